//! From intersection records to gradients of Gaussians, the Adam step on them, and the counting of steps.

use super::{
    Bench,
    judge::{Row, Work},
    raster::{Ordered, Scene, image_grad, read_records},
    sort::noise,
};
use crate::{
    error::Result,
    gpu::Buffer,
    pipelines::{
        learn::{Beside, Learner, Lesson, Rates, Seen},
        model::{Planes, Segment},
    },
    reference::{
        self, Options, Params,
        adam::{
            PlaneRate, adam, curvature_one, dither_of, newton_one, pack_firsts, pack_moments, unpack_firsts,
            unpack_moments,
        },
        blend::Margin,
        blend_backward::{Record, blend_backward_magnitudes},
        project_backward::{magnitudes, probe_backward, project_backward, sum_records},
    },
    scene::layout::{self, Array, BETAS, GEOMETRY_PLANES, Group, LOBE_PLANES, OPACITY},
    stages::{
        status::{self, Resource, Status},
        step_done,
    },
};

/// Large enough that a wrong step is not a rounding of the parameter, and all different, lest one stand in for another.
const RATES: Rates = Rates {
    mean: 0.01,
    log_scale: 0.013,
    quat: 0.009,
    opacity: 0.017,
    dc: 0.011,
    sh: 0.007,
    direction: 0.015,
    width: 0.008,
    sharpness: 0.019,
    mean_opacity: 0.0,
    mean_scale: 0.0,
    newton: 0.3,
};
/// Step of the bias correction: the second moment's is 2 there, and steps are about as long as the rate.
const STEP: u32 = 700;

/// Stage of the rows from scene to gradients, and the variants whose times are what determinism costs.
pub(super) const WHOLE: &str = "(render backward)";
pub(super) const DETERMINISTIC: &str = "all";
pub(super) const ATOMIC: &str = "all, float atomics";

pub(super) fn cases(
    bench: &mut Bench<'_>,
    scene: &Scene,
    ordered: &Ordered,
    twin: &reference::Rendered,
    options: &Options,
) -> Result<()> {
    let touched = gradients(bench, scene, ordered, options)?;
    for part in &parts(scene) {
        for opacity_only in [true, false] {
            // A compensated step is the same step.
            if options.compensate || opacity_only && part.segment == Segment::Supplement {
                continue;
            }
            for sparse in [false, true] {
                step(bench, scene, ordered, part, part.lesson(options, opacity_only, sparse), &touched)?;
            }
        }
        if !options.compensate && scene.degree != BETAS {
            newton(bench, scene, ordered, part, false)?;
        }
    }
    if scene.model.has_supplement() && !options.compensate {
        steps_done(bench)?;
    }
    whole(bench, scene, ordered, twin, options, &format!("{DETERMINISTIC}{}", scene.suffix(options.compensate)))
}

/// Gradients of a whole picture, and a step of each segment.
pub(super) fn check(
    bench: &mut Bench<'_>,
    scene: &Scene,
    ordered: &Ordered,
    twin: &reference::Rendered,
    options: &Options,
) -> Result<()> {
    whole(bench, scene, ordered, twin, options, "")?;
    parts(scene).iter().try_for_each(|part| step(bench, scene, ordered, part, part.lesson(options, false, false), &[]))
}

/// What a raster that packs its records is asked, with moments that are packed too.
pub(super) fn packed_cases(bench: &mut Bench<'_>, scene: &Scene, ordered: &Ordered, options: &Options) -> Result<()> {
    let touched = gradients(bench, scene, ordered, options)?;
    for part in &parts(scene) {
        for opacity_only in [true, false] {
            if opacity_only && part.segment == Segment::Supplement {
                continue;
            }
            let lesson = Lesson { packed: true, ..part.lesson(options, opacity_only, false) };
            step(bench, scene, ordered, part, lesson, &touched)?;
        }
        if scene.degree != BETAS {
            newton(bench, scene, ordered, part, true)?;
        }
    }
    Ok(())
}

