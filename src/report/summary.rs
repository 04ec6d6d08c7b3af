//! Summaries of scenes and datasets in numbers.

use glam::DVec3;
use serde::Serialize;

use crate::{
    data::{Dataset, DatasetKind, PixelSource, Split},
    scene::{Gaussians, Scene, color},
};

/// Distribution of values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spread {
    /// Minimum.
    pub min: f64,
    /// 5th percentile.
    pub p5: f64,
    /// Median.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Maximum.
    pub max: f64,
}

impl Spread {
    /// Distribution of `values`; `None` if there are none. A percentile is the value at rank round(p (n −
    /// 1)).
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Spread> {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_unstable_by(f64::total_cmp);
        let at = |p: f64| values[(p * (values.len() - 1) as f64).round() as usize];
        (!values.is_empty()).then(|| Spread {
            min: at(0.0),
            p5: at(0.05),
            median: at(0.5),
            p95: at(0.95),
            max: at(1.0),
        })
    }
}

/// Summary of a set of Gaussians. Distributions and bounds are `None` if it is empty.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GaussiansSummary {
    /// Number of Gaussians.
    pub count: usize,
    /// Smallest and largest coordinates of the centers, scene units.
    pub bounds: Option<[[f32; 3]; 2]>,
    /// Opacity σ(logit), 0 to 1.
    pub opacity: Option<Spread>,
    /// Largest standard deviation of each Gaussian, scene units.
    pub largest_scale: Option<Spread>,
    /// Smallest standard deviation of each Gaussian, scene units.
    pub smallest_scale: Option<Spread>,
}

/// Summary of opacity lobes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LobesSummary {
    /// Width T, in [0.01, 1]: the lobe ends at the angle πT.
    pub width: Option<Spread>,
    /// Sharpness β; the exponent is exp(β).
    pub sharpness: Option<Spread>,
}

/// Summary of the supplement of an augmented scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SupplementSummary {
    /// Degree of the harmonics, 0 to 3; `None` for other color models.
    pub sh_degree: Option<u32>,
    /// Name of the color model.
    #[serde(skip)]
    pub color: &'static str,
    /// Gaussians of the supplement.
    #[serde(flatten)]
    pub gaussians: GaussiansSummary,
    /// Their lobes.
    pub lobes: LobesSummary,
}

/// Summary of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneSummary {
    /// Degree of the base's harmonics, 0 to 3; `None` for other color models.
    pub sh_degree: Option<u32>,
    /// Name of the base's color model.
    #[serde(skip)]
    pub color: &'static str,
    /// Number of Gaussians of the base with bands, if the others have a constant color.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub banded: Option<usize>,
    /// Origin of the scene's coordinates, in the world; `None` for the world's origin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<[f64; 3]>,
    /// Gaussians that every viewer shows.
    pub base: GaussiansSummary,
    /// Gaussians with lobes, if there are any.
    pub supplement: Option<SupplementSummary>,
}

impl SceneSummary {
    /// Summarizes a scene.
    pub fn of(scene: &Scene) -> SceneSummary {
        let lobe_spread = |values: &[f32]| Spread::of(values.iter().map(|&v| f64::from(v)));
        SceneSummary {
            sh_degree: color::of(scene.base.sh_degree).harmonics,
            color: color::of(scene.base.sh_degree).name,
            banded: scene.mixed.then(|| scene.base.len() - scene.base.constants()),
            origin: Some(scene.origin.to_array()).filter(|_| scene.origin != DVec3::ZERO),
            base: GaussiansSummary::of(&scene.base),
            supplement: scene.supplement.as_ref().map(|s| SupplementSummary {
                sh_degree: color::of(s.gaussians.sh_degree).harmonics,
                color: color::of(s.gaussians.sh_degree).name,
                gaussians: GaussiansSummary::of(&s.gaussians),
                lobes: LobesSummary { width: lobe_spread(&s.lobes.widths), sharpness: lobe_spread(&s.lobes.sharpness) },
            }),
        }
    }
}

impl GaussiansSummary {
    /// Summarizes the Gaussians of one segment.
    pub fn of(gaussians: &Gaussians) -> GaussiansSummary {
        let corner = |pick: fn(f32, f32) -> f32| {
            gaussians.means.iter().copied().reduce(|a, b| [pick(a[0], b[0]), pick(a[1], b[1]), pick(a[2], b[2])])
        };
        let scale = |pick: fn(f32, f32) -> f32| {
            Spread::of(gaussians.log_scales.iter().map(|s| f64::from(pick(pick(s[0], s[1]), s[2])).exp()))
        };
        GaussiansSummary {
            count: gaussians.len(),
            bounds: corner(f32::min).zip(corner(f32::max)).map(|(low, high)| [low, high]),
            opacity: Spread::of(gaussians.opacities.iter().map(|&o| 1.0 / (1.0 + f64::from(-o).exp()))),
            largest_scale: scale(f32::max),
            smallest_scale: scale(f32::min),
        }
    }
}

