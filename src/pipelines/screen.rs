//! The screen phase (method, section 3): for each view, optimises supplementary Gaussians in image space over
//! the fixed base render. Many views run at once, but independently: a view's result does not depend on the
//! rest of its batch.
//!
//! base_losses → budgets → for each batch: [`Refiner`], then lift the remaining Gaussians on the device.

pub mod batch;
pub mod rig;

use std::ops::Range;

use batch::{BATCH_PIXELS, batches, frames_of, sizes_of};
use rig::Screen;

use super::{
    loss::{Batch, LossOptions, Photometric, Tiles},
    model::{Model, Segment},
    render::{Renderer, Show},
    session::Session,
    steps::{Looped, Steps},
    views::{Views, view},
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Recorder},
    stages::{
        constants::{
            constants::NONE,
            screen::{DRAWING, FILLED},
        },
        ssim::tiles_per_frame,
        status::Resource,
        types::{Frame, Quota},
    },
};

/// Steps per submission: a step has some 30 dispatches.
const STEPS_PER_SUBMISSION: u32 = 10;
/// A batch leaves one part in this number of its memory free, as memory is allocated in blocks.
const SPARE: u64 = 4;

/// Numbers of steps and draws of the screen phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Schedule {
    /// Steps after each draw, before the prune.
    pub round_steps: u32,
    /// Steps after the last draw.
    pub final_steps: u32,
    /// Maximum number of draws. A draw is a fifth of the budget; if prunes remove a share p of each,
    /// 5 / (1 − p) draws fill it, so 20 are enough up to p = 3/4. A view that loses more than that has no use for
    /// more Gaussians: it enters the last steps with those it has, and its other places stay empty.
    pub max_rounds: u32,
    /// ⚖ Adam's bias correction counts the steps of the view, as the authors' release does with its single
    /// optimiser, instead of those of each Gaussian. Then the first steps of later draws are about three times as
    /// long.
    pub shared_steps: bool,
}

impl Schedule {
    /// AuGS, appendix A.
    pub const PAPER: Schedule = Schedule { round_steps: 200, final_steps: 1000, max_rounds: 20, shared_steps: false };
    /// At least ten times fewer steps, for previews and machines without a GPU.
    pub const QUICK: Schedule = Schedule { round_steps: 20, final_steps: 20, max_rounds: 8, shared_steps: false };
}

/// Progress of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Finished draws.
    pub round: u32,
    /// Finished steps of this round, and their total.
    pub step: u32,
    /// See `step`.
    pub steps: u32,
    /// All rounds are finished; the final steps are running.
    pub last: bool,
    /// 2D Gaussians of the batch after its last draw, and their budget.
    pub count: u32,
    /// See `count`.
    pub budget: u32,
    /// Mean of the views' losses at the last draw; views that wait count with their base render.
    pub loss: f64,
}

/// Results of a batch, by position of the view in it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Refined {
    /// Loss of the base render of each view; `losses` is that with the 2D Gaussians.
    pub base_losses: Vec<f32>,
    /// See `base_losses`.
    pub losses: Vec<f32>,
    /// Remaining 2D Gaussians of each view.
    pub counts: Vec<u32>,
    /// Number of draws.
    pub rounds: u32,
    /// Number of times that the intersection buffers grew.
    pub grown: u32,
}

/// One 2D Gaussian on the host.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScreenGaussian {
    /// Index in the dataset.
    pub view: u32,
    /// Pixels.
    pub centre: [f32; 2],
    /// sRGB, 0 to 1.
    pub color: [f32; 3],
    /// ln(o / (1 − o)), before compensation.
    pub opacity_logit: f32,
    /// Natural logarithms of the standard deviations along the axes, pixels.
    pub log_scale: [f32; 2],
    /// Angle of the first axis, radians.
    pub angle: f32,
    /// Camera z at the centre, 0: none.
    pub depth: f32,
}

