//! What a raster holds, and what lies in whose memory.

use crate::{
    gpu::{Buffer, Context, DeviceInfo, GpuError, Unused},
    pipelines::{plan::buffers, session::Policy},
    stages::{
        blocks::{DIGIT_TOTALS, block_counts_len, block_sums_len},
        constants::slots::SLOTS_PER_BLOCK,
        types::{PackedSplat, Splat},
    },
};

/// What a [`Raster`](super::Raster) must hold and do.
#[derive(Debug, Clone, Copy)]
pub struct RasterOptions {
    /// Splats that a projection stage fills.
    pub splats: u32,
    /// Pixels of all frames of the largest batch.
    pub pixels: u32,
    /// Tiles of the largest grid.
    pub tiles: u32,
    /// Intersections to begin with; [`Raster::grow`](super::Raster::grow) makes room for more.
    pub isects: u32,
    /// Splats belong to many frames, `splat_frames` says to which.
    pub batch: bool,
    /// The background is an image, `backdrop`.
    pub background_image: bool,
    /// Also find the Gaussian of median depth of each pixel.
    pub median: bool,
    /// What lies behind `scene_depths` is not seen.
    pub occluded: bool,
    /// Gradients will be asked for.
    pub backward: bool,
    /// And sums by blend weight, see [`Raster::record_scores`](super::Raster::record_scores).
    pub scores: bool,
    /// Splats and their colours are packed: 28 bytes in place of 36. Not where gradients are asked for, nor batches.
    pub packed_splats: bool,
    /// Which variants run; of it, the reduction, whether records are packed, and the tile.
    pub policy: Policy,
}

impl RasterOptions {
    /// Bits of a tile's number.
    pub(super) fn tile_bits(&self) -> u32 {
        self.tiles.saturating_sub(1).checked_ilog2().map_or(1, |b| b + 1)
    }

    pub(super) fn only_if(&self, what: bool, elements: u32) -> u32 {
        if what { elements } else { 1 }
    }

    /// Gradient records of intersections are packed: of all but batches, whose reader knows them as floats only.
    pub(super) fn packed(&self) -> bool {
        self.policy.packed && !self.batch
    }

    /// Elements of each buffer of gradient records by intersection.
    pub(super) fn records(&self, packed: bool) -> u32 {
        self.only_if(self.backward && self.packed() == packed, self.room())
    }

    /// Intersections of which a device binds a list with so many bytes for each.
    pub(in crate::pipelines) fn most_isects(device: &DeviceInfo, bytes: u64) -> u32 {
        let whole = |isects: u64| isects / u64::from(LIST_ALIGNMENT) * u64::from(LIST_ALIGNMENT);
        whole((device.max_storage_bytes / bytes).min(u32::MAX.into())) as u32
    }

    /// Elements of lists by intersection: as many as there are, and as splats, which are sorted in the same memory before; rounded up so
    /// that lists that share memory begin where a device lets buffers begin.
    pub(super) fn room(&self) -> u32 {
        aligned(self.isects.max(self.splats))
    }

    /// Elements of splats as floats, whose memory serves something else between frames of a raster that learns.
    pub(super) fn splat_room(&self) -> u32 {
        if self.backward { aligned(self.splats) } else { self.only_if(!self.packed_splats, self.splats) }
    }

    /// Depths are asked for after they are sorted: what hides splats compares them, and between steps their memory serves something else.
    pub(super) fn keeps_depths(&self) -> bool {
        self.backward || self.occluded
    }

    /// Bytes of the widest of an intersection's gradient records.
    pub(super) fn record_bytes(&self) -> u64 {
        if self.packed() { 16 } else { 12 }
    }
}

pub(super) fn aligned(elements: u32) -> u32 {
    elements.checked_next_multiple_of(LIST_ALIGNMENT).unwrap_or(elements)
}

/// Bits of a depth key.
pub(super) const DEPTH_BITS: u32 = 32;
/// Bytes of an intersection in a list that is sorted.
pub(in crate::pipelines) const LIST_BYTES: u64 = 4;
/// Words: 256 bytes, where every driver at hand lets a buffer begin in memory. Else [`Buffer::over`] takes memory of its own.
pub(super) const LIST_ALIGNMENT: u32 = 64;

