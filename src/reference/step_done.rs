//! Twin of `step_done.comp`: counts a step, unless a buffer was too small for it.

use crate::stages::status::{STEPS, Status, WORDS};

/// Updates `status` after a step.
pub fn step_done(status: &mut [u32; WORDS]) {
    if !Status(*status).failed() {
        status[STEPS] += 1;
    }
}
