//! Room for intersections, and plans of all memory.

use super::*;

#[test]
fn what_overflows_says_so_shows_what_is_near_and_finds_room_in_flight() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(4, 800, 0, 0), random_camera(64, 48));
    let want = rendered(&gpu, &scene, &camera);
    let model = Model::upload(&gpu, &scene, 0).unwrap();
    let limits = Limits { intersections: Room::Intersections(300), in_flight: 2, ..wide(Limits::of(&model, 64, 48)) };
    let mut frames = Frames::new(&gpu, limits.clone()).unwrap();
    assert_eq!(frames.capacity(), 300);
    let engine = Engine::new(&gpu, 2);
    let targets = [0, 1].map(|_| Float::new(&gpu, 64 * 48));
    let record = |frames: &mut Frames, slot: u32| {
        let color = Some(targets[slot as usize].target(Blend::Opaque(GREY)));
        let view = FrameView { color, ..FrameView::new(camera) };
        let commands = engine.begin(slot);
        let frame = Frame { slot, instances: &[Instance::of(&model)], views: &[view] };
        unsafe { frames.record(commands, &frame) }.unwrap();
        engine.submit(slot);
    };
    record(&mut frames, 0);
    engine.finish();
    let report = frames.report(0).unwrap();
    let needed = report.needed.expect("300 intersections are too few");
    assert!(needed > 1000 && report.intersections == 300 && report.visible > 100, "{report:?}");
    // In the order of depth, each Gaussian takes as many places as it touches tiles. The last one that fits
    // may fit for some of its tiles only. Pixels show exactly the Gaussians before it, as in the twin, and
    // none after it.
    let tile = limits.policy.tile(gpu.info());
    let options = Options { tile_width: tile.width, tile_height: tile.height, ..Default::default() };
    let view = View::from_camera(&camera).rounded();
    let mut near = project(&Params::from_scene(&scene).unwrap(), &view, &options);
    let mut order: Vec<usize> = (0..near.depths.len()).filter(|&i| near.tile_counts[i] > 0).collect();
    order.sort_by(|&a, &b| near.depths[a].total_cmp(&near.depths[b]));
    let tiling = Tiling::new(64, 48, &options);
    let (mut room, mut in_part, mut missing) = (300, vec![false; tiling.count()], 0);
    for i in order {
        let takes = near.tile_counts[i];
        if takes <= room {
            room -= takes;
            continue;
        }
        if room > 0 {
            for_each_tile(&near.splats[i], &tiling, |tile| in_part[tile as usize] = true);
        }
        (room, missing) = (0, missing + 1);
        (near.splats[i], near.depths[i], near.tile_counts[i]) = (Default::default(), f64::INFINITY, 0);
    }
    let grey = Background::Color(GREY.map(f64::from));
    let prefix = blend_before(&near.splats, &Intersections::new(&near, tiling), grey, 0.5, |_| f64::INFINITY);
    let (mut calm, mut changed) = (0, 0);
    for (pixel, got) in targets[0].pixels().iter().enumerate() {
        let tile = tiling.tile_of(pixel as u32 % 64, pixel as u32 / 64);
        if !in_part[tile as usize] && prefix.margins[pixel].image() > NEAR {
            calm += 1;
            let far = (0..3).any(|c| (f64::from(want[pixel][c]) - prefix.image[pixel][c]).abs() > 0.01);
            changed += usize::from(far);
            for c in 0..3 {
                let off = (f64::from(got[c]) - prefix.image[pixel][c]).abs();
                assert!(off < 1e-5, "{pixel}: {got:?} {:?}", prefix.image[pixel]);
            }
        }
    }
    assert!(missing > 100 && calm > 2000 && changed > 500, "{missing} {calm} {changed}");
    // The frame in slot 0 is in flight while room is made for the one in slot 1.
    record(&mut frames, 0);
    frames.reserve(needed).unwrap();
    assert!(frames.capacity() >= needed);
    record(&mut frames, 1);
    engine.finish();
    assert_eq!((frames.report(0).unwrap().needed, frames.report(1).unwrap().needed), (Some(needed), None));
    assert!(targets[1].pixels().iter().zip(&want).all(|(g, w)| g[..3] == w[..3]));
    let plan = limits.plan(gpu.info()).unwrap().bytes();
    let more = Limits { intersections: Room::Bytes(1 << 20), ..limits }.plan(gpu.info()).unwrap().bytes();
    assert!(more > plan + (900 << 10) && more < plan + (1200 << 10), "{plan} {more}");
}

/// The device's limit for one buffer ends growth; `tests/invariants/reduction.rs` tests that of memory.
#[test]
fn room_ends_at_the_largest_buffer() {
    let gpu = Gpu::new();
    let model = Model::upload(&gpu, &random_scene(4, 100, 0, 0), 0).unwrap();
    let limits = Limits { intersections: Room::Intersections(1000), ..Limits::of(&model, 16, 16) };
    let mut frames = Frames::new(&gpu, limits).unwrap();
    // On a CPU device untouched pages take no memory.
    if gpu.info().is_cpu && gpu.info().max_storage_bytes <= 128 << 20 {
        let most = (gpu.info().max_storage_bytes / 4) as u32;
        frames.reserve(most / 10 * 9).unwrap();
        assert_eq!(frames.capacity(), most);
        assert!(frames.reserve(most + 1).is_err());
        // The default room for 2.5 million Gaussians at 3840 × 2160 would be 35 million.
        let large = Limits { gaussians: 2_500_000, width: 3840, height: 2160, ..frames.limits().clone() };
        for intersections in [Room::Usual, Room::Bytes(1 << 40)] {
            let plan = Limits { intersections, ..large.clone() }.plan(gpu.info()).unwrap();
            let lists = plan.0.iter().filter(|buffer| buffer.name.starts_with("isect"));
            assert!(
                lists.clone().count() > 3 && lists.map(|list| list.bytes()).all(|b| b <= gpu.info().max_storage_bytes)
            );
        }
    }
}

