//! Prepares a training run: uploads photographs and selects the first points.

use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::{
    photographs::Storage,
    train::HALVED_UNTIL,
    views::{Views, halved, origin_for},
};
use crate::{
    Error, Result,
    data::{Dataset, Image, Photo, PointCloud, Split, load_photos},
    gpu::Context,
    scene::Camera,
    stages::{
        ssim::{partials_len, tiles_for},
        types::Frame,
    },
};

/// Maximum number of random points, same as in 3DGS.
pub const MAX_RANDOM_POINTS: usize = 100_000;
/// Random points per pixel of the largest training photo, below the maximum. Most random Gaussians start in
/// empty space, and their number is fixed. On NeRF Synthetic lego at 64 × 64, four per pixel are 2.4 dB
/// better than one after 5000 steps, at a fourth of the speed; in runs of 20 s they lose 0.7 dB.
pub const RANDOM_POINTS_PER_PIXEL: usize = 4;

/// A run that grows starts with one in this number of the random points; the rest is added at pixels with
/// errors. Fox at 128 pixels has no points of its own. From 9,216 points it grows to 36,864 Gaussians and
/// 32.52 dB in 2,000 steps; starting with that number gives 31.52 dB in 1.5 times the time. Growing to 24,768
/// in 500 steps gives 30.40 dB against 29.49, and in 2,000 steps 32.60 against 32.63 (two seeds).
pub const RANDOM_NTH: usize = 4;

/// Default maximum number of Gaussians, relative to the points at the start.
const GROWTH: usize = 4;
/// Pixels of the training photos for each Gaussian: the first bounds the default number from above, since
/// more would explain noise. The second bounds it from below; it gives NeRF Synthetic at 800 pixels as many
/// as 3DGS has.
const PIXELS_EACH: [u64; 2] = [16, 256];
/// Default maximum number of Gaussians, by the points at the start and the pixels of the training photos.
pub fn default_gaussians(points: usize, pixels: u64) -> usize {
    let least = (pixels / PIXELS_EACH[1]) as usize;
    (GROWTH * points).max(least).min(most_gaussians(pixels).max(points)).min(u32::MAX as usize)
}

/// Number of Gaussians above which they would explain the noise of photos with so many pixels.
pub fn most_gaussians(pixels: u64) -> usize {
    (pixels / PIXELS_EACH[0]) as usize
}

/// [`store_photos`] in device memory.
///
/// # Errors
/// Those of [`store_photos`].
pub fn upload_photos(
    context: &Context,
    photos: &[&Photo],
    background: [f32; 3],
    halvings: u32,
    progress: impl FnMut(usize, &[u32]),
) -> Result<Views> {
    store_photos(context, photos, background, halvings, Storage::Device, false, progress)
}

/// Uploads the cameras of `photos`, and stores their photographs as targets, with copies whose sides are halved
/// up to `halvings` times. A masked pixel has alpha 0. Photographs are decoded a few at a time, so that the host
/// never holds them all. Transparent pixels are blended over `background`; with `transparent`, steps may blend them over another
/// one. `progress` is called after every photo, with the number done so far and its pixels as uploaded.
///
/// # Errors
/// Errors of the files, and [`Error::Usage`] if a photograph is too large for the device.
pub fn store_photos(
    context: &Context,
    photos: &[&Photo],
    background: [f32; 3],
    halvings: u32,
    storage: Storage,
    transparent: bool,
    mut progress: impl FnMut(usize, &[u32]),
) -> Result<Views> {
    if let Some(error) = photos.iter().find_map(|photo| too_large(photo, context.info().max_storage_bytes)) {
        return Err(error);
    }
    let cameras: Vec<Camera> = photos.iter().map(|photo| photo.camera).collect();
    let transparent = (transparent && photos.iter().any(|photo| photo.shows_background())).then_some(background);
    let mut views = Views::halved(context, origin_for(&cameras), &cameras, halvings, storage, transparent)?;
    let (mut done, mut any_counts) = (0, photos.is_empty());
    // Each size is made from the next larger one.
    let sizes = |photo: &Photo, image: Image| {
        let mut sizes = vec![image];
        for halvings in 1..=halvings {
            let Camera { width, height, .. } = halved(&photo.camera, halvings);
            sizes.push(sizes[sizes.len() - 1].reduced([width, height]));
        }
        sizes
    };
    let far = background.map(|value| if value < 0.5 { 1.0 } else { 0.0 });
    let all = |photo: &Photo, image: Image| {
        let (any_counts, sizes_of) = (image.any_counts(), sizes(photo, image));
        let mut packed: Vec<_> = sizes_of.iter().map(Image::packed).collect();
        if transparent.is_some() && photo.shows_background() {
            // A second picture tells the opacity after lens, mask and reduction, without a fourth channel in all of them.
            for ((packed, image), other) in packed.iter_mut().zip(&sizes_of).zip(sizes(photo, photo.load(far)?)) {
                image.put_opacity(packed, (background, far), &other);
            }
        }
        Ok((any_counts, packed))
    };
    let mut any_transparent = false;
    load_photos(photos, background, all, |loaded: Result<_>| {
        let (counts, sizes) = loaded?;
        any_counts |= counts;
        any_transparent |= sizes.iter().flatten().any(|word| (1..255).contains(&(word >> 24)));
        for (packed, view) in sizes.iter().zip((done..).step_by(photos.len())) {
            views.upload_photograph(view, packed)?;
        }
        done += 1;
        sizes.first().into_iter().for_each(|whole| progress(done, whole));
        Ok(())
    })?;
    if !any_counts {
        return Err(Error::Usage(
            "no pixel of the training photos counts: masks or lenses leave out all of them".into(),
        ));
    }
    if !any_transparent {
        views.drop_opacities()?;
    }
    Ok(views)
}

