//! Turns a rendered pixel into a texel of a caller's image.

use crate::{
    data::srgb::{linear_from_srgb, srgb_from_linear},
    gpu::f16,
    stages::constants::resolve::{BGRA8, HALF_MAX, OPAQUE, OVER, RGBA8, RGBA16F},
};

/// What is asked of a pixel, see `glsl/raster/resolve.comp`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct To {
    /// [`OPAQUE`] and so on.
    pub blend: u32,
    /// The target holds linear light.
    pub linear: bool,
    /// Factor of the Gaussians' linear light.
    pub exposure: f64,
}

impl To {
    /// RGBA of the target; `rendered` is RGB over its background and transmittance, `below` what the target holds.
    pub fn resolve(&self, rendered: [f64; 4], below: [f64; 4]) -> [f64; 4] {
        let transmittance = rendered[3];
        let alpha = if self.blend == OPAQUE { 1.0 } else { 1.0 - transmittance };
        let colour = |c: usize| {
            let straight = if alpha > 0.0 { rendered[c] / alpha } else { 0.0 };
            let straight = if self.exposure == 1.0 {
                straight
            } else {
                srgb_from_linear(self.exposure * linear_from_srgb(straight))
            };
            match (self.blend == OVER, self.linear) {
                (true, true) => {
                    linear_from_srgb(alpha * straight + transmittance * srgb_from_linear(below[c].max(0.0)))
                }
                (true, false) => alpha * straight + transmittance * below[c],
                (false, true) => alpha * linear_from_srgb(straight),
                (false, false) => alpha * straight,
            }
        };
        let covered = if self.blend == OVER { alpha + transmittance * below[3] } else { alpha };
        [colour(0), colour(1), colour(2), covered]
    }
}

/// What a depth buffer is cleared to: the depth of the far plane.
pub fn empty([_, b]: [f64; 2]) -> f64 {
    if b < 0.0 { 1.0 } else { 0.0 }
}

/// The depth a + b / z of camera z, as far as a depth buffer can hold it; of no Gaussian, 0, that of the far plane.
pub fn depth(z: f64, [a, b]: [f64; 2]) -> f64 {
    if z > 0.0 { (a + b / z).clamp(0.0, 1.0) } else { empty([a, b]) }
}

/// The camera z of a depth; ∞ where it is that of nothing.
pub fn camera_z(depth: f64, [a, b]: [f64; 2]) -> f64 {
    let z = b / (depth - a);
    let something = if b < 0.0 { depth < 1.0 } else { depth > 0.0 };
    if something && z > 0.0 { z } else { f64::INFINITY }
}

/// Words of a texel.
pub fn words(format: u32) -> usize {
    match format {
        RGBA8 | BGRA8 => 1,
        RGBA16F => 2,
        _ => 4,
    }
}

/// RGBA of a texel.
pub fn unpack(format: u32, texel: &[u32]) -> [f64; 4] {
    let bytes: Vec<u8> = texel.iter().flat_map(|word| word.to_le_bytes()).collect();
    match format {
        RGBA8 => [0, 1, 2, 3].map(|c| f64::from(bytes[c]) / 255.0),
        BGRA8 => [2, 1, 0, 3].map(|c| f64::from(bytes[c]) / 255.0),
        RGBA16F => [0, 2, 4, 6].map(|at| f16::from_le_bytes([bytes[at], bytes[at + 1]]).to_f64()),
        _ => [0, 1, 2, 3].map(|c| f32::from_bits(texel[c]).into()),
    }
}

