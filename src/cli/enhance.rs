//! `glint enhance`: augments a base scene, measures the gain on the test photos, and discards a result that
//! is worse than the base.

use std::{
    fs,
    path::PathBuf,
    time::{Duration, Instant},
};

use clap::ValueEnum;
use drive::{Beside, run_with_progress};
use glam::DVec3;
use report::{Costs, Gain, Placement, Report, Seconds, Sizes, gain, joint_stages, pass_loss};
use serde::Serialize;
use serde_json::json;

use super::{
    CommonArgs, Failure as Ended, Look, Outcome, SceneArgs, WatchArgs, Watched, counted,
    dataset::{check_sight, upload},
    interrupt::Interrupt,
    kept::{KeepArgs, Kept, settings},
    lock::Lock,
    output::{Inputs, OutputArgs, check_room},
    print, print_json,
    progress::{Progress, note},
    tell_run,
    train::storage::PhotosOn,
    units,
};
use crate::{
    Error, Result,
    data::{Dataset, Photo, SceneFile, Split, TrainedWith, scene_bytes, write_ply},
    gpu::Context,
    pipelines::{
        classes::demote,
        enhance::{EnhanceOptions, Enhanced, Method},
        join::JoinOptions,
        lift::LiftOptions,
        pursuit::Kinds,
        screen::Schedule,
        session::{Policy, Session},
        spend::{MOST_BY_BYTES, MOST_BY_GAIN, Weigh},
        start::photos_of,
        views::{Views, scene_origin_for},
    },
    scene::{Camera, Scene, color},
};

pub(super) mod drive;
pub(super) mod report;

/// Bytes of a photo's pixel and of its errors while Gaussians are placed, and the share of the device's memory that all
/// may take there.
const PIXEL_BYTES: f64 = 40.0;
const PHOTOS_SHARE: f64 = 0.75;

const EXAMPLES: &str = "\
Gaussians are placed to reduce the squared error of all training photos most: with a lobe, so that their opacity depends on \
the viewing direction, or plain if those gain more. Then everything learns together with the base. The tightest of --ratio, \
--bytes or --total-bytes, and --time holds. Without --ratio, --bytes and --total-bytes, Gaussians are added until another one \
would gain less than the same time of longer training. The plan is printed first: the gain of each kind, and the candidates \
left out, with reasons. Only training photos are used; the gain is then measured on the test photos. --method augs is the \
paper's method: it fits 2D Gaussians to the base's errors in each photo, lifts them into the scene and optimizes them together \
with the base's opacities.

If the base has constant colors (train --sh-degree 0), Gaussians that gain by bands of harmonics get them. In the same bytes \
such a base has 4.4 times as many Gaussians as one of degree 3.

Examples:
  glint enhance garden --base base.ply -o augmented.ply
  glint enhance garden --base point_cloud.ply -o augmented.ply --ratio 0.05 --max-size 800
  glint enhance garden --base base.ply -o augmented.ply --bytes 2MB --time 60s
  glint enhance garden --base point_cloud.ply -o augmented.ply --total-bytes 25MB
  glint enhance garden --base base.ply -o augmented.ply --method augs --preset quick

A checkpoint, augmented.checkpoint.safetensors, is saved every minute, on an error and on Ctrl-C. It has the state of the \
joint phase, and with --method augs the lifted Gaussians. The same command resumes from it and removes it at the end. With \
--time there is no checkpoint.";

/// Number of steps in the screen phase of the paper's method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Preset {
    /// Shorter rounds, for previews and machines without a GPU
    Quick,
    /// The paper's numbers of steps
    Paper,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