#[test]
fn plans_made_before_there_is_a_model_say_what_is_held() {
    let gpu = Gpu::new();
    let entry = unsafe { ash::Entry::load() }.unwrap();
    for (supplement, degree, half) in [(0, 0, false), (700, 3, false), (700, 2, true)] {
        let scene = random_scene(9, 9000, supplement, degree);
        let room = model::Room { half, ..Default::default() };
        let before = gpu.memory().used;
        let model = Model::upload_around(&gpu, DVec3::ZERO, &scene, room).unwrap();
        let (planned, held) = (Model::plan(gpu.info(), &scene, room).bytes(), gpu.memory().used - before);
        // A buffer for unused bindings, and the rounding of small buffers.
        assert!(held.abs_diff(planned) < 4096, "{held} bytes held, {planned} planned");
        // An upload takes the same again, on a device that shares the host's memory.
        drop(model);
        for room in [room, model::Room { page: Some(1000), base: 2500, ..room }] {
            let before = gpu.memory().used;
            let upload = Upload::prepare(&gpu, DVec3::ZERO, &scene, room).unwrap();
            let staged = Upload::plan(gpu.info(), &scene, room).bytes();
            let held = gpu.memory().used - before - Model::plan(gpu.info(), &scene, room).bytes();
            if gpu.info().is_cpu {
                // Placeholders for missing lobes, one per page.
                assert!(held.abs_diff(staged) < 4096, "{held} bytes held, {staged} planned");
            }
            drop(upload);
        }
        let model = Model::upload_around(&gpu, DVec3::ZERO, &scene, room).unwrap();
        // Each is listed by name.
        let named = |held: Vec<Held>| {
            assert!(held.iter().all(|held| held.buffer != vk::Buffer::null()));
            (
                held.iter().map(|held| held.name).collect::<BTreeSet<_>>(),
                held.iter().map(|held| held.bytes).sum::<u64>(),
            )
        };
        let (names, bytes) = named(model.held());
        assert!(
            bytes == planned && names.contains("supplement lobes") == (supplement > 0),
            "{names:?} of {bytes} bytes"
        );
        let needs = Needs::of_scene(&scene, half);
        assert_eq!(needs, Needs::of(&model));
        let limits = Limits::for_needs(needs, 320, 200);
        // No device is needed: the properties of a physical one give the same plan.
        let physical = unsafe { Context::describe(&entry, gpu.instance(), gpu.physical_device()) }.unwrap();
        assert_eq!(Model::plan(&physical, &scene, room), Model::plan(gpu.info(), &scene, room));
        assert_eq!(limits.plan(&physical).unwrap(), limits.plan(gpu.info()).unwrap());
        let before = gpu.memory().used;
        let frames = Frames::new(&gpu, limits.clone()).unwrap();
        let (planned, held) = (limits.plan(gpu.info()).unwrap().bytes(), gpu.memory().used - before);
        assert!(held.abs_diff(planned) < 4096, "{held} bytes held, {planned} planned");
        // Except for one element of each of the four kinds of gradient records, and the reports that the host
        // reads.
        let (reports, held): (Vec<_>, Vec<_>) = frames.held().into_iter().partition(|held| held.name == "report");
        assert!(reports.len() == 2 && reports[0].buffer != reports[1].buffer && reports[0].bytes == 40, "{reports:?}");
        let (names, bytes) = named(held);
        assert!(
            bytes + 3 * 12 + 16 == planned && names.contains("image") && names.contains("target"),
            "{names:?}: {bytes}"
        );
        drop(frames);
    }
}

/// An engine learns the required room only after its first frame. So the default must suffice for a capture
/// at screen size, from a camera of its photographs, opaque and with the gaps between points filled.
#[test]
fn a_first_frame_of_a_capture_finds_room_at_the_size_of_a_screen() {
    let Some(path) = shared::shared("small/garden") else { return };
    let gpu = Gpu::new();
    let dataset = Dataset::open(path, &DatasetOptions::default()).unwrap();
    let cloud = first_points(&dataset, Some(30_000), 0).cloud;
    let mut base = from_points(&cloud.around(DVec3::ZERO), &cloud.colors, 0);
    base.opacities.fill(3.0);
    let model = Model::upload(&gpu, &Scene { base, ..Default::default() }, 0).unwrap();
    let (width, height) = (1920, 1080);
    let mut frames = Frames::new(&gpu, Limits { texel: Texel::Rgba8, ..Limits::of(&model, width, height) }).unwrap();
    let engine = Engine::new(&gpu, 1);
    let target = Buffer::<u32>::new(&gpu, "target", (width * height) as usize, Location::Device).unwrap();
    let range = BufferRange { buffer: target.raw().handle(), offset: 0 };
    let color = Some(Target::new(Pixels::Buffer(range), Texel::Rgba8));
    for photo in dataset.photos.iter().step_by(dataset.photos.len().div_ceil(4)) {
        let view = FrameView { color, ..FrameView::new(photo.camera.fitted(width, height)) };
        draw(&engine, &mut frames, &[Instance::of(&model)], view);
        let report = frames.report(0).unwrap();
        println!("{}: {} intersections, room for {}", photo.name, report.intersections, frames.capacity());
        assert!(report.needed.is_none() && report.intersections > 100_000, "{report:?}");
    }
}
