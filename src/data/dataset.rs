//! Photos with their cameras, read from COLMAP or transforms.json datasets or made in memory.

use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::distortion::{Distortion, Lens};
use super::images::{self, Image};
use super::ply::PointCloud;
use super::{colmap, transforms};
use crate::scene::Camera;
use crate::{Error, Result};

/// Of the photos sorted by name, the first and every 8th after it are for testing (Mip-NeRF 360, 3DGS).
const TEST_EVERY: usize = 8;

/// How photos are prepared.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DatasetOptions {
    /// Photos whose longer side exceeds this many pixels are reduced to it. Nothing is ever enlarged.
    pub max_size: Option<u32>,
    /// What transparent pixels are put over, sRGB values 0 to 1. Black by default.
    pub background: [f32; 3],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    Train,
    Test,
}

/// Where a dataset comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DatasetKind {
    Colmap,
    /// NeRF Synthetic: transforms.json whose focal length is an angle.
    Blender,
    /// transforms.json of instant-ngp or nerfstudio.
    Transforms,
    /// Made by the program itself.
    Memory,
}

/// An image file and what its pixels go through.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageFile {
    pub path: PathBuf,
    /// Width and height of the file.
    pub size: [u32; 2],
    /// What is taken out of it; none for a pinhole.
    pub lens: Option<Lens>,
}

/// Where a photo's pixels are.
#[derive(Debug, Clone, PartialEq)]
pub enum PixelSource {
    File(ImageFile),
    /// Of the photo's camera's size.
    Memory(Arc<Image>),
}

/// One photo.
#[derive(Debug, Clone, PartialEq)]
pub struct Photo {
    /// The name in the dataset, relative and with `/` between folders; unique.
    pub name: String,
    /// The camera of the prepared image: without distortion, and of its reduced size.
    pub camera: Camera,
    pub split: Split,
    pub pixels: PixelSource,
}

/// A set of photos, sorted by name, and sparse points if there are any.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    pub kind: DatasetKind,
    pub photos: Vec<Photo>,
    pub points: Option<PointCloud>,
    /// What transparent pixels are put over, sRGB values 0 to 1.
    pub background: [f32; 3],
    /// Whether any photo has lens distortion taken out.
    pub undistorted: bool,
    /// The largest part of an undistorted photo, 0 to 1, that its file does not show and that is filled from the edge.
    pub outside: f64,
    /// The files that describe it. With [`Dataset::photo_files`] all that it is read from.
    pub sources: Vec<PathBuf>,
}

/// A photo as a dataset's files describe it.
pub(super) struct Shot {
    pub(super) name: String,
    pub(super) path: PathBuf,
    /// The file that names it, for errors.
    pub(super) listed_in: PathBuf,
    pub(super) camera: SourceCamera,
    /// World to camera, OpenCV axes.
    pub(super) rotation: DMat3,
    pub(super) translation: DVec3,
    pub(super) split: Option<Split>,
}

/// A focal length in pixels or as fields of view in radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Focal {
    Pixels([f64; 2]),
    Angles { x: f64, y: Option<f64> },
}

/// Intrinsics as a file gives them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SourceCamera {
    /// The image size that they are for; the file's own if not given.
    pub(super) size: Option<[f64; 2]>,
    pub(super) focal: Focal,
    /// The middle if not given.
    pub(super) center: Option<[f64; 2]>,
    pub(super) distortion: Distortion,
}

impl SourceCamera {
    /// What is wrong with the numbers, before any image is known.
    pub(super) fn check(&self) -> Result<(), String> {
        let positive = |v: &f64| v.is_finite() && *v > 0.0;
        let angle = |v: &f64| *v > 0.0 && *v < std::f64::consts::PI;
        if let Some(size) = self.size.filter(|size| !size.iter().all(positive)) {
            return Err(format!("the image size {size:?} is not sound"));
        }
        match self.focal {
            Focal::Pixels(focal) if !focal.iter().all(positive) => {
                return Err(format!("the focal lengths {focal:?} are not positive numbers"));
            }
            Focal::Angles { x, y } if ![Some(x), y].iter().flatten().all(angle) => {
                return Err("the field of view is not between 0 and π".into());
            }
            _ => {}
        }
        if let Some(center) = self.center.filter(|center| !center.iter().all(|v| v.is_finite())) {
            return Err(format!("the principal point {center:?} is not finite"));
        }
        if !self.distortion.is_finite() {
            return Err(format!("the distortion {:?} is not finite", self.distortion));
        }
        Ok(())
    }

