//! Packs Gaussians into few bytes, as the page's vertex shader (`project.vert`) reads them.

use glam::DVec3;

use crate::{
    gpu::f16,
    scene::{Gaussians, Lobes, Scene, layout},
};

/// Words of a Gaussian's geometry: 32 bytes.
const GEOMETRY: usize = 8;
/// Words of a lobe: 16 bytes.
const LOBE: usize = 4;
/// Largest number in 16 and in 15 bits.
const MAX_16: f64 = 65535.0;
const MAX_15: f64 = 32767.0;
/// Largest value of a signed byte, symmetric around 0.
const MAX_SIGNED: f32 = 127.0;

/// Scene as blocks of words, the base's Gaussians before the supplement's.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Packed {
    /// For each Gaussian: mean (3 × f32), opacity and three log scales (16 bits each), rotation (3 × 15
    /// bits, and 2 bits for the index of the missing quaternion component), and the constant harmonic (3
    /// halves). 16-bit numbers are in this order, the low half of a word first.
    pub geometry: Vec<u32>,
    /// For each Gaussian: the largest coefficient as a half, then all coefficients (k from 1 on, red,
    /// green, blue) as signed bytes relative to it, padded to 16 bytes. Empty if all Gaussians have degree
    /// 0; the supplement has no rows if all its Gaussians do.
    pub harmonics: Vec<u32>,
    /// For each Gaussian of the supplement, f32: the lobe's direction as a vector whose length is the
    /// width, and its sharpness.
    pub lobes: Vec<u32>,
    /// Log scales encoded as 0 and as 65535.
    pub log_scales: [f32; 2],
    /// The larger degree of base and supplement, used for `harmonics`.
    pub degree: u32,
    /// Number of Gaussians in `harmonics`.
    pub with_harmonics: usize,
}

impl Packed {
    /// Packs a scene; means count from `origin`.
    pub(super) fn new(scene: &Scene, origin: DVec3) -> Packed {
        let parts = || std::iter::once(&scene.base).chain(scene.supplement.as_ref().map(|s| &s.gaussians));
        let scales = || parts().flat_map(|part| part.log_scales.iter().flatten().copied());
        let (low, high) = scales().fold((f32::MAX, f32::MIN), |(low, high), s| (low.min(s), high.max(s)));
        let log_scales = if low <= high { [low, high] } else { [0.0; 2] };
        let degree = parts().map(|part| part.sh_degree).max().unwrap_or_default();
        let (mut geometry, mut harmonics, mut with_harmonics) = (Vec::new(), Vec::new(), 0);
        for (part, lobed) in parts().zip([false, true]) {
            (0..part.len()).for_each(|i| geometry.extend(geometry_of(part, i, origin, log_scales)));
            // The base comes first, so each of its Gaussians has a row even if only the supplement has
            // bands.
            if part.sh_degree > 0 || !lobed && degree > 0 {
                (0..part.len()).for_each(|i| harmonics.extend(harmonics_of(part, i, degree)));
                with_harmonics += part.len();
            }
        }
        let lobes = scene.supplement.as_ref().map(|s| &s.lobes);
        let lobes = lobes.into_iter().flat_map(|lobes| (0..lobes.widths.len()).flat_map(|j| lobe_of(lobes, j)));
        Packed { geometry, harmonics, lobes: lobes.collect(), log_scales, degree, with_harmonics }
    }
}

/// Bytes of a Gaussian without and with a lobe, if their harmonics have these degrees.
pub(super) fn bytes_of([plain, lobed]: [u32; 2]) -> [usize; 2] {
    // Rows of the base have the larger degree; so have those of the supplement, if there are any.
    let harmonics = harmonic_words(plain.max(lobed));
    [4 * (GEOMETRY + harmonics), 4 * (GEOMETRY + if lobed > 0 { harmonics } else { 0 } + LOBE)]
}

/// Words of a row, rounded up to texels of four words: 0, 1, 2 or 3 texels.
fn harmonic_words(degree: u32) -> usize {
    let above = 3 * (layout::coefficients(degree) - 1);
    if above == 0 { 0 } else { 4 * (2 + above).div_ceil(16) }
}

fn geometry_of(part: &Gaussians, i: usize, origin: DVec3, [low, high]: [f32; 2]) -> [u32; GEOMETRY] {
    let mean = DVec3::from_array(part.means[i].map(f64::from)) - origin;
    let [x, y, z] = mean.to_array().map(|v| (v as f32).to_bits());
    let range = f64::from(high) - f64::from(low);
    let share = |s: f32| if range > 0.0 { (f64::from(s) - f64::from(low)) / range } else { 0.0 };
    let [sx, sy, sz] = part.log_scales[i].map(|s| (MAX_16 * share(s)).round() as u32);
    let (rotation, opacity) = match rotation_of(part.quats[i]) {
        Some(rotation) => (rotation, MAX_16 / (1.0 + (-f64::from(part.opacities[i])).exp())),
        // A Gaussian without a rotation is not visible.
        None => ([0; 3], 0.0),
    };
    let [ra, rb, rc] = rotation;
    let [red, green, blue] = part.sh[i * part.sh_coefficients()].map(half);
    let pair = |a: u32, b: u32| a | b << 16;
    [x, y, z, pair(opacity.round() as u32, sx), pair(sy, sz), pair(ra, rb), pair(rc, red), pair(green, blue)]
}

