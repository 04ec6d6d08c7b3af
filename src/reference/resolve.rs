//! Twin of `resolve.comp`: converts a rendered pixel to a texel of a caller's image.

use crate::{
    data::srgb::{linear_from_srgb, srgb_from_linear},
    gpu::f16,
    stages::constants::resolve::{BGRA8, HALF_MAX, OPAQUE, OVER, PREMULTIPLIED, RGBA8, RGBA16F},
};

/// Parameters of the conversion, see `glsl/raster/resolve.comp`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct To {
    /// Blend mode: [`OPAQUE`] and so on.
    pub blend: u32,
    /// The target holds linear light.
    pub linear: bool,
    /// Factor of the Gaussians' linear light.
    pub exposure: f64,
    /// sRGB-encoded, for [`OPAQUE`]; if exposure is 1 the rendered image already includes it.
    pub background: [f64; 3],
}

impl To {
    /// True if the rendered image includes the background, see [`To::background`].
    pub fn whole(&self) -> bool {
        self.blend == OPAQUE && self.exposure == 1.0
    }

    /// RGBA of the target; `rendered` is RGB and transmittance, `below` the target's content.
    pub fn resolve(&self, rendered: [f64; 4], below: [f64; 4]) -> [f64; 4] {
        let transmittance = rendered[3];
        let alpha = if self.whole() { 1.0 } else { 1.0 - transmittance };
        let color = |c: usize| {
            let straight = if alpha > 0.0 { rendered[c] / alpha } else { 0.0 };
            let straight = if self.exposure == 1.0 {
                straight
            } else {
                srgb_from_linear(self.exposure * linear_from_srgb(straight))
            };
            let light = |c: f64| if self.linear { linear_from_srgb(c) } else { c };
            if self.whole() || self.blend == PREMULTIPLIED {
                return alpha * light(straight);
            }
            let behind = match (self.blend == OVER, self.linear) {
                (true, true) => srgb_from_linear(below[c].max(0.0)),
                (true, false) => below[c],
                (false, _) => self.background[c],
            };
            light(alpha * straight + transmittance * behind)
        };
        let covered = match self.blend {
            OVER => alpha + transmittance * below[3],
            OPAQUE => 1.0,
            _ => alpha,
        };
        [color(0), color(1), color(2), covered]
    }
}

/// Clear value of a depth buffer: the depth of the far plane.
pub fn empty([_, b]: [f64; 2]) -> f64 {
    if b < 0.0 { 1.0 } else { 0.0 }
}

/// The depth a + b / z of camera z, clamped to a depth buffer's range. If z is 0 (no Gaussian), the far
/// plane's depth.
pub fn depth(z: f64, [a, b]: [f64; 2]) -> f64 {
    if z > 0.0 { (a + b / z).clamp(0.0, 1.0) } else { empty([a, b]) }
}

/// The camera z of a depth; ∞ for the clear value.
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

    #[test]
    fn a_curve_and_its_inverse_meet() {
        for i in 0..=400 {
            let c = f64::from(i) / 100.0;
            assert!((srgb_from_linear(linear_from_srgb(c)) - c).abs() < 1e-6, "{c}");
        }
        // Middle grey, as in published tables.
        assert!((linear_from_srgb(0.5) - 0.214041).abs() < 1e-6);
    }

    #[test]
    fn over_an_opaque_texel_is_what_a_background_of_its_color_gives() {
        let below = [0.3, 0.6, 0.9, 1.0];
        let (color, t) = ([0.2, 0.1, 0.4], 0.25);
        let over = To { blend: OVER, linear: false, exposure: 1.0, background: [0.0; 3] };
        let result = over.resolve([color[0], color[1], color[2], t], below);
        for c in 0..3 {
            assert!((result[c] - (color[c] + t * below[c])).abs() < 1e-12);
        }
        assert_eq!(result[3], 1.0);
        // The same in linear light: the content below is encoded first.
        let light = To { linear: true, ..over }.resolve([0.2, 0.1, 0.4, t], below.map(linear_from_srgb));
        for c in 0..3 {
            assert!((srgb_from_linear(light[c]) - result[c]).abs() < 1e-6);
        }
        // Twice the light of a color is not twice its value.
        let to = To { blend: PREMULTIPLIED, linear: true, exposure: 2.0, background: [0.0; 3] };
        let brighter = to.resolve([0.3, 0.3, 0.3, 0.5], [0.0; 4]);
        assert!((brighter[0] - 0.5 * 2.0 * linear_from_srgb(0.6)).abs() < 1e-9);
    }

    #[test]
    fn a_background_is_as_bright_as_it_was_whatever_is_exposed() {
        let background = [0.2, 0.5, 0.9];
        let to = |linear, exposure| To { blend: OPAQUE, linear, exposure, background };
        for exposure in [0.0, 0.5, 2.0] {
            // A pixel without a Gaussian, and one half covered.
            let empty = to(false, exposure).resolve([0.0, 0.0, 0.0, 1.0], [0.0; 4]);
            assert_eq!(empty, [0.2, 0.5, 0.9, 1.0]);
            let half = to(false, exposure).resolve([0.3, 0.3, 0.3, 0.5], [0.0; 4]);
            let own = srgb_from_linear(exposure * linear_from_srgb(0.6));
            assert!((0..3).all(|c| (half[c] - 0.5 * (own + background[c])).abs() < 1e-9) && half[3] == 1.0);
            let light = to(true, exposure).resolve([0.3, 0.3, 0.3, 0.5], [0.0; 4]);
            assert!((0..3).all(|c| (srgb_from_linear(light[c]) - half[c]).abs() < 1e-6));
        }
        // The image that includes its background gives the same result.
        let over: Vec<f64> = background.iter().map(|b| 0.3 + 0.5 * b).collect();
        let plain = to(false, 1.0).resolve([over[0], over[1], over[2], 0.5], [0.0; 4]);
        let exposed = to(false, 1.0 + 1e-9).resolve([0.3, 0.3, 0.3, 0.5], [0.0; 4]);
        assert!((0..4).all(|c| (plain[c] - exposed[c]).abs() < 1e-6), "{plain:?} {exposed:?}");
    }
}
