//! Runs many recorded steps without waiting for any one of them.

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

/// Submissions that may be on their way at once: one runs while the next is recorded.
const IN_FLIGHT: usize = 2;
/// How long a submission takes at most, as far as that is known from those before it and a step takes no longer: whoever waits for what is on
/// its way, as at the end, waits twice as long, and drivers end what takes seconds.
const LONGEST: Duration = Duration::from_millis(500);
/// Of so many submissions one is timed: enough to see how a long run changes, few enough to cost nothing.
const TIMED_OF: usize = 8;
/// So many are timed at first, as they are short.
const TIMED_FIRST: usize = 5;
/// Where less than one part in so many of the room is left, more is made: steps that do not fit cost nearly as much as those that
/// do, and two submissions of them are on their way before it is seen. What steps need grows more slowly than that.
const SPARE: u32 = 8;

/// Something that is done step by step.
pub trait Looped {
    /// Records step `step`, all but the counting of it.
    fn record(&mut self, recorder: &mut Recorder, step: u32, status: &Buffer<u32>) -> Result<()>;

    /// Makes room where the device found too little; nothing is in flight.
    fn grow(&mut self, resource: Resource, needed: u32) -> Result<()>;

    /// Makes room for more intersections than `needed`, which fit, so that more will; nothing is in flight. An error where that would
    /// change more than the room, how gradients are added up above all.
    fn grow_early(&mut self, needed: u32) -> Result<()> {
        self.grow(Resource::Intersections, needed)
    }

    /// For how many intersections there is room, where [`Looped::grow_early`] can make more.
    fn room(&self) -> u32 {
        u32::MAX
    }
}

/// The device's status words and where the host reads them late.
pub struct Steps {
    context: Context,
    /// Given to every stage that asks for `status`.
    pub status: Buffer<u32>,
    readback: [Buffer<u32>; IN_FLIGHT],
    /// Steps in one command buffer at most.
    most: u32,
    /// How long one is to take at most.
    longest: Duration,
    /// Steps in the next one.
    batch: u32,
    done: step_done::Stage,
    run: Run,
}

/// A loop on its way.
#[derive(Default)]
struct Run {
    total: u32,
    /// Steps that may be recorded before the loop is let go on.
    until: u32,
    next: u32,
    submitted: usize,
    timed: bool,
    /// Too little room is left: nothing is submitted until there is more.
    tight: bool,
    /// There was no more to be had before it is needed.
    full: bool,
    in_flight: VecDeque<Flight>,
    /// When the last submission was seen to be done.
    seen: Option<Instant>,
    report: StepReport,
}

/// A submission on its way.
struct Flight {
    submission: Submission,
    /// Of `readback`.
    ring: usize,
    steps: u32,
    begun: Instant,
}

impl Run {
    /// With nothing on its way, once `done` steps were and there is room or no more to be had; `grown`: more was made.
    fn go_on(&mut self, status: &Buffer<u32>, done: u32, grown: bool) -> Result<()> {
        self.tight = false;
        self.report.grown += u32::from(grown);
        Ok(status.upload(0, &Status::of_steps(done).0)?)
    }
}

/// What a loop did.
#[derive(Debug, Default)]
pub struct StepReport {
    /// How often something was too small and was made larger.
    pub grown: u32,
    /// Time of each stage on the device, in the order of recording, of the steps that were timed: some all through the run.
    pub stages: Vec<StageTime>,
}

