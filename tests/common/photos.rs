//! Photos of the built-in scene as a COLMAP dataset.

use std::{fs, path::Path};

use glam::{DMat3, DQuat, DVec3};
use glint::{
    data::{
        builtin::{Part, render_truth},
        write_png_rgb,
    },
    reference::random_scene,
    report::decompose::srgb_from_linear,
    scene::{Camera, Scene},
};

/// A camera on a circle of radius 5 around the origin, at an angle in radians, looking at it. The built-in
/// scene has z up.
pub fn camera_of([width, height]: [u32; 2], focal: f64, turn: f64) -> Camera {
    let eye = DVec3::new(5.0 * turn.sin(), -5.0 * turn.cos(), 1.5);
    let forward = -eye.normalize();
    let right = forward.cross(DVec3::Z).normalize();
    let rotation = DMat3::from_cols(right, forward.cross(right), forward).transpose();
    Camera { rotation, translation: -(rotation * eye), ..Camera::new(width, height, focal) }
}

/// A scene with Gaussians of suitable size in front of the cameras: the sample's are made for another camera.
pub fn visible(seed: u64, count: usize, supplement: usize, sh_degree: u32) -> Scene {
    let mut scene = random_scene(seed, count, supplement, sh_degree);
    let extra = scene.supplement.iter_mut().flat_map(|s| &mut s.gaussians.means);
    scene.base.means.iter_mut().chain(extra).for_each(|mean| *mean = mean.map(f32::sin));
    scene
}

/// Writes photos, and a model in text of their cameras, which differ only in their poses, and of points.
pub fn write_photos(data: &Path, photos: &[(&str, Camera)], points: &str) {
    let Camera { width, height, fx, fy, cx, cy, .. } = photos[0].1;
    let mut images = String::new();
    for (i, (name, camera)) in photos.iter().enumerate() {
        let rgb: Vec<f32> = render_truth(camera, Part::All).into_iter().map(srgb_from_linear).collect();
        let path = data.join("images").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        write_png_rgb(path, width, height, &rgb).unwrap();
        let (q, t) = (DQuat::from_mat3(&camera.rotation), camera.translation);
        let pose = [q.w, q.x, q.y, q.z, t.x, t.y, t.z].map(|v| v.to_string()).join(" ");
        images += &format!("{} {pose} 1 {name}\n\n", i + 1);
    }
    let model = data.join("sparse/0");
    fs::create_dir_all(&model).unwrap();
    fs::write(model.join("cameras.txt"), format!("1 PINHOLE {width} {height} {fx} {fy} {cx} {cy}\n")).unwrap();
    fs::write(model.join("images.txt"), images).unwrap();
    fs::write(model.join("points3D.txt"), points).unwrap();
}
