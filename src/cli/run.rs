//! `glint run`: from photos to a scene, a report and a page, by the other commands one after another.

use std::{
    ffi::{OsStr, OsString},
    fs,
    path::{Path, PathBuf},
    process::{Command as Process, Stdio},
    time::{Duration, Instant},
};

use clap::{Parser, ValueEnum};
use serde_json::{Value, json};

use super::{
    Cli, DeviceArgs, Outcome, PhotoArgs, captured, counted, history,
    output::{Inputs, OutputArgs},
    print, print_json,
    progress::{self, note},
    report::{NUMBERS, PAGE},
    run, to_json,
    train::fit,
    units,
};
use crate::{
    Error, Result,
    data::{self, Dataset, Split, gaussian_bytes, write_text},
    pipelines::{
        classes,
        learn::learning_bytes,
        start::{default_gaussians, most_gaussians},
    },
};

const EXAMPLES: &str = "\
Runs glint train, enhance, report and export, prints each command line, and writes into DIR:
  base.ply           the base, for comparison; without --time, base.history.jsonl has five evaluations of it
  scene.ply          the scene: constant colors, with bands of harmonics and lobes where they pay
  report/index.html  both compared with the test photos
  scene.html         a page that shows the scene in any browser
  run.json           the command lines; train.json and enhance.json have their figures

The same command resumes an interrupted run and skips what is done. --restart starts over.

For photos without poses, COLMAP finds them first if it is installed (DIR/colmap).

Examples:
  glint run garden -o garden.run
  glint run my_photos -o my_scene --preset draft
  glint run garden -o garden.run --bytes 25MB --time 10m
  glint run garden -o garden.run --sh-degree 0";

/// The list of command lines, which identifies a run.
const COMMANDS: &str = "run.json";
const BASE: &str = "base.ply";
const SCENE: &str = "scene.ply";
const TRAINED: &str = "train.json";
const ENHANCED: &str = "enhance.json";
const REPORT: &str = "report";
const VIEWER: &str = "scene.html";
/// Folder of COLMAP's poses.
const COLMAP: &str = "colmap";
/// Number of evaluations of the base during its training.
const CURVE: u32 = 5;

/// Share of --time for the base and for the augmentation; not tuned. The rest is for report and page.
const TIME: [f64; 2] = [0.55, 0.35];
/// Bytes of a base of constant colors, of --bytes (docs/experiments/2026-11-28-run.md), and of one with harmonics of a single degree, which
/// gives up bands later (docs/experiments/2026-11-30-demotion.md). Without a degree the base takes all, because some of it fades later.
const BASE_BYTES: [f64; 2] = [0.65, 1.25];

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum Preset {
    /// 2000 steps, photos of at most 640 pixels
    Draft,
    /// 7000 steps
    #[default]
    Standard,
    /// 30000 steps
    Best,
}

impl Preset {
    fn steps(self) -> u32 {
        match self {
            Preset::Draft => 2_000,
            Preset::Standard => 7_000,
            Preset::Best => 30_000,
        }
    }

    /// Maximum size of photos, if it is not glint's default.
    fn max_size(self) -> Option<u32> {
        (self == Preset::Draft).then_some(640)
    }
}

/// Make a scene, a report and a page from photos, in one command
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder or JSON file of the dataset, or a folder of photos without poses
    dataset: PathBuf,
    /// Output folder; created if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Length of the base's training; the augmentation takes 30 steps a photo more
    #[arg(long, value_enum, default_value_t)]
    preset: Preset,
    /// Time for the whole run, such as 90s, 5m or 1.5h, instead of the preset's steps. COLMAP comes on top
    #[arg(long, value_name = "TIME", value_parser = units::duration)]
    time: Option<Duration>,
    /// Maximum size of the scene's Gaussians in its file, such as 25MB, without the copy of a base that the
    /// file may keep for other viewers [default: that of the Gaussians of degree 3 that glint train makes by
    /// default, limited by the photos' pixels and the device's memory]
    #[arg(long, value_name = "BYTES", value_parser = units::bytes)]
    bytes: Option<u64>,
    /// Degree of the harmonics of all Gaussians of the base, 0 to 3. With 0, those that gain by bands get them
    /// when lobes are placed; with others, those that show little by them lose them then [default: 3 in
    /// training, near the end of which those that show little by them lose them]
    #[arg(long, value_name = "L", value_parser = clap::value_parser!(u32).range(0..=3))]
    sh_degree: Option<u32>,
    /// Start over even if the folder has another run
    #[arg(long)]
    restart: bool,
    /// Print JSON with the command lines and all figures
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    photos: PhotoArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

