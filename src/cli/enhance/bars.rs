//! The loop of an augmentation: a bar for each phase, what is kept of it and when it ends.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use crate::{
    Result,
    cli::{
        Look,
        dataset::note_foreign_base,
        deadline::{Deadline, MOST},
        interrupt::Interrupt,
        kept::Kept,
        print,
        progress::{Progress, learned, note},
    },
    pipelines::{
        checkpoint::Checkpoint,
        enhance::{EnhanceOptions, Enhanced, Enhancer, Event, kept_lifts},
        screen::{self, Schedule},
        session::Session,
        views::Views,
    },
    report::spending,
    scene::Scene,
};

/// What an augmentation has to do with while it goes on.
#[derive(Default)]
pub(in crate::cli) struct Beside<'a> {
    /// The base's file.
    pub(in crate::cli) base: Option<&'a Path>,
    /// Keeps what it can, and what an earlier run kept.
    pub(in crate::cli) kept: Option<(&'a mut Kept, Option<Checkpoint>)>,
    /// Ends the joint phase when it is asked to; must live until the result is written.
    pub(in crate::cli) interrupt: Option<&'a Interrupt>,
    /// When the joint phase is to end.
    pub(in crate::cli) end: Option<Instant>,
    /// The plan is not printed.
    pub(in crate::cli) silent: bool,
}

/// Augments with a bar for each phase. `look_at` sees the model at each event.
pub(in crate::cli) fn run_with_progress(
    session: &Session,
    scene: &Scene,
    views: &Views,
    options: &EnhanceOptions,
    beside: Beside,
    look_at: &mut Look<'_>,
) -> Result<Enhanced> {
    let Beside { base, kept, interrupt, end, silent } = beside;
    let (mut kept, mut found) = kept.map_or((None, None), |(kept, found)| (Some(kept), found));
    let mut bar = Some(("", Progress::new("rendering the base", "passes", 1)));
    let mut show = |label: &'static str, done: u64, total: u64, said: Option<String>| {
        if total == 0 {
            bar = None;
            return;
        }
        if bar.as_ref().is_none_or(|(shown, _)| *shown != label) {
            // The old one goes first.
            bar = None;
            let begun = Progress::new(label, "steps", total);
            // A phase may go on where a placement or an earlier run left it.
            begun.goes_on_from(done);
            bar = Some((label, begun));
        }
        if let Some((_, bar)) = &bar {
            bar.set_of(done, total);
            if let Some(said) = said {
                bar.say(said);
            }
        }
    };
    let mut enhancer = Enhancer::new(session, scene, views, options)?;
    let (mut told, mut begun) = (0, Instant::now());
    let mut clock: Option<Deadline> = None;
    // When the placement that is being made began, and how long the last one took.
    let (mut placing, mut placed_in) = (None, Duration::ZERO);
    loop {
        let before = Instant::now();
        let event = match (enhancer.next(views), &mut kept) {
            (Ok(Some(event)), _) => event,
            (Ok(None), _) => break,
            (Err(error), Some(kept)) => return Err(kept.keep_after(error, || enhancer.checkpoint(views))),
            (Err(error), None) => return Err(error),
        };
        let told_of = match &event {
            Event::Place(at) => Some(("placing", at.step.into(), at.steps.into())),
            Event::Screen { batch, batches, progress } => {
                let (done, total) = screen_steps(&options.schedule, *batch, *batches, progress);
                Some(("refining", done, total))
            }
            Event::Join { step, steps } => Some(("joining", u64::from(*step), u64::from(*steps))),
            _ => None,
        };
        if let Some((label, done, total)) = told_of {
            look_at(enhancer.model(), format_args!("{label}, step {done} of {total}"));
        }
        match event {
            // The next event brings a bar of its own.
            Event::Base => {
                begun = Instant::now();
                if let Some(base) = base {
                    note_foreign_base(base, enhancer.base_losses());
                }
            }
            Event::Weigh { step, steps } => show("weighing", step.into(), steps.into(), None),
            Event::Weighed => {
                if let Some(end) = end {
                    let (passed, left) = (begun.elapsed(), end.saturating_duration_since(Instant::now()));
                    // A pass took that long; all placements together are thought to take two, until one has been made.
                    let passes = left.as_secs_f64() / passed.as_secs_f64().max(1e-9) - 2.0;
                    enhancer.take_steps((passes * views.cameras.len() as f64).min(MOST.into()) as u32);
                }
            }
            Event::Planned => {
                show("", 0, 0, None);
                if let (Some(plan), false) = (enhancer.spending(), silent) {
                    print(spending::text(plan))?;
                }
            }
            Event::Place(at) => {
                placing.get_or_insert(before);
                show("placing", at.step.into(), at.steps.into(), None);
            }
            Event::Batch { views: range, .. } => {
                if let Some(lifts) = found.as_ref().and_then(|found| kept_lifts(found, &range)) {
                    enhancer.resume(lifts)?;
                }
            }
            Event::Screen { batch, batches, progress } => {
                let (done, total) = screen_steps(&options.schedule, batch, batches, &progress);
                let screen::Progress { loss, count, budget, .. } = progress;
                let said = loss.is_finite().then(|| format!("loss {loss:.4}, {count}/{budget} placed"));
                show("refining", done, total, said);
            }
            Event::Lifted { .. } => {
                if let Some(kept) = &mut kept {
                    kept.keep(|| enhancer.checkpoint(views))?;
                }
            }
            Event::Join { step, steps } => {
                for (k, placed) in enhancer.placed().iter().enumerate().skip(told) {
                    let (placement, placements) = (k + 1, options.pursuit.placements.max(1));
                    tracing::info!(
                        "placement {placement} of {placements}: {} Gaussians with lobes, {} plain",
                        placed.lobes,
                        placed.plain
                    );
                }
                told = enhancer.placed().len();
                if let Some(began) = placing.take() {
                    placed_in = began.elapsed();
                    if let Some(deadline) = &mut clock {
                        deadline.leave_out(placed_in);
                    }
                }
                if let Some(end) = end {
                    let now = Instant::now();
                    let deadline = clock.get_or_insert_with(|| Deadline::of(now, end, steps, step));
                    if deadline.is_over(now) && step < steps {
                        note(format!("the time was over after {step} of {steps} joint steps"));
                        enhancer.stop(views)?;
                        continue;
                    }
                    if deadline.is_due(step, now) {
                        enhancer.replan(views, |step| {
                            // Those that are to come take as long as the last one did.
                            let more = options.pursuit.placements.saturating_sub(told as u32);
                            let plan = deadline.plan(step, Instant::now(), placed_in * more);
                            [plan.total, plan.done]
                        })?;
                    }
                }
                let lately = enhancer.lately(step, views);
                show("joining", step.into(), steps.into(), Some(learned(lately, None, &session.context)));
                if let (0, Some(found)) = (step, found.take()) {
                    enhancer.resume_join(&found)?;
                }
                if let Some(interrupt) = interrupt {
                    interrupt.listen()?;
                }
                let asked = interrupt.is_some_and(Interrupt::asked);
                if let Some(kept) = &mut kept {
                    // What is learned last is kept until it is written.
                    if asked || step == steps {
                        kept.keep(|| enhancer.checkpoint(views))?;
                    } else {
                        kept.look(|| enhancer.checkpoint(views))?;
                    }
                }
                if asked {
                    enhancer.stop(views)?;
                }
            }
        }
    }
    enhancer.finish(views)
}

