//! Runs commands as child processes that cannot outlive their test.

use std::{
    io::Read,
    process::{Child, Command, Output, Stdio},
    thread::{self, JoinHandle},
    time::Duration,
};

use wait_timeout::ChildExt;

/// Longer than any command of the tests on two busy cores with the validation layers.
const LIMIT: Duration = Duration::from_secs(300);

/// Runs `command` to its end.
#[track_caller]
#[allow(dead_code, reason = "not every test runs commands of the usual length")]
pub fn run(command: &mut Command) -> Output {
    run_within(LIMIT, command)
}

/// [`run`] with a longer time limit.
#[track_caller]
pub fn run_within(limit: Duration, command: &mut Command) -> Output {
    // The record of device checks goes to the tests' folder instead of the user's files.
    if !command.get_envs().any(|(name, _)| name == "XDG_CACHE_HOME") {
        command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
    }
    let piped = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    finish_within(limit, piped.spawn().unwrap())
}

/// Waits for `child` and reads its pipes to the end. A child that does not end is killed, and the test fails.
#[track_caller]
#[allow(dead_code, reason = "not every test has children")]
pub fn finish(child: Child) -> Output {
    finish_within(LIMIT, child)
}

#[track_caller]
fn finish_within(limit: Duration, mut child: Child) -> Output {
    let (stdout, stderr) = (drain(child.stdout.take()), drain(child.stderr.take()));
    let status = child.wait_timeout(limit).unwrap();
    if status.is_none() {
        child.kill().unwrap();
        child.wait().unwrap();
    }
    let (stdout, stderr) = (stdout.join().unwrap(), stderr.join().unwrap());
    let status = status.unwrap_or_else(|| panic!("not done in {limit:?}: {}", String::from_utf8_lossy(&stderr)));
    Output { status, stdout, stderr }
}

fn drain(pipe: Option<impl Read + Send + 'static>) -> JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        pipe.map(|mut pipe| pipe.read_to_end(&mut bytes).unwrap());
        bytes
    })
}
