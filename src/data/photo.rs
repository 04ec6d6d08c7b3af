//! Datasets in memory: photos with their cameras, where their pixels come from, and the options they are opened with.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::lens::Lens;
use super::points::PointCloud;
use super::reduce::Reduce;
use super::trained_with::PartOf;
use crate::scene::Camera;

/// Folders next to the photos' own with their diffuse and specular parts, under the same names, if the truth
/// is known.
pub const DIFFUSE: &str = "diffuse";
/// See [`DIFFUSE`].
pub const SPECULAR: &str = "specular";

/// Options for finding and preparing photos.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct DatasetOptions {
    /// Maximum longer side, pixels: larger photos are downscaled to it, smaller ones are never enlarged.
    pub max_size: Option<u32>,
    /// Method of downscaling.
    pub reduce: Reduce,
    /// Use the photos in `images_2`, `_4` or `_8` if their size equals the downscaled size. Ignored if
    /// `images` is set.
    pub reduced_folders: bool,
    /// Color behind transparent pixels, sRGB values 0 to 1. Black by default.
    pub background: [f32; 3],
    /// Folder of the photos, in the dataset or elsewhere; `None` for the dataset's usual folder.
    pub images: Option<PathBuf>,
    /// Folder of the COLMAP model, in the dataset or elsewhere; `None` for the first of the usual places.
    pub model: Option<PathBuf>,
    /// Selects the test photos, unless the dataset lists them.
    pub holdout: Holdout,
    /// Leave out the test photos, and test on the first and every 8th of the training photos after it.
    #[serde(default)]
    pub tune: bool,
    /// Meaning of transparency.
    pub alpha: Alpha,
}

/// Selection of the test photos.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Holdout {
    /// The dataset's own lists; without lists, the first by name and every 8th after it.
    #[default]
    Dataset,
    /// The first by name and every n-th after it.
    Every(u32),
    /// A contiguous eighth of the cameras: by angle if they surround something, otherwise one end of their
    /// largest spread.
    Sector,
    /// None: all photos are for training.
    Nothing,
}

impl FromStr for Holdout {
    type Err = String;

    /// Parses `none`, `sector` or a number from 2; [`Holdout::Dataset`] has no name.
    fn from_str(text: &str) -> Result<Holdout, String> {
        match text {
            "none" => Ok(Holdout::Nothing),
            "sector" => Ok(Holdout::Sector),
            _ => match text.parse() {
                Ok(n) if n >= 2 => Ok(Holdout::Every(n)),
                _ => Err("expected sector, none or a number from 2".into()),
            },
        }
    }
}

impl fmt::Display for Holdout {
    /// Writes the name used in histories and reports: equal names hold out the same photos.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Holdout::Dataset => f.write_str("default"),
            Holdout::Every(n) => write!(f, "every {n}"),
            Holdout::Sector => f.write_str("sector"),
            Holdout::Nothing => f.write_str("none"),
        }
    }
}

/// Meaning of transparency.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Alpha {
    /// The background shows through
    #[default]
    Background,
    /// Pixels with alpha below one half are ignored
    Mask,
}

/// Purpose of a photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    /// Photos for training.
    Train,
    /// Photos for testing.
    Test,
}

/// Origin of a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DatasetKind {
    /// A COLMAP model, binary or text.
    Colmap,
    /// NeRF Synthetic: a transforms.json with an angle as focal length, and cameras around the cube of those
    /// scenes.
    Blender,
    /// transforms.json of instant-ngp or nerfstudio.
    Transforms,
    /// Made by the program itself.
    #[default]
    Memory,
}

/// An image file, and the processing of its pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Width and height of the picture after its rotation.
    pub size: [u32; 2],
    /// EXIF orientation, 1 to 8, to rotate the file's pixels by; 1 leaves them unchanged.
    pub orientation: u8,
    /// Bytes per pixel of the decoded file.
    pub bytes_per_pixel: u8,
    /// Whether pixels may be transparent.
    pub has_alpha: bool,
    /// Lens to remove; `None` for a pinhole.
    pub lens: Option<Lens>,
    /// A mask image; its black pixels are ignored.
    pub mask: Option<PathBuf>,
    /// Meaning of transparency.
    pub alpha: Alpha,
    /// Method of downscaling.
    pub reduce: Reduce,
}

/// An 8-bit sRGB image: 3 bytes per pixel, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// 8-bit sRGB, `[height · width · 3]`, rows from the top.
    pub rgb: Vec<u8>,
    /// By pixel, `false` if it is masked: losses and metrics ignore it. `None` if all pixels are valid.
    pub mask: Option<Vec<bool>>,
}

impl Image {
    /// Whether any pixel is valid.
    pub fn any_counts(&self) -> bool {
        self.mask.as_ref().is_none_or(|mask| mask.contains(&true))
    }

    /// The pixels in the device's format: R in the low byte; the high byte is 255 for valid pixels, else 0.
    pub fn packed(&self) -> Vec<u32> {
        let counts = |i: usize| self.mask.as_ref().is_none_or(|mask| mask[i]);
        let pixels = self.rgb.chunks_exact(3).enumerate();
        pixels.map(|(i, p)| u32::from_le_bytes([p[0], p[1], p[2], if counts(i) { 255 } else { 0 }])).collect()
    }

