//! Classes of color in training (method, section 8): Gaussians have a constant color at first. Early in the run those get bands of
//! harmonics that gain more by them than further Gaussians of the same bytes would gain. Density control continues in both classes.
//!
//! Checkpoint → search for bands → checkpoint of two segments, which the caller resumes with a model and a loop for both.

use glam::DVec3;

use super::{
    bands::Bands,
    checkpoint::Checkpoint,
    density::DensityOptions,
    learn::sh_moments,
    model::{Model, Room},
    session::Session,
    train::Trainer,
    views::Views,
};
use crate::{
    data::{
        band_bytes,
        checkpoint::{BANDED, BASE, SH},
        gaussian_bytes, scene_bytes,
    },
    error::{Error, Result},
    scene::{Gaussians, Scene, layout},
};

/// Fraction of the run after which Gaussians get bands. The scene then has a third of the Gaussians that it gains. 0.3 is better on one scene
/// and worse on three (docs/experiments/2026-11-29-classes.md).
pub const DIVIDED_AT: f64 = 0.12;
/// Relative fall of the predicted squared error that justifies a relative increase of bytes. True gains of bands are several times the
/// predicted ones (docs/experiments/2026-11-29-predictions.md); docs/experiments/2026-11-29-classes.md has other values.
pub const WORTH: f64 = 0.05;
/// Part of the squared error that bands must prevent to be kept by [`demote`], relative to their part of the bytes
/// (docs/experiments/2026-11-30-demotion.md).
pub const WORTH_KEEPING: f64 = 8.0;
/// Part of the bytes that a base takes at most when bands are removed; the rest is for added Gaussians.
pub const BASE_PART: f64 = 0.85;
/// Before the division Gaussians grow as if this share of them were to get bands of the highest degree, so that any division fits.
pub const ASSUMED: f64 = 0.3;
/// Name in a checkpoint.
const CLASSES: &str = "classes";

/// Numbers of Gaussians without bands and with, when a scene was divided.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Classes {
    /// Degree of the bands; 0 if no Gaussian has any.
    pub degree: u32,
    /// Gaussians with a constant color.
    pub constants: u32,
    /// Gaussians with bands.
    pub banded: u32,
}

impl Classes {
    /// Maximum number of Gaussians before the division, if the scene has `bytes` in the end.
    pub fn at_first(bytes: u64) -> u32 {
        fitting(bytes, ASSUMED, 3)
    }

    /// Number of points to start from: half of the Gaussians that the scene would have if all got bands of the highest degree.
    pub fn points(bytes: u64) -> u32 {
        (fitting(bytes, 1.0, 3) / 2).max(1)
    }

    /// Maximum number of Gaussians of both classes in `bytes`, if their shares stay as they are.
    fn limits(&self, bytes: u64) -> [u32; 2] {
        let share = f64::from(self.banded) / f64::from((self.constants + self.banded).max(1));
        let all = fitting(bytes, share, self.degree);
        let banded = (share * f64::from(all)) as u32;
        [all - banded, banded].map(|limit| limit.max(1))
    }

    /// Density control of the classes from the division on. `before` controlled the whole scene.
    pub fn controls(&self, before: &DensityOptions, bytes: u64) -> Vec<DensityOptions> {
        let of = |(limit, count): (u32, u32)| before.toward(limit.max(count), count, DIVIDED_AT);
        let classes = self.limits(bytes).into_iter().zip([self.constants, self.banded]);
        classes.take(if self.banded > 0 { 2 } else { 1 }).map(of).collect()
    }

    /// An empty scene around `origin` for a model of both classes, and the room that it needs. [`Trainer::resume`] fills it.
    pub fn room(&self, origin: DVec3, controls: &[DensityOptions], host: bool) -> (Scene, Room) {
        let base = Gaussians { sh_degree: self.degree, ..Gaussians::default() };
        let [base_room, banded] = [0, 1].map(|class| controls.get(class).map_or(0, |control| control.limit));
        let scene = Scene { base, mixed: self.banded > 0, origin, ..Scene::default() };
        (scene, Room { base: base_room, banded, host, ..Room::default() })
    }

    /// Stores them in a checkpoint.
    pub fn keep(&self, checkpoint: &mut Checkpoint) {
        checkpoint.put_words(CLASSES.into(), vec![self.degree, self.constants, self.banded]);
    }

    /// Those of a checkpoint; `None` if its scene was not divided.
    pub fn of(checkpoint: &Checkpoint) -> Option<Self> {
        let &[degree, constants, banded] = checkpoint.words(CLASSES)? else { return None };
        Some(Classes { degree, constants, banded })
    }
}

/// Number of Gaussians in `bytes`, of which a `share` has bands of `degree`.
fn fitting(bytes: u64, share: f64, degree: u32) -> u32 {
    let each = gaussian_bytes(0, false) as f64 + share * band_bytes(degree) as f64;
    (bytes as f64 / each) as u32
}

