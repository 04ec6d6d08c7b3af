//! `glint doctor`: describes a machine for an issue, and whether training would work on it.

use std::{
    env,
    fmt::Display,
    fs, io,
    path::Path,
    process::{Command, Stdio},
    thread,
    time::Instant,
};

use serde::Serialize;

use super::{
    DeviceArgs, Failure, Outcome, check,
    devices::{self, Listed},
    no_gpu, print, print_json, told,
};
use crate::gpu::{ContextOptions, DeviceInfo, loader_version};

/// Free bytes below which a run may fill the disk: scene and checkpoint of a million Gaussians.
const DISK: u64 = 1 << 30;

/// Check this machine: driver, devices, display, tools and disk, in a dozen lines to paste into an issue
///
/// The device that glint would take is compared with float64, as before its first use. The exit code is 1 if training
/// would not work.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Print JSON: {"ready","version","features","lines":[{"state","name","text"}],"devices"}; devices as in
    /// `glint devices --json`
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    /// Training would work.
    ready: bool,
    version: &'static str,
    features: Vec<&'static str>,
    lines: Vec<Line>,
    devices: Vec<Listed>,
}

#[derive(Serialize)]
struct Line {
    state: State,
    name: &'static str,
    /// The finding, and the next step if anything is missing.
    text: String,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum State {
    Ok,
    /// Something works slowly or not at all, but training works.
    Warning,
    Error,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let report = Report::new();
        if self.json {
            print_json(&report)?;
        } else {
            let line = |line: &Line| {
                let state = format!("{:?}", line.state).to_lowercase();
                format!("{state:<8} {:<8} {}\n", line.name, line.text.replace(char::is_control, " "))
            };
            print(report.lines.iter().map(line).collect::<String>())?;
        }
        if report.ready { Ok(()) } else { Err(Failure::Unfit) }
    }
}

impl Report {
    fn new() -> Report {
        let (version, features) = (env!("CARGO_PKG_VERSION"), features());
        let glint = Line::new(State::Ok, "glint", format!("{version}, built with {}", features.join(", ")));
        let loader = match loader_version() {
            Ok(version) => Line::new(State::Ok, "vulkan", format!("loader {version}")),
            Err(error) => Line::new(State::Error, "vulkan", error),
        };
        let (checked, taken) = checked();
        // An error is reported by the check.
        let devices = devices::list().unwrap_or_default();
        let taken = taken.and_then(|info| index(&devices, &info));
        let mut lines = vec![glint, system(), loader];
        lines.extend(devices.iter().map(|device| described(device, taken)));
        lines.push(checked);
        lines.push(display());
        lines.push(tool("colmap", "help", "finds the poses of photos (docs/datasets.md)"));
        lines.push(tool("ffmpeg", "-version", "extracts photos from videos"));
        lines.push(disk());
        let ready = lines.iter().all(|line| line.state != State::Error);
        Report { ready, version, features, lines, devices }
    }
}

impl Line {
    fn new(state: State, name: &'static str, text: impl Display) -> Line {
        Line { state, name, text: text.to_string() }
    }
}

/// Cargo features of this build.
fn features() -> Vec<&'static str> {
    let all = [
        ("cli", true),
        ("formats", cfg!(feature = "formats")),
        ("view", cfg!(feature = "view")),
        ("c", cfg!(feature = "c")),
    ];
    all.into_iter().filter(|(_, is_on)| *is_on).map(|(name, _)| name).collect()
}

fn system() -> Line {
    let release = fs::read_to_string("/etc/os-release").unwrap_or_default();
    let name = release.lines().find_map(|line| line.strip_prefix("PRETTY_NAME="));
    let name = name.map_or(env::consts::OS, |name| name.trim_matches('"'));
    let threads = thread::available_parallelism().map_or(1, usize::from);
    Line::new(State::Ok, "system", format!("{name}, {}, {threads} CPU threads", env::consts::ARCH))
}

