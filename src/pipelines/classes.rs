//! Classes of color in training (method, section 8): all Gaussians learn bands of harmonics. Early in the run the share that needs them gives
//! the number of Gaussians. If they show next to nothing, all go at once. Otherwise the others lose theirs late in the run, so that the scene
//! fits its bytes.
//!
//! Checkpoint → search for bands → checkpoint, which the caller resumes with a model of another size, or of two segments.

use glam::DVec3;

use super::{
    bands::{Bands, Promotion, squared_error},
    checkpoint::Checkpoint,
    density::{BUDGET_SPAN, DensityOptions},
    learn::sh_moments,
    model::{Model, Room},
    render::{Needs, RenderOptions, Renderer},
    session::Session,
    train::{BaseOptions, Trainer, dense_trainer},
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

/// Fraction of the run after which the share of Gaussians that need bands is measured.
pub const MEASURED_AT: f64 = 0.2;
/// Length of the trial without bands then, as a fraction of the run.
pub const TRIED: f64 = 0.05;
/// Fraction of the run after which bands that show little go. Density control ends there.
pub const DEMOTED_AT: f64 = BUDGET_SPAN[2];
/// Part of the squared error that bands must prevent after the trial, relative to their part of the bytes. They prevent less than in the end
/// (docs/experiments/2026-11-30-number.md).
pub const WORTH: f64 = 0.5;
/// Part of the squared error that bands must prevent in the end, relative to their part of the bytes
/// (docs/experiments/2026-11-30-demotion.md).
pub const WORTH_KEEPING: f64 = 8.0;
/// Least true worth of all bands that the trial can tell from none, relative to the squared error: two trials of one scene differ by so much
/// (docs/experiments/2026-11-30-number.md).
pub const TOLD: f64 = 0.03;
/// Predicted over true worth of all bands from which on they go after the trial: 50 in a diffuse scene, at most 21 in seven others
/// (docs/experiments/2026-11-30-number.md).
pub const EMPTY: f64 = 32.0;
/// True worth up to which they go, relative to the squared error, some 1 dB: long runs of fox have more than 0.5, whatever the search
/// predicts, and of a diffuse scene 0.12 (docs/experiments/2026-11-30-number.md).
pub const SHOWN: f64 = 0.25;
/// Part of the bytes that a base takes at most when bands are removed; the rest is for added Gaussians.
pub const BASE_PART: f64 = 0.93;
/// Before the measurement the scene grows as if this share of its Gaussians were to keep their bands.
pub const ASSUMED: f64 = 0.3;
/// Name in a checkpoint.
const CLASSES: &str = "classes";
/// Degree of the harmonics in training.
pub const DEGREE: u32 = 3;

/// Classes of a scene in training: the number of Gaussians, and how many of them have bands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Classes {
    /// Gaussians when their share with bands was measured, or when bands went late in the run.
    pub count: u32,
    /// Maximum number of Gaussians.
    pub limit: u32,
    /// Gaussians with bands, after bands went.
    pub banded: Option<u32>,
}

impl Classes {
    /// Maximum number of Gaussians before the measurement, if the scene has `bytes` in the end.
    pub fn at_first(bytes: u64) -> u32 {
        fitting(bytes, ASSUMED)
    }

    /// Number of points to start from; density control places the other half where errors are large.
    pub fn points(bytes: u64) -> u32 {
        (Self::at_first(bytes) / 2).max(1)
    }

    /// Density control from the measurement on. `before` controlled the scene until then.
    pub fn control(&self, before: &DensityOptions) -> DensityOptions {
        before.toward(self.limit, self.count, MEASURED_AT)
    }

    /// An empty scene around `origin` for a model of these classes, and the room that it needs. [`Trainer::resume`] fills it.
    pub fn room(&self, origin: DVec3, host: bool) -> (Scene, Room) {
        let base = Gaussians { sh_degree: self.degree(), ..Gaussians::default() };
        let banded = self.banded.unwrap_or(0);
        let scene = Scene { base, mixed: banded > 0, origin, ..Scene::default() };
        (scene, Room { base: (self.limit - banded).max(1), banded, host, ..Room::default() })
    }

