//! Inputs at and beyond what a scene usually holds: each has an outcome, written in docs/extremes.md, and a test here.

mod common;
#[path = "common/probe.rs"]
mod probe;

use common::Gpu;
use glam::DVec3;
use glint::{
    gpu::Buffer,
    pipelines::{
        model::Model,
        raster::{Raster, RasterOptions, Reduction, WORKGROUP},
        render::Renderer,
        train::{BaseOptions, train_base},
        views::Views,
    },
    reference::{
        Background, Intersections, Options,
        blend::blend,
        blend_backward::blend_backward,
        median_depth::{DepthAt, median_depth},
        plane_backward::plane_backward as plane_backward_twin,
        plane_project::Plane,
        plane_project::plane_project as plane_project_twin,
        random_scene,
        tiles::Tiling,
    },
    scene::{Camera, Scene},
    stages::{
        emit::{self, Emit},
        plane_backward::{self, PlaneBackward},
        plane_draw::{self, PlaneDraw},
        plane_project::{self, PlaneProject},
        types::{Frame, PlaneState, Quota, Splat},
    },
};
use probe::{BACKGROUND, Blob, Probe, RATES, Setup, Shot, camera_at, distance, ripple, scene, with_lobes};

const WIDTH: u32 = 72;
const HEIGHT: u32 = 56;

/// Where Adam's first step must have gone: the rate times g / (|g| + 1e-15), whatever the gradient's size.
fn assert_one_step(shot: &Shot, before: &Scene, what: &str) {
    let (old, new) = (
        glint::reference::Params::from_scene(before).unwrap(),
        glint::reference::Params::from_scene(&shot.stepped).unwrap(),
    );
    let g = &shot.gradients;
    let rate_of = |array: usize, plane: usize| match (array, plane) {
        (0, 0..3) => RATES[0],
        (0, 3..6) => RATES[1],
        (0, 6..10) => RATES[2],
        (0, _) => RATES[3],
        (1, 0..3) => RATES[4],
        (1, _) => RATES[5],
        (_, 0..3) => RATES[6],
        (_, 3) => RATES[7],
        _ => RATES[8],
    };
    for (array, (old, new, g, stride)) in [
        (&old.geometry, &new.geometry, &g.geometry, g.stride),
        (&old.sh, &new.sh, &g.sh, g.stride),
        (&old.lobes, &new.lobes, &g.lobes, g.lobe_stride),
    ]
    .into_iter()
    .enumerate()
    {
        for at in 0..old.len() {
            let rate = f64::from(rate_of(array, at / stride));
            let mut want = old[at] - rate * g[at] / (g[at].abs() + 1e-15);
            if array == 2 && at / stride == 3 {
                want = want.clamp(0.01, 1.0);
            }
            if array == 2 && at / stride == 4 {
                want = want.clamp(-2.0, 8.0);
            }
            // Two roundings of the parameter; Adam's own arithmetic, and square roots of denormal squares for |g| < 1e-17.
            let tolerance = 2e-7 * old[at].abs() + if g[at].abs() < 1e-16 { rate } else { 1e-4 * rate };
            assert!(
                (new[at] - want).abs() <= tolerance,
                "{what}: array {array} at {at}: {} → {}, wanted {want}, gradient {}",
                old[at],
                new[at],
                g[at]
            );
        }
    }
}

/// Renders, differentiates, steps and compares with the twin.
fn check(probe: &mut Probe, camera: &Camera, scene: &Scene, what: &str, calm: f64, image: f64, gradient: f64) -> Shot {
    let twin = probe.twin(scene, camera, calm);
    let shot = probe.shoot(scene, camera, &twin.image_grad);
    assert!(shot.is_finite(), "{what}: not finite");
    let d = distance(&shot, &twin);
    println!(
        "{what}: image {:.1e}, calm {:.2}, gradients {:?}",
        d.image,
        d.calm,
        d.groups.iter().map(|g| format!("{} {:.1e}", g.0, g.1)).collect::<Vec<_>>()
    );
    assert!(d.image <= image, "{what}: image off by {}", d.image);
    for (name, l2, cosine) in &d.groups {
        assert!(*l2 <= gradient && *cosine >= 1.0 - gradient, "{what}: {name} off by {l2}, cosine {cosine}");
    }
    assert_one_step(&shot, scene, what);
    shot
}

fn usual() -> Camera {
    camera_at(DVec3::new(0.4, -0.3, 0.2), WIDTH, HEIGHT)
}

/// Two ordinary Gaussians before which the extreme one stands or behind which it lies.
fn company(camera: &Camera) -> [Blob; 2] {
    let near = Blob { mean: camera.unproject(30.0, 25.0, 3.0), scale: [0.3, 0.2, 0.25], ..Default::default() };
    let far = Blob {
        mean: camera.unproject(45.0, 33.0, 6.0),
        scale: [0.7, 0.9, 0.4],
        logit: 1.0,
        rgb: [0.2, 0.4, 0.9],
        ..near
    };
    [near, far]
}

#[test]
fn scales_from_1e_minus_7_to_1e4_scene_units() {
    let gpu = Gpu::new();
    let camera = usual();
    let [near, far] = company(&camera);
    for compensate in [false, true] {
        let mut probe = Probe::new(&gpu, 8, &camera, Setup { compensate, ..Default::default() });
        for exponent in -7..=4 {
            let s = 10f64.powi(exponent);
            let blob =
                Blob { mean: camera.unproject(36.4, 28.7, 4.0), scale: [s, 0.7 * s, 1.2 * s], ..Default::default() };
            let what = format!("scale 1e{exponent}, compensated {compensate}");
            check(&mut probe, &camera, &scene(&[near, blob, far]), &what, 1e-4, 1e-5, 1e-4);
        }
    }
}

#[test]
fn needles_and_pancakes_to_1e7() {
    let gpu = Gpu::new();
    let camera = usual();
    let [near, far] = company(&camera);
    for compensate in [false, true] {
        let mut probe = Probe::new(&gpu, 8, &camera, Setup { compensate, ..Default::default() });
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
                let blob =
                    Blob { mean: camera.unproject(36.4, 28.7, 4.0), scale, quat, logit: 2.0, ..Default::default() };
                let what = format!("needle {scale:?} turn {n}, compensated {compensate}");
                // Beyond 1e5 px of length the direction itself is the bound: float32 has it to 1e-7 rad, which over the 50 px
                // in view is 1e-5 px of a width of 0.55 px: 1e-5 of the image, and 1e-3 of gradients that are
                // differences of two edges.
                let gradient = if scale[0] / scale[2] > 1e6 && scale[0] > 10.0 { 2e-3 } else { 1e-4 };
                check(&mut probe, &camera, &scene(&[near, blob, far]), &what, 1e-4, 2e-5, gradient);
            }
        }
    }
}

#[test]
fn centres_beside_behind_and_around_the_camera() {
    let gpu = Gpu::new();
    let camera = usual();
    let [near, far] = company(&camera);
    let mut probe = Probe::new(&gpu, 16, &camera, Setup::default());
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
        // A centre 1e6 px away has 0.1 px of rounding.
        let gradient = if x.abs() > 1e5 { 1e-3 } else { 1e-4 };
        check(&mut probe, &camera, &scene(&[near, blob, far]), what, 1e-4, 1e-5, gradient);
    }
}

