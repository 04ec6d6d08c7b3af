//! The 2D stage (method, section 3): for each view, supplementary Gaussians in image space over the fixed base render.
//! Many views at once, each by itself: a view's result does not depend on those it shares a batch with.
//!
//! base_losses → budgets → for each batch: [`PlaneStage::refine`], and lift what is left on the device.

mod batch;

use std::{cell::RefCell, ops::Range};

pub use batch::batches;
use batch::{BatchLoss, LossBuffers, Sizes, TileLists, frames_of};

use super::{
    model::Model,
    raster::{Grid, Raster, RasterOptions, Reduction, TileShape, WORKGROUP},
    render::Renderer,
    steps::Steps,
    views::{Views, view},
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    scene::Camera,
    stages::{
        dispatch_args::{self, DispatchArgs},
        kernels,
        loss_sum::LossSum,
        plane_backward::{self, PlaneBackward},
        plane_draw::{self, PlaneDraw},
        plane_project::{self, PlaneProject},
        plane_prune::{self, PlanePrune},
        plane_tiles::{self, PlaneTiles},
        ssim_backward::SsimBackward,
        ssim_forward::SsimForward,
        step_done::{self, OVERFLOW, StepDone},
        types::{Frame, PlaneState, Quota, View},
    },
};

/// Planes of a 2D Gaussian, see `glsl/shared/plane.glsl`.
pub const PLANES: usize = 10;
/// Planes that are learned; each has two moments.
const LEARNED: usize = 9;
/// An entry of `plane_frames`: no Gaussian here.
pub const EMPTY: u32 = kernels::constants::constants::NONE;
/// Intersections to begin with for each slot, and at least. New Gaussians have σ = 0.005 of the shorter side and touch
/// 4 to 9 tiles of 8 × 8 pixels in images of 800 pixels.
const ISECTS_PER_SLOT: u32 = 8;
const MIN_ISECTS: u32 = 1 << 16;
/// Steps in one submission: a step is some 30 dispatches.
const STEPS_PER_SUBMISSION: u32 = 10;
/// Threads that draw for one view; they go through its pixels five times.
const DRAW_WORKGROUP: u32 = 256;

/// When Gaussians are drawn, stepped and pruned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Schedule {
    /// Steps after each draw, before the prune.
    pub round_steps: u32,
    /// Steps once all views have their number.
    pub final_steps: u32,
    /// Draws at most. A draw is a fifth of the budget; where the prunes take away a share p of each, 5 / (1 − p) draws fill it,
    /// so 20 are enough up to p = 3/4. A view that loses more than that has no use for more Gaussians: it goes into the last
    /// steps with what it has, and its other slots stay empty.
    pub max_rounds: u32,
}

impl Schedule {
    /// AuGS, appendix A.
    pub const PAPER: Schedule = Schedule { round_steps: 200, final_steps: 1000, max_rounds: 20 };
    /// Ten and more times fewer steps, for previews and machines without a GPU.
    pub const QUICK: Schedule = Schedule { round_steps: 20, final_steps: 40, max_rounds: 8 };
}

/// How far a batch is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Draws done.
    pub round: u32,
    /// Steps done in this round, of how many; the last round is that of the final steps.
    pub step: u32,
    pub steps: u32,
    /// 2D Gaussians of the batch after its last draw, of how many.
    pub count: u32,
    pub budget: u32,
    /// Mean of the views' losses at the last draw; views that wait count with their base render.
    pub loss: f64,
}

/// What became of the views of a batch, by position in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// Losses of the base render, and with the 2D Gaussians.
    pub base_losses: Vec<f32>,
    pub losses: Vec<f32>,
    /// 2D Gaussians that are left.
    pub counts: Vec<u32>,
    /// Draws.
    pub rounds: u32,
    /// How often the intersection buffers were grown.
    pub grown: u32,
}

/// One 2D Gaussian on the host.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Index in the dataset.
    pub view: u32,
    /// Pixels.
    pub centre: [f32; 2],
    pub colour: [f32; 3],
    pub opacity_logit: f32,
    /// Natural logarithms of the standard deviations along the axes, pixels.
    pub log_scale: [f32; 2],
    /// Of the first axis, radians.
    pub angle: f32,
    /// Camera z at the centre, 0: none.
    pub depth: f32,
}

