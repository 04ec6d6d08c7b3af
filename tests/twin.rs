//! Twins that replace stages at run time: each stage in the pipelines that use it, all at once in `glint
//! verify`, and the handling of a twin that is wrong or fails.

mod common;
#[path = "common/probe.rs"]
mod probe;
#[path = "common/wall.rs"]
mod wall;

use std::collections::BTreeSet;

use common::{Gpu, session};
use glam::{DMat3, DQuat, DVec3};
use glint::{
    gpu::{Buffer, BufferRange, ContextOptions, GpuError, Pixels, Twin},
    pipelines::{
        density::{DensityOptions, Strategy},
        exposure::IDENTITY,
        frames::{Blend, Frame, FrameView, Frames, Instance, Light, Limits, Target, Texel, Transform},
        learn::Lesson,
        lift::{LiftOptions, LiftPhase},
        model::{Model, Rearrange, Room, Segment, Sources},
        pursuit::{Pursuit, PursuitOptions},
        render::{Needs, RenderOptions, Renderer},
        screen::{Refiner, Schedule},
        session::{Reduction, Session},
        train::{BaseOptions, StepPlan, Trainer, dense_trainer},
        views::Views,
    },
    reference::{Params, random_camera, random_scene, twin, twins},
    scene::{Camera, Scene},
    stages::{blend, status},
    verify::{Options, run},
};
use probe::{BACKGROUND, Probe, RATES, Setup, ripple};
use wall::wall;

fn with(twins: &[Twin]) -> Gpu {
    Gpu::with(ContextOptions { twins: twins.to_vec(), ..ContextOptions::from_env() })
}

/// The results of a pipeline, by name.
type Outcome = Vec<(&'static str, Vec<f32>)>;

/// Stages, each with the tolerance of the results with its twin.
type Stages = &'static [(&'static str, Near)];

/// Tolerance between the results with and without a twin.
#[derive(Clone, Copy, PartialEq)]
enum Near {
    /// Integers, or decisions based on integers: the same bits.
    Same,
    /// All values except one in a hundred are within this fraction of the largest of their kind. A pixel, a
    /// tile or a draw may differ if float32 is at a threshold, and Adam's first steps have a fixed length
    /// even if the gradient is only rounding.
    Within(f64),
}

/// `glint verify` compares one pass of each; here the device continues after the replaced stage. The
/// difference is float32's rounding of a stage, about 1e-6, amplified by sums of dozens of tiles and by
/// Adam's first step (exact to 1e-5: 1 − 0.999 has four digits in float32).
const VIEW: Stages = &[
    ("dispatch_args", Near::Same),
    ("radix_upsweep", Near::Same),
    ("radix_spine", Near::Same),
    ("radix_downsweep", Near::Same),
    ("scan_reduce", Near::Same),
    ("scan_spine", Near::Same),
    ("scan_apply", Near::Same),
    ("recount", Near::Same),
    ("tile_ranges", Near::Same),
    ("project", Near::Within(1e-4)),
    ("emit", Near::Within(1e-4)),
    ("blend", Near::Within(1e-4)),
    ("median_depth", Near::Within(1e-4)),
    ("blend_backward", Near::Within(1e-4)),
    ("project_backward", Near::Within(1e-4)),
];

/// A rotated instance of half width behind a mesh's depths, over the target's content.
const FRAMES: Stages = &[
    ("project", Near::Within(1e-4)),
    ("blend", Near::Within(1e-4)),
    ("median_depth", Near::Within(1e-4)),
    ("resolve", Near::Within(1e-5)),
];

/// Three steps: Adam's are as long as their rate for any gradient, so the rounding of a small gradient
/// matters.
const TRAINING: Stages = &[
    ("step_done", Near::Same),
    ("ssim_forward", Near::Within(1e-3)),
    ("ssim_backward", Near::Within(1e-3)),
    // No learning depends on it.
    ("loss_sum", Near::Within(1e-6)),
    ("project_backward", Near::Within(1e-3)),
];