    /// The intrinsics for an image file of this size, which may be a reduced copy of what they were made for.
    pub(super) fn for_image(&self, [width, height]: [u32; 2]) -> Result<Lens, String> {
        let (disk_w, disk_h) = (width as f64, height as f64);
        let [w, h] = self.size.unwrap_or([disk_w, disk_h]);
        let (scale_x, scale_y) = (disk_w / w, disk_h / h);
        // A reduced size is rounded to whole pixels, in either direction.
        if (disk_w - w * scale_y).abs() > 1.0 && (disk_h - h * scale_x).abs() > 1.0 {
            let turned = if width != height && disk_w == h && disk_h == w { " (it is turned)" } else { "" };
            return Err(format!(
                "the image is {width} × {height}, but its camera is for {w} × {h}, of another aspect{turned}"
            ));
        }
        let [fx, fy] = match self.focal {
            Focal::Pixels(focal) => focal,
            Focal::Angles { x, y } => {
                let fx = 0.5 * w / (0.5 * x).tan();
                [fx, y.map_or(fx, |y| 0.5 * h / (0.5 * y).tan())]
            }
        };
        let [cx, cy] = self.center.unwrap_or([0.5 * w, 0.5 * h]);
        let (fx, fy, cx, cy) = (fx * scale_x, fy * scale_y, cx * scale_x, cy * scale_y);
        Ok(Lens { width, height, fx, fy, cx, cy, distortion: self.distortion })
    }
}

/// `name` without what could lead out of a folder, so that outputs may be named after photos.
fn clean_name(name: &str) -> String {
    let parts = Path::new(name).components().filter_map(|part| match part {
        Component::Normal(part) => Some(part.to_string_lossy()),
        _ => None,
    });
    parts.collect::<Vec<_>>().join("/")
}

impl Dataset {
    /// Reads what describes a dataset: cameras, names, sizes and points, but no pixels. `path` is a folder with a COLMAP model
    /// (sparse/0, sparse or itself) and images, a folder with transforms_train.json or transforms.json, or such a file.
    pub fn open(path: impl AsRef<Path>, options: &DatasetOptions) -> Result<Dataset> {
        let path = path.as_ref();
        if options.max_size == Some(0) {
            return Err(Error::Usage("the largest image size must be at least 1 pixel".into()));
        }
        if !options.background.iter().all(|v| (0.0..=1.0).contains(v)) {
            return Err(Error::Usage(format!("the background {:?} is not in 0 to 1", options.background)));
        }
        let found = std::fs::metadata(path).map_err(|source| Error::io(path, source))?;
        if let Some(model) = found.is_dir().then(|| colmap::find(path)).flatten() {
            let (shots, points, sources) = colmap::read(path, &model)?;
            return assemble(DatasetKind::Colmap, shots, points, sources, options);
        }
        if let Some(file) = transforms::find(path) {
            let transforms::Transforms { shots, points, blender, sources } = transforms::read(&file, found.is_file())?;
            let kind = if blender { DatasetKind::Blender } else { DatasetKind::Transforms };
            return assemble(kind, shots, points, sources, options);
        }
        let what = "no dataset here; expected a folder with a COLMAP model (sparse/0/cameras.bin or .txt, and images/), \
                    with transforms_train.json or transforms.json, or a path to such a JSON file";
        Err(Error::input(path, what))
    }

    /// The files that pixels come from.
    pub fn photo_files(&self) -> Vec<&Path> {
        let files = self.photos.iter().filter_map(|photo| match &photo.pixels {
            PixelSource::File(file) => Some(file.path.as_path()),
            PixelSource::Memory(_) => None,
        });
        files.collect()
    }

