//! Trains Gaussians on photographs: render → loss → backward → Adam, one view a step, all on the device.
//!
//! [`Trainer`] is the loop of both the base scene (method, section 2; Gaussians fixed in number) and the joint stage
//! (section 5, `join`): they differ in which Gaussians learn what, and how fast.

use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::{
    loss::Photometric,
    model::{GEOMETRY_PLANES, LOBE_PLANES, Model},
    raster::{Reduction, WORKGROUP},
    render::{RenderOptions, Renderer},
    steps::{StepReport, Steps},
    views::Views,
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Context, GpuError, Recorder},
    stages::{
        project_backward::{self, ProjectBackward},
        ssim_forward::tiles_per_frame,
        step_done::{self, StepDone},
    },
};

/// Steps recorded into one command buffer: enough that submitting costs nothing, few enough that progress is seen and a
/// replay after growth is short.
const BATCH: u32 = 16;

/// Learning rates by parameter, per step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Rates {
    /// Scene units.
    pub mean: f32,
    pub log_scale: f32,
    pub quat: f32,
    pub opacity: f32,
    /// Constant SH band.
    pub dc: f32,
    /// Other SH bands.
    pub sh: f32,
    pub direction: f32,
    pub width: f32,
    pub sharpness: f32,
}

/// What a range of Gaussians learns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    pub first: u32,
    pub count: u32,
    /// Supplementary Gaussians, which have lobes.
    pub lobes: bool,
    /// All but the opacity is frozen.
    pub opacity_only: bool,
    /// Leave alone what a step's view does not blend (SparseAdam).
    pub sparse: bool,
    /// Adam's bias correction of all but the lobes, which always have it.
    pub bias_correction: bool,
}

/// What a step is made of besides its view.
#[derive(Debug, Clone, Copy)]
pub struct StepPlan {
    pub rates: Rates,
    /// SH bands in use.
    pub active_degree: u32,
}

/// A part with its pipeline and Adam's moments.
struct Learner {
    part: Part,
    stage: ProjectBackward,
    geometry_moments: Buffer<f32>,
    sh_moments: Buffer<f32>,
    lobe_moments: Buffer<f32>,
}

impl Learner {
    fn new(context: &Context, model: &Model, part: Part) -> Result<Self, GpuError> {
        let spec = project_backward::Spec {
            workgroup_size: WORKGROUP,
            compensate: false,
            lobes: part.lobes,
            opacity_only: part.opacity_only,
            sparse: part.sparse,
            gradients: false,
        };
        // Frozen planes have no moments.
        let (geometry, sh, lobes) = match (part.opacity_only, part.lobes) {
            (true, _) => (1, 0, 0),
            (false, false) => (GEOMETRY_PLANES, 3 * model.coefficients() as usize, 0),
            (false, true) => (GEOMETRY_PLANES, 3 * model.coefficients() as usize, LOBE_PLANES),
        };
        let moments = |name: &str, planes: usize| Buffer::zeroed(context, name, 2 * planes * part.count as usize);
        Ok(Learner {
            part,
            stage: ProjectBackward::new(context, &spec)?,
            geometry_moments: moments("geometry moments", geometry)?,
            sh_moments: moments("sh moments", sh)?,
            lobe_moments: moments("lobe moments", lobes)?,
        })
    }
}

/// Everything that a training loop needs, made once.
pub struct Trainer {
    renderer: Renderer,
    loss: Photometric,
    learners: Vec<Learner>,
    done: StepDone,
    steps: Steps,
    background: [f32; 3],
}

/// What a training loop did.
#[derive(Debug)]
pub struct TrainReport {
    pub steps: StepReport,
    /// Loss of every step's view before the step.
    pub losses: Vec<f32>,
}

impl Trainer {
    /// For up to `max_steps` steps on `model` in `views`, whose photographs are the targets.
    pub fn new(
        context: &Context,
        model: &Model,
        views: &Views,
        parts: &[Part],
        background: [f32; 3],
        max_steps: u32,
        reduction: Reduction,
    ) -> Result<Self, GpuError> {
        let frames: Vec<_> = views.frames.download()?;
        let render = RenderOptions { backward: true, reduction, ..Default::default() };
        Ok(Trainer {
            renderer: Renderer::new(context, model.count(), views, render)?,
            loss: Photometric::new(context, 1, tiles_per_frame(&frames), max_steps as usize)?,
            learners: parts.iter().map(|&p| Learner::new(context, model, p)).collect::<Result<_, _>>()?,
            done: StepDone::new(context, &step_done::Spec { workgroup_size: 1 })?,
            steps: Steps::new(context, BATCH)?,
            background,
        })
    }

