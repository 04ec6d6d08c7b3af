//! Decomposition of images into diffuse light, the same from every direction, and specular light (method,
//! section 6), in linear light.

use rayon::prelude::*;
use serde::Serialize;

use crate::{Error, Result, data::srgb};

/// [`srgb::linear_from_srgb`] for values of images.
pub fn linear_from_srgb(v: f32) -> f32 {
    srgb::linear_from_srgb(v.into()) as f32
}

/// Inverse of [`linear_from_srgb`].
pub fn srgb_from_linear(v: f32) -> f32 {
    srgb::srgb_from_linear(v.into()) as f32
}

/// Two images in linear light that add up to the whole, with as many values as the input.
#[derive(Debug, Clone, PartialEq)]
pub struct Decomposition {
    /// Diffuse part, linear light, `[height · width · 3]`.
    pub diffuse: Vec<f32>,
    /// Specular part, linear light, `[height · width · 3]`; diffuse and specular add up to the image.
    pub specular: Vec<f32>,
}

/// Decomposes `whole`, an image of the whole scene. `constant` shows the base Gaussians with their constant
/// SH band only. Both hold sRGB values and have the same length. Diffuse is the smaller of the two in
/// linear light; specular is the rest of `whole`, never negative.
pub fn decompose(whole: &[f32], constant: &[f32]) -> Decomposition {
    let (diffuse, specular) = whole
        .par_iter()
        .zip(constant)
        .map(|(&whole, &constant)| {
            let (all, diffuse) = (linear_from_srgb(whole), linear_from_srgb(constant.min(whole)));
            (diffuse, all - diffuse)
        })
        .unzip();
    Decomposition { diffuse, specular }
}

/// Quality of a render's parts against the true ones, in linear light; infinite for equal images (`null` in
/// JSON).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PartsQuality {
    /// PSNR of the diffuse part in linear light, dB.
    pub diffuse: f64,
    /// PSNR of the specular part in linear light, dB.
    pub specular: f64,
}

impl PartsQuality {
    /// Mean decibels over views; infinite if any view is, `None` without views.
    pub fn mean(views: &[PartsQuality]) -> Option<PartsQuality> {
        let n = views.len() as f64;
        (!views.is_empty()).then(|| PartsQuality {
            diffuse: views.iter().map(|q| q.diffuse).sum::<f64>() / n,
            specular: views.iter().map(|q| q.specular).sum::<f64>() / n,
        })
    }
}

/// Compares `parts` with the true ones, which have as many sRGB bytes as `parts` has values. `mask` selects
/// the pixels that count. Light is clamped to between 0 and 1, as in the true parts.
///
/// # Errors
/// [`Error::Usage`] for other numbers of values, if no pixel counts, and for NaN.
pub fn judge(parts: &Decomposition, diffuse: &[u8], specular: &[u8], mask: Option<&[bool]>) -> Result<PartsQuality> {
    let psnr = |name: &str, found: &[f32], truth: &[u8]| {
        let n = found.len();
        if truth.len() != n || mask.is_some_and(|mask| 3 * mask.len() != n) {
            let what = format!("{name}: {n} values, but the true part or the mask has another number");
            return Err(Error::Usage(what));
        }
        let counts = |i: &usize| mask.is_none_or(|mask| mask[i / 3]);
        let square = |i: usize| {
            let truth = f64::from(linear_from_srgb(f32::from(truth[i]) / 255.0));
            (f64::from(found[i].clamp(0.0, 1.0)) - truth).powi(2)
        };
        let counted = (0..n).filter(counts).count();
        let error = (0..n).filter(counts).map(square).sum::<f64>() / counted as f64;
        // Without pixels the mean is NaN, too.
        if error.is_nan() {
            return Err(Error::Usage(format!("{name}: no pixel counts, or the render is NaN")));
        }
        Ok(10.0 * error.recip().log10())
    };
    Ok(PartsQuality {
        diffuse: psnr("diffuse", &parts.diffuse, diffuse)?,
        specular: psnr("specular", &parts.specular, specular)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_judged_in_linear_light_where_the_mask_counts() {
        // Bytes 0, 255 and 188 have linear light 0, 1 and 0.5029 (IEC 61966-2-1).
        let half = 0.502_886_5;
        let parts = Decomposition {
            diffuse: vec![0.1, 1.0, half, 9.0, 9.0, 9.0],
            specular: vec![0.0, 1.7, half, 0.5, 0.5, 0.5],
        };
        let truth = [0, 255, 188, 0, 0, 0];
        let found = judge(&parts, &truth, &truth, Some(&[true, false])).unwrap();
        // One of three values is off by 0.1.
        assert!((found.diffuse - 10.0 * 300f64.log10()).abs() < 1e-4, "{found:?}");
        // Values brighter than white count as white; the curve is in float32.
        assert!(found.specular > 120.0, "{found:?}");
        let all = judge(&parts, &truth, &truth, None).unwrap();
        assert!((all.specular - 10.0 * 8f64.log10()).abs() < 1e-4 && all.diffuse < 3.1, "{all:?}");
        let equal = Decomposition { diffuse: vec![0.0; 6], specular: vec![1.0; 6] };
        assert_eq!(judge(&equal, &[0; 6], &[255; 6], None).unwrap().diffuse, f64::INFINITY);
        let mean = PartsQuality::mean(&[found, all]).unwrap();
        assert_eq!(mean.diffuse, (found.diffuse + all.diffuse) / 2.0);
        assert_eq!(PartsQuality::mean(&[]), None);
    }

    #[test]
    fn what_cannot_be_judged_is_refused() {
        let parts = |v| Decomposition { diffuse: vec![v; 3], specular: vec![0.0; 3] };
        assert!(judge(&parts(0.0), &[0; 6], &[0; 3], None).is_err());
        assert!(judge(&parts(0.0), &[0; 3], &[0; 3], Some(&[true, true])).is_err());
        assert!(judge(&parts(0.0), &[0; 3], &[0; 3], Some(&[false])).is_err());
        assert!(judge(&parts(f32::NAN), &[0; 3], &[0; 3], None).unwrap_err().to_string().contains("diffuse"));
    }
}