/// Number of photos of one size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct SizeCount {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Photos of this size.
    pub photos: usize,
}

/// Summary of a dataset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DatasetSummary {
    /// `COLMAP`, `Blender` (NeRF Synthetic), `transforms` (instant-ngp, nerfstudio) or `memory`.
    pub format: &'static str,
    /// Number of photos.
    pub photos: usize,
    /// Photos for training.
    pub train: usize,
    /// Photos for testing.
    pub test: usize,
    /// Sizes after preparation, most frequent first.
    pub sizes: Vec<SizeCount>,
    /// Photos downscaled from larger files.
    pub reduced: usize,
    /// Photos whose lens distortion is removed.
    pub undistorted: usize,
    /// Largest share of such a photo, 0 to 1, that its file does not show and that does not count.
    pub outside: f64,
    /// Photos with a mask file.
    pub masked: usize,
    /// Sparse points; `None` if there are none.
    pub points: Option<usize>,
    /// 1.1 × the largest distance of a training camera from their mean, scene units.
    pub extent: f64,
    /// Center of the ball that the training cameras look at, scene units.
    pub focus_center: Option<[f64; 3]>,
    /// Radius of that ball, scene units.
    pub focus_radius: Option<f64>,
}

impl DatasetSummary {
    /// Summarizes a dataset.
    pub fn of(dataset: &Dataset) -> DatasetSummary {
        let mut sizes: Vec<SizeCount> = Vec::new();
        for camera in dataset.photos.iter().map(|photo| &photo.camera) {
            match sizes.iter_mut().find(|s| (s.width, s.height) == (camera.width, camera.height)) {
                Some(size) => size.photos += 1,
                None => sizes.push(SizeCount { width: camera.width, height: camera.height, photos: 1 }),
            }
        }
        sizes.sort_by_key(|s| std::cmp::Reverse(s.photos));
        let files = || {
            dataset.photos.iter().filter_map(|photo| match &photo.pixels {
                PixelSource::File(file) => Some((photo, file)),
                PixelSource::Memory(_) => None,
            })
        };
        let focus = dataset.focus();
        DatasetSummary {
            format: match dataset.kind {
                DatasetKind::Colmap => "COLMAP",
                DatasetKind::Blender => "Blender",
                DatasetKind::Transforms => "transforms",
                DatasetKind::Memory => "memory",
            },
            photos: dataset.photos.len(),
            train: dataset.split(Split::Train).count(),
            test: dataset.split(Split::Test).count(),
            sizes,
            reduced: files().filter(|(photo, file)| file.size != [photo.camera.width, photo.camera.height]).count(),
            undistorted: files().filter(|(_, file)| file.lens.is_some()).count(),
            outside: dataset.outside,
            masked: files().filter(|(_, file)| file.mask.is_some()).count(),
            points: dataset.points.as_ref().map(|points| points.positions.len()),
            extent: dataset.extent(),
            focus_center: focus.map(|f| f.center.to_array()),
            focus_radius: focus.map(|f| f.radius),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::sample::random_scene;

    #[test]
    fn a_spread_is_of_values_that_occur() {
        let spread = Spread::of((0..=100).rev().map(f64::from)).unwrap();
        assert_eq!(spread, Spread { min: 0.0, p5: 5.0, median: 50.0, p95: 95.0, max: 100.0 });
        assert_eq!(Spread::of([]), None);
        assert_eq!(Spread::of([3.0]).unwrap().p95, 3.0);
    }

    #[test]
    fn a_scene_is_summed_up() {
        let scene = random_scene(1, 200, 50, 2);
        let summary = SceneSummary::of(&scene);
        let supplement = summary.supplement.unwrap();
        assert_eq!((summary.sh_degree.unwrap(), summary.base.count, supplement.gaussians.count), (2, 200, 50));
        let [low, high] = summary.base.bounds.unwrap();
        assert!(scene.base.means.iter().all(|m| (0..3).all(|c| low[c] <= m[c] && m[c] <= high[c])));
        let (small, large) = (summary.base.smallest_scale.unwrap(), summary.base.largest_scale.unwrap());
        assert!(0.0 < small.min && small.median < large.median);
        assert!(summary.base.opacity.unwrap().max < 1.0);
        let empty = SceneSummary::of(&Scene::default());
        assert_eq!((empty.base.bounds, empty.base.opacity, empty.supplement), (None, None, None));
    }
}