/// What project_backward makes of the raster's own records, and which Gaussians they are of.
fn gradients(bench: &mut Bench<'_>, scene: &Scene, ordered: &Ordered, options: &Options) -> Result<Vec<bool>> {
    let raster = &ordered.renderer.raster;
    let packed = raster.packs_records();
    let own = read_records(raster, ordered.isects.isect_slots.len())?;
    let own: Vec<Record> = own.iter().map(|record| record.map(f64::from)).collect();
    let sizes: Vec<Record> = own.iter().map(|record| record.map(f64::abs)).collect();
    let Ordered { splats, tile_counts, isects, .. } = ordered;
    let (params, view) = (&scene.params, &scene.view);
    let want = project_backward(params, view, options, splats, tile_counts, isects, &own);
    let terms = magnitudes(params, view, options, splats, &sum_records(tile_counts, isects, &sizes));
    for part in &parts(scene) {
        for (opacity_only, name) in [(true, ", opacity only"), (false, ", all")] {
            if opacity_only && part.segment == Segment::Supplement {
                continue;
            }
            let lesson = Lesson { packed, ..part.lesson(options, opacity_only, false) };
            let how = if packed { ", packed records" } else { "" };
            let variant = format!("{}{name}{how}{}", part.name, scene.suffix(options.compensate));
            let mut row = bench.row("project_backward", variant);
            row.chosen = !options.compensate && !packed;
            let (gradients, time) = part.gradients(bench, scene, ordered, lesson)?;
            compare(&mut row, scene, part, &gradients, &want.params, &terms);
            row.time = time;
            row.work = part.work(scene, ordered, &lesson, false);
            bench.push(row);
        }
    }
    Ok(want.touched)
}

/// From scene to gradients, against a twin that shares nothing with the device but the scene.
pub(super) fn whole(
    bench: &mut Bench<'_>,
    scene: &Scene,
    ordered: &Ordered,
    twin: &reference::Rendered,
    options: &Options,
    variant: &str,
) -> Result<()> {
    let mut row = bench.row(WHOLE, variant);
    row.chosen = !options.compensate && !ordered.renderer.raster.by_gaussian();
    let grad = image_grad(&twin.blended, Margin::gradient);
    let flat: Vec<f32> = grad.iter().flatten().map(|&g| g as f32).collect();
    ordered.renderer.raster.buffers.image_grad.upload(0, &flat)?;
    let want = twin.backward(&scene.params, &scene.view, options, &grad);
    let (splats, isects) = (&twin.projected.splats, &twin.isects);
    let sizes = blend_backward_magnitudes(splats, isects, &twin.blended.image, &grad);
    let sizes = sum_records(&twin.projected.tile_counts, isects, &sizes);
    let terms = magnitudes(&scene.params, &scene.view, options, splats, &sizes);
    let times = bench.time(|recorder| ordered.record_blend_backward(recorder, scene))?;
    let mut total = times.sum();
    for part in &parts(scene) {
        let (gradients, time) = part.gradients(bench, scene, ordered, part.lesson(options, false, false))?;
        compare(&mut row, scene, part, &gradients, &want.params, &terms);
        total = total.zip(time).map(|(a, b)| a + b);
    }
    row.time = total;
    bench.push(row);
    Ok(())
}

/// Gaussians that learn alike.
struct Part {
    name: &'static str,
    segment: Segment,
    /// Gaussian index of the first, and how many.
    first: usize,
    count: usize,
}

fn parts(scene: &Scene) -> Vec<Part> {
    let [base, supplement] = Segment::ALL.map(|segment| scene.model.count_of(segment) as usize);
    let base_part = Part { name: "base", segment: Segment::Base, first: 0, count: base };
    let supplement_part = Part { name: "lobes", segment: Segment::Supplement, first: base, count: supplement };
    [base_part, supplement_part].into_iter().filter(|part| part.count > 0).collect()
}

/// Planes of geometry, SH and lobes.
type Columns = [Vec<Vec<f32>>; 3];

