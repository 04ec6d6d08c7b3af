//! Tests the built-in scene, and real datasets and scenes from `../shared/data`; the latter skip with a message if they are missing.

mod builtin;
mod carving;
#[path = "../common/mod.rs"]
mod common;
mod imperfect;
mod lenses;
mod reduced;
#[path = "../common/shared.rs"]
mod shared;
mod upload;
mod variants;
mod wild;

use glam::DVec3;
use glint::data::{Dataset, DatasetKind, DatasetOptions, Split, read_scene, write_scene};
use shared::shared;

fn open(name: &str) -> Option<Dataset> {
    Some(Dataset::open(shared(name)?, &DatasetOptions::default()).unwrap())
}

fn count(data: &Dataset, split: Split) -> usize {
    data.split(split).count()
}

fn sees(camera: &glint::scene::Camera, point: [f64; 3]) -> bool {
    let (x, y, z) = camera.project(DVec3::from_array(point));
    z > 0.0 && x >= 0.0 && x <= camera.width as f64 && y >= 0.0 && y <= camera.height as f64
}

/// Photos of a model see most of its points: no axis is mirrored, no pose inverted.
fn assert_points_are_seen(data: &Dataset, least: f64) {
    let points = &data.points.as_ref().unwrap().positions;
    let mut shares = 0.0;
    for photo in &data.photos {
        shares += points.iter().filter(|&&p| sees(&photo.camera, p)).count() as f64 / points.len() as f64;
    }
    let share = shares / data.photos.len() as f64;
    assert!(share > least, "a photo sees {share} of the points on average");
}

#[test]
fn nerf_synthetic_loads_as_published() {
    let Some(data) = open("small/lego") else { return };
    assert_eq!((data.kind, count(&data, Split::Train), count(&data, Split::Test)), (DatasetKind::Blender, 100, 25));
    assert!(data.points.is_none() && !data.undistorted);
    let fx = 100.0 / (0.5f64 * 0.6911112070083618).tan();
    assert!(data.photos.iter().all(|p| (p.camera.fx - fx).abs() < 1e-9 && p.camera.fy == p.camera.fx));
    assert!(data.photos.iter().all(|p| (p.camera.cx, p.camera.cy, p.camera.width) == (100.0, 100.0, 200)));
    let images = data.load_images().unwrap();
    assert_eq!(images.len(), 125);
    assert!(images.iter().all(|image| image.rgb.len() == 200 * 200 * 3 && image.rgb[..3] == [0; 3]));
    // The cameras are on a sphere of radius 4.03 about the origin and look at it.
    let focus = data.focus().unwrap();
    assert!(focus.center.length() < 0.05 && (focus.radius - 4.03).abs() < 0.05, "{focus:?}");
    let cloud = data.random_points(10_000, 3);
    assert!(cloud.positions.iter().flatten().all(|v| v.abs() <= 1.3));
    let middle = data.photos.iter().filter(|photo| sees(&photo.camera, [0.0; 3])).count();
    assert_eq!(middle, 125);
    let white = DatasetOptions { background: [1.0; 3], max_size: Some(100), ..Default::default() };
    let white = Dataset::open(shared("small/lego").unwrap(), &white).unwrap();
    let image = white.photos[0].load(white.background).unwrap();
    assert_eq!((image.width, image.height, &image.rgb[..3]), (100, 100, &[255; 3][..]));
}

#[test]
fn a_transforms_file_that_is_named_comes_alone() {
    let Some(path) = shared("small/lego/transforms_train.json") else { return };
    let data = Dataset::open(path, &DatasetOptions::default()).unwrap();
    assert_eq!((count(&data, Split::Train), count(&data, Split::Test)), (87, 13));
}

