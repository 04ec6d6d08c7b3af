//! Augments a base scene. Pursuit: base losses → gain of longer training → placement and plan → joint phase.
//! The paper's method: base losses → screen phase → inverse splatting, batch by batch → joint phase.

use std::{
    ops::Range,
    time::{Duration, Instant},
};

use glam::DVec3;
use rayon::prelude::*;

use super::{
    bands::{Bands, Promotion},
    checkpoint::Checkpoint,
    join::{JoinOptions, course, join_for},
    learn::{NEWTON_PART, WORKING_BYTES, learning_bytes},
    lift::{LiftOptions, LiftPhase, Lifted},
    model::{Model, Room, Segment},
    pursuit::{self, Placed, Pursuit, PursuitOptions},
    render::{MEDIAN_THRESHOLD, Needs, RenderOptions, Renderer},
    screen::{self, Refiner, Schedule, base_losses, budgets},
    session::Session,
    spend::{Allowance, OVERFILL, Spending, TrainingOn, Weigh, leave_out_faintest},
    train::{TrainReport, Trainer},
    views::Views,
};
use crate::{
    data::scene_bytes,
    error::{Error, Result},
    scene::{Gaussians, Scene, Supplement, color},
    stages::types::Lift,
};

/// How Gaussians are placed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Residual pursuit: places the Gaussians that gain most in all photos at once; then everything learns
    // Method, section 7.
    #[default]
    Pursuit,
    /// The paper's method: fits Gaussians in each photo and lifts them by its depth; then the base learns only its
    /// opacities
    // Method, sections 3 and 4.
    Augs,
}

/// Options of an augmentation. [`EnhanceOptions::paper`] has the paper's values.
#[derive(Debug, Clone, Copy)]
pub struct EnhanceOptions {
    /// Method that finds the supplementary Gaussians.
    pub method: Method,
    /// Options of [`Method::Pursuit`].
    pub pursuit: PursuitOptions,
    /// Maximum number of added Gaussians, as a multiple of the base's.
    pub ratio: f64,
    /// [`Method::Pursuit`]: maximum size of the added Gaussians in a file, bytes.
    pub bytes: Option<u64>,
    /// [`Method::Pursuit`]: maximum size of the whole scene in a file, bytes, in place of `bytes`. Until the end it may take [`OVERFILL`] times
    /// as many. Its base loses the Gaussians that no image shows, and the faintest if it is still too large; it is not stored twice.
    pub total_bytes: Option<u64>,
    /// [`Method::Pursuit`]: whether placement is weighed against longer training.
    pub weigh: Weigh,
    /// [`Method::Pursuit`]: whether Gaussians of a base of constant colors get bands where these gain more per byte than what is placed.
    pub bands: bool,
    /// [`Method::Augs`]: rounds and steps of the screen phase.
    pub schedule: Schedule,
    /// [`Method::Augs`]: options of inverse splatting.
    pub lift: LiftOptions,
    /// Options of the joint phase.
    pub join: JoinOptions,
    /// ⚖ Transmittance that defines the depth of a pixel: 0.5; the authors' release has 0.7.
    pub median_threshold: f32,
    /// Use the z of the median Gaussian's centre, not of its point of maximum response.
    pub centre_depth: bool,
}

impl EnhanceOptions {
    /// Residual pursuit, followed by a joint phase that trains everything.
    pub fn pursuit() -> Self {
        EnhanceOptions {
            method: Method::Pursuit,
            bands: true,
            join: JoinOptions {
                everything: true,
                pace: 2.0,
                decay: 0.1,
                newton: NEWTON_PART,
                ..JoinOptions::default()
            },
            ..Self::paper()
        }
    }

    /// The paper's settings.
    pub fn paper() -> Self {
        EnhanceOptions {
            method: Method::Augs,
            pursuit: PursuitOptions::default(),
            ratio: 0.1,
            bytes: None,
            total_bytes: None,
            weigh: Weigh::Not,
            bands: false,
            schedule: Schedule::PAPER,
            lift: LiftOptions::default(),
            join: JoinOptions::default(),
            median_threshold: MEDIAN_THRESHOLD,
            centre_depth: false,
        }
    }

    /// Limits of an augmentation of `scene`, and the price of a Gaussian.
    pub fn allowance(&self, scene: &Scene) -> Allowance {
        let overfilled = self.total_bytes.map(|total| (OVERFILL * total as f64) as u64);
        let bytes = overfilled.map_or(self.bytes, |bytes| Some(bytes.saturating_sub(scene_bytes(scene))));
        Allowance::new(scene, self.lobe_degree(scene), self.ratio, bytes)
    }

