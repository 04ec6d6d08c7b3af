//! Host adapters of the optimiser's twins: gradient records to parameters, and the counting of steps.

use glam::DVec3;

use super::{Outcome, failed, page, params, records_of, view};
use crate::{
    reference::{
        self as twin, Intersections, Options, Params,
        adam::{
            PACE, PlaneRate, adam_one, curvature_one, dither_of, newton_one, pack_firsts, pack_moments,
            unit_before_step, unpack_firsts, unpack_moments,
        },
        blend_backward::Record,
        lobe,
        packed_record::unpack_record,
        project_backward::{probe_backward, regularise, sum_records},
        tiles::Tiling,
    },
    scene::layout::{self, Array, GEOMETRY_PLANES, LAST_STEP, LOBE_DIRECTION, OPACITY, QUAT},
    stages::{kernels, status, types::StepRates},
};

twins!(adam, project_backward, step_done);

pub(super) fn step_done(h: kernels::step_done::Host<'_>) -> Outcome {
    if let Some(status) = h.status.first_chunk_mut::<{ status::WORDS }>() {
        twin::step_done::step_done(status);
    }
    Ok(())
}

/// A page's parameters, and their moments or accumulated gradients.
struct Planes<'a> {
    geometry: &'a mut [[f32; 4]],
    sh: &'a mut [[f32; 4]],
    lobes: &'a mut [[f32; 4]],
    beside: [&'a mut [[f32; 4]]; 3],
    stride: usize,
    page_first: u32,
    packed: bool,
    newton: bool,
}

/// The part of the parameters that steps.
#[derive(Clone, Copy)]
struct Moves {
    has_lobes: bool,
    opacity_only: bool,
    sh_degree: u32,
}

impl Moves {
    /// Groups of parameters that step, each with its number among all.
    fn groups(self) -> impl Iterator<Item = (usize, layout::Group)> {
        let moves = move |group: &layout::Group| match group.array {
            Array::Lobes => self.has_lobes && !self.opacity_only,
            Array::Geometry => !self.opacity_only || group.planes.start == OPACITY,
            Array::Sh => !self.opacity_only,
        };
        layout::groups(self.sh_degree).into_iter().enumerate().filter(move |(_, group)| moves(group))
    }

    /// The plane of gradients of plane p: opacity's is the first if nothing else learns.
    fn beside(self, p: usize) -> usize {
        if self.opacity_only { 0 } else { p }
    }

    /// The planes of both moments of plane p; a quad's moments are two quads. The same plane twice if both
    /// share a word.
    fn moments(self, p: usize, packed: bool) -> [usize; 2] {
        let first = if packed || self.opacity_only { self.beside(p) } else { 8 * (p / 4) + p % 4 };
        match (packed, self.opacity_only) {
            (true, _) => [first, first],
            (false, true) => [first, first + 1],
            (false, false) => [first, first + 4],
        }
    }
}

/// The array of a group.
fn values(grads: &Params, array: Array) -> &[f64] {
    match array {
        Array::Geometry => &grads.geometry,
        Array::Sh => &grads.sh,
        Array::Lobes => &grads.lobes,
    }
}

/// True if every parameter that steps has a finite gradient.
fn is_sound(grads: &Params, moves: Moves, place: usize) -> bool {
    let finite = |(_, group): (usize, layout::Group)| {
        group.planes.clone().all(|p| values(grads, group.array)[p * grads.stride + place].is_finite())
    };
    moves.groups().all(finite)
}

