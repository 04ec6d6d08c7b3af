//! Reads and writes streamed SOG: a folder of SOG scenes with levels of detail, and `lod-meta.json`, a tree of boxes whose leaves name
//! their Gaussians at each level, so that viewers load what they see as fine as they see it.
//!
//! Source: PlayCanvas' splat-transform, version 1 of the file. At each level, a leaf has the number of a file in `filenames` and a range of
//! Gaussians in that file. Level 0 is the finest. A box encloses its Gaussians up to one standard deviation.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::path::Path;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::super::order;
use super::META;
use super::files::Files;
use super::write::encode;
use crate::Result;
use crate::data::atomic::replace_folder;
use crate::data::formats::common::append;
use crate::data::scene_file::SOG_META;
use crate::data::{SceneFile, TrainedWith, lod};
use crate::scene::{Gaussians, Scene};

/// The description of all files.
const INDEX: &str = SOG_META[1];
/// Most Gaussians in a leaf, the unit in which viewers choose a level.
const LEAF: usize = 1 << 16;
/// A file takes leaves until it has as many Gaussians.
const UNIT: usize = 1 << 19;

#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Index {
    version: u32,
    #[serde(default)]
    count: usize,
    /// Gaussians of each level.
    #[serde(default)]
    counts: Vec<usize>,
    #[serde(default)]
    lod_levels: usize,
    /// An SOG scene that is always shown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    environment: Option<String>,
    filenames: Vec<String>,
    tree: Node,
}

#[derive(Debug, Serialize, Deserialize)]
struct Node {
    #[serde(default)]
    bound: Bound,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    children: Vec<Node>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    lods: BTreeMap<usize, Range>,
}

#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Bound {
    min: [f32; 3],
    max: [f32; 3],
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Range {
    file: usize,
    offset: usize,
    count: usize,
}

/// Whether a file of this name is such a description.
pub(super) fn is_index(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name == INDEX)
}

/// Writes the folder of `path`, with `levels` levels, each of half of the Gaussians of the one before. Beside the scene, it holds a leaf
/// and a file of each level.
///
/// # Errors
/// [`Error::Input`](crate::Error::Input) if the folder holds other files than a scene of this format.
pub(in crate::data) fn write(file: &SceneFile, path: &Path, levels: Option<u8>) -> Result<Vec<String>> {
    let base = &file.scene.base;
    let own = |name: &str| name == INDEX || name.split_once('_').is_some_and(|(a, b)| is_number(a) && is_number(b));
    replace_folder(path.parent().unwrap_or(Path::new("")), own, |folder| {
        let levels = usize::from(levels.unwrap_or(1));
        let mut units = Units { folder, file, filenames: Vec::new(), levels: vec![Level::default(); levels] };
        let tree = units.node(base, (0..base.len()).collect())?;
        (0..levels).try_for_each(|level| units.flush(level))?;
        let counts: Vec<usize> = units.levels.iter().map(|level| level.count).collect();
        let count = counts.iter().sum();
        let filenames = units.filenames;
        let index = Index { version: 1, count, counts, lod_levels: levels, environment: None, filenames, tree };
        let text = serde_json::to_vec(&index)?;
        fs::write(folder.join(INDEX), text)
    })?;
    Ok(Vec::new())
}

fn is_number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// The files that are being written.
struct Units<'a> {
    folder: &'a Path,
    file: &'a SceneFile,
    filenames: Vec<String>,
    levels: Vec<Level>,
}

/// The next file of a level.
#[derive(Clone, Default)]
struct Level {
    gaussians: Option<Gaussians>,
    /// Files written so far.
    files: usize,
    /// Gaussians in all files.
    count: usize,
}

impl Units<'_> {
    /// Cuts these Gaussians of `base` at the median of their longest axis until they fit into leaves.
    fn node(&mut self, base: &Gaussians, mut members: Vec<usize>) -> std::io::Result<Node> {
        if members.len() <= LEAF {
            return self.leaf(base, &members);
        }
        let of = |axis: usize| members.iter().map(move |&i| base.means[i][axis]);
        let extent = |axis: usize| of(axis).fold(f32::MIN, f32::max) - of(axis).fold(f32::MAX, f32::min);
        let longest = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
        let middle = members.len() / 2;
        // The order of equal coordinates is that of their numbers, so that the cut is always the same.
        members.select_nth_unstable_by(middle, |&a, &b| {
            base.means[a][longest].total_cmp(&base.means[b][longest]).then(a.cmp(&b))
        });
        let upper = members.split_off(middle);
        let children = vec![self.node(base, members)?, self.node(base, upper)?];
        let bound = children[0].bound.with(children[1].bound);
        Ok(Node { bound, children, lods: BTreeMap::new() })
    }

    fn leaf(&mut self, base: &Gaussians, members: &[usize]) -> std::io::Result<Node> {
        let mut members = members.to_vec();
        members.sort_unstable();
        let mut level = base.reordered(&members);
        let bound = Bound::of(&level);
        let mut lods = BTreeMap::new();
        for number in 0..self.levels.len() {
            if number > 0 {
                level = lod::coarser(&level, level.len().div_ceil(2)).0;
            }
            if !level.is_empty() {
                lods.insert(number, self.add(number, level.reordered(&order::along_curve(&level.means)))?);
            }
        }
        Ok(Node { bound, children: Vec::new(), lods })
    }

    fn add(&mut self, number: usize, gaussians: Gaussians) -> std::io::Result<Range> {
        let level = &mut self.levels[number];
        let name = format!("{number}_{}/{META}", level.files);
        let (offset, count) = (level.gaussians.as_ref().map_or(0, Gaussians::len), gaussians.len());
        if offset == 0 {
            self.filenames.push(name.clone());
        }
        append(&mut level.gaussians, gaussians);
        level.count += count;
        let file = self.filenames.iter().rposition(|known| *known == name).unwrap_or(0);
        if offset + count >= UNIT {
            self.flush(number)?;
        }
        Ok(Range { file, offset, count })
    }

    /// Writes the next file of a level, if it has Gaussians.
    fn flush(&mut self, number: usize) -> std::io::Result<()> {
        let level = &mut self.levels[number];
        let Some(gaussians) = level.gaussians.take() else { return Ok(()) };
        let folder = self.folder.join(format!("{number}_{}", level.files));
        level.files += 1;
        fs::create_dir(&folder)?;
        encode(&gaussians, self.file)?.into_iter().try_for_each(|(name, bytes)| fs::write(folder.join(name), bytes))
    }
}

