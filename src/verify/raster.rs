//! Rendering: every kernel from projection to pixels and back to intersection records, alone and as a whole.

use glam::DVec3;
use rayon::prelude::*;

use super::{Bench, NEAR_THRESHOLD, half::rounded, judge::Work, sort::noise, step};
use crate::{
    error::Result,
    gpu::{Buffer, Recorder},
    pipelines::{
        model::{Model, Room, Segment},
        raster::{Grid, ISECTS, Raster, Records, TileShape, VISIBLE},
        render::{MEDIAN_THRESHOLD, Needs, RenderOptions, Renderer, Show},
        session::{Policy, Reduction},
        views::Views,
    },
    reference::{
        self, ALPHA_MAX, ALPHA_MIN, Background, Intersections, NEAR, NONE, Options, Params, Splat, TRANSMITTANCE_MIN,
        View,
        blend::{Blended, Margin, blend},
        blend_backward::{Record, blend_backward, blend_backward_magnitudes},
        blend_backward_atomic::blend_backward_atomic,
        emit::{emit, globals},
        median_depth::{DepthAt, median_depth},
        packed_record::{pack_record, unit_of, unpack_record},
        project::{Projected, project},
        random_camera, random_scene,
        tile_ranges::tile_ranges,
        tiles::{Tiling, for_each_tile},
    },
    scene::layout::{BETAS, GEOMETRY_PLANES, sh_planes},
    stages::{status, types},
};

pub(super) const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    let (count, supplement, width, height) = if quick { (2500, 800, 97, 71) } else { (30_000, 10_000, 403, 301) };
    let lanes = bench.context.info().subgroup_size;
    let chosen = TileShape::for_subgroup(lanes);
    let scene = Scene::new(bench, 1, (count, supplement), 3, (width, height), false)?;
    let twin = scene.twin(false);
    for tile in TileShape::choices(lanes) {
        case(bench, &scene, &twin, tile, false)?;
    }
    case(bench, &scene, &scene.twin(true), chosen, true)?;
    // Without a supplement, and with fewer bands.
    let plain = Scene::new(bench, 2, (count, 0), 1, (width, height), false)?;
    case(bench, &plain, &plain.twin(false), chosen, false)?;
    let betas = Scene::new(bench, 3, (count, 0), BETAS, (width, height), false)?;
    case(bench, &betas, &betas.twin(false), chosen, false)
}

/// A small picture, as a whole, its gradients, and a step by these. Few pipelines: a CPU device takes longer to compile them than to run.
pub(super) fn check(bench: &mut Bench<'_>) -> Result<()> {
    let tile = TileShape::for_subgroup(bench.context.info().subgroup_size);
    let scene = Scene::new(bench, 1, (500, 0), 0, (41, 27), false)?;
    let (twin, options) = (scene.twin(false), scene.options(tile, false));
    let policy = Policy { reduction: Reduction::Deterministic, tile: Some(tile), ..Policy::default() };
    let renderer = scene.renderer(bench, policy, |options| options.backward = true)?;
    let ordered = Ordered::of(bench, &scene, renderer, policy, tile)?;
    let mut row = bench.row("(render)", "");
    let image = ordered.renderer.raster.buffers.image.download_range(0, scene.pixels())?;
    compare_image(&mut row, &image, &twin.blended, Margin::image);
    if !ordered.is_sound() {
        row.unequal(u64::MAX);
    }
    bench.push(row);
    step::check(bench, &scene, &ordered, &twin, &options)
}

/// A random scene on both sides.
pub(super) struct Scene {
    pub params: Params,
    pub view: View,
    pub views: Views,
    pub model: Model,
    pub show: Show,
    pub degree: u32,
}

impl Scene {
    /// With `half` its model is of half width, and its parameters are what that holds.
    pub fn new(
        bench: &Bench<'_>,
        seed: u64,
        (count, supplement): (usize, usize),
        degree: u32,
        (width, height): (u32, u32),
        half: bool,
    ) -> Result<Self> {
        let scene = random_scene(seed, count, supplement, degree);
        let camera = random_camera(width, height);
        let model = Model::upload_around(bench.context, DVec3::ZERO, &scene, Room { half, ..Default::default() })?;
        let params = Params::from_scene(&scene)?;
        Ok(Scene {
            params: if half { rounded(&params) } else { params },
            view: View::from_camera(&camera).rounded(),
            views: Views::upload(bench.context, &[camera], &[])?,
            show: Show::all(&model, BACKGROUND),
            model,
            degree,
        })
    }

    pub fn options(&self, tile: TileShape, compensate: bool) -> Options {
        Options {
            active_degree: self.degree,
            compensate,
            tile_width: tile.width,
            tile_height: tile.height,
            median_threshold: f64::from(MEDIAN_THRESHOLD),
        }
    }

