//! Tests training and augmentation as a whole: gains, numbers of the method, invariants of each phase.

mod bands;
#[path = "../common/mod.rs"]
mod common;
mod density;
mod determinism;
mod exposure;
mod floors;
mod method;
mod photographs;
mod pursuit;
mod pursuit_edges;
mod screen;

use std::sync::LazyLock;

use glint::{
    data::builtin::{BuiltinPhoto, BuiltinScene, builtin_scene},
    reference::Params,
    scene::{Camera, Gaussians, Scene},
};

/// A wall at z = 4 of plates that face z, `step` apart.
fn plates([across, down]: [i32; 2], step: f32, log_scale: [f32; 3], opacity: f32, dc: [f32; 3]) -> Gaussians {
    let mut base = Gaussians { sh_degree: 0, ..Default::default() };
    for (i, j) in (0..across).flat_map(|i| (0..down).map(move |j| (i, j))) {
        base.means.push([step * (i - across / 2) as f32, step * (j - down / 2) as f32, 4.0]);
        base.log_scales.push(log_scale);
        base.quats.push([1.0, 0.0, 0.0, 0.0]);
        base.opacities.push(opacity);
        base.sh.push(dc);
    }
    base
}

/// The built-in scene with `points` of its points. Tracing its photographs takes seconds, so all tests share them.
fn built(points: usize) -> BuiltinScene {
    static SCENE: LazyLock<BuiltinScene> = LazyLock::new(|| builtin_scene(2000));
    let mut scene = SCENE.clone();
    scene.point_positions.truncate(points);
    scene.point_colors.truncate(points);
    scene
}

/// A photograph's camera and pixels with every fourth row and column, for tests to which sizes mean nothing.
fn quarter(photo: &BuiltinPhoto) -> (Camera, Vec<u8>) {
    let Camera { width, height, fx, fy, cx, cy, .. } = photo.camera;
    let [fx, fy, cx, cy] = [fx, fy, cx, cy].map(|v| v / 4.0);
    let camera = Camera { width: width / 4, height: height / 4, fx, fy, cx, cy, ..photo.camera };
    let at = |p: u32| 3 * (4 * (p / camera.width) * width + 4 * (p % camera.width)) as usize;
    let pixels = (0..camera.width * camera.height).flat_map(|p| photo.rgb[at(p)..][..3].to_vec());
    (camera, pixels.collect())
}

/// Puts Gaussians all over a camera's picture, wherever they were.
fn put_before(camera: &Camera, means: &mut [[f32; 3]]) {
    let (width, height) = (camera.width as usize, camera.height as usize);
    for (k, mean) in means.iter_mut().enumerate() {
        let (x, y) = ((k * 37 % width) as f64, (k * 59 % height) as f64);
        *mean = camera.unproject(x, y, 2.0 + 0.01 * (k % 100) as f64).as_vec3().to_array();
    }
}

/// Every float as its bits: distinguishes 0 from −0, and NaN equals itself.
fn bits(scene: &Scene) -> Vec<u64> {
    let p = Params::from_scene(scene).unwrap();
    [p.geometry, p.sh, p.lobes].concat().into_iter().map(f64::to_bits).collect()
}
