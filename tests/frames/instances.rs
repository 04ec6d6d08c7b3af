//! Models placed in a world.

use super::*;

/// Transforms all Gaussians of a scene of degree 0, since rotating harmonics is too much for a test.
fn move_all(params: &mut Params, t: &Transform) {
    let stride = params.stride;
    for i in 0..params.count {
        let mean = t.translation + t.scale * (t.rotation * params.mean(i));
        (0..3).for_each(|c| params.geometry[(layout::MEAN + c) * stride + i] = mean[c]);
        (0..3).for_each(|c| params.geometry[(layout::LOG_SCALE + c) * stride + i] += t.scale.ln());
        let [w, x, y, z] = params.quat(i);
        let q = t.rotation * DQuat::from_xyzw(x, y, z, w).normalize();
        [q.w, q.x, q.y, q.z]
            .into_iter()
            .enumerate()
            .for_each(|(c, v)| params.geometry[(layout::QUAT + c) * stride + i] = v);
        if let Some((direction, ..)) = params.lobe(i) {
            let (direction, j) = (t.rotation * direction, i - params.lobe_first);
            (0..3).for_each(|c| params.lobes[(layout::LOBE_DIRECTION + c) * params.lobe_stride + j] = direction[c]);
        }
    }
}

/// The first or the second half of the base, and of the supplement.
fn half_of(scene: &Scene, second: bool) -> Scene {
    let pick = |n: usize| if second { n / 2..n } else { 0..n / 2 };
    let gaussians = |g: &Gaussians| g.reordered(&pick(g.len()).collect::<Vec<_>>());
    let supplement = scene.supplement.as_ref().map(|s| {
        let r = pick(s.gaussians.len());
        let lobes = Lobes {
            directions: s.lobes.directions[r.clone()].to_vec(),
            widths: s.lobes.widths[r.clone()].to_vec(),
            sharpness: s.lobes.sharpness[r].to_vec(),
        };
        Supplement { gaussians: gaussians(&s.gaussians), lobes }
    });
    Scene { base: gaussians(&scene.base), supplement, ..Default::default() }
}

#[test]
fn two_halves_of_a_scene_that_stand_where_it_stands_are_the_scene() {
    let gpu = Gpu::new();
    let camera = random_camera(61, 47);
    let scene = random_scene(12, 900, 300, 0);
    let transform = Transform {
        rotation: DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 1.1),
        scale: 1.7,
        translation: DVec3::new(0.4, -0.3, 0.2),
    };
    // The camera moves along, so that the view stays the same.
    let moved_camera = gone_with(&camera, &transform);
    let mut world = Params::from_scene(&scene).unwrap();
    move_all(&mut world, &transform);
    let near = 0.2 * transform.scale;
    let want = twin_of(&world, &View { near, ..View::from_camera(&moved_camera) }.rounded(), |_| f64::INFINITY);
    let halves = [false, true].map(|second| {
        // The origin of a model's coordinates does not change its place.
        let origin = if second { DVec3::new(3.0, 1.0, -2.0) } else { DVec3::ZERO };
        Model::upload_around(&gpu, origin, &half_of(&scene, second), model::Room::default()).unwrap()
    });
    let limits = Limits {
        instances: 2,
        gaussians: halves.iter().map(Model::capacity).sum(),
        depth_out: true,
        ..wide(Limits::of(&halves[0], 61, 47))
    };
    let mut frames = Frames::new(&gpu, limits).unwrap();
    let engine = Engine::new(&gpu, 1);
    let float = Float::new(&gpu, camera.pixels());
    let ids = Buffer::<u32>::zeroed(&gpu, "ids", camera.pixels() as usize).unwrap();
    let view = FrameView {
        near,
        color: Some(float.target(Blend::Premultiplied)),
        ids: Some(Pixels::Buffer(BufferRange { buffer: ids.raw().handle(), offset: 0 })),
        ..FrameView::new(moved_camera)
    };
    let instances = [0, 1].map(|k| Instance { transform, ..Instance::of(&halves[k]) });
    draw(&engine, &mut frames, &instances, view);
    let (mut calm, mut off, mut squares) = (0, 0f64, 0f64);
    for (got, (want, margin)) in float.pixels().iter().zip(&want) {
        if *margin > NEAR {
            calm += 1;
            for c in 0..3 {
                let difference = (f64::from(got[c]) - want[c]).abs();
                (off, squares) = (off.max(difference), squares + difference * difference);
            }
        }
    }
    // A coordinate of 10 units in float32 is off by 1e-6 of a pixel (0.03 units nearby), and an edge has a
    // slope of 1 per pixel; on average a tenth of that.
    assert!(calm > 2000 && off < 4e-5 && (squares / calm as f64).sqrt() < 4e-6, "{calm} {off:e} {squares:e}");
    // If both have the same origin, they equal the scene to the last bit.
    let (whole, parts) = (
        Model::upload(&gpu, &scene, 0).unwrap(),
        [false, true].map(|b| Model::upload(&gpu, &half_of(&scene, b), 0).unwrap()),
    );
    let mut image = |models: &[&Model]| {
        let instances: Vec<_> = models.iter().map(|model| Instance { transform, ..Instance::of(model) }).collect();
        draw(&engine, &mut frames, &instances, view);
        float.pixels()
    };
    // Equal depths would be in another order: the halves of the supplement lie between those of the base.
    assert_eq!(image(&[&whole]), image(&[&parts[0], &parts[1]]));
    let ids = ids.download().unwrap();
    let of = |k: usize| ids.iter().filter(|&&id| id != u32::MAX && (id >= halves[0].capacity()) == (k == 1)).count();
    assert!(of(0) > 100 && of(1) > 100 && ids.iter().all(|&id| id == u32::MAX || id < 1200), "{} {}", of(0), of(1));
    // Without instances only the background is drawn.
    let empty = FrameView { color: Some(float.target(Blend::Opaque(GREY))), ..view };
    draw(&engine, &mut frames, &[], empty);
    assert!(float.pixels().iter().all(|p| *p == [GREY[0], GREY[1], GREY[2], 1.0]));
}

