//! Renders a scene from one of a set of cameras: project → order → blend, and optionally the median depth.

use std::collections::BTreeSet;

use super::{
    model::{Model, Room, Segment},
    plan::bind,
    raster::{Grid, Raster, RasterOptions},
    session::Policy,
    sort::Extent,
    views::Views,
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    scene::{Camera, Scene},
    stages::{
        WORKGROUP, median_depth, project,
        status::{self, Resource, Status},
        types::View,
    },
};

/// Initial room for intersections, per Gaussian and in total; it grows if a view needs more. Scenes of the
/// usual trainers have 2 to 6 tiles per visible Gaussian.
const ISECTS_PER_GAUSSIAN: u32 = 4;
const MIN_ISECTS: u32 = 1 << 16;

/// The Gaussian at which transmittance first falls below this gives the pixel its depth (method, section 4;
/// the authors' release has 0.7).
pub const MEDIAN_THRESHOLD: f32 = 0.5;

/// Features of a [`Renderer`] beyond color and transmittance.
#[derive(Debug, Clone, Copy)]
pub struct RenderOptions {
    /// Enable depths.
    pub depth: bool,
    /// Use the z of the median Gaussian's centre, not of its point of maximum response.
    pub centre_depth: bool,
    /// Transmittance, see [`MEDIAN_THRESHOLD`].
    pub median_threshold: f32,
    /// Enable gradients.
    pub backward: bool,
    /// Initial number of Gaussians, if it reaches the number in [`Needs`] later or never. Sets the initial
    /// room for intersections.
    pub first: Option<u32>,
    /// Variants of the stages.
    pub policy: Policy,
}

impl Default for RenderOptions {
    fn default() -> Self {
        RenderOptions {
            depth: false,
            centre_depth: false,
            median_threshold: MEDIAN_THRESHOLD,
            backward: false,
            first: None,
            policy: Policy::default(),
        }
    }
}

/// Maximum size and formats of the scenes that a [`Renderer`] must support.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Needs {
    /// Maximum number of Gaussians in all segments.
    pub gaussians: u32,
    /// Bands of harmonics, or betas, of rendered bases: one pipeline per entry.
    pub degrees: Vec<u32>,
    /// Bands of rendered supplements; empty if nothing has a lobe.
    pub lobe_degrees: Vec<u32>,
    /// Models have half width, see [`Model::is_half`].
    pub half: bool,
}

impl Needs {
    /// Needs of a whole model, at its own degree.
    pub fn of(model: &Model) -> Self {
        Self::at(model, [model.sh_degree])
    }

    /// Needs of a whole model, rendered with these bands of harmonics.
    pub fn at(model: &Model, degrees: impl IntoIterator<Item = u32> + Clone) -> Self {
        let of = |lobes: bool| {
            let segments = Segment::ALL.into_iter().filter(|&s| model.has(s) && s.has_lobes() == lobes);
            distinct(segments.flat_map(|s| degrees.clone().into_iter().map(move |degree| model.degree_of(s, degree))))
        };
        Needs { gaussians: model.capacity(), degrees: of(false), lobe_degrees: of(true), half: model.is_half() }
    }

    /// Needs of a scene whose model has no spare room; `half` as in [`Room`].
    pub fn of_scene(scene: &Scene, half: bool) -> Self {
        let supplement = scene.supplement.as_ref().map(|supplement| &supplement.gaussians).filter(|g| !g.is_empty());
        let room = Room::default().capacities(Room::counts(scene));
        let [_, banded, _] = room;
        let own = scene.base.sh_degree;
        Needs {
            gaussians: room.into_iter().sum(),
            degrees: if !scene.mixed {
                vec![own]
            } else if banded > 0 {
                distinct([0, own].into_iter())
            } else {
                vec![0]
            },
            lobe_degrees: supplement.iter().map(|gaussians| gaussians.sh_degree).collect(),
            half,
        }
    }

    /// Bands of a rendered segment.
    fn degrees_of(&self, segment: Segment) -> &[u32] {
        if segment.has_lobes() { &self.lobe_degrees } else { &self.degrees }
    }

    /// Whether splats are packed; gradients need unpacked ones.
    fn packs(&self, options: &RenderOptions) -> bool {
        self.half && !options.backward
    }
}

/// Sorted, without duplicates.
fn distinct(degrees: impl Iterator<Item = u32>) -> Vec<u32> {
    degrees.collect::<BTreeSet<u32>>().into_iter().collect()
}

/// Selects the parts of a model to render, and the background.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Show {
    /// The last segment to show: the base alone, or both.
    pub upto: Segment,
    /// Bands of harmonics.
    pub degree: u32,
    /// sRGB, 0 to 1.
    pub background: [f32; 3],
}

