//! Trains a scene on a dataset and writes it as a PLY file:
//!
//!     cargo run --release --example train -- DATASET SCENE.ply

use std::{env, path::Path};

use glint::{
    Error, Result,
    data::{Dataset, DatasetOptions, Split, write_scene},
    gpu::{Context, ContextOptions},
    pipelines::{
        density::{DensityOptions, Strategy},
        model::{Model, Room},
        session::Session,
        start::{default_gaussians, first_points, photos_of, upload_photos},
        train::{BaseOptions, dense_trainer},
        views::scene_origin_for,
    },
    scene::{Camera, Scene, from_points},
};

fn main() -> Result<()> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [dataset, output] = &arguments[..] else { return Err(Error::Usage("expected DATASET SCENE.ply".into())) };
    let loss = train(dataset.as_ref(), output.as_ref(), 7000)?;
    println!("{output}: the last step had a loss of {loss:.4}");
    Ok(())
}

/// Returns the loss of the last step. An error names the file or the option, and the expected value; an error of the device leaves no
/// output.
pub fn train(dataset: &Path, output: &Path, iterations: u32) -> Result<f32> {
    // The first discrete GPU, else any device.
    let context = Context::new(&ContextOptions::default())?;
    let dataset = Dataset::open(dataset, &DatasetOptions::default())?;
    let photos = photos_of(&dataset, Some(Split::Train))?;
    let views = upload_photos(&context, &photos, dataset.background, 0, |_, _| ())?;

    // Gaussians at the sparse points, or at random ones if the dataset has none. Positions are float32 around an origin; it is 0
    // unless the cameras are far from there.
    let cameras: Vec<Camera> = photos.iter().map(|photo| photo.camera).collect();
    let origin = scene_origin_for(&cameras);
    let points = first_points(&dataset, None, 0).cloud;
    let options = BaseOptions { iterations, ..BaseOptions::default() };
    let base = from_points(&points.around(origin), &points.colors, options.sh_degree);
    let first = base.len() as u32;
    let pixels = cameras.iter().map(|camera| u64::from(camera.pixels())).sum();
    let limit = default_gaussians(base.len(), pixels) as u32;

    // All memory is allocated here: if it does not suffice, the error says so before the first step.
    let scene = Scene { base, origin, ..Scene::default() };
    let room = Room { base: limit - first, ..Room::default() };
    let model = Model::upload_around(&context, views.origin, &scene, room)?;
    let extent = dataset.extent() as f32;
    let session = Session { background: dataset.background, extent, ..Session::new(&context) };
    let density = DensityOptions { strategy: Strategy::Budget, limit, first, iterations };
    let mut trainer = dense_trainer(&session, &model, &views, &options, &density)?;
    let report = trainer.run(&model, &views, false, |done| {
        if done.is_multiple_of(1000) {
            println!("{done} of {iterations} steps");
        }
    })?;
    write_scene(output, &model.download()?)?;
    Ok(report.losses.last().copied().unwrap_or(f32::NAN))
}
