//! Extreme numbers of Gaussians and intersections, orders of depths, and sizes of images.

use std::iter;

use glam::DVec3;
use glint::{
    Error,
    gpu::{Buffer, Context, ContextOptions, Location, Recorder},
    pipelines::{
        exposure::IDENTITY,
        learn::Lesson,
        model::{Model, Room, Segment},
        photographs::Storage,
        raster::TileShape,
        render::{Needs, Renderer},
        session::{Policy, Session},
        steps::{Looped, Steps},
        train::{BaseOptions, Trainer, base_trainer},
        views::Views,
    },
    reference::{
        self,
        tiles::{Tiling, for_each_tile},
    },
    scene::{Camera, Scene},
    stages::{
        WORKGROUP,
        constants::slots::SLOTS_PER_BLOCK,
        dispatch_args, emit,
        status::Resource,
        types::{Frame, Splat},
    },
};

use super::{
    HEIGHT, WIDTH, assert_background, check, cloud,
    common::{Gpu, peak_memory, session},
    company,
    probe::{BACKGROUND, Blob, Probe, Setup, base, camera_at, scene},
    scattered, usual,
};

#[test]
fn counts_about_the_sizes_of_workgroups_and_blocks() {
    let camera = usual();
    let mut probe = Probe::new(2049, &camera, Setup::default());
    for count in [0, 1, 7, 8, 9, 31, 32, 33, 63, 64, 65, 127, 128, 129, 1023, 1024, 1025, 2049] {
        let scene = cloud(&camera, count, -1.0, scattered);
        let shot = check(&mut probe, &camera, &scene, &format!("{count} Gaussians"), 1e-4, 1e-5, 1e-4);
        if count == 0 {
            assert_background(&shot);
        }
    }
}

#[test]
fn an_empty_view_is_the_background_and_not_the_last_image() {
    let camera = usual();
    let back = Camera { rotation: glam::DMat3::from_rotation_y(std::f64::consts::PI) * camera.rotation, ..camera };
    let back = Camera { translation: -(back.rotation * camera.eye()), ..back };
    let scene = scene(&company(&camera));
    let mut probe = Probe::new(8, &camera, Setup::default());
    let zeros = vec![[0.0; 3]; camera.pixels() as usize];
    let seen = probe.shoot(&scene, &camera, &zeros);
    assert!(seen.image.iter().any(|p| p[3] < 0.9) && seen.depth.iter().any(|&z| z > 0.0));
    let empty = probe.shoot(&scene, &back, &zeros);
    assert_background(&empty);
    assert!(empty.depth.iter().all(|&z| z == 0.0) && empty.tile_counts == [0, 0]);
    assert_eq!(probe.shoot(&scene, &camera, &zeros).bits(), seen.bits());
}

/// 4.3 million Gaussians need more workgroups of 64 than a dimension of a dispatch allows.
#[test]
fn more_gaussians_than_one_dimension_of_a_dispatch_has_groups() {
    let gpu = Gpu::new();
    let camera = Camera { rotation: glam::DMat3::IDENTITY, translation: DVec3::ZERO, ..camera_at(DVec3::ZERO, 16, 16) };
    let seen = [0usize, 4_194_239, 4_194_240, 4_194_241, 4_199_999];
    let count = 4_200_000;
    // Only the geometry is large. Most Gaussians are zeros, so at the camera and not visible.
    let mut base = glint::scene::Gaussians { sh_degree: 0, ..Default::default() };
    base.means = vec![[0.0; 3]; count];
    base.log_scales = vec![[-3.0; 3]; count];
    base.quats = vec![[1.0, 0.0, 0.0, 0.0]; count];
    base.opacities = vec![0.0; count];
    base.sh = vec![[0.0; 3]; count];
    for (k, &i) in seen.iter().enumerate() {
        base.means[i] = camera.unproject(2.5 + 3.0 * k as f64, 8.5, 2.0).as_vec3().to_array();
    }
    let scene = Scene { base, ..Default::default() };
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    // 11 planes of 4.2 million floats are 185 MB: more than the smallest guaranteed buffer of Vulkan, so they
    // use several pages.
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let pages = model.pages(Segment::Base).count();
    assert!(pages > 1 || gpu.info().max_storage_bytes >= 11 * 4 * count as u64);
    let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, Default::default()).unwrap();
    let image = renderer.render(&model, &views, 0, BACKGROUND).unwrap();
    for (k, i) in seen.iter().enumerate() {
        let t = image.transmittance[8 * 16 + 2 + 3 * k];
        assert!(t < 0.6, "Gaussian {i} is missing: {t}");
    }
}