#[test]
fn a_centre_on_the_near_plane_or_behind_it_is_not_seen() {
    let gpu = Gpu::new();
    let camera = Camera { rotation: glam::DMat3::IDENTITY, translation: DVec3::ZERO, ..usual() };
    let company = company(&camera);
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let alone = probe.shoot(&scene(&company), &camera, &image_grad);
    // With this pose camera z is the mean's own z: 0.2f32 is on the plane to the last bit.
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

/// Two scenes that hold the same in other units: 1e6 units from the origin, and 1e-4 units large.
#[test]
fn a_scene_far_from_its_origin_is_drawn_from_its_middle() {
    let gpu = Gpu::new();
    let near = usual();
    // What float32 has at 1e6, so that the means themselves lose nothing.
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
    let mut here = Probe::new(&gpu, 64, &near, Setup::default());
    let mut there = Probe::new(&gpu, 64, &near, Setup { origin, ..Default::default() });
    let mut naive = Probe::new(&gpu, 64, &near, Setup::default());
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
    // What the upload moved the download moves back.
    let original = scene(&blobs(offset));
    let model = Model::upload_around(&gpu, origin, &original, 0).unwrap();
    assert_eq!(model.download().unwrap(), original);
    // Model and views that count from different places are refused.
    let views = Views::upload(&gpu, &[near], &[]).unwrap();
    let mut renderer = Renderer::new(&gpu, 64, &views, Default::default()).unwrap();
    assert!(renderer.render(&model, &views, 0, BACKGROUND).is_err());
}

#[test]
fn a_scene_smaller_than_the_near_plane_is_not_seen() {
    let gpu = Gpu::new();
    let camera = usual();
    let blobs: Vec<_> = company(&camera)
        .into_iter()
        .map(|b| Blob { mean: camera.eye() + (b.mean - camera.eye()) * 1e-4, scale: b.scale.map(|s| s * 1e-4), ..b })
        .collect();
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let shot = probe.shoot(&scene(&blobs), &camera, &image_grad);
    assert_background(&shot);
    assert!(shot.gradients.geometry.iter().all(|&g| g == 0.0) && shot.is_finite());
    assert_eq!(shot.stepped, scene(&blobs));
}

fn assert_background(shot: &Shot) {
    let [r, g, b] = BACKGROUND;
    assert!(shot.image.iter().all(|p| *p == [r, g, b, 1.0]));
}

#[test]
fn quaternions_of_any_length() {
    let gpu = Gpu::new();
    let camera = usual();
    let [near, far] = company(&camera);
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    let blob = Blob { mean: camera.unproject(36.4, 28.7, 4.0), scale: [0.6, 0.1, 0.2], ..Default::default() };
    let unit = {
        let n = blob.quat.iter().map(|q| q * q).sum::<f32>().sqrt();
        Blob { quat: blob.quat.map(|q| q / n), ..blob }
    };
    let twin = probe.twin(&scene(&[near, unit, far]), &camera, 1e-4);
    let want = probe.shoot(&scene(&[near, unit, far]), &camera, &twin.image_grad);
    for length in [1e-36f32, 1e-30, 1e-20, 1e-10, 1e-3, 1.0, 1e3, 1e10, 1e19, 1e30, 1e37] {
        let stretched = Blob { quat: unit.quat.map(|q| q * length), ..unit };
        let before = scene(&[near, stretched, far]);
        let shot = probe.shoot(&before, &camera, &twin.image_grad);
        // The same rotation up to a rounding of each component.
        for (a, b) in shot.image.iter().flatten().zip(want.image.iter().flatten()) {
            assert!((a - b).abs() < 1e-5, "length {length}: {a} {b}");
        }
        assert!(shot.stepped.base.quats.iter().flatten().all(|q| q.is_finite()));
        // A step turns it no further than a unit quaternion's: 2 · √4 · rate, whatever its length.
        let norm = |q: [f32; 4]| q.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
        let (old, new) = (unit.quat, shot.stepped.base.quats[1]);
        let cosine =
            old.iter().zip(&new).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum::<f64>() / (norm(old) * norm(new));
        let turn = 2.0 * cosine.min(1.0).acos();
        println!("quaternion of length {length:e}: turned by {turn:.1e}, now of length {:.1e}", norm(new));
        let shortest = f64::from(length).clamp(0.01, 1.0);
        assert!(
            turn <= 4.1 * f64::from(RATES[2]) / if length < 0.01 { 1.0 } else { shortest },
            "length {length}: turned by {turn}"
        );
        // And turns it at all.
        assert!(turn > 1e-6 || (1.0..=100.0).contains(&length) && turn > 1e-8, "length {length}: turned by {turn}");
    }
    for quat in [[0.0; 4], [1e-40, 0.0, 0.0, 0.0], [f32::NAN, 1.0, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0, 0.0]] {
        let shot = probe.shoot(&scene(&[near, far, Blob { quat, ..unit }]), &camera, &twin.image_grad);
        assert_eq!(shot.tile_counts[2], 0, "{quat:?}");
        assert!(shot.image.iter().flatten().all(|x| x.is_finite()), "{quat:?}");
    }
}

#[test]
fn logits_to_100_either_way() {
    let gpu = Gpu::new();
    let camera = usual();
    let [near, far] = company(&camera);
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    for logit in [-100.0f32, -20.0, -5.6, 5.0, 10.0, 16.0, 18.0, 20.0, 25.0, 30.0, 60.0, 88.0, 89.0, 100.0] {
        let blob =
            Blob { mean: camera.unproject(36.4, 28.7, 4.0), scale: [0.6, 0.3, 0.4], logit, ..Default::default() };
        // Only this one's gradient: beside the others' it would be nothing.
        let alone = scene(&[blob]);
        let shot = check(&mut probe, &camera, &alone, &format!("logit {logit}"), 1e-4, 1e-5, 1e-4);
        let gradient = shot.gradients.geometry[10];
        if (5.0..=80.0).contains(&logit) {
            assert!(gradient != 0.0, "logit {logit} has no gradient");
        }
        // Adam forgets the size of a gradient above 1e-15, so that an opacity of 1 − 2e-9 learns like any other.
        let moved = (shot.stepped.base.opacities[0] - logit).abs();
        if (5.0..=25.0).contains(&logit) {
            assert!(moved > 0.9 * RATES[3], "logit {logit} moved by {moved}");
        }
        check(&mut probe, &camera, &scene(&[near, blob, far]), &format!("logit {logit} in company"), 1e-4, 1e-5, 1e-4);
    }
}

/// A Gaussian much wider than the image has one α: on both sides of each threshold by the smallest step of the logit that shows.
#[test]
fn alpha_at_its_two_thresholds() {
    let gpu = Gpu::new();
    let camera = usual();
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let logit = |alpha: f64| (alpha / (1.0 - alpha)).ln() as f32;
    for (threshold, what) in [(1.0 / 255.0, "1/255"), (0.99, "0.99")] {
        let mut states = std::collections::BTreeSet::new();
        for k in -12..=12 {
            // One float32 step of the logit is 5e-7: α changes by 2e-9 at 1/255, 5e-9 at 0.99: below a step of α itself.
            let blob = Blob {
                mean: camera.unproject(36.5, 28.5, 4.0),
                scale: [1e5; 3],
                logit: logit(threshold) + k as f32 * 1e-6,
                ..Default::default()
            };
            let shot = probe.shoot(&scene(&[blob]), &camera, &image_grad);
            let t = shot.image[0][3];
            // α may differ from pixel to pixel by the roundings of exp(−1e-9); the rule may not.
            for pixel in &shot.image {
                let alpha = 1.0 - f64::from(pixel[3]);
                let taken = alpha >= 1.0 / 255.0 - 1e-7;
                assert!(pixel[3] == 1.0 || taken, "{what}: α {alpha}");
                assert!(alpha <= 0.99 + 1e-7);
            }
            assert!(shot.is_finite());
            let learns = shot.gradients.geometry[10] != 0.0;
            states.insert((t == 1.0, learns));
        }
        // Both sides were met: not taken and taken; taken, and taken without a gradient of its opacity.
        let sides = if threshold < 0.5 { [(false, true), (true, false)] } else { [(false, false), (false, true)] };
        assert_eq!(states.into_iter().collect::<Vec<_>>(), sides, "{what}");
    }
}

#[test]
fn sh_coefficients_of_1e4() {
    let gpu = Gpu::new();
    let camera = usual();
    let mut probe = Probe::new(&gpu, 64, &camera, Setup { degree: 3, ..Default::default() });
    for factor in [1e2f32, 1e4, -1e4] {
        let mut random = random_scene(5, 40, 12, 3);
        random
            .base
            .sh
            .iter_mut()
            .chain(&mut random.supplement.as_mut().unwrap().gaussians.sh)
            .flatten()
            .for_each(|c| *c *= factor);
        // Colours are sums of 16 terms of up to 1e4: what is left of 1 has 1e-3 of rounding, relative to the largest 1e-6. A
        // gradient of the direction through them is a difference of such terms.
        check(&mut probe, &camera, &random, &format!("SH × {factor}"), 1e-4, 1e-4, 1e-4);
    }
}

#[test]
fn lobes_at_the_ends_of_their_ranges() {
    let gpu = Gpu::new();
    let camera = usual();
    let company = company(&camera);
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    let blob =
        Blob { mean: camera.unproject(36.4, 28.7, 4.0), scale: [0.5, 0.3, 0.4], logit: 2.0, ..Default::default() };
    let v = (camera.eye() - blob.mean).normalize();
    let across = v.any_orthonormal_vector();
    let at = |theta: f64, length: f64| ((v * theta.cos() + across * theta.sin()) * length).as_vec3().to_array();
    let pi = std::f64::consts::PI;
    // (direction, T, β, seen, bound of the gradients)
    let mut cases = Vec::new();
    for width in [0.01f64, 0.1, 1.0] {
        let t = f64::from(width as f32);
        for sharpness in [-20.0f32, -2.0, 0.0, 8.0, 20.0] {
            // On the axis all is flat but β's own part. Off it: half of what it takes to halve the factor, or half of T.
            let half = (2.0 * (0.5f64.ln() / (2.0 * f64::from(sharpness).exp())).exp().acos() * t).min(0.5 * t * pi);
            let bound = if sharpness > 10.0 || (sharpness > 5.0 && width < 0.05) {
                f64::INFINITY
            } else if width < 0.05 {
                1e-2
            } else {
                1e-3
            };
            cases.push((at(0.5 * half, 1.0), width as f32, sharpness, None, bound));
            cases.push((
                at(0.0, 1.0),
                width as f32,
                sharpness,
                if sharpness > 10.0 { None } else { Some(true) },
                f64::INFINITY,
            ));
            if width > 0.05 {
                cases.push((at(0.1 * half, 1.0), width as f32, sharpness, Some(true), bound));
            }
            if width < 1.0 {
                cases.push((at(pi * t * 1.0001, 1.0), width as f32, sharpness, Some(false), 0.0));
            }
            // The cosine of ψ/2 is 1 again at 4 π.
            if width < 0.25 {
                cases.push((at(4.0 * pi * t, 1.0), width as f32, sharpness, Some(false), 0.0));
            }
            cases.push((
                at((pi * t * 0.9).min(pi * 0.9), 1.0),
                width as f32,
                sharpness,
                None,
                if sharpness < 5.0 { 1e-3 } else { f64::INFINITY },
            ));
        }
    }
    cases.push((at(pi, 1.0), 1.0, 0.0, Some(false), 0.0));
    // At θ near π with T = 1 the sine is small again, the quotient is not.
    cases.push((at(pi - 5e-5, 1.0), 1.0, -2.0, Some(true), 5e-2));
    for length in [1e-36, 1e-25, 1e-10, 1e10, 1e25, 1e37] {
        cases.push((at(0.4, length), 0.5, 0.5, Some(true), f64::INFINITY));
    }
    for direction in [[0.0; 3], [1e-40, 0.0, 0.0], [f32::NAN, 0.0, 1.0], [f32::INFINITY, 0.0, 0.0]] {
        cases.push((direction, 0.5, 0.0, Some(false), f64::INFINITY));
    }
    let plain = probe.shoot(&scene(&company), &camera, &vec![[0.0; 3]; camera.pixels() as usize]);
    for (direction, width, sharpness, seen, bound) in cases {
        let scene = with_lobes(&company, &[(blob, direction, width, sharpness)]);
        let what = format!("lobe {direction:?}, T {width}, β {sharpness}");
        let twin = probe.twin(&scene, &camera, 1e-4);
        let shot = probe.shoot(&scene, &camera, &twin.image_grad);
        assert!(seen.is_none_or(|seen| seen == (shot.tile_counts[2] > 0)), "{what}: seen {}", shot.tile_counts[2]);
        let finite = shot.image.iter().flatten().all(|x| x.is_finite());
        let supplement = shot.stepped.supplement.as_ref().unwrap();
        assert!(finite && supplement.gaussians.means[0].iter().all(|x| x.is_finite()), "{what}");
        if direction.iter().all(|d| d.is_finite()) {
            assert!(shot.is_finite(), "{what}");
            let [t, b] = [supplement.lobes.widths[0], supplement.lobes.sharpness[0]];
            assert!((0.01..=1.0).contains(&t), "{what}: {t}");
            assert!(shot.tile_counts[2] == 0 || (-2.0..=8.0).contains(&b), "{what}: {b}");
        }
        if shot.tile_counts[2] == 0 {
            assert_eq!(shot.image, plain.image, "{what}");
        } else if bound < f64::INFINITY {
            let d = distance(&shot, &twin);
            println!(
                "{what}: image {:.1e}, gradients {:?}",
                d.image,
                d.groups.iter().map(|g| format!("{} {:.1e}", g.0, g.1)).collect::<Vec<_>>()
            );
            assert!(d.worst() <= bound && d.image < 1e-3, "{what}: {d:?}");
        }
    }
}

/// A step of fixed length must not turn a short direction by any angle, nor a long one not at all.
#[test]
fn lobe_directions_of_any_length_turn_alike() {
    let gpu = Gpu::new();
    let camera = usual();
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    let blob =
        Blob { mean: camera.unproject(36.4, 28.7, 4.0), scale: [0.5, 0.3, 0.4], logit: 2.0, ..Default::default() };
    let v = (camera.eye() - blob.mean).normalize();
    let direction = v * 0.4f64.cos() + v.any_orthonormal_vector() * 0.4f64.sin();
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    for length in [1e-36, 1e-20, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e20, 1e37] {
        let lobe = (blob, (direction * length).as_vec3().to_array(), 0.5, 0.5);
        let shot = probe.shoot(&with_lobes(&company(&camera), &[lobe]), &camera, &image_grad);
        let stepped = shot.stepped.supplement.unwrap().lobes.directions[0];
        let stepped = DVec3::from_array(stepped.map(f64::from)) / if length > 100.0 { 1.0 } else { length.max(1e-30) };
        let turn = direction.angle_between(stepped.normalize());
        println!("direction of length {length:e}: turned by {turn:.1e}");
        // Each component moves by the rate: of a unit vector where the length is outside 0.01 to 100.
        let moved = f64::from(RATES[6]) / if (0.01..=100.0).contains(&length) { length } else { 1.0 };
        assert!(turn <= 1.8 * moved && turn > 0.1 * moved, "length {length}: turned by {turn}");
    }
}

/// θ is exactly 0: the quotient of two zeros is a limit there.
#[test]
fn a_lobe_seen_along_its_axis_learns() {
    let gpu = Gpu::new();
    let camera = Camera { rotation: glam::DMat3::IDENTITY, translation: DVec3::ZERO, ..usual() };
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    let blob = Blob { mean: DVec3::new(0.0, 0.0, 4.0), scale: [0.5, 0.3, 0.4], ..Default::default() };
    let before = with_lobes(&[], &[(blob, [0.0, 0.0, -1.0], 0.5, 0.5)]);
    let twin = probe.twin(&before, &camera, 1e-4);
    let shot = probe.shoot(&before, &camera, &twin.image_grad);
    let d = distance(&shot, &twin);
    assert!(shot.is_finite() && d.image < 1e-5 && d.worst() < 1e-4, "{d:?}");
    assert!(shot.gradients.lobes[..3].iter().all(|&g| g == 0.0));
    let (old, new) = (before.supplement.unwrap().gaussians, shot.stepped.supplement.unwrap().gaussians);
    assert!((new.opacities[0] - old.opacities[0]).abs() > 0.9 * RATES[3]);
}

// --- order and count ---

/// A scene of `count` Gaussians: `at` says where in the image, how deep and how wide.
fn cloud(camera: &Camera, count: usize, logit: f32, at: impl Fn(usize) -> (f64, f64, f64, f64)) -> Scene {
    let blobs: Vec<_> = (0..count)
        .map(|i| {
            let (x, y, z, px) = at(i);
            let s = px * z / camera.fx;
            let rgb = [
                (i * 7 % 11) as f32 / 12.0 + 0.05,
                (i * 5 % 13) as f32 / 14.0 + 0.05,
                (i * 3 % 17) as f32 / 18.0 + 0.05,
            ];
            Blob { mean: camera.unproject(x, y, z), scale: [s, 0.8 * s, 0.6 * s], logit, rgb, ..Default::default() }
        })
        .collect();
    scene(&blobs)
}

fn scattered(i: usize) -> (f64, f64, f64, f64) {
    let noise = |k: usize| ((i * 2654435761 + k * 40503) % 10007) as f64 / 10007.0;
    (noise(1) * f64::from(WIDTH), noise(2) * f64::from(HEIGHT), 1.0 + 9.0 * noise(3), 1.0 + 2.0 * noise(4))
}

#[test]
fn counts_about_the_sizes_of_workgroups_and_blocks() {
    let gpu = Gpu::new();
    let camera = usual();
    let mut probe = Probe::new(&gpu, 2049, &camera, Setup::default());
    for count in [0, 1, 7, 8, 9, 31, 32, 33, 63, 64, 65, 127, 128, 129, 1023, 1024, 1025, 2049] {
        let scene = cloud(&camera, count, -1.0, scattered);
        let shot = check(&mut probe, &camera, &scene, &format!("{count} Gaussians"), 1e-4, 1e-5, 1e-4);
        if count == 0 {
            assert_background(&shot);
        }
    }
}

#[test]
fn an_empty_view_is_the_background_and_not_the_last_image() {
    let gpu = Gpu::new();
    let camera = usual();
    let back = Camera { rotation: glam::DMat3::from_rotation_y(std::f64::consts::PI) * camera.rotation, ..camera };
    let back = Camera { translation: -(back.rotation * camera.eye()), ..back };
    let scene = scene(&company(&camera));
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    let zeros = vec![[0.0; 3]; camera.pixels() as usize];
    let seen = probe.shoot(&scene, &camera, &zeros);
    assert!(seen.image.iter().any(|p| p[3] < 0.9) && seen.depth.iter().any(|&z| z > 0.0));
    let empty = probe.shoot(&scene, &back, &zeros);
    assert_background(&empty);
    assert!(empty.depth.iter().all(|&z| z == 0.0) && empty.tile_counts == [0, 0]);
    assert_eq!(probe.shoot(&scene, &camera, &zeros).bits(), seen.bits());
}

/// 4.3 million Gaussians are more workgroups of 64 than a dimension of a dispatch has.
#[test]
fn more_gaussians_than_one_dimension_of_a_dispatch_has_groups() {
    let gpu = Gpu::new();
    let camera = Camera { rotation: glam::DMat3::IDENTITY, translation: DVec3::ZERO, ..camera_at(DVec3::ZERO, 16, 16) };
    let seen = [0usize, 4_194_239, 4_194_240, 4_194_241, 4_199_999];
    let count = 4_200_000;
    // Only the geometry is large; one plane of zeros is what most of them are: at the camera, hence not seen.
    let mut base = glint::scene::Gaussians { sh_degree: 0, ..Default::default() };
    base.means = vec![[0.0; 3]; count];
    base.log_scales = vec![[-3.0; 3]; count];
    base.quats = vec![[1.0, 0.0, 0.0, 0.0]; count];
    base.opacities = vec![0.0; count];
    base.sh = vec![[0.0; 3]; count];
    for (k, &i) in seen.iter().enumerate() {
        base.means[i] = camera.unproject(2.5 + 3.0 * k as f64, 8.5, 2.0).as_vec3().to_array();
    }
    let scene = Scene { base, supplement: None };
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    // 11 planes of 4.2 million floats are 185 MB: beyond a device with the least buffer that Vulkan allows, which says so.
    let model = Model::upload(&gpu, &scene, 0);
    assert_eq!(model.is_err(), 11 * 4 * count as u64 > gpu.info().max_storage_bytes);
    match model {
        Ok(model) => {
            let mut renderer = Renderer::new(&gpu, count as u32, &views, Default::default()).unwrap();
            let image = renderer.render(&model, &views, 0, BACKGROUND).unwrap();
            for (k, i) in seen.iter().enumerate() {
                let t = image.transmittance[8 * 16 + 2 + 3 * k];
                assert!(t < 0.6, "Gaussian {i} is missing: {t}");
            }
        }
        Err(error) => assert!(matches!(error, glint::gpu::GpuError::BufferTooLarge { .. }), "{error}"),
    }
}

#[test]
fn ten_thousand_at_one_depth_are_drawn_in_the_order_of_their_indices() {
    let gpu = Gpu::new();
    let camera = Camera { rotation: glam::DMat3::IDENTITY, translation: DVec3::ZERO, ..usual() };
    let mut probe = Probe::new(&gpu, 10_000, &camera, Setup::default());
    let mut scene = cloud(&camera, 10_000, -3.0, |i| {
        let (x, y, _, px) = scattered(i);
        (x, y, 4.0, px)
    });
    scene.base.means.iter_mut().for_each(|m| m[2] = 4.0);
    // The twin orders equal depths by index; its margins for order are 0 everywhere, so all else is asked of it here.
    let twin = probe.twin(&scene, &camera, 1e-4);
    let zeros = vec![[0.0; 3]; camera.pixels() as usize];
    let shot = probe.shoot(&scene, &camera, &zeros);
    let mut off = 0;
    for (p, want) in twin.rendered.blended.image.iter().enumerate() {
        let difference = (0..4).map(|c| (f64::from(shot.image[p][c]) - want[c]).abs()).fold(0.0, f64::max);
        // An α met at 1/255 changes a pixel by at most that much.
        assert!(difference < 1.1 / 255.0, "pixel {p} is off by {difference}");
        off += u32::from(difference > 1e-4);
    }
    assert!(off < camera.pixels() / 100, "{off} pixels");
    for _ in 0..3 {
        assert_eq!(probe.shoot(&scene, &camera, &zeros).bits(), shot.bits());
    }
}

#[test]
fn five_thousand_deep_on_one_pixel() {
    let gpu = Gpu::new();
    let camera = camera_at(DVec3::ZERO, 8, 8);
    let mut probe = Probe::new(&gpu, 5000, &camera, Setup::default());
    // Opacity 0.0055: the last is still seen through all others, T = 0.9945^3000 or so.
    for (logit, what) in [(-5.2f32, "5,000 thin layers"), (-1.0, "5,000 layers")] {
        let scene =
            cloud(&camera, 5000, logit, |i| (4.1, 3.9, 1.0 + 0.01 * ((i * 2741) % 5000) as f64, 2.0 + (i % 7) as f64));
        // Pixels with thousands of Gaussians are all near some threshold; a hundredth of the usual margin leaves most of them.
        check(&mut probe, &camera, &scene, what, 1e-6, 1e-4, 1e-3);
    }
}

#[test]
fn one_tile_receives_every_gaussian() {
    let gpu = Gpu::new();
    let camera = usual();
    let mut probe = Probe::new(&gpu, 40_000, &camera, Setup::default());
    // 40,000 splats narrower than a tile, all in one of 63: each pixel has its own few thousand.
    let scene = cloud(&camera, 40_000, -5.0, |i| {
        let (x, y, z, _) = scattered(i);
        (32.0 + 8.0 * x / f64::from(WIDTH), 24.0 + 8.0 * y / f64::from(HEIGHT), z + 1e-4 * i as f64, 0.3)
    });
    check(&mut probe, &camera, &scene, "40,000 in one tile", 1e-6, 1e-4, 1e-3);
}

#[test]
fn images_of_1_by_1_and_17_by_3_and_4097_by_5() {
    let gpu = Gpu::new();
    for (width, height) in [(1, 1), (17, 3), (4097, 5), (5, 4097)] {
        let camera = camera_at(DVec3::new(0.1, 0.2, -0.3), width, height);
        let mut probe = Probe::new(&gpu, 256, &camera, Setup::default());
        let scene = cloud(&camera, 256, 0.5, |i| {
            let (x, y, z, px) = scattered(i);
            (x / f64::from(WIDTH) * f64::from(width), y / f64::from(HEIGHT) * f64::from(height), z, px * 3.0)
        });
        check(&mut probe, &camera, &scene, &format!("{width} × {height}"), 1e-4, 1e-4, 1e-4);
    }
}

/// Eight Gaussians that fill an image of 3840 × 2160: 1,036,800 intersections, 129,600 of each. llvmpipe ends loops after 65,535
/// iterations: emission, and the sums over a Gaussian's slots, must make fewer.
#[test]
fn gaussians_that_fill_a_4k_image_have_all_their_tiles_and_gradients() {
    let gpu = Gpu::new();
    let camera = camera_at(DVec3::ZERO, 3840, 2160);
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    // Wider than the image by so much that each has one α everywhere.
    let scene = cloud(&camera, 8, -2.0, |i| (1920.0, 1080.0, 3.0 + i as f64, 3e6));
    let ones = vec![[1.0, 0.5, 0.25]; camera.pixels() as usize];
    let shot = probe.shoot(&scene, &camera, &ones);
    let alpha = 1.0 / (1.0 + 2f64.exp());
    for (p, pixel) in shot.image.iter().enumerate() {
        assert!((f64::from(pixel[3]) - (1.0 - alpha).powi(8)).abs() < 1e-6, "pixel {p}: {pixel:?}");
    }
    let pixels = f64::from(camera.pixels());
    for i in 0..8 {
        // ∂/∂DC = SH_C0 Σ α T ∂loss/∂rgb.
        let red = 0.28209479177387814 * alpha * (1.0 - alpha).powi(i as i32) * pixels;
        for (c, share) in [1.0, 0.5, 0.25].into_iter().enumerate() {
            let got = shot.gradients.sh[c * 8 + i];
            assert!(
                (got / (red * share) - 1.0).abs() < 5e-6,
                "Gaussian {i}, channel {c}: {got}, wanted {}",
                red * share
            );
        }
    }
}

/// `dispatch_args` has told the host by then; what lies behind the buffers' room must stay what it is until they have grown.
#[test]
fn what_does_not_fit_is_not_emitted() {
    let gpu = Gpu::new();
    let frame = Frame { image_first: 0, target_first: 0, width: 256, height: 256 };
    // One of a few rows of tiles, and one of all 32, whose slots begin at 100.
    let splat = |l: f32| Splat { x: 128.0, y: 128.0, l11: l, l22: l, opacity: 0.5, z: 1.0, ..Default::default() };
    let words = |name: &str, data: &[u32]| Buffer::from_slice(&gpu, name, data).unwrap();
    let emit = Emit::new(&gpu, &emit::Spec { workgroup_size: WORKGROUP, tile_width: 8, tile_height: 8, batch: false });
    let emit = emit.unwrap();
    for capacity in [2, 500] {
        let [tiles, globals] = ["isect tiles", "global from slot"].map(|name| words(name, &[7777; 2000]));
        let mut recorder = gpu.recorder("emit").unwrap();
        emit.record(
            &mut recorder,
            &emit::Buffers {
                frames: &Buffer::from_slice(&gpu, "frames", &[frame]).unwrap(),
                count: &words("count", &[2]),
                global_from_rank: &words("ranks", &[0, 1]),
                rank_first_slot: &words("first slots by rank", &[0, 100]),
                splats: &Buffer::from_slice(&gpu, "splats", &[splat(0.5), splat(1e-6)]).unwrap(),
                splat_frames: &words("splat frames", &[0, 0]),
                isect_tiles: &tiles,
                global_from_slot: &globals,
                first_slot: &words("first slots", &[0, 0]),
            },
            &emit::Push { frame_first: 0, tiles_x: 32, tiles_per_frame: 1024, capacity, count_index: 0 },
            &words("args", &[1, 1, 1]),
            0,
        );
        recorder.submit().unwrap().wait().unwrap();
        let (tiles, globals) = (tiles.download().unwrap(), globals.download().unwrap());
        let room = capacity as usize;
        assert!(tiles[room..].iter().chain(&globals[room..]).all(|&word| word == 7777), "{capacity}");
        let small = globals.iter().take_while(|&&g| g == 0).count();
        assert!(if room < 100 { small == room } else { small > 3 && globals[100..room].iter().all(|&g| g == 1) });
    }
}

/// 60 Gaussians that fill an image, more intersections than a trainer of so few has room for at first; and the same with so many
/// unseen ones that there is room from the start.
#[test]
fn training_in_too_little_room_gives_the_bits_of_training_in_enough() {
    let gpu = Gpu::new();
    let camera = camera_at(DVec3::new(0.4, -0.3, 0.2), 512, 384);
    // The second sees them as points, so that some steps fit and others do not.
    let far = Camera { translation: camera.translation + DVec3::new(0.0, 0.0, 3000.0), ..camera };
    let photographs: Vec<Vec<u8>> = [60, 200].map(|c| vec![c; 3 * camera.pixels() as usize]).into();
    let filling = cloud(&camera, 60, -2.0, |i| (256.0 + i as f64, 192.0, 3.0 + 0.1 * i as f64, 1000.0));
    let mut roomy = filling.clone();
    // Behind both cameras.
    let (unseen, behind) = (100_000, camera.unproject(256.0, 192.0, -1e4).as_vec3().to_array());
    roomy.base.means.extend(vec![behind; unseen]);
    roomy.base.log_scales.extend(vec![[-3.0; 3]; unseen]);
    roomy.base.quats.extend(vec![[1.0, 0.0, 0.0, 0.0]; unseen]);
    roomy.base.opacities.extend(vec![0.0; unseen]);
    roomy.base.sh.extend(vec![[0.0; 3]; unseen]);
    let images: Vec<&[u8]> = photographs.iter().map(Vec::as_slice).collect();
    let views = Views::upload(&gpu, &[camera, far], &images).unwrap();
    let trained = [&filling, &roomy].map(|scene| {
        let model = Model::upload(&gpu, scene, 0).unwrap();
        let options = BaseOptions { iterations: 8, sh_degree: 0, seed: 7, extent: 2.0, reduction: Reduction::Auto };
        let report = train_base(&gpu, &model, &views, BACKGROUND, &options, false, |_| ()).unwrap();
        let base = model.download().unwrap().base;
        let kept = (base.means[..60].to_vec(), base.quats[..60].to_vec(), base.sh[..60].to_vec());
        (report.steps.grown, report.losses, kept, base.opacities[..60].to_vec(), base.log_scales[..60].to_vec())
    });
    assert_eq!((trained[0].0, trained[1].0), (1, 0));
    assert!(trained[0].1 == trained[1].1 && trained[0].2 == trained[1].2);
    assert!(trained[0].3 == trained[1].3 && trained[0].4 == trained[1].4);
    assert!(trained[0].3 != filling.base.opacities);
}

// --- data ---

/// Every parameter of one Gaussian, base and supplementary, is in turn not a number: all that is not its own stays the same to the last bit.
#[test]
fn what_is_not_a_number_stays_where_it_is() {
    let gpu = Gpu::new();
    let camera = usual();
    let mut probe = Probe::new(&gpu, 512, &camera, Setup { degree: 1, ..Default::default() });
    let clean = random_scene(9, 160, 80, 1);
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let reference = probe.shoot(&clean, &camera, &image_grad);
    let base = (0..160).filter(|&i| reference.tile_counts[i] > 0).max_by_key(|&i| reference.tile_counts[i]).unwrap();
    let extra = (0..80)
        .filter(|&j| reference.tile_counts[160 + j] > 0)
        .max_by_key(|&j| reference.tile_counts[160 + j])
        .unwrap();
    // A Gaussian of opacity 0 is not there.
    let mut without = clean.clone();
    without.base.opacities[base] = -100.0;
    without.supplement.as_mut().unwrap().gaussians.opacities[extra] = -100.0;
    let absent = probe.shoot(&without, &camera, &image_grad);
    assert_ne!(absent.image, reference.image);
    let others = |shot: &Shot| {
        let mut s = shot.clone();
        let n = s.gradients.stride;
        for i in [base, 160 + extra] {
            s.tile_counts[i] = 0;
            for array in [&mut s.gradients.geometry, &mut s.gradients.sh] {
                (0..array.len() / n).for_each(|p| array[p * n + i] = 0.0);
            }
        }
        (0..5).for_each(|p| s.gradients.lobes[p * 80 + extra] = 0.0);
        let supplement = s.stepped.supplement.as_mut().unwrap();
        for (g, i) in [(&mut s.stepped.base, base), (&mut supplement.gaussians, extra)] {
            (g.means[i], g.log_scales[i], g.quats[i], g.opacities[i]) = ([0.0; 3], [0.0; 3], [0.0; 4], 0.0);
            g.sh[4 * i..4 * i + 4].fill([0.0; 3]);
        }
        let lobes = &mut supplement.lobes;
        (lobes.directions[extra], lobes.widths[extra], lobes.sharpness[extra]) = ([0.0; 3], 0.0, 0.0);
        s.bits()
    };
    let want = others(&absent);
    let mut poisoned = 0;
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for field in 0..28 {
            let mut scene = without.clone();
            let supplement = scene.supplement.as_mut().unwrap();
            let (g, i) = if field < 14 { (&mut scene.base, base) } else { (&mut supplement.gaussians, extra) };
            let clean = if field < 14 { &clean.base } else { &clean.supplement.as_ref().unwrap().gaussians };
            g.opacities[i] = clean.opacities[i];
            match field % 14 {
                f @ 0..3 => g.means[i][f] = bad,
                f @ 3..6 => g.log_scales[i][f - 3] = bad,
                f @ 6..10 => g.quats[i][f - 6] = bad,
                10 => g.opacities[i] = bad,
                11 => g.sh[4 * i][1] = bad,
                12 => g.sh[4 * i + 2][0] = bad,
                _ if field < 14 => continue,
                _ => supplement.lobes.directions[extra][1] = bad,
            }
            // +∞ of a logit is an opacity of 1, −∞ of a log scale a size of 0: these have a meaning, and draw.
            if bad == f32::INFINITY && field % 14 == 10 || bad == f32::NEG_INFINITY && (3..6).contains(&(field % 14)) {
                let shot = probe.shoot(&scene, &camera, &image_grad);
                assert!(shot.image.iter().flatten().all(|x| x.is_finite()), "{bad} in field {field}");
                continue;
            }
            let shot = probe.shoot(&scene, &camera, &image_grad);
            assert!(
                shot.tile_counts[if field < 14 { base } else { 160 + extra }] == 0,
                "{bad} in field {field} is seen"
            );
            assert!(shot.image == absent.image, "{bad} in field {field} shows in the image");
            assert!(others(&shot) == want, "{bad} in field {field} shows in gradients or steps");
            poisoned += 1;
        }
    }
    for (width, sharpness) in
        [(f32::NAN, 0.0), (0.5, f32::NAN), (0.5, f32::INFINITY), (f32::INFINITY, 0.0), (-1.0, 0.0), (0.0, 0.0)]
    {
        let mut scene = without.clone();
        let supplement = scene.supplement.as_mut().unwrap();
        supplement.gaussians.opacities[extra] = clean.supplement.as_ref().unwrap().gaussians.opacities[extra];
        (supplement.lobes.widths[extra], supplement.lobes.sharpness[extra]) = (width, sharpness);
        let shot = probe.shoot(&scene, &camera, &image_grad);
        assert!(shot.image.iter().flatten().all(|x| x.is_finite()), "T {width}, β {sharpness}");
        if shot.tile_counts[160 + extra] == 0 {
            assert!(others(&shot) == want, "T {width}, β {sharpness}");
        }
        poisoned += 1;
    }
    println!("{poisoned} poisoned scenes");
}

