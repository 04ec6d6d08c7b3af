//! From splats to pixels and back: depth order, tile lists, blending and its gradient.
//!
//! Splats come from a projection stage (`project` for scenes, `plane_project` for the 2D stage), which fills `splats`,
//! `depth_keys` and `tile_counts`. One frame or many are rasterised by the same dispatches.

use super::sort::{Extent, Pairs, RadixScratch, RadixSort, Scan, ScanBuffers};
use crate::{
    gpu::{Buffer, Context, GpuError, Location, Recorder},
    stages::{
        blend::{self, Blend},
        blend_backward::{self, BlendBackward},
        blend_backward_atomic::{self, BlendBackwardAtomic},
        dispatch_args::{self, DispatchArgs},
        emit::{self, Emit},
        kernels,
        radix_upsweep::{block_counts_len, digit_totals_len},
        scan_reduce::{block_sums_len, items_per_group},
        step_done::OVERFLOW,
        tile_ranges::{self, TileRanges},
        types::{Frame, Splat},
    },
};

/// Floats of a gradient record, see ARCHITECTURE.md.
pub const RECORD: usize = kernels::constants::constants::RECORD as usize;

/// How a subgroup covers a tile; see `glsl/shared/tile.glsl` for what must hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TileShape {
    pub width: u32,
    pub height: u32,
    /// Pixels of a lane.
    pub pixels: u32,
}

impl TileShape {
    /// 8×8 for subgroups of 8 and 16 lanes, 8×16 for 32 and 64: a tile is one subgroup's work, and the cost of handing a
    /// splat round is shared by as many pixels as keep the list short.
    pub fn for_subgroup(lanes: u32) -> Self {
        let height = if lanes <= 16 { 8 } else { 16 };
        TileShape { width: 8, height, pixels: 8 * height / lanes }
    }

    /// Tiles of `width` × `height` pixels, where a subgroup of `lanes` lanes can cover them.
    pub fn new(width: u32, height: u32, lanes: u32) -> Option<Self> {
        let area = width.checked_mul(height)?;
        let fits = width > 0 && lanes.is_multiple_of(width) && area > 0 && area.is_multiple_of(lanes);
        // The pixels of a lane that are not finished are the bits of a word.
        (fits && area / lanes <= 32).then(|| TileShape { width, height, pixels: area / lanes })
    }

    /// The usual ones of those that subgroups of so many lanes can cover.
    pub fn choices(lanes: u32) -> Vec<Self> {
        [(8, 8), (8, 16), (16, 16)].into_iter().filter_map(|(width, height)| Self::new(width, height, lanes)).collect()
    }
}

impl std::fmt::Display for TileShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}×{}", self.width, self.height)
    }
}

/// The tiles of a batch of frames: each frame has the same grid, that of the largest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid {
    /// Index of the first frame in `frames`.
    pub frame_first: u32,
    pub frame_count: u32,
    pub tiles_x: u32,
    pub tiles_y: u32,
}

impl Grid {
    /// For frames of at most `width` × `height` pixels.
    pub fn new(tile: TileShape, frame_first: u32, frame_count: u32, width: u32, height: u32) -> Self {
        Grid { frame_first, frame_count, tiles_x: width.div_ceil(tile.width), tiles_y: height.div_ceil(tile.height) }
    }

    pub fn tiles_per_frame(&self) -> u32 {
        self.tiles_x * self.tiles_y
    }

    pub fn tiles(&self) -> u32 {
        self.frame_count * self.tiles_per_frame()
    }
}

/// How the gradient records of a Gaussian's intersections are added up.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Reduction {
    /// [`Reduction::Deterministic`] while its records fit the device; from then on [`Reduction::Atomic`], if the device can.
    #[default]
    Auto,
    /// In a fixed order, the same bits every run. Takes 36 bytes for each intersection.
    Deterministic,
    /// By float atomics in any order. Takes 36 bytes for each Gaussian.
    Atomic,
}

/// What a [`Raster`] must hold and do.
#[derive(Debug, Clone, Copy)]
pub struct RasterOptions {
    /// Splats that a projection stage fills.
    pub splats: u32,
    /// Pixels of all frames of the largest batch.
    pub pixels: u32,
    /// Tiles of the largest grid.
    pub tiles: u32,
    /// Intersections to begin with; [`Raster::grow`] makes room for more.
    pub isects: u32,
    /// Splats belong to many frames, `splat_frames` says to which.
    pub batch: bool,
    /// The background is an image, `backdrop`.
    pub background_image: bool,
    /// Also find the Gaussian of median depth of each pixel.
    pub median: bool,
    /// Gradients will be asked for.
    pub backward: bool,
    pub reduction: Reduction,
}