impl Planes<'_> {
    fn array(&mut self, array: Array) -> (&mut [f32], &mut [f32]) {
        let [geometry, sh, lobes] = &mut self.beside;
        let (params, beside): (&mut [[f32; 4]], &mut [[f32; 4]]) = match array {
            Array::Geometry => (self.geometry, geometry),
            Array::Sh => (self.sh, sh),
            Array::Lobes => (self.lobes, lobes),
        };
        (params.as_flattened_mut(), beside.as_flattened_mut())
    }

    /// Counts a Newton step of the places marked in `steps`, and returns the pace of all: the factor on their steps.
    fn count_step(&mut self, steps: &[bool], moves: Moves, r: &StepRates) -> Vec<f64> {
        let (newton, stride, [plane, _]) = (self.newton, self.stride, moves.moments(LAST_STEP, self.packed));
        let (_, moments) = self.array(Array::Geometry);
        let pace = |(place, &steps): (usize, &bool)| {
            if !newton || moves.opacity_only || !steps || r.probe != 0 {
                return 1.0;
            }
            let last = &mut moments[layout::at(plane, stride, place)];
            let before = std::mem::replace(last, (r.step + 1) as f32);
            if before == r.step as f32 { 1.0 } else { PACE }
        };
        steps.iter().enumerate().map(pace).collect()
    }

    /// Steps the places marked in `steps`, or updates their curvature from a probe.
    fn step(&mut self, grads: &Params, steps: &[bool], moves: Moves, r: &StepRates) {
        let pace = self.count_step(steps, moves, r);
        let rates =
            [r.mean, r.log_scale, r.quat, r.opacity, r.dc, r.sh, r.direction, r.width, r.sharpness].map(f64::from);
        // The kernel multiplies by the corrections, the twin divides.
        let correct = |corrections: [f32; 2]| corrections.map(|c| 1.0 / f64::from(c));
        let Planes { stride, page_first, packed, newton, .. } = *self;
        for (number, group) in moves.groups() {
            let rate = |p: usize| PlaneRate::of(&group, p, rates[number]);
            let correct = match group.array {
                Array::Lobes => correct([r.lobe_first_correction, r.lobe_second_correction]),
                _ => correct([r.first_correction, r.second_correction]),
            };
            let grads = values(grads, group.array);
            if newton && group.array == Array::Sh && group.planes.start > 0 {
                if r.probe == 0 {
                    self.step_bands(grads, (steps, &pace), group.planes.len() / 3, &rate(group.planes.start), r);
                }
                continue;
            }
            let (params, moments) = self.array(group.array);
            for p in group.planes.clone() {
                // Newton's step of harmonics: the constant's curvature precedes all first moments.
                let newtons = newton && !packed && group.array == Array::Sh;
                let words = if newtons { [4 + p, p] } else { moves.moments(p, packed) };
                for place in (0..steps.len()).filter(|&place| steps[place]) {
                    let [first, second] = words.map(|p| layout::at(p, stride, place));
                    let (of, at) = (p * stride + place, layout::at(p, stride, place));
                    let [mut m, mut v] = match packed {
                        true => unpack_moments(moments[first].to_bits()),
                        false => [moments[first], moments[second]].map(f64::from),
                    };
                    let mut param = f64::from(params[at]);
                    match (newton, r.probe) {
                        (false, _) => adam_one(&mut param, grads[of], [&mut m, &mut v], &rate(p), correct),
                        (true, 0) => {
                            let (rate, part) = (rate(p).times(pace[place]), pace[place] * f64::from(r.newton));
                            newton_one(&mut param, grads[of], &mut m, v, &rate, part);
                        }
                        (true, _) => curvature_one(grads[of], &mut v),
                    }
                    params[at] = param as f32;
                    if packed {
                        let dither = dither_of(page_first + place as u32, p as u32, r.step);
                        moments[first] = f32::from_bits(pack_moments([m, v], dither));
                    } else {
                        moments[first] = m as f32;
                        moments[second] = v as f32;
                    }
                }
            }
        }
    }

    /// Curvature of the constant color of the first `count` places.
    fn known_curvature(&self, count: usize) -> Vec<[f64; 3]> {
        let known = |word: f32| if self.packed { unpack_moments(word.to_bits())[1] } else { f64::from(word) };
        self.beside[1][..count].iter().map(|quad| [0, 1, 2].map(|c| known(quad[c]))).collect()
    }

    /// Newton's step of `bands` coefficients of harmonics beyond the constant one, whose curvature they use.
    fn step_bands(
        &mut self,
        grads: &[f64],
        (steps, pace): (&[bool], &[f64]),
        bands: usize,
        rate: &PlaneRate,
        r: &StepRates,
    ) {
        let Planes { stride, page_first, packed, .. } = *self;
        let (params, moments) = self.array(Array::Sh);
        for (place, k) in
            (0..steps.len()).filter(|&place| steps[place]).flat_map(|place| (1..=bands).map(move |k| (place, k)))
        {
            let at = |p: usize| layout::at(p, stride, place);
            let curvature: [f64; 3] = std::array::from_fn(|c| match packed {
                true => unpack_moments(moments[at(c)].to_bits())[1],
                false => f64::from(moments[at(c)]),
            });
            let mut first = match packed {
                true => unpack_firsts(moments[at(2 + k)].to_bits(), curvature),
                false => std::array::from_fn(|c| f64::from(moments[at(4 + 3 * k + c)])),
            };
            let (rate, part) = (rate.times(pace[place]), pace[place] * f64::from(r.newton));
            for (c, first) in first.iter_mut().enumerate() {
                let mut param = f64::from(params[at(3 * k + c)]);
                let grad = grads[(3 * k + c) * stride + place];
                newton_one(&mut param, grad, first, curvature[c], &rate, part);
                params[at(3 * k + c)] = param as f32;
            }
            if packed {
                let dither = dither_of(page_first + place as u32, 3 * k as u32, r.step);
                moments[at(2 + k)] = f32::from_bits(pack_firsts(first, curvature, dither));
            } else {
                (0..3).for_each(|c| moments[at(4 + 3 * k + c)] = first[c] as f32);
            }
        }
    }

    /// Adds gradients up, and counts views for each Gaussian that is blended.
    fn add(&mut self, grads: &Params, places: &[bool], moves: Moves, blended: &[bool]) {
        let stride = self.stride;
        let places: Vec<usize> = (0..places.len()).filter(|&place| places[place]).collect();
        for (_, group) in moves.groups() {
            let grads = values(grads, group.array);
            let (_, sums) = self.array(group.array);
            for p in group.planes.clone() {
                for place in &places {
                    let sum = &mut sums[layout::at(moves.beside(p), stride, *place)];
                    *sum = (f64::from(*sum) + grads[p * stride + place]) as f32;
                }
            }
        }
        let views = if moves.opacity_only { 1 } else { GEOMETRY_PLANES };
        for place in places {
            self.beside[0].as_flattened_mut()[layout::at(views, stride, place)] += f32::from(u8::from(blended[place]));
        }
    }

    /// Normalises the vector in `N` planes before a step that would turn it wildly or not at all; returns its
    /// former length.
    fn make_unit<const N: usize>(&mut self, array: Array, plane: usize, place: usize) -> Option<f64> {
        let stride = self.stride;
        let (params, _) = self.array(array);
        let at: [usize; N] = std::array::from_fn(|c| layout::at(plane + c, stride, place));
        let (unit, length) = unit_before_step(at.map(|at| f64::from(params[at])))?;
        at.into_iter().zip(unit).for_each(|(at, v)| params[at] = v as f32);
        Some(length)
    }
}