impl Part {
    fn lesson(&self, options: &Options, opacity_only: bool, sparse: bool) -> Lesson {
        let compensate = options.compensate;
        Lesson { opacity_only, sparse, compensate, ..Lesson::new(self.segment) }
    }

    fn seen<'a>(&self, scene: &'a Scene, ordered: &'a Ordered) -> Seen<'a> {
        Seen {
            model: &scene.model,
            views: &scene.views,
            view: 0,
            raster: &ordered.renderer.raster,
            degree: scene.degree,
            status: &ordered.status,
        }
    }

    /// What the kernel adds up for one view, and the time of that.
    fn gradients(
        &self,
        bench: &Bench<'_>,
        scene: &Scene,
        ordered: &Ordered,
        lesson: Lesson,
    ) -> Result<(Columns, Option<f64>)> {
        let learner = Learner::new(&scene.model, lesson, true)?;
        let times = bench.time(|recorder| {
            learner.record_begin(recorder);
            learner.record_add(recorder, &self.seen(scene, ordered));
        })?;
        let Some(gradients) = learner.gradients() else { return Ok((Columns::default(), None)) };
        Ok((columns(gradients)?, times.of("project_backward")))
    }

    fn work(&self, scene: &Scene, ordered: &Ordered, lesson: &Lesson, step: bool) -> Work {
        let count = self.count as f64;
        let slots: f64 = ordered.tile_counts[self.first..][..self.count].iter().map(|&n| f64::from(n)).sum();
        let records = match (ordered.renderer.raster.packs_records(), lesson.opacity_only) {
            (true, _) => 16.0,
            (false, true) => 12.0,
            (false, false) => 36.0,
        };
        let lobes = if self.segment == Segment::Supplement { LOBE_PLANES } else { 0 };
        let planes = if lesson.opacity_only { 1 } else { GEOMETRY_PLANES + layout::sh_planes(scene.degree) + lobes };
        // Parameter and both moments, read and written; or the gradient added to what there was.
        let of_plane = match (step, lesson.packed) {
            (true, false) => 6.0,
            (true, true) => 4.0,
            (false, _) => 3.0,
        };
        Work { bytes: records * slots + count * 4.0 * (2.0 + of_plane * planes as f64), operations: 0.0 }
    }

    /// Groups of parameters that such a lesson moves, each with its rate.
    fn groups(&self, scene: &Scene, opacity_only: bool) -> Vec<(Group, f64)> {
        let learns = |(group, _): &(Group, f32)| match opacity_only {
            true => group.array == Array::Geometry && group.planes.start == OPACITY,
            false => group.array != Array::Lobes || self.segment == Segment::Supplement,
        };
        let groups = layout::groups(scene.degree).into_iter().zip(RATES.by_group()).filter(learns);
        groups.map(|(group, rate)| (group, f64::from(rate))).collect()
    }
}

fn columns(beside: &Beside) -> Result<Columns> {
    Ok([beside.geometry.download()?, beside.sh.download()?, beside.lobes.download()?])
}

/// Planes that gradients and moments have: opacity's are the first where it learns alone.
fn beside(group: &Group, of: &[Vec<f32>]) -> std::ops::Range<usize> {
    let alone = group.array == Array::Geometry && of.len() < GEOMETRY_PLANES;
    if alone { 0..1 } else { group.planes.clone() }
}

fn compare(row: &mut Row, scene: &Scene, part: &Part, got: &Columns, want: &Params, terms: &Params) {
    let opacity_only = got[1].is_empty();
    for (group, _) in part.groups(scene, opacity_only) {
        let of_group = &got[group.array as usize];
        let got = beside(&group, of_group).flat_map(|p| of_group[p][..part.count].iter().copied());
        let want = want.group(&group, part.first, part.count);
        let terms = terms.group(&group, part.first, part.count);
        row.sums(got.zip(want.zip(terms)).map(|(got, (want, terms))| (got, want, terms)).collect::<Vec<_>>());
    }
}