enum Failure {
    Largest,
    Smallest,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
enum Weights {
    Squared,
    Plain,
}

/// Options for every ⚖ of docs/method.md.
#[derive(Debug, clap::Args, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) struct ChoiceArgs {
    /// Rounds of the screen phase of --method augs [default: paper; demo: quick]
    #[arg(long, value_enum)]
    preset: Option<Preset>,
    /// Take a pixel's depth at the first point with a transmittance below this, 0.01 to 0.99; the authors'
    /// release uses 0.7
    #[arg(long, value_name = "T", default_value_t = 0.5, value_parser = parse_share)]
    depth_threshold: f32,
    /// Take a pixel's depth at the center of its median Gaussian, instead of at the Gaussian's maximum
    /// along the ray
    #[arg(long)]
    centre_depth: bool,
    /// Count the steps of the whole view for Adam's bias correction, as the authors' release does, instead
    /// of those of each 2D Gaussian
    #[arg(long)]
    shared_steps: bool,
    /// Group that must have at least 3 points to separate foreground from background
    #[arg(long, value_enum, default_value_t = Failure::Largest)]
    cluster_failure: Failure,
    /// Weights of the covariance of a group
    #[arg(long, value_enum, default_value_t = Weights::Squared)]
    pca_weights: Weights,
    /// Use Adam's bias correction for all parameters of the joint phase of --method augs, not only for
    /// lobes
    #[arg(long)]
    bias_correction: bool,
}

impl ChoiceArgs {
    /// Options of a method with these choices.
    ///
    /// # Errors
    /// [`Error::Usage`] for a choice that the method does not have.
    pub(super) fn options(&self, method: Method, preset: Preset) -> Result<EnhanceOptions> {
        if method == Method::Pursuit {
            let of_augs = [
                ("--preset", self.preset.is_some()),
                ("--shared-steps", self.shared_steps),
                ("--cluster-failure", self.cluster_failure != Failure::Largest),
                ("--pca-weights", self.pca_weights != Weights::Squared),
                ("--bias-correction", self.bias_correction),
            ];
            if let Some((name, _)) = of_augs.into_iter().find(|(_, given)| *given) {
                return Err(Error::Usage(format!("{name} needs --method augs")));
            }
        }
        let preset = match (method, self.preset.unwrap_or(preset)) {
            (Method::Pursuit, _) => {
                return Ok(EnhanceOptions {
                    median_threshold: self.depth_threshold,
                    centre_depth: self.centre_depth,
                    ..EnhanceOptions::pursuit()
                });
            }
            (Method::Augs, preset) => preset,
        };
        let preset = match preset {
            Preset::Quick => EnhanceOptions::quick(),
            Preset::Paper => EnhanceOptions::paper(),
        };
        Ok(EnhanceOptions {
            median_threshold: self.depth_threshold,
            centre_depth: self.centre_depth,
            schedule: Schedule { shared_steps: self.shared_steps, ..preset.schedule },
            lift: LiftOptions {
                fail_on_smallest: self.cluster_failure == Failure::Smallest,
                plain_weights: self.pca_weights == Weights::Plain,
            },
            join: JoinOptions { bias_correction: self.bias_correction, ..preset.join },
            ..preset
        })
    }
}

/// Augment a base scene from photos
// Serialized into the settings of a checkpoint. A new option becomes part of them unless it is skipped.
#[derive(Debug, clap::Args, Serialize)]
#[serde(rename_all = "kebab-case")]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder or JSON file of the dataset
    #[serde(skip)]
    dataset: PathBuf,
    /// Base scene, from glint or any other 3DGS trainer, in any format that glint reads
    #[arg(long, value_name = "PLY")]
    #[serde(skip)]
    base: PathBuf,
    /// Output PLY file: other viewers show its base, glint also shows the added Gaussians
    #[arg(short, long, value_name = "PLY")]
    #[serde(skip)]
    output: PathBuf,
    /// Method that finds the added Gaussians
    #[arg(long, value_enum, default_value_t)]
    method: Method,
    /// Maximum number of added Gaussians, per Gaussian of the base, such as 0.1 or 10%, up to 10 [default: those that gain
    /// more than longer training, at most 0.25; 0.1 with --method augs]
    #[arg(long, value_parser = units::share(0.0..=10.0))]
    ratio: Option<f64>,
    /// Maximum size of the added Gaussians in the file, such as 500kB or 2MB. A changed base stored next to
    /// the original one does not count
    #[arg(long, value_name = "BYTES", value_parser = units::bytes)]
    bytes: Option<u64>,
    /// Maximum size of all Gaussians in the file, such as 25MB, in place of that of the added ones. Bands of harmonics that
    /// prevent little error are removed from the base, and added Gaussians take their bytes; a base of train --bytes keeps
    /// its bands if it leaves room. If too few Gaussians fade, the faintest are left out. Viewers that do not know this
    /// format show constant colors
    #[arg(long, value_name = "BYTES", value_parser = units::bytes, conflicts_with = "bytes")]
    #[serde(skip_serializing_if = "Option::is_none")]
    total_bytes: Option<u64>,
    /// Time until the scene is written, such as 60s or 5m; the joint phase has as many steps as fit. Two
    /// runs differ
    #[arg(long, value_parser = units::duration)]
    #[serde(skip)]
    time: Option<Duration>,
    #[command(flatten)]
    #[serde(skip)]
    keep: KeepArgs,
    #[command(flatten)]
    #[serde(skip)]
    watch: WatchArgs,
    /// Seed of random numbers and of the order of photos; the same seed and device give the same scene
    #[arg(long, default_value_t = 0)]
    seed: u32,
    /// Print JSON with the added Gaussians, the times of all phases and the gain
    #[arg(long)]
    #[serde(skip)]
    json: bool,
    #[command(flatten)]
    #[serde(skip)]
    replace: OutputArgs,
    #[command(flatten)]
    #[serde(skip)]
    lenient: SceneArgs,
    #[command(flatten)]
    #[serde(skip)]
    common: CommonArgs,
    #[command(flatten)]
    #[serde(flatten)]
    choices: ChoiceArgs,
}