/// Budget of 2D Gaussians for each view, of `most` in all: n_i = ⌈most · ℓ_i / Σℓ⌉. A view gets none unless its
/// loss is a positive finite number.
pub fn budgets(losses: &[f64], most: u32) -> Vec<u32> {
    // guard: budgets of usable losses
    let usable = |loss: f64| if loss > 0.0 && loss.is_finite() { loss } else { 0.0 };
    let total: f64 = losses.iter().map(|&l| usable(l)).sum();
    losses.iter().map(|&l| if total > 0.0 { (f64::from(most) * usable(l) / total).ceil() as u32 } else { 0 }).collect()
}

/// Loss of the base in each view, 0.8 L1 + 0.2 (1 − SSIM), one view after the other. Waits.
///
/// # Errors
/// If the device's memory is too small, or the device fails.
pub fn base_losses(session: &Session, renderer: &mut Renderer, model: &Model, views: &Views) -> Result<Vec<f64>> {
    let count = views.cameras.len() as u32;
    let tiles_per_frame = tiles_per_frame(&views.frame_list);
    let options = LossOptions { tiles: tiles_per_frame, losses: count, ..Default::default() };
    let loss = Photometric::new(&session.context, &options)?;
    let mut work = BaseLosses { renderer, model, views, background: session.background, loss: &loss, tiles_per_frame };
    let mut steps = Steps::new(&session.context, STEPS_PER_SUBMISSION.min(views.views_at_once()))?;
    steps.run(count, false, &mut work, |_| ())?;
    Ok(loss.losses.mapped().iter().map(|loss| loss.total.into()).collect())
}

/// Step v computes the loss of view v.
struct BaseLosses<'a> {
    renderer: &'a mut Renderer,
    model: &'a Model,
    views: &'a Views,
    background: [f32; 3],
    loss: &'a Photometric,
    tiles_per_frame: u32,
}

impl Looped for BaseLosses<'_> {
    fn record(&mut self, recorder: &mut Recorder, view: u32, status: &Buffer<u32>) -> Result<()> {
        let targets = self.views.record_photograph(recorder, view, None)?;
        let show = Show { upto: Segment::Base, degree: self.model.sh_degree, background: self.background };
        self.renderer.record(recorder, self.model, self.views, view, &show, status)?;
        let batch = Batch {
            frames: &self.views.frames,
            frame_first: view,
            frame_count: 1,
            tiles_per_frame: self.tiles_per_frame,
            image: &self.renderer.raster.buffers.image,
            targets,
        };
        self.loss.record_forward(recorder, &batch, Tiles::All, None);
        self.loss.record_sum(recorder, &batch, view);
        Ok(())
    }

    fn grow(&mut self, _: Resource, needed: u32) -> Result<()> {
        Ok(self.renderer.raster.grow(needed)?)
    }
}

/// Renders the views of a batch one after the other into `images`, and their depths into `depths`.
struct BaseWork<'a> {
    renderer: &'a mut Renderer,
    model: &'a Model,
    views: &'a Views,
    background: [f32; 3],
    /// Index of the batch's first view.
    first: u32,
    list: &'a [Frame],
    images: &'a Buffer<[f32; 4]>,
    depths: &'a Buffer<f32>,
}

impl Looped for BaseWork<'_> {
    fn record(&mut self, recorder: &mut Recorder, step: u32, status: &Buffer<u32>) -> Result<()> {
        let frame = &self.list[step as usize];
        let show = Show { upto: Segment::Base, degree: self.model.sh_degree, background: self.background };
        self.renderer.record(recorder, self.model, self.views, self.first + step, &show, status)?;
        let (first, pixels) = (frame.image_first as usize, (frame.width * frame.height) as usize);
        recorder.copy(&self.renderer.raster.buffers.image, 0, self.images, first, pixels);
        recorder.copy(&self.renderer.depths, 0, self.depths, first, pixels);
        Ok(())
    }

    fn grow(&mut self, _: Resource, needed: u32) -> Result<()> {
        Ok(self.renderer.raster.grow(needed)?)
    }
}

