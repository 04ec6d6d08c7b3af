//! Layout of a Gaussian's parameters: the host's side of `glsl/shared/model.glsl`, which defines the numbers.
//! Models on the device, the float64 twins and the tests all access planes through this module.

use std::{num::NonZero, ops::Range, thread};

use super::{Gaussians, Lobes, color};
use crate::{gpu::f16, stages::constants::model};

/// First plane of the mean, x, y and z: scene units.
pub const MEAN: usize = model::MEAN as usize;
/// First plane of the three scales' natural logarithms.
pub const LOG_SCALE: usize = model::LOG_SCALE as usize;
/// Number of the last Newton step, from 1: a plane of the first moments only.
pub const LAST_STEP: usize = model::LAST_STEP as usize;
/// First plane of the quaternion, w, x, y and z, of any length.
pub const QUAT: usize = model::QUAT as usize;
/// Plane of the opacity's logit.
pub const OPACITY: usize = model::OPACITY as usize;
/// Number of planes of geometry.
pub const GEOMETRY_PLANES: usize = model::GEOMETRY_PLANES as usize;
/// Number of planes of geometry at half width: the mean, the opacity's logit, and four words with rotation
/// and scales.
pub const HALF_GEOMETRY_PLANES: usize = model::HALF_GEOMETRY_PLANES as usize;
/// First plane of the lobe's direction, x, y and z, of any length.
pub const LOBE_DIRECTION: usize = model::LOBE_DIRECTION as usize;
/// Plane of T.
pub const LOBE_WIDTH: usize = model::LOBE_WIDTH as usize;
/// Plane of β.
pub const LOBE_SHARPNESS: usize = model::LOBE_SHARPNESS as usize;
/// Number of planes of a lobe.
pub const LOBE_PLANES: usize = model::LOBE_PLANES as usize;

/// Minimum number of places that a thread fills.
const PLACES_AT_ONCE: usize = 4096;

/// Quads that hold `planes` planes: four are interleaved.
pub const fn quads(planes: usize) -> usize {
    planes.div_ceil(4)
}

/// Bytes that `planes` planes of a Gaussian take on the device: whole quads.
pub const fn bytes(planes: usize) -> u64 {
    (size_of::<[f32; 4]>() * quads(planes)) as u64
}

/// Index of plane p of a place among the numbers of a page of `stride` places.
pub const fn at(p: usize, stride: usize, place: usize) -> usize {
    4 * (p / 4 * stride + place) + p % 4
}

/// Makes a page of quads from the values of `planes` planes by plane and place, for places below `count` of
/// `stride`; 0 elsewhere.
pub fn page(planes: usize, stride: usize, count: usize, value: impl Fn(usize, usize) -> f32 + Sync) -> Vec<[f32; 4]> {
    let mut page = vec![[0.0; 4]; quads(planes) * stride];
    for (q, quads) in page.chunks_mut(stride.max(1)).enumerate() {
        let quad = |place| [0, 1, 2, 3].map(|k| if 4 * q + k < planes { value(4 * q + k, place) } else { 0.0 });
        fill(&mut quads[..count], quad);
    }
    page
}

/// Writes the value of each index, by as many threads as are worth it: plain ones, because the crate has no rayon without default features.
fn fill<T: Send>(out: &mut [T], value: impl Fn(usize) -> T + Sync) {
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    let (value, piece) = (&value, out.len().div_ceil(threads).max(PLACES_AT_ONCE));
    let several = out.len() > piece;
    thread::scope(|scope| {
        for (k, some) in out.chunks_mut(piece).enumerate() {
            let mut work = move || some.iter_mut().enumerate().for_each(|(i, to)| *to = value(k * piece + i));
            if several {
                scope.spawn(work);
            } else {
                work();
            }
        }
    });
}

/// Planes of a page, one after the other.
pub fn planes(page: &[[f32; 4]], planes: usize, stride: usize) -> impl Iterator<Item = f32> + '_ {
    (0..planes).flat_map(move |p| page[p / 4 * stride..][..stride].iter().map(move |quad| quad[p % 4]))
}

/// Number of RGB coefficients of a [color model](color::MODELS).
pub fn coefficients(degree: u32) -> usize {
    color::of(degree).coefficients
}

/// Planes of `sh`: coefficient k of channel c is plane 3k + c.
pub fn sh_planes(degree: u32) -> usize {
    3 * coefficients(degree)
}

/// The arrays that hold the planes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Array {
    /// Mean, scales, rotation, opacity.
    Geometry,
    /// Coefficients of color.
    Sh,
    /// Lobes of the supplement.
    Lobes,
}