/// One Adam step, judged by the kernel's own gradients: that of project_backward, and that of adam.
fn step(
    bench: &mut Bench<'_>,
    scene: &Scene,
    ordered: &Ordered,
    part: &Part,
    lesson: Lesson,
    touched: &[bool],
) -> Result<()> {
    let (model, count) = (&scene.model, part.count);
    let parameters = model.part(part.segment);
    let parameters = [&parameters.geometry, &parameters.sh, &parameters.lobes];
    let original = read(parameters)?;
    let mut before = original.clone();
    // Some lobes stand at the ends of their ranges, of opacity and of betas.
    let mut at_ends = vec![(2, layout::LOBE_WIDTH, [0.0101, 0.9999]), (2, layout::LOBE_SHARPNESS, [-1.999, 7.999])];
    if scene.degree == BETAS {
        at_ends.extend([8, 14].map(|plane| (1, plane, [-1.386, 6.999])));
    }
    for (array, plane, ends) in at_ends {
        for lobe in before[array].get_mut(plane).into_iter().flat_map(|values| values.chunks_mut(4)) {
            lobe.iter_mut().zip(ends).for_each(|(value, end)| *value = end);
        }
    }
    write(parameters, &before)?;
    let (own, _) = part.gradients(bench, scene, ordered, lesson)?;
    let learners =
        [("project_backward", Learner::new(model, lesson, false)?), ("adam", Learner::new(model, lesson, true)?)];
    // First moments as large as the gradients around them, second ones of their squares: no step is cut off or explodes.
    let moments = |array: usize| -> Vec<Vec<f32>> {
        let of_plane = |(p, plane): (usize, &Vec<f32>)| {
            let rms = (plane.iter().map(|g| g * g).sum::<f32>() / count as f32).sqrt() + 1e-6;
            let unit = move |i: usize| (noise((p * count + i) as u32) >> 8) as f32 / 16_777_216.0;
            let first = (0..count).map(|i| rms * (unit(i) - 0.5)).collect();
            let second = (0..count).map(|i| rms * rms * (unit(i) + 0.1)).collect();
            [first, second]
        };
        own[array].iter().take(learning(&own, array)).enumerate().flat_map(of_plane).collect()
    };
    let mut start: Columns = [moments(0), moments(1), moments(2)];
    let places = Places { packed: lesson.packed, opacity_only: lesson.opacity_only, newton: false };
    let words = if lesson.packed { packed(&mut start) } else { start.clone() };
    let stored = places.stored(&words, beside_planes(&learners[0].1));
    let name = match (lesson.opacity_only, lesson.sparse) {
        (true, true) => "step of opacity, sparse",
        (true, false) => "step of opacity",
        (false, true) => "step, sparse",
        (false, false) => "step",
    };
    let seen = part.seen(scene, ordered);
    for (stage, learner) in &learners {
        let prepare = || -> Result<()> {
            write(parameters, &before)?;
            write(learner.moments.all(), &stored)
        };
        let times = bench.time_after(prepare, |recorder| {
            if learner.gradients().is_some() {
                learner.record_begin(recorder);
                learner.record_add(recorder, &seen);
                learner.record_adam(recorder, model, scene.degree, &RATES, STEP - 1, &ordered.status);
            } else {
                learner.record_step(recorder, &seen, &RATES, STEP - 1);
            }
        })?;
        let (after, after_moments) = (read(parameters)?, read(learner.moments.all())?);
        let packed = if lesson.packed { ", packed" } else { "" };
        let mut row = bench.row(stage, format!("{}, {name}{packed}{}", part.name, scene.suffix(false)));
        // Training steps at once.
        row.chosen = learner.gradients().is_none();
        let mut otherwise = 0;
        let mut words = 0;
        for (group, rate) in part.groups(scene, lesson.opacity_only) {
            let array = group.array as usize;
            let planes = beside(&group, &own[array]);
            for (p, at) in group.planes.clone().zip(planes) {
                let wide = |values: &[f32]| -> Vec<f64> { values[..count].iter().map(|&v| f64::from(v)).collect() };
                let (mut value, gradients) = (wide(&before[array][p]), wide(&own[array][at]));
                let (mut first, mut second) = (wide(&start[array][2 * at]), wide(&start[array][2 * at + 1]));
                let touched = lesson.sparse.then(|| &touched[part.first..][..count]);
                let rate = [PlaneRate::of(&group, p, rate)];
                adam(&mut value, &gradients, &mut first, &mut second, count, count, &rate, Some(STEP), touched);
                // Each plane by itself: their magnitudes differ.
                row.numbers(after[array][p].iter().copied().zip(value));
                let lies = places.of(array, at);
                if !lesson.packed {
                    row.numbers(after_moments[array][lies[0]].iter().copied().zip(first));
                    row.numbers(after_moments[array][lies[1]].iter().copied().zip(second));
                    continue;
                }
                words += count;
                let terms = terms_of(&start[array][2 * at], &gradients);
                otherwise += other_words(&mut row, &after_moments[array][lies[0]], [&first, &second], &terms, p);
            }
        }
        if lesson.packed {
            row.flips(otherwise, words);
        }
        row.time = times.of(stage);
        row.work = part.work(scene, ordered, &lesson, true);
        bench.push(row);
    }
    write(parameters, &original)
}

