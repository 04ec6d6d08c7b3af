use std::{
    cell::Cell,
    path::PathBuf,
    time::{Duration, Instant},
};

use first::checksum;
use serde::Serialize;
use serde_json::{Value, json};

use super::{
    DeviceArgs, DrawArgs, Failure, LearnArgs, Outcome, PhotoArgs, SceneArgs, WatchArgs, Watched, counted,
    dataset::{check_sight, is_uncounted, note_uncounted},
    deadline::{Deadline, FIRST, MOST, Plan, duration},
    history::{History, Moment},
    interrupt::Interrupt,
    kept::{KeepArgs, Kept, photos_json},
    lock::Lock,
    output::{Inputs, OutputArgs, check_room},
    print, print_json,
    progress::{Progress, learned, note},
    tell_run,
};
use crate::{
    Error, Result,
    data::{Dataset, Photo, SceneFile, Split, TrainedWith, gaussian_bytes, write_scene_file},
    pipelines::{
        checkpoint::Clock,
        density::{DensityOptions, Strategy},
        exposure::IDENTITY,
        learn::learning_bytes,
        model::{Model, Room},
        render::RenderOptions,
        session::{Policy, Reduction, Session},
        start::{halvings_for, photos_of, upload_photos},
        train::{BaseOptions, HALVED_UNTIL, Trainer, dense_trainer, halvings_at},
    },
    report::runs::StageMean,
    scene::{
        Scene,
        layout::{self, BETAS, colour_name},
    },
    stages::constants::density::SCORES,
};

mod first;

const EXAMPLES: &str = "\
Gaussians start at the dataset's sparse points, or at random points if there are none. --strategy says how they go on: where \
photos are not yet met there are more, up to --gaussians, and transparent ones go. Only training photos are used.

What was learned is saved beside the output every minute, on an error and on Ctrl-C (base.checkpoint.safetensors for \
base.ply). The same command resumes there, gives the same scene as an uninterrupted run, and removes it in the end. \
With --time it goes on for the time that was left. --restart begins anew and renames the checkpoint to base.checkpoint.safetensors.old.

--eval-every writes base.history.jsonl beside base.ply, a JSON object on each line (what glint report --history reads, and step and loss), \
and base.history/step-NNNNNN.png: the first test photo, its render and their error.

Examples:
  glint train garden -o base.ply
  glint train garden -o base.ply --time 5m --gaussians 300000
  glint train garden -o base.ply --eval-every 1000
  glint train garden -o base.ply --exposure
  glint train garden -o better.ply --init base.ply --iterations 7000
  glint train garden -o base.ply --points 100000 --gaussians 300000 --iterations 7000
  glint train lego -o base.ply --iterations 7000 --max-size 400 --json > report.json";

/// A submission takes no more of a run's time than one part in so many: two of them are on their way when it is to end.
const SUBMISSIONS: u32 = 40;
/// Bytes a second that a scene is written with at least, but for a slow disk.
const WRITTEN_PER_SECOND: f64 = 2e8;
/// Of a Gaussian's scores in a checkpoint.
const SCORE_BYTES: u64 = 4 * SCORES as u64;
/// A request for more Gaussians than this is compared with the device's memory before anything is allocated.
const MANY: u32 = 1 << 20;

