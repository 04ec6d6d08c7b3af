//! What people see on stderr while they wait: a bar with rate and time left, or now and then a line where stderr is no
//! terminal.

use std::{
    borrow::Cow,
    cell::Cell,
    fmt::Display,
    io::{self, Write},
    sync::LazyLock,
    time::{Duration, Instant},
};

use indicatif::{HumanDuration, MultiProgress, ProgressBar, ProgressStyle};

/// All bars, so that lines of text can be written above them. Hidden where stderr is no terminal.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Between lines in a log file: a run of an hour leaves 120.
const LINE_EVERY: Duration = Duration::from_secs(30);

/// A bar of one stage of a command; it disappears when dropped.
pub(super) struct Progress {
    bar: ProgressBar,
    label: &'static str,
    unit: &'static str,
    started: Instant,
    last_line: Cell<Instant>,
}

impl Progress {
    /// `label` says what is done, `unit` what is counted up to `total`.
    pub(super) fn new(label: &'static str, unit: &'static str, total: u64) -> Self {
        let bar = BARS.add(ProgressBar::new(total));
        let template = format!("{label} {{wide_bar}} {{pos}}/{{len}} {unit}, {{per_sec}}, {{eta}} left");
        // A template that does not parse would leave indicatif's own bar.
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style.progress_chars("━╸─"));
        }
        bar.tick();
        let now = Instant::now();
        Progress { bar, label, unit, started: now, last_line: Cell::new(now) }
    }

    /// So many are done.
    pub(super) fn set(&self, done: u64) {
        self.bar.set_position(done);
        if BARS.is_hidden() && self.last_line.get().elapsed() >= LINE_EVERY {
            self.last_line.set(Instant::now());
            let total = self.bar.length().unwrap_or(done);
            let rate = done as f64 / self.started.elapsed().as_secs_f64();
            let left = Duration::try_from_secs_f64(total.saturating_sub(done) as f64 / rate).unwrap_or(Duration::MAX);
            let Progress { label, unit, .. } = self;
            line(format!("{label}: {done}/{total} {unit}, {rate:.1}/s, {} left", HumanDuration(left)));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Tells something that the user would not expect, such as what was left out and why.
pub(super) fn note<'a>(text: impl Into<Cow<'a, str>>) {
    line(format!("note: {}", text.into()));
}

fn line(text: impl Display) {
    // With stderr gone there is nobody to tell.
    BARS.suspend(|| drop(writeln!(io::stderr(), "{text}")));
}

/// Puts log lines above the bars.
pub(super) struct LogWriter;

impl Write for LogWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        BARS.suspend(|| io::stderr().write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}