/// A probe of the curvature and one step of Newton's, judged by the kernel's own gradients.
fn newton(bench: &mut Bench<'_>, scene: &Scene, ordered: &Ordered, part: &Part, is_packed: bool) -> Result<()> {
    let (model, count) = (&scene.model, part.count);
    let parameters = model.part(part.segment);
    let parameters = [&parameters.geometry, &parameters.sh, &parameters.lobes];
    let before = read(parameters)?;
    let lesson = Lesson { packed: is_packed, ..Lesson::new(part.segment) };
    let (own, _) = part.gradients(bench, scene, ordered, lesson)?;
    let learner = Learner::new(model, Lesson { newton: true, ..lesson }, false)?;
    let unit = |i: usize| (noise(i as u32) >> 8) as f32 / 16_777_216.0;
    // Curvatures of which a step of some rates follows, or one that is cut off; of a third nothing is known, and of a fifth so little is
    // there that gradients are far beyond its root.
    let moments = |array: usize| -> Vec<Vec<f32>> {
        let of_plane = |(p, plane): (usize, &Vec<f32>)| {
            let rms = (plane.iter().map(|g| g * g).sum::<f32>() / count as f32).sqrt() + 1e-6;
            let first = (0..count).map(|i| rms * (unit(p * count + i) - 0.5)).collect();
            let second = |i: usize| match (i.is_multiple_of(3), i.is_multiple_of(5)) {
                (true, _) => 0.0,
                (_, true) => 1e-4 * rms * rms,
                _ => rms * 10.0 * (unit(p * count + i) + 0.05),
            };
            [first, (0..count).map(second).collect()]
        };
        own[array].iter().take(learning(&own, array)).enumerate().flat_map(of_plane).collect()
    };
    let mut start: Columns = [moments(0), moments(1), moments(2)];
    let places = Places { packed: is_packed, opacity_only: false, newton: true };
    let words = if is_packed { packed(&mut start) } else { start.clone() };
    let mut stored = places.stored(&words, beside_planes(&learner));
    stored[1] = sh_stored(&mut start[1], is_packed);
    let clamped = clamped_in_probes(scene, ordered, part, &start[1])?;
    let seen = part.seen(scene, ordered);
    let how = if is_packed { ", packed" } else { "" };
    for (name, probes) in [("probe", true), ("Newton's step", false)] {
        let prepare = || -> Result<()> {
            write(parameters, &before)?;
            write(learner.moments.all(), &stored)
        };
        let times = bench.time_after(prepare, |recorder| match probes {
            true => learner.record_probe(recorder, &seen, STEP - 1),
            false => learner.record_step(recorder, &seen, &RATES, STEP - 1),
        })?;
        let (after, after_moments) = (read(parameters)?, read(learner.moments.all())?);
        let mut row = bench.row("project_backward", format!("{}, {name}{how}{}", part.name, scene.suffix(false)));
        let ([mut otherwise, mut words], mut firsts) = ([0; 2], Vec::new());
        for (group, rate) in part.groups(scene, false) {
            let array = group.array as usize;
            for p in group.planes.clone() {
                let wide = |values: &[f32]| -> Vec<f64> { values[..count].iter().map(|&v| f64::from(v)).collect() };
                let (mut value, mut gradients) = (wide(&before[array][p]), wide(&own[array][p]));
                if probes && let Some(off) = clamped.get(array).and_then(|planes| planes.get(p)) {
                    gradients.iter_mut().zip(off).for_each(|(gradient, off)| *gradient += off);
                }
                let (mut first, mut second) = (wide(&start[array][2 * p]), wide(&start[array][2 * p + 1]));
                let rate = PlaneRate::of(&group, p, rate);
                for i in 0..count {
                    match probes {
                        true => curvature_one(gradients[i], &mut second[i]),
                        false => {
                            let part = f64::from(RATES.newton);
                            newton_one(&mut value[i], gradients[i], &mut first[i], second[i], &rate, part);
                        }
                    }
                }
                row.numbers(after[array][p].iter().copied().zip(value));
                let terms = terms_of(&start[array][2 * p], &gradients);
                if array == Array::Sh as usize && p >= 3 {
                    // First moments alone, which a probe leaves.
                    firsts.push([first, second, terms]);
                } else if is_packed {
                    words += count;
                    otherwise += other_words(&mut row, &after_moments[array][p], [&first, &second], &terms, p);
                } else {
                    let [at, second_at] = places.of(array, p);
                    row.numbers(after_moments[array][at].iter().copied().zip(first));
                    row.numbers(after_moments[array][second_at].iter().copied().zip(second));
                }
            }
        }
        let sh = &after_moments[Array::Sh as usize];
        if !is_packed {
            for (got, [want, ..]) in sh[4 + 3..].iter().zip(&firsts) {
                row.numbers(got.iter().copied().zip(want.iter().copied()));
            }
        } else if probes {
            (3..sh.len()).for_each(|w| row.unequal(u64::from(sh[w] != stored[1][w])));
        } else {
            for (k, channels) in firsts.as_chunks::<3>().0.iter().enumerate() {
                words += count;
                let of = [0, 1, 2].map(|what| channels.each_ref().map(|channel| &channel[what][..]));
                otherwise += other_firsts(&mut row, &sh[3 + k], of, 3 * (k + 1));
            }
        }
        if is_packed {
            row.flips(otherwise, words);
        }
        row.time = times.of("project_backward");
        row.work = part.work(scene, ordered, &learner.lesson, true);
        bench.push(row);
    }
    write(parameters, &before)
}