// --- stiffness ---

/// What 500 steps of training did.
struct Trained {
    start: f64,
    end: f64,
    scene: Scene,
}

const STEPS: u32 = 500;

fn train(gpu: &Gpu, cameras: &[Camera], photographs: &[Vec<u8>], scene: &Scene, origin: DVec3) -> Trained {
    let images: Vec<&[u8]> = photographs.iter().map(Vec::as_slice).collect();
    let views = Views::upload_around(gpu, origin, cameras, &images).unwrap();
    let model = Model::upload_around(gpu, origin, scene, 0).unwrap();
    let options = BaseOptions { iterations: STEPS, sh_degree: 0, seed: 7, extent: 2.0, reduction: Reduction::Auto };
    let report = train_base(gpu, &model, &views, BACKGROUND, &options, false, |_| ()).unwrap();
    assert!(report.losses.iter().all(|l| l.is_finite()));
    let mean = |l: &[f32]| l.iter().map(|&l| f64::from(l)).sum::<f64>() / l.len() as f64;
    let v = cameras.len();
    Trained {
        start: mean(&report.losses[..v]),
        end: mean(&report.losses[report.losses.len() - v..]),
        scene: model.download().unwrap(),
    }
}

/// Four cameras around a scene of 150 blobs, what they photograph, and the blobs; all moved by `offset`.
fn photographed(gpu: &Gpu, offset: DVec3) -> (Vec<Camera>, Vec<Vec<u8>>, Vec<Blob>) {
    let first = usual();
    let middle = first.unproject(36.0, 28.0, 4.0);
    let cameras: Vec<Camera> = (0..4)
        .map(|k| {
            let turn = glam::DMat3::from_rotation_y(0.15 * (f64::from(k) - 1.5));
            let rotation = first.rotation * turn;
            let eye = middle + turn.transpose() * (first.eye() - middle) + offset;
            Camera { rotation, translation: -(rotation * eye), ..first }
        })
        .collect();
    let truth: Vec<Blob> = (0..150)
        .map(|i| {
            let (x, y, z, px) = scattered(i);
            let s = 3.0 * px * (2.0 + 0.4 * z) / first.fx;
            let rgb = [(i % 7) as f32 / 7.0, (i % 5) as f32 / 5.0, (i % 3) as f32 / 3.0];
            // Steps of 1/4, which float32 has at 1e6: the offset itself loses nothing.
            let mean = (first.unproject(x, y, 2.0 + 0.4 * z) * 4.0).round() / 4.0 + offset;
            Blob { mean, scale: [s, 0.7 * s, 0.5 * s], logit: 2.0, rgb, ..Default::default() }
        })
        .collect();
    let origin = offset;
    let views = Views::upload_around(gpu, origin, &cameras, &[]).unwrap();
    let model = Model::upload_around(gpu, origin, &scene(&truth), 0).unwrap();
    let mut renderer = Renderer::new(gpu, 150, &views, Default::default()).unwrap();
    let photographs = (0..4)
        .map(|v| {
            let image = renderer.render(&model, &views, v, BACKGROUND).unwrap();
            image.color.iter().map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8).collect()
        })
        .collect();
    (cameras, photographs, truth)
}