    /// Step t renders view `schedule[t]` and moves what its [`StepPlan`] says. `progress` hears the number of finished steps.
    ///
    /// # Errors
    /// [`Error::Usage`] where the schedule names a view that is not there or is longer than the trainer was made for, or where model
    /// and views have different origins.
    pub fn run(
        &mut self,
        model: &Model,
        views: &Views,
        schedule: &[u32],
        plan: impl Fn(u32) -> StepPlan,
        timed: bool,
        progress: impl FnMut(u32),
    ) -> Result<TrainReport> {
        if schedule.len() > self.loss.losses.len() || schedule.iter().any(|&v| v as usize >= views.cameras.len()) {
            return Err(Error::Usage("the schedule does not fit the trainer".into()));
        }
        model.check_origin(views)?;
        let Trainer { renderer, loss, learners, done, steps, background } = self;
        let renderer = std::cell::RefCell::new(renderer);
        // Gaussians below the first that learns more than its opacity need no other gradient.
        let frozen = learners.iter().filter(|l| l.part.opacity_only).map(|l| l.part.first + l.part.count).max();
        let report = steps.run(
            schedule.len() as u32,
            timed,
            |recorder, step| {
                let view = schedule[step as usize];
                let StepPlan { rates, active_degree } = plan(step);
                let renderer = renderer.borrow();
                let grid = renderer.record(recorder, model, views, view, active_degree, *background, &steps.status);
                loss.record(recorder, &renderer.raster, &views.frames, &views.targets, (view, 1), step);
                renderer.raster.record_blend_backward(recorder, &grid, &views.frames, frozen.unwrap_or(0));
                for learner in learners.iter() {
                    record_learner(
                        recorder,
                        learner,
                        model,
                        views,
                        &renderer,
                        view,
                        step,
                        &rates,
                        active_degree,
                        &steps.status,
                    );
                }
                done.record(recorder, &step_done::Buffers { status: &steps.status });
            },
            |needed| renderer.borrow_mut().raster.grow(needed),
            progress,
        )?;
        let losses = self.loss.losses.mapped().iter().take(schedule.len()).map(|l| l.total).collect();
        Ok(TrainReport { steps: report, losses })
    }
}

#[expect(clippy::too_many_arguments, reason = "private: what one step knows")]
fn record_learner(
    recorder: &mut Recorder,
    learner: &Learner,
    model: &Model,
    views: &Views,
    renderer: &Renderer,
    view: u32,
    step: u32,
    rates: &Rates,
    active_degree: u32,
    status: &Buffer<u32>,
) {
    let Part { first, count, bias_correction, .. } = learner.part;
    if count == 0 {
        return;
    }
    let correction = |beta: f64| (1.0 / (1.0 - beta.powi(step as i32 + 1))) as f32;
    let (lobe_first_correction, lobe_second_correction) = (correction(0.9), correction(0.999));
    let (first_correction, second_correction) =
        if bias_correction { (lobe_first_correction, lobe_second_correction) } else { (1.0, 1.0) };
    let raster = &renderer.raster;
    learner.stage.record(
        recorder,
        &project_backward::Buffers {
            views: &views.views,
            status,
            tile_counts: &raster.tile_counts,
            first_slot: &raster.first_slot,
            records: &raster.records,
            geometry: &model.geometry,
            sh: &model.sh,
            lobes: &model.lobes,
            geometry_moments: &learner.geometry_moments,
            sh_moments: &learner.sh_moments,
            lobe_moments: &learner.lobe_moments,
        },
        &project_backward::Push {
            first,
            count,
            stride: model.stride,
            moment_stride: count,
            lobe_stride: model.lobe_stride,
            view,
            active_degree: active_degree.min(model.sh_degree),
            stored_coefficients: model.coefficients(),
            rate_mean: rates.mean,
            rate_log_scale: rates.log_scale,
            rate_quat: rates.quat,
            rate_opacity: rates.opacity,
            rate_dc: rates.dc,
            rate_sh: rates.sh,
            rate_direction: rates.direction,
            rate_width: rates.width,
            rate_sharpness: rates.sharpness,
            first_correction,
            second_correction,
            lobe_first_correction,
            lobe_second_correction,
            by_gaussian: raster.by_gaussian().into(),
        },
    );
}

/// `steps` views in random permutations of 0..`views`: every view once before any comes again.
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

/// The base scene's schedule (3DGS, method section 2): position rate falling log-linearly over the run, SH bands one by one.
#[derive(Debug, Clone, Copy)]
pub struct BaseOptions {
    pub iterations: u32,
    pub sh_degree: u32,
    pub seed: u64,
    /// 1.1 × the largest camera distance from their mean, scene units: what position rates are relative to.
    pub extent: f32,
    pub reduction: Reduction,
}

impl BaseOptions {
    /// What step `step` does.
    pub fn plan(&self, step: u32) -> StepPlan {
        let t = f64::from(step) / f64::from(self.iterations.max(1));
        let (start, end) = (1.6e-4f64, 1.6e-6f64);
        let mean = (start.ln() * (1.0 - t) + end.ln() * t).exp() as f32 * self.extent;
        // One band more each 1000 of 30,000 steps; shorter runs keep the proportion.
        let interval = (self.iterations / 30).clamp(1, 1000);
        StepPlan {
            rates: Rates {
                mean,
                log_scale: 5e-3,
                quat: 1e-3,
                opacity: 0.025,
                dc: 2.5e-3,
                sh: 2.5e-3 / 20.0,
                ..Default::default()
            },
            active_degree: (step / interval).min(self.sh_degree),
        }
    }
}

/// Trains all plain Gaussians of `model` on the views `0..` of `views` that have photographs.
pub fn train_base(
    context: &Context,
    model: &Model,
    views: &Views,
    background: [f32; 3],
    options: &BaseOptions,
    timed: bool,
    progress: impl FnMut(u32),
) -> Result<TrainReport> {
    let part = Part {
        first: 0,
        count: model.base_count,
        lobes: false,
        opacity_only: false,
        sparse: false,
        bias_correction: true,
    };
    let mut trainer = Trainer::new(context, model, views, &[part], background, options.iterations, options.reduction)?;
    let schedule = permutations(views.cameras.len() as u32, options.iterations, options.seed);
    trainer.run(model, views, &schedule, |step| options.plan(step), timed, progress)
}
