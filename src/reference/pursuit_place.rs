//! Twin of `pursuit_place.comp`: turns chosen candidates into Gaussians.

use std::f64::consts::PI;

use super::{
    lift_pca::Lift,
    pursuit::{Candidate, Fit},
};

/// The Gaussian of a chosen candidate. With `width` 0 it is plain.
pub fn pursuit_place(c: &Candidate, fit: &Fit) -> Lift {
    let sh_c0 = 0.5 / PI.sqrt();
    Lift {
        mean: c.mean.to_array(),
        log_scale: [fit.sigma.ln(); 3],
        quat: [1.0, 0.0, 0.0, 0.0],
        dc: ((fit.color - 0.5) / sh_c0).to_array(),
        opacity: (fit.opacity / (1.0 - fit.opacity)).ln(),
        lobe_dir: c.toward.to_array(),
        lobe_width: fit.width,
        theta_bar: c.theta_bar,
        cluster_size: 1,
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::reference::sigmoid;

    #[test]
    fn a_placed_gaussian_has_the_fits_color_and_opacity() {
        let c = Candidate { mean: DVec3::ONE, toward: DVec3::X, px: 0.1, theta_bar: 0.2, view: 3, pixel: 4 };
        let fit = Fit {
            sigma: 0.02,
            opacity: 0.7,
            width: 0.0,
            color: DVec3::new(0.1, 0.5, 0.9),
            gain: 1.0,
            support: 1.0,
            plain: 0.0,
        };
        let lift = pursuit_place(&c, &fit);
        assert!((sigmoid(lift.opacity) - 0.7).abs() < 1e-12 && lift.dc[1] == 0.0 && lift.cluster_size == 1);
        assert!((0.28209479177387814 * lift.dc[2] + 0.5 - 0.9).abs() < 1e-12);
        assert!((lift.log_scale[0].exp() - 0.02).abs() < 1e-12);
    }
}
