//! Density control (method, section 2): prunes and multiplies Gaussians during training. It runs entirely on
//! the device and gives the same result every run.
//!
//! A refinement is weigh → scan of the living Gaussians → scan or sort of the keys → plan → draw → place →
//! gather → apply. The new number of Gaussians lives on the device, and later dispatches read it there.

use super::{
    learn::{Beside, NEWTON_PART, Rates, Seen, moments_of, sh_moments},
    loss::Batch,
    model::{Model, Planes, Rearrange, Segment, Sources},
    plan::{bind, buffers},
    raster::{Between, Grid, Raster},
    session::Session,
    sort::{Extent, Input, Pairs, RadixScratch, RadixSort, Scan, ScanBuffers},
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Location, Recorder},
    scene::Gaussians,
    stages::{
        WORKGROUP,
        blocks::{DIGIT_TOTALS, block_counts_len, block_sums_len},
        constants::density::{ADC, ALIVE, BUDGET, CANDIDATES, ERRORS, MCMC, NEW, OLD, SCORES, WORDS},
        density_apply, density_draw, density_image, density_noise, density_place, density_plan, density_score,
        density_weigh,
    },
};

/// How the number of Gaussians changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Constant number of Gaussians
    Fixed,
    /// 3DGS-MCMC (Kheradmand 2024): transparent Gaussians move to opaque ones, 5 % more at each refinement
    Mcmc,
    /// 3DGS (Kerbl 2023): Gaussians with large gradients are cloned or split, opacities are reset
    Adc,
    /// Grows up to the limit, toward places with large errors; transparent Gaussians move there
    #[default]
    Budget,
}

impl Strategy {
    /// All strategies.
    pub const ALL: [Strategy; 4] = [Strategy::Fixed, Strategy::Mcmc, Strategy::Adc, Strategy::Budget];

    /// The strategy's number in the kernels; none if it never refines.
    pub fn kernel(self) -> Option<u32> {
        match self {
            Strategy::Fixed => None,
            Strategy::Mcmc => Some(MCMC),
            Strategy::Adc => Some(ADC),
            Strategy::Budget => Some(BUDGET),
        }
    }

    /// Whether it starts from few Gaussians and adds others where errors are large.
    pub fn follows_errors(self) -> bool {
        self == Strategy::Budget
    }

    /// Whether steps are Newton's; the published strategies use Adam's.
    pub fn is_newton(self) -> bool {
        matches!(self, Strategy::Fixed | Strategy::Budget)
    }
}

/// Options of density control for one run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DensityOptions {
    /// Selects the Gaussians to prune and to multiply.
    pub strategy: Strategy,
    /// Maximum number of Gaussians; [`Strategy::Budget`] grows to this number.
    pub limit: u32,
    /// Gaussians at the start.
    pub first: u32,
    /// Steps of the run.
    pub iterations: u32,
}

/// One refinement: a change of the Gaussians between two steps.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Event {
    /// Number of Gaussians afterwards: `target`, or one in `nth` more than before, whichever is more.
    target: u32,
    nth: u32,
    /// Upper limit of opacities afterwards.
    most: f32,
    /// Input of the hash; differs between the events of one step.
    number: u32,
}

