//! Twin of `pursuit_sight.comp`: the views in which a candidate's fit shows.

use std::f64::consts::PI;

use super::pursuit::{Candidate, Fit, Ground};

/// Sets the bits of the page's views that see the candidate from within its lobe.
pub fn pursuit_sight(ground: &Ground<'_>, c: &Candidate, fit: &Fit, words: &mut [u32]) {
    for (v, s) in ground.sights(c).filter(|_| fit.gain > 0.0) {
        if fit.width == 0.0 || s.theta < PI * fit.width {
            words[v as usize / 32] |= 1 << (v % 32);
        }
    }
}
