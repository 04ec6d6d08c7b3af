//! The whole augmentation of a base scene: base losses → 2D stage → inverse splatting, batch by batch → joint optimisation.

use std::{
    ops::Range,
    time::{Duration, Instant},
};

use super::{
    join::{JoinOptions, join},
    lift::{LiftOptions, LiftStage, Lifted},
    model::Model,
    plane::{self, PlaneStage, Refined, Schedule, base_losses, budgets},
    raster::Reduction,
    render::{MEDIAN_THRESHOLD, RenderOptions, Renderer},
    train::TrainReport,
    views::Views,
};
use crate::{
    error::{Error, Result},
    gpu::Context,
    scene::Scene,
    stages::types::Lift,
};

#[derive(Debug, Clone, Copy)]
pub struct EnhanceOptions {
    /// Supplementary Gaussians for each Gaussian of the base, at most.
    pub ratio: f64,
    pub schedule: Schedule,
    pub lift: LiftOptions,
    /// Joint steps for each view.
    pub steps_per_view: u32,
    /// ⚖ Adam's bias correction of the standard parameters in the joint stage; the release has none.
    pub bias_correction: bool,
    /// ⚖ Transmittance at which a pixel has its depth: 0.5, the release 0.7.
    pub median_threshold: f32,
    /// Take the z of the median Gaussian's centre, not of its point of maximum response.
    pub centre_depth: bool,
    pub seed: u32,
    /// 1.1 × the largest camera distance from their mean, scene units.
    pub extent: f32,
    /// sRGB, 0 to 1.
    pub background: [f32; 3],
    pub reduction: Reduction,
}

impl EnhanceOptions {
    /// The paper's settings.
    pub fn paper(extent: f32, background: [f32; 3]) -> Self {
        EnhanceOptions {
            ratio: 0.1,
            schedule: Schedule::PAPER,
            lift: LiftOptions::default(),
            steps_per_view: 30,
            bias_correction: false,
            median_threshold: MEDIAN_THRESHOLD,
            centre_depth: false,
            seed: 0,
            extent,
            background,
            reduction: Reduction::Auto,
        }
    }

    /// The same stages with shorter rounds.
    pub fn quick(extent: f32, background: [f32; 3]) -> Self {
        EnhanceOptions { schedule: Schedule::QUICK, ..Self::paper(extent, background) }
    }
}

/// What is going on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stage {
    /// Rendering the base in every view.
    Base,
    /// Refining a batch of views in image space, of how many.
    Plane {
        batch: usize,
        batches: usize,
        progress: plane::Progress,
    },
    Lift,
    /// Joint steps done, of how many.
    Join {
        step: u32,
        steps: u32,
    },
}

/// A batch whose 2D Gaussians were lifted; the stage still holds them.
pub struct LiftedBatch<'a> {
    pub plane: &'a PlaneStage,
    pub batch: usize,
    pub views: Range<usize>,
    pub refined: &'a Refined,
    pub lifted: &'a Lifted,
}

/// Wall-clock time of each stage.
#[derive(Debug, Clone, Copy, Default)]
pub struct Times {
    pub base: Duration,
    pub plane: Duration,
    pub lift: Duration,
    pub join: Duration,
}

#[derive(Debug)]
pub struct Enhanced {
    pub scene: Scene,
    /// Loss of the base render of each view.
    pub base_losses: Vec<f64>,
    /// 2D Gaussians that each view was allowed.
    pub budgets: Vec<u32>,
    /// 2D Gaussians left after the 2D stage, and those of them that were lifted.
    pub refined: u32,
    pub lifted: u32,
    /// Views whose lifts came from an earlier run.
    pub resumed: usize,
    pub times: Times,
    /// `None` where nothing was added.
    pub join: Option<TrainReport>,
}