impl Bound {
    fn of(gaussians: &Gaussians) -> Bound {
        let boxes = (0..gaussians.len()).map(|i| {
            let covariance = lod::covariance(gaussians, i);
            let half = DVec3::from_array([0, 1, 2].map(|axis| covariance.col(axis)[axis].sqrt()));
            let mean = DVec3::from_array(gaussians.means[i].map(f64::from));
            // JSON has no infinity.
            let corner = |at: DVec3| at.to_array().map(|v| v.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32);
            Bound { min: corner(mean - half), max: corner(mean + half) }
        });
        boxes.reduce(Bound::with).unwrap_or_default()
    }

    fn with(self, other: Bound) -> Bound {
        let both =
            |a: [f32; 3], b: [f32; 3], pick: fn(f32, f32) -> f32| std::array::from_fn(|axis| pick(a[axis], b[axis]));
        Bound { min: both(self.min, other.min, f32::min), max: both(self.max, other.max, f32::max) }
    }
}

/// Reads the finest level.
pub(super) fn read(bytes: &[u8], folder: Option<&Path>) -> Result<SceneFile, String> {
    let mut index: Index =
        serde_json::from_slice(bytes).map_err(|error| format!("is not understood as streamed SOG: {error}"))?;
    if index.version != 1 {
        return Err(format!("is streamed SOG of version {}; 1 is read", index.version));
    }
    let mut ranges: BTreeMap<usize, Vec<Range>> = BTreeMap::new();
    let mut nodes = vec![&index.tree];
    while let Some(node) = nodes.pop() {
        nodes.extend(node.children.iter().rev());
        // A leaf may lack levels.
        if let Some(range) = node.lods.values().next() {
            ranges.entry(range.file).or_default().push(*range);
        }
    }
    let environment = index.environment.take().map(|name| {
        index.filenames.push(name);
        index.filenames.len() - 1
    });
    // Otherwise one file could be read again and again under many numbers.
    let mut names = HashSet::new();
    let mut files = Files::Folder { meta: b"", folder, have: bytes.len() };
    let (mut all, mut origin, mut trained_with) = (None, DVec3::ZERO, TrainedWith::default());
    for file in ranges.keys().copied().chain(environment) {
        let Some(name) = index.filenames.get(file) else {
            return Err(format!("has a leaf in file {file}, expected a number below {}", index.filenames.len()));
        };
        if !names.insert(name) {
            return Err(format!("names `{name}` twice"));
        }
        let unit = files.read(name)?;
        let beside = folder.and_then(|folder| folder.join(name).parent().map(Path::to_owned));
        let unit = super::read(&unit, beside.as_deref()).map_err(|what| format!("`{name}` {what}"))?;
        (origin, trained_with) = (unit.scene.origin, unit.trained_with);
        let base = unit.scene.base;
        let whole = [Range { file, offset: 0, count: base.len() }];
        let named: usize =
            ranges.get(&file).into_iter().flatten().fold(0, |sum, range| sum.saturating_add(range.count));
        if named > base.len() {
            return Err(format!("has leaves of {named} Gaussians in `{name}`, which has {}", base.len()));
        }
        for range in ranges.get(&file).map_or(&whole[..], |ranges| ranges) {
            let end = range.offset.checked_add(range.count).filter(|&end| end <= base.len());
            let Some(end) = end else {
                return Err(format!(
                    "has {} Gaussians from {} on in `{name}`, which has {}",
                    range.count,
                    range.offset,
                    base.len()
                ));
            };
            append(&mut all, base.reordered(&(range.offset..end).collect::<Vec<_>>()));
        }
    }
    let base = all.unwrap_or_default();
    Ok(SceneFile { trained_with, ..Scene { base, origin, ..Default::default() }.into() })
}
