//! Checkpoints of a training loop: one safetensors file with everything that the remaining steps need. A
//! resumed run gives the same bits as an uninterrupted one.
//!
//! The file records the settings it was made with, as work folders do. A checksum guards it, since a flipped
//! bit in a parameter would go unnoticed.

use std::{collections::BTreeMap, io, path::Path};

use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::{
    data::{
        Kind, TrainedWith,
        checkpoint::{ORIGIN, TRAINED_WITH, checksum, origin_words},
        read_tensors_about,
        tensors::{Tensor, Values},
        write_tensors_about,
    },
    error::{Error, Result},
    scene::layout::LAST_STEP,
};

/// Progress of a run that is limited by time, not by a number of steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// Steps that the run was planned to have; the checkpoint's `step` counts towards these.
    pub total: u32,
    /// Steps that were really taken. A change of plan rescales `step` and `total`, not this number.
    pub taken: u32,
    /// Milliseconds of the run's time that are spent.
    pub milliseconds: u64,
}

/// A training loop between two steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// Finished steps.
    pub step: u32,
    /// Set by the caller, only for a run that is limited by time.
    pub clock: Option<Clock>,
    /// Training settings, for readers of the scene in this file; the caller sets them.
    pub trained_with: TrainedWith,
    tensors: BTreeMap<String, Tensor>,
}

/// Result of [`Checkpoint::find`].
#[derive(Debug)]
pub enum Found {
    /// There is no file: the run starts from the beginning.
    Nothing,
    /// A complete checkpoint of this run.
    Sound(Checkpoint),
    /// The file belongs to a run with other settings, or is not a checkpoint; names the first difference.
    Foreign(String),
    /// A checkpoint that cannot be used, and the reason.
    Damaged(Error),
}

impl Checkpoint {
    pub(super) fn new(step: u32) -> Self {
        Checkpoint { step, clock: None, trained_with: TrainedWith::default(), tensors: BTreeMap::new() }
    }

    /// Stores the origin of the coordinates of the scene in this checkpoint.
    pub(super) fn put_origin(&mut self, origin: DVec3) {
        let values = Values::U32(origin_words(origin).to_vec());
        self.tensors.insert(ORIGIN.into(), Tensor { shape: vec![3, 2], values });
    }

    pub(super) fn put(&mut self, name: String, shape: [usize; 2], values: Vec<f32>) {
        self.tensors.insert(name, Tensor { shape: shape.to_vec(), values: Values::F32(values) });
    }

    pub(super) fn put_words(&mut self, name: String, values: Vec<u32>) {
        self.tensors.insert(name, Tensor { shape: vec![values.len()], values: Values::U32(values) });
    }

    /// The words of a tensor; `None` if it is missing or not of type u32.
    pub(super) fn words(&self, name: &str) -> Option<&[u32]> {
        match &self.tensors.get(name)?.values {
            Values::U32(words) => Some(words),
            Values::F32(_) => None,
        }
    }

    /// Names of all tensors, in order.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.tensors.keys().map(String::as_str)
    }

    /// Length of the first dimension of a tensor: the number of planes.
    pub(super) fn rows(&self, name: &str) -> Result<usize> {
        let shape = self.tensors.get(name).and_then(|tensor| tensor.shape.first());
        shape.copied().ok_or_else(|| Error::Usage(format!("the checkpoint has no `{name}`")))
    }

    /// Length of the last dimension of a tensor: the number of Gaussians, if it holds planes.
    pub(super) fn columns(&self, name: &str) -> Result<usize> {
        let shape = self.tensors.get(name).and_then(|tensor| tensor.shape.last());
        shape.copied().ok_or_else(|| Error::Usage(format!("the checkpoint has no `{name}`")))
    }

    /// The values of `planes` planes of `count` Gaussians. Earlier versions had packed moments without the
    /// plane [`LAST_STEP`].
    pub(super) fn planes(&self, name: &str, planes: usize, count: usize) -> Result<&[f32]> {
        let without = |error| match planes == LAST_STEP + 1 {
            true => self.floats(name, LAST_STEP * count).map_err(|_| error),
            false => Err(error),
        };
        self.floats(name, planes * count).or_else(without)
    }

    /// The values of a tensor; an error unless it has exactly `count` values.
    pub(super) fn floats(&self, name: &str, count: usize) -> Result<&[f32]> {
        match self.tensors.get(name) {
            // guard: checkpoints of another size
            Some(Tensor { values: Values::F32(values), .. }) if values.len() == count => Ok(values),
            _ => Err(Error::Usage(format!("the checkpoint has no `{name}` of {count} values"))),
        }
    }

    /// Writes the whole file or nothing. `settings` is everything that the run depends on.
    pub fn write(&self, path: &Path, settings: &Value) -> Result<()> {
        let mut about = json!({"step": self.step, "clock": self.clock, "settings": settings});
        if !self.trained_with.is_unknown() {
            about[TRAINED_WITH] = json!(self.trained_with);
        }
        about["crc32"] = checksum(&about, &self.tensors).into();
        let list: Vec<_> = self.tensors.iter().map(|(name, t)| (name.as_str(), &t.shape[..], t)).collect();
        write_tensors_about(path, &list, Some(&about.to_string()))
    }

    /// Reads the checkpoint at `path`, if it was written with the same `settings`.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read.
    pub fn find(path: &Path, settings: &Value) -> Result<Found> {
        let (tensors, about) = match read_tensors_about(path) {
            Ok(found) => found,
            Err(Error::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => return Ok(Found::Nothing),
            // A file that is not safetensors never was a checkpoint.
            Err(error @ Error::Input { .. }) => match Kind::of_file(path)? {
                Kind::Safetensors | Kind::Empty => return Ok(Found::Damaged(error)),
                kind => return Ok(Found::Foreign(format!("it is {kind}"))),
            },
            Err(error) => return Err(error),
        };
        let damaged = |what: &str| Ok(Found::Damaged(Error::input(path, what)));
        // Not written by glint, so glint must not replace it.
        let Some(about) = about else { return Ok(Found::Foreign("it does not say what it was made from".into())) };
        let Ok(about) = serde_json::from_str::<Value>(&about) else {
            return damaged("is damaged: what it was made from cannot be read");
        };
        // Compare with the settings after a round trip through text, since numbers may lose their last digit
        // there.
        let now: Value = serde_json::from_str(&settings.to_string()).unwrap_or(Value::Null);
        if let Some(what) = difference(&about["settings"], &now, "") {
            return Ok(Found::Foreign(what));
        }
        let Some(step) = about["step"].as_u64().and_then(|step| u32::try_from(step).ok()) else {
            return damaged("does not say how many steps were done");
        };
        let clock = match &about["clock"] {
            Value::Null => None,
            clock => match Clock::deserialize(clock) {
                Ok(clock) if step <= clock.total => Some(clock),
                _ => return damaged("does not say how much of its time was spent"),
            },
        };
        // guard: bits of a checkpoint
        if about["crc32"].as_u64() != Some(checksum(&about, &tensors).into()) {
            return damaged("is damaged: its checksum is another");
        }
        let trained_with = TrainedWith::from_json(&about[TRAINED_WITH]);
        Ok(Found::Sound(Checkpoint { step, clock, trained_with, tensors }))
    }
}

