//! Runs an augmentation with a progress bar for each phase, checkpoints, and an end on request or by time.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use crate::{
    Error, Result,
    cli::{
        Look, caller,
        dataset::note_foreign_base,
        deadline::{Deadline, MOST},
        interrupt::Interrupt,
        kept::Kept,
        print,
        progress::{Progress, learned, note},
    },
    pipelines::{
        checkpoint::Checkpoint,
        enhance::{EnhanceOptions, Enhanced, Enhancer, Event, TRIAL_PASSES, kept_lifts},
        screen::{self, Schedule},
        session::Session,
        views::Views,
    },
    report::spending,
    scene::Scene,
};

/// Surroundings of an augmentation: base file, checkpoint, interrupt and end.
#[derive(Default)]
pub(in crate::cli) struct Beside<'a> {
    /// File of the base.
    pub(in crate::cli) base: Option<&'a Path>,
    /// Checkpoint file, and the checkpoint of an earlier run.
    pub(in crate::cli) kept: Option<(&'a mut Kept, Option<Checkpoint>)>,
    /// Ends the joint phase on request; must live until the result is written.
    pub(in crate::cli) interrupt: Option<&'a Interrupt>,
    /// End of the joint phase.
    pub(in crate::cli) end: Option<Instant>,
    /// Whether the plan is not printed.
    pub(in crate::cli) silent: bool,
}

/// Augments with a progress bar for each phase. `look_at` sees the model at each event.
pub(in crate::cli) fn run_with_progress(
    session: &Session,
    scene: &Scene,
    views: &Views,
    options: &EnhanceOptions,
    beside: Beside<'_>,
    look_at: &mut Look<'_>,
) -> Result<Enhanced> {
    let bar = Some(("", Progress::new("rendering the base", "passes", 1)));
    let enhancer = Enhancer::new(session, scene, views, options)?;
    let share = beside.end.map(|end| end.saturating_duration_since(Instant::now()) / 10);
    let mut augmentation = Augmentation {
        session,
        views,
        options,
        beside,
        enhancer,
        bar,
        told: 0,
        renumbered: 0,
        begun: Instant::now(),
        share,
        pace: None,
        clock: None,
        placements: options.pursuit.placements.max(1),
        placing: Placing::default(),
        rendered_in: Duration::ZERO,
    };
    loop {
        let before = Instant::now();
        match augmentation.enhancer.next(views) {
            Ok(Some(event)) => augmentation.follow(event, before, look_at)?,
            Ok(None) => return augmentation.enhancer.finish(views),
            Err(error) => return Err(augmentation.fail(error)),
        }
    }
}

/// Augmentation in progress.
struct Augmentation<'a> {
    session: &'a Session,
    views: &'a Views,
    options: &'a EnhanceOptions,
    beside: Beside<'a>,
    enhancer: Enhancer,
    /// Label and bar of the current phase.
    bar: Option<(&'static str, Progress)>,
    /// Placements already logged.
    told: usize,
    /// Joint steps taken, less their number in the present plan of a run by time.
    renumbered: i64,
    /// Time at which the base was rendered.
    begun: Instant,
    /// A tenth of the time of a run by time: the most that the search for bands, the trial of longer training, and all placements may
    /// take each.
    share: Option<Duration>,
    /// Pace of the search or the trial, in a run by time.
    pace: Option<Pace>,
    /// Plan of a run by time.
    clock: Option<Deadline>,
    /// Number of placements.
    placements: u32,
    placing: Placing,
    /// Duration of rendering the base in all views, which is repeated at the end; an estimate, as the driver compiled kernels meanwhile.
    rendered_in: Duration,
}

/// Times of placements.
#[derive(Default)]
struct Placing {
    /// Start of the placement in progress, and whether it was cut short.
    since: Option<Instant>,
    hurried: bool,
    /// Duration of the last one.
    last: Duration,
}

/// Pace of a phase.
struct Pace {
    label: &'static str,
    /// Time and step of its first event; before, the driver compiles kernels.
    since: Instant,
    first: u32,
}

