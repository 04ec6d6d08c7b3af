//! Tests the model's pages and counts: results do not depend on the layout in memory, and a segment can grow,
//! shrink and be reordered on the device.

use glam::{DMat3, DVec3};
use glint::{
    gpu::Buffer,
    pipelines::{
        density::{DensityOptions, Strategy},
        frames::{self, Frames, Limits},
        learn::{Learner, Lesson, Rates, Seen, learning_bytes},
        model::{Model, Rearrange, Room, Segment, Sources},
        raster::{Raster, RasterOptions},
        render::{Needs, RenderOptions, Renderer, Show},
        session::{Policy, Reduction, Session},
        train::{BaseOptions, StepPlan, Trainer, dense_trainer},
        views::Views,
    },
    reference::{random_camera, random_scene},
    scene::{Camera, Gaussians, Scene},
    stages::{
        constants::constants::NONE,
        status::{self, Resource, Status},
    },
};

use super::{
    common::{Gpu, peak_memory, session},
    probe::{BACKGROUND, Probe, RATES, Setup, ripple},
};

#[test]
fn pages_change_nothing() {
    let (scene, camera) = (random_scene(41, 700, 300, 2), random_camera(80, 60));
    let image_grad: Vec<_> = (0..camera.pixels() as usize).map(ripple).collect();
    let bits = |page: Option<u32>, opacity_only: bool| {
        let setup = Setup { degree: 2, page, opacity_only, ..Default::default() };
        Probe::new(1000, &camera, setup).shoot(&scene, &camera, &image_grad).bits()
    };
    for opacity_only in [false, true] {
        let whole = bits(None, opacity_only);
        for page in [700, 699, 64, 97] {
            assert!(bits(Some(page), opacity_only) == whole, "pages of {page}");
        }
    }
}

/// The base rearranged: some Gaussians twice, some dropped, some moved to the front.
fn reordered(scene: &Scene, sources: &[u32]) -> Scene {
    let sources: Vec<usize> = sources.iter().map(|&source| source as usize).collect();
    Scene { base: scene.base.reordered(&sources), ..scene.clone() }
}

#[test]
fn a_segment_grows_shrinks_and_is_reordered_on_the_device() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(42, 300, 120, 1), random_camera(70, 50));
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let image = |model: &Model| {
        let mut renderer = Renderer::new(&gpu, Needs::of(model), &views, RenderOptions::default()).unwrap();
        renderer.render(model, &views, 0, BACKGROUND).unwrap()
    };
    let rearranged = |model: &Model, sources: &[u32]| {
        let count = Buffer::from_slice(&gpu, "count", &[9, sources.len() as u32]).unwrap();
        let sources = Buffer::from_slice(&gpu, "sources", sources).unwrap();
        let status = Buffer::<u32>::zeroed(&gpu, "status", status::WORDS).unwrap();
        let rearrange = Rearrange::new(&gpu, sources.len() as u32).unwrap();
        let mut recorder = gpu.recorder("rearrange").unwrap();
        let there = Sources { sources: &sources, count: &count, index: 1 };
        rearrange.record(&mut recorder, model, Segment::Base, there, &[], &status);
        recorder.submit().unwrap().wait().unwrap();
        Status::read(&status.download().unwrap())
    };
    let mut model =
        Model::upload_around(&gpu, DVec3::ZERO, &scene, Room { page: Some(97), ..Default::default() }).unwrap();
    let mut now = scene;
    for new in [450, 130, 131, 800] {
        let old = now.base.len() as u32;
        model.reserve(Segment::Base, new).unwrap();
        let sources: Vec<u32> = (0..new).map(|t| (t * 7 + 3) % old).collect();
        rearranged(&model, &sources);
        now = reordered(&now, &sources);
        assert_eq!(model.learn_counts().unwrap(), [new, 0, 120]);
        assert!(model.download().unwrap() == now, "{old} to {new}");
        // As if uploaded in this order.
        assert!(image(&model) == image(&Model::upload(&gpu, &now, 0).unwrap()), "{old} to {new}");
    }

    // More than fit: reported for this resource, and the rest is in place.
    let room = model.part(Segment::Base).capacity();
    let sources: Vec<u32> = (0..room + 50).map(|t| if t < room { t % 800 } else { NONE }).collect();
    let told = rearranged(&model, &sources);
    assert_eq!(told.needs().collect::<Vec<_>>(), [(Resource::BaseGaussians, room + 50)]);
    assert_eq!(model.learn_counts().unwrap(), [room, 0, 120]);
}

