//! The joint phase (method, section 5): the supplementary Gaussians learn everything, the base only its opacities.

use super::{
    learn::{Lesson, Rates},
    model::{Model, Segment},
    session::Session,
    train::{StepPlan, Trainer, permutations},
    views::Views,
};
use crate::error::Result;

#[derive(Debug, Clone, Copy)]
pub struct JoinOptions {
    /// Steps for each view; the method has 30.
    pub steps_per_view: u32,
    /// Adam's bias correction of the standard parameters and the base's opacities. The authors' release has none; lobes
    /// always have it.
    pub bias_correction: bool,
}

impl JoinOptions {
    /// Constant over the run; `extent` is the session's.
    pub fn rates(&self, extent: f32) -> Rates {
        Rates {
            mean: 1.6e-5 * extent,
            log_scale: 0.002,
            quat: 5e-4,
            opacity: 0.02,
            dc: 1e-3,
            sh: 1e-3 / 20.0,
            direction: 1e-3,
            width: 2e-4,
            sharpness: 2e-3,
            ..Default::default()
        }
    }

    /// What base and supplement learn.
    pub fn lessons(&self, session: &Session) -> [Lesson; 2] {
        let (bias_correction, compensate) = (self.bias_correction, session.policy.compensate);
        [
            Lesson { segment: Segment::Base, opacity_only: true, sparse: true, bias_correction, compensate },
            Lesson { segment: Segment::Supplement, opacity_only: false, sparse: false, bias_correction, compensate },
        ]
    }
}

/// The joint phase on all of `views`, ready to run.
pub fn join(session: &Session, model: &Model, views: &Views, options: &JoinOptions) -> Result<Trainer> {
    let count = views.cameras.len() as u32;
    let schedule = permutations(count, options.steps_per_view * count, session.seed);
    let plan = StepPlan { rates: options.rates(session.extent), active_degree: model.sh_degree };
    Trainer::new(session, model, views, &options.lessons(session), schedule, 1, move |_| plan)
}