/// What a probe's gradients have more than a step's, by array (but for lobes) and plane: they pass a clamped channel by what is known of its
/// curvature, the second of each pair of `sh`, and not by its sign.
fn clamped_in_probes(scene: &Scene, ordered: &Ordered, part: &Part, sh: &[Vec<f32>]) -> Result<[Vec<Vec<f64>>; 2]> {
    let Ordered { splats, tile_counts, isects, renderer, .. } = ordered;
    let (params, view) = (&scene.params, &scene.view);
    let options = Options { active_degree: scene.degree, ..Default::default() };
    let own = read_records(&renderer.raster, isects.isect_slots.len())?;
    let own: Vec<Record> = own.iter().map(|record| record.map(f64::from)).collect();
    let mut known = vec![[1.0; 3]; params.count];
    for (i, known) in known[part.first..][..part.count].iter_mut().enumerate() {
        *known = [1, 3, 5].map(|second| f64::from(sh[second][i]));
    }
    let step = project_backward(params, view, &options, splats, tile_counts, isects, &own).params;
    let records = sum_records(tile_counts, isects, &own);
    let probe = probe_backward(params, view, &options, splats, records, &known).params;
    let off = |step: &[f64], probe: &[f64]| -> Vec<Vec<f64>> {
        let planes = step.chunks(params.stride).zip(probe.chunks(params.stride));
        let of = |values: &[f64]| values[part.first..][..part.count].to_vec();
        planes.map(|(step, probe)| of(probe).into_iter().zip(of(step)).map(|(a, b)| a - b).collect()).collect()
    };
    Ok([off(&step.geometry, &probe.geometry), off(&step.sh, &probe.sh)])
}

