//! Trains Gaussians on photographs: render → loss → backward → step, all on the device.
//!
//! [`Trainer`] is the loop of both the base scene (method, section 2; `density` changes the number of
//! Gaussians) and the joint phase (section 5, `join`). They differ in the parameters that learn, and in their
//! rates.

use std::time::Duration;

use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::{
    checkpoint::Checkpoint,
    density::{Density, DensityOptions, Strategy},
    exposure::Exposure,
    learn::{Learner, Lesson, PROBED_NTH, Rates, Seen},
    loss::{Batch, LossOptions, Photometric, Tiles},
    model::{Model, Planes, Segment},
    raster::{Grid, Raster},
    render::{Needs, RenderOptions, Renderer, Show},
    session::{Policy, Session},
    steps::{Looped, StepReport, Steps},
    views::Views,
};
use crate::{
    data::checkpoint::{BANDED, BASE, GEOMETRY, LOBES, SH, SUPPLEMENT},
    error::{Error, Result},
    gpu::{Buffer, Recorder},
    scene::color,
    stages::{ssim::tiles_per_frame, status::Resource, types::Loss},
};

/// Maximum number of steps per command buffer: enough that submitting costs nothing, few enough that progress
/// is visible and a replay after growth is short.
const BATCH: u32 = 16;

/// Settings of a step, apart from its views.
#[derive(Debug, Clone, Copy)]
pub struct StepPlan {
    /// Learning rates per parameter class.
    pub rates: Rates,
    /// SH bands in use.
    pub active_degree: u32,
}

/// Pipelines and buffers of a training loop, made once, and the loop itself.
pub struct Trainer {
    work: Training,
    steps: Steps,
}

/// The body of the loop: one training step.
struct Training {
    renderer: Renderer,
    loss: Photometric,
    tiles_per_frame: u32,
    learners: Vec<Learner>,
    /// Step t sees the views `schedule[t * views_per_step..][..views_per_step]`.
    schedule: Vec<u32>,
    views_per_step: u32,
    plan: Box<dyn Fn(u32) -> StepPlan + Send>,
    background: [f32; 3],
    /// Seed of random backgrounds.
    seed: u64,
    /// Density control of the base.
    density: Option<Density>,
    exposure: Option<Exposure>,
    /// The number of Gaussians in a segment may change during the loop.
    varies: bool,
    /// Some learner uses Newton's steps.
    newton: bool,
}

/// Results of a training loop.
#[derive(Debug)]
pub struct TrainReport {
    /// Number of growths, and times of the stages.
    pub steps: StepReport,
    /// Loss of every view of every step, before the step.
    pub losses: Vec<f32>,
}

/// A training step together with the model and views it runs on.
struct On<'a> {
    training: &'a mut Training,
    model: &'a Model,
    views: &'a Views,
}

