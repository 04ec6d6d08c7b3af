//! What a training run starts from: photographs on the device and a first scene.

use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::{
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

/// Random points at most: 3DGS's number.
pub const MAX_RANDOM_POINTS: usize = 100_000;
/// Random points for each pixel of the largest training photo, where that is less. Gaussians are fixed in number and most
/// random ones begin in empty space. NeRF Synthetic lego at 64 × 64: after 5000 steps four for each pixel are 2.4 dB better
/// than one, at a fourth of the speed; in runs of 20 s they lose 0.7 dB to one for each pixel.
pub const RANDOM_POINTS_PER_PIXEL: usize = 4;

/// A run whose number grows begins with one in so many of these: the rest comes to where errors are. Of fox at 128 pixels, which has none of
/// its own, 9,216 points come to 36,864 Gaussians and 32.52 dB in 2,000 steps, as many points make 31.52 in 1.5 times the time; to 24,768 in
/// 500 steps 30.40 dB beside 29.49, and in 2,000 steps 32.60 beside 32.63 (two seeds).
pub const RANDOM_NTH: usize = 4;

/// Cameras of `photos`, and their photographs as targets, with smaller ones beside them whose sides are halved up to `halvings` times; a pixel that does not count has alpha 0. Photographs are decoded a
/// few at a time, so that the host never holds them all. `background` is what transparent pixels are put over; `progress`
/// is called for every photo, with the number done so far and its pixels as the device has them.
///
/// # Errors
/// Those of the files, and [`Error::Usage`] where a photograph is more than the device can learn from at once.
pub fn upload_photos(
    context: &Context,
    photos: &[&Photo],
    background: [f32; 3],
    halvings: u32,
    mut progress: impl FnMut(usize, &[u32]),
) -> Result<Views> {
    if let Some(error) = photos.iter().find_map(|photo| too_large(photo, context.info().max_storage_bytes)) {
        return Err(error);
    }
    let cameras: Vec<Camera> = photos.iter().map(|photo| photo.camera).collect();
    let views = Views::halved(context, origin_for(&cameras), &cameras, halvings)?;
    let (mut done, mut any_counts) = (0, photos.is_empty());
    // Each is made of the one twice as large.
    let sizes = |photo: &Photo, image: Image| {
        let (mut image, mut sizes) = (image, Vec::with_capacity(1 + halvings as usize));
        let any_counts = image.any_counts();
        for halvings in 1..=halvings {
            let Camera { width, height, .. } = halved(&photo.camera, halvings);
            let smaller = image.reduced([width, height]);
            sizes.push(std::mem::replace(&mut image, smaller).packed());
        }
        sizes.push(image.packed());
        (any_counts, sizes)
    };
    load_photos(photos, background, sizes, |(counts, sizes)| {
        any_counts |= counts;
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
    Ok(views)
}

/// Pixels of the longer side that photographs with halved sides keep. At 62 pixels (LLFF horns) a run lost 0.6 dB to one of as many steps on
/// photographs in full, which took 1.4 times as long; from 128 pixels on none lost anything.
const LEAST_SIDE: u32 = 128;

/// How often the sides of these photographs are halved in a run that begins with small ones.
pub fn halvings_for(photos: &[&Photo]) -> u32 {
    let side = photos.iter().map(|photo| photo.camera.width.max(photo.camera.height)).min().unwrap_or(0);
    (0..=HALVED_UNTIL.len() as u32).take_while(|&halvings| side >> halvings >= LEAST_SIDE).last().unwrap_or(0)
}

/// What to do about a photo that cannot be learned from on a device that binds `limit` bytes at once. Of all that a pixel takes
/// the derivatives of its loss are the most.
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

/// Points that a first scene is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstPoints {
    /// Scene units and 8-bit sRGB.
    pub cloud: PointCloud,
    /// The dataset's own number of sparse points; `None` where it has none and the points are random.
    pub sparse: Option<usize>,
}

/// The dataset's sparse points, else random ones.
///
/// With a `limit`, more sparse points than that are thinned to a random selection in their order, and random points are that
/// many. Without one all sparse points are taken, and [`RANDOM_POINTS_PER_PIXEL`] times as many random ones as the largest
/// training photo has pixels, at most [`MAX_RANDOM_POINTS`].
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

/// The photos of a split, all for `None`.
///
/// # Errors
/// [`Error::Usage`] where there is none.
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

    use glam::{DMat3, DVec3};

    use super::*;
    use crate::data::{DatasetKind, Image, PixelSource};

    fn dataset(points: Option<usize>) -> Dataset {
        let photo = |name: &str, split, width| Photo {
            name: name.into(),
            camera: Camera {
                width,
                height: 4,
                fx: 5.0,
                fy: 5.0,
                cx: 2.0,
                cy: 2.0,
                rotation: DMat3::IDENTITY,
                translation: DVec3::Z,
            },
            split,
            pixels: PixelSource::Memory(Arc::new(Image {
                width,
                height: 4,
                rgb: vec![0; 12 * width as usize],
                mask: None,
            })),
        };
        Dataset {
            kind: DatasetKind::Memory,
            photos: vec![photo("a", Split::Test, 9), photo("b", Split::Train, 5), photo("c", Split::Train, 6)],
            points: points.map(|n| PointCloud {
                positions: (0..n).map(|i| [i as f64; 3]).collect(),
                colors: (0..n).map(|i| [i as u8; 3]).collect(),
            }),
            background: [0.0; 3],
            undistorted: false,
            outside: 0.0,
            sources: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// It was "buffer targets needs 168820736 bytes".
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
}