/// Parameters of one kind, with one unit, one learning rate and one bound of error.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Its name, for messages and tables.
    pub name: &'static str,
    /// The array that holds them.
    pub array: Array,
    /// Their planes in that array.
    pub planes: Range<usize>,
}

/// All groups of a scene of that degree, in the order of the learning rates.
pub fn groups(degree: u32) -> [Group; 9] {
    let group = |name, array, planes| Group { name, array, planes };
    [
        group("mean", Array::Geometry, MEAN..MEAN + 3),
        group("log scale", Array::Geometry, LOG_SCALE..LOG_SCALE + 3),
        group("quaternion", Array::Geometry, QUAT..QUAT + 4),
        group("opacity", Array::Geometry, OPACITY..OPACITY + 1),
        group("DC", Array::Sh, 0..3),
        group(color::of(degree).group, Array::Sh, 3..sh_planes(degree)),
        group("lobe direction", Array::Lobes, LOBE_DIRECTION..LOBE_WIDTH),
        group("lobe width", Array::Lobes, LOBE_WIDTH..LOBE_SHARPNESS),
        group("lobe sharpness", Array::Lobes, LOBE_SHARPNESS..LOBE_PLANES),
    ]
}

/// The geometry of Gaussian i, plane by plane.
pub fn geometry(gaussians: &Gaussians, i: usize) -> [f32; GEOMETRY_PLANES] {
    let mut planes = [0.0; GEOMETRY_PLANES];
    planes[MEAN..MEAN + 3].copy_from_slice(&gaussians.means[i]);
    planes[LOG_SCALE..LOG_SCALE + 3].copy_from_slice(&gaussians.log_scales[i]);
    planes[QUAT..QUAT + 4].copy_from_slice(&gaussians.quats[i]);
    planes[OPACITY] = gaussians.opacities[i];
    planes
}

/// The lobe of supplementary Gaussian j, plane by plane.
pub fn lobe(lobes: &Lobes, j: usize) -> [f32; LOBE_PLANES] {
    let mut planes = [0.0; LOBE_PLANES];
    planes[LOBE_DIRECTION..LOBE_WIDTH].copy_from_slice(&lobes.directions[j]);
    planes[LOBE_WIDTH] = lobes.widths[j];
    planes[LOBE_SHARPNESS] = lobes.sharpness[j];
    planes
}

/// Plane p of the harmonics of Gaussian i; 0 for bands that it lacks.
pub fn sh(gaussians: &Gaussians, i: usize, p: usize) -> f32 {
    let stored = gaussians.sh_coefficients();
    if p / 3 < stored { gaussians.sh[i * stored + p / 3][p % 3] } else { 0.0 }
}

/// Packs geometry at half width, as read by kernels with `HALF_WIDTH` (`glsl/shared/model.glsl`). The mean
/// and the opacity keep their bits. Components of the unit quaternion are exact to 2e-6 and scales to 8e-6 of
/// themselves; log scales are clamped to ±32. If projection would cull a Gaussian, for a quaternion without a
/// direction or a log scale that is NaN or +∞, its opacity becomes NaN.
pub fn pack_geometry(planes: [f32; GEOMETRY_PLANES]) -> [f32; HALF_GEOMETRY_PLANES] {
    let quat: [f64; 4] = std::array::from_fn(|k| planes[QUAT + k].into());
    let scales: [f64; 3] = std::array::from_fn(|k| planes[LOG_SCALE + k].into());
    let missing = (1..4).fold(0, |best, k| if quat[k].abs() > quat[best].abs() { k } else { best });
    // The same test as `to_unit` of the kernels.
    let turned = quat.iter().all(|q| q.is_finite()) && quat[missing].abs() >= f32::MIN_POSITIVE.into();
    let drawn = turned && scales.iter().all(|&s| s < f64::INFINITY);
    let length = quat.iter().map(|q| q * q).sum::<f64>().sqrt().copysign(quat[missing]);
    let step = f64::from(model::ROTATION_STEP) * length;
    let (bits, zero) = (model::ROTATION_LOW_BITS, f64::from(model::ROTATION_ZERO));
    let mut packed = [0.0; HALF_GEOMETRY_PLANES];
    packed[MEAN..MEAN + 3].copy_from_slice(&planes[MEAN..MEAN + 3]);
    // guard: what half width cannot say is not drawn
    packed[OPACITY] = if drawn { planes[OPACITY] } else { f32::NAN };
    let mut last = (missing as u32) << (3 * bits);
    for (k, from) in (0..4).filter(|&k| k != missing).enumerate() {
        let part = ((quat[from] / step).round() + zero).clamp(1.0, 2.0 * zero - 1.0) as u32;
        last |= (part & ((1 << bits) - 1)) << (k as u32 * bits);
        let most = f64::from(i32::MAX >> bits);
        // guard: log scales of half width
        let scale = (scales[k] / f64::from(model::LOG_SCALE_STEP)).round().clamp(-most - 1.0, most) as i32;
        packed[QUAT + k] = f32::from_bits((scale as u32) << bits | part >> bits);
    }
    packed[QUAT + 3] = f32::from_bits(last);
    packed
}

