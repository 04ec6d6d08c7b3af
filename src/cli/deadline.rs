//! A run of as many steps as find time until a given moment.
//!
//! All schedules are fractions of a run, so a run that turns out slower or faster than was thought becomes one of fewer or more steps,
//! of which the same fraction is done. How long a step takes is known only from those that were done; so it is asked several times. What is
//! known of how it changes (steps on smaller photos come first) is told by whoever begins the run.

use std::{
    fmt::Display,
    time::{Duration, Instant},
};

/// Steps of the run that a first guess is for; few of them are done as such.
const FIRST: u32 = 100_000;
/// Steps after which the first guess is replaced: two submissions, and enough for a mean.
const PILOT: u32 = 64;
/// Fractions of the run at which it is planned anew. The last is what the end can be off by, times what the rate still changes.
const MARKS: [f64; 7] = [0.05, 0.15, 0.3, 0.5, 0.7, 0.85, 0.95];
/// Steps of a run at most: the losses of so many, 16 bytes each, any device binds at once.
pub(super) const MOST: u32 = 8_000_000;

/// Samples of a mean: it is off by a hundredth of what the cost leaps by.
const SAMPLES: u32 = 100;

/// When a run ends, and how it is planned until then.
pub(super) struct Deadline {
    end: Instant,
    /// Of the run that is planned now.
    pub(super) total: u32,
    /// When the last plan was made, and the step at that time; later by what took time since and was no step.
    since: Instant,
    step: u32,
    guessed: bool,
    /// How long a step takes where that fraction of the run is done, as a multiple of what any takes.
    cost: Box<dyn Fn(f64) -> f64>,
    marks: std::slice::Iter<'static, f64>,
}

/// The same run with another number of steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plan {
    /// Steps in all.
    pub(super) total: u32,
    /// Those of them that count as done.
    pub(super) done: u32,
}

/// `step` of `total` steps are done, the last took `each` seconds, and `left` seconds are left.
fn plan(step: u32, total: u32, each: f64, left: f64) -> Plan {
    // A run that came to its end while it was asked goes on as one that lacks a step.
    let step = step.min(total.max(1) - 1);
    let [before, of, most] = [step, total.max(1), MOST].map(f64::from);
    let steps = (left.max(0.0) / each.max(1e-9)).min(most);
    // At least one step more, so that the run has an end of its own.
    let all = (steps * of / (of - before)).clamp(1.0, most);
    let done = (all * before / of).floor();
    Plan { total: (all.round() as u32).max(done as u32 + 1), done: done as u32 }
}

/// Mean of `cost` between two fractions of a run.
fn mean(cost: &dyn Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    (0..SAMPLES).map(|i| cost(from + (to - from) * (f64::from(i) + 0.5) / f64::from(SAMPLES))).sum::<f64>()
        / f64::from(SAMPLES)
}

impl Deadline {
    /// Until `end`.
    pub(super) fn new(end: Instant) -> Self {
        let (cost, marks) = (Box::new(|_| 1.0), MARKS.iter());
        Deadline { end, total: FIRST, since: Instant::now(), step: 0, guessed: true, cost, marks }
    }

    /// The same of a run that is thought to have `total` steps.
    pub(super) fn of(end: Instant, total: u32) -> Self {
        Deadline { total, guessed: false, ..Deadline::new(end) }
    }

    /// Of a run whose steps take `cost` where a fraction of it is done, as multiples of one another.
    pub(super) fn costs(&mut self, cost: impl Fn(f64) -> f64 + 'static) {
        self.cost = Box::new(cost);
    }

    /// The step at which the run is to be planned anew; `None` for its end.
    pub(super) fn next(&mut self) -> Option<u32> {
        if self.guessed {
            return Some(PILOT);
        }
        let step = |mark: &f64| (mark * f64::from(self.total)) as u32;
        self.marks.find(|mark| step(mark) >= self.step + PILOT).map(step)
    }

    /// So much time went into something else than steps.
    pub(super) fn leave_out(&mut self, time: Duration) {
        self.since += time;
    }

    /// Plans the run anew, of which `step` steps are done, and in whose rest something else than steps takes the time `reserved`.
    pub(super) fn plan(&mut self, step: u32, reserved: Duration) -> Plan {
        let now = Instant::now();
        let each = now.saturating_duration_since(self.since).as_secs_f64() / f64::from((step - self.step).max(1));
        let part = |step: u32| f64::from(step) / f64::from(self.total.max(1));
        let each = each * mean(&self.cost, part(step), 1.0) / mean(&self.cost, part(self.step), part(step));
        let left = self.end.saturating_duration_since(now).saturating_sub(reserved);
        let plan = plan(step, self.total, each, left.as_secs_f64());
        (self.total, self.step, self.since, self.guessed) = (plan.total, plan.done, now, false);
        plan
    }
}

