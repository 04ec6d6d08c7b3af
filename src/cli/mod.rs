//! The `glint` command, with one file for each subcommand. Results go to stdout; progress, notes, logs and
//! errors go to stderr.
//!
//! Exit codes: 0 success, 1 machine (device, driver, memory, disk), 2 bad input or usage, 130 interrupted.

mod caller;
mod check;
mod convert;
mod dataset;
mod deadline;
mod demo;
mod devices;
mod doctor;
pub mod embed;
mod enhance;
mod eval;
mod export;
mod help;
mod history;
mod info;
mod interrupt;
mod kept;
mod lock;
#[cfg(all(test, feature = "formats", feature = "view"))]
mod manual;
mod merge;
mod names;
mod output;
mod pages;
mod partition;
mod picture;
mod progress;
mod render;
mod report;
mod run;
mod synth;
mod train;
mod units;
mod verify;
#[cfg(feature = "view")]
mod view;

use std::{
    cell::RefCell,
    ffi::OsString,
    fmt::{Arguments, Display},
    io::{self, IsTerminal, Write},
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{ArgAction, Args, FromArgMatches, Parser, Subcommand, ValueEnum};
use serde::Serialize;
use tracing_subscriber::EnvFilter;

use crate::{
    Error, Result,
    data::{self, Dataset, Dropped, Photo, SceneFile, Split, TrainedWith, counted},
    gpu::{Context, ContextOptions, GpuError, Twin},
    pipelines::{
        model::Model,
        session::{Policy, Reduction, Session},
    },
    reference,
};
use dataset::{PhotoArgs, settled};
use progress::{LogWriter, note};

const EXAMPLES: &str = "\
Examples:
  glint run garden -o garden.run           from photos to a scene, a report and a page
  glint demo                               train and augment a built-in scene
  glint train garden -o base.ply           train a base scene on a dataset
  glint enhance garden --base base.ply -o augmented.ply
  glint eval augmented.ply garden          PSNR and SSIM on its test photos
  glint view augmented.ply garden          look at it in a window
  glint render augmented.ply garden -o views
  glint info augmented.ply                 describe a scene or a dataset
  glint convert base.ply base.spz          convert it for other programs
  glint export --html page.html scene.ply  a page that shows it in any browser
  glint doctor                             check device, driver, display, tools and disk
  glint verify --quick                     check that this device computes correctly

A dataset is a folder with a COLMAP model (sparse/0 and images/), a folder with transforms.json or \
transforms_train.json, or such a JSON file. Every 8th photo by name is a test photo, unless the dataset has its own \
selection (transforms_test.json, lists in transforms.json, test.txt) or --holdout is given.

Ctrl-C during training saves the scene; a second Ctrl-C quits immediately.

Exit codes: 0 success, 1 machine or device, 2 bad input or usage, 130 interrupted. RUST_LOG overrides -v.";

/// Train, augment, view and convert 3D Gaussian scenes with Vulkan compute
#[derive(Debug, Parser)]
#[command(name = "glint", version, after_help = EXAMPLES, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Log cameras, memory, losses and times to stderr; -vv and -vvv log more
    #[arg(short, long, global = true, action = ArgAction::Count)]
    verbose: u8,
    /// Print only results and errors: no progress bars, no notes
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::Args),
    Demo(demo::Args),
    Train(train::Args),
    #[command(alias = "augment")]
    Enhance(enhance::Args),
    #[cfg(feature = "view")]
    View(Box<view::Args>),
    Render(render::Args),
    Eval(eval::Args),
    Info(info::Args),
    Convert(convert::Args),
    Export(export::Args),
    Report(report::Args),
    Synth(synth::Args),
    Partition(partition::Args),
    Merge(merge::Args),
    Devices(devices::Args),
    Doctor(doctor::Args),
    Verify(verify::Args),
    Completions(pages::CompletionsArgs),
    Man(pages::ManArgs),
}