/// Planes of an array that learn, of which `gradients` are: those of the geometry have one more, which counts views.
fn learning(gradients: &Columns, array: usize) -> usize {
    gradients[array].len() - usize::from(array == Array::Geometry as usize)
}

/// Where moments lie (`glsl/shared/model.glsl`, `adam.glsl`).
struct Places {
    packed: bool,
    opacity_only: bool,
    newton: bool,
}

impl Places {
    /// The planes of both moments of plane p of an array, the same one where both are a word.
    fn of(&self, array: usize, p: usize) -> [usize; 2] {
        match (self.packed, self.opacity_only, self.newton && array == Array::Sh as usize) {
            (true, ..) => [p, p],
            (_, true, _) => [p, p + 1],
            (.., true) => [4 + p, p],
            _ => [8 * (p / 4) + p % 4, 8 * (p / 4) + p % 4 + 4],
        }
    }

    /// Pairs of moments, or words of them, as the planes that a learner has; 0 in what is none of these.
    fn stored(&self, moments: &Columns, planes: [usize; 3]) -> Columns {
        let each = if self.packed { 1 } else { 2 };
        let of_array = |array: usize| {
            let moments = &moments[array];
            let mut stored = vec![vec![0.0; moments.first().map_or(0, Vec::len)]; planes[array]];
            for (p, pair) in moments.chunks(each).enumerate() {
                let at = self.of(array, p);
                pair.iter()
                    .zip(at)
                    .filter(|_| at[0].max(at[1]) < planes[array])
                    .for_each(|(m, at)| stored[at].clone_from(m));
            }
            stored
        };
        [of_array(0), of_array(1), of_array(2)]
    }
}

/// The words of pairs of moments; the moments become what their words say.
fn packed(moments: &mut Columns) -> Columns {
    moments.each_mut().map(|array| packed_pairs(array))
}

fn packed_pairs(pairs: &mut [Vec<f32>]) -> Vec<Vec<f32>> {
    let words = |pair: &mut [Vec<f32>]| -> Vec<f32> {
        let [first, second] = pair else { return Vec::new() };
        let word = |(m, v): (&mut f32, &mut f32)| {
            let word = pack_moments([f64::from(*m), f64::from(*v)], 0);
            [*m, *v] = unpack_moments(word).map(|moment| moment as f32);
            f32::from_bits(word)
        };
        first.iter_mut().zip(second).map(word).collect()
    };
    pairs.chunks_mut(2).map(words).collect()
}

/// The sizes of what makes a first moment: of `before` and the gradient.
fn terms_of(before: &[f32], gradients: &[f64]) -> Vec<f64> {
    before.iter().zip(gradients).map(|(m, g)| f64::from(m.abs()) + g.abs()).collect()
}

/// What Newton's steps store beside harmonics of `pairs`, a first moment and a curvature of each plane: of those beyond the constant one
/// the first moments. Their curvatures become those of the constant one, and what is packed what its words say.
fn sh_stored(pairs: &mut [Vec<f32>], is_packed: bool) -> Vec<Vec<f32>> {
    let mut stored: Vec<Vec<f32>> = match is_packed {
        true => packed_pairs(&mut pairs[..6]),
        false => {
            let [seconds, firsts] = [1, 0].map(|m| [m, m + 2, m + 4].map(|m| pairs[m].clone()));
            let none = vec![vec![0.0; pairs[0].len()]];
            [&seconds[..], &none, &firsts].concat()
        }
    };
    for p in 3..pairs.len() / 2 {
        pairs[2 * p + 1] = pairs[2 * (p % 3) + 1].clone();
    }
    for band in pairs[6..].chunks_mut(6) {
        if !is_packed {
            stored.extend([0, 2, 4].map(|first| band[first].clone()));
            continue;
        }
        let count = band[0].len();
        let word = |i: usize| {
            let [first, curvature] = [0, 1].map(|m| std::array::from_fn(|c| f64::from(band[2 * c + m][i])));
            let word = pack_firsts(first, curvature, 0);
            let kept = unpack_firsts(word, curvature);
            (0..3).for_each(|c| band[2 * c][i] = kept[c] as f32);
            f32::from_bits(word)
        };
        stored.push((0..count).map(word).collect());
    }
    stored
}

