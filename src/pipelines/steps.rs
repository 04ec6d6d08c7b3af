//! Runs a loop of recorded steps with several submissions in flight.

use std::{
    collections::VecDeque,
    mem,
    time::{Duration, Instant},
};

use crate::{
    error::Result,
    gpu::{Buffer, Context, GpuError, Kernel, Location, Recorder, StageTime, Submission},
    stages::{
        status::{self as words, Resource, Status},
        step_done,
    },
};

/// Maximum number of submissions in flight: one runs while the next is recorded.
const IN_FLIGHT: usize = 2;
/// Target duration of a submission, estimated from the previous ones; a single step may take longer. Waiting
/// for all work in flight takes twice as long, and drivers abort work that takes seconds.
const LONGEST: Duration = Duration::from_millis(500);
/// One submission in this number is timed: enough to see changes over a long run, few enough to cost nothing.
const TIMED_OF: usize = 8;
/// Number of timed submissions at the start, as these are short.
const TIMED_FIRST: usize = 5;
/// Room grows once less than one part in this number is left. Steps that do not fit cost nearly as much as
/// steps that do, and two submissions of them are in flight before the host notices. The need of steps grows
/// more slowly than that.
const SPARE: u32 = 8;

/// A loop body, run step by step.
pub trait Looped {
    /// Records step `step`, except for counting it.
    fn record(&mut self, recorder: &mut Recorder, step: u32, status: &Buffer<u32>) -> Result<()>;

    /// Makes room after a step did not fit; nothing is in flight.
    fn grow(&mut self, resource: Resource, needed: u32) -> Result<()>;

    /// Makes more room ahead of time, for `needed` intersections that still fit; nothing is in flight. An
    /// error if this would change more than the room, above all the reduction of gradients.
    fn grow_early(&mut self, needed: u32) -> Result<()> {
        self.grow(Resource::Intersections, needed)
    }

    /// Room for intersections, if [`Looped::grow_early`] can make more.
    fn room(&self) -> u32 {
        u32::MAX
    }
}

/// Drives a loop of steps: the device's status words, and their copies that the host reads later.
pub struct Steps {
    context: Context,
    /// Status words for every stage that needs `status`.
    pub status: Buffer<u32>,
    readback: [Buffer<u32>; IN_FLIGHT],
    /// Maximum number of steps per command buffer.
    most: u32,
    /// Target duration of a command buffer.
    longest: Duration,
    /// Number of steps in the next one.
    batch: u32,
    done: step_done::Stage,
    run: Run,
}

/// State of a running loop.
#[derive(Default)]
struct Run {
    total: u32,
    /// Steps beyond this one are not recorded yet.
    until: u32,
    next: u32,
    /// Finished steps that [`Steps::advance`] has reported.
    reported: u32,
    submitted: usize,
    timed: bool,
    /// Too little room is left: no more submissions until there is more.
    tight: bool,
    /// More room was not available.
    full: bool,
    in_flight: VecDeque<Flight>,
    /// Time at which the last submission was found to be done.
    seen: Option<Instant>,
    report: StepReport,
}

/// A submission in flight.
struct Flight {
    submission: Submission,
    /// Index in `readback`.
    ring: usize,
    steps: u32,
    begun: Instant,
}

impl Run {
    /// Resumes the loop after `done` steps, with nothing in flight; `grown` tells whether room was added.
    fn go_on(&mut self, status: &Buffer<u32>, done: u32, grown: bool) -> Result<()> {
        self.tight = false;
        self.report.grown += u32::from(grown);
        Ok(status.upload(0, &Status::of_steps(done).0)?)
    }
}

/// Results of a loop.
#[derive(Debug, Default)]
pub struct StepReport {
    /// Number of times that something was too small and grew.
    pub grown: u32,
    /// Device time of each stage in the timed steps, in order of recording. Timed steps are spread over the
    /// run.
    pub stages: Vec<StageTime>,
}