/// Words of `count`.
const SPLATS: u32 = 0;
pub(crate) const VISIBLE: u32 = 1;
pub(crate) const ISECTS: u32 = 2;
const ISECTS_SORTED: u32 = 3;
/// Slots of `args`: block-wise stages over splats, visible splats and intersections, and thread-wise stages.
const SPLAT_BLOCKS: u32 = 0;
const VISIBLE_BLOCKS: u32 = 1;
const VISIBLE_THREADS: u32 = 2;
const ISECT_BLOCKS: u32 = 3;
const ISECT_THREADS: u32 = 4;

/// Threads of a workgroup where the stage has no wish of its own.
pub const WORKGROUP: u32 = 64;

/// Buffers whose size depends on the number of intersections.
struct IsectBuffers {
    capacity: u32,
    tiles: Buffer<u32>,
    /// Sorting goes from `tiles` to `keys`, back, and so on; the values between these two.
    keys: Buffer<u32>,
    values: [Buffer<u32>; 2],
    global_from_slot: Buffer<u32>,
    block_counts: Buffer<u32>,
}

impl IsectBuffers {
    fn new(context: &Context, capacity: u32, digit_bits: u32) -> Result<Self, GpuError> {
        let n = capacity as usize;
        let words = |name: &str, len: usize| Buffer::new(context, name, len, Location::Device);
        Ok(IsectBuffers {
            capacity,
            tiles: words("isect tiles", n)?,
            keys: words("isect keys", n)?,
            values: [words("isect slots 0", n)?, words("isect slots 1", n)?],
            global_from_slot: words("global from slot", n)?,
            block_counts: words("isect block counts", block_counts_len(capacity, digit_bits))?,
        })
    }
}

/// The blend's backward pass.
enum Backward {
    /// Records by intersection slot.
    Deterministic(BlendBackward),
    /// Records by Gaussian.
    Atomic(BlendBackwardAtomic),
}

impl Backward {
    /// With the records' buffer, for so many intersections.
    fn new(
        context: &Context,
        options: &RasterOptions,
        tile: TileShape,
        isects: u32,
    ) -> Result<(Self, Buffer<f32>), GpuError> {
        let workgroup_size = WORKGROUP;
        let TileShape { width: tile_width, height: tile_height, pixels } = tile;
        let records = |name, count: u32| Buffer::new(context, name, count as usize * RECORD, Location::Device);
        let deterministic = || {
            let records = records("isect grads", isects)?;
            let spec = blend_backward::Spec { workgroup_size, tile_width, tile_height, pixels };
            Ok((Backward::Deterministic(BlendBackward::new(context, &spec)?), records))
        };
        let atomic = || {
            let records = records("splat grads", options.splats.max(1))?;
            let spec = blend_backward_atomic::Spec { workgroup_size, tile_width, tile_height, pixels };
            Ok((Backward::Atomic(BlendBackwardAtomic::new(context, &spec)?), records))
        };
        match options.reduction {
            Reduction::Deterministic => deterministic(),
            Reduction::Atomic if !context.info().float_atomics => {
                Err(GpuError::Missing { device: context.info().name.clone(), feature: "float atomics".into() })
            }
            Reduction::Atomic => atomic(),
            Reduction::Auto => deterministic().or_else(|error| match error {
                error if error.is_no_room() && context.info().float_atomics => {
                    tracing::warn!(
                        "no room for the gradients of {isects} intersections: float atomics add them up by Gaussian, so \
                         two runs will differ in their last digits"
                    );
                    atomic()
                }
                error => Err(error),
            }),
        }
    }
}

fn no_records(context: &Context) -> Result<Buffer<f32>, GpuError> {
    Buffer::new(context, "no records", 1, Location::Device)
}