/// Describes the first difference between two JSON values; `place` is the path to them.
fn difference(found: &Value, now: &Value, place: &str) -> Option<String> {
    if let (Value::Object(a), Value::Object(b)) = (found, now) {
        let inside = |key: &str| if place.is_empty() { key.to_owned() } else { format!("{place}.{key}") };
        let all = a.keys().chain(b.keys().filter(|key| !a.contains_key(*key)));
        return all.into_iter().find_map(|key| {
            let [a, b] = [a, b].map(|map| map.get(key).unwrap_or(&Value::Null));
            difference(a, b, &inside(key))
        });
    }
    (found != now).then(|| format!("`{place}` was {found} and is {now}"))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_checkpoint_comes_back_unless_it_is_damaged_or_of_another_run() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.safetensors");
        let settings = json!({"options": {"seed": 0, "ratio": 0.1}, "photos": {"a.png": 7}});
        let find = |settings: &Value| Checkpoint::find(&path, settings).unwrap();
        assert!(matches!(find(&settings), Found::Nothing));
        let mut kept = Checkpoint::new(5);
        kept.put("losses".into(), [1, 3], vec![0.5, f32::INFINITY, -0.0]);
        kept.put("base.sh".into(), [2, 0], vec![]);
        kept.write(&path, &settings).unwrap();
        let Found::Sound(found) = find(&settings) else { panic!("not sound") };
        assert_eq!(found, kept);
        assert_eq!(found.floats("losses", 3).unwrap()[1], f32::INFINITY);
        for (name, count) in [("losses", 2), ("loss", 3)] {
            assert!(found.floats(name, count).unwrap_err().to_string().contains(name));
        }

        // A plane fewer is an earlier version's; two are another scene's.
        let columns = |rows: usize| {
            let mut checkpoint = Checkpoint::new(1);
            checkpoint.put("moments".into(), [rows, 2], vec![0.5; 2 * rows]);
            checkpoint.planes("moments", LAST_STEP + 1, 2).map(<[f32]>::len).ok()
        };
        assert_eq!([12, 11, 10].map(columns), [Some(24), Some(22), None]);
        assert!(found.planes("losses", 4, 1).is_err());

        kept.clock = Some(Clock { total: 9, taken: 70, milliseconds: 1 << 40 });
        kept.trained_with =
            TrainedWith { background: Some([1.0, 0.5, 0.25]), max_size: Some(56), ..Default::default() };
        kept.write(&path, &settings).unwrap();
        assert!(matches!(find(&settings), Found::Sound(found) if found == kept));

        let mut other = settings.clone();
        other["options"]["seed"] = json!(3);
        let Found::Foreign(what) = find(&other) else { panic!("not foreign") };
        assert_eq!(what, "`options.seed` was 0 and is 3");

        // A flip of any bit, and any truncation, is noticed.
        let whole = fs::read(&path).unwrap();
        for at in (0..whole.len()).step_by(3) {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            fs::write(&path, &bytes).unwrap();
            match find(&settings) {
                Found::Damaged(error) => assert!(error.to_string().contains("a.safetensors")),
                Found::Foreign(_) => {}
                found => panic!("byte {at}: {found:?}"),
            }
        }
        for len in [0, 9, whole.len() - 1] {
            fs::write(&path, &whole[..len]).unwrap();
            assert!(matches!(find(&settings), Found::Damaged(_)), "{len} bytes");
        }
        // A file of another kind belongs to somebody else.
        fs::write(&path, "ply\nformat").unwrap();
        let Found::Foreign(what) = find(&settings) else { panic!("not foreign") };
        assert_eq!(what, "it is a PLY file");
        crate::data::write_tensors(&path, &[("losses", &[1], &[1.0f32][..])]).unwrap();
        assert!(matches!(find(&settings), Found::Foreign(_)));
        // A folder is not a checkpoint.
        assert!(Checkpoint::find(folder.path(), &settings).is_err());
    }
}