/// No parameter goes further than Adam's bound lets it, in 500 steps: 7.3 rates each.
fn assert_bounded(before: &Scene, after: &Scene, what: &str) {
    let g = (&before.base, &after.base);
    let far = |a: &[[f32; 3]], b: &[[f32; 3]]| {
        a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
    };
    let steps = f64::from(STEPS) * 7.3;
    assert!(far(&g.0.log_scales, &g.1.log_scales) <= steps * 5e-3, "{what}");
    assert!(far(&g.0.sh, &g.1.sh) <= steps * 2.5e-3, "{what}");
    // The position's rate falls from 1.6e-4 to 1.6e-6 × extent; float32 has steps of 0.06 at 1e6.
    let ulp = g.0.means.iter().flatten().map(|m| m.abs()).fold(0.0, f32::max) * f32::EPSILON;
    assert!(far(&g.0.means, &g.1.means) <= steps * 3.2e-4 + f64::from(ulp), "{what}");
    let p = glint::reference::Params::from_scene(after).unwrap();
    assert!(p.geometry.iter().chain(&p.sh).all(|x| x.is_finite()), "{what}");
}

#[test]
fn stiff_problems_train_without_divergence() {
    let gpu = Gpu::new();
    let (cameras, photographs, truth) = photographed(&gpu, DVec3::ZERO);
    // Where they begin: off by a few pixels, and grey.
    let ordinary: Vec<Blob> = truth
        .iter()
        .enumerate()
        .map(|(i, b)| Blob {
            mean: b.mean + 0.05 * DVec3::new((i % 3) as f64 - 1.0, (i % 5) as f64 - 2.0, 0.0),
            rgb: [0.5; 3],
            ..*b
        })
        .collect();
    type Spoil = fn(usize, Blob) -> Blob;
    let problems: [(&str, Spoil); 6] = [
        ("ordinary", |_, b| b),
        ("scales from 1e-5 to 1e3", |i, b| match i % 5 {
            0 => Blob { scale: [1e-5; 3], ..b },
            1 if i < 50 => Blob { scale: [1e3; 3], logit: -4.0, ..b },
            2 if i < 50 => Blob { scale: [1e3, 1e-5, 1e-5], ..b },
            _ => b,
        }),
        ("opacities from 0.0025 to 1 − 2e-9", |i, b| Blob { logit: [-6.0, 20.0, 2.0, 10.0, -3.0][i % 5], ..b }),
        ("quaternions of length 1e-20 to 1e20", |i, b| {
            let length = [1e-20, 1e-3, 1.0, 1e3, 1e20][i % 5];
            Blob { quat: b.quat.map(|q| q * length), ..b }
        }),
        ("needles of 1 : 1e5 across the image", |i, b| Blob {
            scale: if i % 4 == 0 { [10.0, 1e-4, 1e-4] } else { b.scale },
            ..b
        }),
        ("all of it", |i, b| Blob {
            scale: [[1e-5, 1e-5, 1e-5], b.scale, [1e2, 1e-3, 1e-5], b.scale][i % 4],
            logit: [-6.0, 20.0, 2.0, 10.0, -3.0][i % 5],
            quat: b.quat.map(|q| q * [1e-20, 1.0, 1e20][i % 3]),
            ..b
        }),
    ];
    for (what, spoil) in problems {
        let blobs: Vec<Blob> = ordinary.iter().enumerate().map(|(i, &b)| spoil(i, b)).collect();
        let start = scene(&blobs);
        // Squares of gradients by parameter are the diagonal that Adam divides by, and stand for the Hessian's. Without quaternions,
        // whose gradients have any size that one likes.
        let mut probe = Probe::new(&gpu, 150, &cameras[0], Setup::default());
        let image_grad: Vec<_> = (0..cameras[0].pixels() as usize).map(ripple).collect();
        let g = probe.shoot(&start, &cameras[0], &image_grad).gradients;
        let kept = g.geometry[..6 * g.stride].iter().chain(&g.geometry[10 * g.stride..]);
        let squares: Vec<f64> = kept.filter(|g| **g != 0.0).map(|g| g * g).collect();
        let span = squares.iter().copied().fold(0.0, f64::max) / squares.iter().copied().fold(f64::INFINITY, f64::min);
        let trained = train(&gpu, &cameras, &photographs, &start, DVec3::ZERO);
        println!("{what}: curvatures span {span:.0e}; loss {:.4} → {:.4}", trained.start, trained.end);
        assert!((span > 1e10 || what == "ordinary") && trained.end < trained.start, "{what}");
        assert_bounded(&start, &trained.scene, what);
    }
}

