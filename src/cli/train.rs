use std::{
    path::PathBuf,
    time::{Duration, Instant},
};

use serde::Serialize;
use serde_json::{Value, json};

use super::{
    At, DeviceArgs, DrawArgs, Failure, LearnArgs, Outcome, PhotoArgs, SceneArgs, WatchArgs, Watched, counted,
    dataset::{check_sight, is_uncounted, note_uncounted},
    deadline::{Deadline, MOST, Plan, duration},
    history::{History, Moment},
    interrupt::Interrupt,
    kept::{KeepArgs, Kept, photos_json},
    output::{Inputs, OutputArgs, check_room},
    print, print_json,
    progress::{Progress, learned, note},
};
use crate::{
    Error, Result,
    data::{Dataset, Photo, Split, gaussian_bytes, is_point_cloud, read_points, write_scene},
    pipelines::{
        density::{DensityOptions, Strategy},
        exposure::IDENTITY,
        learn::learning_bytes,
        model::{Model, Room},
        render::RenderOptions,
        session::{Policy, Reduction, Session},
        start::{first_points, halvings_for, photos_of, upload_photos},
        train::{BaseOptions, HALVED_UNTIL, LEARNED, Trainer, dense_trainer, halvings_at},
    },
    report::runs::StageMean,
    scene::{
        Gaussians, Scene, from_points,
        layout::{self, BETAS, colour_name},
    },
};

const EXAMPLES: &str = "\
Gaussians start at the dataset's sparse points, or at random points if there are none. --strategy says how they go on: where \
photos are not yet met there are more, up to --gaussians, and transparent ones go. Only training photos are used.

What was learned is saved beside the output every minute, on an error and on Ctrl-C (base.checkpoint.safetensors for \
base.ply). The same command resumes from there, gives the same scene as an uninterrupted run, and removes it in the end. With --time \
nothing is saved beside the output.

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

/// Where photos show by their transparency where a scene is, random points are one to begin with for so many Gaussians in the end.
const CARVED_NTH: usize = 4;
/// What takes the place of the output's extension.
const CHECKPOINT: &str = "checkpoint.safetensors";

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
    /// they take, and all schedules end with the last
    #[arg(long, value_name = "TIME", value_parser = duration, conflicts_with_all = ["iterations", "eval_every", "checkpoint_every"])]
    #[serde(skip)]
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
    /// Number of Gaussians: a random subset if there are more sparse points, random points if there are no
    /// sparse ones. Fewer are faster [default: all sparse points, or as many random ones as --gaussians or 4 for each pixel of the
    /// largest photo, at most 100000; a quarter of that where transparent photos show where the scene is]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    points: Option<u32>,
    /// Begin with what a file holds in place of the dataset's points: a PLY of points (and their colours), or the Gaussians of any scene,
    /// which then learn on
    #[arg(long, value_name = "FILE")]
    #[serde(skip)]
    init: Option<PathBuf>,
    #[command(flatten)]
    #[serde(skip)]
    lenient: SceneArgs,
    /// Gaussians at most, at the start too; the default strategy ends with as many [default: those of the start, before a quarter of them is taken]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    gaussians: Option<u32>,
    /// How Gaussians are pruned and multiplied
    #[arg(long, value_enum, default_value_t)]
    strategy: StrategyArg,
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

#[derive(Debug, Clone, Copy, Default, clap::ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
enum StrategyArg {
    /// Not at all
    Fixed,
    /// As 3DGS-MCMC: transparent ones move to opaque ones, 5 % more at each refinement
    Mcmc,
    /// As 3DGS: those with large gradients are cloned or split, opacities are reset
    Adc,
    /// More over the run up to --gaussians, and transparent ones move, to where errors are
    #[default]
    Budget,
}