#[test]
fn ten_thousand_at_one_depth_are_drawn_in_the_order_of_their_indices() {
    let camera = Camera { rotation: glam::DMat3::IDENTITY, translation: DVec3::ZERO, ..usual() };
    let mut probe = Probe::new(10_000, &camera, Setup::default());
    let mut scene = cloud(&camera, 10_000, -3.0, |i| {
        let (x, y, _, px) = scattered(i);
        (x, y, 4.0, px)
    });
    scene.base.means.iter_mut().for_each(|m| m[2] = 4.0);
    // The twin orders equal depths by index; its margins of order are 0 everywhere, so only its other results
    // are compared here.
    let twin = probe.twin(&scene, &camera, 1e-4);
    let zeros = vec![[0.0; 3]; camera.pixels() as usize];
    let shot = probe.shoot(&scene, &camera, &zeros);
    let mut off = 0;
    for (p, want) in twin.rendered.blended.image.iter().enumerate() {
        let difference = (0..4).map(|c| (f64::from(shot.image[p][c]) - want[c]).abs()).fold(0.0, f64::max);
        // An α that differs at 1/255 changes a pixel by at most that.
        assert!(difference < 1.1 / 255.0, "pixel {p} is off by {difference}");
        off += u32::from(difference > 1e-4);
    }
    assert!(off < camera.pixels() / 100, "{off} pixels");
    for _ in 0..3 {
        assert_eq!(probe.shoot(&scene, &camera, &zeros).bits(), shot.bits());
    }
}

#[test]
fn five_thousand_deep_on_one_pixel() {
    let camera = camera_at(DVec3::ZERO, 8, 8);
    let mut probe = Probe::new(5000, &camera, Setup::default());
    // Opacity 0.0055: the last layer is still visible through all others, T = 0.9945^3000 or so.
    for (logit, what) in [(-5.2f32, "5,000 thin layers"), (-1.0, "5,000 layers")] {
        let scene =
            cloud(&camera, 5000, logit, |i| (4.1, 3.9, 1.0 + 0.01 * ((i * 2741) % 5000) as f64, 2.0 + (i % 7) as f64));
        // Pixels with thousands of Gaussians are all near some threshold; a hundredth of the usual margin
        // keeps most of them.
        check(&mut probe, &camera, &scene, what, 1e-6, 1e-4, 1e-3);
    }
}

#[test]
fn one_tile_receives_every_gaussian() {
    let camera = usual();
    let mut probe = Probe::new(40_000, &camera, Setup::default());
    // 40,000 splats narrower than a tile, all in one of 63: each pixel has a few thousand of its own.
    let scene = cloud(&camera, 40_000, -5.0, |i| {
        let (x, y, z, _) = scattered(i);
        (32.0 + 8.0 * x / f64::from(WIDTH), 24.0 + 8.0 * y / f64::from(HEIGHT), z + 1e-4 * i as f64, 0.3)
    });
    check(&mut probe, &camera, &scene, "40,000 in one tile", 1e-6, 1e-4, 1e-3);
}

#[test]
fn images_of_1_by_1_and_17_by_3_and_4097_by_5() {
    for (width, height) in [(1, 1), (17, 3), (4097, 5), (5, 4097)] {
        let camera = camera_at(DVec3::new(0.1, 0.2, -0.3), width, height);
        let mut probe = Probe::new(256, &camera, Setup::default());
        let scene = cloud(&camera, 256, 0.5, |i| {
            let (x, y, z, px) = scattered(i);
            (x / f64::from(WIDTH) * f64::from(width), y / f64::from(HEIGHT) * f64::from(height), z, px * 3.0)
        });
        check(&mut probe, &camera, &scene, &format!("{width} × {height}"), 1e-4, 1e-4, 1e-4);
    }
}

/// Eight Gaussians that fill an image of 3840 × 2160: 1,036,800 intersections, 129,600 of each. llvmpipe ends
/// loops after 65,535 iterations: emission, and the sums over a Gaussian's slots, must need fewer.
#[test]
fn gaussians_that_fill_a_4k_image_have_all_their_tiles_and_gradients() {
    let camera = camera_at(DVec3::ZERO, 3840, 2160);
    let mut probe = Probe::new(8, &camera, Setup::default());
    // So much wider than the image that each has one α everywhere.
    let scene = cloud(&camera, 8, -2.0, |i| (1920.0, 1080.0, 3.0 + i as f64, 3e6));
    let ones = vec![[1.0, 0.5, 0.25]; camera.pixels() as usize];
    let shot = probe.shoot(&scene, &camera, &ones);
    let alpha = 1.0 / (1.0 + 2f64.exp());
    for (p, pixel) in shot.image.iter().enumerate() {
        assert!((f64::from(pixel[3]) - (1.0 - alpha).powi(8)).abs() < 1e-6, "pixel {p}: {pixel:?}");
    }
    let pixels = f64::from(camera.pixels());
    for i in 0..8 {
        // ∂/∂DC = SH_C0 Σ α T ∂loss/∂rgb.
        let red = 0.28209479177387814 * alpha * (1.0 - alpha).powi(i as i32) * pixels;
        for (c, share) in [1.0, 0.5, 0.25].into_iter().enumerate() {
            let got = shot.gradients.sh[c * 8 + i];
            assert!(
                (got / (red * share) - 1.0).abs() < 5e-6,
                "Gaussian {i}, channel {c}: {got}, wanted {}",
                red * share
            );
        }
    }
}

