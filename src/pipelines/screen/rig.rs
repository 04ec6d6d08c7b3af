//! The 2D Gaussians of a batch of views on the device, and the stages that run on them.

use super::batch::ScreenSizes;
use crate::{
    error::Result,
    gpu::{Buffer, Context, GpuError, Recorder},
    pipelines::{
        loss::{Batch, LossOptions, Photometric, TileLists, Tiles},
        plan::{Plan, bind, buffers},
        raster::{Grid, Raster, RasterOptions},
        session::Policy,
        sort::Extent,
    },
    stages::{
        WORKGROUP,
        blocks::items_per_group,
        constants::{constants::NONE, screen, status::NO_RESOURCE},
        dispatch_args, screen_backward, screen_draw, screen_project, screen_prune, screen_tiles,
        ssim::{TILE, tiles_per_frame},
        status,
        types::{Frame, Quota, ScreenState, View},
    },
};

/// Planes per 2D Gaussian, see `glsl/shared/screen.glsl`.
pub const SCREEN_PLANES: usize = screen::SCREEN_PLANES as usize;
/// Learned planes; each has two moments.
pub const LEARNED: usize = screen::LEARNED as usize;
/// Initial room for intersections, per place and in total. New Gaussians have σ = 0.005 of the shorter side
/// and touch 4 to 9 tiles of 8 × 8 pixels in images of 800 pixels.
const ISECTS_PER_PLACE: u32 = 8;
const MIN_ISECTS: u32 = 1 << 16;
/// Threads that draw for one view; they make five passes over its pixels.
const DRAW_WORKGROUP: u32 = 256;

buffers! {
    /// Buffers of a batch and its 2D Gaussians, by place.
    pub struct ScreenBuffers(o: ScreenSizes) {
        /// [`SCREEN_PLANES`] × places.
        pub screen_planes: f32 = SCREEN_PLANES * o.places as usize,
        /// Position of each 2D Gaussian's view in the batch; [`NONE`] if the place is empty.
        pub screen_frames: u32 = o.places,
        /// Steps since a 2D Gaussian was drawn.
        pub screen_ages: u32 = o.places,
        /// Two moments per learned plane p: planes 2p and 2p + 1.
        pub screen_moments: f32 = 2 * LEARNED * o.places as usize,
        /// Pixels of the last draw, by place of the view's quota.
        pub drawn_pixels: u32 = o.places,
        /// By frame: number of Gaussians, and the mode of the next steps.
        pub screen_states: ScreenState = o.frames,
        /// By frame: its view, and its range of places.
        pub quotas: Quota = o.frames,
        /// Layout of each frame's pixels.
        pub frames: Frame = o.frames,
        /// The batch's cameras; `pixel_first` is relative to `depths`.
        pub views: View = o.frames,
        /// Camera z by pixel of the batch, 0: none.
        pub depths: f32 = o.pixels,
        population: u32 = 3,
        population_args: u32 = 3,
    }
}

/// The current batch.
struct Current {
    places: u32,
    frames: u32,
    grid: Grid,
    tiles_per_frame: u32,
}

/// Pipelines and buffers for batches up to some size, and the current batch.
pub struct Screen {
    context: Context,
    /// Maximum sizes.
    pub sizes: ScreenSizes,
    /// 2D Gaussians and their background.
    pub buffers: ScreenBuffers,
    /// Order and blend of all views of the batch at once.
    pub raster: Raster,
    /// The loss of all views of the batch at once.
    pub loss: Photometric,
    /// Tiles of the loss that can have changed.
    pub lists: TileLists,
    current: Current,
    project: screen_project::Stage,
    tiles: screen_tiles::Stage,
    dispatch_args: dispatch_args::Stage,
    backward: screen_backward::Stage,
    gradients: screen_backward::Stage,
    prune: screen_prune::Stage,
    draw: screen_draw::Stage,
}

impl Screen {
    /// Makes the pipelines and buffers for batches within `sizes`.
    pub fn new(context: &Context, sizes: ScreenSizes, policy: Policy) -> Result<Self> {
        let tile = policy.tile(context.info());
        let workgroup_size = WORKGROUP;
        let project = screen_project::Spec { workgroup_size, tile_width: tile.width, tile_height: tile.height };
        let backward =
            |gradients| screen_backward::Stage::new(context, &screen_backward::Spec { workgroup_size, gradients });
        Ok(Screen {
            raster: Raster::new(context, Self::raster_options(context, &sizes, policy))?,
            loss: Photometric::new(context, &Self::loss_options(&sizes))?,
            lists: TileLists::new(context, &sizes.loss_tiles)?,
            buffers: ScreenBuffers::new(context, &sizes)?,
            current: Current { places: 0, frames: 0, grid: Grid::new(tile, 0, 0, 1, 1), tiles_per_frame: 0 },
            project: screen_project::Stage::new(context, &project)?,
            tiles: screen_tiles::Stage::new(context, &screen_tiles::Spec { workgroup_size, tile: TILE })?,
            dispatch_args: dispatch_args::Stage::new(context, &dispatch_args::Spec { workgroup_size: 1 })?,
            backward: backward(false)?,
            gradients: backward(true)?,
            prune: screen_prune::Stage::new(context, &screen_prune::Spec { workgroup_size })?,
            draw: screen_draw::Stage::new(
                context,
                &screen_draw::Spec { workgroup_size: DRAW_WORKGROUP.min(context.info().max_workgroup) },
            )?,
            context: context.clone(),
            sizes,
        })
    }