/// At 1e6 units from the origin float32 has steps of 0.06: without recentring no position can learn, and none is drawn where it is.
#[test]
fn a_scene_far_from_its_origin_trains_as_it_does_at_home() {
    let gpu = Gpu::new();
    let offset = DVec3::new(1048576.0, -524288.0, 1048576.0);
    let losses = [DVec3::ZERO, offset].map(|offset| {
        let (cameras, photographs, truth) = photographed(&gpu, offset);
        let grey: Vec<Blob> =
            truth.iter().map(|b| Blob { mean: b.mean + DVec3::new(0.25, 0.0, 0.0), rgb: [0.5; 3], ..*b }).collect();
        let origin = glint::pipelines::views::origin_for(&cameras);
        let naive = train(&gpu, &cameras, &photographs, &scene(&grey), DVec3::ZERO);
        let trained = train(&gpu, &cameras, &photographs, &scene(&grey), origin);
        println!(
            "{offset}: loss {:.5} → {:.5} counted from {origin:.0}, {:.5} → {:.5} counted from the world's origin",
            trained.start, trained.end, naive.start, naive.end
        );
        assert_bounded(&scene(&grey), &trained.scene, "far");
        (trained.start, trained.end, naive.end)
    });
    let [home, far] = losses;
    // The same start; another middle rounds otherwise, and 500 steps of Adam carry that to a few hundredths of the end.
    assert!((far.0 - home.0).abs() < 1e-5 && (far.1 - home.1).abs() < 0.1 * home.1, "{losses:?}");
    // What the recentring is for.
    assert!(far.2 > 1.3 * home.1, "{losses:?}");
}

