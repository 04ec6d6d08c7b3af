//! Datasets in memory: photos with their cameras, where their pixels come from, and the options they are opened with.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use super::lens::Lens;
use super::points::PointCloud;
use super::reduce::Reduce;
use crate::scene::Camera;

/// The folders beside a photo's own, by the same names, that hold its diffuse and its specular part where the truth is known.
pub const DIFFUSE: &str = "diffuse";
/// See [`DIFFUSE`].
pub const SPECULAR: &str = "specular";

/// How photos are found and prepared.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DatasetOptions {
    /// Photos whose longer side exceeds this many pixels are reduced to it. Nothing is ever enlarged.
    pub max_size: Option<u32>,
    /// How they are reduced.
    pub reduce: Reduce,
    /// Photos that `images_2`, `_4` or `_8` has at the size that they would be reduced to are taken from there, unless `images` says where
    /// they are.
    pub reduced_folders: bool,
    /// What transparent pixels are put over, sRGB values 0 to 1. Black by default.
    pub background: [f32; 3],
    /// The folder of the photos, in the dataset or a path of its own; by default where the dataset has them.
    pub images: Option<PathBuf>,
    /// The folder of the COLMAP model, in the dataset or a path of its own; by default the first of the usual places.
    pub model: Option<PathBuf>,
    /// Which photos are for testing, where the dataset does not say.
    pub holdout: Holdout,
    /// What transparency means.
    pub alpha: Alpha,
}

/// Which photos are for testing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Holdout {
    /// Those that the dataset's own lists name; without lists the first by name and every 8th after it.
    #[default]
    Dataset,
    /// The first by name and every n-th after it.
    Every(u32),
    /// An eighth that lies together: of cameras that go round something, by angle; else one end of their largest spread.
    Sector,
    /// None: all are for training.
    Nothing,
}

impl FromStr for Holdout {
    type Err = String;

    /// `none`, `sector` or a number from 2; what the dataset says has no name.
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
    /// As histories and pages name it: equal where the same photos are held out.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Holdout::Dataset => f.write_str("default"),
            Holdout::Every(n) => write!(f, "every {n}"),
            Holdout::Sector => f.write_str("sector"),
            Holdout::Nothing => f.write_str("none"),
        }
    }
}

/// What transparency means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Alpha {
    /// They show the background
    #[default]
    Background,
    /// Pixels with alpha below a half are ignored
    Mask,
}

/// What a photo is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    /// Photos that scenes learn from.
    Train,
    /// Photos that they are measured on.
    Test,
}

/// Where a dataset comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DatasetKind {
    /// A COLMAP model, binary or text.
    Colmap,
    /// NeRF Synthetic: transforms.json whose focal length is an angle, and cameras around the cube of those scenes.
    Blender,
    /// transforms.json of instant-ngp or nerfstudio.
    Transforms,
    /// Made by the program itself.
    Memory,
}

/// An image file and what its pixels go through.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageFile {
    /// Where it was found.
    pub path: PathBuf,
    /// Width and height of the picture, after it is turned.
    pub size: [u32; 2],
    /// The EXIF orientation, 1 to 8, by which the file's pixels are turned; 1 leaves them as they are.
    pub orientation: u8,
    /// Of the file, as it is decoded.
    pub bytes_per_pixel: u8,
    /// Whether pixels may be transparent.
    pub has_alpha: bool,
    /// What is taken out of it; none for a pinhole.
    pub lens: Option<Lens>,
    /// An image whose black pixels do not count.
    pub mask: Option<PathBuf>,
    /// What transparency means.
    pub alpha: Alpha,
    /// How it is downscaled.
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
    /// By pixel, `false` where it says nothing of the scene and is left out of losses and metrics; all count where there is no
    /// mask.
    pub mask: Option<Vec<bool>>,
}

impl Image {
    /// Whether any pixel says something of the scene.
    pub fn any_counts(&self) -> bool {
        self.mask.as_ref().is_none_or(|mask| mask.contains(&true))
    }

    /// The pixels as the device has them: R in the low byte, and in the high one 255 where the pixel counts, else 0.
    pub fn packed(&self) -> Vec<u32> {
        let counts = |i: usize| self.mask.as_ref().is_none_or(|mask| mask[i]);
        let pixels = self.rgb.chunks_exact(3).enumerate();
        pixels.map(|(i, p)| u32::from_le_bytes([p[0], p[1], p[2], if counts(i) { 255 } else { 0 }])).collect()
    }
}

/// Where a photo's pixels are.
#[derive(Debug, Clone, PartialEq)]
pub enum PixelSource {
    /// Decoded when it is asked for.
    File(Box<ImageFile>),
    /// Of the photo's camera's size.
    Memory(Arc<Image>),
}

/// One photo.
#[derive(Debug, Clone, PartialEq)]
pub struct Photo {
    /// The name in the dataset, relative and with `/` between folders; unique. Of a panorama's faces, each has its own.
    pub name: String,
    /// The camera of the prepared image: without distortion, and of its reduced size.
    pub camera: Camera,
    /// For training or for testing.
    pub split: Split,
    /// Where they are read from.
    pub pixels: PixelSource,
}

/// A set of photos, sorted by name, and sparse points if there are any.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// What the files are.
    pub kind: DatasetKind,
    /// Sorted by name.
    pub photos: Vec<Photo>,
    /// Where the base may begin.
    pub points: Option<PointCloud>,
    /// What transparent pixels are put over, sRGB values 0 to 1.
    pub background: [f32; 3],
    /// Whether any photo has lens distortion taken out.
    pub undistorted: bool,
    /// The largest part of an undistorted photo, 0 to 1, that its file does not show and that does not count.
    pub outside: f64,
    /// The files that describe it. With [`Dataset::photo_files`] all that it is read from.
    pub sources: Vec<PathBuf>,
    /// What its user would not expect: what was left out, replaced or guessed, a sentence each.
    pub notes: Vec<String>,
}

impl Dataset {
    /// The files that pixels come from.
    pub fn photo_files(&self) -> Vec<&Path> {
        let files = self.photos.iter().filter_map(|photo| match &photo.pixels {
            PixelSource::File(file) => Some(std::iter::once(&file.path).chain(&file.mask)),
            PixelSource::Memory(_) => None,
        });
        files.flatten().map(PathBuf::as_path).collect()
    }

    /// Photos of one split, with their index.
    pub fn split(&self, split: Split) -> impl Iterator<Item = (usize, &Photo)> {
        self.photos.iter().enumerate().filter(move |(_, photo)| photo.split == split)
    }
}

impl Photo {
    /// Whether the background may shine through it.
    pub(super) fn shows_background(&self) -> bool {
        matches!(&self.pixels, PixelSource::File(file) if file.has_alpha && file.alpha == Alpha::Background)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_holdout_is_a_sector_none_or_a_number() {
        assert_eq!("sector".parse(), Ok(Holdout::Sector));
        assert_eq!("none".parse(), Ok(Holdout::Nothing));
        assert_eq!("2".parse(), Ok(Holdout::Every(2)));
        for bad in ["", "0", "1", "-3", "2.5", "all"] {
            assert!(bad.parse::<Holdout>().is_err(), "{bad}");
        }
    }
}
