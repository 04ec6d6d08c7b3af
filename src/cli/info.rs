//! `glint info`: describes a scene or a dataset.

use std::{fmt::Write, path::PathBuf};

use serde::Serialize;

use super::{DeviceArgs, Outcome, SceneArgs, counted, dataset::DatasetArgs, print, print_json};
use crate::{
    Error,
    data::{DatasetOptions, Kind, SceneFile, TrainedWith, is_scene_folder},
    gpu::Context,
    report::{
        plan::RenderPlan,
        summary::{DatasetSummary, GaussiansSummary, SceneSummary, Spread},
    },
};

const EXAMPLES: &str = "\
Examples:
  glint info augmented.ply
  glint info augmented.ply --plan --resolution 3840x2160 --half     memory that an engine needs to draw it
  glint info garden                                                a dataset";

/// Describe a scene or a dataset
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene, or folder or JSON file of a dataset; the contents decide
    #[arg(value_name = "SCENE|DATASET")]
    path: PathBuf,
    #[command(flatten)]
    lenient: SceneArgs,
    #[command(flatten)]
    dataset: DatasetArgs,
    /// For a scene, also show the kernels, buffers and memory of rendering, and the parts that it leaves
    /// out
    #[arg(long)]
    plan: bool,
    /// Size of the plan's view, pixels
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1920x1080", value_parser = parse_size, requires = "plan")]
    resolution: Size,
    /// Plan a model of half width
    #[arg(long, requires = "plan")]
    half: bool,
    #[command(flatten)]
    device: DeviceArgs,
    /// Print JSON; "kind" is "scene" or "dataset", and a scene has "plan" with --plan
    #[arg(long)]
    json: bool,
}

/// Width and height.
type Size = [u32; 2];

fn parse_size(text: &str) -> Result<Size, String> {
    let sides = text.split_once('x').map(|(width, height)| [width, height].map(str::parse::<u32>));
    match sides {
        Some([Ok(width @ 1..=MOST_SIDE), Ok(height @ 1..=MOST_SIDE)]) => Ok([width, height]),
        _ => Err(format!("expected two numbers of 1 to {MOST_SIDE}, as in 1920x1080")),
    }
}

/// Maximum side of a view, pixels.
const MOST_SIDE: u32 = 1 << 15;

#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Found {
    Scene {
        #[serde(flatten)]
        scene: Box<SceneSummary>,
        #[serde(skip_serializing_if = "TrainedWith::is_unknown")]
        trained_with: TrainedWith,
        #[serde(skip_serializing_if = "Option::is_none")]
        plan: Option<Box<RenderPlan>>,
    },
    Dataset(DatasetSummary),
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let path = &self.path;
        let kind = match path.is_dir() {
            true if is_scene_folder(path) => Some(Kind::Sog),
            true => None,
            false => Some(Kind::of_file(path)?),
        };
        let found = match kind {
            None | Some(Kind::Json) if self.plan => {
                return Err(Error::input(path, "is a dataset, expected a scene for --plan").into());
            }
            // A video is not a dataset; `open` explains what to do with it.
            None | Some(Kind::Json | Kind::Video) => {
                Found::Dataset(DatasetSummary::of(&self.dataset.open(path, DatasetOptions::default())?.0))
            }
            Some(kind) if kind.may_be_scene() => {
                let SceneFile { scene, trained_with, .. } = self.lenient.open_file(path)?;
                let plan = |context: &Context| Ok(RenderPlan::of(context.info(), &scene, self.resolution, self.half)?);
                let plan = if self.plan { Some(Box::new(self.device.with(plan)?)) } else { None };
                Found::Scene { scene: Box::new(SceneSummary::of(&scene)), trained_with, plan }
            }
            Some(other) => {
                let what = format!("is {other}; expected a scene, a transforms.json or a folder with a dataset");
                return Err(Error::input(path, what).into());
            }
        };
        match &found {
            _ if self.json => print_json(&found)?,
            Found::Scene { scene, trained_with, plan } => {
                print(scene_text(scene, trained_with) + &plan.as_ref().map(ToString::to_string).unwrap_or_default())?;
            }
            Found::Dataset(dataset) => print(dataset_text(dataset))?,
        }
        Ok(())
    }
}

/// Lines of a title and a text. Writing to a string cannot fail.
struct Lines(String);

impl Lines {
    fn add(&mut self, title: &str, text: impl std::fmt::Display) {
        let _ = writeln!(self.0, "{title:<16}{text}");
    }
}

