//! Photographs on the device equal the files' contents.

use glint::data::{Dataset, Photo};
use glint::pipelines::start::upload_photos;

use crate::common::Gpu;
use crate::variants::{KINDS, Plain};

/// A regression test: swapped red and blue went unnoticed, and cost 4 dB.
#[test]
fn every_channel_of_every_photo_is_where_it_belongs() {
    let gpu = Gpu::new();
    let plain = Plain::new(5, [7, 5], [9.0, 9.0], "sub", 3);
    let folder = tempfile::tempdir().unwrap();
    let (path, options) = KINDS[0].1(&plain, folder.path());
    // The third photo has a mask that hides every other pixel.
    let checks = image::GrayImage::from_fn(7, 5, |x, y| image::Luma([255 * ((x + y) % 2) as u8]));
    let mask = folder.path().join("masks").join(&plain.names[2]);
    std::fs::create_dir_all(mask.parent().unwrap()).unwrap();
    checks.save(mask).unwrap();
    let data = Dataset::open(path, &options).unwrap();
    let photos: Vec<&Photo> = data.photos.iter().collect();
    let mut heard = Vec::new();
    let views = upload_photos(&gpu, &photos, data.background, 0, |done, _| heard.push(done)).unwrap();
    assert_eq!(heard, [1, 2, 3, 4, 5]);
    for (i, photo) in plain.photos.iter().enumerate() {
        let words = views.download_photograph(i).unwrap();
        for (j, pixel) in photo.pixels().enumerate() {
            let word = words[j];
            // Red in the low byte, alpha in the high one.
            let [red, green, blue] = pixel.0.map(u32::from);
            assert_eq!(word & 0x00FF_FFFF, red | green << 8 | blue << 16, "pixel {j} of photo {i}");
            let counts = i != 2 || (j % 7 + j / 7) % 2 == 1;
            assert_eq!(word >> 24, if counts { 255 } else { 0 }, "pixel {j} of photo {i}");
        }
    }
}

/// Small photos follow the full-size ones; each is made from the one twice as large, with a camera of
/// matching size.
#[test]
fn photos_with_halved_sides_are_means_of_their_pixels() {
    let gpu = Gpu::new();
    let plain = Plain::new(3, [12, 6], [9.0, 9.0], "sub", 3);
    let folder = tempfile::tempdir().unwrap();
    let (path, options) = KINDS[0].1(&plain, folder.path());
    // The second photo has a masked pixel, and so have its smaller versions.
    let mask = folder.path().join("masks").join(&plain.names[1]);
    std::fs::create_dir_all(mask.parent().unwrap()).unwrap();
    image::GrayImage::from_fn(12, 6, |x, y| image::Luma([255 * u8::from((x, y) != (7, 2))])).save(mask).unwrap();
    let data = Dataset::open(path, &options).unwrap();
    let photos: Vec<&Photo> = data.photos.iter().collect();
    let mut heard = 0;
    let views = upload_photos(&gpu, &photos, data.background, 2, |_, words| heard += words.len()).unwrap();
    assert_eq!((views.photos, views.halvings(), views.cameras.len(), heard), (3, 2, 9, 3 * 72));
    for photo in 0..3 {
        // 12 × 6, 6 × 3 and 3 × 2; the rows of the last are made of one and a half rows each.
        for (k, [width, height]) in [(1usize, [6u32, 3u32]), (2, [3, 2])] {
            let (view, before) = (photo + 3 * k, photo + 3 * (k - 1));
            let (camera, whole) = (views.cameras[view], views.cameras[photo]);
            assert_eq!([camera.width, camera.height], [width, height]);
            assert_eq!(
                [camera.fx, camera.cy],
                [whole.fx * f64::from(width) / 12.0, whole.cy * f64::from(height) / 6.0]
            );
            let (from, rows) = (views.download_photograph(before).unwrap(), f64::from(views.cameras[before].height));
            for (at, word) in views.download_photograph(view).unwrap().into_iter().enumerate() {
                let (x, y) = (at as u32 % width, f64::from(at as u32 / width));
                let (mut sum, mut counts) = ([0.0; 3], true);
                for (i, other) in from.iter().enumerate() {
                    let (column, row) = (i as u32 % (2 * width), f64::from(i as u32 / (2 * width)));
                    let step = rows / f64::from(height);
                    let share = ((row + 1.0).min((y + 1.0) * step) - row.max(y * step)).max(0.0) / step / 2.0;
                    if column / 2 == x && share > 0.0 {
                        let bytes = other.to_le_bytes();
                        (0..3).for_each(|c| sum[c] += share * f64::from(bytes[c]));
                        counts &= bytes[3] == 255;
                    }
                }
                let bytes = word.to_le_bytes();
                // Rounded, from float32 sums.
                assert!((0..3).all(|c| (f64::from(bytes[c]) - sum[c]).abs() < 0.501), "photo {photo}, {k}, {at}");
                assert_eq!(bytes[3] == 255, counts, "photo {photo}, {k}, {at}");
            }
        }
    }
}