    /// All of rendering in float64. The tiles' shape does not matter to an image.
    pub fn twin(&self, compensate: bool) -> reference::Rendered {
        let tile = TileShape { width: 16, height: 16, pixels: 1 };
        let background = Background::Color(BACKGROUND.map(f64::from));
        reference::render(&self.params, &self.view, &self.options(tile, compensate), background)
    }

    pub fn renderer(&self, bench: &Bench<'_>, policy: Policy, set: impl Fn(&mut RenderOptions)) -> Result<Renderer> {
        let mut options = RenderOptions { policy, ..Default::default() };
        set(&mut options);
        Ok(Renderer::new(bench.context, Needs::of(&self.model), &self.views, options)?)
    }

    pub fn pixels(&self) -> usize {
        self.view.width as usize * self.view.height as usize
    }

    /// "8×8, lobes, compensated".
    fn variant(&self, tile: TileShape, compensate: bool) -> String {
        let lobes = if self.model.has_supplement() { ", lobes" } else { "" };
        format!("{tile}{lobes}{}", self.suffix(compensate))
    }

    /// ", compensated, degree 1".
    pub fn suffix(&self, compensate: bool) -> String {
        let degree = match self.degree {
            3 => String::new(),
            BETAS => ", betas".into(),
            degree => format!(", degree {degree}"),
        };
        format!("{}{degree}", if compensate { ", compensated" } else { "" })
    }
}

/// A scene that the device has rendered, and what it made of it before the pixels, in float64.
pub(super) struct Ordered {
    pub renderer: Renderer,
    pub policy: Policy,
    pub grid: Grid,
    pub status: Buffer<u32>,
    pub splats: Vec<Splat>,
    pub tile_counts: Vec<u32>,
    pub isects: Intersections,
    depth_keys: Vec<u32>,
}

impl Ordered {
    fn new(bench: &Bench<'_>, scene: &Scene, policy: Policy, tile: TileShape) -> Result<Self> {
        let policy = Policy { tile: Some(tile), ..policy };
        let mut renderer = scene.renderer(bench, policy, |options| {
            options.depth = true;
            options.backward = true;
        })?;
        renderer.raster.make_scores()?;
        Self::of(bench, scene, renderer, policy, tile)
    }

    fn of(bench: &Bench<'_>, scene: &Scene, mut renderer: Renderer, policy: Policy, tile: TileShape) -> Result<Self> {
        let view = &scene.view;
        renderer.render_on_device(&scene.model, &scene.views, 0, &scene.show)?;
        let mut ordered = Ordered {
            grid: renderer.raster.grid(0, 1, view.width, view.height),
            renderer,
            policy,
            status: Buffer::zeroed(bench.context, "status", status::WORDS)?,
            splats: vec![],
            tile_counts: vec![],
            isects: Intersections {
                tiling: Tiling::new(view.width, view.height, &scene.options(tile, policy.compensate)),
                global_from_rank: vec![],
                isect_tiles: vec![],
                isect_slots: vec![],
                global_from_slot: vec![],
                first_slot: vec![],
                tile_ranges: vec![],
            },
            depth_keys: vec![],
        };
        ordered.read(scene.params.count)?;
        Ok(ordered)
    }

    fn read(&mut self, count: usize) -> Result<()> {
        let (raster, buffers) = (&self.renderer.raster, &self.renderer.raster.buffers);
        let words = buffers.count.download()?;
        let (visible, isects) = (words[VISIBLE as usize] as usize, words[ISECTS as usize] as usize);
        self.depth_keys = buffers.depth_keys.download_range(0, count)?;
        self.tile_counts = buffers.tile_counts.download_range(0, count)?;
        // What is not visible has no splat and no slot; the device leaves its memory as it was.
        let seen = |i: usize| self.tile_counts[i] > 0;
        let splats = buffers.splats.download_range(0, count)?;
        let colours = buffers.splat_colours.download_range(0, count)?;
        let splat = |i: usize| wide(&splats[i], colours[i], self.depth_keys[i]);
        self.splats = (0..count).map(|i| if seen(i) { splat(i) } else { Splat::default() }).collect();
        let first_slot = buffers.first_slot.download_range(0, count)?;
        let global_from_rank = raster.global_from_rank().download_range(0, visible)?;
        self.isects = Intersections {
            tiling: self.isects.tiling,
            global_from_slot: globals(&raster.rank_blocks().download()?, &global_from_rank, isects),
            global_from_rank,
            isect_tiles: raster.isect_tiles().download_range(0, isects)?,
            isect_slots: raster.isect_slots().download_range(0, isects)?,
            first_slot: (0..count).map(|i| if seen(i) { first_slot[i] } else { 0 }).collect(),
            tile_ranges: buffers.tile_ranges.download_range(0, self.isects.tiling.count())?,
        };
        Ok(())
    }

