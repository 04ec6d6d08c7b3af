//! The joint phase (method, section 5): the supplementary Gaussians learn all parameters, the base only its
//! opacities.

use super::{
    learn::{Lesson, Rates},
    model::{Model, Segment},
    session::{Policy, Session},
    train::{StepPlan, Trainer, permutations},
    views::Views,
};
use crate::error::Result;

/// Options of the joint phase.
#[derive(Debug, Clone, Copy)]
pub struct JoinOptions {
    /// Steps per view; the method has 30.
    pub steps_per_view: u32,
    /// Adam's bias correction for the standard parameters and the base's opacities. The authors' release has
    /// none; lobes always have it.
    pub bias_correction: bool,
    /// The base learns everything too, not only its opacities.
    pub everything: bool,
    /// Initial rates, as a multiple of the method's.
    pub pace: f32,
    /// Final rates, as a fraction of the initial ones.
    pub decay: f32,
    /// Initial fraction of the way to the minimum that a Newton step goes, see [`Rates::newton`]; 0 for
    /// Adam's steps. Without `everything`, steps are always Adam's.
    pub newton: f32,
    /// Multipliers on the rates of lobes' directions, widths and sharpnesses; 0 keeps the values from
    /// placement.
    pub lobe_rates: [f32; 3],
}

impl Default for JoinOptions {
    /// The paper's options.
    fn default() -> Self {
        JoinOptions {
            steps_per_view: 30,
            bias_correction: false,
            everything: false,
            pace: 1.0,
            decay: 1.0,
            newton: 0.0,
            lobe_rates: [1.0; 3],
        }
    }
}

impl JoinOptions {
    /// Rates at the fraction `done` of the run; `extent` is the session's.
    pub fn rates(&self, extent: f32, done: f32) -> Rates {
        let [direction, width, sharpness] = self.lobe_rates;
        let rates = Rates {
            mean: 1.6e-5 * extent,
            log_scale: 0.002,
            quat: 5e-4,
            opacity: 0.02,
            dc: 1e-3,
            sh: 1e-3 / 20.0,
            direction: 1e-3 * direction,
            width: 2e-4 * width,
            sharpness: 2e-3 * sharpness,
            ..Default::default()
        };
        let left = self.decay.powf(done);
        Rates { newton: self.newton * left, ..rates.times(self.pace * left) }
    }

    /// Lessons of the segments of `model`.
    pub fn lessons(&self, session: &Session, model: &Model) -> Vec<Lesson> {
        let bias_correction = self.bias_correction;
        let Policy { compensate, packed, .. } = session.policy;
        let newton = self.newton > 0.0 && self.everything;
        let lesson = |segment: Segment| Lesson {
            opacity_only: !segment.has_lobes() && !self.everything,
            sparse: !segment.has_lobes(),
            bias_correction,
            compensate,
            packed,
            newton,
            ..Lesson::new(segment)
        };
        let segments = Segment::ALL.into_iter().filter(|&segment| segment != Segment::Banded || model.has(segment));
        segments.map(lesson).collect()
    }
}

/// The joint phase on all of `views`, ready to run.
pub fn join(session: &Session, model: &Model, views: &Views, options: &JoinOptions) -> Result<Trainer> {
    join_for(session, model, views, options, options.steps_per_view * views.cameras.len() as u32)
}

/// [`join`] with a total of `steps` steps.
pub fn join_for(session: &Session, model: &Model, views: &Views, options: &JoinOptions, steps: u32) -> Result<Trainer> {
    let (schedule, plan) = course(session, model, views, options, steps);
    Trainer::new(session, model, views, &options.lessons(session, model), schedule, 1, plan)
}

/// The schedule of views for a joint phase of `steps` steps, and the plan of each step.
pub(super) fn course(
    session: &Session,
    model: &Model,
    views: &Views,
    options: &JoinOptions,
    steps: u32,
) -> (Vec<u32>, impl Fn(u32) -> StepPlan + Send + 'static + use<>) {
    let schedule = permutations(views.cameras.len() as u32, steps, session.seed);
    let (options, extent, active_degree) = (*options, session.extent, model.sh_degree);
    let plan = move |step| {
        let done = step as f32 / steps.max(1) as f32;
        StepPlan { rates: options.rates(extent, done), active_degree }
    };
    (schedule, plan)
}