    /// Degree of the harmonics of supplementary Gaussians; the paper's have the base's degree.
    pub fn lobe_degree(&self, scene: &Scene) -> u32 {
        match self.method {
            Method::Pursuit => self.pursuit.lobe_degree.min(scene.plain_degree()),
            Method::Augs => scene.base.sh_degree,
        }
    }

    /// [`EnhanceOptions::paper`] with shorter rounds.
    pub fn quick() -> Self {
        EnhanceOptions { schedule: Schedule::QUICK, ..Self::paper() }
    }
}

/// Progress of an augmentation: the stage about to run, or just finished. `batch` counts from 0; `views` are
/// indices of the training views.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "fields of the variants")]
pub enum Event {
    /// The base was rendered in every view, and the budgets of 2D Gaussians are known.
    Base,
    /// A batch of views is next. To skip it, pass [`Enhancer::resume`] the lifts of an earlier run
    /// ([`kept_lifts`]).
    Batch { batch: usize, batches: usize, views: Range<usize> },
    /// The views of the batch are being refined in image space.
    Screen { batch: usize, batches: usize, progress: screen::Progress },
    /// The gain of bands is being measured.
    Bands { step: u32, steps: u32 },
    /// The base is being trained for a short time, to measure the gain.
    Weigh { step: u32, steps: u32 },
    /// The time of a step is known: [`Enhancer::take_steps`] may now set the length of the joint phase.
    Weighed,
    /// Pursuit is placing Gaussians.
    Place(pursuit::Progress),
    /// [`Enhancer::spending`] now returns the plan.
    Planned,
    /// The batch was lifted; [`Enhancer::lifted`] returns it until the next event.
    Lifted { views: Range<usize> },
    /// Finished steps of the joint phase, and their total. At 0, [`Enhancer::resume_join`] may restore a
    /// checkpoint.
    Join { step: u32, steps: u32 },
}

/// Wall-clock time of each phase.
#[derive(Debug, Clone, Copy, Default)]
pub struct Times {
    /// Rendering the base and computing its losses.
    pub base: Duration,
    /// Measuring the gain of bands.
    pub bands: Duration,
    /// Measuring the gain of longer training.
    pub weigh: Duration,
    /// Placement, by [`Method::Pursuit`].
    pub place: Duration,
    /// The screen phase.
    pub screen: Duration,
    /// Inverse splatting.
    pub lift: Duration,
    /// The joint phase.
    pub join: Duration,
}

/// Result of an augmentation.
#[derive(Debug, Default)]
pub struct Enhanced {
    /// Base and supplement after the joint phase; added Gaussians without lobes follow the base's own, and those with bands follow them.
    /// From a mixed base, or if the total size has a limit, those that no image shows are removed, unless all that have bands would go.
    pub scene: Scene,
    /// The original base, if the trained one is worse without the supplement: other viewers should show this
    /// one.
    pub original: Option<Gaussians>,
    /// Loss of the original base's render of each view.
    pub base_losses: Vec<f64>,
    /// Budget of 2D Gaussians of each view.
    pub budgets: Vec<u32>,
    /// 2D Gaussians left after the screen phase.
    pub refined: u32,
    /// Supplementary Gaussians in the final scene.
    pub lifted: u32,
    /// Added Gaussians without lobes, including those that faded.
    pub plain: u32,
    /// Gaussians that were removed: transparent in every view, or the faintest beyond a limit.
    pub faded: u32,
    /// Views with lifts from an earlier run.
    pub resumed: usize,
    /// Wall-clock time of each phase.
    pub times: Times,
    /// Result of each placement of [`Method::Pursuit`].
    pub placed: Vec<Placed>,
    /// The Gaussians that got bands.
    pub promotion: Promotion,
    /// The plan that was followed, by [`Method::Pursuit`].
    pub spending: Option<Spending>,
    /// Total steps of the joint phase.
    pub steps: u32,
    /// `None` if nothing was added.
    pub join: Option<TrainReport>,
}

/// A copy of the base and its trainer, to measure the gain of longer training.
struct Pilot {
    model: Model,
    trainer: Trainer,
}

/// The next stage.
enum Next {
    Base,
    Bands(Box<Bands>),
    Weigh(Box<Pilot>),
    /// Starts the first placement.
    First,
    /// Pursuit places Gaussians; with a trainer, the joint phase then resumes.
    Place(Option<Box<Trainer>>),
    /// Starts the joint phase.
    Begin,
    Batch(usize),
    Screen(usize),
    Join(Box<Trainer>),
    Done,
}

/// Inverse splatting of [`Method::Augs`].
struct Lifting {
    phase: LiftPhase,
    /// The last batch, until the next event.
    lifted: Option<Lifted>,
    /// Lifts of each batch, for checkpoints.
    lifts: Vec<(Range<usize>, Vec<Lift>)>,
}