    /// Writes the opacity of valid pixels into the high byte of `packed`, as the kernel `composite` reads it: 1 to 255. It follows from the
    /// change of the colors between backgrounds, from `background` to `far`, over which the photo is `other`.
    pub(crate) fn put_opacity(&self, packed: &mut [u32], (background, far): ([f32; 3], [f32; 3]), other: &Image) {
        let whole: f32 = background.iter().zip(far).map(|(a, b)| 255.0 * (b - a).abs()).sum();
        let pixels = packed.iter_mut().zip(self.rgb.chunks_exact(3).zip(other.rgb.chunks_exact(3)));
        for (word, (own, other)) in pixels.filter(|(word, _)| **word >> 24 != 0) {
            let change: u32 = own.iter().zip(other).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
            let opacity = (1.0 - change as f32 / whole).clamp(0.0, 1.0);
            *word = *word & 0xFF_FFFF | (1 + (254.0 * opacity).round() as u32) << 24;
        }
    }
}

/// Storage of a photo's pixels.
#[derive(Debug, Clone, PartialEq)]
pub enum PixelSource {
    /// A file, decoded on demand.
    File(Box<ImageFile>),
    /// An image of the size of the photo's camera.
    Memory(Arc<Image>),
}

/// One photo.
#[derive(Debug, Clone, PartialEq)]
pub struct Photo {
    /// Unique relative name in the dataset, with `/` between folders. Each face of a panorama has its own
    /// name.
    pub name: String,
    /// Camera of the prepared image: undistorted and downscaled.
    pub camera: Camera,
    /// Training or testing.
    pub split: Split,
    /// Storage of the pixels.
    pub pixels: PixelSource,
}

/// A set of photos, sorted by name, and sparse points if there are any.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Dataset {
    /// Format of the dataset's files.
    pub kind: DatasetKind,
    /// Sorted by name.
    pub photos: Vec<Photo>,
    /// Sparse points for the first scene.
    pub points: Option<PointCloud>,
    /// Color behind transparent pixels, sRGB values 0 to 1.
    pub background: [f32; 3],
    /// Whether lens distortion is removed from any photo.
    pub undistorted: bool,
    /// Largest fraction of an undistorted photo, 0 to 1, outside of its file; such pixels are ignored.
    pub outside: f64,
    /// The files that describe the dataset. Together with [`Dataset::photo_files`], all files that it is read
    /// from.
    pub sources: Vec<PathBuf>,
    /// Notes for the user on anything left out, replaced or guessed, one sentence each.
    pub notes: Vec<String>,
    /// The part of a plan that these photos are.
    pub part: Option<PartOf>,
    /// Number of Gaussians that the plan gives this part at most.
    pub gaussians: Option<u32>,
}

impl Dataset {
    /// The image files of all photos.
    pub fn photo_files(&self) -> Vec<&Path> {
        let files = self.photos.iter().filter_map(|photo| match &photo.pixels {
            PixelSource::File(file) => Some(std::iter::once(&file.path).chain(&file.mask)),
            PixelSource::Memory(_) => None,
        });
        files.flatten().map(PathBuf::as_path).collect()
    }

    /// Photos of one split, each with its index.
    pub fn split(&self, split: Split) -> impl Iterator<Item = (usize, &Photo)> {
        self.photos.iter().enumerate().filter(move |(_, photo)| photo.split == split)
    }
}

impl Photo {
    /// Whether the background may be visible through it.
    pub(crate) fn shows_background(&self) -> bool {
        matches!(&self.pixels, PixelSource::File(file) if file.has_alpha && file.alpha == Alpha::Background)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opacity_follows_from_the_change_between_backgrounds() {
        let backgrounds = [[0.0f32, 0.2, 1.0], [1.0, 1.0, 0.0]];
        let opacities = [0u8, 1, 64, 128, 254, 255];
        let over = |background: [f32; 3]| {
            let channel = |a: u8, c: usize| {
                let (a, front) = (f32::from(a) / 255.0, [0.9, 0.3, 0.0][c]);
                (255.0 * (front * a + background[c] * (1.0 - a))).round() as u8
            };
            let rgb = opacities.iter().flat_map(|&a| [0, 1, 2].map(|c| channel(a, c))).collect();
            Image { width: 6, height: 1, rgb, mask: Some(vec![true, true, true, false, true, true]) }
        };
        let [own, other] = backgrounds.map(over);
        let (before, mut packed) = (own.packed(), own.packed());
        own.put_opacity(&mut packed, (backgrounds[0], backgrounds[1]), &other);
        for ((word, before), opacity) in packed.iter().zip(&before).zip(opacities) {
            assert_eq!(word & 0xFF_FFFF, before & 0xFF_FFFF);
            // Both pictures round each color by half a step, so the sum of three changes is off by 3 of 714 at most: 1.1 of 254. Its
            // opacity is rounded by a half.
            let off = f64::from(word >> 24) - (1.0 + 254.0 * f64::from(opacity) / 255.0);
            assert!(if before >> 24 == 0 { *word >> 24 == 0 } else { off.abs() <= 1.6 }, "{opacity}: {word:#x}");
        }
    }
}
