//! Twin of `adam.comp`: Adam (Kingma 2015) on parameter planes, with the settings of 3DGS, and Newton's step
//! by curvatures from probes.

use super::{FLOAT_MAX, FLOAT_MIN, betas::B_RANGE};
use crate::scene::{
    color,
    layout::{Array, Group, LOBE_SHARPNESS, LOBE_WIDTH},
};

/// Decay of the first moment (3DGS).
pub const BETA1: f64 = 0.9;
/// Decay of the second moment (3DGS).
pub const BETA2: f64 = 0.999;
/// Added to the root of the second moment, which keeps the quotient finite (3DGS).
pub const EPSILON: f64 = 1e-15;

/// Factor on the Newton step of a Gaussian that the step before did not move.
pub const PACE: f64 = 2.0;

/// Gradients are clamped to this: the square of a larger one, times the first correction of 1000, would leave
/// float32.
pub const GRADIENT_MAX: f64 = 1e17;

/// Range of a lobe's width T (method, section 1).
pub const WIDTH_RANGE: (f64, f64) = (0.01, 1.0);

/// Range of a lobe's sharpness β. Both ends are beyond any visible difference, and inside float32.
///
/// At β = 8 the exponent is 2 e^8 ≈ 6e3: the lobe falls to one half within 0.03 T rad, 3e-4 rad for the
/// narrowest T, an angle that float32 directions (1e-7) still resolve to a thousandth. Just below ψ = π float32 has
/// cos(ψ/2) ≥ 7e-8, so |2 e^β ln cos(ψ/2)| ≤ 1e5 and exp gives 0, never NaN.
/// At β = −2 the exponent is 0.27: the factor is above 0.3 over 99 % of the support and falls to 0.01 at the
/// last angle that float32 has inside it. Blunter lobes would end in a jump there.
pub const SHARPNESS_RANGE: (f64, f64) = (-2.0, 8.0);

/// Learning rate and range of one plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaneRate {
    /// Learning rate; 0 leaves the plane and its moments unchanged.
    pub rate: f64,
    /// Range to which the parameter is clamped after its step.
    pub range: Option<(f64, f64)>,
}

impl PlaneRate {
    /// A rate for a plane without bounds.
    pub fn free(rate: f64) -> Self {
        PlaneRate { rate, range: None }
    }

    /// The plane with `factor` times its rate.
    pub fn times(&self, factor: f64) -> Self {
        PlaneRate { rate: factor * self.rate, range: self.range }
    }

    /// The rate of a plane of a group of parameters, with that plane's range.
    pub fn of(group: &Group, plane: usize, rate: f64) -> Self {
        let range = match (group.array, plane) {
            (Array::Lobes, LOBE_WIDTH) => Some(WIDTH_RANGE),
            (Array::Lobes, LOBE_SHARPNESS) => Some(SHARPNESS_RANGE),
            // The third number of a lobe's shape, which comes behind its color.
            (Array::Sh, _) if group.name == color::of(color::BETAS).group && plane % 6 == 2 => Some(B_RANGE),
            _ => None,
        };
        PlaneRate { rate, range }
    }
}

/// Lengths at which a quaternion or a lobe's direction is not normalised; see `glsl/shared/unit.glsl`.
const LENGTHS: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// Normalises a vector before it steps, and returns its former length too; `None` if the length is from
/// 0.01 to 100. A vector without a direction is returned unchanged, with length 0.
pub fn unit_before_step<const N: usize>(vector: [f64; N]) -> Option<([f64; N], f64)> {
    let largest = vector.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
    if !(FLOAT_MIN..=FLOAT_MAX).contains(&largest) {
        return Some((vector, 0.0));
    }
    let length = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
    (!LENGTHS.contains(&length)).then(|| (vector.map(|v| v / length), length))
}