/// Working buffers and pipelines; made once for the largest scene, image and batch.
pub struct Raster {
    context: Context,
    options: RasterOptions,
    pub tile: TileShape,
    pub splats: Buffer<Splat>,
    pub depth_keys: Buffer<u32>,
    pub tile_counts: Buffer<u32>,
    /// By Gaussian index: where its intersection slots begin. Valid where `tile_counts` is not 0.
    pub first_slot: Buffer<u32>,
    /// RGB with the background, and transmittance.
    pub image: Buffer<[f32; 4]>,
    pub image_grad: Buffer<f32>,
    pub backdrop: Buffer<[f32; 4]>,
    pub median_ids: Buffer<u32>,
    pub(crate) tile_ranges: Buffer<[u32; 2]>,
    pub(crate) count: Buffer<u32>,
    args: Buffer<u32>,
    depth_sorted: [(Buffer<u32>, Buffer<u32>); 2],
    rank_first_slot: Buffer<u32>,
    block_sums: Buffer<u32>,
    depth_block_counts: Buffer<u32>,
    digit_totals: Buffer<u32>,
    isects: IsectBuffers,
    depth_sort: RadixSort,
    tile_sort: RadixSort,
    scan: Scan,
    dispatch_args: DispatchArgs,
    emit: Emit,
    ranges: TileRanges,
    blend: Blend,
    backward: Option<Backward>,
    /// Gradient records: by Gaussian where [`Raster::by_gaussian`], else by intersection slot.
    pub records: Buffer<f32>,
}

impl Raster {
    pub fn new(context: &Context, options: RasterOptions) -> Result<Self, GpuError> {
        Self::with_tile(context, options, TileShape::for_subgroup(context.info().subgroup_size))
    }

    /// With tiles of a shape that [`TileShape::new`] gave for the device's subgroups.
    pub fn with_tile(context: &Context, options: RasterOptions, tile: TileShape) -> Result<Self, GpuError> {
        let (splats, pixels) = (options.splats.max(1) as usize, options.pixels as usize);
        let words = |name: &str, len: usize| Buffer::new(context, name, len, Location::Device);
        let pair = |i: usize| -> Result<_, GpuError> {
            Ok((words(&format!("depth keys {i}"), splats)?, words(&format!("global from rank {i}"), splats)?))
        };
        // A tile's number needs this many bits.
        let tile_bits = options.tiles.saturating_sub(1).checked_ilog2().map_or(1, |b| b + 1);
        let depth_sort = RadixSort::new(context, 32, true)?;
        let tile_sort = RadixSort::new(context, tile_bits, true)?;
        let digit_bits = depth_sort.digit_bits().max(tile_sort.digit_bits());
        let TileShape { width: tile_width, height: tile_height, pixels: lane_pixels } = tile;
        let workgroup_size = WORKGROUP;
        let blend_spec = blend::Spec {
            workgroup_size,
            tile_width,
            tile_height,
            pixels: lane_pixels,
            background_image: options.background_image,
            median: options.median,
        };
        let emit_spec = emit::Spec { workgroup_size, tile_width, tile_height, batch: options.batch };
        let (backward, records) = match options.backward {
            true => {
                Backward::new(context, &options, tile, options.isects.max(1)).map(|(stage, to)| (Some(stage), to))?
            }
            false => (None, no_records(context)?),
        };
        let raster = Raster {
            tile,
            splats: Buffer::new(context, "splats", splats, Location::Device)?,
            depth_keys: words("depth keys", splats)?,
            tile_counts: words("tile counts", splats)?,
            first_slot: words("first slot", splats)?,
            image: Buffer::new(context, "image", pixels, Location::Device)?,
            image_grad: Buffer::new(
                context,
                "image grad",
                if options.backward { 3 * pixels } else { 1 },
                Location::Device,
            )?,
            backdrop: Buffer::new(
                context,
                "backdrop",
                if options.background_image { pixels } else { 1 },
                Location::Device,
            )?,
            median_ids: words("median ids", if options.median { pixels } else { 1 })?,
            tile_ranges: Buffer::new(context, "tile ranges", options.tiles as usize, Location::Device)?,
            count: words("count", 4)?,
            args: words("dispatch args", 15)?,
            depth_sorted: [pair(0)?, pair(1)?],
            rank_first_slot: words("rank first slot", splats)?,
            block_sums: words("block sums", block_sums_len(splats as u32))?,
            depth_block_counts: words("depth block counts", block_counts_len(splats as u32, depth_sort.digit_bits()))?,
            digit_totals: words("digit totals", digit_totals_len(digit_bits))?,
            isects: IsectBuffers::new(context, options.isects.max(1), tile_sort.digit_bits())?,
            depth_sort,
            tile_sort,
            scan: Scan::new(context, true)?,
            dispatch_args: DispatchArgs::new(context)?,
            emit: Emit::new(context, &emit_spec)?,
            ranges: TileRanges::new(context, &tile_ranges::Spec { workgroup_size })?,
            blend: Blend::new(context, &blend_spec)?,
            backward,
            records,
            context: context.clone(),
            options,
        };
        Ok(raster)
    }

