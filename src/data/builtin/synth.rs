//! Synthetic datasets with known truth: mirrors, gloss, diffuse surfaces, a mix, and one material from smooth
//! to rough. Cameras are all around; each photograph comes with its diffuse and specular part. The studio
//! with its floor and lights is that of the built-in scene; rays that leave it see black.

use std::fs;
use std::path::Path;

use glam::{DVec3, dvec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::json;

use super::points::surface_points;
use super::studio::{Albedo, Object, Shape, Studio, objects, to_byte};
use super::{BuiltinPhoto, CALM, DISTANCE, DISTANCE_JITTER, JITTER, Part, TARGET, direction, look_at, render};
use crate::data::{DIFFUSE, PointCloud, SPECULAR, write_png_bytes, write_text};
use crate::{Error, Result};

/// Lowest and highest elevation of the cameras, degrees.
const LOWEST: f64 = 14.0;
const HIGHEST: f64 = 58.0;
/// Real mirrors do not reflect sharper than a pixel: standard deviation, radians.
const POLISHED: f64 = 0.006;
/// Folder of the photographs in a dataset.
const IMAGES: &str = "images";
const TRANSFORMS: &str = "transforms.json";
const POINTS: &str = "points.ply";

/// Materials of a synthetic scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Synth {
    /// A standing mirror, a mirror on the floor and a mirror ball among matte objects: virtual images
    Mirror,
    /// Lacquer and satin metal: broad highlights, no sharp reflections
    Gloss,
    /// Nothing reflects: the specular part is 0
    Diffuse,
    /// Mirrors, gloss and matte surfaces
    Mixed,
    /// Seven balls of one metal, each blurring reflections twice as far as the one before: from 0.5° to 30°
    Rough,
}

/// Cameras and points of a synthetic scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SynthOptions {
    /// Number of photographs, at least [`SynthOptions::LEAST_VIEWS`].
    pub views: u32,
    /// Width and height of each, pixels, at least [`SynthOptions::LEAST_SIZE`].
    pub size: u32,
    /// Number of surface points.
    pub points: usize,
    /// Seed for the positions of cameras and points.
    pub seed: u64,
}

impl SynthOptions {
    /// With fewer views, few places are seen by three photographs, and points need three.
    pub const LEAST_VIEWS: u32 = 8;
    /// With fewer pixels per side, SSIM's window of 11 covers most of the image.
    pub const LEAST_SIZE: u32 = 16;

    fn names(&self) -> impl Iterator<Item = String> {
        let digits = self.views.saturating_sub(1).to_string().len().max(2);
        (0..self.views).map(move |i| format!("view_{i:0digits$}"))
    }

    /// Every file of the dataset, relative to its folder.
    pub fn files(&self) -> Vec<String> {
        let image = |folder: &'static str| self.names().map(move |name| format!("{folder}/{name}.png"));
        let plain = [TRANSFORMS, POINTS].map(str::to_owned);
        [IMAGES, DIFFUSE, SPECULAR].into_iter().flat_map(image).chain(plain).collect()
    }
}

/// A scene and its photographs.
pub struct SynthScene {
    studio: Studio,
    photos: Vec<BuiltinPhoto>,
    points: PointCloud,
}

fn plain(r: f64, g: f64, b: f64) -> Albedo {
    Albedo::Plain(dvec3(r, g, b))
}

fn matt(shape: Shape, albedo: Albedo) -> Object {
    Object { shape, albedo, f0: DVec3::ZERO, blur: 0.1 }
}

fn mirror(shape: Shape, f0: DVec3) -> Object {
    Object { shape, albedo: Albedo::Plain(DVec3::ZERO), f0, blur: POLISHED }
}

fn ball(x: f64, y: f64, radius: f64) -> Shape {
    Shape::Ellipsoid { centre: dvec3(x, y, radius), radii: DVec3::splat(radius) }
}

/// A block on the floor; `half` sizes, `yaw` in degrees.
fn block(x: f64, y: f64, half: [f64; 3], rounding: f64, yaw: f64) -> Shape {
    let half = DVec3::from_array(half);
    Shape::RoundedBox { centre: dvec3(x, y, half.z), half, rounding, yaw: yaw.to_radians() }
}