    fn raster_options(context: &Context, sizes: &ScreenSizes, policy: Policy) -> RasterOptions {
        let grid = Grid::new(policy.tile(context.info()), 0, sizes.frames, sizes.width, sizes.height);
        RasterOptions {
            splats: sizes.places,
            pixels: sizes.pixels,
            tiles: grid.tiles(),
            isects: sizes.places.saturating_mul(ISECTS_PER_PLACE).max(MIN_ISECTS),
            batch: true,
            background_image: true,
            backward: true,
            policy,
            ..RasterOptions::default()
        }
    }

    fn loss_options(sizes: &ScreenSizes) -> LossOptions {
        LossOptions {
            tiles: sizes.loss_tiles,
            map_pixels: sizes.pixels,
            losses: sizes.frames,
            listed: true,
            backward: true,
            ..LossOptions::default()
        }
    }

    /// Buffers for batches of this size.
    pub fn plan(context: &Context, sizes: &ScreenSizes, policy: Policy) -> Plan {
        let raster = Raster::plan(&Self::raster_options(context, sizes, policy));
        let lists = TileLists::plan(&sizes.loss_tiles);
        raster.and(Photometric::plan(&Self::loss_options(sizes))).and(lists).and(ScreenBuffers::plan(sizes))
    }

    /// Sets the mode of all views, see `glsl/shared/screen.glsl`. Waits.
    pub fn set_mode(&self, mode: u32) -> Result<(), GpuError> {
        let b = &self.buffers.screen_states;
        b.upload(0, &vec![ScreenState { count: 0, mode }; b.len()])
    }

    /// Starts a batch: all places empty, all views drawing. Waits.
    pub fn begin(&mut self, frames: &[Frame], views: &[View], quotas: &[Quota]) -> Result<()> {
        let places = quotas.iter().map(|q| q.budget).sum::<u32>();
        let b = &self.buffers;
        b.frames.upload(0, frames)?;
        b.views.upload(0, views)?;
        b.quotas.upload(0, quotas)?;
        b.population.upload(0, &[0, places, places])?;
        let blocks = places.div_ceil(items_per_group(self.context.info())).max(1);
        b.population_args.upload(0, &[blocks, 1, 1])?;
        let mut recorder = self.context.recorder("screen begin")?;
        recorder.fill(&b.screen_frames, NONE);
        // guard: images of another batch
        self.raster.record_forget(&mut recorder);
        recorder.submit()?.wait()?;
        self.set_mode(screen::DRAWING)?;
        let width = frames.iter().map(|f| f.width).max().unwrap_or(1);
        let height = frames.iter().map(|f| f.height).max().unwrap_or(1);
        self.current = Current {
            places,
            frames: frames.len() as u32,
            grid: self.raster.grid(0, frames.len() as u32, width, height),
            tiles_per_frame: tiles_per_frame(frames),
        };
        Ok(())
    }

    fn batch<'a>(&'a self, targets: &'a Buffer<u32>) -> Batch<'a> {
        Batch {
            frames: &self.buffers.frames,
            frame_first: 0,
            frame_count: self.current.frames,
            tiles_per_frame: self.current.tiles_per_frame,
            image: &self.raster.buffers.image,
            targets,
        }
    }

    /// Renders the batch's current images over `backdrop`.
    pub fn record_render(&self, recorder: &mut Recorder, status: &Buffer<u32>) {
        let (b, r, places) = (&self.buffers, &self.raster.buffers, self.current.places);
        let buffers = bind!(screen_project {
            b => frames, screen_frames, screen_states, depths, screen_planes;
            r => splats, splat_colors, depth_keys, tile_counts;
        });
        let push = screen_project::Push { count: places, stride: self.sizes.places };
        self.project.record(recorder, &buffers, &push, places);
        let splats = Extent { count: &b.population, index: 1, args: &b.population_args, dispatch: 0 };
        self.raster.record_order(recorder, splats, &self.current.grid, &b.frames, Some(&b.screen_frames), status);
        self.raster.record_blend(recorder, &self.current.grid, &b.frames, [0.0; 3], 0.0);
    }

