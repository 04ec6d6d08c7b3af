use std::path::{Path, PathBuf};

use clap::ValueEnum;
use serde::Serialize;

use super::{
    DeviceArgs, Outcome, PhotoArgs, ReductionArgs, SceneArgs,
    dataset::check_sight,
    output::{Inputs, OutputArgs, check_room},
    print, print_json,
    progress::{Progress, note},
    render::file_names,
};
use crate::{
    Error, Result,
    data::{Photo, Split, scene_bytes, write_scene},
    gpu::Context,
    pipelines::{
        enhance::{EnhanceOptions, Enhanced, Stage, enhance},
        lift::LiftOptions,
        start::{photos_of, upload_photos},
        views::Views,
        work::WorkDir,
    },
    scene::Scene,
};

const EXAMPLES: &str = "\
Supplementary Gaussians, whose opacity depends on the view, are fitted to what the base gets wrong in each photo, lifted into
the scene and optimised together with the base's opacities. Only training photos are used.

Examples:
  glint enhance garden --base base.ply -o augmented.ply
  glint enhance garden --base point_cloud.ply -o augmented.ply --preset quick --max-size 800
  glint enhance garden --base base.ply -o augmented.ply --work kept     # inspect it, or go on after an interruption";

/// How long the stages take.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Preset {
    /// The same stages with shorter rounds, for previews and machines without a GPU
    Quick,
    /// The paper's numbers of steps
    Paper,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Failure {
    Largest,
    Smallest,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Weights {
    Squared,
    Plain,
}

/// Augment a base scene, trained here or elsewhere, from the photos
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder or JSON file of the dataset
    dataset: PathBuf,
    /// 3DGS PLY of the base scene
    #[arg(long, value_name = "PLY")]
    base: PathBuf,
    /// PLY file to write: the base as any viewer reads it, and an element `augmented`
    #[arg(short, long, value_name = "PLY")]
    output: PathBuf,
    /// Supplementary Gaussians for each Gaussian of the base
    #[arg(long, default_value_t = 0.1, value_parser = parse_ratio)]
    ratio: f64,
    #[arg(long, value_enum, default_value_t = Preset::Paper)]
    preset: Preset,
    /// Keep each view's 2D Gaussians and lifts (safetensors), base render and depth (EXR) in this folder, and go on from what
    /// it holds
    #[arg(long, value_name = "DIR")]
    work: Option<PathBuf>,
    /// Seed of the draws and of the order of photos; the same seed gives the same scene on the same device
    #[arg(long, default_value_t = 0)]
    seed: u32,
    /// Print JSON: what was added and how long each stage took
    #[arg(long)]
    json: bool,
    /// A pixel's depth is where its transmittance first falls below this; the authors' release has 0.7
    #[arg(long, value_name = "T", default_value_t = 0.5, value_parser = parse_share, help_heading = "What the paper leaves open")]
    depth_threshold: f32,
    /// Separating foreground and background fails while this group has fewer than 3 points
    #[arg(long, value_enum, default_value_t = Failure::Largest, help_heading = "What the paper leaves open")]
    cluster_failure: Failure,
    /// Weights of the covariance of a group
    #[arg(long, value_enum, default_value_t = Weights::Squared, help_heading = "What the paper leaves open")]
    pca_weights: Weights,
    /// Adam's bias correction for all parameters of the joint stage, not only those of the lobes
    #[arg(long, help_heading = "What the paper leaves open")]
    bias_correction: bool,
    #[command(flatten)]
    replace: OutputArgs,
    #[command(flatten)]
    lenient: SceneArgs,
    #[command(flatten)]
    photos: PhotoArgs,
    #[command(flatten)]
    reduction: ReductionArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

fn parse_ratio(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|r| (0.0..=10.0).contains(r)).ok_or_else(|| "expected a number from 0 to 10".into())
}