/// The accumulated gradients of two views equal the sum, up to one rounding; the step on them is Adam's.
#[test]
fn gradients_of_several_views_add_up() {
    let gpu = Gpu::new();
    let scene = random_scene(43, 500, 200, 2);
    let cameras = [random_camera(64, 48), random_camera(48, 64)];
    let views = Views::upload(&gpu, &cameras, &[]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let options = RenderOptions { backward: true, policy: session(&gpu).policy, ..Default::default() };
    let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, options).unwrap();
    let image_grad: Vec<f32> = (0..64 * 48).flat_map(ripple).map(|g| g as f32).collect();
    let status = Buffer::<u32>::zeroed(&gpu, "status", status::WORDS).unwrap();
    for segment in [Segment::Base, Segment::Supplement] {
        let lesson = Lesson::new(segment);
        let learner = Learner::new(&model, lesson, true).unwrap();
        let mut of = |seen: &[u32]| -> [Vec<f32>; 3] {
            for (k, &view) in seen.iter().enumerate() {
                renderer.render_on_device(&model, &views, view, &Show::all(&model, BACKGROUND)).unwrap();
                let raster = &renderer.raster;
                raster.buffers.image_grad.upload(0, &image_grad).unwrap();
                let camera = &cameras[view as usize];
                let grid = raster.grid(view, 1, camera.width, camera.height);
                let mut recorder = gpu.recorder("gradients").unwrap();
                raster.record_blend_backward(&mut recorder, &grid, &views.frames, &model.population, 0);
                if k == 0 {
                    learner.record_begin(&mut recorder);
                }
                let seen = Seen { model: &model, views: &views, view, raster, degree: 2, status: &status };
                learner.record_add(&mut recorder, &seen);
                recorder.submit().unwrap().wait().unwrap();
            }
            learner.gradients().unwrap().all().map(|planes| planes.download().unwrap().concat())
        };
        let [first, second, both] = [&[0][..], &[1], &[0, 1]].map(&mut of);
        for (array, sums) in both.iter().enumerate() {
            for (at, &sum) in sums.iter().enumerate() {
                assert_eq!(sum, first[array][at] + second[array][at], "array {array}, element {at}");
            }
        }
        assert!(both[0].iter().any(|&g| g != 0.0));
    }
}

/// Four steps of two views each, and one of all eight with a step length to match: both learn.
#[test]
fn steps_of_several_views_learn() {
    let gpu = Gpu::new();
    let scene = random_scene(44, 400, 0, 1);
    let camera = random_camera(48, 36);
    let grey = vec![120u8; 3 * 48 * 36];
    let views = Views::upload(&gpu, &[camera; 2], &[&grey, &grey]).unwrap();
    let session = Session { background: BACKGROUND, ..session(&gpu) };
    for (views_per_step, steps) in [(1, 40), (4, 40)] {
        let model = Model::upload(&gpu, &scene, 0).unwrap();
        let lesson = Lesson { sparse: true, ..Lesson::new(Segment::Base) };
        let schedule = (0..views_per_step * steps).map(|k| k % 2).collect();
        let plan = |_| StepPlan { rates: Rates { dc: 0.01, ..RATES }, active_degree: 1 };
        let mut trainer = Trainer::new(&session, &model, &views, &[lesson], schedule, views_per_step, plan).unwrap();
        let losses = trainer.run(&model, &views, false, |_| ()).unwrap().losses;
        assert_eq!((losses.len() as u32, trainer.total()), (views_per_step * steps, steps));
        for (after, views) in [(steps, 8), (10, 3)] {
            let [loss, psnr] = trainer.lately(after, views).unwrap();
            let last = &losses[..(after * views_per_step) as usize];
            let mean = last[last.len() - views..].iter().map(|&l| f64::from(l)).sum::<f64>() / views as f64;
            assert!((loss - mean).abs() < 1e-12, "{loss} {mean}");
            assert!((5.0..60.0).contains(&psnr), "{psnr}");
        }
        assert_eq!((trainer.lately(0, 8), trainer.gaussians()), (None, None));
        assert!(
            losses[losses.len() - 1] < 0.8 * losses[0],
            "{views_per_step} views: {} to {}",
            losses[0],
            losses[losses.len() - 1]
        );
    }
}

