//! Gaussians on the host, structure of arrays, in the units of the de-facto PLY layout.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;

use super::{color, layout};

/// Plain 3D Gaussians. All vectors have the same length, except `sh`, which holds `len · K` RGB coefficients,
/// K = (sh_degree + 1)², Gaussian-major: `sh[i · K + k]`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gaussians {
    /// Degree of the spherical harmonics, 0 to 3, or [`BETAS`](color::BETAS): `sh` has the constant and then, for each lobe, its color and
    /// its θ, φ and b.
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

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// Coefficients per Gaussian: (L + 1)², or those of betas.
    pub fn sh_coefficients(&self) -> usize {
        layout::coefficients(self.sh_degree)
    }

    /// Converts to another [color model](color::MODELS). Harmonics keep their common bands and gain bands of 0; between different models
    /// only the constant is kept.
    pub fn with_degree(self, sh_degree: u32) -> Gaussians {
        if sh_degree == self.sh_degree {
            return self;
        }
        let (old, new) = (self.sh_coefficients(), layout::coefficients(sh_degree));
        let (from, to) = (color::of(self.sh_degree), color::of(sh_degree));
        let kept = if from.shares_with(to) { old } else { 1 };
        let of = |(i, row): (usize, &[[f32; 3]])| {
            let coefficient = |k: usize| if k < kept { row[k] } else { (to.initial)(i, k) };
            (0..new).map(coefficient).collect::<Vec<_>>()
        };
        Gaussians { sh_degree, sh: self.sh.chunks(old).enumerate().flat_map(of).collect(), ..self }
    }

    /// Appends `more`; all get the higher degree of harmonics.
    pub fn append(&mut self, more: Gaussians) {
        let degree = self.sh_degree.max(more.sh_degree);
        *self = std::mem::take(self).with_degree(degree);
        let more = more.with_degree(degree);
        self.means.extend(more.means);
        self.log_scales.extend(more.log_scales);
        self.quats.extend(more.quats);
        self.opacities.extend(more.opacities);
        self.sh.extend(more.sh);
    }

    /// The Gaussians of these numbers, in this order.
    pub fn reordered(&self, order: &[usize]) -> Gaussians {
        let k = self.sh_coefficients();
        Gaussians {
            sh_degree: self.sh_degree,
            means: order.iter().map(|&i| self.means[i]).collect(),
            log_scales: order.iter().map(|&i| self.log_scales[i]).collect(),
            quats: order.iter().map(|&i| self.quats[i]).collect(),
            opacities: order.iter().map(|&i| self.opacities[i]).collect(),
            sh: order.iter().flat_map(|&i| self.sh[i * k..][..k].iter().copied()).collect(),
        }
    }

    /// Number of leading Gaussians with a constant color: all their bands are 0. Other models of color than harmonics have none.
    pub fn constants(&self) -> usize {
        let colors = color::of(self.sh_degree);
        let constant = |row: &&[[f32; 3]]| row[1..].iter().flatten().all(|&value| value == 0.0);
        match colors.harmonics {
            Some(_) => self.sh.chunks(colors.coefficients).take_while(constant).count(),
            None => 0,
        }
    }
}

/// The opacity lobes of supplementary Gaussians (method, section 1).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lobes {
    /// Lobe directions d, from the Gaussian to the eye that sees it best; not normalised.
    pub directions: Vec<[f32; 3]>,
    /// Widths T in [0.01, 1]: the lobe ends at the angle πT.
    pub widths: Vec<f32>,
    /// Sharpness β; the exponent is exp(β).
    pub sharpness: Vec<f32>,
}

/// Supplementary Gaussians, each with a lobe.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Supplement {
    /// Plain Gaussians; their opacities are those in the middle of the lobe.
    pub gaussians: Gaussians,
    /// One lobe for each Gaussian.
    pub lobes: Lobes,
}

