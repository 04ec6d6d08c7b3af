//! Tests the guarantees of the built-in scene: point coverage, reflections, encoding.

use std::sync::LazyLock;

use glam::Vec3;
use glint::data::builtin::{BuiltinScene, Part, SIZE, builtin_scene, render_truth};

const POINTS: usize = 2000;

static SCENE: LazyLock<BuiltinScene> = LazyLock::new(|| builtin_scene(POINTS));

#[test]
fn another_call_gives_the_same_bytes_and_fewer_points_are_the_first() {
    const FEW: usize = POINTS / 2;
    let again = builtin_scene(FEW);
    for (a, b) in SCENE.photos.iter().zip(&again.photos) {
        assert_eq!(a.rgb, b.rgb, "{}", a.name);
        assert_eq!(a.camera, b.camera, "{}", a.name);
    }
    assert_eq!(SCENE.point_positions[..FEW], again.point_positions);
    assert_eq!(SCENE.point_colors[..FEW], again.point_colors);
}

#[test]
fn there_are_48_training_and_8_test_views_of_128_by_128() {
    assert_eq!(SCENE.photos.iter().filter(|p| !p.is_test).count(), 48);
    assert_eq!(SCENE.photos.iter().filter(|p| p.is_test).count(), 8);
    let mut names: Vec<_> = SCENE.photos.iter().map(|p| p.name.as_str()).collect();
    assert!(names.is_sorted());
    names.dedup();
    assert_eq!(names.len(), 56);
    for photo in &SCENE.photos {
        assert_eq!((photo.camera.width, photo.camera.height), (SIZE, SIZE));
        assert_eq!(photo.rgb.len(), (SIZE * SIZE * 3) as usize);
        let error = (photo.camera.rotation * photo.camera.rotation.transpose() - glam::DMat3::IDENTITY).to_cols_array();
        assert!(error.iter().all(|e| e.abs() < 1e-12));
        assert!((photo.camera.rotation.determinant() - 1.0).abs() < 1e-12);
    }
    for value in SCENE.background {
        assert!((value * 255.0 - (value * 255.0).round()).abs() < 1e-4);
    }
}

#[test]
fn every_point_is_in_the_frame_of_three_training_cameras() {
    assert_eq!(SCENE.point_positions.len(), POINTS);
    assert_eq!(SCENE.point_colors.len(), POINTS);
    for point in &SCENE.point_positions {
        let seen = SCENE.photos.iter().filter(|photo| !photo.is_test).filter(|photo| {
            let (x, y, z) = photo.camera.project(Vec3::from_array(*point).as_dvec3());
            z > 0.2 && (0.0..SIZE as f64).contains(&x) && (0.0..SIZE as f64).contains(&y)
        });
        assert!(seen.count() >= 3, "{point:?}");
    }
}

/// Every prefix covers everything that training cameras see: each part of the surface has a point nearby.
#[test]
fn every_prefix_covers_the_floor_that_is_seen() {
    let on_floor = |p: &&[f32; 3]| p[2].abs() < 0.03;
    for (count, reach) in [(POINTS / 4, 0.42), (POINTS, 0.22)] {
        let floor: Vec<Vec3> = SCENE.point_positions[..count].iter().filter(on_floor).map(|p| Vec3::from(*p)).collect();
        let mut worst = 0.0f32;
        // The empty foreground between the plate and the cameras, seen by all cameras.
        for i in 0..100 {
            let p = Vec3::new(-0.5 + 0.1 * (i % 10) as f32, -1.45 + 0.02 * (i / 10) as f32, 0.0);
            let nearest = floor.iter().map(|q| p.distance(*q)).fold(f32::INFINITY, f32::min);
            worst = worst.max(nearest);
        }
        assert!(worst < reach, "of {count} points none within {worst} of a place on the floor");
    }
}

/// Reflection is more than a tenth of all light (measured: 0.196), and brightens more than 2 % of the pixels
/// (0.042) by over a quarter of white.
#[test]
fn reflections_are_a_real_part_of_the_image() {
    let (mut all, mut reflected, mut lifted, mut pixels) = (0.0f64, 0.0f64, 0usize, 0usize);
    for photo in SCENE.photos.iter().filter(|p| p.is_test) {
        let whole = render_truth(&photo.camera, Part::All);
        let diffuse = render_truth(&photo.camera, Part::Diffuse);
        let specular = render_truth(&photo.camera, Part::Specular);
        for ((a, d), s) in whole.iter().zip(&diffuse).zip(&specular) {
            assert!((a - d - s).abs() < 1e-6 && *d >= 0.0 && *s >= 0.0 && *a <= 1.0, "{a} = {d} + {s}");
        }
        all += whole.iter().map(|v| *v as f64).sum::<f64>();
        reflected += specular.iter().map(|v| *v as f64).sum::<f64>();
        lifted += specular.chunks_exact(3).filter(|s| s.iter().sum::<f32>() > 0.75).count();
        pixels += specular.len() / 3;
    }
    let (share, lifted) = (reflected / all, lifted as f64 / pixels as f64);
    assert!(share > 0.1, "reflected share of the light {share}");
    assert!(lifted > 0.02, "share of strongly lit pixels {lifted}");
}

#[test]
fn photographs_are_the_truth_quantised() {
    let photo = &SCENE.photos[10];
    let truth = render_truth(&photo.camera, Part::All);
    for (byte, light) in photo.rgb.iter().zip(&truth) {
        let v = *byte as f32 / 255.0;
        let decoded = if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
        // Half a step of 1/255 times the largest slope of the decoding, 2.4 / 1.055.
        assert!((decoded - light).abs() <= 0.5 / 255.0 * 2.28, "{byte} for {light}");
    }
}