fn parse_share(text: &str) -> Result<f32, String> {
    let found = text.parse().ok().filter(|t| (0.01..=0.99).contains(t));
    found.ok_or_else(|| "expected a number from 0.01 to 0.99".into())
}

/// Loss of test PSNR, dB, above which an augmentation without a budget is discarded. Seeds move the PSNR by
/// more (docs/experiments/2026-11-23-augmentation.md).
const WORSE_DB: f64 = 0.02;

/// Inputs of an augmentation.
struct Task<'a> {
    dataset: &'a Dataset,
    photos: Vec<&'a Photo>,
    /// Base.
    scene: &'a Scene,
    /// With --total-bytes the base without bands that prevent little error; it is what is augmented.
    demoted: Option<Scene>,
    options: EnhanceOptions,
    policy: Policy,
    trained_with: TrainedWith,
}

impl Task<'_> {
    /// The scene that is augmented.
    fn to_augment(&self) -> &Scene {
        self.demoted.as_ref().unwrap_or(self.scene)
    }

    /// Gaussians of the base that lost their bands.
    fn lost_bands(&self) -> usize {
        let constants =
            |scene: &Scene| if scene.mixed || scene.base.sh_degree == 0 { scene.base.constants() } else { 0 };
        constants(self.to_augment()) - constants(self.scene)
    }
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let end = self.time.map(|time| Instant::now() + time);
        let SceneFile { scene, trained_with, .. } = self.base_scene()?;
        let (mut photo_args, draw) =
            (self.common.photos.like(trained_with, &self.base), self.common.draw.like(trained_with, &self.base));
        let dataset = photo_args.open_with_options(&self.dataset)?.0;
        let policy = draw.policy();
        let (part, TrainedWith { exposure, matte, .. }) = (dataset.part, trained_with);
        let trained_with = TrainedWith { exposure, matte, part, ..photo_args.trained_with(policy.compensate) };
        let cameras: Vec<Camera> = dataset.split(Split::Train).map(|(_, photo)| photo.camera).collect();
        let origin = scene_origin_for(&cameras);
        // Positions far from 0 would be rounded when they learn. A scene whose origin is elsewhere keeps
        // its bits.
        let scene = if origin == DVec3::ZERO { scene } else { scene.around(origin) };
        let inputs = Inputs::default().scene(&self.base).dataset(&dataset);
        // A run by time reads no checkpoint, so it does not own an earlier output.
        let owns = self.time.is_none() && KeepArgs::owns(&self.output);
        self.replace.or(owns).check_ply(&self.output, &inputs)?;
        let _ours = Lock::take(&self.output)?;
        let photos = photos_of(&dataset, Some(Split::Train))?;
        let mut options = self.options()?;
        if matte == Some(true) && self.method == Method::Pursuit {
            note("training found that no color of the base depends on the view: only plain Gaussians are added");
            (options.bands, options.pursuit.kinds) = (false, Kinds::Plain);
        }
        // Each view may round its share up.
        let allowance = options.allowance(&scene);
        let [lobes, plain] = allowance.most().map(|most| u64::from(most) + photos.len() as u64);
        let [lobe_bytes, plain_bytes] = allowance.prices();
        let added = (lobes * lobe_bytes).max(plain * plain_bytes);
        check_room(&self.output, scene_bytes(&scene) + added, 0)?;
        check_sight(&dataset, scene.origin, &scene.base.means)?;
        if scene.base.sh_degree < 3 {
            note(format!(
                "the base has SH degree {}: higher bands are neither stored nor evaluated",
                scene.base.sh_degree
            ));
        }
        let background = dataset.background;
        let run = Watched { device: &self.common.device, dataset: &dataset, policy, background, output: &self.output };
        let task = Task { dataset: &dataset, photos, scene: &scene, demoted: None, options, policy, trained_with };
        self.watch.with(&run, |context, look_at| self.augment(context, look_at, task, end))
    }

    /// Reads the base; fails if it is augmented or has no harmonics.
    fn base_scene(&self) -> Result<SceneFile> {
        let file = self.lenient.open_file(&self.base)?;
        if file.scene.supplement.is_some() {
            let what = "is augmented already (it has supplementary Gaussians), expected a base scene";
            return Err(Error::input(&self.base, what));
        }
        let colors = color::of(file.scene.base.sh_degree);
        if colors.harmonics.is_none() {
            return Err(Error::input(&self.base, format!("has {}, expected a base with harmonics", colors.name)));
        }
        Ok(file)
    }

    /// Chooses where the photos lie; prints a note if that is not the device.
    fn photos_on(&self, context: &Context, photos: &[&Photo]) -> Result<PhotosOn> {
        if self.method == Method::Augs {
            return Ok(PhotosOn::Device);
        }
        let pixels: u64 = photos.iter().map(|photo| u64::from(photo.camera.pixels())).sum();
        let fits = PIXEL_BYTES * pixels as f64 <= PHOTOS_SHARE * context.memory_at_most() as f64;
        let on = PhotosOn::choose(fits, context.staging_memory(), pixels);
        check_room(&self.output, on.file_bytes(pixels), 0)?;
        on.tell(pixels, ", because the device's memory does not hold them and their errors");
        Ok(on)
    }

    /// Runs the augmentation, until `end` at the latest, and prints its report.
    fn augment(&self, context: &Context, look_at: &mut Look<'_>, mut task: Task<'_>, end: Option<Instant>) -> Outcome {
        let Task { dataset, ref photos, scene, policy, trained_with, .. } = task;
        let (background, extent) = (dataset.background, dataset.extent() as f32);
        let session = self.common.learn.session(context, policy, background, extent, self.seed.into());
        let on = self.photos_on(context, photos)?;
        let (views, checksums) = upload(context, photos, background, 0, on.storage(&self.output)?, false)?;
        if let Some(total) = self.total_bytes {
            let bar = Progress::new("weighing bands", "steps", 1);
            let demoted = demote(&session, scene, &views, total, |[done, all]| bar.set_of(done.into(), all.into()))?;
            task.demoted = demoted;
        }
        let (base, options) = (task.to_augment(), &task.options);
        // A run by time has another number of steps each time, so it has no checkpoint.
        let mut kept = None;
        if self.time.is_none() {
            let base = fs::read(&self.base).map_err(|e| Error::io(&self.base, e))?;
            let base = ("base", json!({"crc32": crc32fast::hash(&base), "bytes": base.len()}));
            let settings = settings(&session, photos, &checksums, self, &format!("{options:?}"), base)?;
            kept = Some(Kept::new(&self.output, settings, &self.keep, trained_with));
        }
        let earlier = kept.as_mut().map(Kept::find).transpose()?.flatten();
        // A resumed joint phase was timed only in part, and a run by time has no time left to repeat it.
        let repeat = self.time.is_none() && earlier.is_none();
        let joins = options.join.steps_per_view as usize * photos.len();
        let length = self.time.map_or_else(|| counted(joins, "joint step"), |time| format!("{time:?}"));
        let base_count = counted(scene.base.len(), "Gaussian");
        tell_run("enhancing", context, photos, format_args!("{base_count}, {length}"));
        let interrupt = Interrupt::default();
        let beside = Beside {
            base: Some(&self.base),
            kept: kept.as_mut().map(|kept| (kept, earlier)),
            interrupt: Some(&interrupt),
            end,
            silent: self.json,
        };
        let mut found = run_with_progress(&session, base, &views, options, beside, look_at)?;
        if let Some(plan) = found.spending.as_mut().filter(|_| task.demoted.is_some()) {
            // They are of the base without the removed bands.
            (plan.training_on_db, plan.training_on_db_per_second) = (None, None);
        }
        let joint_steps = found.join.as_ref().map_or(0, |join| join.losses.len() as u32);
        let ended = interrupt.asked() && found.join.is_some() && joint_steps < found.steps;
        // Written before anything else can fail.
        write_ply(&self.output, &found.scene, found.original.as_ref(), trained_with.ended(!ended))?;
        drop(interrupt);
        if let (Some(kept), false) = (&kept, ended) {
            kept.remove()?;
        }
        // After an interrupt, the result is not measured.
        let (gain, discarded) =
            if ended { (None, false) } else { self.judge(&session, (&views, repeat), &task, &mut found)? };
        let report = self.report(context, &task, &found, gain, discarded)?;
        match self.json {
            true => print_json(&report)?,
            false => print(report.text(options.method))?,
        }
        if ended {
            let (output, steps) = (report.output, found.steps);
            let on = if kept.is_some() { "; run the same command to resume" } else { "" };
            return Err(Ended::Interrupted(format!(
                "interrupted after {joint_steps} of {steps} joint steps; {output} has their result{on}"
            )));
        }
        Ok(())
    }

    /// Measures the gain on the test photos. Returns it, and whether the augmentation was discarded.
    fn judge(
        &self,
        session: &Session,
        views: (&Views, bool),
        task: &Task<'_>,
        found: &mut Enhanced,
    ) -> Result<(Option<Gain>, bool)> {
        let &Task { dataset, scene, trained_with, .. } = task;
        let mut gain = match gain(session, scene, found, dataset, views) {
            // The augmentation stands even if it cannot be measured.
            Err(error @ Error::Input { .. }) => {
                note(format!("the gain on the test photos is unknown: {error}"));
                None
            }
            judged => judged?,
        };
        let Some(known) = gain.as_mut().filter(|_| found.join.is_some()) else { return Ok((gain, false)) };
        let change = known.after.psnr - known.before.psnr;
        let discarded = self.asks_for_nothing() && change < -WORSE_DB;
        if discarded {
            note(format!(
                "the augmented scene is {:.2} dB worse on the test photos than the base, so the base was written; with \
                 a budget (--ratio, --bytes, --total-bytes, --time) the augmented scene is written in any case",
                -change
            ));
            write_ply(&self.output, scene, None, trained_with)?;
        } else if found.original.is_none()
            && !found.scene.mixed
            && self.total_bytes.is_none()
            && known.base_alone.psnr < known.before.psnr
        {
            // On the training photos, the changed base alone was better.
            found.original = Some(scene.base.clone());
            known.base_alone = known.before;
            write_ply(&self.output, &found.scene, found.original.as_ref(), trained_with)?;
        }
        Ok((gain, discarded))
    }

    /// Collects the report, and prints notes on the budget.
    fn report<'a>(
        &'a self,
        context: &'a Context,
        task: &Task<'_>,
        found: &'a Enhanced,
        gain: Option<Gain>,
        discarded: bool,
    ) -> Result<Report<'a>> {
        let Task { photos, scene, options, .. } = task;
        let allowance = options.allowance(task.to_augment());
        let budget = match options.method {
            Method::Pursuit => allowance.most().into_iter().max().unwrap_or_default(),
            Method::Augs => found.budgets.iter().sum(),
        };
        tell_left_out(task, found, budget, allowance.gaussians);
        Ok(Report {
            output: self.output.to_string_lossy().into_owned(),
            device: &context.info().name,
            photos: photos.len(),
            photos_resumed: found.resumed,
            sizes: Sizes {
                base_gaussians: scene.base.len(),
                budget,
                refined: found.refined,
                supplementary_gaussians: found.lifted,
                plain_gaussians: found.plain,
                banded_gaussians: found.promotion.gains.len() as u32,
                demoted_gaussians: task.lost_bands(),
                bytes_added: if discarded {
                    0
                } else {
                    scene_bytes(&found.scene).saturating_sub(scene_bytes(task.to_augment()))
                },
                file_bytes: fs::metadata(&self.output).map_err(|e| Error::io(&self.output, e))?.len(),
            },
            plan: found.spending.as_ref(),
            faded_gaussians: found.faded,
            original_kept: found.original.is_some(),
            costs: Costs {
                seconds: Seconds::of(&found.times),
                device_megabytes: context.memory().most_used as f64 / 1e6,
                stages: joint_stages(found),
            },
            joint_loss_first: pass_loss(found, photos.len(), false),
            joint_loss_last: pass_loss(found, photos.len(), true),
            placements: found.placed.iter().map(|p| Placement { lobes: p.lobes, plain: p.plain }).collect(),
            discarded,
            gain,
        })
    }

    /// The budget in bytes, of all Gaussians or of the added ones.
    fn budget(&self) -> Option<u64> {
        self.total_bytes.or(self.bytes)
    }

    /// Whether method and budget are glint's defaults.
    fn asks_for_nothing(&self) -> bool {
        self.method == Method::Pursuit && self.ratio.is_none() && self.budget().is_none() && self.time.is_none()
    }

    /// Options of the augmentation, by method and budget.
    fn options(&self) -> Result<EnhanceOptions> {
        let options = self.choices.options(self.method, Preset::Paper)?;
        if self.method == Method::Augs {
            let of_pursuit = [
                ("--bytes", self.bytes.is_some()),
                ("--total-bytes", self.total_bytes.is_some()),
                ("--time", self.time.is_some()),
            ];
            if let Some((name, _)) = of_pursuit.into_iter().find(|(_, given)| *given) {
                return Err(Error::Usage(format!("{name} needs --method pursuit")));
            }
            return Ok(EnhanceOptions { ratio: self.ratio.unwrap_or(options.ratio), ..options });
        }
        let (ratio, weigh) = match (self.ratio, self.budget()) {
            (Some(ratio), _) => (ratio, Weigh::Tell),
            (None, Some(_)) => (MOST_BY_BYTES, Weigh::Tell),
            (None, None) => (MOST_BY_GAIN, Weigh::Limit),
        };
        Ok(EnhanceOptions { ratio, weigh, bytes: self.bytes, total_bytes: self.total_bytes, ..options })
    }
}

