//! Residual pursuit (method, section 7): places Gaussians, with lobes or plain, by their gain in all training
//! views at once.
//!
//! look (render, residual, pyramid of each view) → draw → (score → fit) for each chunk of candidates → sight →
//! rounds of (gain → claim → check → attenuate) → place → append. The host does not wait in between; it reads the
//! number of placed Gaussians at the end.

mod placer;

use self::placer::{KEPT, Placer};
use super::{
    model::Model,
    render::Renderer,
    session::Session,
    spend::{Choice, Chosen},
    steps::{Looped, Steps},
    views::Views,
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Recorder},
    stages::{constants::constants::NONE, status::Resource, types::Lift},
};

/// Kinds of Gaussians that may be placed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Kinds {
    /// With a lobe or plain, whichever gains more.
    #[default]
    Both,
    /// Supplementary Gaussians only.
    Lobes,
    /// Gaussians of the base only.
    Plain,
}

/// Options for drawing, fitting and choosing candidates (method, section 7).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PursuitOptions {
    /// Candidates to draw per Gaussian that may be placed; four times as many as long as these are at most
    /// [`FEW_CANDIDATES`].
    pub draws: u32,
    /// Number of sizes to try: `first_size` times powers of `size_ratio`, px in the view that a candidate was
    /// drawn in.
    pub sizes: u32,
    /// See `sizes`.
    pub first_size: f32,
    /// See `sizes`.
    pub size_ratio: f32,
    /// Rounds of choosing. Each takes all candidates that no overlapping candidate beats.
    pub rounds: u32,
    /// Kinds of Gaussians that may be placed.
    pub kinds: Kinds,
    /// Factor on the gain of a lobe if both kinds may be placed: a slightly higher gain than a plain
    /// Gaussian's is noise.
    pub lobe_worth: f32,
    /// Number of placements: the first before the joint phase, the others in its first half, each from the
    /// residual at that time.
    pub placements: u32,
    /// Minimum gain of a Gaussian: squared error, summed over pixels and channels of all views.
    pub least_gain: f32,
    /// Reduces a candidate's gain in a view by the share of its color that comes from that view alone: 0
    /// keeps the fitted color, 1 uses the color predicted from the other views.
    pub caution: f32,
    /// Standard errors over the views to subtract from a gain, so that a gain in few views counts less.
    pub doubt: f32,
    /// A supplementary Gaussian with a final opacity below this in every view is removed.
    pub least_opacity: f32,
    /// Degree of the harmonics of Gaussians with lobes, at most the base's. Their lobes already depend on the
    /// view: more bands gain nothing on the whole (docs/experiments/2026-11-23-augmentation.md) and take three times the bytes.
    pub lobe_degree: u32,
    /// Maximum number of views to look at, evenly spread; `None` for as many as fit three quarters of the free memory beyond `spare`, at some
    /// 34 bytes a pixel. Gains and errors of all views are estimates from these.
    pub views: Option<u32>,
    /// Memory to leave free for what follows, bytes.
    pub spare: u64,
    /// Maximum number of texels per page; `None` for the device's limit.
    pub page: Option<u32>,
}

impl Default for PursuitOptions {
    fn default() -> Self {
        PursuitOptions {
            draws: 3,
            sizes: 6,
            first_size: 0.5,
            size_ratio: std::f32::consts::SQRT_2,
            rounds: 48,
            kinds: Kinds::Both,
            lobe_worth: 0.98,
            placements: 3,
            least_gain: 0.0,
            caution: 1.0,
            doubt: 0.5,
            least_opacity: 0.1,
            lobe_degree: 0,
            views: None,
            spare: 0,
            page: None,
        }
    }
}

/// Result of a placement.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Placed {
    /// Placed Gaussians in order of falling gain. `lobe_width` 0: plain, in the base; `cluster_size` 0: an
    /// empty entry.
    pub lifts: Vec<Lift>,
    /// Number with a lobe.
    pub lobes: u32,
    /// Number without, in the base.
    pub plain: u32,
    /// By rank: expected fall of the squared error, summed over pixels and channels of all views.
    pub gains: Vec<f32>,
}

impl Placed {
    /// Number of placed Gaussians.
    pub fn count(&self) -> u32 {
        self.lobes + self.plain
    }
}

/// Steps per submission.
const STEPS_PER_SUBMISSION: u32 = 8;
/// Bytes per word; budgets count words.
const WORD: u64 = 4;
/// So many candidates cost little, and among fewer some Gaussians find no good one.
pub const FEW_CANDIDATES: u32 = 4096;