/// Minimum longer side of halved photographs, px. At 62 pixels (LLFF horns) a run lost 0.6 dB against one
/// with the same number of steps on full-size photographs, which took 1.4 times as long. From 128 pixels on
/// no run lost anything.
const LEAST_SIDE: u32 = 128;

/// Number of halvings for a run on these photographs that starts with small ones.
pub fn halvings_for(photos: &[&Photo]) -> u32 {
    let side = photos.iter().map(|photo| photo.camera.width.max(photo.camera.height)).min().unwrap_or(0);
    (0..=HALVED_UNTIL.len() as u32).take_while(|&halvings| side >> halvings >= LEAST_SIDE).last().unwrap_or(0)
}

/// An error with advice for a photo that is too large for a device that binds `limit` bytes at once. The
/// derivatives of the loss take the most bytes per pixel.
fn too_large(photo: &Photo, limit: u64) -> Option<Error> {
    let Camera { width, height, .. } = photo.camera;
    let frame = Frame { image_first: 0, target_first: 0, width, height };
    let bytes = (partials_len(tiles_for(&frame)) * size_of::<[f32; 3]>()) as u64;
    if bytes <= limit {
        return None;
    }
    // A little less, since tiles are whole.
    let fits = (0.95 * (limit as f64 / bytes as f64).sqrt() * f64::from(width.max(height))) as u32;
    let megabytes = |bytes: u64| bytes as f64 / 1e6;
    Some(Error::Usage(format!(
        "the photo {} is {width} × {height}; to learn from it takes {:.0} MB at once, and the device binds {:.0} MB: \
         --max-size {fits} fits",
        photo.name,
        megabytes(bytes),
        megabytes(limit)
    )))
}

/// Points of the first scene.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstPoints {
    /// Positions in scene units, and 8-bit sRGB colors.
    pub cloud: PointCloud,
    /// Number of sparse points in the dataset; `None` if it has none and the points are random.
    pub sparse: Option<usize>,
}

/// The dataset's sparse points, or random ones if there are none.
///
/// With a `limit`, sparse points beyond it are thinned at random, keeping their order, and the number of
/// random points is `limit`. Without one, all sparse points are taken; the number of random points is
/// [`RANDOM_POINTS_PER_PIXEL`] times the pixels of the largest training photo, at most [`MAX_RANDOM_POINTS`].
pub fn first_points(dataset: &Dataset, limit: Option<usize>, seed: u64) -> FirstPoints {
    match &dataset.points {
        Some(cloud) => {
            let n = cloud.positions.len();
            let cloud = match limit {
                Some(limit) if limit < n => {
                    let mut order: Vec<usize> = (0..n).collect();
                    let (chosen, _) = order.partial_shuffle(&mut ChaCha8Rng::seed_from_u64(seed), limit);
                    chosen.sort_unstable();
                    PointCloud {
                        positions: chosen.iter().map(|&i| cloud.positions[i]).collect(),
                        colors: chosen.iter().map(|&i| cloud.colors[i]).collect(),
                    }
                }
                _ => cloud.clone(),
            };
            FirstPoints { cloud, sparse: Some(n) }
        }
        None => {
            let pixels = dataset.split(Split::Train).map(|(_, photo)| photo.camera.pixels() as usize).max();
            let n = limit.unwrap_or((RANDOM_POINTS_PER_PIXEL * pixels.unwrap_or(0)).min(MAX_RANDOM_POINTS));
            FirstPoints { cloud: dataset.random_points(n, seed), sparse: None }
        }
    }
}

