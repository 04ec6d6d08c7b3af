//! Twin of `pursuit_score.comp`: the sums from which a candidate's best color, opacity and gain follow for a
//! size and every lobe width.

use std::f64::consts::PI;

use super::pursuit::{Candidate, Ground, footprint_px, lobe_factor, lobe_width};
use crate::stages::constants::pursuit::{SUMS, WIDTHS};

/// A (rgb), B (rgb), C, D, E and Σ (a l²)² of the method, section 7, by width; over the views of a page.
pub type Sums = [[f64; SUMS as usize]; WIDTHS as usize];

/// The sums for a round Gaussian of `sigma` scene units.
pub fn pursuit_score(ground: &Ground<'_>, c: &Candidate, sigma: f64) -> Sums {
    let mut sums = Sums::default();
    for (v, s) in ground.sights(c) {
        let deviation = footprint_px(&ground.views[v as usize], s.z, sigma);
        let area = PI * deviation * deviation;
        let t = ground.look(v, s.at, deviation);
        let difference_render = t.difference.dot(t.render) + t.covariance;
        for (w, sums) in sums.iter_mut().enumerate() {
            let l = lobe_factor(s.theta, lobe_width(w as u32, c.theta_bar));
            let (l1, l2) = (area * l, area * l * l);
            for k in 0..3 {
                sums[k] += 2.0 * l1 * t.difference[k];
                sums[3 + k] += l2 * t.render[k];
            }
            sums[6] += l2;
            sums[7] += 2.0 * l1 * difference_render;
            sums[8] += l2 * (t.render.length_squared() + t.variance);
            sums[9] += l2 * l2;
        }
    }
    sums
}