    /// Whether [`measure`] found that no color gains by depending on the view, and the scene had room to grow without bands. If all bands
    /// went late, each showed too little for its bytes, and lobes may still gain.
    pub fn are_matte(&self) -> bool {
        self.banded == Some(0) && self.limit > self.count
    }

    /// Degree of the harmonics of the Gaussians that have some.
    pub fn degree(&self) -> u32 {
        if self.banded == Some(0) { 0 } else { DEGREE }
    }

    /// Stores them in a checkpoint.
    pub fn keep(&self, checkpoint: &mut Checkpoint) {
        let words = [self.count, self.limit].into_iter().chain(self.banded);
        checkpoint.put_words(CLASSES.into(), words.collect());
    }

    /// Those of a checkpoint; `None` if its scene was not measured.
    pub fn of(checkpoint: &Checkpoint) -> Option<Self> {
        let (&[count, limit], banded) = checkpoint.words(CLASSES)?.split_first_chunk()?;
        let banded = banded.first().copied();
        Some(Classes { count, limit, banded }).filter(|_| banded <= Some(limit))
    }
}

/// Bytes of a Gaussian with bands.
pub fn most_bytes() -> u64 {
    gaussian_bytes(0, false) + band_bytes(DEGREE)
}

/// Number of Gaussians in `bytes`, of which a `share` has bands.
fn fitting(bytes: u64, share: f64) -> u32 {
    let each = gaussian_bytes(0, false) as f64 + share * band_bytes(DEGREE) as f64;
    (bytes as f64 / each) as u32
}

/// Settings of the trial in [`measure`].
#[derive(Clone, Copy)]
pub struct Trial<'a> {
    /// Options of the run.
    pub options: &'a BaseOptions,
    /// Density control of the run.
    pub density: &'a DensityOptions,
    /// Colors and moments lie in the host's memory.
    pub host: bool,
    /// Asked after every submission.
    pub goes_on: &'a dyn Fn() -> bool,
}

/// Finds the number of Gaussians for a scene of `bytes`, at most `most`: measures which share of those of a loop on `model` needs bands, in
/// the photographs with their sides halved `halvings` times. Returns it and a checkpoint, or `None` if [`Trial::goes_on`] ends it. Waits; the
/// loop and the model do not change.
///
/// The search counts as the worth of bands also what other Gaussians would take over. So two copies of the scene learn on, one of them without
/// bands. If the other copy is hardly better, although the search promises much, the checkpoint has no bands.
///
/// # Errors
/// Those of [`Bands::new`] and [`dense_trainer`].
pub fn measure(
    session: &Session,
    model: &Model,
    trainer: &mut Trainer,
    (views, halvings): (&Views, u32),
    bytes: u64,
    most: u32,
    trial: &Trial,
) -> Result<Option<(Classes, Checkpoint)>> {
    let checkpoint = trainer.checkpoint(model, views)?;
    let count = model.counts()?[0];
    let order: Vec<usize> = (0..count as usize).collect();
    let constant = divided(&checkpoint, &order, count as usize, session.policy.packed)?;
    let learned = |from: &Checkpoint, banded: Option<u32>| -> Result<Option<Model>> {
        let classes = Classes { count, limit: count, banded };
        let (empty, room) = classes.room(model.scene_origin, trial.host);
        let copy = Model::upload_around(&session.context, views.origin, &empty, room)?;
        let options = BaseOptions { sh_degree: classes.degree(), ..*trial.options };
        let mut learning = dense_trainer(session, &copy, views, &options, &classes.control(trial.density))?;
        learning.resume(&copy, from, false)?;
        let steps = (TRIED * f64::from(options.iterations)).ceil() as u32;
        learning.go_on_to((checkpoint.step + steps).min(options.iterations));
        while learning.advance(&copy, views)?.is_some() {
            if !(trial.goes_on)() {
                return Ok(None);
            }
        }
        Ok(Some(copy))
    };
    let without = match learned(&constant, Some(0))? {
        None => return Ok(None),
        Some(copy) => {
            let render = RenderOptions { policy: session.policy, ..Default::default() };
            let mut renderer = Renderer::new(&session.context, Needs::of(&copy), views, render)?;
            squared_error(session, &mut renderer, &copy, views, halvings)?
        }
    };
    // The copy's memory is free before the search.
    let Some(scene) = learned(&checkpoint, None)?.map(|copy| copy.download()).transpose()? else { return Ok(None) };
    let mut with = searched(session, &scene, views, halvings, |_| ())?;
    let error = with.squared_error(session, views)?;
    let promised = with.choose_of(DEGREE, u64::MAX, 0.0).gain();
    let least = WORTH * error / scene_bytes(&scene) as f64;
    let share = with.choose_of(DEGREE, u64::MAX, least).gains.len() as f64 / f64::from(count);
    let [of_promise, of_trial] = [promised, without - error].map(|worth| worth / error);
    tracing::debug!("bands are worth {of_promise:.2} of the error by the search, {of_trial:.3} by the trial");
    let none = share == 0.0 || are_empty(of_promise, of_trial);
    let (share, banded, from) = if none { (0.0, Some(0), constant) } else { (share, None, checkpoint) };
    let limit = fitting(bytes, share).min(most).max(count);
    Ok(Some((Classes { count, limit, banded }, from)))
}

