//! Host adapters of the rasteriser's twins: from Gaussians to pixels and back to gradient records.

use std::borrow::Cow;

use super::{Outcome, page, params, pixels, view, wide_rows};
use crate::{
    reference::{
        self as twin, Background, Intersections, NONE, Options, Splat,
        blend_backward::Record,
        emit::{Emitted, claim, globals},
        median_depth::DepthAt,
        packed_record::pack_record,
        packed_splat::{pack_splat, packed, unpack_splat},
        tiles::Tiling,
    },
    scene::layout,
    stages::{
        kernels,
        types::{self, Frame},
    },
};

twins!(blend, blend_backward, blend_backward_atomic, emit, median_depth, project, resolve, tile_ranges);

pub(super) fn project(h: kernels::project::Host<'_>) -> Outcome {
    let kernels::project::Push { segment, page_first, stride, view: view_index, splat_first } = h.push;
    let kernels::project::Spec {
        tile_width,
        tile_height,
        compensate,
        has_lobes,
        sh_degree,
        half_width,
        packed_splats,
        ..
    } = h.spec;
    let (first, count) = page(h.population, segment, page_first, stride, h.workgroups.threads());
    let first = first + splat_first as usize;
    let geometry = whole_geometry(h.geometry, half_width, stride);
    let sh: Cow<'_, _> = if half_width { layout::unpack_halves(h.sh, stride as usize).into() } else { h.sh.into() };
    let params = params([&geometry, &sh, h.lobes], count, stride, has_lobes, sh_degree);
    let options = Options { active_degree: sh_degree, compensate, tile_width, tile_height, ..Default::default() };
    let view = view(&h.views[view_index as usize]);
    let mut projected = twin::project::project(&params, &view, &options);
    if packed_splats {
        projected = packed(projected, &Tiling::new(view.width, view.height, &options));
    }
    for (i, (splat, tiles)) in (first..).zip(projected.splats.iter().zip(projected.tile_counts)) {
        h.depth_keys[i] = NONE;
        h.tile_counts[i] = tiles;
        if tiles > 0 {
            match packed_splats {
                true => h.packed_splats[i] = pack_splat(splat),
                false => (h.splats[i], h.splat_colors[i]) = narrow(splat),
            }
            h.depth_keys[i] = (splat.z as f32).to_bits();
        }
    }
    Ok(())
}

/// A page of geometry at full width, three quads for each Gaussian, from one of either width.
fn whole_geometry(geometry: &[[f32; 4]], half_width: bool, stride: u32) -> Cow<'_, [[f32; 4]]> {
    match half_width {
        true => layout::unpack_geometry_page(geometry, stride as usize).into(),
        false => geometry.into(),
    }
}

pub(super) fn narrow(s: &Splat) -> (types::Splat, [f32; 3]) {
    let shape = [s.l11, s.l12, s.l22, s.opacity].map(|v| v as f32);
    (types::Splat { shape, centre: [s.x as f32, s.y as f32] }, s.color().map(|c| c as f32))
}

/// Converts a splat to float64. Camera z is not used here.
pub(super) fn wide_splat(s: &types::Splat, color: [f32; 3]) -> Splat {
    let ([x, y], [l11, l12, l22, opacity]) = (s.centre.map(f64::from), s.shape.map(f64::from));
    let [r, g, b] = color.map(f64::from);
    Splat { x, y, l11, l12, l22, opacity, r, g, b, z: 1.0 }
}

/// The tiles of a frame in the grid of its batch, with rows of `tiles_x`.
fn tiling(frame: &Frame, [tile_width, tile_height]: [u32; 2], tiles_x: u32, tiles_per_frame: u32) -> Tiling {
    let tiles_y = tiles_per_frame / tiles_x.max(1);
    Tiling { width: frame.width, height: frame.height, tile_width, tile_height, tiles_x, tiles_y }
}

