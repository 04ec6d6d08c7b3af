//! The 2D stage: batches of frames, their Gaussians' life from draw to prune.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Bench, NEAR_THRESHOLD, judge::Row};
use crate::{
    error::Result,
    gpu::{Buffer, Location, Recorder},
    pipelines::{
        plane::PLANES,
        raster::{Grid, ISECTS, Raster, RasterOptions, Reduction, WORKGROUP},
    },
    reference::{
        Background, Intersections, NONE, Options, Splat,
        blend::{Blended, blend},
        blend_backward::{Record, blend_backward},
        screen_backward::{ScreenGrad, ScreenMoments, screen_backward, screen_step},
        screen_draw::{Draw, draw_size, key, new_screen_gaussian, screen_draw},
        screen_project::{Plane, screen_project},
        screen_prune::screen_prune,
        screen_tiles::{WINDOW_RADIUS, screen_tiles},
        tiles::Tiling,
    },
    stages::{
        screen_backward::{self as backward_stage, ScreenBackward},
        screen_draw::{self as draw_stage, ScreenDraw},
        screen_project::{self as project_stage, ScreenProject},
        screen_prune::{self as prune_stage, ScreenPrune},
        screen_tiles::{self as tiles_stage, ScreenTiles},
        ssim_forward::{TILE, tiles_per_frame},
        step_done::{OVERFLOW, STATUS_WORDS},
        types::{Frame, ScreenState, Quota},
    },
    verify::raster::{compare_image, image_margin, is_marginal, wide},
};

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    let (frames, count) = if quick { (SMALL_FRAMES, 160) } else { (frames([(403, 301), (280, 333)]), 4000) };
    batch(bench, frames, count)?;
    prune(bench, frames, if quick { 500 } else { 20_000 })?;
    draw(bench, frames, quick)
}

/// Two frames behind one another.
pub const fn frames([a, b]: [(u32, u32); 2]) -> [Frame; 2] {
    [
        Frame { image_first: 0, target_first: 0, width: a.0, height: a.1 },
        Frame { image_first: a.0 * a.1, target_first: a.0 * a.1, width: b.0, height: b.1 },
    ]
}

/// Two frames of different sizes, neither of whole tiles.
pub const SMALL_FRAMES: [Frame; 2] = frames([(61, 43), (50, 70)]);

/// Pixels of all frames.
pub fn pixel_count(frames: &[Frame; 2]) -> usize {
    frames.iter().map(|f| (f.width * f.height) as usize).sum()
}

/// The part of a frame in a buffer of all pixels.
pub fn pixels_of<'a, T>(all: &'a [T], frame: &Frame) -> &'a [T] {
    &all[frame.image_first as usize..][..(frame.width * frame.height) as usize]
}

/// Random 2D Gaussians on slots of two frames in turns; every seventh slot is empty.
pub struct Scattered {
    pub planes: Vec<Plane>,
    /// Frame of each slot, [`NONE`] where it is empty.
    pub frames: Vec<u32>,
    /// By pixel of all frames, a tenth of them 0.
    pub depths: Vec<f32>,
}

impl Scattered {
    pub fn new(all: &[Frame; 2], seed: u64, count: usize) -> (Self, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let frames: Vec<u32> = (0..count).map(|i| if i % 7 == 3 { NONE } else { (i / 2 % 2) as u32 }).collect();
        let planes = frames
            .iter()
            .map(|&f| {
                let frame = all[f.min(1) as usize];
                let mut plane = [0.0; 10];
                // Rounded to float32, so that both sides begin with the same.
                let mut set = |p: usize, x: f64| plane[p] = f64::from(x as f32);
                set(0, rng.random_range(0.0..frame.width as f64));
                set(1, rng.random_range(0.0..frame.height as f64));
                (2..5).for_each(|c| set(c, rng.random_range(0.0..1.0)));
                set(5, rng.random_range(-5.0..3.0));
                set(6, rng.random_range(-1.0..2.3));
                set(7, rng.random_range(-1.0..2.3));
                set(8, rng.random_range(-1.5..1.5));
                plane
            })
            .collect();
        let depth = |rng: &mut ChaCha8Rng| if rng.random_bool(0.1) { 0.0 } else { rng.random_range(1.0..9.0) };
        let depths = (0..pixel_count(all)).map(|_| depth(&mut rng)).collect();
        (Scattered { planes, frames, depths }, rng)
    }