impl Trainer {
    /// For steps on `model` that see `views_per_step` of `views` each, in the order of `schedule`; the views'
    /// photographs are the targets. `plan` returns the rates of each step.
    ///
    /// # Errors
    /// [`Error::Usage`] if the schedule names a missing view or does not divide into steps, or if model and
    /// views have different origins; otherwise an error of the device.
    pub fn new(
        session: &Session,
        model: &Model,
        views: &Views,
        lessons: &[Lesson],
        schedule: Vec<u32>,
        views_per_step: u32,
        plan: impl Fn(u32) -> StepPlan + Send + 'static,
    ) -> Result<Self> {
        let whole = views_per_step > 0 && (schedule.len() as u32).is_multiple_of(views_per_step);
        let newton = lessons.iter().any(|lesson| lesson.newton);
        if newton && views_per_step > 1 {
            return Err(Error::Usage("Newton's steps see one view each".into()));
        }
        let mut of_newton = lessons.iter().filter(|lesson| lesson.newton && !lesson.opacity_only);
        if let Some(lesson) = of_newton.find(|lesson| !color::of(model.part(lesson.segment).sh_degree).newton) {
            let name = color::of(model.part(lesson.segment).sh_degree).name;
            return Err(Error::Usage(format!("{name} learn by Adam's steps, and these are Newton's")));
        }
        if !whole || schedule.iter().any(|&v| v as usize >= views.cameras.len()) {
            return Err(Error::Usage("the schedule does not fit the views or the steps".into()));
        }
        model.check_origin(views)?;
        let context = &session.context;
        // The model's spare room may never be used.
        let render =
            RenderOptions { backward: true, first: Some(model.count()), policy: session.policy, ..Default::default() };
        // The bands in use never become fewer.
        let least_degree = plan(0).active_degree;
        let needs = Needs::at(model, least_degree.min(model.sh_degree)..=model.sh_degree);
        let tiles_per_frame = tiles_per_frame(&views.frame_list);
        let (tiles, losses) = (tiles_per_frame, schedule.len() as u32);
        let loss = LossOptions { tiles, losses, backward: true, probe: newton, ..Default::default() };
        let learner = |&lesson: &Lesson| Learner::new(model, Lesson { least_degree, ..lesson }, views_per_step > 1);
        Ok(Trainer {
            work: Training {
                renderer: Renderer::new(context, needs, views, render)?,
                loss: Photometric::new(context, &loss)?,
                tiles_per_frame,
                learners: lessons.iter().map(learner).collect::<Result<_, _>>()?,
                schedule,
                views_per_step,
                plan: Box::new(plan),
                background: session.background,
                seed: session.seed,
                density: None,
                exposure: None,
                varies: false,
                newton,
            },
            steps: Steps::new(context, BATCH.min(views.views_at_once() / views_per_step))?,
        })
    }

    /// The raster of all its steps.
    pub fn raster(&self) -> &Raster {
        &self.work.renderer.raster
    }

    /// Starts the loop, or starts it again from the current parameters.
    pub fn start(&mut self, timed: bool) -> Result<()> {
        self.steps.start(self.total(), timed)
    }

    /// Resumes from a [`Trainer::checkpoint`]: restores `model`'s parameters and the moments. The result has
    /// the same bits as an uninterrupted run. Waits.
    ///
    /// # Errors
    /// [`Error::Usage`] if the checkpoint is of another model or schedule; then nothing has changed.
    pub fn resume(&mut self, model: &Model, checkpoint: &Checkpoint, timed: bool) -> Result<()> {
        let (step, total) = (checkpoint.step, self.total());
        if step > total {
            return Err(Error::Usage(format!("{step} of {total} steps are done")));
        }
        let seen = (step * self.work.views_per_step) as usize;
        let losses = checkpoint.floats(LOSSES, seen)?;
        let (mut kept, mut counts) = (Vec::new(), Vec::new());
        for learner in &self.work.learners {
            let segment = learner.lesson.segment;
            let all = self.work.learned(model, learner);
            let count = match all.first() {
                Some((first, _)) if self.work.varies => checkpoint.columns(first)?,
                _ => model.count_of(segment) as usize,
            };
            let room = model.part(segment).capacity() as usize;
            if count > room {
                return Err(Error::Usage(format!("the checkpoint has {count} Gaussians, the model room for {room}")));
            }
            counts.push((segment, count as u32));
            for (name, planes) in all {
                kept.push((planes, checkpoint.planes(&name, planes.planes(), count)?, count));
            }
        }
        let maps = self.work.exposure.as_ref().map(|exposure| exposure.find(checkpoint)).transpose()?;
        for (planes, values, count) in kept {
            planes.restore(values, count)?;
        }
        if let (Some(exposure), Some(maps)) = (&self.work.exposure, maps) {
            exposure.restore(maps)?;
        }
        for (segment, count) in counts {
            model.set_count(segment, count)?;
        }
        self.work.write_losses(losses);
        self.steps.start_at(step, total, timed)
    }

    /// Checkpoint of everything that the remaining steps need. Waits; the loop can continue.
    pub fn checkpoint(&mut self, model: &Model, views: &Views) -> Result<Checkpoint> {
        let step = self.settle(model, views)?;
        let mut checkpoint = Checkpoint::new(step);
        checkpoint.put_origin(model.origin);
        let seen = (step * self.work.views_per_step) as usize;
        let losses = self.work.loss.losses.mapped();
        checkpoint.put(LOSSES.into(), [1, seen], losses[..seen].iter().map(|l| l.total).collect());
        let counts = model.counts()?;
        for learner in &self.work.learners {
            let count = counts[learner.lesson.segment as usize] as usize;
            for (name, planes) in self.work.learned(model, learner) {
                checkpoint.put(name, [planes.planes(), count], planes.values(count)?);
            }
        }
        if let Some(exposure) = &self.work.exposure {
            exposure.keep(&mut checkpoint)?;
        }
        Ok(checkpoint)
    }

