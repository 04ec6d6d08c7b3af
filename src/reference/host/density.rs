//! Host adapters of density control's twins: pruning, drawing and applying.

use glam::DVec3;

use super::{Outcome, failed, page, params, pixels, records_of};
use crate::{
    reference::{
        self as twin, NONE, Splat,
        density_apply::{Apply, Geometry},
        density_draw::Draw,
        density_plan::Plan,
        density_weigh::Weigh,
        packed_record::unpack_record,
    },
    scene::layout::{self, GEOMETRY_PLANES, LOG_SCALE, MEAN, OPACITY, QUAT},
    stages::{
        constants::density::{ALIVE, BUDGET, CANDIDATES, CHILDREN, NEW, OLD, PULL},
        kernels,
    },
};

twins!(
    density_apply,
    density_draw,
    density_image,
    density_noise,
    density_place,
    density_plan,
    density_score,
    density_weigh
);

pub(super) fn density_image(h: kernels::density_image::Host<'_>) -> Outcome {
    let frame = &h.frames[h.push.frame as usize];
    let here = pixels(frame);
    let count = here.len().min(h.workgroups.threads());
    let image: Vec<[f64; 4]> = h.image[here.clone()][..count].iter().map(|p| p.map(f64::from)).collect();
    let targets = &h.targets[frame.target_first as usize..][..count];
    for (pixel, parts) in twin::density_image::density_image(&image, targets, h.spec.terms).into_iter().enumerate() {
        for (c, part) in parts.into_iter().enumerate() {
            h.image_grad[3 * (here.start + pixel) + c] = part as f32;
        }
    }
    Ok(())
}

pub(super) fn density_score(h: kernels::density_score::Host<'_>) -> Outcome {
    let kernels::density_score::Push { segment, page_first, stride, by_gaussian, half_width, half_height } = h.push;
    if failed(h.status) {
        return Ok(());
    }
    let (first, count) = page(h.population, segment, page_first, stride, h.workgroups.threads());
    let pulls = h.spec.pulls.then(|| [half_width, half_height].map(f64::from));
    for place in 0..count {
        let i = first + place;
        let mut record = [0.0; 9];
        for at in records_of(i, by_gaussian != 0, h.tile_counts, h.first_slot) {
            let (centre, color) = match (h.spec.packed_records && by_gaussian == 0, h.spec.pulls) {
                (true, true) => {
                    let [a, b, c, ..] = unpack_record(h.record_words[at]);
                    ([a, b, c], [0.0; 3])
                }
                (true, false) => {
                    let [error, weight, ..] = h.record_words[at].map(|word| f64::from(f32::from_bits(word)));
                    ([0.0; 3], [error, weight, 0.0])
                }
                (false, true) => (h.record_centres[at].map(f64::from), [0.0; 3]),
                (false, false) => ([0.0; 3], h.record_colors[at].map(f64::from)),
            };
            for c in 0..3 {
                record[c] += centre[c];
                record[6 + c] += color[c];
            }
        }
        let splat = match h.spec.pulls {
            true => {
                let [l11, l12, l22, _] = h.splats[i].shape.map(f64::from);
                Splat { l11, l12, l22, ..Splat::default() }
            }
            false => Splat::default(),
        };
        let plane = if h.spec.pulls { PULL } else { 0 } as usize;
        let add = twin::density_score::density_score(&record, &splat, pulls);
        for (p, add) in add.into_iter().enumerate() {
            let sum = &mut h.scores[place][plane + p];
            *sum = (f64::from(*sum) + add) as f32;
        }
    }
    Ok(())
}

/// Number of a page's Gaussians that the dispatch takes.
fn count_of(population: &[u32], segment: u32, page_first: u32, stride: u32, threads: usize) -> usize {
    page(population, segment, page_first, stride, threads).1
}

pub(super) fn density_weigh(h: kernels::density_weigh::Host<'_>) -> Outcome {
    let kernels::density_weigh::Push { segment, page_first, stride, capacity, least_opacity, least_score, step, seed } =
        h.push;
    let count = count_of(h.population, segment, page_first, stride, h.workgroups.threads());
    let params = params([h.geometry, &[], &[]], count, stride, false, 0);
    let [least_opacity, least_score] = [least_opacity, least_score].map(f64::from);
    let weigh = Weigh { strategy: h.spec.strategy, capacity, least_opacity, least_score, step, seed };
    for place in 0..count {
        let number = page_first + place as u32;
        let scores = h.scores[place].map(f64::from);
        let (stays, key) = twin::density_weigh::density_weigh(&weigh, &params, place, number, scores);
        h.alive[number as usize] = stays.into();
        h.keys[number as usize] = match (key, h.spec.strategy) {
            (None, _) => NONE,
            (Some(key), BUDGET) => (key as f32).to_bits(),
            (Some(key), _) => key as u32,
        };
    }
    Ok(())
}

