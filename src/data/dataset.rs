//! Photos with their cameras: read from COLMAP or transforms.json datasets, or made in memory.

use std::path::Path;

use rayon::prelude::*;

use super::formats::Kind;
use super::images;
use super::photo::{Dataset, DatasetKind, DatasetOptions, Holdout, Image, ImageFile, Photo, PixelSource};
use super::{advice, assemble, colmap, folders, reduced, transforms};
use crate::{Error, Result};

/// Maximum memory of photos that are decoded at the same time, bytes. A single photo is decoded regardless of
/// its size.
const DECODING: u64 = 1 << 30;

impl Dataset {
    /// Reads a dataset's description: cameras, names, sizes and points, but no pixels. `path` is a folder
    /// with images and a COLMAP model (in sparse/0, sparse, the folder itself or another usual place). It may
    /// also be a folder with transforms_train.json or transforms.json, or such a file.
    pub fn open(path: impl AsRef<Path>, options: &DatasetOptions) -> Result<Dataset> {
        let path = path.as_ref();
        if options.max_size == Some(0) {
            return Err(Error::Usage("the largest image size must be at least 1 pixel".into()));
        }
        if !options.background.iter().all(|v| (0.0..=1.0).contains(v)) {
            return Err(Error::Usage(format!("the background {:?} is not in 0 to 1", options.background)));
        }
        if options.holdout == Holdout::Every(0) {
            return Err(Error::Usage("every 0th photo cannot be for testing; expected 1 or more".into()));
        }
        let found = std::fs::metadata(path).map_err(|source| Error::io(path, source))?;
        let full = Dataset::read(path, found.is_dir(), options)?;
        if !options.reduced_folders || options.images.is_some() {
            return Ok(full);
        }
        let root = if found.is_dir() { path } else { path.parent().unwrap_or(Path::new("")) };
        // Photos in reduced folders stay as they are: a pixel too large, another downscale would only blur
        // them.
        let open = |folder: &Path| {
            let options = DatasetOptions { images: Some(folder.to_owned()), max_size: None, ..options.clone() };
            Dataset::read(path, found.is_dir(), &options)
        };
        Ok(reduced::instead(&full, root, open).unwrap_or(full))
    }

    fn read(path: &Path, is_folder: bool, options: &DatasetOptions) -> Result<Dataset> {
        if is_folder {
            let near = folders::find_model(path, options)?;
            let file = transforms::find(path);
            // A model in its own folder is often the source of a transforms.json, which then has priority.
            if let Some(model) = near.filter(|model| !model.aside || file.is_none()) {
                let mut read = colmap::read(path, &model, options)?;
                if let Some(file) = file {
                    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
                    read.notes.push(format!("the COLMAP model is read; {name} beside it is not"));
                }
                return assemble::assemble(DatasetKind::Colmap, read, options);
            }
            if let Some(file) = file {
                return assemble::assemble(DatasetKind::Transforms, transforms::read(&file, false, options)?, options);
            }
            return Err(Error::input(path, advice::of_folder(path)));
        }
        match Kind::of_file(path)? {
            Kind::Json => assemble::assemble(DatasetKind::Transforms, transforms::read(path, true, options)?, options),
            other => Err(Error::input(path, advice::of_file(other))),
        }
    }

    /// Decodes and prepares all photos, in order.
    pub fn load_images(&self) -> Result<Vec<Image>> {
        let photos: Vec<&Photo> = self.photos.iter().collect();
        let mut images = Vec::with_capacity(photos.len());
        load_photos(
            &photos,
            self.background,
            |_, image| image,
            |image| {
                images.push(image);
                Ok(())
            },
        )?;
        Ok(images)
    }
}

