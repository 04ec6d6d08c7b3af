//! Initial Gaussians of a training run, and their maximum number.

use glam::DVec3;

use super::{Args, Error, Result};
use crate::{
    data::{Dataset, PointCloud, SceneFile, Split, gaussian_bytes, is_point_cloud, read_points},
    gpu::Context,
    pipelines::{
        classes::Classes,
        learn::WORKING_BYTES,
        start::{RANDOM_NTH, default_gaussians, first_points},
        train::LEARNED,
        views::scene_origin_for,
    },
    scene::{Camera, Gaussians, Scene, color, from_points},
};

/// Share of the memory for Gaussians and their intersections.
const MEMORY_PART: f64 = 0.75;
/// Bytes of a photo's pixel: one word, and half as much for smaller copies.
pub(super) const PIXEL_BYTES: f64 = 6.0;

/// Initial color of points without colors.
const GREY: [u8; 3] = [128; 3];
/// Largest channel value that counts as black, of 255.
const BLACK: u8 = 31;

/// Initial state of a run.
pub(super) struct First {
    pub(super) gaussians: Gaussians,
    /// Origin of the means, in the world.
    pub(super) origin: DVec3,
    /// Maximum number of Gaussians.
    pub(super) most: usize,
    /// See [`BaseOptions::begins`](super::BaseOptions::begins).
    pub(super) begins: f64,
    /// Notes for the user.
    pub(super) notes: Vec<String>,
}

impl First {
    /// Limits a default maximum to the device's memory and returns a note if it did. A Gaussian takes
    /// `bytes` to learn; the photos have `pixels`.
    pub(super) fn fit(&mut self, context: &Context, bytes: u64, pixels: u64) -> Option<String> {
        let fit = fit(context.memory_at_most(), bytes, pixels);
        let (first, most) = (self.gaussians.len(), self.most);
        if fit >= most || most <= first {
            return None;
        }
        self.most = fit.max(first);
        Some(format!("at most {} Gaussians, because the device's memory holds no more", self.most))
    }
}

/// Number of Gaussians that fit in `memory`, each with `bytes` to learn, next to photos of `pixels`.
pub(in crate::cli) fn fit(memory: u64, bytes: u64, pixels: u64) -> usize {
    let room = MEMORY_PART * memory as f64 - PIXEL_BYTES * pixels as f64;
    (room.max(0.0) / (bytes + WORKING_BYTES) as f64) as usize
}

/// Checksum of all numbers of these Gaussians.
pub(super) fn checksum(of: &Gaussians) -> u32 {
    let Gaussians { sh_degree, means, log_scales, quats, opacities, sh } = of;
    let mut all = crc32fast::Hasher::new();
    all.update(&sh_degree.to_le_bytes());
    for part in [means, log_scales, sh] {
        all.update(bytemuck::cast_slice(part));
    }
    all.update(bytemuck::cast_slice(quats));
    all.update(bytemuck::cast_slice(opacities));
    all.finalize()
}

impl Args {
    /// Scene given by --init, unless it is a file of points.
    pub(super) fn init_scene(&self) -> Result<Option<SceneFile>> {
        match &self.model.init {
            Some(file) if file.is_dir() || !is_point_cloud(file)? => self.model.lenient.open_file(file).map(Some),
            _ => Ok(None),
        }
    }