    pub fn record_blend_backward(&self, recorder: &mut Recorder, scene: &Scene) {
        self.record_sought(recorder, scene, Sought::All);
    }

    fn record_sought(&self, recorder: &mut Recorder, scene: &Scene, what: Sought) {
        let (raster, frames, population) = (&self.renderer.raster, &scene.views.frames, &scene.model.population);
        match what {
            Sought::Scores => raster.record_scores(recorder, &self.grid, frames, population),
            Sought::Opacity => raster.record_blend_backward(recorder, &self.grid, frames, population, FROZEN),
            Sought::All => raster.record_blend_backward(recorder, &self.grid, frames, population, 0),
        }
    }

    /// Every index that the twins follow lies within what it indexes.
    fn is_sound(&self) -> bool {
        let i = &self.isects;
        let (count, isects) = (self.splats.len() as u32, i.isect_slots.len() as u32);
        let owned = |g: usize| u64::from(i.first_slot[g]) + u64::from(self.tile_counts[g]) <= u64::from(isects);
        i.global_from_rank.iter().chain(&i.global_from_slot).all(|&g| g < count)
            && i.isect_slots.iter().all(|&slot| slot < isects)
            && i.isect_tiles.iter().all(|&tile| (tile as usize) < i.tiling.count())
            && i.tile_ranges.iter().all(|r| r[0] <= r[1] && r[1] <= isects)
            && (0..count as usize).all(owned)
    }
}

/// `key` is the bits of the camera's z.
pub(super) fn wide(s: &types::Splat, colour: [f32; 3], key: u32) -> Splat {
    let ([x, y], [l11, l12, l22, opacity]) = (s.centre.map(f64::from), s.shape.map(f64::from));
    let [r, g, b, z] = [colour[0], colour[1], colour[2], f32::from_bits(key)].map(f64::from);
    Splat { x, y, l11, l12, l22, opacity, r, g, b, z }
}

fn case(
    bench: &mut Bench<'_>,
    scene: &Scene,
    twin: &reference::Rendered,
    tile: TileShape,
    compensate: bool,
) -> Result<()> {
    let chosen = tile == TileShape::for_subgroup(bench.context.info().subgroup_size);
    let policy = Policy { reduction: Reduction::Deterministic, compensate, ..Policy::default() };
    let ordered = Ordered::new(bench, scene, policy, tile)?;
    let variant = scene.variant(tile, compensate);
    let options = scene.options(tile, compensate);
    // What rendering does where nobody asks for depths or gradients.
    let mut plain = scene.renderer(bench, ordered.policy, |_| ())?;
    plain.render_on_device(&scene.model, &scene.views, 0, &scene.show)?;
    let times = bench.time(|recorder| {
        drop(plain.record(recorder, &scene.model, &scene.views, 0, &scene.show, &ordered.status));
    })?;
    let (tiling, isects) = (ordered.isects.tiling, &ordered.isects);
    let (count, visible) = (scene.params.count as f64, isects.global_from_rank.len() as f64);
    let isect_count = isects.isect_slots.len() as f64;

    // Projection.
    let projected = project(&scene.params, &scene.view, &options);
    let mut row = bench.row("project", &variant);
    compare_splats(&mut row, &ordered.splats, &ordered.depth_keys, &ordered.tile_counts, &projected, &tiling);
    let planes = (GEOMETRY_PLANES + sh_planes(scene.degree)) as f64;
    let supplement = f64::from(scene.model.count_of(Segment::Supplement));
    row.work = Work {
        bytes: count * 8.0 + 4.0 * (count * planes + 5.0 * supplement) + 36.0 * visible,
        // The SH dot products, the position (9), JW (12), RS (21), M (18), its products (15), the direction (6) and its basis
        // (30), the rows and spans of the tile list (40): 150 at least.
        operations: count * 9.0 + visible * (150.0 + planes - 11.0),
    };
    row.time = times.of("project");
    row.chosen = chosen && !compensate;
    bench.push(row);

    // Tile lists.
    let mut row = bench.row("emit", &variant);
    row.chosen = chosen && !compensate;
    row.time = times.of("emit");
    row.work.bytes = visible * (8.0 + 24.0 + 4.0) + isect_count * 8.0;
    if !ordered.is_sound() {
        // Nothing further can be compared: an index leads out of its buffer.
        row.unequal(u64::MAX);
        bench.push(row);
        return Ok(());
    }
    let (flips, wrong) = compare_lists(&ordered, bench.shift());
    row.flips(flips, isects.isect_slots.len());
    row.unequal(wrong);
    bench.push(row);
    let mut row = bench.row("tile_ranges", &variant);
    row.words(&isects.tile_ranges, &tile_ranges(&isects.isect_tiles, tiling.count()));
    row.chosen = chosen && !compensate;
    row.time = times.of("tile_ranges");
    row.work.bytes = (4.0 * isect_count.max(2.0).log2() + 8.0) * tiling.count() as f64;
    bench.push(row);

    let image = plain.raster.buffers.image.download_range(0, scene.pixels())?;
    let mut row = bench.row("(render)", &variant);
    row.chosen = chosen && !compensate;
    row.time = times.sum();
    compare_image(&mut row, &image, &twin.blended, Margin::image);
    bench.push(row);
    let calm = blends(bench, scene, &ordered, &image, times.of("blend"), &variant, chosen && !compensate)?;
    blend_backwards(bench, scene, &ordered, &calm, &variant, chosen && !compensate)?;
    if chosen && !compensate {
        let packed = Ordered::new(bench, scene, Policy { packed: true, ..policy }, tile)?;
        blend_backwards(bench, scene, &packed, &calm, &format!("{variant}, packed"), false)?;
        step::packed_cases(bench, scene, &packed, &options)?;
    }
    if chosen {
        step::cases(bench, scene, &ordered, twin, &options)?;
    }
    if chosen && !compensate {
        // What is chosen where deterministic gradients find no room.
        for reduction in Reduction::offered(bench.context).into_iter().filter(|r| *r != policy.reduction) {
            let ordered = Ordered::new(bench, scene, Policy { reduction, ..policy }, tile)?;
            blend_backwards(bench, scene, &ordered, &calm, &variant, false)?;
            let name = if reduction == Reduction::Atomic { step::ATOMIC } else { step::DETERMINISTIC };
            step::whole(bench, scene, &ordered, twin, &options, &format!("{name}{}", scene.suffix(false)))?;
        }
    }
    Ok(())
}