impl From<StrategyArg> for Strategy {
    fn from(arg: StrategyArg) -> Self {
        match arg {
            StrategyArg::Fixed => Strategy::Fixed,
            StrategyArg::Mcmc => Strategy::Mcmc,
            StrategyArg::Adc => Strategy::Adc,
            StrategyArg::Budget => Strategy::Budget,
        }
    }
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
        let mut deadline = self.time.map(|time| Deadline::new(Instant::now() + time));
        let mut dataset = self.photos.open(&self.dataset)?;
        let mut inputs = Inputs::default().dataset(&dataset);
        if let Some(init) = &self.init {
            inputs = inputs.scene(init);
        }
        self.replace.check_ply(&self.output, &inputs)?;
        let first = self.first(&mut dataset)?;
        let photos = photos_of(&dataset, Some(Split::Train))?;
        let test = self.eval_every.map(|_| photos_of(&dataset, Some(Split::Test))).transpose()?;
        let (count, begins) = (first.gaussians.len(), first.begins);
        let own = || if Strategy::from(self.strategy).is_newton() { halvings_for(&photos) } else { 0 };
        let halvings = self.halvings.unwrap_or_else(own);
        let options = |iterations| BaseOptions { iterations, sh_degree, begins };
        if let Some(deadline) = &mut deadline {
            let whole = options(1);
            deadline.costs(move |part| step_cost(halvings_at(whole.part_of(part), halvings)));
        }
        let density = |iterations| self.density([count, first.most], iterations);
        check_room(&self.output, u64::from(density(self.iterations).limit) * gaussian_bytes(sh_degree, false))?;
        check_sight(&dataset, &first.gaussians.means)?;
        first.notes.into_iter().for_each(note);
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
            policy: self.draw.policy(),
            background: dataset.background,
            output: &self.output,
        };
        self.watch.with(&run, |context, look_at| {
            let (background, seed) = (dataset.background, self.seed);
            let mut session = {
                let cameras = photos.iter().map(|photo| &photo.camera);
                self.learn.session(context, self.draw.policy(), cameras, (background, extent, seed))?
            };
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
            let pixels: u64 = photos.iter().map(|photo| u64::from(photo.camera.pixels())).sum();
            tracing::info!("on the device: {:.1} MB of photos", megabytes(4 * pixels));
            if halvings > 0 {
                tracing::info!("photos are seen with sides halved {} at first", times(halvings));
            }
            let mut iterations = deadline.as_ref().map_or(self.iterations, |deadline| deadline.total);
            let control = density(iterations);
            let most = control.limit.max(count as u32);
            let packed = self.learn.precision == super::Precision::Half;
            let scene = u64::from(most) * learning_bytes(sh_degree, packed, control.strategy.is_newton());
            tracing::info!("on the device: {:.1} MB for {most} Gaussians and their moments", megabytes(scene));
            let mut base = first.gaussians;
            let beginning = checksum(&base);
            if begins == 0.0 {
                control.begin(&mut base);
            }
            let scene = Scene { base, supplement: None };
            let room = Room { base: control.limit.saturating_sub(count as u32), ..Default::default() };
            let model = Model::upload_around(context, views.origin, &scene, room)?;
            // For --json and -v.
            let timed = self.json || tracing::enabled!(tracing::Level::INFO);
            let training = Progress::new("training", "steps", iterations.into());
            let started = Instant::now();
            let settings = self.settings(
                &photos,
                &checksums,
                [count as u32, beginning, halvings],
                &session,
                &options(iterations),
                &control,
            )?;
            let mut kept = Kept::new(self.output.with_extension(CHECKPOINT), settings, self.keep.every());
            let found = match &deadline {
                None => kept.find(|path, why| self.replace.check_foreign(path, why))?,
                Some(_) => None,
            };
            session.policy.tile = kept.tile(context)?;
            let mut trainer = dense_trainer(&session, &model, &views, &options(iterations), &control)?;
            if self.exposure {
                trainer.correct_exposure(&session, &views)?;
            }
            let mut history =
                test.map(|test| History::new(context, &self.output, test, background, seed, self.photos.holdout()));
            if let Some(history) = &mut history {
                history.begin(found.as_ref().map(|found| found.step), &self.replace, &inputs)?;
            }
            let looked = found.as_ref().zip(history.as_ref()).is_some_and(|(found, history)| history.has(found.step));
            let resumed = match &found {
                Some(checkpoint) => {
                    trainer.resume(&model, checkpoint, timed)?;
                    checkpoint.step
                }
                None => {
                    trainer.start(timed)?;
                    0
                }
            };
            drop(found);
            training.goes_on_from(resumed.into());
            let interrupt = Interrupt::default();
            interrupt.listen()?;
            let (mut gaussians, mut evaluating) = (0, Duration::ZERO);
            // Steps that this run did: with a deadline their numbers leap when it is planned anew.
            let (mut ran, mut begun) = (0, resumed);
            let pass_loss = |pass: &[f32]| pass.iter().map(|&l| f64::from(l)).sum::<f64>() / pass.len().max(1) as f64;
            let mut train = || -> Result<()> {
                let mut look = |step: u32, trainer: &Trainer, scene: &Scene| -> Result<()> {
                    let Some(history) = &mut history else { return Ok(()) };
                    let (seconds, began) = ((started.elapsed() - evaluating).as_secs_f64(), Instant::now());
                    let losses = trainer.losses(step);
                    let loss = pass_loss(&losses[losses.len().saturating_sub(photos.len())..]);
                    let bytes = scene.base.len() as u64 * gaussian_bytes(sh_degree, false);
                    let options = RenderOptions { policy: self.draw.policy(), ..Default::default() };
                    history.add(scene, Moment { step, seconds, bytes, loss }, options)?;
                    evaluating += began.elapsed();
                    Ok(())
                };
                let evaluation = |after: u32| self.eval_every.map(|every| (after / every + 1).saturating_mul(every));
                let mut stop = match &mut deadline {
                    Some(deadline) => deadline.next(),
                    None => evaluation(resumed),
                };
                // A run that ended just when it was to be looked at is looked at now.
                let due = |every| resumed > 0 && resumed < iterations && resumed.is_multiple_of(every);
                if self.eval_every.is_some_and(due) && !looked {
                    look(resumed, &trainer, &model.download()?)?;
                }
                trainer.go_on_to(stop.unwrap_or(iterations));
                while !interrupt.asked() {
                    if let Some(done) = trainer.advance(&model, &views)? {
                        look_at(&model, At { phase: "", step: done.into(), steps: iterations.into() });
                        (ran, begun) = (ran + done - begun, done);
                        training.set_of(done.into(), iterations.into());
                        let small = match halvings_at(options(iterations).part(done), halvings) {
                            0 => String::new(),
                            halvings => format!(", photos at 1/{}", 1 << halvings),
                        };
                        let said = learned(trainer.lately(done, photos.len()), trainer.gaussians(), context);
                        training.say(said + &small);
                        if deadline.is_none() {
                            kept.look(|| trainer.checkpoint(&model, &views))?;
                        }
                        continue;
                    }
                    let Some(step) = stop.filter(|&step| step < iterations) else { break };
                    stop = if let Some(deadline) = &mut deadline {
                        let Plan { total, done } = deadline.plan(step, Duration::ZERO);
                        tracing::info!("a run of {total} steps, of which {done} count as done");
                        trainer.replan(&session, &views, &options(total), &density(total), done)?;
                        (iterations, begun) = (total, done);
                        deadline.next()
                    } else {
                        look(step, &trainer, &model.download()?)?;
                        evaluation(step)
                    };
                    trainer.go_on_to(stop.unwrap_or(iterations));
                }
                if interrupt.asked() && deadline.is_none() {
                    kept.keep(|| trainer.checkpoint(&model, &views))?;
                }
                let scene = model.download()?;
                gaussians = scene.base.len();
                write_scene(&self.output, &scene)?;
                if interrupt.asked() { Ok(()) } else { look(iterations, &trainer, &scene) }
            };
            if let Err(error) = train() {
                drop(training);
                if deadline.is_some() {
                    return Err(error.into());
                }
                return Err(kept.keep_after(error, || trainer.checkpoint(&model, &views)).into());
            }
            let trained = trainer.stop()?;
            let largest_exposure = trainer.exposures()?.map(|maps| farthest(&maps));
            let device_megabytes = context.memory().most_used as f64 / 1e6;
            let steps = trained.losses.len() as u32;
            let seconds = (started.elapsed() - evaluating).as_secs_f64();
            drop(training);
            if steps == iterations && deadline.is_none() {
                kept.remove()?;
            }
            drop(interrupt);

            for (pass, losses) in passes(&trained.losses, photos.len()) {
                tracing::info!("mean loss of steps {pass}: {:.4}", pass_loss(losses));
            }
            let stages = trained.steps.milliseconds();
            for (name, milliseconds) in &stages {
                tracing::info!("a step's {name}: {milliseconds:.3} ms");
            }
            let last = &trained.losses[trained.losses.len().saturating_sub(photos.len())..];
            let report = Report {
                output: &self.output.to_string_lossy(),
                device: &context.info().name,
                photos: photos.len(),
                gaussians,
                sh_degree: Some(sh_degree).filter(|&degree| degree != BETAS),
                iterations: if deadline.is_some() { ran } else { steps },
                iterations_resumed: resumed,
                seed,
                halvings,
                tile: session.policy.tile(context.info()).to_string(),
                seconds,
                steps_per_second: f64::from(if deadline.is_some() { ran } else { steps - resumed }) / seconds,
                final_loss: pass_loss(last),
                largest_exposure,
                device_megabytes,
                buffers_grown: trained.steps.grown,
                stages: StageMean::all(&stages),
            };
            let Report { output, device, photos, iterations: did, steps_per_second, final_loss, .. } = report;
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
                    counted(did as usize, "step"),
                ))?;
            }
            if steps < iterations {
                let goes_on = if deadline.is_some() { "" } else { ", and the same command with --force goes on" };
                let what =
                    format!("ended after {did} of {iterations} steps; {output} has what was learned in them{goes_on}");
                return Err(Failure::Interrupted(what));
            }
            Ok(())
        })
    }

    /// What colours are: a degree of harmonics, or betas.
    fn degree(&self) -> u32 {
        if self.color == ColorArg::Sb { BETAS } else { self.sh_degree }
    }

    fn check_color(&self) -> Result<()> {
        if self.color == ColorArg::Sh {
            return Ok(());
        }
        if Strategy::from(self.strategy).is_newton() {
            return Err(Error::Usage("--color sb learns by Adam's steps: expected --strategy mcmc or adc".into()));
        }
        if self.sh_degree != BaseOptions::default().sh_degree {
            return Err(Error::Usage("--color sb has no harmonics: --sh-degree is for --color sh".into()));
        }
        Ok(())
    }

    /// What the run begins with: a file's Gaussians or points, the dataset's points, or random ones.
    fn first(&self, dataset: &mut Dataset) -> Result<First> {
        let limit = self.gaussians.map(|n| n as usize);
        let points = match &self.init {
            Some(file) if !file.is_dir() && is_point_cloud(file)? => {
                let cloud = read_points(file)?;
                if cloud.positions.is_empty() {
                    return Err(Error::input(file, "has no points to begin with"));
                }
                dataset.points = Some(cloud);
                "points in the file"
            }
            Some(file) => {
                let Scene { base, supplement } = self.lenient.open(file)?;
                if let Some(limit) = limit.filter(|&limit| limit < base.len()) {
                    let what = format!("has {} Gaussians, expected no more than --gaussians {limit}", base.len());
                    return Err(Error::input(file, what));
                }
                if self.points.is_some() {
                    return Err(Error::input(file, "holds Gaussians, and --points is for points"));
                }
                if base.is_empty() {
                    return Err(Error::input(file, "has no Gaussians to begin with"));
                }
                let mut notes = Vec::new();
                if let Some(left) = supplement.filter(|supplement| !supplement.gaussians.is_empty()) {
                    let left = left.gaussians.len();
                    notes.push(format!("{}: its {left} Gaussians with lobes are left out", file.display()));
                }
                if base.sh_degree != 0 && (base.sh_degree == BETAS) != (self.degree() == BETAS) {
                    let (had, has) = (colour_name(base.sh_degree), colour_name(self.degree()));
                    notes.push(format!("{}: of its {had} only the constant is kept, for {has}", file.display()));
                }
                let gaussians = base.with_degree(self.degree());
                return Ok(First { most: gaussians.len(), gaussians, begins: LEARNED, notes });
            }
            None => "sparse points",
        };
        let wanted = [self.points, self.gaussians].into_iter().flatten().min();
        let mut first = first_points(dataset, wanted.map(|n| n as usize), self.seed);
        let most = first.cloud.positions.len();
        let mut place = "";
        // The other strategies' papers begin with as many points as they say, anywhere.
        if first.sparse.is_none() && matches!(self.strategy, StrategyArg::Budget) {
            let few = self.points.map_or((most / CARVED_NTH).max(1), |_| most);
            if let Some(cloud) = dataset.carved_points(few, self.seed)? {
                first.cloud = cloud;
                place = " where no photo is transparent";
            }
        }
        let count = first.cloud.positions.len();
        let said = match (first.sparse, self.points) {
            (None, _) => Some(format!("the dataset has no sparse points: starting from {count} random ones{place}")),
            (Some(n), Some(wanted)) if n < wanted as usize => {
                Some(format!("there are {n} {points}, fewer than the {wanted} that --points allows"))
            }
            (Some(n), _) if count < n => Some(format!("starting from {count} of {n} {points}, chosen at random")),
            _ => None,
        };
        let gaussians = from_points(&first.cloud.positions, &first.cloud.colors, self.degree());
        Ok(First { gaussians, most, begins: 0.0, notes: said.into_iter().collect() })
    }

    /// Of a run that begins with the first number of Gaussians and comes to the second where nothing else is asked for.
    fn density(&self, [first, most]: [usize; 2], iterations: u32) -> DensityOptions {
        let limit = self.gaussians.unwrap_or(most as u32);
        DensityOptions { strategy: self.strategy.into(), limit, first: first as u32, iterations }
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
            // A run that goes on keeps its own, whatever was calibrated since.
            "tile": policy.tile.map(|tile| [tile.width, tile.height]),
            "resolved": format!("{options:?} {density:?} {halvings} {:?}", (resolved, background, extent, seed)),
        }))
    }
}

fn times(n: u32) -> &'static str {
    if n == 1 { "once" } else { "twice" }
}

/// How long a step takes on photos whose sides are halved so many times, as a share of one on photos in full: a quarter of it is by
/// Gaussian. (0.17 to 0.3 of it, at 224 to 800 pixels and as many Gaussians as README.md has there.)
fn step_cost(halvings: u32) -> f64 {
    0.25 + 0.75 * 0.25f64.powi(halvings as i32)
}

/// What a run begins with.
struct First {
    gaussians: Gaussians,
    /// As many as it may come to where nothing else is asked for.
    most: usize,
    /// Of [`BaseOptions`].
    begins: f64,
    /// What the user would not expect of it.
    notes: Vec<String>,
}

/// Of all numbers of these Gaussians.
fn checksum(of: &Gaussians) -> u32 {
    let Gaussians { sh_degree, means, log_scales, quats, opacities, sh } = of;
    let mut all = crc32fast::Hasher::new();
    all.update(&sh_degree.to_le_bytes());
    for part in [means, log_scales, sh] {
        all.update(bytemuck::cast_slice(part));
    }
    all.update(bytemuck::cast_slice(quats));
    all.update(bytemuck::cast_slice(opacities));
    all.finalize()
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