    /// Initial Gaussians: those of a file, or made from its points, the dataset's points, or random ones.
    pub(super) fn first(&self, dataset: &mut Dataset, init: Option<SceneFile>) -> Result<First> {
        let of_bytes = |bytes: u64| u32::try_from(bytes / gaussian_bytes(0, false)).unwrap_or(u32::MAX);
        let asked = self.model.gaussians.or(self.model.bytes.map(of_bytes));
        let limit = asked.or(dataset.gaussians).map(|n| n as usize);
        let points_at_most = self.model.bytes.map(Classes::points);
        let cameras: Vec<Camera> = dataset.split(Split::Train).map(|(_, photo)| photo.camera).collect();
        let origin = scene_origin_for(&cameras);
        let mut notes = Vec::new();
        let points = match (&self.model.init, init) {
            (Some(file), None) => {
                let cloud = read_points(file, &mut notes)?;
                if cloud.positions.is_empty() {
                    return Err(Error::input(file, "has no points to start from"));
                }
                dataset.points = Some(cloud);
                "points in the file"
            }
            (Some(file), Some(_)) if self.model.bytes.is_some() => {
                return Err(Error::input(file, "holds Gaussians, but --bytes starts from points"));
            }
            (Some(file), Some(init)) => {
                let Scene { base, supplement, .. } = init.scene.around(origin);
                if let Some(limit) = limit.filter(|&limit| limit < base.len()) {
                    let what = format!("has {} Gaussians, expected no more than --gaussians {limit}", base.len());
                    return Err(Error::input(file, what));
                }
                if self.model.points.is_some() {
                    return Err(Error::input(file, "holds Gaussians, but --points is only for points"));
                }
                if base.is_empty() {
                    return Err(Error::input(file, "has no Gaussians to start from"));
                }
                if let Some(left) = supplement.filter(|supplement| !supplement.gaussians.is_empty()) {
                    let left = left.gaussians.len();
                    notes.push(format!("{}: its {left} Gaussians with lobes are left out", file.display()));
                }
                let [had, has] = [base.sh_degree, self.degree()].map(color::of);
                if base.sh_degree != 0 && !had.shares_with(has) {
                    let (had, has) = (had.name, has.name);
                    notes.push(format!("{}: only the constant of its {had} is used, for {has}", file.display()));
                }
                let gaussians = base.with_degree(self.degree());
                // The file's author chose their number.
                let most = limit.unwrap_or(gaussians.len());
                return Ok(First { most, gaussians, origin, begins: LEARNED, notes });
            }
            (None, _) => "sparse points",
        };
        if let (Some(wanted), Some(most)) = (self.model.points, points_at_most)
            && wanted > most
        {
            notes.push(format!("--points {wanted}: --bytes leaves room for {most} at the start"));
        }
        let wanted = [self.model.points, self.model.gaussians, points_at_most].into_iter().flatten().min();
        let mut first = first_points(dataset, wanted.map(|n| n as usize), self.seed);
        let mut place = "";
        // The papers of the other strategies place their full number of points anywhere.
        if first.sparse.is_none() && self.model.strategy.follows_errors() {
            let few = match self.model.points.or(points_at_most) {
                Some(_) => first.cloud.positions.len(),
                None => (first.cloud.positions.len() / RANDOM_NTH).max(1),
            };
            match dataset.carved_points(few, self.seed)? {
                Some(cloud) => (first.cloud, place) = (cloud, " where no photo is transparent"),
                None => first.cloud = dataset.random_points(few, self.seed),
            }
        }
        let count = first.cloud.positions.len();
        let grey = first.sparse.and_then(|_| grey_if_all_are_black(&mut first.cloud, points));
        let far = (origin != DVec3::ZERO).then(|| {
            let [x, y, z] = origin.to_array();
            format!(
                "the cameras are far from the world's origin: positions count from ({x}, {y}, {z}). The file stores \
                 this in a comment that glint reads; other programs show the scene at the origin"
            )
        });
        let said = match (first.sparse, self.model.points) {
            (None, _) => Some(format!("the dataset has no sparse points: starting from {count} random ones{place}")),
            (Some(n), Some(wanted)) if n < wanted as usize => {
                Some(format!("there are {n} {points}, fewer than the {wanted} that --points allows"))
            }
            (Some(n), _) if count < n => Some(format!("starting from {count} of {n} {points}, chosen at random")),
            _ => None,
        };
        let gaussians = from_points(&first.cloud.around(origin), &first.cloud.colors, self.degree());
        let pixels = dataset.split(Split::Train).map(|(_, photo)| u64::from(photo.camera.pixels())).sum();
        let grows = self.model.strategy.kernel().is_some();
        let most = limit.unwrap_or_else(|| if grows { default_gaussians(count, pixels) } else { count });
        notes.extend([said, grey, far].into_iter().flatten());
        Ok(First { gaussians, origin, most, begins: 0.0, notes })
    }
}

/// Sets the color of points to gray if all have the same color and it is nearly black. Tools that do not
/// know the colors of points write black.
fn grey_if_all_are_black(cloud: &mut PointCloud, points: &str) -> Option<String> {
    let one = *cloud.colors.first()?;
    if one.iter().any(|&channel| channel > BLACK) || cloud.colors.iter().any(|color| *color != one) {
        return None;
    }
    cloud.colors.fill(GREY);
    Some(format!("all {points} have the color {one:?}, like points without colors: they start gray"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_may_grow_as_far_as_memory_goes() {
        // With 680 learned bytes each, three quarters of 4 GB hold 1,000 Gaussians for each MB of room.
        assert_eq!(fit(4_000_000_000, 680, 0), 3_000_000);
        assert_eq!(fit(4_000_000_000, 680, 100_000_000), 2_400_000);
        // Zero if the photos take all memory.
        assert_eq!([fit(4_000_000_000, 680, 1 << 40), fit(0, 680, 0)], [0; 2]);
    }

    #[test]
    fn black_points_begin_grey() {
        let cloud =
            |colors: &[[u8; 3]]| PointCloud { positions: vec![[0.0; 3]; colors.len()], colors: colors.to_vec() };
        let mut black = cloud(&[[0; 3]; 3]);
        let note = grey_if_all_are_black(&mut black, "sparse points").unwrap();
        assert!(black.colors == [GREY; 3] && note.contains("all sparse points have the color [0, 0, 0]"), "{note}");
        assert!(grey_if_all_are_black(&mut cloud(&[[31, 0, 9]; 2]), "points").is_some());
        for colors in [&[[0; 3], [0, 0, 1]][..], &[[32, 0, 0]; 3], &[[255; 3]; 2], &[GREY; 2], &[]] {
            let mut known = cloud(colors);
            assert_eq!((grey_if_all_are_black(&mut known, "points"), &known.colors[..]), (None, colors));
        }
    }
}
