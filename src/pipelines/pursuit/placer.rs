//! The stages of a placement: pipelines, buffers, and what each step of [`super::Pursuit`] records.

use super::{FEW_CANDIDATES, Kinds, PursuitOptions};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    pipelines::{
        lift::{Append, Lifts},
        model::{Model, Segment},
        plan::{bind, buffers},
        render::{Renderer, Show},
        session::Session,
        sort::{Extent, Input, Pairs, RadixScratch, RadixSort, Scan, ScanBuffers},
        views::{Views, view},
    },
    stages::{
        WORKGROUP,
        blocks::{DIGIT_TOTALS, block_counts_len, block_sums_len, items_per_group},
        constants::{
            constants::NONE,
            pursuit::{CELL, ERROR_BLOCK, LEVELS, SUMS, WIDTHS},
        },
        dispatch_args, pursuit_attenuate, pursuit_blur, pursuit_claim, pursuit_draw, pursuit_fit, pursuit_gain,
        pursuit_place, pursuit_quanta, pursuit_residual, pursuit_score, pursuit_sight,
        status::Resource,
        types::{Candidate, Fit, Frame, Lift, Plot, Texel, View},
    },
};

/// Words of `counts`.
const BLOCKS: u32 = 0;
const QUANTA: u32 = 1;
const CANDIDATES: u32 = 2;
pub(super) const KEPT: u32 = 3;
const PLACES: u32 = 4;
const PLACED: u32 = 5;
const SPENT: u32 = 6;
const COUNTS: usize = 7;

/// Maximum bytes of sums for a chunk of candidates.
const CHUNK_BYTES: u64 = 128 << 20;

/// Maximum share of the free memory for the errors of all views. The rest is for candidates and renders.
const ERRORS_SHARE: f64 = 0.75;

/// Numbers of `most` of `all` views, evenly spread.
fn spread(all: usize, most: usize) -> Vec<u32> {
    let count = most.min(all);
    (0..count).map(|i| (i * all / count) as u32).collect()
}

/// Texels of all levels, pixels and cells of a view.
fn sizes_of(frame: &Frame) -> [u64; 3] {
    let [width, height] = [frame.width, frame.height].map(u64::from);
    let level = |k: u32| width.div_ceil(1 << k) * height.div_ceil(1 << k);
    let cells = width.div_ceil(CELL.into()) * height.div_ceil(CELL.into());
    [(0..LEVELS).map(level).sum(), width * height, cells]
}

/// Working memory of a view, bytes: its part of the buffers of a [`Page`].
fn view_bytes(frame: &Frame) -> u64 {
    let [texels, pixels, cells] = sizes_of(frame);
    size_of::<Texel>() as u64 * texels + 12 * pixels + 4 * cells
}

/// Looked-at views that share one set of buffers for their pyramids.
pub(crate) struct Page {
    pub(crate) views: std::ops::Range<u32>,
    pub(crate) blocks: std::ops::Range<u32>,
    pub(crate) texels: Buffer<Texel>,
    pub(crate) surface_depths: Buffer<f32>,
    pub(crate) errors: Buffer<f32>,
    pub(crate) explained: Buffer<u32>,
    pub(crate) claims: Buffer<u32>,
}

/// Sizes of [`Work`].
pub(crate) struct Sizes {
    pixels: u32,
    blocks: u32,
    candidates: u32,
    words: u32,
    chunk_items: u32,
    most: u32,
}