/// Reason why a command failed.
#[derive(Debug)]
enum Failure {
    Error(Error),
    /// Number of messages from the validation layers.
    Validation(usize),
    /// The user interrupted the run, and partial results were saved; the text describes them.
    Interrupted(String),
    /// There is no display, or no window can be opened on it.
    #[cfg(feature = "view")]
    NoWindow(String),
    /// The device failed its check; the text describes how.
    Device(String),
    /// Number of rows that exceed their bounds against the twins.
    Bounds(usize),
    /// `glint doctor` found that training would not work.
    Unfit,
}

impl<E: Into<Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Failure::Error(error.into())
    }
}

type Outcome<T = ()> = Result<T, Failure>;

/// Parses the arguments of the process and runs the command.
pub fn main() -> ExitCode {
    let cli = Cli::from_arg_matches(&help::command().get_matches()).unwrap_or_else(|error| error.exit());
    log(cli.verbose, cli.quiet);
    let outcome = match unexpanded(std::env::args_os().skip(1)) {
        Some(what) => Err(Error::Usage(what).into()),
        None => run(&cli.command),
    };
    let Err(failure) = outcome else { return ExitCode::SUCCESS };
    let (line, code) = told(failure);
    // A failed write has no reader: stderr is closed.
    let _ = writeln!(io::stderr(), "error: {line}");
    ExitCode::from(code)
}

/// Message and exit code of a failure.
fn told(failure: Failure) -> (String, u8) {
    let (text, code) = match failure {
        Failure::Error(error) => (error.to_string(), error.exit_code()),
        Failure::Validation(count) => (format!("the validation layers found {count} faults (see above)"), 1),
        #[cfg(feature = "view")]
        Failure::NoWindow(why) => (
            format!(
                "no window can be opened: {why} (expected an X11 desktop, or Wayland with Xwayland, named by DISPLAY)"
            ),
            1,
        ),
        Failure::Interrupted(what) => (what, interrupt::EXIT_CODE),
        Failure::Device(what) => (
            format!(
                "{what}; choose another device or driver (glint devices), list all errors (glint verify), replace \
                 wrong stages by twins (--twin), or use it anyway (--unchecked)"
            ),
            1,
        ),
        Failure::Bounds(count) => (format!("{} out of bounds (see the table)", counted(count, "row")), 1),
        Failure::Unfit => ("training would not work on this machine (see the lines with `error`)".into(), 1),
    };
    // A driver's text or a file name may contain line breaks.
    (text.replace(char::is_control, " "), code)
}

fn run(command: &Command) -> Outcome {
    match command {
        Command::Run(args) => args.run(),
        Command::Demo(args) => args.run(),
        Command::Train(args) => args.run(),
        Command::Enhance(args) => args.run(),
        #[cfg(feature = "view")]
        Command::View(args) => args.run(),
        Command::Render(args) => args.run(),
        Command::Eval(args) => args.run(),
        Command::Info(args) => args.run(),
        Command::Convert(args) => args.run(),
        Command::Export(args) => args.run(),
        Command::Report(args) => args.run(),
        Command::Synth(args) => args.run(),
        Command::Partition(args) => args.run(),
        Command::Merge(args) => args.run(),
        Command::Devices(args) => args.run(),
        Command::Doctor(args) => args.run(),
        Command::Verify(args) => args.run(),
        Command::Completions(args) => args.run(),
        Command::Man(args) => args.run(),
    }
}

/// Message for an argument whose `~` was not expanded by the shell.
fn unexpanded(arguments: impl Iterator<Item = OsString>) -> Option<String> {
    let home = |path: &&str| *path == "~" || path.starts_with("~/");
    let literal = |argument: OsString| {
        let text = argument.to_str()?;
        let path = [Some(text), text.split_once('=').map(|(_, value)| value)].into_iter().flatten().find(home)?;
        (!Path::new(path).exists()).then(|| path.to_owned())
    };
    let path = arguments.into_iter().find_map(literal)?;
    let rest = path.trim_start_matches('~');
    Some(format!(
        "{path}: the shell has not expanded `~`, because it is quoted or follows a `=`; write \"$HOME{rest}\" instead"
    ))
}