fn mirrors() -> Vec<Object> {
    let bands = Albedo::Bands { a: dvec3(0.02, 0.25, 0.27), b: dvec3(0.30, 0.42, 0.38), per_unit: 5.0 };
    let marble = Albedo::Marble { a: dvec3(0.45, 0.45, 0.43), b: dvec3(0.06, 0.10, 0.32), scale: 9.0 };
    vec![
        mirror(block(0.05, 0.25, [0.85, 0.06, 0.55], 0.02, 12.0), DVec3::splat(0.85)),
        mirror(block(-0.35, -0.85, [0.55, 0.40, 0.05], 0.02, -10.0), dvec3(0.80, 0.82, 0.85)),
        mirror(ball(-1.05, -0.10, 0.36), dvec3(0.88, 0.86, 0.82)),
        matt(ball(0.45, -0.45, 0.28), plain(0.55, 0.05, 0.04)),
        matt(Shape::Ellipsoid { centre: dvec3(1.05, -0.35, 0.30), radii: dvec3(0.24, 0.24, 0.30) }, bands),
        matt(block(-0.45, -0.80, [0.14, 0.14, 0.14], 0.03, 30.0), plain(0.60, 0.42, 0.05)),
        matt(ball(-0.35, 0.95, 0.30), marble),
        matt(block(0.55, 0.95, [0.20, 0.20, 0.34], 0.05, -24.0), plain(0.05, 0.11, 0.42)),
        matt(
            Shape::Capsule { a: dvec3(1.15, 0.50, 0.16), b: dvec3(1.15, 0.50, 0.62), radius: 0.16 },
            plain(0.10, 0.36, 0.10),
        ),
    ]
}

/// The objects of the built-in scene, each changed according to its number.
fn changed(change: impl Fn(usize, &mut Object)) -> Vec<Object> {
    let mut all = objects();
    all.iter_mut().enumerate().for_each(|(i, object)| change(i, object));
    all
}

impl Synth {
    fn objects(self) -> Vec<Object> {
        match self {
            Synth::Mirror => mirrors(),
            Synth::Gloss => changed(|_, object| object.blur = object.blur.max(7f64.to_radians())),
            Synth::Diffuse => changed(|_, object| {
                // Metals have no diffuse color: use the color of their reflections.
                if object.albedo.mean().length() < object.f0.length() {
                    object.albedo = Albedo::Plain(0.6 * object.f0);
                }
                object.f0 = DVec3::ZERO;
            }),
            Synth::Mixed => changed(|i, object| match i {
                // Chrome and plate become mirrors; pebble, marbled ball and box become diffuse; the others
                // stay glossy.
                0 => (object.f0, object.blur) = (DVec3::splat(0.85), POLISHED),
                3 => (object.f0, object.blur) = (DVec3::splat(0.5), POLISHED),
                2 | 5 | 7 => object.f0 = DVec3::ZERO,
                _ => {}
            }),
            Synth::Rough => {
                let places =
                    [(0.0, 0.0), (0.0, -1.0), (0.87, -0.5), (0.87, 0.5), (0.0, 1.0), (-0.87, 0.5), (-0.87, -0.5)];
                let one = |(i, (x, y)): (usize, (f64, f64))| Object {
                    shape: ball(x, y, 0.36),
                    albedo: Albedo::Plain(DVec3::ZERO),
                    f0: dvec3(0.75, 0.70, 0.62),
                    blur: (0.5 * 60f64.powf(i as f64 / 6.0)).to_radians(),
                };
                places.into_iter().enumerate().map(one).collect()
            }
        }
    }

    /// Makes the scene and renders its photographs. Repeated calls give the same bytes. Between platforms a
    /// byte may differ by one, if their mathematical libraries round differently.
    ///
    /// # Errors
    /// [`Error::Usage`] for too few views or pixels.
    pub fn photograph(self, options: &SynthOptions) -> Result<SynthScene> {
        let SynthOptions { views, size, points, seed } = *options;
        let (least_views, least_size) = (SynthOptions::LEAST_VIEWS, SynthOptions::LEAST_SIZE);
        if views < least_views || size < least_size {
            let what = format!("{views} views of {size} pixels, expected at least {least_views} of {least_size}");
            return Err(Error::Usage(what));
        }
        let studio = Studio::new(self.objects(), DVec3::ZERO);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut signed = || rng.random::<f64>() * 2.0 - 1.0;
        let turn = 180.0 * signed();
        let (low, high) = (LOWEST.to_radians().sin(), HIGHEST.to_radians().sin());
        let golden = 180.0 * (3.0 - 5f64.sqrt());
        let photo = |(i, name): (usize, String)| {
            // Fibonacci's spiral over a band of the sphere: even in total, and even for every eighth view.
            let part = (i as f64 + 0.5) / f64::from(views);
            let azimuth = turn + golden * i as f64 + JITTER * signed();
            let elevation = (low + (high - low) * part).asin().to_degrees() + JITTER * signed();
            let eye = TARGET + direction(azimuth, elevation) * DISTANCE * (1.0 + DISTANCE_JITTER * signed());
            let camera = look_at(eye).resized(size, size);
            let rgb = render(&studio, &camera, Part::All, CALM).iter().map(|&v| to_byte(f64::from(v))).collect();
            BuiltinPhoto { name, camera, is_test: false, rgb }
        };
        let photos: Vec<BuiltinPhoto> = options.names().enumerate().map(photo).collect();
        let (positions, colors) = surface_points(&studio, seed, &photos, points);
        let positions = positions.into_iter().map(|at| at.map(f64::from)).collect();
        Ok(SynthScene { studio, photos, points: PointCloud { positions, colors } })
    }
}

