use glint::{
    data::builtin::builtin_scene,
    gpu::*,
    pipelines::{model::Model, render::*, train::*, views::Views},
    report::metrics::*,
    scene::*,
};
#[test]
fn scratch() {
    let n: usize = std::env::var("N").ok().and_then(|s| s.parse().ok()).unwrap_or(4000);
    let iters: u32 = std::env::var("IT").ok().and_then(|s| s.parse().ok()).unwrap_or(200);
    let deg: u32 = std::env::var("SH").ok().and_then(|s| s.parse().ok()).unwrap_or(3);
    let context = Context::new(&ContextOptions::default()).unwrap();
    let b = builtin_scene(n);
    let train: Vec<_> = b.photos.iter().filter(|p| !p.is_test).collect();
    let test: Vec<_> = b.photos.iter().filter(|p| p.is_test).collect();
    let cams: Vec<Camera> = train.iter().map(|p| p.camera).collect();
    let imgs: Vec<&[u8]> = train.iter().map(|p| &p.rgb[..]).collect();
    let views = Views::upload(&context, &cams, &imgs).unwrap();
    let scene = Scene { base: from_points(&b.point_positions, &b.point_colors, deg), supplement: None };
    let model = Model::upload(&context, &scene, 0).unwrap();
    let t = std::time::Instant::now();
    let rep = train_base(
        &context,
        &model,
        &views,
        b.background,
        &BaseOptions { iterations: iters, sh_degree: deg, seed: 1, extent: 3.0 },
        true,
        |_| (),
    )
    .unwrap();
    let dt = t.elapsed().as_secs_f64();
    println!(
        "{} Gaussians {iters} steps {dt:.2}s = {:.1} ms/step, loss {:.4} -> {:.4}, grown {}",
        scene.base.len(),
        dt * 1e3 / iters as f64,
        rep.losses[0],
        rep.losses.iter().rev().take(48).sum::<f32>() / 48.0,
        rep.steps.grown
    );
    let mut by: std::collections::BTreeMap<&str, f64> = Default::default();
    for s in &rep.steps.stages {
        *by.entry(s.name).or_default() += s.time.as_secs_f64() * 1e3 / 16.0;
    }
    let mut v: Vec<_> = by.into_iter().collect();
    v.sort_by(|a, b| b.1.total_cmp(&a.1));
    for (k, t) in v {
        println!("  {k:20} {t:.3} ms");
    }
    let tcams: Vec<Camera> = test.iter().map(|p| p.camera).collect();
    let tv = Views::upload(&context, &tcams, &[]).unwrap();
    let mut r = Renderer::new(&context, model.count(), &tv, RenderOptions::default()).unwrap();
    let mut sum = 0.0;
    for (i, p) in test.iter().enumerate() {
        let im = r.render(&model, &tv, i as u32, b.background).unwrap();
        let reference: Vec<u8> = p.rgb.clone();
        let q = psnr(&Pair { image: &im.color, reference: &reference, width: im.width, height: im.height }).unwrap();
        sum += q;
    }
    println!("test PSNR {:.2}", sum / test.len() as f64);
}
