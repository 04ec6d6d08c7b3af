//! Gradients accumulated by float atomics, the fallback if records by intersection do not fit.

use glam::DVec3;
use glint::{
    gpu::{ContextOptions, GpuError},
    pipelines::{
        raster::{Raster, RasterOptions},
        session::{Policy, Reduction},
    },
    reference::random_scene,
};

use super::{
    common::Gpu,
    probe::{Blob, Probe, Setup, camera_at, distance, scene},
};

/// The smallest number of intersections whose records exceed the device's limit for one buffer.
fn too_many(gpu: &Gpu) -> u32 {
    // Each of three buffers holds a third of a record.
    u32::try_from(gpu.info().max_storage_bytes / 12 + 1).unwrap()
}

/// Without float atomics on the device, requesting them is an error, and the tests here end.
fn has_atomics(gpu: &Gpu) -> bool {
    if !gpu.info().float_atomics {
        let options = options(1, Reduction::Atomic);
        assert!(matches!(Raster::new(gpu, options), Err(GpuError::Missing { .. })));
        println!("{} has no float atomics", gpu.info().name);
    }
    gpu.info().float_atomics
}

fn options(isects: u32, reduction: Reduction) -> RasterOptions {
    let policy = Policy { reduction, ..Default::default() };
    RasterOptions { splats: 1, pixels: 64, tiles: 1, isects, backward: true, policy, ..Default::default() }
}

/// A driver that moves memory to the host would grant more than the device has; the budget refuses first.
#[test]
fn atomics_take_over_where_records_are_beyond_the_memory_budget() {
    let isects = 1_000_000;
    // The records take 36 MB, the lists at least 4 MB; without records at least 16 MB.
    let gpu = Gpu::with(ContextOptions { memory_budget: Some(30_000_000), ..ContextOptions::from_env() });
    let refused = Raster::new(&gpu, options(isects, Reduction::Deterministic)).err().unwrap();
    assert!(matches!(&refused, GpuError::OverBudget { name, .. } if name.starts_with("record")), "{refused}");
    match Raster::new(&gpu, options(isects, Reduction::Auto)) {
        Ok(raster) => assert!(gpu.info().float_atomics && raster.by_gaussian()),
        Err(e) => assert!(!gpu.info().float_atomics && e.is_no_room(), "{e}"),
    }
}

/// Growth holds at most the old buffers and one new one. Without room for that, even for the required size
/// only, the raster stays unchanged.
#[test]
fn growth_needs_the_room_of_one_buffer_more() {
    let (old, new) = (400_000, 1_000_000);
    let made = |budget: Option<u64>| {
        let gpu = Gpu::with(ContextOptions { memory_budget: budget, ..ContextOptions::from_env() });
        let raster = Raster::new(&gpu, options(old, Reduction::Deterministic)).unwrap();
        (gpu, raster)
    };
    let (gpu, mut raster) = made(None);
    let before = gpu.memory().used;
    raster.grow(new).unwrap();
    // If blocks no longer fit, each of a few dozen small buffers is aligned separately.
    let slack = 1 << 14;
    let (after, room) = (gpu.memory().used, raster.capacity());
    assert!(room >= new && after > 2 * before);
    // Each part of a record has three floats: the largest buffer.
    let largest_old = 12 * u64::from(old);
    let (gpu, mut raster) = made(Some(after + largest_old));
    raster.grow(new).unwrap();
    assert_eq!((gpu.memory().used, raster.capacity()), (after, room));
    // The real need is in between: bisect six times.
    let (mut low, mut high) = (before + slack, after + largest_old);
    for _ in 0..6 {
        let budget = (low + high) / 2;
        let (_gpu, mut raster) = made(Some(budget));
        if raster.grow(new).is_ok() { high = budget } else { low = budget }
    }
    println!("growth from {before} to {after} bytes held {high} at most; the largest old buffer has {largest_old}");
    // If a quarter more does not fit, the required size may.
    let (gpu, mut raster) = made(Some(after - largest_old));
    raster.grow(new).unwrap();
    assert_eq!((raster.capacity(), raster.by_gaussian()), (new, false));
    let exact = gpu.memory().used;
    // First the lists fit but not the records, then not even the first list fits.
    for budget in [exact - largest_old, before + slack] {
        let (gpu, mut raster) = made(Some(budget));
        let refused = raster.grow(new).unwrap_err();
        assert!(refused.is_no_room(), "{refused}");
        assert_eq!((raster.capacity(), raster.by_gaussian()), (old, false));
        assert!(gpu.memory().used >= before);
    }
}

