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
        learn::learning_bytes,
        start::{default_gaussians, most_gaussians},
    },
};

const EXAMPLES: &str = "\
Runs glint train, enhance, report and export, prints each command line, and writes into DIR:
  trials/            short runs that choose --sh-degree; the test photos take no part in them
  base.ply           the base, for comparison; without --time, base.history.jsonl has five evaluations of it
  scene.ply          the scene, with lobes where they pay, and bands where they pay if its base has constant colors
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
/// Folder of the short runs that choose the degree.
const TRIALS: &str = "trials";

/// Number of commands after the trials.
const STEPS: usize = 4;
/// Number of evaluations of the base during its training.
const CURVE: u32 = 5;
/// Degrees of the trials. Degree 2 lies between two of them and was not measured.
const DEGREES: [u32; 3] = [0, 1, 3];
/// Trials are shorter than the run by this factor.
const TRIAL: u32 = 16;
/// Minimum number of steps of a trial. On chair degree 3 leads by 0.3 dB after 125 steps, by 1.1 dB after 250, and by 0.7 dB in the end.
const LEAST_TRIAL: u32 = 250;
/// Minimum time of a trial: on llvmpipe the first step begins after one second of it.
const LEAST_TRIAL_TIME: Duration = Duration::from_secs(5);
/// A base with harmonics must be better than constant colors by this much in the trials, dB, because bands and lobes then improve
/// constant colors by more (docs/experiments/2026-11-28-degree.md).
const MARGIN_DB: f64 = 0.5;

