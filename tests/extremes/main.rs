//! Inputs at and beyond what a scene usually holds: each has an outcome, written in docs/extremes.md, and a test here.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/probe.rs"]
mod probe;

mod counts;
mod data;
mod geometry;
mod parameters;
mod screen;
mod stiffness;

use glam::DVec3;
use glint::scene::{Camera, Scene};
use probe::{BACKGROUND, Blob, Probe, RATES, Shot, camera_at, distance, scene};

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

fn assert_background(shot: &Shot) {
    let [r, g, b] = BACKGROUND;
    assert!(shot.image.iter().all(|p| *p == [r, g, b, 1.0]));
}

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