/// Growth ahead of time must not switch to atomics; growth after an overflow may.
#[test]
fn growth_in_time_keeps_the_order_of_sums() {
    let (old, fits, more) = (400_000, 800_000, 1_000_000);
    let made = |budget: Option<u64>| {
        let gpu = Gpu::with(ContextOptions { memory_budget: budget, ..ContextOptions::from_env() });
        let raster = Raster::new(&gpu, options(old, Reduction::Auto)).unwrap();
        (gpu, raster)
    };
    let (gpu, mut raster) = made(None);
    raster.grow_early(fits).unwrap();
    assert!(raster.capacity() == more && !raster.by_gaussian());
    // The lists fit, the records do not.
    let budget = gpu.memory().used - 12 * u64::from(old);
    let (gpu, mut raster) = made(Some(budget));
    let before = gpu.memory().used;
    assert!(raster.grow_early(fits).unwrap_err().is_no_room());
    assert_eq!((raster.capacity(), raster.by_gaussian()), (old, false));
    assert!(gpu.memory().used >= before);
    match raster.grow(fits) {
        Ok(()) => assert!(raster.capacity() == more && raster.by_gaussian()),
        Err(e) => assert!(!gpu.info().float_atomics && e.is_no_room(), "{e}"),
    }
}

#[test]
fn float_atomics_give_the_twins_gradients() {
    let gpu = Gpu::new();
    if !has_atomics(&gpu) {
        return;
    }
    let camera = camera_at(DVec3::ZERO, 80, 60);
    for (seed, base, supplement, degree, compensate) in [(11, 600, 300, 3, false), (12, 800, 0, 1, true)] {
        let scene = random_scene(seed, base, supplement, degree);
        let setup = Setup { degree, compensate, reduction: Reduction::Atomic, ..Default::default() };
        let mut probe = Probe::new((base + supplement) as u32, &camera, setup);
        let twin = probe.twin(&scene, &camera, 1e-4);
        // Twice: sums must start at 0 again.
        for _ in 0..2 {
            let shot = probe.shoot(&scene, &camera, &twin.image_grad);
            let found = distance(&shot, &twin);
            println!("{:?}", found.groups);
            assert!(found.groups.len() >= 6);
            // A few dozen tiles are summed in another order: the bounds of `tests/render.rs` apply.
            assert!(found.groups.iter().all(|(_, l2, cosine)| *l2 <= 1e-4 && *cosine > 0.9999), "{:?}", found.groups);
        }
    }
}

/// Eight Gaussians, each with the same term from all of 32,400 tiles. Summed one by one, n such terms lose
/// up to half a unit in the last place of the sum each: n · 2⁻²⁵ of it, 1e-3. Deterministic sums, in parts
/// and compensated, lose 5e-6 (`tests/extremes/`).
#[test]
fn float_atomics_lose_digits_where_one_gaussian_fills_a_large_image() {
    let gpu = Gpu::new();
    if !has_atomics(&gpu) {
        return;
    }
    let camera = camera_at(DVec3::ZERO, 1920, 1080);
    let blobs: Vec<Blob> = (0..8)
        .map(|i| {
            let z = 3.0 + f64::from(i);
            Blob {
                mean: camera.unproject(960.0, 540.0, z),
                scale: [3e6 * z / camera.fx; 3],
                logit: -2.0,
                ..Default::default()
            }
        })
        .collect();
    let gradients = [Reduction::Deterministic, Reduction::Atomic].map(|reduction| {
        let mut probe = Probe::new(8, &camera, Setup { reduction, ..Default::default() });
        let ones = vec![[1.0, 0.5, 0.25]; camera.pixels() as usize];
        probe.shoot(&scene(&blobs), &camera, &ones).gradients.sh
    });
    for (fixed, atomic) in gradients[0].iter().zip(&gradients[1]) {
        assert!(*fixed > 1e3 && (atomic / fixed - 1.0).abs() < 1e-3, "{atomic} for {fixed}");
    }
}

#[test]
fn atomics_take_over_where_records_find_no_room_and_not_where_bits_are_promised() {
    let gpu = Gpu::new();
    let too_many = too_many(&gpu);
    let refused = Raster::new(&gpu, options(too_many, Reduction::Deterministic));
    assert!(matches!(refused, Err(GpuError::BufferTooLarge { name, .. }) if name == "record_centres"));
    if !has_atomics(&gpu) {
        return;
    }
    assert!(Raster::new(&gpu, options(too_many, Reduction::Auto)).unwrap().by_gaussian());
    assert!(!Raster::new(&gpu, options(1000, Reduction::Auto)).unwrap().by_gaussian());

    // As in training, between two steps when the buffers grow.
    let camera = camera_at(DVec3::ZERO, 80, 60);
    let scene = random_scene(14, 400, 200, 1);
    let mut probe = Probe::new(600, &camera, Setup { degree: 1, reduction: Reduction::Auto, ..Default::default() });
    let twin = probe.twin(&scene, &camera, 1e-4);
    for by_gaussian in [false, true] {
        if by_gaussian {
            probe.renderer.raster.grow(too_many).unwrap();
        }
        assert_eq!(probe.renderer.raster.by_gaussian(), by_gaussian);
        let shot = probe.shoot(&scene, &camera, &twin.image_grad);
        assert!(distance(&shot, &twin).worst() <= 1e-4);
    }
}