/// The lists of `emit`; slots that it leaves alone have 7777.
struct Listed<'a> {
    gpu: &'a Gpu,
    tiles: Buffer<u32>,
    globals: Buffer<u32>,
    blocks: Buffer<[u32; 2]>,
}

impl<'a> Listed<'a> {
    fn new(gpu: &'a Gpu, slots: usize, blocks: usize) -> Self {
        let list = |name| Buffer::from_slice(gpu, name, &vec![7777; slots]).unwrap();
        let blocks = Buffer::zeroed(gpu, "rank blocks", blocks).unwrap();
        Listed { gpu, tiles: list("isect tiles"), globals: list("isect globals"), blocks }
    }

    /// Lists the tiles of splats, of which each has its own rank, in a frame of 32 × 32 tiles.
    fn emit(&self, direct: bool, splats: &[Splat], counts: &[u32], first: &[u32], capacity: u32) {
        let words = |name: &str, data: &[u32]| Buffer::from_slice(self.gpu, name, data).unwrap();
        let frame = Frame { width: 256, height: 256, ..Default::default() };
        let (workgroup_size, tile_width, tile_height) = (WORKGROUP, 8, 8);
        let spec = emit::Spec { workgroup_size, tile_width, tile_height, batch: false, direct, packed_splats: false };
        let count = splats.len() as u32;
        let buffers = emit::Buffers {
            frames: &Buffer::from_slice(self.gpu, "frames", &[frame]).unwrap(),
            count: &words("count", &[count]),
            global_from_rank: &words("ranks", &(0..count).collect::<Vec<_>>()),
            rank_first_slot: &words("first slots by rank", first),
            splats: &Buffer::from_slice(self.gpu, "splats", splats).unwrap(),
            packed_splats: &Buffer::zeroed(self.gpu, "packed splats", 1).unwrap(),
            tile_counts: &words("tile counts", counts),
            splat_frames: &words("splat frames", &[0; 2]),
            isect_tiles: &self.tiles,
            isect_globals: &self.globals,
            rank_blocks: &self.blocks,
            first_slot: &words("first slots", &vec![0; splats.len()]),
        };
        let push = emit::Push { frame_first: 0, tiles_x: 32, tiles_per_frame: 1024, capacity, count_index: 0 };
        let mut recorder = self.gpu.recorder("emit").unwrap();
        let stage = emit::Stage::new(self.gpu, &spec).unwrap();
        stage.record_indirect(&mut recorder, &buffers, &push, &words("args", &[1, 1, 1]), 0);
        recorder.submit().unwrap().wait().unwrap();
    }

    fn download(&self) -> (Vec<u32>, Vec<u32>, Vec<[u32; 2]>) {
        (self.tiles.download().unwrap(), self.globals.download().unwrap(), self.blocks.download().unwrap())
    }
}

/// `dispatch_args` has reported the overflow by then; memory beyond the buffers' room must stay untouched
/// until they have grown.
#[test]
fn what_does_not_fit_is_not_emitted() {
    let gpu = Gpu::new();
    // One splat of a few rows of tiles, and one of all 32, with slots from 100 on.
    let splat = |l: f32| Splat { shape: [l, 0.0, l, 0.5], centre: [128.0, 128.0] };
    for (direct, capacity) in [(true, 2), (true, 500), (false, 2), (false, 500)] {
        let list = Listed::new(&gpu, 2000, 100);
        list.emit(direct, &[splat(0.5), splat(1e-6)], &[100, 1024], &[0, 100], capacity);
        let (tiles, globals, blocks) = list.download();
        let room = capacity as usize;
        assert!(tiles[room..].iter().chain(&globals[room..]).all(|&word| word == 7777), "{capacity}");
        let begun = room.div_ceil(SLOTS_PER_BLOCK as usize);
        assert!(blocks[begun..].iter().all(|block| *block == [0; 2]), "{capacity}");
        let globals = match direct {
            true => globals,
            false => reference::emit::globals(&blocks, &[0, 1], room),
        };
        let small = globals.iter().take_while(|&&g| g == 0).count();
        assert!(if room < 100 { small == room } else { small > 3 && globals[100..room].iter().all(|&g| g == 1) });
    }
}

