//! Columns of a 3DGS PLY: their names, their order, and their places in a Gaussian.

use crate::scene::{Gaussians, Lobes, color};

pub(super) const BASE: &str = "vertex";
pub(super) const SUPPLEMENT: &str = "augmented";
pub(super) const LEARNED: &str = "learned";
pub(super) const BANDS: &str = "bands";

/// An empty list, for Gaussians without lobes.
pub(super) static NO_LOBES: Lobes = Lobes { directions: Vec::new(), widths: Vec::new(), sharpness: Vec::new() };

/// One of a Gaussian's numbers.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    Mean(usize),
    /// Coefficient and channel.
    Sh(usize, usize),
    Opacity,
    LogScale(usize),
    Quat(usize),
    Direction(usize),
    Width,
    Sharpness,
}

impl Place {
    /// Whether it is a coefficient beyond the constant one.
    pub(super) fn is_rest(self) -> bool {
        matches!(self, Place::Sh(1.., _))
    }
}

macro_rules! number {
    ($name:ident $(, $mut:tt)?) => {
        /// The number of Gaussian `i`; `lobes` has its lobe, if there is one.
        pub(super) fn $name<'a>(g: &'a $($mut)? Gaussians, lobes: &'a $($mut)? Lobes, i: usize, place: Place) -> &'a $($mut)? f32 {
            let first = i * g.sh_coefficients();
            match place {
                Place::Mean(axis) => &$($mut)? g.means[i][axis],
                Place::Sh(coefficient, channel) => &$($mut)? g.sh[first + coefficient][channel],
                Place::Opacity => &$($mut)? g.opacities[i],
                Place::LogScale(axis) => &$($mut)? g.log_scales[i][axis],
                Place::Quat(part) => &$($mut)? g.quats[i][part],
                Place::Direction(axis) => &$($mut)? lobes.directions[i][axis],
                Place::Width => &$($mut)? lobes.widths[i],
                Place::Sharpness => &$($mut)? lobes.sharpness[i],
            }
        }
    };
}
number!(number);
number!(number_mut, mut);

/// All columns except normals, in the reference trainer's order.
pub(super) fn columns(sh_degree: u32, lobed: bool) -> Vec<(String, Place)> {
    let colors = color::of(sh_degree);
    let beyond = colors.coefficients - 1;
    let rest = (0..3 * beyond).map(|i| {
        let (coefficient, channel) = (colors.ply_place)(i, beyond);
        Place::Sh(coefficient, channel)
    });
    let mut all = axes("", Place::Mean);
    all.extend(numbered("f_dc_", (0..3).map(|channel| Place::Sh(0, channel))));
    all.extend(numbered(colors.ply_prefix, rest));
    all.push(("opacity".into(), Place::Opacity));
    all.extend(numbered("scale_", (0..3).map(Place::LogScale)));
    all.extend(numbered("rot_", (0..4).map(Place::Quat)));
    if lobed {
        all.extend(axes("lobe_", Place::Direction));
        all.extend([("lobe_width".into(), Place::Width), ("lobe_sharpness".into(), Place::Sharpness)]);
    }
    all
}

fn axes(name: &str, place: fn(usize) -> Place) -> Vec<(String, Place)> {
    ["x", "y", "z"].into_iter().enumerate().map(|(i, axis)| (format!("{name}{axis}"), place(i))).collect()
}

fn numbered(name: &str, places: impl Iterator<Item = Place>) -> impl Iterator<Item = (String, Place)> {
    places.enumerate().map(move |(i, place)| (format!("{name}{i}"), place))
}