/// A command of the run.
struct Step {
    arguments: Vec<OsString>,
    /// The file that shows that the command is done.
    done: PathBuf,
    /// Options that do not change the result, so that they are not part of the run's identity. With --json the standard output becomes
    /// the file.
    added: &'static [&'static str],
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let began = Instant::now();
        let (path, images) = self.posed()?;
        let mut photos = self.photos.clone();
        photos.prefer(images, self.preset.max_size());
        let dataset = photos.open(&path)?;
        let bytes = self.bytes.map_or_else(|| self.default_bytes(&dataset), Ok)?;
        let steps = self.steps(&path, &dataset, &photos, bytes)?;
        OutputArgs::default().make_folder(&self.output, &Inputs::default().dataset(&dataset))?;
        self.prepare(&steps)?;
        let before = steps.iter().take_while(|step| step.done.exists()).count();
        for (i, step) in steps.iter().enumerate() {
            let (line, is_done) = (line_of(&step.arguments), i < before);
            let state = if is_done { " done before" } else { "" };
            progress::tell_run(format_args!("{}/{}{state}: {line}", i + 1, steps.len()));
            if !is_done {
                step.run(self.restart)?;
            }
        }
        self.tell(&steps, began)
    }

    /// The dataset, and the folder of its photos if it is elsewhere: as given, or with poses by COLMAP.
    fn posed(&self) -> Result<(PathBuf, Option<PathBuf>)> {
        let count = data::photos_without_poses(&self.dataset);
        if count == 0 || self.photos.has_model() {
            return Ok((self.dataset.clone(), None));
        }
        let nested = self.dataset.join("images");
        let images = if nested.is_dir() { nested } else { self.dataset.clone() };
        let images = images.canonicalize().map_err(|e| Error::io(&images, e))?;
        let workspace = self.output.join(COLMAP);
        if !has_poses(&workspace) {
            let what = format!("{} without poses: COLMAP looks for them", counted(count, "photo"));
            progress::tell_run(format_args!("{what}; its log is {}", workspace.join("log.txt").display()));
            colmap(&images, &workspace)?;
        }
        Ok((workspace, Some(images)))
    }

    /// Size of the scene if none is given. Without a degree, all Gaussians of the base may lose their bands and take fewer bytes, so their number
    /// has a limit of its own.
    fn default_bytes(&self, dataset: &Dataset) -> Outcome<u64> {
        let pixels = dataset.split(Split::Train).map(|(_, photo)| u64::from(photo.camera.pixels())).sum();
        let points = dataset.points.as_ref().map_or(0, |points| points.positions.len());
        let sh_degree = self.sh_degree.unwrap_or(classes::DEGREE);
        let fit = self.device.with_unchecked(|context| {
            Ok(fit(context.memory_at_most(), learning_bytes(sh_degree, false, true).iter().sum(), pixels))
        })?;
        let most = fit.min(most_gaussians(pixels).max(points)) as u64;
        let all = default_gaussians(points, pixels) as u64 * gaussian_bytes(3, false);
        let (one, share) = match self.sh_degree {
            None | Some(0) => (gaussian_bytes(0, false), 1.0),
            // A base with harmonics is larger than the scene.
            Some(degree) => (gaussian_bytes(degree, false), BASE_BYTES[1]),
        };
        Ok(all.min(((most * one) as f64 / share) as u64))
    }

    fn steps(&self, path: &Path, dataset: &Dataset, photos: &PhotoArgs, bytes: u64) -> Result<Vec<Step>> {
        let at = |name: &str| self.output.join(name);
        let [base, scene, trained, enhanced] = [BASE, SCENE, TRAINED, ENHANCED].map(at);
        let named = |name: &str, path: &Path| [OsString::from(name), path.into()].join(OsStr::new("="));
        let points = dataset.points.as_ref().map_or(0, |points| points.positions.len());
        let (base_options, rest) = shares(bytes, self.sh_degree, points)?;
        let mut enhance = words(["enhance"], [path]);
        enhance.extend(words(["--base"], [&base]).into_iter().chain(words(["-o"], [&scene])));
        let length = match self.time {
            Some(time) => {
                let [train_for, enhance_for] = TIME.map(|share| format!("{:.1}s", share * time.as_secs_f64()));
                enhance.extend(["--time".into(), enhance_for.into()]);
                ["--time".into(), train_for]
            }
            None => ["--iterations".into(), self.preset.steps().to_string()],
        };
        let mut train = words(["train"], [path]);
        train.extend(base_options.into_iter().chain(length).map(OsString::from));
        train.extend(words(["-o"], [&base]));
        enhance.extend(rest.map(OsString::from));
        let mut report = words(["report"], [path]);
        report.extend([named("base", &base), named("scene", &scene)]);
        report.extend(words(["-o"], [at(REPORT)]));
        report.extend(words(["--run"], [&trained]).into_iter().chain(words(["--run"], [&enhanced])));
        if dataset.split(Split::Test).next().is_none() {
            report.extend(["--split".into(), "train".into()]);
        } else if self.time.is_none() {
            // Evaluations would come on top of the time.
            train.extend(["--eval-every".into(), (self.preset.steps() / CURVE).to_string().into()]);
            report.extend(words(["--history"], [base.with_extension(history::FILE)]));
        }
        let mut export = words(["export"], [&scene, &path.to_owned()]);
        export.extend(words(["--html"], [at(VIEWER)]));
        let (shown, device) = (photos.arguments(), self.device.arguments());
        [&mut train, &mut enhance, &mut report].into_iter().for_each(|to| to.extend(device.iter().cloned()));
        [&mut train, &mut enhance, &mut report, &mut export]
            .into_iter()
            .for_each(|to| to.extend(shown.iter().cloned()));
        let step = |arguments, done, added| Step { arguments, done, added };
        Ok(vec![
            step(train, trained, &["--force", "--json"]),
            step(enhance, enhanced, &["--force", "--json"]),
            step(report, at(REPORT).join(PAGE), &["--force"]),
            step(export, at(VIEWER), &["--force"]),
        ])
    }

    /// Prepares the folder for these steps, or finds that it has them already.
    ///
    /// # Errors
    /// [`Error::Input`] if the folder has other steps or foreign files, unless the run is to start over.
    fn prepare(&self, steps: &[Step]) -> Result<()> {
        let path = self.output.join(COMMANDS);
        let lines: Vec<String> = steps.iter().map(|step| line_of(&step.arguments)).collect();
        let read = fs::read(&path).ok().map(|text| serde_json::from_slice(&text).unwrap_or(Value::Null));
        let found = read.as_ref().and_then(|read| read["commands"].as_array()).map_or(&[][..], Vec::as_slice);
        let other = found.iter().zip(&lines).find(|(found, line)| **found != **line);
        let other = match (&read, other) {
            _ if self.restart => None,
            (Some(_), Some((found, _))) => Some(format!("has another run (`{}`)", found.as_str().unwrap_or_default())),
            (Some(_), None) if found.is_empty() => Some("has a damaged run.json".into()),
            (Some(_), None) => None,
            (None, _) => {
                let files = [BASE, SCENE, VIEWER].map(|name| self.output.join(name));
                let foreign = files.into_iter().find(|file| file.exists());
                foreign.map(|file| format!("has {}, which is not of a run", file.display()))
            }
        };
        if let Some(other) = other {
            let what =
                format!("{other}; repeat it with its options, give another folder, or start over with --restart");
            return Err(Error::input(&self.output, what));
        }
        if self.restart || read.is_none() {
            steps.iter().for_each(|step| drop(fs::remove_file(&step.done)));
            write_text(&path, &to_json(&json!({"glint": env!("CARGO_PKG_VERSION"), "commands": lines}))?)?;
        }
        Ok(())
    }

    /// Prints the figures and the files.
    fn tell(&self, steps: &[Step], began: Instant) -> Outcome {
        let report = self.output.join(REPORT);
        let scenes = read_json(&report.join(NUMBERS))?["scenes"].take();
        if self.json {
            return Ok(print_json(&json!({
                "output": self.output,
                "seconds": began.elapsed().as_secs_f64(),
                "commands": steps.iter().map(|step| line_of(&step.arguments)).collect::<Vec<_>>(),
                "train": read_json(&self.output.join(TRAINED))?,
                "enhance": read_json(&self.output.join(ENHANCED))?,
                "scenes": scenes,
            }))?);
        }
        let mut text = String::new();
        for scene in scenes.as_array().into_iter().flatten() {
            let number = |key: &str| scene[key].as_f64().unwrap_or(f64::NAN);
            text += &format!(
                "{:<6} {:.2} dB, SSIM {:.4}, {} Gaussians, {:.1} MB\n",
                scene["name"].as_str().unwrap_or_default(),
                number("psnr"),
                number("ssim"),
                number("gaussians"),
                number("bytes") / 1e6,
            );
        }
        for (name, what) in [
            (
                self.output.join(SCENE),
                "the scene; other viewers show more of it in other formats, which glint convert writes",
            ),
            (report.join(PAGE), "compared with the photos"),
            (self.output.join(VIEWER), "the scene in a browser"),
        ] {
            text += &format!("{}  {what}\n", name.display());
        }
        Ok(print(text)?)
    }
}