buffers! {
    pub(crate) struct Work(o: Sizes) {
        /// Texels of one view before blurring.
        pub(crate) raw_texels: Texel = o.pixels,
        pub(crate) counts: u32 = COUNTS,
        pub(crate) args: u32 = 9,
        pub(crate) error_sums: f32 = o.blocks,
        /// Squared error, summed over channels, of each block.
        pub(crate) squares: f32 = o.blocks,
        pub(crate) quanta: u32 = o.blocks,
        pub(crate) quanta_firsts: u32 = o.blocks,
        pub(crate) block_sums: u32 = block_sums_len(o.blocks.max(o.candidates)),
        pub(crate) candidates: Candidate = o.candidates,
        pub(crate) fits: Fit = o.candidates,
        pub(crate) prices: u32 = o.candidates,
        /// By rank: total price of the candidates with a higher gain.
        pub(crate) spent: u32 = o.candidates,
        pub(crate) sums: f32 = o.chunk_items as usize * (WIDTHS * SUMS) as usize,
        pub(crate) gains: f32 = o.candidates,
        /// By candidate: a bit for each view in which its fit shows.
        pub(crate) sights: u32 = o.candidates as usize * o.words as usize,
        /// Squares of the gains in each view.
        pub(crate) gain_squares: f32 = o.candidates,
        pub(crate) beaten: u32 = o.candidates,
        pub(crate) gain_keys: u32 = o.candidates,
        pub(crate) sorted_keys: u32 = o.candidates,
        pub(crate) order: u32 = o.candidates,
        pub(crate) other_keys: u32 = o.candidates,
        pub(crate) other_order: u32 = o.candidates,
        pub(crate) radix_counts: u32 = block_counts_len(o.candidates, 32),
        pub(crate) digit_totals: u32 = DIGIT_TOTALS,
        pub(crate) lifts: Lift = o.most,
        pub(crate) lift_flags: u32 = o.most,
        pub(crate) plain_flags: u32 = o.most,
        pub(crate) ranks: u32 = o.most,
    }
}

/// Pipelines and buffers of a placement, made once.
pub(crate) struct Placer {
    session: Session,
    pub(super) options: PursuitOptions,
    /// Maximum number of Gaussians: that fit, and that may be placed now.
    pub(super) most: u32,
    pub(super) limit: u32,
    /// Prices in words, of a Gaussian with a lobe and of a plain one, and the budget for now; [`NONE`]:
    /// unlimited.
    pub(crate) prices: [u32; 2],
    pub(super) budget: u32,
    pub(crate) candidates: u32,
    /// Candidates per chunk.
    chunk: u32,
    pub(crate) worth: [f32; 2],
    /// Numbers of the looked-at views. All other fields count these only.
    looked: Vec<u32>,
    /// Their share of all views.
    pub(super) share: f32,
    views: Buffer<View>,
    frames: Buffer<Frame>,
    frame_list: Vec<Frame>,
    pub(crate) plots: Buffer<Plot>,
    plot_list: Vec<Plot>,
    pub(crate) pages: Vec<Page>,
    pub(crate) work: Work,
    stages: Stages,
}

struct Stages {
    residual: pursuit_residual::Stage,
    blur: [pursuit_blur::Stage; 2],
    quanta: pursuit_quanta::Stage,
    args: dispatch_args::Stage,
    scan: Scan,
    draw: pursuit_draw::Stage,
    score: pursuit_score::Stage,
    fit: pursuit_fit::Stage,
    sight: pursuit_sight::Stage,
    gain: pursuit_gain::Stage,
    claim: [pursuit_claim::Stage; 2],
    attenuate: pursuit_attenuate::Stage,
    sort: RadixSort,
    /// Scan of prices, in the order of gain.
    spend: Scan,
    place: pursuit_place::Stage,
    append: Append,
}

impl Stages {
    fn new(context: &Context) -> Result<Self, GpuError> {
        let workgroup_size = WORKGROUP;
        let blur = |halve| pursuit_blur::Stage::new(context, &pursuit_blur::Spec { workgroup_size, halve });
        let claim = |check| pursuit_claim::Stage::new(context, &pursuit_claim::Spec { workgroup_size, check });
        // A single workgroup sums over everything, with as many threads as a spine.
        let most = context.info().max_workgroup;
        let quanta = pursuit_quanta::Spec { workgroup_size: context.info().workgroup(256).min(most) };
        Ok(Stages {
            residual: pursuit_residual::Stage::new(context, &pursuit_residual::Spec { workgroup_size })?,
            blur: [blur(false)?, blur(true)?],
            quanta: pursuit_quanta::Stage::new(context, &quanta)?,
            args: dispatch_args::Stage::new(context, &dispatch_args::Spec { workgroup_size: 1 })?,
            scan: Scan::new(context, false)?,
            draw: pursuit_draw::Stage::new(context, &pursuit_draw::Spec { workgroup_size })?,
            score: pursuit_score::Stage::new(context, &pursuit_score::Spec { workgroup_size })?,
            fit: pursuit_fit::Stage::new(context, &pursuit_fit::Spec { workgroup_size })?,
            sight: pursuit_sight::Stage::new(context, &pursuit_sight::Spec { workgroup_size })?,
            gain: pursuit_gain::Stage::new(context, &pursuit_gain::Spec { workgroup_size })?,
            claim: [claim(false)?, claim(true)?],
            attenuate: pursuit_attenuate::Stage::new(context, &pursuit_attenuate::Spec { workgroup_size })?,
            sort: RadixSort::new(context, 32, Input::Keys)?,
            spend: Scan::new(context, true)?,
            place: pursuit_place::Stage::new(context, &pursuit_place::Spec { workgroup_size })?,
            append: Append::new(context)?,
        })
    }
}