impl Photo {
    /// Decodes and prepares the image, at the camera's size.
    pub fn load(&self, background: [f32; 3]) -> Result<Image> {
        let size = [self.camera.width, self.camera.height];
        match &self.pixels {
            PixelSource::File(file) => images::load(file, size, background),
            PixelSource::Memory(image) => {
                let pixels = size[0] as usize * size[1] as usize;
                let masked = image.mask.as_ref().is_none_or(|mask| mask.len() == pixels);
                if [image.width, image.height] != size || image.rgb.len() != 3 * pixels || !masked {
                    return Err(Error::Usage(format!(
                        "photo `{}`: its image has another size than its camera",
                        self.name
                    )));
                }
                Ok(Image::clone(image))
            }
        }
    }

    /// The true `part` of the photo's light, [`DIFFUSE`](super::DIFFUSE) or [`SPECULAR`](super::SPECULAR), prepared like the photo;
    /// `None` if there is no such file.
    ///
    /// # Errors
    /// If the file is not an image, or has another size than the photo.
    pub fn part(&self, part: &str) -> Result<Option<Photo>> {
        let PixelSource::File(file) = &self.pixels else { return Ok(None) };
        let folder = file.path.parent().and_then(Path::parent);
        let path = folder.zip(file.path.file_name()).map(|(folder, name)| folder.join(part).join(name));
        let Some(path) = path.filter(|path| path.is_file()) else { return Ok(None) };
        let images::Header { size, bytes_per_pixel, has_alpha, .. } = images::open(&path)?;
        let size = images::upright(size, file.orientation);
        if size != file.size {
            let ([w, h], [ew, eh]) = (size, file.size);
            return Err(Error::input(path, format!("is {w} × {h}, but its photo is {ew} × {eh}")));
        }
        let pixels =
            PixelSource::File(Box::new(ImageFile { path, bytes_per_pixel, has_alpha, ..ImageFile::clone(file) }));
        Ok(Some(Photo { pixels, ..self.clone() }))
    }

    /// Maximum bytes of memory of [`Photo::load`], not counting the file's own.
    pub fn bytes_to_load(&self) -> u64 {
        match &self.pixels {
            PixelSource::File(file) => images::bytes_to_load(file, [self.camera.width, self.camera.height]),
            PixelSource::Memory(_) => 4 * u64::from(self.camera.pixels()),
        }
    }
}

/// Decodes and prepares `photos`, passes each to `make`, and passes the results to `take` in order. Runs on
/// all threads, within a limit of 1 GiB.
pub fn load_photos<T: Send>(
    photos: &[&Photo],
    background: [f32; 3],
    make: impl Fn(&Photo, Image) -> T + Sync,
    mut take: impl FnMut(T) -> Result<()>,
) -> Result<()> {
    let mut left = photos;
    while !left.is_empty() {
        let (some, rest) = left.split_at(at_once(left.iter().map(|photo| photo.bytes_to_load())));
        left = rest;
        // Collected first, so that the error names the first of several faulty photos.
        let load = |photo: &&Photo| photo.load(background).map(|image| make(photo, image));
        let made: Vec<Result<T>> = some.par_iter().map(load).collect();
        made.into_iter().try_for_each(|made| take(made?))?;
    }
    Ok(())
}

