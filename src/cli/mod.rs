//! The `glint` command, one file per subcommand. Results go to stdout; progress, notes, logs and errors to stderr.
//!
//! Exit codes: 0 done, 2 bad input or usage, 1 the machine (device, driver, memory, disk).

mod demo;
mod devices;
mod enhance;
mod eval;
mod info;
mod progress;
mod render;
mod train;
mod verify;

use std::{
    fmt::Display,
    fs,
    io::{self, IsTerminal, Write},
    path::{Path, PathBuf},
    process::ExitCode,
};

use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};
use serde::Serialize;
use tracing_subscriber::EnvFilter;

use crate::{
    Error, Result,
    data::{self, Dataset, DatasetOptions, PixelSource, Split},
    gpu::{Context, ContextOptions, GpuError, Twin},
    pipelines::session::{Policy, Reduction, Session},
    reference,
    scene::Scene,
};
use progress::{LogWriter, note};

const EXAMPLES: &str = "\
Examples:
  glint demo                               the whole method on a built-in scene
  glint train garden -o base.ply           train a base scene on a dataset
  glint enhance garden --base base.ply -o augmented.ply
  glint eval augmented.ply garden          PSNR and SSIM of its test views
  glint render augmented.ply garden -o views
  glint info augmented.ply                 what is in the file
  glint verify --quick                     does this device compute what it should?

A dataset is a folder with a COLMAP model (sparse/0 and images/) or with transforms.json or transforms_train.json, or \
such a JSON file. Every 8th photo by name is for testing, unless the dataset says itself which are.

Exit codes: 0 done, 2 bad input or usage, 1 the machine. RUST_LOG overrides -v.";

/// Augmented radiance fields in Vulkan compute: 3D Gaussian scenes with view-dependent opacity lobes.
#[derive(Debug, Parser)]
#[command(name = "glint", version, after_help = EXAMPLES, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Log what happens to stderr; -vv and -vvv say more
    #[arg(short, long, global = true, action = ArgAction::Count)]
    verbose: u8,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Args),
    Train(train::Args),
    Enhance(enhance::Args),
    Render(render::Args),
    Eval(eval::Args),
    Info(info::Args),
    Devices(devices::Args),
    Verify(verify::Args),
}

/// Why a command did not do what it should.
#[derive(Debug)]
enum Failure {
    Error(Error),
    /// The validation layers were on and said so many things.
    Validation(usize),
    /// So many stages were farther from their twins than they may be.
    Bounds(usize),
}

impl<E: Into<Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Failure::Error(error.into())
    }
}

type Outcome<T = ()> = Result<T, Failure>;

/// Parses the process's arguments and does what they say.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    log(cli.verbose);
    let outcome = match &cli.command {
        Command::Demo(args) => args.run(),
        Command::Train(args) => args.run(),
        Command::Enhance(args) => args.run(),
        Command::Render(args) => args.run(),
        Command::Eval(args) => args.run(),
        Command::Info(args) => args.run(),
        Command::Devices(args) => args.run(),
        Command::Verify(args) => args.run(),
    };
    let (text, code) = match outcome {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Error(error)) => (error.to_string(), error.exit_code()),
        Err(Failure::Validation(count)) => (format!("the validation layers found {count} faults (see above)"), 1),
        Err(Failure::Bounds(count)) => (format!("{count} rows break their bound (see the table)"), 1),
    };
    // One line, whatever a driver or a file name put into it. Nobody is left to tell when stderr is gone.
    let line = text.replace(char::is_control, " ");
    let _ = writeln!(io::stderr(), "error: {line}");
    ExitCode::from(code)
}

/// Sends log lines to stderr, above the progress bar.
fn log(verbose: u8) {
    let level = ["warn", "info", "debug", "trace"][usize::from(verbose.min(3))];
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(format!("glint={level}")));
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(|| LogWriter)
        .with_ansi(io::stderr().is_terminal())
        .log_internal_errors(false)
        .try_init();
}

/// Which device to run on.
#[derive(Debug, Args)]
struct DeviceArgs {
    /// Vulkan device: an index of `glint devices` or a part of its name [default: the first discrete GPU, else any; or
    /// what the variable GLINT_DEVICE says]
    #[arg(long, value_name = "DEVICE")]
    device: Option<String>,
    /// Turn the Vulkan validation layers on, as the variable GLINT_VALIDATION does; what they find makes the command fail
    #[arg(long, hide = true)]
    validate: bool,
    /// Let the float64 twin of a stage stand in for it, on the host and slowly: where that changes what is wrong, the driver
    /// runs this stage wrongly. May be given several times
    #[arg(long = "twin", value_name = "STAGE", value_parser = parse_twin)]
    twins: Vec<Twin>,
}

fn parse_twin(stage: &str) -> Result<Twin, String> {
    reference::twin(stage).ok_or_else(|| {
        let stages: Vec<&str> = reference::twins().iter().map(|twin| twin.stage).collect();
        format!("expected one of {}", stages.join(", "))
    })
}