/// Projected splats against the twin's: numbers of what both see, flips in what is seen and in numbers of tiles.
pub(super) fn compare_splats(
    row: &mut super::Row,
    splats: &[Splat],
    depth_keys: &[u32],
    tile_counts: &[u32],
    projected: &Projected,
    tiling: &Tiling,
) {
    let both: Vec<usize> =
        (0..splats.len()).filter(|&i| depth_keys[i] != NONE && projected.tile_counts[i] > 0).collect();
    let fields: [fn(&Splat) -> f64; 10] =
        [|s| s.x, |s| s.y, |s| s.l11, |s| s.l12, |s| s.l22, |s| s.opacity, |s| s.r, |s| s.g, |s| s.b, |s| s.z];
    for field in fields {
        // The device's own were float32.
        row.numbers(both.iter().map(|&i| (field(&splats[i]) as f32, field(&projected.splats[i]))));
    }
    let (mut flips, mut wrong) = (0, 0);
    for i in 0..splats.len() {
        let (here, there) = (depth_keys[i] != NONE, projected.tile_counts[i] > 0);
        wrong += u64::from(here != (tile_counts[i] > 0));
        if here != there {
            let splat = if here { &splats[i] } else { &projected.splats[i] };
            flips += 1;
            wrong += u64::from(!is_marginal(splat, tiling));
        } else if tile_counts[i] != projected.tile_counts[i] {
            flips += 1;
        }
    }
    row.flips(flips, both.len());
    row.unequal(wrong);
}

/// Whether float32 may see a splat that float64 does not, or the other way round: its opacity is at the threshold, it is at
/// the near plane, or no pixel's centre is well within its ellipse.
pub(super) fn is_marginal(splat: &Splat, tiling: &Tiling) -> bool {
    let reaches = (0..tiling.height)
        .into_par_iter()
        .any(|row| (0..tiling.width).any(|column| alpha(splat, column, row) >= ALPHA_MIN * (1.0 + NEAR_THRESHOLD)));
    (255.0 * splat.opacity - 1.0).abs() < NEAR_THRESHOLD || (splat.z / NEAR - 1.0).abs() < NEAR_THRESHOLD || !reaches
}

fn alpha(splat: &Splat, column: u32, row: u32) -> f64 {
    let (u, v) = splat.whiten(column, row);
    splat.opacity * (-0.5 * (u * u + v * v)).exp()
}