/// Divides the Gaussians of a loop on `model`, which have constant colors: measures what bands would gain in the photographs with their
/// sides halved `halvings` times. Returns the classes and a checkpoint of them. Waits; the loop and the model do not change.
///
/// # Errors
/// [`Error::Usage`] if the loop is not a base's with Newton's steps; otherwise an error of the device.
pub fn divide(
    session: &Session,
    model: &Model,
    trainer: &mut Trainer,
    views: &Views,
    halvings: u32,
) -> Result<(Classes, Checkpoint)> {
    let checkpoint = trainer.checkpoint(model, views)?;
    let scene = model.download()?;
    let count = scene.base.len();
    let mut bands = Bands::new(session, &scene, views, halvings)?;
    bands.measure_errors(session, views)?;
    while bands.advance(views)?.is_some() {}
    let bytes = count as u64 * gaussian_bytes(0, false);
    let promotion = bands.choose(u64::MAX, WORTH * bands.squared_error(views) / bytes as f64);
    let banded = promotion.gains.len();
    let (degree, constants) = (if banded > 0 { promotion.degree } else { 0 }, count - banded);
    let classes = Classes { degree, constants: constants as u32, banded: banded as u32 };
    let colors = bands.promoted(&scene.base, &promotion);
    let mut divided = divided(&checkpoint, &promotion.order(count), constants, &colors, session.policy.packed)?;
    classes.keep(&mut divided);
    Ok((classes, divided))
}

/// `scene` without the bands that prevent little of the squared error, for a scene of at most `bytes` in which other Gaussians take their
/// place. Nothing else changes. `progress` is called with the done and all steps of a search in the photographs of `views`. Waits.
///
/// # Errors
/// [`Error::Usage`] if not even constant colors fit the bytes, or if the colors are not harmonics; otherwise an error of the device.
pub fn demote(
    session: &Session,
    scene: &Scene,
    views: &Views,
    bytes: u64,
    mut progress: impl FnMut([u32; 2]),
) -> Result<Scene> {
    let (count, degree) = (scene.base.len(), scene.base.sh_degree);
    let constant = count as u64 * gaussian_bytes(0, false);
    if constant > bytes {
        let what = format!("{count} Gaussians take {constant} bytes without bands, expected at most {bytes}");
        return Err(Error::Usage(what));
    }
    if degree == 0 {
        return Ok(scene.clone());
    }
    let mut bands = Bands::new(session, scene, views, 0)?;
    bands.measure_errors(session, views)?;
    while let Some(done) = bands.advance(views)? {
        progress(done);
    }
    let least = WORTH_KEEPING * bands.squared_error(views) / scene_bytes(scene) as f64;
    let mut kept = bands.choose_of(degree, u64::MAX, least);
    let first = if scene.mixed { scene.base.constants() } else { 0 };
    kept.gains.retain(|found| found.number as usize >= first);
    let room = ((BASE_PART * bytes as f64) as u64).saturating_sub(constant);
    kept.gains.truncate((room / band_bytes(degree)) as usize);
    let mut base = scene.base.reordered(&kept.order(count));
    let constants = count - kept.gains.len();
    base.sh.chunks_mut(layout::coefficients(degree)).take(constants).for_each(|sh| sh[1..].fill([0.0; 3]));
    Ok(Scene { base, mixed: true, ..scene.clone() })
}

