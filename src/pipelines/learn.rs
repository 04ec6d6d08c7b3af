//! Updates a segment's Gaussians from a view's gradient records: gradients and step in one pass, or gradients
//! of several views first and then one step. Steps are Adam's, or Newton's with a curvature estimated from
//! probes.

use super::{
    model::{Model, Planes, Segment},
    plan::bind,
    raster::Raster,
    views::Views,
};
use crate::{
    gpu::{Buffer, GpuError, Recorder},
    scene::{
        color,
        layout::{GEOMETRY_PLANES, LAST_STEP, LOBE_PLANES, bytes, quads, sh_planes},
    },
    stages::{WORKGROUP, adam, project_backward, types::StepRates},
};

/// Learning rates by parameter, per step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Rates {
    /// Scene units.
    pub mean: f32,
    /// Logarithms of scene units.
    pub log_scale: f32,
    /// Components of quaternions, before normalisation.
    pub quat: f32,
    /// Logits.
    pub opacity: f32,
    /// Constant SH band.
    pub dc: f32,
    /// Other SH bands, or the lobes of spherical betas.
    pub sh: f32,
    /// Directions of lobes.
    pub direction: f32,
    /// T of lobes.
    pub width: f32,
    /// β of lobes.
    pub sharpness: f32,
    /// Weight of the segment's mean opacity in the loss. Only for a learner that steps on each view.
    pub mean_opacity: f32,
    /// Weight of the segment's mean scale in the loss, per scene unit.
    pub mean_scale: f32,
    /// Fraction of the way to the minimum that a Newton step goes. Rates then bound the step to three times
    /// their value.
    pub newton: f32,
}

impl Rates {
    /// All rates times `factor`.
    pub fn times(&self, factor: f32) -> Rates {
        let [mean, log_scale, quat, opacity, dc, sh, direction, width, sharpness] =
            self.by_group().map(|rate| factor * rate);
        Rates { mean, log_scale, quat, opacity, dc, sh, direction, width, sharpness, ..*self }
    }

    /// The rates in the order of [`groups`](crate::scene::layout::groups).
    pub fn by_group(&self) -> [f32; 9] {
        let Rates { mean, log_scale, quat, opacity, dc, sh, direction, width, sharpness, .. } = *self;
        [mean, log_scale, quat, opacity, dc, sh, direction, width, sharpness]
    }
}

/// Selects the parameters of a segment that learn, and the optimiser.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lesson {
    /// The segment that learns.
    pub segment: Segment,
    /// Only opacities learn.
    pub opacity_only: bool,
    /// Skip Gaussians that a step does not blend (SparseAdam).
    pub sparse: bool,
    /// Adam's bias correction, except for lobes, which always have it.
    pub bias_correction: bool,
    /// Opacity compensation, same as in the projection.
    pub compensate: bool,
    /// See [`Policy::packed`](super::session::Policy::packed); must match the raster that makes the
    /// gradients.
    pub packed: bool,
    /// Newton's steps with the curvature from [`Learner::record_probe`], instead of Adam's. Each step then
    /// sees one view, and skips Gaussians that it does not blend.
    pub newton: bool,
    /// Least bands of harmonics that a step uses. Only degrees from this to the segment's have pipelines; a step of fewer bands learns
    /// nothing.
    pub least_degree: u32,
}

impl Lesson {
    /// All parameters learn in every step, with any bands of harmonics and Adam's bias correction.
    pub fn new(segment: Segment) -> Self {
        Lesson {
            segment,
            opacity_only: false,
            sparse: false,
            bias_correction: true,
            compensate: false,
            packed: false,
            newton: false,
            least_degree: 0,
        }
    }
}

/// One Newton step in this number is preceded by a probe.
pub const PROBED_NTH: u32 = 4;
/// Initial fraction of the way to the minimum that a Newton step goes.
pub const NEWTON_PART: f32 = 0.02;

/// Quads of moments per quad of parameters with both moments.
pub(super) fn moments_of(packed: bool) -> usize {
    if packed { 1 } else { 2 }
}