/// Projection counts tiles, emit lists them: if they differ by some tiles, no entry lands in a neighbour's
/// slot and no slot keeps old data.
#[test]
fn a_count_of_tiles_that_differs_from_what_is_listed_harms_no_neighbour() {
    let gpu = Gpu::new();
    let tiling = Tiling { width: 256, height: 256, tile_width: 8, tile_height: 8, tiles_x: 32, tiles_y: 32 };
    // Alternately a splat of a few rows of tiles, listed by its own lane, and one of all 32, listed by its
    // subgroup.
    let splat = |i: u32| {
        let (x, l) = (20.3 + 20.0 * i as f32, if i.is_multiple_of(2) { 0.5 } else { 1e-6 });
        Splat { shape: [l, 0.0, l, 0.5], centre: [x, 100.7] }
    };
    let splats: Vec<Splat> = (0..10).map(splat).collect();
    let wide = splats.iter().map(|s| {
        let ([x, y], [l11, l12, l22, opacity]) = (s.centre.map(f64::from), s.shape.map(f64::from));
        reference::Splat { x, y, l11, l12, l22, opacity, ..Default::default() }
    });
    let wide: Vec<reference::Splat> = wide.collect();
    for off in [[0, 0, 0], [3, 1, 700], [-1, -3, -1], [2, -2, -1000]] {
        let listed = wide.iter().map(|s| {
            let mut tiles = 0;
            for_each_tile(s, &tiling, |_| tiles += 1);
            tiles
        });
        let counts: Vec<u32> = listed.enumerate().map(|(i, n): (usize, i32)| (n + off[i % 3]).max(1) as u32).collect();
        let ranks: Vec<u32> = (0..10).collect();
        let twin = reference::emit::emit(&wide, &counts, &ranks, &tiling);
        let slots = twin.tile_of_slot.len();
        let list = Listed::new(&gpu, slots + 9, slots);
        for direct in [true, false] {
            list.emit(direct, &splats, &counts, &twin.first_slot, slots as u32);
        }
        let (tiles, globals, blocks) = list.download();
        assert_eq!(tiles[..slots], twin.tile_of_slot, "{off:?}");
        assert_eq!((&tiles[slots..], &globals[slots..]), (&[7777; 9][..], &[7777; 9][..]));
        for slot in (0..slots).filter(|&slot| tiles[slot] != reference::NONE) {
            assert_eq!(globals[slot], twin.global_from_slot[slot], "{off:?}");
        }
        let by_rank = reference::emit::globals(&blocks, &ranks, slots);
        assert_eq!(by_rank, twin.global_from_slot, "{off:?}");
    }
}

/// Gaussians that fill 256 × 192 pixels, and ones that nobody sees.
const COUNT: usize = 100;
const UNSEEN: usize = 25_000;

/// A camera that [`filling`] fills, and one that sees it as points, so that some steps fit and others do not.
fn near_and_far(gpu: &Gpu) -> Views {
    let near = camera_at(DVec3::new(0.4, -0.3, 0.2), 256, 192);
    let far = Camera { translation: near.translation + DVec3::new(0.0, 0.0, 3000.0), ..near };
    let [dark, bright] = [60, 200].map(|c| vec![c; 3 * near.pixels() as usize]);
    Views::upload(gpu, &[near, far], &[&dark, &bright]).unwrap()
}

/// `count` Gaussians that fill the first view, and `unseen` ones behind it, which make room for four intersections each.
fn filling(views: &Views, count: usize, unseen: usize) -> Scene {
    let near = &views.cameras[0];
    let mut scene = cloud(near, count, -2.0, |i| (128.0 + i as f64, 96.0, 3.0 + 0.1 * i as f64, 1000.0));
    let behind = Blob { mean: near.unproject(128.0, 96.0, -1e4), ..Default::default() };
    scene.base.append(base(&vec![behind; unseen]));
    scene
}

/// With tiles so small that these Gaussians have more intersections than there is room for, on every device.
fn small_tiles(gpu: &Context) -> Session {
    let (session, lanes) = (session(gpu), gpu.info().subgroup_size);
    Session {
        policy: Policy { tile: TileShape::new(8, 8, lanes), ..session.policy },
        background: BACKGROUND,
        extent: 2.0,
        ..session
    }
}

