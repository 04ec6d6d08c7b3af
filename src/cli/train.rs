//! `glint train`: trains a base scene. This file has the options and the setup of a run; `first` has the
//! initial Gaussians, `course` the training loop.

use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use course::{At, Clocks, Course, Training};
pub(super) use first::fit;
use first::{First, checksum};
use serde::Serialize;
use serde_json::json;
use storage::{GaussiansOn, PhotosOn, PlaceArgs};

use super::{
    CommonArgs, Look, Outcome, SceneArgs, WatchArgs, Watched, counted,
    dataset::{check_sight, upload},
    deadline::{Deadline, FIRST, MOST},
    history::History,
    interrupt::Interrupt,
    kept::{KeepArgs, Kept, settings},
    lock::Lock,
    output::{Inputs, OutputArgs, check_room},
    progress::{Progress, note},
    tell_run, units,
};
use crate::{
    Error, Result,
    data::{Dataset, Photo, Split, TrainedWith, gaussian_bytes},
    gpu::Context,
    pipelines::{
        checkpoint::Clock,
        classes::{self, Classes},
        density::Strategy,
        learn::learning_bytes,
        session::Policy,
        start::{halvings_for, photos_of},
        train::{BaseOptions, HALVED_UNTIL, VARIED_NTH},
    },
    report::runs::StageMean,
    scene::{Scene, color},
    stages::constants::density::SCORES,
};

mod course;
mod first;
pub(super) mod storage;

const EXAMPLES: &str = "\
Gaussians start at the dataset's sparse points, or at random points if there are none. The default --strategy adds more where \
errors are large, up to --gaussians, and moves transparent ones there. Only training photos are used.

A checkpoint is saved next to the output every minute, on an error and on Ctrl-C (base.checkpoint.safetensors for base.ply). \
The same command resumes from it, gives the same scene as an uninterrupted run, and removes it at the end. With --time it \
resumes for the time that was left. --restart starts over and renames the checkpoint to base.checkpoint.safetensors.old.

--eval-every writes base.history.jsonl next to base.ply, with a JSON object on each line (the fields of glint report \
--history, step and loss), and base.history/step-NNNNNN.png: the first test photo, its render and its error.

Examples:
  glint train garden -o base.ply
  glint train garden -o base.ply --time 5m --gaussians 300000
  glint train garden -o base.ply --eval-every 1000
  glint train garden -o base.ply --exposure
  glint train garden -o better.ply --init base.ply --iterations 7000
  glint train garden -o base.ply --points 100000 --gaussians 300000 --iterations 7000
  glint train lego -o base.ply --iterations 7000 --max-size 400 --json > report.json";

/// A submission takes at most 1/40 of a run's time, because two are still running when the time ends.
const SUBMISSIONS: u32 = 40;
/// Minimum speed of writing a scene, bytes per second, except on slow disks.
const WRITTEN_PER_SECOND: f64 = 2e8;
/// Size of a Gaussian's scores in a checkpoint, bytes.
const SCORE_BYTES: u64 = 4 * SCORES as u64;
/// Larger requests for Gaussians are compared with the device's memory before anything is allocated.
const MANY: u32 = 1 << 20;