    /// Total number of steps in the schedule.
    pub fn total(&self) -> u32 {
        self.work.total()
    }

    /// Accepts checkpoints with another number of Gaussians than the initial model.
    pub fn let_counts_vary(&mut self) {
        self.work.varies = true;
    }

    /// Enables exposure correction: learns an affine map of colors for each of `views`, see
    /// [`exposure`](super::exposure). Call it before the loop starts; checkpoints include the maps.
    ///
    /// # Errors
    /// [`Error::Usage`] if a step sees several views; otherwise an error of the device.
    pub fn correct_exposure(&mut self, session: &Session, views: &Views) -> Result<()> {
        if self.work.views_per_step != 1 {
            return Err(Error::Usage("exposure is corrected in steps of one view only".into()));
        }
        self.work.exposure = Some(Exposure::new(&session.context, views)?);
        Ok(())
    }

    /// The map of each view, rows of (M | b), if exposure correction is on. Waits.
    pub fn exposures(&self) -> Result<Option<Vec<[f32; 12]>>> {
        self.work.exposure.as_ref().map(Exposure::download).transpose()
    }

    /// Lets the loop run up to step `step`; [`Trainer::advance`] then has nothing more to do until the limit
    /// is raised.
    pub fn go_on_to(&mut self, step: u32) {
        self.steps.go_on_to(step);
    }

    /// Runs until some steps are done. Returns their number so far, or `None` once all are. `model` and
    /// `views` must be those passed to [`Trainer::new`].
    pub fn advance(&mut self, model: &Model, views: &Views) -> Result<Option<u32>> {
        self.steps.advance(&mut On { training: &mut self.work, model, views })
    }

    /// Waits for all work in flight, and returns the number of finished steps. The loop can continue.
    pub fn settle(&mut self, model: &Model, views: &Views) -> Result<u32> {
        self.steps.settle(&mut On { training: &mut self.work, model, views })
    }

    /// Limits the duration of a submission, unless a single step takes longer; half a second at most.
    pub fn submit_at_most(&mut self, longest: Duration) {
        self.steps.last_at_most(longest);
    }

    /// Losses of the views of the first `steps` steps, all of them finished.
    pub fn losses(&self, steps: u32) -> Vec<f32> {
        let seen = (steps * self.work.views_per_step) as usize;
        self.work.loss.losses.mapped().iter().take(seen.min(self.work.schedule.len())).map(|l| l.total).collect()
    }

    /// Means of loss and PSNR \[dB\] over the last `views` views of the first `steps` steps, all of them
    /// finished. Each value is from before its step; masked pixels count as correct. `None` if no step has
    /// run since the start or resume.
    pub fn lately(&self, steps: u32, views: usize) -> Option<[f64; 2]> {
        let seen = ((steps * self.work.views_per_step) as usize).min(self.work.schedule.len());
        let losses = &self.work.loss.losses.mapped()[seen.saturating_sub(views)..seen];
        let known: Vec<&Loss> = losses.iter().filter(|loss| loss.squared.is_finite()).collect();
        let mean = |of: fn(&Loss) -> f64| known.iter().map(|loss| of(loss)).sum::<f64>() / known.len() as f64;
        // Clamped to 150 dB.
        let psnr = |loss: &Loss| -10.0 * f64::from(loss.squared).max(1e-15).log10();
        (!known.is_empty()).then(|| [mean(|loss| loss.total.into()), mean(psnr)])
    }

    /// Number of base Gaussians after the last refinement of density control; `None` before the first. Does
    /// not wait.
    pub fn gaussians(&self) -> Option<u32> {
        let told = self.work.density.iter().flat_map(|density| density.told.mapped()).sum();
        (told > 0).then_some(told)
    }

