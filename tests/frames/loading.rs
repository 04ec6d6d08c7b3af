//! Scenes that load while others are drawn.

use super::*;

/// Its counts and dispatches would be uninitialised: a frame might never end.
#[test]
fn an_upload_that_was_not_recorded_is_no_model() {
    let (gpu, other) = (Gpu::new(), Gpu::new());
    let prepare = || Upload::prepare(&gpu, DVec3::ZERO, &random_scene(7, 60, 20, 1), model::Room::default()).unwrap();
    let refused = |result: Result<(), Error>, words: &str| match result {
        Err(Error::Usage(message)) => assert!(message.contains(words), "{message}"),
        other => panic!("{other:?}"),
    };
    refused(prepare().finish().map(drop), "not recorded");
    // Recording is refused if the recorder is of another device.
    let upload = prepare();
    refused(upload.record(&mut other.recorder("elsewhere").unwrap()), "another context");
    assert!(!upload.is_recorded());
    let mut recorder = gpu.recorder("here").unwrap();
    upload.record(&mut recorder).unwrap();
    recorder.submit().unwrap().wait().unwrap();
    assert_eq!(upload.finish().unwrap().counts().unwrap(), [60, 0, 20]);
}

/// One thread draws continuously while another loads three scenes, one after the other. Each is prepared,
/// recorded, run and finished between frames, and drawn from the next frame on. Both threads submit to one
/// queue, under the engine's lock.
#[test]
fn scenes_load_in_one_thread_while_another_draws() {
    let gpu = Gpu::new();
    let camera = random_camera(48, 40);
    let scenes: Vec<Scene> = (0..4).map(|seed| random_scene(30 + seed, 250, 60, 1)).collect();
    let pages = model::Room { page: Some(97), ..Default::default() };
    let first = Model::upload_around(&gpu, DVec3::ZERO, &scenes[0], pages).unwrap();
    let mut frames = Frames::new(&gpu, Limits { in_flight: 3, ..wide(Limits::of(&first, 48, 40)) }).unwrap();
    // Slot k shows the scene that was current when it was last recorded.
    let targets = [0, 1, 2].map(|_| Float::new(&gpu, 48 * 40));
    let submitted = gpu.counters().submissions;
    let (drawn, done) = (AtomicU32::new(0), AtomicBool::new(false));
    let (send, receive) = std::sync::mpsc::channel::<Model>();
    let (models, shown, during) = std::thread::scope(|s| {
        let loading = s.spawn(|| {
            let engine = Engine::new(&gpu, 1);
            // Frames drawn between start and end of a load.
            let mut during = Vec::new();
            for scene in &scenes[1..] {
                let before = drawn.load(Relaxed);
                let next_frame = || {
                    let now = drawn.load(Relaxed);
                    while drawn.load(Relaxed) == now && !done.load(Relaxed) {
                        std::thread::yield_now();
                    }
                };
                next_frame();
                let upload = Upload::prepare(&gpu, DVec3::ZERO, scene, pages).unwrap();
                next_frame();
                let mut kept = Kept::default();
                engine.run(|commands| {
                    let mut recorder = unsafe { Recorder::borrow(&gpu, commands, Kept::default()) };
                    upload.record(&mut recorder).unwrap();
                    kept = recorder.finish();
                });
                send.send(upload.finish().unwrap()).unwrap();
                during.push(drawn.load(Relaxed) - before);
            }
            drop(send);
            during
        });
        let engine = Engine::new(&gpu, 3);
        let (mut models, mut shown) = (vec![first], [0; 3]);
        let mut last = None;
        for n in 0.. {
            models.extend(receive.try_recv());
            // Until each slot shows the last scene.
            if models.len() == scenes.len() && last.is_none() {
                last = Some(n + 3);
            }
            if last == Some(n) || loading.is_finished() && models.len() < scenes.len() {
                break;
            }
            let slot = n % 3;
            let commands = engine.begin(slot);
            let color = Some(targets[slot as usize].target(Blend::Opaque(GREY)));
            let views = [FrameView { color, ..FrameView::new(camera) }];
            let model = models.last().unwrap();
            let frame = Frame { slot, instances: &[Instance::of(model)], views: &views };
            unsafe { frames.record(commands, &frame) }.unwrap();
            engine.submit(slot);
            shown[slot as usize] = models.len() - 1;
            drawn.fetch_add(1, Relaxed);
        }
        done.store(true, Relaxed);
        engine.finish();
        (models, shown, loading.join().unwrap())
    });
    assert_eq!((models.len(), shown), (4, [3; 3]));
    // At least two frames were drawn during every load, and glint itself submitted nothing.
    assert!(during.len() == 3 && during.iter().all(|&frames| frames >= 2), "{during:?}");
    assert_eq!(gpu.counters().submissions, submitted);
    let want = rendered(&gpu, &scenes[3], &camera);
    for target in &targets {
        assert!(target.pixels().iter().zip(&want).all(|(g, w)| g[..3] == w[..3]));
    }
    // Every scene was loaded completely, as by a separate upload.
    for (model, scene) in models.iter().zip(&scenes) {
        let back = model.download().unwrap();
        assert_eq!((back.base.means, back.base.sh), (scene.base.means.clone(), scene.base.sh.clone()));
    }
}