    /// Decodes and prepares all photos in parallel, in their order.
    pub fn load_images(&self) -> Result<Vec<Image>> {
        // Collected first, so that of several faults the first by name is told.
        let results: Vec<Result<Image>> = self.photos.par_iter().map(|photo| photo.load(self.background)).collect();
        results.into_iter().collect()
    }

    /// Photos of one split, with their index.
    pub fn split(&self, split: Split) -> impl Iterator<Item = (usize, &Photo)> {
        self.photos.iter().enumerate().filter(move |(_, photo)| photo.split == split)
    }
}

impl Photo {
    /// The prepared image, of the camera's size.
    pub fn load(&self, background: [f32; 3]) -> Result<Image> {
        let size = [self.camera.width, self.camera.height];
        match &self.pixels {
            PixelSource::File(file) => images::load(&file.path, file.size, file.lens.as_ref(), size, background),
            PixelSource::Memory(image) => {
                if [image.width, image.height] != size || image.rgb.len() != 3 * size[0] as usize * size[1] as usize {
                    return Err(Error::Usage(format!(
                        "photo `{}`: its image has another size than its camera",
                        self.name
                    )));
                }
                Ok(Image::clone(image))
            }
        }
    }
}

fn assemble(
    kind: DatasetKind,
    mut shots: Vec<Shot>,
    points: Option<PointCloud>,
    sources: Vec<PathBuf>,
    options: &DatasetOptions,
) -> Result<Dataset> {
    let mut names = HashSet::new();
    for shot in &mut shots {
        shot.name = clean_name(&shot.name);
        if shot.name.is_empty() || !names.insert(shot.name.clone()) {
            let what = format!("the image name `{}` is empty or appears twice", shot.name);
            return Err(Error::input(&shot.listed_in, what));
        }
    }
    shots.sort_by(|a, b| a.name.cmp(&b.name));
    let missing: Vec<&Shot> = shots.iter().filter(|shot| !shot.path.is_file()).collect();
    if let [first, more @ ..] = &missing[..] {
        let others = if more.is_empty() { String::new() } else { format!(" (and {} more)", more.len()) };
        let what = format!("image `{}` is listed, but {} is missing{others}", first.name, first.path.display());
        return Err(Error::input(&first.listed_in, what));
    }
    let results: Vec<Result<(Photo, f64)>> =
        shots.into_par_iter().enumerate().map(|(i, shot)| prepare(shot, i, options)).collect();
    let photos = results.into_iter().collect::<Result<Vec<_>>>()?;
    let outside = photos.iter().fold(0.0, |worst: f64, (_, outside)| worst.max(*outside));
    let photos: Vec<Photo> = photos.into_iter().map(|(photo, _)| photo).collect();
    let undistorted =
        photos.iter().any(|photo| matches!(&photo.pixels, PixelSource::File(file) if file.lens.is_some()));
    Ok(Dataset { kind, photos, points, background: options.background, undistorted, outside, sources })
}

