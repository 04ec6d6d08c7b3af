//! Photographs on the device are what the files hold.

use glint::data::{Dataset, DatasetOptions, Photo};
use glint::pipelines::start::upload_photos;
use image::{Rgba, RgbaImage};

use crate::common::Gpu;
use crate::variants::{KINDS, Plain};

/// Red and blue exchanged once went unnoticed, and cost 4 dB.
#[test]
fn every_channel_of_every_photo_is_where_it_belongs() {
    let gpu = Gpu::new();
    let plain = Plain::new(5, [7, 5], [9.0, 9.0], "sub", 3);
    let folder = tempfile::tempdir().unwrap();
    let (path, options) = KINDS[0].1(&plain, folder.path());
    // The third photo has a mask, which leaves out every other pixel.
    let checks = image::GrayImage::from_fn(7, 5, |x, y| image::Luma([255 * ((x + y) % 2) as u8]));
    let mask = folder.path().join("masks").join(&plain.names[2]);
    std::fs::create_dir_all(mask.parent().unwrap()).unwrap();
    checks.save(mask).unwrap();
    let data = Dataset::open(path, &options).unwrap();
    let photos: Vec<&Photo> = data.photos.iter().collect();
    let mut heard = Vec::new();
    let views = upload_photos(&gpu, &photos, data.background, |done, _| heard.push(done)).unwrap();
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

#[test]
fn transparent_pixels_have_the_background_or_do_not_count() {
    let gpu = Gpu::new();
    let plain = Plain::new(2, [2, 1], [9.0, 9.0], "sub", 3);
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = KINDS[0].1(&plain, folder.path());
    for name in &plain.names {
        let pixels = [Rgba([200, 100, 50, 255]), Rgba([200, 100, 50, 0])];
        RgbaImage::from_fn(2, 1, |x, _| pixels[x as usize]).save(folder.path().join("images").join(name)).unwrap();
    }
    for (alpha, expected) in [(glint::data::Alpha::Background, 0xFF33_66FFu32), (glint::data::Alpha::Mask, 0x0032_64C8)]
    {
        let options = DatasetOptions { alpha, background: [1.0, 0.4, 0.2], ..Default::default() };
        let data = Dataset::open(&path, &options).unwrap();
        let photos: Vec<&Photo> = data.photos.iter().collect();
        let views = upload_photos(&gpu, &photos, data.background, |_, _| ()).unwrap();
        for view in 0..2 {
            assert_eq!(views.download_photograph(view).unwrap(), [0xFF32_64C8, expected]);
        }
    }
}
