//! The built-in scene: a small studio shot of glossy and mirror-like objects on a diffuse floor. It is ray
//! traced analytically in f64, with exact cameras and a point cloud like that of structure from motion.
//!
//! It demonstrates the gain of view-dependent opacity over spherical harmonics. A surface point lights up
//! over a cone of view directions 12 to 19° wide (at half its brightness): too narrow for harmonics of degree
//! 3, but wide enough to be seen by several neighbouring cameras, which are 5 to 9° apart.
//!
//! Reflection model: the mirror direction sees rectangular lights, blurred by a Gaussian of the material's
//! own width. For a rectangle this is a product of error functions; the images use no random sampling. The
//! scene is bounded: a ray that leaves it sees one constant background, reflected rays see the studio.
//!
//! World axes: z up, the floor is z = 0, cameras look along +y. Lengths are scene units, angles radians, light is linear
//! and dimensionless (1 = white of the photograph).

mod points;
mod studio;
pub mod synth;

use std::sync::Arc;

use glam::{DMat3, DVec3, dvec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::{Dataset, Image, Photo, PixelSource, PointCloud, Split};
use crate::scene::Camera;
use points::surface_points;
use studio::{BACKGROUND, Sample, Studio, View, studio, to_byte};

/// Width and height of a photograph, pixels.
pub const SIZE: u32 = 128;
/// Focal length at [`SIZE`], pixels: a field of view of 25.8°, so that the objects fill the frame from [`DISTANCE`].
const FOCAL: f64 = 280.0;
/// Distance of the cameras from their target, scene units.
const DISTANCE: f64 = 6.0;
/// Point that the cameras look at.
const TARGET: DVec3 = dvec3(0.0, 0.05, 0.22);
/// Cameras are on a grid of azimuths by elevations, odd rows half a step to the right.
const COLUMNS: usize = 8;
const ROWS: usize = 7;
/// Azimuth span of a row, degrees; neighbours in a row are then 13.5° of azimuth or about 10° of arc apart.
const AZIMUTH_SPAN: f64 = 94.5;
/// Lowest elevation and elevation span, degrees: rows are 5.8° apart.
const ELEVATION: f64 = 24.0;
const ELEVATION_SPAN: f64 = 35.0;
/// Maximum jitter of a camera: in azimuth and elevation, degrees, and in distance, relative.
const JITTER: f64 = 1.2;
const DISTANCE_JITTER: f64 = 0.02;
/// Grid cells (row, column) of the test cameras: none at the border, no two adjacent.
const TEST_CELLS: [(usize, usize); 8] = [(1, 1), (1, 4), (1, 6), (3, 2), (3, 5), (5, 1), (5, 3), (5, 6)];
/// Four samples suffice if a pixel's corners hit one object and differ by less than this (square roots of
/// linear light, which are near sRGB). Compared with sixteen, one value in 10,000 then differs by more than
/// an 8-bit step.
const CALM: f64 = 4.0 / 255.0;
const SEED: u64 = 0x0067_6c69_6e74;

/// A photograph of the built-in scene.
#[derive(Debug, Clone)]
pub struct BuiltinPhoto {
    /// File name without extension, `view_00` to `view_55` in grid order.
    pub name: String,
    /// Pose and lens of the traced view, at the size of `rgb`.
    pub camera: Camera,
    /// Whether it is held out for testing.
    pub is_test: bool,
    /// 8-bit sRGB, `[height · width · 3]`, rows from the top.
    pub rgb: Vec<u8>,
}

/// Photographs, cameras and points of the built-in scene.
#[derive(Debug, Clone)]
pub struct BuiltinScene {
    /// 48 training and 8 test photographs of 128 × 128, in grid order.
    pub photos: Vec<BuiltinPhoto>,
    /// Surface points, scene units; every prefix is spread as evenly as the whole.
    pub point_positions: Vec<[f32; 3]>,
    /// Their colors, 8-bit sRGB, the mean over the training photographs that see them.
    pub point_colors: Vec<[u8; 3]>,
    /// sRGB in [0, 1], the color of rays that leave the scene; a multiple of 1/255.
    pub background: [f32; 3],
}

/// Selects the part of the light that [`render_truth`] returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// All light, as a photograph shows it.
    All,
    /// The part independent of the view: albedo times irradiance, and the background.
    Diffuse,
    /// The reflected part. `All = Diffuse + Specular`, each sample clipped at white first.
    Specular,
}