/// Length of the published 3DGS and 3DGS-MCMC runs, in steps. Other lengths scale their numbers
/// proportionally.
const FULL_RUN: f64 = 30_000.0;
/// A Gaussian with this opacity or less is pruned.
pub const LEAST_OPACITY: f32 = 0.005;
/// ADC multiplies a Gaussian whose gradient over the image exceeds this, averaged over the views that blend
/// it.
pub const LEAST_PULL: f32 = 2e-4;
/// ADC clones Gaussians up to this scale, as a fraction of the extent, and splits larger ones.
pub const CLONE_SCALE: f32 = 0.01;
/// Opacity that ADC resets to.
pub const RESET_OPACITY: f32 = 0.01;
/// MCMC: each refinement adds one Gaussian per this number.
pub const GROWTH_NTH: u32 = 20;
/// MCMC: noise of a step, as a multiple of the rate of positions.
pub const NOISE: f32 = 5e5;
/// MCMC: weights of mean opacity and mean scale in the loss.
pub const MEAN_WEIGHT: f32 = 0.01;
/// MCMC: initial opacity, and initial scale relative to that of 3DGS.
pub const FIRST_OPACITY: f32 = 0.5;
/// See [`FIRST_OPACITY`].
pub const FIRST_SCALE: f32 = 0.1;
/// MCMC: learning rate of opacities.
pub const OPACITY_RATE: f32 = 0.05;
/// The budget, as fractions of the run: growth starts at the first and ends at the second; transparent
/// Gaussians move until the third.
pub const BUDGET_SPAN: [f64; 3] = [0.02, 0.6, 0.85];
/// The budget: refinements per run, if that gives intervals of 10 to 100 steps; otherwise the interval is
/// clamped.
pub const BUDGET_EVENTS: u32 = 40;
/// The budget: one step in this number collects scores.
pub const SCORED_NTH: u32 = 3;
/// The budget: the last learning rates of a run, as a fraction of the first.
pub const LAST_RATE: f64 = 0.6;
/// The budget: from the last of [`BUDGET_SPAN`] on, the number of Gaussians is fixed. From then to the end,
/// the rates of rotations and opacities fall to this fraction, and so does the fraction of the way to the
/// minimum that a Newton step goes.
pub const SETTLED_RATE: f64 = 0.1;
/// The budget: rate of positions, relative to that of 3DGS. A Newton step finds its own length and needs a
/// wider bound.
pub const MEAN_RATE: f64 = 2.0;
/// The budget: rates are multiplied by (3DGS's run length / this run's length) to this power.
pub const RATE_POWER: f64 = 0.2;

impl DensityOptions {
    /// Steps between refinements.
    pub fn interval(&self) -> u32 {
        match self.strategy {
            Strategy::Fixed => u32::MAX,
            // Every 100 of 30,000 steps; in a shorter run at least 20, so that some views are seen between
            // two refinements.
            Strategy::Mcmc | Strategy::Adc => (self.iterations / 300).clamp(20, 100),
            Strategy::Budget => (self.iterations / BUDGET_EVENTS).clamp(10, 100),
        }
    }

    /// Number of Gaussians that the budget allows after step `step` (from 0): N0 at first, B at the end. In
    /// between it is N0 + (B − N0) (1 − (1 − x)²), x rising from 0 to 1 over the first two of
    /// [`BUDGET_SPAN`].
    pub fn budget(&self, step: u32) -> u32 {
        self.budget_at(self.part(step + 1))
    }

    /// [`DensityOptions::budget`] at the fraction `part` of the run.
    fn budget_at(&self, part: f64) -> u32 {
        let [begin, full, _] = BUDGET_SPAN;
        let x = ((part - begin) / (full - begin)).clamp(0.0, 1.0);
        let (first, limit) = (f64::from(self.first.min(self.limit)), f64::from(self.limit));
        (first + (limit - first) * (1.0 - (1.0 - x).powi(2))).round() as u32
    }

    /// Expected number of Gaussians at the fraction `part` of the run, relative to the maximum. It is 1 for
    /// strategies that let the scene decide the number.
    pub fn share(&self, part: f64) -> f64 {
        match self.strategy {
            Strategy::Budget if self.first < self.limit => f64::from(self.budget_at(part)) / f64::from(self.limit),
            _ => 1.0,
        }
    }

    /// These options for Gaussians of which there are `count` at the fraction `part` of the run, and may be `limit` in the end.
    pub fn toward(&self, limit: u32, count: u32, part: f64) -> Self {
        let grown = DensityOptions { first: 0, limit: u32::MAX, ..*self }.share(part);
        let first = (f64::from(count) - grown * f64::from(limit)) / (1.0 - grown);
        DensityOptions { first: first.max(0.0).round() as u32, limit, ..*self }
    }