/// A base scene and, once it is augmented, its supplement (with the base's SH degree).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Scene {
    /// The part that any viewer shows.
    pub base: Gaussians,
    /// The Gaussians that augmentation added.
    pub supplement: Option<Supplement>,
    /// Whether only some Gaussians of the base have bands: the leading ones whose bands are all 0 ([`Gaussians::constants`]) then take no
    /// memory for them on the device or in a PLY file. Bands of 0 alone do not say so: training begins with them.
    pub mixed: bool,
    /// Origin of the means in world coordinates, scene units. It is not 0 for scenes so far from the world's
    /// origin that float32 cannot hold their means there (georeferenced ones).
    pub origin: DVec3,
}

impl Scene {
    /// Degree of the bands that a Gaussian of the base has at least.
    pub fn plain_degree(&self) -> u32 {
        if self.mixed { 0 } else { self.base.sh_degree }
    }

    /// The scene with means relative to `origin` (world). With the present origin every bit stays the same.
    pub fn around(mut self, origin: DVec3) -> Scene {
        let by = self.origin - origin;
        if by != DVec3::ZERO {
            let supplement = self.supplement.iter_mut().flat_map(|supplement| &mut supplement.gaussians.means);
            for mean in self.base.means.iter_mut().chain(supplement) {
                *mean = (DVec3::from_array(mean.map(f64::from)) + by).as_vec3().to_array();
            }
        }
        self.origin = origin;
        self
    }

    /// Means of base and supplement in the world.
    pub fn world_means(&self) -> impl Iterator<Item = DVec3> {
        let supplement = self.supplement.iter().flat_map(|supplement| &supplement.gaussians.means);
        self.base.means.iter().chain(supplement).map(|mean| self.origin + DVec3::from_array(mean.map(f64::from)))
    }
}

impl Supplement {
    /// The largest opacity, 0 to 1, of Gaussian `i` for any of `eyes` (scene units): σ(logit) times the
    /// lobe's factor (method, section 1).
    pub fn greatest_opacity(&self, i: usize, eyes: &[DVec3]) -> f64 {
        let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let (mean, direction) = (vector(self.gaussians.means[i]), vector(self.lobes.directions[i]));
        let exponent = 2.0 * f64::from(self.lobes.sharpness[i]).exp();
        let factor = |eye: &DVec3| {
            let half = 0.5 * direction.angle_between(*eye - mean) / f64::from(self.lobes.widths[i]);
            if half < FRAC_PI_2 { half.cos().powf(exponent) } else { 0.0 }
        };
        let most = eyes.iter().map(factor).fold(0.0, f64::max);
        most / (1.0 + (-f64::from(self.gaussians.opacities[i])).exp())
    }

    /// Keeps the Gaussians for which `keep` returns true, in their order.
    pub fn retain(&mut self, keep: impl FnMut(usize) -> bool) {
        let kept: Vec<bool> = (0..self.gaussians.len()).map(keep).collect();
        fn only<T>(values: &mut Vec<T>, kept: &[bool]) {
            let each = values.len() / kept.len().max(1);
            let mut at = 0;
            values.retain(|_| {
                at += 1;
                kept[(at - 1) / each]
            });
        }
        let (g, l) = (&mut self.gaussians, &mut self.lobes);
        only(&mut g.means, &kept);
        only(&mut g.log_scales, &kept);
        only(&mut g.quats, &kept);
        only(&mut g.opacities, &kept);
        only(&mut g.sh, &kept);
        only(&mut l.directions, &kept);
        only(&mut l.widths, &kept);
        only(&mut l.sharpness, &kept);
    }
}

#[cfg(test)]
mod tests {
    use super::{super::color::BETAS, *};

    #[test]
    fn bands_come_and_go() {
        let one = Gaussians { sh_degree: 1, sh: (0..8).map(|k| [k as f32; 3]).collect(), ..Default::default() };
        let none = one.clone().with_degree(0);
        assert_eq!((none.sh_degree, &none.sh[..]), (0, &[[0.0; 3], [4.0; 3]][..]));
        let two = one.clone().with_degree(2);
        assert_eq!((two.sh.len(), two.sh[3], two.sh[4], two.sh[9]), (18, [3.0; 3], [0.0; 3], [4.0; 3]));
        assert_eq!(two.with_degree(1), one);
        let betas = one.clone().with_degree(BETAS);
        let k = betas.sh_coefficients();
        assert_eq!((betas.sh.len(), betas.sh[0], betas.sh[k], betas.sh[1]), (2 * k, [0.0; 3], [4.0; 3], [0.0; 3]));
        assert_eq!(betas.clone().with_degree(1), one.with_degree(0).with_degree(1));
        assert_eq!(betas.clone().with_degree(BETAS), betas);
    }