fn spread(spread: &Option<Spread>) -> String {
    spread.map_or("–".into(), |s| {
        format!("median {:.4}, 90 % in {:.4} to {:.4}, all in {:.4} to {:.4}", s.median, s.p5, s.p95, s.min, s.max)
    })
}

/// Settings in words; empty if the file has none.
fn trained_text(&TrainedWith { background, antialiased, max_size, exposure, matte, part }: &TrainedWith) -> String {
    let said = [
        background.map(|[r, g, b]| format!("background {r},{g},{b}")),
        max_size.map(|pixels| format!("photos of at most {pixels} pixels")),
        antialiased.filter(|&yes| yes).map(|_| "antialiasing".to_owned()),
        exposure.filter(|&yes| yes).map(|_| "an exposure for each photo".to_owned()),
        matte.filter(|&yes| yes).map(|_| "no color depends on the view".to_owned()),
        part.map(|part| format!("part {part}")),
    ];
    said.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

fn scene_text(scene: &SceneSummary, trained_with: &TrainedWith) -> String {
    let mut lines = Lines(String::new());
    match &scene.supplement {
        Some(supplement) => {
            let lobed = match supplement.sh_degree {
                Some(degree) if supplement.color != scene.color => format!(" and {degree}"),
                _ => String::new(),
            };
            lines.add(
                "scene",
                format_args!(
                    "{} base and {} supplementary Gaussians, {}{lobed}",
                    scene.base.count, supplement.gaussians.count, scene.color
                ),
            )
        }
        None => {
            let count = counted(scene.base.count, "Gaussian");
            lines.add("scene", format_args!("{count}, {}, no supplement", scene.color))
        }
    }
    if let Some(banded) = scene.banded {
        lines.add(
            "bands",
            format_args!("{banded} of {} Gaussians of the base; the others have a constant color", scene.base.count),
        );
    }
    if let Some([x, y, z]) = scene.origin {
        lines.add("origin", format_args!("{x}, {y}, {z}: positions count from there"));
    }
    let trained = trained_text(trained_with);
    if !trained.is_empty() {
        lines.add("trained with", trained);
    }
    gaussians_text(&mut lines, &scene.base);
    if let Some(supplement) = &scene.supplement {
        lines.add("supplement", format_args!("{} with lobes", counted(supplement.gaussians.count, "Gaussian")));
        gaussians_text(&mut lines, &supplement.gaussians);
        lines.add("  lobe width", spread(&supplement.lobes.width));
        lines.add("  sharpness", spread(&supplement.lobes.sharpness));
    }
    lines.0
}

fn gaussians_text(lines: &mut Lines, gaussians: &GaussiansSummary) {
    if let Some([low, high]) = gaussians.bounds {
        lines.add("  bounds", format_args!("{low:.3?} to {high:.3?}"));
    }
    lines.add("  opacity", spread(&gaussians.opacity));
    lines.add("  largest scale", spread(&gaussians.largest_scale));
    lines.add("  smallest", spread(&gaussians.smallest_scale));
}

fn dataset_text(dataset: &DatasetSummary) -> String {
    let mut lines = Lines(String::new());
    lines.add("dataset", dataset.format);
    lines.add("photos", format_args!("{} ({} train, {} test)", dataset.photos, dataset.train, dataset.test));
    // Photo collections may have a different size for each photo.
    let shown = 3;
    let mut sizes: Vec<String> =
        dataset.sizes.iter().take(shown).map(|s| format!("{} × {} ({})", s.width, s.height, s.photos)).collect();
    if dataset.sizes.len() > shown {
        sizes.push(format!("{} other sizes", dataset.sizes.len() - shown));
    }
    lines.add("sizes", sizes.join(", "));
    lines.add("points", dataset.points.map_or("none".into(), |n| n.to_string()));
    if dataset.undistorted > 0 {
        let outside = 100.0 * dataset.outside;
        let text = format!(
            "removed from {}; at most {outside:.1} % of one does not count",
            counted(dataset.undistorted, "photo")
        );
        lines.add("distortion", text);
    }
    if dataset.masked > 0 {
        lines.add("masks", counted(dataset.masked, "photo"));
    }
    lines.add("extent", format_args!("{:.4} scene units", dataset.extent));
    if let (Some(center), Some(radius)) = (dataset.focus_center, dataset.focus_radius) {
        lines.add("focus", format_args!("{center:.3?}, cameras at {radius:.3} from it"));
    }
    lines.0
}
