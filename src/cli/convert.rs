use std::{
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

use serde::Serialize;

use super::{
    Outcome, SceneArgs,
    output::{Inputs, OutputArgs},
    print, print_json,
    progress::note,
};
use crate::{
    Error, Result,
    data::{SceneFile, SceneFormat, write_scene_file},
};

const EXAMPLES: &str = "\
The ending of the output's name says what it becomes:
  .ply             everything, bit for bit
  .splat           positions and sizes, colours and rotations as bytes; no view-dependent colour

Gaussians with lobes are an error where the output has no place for them; with --base-only they are left out, and what \
other viewers show of an augmented PLY is written. All commands that take a scene read these files too.

Examples:
  glint convert base.ply base.splat
  glint convert augmented.ply base.splat --base-only
  glint convert download.splat scene.ply --lenient";

/// Write a scene as a file of another kind
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene, told by its contents
    input: PathBuf,
    /// File to write
    output: PathBuf,
    /// Leave out Gaussians with lobes
    #[arg(long)]
    base_only: bool,
    #[command(flatten)]
    lenient: SceneArgs,
    #[command(flatten)]
    replace: OutputArgs,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    gaussians: usize,
    supplementary: usize,
    sh_degree: u32,
    /// Bytes of the input; of a folder, of all files in it.
    input_bytes: u64,
    output_bytes: u64,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        let (input, output) = (&self.input, &self.output);
        let format = SceneFormat::of(output).ok_or_else(|| unknown(output))?;
        let ending = output.extension().unwrap_or_default().to_string_lossy();
        self.replace.check_file(output, &ending, "a scene", &Inputs::default().scene(input))?;
        let mut file = self.lenient.open_file(input)?;
        if self.base_only {
            file = file.into_base();
        }
        check_lobes(&file, format, output)?;
        let degree = file.scene.base.sh_degree;
        if degree > format.greatest_sh_degree() {
            note(format!(
                "{}: colour that depends on the view is not kept (harmonics of degree {} to {degree})",
                output.display(),
                format.greatest_sh_degree() + 1
            ));
        }
        write_scene_file(output, &file)?;
        let report = Report {
            gaussians: file.scene.base.len(),
            supplementary: file.scene.supplement.as_ref().map_or(0, |s| s.gaussians.len()),
            sh_degree: degree.min(format.greatest_sh_degree()),
            input_bytes: bytes_of(input),
            output_bytes: bytes_of(output),
        };
        match self.json {
            true => print_json(&report)?,
            false => print(report.text(output))?,
        }
        Ok(())
    }
}

impl Report {
    fn text(&self, output: &Path) -> String {
        let mut text = format!("{}: {} Gaussians", output.display(), self.gaussians);
        if self.supplementary > 0 {
            let _ = write!(text, ", {} with lobes", self.supplementary);
        }
        let megabytes = |bytes: u64| bytes as f64 / 1e6;
        let (before, now) = (megabytes(self.input_bytes), megabytes(self.output_bytes));
        text + &format!(", SH degree {}, {now:.3} MB of {before:.3}\n", self.sh_degree)
    }
}

fn unknown(output: &Path) -> Error {
    let endings: Vec<String> = SceneFormat::ALL.iter().map(|(ending, _)| format!(".{ending}")).collect();
    Error::input(output, format!("has no ending that says what to write, expected one of {}", endings.join(", ")))
}

fn check_lobes(file: &SceneFile, format: SceneFormat, output: &Path) -> Result<()> {
    match &file.scene.supplement {
        Some(supplement) if !format.keeps_lobes() => {
            let count = supplement.gaussians.len();
            let what = format!(
                "this format has no place for the scene's {count} Gaussians with lobes; --base-only leaves them out, .ply keeps them"
            );
            Err(Error::input(output, what))
        }
        _ => Ok(()),
    }
}

/// Of a folder, the bytes of the files in it.
fn bytes_of(path: &Path) -> u64 {
    let size = |path: &Path| fs::metadata(path).map_or(0, |found| found.len());
    match fs::read_dir(path) {
        Ok(entries) => entries.flatten().map(|entry| size(&entry.path())).sum(),
        Err(_) => size(path),
    }
}