/// Planes of moments for `planes` parameters: rounded up to whole quads if moments are not packed.
pub(crate) fn moment_planes(planes: usize, packed: bool) -> usize {
    if packed { planes } else { 2 * 4 * quads(planes) }
}

/// Planes of moments of harmonics of `degree`. With Newton's steps only the constant band has a curvature,
/// used for all bands: one quad, stored before the first moments. If packed, the other bands store three
/// first moments per word.
pub fn sh_moments(degree: u32, packed: bool, newton: bool) -> usize {
    let all = sh_planes(degree);
    match (newton, packed) {
        (false, _) => moment_planes(all, packed),
        (true, false) => 4 + all,
        (true, true) => 3 + (all - 3) / 3,
    }
}

/// Bytes of a base Gaussian that learns all parameters: of its geometry, and of its color and moments, which
/// [`Room::host`](super::model::Room::host) puts in the host's memory.
pub fn learning_bytes(sh_degree: u32, packed: bool, newton: bool) -> [u64; 2] {
    let moments = moment_planes(LAST_STEP + 1, packed);
    let others = [sh_planes(sh_degree), moments, sh_moments(sh_degree, packed, newton)];
    [bytes(GEOMETRY_PLANES), others.map(bytes).iter().sum()]
}

/// Bytes of a Gaussian beyond its learned ones: 52 of its splat, 40 for each of about six intersections
/// (checked by `tests/invariants/model.rs`), and scores.
pub const WORKING_BYTES: u64 = 320;

/// Planes parallel to a segment's own: moments or gradients.
pub struct Beside {
    /// Parallel to the geometry planes of [`layout`](crate::scene::layout).
    pub geometry: Planes,
    /// Parallel to the planes of harmonics, up to the segment's degree.
    pub sh: Planes,
    /// Parallel to the planes of lobes; empty for a base.
    pub lobes: Planes,
}

impl Beside {
    fn moments(model: &Model, lesson: &Lesson) -> Result<Self, GpuError> {
        let sh = sh_moments(model.part(lesson.segment).sh_degree, lesson.packed, lesson.newton);
        let of = |planes| moment_planes(planes, lesson.packed);
        // An opacity alone has both moments in one quad.
        Self::new(model, lesson, [moments_of(lesson.packed), of(LAST_STEP + 1), sh, of(LOBE_PLANES)])
    }

    /// One extra plane after the geometry's counts views.
    fn gradients(model: &Model, lesson: &Lesson) -> Result<Self, GpuError> {
        let sh = sh_planes(model.part(lesson.segment).sh_degree);
        Self::new(model, lesson, [1 + 1, GEOMETRY_PLANES + 1, sh, LOBE_PLANES])
    }

    /// Numbers of planes: of geometry if only opacity learns, of geometry, of harmonics, and of lobes.
    fn new(model: &Model, lesson: &Lesson, planes: [usize; 4]) -> Result<Self, GpuError> {
        let [opacity, geometry, sh, lobes] = planes;
        // Frozen parameters have none.
        let (geometry, sh, lobes) = match (lesson.opacity_only, lesson.segment) {
            (true, _) => (opacity, 0, 0),
            (false, Segment::Base | Segment::Banded) => (geometry, sh, 0),
            (false, Segment::Supplement) => (geometry, sh, lobes),
        };
        let part = model.part(lesson.segment);
        let zeroed = |name, planes| Planes::zeroed(model.context(), name, planes, part.sh.location(), &part.pages);
        Ok(Beside {
            geometry: zeroed("geometry_beside", geometry)?,
            sh: zeroed("sh_beside", sh)?,
            lobes: zeroed("lobe_beside", lobes)?,
        })
    }

    /// All planes, as [`super::model::Rearrange::record`] takes them.
    pub fn all(&self) -> [&Planes; 3] {
        [&self.geometry, &self.sh, &self.lobes]
    }
}

/// The gradients of several views, and the stages that accumulate and apply them.
struct Accumulated {
    /// One extra plane after the geometry's counts the views that blend the Gaussian.
    gradients: Beside,
    add: Vec<project_backward::Stage>,
    step: Vec<adam::Stage>,
}

