//! Which tiles suit a device, by time.

use std::time::Duration;

use super::{
    model::Model,
    raster::TileShape,
    render::{Needs, RenderOptions, Renderer},
    session::{Policy, Session},
    train::{BaseOptions, train_base},
    views::Views,
};
use crate::{
    error::{Error, Result},
    gpu::{Context, GpuError},
    reference::{covering_scene, random_camera},
    scene::{Camera, Scene},
};
use glam::DMat3;

/// Steps of one measurement: a submission, which is timed.
const STEPS: u32 = 16;
/// Each shape is timed so often, in turns.
const ROUNDS: usize = 3;
/// Another shape than the usual is chosen where it takes at most this part of its time in every round: what differs by less changes
/// from run to run.
const WORTH: f64 = 0.95;

/// What there is to train on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Load {
    /// Pixels of the views.
    pub width: u32,
    /// Pixels of the views.
    pub height: u32,
    /// Random ones, which cover the views as often whatever their number.
    pub gaussians: usize,
}

/// From a thumbnail to full HD, with as many Gaussians as photographs of the size are given.
pub const LOADS: [Load; 3] = [
    Load { width: 256, height: 256, gaussians: 20_000 },
    Load { width: 1024, height: 576, gaussians: 100_000 },
    Load { width: 1920, height: 1080, gaussians: 400_000 },
];

/// How long a training step takes by tiles of one shape.
#[derive(Debug, Clone)]
pub struct TileTimes {
    /// What a subgroup covers.
    pub tile: TileShape,
    /// Time of a step's stages on the device, one for each round.
    pub times: Vec<Duration>,
}

/// The time of a training step for each of the shapes that the device's subgroups can cover; the usual one comes first. `round` is
/// called after each measurement.
///
/// # Errors
/// [`Error::Usage`] for a load of no Gaussians; what the device lacks for the load; [`GpuError`] where it has no timestamps.
pub fn time_tiles(context: &Context, load: Load, mut measured: impl FnMut()) -> Result<Vec<TileTimes>> {
    let (model, views) = random_task(context, load, 1.0, 3)?;
    let lanes = context.info().subgroup_size;
    let usual = TileShape::for_subgroup(lanes);
    let others = TileShape::choices(lanes).into_iter().filter(|&tile| tile != usual);
    let mut found: Vec<_> =
        std::iter::once(usual).chain(others).map(|tile| TileTimes { tile, times: Vec::new() }).collect();
    for _ in 0..ROUNDS {
        for TileTimes { tile, times } in &mut found {
            let policy = Policy { tile: Some(*tile), ..Default::default() };
            let session = Session { policy, ..Session::new(context) };
            let options = BaseOptions { iterations: STEPS, ..Default::default() };
            let done = train_base(&session, &model, &views, &options, true, |_| ())?;
            let milliseconds: f64 = done.steps.milliseconds().iter().map(|(_, time)| time).sum();
            if milliseconds <= 0.0 {
                return Err({
                    let device = context.info().name.clone();
                    GpuError::Missing { device, feature: "timestamps".into() }.into()
                });
            }
            times.push(Duration::from_secs_f64(milliseconds / 1e3));
            measured();
        }
    }
    Ok(found)
}

/// How often [`time_tiles`] measures.
pub fn measurements(context: &Context) -> usize {
    ROUNDS * TileShape::choices(context.info().subgroup_size).len()
}

/// The shape to take: the fastest of those that are faster than the first, the usual one, in each round and by more than such times
/// vary; else that one. `None` of nothing.
pub fn best_tile(found: &[TileTimes]) -> Option<TileShape> {
    let usual = found.first()?;
    let total = |of: &TileTimes| of.times.iter().sum::<Duration>();
    let worth =
        |of: &&TileTimes| of.times.iter().zip(&usual.times).all(|(a, b)| a.as_secs_f64() <= WORTH * b.as_secs_f64());
    Some(found[1..].iter().filter(worth).min_by_key(|of| total(of)).unwrap_or(usual).tile)
}

/// Random Gaussians, and four views whose photographs show the same ones with colours that have changed places. They cover an image
/// `overlap` times as often as 2,000 of the usual size do.
///
/// # Errors
/// [`Error::Usage`] for a load of no Gaussians; what the device lacks for them.
pub fn random_task(context: &Context, load: Load, overlap: f64, sh_degree: u32) -> Result<(Model, Views)> {
    let Load { width, height, gaussians } = load;
    if gaussians == 0 {
        return Err(Error::Usage("a load of no Gaussians".into()));
    }
    let scene = covering_scene(gaussians, 0.0, overlap, sh_degree);
    let camera = random_camera(width, height);
    let cameras = [0.0, 0.05, 0.1, 0.15].map(|angle| {
        let turn = DMat3::from_rotation_y(angle);
        Camera { rotation: turn * camera.rotation, translation: turn * camera.translation, ..camera }
    });
    let photographs = {
        let mut other: Scene = scene.clone();
        other.base.sh.rotate_right(scene.base.sh_coefficients());
        let views = Views::upload(context, &cameras, &[])?;
        let model = Model::upload(context, &other, 0)?;
        let mut renderer = Renderer::new(context, Needs::of(&model), &views, RenderOptions::default())?;
        let byte = |value: f32| (255.0 * value.clamp(0.0, 1.0)).round() as u8;
        let mut photograph = |v| -> Result<Vec<u8>> {
            Ok(renderer.render(&model, &views, v, [0.0; 3])?.color.into_iter().map(byte).collect())
        };
        (0..cameras.len() as u32).map(&mut photograph).collect::<Result<Vec<_>>>()?
    };
    let views = Views::upload(context, &cameras, &photographs.iter().map(Vec::as_slice).collect::<Vec<_>>())?;
    Ok((Model::upload(context, &scene, 0)?, views))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(height: u32, times: [u64; 3]) -> TileTimes {
        let tile = TileShape::new(8, height, 8).unwrap_or_else(|| TileShape::for_subgroup(8));
        TileTimes { tile, times: times.map(Duration::from_millis).to_vec() }
    }

    #[test]
    fn another_shape_must_be_faster_each_time_and_by_enough() {
        let usual = || shape(8, [100, 110, 100]);
        let best = |others: &[TileTimes]| best_tile(&[&[usual()], others].concat()).map(|tile| tile.height);
        assert_eq!(best_tile(&[]), None);
        assert_eq!(best(&[]), Some(8));
        assert_eq!(best(&[shape(16, [90, 90, 90])]), Some(16));
        assert_eq!(best(&[shape(16, [90, 105, 90])]), Some(8), "one round is within noise");
        assert_eq!(best(&[shape(16, [90, 90, 90]), shape(24, [80, 80, 80])]), Some(24), "the fastest of them");
    }
}