/// Train a base scene on photos
// Serialised into the settings of a checkpoint: an option that is new is in them unless it says that it changes nothing there.
#[derive(Debug, clap::Args, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder or JSON file of the dataset
    #[serde(skip)]
    dataset: PathBuf,
    /// PLY file to write
    #[arg(short, long, value_name = "PLY")]
    #[serde(skip)]
    output: PathBuf,
    /// Steps, one photo each
    #[arg(long, value_name = "N", default_value_t = BaseOptions::default().iterations, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST)))]
    iterations: u32,
    /// Time in place of a number of steps: 90s, 5m, 1.5h. Reading photos is part of it. How many steps there will be follows from how long
    /// they take, and all schedules end with the last. What --eval-every takes comes on top. Two runs differ
    #[arg(long, value_name = "TIME", value_parser = duration, conflicts_with = "iterations")]
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "in_seconds")]
    time: Option<Duration>,
    /// Compare with the test photos after every N steps and at the end
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    #[serde(skip)]
    eval_every: Option<u32>,
    /// Degree of the spherical harmonics, 0 to 3
    #[arg(long, value_name = "L", default_value_t = BaseOptions::default().sh_degree, value_parser = clap::value_parser!(u32).range(0..=3))]
    sh_degree: u32,
    /// How colours depend on the direction of view
    #[arg(long, value_enum, default_value_t)]
    #[serde(skip_serializing_if = "is_default")]
    color: ColorArg,
    /// Number of Gaussians at the start: a random subset if there are more sparse points, random points if there are no
    /// sparse ones. Fewer are faster [default: all sparse points, or random ones: a quarter of --gaussians, or one for each pixel of the
    /// largest photo, at most 25000; four times as many where the strategy is not budget]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    points: Option<u32>,
    /// Begin with what a file holds in place of the dataset's points: a PLY of points (and their colours), or the Gaussians of any scene or
    /// checkpoint, which then learn on
    #[arg(long, value_name = "FILE")]
    #[serde(skip)]
    init: Option<PathBuf>,
    #[command(flatten)]
    #[serde(skip)]
    lenient: SceneArgs,
    /// Gaussians at most, at the start too; the default strategy ends with as many [default: four times those of the start, but one for 16
    /// pixels of the training photos at most and one for 256 at least, and no more than find room in memory; with --strategy fixed and of a
    /// scene that --init names as many as there are]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    gaussians: Option<u32>,
    /// How Gaussians are pruned and multiplied
    #[arg(long, value_enum, default_value_t)]
    strategy: Strategy,
    /// Learn an affine map of colours for each training photo beside the scene, for photos of changing exposure or white balance. Their
    /// mean stays the identity; test photos, eval and render have none
    #[arg(long)]
    exposure: bool,
    /// Begin with photos whose sides are halved so many times, which takes less time: a quarter of their sides until 30 % of the run, half
    /// until 70 % [default: 2, as far as longer sides keep 128 pixels; 0 with mcmc and adc]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=HALVED_UNTIL.len() as i64))]
    #[serde(skip)]
    halvings: Option<u32>,
    /// Seed of the random points and of the order of photos; the same seed and device give the same scene
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Print JSON: what was done, how fast, and the device time of each stage
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
    photos: PhotoArgs,
    #[command(flatten)]
    #[serde(skip)]
    learn: LearnArgs,
    #[command(flatten)]
    #[serde(skip)]
    draw: DrawArgs,
    #[command(flatten)]
    #[serde(skip)]
    device: DeviceArgs,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, clap::ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
enum ColorArg {
    /// Spherical harmonics of --sh-degree
    #[default]
    Sh,
    /// Two spherical betas, as DBS; with --strategy mcmc or adc
    Sb,
}

fn in_seconds<S: serde::Serializer>(time: &Option<Duration>, to: S) -> Result<S::Ok, S::Error> {
    time.map(|time| time.as_secs_f64()).serialize(to)
}

