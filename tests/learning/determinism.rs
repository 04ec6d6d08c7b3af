//! Two runs on one device give the same bits: base training, and the whole augmentation; so does an
//! interrupted run.

use glint::{
    pipelines::{
        enhance::{EnhanceOptions, enhance},
        join::{JoinOptions, join},
        model::{Model, Room},
        screen::Schedule,
        session::Session,
        train::{BaseOptions, train_base},
        views::Views,
    },
    reference::random_scene,
    scene::{Camera, Scene, from_points},
    stages::WORKGROUP,
};

use super::{
    bits, built,
    common::{Gpu, session},
    put_before, quarter,
};

fn trained(session: &Session, views: &Views, start: &Scene) -> (Vec<u64>, Vec<u32>, Scene) {
    let model = Model::upload(&session.context, start, 0).unwrap();
    let options = BaseOptions { iterations: 60, sh_degree: 2, ..Default::default() };
    let report = train_base(session, &model, views, &options, false, |_| ()).unwrap();
    let scene = model.download().unwrap();
    (bits(&scene), report.losses.iter().map(|l| l.to_bits()).collect(), scene)
}

#[test]
fn training_and_augmentation_give_the_same_bits_twice() {
    let built = built(700);
    let photos: Vec<_> = built.photos.iter().filter(|p| !p.is_test).step_by(12).collect();
    let cameras: Vec<Camera> = photos.iter().map(|p| p.camera).collect();
    let images: Vec<&[u8]> = photos.iter().map(|p| &p.rgb[..]).collect();
    let start = Scene { base: from_points(&built.point_positions, &built.point_colors, 2), ..Default::default() };
    assert!(start.base.len() > 8 * WORKGROUP as usize && cameras.len() == 4);
    // A separate device for each run, so that nothing is left from the first.
    let runs: Vec<_> = (0..2)
        .map(|_| {
            let gpu = Gpu::new();
            let views = Views::upload(&gpu, &cameras, &images).unwrap();
            let session = Session { background: built.background, extent: 3.0, seed: 3, ..session(&gpu) };
            let (base_bits, losses, base) = trained(&session, &views, &start);
            let mut options = EnhanceOptions::quick();
            options.schedule = Schedule { round_steps: 12, final_steps: 12, max_rounds: 3, shared_steps: false };
            options.join.steps_per_view = 4;
            options.ratio = 0.2;
            let enhanced = enhance(&session, &base, &views, &options, |_| ()).unwrap();
            assert!(enhanced.lifted > 10, "{} of {} were lifted", enhanced.lifted, enhanced.refined);
            let joined = enhanced.join.unwrap().losses.iter().map(|l| l.to_bits()).collect::<Vec<_>>();
            (base_bits, losses, bits(&enhanced.scene), enhanced.lifted, joined)
        })
        .collect();
    println!("{} Gaussians, {} lifted", start.base.len(), runs[0].3);
    assert!(runs[0] == runs[1]);
    // Training has changed the bits.
    assert!(runs[0].0 != bits(&start) && runs[0].0 != runs[0].2);
}

/// The joint phase covers everything in a checkpoint: two segments that learn different parameters, in
/// several pages each.
#[test]
fn a_loop_goes_on_from_a_checkpoint_to_the_same_bits() {
    let gpu = Gpu::new();
    let built = built(100);
    let (cameras, photos): (Vec<Camera>, Vec<Vec<u8>>) = built.photos.iter().take(4).map(quarter).unzip();
    let views = Views::upload(&gpu, &cameras, &photos.iter().map(|p| &p[..]).collect::<Vec<_>>()).unwrap();
    let mut scene = random_scene(3, 500, 300, 1);
    for part in [&mut scene.base, &mut scene.supplement.as_mut().unwrap().gaussians] {
        put_before(&cameras[0], &mut part.means);
    }
    let session = Session { background: built.background, extent: 2.0, ..session(&gpu) };
    let options = JoinOptions { steps_per_view: 20, bias_correction: true, ..Default::default() };
    let paged = |page: u32| {
        // Spare room, as after a screen phase.
        let room = Room { supplement: 70, page: Some(page), ..Default::default() };
        Model::upload_around(&gpu, views.origin, &scene, room).unwrap()
    };
    let (model, mut steps) = (paged(192), Vec::new());
    let mut trainer = join(&session, &model, &views, &options).unwrap();
    assert_eq!(trainer.total(), options.steps_per_view * views.cameras.len() as u32);
    let whole = trainer.run(&model, &views, false, |done| steps.push(done)).unwrap();
    let want = bits(&model.download().unwrap());
    assert_eq!(steps.last(), Some(&80));

    // From a running loop with submissions in flight, into pages of another size.
    let model = paged(192);
    let mut trainer = join(&session, &model, &views, &options).unwrap();
    trainer.start(false).unwrap();
    assert_eq!(trainer.advance(&model, &views).unwrap(), Some(1));
    let checkpoint = trainer.checkpoint(&model, &views).unwrap();
    assert!(checkpoint.step > 1 && checkpoint.step < 80, "{}", checkpoint.step);
    while trainer.advance(&model, &views).unwrap().is_some() {}
    assert!(bits(&model.download().unwrap()) == want && trainer.report().losses == whole.losses);

    // The last steps of a loop are in flight: they are reported all the same.
    let model = paged(192);
    let mut trainer = join(&session, &model, &views, &options).unwrap();
    trainer.start(false).unwrap();
    trainer.go_on_to(2);
    assert_eq!(trainer.advance(&model, &views).unwrap(), Some(1));
    assert_eq!(trainer.checkpoint(&model, &views).unwrap().step, 2);
    assert_eq!([(); 2].map(|()| trainer.advance(&model, &views).unwrap()), [Some(2), None]);

    let other = paged(256);
    let mut trainer = join(&session, &other, &views, &options).unwrap();
    trainer.resume(&other, &checkpoint, false).unwrap();
    while trainer.advance(&other, &views).unwrap().is_some() {}
    assert!(bits(&other.download().unwrap()) == want);
    assert_eq!(trainer.report().losses, whole.losses);
    // The last checkpoint has no steps left.
    let last = trainer.checkpoint(&other, &views).unwrap();
    let fresh = paged(256);
    let mut trainer = join(&session, &fresh, &views, &options).unwrap();
    trainer.resume(&fresh, &last, false).unwrap();
    assert_eq!((last.step, trainer.advance(&fresh, &views).unwrap()), (80, None));
    assert!(bits(&fresh.download().unwrap()) == want);

    // With another model, or a longer schedule, nothing changes.
    let small = random_scene(3, 400, 300, 1);
    let model = Model::upload(&gpu, &small, 0).unwrap();
    let mut trainer = join(&session, &model, &views, &options).unwrap();
    let refused = trainer.resume(&model, &checkpoint, false).unwrap_err().to_string();
    assert!(refused.contains("base.geometry"), "{refused}");
    assert!(bits(&model.download().unwrap()) == bits(&small));
    let shorter = JoinOptions { steps_per_view: 1, ..options };
    let mut trainer = join(&session, &fresh, &views, &shorter).unwrap();
    assert!(trainer.resume(&fresh, &last, false).unwrap_err().to_string().contains("of 4 steps"));
}