#[test]
fn colmap_models_load_with_their_points() {
    for (name, views, points, [width, height]) in [
        ("small/bonsai", 292, 20_849, [256, 171]),
        ("small/horns", 62, 5_413, [250, 187]),
        ("small/garden", 185, 30_000, [224, 224]),
    ] {
        let Some(data) = open(name) else { continue };
        assert_eq!((data.kind, data.photos.len(), data.undistorted), (DatasetKind::Colmap, views, false), "{name}");
        assert_eq!(count(&data, Split::Test), views.div_ceil(8));
        assert_eq!(data.points.as_ref().unwrap().positions.len(), points);
        assert!(data.photos.iter().all(|p| [p.camera.width, p.camera.height] == [width, height]));
        assert_points_are_seen(&data, 0.2);
        let images = data.load_images().unwrap();
        assert!(images.iter().all(|image| [image.width, image.height] == [width, height]));
        // The colors of points match the pixels at their projections, better than those of the upside-down
        // photo.
        let (photo, image, cloud) = (&data.photos[5], &images[5], data.points.as_ref().unwrap());
        let (mut right, mut wrong) = (0.0, 0.0);
        for (&p, color) in cloud.positions.iter().zip(&cloud.colors).filter(|(p, _)| sees(&photo.camera, **p)) {
            let (x, y, _) = photo.camera.project(DVec3::from_array(p));
            let (x, y) = ((x as u32).min(width - 1), (y as u32).min(height - 1));
            let difference = |y: u32| -> f64 {
                (0..3).map(|c| image.rgb[(3 * (y * width + x)) as usize + c].abs_diff(color[c]) as f64).sum()
            };
            right += difference(y);
            wrong += difference(height - 1 - y);
        }
        assert!(right < 0.75 * wrong, "{name}: {right} against {wrong}");
    }
}

#[test]
fn the_fox_is_undistorted_without_a_camera_model() {
    let Some(data) = open("small/fox") else { return };
    assert_eq!((data.kind, data.photos.len(), data.undistorted), (DatasetKind::Transforms, 50, true));
    // The fox's distortion moves the corners by a pixel or two.
    assert!(data.outside < 0.05, "{}", data.outside);
    let camera = data.photos[0].camera;
    assert_eq!((camera.width, camera.height), (144, 256));
    assert!((camera.fx - 183.40266666666668).abs() < 1e-9 && (camera.cy - 128.7024).abs() < 1e-9);
    assert_eq!(data.load_images().unwrap().len(), 50);
}

/// The datasets' sparse points are the reference for the focus.
#[test]
fn the_focus_is_where_the_sparse_points_are() {
    for name in ["small/horns", "small/bonsai", "small/garden"] {
        let Some(data) = open(name) else { continue };
        let focus = data.focus().unwrap();
        let points = &data.points.as_ref().unwrap().positions;
        let within = |reach: f64| {
            let inside = |p: &&[f64; 3]| DVec3::from_array(**p).distance(focus.center) < reach * focus.radius;
            points.iter().filter(inside).count() as f64 / points.len() as f64
        };
        let [one, two, three] = [1.0, 2.0, 3.0].map(within);
        eprintln!("{name}: shares of the sparse points in 1, 2, 3 focus radii: {one:.2}, {two:.2}, {three:.2}");
        // The object in focus is inside the ball, the room behind it around the ball: 0.30 and 0.88 for the
        // bonsai.
        assert!(one > 0.25 && three > 0.8, "{name}: {one}, {three}");
    }
}

#[test]
fn the_reference_trainers_scene_comes_back_bit_for_bit() {
    let Some(path) = shared("splats/inria_sh3_9k.ply") else { return };
    let scene = read_scene(&path).unwrap();
    assert_eq!((scene.base.len(), scene.base.sh_degree, scene.supplement.is_none()), (9_080, 3, true));
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("copy.ply");
    write_scene(&copy, &scene).unwrap();
    let (a, b) = (std::fs::read(&path).unwrap(), std::fs::read(&copy).unwrap());
    // Both write zero normals, so the whole files are equal.
    assert!(a == b);
    assert_eq!(read_scene(&copy).unwrap(), scene);
}
