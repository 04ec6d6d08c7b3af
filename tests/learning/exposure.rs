//! Exposure correction: photographs with known exposures are separated from the scene, and checkpoints
//! include the maps.

use std::sync::Arc;

use glint::{
    Error,
    data::{
        Image, Photo, PixelSource, Split,
        builtin::{Part, render_truth},
    },
    pipelines::{
        density::{DensityOptions, Strategy},
        exposure::IDENTITY,
        learn::{Lesson, Rates},
        model::{Model, Room, Segment},
        render::RenderOptions,
        session::Session,
        train::{BaseOptions, StepPlan, Trainer, dense_trainer},
        views::Views,
    },
    report::{decompose::srgb_from_linear, evaluate::evaluate},
    scene::{Camera, Gaussians, Scene, from_points},
};

use super::{
    bits, built,
    common::{Gpu, session},
};

/// Width and height of all photographs, pixels.
const SIDE: u32 = 48;
const GAUSSIANS: u32 = 600;

struct Setup {
    session: Session,
    /// Photographs with varying exposure.
    views: Views,
    /// Factor of each channel of each photograph.
    gains: Vec<[f64; 3]>,
    /// Photographs with exposure 1.
    test: Vec<Photo>,
    start: Gaussians,
}

impl Setup {
    fn new(gpu: &Gpu) -> Self {
        let built = built(GAUSSIANS as usize);
        let small = |camera: &Camera| {
            let by = f64::from(SIDE) / f64::from(camera.width);
            let Camera { fx, fy, cx, cy, .. } = *camera;
            Camera { width: SIDE, height: SIDE, fx: by * fx, fy: by * fy, cx: by * cx, cy: by * cy, ..*camera }
        };
        // Dark enough that no gain exceeds 8 bits.
        let truth = |camera: &Camera| -> Vec<f64> {
            render_truth(camera, Part::All).into_iter().map(|v| 0.7 * f64::from(srgb_from_linear(v))).collect()
        };
        let bytes = |rgb: &[f64], gain: [f64; 3]| -> Vec<u8> {
            rgb.iter().enumerate().map(|(i, v)| (255.0 * v * gain[i % 3]).round().clamp(0.0, 255.0) as u8).collect()
        };
        let of = |is_test: bool| built.photos.iter().filter(move |p| p.is_test == is_test);
        let train: Vec<Camera> = of(false).step_by(4).map(|p| small(&p.camera)).collect();
        // Alternately brighter and darker, each with a different tint; the mean is 1.
        let gain = |i: usize, c: usize| {
            let (bright, tint) = ((5 * i % 12) as f64 / 5.5 - 1.0, ((7 * i + 5 * c) % 12) as f64 / 5.5 - 1.0);
            1.0 + 0.21 * bright + 0.09 * tint
        };
        let raw: Vec<[f64; 3]> = (0..train.len()).map(|i| [0, 1, 2].map(|c| gain(i, c))).collect();
        let mean = [0, 1, 2].map(|c| raw.iter().map(|g| g[c]).sum::<f64>() / raw.len() as f64);
        let gains: Vec<[f64; 3]> = raw.iter().map(|g| [0, 1, 2].map(|c| g[c] / mean[c])).collect();
        let photos: Vec<Vec<u8>> =
            train.iter().zip(&gains).map(|(camera, &gain)| bytes(&truth(camera), gain)).collect();
        let views = Views::upload(gpu, &train, &photos.iter().map(Vec::as_slice).collect::<Vec<_>>()).unwrap();
        let test = of(true).map(|p| {
            let camera = small(&p.camera);
            let rgb = bytes(&truth(&camera), [1.0; 3]);
            let pixels = PixelSource::Memory(Arc::new(Image { width: SIDE, height: SIDE, rgb, mask: None }));
            Photo { name: p.name.clone(), camera, split: Split::Test, pixels }
        });
        let points = built.dataset().points.unwrap();
        Setup {
            session: Session { background: built.background, extent: 2.0, seed: 3, ..session(gpu) },
            views,
            gains,
            test: test.collect(),
            start: from_points(&points.around(glam::DVec3::ZERO), &points.colors, 1),
        }
    }