// --- the 2D stage ---

/// One frame of 2D Gaussians: image, gradients, and planes after a step, planes × slots.
struct Flat<'a> {
    gpu: &'a Gpu,
    raster: Raster,
    project: PlaneProject,
    backward: [PlaneBackward; 2],
}

const SLOTS: usize = 24;
const FLAT: (u32, u32) = (40, 30);

impl<'a> Flat<'a> {
    fn new(gpu: &'a Gpu) -> Self {
        let options = RasterOptions {
            splats: SLOTS as u32,
            pixels: FLAT.0 * FLAT.1,
            tiles: 5 * 4,
            isects: 1 << 12,
            batch: true,
            background_image: false,
            median: false,
            backward: true,
            reduction: Reduction::Auto,
        };
        let raster = Raster::new(gpu, options).unwrap();
        let (tile_width, tile_height) = (raster.tile.width, raster.tile.height);
        let spec = plane_project::Spec { workgroup_size: WORKGROUP, tile_width, tile_height };
        let backward = |gradients| {
            PlaneBackward::new(gpu, &plane_backward::Spec { workgroup_size: WORKGROUP, gradients }).unwrap()
        };
        Flat {
            gpu,
            project: PlaneProject::new(gpu, &spec).unwrap(),
            raster,
            backward: [backward(true), backward(false)],
        }
    }

    fn run(
        &self,
        planes: &[Plane],
        slots: &[u32],
        depths: &[f32],
        image_grad: &[[f64; 3]],
    ) -> (Vec<[f32; 4]>, Vec<f32>, Vec<f32>) {
        let (gpu, raster, n) = (self.gpu, &self.raster, SLOTS as u32);
        let columns: Vec<f32> = (0..10 * SLOTS).map(|k| planes[k % SLOTS][k / SLOTS] as f32).collect();
        let frame = Frame { image_first: 0, target_first: 0, width: FLAT.0, height: FLAT.1 };
        let frames = Buffer::from_slice(gpu, "frames", &[frame]).unwrap();
        let plane_frames = Buffer::from_slice(gpu, "plane frames", slots).unwrap();
        let states = Buffer::from_slice(gpu, "states", &[PlaneState { count: n, stepping: 1 }]).unwrap();
        let depths = Buffer::from_slice(gpu, "depths", depths).unwrap();
        let plane = Buffer::from_slice(gpu, "plane", &columns).unwrap();
        let status = Buffer::<u32>::zeroed(gpu, "status", 2).unwrap();
        let ages = Buffer::<u32>::zeroed(gpu, "ages", SLOTS).unwrap();
        let moments = [(); 2].map(|()| Buffer::<f32>::zeroed(gpu, "moments", 18 * SLOTS).unwrap());
        let flat: Vec<f32> = image_grad.iter().flatten().map(|&g| g as f32).collect();
        raster.image_grad.upload(0, &flat).unwrap();
        let grid = raster.grid(0, 1, FLAT.0, FLAT.1);
        let mut recorder = gpu.recorder("flat").unwrap();
        self.project.record(
            &mut recorder,
            &plane_project::Buffers {
                frames: &frames,
                plane_frames: &plane_frames,
                plane_states: &states,
                depths: &depths,
                plane: &plane,
                splats: &raster.splats,
                depth_keys: &raster.depth_keys,
                tile_counts: &raster.tile_counts,
            },
            &plane_project::Push { count: n, stride: n },
        );
        raster.record_order(&mut recorder, n, &grid, &frames, &plane_frames, &status);
        raster.record_blend(&mut recorder, &grid, &frames, BACKGROUND, 0.0);
        raster.record_blend_backward(&mut recorder, &grid, &frames, 0);
        for (stage, moments) in self.backward.iter().zip(&moments) {
            let buffers = plane_backward::Buffers {
                status: &status,
                frames: &frames,
                plane_frames: &plane_frames,
                plane_states: &states,
                tile_counts: &raster.tile_counts,
                first_slot: &raster.first_slot,
                records: &raster.records,
                plane: &plane,
                plane_ages: &ages,
                plane_moments: moments,
            };
            stage.record(&mut recorder, &buffers, &plane_backward::Push { count: n, stride: n, by_gaussian: 0 });
        }
        recorder.submit().unwrap().wait().unwrap();
        let gradients = moments[0].download().unwrap();
        let gradients = (0..9 * SLOTS).map(|k| gradients[k / SLOTS * 2 * SLOTS + k % SLOTS]).collect();
        (raster.image.download().unwrap(), gradients, plane.download().unwrap())
    }
}

