//! Ctrl-C, what a batch system sends before it kills, and the end of the terminal: what was learned so far is kept.

use std::{
    cell::Cell,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

#[cfg(target_os = "linux")]
use signal_hook::consts::SIGHUP;
use signal_hook::{
    consts::{SIGINT, SIGTERM},
    flag,
};

use super::caller;
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
        // A program that runs this command has signals of its own.
        if self.listening.replace(true) || caller::listen(true) {
            return Ok(());
        }
        for &signal in signals() {
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
        self.asked.load(Ordering::Relaxed) || (self.listening.get() && caller::asked())
    }
}

/// Those that ask for an end. The end of a terminal does so unless whoever started this has it ignored, as nohup does; where it cannot be
/// known whether it is ignored, nothing is changed.
fn signals() -> &'static [i32] {
    #[cfg(target_os = "linux")]
    if std::fs::read_to_string("/proc/self/status").is_ok_and(|status| !ignores(&status, SIGHUP)) {
        return &[SIGINT, SIGTERM, SIGHUP];
    }
    &[SIGINT, SIGTERM]
}

/// Whether a process whose `/proc/PID/status` this is ignores a signal, or does not say.
#[cfg(target_os = "linux")]
fn ignores(status: &str, signal: i32) -> bool {
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_none_or(|mask| mask >> (signal - 1) & 1 == 1)
}

impl Drop for Interrupt {
    fn drop(&mut self) {
        self.asked.store(true, Ordering::Relaxed);
        caller::listen(false);
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_status_says_what_is_ignored() {
        let status = |mask: &str| {
            format!("Name:\tglint\nSigBlk:\t0000000000000001\nSigIgn:\t{mask}\nSigCgt:\t0000000000000001\n")
        };
        assert!(ignores(&status("0000000000000001"), SIGHUP) && ignores(&status("0000000000001003"), SIGHUP));
        assert!(!ignores(&status("0000000000001000"), SIGHUP) && !ignores(&status("fffffffffffffffe"), SIGHUP));
        assert!(ignores("Name:\tglint\n", SIGHUP));
    }
}