buffers! {
    /// What is by splat, by pixel and by tile.
    pub struct RasterBuffers(o: RasterOptions) {
        /// By Gaussian index, where `tile_counts` is not 0.
        pub splats: Splat = o.splat_room(),
        /// sRGB, ≥ 0.
        pub splat_colours: [f32; 3] = o.splat_room(),
        /// Both in one, where that was asked for.
        pub packed_splats: PackedSplat = o.only_if(o.packed_splats, o.splats),
        /// Bits of camera z; [`NONE`](crate::stages::constants::constants::NONE): not in this view. Where nobody asks for them when they
        /// are sorted, they lie in the lists by intersection, see [`Raster::depth_keys`](super::Raster::depth_keys).
        pub depth_keys: u32 = o.only_if(o.keeps_depths(), o.splats),
        /// Tiles that a splat touches.
        pub tile_counts: u32 = o.splats,
        /// By Gaussian index: where its intersection slots, and with them its gradient records, begin. Valid where `tile_counts` is not 0.
        pub first_slot: u32 = o.only_if(o.backward, o.splats),
        /// RGB with the background, and transmittance.
        pub image: [f32; 4] = o.pixels,
        /// ∂loss/∂RGB by pixel, interleaved.
        pub image_grad: f32 = 3 * u64::from(o.only_if(o.backward, o.pixels)),
        /// RGB and transmittance of what lies behind all splats.
        pub backdrop: [f32; 4] = o.only_if(o.background_image, o.pixels),
        /// Gaussian index of each pixel's median; NONE: none.
        pub median_ids: u32 = o.only_if(o.median, o.pixels),
        /// By pixel, as a depth buffer has them.
        pub scene_depths: f32 = o.only_if(o.occluded, o.pixels),
        pub(crate) tile_ranges: [u32; 2] = o.tiles,
        pub(crate) count: u32 = 4,
        pub(super) args: u32 = 12,
        /// Of a batch: whether a tile's pixels show splats, or what nobody knows.
        pub(crate) tile_drawn: u32 = o.only_if(o.batch, o.tiles),
        /// Of a batch: which tiles are blended, in any order, and how many.
        pub(crate) tile_list: u32 = o.only_if(o.batch, o.tiles),
        /// See `tile_list`.
        pub(crate) tile_list_count: u32 = 1,
        pub(super) global_from_rank: u32 = o.only_if(o.backward, o.splats),
        pub(super) block_sums: u32 = block_sums_len(o.splats),
        pub(super) depth_block_counts: u32 = block_counts_len(o.splats, DEPTH_BITS),
        pub(super) digit_totals: u32 = DIGIT_TOTALS,
    }
}

buffers! {
    /// What is by intersection, while the view is blended and after. In `isect_slots` sorting ends; where gradients are asked for it sorts
    /// slots, as records lie by slot, and `rank_blocks` says whose they are; else Gaussian indices.
    pub(super) struct Isects(o: RasterOptions) {
        pub(super) isect_slots: u32 = o.room(),
        pub(super) rank_blocks: [u32; 2] = o.only_if(o.backward, o.isects.div_ceil(SLOTS_PER_BLOCK)),
        pub(super) isect_block_counts: u32 = block_counts_len(o.isects, o.tile_bits()),
    }
}

buffers! {
    /// What is by intersection until they are sorted. Sorting goes from `isect_tiles` to `isect_keys`, back, and so on.
    pub(super) struct Sorting(o: RasterOptions) {
        pub(super) isect_tiles: u32 = o.room(),
        pub(super) isect_keys: u32 = o.room(),
        pub(super) isect_slots_1: u32 = o.room(),
    }
}

impl Sorting {
    /// In the memory of records by intersection, which are written when all is sorted.
    pub(super) fn over(context: &Context, options: &RasterOptions, records: &Records) -> Result<Self, GpuError> {
        let list = |name, place: u64| {
            let (first, len) = (place * LIST_BYTES * u64::from(options.room()), options.room() as usize);
            match options.packed() {
                true => Buffer::over(context, name, &records.record_words, first, len),
                false => Buffer::over(context, name, &records.record_shapes, first, len),
            }
        };
        Ok(Sorting {
            isect_tiles: list("isect_tiles", 0)?,
            isect_keys: list("isect_keys", 1)?,
            isect_slots_1: list("isect_slots_1", 2)?,
        })
    }