/// Train a base scene on photos
// Serialized into the settings of a checkpoint. A new option becomes part of them unless it is skipped.
#[derive(Debug, clap::Args, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder or JSON file of the dataset
    #[serde(skip)]
    dataset: PathBuf,
    /// Output PLY file
    #[arg(short, long, value_name = "PLY")]
    #[serde(skip)]
    output: PathBuf,
    /// Number of steps, one photo each, such as 7000 or 7k
    #[arg(long, value_name = "N", default_value_t = BaseOptions::default().iterations, value_parser = units::count(1..=MOST), alias = "steps")]
    iterations: u32,
    /// Train for this time instead of a number of steps: 90s, 5m, 1.5h, including the reading of photos.
    /// glint derives the number of steps from their duration, and all schedules end with the last step.
    /// Evaluations by --eval-every come on top. Two runs differ
    #[arg(long, value_name = "TIME", value_parser = units::duration, conflicts_with = "iterations")]
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "in_seconds")]
    time: Option<Duration>,
    /// Evaluate on the test photos after every N steps and at the end
    #[arg(long, value_name = "N", value_parser = units::count(1..=u32::MAX))]
    #[serde(skip)]
    eval_every: Option<u32>,
    #[command(flatten)]
    #[serde(flatten)]
    model: ModelArgs,
    /// Learn an affine color map for each training photo, for photos of changing exposure or white balance.
    /// The mean of all maps stays the identity; test photos, eval and render use none
    #[arg(long)]
    exposure: bool,
    /// Train on downscaled photos at first, with sides halved up to N times: for 2, a quarter of their
    /// sides until 30 % of the run, half until 70 % [default: 2, as far as longer sides keep 128 pixels; 0
    /// with mcmc and adc]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=HALVED_UNTIL.len() as i64))]
    #[serde(skip)]
    halvings: Option<u32>,
    #[command(flatten)]
    #[serde(skip)]
    place: PlaceArgs,
    /// Seed of random points and of the order of photos; the same seed and device give the same scene
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Print JSON with the counts, the speed and the device time of each stage
    #[arg(long)]
    #[serde(skip)]
    json: bool,
    #[command(flatten)]
    #[serde(skip)]
    keep: KeepArgs,
    #[command(flatten)]
    #[serde(skip)]
    watch: WatchArgs,
    #[command(flatten)]
    #[serde(skip)]
    replace: OutputArgs,
    #[command(flatten)]
    #[serde(skip)]
    common: CommonArgs,
}

/// Options of the Gaussians: their colors, initial values and number.
#[derive(Debug, clap::Args, Serialize)]
#[serde(rename_all = "kebab-case")]
struct ModelArgs {
    /// Degree of the spherical harmonics, 0 to 3
    #[arg(long, value_name = "L", default_value_t = BaseOptions::default().sh_degree, value_parser = clap::value_parser!(u32).range(0..=3))]
    sh_degree: u32,
    /// Color model
    #[arg(long, value_enum, default_value_t)]
    #[serde(skip_serializing_if = "is_default")]
    color: ColorArg,
    /// Number of Gaussians at the start: a random subset of the sparse points, or random points if there
    /// are none. Fewer train faster [default: all sparse points; without any, a quarter of --gaussians, or
    /// one for each pixel of the largest photo, at most 25000; four times as many random ones if the
    /// strategy is not budget]
    #[arg(long, value_name = "N", value_parser = units::count(1..=u32::MAX))]
    points: Option<u32>,
    /// Start from this file instead of the dataset's points: a PLY of points (and their colors), or the
    /// Gaussians of any scene or checkpoint
    #[arg(long, value_name = "FILE")]
    #[serde(skip)]
    init: Option<PathBuf>,
    #[command(flatten)]
    #[serde(skip)]
    lenient: SceneArgs,
    /// Maximum number of Gaussians; the default strategy grows to this number [default: 4× the initial
    /// number, clamped to between one per 256 and one per 16 training pixels, and to the device's memory;
    /// the initial number with --strategy fixed or a scene as --init]
    #[arg(long, value_name = "N", value_parser = units::count(1..=u32::MAX), alias = "cap-max")]
    gaussians: Option<u32>,
    /// Maximum size of the Gaussians in the file, such as 25MB, instead of their number and the degree of
    /// their harmonics. All learn bands of harmonics; their number follows from how many need them. Near the
    /// end of the run the others lose theirs, so that until then the scene is up to 4.2 times as large. Viewers
    /// that do not know this format show constant colors
    #[arg(long, value_name = "BYTES", value_parser = units::bytes, conflicts_with_all = ["gaussians", "sh_degree"])]
    #[serde(skip_serializing_if = "Option::is_none")]
    bytes: Option<u64>,
    /// Strategy that prunes and multiplies Gaussians
    #[arg(long, value_enum, default_value_t)]
    strategy: Strategy,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
enum ColorArg {
    /// Spherical harmonics of --sh-degree
    #[default]
    Sh,
    /// Two spherical betas, as in DBS; needs --strategy mcmc or adc
    Sb,
}

fn in_seconds<S: serde::Serializer>(time: &Option<Duration>, to: S) -> Result<S::Ok, S::Error> {
    time.map(|time| time.as_secs_f64()).serialize(to)
}

fn is_default(color: &ColorArg) -> bool {
    *color == ColorArg::default()
}

/// Content of `--json`.
#[derive(Serialize)]
struct Report<'a> {
    output: &'a str,
    device: &'a str,
    photos: usize,
    gaussians: usize,
    /// Degree of the harmonics; `None` for other color models.
    sh_degree: Option<u32>,
    /// With --bytes: Gaussians that keep bands of this degree; the others have none.
    #[serde(skip_serializing_if = "Option::is_none")]
    banded: Option<usize>,
    #[serde(flatten)]
    length: Length,
    seed: u64,
    /// Number of times that the sides of photos were halved at first.
    halvings: u32,
    /// Width × height of a tile, pixels.
    tile: String,
    /// Time of the training loop in this run, without evaluations.
    seconds: f64,
    steps_per_second: f64,
    /// Mean over the last pass through the photos.
    final_loss: f64,
    /// With --exposure: the largest difference between an entry of a photo's map and the identity.
    #[serde(skip_serializing_if = "Option::is_none")]
    largest_exposure: Option<f32>,
    #[serde(flatten)]
    costs: Costs,
}