impl DeviceArgs {
    /// Opens the device, does `work` on it and fails if the validation layers were on and found something.
    fn with<T>(&self, work: impl FnOnce(&Context) -> Outcome<T>) -> Outcome<T> {
        let mut options = ContextOptions::from_env();
        options.device = self.device.clone().or(options.device);
        options.validation |= self.validate;
        options.twins.clone_from(&self.twins);
        let context = Context::new(&options).map_err(|e| match e {
            // A device that was asked for and is not there is the caller's mistake.
            GpuError::NoDevice(_) if options.device.is_some() => Error::Usage(format!("--device: {e}")),
            e => e.into(),
        })?;
        let result = work(&context);
        match context.validation_messages().len() {
            0 => result,
            count => Err(Failure::Validation(count)),
        }
    }
}

/// How gradients are added up.
#[derive(Debug, Args)]
struct ReductionArgs {
    /// Promise the same bits every run. Without it, float atomics add gradients up, in any order, once a scene's gradients no
    /// longer fit the device's memory (and a warning says so); with it that is an error
    #[arg(long)]
    deterministic: bool,
}

impl ReductionArgs {
    /// What everything on `context` is run with.
    fn session(&self, context: &Context, background: [f32; 3], extent: f32, seed: u64) -> Session {
        let reduction = if self.deterministic { Reduction::Deterministic } else { Reduction::Auto };
        let policy = Policy { reduction, ..Policy::default() };
        Session { policy, background, extent, seed, ..Session::new(context) }
    }
}

/// How photos are prepared.
#[derive(Debug, Args)]
struct PhotoArgs {
    /// Reduce photos whose longer side has more pixels than this; nothing is ever enlarged [default: 1600, as 3DGS]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..))]
    max_size: Option<u32>,
    /// What is behind the scene and behind transparent pixels: black, white or R,G,B with sRGB values from 0 to 1
    #[arg(long, value_name = "COLOR", default_value = "black", value_parser = parse_background)]
    background: [f32; 3],
}

/// 3DGS trains on photos of at most this width.
const DEFAULT_MAX_SIZE: u32 = 1600;

impl PhotoArgs {
    /// Reads the dataset and tells what the user would not expect of it.
    fn open(&self, path: &Path) -> Result<Dataset> {
        let max_size = self.max_size.unwrap_or(DEFAULT_MAX_SIZE);
        let dataset = Dataset::open(path, &DatasetOptions { max_size: Some(max_size), background: self.background })?;
        let reduced = dataset.photos.iter().filter(|photo| match &photo.pixels {
            PixelSource::File(file) => file.size.iter().any(|&side| side > max_size),
            PixelSource::Memory(_) => false,
        });
        if self.max_size.is_none() && reduced.clone().next().is_some() {
            note(format!(
                "{} of {} photos are reduced to {max_size} pixels on the longer side; --max-size sets another limit",
                reduced.count(),
                dataset.photos.len()
            ));
        }
        Ok(dataset)
    }
}

fn parse_background(text: &str) -> Result<[f32; 3], String> {
    match text {
        "black" => return Ok([0.0; 3]),
        "white" => return Ok([1.0; 3]),
        _ => {}
    }
    let values: Option<Vec<f32>> = text.split(',').map(|v| v.trim().parse().ok()).collect();
    let color = values.and_then(|v| <[f32; 3]>::try_from(v).ok());
    color
        .filter(|color| color.iter().all(|v| (0.0..=1.0).contains(v)))
        .ok_or_else(|| "expected black, white or three numbers from 0 to 1 such as 0.2,0.2,0.2".into())
}

/// Which photos of a dataset.
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

/// Reads a scene.
fn open_scene(path: &Path) -> Result<Scene> {
    // Reading a folder would blame the machine.
    if path.is_dir() {
        let what = "is a folder, expected a PLY scene (the scene comes before the dataset)";
        return Err(Error::input(path, what));
    }
    data::read_scene(path)
}

/// Fails now if a file at `path` could not be written after hours of work. Leaves nothing behind.
fn check_output(path: &Path) -> Result<()> {
    if fs::metadata(path).is_ok_and(|found| !found.is_file()) {
        return Err(Error::input(path, "exists and is not a file, expected the name of a file to write"));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let can = tempfile::tempfile_in(folder);
    can.map(drop).map_err(|error| Error::input(path, format!("cannot be written: {}: {error}", folder.display())))
}

/// Makes the folder that outputs go to.
fn make_folder(path: &Path) -> Result<()> {
    if fs::metadata(path).is_ok_and(|found| !found.is_dir()) {
        return Err(Error::input(path, "exists and is not a folder, expected a folder for the images"));
    }
    fs::create_dir_all(path).map_err(|error| Error::input(path, format!("the folder cannot be made: {error}")))?;
    tempfile::tempfile_in(path).map(drop).map_err(|error| Error::input(path, format!("cannot be written to: {error}")))
}

/// Prints a result. A reader that has gone away has seen enough.
fn print(text: impl Display) -> Result<()> {
    let mut out = io::stdout().lock();
    match write!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::io(PathBuf::from("stdout"), error)),
        _ => Ok(()),
    }
}

fn print_json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|e| Error::io(PathBuf::from("stdout"), e.into()))?;
    print(format_args!("{text}\n"))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn backgrounds_are_names_or_three_numbers() {
        assert_eq!(parse_background("white"), Ok([1.0; 3]));
        assert_eq!(parse_background("0, 0.5,1"), Ok([0.0, 0.5, 1.0]));
        for bad in ["", "grey", "1,1", "0,0,0,0", "0,0,255", "0,0,nan", "-1,0,0"] {
            assert!(parse_background(bad).is_err(), "{bad}");
        }
    }
}
