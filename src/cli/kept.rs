//! Checkpoint file of a run, so that a killed run loses at most a minute.

use std::{
    fs,
    io::ErrorKind,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::progress::note;
use crate::{
    Error, Result,
    data::{Photo, TrainedWith},
    pipelines::{
        checkpoint::{Checkpoint, Found},
        session::{Policy, Reduction, Session},
    },
    scene::layout,
};

/// Extension that replaces the output's.
const CHECKPOINT: &str = "checkpoint.safetensors";

#[derive(Debug, clap::Args)]
pub(super) struct KeepArgs {
    /// Seconds between checkpoints
    #[arg(long, value_name = "SECONDS", default_value_t = 60)]
    checkpoint_every: u64,
    /// Start over even if there is a checkpoint, whatever its options; it is renamed to *.old. Without
    /// this, the same command resumes from it
    #[arg(long)]
    restart: bool,
}

impl KeepArgs {
    /// Checkpoint file of a run that writes `output`.
    pub(super) fn checkpoint(output: &Path) -> PathBuf {
        output.with_extension(CHECKPOINT)
    }

    /// Whether an interrupted run left a checkpoint for `output`, whose output may then be replaced. A run
    /// writes a checkpoint only if it may write its output.
    pub(super) fn owns(output: &Path) -> bool {
        Self::checkpoint(output).exists()
    }
}

/// Checkpoint of one loop.
pub(super) struct Kept {
    path: PathBuf,
    settings: Value,
    /// Stored in the checkpoint for commands that read it as a scene.
    trained_with: TrainedWith,
    every: Duration,
    restart: bool,
    last: Instant,
    /// Whether a note has reported that the file cannot be written.
    warned: bool,
}

impl Kept {
    /// Checkpoint of a run that writes `output`. `settings` is everything that determines the result.
    pub(super) fn new(output: &Path, settings: Value, args: &KeepArgs, trained_with: TrainedWith) -> Kept {
        let &KeepArgs { checkpoint_every, restart } = args;
        let (path, every) = (KeepArgs::checkpoint(output), Duration::from_secs(checkpoint_every));
        Kept { path, settings, trained_with, every, restart, last: Instant::now(), warned: false }
    }

    /// Finds the checkpoint of an earlier run with the same settings. A note reports a damaged checkpoint,
    /// which is ignored.
    ///
    /// # Errors
    /// [`Error::Input`] if it belongs to another run, unless the run is to start over.
    pub(super) fn find(&mut self) -> Result<Option<Checkpoint>> {
        let (path, found) = (&self.path, Checkpoint::find(&self.path, &self.settings)?);
        let old = path.with_extension("safetensors.old");
        if self.restart && !matches!(found, Found::Nothing) {
            fs::rename(path, &old).map_err(|error| Error::io(path, error))?;
            note(format!("{}: the checkpoint of the earlier run is now {}", path.display(), old.display()));
            return Ok(None);
        }
        match found {
            Found::Nothing => Ok(None),
            Found::Sound(checkpoint) => {
                let at = if checkpoint.step > 0 { format!(" after step {}", checkpoint.step) } else { String::new() };
                note(format!("{}: resuming{at}; --restart starts over", path.display()));
                Ok(Some(checkpoint))
            }
            Found::Foreign(why) => {
                let what = format!(
                    "this is the checkpoint of another run: {why}; resume it with its own options, or start over \
                     with --restart, which renames it to {}",
                    old.file_name().unwrap_or_default().to_string_lossy()
                );
                Err(Error::input(path, what))
            }
            Found::Damaged(error) => {
                note(format!("{error}; the run starts over"));
                Ok(None)
            }
        }
    }

    /// Whether the next checkpoint is due.
    pub(super) fn is_due(&self) -> bool {
        self.last.elapsed() >= self.every
    }

    /// Writes `checkpoint`. Returns false if disk or memory is full: a note reports that once and the run
    /// continues, since there may be room at its end.
    pub(super) fn keep(&mut self, checkpoint: Result<Checkpoint>) -> Result<bool> {
        self.last = Instant::now();
        let written = checkpoint.and_then(|mut found| {
            found.trained_with = self.trained_with;
            found.write(&self.path, &self.settings)
        });
        match written {
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
                    note(format!("the checkpoint cannot be saved: {error}; the run continues"));
                }
                self.warned = true;
                Ok(false)
            }
        }
    }

    /// Writes a checkpoint if it can after `error`, and returns the error.
    pub(super) fn keep_after(&mut self, error: Error, checkpoint: Result<Checkpoint>) -> Error {
        let kept = matches!(self.keep(checkpoint), Ok(true));
        if kept || self.path.exists() {
            let what = if kept { "the current state" } else { "the last checkpoint" };
            note(format!("{what} is in {}: run the same command to resume", self.path.display()));
        }
        error
    }

    /// Removes the checkpoint of a finished run.
    pub(super) fn remove(&self) -> Result<()> {
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(Error::io(&self.path, error)),
            _ => Ok(()),
        }
    }
}

/// Settings that determine the result of a run: photos and their checksums as uploaded, `options` as given,
/// their `meaning` in this version, and the initial scene.
pub(super) fn settings(
    session: &Session,
    photos: &[&Photo],
    checksums: &[u32],
    options: &impl Serialize,
    meaning: &str,
    begins_with: (&str, Value),
) -> Result<Value> {
    // Destructured, so that a new field is not forgotten. The reduction is left out: it does not change the
    // meaning of gradients.
    let &Session { context: _, policy, background, extent, seed } = session;
    let resolved = Policy { reduction: Reduction::Auto, tile: None, ..policy };
    let photo = |(photo, pixels): (&&Photo, &u32)| {
        let camera = crc32fast::hash(format!("{:?}", photo.camera).as_bytes());
        (photo.name.clone(), json!({"pixels_crc32": pixels, "camera_crc32": camera}))
    };
    let photos: Map<String, Value> = photos.iter().zip(checksums).map(photo).collect();
    let mut all = json!({
        "glint": env!("CARGO_PKG_VERSION"),
        "planes": layout::groups(0).map(|group| group.planes.start),
        "photos": photos,
        "options": serde_json::to_value(options).map_err(|e| Error::Usage(e.to_string()))?,
        "resolved": format!("{meaning} {:?}", (resolved, background, extent, seed)),
    });
    all[begins_with.0] = begins_with.1;
    Ok(all)
}