/// Position of level k of a view: first texel, width, height.
fn level_of(plot: &Plot, width: u32, height: u32, k: u32) -> [u32; 3] {
    let mut level = [plot.texel_first, width, height];
    for j in 1..=k {
        level[0] += level[1] * level[2];
        level[1] = width.div_ceil(1 << j);
        level[2] = height.div_ceil(1 << j);
    }
    level
}

impl Placer {
    /// Pipelines and buffers to place at most `most` Gaussians over `views`, whose photographs must be uploaded.
    ///
    /// # Errors
    /// Errors of the device; [`Error::Usage`] for more views or pixels than 32 bits can count.
    pub(super) fn new(session: &Session, views: &Views, most: u32, options: PursuitOptions) -> Result<Self> {
        let context = &session.context;
        let bound = context.info().max_storage_bytes;
        let most_texels = u64::from(options.page.unwrap_or(u32::MAX)).min(bound / size_of::<Texel>() as u64);
        let (mut plot_list, mut pages) = (Vec::new(), Vec::new());
        let memory = context.memory();
        let free = memory.budget.saturating_sub(memory.taken);
        let free = free.saturating_sub(options.spare).max(free / 4);
        let each = views.frame_list.iter().map(view_bytes).sum::<u64>() as f64 / views.frame_list.len().max(1) as f64;
        let most_views =
            (ERRORS_SHARE * free as f64 / each).min(options.views.unwrap_or(u32::MAX).into()).max(1.0) as usize;
        let (all, looked) = (views.cameras.len(), spread(views.cameras.len(), most_views));
        if looked.len() < all && options.views.is_none() {
            let count = looked.len();
            tracing::warn!(
                "placing looks at {count} of {all} photos: memory does not hold the errors of all; use smaller images"
            );
        }
        let frame_list: Vec<Frame> = looked.iter().map(|&v| views.frame_list[v as usize]).collect();
        let view_list: Vec<View> = looked.iter().map(|&v| view(&views.cameras[v as usize], 0)).collect();
        let mut begin = (0usize, 0u32);
        let (mut texels, mut pixels, mut cells, mut blocks) = (0u64, 0u64, 0u64, 0u64);
        let make =
            |views: std::ops::Range<u32>, blocks, texels: u64, pixels: u64, cells: u64| -> Result<Page, GpuError> {
                let floats = |name: &str| Buffer::new(context, name, pixels as usize, Location::Device);
                Ok(Page {
                    views,
                    blocks,
                    texels: Buffer::new(context, "texels", texels as usize, Location::Device)?,
                    surface_depths: floats("surface_depths")?,
                    errors: floats("errors")?,
                    explained: Buffer::new(context, "explained", pixels as usize, Location::Device)?,
                    claims: Buffer::new(context, "claims", cells as usize, Location::Device)?,
                })
            };
        for (v, frame) in frame_list.iter().enumerate() {
            let [own, own_pixels, own_cells] = sizes_of(frame);
            if v > begin.0 && (texels + own > most_texels) {
                pages.push(make(begin.0 as u32..v as u32, begin.1..blocks as u32, texels, pixels, cells)?);
                begin = (v, blocks as u32);
                (texels, pixels, cells) = (0, 0, 0);
            }
            let first = Plot {
                texel_first: texels as u32,
                pixel_first: pixels as u32,
                cell_first: cells as u32,
                block_first: u32::try_from(blocks).map_err(|_| too_many())?,
            };
            plot_list.push(first);
            texels += own;
            pixels += own_pixels;
            cells += own_cells;
            blocks += own_pixels.div_ceil(ERROR_BLOCK.into());
        }
        let blocks = u32::try_from(blocks).map_err(|_| too_many())?;
        pages.push(make(begin.0 as u32..looked.len() as u32, begin.1..blocks, texels, pixels, cells)?);
        // One sort must hold all candidates.
        let words = looked.len().div_ceil(32) as u32;
        let largest = (bound / (size_of::<Candidate>() as u64).max(4 * u64::from(words))).min(1 << 26) as u32;
        let drawn = most.saturating_mul(options.draws);
        let candidates = drawn.saturating_mul(4).min(FEW_CANDIDATES).max(drawn).clamp(1, largest);
        let item_bytes = 4 * u64::from(WIDTHS * SUMS * options.sizes.max(1));
        let chunk_bytes = CHUNK_BYTES.min(bound).min(free / 8);
        let chunk = (chunk_bytes / item_bytes).max(1).min(u64::from(candidates)) as u32;
        let sizes = Sizes {
            pixels: views.max_pixels(),
            blocks,
            candidates,
            words,
            chunk_items: chunk * options.sizes.max(1),
            most: most.max(1),
        };
        let worth = match options.kinds {
            Kinds::Both => [options.lobe_worth, 1.0],
            Kinds::Lobes => [1.0, 0.0],
            Kinds::Plain => [0.0, 1.0],
        };
        Ok(Placer {
            session: session.clone(),
            options,
            most: most.max(1),
            limit: most,
            prices: [1; 2],
            budget: NONE,
            candidates,
            chunk,
            worth,
            views: Buffer::from_slice(context, "looked_views", &view_list)?,
            frames: Buffer::from_slice(context, "looked_frames", &frame_list)?,
            frame_list,
            share: looked.len() as f32 / views.cameras.len().max(1) as f32,
            looked,
            plots: Buffer::from_slice(context, "plots", &plot_list)?,
            plot_list,
            pages,
            work: Work::new(context, &sizes)?,
            stages: Stages::new(context)?,
        })
    }

