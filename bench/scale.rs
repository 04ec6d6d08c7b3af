//! Cuts and merges synthetic cities, and prints CPU time and memory by size. Linux only.
//!
//!     cargo bench --bench scale -- FOLDER PHOTOS:GAUSSIANS...
//!
//! Cameras stand a meter apart on both sides of the streets of a square grid. Each photo adds 100 points, which seven photos in a row see.
//! For each size, a COLMAP model and photos of 4 × 3 pixels are written to FOLDER and read, cut into parts of at most 500 training photos,
//! and a part is opened. Then a scene for each part, with Gaussians around its own seeds and a sixth around seeds of other parts, is written,
//! and all are merged. The last line has the exponents of growth by photos, those of the merge by Gaussians.

use std::{
    fs::{self, File},
    io::{BufWriter, Write},
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::Parser;
use glam::{DMat3, DQuat, DVec3};
use glint::{
    Error, Result,
    data::{
        Dataset, DatasetOptions, PartOf, TrainedWith, merge,
        plan::{Limits, Plan, cut},
        write_ply, write_png_rgb,
    },
    scene::{Camera, Gaussians, Scene},
};

/// Distance of two streets, m, and of a street's middle from its houses and from the camera.
const STREETS: usize = 60;
const HOUSES: f64 = 10.0;
const CAMERA: f64 = 3.0;
/// Points that a photo adds, photos that see each of them, and keypoints without a point.
const POINTS: usize = 100;
const TRACK: usize = 7;
const OTHERS: usize = 300;
const PART: usize = 500;

#[derive(Parser)]
struct Args {
    /// Folder for temporary files: 38 kB for each photo and 150 bytes for each Gaussian of the largest size
    folder: PathBuf,
    #[arg(required = true, value_name = "PHOTOS:GAUSSIANS", value_parser = size)]
    sizes: Vec<(usize, usize)>,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn size(text: &str) -> Result<(usize, usize), String> {
    let sizes =
        text.split_once(':').and_then(|(photos, gaussians)| Some((photos.parse().ok()?, gaussians.parse().ok()?)));
    sizes.ok_or_else(|| "expected two numbers, such as 1000:10000000".into())
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("scale: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(args: &Args) -> Result<()> {
    println!("                               read         cut            part           merge");
    println!("  photos  Gaussians parts     s     MB     s     MB     s     MB      s     MB");
    let mut rows = Vec::new();
    for &(photos, gaussians) in &args.sizes {
        let row = measure(&args.folder, photos, gaussians)?;
        rows.push((photos, gaussians, row));
    }
    print!("exponent                 ");
    for k in 0..8 {
        let of = |(photos, gaussians, row): &(usize, usize, [f64; 8])| {
            ((if k < 6 { *photos } else { *gaussians } as f64).ln(), row[k].ln())
        };
        print!(" {:>6.2}", slope(&rows.iter().map(of).collect::<Vec<_>>()));
    }
    println!();
    Ok(())
}

/// Slope of the line with the least squared distances.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (x, y) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let sum = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>();
    sum(&|p| (p.0 - x) * (p.1 - y)) / sum(&|p| (p.0 - x).powi(2))
}

/// CPU seconds and peak of memory, MB, of reading, cutting, opening a part and merging.
fn measure(folder: &Path, photos: usize, gaussians: usize) -> Result<[f64; 8]> {
    let folder = tempfile::tempdir_in(folder).map_err(|error| Error::io(folder, error))?;
    let (city, path) = (folder.path().join("city"), folder.path().join("plan.json"));
    write_city(&city, photos).map_err(|error| Error::io(&city, error))?;
    let options = DatasetOptions::default();
    let (dataset, read) = stage(|| Dataset::open(&city, &options))?;
    let limits = Limits { photos: PART, gaussians: usize::MAX, total: gaussians };
    let (plan, cut) = stage(|| {
        let plan = cut(&dataset, &city, &options, limits, &mut Vec::new())?;
        plan.write(&path)?;
        Ok(plan)
    })?;
    drop((dataset, plan));
    let (plan, part) = stage(|| {
        let plan = Plan::read(&path)?;
        plan.open(&path, 0)?;
        Ok(plan)
    })?;
    let files = write_parts(&plan, gaussians, folder.path())?;
    let (parts, merge) = stage(|| merge(&plan, &files, &folder.path().join("merged.ply"), |_| {}))?;
    let row: Vec<f64> = [read, cut, part, merge].concat();
    print!("{photos:>8} {:>10} {:>5}", parts.iter().map(|part| part.kept).sum::<usize>(), parts.len());
    row.iter().for_each(|value| print!(" {value:>6.1}"));
    println!();
    Ok(std::array::from_fn(|k| row[k]))
}

/// Runs `work`. Returns its result, its CPU seconds of all threads, and its peak of memory, MB.
fn stage<T>(work: impl FnOnce() -> Result<T>) -> Result<(T, [f64; 2])> {
    fs::write("/proc/self/clear_refs", "5").map_err(|error| Error::io("/proc/self/clear_refs", error))?;
    let start = cpu_seconds()?;
    let result = work()?;
    let seconds = cpu_seconds()? - start;
    let text = proc_file("/proc/self/status")?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes: f64 = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(f64::NAN);
    Ok((result, [seconds, kilobytes * 1024.0 / 1e6]))
}

/// CPU time of this process so far, user and system.
fn cpu_seconds() -> Result<f64> {
    let text = proc_file("/proc/self/stat")?;
    // Fields 14 and 15, in hundredths; the second field is a name in parentheses.
    let fields = text.rsplit(')').next().unwrap_or_default().split_whitespace().skip(11).take(2);
    Ok(fields.filter_map(|field| field.parse::<f64>().ok()).sum::<f64>() / 100.0)
}

fn proc_file(path: &str) -> Result<String> {
    fs::read_to_string(path).map_err(|error| Error::io(path, error))
}

/// From −½ to ½, always the same for a number.
fn noise(number: usize) -> f64 {
    // Fibonacci hashing, twice.
    let hash = (number as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    (hash ^ (hash >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) as f64 / u64::MAX as f64 - 0.5
}

/// A way along one side of a street.
struct City {
    length: usize,
}

impl City {
    fn new(photos: usize) -> City {
        City { length: STREETS * (photos as f64 / (4 * STREETS) as f64).sqrt().ceil() as usize }
    }

    /// From meters along the way of a photo, across the street towards its houses, and up, to the world, whose y points down.
    fn place(&self, photo: usize, along: f64, across: f64, up: f64) -> DVec3 {
        let way = photo / self.length;
        let across = (way / 4 * STREETS) as f64 + if (way / 2).is_multiple_of(2) { across } else { -across };
        if way.is_multiple_of(2) { DVec3::new(along, -up, across) } else { DVec3::new(across, -up, along) }
    }

    fn camera(&self, photo: usize) -> Camera {
        let along = (photo % self.length) as f64;
        let eye = self.place(photo, along, -CAMERA, 1.7);
        let forward = (self.place(photo, along + 1.0, 1.0 - CAMERA, 1.7) - eye).normalize();
        let right = DVec3::Y.cross(forward);
        let rotation = DMat3::from_cols(right, DVec3::Y, forward).transpose();
        Camera { rotation, translation: -(rotation * eye), ..Camera::new(1600, 1200, 800.0) }
    }

    /// Most points are on houses; a fifth is on the ground, and all are at crossings.
    fn point(&self, photo: usize, number: usize) -> DVec3 {
        let [along, across, up] = std::array::from_fn(|k| noise((photo * POINTS + number) * 3 + k));
        let along = (photo % self.length) as f64 + HOUSES + CAMERA + 12.0 * along;
        let from_crossing = (along + 0.5 * STREETS as f64).rem_euclid(STREETS as f64) - 0.5 * STREETS as f64;
        match number.is_multiple_of(5) || from_crossing.abs() < HOUSES {
            true => self.place(photo, along, HOUSES * (0.5 + across), 0.0),
            false => self.place(photo, along, HOUSES + 0.5 * across, 10.0 * (0.5 + up)),
        }
    }
}

/// Writes a COLMAP model, and photos that are links to a few files.
fn write_city(folder: &Path, photos: usize) -> std::io::Result<()> {
    let (model, pictures, city) = (folder.join("sparse/0"), folder.join("images"), City::new(photos));
    fs::create_dir_all(&model)?;
    fs::create_dir_all(&pictures)?;
    let start = |name: &str, count: usize| {
        let mut file = BufWriter::with_capacity(1 << 20, File::create(model.join(name))?);
        file.write_all(&(count as u64).to_le_bytes())?;
        Ok::<_, std::io::Error>(file)
    };
    let mut file = start("cameras.bin", 1)?;
    // Camera 1 is a PINHOLE.
    file.write_all(bytemuck::bytes_of(&[1u32, 1]))?;
    file.write_all(bytemuck::bytes_of(&[1600u64, 1200]))?;
    file.write_all(bytemuck::bytes_of(&[800f64, 800.0, 800.0, 600.0]))?;
    file.flush()?;
    let (mut images, mut points) = (start("images.bin", photos)?, start("points3D.bin", photos * POINTS)?);
    let mut first_link = PathBuf::new();
    for photo in 0..photos {
        let (name, camera) = (format!("{photo:06}.png"), city.camera(photo));
        let turn = DQuat::from_mat3(&camera.rotation);
        images.write_all(&(photo as u32 + 1).to_le_bytes())?;
        images.write_all(bytemuck::bytes_of(&[turn.w, turn.x, turn.y, turn.z]))?;
        images.write_all(bytemuck::bytes_of(&camera.translation.to_array()))?;
        images.write_all(&1u32.to_le_bytes())?;
        images.write_all(name.as_bytes())?;
        images.write_all(&[0])?;
        let seen = photo.saturating_sub(TRACK - 1)..photo + 1;
        images.write_all(&((seen.len() * POINTS + OTHERS) as u64).to_le_bytes())?;
        for number in seen.start * POINTS..seen.end * POINTS {
            let (x, y, _) = camera.project(city.point(number / POINTS, number % POINTS));
            images.write_all(bytemuck::bytes_of(&[x, y]))?;
            images.write_all(&(number as u64).to_le_bytes())?;
        }
        images.write_all(&[255; 24 * OTHERS])?;
        let seen_by = photo..photos.min(photo + TRACK);
        for number in 0..POINTS {
            points.write_all(&((photo * POINTS + number) as u64).to_le_bytes())?;
            points.write_all(bytemuck::bytes_of(&city.point(photo, number).to_array()))?;
            points.write_all(&[128; 3])?;
            points.write_all(bytemuck::bytes_of(&[0.5f64.to_bits(), seen_by.len() as u64]))?;
            for image in seen_by.clone() {
                let place = (photo - image.saturating_sub(TRACK - 1)) * POINTS + number;
                points.write_all(bytemuck::bytes_of(&[image as u32 + 1, place as u32]))?;
            }
        }
        // File systems limit the number of links to a file.
        let path = pictures.join(name);
        if photo.is_multiple_of(10_000) {
            write_png_rgb(&path, 4, 3, &[0.5; 36]).map_err(std::io::Error::other)?;
            first_link = path;
        } else {
            fs::hard_link(&first_link, path)?;
        }
    }
    images.flush()?;
    points.flush()
}

/// Writes a scene of constant colors for each part.
fn write_parts(plan: &Plan, gaussians: usize, folder: &Path) -> Result<Vec<PathBuf>> {
    let seeds: Vec<[f64; 6]> = plan.parts.iter().flat_map(|part| &part.seeds).copied().collect();
    let (id, of) = (plan.id(), plan.parts.len() as u32);
    let write = |(number, part): (usize, &glint::data::plan::Part)| {
        let count = gaussians * part.seeds.len() / seeds.len();
        let near = part.near.iter().map(|&near| seeds[near as usize]).collect::<Vec<_>>();
        let more = if near.is_empty() { 0 } else { count / 5 };
        let mut base = Gaussians::default();
        for i in 0..count + more {
            let [x, y, z, ..] = if i < count { part.seeds[i % part.seeds.len()] } else { near[i % near.len()] };
            let off = |k: usize| noise(i * 3 + k);
            base.means.push([x + off(0), y + off(1), z + off(2)].map(|v| v as f32));
            base.log_scales.push([-3.0; 3]);
            base.quats.push([1.0, 0.0, 0.0, 0.0]);
            base.opacities.push(1.0);
            base.sh.push([0.5; 3]);
        }
        let path = folder.join(format!("{number}.ply"));
        let part = Some(PartOf { plan: id, part: number as u32, of, complete: true });
        let scene = Scene { base, ..Default::default() };
        write_ply(&path, &scene, None, TrainedWith { part, ..Default::default() })?;
        Ok(path)
    };
    plan.parts.iter().enumerate().map(write).collect()
}