impl Show {
    /// Shows all of `model`.
    pub fn all(model: &Model, background: [f32; 3]) -> Self {
        Show { upto: Segment::Supplement, degree: model.sh_degree, background }
    }
}

/// The stages that read models: projection, and optionally the median depth.
pub(super) struct ModelStages {
    needs: Needs,
    /// Without lobes and with, then by degree in the order of `needs`, so that a scene without supplement never pays
    /// for lobes.
    project: [Vec<project::Stage>; 2],
    median_depth: Option<median_depth::Stage>,
}

/// A model in a frame: its start in the common Gaussian index, and its view among `views`.
#[derive(Clone, Copy)]
pub(super) struct Placed<'a> {
    pub model: &'a Model,
    pub splat_first: u32,
    pub views: &'a Buffer<View>,
    pub view: u32,
    /// The last segment to show.
    pub upto: Segment,
    /// Bands of harmonics.
    pub degree: u32,
    /// Scale of the model in the view's world.
    pub scale: f32,
}

impl ModelStages {
    pub fn new(context: &Context, needs: Needs, options: &RenderOptions) -> Result<Self, GpuError> {
        let tile = options.policy.tile(context.info());
        let project = |has_lobes: bool, degrees: &[u32]| -> Result<Vec<_>, GpuError> {
            let stage = |&sh_degree: &u32| {
                let spec = project::Spec {
                    workgroup_size: context.info().workgroup(WORKGROUP),
                    tile_width: tile.width,
                    tile_height: tile.height,
                    compensate: options.policy.compensate,
                    has_lobes,
                    sh_degree,
                    half_width: needs.half,
                    packed_splats: needs.packs(options),
                };
                project::Stage::new(context, &spec)
            };
            degrees.iter().map(stage).collect()
        };
        let depth_spec =
            median_depth::Spec { workgroup_size: WORKGROUP, centre: options.centre_depth, half_width: needs.half };
        Ok(ModelStages {
            project: [project(false, &needs.degrees)?, project(true, &needs.lobe_degrees)?],
            median_depth: if options.depth { Some(median_depth::Stage::new(context, &depth_spec)?) } else { None },
            needs,
        })
    }

    /// Checks that the stages cover this rendering.
    ///
    /// # Errors
    /// [`Error::Usage`] if they do not.
    pub fn check(&self, model: &Model, upto: Segment, degree: u32) -> Result<()> {
        let lacks = |&segment: &Segment| model.has(segment) && self.pipeline(model, segment, degree).is_none();
        let wrong = if let Some(segment) = upto.upto().find(lacks) {
            let shown = model.degree_of(segment, degree);
            match (self.needs.degrees_of(segment), segment.has_lobes()) {
                ([], true) => "scenes without supplement".into(),
                (degrees, true) => format!("supplements of degrees {degrees:?} of harmonics, not of {shown}"),
                (degrees, false) => format!("degrees {degrees:?} of harmonics, not for {shown}"),
            }
        } else if model.is_half() != self.needs.half {
            format!("models of {} width", if self.needs.half { "half" } else { "full" })
        } else {
            return Ok(());
        };
        Err(Error::Usage(format!("the renderer was made for {wrong}")))
    }

    /// The projection of a segment that is rendered with `degree`.
    fn pipeline(&self, model: &Model, segment: Segment, degree: u32) -> Option<&project::Stage> {
        let shown = model.degree_of(segment, degree);
        let k = self.needs.degrees_of(segment).iter().position(|&made| made == shown)?;
        self.project[usize::from(segment.has_lobes())].get(k)
    }

    /// Splats, colors, depth keys and tile counts of a model.
    pub fn record_project(&self, recorder: &mut Recorder, raster: &Raster, placed: &Placed<'_>) {
        let Placed { model, splat_first, views, view, upto, degree, .. } = *placed;
        let Some(depth_keys) = raster.depth_keys() else { return };
        for segment in upto.upto() {
            let part = model.part(segment);
            let Some(stage) = self.pipeline(model, segment, degree) else { continue };
            for (k, dispatch, page) in model.pages(segment) {
                stage.record_indirect(
                    recorder,
                    &bind!(project {
                        views, depth_keys,
                        geometry: part.geometry.page(k),
                        sh: part.sh.page(k),
                        lobes: part.lobes.page(k);
                        model => population;
                        raster.buffers => splats, splat_colors, packed_splats, tile_counts;
                    }),
                    &project::Push {
                        segment: segment.index(),
                        page_first: page.first,
                        stride: page.capacity,
                        view,
                        splat_first,
                    },
                    &model.population_args,
                    dispatch,
                );
            }
        }
    }

