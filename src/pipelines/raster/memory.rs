//! Buffers of a raster, and their aliasing: lists that are not needed at the same time share memory.

use super::Policy;
use crate::{
    gpu::{Buffer, Context, DeviceInfo, GpuError, Unused},
    pipelines::plan::buffers,
    stages::{
        blocks::{DIGIT_TOTALS, block_counts_len, block_sums_len},
        constants::slots::SLOTS_PER_BLOCK,
        types::{PackedSplat, Splat},
    },
};

/// Sizes and features of a [`Raster`](super::Raster).
#[derive(Debug, Clone, Copy, Default)]
pub struct RasterOptions {
    /// Maximum number of splats that a projection stage fills.
    pub splats: u32,
    /// Pixels of all frames of the largest batch.
    pub pixels: u32,
    /// Tiles of the largest grid.
    pub tiles: u32,
    /// Initial room for intersections; [`Raster::grow`](super::Raster::grow) makes more.
    pub isects: u32,
    /// Splats belong to several frames; `splat_frames` maps a splat to its frame.
    pub batch: bool,
    /// The background is an image, `backdrop`.
    pub background_image: bool,
    /// Also find the Gaussian of median depth of each pixel.
    pub median: bool,
    /// Hide splats behind `scene_depths`.
    pub occluded: bool,
    /// Enable gradients.
    pub backward: bool,
    /// Enable sums by blend weight, see [`Raster::record_scores`](super::Raster::record_scores).
    pub scores: bool,
    /// Splats and their colors are packed: 28 bytes in place of 36. Not for gradients or batches.
    pub packed_splats: bool,
    /// Variants of the stages: uses the reduction, the packing of records, and the tile.
    pub policy: Policy,
}

impl RasterOptions {
    /// Bits of a tile number.
    pub(super) fn tile_bits(&self) -> u32 {
        self.tiles.saturating_sub(1).checked_ilog2().map_or(1, |b| b + 1)
    }

    pub(super) fn only_if(&self, what: bool, elements: u32) -> u32 {
        if what { elements } else { 1 }
    }

    /// Whether gradient records of intersections are packed: all except those of batches, whose reader
    /// expects floats.
    pub(super) fn packed(&self) -> bool {
        self.policy.packed && !self.batch
    }

    /// Elements of a buffer of gradient records by intersection, for packed or plain records.
    pub(super) fn records(&self, packed: bool) -> u32 {
        self.only_if(self.backward && self.packed() == packed, self.room())
    }

    /// Maximum number of intersections for a list with `bytes` per entry, by the device's limit.
    pub(in crate::pipelines) fn most_isects(device: &DeviceInfo, bytes: u64) -> u32 {
        let whole = |isects: u64| isects / u64::from(LIST_ALIGNMENT) * u64::from(LIST_ALIGNMENT);
        whole((device.max_storage_bytes / bytes).min(u32::MAX.into())) as u32
    }

    /// Elements of lists by intersection: the larger of the numbers of intersections and of splats, as the
    /// splats' sort uses the same memory. Rounded up so that lists that share a buffer start at an aligned
    /// offset.
    pub(super) fn room(&self) -> u32 {
        aligned(self.isects.max(self.splats))
    }

    /// Elements of unpacked splats; a learning raster reuses their memory between frames.
    pub(super) fn splat_room(&self) -> u32 {
        if self.backward { aligned(self.splats) } else { self.only_if(!self.packed_splats, self.splats) }
    }

    /// Whether depths are kept after their sort: occlusion compares them, and a learning raster reuses their
    /// memory between steps.
    pub(super) fn keeps_depths(&self) -> bool {
        self.backward || self.occluded
    }

    /// Bytes per intersection of the widest gradient record.
    pub(super) fn record_bytes(&self) -> u64 {
        if self.packed() { 16 } else { 12 }
    }
}

pub(super) fn aligned(elements: u32) -> u32 {
    elements.checked_next_multiple_of(LIST_ALIGNMENT).unwrap_or(elements)
}

/// Bits of a depth key.
pub(super) const DEPTH_BITS: u32 = 32;
/// Bytes per intersection of a sorted list.
pub(in crate::pipelines) const LIST_BYTES: u64 = 4;
/// In words: 256 bytes, enough for the buffer alignment of every tested driver. Otherwise [`Buffer::over`]
/// allocates separate memory.
pub(super) const LIST_ALIGNMENT: u32 = 64;