pub(super) fn emit(h: kernels::emit::Host<'_>) -> Outcome {
    let kernels::emit::Push { frame_first, tiles_x, tiles_per_frame, capacity, count_index } = h.push;
    let kernels::emit::Spec { tile_width, tile_height, batch, direct, packed_splats, .. } = h.spec;
    let count = h.workgroups.threads().min(h.count[count_index as usize] as usize);
    for (rank, (&global, &slot)) in (0..).zip(h.global_from_rank[..count].iter().zip(h.rank_first_slot)) {
        let i = global as usize;
        let f = if batch { h.splat_frames[i] } else { 0 };
        let frame = &h.frames[(frame_first + f) as usize];
        let room = h.tile_counts[i].min(capacity.saturating_sub(slot));
        let tiling = tiling(frame, [tile_width, tile_height], tiles_x, tiles_per_frame);
        let splat = match packed_splats {
            true => unpack_splat(&h.packed_splats[i]),
            false => wide_splat(&h.splats[i], [0.0; 3]),
        };
        let Emitted { tile_of_slot, .. } = twin::emit::emit(&[splat], &[room], &[0], &tiling);
        let slots = slot as usize..slot as usize + room as usize;
        for (slot, tile) in slots.zip(tile_of_slot) {
            h.isect_tiles[slot] = if tile == NONE { NONE } else { f * tiles_per_frame + tile };
            if direct {
                h.isect_globals[slot] = global;
            }
        }
        if !direct {
            h.first_slot[i] = slot;
            if room > 0 {
                claim(h.rank_blocks, rank, slot, room);
            }
        }
    }
    Ok(())
}

pub(super) fn tile_ranges(h: kernels::tile_ranges::Host<'_>) -> Outcome {
    let kernels::tile_ranges::Push { count_index, tile_count } = h.push;
    let isects = h.count[count_index as usize] as usize;
    let ranges = twin::tile_ranges::tile_ranges(&h.isect_tiles[..isects], tile_count as usize);
    h.tile_ranges[..ranges.len()].copy_from_slice(&ranges);
    if h.spec.listed {
        let tiles = twin::tile_ranges::listed_tiles(&ranges, h.tile_drawn);
        h.tile_list_count[0] += tiles.len() as u32;
        h.tile_list[..tiles.len()].copy_from_slice(&tiles);
    }
    Ok(())
}

/// The tile lists of a grid.
struct Lists<'a> {
    frames: &'a [Frame],
    tile_ranges: &'a [[u32; 2]],
    isect_slots: &'a [u32],
    global_from_slot: Vec<u32>,
    tile: [u32; 2],
    frame_first: u32,
    tiles_x: u32,
    tiles_per_frame: u32,
    /// By tile: whether the dispatch takes it.
    taken: Vec<bool>,
}

/// Marks the tiles of a grid that are taken: all, or those listed.
fn taken(tile_count: u32, listed: bool, tile_list: &[u32], tile_list_count: &[u32]) -> Vec<bool> {
    let mut taken = vec![!listed; tile_count as usize];
    if listed {
        tile_list[..tile_list_count[0] as usize].iter().for_each(|&tile| taken[tile as usize] = true);
    }
    taken
}

impl Lists<'_> {
    /// Visits the frames of the grid in turn, with their tiles that are taken.
    fn for_each_frame(&self, mut visit: impl FnMut(&Frame, &Intersections, &[bool])) {
        let mut isects = Intersections {
            isect_slots: self.isect_slots.to_vec(),
            global_from_slot: self.global_from_slot.clone(),
            ..Intersections::none(Tiling::new(1, 1, &Options::default()))
        };
        let per_frame = self.tiles_per_frame.max(1) as usize;
        let tiles = self.tile_ranges.chunks(per_frame).zip(self.taken.chunks(per_frame));
        for (frame, (ranges, taken)) in self.frames[self.frame_first as usize..].iter().zip(tiles) {
            isects.tiling = tiling(frame, self.tile, self.tiles_x, self.tiles_per_frame);
            isects.tile_ranges = ranges.iter().zip(taken).map(|(&range, &t)| if t { range } else { [0; 2] }).collect();
            visit(frame, &isects, taken);
        }
    }
}

fn wide_splats(splats: &[types::Splat], colors: &[[f32; 3]]) -> Vec<Splat> {
    splats.iter().zip(colors).map(|(splat, &color)| wide_splat(splat, color)).collect()
}