pub(super) fn adam(h: kernels::adam::Host<'_>) -> Outcome {
    let kernels::adam::Push { segment, page_first, stride, rates } = h.push;
    let kernels::adam::Spec { has_lobes, opacity_only, sparse, packed, sh_degree, .. } = h.spec;
    if failed(h.status) {
        return Ok(());
    }
    let (_, count) = page(h.population, segment, page_first, stride, h.workgroups.threads());
    let moves = Moves { has_lobes, opacity_only, sh_degree };
    let mut grads = params([h.geometry_grads, h.sh_grads, h.lobe_grads], count, stride, has_lobes, sh_degree);
    let stride = stride as usize;
    let views = if opacity_only { 1 } else { GEOMETRY_PLANES };
    let blended = |place: usize| h.geometry_grads[views / 4 * stride + place][views % 4] != 0.0;
    if opacity_only {
        grads.geometry = vec![0.0; GEOMETRY_PLANES * stride];
        let own = &mut grads.geometry[OPACITY * stride..][..stride];
        own.iter_mut().zip(h.geometry_grads).for_each(|(to, quad)| *to = quad[0].into());
    }
    let steps: Vec<bool> =
        (0..count).map(|place| (!sparse || blended(place)) && is_sound(&grads, moves, place)).collect();
    let beside = [h.geometry_moments, h.sh_moments, h.lobe_moments];
    let [geometry, sh, lobes] = [h.geometry, h.sh, h.lobes];
    let mut planes = Planes { geometry, sh, lobes, beside, stride, page_first, packed, newton: false };
    // A normalised vector takes the gradient of its unit vector: longer by the vector's length.
    for place in (0..count).filter(|&place| steps[place] && !opacity_only) {
        scale(&mut grads.geometry, QUAT..QUAT + 4, stride, place, || {
            planes.make_unit::<4>(Array::Geometry, QUAT, place)
        });
        if has_lobes {
            let directions = LOBE_DIRECTION..LOBE_DIRECTION + 3;
            let make_unit = || planes.make_unit::<3>(Array::Lobes, LOBE_DIRECTION, place);
            scale(&mut grads.lobes, directions, stride, place, make_unit);
        }
    }
    planes.step(&grads, &steps, moves, &rates);
    Ok(())
}

/// Multiplies a vector's gradient by the result of `by`, which is called only if the gradient is not 0.
fn scale(
    grads: &mut [f64],
    planes: std::ops::Range<usize>,
    stride: usize,
    place: usize,
    by: impl FnOnce() -> Option<f64>,
) {
    let at = |p: usize| p * stride + place;
    if planes.clone().any(|p| grads[at(p)] != 0.0)
        && let Some(length) = by()
    {
        planes.for_each(|p| grads[at(p)] *= length);
    }
}