/// A running augmentation: call [`Enhancer::next`] until it returns `None`.
pub struct Enhancer {
    session: Session,
    options: EnhanceOptions,
    model: Model,
    /// Renders the base alone, with depth.
    renderer: Renderer,
    refiner: Option<Refiner>,
    pursuit: Option<Pursuit>,
    /// The search for bands, until the plan is made.
    bands: Option<Box<Bands>>,
    /// The scene before.
    original: Scene,
    /// The trained base is worse than the original.
    worse_alone: bool,
    lifting: Lifting,
    next: Next,
    allowance: Allowance,
    training_on: Option<TrainingOn>,
    /// Without its scene until the end.
    found: Enhanced,
}

impl Enhancer {
    /// Augments `scene`, whose supplement must be `None`, from the photographs of `views`. Waits.
    ///
    /// # Errors
    /// [`Error::Usage`] if the scene is empty or already augmented, or there are no views; otherwise an error
    /// of the device.
    pub fn new(session: &Session, scene: &Scene, views: &Views, options: &EnhanceOptions) -> Result<Self> {
        if scene.supplement.is_some() {
            return Err(Error::Usage("the scene is augmented already; give its base".into()));
        }
        if scene.base.is_empty() || views.cameras.is_empty() {
            return Err(Error::Usage("there is nothing to augment: no Gaussians, or no training views".into()));
        }
        let colors = color::of(scene.base.sh_degree);
        if colors.harmonics.is_none() {
            return Err(Error::Usage(format!("the base has {}, expected harmonics", colors.name)));
        }
        let allowance = options.allowance(scene);
        let room = match options.method {
            Method::Pursuit => {
                let [supplement, base] = allowance.most();
                let supplement_degree = Some(options.lobe_degree(scene));
                // Faded supplementary Gaussians stay in the model until the end.
                Room { base, supplement: supplement.saturating_mul(2), supplement_degree, ..Default::default() }
            }
            Method::Augs => Room::default(),
        };
        let model = Model::upload_around(&session.context, views.origin, scene, room)?;
        Ok(Enhancer {
            renderer: renderer_of(session, &model, views, options)?,
            lifting: Lifting {
                phase: LiftPhase::new(&session.context, options.lift)?,
                lifted: None,
                lifts: Vec::new(),
            },
            session: session.clone(),
            options: *options,
            model,
            refiner: None,
            pursuit: None,
            bands: None,
            original: scene.clone(),
            worse_alone: false,
            next: Next::Base,
            allowance,
            training_on: None,
            found: Enhanced { steps: options.join.steps_per_view * views.cameras.len() as u32, ..Enhanced::default() },
        })
    }

    /// The current scene; work in flight may still change it.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Loss of the base in each view, 0.8 L1 + 0.2 (1 − SSIM); valid after [`Event::Base`].
    pub fn base_losses(&self) -> &[f64] {
        &self.found.base_losses
    }

    /// Runs to the next event; `None` once all is done. `views` must be those passed to [`Enhancer::new`].
    pub fn next(&mut self, views: &Views) -> Result<Option<Event>> {
        self.lifting.lifted = None;
        loop {
            let started = Instant::now();
            let event = match (&self.next, self.options.method) {
                (Next::Base, Method::Pursuit) => self.look(views, started),
                (Next::Base, Method::Augs) => self.share_out(views, started),
                (Next::Bands(_), _) => self.find_bands(views, started),
                (Next::Weigh(_), _) => self.weigh(views, started),
                (Next::First, _) => self.begin_first(),
                (Next::Place(_), _) => self.place(views, started),
                (Next::Begin, _) => {
                    self.next = self.begin_join(views)?;
                    self.found.times.join += started.elapsed();
                    Ok(self.join_on())
                }
                (&Next::Batch(batch), _) => self.begin_batch(views, batch, started),
                (&Next::Screen(batch), _) => self.refine(views, batch, started),
                (Next::Join(_), _) => self.step_jointly(views, started),
                (Next::Done, _) => return Ok(None),
            }?;
            if event.is_some() {
                return Ok(event);
            }
        }
    }

    /// Pursuit: computes the residuals of the base, and chooses the next stage.
    fn look(&mut self, views: &Views, started: Instant) -> Result<Option<Event>> {
        self.found.base_losses = base_losses(&self.session, &mut self.renderer, &self.model, views)?;
        let [lobes, plain] = self.allowance.most();
        let most = lobes.max(plain);
        // The trial of longer training and the joint phase make these beside pursuit.
        let each = learning_bytes(self.model.sh_degree, false, true).iter().sum::<u64>() + WORKING_BYTES;
        let spare = u64::from(self.model.capacity()) * each;
        let options = PursuitOptions { spare, ..self.options.pursuit };
        let mut pursuit = Pursuit::new(&self.session, views, most, options)?;
        if self.allowance.bytes.is_some() {
            pursuit.charge(self.allowance.prices());
        }
        self.pursuit = Some(pursuit);
        self.next = match self.options.bands && self.original.base.sh_degree == 0 {
            true => Next::Bands(Box::new(Bands::new(&self.session, &self.original, views, 0)?)),
            false => self.begin_placing(views)?,
        };
        self.found.times.base = started.elapsed();
        Ok(Some(Event::Base))
    }

