//! Progress on stderr: a bar for each phase with rate and time left. If stderr is not a terminal, a line is
//! printed every 30 seconds instead.

use std::{
    borrow::Cow,
    cell::Cell,
    collections::BTreeSet,
    fmt::Display,
    io::{self, Write},
    sync::{
        Arc, LazyLock, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc::{self, RecvTimeoutError},
    },
    thread,
    time::{Duration, Instant},
};

use indicatif::{HumanDuration, MultiProgress, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::{caller, deadline::mean};
use crate::gpu::Context;

/// All bars, so that text lines can be written above them. Hidden if stderr is not a terminal.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);
/// Notes that were printed.
static TOLD: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
/// Whether only errors are printed.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Interval between lines in a log file: 120 lines in an hour. The first line comes earlier, to show the
/// time left.
const LINE_EVERY: Duration = Duration::from_secs(30);
const FIRST_LINE: Duration = Duration::from_secs(5);
/// Minimum duration of a phase that logs a line at its end.
const WORTH_A_LINE: Duration = Duration::from_secs(10);
/// Minimum share of the work, and minimum time, before the time left is estimated. The first steps wait for
/// pipelines.
const KNOWN_FROM: (f64, Duration) = (0.01, Duration::from_secs(2));

/// Prints only errors from now on.
pub(super) fn quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Relative duration of a unit of work, by the fraction of the phase that is done.
type Cost = Arc<dyn Fn(f64) -> f64 + Send + Sync>;

/// Progress of a phase over time.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pace {
    /// Units done before `elapsed` began.
    before: u64,
    done: u64,
    total: u64,
    elapsed: Duration,
}

impl Pace {
    /// Units done in `elapsed`.
    fn new_done(&self) -> u64 {
        self.done.saturating_sub(self.before)
    }

    /// Rate with three digits, such as "12.3/s".
    fn rate(&self) -> String {
        let rate = self.new_done() as f64 / self.elapsed.as_secs_f64().max(1e-9);
        match rate {
            _ if self.new_done() == 0 => "–/s".into(),
            ..10.0 => format!("{rate:.2}/s"),
            10.0..100.0 => format!("{rate:.1}/s"),
            _ => format!("{rate:.0}/s"),
        }
    }

    /// Time left, estimated from the work done since the phase began or resumed, if units take `cost`.
    /// `None` until the estimate is reliable.
    fn left(&self, cost: &Cost) -> Option<Duration> {
        let part = |count: u64| count as f64 / self.total.max(1) as f64;
        let work = |from: u64, to: u64| (part(to) - part(from)).max(0.0) * mean(&**cost, part(from), part(to));
        let (done, left) = (work(self.before, self.done), work(self.done, self.total));
        let known = done >= KNOWN_FROM.0 * (done + left) && done > 0.0 && self.elapsed >= KNOWN_FROM.1;
        known.then(|| self.elapsed.mul_f64(left / done))
    }

    fn left_text(&self, cost: &Cost) -> String {
        self.left(cost).map_or(String::new(), |left| format!(", {} left", HumanDuration(left)))
    }
}

/// Progress bar of one phase; it disappears when dropped.
pub(super) struct Progress {
    bar: ProgressBar,
    label: &'static str,
    unit: &'static str,
    started: Instant,
    /// Stops the lines in a log file.
    ended: Option<mpsc::Sender<()>>,
    total: Cell<u64>,
    /// Units done in earlier runs or parts of the phase.
    before: Arc<AtomicU64>,
    cost: Cost,
}

impl Progress {
    /// Bar with a `label` for the phase and a `unit` that is counted up to `total`.
    pub(super) fn new(label: &'static str, unit: &'static str, total: u64) -> Self {
        Self::of_cost(label, unit, total, |_| 1.0)
    }