fn parse_share(text: &str) -> Result<f32, String> {
    let found = text.parse().ok().filter(|t| (0.01..=0.99).contains(t));
    found.ok_or_else(|| "expected a number from 0.01 to 0.99".into())
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    output: &'a str,
    device: &'a str,
    photos: usize,
    /// Photos whose lifts came from `--work`.
    photos_resumed: usize,
    base_gaussians: usize,
    /// 2D Gaussians allowed, left after the 2D stage, and lifted.
    budget: u32,
    refined: u32,
    supplementary_gaussians: u32,
    seconds: Seconds,
    /// Mean loss over the first and over the last pass of the joint stage; null where it did not run.
    joint_loss_first: Option<f64>,
    joint_loss_last: Option<f64>,
}

#[derive(Serialize)]
struct Seconds {
    base: f64,
    plane: f64,
    lift: f64,
    join: f64,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let scene = self.lenient.open(&self.base)?;
        if scene.supplement.is_some() {
            let what = "is augmented already (it has an element `augmented`), expected a base scene";
            return Err(Error::input(&self.base, what).into());
        }
        let dataset = self.photos.open(&self.dataset)?;
        let inputs = Inputs::default().scene(&self.base).dataset(&dataset);
        self.replace.check_file(&self.output, "ply", "a PLY scene", &inputs)?;
        let photos = photos_of(&dataset, Some(Split::Train))?;
        let (gaussians, sh_degree) = (scene.base.len() as u64, scene.base.sh_degree);
        // Each view may round its share up.
        let added = (self.ratio * gaussians as f64) as u64 + photos.len() as u64;
        check_room(&self.output, scene_bytes(gaussians, added, sh_degree))?;
        check_sight(&dataset, &scene.base.means)?;
        let extent = dataset.extent() as f32;
        if scene.base.sh_degree < 3 {
            note(format!(
                "the base has SH degree {}: higher bands are neither stored nor evaluated",
                scene.base.sh_degree
            ));
        }
        let background = self.photos.background;
        let preset = match self.preset {
            Preset::Quick => EnhanceOptions::quick(extent, background),
            Preset::Paper => EnhanceOptions::paper(extent, background),
        };
        let options = EnhanceOptions {
            ratio: self.ratio,
            seed: self.seed,
            median_threshold: self.depth_threshold,
            lift: LiftOptions {
                fail_on_smallest: self.cluster_failure == Failure::Smallest,
                plain_weights: self.pca_weights == Weights::Plain,
            },
            bias_correction: self.bias_correction,
            reduction: self.reduction.reduction(),
            ..preset
        };
        let work = match &self.work {
            Some(folder) => {
                self.replace.make_folder(folder, &inputs)?;
                Some(WorkDir::open(folder, &self.settings(&photos)?, view_names(&photos))?)
            }
            None => None,
        };
        self.device.with(|context| {
            let reading = Progress::new("reading", "photos", photos.len() as u64);
            let views = upload_photos(context, &photos, background, |done| reading.set(done as u64))?;
            drop(reading);
            let found = run_with_progress(context, &scene, &views, &options, work.as_ref())?;
            write_scene(&self.output, &found.scene)?;
            let lost = found.base_losses.iter().filter(|loss| !loss.is_finite()).count();
            if lost > 0 {
                note(format!(
                    "the base's render of {lost} of {} photos is so far out of range that its loss is no number; nothing was \
                     added for them",
                    photos.len()
                ));
            } else if found.lifted == 0 {
                note("nothing was added: no view had anything left that supplementary Gaussians made better");
            }
            let report = Report {
                output: &self.output.to_string_lossy(),
                device: &context.info().name,
                photos: photos.len(),
                photos_resumed: found.resumed,
                base_gaussians: scene.base.len(),
                budget: found.budgets.iter().sum(),
                refined: found.refined,
                supplementary_gaussians: found.lifted,
                seconds: Seconds {
                    base: found.times.base.as_secs_f64(),
                    plane: found.times.plane.as_secs_f64(),
                    lift: found.times.lift.as_secs_f64(),
                    join: found.times.join.as_secs_f64(),
                },
                joint_loss_first: pass_loss(&found, photos.len(), false),
                joint_loss_last: pass_loss(&found, photos.len(), true),
            };
            if self.json {
                return Ok(print_json(&report)?);
            }
            let Report { output, device, base_gaussians, supplementary_gaussians, seconds, .. } = report;
            Ok(print(format_args!(
                "{output}: {supplementary_gaussians} supplementary Gaussians on {base_gaussians}\n\
                 base {:.1} s, 2D stage {:.1} s, lifting {:.1} s, joint stage {:.1} s on {device}\n",
                seconds.base, seconds.plane, seconds.lift, seconds.join
            ))?)
        })
    }

    /// Everything that the intermediate results depend on, as text.
    fn settings(&self, photos: &[&Photo]) -> Result<String> {
        let base = std::fs::read(&self.base).map_err(|e| Error::io(&self.base, e))?;
        let views: Vec<String> = photos.iter().map(|p| format!("{} {:?}", p.name, p.camera)).collect();
        let settings = serde_json::json!({
            "glint": env!("CARGO_PKG_VERSION"),
            "base_crc32": crc32fast::hash(&base),
            "base_bytes": base.len(),
            "views_crc32": crc32fast::hash(views.join("\n").as_bytes()),
            "views": photos.len(),
            "ratio": self.ratio,
            "preset": format!("{:?}", self.preset),
            "seed": self.seed,
            "background": self.photos.background,
            "depth_threshold": self.depth_threshold,
            "cluster_failure": format!("{:?}", self.cluster_failure),
            "pca_weights": format!("{:?}", self.pca_weights),
        });
        serde_json::to_string_pretty(&settings).map_err(|e| Error::Usage(e.to_string()))
    }
}

