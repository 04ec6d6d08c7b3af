//! Verifies views: every kernel from projection to pixels, back to gradient records, and the steps on them.

use glam::DVec3;

use super::{Bench, sort::noise};
use crate::{
    error::Result,
    gpu::Buffer,
    pipelines::{
        learn::{Learner, Lesson, Rates, Seen},
        model::{Model, Room, Segment},
        raster::{Grid, TileShape},
        render::{Needs, RenderOptions, Renderer, Show},
        session::{Policy, Reduction},
        views::Views,
    },
    reference::{NONE, random_camera, random_scene},
    scene::color::BETAS,
    stages::{
        status::{self, Resource, Status},
        step_done,
    },
};

pub(super) const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];

/// Large enough that a wrong step cannot hide in a parameter's rounding; all different, so that a swap shows.
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
/// Step of the bias correction: the second moment's correction is 2 there, and steps are about as long as the
/// rate.
const STEP: u32 = 700;
/// Number of segments that only learn opacities: all of them.
const FROZEN: u32 = Segment::ALL.len() as u32;

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    let (count, supplement, width, height) = if quick { (1500, 500, 97, 71) } else { (30_000, 10_000, 403, 301) };
    let lanes = bench.shadowed.info().subgroup_size;
    let policy =
        Policy { reduction: Reduction::Deterministic, tile: Some(TileShape::for_subgroup(lanes)), ..Policy::default() };
    let scene = Subject { seed: 1, count, supplement, degree: 3, half: false, size: (width, height) };
    let shot = Shot::new(bench, scene)?;
    for tile in TileShape::choices(lanes) {
        shot.blend(bench, Policy { tile: Some(tile), ..policy })?;
    }
    // The other reductions that the device offers, since training may switch between them.
    for reduction in Reduction::offered(&bench.shadowed).into_iter().filter(|r| *r != policy.reduction) {
        shot.blend(bench, Policy { reduction, ..policy })?;
    }
    shot.depths(bench, policy)?;
    for policy in [policy, Policy { compensate: true, ..policy }, Policy { packed: true, ..policy }] {
        shot.learn(bench, policy)?;
    }
    // Without a supplement and with fewer bands; betas; half width, a format for rendering only.
    Shot::new(bench, Subject { seed: 2, supplement: 0, degree: 1, ..scene })?.learn(bench, policy)?;
    let betas = Shot::new(bench, Subject { seed: 3, supplement: 0, degree: BETAS, ..scene })?;
    for policy in [policy, Policy { packed: true, ..policy }] {
        betas.learn(bench, policy)?;
    }
    Shot::new(bench, Subject { seed: 4, half: true, ..scene })?.depths(bench, policy)?;
    steps_done(bench)
}

/// A small picture and a step by its gradients. Uses few pipelines: a CPU device takes longer to compile them
/// than to run them.
pub(super) fn check(bench: &Bench<'_>) -> Result<()> {
    let subject = Subject { seed: 1, count: 500, supplement: 0, degree: 0, half: false, size: (41, 27) };
    let shot = Shot::new(bench, subject)?;
    let mut renderer = shot.renderer(Policy { reduction: Reduction::Deterministic, ..Policy::default() }, false)?;
    shot.render(&mut renderer)?;
    shot.record_gradients(bench, &renderer, 0)?;
    let learner = Learner::new(&shot.model, Lesson::new(Segment::Base), false)?;
    bench.run(|recorder| learner.record_step(recorder, &shot.seen(&renderer), &RATES, STEP - 1))
}

/// A random scene and a view of it.
#[derive(Clone, Copy)]
struct Subject {
    seed: u64,
    count: usize,
    supplement: usize,
    degree: u32,
    half: bool,
    size: (u32, u32),
}

/// A scene, a view of it, and their buffers.
struct Shot {
    model: Model,
    views: Views,
    show: Show,
    degree: u32,
    status: Buffer<u32>,
}