pub(super) fn blend(h: kernels::blend::Host<'_>) -> Outcome {
    let kernels::blend::Push {
        frame_first,
        tiles_x,
        tiles_per_frame,
        tile_count,
        background,
        median_threshold,
        depth_form: [a, b],
    } = h.push;
    let kernels::blend::Spec {
        tile_width,
        tile_height,
        background_image,
        median,
        occluded,
        direct,
        packed_splats,
        listed,
        ..
    } = h.spec;
    // If the list holds Gaussians, the slot of each is its position in the list.
    let places: Vec<u32> = (0..h.isect_slots.len() as u32).collect();
    let (isect_slots, global_from_slot) = match direct {
        true => (&places[..], h.isect_slots.to_vec()),
        false => (h.isect_slots, globals(h.rank_blocks, h.global_from_rank, h.isect_slots.len())),
    };
    let lists = Lists {
        frames: h.frames,
        tile_ranges: h.tile_ranges,
        isect_slots,
        global_from_slot,
        tile: [tile_width, tile_height],
        frame_first,
        tiles_x,
        tiles_per_frame,
        taken: taken(tile_count, listed, h.tile_list, h.tile_list_count),
    };
    let mut splats = match packed_splats {
        true => h.packed_splats.iter().map(unpack_splat).collect(),
        false => wide_splats(h.splats, h.splat_colors),
    };
    if occluded {
        splats.iter_mut().zip(h.depth_keys).for_each(|(s, &key)| s.z = f32::from_bits(key).into());
    }
    lists.for_each_frame(|frame, isects, taken| {
        let pixels = pixels(frame);
        let farthest = |pixel: usize| match occluded {
            true => twin::resolve::camera_z(h.scene_depths[pixels.start + pixel].into(), [a, b].map(f64::from)),
            false => f64::INFINITY,
        };
        let backdrop: Vec<[f64; 3]> = match background_image {
            true => h.backdrop[pixels.clone()].iter().map(|&[r, g, b, _]| [r, g, b].map(f64::from)).collect(),
            false => vec![],
        };
        let behind = match background_image {
            true => Background::Image(&backdrop),
            false => Background::Color(background.map(f64::from)),
        };
        let blended = twin::blend::blend_before(&splats, isects, behind, f64::from(median_threshold), farthest);
        for (pixel, at) in (0..).zip(pixels) {
            if !taken[isects.tiling.tile_of(pixel % frame.width, pixel / frame.width) as usize] {
                continue;
            }
            h.image[at] = blended.image[pixel as usize].map(|v| v as f32);
            if median {
                h.median_ids[at] = blended.median[pixel as usize];
            }
        }
    });
    Ok(())
}

/// Input of both backward passes of the blend.
struct Backward<'a> {
    lists: Lists<'a>,
    splats: &'a [types::Splat],
    splat_colors: &'a [[f32; 3]],
    image: &'a [[f32; 4]],
    image_grad: &'a [f32],
    /// Index of the first Gaussian with a complete record.
    all_first: u32,
}

impl Backward<'_> {
    /// Slot, Gaussian and record of every intersection that some pixel blends. If a Gaussian learns only its
    /// opacity, the record has only that part, and 1 in the first.
    fn for_each_record(&self, mut put: impl FnMut(usize, u32, Record)) {
        let splats = wide_splats(self.splats, self.splat_colors);
        self.lists.for_each_frame(|frame, isects, _| {
            let pixels = pixels(frame);
            let image = wide_rows(&self.image[pixels.clone()]);
            let (rows, _) = self.image_grad[3 * pixels.start..3 * pixels.end].as_chunks::<3>();
            let records = twin::blend_backward::blend_backward(&splats, isects, &image, &wide_rows(rows));
            // With a gradient of 1 everywhere, a color's part is not 0 if and only if a pixel blends the
            // Gaussian.
            let ones = vec![[1.0; 3]; image.len()];
            let blended = twin::blend_backward::blend_backward(&splats, isects, &image, &ones);
            for range in &isects.tile_ranges {
                for &slot in &isects.isect_slots[range[0] as usize..range[1] as usize] {
                    let (slot, global) = (slot as usize, isects.global_from_slot[slot as usize]);
                    if blended[slot][6] == 0.0 {
                        continue;
                    }
                    let record = records[slot];
                    let alone = [1.0, 0.0, record[2], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
                    put(slot, global, if global >= self.all_first { record } else { alone });
                }
            }
        });
    }
}

/// Builds [`Backward`] from the host of either backward pass.
macro_rules! backward {
    ($h:ident) => {
        Backward {
            lists: Lists {
                frames: $h.frames,
                tile_ranges: $h.tile_ranges,
                isect_slots: $h.isect_slots,
                global_from_slot: globals($h.rank_blocks, $h.global_from_rank, $h.isect_slots.len()),
                tile: [$h.spec.tile_width, $h.spec.tile_height],
                frame_first: $h.push.frame_first,
                tiles_x: $h.push.tiles_x,
                tiles_per_frame: $h.push.tiles_per_frame,
                taken: taken($h.push.tile_count, $h.spec.listed, $h.tile_list, $h.tile_list_count),
            },
            splats: $h.splats,
            splat_colors: $h.splat_colors,
            image: $h.image,
            image_grad: $h.image_grad,
            all_first: $h.population[$h.push.frozen as usize],
        }
    };
}