impl Step {
    /// Runs the command.
    fn run(&self, restart: bool) -> Outcome {
        // Only `train` and `enhance` take both options, and --restart.
        let restart = (restart && self.added.len() == 2).then_some("--restart");
        let added = self.added.iter().copied().chain(restart).map(OsStr::new);
        let all = [OsStr::new("glint")].into_iter().chain(self.arguments.iter().map(OsString::as_os_str)).chain(added);
        let cli = Cli::try_parse_from(all).map_err(|error| Error::Usage(error.to_string()))?;
        let (text, outcome) = captured(|| run(&cli.command));
        outcome?;
        if self.added.contains(&"--json") {
            write_text(&self.done, &text)?;
        }
        Ok(())
    }
}

/// Options for the size of a base that starts from up to `points` sparse points, and for that of its augmentation.
fn shares(bytes: u64, sh_degree: Option<u32>, points: usize) -> Result<(Vec<String>, [String; 2])> {
    let [constant, banded] = BASE_BYTES.map(|share| (share * bytes as f64) as u64);
    let (base, one) = match sh_degree {
        None => (bytes, classes::most_bytes()),
        Some(0) => (constant, gaussian_bytes(0, false)),
        Some(degree) => (banded, gaussian_bytes(degree, false)),
    };
    let gaussians = (base / one).min(u32::MAX.into());
    if gaussians == 0 {
        let what = format!("a scene of {bytes} bytes has no room for a base, because a Gaussian takes {one} (--bytes)");
        return Err(Error::Usage(what));
    }
    let mut options = match sh_degree {
        None => vec!["--bytes".into(), base.to_string()],
        Some(degree) => vec!["--sh-degree".into(), degree.to_string(), "--gaussians".into(), gaussians.to_string()],
    };
    let rest = if sh_degree == Some(0) { ("--bytes", bytes - gaussians * one) } else { ("--total-bytes", bytes) };
    // The strategy places the other half where errors are large.
    if sh_degree.is_some() && points as u64 > gaussians / 2 {
        options.extend(["--points".into(), (gaussians / 2).max(1).to_string()]);
    }
    Ok((options, [rest.0.into(), rest.1.to_string()]))
}