    /// Bar of a phase whose units take `cost`, by the fraction of the phase that is done.
    pub(super) fn of_cost(
        label: &'static str,
        unit: &'static str,
        total: u64,
        cost: impl Fn(f64) -> f64 + Send + Sync + 'static,
    ) -> Self {
        let cost: Cost = Arc::new(cost);
        let (bar, before) = (ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden()), Arc::default());
        set_style(&bar, [label, unit, ""], &before, &cost);
        let hidden = is_quiet() || caller::is_embedded();
        let bar = if hidden { bar } else { BARS.add(bar) };
        bar.tick();
        let ended = (BARS.is_hidden() && !hidden).then(|| {
            let (ended, wait) = mpsc::channel();
            let (shown, before, cost) = (bar.clone(), Arc::clone(&before), Arc::clone(&cost));
            let beat = move || line(heartbeat([label, unit], &shown, &before, &cost));
            thread::spawn(move || every([FIRST_LINE, LINE_EVERY], &wait, beat));
            ended
        });
        Progress { bar, label, unit, started: Instant::now(), ended, total: Cell::new(total), before, cost }
    }

    /// Sets the units done earlier. Rate and time left count only later units.
    pub(super) fn goes_on_from(&self, done: u64) {
        self.before.store(done, Ordering::Relaxed);
        self.bar.reset_elapsed();
        self.set(done);
    }

    /// Sets the number of units done.
    pub(super) fn set(&self, done: u64) {
        self.bar.set_position(done);
        self.tell();
    }

    /// Counts one more unit as done.
    pub(super) fn advance(&self) {
        self.bar.inc(1);
        self.tell();
    }

    /// Reports the progress to an embedding program.
    fn tell(&self) {
        let (done, total) = (self.bar.position(), self.bar.length().unwrap_or(0));
        caller::phase(caller::Phase { name: self.label, unit: self.unit, done, total });
    }

    /// Sets the units done and the current estimate of the total.
    pub(super) fn set_of(&self, done: u64, total: u64) {
        if self.total.replace(total) != total {
            self.bar.set_length(total);
        }
        self.set(done);
    }

    /// Shows a text in a line below the bar.
    pub(super) fn say(&self, text: impl Display) {
        if self.bar.message().is_empty() {
            set_style(&self.bar, [self.label, self.unit, "\n  {wide_msg}"], &self.before, &self.cost);
        }
        self.bar.set_message(text.to_string());
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        let (took, done) = (self.started.elapsed(), self.bar.position());
        let Progress { label, unit, .. } = self;
        tracing::info!("{label}: {done} {unit} in {:.1} s", took.as_secs_f64());
        if self.ended.take().is_some() && took >= WORTH_A_LINE {
            line(format!("{label}: {done} {unit} done in {}", HumanDuration(took)));
        }
        self.bar.finish_and_clear();
    }
}

/// Sets the style of a bar, with `more` after its line.
fn set_style(bar: &ProgressBar, [label, unit, more]: [&str; 3], before: &Arc<AtomicU64>, cost: &Cost) {
    let (before, cost) = (Arc::clone(before), Arc::clone(cost));
    let rate = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        let (done, total) = (state.pos(), state.len().unwrap_or(0));
        let pace = Pace { before: before.load(Ordering::Relaxed), done, total, elapsed: state.elapsed() };
        // Errors of formatting only shorten the line.
        let _ = write!(out, "{}{}", pace.rate(), pace.left_text(&cost));
    };
    let template = format!("{label} {{wide_bar}} {{pos}}/{{len}} {unit}, {{pace}}{more}");
    // If the template did not parse, indicatif's default bar would remain.
    if let Ok(style) = ProgressStyle::with_template(&template) {
        bar.set_style(style.with_key("pace", rate).progress_chars("━╸─"));
    }
}

/// Text on training progress: mean loss and PSNR of the last pass, number of Gaussians, device memory.
pub(super) fn learned(lately: Option<[f64; 2]>, gaussians: Option<u32>, context: &Context) -> String {
    let quality = lately.map_or(String::new(), |[loss, psnr]| format!("loss {loss:.4}, {psnr:.2} dB, "));
    let count = gaussians.map_or(String::new(), |count| format!("{count} Gaussians, "));
    format!("{quality}{count}{:.0} MB", context.memory().used as f64 / 1e6)
}

/// Line for a log file.
fn heartbeat([label, unit]: [&str; 2], bar: &ProgressBar, before: &AtomicU64, cost: &Cost) -> String {
    let (done, total) = (bar.position(), bar.length().unwrap_or(0));
    let pace = Pace { before: before.load(Ordering::Relaxed), done, total, elapsed: bar.elapsed() };
    let said = bar.message();
    let more = if said.is_empty() { said } else { format!(", {said}") };
    format!("{label}: {done}/{total} {unit}, {}{}{more}", pace.rate(), pace.left_text(cost))
}

/// Calls `beat` after the first interval and then after each of the second, until the sender of `wait` is
/// dropped.
fn every([first, interval]: [Duration; 2], wait: &mpsc::Receiver<()>, mut beat: impl FnMut()) {
    let mut next = first;
    while let Err(RecvTimeoutError::Timeout) = wait.recv_timeout(next) {
        beat();
        next = interval;
    }
}

/// Prints a line that describes the run.
pub(super) fn tell_run(text: impl Display) {
    line(text.to_string().replace(char::is_control, " "));
}