/// A checkpoint in which the Gaussians of the base come in `order`, those from `constants` on as a segment with bands. `colors` are all
/// colors in this order. New coefficients have no moments yet.
fn divided(
    checkpoint: &Checkpoint,
    order: &[usize],
    constants: usize,
    colors: &Gaussians,
    packed: bool,
) -> Result<Checkpoint> {
    let (prefix, moments_name) = (format!("{BASE}."), format!("{BASE}.{SH}_moments"));
    if checkpoint.rows(&moments_name)? != sh_moments(0, packed, true) {
        return Err(Error::Usage("Gaussians are divided in a loop of Newton's steps on constant colors".into()));
    }
    let mut to = checkpoint.clone();
    let (first, last) = order.split_at(constants);
    if last.is_empty() {
        return Ok(to);
    }
    for name in checkpoint.names().filter(|name| name.starts_with(&prefix)) {
        let what = &name[prefix.len()..];
        let planes = checkpoint.rows(name)?;
        let values = checkpoint.floats(name, planes * order.len())?;
        let of = |plane: usize, i: usize| values[plane * order.len() + i];
        let columns = |numbers: &[usize]| -> Vec<f32> {
            (0..planes).flat_map(|plane| numbers.iter().map(move |&i| (plane, i))).map(|(p, i)| of(p, i)).collect()
        };
        let mut banded = columns(last);
        let mut planes_of_banded = planes;
        if what == SH {
            planes_of_banded = layout::sh_planes(colors.sh_degree);
            let of = |p: usize| (constants..order.len()).map(move |i| layout::sh(colors, i, p));
            banded = (0..planes_of_banded).flat_map(of).collect();
        } else if *name == moments_name {
            planes_of_banded = sh_moments(colors.sh_degree, packed, true);
            banded.resize(planes_of_banded * last.len(), 0.0);
        }
        to.put(format!("{BANDED}.{what}"), [planes_of_banded, last.len()], banded);
        to.put(name.to_owned(), [planes, first.len()], columns(first));
    }
    Ok(to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{data::checkpoint::GEOMETRY, pipelines::density::Strategy};

    #[test]
    fn every_division_fits_the_bytes_and_leaves_no_gaussian_out() {
        let bytes = 1_984_000;
        // 68 bytes each, or 248 with bands of degree 3; 122 where three of ten have them.
        assert_eq!([Classes::at_first(bytes), Classes::points(bytes)], [16_262, 4000]);
        let first = Classes::points(bytes);
        let before =
            DensityOptions { strategy: Strategy::Budget, limit: Classes::at_first(bytes), first, iterations: 1000 };
        let step = (DIVIDED_AT * 1000.0) as u32;
        let count = before.budget(step - 1);
        for (degree, banded) in [(0, 0), (1, 1), (2, count / 2), (3, count / 10), (3, count)] {
            let classes = Classes { degree, constants: count - banded, banded };
            let controls = classes.controls(&before, bytes);
            assert_eq!(controls.len(), if banded > 0 { 2 } else { 1 });
            let counts = [classes.constants, classes.banded];
            let all: Vec<[u32; 2]> = controls.iter().map(|c| [c.budget(step - 1), c.limit]).collect();
            for ([now, limit], count) in all.iter().zip(counts) {
                assert!(now >= &count && limit >= &count, "{classes:?}: {all:?}");
            }
            let limits = [all[0][1], all.get(1).map_or(0, |class| class[1])].map(u64::from);
            let size = (limits[0] + limits[1]) * gaussian_bytes(0, false) + limits[1] * band_bytes(degree);
            // Rounding leaves out less than one Gaussian of each class. A class without Gaussians has room for one that never comes.
            assert!(size <= bytes + 248 && size > bytes - 2 * 248, "{classes:?}: {size}");
        }
    }

    #[test]
    fn a_divided_checkpoint_has_each_gaussian_once_with_all_that_it_had() {
        for packed in [false, true] {
            let (moments, more) = (sh_moments(0, packed, true), sh_moments(1, packed, true));
            let mut whole = Checkpoint::new(7);
            // Plane p of Gaussian i is 10 p + i.
            let plane = |p: usize| (0..3).map(move |i| (10 * p + i) as f32);
            let mut put = |name: &str, planes: usize| {
                whole.put(format!("{BASE}.{name}"), [planes, 3], (0..planes).flat_map(plane).collect());
            };
            put(GEOMETRY, 2);
            put(SH, 3);
            put("sh_moments", moments);
            whole.put("losses".into(), [1, 7], vec![0.5; 7]);
            let order = [0, 2, 1];
            // The last one's coefficients, constant and bands.
            let sh = (0..12).map(|k| [k as f32, 0.25, -1.0]).collect();
            let colors = Gaussians { sh_degree: 1, means: vec![[0.0; 3]; 3], sh, ..Gaussians::default() };
            let found = divided(&whole, &order, 2, &colors, packed).unwrap();
            assert_eq!(found.floats("base.geometry", 4).unwrap(), [0.0, 2.0, 10.0, 12.0]);
            assert_eq!(found.floats("banded.geometry", 2).unwrap(), [1.0, 11.0]);
            assert_eq!(found.floats("base.sh", 6).unwrap(), [0.0, 2.0, 10.0, 12.0, 20.0, 22.0]);
            assert_eq!(found.floats("banded.sh", 12).unwrap()[..6], [8.0, 0.25, -1.0, 9.0, 0.25, -1.0]);
            let known: Vec<f32> = (0..moments).map(|p| (10 * p + 1) as f32).collect();
            let banded = found.floats("banded.sh_moments", more).unwrap();
            assert!(banded[..moments] == known && banded[moments..].iter().all(|&word| word == 0.0));
            assert_eq!((found.step, found.floats("losses", 7).unwrap()), (7, &[0.5; 7][..]));
            // Nobody gains: nothing changes.
            assert_eq!(divided(&whole, &[0, 1, 2], 3, &colors, packed).unwrap(), whole);
            // Another precision's moments.
            assert!(divided(&whole, &order, 2, &colors, !packed).is_err());
        }
    }
}