/// Current phase of a placement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Job {
    /// Render every view and make its pyramid.
    Look,
    Choose,
    Place,
    Done,
}

/// Progress of a placement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Views rendered, chunks scored and rounds finished so far.
    pub step: u32,
    /// Total number of these steps.
    pub steps: u32,
}

/// A running placement.
pub struct Pursuit {
    pub(crate) placer: Placer,
    steps: Steps,
    job: Job,
    /// Whether rounds end as soon as possible.
    brief: bool,
}

impl Pursuit {
    /// Places at most `most` Gaussians by their gain in `views`, whose photographs must be uploaded. Waits.
    ///
    /// # Errors
    /// Errors of the device; [`Error::Usage`] for more views or pixels than 32 bits can count.
    pub fn new(session: &Session, views: &Views, most: u32, options: PursuitOptions) -> Result<Self> {
        let placer = Placer::new(session, views, most, options)?;
        let steps = Steps::new(&session.context, STEPS_PER_SUBMISSION.min(views.views_at_once()))?;
        Ok(Pursuit { placer, steps, job: Job::Done, brief: false })
    }

    /// Sets the price of a Gaussian, in bytes, with a lobe and without. The kind with the higher gain per
    /// byte is then chosen, and [`Pursuit::start_within`] may limit the total.
    pub fn charge(&mut self, [lobe, plain]: [u64; 2]) {
        let p = &mut self.placer;
        p.prices = [lobe, plain].map(|bytes| u32::try_from(bytes.div_ceil(WORD)).unwrap_or(NONE));
        if p.options.kinds == Kinds::Both && lobe > 0 {
            p.worth[0] = p.options.lobe_worth * (plain as f64 / lobe as f64) as f32;
        }
    }

    /// Starts a placement of at most `most` Gaussians, and no more than it was made for. Waits.
    pub fn start(&mut self, most: u32) -> Result<()> {
        self.start_within(most, None)
    }

    /// [`Pursuit::start`] with a limit on the total price in bytes, see [`Pursuit::charge`].
    pub fn start_within(&mut self, most: u32, bytes: Option<u64>) -> Result<()> {
        self.placer.limit = most;
        self.placer.budget = bytes.map_or(NONE, |bytes| u32::try_from(bytes / WORD).unwrap_or(NONE));
        let p = &self.placer;
        p.work.counts.upload(0, &[p.blocks(), 0, p.candidates, 0, p.most, 0, 0])?;
        (self.job, self.brief) = (Job::Look, false);
        self.steps.start(p.looks(), false)
    }

    /// Ends the rounds of the placement in progress, after one if none is done: what they have chosen is placed.
    pub fn hurry(&mut self) {
        self.brief = true;
        if self.job == Job::Choose {
            self.steps.go_on_to(self.placer.fits() + 3);
        }
    }

    /// Runs until some steps are done; `None` once the Gaussians are in `model`, whose room must suffice.
    /// `renderer` must have depth and room for all of `model`.
    pub fn advance(&mut self, renderer: &mut Renderer, model: &Model, views: &Views) -> Result<Option<Progress>> {
        let placer = &self.placer;
        let (looks, choices, fits) = (placer.looks(), placer.choices(), placer.fits());
        let steps = looks + choices + 1;
        loop {
            let advanced = match self.job {
                Job::Look => self.steps.advance(&mut Look { placer, renderer, model, views })?,
                Job::Choose => self.steps.advance(&mut Choose { placer })?,
                Job::Place => self.steps.advance(&mut Place { placer, model })?,
                Job::Done => return Ok(None),
            };
            let before = [0, looks, looks + choices][self.job as usize];
            if let Some(done) = advanced {
                return Ok(Some(Progress { step: before + done, steps }));
            }
            self.job = match self.job {
                Job::Look => {
                    self.steps.start(choices, false)?;
                    if self.brief {
                        self.steps.go_on_to(fits + 3);
                    }
                    Job::Choose
                }
                Job::Choose => {
                    self.steps.start(1, false)?;
                    Job::Place
                }
                Job::Place | Job::Done => Job::Done,
            };
        }
    }

    /// Squared error over pixels and channels of all views, as last rendered. Waits.
    pub fn squared_error(&self) -> Result<f64> {
        let looked: f64 = self.placer.work.squares.download()?.into_iter().map(f64::from).sum();
        Ok(looked / f64::from(self.placer.share))
    }

