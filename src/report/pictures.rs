//! Pictures of a view: photo, render and error map, as pixels and as `data:` addresses.

use base64::{Engine, engine::general_purpose::STANDARD};
use image::{
    RgbImage,
    codecs::{jpeg::JpegEncoder, png::PngEncoder},
    imageops::thumbnail,
};

use super::evaluate::Compared;
use crate::{
    Error, Result,
    data::{Image, srgb::srgb_from_linear, to_byte},
};

/// Error at the bright end of the error maps' colors.
const FULL_ERROR: f32 = 0.25;
/// Longer side of a large picture on a page, pixels.
const SHOWN: u32 = 400;
/// JPEG quality of large pictures, of 100.
const SHOWN_QUALITY: u8 = 85;
/// Maximum side of pictures that are shown unchanged, pixels.
const SMALL: u32 = 256;
/// Gray of pixels that do not count.
const LEFT_OUT: u8 = 128;

/// Photo, render and error map. Masked pixels of the photo and the error map are gray.
pub fn pictures(view: &Compared<'_>) -> [RgbImage; 3] {
    let Image { width, height, rgb, mask } = view.truth;
    let left_out = |i: usize| mask.as_ref().is_some_and(|mask| !mask[i]);
    let grey = |mut bytes: Vec<u8>, share: u16| {
        for (_, pixel) in bytes.chunks_exact_mut(3).enumerate().filter(|(i, _)| left_out(*i)) {
            pixel.iter_mut().for_each(|v| *v = ((u16::from(*v) * (4 - share) + u16::from(LEFT_OUT) * share) / 4) as u8);
        }
        bytes
    };
    let render = &view.whole.color;
    [grey(rgb.clone(), 3), render.iter().map(|&v| to_byte(v)).collect(), grey(error_map(render, rgb), 4)]
        .map(|bytes| RgbImage::from_vec(*width, *height, bytes).unwrap_or_default())
}

/// Absolute error (mean over the channels, clamped to [0, 1]) as a color of a perceptual scale; 0.25 and more is
/// at the bright end. RGB bytes per pixel.
pub fn error_map(image: &[f32], reference: &[u8]) -> Vec<u8> {
    let pixels = image.chunks_exact(3).zip(reference.chunks_exact(3));
    pixels
        .flat_map(|(a, b)| {
            let error: f32 = a.iter().zip(b).map(|(a, b)| (a.clamp(0.0, 1.0) - *b as f32 / 255.0).abs()).sum();
            // NaN counts as the largest error.
            color_of(if error.is_nan() { 1.0 } else { error / (3.0 * FULL_ERROR) })
        })
        .collect()
}

/// Color for t in [0, 1] (clamped): from near black through violet, red and orange to pale yellow.
/// Lightness grows evenly in Oklab (Björn Ottosson, 2020), so that equal steps of the error look equal.
fn color_of(t: f32) -> [u8; 3] {
    let t = t.clamp(0.0, 1.0) as f64;
    let lightness = 0.12 + 0.83 * t;
    // Violet (300°) to yellow (105°), the short way through red (30°).
    let hue = (300.0 + 165.0 * t).to_radians();
    let chroma = 0.15 * (std::f64::consts::PI * (0.12 + 0.76 * t)).sin();
    let (a, b) = (chroma * hue.cos(), chroma * hue.sin());
    let cube = |v: f64| v * v * v;
    let l = cube(lightness + 0.3963377774 * a + 0.2158037573 * b);
    let m = cube(lightness - 0.1055613458 * a - 0.0638541728 * b);
    let s = cube(lightness - 0.0894841775 * a - 1.2914855480 * b);
    let linear = [
        4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
        -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s,
        -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s,
    ];
    linear.map(|v| (srgb_from_linear(v.max(0.0)) * 255.0).round() as u8)
}