    pub fn context(&self) -> &Context {
        &self.context
    }

    /// Intersections that fit.
    pub fn capacity(&self) -> u32 {
        self.isects.capacity
    }

    /// Records are by Gaussian, added up by atomics.
    pub fn by_gaussian(&self) -> bool {
        matches!(self.backward, Some(Backward::Atomic(_)))
    }

    /// Makes room for at least `needed` intersections, and a quarter more so that growth is rare. Nothing of this raster may
    /// be in flight.
    pub fn grow(&mut self, needed: u32) -> Result<(), GpuError> {
        let capacity = needed.saturating_add(needed / 4);
        self.isects = IsectBuffers::new(&self.context, capacity, self.tile_sort.digit_bits())?;
        if let Some(Backward::Deterministic(_)) = self.backward {
            // What there was makes room for what comes.
            self.records = no_records(&self.context)?;
            let (stage, records) = Backward::new(&self.context, &self.options, self.tile, capacity)?;
            (self.backward, self.records) = (Some(stage), records);
        }
        Ok(())
    }

    /// The grid of one frame, or of several of the same largest size.
    pub fn grid(&self, frame_first: u32, frame_count: u32, width: u32, height: u32) -> Grid {
        Grid::new(self.tile, frame_first, frame_count, width, height)
    }

    /// Sorts the first `splats` splats by depth, lists their tiles and sorts the list by tile, front to back in each. Raises
    /// `status` where the intersections do not fit. `splat_frames` is read only by a batch raster; else any buffer will do.
    pub fn record_order(
        &self,
        recorder: &mut Recorder,
        splats: u32,
        grid: &Grid,
        frames: &Buffer<Frame>,
        splat_frames: &Buffer<u32>,
        status: &Buffer<u32>,
    ) {
        let per_block = items_per_group(self.context.info());
        let isects = &self.isects;
        let extent = |index, slot| Extent { count: &self.count, index, args: &self.args, slot };
        recorder.fill(&self.count, splats);
        self.args_for(recorder, status, SPLATS, splats, per_block, SPLAT_BLOCKS);
        let by_depth = self.depth_sort.record(
            recorder,
            Pairs { keys: &self.depth_keys, values: &self.depth_keys },
            [0, 1].map(|i| Pairs { keys: &self.depth_sorted[i].0, values: &self.depth_sorted[i].1 }),
            RadixScratch { block_counts: &self.depth_block_counts, digit_totals: &self.digit_totals },
            extent(SPLATS, SPLAT_BLOCKS),
            VISIBLE,
        );
        let global_from_rank = by_depth.values;
        self.args_for(recorder, status, VISIBLE, splats, per_block, VISIBLE_BLOCKS);
        self.args_for(recorder, status, VISIBLE, splats, self.context.info().workgroup(WORKGROUP), VISIBLE_THREADS);
        self.scan.record(
            recorder,
            &ScanBuffers {
                values: &self.tile_counts,
                index: Some(global_from_rank),
                block_sums: &self.block_sums,
                offsets: &self.rank_first_slot,
            },
            extent(VISIBLE, VISIBLE_BLOCKS),
            ISECTS,
        );
        self.args_for(recorder, status, ISECTS, isects.capacity, per_block, ISECT_BLOCKS);
        self.args_for(recorder, status, ISECTS, isects.capacity, WORKGROUP, ISECT_THREADS);

        self.emit.record(
            recorder,
            &emit::Buffers {
                frames,
                count: &self.count,
                global_from_rank,
                rank_first_slot: &self.rank_first_slot,
                splats: &self.splats,
                tile_counts: &self.tile_counts,
                splat_frames,
                isect_tiles: &isects.tiles,
                global_from_slot: &isects.global_from_slot,
                first_slot: &self.first_slot,
            },
            &emit::Push {
                frame_first: grid.frame_first,
                tiles_x: grid.tiles_x,
                tiles_per_frame: grid.tiles_per_frame(),
                capacity: isects.capacity,
                count_index: VISIBLE,
            },
            &self.args,
            VISIBLE_THREADS,
        );
        let by_tile = self.tile_sort.record(
            recorder,
            Pairs { keys: &isects.tiles, values: &isects.tiles },
            [
                Pairs { keys: &isects.keys, values: &isects.values[0] },
                Pairs { keys: &isects.tiles, values: &isects.values[1] },
            ],
            RadixScratch { block_counts: &isects.block_counts, digit_totals: &self.digit_totals },
            extent(ISECTS, ISECT_BLOCKS),
            ISECTS_SORTED,
        );
        self.ranges.record(
            recorder,
            &tile_ranges::Buffers { count: &self.count, isect_tiles: by_tile.keys, tile_ranges: &self.tile_ranges },
            &tile_ranges::Push { count_index: ISECTS_SORTED },
            &self.args,
            ISECT_THREADS,
        );
    }