impl StepReport {
    /// Mean milliseconds per step of each stage, in the order of their first run.
    pub fn milliseconds(&self) -> Vec<(&'static str, f64)> {
        // Every step ends with one of these.
        let steps = self.stages.iter().filter(|t| t.name == step_done::Kernel::NAME).count().max(1);
        let mut sums: Vec<(&'static str, f64)> = Vec::new();
        for time in &self.stages {
            let milliseconds = time.time.as_secs_f64() * 1e3 / steps as f64;
            match sums.iter_mut().find(|(name, _)| *name == time.name) {
                Some((_, sum)) => *sum += milliseconds,
                None => sums.push((time.name, milliseconds)),
            }
        }
        sums
    }
}

impl Steps {
    /// For submissions of up to `most` steps. The first has one step; each later one has up to twice the
    /// previous number, as long as it takes at most half a second.
    pub fn new(context: &Context, most: u32) -> Result<Self, GpuError> {
        let readback = |i: usize| Buffer::new(context, &format!("status_readback_{i}"), words::WORDS, Location::Host);
        Ok(Steps {
            context: context.clone(),
            status: Buffer::zeroed(context, "status", words::WORDS)?,
            readback: [readback(0)?, readback(1)?],
            most: most.max(1),
            longest: LONGEST,
            batch: 1,
            done: step_done::Stage::new(context, &step_done::Spec { workgroup_size: 1 })?,
            run: Run::default(),
        })
    }

    /// Starts a loop of steps 0..`total`. With `timed`, the stages of some submissions are timed.
    pub fn start(&mut self, total: u32, timed: bool) -> Result<()> {
        self.start_at(0, total, timed)
    }

    /// Starts a loop whose first `done` steps an earlier run did.
    pub fn start_at(&mut self, done: u32, total: u32, timed: bool) -> Result<()> {
        self.status.upload(0, &Status::of_steps(done).0)?;
        self.run = Run { total, until: total, next: done, reported: done, timed, ..Run::default() };
        Ok(())
    }

    /// Renumbers a loop with nothing in flight: `done` steps of `total` are now done. The report so far
    /// stays.
    pub fn count_anew(&mut self, done: u32, total: u32) -> Result<()> {
        let Run { timed, submitted, report, .. } = mem::take(&mut self.run);
        self.start_at(done, total, timed)?;
        (self.run.submitted, self.run.report) = (submitted, report);
        Ok(())
    }

    /// Limits the duration of submissions to `longest`, or half a second if that is less.
    pub fn last_at_most(&mut self, longest: Duration) {
        self.longest = longest.min(LONGEST);
    }

    /// Lets the loop run up to step `step`; [`Steps::advance`] then has nothing more to do.
    pub fn go_on_to(&mut self, step: u32) {
        self.run.until = step.min(self.run.total);
    }

    /// Keeps submissions in flight until one is done. Returns the number of finished steps, or `None` once
    /// all are. If a step ran out of room, nothing after it took effect: `work` makes room, and the loop
    /// repeats from that step.
    pub fn advance(&mut self, work: &mut impl Looped) -> Result<Option<u32>> {
        let Steps { context, status, readback, batch, done, run, .. } = self;
        while !run.tight && run.next < run.until && run.in_flight.len() < IN_FLIGHT {
            let mut recorder = context.recorder("steps")?;
            // The copy of `status` that ends the submission before may still read it.
            recorder.barrier();
            if run.timed && (run.submitted < TIMED_FIRST || run.submitted.is_multiple_of(TIMED_OF)) {
                recorder.time_stages();
            }
            let end = run.until.min(run.next + *batch);
            for step in run.next..end {
                work.record(&mut recorder, step, status)?;
                done.record(&mut recorder, &step_done::Buffers { status }, &step_done::Push {}, 1);
            }
            let ring = run.submitted % IN_FLIGHT;
            recorder.copy(status, 0, &readback[ring], 0, words::WORDS);
            let (begun, steps) = (Instant::now(), end - run.next);
            run.in_flight.push_back(Flight { submission: recorder.submit()?, ring, steps, begun });
            run.next = end;
            run.submitted += 1;
        }
        let collected = self.collect(work)?;
        let run = &mut self.run;
        // Steps that were settled are reported as well: otherwise the caller would wait for them forever.
        let done = collected.or((run.reported < run.next).then_some(run.next));
        run.reported = done.unwrap_or(run.reported);
        Ok(done)
    }

    /// Waits for all work in flight, and returns the number of finished steps. The loop can continue;
    /// [`Steps::advance`] reports these steps as well.
    pub fn settle(&mut self, work: &mut impl Looped) -> Result<u32> {
        while self.collect(work)?.is_some() {}
        Ok(self.run.next)
    }

