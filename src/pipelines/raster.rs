//! Rasterises splats: depth order, tile lists, blending and its gradient.
//!
//! Splats come from a projection stage (`project` for scenes, `screen_project` for the screen phase). It fills `splats`,
//! `depth_keys` and `tile_counts`. One frame or many are rasterised by the same dispatches.

mod memory;
mod policy;

use std::mem;

pub(super) use memory::LIST_BYTES;
use memory::{DEPTH_BITS, DepthSorting, GaussianRecords, Isects, RasterParts, Sorting};
pub use memory::{RasterBuffers, RasterOptions, Records};
pub use policy::{Policy, Reduction, TileShape};

use super::{
    plan::{Held, Plan, bind},
    sort::{Extent, Input, Pairs, RadixScratch, RadixSort, Scan, ScanBuffers},
};
use crate::{
    error::{Error, Result},
    gpu::{Buffer, Context, DeviceInfo, GpuError, Kernel, Pipeline, Recorder, Unused},
    stages::{
        WORKGROUP, blend, blend_backward, blend_backward_atomic, blocks::items_per_group,
        constants::status::NO_RESOURCE, dispatch_args, emit, status::Resource, tile_ranges, types::Frame,
    },
};

/// The tiles of a batch of frames: every frame has the grid of the largest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid {
    /// Index of the first frame in `frames`.
    pub frame_first: u32,
    /// Frames, one after the other.
    pub frame_count: u32,
    /// Tiles across the largest frame.
    pub tiles_x: u32,
    /// Tiles down the largest frame.
    pub tiles_y: u32,
}

impl Grid {
    /// Grid of frames of at most `width` × `height` pixels.
    pub fn new(tile: TileShape, frame_first: u32, frame_count: u32, width: u32, height: u32) -> Self {
        Grid { frame_first, frame_count, tiles_x: width.div_ceil(tile.width), tiles_y: height.div_ceil(tile.height) }
    }

    /// Tiles of the largest frame; every frame has this number.
    pub fn tiles_per_frame(&self) -> u32 {
        self.tiles_x * self.tiles_y
    }

    /// Tiles of all frames.
    pub fn tiles(&self) -> u32 {
        self.frame_count * self.tiles_per_frame()
    }
}

/// Words of `count`.
const SPLATS: u32 = 0;
pub(crate) const VISIBLE: u32 = 1;
pub(crate) const ISECTS: u32 = 2;
const ISECTS_SORTED: u32 = 3;
/// Dispatches in `args`: block-wise stages over visible splats and intersections, and thread-wise ones over visible splats.
const VISIBLE_BLOCKS: u32 = 0;
const VISIBLE_THREADS: u32 = 1;
const ISECT_BLOCKS: u32 = 2;
/// Blend and its backward pass over listed tiles, for a batch.
const LISTED_TILES: u32 = 3;
/// The blend's backward pass: of gradients, and optionally of scores.
enum Backward {
    /// Records by intersection slot.
    Deterministic(blend_backward::Stage, Option<blend_backward::Stage>),
    /// Records by Gaussian.
    Atomic(blend_backward_atomic::Stage, Option<blend_backward_atomic::Stage>),
}

impl Backward {
    /// Makes the stages with the records' buffers.
    fn new(context: &Context, options: &RasterOptions, tile: TileShape) -> Result<(Self, Records), GpuError> {
        let deterministic = || {
            let records = Records::new(context, options)?;
            Ok((Self::stages(context, options, tile, false)?, records))
        };
        let atomic = || {
            let GaussianRecords { record_centres, record_shapes, record_colors } =
                GaussianRecords::new(context, options)?;
            let record_words = Unused::new(context)?.of();
            let records = Records { record_centres, record_shapes, record_colors, record_words };
            Ok((Self::stages(context, options, tile, true)?, records))
        };
        match options.policy.reduction {
            // guard: deterministic or nothing
            Reduction::Deterministic => deterministic(),
            Reduction::Atomic if !context.info().float_atomics => {
                Err(GpuError::Missing { device: context.info().name.clone(), feature: "float atomics".into() })
            }
            Reduction::Atomic => atomic(),
            Reduction::Auto => deterministic().or_else(|error| match error {
                // guard: atomics take over
                error if error.is_no_room() && context.info().float_atomics => {
                    tracing::warn!(
                        "no room for the gradients of {} intersections: float atomics add them up by Gaussian, so two runs \
                         will differ in their last digits",
                        options.isects
                    );
                    atomic()
                }
                error => Err(error),
            }),
        }
    }