/// Mean loss of the first or the last pass over the photos.
fn pass_loss(found: &Enhanced, photos: usize, last: bool) -> Option<f64> {
    let losses = &found.join.as_ref()?.losses;
    let n = photos.min(losses.len());
    let pass = if last { &losses[losses.len() - n..] } else { &losses[..n] };
    Some(pass.iter().map(|&l| f64::from(l)).sum::<f64>() / n.max(1) as f64)
}

fn view_names(photos: &[&Photo]) -> Vec<String> {
    let photos: Vec<Photo> = photos.iter().map(|&p| p.clone()).collect();
    let names = file_names(&photos, "x");
    names.iter().map(|n| Path::new(n).with_extension("").to_string_lossy().into_owned()).collect()
}

/// Augments with a bar for each stage.
pub(super) fn run_with_progress(
    context: &Context,
    scene: &Scene,
    views: &Views,
    options: &EnhanceOptions,
    work: Option<&WorkDir>,
) -> Result<Enhanced> {
    let mut bar: Option<(u64, Progress)> = None;
    let watch = |stage: &Stage| {
        // A bar for each round of a batch, and one for the joint stage.
        let (key, label, done, total) = match stage {
            Stage::Base | Stage::Lift => (0, "", 0, 0),
            Stage::Plane { batch, progress, .. } => {
                (1 + *batch as u64 * 1000 + u64::from(progress.round), "refining", progress.step, progress.steps)
            }
            Stage::Join { step, steps } => (u64::MAX, "joining", *step, *steps),
        };
        if total == 0 {
            bar = None;
        } else {
            if bar.as_ref().is_none_or(|(k, _)| *k != key) {
                bar = None;
                bar = Some((key, Progress::new(label, "steps", total.into())));
            }
            if let Some((_, bar)) = &bar {
                bar.set(done.into());
            }
        }
    };
    enhance(
        context,
        scene,
        views,
        options,
        watch,
        |range| work.map_or(Ok(None), |w| w.resume(range)),
        |batch| work.map_or(Ok(()), |w| w.keep(&views.cameras, batch)),
    )
}
