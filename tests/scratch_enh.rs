use glint::{
    data::builtin::builtin_scene,
    gpu::*,
    pipelines::{enhance::*, model::Model, render::*, train::*, views::Views},
    report::metrics::*,
    scene::*,
};
fn env(k: &str, d: f64) -> f64 {
    std::env::var(k).ok().and_then(|s| s.parse().ok()).unwrap_or(d)
}
#[test]
fn scratch() {
    let n = env("N", 4000.0) as usize;
    let iters = env("IT", 1000.0) as u32;
    let deg = env("SH", 3.0) as u32;
    let ratio = env("R", 0.1);
    let context = Context::new(&ContextOptions::default()).unwrap();
    let b = builtin_scene((n as f64 * (1.0 + ratio)) as usize + 100);
    let train: Vec<_> = b.photos.iter().filter(|p| !p.is_test).collect();
    let test: Vec<_> = b.photos.iter().filter(|p| p.is_test).collect();
    let cams: Vec<Camera> = train.iter().map(|p| p.camera).collect();
    let imgs: Vec<&[u8]> = train.iter().map(|p| &p.rgb[..]).collect();
    let views = Views::upload(&context, &cams, &imgs).unwrap();
    let tcams: Vec<Camera> = test.iter().map(|p| p.camera).collect();
    let tv = Views::upload(&context, &tcams, &[]).unwrap();
    let mean = cams.iter().map(|c| c.eye()).sum::<glam::DVec3>() / cams.len() as f64;
    let extent = 1.1 * cams.iter().map(|c| c.eye().distance(mean)).fold(0.0, f64::max) as f32;
    let eval = |scene: &Scene, what: &str| {
        let model = Model::upload(&context, scene, 0).unwrap();
        for (tag, v, photos) in [("test", &tv, &test), ("train", &views, &train)] {
            let mut r = Renderer::new(&context, model.count(), v, RenderOptions::default()).unwrap();
            let mut sum = 0.0;
            for (i, p) in photos.iter().enumerate() {
                let im = r.render(&model, v, i as u32, b.background).unwrap();
                sum += psnr(&Pair { image: &im.color, reference: &p.rgb, width: im.width, height: im.height }).unwrap();
            }
            println!(
                "{what}: {tag} PSNR {:.3}  ({} + {})",
                sum / photos.len() as f64,
                scene.base.len(),
                scene.supplement.as_ref().map_or(0, |s| s.gaussians.len())
            );
        }
    };
    let train_it = |points: usize, iters: u32, sched: u32| {
        let scene =
            Scene { base: from_points(&b.point_positions[..points], &b.point_colors[..points], deg), supplement: None };
        let model = Model::upload(&context, &scene, 0).unwrap();
        let t = std::time::Instant::now();
        train_base(
            &context,
            &model,
            &views,
            b.background,
            &BaseOptions { iterations: iters, sh_degree: deg, seed: 1, extent },
            true,
            |_| (),
        )
        .unwrap();
        println!("train {points} {iters} {sched}: {:.1}s", t.elapsed().as_secs_f64());
        model.download().unwrap()
    };
    let base = train_it(n, iters, 0);
    eval(&base, "base");
    let mut o = EnhanceOptions::quick(extent, b.background);
    o.ratio = ratio;
    o.steps_per_view = env("JS", 30.0) as u32;
    o.schedule.round_steps = env("RS", 30.0) as u32;
    o.schedule.final_steps = env("FS", 60.0) as u32;
    o.bias_correction = env("BC", 0.0) > 0.0;
    let mut last = 0;
    let e = enhance(
        &context,
        &base,
        &views,
        &o,
        |s| {
            if let Stage::Plane { progress, .. } = s
                && progress.round != last
            {
                last = progress.round;
                println!("{progress:?}")
            }
        },
        |b| {
            println!(
                "counts {:?} rounds {} loss {:?} -> {:?}, appended {}",
                b.refined.counts,
                b.refined.rounds,
                b.refined.base_losses.iter().sum::<f32>(),
                b.refined.losses.iter().sum::<f32>(),
                b.lifted.appended
            );
            Ok(())
        },
    )
    .unwrap();
    println!("times {:?} refined {} lifted {}", e.times, e.refined, e.lifted);
    let j = e.join.as_ref().unwrap();
    println!(
        "joint loss {} -> {}",
        j.losses[..48].iter().sum::<f32>() / 48.0,
        j.losses.iter().rev().take(48).sum::<f32>() / 48.0
    );
    let mut by: std::collections::BTreeMap<&str, f64> = Default::default();
    for s in &j.steps.stages {
        *by.entry(s.name).or_default() += s.time.as_secs_f64() * 1e3 / 16.0;
    }
    println!("{by:?}");
    eval(&e.scene, "augmented");
    if env("PLAIN", 1.0) > 0.0 {
        let plain = train_it(n + e.lifted as usize, iters + o.steps_per_view * 48, 0);
        eval(&plain, "plain+");
    }
}
