//! Two runs on one device give the same bits: base training, and the whole augmentation.

mod common;

use common::{Gpu, session};
use glint::{
    data::builtin::builtin_scene,
    pipelines::{
        enhance::{EnhanceOptions, enhance},
        model::Model,
        screen::Schedule,
        session::Session,
        train::{BaseOptions, train_base},
        views::Views,
    },
    reference::Params,
    scene::{Camera, Scene, from_points},
    stages::WORKGROUP,
};

/// Every float as its bits: 0 and −0 are told apart, and NaN is equal to itself.
fn bits(scene: &Scene) -> Vec<u64> {
    let p = Params::from_scene(scene).unwrap();
    [p.geometry, p.sh, p.lobes].concat().into_iter().map(f64::to_bits).collect()
}

fn trained(session: &Session, views: &Views, start: &Scene) -> (Vec<u64>, Vec<u32>, Scene) {
    let model = Model::upload(&session.context, start, 0).unwrap();
    let options = BaseOptions { iterations: 60, sh_degree: 2 };
    let report = train_base(session, &model, views, &options, false, |_| ()).unwrap();
    let scene = model.download().unwrap();
    (bits(&scene), report.losses.iter().map(|l| l.to_bits()).collect(), scene)
}

#[test]
fn training_and_augmentation_give_the_same_bits_twice() {
    let built = builtin_scene(700);
    let photos: Vec<_> = built.photos.iter().filter(|p| !p.is_test).step_by(12).collect();
    let cameras: Vec<Camera> = photos.iter().map(|p| p.camera).collect();
    let images: Vec<&[u8]> = photos.iter().map(|p| &p.rgb[..]).collect();
    let start = Scene { base: from_points(&built.point_positions, &built.point_colors, 2), supplement: None };
    assert!(start.base.len() > 8 * WORKGROUP as usize && cameras.len() == 4);
    // A device of its own for each run: nothing may be left over from the first.
    let runs: Vec<_> = (0..2)
        .map(|_| {
            let gpu = Gpu::new();
            let views = Views::upload(&gpu, &cameras, &images).unwrap();
            let session = Session { background: built.background, extent: 3.0, seed: 3, ..session(&gpu) };
            let (base_bits, losses, base) = trained(&session, &views, &start);
            let mut options = EnhanceOptions::quick();
            options.schedule = Schedule { round_steps: 20, final_steps: 20, max_rounds: 3, shared_steps: false };
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
    // And the bits are not those of doing nothing.
    assert!(runs[0].0 != bits(&start) && runs[0].0 != runs[0].2);
}