impl Shot {
    fn new(bench: &Bench<'_>, subject: Subject) -> Result<Self> {
        let Subject { seed, count, supplement, degree, half, size: (width, height) } = subject;
        let context = &bench.shadowed;
        let mut scene = random_scene(seed, count, supplement, degree);
        // Some lobes and betas are at the ends of their ranges.
        if let Some(supplement) = &mut scene.supplement {
            let lobes = &mut supplement.lobes;
            lobes.widths.chunks_mut(4).for_each(|some| ends(some, [0.0101, 0.9999]));
            lobes.sharpness.chunks_mut(4).for_each(|some| ends(some, [-1.999, 7.999]));
        }
        if degree == BETAS {
            let coefficients = scene.base.sh_coefficients();
            for base in scene.base.sh.chunks_mut(4 * coefficients) {
                for coefficient in [2, 4] {
                    [base[coefficient][2], base[coefficient + coefficients][2]] = [-1.386, 6.999];
                }
            }
        }
        let room = Room { half, page: Some(count as u32 * 2 / 3), ..Default::default() };
        let model = Model::upload_around(context, DVec3::ZERO, &scene, room)?;
        Ok(Shot {
            views: Views::upload(context, &[random_camera(width, height)], &[])?,
            show: Show::all(&model, BACKGROUND),
            status: Buffer::zeroed(context, "status", status::WORDS)?,
            model,
            degree,
        })
    }

    fn renderer(&self, policy: Policy, depth: bool) -> Result<Renderer> {
        let backward = !self.model.is_half();
        let options = RenderOptions { policy, depth, backward, ..Default::default() };
        Ok(Renderer::new(self.model.context(), Needs::of(&self.model), &self.views, options)?)
    }

    fn render(&self, renderer: &mut Renderer) -> Result<()> {
        renderer.render_on_device(&self.model, &self.views, 0, &self.show)
    }

    fn seen<'a>(&'a self, renderer: &'a Renderer) -> Seen<'a> {
        let Shot { model, views, degree, status, .. } = self;
        Seen { model, views, view: 0, raster: &renderer.raster, degree: *degree, status }
    }

    /// Verifies a picture and its records: of all gradients, of opacities alone, and of scores.
    fn blend(&self, bench: &Bench<'_>, policy: Policy) -> Result<()> {
        self.render(&mut self.renderer(policy, false)?)?;
        let mut renderer = self.renderer(policy, true)?;
        renderer.raster.make_scores()?;
        self.render(&mut renderer)?;
        [0, FROZEN].into_iter().try_for_each(|frozen| self.record_gradients(bench, &renderer, frozen))?;
        let (raster, grid) = (&renderer.raster, self.grid(&renderer));
        bench.run(|recorder| raster.record_scores(recorder, &grid, &self.views.frames, &self.model.population))
    }

    fn grid(&self, renderer: &Renderer) -> Grid {
        let camera = &self.views.cameras[0];
        renderer.raster.grid(0, 1, camera.width, camera.height)
    }

    /// Uses a smooth gradient of the picture that differs by channel; segments below `frozen` only learn
    /// opacities.
    fn record_gradients(&self, bench: &Bench<'_>, renderer: &Renderer, frozen: u32) -> Result<()> {
        let (raster, grid) = (&renderer.raster, self.grid(renderer));
        let at = |p: u32| [0.0, 1.0, 2.0].map(|c: f64| (f64::from(p) * 0.013 + c).sin() as f32);
        let gradient: Vec<f32> = (0..self.views.cameras[0].pixels()).flat_map(at).collect();
        raster.buffers.image_grad.upload(0, &gradient)?;
        let (frames, population) = (&self.views.frames, &self.model.population);
        bench.run(|recorder| raster.record_blend_backward(recorder, &grid, frames, population, frozen))
    }

    /// Verifies depths of arbitrary Gaussians: some have their maximum response behind the camera.
    fn depths(&self, bench: &Bench<'_>, policy: Policy) -> Result<()> {
        let mut renderer = self.renderer(policy, true)?;
        self.render(&mut renderer)?;
        let (pixels, count) = (self.views.cameras[0].pixels(), self.model.count());
        let ids: Vec<u32> = (0..pixels).map(|p| if p % 9 == 4 { NONE } else { noise(p) % count }).collect();
        for centre_depth in [false, true] {
            let options = RenderOptions { policy, depth: true, centre_depth, ..Default::default() };
            let renderer = Renderer::new(&bench.shadowed, Needs::of(&self.model), &self.views, options)?;
            renderer.raster.buffers.median_ids.upload(0, &ids)?;
            bench.run(|recorder| renderer.depths_of(recorder, &self.model, &self.views, 0, &self.show))?;
        }
        Ok(())
    }

