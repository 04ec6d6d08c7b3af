//! `glint synth`: writes a ray-traced dataset with known diffuse and specular light.

use std::path::PathBuf;

use super::{
    Outcome,
    output::{Inputs, OutputArgs},
    print,
    progress::note,
};
use crate::data::builtin::synth::{Synth, SynthOptions};

const EXAMPLES: &str = "\
Writes transforms.json, points.ply (sparse points), images/, and the true diffuse and specular part of each photo in diffuse/ \
and specular/: 8-bit sRGB values of linear light that adds up. The cameras surround the scene; the background is black. \
`glint eval --decomposition` compares a scene's parts with the true ones.

Examples:
  glint synth mirror -o mirror
  glint train mirror -o base.ply && glint eval base.ply mirror --decomposition
  glint train mirror -o base.ply --holdout sector";

/// Make a dataset with known diffuse and specular light
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Materials of the scene
    #[arg(value_enum)]
    name: Synth,
    /// Output folder for the dataset; created if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Number of photos
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(i64::from(SynthOptions::LEAST_VIEWS)..=1000))]
    views: u32,
    /// Width and height of each photo, pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 128,
        value_parser = clap::value_parser!(u32).range(i64::from(SynthOptions::LEAST_SIZE)..=2048))]
    size: u32,
    /// Number of sparse points
    #[arg(long, default_value_t = 4000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    points: u32,
    /// Seed for the positions of cameras and sparse points
    #[arg(long, default_value_t = 0)]
    seed: u32,
    #[command(flatten)]
    replace: OutputArgs,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let inputs = Inputs::default();
        let options =
            SynthOptions { views: self.views, size: self.size, points: self.points as usize, seed: self.seed.into() };
        self.replace.check_files(&self.output, options.files().iter().map(String::as_str), &inputs)?;
        self.replace.make_folder(&self.output, &inputs)?;
        note(format!("tracing {} photos of {} × {} pixels", self.views, self.size, self.size));
        let scene = self.name.photograph(&options)?;
        scene.write(&self.output)?;
        Ok(print(format_args!(
            "{}: {} photos and their parts, {} points\n",
            self.output.display(),
            self.views,
            self.points
        ))?)
    }
}