fn flat_planes() -> Vec<Plane> {
    (0..SLOTS)
        .map(|i| {
            let (x, y) = ((i * 17 % 40) as f64 + 0.25, (i * 11 % 30) as f64 + 0.75);
            let rgb = |k: usize| ((i * k % 7) as f64 / 7.0) as f32 as f64;
            [x, y, rgb(2), rgb(3), rgb(4), -1.0, 0.5, 1.25, 0.5, 0.0]
        })
        .collect()
}

fn flat_depths() -> Vec<f32> {
    (0..FLAT.0 * FLAT.1).map(|p| 2.0 + (p * 37 % 101) as f32 / 50.0).collect()
}

#[test]
fn extreme_2d_gaussians_have_the_twins_gradients() {
    let gpu = Gpu::new();
    let flat = Flat::new(&gpu);
    let cap = f64::from(0.7f32.ln());
    // (what, logit, log scales, angle, centre); scales are capped at 0.01 (W + H) = 0.7 px by the steps, not by the kernels.
    let cases = [
        ("logit 20", 20.0, [0.5, 1.25], 0.5, [20.25, 15.75]),
        ("logit 30", 30.0, [0.5, 1.25], 0.5, [20.25, 15.75]),
        ("logit 100", 100.0, [0.5, 1.25], 0.5, [20.25, 15.75]),
        ("at the cap", 1.0, [cap, cap], 0.5, [20.25, 15.75]),
        ("a needle of 1 : 400", 3.0, [4.0, -2.0], 0.7, [20.25, 15.75]),
        ("a needle on a diagonal", 6.0, [3.9, -1.0], 0.785, [20.25, 15.75]),
        ("a needle near the horizontal", 6.0, [3.9, -1.0], 0.4, [20.25, 15.75]),
        ("thinner than a pixel", 6.0, [-1.5, -1.5], 0.7, [20.25, 15.75]),
        ("filling the image", 0.0, [6.0, 5.5], 0.7, [20.25, 15.75]),
        ("wider than all", 0.0, [15.0, 15.5], 0.7, [20.25, 15.75]),
        ("in the first corner", 1.0, [0.5, 1.25], 0.5, [0.0, 0.0]),
        ("in the last corner", 1.0, [0.5, 1.25], 0.5, [40.0, 30.0]),
        ("turned 300 times", 1.0, [0.5, 1.25], 300.5, [20.25, 15.75]),
    ];
    let mut options =
        Options { tile_width: flat.raster.tile.width, tile_height: flat.raster.tile.height, ..Default::default() };
    options.active_degree = 0;
    for (what, logit, log_scale, angle, centre) in cases {
        let mut planes = flat_planes();
        planes[5] = [centre[0], centre[1], 0.75, 0.5, 0.25, logit, log_scale[0], log_scale[1], angle, 0.0];
        planes.iter_mut().flatten().for_each(|x| *x = f64::from(*x as f32));
        let mut twin = planes.clone();
        let depths: Vec<f64> = flat_depths().iter().map(|&z| f64::from(z)).collect();
        let projected = plane_project_twin(&mut twin, &depths, FLAT.0, FLAT.1, &options);
        let isects = Intersections::new(&projected.splats, &projected.depths, Tiling::new(FLAT.0, FLAT.1, &options));
        let blended = blend(&projected.splats, &isects, Background::Color(BACKGROUND.map(f64::from)), 0.0);
        let grads: Vec<[f64; 3]> = (0..blended.image.len())
            .map(|p| {
                let m = &blended.margins[p];
                if m.alpha.min(m.transmittance).min(m.clamp) > 1e-4 { ripple(p) } else { [0.0; 3] }
            })
            .collect();
        let records = blend_backward(&projected.splats, &isects, &blended.image, &grads);
        let want = plane_backward_twin(&twin, &projected.tile_counts, &isects, &records);
        let (image, got, stepped) = flat.run(&planes, &[0; SLOTS], &flat_depths(), &grads);
        let worst = image.iter().zip(&blended.image).zip(&grads).filter(|(_, g)| **g != [0.0; 3]);
        let worst = worst.flat_map(|((a, b), _)| (0..4).map(|c| (f64::from(a[c]) - b[c]).abs())).fold(0.0, f64::max);
        assert!(worst < 2e-5, "{what}: image off by {worst}");
        let mut line = Vec::new();
        for p in 0..9 {
            let pairs: Vec<(f64, f64)> = (0..SLOTS).map(|i| (f64::from(got[p * SLOTS + i]), want[i][p])).collect();
            // The extreme one's own gradient, beside whose size the others' would hide it or be hidden.
            for pairs in [&pairs[5..6], &pairs[..]] {
                let size = pairs.iter().map(|(_, w)| w * w).sum::<f64>().sqrt();
                let d = pairs.iter().map(|(g, w)| (g - w).powi(2)).sum::<f64>().sqrt();
                line.push(format!("{:.0e}", d / size));
                // Single gradients are sums that partly cancel; an angle in float32 has 3e-5 rad at 300, 1e-3 of the ellipse.
                let bound = if angle > 100.0 { 1e-2 } else { 1e-3 };
                assert!(d <= bound * size + 1e-6, "{what}: plane {p} off by {d} of {size}");
            }
        }
        println!("{what}: image {worst:.0e}, gradients {line:?}");
        if (20.0..=30.0).contains(&logit) {
            assert!(
                got[5 * SLOTS + 5] != 0.0 && (f64::from(stepped[5 * SLOTS + 5]) - logit).abs() > 0.01,
                "{what} cannot recover"
            );
        }
        assert!(stepped.iter().all(|x| x.is_finite()), "{what}");
        // Half a turn changes no ellipse.
        assert!(stepped[8 * SLOTS + 5].abs() < 1.6, "{what}: turned to {}", stepped[8 * SLOTS + 5]);
    }
}

#[test]
fn a_2d_gaussian_that_is_not_a_number_stays_alone() {
    let gpu = Gpu::new();
    let flat = Flat::new(&gpu);
    let grads: Vec<_> = (0..(FLAT.0 * FLAT.1) as usize).map(ripple).collect();
    let mut slots = [0; SLOTS];
    slots[5] = u32::MAX;
    let others = |(image, gradients, planes): (Vec<[f32; 4]>, Vec<f32>, Vec<f32>)| {
        let kept = |v: Vec<f32>| {
            v.into_iter().enumerate().filter(|(k, _)| k % SLOTS != 5).map(|(_, x)| x.to_bits()).collect::<Vec<_>>()
        };
        (image, kept(gradients), kept(planes))
    };
    let without = others(flat.run(&flat_planes(), &slots, &flat_depths(), &grads));
    let with = others(flat.run(&flat_planes(), &[0; SLOTS], &flat_depths(), &grads));
    assert!(without.0 != with.0);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for p in 0..9 {
            let mut planes = flat_planes();
            planes[5][p] = bad;
            // An opacity of 1 is one.
            if p == 5 && bad == f64::INFINITY {
                continue;
            }
            planes[5][9] = 7.0;
            let result = flat.run(&planes, &[0; SLOTS], &flat_depths(), &grads);
            assert_eq!(flat.raster.tile_counts.download().unwrap()[5], 0, "{bad} in plane {p} is seen");
            // A centre that is no place asks no pixel for its depth.
            assert!(p >= 2 || result.2[9 * SLOTS + 5] == 7.0, "{bad} in plane {p}");
            assert!(others(result) == without, "{bad} in plane {p}");
        }
        // A depth map with a hole that is no number: behind all others.
        let mut depths = flat_depths();
        let at = (flat_planes()[5][1] as u32 * FLAT.0 + flat_planes()[5][0] as u32) as usize;
        depths[at] = bad as f32;
        let (image, gradients, planes) = flat.run(&flat_planes(), &[0; SLOTS], &depths, &grads);
        assert!(
            image.iter().flatten().chain(&gradients).all(|x| x.is_finite())
                && planes[..9 * SLOTS].iter().all(|x| x.is_finite()),
            "depth {bad}"
        );
        assert!(bad > 0.0 || planes[9 * SLOTS + 5] == 0.0, "depth {bad} is kept");
    }
}