    /// Lists the tiles of the loss that the gradients of the render need.
    pub fn record_lists(&self, recorder: &mut Recorder, status: &Buffer<u32>) {
        let (b, r, lists) = (&self.buffers, &self.raster.buffers, &self.lists);
        let TileLists { tile_marks, count, args, forward_tiles, backward_tiles } = lists;
        recorder.fill(tile_marks, 0);
        recorder.fill(count, 0);
        let buffers = bind!(screen_tiles {
            tile_marks, count, forward_tiles, backward_tiles;
            b => frames, screen_frames;
            r => tile_counts, splats;
        });
        let push = screen_tiles::Push { count: self.current.places, tiles_per_frame: self.current.tiles_per_frame };
        self.tiles.record(recorder, &buffers, &push, self.current.places);
        for list in 0..2 {
            let buffers = dispatch_args::Buffers { count, dispatch_args: args, status };
            let push = dispatch_args::Push {
                count_index: list,
                // The list has room for every tile, so this never overflows.
                capacity: u32::MAX,
                items_per_group: 1,
                args_index: 3 * list,
                resource_index: NO_RESOURCE,
            };
            self.dispatch_args.record(recorder, &buffers, &push, 1);
        }
    }

    /// Gradient records of the render, from the loss against `targets`.
    pub fn record_loss(&self, recorder: &mut Recorder, targets: &Buffer<u32>, status: &Buffer<u32>) {
        self.record_lists(recorder, status);
        let batch = self.batch(targets);
        self.loss.record_forward(recorder, &batch, Tiles::Listed, Some(&self.lists));
        let image_grad = &self.raster.buffers.image_grad;
        self.loss.record_backward(recorder, &batch, image_grad, Tiles::Listed, Some(&self.lists));
        self.record_blend_backward(recorder);
    }

    /// Gradient records of the render, from `image_grad`.
    pub fn record_blend_backward(&self, recorder: &mut Recorder) {
        let b = &self.buffers;
        self.raster.record_blend_backward(recorder, &self.current.grid, &b.frames, &b.population, 0);
    }

    /// Steps on the gradient records.
    pub fn record_step(&self, recorder: &mut Recorder, status: &Buffer<u32>) {
        self.record_backward(recorder, &self.backward, &self.buffers.screen_moments, status);
    }

    /// Writes the gradients without a step: plane p goes to plane 2p of `into`, a buffer like the moments.
    pub fn record_gradients(&self, recorder: &mut Recorder, into: &Buffer<f32>, status: &Buffer<u32>) {
        self.record_backward(recorder, &self.gradients, into, status);
    }

    fn record_backward(
        &self,
        recorder: &mut Recorder,
        stage: &screen_backward::Stage,
        screen_moments: &Buffer<f32>,
        status: &Buffer<u32>,
    ) {
        let (b, raster) = (&self.buffers, &self.raster);
        let buffers = bind!(screen_backward {
            status, screen_moments;
            b => frames, screen_frames, screen_states, screen_planes, screen_ages;
            raster.buffers => tile_counts, first_slot;
            raster.records => record_centres, record_shapes, record_colors;
        });
        let by_gaussian = raster.by_gaussian().into();
        let push = screen_backward::Push { count: self.current.places, stride: self.sizes.places, by_gaussian };
        stage.record(recorder, &buffers, &push, self.current.places);
    }

    /// Frees the places of 2D Gaussians that are too faint or cover too few pixels.
    pub fn record_prune(&self, recorder: &mut Recorder, status: &Buffer<u32>) {
        let b = &self.buffers;
        let buffers = bind!(screen_prune { status; b => frames, screen_states, screen_planes, screen_frames; });
        let push = screen_prune::Push { count: self.current.places, stride: self.sizes.places };
        self.prune.record(recorder, &buffers, &push, self.current.places);
    }

    /// Computes the render's loss, per view and per pixel.
    pub fn record_loss_map(&self, recorder: &mut Recorder, targets: &Buffer<u32>) {
        let batch = self.batch(targets);
        self.loss.record_forward(recorder, &batch, Tiles::Map, None);
        self.loss.record_sum(recorder, &batch, 0);
    }

    /// Draws new Gaussians at pixels with a high loss; `age` is their initial age.
    pub fn record_draw(&self, recorder: &mut Recorder, round: u32, seed: u32, age: u32, status: &Buffer<u32>) {
        let b = &self.buffers;
        let buffers = bind!(screen_draw {
            status,
            loss_map: self.loss.loss_map();
            b => frames, quotas, drawn_pixels, screen_states, screen_frames, screen_planes, screen_ages, screen_moments;
            self.raster.buffers => image;
        });
        let (frame_count, stride) = (self.current.frames, self.sizes.places);
        let push = screen_draw::Push { frame_count, stride, round, seed, age };
        self.draw.record(recorder, &buffers, &push, self.current.frames);
    }

    /// Makes separate status words, for recordings outside of loops.
    pub fn status(&self) -> Result<Buffer<u32>, GpuError> {
        Buffer::zeroed(&self.context, "screen status", status::WORDS)
    }

    /// Number of places in the current batch.
    pub fn places(&self) -> u32 {
        self.current.places
    }
}