/// The three parts in which records are stored.
fn parts(record: &Record) -> [[f32; 3]; 3] {
    [0, 3, 6].map(|first| [0, 1, 2].map(|c| record[first + c] as f32))
}

pub(super) fn blend_backward(h: kernels::blend_backward::Host<'_>) -> Outcome {
    let backward = backward!(h);
    backward.for_each_record(|slot, global, record| {
        let [centre, shape, mut color] = parts(&record);
        let all = global >= backward.all_first;
        if h.spec.scores {
            // The third is not used.
            color[2] = 0.0;
        }
        match (h.spec.packed_records, h.spec.scores) {
            (true, true) => h.record_words[slot] = [color[0].to_bits(), color[1].to_bits(), 0, 0],
            (true, false) => h.record_words[slot] = pack_record(&record, !all),
            (false, true) => h.record_colors[slot] = color,
            (false, false) => {
                h.record_centres[slot] = centre;
                if all {
                    h.record_shapes[slot] = shape;
                    h.record_colors[slot] = color;
                }
            }
        }
    });
    Ok(())
}

pub(super) fn blend_backward_atomic(h: kernels::blend_backward_atomic::Host<'_>) -> Outcome {
    let backward = backward!(h);
    let mut isects = Intersections::none(Tiling::new(1, 1, &Options::default()));
    let mut records = Vec::new();
    backward.for_each_record(|_, global, record| {
        isects.global_from_slot.push(global);
        records.push(record);
    });
    if h.spec.scores {
        // Only two of the colors' three sums are used.
        records
            .iter_mut()
            .for_each(|record| *record = std::array::from_fn(|k| if [6, 7].contains(&k) { record[k] } else { 0.0 }));
    }
    let sums = twin::blend_backward_atomic::blend_backward_atomic(&isects, &records, h.splats.len());
    for (global, sum) in sums.iter().enumerate().filter(|(_, sum)| **sum != [0.0; 9]) {
        let to = [&mut h.record_centres[global], &mut h.record_shapes[global], &mut h.record_colors[global]];
        for (to, part) in to.into_iter().zip(parts(sum)) {
            to.iter_mut().zip(part).for_each(|(to, v)| *to += v);
        }
    }
    Ok(())
}

pub(super) fn median_depth(h: kernels::median_depth::Host<'_>) -> Outcome {
    let kernels::median_depth::Push { segment, page_first, stride, view: view_index, depth_first, splat_first, scale } =
        h.push;
    let view = view(&h.views[view_index as usize]);
    let (first, count) = page(h.population, segment, page_first, stride, usize::MAX);
    let first = first + splat_first as usize;
    let pixels = h.workgroups.threads().min(view.width as usize * view.height as usize);
    // Indices by place in the page; other pages take the other pixels.
    let here = |&i: &u32| i.checked_sub(first as u32).filter(|&place| i != NONE && (place as usize) < count);
    let median: Vec<u32> = h.median_ids[..pixels].iter().map(|i| here(i).unwrap_or(NONE)).collect();
    let geometry = whole_geometry(h.geometry, h.spec.half_width, stride);
    let params = params([&geometry, &[], &[]], count, stride, false, 0);
    let at = if h.spec.centre { DepthAt::Centre } else { DepthAt::MaximumResponse };
    let depths = twin::median_depth::median_depth(&params, &view, &median, at, scale.into());
    let to = &mut h.depths[depth_first as usize..][..pixels];
    for (pixel, depth) in depths.into_iter().enumerate() {
        let nobodys = h.median_ids[pixel] == NONE && segment == 0 && page_first == 0 && splat_first == 0;
        if median[pixel] != NONE || nobodys {
            to[pixel] = depth as f32;
        }
    }
    Ok(())
}

pub(super) fn resolve(h: kernels::resolve::Host<'_>) -> Outcome {
    let kernels::resolve::Push { pixels, format, blend, linear, depth, exposure, depth_form, background } = h.push;
    let form = depth_form.map(f64::from);
    let background = background.map(f64::from);
    let to = twin::resolve::To { blend, linear: linear != 0, exposure: exposure.into(), background };
    let words = twin::resolve::words(format);
    for pixel in 0..h.workgroups.threads().min(pixels as usize) {
        if depth != 0 {
            h.depth_target[pixel] = twin::resolve::depth(h.depths[pixel].into(), form) as f32;
        }
        let target = &mut h.target[words * pixel..][..words];
        let below = twin::resolve::unpack(format, target);
        twin::resolve::pack(format, to.resolve(h.image[pixel].map(f64::from), below), target);
    }
    Ok(())
}