/// Only the last pixels of an image of 3840 × 2160 have a loss: they are drawn, by a kernel that goes through all of them five times.
#[test]
fn pixels_at_the_end_of_a_4k_image_can_be_drawn() {
    let gpu = Gpu::new();
    let (width, height, slots) = (3840u32, 2160u32, 20u32);
    let pixels = (width * height) as usize;
    let mut loss = vec![0f32; pixels];
    loss[pixels - 50..].fill(0.5);
    let words = |name: &str, len: usize| Buffer::<u32>::zeroed(&gpu, name, len).unwrap();
    let floats = |name: &str, len: usize| Buffer::<f32>::zeroed(&gpu, name, len).unwrap();
    let frame = Frame { image_first: 0, target_first: 0, width, height };
    let quota = Quota { view: 0, first: 0, budget: slots };
    let plane_frames = Buffer::from_slice(&gpu, "plane frames", &[u32::MAX; 20]).unwrap();
    let (plane, states) = (floats("plane", 10 * 20), Buffer::<PlaneState>::zeroed(&gpu, "states", 1).unwrap());
    let mut recorder = gpu.recorder("draw").unwrap();
    // The stage's own workgroup in the pipeline.
    PlaneDraw::new(&gpu, &plane_draw::Spec { workgroup_size: 256 }).unwrap().record(
        &mut recorder,
        &plane_draw::Buffers {
            status: &words("status", 2),
            frames: &Buffer::from_slice(&gpu, "frames", &[frame]).unwrap(),
            quotas: &Buffer::from_slice(&gpu, "quotas", &[quota]).unwrap(),
            loss_map: &Buffer::from_slice(&gpu, "loss map", &loss).unwrap(),
            image: &Buffer::<[f32; 4]>::zeroed(&gpu, "image", pixels).unwrap(),
            drawn_pixels: &words("drawn", 20),
            plane_states: &states,
            plane_frames: &plane_frames,
            plane: &plane,
            plane_ages: &words("ages", 20),
            plane_moments: &floats("moments", 18 * 20),
        },
        &plane_draw::Push { frame_count: 1, stride: slots, round: 1, seed: 1 },
    );
    recorder.submit().unwrap().wait().unwrap();
    let taken = plane_frames.download().unwrap().iter().filter(|&&f| f == 0).count();
    assert_eq!((taken, states.download().unwrap()[0].count), (4, 4));
    let planes = plane.download().unwrap();
    for i in 0..4 {
        let (x, y) = (planes[i], planes[20 + i]);
        assert!(y == 2159.5 && x > 3840.0 - 50.0, "({x}, {y})");
    }
}

#[test]
fn what_leaves_float32_on_the_way_is_not_seen() {
    let gpu = Gpu::new();
    let camera = usual();
    let company = company(&camera);
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let alone = probe.shoot(&scene(&company), &camera, &image_grad);
    // Axes of 1.5e9 px are within it, ends 5e9 px away beyond any int: it fills the image.
    let wide = Blob { mean: camera.unproject(36.0, 28.0, 4.0), scale: [1e8; 3], ..company[0] };
    let shot = probe.shoot(&scene(&[company[0], company[1], wide]), &camera, &image_grad);
    let tile = probe.options();
    assert_eq!(shot.tile_counts[2], WIDTH.div_ceil(tile.tile_width) * HEIGHT.div_ceil(tile.tile_height));
    // A mean whose camera z is beyond 3.4e38 while its x and y are not: no component of the axis is near 1.
    let beyond = 3.6e38 * camera.rotation.row(2);
    for blob in [
        Blob { mean: camera.unproject(36.0, 28.0, 4.0), scale: [1e9; 3], ..company[0] },
        Blob { mean: camera.unproject(36.0, 28.0, 4.0), scale: [1e30; 3], ..company[0] },
        Blob { mean: camera.unproject(36.0, 28.0, 4.0), scale: [1e38, 1e-30, 1e38], ..company[0] },
        Blob { mean: beyond, ..company[0] },
        // Nor is a place that is beyond it while z is not.
        Blob { mean: 3.6e38 * camera.rotation.row(0) + 1e38 * camera.rotation.row(2), ..company[0] },
        Blob { mean: 3.6e38 * camera.rotation.row(1) + 1e38 * camera.rotation.row(2), ..company[0] },
    ] {
        let shot = probe.shoot(&scene(&[company[0], company[1], blob]), &camera, &image_grad);
        assert_eq!(shot.tile_counts[2], 0, "{blob:?}");
        assert!(shot.image == alone.image && shot.is_finite(), "{blob:?}");
    }
}

/// A loss that is steeper than float32's squares: Adam must move by its rate, not by rate · g / ∞.
#[test]
fn a_gradient_whose_square_overflows_moves_a_parameter_by_its_rate() {
    let gpu = Gpu::new();
    let camera = usual();
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
    let before = scene(&company(&camera));
    let steep: Vec<_> = (0..camera.pixels() as usize).map(|p| ripple(p).map(|g| g * 1e22)).collect();
    let shot = probe.shoot(&before, &camera, &steep);
    assert!(shot.is_finite() && shot.gradients.geometry[10 * 2].abs() > 1e20);
    assert_one_step(&shot, &before, "steep");
    // And what is not finite leaves its Gaussian as it is.
    let mut broken = vec![[0.0; 3]; camera.pixels() as usize];
    broken[25 * WIDTH as usize + 30] = [f64::NAN, 0.0, 0.0];
    assert_eq!(probe.shoot(&before, &camera, &broken).stepped, before);
    // Of those that learn their opacity alone too.
    let mut frozen = Probe::new(&gpu, 8, &camera, Setup { opacity_only: true, ..Default::default() });
    assert_eq!(frozen.shoot(&before, &camera, &broken).stepped, before);
    let moved = frozen.shoot(&before, &camera, &steep).stepped.base;
    for (new, old) in moved.opacities.iter().zip(&before.base.opacities) {
        assert!(((new - old).abs() - RATES[3]).abs() < 1e-4 * RATES[3], "{old} → {new}");
    }
    assert_eq!(moved.means, before.base.means);
}

/// The same of the 2D stage.
#[test]
fn a_2d_gradient_whose_square_overflows_moves_a_parameter_by_its_rate() {
    let gpu = Gpu::new();
    let flat = Flat::new(&gpu);
    let pixels = (FLAT.0 * FLAT.1) as usize;
    let steep: Vec<_> = (0..pixels).map(|p| ripple(p).map(|g| g * 1e22)).collect();
    let (_, gradients, stepped) = flat.run(&flat_planes(), &[0; SLOTS], &flat_depths(), &steep);
    let logit = 5 * SLOTS..6 * SLOTS;
    for (g, new) in gradients[logit.clone()].iter().zip(&stepped[logit]) {
        assert!(g.abs() > 1e19 && ((new + 1.0).abs() - 0.02).abs() < 1e-5, "{g:e}: −1 → {new}");
    }
    let (_, _, stepped) = flat.run(&flat_planes(), &[0; SLOTS], &flat_depths(), &vec![[f64::NAN; 3]; pixels]);
    for (i, plane) in flat_planes().iter().enumerate() {
        assert!((0..9).all(|p| stepped[p * SLOTS + i] == plane[p] as f32), "{i}");
    }
}

#[test]
fn depths_lie_before_the_near_plane_even_inside_a_gaussian() {
    let gpu = Gpu::new();
    let camera = usual();
    let mut probe = Probe::new(&gpu, 8, &camera, Setup::default());
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
            let want = median_depth(&params, &view, median, DepthAt::MaximumResponse);
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

/// 33 Gaussians that fill 3840 × 2160 pixels: 4.28 million intersections, more workgroups of 64 than the 65,535 of a dimension, in
/// buffers that every device has, and 65 times as many as there was room for at first.
#[test]
fn more_intersections_than_one_dimension_of_a_dispatch_has_groups() {
    let gpu = Gpu::new();
    let camera = camera_at(DVec3::ZERO, 3840, 2160);
    let scene = cloud(&camera, 33, -3.0, |i| (1920.0, 1080.0, 3.0 + i as f64, 3e6));
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut renderer = Renderer::new(&gpu, 33, &views, Default::default()).unwrap();
    let image = renderer.render(&model, &views, 0, BACKGROUND).unwrap();
    let isects: u32 = renderer.raster.tile_counts.download().unwrap().iter().sum();
    let fill = f64::from(isects) / f64::from(renderer.raster.grid(0, 1, 3840, 2160).tiles());
    assert!(fill == 33.0 && renderer.raster.capacity() >= isects);
    let want = (1.0 - 1.0 / (1.0 + 3f64.exp())).powi(33);
    for (p, &t) in image.transmittance.iter().enumerate() {
        assert!((f64::from(t) - want).abs() < 1e-5, "pixel {p}: {t}, wanted {want}");
    }
}

/// 34,000 Gaussians that fill 3840 × 2160 pixels, in tiles of 8 × 8 4.4e9 intersections, 1.1e8 beyond what 32 bits count: an
/// error, not the image of 1.1e8, nor a loop that never has room enough. Larger tiles too need more than the 4 GiB that can be bound.
#[test]
fn more_intersections_than_can_be_counted_are_an_error() {
    let gpu = Gpu::new();
    let camera = camera_at(DVec3::ZERO, 3840, 2160);
    let count = 34_000;
    let scene = cloud(&camera, count, -3.0, |i| (1920.0, 1080.0, 3.0 + 1e-3 * i as f64, 3e6));
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut renderer = Renderer::new(&gpu, count as u32, &views, Default::default()).unwrap();
    let error = renderer.render(&model, &views, 0, BACKGROUND).unwrap_err();
    assert!(matches!(error, glint::Error::Gpu(glint::gpu::GpuError::BufferTooLarge { .. })), "{error}");
}