    fn find_bands(&mut self, views: &Views, started: Instant) -> Result<Option<Event>> {
        let Next::Bands(bands) = &mut self.next else { return self.end() };
        let advanced = bands.advance(views)?;
        self.found.times.bands += started.elapsed();
        if let Some([step, steps]) = advanced {
            return Ok(Some(Event::Bands { step, steps }));
        }
        let next = self.begin_placing(views)?;
        if let Next::Bands(bands) = std::mem::replace(&mut self.next, next) {
            self.bands = Some(bands);
        }
        Ok(None)
    }

    /// The trial of longer training if there is one, else the first placement.
    fn begin_placing(&self, views: &Views) -> Result<Next> {
        let [lobes, plain] = self.allowance.most();
        if self.options.weigh != Weigh::Not && lobes.max(plain) > 0 {
            return Ok(Next::Weigh(Box::new(self.pilot(views)?)));
        }
        Ok(Next::First)
    }

    fn begin_first(&mut self) -> Result<Option<Event>> {
        let (gaussians, bytes) = self.allowance.left([0, self.options.pursuit.placements], 0, 0);
        if let Some(pursuit) = &mut self.pursuit {
            pursuit.start_within(gaussians, bytes)?;
        }
        self.next = Next::Place(None);
        Ok(None)
    }

    /// Shortens the phase in progress. The search for bands and the trial of longer training end without a result; a placement ends
    /// its rounds. Other phases do not change. Waits.
    pub fn hurry(&mut self, views: &Views) -> Result<()> {
        match &self.next {
            Next::Bands(_) => self.next = self.begin_placing(views)?,
            Next::Weigh(_) => self.next = Next::First,
            Next::Place(_) => self.pursuit.iter_mut().for_each(Pursuit::hurry),
            _ => {}
        }
        Ok(())
    }

    /// Gives bands to Gaussians that gain more by them, per byte, than the last placed Gaussian gains, as far as bytes are left.
    fn promote(&mut self, views: &Views, least_gain: f32) -> Result<()> {
        let (Some(bands), Some(placed)) = (self.bands.take(), self.found.placed.last()) else { return Ok(()) };
        let [lobe, plain] = self.allowance.prices();
        let price = |lift: &Lift| if lift.lobe_width > 0.0 { lobe } else { plain };
        let last = placed.lifts.last().zip(placed.gains.last());
        let least =
            last.map_or(f64::from(least_gain) / plain as f64, |(lift, &gain)| f64::from(gain) / price(lift) as f64);
        let taken = self.allowance.taken(placed.plain, placed.lobes);
        // A limit in Gaussians stands for the bytes of as many plain ones.
        let bytes = self.allowance.bytes.unwrap_or(u64::from(self.allowance.gaussians) * plain);
        let most = bytes.saturating_sub(taken);
        let promotion = bands.choose(most, least);
        if promotion.gains.is_empty() {
            return Ok(());
        }
        let mut scene = self.model.download()?;
        (scene.base, scene.mixed) = (bands.promoted(&scene.base, &promotion), true);
        let room = |segment| self.model.part(segment).capacity() - self.model.count_of(segment);
        let supplement = self.model.part(Segment::Supplement);
        let room = Room {
            base: room(Segment::Base),
            supplement: room(Segment::Supplement),
            supplement_degree: Some(supplement.sh_degree),
            ..Room::default()
        };
        self.model = Model::upload_around(&self.session.context, views.origin, &scene, room)?;
        self.renderer = renderer_of(&self.session, &self.model, views, &self.options)?;
        self.allowance.bytes = self.allowance.bytes.map(|bytes| bytes - promotion.bytes());
        self.found.promotion = promotion;
        Ok(())
    }

    fn weigh(&mut self, views: &Views, started: Instant) -> Result<Option<Event>> {
        let (Next::Weigh(pilot), Some(pursuit)) = (&mut self.next, &mut self.pursuit) else { return self.end() };
        let steps = pilot.trainer.total();
        if let Some(step) = pilot.trainer.advance(&pilot.model, views)? {
            self.found.times.weigh += started.elapsed();
            return Ok(Some(Event::Weigh { step, steps }));
        }
        let after = pursuit.measure(&mut self.renderer, &pilot.model, views)?;
        // The first placement measures the error before training and fills it in.
        let seconds = self.found.times.weigh.as_secs_f64();
        self.training_on = Some(TrainingOn { before: f64::NAN, after, steps, seconds });
        self.next = Next::First;
        self.found.times.weigh += started.elapsed();
        Ok(Some(Event::Weighed))
    }

