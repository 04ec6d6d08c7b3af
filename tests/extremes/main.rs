//! Inputs at and beyond the usual ranges of a scene: each has an outcome, documented in docs/extremes.md, and
//! a test here.

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
use glint::{
    reference::{Params, adam::PlaneRate},
    scene::{
        Camera, Scene,
        layout::{self, Array},
    },
};
use probe::{BACKGROUND, Blob, Probe, RATES, Setup, Shot, camera_at, distance, scene};

const WIDTH: u32 = 72;
const HEIGHT: u32 = 56;

/// Checks Adam's first step: the rate times g / (|g| + 1e-15), for any size of the gradient.
fn assert_one_step(shot: &Shot, before: &Scene, what: &str) {
    let [old, new] = [before, &shot.stepped].map(|scene| Params::from_scene(scene).unwrap());
    let g = &shot.gradients;
    for (group, rate) in layout::groups(old.sh_degree).into_iter().zip(RATES.by_group()) {
        let rate = f64::from(rate);
        let first = if group.array == Array::Lobes { old.lobe_first } else { 0 };
        let of = |p: &Params| p.group(&group, first, old.count - first).collect::<Vec<_>>();
        let count = (old.count - first).max(1);
        for (i, ((old, new), g)) in of(&old).into_iter().zip(of(&new)).zip(of(g)).enumerate() {
            let range = PlaneRate::of(&group, group.planes.start + i / count, rate).range;
            let range = range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            let want = (old - rate * g / (g.abs() + 1e-15)).clamp(range.0, range.1);
            // Two roundings of the parameter; Adam's own arithmetic, and square roots of denormal squares for
            // |g| < 1e-17.
            let tolerance = 2e-7 * old.abs() + if g.abs() < 1e-16 { rate } else { 1e-4 * rate };
            assert!(
                (new - want).abs() <= tolerance,
                "{what}: {}: {old} → {new}, wanted {want}, gradient {g}",
                group.name
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

/// Two ordinary Gaussians, one in front of the extreme one and one behind it.
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

/// A Gaussian between the two, near the middle of the picture.
fn middle(camera: &Camera) -> Blob {
    Blob { mean: camera.unproject(36.4, 28.7, 4.0), ..Default::default() }
}

/// The usual camera, the two in its view, and a probe for these and a few others.
fn stage(setup: Setup) -> (Camera, [Blob; 2], Probe) {
    let camera = usual();
    (camera, company(&camera), Probe::new(16, &camera, setup))
}

fn assert_background(shot: &Shot) {
    let [r, g, b] = BACKGROUND;
    assert!(shot.image.iter().all(|p| *p == [r, g, b, 1.0]));
}

/// A scene of `count` Gaussians: `at` gives position in the image, depth and width.
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
