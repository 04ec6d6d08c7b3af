//! Compares rendering and its gradients on the device with the float64 twins, for scenes of every degree.

mod common;
#[path = "common/probe.rs"]
mod probe;

use common::Gpu;
use glint::{
    gpu::Buffer,
    pipelines::{
        learn::{Learner, Lesson, Rates, Seen},
        model::{Model, Segment},
        render::{Needs, RenderOptions, Renderer, Show},
        sort::Extent,
        views::Views,
    },
    reference::{NONE, Params, View, random_camera, random_scene},
    stages::status::{self, Status},
    verify::NEAR_THRESHOLD,
};
use probe::{BACKGROUND, Probe, Setup, distance};

#[test]
fn images_and_gradients_agree_with_the_twin_but_where_a_threshold_is_met() {
    for (seed, base, supplement, degree, (width, height), compensate) in [
        (1, 3000, 600, 3, (97, 71), false),
        (2, 2000, 0, 0, (64, 64), true),
        (3, 4000, 1000, 2, (128, 96), true),
        (4, 1500, 500, 1, (33, 130), false),
    ] {
        let scene = random_scene(seed, base, supplement, degree);
        let camera = random_camera(width, height);
        let setup = Setup { compensate, degree, ..Default::default() };
        let mut probe = Probe::new((base + supplement) as u32, &camera, setup);
        let twin = probe.twin(&scene, &camera, NEAR_THRESHOLD);
        let shot = probe.shoot(&scene, &camera, &twin.image_grad);
        let blended = &twin.rendered.blended;
        let mut sum = 0.0;
        for (p, (got, want)) in shot.image.iter().zip(&blended.image).enumerate() {
            let difference = (0..4).map(|c| (f64::from(got[c]) - want[c]).abs()).fold(0.0, f64::max);
            sum += difference;
            let margin = blended.margins[p].image();
            assert!(difference < 1e-3 || margin < NEAR_THRESHOLD, "pixel {p} off by {difference}, margin {margin}");
        }
        let mean = sum / blended.image.len() as f64;
        let found = distance(&shot, &twin);
        println!("scene {seed}: image off by {mean:.1e}, {:?}", found.groups);
        assert!(mean < 1e-5 && found.groups.len() >= 5);
        // Float32 sums of some hundred terms that partly cancel: 1e-5 is usual, 1e-4 the promised bound.
        assert!(found.groups.iter().all(|(_, l2, cosine)| *l2 <= 1e-4 && *cosine > 0.9999), "{:?}", found.groups);
    }
}

/// SparseAdam moves all Gaussians that the view blends. If α is clamped at 0.99 in every pixel there is no
/// gradient, but momentum continues.
#[test]
fn a_gaussian_that_is_clamped_in_every_pixel_counts_as_blended() {
    let gpu = Gpu::new();
    let camera = random_camera(16, 16);
    let mut scene = random_scene(21, 2, 0, 0);
    // One fills the image, one is behind the camera.
    for (i, z) in [3.0, -3.0].into_iter().enumerate() {
        scene.base.means[i] = camera.unproject(8.0, 8.0, z).as_vec3().to_array();
        scene.base.log_scales[i] = [3.0; 3];
        scene.base.opacities[i] = 12.0;
    }
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let render = RenderOptions { backward: true, ..Default::default() };
    let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, render).unwrap();
    renderer.render_on_device(&model, &views, 0, &Show::all(&model, BACKGROUND)).unwrap();
    let raster = &renderer.raster;
    raster.buffers.image_grad.upload(0, &[1.0; 3 * 16 * 16]).unwrap();
    let lesson = Lesson { opacity_only: true, sparse: true, bias_correction: false, ..Lesson::new(Segment::Base) };
    let learner = Learner::new(&model, lesson, false).unwrap();
    let (m, v) = (0.5f32, 0.25f32);
    learner.moments.geometry.page(0).upload(0, &[[m, v, 0.0, 0.0]; 2]).unwrap();
    let status = Buffer::<u32>::zeroed(&gpu, "status", status::WORDS).unwrap();
    let seen = Seen { model: &model, views: &views, view: 0, raster, degree: 0, status: &status };
    let mut recorder = gpu.recorder("step").unwrap();
    raster.record_blend_backward(&mut recorder, &raster.grid(0, 1, 16, 16), &views.frames, &model.population, 2);
    learner.record_step(&mut recorder, &seen, &Rates { opacity: 0.02, ..Default::default() }, 0);
    recorder.submit().unwrap().wait().unwrap();
    let got = learner.moments.geometry.page(0).download().unwrap();
    let opacities = model.download().unwrap().base.opacities;
    assert!((got[0][0] - 0.9 * m).abs() < 1e-6 && (got[0][1] - 0.999 * v).abs() < 1e-6, "{got:?}");
    assert!((opacities[0] - (12.0 - 0.02 * 0.45 / 0.24975f32.sqrt())).abs() < 1e-5, "{opacities:?}");
    assert_eq!((got[1], opacities[1]), ([m, v, 0.0, 0.0], 12.0));
}

/// Slots that were counted but are not needed drop out of the sort by tile: the image is equal to the last
/// bit.
#[test]
fn tiles_counted_in_vain_change_no_pixel() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(8, 1500, 300, 1), random_camera(97, 71));
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
    renderer.render_on_device(&model, &views, 0, &Show::all(&model, BACKGROUND)).unwrap();
    let raster = &renderer.raster;
    let pixels = camera.pixels() as usize;
    let want = raster.buffers.image.download_range(0, pixels).unwrap();
    let mut counts = raster.buffers.tile_counts.download().unwrap();
    counts.iter_mut().enumerate().filter(|(_, n)| **n > 0).for_each(|(i, n)| *n += [1, 0, 30][i % 3]);
    raster.buffers.tile_counts.upload(0, &counts).unwrap();
    assert!(counts.iter().sum::<u32>() < raster.capacity());
    let grid = raster.grid(0, 1, camera.width, camera.height);
    let status = Buffer::<u32>::zeroed(&gpu, "status", status::WORDS).unwrap();
    let (upto, args) = (Segment::Supplement, &model.population_args);
    let splats =
        Extent { count: &model.population, index: upto.index() + 1, args, dispatch: model.blocks_dispatch(upto) };
    // Depths are not needed after their sort, so they are not kept.
    let (params, view) = (Params::from_scene(&scene).unwrap(), View::from_camera(&camera).rounded());
    let key = |i: usize| if counts[i] > 0 { (view.to_camera(params.mean(i)).z as f32).to_bits() } else { NONE };
    let keys: Vec<u32> = (0..counts.len()).map(key).collect();
    // Twice, so that stale entries of an earlier order could be taken for tiles.
    for _ in 0..2 {
        raster.depth_keys().unwrap().upload(0, &keys).unwrap();
        let mut recorder = gpu.recorder("order again").unwrap();
        raster.record_order(&mut recorder, splats, &grid, &views.frames, None, &status);
        raster.record_blend(&mut recorder, &grid, &views.frames, BACKGROUND, 0.5);
        recorder.submit().unwrap().wait().unwrap();
        assert!(!Status::read(&status.download().unwrap()).failed());
        assert!(raster.buffers.image.download_range(0, pixels).unwrap() == want);
    }
}