    /// Plane-major, as the device has it.
    pub fn columns(&self) -> Vec<f32> {
        let n = self.planes.len();
        (0..PLANES * n).map(|k| self.planes[k % n][k / n] as f32).collect()
    }

    /// The Gaussians of a frame and their slots.
    pub fn of_frame(&self, f: u32) -> (Vec<Plane>, Vec<usize>) {
        let slots: Vec<usize> = (0..self.planes.len()).filter(|&i| self.frames[i] == f).collect();
        (slots.iter().map(|&i| self.planes[i]).collect(), slots)
    }
}

/// Projection, tile lists, blending and its backward pass of two frames at once, gradients and the step.
fn batch(bench: &mut Bench<'_>, all: [Frame; 2], count: usize) -> Result<()> {
    let context = bench.context;
    let pixels = pixel_count(&all);
    let (scene, mut rng) = Scattered::new(&all, 3, count);
    let tile = crate::pipelines::raster::TileShape::for_subgroup(context.info().subgroup_size);
    let (width, height) = (all[0].width.max(all[1].width), all[0].height.max(all[1].height));
    let grid = Grid::new(tile, 0, 2, width, height);
    let options = RasterOptions {
        splats: count as u32,
        pixels: pixels as u32,
        tiles: grid.tiles(),
        isects: 1 << 18,
        batch: true,
        background_image: true,
        median: false,
        backward: true,
        reduction: Reduction::Deterministic,
    };
    let raster = Raster::new(context, options)?;
    let backdrop: Vec<[f32; 4]> = (0..pixels).map(|_| [0; 4].map(|_| rng.random_range(0.0..1.0))).collect();
    raster.backdrop.upload(0, &backdrop)?;
    let frames = Buffer::from_slice(context, "frames", &all)?;
    let screen_frames = Buffer::from_slice(context, "plane frames", &scene.frames)?;
    let states = Buffer::from_slice(context, "states", &[ScreenState { count: 0, stepping: 1 }; 2])?;
    let depths = Buffer::from_slice(context, "depths", &scene.depths)?;
    let plane = Buffer::from_slice(context, "plane", &scene.columns())?;
    let status = Buffer::<u32>::zeroed(context, "status", STATUS_WORDS)?;
    let spec = project_stage::Spec { workgroup_size: WORKGROUP, tile_width: tile.width, tile_height: tile.height };
    let project = ScreenProject::new(context, &spec)?;
    let times = bench.time(|recorder| {
        let buffers = project_stage::Buffers {
            frames: &frames,
            screen_frames: &screen_frames,
            screen_states: &states,
            depths: &depths,
            plane: &plane,
            splats: &raster.splats,
            depth_keys: &raster.depth_keys,
            tile_counts: &raster.tile_counts,
        };
        project.record(recorder, &buffers, &project_stage::Push { count: count as u32, stride: count as u32 });
        raster.record_order(recorder, count as u32, &grid, &frames, &screen_frames, &status);
        raster.record_blend(recorder, &grid, &frames, [0.0; 3], 0.0);
    })?;
    let (splats, keys) = (raster.splats.download()?, raster.depth_keys.download()?);
    let (tile_counts, first_slot) = (raster.tile_counts.download()?, raster.first_slot.download()?);
    let image = raster.image.download()?;
    let isect_count = raster.count.download()?[ISECTS as usize] as usize;
    let slots = raster.isect_slots().download_range(0, isect_count)?;
    let global_from_slot = raster.global_from_slot().download_range(0, isect_count)?;
    let ranges = raster.tile_ranges.download()?;
    let visible: Vec<usize> = (0..count).filter(|&i| keys[i] != NONE).collect();
    let mut row = bench.row("screen_project", format!("{tile}"));
    row.time = times.of("screen_project");
    row.work.bytes = count as f64 * 48.0 + visible.len() as f64 * 44.0;
    let sound = status.download()?[OVERFLOW] == 0
        && slots.iter().all(|&s| (s as usize) < isect_count)
        && global_from_slot.iter().all(|&g| (g as usize) < count)
        && ranges.iter().all(|r| r[0] <= r[1] && r[1] as usize <= isect_count)
        && visible.iter().all(|&i| first_slot[i] as usize + tile_counts[i] as usize <= isect_count);
    if !sound {
        // Nothing further can be compared: an index leads out of its buffer.
        row.unequal(u64::MAX);
        bench.push(row);
        return Ok(());
    }
    let own: Vec<Splat> =
        (0..count).map(|i| if keys[i] == NONE { Splat::default() } else { wide(&splats[i]) }).collect();

    let options = Options { tile_width: tile.width, tile_height: tile.height, ..Default::default() };
    let depths64: Vec<f64> = scene.depths.iter().map(|&z| f64::from(z)).collect();
    let mut blend_row = bench.row("blend", format!("{tile}, batch, background image"));
    blend_row.time = times.of("blend");
    blend_row.work.bytes = 8.0 * isect_count as f64 + 40.0 * visible.len() as f64 + 32.0 * pixels as f64;
    let mut both: Vec<(usize, Splat)> = Vec::new();
    let (mut flips, mut wrong) = (0, 0);
    let mut image_grad = vec![0f32; 3 * pixels];
    let mut records: Vec<Record> = vec![[0.0; 9]; isect_count];
    let mut with_depths: Vec<(Vec<Plane>, Vec<usize>)> = Vec::new();
    for (f, frame) in all.iter().enumerate() {
        let (mut planes, of_frame) = scene.of_frame(f as u32);
        let (width, height) = (frame.width, frame.height);
        let projected = screen_project(&mut planes, pixels_of(&depths64, frame), width, height, &options);
        let tiling = Tiling::new(width, height, &options);
        for (j, &i) in of_frame.iter().enumerate() {
            let (here, there) = (keys[i] != NONE, projected.tile_counts[j] > 0);
            if here != there {
                flips += 1;
                let splat = if here { &own[i] } else { &projected.splats[j] };
                // A 2D Gaussian's z does not decide anything.
                wrong += u64::from(!is_marginal(&Splat { z: 1.0, ..*splat }, &tiling));
            } else if here {
                flips += usize::from(tile_counts[i] != projected.tile_counts[j]);
                let z = planes[j][9];
                wrong += u64::from(keys[i] != if z > 0.0 { (z as f32).to_bits() } else { f32::INFINITY.to_bits() });
                both.push((i, projected.splats[j]));
            }
        }
        // The tiles of a frame lie in a grid for the largest of them.
        let per_frame = grid.tiles_per_frame() as usize;
        let isects = Intersections {
            tiling: Tiling { tiles_x: grid.tiles_x, tiles_y: grid.tiles_y, ..tiling },
            global_from_rank: vec![],
            isect_tiles: vec![],
            isect_slots: slots.clone(),
            global_from_slot: global_from_slot.clone(),
            first_slot: vec![],
            tile_ranges: ranges[f * per_frame..][..per_frame].to_vec(),
        };
        let behind: Vec<[f64; 3]> =
            pixels_of(&backdrop, frame).iter().map(|p| [p[0], p[1], p[2]].map(f64::from)).collect();
        let blended = blend(&own, &isects, Background::Image(&behind), 0.0);
        let got = pixels_of(&image, frame);
        compare_image(&mut blend_row, got, &blended, image_margin);
        let grads = random_grad(&blended, &mut rng);
        for (p, grad) in grads.iter().enumerate() {
            let at = 3 * (frame.image_first as usize + p);
            (0..3).for_each(|c| image_grad[at + c] = grad[c] as f32);
        }
        let got: Vec<[f64; 4]> = got.iter().map(|p| p.map(f64::from)).collect();
        for (sum, part) in records.iter_mut().zip(blend_backward(&own, &isects, &got, &grads)) {
            (0..9).for_each(|k| sum[k] += part[k]);
        }
        with_depths.push((planes, of_frame));
    }
    let fields: [fn(&Splat) -> f64; 10] =
        [|s| s.x, |s| s.y, |s| s.l11, |s| s.l12, |s| s.l22, |s| s.opacity, |s| s.r, |s| s.g, |s| s.b, |s| s.z];
    for field in fields {
        // The device's own were float32.
        row.numbers(both.iter().map(|(i, twin)| (field(&own[*i]) as f32, field(twin))));
    }
    row.flips(flips, both.len());
    row.unequal(wrong);
    bench.push(row);
    bench.push(blend_row);

    tiles(bench, &all, &frames, &screen_frames, &raster, &scene.frames, &own, &tile_counts, &keys)?;

    raster.image_grad.upload(0, &image_grad)?;
    let times = bench.time(|recorder| raster.record_blend_backward(recorder, &grid, &frames, 0))?;
    let got = raster.records.download_range(0, 9 * isect_count)?;
    let mut row = bench.row("blend_backward", format!("{tile}, batch, all"));
    for parts in [0..2, 2..5, 5..6, 6..9] {
        let (got, records) = (&got, &records);
        let pairs = (0..isect_count).flat_map(|s| parts.clone().map(move |k| (got[9 * s + k], records[s][k])));
        row.gradients(pairs);
    }
    row.time = times.sum();
    row.work.bytes = 44.0 * isect_count as f64 + 40.0 * visible.len() as f64 + 28.0 * pixels as f64;
    bench.push(row);

    // Gradients from the device's own records, and the step from its own gradients.
    let records: Vec<Record> = got.chunks_exact(9).map(|r| std::array::from_fn(|k| f64::from(r[k]))).collect();
    let grads: Vec<Vec<ScreenGrad>> = with_depths
        .iter()
        .map(|(planes, of_frame)| {
            let counts: Vec<u32> = of_frame.iter().map(|&i| if keys[i] == NONE { 0 } else { tile_counts[i] }).collect();
            let firsts = of_frame.iter().map(|&i| if keys[i] == NONE { 0 } else { first_slot[i] }).collect();
            let isects = Intersections {
                tiling: Tiling::new(1, 1, &options),
                global_from_rank: vec![],
                isect_tiles: vec![],
                isect_slots: vec![],
                global_from_slot: vec![],
                first_slot: firsts,
                tile_ranges: vec![],
            };
            screen_backward(planes, &counts, &isects, &records)
        })
        .collect();
    let start: Vec<f32> = (0..18 * count)
        .map(
            |k| if (k / count).is_multiple_of(2) { rng.random_range(-0.1..0.1) } else { rng.random_range(0.001..0.01) },
        )
        .collect();
    let ages: Vec<u32> = (0..count as u32).map(|i| [0, 1, 5, 80, 1500][i as usize % 5]).collect();
    let screen_ages = Buffer::from_slice(context, "ages", &ages)?;
    let moments = Buffer::from_slice(context, "moments", &start)?;
    let gradients = Buffer::<f32>::zeroed(context, "gradients", 18 * count)?;
    // With the depths that projection took.
    let before = plane.download()?;
    let run = |bench: &Bench<'_>, gradients_only: bool, into: &Buffer<f32>| -> Result<Option<f64>> {
        let spec = backward_stage::Spec { workgroup_size: WORKGROUP, gradients: gradients_only };
        let stage = ScreenBackward::new(context, &spec)?;
        let prepare = || -> Result<()> {
            if !gradients_only {
                plane.upload(0, &before)?;
                screen_ages.upload(0, &ages)?;
                moments.upload(0, &start)?;
            }
            Ok(())
        };
        let times = bench.time_after(prepare, |recorder| {
            let buffers = backward_stage::Buffers {
                status: &status,
                frames: &frames,
                screen_frames: &screen_frames,
                screen_states: &states,
                tile_counts: &raster.tile_counts,
                first_slot: &raster.first_slot,
                records: &raster.records,
                plane: &plane,
                screen_ages: &screen_ages,
                screen_moments: into,
            };
            stage.record(
                recorder,
                &buffers,
                &backward_stage::Push { count: count as u32, stride: count as u32, by_gaussian: 0 },
            );
        })?;
        Ok(times.of("screen_backward"))
    };
    let mut row = bench.row("screen_backward", "gradients");
    row.chosen = false;
    row.time = run(bench, true, &gradients)?;
    row.work.bytes = 36.0 * isect_count as f64 + 4.0 * count as f64 * (3.0 + 9.0 + 9.0);
    let got = gradients.download()?;
    for planes in [0..2, 2..5, 5..6, 6..8, 8..9] {
        let pairs = planes.flat_map(|p| {
            let (got, grads, with_depths) = (&got, &grads, &with_depths);
            (0..2).flat_map(move |f| {
                let slots = with_depths[f].1.iter().enumerate();
                slots.map(move |(j, &i)| (got[2 * p * count + i], grads[f][j][p]))
            })
        });
        row.gradients(pairs);
    }
    bench.push(row);

    let mut row = bench.row("screen_backward", "step");
    row.time = run(bench, false, &moments)?;
    row.work.bytes = 36.0 * isect_count as f64 + 4.0 * count as f64 * (5.0 + 54.0);
    let (after, after_moments, after_ages) = (plane.download()?, moments.download()?, screen_ages.download()?);
    let mut pairs: [[Vec<(f32, f64)>; 9]; 3] = Default::default();
    let mut wrong = 0;
    for (f, (planes, of_frame)) in with_depths.iter_mut().enumerate() {
        let own: Vec<ScreenGrad> =
            of_frame.iter().map(|&i| std::array::from_fn(|p| f64::from(got[2 * p * count + i]))).collect();
        let mut state: Vec<ScreenMoments> = of_frame
            .iter()
            .map(|&i| ScreenMoments {
                first: std::array::from_fn(|p| f64::from(start[2 * p * count + i])),
                second: std::array::from_fn(|p| f64::from(start[(2 * p + 1) * count + i])),
                age: ages[i],
            })
            .collect();
        screen_step(planes, &own, &mut state, all[f].width, all[f].height);
        for (j, &i) in of_frame.iter().enumerate() {
            wrong += u64::from(after_ages[i] != state[j].age);
            for p in 0..9 {
                pairs[0][p].push((after[p * count + i], planes[j][p]));
                pairs[1][p].push((after_moments[2 * p * count + i], state[j].first[p]));
                pairs[2][p].push((after_moments[(2 * p + 1) * count + i], state[j].second[p]));
            }
        }
    }
    // Empty slots are as they were.
    for i in (0..count).filter(|&i| scene.frames[i] == NONE) {
        let kept = (0..9).all(|p| after[p * count + i] == before[p * count + i]);
        wrong += u64::from(!kept || (keys[i], tile_counts[i], after_ages[i]) != (NONE, 0, ages[i]));
    }
    row.unequal(wrong);
    pairs.into_iter().flatten().for_each(|pairs| row.numbers(pairs));
    bench.push(row);
    Ok(())
}