/// A lesson with its pipelines and moments.
pub struct Learner {
    /// The parameters and the optimiser.
    pub lesson: Lesson,
    /// First and second moments, or first moments and curvatures, in pages like the model's.
    pub moments: Beside,
    /// The color models to evaluate, one pipeline for each.
    degrees: &'static [u32],
    /// Pipelines of the fused step, one per entry of `degrees`.
    fused: Vec<project_backward::Stage>,
    accumulated: Option<Accumulated>,
}

/// One rendered view of a step.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    /// The model that the gradients belong to.
    pub model: &'a Model,
    /// The cameras, `view` among them.
    pub views: &'a Views,
    /// Index in `views`.
    pub view: u32,
    /// Holds the render of the view, and its gradient records.
    pub raster: &'a Raster,
    /// Bands of harmonics in use.
    pub degree: u32,
    /// See `stages::status`; if it reports that the step did not fit, nothing is updated.
    pub status: &'a Buffer<u32>,
}

impl Learner {
    /// `accumulate` enables steps that see several views.
    pub fn new(model: &Model, lesson: Lesson, accumulate: bool) -> Result<Self, GpuError> {
        let context = model.context();
        let has_lobes = lesson.segment.has_lobes();
        let Lesson { opacity_only, sparse, compensate, packed, newton, .. } = lesson;
        // Frozen segments do not read their colors.
        let colors = color::of(model.part(lesson.segment).sh_degree);
        let degrees = if opacity_only { &[0] } else { colors.parts_from(lesson.least_degree) };
        let backward = |wanted: bool, accumulate: bool| -> Result<Vec<_>, GpuError> {
            let spec = |sh_degree| project_backward::Spec {
                workgroup_size: context.info().workgroup(WORKGROUP),
                compensate,
                has_lobes,
                opacity_only,
                sparse: (sparse || newton) && !accumulate,
                accumulate,
                packed,
                packed_records: packed,
                newton: newton && !accumulate,
                sh_degree,
            };
            degrees
                .iter()
                .filter(|_| wanted)
                .map(|&degree| project_backward::Stage::new(context, &spec(degree)))
                .collect()
        };
        let step = |&sh_degree: &u32| {
            let spec = adam::Spec {
                workgroup_size: context.info().workgroup(WORKGROUP),
                has_lobes,
                opacity_only,
                sparse,
                packed,
                sh_degree,
            };
            adam::Stage::new(context, &spec)
        };
        let accumulated = match accumulate {
            false => None,
            true => Some(Accumulated {
                gradients: Beside::gradients(model, &lesson)?,
                add: backward(true, true)?,
                step: degrees.iter().map(step).collect::<Result<_, _>>()?,
            }),
        };
        Ok(Learner {
            lesson,
            moments: Beside::moments(model, &lesson)?,
            fused: backward(!accumulate, false)?,
            degrees,
            accumulated,
        })
    }

    /// The accumulated gradients, if the learner was made with `accumulate`.
    pub fn gradients(&self) -> Option<&Beside> {
        self.accumulated.as_ref().map(|a| &a.gradients)
    }

    /// Computes the gradients of one view and steps on them. `step` counts from 0 over the life of the
    /// moments.
    pub fn record_step(&self, recorder: &mut Recorder, seen: &Seen<'_>, rates: &Rates, step: u32) {
        self.record_backward(recorder, seen, &self.fused, &self.moments, rates, self.step_rates(rates, step));
    }

    /// Updates the curvature from the records of [`record_probe`](super::loss::Photometric::record_probe).
    /// Parameters do not change. `step` as in [`Learner::record_step`].
    pub fn record_probe(&self, recorder: &mut Recorder, seen: &Seen<'_>, step: u32) {
        let rates = StepRates { probe: 1, step, ..Default::default() };
        self.record_backward(recorder, seen, &self.fused, &self.moments, &Rates::default(), rates);
    }

    /// Starts a step that sees several views.
    pub fn record_begin(&self, recorder: &mut Recorder) {
        if let Some(a) = &self.accumulated {
            a.gradients.all().into_iter().for_each(|planes| planes.record_zero(recorder));
        }
    }