    /// Converts a number of steps to a fraction of the run.
    fn part(&self, steps: u32) -> f64 {
        f64::from(steps) / f64::from(self.iterations.max(1))
    }

    /// The refinements after step `step` (from 0), in order.
    fn events(&self, step: u32) -> Vec<Event> {
        if !(step + 1).is_multiple_of(self.interval()) {
            return Vec::new();
        }
        let (t, [begin, _, end]) = (self.part(step + 1), BUDGET_SPAN);
        let plain = Event { target: 0, nth: 0, most: 1.0, number: 2 * step };
        match self.strategy {
            // First move the dead Gaussians, then grow.
            Strategy::Mcmc if (500.0 / FULL_RUN..25_000.0 / FULL_RUN).contains(&t) => {
                vec![plain, Event { nth: GROWTH_NTH, number: 2 * step + 1, ..plain }]
            }
            Strategy::Adc if (500.0 / FULL_RUN..15_000.0 / FULL_RUN).contains(&t) => {
                let reset = ((step + 1) / self.interval()).is_multiple_of(30);
                vec![Event { target: self.limit, most: if reset { RESET_OPACITY } else { 1.0 }, ..plain }]
            }
            Strategy::Budget if (begin..end).contains(&t) => vec![Event { target: self.budget(step), ..plain }],
            _ => Vec::new(),
        }
    }

    /// Whether step `step` collects the scores of its view.
    fn scores(&self, step: u32) -> bool {
        match self.strategy {
            Strategy::Fixed | Strategy::Mcmc => false,
            Strategy::Adc => self.part(step) < 15_000.0 / FULL_RUN,
            Strategy::Budget => step.is_multiple_of(SCORED_NTH) && self.part(step) < BUDGET_SPAN[2],
        }
    }

    /// Learning rates of step `step`, derived from the `rates` of a base with a fixed number of Gaussians.
    pub fn rates(&self, rates: Rates, step: u32) -> Rates {
        match self.strategy {
            Strategy::Adc => rates,
            Strategy::Mcmc => {
                Rates { opacity: OPACITY_RATE, mean_opacity: MEAN_WEIGHT, mean_scale: MEAN_WEIGHT, ..rates }
            }
            Strategy::Fixed | Strategy::Budget => {
                let shorter = (FULL_RUN / f64::from(self.iterations.max(1))).max(1.0).powf(RATE_POWER);
                let (part, end) = (self.part(step), BUDGET_SPAN[2]);
                let late = LAST_RATE.powf(part);
                let left = SETTLED_RATE.powf(((part - end) / (1.0 - end)).clamp(0.0, 1.0));
                let settled = late * left;
                let times = |rate: f32, by: f64| (f64::from(rate) * by) as f32;
                Rates {
                    mean: times(rates.mean, MEAN_RATE * shorter),
                    log_scale: times(rates.log_scale, shorter * late),
                    quat: times(rates.quat, shorter * settled),
                    opacity: times(rates.opacity, settled),
                    dc: times(rates.dc, shorter * late),
                    sh: times(rates.sh, shorter * late),
                    newton: times(NEWTON_PART, left),
                    ..rates
                }
            }
        }
    }

    /// Turns 3DGS's initial Gaussians into those of the strategy.
    pub fn begin(&self, gaussians: &mut Gaussians) {
        let logit = |opacity: f32| (opacity / (1.0 - opacity)).ln();
        if self.strategy == Strategy::Mcmc {
            gaussians.opacities.fill(logit(FIRST_OPACITY));
            gaussians.log_scales.as_flattened_mut().iter_mut().for_each(|s| *s += FIRST_SCALE.ln());
        }
    }
}

buffers! {
    /// Buffers other than [`ByNumber`].
    struct DensityBuffers(limit: u32) {
        words: u32 = WORDS,
        args: u32 = 3,
        block_sums: u32 = block_sums_len(*limit),
        block_counts: u32 = block_counts_len(*limit, KEY_BITS),
        digit_totals: u32 = DIGIT_TOTALS,
    }
}