/// Prints notes if the budget was exceeded or nothing was added. `budget` counts all Gaussians allowed,
/// `most` those of --ratio.
fn tell_left_out(task: &Task<'_>, found: &Enhanced, budget: u32, most: u32) {
    let (bases, ratio) = (task.scene.base.len(), task.options.ratio);
    if f64::from(budget) > 1.1 * f64::from(most) {
        note(format!(
            "each view's share is rounded up: --ratio {ratio} of {bases} Gaussians is {most}, and {budget} were allowed"
        ));
    }
    let lost = found.base_losses.iter().filter(|loss| !loss.is_finite()).count();
    if lost > 0 {
        note(format!(
            "the base's render of {lost} of {} photos is so far out of range that its loss is NaN; nothing was added for them",
            task.photos.len()
        ));
    } else if found.lifted + found.plain == 0 && found.promotion.gains.is_empty() {
        let (below, beyond) =
            found.spending.as_ref().map_or((0, 0), |p| (p.candidates.below_training_on, p.candidates.beyond));
        note(match (below, beyond) {
            _ if budget == 0 => "nothing was added: the budget is less than one Gaussian",
            (0, 0) => "nothing was added: no candidate gains anything",
            (0, _) => "nothing was added: no candidate that gains something fits the budget",
            _ => "nothing was added: longer training gains more than Gaussians do; the scene is unchanged",
        });
    }
}
