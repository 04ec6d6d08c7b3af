//! Reads a checkpoint as a scene, and defines the names of a checkpoint's tensors.
//!
//! The names are shared by `pipelines::checkpoint`, which writes checkpoints, and the scene reader below.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use serde_json::Value;

use super::scene_file::SceneFile;
use super::tensors::{Tensor, Values, parse_tensors_about};
use super::trained_with::TrainedWith;
use crate::scene::{Gaussians, Lobes, Scene, Supplement};
use crate::scene::{
    color,
    layout::{self, GEOMETRY_PLANES, LOBE_PLANES, sh_planes},
};
use crate::{Error, Result};

/// Prefixes of the tensor names of a segment.
pub const BASE: &str = "base";
/// See [`BASE`].
pub const BANDED: &str = "banded";
/// See [`BASE`].
pub const SUPPLEMENT: &str = "supplement";
/// Suffixes of the tensor names: planes in the order of `scene::layout`, each with all Gaussians.
pub const GEOMETRY: &str = "geometry";
/// See [`GEOMETRY`].
pub const SH: &str = "sh";
/// See [`GEOMETRY`].
pub const LOBES: &str = "lobes";
/// Origin of the means: the words of x, y and z as float64, the lower one first.
pub const ORIGIN: &str = "origin";

/// Key of the training settings in a checkpoint's description.
pub const TRAINED_WITH: &str = "trained_with";

/// Checksum of a checkpoint's tensors and description, without its settings and this number.
pub fn checksum(about: &Value, tensors: &BTreeMap<String, Tensor>) -> u32 {
    let number = |of: &Value| of.as_u64().unwrap_or_default();
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&(number(&about["step"]) as u32).to_le_bytes());
    if !about["clock"].is_null() {
        let [total, taken, milliseconds] = ["total", "taken", "milliseconds"].map(|key| number(&about["clock"][key]));
        hasher.update(format!("{total} {taken} {milliseconds}").as_bytes());
    }
    if !about[TRAINED_WITH].is_null() {
        hasher.update(about[TRAINED_WITH].to_string().as_bytes());
    }
    for (name, Tensor { shape, values }) in tensors {
        hasher.update(format!("{name} {shape:?}").as_bytes());
        match values {
            Values::F32(values) => hasher.update(bytemuck::cast_slice(values)),
            Values::U32(values) => hasher.update(bytemuck::cast_slice(values)),
        }
    }
    hasher.finalize()
}

/// Encodes an origin for a checkpoint.
pub fn origin_words(origin: DVec3) -> [u32; 6] {
    let [x, y, z] = origin.to_array().map(|v| [v.to_bits() as u32, (v.to_bits() >> 32) as u32]);
    [x[0], x[1], y[0], y[1], z[0], z[1]]
}

/// Reads the scene in a checkpoint's bytes. `path` is only used in errors.
pub(super) fn parse(bytes: &[u8], _: Option<&Path>, path: &Path) -> Result<SceneFile> {
    let (tensors, about) = parse_tensors_about(bytes, path)?;
    let about = about.and_then(|text| serde_json::from_str::<Value>(&text).ok()).unwrap_or_default();
    let fail = |what: &str| Error::input(path, what);
    if about["settings"].is_null() {
        return Err(fail(
            "is a safetensors file, but not what glint keeps of a run: expected a checkpoint of train or enhance",
        ));
    }
    if about["crc32"].as_u64() != Some(checksum(&about, &tensors).into()) {
        return Err(fail("is a damaged checkpoint: its checksum is another"));
    }
    let origin = match tensors.get(ORIGIN) {
        Some(Tensor { values: Values::U32(words), .. }) if words.len() == 6 => {
            let at = |i: usize| f64::from_bits(u64::from(words[2 * i]) | u64::from(words[2 * i + 1]) << 32);
            DVec3::new(at(0), at(1), at(2))
        }
        _ => {
            return Err(fail(
                "does not say where its coordinates begin, as before glint kept that: the command that made it resumes it",
            ));
        }
    };
    let kept = Kept { tensors: &tensors, path };
    let (mut base, _) = kept.segment(BASE, false)?;
    let mixed = tensors.contains_key(&format!("{BANDED}.{GEOMETRY}"));
    if mixed {
        base.append(kept.segment(BANDED, false)?.0);
    }
    let supplement = match tensors.contains_key(&format!("{SUPPLEMENT}.{GEOMETRY}")) {
        true => Some(kept.segment(SUPPLEMENT, true)?),
        false => None,
    };
    let supplement = supplement.map(|(gaussians, lobes)| Supplement { gaussians, lobes });
    let supplement = supplement.filter(|supplement| !supplement.gaussians.is_empty());
    let trained_with = TrainedWith::from_json(&about[TRAINED_WITH]);
    Ok(SceneFile { trained_with, ..Scene { base, supplement, mixed, origin }.into() })
}