/// A trainer that has started, of the views in this order.
fn trainer(session: &Session, views: &Views, scene: &Scene, schedule: Vec<u32>) -> (Trainer, Model) {
    let model = Model::upload(&session.context, scene, 0).unwrap();
    let options = BaseOptions { iterations: schedule.len() as u32, sh_degree: 0, ..Default::default() };
    let (lessons, plan) = ([Lesson::new(Segment::Base)], move |step| options.plan(2.0, step));
    let mut trainer = Trainer::new(session, &model, views, &lessons, schedule, 1, plan).unwrap();
    trainer.start(false).unwrap();
    (trainer, model)
}

/// 100 Gaussians that fill an image, more intersections than a trainer of 100 has room for at first; and the
/// same with enough invisible ones to give room from the start.
#[test]
fn training_in_too_little_room_gives_the_bits_of_training_in_enough() {
    let gpu = Gpu::new();
    let views = near_and_far(&gpu);
    let filling = filling(&views, COUNT, 0);
    let roomy = self::filling(&views, COUNT, UNSEEN);
    let trained = [&filling, &roomy].map(|scene| {
        let model = Model::upload(&gpu, scene, 0).unwrap();
        let session = Session { seed: 7, ..small_tiles(&gpu) };
        let options = BaseOptions { iterations: 8, sh_degree: 0, ..Default::default() };
        let mut trainer = base_trainer(&session, &model, &views, &options).unwrap();
        // Its maps are learned too, and must not move in steps that did not fit.
        trainer.correct_exposure(&session, &views).unwrap();
        let report = trainer.run(&model, &views, true, |_| ()).unwrap();
        // Only submissions that fitted are timed; if the only timed one did not fit, the next was timed.
        assert!(!report.steps.stages.is_empty());
        let maps = trainer.exposures().unwrap().unwrap();
        let base = model.download().unwrap().base;
        let kept = base.reordered(&(0..COUNT).collect::<Vec<_>>());
        (report.steps.grown, report.losses, kept, maps)
    });
    assert_eq!((trained[0].0, trained[1].0), (1, 0));
    assert!(trained[0].1 == trained[1].1 && trained[0].2 == trained[1].2);
    assert!(trained[0].3 == trained[1].3 && trained[0].3[0] != IDENTITY);
    assert!(trained[0].2.opacities != filling.base.opacities);
}

/// Future Gaussians get room for one intersection each, used by their sort too, instead of four, for 212
/// bytes per Gaussian instead of 332.
#[test]
fn a_trainer_begins_with_room_for_what_is_there() {
    let gpu = Gpu::new();
    let camera = camera_at(DVec3::new(0.4, -0.3, 0.2), 64, 48);
    let views = Views::upload(&gpu, &[camera], &[&vec![99; 3 * 64 * 48]]).unwrap();
    let scene = cloud(&camera, 60, -2.0, |i| (30.0 + 0.1 * i as f64, 20.0, 3.0 + 0.1 * i as f64, 2.0));
    let room = 100_000;
    let taken = |base: u32| {
        let model = Model::upload_around(&gpu, views.origin, &scene, Room { base, ..Default::default() }).unwrap();
        let options = BaseOptions { iterations: 8, sh_degree: 0, ..Default::default() };
        let before = gpu.memory().used;
        let trainer = base_trainer(&session(&gpu), &model, &views, &options).unwrap();
        let taken = gpu.memory().used - before;
        drop(trainer);
        taken
    };
    // Splats and moments are per Gaussian too. Memory is counted in whole blocks.
    let more = taken(room) - taken(0);
    assert!(more < 220 * u64::from(room), "{more} bytes");
}

/// Room for the trainers of these tests.
const BUDGET: u64 = 64 << 20;

/// Takes all but `left` bytes of `BUDGET`. Once a trainer is made, because making it needs more than it keeps.
fn ballast(gpu: &Gpu, left: u64) -> Vec<Buffer<u8>> {
    let piece = || Buffer::<u8>::new(gpu, "ballast", 1 << 16, Location::Device).ok();
    let mut pieces: Vec<_> = iter::from_fn(piece).collect();
    while BUDGET - gpu.memory().used < left {
        pieces.pop().unwrap();
    }
    pieces
}

