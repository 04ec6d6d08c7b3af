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