/// Sends log lines to stderr, above the progress bars.
fn log(verbose: u8, quiet: bool) {
    if quiet {
        progress::quiet();
    }
    let level = if quiet { "error" } else { ["warn", "info", "debug", "trace"][usize::from(verbose.min(3))] };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(format!("glint={level}")));
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(|| LogWriter)
        .with_ansi(io::stderr().is_terminal())
        .log_internal_errors(false)
        .try_init();
}

/// Adds a hint to errors about a missing driver.
fn with_hint(error: GpuError) -> GpuError {
    let hint = "install your GPU's Vulkan driver, or Mesa's to run on the CPU (on Debian and Ubuntu: apt install \
                mesa-vulkan-drivers)";
    match error {
        GpuError::NoDevice(why) => GpuError::NoDevice(format!("{why}: {hint}")),
        GpuError::Vulkan { result: ash::vk::Result::ERROR_INCOMPATIBLE_DRIVER, .. } => {
            GpuError::NoDevice(format!(" ({error}): {hint}"))
        }
        error => error,
    }
}

/// Options that select and configure the device.
#[derive(Debug, Default, Args)]
struct DeviceArgs {
    /// Vulkan device: an index from `glint devices` or a part of its name [default: the GLINT_DEVICE
    /// variable, else the first discrete GPU, else any device]
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// Turn on Vulkan's validation layers, like the GLINT_VALIDATION variable; the command fails if they
    /// report anything
    #[arg(long, hide = true)]
    validate: bool,
    /// Run STAGE on the CPU in float64 (slow). If this fixes the output, the driver runs STAGE wrongly. May
    /// be given several times
    #[arg(long = "twin", value_name = "STAGE", value_parser = parse_twin)]
    twins: Vec<Twin>,
    /// Use the device even if it fails the check before its first use: sort, scan, an image and a training
    /// step against float64
    #[arg(long)]
    unchecked: bool,
}

fn parse_twin(stage: &str) -> Result<Twin, String> {
    reference::twin(stage).ok_or_else(|| {
        let stages: Vec<&str> = reference::twins().iter().map(|twin| twin.stage).collect();
        format!("expected one of {}", stages.join(", "))
    })
}

impl DeviceArgs {
    /// These options as on the command line.
    fn arguments(&self) -> Vec<OsString> {
        let DeviceArgs { device, validate, twins, unchecked } = self;
        let mut all: Vec<OsString> = device.iter().flat_map(|device| ["--device".into(), device.into()]).collect();
        all.extend(twins.iter().flat_map(|twin| ["--twin".into(), twin.stage.into()]));
        let flags = [("--validate", validate), ("--unchecked", unchecked)];
        all.extend(flags.into_iter().filter(|&(_, &given)| given).map(|(name, _)| name.into()));
        all
    }

    /// Context options from command-line options and environment variables.
    fn options(&self) -> ContextOptions {
        let mut options = ContextOptions::from_env();
        options.device = self.device.clone().or(options.device);
        options.validation |= self.validate;
        options.twins.clone_from(&self.twins);
        options
    }

    /// If the user named a missing device, this is an error of usage.
    fn explain(&self, options: &ContextOptions, error: GpuError) -> Error {
        let asked = if self.device.is_some() { "--device" } else { "GLINT_DEVICE" };
        match error {
            GpuError::NoDevice(_) if options.device.is_some() => Error::Usage(format!("{asked}: {error}")),
            error => with_hint(error).into(),
        }
    }

    /// Opens and checks the device and does `work` on it. Fails if the validation layers were on and
    /// reported anything.
    fn with<T>(&self, work: impl FnOnce(&Context) -> Outcome<T>) -> Outcome<T> {
        self.with_unchecked(|context| {
            check::check(context, &self.options(), self.unchecked)?;
            work(context)
        })
    }