    fn density(&self, iterations: u32) -> DensityOptions {
        DensityOptions { strategy: Strategy::Budget, limit: GAUSSIANS + 200, first: GAUSSIANS, iterations }
    }

    fn trainer(&self, iterations: u32, exposure: bool) -> (Model, Trainer) {
        let density = self.density(iterations);
        let mut base = self.start.clone();
        density.begin(&mut base);
        let room = Room { base: 200, ..Default::default() };
        let scene = Scene { base, ..Default::default() };
        let model = Model::upload_around(&self.session.context, self.views.origin, &scene, room).unwrap();
        let options = BaseOptions { iterations, sh_degree: 1, ..Default::default() };
        let mut trainer = dense_trainer(&self.session, &model, &self.views, &options, &density).unwrap();
        if exposure {
            trainer.correct_exposure(&self.session, &self.views).unwrap();
        }
        (model, trainer)
    }

    /// Mean PSNR of the test photographs, dB.
    fn psnr(&self, scene: &Scene) -> f64 {
        let photos: Vec<&Photo> = self.test.iter().collect();
        let (context, background) = (&self.session.context, self.session.background);
        evaluate(context, scene, &photos, RenderOptions::default(), background, |_| Ok(())).unwrap().augmented.psnr
    }
}

/// Largest difference of the maps' mean from the identity.
fn off_mean(maps: &[[f32; 12]]) -> f64 {
    let mean = |e: usize| maps.iter().map(|map| f64::from(map[e])).sum::<f64>() / maps.len() as f64;
    (0..12).map(|e| (mean(e) - f64::from(IDENTITY[e])).abs()).fold(0.0, f64::max)
}

#[test]
fn known_exposures_are_told_from_the_scene() {
    let gpu = Gpu::new();
    let setup = Setup::new(&gpu);
    let found = [false, true].map(|exposure| {
        let (model, mut trainer) = setup.trainer(600, exposure);
        trainer.run(&model, &setup.views, false, |_| ()).unwrap();
        (setup.psnr(&model.download().unwrap()), trainer.exposures().unwrap())
    });
    let [(without, none), (with, Some(maps))] = found else { panic!("no maps") };
    assert_eq!(none, None);
    // Compares the brightening of the scene's grey by a map with the gain of its photograph.
    let grey = 0.4;
    let (mut error, mut spread) = (0.0, 0.0);
    for (map, gain) in maps.iter().zip(&setup.gains) {
        for c in 0..3 {
            let row = map[4 * c..][..4].iter().map(|&v| f64::from(v)).collect::<Vec<_>>();
            let learned = row[0] + row[1] + row[2] + row[3] / grey;
            error += (learned - gain[c]).powi(2);
            spread += (1.0 - gain[c]).powi(2);
        }
    }
    let left = (error / spread).sqrt();
    let off = off_mean(&maps);
    println!(
        "{without:.2} dB without, {with:.2} dB with; {left:.2} of the gains are left, the mean map is off by {off:.1e}"
    );
    assert!(with > without + 0.7, "{with} and {without}");
    assert!(left < 0.4, "{left}");
    assert!(off < 1e-6, "{off}");
}

fn map_bits(trainer: &Trainer) -> Vec<u32> {
    trainer.exposures().unwrap().unwrap().into_iter().flatten().map(f32::to_bits).collect()
}