/// Augments `scene`, whose supplement must be `None`, from the photographs of `views`.
///
/// `watch` hears of progress. Before a batch of views is refined, `resume` may give what an earlier run lifted from it; `keep`
/// hears of every batch that was lifted now.
///
/// # Errors
/// [`Error::Usage`] for a scene that is empty or augmented already, or for no views; else what the device lacks.
pub fn enhance(
    context: &Context,
    scene: &Scene,
    views: &Views,
    options: &EnhanceOptions,
    mut watch: impl FnMut(&Stage),
    mut resume: impl FnMut(Range<usize>) -> Result<Option<Vec<Lift>>>,
    mut keep: impl FnMut(&LiftedBatch<'_>) -> Result<()>,
) -> Result<Enhanced> {
    if scene.supplement.is_some() {
        return Err(Error::Usage("the scene is augmented already; give its base".into()));
    }
    if scene.base.is_empty() || views.cameras.is_empty() {
        return Err(Error::Usage("there is nothing to augment: no Gaussians, or no training views".into()));
    }
    let unit = if options.extent > 0.0 { options.extent } else { 1.0 };
    let mut times = Times::default();

    watch(&Stage::Base);
    let started = Instant::now();
    let render = RenderOptions {
        depth: true,
        centre_depth: options.centre_depth,
        median_threshold: options.median_threshold,
        ..Default::default()
    };
    let count = scene.base.len() as u32;
    let base = Model::upload_around(context, views.origin, scene, 0)?;
    let mut renderer = Renderer::new(context, count, views, render)?;
    let losses = base_losses(&mut renderer, &base, views, options.background)?;
    let budgets = budgets(&losses, count, options.ratio);
    let total: u32 = budgets.iter().sum();
    drop(base);
    let mut model = Model::upload_around(context, views.origin, scene, total as usize)?;
    times.base = started.elapsed();

    let started = Instant::now();
    let mut stage = PlaneStage::new(context, views, &budgets, options.schedule, options.seed, options.reduction)?;
    let lift = LiftStage::new(context, options.lift)?;
    times.plane += started.elapsed();
    let batches = stage.batches().to_vec();
    let (mut refined_count, mut resumed) = (0, 0);
    // The base alone is what the 2D stage refines: lifted Gaussians of earlier batches are hidden from its renders.
    for (batch, range) in batches.iter().enumerate() {
        if let Some(lifts) = resume(range.clone())? {
            resumed += range.len();
            refined_count += lifts.len() as u32;
            model.append(&lifts)?;
            continue;
        }
        let base = Model { supplement_count: 0, ..model.clone() };
        let started = Instant::now();
        let refined = stage.refine(&mut renderer, &base, views, batch, options.background, |progress| {
            watch(&Stage::Plane { batch, batches: batches.len(), progress: *progress });
        })?;
        refined_count += refined.counts.iter().sum::<u32>();
        times.plane += started.elapsed();

        watch(&Stage::Lift);
        let started = Instant::now();
        let lifted = lift.lift(&stage, range, views, unit, &mut model)?;
        times.lift += started.elapsed();
        keep(&LiftedBatch { plane: &stage, batch, views: range.clone(), refined: &refined, lifted: &lifted })?;
    }
    drop((stage, lift, renderer));

    let started = Instant::now();
    let joined = if model.supplement_count > 0 {
        let join_options = JoinOptions {
            steps_per_view: options.steps_per_view,
            seed: u64::from(options.seed),
            extent: options.extent,
            bias_correction: options.bias_correction,
            reduction: options.reduction,
        };
        let steps = options.steps_per_view * views.cameras.len() as u32;
        Some(join(context, &model, views, options.background, &join_options, true, |step| {
            watch(&Stage::Join { step, steps });
        })?)
    } else {
        None
    };
    times.join = started.elapsed();
    Ok(Enhanced {
        scene: model.download()?,
        base_losses: losses,
        budgets,
        refined: refined_count,
        resumed,
        lifted: model.supplement_count,
        times,
        join: joined,
    })
}