    /// Does `work` without the check, for commands that test the device themselves.
    fn with_unchecked<T>(&self, work: impl FnOnce(&Context) -> Outcome<T>) -> Outcome<T> {
        let options = self.options();
        let context = Context::new(&options).map_err(|error| self.explain(&options, error))?;
        tracing::info!("device: {}", context.info().name);
        let result = work(&context);
        tell_end(result, context.validation_messages().len())
    }
}

/// Prints device, photos and length of a run before its first step. If the device is a CPU, a note explains
/// why no GPU is used.
fn tell_run(what: &str, context: &Context, photos: &[&Photo], length: impl Display) {
    let info = context.info();
    let sizes = photos.iter().map(|photo| [photo.camera.width, photo.camera.height]);
    let largest = sizes.clone().max_by_key(|&[width, height]| u64::from(width) * u64::from(height)).unwrap_or_default();
    let at_most = if sizes.into_iter().all(|size| size == largest) { "" } else { "at most " };
    let ([width, height], photos) = (largest, counted(photos.len(), "photo"));
    progress::tell_run(format_args!(
        "{what} on {} ({}): {photos} of {at_most}{width} × {height}, {length}",
        info.name, info.kind
    ));
    if info.is_cpu
        && let Some(why) = no_gpu()
    {
        note(why);
    }
}

/// Reason why an existing GPU is not used.
fn no_gpu() -> Option<String> {
    let devices = Context::devices().unwrap_or_default();
    let mut gpus = devices.iter().filter(|(info, _)| !info.is_cpu).peekable();
    let hint = "glint runs on the CPU, which is much slower";
    if gpus.peek().is_some() {
        // A usable GPU is not an error: the user chose the CPU.
        let (info, refused) = gpus.find_map(|(info, refused)| Some((info, refused.as_ref()?)))?;
        return Some(format!("{} cannot be used: {refused}; {hint}", info.name));
    }
    let node = ["/dev/nvidia0", "/dev/dri/renderD128", "/dev/kfd"].into_iter().find(|node| Path::new(node).exists())?;
    Some(format!("there is a GPU ({node}), but no Vulkan driver offers it: install its driver (glint devices); {hint}"))
}

/// Returns `result`, or an error if the validation layers reported `faults`.
fn tell_end<T>(result: Outcome<T>, faults: usize) -> Outcome<T> {
    if let Some(bytes) = peak_memory() {
        tracing::info!("the process held {:.1} MB of memory at most", bytes as f64 / 1e6);
    }
    match faults {
        0 => result,
        count => Err(Failure::Validation(count)),
    }
}

/// Callback between the steps of a run; it gets the model and a text on the progress.
type Look<'a> = dyn FnMut(&Model, Arguments<'_>) + 'a;

/// Options to watch a run in a window.
#[derive(Debug, Args)]
struct WatchArgs {
    /// Show the scene in a window while training. The run takes less than a tenth longer; the result is
    /// identical. Keys and mouse as in glint view; closing the window does not end the run
    #[cfg(feature = "view")]
    #[arg(long)]
    view: bool,
}

/// Properties of a run that is shown in a window.
#[cfg_attr(not(feature = "view"), expect(dead_code, reason = "nothing shows it"))]
struct Watched<'a> {
    device: &'a DeviceArgs,
    dataset: &'a Dataset,
    policy: Policy,
    background: [f32; 3],
    /// Output file of the scene.
    output: &'a Path,
}

impl WatchArgs {
    /// Opens the device, with a window if requested, and does `work` on it as [`DeviceArgs::with`] does.
    fn with<T>(&self, run: &Watched<'_>, work: impl FnOnce(&Context, &mut Look<'_>) -> Outcome<T>) -> Outcome<T> {
        #[cfg(feature = "view")]
        if self.view {
            return view::watch(run, work);
        }
        run.device.with(|context| work(context, &mut |_, _| ()))
    }
}

