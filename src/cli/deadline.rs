//! Plans a run that ends at a given time: derives the number of steps from their measured duration.
//!
//! All schedules are fractions of a run. If steps turn out slower or faster than planned, the run continues
//! with another number of steps, of which the same fraction is done. The run is replanned several times, at
//! fixed shares of the time. The caller supplies how the cost of a step changes, because steps on smaller
//! photos and fewer Gaussians come first.
//!
//! No step begins after the end. A run therefore overruns by the step in progress, plus any steps submitted
//! before their duration was known.

use std::time::{Duration, Instant};

/// Number of steps assumed before the first plan; few steps run under this guess.
pub(super) const FIRST: u32 = 100_000;
/// Maximum number of steps before the guess is replaced; enough for a mean.
const PILOT: u32 = 64;
/// Shares of the time after which the run is replanned. The guess is replaced after the second one at the
/// latest. After the last one, an error remains: the change of rate in the rest of the run.
const MARKS: [f64; 16] = [0.005, 0.02, 0.04, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.88, 0.94, 0.98];
/// Fewer steps than this are too few for a reliable mean.
const FEW: u32 = 4;
/// Maximum number of steps. Every device can bind their losses, 16 bytes each, at once.
pub(super) const MOST: u32 = 8_000_000;

/// Samples of a mean; its error is 1/100 of the jumps in the cost.
const SAMPLES: u32 = 100;

/// End of a run, and its plan until then. Callers pass the current time, so that tests can use their own
/// clock.
pub(super) struct Deadline {
    begin: Instant,
    end: Instant,
    /// Number of steps of the current plan.
    pub(super) total: u32,
    /// Time of the last plan, moved later by pauses that were not steps, and the step at that time.
    since: Instant,
    step: u32,
    /// Whether `total` is still a guess.
    guessed: bool,
    /// Whether the first steps are done. They are not measured, because the driver compiles kernels during
    /// them.
    warm: bool,
    /// Duration of a step of cost 1 when the last plan was made, seconds.
    unit: Option<f64>,
    /// Relative duration of a step, by the fraction of the run that is done.
    cost: Box<dyn Fn(f64) -> f64>,
}

/// New number of steps for the same run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plan {
    /// Steps in all.
    pub(super) total: u32,
    /// Steps that count as done.
    pub(super) done: u32,
}

/// Plan after `step` of `total` steps if `fit` more fit into the time: these become the unfinished fraction
/// of the run. At least one step follows, so that the run reaches its end, unless it already has.
fn plan(step: u32, total: u32, fit: f64) -> Plan {
    let total = total.max(1);
    if step >= total && fit < 1.0 {
        return Plan { total, done: total };
    }
    // A run that reached its end too early continues as if it lacked one step.
    let left = f64::from(total - step.min(total - 1)) / f64::from(total);
    let most = f64::from(MOST);
    let to_come = fit.clamp(1.0, (left * most).max(1.0)).round();
    let all = (to_come / left).round().min(most);
    Plan { total: all as u32, done: (all - to_come).max(0.0) as u32 }
}

/// Mean of `cost` between two fractions of a run.
pub(super) fn mean(cost: &dyn Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    (0..SAMPLES).map(|i| cost(from + (to - from) * (f64::from(i) + 0.5) / f64::from(SAMPLES))).sum::<f64>()
        / f64::from(SAMPLES)
}

impl Deadline {
    /// Deadline of a run from `begin` until `end`.
    pub(super) fn new(begin: Instant, end: Instant) -> Self {
        Deadline {
            begin,
            end,
            total: FIRST,
            since: begin,
            step: 0,
            guessed: true,
            warm: false,
            unit: None,
            cost: Box::new(|_| 1.0),
        }
    }

    /// Deadline of a run estimated at `total` steps, of which `step` are done.
    pub(super) fn of(begin: Instant, end: Instant, total: u32, step: u32) -> Self {
        Deadline { total, step, guessed: false, ..Deadline::new(begin, end) }
    }

    /// Sets the relative duration of steps, by the fraction of the run that is done.
    pub(super) fn costs(&mut self, cost: impl Fn(f64) -> f64 + 'static) {
        self.cost = Box::new(cost);
    }

    /// Whether to replan at the time `now`, after `step` steps.
    pub(super) fn is_due(&mut self, step: u32, now: Instant) -> bool {
        let done = step.saturating_sub(self.step);
        if done == 0 {
            return false;
        }
        if !self.warm && step < self.total {
            (self.since, self.step, self.warm) = (now, step, true);
            return false;
        }
        // All steps done long before the end: the run gets more steps.
        if step >= self.total {
            return self.share(now) < MARKS[MARKS.len() - 1];
        }
        let next = if self.guessed { MARKS[1] } else { 0.0 };
        let passed = |share: f64| MARKS.iter().take_while(|&&mark| mark <= share).count();
        let share = self.share(now);
        passed(share) > passed(self.share(self.since)) && share >= next || self.guessed && done >= PILOT
    }

