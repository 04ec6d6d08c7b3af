//! Twin of `pursuit_attenuate.comp`: marks the part of the residual that a chosen candidate explains, so that
//! others cannot gain it again.

use glam::DVec2;

use super::pursuit::{Candidate, Fit, Ground, REACH, WHOLE};

/// Largest share of a residual: at twice the residual, as much is missing as before.
const MOST: f64 = 2.0;
/// Smallest squared residual that counts: a quarter of a step of 8 bits.
const LEAST: f64 = 1e-6;

/// Adds the candidate's part to `explained`, by pixel of the page.
pub fn pursuit_attenuate(ground: &Ground<'_>, c: &Candidate, fit: &Fit, explained: &mut [u32]) {
    for (v, s) in ground.sights(c) {
        let Some((alpha, t, deviation)) = ground.meets(v, &s, fit) else { continue };
        let (before, change) = (2.0 * t.difference, alpha * (fit.color - t.render));
        let share = (change.dot(before) / before.length_squared().max(LEAST)).clamp(0.0, MOST);
        let width = ground.views[v as usize].width;
        let [x0, y0, x1, y1] = ground.window(v, &s, REACH * deviation);
        let middle = DVec2::new(f64::from(s.pixel % width), f64::from(s.pixel / width));
        for y in y0..=y1 {
            for x in x0..=x1 {
                let d = (DVec2::new(f64::from(x), f64::from(y)) - middle) / deviation;
                let part = share * (-0.5 * d.length_squared()).exp();
                explained[(ground.plots[v as usize].pixel_first + y * width + x) as usize] +=
                    (WHOLE * part + 0.5) as u32;
            }
        }
    }
}