fn is_default(color: &ColorArg) -> bool {
    *color == ColorArg::default()
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    output: &'a str,
    device: &'a str,
    photos: usize,
    gaussians: usize,
    /// None of spherical betas.
    sh_degree: Option<u32>,
    iterations: u32,
    /// Those of them that an earlier run did.
    iterations_resumed: u32,
    seed: u64,
    /// How often sides of photos were halved at first.
    halvings: u32,
    /// Width × height of a tile, pixels.
    tile: String,
    /// Of the training loop alone, in this run, without evaluations.
    seconds: f64,
    steps_per_second: f64,
    /// Mean over the last pass through the photos.
    final_loss: f64,
    /// With --exposure: the largest difference of an entry of a photo's map from the identity's.
    #[serde(skip_serializing_if = "Option::is_none")]
    largest_exposure: Option<f32>,
    /// The most that the device held.
    device_megabytes: f64,
    /// How often a buffer was too small and was grown.
    buffers_grown: u32,
    /// In the order in which they first run; empty where the device has no timestamps.
    stages: Vec<StageMean>,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        self.check_color()?;
        let sh_degree = self.degree();
        let began = Instant::now();
        let init = self.init_scene()?;
        let (mut photo_args, mut draw) = (self.photos.clone(), self.draw);
        if let (Some(file), Some(path)) = (&init, &self.init) {
            (photo_args, draw) = (photo_args.like(file.trained_with, path), draw.like(file.trained_with, path));
        }
        let policy = draw.policy();
        let exposure = self.exposure.then_some(true);
        let trained_with = TrainedWith { exposure, ..photo_args.trained_with(policy.compensate) };
        let mut dataset = photo_args.open(&self.dataset)?;
        self.check_asked(&dataset)?;
        let mut inputs = Inputs::default().dataset(&dataset);
        if let Some(init) = &self.init {
            inputs = inputs.scene(init);
        }
        let replace = self.replace.or(KeepArgs::owns(&self.output));
        replace.check_ply(&self.output, &inputs)?;
        let _ours = Lock::take(&self.output)?;
        let mut first = self.first(&mut dataset, init)?;
        let photos = photos_of(&dataset, Some(Split::Train))?;
        let test = self.eval_every.map(|_| photos_of(&dataset, Some(Split::Test))).transpose()?;
        let (count, begins) = (first.gaussians.len(), first.begins);
        let own = || if self.strategy.is_newton() { halvings_for(&photos) } else { 0 };
        let halvings = self.halvings.unwrap_or_else(own);
        let options = |iterations| BaseOptions { iterations, sh_degree, begins };
        check_sight(&dataset, first.origin, &first.gaussians.means)?;
        first.notes.drain(..).for_each(note);
        if sh_degree < 3 {
            let bands: Vec<String> = (sh_degree + 1..=3).map(|band| band.to_string()).collect();
            note(format!("SH degree {sh_degree}: bands {} are not stored", bands.join(", ")));
        }
        let extent = dataset.extent() as f32;
        if extent == 0.0 {
            note("all training cameras stand at one place, which gives no scale: positions are not learned");
        }
        let run = Watched {
            device: &self.device,
            dataset: &dataset,
            policy,
            background: dataset.background,
            output: &self.output,
        };
        self.watch.with(&run, |context, look_at| {
            let (background, seed) = (dataset.background, self.seed);
            let packed = self.learn.precision == super::Precision::Half;
            let bytes = learning_bytes(sh_degree, packed, self.strategy.is_newton());
            let pixels: u64 = photos.iter().map(|photo| u64::from(photo.camera.pixels())).sum();
            if self.gaussians.is_none() {
                first.fit(context, bytes, pixels).into_iter().for_each(note);
            }
            let density = |iterations| self.density([count, first.most], iterations);
            // A disk needs room for what memory leaves of them.
            let control = density(self.iterations);
            let scene = u64::from(control.limit) * gaussian_bytes(sh_degree, false);
            check_room(&self.output, scene, self.kept_bytes(&control, test.as_deref().unwrap_or_default()))?;
            let session = self.learn.session(context, policy, background, extent, seed);
            let reading = Progress::new("reading", "photos", photos.len() as u64);
            let (mut checksums, mut uncounted) = (Vec::with_capacity(photos.len()), 0);
            let views = upload_photos(context, &photos, background, halvings, |done, words| {
                checksums.push(crc32fast::hash(bytemuck::cast_slice(words)));
                uncounted += usize::from(is_uncounted(words));
                reading.set(done as u64);
            })?;
            drop(reading);
            note_uncounted(uncounted);
            let megabytes = |bytes: u64| bytes as f64 / 1e6;
            tracing::info!("on the device: {:.1} MB of photos", megabytes(4 * pixels));
            if halvings > 0 {
                tracing::info!("photos are seen with sides halved {} at first", times(halvings));
            }
            let mut iterations = if self.time.is_some() { FIRST } else { self.iterations };
            let control = density(iterations);
            let most = control.limit.max(count as u32);
            let scene = u64::from(most) * bytes;
            tracing::info!("on the device: {:.1} MB for {most} Gaussians and their moments", megabytes(scene));
            let mut base = first.gaussians;
            let beginning = checksum(&base);
            if begins == 0.0 {
                control.begin(&mut base);
            }
            let scene = Scene { base, supplement: None, origin: first.origin };
            let room = Room { base: control.limit.saturating_sub(count as u32), ..Default::default() };
            let model = Model::upload_around(context, views.origin, &scene, room)?;
            // For --json and -v.
            let timed = self.json || tracing::enabled!(tracing::Level::INFO);
            let whole = options(1);
            let cost = move |part| step_cost(halvings_at(whole.part_of(part), halvings), control.share(part));
            let training = Progress::of_cost("training", "steps", iterations.into(), cost);
            let started = Instant::now();
            let settings = self.settings(
                &photos,
                &checksums,
                [count as u32, beginning, halvings],
                &session,
                &options(iterations),
                &control,
            )?;
            let mut kept = Kept::new(&self.output, settings, &self.keep, trained_with);
            let found = kept.find()?;
            let clock = found.as_ref().and_then(|found| found.clock);
            if let Some(Clock { total, .. }) = clock {
                iterations = total;
            }
            let mut trainer = dense_trainer(&session, &model, &views, &options(iterations), &control)?;
            if self.exposure {
                trainer.correct_exposure(&session, &views)?;
            }
            let resumed = found.as_ref().map_or(0, |found| found.step);
            let had = clock.map_or(resumed, |clock| clock.taken);
            let goes_on = clock.map(|clock| (clock, resumed));
            let deadline = self.time.map(|time| self.deadline(time, began, control.limit, goes_on));
            let mut deadline = deadline.transpose()?;
            if let (Some(deadline), Some(time)) = (&mut deadline, self.time) {
                deadline.costs(cost);
                trainer.submit_at_most(time / SUBMISSIONS);
            }
            let mut history =
                test.map(|test| History::new(context, &self.output, test, background, seed, photo_args.holdout()));
            if let Some(history) = &mut history {
                history.begin(found.as_ref().map(|_| had), &replace, &inputs)?;
            }
            match &found {
                Some(checkpoint) => trainer.resume(&model, checkpoint, timed)?,
                None => trainer.start(timed)?,
            }
            drop(found);
            let length = match self.time {
                Some(time) => format!("{} s", time.as_secs_f64()),
                None => counted(iterations as usize, "step"),
            };
            tell_run("training", context, &photos, format_args!("{count} to {most} Gaussians, {length}"));
            training.goes_on_from(had.into());
            let interrupt = Interrupt::default();
            interrupt.listen()?;
            let (mut gaussians, evaluating) = (0, Cell::new(Duration::ZERO));
            let mut at = At { done: resumed, total: iterations, taken: had };
            let pass_loss = |pass: &[f32]| pass.iter().map(|&l| f64::from(l)).sum::<f64>() / pass.len().max(1) as f64;
            let spent = clock.map_or(Duration::ZERO, |clock| Duration::from_millis(clock.milliseconds));
            let keep = |trainer: &mut Trainer, at: At| {
                let mut checkpoint = trainer.checkpoint(&model, &views)?;
                let milliseconds = (spent + began.elapsed().saturating_sub(evaluating.get())).as_millis() as u64;
                let At { total, taken, .. } = at.after(checkpoint.step);
                checkpoint.clock = self.time.map(|_| Clock { total, taken, milliseconds });
                Ok(checkpoint)
            };
            let mut train = || -> Result<()> {
                // How long it took. A step is looked at once, also if the run begins or ends there.
                let mut look = |at: At, trainer: &Trainer, scene: &Scene| -> Result<Duration> {
                    let Some(history) = history.as_mut().filter(|history| !history.has(at.taken)) else {
                        return Ok(Duration::ZERO);
                    };
                    let (seconds, began) = ((started.elapsed() - evaluating.get()).as_secs_f64(), Instant::now());
                    let losses = trainer.losses(at.done);
                    let loss = pass_loss(&losses[losses.len().saturating_sub(photos.len())..]);
                    let bytes = scene.base.len() as u64 * gaussian_bytes(sh_degree, false);
                    let options = RenderOptions { policy, ..Default::default() };
                    history.add(scene, Moment { step: at.taken, seconds, bytes, loss }, options)?;
                    let took = began.elapsed();
                    evaluating.set(evaluating.get() + took);
                    Ok(took)
                };
                let evaluation = |after: u32| self.eval_every.map(|every| (after / every + 1).saturating_mul(every));
                let mut looks_at = evaluation(at.taken);
                // A run that ended just when it was to be looked at is looked at now.
                let due = |every| had > 0 && at.is_going_on() && had.is_multiple_of(every);
                if self.eval_every.is_some_and(due) {
                    look(at, &trainer, &model.download()?)?;
                }
                while !interrupt.asked() {
                    let stop = looks_at.map_or(at.total, |next| at.total.min(at.done + (next - at.taken)));
                    let in_time = deadline.as_ref().map_or(stop, |deadline| deadline.last(at.done, Instant::now()));
                    trainer.go_on_to(stop.min(in_time));
                    if let Some(done) = trainer.advance(&model, &views)? {
                        at = at.after(done);
                        let (taken, all) = (at.taken, at.taken + at.total.saturating_sub(at.done));
                        look_at(&model, format_args!("step {taken} of {all}"));
                        training.set_of(taken.into(), all.into());
                        let small = match halvings_at(options(at.total).part(done), halvings) {
                            0 => String::new(),
                            halvings => format!(", photos at 1/{}", 1 << halvings),
                        };
                        let said = learned(trainer.lately(done, photos.len()), trainer.gaussians(), context);
                        training.say(said + &small);
                        kept.look(|| keep(&mut trainer, at))?;
                        if let Some(deadline) = &mut deadline
                            && deadline.is_due(done, Instant::now())
                        {
                            at = at.after(trainer.settle(&model, &views)?);
                            let Plan { total, done } = deadline.plan(at.done, Instant::now(), Duration::ZERO);
                            tracing::info!("after {} steps: a run of {total}, of which {done} count as done", at.taken);
                            trainer.replan(&session, &views, &options(total), &density(total), done)?;
                            at = At { done, total, ..at };
                        }
                    } else if looks_at == Some(at.taken) && at.is_going_on() {
                        let took = look(at, &trainer, &model.download()?)?;
                        if let Some(deadline) = &mut deadline {
                            deadline.pause(took);
                        }
                        looks_at = evaluation(at.taken);
                    } else if !at.is_going_on() || at.done >= in_time {
                        break;
                    }
                }
                if interrupt.asked() {
                    kept.keep(|| keep(&mut trainer, at))?;
                }
                let file = SceneFile { trained_with, ..model.download()?.into() };
                gaussians = file.scene.base.len();
                write_scene_file(&self.output, &file)?;
                if interrupt.asked() { Ok(()) } else { look(at, &trainer, &file.scene).map(drop) }
            };
            if let Err(error) = train() {
                drop(training);
                return Err(kept.keep_after(error, || keep(&mut trainer, at)).into());
            }
            let trained = trainer.stop()?;
            let largest_exposure = trainer.exposures()?.map(|maps| farthest(&maps));
            let device_megabytes = context.memory().most_used as f64 / 1e6;
            // What was on its way when an end was asked for is done, too.
            let at = at.after(trained.losses.len() as u32);
            let ended = interrupt.asked() && at.is_going_on();
            let seconds = (started.elapsed() - evaluating.get()).as_secs_f64();
            drop(training);
            if !ended {
                kept.remove()?;
            }
            drop(interrupt);
            if self.time.is_some() && !ended {
                at.tell_of_time(photos.len());
            }
            for (pass, losses) in passes(&trained.losses, photos.len()) {
                tracing::info!("mean loss of steps {pass}: {:.4}", pass_loss(losses));
            }
            let stages = trained.steps.milliseconds();
            for (name, milliseconds) in &stages {
                tracing::info!("a step's {name}: {milliseconds:.3} ms");
            }
            let last_pass = &trained.losses[trained.losses.len().saturating_sub(photos.len())..];
            let report = Report {
                output: &self.output.to_string_lossy(),
                device: &context.info().name,
                photos: photos.len(),
                gaussians,
                sh_degree: Some(sh_degree).filter(|&degree| degree != BETAS),
                iterations: at.taken,
                iterations_resumed: had,
                seed,
                halvings,
                tile: session.policy.tile(context.info()).to_string(),
                seconds,
                steps_per_second: f64::from(at.taken - had) / seconds,
                final_loss: pass_loss(last_pass),
                largest_exposure,
                device_megabytes,
                buffers_grown: trained.steps.grown,
                stages: StageMean::all(&stages),
            };
            let Report { output, device, photos, steps_per_second, final_loss, .. } = report;
            if let Some(largest) = largest_exposure {
                note(format!("exposure: the photos' colour maps differ from none by at most {largest:.3}"));
            }
            if self.json {
                print_json(&report)?;
            } else {
                print(format_args!(
                    "{output}: {} of {} from {}\n\
                     {} in {seconds:.1} s ({steps_per_second:.1}/s) on {device}, loss {final_loss:.4}\n",
                    counted(gaussians, "Gaussian"),
                    colour_name(sh_degree),
                    counted(photos, "photo"),
                    counted(at.taken as usize, "step"),
                ))?;
            }
            if ended {
                // With --time nobody knows how many there would have been.
                let of = self.time.map_or(format!(" of {}", at.total), |_| String::new());
                let goes_on = "the same command resumes there";
                let what =
                    format!("ended after {}{of} steps; {output} has what was learned in them, and {goes_on}", at.taken);
                return Err(Failure::Interrupted(what));
            }
            Ok(())
        })
    }

    /// The end of a run of so long that began at `began` and is about to take its first step, less what writing so many Gaussians takes. One
    /// that goes on has the time that was left, be it none.
    fn deadline(
        &self,
        time: Duration,
        began: Instant,
        gaussians: u32,
        goes_on: Option<(Clock, u32)>,
    ) -> Result<Deadline> {
        let bytes = u64::from(gaussians) * gaussian_bytes(self.degree(), false);
        let writing = Duration::from_secs_f64(bytes as f64 / WRITTEN_PER_SECOND).min(time / 10);
        let (now, left) = (Instant::now(), time - writing);
        if let Some((Clock { total, milliseconds, .. }, step)) = goes_on {
            let left = left.saturating_sub(Duration::from_millis(milliseconds));
            return Ok(Deadline::of(now, began + left, total, step));
        }
        if now >= began + left {
            let passed = (now - began).as_secs_f64();
            let what = "expected more, as a scene takes hundreds of steps";
            return Err(Error::Usage(format!(
                "--time {time:?}: no time is left for a step, as {passed:.1} s were over before the first; {what}"
            )));
        }
        Ok(Deadline::new(now, began + left))
    }

    /// What colours are: a degree of harmonics, or betas.
    fn degree(&self) -> u32 {
        if self.color == ColorArg::Sb { BETAS } else { self.sh_degree }
    }

    fn check_color(&self) -> Result<()> {
        if self.color == ColorArg::Sh {
            return Ok(());
        }
        if self.strategy.is_newton() {
            return Err(Error::Usage("--color sb learns by Adam's steps: expected --strategy mcmc or adc".into()));
        }
        if self.sh_degree != BaseOptions::default().sh_degree {
            return Err(Error::Usage("--color sb has no harmonics: --sh-degree is for --color sh".into()));
        }
        Ok(())
    }

    /// Fails if the device has no memory for the Gaussians that were asked for, before anything is allocated.
    fn check_asked(&self, dataset: &Dataset) -> Outcome {
        // Sparse points limit their own number; random points do not.
        let drawn = self.points.filter(|_| self.init.is_none() && dataset.points.is_none());
        let asked = [("--gaussians", self.gaussians), ("--points", drawn)];
        let most = asked.into_iter().filter_map(|(option, n)| Some((n.filter(|&n| n > MANY)?, option))).max();
        let Some((n, option)) = most else { return Ok(()) };
        let packed = self.learn.precision == super::Precision::Half;
        let bytes = learning_bytes(self.degree(), packed, self.strategy.is_newton());
        self.device.with_unchecked(|context| {
            let fit = context.memory_at_most() / bytes;
            if u64::from(n) <= fit {
                return Ok(());
            }
            let what = format!(
                "{option} {n}: the device's memory holds {fit} Gaussians, {bytes} bytes each; expected no more"
            );
            Err(Error::Usage(what).into())
        })
    }

    /// Of a run that begins with the first number of Gaussians and comes to the second where nothing else is asked for.
    fn density(&self, [first, most]: [usize; 2], iterations: u32) -> DensityOptions {
        DensityOptions { strategy: self.strategy, limit: most as u32, first: first as u32, iterations }
    }

    /// What a run keeps beside its scene while it goes on: its checkpoint, twice while one takes the place of another, and pictures of the
    /// first of these photos, as far as it is known how many there will be.
    fn kept_bytes(&self, control: &DensityOptions, test: &[&Photo]) -> u64 {
        let packed = self.learn.precision == super::Precision::Half;
        let gaussian = learning_bytes(self.degree(), packed, control.strategy.is_newton()) + SCORE_BYTES;
        let checkpoint = u64::from(control.limit) * gaussian + 4 * u64::from(control.iterations);
        let pictures = match (self.eval_every, test.first(), self.time) {
            (Some(every), Some(photo), None) => {
                u64::from(self.iterations.div_ceil(every)) * 3 * 3 * u64::from(photo.camera.pixels())
            }
            _ => 0,
        };
        2 * checkpoint + pictures
    }

    /// Everything that training depends on.
    fn settings(
        &self,
        photos: &[&Photo],
        pixels: &[u32],
        [first, checksum, halvings]: [u32; 3],
        session: &Session,
        options: &BaseOptions,
        density: &DensityOptions,
    ) -> Result<Value> {
        // Taken apart, so that what is new in it is not forgotten. How gradients are added up does not change what they are.
        let &Session { context: _, policy, background, extent, seed } = session;
        let resolved = Policy { reduction: Reduction::Auto, tile: None, ..policy };
        Ok(json!({
            "glint": env!("CARGO_PKG_VERSION"),
            "planes": layout::groups(0).map(|group| group.planes.start),
            "photos": photos_json(photos, pixels),
            "points": {"count": first, "crc32": checksum},
            "options": serde_json::to_value(self).map_err(|e| Error::Usage(e.to_string()))?,
            "resolved": format!("{options:?} {density:?} {halvings} {:?}", (resolved, background, extent, seed)),
        }))
    }
}