    fn place(&mut self, views: &Views, started: Instant) -> Result<Option<Event>> {
        let (Next::Place(joining), Some(pursuit)) = (&mut self.next, &mut self.pursuit) else { return self.end() };
        let progress = pursuit.advance(&mut self.renderer, &self.model, views)?;
        self.found.times.place += started.elapsed();
        if let Some(progress) = progress {
            if let (Some(on), true) = (&mut self.training_on, pursuit.has_looked(progress))
                && on.before.is_nan()
            {
                on.before = pursuit.squared_error()?;
                if self.options.weigh == Weigh::Limit {
                    let least = on.least_gain(self.found.steps, self.original.base.len() as u32) as f32;
                    pursuit.demand(least.max(self.options.pursuit.least_gain));
                }
            }
            return Ok(Some(Event::Place(progress)));
        }
        let joining = joining.take();
        self.model.learn_counts()?;
        self.found.placed.push(pursuit.placed()?);
        let Some(trainer) = joining else {
            let placements = self.options.pursuit.placements.max(1);
            let (choice, least) = (pursuit.choice()?, pursuit.least_gain());
            let steps = [placements, self.found.steps];
            let spending = Spending::new(&self.allowance, steps, &choice, least, self.training_on.as_ref());
            self.promote(views, least)?;
            self.found.spending = Some(spending.with_bands(&self.found.promotion, &choice));
            self.next = Next::Begin;
            return Ok(Some(Event::Planned));
        };
        self.next = Next::Join(trainer);
        Ok(self.join_on())
    }

    /// The paper's method: computes the budget of 2D Gaussians of each view.
    fn share_out(&mut self, views: &Views, started: Instant) -> Result<Option<Event>> {
        self.found.base_losses = base_losses(&self.session, &mut self.renderer, &self.model, views)?;
        self.found.budgets = budgets(&self.found.base_losses, self.allowance.gaussians);
        self.model.reserve(Segment::Supplement, self.found.budgets.iter().sum())?;
        self.found.times.base = started.elapsed();
        self.refiner = Some(Refiner::new(&self.session, views, &self.found.budgets, self.options.schedule)?);
        self.found.times.screen = started.elapsed() - self.found.times.base;
        self.next = Next::Batch(0);
        Ok(Some(Event::Base))
    }

    fn begin_batch(&mut self, views: &Views, batch: usize, started: Instant) -> Result<Option<Event>> {
        if let Some((batches, range)) = self.batch(batch) {
            self.next = Next::Screen(batch);
            return Ok(Some(Event::Batch { batch, batches, views: range }));
        }
        self.refiner = None;
        self.next = self.begin_join(views)?;
        self.found.times.join = started.elapsed();
        Ok(match &self.next {
            Next::Join(trainer) => Some(Event::Join { step: 0, steps: trainer.total() }),
            _ => None,
        })
    }

    fn refine(&mut self, views: &Views, batch: usize, started: Instant) -> Result<Option<Event>> {
        let (Some((batches, range)), Some(refiner)) = (self.batch(batch), &mut self.refiner) else {
            return self.end();
        };
        if refiner.views() != range {
            refiner.start(views, batch)?;
        }
        if let Some(progress) = refiner.advance(&mut self.renderer, &self.model, views)? {
            self.found.times.screen += started.elapsed();
            return Ok(Some(Event::Screen { batch, batches, progress }));
        }
        self.found.refined += refiner.refined().counts.iter().sum::<u32>();
        self.found.times.screen += started.elapsed();
        let started = Instant::now();
        let unit = if self.session.extent > 0.0 { self.session.extent } else { 1.0 };
        let lifted = self.lifting.phase.lift(refiner, views, unit, &mut self.model)?;
        self.lifting.lifts.push((range.clone(), lifted.lifts.clone()));
        self.lifting.lifted = Some(lifted);
        self.found.times.lift += started.elapsed();
        self.next = Next::Batch(batch + 1);
        Ok(Some(Event::Lifted { views: range }))
    }