/// The steps of a round, a prune, and the losses of the remaining Gaussians. With `draw`, these losses place
/// new ones.
struct Round<'a> {
    screen: &'a mut Screen,
    targets: &'a Buffer<u32>,
    steps: u32,
    draw: Option<Draw>,
}

#[derive(Clone, Copy)]
struct Draw {
    round: u32,
    seed: u32,
    /// Initial age of drawn Gaussians.
    age: u32,
}

impl Looped for Round<'_> {
    fn record(&mut self, recorder: &mut Recorder, step: u32, status: &Buffer<u32>) -> Result<()> {
        let screen = &self.screen;
        if step < self.steps {
            screen.record_render(recorder, status);
            screen.record_loss(recorder, self.targets, status);
            screen.record_step(recorder, status);
        } else {
            screen.record_prune(recorder, status);
            screen.record_render(recorder, status);
            screen.record_loss_map(recorder, self.targets);
            if let Some(Draw { round, seed, age }) = self.draw {
                screen.record_draw(recorder, round, seed, age, status);
            }
        }
        Ok(())
    }

    fn grow(&mut self, _: Resource, needed: u32) -> Result<()> {
        Ok(self.screen.raster.grow(needed)?)
    }

    fn grow_early(&mut self, needed: u32) -> Result<()> {
        Ok(self.screen.raster.grow_early(needed)?)
    }

    fn room(&self) -> u32 {
        self.screen.raster.capacity()
    }
}

/// Current job of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Job {
    Idle,
    /// Render the base and its depths.
    Base,
    /// Run the steps before draw `round`, then draw.
    Round {
        round: u32,
        steps: u32,
    },
    /// Run the steps after the last draw.
    LastRound,
    Final,
}

/// Refines views batch by batch; the results of one batch stay on the device until the next starts.
pub struct Refiner {
    /// Buffers and stages of one batch, reused for each.
    pub screen: Screen,
    batches: Vec<Range<usize>>,
    budgets: Vec<u32>,
    schedule: Schedule,
    seed: u32,
    background: [f32; 3],
    steps: Steps,
    /// The current batch, its frames and its job.
    batch: Range<usize>,
    frames: Vec<Frame>,
    job: Job,
    progress: Progress,
    refined: Refined,
}

impl Refiner {
    /// `budgets` covers all views, see [`budgets`]. Batches are as large as memory allows.
    ///
    /// # Errors
    /// [`Error::Usage`] if the numbers of views and budgets differ; otherwise an error of the device.
    pub fn new(session: &Session, views: &Views, budgets: &[u32], schedule: Schedule) -> Result<Self> {
        if budgets.len() != views.cameras.len() {
            let (n, v) = (budgets.len(), views.cameras.len());
            return Err(Error::Usage(format!("{n} budgets for {v} views: one for each is needed")));
        }
        let context = &session.context;
        let memory = context.memory();
        let room = memory.budget.saturating_sub(memory.taken);
        let mut pixels = BATCH_PIXELS;
        let (batches, sizes) = loop {
            let batches = batches(context, views, pixels);
            let sizes = sizes_of(views, &batches, budgets)?;
            let needed = Screen::plan(context, &sizes, session.policy).bytes();
            if needed.saturating_add(needed / SPARE) <= room || batches.len() == views.cameras.len() {
                break (batches, sizes);
            }
            pixels = pixels.min(sizes.pixels.into()) / 2;
        };
        Ok(Refiner {
            screen: Screen::new(context, sizes, session.policy)?,
            batches,
            budgets: budgets.to_vec(),
            schedule,
            seed: session.seed as u32,
            background: session.background,
            steps: Steps::new(context, STEPS_PER_SUBMISSION)?,
            batch: 0..0,
            frames: Vec::new(),
            job: Job::Idle,
            progress: Progress { round: 0, step: 0, steps: 0, last: false, count: 0, budget: 0, loss: f64::NAN },
            refined: Refined::default(),
        })
    }