    /// Changes the length of a loop of [`dense_trainer`], of which `done` steps then count as done; keeps all
    /// learned parameters. Waits.
    pub fn replan(
        &mut self,
        session: &Session,
        views: &Views,
        options: &BaseOptions,
        density: &DensityOptions,
        done: u32,
    ) -> Result<()> {
        let (schedule, plan) = course(session, views, options, density);
        if let Some(control) = &mut self.work.density {
            control.replan(options.iterations);
        }
        self.follow(session, schedule, plan, done)
    }

    /// Stops the loop, and returns the number of finished steps. Waits.
    pub(super) fn halt(&mut self) -> Result<u32> {
        self.steps.stop()
    }

    /// Switches to another schedule, of which `done` steps count as done; keeps all learned parameters. The
    /// last losses stay; if there are too few, the first one is repeated before them. Waits.
    pub(super) fn follow(
        &mut self,
        session: &Session,
        schedule: Vec<u32>,
        plan: impl Fn(u32) -> StepPlan + Send + 'static,
        done: u32,
    ) -> Result<()> {
        let before = self.halt()?;
        let losses = self.losses(before);
        let late = losses.len().saturating_sub(done as usize);
        let first = losses.first().copied().unwrap_or(0.0);
        let padding = std::iter::repeat_n(first, (done as usize).saturating_sub(losses.len()));
        let moved: Vec<f32> = padding.chain(losses[late..].iter().copied()).collect();
        self.work.loss.make_room(&session.context, schedule.len())?;
        self.work.write_losses(&moved);
        (self.work.schedule, self.work.plan) = (schedule, Box::new(plan));
        self.steps.count_anew(done, self.total())
    }

    /// Results so far.
    pub fn report(&mut self) -> TrainReport {
        TrainReport { losses: self.losses(self.total()), steps: self.steps.report() }
    }

    /// Ends the loop early, and returns the results so far. Waits.
    pub fn stop(&mut self) -> Result<TrainReport> {
        let done = self.steps.stop()?;
        Ok(TrainReport { losses: self.losses(done), steps: self.steps.report() })
    }

    /// Runs all steps; calls `progress` with the number of finished steps.
    pub fn run(
        &mut self,
        model: &Model,
        views: &Views,
        timed: bool,
        mut progress: impl FnMut(u32),
    ) -> Result<TrainReport> {
        self.start(timed)?;
        while let Some(done) = self.advance(model, views)? {
            progress(done);
        }
        Ok(self.report())
    }
}

/// Name of the losses in a checkpoint.
const LOSSES: &str = "losses";

impl Training {
    fn total(&self) -> u32 {
        self.schedule.len() as u32 / self.views_per_step
    }

    /// Stores the losses of the first steps; their components are unknown.
    fn write_losses(&mut self, losses: &[f32]) {
        let whole = |&total: &f32| Loss { l1: f32::NAN, squared: f32::NAN, ssim: f32::NAN, total };
        self.loss.losses.write_mapped(&losses.iter().map(whole).collect::<Vec<_>>());
    }

    /// Everything that a learner and density control change, by name in a checkpoint: parameters, moments,
    /// scores.
    fn learned<'a>(&'a self, model: &'a Model, learner: &'a Learner) -> Vec<(String, &'a Planes)> {
        let part = model.part(learner.lesson.segment);
        let segment = match learner.lesson.segment {
            Segment::Base => BASE,
            Segment::Banded => BANDED,
            Segment::Supplement => SUPPLEMENT,
        };
        let [geometry, sh, lobes] = learner.moments.all();
        let all = [(GEOMETRY, &part.geometry, geometry), (SH, &part.sh, sh), (LOBES, &part.lobes, lobes)];
        // Parameters without moments are frozen.
        let moving = all.into_iter().filter(|(.., moments)| moments.planes() > 0);
        let named = moving.flat_map(|(what, planes, moments)| {
            [(format!("{segment}.{what}"), planes), (format!("{segment}.{what}_moments"), moments)]
        });
        let scores = self.density.iter().find(|density| density.segment == learner.lesson.segment);
        named.chain(scores.map(|density| (format!("{segment}.scores"), &density.scores))).collect()
    }
}

