//! From intersection records to gradients of Gaussians, the Adam step on them, and the counting of steps.

use super::{
    Bench,
    judge::{Row, Work},
    raster::{Ordered, Scene, image_grad, records},
};
use crate::{
    error::Result,
    gpu::{Buffer, Recorder},
    pipelines::{model::GEOMETRY_PLANES, model::LOBE_PLANES, raster::WORKGROUP},
    reference::{
        self, Options,
        adam::{PlaneRate, adam, lobe_rates},
        blend::Margin,
        project_backward::{Gradients, project_backward},
    },
    stages::{
        project_backward::{self as stage, ProjectBackward},
        step_done::{self, OVERFLOW, STATUS_WORDS, STEPS, StepDone},
    },
};

/// Every rate: large enough that a wrong step is not a rounding of the parameter.
const RATE: f32 = 0.01;
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
    let suffix = scene.suffix(options.compensate);
    let parts = parts(scene);
    let isect_grads = records(ordered)?;
    let Ordered { splats, tile_counts, isects, .. } = ordered;
    let want = project_backward(&scene.params, &scene.view, options, splats, tile_counts, isects, &isect_grads);
    for part in &parts {
        for (opacity_only, name) in [(true, "opacity only"), (false, "all")] {
            if opacity_only && part.lobes {
                continue;
            }
            let mut row = bench.row("project_backward", format!("{}, {name}{suffix}", part.name));
            row.chosen = !options.compensate;
            let run = Run { scene, ordered, part, compensate: options.compensate, opacity_only, mode: Mode::Gradients };
            let (moments, time) = run.gradients(bench)?;
            compare(&mut row, scene, part, opacity_only, &moments, &want);
            row.time = time;
            row.work = run.work();
            bench.push(row);
        }
    }
    // A compensated step is the same step.
    if !options.compensate {
        for part in &parts {
            for (opacity_only, sparse) in [(false, false), (false, true), (true, true)] {
                if !(opacity_only && part.lobes) {
                    step(bench, scene, ordered, part, opacity_only, sparse, &want)?;
                }
            }
        }
        if scene.model.supplement_count > 0 {
            steps_done(bench)?;
        }
    }

    whole(bench, scene, ordered, twin, options, &format!("{DETERMINISTIC}{suffix}"))
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
    row.chosen = !options.compensate && !ordered.raster.by_gaussian();
    let grad = image_grad(&twin.blended, Margin::gradient);
    let flat: Vec<f32> = grad.iter().flatten().map(|&g| g as f32).collect();
    ordered.raster.image_grad.upload(0, &flat)?;
    let want = twin.backward(&scene.params, &scene.view, options, &grad);
    let times = bench.time(|r| ordered.raster.record_blend_backward(r, &ordered.grid, &scene.views.frames, 0))?;
    let mut total = times.sum();
    for part in &parts(scene) {
        let run =
            Run { scene, ordered, part, compensate: options.compensate, opacity_only: false, mode: Mode::Gradients };
        let (moments, time) = run.gradients(bench)?;
        compare(&mut row, scene, part, false, &moments, &want);
        total = total.zip(time).map(|(a, b)| a + b);
    }
    row.time = total;
    bench.push(row);
    Ok(())
}

/// Gaussians that learn alike.
struct Part {
    name: &'static str,
    first: usize,
    count: usize,
    lobes: bool,
}

fn parts(scene: &Scene) -> Vec<Part> {
    let (base, supplement) = (scene.model.base_count as usize, scene.model.supplement_count as usize);
    let base_part = Part { name: "base", first: 0, count: base, lobes: false };
    let supplement_part = Part { name: "lobes", first: base, count: supplement, lobes: true };
    [base_part, supplement_part].into_iter().filter(|part| part.count > 0).collect()
}

enum Mode {
    Gradients,
    Step { sparse: bool },
}

/// Moments, or gradients in their first planes: geometry, SH and lobes.
type Moments = [Vec<f32>; 3];

struct Run<'a> {
    scene: &'a Scene,
    ordered: &'a Ordered,
    part: &'a Part,
    compensate: bool,
    opacity_only: bool,
    mode: Mode,
}

