//! Rendering at half width, from which nothing learns: what a model of half width holds, and every kernel that reads it.

use super::{
    Bench,
    judge::Work,
    raster::{BACKGROUND, Scene, blend_pairs, compare_image, compare_splats, covers, image_margin, median_depths},
};
use crate::{
    error::Result,
    gpu::Buffer,
    pipelines::{
        raster::{Raster, TileShape},
        render::MEDIAN_THRESHOLD,
        session::Policy,
    },
    reference::{
        Background, Intersections, NONE, Params, Splat,
        blend::{Margin, blend},
        median_depth::DepthAt,
        packed_splat::{packed, unpack_splat},
        project::{Projected, project},
        tiles::{Tiling, for_each_tile},
    },
    scene::layout::{self, GEOMETRY_PLANES},
    stages::status,
};

const NAME: &str = "half width";

/// What a model of half width holds of these.
pub(super) fn rounded(params: &Params) -> Params {
    let mut half = params.clone();
    for i in 0..params.count {
        let own: [f32; GEOMETRY_PLANES] = std::array::from_fn(|p| params.geometry[p * params.stride + i] as f32);
        let back = layout::unpack_geometry(layout::pack_geometry(own));
        (0..GEOMETRY_PLANES).for_each(|p| half.geometry[p * params.stride + i] = back[p].into());
    }
    half.sh.iter_mut().for_each(|p| *p = layout::halves(layout::pack_halves(*p as f32, 0.0))[0].into());
    half
}

/// Splats as the device has them, and what the twin goes on with.
struct Seen {
    projected: Projected,
    depth_keys: Vec<u32>,
}

impl Seen {
    /// After projection, before anything is sorted.
    fn read(raster: &Raster, count: usize) -> Result<Self> {
        let depth_keys = match raster.depth_keys() {
            Some(keys) => keys.download_range(0, count)?,
            None => vec![NONE; count],
        };
        let tile_counts = raster.buffers.tile_counts.download_range(0, count)?;
        let own = raster.buffers.packed_splats.download_range(0, count)?;
        let splat = |i: usize| match tile_counts[i] {
            0 => Splat::default(),
            _ => Splat { z: f32::from_bits(depth_keys[i]).into(), ..unpack_splat(&own[i]) },
        };
        let depth = |&key: &u32| if key == NONE { f64::INFINITY } else { f32::from_bits(key).into() };
        let projected = Projected {
            splats: (0..count).map(splat).collect(),
            depths: depth_keys.iter().map(depth).collect(),
            tile_counts,
            kinks: vec![],
        };
        Ok(Seen { projected, depth_keys })
    }
}

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    let (count, supplement, width, height) = if quick { (1500, 500, 97, 71) } else { (20_000, 5_000, 403, 301) };
    let scene = Scene::new(bench, 4, (count, supplement), 3, (width, height), true)?;
    let count = count + supplement;
    let tile = TileShape::for_subgroup(bench.context.info().subgroup_size);
    let policy = Policy { tile: Some(tile), ..Policy::default() };
    let mut renderer = scene.renderer(bench, policy, |options| options.depth = true)?;
    renderer.render_on_device(&scene.model, &scene.views, 0, &scene.show)?;
    let status = Buffer::zeroed(bench.context, "status", status::WORDS)?;
    let times = bench.time(|recorder| {
        drop(renderer.record(recorder, &scene.model, &scene.views, 0, &scene.show, &status));
    })?;
    let image = renderer.raster.buffers.image.download_range(0, scene.pixels())?;
    let options = scene.options(tile, false);
    let tiling = Tiling::new(width, height, &options);
    let ranges = renderer.raster.buffers.tile_ranges.download_range(0, tiling.count())?;
    let lists = renderer.raster.isect_slots().download()?;
    // Once more, for what sorting leaves nothing of.
    let mut recorder = bench.context.recorder("splats")?;
    renderer.splats_of(&mut recorder, &scene.model, &scene.views, 0, &scene.show);
    recorder.submit()?.wait()?;
    let seen = Seen::read(&renderer.raster, count)?;
    let visible = seen.depth_keys.iter().filter(|&&key| key != NONE).count() as f64;

    let mut row = bench.row("project", NAME);
    let want = packed(project(&scene.params, &scene.view, &options), &tiling);
    let Projected { splats, tile_counts, .. } = &seen.projected;
    compare_splats(&mut row, splats, &seen.depth_keys, tile_counts, &same_halves(&want, splats), &tiling);
    row.time = times.of("project");
    row.work.bytes = count as f64 * (32.0 + 8.0) + visible * (96.0 + 28.0);
    bench.push(row);

    let isects = Intersections::new(&seen.projected, tiling);
    let mut row = bench.row("emit", NAME);
    let (flips, wrong) = compare_lists(&seen.projected, &tiling, &ranges, &lists, bench.shift());
    row.flips(flips, isects.isect_slots.len());
    row.unequal(wrong);
    row.time = times.of("emit");
    row.work.bytes = visible * (8.0 + 28.0 + 4.0) + isects.isect_slots.len() as f64 * 8.0;
    bench.push(row);

    let mut row = bench.row("blend", NAME);
    let background = Background::Color(BACKGROUND.map(f64::from));
    let own = blend(splats, &isects, background, f64::from(MEDIAN_THRESHOLD));
    compare_image(&mut row, &image, &own, image_margin);
    let [tested, blended] = blend_pairs(splats, &isects);
    row.time = times.of("blend");
    row.work = Work {
        bytes: 4.0 * isects.isect_slots.len() as f64 + 28.0 * visible + 16.0 * scene.pixels() as f64,
        operations: 9.0 * tested + 7.0 * blended,
    };
    bench.push(row);

    let mut row = bench.row("(render)", NAME);
    let twin = blend(&want.splats, &Intersections::new(&want, tiling), background, f64::from(MEDIAN_THRESHOLD));
    compare_image(&mut row, &image, &twin, Margin::image);
    row.time = times.sum();
    bench.push(row);
    median_depths(bench, &scene, &renderer, DepthAt::MaximumResponse, NAME)
}