/// Number of 2D Gaussians of each view: n_i = ⌈⌈ratio · gaussians⌉ · ℓ_i / Σℓ⌉. A view whose loss is not a positive number
/// gets none.
pub fn budgets(losses: &[f64], gaussians: u32, ratio: f64) -> Vec<u32> {
    let usable = |loss: f64| if loss > 0.0 && loss.is_finite() { loss } else { 0.0 };
    let total: f64 = losses.iter().map(|&l| usable(l)).sum();
    let budget = (ratio * f64::from(gaussians)).ceil();
    losses.iter().map(|&l| if total > 0.0 { (budget * usable(l) / total).ceil() as u32 } else { 0 }).collect()
}

/// Loss of the base render of every view: 0.8 · L1 + 0.2 · (1 − SSIM).
///
/// # Errors
/// Where the device's memory or a buffer's size is too small, or the device fails.
pub fn base_losses(renderer: &mut Renderer, model: &Model, views: &Views, background: [f32; 3]) -> Result<Vec<f64>> {
    let context = renderer.raster.context().clone();
    let batches = batches(&context, &views.cameras);
    let sizes = Sizes::of(&views.cameras, &batches);
    let buffers = LossBuffers::new(&context, &sizes, false)?;
    let images = Buffer::new(&context, "base renders", sizes.pixels as usize, Location::Device)?;
    let frames = Buffer::new(&context, "plane frames", sizes.frames, Location::Device)?;
    let (ssim, sum) = (SsimForward::new(&context, false, false)?, LossSum::new(&context)?);
    let steps = Steps::new(&context, STEPS_PER_SUBMISSION)?;
    let step_done = StepDone::new(&context, &step_done::Spec { workgroup_size: 1 })?;
    let mut all = Vec::with_capacity(views.cameras.len());
    for batch in &batches {
        let list = frames_of(&views.cameras, batch);
        frames.upload(0, &list)?;
        render_batch(renderer, model, views, background, batch, &list, &steps, &step_done, &images, None)?;
        let mut recorder = context.recorder("base losses")?;
        let loss = BatchLoss { frames: &frames, list: &list, targets: &views.targets, buffers: &buffers };
        loss.forward(&mut recorder, &ssim, &images, None);
        loss.sum(&mut recorder, &sum);
        recorder.submit()?.wait()?;
        all.extend(buffers.losses.download_range(0, list.len())?.iter().map(|l| f64::from(l.total)));
    }
    Ok(all)
}

/// Renders the views of a batch one after the other into `images`, and their depths into `depths`.
#[expect(clippy::too_many_arguments, reason = "each is a different thing that the renders depend on")]
fn render_batch(
    renderer: &mut Renderer,
    model: &Model,
    views: &Views,
    background: [f32; 3],
    batch: &Range<usize>,
    frames: &[Frame],
    steps: &Steps,
    step_done: &StepDone,
    images: &Buffer<[f32; 4]>,
    depths: Option<&Buffer<f32>>,
) -> Result<(), GpuError> {
    let renderer = RefCell::new(renderer);
    steps.run(
        frames.len() as u32,
        false,
        |recorder, k| {
            let renderer = renderer.borrow();
            let (frame, v) = (&frames[k as usize], batch.start as u32 + k);
            renderer.record(recorder, model, views, v, model.sh_degree, background, &steps.status);
            let (first, pixels) = (frame.image_first as usize, (frame.width * frame.height) as usize);
            recorder.copy(&renderer.raster.image, 0, images, first, pixels);
            if let Some(depths) = depths {
                recorder.copy(&renderer.depths, 0, depths, first, pixels);
            }
            step_done.record(recorder, &step_done::Buffers { status: &steps.status });
        },
        |needed| renderer.borrow_mut().raster.grow(needed),
        |_| (),
    )?;
    Ok(())
}