/// Number of next photos to decode at once, from the bytes that each takes.
fn at_once(bytes: impl Iterator<Item = u64>) -> usize {
    let sums = bytes.scan(0u64, |sum, bytes| {
        *sum = sum.saturating_add(bytes);
        Some(*sum)
    });
    sums.take(rayon::current_num_threads()).take_while(|&sum| sum <= DECODING).count().max(1)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::{photo::Split, reduce::Reduce};
    use super::*;
    use crate::scene::Camera;

    /// 17 photos of 8 × 6: the left half is red and opaque, the right half green and transparent.
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
        let options = DatasetOptions { max_size: Some(4), background: [0.0, 0.0, 1.0], ..Default::default() };
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
            assert_eq!(image, Image { width: 4, height: 3, rgb: row.repeat(3), mask: None });
        }
        // The cubic's taps by hand, without those beyond the edge: red of the second is 0.9453125 /
        // 1.01171875.
        let data = Dataset::open(folder.path(), &DatasetOptions { reduce: Reduce::Bicubic, ..options }).unwrap();
        let row = [[255, 0, 0], [238, 0, 17], [17, 0, 238], [0, 0, 255]].concat();
        assert_eq!(data.load_images().unwrap()[16].rgb, row.repeat(3));
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
        let notes = Dataset::open(folder.path(), &options).unwrap().notes;
        assert!(notes[0].contains("1 photo of 17 left out") && notes[0].contains("`05`"), "{notes:?}");
        let json = folder.path().join("transforms.json");
        let text = std::fs::read_to_string(&json).unwrap();
        std::fs::write(&json, text.replace("\"05\"", "\"./04\"")).unwrap();
        let message = Dataset::open(folder.path(), &options).unwrap_err().to_string();
        assert!(message.contains("`04`") && message.contains("twice"), "{message}");
        // Errors of the system are passed on: this name exceeds the maximum length.
        std::fs::write(&json, text.replace("\"05\"", &format!("\"{}\"", "5".repeat(300)))).unwrap();
        let notes = Dataset::open(folder.path(), &options).unwrap().notes;
        assert!(notes[0].contains("cannot be looked at"), "{notes:?}");
        // No photo is left.
        std::fs::write(&json, text).unwrap();
        (0..17).for_each(|i| drop(std::fs::remove_file(folder.path().join(format!("{i:02}.png")))));
        let message = Dataset::open(folder.path(), &options).unwrap_err().to_string();
        assert!(message.contains("`00`") && message.contains("(and 16 more: `01`, `02`, `03`, …)"), "{message}");
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
    fn as_many_photos_are_decoded_at_once_as_memory_allows() {
        let threads = rayon::current_num_threads();
        let count = |bytes: &[u64]| at_once(bytes.iter().copied());
        assert_eq!(count(&[DECODING / 2, DECODING / 2, 1]), threads.min(2));
        assert_eq!(count(&[DECODING / 2, DECODING / 2 + 1]), 1);
        assert_eq!(count(&[u64::MAX, u64::MAX]), 1);
        assert_eq!(count(&vec![1; 1000]), threads.min(1000));
    }

    #[test]
    fn the_split_is_as_it_is_asked_for() {
        let folder = folder();
        let tests = |holdout| {
            let options = DatasetOptions { holdout, ..Default::default() };
            let data = Dataset::open(folder.path(), &options)?;
            Ok::<_, Error>(data.split(Split::Test).map(|(_, photo)| photo.name.clone()).collect::<Vec<_>>().join(" "))
        };
        assert_eq!(tests(Holdout::Dataset).unwrap(), "00 08 16");
        assert!(tests(Holdout::Every(0)).is_err());
        let tune = DatasetOptions { tune: true, ..Default::default() };
        let data = Dataset::open(folder.path(), &tune).unwrap();
        let names = |split| data.split(split).map(|(_, photo)| &photo.name[..]).collect::<Vec<_>>().join(" ");
        assert_eq!(names(Split::Test), "01 10");
        assert!(!names(Split::Train).contains("08") && names(Split::Train).starts_with("02 03"));
        // A missing photo does not move others to another split.
        std::fs::remove_file(folder.path().join("03.png")).unwrap();
        assert_eq!(tests(Holdout::Dataset).unwrap(), "00 08 16");
    }

    #[test]
    fn images_in_memory_must_fit_their_camera() {
        let camera = Camera::new(2, 1, 1.0);
        let photo = |rgb: Vec<u8>, mask| Photo {
            name: "a".into(),
            camera,
            split: Split::Train,
            pixels: PixelSource::Memory(Arc::new(Image { width: 2, height: 1, rgb, mask })),
        };
        assert_eq!(photo(vec![7; 6], Some(vec![true, false])).load([0.0; 3]).unwrap().rgb, [7; 6]);
        assert!(photo(vec![7; 5], None).load([0.0; 3]).is_err());
        assert!(photo(vec![7; 6], Some(vec![true])).load([0.0; 3]).is_err());
    }
}
