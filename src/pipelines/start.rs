//! What a training run starts from: photographs on the device and a first scene.

use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

use super::views::{Views, origin_for};
use crate::{
    Error, Result,
    data::{Dataset, Photo, PointCloud, Split, load_photos},
    gpu::{Buffer, Context, Location},
    scene::Camera,
};

/// Random points at most: 3DGS's number.
pub const MAX_RANDOM_POINTS: usize = 100_000;
/// Random points for each pixel of the largest training photo, where that is less. Gaussians are fixed in number and most
/// random ones begin in empty space. NeRF Synthetic lego at 64 × 64: after 5000 steps four for each pixel are 2.4 dB better
/// than one, at a fourth of the speed; in runs of 20 s they lose 0.7 dB to one for each pixel.
pub const RANDOM_POINTS_PER_PIXEL: usize = 4;

/// Cameras of `photos`, and their photographs as targets; a pixel that does not count has alpha 0. Photographs are decoded a
/// few at a time, so that the host never holds them all. `background` is what transparent pixels are put over; `progress`
/// hears of every photo that is done: how many are, and its pixels as the device has them.
///
/// # Errors
/// Those of the files, and [`Error::Usage`] where all photographs do not fit into one buffer of the device.
pub fn upload_photos(
    context: &Context,
    photos: &[&Photo],
    background: [f32; 3],
    mut progress: impl FnMut(usize, &[u32]),
) -> Result<Views> {
    // 4 bytes for each pixel. Checked before cameras are numbered: positions of pixels are 32 bits.
    let pixels: u64 = photos.iter().map(|p| u64::from(p.camera.width) * u64::from(p.camera.height)).sum();
    let limit = context.info().max_storage_bytes.min(4 * u64::from(u32::MAX));
    if 4 * pixels > limit {
        return Err(too_many(photos, pixels, limit));
    }
    let cameras: Vec<Camera> = photos.iter().map(|photo| photo.camera).collect();
    let mut views = Views::upload_around(context, origin_for(&cameras), &cameras, &[])?;
    views.targets = Buffer::new(context, "targets", pixels as usize, Location::Device)?;
    let (mut first, mut done) = (0, 0);
    load_photos(photos, background, |image| {
        let packed = image.packed();
        views.targets.upload(first, &packed)?;
        first += packed.len();
        done += 1;
        progress(done, &packed);
        Ok(())
    })?;
    Ok(views)
}

/// What to do about photographs of so many pixels, on a device that binds `limit` bytes at once.
fn too_many(photos: &[&Photo], pixels: u64, limit: u64) -> Error {
    let longest = photos.iter().map(|photo| photo.camera.width.max(photo.camera.height)).max().unwrap_or(0);
    let shrink = (limit as f64 / (4 * pixels) as f64).sqrt();
    // A little less, since sides are rounded.
    let fits = (0.99 * shrink * f64::from(longest)) as u32;
    let megabytes = |bytes: u64| bytes as f64 / 1e6;
    Error::Usage(format!(
        "{} photos of up to {longest} pixels a side take {:.0} MB on the device, which binds {:.0} MB at once: --max-size {fits} \
         fits, or leave photos out",
        photos.len(),
        megabytes(4 * pixels),
        megabytes(limit)
    ))
}

/// Points that a first scene is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct FirstPoints {
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
                positions: (0..n).map(|i| [i as f32; 3]).collect(),
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
    fn photos_that_do_not_fit_are_told_what_would() {
        let data = dataset(None);
        let photos: Vec<&Photo> = data.photos.iter().collect();
        // 36 + 20 + 24 pixels are 320 bytes; half of that is what sides of 9 / √2 take.
        let message = too_many(&photos, 80, 160).to_string();
        assert!(message.contains("3 photos of up to 9 pixels") && message.contains("--max-size 6 fits"), "{message}");
    }

    #[test]
    fn sparse_points_are_all_taken_or_thinned_in_their_order() {
        let data = dataset(Some(50));
        assert_eq!(first_points(&data, None, 0).cloud, data.points.clone().unwrap());
        assert_eq!(first_points(&data, Some(1000), 0).cloud.positions.len(), 50);
        let few = first_points(&data, Some(10), 7);
        assert_eq!((few.cloud.positions.len(), few.sparse), (10, Some(50)));
        assert!(few.cloud.positions.is_sorted_by(|a, b| a[0] < b[0]));
        assert!(few.cloud.positions.iter().zip(&few.cloud.colors).all(|(p, c)| p[0] == f32::from(c[0])));
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