/// Pipelines and buffers for every batch of a set of views.
///
/// After [`PlaneStage::refine`] the public buffers hold that batch's 2D Gaussians, by slot, until the next call.
pub struct PlaneStage {
    context: Context,
    batches: Vec<Range<usize>>,
    budgets: Vec<u32>,
    schedule: Schedule,
    seed: u32,
    /// [`PLANES`] × `stride`.
    pub plane: Buffer<f32>,
    pub stride: u32,
    /// Position in the batch of each 2D Gaussian's view, [`EMPTY`] where the slot has none.
    pub plane_frames: Buffer<u32>,
    /// The batch's cameras; `pixel_first` counts within `depths`.
    pub views: Buffer<View>,
    /// Camera z by pixel of the batch, 0: none.
    pub depths: Buffer<f32>,
    frames: Buffer<Frame>,
    quotas: Buffer<Quota>,
    states: Buffer<PlaneState>,
    ages: Buffer<u32>,
    moments: Buffer<f32>,
    drawn_pixels: Buffer<u32>,
    loss: LossBuffers,
    lists: TileLists,
    /// Grown between submissions where a step needs more intersections.
    pub raster: RefCell<Raster>,
    steps: Steps,
    project: PlaneProject,
    tiles: PlaneTiles,
    dispatch_args: DispatchArgs,
    /// Of listed tiles, and of all with the loss map.
    ssim_forward: SsimForward,
    ssim_map: SsimForward,
    ssim_backward: SsimBackward,
    loss_sum: LossSum,
    backward: PlaneBackward,
    prune: PlanePrune,
    draw: PlaneDraw,
    step_done: StepDone,
}

impl PlaneStage {
    /// `budgets` are those of all views, see [`budgets`]. The same `seed` gives the same Gaussians.
    ///
    /// # Errors
    /// [`Error::Usage`] where the views and the budgets are not of the same number; else what the device lacks.
    pub fn new(
        context: &Context,
        views: &Views,
        budgets: &[u32],
        schedule: Schedule,
        seed: u32,
        reduction: Reduction,
    ) -> Result<Self> {
        if budgets.len() != views.cameras.len() {
            let (n, v) = (budgets.len(), views.cameras.len());
            return Err(Error::Usage(format!("{n} budgets for {v} views: one for each is needed")));
        }
        let batches = batches(context, &views.cameras);
        let sizes = Sizes::of(&views.cameras, &batches);
        let tile = TileShape::for_subgroup(context.info().subgroup_size);
        let slots_of = |b: &Range<usize>| budgets[b.clone()].iter().map(|&n| u64::from(n)).sum::<u64>();
        let slots = batches.iter().map(slots_of).max().unwrap_or(0).max(1);
        let slots = u32::try_from(slots).ok().filter(|&n| n <= u32::MAX / (2 * LEARNED as u32)).ok_or_else(|| {
            Error::Usage(format!("{slots} 2D Gaussians at once are more than the device can address"))
        })?;
        let grid = Grid::new(tile, 0, sizes.frames as u32, sizes.width, sizes.height);
        let raster_options = RasterOptions {
            splats: slots,
            pixels: sizes.pixels,
            tiles: grid.tiles(),
            isects: slots.saturating_mul(ISECTS_PER_SLOT).max(MIN_ISECTS),
            batch: true,
            background_image: true,
            median: false,
            backward: true,
            reduction,
        };
        let n = slots as usize;
        let words = |name: &str, len: usize| Buffer::new(context, name, len, Location::Device);
        let floats = |name: &str, len: usize| Buffer::new(context, name, len, Location::Device);
        let project_spec =
            plane_project::Spec { workgroup_size: WORKGROUP, tile_width: tile.width, tile_height: tile.height };
        let backward_spec = plane_backward::Spec { workgroup_size: WORKGROUP, gradients: false };
        Ok(PlaneStage {
            plane: floats("plane", PLANES * n)?,
            stride: slots,
            plane_frames: words("plane frames", n)?,
            views: Buffer::new(context, "plane views", sizes.frames, Location::Device)?,
            depths: floats("plane depths", sizes.pixels as usize)?,
            frames: Buffer::new(context, "frames", sizes.frames, Location::Device)?,
            quotas: Buffer::new(context, "quotas", sizes.frames, Location::Device)?,
            states: Buffer::new(context, "plane states", sizes.frames, Location::Device)?,
            ages: words("plane ages", n)?,
            moments: floats("plane moments", 2 * LEARNED * n)?,
            drawn_pixels: words("drawn pixels", n)?,
            loss: LossBuffers::new(context, &sizes, true)?,
            lists: TileLists::new(context, sizes.loss_tiles)?,
            raster: RefCell::new(Raster::new(context, raster_options)?),
            steps: Steps::new(context, STEPS_PER_SUBMISSION)?,
            project: PlaneProject::new(context, &project_spec)?,
            tiles: PlaneTiles::new(context, WORKGROUP)?,
            dispatch_args: DispatchArgs::new(context)?,
            ssim_forward: SsimForward::new(context, true, false)?,
            ssim_map: SsimForward::new(context, false, true)?,
            ssim_backward: SsimBackward::new(context, true)?,
            loss_sum: LossSum::new(context)?,
            backward: PlaneBackward::new(context, &backward_spec)?,
            prune: PlanePrune::new(context, &plane_prune::Spec { workgroup_size: WORKGROUP })?,
            draw: PlaneDraw::new(context, &plane_draw::Spec { workgroup_size: DRAW_WORKGROUP })?,
            step_done: StepDone::new(context, &step_done::Spec { workgroup_size: 1 })?,
            context: context.clone(),
            batches,
            budgets: budgets.to_vec(),
            schedule,
            seed,
        })
    }