    /// The ranges of views of the batches, in order.
    pub fn batches(&self) -> &[Range<usize>] {
        &self.batches
    }

    /// The views of the current batch.
    pub fn views(&self) -> Range<usize> {
        self.batch.clone()
    }

    /// Starts batch `batch` of `views`. Waits.
    pub fn start(&mut self, views: &Views, batch: usize) -> Result<()> {
        let Some(batch) = self.batches.get(batch).cloned() else {
            return Err(Error::Usage(format!("batch {batch} of {}", self.batches.len())));
        };
        self.frames = frames_of(views, &batch);
        let mut quotas = Vec::with_capacity(batch.len());
        let mut first = 0;
        for (v, &budget) in batch.clone().zip(&self.budgets[batch.clone()]) {
            quotas.push(Quota { view: v as u32, first, budget });
            first += budget;
        }
        let cameras = views.cameras[batch.clone()].iter().zip(&self.frames);
        let list: Vec<_> = cameras.map(|(camera, frame)| view(camera, frame.image_first)).collect();
        self.screen.begin(&self.frames, &list, &quotas)?;
        self.batch = batch;
        self.job = Job::Base;
        self.refined = Refined::default();
        self.progress = Progress { round: 0, step: 0, steps: 0, last: false, count: 0, budget: first, loss: f64::NAN };
        self.start_job()
    }

    /// Continues the current batch, over `model`'s base; `renderer` must have depth. `None` once it is
    /// refined. The host waits for submissions in flight, and once per round.
    pub fn advance(&mut self, renderer: &mut Renderer, model: &Model, views: &Views) -> Result<Option<Progress>> {
        let (first, targets) = (self.batch.start as u32, views.targets(self.batch.start)?);
        loop {
            let steps = match self.job {
                Job::Idle => return Ok(None),
                Job::Base => 0,
                Job::Round { steps, .. } => steps,
                Job::LastRound => self.schedule.round_steps,
                Job::Final => self.schedule.final_steps,
            };
            let advanced = match self.job {
                Job::Base => {
                    let images = self.screen.raster.buffers.backdrop.clone();
                    let (background, list) = (self.background, &self.frames[..]);
                    let depths = &self.screen.buffers.depths;
                    let mut work =
                        BaseWork { renderer, model, views, background, first, list, images: &images, depths };
                    self.steps.advance(&mut work)?
                }
                _ => {
                    let draw = match self.job {
                        Job::Round { round, .. } => {
                            let before = (round - 1) * self.schedule.round_steps;
                            let age = if self.schedule.shared_steps { before } else { 0 };
                            Some(Draw { round, seed: self.seed, age })
                        }
                        _ => None,
                    };
                    self.steps.advance(&mut Round { screen: &mut self.screen, targets, steps, draw })?
                }
            };
            if let Some(done) = advanced {
                self.progress.step = done.min(steps);
                self.progress.steps = steps;
                self.progress.last = self.job == Job::Final;
                return Ok(Some(self.progress));
            }
            self.finish_job()?;
        }
    }

    /// Refines a whole batch; calls `progress` on the way.
    pub fn refine(
        &mut self,
        renderer: &mut Renderer,
        model: &Model,
        views: &Views,
        batch: usize,
        mut progress: impl FnMut(&Progress),
    ) -> Result<Refined> {
        self.start(views, batch)?;
        while let Some(so_far) = self.advance(renderer, model, views)? {
            progress(&so_far);
        }
        Ok(self.refined.clone())
    }

    /// Results of the current batch, once it is refined.
    pub fn refined(&self) -> &Refined {
        &self.refined
    }

