//! `glint partition`: cuts a dataset into parts that train by themselves.

use std::path::PathBuf;

use serde::Serialize;

use super::{
    Outcome, PhotoArgs, counted,
    output::{Inputs, OutputArgs},
    print, print_json,
    progress::note,
    units,
};
use crate::{
    Error,
    data::{
        Split,
        plan::{Limits, Part, cut},
    },
    pipelines::start::default_gaussians,
};

const EXAMPLES: &str = "\
The cut follows what cameras see: photos and groups of sparse points that show each other stay together. A part also has the \
photos of its neighbors that show it (its ring), and it trains all that its photos show; glint merge keeps what belongs to it. Each \
part is trained by a command of its own, on any device:

  glint partition city -o city.plan.json --photos 500
  glint train city.plan.json --part 0 -o parts/0.ply      and so on for each part
  glint merge city.plan.json parts -o city.ply

`glint eval city.ply city` measures the result. docs/scale.md has the way to many machines.";

/// Cut a dataset into parts that train by themselves
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder or JSON file of the dataset
    dataset: PathBuf,
    /// Output plan, a JSON file
    #[arg(short, long, value_name = "JSON")]
    output: PathBuf,
    /// Maximum number of training photos of a part, not counting its ring
    #[arg(long, value_name = "N", value_parser = units::count(1..=u32::MAX), required_unless_present = "gaussians")]
    photos: Option<u32>,
    /// Maximum number of Gaussians of a part; the whole scene has as many as glint train gives it by default
    #[arg(long, value_name = "N", value_parser = units::count(1..=u32::MAX))]
    gaussians: Option<u32>,
    /// Print JSON with the sizes of all parts
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    replace: OutputArgs,
    #[command(flatten)]
    selection: PhotoArgs,
}

/// Content of `--json`.
#[derive(Serialize)]
struct Report {
    output: PathBuf,
    parts: Vec<Sizes>,
}

#[derive(Serialize)]
struct Sizes {
    /// Training photos, without the ring.
    photos: usize,
    ring: usize,
    test: usize,
    /// Maximum number of Gaussians.
    gaussians: u32,
}

impl Sizes {
    fn of(part: &Part) -> Sizes {
        Sizes { photos: part.photos.len(), ring: part.ring.len(), test: part.test.len(), gaussians: part.gaussians }
    }
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let (dataset, options) = self.selection.clone().open_with_options(&self.dataset)?;
        if dataset.part.is_some() {
            return Err(Error::Usage("a part of a plan is not cut again; expected a dataset".into()).into());
        }
        let inputs = Inputs::default().dataset(&dataset);
        self.replace.check_file(&self.output, "json", "a plan", &inputs)?;
        let pixels = dataset.split(Split::Train).map(|(_, photo)| u64::from(photo.camera.pixels())).sum();
        let points = dataset.points.as_ref().map_or(0, |points| points.positions.len());
        let most = |limit: Option<u32>| limit.map_or(usize::MAX, |limit| limit as usize);
        let limits = Limits {
            photos: most(self.photos),
            gaussians: most(self.gaussians),
            total: default_gaussians(points, pixels),
        };
        let mut notes = Vec::new();
        let plan = cut(&dataset, &self.dataset, &options, limits, &mut notes)?;
        notes.into_iter().for_each(note);
        plan.write(&self.output)?;
        let report = Report { output: self.output.clone(), parts: plan.parts.iter().map(Sizes::of).collect() };
        match self.json {
            true => print_json(&report)?,
            false => print(report.text())?,
        }
        Ok(())
    }
}

impl Report {
    fn text(&self) -> String {
        let mut text = format!("{}: {}\n", self.output.display(), counted(self.parts.len(), "part"));
        text += "part   photos     ring     test  Gaussians\n";
        for (i, Sizes { photos, ring, test, gaussians }) in self.parts.iter().enumerate() {
            text += &format!("{i:>4} {photos:>8} {ring:>8} {test:>8} {gaussians:>10}\n");
        }
        text
    }
}