/// Unpacks the planes of [`pack_geometry`], with a unit quaternion.
pub fn unpack_geometry(packed: [f32; HALF_GEOMETRY_PLANES]) -> [f32; GEOMETRY_PLANES] {
    let words: [u32; 4] = std::array::from_fn(|k| packed[QUAT + k].to_bits());
    let (bits, zero) = (model::ROTATION_LOW_BITS, f64::from(model::ROTATION_ZERO));
    let mut planes = [0.0; GEOMETRY_PLANES];
    planes[..QUAT].copy_from_slice(&packed[..QUAT]);
    let missing = (words[3] >> (3 * bits)) as usize;
    let mut squares = 0.0;
    for (k, to) in (0..4).filter(|&k| k != missing).enumerate() {
        let low = (1 << bits) - 1;
        let part = (words[k] & low) << bits | (words[3] >> (k as u32 * bits)) & low;
        let component = f64::from(model::ROTATION_STEP) * (f64::from(part) - zero);
        squares += component * component;
        planes[QUAT + to] = component as f32;
        planes[LOG_SCALE + k] = (f64::from(model::LOG_SCALE_STEP) * f64::from(words[k] as i32 >> bits)) as f32;
    }
    planes[QUAT + missing] = (1.0 - squares).max(0.0).sqrt() as f32;
    planes
}

/// A page of packed geometry ([`pack_geometry`]), from the values of `GEOMETRY_PLANES` planes, given as to
/// [`page`].
pub fn pack_geometry_page(stride: usize, count: usize, value: impl Fn(usize, usize) -> f32 + Sync) -> Vec<[f32; 4]> {
    let packed = |place| pack_geometry(std::array::from_fn(|p| value(p, place)));
    let mut all = vec![[0.0; HALF_GEOMETRY_PLANES]; count];
    fill(&mut all, packed);
    page(HALF_GEOMETRY_PLANES, stride, count, |p, place| all[place][p])
}

/// Unpacks a page of geometry of half width: to three quads for each Gaussian.
pub fn unpack_geometry_page(quads: &[[f32; 4]], stride: usize) -> Vec<[f32; 4]> {
    let (first, rest) = quads.split_at(stride.min(quads.len()));
    let unpacked = |(a, b): (&[f32; 4], &[f32; 4])| unpack_geometry(std::array::from_fn(|p| [a, b][p / 4][p % 4]));
    let all: Vec<_> = first.iter().zip(rest).map(unpacked).collect();
    page(GEOMETRY_PLANES, stride, all.len(), |p, place| all[place][p])
}

/// Packs two halves into a word, of planes 2p (low) and 2p + 1 (high), as read by kernels with `HALF_WIDTH`.
/// Values beyond a half's range are clamped.
pub fn pack_halves(low: f32, high: f32) -> f32 {
    let half = |v: f32| f16::from_f32(v.clamp(-65504.0, 65504.0)).to_bits();
    f32::from_bits(u32::from(half(low)) | u32::from(half(high)) << 16)
}

/// Unpacks the two values of a word of [`pack_halves`], low half first.
pub fn halves(word: f32) -> [f32; 2] {
    [0, 16].map(|shift| f16::from_bits((word.to_bits() >> shift) as u16).to_f32())
}

/// Unpacks a page of such words: to two quads for each.
pub fn unpack_halves(words: &[[f32; 4]], stride: usize) -> Vec<[f32; 4]> {
    let of = |[low, high]: [f32; 2]| {
        let ([a, b], [c, d]) = (halves(low), halves(high));
        [a, b, c, d]
    };
    let quads = words.chunks(stride.max(1));
    quads.flat_map(|quad| [0, 2].map(|h| quad.iter().map(move |w| of([w[h], w[h + 1]])))).flatten().collect()
}