    /// Evaluates a finished job, and selects the next one.
    fn finish_job(&mut self) -> Result<()> {
        let grown = self.steps.report().grown;
        self.job = match self.job {
            Job::Idle => Job::Idle,
            // The first draw has no steps before it.
            Job::Base => Job::Round { round: 1, steps: 0 },
            Job::Round { round, .. } => {
                self.refined.grown += grown;
                self.refined.rounds = round;
                let losses = self.losses();
                let states = self.screen.buffers.screen_states.download_range(0, self.frames.len())?;
                self.progress.round = round;
                self.progress.count = states.iter().map(|s| s.count).sum();
                self.progress.loss = losses.iter().map(|&l| f64::from(l)).sum::<f64>() / losses.len() as f64;
                if self.refined.base_losses.is_empty() {
                    self.refined.base_losses = losses;
                }
                if round < self.schedule.max_rounds && states.iter().any(|s| s.mode == DRAWING) {
                    Job::Round { round: round + 1, steps: self.schedule.round_steps }
                } else {
                    Job::LastRound
                }
            }
            Job::LastRound => {
                self.refined.grown += grown;
                self.screen.set_mode(FILLED)?;
                Job::Final
            }
            Job::Final => {
                self.refined.grown += grown;
                self.refined.losses = self.losses();
                self.refined.counts = vec![0; self.frames.len()];
                let frames = self.screen.buffers.screen_frames.download_range(0, self.screen.places() as usize)?;
                for frame in frames {
                    if let Some(count) = self.refined.counts.get_mut(frame as usize) {
                        *count += 1;
                    }
                }
                Job::Idle
            }
        };
        self.start_job()
    }

    /// Starts the current job.
    fn start_job(&mut self) -> Result<()> {
        let steps = match self.job {
            Job::Idle => return Ok(()),
            Job::Base => self.frames.len() as u32,
            Job::Round { steps, .. } => steps + 1,
            Job::LastRound => self.schedule.round_steps + 1,
            Job::Final => self.schedule.final_steps + 1,
        };
        self.steps.start(steps, false)
    }

    fn losses(&self) -> Vec<f32> {
        self.screen.loss.losses.mapped()[..self.frames.len()].iter().map(|l| l.total).collect()
    }

    /// Base render (RGB, transmittance) and depth of one view of the current batch, by position. Waits.
    pub fn base_render(&self, position: usize) -> Result<(Vec<[f32; 4]>, Vec<f32>)> {
        let Some(frame) = self.frames.get(position) else {
            return Err(Error::Usage(format!("view {position} of a batch of {}", self.frames.len())));
        };
        let (first, pixels) = (frame.image_first as usize, (frame.width * frame.height) as usize);
        let image = self.screen.raster.buffers.backdrop.download_range(first, pixels)?;
        Ok((image, self.screen.buffers.depths.download_range(first, pixels)?))
    }

    /// Downloads the 2D Gaussians of the current batch, each with its place; ordered by view, then by place.
    /// Waits.
    pub fn download(&self) -> Result<Vec<(usize, ScreenGaussian)>> {
        let b = &self.screen.buffers;
        let (planes, frames) = (b.screen_planes.download()?, b.screen_frames.download()?);
        let at = |p: usize, i: usize| planes[p * self.screen.sizes.places as usize + i];
        let taken = frames.iter().enumerate().filter(|(_, f)| **f != NONE);
        Ok(taken
            .map(|(i, &frame)| {
                let gaussian = ScreenGaussian {
                    view: self.batch.start as u32 + frame,
                    centre: [at(0, i), at(1, i)],
                    color: [at(2, i), at(3, i), at(4, i)],
                    opacity_logit: at(5, i),
                    log_scale: [at(6, i), at(7, i)],
                    angle: at(8, i),
                    depth: at(9, i),
                };
                (i, gaussian)
            })
            .collect())
    }
}