/// Picture as a `data:` address for a page: PNG up to 256 pixels a side. Larger ones are downscaled to 400
/// pixels and encoded as JPEG.
///
/// # Errors
/// Errors of the encoders.
pub fn data_of(picture: &RgbImage) -> Result<String> {
    let (width, height) = picture.dimensions();
    let longer = width.max(height);
    let mut bytes = Vec::new();
    let (kind, encoded) = if longer > SMALL {
        let shrink = (f64::from(SHOWN) / f64::from(longer)).min(1.0);
        let side = |side: u32| ((f64::from(side) * shrink).round() as u32).max(1);
        let encoder = JpegEncoder::new_with_quality(&mut bytes, SHOWN_QUALITY);
        ("jpeg", thumbnail(picture, side(width), side(height)).write_with_encoder(encoder))
    } else {
        ("png", picture.write_with_encoder(PngEncoder::new(&mut bytes)))
    };
    encoded.map_err(|error| Error::Usage(format!("a picture of {width} × {height} cannot be encoded: {error}")))?;
    Ok(format!("data:image/{kind};base64,{}", STANDARD.encode(bytes)))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        data::{Photo, PixelSource, Split, srgb::linear_from_srgb},
        pipelines::render::Rendered,
        report::{evaluate::ViewQuality, metrics::Quality},
        scene::Camera,
    };

    fn luminance(c: [u8; 3]) -> f64 {
        let linear = |b: u8| linear_from_srgb(f64::from(b) / 255.0);
        0.2126 * linear(c[0]) + 0.7152 * linear(c[1]) + 0.0722 * linear(c[2])
    }

    #[test]
    fn error_colors_grow_evenly_lighter() {
        let lightness = |t: f32| luminance(color_of(t)).cbrt();
        let steps: Vec<f64> = (0..32).map(|i| lightness((i + 1) as f32 / 32.0) - lightness(i as f32 / 32.0)).collect();
        let mean = steps.iter().sum::<f64>() / 32.0;
        // Rounding to bytes and clipping to the gamut change a step's size, but never its sign.
        assert!(steps.iter().all(|s| *s > 0.3 * mean && *s < 2.0 * mean), "{steps:?}");
        assert_eq!(color_of(f32::INFINITY), color_of(1.0));
    }

    #[test]
    fn error_maps_scale_by_the_full_error() {
        let map = error_map(&[0.0, 0.0, 0.0, 0.375, 0.0, 0.0, f32::NAN, 0.0, 0.0], &[0; 9]);
        assert_eq!(map, [color_of(0.0), color_of(0.5), color_of(1.0)].concat());
    }

    #[test]
    fn pictures_show_what_they_are_called_and_are_grey_where_nothing_counts() {
        let truth = Image { width: 2, height: 1, rgb: vec![0, 100, 200, 10, 20, 30], mask: Some(vec![true, false]) };
        let rendered =
            |color: Vec<f32>| Rendered { width: 2, height: 1, color, transmittance: vec![0.0; 2], depth: Vec::new() };
        let (base, whole) = (rendered(vec![1.0; 6]), rendered(vec![0.5, 2.0, -1.0, 0.5, 0.5, 0.5]));
        let camera = Camera::new(2, 1, 1.0);
        let pixels = PixelSource::Memory(Arc::new(truth.clone()));
        let photo = Photo { name: "a".into(), camera, split: Split::Test, pixels };
        let quality = Quality { psnr: 20.0, ssim: 0.5 };
        let quality = ViewQuality { name: "a".into(), base: quality, augmented: quality };
        let view = Compared { photo: &photo, truth: &truth, base: &base, whole: &whole, quality: &quality };
        let [photo, render, error] = pictures(&view).map(RgbImage::into_raw);
        // A quarter of the original color and three quarters of gray.
        assert_eq!(photo, [0, 100, 200, 98, 101, 103]);
        assert_eq!(render, [128, 255, 0, 128, 128, 128]);
        // Errors of 0.5, 0.61 and 0.78 have a mean above a quarter.
        assert_eq!(error, [color_of(1.0), [128; 3]].concat());
    }

    #[test]
    fn large_pictures_are_downscaled() {
        let data = data_of(&RgbImage::from_pixel(900, 300, image::Rgb([200, 30, 10]))).unwrap();
        let jpeg = data.strip_prefix("data:image/jpeg;base64,").unwrap();
        let small = image::load_from_memory(&STANDARD.decode(jpeg).unwrap()).unwrap().into_rgb8();
        assert_eq!(small.dimensions(), (400, 133));
        // JPEG of a single color: within a step or two.
        assert!(small.get_pixel(50, 50).0.iter().zip([200u8, 30, 10]).all(|(a, b)| a.abs_diff(b) < 4));
    }
}