    /// The views of each batch, in order.
    pub fn batches(&self) -> &[Range<usize>] {
        &self.batches
    }

    /// Refines the views of batch `batch` over `model`'s renders; `renderer` must have been made with depth. The host waits
    /// once for each round, beside the bound on submissions that are on their way.
    pub fn refine(
        &mut self,
        renderer: &mut Renderer,
        model: &Model,
        views: &Views,
        batch: usize,
        background: [f32; 3],
        mut progress: impl FnMut(&Progress),
    ) -> Result<Refined> {
        let Some(batch) = self.batches.get(batch).cloned() else {
            return Err(Error::Usage(format!("batch {batch} of {}", self.batches.len())));
        };
        let frames = frames_of(&views.cameras, &batch);
        let budgets = self.budgets[batch.clone()].to_vec();
        let slots = self.prepare(views, &batch, &frames, &budgets)?;
        render_batch(
            renderer,
            model,
            views,
            background,
            &batch,
            &frames,
            &self.steps,
            &self.step_done,
            &self.raster.borrow().backdrop.clone(),
            Some(&self.depths),
        )?;

        let [width, height] = [frames.iter().map(|f| f.width).max(), frames.iter().map(|f| f.height).max()];
        let grid = self.raster.borrow().grid(0, frames.len() as u32, width.unwrap_or(1), height.unwrap_or(1));
        let mut report =
            Progress { round: 0, step: 0, steps: 0, count: 0, budget: budgets.iter().sum(), loss: f64::NAN };
        let mut refined =
            Refined { base_losses: Vec::new(), losses: Vec::new(), counts: Vec::new(), rounds: 0, grown: 0 };
        // What follows a draw and leads up to the next, so the first has no steps.
        let mut steps = 0;
        loop {
            let round = refined.rounds + 1;
            refined.grown += self.run(&frames, views, slots, &grid, steps, Some(round), |step| {
                report.step = step.min(steps);
                report.steps = steps;
                progress(&report);
            })?;
            refined.rounds = round;
            let losses = self.losses(frames.len())?;
            if refined.base_losses.is_empty() {
                refined.base_losses.clone_from(&losses);
            }
            let states = self.states.download_range(0, frames.len())?;
            report.round = round;
            report.count = states.iter().map(|s| s.count).sum();
            report.loss = losses.iter().map(|&l| f64::from(l)).sum::<f64>() / frames.len() as f64;
            if round >= self.schedule.max_rounds || states.iter().all(|s| s.stepping == 0) {
                break;
            }
            steps = self.schedule.round_steps;
        }
        let awake: Vec<_> = (0..frames.len()).map(|_| PlaneState { count: 0, stepping: 1 }).collect();
        self.states.upload(0, &awake)?;
        steps = self.schedule.final_steps;
        refined.grown += self.run(&frames, views, slots, &grid, steps, None, |step| {
            report.step = step.min(steps);
            report.steps = steps;
            progress(&report);
        })?;
        refined.losses = self.losses(frames.len())?;
        refined.counts = vec![0; frames.len()];
        for frame in self.plane_frames.download_range(0, slots as usize)? {
            if let Some(count) = refined.counts.get_mut(frame as usize) {
                *count += 1;
            }
        }
        Ok(refined)
    }

