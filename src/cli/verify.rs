//! `glint verify`: tests a device and its driver by comparing every kernel with float64.

use std::path::{Path, PathBuf};

use super::{DeviceArgs, DrawArgs, Failure, Outcome, PhotoArgs, SceneArgs, print, print_json, progress::Progress};
use crate::{
    data::Split,
    error::Result,
    gpu::Context,
    pipelines::{
        session::Session,
        start::{first_points, photos_of},
        views::scene_origin_for,
    },
    scene::{Camera, Scene, from_points},
    verify::{Options, Report, STEPS, explain, run, work},
};

const EXAMPLES: &str = "\
Examples:
  glint verify --quick                     # check this device and its driver
  glint verify garden                      # check the first training steps on a dataset
  glint verify garden base.ply             # start these steps from a scene";

/// Check a device and its driver: the error of every kernel against float64, and its time
///
/// Without a dataset, every stage runs in each variant, on built-in data. With a dataset, glint trains on
/// its photos for 30 steps and compares each dispatch with float64 on the same buffers: a broken row names
/// the stage that deviates. The exit code is 1 if a bound is broken.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder or JSON file of a dataset, to check the first training steps on it
    #[arg(conflicts_with = "quick")]
    dataset: Option<PathBuf>,
    /// Scene to start from, instead of the dataset's points
    scene: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    photos: PhotoArgs,
    #[command(flatten)]
    draw: DrawArgs,
    #[command(flatten)]
    lenient: SceneArgs,
    /// Check small cases only: less than a minute on two CPU cores, instead of some minutes
    #[arg(long)]
    quick: bool,
    /// Print JSON: {"device","rates","rows":[{"stage","variant","errors","breaches","blind","time"}],"seconds"};
    /// times in seconds
    #[arg(long)]
    json: bool,
    /// Self-test of the bounds: also compare with reference results that are off by this relative error, 0 to
    /// 1. A row fails as blind if its bounds do not notice the error; with 0.002, no row does
    #[arg(long, value_name = "ERROR", default_value_t = 0.0, hide_default_value = true, value_parser = parse_error)]
    perturb: f64,
    /// Print the bounds and their reasons, and exit
    #[arg(long, conflicts_with_all = ["quick", "json", "perturb"])]
    explain: bool,
}

fn parse_error(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|e| (0.0..=1.0).contains(e)).ok_or_else(|| "expected a number from 0 to 1".into())
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        if self.explain {
            return Ok(print(explain())?);
        }
        self.device.with_unchecked(|context| {
            let report = match &self.dataset {
                Some(dataset) => self.work(context, dataset)?,
                None => run(context, &Options { quick: self.quick, perturb: self.perturb })?,
            };
            if self.json {
                print_json(&report)?;
            } else {
                print(&report)?;
            }
            match report.broken() {
                0 => Ok(()),
                count => Err(Failure::Bounds(count)),
            }
        })
    }

    fn work(&self, context: &Context, dataset: &Path) -> Result<Report> {
        let file = self.scene.as_ref().map(|scene| self.lenient.open_file(scene)).transpose()?;
        let (mut photos, mut draw) = (self.photos.clone(), self.draw);
        if let (Some(path), Some(file)) = (&self.scene, &file) {
            (photos, draw) = (photos.like(file.trained_with, path), draw.like(file.trained_with, path));
        }
        let dataset = photos.open(dataset)?;
        let photos = photos_of(&dataset, Some(Split::Train))?;
        let cameras: Vec<Camera> = photos.iter().map(|photo| photo.camera).collect();
        let origin = scene_origin_for(&cameras);
        let scene = match file {
            Some(file) => file.scene.around(origin),
            None => {
                let cloud = first_points(&dataset, None, 0).cloud;
                let mut base = from_points(&cloud.around(origin), &cloud.colors, 3);
                // The gradient of a sphere's rotation is 0; float32 would compute only rounding errors.
                base.log_scales.iter_mut().for_each(|axes| (axes[0], axes[1]) = (axes[0] + 0.1, axes[1] - 0.1));
                Scene { base, origin, ..Default::default() }
            }
        };
        let (policy, background) = (draw.policy(), dataset.background);
        let session = Session { policy, background, extent: dataset.extent() as f32, ..Session::new(context) };
        let progress = Progress::new("verifying", "steps", u64::from(STEPS));
        work(&session, &photos, &scene, self.perturb, |_| progress.advance())
    }
}