    fn step_jointly(&mut self, views: &Views, started: Instant) -> Result<Option<Event>> {
        let Next::Join(trainer) = &mut self.next else { return self.end() };
        let steps = trainer.total();
        if let Some(step) = trainer.advance(&self.model, views)? {
            self.found.times.join += started.elapsed();
            return Ok(Some(Event::Join { step, steps }));
        }
        let (done, placements) = (self.found.placed.len() as u32, self.options.pursuit.placements);
        if let (Some(pursuit), true) = (&mut self.pursuit, done < placements) {
            // Faded Gaussians are removed at the end, so more can be placed now.
            let faded = faded(&self.model, views, self.options.pursuit.least_opacity)?;
            let plain = self.model.base_count() - self.original.base.len() as u32;
            let lobes = self.model.count_of(Segment::Supplement);
            let room = self.model.part(Segment::Supplement).capacity().saturating_sub(lobes);
            let (gaussians, bytes) = self.allowance.left([done, placements], plain, lobes - faded);
            pursuit.start_within(gaussians.min(room), bytes)?;
            if let Next::Join(trainer) = std::mem::replace(&mut self.next, Next::Done) {
                self.next = Next::Place(Some(trainer));
            }
            return Ok(None);
        }
        self.found.join = Some(trainer.report());
        self.finish_join(views)?;
        Ok(None)
    }

    /// Ends the augmentation.
    fn end(&mut self) -> Result<Option<Event>> {
        self.next = Next::Done;
        Ok(None)
    }

    /// Skips the batch that [`Event::Batch`] announced, using the lifts of an earlier run. Waits.
    pub fn resume(&mut self, lifts: &[Lift]) -> Result<()> {
        let Next::Screen(batch) = self.next else {
            return Err(Error::Usage("lifts are taken up when a batch is about to begin".into()));
        };
        let views = self.batch(batch).map_or(0..0, |(_, views)| views);
        self.found.resumed += views.len();
        self.found.refined += lifts.len() as u32;
        self.lifting.phase.append_lifts(lifts, &mut self.model)?;
        self.lifting.lifts.push((views, lifts.to_vec()));
        self.next = Next::Batch(batch + 1);
        Ok(())
    }

    /// Resumes the joint phase from an [`Enhancer::checkpoint`] taken in this phase. Call it just before the
    /// phase starts. Waits.
    ///
    /// # Errors
    /// [`Error::Usage`] if the checkpoint is of another scene or schedule; the phase can then still start
    /// from the beginning.
    pub fn resume_join(&mut self, checkpoint: &Checkpoint) -> Result<()> {
        let Next::Join(trainer) = &mut self.next else { return Err(not_joining()) };
        if checkpoint.step == 0 {
            return Ok(());
        }
        if self.options.method == Method::Augs {
            return trainer.resume(&self.model, checkpoint, true);
        }
        let placements = self.options.pursuit.placements;
        let done = checkpoint.floats(PLACEMENTS, 1)?[0] as u32;
        if !(1..=placements).contains(&done) {
            return Err(Error::Usage(format!("{done} of {placements} placements are done")));
        }
        trainer.resume(&self.model, checkpoint, true)?;
        self.model.learn_counts()?;
        self.found.placed.resize(done as usize, Placed::default());
        trainer.go_on_to(pause(trainer.total(), done, self.options.pursuit.placements));
        Ok(())
    }

    /// Means of the joint phase over the last pass before step `step`, see [`Trainer::lately`].
    pub fn lately(&self, step: u32, views: &Views) -> Option<[f64; 2]> {
        let Next::Join(trainer) = &self.next else { return None };
        trainer.lately(step, views.cameras.len())
    }

    /// Checkpoint of the lifts of finished batches and of the joint phase. Waits; the augmentation can
    /// continue.
    pub fn checkpoint(&mut self, views: &Views) -> Result<Checkpoint> {
        let mut checkpoint = match &mut self.next {
            Next::Join(trainer) => trainer.checkpoint(&self.model, views)?,
            _ if self.lifting.lifts.is_empty() => return Err(not_joining()),
            _ => Checkpoint::new(0),
        };
        match self.options.method {
            Method::Pursuit => checkpoint.put(PLACEMENTS.into(), [1, 1], vec![self.found.placed.len() as f32]),
            Method::Augs => {
                for (views, lifts) in &self.lifting.lifts {
                    checkpoint.put_words(batch_name(views), bytemuck::cast_slice(lifts).to_vec());
                }
            }
        }
        Ok(checkpoint)
    }

    /// Ends the joint phase early; the scene holds the result so far. Waits.
    pub fn stop(&mut self, views: &Views) -> Result<()> {
        let Next::Join(trainer) = &mut self.next else { return Err(not_joining()) };
        self.found.join = Some(trainer.stop()?);
        self.finish_join(views)
    }

    /// Checks whether the trained base alone is still as good as the original.
    fn finish_join(&mut self, views: &Views) -> Result<()> {
        self.next = Next::Done;
        let now = base_losses(&self.session, &mut self.renderer, &self.model, views)?;
        // NaN counts as worse.
        let [now, before] = [&now, &self.found.base_losses].map(|losses| losses.iter().sum::<f64>());
        self.worse_alone = now > before || now.is_nan() || before.is_nan();
        Ok(())
    }