/// The check of the device that glint would take, and that device.
fn checked() -> (Line, Option<DeviceInfo>) {
    let start = Instant::now();
    let mut taken = None;
    let outcome = DeviceArgs::default().with_unchecked(|context| {
        taken = Some(context.info().clone());
        check::wrong(context)?.map_or(Ok(()), |text| Err(Failure::Device(text)))
    });
    let line = match outcome {
        Ok(()) => {
            let seconds = start.elapsed().as_secs_f64();
            let text = format!("sort, scan, an image and a training step agree with float64 ({seconds:.1} s)");
            Line::new(State::Ok, "check", text)
        }
        Err(failure) => Line::new(State::Error, "check", told(failure).0),
    };
    (line, taken)
}

/// Index of the device that glint takes. Of several devices of one name it is the first, unless another was selected.
fn index(devices: &[Listed], taken: &DeviceInfo) -> Option<usize> {
    let selected = ContextOptions::from_env().device.and_then(|device| device.parse().ok());
    let is_it = |device: &&Listed| device.refused.is_none() && device.info.name == taken.name;
    selected.or_else(|| devices.iter().find(is_it).map(|device| device.index))
}

fn described(device: &Listed, taken: Option<usize>) -> Line {
    let Listed { index, info, .. } = device;
    let mut text = format!(
        "{index}: {}, {}; driver {} {}, Vulkan {}; {:.1} GB of memory, buffers of up to {} MiB, {} lanes a subgroup",
        info.name,
        info.kind,
        info.driver.name,
        info.driver.version,
        info.driver.vulkan,
        info.memory_bytes as f64 / 1e9,
        info.max_storage_bytes >> 20,
        info.subgroup_size
    );
    let is_taken = taken == Some(*index);
    let mut warnings: Vec<String> = device.note().into_iter().collect();
    if is_taken {
        text += "; glint takes this device";
        if info.is_cpu {
            warnings.push(no_gpu().unwrap_or_else(|| "training on a CPU is much slower than on a GPU".into()));
        }
    } else if let Some(taken) = taken
        && device.refused.is_none()
    {
        text += &format!("; glint prefers device {taken}, --device {index} selects this one");
    }
    let state = if warnings.is_empty() { State::Ok } else { State::Warning };
    warnings.insert(0, text);
    Line::new(state, "device", warnings.join("; "))
}

fn display() -> Line {
    #[cfg(feature = "view")]
    let found = super::view::try_display().map_err(|failure| told(failure).0);
    #[cfg(not(feature = "view"))]
    let found = Err("this build has no glint view: build with --features view");
    match found {
        Ok(()) => Line::new(State::Ok, "display", "glint view can open a window"),
        Err(why) => Line::new(State::Warning, "display", format!("{why}; glint export makes a page for any browser")),
    }
}

/// Line of a program on the PATH. It prints its version with `argument`.
fn tool(name: &'static str, argument: &str, purpose: &str) -> Line {
    match Command::new(name).arg(argument).stdin(Stdio::null()).output() {
        Ok(output) if output.status.success() => {
            let text = String::from_utf8_lossy(&output.stdout);
            let is_number = |word: &&str| word.starts_with(|c: char| c.is_ascii_digit());
            let version = text.split_whitespace().find(is_number).unwrap_or("of unknown version");
            Line::new(State::Ok, name, version)
        }
        Ok(output) => {
            Line::new(State::Warning, name, format!("`{name} {argument}` fails ({}): reinstall it", output.status))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let text = format!("not on the PATH; {purpose}: install it (on Debian and Ubuntu: apt install {name})");
            Line::new(State::Warning, name, text)
        }
        Err(error) => Line::new(State::Warning, name, format!("cannot be run: {error}")),
    }
}

fn disk() -> Line {
    match fs4::available_space(Path::new(".")) {
        Ok(free) => {
            let text = format!("{:.1} GB free in this folder", free as f64 / 1e9);
            let is_low = free < DISK;
            let next = if is_low { ": free some, or write elsewhere (-o)" } else { "" };
            Line::new(if is_low { State::Warning } else { State::Ok }, "disk", text + next)
        }
        Err(error) => Line::new(State::Warning, "disk", format!("free space is unknown: {error}")),
    }
}