/// Lists by Gaussian number. A refinement runs after a step, so all of them reuse the memory of the step's
/// splats.
struct ByNumber {
    alive: Buffer<u32>,
    ranks: Buffer<u32>,
    keys: Buffer<u32>,
    sources: Buffer<u32>,
    copies: Buffer<u32>,
    sorted_keys: Buffer<u32>,
    sorted: Buffer<u32>,
    sorted_keys_1: Buffer<u32>,
    sorted_1: Buffer<u32>,
}

const KEY_BITS: u32 = 32;

struct Stages {
    image: density_image::Stage,
    score: density_score::Stage,
    weigh: density_weigh::Stage,
    scan: Scan,
    sort: RadixSort,
    plan: density_plan::Stage,
    draw: density_draw::Stage,
    place: density_place::Stage,
    rearrange: Rearrange,
    apply: density_apply::Stage,
    noise: density_noise::Stage,
}

/// Density control of a segment, with its pipelines and buffers.
pub struct Density {
    /// The segment whose Gaussians it prunes and multiplies.
    pub segment: Segment,
    options: DensityOptions,
    seed: u32,
    extent: f32,
    buffers: DensityBuffers,
    by_number: ByNumber,
    /// Sums over the views since the last refinement.
    pub scores: Planes,
    /// Gaussians after the last refinement; 0 before the first. In host memory.
    pub(super) told: Buffer<u32>,
    stages: Stages,
}

impl Density {
    /// For a `segment` of `model` with room for `options.limit` Gaussians, and the `raster` that all its steps
    /// use.
    ///
    /// # Errors
    /// [`Error::Usage`] if the segment has less room; otherwise an error of the device.
    pub fn new(
        session: &Session,
        model: &Model,
        segment: Segment,
        raster: &Raster,
        options: &DensityOptions,
    ) -> Result<Self> {
        let (context, limit) = (&session.context, options.limit);
        let part = model.part(segment);
        if part.capacity() < limit || limit == 0 {
            let (room, what) = (part.capacity(), segment.resource());
            return Err(Error::Usage(format!("there is room for {room} {what}, not for {limit}")));
        }
        let workgroup_size = context.info().workgroup(WORKGROUP);
        let strategy = options.strategy.kernel().unwrap_or(MCMC);
        let replacement = strategy == MCMC;
        let packed = session.policy.packed;
        let Between { quads, words } = raster.between_frames()?;
        let [alive, ranks, keys, sources, copies, sorted_keys, sorted, sorted_keys_1, sorted_1] = words;
        let told = Buffer::new(context, "told", 1, Location::Host)?;
        told.write_mapped(&[0]);
        Ok(Density {
            segment,
            options: *options,
            seed: session.seed as u32 ^ (session.seed >> 32) as u32,
            extent: session.extent,
            buffers: DensityBuffers::new(context, &part.capacity())?,
            by_number: ByNumber { alive, ranks, keys, sources, copies, sorted_keys, sorted, sorted_keys_1, sorted_1 },
            scores: Planes::zeroed(context, "scores", SCORES as usize, Location::Device, &part.pages)?,
            told,
            stages: Stages {
                image: density_image::Stage::new(context, &density_image::Spec { workgroup_size, terms: ERRORS })?,
                score: density_score::Stage::new(
                    context,
                    &density_score::Spec {
                        workgroup_size,
                        pulls: options.strategy == Strategy::Adc,
                        packed_records: packed,
                    },
                )?,
                weigh: density_weigh::Stage::new(context, &density_weigh::Spec { workgroup_size, strategy })?,
                scan: Scan::new(context, false)?,
                sort: RadixSort::new(context, KEY_BITS, Input::Keys)?,
                plan: density_plan::Stage::new(context, &density_plan::Spec { workgroup_size: 1, replacement })?,
                draw: density_draw::Stage::new(context, &density_draw::Spec { workgroup_size, replacement })?,
                place: density_place::Stage::new(context, &density_place::Spec { workgroup_size })?,
                rearrange: Rearrange::with(context, part.capacity(), quads)?,
                apply: density_apply::Stage::new(
                    context,
                    &density_apply::Spec {
                        workgroup_size,
                        strategy,
                        sh_beside: sh_moments(part.sh_degree, packed, options.strategy.is_newton()) as u32,
                        moments: moments_of(packed) as u32,
                    },
                )?,
                noise: density_noise::Stage::new(context, &density_noise::Spec { workgroup_size })?,
            },
        })
    }