/// Packs a rotation: the three smaller components of the unit quaternion whose largest is positive, in 15
/// bits each from −√½ to √½. The top bits of the first two hold the index of the missing component, low bit
/// first.
fn rotation_of(quat: [f32; 4]) -> Option<[u32; 3]> {
    let quat = quat.map(f64::from);
    let missing = (0..4).max_by(|&a, &b| quat[a].abs().total_cmp(&quat[b].abs()))?;
    let largest = quat[missing].abs();
    if !(largest >= f64::from(f32::MIN_POSITIVE) && largest <= f64::from(f32::MAX)) {
        return None;
    }
    let length = quat.iter().map(|q| q * q).sum::<f64>().sqrt() * quat[missing].signum();
    let mut three = (0..4).filter(|&k| k != missing).map(|k| {
        let share = 0.5 + quat[k] / length * std::f64::consts::FRAC_1_SQRT_2;
        (MAX_15 * share).round().clamp(0.0, MAX_15) as u32
    });
    let mut next = |top: usize| three.next().unwrap_or_default() | (top as u32) << 15;
    Some([next(missing & 1), next(missing >> 1), next(0)])
}

/// Row of harmonics, padded to `degree`.
fn harmonics_of(part: &Gaussians, i: usize, degree: u32) -> impl Iterator<Item = u32> {
    let k = part.sh_coefficients();
    let above = part.sh[i * k + 1..(i + 1) * k].as_flattened();
    let largest = above.iter().fold(0.0f32, |most, v| most.max(v.abs())).min(f16::MAX.to_f32());
    // Rounded up, so that no coefficient exceeds 127 steps.
    let nearest = f16::from_f32(largest);
    let scale = if nearest.to_f32() < largest { f16::from_bits(nearest.to_bits() + 1) } else { nearest };
    let step = scale.to_f32() / MAX_SIGNED;
    let byte = |v: &f32| if step > 0.0 { (v / step).round().clamp(-MAX_SIGNED, MAX_SIGNED) as i8 as u8 } else { 0 };
    let mut bytes = scale.to_bits().to_le_bytes().to_vec();
    bytes.extend(above.iter().map(byte));
    bytes.resize(4 * harmonic_words(degree), 0);
    bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect::<Vec<_>>().into_iter()
}

fn lobe_of(lobes: &Lobes, j: usize) -> [u32; LOBE] {
    let direction = DVec3::from_array(lobes.directions[j].map(f64::from));
    // A lobe without a direction is not visible, as in the kernels.
    let known = direction.abs().max_element() >= f64::from(f32::MIN_POSITIVE);
    let vector = if known { direction.normalize() * f64::from(lobes.widths[j]) } else { DVec3::ZERO };
    let [x, y, z] = vector.to_array().map(|v| (v as f32).to_bits());
    [x, y, z, lobes.sharpness[j].to_bits()]
}