impl SynthScene {
    /// Linear light in 0 to 1 of each photograph, `[size · size · 3]`, rows from the top.
    pub fn truth(&self, part: Part) -> impl Iterator<Item = Vec<f32>> {
        self.photos.iter().map(move |photo| render(&self.studio, &photo.camera, part, CALM))
    }

    /// Writes the [`SynthOptions::files`]: transforms.json, points.ply, images/, and the two parts of each
    /// photograph in diffuse/ and specular/ (sRGB values of linear light that adds up). transforms.json is
    /// written last, so that an incomplete folder is not a dataset.
    pub fn write(&self, folder: impl AsRef<Path>) -> Result<()> {
        let folder = folder.as_ref();
        for part in [IMAGES, DIFFUSE, SPECULAR].map(|part| folder.join(part)) {
            fs::create_dir_all(&part).map_err(|source| Error::io(&part, source))?;
        }
        for photo in &self.photos {
            let (width, height) = (photo.camera.width, photo.camera.height);
            let path = |part: &str| folder.join(part).join(format!("{}.png", photo.name));
            write_png_bytes(path(IMAGES), width, height, &photo.rgb)?;
            for (name, part) in [(DIFFUSE, Part::Diffuse), (SPECULAR, Part::Specular)] {
                let light = render(&self.studio, &photo.camera, part, CALM);
                let bytes: Vec<u8> = light.iter().map(|&v| to_byte(f64::from(v))).collect();
                write_png_bytes(path(name), width, height, &bytes)?;
            }
        }
        let mut cloud = format!("ply\nformat ascii 1.0\nelement vertex {}\n", self.points.positions.len());
        ["x", "y", "z"].iter().for_each(|name| cloud += &format!("property float {name}\n"));
        ["red", "green", "blue"].iter().for_each(|name| cloud += &format!("property uchar {name}\n"));
        cloud += "end_header\n";
        for (place, [r, g, b]) in self.points.positions.iter().zip(&self.points.colors) {
            let [x, y, z] = place.map(|v| v as f32);
            cloud += &format!("{x} {y} {z} {r} {g} {b}\n");
        }
        write_text(folder.join(POINTS), &cloud)?;
        let camera = self.photos[0].camera;
        let frames: Vec<_> = self.photos.iter().map(frame).collect();
        let transforms = json!({
            "camera_model": "PINHOLE", "w": camera.width, "h": camera.height, "fl_x": camera.fx, "fl_y": camera.fy,
            "cx": camera.cx, "cy": camera.cy, "ply_file_path": POINTS, "frames": frames,
        });
        write_text(folder.join(TRANSFORMS), &format!("{transforms:#}\n"))
    }
}