/// Whether bands show nothing: the search promises much, and the trial finds little. Both are relative to the squared error.
fn are_empty(promised: f64, found: f64) -> bool {
    found <= SHOWN && promised >= EMPTY * found.max(TOLD)
}

/// Takes the bands that prevent little of the squared error from the Gaussians of a loop on `model`, for a scene of at most `bytes`. Returns
/// the classes and a checkpoint of them. Waits; the loop and the model do not change.
///
/// # Errors
/// [`Error::Usage`] if the loop is not a base's with Newton's steps; otherwise an error of the device.
pub fn divide(
    session: &Session,
    model: &Model,
    trainer: &mut Trainer,
    views: &Views,
    bytes: u64,
) -> Result<(Classes, Checkpoint)> {
    let checkpoint = trainer.checkpoint(model, views)?;
    let scene = model.download()?;
    let count = scene.base.len();
    let mut kept = kept(session, &scene, views, |_| ())?;
    kept.limit(bytes.saturating_sub(count as u64 * gaussian_bytes(0, false)));
    let banded = kept.gains.len();
    let classes = Classes { count: count as u32, limit: count as u32, banded: Some(banded as u32) };
    Ok((classes, divided(&checkpoint, &kept.order(count), count - banded, session.policy.packed)?))
}

/// `scene` without the bands that prevent little of the squared error, for a scene of at most `bytes` in which other Gaussians take their
/// place. Nothing else changes. `None` if it stays as it is: without bands, or mixed and small enough. `progress` is called with the done and
/// all steps of a search in the photographs of `views`. Waits.
///
/// # Errors
/// [`Error::Usage`] if not even constant colors fit the bytes, or if the colors are not harmonics; otherwise an error of the device.
pub fn demote(
    session: &Session,
    scene: &Scene,
    views: &Views,
    bytes: u64,
    progress: impl FnMut([u32; 2]),
) -> Result<Option<Scene>> {
    let (count, degree) = (scene.base.len(), scene.base.sh_degree);
    let constant = count as u64 * gaussian_bytes(0, false);
    if constant > bytes {
        let what = format!("{count} Gaussians take {constant} bytes without bands, expected at most {bytes}");
        return Err(Error::Usage(what));
    }
    let most = (BASE_PART * bytes as f64) as u64;
    if degree == 0 || (scene.mixed && scene_bytes(scene) <= most) {
        return Ok(None);
    }
    let mut kept = kept(session, scene, views, progress)?;
    let first = if scene.mixed { scene.base.constants() } else { 0 };
    kept.gains.retain(|found| found.number as usize >= first);
    kept.limit(most.saturating_sub(constant));
    let mut base = scene.base.reordered(&kept.order(count));
    let constants = count - kept.gains.len();
    base.sh.chunks_mut(layout::coefficients(degree)).take(constants).for_each(|sh| sh[1..].fill([0.0; 3]));
    Ok(Some(Scene { base, mixed: true, ..scene.clone() }))
}

