//! What a candidate still gains, given what the choices so far have explained.

use std::f64::consts::PI;

use super::pursuit::{Candidate, Fit, Ground, HALVING};

/// Over the views of a page; `explained` by pixel of the page.
pub fn pursuit_gain(ground: &Ground<'_>, explained: &[u32], c: &Candidate, fit: &Fit) -> f64 {
    let one = |(v, s)| {
        let (alpha, t, deviation) = ground.meets(v, &s, fit)?;
        let after = t.difference - alpha * (fit.colour - t.render);
        let here = 4.0 * PI * deviation * deviation * (t.difference.length_squared() - after.length_squared());
        let pixel = (ground.plots[v as usize].pixel_first + s.pixel) as usize;
        let left = (-f64::from(explained[pixel]) / HALVING).exp2();
        Some(if here > 0.0 { here * left * left } else { here })
    };
    ground.sights(c).filter_map(one).sum()
}
