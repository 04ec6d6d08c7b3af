//! The table of color models: what differs between degrees of spherical harmonics and other models of view-dependent color.
//!
//! Fields and constants named `sh_degree`, here and in kernels, are indices of [`MODELS`].

use std::f64::consts::TAU;

use crate::stages::constants::betas;

/// Index of spherical betas (method, section 1).
pub const BETAS: u32 = betas::BETAS;
/// Light lobes of a Gaussian whose color is spherical betas.
pub const BETA_LOBES: usize = betas::BETA_LOBES as usize;

/// A model of a Gaussian's color.
#[derive(Debug)]
pub struct ColorModel {
    /// Name for messages and tables.
    pub name: &'static str,
    /// Number of RGB coefficients; the first is the constant.
    pub coefficients: usize,
    /// Degree of the spherical harmonics; `None` for other models.
    pub harmonics: Option<u32>,
    /// Indices of the models that can be rendered from these coefficients, ascending; the last is this model.
    pub parts: &'static [u32],
    /// Name of the parameters beyond the constant.
    pub group: &'static str,
    /// Adam's learning rate of these parameters: 3DGS's, DBS's.
    pub rate: f32,
    /// Whether Newton's steps know the curvature of these parameters.
    pub newton: bool,
    /// Prefix of the PLY properties beyond the constant.
    pub ply_prefix: &'static str,
    /// Returns the coefficient and channel of a PLY property, by its number behind the prefix and the number of coefficients beyond the
    /// constant.
    pub ply_place: fn(usize, usize) -> (usize, usize),
    /// Returns the initial value of coefficient k ≥ 1 of Gaussian i.
    pub initial: fn(usize, usize) -> [f32; 3],
}

/// All color models.
pub static MODELS: [ColorModel; 5] = [
    harmonics("SH degree 0", &[0]),
    harmonics("SH degree 1", &[0, 1]),
    harmonics("SH degree 2", &[0, 1, 2]),
    harmonics("SH degree 3", &[0, 1, 2, 3]),
    ColorModel {
        name: "spherical betas",
        coefficients: 1 + 2 * BETA_LOBES,
        harmonics: None,
        parts: &[0, BETAS],
        group: "betas",
        rate: 2.5e-3,
        newton: false,
        ply_prefix: "sb_params_",
        // A lobe has six numbers: its color, then θ, φ and b.
        ply_place: |i, _| (1 + 2 * (i % BETA_LOBES) + i / BETA_LOBES / 3, i / BETA_LOBES % 3),
        initial: initial_beta,
    },
];

const fn harmonics(name: &'static str, parts: &'static [u32]) -> ColorModel {
    ColorModel {
        name,
        coefficients: parts.len() * parts.len(),
        harmonics: Some(parts.len() as u32 - 1),
        parts,
        group: "SH",
        rate: 2.5e-3 / 20.0,
        newton: true,
        ply_prefix: "f_rest_",
        ply_place: |i, count| (1 + i % count, i / count),
        initial: |_, _| [0.0; 3],
    }
}

/// Directions of lobes cover the sphere evenly, by Roberts's sequence of the plastic number. (DBS draws θ evenly from 0 to π, which puts
/// most lobes near the poles.)
fn initial_beta(i: usize, k: usize) -> [f32; 3] {
    if k % 2 == 1 {
        return [0.0; 3];
    }
    let number = (i * BETA_LOBES + k / 2) as f64;
    let [height, turn] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2].map(|step| (number * step).fract());
    [(1.0 - 2.0 * height).acos() as f32, (TAU * turn) as f32, 0.0]
}

/// Returns the model of an index; the last for an index beyond the table, which [`check`] rejects.
pub fn of(index: u32) -> &'static ColorModel {
    &MODELS[(index as usize).min(MODELS.len() - 1)]
}

/// Returns the index if the table has it.
///
/// # Errors
/// What is wrong with an index beyond the table, and what is expected.
pub fn check(index: u32) -> Result<u32, String> {
    let others = || MODELS.iter().enumerate().filter(|(_, model)| model.harmonics.is_none());
    match (index as usize) < MODELS.len() {
        true => Ok(index),
        false => {
            let others: String = others().map(|(index, model)| format!(", or {index}: {}", model.name)).collect();
            Err(format!("harmonics of degree {index}, expected 0 to 3{others}"))
        }
    }
}

impl ColorModel {
    /// Whether coefficients beyond the constant mean the same in both models.
    pub fn shares_with(&self, other: &ColorModel) -> bool {
        self.group == other.group
    }

    /// Returns the index of the part to render if `index` is asked for: the least that has as much, or all.
    pub fn part(&self, index: u32) -> u32 {
        self.parts_from(index)[0]
    }

    /// Returns the parts to render if `index` or more is asked for, ascending; never empty.
    pub fn parts_from(&self, index: u32) -> &'static [u32] {
        &self.parts[self.parts.partition_point(|&part| part < index).min(self.parts.len() - 1)..]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_model_are_prefixes_of_its_coefficients() {
        for (index, model) in MODELS.iter().enumerate() {
            assert!(model.parts.is_sorted() && model.parts.last() == Some(&(index as u32)), "{}", model.name);
            assert!(model.parts.iter().all(|&part| of(part).coefficients <= model.coefficients), "{}", model.name);
            assert_eq!((model.part(0), model.part(9)), (0, index as u32));
        }
        assert_eq!([MODELS[3].part(2), MODELS[1].part(3), of(BETAS).part(1)], [2, 1, BETAS]);
        assert!(check(BETAS).is_ok() && check(5).is_err_and(|what| what.contains("or 4: spherical betas")));
    }

    #[test]
    fn every_number_has_one_ply_property() {
        for model in &MODELS {
            let (beyond, count) = (model.coefficients - 1, 3 * (model.coefficients - 1));
            let mut places: Vec<_> = (0..count).map(|i| (model.ply_place)(i, beyond)).collect();
            places.sort_unstable();
            places.dedup();
            assert_eq!(places.len(), count, "{}", model.name);
            assert!(places.iter().all(|&(k, channel)| (1..model.coefficients).contains(&k) && channel < 3));
        }
    }
}