#[test]
fn a_list_of_instances_grows_and_takes_nothing_from_the_heap() {
    let gpu = Gpu::new();
    let models: Vec<Model> = (0..40)
        .map(|seed| Model::upload(&gpu, &random_scene(seed, 30, if seed % 2 == 0 { 10 } else { 0 }, 1), 0).unwrap())
        .collect();
    let limits = Limits {
        instances: 40,
        gaussians: models.iter().map(Model::capacity).sum(),
        depth_out: true,
        ..wide(Limits::of(&models[0], 32, 24))
    };
    let mut frames = Frames::new(&gpu, limits).unwrap();
    let (engine, float) = (Engine::new(&gpu, 1), Float::new(&gpu, 32 * 24));
    let ids = Buffer::<u32>::zeroed(&gpu, "ids", 32 * 24).unwrap();
    let view = FrameView {
        color: Some(float.target(Blend::Premultiplied)),
        ids: Some(Pixels::Buffer(BufferRange { buffer: ids.raw().handle(), offset: 0 })),
        ..FrameView::new(random_camera(32, 24))
    };
    for count in [1, 2, 7, 20, 40, 3] {
        let instances: Vec<_> = models[..count].iter().map(Instance::of).collect();
        engine.run(|commands| {
            let taken = TAKEN.get();
            unsafe { frames.record(commands, &Frame { slot: 0, instances: &instances, views: &[view] }) }.unwrap();
            assert_eq!(TAKEN.get() - taken, 0, "{count} instances");
        });
    }
}

#[test]
fn room_that_is_not_filled_shows_nothing() {
    let gpu = Gpu::new();
    let (scene, camera) = (random_scene(7, 600, 0, 1), random_camera(61, 47));
    let few = half_of(&scene, false);
    let (all, roomy) = (Model::upload(&gpu, &scene, 0).unwrap(), {
        let room = model::Room { base: 300, ..Default::default() };
        Model::upload_around(&gpu, DVec3::ZERO, &few, room).unwrap()
    });
    let mut frames = Frames::new(&gpu, wide(Limits::of(&all, 61, 47))).unwrap();
    let engine = Engine::new(&gpu, 1);
    let float = Float::new(&gpu, camera.pixels());
    let mut image = |model| {
        let view = FrameView { color: Some(float.target(Blend::Opaque(GREY))), ..FrameView::new(camera) };
        draw(&engine, &mut frames, &[Instance::of(model)], view);
        float.pixels()
    };
    let (whole, half) = (image(&all), image(&roomy));
    assert!(half.iter().zip(rendered(&gpu, &few, &camera)).all(|(g, w)| g[..3] == w[..3]));
    assert_ne!(whole, half);
}
