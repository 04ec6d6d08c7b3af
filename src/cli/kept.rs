//! What is kept of a loop while it goes on, so that a run that is killed loses a minute and not a night.

use std::{
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use serde_json::{Map, Value, json};

use super::{calibrate, progress::note};
use crate::{
    Error, Result,
    data::Photo,
    gpu::Context,
    pipelines::{
        checkpoint::{Checkpoint, Found},
        raster::TileShape,
    },
};

/// Of a place where a checkpoint should be.
pub(super) const NOTHING: &str =
    "is not there, so there is nothing that --resume could go on from; without it a run begins";

#[derive(Debug, clap::Args)]
pub(super) struct KeepArgs {
    /// Seconds between checkpoints of what is being learned
    #[arg(long, value_name = "SECONDS", default_value_t = 60)]
    checkpoint_every: u64,
    /// Go on from what the same command left when it was ended, and fail where there is nothing of it. Its output is replaced, the checkpoint
    /// of another run never is
    #[arg(long)]
    pub(super) resume: bool,
}

impl KeepArgs {
    pub(super) fn every(&self) -> Duration {
        Duration::from_secs(self.checkpoint_every)
    }
}

/// The checkpoint of one loop.
pub(super) struct Kept {
    path: PathBuf,
    settings: Value,
    every: Duration,
    /// What an earlier run left must be there.
    resume: bool,
    last: Instant,
    /// It was said that it cannot be written.
    warned: bool,
}

impl Kept {
    /// `settings` is everything that the loop depends on.
    pub(super) fn new(path: PathBuf, settings: Value, every: Duration) -> Kept {
        Kept { path, settings, every, resume: false, last: Instant::now(), warned: false }
    }

    /// The same of one that has to be there.
    pub(super) fn demanded(self, resume: bool) -> Kept {
        Kept { resume, ..self }
    }

    /// What an earlier run left. One that is damaged is passed over with a note; one of other settings goes to `foreign`, which
    /// is told why and may fail. Where one is demanded all this is an error.
    pub(super) fn find(&mut self, foreign: impl FnOnce(&Path, &str) -> Result<()>) -> Result<Option<Checkpoint>> {
        match Checkpoint::find(&self.path, &mut self.settings)? {
            Found::Nothing if self.resume => Err(Error::input(&self.path, NOTHING)),
            Found::Nothing => Ok(None),
            Found::Sound(checkpoint) => {
                note(format!("going on after step {} of {}", checkpoint.step, self.path.display()));
                Ok(Some(checkpoint))
            }
            Found::Foreign(why) if self.resume => {
                let what =
                    format!("this is the checkpoint of another run: {why}; --resume wants one of the same options");
                Err(Error::input(&self.path, what))
            }
            Found::Damaged(error) if self.resume => Err(error),
            Found::Foreign(why) => foreign(&self.path, &why).map(|()| None),
            Found::Damaged(error) => {
                note(format!("{error}; all steps are done again"));
                Ok(None)
            }
        }
    }

    /// The tile that the loop is to learn by: where something was found, as it did until then.
    pub(super) fn tile(&self, context: &Context) -> Result<Option<TileShape>> {
        calibrate::tile_of(&self.settings, &self.path, context)
    }

    /// Keeps what `checkpoint` gives if it is time.
    pub(super) fn look(&mut self, checkpoint: impl FnOnce() -> Result<Checkpoint>) -> Result<()> {
        if self.last.elapsed() < self.every {
            return Ok(());
        }
        self.keep(checkpoint)?;
        self.last = Instant::now();
        Ok(())
    }

    /// Keeps what `checkpoint` gives; whether there was room for it. A disk or a memory that is full is said once and is no
    /// reason to end: there may be room when the loop is done.
    pub(super) fn keep(&mut self, checkpoint: impl FnOnce() -> Result<Checkpoint>) -> Result<bool> {
        match checkpoint().and_then(|found| found.write(&self.path, &self.settings)) {
            Ok(()) => Ok(true),
            Err(error) => {
                let full = match &error {
                    Error::Gpu(error) => error.is_no_room(),
                    Error::Io { .. } => true,
                    _ => false,
                };
                if !full {
                    return Err(error);
                }
                if !self.warned {
                    note(format!("what was learned so far cannot be kept: {error}"));
                }
                self.warned = true;
                Ok(false)
            }
        }
    }

    /// Keeps what it can of a loop that ended with `error`, which it gives back.
    pub(super) fn keep_after(&mut self, error: Error, checkpoint: impl FnOnce() -> Result<Checkpoint>) -> Error {
        let kept = matches!(self.keep(checkpoint), Ok(true));
        if kept || self.path.exists() {
            let what = if kept { "what was learned until now" } else { "the last checkpoint" };
            note(format!("{what} is in {}: the same command with --resume goes on from there", self.path.display()));
        }
        error
    }

    /// Nothing is left to go on with.
    pub(super) fn remove(&self) -> Result<()> {
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(Error::io(&self.path, error)),
            _ => Ok(()),
        }
    }
}

/// What `photos` were, by name: `pixels` has the checksum of each as the device has it, after lens, mask and reduction.
pub(super) fn photos_json(photos: &[&Photo], pixels: &[u32]) -> Map<String, Value> {
    let photo = |(photo, pixels): (&&Photo, &u32)| {
        let camera = crc32fast::hash(format!("{:?}", photo.camera).as_bytes());
        (photo.name.clone(), json!({"pixels_crc32": pixels, "camera_crc32": camera}))
    };
    photos.iter().zip(pixels).map(photo).collect()
}