fn read_json(path: &Path) -> Result<Value> {
    let text = fs::read(path).map_err(|e| Error::io(path, e))?;
    serde_json::from_slice(&text).map_err(|e| Error::input(path, e.to_string()))
}

/// Whether COLMAP has finished: it writes the points last.
fn has_poses(workspace: &Path) -> bool {
    ["bin", "txt"].iter().any(|ending| workspace.join(format!("sparse/0/points3D.{ending}")).exists())
}

/// Finds the poses of photos. COLMAP's SIFT runs on the CPU if it cannot run on a GPU.
fn colmap(images: &Path, workspace: &Path) -> Result<()> {
    fs::create_dir_all(workspace).map_err(|e| Error::io(workspace, e))?;
    let log = workspace.join("log.txt");
    for gpu in ["1", "0"] {
        let to = fs::File::create(&log).map_err(|e| Error::io(&log, e))?;
        let copy = to.try_clone().map_err(|e| Error::io(&log, e))?;
        let mut process = Process::new("colmap");
        process.arg("automatic_reconstructor").args(["--dense", "0", "--use_gpu", gpu]);
        process.arg("--workspace_path").arg(workspace).arg("--image_path").arg(images);
        let status = process.stdin(Stdio::null()).stdout(to).stderr(copy).status().map_err(|error| {
            let what = format!(
                "holds photos without poses, and COLMAP, which finds them, cannot be run ({error}); install it, or give \
                 a dataset with poses (docs/datasets.md)"
            );
            Error::input(images, what)
        })?;
        if status.success() && has_poses(workspace) {
            return Ok(());
        }
        if gpu == "1" {
            note("COLMAP failed with a GPU and is run again without");
        }
    }
    let what = format!("COLMAP found no poses for these photos; its log is {}", log.display());
    Err(Error::input(images, what))
}

