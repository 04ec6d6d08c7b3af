//! PSNR and SSIM in f64, of renders before quantization against 8-bit photos.
//!
//! Images hold sRGB values, interleaved `[height · width · 3]`, rows from the top. Renders are clamped to
//! [0, 1] here; photos are bytes, value / 255. Masked pixels count in no mean. In SSIM windows that reach
//! over them, the render equals the photo there, as in the loss.

use rayon::prelude::*;
use serde::Serialize;

use crate::{Error, Result};

/// Window of SSIM (Wang et al. 2004), as in 3DGS: 11 × 11, Gaussian of σ = 1.5 pixels, zeros beyond the
/// border.
const WINDOW: usize = 11;
const SIGMA: f64 = 1.5;
/// (K₁ · range)² and (K₂ · range)² with K₁ = 0.01, K₂ = 0.03 and values in [0, 1].
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Render and the photo to compare it with.
#[derive(Debug, Clone, Copy)]
pub struct Pair<'a> {
    /// Render: sRGB values, RGB interleaved; clamped to between 0 and 1.
    pub image: &'a [f32],
    /// Photo: 8-bit sRGB values, RGB interleaved.
    pub reference: &'a [u8],
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Whether each pixel counts; all do if there is no mask.
    pub mask: Option<&'a [bool]>,
}

/// Quality of a render against its photo.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quality {
    /// Peak signal-to-noise ratio, dB; infinite for identical images (`null` in JSON, which has no
    /// infinity).
    pub psnr: f64,
    /// Structural similarity, in [−1, 1]; 1 for identical images. Mean over pixels and channels.
    pub ssim: f64,
}

impl Quality {
    /// Mean over views, also of the decibels, as is usual in the literature; infinite if any view is,
    /// `None` without views.
    pub fn mean(views: &[Quality]) -> Option<Quality> {
        let n = views.len() as f64;
        (!views.is_empty()).then(|| Quality {
            psnr: views.iter().map(|q| q.psnr).sum::<f64>() / n,
            ssim: views.iter().map(|q| q.ssim).sum::<f64>() / n,
        })
    }
}

/// Both metrics of every pair, in order. Pairs are spread over the cores.
pub fn qualities(pairs: &[Pair]) -> Result<Vec<Quality>> {
    pairs.par_iter().map(|p| Ok(Quality { psnr: psnr(p)?, ssim: ssim(p)? })).collect()
}

/// Peak signal-to-noise ratio in dB, 10 log₁₀(1 / mean squared error over pixels and channels); infinite
/// for equal images.
pub fn psnr(pair: &Pair) -> Result<f64> {
    let counted = pair.check()?;
    let square = |i: usize| (value(pair.image[i]) - pair.reference[i] as f64 / 255.0).powi(2);
    let error = (0..pair.image.len()).filter(|i| pair.counts(i / 3)).map(square).sum::<f64>() / (3 * counted) as f64;
    Ok(10.0 * error.recip().log10())
}

/// Mean structural similarity over pixels and channels.
pub fn ssim(pair: &Pair) -> Result<f64> {
    let counted = pair.check()?;
    let (width, height) = (pair.width as usize, pair.height as usize);
    let weights = weights();
    let of_channel = |channel: usize| {
        let y: Vec<f64> = pair.reference[channel..].iter().step_by(3).map(|v| *v as f64 / 255.0).collect();
        let image = pair.image[channel..].iter().step_by(3).enumerate();
        let x: Vec<f64> = image.map(|(i, &v)| if pair.counts(i) { value(v) } else { y[i] }).collect();
        let blurred = |f: fn(f64, f64) -> f64| {
            let product: Vec<f64> = x.iter().zip(&y).map(|(x, y)| f(*x, *y)).collect();
            blur(&product, width, height, &weights)
        };
        let (mx, my) = (blurred(|x, _| x), blurred(|_, y| y));
        let (xx, yy, xy) = (blurred(|x, _| x * x), blurred(|_, y| y * y), blurred(|x, y| x * y));
        let of = |i: usize| similarity(mx[i], my[i], xx[i], yy[i], xy[i]);
        (0..width * height).filter(|&i| pair.counts(i)).map(of).sum::<f64>()
    };
    let sums: Vec<f64> = (0..3).into_par_iter().map(of_channel).collect();
    Ok(sums.iter().sum::<f64>() / (3 * counted) as f64)
}

/// SSIM from the windowed means of x, y, x², y², xy.
fn similarity(mx: f64, my: f64, xx: f64, yy: f64, xy: f64) -> f64 {
    let (vx, vy, cov) = (xx - mx * mx, yy - my * my, xy - mx * my);
    (2.0 * mx * my + C1) * (2.0 * cov + C2) / ((mx * mx + my * my + C1) * (vx + vy + C2))
}

