//! Checks the validity of a scene's numbers.

use super::ply_columns::{BASE, NO_LOBES, SUPPLEMENT, columns, number};
use crate::{
    Error, Result,
    scene::{Gaussians, Lobes, Scene, color},
};

/// Range of lobe widths T in the method (section 1).
pub(super) const LOBE_WIDTHS: std::ops::RangeInclusive<f32> = 0.01..=1.0;

/// Replaces a logit of +∞, an opacity of 1: ln 2²⁵, whose opacity is 1 in float32.
const OPAQUE: f32 = 17.328_68;
/// Replaces −∞, as the logit of an opacity of 0 or the logarithm of a size of 0: the logarithm of the
/// smallest normal float32.
const NOTHING: f32 = -87.336_54;

/// Replaces meaningful infinities by numbers that kernels draw the same: logits of ±∞, and log scales of −∞
/// (flat Gaussians).
pub(crate) fn make_finite(scene: &mut Scene) {
    make_finite_part(&mut scene.base);
    scene.supplement.iter_mut().for_each(|supplement| make_finite_part(&mut supplement.gaussians));
}

/// [`make_finite`] for one segment of a scene.
pub(super) fn make_finite_part(gaussians: &mut Gaussians) {
    for logit in gaussians.opacities.iter_mut().filter(|logit| logit.is_infinite()) {
        *logit = if *logit > 0.0 { OPAQUE } else { NOTHING };
    }
    let scales = gaussians.log_scales.as_flattened_mut().iter_mut();
    scales.filter(|scale| **scale == f32::NEG_INFINITY).for_each(|scale| *scale = NOTHING);
}

/// Gaussians that a lenient reader dropped.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Number of dropped base Gaussians; `supplementary` counts the others.
    pub base: usize,
    /// See `base`.
    pub supplementary: usize,
    /// Fault of the first one: element, row and property.
    pub first: Option<String>,
}

/// Checks that a scene could be stored in a file: lists of equal length, finite numbers, rotations and lobes
/// with a direction. For scenes from elsewhere; readers check it already.
///
/// # Errors
/// [`Error::Usage`], naming the fault in PLY's terms: `vertex` is the base, `augmented` the supplement.
pub fn check_scene(scene: &Scene) -> Result<()> {
    check(scene).map_err(|what| Error::Usage(format!("a scene: {what}")))
}

/// Checks lengths, finiteness, rotations and lobes; the error names element, row and property.
pub(super) fn check(scene: &Scene) -> Result<(), String> {
    lengths(scene)?;
    let mut first = faults(BASE, &scene.base, None).next();
    if let Some(supplement) = &scene.supplement {
        first = first.or_else(|| faults(SUPPLEMENT, &supplement.gaussians, Some(&supplement.lobes)).next());
    }
    first.map_or(Ok(()), |(_, fault)| Err(fault))
}

/// Checks lengths and degrees only.
pub(crate) fn lengths(scene: &Scene) -> Result<(), String> {
    check_lengths(BASE, &scene.base)?;
    if let Some(supplement) = &scene.supplement {
        let (n, lobes) = (supplement.gaussians.len(), &supplement.lobes);
        check_lengths(SUPPLEMENT, &supplement.gaussians)?;
        let [base, lobed] = [&scene.base, &supplement.gaussians].map(|part| color::of(part.sh_degree));
        if !base.shares_with(lobed) {
            let (base, lobed) = (base.name, lobed.name);
            return Err(format!("`{BASE}` has {base} and `{SUPPLEMENT}` {lobed}; expected harmonics or betas in both"));
        }
        if [lobes.directions.len(), lobes.widths.len(), lobes.sharpness.len()] != [n; 3] {
            return Err(format!("`{SUPPLEMENT}` has {n} Gaussians but another number of lobes"));
        }
    }
    Ok(())
}

/// Removes invalid rows from a scene with valid lengths.
pub(super) fn drop_faults(scene: &mut Scene) -> Dropped {
    let (base, first) = keep_sound(BASE, &mut scene.base, None);
    let mut dropped = Dropped { base, supplementary: 0, first };
    if let Some(supplement) = &mut scene.supplement {
        let lobes = Some(&mut supplement.lobes);
        let (count, first) = keep_sound(SUPPLEMENT, &mut supplement.gaussians, lobes);
        dropped = Dropped { supplementary: count, first: dropped.first.or(first), ..dropped };
    }
    dropped
}

/// Removes invalid rows; returns their number, and the fault of the first.
fn keep_sound(element: &str, gaussians: &mut Gaussians, lobes: Option<&mut Lobes>) -> (usize, Option<String>) {
    let (mut keep, mut first) = (vec![true; gaussians.len()], None);
    for (row, fault) in faults(element, gaussians, lobes.as_deref()) {
        keep[row] = false;
        first.get_or_insert(fault);
    }
    let k = gaussians.sh_coefficients();
    retain(&mut gaussians.means, &keep, 1);
    retain(&mut gaussians.log_scales, &keep, 1);
    retain(&mut gaussians.quats, &keep, 1);
    retain(&mut gaussians.opacities, &keep, 1);
    retain(&mut gaussians.sh, &keep, k);
    if let Some(Lobes { directions, widths, sharpness }) = lobes {
        retain(directions, &keep, 1);
        retain(widths, &keep, 1);
        retain(sharpness, &keep, 1);
    }
    (keep.iter().filter(|&&keep| !keep).count(), first)
}

