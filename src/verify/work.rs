//! Verifies the first training steps on a user's dataset.

use std::time::Instant;

use super::{Bench, Report, rates};
use crate::{
    data::Photo,
    error::Result,
    pipelines::{
        density::{DensityOptions, Strategy},
        model::{Model, Room},
        session::Session,
        start::upload_photos,
        train::{BaseOptions, LEARNED, dense_trainer},
    },
    scene::Scene,
};

/// Number of steps: density control refines once in them.
pub const STEPS: u32 = 30;

/// Trains `scene` on `photos` for [`STEPS`] steps, and compares each dispatch with its twin.
///
/// # Errors
/// Unreadable photos, and failures of the device; a wrong result is a [`Breach`](super::Breach) of a row.
pub fn work(
    session: &Session,
    photos: &[&Photo],
    scene: &Scene,
    perturb: f64,
    mut progress: impl FnMut(u32),
) -> Result<Report> {
    let (start, context) = (Instant::now(), session.context.clone());
    let mut bench = Bench::new(&context, perturb, 1)?;
    rates::measure(&mut bench)?;
    let session = Session { context: bench.shadowed.clone(), ..session.clone() };
    let views = upload_photos(&session.context, photos, session.background, 0, |_, _| ())?;
    let first = scene.base.len() as u32;
    let limit = first + first / 8 + 8;
    let room = Room { base: limit - first, ..Default::default() };
    let model = Model::upload_around(&session.context, views.origin, scene, room)?;
    let options = BaseOptions { iterations: STEPS, sh_degree: scene.base.sh_degree, begins: LEARNED };
    let density = DensityOptions { strategy: Strategy::Budget, limit, first, iterations: STEPS };
    dense_trainer(&session, &model, &views, &options, &density)?.run(&model, &views, false, &mut progress)?;
    let (device, rates, rows) = (context.info().clone(), bench.rates, bench.into_rows());
    Ok(Report { device, rates, rows, seconds: start.elapsed().as_secs_f64() })
}