/// A frame of transforms.json: camera to world, OpenGL axes.
fn frame(photo: &BuiltinPhoto) -> serde_json::Value {
    let (rotation, eye) = (photo.camera.rotation, photo.camera.eye());
    let (right, up, back) = (rotation.row(0), -rotation.row(1), -rotation.row(2));
    let row = |i: usize| [right[i], up[i], back[i], eye[i]];
    let matrix = [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]];
    json!({"file_path": format!("{IMAGES}/{}.png", photo.name), "transform_matrix": matrix})
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Dataset, DatasetKind, DatasetOptions, Split};

    const SMALL: SynthOptions = SynthOptions { views: 12, size: 24, points: 60, seed: 3 };
    const ALL: [Synth; 5] = [Synth::Mirror, Synth::Gloss, Synth::Diffuse, Synth::Mixed, Synth::Rough];

    #[test]
    fn a_dataset_is_read_as_it_was_made() {
        let folder = tempfile::tempdir().unwrap();
        let scene = Synth::Mixed.photograph(&SMALL).unwrap();
        scene.write(folder.path()).unwrap();
        let dataset = Dataset::open(folder.path(), &DatasetOptions::default()).unwrap();
        assert_eq!((dataset.kind, dataset.photos.len()), (DatasetKind::Transforms, 12));
        assert_eq!(dataset.split(Split::Test).count(), 2);
        assert_eq!(dataset.points.as_ref(), Some(&scene.points));
        assert!(dataset.notes.is_empty(), "{:?}", dataset.notes);
        for (photo, made) in dataset.photos.iter().zip(&scene.photos) {
            let off = (photo.camera.rotation - made.camera.rotation).to_cols_array();
            assert!(
                off.iter().all(|v| v.abs() < 1e-12)
                    && photo.camera.translation.distance(made.camera.translation) < 1e-9
            );
            assert_eq!((photo.camera.fx, photo.camera.cx), (made.camera.fx, made.camera.cx));
            assert_eq!(photo.load([0.0; 3]).unwrap().rgb, made.rgb);
            let part = |part| photo.part(part).unwrap().unwrap().load([0.0; 3]).unwrap().rgb;
            assert!(part(DIFFUSE) != part(SPECULAR) && part(DIFFUSE) != made.rgb);
        }
    }

    /// Fraction of each scene's light that comes from reflection: none, some, or most of it with mirrors.
    #[test]
    fn scenes_shine_as_much_as_their_names_say() {
        let shares = ALL.map(|synth| {
            let scene = synth.photograph(&SynthOptions { views: 8, size: 16, ..SMALL }).unwrap();
            let sum = |part| scene.truth(part).flatten().map(f64::from).sum::<f64>();
            let parts = scene.truth(Part::All).zip(scene.truth(Part::Diffuse)).zip(scene.truth(Part::Specular));
            for ((all, diffuse), specular) in parts {
                let worst = all.iter().zip(&diffuse).zip(&specular).map(|((a, d), s)| (a - d - s).abs());
                // Sums of sixteen float32 numbers.
                assert!(worst.fold(0.0, f32::max) < 1e-6);
            }
            sum(Part::Specular) / sum(Part::All)
        });
        let [mirror, gloss, diffuse, mixed, rough] = shares;
        assert_eq!(diffuse, 0.0);
        // `mixed` also has matt objects.
        assert!(
            gloss > 0.02 && mixed > 0.02 && [mirror, gloss, rough].iter().all(|share| *share > mixed),
            "{shares:?}"
        );
    }

    /// The standing mirror shows virtual images behind it: a virtual point looks the same from two cameras,
    /// though they see it through distant places on the mirror.
    #[test]
    fn a_mirror_shows_virtual_images() {
        let studio = Studio::new(Synth::Mirror.objects(), DVec3::ZERO);
        let Shape::RoundedBox { centre, half, yaw, .. } = &studio.objects[0].shape else {
            panic!("the mirror is first")
        };
        let normal = glam::DMat3::from_rotation_z(*yaw) * DVec3::NEG_Y;
        let face = *centre + half.y * normal;
        // The red ball's nearest side to the mirror, and the position of its image.
        let at = studio.objects[3].shape.centre() - 0.28 * normal;
        let image = at - 2.0 * (at - face).dot(normal) * normal;
        let mut seen = Vec::new();
        for azimuth in [0.0, 10.0, 25.0] {
            let eye = face + direction(azimuth, 35.0) * DISTANCE;
            let d = (image - eye).normalize();
            let hit = studio.trace(eye, d).unwrap();
            if hit.normal.distance(normal) > 1e-9 {
                continue;
            }
            let (diffuse, specular) = studio.shade(&hit, d, 1);
            assert_eq!(diffuse, DVec3::ZERO);
            assert!(image.distance(eye) > hit.point.distance(eye) + 0.1);
            seen.push((hit.point, specular));
        }
        let [(a, first), .., (b, last)] = seen[..] else { panic!("the image is hidden: {seen:?}") };
        assert!(a.distance(b) > 0.1, "{a} {b}");
        // Red, and equal except for Schlick's grazing term.
        assert!(first.x > 3.0 * first.y && (first - last).abs().max_element() < 0.02 * first.x, "{first} {last}");
    }
}