    /// Whether the time is over.
    pub(super) fn is_over(&self, now: Instant) -> bool {
        now >= self.end
    }

    /// After `step` steps: the step before which the time ends. A run that stops there overruns by less
    /// than one step.
    pub(super) fn last(&self, step: u32, now: Instant) -> u32 {
        let Some(unit) = self.measured(step, now) else {
            return if self.is_over(now) { step } else { u32::MAX };
        };
        let each = unit * (self.cost)(self.part(step));
        let steps = self.left(now, Duration::ZERO) / each.max(1e-9);
        step.saturating_add(steps.ceil() as u32)
    }

    /// Excludes time that was not spent on steps.
    pub(super) fn leave_out(&mut self, time: Duration) {
        self.since += time;
    }

    /// Moves the end by a pause, which does not count as time of the run.
    pub(super) fn pause(&mut self, time: Duration) {
        (self.begin, self.since, self.end) = (self.begin + time, self.since + time, self.end + time);
    }

    /// Replans the run after `step` steps. Work other than steps will take the time `reserved`.
    pub(super) fn plan(&mut self, step: u32, now: Instant, reserved: Duration) -> Plan {
        let plan = plan(step, self.total, self.fit(step, now, reserved));
        self.unit = self.measured(step, now);
        (self.total, self.step, self.since, self.guessed) = (plan.total, plan.done, now, false);
        plan
    }

    /// Mean number of steps that fit into the time after step `step`.
    fn fit(&self, step: u32, now: Instant, reserved: Duration) -> f64 {
        let Some(unit) = self.measured(step, now) else { return 0.0 };
        let each = unit * mean(&self.cost, self.part(step.min(self.total.max(1) - 1)), 1.0);
        self.left(now, reserved) / each.max(1e-9)
    }

    /// Duration of a step of cost 1, seconds, measured since the last plan. If there were few steps since,
    /// the earlier measurement counts half.
    fn measured(&self, step: u32, now: Instant) -> Option<f64> {
        let done = step.saturating_sub(self.step);
        if done == 0 {
            return self.unit;
        }
        let each = now.saturating_duration_since(self.since).as_secs_f64() / f64::from(done);
        let unit = each / mean(&self.cost, self.part(self.step), self.part(step)).max(1e-9);
        match self.unit {
            Some(before) if done < FEW => Some(0.5 * (before + unit)),
            _ => Some(unit),
        }
    }

    fn part(&self, step: u32) -> f64 {
        f64::from(step) / f64::from(self.total.max(1))
    }

    /// Passed share of the time from `begin` to `end`.
    fn share(&self, now: Instant) -> f64 {
        let [passed, all] = [now, self.end].map(|at| at.saturating_duration_since(self.begin).as_secs_f64());
        passed / all.max(1e-9)
    }