fn words<const N: usize, P: AsRef<Path>>(first: [&str; N], paths: impl IntoIterator<Item = P>) -> Vec<OsString> {
    let paths = paths.into_iter().map(|path| path.as_ref().as_os_str().to_owned());
    first.into_iter().map(OsString::from).chain(paths).collect()
}

/// A command line that a shell understands.
fn line_of(arguments: &[OsString]) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=./,:+".contains(c);
    let quoted = arguments.iter().map(|argument| {
        let text = argument.to_string_lossy();
        if !text.is_empty() && text.chars().all(plain) {
            text.into_owned()
        } else {
            format!("'{}'", text.replace('\'', r"'\''"))
        }
    });
    ["glint".to_owned()].into_iter().chain(quoted).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_line_is_quoted_for_a_shell() {
        let line = line_of(&["train", "it's here", "-o", "a=b/c.ply", ""].map(OsString::from));
        assert_eq!(line, r"glint train 'it'\''s here' -o a=b/c.ply ''");
    }

    #[test]
    fn bytes_are_shared_between_base_and_augmentation() {
        let of = |sh_degree| {
            let (base, rest) = shares(1_000_000, sh_degree, 4000).unwrap();
            [base.join(" "), rest.join(" ")]
        };
        let left = 1_000_000 - 11_607 * 56;
        assert_eq!(of(None), ["--bytes 1000000", "--total-bytes 1000000"]);
        assert_eq!(of(Some(0)), ["--sh-degree 0 --gaussians 11607".into(), format!("--bytes {left}")]);
        assert_eq!(of(Some(3)), ["--sh-degree 3 --gaussians 5040 --points 2520", "--total-bytes 1000000"]);
        assert!(shares(80, Some(0), 0).unwrap_err().to_string().contains("a Gaussian takes 56"));
        assert!(shares(235, None, 0).is_err());
    }
}
