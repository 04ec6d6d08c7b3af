//! `glint convert`: writes a scene in another file format.

use std::{
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{
    DeviceArgs, DrawArgs, Outcome, PhotoArgs, SceneArgs, SplitArg, counted,
    output::{Inputs, OutputArgs},
    print, print_json,
    progress::{Progress, note},
};
use crate::{
    Error, Result,
    data::{Photo, SceneFile, SceneFormat, read_scene, write_scene_as},
    pipelines::{
        layers::{Layer, Layers},
        render::RenderOptions,
        session::Policy,
        start::photos_of,
    },
    scene::{Scene, color},
};

const EXAMPLES: &str = "\
Examples:
  glint convert base.ply base.spz
  glint convert base.ply base.spz --spz-version 3        for viewers that cannot read version 4
  glint convert augmented.ply base.sog --base-only
  glint convert base.ply web/lod-meta.json --lod 6       levels of detail, each with half of the Gaussians
  glint convert download.splat scene.ply --lenient
  glint convert base.checkpoint.safetensors base.ply     the current state of a run
  glint convert base.ply base.sog --compare garden       PSNR of its renders against the input's";

fn after_help() -> String {
    let line = |format: &SceneFormat| format!("  {:<17}{}\n", format.shown(), format.about);
    let formats: String = SceneFormat::ALL.iter().map(line).collect();
    let lobes = SceneFormat::endings(|format| format.keeps_lobes);
    format!(
        "The ending of the output file decides its format:\n{formats}\n\
         Only {lobes} can store Gaussians with lobes. For other formats such a scene is an error, unless --base-only leaves \
         them out and writes the base as other viewers show it. All commands that take a scene read these files, SPZ from \
         version 1 on, SOG also as a folder, .gltf, and checkpoints.\n\n{EXAMPLES}"
    )
}

/// Convert a scene to another file format
#[derive(Debug, clap::Args)]
#[command(after_help = after_help())]
pub(super) struct Args {
    /// Input scene; its contents decide the format
    input: PathBuf,
    /// Output file; its ending decides the format
    output: PathBuf,
    #[command(flatten)]
    save: SaveArgs,
    #[command(flatten)]
    lenient: SceneArgs,
    /// Render the views of this dataset before and after, and print the mean PSNR of one against the other
    #[arg(long, value_name = "DATASET")]
    compare: Option<PathBuf>,
    /// Photos whose cameras --compare uses
    #[arg(long, value_enum, default_value_t = SplitArg::Test)]
    split: SplitArg,
    /// Print JSON; "psnr" is null if the renders are identical
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    photos: PhotoArgs,
    #[command(flatten)]
    draw: DrawArgs,
    #[command(flatten)]
    device: DeviceArgs,
}

/// Options of writing a scene.
#[derive(Debug, clap::Args)]
pub(super) struct SaveArgs {
    /// Leave out Gaussians with lobes
    #[arg(long)]
    base_only: bool,
    /// Version of the SPZ file, for viewers that cannot read version 4. Version 3 is larger; version 2 also
    /// has coarser rotations; version 1 also has 16-bit positions
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=4))]
    spz_version: Option<u8>,
    /// Number of levels of detail for lod-meta.json, each with half of the Gaussians of the one before
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=16))]
    lod: Option<u8>,
    #[command(flatten)]
    replace: OutputArgs,
}

/// Scene and format that passed the checks before writing.
pub(super) struct Prepared {
    file: SceneFile,
    format: SceneFormat,
}

impl SaveArgs {
    /// Fails if `file` cannot or must not be written to `output`.
    pub(super) fn prepare(&self, output: &Path, file: SceneFile, inputs: &Inputs) -> Result<Prepared> {
        let mut format = SceneFormat::of(output).ok_or_else(|| unknown(output))?;
        if let Some(version) = self.spz_version {
            let refuse = || Error::Usage(format!("{}: --spz-version is only for .spz files", output.display()));
            format = format.in_version(version).ok_or_else(refuse)?;
        }
        if let Some(levels) = self.lod {
            let refuse = || Error::Usage(format!("{}: --lod is only for FOLDER/lod-meta.json", output.display()));
            format = format.with_levels(levels).ok_or_else(refuse)?;
        }
        match format.levels {
            Some(_) => self.replace.check_folder_of(output, inputs)?,
            None => {
                let ending = output.extension().unwrap_or_default().to_string_lossy();
                self.replace.check_file(output, &ending, "a scene", inputs)?;
            }
        }
        let file = if self.base_only { file.into_base() } else { file };
        check_lobes(&file, format, output)?;
        let kept = format.greatest_sh_degree;
        if let Some(degree) = color::of(file.scene.base.sh_degree).harmonics.filter(|&degree| degree > kept) {
            note(format!(
                "{}: view-dependent color is not stored (harmonics of degree {} to {degree})",
                output.display(),
                kept + 1
            ));
        }
        Ok(Prepared { file, format })
    }
}

impl Prepared {
    pub(super) fn write(&self, output: &Path) -> Result<()> {
        for text in write_scene_as(output, self.format, &self.file)? {
            note(format!("{}: {text}", output.display()));
        }
        Ok(())
    }
}