impl Run<'_> {
    fn stage(&self, bench: &Bench<'_>) -> Result<ProjectBackward> {
        let spec = stage::Spec {
            workgroup_size: WORKGROUP,
            compensate: self.compensate,
            lobes: self.part.lobes,
            opacity_only: self.opacity_only,
            sparse: matches!(self.mode, Mode::Step { sparse: true }),
            gradients: matches!(self.mode, Mode::Gradients),
        };
        Ok(ProjectBackward::new(bench.context, &spec)?)
    }

    /// `parameters` are geometry, SH and lobes.
    fn record(
        &self,
        recorder: &mut Recorder,
        stage: &ProjectBackward,
        parameters: [&Buffer<f32>; 3],
        moments: [&Buffer<f32>; 3],
    ) {
        let (scene, ordered) = (self.scene, self.ordered);
        let [geometry, sh, lobes] = parameters;
        let [geometry_moments, sh_moments, lobe_moments] = moments;
        let correction = |beta: f64| (1.0 / (1.0 - beta.powi(STEP as i32))) as f32;
        stage.record(
            recorder,
            &stage::Buffers {
                views: &scene.views.views,
                status: &ordered.status,
                tile_counts: &ordered.raster.tile_counts,
                first_slot: &ordered.raster.first_slot,
                records: &ordered.raster.records,
                geometry,
                sh,
                lobes,
                geometry_moments,
                sh_moments,
                lobe_moments,
            },
            &stage::Push {
                first: self.part.first as u32,
                count: self.part.count as u32,
                stride: scene.model.stride,
                moment_stride: self.part.count as u32,
                lobe_stride: scene.model.lobe_stride,
                view: 0,
                active_degree: scene.degree,
                stored_coefficients: scene.model.coefficients(),
                rate_mean: RATE,
                rate_log_scale: RATE,
                rate_quat: RATE,
                rate_opacity: RATE,
                rate_dc: RATE,
                rate_sh: RATE,
                rate_direction: RATE,
                rate_width: RATE,
                rate_sharpness: RATE,
                first_correction: correction(reference::adam::BETA1),
                second_correction: correction(reference::adam::BETA2),
                lobe_first_correction: correction(reference::adam::BETA1),
                lobe_second_correction: correction(reference::adam::BETA2),
                by_gaussian: ordered.raster.by_gaussian().into(),
            },
        );
    }

    fn gradients(&self, bench: &Bench<'_>) -> Result<(Moments, Option<f64>)> {
        let stage = self.stage(bench)?;
        let model = &self.scene.model;
        let planes = planes(self.scene);
        let zeros = |p: usize| Buffer::<f32>::zeroed(bench.context, "gradients", 2 * p * self.part.count);
        let into = [zeros(planes[0])?, zeros(planes[1])?, zeros(planes[2])?];
        let times = bench.time(|recorder| {
            self.record(recorder, &stage, [&model.geometry, &model.sh, &model.lobes], [&into[0], &into[1], &into[2]]);
        })?;
        let moments = [into[0].download()?, into[1].download()?, into[2].download()?];
        Ok((moments, times.of("project_backward")))
    }

    fn work(&self) -> Work {
        let [geometry, sh, lobes] = planes(self.scene).map(|p| p as f64);
        let count = self.part.count as f64;
        let isects = 36.0 * self.slots();
        let planes = geometry + sh + if self.part.lobes { lobes } else { 0.0 };
        let bytes = match (&self.mode, self.opacity_only) {
            (Mode::Gradients, true) => isects / 4.5 + count * 4.0 * (2.0 + 2.0),
            (Mode::Gradients, false) => isects + count * 4.0 * (2.0 + 2.0 * planes),
            // Parameter and both moments, read and written.
            (Mode::Step { .. }, true) => isects / 4.5 + count * 4.0 * (2.0 + 6.0),
            (Mode::Step { .. }, false) => isects + count * 4.0 * (2.0 + 6.0 * planes),
        };
        Work { bytes, operations: 0.0 }
    }

    /// Slots of the part's Gaussians.
    fn slots(&self) -> f64 {
        self.ordered.tile_counts[self.part.first..][..self.part.count].iter().map(|&n| f64::from(n)).sum()
    }
}

/// Planes of geometry, SH and lobes.
fn planes(scene: &Scene) -> [usize; 3] {
    [GEOMETRY_PLANES, 3 * scene.model.coefficients() as usize, LOBE_PLANES]
}

