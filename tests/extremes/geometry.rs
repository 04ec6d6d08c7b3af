//! Extreme positions, sizes and lengths of Gaussians.

use glam::DVec3;
use glint::{
    pipelines::{
        model::{Model, Room},
        render::{Needs, Renderer},
        views::Views,
    },
    reference::median_depth::{DepthAt, median_depth},
    scene::Camera,
};

use super::{
    HEIGHT, WIDTH, assert_background, check,
    common::Gpu,
    company, middle,
    probe::{BACKGROUND, Blob, Probe, Setup, distance, ripple, scene},
    stage, usual,
};

#[test]
fn scales_from_1e_minus_7_to_1e4_scene_units() {
    let camera = usual();
    let [near, far] = company(&camera);
    for compensate in [false, true] {
        let mut probe = Probe::new(8, &camera, Setup { compensate, ..Default::default() });
        for exponent in -7..=4 {
            let s = 10f64.powi(exponent);
            let blob = Blob { scale: [s, 0.7 * s, 1.2 * s], ..middle(&camera) };
            let what = format!("scale 1e{exponent}, compensated {compensate}");
            check(&mut probe, &camera, &scene(&[near, blob, far]), &what, 1e-4, 1e-5, 1e-4);
        }
    }
}

#[test]
fn needles_and_pancakes_to_1e7() {
    let camera = usual();
    let [near, far] = company(&camera);
    for compensate in [false, true] {
        let mut probe = Probe::new(8, &camera, Setup { compensate, ..Default::default() });
        for (n, quat) in [[1.0, 0.0, 0.0, 0.0], [0.9, 0.2, -0.3, 0.4], [0.1, 0.7, 0.6, -0.3]].into_iter().enumerate() {
            for scale in [
                [1.0, 1e-7, 1e-7],
                [1.0, 1.0, 1e-7],
                [100.0, 1e-5, 1e-5],
                [1e4, 1e-3, 1e-3],
                [1e4, 5e-2, 5e-2],
                [1e4, 1e4, 1e-3],
                [1e2, 1e-2, 1e-5],
            ] {
                let blob = Blob { scale, quat, logit: 2.0, ..middle(&camera) };
                let what = format!("needle {scale:?} turn {n}, compensated {compensate}");
                // Beyond a length of 1e5 px the direction itself limits the precision: float32 has 1e-7 rad,
                // over the 50 px in view 1e-5 px of a width of 0.55 px. That is 1e-5 of the image, and 1e-3
                // of gradients that are differences of two edges.
                let gradient = if scale[0] / scale[2] > 1e6 && scale[0] > 10.0 { 2e-3 } else { 1e-4 };
                check(&mut probe, &camera, &scene(&[near, blob, far]), &what, 1e-4, 2e-5, gradient);
            }
        }
    }
}

#[test]
fn centres_beside_behind_and_around_the_camera() {
    let (camera, [near, far], mut probe) = stage(Setup::default());
    let (w, h) = (f64::from(WIDTH), f64::from(HEIGHT));
    for (what, x, y, z, s) in [
        ("camera inside", 36.0, 28.0, 0.5, 2.0),
        ("just beyond the near plane", 36.0, 28.0, 0.2001, 0.05),
        ("at the frustum's edge", w, 0.0, 3.0, 0.2),
        ("past the edge", w + 20.0, -15.0, 3.0, 0.5),
        ("where the Jacobian is clamped", 3.0 * w, h, 3.0, 2.0),
        ("far beside the image", 1e4, 28.0, 1.0, 100.0),
        ("very far beside the image", -1e6, 2e5, 0.5, 4e3),
        ("smaller than a pixel", 36.5, 28.5, 500.0, 0.01),
        ("on a pixel's corner", 36.0, 28.0, 500.0, 0.01),
        ("far away", 36.5, 28.5, 1e6, 1e3),
    ] {
        let blob = Blob { mean: camera.unproject(x, y, z), scale: [s, 0.8 * s, 0.6 * s], ..Default::default() };
        // A centre 1e6 px away is rounded to 0.1 px.
        let gradient = if x.abs() > 1e5 { 1e-3 } else { 1e-4 };
        check(&mut probe, &camera, &scene(&[near, blob, far]), what, 1e-4, 1e-5, gradient);
    }
}