impl Augmentation<'_> {
    /// Saves a checkpoint if it can after `error`, and returns the error.
    fn fail(&mut self, error: Error) -> Error {
        match &mut self.beside.kept {
            Some((kept, _)) => kept.keep_after(error, self.enhancer.checkpoint(self.views)),
            None => error,
        }
    }

    /// Shows `done` of `total` steps of a phase, and a text.
    fn show(&mut self, label: &'static str, done: u64, total: u64, said: Option<String>) {
        if self.bar.as_ref().is_none_or(|(shown, _)| *shown != label) {
            // The old bar is removed first.
            self.bar = None;
            let begun = Progress::new(label, "steps", total);
            // A phase may continue after a placement or from an earlier run.
            begun.goes_on_from(done);
            self.bar = Some((label, begun));
        }
        if let Some((_, bar)) = &self.bar {
            bar.set_of(done, total);
            if let Some(said) = said {
                bar.say(said);
            }
        }
    }

    /// Handles an event that took the time since `before`.
    fn follow(&mut self, event: Event, before: Instant, look_at: &mut Look<'_>) -> Result<()> {
        let mut look = |enhancer: &Enhancer, label: &str, done: u64, total: u64| {
            look_at(enhancer.model(), format_args!("{label}, step {done} of {total}"));
        };
        match event {
            // The next event brings its own bar.
            Event::Base => {
                (self.begun, self.rendered_in) = (Instant::now(), before.elapsed());
                self.bar.iter().for_each(|(_, bar)| bar.advance());
                if let Some(base) = self.beside.base {
                    note_foreign_base(base, self.enhancer.base_losses());
                }
            }
            Event::Bands { step, steps } => {
                self.show("finding bands", step.into(), steps.into(), None);
                self.takes_too_long("finding bands", step, steps)?;
            }
            Event::Weigh { step, steps } => {
                self.show("weighing", step.into(), steps.into(), None);
                if let Some(all) = self.takes_too_long("weighing", step, steps)? {
                    self.plan_joining(all / steps);
                }
            }
            Event::Weighed => {
                let steps = TRIAL_PASSES * self.views.cameras.len() as u32;
                // The driver compiled kernels before the first event.
                let pace = self.pace.take().filter(|pace| pace.first < steps);
                let (time, steps) = match pace {
                    Some(Pace { since, first, .. }) => (since.elapsed(), steps - first),
                    None => (self.begun.elapsed(), steps),
                };
                self.plan_joining(time / steps);
            }
            Event::Planned => {
                self.bar = None;
                if let (Some(plan), false) = (self.enhancer.spending(), self.beside.silent) {
                    print(spending::text(plan))?;
                }
            }
            Event::Place(at) => {
                look(&self.enhancer, "placing", at.step.into(), at.steps.into());
                let began = *self.placing.since.get_or_insert(before);
                self.show("placing", at.step.into(), at.steps.into(), None);
                let share = self.share.map(|share| share / self.placements);
                // The last step places what the rounds before have chosen.
                if at.step + 1 < at.steps && !self.placing.hurried && share.is_some_and(|share| began.elapsed() > share)
                {
                    note("placing has taken its share of the time, so its rounds end early");
                    self.placing.hurried = true;
                    self.enhancer.hurry(self.views)?;
                }
            }
            Event::Batch { views: range, .. } => {
                let earlier = self.beside.kept.as_ref().and_then(|(_, earlier)| earlier.as_ref());
                if let Some(lifts) = earlier.and_then(|earlier| kept_lifts(earlier, &range)) {
                    self.enhancer.resume(lifts)?;
                }
            }
            Event::Screen { batch, batches, progress } => {
                let (done, total) = screen_steps(&self.options.schedule, batch, batches, &progress);
                look(&self.enhancer, "refining", done, total);
                let screen::Progress { loss, count, budget, .. } = progress;
                let said = loss.is_finite().then(|| format!("loss {loss:.4}, {count}/{budget} placed"));
                self.show("refining", done, total, said);
            }
            Event::Lifted { .. } => {
                if let Some((kept, _)) = &mut self.beside.kept {
                    kept.keep(self.enhancer.checkpoint(self.views))?;
                }
            }
            Event::Join { step, steps } => {
                look(&self.enhancer, "joining", self.taken(step).into(), self.taken(steps).into());
                self.join(step, steps)?;
            }
        }
        Ok(())
    }

    /// Ends a phase that would take more than its share of a run by time; returns the time that it would have taken.
    fn takes_too_long(&mut self, label: &'static str, step: u32, steps: u32) -> Result<Option<Duration>> {
        let Some(share) = self.share else { return Ok(None) };
        let now = Instant::now();
        let pace = match self.pace.take() {
            Some(pace) if pace.label == label => self.pace.insert(pace),
            _ => self.pace.insert(Pace { label, since: now, first: step }),
        };
        let done = step.saturating_sub(pace.first);
        if done == 0 {
            return Ok(None);
        }
        let all = (now - pace.since).mul_f64(f64::from(steps) / f64::from(done));
        if all <= share {
            return Ok(None);
        }
        note(format!("{label} would take {:.0} s, more than a tenth of the time, and is left out", all.as_secs_f64()));
        self.enhancer.hurry(self.views)?;
        Ok(Some(all))
    }

    /// Estimates the number of joint steps of a run by time, at `each` for a step.
    fn plan_joining(&mut self, each: Duration) {
        let (Some(end), Some(share)) = (self.beside.end, self.share) else { return };
        // Each placement renders all views, and so does the comparison at the end. A render takes a third of a training step on llvmpipe
        // (bench/results/llvmpipe-step-garden224.json); half leaves a margin.
        self.rendered_in = self.rendered_in.min(each * self.views.cameras.len() as u32 / 2);
        if self.rendered_in * self.placements > share {
            self.placements = 1;
            self.enhancer.place_once();
        }
        let others = self.rendered_in * (self.placements + 1);
        let left = end.saturating_duration_since(Instant::now()).saturating_sub(others);
        let steps = left.as_secs_f64() / each.as_secs_f64().max(1e-9);
        self.enhancer.take_steps(steps.min(MOST.into()) as u32);
    }

    /// Joint steps taken by step `number` of the present plan.
    fn taken(&self, number: u32) -> u32 {
        (i64::from(number) + self.renumbered) as u32
    }

    /// Continues the joint phase after `step` of `steps` steps.
    fn join(&mut self, step: u32, steps: u32) -> Result<()> {
        let placements = self.placements;
        for (k, placed) in self.enhancer.placed().iter().enumerate().skip(self.told) {
            let (placement, lobes, plain) = (k + 1, placed.lobes, placed.plain);
            tracing::info!("placement {placement} of {placements}: {lobes} Gaussians with lobes, {plain} plain");
        }
        self.told = self.enhancer.placed().len();
        if let Some(began) = self.placing.since.take() {
            self.placing = Placing { last: began.elapsed(), ..Placing::default() };
            if let Some(deadline) = &mut self.clock {
                deadline.leave_out(self.placing.last);
            }
        }
        let [taken, all] = [step, steps].map(|number| self.taken(number));
        if let Some(end) = self.beside.end
            && self.plan_until(end, [step, taken], [steps, all])?
        {
            return Ok(());
        }
        let lately = self.enhancer.lately(step, self.views);
        self.show("joining", taken.into(), all.into(), Some(learned(lately, None, &self.session.context)));
        let (gaussians, seconds) = (self.enhancer.model().count(), self.begun.elapsed().as_secs_f64());
        caller::step(caller::Step { step: taken, steps: all, lately, gaussians, seconds });
        let Beside { kept, interrupt, .. } = &mut self.beside;
        if let (0, Some(earlier)) = (step, kept.as_mut().and_then(|(_, earlier)| earlier.take())) {
            self.enhancer.resume_join(&earlier)?;
        }
        if let Some(interrupt) = interrupt {
            interrupt.listen()?;
        }
        let asked = interrupt.is_some_and(Interrupt::asked);
        if let Some((kept, _)) = kept
            // The last state is checkpointed until the scene is written.
            && (asked || step == steps || kept.is_due())
        {
            kept.keep(self.enhancer.checkpoint(self.views))?;
        }
        if asked { self.enhancer.stop(self.views) } else { Ok(()) }
    }

    /// Replans a joint phase that has until `end`. Of the steps and of all steps come the numbers in the present plan, then those taken.
    /// Returns whether it is over.
    fn plan_until(&mut self, end: Instant, [step, taken]: [u32; 2], [steps, all]: [u32; 2]) -> Result<bool> {
        let now = Instant::now();
        let deadline = self.clock.get_or_insert_with(|| Deadline::of(now, end, steps, step));
        if deadline.is_over(now) && step < steps {
            note(format!("the time ended after {taken} of {all} joint steps"));
            self.enhancer.stop(self.views)?;
            return Ok(true);
        }
        if deadline.is_due(step, now) {
            // The next placements are estimated to take as long as the last one.
            let more = self.placements.saturating_sub(self.told as u32);
            let reserved = self.placing.last * more + self.rendered_in;
            self.enhancer.replan(self.views, |step| {
                let plan = deadline.plan(step, Instant::now(), reserved);
                self.renumbered += i64::from(step) - i64::from(plan.done);
                [plan.total, plan.done]
            })?;
        }
        Ok(false)
    }
}