    /// Sets the length of the joint phase, before it starts.
    pub fn take_steps(&mut self, steps: u32) {
        self.found.steps = steps.max(1);
    }

    /// Makes the first placement the only one. Call it before that begins, at [`Event::Weighed`] at the latest.
    pub fn place_once(&mut self) {
        self.options.pursuit.placements = 1;
    }

    /// The plan of the placement, after [`Event::Planned`].
    pub fn spending(&self) -> Option<&Spending> {
        self.found.spending.as_ref()
    }

    /// Changes the length of a running joint phase. `plan` takes the number of finished steps, and returns
    /// the new total and the step to continue at. Waits.
    pub fn replan(&mut self, views: &Views, plan: impl FnOnce(u32) -> [u32; 2]) -> Result<()> {
        let Next::Join(trainer) = &mut self.next else { return Err(not_joining()) };
        let [steps, done] = plan(trainer.halt()?);
        let (schedule, plan) = course(&self.session, &self.model, views, &self.options.join, steps);
        trainer.follow(&self.session, schedule, plan, done)?;
        if self.options.method == Method::Pursuit {
            trainer.go_on_to(pause(steps, self.found.placed.len() as u32, self.options.pursuit.placements));
        }
        self.found.steps = steps;
        Ok(())
    }

    /// The batch that [`Event::Lifted`] announced: its 2D Gaussians, still on the device, and their lifts.
    pub fn lifted(&self) -> Option<(&Refiner, &Lifted)> {
        self.refiner.as_ref().zip(self.lifting.lifted.as_ref())
    }

    /// Results of the placements so far.
    pub fn placed(&self) -> &[Placed] {
        &self.found.placed
    }

    /// The final scene, after the last event; `views` must be those passed to [`Enhancer::new`]. Waits.
    pub fn finish(self, views: &Views) -> Result<Enhanced> {
        let mut scene = self.model.download()?;
        let lifted = self.model.count_of(Segment::Supplement);
        let plain = (scene.base.len() - self.original.base.len()) as u32;
        let total = self.options.total_bytes;
        let mut greatest = Vec::new();
        if let (Method::Pursuit, Some(supplement)) = (self.options.method, &mut scene.supplement) {
            let room = self.allowance.lobes_beside(plain) as usize;
            let opacities = greatest_opacities(supplement, views, scene.origin);
            // More may be left than allowed, if faded Gaussians that were already replaced have recovered.
            let mut order: Vec<usize> = (0..opacities.len()).collect();
            order.sort_by(|&a, &b| opacities[b].total_cmp(&opacities[a]));
            let mut keep = vec![false; opacities.len()];
            order.iter().take(room).for_each(|&i| keep[i] = opacities[i] >= self.options.pursuit.least_opacity.into());
            supplement.retain(|i| keep[i]);
            greatest = (0..keep.len()).filter(|&i| keep[i]).map(|i| opacities[i]).collect();
        }
        // The file of another base may have to begin with the original.
        let is_free = scene.mixed || total.is_some();
        let original = (self.worse_alone && !is_free).then_some(self.original.base);
        let all = scene.base.len();
        if is_free && self.found.join.is_some() {
            let shown: Vec<usize> = (0..all).filter(|&i| is_shown(scene.base.opacities[i])).collect();
            let base = scene.base.reordered(&shown);
            // Without bands it would no longer be mixed.
            if !scene.mixed || base.constants() < shown.len() {
                scene.base = base;
            }
            total.iter().for_each(|&total| leave_out_faintest(&mut scene, &greatest, total));
        }
        scene.supplement = scene.supplement.filter(|s| !s.gaussians.is_empty());
        let left = scene.supplement.as_ref().map_or(0, |s| s.gaussians.len() as u32);
        let faded = lifted - left + (all - scene.base.len()) as u32;
        Ok(Enhanced { scene, original, lifted: left, plain, faded, ..self.found })
    }

    /// The number of batches, and the views of one.
    fn batch(&self, batch: usize) -> Option<(usize, Range<usize>)> {
        let batches = self.refiner.as_ref()?.batches();
        Some((batches.len(), batches.get(batch)?.clone()))
    }

    /// A trainer on a copy of the base, for some passes over the photographs; rates fall as in the joint
    /// phase.
    fn pilot(&self, views: &Views) -> Result<Pilot> {
        let model = Model::upload_around(&self.session.context, views.origin, &self.original, Room::default())?;
        // Without bias correction, Adam's moments would not settle in such a short run.
        let options = JoinOptions { bias_correction: true, steps_per_view: TRIAL_PASSES, ..self.options.join };
        let steps = TRIAL_PASSES * views.cameras.len() as u32;
        let mut trainer = join_for(&self.session, &model, views, &options, steps)?;
        trainer.start(false)?;
        Ok(Pilot { model, trainer })
    }