impl BuiltinScene {
    /// The scene as a dataset in memory.
    pub fn dataset(&self) -> Dataset {
        let image =
            |p: &BuiltinPhoto| Image { width: p.camera.width, height: p.camera.height, rgb: p.rgb.clone(), mask: None };
        let photo = |p: &BuiltinPhoto| Photo {
            name: p.name.clone(),
            camera: p.camera,
            split: if p.is_test { Split::Test } else { Split::Train },
            pixels: PixelSource::Memory(Arc::new(image(p))),
        };
        Dataset {
            photos: self.photos.iter().map(photo).collect(),
            points: Some(PointCloud {
                positions: self.point_positions.iter().map(|at| at.map(f64::from)).collect(),
                colors: self.point_colors.clone(),
            }),
            background: self.background,
            ..Dataset::default()
        }
    }
}

/// Makes the built-in scene with `points` surface points. Repeated calls give the same bytes. Between
/// platforms a byte may differ by one, if their mathematical libraries round differently.
pub fn builtin_scene(points: usize) -> BuiltinScene {
    let photos: Vec<BuiltinPhoto> = cameras()
        .into_iter()
        .enumerate()
        .map(|(i, (camera, is_test))| {
            let rgb = render_truth(&camera, Part::All).iter().map(|&v| to_byte(v as f64)).collect();
            BuiltinPhoto { name: format!("view_{i:02}"), camera, is_test, rgb }
        })
        .collect();
    let (point_positions, point_colors) = surface_points(studio(), SEED, &photos, points);
    BuiltinScene { photos, point_positions, point_colors, background: BACKGROUND.map(|b| b as f32 / 255.0) }
}

/// Renders the scene from `camera` without quantisation: linear light in [0, 1], `[height · width · 3]`, rows from the top.
pub fn render_truth(camera: &Camera, part: Part) -> Vec<f32> {
    render(studio(), camera, part, CALM)
}

fn render(studio: &Studio, camera: &Camera, part: Part, calm: f64) -> Vec<f32> {
    let view = View { camera, eye: camera.eye() };
    let (width, height) = (camera.width as usize, camera.height as usize);
    let corner = |y: usize| -> Vec<Sample> { (0..=width).map(|x| studio.sample(&view, x as f64, y as f64)).collect() };
    let corners: Vec<Vec<Sample>> = (0..=height).into_par_iter().map(corner).collect();
    let mut image = vec![0.0f32; width * height * 3];
    // A camera without pixels has an empty image, without rows to split.
    image.par_chunks_mut((width * 3).max(1)).enumerate().for_each(|(y, row)| {
        for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
            let around = [corners[y][x], corners[y][x + 1], corners[y + 1][x], corners[y + 1][x + 1]];
            let light = studio.pixel(&view, x as f64, y as f64, part, around, calm);
            pixel.copy_from_slice(&light.as_vec3().to_array());
        }
    });
    image
}