impl On<'_> {
    /// One Newton step in [`PROBED_NTH`] is probed.
    fn is_probed(&self, step: u32) -> bool {
        self.training.newton && step.is_multiple_of(PROBED_NTH)
    }

    /// Records the gradient records of one view and returns the inputs of its loss.
    fn record_view(
        &self,
        recorder: &mut Recorder,
        at: u32,
        degree: u32,
        status: &Buffer<u32>,
    ) -> Result<(Grid, Batch<'_>)> {
        let On { training, model, views } = self;
        let Training { renderer, loss, .. } = &**training;
        let view = training.schedule[at as usize];
        // A photograph's map of exposure would change the background, too.
        let varied = views.are_transparent() && training.exposure.is_none() && at.is_multiple_of(VARIED_NTH);
        let varied = varied.then(|| background_of(training.seed, at));
        let targets = views.record_photograph(recorder, view, varied)?;
        let background = varied.map_or(training.background, |color| color.map(|byte| f32::from(byte) / 255.0));
        let show = Show { upto: Segment::Supplement, degree, background };
        let grid = renderer.record(recorder, model, views, view, &show, status)?;
        let buffers = &renderer.raster.buffers;
        let batch = Batch {
            frames: &views.frames,
            frame_first: view,
            frame_count: 1,
            tiles_per_frame: training.tiles_per_frame,
            image: training.exposure.as_ref().map_or(&buffers.image, |exposure| &exposure.corrected),
            targets,
        };
        if let Some(exposure) = &training.exposure {
            exposure.record_apply(recorder, views, view, buffers);
        }
        loss.record_forward(recorder, &batch, Tiles::All, None);
        // Leading segments that only learn opacities need no other gradient.
        let frozen = training.learners.iter().take_while(|l| l.lesson.opacity_only).count() as u32;
        let blend_backward = |recorder: &mut Recorder| {
            renderer.raster.record_blend_backward(recorder, &grid, &views.frames, &model.population, frozen);
        };
        // Newton's steps see one view each, so `at` is the number of the step.
        if self.is_probed(at) {
            let pixels = views.cameras[view as usize].pixels();
            loss.record_probe(recorder, &batch, &buffers.image_grad, pixels, at);
            blend_backward(recorder);
            let seen = Seen { model, views, view, raster: &renderer.raster, degree, status };
            let newton = training.learners.iter().filter(|learner| learner.lesson.newton);
            newton.for_each(|learner| learner.record_probe(recorder, &seen, at));
        }
        loss.record_backward(recorder, &batch, &buffers.image_grad, Tiles::All, None);
        if let Some(exposure) = &training.exposure {
            exposure.record_backward(recorder, views, view, buffers);
        }
        loss.record_sum(recorder, &batch, at);
        blend_backward(recorder);
        Ok((grid, batch))
    }
}

impl Looped for On<'_> {
    fn record(&mut self, recorder: &mut Recorder, step: u32, status: &Buffer<u32>) -> Result<()> {
        let On { training, model, views } = &*self;
        let StepPlan { rates, active_degree: degree } = (training.plan)(step);
        let (views_per_step, raster) = (training.views_per_step, &training.renderer.raster);
        let several = views_per_step > 1;
        if several {
            training.learners.iter().for_each(|learner| learner.record_begin(recorder));
        }
        for at in step * views_per_step..(step + 1) * views_per_step {
            let (grid, batch) = self.record_view(recorder, at, degree, status)?;
            let view = training.schedule[at as usize];
            let seen = Seen { model, views, view, raster, degree, status };
            for learner in &training.learners {
                match several {
                    false => learner.record_step(recorder, &seen, &rates, step),
                    true => learner.record_add(recorder, &seen),
                }
            }
            if let Some(exposure) = &training.exposure {
                exposure.record_step(recorder, views, view, f64::from(step) / f64::from(training.total()), status);
            }
            if let Some(density) = &training.density {
                density.record_errors(recorder, step, &seen, (&grid, &batch));
                density.record_scores(recorder, step, &seen);
            }
        }
        if several {
            for learner in &training.learners {
                learner.record_adam(recorder, model, degree, &rates, step, status);
            }
        }
        if let (Some(density), Some(learner)) = (&training.density, training.learners.first()) {
            density.record(recorder, model, &learner.moments, &rates, step, status);
        }
        Ok(())
    }

    fn grow(&mut self, resource: Resource, needed: u32) -> Result<()> {
        match resource {
            Resource::Intersections => Ok(self.training.renderer.raster.grow(needed)?),
            other => Err(Error::Usage(format!("training needs room for {needed} {other}, more than it may have"))),
        }
    }

    fn grow_early(&mut self, needed: u32) -> Result<()> {
        Ok(self.training.renderer.raster.grow_early(needed)?)
    }

    fn room(&self) -> u32 {
        self.training.renderer.raster.capacity()
    }
}