    /// Accumulates the gradients of one view.
    pub fn record_add(&self, recorder: &mut Recorder, seen: &Seen<'_>) {
        if let Some(a) = &self.accumulated {
            self.record_backward(recorder, seen, &a.add, &a.gradients, &Rates::default(), StepRates::default());
        }
    }

    /// Steps on the accumulated gradients.
    pub fn record_adam(
        &self,
        recorder: &mut Recorder,
        model: &Model,
        degree: u32,
        rates: &Rates,
        step: u32,
        status: &Buffer<u32>,
    ) {
        let Some(a) = &self.accumulated else { return };
        let part = model.part(self.lesson.segment);
        let Some(stage) = self.by_degree(&a.step, model, degree) else { return };
        for (k, dispatch, page) in model.pages(self.lesson.segment) {
            stage.record_indirect(
                recorder,
                &adam::Buffers {
                    population: &model.population,
                    status,
                    geometry: part.geometry.page(k),
                    sh: part.sh.page(k),
                    lobes: part.lobes.page(k),
                    geometry_moments: self.moments.geometry.page(k),
                    sh_moments: self.moments.sh.page(k),
                    lobe_moments: self.moments.lobes.page(k),
                    geometry_grads: a.gradients.geometry.page(k),
                    sh_grads: a.gradients.sh.page(k),
                    lobe_grads: a.gradients.lobes.page(k),
                },
                &adam::Push {
                    segment: page.segment,
                    page_first: page.first,
                    stride: page.capacity,
                    rates: self.step_rates(rates, step),
                },
                &model.population_args,
                dispatch,
            );
        }
    }

    fn record_backward(
        &self,
        recorder: &mut Recorder,
        seen: &Seen<'_>,
        stages: &[project_backward::Stage],
        into: &Beside,
        weights: &Rates,
        rates: StepRates,
    ) {
        let Seen { model, views, view, raster, degree, status } = *seen;
        let part = model.part(self.lesson.segment);
        let Some(stage) = self.by_degree(stages, model, degree) else { return };
        for (k, dispatch, page) in model.pages(self.lesson.segment) {
            stage.record_indirect(
                recorder,
                &bind!(project_backward {
                    status,
                    geometry: part.geometry.page(k),
                    sh: part.sh.page(k),
                    lobes: part.lobes.page(k),
                    geometry_moments: into.geometry.page(k),
                    sh_moments: into.sh.page(k),
                    lobe_moments: into.lobes.page(k);
                    model => population;
                    views => views;
                    raster.buffers => tile_counts, first_slot, splat_colors;
                    raster.records => record_centres, record_shapes, record_colors, record_words;
                }),
                &project_backward::Push {
                    segment: page.segment,
                    page_first: page.first,
                    stride: page.capacity,
                    view,
                    by_gaussian: raster.by_gaussian().into(),
                    rates,
                    mean_opacity: weights.mean_opacity,
                    mean_scale: weights.mean_scale,
                },
                &model.population_args,
                dispatch,
            );
        }
    }

    fn by_degree<'a, S>(&self, stages: &'a [S], model: &Model, degree: u32) -> Option<&'a S> {
        let degree = if self.lesson.opacity_only { 0 } else { model.degree_of(self.lesson.segment, degree) };
        stages.get(self.degrees.iter().position(|&of| of == degree)?)
    }

    fn step_rates(&self, rates: &Rates, step: u32) -> StepRates {
        let correction = |beta: f64| (1.0 / (1.0 - beta.powi(step as i32 + 1))) as f32;
        let lobe = [correction(0.9), correction(0.999)];
        let other = if self.lesson.bias_correction { lobe } else { [1.0; 2] };
        StepRates {
            mean: rates.mean,
            log_scale: rates.log_scale,
            quat: rates.quat,
            opacity: rates.opacity,
            dc: rates.dc,
            sh: rates.sh,
            direction: rates.direction,
            width: rates.width,
            sharpness: rates.sharpness,
            first_correction: other[0],
            second_correction: other[1],
            lobe_first_correction: lobe[0],
            lobe_second_correction: lobe[1],
            step,
            newton: rates.newton,
            probe: 0,
        }
    }
}
