//! Host adapters of the screen phase's twins: 2D Gaussians from draw to prune.

use super::{Outcome, failed, pixels, raster, records_of, wide, wide_rows};
use crate::{
    reference::{
        self as twin, Intersections, NONE, Options,
        adam::GRADIENT_MAX,
        blend_backward::Record,
        screen_backward::{ScreenGrad, ScreenMoments, screen_step},
        screen_draw::{Draw, draw_size, new_screen_gaussian},
        screen_project::{DEPTH, ScreenGaussian},
        screen_tiles::WINDOW_RADIUS,
        tiles::Tiling,
    },
    stages::{
        constants::screen::{DRAWING, FILLED, LEARNED, WAITING},
        kernels,
        types::ScreenState,
    },
};

twins!(screen_backward, screen_draw, screen_project, screen_prune, screen_tiles);

const LEARNED_PLANES: usize = LEARNED as usize;

/// The slots of each frame's Gaussians; views that wait have none.
fn places(screen_frames: &[u32], states: &[ScreenState]) -> Vec<Vec<usize>> {
    let mut all = vec![Vec::new(); states.len()];
    for (i, &f) in screen_frames.iter().enumerate().filter(|(_, f)| **f != NONE) {
        if states[f as usize].mode != WAITING {
            all[f as usize].push(i);
        }
    }
    all
}

fn gaussians(planes: &[f32], stride: u32, places: &[usize]) -> Vec<ScreenGaussian> {
    let of = |&i: &usize| std::array::from_fn(|p| f64::from(planes[p * stride as usize + i]));
    places.iter().map(of).collect()
}

pub(super) fn screen_project(h: kernels::screen_project::Host<'_>) -> Outcome {
    let kernels::screen_project::Push { count, stride } = h.push;
    let kernels::screen_project::Spec { tile_width, tile_height, .. } = h.spec;
    let count = h.workgroups.threads().min(count as usize);
    let options = Options { tile_width, tile_height, ..Default::default() };
    h.depth_keys[..count].fill(NONE);
    h.tile_counts[..count].fill(0);
    for (f, places) in places(&h.screen_frames[..count], h.screen_states).iter().enumerate() {
        if places.is_empty() {
            continue;
        }
        let frame = &h.frames[f];
        let mut gaussians = gaussians(h.screen_planes, stride, places);
        let depths = wide(&h.depths[pixels(frame)]);
        let projected =
            twin::screen_project::screen_project(&mut gaussians, &depths, frame.width, frame.height, &options);
        for (j, &i) in places.iter().enumerate() {
            h.screen_planes[DEPTH * stride as usize + i] = gaussians[j][DEPTH] as f32;
            if projected.tile_counts[j] > 0 {
                (h.splats[i], h.splat_colors[i]) = raster::narrow(&projected.splats[j]);
                // A Gaussian without a depth lies behind everything: the largest double becomes infinite
                // here.
                h.depth_keys[i] = (projected.depths[j] as f32).to_bits();
                h.tile_counts[i] = projected.tile_counts[j];
            }
        }
    }
    Ok(())
}

pub(super) fn screen_backward(h: kernels::screen_backward::Host<'_>) -> Outcome {
    let kernels::screen_backward::Push { count, stride, by_gaussian } = h.push;
    let gradients_only = h.spec.gradients;
    if !gradients_only && failed(h.status) {
        return Ok(());
    }
    let (count, plane) = (h.workgroups.threads().min(count as usize), stride as usize);
    for (f, places) in places(&h.screen_frames[..count], h.screen_states).iter().enumerate() {
        if places.is_empty() {
            continue;
        }
        let mut gaussians = gaussians(h.screen_planes, stride, places);
        let mut records: Vec<Record> = Vec::new();
        let mut isects = Intersections::none(Tiling::new(1, 1, &Options::default()));
        let mut tile_counts = Vec::new();
        for &i in places {
            let own = records_of(i, by_gaussian != 0, h.tile_counts, h.first_slot);
            isects.first_slot.push(records.len() as u32);
            tile_counts.push(own.len() as u32);
            for at in own {
                let [a, b, c] = [h.record_centres[at], h.record_shapes[at], h.record_colors[at]];
                let parts = [a, b, c].map(|part| part.map(f64::from));
                records.push(std::array::from_fn(|r| parts[r / 3][r % 3]));
            }
        }
        let grads = twin::screen_backward::screen_backward(&gaussians, &tile_counts, &isects, &records);
        if gradients_only {
            for (&i, grad) in places.iter().zip(&grads).filter(|(_, grad)| grad.iter().all(|g| g.is_finite())) {
                for (p, &g) in grad.iter().enumerate() {
                    h.screen_moments[2 * p * plane + i] = g as f32;
                }
            }
            continue;
        }
        let moment = |p: usize, i: usize| f64::from(h.screen_moments[p * plane + i]);
        let state = |&i: &usize| ScreenMoments {
            first: std::array::from_fn(|p| moment(2 * p, i)),
            second: std::array::from_fn(|p| moment(2 * p + 1, i)),
            age: h.screen_ages[i],
        };
        let mut states: Vec<ScreenMoments> = places.iter().map(state).collect();
        // The kernel keeps squares within float32. Infinite gradients stay infinite, and the twin skips them.
        let cut = |g: f64| if g.is_finite() { g.clamp(-GRADIENT_MAX, GRADIENT_MAX) } else { g };
        let grads: Vec<ScreenGrad> = grads.iter().map(|grad| grad.map(cut)).collect();
        screen_step(&mut gaussians, &grads, &mut states, h.frames[f].width, h.frames[f].height);
        for ((&i, gaussian), state) in places.iter().zip(&gaussians).zip(&states) {
            for (p, &value) in gaussian[..LEARNED_PLANES].iter().enumerate() {
                h.screen_planes[p * plane + i] = value as f32;
                h.screen_moments[2 * p * plane + i] = state.first[p] as f32;
                h.screen_moments[(2 * p + 1) * plane + i] = state.second[p] as f32;
            }
            h.screen_ages[i] = state.age;
        }
    }
    Ok(())
}