/// Peak memory of this process, bytes, if the system reports it (Linux). It includes the buffers of a CPU
/// device.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kilobytes =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.split_whitespace().next()?.parse().ok());
    kilobytes.map(|n: u64| 1024 * n)
}

/// Options of `train` and `enhance`: photos, gradients, drawing, device.
#[derive(Debug, Args)]
struct CommonArgs {
    #[command(flatten)]
    photos: PhotoArgs,
    #[command(flatten)]
    learn: LearnArgs,
    #[command(flatten)]
    draw: DrawArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

/// Options for the precision and summation of gradients.
#[derive(Debug, Args)]
struct LearnArgs {
    /// Guarantee bit-identical runs: fail if gradients do not fit the device's memory. Without this option,
    /// they are then summed by float atomics in any order, with a warning
    #[arg(long)]
    deterministic: bool,
    /// Precision of the optimizer's moments. `half` saves 176 of 612 bytes for each Gaussian of degree 3
    /// (240 of 788 with Adam); over nine runs it neither gained nor lost quality
    #[arg(long, value_enum, default_value_t)]
    precision: Precision,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum Precision {
    /// 32 bits for each moment of a parameter
    #[default]
    Full,
    /// At most 16 bits for each, rounded at random
    Half,
}

impl LearnArgs {
    /// Session on `context` with these options.
    fn session(&self, context: &Context, policy: Policy, background: [f32; 3], extent: f32, seed: u64) -> Session {
        let reduction = if self.deterministic { Reduction::Deterministic } else { Reduction::Auto };
        let policy = Policy { reduction, packed: self.precision == Precision::Half, ..policy };
        Session { policy, background, extent, seed, ..Session::new(context) }
    }
}

/// Options that affect rendering.
#[derive(Debug, Clone, Copy, Args)]
struct DrawArgs {
    /// Fade Gaussians smaller than a pixel, so that the blur of 0.3 px² on every Gaussian adds no light
    /// (gsplat's `antialiased` mode) [default: as the scene was trained, else off]
    #[arg(long, value_name = "YES", num_args = 0..=1, require_equals = true, default_missing_value = "true")]
    compensate: Option<bool>,
}

impl DrawArgs {
    fn policy(&self) -> Policy {
        Policy { compensate: self.compensate.unwrap_or_default(), ..Policy::default() }
    }

    /// Fills options that were not given with those that the scene at this path was trained with.
    fn like(&self, trained_with: TrainedWith, scene: &Path) -> DrawArgs {
        let both = [self.compensate, trained_with.antialiased];
        DrawArgs { compensate: settled("--compensate", both, scene, bool::to_string) }
    }
}

/// Photos of a dataset to use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SplitArg {
    Train,
    Test,
    All,
}

impl SplitArg {
    fn split(self) -> Option<Split> {
        match self {
            SplitArg::Train => Some(Split::Train),
            SplitArg::Test => Some(Split::Test),
            SplitArg::All => None,
        }
    }
}

/// Options for reading scenes.
#[derive(Debug, Args)]
struct SceneArgs {
    /// Drop invalid Gaussians (NaN, infinite opacity or scale, zero rotation) and report their number,
    /// instead of refusing the file
    #[arg(long)]
    lenient: bool,
}

impl SceneArgs {
    /// Reads a scene.
    #[cfg(feature = "view")]
    fn open(&self, path: &Path) -> Result<crate::scene::Scene> {
        Ok(self.open_file(path)?.scene)
    }