    /// Waits for the oldest submission; `None` if nothing is in flight.
    fn collect(&mut self, work: &mut impl Looped) -> Result<Option<u32>> {
        let Steps { status, readback, run, .. } = self;
        let Some(Flight { submission, ring, steps, begun }) = run.in_flight.pop_front() else { return Ok(None) };
        let stages = submission.wait()?;
        // It may have waited for the previous submission.
        let now = Instant::now();
        let took = now - run.seen.replace(now).map_or(begun, |seen| seen.max(begun));
        let found = Status::read(readback[ring].mapped());
        let asked = found.asked(Resource::Intersections);
        if !found.failed() {
            // Failed submissions are not timed: steps after the failure do only a part of their work.
            run.report.stages.extend(stages);
            self.batch = next_batch(self.batch, steps, took, self.longest).min(self.most);
            let room = work.room();
            run.tight |= !run.full && run.next < run.total && asked > room - room / SPARE;
            if run.tight && run.in_flight.is_empty() {
                tracing::debug!(step = found.steps(), asked, room, "making room in time");
                match work.grow_early(asked) {
                    Ok(()) => {}
                    // Without more room, continue as long as steps fit.
                    Err(_) if work.room() >= asked => run.full = true,
                    // Not even the old room could be made again.
                    Err(_) => work.grow(Resource::Intersections, asked)?,
                }
                let grown = !run.full;
                run.go_on(status, found.steps(), grown)?;
            }
        } else {
            // Later submissions had no effect either: drain them, then go back to the step that did not fit.
            run.in_flight.clear();
            // Set this first: if growing fails, this number of steps is valid.
            // guard: steps that did not fit are done again
            run.next = found.steps();
            // Time the next submission: the failed one may have been the only timed one.
            run.submitted = run.submitted.next_multiple_of(TIMED_OF);
            for (resource, needed) in found.needs() {
                tracing::debug!(step = found.steps(), %resource, needed, "making room");
                work.grow(resource, needed)?;
            }
            run.go_on(status, found.steps(), true)?;
        }
        Ok(Some(found.steps()))
    }

    /// Ends the loop early, once work in flight is done. Returns the number of finished steps.
    pub fn stop(&mut self) -> Result<u32> {
        for Flight { submission, ring, .. } in mem::take(&mut self.run.in_flight) {
            let stages = submission.wait()?;
            if !Status::read(self.readback[ring].mapped()).failed() {
                self.run.report.stages.extend(stages);
            }
        }
        (self.run.next, self.run.reported) = (self.run.total, self.run.total);
        Ok(Status::read(&self.status.download()?).steps())
    }

    /// Takes the results so far; the next report starts empty.
    pub fn report(&mut self) -> StepReport {
        mem::take(&mut self.run.report)
    }

    /// Runs a whole loop; calls `progress` with the number of finished steps.
    pub fn run(
        &mut self,
        total: u32,
        timed: bool,
        work: &mut impl Looped,
        mut progress: impl FnMut(u32),
    ) -> Result<StepReport> {
        self.start(total, timed)?;
        while let Some(done) = self.advance(work)? {
            progress(done);
        }
        Ok(self.report())
    }
}

/// Number of steps in the next submission, given that the last one had `steps` steps (`batch` were allowed)
/// and took `took`.
fn next_batch(batch: u32, steps: u32, took: Duration, longest: Duration) -> u32 {
    let each = took.as_secs_f64() / f64::from(steps.max(1));
    let fit = (longest.as_secs_f64() / each.max(1e-9)) as u32;
    fit.clamp(1, batch.saturating_mul(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn submissions_are_as_short_as_they_should_be() {
        let next = |batch, steps, milliseconds| next_batch(batch, steps, Duration::from_millis(milliseconds), LONGEST);
        assert_eq!([next(1, 1, 1), next(8, 8, 8), next(16, 4, 4)], [2, 16, 32]);
        assert_eq!([next(16, 16, 1600), next(16, 16, 8000), next(1, 1, 5000), next(4, 4, 0)], [5, 1, 1, 8]);
    }

    #[test]
    fn times_are_those_of_a_step() {
        let stage = |name, milliseconds| StageTime { name, time: Duration::from_millis(milliseconds) };
        let step = [stage("blend", 6), stage("sort", 1), stage("sort", 2), stage(step_done::Kernel::NAME, 1)];
        let report = StepReport { grown: 0, stages: [step, step].concat() };
        assert_eq!(report.milliseconds(), [("blend", 6.0), ("sort", 3.0), (step_done::Kernel::NAME, 1.0)]);
        assert_eq!(StepReport::default().milliseconds(), []);
    }
}