/// Two cameras back to back. Momentum and probes of one camera's photographs must not move what only the other one sees: in a scene of many
/// cameras that diverges.
#[test]
fn newton_steps_do_not_move_what_the_view_does_not_show() {
    let gpu = Gpu::new();
    let front = Camera { rotation: DMat3::IDENTITY, translation: DVec3::ZERO, ..random_camera(48, 36) };
    let back = Camera { rotation: DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0)), ..front };
    let mut scene = random_scene(44, 400, 0, 1);
    for (k, mean) in scene.base.means.iter_mut().enumerate() {
        let (x, y) = ((k * 37 % 48) as f64, (k * 59 % 36) as f64);
        let [x, y, z] = front.unproject(x, y, 2.0 + 0.01 * (k % 100) as f64).as_vec3().to_array();
        *mean = if k < 200 { [x, y, z] } else { [-x, y, -z] };
    }
    let grey = vec![120u8; 3 * 48 * 36];
    let views = Views::upload(&gpu, &[front, back], &[&grey, &grey]).unwrap();
    let session = Session { background: BACKGROUND, ..session(&gpu) };
    for packed in [false, true] {
        let model = Model::upload(&gpu, &scene, 0).unwrap();
        let lesson = Lesson { newton: true, packed, ..Lesson::new(Segment::Base) };
        let session = Session { policy: Policy { packed, ..session.policy }, ..session.clone() };
        let plan = |_| StepPlan { rates: Rates { newton: 0.02, ..RATES }, active_degree: 1 };
        let schedule = [[1; 8], [0; 8]].concat();
        let mut trainer = Trainer::new(&session, &model, &views, &[lesson], schedule, 1, plan).unwrap();
        trainer.start(false).unwrap();
        let mut seen = Vec::new();
        for until in [8, 16] {
            trainer.go_on_to(until);
            while trainer.settle(&model, &views).unwrap() < until {
                trainer.advance(&model, &views).unwrap();
            }
            seen.push(model.download().unwrap().base);
        }
        let moved = |from: &Gaussians, to: &Gaussians, k: usize| from.reordered(&[k]) != to.reordered(&[k]);
        let count = |from, to, some: std::ops::Range<usize>| some.filter(|&k| moved(from, to, k)).count();
        // Of 200 in front of a camera some are transparent or hidden; a tenth of them is enough to learn.
        assert_eq!(count(&scene.base, &seen[0], 0..200), 0, "packed: {packed}");
        assert!(count(&scene.base, &seen[0], 200..400) > 20, "packed: {packed}");
        assert_eq!(count(&seen[0], &seen[1], 200..400), 0, "packed: {packed}");
        assert!(count(&seen[0], &seen[1], 0..200) > 20, "packed: {packed}");
    }
}

#[test]
fn a_segment_has_no_more_gaussians_than_there_is_room_for() {
    let gpu = Gpu::new();
    let mut model = Model::upload(&gpu, &random_scene(1, 64, 0, 1), 0).unwrap();
    for count in [10, 0, 64] {
        model.set_count(Segment::Base, count).unwrap();
        assert_eq!(model.learn_counts().unwrap(), [count, 0, 0]);
    }
    let capacity = model.part(Segment::Base).capacity();
    model.set_count(Segment::Base, capacity).unwrap();
    let refused = model.set_count(Segment::Base, capacity + 1).unwrap_err().to_string();
    assert!(refused.contains(&format!("room for {capacity}")), "{refused}");
    assert_eq!(model.learn_counts().unwrap(), [capacity, 0, 0]);
}