/// Keeps the values of some rows, each with `width` values.
fn retain<T>(values: &mut Vec<T>, keep: &[bool], width: usize) {
    let mut i = 0;
    values.retain(|_| {
        i += 1;
        keep[(i - 1) / width]
    });
}

fn check_lengths(element: &str, gaussians: &Gaussians) -> Result<(), String> {
    color::check(gaussians.sh_degree).map_err(|what| format!("`{element}` has {what}"))?;
    let (n, k) = (gaussians.len(), gaussians.sh_coefficients());
    let lengths =
        [gaussians.log_scales.len(), gaussians.quats.len(), gaussians.opacities.len(), gaussians.sh.len() / k];
    if lengths != [n; 4] || gaussians.sh.len() != n * k {
        return Err(format!("`{element}` has {n} means but other numbers of scales, rotations, opacities or SH"));
    }
    Ok(())
}

/// Invalid rows, each with its fault.
fn faults<'a>(
    element: &'a str,
    gaussians: &'a Gaussians,
    lobes: Option<&'a Lobes>,
) -> impl Iterator<Item = (usize, String)> + 'a {
    let columns = columns(gaussians.sh_degree, lobes.is_some());
    let fault = move |row: usize| {
        for (name, place) in &columns {
            // guard: PLY: numbers
            if !number(gaussians, lobes.unwrap_or(&NO_LOBES), row, *place).is_finite() {
                return Some(format!("`{name}` is not a finite number"));
            }
        }
        let quat = gaussians.quats[row];
        // guard: PLY: rotations
        if !has_direction(&quat) {
            return Some(format!("the rotation `rot_0..3` = {quat:?} has no direction"));
        }
        lobe_fault(lobes?, row)
    };
    (0..gaussians.len())
        .filter_map(move |row| Some((row, format!("row {row} of element `{element}`: {}", fault(row)?))))
}

/// Same rule as in the kernels (`to_unit`): any length that float32 holds, except that denormals count as 0.
fn has_direction(finite: &[f32]) -> bool {
    finite.iter().any(|v| v.is_normal())
}

fn lobe_fault(lobes: &Lobes, row: usize) -> Option<String> {
    let direction = lobes.directions[row];
    // guard: PLY: directions
    if !has_direction(&direction) {
        return Some(format!("the lobe direction {direction:?} has no direction"));
    }
    // guard: PLY: widths
    if !LOBE_WIDTHS.contains(&lobes.widths[row]) {
        return Some(format!("`lobe_width` is {}, expected 0.01 to 1", lobes.widths[row]));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Supplement;

    #[test]
    fn infinities_that_mean_something_become_numbers() {
        let infinite = [f32::INFINITY, f32::NEG_INFINITY, 3.0, f32::NAN];
        let mut part = Gaussians {
            opacities: infinite.to_vec(),
            log_scales: vec![[f32::NEG_INFINITY, f32::INFINITY, -1e30]],
            ..Default::default()
        };
        make_finite_part(&mut part);
        let sigmoid = |logit: f32| 1.0 / (1.0 + (-logit).exp());
        let [opaque, gone] = [0, 1].map(|i| sigmoid(part.opacities[i]));
        assert!(opaque == 1.0 && gone.is_normal() && gone < 1.2e-38, "{opaque} {gone}");
        assert!(part.opacities[2] == 3.0 && part.opacities[3].is_nan());
        let [flat, endless, thin] = part.log_scales[0];
        assert!(flat.exp().is_normal() && flat.exp() < 1.2e-38 && endless == f32::INFINITY && thin == -1e30);
    }

    #[test]
    fn lengths_that_do_not_agree_are_named() {
        let one = Gaussians {
            sh_degree: 1,
            means: vec![[0.0; 3]],
            log_scales: vec![[0.0; 3]],
            quats: vec![[1.0, 0.0, 0.0, 0.0]],
            opacities: vec![0.0],
            sh: vec![[0.0; 3]; 4],
        };
        let lobes = Lobes { directions: vec![[1.0; 3]], widths: vec![0.5], sharpness: vec![0.0] };
        let scene = |base: &Gaussians, gaussians: &Gaussians, lobes: &Lobes| {
            let supplement = Supplement { gaussians: gaussians.clone(), lobes: lobes.clone() };
            check(&Scene { base: base.clone(), supplement: Some(supplement), ..Default::default() })
        };
        scene(&one, &one, &lobes).unwrap();
        let short = [
            Gaussians { log_scales: vec![], ..one.clone() },
            Gaussians { quats: vec![], ..one.clone() },
            Gaussians { opacities: vec![], ..one.clone() },
            Gaussians { sh: vec![[0.0; 3]; 5], ..one.clone() },
            Gaussians { sh_degree: color::MODELS.len() as u32, ..one.clone() },
        ];
        for short in &short {
            assert!(scene(short, &one, &lobes).unwrap_err().contains("`vertex`"));
            assert!(scene(&one, short, &lobes).unwrap_err().contains("`augmented`"));
        }
        let short = [
            Lobes { directions: vec![], ..lobes.clone() },
            Lobes { widths: vec![], ..lobes.clone() },
            Lobes { sharpness: vec![], ..lobes.clone() },
        ];
        short.iter().for_each(|short| assert!(scene(&one, &one, short).unwrap_err().contains("number of lobes")));
    }
}
