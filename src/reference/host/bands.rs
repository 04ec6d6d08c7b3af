//! Host adapters of the twins that find bands.

use glam::DVec3;

use super::{Outcome, failed, page, records_of};
use crate::{
    reference as twin,
    scene::layout::{self, MEAN},
    stages::kernels,
};

twins!(bands_fit, bands_look);

pub(super) fn bands_look(h: kernels::bands_look::Host<'_>) -> Outcome {
    let kernels::bands_look::Push { segment, page_first, stride, by_gaussian, view } = h.push;
    if failed(h.status) {
        return Ok(());
    }
    let (first, count) = page(h.population, segment, page_first, stride, h.workgroups.threads());
    let packed = h.spec.packed_records && by_gaussian == 0;
    for place in 0..count {
        let i = first + place;
        let mut sums = [0.0; 2];
        for at in records_of(i, by_gaussian != 0, h.tile_counts, h.first_slot) {
            let part = match packed {
                true => [h.record_words[at][0], h.record_words[at][1]].map(f32::from_bits),
                false => [h.record_colors[at][0], h.record_colors[at][1]],
            };
            (0..2).for_each(|s| sums[s] += f64::from(part[s]));
        }
        let look = &mut h.looks[(view * stride) as usize + place];
        *look = match h.spec.second {
            false => [sums[0] as f32, sums[1] as f32, 0.0, 0.0],
            true => {
                let sums_of_color = [look[0].into(), look[1].into(), sums[0]];
                let color = h.splat_colors[i].map(f64::from);
                twin::bands_look::bands_look(color, sums_of_color, sums[1]).map(|v| v as f32)
            }
        };
    }
    Ok(())
}

pub(super) fn bands_fit(h: kernels::bands_fit::Host<'_>) -> Outcome {
    let kernels::bands_fit::Push { segment, page_first, stride, view_count } = h.push;
    let (_, count) = page(h.population, segment, page_first, stride, h.workgroups.threads());
    let (stride, view_count) = (stride as usize, view_count as usize);
    let eyes: Vec<DVec3> =
        h.views[..view_count].iter().map(|view| DVec3::from_array(view.eye.map(f64::from))).collect();
    for place in 0..count {
        let mean = |axis: usize| f64::from(h.geometry[layout::at(MEAN + axis, stride, place) / 4][(MEAN + axis) % 4]);
        let looks: Vec<[f64; 4]> = (0..view_count).map(|v| h.looks[v * stride + place].map(f64::from)).collect();
        let mean = DVec3::new(mean(0), mean(1), mean(2));
        let (gain, fit) = twin::bands_fit::bands_fit(mean, &eyes, &looks, h.spec.sh_degree);
        h.gains[place] = gain as f32;
        for (k, coefficient) in fit.into_iter().enumerate() {
            h.fits[k * stride + place] = coefficient.map(|v| v as f32);
        }
    }
    Ok(())
}
