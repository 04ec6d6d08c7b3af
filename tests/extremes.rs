//! Inputs at and beyond what a scene usually holds: each has an outcome, written in docs/extremes.md, and a test here.

mod common;
#[path = "common/probe.rs"]
mod probe;

use common::Gpu;
use glam::DVec3;
use glint::{
    pipelines::{model::Model, render::Renderer, views::Views},
    reference::random_scene,
    scene::{Camera, Scene},
};
use probe::{BACKGROUND, Blob, Probe, RATES, Setup, Shot, camera_at, distance, ripple, scene, with_lobes};

const WIDTH: u32 = 72;
const HEIGHT: u32 = 56;

/// Where Adam's first step must have gone: the rate times g / (|g| + 1e-15), whatever the gradient's size.
fn assert_one_step(shot: &Shot, before: &Scene, what: &str) {
    let (old, new) = (glint::reference::Params::from_scene(before).unwrap(), glint::reference::Params::from_scene(&shot.stepped).unwrap());
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
            assert!((new[at] - want).abs() <= tolerance, "{what}: array {array} at {at}: {} → {}, wanted {want}, gradient {}", old[at], new[at], g[at]);
        }
    }
}

/// Renders, differentiates, steps and compares with the twin.
fn check(probe: &mut Probe, camera: &Camera, scene: &Scene, what: &str, calm: f64, image: f64, gradient: f64) -> Shot {
    let twin = probe.twin(scene, camera, calm);
    let shot = probe.shoot(scene, camera, &twin.image_grad);
    assert!(shot.is_finite(), "{what}: not finite");
    let d = distance(&shot, &twin);
    println!("{what}: image {:.1e}, calm {:.2}, gradients {:?}", d.image, d.calm, d.groups.iter().map(|g| format!("{} {:.1e}", g.0, g.1)).collect::<Vec<_>>());
    if std::env::var_os("EXPLORE").is_none() {
    assert!(d.image <= image, "{what}: image off by {}", d.image);
    for (name, l2, cosine) in &d.groups {
        assert!(*l2 <= gradient && *cosine >= 1.0 - gradient, "{what}: {name} off by {l2}, cosine {cosine}");
    }
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
    let far = Blob { mean: camera.unproject(45.0, 33.0, 6.0), scale: [0.7, 0.9, 0.4], logit: 1.0, rgb: [0.2, 0.4, 0.9], ..near };
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
            let blob = Blob { mean: camera.unproject(36.4, 28.7, 4.0), scale: [s, 0.7 * s, 1.2 * s], ..Default::default() };
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
            for scale in [[1.0, 1e-7, 1e-7], [1.0, 1.0, 1e-7], [100.0, 1e-5, 1e-5], [1e4, 1e-3, 1e-3], [1e4, 1e4, 1e-3], [1e2, 1e-2, 1e-5]] {
                let blob = Blob { mean: camera.unproject(36.4, 28.7, 4.0), scale, quat, logit: 2.0, ..Default::default() };
                let what = format!("needle {scale:?} turn {n}, compensated {compensate}");
                check(&mut probe, &camera, &scene(&[near, blob, far]), &what, 1e-4, 1e-5, 1e-4);
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
        check(&mut probe, &camera, &scene(&[near, blob, far]), what, 1e-4, 1e-5, 1e-4);
    }
}