fn half(value: f32) -> u32 {
    let most = f16::MAX.to_f32();
    f16::from_f32(value.clamp(-most, most)).to_bits().into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{reference::random_scene, scene::Supplement};

    /// Decodes a Gaussian's words like the shader: mean, opacity, log scales, quaternion, constant
    /// harmonic.
    fn unpack(words: &[u32], [low, high]: [f32; 2]) -> ([f32; 3], f64, [f64; 3], [f64; 4], [f32; 3]) {
        let short = |at: usize| words[3 + at / 2] >> (16 * (at % 2)) & 0xFFFF;
        let scale = |at| f64::from(low) + f64::from(high - low) * f64::from(short(at)) / MAX_16;
        let part = |at| (f64::from(short(at) & 0x7FFF) / MAX_15 - 0.5) * 2f64.sqrt();
        let missing = (short(4) >> 15 | short(5) >> 15 << 1) as usize;
        let three = [part(4), part(5), part(6)];
        let mut quat = three.to_vec();
        quat.insert(missing, (1.0 - three.iter().map(|v| v * v).sum::<f64>()).max(0.0).sqrt());
        let constant = [7, 8, 9].map(|at| f16::from_bits(short(at) as u16).to_f32());
        (
            [0, 1, 2].map(|k| f32::from_bits(words[k])),
            f64::from(short(0)) / MAX_16,
            [1, 2, 3].map(scale),
            quat.try_into().unwrap(),
            constant,
        )
    }

    /// Each number is within half a step of the original, for the step of its width.
    #[test]
    fn numbers_keep_what_their_widths_hold() {
        for [base, lobed] in [[0, 0], [1, 1], [2, 2], [3, 3], [3, 0], [2, 1], [0, 2]] {
            let mut scene = random_scene(5, 300, 100, 3);
            scene.base = scene.base.with_degree(base);
            scene.supplement = scene.supplement.map(|s| Supplement { gaussians: s.gaussians.with_degree(lobed), ..s });
            let packed = Packed::new(&scene, DVec3::ZERO);
            let Supplement { gaussians, lobes } = scene.supplement.as_ref().unwrap();
            let (degree, rows) = (base.max(lobed), if lobed == 0 { 300 } else { 400 });
            let words = harmonic_words(degree);
            assert_eq!((packed.geometry.len(), packed.harmonics.len()), (400 * GEOMETRY, rows * words));
            assert_eq!((packed.degree, packed.with_harmonics), (degree, if degree == 0 { 0 } else { rows }));
            let whole: usize = packed.geometry.len() + packed.harmonics.len() + packed.lobes.len();
            let [plain_bytes, lobed_bytes] = bytes_of([base, lobed]);
            assert_eq!(4 * whole, 300 * plain_bytes + 100 * lobed_bytes);
            let range = packed.log_scales[1] - packed.log_scales[0];
            for n in 0..400 {
                let (part, i) = if n < 300 { (&scene.base, n) } else { (gaussians, n - 300) };
                let (mean, opacity, scales, quat, constant) =
                    unpack(&packed.geometry[GEOMETRY * n..][..GEOMETRY], packed.log_scales);
                assert_eq!(mean, part.means[i]);
                let expected = 1.0 / (1.0 + (-f64::from(part.opacities[i])).exp());
                assert!((opacity - expected).abs() <= 0.5001 / MAX_16);
                for (found, expected) in scales.iter().zip(part.log_scales[i]) {
                    assert!((found - f64::from(expected)).abs() <= 0.501 * f64::from(range) / MAX_16);
                }
                // Three components are off by at most half a step of √2 / 32767, and the fourth by at most
                // their sum.
                let source = part.quats[i].map(f64::from);
                let length = source.iter().map(|v| v * v).sum::<f64>().sqrt();
                let dot: f64 = quat.iter().zip(source).map(|(a, b)| a * b / length).sum();
                assert!(dot.abs() > 1.0 - 6.0 * (0.5 * 2f64.sqrt() / MAX_15).powi(2), "{n}: {dot}");
                let k = part.sh_coefficients();
                for (found, expected) in constant.iter().zip(part.sh[i * k]) {
                    assert!((found - expected).abs() <= expected.abs() / 2048.0 + 1e-7);
                }
                let row = if n < packed.with_harmonics { &packed.harmonics[words * n..][..words] } else { &[] };
                let bytes: Vec<u8> = row.iter().flat_map(|w| w.to_le_bytes()).collect();
                for (at, expected) in part.sh[i * k + 1..(i + 1) * k].as_flattened().iter().enumerate() {
                    let step = f16::from_le_bytes([bytes[0], bytes[1]]).to_f32() / MAX_SIGNED;
                    assert!((f32::from(bytes[2 + at] as i8) * step - expected).abs() <= 0.501 * step);
                }
            }
            for j in 0..100 {
                let [x, y, z, sharpness] = [0, 1, 2, 3].map(|k| f32::from_bits(packed.lobes[LOBE * j + k]));
                let (v, d) = (DVec3::new(x.into(), y.into(), z.into()), lobes.directions[j].map(f64::from));
                assert!((v.length() - f64::from(lobes.widths[j])).abs() < 1e-6 && sharpness == lobes.sharpness[j]);
                assert!(v.angle_between(DVec3::from_array(d)) < 1e-6);
            }
        }
    }

    #[test]
    fn what_is_not_seen_stays_unseen_and_an_origin_is_taken_off() {
        let mut scene = random_scene(6, 2, 1, 1);
        scene.base.quats[0] = [0.0; 4];
        scene.base.means[1] = [1e6, 2.0, 3.0];
        scene.base.sh[5] = [1e30, 0.0, -1e30];
        scene.supplement.as_mut().unwrap().lobes.directions[0] = [0.0; 3];
        let packed = Packed::new(&scene, DVec3::new(1e6, 0.0, 0.0));
        assert_eq!(packed.geometry[3] & 0xFFFF, 0);
        assert_eq!([8, 9, 10].map(|at| f32::from_bits(packed.geometry[at])), [0.0, 2.0, 3.0]);
        assert_eq!(packed.lobes[..3], [0; 3]);
        // Values beyond a half are clamped to its maximum.
        assert_eq!(packed.harmonics[4] & 0xFFFF, u32::from(f16::MAX.to_bits()));
        assert!(Packed::new(&Scene::default(), DVec3::ZERO).geometry.is_empty());
    }

    #[test]
    fn bytes_are_those_that_the_help_tells() {
        assert_eq!([0, 1, 2, 3].map(|degree| bytes_of([degree; 2])), [[32, 48], [48, 64], [64, 80], [80, 96]]);
        assert_eq!(bytes_of([3, 0]), [80, 48]);
    }
}