/// The texel of RGBA.
pub fn pack(format: u32, c: [f64; 4], texel: &mut [u32]) {
    let byte = |c: f64| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
    let half = |c: f64| f16::from_f64(c.min(f64::from(HALF_MAX))).to_bits();
    match format {
        RGBA8 => texel[0] = u32::from_le_bytes(c.map(byte)),
        BGRA8 => texel[0] = u32::from_le_bytes([c[2], c[1], c[0], c[3]].map(byte)),
        RGBA16F => {
            let pair = |a, b| u32::from(half(a)) | u32::from(half(b)) << 16;
            texel.copy_from_slice(&[pair(c[0], c[1]), pair(c[2], c[3])]);
        }
        _ => texel.copy_from_slice(&c.map(|c| (c as f32).to_bits())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::constants::resolve::{PREMULTIPLIED, RGBA32F};

    #[test]
    fn a_curve_and_its_inverse_meet() {
        for i in 0..=400 {
            let c = f64::from(i) / 100.0;
            assert!((srgb_from_linear(linear_from_srgb(c)) - c).abs() < 1e-6, "{c}");
        }
        // Middle grey, as tables have it.
        assert!((linear_from_srgb(0.5) - 0.214041).abs() < 1e-6);
    }

    #[test]
    fn texels_come_back_within_half_a_step() {
        let c = [0.25, 0.5, 0.998, 0.1];
        for (format, step) in [(RGBA8, 0.5 / 255.0), (BGRA8, 0.5 / 255.0), (RGBA16F, 2f64.powi(-12)), (RGBA32F, 1e-7)] {
            let mut texel = vec![0; words(format)];
            pack(format, c, &mut texel);
            let back = unpack(format, &texel);
            assert!(c.iter().zip(back).all(|(a, b)| (a - b).abs() <= step), "{format}: {back:?}");
        }
        let mut texel = [0];
        pack(BGRA8, [1.0, 0.0, 0.0, 1.0], &mut texel);
        assert_eq!(texel, [0xFFFF_0000]);
    }

    #[test]
    fn over_an_opaque_texel_is_what_a_background_of_its_colour_gives() {
        let below = [0.3, 0.6, 0.9, 1.0];
        let (colour, t) = ([0.2, 0.1, 0.4], 0.25);
        let over = To { blend: OVER, linear: false, exposure: 1.0 };
        let result = over.resolve([colour[0], colour[1], colour[2], t], below);
        for c in 0..3 {
            assert!((result[c] - (colour[c] + t * below[c])).abs() < 1e-12);
        }
        assert_eq!(result[3], 1.0);
        // The same in light: what is below is encoded first.
        let light = To { linear: true, ..over }.resolve([0.2, 0.1, 0.4, t], below.map(linear_from_srgb));
        for c in 0..3 {
            assert!((srgb_from_linear(light[c]) - result[c]).abs() < 1e-6);
        }
        // Twice the light of a colour is not twice its value.
        let brighter = To { blend: PREMULTIPLIED, linear: true, exposure: 2.0 }.resolve([0.3, 0.3, 0.3, 0.5], [0.0; 4]);
        assert!((brighter[0] - 0.5 * 2.0 * linear_from_srgb(0.6)).abs() < 1e-9);
    }

    #[test]
    fn depths_come_back_in_every_form() {
        let (near, far) = (0.1, 50.0);
        let forms = [[far / (far - near), -far * near / (far - near)], [0.0, near], [1.0, -near]];
        for form in forms {
            for z in [0.2, 1.0, 30.0] {
                assert!((camera_z(depth(z, form), form) / z - 1.0).abs() < 1e-9, "{form:?} {z}");
            }
        }
        // Nothing there: what a depth buffer is cleared to, also where the far plane is near.
        for (form, cleared) in forms.into_iter().zip([1.0, 0.0, 1.0]) {
            assert_eq!((depth(0.0, form), camera_z(cleared, form)), (cleared, f64::INFINITY));
            // What is beyond the far plane, or before the near one, is as far as depths go.
            let beyond = [0.5 * near, 2.0 * far].map(|z| depth(z, form));
            assert!(beyond[0] == 1.0 - cleared && (0.0..=1.0).contains(&beyond[1]), "{form:?}: {beyond:?}");
        }
    }
}