/// With the twin's splats `shift` pixels aside: tiles in one list only, all of them without a pixel that is covered for sure, and what is wrong with the lists.
fn compare_lists(ordered: &Ordered, shift: f64) -> (usize, u64) {
    let Ordered { isects, splats, tile_counts, depth_keys, .. } = ordered;
    let tiling = isects.tiling;
    let mut wrong = 0;
    // Ranks: by depth, ties by index.
    let mut ranks: Vec<u32> = (0..depth_keys.len() as u32).filter(|&i| depth_keys[i as usize] != NONE).collect();
    ranks.sort_by_key(|&i| depth_keys[i as usize]);
    wrong += u64::from(ranks != isects.global_from_rank);
    // The list is sorted by tile and then by slot, and every slot is in it once.
    let mut tile_of_slot = vec![NONE; isects.isect_slots.len()];
    for (&slot, &tile) in isects.isect_slots.iter().zip(&isects.isect_tiles) {
        tile_of_slot[slot as usize] = tile;
    }
    wrong += tile_of_slot.iter().filter(|&&tile| tile == NONE).count() as u64;
    let keys = isects.isect_tiles.iter().zip(&isects.isect_slots);
    wrong += u64::from(!keys.is_sorted());
    let splats: Vec<Splat> = splats.iter().map(|s| Splat { x: s.x + shift, ..*s }).collect();
    let count = |splat| {
        let mut tiles = 0;
        for_each_tile(splat, &tiling, |_| tiles += 1);
        tiles
    };
    let counts: Vec<u32> = splats.iter().map(count).collect();
    let twin = emit(&splats, &counts, &isects.global_from_rank, &tiling);
    let mut slot = 0;
    let mut flips = 0;
    for &global in &isects.global_from_rank {
        let i = global as usize;
        let end = (slot + tile_counts[i] as usize).min(tile_of_slot.len());
        let (own, first) = (&tile_of_slot[slot..end], twin.first_slot[i] as usize);
        wrong += u64::from(isects.first_slot[i] as usize != slot || !own.is_sorted_by(|a, b| a < b));
        wrong += isects.global_from_slot[slot..end].iter().filter(|&&g| g != global).count() as u64;
        slot = end;
        let theirs = twin.global_from_slot[first..].iter().take_while(|&&g| g == global).count();
        let theirs = &twin.tile_of_slot[first..first + theirs];
        flips += own.iter().filter(|tile| theirs.binary_search(tile).is_err()).count();
        for tile in theirs.iter().filter(|tile| own.binary_search(tile).is_err()) {
            flips += 1;
            wrong += u64::from(covers(&splats[i], *tile, &tiling));
        }
    }
    wrong += u64::from(slot != tile_of_slot.len());
    (flips, wrong)
}

/// Whether a splat covers a pixel of a tile for sure.
pub(super) fn covers(splat: &Splat, tile: u32, tiling: &Tiling) -> bool {
    let (left, top) = (tile % tiling.tiles_x * tiling.tile_width, tile / tiling.tiles_x * tiling.tile_height);
    let mut rows = top..(top + tiling.tile_height).min(tiling.height);
    let columns = left..(left + tiling.tile_width).min(tiling.width);
    rows.any(|row| columns.clone().any(|c| alpha(splat, c, row) >= ALPHA_MIN * (1.0 + NEAR_THRESHOLD)))
}

/// The decisions that an image hangs on, without that of the order, which the lists decide.
pub(super) fn image_margin(margin: &Margin) -> f64 {
    margin.alpha.min(margin.transmittance).min(margin.occluder)
}

/// Pixels against the twin's: numbers where no threshold is near, flips where one is.
pub(super) fn compare_image(row: &mut super::Row, got: &[[f32; 4]], want: &Blended, margin: fn(&Margin) -> f64) {
    let is_calm = |pixel: &usize| margin(&want.margins[*pixel]) > NEAR_THRESHOLD;
    let calm: Vec<usize> = (0..got.len()).filter(is_calm).collect();
    row.numbers(calm.iter().flat_map(|&p| (0..3).map(move |c| (got[p][c], want.image[p][c]))));
    row.numbers(calm.iter().map(|&p| (got[p][3], want.image[p][3])));
    let off = |p: usize| !(0..4).all(|c| (f64::from(got[p][c]) - want.image[p][c]).abs() <= JUMP);
    row.flips((0..got.len()).filter(|p| !is_calm(p) && off(*p)).count(), got.len());
}

