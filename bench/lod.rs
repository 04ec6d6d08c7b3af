//! Measures levels of detail. Renders of merged scenes against renders of the whole one (PSNR), beside as many Gaussians drawn at random,
//! and beside those of the greatest opacity times area:
//!
//!     cargo bench --bench lod -- SCENE.ply DATASET [--levels N] [--size PIXELS]
//!
//! Without a scene, a synthetic land of `--gaussians` (5 million by default) is written as streamed SOG by `glint convert`, whose time and
//! memory (on Linux) are printed; then its coarsest level is compared as written.

use std::{fs, path::PathBuf, process::Command, process::ExitCode, time::Duration, time::Instant};

use clap::Parser;
use glam::{DMat3, DVec3};
use glint::{
    Error, Result,
    data::{Dataset, DatasetOptions, Split, lod, read_scene, write_scene},
    gpu::{Context, ContextOptions},
    pipelines::{
        layers::{Layer, Layers},
        render::RenderOptions,
        start::photos_of,
    },
    scene::{Camera, Gaussians, Scene},
};

#[derive(Parser)]
struct Args {
    /// A scene, and the dataset whose test views are rendered
    #[arg(num_args = 0..=2, value_names = ["SCENE", "DATASET"])]
    scene: Vec<PathBuf>,
    #[arg(long, default_value_t = 5_000_000)]
    gaussians: usize,
    /// Each level has half of the Gaussians of the one before
    #[arg(long, default_value_t = 5)]
    levels: u8,
    /// Longest side of a view
    #[arg(long, default_value_t = 512)]
    size: u32,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let result = match &args.scene[..] {
        [scene, dataset] => compare(&args, scene, dataset),
        [] => stream(&args),
        _ => Err(Error::Usage("expected a scene and a dataset, or neither".into())),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("lod: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// Renders of a scene from some cameras, to compare others with.
struct Judge {
    context: Context,
    cameras: Vec<Camera>,
    whole: Vec<Vec<f32>>,
}

impl Judge {
    fn new(scene: &Scene, cameras: Vec<Camera>) -> Result<Judge> {
        let context = Context::new(&ContextOptions::default())?;
        let mut judge = Judge { context, cameras, whole: Vec::new() };
        judge.whole = judge.views(scene)?;
        Ok(judge)
    }

    fn views(&self, scene: &Scene) -> Result<Vec<Vec<f32>>> {
        let mut layers = Layers::new(&self.context, scene, self.cameras.iter(), RenderOptions::default())?;
        self.cameras.iter().map(|camera| Ok(layers.render(Layer::Whole, camera, [0.0; 3])?.color)).collect()
    }

    /// Mean PSNR, dB.
    fn psnr(&self, scene: &Scene, base: Gaussians) -> Result<f64> {
        let views = self.views(&Scene { base, origin: scene.origin, ..Default::default() })?;
        Ok(views.iter().zip(&self.whole).map(|(a, b)| psnr(a, b)).sum::<f64>() / views.len() as f64)
    }

    /// Prints a line: a level, and as many Gaussians of the scene at random and by mass.
    fn line(&self, scene: &Scene, level: &Gaussians, seconds: f64) -> Result<()> {
        let n = level.len();
        // Fibonacci hashing: as good as random, and always the same.
        let mut drawn: Vec<usize> = (0..scene.base.len()).collect();
        drawn.sort_by_key(|&i| (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let by_mass = by_mass(&scene.base);
        let [random, massive] = [&drawn, &by_mass].map(|order| self.psnr(scene, scene.base.reordered(&order[..n])));
        println!("{n:>9} {:>9.2} {:>8.2} {:>8.2} {seconds:>8.2}", self.psnr(scene, level.clone())?, random?, massive?);
        Ok(())
    }
}

fn heading() {
    println!("{:>9} {:>9} {:>8} {:>8} {:>8}", "Gaussians", "merged dB", "random", "by mass", "seconds");
}

fn compare(args: &Args, scene: &PathBuf, dataset: &PathBuf) -> Result<()> {
    let scene = read_scene(scene)?;
    let options = DatasetOptions { max_size: Some(args.size), ..Default::default() };
    let dataset = Dataset::open(dataset, &options)?;
    let cameras = photos_of(&dataset, Some(Split::Test))?.into_iter().map(|photo| photo.camera).collect();
    let judge = Judge::new(&scene, cameras)?;
    let mut level = scene.base.clone();
    heading();
    for _ in 1..args.levels {
        let start = Instant::now();
        level = lod::coarser(&level, level.len().div_ceil(2)).0;
        judge.line(&scene, &level, start.elapsed().as_secs_f64())?;
    }
    Ok(())
}

fn stream(args: &Args) -> Result<()> {
    let folder = tempfile::tempdir().map_err(|error| Error::io("temporary folder", error))?;
    let (input, output) = (folder.path().join("land.ply"), folder.path().join("web/lod-meta.json"));
    let scene = Scene { base: land(args.gaussians), ..Default::default() };
    write_scene(&input, &scene)?;
    let start = Instant::now();
    let fail = |error| Error::io("glint convert", error);
    let mut child = Command::new(env!("CARGO_BIN_EXE_glint"))
        .args(["convert", "--lod", &args.levels.to_string()])
        .args([&input, &output])
        .spawn()
        .map_err(fail)?;
    let mut peak = 0;
    while child.try_wait().map_err(fail)?.is_none() {
        let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        peak = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok()).unwrap_or(peak);
        std::thread::sleep(Duration::from_millis(50));
    }
    let seconds = start.elapsed().as_secs_f64();
    let megabytes = |bytes: u64| bytes as f64 / 1e6;
    let of_input = fs::metadata(&input).map_or(0, |found| found.len());
    println!(
        "glint convert: {seconds:.1} s, {:.0} MB of memory, input {:.0} MB",
        megabytes(peak * 1024),
        megabytes(of_input)
    );
    let last = args.levels - 1;
    let mut level = Gaussians { sh_degree: scene.base.sh_degree, ..Default::default() };
    for file in 0.. {
        let unit = output.with_file_name(format!("{last}_{file}"));
        if !unit.exists() {
            break;
        }
        level.append(read_scene(unit)?.base);
    }
    let cameras = (0..6).map(|i| camera(f64::from(i), args.size)).collect();
    heading();
    Judge::new(&scene, cameras)?.line(&scene, &level, seconds)
}

/// Gaussians in descending order of opacity times area.
fn by_mass(gaussians: &Gaussians) -> Vec<usize> {
    let mass = |i: usize| {
        let [x, y, z] = gaussians.log_scales[i].map(f32::exp);
        (x * y + y * z + z * x) / (1.0 + (-gaussians.opacities[i]).exp())
    };
    let mut order: Vec<usize> = (0..gaussians.len()).collect();
    order.sort_by(|&i, &j| mass(j).total_cmp(&mass(i)));
    order
}

/// Discs on a hilly square of 100 units, with colors of several wavelengths, some of a Gaussian's size.
fn land(count: usize) -> Gaussians {
    let side = (count as f64).sqrt().ceil();
    let spacing = 100.0 / side;
    let noise =
        |i: usize, k: u64| (i as u64 * 8 + k).wrapping_mul(0x9e37_79b9_7f4a_7c15) as f64 / u64::MAX as f64 - 0.5;
    let mut out = Gaussians { sh_degree: 3, ..Default::default() };
    for i in 0..count {
        let [x, z] = [(i as f64 % side).floor(), (i as f64 / side).floor()];
        let [x, z] = [(x + noise(i, 0)) * spacing - 50.0, (z + noise(i, 1)) * spacing - 50.0];
        let y = 2.0 * (0.21 * x).sin() * (0.17 * z).cos() + 0.3 * (1.3 * x + 0.7 * z).sin();
        let hue = |phase: f64| (0.4 * x + phase).sin() * (0.5 * z).cos() + 0.5 * (5.0 * x - 3.0 * z + phase).sin();
        out.means.push([x, y, z].map(|v| v as f32));
        // Two axes in the ground, one across it.
        out.log_scales.push([0.7 * spacing, 0.1 * spacing, 0.7 * spacing].map(|v| v.ln() as f32));
        out.quats.push([1.0, 0.0, 0.0, 0.0]);
        out.opacities.push(2.0 * noise(i, 2) as f32 + 1.5);
        out.sh.push([0.0, 2.0, 4.0].map(|phase| (hue(phase) + noise(i, 3)) as f32));
        out.sh.extend((1..16).map(|k| [0.1 * noise(i, 4 + k % 4) as f32; 3]));
    }
    out
}

/// Over the land, in a circle, looking down at its middle.
fn camera(i: f64, size: u32) -> Camera {
    let eye = DVec3::new(30.0 * i.cos(), -15.0, 30.0 * i.sin());
    let forward = -eye.normalize();
    let right = DVec3::Y.cross(forward).normalize();
    let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
    Camera { rotation, translation: -(rotation * eye), ..Camera::new(size, size, f64::from(size) * 0.8) }
}

fn psnr(a: &[f32], b: &[f32]) -> f64 {
    let off = |(&a, &b): (&f32, &f32)| f64::from(a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0)).powi(2);
    -10.0 * (a.iter().zip(b).map(off).sum::<f64>() / a.len() as f64).log10()
}
