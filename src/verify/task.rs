//! A synthetic training task for benchmarks, without a dataset.

use glam::DMat3;

use crate::{
    error::{Error, Result},
    gpu::Context,
    pipelines::{
        model::Model,
        render::{Needs, RenderOptions, Renderer},
        views::Views,
    },
    reference::{covering_scene, random_camera},
    scene::{Camera, Scene},
};

/// Size of a synthetic training task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Load {
    /// Pixels of the views.
    pub width: u32,
    /// Pixels of the views.
    pub height: u32,
    /// Number of random Gaussians; their total coverage of the views does not depend on it.
    pub gaussians: usize,
}

/// Random Gaussians, and four views. The photographs show the same Gaussians with permuted colors. The coverage of
/// an image is `overlap` times that of 2,000 Gaussians of the usual size.
///
/// # Errors
/// [`Error::Usage`] for a load without Gaussians; errors of the device.
pub fn random_task(context: &Context, load: Load, overlap: f64, sh_degree: u32) -> Result<(Model, Views)> {
    let Load { width, height, gaussians } = load;
    if gaussians == 0 {
        return Err(Error::Usage("a load of no Gaussians".into()));
    }
    let scene = covering_scene(gaussians, 0.0, overlap, sh_degree);
    let camera = random_camera(width, height);
    let cameras = [0.0, 0.05, 0.1, 0.15].map(|angle| {
        let turn = DMat3::from_rotation_y(angle);
        Camera { rotation: turn * camera.rotation, translation: turn * camera.translation, ..camera }
    });
    let photographs = {
        let mut other: Scene = scene.clone();
        other.base.sh.rotate_right(scene.base.sh_coefficients());
        let views = Views::upload(context, &cameras, &[])?;
        let model = Model::upload(context, &other, 0)?;
        let mut renderer = Renderer::new(context, Needs::of(&model), &views, RenderOptions::default())?;
        let byte = |value: f32| (255.0 * value.clamp(0.0, 1.0)).round() as u8;
        let mut photograph = |v| -> Result<Vec<u8>> {
            Ok(renderer.render(&model, &views, v, [0.0; 3])?.color.into_iter().map(byte).collect())
        };
        (0..cameras.len() as u32).map(&mut photograph).collect::<Result<Vec<_>>>()?
    };
    let views = Views::upload(context, &cameras, &photographs.iter().map(Vec::as_slice).collect::<Vec<_>>())?;
    Ok((Model::upload(context, &scene, 0)?, views))
}