#[test]
fn maps_are_learned_the_same_every_time_and_across_a_checkpoint() {
    let gpu = Gpu::new();
    let setup = Setup::new(&gpu);
    let (model, mut trainer) = setup.trainer(120, true);
    let whole = trainer.run(&model, &setup.views, false, |_| ()).unwrap();
    let (want, want_maps) = (bits(&model.download().unwrap()), map_bits(&trainer));

    let (other, mut trainer) = setup.trainer(120, true);
    trainer.start(false).unwrap();
    trainer.go_on_to(48);
    while trainer.advance(&other, &setup.views).unwrap().is_some() {}
    let checkpoint = trainer.checkpoint(&other, &setup.views).unwrap();
    assert!(checkpoint.step == 48 && map_bits(&trainer) != want_maps);
    let (fresh, mut trainer) = setup.trainer(120, true);
    trainer.resume(&fresh, &checkpoint, false).unwrap();
    while trainer.advance(&fresh, &setup.views).unwrap().is_some() {}
    assert!(bits(&fresh.download().unwrap()) == want && map_bits(&trainer) == want_maps);
    assert_eq!(trainer.report().losses, whole.losses);

    // A run without maps is different, and neither can resume from the other's checkpoint: nothing changes.
    let (plain, mut trainer) = setup.trainer(120, false);
    trainer.start(false).unwrap();
    trainer.advance(&plain, &setup.views).unwrap();
    let without = trainer.checkpoint(&plain, &setup.views).unwrap();
    let (fresh, mut trainer) = setup.trainer(120, true);
    let before = bits(&fresh.download().unwrap());
    let refused = trainer.resume(&fresh, &without, false).unwrap_err().to_string();
    assert!(refused.contains("exposure.maps"), "{refused}");
    assert!(bits(&fresh.download().unwrap()) == before);
}

#[test]
fn maps_stay_when_a_run_is_planned_anew() {
    let gpu = Gpu::new();
    let setup = Setup::new(&gpu);
    let (model, mut trainer) = setup.trainer(100, true);
    trainer.start(false).unwrap();
    trainer.go_on_to(40);
    while trainer.advance(&model, &setup.views).unwrap().is_some() {}
    let before = map_bits(&trainer);
    let options = BaseOptions { iterations: 160, sh_degree: 1, ..Default::default() };
    trainer.replan(&setup.session, &setup.views, &options, &setup.density(160), 64).unwrap();
    assert!(map_bits(&trainer) == before && trainer.total() == 160);
    while trainer.advance(&model, &setup.views).unwrap().is_some() {}
    assert!(map_bits(&trainer) != before && off_mean(&trainer.exposures().unwrap().unwrap()) < 1e-6);
}

/// A single photograph's map would be the scene's exposure: it stays the identity, and the run equals one
/// without maps. Steps of several views have none.
#[test]
fn a_photograph_alone_keeps_its_colors() {
    let gpu = Gpu::new();
    let setup = Setup::new(&gpu);
    let scene = Scene { base: setup.start.clone(), ..Default::default() };
    let model = Model::upload_around(&gpu, setup.views.origin, &scene, Room::default()).unwrap();
    let (lesson, rates) = (Lesson::new(Segment::Base), Rates::default());
    let plan = move |_| StepPlan { rates, active_degree: 0 };
    let mut trainer = Trainer::new(&setup.session, &model, &setup.views, &[lesson], vec![0, 1, 2, 3], 2, plan).unwrap();
    let refused = trainer.correct_exposure(&setup.session, &setup.views).unwrap_err();
    assert!(matches!(&refused, Error::Usage(what) if what.contains("one view")), "{refused}");
    assert_eq!(trainer.exposures().unwrap(), None);

    let rgb = setup.views.download_photograph(0).unwrap();
    let rgb: Vec<u8> = rgb.iter().flat_map(|p| [0, 8, 16].map(|shift| (p >> shift) as u8)).collect();
    let views = Views::upload(&gpu, &setup.views.cameras[..1], &[&rgb]).unwrap();
    let setup = Setup { views, ..setup };
    let runs = [false, true].map(|exposure| {
        let (model, mut trainer) = setup.trainer(20, exposure);
        let losses = trainer.run(&model, &setup.views, false, |_| ()).unwrap().losses;
        (losses, trainer.exposures().unwrap())
    });
    assert_eq!(runs[1].1, Some(vec![IDENTITY]));
    assert_eq!(runs[0].0, runs[1].0);
}
