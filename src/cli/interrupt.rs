//! Ends a run early on Ctrl-C, SIGTERM or the end of its terminal, so that it can save its scene.

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

/// Exit code by which shells report Ctrl-C.
pub(super) const EXIT_CODE: u8 = 130;

/// Handler of signals. After [`Interrupt::listen`], the first signal requests a stop and the second ends
/// the process. Before that, and after the drop, there is nothing to save and the first signal ends the
/// process.
#[derive(Default)]
pub(super) struct Interrupt {
    asked: Arc<AtomicBool>,
    listening: Cell<bool>,
}

impl Interrupt {
    /// Starts handling signals, unless it already has.
    pub(super) fn listen(&self) -> Result<()> {
        // A program that embeds this command handles signals itself.
        if self.listening.replace(true) || caller::listen(true) {
            return Ok(());
        }
        for &signal in signals() {
            // The order matters: the first signal finds the flag unset, and then sets it.
            flag::register_conditional_shutdown(signal, EXIT_CODE.into(), Arc::clone(&self.asked))
                .and_then(|_| flag::register(signal, Arc::clone(&self.asked)))
                .map_err(|error| Error::io("signals", error))?;
        }
        tracing::debug!("listening for signals");
        Ok(())
    }

    /// Whether a stop was requested.
    pub(super) fn asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed) || (self.listening.get() && caller::asked())
    }
}

/// Signals that request a stop. SIGHUP is one of them unless the parent process ignores it, as nohup does,
/// or this is unknown.
fn signals() -> &'static [i32] {
    #[cfg(target_os = "linux")]
    if std::fs::read_to_string("/proc/self/status").is_ok_and(|status| !ignores(&status, SIGHUP)) {
        return &[SIGINT, SIGTERM, SIGHUP];
    }
    &[SIGINT, SIGTERM]
}

/// Whether a process with this `/proc/PID/status` ignores a signal; also true if the text does not tell.
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