    /// Depths of the raster's `median_ids` that belong to this model.
    pub fn record_depths(
        &self,
        recorder: &mut Recorder,
        raster: &Raster,
        depths: &Buffer<f32>,
        placed: &Placed<'_>,
        pixels: u32,
    ) {
        let Placed { model, splat_first, views, view, upto, scale, .. } = *placed;
        let Some(median_depth) = &self.median_depth else { return };
        for segment in upto.upto() {
            for (k, _, page) in model.pages(segment) {
                median_depth.record(
                    recorder,
                    &median_depth::Buffers {
                        population: &model.population,
                        views,
                        geometry: model.part(segment).geometry.page(k),
                        median_ids: &raster.buffers.median_ids,
                        depths,
                    },
                    &median_depth::Push {
                        segment: segment.index(),
                        page_first: page.first,
                        stride: page.capacity,
                        view,
                        depth_first: 0,
                        splat_first,
                        scale,
                    },
                    pixels,
                );
            }
        }
    }
}

/// Pipelines and working buffers to render scenes up to a maximum size, in a set of views.
pub struct Renderer {
    /// Order and blend stages, shared with the screen phase.
    pub raster: Raster,
    options: RenderOptions,
    stages: ModelStages,
    /// Camera z by pixel of the last rendered view, 0 if there is none.
    pub depths: Buffer<f32>,
    status: Buffer<u32>,
}

/// A rendered view on the host.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// RGB interleaved, not clamped above.
    pub color: Vec<f32>,
    /// By pixel: visible fraction of the background.
    pub transmittance: Vec<f32>,
    /// Camera z, 0 if there is none; empty unless [`RenderOptions::depth`].
    pub depth: Vec<f32>,
}

impl Renderer {
    /// A renderer for any of `views`. Waits.
    pub fn new(context: &Context, needs: Needs, views: &Views, options: RenderOptions) -> Result<Self, GpuError> {
        let tile = options.policy.tile(context.info());
        let grids = views.cameras.iter().map(|c| Grid::new(tile, 0, 1, c.width, c.height).tiles());
        let raster_options = RasterOptions {
            splats: needs.gaussians.max(1),
            pixels: views.max_pixels(),
            tiles: grids.max().unwrap_or(1),
            isects: options.first.unwrap_or(needs.gaussians).saturating_mul(ISECTS_PER_GAUSSIAN).max(MIN_ISECTS),
            median: options.depth,
            backward: options.backward,
            packed_splats: needs.packs(&options),
            policy: options.policy,
            ..RasterOptions::default()
        };
        let depth_pixels = if options.depth { views.max_pixels() as usize } else { 1 };
        Ok(Renderer {
            raster: Raster::new(context, raster_options)?,
            stages: ModelStages::new(context, needs, &options)?,
            depths: Buffer::new(context, "depths", depth_pixels, Location::Device)?,
            status: Buffer::zeroed(context, "render status", status::WORDS)?,
            options,
        })
    }

    /// Records view `view` of `model` into the raster's image (and `depths`). The caller first sets `status`,
    /// of [`status::WORDS`] words, to 0; overflows are reported there.
    ///
    /// # Errors
    /// [`Error::Usage`] if the renderer was not made for this; then nothing is recorded.
    pub fn record(
        &self,
        recorder: &mut Recorder,
        model: &Model,
        views: &Views,
        view: u32,
        show: &Show,
        status: &Buffer<u32>,
    ) -> Result<Grid> {
        let grid = self.record_order(recorder, model, views, view, show, status)?;
        self.raster.record_blend(recorder, &grid, &views.frames, show.background, self.options.median_threshold);
        if self.options.depth {
            self.depths_of(recorder, model, views, view, show);
        }
        Ok(grid)
    }

    /// Records the depths of the Gaussians in the raster's `median_ids`, after the pixels.
    ///
    /// # Errors
    /// [`Error::Usage`] if the renderer was not made for this, or without [`RenderOptions::depth`]; then
    /// nothing is recorded.
    pub fn record_depths(
        &self,
        recorder: &mut Recorder,
        model: &Model,
        views: &Views,
        view: u32,
        show: &Show,
    ) -> Result<()> {
        self.check(recorder, model, views, view, show)?;
        if !self.options.depth {
            return Err(Error::Usage("depths are asked for, the renderer was made without".into()));
        }
        self.depths_of(recorder, model, views, view, show);
        Ok(())
    }