/// Adam's steps of maps are also as long as their rate, and the mean over all maps is subtracted.
const EXPOSURE: Stages = &[
    ("exposure_apply", Near::Within(1e-3)),
    ("exposure_backward", Near::Within(1e-3)),
    ("exposure_step", Near::Within(1e-3)),
];

/// The first of three steps is probed.
const NEWTON: Stages = &[("loss_probe", Near::Within(1e-3)), ("project_backward", Near::Within(1e-3))];

const SEVERAL_VIEWS: Stages = &[("adam", Near::Within(1e-3)), ("project_backward", Near::Within(1e-3))];

const MOVES: Stages = &[("gather", Near::Same), ("recount", Near::Same)];

/// A few refinements: a different draw gives a different Gaussian from then on.
const DENSITY: Stages = &[
    ("density_image", Near::Within(1e-2)),
    ("density_score", Near::Within(1e-2)),
    ("density_weigh", Near::Within(1e-2)),
    ("density_plan", Near::Same),
    ("density_draw", Near::Same),
    ("density_place", Near::Same),
    ("density_apply", Near::Within(1e-2)),
];
const NOISE: Stages = &[("density_noise", Near::Within(1e-2))];

/// Some thirty steps of 2D Gaussians, and their lifts.
const AUGMENTATION: Stages = &[
    ("screen_project", Near::Within(1e-3)),
    ("screen_backward", Near::Within(1e-3)),
    ("screen_prune", Near::Same),
    ("screen_draw", Near::Within(1e-3)),
    // Unneeded entries, or another order, do not change the gradients in use.
    ("screen_tiles", Near::Same),
    ("emit", Near::Within(1e-3)),
    ("tile_ranges", Near::Same),
    ("blend", Near::Within(1e-3)),
    ("blend_backward", Near::Within(1e-3)),
    ("ssim_forward", Near::Within(1e-3)),
    ("ssim_backward", Near::Within(1e-3)),
    ("loss_sum", Near::Within(1e-3)),
    ("scan_reduce", Near::Same),
    ("scan_apply", Near::Same),
    ("lift_count", Near::Same),
    ("lift_points", Near::Within(1e-3)),
    ("lift_join", Near::Same),
    ("lift_groups", Near::Same),
    ("lift_pca", Near::Within(1e-3)),
    ("lift_append", Near::Same),
];

/// Few Gaussians are placed, chosen by order: one candidate more or less shifts all later ranks by one, and
/// their gains by about one per cent.
const PURSUIT: Stages = &[
    ("pursuit_residual", Near::Within(0.1)),
    ("pursuit_blur", Near::Within(0.1)),
    ("pursuit_quanta", Near::Within(0.1)),
    ("pursuit_draw", Near::Within(0.1)),
    ("pursuit_score", Near::Within(0.1)),
    ("pursuit_fit", Near::Within(0.1)),
    ("pursuit_gain", Near::Within(0.1)),
    ("pursuit_claim", Near::Within(0.1)),
    ("pursuit_attenuate", Near::Within(0.1)),
    ("pursuit_place", Near::Within(1e-5)),
    ("lift_append", Near::Same),
];

#[test]
fn every_twin_stands_in_somewhere() {
    let lists = [VIEW, FRAMES, TRAINING, EXPOSURE, NEWTON, SEVERAL_VIEWS, MOVES, DENSITY, NOISE, PURSUIT, AUGMENTATION];
    let mut tried: BTreeSet<&str> = lists.iter().flat_map(|list| list.iter().map(|(stage, _)| *stage)).collect();
    // Stages of reductions are tested if the device supports them.
    tried.extend(twins().iter().map(|twin| twin.stage).filter(|name| name.starts_with("blend_backward")));
    assert_eq!(tried, twins().iter().map(|twin| twin.stage).collect());
}