    /// Nothing.
    pub(super) fn none(unused: &Unused) -> Self {
        Sorting { isect_tiles: unused.of(), isect_keys: unused.of(), isect_slots_1: unused.of() }
    }
}

buffers! {
    /// Gradient records, by intersection slot. Until the backward pass their memory may be what sorting works in.
    pub struct Records(o: RasterOptions) {
        /// Σ g w_u, Σ g w_v, Σ ∂loss/∂opacity.
        pub record_centres: [f32; 3] = o.records(false),
        /// Σ g w_u², Σ g w_u w_v, Σ g w_v².
        pub record_shapes: [f32; 3] = o.records(false),
        /// ∂loss/∂rgb.
        pub record_colours: [f32; 3] = o.records(false),
        /// All of these in four words, where they are packed (`glsl/shared/packed_record.glsl`).
        pub record_words: [u32; 4] = o.records(true),
    }
}

impl Records {
    /// How many of either kind there are.
    pub(super) fn len(&self) -> usize {
        self.record_centres.len().max(self.record_words.len())
    }
}

buffers! {
    /// Gradient records added up by Gaussian.
    pub(super) struct GaussianRecords(o: RasterOptions) {
        pub(super) record_centres: [f32; 3] = o.only_if(o.backward, o.splats),
        pub(super) record_shapes: [f32; 3] = o.only_if(o.backward, o.splats),
        pub(super) record_colours: [f32; 3] = o.only_if(o.backward, o.splats),
    }
}

/// What splats are sorted by depth in, and what the lists by intersection are made from.
pub(super) struct DepthSorting {
    /// In the second of these sorting begins, where the keys are not kept.
    pub(super) keys: [Buffer<u32>; 2],
    /// Gaussian index by rank; one of both once all are sorted.
    pub(super) global_from_rank: [Buffer<u32>; 2],
    pub(super) rank_first_slot: Buffer<u32>,
}

impl DepthSorting {
    /// In the memory of the lists by intersection. `emit` writes `isect_tiles` and `values`, place 2 or 3, and reads the ranks and their
    /// first slots, so these lie in the others; gradients need the ranks until the end, so there they have memory of their own.
    pub(super) fn over(raster: &RasterParts<'_>) -> Result<Self, GpuError> {
        let RasterParts { context, options, buffers, isects, sorting, last, values } = *raster;
        let lists = [&sorting.isect_tiles, &sorting.isect_keys, &sorting.isect_slots_1, &isects.isect_slots];
        let list = |name, place: usize| Buffer::over(context, name, lists[place], 0, options.splats as usize);
        let free = 5 - values;
        let ranks = match options.backward {
            true => buffers.global_from_rank.clone(),
            false => list("global_from_rank", 1)?,
        };
        let mut global_from_rank = [ranks, list("global_from_rank_1", values)?];
        if last == 1 {
            global_from_rank.swap(0, 1);
        }
        Ok(DepthSorting {
            keys: [list("sorted_keys", 0)?, list("sorted_keys_1", free)?],
            global_from_rank,
            // When keys are sorted they are not needed any more.
            rank_first_slot: list("rank_first_slot", free)?,
        })
    }

    /// Nothing.
    pub(super) fn none(unused: &Unused) -> Self {
        let none = || unused.of();
        DepthSorting { keys: [none(), none()], global_from_rank: [none(), none()], rank_first_slot: none() }
    }
}

/// What [`DepthSorting`] lies in.
#[derive(Clone, Copy)]
pub(super) struct RasterParts<'a> {
    pub(super) context: &'a Context,
    pub(super) options: &'a RasterOptions,
    pub(super) buffers: &'a RasterBuffers,
    pub(super) isects: &'a Isects,
    pub(super) sorting: &'a Sorting,
    /// Which of both pairs the depths' sort ends in.
    pub(super) last: usize,
    /// Place of the values that `emit` writes.
    pub(super) values: usize,
}