pub(super) fn project_backward(h: kernels::project_backward::Host<'_>) -> Outcome {
    let kernels::project_backward::Push {
        segment,
        page_first,
        stride,
        view: view_index,
        by_gaussian,
        rates,
        mean_opacity,
        mean_scale,
    } = h.push;
    let kernels::project_backward::Spec {
        compensate,
        has_lobes,
        opacity_only,
        sparse,
        accumulate,
        packed,
        packed_records,
        newton,
        sh_degree,
        ..
    } = h.spec;
    if failed(h.status) {
        return Ok(());
    }
    let (first, count) = page(h.population, segment, page_first, stride, h.workgroups.threads());
    let view = view(&h.views[view_index as usize]);
    let moves = Moves { has_lobes, opacity_only, sh_degree };

    // The records of the page's Gaussians, one after the other.
    let mut records: Vec<Record> = Vec::new();
    let mut marks = vec![false; count];
    let (mut starts, mut counts) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for (i, mark) in (first..).zip(&mut marks) {
        let own = records_of(i, by_gaussian != 0, h.tile_counts, h.first_slot);
        starts.push(records.len() as u32);
        counts.push(own.len() as u32);
        for at in own {
            let mut parts = match packed_records && by_gaussian == 0 {
                true => {
                    let record = unpack_record(h.record_words[at]);
                    [0, 3, 6].map(|first| [0, 1, 2].map(|c| record[first + c] as f32))
                }
                false if opacity_only => [h.record_centres[at], [0.0; 3], [0.0; 3]],
                false => [h.record_centres[at], h.record_shapes[at], h.record_colors[at]],
            };
            if opacity_only {
                // The first part is a mark, and the others are missing.
                *mark |= parts[0][0] != 0.0;
                parts[0][0] = 0.0;
                parts[0][1] = 0.0;
            }
            records.push(std::array::from_fn(|r| f64::from(parts[r / 3][r % 3])));
        }
    }
    let isects = Intersections { first_slot: starts, ..Intersections::none(Tiling::new(1, 1, &Options::default())) };
    let sums = sum_records(&counts, &isects, &records);
    let is_blended = |(sum, mark): (&Record, &bool)| sum[2] != 0.0 || *mark || sum[6..].iter().any(|&c| c != 0.0);
    let blended: Vec<bool> = sums.iter().zip(&marks).map(is_blended).collect();

    let beside = [h.geometry_moments, h.sh_moments, h.lobe_moments];
    let [geometry, sh, lobes] = [h.geometry, h.sh, h.lobes];
    let mut planes = Planes { geometry, sh, lobes, beside, stride: stride as usize, page_first, packed, newton };
    let read =
        |planes: &Planes<'_>| params([planes.geometry, planes.sh, planes.lobes], count, stride, has_lobes, sh_degree);
    if !opacity_only && !accumulate {
        let before = read(&planes);
        for place in (0..count).filter(|&place| blended[place]) {
            planes.make_unit::<4>(Array::Geometry, QUAT, place);
            let to_eye: DVec3 = view.eye - before.mean(place);
            if before.lobe(place).is_some_and(|(d, width, sharpness)| lobe::factor(d, width, sharpness, to_eye) > 0.0) {
                planes.make_unit::<3>(Array::Lobes, LOBE_DIRECTION, place);
            }
        }
    }
    let params = read(&planes);
    let options = Options { active_degree: sh_degree, compensate, ..Default::default() };
    // The kernel also repeats the projection.
    let splats = twin::project::project(&params, &view, &options).splats;
    let mut grads = if newton && rates.probe != 0 {
        probe_backward(&params, &view, &options, &splats, sums, &planes.known_curvature(count))
    } else {
        twin::project_backward::project_backward(&params, &view, &options, &splats, &counts, &isects, &records)
    };
    if !opacity_only {
        let of_all = (h.population[segment as usize + 1] - h.population[segment as usize]) as usize;
        let [mean_opacity, mean_scale] = [mean_opacity, mean_scale].map(f64::from);
        regularise(&params, count, of_all, mean_opacity, mean_scale, &mut grads.params);
    }
    let moved: Vec<bool> =
        (0..count).map(|place| (blended[place] || !sparse) && is_sound(&grads.params, moves, place)).collect();
    if accumulate {
        planes.add(&grads.params, &moved, moves, &blended);
    } else {
        planes.step(&grads.params, &moved, moves, &rates);
    }
    Ok(())
}
