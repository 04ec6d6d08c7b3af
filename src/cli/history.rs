//! History of a training run: evaluates the scene on the test photos every few steps, and writes a line and
//! a picture each time.

use std::{
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
};

use image::{RgbImage, imageops};
use serde::Serialize;
use serde_json::Value;

use super::{
    dataset::note_uncounted,
    output::{Inputs, OutputArgs},
    progress::{Progress, note},
};
use crate::{
    Error, Result,
    data::{Photo, write_png_bytes, write_text},
    gpu::Context,
    pipelines::render::RenderOptions,
    report::{evaluate::evaluate, metrics::Quality, pictures::pictures},
    scene::Scene,
};

/// Extensions that replace the output's: of the file, and of the folder of pictures.
pub(super) const FILE: &str = "history.jsonl";
const FOLDER: &str = "history";
/// Prefix of the pictures' names.
const STEP: &str = "step-";

/// Line of the file; `glint report --history` reads a subset of it.
#[derive(Serialize)]
struct Line<'a> {
    name: &'a str,
    step: u32,
    /// Time of training, without evaluations, seconds.
    seconds: f64,
    bytes: u64,
    gaussians: usize,
    loss: f64,
    #[serde(flatten)]
    quality: Quality,
    seed: u64,
    holdout: &'a str,
}

/// State of a run at a step, without its scene.
pub(super) struct Moment {
    pub(super) step: u32,
    pub(super) seconds: f64,
    /// Size of the scene's file without its header, bytes.
    pub(super) bytes: u64,
    /// Mean over the last pass through the photos.
    pub(super) loss: f64,
}

/// Evaluations of one run.
pub(super) struct History<'a> {
    context: &'a Context,
    photos: Vec<&'a Photo>,
    background: [f32; 3],
    name: String,
    seed: u64,
    holdout: String,
    path: PathBuf,
    folder: PathBuf,
    lines: String,
    /// Time of earlier runs, seconds.
    seconds: f64,
    /// Whether a note has reported that the file cannot be written.
    warned: bool,
}

impl<'a> History<'a> {
    /// History of a run that writes `output`, measured on `photos`.
    pub(super) fn new(
        context: &'a Context,
        output: &Path,
        photos: Vec<&'a Photo>,
        background: [f32; 3],
        seed: u64,
        holdout: String,
    ) -> Self {
        let name = output.file_stem().map_or(String::new(), |stem| stem.to_string_lossy().into_owned());
        let [path, folder] = [FILE, FOLDER].map(|extension| output.with_extension(extension));
        let (lines, seconds, warned) = (String::new(), 0.0, false);
        History { context, photos, background, name, seed, holdout, path, folder, lines, seconds, warned }
    }

    /// Continues the history of an earlier run up to step `resumed`. A new run fails if there is a history,
    /// unless it may be replaced.
    pub(super) fn begin(&mut self, resumed: Option<u32>, replace: &OutputArgs, inputs: &Inputs) -> Result<()> {
        let Some(step) = resumed else {
            replace.check_file(&self.path, "jsonl", "a history", inputs)?;
            replace.make_folder(&self.folder, inputs)?;
            let found = fs::read_dir(&self.folder).map_err(|error| Error::io(&self.folder, error))?;
            let mut names: Vec<_> = found.flatten().filter_map(|file| file.file_name().into_string().ok()).collect();
            names.sort();
            let pictures =
                names.iter().map(String::as_str).filter(|name| name.starts_with(STEP) && name.ends_with(".png"));
            replace.check_files(&self.folder, pictures.clone(), inputs)?;
            // Pictures that may be replaced belong to another run.
            return pictures
                .map(|name| self.folder.join(name))
                .try_for_each(|path| fs::remove_file(&path).map_err(|error| Error::io(&path, error)));
        };
        // The earlier run may have had no history.
        replace.make_folder(&self.folder, inputs)?;
        let text = match fs::read_to_string(&self.path) {
            Ok(text) => text,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(Error::io(&self.path, error)),
        };
        for line in text.lines() {
            let value: Value = serde_json::from_str(line)
                .map_err(|error| Error::input(&self.path, format!("is not a history, expected JSON lines: {error}")))?;
            // Steps after the checkpoint are evaluated again.
            if value["step"].as_u64().is_some_and(|at| at <= step.into()) {
                self.lines += line;
                self.lines += "\n";
                self.seconds = value["seconds"].as_f64().unwrap_or(self.seconds);
            }
        }
        Ok(())
    }

    /// Whether there is a line for `step`.
    pub(super) fn has(&self, step: u32) -> bool {
        let of = |line: &str| serde_json::from_str::<Value>(line).is_ok_and(|value| value["step"] == step);
        self.lines.lines().any(of)
    }

    /// Evaluates `scene` on all test photos. Writes a line, and a picture of the first photo, its render
    /// and its error. If the disk is full, a note reports it once and the run continues; the next line is
    /// written together with the missing ones.
    pub(super) fn add(&mut self, scene: &Scene, moment: Moment, options: RenderOptions) -> Result<()> {
        let Moment { step, seconds, bytes, loss } = moment;
        let progress = Progress::new("evaluating", "views", self.photos.len() as u64);
        let mut first = None;
        let found = evaluate(self.context, scene, &self.photos, options, self.background, |view| {
            progress.advance();
            if first.is_none() {
                first = Some(row(&pictures(view)));
            }
            Ok(())
        })?;
        drop(progress);
        if self.lines.is_empty() {
            note_uncounted(self.photos.len() - found.views.len());
        }
        let line = Line {
            name: &self.name,
            step,
            seconds: self.seconds + seconds,
            bytes,
            gaussians: scene.base.len(),
            loss,
            quality: found.augmented,
            seed: self.seed,
            holdout: &self.holdout,
        };
        self.lines += &serde_json::to_string(&line).map_err(|error| Error::Usage(error.to_string()))?;
        self.lines += "\n";
        let line = write_text(&self.path, &self.lines);
        let picture = first.map_or(Ok(()), |picture| {
            let path = self.folder.join(format!("{STEP}{step:06}.png"));
            write_png_bytes(path, picture.width(), picture.height(), picture.as_raw())
        });
        match line.and(picture) {
            Err(error @ Error::Io { .. }) if !self.warned => {
                note(format!("the evaluation cannot be saved: {error}; the run continues"));
                self.warned = true;
            }
            Err(Error::Io { .. }) => {}
            written => written?,
        }
        let Quality { psnr, ssim } = found.augmented;
        note(format!("step {step}: {psnr:.2} dB, SSIM {ssim:.4}, {} Gaussians", scene.base.len()));
        Ok(())
    }
}

/// Places pictures side by side.
fn row(pictures: &[RgbImage]) -> RgbImage {
    let width = pictures.iter().map(RgbImage::width).sum();
    let mut all = RgbImage::new(width, pictures.iter().map(RgbImage::height).max().unwrap_or(0));
    let mut x = 0;
    for picture in pictures {
        imageops::replace(&mut all, picture, x, 0);
        x += i64::from(picture.width());
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_stand_in_a_row() {
        let picture = |side: u32, value: u8| RgbImage::from_pixel(side, side, image::Rgb([value; 3]));
        let all = row(&[picture(2, 10), picture(3, 20)]);
        assert_eq!(all.dimensions(), (5, 3));
        assert_eq!([all.get_pixel(1, 1).0[0], all.get_pixel(2, 2).0[0], all.get_pixel(0, 2).0[0]], [10, 20, 0]);
    }
}