/// More than the guaranteed buffer size of 128 MiB: in pages; no photograph spans two.
#[test]
fn photographs_of_400_megabytes_are_held_and_read_back() {
    let gpu = Gpu::new();
    let camera = random_camera(1000, 1000);
    let views = Views::without_photographs(&gpu, DVec3::ZERO, &[camera; 100], true).unwrap();
    let photograph = |v: u32| (0..1_000_000u32).map(|p| p.wrapping_mul(v + 1)).collect::<Vec<_>>();
    for v in 0..100 {
        views.upload_photograph(v, &photograph(v as u32)).unwrap();
    }
    for v in [0, 1, 32, 33, 66, 67, 99] {
        assert!(views.download_photograph(v).unwrap() == photograph(v as u32), "photograph {v}");
    }
    println!("100 photographs: {} bytes of buffers, {} of the whole process at most", gpu.memory().used, peak_memory());
    let page = views.same_page(0);
    assert!(page as u64 * 4_000_000 <= gpu.info().max_storage_bytes && (page == 100 || views.same_page(page) > 0));
}

/// Bytes of a run per additional Gaussian, including density control and four intersections.
#[test]
fn a_run_takes_612_bytes_and_436_with_packed_moments_beside_its_intersections() {
    let gpu = Gpu::new();
    let views = Views::without_photographs(&gpu, DVec3::ZERO, &[random_camera(32, 32)], true).unwrap();
    for (packed, gaussian, isect) in [(false, 612, 40), (true, 436, 20)] {
        let session = Session { policy: Policy { packed, ..Policy::default() }, ..session(&gpu) };
        let held = |count: u32| {
            let scene = random_scene(1, count as usize, 0, 3);
            let model = Model::upload(&gpu, &scene, 0).unwrap();
            let density = DensityOptions { strategy: Strategy::Budget, limit: count, first: count, iterations: 10 };
            let options = BaseOptions { iterations: 10, sh_degree: 3, ..Default::default() };
            let trainer = dense_trainer(&session, &model, &views, &options, &density).unwrap();
            let used = gpu.memory().used;
            drop(trainer);
            used
        };
        let [few, more] = [20_000, 40_000].map(held);
        // Counts of blocks add a few bits per word.
        let each = (more - few) as f64 / 20_000.0 - 4.0 * f64::from(isect);
        assert!((f64::from(gaussian)..f64::from(gaussian) + 4.0).contains(&each), "{each} bytes, packed: {packed}");
    }
}