    /// Reads a scene with its metadata, and with the base that other viewers show.
    fn open_file(&self, path: &Path) -> Result<SceneFile> {
        // Reading a folder would give an I/O error, which blames the machine.
        if path.is_dir() && !data::is_scene_folder(path) {
            let what = "is a folder, expected a scene file (if both are arguments, the scene comes before the dataset)";
            return Err(Error::input(path, what));
        }
        let tell = |file: &SceneFile| file.notes.iter().for_each(|text| note(format!("{}: {text}", path.display())));
        if !self.lenient {
            return data::read_scene_file(path).inspect(tell).map_err(|error| match error {
                Error::Input { path, what } if what.starts_with("row ") => {
                    Error::input(path, format!("{what} (--lenient drops such Gaussians)"))
                }
                error => error,
            });
        }
        let (file, Dropped { base, supplementary, first }) = data::read_scene_file_leniently(path)?;
        tell(&file);
        if let Some(first) = first {
            let all = file.scene.base.len() + file.scene.supplement.as_ref().map_or(0, |s| s.gaussians.len());
            let dropped = base + supplementary;
            let path = path.display();
            note(format!("{path}: {dropped} of {} Gaussians dropped; the first error is: {first}", all + dropped));
        }
        Ok(file)
    }
}

thread_local! {
    /// Results printed inside [`captured`].
    static CAPTURED: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// Does `work`, and returns the results that it prints.
fn captured<T>(work: impl FnOnce() -> T) -> (String, T) {
    /// A stopped command unwinds.
    struct End;
    impl Drop for End {
        fn drop(&mut self) {
            CAPTURED.take();
        }
    }
    let _end = End;
    CAPTURED.set(Some(String::new()));
    let done = work();
    (CAPTURED.take().unwrap_or_default(), done)
}

/// Prints a result. A closed pipe is not an error.
fn print(text: impl Display) -> Result<()> {
    let into = |captured: &mut Option<String>| captured.as_mut().map(|all| *all += &text.to_string());
    if CAPTURED.with_borrow_mut(into).is_some() {
        return Ok(());
    }
    if caller::is_embedded() {
        caller::print(&text.to_string());
        return Ok(());
    }
    let mut out = io::stdout().lock();
    match write!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::io(PathBuf::from("stdout"), error)),
        _ => Ok(()),
    }
}

fn print_json(value: &impl Serialize) -> Result<()> {
    print(to_json(value)?)
}

fn to_json(value: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string_pretty(value).map_err(|e| Error::io(PathBuf::from("stdout"), e.into()))?;
    Ok(text + "\n")
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn what_the_process_held_at_most_is_in_bytes() {
        let held = vec![1u8; 50_000_000];
        let most = peak_memory().unwrap();
        assert!((held.len() as u64..1 << 40).contains(&most), "{most}");
    }

    #[test]
    fn rows_out_of_bounds_fail_as_the_machine_does() {
        assert_eq!(told(Failure::Bounds(2)), ("2 rows out of bounds (see the table)".into(), 1));
    }

    #[test]
    fn results_are_captured_until_the_work_ends() {
        let said = captured(|| print("a").and_then(|()| print(1)).is_ok());
        assert_eq!(said, ("a1".into(), true));
        // As a stopped command does.
        let ended = std::panic::catch_unwind(|| captured(|| std::panic::resume_unwind(Box::new(()))));
        assert!(ended.is_err() && CAPTURED.with_borrow(Option::is_none));
    }

    #[test]
    fn a_home_that_no_shell_has_filled_in_is_told() {
        let found = |arguments: &[&str]| unexpanded(arguments.iter().map(OsString::from));
        for arguments in
            [&["train", "~/garden"][..], &["train", "x", "-o", "~/a.ply"], &["--init=~/a.ply"], &["a=~/s.ply"], &["~"]]
        {
            let what = found(arguments).unwrap();
            assert!(what.contains("has not expanded `~`") && what.contains("\"$HOME"), "{what}");
        }
        assert!(found(&["~/garden"]).unwrap().contains("write \"$HOME/garden\""));
        assert_eq!(found(&["train", "a~/b", "~x", "a=b~", "/home/~/x"]), None);
    }

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}