/// Tiles of the loss that the device's splats need: at least the exact ones, at most those of boxes a hundredth of a pixel wider.
#[expect(clippy::too_many_arguments, reason = "private: what the batch knows")]
fn tiles(
    bench: &mut Bench<'_>,
    all: &[Frame; 2],
    frames: &Buffer<Frame>,
    screen_frames: &Buffer<u32>,
    raster: &Raster,
    frame_of: &[u32],
    own: &[Splat],
    tile_counts: &[u32],
    keys: &[u32],
) -> Result<()> {
    let context = bench.context;
    let tiles_per_frame = tiles_per_frame(all);
    let most = 2 * tiles_per_frame as usize;
    let words = |name: &str, len: usize| Buffer::<u32>::zeroed(context, name, len);
    let (tile_marks, count) = (words("tile marks", 2 * most)?, words("tile count", 2)?);
    let lists = [words("forward tiles", most)?, words("backward tiles", most)?];
    let stage = ScreenTiles::new(context, WORKGROUP)?;
    let record = |recorder: &mut Recorder, slots: usize| {
        let buffers = tiles_stage::Buffers {
            frames,
            screen_frames,
            tile_counts: &raster.tile_counts,
            splats: &raster.splats,
            tile_marks: &tile_marks,
            count: &count,
            forward_tiles: &lists[0],
            backward_tiles: &lists[1],
        };
        stage.record(recorder, &buffers, &tiles_stage::Push { slots: slots as u32, tiles_per_frame });
    };
    let mut row = bench.row("screen_tiles", "");
    let (mut flips, mut listed) = (0, 0);
    // With few slots most tiles are not listed, with all of them most are. (A perturbed twin is half a tile off.)
    for slots in [2, 5, 9, own.len()] {
        let mut recorder = context.recorder("plane tiles")?;
        record(&mut recorder, slots);
        recorder.submit()?.wait()?;
        let lengths = count.download()?;
        for (k, halo) in [WINDOW_RADIUS, 0.0].into_iter().enumerate() {
            let mut got = lists[k].download_range(0, lengths[k] as usize)?;
            got.sort_unstable();
            row.unequal(u64::from(!got.is_sorted_by(|a, b| a < b) || got.len() != lengths[k] as usize));
            listed += got.len();
            let mut known = 0;
            for (f, frame) in all.iter().enumerate() {
                let of_frame: Vec<usize> = (0..slots).filter(|&i| frame_of[i] == f as u32 && keys[i] != NONE).collect();
                let splats: Vec<Splat> =
                    of_frame.iter().map(|&i| Splat { x: own[i].x + 8.0 * bench.shift(), ..own[i] }).collect();
                let counts: Vec<u32> = of_frame.iter().map(|&i| tile_counts[i]).collect();
                let twin = |halo| screen_tiles(&splats, &counts, frame.width, frame.height, TILE, halo);
                let first = f as u32 * tiles_per_frame;
                let here: Vec<u32> =
                    got.iter().filter(|&&t| t / tiles_per_frame == f as u32).map(|t| t - first).collect();
                known += here.len();
                let (least, most) = (twin(halo), twin(halo + 0.01));
                flips += here.iter().filter(|t| !least.contains(t)).count();
                let missing = least.iter().filter(|t| here.binary_search(t).is_err()).count();
                let extra = here.iter().filter(|t| !most.contains(t)).count();
                row.unequal((missing + extra) as u64);
            }
            row.unequal((got.len() - known) as u64);
        }
    }
    let times = bench.time(|recorder| record(recorder, own.len()))?;
    row.flips(flips, listed);
    row.time = times.of("screen_tiles");
    row.work.bytes = own.len() as f64 * (8.0 + 24.0) + 4.0 * (2 * most + listed) as f64;
    bench.push(row);
    Ok(())
}