    fn left(&self, now: Instant, reserved: Duration) -> f64 {
        self.end.saturating_duration_since(now).saturating_sub(reserved).as_secs_f64()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipelines::train::halvings_at;

    #[test]
    fn a_run_keeps_its_fraction_and_its_end() {
        // 1 % is done; the 99 steps that fit are the other 99 %.
        assert_eq!(plan(1000, 100_000, 99.0), Plan { total: 100, done: 1 });
        // Steps take the expected time: nothing changes.
        assert_eq!(plan(50, 100, 50.0), Plan { total: 100, done: 50 });
        // No time is left: one more step, from the current fraction.
        assert_eq!(plan(50, 100, 0.0), Plan { total: 2, done: 1 });
        assert_eq!(plan(99, 100, 0.0), Plan { total: 100, done: 99 });
        assert_eq!(plan(0, 100_000, 0.3), Plan { total: 1, done: 0 });
        assert!(plan(10, 100, 1e18).total <= MOST && plan(10, 100, f64::INFINITY).total <= MOST);
        // A finished run counts as one that lacks a step, 1 %: five more steps make 500.
        assert_eq!(plan(100, 100, 5.0), Plan { total: 500, done: 495 });
        assert_eq!(plan(100, 100, 0.4), Plan { total: 100, done: 100 });
    }

    /// Result of a simulated loop.
    struct Run {
        seconds: f64,
        steps: u32,
        /// Fraction of the schedule.
        part: f64,
        plans: u32,
    }

    /// Simulates the loop of `Steps` for `time` seconds. A step takes `truth` of the fraction done, the
    /// very first one `first` more; the deadline knows `cost`.
    fn run(time: f64, first: f64, truth: &dyn Fn(f64) -> f64, cost: impl Fn(f64) -> f64 + 'static) -> Run {
        let base = Instant::now();
        let at = |seconds: f64| base + Duration::from_secs_f64(seconds);
        let mut deadline = Deadline::new(base, at(time));
        deadline.costs(cost);
        let (mut now, mut steps, mut plans) = (0.0, 0, 0);
        let (mut done, mut next, mut total, mut batch) = (0, 0, FIRST, 1);
        let mut flying = std::collections::VecDeque::new();
        loop {
            let until = total.min(deadline.last(done, at(now)));
            while flying.len() < 2 && next < until {
                let end = until.min(next + batch);
                flying.push_back((next, end));
                next = end;
            }
            let due = deadline.is_due(done, at(now));
            if flying.is_empty() && !due {
                break Run { seconds: now, steps, part: f64::from(done) / f64::from(total), plans };
            }
            for _ in 0..if due { flying.len() } else { 1 } {
                let Some((begin, end)) = flying.pop_front() else { break };
                let took: f64 = (begin..end).map(|step| truth(f64::from(step) / f64::from(total))).sum();
                now += took + if steps == 0 { first } else { 0.0 };
                let fit = (0.5f64.min(time / 40.0) * f64::from(end - begin) / took) as u32;
                (done, steps, batch) = (end, steps + end - begin, fit.clamp(1, (2 * batch).min(16)));
            }
            if due {
                let plan = deadline.plan(done, at(now), Duration::ZERO);
                (total, done, next, plans) = (plan.total, plan.done, plan.done, plans + 1);
            }
        }
    }

    /// If steps become slower as the number of Gaussians grows, the run still ends in time.
    #[test]
    fn a_run_that_becomes_slower_ends_in_time() {
        let found = run(60.0, 0.5, &|part| 0.02 * (1.0 + 2.0 * part), |_| 1.0);
        // In the last fiftieth, a change of rate is not corrected.
        assert!((found.seconds - 60.0).abs() < 0.005 * 60.0 && found.part > 0.99, "{} {}", found.seconds, found.part);
        assert!((1400..1800).contains(&found.steps) && found.plans > 10, "{} {}", found.steps, found.plans);
    }

    /// Steps on photos of a quarter and half the size come first, at a roughly known cost.
    #[test]
    fn a_run_whose_photos_grow_ends_in_time() {
        let cost = |fixed: f64| move |part: f64| fixed + (1.0 - fixed) * 0.25f64.powi(halvings_at(part, 2) as i32);
        for truth in [0.1, 0.25, 0.5] {
            for time in [6.0, 60.0] {
                let found = run(time, 0.3, &|part| 0.02 * (1.0 + part) * cost(truth)(part), cost(0.25));
                let Run { seconds, part, .. } = found;
                assert!((seconds - time).abs() < 0.01 * time && part > 0.97, "{truth}, {time}: {seconds} {part}");
            }
        }
    }

    /// A run with few steps overruns by one step, or by those submitted before any duration was known.
    #[test]
    fn a_run_of_few_slow_steps_ends_in_time() {
        for (time, each, first) in
            [(10.0, 1.0, 1.0), (2.0, 0.13, 0.2), (3.0, 0.002, 0.3), (1.0, 0.1, 0.1), (5.0, 0.9, 0.0)]
        {
            let Run { seconds, steps, part, .. } = run(time, first, &|_| each, |_| 1.0);
            assert!((0.85 * time..time + each).contains(&seconds), "{time}, {each}: {seconds}");
            assert!(part == 1.0 && f64::from(steps) * each > 0.7 * time, "{time}, {each}: {steps} steps, {part}");
        }
        // Two steps that each exceed the whole time: both were submitted at once.
        let Run { seconds, steps, .. } = run(1.0, 0.0, &|_| 3.0, |_| 1.0);
        assert_eq!((seconds, steps), (6.0, 2));
    }

    /// A run that was estimated at one step is not over with it.
    #[test]
    fn a_run_of_one_step_gets_more() {
        let base = Instant::now();
        let mut deadline = Deadline::of(base, base + Duration::from_secs(100), 1, 0);
        let now = base + Duration::from_secs(2);
        assert!(deadline.is_due(1, now));
        assert_eq!(deadline.plan(1, now, Duration::ZERO), Plan { total: 49, done: 0 });
    }

    /// Evaluations do not count as time of the run.
    #[test]
    fn a_pause_moves_the_end_and_no_share() {
        let base = Instant::now();
        let at = |seconds: u64| base + Duration::from_secs(seconds);
        let mut deadline = Deadline::of(base, at(100), 1000, 0);
        assert!(!deadline.is_due(1, at(0)) && deadline.is_due(101, at(10)));
        assert_eq!(deadline.plan(101, at(10), Duration::ZERO), Plan { total: 1001, done: 101 });
        deadline.pause(Duration::from_secs(50));
        assert!(!deadline.is_due(102, at(61)) && deadline.is_due(151, at(65)));
        assert_eq!(deadline.plan(151, at(65), Duration::ZERO), Plan { total: 1001, done: 151 });
        assert!(!deadline.is_over(at(149)) && deadline.is_over(at(150)));
    }
}