/// Window along one axis; the full window is the outer product of two.
fn weights() -> [f64; WINDOW] {
    let centre = (WINDOW / 2) as f64;
    let raw: [f64; WINDOW] = std::array::from_fn(|i| (-(i as f64 - centre).powi(2) / (2.0 * SIGMA * SIGMA)).exp());
    let sum: f64 = raw.iter().sum();
    raw.map(|w| w / sum)
}

/// Blurs `[height · width]` along x, then along y. Sums have the same order on any number of threads.
fn blur(image: &[f64], width: usize, height: usize, weights: &[f64; WINDOW]) -> Vec<f64> {
    const HALF: usize = WINDOW / 2;
    let mut rows = vec![0.0; image.len()];
    image.par_chunks_exact(width).zip(rows.par_chunks_exact_mut(width)).for_each(|(row, out)| {
        for (k, weight) in weights.iter().enumerate() {
            // Output x takes input x + k − HALF.
            let (skipped, from) = (HALF.saturating_sub(k).min(width), k.saturating_sub(HALF).min(width));
            for (out, v) in out[skipped..].iter_mut().zip(&row[from..]) {
                *out += weight * v;
            }
        }
    });
    let mut both = vec![0.0; image.len()];
    both.par_chunks_exact_mut(width).enumerate().for_each(|(y, out)| {
        for k in y.saturating_sub(HALF)..(y + HALF + 1).min(height) {
            let weight = weights[k + HALF - y];
            for (out, v) in out.iter_mut().zip(&rows[k * width..]) {
                *out += weight * v;
            }
        }
    });
    both
}

fn value(v: f32) -> f64 {
    v.clamp(0.0, 1.0) as f64
}