/// One view in so many is shown over a random background, if photographs are transparent. Without, Gaussians of the background's color stay
/// in front of what other photos show; with all, scenes converge more slowly (docs/experiments/2026-11-29-backgrounds.md).
pub const VARIED_NTH: u32 = 8;

/// The random background of view `at` of the schedule.
fn background_of(seed: u64, at: u32) -> [u8; 3] {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(1 + u64::from(at));
    rng.random()
}

/// `steps` views in random permutations of 0..`views`: no view repeats before all were seen.
pub fn permutations(views: u32, steps: u32, seed: u64) -> Vec<u32> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut order: Vec<u32> = (0..views).collect();
    let mut schedule = Vec::with_capacity(steps as usize);
    while schedule.len() < steps as usize && views > 0 {
        order.shuffle(&mut rng);
        schedule.extend(order.iter().take(steps as usize - schedule.len()));
    }
    schedule
}

/// Options of the base scene's schedule (3DGS, method section 2): the rate of positions falls log-linearly
/// over the run, and SH bands are added one by one.
#[derive(Debug, Clone, Copy)]
pub struct BaseOptions {
    /// Steps, of one view each.
    pub iterations: u32,
    /// Degree of the harmonics, 0 to 3, or [`BETAS`](color::BETAS).
    pub sh_degree: u32,
    /// Fraction of the schedule to skip: 0, or [`LEARNED`] for Gaussians that are already trained.
    pub begins: f64,
}

/// Fractions of a run until which the photographs are at most half and at most a quarter of their size, if
/// halved ones exist.
pub const HALVED_UNTIL: [f64; 2] = [0.7, 0.3];

/// Number of halvings of the photographs at the fraction `part` of a run, if `most` exist.
pub fn halvings_at(part: f64, most: u32) -> u32 {
    HALVED_UNTIL.iter().take(most as usize).filter(|&&until| part < until).count() as u32
}

/// Fraction of the schedule that trained Gaussians skip.
pub const LEARNED: f64 = 0.5;

impl Default for BaseOptions {
    /// 3DGS's options.
    fn default() -> Self {
        BaseOptions { iterations: 30_000, sh_degree: 3, begins: 0.0 }
    }
}

impl BaseOptions {
    /// Fraction of the schedule at the fraction `part` of the run, both 0 to 1.
    pub fn part_of(&self, part: f64) -> f64 {
        self.begins + (1.0 - self.begins) * part
    }

    /// Fraction of the schedule before step `step`, 0 to 1.
    pub fn part(&self, step: u32) -> f64 {
        self.part_of(f64::from(step) / f64::from(self.iterations.max(1)))
    }

    /// Settings of step `step`; `extent` is the session's.
    pub fn plan(&self, extent: f32, step: u32) -> StepPlan {
        let t = self.part(step);
        let (start, end) = (1.6e-4f64, 1.6e-6f64);
        let mean = (start.ln() * (1.0 - t) + end.ln() * t).exp() as f32 * extent;
        // One more band every 1000 of 30,000 steps; shorter runs scale the interval.
        let interval = (self.iterations / 30).clamp(1, 1000);
        let colors = color::of(self.sh_degree);
        StepPlan {
            rates: Rates {
                mean,
                log_scale: 5e-3,
                quat: 1e-3,
                opacity: 0.025,
                dc: 2.5e-3,
                sh: colors.rate,
                ..Default::default()
            },
            // Trained Gaussians use all bands from the start; only harmonics have bands.
            active_degree: match colors.harmonics {
                Some(degree) if self.begins == 0.0 => degree.min(step / interval),
                _ => self.sh_degree,
            },
        }
    }
}