    /// Squared error of `model` over pixels and channels of all views; places nothing. Waits.
    pub fn measure(&mut self, renderer: &mut Renderer, model: &Model, views: &Views) -> Result<f64> {
        let placer = &self.placer;
        self.steps.run(placer.looks(), false, &mut Look { placer, renderer, model, views }, |_| ())?;
        self.squared_error()
    }

    /// Whether all looked-at views have been rendered and nothing was chosen yet.
    pub fn has_looked(&self, progress: Progress) -> bool {
        progress.step == self.placer.looks()
    }

    /// Sets the minimum gain of a Gaussian in squared error.
    pub fn demand(&mut self, least_gain: f32) {
        self.placer.options.least_gain = least_gain;
    }

    /// See [`Pursuit::demand`].
    pub fn least_gain(&self) -> f32 {
        self.placer.options.least_gain
    }

    /// The chosen candidates, placed or not. Waits.
    pub fn choice(&self) -> Result<Choice> {
        let p = &self.placer;
        let sorted = p.sorted();
        let kept = (p.work.counts.download()?[KEPT as usize] as usize).min(p.candidates as usize);
        let (keys, order) = (sorted.keys.download_range(0, kept)?, sorted.values.download_range(0, kept)?);
        let fits = p.work.fits.download()?;
        let one = |(key, i): (u32, u32)| {
            let (gain, fit) = (f32::from_bits(!key) / p.share, fits.get(i as usize).copied().unwrap_or_default());
            // Overlap and caution reduce both gains in the same proportion.
            let plain = if fit.gain > 0.0 { gain * fit.plain / fit.gain } else { 0.0 };
            Chosen { gain, lobe: fit.width > 0.0, plain }
        };
        let chosen = keys.into_iter().zip(order).map(one).collect();
        Ok(Choice { chosen, drawn: p.candidates, squared_error: self.squared_error()? })
    }

    /// The placed Gaussians. Waits.
    pub fn placed(&self) -> Result<Placed> {
        let p = &self.placer;
        let lifts: Vec<Lift> = p.work.lifts.download()?.into_iter().take_while(|lift| lift.cluster_size > 0).collect();
        let lobes = lifts.iter().filter(|lift| lift.lobe_width > 0.0).count() as u32;
        let keys = p.sorted().keys.download_range(0, lifts.len())?;
        let gains = keys.into_iter().map(|key| f32::from_bits(!key) / p.share).collect();
        Ok(Placed { lobes, plain: lifts.len() as u32 - lobes, lifts, gains })
    }
}

struct Look<'a> {
    placer: &'a Placer,
    renderer: &'a mut Renderer,
    model: &'a Model,
    views: &'a Views,
}

impl Looped for Look<'_> {
    fn record(&mut self, recorder: &mut Recorder, step: u32, status: &Buffer<u32>) -> Result<()> {
        self.placer.record_look(recorder, self.renderer, self.model, self.views, step, status)
    }

    fn grow(&mut self, _: Resource, needed: u32) -> Result<()> {
        Ok(self.renderer.raster.grow(needed)?)
    }
}

struct Choose<'a> {
    placer: &'a Placer,
}

impl Looped for Choose<'_> {
    fn record(&mut self, recorder: &mut Recorder, step: u32, status: &Buffer<u32>) -> Result<()> {
        match step {
            0 => self.placer.record_draw(recorder, status),
            step if step <= self.placer.fits() => self.placer.record_fit(recorder, step - 1),
            step if step == self.placer.fits() + 1 => self.placer.record_sights(recorder),
            _ => self.placer.record_round(recorder),
        }
        Ok(())
    }

    fn grow(&mut self, resource: Resource, needed: u32) -> Result<()> {
        Err(no_room(resource, needed))
    }
}

struct Place<'a> {
    placer: &'a Placer,
    model: &'a Model,
}

impl Looped for Place<'_> {
    fn record(&mut self, recorder: &mut Recorder, _: u32, status: &Buffer<u32>) -> Result<()> {
        self.placer.record_place(recorder, self.placer.budget);
        self.placer.record_append(recorder, self.model, status);
        Ok(())
    }

    fn grow(&mut self, resource: Resource, needed: u32) -> Result<()> {
        Err(no_room(resource, needed))
    }
}

fn no_room(resource: Resource, needed: u32) -> Error {
    Error::Usage(format!("placing needs room for {needed} {resource}, which was not made"))
}