    /// [`Renderer::record_depths`] without checks.
    pub(crate) fn depths_of(&self, recorder: &mut Recorder, model: &Model, views: &Views, view: u32, show: &Show) {
        let placed = placed(model, views, view, show);
        let pixels = views.cameras.get(view as usize).map_or(0, Camera::pixels);
        self.stages.record_depths(recorder, &self.raster, &self.depths, &placed, pixels);
    }

    /// Records the stages before the pixels: splats, and the ordered lists of their tiles.
    ///
    /// # Errors
    /// [`Error::Usage`] if the renderer was not made for this; then nothing is recorded.
    pub fn record_order(
        &self,
        recorder: &mut Recorder,
        model: &Model,
        views: &Views,
        view: u32,
        show: &Show,
        status: &Buffer<u32>,
    ) -> Result<Grid> {
        let camera = self.check(recorder, model, views, view, show)?;
        if status.len() < status::WORDS {
            let words = status.len();
            return Err(Error::Usage(format!("a status of {words} words, expected {}", status::WORDS)));
        }
        let raster = &self.raster;
        let grid = raster.grid(view, 1, camera.width, camera.height);
        self.splats_of(recorder, model, views, view, show);
        let splats = Extent {
            count: &model.population,
            index: show.upto.last().index() + 1,
            args: &model.population_args,
            dispatch: model.blocks_dispatch(show.upto.last()),
        };
        raster.record_order(recorder, splats, &grid, &views.frames, None, status);
        Ok(grid)
    }

    /// Records the splats with their depths and tile counts, without checks.
    pub(crate) fn splats_of(&self, recorder: &mut Recorder, model: &Model, views: &Views, view: u32, show: &Show) {
        self.stages.record_project(recorder, &self.raster, &placed(model, views, view, show));
    }

    /// Checks that the view exists, and that the renderer was made for it and for the model.
    fn check<'a>(
        &self,
        recorder: &Recorder,
        model: &Model,
        views: &'a Views,
        view: u32,
        show: &Show,
    ) -> Result<&'a Camera> {
        if ![recorder.context(), model.context()].into_iter().all(|context| context.is_same(self.raster.context())) {
            return Err(Error::Usage("a recorder or a model of another context than the renderer's".into()));
        }
        model.check_origin(views)?;
        self.stages.check(model, show.upto, show.degree)?;
        let Some(camera) = views.cameras.get(view as usize) else {
            let most = views.cameras.len();
            return Err(Error::Usage(format!("there are {most} views, and number {view} was asked for")));
        };
        self.raster.check(show.upto.upto().map(|s| model.part(s).capacity()).sum(), camera.width, camera.height)?;
        Ok(camera)
    }

    /// Renders one view and leaves it on the device; grows the intersection buffers if they are too small.
    /// Waits.
    ///
    /// # Errors
    /// [`Error::Usage`] if model and views have different origins; otherwise an error of the device.
    pub fn render_on_device(&mut self, model: &Model, views: &Views, view: u32, show: &Show) -> Result<()> {
        loop {
            let mut recorder = self.raster.context().recorder("render")?;
            recorder.fill(&self.status, 0);
            self.record(&mut recorder, model, views, view, show, &self.status)?;
            recorder.submit()?.wait()?;
            let status = Status::read(&self.status.download()?);
            // guard: a view that did not fit is drawn again
            match status.needed(Resource::Intersections) {
                None => return Ok(()),
                Some(needed) => self.raster.grow(needed)?,
            }
        }
    }

    /// Renders one view of all of `model` and downloads it. Waits.
    pub fn render(&mut self, model: &Model, views: &Views, view: u32, background: [f32; 3]) -> Result<Rendered> {
        self.render_shown(model, views, view, &Show::all(model, background))
    }

    /// Renders the selected parts of one view and downloads it. Waits.
    pub fn render_shown(&mut self, model: &Model, views: &Views, view: u32, show: &Show) -> Result<Rendered> {
        self.render_on_device(model, views, view, show)?;
        let camera = &views.cameras[view as usize];
        let pixels = camera.pixels() as usize;
        let image = self.raster.buffers.image.download_range(0, pixels)?;
        Ok(Rendered {
            width: camera.width,
            height: camera.height,
            color: image.iter().flat_map(|p| [p[0], p[1], p[2]]).collect(),
            transmittance: image.iter().map(|p| p[3]).collect(),
            depth: if self.options.depth { self.depths.download_range(0, pixels)? } else { Vec::new() },
        })
    }
}

/// A single model in its own coordinates.
fn placed<'a>(model: &'a Model, views: &'a Views, view: u32, show: &Show) -> Placed<'a> {
    Placed { model, splat_first: 0, views: &views.views, view, upto: show.upto, degree: show.degree, scale: 1.0 }
}
