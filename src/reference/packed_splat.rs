//! Twin of `glsl/shared/packed_splat.glsl`: a splat and its color in 28 bytes.

use super::{
    Splat,
    project::Projected,
    tiles::{Tiling, for_each_tile},
};
use crate::{
    gpu::f16,
    stages::{constants::packed_splat::OPACITY_STEP, types::PackedSplat},
};

/// Largest half float.
const HALF_MAX: f32 = 65504.0;

/// Packs a splat, through float32.
pub fn pack_splat(s: &Splat) -> PackedSplat {
    let half = |color: f64| {
        let bits = (color as f32).min(HALF_MAX).to_bits();
        u32::from(f16::from_f32(f32::from_bits((bits + 0x1000) & !0x1fff)).to_bits())
    };
    let opacity = (s.opacity as f32 / OPACITY_STEP + 0.5).min(65535.0) as u32;
    let words = [s.l11, s.l12, s.l22, s.x, s.y].map(|v| (v as f32).to_bits());
    let [l11, l12, l22, x, y] = words;
    PackedSplat { first: [l11, l12, l22, x], rest: [y, opacity | half(s.r) << 16, half(s.g) | half(s.b) << 16] }
}

/// Unpacks a splat. The camera's z is lost.
pub fn unpack_splat(p: &PackedSplat) -> Splat {
    let float = |word: u32| f64::from(f32::from_bits(word));
    let half = |word: u32| f16::from_bits(word as u16).to_f64();
    let ([l11, l12, l22, x], [y, opacity_red, green_blue]) = (p.first, p.rest);
    Splat {
        x: float(x),
        y: float(y),
        l11: float(l11),
        l12: float(l12),
        l22: float(l22),
        opacity: (f64::from(opacity_red & 0xffff) as f32 * OPACITY_STEP).into(),
        r: half(opacity_red >> 16),
        g: half(green_blue),
        b: half(green_blue >> 16),
        z: 1.0,
    }
}

/// Projected splats after packing and unpacking; their tile counts follow the packed opacity.
pub fn packed(projected: Projected, tiling: &Tiling) -> Projected {
    let mut packed = projected;
    for (splat, tiles) in packed.splats.iter_mut().zip(&mut packed.tile_counts).filter(|(_, tiles)| **tiles > 0) {
        *splat = Splat { z: splat.z, ..unpack_splat(&pack_splat(splat)) };
        *tiles = 0;
        for_each_tile(splat, tiling, |_| *tiles += 1);
    }
    packed
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Opacities to half of 1/65280, and exact at α's threshold; colors to half a unit of a half, 2^-11 of
    /// themselves.
    #[test]
    fn a_packed_splat_comes_back() {
        for k in 0..2000 {
            let t = f64::from(k) / 2000.0;
            let [x, y, l11, l12, l22] =
                [1e5 * t - 3e3, 40.0 * t, 1.7 * t, -3.0 * t, 1e-4 * t].map(|v| f64::from(v as f32));
            let splat = Splat { x, y, l11, l12, l22, opacity: t, r: 3.0 * t, g: 1e-3 * t, b: 5e4 * t, z: 1.0 };
            let back = unpack_splat(&pack_splat(&splat));
            assert_eq!([back.x, back.y, back.l11, back.l12, back.l22], [x, y, l11, l12, l22]);
            assert!((back.opacity - t).abs() <= 0.5001 / 65280.0, "{t}: {}", back.opacity);
            for (got, want) in [(back.r, splat.r), (back.g, splat.g), (back.b, splat.b)] {
                assert!((got - want).abs() <= want / 2048.0 + 1e-7, "{got} {want}");
            }
        }
        let of = |opacity: f64, r: f64| {
            unpack_splat(&pack_splat(&Splat { opacity, r, l11: 1.0, l22: 1.0, ..Splat::default() }))
        };
        let least = 1.0f32 / 255.0;
        assert!(of(least.into(), 0.0).opacity as f32 >= least && of(1.0, 0.0).opacity == 1.0);
        assert_eq!(of(1.0, 1e30).r, 65504.0);
    }
}