/// A loop that trains all plain Gaussians of `model` on all of `views`, whose photographs must be uploaded.
/// Their number is fixed.
pub fn base_trainer(session: &Session, model: &Model, views: &Views, options: &BaseOptions) -> Result<Trainer> {
    let fixed = DensityOptions { strategy: Strategy::Fixed, limit: 0, first: 0, iterations: options.iterations };
    dense_trainer(session, model, views, options, &fixed)
}

/// A loop of `options.iterations` steps with density control. `model` needs room for its `limit`. In a [mixed](crate::scene::Scene::mixed) scene
/// the number of Gaussians is fixed, and density control only sets the rates.
///
/// # Errors
/// [`Error::Usage`] if there is less room; otherwise an error of the device.
pub fn dense_trainer(
    session: &Session,
    model: &Model,
    views: &Views,
    options: &BaseOptions,
    density: &DensityOptions,
) -> Result<Trainer> {
    let strategy = density.strategy;
    let Policy { compensate, packed, .. } = session.policy;
    let newton = strategy.is_newton();
    let mixed = model.has(Segment::Banded);
    let segments = [Segment::Base, Segment::Banded].into_iter().take(if mixed { 2 } else { 1 });
    let lesson = |segment| Lesson { compensate, packed, newton, ..Lesson::new(segment) };
    let lessons: Vec<Lesson> = segments.map(lesson).collect();
    let (schedule, plan) = course(session, views, options, density);
    let mut trainer = Trainer::new(session, model, views, &lessons, schedule, 1, plan)?;
    if mixed {
        // The number of a checkpoint.
        trainer.let_counts_vary();
    } else if strategy.kernel().is_some() {
        trainer.work.density = Some(Density::new(session, model, Segment::Base, trainer.raster(), density)?);
        if strategy.follows_errors() {
            trainer.work.renderer.raster.make_scores()?;
        }
        trainer.let_counts_vary();
    }
    Ok(trainer)
}

/// The schedule of views for [`dense_trainer`], small photographs first if there are any, and the settings of
/// each step.
fn course(
    session: &Session,
    views: &Views,
    options: &BaseOptions,
    density: &DensityOptions,
) -> (Vec<u32>, impl Fn(u32) -> StepPlan + Send + 'static + use<>) {
    let mut schedule = permutations(views.photos, options.iterations, session.seed);
    for (step, view) in (0..).zip(&mut schedule) {
        *view += views.photos * halvings_at(options.part(step), views.halvings());
    }
    let (extent, options, density) = (session.extent, *options, *density);
    let plan = move |step| {
        let plan = options.plan(extent, step);
        StepPlan { rates: density.rates(plan.rates, step), ..plan }
    };
    (schedule, plan)
}

/// Runs [`base_trainer`] to the end; calls `progress` with the number of finished steps.
pub fn train_base(
    session: &Session,
    model: &Model,
    views: &Views,
    options: &BaseOptions,
    timed: bool,
    progress: impl FnMut(u32),
) -> Result<TrainReport> {
    base_trainer(session, model, views, options)?.run(model, views, timed, progress)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn photos_grow_twice_as_far_as_there_are_small_ones() {
        let seen = |most: u32| [0.0, 0.29, 0.3, 0.69, 0.7, 1.0].map(|part| halvings_at(part, most));
        assert_eq!([seen(0), seen(1), seen(2)], [[0; 6], [1, 1, 1, 1, 0, 0], [2, 2, 1, 1, 0, 0]]);
    }

    #[test]
    fn every_view_comes_once_before_any_comes_again() {
        let schedule = permutations(7, 24, 5);
        assert_eq!(schedule.len(), 24);
        for pass in schedule.chunks(7) {
            let mut seen = pass.to_vec();
            seen.sort_unstable();
            seen.dedup();
            assert_eq!(seen.len(), pass.len(), "{pass:?}");
        }
        assert_ne!(schedule[..7], schedule[7..14]);
        assert_eq!(schedule, permutations(7, 24, 5));
        assert_ne!(schedule, permutations(7, 24, 6));
        assert!(permutations(0, 5, 1).is_empty());
    }
}