pub(super) fn density_plan(h: kernels::density_plan::Host<'_>) -> Outcome {
    let kernels::density_plan::Push { capacity, target, nth, threads_per_group } = h.push;
    let [old, alive, candidates] = [OLD, ALIVE, CANDIDATES].map(|word| h.words[word as usize]);
    let (replacement, failed) = (h.spec.replacement, failed(h.status));
    let plan = Plan { old, alive, candidates, capacity, target, nth, replacement, failed };
    let [stay, children, new] = twin::density_plan::density_plan(&plan);
    for (word, value) in [(ALIVE, stay), (CHILDREN, children), (NEW, new)] {
        h.words[word as usize] = value;
    }
    let (.., groups) = twin::dispatch_args::dispatch_args(children, u32::MAX, threads_per_group);
    h.dispatch_args[..3].copy_from_slice(&groups);
    Ok(())
}

pub(super) fn density_draw(h: kernels::density_draw::Host<'_>) -> Outcome {
    let kernels::density_draw::Push { step, seed } = h.push;
    let word = |word: u32| h.words[word as usize];
    let draw = h.spec.replacement.then(|| Draw { total: word(CANDIDATES), step, seed });
    let order = if h.spec.replacement { &h.order[..word(OLD) as usize] } else { h.order };
    for child in 0..word(CHILDREN).min(h.workgroups.threads() as u32) {
        let parent = twin::density_draw::density_draw(child, order, draw);
        h.sources[(word(ALIVE) + child) as usize] = parent;
        h.copies[parent as usize] += 1;
    }
    Ok(())
}

pub(super) fn density_place(h: kernels::density_place::Host<'_>) -> Outcome {
    let kernels::density_place::Push { page_first, stride } = h.push;
    let old = h.words[OLD as usize] as usize;
    let placed = twin::density_place::density_place(&h.alive[..old], &h.ranks[..old], h.words[ALIVE as usize]);
    let count = (stride as usize).min(h.workgroups.threads());
    for (number, place) in placed.into_iter().enumerate().skip(page_first as usize).take(count) {
        if let Some(place) = place {
            h.sources[place as usize] = number as u32;
        }
    }
    Ok(())
}

fn geometry(page: &[[f32; 4]], stride: u32, place: usize) -> Geometry {
    let plane = |p: usize| f64::from(page.as_flattened()[layout::at(p, stride as usize, place)]);
    let triple = |p: usize| DVec3::new(plane(p), plane(p + 1), plane(p + 2));
    Geometry {
        mean: triple(MEAN),
        log_scale: triple(LOG_SCALE),
        quat: std::array::from_fn(|c| plane(QUAT + c)),
        logit: plane(OPACITY),
    }
}

pub(super) fn density_apply(h: kernels::density_apply::Host<'_>) -> Outcome {
    let kernels::density_apply::Push { segment, page_first, stride, small, most, step, seed } = h.push;
    if failed(h.status) {
        return Ok(());
    }
    let count = count_of(h.population, segment, page_first, stride, h.workgroups.threads());
    let [small, most] = [small, most].map(f64::from);
    let apply = Apply { strategy: h.spec.strategy, small, most, step, seed };
    let moments = h.spec.moments as usize;
    for place in 0..count {
        let number = page_first + place as u32;
        let copies = h.copies[h.sources[number as usize] as usize];
        let child = number >= h.words[ALIVE as usize];
        let old = geometry(h.geometry, stride, place);
        let (new, begins) = twin::density_apply::density_apply(&apply, &old, number, copies, child);
        let quad = |p: usize| p / 4 * stride as usize + place;
        for c in 0..3 {
            h.geometry[quad(MEAN)][MEAN % 4 + c] = new.mean[c] as f32;
            h.geometry[quad(LOG_SCALE)][LOG_SCALE % 4 + c] = new.log_scale[c] as f32;
        }
        h.geometry[quad(OPACITY)][OPACITY % 4] = new.logit as f32;
        // Quad q's moments are quads moments · q and those after it.
        for q in 0..moments * layout::quads(GEOMETRY_PLANES) {
            let own = &mut h.geometry_moments[q * stride as usize + place];
            if begins.all {
                *own = [0.0; 4];
            } else if begins.opacity && q / moments == OPACITY / 4 {
                own[OPACITY % 4] = 0.0;
            }
        }
        if begins.all {
            (0..h.spec.sh_beside as usize).for_each(|m| h.sh_moments[quad(m)] = [0.0; 4]);
        }
        h.scores[place] = [0.0; 4];
    }
    Ok(())
}

pub(super) fn density_noise(h: kernels::density_noise::Host<'_>) -> Outcome {
    let kernels::density_noise::Push { segment, page_first, stride, rate, step, seed } = h.push;
    if failed(h.status) {
        return Ok(());
    }
    for place in 0..count_of(h.population, segment, page_first, stride, h.workgroups.threads()) {
        let gaussian = geometry(h.geometry, stride, place);
        let number = page_first + place as u32;
        let off = twin::density_noise::density_noise(&gaussian, rate.into(), number, step, seed);
        for c in 0..3 {
            h.geometry[place][MEAN + c] = (gaussian.mean[c] + off[c]) as f32;
        }
    }
    Ok(())
}