pub(super) fn screen_prune(h: kernels::screen_prune::Host<'_>) -> Outcome {
    let kernels::screen_prune::Push { count, stride } = h.push;
    if failed(h.status) {
        return Ok(());
    }
    let count = h.workgroups.subgroups().min(count as usize);
    for (f, places) in places(&h.screen_frames[..count], h.screen_states).iter().enumerate() {
        let (gaussians, frame) = (gaussians(h.screen_planes, stride, places), &h.frames[f]);
        let stays = twin::screen_prune::screen_prune(&gaussians, frame.width, frame.height);
        places.iter().zip(stays).filter(|(_, stays)| !stays).for_each(|(&i, _)| h.screen_frames[i] = NONE);
    }
    Ok(())
}

pub(super) fn screen_tiles(h: kernels::screen_tiles::Host<'_>) -> Outcome {
    let kernels::screen_tiles::Push { count, tiles_per_frame } = h.push;
    let count = h.workgroups.threads().min(count as usize);
    let mut of_frame = vec![Vec::new(); h.frames.len()];
    for i in (0..count).filter(|&i| h.tile_counts[i] > 0) {
        of_frame[h.screen_frames[i] as usize].push(i);
    }
    let lists = [(h.forward_tiles, WINDOW_RADIUS), (h.backward_tiles, 0.0)];
    for (k, (list, halo)) in lists.into_iter().enumerate() {
        for (f, places) in of_frame.iter().enumerate() {
            let splats: Vec<_> = places.iter().map(|&i| raster::wide_splat(&h.splats[i], [0.0; 3])).collect();
            let frame = &h.frames[f];
            let ones = vec![1; splats.len()];
            for tile in twin::screen_tiles::screen_tiles(&splats, &ones, frame.width, frame.height, h.spec.tile, halo) {
                let tile = f as u32 * tiles_per_frame + tile;
                let mark = &mut h.tile_marks[2 * tile as usize + k];
                if std::mem::replace(mark, 1) == 0 {
                    list[h.count[k] as usize] = tile;
                    h.count[k] += 1;
                }
            }
        }
    }
    Ok(())
}

pub(super) fn screen_draw(h: kernels::screen_draw::Host<'_>) -> Outcome {
    let kernels::screen_draw::Push { frame_count, stride, round, seed, age } = h.push;
    if failed(h.status) {
        return Ok(());
    }
    let stride = stride as usize;
    for f in 0..h.workgroups.groups().min(frame_count as usize) {
        match h.screen_states[f].mode {
            DRAWING => {}
            FILLED => {
                h.screen_states[f].mode = WAITING;
                continue;
            }
            _ => continue,
        }
        let (frame, quota) = (&h.frames[f], h.quotas[f]);
        let (first, budget) = (quota.first as usize, quota.budget as usize);
        let empty: Vec<usize> = (first..first + budget).filter(|&i| h.screen_frames[i] == NONE).collect();
        let wanted = empty.len().min(draw_size(quota.budget) as usize);
        let draw = Draw { seed, view: quota.view, round };
        let drawn = twin::screen_draw::screen_draw(draw, &wide(&h.loss_map[pixels(frame)]), wanted);
        let image = wide_rows(&h.image[pixels(frame)]);
        for (r, (&i, &pixel)) in empty.iter().zip(&drawn).enumerate() {
            let gaussian = new_screen_gaussian(pixel, &image, frame.width, frame.height);
            gaussian.iter().enumerate().for_each(|(p, &v)| h.screen_planes[p * stride + i] = v as f32);
            (0..2 * LEARNED_PLANES).for_each(|m| h.screen_moments[m * stride + i] = 0.0);
            h.drawn_pixels[first + r] = pixel;
            h.screen_ages[i] = age;
            h.screen_frames[i] = f as u32;
        }
        let count = (budget - empty.len() + drawn.len()) as u32;
        h.screen_states[f] = ScreenState { count, mode: if count < quota.budget { DRAWING } else { FILLED } };
    }
    Ok(())
}