fn times(n: u32) -> &'static str {
    if n == 1 { "once" } else { "twice" }
}

/// How long a step takes on photos whose sides are halved so many times, and by a share of the Gaussians, as a part of one on photos in
/// full by all: a quarter of it is by Gaussian (0.17 to 0.3 of it, at 224 to 800 pixels and as many Gaussians as README.md has there), and
/// all of it grows with the root of the Gaussians, nearly (docs/results.md: by 0.47).
fn step_cost(halvings: u32, gaussians: f64) -> f64 {
    0.25 * gaussians + 0.75 * 0.25f64.powi(halvings as i32) * gaussians.powf(0.3)
}

/// Where a run is.
#[derive(Clone, Copy)]
struct At {
    /// Steps that are done, of so many in all.
    done: u32,
    total: u32,
    /// Steps that were taken: with --time the others leap when it is planned anew.
    taken: u32,
}

impl At {
    /// Once so many are done.
    fn after(self, done: u32) -> At {
        At { done, taken: self.taken + (done - self.done), ..self }
    }

    fn is_going_on(self) -> bool {
        self.done < self.total
    }

    /// What became of a run by --time that one would not expect.
    fn tell_of_time(self, photos: usize) {
        let At { done, total, taken } = self;
        if self.is_going_on() {
            let part = 100.0 * f64::from(done) / f64::from(total);
            note(format!(
                "the time was over after {part:.0} % of the schedule: its last steps took longer than was thought"
            ));
        }
        if (taken as usize) < photos {
            let (steps, photos) = (counted(taken as usize, "step"), counted(photos, "photo"));
            note(format!(
                "there was time for {steps} only, and there are {photos}: the scene has hardly begun to learn"
            ));
        }
    }
}