    pub(super) fn blocks(&self) -> u32 {
        self.pages.last().map_or(0, |page| page.blocks.end)
    }

    /// Number of chunks of candidates.
    pub(super) fn fits(&self) -> u32 {
        self.candidates.div_ceil(self.chunk)
    }

    /// Number of choosing steps: one to draw, one per chunk, one for the sights, the rounds.
    pub(super) fn choices(&self) -> u32 {
        2 + self.fits() + self.options.rounds
    }

    fn pairs(&self) -> [Pairs<'_>; 2] {
        let w = &self.work;
        [Pairs { keys: &w.sorted_keys, values: &w.order }, Pairs { keys: &w.other_keys, values: &w.other_order }]
    }

    /// Keys and numbers of the candidates, sorted by gain.
    pub(super) fn sorted(&self) -> Pairs<'_> {
        self.pairs()[self.stages.sort.last_pair()]
    }

    /// Number of the looked-at views.
    pub(super) fn looks(&self) -> u32 {
        self.looked.len() as u32
    }

    /// Records the render of looked-at view `at`, its residual and pyramid.
    pub(super) fn record_look(
        &self,
        recorder: &mut Recorder,
        renderer: &Renderer,
        model: &Model,
        views: &Views,
        at: u32,
        status: &Buffer<u32>,
    ) -> Result<()> {
        let show = Show::all(model, self.session.background);
        renderer.record(recorder, model, views, self.looked[at as usize], &show, status)?;
        self.record_pyramid(recorder, views, at, &renderer.raster.buffers.image, &renderer.depths)
    }

    /// Records the residual of a rendered view, looked-at view `at`, and its pyramid.
    pub(crate) fn record_pyramid(
        &self,
        recorder: &mut Recorder,
        views: &Views,
        at: u32,
        image: &Buffer<[f32; 4]>,
        depths: &Buffer<f32>,
    ) -> Result<()> {
        let (w, Frame { width, height, .. }) = (&self.work, self.frame_list[at as usize]);
        let page = self.pages.iter().find(|page| page.views.contains(&at));
        let Some(page) = page else { return Err(too_many()) };
        let targets = views.record_photograph(recorder, self.looked[at as usize], None)?;
        self.stages.residual.record(
            recorder,
            &bind!(pursuit_residual {
                image, targets, depths,
                texels: &w.raw_texels;
                self => frames, plots;
                page => surface_depths, errors, explained;
                w => error_sums, squares;
            }),
            &pursuit_residual::Push { view: at },
            (width * height).div_ceil(ERROR_BLOCK),
        );
        let plot = &self.plot_list[at as usize];
        let mut from = [0, width, height];
        for k in 0..LEVELS {
            let to = level_of(plot, width, height, k);
            let push = pursuit_blur::Push {
                from_first: from[0],
                from_width: from[1],
                from_height: from[2],
                first: to[0],
                width: to[1],
                height: to[2],
            };
            // Each level is made from the one below, in the same buffer.
            let from_texels = if k == 0 { &w.raw_texels } else { &page.texels };
            let buffers = pursuit_blur::Buffers { from_texels, texels: &page.texels };
            self.stages.blur[usize::from(k > 0)].record(recorder, &buffers, &push, to[1] * to[2]);
            from = to;
        }
        Ok(())
    }

    fn record_args(&self, recorder: &mut Recorder, count_index: u32, items: u32, dispatch: u32, status: &Buffer<u32>) {
        let w = &self.work;
        self.stages.args.record(
            recorder,
            &dispatch_args::Buffers { count: &w.counts, dispatch_args: &w.args, status },
            &dispatch_args::Push {
                count_index,
                capacity: items,
                items_per_group: items_per_group(self.session.context.info()),
                args_index: 3 * dispatch,
                resource_index: Resource::Intersections.index(),
            },
            1,
        );
    }

    pub(crate) fn record_draw(&self, recorder: &mut Recorder, status: &Buffer<u32>) {
        let (w, s) = (&self.work, &self.stages);
        let count = self.blocks();
        self.record_args(recorder, BLOCKS, count, 0, status);
        self.record_args(recorder, CANDIDATES, self.candidates, 1, status);
        self.record_args(recorder, PLACES, self.most, 2, status);
        let buffers = pursuit_quanta::Buffers { error_sums: &w.error_sums, quanta: &w.quanta };
        s.quanta.record(recorder, &buffers, &pursuit_quanta::Push { count }, 1);
        let extent = Extent { count: &w.counts, index: BLOCKS, args: &w.args, dispatch: 0 };
        let scan = ScanBuffers { values: &w.quanta, index: None, block_sums: &w.block_sums, offsets: &w.quanta_firsts };
        s.scan.record(recorder, &scan, extent, QUANTA);
        recorder.fill(&w.candidates, NONE);
        for page in &self.pages {
            s.draw.record(
                recorder,
                &bind!(pursuit_draw {
                    quanta_total: &w.counts;
                    self => views, plots;
                    w => quanta_firsts, quanta, error_sums, candidates;
                    page => errors, surface_depths;
                }),
                &pursuit_draw::Push {
                    count: self.candidates,
                    seed: self.session.seed as u32,
                    view_first: page.views.start,
                    view_end: page.views.end,
                    view_count: self.looks(),
                    block_first: page.blocks.start,
                    block_end: page.blocks.end,
                    total_index: QUANTA,
                },
                self.candidates,
            );
        }
        recorder.fill(&w.gain_keys, NONE);
        // No candidate is out yet.
        recorder.fill(&w.gains, f32::MAX.to_bits());
    }

    pub(crate) fn record_fit(&self, recorder: &mut Recorder, chunk: u32) {
        let (w, s) = (&self.work, &self.stages);
        let first = chunk * self.chunk;
        let count = self.chunk.min(self.candidates - first);
        let PursuitOptions { sizes, first_size, size_ratio, .. } = self.options;
        for (k, page) in self.pages.iter().enumerate() {
            s.score.record(
                recorder,
                &bind!(pursuit_score {
                    self => views, plots;
                    page => surface_depths, texels;
                    w => candidates, sums;
                }),
                &pursuit_score::Push {
                    first,
                    count,
                    sizes,
                    first_size,
                    size_ratio,
                    view_first: page.views.start,
                    view_end: page.views.end,
                    begin: u32::from(k == 0),
                },
                count * sizes,
            );
        }
        let ([lobe_worth, plain_worth], [lobe_price, plain_price]) = (self.worth, self.prices);
        s.fit.record(
            recorder,
            &pursuit_fit::Buffers { candidates: &w.candidates, sums: &w.sums, fits: &w.fits, prices: &w.prices },
            &pursuit_fit::Push {
                first,
                count,
                sizes,
                first_size,
                size_ratio,
                lobe_worth,
                plain_worth,
                lobe_price,
                plain_price,
                doubt: self.options.doubt,
            },
            count,
        );
    }

    /// Words of [`Work::sights`] for each candidate.
    fn words(&self) -> u32 {
        self.looks().div_ceil(32)
    }

    pub(crate) fn record_sights(&self, recorder: &mut Recorder) {
        let (count, words) = (self.candidates, self.words());
        for (k, page) in self.pages.iter().enumerate() {
            self.stages.sight.record(
                recorder,
                &bind!(pursuit_sight {
                    self => views, plots;
                    page => surface_depths;
                    self.work => candidates, fits, sights;
                }),
                &pursuit_sight::Push {
                    count,
                    words,
                    view_first: page.views.start,
                    view_end: page.views.end,
                    begin: u32::from(k == 0),
                },
                count * words,
            );
        }
    }

    pub(crate) fn record_round(&self, recorder: &mut Recorder) {
        let (w, s) = (&self.work, &self.stages);
        let (count, words) = (self.candidates, self.words());
        for (k, page) in self.pages.iter().enumerate() {
            s.gain.record(
                recorder,
                &bind!(pursuit_gain {
                    self => views, plots;
                    page => surface_depths, texels, explained;
                    w => candidates, fits, gain_keys, gains, gain_squares, sights;
                }),
                &pursuit_gain::Push {
                    count,
                    view_first: page.views.start,
                    view_end: page.views.end,
                    begin: u32::from(k == 0),
                    last: u32::from(k + 1 == self.pages.len()),
                    caution: self.options.caution,
                    doubt: self.options.doubt,
                    words,
                },
                count,
            );
        }
        for check in [0, 1] {
            for (k, page) in self.pages.iter().enumerate() {
                if check == 0 {
                    recorder.fill(&page.claims, 0);
                }
                s.claim[check].record(
                    recorder,
                    &bind!(pursuit_claim {
                        self => views, plots;
                        page => surface_depths, claims;
                        w => candidates, fits, gains, beaten, sights;
                    }),
                    &pursuit_claim::Push {
                        count,
                        view_first: page.views.start,
                        view_end: page.views.end,
                        begin: u32::from(k == 0),
                        words,
                    },
                    count,
                );
            }
        }
        for (k, page) in self.pages.iter().enumerate() {
            s.attenuate.record(
                recorder,
                &bind!(pursuit_attenuate {
                    self => views, plots;
                    page => surface_depths, texels, explained;
                    w => candidates, fits, gains, beaten, gain_keys, sights;
                }),
                &pursuit_attenuate::Push {
                    count,
                    view_first: page.views.start,
                    view_end: page.views.end,
                    last: u32::from(k + 1 == self.pages.len()),
                    words,
                },
                count,
            );
        }
    }

    /// `budget` is in words; [`NONE`]: unlimited.
    pub(crate) fn record_place(&self, recorder: &mut Recorder, budget: u32) {
        let (w, s) = (&self.work, &self.stages);
        let [first, second] = self.pairs();
        let input = Pairs { keys: &w.gain_keys, values: &w.gain_keys };
        let scratch = RadixScratch { block_counts: &w.radix_counts, digit_totals: &w.digit_totals };
        let extent = Extent { count: &w.counts, index: CANDIDATES, args: &w.args, dispatch: 1 };
        let sorted = s.sort.record(recorder, input, [first, second], scratch, extent, KEPT);
        if budget != NONE {
            let extent = Extent { index: KEPT, ..extent };
            let (block_sums, offsets) = (&w.block_sums, &w.spent);
            let prices = ScanBuffers { values: &w.prices, index: Some(sorted.values), block_sums, offsets };
            s.spend.record(recorder, &prices, extent, SPENT);
        }
        s.place.record(
            recorder,
            &bind!(pursuit_place {
                kept: &w.counts,
                order: sorted.values;
                w => candidates, fits, gain_keys, lifts, lift_flags, plain_flags, prices, spent;
            }),
            &pursuit_place::Push {
                count: self.most,
                most: self.limit,
                budget,
                kept_index: KEPT,
                least_gain: self.options.least_gain * self.share,
            },
            self.most,
        );
    }

    pub(super) fn record_append(&self, recorder: &mut Recorder, model: &Model, status: &Buffer<u32>) {
        let (w, s) = (&self.work, &self.stages);
        for (segment, flags) in [(Segment::Base, &w.plain_flags), (Segment::Supplement, &w.lift_flags)] {
            let lifts = Lifts {
                lifts: &w.lifts,
                flags,
                ranks: &w.ranks,
                block_sums: &w.block_sums,
                extent: Extent { count: &w.counts, index: PLACES, args: &w.args, dispatch: 2 },
                total_index: PLACED,
                count: self.most,
            };
            s.append.record(recorder, segment, &lifts, model, status);
        }
    }
}

fn too_many() -> Error {
    Error::Usage("the views have more pixels than can be counted".into())
}