#[test]
fn a_centre_on_the_near_plane_or_behind_it_is_not_seen() {
    let camera = Camera { rotation: glam::DMat3::IDENTITY, translation: DVec3::ZERO, ..usual() };
    let company = company(&camera);
    let mut probe = Probe::new(8, &camera, Setup::default());
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let alone = probe.shoot(&scene(&company), &camera, &image_grad);
    // With this pose, camera z equals the mean's own z: 0.2f32 is exactly on the plane.
    for (z, seen) in [
        (0.2f32, false),
        (0.2f32.next_up(), true),
        (0.0, false),
        (-3.0, false),
        (f32::MAX, true),
        (f32::INFINITY, false),
    ] {
        let blob = Blob { mean: DVec3::new(0.0, 0.0, f64::from(z)), ..company[0] };
        let shot = probe.shoot(&scene(&[company[0], company[1], blob]), &camera, &image_grad);
        assert_eq!(shot.tile_counts[2] > 0, seen, "z {z}");
        if !seen {
            assert_eq!(shot.image, alone.image, "z {z}");
        }
        assert!(!seen || shot.is_finite(), "z {z}");
    }
}

/// One scene in other units: 1e6 units from the origin, and 1e-4 units large.
#[test]
fn a_scene_far_from_its_origin_is_drawn_from_its_middle() {
    let gpu = Gpu::new();
    let near = usual();
    // Multiples of float32's step at 1e6, so that the means themselves lose nothing.
    let offset = DVec3::new(1048576.0, -524288.0, 2097152.0);
    let snap = |p: DVec3| (p * 4.0).round() / 4.0;
    let blobs = |by: DVec3| -> Vec<Blob> {
        (0..60)
            .map(|i| {
                let (x, y) = (f64::from(i * 37 % 72), f64::from(i * 23 % 56));
                let mean = snap(near.unproject(x, y, 8.0 + f64::from(i % 7) * 5.0)) + by;
                Blob {
                    mean,
                    scale: [0.6, 0.4, 0.9],
                    logit: 0.3,
                    rgb: [0.2, (x / 72.0) as f32, (y / 56.0) as f32],
                    ..Default::default()
                }
            })
            .collect()
    };
    let far = Camera { translation: near.translation - near.rotation * offset, ..near };
    let origin = glint::pipelines::views::origin_for(&[far]);
    assert!(
        origin.distance(far.eye()) < 1.0
            && glint::pipelines::views::origin_for(&[near, usual().around(DVec3::X)]) == DVec3::ZERO
    );
    let mut here = Probe::new(64, &near, Setup::default());
    let mut there = Probe::new(64, &near, Setup { origin, ..Default::default() });
    let mut naive = Probe::new(64, &near, Setup::default());
    let twin = here.twin(&scene(&blobs(DVec3::ZERO)), &near, 1e-4);
    let want = here.shoot(&scene(&blobs(DVec3::ZERO)), &near, &twin.image_grad);
    let got = there.shoot(&scene(&blobs(offset)), &far, &twin.image_grad);
    let without = naive.shoot(&scene(&blobs(offset)), &far, &twin.image_grad);
    let (d, n) = (distance(&got, &twin), distance(&without, &twin));
    println!(
        "1e6 from the origin: image {:.1e}, gradients {:.1e}; not recentred: {:.1e}, {:.1e}",
        d.image,
        d.worst(),
        n.image,
        n.worst()
    );
    assert!(d.image < 1e-5 && d.worst() < 1e-4 && n.image > 1e-3);
    assert_eq!(want.tile_counts, got.tile_counts);
    // Download reverts the shift of the upload.
    let original = scene(&blobs(offset));
    let model = Model::upload_around(&gpu, origin, &original, Room::default()).unwrap();
    assert_eq!(model.download().unwrap(), original);
    // A model and views with different origins are refused.
    let views = Views::upload(&gpu, &[near], &[]).unwrap();
    let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, Default::default()).unwrap();
    assert!(renderer.render(&model, &views, 0, BACKGROUND).is_err());
}

#[test]
fn a_scene_smaller_than_the_near_plane_is_not_seen() {
    let camera = usual();
    let blobs: Vec<_> = company(&camera)
        .into_iter()
        .map(|b| Blob { mean: camera.eye() + (b.mean - camera.eye()) * 1e-4, scale: b.scale.map(|s| s * 1e-4), ..b })
        .collect();
    let mut probe = Probe::new(8, &camera, Setup::default());
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let shot = probe.shoot(&scene(&blobs), &camera, &image_grad);
    assert_background(&shot);
    assert!(shot.gradients.geometry.iter().all(|&g| g == 0.0) && shot.is_finite());
    assert_eq!(shot.stepped, scene(&blobs));
}