/// Random where the image is calm, nothing elsewhere.
fn random_grad(blended: &Blended, rng: &mut ChaCha8Rng) -> Vec<[f64; 3]> {
    let calm = |p: usize| image_margin(&blended.margins[p]).min(blended.margins[p].clamp) > NEAR_THRESHOLD;
    (0..blended.margins.len())
        .map(|p| if calm(p) { [0; 3].map(|_| f64::from(rng.random_range(-1.0..1.0f32))) } else { [0.0; 3] })
        .collect()
}

fn prune(bench: &mut Bench<'_>, all: [Frame; 2], count: usize) -> Result<()> {
    let context = bench.context;
    let (mut scene, mut rng) = Scattered::new(&all, 4, count);
    for plane in &mut scene.planes {
        plane[5] = f64::from(rng.random_range(-6.0..2.0f32));
        plane[6] = f64::from(rng.random_range(-1.0..1.5f32));
    }
    scene.planes[1][0] = f64::NAN;
    scene.planes[2][5] = f64::NAN;
    let frames = Buffer::from_slice(context, "frames", &all)?;
    let plane = Buffer::from_slice(context, "plane", &scene.columns())?;
    let screen_frames = Buffer::from_slice(context, "plane frames", &scene.frames)?;
    let states = Buffer::from_slice(context, "states", &[ScreenState { count: 0, stepping: 1 }; 2])?;
    let status = Buffer::<u32>::zeroed(context, "status", STATUS_WORDS)?;
    let stage = ScreenPrune::new(context, &prune_stage::Spec { workgroup_size: WORKGROUP })?;
    let times = bench.time_after(
        || Ok(screen_frames.upload(0, &scene.frames)?),
        |recorder| {
            let buffers = prune_stage::Buffers {
                status: &status,
                frames: &frames,
                screen_states: &states,
                plane: &plane,
                screen_frames: &screen_frames,
            };
            stage.record(recorder, &buffers, &prune_stage::Push { count: count as u32, stride: count as u32 });
        },
    )?;
    let left = screen_frames.download()?;
    let mut row = bench.row("screen_prune", "");
    row.time = times.of("screen_prune");
    let (mut flips, mut wrong) = (0, 0);
    for (f, frame) in all.iter().enumerate() {
        let (mut planes, slots) = scene.of_frame(f as u32);
        planes.iter_mut().for_each(|plane| plane[5] += bench.shift());
        let keep = screen_prune(&planes, frame.width, frame.height);
        for (j, &i) in slots.iter().enumerate() {
            if (left[i] != NONE) == keep[j] {
                continue;
            }
            flips += 1;
            // A pixel within float32's error of 1/255, or an opacity of 0.005, may go either way.
            let moved = |by: f64| {
                let mut plane = planes[j];
                plane[5] += by;
                screen_prune(&[plane], frame.width, frame.height)[0]
            };
            wrong += u64::from(moved(NEAR_THRESHOLD) == moved(-NEAR_THRESHOLD));
        }
    }
    row.flips(flips, count);
    row.unequal(wrong);
    row.work.bytes = count as f64 * 4.0 * 8.0;
    bench.push(row);
    Ok(())
}

