//! `glint eval`: measures PSNR, SSIM and LPIPS of a scene against the photos of a dataset.

use std::path::PathBuf;

use serde::Serialize;

use super::{
    DeviceArgs, DrawArgs, Outcome, PhotoArgs, SceneArgs, SplitArg,
    dataset::{note_foreign, note_uncounted},
    print, print_json,
    progress::{Progress, note},
};
use crate::{
    data::SceneFile,
    pipelines::{render::RenderOptions, start::photos_of},
    report::{
        decompose::PartsQuality,
        evaluate::{Evaluation, PartsEvaluation, evaluate, evaluate_parts},
        lpips::Lpips,
        metrics::Quality,
        table::{Cell, Column, Table},
    },
};

const EXAMPLES: &str = "\
PSNR and SSIM (window 11, σ 1.5) compare renders with 8-bit photos. Renders are sRGB values clamped to between 0 and 1, not \
quantized. \"base\" has the base Gaussians as stored in this file; augmenting changes their opacities, so it is not the \
scene that was augmented. Without a supplement, \"augmented\" equals \"base\".

`glint report` shows the renders and their errors on a page.

Examples:
  glint eval augmented.ply garden
  glint eval augmented.ply mirror --decomposition      # of glint synth mirror -o mirror
  glint eval augmented.ply garden --lpips vgg.safetensors
  glint eval base.ply lego --split all --json | jq .base.psnr";

/// Measure a scene against photos: PSNR and SSIM of each view, and their means
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene to measure
    scene: PathBuf,
    /// Folder or JSON file of the dataset
    dataset: PathBuf,
    /// Photos to compare with
    #[arg(long, value_enum, default_value_t = SplitArg::Test)]
    split: SplitArg,
    /// Print JSON:
    /// {"base":{"psnr","ssim"},"augmented":{"psnr","ssim"},"views":[{"name","base","augmented"}]}; an
    /// infinite PSNR is null
    #[arg(long)]
    json: bool,
    /// Also compare diffuse and specular light with the true parts of each photo (folders diffuse and
    /// specular, as glint synth writes them): PSNR in linear light. JSON: "decomposition"
    #[arg(long)]
    decomposition: bool,
    /// Also compute LPIPS with these weights: the state_dict of lpips.LPIPS without its lins.* copies, as
    /// safetensors. The names of its tensors decide between AlexNet and VGG. JSON: "lpips"
    #[arg(long, value_name = "FILE")]
    lpips: Option<PathBuf>,
    #[command(flatten)]
    lenient: SceneArgs,
    #[command(flatten)]
    photos: PhotoArgs,
    #[command(flatten)]
    draw: DrawArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let SceneFile { scene, trained_with, .. } = self.lenient.open_file(&self.scene)?;
        let (photos, draw) = (self.photos.like(trained_with, &self.scene), self.draw.like(trained_with, &self.scene));
        let dataset = photos.open(&self.dataset)?;
        let photos = photos_of(&dataset, self.split.split())?;
        if scene.supplement.is_none() {
            note(format!("{} has no supplement: its base is the whole scene", self.scene.display()));
        }
        let lpips = self.lpips.as_ref().map(Lpips::read).transpose()?;
        let augmented = scene.supplement.is_some();
        let mut distances = Vec::new();
        let (found, parts) = self.device.with(|context| {
            let options = || RenderOptions { policy: draw.policy(), ..Default::default() };
            let parts = || evaluate_parts(context, &scene, &photos, options(), dataset.background);
            let parts = self.decomposition.then(parts).transpose()?;
            let progress = Progress::new("comparing", "views", photos.len() as u64);
            let found = evaluate(context, &scene, &photos, options(), dataset.background, |view| {
                progress.advance();
                if let Some(lpips) = &lpips {
                    distances.push(lpips.of_view(view)?);
                }
                Ok(())
            })?;
            Ok((found, parts))
        })?;
        note_uncounted(photos.len() - found.views.len());
        note_foreign(&self.scene, found.augmented.psnr);
        let distances = lpips.is_some().then(|| Evaluation::of(distances));
        let numbers = Numbers { found: &found, decomposition: parts.as_ref(), lpips: distances.as_ref() };
        if self.json {
            print_json(&numbers)?
        } else {
            print(table(&numbers, augmented))?
        }
        Ok(())
    }
}

/// Content of `--json`.
#[derive(Serialize)]
struct Numbers<'a> {
    #[serde(flatten)]
    found: &'a Evaluation,
    #[serde(skip_serializing_if = "Option::is_none")]
    decomposition: Option<&'a PartsEvaluation>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lpips: Option<&'a Evaluation<f64>>,
}

/// Table with a row for each view and one for the mean. It has columns of the supplement and of the parts
/// only if those exist.
fn table(numbers: &Numbers<'_>, augmented: bool) -> Table {
    let Numbers { found, decomposition: parts, lpips } = *numbers;
    let text = Column::new("view", "", 0);
    let psnr = |title| Column::new(title, "dB", 2);
    let pure = |title| Column::new(title, "", 4);
    let mut columns = vec![text];
    if augmented {
        columns.extend([psnr("base PSNR"), pure("base SSIM")]);
    }
    columns.extend([psnr("PSNR"), pure("SSIM")]);
    if parts.is_some() {
        columns.extend([psnr("diffuse PSNR"), psnr("specular PSNR")]);
    }
    if lpips.is_some() {
        columns.extend(augmented.then(|| pure("base LPIPS")));
        columns.push(pure("LPIPS"));
    }
    let mut table = Table::new(columns);
    let mut row = |name: &str, [base, whole]: [Quality; 2], parts: Option<PartsQuality>, lpips: Option<[f64; 2]>| {
        let shown = if augmented { vec![base, whole] } else { vec![whole] };
        let numbers = shown.into_iter().flat_map(|q| [Cell::Number(q.psnr), Cell::Number(q.ssim)]);
        let parts = parts.into_iter().flat_map(|q| [Cell::Number(q.diffuse), Cell::Number(q.specular)]);
        let distances = lpips.into_iter().flatten().skip(usize::from(!augmented)).map(Cell::Number);
        table.row(std::iter::once(name.into()).chain(numbers).chain(parts).chain(distances));
    };
    for (i, view) in found.views.iter().enumerate() {
        let distances = lpips.map(|lpips| [lpips.views[i].base, lpips.views[i].augmented]);
        row(&view.name, [view.base, view.augmented], parts.map(|parts| parts.views[i].quality), distances);
    }
    let distances = lpips.map(|lpips| [lpips.base, lpips.augmented]);
    row("mean", [found.base, found.augmented], parts.map(|parts| parts.mean), distances);
    table
}