/// Runs `pipeline` once without twins, and once for each stage with its twin in place.
fn stand_in(pipeline: impl Fn(&Gpu) -> Outcome, stages: &[(&'static str, Near)]) {
    let plain = Gpu::new();
    let want = pipeline(&plain);
    assert_eq!(plain.counters().twins, 0);
    for &(stage, near) in stages {
        let gpu = with(&[twin(stage).unwrap()]);
        let got = pipeline(&gpu);
        assert!(gpu.counters().twins > 0, "{stage} was not called");
        for ((what, got), (_, want)) in got.iter().zip(&want) {
            assert_eq!(got.len(), want.len(), "{stage}: {what}");
            let largest = want.iter().fold(0.0f64, |a, &v| a.max(f64::from(v).abs()));
            let mut off: Vec<f64> = got.iter().zip(want).map(|(&a, &b)| (f64::from(a) - f64::from(b)).abs()).collect();
            off.sort_by(f64::total_cmp);
            let worst =
                off.get((off.len() * 99).div_ceil(100).saturating_sub(1)).copied().unwrap_or(0.0) / largest.max(1e-30);
            println!(
                "{stage}: {what}: {worst:.1e} of {largest:.1e}, at most {:.1e}",
                off.last().unwrap_or(&0.0) / largest
            );
            match near {
                Near::Same => {
                    assert!(got.iter().map(|v| v.to_bits()).eq(want.iter().map(|v| v.to_bits())), "{stage}: {what}")
                }
                Near::Within(bound) => assert!(worst <= bound, "{stage}: {what} is off by {worst:e}"),
            }
        }
    }
}

/// Changes of each parameter, by array.
fn moved(before: &Scene, after: &Scene) -> Outcome {
    let [a, b] = [before, after].map(|scene| Params::from_scene(scene).unwrap());
    let of = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (b - a) as f32).collect();
    vec![
        ("moved", of(&a.geometry, &b.geometry)),
        ("moved SH", of(&a.sh, &b.sh)),
        ("moved lobes", of(&a.lobes, &b.lobes)),
    ]
}

/// A view, its depths and gradients, and a step; the model uses several pages.
fn shot(gpu: &Gpu, setup: Setup) -> Outcome {
    let (scene, camera) = (random_scene(41, 700, 300, 2), random_camera(80, 60));
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let setup = Setup { degree: 2, page: Some(97), ..setup };
    let shot = Probe::new(gpu, 1000, &camera, setup).shoot(&scene, &camera, &image_grad);
    let narrow = |values: &[f64]| values.iter().map(|&v| v as f32).collect();
    let mut all = vec![
        ("image", shot.image.concat()),
        ("depth", shot.depth),
        ("tiles", shot.tile_counts.iter().map(|&n| n as f32).collect()),
        ("gradients", narrow(&shot.gradients.geometry)),
        ("gradients of SH", narrow(&shot.gradients.sh)),
        ("gradients of lobes", narrow(&shot.gradients.lobes)),
    ];
    all.extend(moved(&scene, &shot.stepped));
    all
}

#[test]
fn the_stages_of_a_view_have_twins() {
    stand_in(|gpu| shot(gpu, Setup::default()), VIEW);
    let compensated = [("project", Near::Within(1e-4)), ("project_backward", Near::Within(1e-4))];
    stand_in(|gpu| shot(gpu, Setup { compensate: true, ..Default::default() }), &compensated);
    stand_in(|gpu| shot(gpu, Setup { opacity_only: true, ..Default::default() }), &compensated[1..]);
}

#[test]
fn the_stages_of_a_frame_have_twins() {
    let pipeline = |gpu: &Gpu| {
        let (scene, camera) = (random_scene(48, 700, 300, 2), random_camera(80, 60));
        let pixels = camera.pixels() as usize;
        let room = Room { half: true, page: Some(97), ..Default::default() };
        let models = [0, 1].map(|_| Model::upload_around(gpu, DVec3::new(0.1, 0.2, -0.1), &scene, room).unwrap());
        let limits = Limits {
            gaussians: 2000,
            instances: 2,
            depth_in: true,
            depth_out: true,
            texel: Texel::Rgba32F,
            ..Limits::of(&models[0], 80, 60)
        };
        let mut frames = Frames::new(gpu, limits).unwrap();
        frames.reserve(60_000).unwrap();
        let mesh: Vec<f32> =
            (0..pixels).map(|p| if p % 80 < 40 { 0.2 / (1.0 + p as f32 / 1000.0) } else { 0.0 }).collect();
        let mesh = Buffer::from_slice(gpu, "mesh", &mesh).unwrap();
        let target = Buffer::from_slice(gpu, "target", &vec![[0.2f32, 0.4, 0.6, 1.0]; pixels]).unwrap();
        let depths = Buffer::<f32>::zeroed(gpu, "depths", pixels).unwrap();
        let place = |buffer| Pixels::Buffer(BufferRange { buffer, offset: 0 });
        let color = Target {
            blend: Blend::Over,
            light: Light::Linear,
            exposure: 1.5,
            ..Target::new(place(target.raw().handle()), Texel::Rgba32F)
        };
        let view = FrameView {
            color: Some(color),
            depth_in: Some(place(mesh.raw().handle())),
            depth_out: Some(place(depths.raw().handle())),
            ..FrameView::new(camera)
        };
        let turned =
            Transform { rotation: DQuat::from_rotation_y(0.2), scale: 1.2, translation: DVec3::new(0.3, 0.0, 0.1) };
        let instances = [0, 1].map(|k| {
            let transform = if k == 0 { Transform::IDENTITY } else { turned };
            Instance { transform, ..Instance::of(&models[k]) }
        });
        let mut recorder = gpu.recorder("frame").unwrap();
        let frame = Frame { slot: 0, instances: &instances, views: &[view] };
        unsafe { frames.record_into(&mut recorder, &frame) }.unwrap();
        recorder.submit().unwrap().wait().unwrap();
        vec![("image", target.download().unwrap().concat()), ("depths", depths.download().unwrap())]
    };
    stand_in(pipeline, FRAMES);
}

#[test]
fn every_reduction_has_a_twin() {
    let (gpu, camera) = (Gpu::new(), random_camera(80, 60));
    for reduction in Reduction::offered(&gpu) {
        let setup = || Setup { reduction, ..Default::default() };
        let stage = Probe::new(&gpu, 1, &camera, setup()).renderer.raster.backward_stage().unwrap();
        stand_in(|gpu| shot(gpu, setup()), &[(stage, Near::Within(1e-4)), ("project_backward", Near::Within(1e-4))]);
    }
}

/// Trains a base on all parameters, or a base on its opacities together with a supplement on all; three steps
/// of one view or of two.
fn train(gpu: &Gpu, supplement: bool, sparse: bool, views_per_step: u32, exposure: bool, newton: bool) -> Outcome {
    let scene = random_scene(44, 400, if supplement { 150 } else { 0 }, 1);
    let cameras = [random_camera(48, 36), random_camera(36, 48)];
    let photo = |camera: &Camera| -> Vec<u8> { (0..3 * camera.pixels()).map(|i| (i / 7 % 200) as u8).collect() };
    let photos = cameras.each_ref().map(photo);
    let views = Views::upload(gpu, &cameras, &photos.each_ref().map(|p| &p[..])).unwrap();
    let session = Session { background: BACKGROUND, ..session(gpu) };
    let model = Model::upload(gpu, &scene, 0).unwrap();
    let lesson = |segment, opacity_only| Lesson { opacity_only, sparse, newton, ..Lesson::new(segment) };
    let lessons = match supplement {
        true => vec![lesson(Segment::Base, true), lesson(Segment::Supplement, false)],
        false => vec![lesson(Segment::Base, false)],
    };
    let schedule = (0..3 * views_per_step).map(|k| k % 2).collect();
    let plan = |step: u32| StepPlan { rates: RATES, active_degree: step.min(1) };
    let mut trainer = Trainer::new(&session, &model, &views, &lessons, schedule, views_per_step, plan).unwrap();
    if exposure {
        trainer.correct_exposure(&session, &views).unwrap();
    }
    let report = trainer.run(&model, &views, false, |_| ()).unwrap();
    let mut all = moved(&scene, &model.download().unwrap());
    if let Some(maps) = trainer.exposures().unwrap() {
        all.push(("maps", maps.iter().flat_map(|map| map.iter().zip(IDENTITY).map(|(a, b)| a - b)).collect()));
    }
    all.push(("losses", report.losses));
    all
}

#[test]
fn the_stages_of_training_have_twins() {
    stand_in(|gpu| train(gpu, false, false, 1, false, false), TRAINING);
    let sparse = [("project_backward", Near::Within(1e-3)), ("blend_backward", Near::Within(1e-3))];
    stand_in(|gpu| train(gpu, true, true, 1, false, false), &sparse);
    stand_in(|gpu| train(gpu, false, false, 1, true, false), EXPOSURE);
    stand_in(|gpu| train(gpu, false, false, 1, false, true), NEWTON);
    stand_in(|gpu| train(gpu, true, true, 2, false, false), SEVERAL_VIEWS);
    stand_in(|gpu| train(gpu, false, false, 2, false, false), &SEVERAL_VIEWS[..1]);
}

/// Thirty steps with one or two refinements.
fn refine(gpu: &Gpu, strategy: Strategy) -> Outcome {
    let scene = random_scene(46, 300, 0, 0);
    let cameras = [random_camera(32, 24), random_camera(24, 32)];
    let photo = |camera: &Camera| -> Vec<u8> { (0..3 * camera.pixels()).map(|i| (i / 7 % 200) as u8).collect() };
    let photos = cameras.each_ref().map(photo);
    let views = Views::upload(gpu, &cameras, &photos.each_ref().map(|p| &p[..])).unwrap();
    let session = Session { background: BACKGROUND, ..session(gpu) };
    let room = Room { page: Some(97), base: 100, ..Default::default() };
    let model = Model::upload_around(gpu, DVec3::ZERO, &scene, room).unwrap();
    let options = BaseOptions { iterations: 30, sh_degree: 0, ..Default::default() };
    let density = DensityOptions { strategy, limit: 400, first: 300, iterations: 30 };
    dense_trainer(&session, &model, &views, &options, &density).unwrap().run(&model, &views, false, |_| ()).unwrap();
    let after = Params::from_scene(&model.download().unwrap()).unwrap();
    assert!(after.count != 300);
    let narrow = |values: &[f64]| values.iter().map(|&v| v as f32).collect();
    vec![("geometry", narrow(&after.geometry)), ("SH", narrow(&after.sh))]
}

#[test]
fn the_stages_of_density_control_have_twins() {
    stand_in(|gpu| refine(gpu, Strategy::Budget), DENSITY);
    let mcmc: Vec<_> = DENSITY
        .iter()
        .chain(NOISE)
        .filter(|(s, _)| !matches!(*s, "density_image" | "density_score"))
        .copied()
        .collect();
    stand_in(|gpu| refine(gpu, Strategy::Mcmc), &mcmc);
}

#[test]
fn moving_gaussians_has_a_twin() {
    let pipeline = |gpu: &Gpu| {
        let scene = random_scene(42, 300, 120, 1);
        let room = Room { page: Some(97), base: 150, ..Default::default() };
        let model = Model::upload_around(gpu, DVec3::ZERO, &scene, room).unwrap();
        let sources: Vec<u32> = (0..420).map(|t| if t % 50 == 49 { u32::MAX } else { (t * 7 + 3) % 300 }).collect();
        let from = Buffer::from_slice(gpu, "sources", &sources).unwrap();
        let count = Buffer::from_slice(gpu, "count", &[9, 420]).unwrap();
        let words = Buffer::<u32>::zeroed(gpu, "status", status::WORDS).unwrap();
        let mut recorder = gpu.recorder("rearrange").unwrap();
        let sources = Sources { sources: &from, count: &count, index: 1 };
        Rearrange::new(gpu, 450).unwrap().record(&mut recorder, &model, Segment::Base, sources, &[], &words);
        recorder.submit().unwrap().wait().unwrap();
        let after = Params::from_scene(&model.download().unwrap()).unwrap();
        assert_eq!(after.count, 540);
        vec![("parameters", [after.geometry, after.sh, after.lobes].concat().iter().map(|&v| v as f32).collect())]
    };
    stand_in(pipeline, MOVES);
}

/// A wall of a few wide Gaussians, photographed twice with stripes that it lacks: three rounds of drawing,
/// steps and pruning, and the lift of the remaining Gaussians.
fn augment(gpu: &Gpu) -> Outcome {
    let (width, height) = (120, 100);
    let camera = |v: usize| {
        let translation = DVec3::new(0.1 * v as f64, 0.0, 0.0);
        Camera { width, height, fx: 130.0, fy: 130.0, cx: 60.0, cy: 50.0, rotation: DMat3::IDENTITY, translation }
    };
    let photo = |v: usize| -> Vec<u8> {
        let stripe = |p: u32| ((p % width + 5 * v as u32) / 12).is_multiple_of(3) && p / width > 30;
        (0..width * height).flat_map(|p| if stripe(p) { [220, 200, 60] } else { [150, 115, 165] }).collect()
    };
    let views = Views::upload(gpu, &[camera(0), camera(1)], &[&photo(0), &photo(1)]).unwrap();
    let scene = Scene { base: wall(), ..Default::default() };
    let room = Room { supplement: 60, page: Some(25), ..Default::default() };
    let mut model = Model::upload_around(gpu, DVec3::ZERO, &scene, room).unwrap();
    let options = RenderOptions { depth: true, ..Default::default() };
    let mut renderer = Renderer::new(gpu, Needs::of(&model), &views, options).unwrap();
    let schedule = Schedule { round_steps: 8, final_steps: 4, max_rounds: 3, shared_steps: false };
    let session = Session { seed: 1, ..session(gpu) };
    let mut refiner = Refiner::new(&session, &views, &[30, 20], schedule, None).unwrap();
    let refined = refiner.refine(&mut renderer, &model, &views, 0, |_| ()).unwrap();
    let gaussians = refiner.download().unwrap();
    let phase = LiftPhase::new(gpu, LiftOptions::default()).unwrap();
    let lifted = phase.lift(&refiner, &views, 4.0, &mut model).unwrap();
    let made = lifted.lifts.iter().filter(|lift| lift.cluster_size > 0).count();
    assert!(made > 15 && model.count_of(Segment::Supplement) as usize == made, "{made} of {}", gaussians.len());
    let after = Params::from_scene(&model.download().unwrap()).unwrap();
    let planes = gaussians
        .iter()
        .flat_map(|(_, g)| [&g.centre[..], &g.colour, &[g.opacity_logit], &g.log_scale, &[g.angle, g.depth]].concat());
    vec![
        ("places", gaussians.iter().map(|&(i, _)| i as f32).collect()),
        ("2D Gaussians", planes.collect()),
        ("losses", refined.losses),
        ("clusters", lifted.lifts.iter().map(|lift| lift.cluster_size as f32).collect()),
        ("parameters", [after.geometry, after.sh, after.lobes].concat().iter().map(|&v| v as f32).collect()),
    ]
}

#[test]
fn the_stages_of_the_augmentation_have_twins() {
    stand_in(augment, AUGMENTATION);
}

/// A wall, photographed three times: with a stripe that it lacks in all photographs, and a spot in two.
fn pursue(gpu: &Gpu) -> Outcome {
    let (width, height) = (60, 50);
    let camera = |v: usize| {
        let translation = DVec3::new(0.37 * v as f64, 0.0, 0.0);
        Camera { width, height, fx: 65.0, fy: 65.0, cx: 30.0, cy: 25.0, rotation: DMat3::IDENTITY, translation }
    };
    let photo = |v: usize| -> Vec<u8> {
        let stripe = |p: u32| (20..26).contains(&(p % width).wrapping_sub(6 * v as u32));
        let spot = |p: u32| v > 0 && (p % width).abs_diff(39 + 6 * v as u32) < 4 && (p / width).abs_diff(12) < 4;
        let colour = |p| {
            if spot(p) {
                [250, 250, 240]
            } else if stripe(p) {
                [220, 200, 60]
            } else {
                [150, 115, 165]
            }
        };
        (0..width * height).flat_map(colour).collect()
    };
    let views = Views::upload(gpu, &[0, 1, 2].map(camera), &[&photo(0)[..], &photo(1), &photo(2)]).unwrap();
    let scene = Scene { base: wall(), ..Default::default() };
    let room = Room { supplement: 20, base: 20, page: Some(25), ..Room::default() };
    let mut model = Model::upload_around(gpu, DVec3::ZERO, &scene, room).unwrap();
    let options = RenderOptions { depth: true, ..Default::default() };
    let mut renderer = Renderer::new(gpu, Needs::of(&model), &views, options).unwrap();
    let options = PursuitOptions { rounds: 6, sizes: 2, first_size: 0.9, size_ratio: 2.1, ..Default::default() };
    let mut pursuit = Pursuit::new(&session(gpu), &views, 20, options).unwrap();
    pursuit.start(20).unwrap();
    while pursuit.advance(&mut renderer, &model, &views).unwrap().is_some() {}
    let placed = pursuit.placed().unwrap();
    assert!(placed.lobes > 0 && placed.plain > 0 && placed.count() <= 20, "{placed:?}");
    model.learn_counts().unwrap();
    let there = [Segment::Base, Segment::Supplement].map(|segment| model.count_of(segment));
    assert_eq!(there, [25 + placed.plain, placed.lobes]);
    // With and without a lobe the gain may be equal to the last digit, so the choice between them is
    // arbitrary.
    let depths = placed.lifts.iter().map(|lift| lift.mean[2]).collect();
    vec![("gains", placed.gains), ("depths", depths)]
}

#[test]
fn the_stages_of_pursuit_have_twins() {
    stand_in(pursue, PURSUIT);
}

/// Every variant of every kernel, as in `glint verify`: if all stages are their twins, a row only shows
/// float32's rounding of inputs, results and sums, and no decision differs.
#[test]
fn a_device_of_twins_is_its_twins() {
    let gpu = with(&twins());
    let report = run(&gpu, &Options { quick: true, perturb: 0.0 }).unwrap();
    assert_eq!(report.broken(), 0, "{report}");
    let stages: BTreeSet<&str> = report.rows.iter().map(|row| row.stage).collect();
    let atomics = gpu.info().float_atomics;
    assert!(twins().iter().all(|t| stages.contains(t.stage) || (t.stage == "blend_backward_atomic" && !atomics)));
    for row in report.rows.iter().filter(|row| !row.stage.starts_with('(')) {
        // A packed moment is rounded in steps of a thousandth: gradients rounded to 6e-8 on the way change
        // one in a few thousand words.
        let flips = if row.variant.contains(", packed") { 1e-3 } else { 0.0 };
        assert!(row.errors.flips.unwrap_or(0.0) <= flips, "{row:?}");
        // One rounding is 6e-8; lifts go through the results of several kernels, and amplify by a cube root.
        let bound = if row.stage == "lift_pca" { 2e-6 } else { 4e-7 };
        assert!(row.errors.max.unwrap_or(0.0) <= bound || row.stage == "fma_rate", "{row:?}");
    }
}

fn image(gpu: &Gpu) -> Result<Vec<f32>, glint::Error> {
    let views = Views::upload(gpu, &[random_camera(40, 30)], &[]).unwrap();
    let model = Model::upload(gpu, &random_scene(5, 200, 0, 1), 0).unwrap();
    let mut renderer = Renderer::new(gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
    renderer.render(&model, &views, 0, BACKGROUND).map(|rendered| rendered.color)
}

#[test]
fn a_wrong_twin_is_seen() {
    let wrong = Twin {
        stage: "blend",
        run: |call| {
            (twin("blend").unwrap().run)(call)?;
            let host = blend::Host::new(call);
            assert_eq!((host.push.background, host.spec.median), (BACKGROUND, false));
            host.image.iter_mut().for_each(|pixel| pixel[1] += 1.0);
            Ok(())
        },
    };
    let [right, wrong] = [twin("blend").unwrap(), wrong].map(|twin| image(&with(&[twin])).unwrap());
    for (k, (right, wrong)) in right.iter().zip(&wrong).enumerate() {
        assert_eq!(*wrong, if k % 3 == 1 { right + 1.0 } else { *right });
    }
}

#[test]
fn what_a_twin_cannot_do_is_an_error_of_the_submission() {
    let refuses = Twin { stage: "blend", run: |_| Err("no tiles today".into()) };
    let told = image(&with(&[refuses])).unwrap_err().to_string();
    assert!(told.contains("the twin of blend: no tiles today"), "{told}");
    let panics = Twin { stage: "emit", run: |call| Err(format!("{}", call.bindings[99].bytes().len())) };
    let told = image(&with(&[panics])).unwrap_err().to_string();
    assert!(told.contains("the twin of emit: index out of bounds"), "{told}");

    let gpu = with(&[refuses]);
    let before = gpu.counters();
    let mut recorder = gpu.recorder("fill").unwrap();
    recorder.fill(&Buffer::<u32>::zeroed(&gpu, "words", 4).unwrap(), 1);
    assert!(!matches!(recorder.submit().unwrap().wait(), Err(GpuError::Twin { .. })));
    assert_eq!(gpu.counters().twins, before.twins);
}

/// The stage's time is wall-clock time; the other stages keep theirs.
#[test]
fn stages_around_a_twin_are_timed() {
    let gpu = with(&[twin("step_done").unwrap()]);
    let words = Buffer::<u32>::zeroed(&gpu, "status", status::WORDS).unwrap();
    let spec = glint::stages::step_done::Spec { workgroup_size: 1 };
    let stage = glint::stages::step_done::Stage::new(&gpu, &spec).unwrap();
    let mut recorder = gpu.recorder("steps").unwrap();
    recorder.time_stages();
    for _ in 0..3 {
        let buffers = glint::stages::step_done::Buffers { status: &words };
        stage.record(&mut recorder, &buffers, &glint::stages::step_done::Push {}, 1);
        recorder.fill(&Buffer::<u32>::new(&gpu, "other", 64, glint::gpu::Location::Device).unwrap(), 7);
    }
    let times = recorder.submit().unwrap().wait().unwrap();
    assert_eq!(words.download().unwrap()[status::STEPS], 3);
    assert_eq!(gpu.counters().twins, 3);
    if gpu.info().timestamp_period > 0.0 {
        let names: Vec<&str> = times.iter().map(|t| t.name).collect();
        assert_eq!(names, ["step_done", "fill", "step_done", "fill", "step_done", "fill"]);
    }
}
