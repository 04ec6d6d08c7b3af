//! Runs the programs of examples/.

use glint::{
    gpu::{Context, ContextOptions},
    pipelines::{
        layers::{Layer, Layers},
        render::RenderOptions,
    },
};

use super::*;

#[allow(dead_code, reason = "its main function is not called")]
#[path = "../../examples/frames.rs"]
mod frames;
#[allow(dead_code, reason = "its main function is not called")]
#[path = "../../examples/train.rs"]
mod train;

/// In one test, since devices of several threads confuse the validation layers.
#[test]
fn the_examples_train_a_scene_and_draw_it() {
    let work = Work::new();
    let [scene, image] = ["scene.ply", "image.ppm"].map(|name| work.path(name));
    let first = train::train(&work.path("data"), &scene, 1).unwrap();
    let last = train::train(&work.path("data"), &scene, 200).unwrap();
    assert!(last < 0.5 * first, "{first} {last}");
    let error = train::train(&work.path("nowhere"), &scene, 1).unwrap_err().to_string();
    assert!(error.contains("nowhere"), "{error}");

    // A larger picture of the test photo's view.
    let camera = Camera { width: 320, height: 240, fx: 400.0, fy: 400.0, cx: 160.0, cy: 120.0, ..camera(-0.4) };
    unsafe { frames::draw(&scene, &camera, &image) }.unwrap();
    let written = fs::read(&image).unwrap();
    let drawn = written.strip_prefix(b"P6 320 240 255\n").unwrap();
    let context = Context::new(&ContextOptions::from_env()).unwrap();
    let scene = read_scene(&scene).unwrap();
    let mut layers = Layers::new(&context, &scene, [&camera], RenderOptions::default()).unwrap();
    let whole = layers.render(Layer::Whole, &camera, [0.0; 3]).unwrap();
    assert_eq!(drawn.len(), whole.color.len());
    let off =
        drawn.iter().zip(&whole.color).map(|(&byte, want)| (f32::from(byte) - 255.0 * want.clamp(0.0, 1.0)).abs());
    // Half width and 8 bits.
    assert!(off.fold(0.0, f32::max) < 1.5 && drawn.iter().any(|&byte| byte > 100));
    assert!(unsafe { frames::draw(&work.path("nowhere"), &camera, &image) }.is_err());
}