    fn stages(context: &Context, options: &RasterOptions, tile: TileShape, atomic: bool) -> Result<Self, GpuError> {
        let (workgroup_size, unrolled) = (WORKGROUP, unrolled(context.info()));
        let (listed, packed_records) = (options.batch, options.packed());
        let TileShape { width: tile_width, height: tile_height, pixels } = tile;
        Ok(if atomic {
            let stage = |scores| {
                let spec = blend_backward_atomic::Spec {
                    workgroup_size,
                    tile_width,
                    tile_height,
                    pixels,
                    unrolled,
                    scores,
                    listed,
                };
                blend_backward_atomic::Stage::new(context, &spec)
            };
            Backward::Atomic(stage(false)?, options.scores.then(|| stage(true)).transpose()?)
        } else {
            let stage = |scores| {
                let spec = blend_backward::Spec {
                    workgroup_size,
                    tile_width,
                    tile_height,
                    pixels,
                    unrolled,
                    scores,
                    listed,
                    packed_records,
                };
                blend_backward::Stage::new(context, &spec)
            };
            Backward::Deterministic(stage(false)?, options.scores.then(|| stage(true)).transpose()?)
        })
    }
}

/// Lists by splat in memory that only frames use, free between frames.
#[cfg(feature = "train")]
pub(super) struct Between {
    pub quads: Buffer<[f32; 4]>,
    pub words: [Buffer<u32>; 9],
}

/// Pipelines of every raster; those of gradients are in [`Backward`].
struct Stages {
    depth_sort: RadixSort,
    tile_sort: RadixSort,
    scan: Scan,
    dispatch_args: dispatch_args::Stage,
    emit: emit::Stage,
    ranges: tile_ranges::Stage,
    blend: blend::Stage,
}

/// Working buffers and pipelines; made once for the largest scene, image and batch.
pub struct Raster {
    context: Context,
    options: RasterOptions,
    /// Tile shape.
    pub tile: TileShape,
    /// Buffers by Gaussian, by tile and by pixel. Those by intersection are separate and can grow.
    pub buffers: RasterBuffers,
    isects: Isects,
    sorting: Sorting,
    by_depth: DepthSorting,
    /// Gradient records; by Gaussian if [`Raster::by_gaussian`].
    pub records: Records,
    stages: Stages,
    backward: Option<Backward>,
    unused: Unused,
}

/// Whether blending and its backward pass unroll the loop over a subgroup's splats: on a CPU, branches cost
/// more than the computation.
fn unrolled(info: &DeviceInfo) -> bool {
    info.constant_lanes().is_some()
}

impl Raster {
    /// Makes the pipelines and buffers.
    ///
    /// # Errors
    /// [`GpuError::BufferTooLarge`] and [`GpuError::OverBudget`], see [`GpuError::is_no_room`], and errors of
    /// Vulkan.
    pub fn new(context: &Context, options: RasterOptions) -> Result<Self, GpuError> {
        let tile = options.policy.tile(context.info());
        let TileShape { width: tile_width, height: tile_height, pixels: lane_pixels } = tile;
        let workgroup_size = WORKGROUP;
        let blend_spec = blend::Spec {
            workgroup_size,
            tile_width,
            tile_height,
            pixels: lane_pixels,
            background_image: options.background_image,
            median: options.median,
            occluded: options.occluded,
            unrolled: unrolled(context.info()),
            direct: !options.backward,
            packed_splats: options.packed_splats,
            listed: options.batch,
        };
        let emit_spec = emit::Spec {
            workgroup_size,
            tile_width,
            tile_height,
            batch: options.batch,
            direct: !options.backward,
            packed_splats: options.packed_splats,
        };
        let (backward, records) = match options.backward {
            true => Backward::new(context, &options, tile).map(|(stage, records)| (Some(stage), records))?,
            false => (None, Records::new(context, &options)?),
        };
        let sorting = match backward {
            Some(Backward::Deterministic(..)) => Sorting::over(context, &options, &records)?,
            _ => Sorting::new(context, &options)?,
        };
        let unused = Unused::new(context)?;
        let mut raster = Raster {
            tile,
            buffers: RasterBuffers::new(context, &options)?,
            isects: Isects::new(context, &options)?,
            sorting,
            by_depth: DepthSorting::none(&unused),
            records,
            stages: Stages {
                depth_sort: RadixSort::new(context, DEPTH_BITS, Input::Keys)?,
                tile_sort: RadixSort::new(
                    context,
                    options.tile_bits(),
                    if options.backward { Input::Keys } else { Input::Some },
                )?,
                scan: Scan::new(context, true)?,
                dispatch_args: dispatch_args::Stage::new(context, &dispatch_args::Spec { workgroup_size: 1 })?,
                emit: emit::Stage::new(context, &emit_spec)?,
                ranges: tile_ranges::Stage::new(context, &tile_ranges::Spec { workgroup_size, listed: options.batch })?,
                blend: blend::Stage::new(context, &blend_spec)?,
            },
            backward,
            unused,
            context: context.clone(),
            options,
        };
        raster.by_depth = DepthSorting::over(&raster.parts())?;
        Ok(raster)
    }