/// If memory runs out in the middle of a run, it is an error, and the result so far can be resumed.
#[test]
fn training_that_runs_out_of_memory_keeps_what_it_learned() {
    // The second camera's steps fit.
    let schedule = [1, 1, 1, 1, 1, 0, 1, 0];
    let trainer = |gpu: &Gpu| {
        let views = near_and_far(gpu);
        let (trainer, model) = trainer(&small_tiles(gpu), &views, &filling(&views, COUNT, 0), schedule.to_vec());
        (trainer, model, views)
    };
    let roomy = Gpu::new();
    let (mut whole, model, views) = trainer(&roomy);
    let before = roomy.memory().used;
    while whole.advance(&model, &views).unwrap().is_some() {}
    let after = roomy.memory().used;
    assert!(whole.report().steps.grown == 1 && after > before);
    let want = model.download().unwrap();

    let tight = Gpu::with(ContextOptions { memory_budget: Some(BUDGET), ..ContextOptions::from_env() });
    let (mut cut, tight_model, tight_views) = trainer(&tight);
    let _ballast = ballast(&tight, (after - before) / 2);
    let error = loop {
        match cut.advance(&tight_model, &tight_views) {
            Ok(done) => assert!(done.is_some_and(|done| done < 8), "it fits"),
            Err(error) => break error,
        }
    };
    assert!(matches!(&error, Error::Gpu(gpu) if gpu.is_no_room()) && error.exit_code() == 1, "{error}");
    let kept = cut.checkpoint(&tight_model, &tight_views).unwrap();
    assert_eq!(kept.step, 5);
    // With enough room it resumes as if nothing had happened.
    let (mut on, model, views) = trainer(&roomy);
    on.resume(&model, &kept, false).unwrap();
    while on.advance(&model, &views).unwrap().is_some() {}
    assert!(model.download().unwrap() == want);
}

/// A training run that nearly fills its room gets more before it fails. If there is no more, it continues in
/// its room with the same bits: it does not switch to atomics for intersections that may never come.
#[test]
fn training_that_nearly_fills_its_room_goes_on_in_it_where_there_is_no_more() {
    // Three submissions; the first and the last step use 97 % of the room.
    let mut schedule = vec![1; 40];
    (schedule[0], schedule[39]) = (0, 0);
    let run = |left: Option<u64>| {
        let gpu = &Gpu::with(ContextOptions { memory_budget: Some(BUDGET), ..ContextOptions::from_env() });
        let TileShape { width, height, .. } = TileShape::for_subgroup(gpu.info().subgroup_size);
        let tiles = 256usize.div_ceil(width as usize) * 192usize.div_ceil(height as usize);
        let views = near_and_far(gpu);
        let scene = filling(&views, 4 * UNSEEN * 97 / 100 / tiles, UNSEEN);
        let session = Session { background: BACKGROUND, extent: 2.0, policy: Policy::default(), ..Session::new(gpu) };
        let (mut trainer, model) = trainer(&session, &views, &scene, schedule.clone());
        let ballast = left.map(|left| ballast(gpu, left));
        let before = gpu.memory().used;
        while trainer.advance(&model, &views).unwrap().is_some() {}
        let (after, report) = (gpu.memory().used, trainer.report());
        drop(ballast);
        (report.steps.grown, report.losses, model.download().unwrap(), before, after)
    };
    let roomy = run(None);
    let (before, after) = (roomy.3, roomy.4);
    assert!(roomy.0 == 1 && after > before);
    println!("{before} bytes before growth, {after} after");
    // The lists by intersection would fit, the records would not.
    let tight = run(Some((after - before) * 4 / 5));
    assert_eq!(tight.0, 0);
    // Records by Gaussian would need less.
    assert!(tight.4 >= tight.3, "{} bytes before, {} after", tight.3, tight.4);
    assert!(tight.1 == roomy.1 && tight.2 == roomy.2);
}

/// Steps that only ask for intersections.
struct Asking {
    asks: Buffer<u32>,
    count: Buffer<u32>,
    args: Buffer<u32>,
    stage: dispatch_args::Stage,
    room: u32,
    /// Maximum possible room.
    most: u32,
    /// The recorded steps.
    recorded: Vec<u32>,
    /// Calls for more room: whether ahead of time, and the number needed.
    grown: Vec<(bool, u32)>,
}

impl Asking {
    fn new(context: &Context, asks: &[u32], most: u32) -> Self {
        Asking {
            asks: Buffer::from_slice(context, "asks", asks).unwrap(),
            count: Buffer::zeroed(context, "count", 1).unwrap(),
            args: Buffer::zeroed(context, "args", 3).unwrap(),
            stage: dispatch_args::Stage::new(context, &dispatch_args::Spec { workgroup_size: 1 }).unwrap(),
            room: 100,
            most,
            recorded: Vec::new(),
            grown: Vec::new(),
        }
    }

    fn make_room(&mut self, early: bool, needed: u32) -> Result<(), Error> {
        self.grown.push((early, needed));
        let room = needed + needed / 4;
        if room > self.most {
            return Err(Error::Usage("no room".into()));
        }
        self.room = room;
        Ok(())
    }
}