fn draw(bench: &mut Bench<'_>, all: [Frame; 2], quick: bool) -> Result<()> {
    let context = bench.context;
    let pixels = pixel_count(&all);
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let stage = ScreenDraw::new(context, &draw_stage::Spec { workgroup_size: 256 })?;
    let frames = Buffer::from_slice(context, "frames", &all)?;
    let image: Vec<[f32; 4]> = (0..pixels).map(|_| [0; 4].map(|_| rng.random_range(-0.2..1.2))).collect();
    let images = Buffer::from_slice(context, "image", &image)?;
    let mut row = bench.row("screen_draw", "");
    // Budgets; the share of pixels with a loss; the share of taken slots.
    let many = if quick { 900 } else { 20_000 };
    for (round, (budgets, dense, taken)) in (1..).zip([
        ([100, 37], 1.0, 0.0),
        ([2, 0], 1.0, 0.0),
        ([600, 3000], 0.02, 0.1),
        ([50, 60], 0.0, 0.5),
        ([many, 1], 0.5, 0.3),
    ]) {
        let slots = (budgets[0] + budgets[1]) as usize;
        let losses: Vec<f32> = (0..pixels)
            .map(|_| if rng.random_bool(dense) { rng.random_range(0.0..1.2f32).powi(3) } else { 0.0 })
            .collect();
        let before: Vec<u32> = (0..slots)
            .map(|i| if rng.random_bool(taken) { u32::from(i >= budgets[0] as usize) } else { NONE })
            .collect();
        let quotas = [
            Quota { view: 11, first: 0, budget: budgets[0] },
            Quota { view: 12, first: budgets[0], budget: budgets[1] },
        ];
        let screen_frames = Buffer::from_slice(context, "plane frames", &before)?;
        let loss_map = Buffer::from_slice(context, "loss map", &losses)?;
        let states = Buffer::<ScreenState>::zeroed(context, "states", 2)?;
        let plane = Buffer::<f32>::zeroed(context, "plane", PLANES * slots)?;
        let (ages_before, moments_before) = (vec![7u32; slots], vec![1f32; 18 * slots]);
        let ages = Buffer::from_slice(context, "ages", &ages_before)?;
        let moments = Buffer::from_slice(context, "moments", &moments_before)?;
        let status = Buffer::<u32>::zeroed(context, "status", STATUS_WORDS)?;
        let quotas_there = Buffer::from_slice(context, "quotas", &quotas)?;
        let drawn_pixels = Buffer::new(context, "drawn pixels", slots, Location::Device)?;
        let buffers = draw_stage::Buffers {
            status: &status,
            frames: &frames,
            quotas: &quotas_there,
            loss_map: &loss_map,
            image: &images,
            drawn_pixels: &drawn_pixels,
            screen_states: &states,
            screen_frames: &screen_frames,
            plane: &plane,
            screen_ages: &ages,
            screen_moments: &moments,
        };
        let push = draw_stage::Push { frame_count: 2, stride: slots as u32, round, seed: 5 };
        let times = bench.time_after(
            || {
                screen_frames.upload(0, &before)?;
                ages.upload(0, &ages_before)?;
                Ok(moments.upload(0, &moments_before)?)
            },
            |recorder| stage.record(recorder, &buffers, &push),
        )?;
        let (after, state) = (screen_frames.download()?, states.download()?);
        let (columns, moments, ages) = (plane.download()?, moments.download()?, ages.download()?);
        for (f, frame) in all.iter().enumerate() {
            let (first, budget) = (quotas[f].first as usize, budgets[f] as usize);
            let which = Draw { seed: 5, view: quotas[f].view, round };
            let losses: Vec<f64> = pixels_of(&losses, frame).iter().map(|&l| f64::from(l)).collect();
            let empty: Vec<usize> = (first..first + budget).filter(|&i| before[i] == NONE).collect();
            let wanted = empty.len().min(draw_size(budgets[f]) as usize);
            let twin = screen_draw(which, &losses, wanted);
            let image: Vec<[f64; 4]> = pixels_of(&image, frame).iter().map(|p| p.map(f64::from)).collect();
            let drawn: Vec<u32> = empty[..twin.len()]
                .iter()
                .map(|&i| (columns[slots + i] - 0.5) as u32 * frame.width + (columns[i] - 0.5) as u32)
                .collect();
            if !drawn.iter().all(|&p| (p as usize) < losses.len()) {
                row.unequal(u64::MAX);
                bench.push(row);
                return Ok(());
            }
            judge_drawn(&mut row, which, &losses, &drawn, &twin);
            let planes = empty.iter().zip(&drawn).map(|(&i, &p)| (i, new_screen_gaussian(p, &image, frame.width, frame.height)));
            let pairs: Vec<(f32, f64)> = planes
                .flat_map(|(i, want)| (0..PLANES).map(move |k| (i, k, want[k])))
                .map(|(i, k, want)| (columns[k * slots + i], want))
                .collect();
            row.numbers(pairs);
            let written = &empty[..twin.len()];
            let wrong = (first..first + budget)
                .filter(|i| match written.binary_search(i) {
                    Ok(_) => (after[*i], ages[*i]) != (f as u32, 0) || (0..18).any(|m| moments[m * slots + i] != 0.0),
                    // All other slots are as they were.
                    Err(_) => (after[*i], ages[*i], moments[*i]) != (before[*i], 7, 1.0),
                })
                .count();
            let count = (budget - empty.len() + twin.len()) as u32;
            let expected = ScreenState { count, stepping: u32::from(count < budgets[f]) };
            row.unequal(wrong as u64 + u64::from(state[f] != expected));
        }
        row.time = times.of("screen_draw");
        // The losses three times, once for each digit of the key, and what is written.
        row.work.bytes = 4.0 * pixels as f64 + slots as f64 * 4.0 * (1.0 + 10.0 + 1.0 + 18.0) / 5.0;
    }
    bench.push(row);
    Ok(())
}

/// Pixels that only one side drew must have keys at the last place, where float32 may order them otherwise.
fn judge_drawn(row: &mut Row, which: Draw, losses: &[f64], drawn: &[u32], twin: &[u32]) {
    let mut wrong = u64::from(!drawn.is_sorted_by(|a, b| a < b));
    let key_of = |p: u32| key(which, p, losses[p as usize]);
    let last = twin.iter().filter_map(|&p| key_of(p)).fold(0.0, f64::max);
    let only_one = drawn.iter().filter(|p| twin.binary_search(p).is_err());
    let only_other = twin.iter().filter(|p| drawn.binary_search(p).is_err());
    let mut flips = 0;
    for &p in only_one.chain(only_other) {
        flips += 1;
        // ln and the hash's division within 3e-7, the loss squared and divided by 2e-7: far within 1e-5.
        wrong += u64::from(!key_of(p).is_some_and(|key| (key / last - 1.0).abs() < 1e-5));
    }
    row.flips(flips, 2 * twin.len());
    row.unequal(wrong);
}