impl Pair<'_> {
    pub(super) fn counts(&self, pixel: usize) -> bool {
        self.mask.is_none_or(|mask| mask[pixel])
    }

    /// Number of pixels that count. Fails for empty images, different sizes and NaN, since a metric of
    /// these has no meaning.
    pub(super) fn check(&self) -> Result<usize> {
        let expected = (self.width as u64 * self.height as u64).saturating_mul(3);
        let (image, reference) = (self.image.len() as u64, self.reference.len() as u64);
        if expected == 0 || image != expected || reference != expected {
            return Err(Error::Usage(format!(
                "comparing images of {} × {} pixels takes {expected} values each (at least one pixel), but the image has {image} \
                 and the reference {reference}",
                self.width, self.height
            )));
        }
        let pixels = self.image.len() / 3;
        if let Some(mask) = self.mask.filter(|mask| mask.len() != pixels) {
            return Err(Error::Usage(format!("the mask has {} values for {pixels} pixels", mask.len())));
        }
        let counted = (0..pixels).filter(|&i| self.counts(i)).count();
        if counted == 0 {
            return Err(Error::Usage("its mask leaves out every pixel, so there is nothing to compare".into()));
        }
        if let Some(i) = self.image.iter().position(|v| v.is_nan()) {
            let (x, y) = (i / 3 % self.width as usize, i / 3 / self.width as usize);
            return Err(Error::Usage(format!("the image to compare is NaN at pixel ({x}, {y})")));
        }
        Ok(counted)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::reference::ssim_forward::ssim_forward;

    /// That of the loss, which its own test compares with the definition.
    fn ssim_of_the_loss(pair: &Pair) -> f64 {
        let image = pair.image.chunks_exact(3).map(|c| [0, 1, 2, 2].map(|k| f64::from(c[k].clamp(0.0, 1.0))));
        let word = |c: &[u8]| u32::from_le_bytes([c[0], c[1], c[2], 255]);
        let targets: Vec<u32> = pair.reference.chunks_exact(3).map(word).collect();
        let found = ssim_forward(pair.width as usize, pair.height as usize, &image.collect::<Vec<_>>(), &targets);
        found.sums[2] / pair.reference.len() as f64
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn ssim_is_its_definition(
            (width, height, image, reference) in (1u32..24, 1u32..24).prop_flat_map(|(w, h)| {
                let n = (w * h * 3) as usize;
                let image = prop::collection::vec(-0.2f32..1.2, n);
                (Just(w), Just(h), image, prop::collection::vec(any::<u8>(), n))
            })
        ) {
            let pair = Pair { image: &image, reference: &reference, width, height, mask: None };
            // f64 sums of 22 products in another order.
            prop_assert!((ssim(&pair).unwrap() - ssim_of_the_loss(&pair)).abs() < 1e-12);
        }
    }

    #[test]
    fn identical_images_have_ssim_1_and_infinite_psnr() {
        let ends: Vec<u8> = (0..20 * 13 * 3).map(|i| if i * 37 % 256 > 127 { 255 } else { 0 }).collect();
        let image: Vec<f32> = ends.iter().map(|b| *b as f32 / 255.0).collect();
        let pair = Pair { image: &image, reference: &ends, width: 20, height: 13, mask: None };
        assert_eq!(psnr(&pair).unwrap(), f64::INFINITY);
        assert_eq!(ssim(&pair).unwrap(), 1.0);
    }

    #[test]
    fn an_even_error_has_its_psnr() {
        let (image, reference) = ([0.5f32; 12], [51u8; 12]);
        let pair = Pair { image: &image, reference: &reference, width: 2, height: 2, mask: None };
        // Error 0.3 everywhere: −20 log₁₀ 0.3.
        assert!((psnr(&pair).unwrap() - 10.457574905606752).abs() < 1e-9);
    }

    #[test]
    fn values_beyond_white_and_black_are_clamped() {
        let pair =
            Pair { image: &[1.5, -3.0, f32::INFINITY], reference: &[255, 0, 255], width: 1, height: 1, mask: None };
        assert_eq!(psnr(&pair).unwrap(), f64::INFINITY);
    }

    #[test]
    fn sizes_that_do_not_fit_and_nan_are_errors() {
        let message = |p: Pair| qualities(&[p]).unwrap_err().to_string();
        let (image, reference) = ([0.0f32; 12], [0u8; 12]);
        let good = Pair { image: &image, reference: &reference, width: 2, height: 2, mask: None };
        assert!(qualities(&[good]).is_ok());
        assert!(message(Pair { reference: &reference[..9], ..good }).contains("the reference 9"));
        assert!(message(Pair { width: u32::MAX, height: u32::MAX, ..good }).contains("values each"));
        assert!(
            message(Pair { image: &[], reference: &[], width: 0, height: 2, mask: None })
                .contains("at least one pixel")
        );
        let mut image = image;
        image[10] = f32::NAN;
        assert!(message(Pair { image: &image, ..good }).contains("pixel (1, 1)"));
    }

    #[test]
    fn masked_pixels_are_in_no_mean() {
        let (width, height) = (13u32, 9u32);
        let n = (width * height) as usize;
        let mut image: Vec<f32> = (0..3 * n).map(|i| (0.3 * i as f32).sin().abs()).collect();
        let reference: Vec<u8> = (0..3 * n).map(|i| (i * 37 % 256) as u8).collect();
        let mask: Vec<bool> = (0..n).map(|i| i % 5 != 2).collect();
        let of = |image: &[f32], mask: Option<&[bool]>| {
            let pair = Pair { image, reference: &reference, width, height, mask };
            (psnr(&pair).unwrap(), ssim(&pair).unwrap())
        };
        let all = vec![true; n];
        assert_eq!(of(&image, Some(&all)), of(&image, None));
        let masked = of(&image, Some(&mask));
        // The render at a masked pixel does not matter, neither for that pixel nor for windows around it.
        (0..3 * n).filter(|i| !mask[i / 3]).for_each(|i| image[i] = 1.0 - image[i]);
        assert_eq!(of(&image, Some(&mask)), masked);
        // By definition: sums over the other pixels, in a render that equals the photo at masked pixels.
        (0..3 * n).filter(|i| !mask[i / 3]).for_each(|i| image[i] = f32::from(reference[i]) / 255.0);
        let counted = mask.iter().filter(|&&counts| counts).count() as f64;
        let error = 10f64.powf(-of(&image, None).0 / 10.0) * n as f64 / counted;
        assert!((masked.0 + 10.0 * error.log10()).abs() < 1e-6);
        // One pixel far from the others keeps its own SSIM.
        let single: Vec<bool> = (0..n).map(|i| i == 0).collect();
        let alone = of(&image, Some(&single));
        assert!(alone.1 < 1.0 && alone.0.is_finite());
        let message = |mask: &[bool]| {
            let pair = Pair { image: &image, reference: &reference, width, height, mask: Some(mask) };
            qualities(&[pair]).unwrap_err().to_string()
        };
        assert!(message(&vec![false; n]).contains("every pixel") && message(&all[1..]).contains("116 values"));
    }

    #[test]
    fn means_are_over_views() {
        let of = |psnr, ssim| Quality { psnr, ssim };
        assert_eq!(Quality::mean(&[of(20.0, 0.5), of(30.0, 1.0)]), Some(of(25.0, 0.75)));
        assert_eq!(Quality::mean(&[]), None);
    }
}