impl Looped for Asking {
    fn record(&mut self, recorder: &mut Recorder, step: u32, status: &Buffer<u32>) -> Result<(), Error> {
        self.recorded.push(step);
        recorder.copy(&self.asks, step as usize, &self.count, 0, 1);
        let buffers = dispatch_args::Buffers { count: &self.count, dispatch_args: &self.args, status };
        let push = dispatch_args::Push {
            count_index: 0,
            capacity: self.room,
            items_per_group: 1,
            args_index: 0,
            resource_index: Resource::Intersections.index(),
        };
        self.stage.record(recorder, &buffers, &push, 1);
        Ok(())
    }

    fn grow(&mut self, resource: Resource, needed: u32) -> Result<(), Error> {
        assert_eq!(resource, Resource::Intersections);
        self.make_room(false, needed)
    }

    fn grow_early(&mut self, needed: u32) -> Result<(), Error> {
        self.make_room(true, needed)
    }

    fn room(&self) -> u32 {
        self.room
    }
}

#[test]
fn room_is_made_before_a_step_fails_and_not_in_vain() {
    let gpu = Gpu::new();
    // 20 steps in submissions of two, two of them in flight; the first two submissions have one step, as
    // their duration is unknown.
    let run = |asks: [u32; 20], most, total| {
        let mut work = Asking::new(&gpu, &asks, most);
        let done = Steps::new(&gpu, 2).unwrap().run(total, false, &mut work, |_| ());
        (work.grown, work.recorded, done.map(|report| report.grown).ok())
    };
    let each: Vec<u32> = (0..20).collect();
    // 88 leave an eighth of the room; 89 do not, nor do the following steps.
    assert_eq!(run([88; 20], 1000, 20), (vec![], each.clone(), Some(0)));
    let mut asks = [89; 20];
    assert_eq!(run(asks, 1000, 20), (vec![(true, 89)], each.clone(), Some(1)));
    asks[9..].fill(99);
    assert_eq!(run(asks, 1000, 20), (vec![(true, 89), (true, 99)], each.clone(), Some(2)));
    // No steps remain after those in flight.
    assert_eq!(run(asks, 1000, 2), (vec![], each[..2].to_vec(), Some(0)));
    // The room suffices, and only one request for more is made.
    assert_eq!(run(asks, 100, 20), (vec![(true, 89)], each.clone(), Some(0)));
    // It does not suffice for step 12: the submissions that this step stops cannot be repeated, and the loop
    // fails.
    asks[12] = 120;
    let (grown, recorded, done) = run(asks, 100, 20);
    assert_eq!((grown, recorded, done), (vec![(true, 89), (false, 120)], each[..16].to_vec(), None));
    // Without room made ahead of time.
    let mut asks = [50; 20];
    asks[12] = 120;
    let again: Vec<u32> = (0..16).chain(12..20).collect();
    assert_eq!(run(asks, 1000, 20), (vec![(false, 120)], again, Some(1)));
}

/// 4.2 million pixels of a thread each: more workgroups of 64 than the 65,535 of a dimension.
#[test]
fn more_pixels_than_one_dimension_of_a_dispatch_has_threads_are_composited() {
    let (gpu, color) = (Gpu::new(), [9, 200, 77]);
    let camera = Camera::new(4200, 1001, 1e3);
    let views = Views::halved(&gpu, DVec3::ZERO, &[camera], 0, Storage::Device, Some([0.0; 3])).unwrap();
    let photograph: Vec<u32> = (0..camera.pixels()).map(|pixel| pixel.wrapping_mul(2_654_435_761)).collect();
    views.upload_photograph(0, &photograph).unwrap();
    let mut recorder = gpu.recorder("composite").unwrap();
    let targets = views.record_photograph(&mut recorder, 0, Some(color)).unwrap();
    recorder.submit().unwrap().wait().unwrap();
    for (pixel, (found, stored)) in targets.download().unwrap().into_iter().zip(photograph).enumerate() {
        assert_eq!(found, reference::composite::composite(stored, color.map(i32::from)), "pixel {pixel}");
    }
}

