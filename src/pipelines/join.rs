//! Joint optimisation (method, section 5): the supplementary Gaussians learn everything, the base only its opacities.

use super::{
    model::Model,
    raster::Reduction,
    train::{Part, Rates, StepPlan, TrainReport, Trainer, permutations},
    views::Views,
};
use crate::{error::Result, gpu::Context};

#[derive(Debug, Clone, Copy)]
pub struct JoinOptions {
    /// Steps for each view; the method has 30.
    pub steps_per_view: u32,
    pub seed: u64,
    /// 1.1 × the largest camera distance from their mean, scene units.
    pub extent: f32,
    /// Adam's bias correction of the standard parameters and the base's opacities. The authors' release has none; lobes
    /// always have it.
    pub bias_correction: bool,
    pub reduction: Reduction,
}

impl JoinOptions {
    /// Constant over the run.
    pub fn rates(&self) -> Rates {
        Rates {
            mean: 1.6e-5 * self.extent,
            log_scale: 0.002,
            quat: 5e-4,
            opacity: 0.02,
            dc: 1e-3,
            sh: 1e-3 / 20.0,
            direction: 1e-3,
            width: 2e-4,
            sharpness: 2e-3,
        }
    }
}

/// Runs the joint stage on all of `views`.
pub fn join(
    context: &Context,
    model: &Model,
    views: &Views,
    background: [f32; 3],
    options: &JoinOptions,
    timed: bool,
    progress: impl FnMut(u32),
) -> Result<TrainReport> {
    let bias_correction = options.bias_correction;
    let base =
        Part { first: 0, count: model.base_count, lobes: false, opacity_only: true, sparse: true, bias_correction };
    let supplement = Part {
        first: model.base_count,
        count: model.supplement_count,
        lobes: true,
        opacity_only: false,
        sparse: false,
        bias_correction,
    };
    let count = views.cameras.len() as u32;
    let steps = options.steps_per_view * count;
    let mut trainer = Trainer::new(context, model, views, &[base, supplement], background, steps, options.reduction)?;
    let schedule = permutations(count, steps, options.seed);
    let plan = StepPlan { rates: options.rates(), active_degree: model.sh_degree };
    trainer.run(model, views, &schedule, |_| plan, timed, progress)
}
