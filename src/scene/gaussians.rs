//! Gaussians on the host, structure of arrays, in the units of the de-facto PLY layout.

/// Plain 3D Gaussians. All vectors have the same length, but `sh` which holds
/// `len · (sh_degree + 1)²` RGB coefficients, Gaussian-major: `sh[i · K + k]`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gaussians {
    /// Degree of the spherical harmonics, 0 to 3.
    pub sh_degree: u32,
    /// Centres, scene units.
    pub means: Vec<[f32; 3]>,
    /// Natural logarithms of the standard deviations along the local axes.
    pub log_scales: Vec<[f32; 3]>,
    /// Rotations as (w, x, y, z), not normalised.
    pub quats: Vec<[f32; 4]>,
    /// Opacities as logits.
    pub opacities: Vec<f32>,
    /// RGB coefficients; k = 0 is the constant band.
    pub sh: Vec<[f32; 3]>,
}

impl Gaussians {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// Coefficients per Gaussian, (L + 1)².
    pub fn sh_coefficients(&self) -> usize {
        ((self.sh_degree + 1) * (self.sh_degree + 1)) as usize
    }
}

/// The opacity lobes of supplementary Gaussians (method, section 1).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lobes {
    /// Lobe directions d, from the Gaussian to where it is seen best; not normalised.
    pub directions: Vec<[f32; 3]>,
    /// Widths T in [0.01, 1]: the lobe ends at the angle πT.
    pub widths: Vec<f32>,
    /// Sharpness β; the exponent is exp(β).
    pub sharpness: Vec<f32>,
}

/// Supplementary Gaussians: plain ones with a lobe each.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Supplement {
    pub gaussians: Gaussians,
    pub lobes: Lobes,
}

/// A base scene and, once it is augmented, its supplement (which shares the base's SH degree).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scene {
    pub base: Gaussians,
    pub supplement: Option<Supplement>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_of_one_is_not_empty() {
        assert!(Gaussians::default().is_empty());
        assert!(!Gaussians { means: vec![[0.0; 3]], ..Default::default() }.is_empty());
    }
}