/// How many words of plane `plane` are not those of the moments; such as are not even neighbours of theirs are wrong: the second moment
/// by one step, the first by one and by what its `terms`, which may cancel, lose in float32.
fn other_words(row: &mut Row, got: &[f32], [first, second]: [&[f64]; 2], terms: &[f64], plane: usize) -> usize {
    let mut others = 0;
    for (i, got) in got.iter().map(|word| word.to_bits()).enumerate() {
        let want = pack_moments([first[i], second[i]], dither_of(i as u32, plane as u32, STEP - 1));
        others += usize::from(got != want);
        let [m, want_m] = [got, want].map(|word| unpack_moments(word)[0]);
        let near = (m - want_m).abs() <= want_m.abs() / 127.0 + 4e-7 * terms[i];
        row.unequal(u64::from(!near || (got >> 16).abs_diff(want >> 16) > 1));
    }
    others
}

/// The same of three first moments in a word, of the coefficient whose first plane is `plane`.
fn other_firsts(row: &mut Row, got: &[f32], [first, curvature, terms]: [[&[f64]; 3]; 3], plane: usize) -> usize {
    let mut others = 0;
    for (i, got) in got.iter().map(|word| word.to_bits()).enumerate() {
        let [first, curvature, terms] = [first, curvature, terms].map(|channels| channels.map(|values| values[i]));
        let want = pack_firsts(first, curvature, dither_of(i as u32, plane as u32, STEP - 1));
        others += usize::from(got != want);
        let [got, want] = [got, want].map(|word| unpack_firsts(word, curvature));
        let near = |c: usize| (got[c] - want[c]).abs() <= want[c].abs() / 15.0 + 4e-7 * terms[c];
        row.unequal(u64::from(!(0..3).all(near)));
    }
    others
}

/// Planes of the moments.
fn beside_planes(learner: &Learner) -> [usize; 3] {
    learner.moments.all().map(Planes::planes)
}

fn read(planes: [&Planes; 3]) -> Result<Columns> {
    Ok([planes[0].download()?, planes[1].download()?, planes[2].download()?])
}

/// The scene has one page.
fn write(planes: [&Planes; 3], columns: &Columns) -> Result<()> {
    for (planes, columns) in planes.into_iter().zip(columns).filter(|(planes, _)| planes.planes() > 0) {
        planes.restore(&columns.concat(), columns[0].len())?;
    }
    Ok(())
}

fn steps_done(bench: &mut Bench<'_>) -> Result<()> {
    let stage = step_done::Stage::new(bench.context, &step_done::Spec { workgroup_size: 1 })?;
    let mut row = bench.row("step_done", "");
    for failed in [false, true] {
        let mut before = Status::default();
        before.0[status::STEPS] = 41;
        if failed {
            before.fail(Resource::SupplementGaussians, 5);
        }
        let there = Buffer::from_slice(bench.context, "status", &before.0)?;
        let times = bench.time_after(
            || Ok(there.upload(0, &before.0)?),
            |recorder| stage.record(recorder, &step_done::Buffers { status: &there }, &step_done::Push {}, 1),
        )?;
        let mut want = before.0;
        reference::step_done::step_done(&mut want);
        row.words(&there.download()?, &want);
        row.time = times.of("step_done");
    }
    row.work.bytes = 12.0;
    bench.push(row);
    Ok(())
}