    fn parts(&self) -> RasterParts<'_> {
        RasterParts {
            context: &self.context,
            options: &self.options,
            buffers: &self.buffers,
            isects: &self.isects,
            sorting: &self.sorting,
            last: self.stages.depth_sort.last_pair(),
            values: if self.stages.tile_sort.last_pair() == 0 { 2 } else { 3 },
        }
    }

    /// Buffers of a raster with these options, with records by intersection.
    pub fn plan(options: &RasterOptions) -> Plan {
        let own = RasterBuffers::plan(options).and(Isects::plan(options));
        match (options.backward, options.policy.reduction) {
            (true, Reduction::Auto | Reduction::Deterministic) => own.and(Records::plan(options)),
            (true, Reduction::Atomic) => own.and(Sorting::plan(options)).and(GaussianRecords::plan(options)),
            (false, _) => own.and(Sorting::plan(options)).and(Records::plan(options)),
        }
    }

    /// Lists all buffers except gradient records and those that alias others.
    pub fn held(&self) -> Vec<Held> {
        [self.buffers.held(), self.isects.held(), self.sorting.held()].concat()
    }

    /// The context that it was made on.
    pub fn context(&self) -> &Context {
        &self.context
    }

    /// Number of intersections that fit.
    pub fn capacity(&self) -> u32 {
        self.options.isects
    }

    /// Checks the room for a frame's splats and pixels; the device checks intersections.
    ///
    /// # Errors
    /// [`Error::Usage`] if they do not fit.
    pub(super) fn check(&self, splats: u32, width: u32, height: u32) -> Result<()> {
        let RasterOptions { splats: most_splats, pixels: most_pixels, tiles: most_tiles, .. } = self.options;
        let tiles = u64::from(width.div_ceil(self.tile.width)) * u64::from(height.div_ceil(self.tile.height));
        for (what, has, most) in [
            ("Gaussians", splats.into(), most_splats),
            ("pixels", u64::from(width) * u64::from(height), most_pixels),
            ("tiles", tiles, most_tiles),
        ] {
            if has > u64::from(most) {
                return Err(Error::Usage(format!("a view of {has} {what}, made for {most}")));
            }
        }
        Ok(())
    }

    /// Lists by splat are free between frames, so other lists reuse their memory. For a raster with a
    /// backward pass.
    #[cfg(feature = "train")]
    pub(super) fn between_frames(&self) -> Result<Between, GpuError> {
        let (context, f, len) = (&self.context, &self.buffers, self.options.splats as usize);
        let each = LIST_BYTES * u64::from(self.options.splat_room());
        let word = |k: usize| match k {
            // After the quads.
            0 | 1 => Buffer::over(context, "between", &f.splats, (4 + k as u64) * each, len),
            2..5 => Buffer::over(context, "between", &f.splat_colors, (k as u64 - 2) * each, len),
            5 => Buffer::over(context, "between", &f.depth_keys, 0, len),
            6 => Buffer::over(context, "between", &f.tile_counts, 0, len),
            7 => Buffer::over(context, "between", &f.first_slot, 0, len),
            _ => Buffer::over(context, "between", &f.global_from_rank, 0, len),
        };
        let [a, b, c, d, e, g, h, i, j] = [0, 1, 2, 3, 4, 5, 6, 7, 8].map(word);
        let words = [a?, b?, c?, d?, e?, g?, h?, i?, j?];
        Ok(Between { quads: Buffer::over(context, "between", &f.splats, 0, len)?, words })
    }

    /// Whether records are by Gaussian, accumulated by atomics.
    pub fn by_gaussian(&self) -> bool {
        matches!(self.backward, Some(Backward::Atomic(..)))
    }

    /// Whether records are by intersection and packed.
    pub fn packs_records(&self) -> bool {
        self.options.packed() && matches!(self.backward, Some(Backward::Deterministic(..)))
    }

    /// Makes the stages for [`Raster::record_scores`].
    pub fn make_scores(&mut self) -> Result<(), GpuError> {
        self.options.scores = true;
        let Some(backward) = &self.backward else { return Ok(()) };
        let atomic = matches!(backward, Backward::Atomic(..));
        self.backward = Some(Backward::stages(&self.context, &self.options, self.tile, atomic)?);
        Ok(())
    }

    /// Makes room for at least `needed` intersections, and a quarter more so that growth is rare, within the
    /// device's limits. Nothing of this raster may be in flight.
    pub fn grow(&mut self, needed: u32) -> Result<(), GpuError> {
        let (before, room) = (self.options.isects, self.room_for(needed));
        match self.grow_to(room) {
            Err(error) if error.is_no_room() && (before..room).contains(&needed) => self.grow_to(needed),
            grown => grown,
        }
    }

    fn room_for(&self, needed: u32) -> u32 {
        let most = |bytes| RasterOptions::most_isects(self.context.info(), bytes);
        // Keep the deterministic reduction while its records fit.
        let most = match self.options.backward && needed <= most(self.options.record_bytes()) {
            true => most(self.options.record_bytes()),
            false => most(LIST_BYTES),
        };
        // guard: room that stops growing
        needed.saturating_add(needed / 4).min(most).max(needed)
    }

    /// Makes room for exactly `isects` intersections.
    fn grow_to(&mut self, isects: u32) -> Result<(), GpuError> {
        let before = self.options.isects;
        self.options.isects = isects;
        // Lists that alias old buffers would keep their memory alive.
        self.by_depth = DepthSorting::none(&self.unused);
        let grown = self.remake();
        if grown.is_err() {
            // New lists have at least the old room. Records that made way are made again; if that fails, no
            // intersection fits any more.
            self.options.isects = before;
            let made_way = self.records.len() < before as usize;
            if let (Some(Backward::Deterministic(..)), true) = (&self.backward, made_way) {
                let again = Records::new(&self.context, &self.options);
                match again.and_then(|r| Sorting::over(&self.context, &self.options, &r).map(|sorting| (r, sorting))) {
                    Ok((records, sorting)) => (self.records, self.sorting) = (records, sorting),
                    Err(_) => self.options.isects = 0,
                }
            }
        }
        match DepthSorting::over(&self.parts()) {
            Ok(by_depth) => self.by_depth = by_depth,
            Err(error) => {
                self.options.isects = 0;
                return grown.and(Err(error));
            }
        }
        grown
    }

    /// [`Raster::grow`] ahead of time, for `needed` intersections that still fit. An error if it would give
    /// up the deterministic reduction.
    pub fn grow_early(&mut self, needed: u32) -> Result<(), GpuError> {
        let reduction = mem::replace(&mut self.options.policy.reduction, Reduction::Deterministic);
        let grown = self.grow(needed);
        self.options.policy.reduction = reduction;
        grown
    }

    /// Replaces all buffers by intersection, one by one: at most one is held twice at any time.
    fn remake(&mut self) -> Result<(), GpuError> {
        let (context, options) = (&self.context, &self.options);
        self.isects.remake(context, options)?;
        let Some(Backward::Deterministic(..)) = self.backward else { return self.sorting.remake(context, options) };
        // Free the old buffers first.
        self.sorting = Sorting::none(&self.unused);
        self.records = Records::new(context, &RasterOptions { backward: false, ..*options })?;
        let (stage, records) = Backward::new(context, options, self.tile)?;
        self.sorting = match stage {
            Backward::Deterministic(..) => Sorting::over(context, options, &records)?,
            Backward::Atomic(..) => Sorting::new(context, options)?,
        };
        (self.backward, self.records) = (Some(stage), records);
        Ok(())
    }

    /// Grid of one frame, or of several with the same maximum size.
    pub fn grid(&self, frame_first: u32, frame_count: u32, width: u32, height: u32) -> Grid {
        Grid::new(self.tile, frame_first, frame_count, width, height)
    }

    /// Sorts the splats by depth, lists their tiles, and sorts the list by tile, front to back in each.
    /// Raises `status` if the intersections do not fit. `splat_frames` is for a batch raster. May overwrite
    /// [`Raster::depth_keys`].
    pub fn record_order(
        &self,
        recorder: &mut Recorder,
        splats: Extent<'_>,
        grid: &Grid,
        frames: &Buffer<Frame>,
        splat_frames: Option<&Buffer<u32>>,
        status: &Buffer<u32>,
    ) {
        let per_block = items_per_group(self.context.info());
        let (f, isects, sorting, capacity) = (&self.buffers, &self.isects, &self.sorting, self.options.isects);
        let d = &self.by_depth;
        let (Some(depth_keys), 1..) = (self.depth_keys(), capacity) else {
            // Growing has failed, and the old buffers could not be made again.
            recorder.fill(&f.tile_ranges, 0);
            return;
        };
        let extent = |index, dispatch| Extent { count: &f.count, index, args: &f.args, dispatch };
        recorder.copy(splats.count, splats.index as usize, &f.count, SPLATS as usize, 1);
        let by_depth = self.stages.depth_sort.record(
            recorder,
            Pairs { keys: depth_keys, values: depth_keys },
            [
                Pairs { keys: &d.keys[0], values: &d.global_from_rank[0] },
                Pairs { keys: &d.keys[1], values: &d.global_from_rank[1] },
            ],
            RadixScratch { block_counts: &f.depth_block_counts, digit_totals: &f.digit_totals },
            Extent { args: splats.args, dispatch: splats.dispatch, ..extent(SPLATS, 0) },
            VISIBLE,
        );
        let global_from_rank = by_depth.values;
        let threads = self.context.info().workgroup(WORKGROUP);
        self.args_for(recorder, status, VISIBLE, self.options.splats, per_block, VISIBLE_BLOCKS);
        self.args_for(recorder, status, VISIBLE, self.options.splats, threads, VISIBLE_THREADS);
        self.stages.scan.record(
            recorder,
            &ScanBuffers {
                values: &f.tile_counts,
                index: Some(global_from_rank),
                block_sums: &f.block_sums,
                offsets: &d.rank_first_slot,
            },
            extent(VISIBLE, VISIBLE_BLOCKS),
            ISECTS,
        );
        self.args_for(recorder, status, ISECTS, capacity, per_block, ISECT_BLOCKS);

        // The last pass must write to `isect_slots`.
        let values = match self.stages.tile_sort.last_pair() {
            0 => [&isects.isect_slots, &sorting.isect_slots_1],
            _ => [&sorting.isect_slots_1, &isects.isect_slots],
        };
        let no_frames = self.unused.of();
        // Clear the marks of the slots' first entries.
        recorder.fill(&isects.rank_blocks, 0);
        self.stages.emit.record_indirect(
            recorder,
            &bind!(emit {
                frames, global_from_rank,
                splat_frames: splat_frames.unwrap_or(&no_frames),
                isect_globals: values[1];
                f => count, splats, packed_splats, tile_counts, first_slot;
                d => rank_first_slot;
                sorting => isect_tiles;
                isects => rank_blocks;
            }),
            &emit::Push {
                frame_first: grid.frame_first,
                tiles_x: grid.tiles_x,
                tiles_per_frame: grid.tiles_per_frame(),
                capacity,
                count_index: VISIBLE,
            },
            &f.args,
            VISIBLE_THREADS,
        );
        let by_tile = self.stages.tile_sort.record(
            recorder,
            Pairs { keys: &sorting.isect_tiles, values: values[1] },
            [
                Pairs { keys: &sorting.isect_keys, values: values[0] },
                Pairs { keys: &sorting.isect_tiles, values: values[1] },
            ],
            RadixScratch { block_counts: &isects.isect_block_counts, digit_totals: &f.digit_totals },
            extent(ISECTS, ISECT_BLOCKS),
            ISECTS_SORTED,
        );
        self.record_ranges(recorder, by_tile.keys, grid, status);
    }

    /// Finds the range of each tile's intersections, and for a batch the list of tiles to blend.
    fn record_ranges(&self, recorder: &mut Recorder, sorted_tiles: &Buffer<u32>, grid: &Grid, status: &Buffer<u32>) {
        let f = &self.buffers;
        if self.options.batch {
            recorder.fill(&f.tile_list_count, 0);
        }
        self.stages.ranges.record(
            recorder,
            &bind!(tile_ranges {
                isect_tiles: sorted_tiles;
                f => count, tile_ranges, tile_drawn, tile_list, tile_list_count;
            }),
            // guard: tiles counted in vain
            &tile_ranges::Push { count_index: ISECTS_SORTED, tile_count: grid.tiles() },
            grid.tiles(),
        );
        if self.options.batch {
            let info = self.context.info();
            let tiles_per_group = info.workgroup(WORKGROUP) / info.subgroup_size;
            let buffers = dispatch_args::Buffers { count: &f.tile_list_count, dispatch_args: &f.args, status };
            let push = dispatch_args::Push {
                count_index: 0,
                // The list has room for every tile.
                capacity: u32::MAX,
                items_per_group: tiles_per_group,
                args_index: 3 * LISTED_TILES,
                resource_index: NO_RESOURCE,
            };
            self.stages.dispatch_args.record(recorder, &buffers, &push, 1);
        }
    }

    /// For a batch: declares `image` stale, so that the next blend covers all tiles.
    pub fn record_forget(&self, recorder: &mut Recorder) {
        recorder.fill(&self.buffers.tile_drawn, 1);
    }

    /// Blends the ordered splats into `image`, and finds `median_ids` if enabled.
    pub fn record_blend(
        &self,
        recorder: &mut Recorder,
        grid: &Grid,
        frames: &Buffer<Frame>,
        background: [f32; 3],
        median_threshold: f32,
    ) {
        self.record_blend_occluded(recorder, grid, frames, background, median_threshold, [0.0, 1.0]);
    }

    /// [`Raster::record_blend`] with occlusion by `scene_depths`, whose values have the form `depth_form`.
    /// For a raster made `occluded`.
    pub fn record_blend_occluded(
        &self,
        recorder: &mut Recorder,
        grid: &Grid,
        frames: &Buffer<Frame>,
        background: [f32; 3],
        median_threshold: f32,
        depth_form: [f32; 2],
    ) {
        let f = &self.buffers;
        let buffers = bind!(blend {
            frames,
            global_from_rank: self.global_from_rank();
            f => tile_ranges, splats, splat_colors, packed_splats, backdrop, image, median_ids, depth_keys,
                scene_depths, tile_list, tile_list_count;
            self.isects => isect_slots, rank_blocks;
        });
        let push = blend::Push {
            frame_first: grid.frame_first,
            tiles_x: grid.tiles_x,
            tiles_per_frame: grid.tiles_per_frame(),
            tile_count: grid.tiles(),
            background,
            median_threshold,
            depth_form,
        };
        self.over_tiles(recorder, &self.stages.blend, &buffers, &push, grid);
    }

    /// Dispatches over all tiles, or over the listed ones for a batch.
    fn over_tiles<K: Kernel>(
        &self,
        recorder: &mut Recorder,
        stage: &Pipeline<K>,
        buffers: &K::Buffers<'_>,
        push: &K::Push,
        grid: &Grid,
    ) {
        match self.options.batch {
            true => stage.record_indirect(recorder, buffers, push, &self.buffers.args, LISTED_TILES),
            false => stage.record(recorder, buffers, push, grid.tiles()),
        }
    }

    /// Turns `image_grad` into gradient records. Gaussians of the first `frozen` segments only get the
    /// gradient of their opacity; `population` has the segments' ranges.
    pub fn record_blend_backward(
        &self,
        recorder: &mut Recorder,
        grid: &Grid,
        frames: &Buffer<Frame>,
        population: &Buffer<u32>,
        frozen: u32,
    ) {
        self.record_backward(recorder, grid, frames, population, frozen, false);
    }

    /// Sums the first two channels of `image_grad`, made by `density_image`, into the records' colors by
    /// blend weight. Requires [`Raster::make_scores`].
    pub fn record_scores(
        &self,
        recorder: &mut Recorder,
        grid: &Grid,
        frames: &Buffer<Frame>,
        population: &Buffer<u32>,
    ) {
        self.record_backward(recorder, grid, frames, population, 0, true);
    }

    fn record_backward(
        &self,
        recorder: &mut Recorder,
        grid: &Grid,
        frames: &Buffer<Frame>,
        population: &Buffer<u32>,
        frozen: u32,
        scores: bool,
    ) {
        let Some(backward) = &self.backward else { return };
        let (f, global_from_rank) = (&self.buffers, self.global_from_rank());
        let Isects { isect_slots, rank_blocks, .. } = &self.isects;
        let RasterBuffers { tile_ranges, tile_list, tile_list_count, splats, splat_colors, image, image_grad, .. } = f;
        let Records { record_centres, record_shapes, record_colors, record_words } = &self.records;
        let (frame_first, tiles_x, tiles_per_frame, tile_count) =
            (grid.frame_first, grid.tiles_x, grid.tiles_per_frame(), grid.tiles());
        // Splats that no pixel blends have no gradient: most of a long list behind an opaque front.
        // guard: sums begin at 0 (9 lines)
        if self.packs_records() {
            recorder.fill(record_words, 0);
        } else {
            recorder.fill(record_colors, 0);
            if !scores {
                recorder.fill(record_centres, 0);
                recorder.fill(record_shapes, 0);
            }
        }
        // The kernels differ in one buffer.
        macro_rules! reduce {
            ($kernel:ident, $all:ident, $of_scores:ident $(, $words:ident)?) => {{
                let Some(stage) = (if scores { $of_scores.as_ref() } else { Some($all) }) else { return };
                let buffers = $kernel::Buffers {
                    frames,
                    tile_ranges,
                    isect_slots,
                    rank_blocks,
                    global_from_rank,
                    splats,
                    splat_colors,
                    image,
                    image_grad,
                    population,
                    tile_list,
                    tile_list_count,
                    record_centres,
                    record_shapes,
                    record_colors,
                    $($words,)?
                };
                let push = $kernel::Push { frame_first, tiles_x, tiles_per_frame, tile_count, frozen };
                self.over_tiles(recorder, stage, &buffers, &push, grid);
            }};
        }
        match backward {
            Backward::Deterministic(all, of_scores) => reduce!(blend_backward, all, of_scores, record_words),
            Backward::Atomic(all, of_scores) => reduce!(blend_backward_atomic, all, of_scores),
        }
    }

    /// Bits of camera z by Gaussian index, [`NONE`](crate::stages::constants::constants::NONE) if not in the
    /// view. A projection fills them before [`Raster::record_order`], which keeps them only for gradients or
    /// occlusion. `None` if a failed growth left no lists: then nothing is projected.
    pub fn depth_keys(&self) -> Option<&Buffer<u32>> {
        match self.options.keeps_depths() {
            true => Some(&self.buffers.depth_keys),
            false => (self.options.isects > 0).then_some(&self.by_depth.keys[1]),
        }
    }

    /// Gaussian index by depth rank.
    pub(crate) fn global_from_rank(&self) -> &Buffer<u32> {
        &self.by_depth.global_from_rank[self.stages.depth_sort.last_pair()]
    }

    fn args_for(
        &self,
        recorder: &mut Recorder,
        status: &Buffer<u32>,
        count_index: u32,
        capacity: u32,
        items_per_group: u32,
        dispatch: u32,
    ) {
        let resource_index = match count_index {
            ISECTS => Resource::Intersections.index(),
            // Every splat has a place.
            _ => NO_RESOURCE,
        };
        self.stages.dispatch_args.record(
            recorder,
            &dispatch_args::Buffers { count: &self.buffers.count, dispatch_args: &self.buffers.args, status },
            &dispatch_args::Push { count_index, capacity, items_per_group, args_index: 3 * dispatch, resource_index },
            1,
        );
    }
}