    /// Fills what a batch begins with; returns the number of its slots. The slots beyond are empty.
    fn prepare(&self, views: &Views, batch: &Range<usize>, frames: &[Frame], budgets: &[u32]) -> Result<u32> {
        let mut slots = 0;
        let mut quotas = Vec::with_capacity(frames.len());
        for (v, &budget) in batch.clone().zip(budgets) {
            quotas.push(Quota { view: v as u32, first: slots, budget });
            slots += budget;
        }
        let cameras = &views.cameras[batch.clone()];
        let list: Vec<_> = cameras.iter().zip(frames).map(|(camera, f)| view(camera, f.image_first)).collect();
        self.views.upload(0, &list)?;
        self.frames.upload(0, frames)?;
        self.quotas.upload(0, &quotas)?;
        let mut recorder = self.context.recorder("plane prepare")?;
        recorder.fill(&self.plane_frames, EMPTY);
        recorder.fill(&self.states, 0);
        recorder.submit()?.wait()?;
        Ok(slots)
    }

    fn losses(&self, frames: usize) -> Result<Vec<f32>, GpuError> {
        Ok(self.loss.losses.download_range(0, frames)?.iter().map(|l| l.total).collect())
    }

    /// `steps` steps, a prune, and the losses of what is left; with `round`, new Gaussians are drawn from these. Returns how
    /// often buffers were grown. `progress` hears of steps done.
    #[expect(clippy::too_many_arguments, reason = "the batch's shape and what to do with it")]
    fn run(
        &self,
        list: &[Frame],
        views: &Views,
        slots: u32,
        grid: &Grid,
        steps: u32,
        round: Option<u32>,
        progress: impl FnMut(u32),
    ) -> Result<u32, GpuError> {
        let status = &self.steps.status;
        let loss = BatchLoss { frames: &self.frames, list, targets: &views.targets, buffers: &self.loss };
        let report = self.steps.run(
            steps + 1,
            false,
            |recorder, step| {
                let raster = self.raster.borrow();
                if step < steps {
                    self.record_render(recorder, &raster, slots, grid);
                    self.record_lists(recorder, &raster, slots, loss.tiles_per_frame());
                    loss.forward(recorder, &self.ssim_forward, &raster.image, Some(&self.lists));
                    loss.backward(recorder, &self.ssim_backward, &raster.image, &raster.image_grad, &self.lists);
                    raster.record_blend_backward(recorder, grid, &self.frames, 0);
                    let buffers = plane_backward::Buffers {
                        status,
                        frames: &self.frames,
                        plane_frames: &self.plane_frames,
                        plane_states: &self.states,
                        tile_counts: &raster.tile_counts,
                        first_slot: &raster.first_slot,
                        records: &raster.records,
                        plane: &self.plane,
                        plane_ages: &self.ages,
                        plane_moments: &self.moments,
                    };
                    let by_gaussian = raster.by_gaussian().into();
                    let push = plane_backward::Push { count: slots, stride: self.stride, by_gaussian };
                    self.backward.record(recorder, &buffers, &push);
                } else {
                    let buffers = plane_prune::Buffers {
                        status,
                        frames: &self.frames,
                        plane_states: &self.states,
                        plane: &self.plane,
                        plane_frames: &self.plane_frames,
                    };
                    self.prune.record(recorder, &buffers, &plane_prune::Push { count: slots, stride: self.stride });
                    self.record_render(recorder, &raster, slots, grid);
                    loss.forward(recorder, &self.ssim_map, &raster.image, None);
                    loss.sum(recorder, &self.loss_sum);
                    if let Some(round) = round {
                        self.record_draw(recorder, &raster, list.len() as u32, round);
                    }
                }
                self.step_done.record(recorder, &step_done::Buffers { status });
            },
            |needed| self.raster.borrow_mut().grow(needed),
            progress,
        )?;
        Ok(report.grown)
    }