/// Pairs of pixel and splat that blending tests, and those that it blends.
pub(super) fn blend_pairs(splats: &[Splat], isects: &Intersections) -> [f64; 2] {
    let tiling = isects.tiling;
    (0..tiling.height)
        .into_par_iter()
        .map(|row| {
            let (mut tested, mut blended) = (0.0, 0.0);
            for column in 0..tiling.width {
                let mut transmittance = 1.0;
                for (_, global) in isects.of_pixel(column, row) {
                    tested += 1.0;
                    let alpha = alpha(&splats[global as usize], column, row).min(ALPHA_MAX);
                    if alpha >= ALPHA_MIN {
                        transmittance *= 1.0 - alpha;
                        if transmittance < TRANSMITTANCE_MIN {
                            break;
                        }
                        blended += 1.0;
                    }
                }
            }
            [tested, blended]
        })
        .reduce(|| [0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
}

/// A jump that no rounding makes: half a step of an 8-bit image is 2e-3.
const JUMP: f64 = 1e-3;

/// Blending with and without the median, whose `plain` image and time are given, and median depths. Returns what the twin
/// makes of the device's own lists.
fn blends(
    bench: &mut Bench<'_>,
    scene: &Scene,
    ordered: &Ordered,
    plain: &[[f32; 4]],
    plain_time: Option<f64>,
    variant: &str,
    chosen: bool,
) -> Result<Blended> {
    let (raster, pixels) = (&ordered.renderer.raster, scene.pixels());
    let colour = Background::Color(BACKGROUND.map(f64::from));
    let own = blend(&ordered.splats, &ordered.isects, colour, f64::from(MEDIAN_THRESHOLD));
    let [tested, blended] = blend_pairs(&ordered.splats, &ordered.isects);
    let visible = ordered.isects.global_from_rank.len() as f64;
    let frames = &scene.views.frames;
    let times = bench.time(|r| raster.record_blend(r, &ordered.grid, frames, BACKGROUND, MEDIAN_THRESHOLD))?;
    let with_median = raster.buffers.image.download_range(0, pixels)?;
    let ids = raster.buffers.median_ids.download_range(0, pixels)?;
    for (name, image, time) in [("", plain, plain_time), (", median", &with_median, times.of("blend"))] {
        let mut row = bench.row("blend", format!("{variant}{name}"));
        row.chosen = chosen;
        row.time = time;
        row.work = Work {
            bytes: 8.0 * ordered.isects.isect_slots.len() as f64 + 36.0 * visible + 16.0 * pixels as f64,
            // dy, u, v, the sum of squares, the half, the exponential, the opacity, the clamp, the test; then 1 − α, the test,
            // α T, three colours and the copy of T.
            operations: 9.0 * tested + 7.0 * blended,
        };
        compare_image(&mut row, image, &own, image_margin);
        if !name.is_empty() {
            let differ: Vec<usize> = (0..pixels).filter(|&p| ids[p] != own.median[p]).collect();
            let margin = |p: usize| image_margin(&own.margins[p]).min(own.margins[p].median);
            row.flips(differ.len(), pixels);
            row.unequal(differ.iter().filter(|&&p| margin(p) >= NEAR_THRESHOLD).count() as u64);
        }
        bench.push(row);
    }
    if chosen && scene.model.has_supplement() {
        for centre in [false, true] {
            let renderer = scene.renderer(bench, ordered.policy, |options| {
                options.depth = true;
                options.centre_depth = centre;
            })?;
            let (name, at) =
                if centre { ("centre", DepthAt::Centre) } else { ("maximum response", DepthAt::MaximumResponse) };
            median_depths(bench, scene, &renderer, at, name)?;
        }
    }
    Ok(own)
}

/// Of Gaussians wherever they are, so that some have their greatest response behind the camera.
pub(super) fn median_depths(
    bench: &mut Bench<'_>,
    scene: &Scene,
    renderer: &Renderer,
    at: DepthAt,
    name: &str,
) -> Result<()> {
    let centre = at == DepthAt::Centre;
    let (pixels, count) = (scene.pixels(), scene.params.count as u32);
    let ids: Vec<u32> = (0..pixels as u32).map(|p| if p % 9 == 4 { NONE } else { noise(p) % count }).collect();
    renderer.raster.buffers.median_ids.upload(0, &ids)?;
    let times = bench.time(|r| renderer.depths_of(r, &scene.model, &scene.views, 0, &scene.show))?;
    let mut row = bench.row("median_depth", name);
    row.chosen = !centre;
    let want = median_depth(&scene.params, &scene.view, &ids, at, 1.0);
    let got = renderer.depths.download_range(0, pixels)?;
    // At the near plane one side may take the centre instead.
    let near = |z: f64| (z / NEAR - 1.0).abs() < NEAR_THRESHOLD;
    let is_near = |p: &usize| !centre && (near(want[*p]) || near(f64::from(got[*p])));
    row.flips((0..pixels).filter(is_near).count(), pixels);
    row.numbers((0..pixels).filter(|p| !is_near(p)).map(|p| (got[p], want[p])));
    row.time = times.all("median_depth");
    row.work.bytes = 8.0 * pixels as f64 + if centre { 12.0 } else { 40.0 } * f64::from(count).min(pixels as f64);
    row.work.operations = if centre { 3.0 } else { 60.0 } * pixels as f64;
    bench.push(row);
    Ok(())
}

/// A smooth gradient that differs by channel; zero where float32 may have decided otherwise, so that the comparison is of the
/// arithmetic alone.
pub(super) fn image_grad(blended: &Blended, margin: fn(&Margin) -> f64) -> Vec<[f64; 3]> {
    let at = |p: usize| [0.0, 1.0, 2.0].map(|c: f64| f64::from((p as f64 * 0.013 + c).sin() as f32));
    let calm = |p: usize| margin(&blended.margins[p]) > NEAR_THRESHOLD;
    (0..blended.margins.len()).map(|p| if calm(p) { at(p) } else { [0.0; 3] }).collect()
}

/// The records of the device's own image by a smooth gradient, which is uploaded.
struct Wanted {
    records: Vec<Record>,
    magnitudes: Vec<Record>,
    /// Of pairs of pixel and splat.
    tested: f64,
    blended: f64,
}

impl Wanted {
    fn new(scene: &Scene, ordered: &Ordered, own: &Blended) -> Result<Self> {
        let (buffers, pixels) = (&ordered.renderer.raster.buffers, scene.pixels());
        let image_grad = image_grad(own, |margin| image_margin(margin).min(margin.clamp));
        let flat: Vec<f32> = image_grad.iter().flatten().map(|&g| g as f32).collect();
        buffers.image_grad.upload(0, &flat)?;
        // The kernel takes what lies behind from the device's image.
        let image = buffers.image.download_range(0, pixels)?;
        let image: Vec<[f64; 4]> = image.into_iter().map(|p| p.map(f64::from)).collect();
        let [tested, blended] = blend_pairs(&ordered.splats, &ordered.isects);
        Ok(Wanted {
            records: blend_backward(&ordered.splats, &ordered.isects, &image, &image_grad),
            magnitudes: blend_backward_magnitudes(&ordered.splats, &ordered.isects, &image, &image_grad),
            tested,
            blended,
        })
    }

    /// What it takes to make so many records.
    fn work(&self, scene: &Scene, ordered: &Ordered, records: usize, what: Sought, packed: bool) -> Work {
        let (isects, visible) = (ordered.isects.isect_slots.len() as f64, ordered.isects.global_from_rank.len() as f64);
        let of_record = match (what, packed) {
            (_, true) => 16.0,
            (Sought::All, false) => 36.0,
            (Sought::Scores | Sought::Opacity, false) => 12.0,
        };
        // Of blended pairs, beside the forward pass.
        let of_pair = match what {
            Sought::Scores => 6.0,
            Sought::Opacity => 14.0,
            Sought::All => 26.0,
        };
        Work {
            bytes: 8.0 * isects + of_record * records as f64 + 36.0 * visible + 28.0 * scene.pixels() as f64,
            // The forward pass's, and: share, pull (3), behind, ∂α (3), and the sums: opacity; where all are wanted g,
            // colour (3), w (2), w wᵀ (6).
            operations: 9.0 * self.tested + of_pair * self.blended,
        }
    }
}

/// Records by slot or by Gaussian: all, or the opacity's part and, of what is blended, a mark.
fn compare_records(row: &mut super::Row, got: &[Record32], want: &[Record], magnitudes: &[Record], all: bool) {
    let part = |parts: std::ops::Range<usize>| {
        let of = move |s: usize| parts.clone().map(move |k| (got[s][k], want[s][k], magnitudes[s][k]));
        (0..want.len()).flat_map(of)
    };
    row.sums(part(2..3));
    if all {
        [0..2, 3..6, 6..9].into_iter().for_each(|parts| row.sums(part(parts)));
    } else {
        // Nothing blended has the mark; what is blended may have it with an opacity gradient of 0.
        let is_right = |(got, want): (&Record32, &Record)| {
            let blended = want.iter().any(|&part| part != 0.0);
            (0..9).all(|k| [0, 2].contains(&k) || got[k] == 0.0) && (got[0] > 0.0 || !blended)
        };
        row.unequal(got.iter().zip(want).filter(|pair| !is_right(*pair)).count() as u64);
    }
}

/// Packed records by slot: numbers that are the same, and flips where what float32 rounds falls on the other side of a code.
fn compare_packed(row: &mut super::Row, got: &[[u32; 4]], want: &[Record], magnitudes: &[Record], all: bool) {
    let (mut same, mut flips) = (Vec::new(), 0);
    let parts: &[usize] = if all { &[0, 1, 2, 3, 4, 5, 6, 7, 8] } else { &[2] };
    for ((&got, want), terms) in got.iter().zip(want).zip(magnitudes) {
        let wanted = pack_record(want, !all);
        let [got_parts, want_parts] = [got, wanted].map(unpack_record);
        let blended = want.iter().any(|&part| part != 0.0);
        row.unequal(u64::from(!all && blended && got_parts[0] != 1.0));
        for &k in parts {
            if got_parts[k] == want_parts[k] {
                same.push((got_parts[k] as f32, want_parts[k]));
                continue;
            }
            flips += 1;
            // A code beside it, of the larger unit where the largest number of the part is at a power of two; and what the sums themselves
            // are off by where their terms cancel, ten times what all but one in a thousand are.
            let near = 1.01 * unit_of(got, k).max(unit_of(wanted, k)) + 1e-4 * terms[k];
            let off = (got_parts[k] - want_parts[k]).abs();
            row.unequal(u64::from(off.is_nan() || off > near));
        }
    }
    row.gradients(same);
    row.flips(flips, want.len() * parts.len());
}

fn blend_backwards(
    bench: &mut Bench<'_>,
    scene: &Scene,
    ordered: &Ordered,
    own: &Blended,
    variant: &str,
    chosen: bool,
) -> Result<()> {
    let wanted = Wanted::new(scene, ordered, own)?;
    let raster = &ordered.renderer.raster;
    let packed = raster.packs_records();
    let by_gaussian = |records: Vec<Record>| match raster.by_gaussian() {
        true => blend_backward_atomic(&ordered.isects, &records, scene.params.count),
        false => records,
    };
    let (want, magnitudes) = (by_gaussian(wanted.records.clone()), by_gaussian(wanted.magnitudes.clone()));
    let Some(stage) = raster.backward_stage() else { return Ok(()) };
    let (bits, count) = (|| read_bits(&raster.records, packed, want.len()), want.len());
    for what in [Sought::Scores, Sought::Opacity, Sought::All] {
        let times = bench.time(|recorder| ordered.record_sought(recorder, scene, what))?;
        let got = bits()?;
        let name = match what {
            Sought::Scores => "scores",
            Sought::Opacity => "opacity only",
            Sought::All => "all",
        };
        let mut row = bench.row(stage, format!("{variant}, {name}"));
        if ordered.policy.reduction == Reduction::Deterministic {
            // Sums in a fixed order: another run gives the same bits.
            let mut recorder = bench.context.recorder("again")?;
            ordered.record_sought(&mut recorder, scene, what);
            recorder.submit()?.wait()?;
            row.words(&bits()?, &got);
        }
        match (what, packed) {
            (Sought::Scores, packed) => {
                let colours: Vec<[f32; 3]> = match packed {
                    true => {
                        let words = raster.records.record_words.download_range(0, count)?;
                        words.into_iter().map(|w| [w[0], w[1], w[2]].map(f32::from_bits)).collect()
                    }
                    false => raster.records.record_colours.download_range(0, count)?,
                };
                for c in 0..2 {
                    row.sums((0..count).map(|s| (colours[s][c], want[s][6 + c], magnitudes[s][6 + c])));
                }
            }
            (_, true) => {
                let words = raster.records.record_words.download_range(0, count)?;
                compare_packed(&mut row, &words, &want, &magnitudes, what == Sought::All);
            }
            (_, false) => {
                let got = read_records(raster, count)?;
                compare_records(&mut row, &got, &want, &magnitudes, what == Sought::All);
            }
        }
        row.chosen = chosen;
        row.time = times.sum();
        row.work = wanted.work(scene, ordered, count, what, packed);
        bench.push(row);
    }
    Ok(())
}

/// What a backward pass is asked for: sums by blend weight, or gradients, of the opacity alone or all.
#[derive(Clone, Copy, PartialEq)]
enum Sought {
    Scores,
    Opacity,
    All,
}

/// As many segments as learn their opacity only: all of them.
const FROZEN: u32 = Segment::ALL.len() as u32;

/// A gradient record as the device has it, in the order of the twin's.
pub(super) type Record32 = [f32; 9];

/// The first `count` records, by slot or by Gaussian.
pub(super) fn read_records(raster: &Raster, count: usize) -> Result<Vec<Record32>> {
    let records = &raster.records;
    if raster.packs_records() {
        let words = records.record_words.download_range(0, count)?;
        return Ok(words.into_iter().map(|words| unpack_record(words).map(|part| part as f32)).collect());
    }
    let centres = records.record_centres.download_range(0, count)?;
    let shapes = records.record_shapes.download_range(0, count)?;
    let colours = records.record_colours.download_range(0, count)?;
    let record = |i: usize| std::array::from_fn(|k| [centres[i], shapes[i], colours[i]][k / 3][k % 3]);
    Ok((0..count).map(record).collect())
}

/// All words of the first `count` records.
fn read_bits(records: &Records, packed: bool, count: usize) -> Result<Vec<u32>> {
    if packed {
        return Ok(records.record_words.download_range(0, count)?.into_flattened());
    }
    let parts = [&records.record_centres, &records.record_shapes, &records.record_colours];
    let parts = parts.map(|part| part.download_range(0, count));
    let mut bits = Vec::new();
    for part in parts {
        bits.extend(part?.into_iter().flatten().map(f32::to_bits));
    }
    Ok(bits)
}