#[test]
fn what_leaves_float32_on_the_way_is_not_seen() {
    let (camera, company, mut probe) = stage(Setup::default());
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let alone = probe.shoot(&scene(&company), &camera, &image_grad);
    // Axes of 1.5e9 px fit into an int, ends at 5e9 px do not: it fills the image.
    let wide = Blob { mean: camera.unproject(36.0, 28.0, 4.0), scale: [1e8; 3], ..company[0] };
    let shot = probe.shoot(&scene(&[company[0], company[1], wide]), &camera, &image_grad);
    let tile = probe.options();
    assert_eq!(shot.tile_counts[2], WIDTH.div_ceil(tile.tile_width) * HEIGHT.div_ceil(tile.tile_height));
    // A mean with camera z beyond 3.4e38 while its x and y are within: no component of the axis is near 1.
    let beyond = 3.6e38 * camera.rotation.row(2);
    for blob in [
        Blob { mean: camera.unproject(36.0, 28.0, 4.0), scale: [1e9; 3], ..company[0] },
        Blob { mean: camera.unproject(36.0, 28.0, 4.0), scale: [1e30; 3], ..company[0] },
        Blob { mean: camera.unproject(36.0, 28.0, 4.0), scale: [1e38, 1e-30, 1e38], ..company[0] },
        Blob { mean: beyond, ..company[0] },
        // Nor is a position beyond it while z is within.
        Blob { mean: 3.6e38 * camera.rotation.row(0) + 1e38 * camera.rotation.row(2), ..company[0] },
        Blob { mean: 3.6e38 * camera.rotation.row(1) + 1e38 * camera.rotation.row(2), ..company[0] },
    ] {
        let shot = probe.shoot(&scene(&[company[0], company[1], blob]), &camera, &image_grad);
        assert_eq!(shot.tile_counts[2], 0, "{blob:?}");
        assert!(shot.image == alone.image && shot.is_finite(), "{blob:?}");
    }
}

#[test]
fn depths_lie_before_the_near_plane_even_inside_a_gaussian() {
    let camera = usual();
    let mut probe = Probe::new(8, &camera, Setup::default());
    let (mut seen, mut fell_back, mut off) = (0, 0, 0);
    for quat in [
        [1.0, 0.0, 0.0, 0.0],
        [0.9, 0.2, -0.3, 0.4],
        [0.1, 0.7, 0.6, -0.3],
        [0.5, 0.5, -0.5, 0.5],
        [0.7, 0.0, 0.7, 0.1],
    ] {
        for scale in [[2.0, 2.0, 0.02], [0.02, 2.0, 2.0], [3.0, 0.3, 0.1], [1e3, 1e3, 1e-4], [2.0, 2.0, 1e-25]] {
            let blob = Blob { mean: camera.unproject(36.0, 28.0, 0.4), scale, quat, logit: 4.0, ..Default::default() };
            let twin = probe.twin(&scene(&[blob]), &camera, 1e-3);
            let shot = probe.shoot(&scene(&[blob]), &camera, &twin.image_grad);
            let params = glint::reference::Params::from_scene(&scene(&[blob])).unwrap();
            let view = glint::reference::View::from_camera(&camera).rounded();
            let median = &twin.rendered.blended.median;
            let want = median_depth(&params, &view, median, DepthAt::MaximumResponse, 1.0);
            for (p, (&z, want)) in shot.depth.iter().zip(want).enumerate() {
                assert!(z == 0.0 || (z > 0.2 && z.is_finite()), "{scale:?} {quat:?}: {z}");
                if twin.rendered.blended.margins[p].median > 1e-3 && twin.image_grad[p] != [0.0; 3] && want > 0.0 {
                    seen += 1;
                    fell_back += u32::from((want - 0.4).abs() < 1e-6);
                    off += u32::from((f64::from(z) - want).abs() > 1e-3 * want);
                }
            }
        }
    }
    println!("{seen} depths, {fell_back} of the centre, {off} off");
    assert!(fell_back > 1000 && seen > 2 * fell_back && off == 0);
}
