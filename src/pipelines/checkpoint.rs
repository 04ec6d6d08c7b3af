//! What a training loop has learned so far, as one safetensors file: everything that the steps to come need, so that they give the
//! bits of a run that was never interrupted.
//!
//! The file says what it was made from, as work folders do, and has a checksum, since a bit that fell over in a parameter would
//! look like any other.

use std::{collections::BTreeMap, io, path::Path};

use glam::DVec3;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::{
    data::{
        Kind, TrainedWith,
        checkpoint::{ORIGIN, TRAINED_WITH, checksum, origin_words},
        read_tensors_about,
        tensors::{Tensor, Values, ValuesRef},
        write_tensors_about,
    },
    error::{Error, Result},
};

/// How a run stood that has a time and no number of steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// Steps that it was planned to have, of which the checkpoint's count as done.
    pub total: u32,
    /// Steps that were taken.
    pub taken: u32,
    /// Of its time that were spent.
    pub milliseconds: u64,
}

/// A training loop between two steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// Steps that are done.
    pub step: u32,
    /// Of a run that has a time; whoever keeps it says so.
    pub clock: Option<Clock>,
    /// For whoever reads the scene in it; whoever keeps it says so.
    pub trained_with: TrainedWith,
    tensors: BTreeMap<String, Tensor>,
}

/// What there is at a checkpoint's path.
#[derive(Debug)]
pub enum Found {
    /// No file: the run begins.
    Nothing,
    /// Of this run, and whole.
    Sound(Checkpoint),
    /// Of other settings; the first that differs.
    Foreign(String),
    /// And why.
    Damaged(Error),
}

impl Checkpoint {
    pub(super) fn new(step: u32) -> Self {
        Checkpoint { step, clock: None, trained_with: TrainedWith::default(), tensors: BTreeMap::new() }
    }

    /// Where the coordinates of the scene in it begin.
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

    /// The words of a tensor, if it is there.
    pub(super) fn words(&self, name: &str) -> Option<&[u32]> {
        match &self.tensors.get(name)?.values {
            Values::U32(words) => Some(words),
            Values::F32(_) => None,
        }
    }

    /// Elements of the last dimension of a tensor: Gaussians, where it holds their planes.
    pub(super) fn columns(&self, name: &str) -> Result<usize> {
        let shape = self.tensors.get(name).and_then(|tensor| tensor.shape.last());
        shape.copied().ok_or_else(|| Error::Usage(format!("the checkpoint has no `{name}`")))
    }

    /// The values of a tensor, which must be so many.
    pub(super) fn floats(&self, name: &str, count: usize) -> Result<&[f32]> {
        match self.tensors.get(name) {
            // guard: checkpoints of another size
            Some(Tensor { values: Values::F32(values), .. }) if values.len() == count => Ok(values),
            _ => Err(Error::Usage(format!("the checkpoint has no `{name}` of {count} values"))),
        }
    }

    /// Writes it whole or not at all. `settings` is everything that the run depends on.
    pub fn write(&self, path: &Path, settings: &Value) -> Result<()> {
        let mut about = json!({"step": self.step, "clock": self.clock, "settings": settings});
        if !self.trained_with.is_unknown() {
            about[TRAINED_WITH] = json!(self.trained_with);
        }
        about["crc32"] = checksum(&about, &self.tensors).into();
        let list: Vec<_> = self.tensors.iter().map(|(name, t)| (name.as_str(), &t.shape[..], Borrowed(t))).collect();
        write_tensors_about(path, &list, Some(&about.to_string()))
    }

    /// What an earlier run left at `path`, if it was one of the same `settings`.
    ///
    /// # Errors
    /// [`Error::Io`] where what is there cannot be read.
    pub fn find(path: &Path, settings: &Value) -> Result<Found> {
        let (tensors, about) = match read_tensors_about(path) {
            Ok(found) => found,
            Err(Error::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => return Ok(Found::Nothing),
            // What is no safetensors file never was a checkpoint.
            Err(error @ Error::Input { .. }) => match Kind::of_file(path)? {
                Kind::Safetensors | Kind::Empty => return Ok(Found::Damaged(error)),
                kind => return Ok(Found::Foreign(format!("it is {kind}"))),
            },
            Err(error) => return Err(error),
        };
        let damaged = |what: &str| Ok(Found::Damaged(Error::input(path, what)));
        // No checkpoint of ours: somebody else's file, which is not for us to replace.
        let Some(about) = about else { return Ok(Found::Foreign("it does not say what it was made from".into())) };
        let Ok(about) = serde_json::from_str::<Value>(&about) else {
            return damaged("is damaged: what it was made from cannot be read");
        };
        // As it is read back, since a number may differ in its last digit from what was written.
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

/// A tensor as it is written.
#[derive(Clone, Copy)]
struct Borrowed<'a>(&'a Tensor);

impl<'a> From<Borrowed<'a>> for ValuesRef<'a> {
    fn from(Borrowed(tensor): Borrowed<'a>) -> Self {
        match &tensor.values {
            Values::F32(values) => ValuesRef::F32(values),
            Values::U32(values) => ValuesRef::U32(values),
        }
    }
}

/// The first place where two JSON values differ, and what is there.
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

        kept.clock = Some(Clock { total: 9, taken: 70, milliseconds: 1 << 40 });
        kept.trained_with =
            TrainedWith { background: Some([1.0, 0.5, 0.25]), max_size: Some(56), ..Default::default() };
        kept.write(&path, &settings).unwrap();
        assert!(matches!(find(&settings), Found::Sound(found) if found == kept));

        let mut other = settings.clone();
        other["options"]["seed"] = json!(3);
        let Found::Foreign(what) = find(&other) else { panic!("not foreign") };
        assert_eq!(what, "`options.seed` was 0 and is 3");

        // Every bit counts, wherever it is, and so does the end.
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
        // What never was one is somebody's.
        fs::write(&path, "ply\nformat").unwrap();
        let Found::Foreign(what) = find(&settings) else { panic!("not foreign") };
        assert_eq!(what, "it is a PLY file");
        crate::data::write_tensors(&path, &[("losses", &[1], &[1.0f32][..])]).unwrap();
        assert!(matches!(find(&settings), Found::Foreign(_)));
        // A folder is nobody's checkpoint.
        assert!(Checkpoint::find(folder.path(), &settings).is_err());
    }
}