#[derive(Serialize)]
struct Report {
    gaussians: usize,
    supplementary: usize,
    /// Degree of the harmonics; `None` for other color models.
    sh_degree: Option<u32>,
    /// Size of the input, bytes. A folder counts all its files.
    input_bytes: u64,
    output_bytes: u64,
    /// PSNR of the output's renders against the input's, dB; only with `--compare`.
    #[serde(skip_serializing_if = "Option::is_none")]
    psnr: Option<f64>,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let (input, output) = (&self.input, &self.output);
        let file = self.lenient.open_file(input)?;
        let (photos, draw) = (self.photos.like(file.trained_with, input), self.draw.like(file.trained_with, input));
        let dataset = self.compare.as_ref().map(|path| photos.open(path)).transpose()?;
        let mut inputs = Inputs::default().scene(input);
        if let Some(dataset) = &dataset {
            inputs = inputs.dataset(dataset);
        }
        let prepared = self.save.prepare(output, file, &inputs)?;
        let Prepared { file, format } = &prepared;
        let colors = color::of(file.scene.base.sh_degree);
        let written = colors.harmonics.map_or(colors, |degree| color::of(degree.min(format.greatest_sh_degree)));
        // Finds an unusable dataset before anything is written.
        let photos = dataset.as_ref().map(|dataset| photos_of(dataset, self.split.split())).transpose()?;
        prepared.write(output)?;
        let report = Report {
            gaussians: file.scene.base.len(),
            supplementary: file.scene.supplement.as_ref().map_or(0, |s| s.gaussians.len()),
            sh_degree: written.harmonics,
            input_bytes: bytes_of(input),
            output_bytes: bytes_of(output),
            psnr: match (&dataset, &photos) {
                (Some(dataset), Some(photos)) => {
                    Some(self.compare(&file.scene, photos, (dataset.background, draw.policy()))?)
                }
                _ => None,
            },
        };
        match self.json {
            true => print_json(&report)?,
            false => print(report.text(output, written.name))?,
        }
        Ok(())
    }

    /// Mean PSNR over the views.
    fn compare(&self, before: &Scene, photos: &[&Photo], (background, policy): ([f32; 3], Policy)) -> Outcome<f64> {
        let after = read_scene(&self.output)?;
        self.device.with(|context| {
            let cameras = || photos.iter().map(|photo| &photo.camera);
            let options = || RenderOptions { policy, ..Default::default() };
            let mut before = Layers::new(context, before, cameras(), options())?;
            let mut after = Layers::new(context, &after, cameras(), options())?;
            let progress = Progress::new("comparing", "views", photos.len() as u64);
            let mut sum = 0.0;
            for camera in cameras() {
                let color = |layers: &mut Layers| -> Result<Vec<f32>> {
                    Ok(layers.render(Layer::Whole, camera, background)?.color)
                };
                sum += psnr(&color(&mut before)?, &color(&mut after)?);
                progress.advance();
            }
            Ok(sum / photos.len() as f64)
        })
    }
}

/// PSNR of sRGB values, clamped to between 0 and 1; infinite if there is no difference.
fn psnr(a: &[f32], b: &[f32]) -> f64 {
    let off = |(&a, &b): (&f32, &f32)| f64::from(a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0)).powi(2);
    -10.0 * (a.iter().zip(b).map(off).sum::<f64>() / a.len() as f64).log10()
}

impl Report {
    fn text(&self, output: &Path, color: &str) -> String {
        let mut text = format!("{}: {}", output.display(), counted(self.gaussians, "Gaussian"));
        if self.supplementary > 0 {
            let _ = write!(text, ", {} with lobes", self.supplementary);
        }
        let megabytes = |bytes: u64| bytes as f64 / 1e6;
        let (before, now) = (megabytes(self.input_bytes), megabytes(self.output_bytes));
        let _ = write!(text, ", {color}, {now:.3} MB of {before:.3}");
        let _ = match self.psnr {
            Some(psnr) if psnr.is_infinite() => write!(text, ", renders are identical to the input's"),
            Some(psnr) => write!(text, ", renders at {psnr:.2} dB against the input's"),
            None => Ok(()),
        };
        text + "\n"
    }
}

fn unknown(output: &Path) -> Error {
    let endings = SceneFormat::endings(|_| true);
    Error::input(output, format!("has no known ending, expected one of {endings}"))
}

fn check_lobes(file: &SceneFile, format: SceneFormat, output: &Path) -> Result<()> {
    match &file.scene.supplement {
        Some(supplement) if !format.keeps_lobes => {
            let (count, keep) = (supplement.gaussians.len(), SceneFormat::endings(|format| format.keeps_lobes));
            let what = format!(
                "this format cannot store the scene's {count} Gaussians with lobes; leave them out with --base-only, \
                 or write one of {keep}"
            );
            Err(Error::input(output, what))
        }
        _ => Ok(()),
    }
}

/// Size of a file, or of the files in a folder, bytes. The description of levels of detail stands for its folder.
fn bytes_of(path: &Path) -> u64 {
    let path = match (SceneFormat::of(path), path.parent()) {
        (Some(SceneFormat { levels: Some(_), .. }), Some(folder)) => folder,
        _ => path,
    };
    fn within(path: &Path) -> u64 {
        match fs::read_dir(path) {
            Ok(entries) => entries.flatten().map(|entry| within(&entry.path())).sum(),
            Err(_) => fs::metadata(path).map_or(0, |found| found.len()),
        }
    }
    within(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_is_measured_as_it_is_shown() {
        assert!((psnr(&[0.5, 0.2], &[0.4, 0.3]) - 20.0).abs() < 1e-5);
        // Values beyond white and black are not visible.
        assert!((psnr(&[1.5, -1.0], &[0.9, 0.1]) - 20.0).abs() < 1e-5);
        assert_eq!(psnr(&[2.0, 0.5], &[1.0, 0.5]), f64::INFINITY);
    }
}