    /// The mean of a thousand random directions is 1/√1000 long; these are spread more evenly.
    #[test]
    fn lobes_of_betas_begin_in_all_directions() {
        let of = |n: usize| {
            let [theta, phi, b] = (color::of(BETAS).initial)(n / 2, 2 + n % 2 * 2).map(f64::from);
            assert_eq!(b, 0.0);
            DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
        };
        let mean = (0..1000).map(of).sum::<DVec3>() / 1000.0;
        assert!(mean.length() < 0.01, "{mean}");
        let squares = (0..1000).map(|n| of(n) * of(n)).sum::<DVec3>() / 1000.0;
        assert!((squares - 1.0 / 3.0).abs().max_element() < 0.01, "{squares}");
    }

    #[test]
    fn what_no_eye_sees_goes_and_the_rest_keeps_its_order() {
        let gaussians = Gaussians {
            sh_degree: 1,
            means: vec![[0.0; 3]; 3],
            log_scales: vec![[1.0; 3], [2.0; 3], [3.0; 3]],
            quats: vec![[1.0, 0.0, 0.0, 0.0]; 3],
            opacities: vec![3f32.ln(); 3],
            sh: (0..12).map(|k| [k as f32; 3]).collect(),
        };
        // Toward the eye at a length other than 1, sideways, and half of the support away.
        let directions = vec![[0.0, 0.0, 3.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0]];
        let lobes = Lobes { directions, widths: vec![0.4, 0.4, 0.5], sharpness: vec![2f32.ln(), 2f32.ln(), 0.0] };
        let mut all = Supplement { gaussians, lobes };
        let eyes = [DVec3::Z * 2.0, DVec3::NEG_Z];
        // ψ/2 = (π/4)/0.5/2 = π/4, whose cosine to the power of 2 e^β = 2 is 1/2; times 3/4.
        for (i, expected) in [0.75, 0.0, 0.375].into_iter().enumerate() {
            assert!((all.greatest_opacity(i, &eyes) - expected).abs() < 1e-7, "{i}");
        }
        assert_eq!(all.greatest_opacity(0, &[]), 0.0);
        let opacities = [0, 1, 2].map(|i| all.greatest_opacity(i, &eyes));
        all.retain(|i| opacities[i] > 0.1);
        assert_eq!(all.gaussians.log_scales, [[1.0; 3], [3.0; 3]]);
        assert_eq!(all.lobes.widths, [0.4, 0.5]);
        assert_eq!(
            all.gaussians.sh.iter().map(|c| c[0]).collect::<Vec<_>>(),
            [0.0, 1.0, 2.0, 3.0, 8.0, 9.0, 10.0, 11.0]
        );
    }

    #[test]
    fn a_scene_around_another_origin_stands_where_it_stood() {
        let base = Gaussians { means: vec![[1.5, -0.0, 2.0]], ..Default::default() };
        let supplement = Supplement { gaussians: base.clone(), ..Default::default() };
        let utm = DVec3::new(5e5, 4.5e6, 120.25);
        let scene = Scene { base, supplement: Some(supplement), origin: utm, ..Scene::default() };
        let there = scene.clone().around(utm - DVec3::X);
        assert_eq!(there.base.means, [[2.5, 0.0, 2.0]]);
        assert_eq!(there.world_means().collect::<Vec<_>>(), scene.world_means().collect::<Vec<_>>());
        assert_eq!(scene.world_means().collect::<Vec<_>>(), [utm + DVec3::new(1.5, 0.0, 2.0); 2]);
        assert_eq!(scene.clone().around(utm).base.means[0][1].to_bits(), (-0.0f32).to_bits());
    }

    #[test]
    fn a_scene_of_one_is_not_empty() {
        assert!(Gaussians::default().is_empty());
        assert!(!Gaussians { means: vec![[0.0; 3]], ..Default::default() }.is_empty());
    }
}