    /// Blends the ordered splats into `image`; also `median_ids` where that was asked for.
    pub fn record_blend(
        &self,
        recorder: &mut Recorder,
        grid: &Grid,
        frames: &Buffer<Frame>,
        background: [f32; 3],
        median_threshold: f32,
    ) {
        self.record_blend_by(&self.blend, recorder, grid, frames, background, median_threshold);
    }

    /// The same by a stage of the caller's, made for this raster's tiles.
    pub fn record_blend_by(
        &self,
        stage: &Blend,
        recorder: &mut Recorder,
        grid: &Grid,
        frames: &Buffer<Frame>,
        background: [f32; 3],
        median_threshold: f32,
    ) {
        stage.record(
            recorder,
            &blend::Buffers {
                frames,
                tile_ranges: &self.tile_ranges,
                isect_slots: self.isect_slots(),
                global_from_slot: &self.isects.global_from_slot,
                splats: &self.splats,
                backdrop: &self.backdrop,
                image: &self.image,
                median_ids: &self.median_ids,
            },
            &blend::Push {
                frame_first: grid.frame_first,
                tiles_x: grid.tiles_x,
                tiles_per_frame: grid.tiles_per_frame(),
                tile_count: grid.tiles(),
                background,
                median_threshold,
            },
        );
    }

    /// Turns `image_grad` into gradient records. Gaussians below `full_first` get the gradient of their opacity only.
    pub fn record_blend_backward(&self, recorder: &mut Recorder, grid: &Grid, frames: &Buffer<Frame>, full_first: u32) {
        let Some(backward) = &self.backward else { return };
        let (frame_first, tiles_x, tiles_per_frame, tile_count) =
            (grid.frame_first, grid.tiles_x, grid.tiles_per_frame(), grid.tiles());
        // What no pixel blends has no gradient: most of a long list that is opaque in front.
        recorder.fill(&self.records, 0);
        match backward {
            Backward::Deterministic(stage) => stage.record(
                recorder,
                &blend_backward::Buffers {
                    frames,
                    tile_ranges: &self.tile_ranges,
                    isect_slots: self.isect_slots(),
                    global_from_slot: &self.isects.global_from_slot,
                    splats: &self.splats,
                    image: &self.image,
                    image_grad: &self.image_grad,
                    isect_grads: &self.records,
                },
                &blend_backward::Push { frame_first, tiles_x, tiles_per_frame, tile_count, full_first },
            ),
            Backward::Atomic(stage) => stage.record(
                recorder,
                &blend_backward_atomic::Buffers {
                    frames,
                    tile_ranges: &self.tile_ranges,
                    isect_slots: self.isect_slots(),
                    global_from_slot: &self.isects.global_from_slot,
                    splats: &self.splats,
                    image: &self.image,
                    image_grad: &self.image_grad,
                    splat_grads: &self.records,
                },
                &blend_backward_atomic::Push { frame_first, tiles_x, tiles_per_frame, tile_count, full_first },
            ),
        }
    }

    /// Gaussian index by depth rank.
    pub(crate) fn global_from_rank(&self) -> &Buffer<u32> {
        &self.depth_sorted[self.depth_sort.last_pair()].1
    }

    /// Tiles of the sorted intersections.
    pub(crate) fn isect_tiles(&self) -> &Buffer<u32> {
        [&self.isects.keys, &self.isects.tiles][self.tile_sort.last_pair()]
    }

    pub(crate) fn isect_slots(&self) -> &Buffer<u32> {
        &self.isects.values[self.tile_sort.last_pair()]
    }

    pub(crate) fn global_from_slot(&self) -> &Buffer<u32> {
        &self.isects.global_from_slot
    }

    fn args_for(
        &self,
        recorder: &mut Recorder,
        status: &Buffer<u32>,
        count_index: u32,
        capacity: u32,
        items_per_group: u32,
        slot: u32,
    ) {
        self.dispatch_args.record(
            recorder,
            &dispatch_args::Buffers { count: &self.count, dispatch_args: &self.args, status },
            &dispatch_args::Push {
                count_index,
                capacity,
                items_per_group,
                args_index: 3 * slot,
                status_index: OVERFLOW as u32,
            },
        );
    }
}