/// The twin's splats, with the device's colours where a half fell on the other side of its rounding: 2^-11 of it at most.
fn same_halves(want: &Projected, got: &[Splat]) -> Projected {
    let mut same = want.clone();
    for (want, got) in same.splats.iter_mut().zip(got) {
        for (want, got) in [(&mut want.r, got.r), (&mut want.g, got.g), (&mut want.b, got.b)] {
            if (*want - got).abs() <= got / 1024.0 {
                *want = got;
            }
        }
    }
    same
}

/// Lists of Gaussians by tile against the twin's, whose splats lie `shift` pixels aside: what is in one only, and what is wrong with it.
fn compare_lists(
    projected: &Projected,
    tiling: &Tiling,
    ranges: &[[u32; 2]],
    lists: &[u32],
    shift: f64,
) -> (usize, u64) {
    let splats: Vec<Splat> = projected.splats.iter().map(|s| Splat { x: s.x + shift, ..*s }).collect();
    let count = |splat| {
        let mut tiles = 0;
        for_each_tile(splat, tiling, |_| tiles += 1);
        tiles
    };
    let tile_counts = splats.iter().map(count).collect();
    let theirs = Projected { splats, tile_counts, ..projected.clone() };
    let want = Intersections::new(&theirs, *tiling);
    let splats = theirs.splats;
    let (mut flips, mut wrong) = (0, 0);
    for (tile, (own, theirs)) in (0..).zip(ranges.iter().zip(&want.tile_ranges)) {
        let Some(own) = lists.get(own[0] as usize..own[1] as usize) else { return (0, u64::MAX) };
        let key = |&global: &u32| (projected.depths[global as usize].to_bits(), global);
        if own.iter().any(|&global| global as usize >= projected.splats.len()) {
            return (0, u64::MAX);
        }
        wrong += u64::from(!own.is_sorted_by(|a, b| key(a) < key(b)));
        let theirs = &want.isect_slots[theirs[0] as usize..theirs[1] as usize];
        let theirs: Vec<u32> = theirs.iter().map(|&slot| want.global_from_slot[slot as usize]).collect();
        let among = |list: &[u32], global: &u32| list.binary_search_by_key(&key(global), key).is_ok();
        flips += own.iter().filter(|global| !among(&theirs, global)).count();
        for global in theirs.iter().filter(|global| !among(own, global)) {
            flips += 1;
            wrong += u64::from(covers(&splats[*global as usize], tile, tiling));
        }
    }
    (flips, wrong)
}