/// The photo and what part of it its file does not show.
fn prepare(shot: Shot, index: usize, options: &DatasetOptions) -> Result<(Photo, f64)> {
    let size = images::size(&shot.path)?;
    let fail = |what: String| Error::input(&shot.path, format!("{what} (listed in {})", shot.listed_in.display()));
    let lens = shot.camera.for_image(size).map_err(fail)?;
    let numbers = [lens.fx, lens.fy, lens.cx, lens.cy].into_iter().chain(shot.translation.to_array());
    // What reaches the device is float32.
    if !numbers.clone().all(|v| (v as f32).is_finite()) || !numbers.take(2).all(|v| (v as f32).is_normal()) {
        return Err(fail("its camera's numbers are too large or too small for 32 bits".into()));
    }
    let [width, height] = images::fit(size, options.max_size);
    let Lens { fx, fy, cx, cy, .. } = lens;
    let (rotation, translation) = (shot.rotation, shot.translation);
    let full = Camera { width: size[0], height: size[1], fx, fy, cx, cy, rotation, translation };
    let lens = (!lens.distortion.is_none()).then_some(lens);
    let every_8th = if index.is_multiple_of(TEST_EVERY) { Split::Test } else { Split::Train };
    let photo = Photo {
        name: shot.name,
        camera: full.resized(width, height),
        split: shot.split.unwrap_or(every_8th),
        pixels: PixelSource::File(ImageFile { path: shot.path, size, lens }),
    };
    Ok((photo, lens.map_or(0.0, |lens| lens.outside_fraction())))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(size: Option<[f64; 2]>) -> SourceCamera {
        let (focal, center) = (Focal::Pixels([4000.0, 4100.0]), Some([2400.0, 1700.0]));
        SourceCamera { size, focal, center, distortion: Distortion::default() }
    }

    #[test]
    fn intrinsics_follow_the_size_of_the_file() {
        // Mip-NeRF 360: 4946 × 3286, whose copies reduced 4 times are 1237 × 822.
        let lens = camera(Some([4946.0, 3286.0])).for_image([1237, 822]).unwrap();
        let (sx, sy) = (1237.0 / 4946.0, 822.0 / 3286.0);
        assert_eq!([lens.fx, lens.fy, lens.cx, lens.cy], [4000.0 * sx, 4100.0 * sy, 2400.0 * sx, 1700.0 * sy]);
        let error = camera(Some([4946.0, 3286.0])).for_image([1237, 825]).unwrap_err();
        assert!(error.contains("1237 × 825") && error.contains("4946 × 3286"), "{error}");
        assert!(camera(Some([640.0, 480.0])).for_image([480, 640]).unwrap_err().contains("turned"));
        assert_eq!(camera(None).for_image([10, 20]).unwrap().fx, 4000.0);
    }

    #[test]
    fn fields_of_view_become_focal_lengths() {
        let focal = Focal::Angles { x: std::f64::consts::FRAC_PI_2, y: None };
        let lens =
            SourceCamera { size: None, focal, center: None, distortion: Distortion::default() }.for_image([200, 100]);
        let lens = lens.unwrap();
        assert!((lens.fx - 100.0).abs() < 1e-12 && lens.fy == lens.fx);
        assert_eq!([lens.cx, lens.cy], [100.0, 50.0]);
    }

    #[test]
    fn names_cannot_lead_out_of_a_folder() {
        assert_eq!(clean_name("./train/r_0"), "train/r_0");
        assert_eq!(clean_name("../../etc/passwd"), "etc/passwd");
        assert_eq!(clean_name("/abs/x.png"), "abs/x.png");
        assert_eq!(clean_name(".."), "");
    }

    /// 17 photos of 8 × 6 whose left half is red and opaque, the right half green and transparent.
    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let turn = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        let frames: Vec<_> = (0..17)
            .rev()
            .map(|i| serde_json::json!({"file_path": format!("{i:02}"), "transform_matrix": turn}))
            .collect();
        let file = serde_json::json!({"fl_x": 16.0, "w": 16, "h": 12, "frames": frames});
        std::fs::write(folder.path().join("transforms.json"), file.to_string()).unwrap();
        for i in 0..17 {
            let pixel = |x, _| if x < 4 { image::Rgba([255, 0, 0, 255]) } else { image::Rgba([0, 255, 0, 0]) };
            image::RgbaImage::from_fn(8, 6, pixel).save(folder.path().join(format!("{i:02}.png"))).unwrap();
        }
        folder
    }

    #[test]
    fn photos_are_sorted_split_composited_and_reduced() {
        let folder = folder();
        let options = DatasetOptions { max_size: Some(4), background: [0.0, 0.0, 1.0] };
        let data = Dataset::open(folder.path(), &options).unwrap();
        assert_eq!((data.kind, data.photos.len(), data.undistorted), (DatasetKind::Transforms, 17, false));
        let names: Vec<&str> = data.photos.iter().map(|photo| &photo.name[..]).collect();
        assert!(names.is_sorted());
        assert_eq!(data.split(Split::Test).map(|(i, _)| i).collect::<Vec<_>>(), [0, 8, 16]);
        let camera = data.photos[3].camera;
        assert_eq!([camera.fx, camera.fy, camera.cx, camera.cy], [4.0, 4.0, 2.0, 1.5]);
        assert_eq!((camera.width, camera.height), (4, 3));
        let row = [[255, 0, 0], [255, 0, 0], [0, 0, 255], [0, 0, 255]].concat();
        for image in data.load_images().unwrap() {
            assert_eq!(image, Image { width: 4, height: 3, rgb: row.repeat(3) });
        }
    }

    #[test]
    fn missing_changed_and_double_images_are_named() {
        let folder = folder();
        let options = DatasetOptions::default();
        let data = Dataset::open(folder.path(), &options).unwrap();
        let path = folder.path().join("05.png");
        image::RgbImage::new(11, 6).save(&path).unwrap();
        let message = data.load_images().unwrap_err().to_string();
        assert!(message.contains("05.png") && message.contains("11 × 6"), "{message}");
        let message = Dataset::open(folder.path(), &options).unwrap_err().to_string();
        assert!(
            message.contains("05.png") && message.contains("aspect") && message.contains("transforms.json"),
            "{message}"
        );
        std::fs::write(&path, "no image").unwrap();
        let message = Dataset::open(folder.path(), &options).unwrap_err().to_string();
        assert!(message.contains("05.png"), "{message}");
        std::fs::remove_file(&path).unwrap();
        let message = Dataset::open(folder.path(), &options).unwrap_err().to_string();
        assert!(message.contains("05"), "{message}");
        let json = folder.path().join("transforms.json");
        let text = std::fs::read_to_string(&json).unwrap().replace("\"05\"", "\"./04\"");
        std::fs::write(&json, text).unwrap();
        let message = Dataset::open(folder.path(), &options).unwrap_err().to_string();
        assert!(message.contains("`04`") && message.contains("twice"), "{message}");
    }

    #[test]
    fn cameras_beyond_float32_are_refused() {
        let folder = folder();
        let json = folder.path().join("transforms.json");
        let sound = std::fs::read_to_string(&json).unwrap();
        for (from, to) in [
            ("\"fl_x\":16.0", "\"fl_x\":1e200"),
            ("\"fl_x\":16.0", "\"fl_x\":1e-200"),
            ("0.0,0.0,1.0,0.0", "0.0,0.0,1.0,1e100"),
        ] {
            assert!(sound.contains(from));
            std::fs::write(&json, sound.replace(from, to)).unwrap();
            let message = Dataset::open(folder.path(), &DatasetOptions::default()).unwrap_err().to_string();
            assert!(message.contains("32 bits") && message.contains("00.png"), "{message}");
        }
    }

    #[test]
    fn what_is_no_dataset_says_what_is_expected() {
        let folder = tempfile::tempdir().unwrap();
        let options = DatasetOptions::default();
        let message = Dataset::open(folder.path(), &options).unwrap_err().to_string();
        assert!(message.contains("sparse/0") && message.contains("transforms.json"), "{message}");
        let missing = Dataset::open(folder.path().join("none"), &options).unwrap_err();
        assert_eq!(missing.exit_code(), 2);
        let zero = DatasetOptions { max_size: Some(0), ..options };
        assert!(matches!(Dataset::open(folder.path(), &zero), Err(Error::Usage(_))));
    }

    #[test]
    fn images_in_memory_must_fit_their_camera() {
        let camera = Camera {
            width: 2,
            height: 1,
            fx: 1.0,
            fy: 1.0,
            cx: 1.0,
            cy: 0.5,
            rotation: DMat3::IDENTITY,
            translation: DVec3::ZERO,
        };
        let photo = |rgb: Vec<u8>| Photo {
            name: "a".into(),
            camera,
            split: Split::Train,
            pixels: PixelSource::Memory(Arc::new(Image { width: 2, height: 1, rgb })),
        };
        assert_eq!(photo(vec![7; 6]).load([0.0; 3]).unwrap().rgb, [7; 6]);
        assert!(photo(vec![7; 5]).load([0.0; 3]).is_err());
    }
}