    /// The options it was made with.
    pub fn options(&self) -> &DensityOptions {
        &self.options
    }

    /// Refines as in a run of `iterations` steps from now on.
    pub(super) fn replan(&mut self, iterations: u32) {
        self.options.iterations = iterations;
    }

    /// Writes the errors of the view that a step has just rendered over the raster's gradient records, for the
    /// scores of all segments, if this step collects scores of errors.
    pub(super) fn record_errors(
        &self,
        recorder: &mut Recorder,
        step: u32,
        seen: &Seen<'_>,
        (grid, batch): (&Grid, &Batch<'_>),
    ) {
        let Seen { model, views, view, raster, .. } = *seen;
        if self.options.scores(step) && self.options.strategy.follows_errors() {
            self.stages.image.record(
                recorder,
                &density_image::Buffers {
                    frames: &views.frames,
                    image: batch.image,
                    targets: batch.targets,
                    image_grad: &raster.buffers.image_grad,
                },
                &density_image::Push { frame: view },
                views.cameras[view as usize].pixels(),
            );
            raster.record_scores(recorder, grid, &views.frames, &model.population);
        }
    }

    /// Adds the scores of the view that a step has just rendered, if this step collects scores. The raster still
    /// holds its splats and lists.
    pub(super) fn record_scores(&self, recorder: &mut Recorder, step: u32, seen: &Seen<'_>) {
        if !self.options.scores(step) {
            return;
        }
        let Seen { model, views, view, raster, status, .. } = *seen;
        let camera = &views.cameras[view as usize];
        for (k, dispatch, page) in model.pages(self.segment) {
            self.stages.score.record_indirect(
                recorder,
                &bind!(density_score {
                    status,
                    scores: self.scores.page(k);
                    model => population;
                    raster.buffers => tile_counts, first_slot, splats;
                    raster.records => record_centres, record_shapes, record_colors, record_words;
                }),
                &density_score::Push {
                    segment: page.segment,
                    page_first: page.first,
                    stride: page.capacity,
                    by_gaussian: raster.by_gaussian().into(),
                    half_width: camera.width as f32 / 2.0,
                    half_height: camera.height as f32 / 2.0,
                },
                &model.population_args,
                dispatch,
            );
        }
    }

    /// Runs last in step `step`: adds noise, and runs the refinements that are due. `moments` move along with
    /// the Gaussians.
    pub(super) fn record(
        &self,
        recorder: &mut Recorder,
        model: &Model,
        moments: &Beside,
        rates: &Rates,
        step: u32,
        status: &Buffer<u32>,
    ) {
        if self.options.strategy == Strategy::Mcmc {
            self.record_noise(recorder, model, NOISE * rates.mean, step, status);
        }
        let events = self.options.events(step);
        for event in &events {
            self.record_event(recorder, model, moments, event, status);
        }
        if !events.is_empty() {
            recorder.copy(&model.segment_counts, self.segment as usize, &self.told, 0, 1);
        }
    }

    fn record_noise(&self, recorder: &mut Recorder, model: &Model, rate: f32, step: u32, status: &Buffer<u32>) {
        let part = model.part(self.segment);
        for (k, dispatch, page) in model.pages(self.segment) {
            self.stages.noise.record_indirect(
                recorder,
                &density_noise::Buffers { population: &model.population, status, geometry: part.geometry.page(k) },
                &density_noise::Push {
                    segment: page.segment,
                    page_first: page.first,
                    stride: page.capacity,
                    rate,
                    step,
                    seed: self.seed,
                },
                &model.population_args,
                dispatch,
            );
        }
    }

    fn record_event(
        &self,
        recorder: &mut Recorder,
        model: &Model,
        moments: &Beside,
        event: &Event,
        status: &Buffer<u32>,
    ) {
        let (b, n, seed) = (&self.buffers, &self.by_number, self.seed);
        let replacement = self.options.strategy == Strategy::Mcmc;
        let threads = self.stages.draw.workgroup_size();
        recorder.copy(&model.segment_counts, self.segment as usize, &b.words, OLD as usize, 1);
        recorder.fill(&n.copies, 0);
        self.record_weights(recorder, model, event);
        let extent = Extent {
            count: &b.words,
            index: OLD,
            args: &model.population_args,
            dispatch: model.blocks_dispatch(self.segment),
        };
        let scan = |values, offsets| ScanBuffers { values, index: None, block_sums: &b.block_sums, offsets };
        self.stages.scan.record(recorder, &scan(&n.alive, &n.ranks), extent, ALIVE);
        let order = if replacement {
            self.stages.scan.record(recorder, &scan(&n.keys, &n.sorted), extent, CANDIDATES);
            &n.sorted
        } else {
            let pairs = [
                Pairs { keys: &n.sorted_keys, values: &n.sorted },
                Pairs { keys: &n.sorted_keys_1, values: &n.sorted_1 },
            ];
            let scratch = RadixScratch { block_counts: &b.block_counts, digit_totals: &b.digit_totals };
            let input = Pairs { keys: &n.keys, values: &n.keys };
            self.stages.sort.record(recorder, input, pairs, scratch, extent, CANDIDATES).values
        };
        self.stages.plan.record(
            recorder,
            &density_plan::Buffers { status, words: &b.words, dispatch_args: &b.args },
            &density_plan::Push {
                capacity: self.options.limit,
                target: event.target,
                nth: event.nth,
                threads_per_group: threads,
            },
            1,
        );
        self.stages.draw.record_indirect(
            recorder,
            &density_draw::Buffers { words: &b.words, order, sources: &n.sources, copies: &n.copies },
            &density_draw::Push { step: event.number, seed },
            &b.args,
            0,
        );
        for (_, dispatch, page) in model.pages(self.segment) {
            self.stages.place.record_indirect(
                recorder,
                &density_place::Buffers { words: &b.words, alive: &n.alive, ranks: &n.ranks, sources: &n.sources },
                &density_place::Push { page_first: page.first, stride: page.capacity },
                &model.population_args,
                dispatch,
            );
        }
        let sources = Sources { sources: &n.sources, count: &b.words, index: NEW };
        self.stages.rearrange.record(recorder, model, self.segment, sources, &moments.all(), status);
        self.record_changes(recorder, model, moments, event, status);
    }

    /// Selects the Gaussians to keep, and weighs how much each should be multiplied.
    fn record_weights(&self, recorder: &mut Recorder, model: &Model, event: &Event) {
        let (n, seed, part) = (&self.by_number, self.seed, model.part(self.segment));
        for (k, dispatch, page) in model.pages(self.segment) {
            self.stages.weigh.record_indirect(
                recorder,
                &density_weigh::Buffers {
                    population: &model.population,
                    geometry: part.geometry.page(k),
                    scores: self.scores.page(k),
                    alive: &n.alive,
                    keys: &n.keys,
                },
                &density_weigh::Push {
                    segment: page.segment,
                    page_first: page.first,
                    stride: page.capacity,
                    capacity: part.capacity(),
                    least_opacity: LEAST_OPACITY,
                    least_score: LEAST_PULL,
                    step: event.number,
                    seed,
                },
                &model.population_args,
                dispatch,
            );
        }
    }

    /// Changes the parameters of copied and moved Gaussians.
    fn record_changes(
        &self,
        recorder: &mut Recorder,
        model: &Model,
        moments: &Beside,
        event: &Event,
        status: &Buffer<u32>,
    ) {
        let (b, n, seed, part) = (&self.buffers, &self.by_number, self.seed, model.part(self.segment));
        for (k, dispatch, page) in model.pages(self.segment) {
            self.stages.apply.record_indirect(
                recorder,
                &density_apply::Buffers {
                    population: &model.population,
                    status,
                    words: &b.words,
                    sources: &n.sources,
                    copies: &n.copies,
                    geometry: part.geometry.page(k),
                    geometry_moments: moments.geometry.page(k),
                    sh_moments: moments.sh.page(k),
                    lobe_moments: moments.lobes.page(k),
                    scores: self.scores.page(k),
                },
                &density_apply::Push {
                    segment: page.segment,
                    page_first: page.first,
                    stride: page.capacity,
                    small: CLONE_SCALE * self.extent,
                    most: event.most,
                    step: event.number,
                    seed,
                },
                &model.population_args,
                dispatch,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{pipelines::train::BaseOptions, scene::from_points};

    fn of(strategy: Strategy, iterations: u32) -> DensityOptions {
        DensityOptions { strategy, limit: 3000, first: 1000, iterations }
    }

    /// Steps with a refinement after them: their number, the first and the last.
    fn events(options: DensityOptions) -> (usize, u32, u32) {
        let all: Vec<u32> = (0..options.iterations).filter(|&step| !options.events(step).is_empty()).collect();
        (all.len(), all[0], all[all.len() - 1])
    }

    #[test]
    fn refinements_come_when_the_method_says() {
        assert_eq!(events(of(Strategy::Mcmc, 30_000)), (245, 499, 24_899));
        assert_eq!(events(of(Strategy::Adc, 30_000)), (145, 499, 14_899));
        assert_eq!(events(of(Strategy::Budget, 30_000)), (249, 599, 25_399));
        assert_eq!(events(of(Strategy::Budget, 1000)), (33, 24, 824));
        assert!((0..30_000).all(|step| of(Strategy::Fixed, 30_000).events(step).is_empty()));
        // MCMC moves dead Gaussians, then grows by a twentieth.
        let [moved, grown] = of(Strategy::Mcmc, 30_000).events(499)[..] else { panic!("two") };
        assert_eq!([(moved.target, moved.nth), (grown.target, grown.nth)], [(0, 0), (0, 20)]);
        assert!(moved.most == 1.0 && moved.number != grown.number);
        // ADC resets opacities at every 30th refinement.
        let resets = |step| of(Strategy::Adc, 30_000).events(step)[0].most;
        assert_eq!([2899, 2999, 3099, 5999].map(resets), [1.0, 0.01, 1.0, 0.01]);
        assert_eq!(of(Strategy::Adc, 30_000).events(499)[0].target, 3000);
        // At 0.31 of the run, half of the growth phase, the budget has added three quarters.
        assert_eq!(of(Strategy::Budget, 1000).budget(309), 2500);
        assert_eq!(of(Strategy::Budget, 1000).events(324)[0].target, of(Strategy::Budget, 1000).budget(324));
        let share = |strategy, part| of(strategy, 1000).share(part);
        assert_eq!(
            [0.0, 0.31, 0.6, 1.0].map(|part| (3000.0 * share(Strategy::Budget, part)) as u32),
            [1000, 2500, 3000, 3000]
        );
        assert_eq!(share(Strategy::Adc, 0.0), 1.0);
    }

    #[test]
    fn scores_are_looked_at_as_long_as_they_are_used() {
        let scored = |strategy| (0..1000).filter(|&step| of(strategy, 1000).scores(step)).collect::<Vec<u32>>();
        assert!(scored(Strategy::Fixed).is_empty() && scored(Strategy::Mcmc).is_empty());
        assert_eq!(scored(Strategy::Adc), (0..500).collect::<Vec<_>>());
        assert_eq!(scored(Strategy::Budget), (0..850).step_by(3).collect::<Vec<_>>());
    }

    #[test]
    fn each_strategy_has_the_rates_and_the_first_gaussians_of_the_method() {
        let at = |strategy, iterations, step| {
            let rates = BaseOptions { iterations, sh_degree: 3, ..Default::default() }.plan(2.0, step).rates;
            let found = of(strategy, iterations).rates(rates, step);
            let by_class = [found.mean, found.log_scale, found.quat, found.opacity, found.dc, found.sh];
            (by_class.map(f64::from), [found.mean_opacity, found.mean_scale])
        };
        let near = |found: [f64; 6], want: [f64; 6]| {
            found.iter().zip(want).for_each(|(f, w)| assert!((f / w - 1.0).abs() < 1e-5, "{found:?} and {want:?}"));
        };
        let plain = [3.2e-4, 5e-3, 1e-3, 0.025, 2.5e-3, 1.25e-4];
        let (rates, weights) = at(Strategy::Adc, 1000, 0);
        near(rates, plain);
        assert_eq!(weights, [0.0; 2]);
        let (rates, weights) = at(Strategy::Mcmc, 1000, 0);
        near(rates, [3.2e-4, 5e-3, 1e-3, 0.05, 2.5e-3, 1.25e-4]);
        assert_eq!(weights, [0.01; 2]);
        // A run of 1,000 steps is 30 times shorter: 30^0.2 = 1.97435; positions have twice that. All rates
        // but that of positions fall to 0.6 of it. Those of rotations and opacities also fall to a tenth:
        // halfway through that fall, at 0.925, the factor is √0.1 0.6^0.925 = 0.197147.
        let (rates, weights) = at(Strategy::Budget, 1000, 0);
        near(rates, [1.263584e-3, 9.87175e-3, 1.97435e-3, 0.025, 4.935875e-3, 2.467938e-4]);
        assert_eq!(weights, [0.0; 2]);
        let (rates, _) = at(Strategy::Budget, 1000, 1000);
        near(rates, [1.263584e-5, 5.92305e-3, 1.18461e-4, 0.0015, 2.961525e-3, 1.480763e-4]);
        let (rates, _) = at(Strategy::Budget, 1000, 925);
        for (found, want) in [(rates[2], 1.97435e-3 * 0.197147), (rates[3], 0.025 * 0.197147)] {
            assert!((found / want - 1.0).abs() < 1e-5, "{found} and {want}");
        }
        // Newton's fraction falls too.
        let newton = |step| of(Strategy::Budget, 1000).rates(Rates::default(), step).newton;
        for (step, want) in [(0, 0.02), (850, 0.02), (925, 0.02 * 0.1f32.sqrt()), (1000, 0.002)] {
            assert!((newton(step) / want - 1.0).abs() < 1e-5, "{step}: {}", newton(step));
        }
        near(at(Strategy::Budget, 30_000, 0).0, [6.4e-4, 5e-3, 1e-3, 0.025, 2.5e-3, 1.25e-4]);

        let first = from_points(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]], &[[9; 3]; 3], 0);
        let begun = |strategy| {
            let mut gaussians = first.clone();
            of(strategy, 1000).begin(&mut gaussians);
            let opacity = 1.0 / (1.0 + (-gaussians.opacities[0]).exp());
            (opacity, (gaussians.log_scales[0][0] - first.log_scales[0][0]).exp())
        };
        for (strategy, opacity, scale) in [
            (Strategy::Fixed, 0.1, 1.0),
            (Strategy::Adc, 0.1, 1.0),
            (Strategy::Mcmc, 0.5, 0.1),
            (Strategy::Budget, 0.1, 1.0),
        ] {
            let found = begun(strategy);
            assert!((found.0 - opacity).abs() < 1e-6 && (found.1 - scale).abs() < 1e-6, "{strategy:?}: {found:?}");
        }
    }
}