/// Share of --time, less that of the trials, for the base and for the augmentation; not tuned. The rest is for report and page.
const TIME: [f64; 2] = [0.55, 0.35];
/// Share of --bytes for the base: of constant colors (docs/experiments/2026-11-28-run.md), and with harmonics. The latter leaves no
/// bytes for bands, only the tenth that docs/experiments/2026-11-26-photographs.md measures for lobes.
const BASE_BYTES: [f64; 2] = [0.65, 0.9];

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
    /// Degree of the harmonics of all Gaussians, 0 to 3. With 0, only those get bands that gain by them
    /// [default: chosen by short runs, tested on photos that they leave out of the training photos; 0 with
    /// --time below 80s]
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
        shares(bytes, self.sh_degree.unwrap_or(0))?;
        OutputArgs::default().make_folder(&self.output, &Inputs::default().dataset(&dataset))?;
        let chooses = self.chooses(&dataset);
        if let Some(time) = self.time.filter(|_| self.sh_degree.is_none() && !self.has_time_for_trials()) {
            note(format!(
                "--time {time:?} is too short for trials: the base has constant colors, unless --sh-degree is given"
            ));
        }
        let (mut steps, mut sh_degree) = (vec![], self.sh_degree.unwrap_or(0));
        if chooses {
            steps = self.trials(&path, &dataset, &photos, bytes)?;
            self.prepare(&steps, self.restart)?;
            OutputArgs::default().make_folder(&self.output.join(TRIALS), &Inputs::default())?;
            self.go(&steps, 0, steps.len() + STEPS)?;
            sh_degree = self.best()?;
        }
        let trials = steps.len();
        steps.extend(self.steps(&path, &dataset, &photos, bytes, sh_degree)?);
        self.prepare(&steps, self.restart && !chooses)?;
        self.go(&steps, trials, steps.len())?;
        self.tell(&steps, began)
    }

    /// Whether trials choose the degree.
    fn chooses(&self, dataset: &Dataset) -> bool {
        // A single photo leaves none to test on, and a plan decides the photos of its parts.
        let can = dataset.part.is_none() && dataset.split(Split::Train).count() > 1;
        can && self.sh_degree.is_none() && self.has_time_for_trials()
    }

    fn has_time_for_trials(&self) -> bool {
        self.time.is_none_or(|time| time / TRIAL >= LEAST_TRIAL_TIME)
    }

    /// Runs all steps from `first` on that are not done.
    fn go(&self, steps: &[Step], first: usize, all: usize) -> Outcome {
        let before = steps.iter().take_while(|step| step.done.exists()).count();
        for (i, step) in steps.iter().enumerate().skip(first) {
            let (line, is_done) = (line_of(&step.arguments), i < before);
            let state = if is_done { " done before" } else { "" };
            progress::tell_run(format_args!("{}/{all}{state}: {line}", i + 1));
            if !is_done {
                step.run(self.restart)?;
            }
        }
        Ok(())
    }

    /// Short runs with harmonics of several degrees in the same bytes, tested on photos left out of the training photos.
    fn trials(&self, path: &Path, dataset: &Dataset, photos: &PhotoArgs, bytes: u64) -> Result<Vec<Step>> {
        let mut steps = Vec::new();
        for degree in DEGREES {
            let [ply, trained, found] = ["ply", "train.json", "json"].map(|ending| self.trial(degree, ending));
            let gaussians = (bytes / gaussian_bytes(degree, false)).clamp(1, u32::MAX.into()) as u32;
            let length = match self.time {
                Some(time) => ["--time".into(), format!("{:.1}s", time.as_secs_f64() / f64::from(TRIAL))],
                None => ["--iterations".into(), (self.preset.steps() / TRIAL).max(LEAST_TRIAL).to_string()],
            };
            let mut train = self.training(path, dataset, degree, gaussians, length);
            train.extend(words(["-o"], [&ply]));
            let mut eval = words(["eval"], [&ply, &path.to_owned()]);
            for to in [&mut train, &mut eval] {
                to.extend(self.device.arguments().into_iter().chain(photos.tuned().arguments()));
            }
            steps.push(Step { arguments: train, done: trained, added: &["--force", "--json"] });
            steps.push(Step { arguments: eval, done: found, added: &["--json"] });
        }
        Ok(steps)
    }

    /// A file of the trial with this degree.
    fn trial(&self, degree: u32, ending: &str) -> PathBuf {
        self.output.join(TRIALS).join(format!("degree-{degree}.{ending}"))
    }

    /// The degree that the trials choose.
    fn best(&self) -> Result<u32> {
        let mut found = Vec::new();
        for degree in DEGREES {
            let quality = &read_json(&self.trial(degree, "json"))?["augmented"];
            found.push((degree, quality["psnr"].as_f64().unwrap_or(f64::NAN)));
        }
        let best = best_degree(&found);
        let all: Vec<String> = found.iter().map(|(degree, psnr)| format!("degree {degree} has {psnr:.2} dB")).collect();
        progress::tell_run(format_args!("the trials choose degree {best}: {}", all.join(", ")));
        Ok(best)
    }

    /// Arguments that train a base.
    fn training(
        &self,
        path: &Path,
        dataset: &Dataset,
        sh_degree: u32,
        gaussians: u32,
        length: [String; 2],
    ) -> Vec<OsString> {
        let mut train = words(["train"], [path]);
        let (degree, most) = (sh_degree.to_string(), gaussians.to_string());
        train.extend(["--sh-degree", &degree, "--gaussians", &most].map(OsString::from));
        train.extend(length.map(OsString::from));
        // The strategy places the other half where errors are large.
        let points = dataset.points.as_ref().map_or(0, |points| points.positions.len());
        if points > gaussians as usize / 2 {
            train.extend(["--points".into(), (gaussians / 2).max(1).to_string().into()]);
        }
        train
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

    /// Size of the scene if none is given. Constant colors, which are taken if no degree is given, take fewer bytes, so the number of
    /// Gaussians is limited by itself.
    fn default_bytes(&self, dataset: &Dataset) -> Outcome<u64> {
        let pixels = dataset.split(Split::Train).map(|(_, photo)| u64::from(photo.camera.pixels())).sum();
        let points = dataset.points.as_ref().map_or(0, |points| points.positions.len());
        let sh_degree = self.sh_degree.unwrap_or(0);
        let fit = self.device.with_unchecked(|context| {
            Ok(fit(context.memory_at_most(), learning_bytes(sh_degree, false, true).iter().sum(), pixels))
        })?;
        let most = fit.min(most_gaussians(pixels).max(points)) as u64;
        let all = default_gaussians(points, pixels) as u64 * gaussian_bytes(3, false);
        Ok(all.min(most * gaussian_bytes(sh_degree, false)))
    }

    fn steps(
        &self,
        path: &Path,
        dataset: &Dataset,
        photos: &PhotoArgs,
        bytes: u64,
        sh_degree: u32,
    ) -> Result<[Step; STEPS]> {
        let at = |name: &str| self.output.join(name);
        let [base, scene, trained, enhanced] = [BASE, SCENE, TRAINED, ENHANCED].map(at);
        let named = |name: &str, path: &Path| [OsString::from(name), path.into()].join(OsStr::new("="));
        let (gaussians, left) = shares(bytes, sh_degree)?;
        let mut enhance = words(["enhance"], [path]);
        enhance.extend(words(["--base"], [&base]).into_iter().chain(words(["-o"], [&scene])));
        let length = match self.time {
            Some(time) => {
                let trials = if self.chooses(dataset) { DEGREES.len() as f64 / f64::from(TRIAL) } else { 0.0 };
                let left = (1.0 - trials) * time.as_secs_f64();
                let [train_for, enhance_for] = TIME.map(|share| format!("{:.1}s", share * left));
                enhance.extend(["--time".into(), enhance_for.into()]);
                ["--time".into(), train_for]
            }
            None => ["--iterations".into(), self.preset.steps().to_string()],
        };
        let mut train = self.training(path, dataset, sh_degree, gaussians, length);
        train.extend(words(["-o"], [&base]));
        enhance.extend(["--bytes".into(), left.to_string().into()]);
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
        Ok([
            step(train, trained, &["--force", "--json"]),
            step(enhance, enhanced, &["--force", "--json"]),
            step(report, at(REPORT).join(PAGE), &["--force"]),
            step(export, at(VIEWER), &["--force"]),
        ])
    }

    /// Prepares the folder for these steps, or finds that it has them already. Those that are new there are not done.
    ///
    /// # Errors
    /// [`Error::Input`] if the folder has other steps or foreign files, unless the run is to start over.
    fn prepare(&self, steps: &[Step], restart: bool) -> Result<()> {
        let path = self.output.join(COMMANDS);
        let lines: Vec<String> = steps.iter().map(|step| line_of(&step.arguments)).collect();
        let read = fs::read(&path).ok().map(|text| serde_json::from_slice(&text).unwrap_or(Value::Null));
        let found = read.as_ref().and_then(|read| read["commands"].as_array()).map_or(&[][..], Vec::as_slice);
        let other = found.iter().zip(&lines).find(|(found, line)| **found != **line);
        let other = match (&read, other) {
            _ if restart => None,
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
        let known = if restart { 0 } else { found.len() };
        if known < lines.len() {
            steps[known..].iter().for_each(|step| drop(fs::remove_file(&step.done)));
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
            (self.output.join(SCENE), "the scene; glint convert writes it in other formats"),
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

/// Number of Gaussians of the base, and the bytes left for the augmentation.
fn shares(bytes: u64, sh_degree: u32) -> Result<(u32, u64)> {
    let (one, share) = (gaussian_bytes(sh_degree, false), BASE_BYTES[usize::from(sh_degree > 0)]);
    let gaussians = (share * bytes as f64) as u64 / one;
    if gaussians == 0 {
        let what = format!("a scene of {bytes} bytes has no room for a base, because a Gaussian takes {one} (--bytes)");
        return Err(Error::Usage(what));
    }
    Ok((gaussians.min(u32::MAX.into()) as u32, bytes - gaussians * one))
}

/// The degree with the highest PSNR, dB, in the trials; constant colors unless another is better by [`MARGIN_DB`].
fn best_degree(found: &[(u32, f64)]) -> u32 {
    let handicap = |&(degree, psnr): &(u32, f64)| if degree > 0 { psnr - MARGIN_DB } else { psnr };
    found.iter().max_by(|a, b| handicap(a).total_cmp(&handicap(b))).map_or(0, |&(degree, _)| degree)
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
    fn a_degree_above_0_must_be_better_by_the_margin() {
        let best = |psnr: [f64; 3]| best_degree(&DEGREES.into_iter().zip(psnr).collect::<Vec<_>>());
        assert_eq!(best([30.0, 30.4, 29.0]), 0);
        assert_eq!(best([30.0, 30.6, 29.0]), 1);
        assert_eq!(best([30.0, 30.6, 31.0]), 3);
    }

    #[test]
    fn bytes_are_shared_between_base_and_augmentation() {
        assert_eq!(shares(1_000_000, 0).unwrap(), (9_558, 1_000_000 - 9_558 * 68));
        assert_eq!(shares(1_000_000, 3).unwrap(), (3_629, 1_000_000 - 3_629 * 248));
        assert!(shares(100, 0).unwrap_err().to_string().contains("a Gaussian takes 68"));
    }
}