    /// Runs steps of every kind twice: from moments of 0, and from those of the first step. Parameters are
    /// restored each time, so that splats and records still match.
    fn learn(&self, bench: &Bench<'_>, policy: Policy) -> Result<()> {
        let mut renderer = self.renderer(policy, false)?;
        self.render(&mut renderer)?;
        let seen = self.seen(&renderer);
        for segment in Segment::ALL.into_iter().filter(|&segment| self.model.count_of(segment) > 0) {
            let (part, count) = (self.model.part(segment), self.model.count_of(segment) as usize);
            let planes = [&part.geometry, &part.sh, &part.lobes];
            let [geometry, sh, lobes] = planes.map(|planes| planes.values(count));
            let parameters = [geometry?, sh?, lobes?];
            let restore =
                || planes.iter().zip(&parameters).try_for_each(|(planes, values)| planes.restore(values, count));
            // Sparse steps select other Gaussians to move; the other options do not affect that.
            let sparse_too = !policy.compensate && !policy.packed;
            let lessons = [(false, false), (true, false), (false, true), (true, true)];
            for (opacity_only, sparse) in lessons.into_iter().filter(|(_, sparse)| !sparse || sparse_too) {
                self.record_gradients(bench, &renderer, if opacity_only { FROZEN } else { 0 })?;
                let Policy { compensate, packed, .. } = policy;
                let least_degree = self.degree;
                let lesson = Lesson { opacity_only, sparse, compensate, packed, least_degree, ..Lesson::new(segment) };
                let [fused, summed] = [false, true].map(|several| Learner::new(&self.model, lesson, several));
                let (fused, summed) = (fused?, summed?);
                for step in [STEP - 1, STEP] {
                    bench.run(|recorder| fused.record_step(recorder, &seen, &RATES, step))?;
                    restore()?;
                    bench.run(|recorder| {
                        summed.record_begin(recorder);
                        summed.record_add(recorder, &seen);
                        summed.record_adam(recorder, &self.model, self.degree, &RATES, step, &self.status);
                    })?;
                    restore()?;
                }
                if opacity_only || sparse || self.degree == BETAS {
                    continue;
                }
                let newton = Learner::new(&self.model, Lesson { newton: true, ..lesson }, false)?;
                for step in [STEP - 1, STEP] {
                    bench.run(|recorder| newton.record_probe(recorder, &seen, step))?;
                    bench.run(|recorder| newton.record_step(recorder, &seen, &RATES, step))?;
                    restore()?;
                }
                if packed {
                    // Next to no curvature: packed gradients of harmonics are beyond 8 of its roots.
                    let small = 2f32.powi(-60).to_bits() >> 15 << 16;
                    bench.run(|recorder| {
                        (0..part.pages.len()).for_each(|k| recorder.fill(newton.moments.sh.page(k), small));
                        newton.record_step(recorder, &seen, &RATES, STEP);
                    })?;
                    restore()?;
                }
            }
        }
        Ok(())
    }
}

fn ends(some: &mut [f32], ends: [f32; 2]) {
    some.iter_mut().zip(ends).for_each(|(value, end)| *value = end);
}

fn steps_done(bench: &Bench<'_>) -> Result<()> {
    let stage = step_done::Stage::new(&bench.shadowed, &step_done::Spec { workgroup_size: 1 })?;
    for failed in [false, true] {
        let mut before = Status::of_steps(41);
        if failed {
            before.fail(Resource::SupplementGaussians, 5);
        }
        let buffers = step_done::Buffers { status: &Buffer::from_slice(&bench.shadowed, "status", &before.0)? };
        bench.run(|recorder| stage.record(recorder, &buffers, &step_done::Push {}, 1))?;
    }
    Ok(())
}