fn compare(row: &mut Row, scene: &Scene, part: &Part, opacity_only: bool, got: &Moments, want: &Gradients) {
    let want = &want.params;
    let count = part.count;
    let group = |row: &mut Row, array: usize, planes: std::ops::Range<usize>| {
        let (values, stride, first) = match array {
            0 => (&want.geometry, want.stride, part.first),
            1 => (&want.sh, want.stride, part.first),
            _ => (&want.lobes, want.lobe_stride, part.first - want.lobe_first.min(part.first)),
        };
        // Opacity alone goes to plane 0.
        let to = |p: usize| if opacity_only { 0 } else { p };
        let pairs = planes.flat_map(|p| (0..count).map(move |i| (p, i)));
        row.gradients(pairs.map(|(p, i)| (got[array][2 * to(p) * count + i], values[p * stride + first + i])));
    };
    if opacity_only {
        return group(row, 0, 10..11);
    }
    // Mean, log scale, quaternion, opacity; DC, SH; direction, width, sharpness.
    [0..3, 3..6, 6..10, 10..11].into_iter().for_each(|planes| group(row, 0, planes));
    group(row, 1, 0..3);
    if scene.degree > 0 {
        group(row, 1, 3..planes(scene)[1]);
    }
    if part.lobes {
        [0..3, 3..4, 4..5].into_iter().for_each(|planes| group(row, 2, planes));
    }
}

/// Parameters of a part and their moments, element i of plane p at p · count + i.
struct State {
    values: Vec<f64>,
    grads: Vec<f64>,
    first: Vec<f64>,
    second: Vec<f64>,
}