/// Prints a note on something that the user would not expect, such as skipped data and the reason. Each text comes once, also if
/// `glint run` reads a dataset several times.
pub(super) fn note<'a>(text: impl Into<Cow<'a, str>>) {
    // A file name may contain line breaks.
    let text = text.into().replace(char::is_control, " ");
    match caller::is_embedded() {
        true => caller::note(text),
        false if TOLD.lock().is_ok_and(|mut told| told.insert(text.clone())) => line(format!("note: {text}")),
        false => {}
    }
}

fn line(text: impl Display) {
    if !is_quiet() && !caller::is_embedded() {
        // A failed write has no reader: stderr is closed.
        BARS.suspend(|| drop(writeln!(io::stderr(), "{text}")));
    }
}

/// Writes log lines above the bars.
pub(super) struct LogWriter;

impl Write for LogWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        BARS.suspend(|| io::stderr().write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pace(done: u64, total: u64, seconds: f64) -> Pace {
        Pace { before: 0, done, total, elapsed: Duration::from_secs_f64(seconds) }
    }

    /// Without a threshold, the bar showed "84,490/s, 0s left" for hours of work.
    #[test]
    fn what_is_left_is_told_when_it_is_known() {
        let same: Cost = Arc::new(|_| 1.0);
        let left = |pace: Pace| pace.left(&same).map(|left| left.as_millis());
        assert_eq!([pace(0, 100, 60.0), pace(16, 30_000, 60.0), pace(50, 100, 1.0)].map(left), [None; 3]);
        // At the end, and beyond the estimated total.
        let known = [pace(25, 100, 10.0), pace(100, 100, 10.0), pace(120, 100, 10.0), pace(1, 0, 10.0)];
        assert_eq!(known.map(left), [30_000, 0, 0, 0].map(Some));
        assert_eq!([pace(25, 100, 10.0), pace(0, 100, 9.0)].map(|p| p.left_text(&same)), [", 30 seconds left", ""]);
        // The second half takes three times as long: a quarter of the steps is an eighth of the work.
        let more: Cost = Arc::new(|part| if part < 0.5 { 1.0 } else { 3.0 });
        let far = pace(25, 100, 10.0).left(&more).unwrap().as_secs_f64();
        assert!((far - 70.0).abs() < 1.0, "{far}");
    }

    /// Without `before`, the bar showed "1112685/s" for a joint phase that continued after placements.
    #[test]
    fn what_was_done_before_makes_nobody_faster() {
        let pace = |done| Pace { before: 600, ..pace(done, 1000, 10.0) };
        let same: Cost = Arc::new(|_| 1.0);
        let left = |pace: &Pace| pace.left(&same).map(|left| left.as_secs_f64().round());
        assert_eq!((pace(600).rate(), left(&pace(600))), ("–/s".into(), None));
        assert_eq!((pace(700).rate(), left(&pace(700))), ("10.0/s".into(), Some(30.0)));
        let bar = Progress::new("joining", "steps", 1000);
        bar.goes_on_from(600);
        bar.set_of(601, 1000);
        thread::sleep(Duration::from_millis(20));
        let said = heartbeat(["joining", "steps"], &bar.bar, &bar.before, &bar.cost);
        let rate = said.strip_prefix("joining: 601/1000 steps, ").and_then(|said| said.strip_suffix("/s"));
        // One step in 20 ms or more.
        assert!(rate.and_then(|rate| rate.parse::<f64>().ok()).is_some_and(|rate| rate <= 50.0), "{said}");
    }

    #[test]
    fn rates_have_three_digits() {
        let rates = [(0, 1.0), (1, 3.0), (123, 10.0), (1234, 10.0), (845, 0.01)].map(|(n, s)| pace(n, 9999, s).rate());
        assert_eq!(rates, ["–/s", "0.33/s", "12.3/s", "123/s", "84500/s"]);
    }

    #[test]
    fn a_log_hears_of_a_phase_again_and_again_until_it_ends() {
        let (ended, wait) = mpsc::channel();
        let (sender, beats) = mpsc::channel();
        let bar = ProgressBar::hidden();
        bar.set_length(8);
        bar.set_position(2);
        bar.set_message("loss 0.5");
        let shown = bar.clone();
        let thread = thread::spawn(move || {
            let (before, cost): (_, Cost) = (AtomicU64::new(0), Arc::new(|_| 1.0));
            every([Duration::from_millis(1); 2], &wait, || {
                drop(sender.send(heartbeat(["joining", "steps"], &shown, &before, &cost)))
            });
        });
        for _ in 0..3 {
            let line = beats.recv_timeout(Duration::from_secs(60)).unwrap();
            assert!(line.starts_with("joining: 2/8 steps, ") && line.ends_with("/s, loss 0.5"), "{line}");
        }
        drop(ended);
        thread.join().unwrap();
    }
}