/// The largest difference of an entry of these maps from the identity's.
fn farthest(maps: &[[f32; 12]]) -> f32 {
    let off = |map: &[f32; 12]| map.iter().zip(IDENTITY).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    maps.iter().map(off).fold(0.0, f32::max)
}

/// The first and the last pass through the photos and eight between them, with their numbers of steps.
fn passes(losses: &[f32], photos: usize) -> Vec<(String, &[f32])> {
    let all: Vec<&[f32]> = losses.chunks(photos.max(1)).collect();
    let shown = all.len().min(10);
    let at = |i: usize| i * (all.len() - 1) / (shown - 1).max(1);
    let named = |i: usize| {
        let first = i * photos.max(1);
        (format!("{} to {}", first + 1, first + all[i].len()), all[i])
    };
    (0..shown).map(|i| named(at(i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passes_are_the_first_the_last_and_some_between() {
        let losses: Vec<f32> = (0..1005).map(|i| i as f32).collect();
        let named = |n: usize, photos: usize| {
            passes(&losses[..n], photos).into_iter().map(|(name, pass)| (name, pass[0])).collect::<Vec<_>>()
        };
        assert_eq!(named(3, 7), [("1 to 3".into(), 0.0)]);
        assert_eq!(named(10, 7), [("1 to 7".into(), 0.0), ("8 to 10".into(), 7.0)]);
        let many = named(1005, 10);
        assert_eq!((many.len(), &many[0].0[..], &many[9].0[..]), (10, "1 to 10", "1001 to 1005"));
        assert!(many.is_sorted_by(|a, b| a.1 < b.1) && named(0, 7).is_empty());
    }
}