/// Adds a Gaussian from its planes.
pub fn push(to: &mut Gaussians, geometry: impl Fn(usize) -> f32, sh: impl Fn(usize) -> f32) {
    to.means.push([MEAN, MEAN + 1, MEAN + 2].map(&geometry));
    to.log_scales.push([LOG_SCALE, LOG_SCALE + 1, LOG_SCALE + 2].map(&geometry));
    to.quats.push([QUAT, QUAT + 1, QUAT + 2, QUAT + 3].map(&geometry));
    to.opacities.push(geometry(OPACITY));
    to.sh.extend((0..coefficients(to.sh_degree)).map(|k| [3 * k, 3 * k + 1, 3 * k + 2].map(&sh)));
}

/// Adds a lobe from its planes.
pub fn push_lobe(to: &mut Lobes, lobe: impl Fn(usize) -> f32) {
    to.directions.push([LOBE_DIRECTION, LOBE_DIRECTION + 1, LOBE_DIRECTION + 2].map(&lobe));
    to.widths.push(lobe(LOBE_WIDTH));
    to.sharpness.push(lobe(LOBE_SHARPNESS));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quaternions of any length and sign, each component in turn the largest, and log scales to the ends of
    /// the range. A part is rounded by half a step of 1.35e-6, three of them by 1.2e-6 together. The largest
    /// component, at least 1/2, takes up to 1.7 times that: 2e-6 in all, and twice as much as an angle. Log
    /// scales have steps of 2^-16.
    #[test]
    fn geometry_of_half_width_comes_back() {
        let mut state = 1u32;
        let mut draw = || {
            state = state.wrapping_mul(1664525).wrapping_add(1013904223);
            (f64::from(state) / f64::from(u32::MAX) - 0.5) as f32
        };
        for round in 0..4000 {
            let mut planes: [f32; GEOMETRY_PLANES] = std::array::from_fn(|_| draw());
            let length = [1.0, 1e-30, 1e37, 3.0][round % 4];
            planes[QUAT..QUAT + 4].iter_mut().for_each(|q| *q *= length);
            planes[QUAT + round / 4 % 4] *= if round % 3 == 0 { 100.0f32.min(1e37 / length) } else { 1.0 };
            planes[LOG_SCALE..LOG_SCALE + 3].iter_mut().for_each(|s| *s *= 63.99);
            let back = unpack_geometry(pack_geometry(planes));
            assert_eq!(back[..QUAT], planes[..QUAT]);
            let wide: [f64; 4] = std::array::from_fn(|k| planes[QUAT + k].into());
            let norm = wide.iter().map(|q| q * q).sum::<f64>().sqrt();
            let sign = (0..4).map(|k| wide[k] * f64::from(back[QUAT + k])).sum::<f64>().signum();
            for k in 0..4 {
                let off = f64::from(back[QUAT + k]) - sign * wide[k] / norm;
                assert!(off.abs() < 2e-6, "{planes:?}, {back:?}");
            }
            for k in LOG_SCALE..LOG_SCALE + 3 {
                assert!((back[k] - planes[k]).abs() <= model::LOG_SCALE_STEP / 2.0, "{planes:?}, {back:?}");
            }
            assert_eq!(unpack_geometry(pack_geometry(back))[LOG_SCALE..], back[LOG_SCALE..]);
        }
    }

    #[test]
    fn half_width_keeps_round_numbers_and_the_nearest_it_has() {
        let of = |quat: [f32; 4], scale: f32| {
            let mut planes = [1.0; GEOMETRY_PLANES];
            planes[QUAT..QUAT + 4].copy_from_slice(&quat);
            planes[LOG_SCALE] = scale;
            unpack_geometry(pack_geometry(planes))
        };
        for k in 0..4 {
            let mut unit = [0.0; 4];
            unit[k] = 1.0;
            assert_eq!(of(unit, -4.5)[QUAT..QUAT + 4], unit);
            assert_eq!(of(unit.map(|q| -q), -4.5)[QUAT..QUAT + 4], unit);
            assert_eq!(of(unit, -4.5)[LOG_SCALE], -4.5);
        }
        let unit = [1.0, 0.0, 0.0, 0.0];
        let most = 32.0 - model::LOG_SCALE_STEP;
        for (scale, want) in [(40.0, most), (f32::MAX, most), (-40.0, -32.0), (f32::NEG_INFINITY, -32.0)] {
            assert_eq!((of(unit, scale)[LOG_SCALE], of(unit, scale)[OPACITY]), (want, 1.0));
        }
    }
}
