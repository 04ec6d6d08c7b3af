//! Compares the score of a decomposition with float64.

use std::fs;

use glint::{
    data::{Alpha, DIFFUSE, ImageFile, Photo, PixelSource, Reduce, SPECULAR, Split, write_png_bytes},
    pipelines::render::RenderOptions,
    reference::{self, Background, Options, Params, random_camera, random_scene},
    report::evaluate::evaluate_parts,
    scene::Scene,
};

use super::common::Gpu;

const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];

/// Linear light of an sRGB value (IEC 61966-2-1).
fn linear(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Renders by the float64 twins, parts by the definition (method, section 6), and a separate PSNR.
#[test]
fn the_score_of_the_parts_is_that_of_float64() {
    let gpu = Gpu::new();
    let (width, height) = (48, 40);
    let camera = random_camera(width, height);
    let folder = tempfile::tempdir().unwrap();
    let bytes = |factor: u32| -> Vec<u8> { (0..3 * width * height).map(|i| (i * factor % 251) as u8).collect() };
    let (diffuse, specular) = (bytes(7), bytes(23));
    for (part, bytes) in [("images", &diffuse), (DIFFUSE, &diffuse), (SPECULAR, &specular)] {
        fs::create_dir(folder.path().join(part)).unwrap();
        write_png_bytes(folder.path().join(part).join("a.png"), width, height, bytes).unwrap();
    }
    let path = folder.path().join("images/a.png");
    let size = [width, height];
    let file = ImageFile {
        path,
        size,
        orientation: 1,
        bytes_per_pixel: 3,
        has_alpha: false,
        lens: None,
        mask: None,
        alpha: Alpha::Background,
        reduce: Reduce::Area,
    };
    let photo = Photo { name: "a.png".into(), camera, split: Split::Test, pixels: PixelSource::File(Box::new(file)) };
    for (seed, supplement) in [(5, 300), (6, 0)] {
        let mut scene = random_scene(seed, 800, supplement, 2);
        if supplement == 0 {
            scene.supplement = None;
        }
        let found = evaluate_parts(&gpu, &scene, &[&photo], RenderOptions::default(), BACKGROUND).unwrap().mean;
        let render = |scene: &Scene, active_degree| {
            let options = Options { active_degree, ..Default::default() };
            let view = reference::View::from_camera(&camera).rounded();
            let background = Background::Color(BACKGROUND.map(f64::from));
            let image =
                reference::render(&Params::from_scene(scene).unwrap(), &view, &options, background).blended.image;
            image.iter().flat_map(|p| [p[0], p[1], p[2]]).collect::<Vec<f64>>()
        };
        let whole = render(&scene, 2);
        let constant = render(&Scene { base: scene.base.clone(), ..Default::default() }, 0);
        let (mut errors, n) = ([0.0; 2], whole.len());
        for i in 0..n {
            let (all, least) = (linear(whole[i]), linear(whole[i].min(constant[i])));
            for (k, (part, truth)) in [(least, &diffuse), (all - least, &specular)].into_iter().enumerate() {
                errors[k] += (part.clamp(0.0, 1.0) - linear(f64::from(truth[i]) / 255.0)).powi(2) / n as f64;
            }
        }
        let [want_diffuse, want_specular] = errors.map(|error| -10.0 * error.log10());
        assert!(want_specular.is_finite() && (want_specular - want_diffuse).abs() > 0.1);
        // Pixels are off by 1e-5 on average; with errors of a tenth and more that is at most 1e-3 dB.
        let off = [found.diffuse - want_diffuse, found.specular - want_specular];
        assert!(off.iter().all(|off| off.abs() < 1e-3), "{found:?}, off by {off:?}");
    }
}
