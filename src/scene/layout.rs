//! Where the parameters of a Gaussian lie: the host's side of `glsl/shared/model.glsl`, from which the numbers come. Models on
//! the device, the float64 twins and the tests all go by planes through here.

use std::ops::Range;

use super::{Gaussians, Lobes};
use crate::{
    gpu::f16,
    stages::constants::{betas, model},
};

/// What stands in the place of a degree of harmonics, 0 to 3, where colours are spherical betas (method, section 1).
pub const BETAS: u32 = betas::BETAS;
/// Lobes of light that such a Gaussian has.
pub const BETA_LOBES: usize = betas::BETA_LOBES as usize;

/// First plane of the mean, x, y and z: scene units.
pub const MEAN: usize = model::MEAN as usize;
/// First plane of the three scales' natural logarithms.
pub const LOG_SCALE: usize = model::LOG_SCALE as usize;
/// First plane of the quaternion, w, x, y and z, of any length.
pub const QUAT: usize = model::QUAT as usize;
/// Plane of the opacity's logit.
pub const OPACITY: usize = model::OPACITY as usize;
/// Planes of geometry in all.
pub const GEOMETRY_PLANES: usize = model::GEOMETRY_PLANES as usize;
/// First plane of the lobe's direction, x, y and z, of any length.
pub const LOBE_DIRECTION: usize = model::LOBE_DIRECTION as usize;
/// Plane of T.
pub const LOBE_WIDTH: usize = model::LOBE_WIDTH as usize;
/// Plane of β.
pub const LOBE_SHARPNESS: usize = model::LOBE_SHARPNESS as usize;
/// Planes of a lobe in all.
pub const LOBE_PLANES: usize = model::LOBE_PLANES as usize;

/// Quads of `planes` planes: four lie together.
pub const fn quads(planes: usize) -> usize {
    planes.div_ceil(4)
}

/// Bytes that `planes` planes of a Gaussian take on the device: whole quads.
pub const fn bytes(planes: usize) -> u64 {
    (size_of::<[f32; 4]>() * quads(planes)) as u64
}

/// Where plane p of a place lies among the numbers of a page of `stride` places.
pub const fn at(p: usize, stride: usize, place: usize) -> usize {
    4 * (p / 4 * stride + place) + p % 4
}

/// A page of quads from the values of `planes` planes by plane and place, of the places below `count` of `stride`; 0 elsewhere.
pub fn page(planes: usize, stride: usize, count: usize, value: impl Fn(usize, usize) -> f32) -> Vec<[f32; 4]> {
    let mut page = vec![[0.0; 4]; quads(planes) * stride];
    for p in 0..planes {
        (0..count).for_each(|place| page[p / 4 * stride + place][p % 4] = value(p, place));
    }
    page
}

/// Planes of such a page, one after the other.
pub fn planes(page: &[[f32; 4]], planes: usize, stride: usize) -> impl Iterator<Item = f32> + '_ {
    (0..planes).flat_map(move |p| page[p / 4 * stride..][..stride].iter().map(move |quad| quad[p % 4]))
}

/// Coefficients of spherical harmonics up to `degree`, or those of [`BETAS`].
pub const fn coefficients(degree: u32) -> usize {
    if degree == BETAS { 1 + 2 * BETA_LOBES } else { ((degree + 1) * (degree + 1)) as usize }
}

/// What there is to show of colours of degree `stored` where `degree` is asked for. Betas have all or, of degree 0, their constant.
pub const fn shown(degree: u32, stored: u32) -> u32 {
    match (degree, stored) {
        (1.., BETAS) => BETAS,
        _ if degree < stored => degree,
        _ => stored,
    }
}

/// All that can be shown of colours of degree `stored`.
pub fn degrees(stored: u32) -> Vec<u32> {
    if stored == BETAS { vec![0, BETAS] } else { (0..=stored).collect() }
}

/// For messages and tables.
pub fn colour_name(degree: u32) -> String {
    if degree == BETAS { "spherical betas".into() } else { format!("SH degree {degree}") }
}

/// Planes of `sh`: coefficient k of channel c is plane 3k + c.
pub const fn sh_planes(degree: u32) -> usize {
    3 * coefficients(degree)
}

/// The arrays that planes lie in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Array {
    /// Mean, scales, rotation, opacity.
    Geometry,
    /// Coefficients of spherical harmonics, or of betas.
    Sh,
    /// Of the supplement only.
    Lobes,
}

/// Parameters of one kind: what has one unit, one learning rate and one bound of error.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// For messages and tables.
    pub name: &'static str,
    /// Where they lie.
    pub array: Array,
    /// Of that array.
    pub planes: Range<usize>,
}

/// The group of what betas have beyond the constant.
pub const BETA_GROUP: &str = "betas";

/// All groups of a scene of that degree, in the order of the learning rates.
pub fn groups(degree: u32) -> [Group; 9] {
    let group = |name, array, planes| Group { name, array, planes };
    [
        group("mean", Array::Geometry, MEAN..MEAN + 3),
        group("log scale", Array::Geometry, LOG_SCALE..LOG_SCALE + 3),
        group("quaternion", Array::Geometry, QUAT..QUAT + 4),
        group("opacity", Array::Geometry, OPACITY..OPACITY + 1),
        group("DC", Array::Sh, 0..3),
        group(if degree == BETAS { BETA_GROUP } else { "SH" }, Array::Sh, 3..sh_planes(degree)),
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

/// Plane p of the harmonics of Gaussian i; 0 for bands that it does not have.
pub fn sh(gaussians: &Gaussians, i: usize, p: usize) -> f32 {
    let stored = gaussians.sh_coefficients();
    if p / 3 < stored { gaussians.sh[i * stored + p / 3][p % 3] } else { 0.0 }
}

/// Two halves in a word, of planes 2p (low) and 2p + 1 (high), as `HALF_SH` of the model's kernels reads them. What a half cannot
/// hold becomes the largest that it can.
pub fn pack_halves(low: f32, high: f32) -> f32 {
    let half = |v: f32| f16::from_f32(v.clamp(-65504.0, 65504.0)).to_bits();
    f32::from_bits(u32::from(half(low)) | u32::from(half(high)) << 16)
}

/// The two values of a word that [`pack_halves`] made, low half first.
pub fn halves(word: f32) -> [f32; 2] {
    [0, 16].map(|shift| f16::from_bits((word.to_bits() >> shift) as u16).to_f32())
}

/// The page of what a page of such words says: two quads for each.
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