/// The 56 cameras in grid order, row by row from the lowest, each with a flag for test cameras.
fn cameras() -> Vec<(Camera, bool)> {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut jitter = || rng.random::<f64>() * 2.0 - 1.0;
    let mut cameras = Vec::with_capacity(ROWS * COLUMNS);
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            let stagger = if row % 2 == 1 { 0.25 } else { -0.25 };
            let along = (column as f64 + stagger) / (COLUMNS - 1) as f64 - 0.5;
            let azimuth = AZIMUTH_SPAN * along + JITTER * jitter();
            let elevation = ELEVATION + ELEVATION_SPAN * row as f64 / (ROWS - 1) as f64 + JITTER * jitter();
            let eye = TARGET + direction(azimuth, elevation) * DISTANCE * (1.0 + DISTANCE_JITTER * jitter());
            cameras.push((look_at(eye), TEST_CELLS.contains(&(row, column))));
        }
    }
    cameras
}

fn look_at(eye: DVec3) -> Camera {
    let forward = (TARGET - eye).normalize();
    let right = forward.cross(DVec3::Z).normalize();
    let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
    Camera { rotation, translation: -(rotation * eye), ..Camera::new(SIZE, SIZE, FOCAL) }
}

/// Unit vector at an azimuth (0 toward the cameras, −y; growing toward +x) and an elevation, both in degrees.
fn direction(azimuth: f64, elevation: f64) -> DVec3 {
    let ((sa, ca), (se, ce)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
    dvec3(sa * ce, -ca * ce, se)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neighbouring cameras are near enough for a highlight (7° to either side) to persist from one to the
    /// next.
    #[test]
    fn every_test_camera_has_training_cameras_within_10_degrees() {
        let cameras = cameras();
        let toward = |c: &Camera| (c.eye() - TARGET).normalize();
        for (test, _) in cameras.iter().filter(|c| c.1) {
            let angles = cameras.iter().filter(|c| !c.1).map(|c| toward(&c.0).angle_between(toward(test)).to_degrees());
            let near = angles.filter(|a| *a < 10.0).count();
            assert!(near >= 3, "{near} training cameras within 10° of a test camera");
        }
    }

    /// Two tiny views of the scene: all light, and its diffuse part. After an intended change of the scene,
    /// the failing assertion prints the new values.
    #[test]
    fn the_scene_is_what_it_was() {
        let mut seen = String::new();
        for camera in [9, 44].map(|i| cameras()[i].0.resized(8, 8)) {
            for part in [Part::All, Part::Diffuse] {
                let bytes = render_truth(&camera, part).iter().map(|v| to_byte(f64::from(*v))).collect::<Vec<u8>>();
                bytes.iter().for_each(|byte| seen += &format!("{byte:02x}"));
            }
        }
        let bytes = |text: &str| -> Vec<u8> {
            text.as_bytes().chunks(2).map(|two| u8::from_str_radix(str::from_utf8(two).unwrap(), 16).unwrap()).collect()
        };
        let (now, then) = (bytes(&seen), bytes(&GOLDEN_VIEWS.concat()));
        // Mathematical libraries may round differently.
        let same = now.len() == then.len() && now.iter().zip(&then).all(|(a, b)| a.abs_diff(*b) <= 1);
        assert!(same, "{seen}");
    }

    #[test]
    fn the_points_are_what_they_were() {
        let photo = |i: usize| {
            let camera = cameras()[i].0.resized(24, 24);
            let rgb = render_truth(&camera, Part::All).iter().map(|&v| to_byte(f64::from(v))).collect();
            BuiltinPhoto { name: String::new(), camera, is_test: i == 20, rgb }
        };
        let (positions, colors) = surface_points(studio(), SEED, &[9, 13, 20, 26, 44, 50].map(photo), 12);
        let now: Vec<i32> = positions
            .iter()
            .zip(&colors)
            .flat_map(|(p, c)| p.map(|v| (v * 1000.0).round() as i32).into_iter().chain(c.map(i32::from)))
            .collect();
        let same = now.len() == GOLDEN_POINTS.len() && now.iter().zip(GOLDEN_POINTS).all(|(a, b)| a.abs_diff(b) <= 1);
        assert!(same, "{now:?}");
    }

    const GOLDEN_VIEWS: [&str; 15] = [
        "1e21291e21291e21291e21291e21291e21291e21291e21291e21291f222a2c2d33393a3d4740377e776720222a1e21296e6c6b747476",
        "8c9097717ba456576d6572656c9d9b597978b57676c56d6b664d4e4b4e5b73717364858f5098966d9392a23632b25a567c4f4e878380",
        "a5a19b7477815f60637a79766b4f4d683d3b6a6564cac4bd9886746866655856568a87859c98938985828b878386827e5755557f7c79",
        "7f7e7d8f8d8b94918e7877789693908a8786848281a4a09b8f8d8ba6a29d1e21291e21291e21291e21291e21291e21291e21291e2129",
        "1e21291f222a2c2d33393a3d3c363243362420222a1e21296e6c6b504e4d1918192e48853a4162446059619794567776af6664b54642",
        "430f0d3e4251727072517882368e8c5e8987a02f2aa9332e794a4a7c79776d6a6753586a4e50557977756344426435335852523b3739",
        "3f28232b2a2e4b49488a87859c98938985828b878377736f37353774716d7f7e7d8f8d8b94918e7877789693908a8786848281a4a09b",
        "8f8d8ba6a29d3e3e42706e6c7a787685828084828083817e5857594a494a8a8885908d8a7573748c8c8e848691828cb2928f91928664",
        "bf6462b8706c6c65647475774148635263944f47466c6150c26662ab4d4e665e5e6a68677673726d7072749c976995908b6d69604445",
        "7d7c7d8482829795975c6e6e77c0bd69c1bd8884816f6e6e958883777a7f7d859c5b5b5c5b7d7a5582859e9a968482804e4a4d616267",
        "45444849494c8885828a87837c7b7c8986838e8a856e6c6c8683808c89869b9894a5a19c3e3e42706e6c7a787685828084828083817e",
        "5857594a494a8a8885908d8a6b6866494745797985616d9b8b898c665b4cbc5e5bb05b584644430000003a425d2d46833a373f544c42",
        "b83834a4312e6158596361607673726a6d6f6c97915a8d8a8667635e42426c696973706e94939556696946afaa49b5b08884815f5c5a",
        "462f2a3534366d76914a49485a7b794176789e9a9675716e2c272a2c2b2f29282b39383b8885828a87837c7b7c8986838d89846b6a6a",
        "8683808c89869b9894a5a19c",
    ];
    /// Position in thousandths, and color.
    #[rustfmt::skip]
    const GOLDEN_POINTS: [i32; 72] = [
        571, -33, 291, 73, 102, 99, -102, -380, -23, 103, 102, 105, -192, 430, 175, 86, 86, 86,
        -579, 856, 621, 101, 100, 102, -239, -643, 316, 148, 129, 120, -870, -300, 570, 165, 52, 49,
        -665, -907, 70, 87, 84, 81, 164, 2166, 6, 139, 137, 139, 870, -92, 495, 117, 203, 198,
        1053, 642, 491, 103, 86, 58, 563, -508, 135, 97, 98, 101, -846, -322, -12, 96, 93, 92,
    ];

    #[test]
    fn four_samples_of_a_calm_pixel_are_as_good_as_sixteen() {
        let mut worst = vec![];
        for i in [9, 27, 45] {
            let camera = cameras()[i].0;
            let bytes = |calm| -> Vec<u8> {
                render(studio(), &camera, Part::All, calm).iter().map(|v| to_byte(*v as f64)).collect()
            };
            worst.extend(bytes(CALM).iter().zip(&bytes(0.0)).map(|(a, b)| a.abs_diff(*b)));
        }
        worst.sort();
        let over = worst.iter().filter(|d| **d > 1).count();
        // Measured for seven: 10 of 344,064 values differ by more than a step, by at most 6 (a silhouette between the
        // corners).
        assert!(
            over * 10_000 < worst.len() && worst.last() < Some(&12),
            "{over} of {}: {:?}",
            worst.len(),
            worst.last()
        );
    }
}