/// Steps of the screen phase that are done, and all that there will be. How many rounds a batch takes is not known: if those to
/// come place as many Gaussians each as those before, they fill the budget after so many.
fn screen_steps(schedule: &Schedule, batch: usize, batches: usize, at: &screen::Progress) -> (u64, u64) {
    let Schedule { round_steps, final_steps, max_rounds, .. } = *schedule;
    let rounds = if at.last {
        at.round
    } else if at.round == 0 {
        // A draw is a fifth of the budget.
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
        // A fifth placed in one round: five rounds.
        assert_eq!(at(1, 50, 200, 20), (50, 2000));
        assert_eq!(at(3, 50, 200, 60), (450, 2000));
        // Half of each draw is pruned: ten.
        assert_eq!(at(3, 0, 200, 30), (400, 3000));
        // As many as there may be, and no fewer than there were.
        assert_eq!(at(2, 0, 200, 0), (200, 5000));
        assert_eq!(at(7, 100, 200, 100), (1300, 2400));
        // Before the first.
        assert_eq!(at(0, 0, 200, 0), (0, 2000));
        // The last steps.
        assert_eq!(at(7, 100, 1000, 100), (1500, 2400));
        assert_eq!(at(7, 1000, 1000, 100), (2400, 2400));
        let progress =
            screen::Progress { round: 1, step: 50, steps: 200, last: false, count: 20, budget: 100, loss: 0.5 };
        assert_eq!(screen_steps(&schedule, 2, 3, &progress), (4050, 6000));
    }
}