impl StepReport {
    /// Mean milliseconds a step of each stage, in the order in which they first ran.
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
    /// For submissions of up to `most` steps each: the first has one, and those that follow up to twice as many as the one before, as long
    /// as that takes no longer than half a second.
    pub fn new(context: &Context, most: u32) -> Result<Self, GpuError> {
        let readback =
            |i: usize| Buffer::new(context, &format!("status_readback_{i}"), words::WORDS, Location::Readback);
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

    /// Begins a loop of steps 0..`total`. With `timed`, the stages of some submissions are timed.
    pub fn start(&mut self, total: u32, timed: bool) -> Result<()> {
        self.start_at(0, total, timed)
    }

    /// The same of a loop whose first `done` steps an earlier run did.
    pub fn start_at(&mut self, done: u32, total: u32, timed: bool) -> Result<()> {
        self.status.upload(0, &Status::of_steps(done).0)?;
        self.run = Run { total, until: total, next: done, timed, ..Run::default() };
        Ok(())
    }

    /// Of a loop of which nothing is on its way: `done` steps of `total` are done from now on. What it did stays in its report.
    pub fn count_anew(&mut self, done: u32, total: u32) -> Result<()> {
        let Run { timed, submitted, report, .. } = mem::take(&mut self.run);
        self.start_at(done, total, timed)?;
        (self.run.submitted, self.run.report) = (submitted, report);
        Ok(())
    }

    /// Submissions are to take no longer than this, if it is less than half a second.
    pub fn last_at_most(&mut self, longest: Duration) {
        self.longest = longest.min(LONGEST);
    }

    /// Lets the loop go on to step `step` and no further: [`Steps::advance`] then has nothing more to do.
    pub fn go_on_to(&mut self, step: u32) {
        self.run.until = step.min(self.run.total);
    }

    /// Keeps submissions on their way until one is done; the number of finished steps, or `None` once all are. Where a step
    /// needed more room than there was, nothing after it took effect: `work` makes room and the loop goes on from that step.
    pub fn advance(&mut self, work: &mut impl Looped) -> Result<Option<u32>> {
        let Steps { context, status, readback, batch, done, run, .. } = self;
        while !run.tight && run.next < run.until && run.in_flight.len() < IN_FLIGHT {
            let mut recorder = context.recorder("steps")?;
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
        self.collect(work)
    }

    /// Waits for all that is on its way: how many steps are done by then. The loop can go on.
    pub fn settle(&mut self, work: &mut impl Looped) -> Result<u32> {
        while self.collect(work)?.is_some() {}
        Ok(self.run.next)
    }

    /// Waits for the oldest submission; `None` where none is on its way.
    fn collect(&mut self, work: &mut impl Looped) -> Result<Option<u32>> {
        let Steps { status, readback, run, .. } = self;
        let Some(Flight { submission, ring, steps, begun }) = run.in_flight.pop_front() else { return Ok(None) };
        let stages = submission.wait()?;
        // It may have waited for the one before it.
        let now = Instant::now();
        let took = now - run.seen.replace(now).map_or(begun, |seen| seen.max(begun));
        let found = Status::read(readback[ring].mapped());
        let asked = found.asked(Resource::Intersections);
        if !found.failed() {
            // Only of these: steps after one that does not fit do a part of their work.
            run.report.stages.extend(stages);
            self.batch = next_batch(self.batch, steps, took, self.longest).min(self.most);
            let room = work.room();
            run.tight |= !run.full && run.next < run.total && asked > room - room / SPARE;
            if run.tight && run.in_flight.is_empty() {
                tracing::debug!(step = found.steps(), asked, room, "making room in time");
                match work.grow_early(asked) {
                    Ok(()) => {}
                    // What fits goes on where there is no more room, as far as it does.
                    Err(_) if work.room() >= asked => run.full = true,
                    // Not even what there was came back.
                    Err(_) => work.grow(Resource::Intersections, asked)?,
                }
                let grown = !run.full;
                run.go_on(status, found.steps(), grown)?;
            }
        } else {
            // Later submissions changed nothing either; let them drain, then go back to the step that did not fit.
            run.in_flight.clear();
            // Before there is room: where there is none, this many steps are what there is.
            // guard: steps that did not fit are done again
            run.next = found.steps();
            // The next is timed: the one that failed may have been, and be the only one.
            run.submitted = run.submitted.next_multiple_of(TIMED_OF);
            for (resource, needed) in found.needs() {
                tracing::debug!(step = found.steps(), %resource, needed, "making room");
                work.grow(resource, needed)?;
            }
            run.go_on(status, found.steps(), true)?;
        }
        Ok(Some(found.steps()))
    }

    /// Ends the loop before its last step, once what is on its way is done: how many steps were.
    pub fn stop(&mut self) -> Result<u32> {
        for Flight { submission, ring, .. } in mem::take(&mut self.run.in_flight) {
            let stages = submission.wait()?;
            if !Status::read(self.readback[ring].mapped()).failed() {
                self.run.report.stages.extend(stages);
            }
        }
        self.run.next = self.run.total;
        Ok(Status::read(&self.status.download()?).steps())
    }

    /// What the loop did so far; the next begins anew.
    pub fn report(&mut self) -> StepReport {
        mem::take(&mut self.run.report)
    }

    /// Runs a whole loop; `progress` is called with the number of finished steps.
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

/// Steps in the next submission, after one of `steps` steps took so long where `batch` were allowed.
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