    /// The batch's images as refined so far.
    fn record_render(&self, recorder: &mut Recorder, raster: &Raster, slots: u32, grid: &Grid) {
        let buffers = plane_project::Buffers {
            frames: &self.frames,
            plane_frames: &self.plane_frames,
            plane_states: &self.states,
            depths: &self.depths,
            plane: &self.plane,
            splats: &raster.splats,
            depth_keys: &raster.depth_keys,
            tile_counts: &raster.tile_counts,
        };
        self.project.record(recorder, &buffers, &plane_project::Push { count: slots, stride: self.stride });
        raster.record_order(recorder, slots, grid, &self.frames, &self.plane_frames, &self.steps.status);
        raster.record_blend(recorder, grid, &self.frames, [0.0; 3], 0.0);
    }

    /// The tiles of the loss that this step's gradients need.
    fn record_lists(&self, recorder: &mut Recorder, raster: &Raster, slots: u32, tiles_per_frame: u32) {
        let lists = &self.lists;
        let buffers = plane_tiles::Buffers {
            frames: &self.frames,
            plane_frames: &self.plane_frames,
            tile_counts: &raster.tile_counts,
            splats: &raster.splats,
            tile_marks: &lists.marks,
            count: &lists.count,
            forward_tiles: &lists.lists[0],
            backward_tiles: &lists.lists[1],
        };
        self.tiles.record(recorder, &buffers, &plane_tiles::Push { slots, tiles_per_frame });
        for list in 0..2 {
            let buffers =
                dispatch_args::Buffers { count: &lists.count, dispatch_args: &lists.args, status: &self.steps.status };
            let push = dispatch_args::Push {
                count_index: list,
                // A list holds every tile, so this never overflows.
                capacity: u32::MAX,
                items_per_group: 1,
                args_index: 3 * list,
                status_index: OVERFLOW as u32,
            };
            self.dispatch_args.record(recorder, &buffers, &push);
        }
    }

    fn record_draw(&self, recorder: &mut Recorder, raster: &Raster, frame_count: u32, round: u32) {
        let buffers = plane_draw::Buffers {
            status: &self.steps.status,
            frames: &self.frames,
            quotas: &self.quotas,
            loss_map: &self.loss.loss_map,
            image: &raster.image,
            drawn_pixels: &self.drawn_pixels,
            plane_states: &self.states,
            plane_frames: &self.plane_frames,
            plane: &self.plane,
            plane_ages: &self.ages,
            plane_moments: &self.moments,
        };
        let push = plane_draw::Push { frame_count, stride: self.stride, round, seed: self.seed };
        self.draw.record(recorder, &buffers, &push);
    }

    /// The base's render (RGB, transmittance) and depth of one view of the batch that was refined last, by its position there.
    pub fn base_render(&self, cameras: &[Camera], batch: usize, position: usize) -> Result<(Vec<[f32; 4]>, Vec<f32>)> {
        let range = self.batches.get(batch).cloned().unwrap_or(0..0);
        let Some(frame) = frames_of(cameras, &range).get(position).copied() else {
            return Err(Error::Usage(format!("batch {batch} has no view {position}")));
        };
        let (first, pixels) = (frame.image_first as usize, (frame.width * frame.height) as usize);
        let image = self.raster.borrow().backdrop.download_range(first, pixels)?;
        Ok((image, self.depths.download_range(first, pixels)?))
    }

    /// The slots that hold a Gaussian, ascending: the order of [`PlaneStage::download`].
    pub fn taken_slots(&self) -> Result<Vec<usize>> {
        let frames = self.plane_frames.download()?;
        Ok((0..frames.len()).filter(|&i| frames[i] != EMPTY).collect())
    }

    /// Reads the 2D Gaussians of batch `batch`, which was refined last, back; by view, and in a view by slot.
    pub fn download(&self, batch: usize) -> Result<Vec<Plane>> {
        let first_view = self.batches.get(batch).map_or(0, |b| b.start) as u32;
        let (plane, frames) = (self.plane.download()?, self.plane_frames.download()?);
        let at = |p: usize, i: usize| plane[p * self.stride as usize + i];
        let taken = frames.iter().enumerate().filter(|(_, f)| **f != EMPTY);
        Ok(taken
            .map(|(i, &frame)| Plane {
                view: first_view + frame,
                centre: [at(0, i), at(1, i)],
                colour: [at(2, i), at(3, i), at(4, i)],
                opacity_logit: at(5, i),
                log_scale: [at(6, i), at(7, i)],
                angle: at(8, i),
                depth: at(9, i),
            })
            .collect())
    }
}
