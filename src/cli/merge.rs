//! `glint merge`: joins the trained parts of a plan.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{
    Outcome, counted,
    output::{Inputs, OutputArgs},
    print, print_json,
    progress::Progress,
};
use crate::{
    Error, Result,
    data::{PartSummary, merge, plan::Plan},
};

const EXAMPLES: &str = "\
glint merge writes those Gaussians of each part whose nearest seed in the plan belongs to that part. One part is in memory at a \
time. The same parts give the same bytes.

Examples:
  glint merge city.plan.json parts -o city.ply
  glint merge city.plan.json parts/0.ply parts/1.ply -o city.ply";

/// Merge the trained parts of a plan into one scene
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Plan of glint partition
    plan: PathBuf,
    /// Scenes of all parts in any order, or one folder with them
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// Output PLY file
    #[arg(short, long, value_name = "PLY")]
    output: PathBuf,
    /// Print JSON with what was kept of each part
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    replace: OutputArgs,
}

/// Content of `--json`.
#[derive(Serialize)]
struct Report<'a> {
    output: &'a Path,
    gaussians: usize,
    parts: Vec<PartSummary>,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let plan = Plan::read(&self.plan)?;
        let parts = self.files()?;
        let inputs = parts.iter().fold(Inputs::default().scene(&self.plan), |inputs, part| inputs.scene(part));
        self.replace.check_ply(&self.output, &inputs)?;
        let progress = Progress::new("merging", "parts read", 0);
        let mut read = 0;
        let parts = merge(&plan, &parts, &self.output, |of| {
            read += 1;
            progress.set_of(read, of);
        })?;
        drop(progress);
        let report = Report { output: &self.output, gaussians: parts.iter().map(|part| part.kept).sum(), parts };
        match self.json {
            true => print_json(&report)?,
            false => print(report.text())?,
        }
        Ok(())
    }

    /// The scenes: those given, or the PLY files of the folder.
    fn files(&self) -> Result<Vec<PathBuf>> {
        let [folder] = &self.parts[..] else { return Ok(self.parts.clone()) };
        if !folder.is_dir() {
            return Ok(self.parts.clone());
        }
        let at = |source| Error::io(folder, source);
        let entries = fs::read_dir(folder).map_err(at)?;
        let mut files = entries.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>().map_err(at)?;
        let is_output =
            |path: &PathBuf| *path == self.output || fs::canonicalize(path).ok() == fs::canonicalize(&self.output).ok();
        files.retain(|path| {
            path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("ply")) && !is_output(path)
        });
        files.sort();
        match files.is_empty() {
            true => Err(Error::input(folder, "has no PLY files, expected the scenes of a plan's parts")),
            false => Ok(files),
        }
    }
}

impl Report<'_> {
    fn text(&self) -> String {
        let mut text = format!(
            "{}: {} of {}\npart      kept  with lobes  left out  at seams\n",
            self.output.display(),
            counted(self.gaussians, "Gaussian"),
            counted(self.parts.len(), "part")
        );
        for (i, PartSummary { kept, kept_lobes, left_out, at_seams }) in self.parts.iter().enumerate() {
            text += &format!("{i:>4} {kept:>9} {kept_lobes:>11} {left_out:>9} {:>7.1} %\n", 100.0 * at_seams);
        }
        text
    }
}