/// "90", "90s", "5m", "1.5h".
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    let fail = |why: &dyn Display| format!("{why}, expected a time such as 90s, 5m or 1.5h");
    let (number, unit) = match text.char_indices().last() {
        Some((at, 's')) => (&text[..at], 1.0),
        Some((at, 'm')) => (&text[..at], 60.0),
        Some((at, 'h')) => (&text[..at], 3600.0),
        _ => (text, 1.0),
    };
    let number: f64 = number.parse().map_err(|error| fail(&error))?;
    match number > 0.0 && number * unit <= 1e7 {
        true => Ok(Duration::from_secs_f64(number * unit)),
        false => Err(fail(&"not between 0 and 2777 hours")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipelines::train::halvings_at;

    #[test]
    fn a_run_keeps_its_fraction_and_its_end() {
        // A hundredth is done; what is left at half a second a step is 99 hundredths of the run.
        assert_eq!(plan(1000, 100_000, 0.5, 49.5), Plan { total: 100, done: 1 });
        // As fast as was thought: nothing changes.
        assert_eq!(plan(50, 100, 0.1, 5.0), Plan { total: 100, done: 50 });
        // No time is left: one step more.
        assert_eq!(plan(50, 100, 0.1, 0.0), Plan { total: 1, done: 0 });
        assert_eq!(plan(99, 100, 1.0, 0.0).total, 1);
        assert!(plan(10, 100, 0.0, 1e9).total <= MOST);
        // At its end it is as a run that lacks one step: five more of these are 500 hundredths.
        assert_eq!(plan(100, 100, 0.01, 0.05), Plan { total: 500, done: 495 });
        assert_eq!(plan(100, 100, 0.01, 0.0), Plan { total: 1, done: 0 });
    }

    #[test]
    fn a_run_is_planned_anew_at_parts_of_it() {
        let end = Instant::now() + Duration::from_secs(60);
        assert_eq!(Deadline::new(end).next(), Some(PILOT));
        let mut known = Deadline::of(end, 1000);
        let marks: Vec<u32> = std::iter::from_fn(|| known.next()).collect();
        let all: Vec<u32> = MARKS.iter().map(|mark| (1000.0 * mark) as u32).filter(|&step| step >= PILOT).collect();
        assert!(!all.is_empty() && marks == all, "{marks:?}");
    }

    /// Of a run of 60 s whose steps take what `truth` says where a fraction is done, while `cost` is what is known of it.
    fn seconds(truth: &dyn Fn(f64) -> f64, cost: &dyn Fn(f64) -> f64) -> f64 {
        let (mut total, mut step, mut now, end) = (FIRST, 0u32, 0.0, 60.0);
        let mut marks = MARKS.iter();
        let mut until = PILOT;
        loop {
            let (since, first) = (now, step);
            while step < until {
                now += truth(f64::from(step) / f64::from(total));
                step += 1;
            }
            if step >= total {
                break;
            }
            let part = |step: u32| f64::from(step) / f64::from(total);
            let ahead = mean(cost, part(step), 1.0) / mean(cost, part(first), part(step));
            let next = plan(step, total, ahead * (now - since) / f64::from(step - first), end - now);
            (total, step) = (next.total, next.done);
            let at = |mark: &f64| (mark * f64::from(total)) as u32;
            until = marks.find(|mark| at(mark) >= step + PILOT).map_or(total, at);
        }
        now
    }

    /// Steps that take longer and longer, as Gaussians become more: the run ends when it should.
    #[test]
    fn a_run_that_becomes_slower_ends_in_time() {
        let now = seconds(&|part| 0.02 * (1.0 + 2.0 * part), &|_| 1.0);
        // The last twentieth is off by what the rate changes within it.
        assert!((now - 60.0).abs() < 0.005 * 60.0, "{now}");
    }

    /// Steps on photos of a quarter and of half the size come first, and how much less they take is known roughly.
    #[test]
    fn a_run_whose_photos_grow_ends_in_time() {
        let cost = |fixed: f64| move |part: f64| fixed + (1.0 - fixed) * 0.25f64.powi(halvings_at(part, 2) as i32);
        for truth in [0.1, 0.25, 0.5] {
            let now = seconds(&|part| 0.02 * (1.0 + part) * cost(truth)(part), &cost(0.25));
            assert!((now - 60.0).abs() < 0.01 * 60.0, "{truth}: {now}");
        }
        // Who knows nothing of it is late.
        assert!(seconds(&|part| 0.02 * cost(0.25)(part), &|_| 1.0) > 61.0);
    }

    #[test]
    fn times_have_units() {
        let seconds = |text| duration(text).map(|d| d.as_secs_f64()).ok();
        assert_eq!(
            [seconds("90"), seconds("90s"), seconds("5m"), seconds("1.5h")].map(Option::unwrap),
            [90.0, 90.0, 300.0, 5400.0]
        );
        for bad in ["", "s", "0", "-1m", "nan", "inf", "1e9h", "5x"] {
            assert_eq!(seconds(bad), None, "{bad}");
        }
    }
}
