//! Photographs in host memory or in a file, and Gaussians in host memory: training gives the same bits as with both in device memory.

use glam::DVec3;
use glint::{
    gpu::Memory,
    pipelines::{
        enhance::{EnhanceOptions, Enhancer},
        learn::{Lesson, Rates, learning_bytes},
        model::{Model, Room, Segment},
        photographs::Storage,
        train::{BaseOptions, StepPlan, Trainer, permutations, train_base},
        views::Views,
    },
    reference::random_scene,
    scene::Camera,
};

use super::{
    bits,
    common::{Gpu, session},
    put_before,
};

const PHOTOS: u32 = 90;
const VIEWS_PER_STEP: u32 = 2;

const GAUSSIANS: usize = 200;

/// Random photographs, at two sizes with `halvings` 1.
fn random_views(gpu: &Gpu, storage: Storage, halvings: u32) -> Views {
    let cameras: Vec<Camera> = (0..PHOTOS)
        .map(|v| Camera {
            translation: DVec3::new(f64::from(v % 10) * 0.02, f64::from(v / 10) * 0.02, 0.0),
            ..Camera::new(40 - v % 9, 30 - v % 5, 40.0)
        })
        .collect();
    let views = Views::halved(gpu, DVec3::ZERO, &cameras, halvings, storage, Some([0.2; 3])).unwrap();
    for (v, camera) in views.cameras.iter().enumerate() {
        // Opacities are random, and no pixel is masked.
        let pixel = |i: u32| 0x100_0000 | (v as u32 * 7919 + i).wrapping_mul(2_654_435_761);
        let packed: Vec<u32> = (0..camera.pixels()).map(pixel).collect();
        views.upload_photograph(v, &packed).unwrap();
        assert!(views.download_photograph(v).unwrap() == packed, "view {v}");
    }
    views
}

/// Bits of the scene and of the losses after two passes, and the memory in use then. `host`: the Gaussians' colors and moments lie in the
/// host's memory.
fn trained(storage: Storage, host: bool) -> (Vec<u64>, Vec<u32>, Memory) {
    let gpu = Gpu::new();
    let views = random_views(&gpu, storage, 1);
    let mut scene = random_scene(5, GAUSSIANS, 0, 0);
    put_before(&views.cameras[0], &mut scene.base.means);
    let room = Room { host, ..Default::default() };
    let model = Model::upload_around(&gpu, DVec3::ZERO, &scene, room).unwrap();
    let rates = Rates { mean: 1e-3, log_scale: 5e-3, quat: 1e-3, opacity: 0.025, dc: 2.5e-3, ..Default::default() };
    let plan = move |_: u32| StepPlan { rates, active_degree: 0 };
    let schedule = permutations(2 * PHOTOS, 4 * PHOTOS, 3);
    let (session, lessons) = (session(&gpu), [Lesson::new(Segment::Base)]);
    let mut trainer = Trainer::new(&session, &model, &views, &lessons, schedule, VIEWS_PER_STEP, plan).unwrap();
    let report = trainer.run(&model, &views, false, |_| ()).unwrap();
    let losses = report.losses.iter().map(|loss| loss.to_bits()).collect();
    let learned = model.download().unwrap();
    assert!(bits(&learned) != bits(&scene));
    (bits(&learned), losses, gpu.memory())
}

#[test]
fn training_gives_the_same_bits_wherever_photographs_and_gaussians_lie() {
    let (scene, losses, all) = trained(Storage::Device, false);
    assert_eq!(losses.len(), 4 * PHOTOS as usize);
    let file = || Storage::File(tempfile::tempfile().unwrap(), "photos".into());
    for (storage, host) in [(Storage::Host, false), (file(), false), (Storage::Device, true), (file(), true)] {
        let in_file = matches!(storage, Storage::File(..));
        let (other_scene, other_losses, memory) = trained(storage, host);
        assert!(other_scene == scene && other_losses == losses, "photographs in a file: {in_file}, host: {host}");
        // 180 photographs on the device, or a slot and, in host memory, those of two submissions of up to 16 steps. A CPU
        // device has one memory for both.
        assert!(!in_file || memory.used < all.used, "{memory:?}, {all:?} on the device");
        // Constant colors and all moments of Adam's steps; accumulated gradients add to them.
        let [_, others] = learning_bytes(0, false, false);
        let saved = (all.used - all.host) - (memory.used - memory.host);
        assert!(!host || saved >= GAUSSIANS as u64 * others, "{memory:?}, {all:?} on the device");
    }
}