/// The tensors of a checkpoint.
struct Kept<'a> {
    tensors: &'a BTreeMap<String, Tensor>,
    path: &'a Path,
}

impl Kept<'_> {
    /// The planes' values, the number of planes, and the number of Gaussians.
    fn planes(&self, segment: &str, what: &str) -> Result<(&[f32], usize, usize)> {
        match self.tensors.get(&format!("{segment}.{what}")) {
            Some(Tensor { shape, values: Values::F32(values) }) if shape.len() == 2 => Ok((values, shape[0], shape[1])),
            _ => {
                let what = format!("has no planes `{segment}.{what}`: only what learns is kept, and this did not");
                Err(Error::input(self.path, what))
            }
        }
    }

    fn segment(&self, segment: &str, with_lobes: bool) -> Result<(Gaussians, Lobes)> {
        let (geometry, planes, count) = self.planes(segment, GEOMETRY)?;
        let (sh, colors, same) = self.planes(segment, SH)?;
        let degree = (0..color::MODELS.len() as u32).find(|&degree| sh_planes(degree) == colors);
        let (true, Some(sh_degree)) = (planes == GEOMETRY_PLANES && same == count, degree) else {
            let what = format!(
                "`{segment}` has {planes} planes of geometry and {colors} of color of {count} and {same} Gaussians, expected \
                 {GEOMETRY_PLANES}, and those of a degree of harmonics"
            );
            return Err(Error::input(self.path, what));
        };
        let (mut gaussians, mut lobes) = (Gaussians { sh_degree, ..Default::default() }, Lobes::default());
        for i in 0..count {
            layout::push(&mut gaussians, |p| geometry[p * count + i], |p| sh[p * count + i]);
        }
        if with_lobes {
            let (values, planes, same) = self.planes(segment, LOBES)?;
            if planes != LOBE_PLANES || same != count {
                let what =
                    format!("`{segment}` has {planes} planes of lobes, expected {LOBE_PLANES} of {count} Gaussians");
                return Err(Error::input(self.path, what));
            }
            (0..count).for_each(|i| layout::push_lobe(&mut lobes, |p| values[p * count + i]));
        }
        Ok((gaussians, lobes))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::tensors::{ValuesRef, write_tensors_about};
    use super::*;
    use crate::reference::sample::random_scene;

    /// Tensors of a checkpoint with this scene, in coordinates relative to `origin`.
    fn tensors_of(scene: &Scene, origin: DVec3) -> BTreeMap<String, Tensor> {
        let mut tensors = BTreeMap::new();
        tensors.insert(ORIGIN.into(), Tensor { shape: vec![3, 2], values: Values::U32(origin_words(origin).to_vec()) });
        let mut put = |segment: &str, what: &str, planes: usize, count: usize, value: &dyn Fn(usize, usize) -> f32| {
            let values = (0..planes).flat_map(|p| (0..count).map(move |i| value(p, i))).collect();
            tensors.insert(
                format!("{segment}.{what}"),
                Tensor { shape: vec![planes, count], values: Values::F32(values) },
            );
        };
        let constants = if scene.mixed { scene.base.constants() } else { scene.base.len() };
        let [first, last] =
            [0..constants, constants..scene.base.len()].map(|part| scene.base.reordered(&part.collect::<Vec<_>>()));
        let first = if scene.mixed { first.with_degree(0) } else { first };
        let banded = scene.mixed.then_some((BANDED, &last));
        let supplement = scene.supplement.as_ref().map(|s| (SUPPLEMENT, &s.gaussians));
        for (segment, gaussians) in [Some((BASE, &first)), banded, supplement].into_iter().flatten() {
            put(segment, GEOMETRY, GEOMETRY_PLANES, gaussians.len(), &|p, i| layout::geometry(gaussians, i)[p]);
            put(segment, SH, sh_planes(gaussians.sh_degree), gaussians.len(), &|p, i| layout::sh(gaussians, i, p));
        }
        if let Some(Supplement { lobes, .. }) = &scene.supplement {
            put(SUPPLEMENT, LOBES, LOBE_PLANES, lobes.widths.len(), &|p, i| layout::lobe(lobes, i)[p]);
        }
        tensors
    }

    /// A checkpoint's bytes.
    fn bytes_of(tensors: &BTreeMap<String, Tensor>, mut about: Value) -> Vec<u8> {
        about["crc32"] = checksum(&about, tensors).into();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        let entries = tensors.iter().map(|(name, tensor)| {
            let values = match &tensor.values {
                Values::F32(values) => ValuesRef::F32(values),
                Values::U32(values) => ValuesRef::U32(values),
            };
            (&name[..], &tensor.shape[..], values)
        });
        let list: Vec<_> = entries.collect();
        write_tensors_about(&path, &list, Some(&about.to_string())).unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn the_scene_of_a_checkpoint_has_the_numbers_that_were_kept() {
        let read = |tensors: &_| {
            let about = json!({"step": 5, "clock": {"total": 9, "taken": 70, "milliseconds": 4}, "settings": {}});
            parse(&bytes_of(tensors, about), None, Path::new("x")).unwrap().scene
        };
        for (degree, supplement) in [(0, 0), (3, 4), (color::BETAS, 0)] {
            let scene = random_scene(1, 7, supplement, degree);
            assert_eq!(read(&tensors_of(&scene, DVec3::ZERO)), scene);
            // With another origin only the origin changes.
            let origin = DVec3::new(1e5, 0.0, -0.3);
            assert_eq!(read(&tensors_of(&scene, origin)), Scene { origin, ..scene.clone() });
            let mut mixed = Scene { origin, mixed: true, ..scene };
            let k = mixed.base.sh_coefficients();
            mixed.base.sh.chunks_mut(k).take(3).for_each(|row| row[1..].fill([0.0; 3]));
            assert_eq!(read(&tensors_of(&mixed, origin)), mixed);
        }
        // Without supplementary Gaussians there is no supplement.
        let none = Scene { supplement: Some(Supplement::default()), ..random_scene(1, 2, 0, 1) };
        assert_eq!(read(&tensors_of(&none, DVec3::ZERO)).supplement, None);
    }

    #[test]
    fn what_is_no_sound_checkpoint_is_refused_by_name() {
        let sound = tensors_of(&random_scene(1, 7, 3, 1), DVec3::ONE);
        let about = json!({"step": 5, "clock": null, "settings": {"seed": 1}});
        let refused = |bytes: &[u8], words: &str| {
            let error = parse(bytes, None, Path::new("x.safetensors")).unwrap_err().to_string();
            assert!(error.contains("x.safetensors") && error.contains(words), "{error}");
        };
        let whole = bytes_of(&sound, about.clone());
        let mut bytes = whole.clone();
        bytes[whole.len() - 200] ^= 1;
        refused(&bytes, "damaged");
        refused(&whole[..whole.len() - 1], "safetensors");
        refused(&bytes_of(&sound, json!({"step": 5})), "not what glint keeps of a run");
        let without = |name: &str| {
            let mut tensors = sound.clone();
            tensors.remove(name).unwrap();
            bytes_of(&tensors, about.clone())
        };
        refused(&without("origin"), "where its coordinates begin");
        for name in ["base.geometry", "base.sh", "supplement.sh", "supplement.lobes"] {
            refused(&without(name), name);
        }
        for (name, shape) in [("base.sh", [6, 14]), ("base.geometry", [7, 11]), ("supplement.lobes", [3, 5])] {
            let mut tensors = sound.clone();
            let tensor = tensors.get_mut(name).unwrap();
            tensor.values = Values::F32(vec![0.5; shape[0] * shape[1]]);
            tensor.shape = shape.to_vec();
            let segment = name.split('.').next().unwrap();
            refused(&bytes_of(&tensors, about.clone()), &format!("`{segment}` has "));
        }
    }
}
