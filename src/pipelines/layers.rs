//! Renders layers of a scene from one camera after another, without a second copy of the scene on the device.

use super::{
    model::{Model, Room, Segment},
    render::{Needs, RenderOptions, Rendered, Renderer, Show},
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
    /// The base Gaussians as they are stored. The joint phase changes their opacities, so this is not the scene that was
    /// augmented.
    Base,
    /// The base Gaussians with their constant SH band only, so that colors do not depend on the view.
    Constant,
}

/// A scene on the device with its renderer. Cameras are uploaded one at a time.
pub struct Layers {
    context: Context,
    model: Model,
    renderer: Renderer,
}

impl Layers {
    /// Prepares for cameras with the sizes of `cameras`.
    pub fn new<'a>(
        context: &Context,
        scene: &Scene,
        cameras: impl IntoIterator<Item = &'a Camera>,
        options: RenderOptions,
    ) -> Result<Self> {
        // The renderer only reads sizes from these.
        let mut sizes: Vec<Camera> = cameras.into_iter().copied().collect();
        let origin = origin_for(&sizes);
        sizes.sort_by_key(|c| (c.width, c.height));
        sizes.dedup_by_key(|c| (c.width, c.height));
        let model = Model::upload_around(context, origin, scene, Room::default())?;
        let views = Views::upload_around(context, origin, &sizes, &[])?;
        let mut needs = Needs::of(&model);
        // Degree 0 of the base, for [`Layer::Constant`].
        if !needs.degrees.contains(&0) {
            needs.degrees.push(0);
        }
        let renderer = Renderer::new(context, needs, &views, options)?;
        Ok(Layers { context: context.clone(), model, renderer })
    }

    /// Renders `layer` from `camera` over `background` (sRGB values). Waits for the device.
    pub fn render(&mut self, layer: Layer, camera: &Camera, background: [f32; 3]) -> Result<Rendered> {
        let show = match layer {
            Layer::Whole => Show::all(&self.model, background),
            Layer::Base => Show { upto: Segment::Base, degree: self.model.sh_degree, background },
            Layer::Constant => Show { upto: Segment::Base, degree: 0, background },
        };
        let views = Views::upload_around(&self.context, self.model.origin, &[*camera], &[])?;
        self.renderer.render_shown(&self.model, &views, 0, &show)
    }
}
