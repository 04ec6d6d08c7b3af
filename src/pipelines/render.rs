//! Renders a scene from one of a set of cameras: project → order → blend, and the median depth where it is asked for.

use super::{
    model::Model,
    raster::{Grid, Raster, RasterOptions, Reduction, TileShape, WORKGROUP},
    views::Views,
};
use crate::{
    error::Result,
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    stages::{
        median_depth::{self, MedianDepth},
        project::{self, Project},
        step_done::{OVERFLOW, STATUS_WORDS},
    },
};

/// Intersections for which there is room at first, for each Gaussian and at least; more are made room for when a view needs
/// them. Scenes of the usual trainers have 2 to 6 tiles for each visible Gaussian.
const ISECTS_PER_GAUSSIAN: u32 = 4;
const MIN_ISECTS: u32 = 1 << 16;

/// Where the transmittance first falls below this, a Gaussian gives the pixel its depth (method, section 4; the authors'
/// release has 0.7).
pub const MEDIAN_THRESHOLD: f32 = 0.5;

/// What a [`Renderer`] can do beyond colour and transmittance.
#[derive(Debug, Clone, Copy)]
pub struct RenderOptions {
    /// Mip-Splatting-style opacity compensation.
    pub compensate: bool,
    pub depth: bool,
    /// Take the z of the median Gaussian's centre, not of its point of maximum response.
    pub centre_depth: bool,
    pub median_threshold: f32,
    /// Gradients will be asked for.
    pub backward: bool,
    pub reduction: Reduction,
    /// What a subgroup covers; `None` is the shape that suits the device. The image does not depend on it.
    pub tile: Option<TileShape>,
}

impl Default for RenderOptions {
    fn default() -> Self {
        RenderOptions {
            compensate: false,
            depth: false,
            centre_depth: false,
            median_threshold: MEDIAN_THRESHOLD,
            backward: false,
            reduction: Reduction::Auto,
            tile: None,
        }
    }
}

/// Pipelines and working buffers for scenes of up to a number of Gaussians in a set of views.
pub struct Renderer {
    pub raster: Raster,
    options: RenderOptions,
    /// `[lobes]`: a scene without supplement never pays for lobes.
    project: [Project; 2],
    median_depth: Option<MedianDepth>,
    /// Camera z by pixel of the view rendered last, 0 where there is none.
    pub depths: Buffer<f32>,
    status: Buffer<u32>,
}

/// One view on the host.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    pub width: u32,
    pub height: u32,
    /// RGB interleaved, not clamped above.
    pub color: Vec<f32>,
    pub transmittance: Vec<f32>,
    /// Camera z, 0 where there is none; empty unless [`RenderOptions::depth`].
    pub depth: Vec<f32>,
}

impl Renderer {
    /// For up to `gaussians` Gaussians in any of `views`.
    pub fn new(context: &Context, gaussians: u32, views: &Views, options: RenderOptions) -> Result<Self, GpuError> {
        let tile = options.tile.unwrap_or_else(|| TileShape::for_subgroup(context.info().subgroup_size));
        let grids = views.cameras.iter().map(|c| Grid::new(tile, 0, 1, c.width, c.height).tiles());
        let raster_options = RasterOptions {
            splats: gaussians,
            pixels: views.max_pixels(),
            tiles: grids.max().unwrap_or(1),
            isects: gaussians.saturating_mul(ISECTS_PER_GAUSSIAN).max(MIN_ISECTS),
            batch: false,
            background_image: false,
            median: options.depth,
            backward: options.backward,
            reduction: options.reduction,
        };
        let project = |lobes| {
            let spec = project::Spec {
                workgroup_size: WORKGROUP,
                tile_width: tile.width,
                tile_height: tile.height,
                compensate: options.compensate,
                lobes,
            };
            Project::new(context, &spec)
        };
        let depth_spec = median_depth::Spec { workgroup_size: WORKGROUP, centre: options.centre_depth };
        Ok(Renderer {
            raster: Raster::with_tile(context, raster_options, tile)?,
            options,
            project: [project(false)?, project(true)?],
            median_depth: if options.depth { Some(MedianDepth::new(context, &depth_spec)?) } else { None },
            depths: Buffer::new(
                context,
                "depths",
                if options.depth { views.max_pixels() as usize } else { 1 },
                Location::Device,
            )?,
            status: Buffer::zeroed(context, "render status", STATUS_WORDS)?,
        })
    }

    /// Records view `view` of `model` into [`Raster::image`] (and `depths`), with SH bands up to `active_degree`.
    #[expect(clippy::too_many_arguments, reason = "each is a different thing that the view depends on")]
    pub fn record(
        &self,
        recorder: &mut Recorder,
        model: &Model,
        views: &Views,
        view: u32,
        active_degree: u32,
        background: [f32; 3],
        status: &Buffer<u32>,
    ) -> Grid {
        let camera = &views.cameras[view as usize];
        let raster = &self.raster;
        let grid = raster.grid(view, 1, camera.width, camera.height);
        self.project[usize::from(model.supplement_count > 0)].record(
            recorder,
            &project::Buffers {
                views: &views.views,
                geometry: &model.geometry,
                sh: &model.sh,
                lobes: &model.lobes,
                splats: &raster.splats,
                depth_keys: &raster.depth_keys,
                tile_counts: &raster.tile_counts,
            },
            &project::Push {
                count: model.count(),
                stride: model.stride,
                lobe_first: model.base_count,
                lobe_stride: model.lobe_stride,
                view,
                active_degree: active_degree.min(model.sh_degree),
            },
        );
        // Any buffer will do for the frames of splats: there is one frame.
        raster.record_order(recorder, model.count(), &grid, &views.frames, &raster.tile_counts, status);
        raster.record_blend(recorder, &grid, &views.frames, background, self.options.median_threshold);
        if let Some(median_depth) = &self.median_depth {
            median_depth.record(
                recorder,
                &median_depth::Buffers {
                    views: &views.views,
                    geometry: &model.geometry,
                    median_ids: &raster.median_ids,
                    depths: &self.depths,
                },
                &median_depth::Push { stride: model.stride, view, depth_first: 0 },
                camera.pixels(),
            );
        }
        grid
    }

    /// Renders one view and leaves it on the device, growing the intersection buffers where they are too small. Waits.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] where model and views have different origins; else what the device lacks.
    pub fn render_on_device(&mut self, model: &Model, views: &Views, view: u32, background: [f32; 3]) -> Result<()> {
        model.check_origin(views)?;
        loop {
            self.status.upload(0, &[0; STATUS_WORDS])?;
            let mut recorder = self.raster.context().recorder("render")?;
            self.record(&mut recorder, model, views, view, model.sh_degree, background, &self.status);
            recorder.submit()?.wait()?;
            let overflow = self.status.download()?[OVERFLOW];
            if overflow == 0 {
                return Ok(());
            }
            self.raster.grow(overflow)?;
        }
    }

    /// Renders one view and reads it back.
    pub fn render(&mut self, model: &Model, views: &Views, view: u32, background: [f32; 3]) -> Result<Rendered> {
        self.render_on_device(model, views, view, background)?;
        let camera = &views.cameras[view as usize];
        let pixels = camera.pixels() as usize;
        let image = self.raster.image.download_range(0, pixels)?;
        Ok(Rendered {
            width: camera.width,
            height: camera.height,
            color: image.iter().flat_map(|p| [p[0], p[1], p[2]]).collect(),
            transmittance: image.iter().map(|p| p[3]).collect(),
            depth: if self.options.depth { self.depths.download_range(0, pixels)? } else { Vec::new() },
        })
    }
}
