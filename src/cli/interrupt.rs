//! Ctrl-C, and what a batch system sends before it kills: what was learned so far is kept.

use std::{
    cell::Cell,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use signal_hook::{
    consts::{SIGINT, SIGTERM},
    flag,
};

use crate::{Error, Result};

/// What a shell says of a command that Ctrl-C ended.
pub(super) const EXIT_CODE: u8 = 130;

/// From [`Interrupt::listen`] on the first signal only asks for an end, and the second ends the process as one always did.
/// Before, and once this is gone, there is nothing to keep: the first signal ends the process.
#[derive(Default)]
pub(super) struct Interrupt {
    asked: Arc<AtomicBool>,
    listening: Cell<bool>,
}

impl Interrupt {
    /// Begins, if it has not yet begun.
    pub(super) fn listen(&self) -> Result<()> {
        if self.listening.replace(true) {
            return Ok(());
        }
        for signal in [SIGINT, SIGTERM] {
            // In this order: the first signal finds the flag unset, and then sets it.
            flag::register_conditional_shutdown(signal, EXIT_CODE.into(), Arc::clone(&self.asked))
                .and_then(|_| flag::register(signal, Arc::clone(&self.asked)))
                .map_err(|error| Error::io("signals", error))?;
        }
        tracing::debug!("a signal ends this early");
        Ok(())
    }

    /// Whether an end was asked for.
    pub(super) fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed)
    }
}

impl Drop for Interrupt {
    fn drop(&mut self) {
        self.asked.store(true, Ordering::Relaxed);
    }
}