    /// Lets the joint phase run to the next placement, if it is the next stage.
    fn join_on(&mut self) -> Option<Event> {
        let (done, placements) = (self.found.placed.len() as u32, self.options.pursuit.placements);
        let Next::Join(trainer) = &mut self.next else { return None };
        let steps = trainer.total();
        trainer.go_on_to(pause(steps, done, placements));
        Some(Event::Join { step: pause(steps, done - 1, placements), steps })
    }

    fn begin_join(&self, views: &Views) -> Result<Next> {
        if self.model.count() == self.original.base.len() as u32 && self.found.promotion.gains.is_empty() {
            return Ok(Next::Done);
        }
        let mut trainer = join_for(&self.session, &self.model, views, &self.options.join, self.found.steps)?;
        if self.options.method == Method::Pursuit {
            trainer.let_counts_vary();
        }
        trainer.start(true)?;
        Ok(Next::Join(Box::new(trainer)))
    }
}

/// A renderer of the base, with depth.
fn renderer_of(session: &Session, model: &Model, views: &Views, options: &EnhanceOptions) -> Result<Renderer> {
    let render = RenderOptions {
        depth: true,
        centre_depth: options.centre_depth,
        median_threshold: options.median_threshold,
        policy: session.policy,
        ..Default::default()
    };
    Ok(Renderer::new(&session.context, Needs::of(model), views, render)?)
}

/// Whether a Gaussian with this logit of its opacity may be in an image. Rendering leaves out opacities below 1/255; float32 of the logistic
/// function is off by less than a thousandth.
fn is_shown(logit: f32) -> bool {
    1.0 / (1.0 + (-f64::from(logit)).exp()) >= 0.999 / 255.0
}

/// The maximum opacity of each Gaussian over all `views`, lobe included. Means are relative to `origin`.
fn greatest_opacities(supplement: &Supplement, views: &Views, origin: DVec3) -> Vec<f64> {
    let eyes: Vec<DVec3> = views.cameras.iter().map(|camera| camera.eye() + (views.origin - origin)).collect();
    let opacity = |i| supplement.greatest_opacity(i, &eyes);
    // NaN counts as transparent.
    (0..supplement.gaussians.len()).into_par_iter().map(|i| opacity(i).max(0.0)).collect()
}

/// Number of supplementary Gaussians with an opacity below `least` in all of `views`. Waits.
fn faded(model: &Model, views: &Views, least: f32) -> Result<u32> {
    let Some(supplement) = model.supplement()? else { return Ok(0) };
    Ok(greatest_opacities(&supplement, views, model.scene_origin)
        .into_iter()
        .filter(|&opacity| opacity < least.into())
        .count() as u32)
}

/// Passes over the photographs in the trial that measures the gain of longer training. One pass says little
/// about a settled base: it ended at far lower rates, and the first steps disturb it.
pub const TRIAL_PASSES: u32 = 3;

/// Name of the number of placements in a checkpoint.
const PLACEMENTS: &str = "placements";

/// The joint step to stop at for the next placement, `done` of `placements` being done. All lie in the first
/// half.
fn pause(steps: u32, done: u32, placements: u32) -> u32 {
    if done < placements { (f64::from(steps) * 0.5 * f64::from(done) / f64::from(placements)) as u32 } else { steps }
}

/// Lifts of a batch with these views in a checkpoint. `None` if the batch was not finished, or was split
/// differently on another device.
pub fn kept_lifts<'a>(checkpoint: &'a Checkpoint, views: &Range<usize>) -> Option<&'a [Lift]> {
    bytemuck::try_cast_slice(checkpoint.words(&batch_name(views))?).ok()
}

/// Name of a batch's lifts in a checkpoint.
fn batch_name(views: &Range<usize>) -> String {
    format!("lifts.{}-{}", views.start, views.end)
}

fn not_joining() -> Error {
    Error::Usage("only the joint phase can be ended early, checkpointed and resumed".into())
}

/// Augments `scene` from the photographs of `views` in one call; `watch` is called with every event.
pub fn enhance(
    session: &Session,
    scene: &Scene,
    views: &Views,
    options: &EnhanceOptions,
    mut watch: impl FnMut(&Event),
) -> Result<Enhanced> {
    let mut enhancer = Enhancer::new(session, scene, views, options)?;
    while let Some(event) = enhancer.next(views)? {
        watch(&event);
    }
    enhancer.finish(views)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn placements_end_with_all_and_lie_in_the_first_part() {
        assert_eq!([0, 1, 2, 3].map(|done| pause(600, done, 3)), [0, 100, 200, 600]);
        assert_eq!([0, 1].map(|done| pause(600, done, 1)), [0, 600]);
    }
}
