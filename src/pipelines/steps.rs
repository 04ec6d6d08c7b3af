//! Runs many recorded steps without waiting for any one of them.

use std::collections::VecDeque;

use crate::{
    gpu::{Buffer, Context, GpuError, Location, Recorder, StageTime, Submission},
    stages::step_done::{OVERFLOW, STATUS_WORDS, STEPS},
};

/// Submissions that may be on their way at once: one runs while the next is recorded.
const IN_FLIGHT: usize = 2;

/// The device's status words and where the host reads them late.
pub struct Steps {
    context: Context,
    /// Given to every stage that asks for `status`.
    pub status: Buffer<u32>,
    readback: [Buffer<u32>; IN_FLIGHT],
    /// Steps in one command buffer.
    batch: u32,
}

/// What a loop did.
#[derive(Debug, Default)]
pub struct StepReport {
    /// How often a buffer was too small and was grown.
    pub grown: u32,
    /// Time of each stage on the device, in the order of recording, summed over the steps that were timed.
    pub stages: Vec<StageTime>,
}

impl Steps {
    pub fn new(context: &Context, batch: u32) -> Result<Self, GpuError> {
        let readback =
            |i: usize| Buffer::new(context, &format!("status readback {i}"), STATUS_WORDS, Location::Readback);
        Ok(Steps {
            context: context.clone(),
            status: Buffer::zeroed(context, "status", STATUS_WORDS)?,
            readback: [readback(0)?, readback(1)?],
            batch: batch.max(1),
        })
    }

    /// Records and submits steps 0..`total`. `record` must end each step with `step_done`. Where a step needed more room
    /// than the buffers have, nothing after it took effect: `grow` is told how many intersections it needed and the loop goes
    /// on from that step. `progress` hears of finished steps. With `timed`, every stage of the first submission is timed.
    pub fn run(
        &self,
        total: u32,
        timed: bool,
        mut record: impl FnMut(&mut Recorder, u32),
        mut grow: impl FnMut(u32) -> Result<(), GpuError>,
        mut progress: impl FnMut(u32),
    ) -> Result<StepReport, GpuError> {
        let mut report = StepReport::default();
        self.status.upload(0, &[0; STATUS_WORDS])?;
        let mut in_flight: VecDeque<(Submission, usize)> = VecDeque::new();
        let (mut next, mut submitted) = (0, 0);
        while next < total || !in_flight.is_empty() {
            while next < total && in_flight.len() < IN_FLIGHT {
                let mut recorder = self.context.recorder("steps")?;
                if timed && submitted == 0 {
                    recorder.time_stages();
                }
                let end = total.min(next + self.batch);
                (next..end).for_each(|step| record(&mut recorder, step));
                let slot = submitted % IN_FLIGHT;
                recorder.copy(&self.status, 0, &self.readback[slot], 0, STATUS_WORDS);
                in_flight.push_back((recorder.submit()?, slot));
                next = end;
                submitted += 1;
            }
            let Some((oldest, slot)) = in_flight.pop_front() else { break };
            report.stages.extend(oldest.wait()?);
            let status = self.readback[slot].mapped();
            let (overflow, done) = (status[OVERFLOW], status[STEPS]);
            progress(done);
            if overflow != 0 {
                // Later submissions changed nothing either; let them drain, then go back to the step that did not fit.
                in_flight.clear();
                tracing::debug!(step = done, intersections = overflow, "growing the intersection buffers");
                grow(overflow)?;
                report.grown += 1;
                self.status.upload(OVERFLOW, &[0])?;
                next = done;
            }
        }
        Ok(report)
    }
}