/// A whole search for bands, in the photographs with their sides halved `halvings` times.
fn searched(
    session: &Session,
    scene: &Scene,
    views: &Views,
    halvings: u32,
    mut progress: impl FnMut([u32; 2]),
) -> Result<Bands> {
    let mut bands = Bands::new(session, scene, views, halvings)?;
    while let Some(done) = bands.advance(views)? {
        progress(done);
    }
    Ok(bands)
}

/// Gaussians of `scene` whose bands prevent at least [`WORTH_KEEPING`] times as large a part of the squared error as their part of the bytes.
fn kept(session: &Session, scene: &Scene, views: &Views, progress: impl FnMut([u32; 2])) -> Result<Promotion> {
    let mut bands = searched(session, scene, views, 0, progress)?;
    let least = WORTH_KEEPING * bands.squared_error(session, views)? / scene_bytes(scene) as f64;
    Ok(bands.choose_of(scene.base.sh_degree, u64::MAX, least))
}

/// A checkpoint in which the Gaussians of the base come in `order`, those from `constants` on as a segment with bands. The others keep their
/// constant and what it learned.
fn divided(checkpoint: &Checkpoint, order: &[usize], constants: usize, packed: bool) -> Result<Checkpoint> {
    let (prefix, moments_name) = (format!("{BASE}."), format!("{BASE}.{SH}_moments"));
    if checkpoint.rows(&moments_name)? != sh_moments(DEGREE, packed, true) {
        return Err(Error::Usage("Gaussians are divided in a loop of Newton's steps on harmonics of degree 3".into()));
    }
    let mut to = checkpoint.clone();
    let (first, last) = order.split_at(constants);
    for name in checkpoint.names().filter(|name| name.starts_with(&prefix)) {
        let what = &name[prefix.len()..];
        let planes = checkpoint.rows(name)?;
        let values = checkpoint.floats(name, planes * order.len())?;
        let columns = |planes: usize, numbers: &[usize]| -> Vec<f32> {
            let of = |plane: usize| numbers.iter().map(move |&i| values[plane * order.len() + i]);
            (0..planes).flat_map(of).collect()
        };
        if !last.is_empty() {
            to.put(format!("{BANDED}.{what}"), [planes, last.len()], columns(planes, last));
        }
        let planes = match name {
            name if *name == moments_name => sh_moments(0, packed, true),
            _ if what == SH => layout::sh_planes(0),
            _ => planes,
        };
        to.put(name.to_owned(), [planes, first.len()], columns(planes, first));
    }
    Ok(to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{data::checkpoint::GEOMETRY, pipelines::density::Strategy};

    #[test]
    fn the_number_of_gaussians_follows_from_the_share_with_bands() {
        let bytes = 1_984_000;
        // 56 bytes each, or 236 with bands of degree 3; 110 where three of ten have them.
        assert_eq!([fitting(bytes, 0.0), fitting(bytes, 1.0)], [35_428, 8406]);
        assert_eq!([Classes::at_first(bytes), Classes::points(bytes)], [18_036, 9018]);
        let first = Classes::points(bytes);
        let before =
            DensityOptions { strategy: Strategy::Budget, limit: Classes::at_first(bytes), first, iterations: 1000 };
        let step = (MEASURED_AT * 1000.0) as u32;
        let count = before.budget(step - 1);
        for limit in [count, 18_036, 35_428] {
            let classes = Classes { count, limit, banded: None };
            let control = classes.control(&before);
            // Start and budget are rounded. If many more come, the first of them come at once.
            let now = control.budget(step - 1);
            assert!(now + 1 >= count && (now <= count + 1 || control.first == 0), "{control:?}: {now} and {count}");
            assert_eq!(control.budget(999), limit);
            assert_eq!(classes.room(DVec3::ZERO, false).1.base, limit);
            // Once bands went, nothing grows.
            let divided = Classes { count: limit, banded: Some(7), ..classes };
            assert_eq!(divided.control(&before).budget(999), limit);
            let (scene, room) = divided.room(DVec3::ZERO, false);
            assert_eq!((scene.mixed, scene.base.sh_degree, room.base, room.banded), (true, 3, limit - 7, 7));
        }
        // Without any bands more may come.
        let none = Classes { count, limit: 35_428, banded: Some(0) };
        let (scene, room) = none.room(DVec3::ZERO, false);
        assert_eq!((scene.mixed, scene.base.sh_degree, room.base, room.banded), (false, 0, 35_428, 0));
        assert_eq!(none.control(&before).budget(999), 35_428);
        // Bands that went late are no sign of a matte scene.
        assert!(none.are_matte() && !Classes { count: none.limit, ..none }.are_matte());
    }

    #[test]
    fn bands_are_empty_if_they_promise_much_and_nothing_is_lost_without() {
        // Runs of a diffuse scene, and of scenes that need bands (docs/experiments/2026-11-30-number.md).
        for [promised, found] in [[1.49, 0.023], [1.50, -0.023], [4.06, 0.108], [5.20, 0.121]] {
            assert!(are_empty(promised, found), "{promised} {found}");
        }
        let needed = [[0.32, 0.020], [0.34, -0.01], [2.13, 0.21], [0.99, 0.15], [0.77, 0.24], [10.24, 0.532]];
        for [promised, found] in needed {
            assert!(!are_empty(promised, found), "{promised} {found}");
        }
    }

    #[test]
    fn what_is_known_of_classes_comes_back_from_a_checkpoint() {
        let mut checkpoint = Checkpoint::new(7);
        assert_eq!(Classes::of(&checkpoint), None);
        for banded in [None, Some(0), Some(4)] {
            let classes = Classes { count: 2, limit: 9, banded };
            classes.keep(&mut checkpoint);
            assert_eq!(Classes::of(&checkpoint), Some(classes));
        }
    }

    #[test]
    fn a_divided_checkpoint_has_each_gaussian_once_without_bands_or_with_all_that_it_had() {
        for packed in [false, true] {
            let (moments, fewer) = (sh_moments(3, packed, true), sh_moments(0, packed, true));
            let mut whole = Checkpoint::new(7);
            // Plane p of Gaussian i is 10 p + i.
            let plane = |p: usize| (0..3).map(move |i| (10 * p + i) as f32);
            let mut put = |name: &str, planes: usize| {
                whole.put(format!("{BASE}.{name}"), [planes, 3], (0..planes).flat_map(plane).collect());
            };
            put(GEOMETRY, 2);
            put(SH, 48);
            put("sh_moments", moments);
            whole.put("losses".into(), [1, 7], vec![0.5; 7]);
            let found = divided(&whole, &[0, 2, 1], 2, packed).unwrap();
            assert_eq!(found.floats("base.geometry", 4).unwrap(), [0.0, 2.0, 10.0, 12.0]);
            assert_eq!(found.floats("banded.geometry", 2).unwrap(), [1.0, 11.0]);
            assert_eq!(found.floats("base.sh", 6).unwrap(), [0.0, 2.0, 10.0, 12.0, 20.0, 22.0]);
            let of_the_last = |planes: usize| (0..planes).map(|p| (10 * p + 1) as f32).collect::<Vec<_>>();
            assert_eq!(found.floats("banded.sh", 48).unwrap(), of_the_last(48));
            assert_eq!(found.floats("banded.sh_moments", moments).unwrap(), of_the_last(moments));
            let of_the_others: Vec<f32> = (0..fewer).flat_map(|p| [(10 * p) as f32, (10 * p + 2) as f32]).collect();
            assert_eq!(found.floats("base.sh_moments", 2 * fewer).unwrap(), of_the_others);
            assert_eq!((found.step, found.floats("losses", 7).unwrap()), (7, &[0.5; 7][..]));
            // All keep their bands, or nobody.
            let all = divided(&whole, &[0, 1, 2], 0, packed).unwrap();
            assert!(all.floats("banded.sh", 144).unwrap() == whole.floats("base.sh", 144).unwrap());
            let none = divided(&whole, &[0, 1, 2], 3, packed).unwrap();
            assert!(none.rows("base.sh").unwrap() == 3 && none.rows("banded.sh").is_err());
            // Another precision's moments.
            assert!(divided(&whole, &[0, 1, 2], 3, !packed).is_err());
        }
    }
}