/// README's figures for a renderer: bytes per Gaussian of degree 3 in the model and in other buffers, and per
/// intersection.
#[test]
fn a_gaussian_that_is_drawn_takes_280_bytes_and_160_at_half_width_beside_its_intersections() {
    let gpu = Gpu::new();
    let camera = random_camera(32, 32);
    // A renderer has room for 65,536 intersections at least.
    let scenes = [20_000, 40_000].map(|count| random_scene(1, count, 0, 3));
    for (half, depth_in, gaussian) in [(false, false, 280), (true, false, 160), (false, true, 284), (true, true, 164)] {
        let held = |scene: &Scene, isects: u32| {
            let before = gpu.memory().used;
            let room = Room { half, ..Default::default() };
            let model = Model::upload_around(&gpu, DVec3::ZERO, scene, room).unwrap();
            let room = frames::Room::Intersections(isects);
            let limits = Limits { intersections: room, depth_in, ..Limits::of(&model, 32, 32) };
            let _frames = Frames::new(&gpu, limits).unwrap();
            gpu.memory().used - before
        };
        let [few, more] = [0, 1].map(|k| held(&scenes[k], 4 * scenes[k].base.len() as u32));
        let lists = held(&scenes[1], 8 * 40_000) - more;
        let isect = lists as f64 / 160_000.0;
        let each = (more - few) as f64 / 20_000.0 - 4.0 * isect;
        // Counts of blocks add a few bits per word.
        assert!((16.0..16.5).contains(&isect), "{isect} bytes for an intersection");
        let gaussian = f64::from(gaussian);
        assert!((gaussian..gaussian + 2.0).contains(&each), "{each} bytes of {gaussian}");
    }
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let room = Room { half: true, ..Default::default() };
    let held = [0, 1].map(|k| {
        let before = gpu.memory().used;
        let model = Model::upload_around(&gpu, DVec3::ZERO, &scenes[k], room).unwrap();
        let _renderer = Renderer::new(&gpu, Needs::of(&model), &views, RenderOptions::default()).unwrap();
        gpu.memory().used - before
    });
    let each = (held[1] - held[0]) as f64 / 20_000.0 - 4.0 * 16.0;
    assert!((160.0..162.0).contains(&each), "{each} bytes in a renderer with room for 4 intersections each");
}

/// README's figures for training: bytes per Gaussian of degree 3 and per intersection, with Newton's steps
/// and with Adam's.
#[test]
fn a_gaussian_that_learns_takes_596_bytes_and_420_with_packed_moments() {
    let gpu = Gpu::new();
    let model = Model::upload(&gpu, &random_scene(1, 64, 0, 3), 0).unwrap();
    let held = |splats: u32, isects: u32, [backward, packed, half]: [bool; 3], reduction: Reduction| {
        let options = RasterOptions {
            splats,
            pixels: 1,
            tiles: 64,
            isects,
            backward,
            packed_splats: half,
            policy: Policy { reduction, packed, ..Policy::default() },
            ..RasterOptions::default()
        };
        Raster::plan(&options).bytes()
    };
    // Counts of blocks add a few bits per word.
    let many = 1u32 << 20;
    // With float atomics there is a gradient record per Gaussian, not per intersection. A renderer has no
    // records, and sorts Gaussians instead of slots.
    let (fixed, atomic) = (Reduction::Deterministic, Reduction::Atomic);
    // A packed record takes 16 bytes instead of 36.
    for (what, reduction, splat, isect) in [
        ([true, false, false], fixed, 52, 40),
        ([true, true, false], fixed, 52, 20),
        ([true, false, false], atomic, 88, 16),
        ([true, true, false], atomic, 88, 16),
        ([false, false, false], fixed, 40, 16),
        ([false, false, true], fixed, 32, 16),
    ] {
        let held = |splats, isects| held(splats, isects, what, reduction) as usize;
        // Splats are sorted in the memory of intersections, so there are at least as many of these.
        let of_splat = (held(many, 4 * many) - held(1, 4 * many)) / many as usize;
        let of_isect = (held(1, many) - held(1, 1)) / many as usize;
        assert!((splat..splat + 2).contains(&of_splat), "{of_splat} bytes of the raster for a Gaussian");
        assert!((isect..isect + 2).contains(&of_isect), "{of_isect} bytes for an intersection");
    }
    for (newton, packed, want) in [(true, false, 596), (true, true, 420), (false, false, 772), (false, true, 532)] {
        let lesson = Lesson { newton, packed, ..Lesson::new(Segment::Base) };
        let learner = Learner::new(&model, lesson, false).unwrap();
        let part = model.part(Segment::Base);
        let (own, beside) = ([&part.geometry, &part.sh], learner.moments.all());
        let all = own.into_iter().chain(beside).filter(|planes| planes.planes() > 0);
        let bytes: usize = all.map(|planes| 16 * planes.page(0).len() / part.pages[0].capacity as usize).sum();
        assert_eq!(bytes + 52, want);
        assert_eq!(learning_bytes(3, packed, newton).iter().sum::<u64>() as usize, bytes, "what `train` announces");
    }
}