buffers! {
    /// Buffers by splat, by pixel and by tile.
    pub struct RasterBuffers(o: RasterOptions) {
        /// By Gaussian index; valid if `tile_counts` is not 0.
        pub splats: Splat = o.splat_room(),
        /// sRGB, ≥ 0.
        pub splat_colors: [f32; 3] = o.splat_room(),
        /// Splat and color in one, if enabled.
        pub packed_splats: PackedSplat = o.only_if(o.packed_splats, o.splats),
        /// Bits of camera z; [`NONE`](crate::stages::constants::constants::NONE): not in this view. If not
        /// needed after the sort, they lie in the lists by intersection, see
        /// [`Raster::depth_keys`](super::Raster::depth_keys).
        pub depth_keys: u32 = o.only_if(o.keeps_depths(), o.splats),
        /// Number of tiles that a splat touches.
        pub tile_counts: u32 = o.splats,
        /// By Gaussian index: its first intersection slot, also the first of its gradient records. Valid if
        /// `tile_counts` is not 0.
        pub first_slot: u32 = o.only_if(o.backward, o.splats),
        /// RGB including the background, and transmittance.
        pub image: [f32; 4] = o.pixels,
        /// ∂loss/∂RGB by pixel, interleaved.
        pub image_grad: f32 = 3 * u64::from(o.only_if(o.backward, o.pixels)),
        /// RGB and transmittance of the backdrop behind all splats.
        pub backdrop: [f32; 4] = o.only_if(o.background_image, o.pixels),
        /// Gaussian index of each pixel's median; NONE: none.
        pub median_ids: u32 = o.only_if(o.median, o.pixels),
        /// By pixel, as depth-buffer values.
        pub scene_depths: f32 = o.only_if(o.occluded, o.pixels),
        pub(crate) tile_ranges: [u32; 2] = o.tiles,
        pub(crate) count: u32 = 4,
        pub(super) args: u32 = 12,
        /// For a batch: whether a tile's pixels show splats, or are stale.
        pub(crate) tile_drawn: u32 = o.only_if(o.batch, o.tiles),
        /// For a batch: tiles to blend, in any order, and their number.
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
    /// Lists by intersection that live until blending ends. Sorting ends in `isect_slots`. With gradients it
    /// sorts slots, since records lie by slot, and `rank_blocks` maps them to ranks; otherwise it sorts
    /// Gaussian indices.
    pub(super) struct Isects(o: RasterOptions) {
        pub(super) isect_slots: u32 = o.room(),
        pub(super) rank_blocks: [u32; 2] = o.only_if(o.backward, o.isects.div_ceil(SLOTS_PER_BLOCK)),
        pub(super) isect_block_counts: u32 = block_counts_len(o.isects, o.tile_bits()),
    }
}

buffers! {
    /// Lists by intersection for sorting only. Passes alternate between `isect_tiles` and `isect_keys`.
    pub(super) struct Sorting(o: RasterOptions) {
        pub(super) isect_tiles: u32 = o.room(),
        pub(super) isect_keys: u32 = o.room(),
        pub(super) isect_slots_1: u32 = o.room(),
    }
}

impl Sorting {
    /// Aliases the records by intersection, since those are written after sorting.
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

    /// Placeholders without memory.
    pub(super) fn none(unused: &Unused) -> Self {
        Sorting { isect_tiles: unused.of(), isect_keys: unused.of(), isect_slots_1: unused.of() }
    }
}

buffers! {
    /// Gradient records, by intersection slot. Until the backward pass, sorting may use their memory.
    pub struct Records(o: RasterOptions) {
        /// Σ g w_u, Σ g w_v, Σ ∂loss/∂opacity.
        pub record_centres: [f32; 3] = o.records(false),
        /// Σ g w_u², Σ g w_u w_v, Σ g w_v².
        pub record_shapes: [f32; 3] = o.records(false),
        /// ∂loss/∂rgb.
        pub record_colors: [f32; 3] = o.records(false),
        /// All three packed into four words, if enabled (`glsl/shared/packed_record.glsl`).
        pub record_words: [u32; 4] = o.records(true),
    }
}

impl Records {
    /// Number of records, packed or plain.
    pub(super) fn len(&self) -> usize {
        self.record_centres.len().max(self.record_words.len())
    }
}

buffers! {
    /// Gradient records accumulated by Gaussian.
    pub(super) struct GaussianRecords(o: RasterOptions) {
        pub(super) record_centres: [f32; 3] = o.only_if(o.backward, o.splats),
        pub(super) record_shapes: [f32; 3] = o.only_if(o.backward, o.splats),
        pub(super) record_colors: [f32; 3] = o.only_if(o.backward, o.splats),
    }
}

/// Buffers of the depth sort, the input of the lists by intersection.
pub(super) struct DepthSorting {
    /// Sorting starts in the second one if depth keys are not kept.
    pub(super) keys: [Buffer<u32>; 2],
    /// Gaussian index by rank; the sort ends in one of the two.
    pub(super) global_from_rank: [Buffer<u32>; 2],
    pub(super) rank_first_slot: Buffer<u32>,
}

impl DepthSorting {
    /// Aliases the lists by intersection. `emit` writes `isect_tiles` and list `values` (2 or 3) while it
    /// reads the ranks and their first slots, so these use the other lists. Gradients need the ranks until
    /// the end, so then those have their own memory.
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
            // The keys are not needed after the sort.
            rank_first_slot: list("rank_first_slot", free)?,
        })
    }

    /// Placeholders without memory.
    pub(super) fn none(unused: &Unused) -> Self {
        let none = || unused.of();
        DepthSorting { keys: [none(), none()], global_from_rank: [none(), none()], rank_first_slot: none() }
    }
}

/// Buffers that [`DepthSorting`] aliases.
#[derive(Clone, Copy)]
pub(super) struct RasterParts<'a> {
    pub(super) context: &'a Context,
    pub(super) options: &'a RasterOptions,
    pub(super) buffers: &'a RasterBuffers,
    pub(super) isects: &'a Isects,
    pub(super) sorting: &'a Sorting,
    /// Index of the pair that the depth sort ends in.
    pub(super) last: usize,
    /// Index of the list of values that `emit` writes.
    pub(super) values: usize,
}