/// Steps one parameter and its moments. `correct` is 1 − β^t of both moments after step t, or 1 for no
/// correction.
pub fn adam_one(
    param: &mut f64,
    gradient: f64,
    [first, second]: [&mut f64; 2],
    plane: &PlaneRate,
    [correct1, correct2]: [f64; 2],
) {
    let g = gradient.clamp(-GRADIENT_MAX, GRADIENT_MAX);
    let m = BETA1 * *first + (1.0 - BETA1) * g;
    let v = BETA2 * *second + (1.0 - BETA2) * g * g;
    (*first, *second) = (m, v);
    *param -= plane.rate * (m / correct1) / ((v / correct2).sqrt() + EPSILON);
    if let Some((low, high)) = plane.range {
        *param = param.max(low).min(high);
    }
}

/// Decay of the moving average of a curvature.
pub const CURVATURE_DECAY: f64 = 0.95;
/// Most learning rates that a Newton step moves.
pub const NEWTON_REACH: f64 = 3.0;

/// Updates an estimated curvature from a probe's `gradient` (method, section 5).
pub fn curvature_one(gradient: f64, curvature: &mut f64) {
    let g = gradient.clamp(-GRADIENT_MAX, GRADIENT_MAX);
    // The first probe initialises the average.
    let before = if *curvature > 0.0 { *curvature } else { g * g };
    *curvature = CURVATURE_DECAY * before + (1.0 - CURVATURE_DECAY) * g * g;
}

/// Steps one parameter `part` of the way to the point where the mean gradient would be 0.
pub fn newton_one(param: &mut f64, gradient: f64, first: &mut f64, curvature: f64, plane: &PlaneRate, part: f64) {
    let g = gradient.clamp(-GRADIENT_MAX, GRADIENT_MAX);
    *first = BETA1 * *first + (1.0 - BETA1) * g;
    if curvature > 0.0 {
        let bound = NEWTON_REACH * plane.rate;
        *param -= (part * *first / curvature).clamp(-bound, bound);
    }
    if let Some((low, high)) = plane.range {
        *param = param.max(low).min(high);
    }
}

/// Packs both moments into one word, rounded by `dither`; see `glsl/shared/packed.glsl`.
pub fn pack_moments([first, second]: [f64; 2], dither: u32) -> u32 {
    let second = ((second as f32).to_bits() + (dither & 0x7fff)) >> 15;
    second << 16 | ((first as f32).to_bits() + (dither >> 16)) >> 16
}

/// Unpacks the first and second moment.
pub fn unpack_moments(word: u32) -> [f64; 2] {
    [word << 16, word >> 16 << 15].map(|bits| f64::from(f32::from_bits(bits)))
}

/// Bits of a float32 that a first moment loses when three share a word; leading bits of the smallest packed
/// value.
const BAND_CUT: u32 = 19;
const BAND_LEAST: u32 = 99 << 4;

/// Packs three first moments into one word, divided by the roots of their curvatures and rounded by `dither`.
pub fn pack_firsts(first: [f64; 3], curvature: [f64; 3], dither: u32) -> u32 {
    let one = |c: usize| {
        let root = curvature[c].sqrt();
        let by = if root > 0.0 { (first[c] / root) as f32 } else { 0.0 };
        let drawn = (dither >> (10 * c) & 0x3ff) << (BAND_CUT - 10);
        let size = (by.abs().to_bits() + drawn) >> BAND_CUT;
        let size = size.clamp(BAND_LEAST, BAND_LEAST + 0x1ff) - BAND_LEAST;
        (size | u32::from(by < 0.0) << 9) << (10 * c)
    };
    one(0) | one(1) | one(2)
}

/// Unpacks a word of [`pack_firsts`].
pub fn unpack_firsts(word: u32, curvature: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| {
        let code = word >> (10 * c);
        let size = match code & 0x1ff {
            0 => 0.0,
            size => f64::from(f32::from_bits((size + BAND_LEAST) << BAND_CUT)),
        };
        curvature[c].sqrt() * if code & 0x200 != 0 { -size } else { size }
    })
}