/// 33 Gaussians that fill 3840 × 2160 pixels: 4.28 million intersections, in buffers within every device's limit. That is 65 times the
/// initial room.
#[test]
fn intersections_of_many_times_the_initial_room_are_drawn() {
    let gpu = Gpu::new();
    let camera = camera_at(DVec3::ZERO, 3840, 2160);
    let scene = cloud(&camera, 33, -3.0, |i| (1920.0, 1080.0, 3.0 + i as f64, 3e6));
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, Default::default()).unwrap();
    let image = renderer.render(&model, &views, 0, BACKGROUND).unwrap();
    let isects: u32 = renderer.raster.buffers.tile_counts.download().unwrap().iter().sum();
    let fill = f64::from(isects) / f64::from(renderer.raster.grid(0, 1, 3840, 2160).tiles());
    assert!(fill == 33.0 && renderer.raster.capacity() >= isects);
    let want = (1.0 - 1.0 / (1.0 + 3f64.exp())).powi(33);
    for (p, &t) in image.transmittance.iter().enumerate() {
        assert!((f64::from(t) - want).abs() < 1e-5, "pixel {p}: {t}, wanted {want}");
    }
}

/// 34,000 Gaussians that fill 3840 × 2160 pixels: 4.4e9 intersections in tiles of 8 × 8, 1.1e8 more than 32
/// bits can count. This must be an error, not an image of 1.1e8 intersections, nor an endless loop of growth.
/// Larger tiles also need more than the 4 GiB that can be bound.
#[test]
fn more_intersections_than_can_be_counted_are_an_error() {
    let gpu = Gpu::new();
    let camera = camera_at(DVec3::ZERO, 3840, 2160);
    let count = 34_000;
    let scene = cloud(&camera, count, -3.0, |i| (1920.0, 1080.0, 3.0 + 1e-3 * i as f64, 3e6));
    let views = Views::upload(&gpu, &[camera], &[]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let mut renderer = Renderer::new(&gpu, Needs::of(&model), &views, Default::default()).unwrap();
    let error = renderer.render(&model, &views, 0, BACKGROUND).unwrap_err();
    assert!(matches!(error, glint::Error::Gpu(glint::gpu::GpuError::BufferTooLarge { .. })), "{error}");
}

/// 720,000 Gaussians with all bands: 138 MB of harmonics and twice that for their moments, in pages if
/// the limit for one buffer is 128 MiB. Four steps run render, gradient and Adam on all of them; visible ones
/// learn, also in the last page.
#[test]
fn more_gaussians_of_degree_3_than_one_buffer_holds_train() {
    let gpu = Gpu::new();
    let camera = camera_at(DVec3::new(0.4, -0.3, 0.2), 160, 120);
    let count = 720_000;
    let mut scene = cloud(&camera, 1, -1.0, |_| (80.0, 60.0, 3.0, 1.0));
    let base = &mut scene.base;
    base.sh_degree = 3;
    // One in fifty is in view, far enough apart that each has its own pixels.
    let mean = |i: usize| {
        let (x, y, z, _) = scattered(i);
        let far = if i.is_multiple_of(50) { 1.0 } else { -1.0 };
        camera.unproject(2.2 * x, 2.1 * y, far * (2.0 + z)).as_vec3().to_array()
    };
    base.means = (0..count).map(mean).collect();
    base.log_scales = vec![[-4.0; 3]; count];
    base.quats = vec![base.quats[0]; count];
    base.opacities = vec![-2.0; count];
    base.sh = vec![[0.1; 3]; 16 * count];
    let photograph: Vec<u8> = (0..3 * camera.pixels()).map(|k| (k % 251) as u8).collect();
    let views = Views::upload(&gpu, &[camera], &[&photograph]).unwrap();
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let session = Session { background: BACKGROUND, extent: 2.0, ..session(&gpu) };
    let options = BaseOptions { iterations: 4, sh_degree: 3, ..Default::default() };
    let mut trainer = base_trainer(&session, &model, &views, &options).unwrap();
    let started = std::time::Instant::now();
    let report = trainer.run(&model, &views, false, |_| ()).unwrap();
    println!(
        "{count} Gaussians of degree 3, four steps: {:.1} s, {} bytes of buffers, {} of the whole process at most",
        started.elapsed().as_secs_f64(),
        gpu.memory().used,
        peak_memory()
    );
    assert!(report.losses[3] < report.losses[0] && report.losses.iter().all(|l| l.is_finite()), "{:?}", report.losses);
    let after = model.download().unwrap().base;
    let learned = |g: &glint::scene::Gaussians, i: usize| g.sh[16 * i + 15] != [0.1; 3] && g.opacities[i] != -2.0;
    for half in [0..count / 2, count / 2..count] {
        let moved = half.clone().filter(|&i| learned(&after, i)).count();
        assert!(moved > half.len() / 100, "{moved} of {half:?}");
    }
    let unseen = (0..count).filter(|i| !i.is_multiple_of(50)).all(|i| after.opacities[i] == -2.0);
    assert!(unseen, "what is behind the camera has moved");
}
