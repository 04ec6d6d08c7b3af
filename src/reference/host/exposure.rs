//! Host adapters of exposure correction's twins.

use super::{Outcome, failed, pixels, wide_rows};
use crate::{
    reference::{
        exposure_apply::Map,
        exposure_backward::SUM_PIXELS,
        exposure_step::Moments,
        {self as twin},
    },
    stages::{
        constants::exposure::{CORRECTIONS, FIRST, MAP, MOMENTS, SECOND},
        kernels,
    },
};

twins!(exposure_apply, exposure_backward, exposure_step);

/// Reads `N` numbers from `first` on.
fn take<const N: usize>(from: &[f32], first: usize) -> [f64; N] {
    std::array::from_fn(|k| f64::from(from[first + k]))
}

fn map(maps: &[f32], photo: u32) -> Map {
    take(maps, (MAP * photo) as usize)
}

pub(super) fn exposure_apply(h: kernels::exposure_apply::Host<'_>) -> Outcome {
    let here = pixels(&h.frames[h.push.frame as usize]);
    let count = here.len().min(h.workgroups.threads());
    let image = wide_rows(&h.image[here.clone()][..count]);
    let mapped = twin::exposure_apply::exposure_apply(&map(h.maps, h.push.photo), &image);
    h.corrected[here].iter_mut().zip(mapped).for_each(|(to, pixel)| *to = pixel.map(|v| v as f32));
    Ok(())
}

pub(super) fn exposure_backward(h: kernels::exposure_backward::Host<'_>) -> Outcome {
    let here = pixels(&h.frames[h.push.frame as usize]);
    let count = here.len().min(h.workgroups.subgroups() * SUM_PIXELS);
    let image = wide_rows(&h.image[here.clone()][..count]);
    let of_pixels = &mut h.image_grad[3 * here.start..][..3 * count];
    let mut grads: Vec<[f64; 3]> = of_pixels.chunks_exact(3).map(|g| take(g, 0)).collect();
    let sums = twin::exposure_backward::exposure_backward(&map(h.maps, h.push.photo), &image, &mut grads);
    of_pixels.iter_mut().zip(grads.as_flattened()).for_each(|(to, &g)| *to = g as f32);
    h.sums.iter_mut().zip(sums.as_flattened()).for_each(|(to, &sum)| *to = sum as f32);
    Ok(())
}

pub(super) fn exposure_step(h: kernels::exposure_step::Host<'_>) -> Outcome {
    let kernels::exposure_step::Push { photo, photos, runs, rate } = h.push;
    if failed(h.status) {
        return Ok(());
    }
    let mut maps: Vec<Map> = (0..photos).map(|photo| map(h.maps, photo)).collect();
    let beside = |photo: u32, plane: u32| (MOMENTS * photo + plane) as usize;
    let read = |photo: u32| Moments {
        first: take(h.moments, beside(photo, FIRST)),
        second: take(h.moments, beside(photo, SECOND)),
        corrections: take(h.moments, beside(photo, CORRECTIONS)),
    };
    let mut moments: Vec<Moments> = (0..photos).map(read).collect();
    let sums: Vec<Map> = (0..runs).map(|run| map(h.sums, run)).collect();
    twin::exposure_step::exposure_step(&mut maps, &mut moments, photo as usize, &sums, rate.into());
    h.maps.iter_mut().zip(maps.as_flattened()).for_each(|(to, &v)| *to = v as f32);
    let Moments { first, second, corrections } = moments[photo as usize];
    let own = &mut h.moments[beside(photo, 0)..][..MOMENTS as usize];
    let all = [&first[..], &second, &corrections].concat();
    own.iter_mut().zip(all).for_each(|(to, v)| *to = v as f32);
    Ok(())
}