/// Random bits by which the moments of plane `plane` of Gaussian `number` are rounded in step `step`.
pub fn dither_of(number: u32, plane: u32, step: u32) -> u32 {
    let x = number.wrapping_add(plane.wrapping_mul(0x9e37_79b9)).wrapping_add(step.wrapping_mul(0x85eb_ca6b));
    let x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    let x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    x ^ x >> 16
}

/// Steps the first `count` elements of every plane. All four arrays are planes × `stride`.
///
/// `bias_step`: number of this step, from 1, for bias correction; none for no correction (⚖ section 5).
/// `touched`: only these elements step, moments included (SparseAdam); none for all.
#[allow(clippy::too_many_arguments)]
pub fn adam(
    params: &mut [f64],
    grads: &[f64],
    first_moments: &mut [f64],
    second_moments: &mut [f64],
    stride: usize,
    count: usize,
    planes: &[PlaneRate],
    bias_step: Option<u32>,
    touched: Option<&[bool]>,
) {
    let correct = bias_step.map_or([1.0; 2], |step| [BETA1, BETA2].map(|beta| 1.0 - beta.powf(step as f64)));
    for (p, plane) in planes.iter().enumerate() {
        if plane.rate == 0.0 {
            continue;
        }
        for i in 0..count {
            if touched.is_some_and(|touched| !touched[i]) {
                continue;
            }
            let at = p * stride + i;
            let moments = [&mut first_moments[at], &mut second_moments[at]];
            adam_one(&mut params[at], grads[at], moments, plane, correct);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(bias: bool, gradients: &[f64]) -> f64 {
        let (mut p, mut m, mut v) = ([0.0], [0.0], [0.0]);
        for (k, &g) in gradients.iter().enumerate() {
            let step = bias.then_some(k as u32 + 1);
            adam(&mut p, &[g], &mut m, &mut v, 1, 1, &[PlaneRate::free(0.01)], step, None);
        }
        p[0]
    }

    /// On a parabola of any curvature: the minimum is reached in the time that `part` implies, no step
    /// exceeds the bound, and the curvature is the mean over the probes.
    #[test]
    fn newtons_steps_go_to_the_minimum_whatever_the_curvature() {
        for bend in [1e-12, 1.0, 1e9] {
            let (mut x, mut m, mut d) = (4.0, 0.0, 0.0);
            let plane = PlaneRate::free(0.1);
            newton_one(&mut x, 4.0 * bend, &mut m, d, &plane, 0.05);
            assert_eq!(x, 4.0, "nothing is known yet");
            for step in 0..400u32 {
                let sign = if step % 3 == 0 { 1.2f64 } else { -0.884_433_277 };
                curvature_one(sign * f64::sqrt(bend), &mut d);
                let before = x;
                newton_one(&mut x, bend * before, &mut m, d, &plane, 0.05);
                assert!((x - before).abs() <= NEWTON_REACH * plane.rate * 1.000_001);
            }
            // 1.2² and twice 0.8844² are 1 on average, and the average forgets in 20 probes.
            assert!((d / bend - 1.0).abs() < 0.05 && x.abs() < 1e-4, "{bend}: {x}, {d}");
        }
    }

    /// A second moment that moves by less than the bits cut off, with gradients that stop and gradients that
    /// start.
    #[test]
    fn packed_moments_are_right_on_average() {
        let gradient = |i: u32, step: u32| match step {
            0..2000 => f64::from(dither_of(i, 7, step)) / f64::from(u32::MAX) - 0.3,
            _ => 0.0,
        };
        let (numbers, mut ratios) = (64, [0.0; 2]);
        for i in 0..numbers {
            let (mut word, [mut m, mut v]) = (0, [0.0; 2]);
            for step in 0..3000 {
                let [mut kept_m, mut kept_v] = unpack_moments(word);
                adam_one(&mut 0.0, gradient(i, step), [&mut m, &mut v], &PlaneRate::free(0.0), [1.0; 2]);
                adam_one(&mut 0.0, gradient(i, step), [&mut kept_m, &mut kept_v], &PlaneRate::free(0.0), [1.0; 2]);
                word = pack_moments([kept_m, kept_v], dither_of(i, 0, step));
                let [kept_m, kept_v] = unpack_moments(word);
                // A draw moves the second moment by 2^-8 / √6 of itself at most (deviation), and it forgets
                // in 1000 steps: √500 of that is 3.6 %. The bound is five of these, as steps and numbers are
                // many. The first moment, 0.7 at most, moves by 2^-7 / √6 of itself and forgets in 10: 2.3 of
                // that, and five of these.
                assert!((kept_v / v - 1.0).abs() < 0.18, "step {step}: {kept_v} for {v}");
                assert!((kept_m - m).abs() < 0.026, "step {step}: {kept_m} for {m}");
                for (ratio, at) in ratios.iter_mut().zip([1999, 2999]) {
                    *ratio += if step == at { kept_v / v / f64::from(numbers) } else { 0.0 };
                }
            }
        }
        // The mean of 64 has an eighth of the deviation.
        assert!(ratios.iter().all(|ratio| (ratio - 1.0).abs() < 4.0 * 0.036 / 8.0), "{ratios:?}");
        assert_eq!(unpack_moments(pack_moments([0.0; 2], u32::MAX)), [0.0; 2]);
    }

    /// From far below its curvature's root to beyond it, a first moment is preserved on average, to a
    /// sixteenth of itself in each draw.
    #[test]
    fn three_first_moments_in_a_word_are_right_on_average() {
        let curvature = [1e-18, 4.0, 9e6];
        for by in [-12.0, 3e-7, 0.0007, -0.9] {
            let first = curvature.map(|d: f64| by * d.sqrt());
            let draws = 4096;
            let mut mean = [0.0; 3];
            for draw in 0..draws {
                let kept = unpack_firsts(pack_firsts(first, curvature, dither_of(draw, 3, 0)), curvature);
                for c in 0..3 {
                    assert!((kept[c] / first[c] - 1.0).abs() <= 1.0 / 16.0, "{by}: {kept:?}");
                    mean[c] += kept[c] / first[c] / f64::from(draws);
                }
            }
            // A draw is off by a thirty-second at most (deviation), and their mean by a 64th of that; four of these.
            assert!(mean.iter().all(|mean| (mean - 1.0).abs() < 4.0 / 32.0 / 64.0), "{by}: {mean:?}");
        }
        // Larger values are clamped to the largest code, and an unknown curvature gives 0.
        let kept = unpack_firsts(pack_firsts([1e9, -1e9, 1.0], [1.0, 1.0, 0.0], 77), [1.0, 1.0, 0.0]);
        assert_eq!(kept, [15.5, -15.5, 0.0]);
    }

    /// The closed form Σ of the moments: m_n = (1 − β1) Σ β1^(n−k) g_k.
    #[test]
    fn the_moments_are_the_weighted_sums() {
        let gradients: [f64; 4] = [0.3, -1.0, 2.0, 0.1];
        for bias in [false, true] {
            let mut expected = 0.0;
            for n in 1..=4 {
                let sum = |beta: f64, power: i32| {
                    let part = |k: usize| (1.0 - beta) * beta.powi((n - 1 - k) as i32) * gradients[k].powi(power);
                    (0..n).map(part).sum::<f64>() / if bias { 1.0 - beta.powi(n as i32) } else { 1.0 }
                };
                expected -= 0.01 * sum(0.9, 1) / (sum(0.999, 2).sqrt() + 1e-15);
            }
            assert!((run(bias, &gradients) - expected).abs() < 1e-14);
        }
    }
}