/// Steps of the run.
#[derive(Serialize)]
struct Length {
    iterations: u32,
    /// Steps done by an earlier run; included in `iterations`.
    iterations_resumed: u32,
}

/// Device memory and times of the steps.
#[derive(Serialize)]
struct Costs {
    /// Peak device memory, MB.
    device_megabytes: f64,
    /// Buffers in the host's memory; part of `device_megabytes` if the device shares it.
    host_megabytes: f64,
    /// Number of times that a buffer overflowed and was grown.
    buffers_grown: u32,
    /// Stages in the order of their first run; empty if the device has no timestamps.
    stages: Vec<StageMean>,
}

/// Inputs read before a device is opened.
struct Read<'a> {
    /// Start of reading.
    began: Instant,
    dataset: &'a Dataset,
    photos: Vec<&'a Photo>,
    /// Test photos, with --eval-every.
    test: Option<Vec<&'a Photo>>,
    /// Name of the selection of test photos.
    holdout: String,
    policy: Policy,
    trained_with: TrainedWith,
    inputs: Inputs,
    replace: OutputArgs,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        self.check_color()?;
        let began = Instant::now();
        let init = self.init_scene()?;
        let (mut photo_args, mut draw) = (self.common.photos.clone(), self.common.draw);
        if let (Some(file), Some(path)) = (&init, &self.model.init) {
            (photo_args, draw) = (photo_args.like(file.trained_with, path), draw.like(file.trained_with, path));
        }
        let policy = draw.policy();
        let exposure = self.exposure.then_some(true);
        let mut dataset = photo_args.open_with_options(&self.dataset)?.0;
        let part = dataset.part;
        if self.exposure && part.is_some() {
            let what = "--exposure cannot be combined with --part, because each part would choose its own mean exposure; \
                        train without --exposure";
            return Err(Error::Usage(what.into()).into());
        }
        let trained_with = TrainedWith { exposure, part, ..photo_args.trained_with(policy.compensate) };
        self.check_asked(&dataset)?;
        let mut inputs = Inputs::default().dataset(&dataset);
        if let Some(init) = &self.model.init {
            inputs = inputs.scene(init);
        }
        let replace = self.replace.or(KeepArgs::owns(&self.output));
        replace.check_ply(&self.output, &inputs)?;
        let _ours = Lock::take(&self.output)?;
        let first = self.first(&mut dataset, init)?;
        let photos = photos_of(&dataset, Some(Split::Train))?;
        let test = self.eval_every.map(|_| photos_of(&dataset, Some(Split::Test))).transpose()?;
        check_sight(&dataset, first.origin, &first.gaussians.means)?;
        self.tell(&first, &dataset);
        let run = Watched {
            device: &self.common.device,
            dataset: &dataset,
            policy,
            background: dataset.background,
            output: &self.output,
        };
        let holdout = photo_args.holdout();
        let read = Read { began, dataset: &dataset, photos, test, holdout, policy, trained_with, inputs, replace };
        self.watch.with(&run, |context, look_at| self.train(context, look_at, read, first))
    }

    /// Prints notes on the initial Gaussians and the cameras.
    fn tell(&self, first: &First, dataset: &Dataset) {
        first.notes.iter().for_each(|text| note(text.as_str()));
        let sh_degree = self.degree();
        if sh_degree < 3 && self.model.bytes.is_none() {
            let bands: Vec<String> = (sh_degree + 1..=3).map(|band| band.to_string()).collect();
            note(format!("SH degree {sh_degree}: bands {} are not stored", bands.join(", ")));
        }
        if dataset.extent() as f32 == 0.0 {
            note("all training cameras are at one place, which gives no scale: positions do not learn");
        }
    }

    /// Trains on the inputs and writes the scene.
    fn train(&self, context: &Context, look_at: &mut Look<'_>, read: Read<'_>, mut first: First) -> Outcome {
        let Read { began, dataset, photos, test, holdout, policy, trained_with, inputs, replace } = read;
        let pixels: u64 = photos.iter().map(|photo| u64::from(photo.camera.pixels())).sum();
        let (on, gaussians_on) = self.choose_places(context, &mut first, pixels);
        let mut course = self.course(&first, &photos, gaussians_on);
        // The check comes after memory has limited the number of Gaussians.
        let control = course.density(self.iterations);
        let most = course.most.max(course.first);
        let size = self.model.bytes.unwrap_or(u64::from(most) * gaussian_bytes(course.sh_degree, false));
        check_room(
            &self.output,
            size + on.file_bytes(pixels),
            self.kept_bytes(most, test.as_deref().unwrap_or_default()),
        )?;
        let session =
            self.common.learn.session(context, policy, dataset.background, dataset.extent() as f32, self.seed);
        let (views, checksums) =
            upload(context, &photos, dataset.background, course.halvings, on.storage(&self.output)?, !self.exposure)?;
        self.tell_memory(
            if on == PhotosOn::Device { pixels } else { 0 },
            most,
            gaussians_on,
            course.halvings,
            views.are_transparent(),
        );

        let mut base = first.gaussians;
        let beginning = checksum(&base);
        if course.begins == 0.0 {
            control.begin(&mut base);
        }
        let scene = Scene { base, origin: first.origin, ..Scene::default() };
        let mut iterations = if self.time.is_some() { FIRST } else { self.iterations };
        let cost = course.cost(iterations);
        let bar = Progress::of_cost("training", "steps", iterations.into(), cost);
        let started = Instant::now();
        let points = ("points", json!({"count": course.first, "crc32": beginning}));
        let meaning = format!("{:?} {:?} {}", course.options(iterations), course.density(iterations), course.halvings);
        let settings = settings(&session, &photos, &checksums, self, &meaning, points)?;
        let mut kept = Kept::new(&self.output, settings, &self.keep, trained_with);
        let found = kept.find()?;
        let clock = found.as_ref().and_then(|found| found.clock);
        if let Some(Clock { total, .. }) = clock {
            iterations = total;
        }
        course.classes = found.as_ref().and_then(Classes::of);
        let (model, mut trainer) = course.engine(self, &session, &views, &scene, iterations)?;
        let resumed = found.as_ref().map_or(0, |found| found.step);
        let had = clock.map_or(resumed, |clock| clock.taken);
        let goes_on = clock.map(|clock| (clock, resumed));
        let deadline = self.time.map(|time| self.deadline(time, began, size, goes_on));
        let mut deadline = deadline.transpose()?;
        if let Some(deadline) = &mut deadline {
            deadline.costs(cost);
        }
        let mut history =
            test.map(|test| History::new(context, &self.output, test, dataset.background, self.seed, holdout));
        if let Some(history) = &mut history {
            history.begin(found.as_ref().map(|_| had), &replace, &inputs)?;
        }
        // Stages are timed for --json and -v.
        let timed = self.json || tracing::enabled!(tracing::Level::INFO);
        match &found {
            Some(checkpoint) => trainer.resume(&model, checkpoint, timed)?,
            None => trainer.start(timed)?,
        }
        drop(found);
        let length = self.time.map_or_else(|| counted(iterations as usize, "step"), |time| format!("{time:?}"));
        tell_run("training", context, &photos, format_args!("{} to {most} Gaussians, {length}", course.first));
        bar.goes_on_from(had.into());
        let interrupt = Interrupt::default();
        interrupt.listen()?;
        let at = At { done: resumed, total: iterations, taken: had };
        let spent = clock.map_or(Duration::ZERO, |clock| Duration::from_millis(clock.milliseconds));
        let clocks = Clocks { began, started, spent, evaluating: Duration::ZERO };
        let mut training = Training {
            args: self,
            session: &session,
            model,
            views: &views,
            course,
            trainer,
            kept,
            trained_with,
            history,
            deadline,
            bar,
            at,
            clocks,
            timed,
        };
        match training.drive(&interrupt, look_at) {
            Ok(counts) => training.finish(had, counts, interrupt),
            Err(error) => Err(training.fail(error).into()),
        }
    }

    /// The course of a run from these Gaussians.
    fn course(&self, first: &First, photos: &[&Photo], on: GaussiansOn) -> Course {
        let is_newton = self.model.strategy.is_newton();
        Course {
            sh_degree: self.degree(),
            begins: first.begins,
            strategy: self.model.strategy,
            first: first.gaussians.len() as u32,
            most: first.most as u32,
            halvings: self.halvings.unwrap_or_else(|| if is_newton { halvings_for(photos) } else { 0 }),
            bytes: self.model.bytes,
            host: on == GaussiansOn::Host,
            classes: None,
        }
    }

    /// Logs the expected device memory, with photos of `pixels` in it.
    fn tell_memory(&self, pixels: u64, most: u32, gaussians_on: GaussiansOn, halvings: u32, transparent: bool) {
        let megabytes = |bytes: u64| bytes as f64 / 1e6;
        if pixels > 0 {
            tracing::info!("on the device: {:.1} MB of photos", megabytes(4 * pixels));
        }
        if transparent {
            tracing::info!("transparent photos: one step in {VARIED_NTH} shows them over a random color");
        }
        if halvings > 0 {
            let times = if halvings == 1 { "once" } else { "twice" };
            tracing::info!("training starts on photos with sides halved {times}");
        }
        let bytes = u64::from(most) * self.device_bytes(gaussians_on == GaussiansOn::Host);
        tracing::info!("on the device: {:.1} MB for {most} Gaussians", megabytes(bytes));
    }

    /// Device memory of a Gaussian that learns, bytes; with `host` without what lies in the host's memory.
    fn device_bytes(&self, host: bool) -> u64 {
        let [geometry, others] = self.learning_bytes();
        if host { geometry } else { geometry + others }
    }

    /// Bytes of a Gaussian that learns: its geometry, and its color and moments.
    fn learning_bytes(&self) -> [u64; 2] {
        let packed = self.common.learn.precision == super::Precision::Half;
        learning_bytes(self.degree(), packed, self.model.strategy.is_newton())
    }

    /// Deadline of a run of length `time`, which began reading at `began`, minus the time to write a scene of
    /// `size` bytes. A resumed run has the time that was left, possibly none.
    fn deadline(&self, time: Duration, began: Instant, size: u64, goes_on: Option<(Clock, u32)>) -> Result<Deadline> {
        let writing = Duration::from_secs_f64(size as f64 / WRITTEN_PER_SECOND).min(time / 10);
        let (now, left) = (Instant::now(), time - writing);
        if let Some((Clock { total, milliseconds, .. }, step)) = goes_on {
            let left = left.saturating_sub(Duration::from_millis(milliseconds));
            return Ok(Deadline::of(now, began + left, total, step));
        }
        if now >= began + left {
            let passed = (now - began).as_secs_f64();
            let what = "expected more time, since a scene takes hundreds of steps";
            return Err(Error::Usage(format!(
                "--time {time:?}: no time is left for a step, because {passed:.1} s passed before the first; {what}"
            )));
        }
        Ok(Deadline::new(now, began + left))
    }

    /// Color model at the start: a degree of harmonics, or betas.
    fn degree(&self) -> u32 {
        match (self.model.color, self.model.bytes) {
            (ColorArg::Sb, _) => color::BETAS,
            (ColorArg::Sh, Some(_)) => classes::DEGREE,
            (ColorArg::Sh, None) => self.model.sh_degree,
        }
    }

    fn check_color(&self) -> Result<()> {
        if self.model.bytes.is_some() && !self.model.strategy.follows_errors() {
            return Err(Error::Usage("--bytes needs --strategy budget; other strategies take --gaussians".into()));
        }
        if let Some(bytes) = self.model.bytes.filter(|&bytes| Classes::at_first(bytes) == 0) {
            let (plain, banded) = (gaussian_bytes(0, false), classes::most_bytes());
            let what = format!("--bytes {bytes}: a Gaussian takes {plain}, with bands up to {banded}; expected more");
            return Err(Error::Usage(what));
        }
        if self.model.color == ColorArg::Sh {
            return Ok(());
        }
        if self.model.strategy.is_newton() {
            return Err(Error::Usage("--color sb needs Adam: expected --strategy mcmc or adc".into()));
        }
        if self.model.sh_degree != BaseOptions::default().sh_degree {
            return Err(Error::Usage("--color sb has no harmonics: --sh-degree is for --color sh".into()));
        }
        Ok(())
    }

    /// Fails before any allocation if the requested Gaussians exceed the device's memory.
    fn check_asked(&self, dataset: &Dataset) -> Outcome {
        // Sparse points limit their own number; random points do not.
        let drawn = self.model.points.filter(|_| self.model.init.is_none() && dataset.points.is_none());
        let asked = [("--gaussians", self.model.gaussians), ("--points", drawn)];
        let most = asked.into_iter().filter_map(|(option, n)| Some((n.filter(|&n| n > MANY)?, option))).max();
        let Some((n, option)) = most else { return Ok(()) };
        self.common.device.with_unchecked(|context| {
            let (fit, bytes) = (self.gaussians_at_most(context), self.device_bytes(false));
            if u64::from(n) <= fit {
                return Ok(());
            }
            let what =
                format!("{option} {n}: memory holds {fit} Gaussians of {bytes} bytes; expected no more than that");
            Err(Error::Usage(what).into())
        })
    }

    /// Bytes on disk next to the scene: the checkpoint, twice while one replaces another, and pictures of
    /// the first test photo if their number is known.
    fn kept_bytes(&self, gaussians: u32, test: &[&Photo]) -> u64 {
        let gaussian = self.device_bytes(false) + SCORE_BYTES;
        let checkpoint = u64::from(gaussians) * gaussian + 4 * u64::from(self.iterations);
        let pictures = match (self.eval_every, test.first(), self.time) {
            (Some(every), Some(photo), None) => {
                u64::from(self.iterations.div_ceil(every)) * 3 * 3 * u64::from(photo.camera.pixels())
            }
            _ => 0,
        };
        2 * checkpoint + pictures
    }
}