/// The photos of a split; all photos for `None`.
///
/// # Errors
/// [`Error::Usage`] if there are none.
pub fn photos_of(dataset: &Dataset, split: Option<Split>) -> Result<Vec<&Photo>> {
    let photos: Vec<&Photo> =
        dataset.photos.iter().filter(|photo| split.is_none_or(|split| photo.split == split)).collect();
    if photos.is_empty() {
        let name = match split {
            Some(Split::Train) => "the training split",
            Some(Split::Test) => "the test split",
            None => "the dataset",
        };
        return Err(Error::Usage(format!("{name} has no photos ({} in all)", dataset.photos.len())));
    }
    Ok(photos)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;

    use super::*;
    use crate::data::{Image, PixelSource};

    fn dataset(points: Option<usize>) -> Dataset {
        let photo = |name: &str, split, width| Photo {
            name: name.into(),
            camera: Camera { cx: 2.0, translation: DVec3::Z, ..Camera::new(width, 4, 5.0) },
            split,
            pixels: PixelSource::Memory(Arc::new(Image {
                width,
                height: 4,
                rgb: vec![0; 12 * width as usize],
                mask: None,
            })),
        };
        Dataset {
            photos: vec![photo("a", Split::Test, 9), photo("b", Split::Train, 5), photo("c", Split::Train, 6)],
            points: points.map(|n| PointCloud {
                positions: (0..n).map(|i| [i as f64; 3]).collect(),
                colors: (0..n).map(|i| [i as u8; 3]).collect(),
            }),
            ..Dataset::default()
        }
    }

    /// The error used to be "buffer targets needs 168820736 bytes".
    #[test]
    fn a_photo_that_does_not_fit_is_told_what_would() {
        let mut photo = dataset(None).photos.swap_remove(0);
        let limit = 128 << 20;
        (photo.camera.width, photo.camera.height) = (4000, 3000);
        let message = too_large(&photo, limit).unwrap().to_string();
        assert!(message.contains(&photo.name) && message.contains("4000 × 3000"), "{message}");
        let fits: u32 = message.split("--max-size ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        (photo.camera.width, photo.camera.height) = (fits, fits * 3 / 4);
        assert!(too_large(&photo, limit).is_none() && fits > 1900, "{fits}");
    }

    #[test]
    fn sparse_points_are_all_taken_or_thinned_in_their_order() {
        let data = dataset(Some(50));
        assert_eq!(first_points(&data, None, 0).cloud, data.points.clone().unwrap());
        assert_eq!(first_points(&data, Some(1000), 0).cloud.positions.len(), 50);
        let few = first_points(&data, Some(10), 7);
        assert_eq!((few.cloud.positions.len(), few.sparse), (10, Some(50)));
        assert!(few.cloud.positions.is_sorted_by(|a, b| a[0] < b[0]));
        assert!(few.cloud.positions.iter().zip(&few.cloud.colors).all(|(p, c)| p[0] == f64::from(c[0])));
        assert_eq!(few, first_points(&data, Some(10), 7));
        assert_ne!(few, first_points(&data, Some(10), 8));
    }

    #[test]
    fn random_points_follow_the_pixels_of_the_largest_training_photo() {
        let data = dataset(None);
        assert_eq!(first_points(&data, None, 0).cloud.positions.len(), 4 * 24);
        assert_eq!(first_points(&data, Some(7), 0).cloud.positions.len(), 7);
        assert_eq!(first_points(&data, Some(7), 0).sparse, None);
    }

    #[test]
    fn an_empty_split_is_an_error_that_names_it() {
        let mut data = dataset(None);
        assert_eq!(photos_of(&data, Some(Split::Train)).unwrap().len(), 2);
        assert_eq!(photos_of(&data, None).unwrap().len(), 3);
        data.photos.retain(|photo| photo.split == Split::Train);
        assert!(photos_of(&data, Some(Split::Test)).unwrap_err().to_string().contains("test split has no photos (2"));
    }

    #[test]
    fn a_scene_may_grow_by_its_points_and_pixels() {
        // fox, horns and garden at 128 pixels; lego at 800; garden at full size.
        assert_eq!(default_gaussians(9216, 396_288), 24_768);
        assert_eq!(default_gaussians(5413, 663_552), 21_652);
        assert_eq!(default_gaussians(30_000, 2_637_824), 120_000);
        assert_eq!(default_gaussians(25_000, 64_000_000), 250_000);
        assert_eq!(default_gaussians(138_766, 175_000_000), 683_593);
        // The initial points are never reduced, even if they outnumber the pixels.
        assert_eq!([default_gaussians(300, 100), default_gaussians(0, 16)], [300, 0]);
    }
}
