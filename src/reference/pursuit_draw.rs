//! Twin of `pursuit_draw.comp`: draws pixels of all views in proportion to their squared error, and places a
//! candidate on each.

use std::f64::consts::FRAC_PI_2;

use glam::DVec2;

use super::{
    FLOAT_MAX, View,
    pursuit::{Candidate, angle_between, project_point},
};
use crate::stages::{constants::pursuit::ERROR_BLOCK, types::Plot};

/// The pixels from which candidates are drawn, with their errors.
#[derive(Debug, Clone, Copy)]
pub struct Drawn<'a> {
    /// All training views.
    pub views: &'a [View],
    /// First texel, pixel, cell and block of each view.
    pub plots: &'a [Plot],
    /// Each block's share, for all views.
    pub quanta: &'a [u32],
    /// Exclusive prefix sum of `quanta`.
    pub quanta_firsts: &'a [u32],
    /// Sum of all shares.
    pub total: u32,
    /// Sum of the errors of each block, for all views.
    pub error_sums: &'a [f64],
    /// Error by pixel of the page.
    pub errors: &'a [f64],
    /// Median depth by pixel of the page, camera z; 0: none.
    pub surface_depths: &'a [f64],
    /// Views of the page, first and end.
    pub page_views: (u32, u32),
    /// Blocks of the page, first and end.
    pub page_blocks: (u32, u32),
}

fn hash(i: u32, seed: u32) -> u32 {
    let step = |v: u32| v.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let (mut x, mut y) = (step(i), step(seed));
    x = x.wrapping_add(y.wrapping_mul(1_664_525));
    y = y.wrapping_add(x.wrapping_mul(1_664_525));
    (x, y) = (x ^ x >> 16, y ^ y >> 16);
    x = x.wrapping_add(y.wrapping_mul(1_664_525));
    y = y.wrapping_add(x.wrapping_mul(1_664_525));
    y ^ y >> 16
}

impl Drawn<'_> {
    /// The view and the pixel of draw i of `count`, if its block is in this page. `late` is added to the
    /// position within the block, as a share of its errors: it shows how near a draw is to another pixel.
    pub fn pixel(&self, i: u32, count: u32, seed: u32, late: f64) -> Option<(u32, u32)> {
        let (each, rest) = (self.total / count, self.total % count);
        let part = each + u32::from(i < rest);
        if part == 0 {
            return None;
        }
        let quantum = i * each + i.min(rest) + hash(i, seed) % part;
        let (first, end) = self.page_blocks;
        if first >= end || quantum < self.quanta_firsts[first as usize] {
            return None;
        }
        let firsts = &self.quanta_firsts[first as usize..end as usize];
        let block = first as usize + firsts.partition_point(|&begins| begins <= quantum) - 1;
        let into = quantum - self.quanta_firsts[block];
        if into >= self.quanta[block] {
            return None;
        }
        let plots = &self.plots[self.page_views.0 as usize..self.page_views.1 as usize];
        let v = self.page_views.0 as usize + plots.partition_point(|plot| plot.block_first as usize <= block) - 1;
        let (view, plot) = (&self.views[v], &self.plots[v]);
        let begin = (block as u32 - plot.block_first) * ERROR_BLOCK;
        let last = (begin + ERROR_BLOCK).min(view.width * view.height);
        let share = (f64::from(into) + 0.5) / f64::from(self.quanta[block]) + late;
        let wanted = share * self.error_sums[block];
        let (mut sum, mut pixel) = (0.0, None);
        for p in begin..last {
            if sum > wanted {
                break;
            }
            let error = self.errors[(plot.pixel_first + p) as usize];
            if error > 0.0 {
                sum += error;
                pixel = Some(p);
            }
        }
        Some((v as u32, pixel?))
    }

    /// The candidate on a pixel of view v.
    pub fn candidate(&self, v: u32, pixel: u32) -> Option<Candidate> {
        let view = &self.views[v as usize];
        let z = self.surface_depths[(self.plots[v as usize].pixel_first + pixel) as usize];
        let at = DVec2::new(f64::from(pixel % view.width), f64::from(pixel / view.width)) + 0.5;
        let slope = (at - DVec2::new(view.cx, view.cy)) / DVec2::new(view.fx, view.fy);
        let ray = slope.x * view.row_x.truncate() + slope.y * view.row_y.truncate() + view.row_z.truncate();
        let (mean, toward) = (view.eye + z * ray, -ray.normalize());
        let others =
            self.views.iter().enumerate().filter(|&(u, other)| u != v as usize && project_point(other, mean).is_some());
        let nearest = others.map(|(_, other)| angle_between(toward, other.eye - mean)).fold(4.0, f64::min);
        let theta_bar = if nearest < 4.0 { nearest } else { FRAC_PI_2 };
        let finite = mean.abs().max_element() <= FLOAT_MAX;
        finite.then_some(Candidate { mean, toward, px: z / view.fx, theta_bar, view: v, pixel })
    }
}

/// Draw i of `count`: `None` if it belongs to another page or has no pixel.
pub fn pursuit_draw(from: &Drawn<'_>, i: u32, count: u32, seed: u32) -> Option<Candidate> {
    let (v, pixel) = from.pixel(i, count, seed, 0.0)?;
    from.candidate(v, pixel)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::{pursuit_quanta::pursuit_quanta, random_camera};

    /// Each pixel is drawn in proportion to its share of the errors, to within one: each draw covers one of
    /// equal parts.
    #[test]
    fn pixels_are_drawn_in_proportion_to_their_errors() {
        let views: Vec<View> = [(20, 16), (7, 5)].map(|(w, h)| View::from_camera(&random_camera(w, h))).to_vec();
        let plot = |pixel_first, block_first| Plot { texel_first: 0, pixel_first, cell_first: 0, block_first };
        let plots = [plot(0, 0), plot(320, 2)];
        let mut errors = vec![0.0; 355];
        let wanted = [(3usize, 0.1), (19, 0.4), (300, 0.2), (320, 0.25), (354, 0.05)];
        wanted.iter().for_each(|&(p, share)| errors[p] = share);
        let sums = [errors[..256].iter().sum(), errors[256..320].iter().sum(), errors[320..].iter().sum::<f64>()];
        let quanta = pursuit_quanta(&sums);
        let firsts = [0, quanta[0], quanta[0] + quanta[1]];
        let from = Drawn {
            views: &views,
            plots: &plots,
            quanta: &quanta,
            quanta_firsts: &firsts,
            total: quanta.iter().sum(),
            error_sums: &sums,
            errors: &errors,
            surface_depths: &[2.0; 355],
            page_views: (0, 2),
            page_blocks: (0, 3),
        };
        let mut found = vec![0; 355];
        let count = 1000;
        for i in 0..count {
            let c = pursuit_draw(&from, i, count, 9).unwrap();
            found[(plots[c.view as usize].pixel_first + c.pixel) as usize] += 1;
        }
        for (p, share) in wanted {
            assert!((f64::from(found[p]) - share * f64::from(count)).abs() <= 2.0, "{p}: {} of {share}", found[p]);
        }
        // The second page gives only the draws of its own blocks.
        let second = Drawn { page_views: (1, 2), page_blocks: (2, 3), ..from };
        let drawn = (0..count).filter(|&i| second.pixel(i, count, 9, 0.0).is_some()).count();
        assert!((298..=302).contains(&drawn), "{drawn}");
    }
}