#[test]
fn an_augmentation_gives_the_same_bits_wherever_photographs_lie() {
    let augmented = |storage| {
        let gpu = Gpu::new();
        let views = random_views(&gpu, storage, 0);
        let mut scene = random_scene(5, GAUSSIANS, 0, 0);
        put_before(&views.cameras[0], &mut scene.base.means);
        let mut options = EnhanceOptions { ratio: 0.2, ..EnhanceOptions::pursuit() };
        options.join.steps_per_view = 1;
        let mut enhancer = Enhancer::new(&session(&gpu), &scene, &views, &options).unwrap();
        while enhancer.next(&views).unwrap().is_some() {}
        let found = enhancer.finish(&views).unwrap();
        assert!(found.placed.iter().any(|placed| placed.count() > 0));
        bits(&found.scene)
    };
    let scene = augmented(Storage::Device);
    assert!(augmented(Storage::Host) == scene);
    assert!(augmented(Storage::File(tempfile::tempfile().unwrap(), "photos".into())) == scene);
}

/// Where photographs are transparent, a Gaussian of their background's color is no part of them.
#[test]
fn black_gaussians_before_a_transparent_black_background_fade() {
    let faded = [true, false].map(|transparent| {
        let (gpu, camera) = (Gpu::new(), Camera::new(32, 24, 40.0));
        let background = transparent.then_some([0.0; 3]);
        let views = Views::halved(&gpu, DVec3::ZERO, &[camera], 0, Storage::Device, background).unwrap();
        // A packed opacity of 1 is transparent.
        let black = if transparent { 0x100_0000 } else { 0xFF00_0000 };
        views.upload_photograph(0, &[black; 32 * 24]).unwrap();
        let mut scene = random_scene(5, 1, 0, 0);
        scene.base.sh.fill([-2.0; 3]);
        (scene.base.means[0], scene.base.log_scales[0], scene.base.opacities[0]) = ([0.0, 0.0, 4.0], [-0.5; 3], 2.0);
        let model = Model::upload(&gpu, &scene, 0).unwrap();
        let options = BaseOptions { iterations: 64, sh_degree: 0, ..Default::default() };
        train_base(&session(&gpu), &model, &views, &options, false, |_| ()).unwrap();
        2.0 - model.download().unwrap().base.opacities[0]
    });
    // Eight steps have another color; without them nothing differs from the photograph.
    assert!(faded[0] > 1.0 && faded[1] == 0.0, "{faded:?}");
}

#[test]
fn several_views_at_once_need_photographs_on_the_device() {
    let gpu = Gpu::new();
    let views = Views::halved(&gpu, DVec3::ZERO, &[Camera::new(8, 6, 9.0)], 0, Storage::Host, None).unwrap();
    let said = views.targets(0).err().unwrap().to_string();
    assert!(said.contains("photographs in device memory"), "{said}");
}

/// A file that ends early, as on a disk that fails.
#[test]
fn a_file_that_cannot_be_read_is_named() {
    let gpu = Gpu::new();
    let storage = Storage::File(tempfile::tempfile().unwrap(), "some/folder".into());
    let views = Views::halved(&gpu, DVec3::ZERO, &[Camera::new(8, 6, 9.0)], 0, storage, None).unwrap();
    let mut recorder = gpu.recorder("photograph").unwrap();
    let said = views.record_photograph(&mut recorder, 0, None).err().unwrap().to_string();
    assert!(said.starts_with("some/folder: "), "{said}");
}