/// Steps done in the screen phase, and steps in all. The number of rounds in a batch is an estimate: each
/// round is assumed to place as many Gaussians as those before, until the budget is full.
fn screen_steps(schedule: &Schedule, batch: usize, batches: usize, at: &screen::Progress) -> (u64, u64) {
    let Schedule { round_steps, final_steps, max_rounds, .. } = *schedule;
    let rounds = if at.last {
        at.round
    } else if at.round == 0 {
        // Each round draws a fifth of the budget.
        5.min(max_rounds)
    } else {
        let needed = (u64::from(at.round) * u64::from(at.budget)).div_ceil(u64::from(at.count.max(1)));
        u32::try_from(needed).unwrap_or(u32::MAX).clamp(at.round, max_rounds.max(at.round))
    };
    let whole_rounds = if at.last { at.round } else { at.round.saturating_sub(1) };
    let done = u64::from(whole_rounds) * u64::from(round_steps) + u64::from(at.step);
    let all = u64::from(rounds) * u64::from(round_steps) + u64::from(final_steps);
    (batch as u64 * all + done, batches as u64 * all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steps_to_come_are_those_of_the_rounds_that_fill_the_budget() {
        let schedule = Schedule { round_steps: 200, final_steps: 1000, max_rounds: 20, shared_steps: false };
        let at = |round, step, steps, count| {
            let last = steps == schedule.final_steps;
            let progress = screen::Progress { round, step, steps, last, count, budget: 100, loss: 0.5 };
            screen_steps(&schedule, 0, 1, &progress)
        };
        // One round places a fifth: five rounds.
        assert_eq!(at(1, 50, 200, 20), (50, 2000));
        assert_eq!(at(3, 50, 200, 60), (450, 2000));
        // Half of each draw is pruned: ten rounds.
        assert_eq!(at(3, 0, 200, 30), (400, 3000));
        // At most the allowed number of rounds, at least those already done.
        assert_eq!(at(2, 0, 200, 0), (200, 5000));
        assert_eq!(at(7, 100, 200, 100), (1300, 2400));
        // Before the first round.
        assert_eq!(at(0, 0, 200, 0), (0, 2000));
        // The final steps.
        assert_eq!(at(7, 100, 1000, 100), (1500, 2400));
        assert_eq!(at(7, 1000, 1000, 100), (2400, 2400));
        let progress =
            screen::Progress { round: 1, step: 50, steps: 200, last: false, count: 20, budget: 100, loss: 0.5 };
        assert_eq!(screen_steps(&schedule, 2, 3, &progress), (4050, 6000));
    }
}