/// One Adam step, judged by the kernel's own gradients.
fn step(
    bench: &mut Bench<'_>,
    scene: &Scene,
    ordered: &Ordered,
    part: &Part,
    opacity_only: bool,
    sparse: bool,
    gradients: &Gradients,
) -> Result<()> {
    let context = bench.context;
    let count = part.count;
    let planes = planes(scene);
    let model = &scene.model;
    let run = |mode| Run { scene, ordered, part, compensate: false, opacity_only, mode };
    // Some lobes stand at the ends of their ranges.
    let mut lobes = model.lobes.download()?;
    let lobe_stride = model.lobe_stride as usize;
    for j in 0..model.supplement_count as usize {
        let ends = match j % 4 {
            0 => Some((0.0101, -1.999)),
            1 => Some((0.9999, 7.999)),
            _ => None,
        };
        if let Some((width, sharpness)) = ends {
            lobes[3 * lobe_stride + j] = width;
            lobes[4 * lobe_stride + j] = sharpness;
        }
    }
    let before = [model.geometry.download()?, model.sh.download()?, lobes];
    let buffers = |name: &str, data: &[Vec<f32>; 3]| -> Result<[Buffer<f32>; 3]> {
        let one = |k: usize| Buffer::from_slice(context, name, &data[k]);
        Ok([one(0)?, one(1)?, one(2)?])
    };
    fn refs(buffers: &[Buffer<f32>; 3]) -> [&Buffer<f32>; 3] {
        [&buffers[0], &buffers[1], &buffers[2]]
    }
    let parameters = buffers("parameters", &before)?;
    let zeros = planes.map(|p| vec![0f32; 2 * p * count]);
    let into = buffers("gradients", &zeros)?;
    let gradient_run = run(Mode::Gradients);
    let stage = gradient_run.stage(bench)?;
    let mut recorder = context.recorder("gradients")?;
    gradient_run.record(&mut recorder, &stage, refs(&parameters), refs(&into));
    recorder.submit()?.wait()?;
    let own = [into[0].download()?, into[1].download()?, into[2].download()?];

    // First moments as large as the gradients around them, second ones of their squares: no step is cut off or explodes.
    let start: [Vec<f32>; 3] = std::array::from_fn(|a| {
        let mut start = vec![0f32; own[a].len()];
        for p in 0..planes[a] {
            let plane = &own[a][2 * p * count..(2 * p + 1) * count];
            let rms = (plane.iter().map(|g| g * g).sum::<f32>() / count as f32).sqrt() + 1e-6;
            for i in 0..count {
                let unit = (super::sort::noise((p * count + i) as u32) >> 8) as f32 / 16_777_216.0;
                start[2 * p * count + i] = rms * (unit - 0.5);
                start[(2 * p + 1) * count + i] = rms * rms * (unit + 0.1);
            }
        }
        start
    });
    let moments = buffers("moments", &start)?;
    let step_run = run(Mode::Step { sparse });
    let stage = step_run.stage(bench)?;
    let times = bench.time_after(
        || {
            for k in 0..3 {
                parameters[k].upload(0, &before[k])?;
                moments[k].upload(0, &start[k])?;
            }
            Ok(())
        },
        |recorder| step_run.record(recorder, &stage, refs(&parameters), refs(&moments)),
    )?;

    let touched: Vec<bool> = (0..count).map(|i| gradients.touched[part.first + i]).collect();
    let name = match (opacity_only, sparse) {
        (true, _) => "step of opacity, sparse",
        (false, true) => "step, sparse",
        (false, false) => "step",
    };
    let mut row = bench.row("project_backward", format!("{}, {name}{}", part.name, scene.suffix(false)));
    let free = PlaneRate::free(f64::from(RATE));
    let rate = f64::from(RATE);
    let strides = [model.stride as usize, model.stride as usize, lobe_stride];
    let firsts = [part.first, part.first, 0];
    for a in 0..3 {
        let (used, rates): (Vec<usize>, Vec<PlaneRate>) = match (a, opacity_only) {
            (0, true) => (vec![10], vec![free]),
            (_, true) => continue,
            (2, false) if !part.lobes => continue,
            (2, false) => ((0..5).collect(), lobe_rates(rate, rate, rate).to_vec()),
            (_, false) => ((0..planes[a]).collect(), vec![free; planes[a]]),
        };
        // Planes of the moments: opacity's are the first where it is alone.
        let column = |data: &[f32], k: usize| -> Vec<f64> {
            data[k * count..(k + 1) * count].iter().map(|&v| f64::from(v)).collect()
        };
        let moment = |p: usize| if opacity_only { 0 } else { p };
        let values = |data: &[f32]| -> Vec<f64> {
            let at = |p: usize, i: usize| f64::from(data[p * strides[a] + firsts[a] + i]);
            used.iter().flat_map(|&p| (0..count).map(move |i| at(p, i))).collect()
        };
        let of_moments = |data: &[f32], second: usize| -> Vec<f64> {
            used.iter().flat_map(|&p| column(data, 2 * moment(p) + second)).collect()
        };
        let mut state = State {
            values: values(&before[a]),
            grads: of_moments(&own[a], 0),
            first: of_moments(&start[a], 0),
            second: of_moments(&start[a], 1),
        };
        adam(
            &mut state.values,
            &state.grads,
            &mut state.first,
            &mut state.second,
            count,
            count,
            &rates,
            Some(STEP),
            sparse.then_some(&touched),
        );
        let (after, after_moments) = (parameters[a].download()?, moments[a].download()?);
        for (got, want) in [
            (values(&after), state.values),
            (of_moments(&after_moments, 0), state.first),
            (of_moments(&after_moments, 1), state.second),
        ] {
            // Each plane by itself: their magnitudes differ.
            for (got, want) in got.chunks_exact(count).zip(want.chunks_exact(count)) {
                row.numbers(got.iter().map(|&v| v as f32).zip(want.iter().copied()));
            }
        }
    }
    row.time = times.of("project_backward");
    row.work = step_run.work();
    bench.push(row);
    Ok(())
}

fn steps_done(bench: &mut Bench<'_>) -> Result<()> {
    let stage = StepDone::new(bench.context, &step_done::Spec { workgroup_size: 1 })?;
    let mut row = bench.row("step_done", "");
    for overflow in [0, 5] {
        let mut before = [0; STATUS_WORDS];
        before[OVERFLOW] = overflow;
        before[STEPS] = 41;
        let status = Buffer::from_slice(bench.context, "status", &before)?;
        let times = bench.time_after(
            || Ok(status.upload(0, &before)?),
            |recorder| stage.record(recorder, &step_done::Buffers { status: &status }),
        )?;
        let mut want = before;
        want[STEPS] += u32::from(overflow == 0);
        row.words(&status.download()?, &want);
        row.time = times.of("step_done");
    }
    row.work.bytes = 12.0;
    bench.push(row);
    Ok(())
}
