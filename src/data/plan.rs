//! Plans: a dataset cut into parts that train by themselves, as a JSON file.

mod cut;
mod file;
mod look;
mod owner;
mod patches;

pub use cut::{Limits, cut};
pub use file::is_plan;
pub use owner::Owners;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::photo::{Dataset, DatasetOptions};
use super::points::PointCloud;
use super::trained_with::PartOf;
use crate::{Error, Result};

/// A dataset cut into parts. `glint partition` writes it; `--part` of other commands reads one part's photos, and `glint merge` its
/// seeds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Absolute path of the dataset.
    pub dataset: PathBuf,
    /// Options that the dataset was opened with.
    pub options: DatasetOptions,
    /// Checksum of the names and cameras of all photos, and of all points.
    pub checksum: u32,
    /// Parts 0, 1, ….
    pub parts: Vec<Part>,
}

/// One part of a plan.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Names of the training photos that the cut gave to this part.
    pub photos: Vec<String>,
    /// Names of training photos of other parts whose rays cross what this part owns.
    pub ring: Vec<String>,
    /// Names of test photos whose rays cross what this part owns.
    pub test: Vec<String>,
    /// Number of Gaussians that the part trains at most.
    pub gaussians: u32,
    /// Smallest and largest coordinates of the part's seeds, world.
    pub bounds: [[f64; 3]; 2],
    /// Oriented seeds: position and unit normal towards the cameras that see it, world. A point or Gaussian belongs to the part of the
    /// nearest seed, see [`Owners`].
    pub seeds: Vec<[f64; 6]>,
    /// Seeds of other parts that these photos show, by number in the sequence of all parts' seeds. The part starts from their points as
    /// well, because its pixels need them, and glint merge leaves out what comes of them.
    pub near: Vec<u32>,
}

impl Plan {
    /// Opens the photos and points of a part.
    ///
    /// # Errors
    /// If there is no such part, or the dataset is missing or has changed since the plan was made.
    pub fn open(&self, path: &Path, part: u32) -> Result<Dataset> {
        let of = self.parts.len();
        let Some(found) = self.parts.get(part as usize) else {
            return Err(Error::input(path, format!("has parts 0 to {}, but not part {part}", of.saturating_sub(1))));
        };
        let mut dataset = self.open_all(path)?;
        let names: HashSet<&String> = [&found.photos, &found.ring, &found.test].into_iter().flatten().collect();
        dataset.photos.retain(|photo| names.contains(&photo.name));
        if let Some(points) = &dataset.points {
            let owners = Owners::of(&self.parts);
            let first: usize = self.parts[..part as usize].iter().map(|part| part.seeds.len()).sum();
            let own = first as u32..(first + found.seeds.len()) as u32;
            dataset.points = Some(points.only(|at| {
                let seed = owners.seed(at);
                own.contains(&seed) || found.near.binary_search(&seed).is_ok()
            }));
        }
        dataset.sources.push(path.to_owned());
        dataset.part = Some(PartOf { plan: self.id(), part, of: of as u32, complete: true });
        dataset.gaussians = Some(found.gaussians);
        Ok(dataset)
    }

    /// Opens all photos and points of the dataset.
    ///
    /// # Errors
    /// If the dataset is missing or has changed since the plan was made.
    pub fn open_all(&self, path: &Path) -> Result<Dataset> {
        let dataset = Dataset::open(&self.dataset, &self.options)?;
        if checksum(&dataset) != self.checksum {
            let what = format!("was made for other photos, cameras or points than {} has now", self.dataset.display());
            return Err(Error::input(path, what + "; make it again (glint partition)"));
        }
        Ok(dataset)
    }
}

impl PointCloud {
    /// The points at positions (world) that `keep` keeps.
    fn only(&self, keep: impl Fn([f64; 3]) -> bool + Sync) -> PointCloud {
        let kept: Vec<bool> = self.positions.par_iter().map(|&at| keep(at)).collect();
        let chosen = |i: &usize| kept[*i];
        PointCloud {
            positions: (0..kept.len()).filter(chosen).map(|i| self.positions[i]).collect(),
            colors: (0..kept.len()).filter(chosen).map(|i| self.colors[i]).collect(),
        }
    }
}

/// Checksum of what a plan depends on: names and cameras of photos, and points.
fn checksum(dataset: &Dataset) -> u32 {
    let mut all = crc32fast::Hasher::new();
    for photo in &dataset.photos {
        let camera = &photo.camera;
        all.update(photo.name.as_bytes());
        all.update(bytemuck::bytes_of(&[camera.width, camera.height]));
        all.update(bytemuck::bytes_of(&[camera.fx, camera.fy, camera.cx, camera.cy]));
        all.update(bytemuck::bytes_of(&camera.rotation.to_cols_array()));
        all.update(bytemuck::bytes_of(&camera.translation.to_array()));
    }
    dataset.points.iter().for_each(|points| all.update(bytemuck::cast_slice(&points.positions)));
    all.finalize()
}
