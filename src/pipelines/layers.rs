//! Renders parts of a scene from one camera after another, without a second copy of the scene on the device.

use super::{
    model::Model,
    render::{RenderOptions, Rendered, Renderer},
    views::{Views, origin_for},
};
use crate::{
    Result,
    gpu::Context,
    scene::{Camera, Scene},
};

/// A part of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layer {
    /// Base and supplement.
    Whole,
    /// The base Gaussians as they are stored. The joint stage changes their opacities, so this is not the scene that was
    /// augmented.
    Base,
    /// The base Gaussians with their constant SH band only: the same from everywhere.
    Constant,
}

/// A scene on the device with what renders it. Cameras go to the device one at a time.
pub struct Layers {
    context: Context,
    model: Model,
    renderer: Renderer,
}

impl Layers {
    /// For cameras of the sizes of `cameras`.
    pub fn new<'a>(
        context: &Context,
        scene: &Scene,
        cameras: impl IntoIterator<Item = &'a Camera>,
        options: RenderOptions,
    ) -> Result<Self> {
        // The renderer only asks for sizes.
        let mut sizes: Vec<Camera> = cameras.into_iter().copied().collect();
        let origin = origin_for(&sizes);
        sizes.sort_by_key(|c| (c.width, c.height));
        sizes.dedup_by_key(|c| (c.width, c.height));
        let model = Model::upload_around(context, origin, scene, 0)?;
        let views = Views::upload_around(context, origin, &sizes, &[])?;
        let renderer = Renderer::new(context, model.count(), &views, options)?;
        Ok(Layers { context: context.clone(), model, renderer })
    }

    /// What `camera` sees of `layer` over `background` (sRGB values). Waits for the device.
    pub fn render(&mut self, layer: Layer, camera: &Camera, background: [f32; 3]) -> Result<Rendered> {
        // Supplementary Gaussians come last and SH planes are sorted by band: parts of a scene are prefixes of its buffers.
        let model = match layer {
            Layer::Whole => self.model.clone(),
            Layer::Base => Model { supplement_count: 0, ..self.model.clone() },
            Layer::Constant => Model { supplement_count: 0, sh_degree: 0, ..self.model.clone() },
        };
        let views = Views::upload_around(&self.context, self.model.origin, &[*camera], &[])?;
        self.renderer.render(&model, &views, 0, background)
    }
}
