//! The screen phase: batches of frames, their Gaussians' life from draw to prune.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Bench, NEAR_THRESHOLD, judge::Row};
use crate::{
    error::Result,
    gpu::Buffer,
    pipelines::{
        raster::ISECTS,
        screen::{
            batch::ScreenSizes,
            rig::{LEARNED, SCREEN_PLANES, Screen},
        },
        session::{Policy, Reduction},
    },
    reference::{
        Background, Intersections, NONE, Options, Splat,
        blend::{Blended, blend},
        blend_backward::{Record, blend_backward, blend_backward_magnitudes},
        emit::globals,
        screen_backward::{ScreenGrad, ScreenMoments, magnitudes as screen_magnitudes, screen_backward, screen_step},
        screen_draw::{Draw, draw_size, key, new_screen_gaussian, screen_draw},
        screen_project::{ScreenGaussian, screen_project},
        screen_prune::screen_prune,
        screen_tiles::{WINDOW_RADIUS, screen_tiles},
        tile_ranges::listed_tiles,
        tiles::Tiling,
    },
    stages::{
        constants::screen::{DRAWING, FILLED, WAITING},
        ssim::{TILE, tiles_per_frame},
        status::{self, Status},
        types::{Frame, Quota, ScreenState, View},
    },
    verify::raster::{compare_image, image_margin, is_marginal, read_records, wide},
};

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    let (frames, count) = if quick { (SMALL_FRAMES, 160) } else { (frames([(403, 301), (280, 333)]), 4000) };
    batch(bench, frames, count)?;
    listed(bench, frames, count)?;
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

/// Random 2D Gaussians on places of two frames in turns; every seventh place is empty.
pub struct Scattered {
    /// By place.
    pub gaussians: Vec<ScreenGaussian>,
    /// Frame of each place, [`NONE`] where it is empty.
    pub frames: Vec<u32>,
    /// By pixel of all frames, a tenth of them 0.
    pub depths: Vec<f32>,
}

impl Scattered {
    /// `count` places, and the generator as it is afterwards.
    pub fn new(all: &[Frame; 2], seed: u64, count: usize) -> (Self, ChaCha8Rng) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let frames: Vec<u32> = (0..count).map(|i| if i % 7 == 3 { NONE } else { (i / 2 % 2) as u32 }).collect();
        let gaussians = frames
            .iter()
            .map(|&f| {
                let frame = all[f.min(1) as usize];
                let mut gaussian = [0.0; 10];
                // Rounded to float32, so that both sides begin with the same.
                let mut set = |p: usize, x: f64| gaussian[p] = f64::from(x as f32);
                set(0, rng.random_range(0.0..frame.width as f64));
                set(1, rng.random_range(0.0..frame.height as f64));
                (2..5).for_each(|c| set(c, rng.random_range(0.0..1.0)));
                set(5, rng.random_range(-5.0..3.0));
                set(6, rng.random_range(-1.0..2.3));
                set(7, rng.random_range(-1.0..2.3));
                set(8, rng.random_range(-1.5..1.5));
                gaussian
            })
            .collect();
        let depth = |rng: &mut ChaCha8Rng| if rng.random_bool(0.1) { 0.0 } else { rng.random_range(1.0..9.0) };
        let depths = (0..pixel_count(all)).map(|_| depth(&mut rng)).collect();
        (Scattered { gaussians, frames, depths }, rng)
    }

    /// Plane-major, as the device has it.
    pub fn columns(&self) -> Vec<f32> {
        let n = self.gaussians.len();
        (0..SCREEN_PLANES * n).map(|k| self.gaussians[k % n][k / n] as f32).collect()
    }

    /// The Gaussians of a frame and their places.
    pub fn of_frame(&self, f: u32) -> (Vec<ScreenGaussian>, Vec<usize>) {
        let places: Vec<usize> = (0..self.gaussians.len()).filter(|&i| self.frames[i] == f).collect();
        (places.iter().map(|&i| self.gaussians[i]).collect(), places)
    }

    /// As the batch at hand of a rig made for it, all of whose views take steps.
    pub fn upload(&self, screen: &mut Screen, all: &[Frame; 2]) -> Result<()> {
        let count = self.gaussians.len() as u32;
        // Who has which place is for a draw to ask.
        screen.begin(all, &[View::default(); 2], &[Quota { view: 0, first: 0, budget: count }, Quota::default()])?;
        let b = &screen.buffers;
        b.screen_planes.upload(0, &self.columns())?;
        b.screen_frames.upload(0, &self.frames)?;
        Ok(b.depths.upload(0, &self.depths)?)
    }
}

/// Projection, tile lists, blending and its backward pass of two frames at once, gradients and the step.
fn batch(bench: &mut Bench<'_>, all: [Frame; 2], count: usize) -> Result<()> {
    let context = bench.context;
    let pixels = pixel_count(&all);
    let (scene, mut rng) = Scattered::new(&all, 3, count);
    let policy = Policy { reduction: Reduction::Deterministic, ..Default::default() };
    let mut screen = Screen::new(context, ScreenSizes::of_frames(&all, count as u32), policy)?;
    scene.upload(&mut screen, &all)?;
    let backdrop: Vec<[f32; 4]> = (0..pixels).map(|_| [0; 4].map(|_| rng.random_range(0.0..1.0))).collect();
    screen.raster.buffers.backdrop.upload(0, &backdrop)?;
    let status = screen.status()?;
    let times = loop {
        let times = bench.time(|recorder| screen.record_render(recorder, &status))?;
        match Status::read(&status.download()?).needs().next() {
            None => break times,
            Some((_, needed)) => screen.raster.grow(needed)?,
        }
        status.upload(0, &[0; status::WORDS])?;
    };
    let (raster, tile) = (&screen.raster, screen.raster.tile);
    let r = &raster.buffers;
    let (keys, tile_counts, first_slot) =
        (r.depth_keys.download()?, r.tile_counts.download()?, r.first_slot.download()?);
    let (splats, colours, image) = (r.splats.download()?, r.splat_colours.download()?, r.image.download()?);
    let isect_count = r.count.download()?[ISECTS as usize] as usize;
    let slots = raster.isect_slots().download_range(0, isect_count)?;
    let global_from_slot =
        globals(&raster.rank_blocks().download()?, &raster.global_from_rank().download()?, isect_count);
    let ranges = r.tile_ranges.download()?;
    let visible: Vec<usize> = (0..count).filter(|&i| keys[i] != NONE).collect();
    let mut row = bench.row("screen_project", format!("{tile}"));
    row.time = times.of("screen_project");
    row.work.bytes = count as f64 * 48.0 + visible.len() as f64 * 44.0;
    let sound = slots.iter().all(|&s| (s as usize) < isect_count)
        && global_from_slot.iter().all(|&g| (g as usize) < count)
        && ranges.iter().all(|r| r[0] <= r[1] && r[1] as usize <= isect_count)
        && visible.iter().all(|&i| first_slot[i] as usize + tile_counts[i] as usize <= isect_count);
    if !sound {
        // Nothing further can be compared: an index leads out of its buffer.
        row.unequal(u64::MAX);
        bench.push(row);
        return Ok(());
    }
    let splat = |i: usize| wide(&splats[i], colours[i], keys[i]);
    let own: Vec<Splat> = (0..count).map(|i| if keys[i] == NONE { Splat::default() } else { splat(i) }).collect();

    let options = Options { tile_width: tile.width, tile_height: tile.height, ..Default::default() };
    let depths64: Vec<f64> = scene.depths.iter().map(|&z| f64::from(z)).collect();
    let mut blend_row = bench.row("blend", format!("{tile}, batch, background image"));
    blend_row.time = times.of("blend");
    blend_row.work.bytes = 8.0 * isect_count as f64 + 40.0 * visible.len() as f64 + 32.0 * pixels as f64;
    let mut both: Vec<(usize, Splat)> = Vec::new();
    let (mut flips, mut wrong) = (0, 0);
    let mut image_grad = vec![0f32; 3 * pixels];
    let (mut records, mut sizes): (Vec<Record>, Vec<Record>) =
        (vec![[0.0; 9]; isect_count], vec![[0.0; 9]; isect_count]);
    let mut with_depths: Vec<(Vec<ScreenGaussian>, Vec<usize>)> = Vec::new();
    for (f, frame) in all.iter().enumerate() {
        let (mut gaussians, of_frame) = scene.of_frame(f as u32);
        let (width, height) = (frame.width, frame.height);
        let projected = screen_project(&mut gaussians, pixels_of(&depths64, frame), width, height, &options);
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
                let z = gaussians[j][9];
                wrong += u64::from(keys[i] != if z > 0.0 { (z as f32).to_bits() } else { f32::INFINITY.to_bits() });
                both.push((i, projected.splats[j]));
            }
        }
        // The tiles of a frame lie in a grid for the largest of them.
        let grid = raster.grid(0, 2, all[0].width.max(all[1].width), all[0].height.max(all[1].height));
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
        for (all, of_frame) in [
            (&mut records, blend_backward(&own, &isects, &got, &grads)),
            (&mut sizes, blend_backward_magnitudes(&own, &isects, &got, &grads)),
        ] {
            all.iter_mut().zip(of_frame).for_each(|(sum, part)| (0..9).for_each(|k| sum[k] += part[k]));
        }
        with_depths.push((gaussians, of_frame));
    }
    // Depths were compared as keys.
    let fields: [fn(&Splat) -> f64; 9] =
        [|s| s.x, |s| s.y, |s| s.l11, |s| s.l12, |s| s.l22, |s| s.opacity, |s| s.r, |s| s.g, |s| s.b];
    for field in fields {
        // The device's own were float32.
        row.numbers(both.iter().map(|(i, twin)| (field(&own[*i]) as f32, field(twin))));
    }
    row.flips(flips, both.len());
    row.unequal(wrong);
    bench.push(row);
    bench.push(blend_row);

    tiles(bench, &all, &screen, &scene.frames, &own, &tile_counts)?;

    r.image_grad.upload(0, &image_grad)?;
    let times = bench.time(|recorder| screen.record_blend_backward(recorder))?;
    let got = read_records(raster, isect_count)?;
    let mut row = bench.row("blend_backward", format!("{tile}, batch, all"));
    for parts in [0..2, 2..3, 3..6, 6..9] {
        let (got, records, sizes) = (&got, &records, &sizes);
        let of = move |s: usize| parts.clone().map(move |k| (got[s][k], records[s][k], sizes[s][k]));
        row.sums((0..isect_count).flat_map(of));
    }
    row.time = times.sum();
    row.work.bytes = 44.0 * isect_count as f64 + 36.0 * visible.len() as f64 + 28.0 * pixels as f64;
    bench.push(row);

    // Gradients from the device's own records, and the step from its own gradients.
    let records: Vec<Record> = got.iter().map(|record| record.map(f64::from)).collect();
    let sizes: Vec<Record> = records.iter().map(|record| record.map(f64::abs)).collect();
    let (grads, terms): (Vec<Vec<ScreenGrad>>, Vec<Vec<ScreenGrad>>) = with_depths
        .iter()
        .map(|(gaussians, of_frame)| {
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
            (
                screen_backward(gaussians, &counts, &isects, &records),
                screen_magnitudes(gaussians, &counts, &isects, &sizes),
            )
        })
        .unzip();
    let start: Vec<f32> = (0..18 * count)
        .map(
            |k| if (k / count).is_multiple_of(2) { rng.random_range(-0.1..0.1) } else { rng.random_range(0.001..0.01) },
        )
        .collect();
    let ages: Vec<u32> = (0..count as u32).map(|i| [0, 1, 5, 80, 1500][i as usize % 5]).collect();
    let gradients = Buffer::<f32>::zeroed(context, "gradients", 2 * LEARNED * count)?;
    // With the depths that projection took.
    let b = &screen.buffers;
    let before = b.screen_planes.download()?;
    let mut row = bench.row("screen_backward", "gradients");
    row.chosen = false;
    row.time = bench.time(|recorder| screen.record_gradients(recorder, &gradients, &status))?.of("screen_backward");
    row.work.bytes = 36.0 * isect_count as f64 + 4.0 * count as f64 * (3.0 + 9.0 + 9.0);
    let got = gradients.download()?;
    for planes in [0..2, 2..5, 5..6, 6..8, 8..9] {
        let (got, grads, terms, with_depths) = (&got, &grads, &terms, &with_depths);
        row.sums(planes.flat_map(move |p| {
            (0..2).flat_map(move |f| {
                let slots = with_depths[f].1.iter().enumerate();
                slots.map(move |(j, &i)| (got[2 * p * count + i], grads[f][j][p], terms[f][j][p]))
            })
        }));
    }
    bench.push(row);

    let mut row = bench.row("screen_backward", "step");
    let prepare = || -> Result<()> {
        b.screen_planes.upload(0, &before)?;
        b.screen_ages.upload(0, &ages)?;
        Ok(b.screen_moments.upload(0, &start)?)
    };
    row.time = bench.time_after(prepare, |recorder| screen.record_step(recorder, &status))?.of("screen_backward");
    row.work.bytes = 36.0 * isect_count as f64 + 4.0 * count as f64 * (5.0 + 54.0);
    let (after, after_moments) = (b.screen_planes.download()?, b.screen_moments.download()?);
    let after_ages = b.screen_ages.download()?;
    let mut pairs: [[Vec<(f32, f64)>; 9]; 3] = Default::default();
    let mut wrong = 0;
    for (f, (gaussians, of_frame)) in with_depths.iter_mut().enumerate() {
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
        screen_step(gaussians, &own, &mut state, all[f].width, all[f].height);
        for (j, &i) in of_frame.iter().enumerate() {
            wrong += u64::from(after_ages[i] != state[j].age);
            for p in 0..9 {
                pairs[0][p].push((after[p * count + i], gaussians[j][p]));
                pairs[1][p].push((after_moments[2 * p * count + i], state[j].first[p]));
                pairs[2][p].push((after_moments[(2 * p + 1) * count + i], state[j].second[p]));
            }
        }
    }
    // Empty places are as they were.
    for i in (0..count).filter(|&i| scene.frames[i] == NONE) {
        let kept = (0..9).all(|p| after[p * count + i] == before[p * count + i]);
        wrong += u64::from(!kept || (keys[i], tile_counts[i], after_ages[i]) != (NONE, 0, ages[i]));
    }
    row.unequal(wrong);
    pairs.into_iter().flatten().for_each(|pairs| row.numbers(pairs));
    bench.push(row);
    Ok(())
}

/// Which tiles are blended while 2D Gaussians go: first all of them are there, then fewer and fewer.
fn listed(bench: &mut Bench<'_>, all: [Frame; 2], count: usize) -> Result<()> {
    let (scene, _) = Scattered::new(&all, 3, count);
    let mut screen = Screen::new(bench.context, ScreenSizes::of_frames(&all, count as u32), Policy::default())?;
    scene.upload(&mut screen, &all)?;
    let status = screen.status()?;
    let (r, tile) = (&screen.raster.buffers, screen.raster.tile);
    let grid = screen.raster.grid(0, 2, all[0].width.max(all[1].width), all[0].height.max(all[1].height));
    let tiles = grid.tiles() as usize;
    let mut row = bench.row("tile_ranges", format!("{tile}, batch, listed"));
    row.chosen = false;
    let mut drawn = vec![1; tiles];
    for left in [count, count / 20, 9, 2, 0, 0] {
        let frames: Vec<u32> = scene.frames.iter().enumerate().map(|(i, &f)| if i < left { f } else { NONE }).collect();
        screen.buffers.screen_frames.upload(0, &frames)?;
        let mut recorder = bench.context.recorder("screen render")?;
        screen.record_render(&mut recorder, &status);
        recorder.submit()?.wait()?;
        let mut got = r.tile_list.download_range(0, r.tile_list_count.download()?[0] as usize)?;
        got.sort_unstable();
        row.words(&got, &listed_tiles(&r.tile_ranges.download_range(0, tiles)?, &mut drawn));
        row.words(&r.tile_drawn.download_range(0, tiles)?, &drawn);
    }
    screen.buffers.screen_frames.upload(0, &scene.frames)?;
    row.time = bench.time(|recorder| screen.record_render(recorder, &status))?.of("tile_ranges");
    // A range, what was drawn and what is, and a tile of the list; some 20 reads of the sorted tiles.
    row.work.bytes = (80.0 + 20.0) * tiles as f64;
    bench.push(row);
    Ok(())
}

/// Tiles of the loss that the device's splats need: at least the exact ones, at most those of boxes a hundredth of a pixel wider.
fn tiles(
    bench: &mut Bench<'_>,
    all: &[Frame; 2],
    screen: &Screen,
    frame_of: &[u32],
    own: &[Splat],
    tile_counts: &[u32],
) -> Result<()> {
    let context = bench.context;
    let tiles_per_frame = tiles_per_frame(all);
    let most = 2 * tiles_per_frame as usize;
    let status = screen.status()?;
    let lists = [&screen.lists.forward_tiles, &screen.lists.backward_tiles];
    let mut row = bench.row("screen_tiles", "");
    let (mut flips, mut listed) = (0, 0);
    // With few Gaussians most tiles are not listed, with all of them most are. (A perturbed twin is half a tile off.)
    for some in [2, 5, 9, own.len()] {
        let counts: Vec<u32> = tile_counts.iter().enumerate().map(|(i, &n)| if i < some { n } else { 0 }).collect();
        screen.raster.buffers.tile_counts.upload(0, &counts)?;
        let mut recorder = context.recorder("screen tiles")?;
        screen.record_lists(&mut recorder, &status);
        recorder.submit()?.wait()?;
        let lengths = screen.lists.count.download()?;
        for (k, halo) in [WINDOW_RADIUS, 0.0].into_iter().enumerate() {
            let mut got = lists[k].download_range(0, lengths[k] as usize)?;
            got.sort_unstable();
            row.unequal(u64::from(!got.is_sorted_by(|a, b| a < b) || got.len() != lengths[k] as usize));
            listed += got.len();
            let mut known = 0;
            for (f, frame) in all.iter().enumerate() {
                let of_frame: Vec<usize> =
                    (0..some).filter(|&i| frame_of[i] == f as u32 && tile_counts[i] > 0).collect();
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
    let times = bench.time(|recorder| screen.record_lists(recorder, &status))?;
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
    for gaussian in &mut scene.gaussians {
        gaussian[5] = f64::from(rng.random_range(-6.0..2.0f32));
        gaussian[6] = f64::from(rng.random_range(-1.0..1.5f32));
    }
    scene.gaussians[1][0] = f64::NAN;
    scene.gaussians[2][5] = f64::NAN;
    let mut screen = Screen::new(context, ScreenSizes::of_frames(&all, count as u32), Policy::default())?;
    scene.upload(&mut screen, &all)?;
    let (status, screen_frames) = (screen.status()?, &screen.buffers.screen_frames);
    let times = bench.time_after(
        || Ok(screen_frames.upload(0, &scene.frames)?),
        |recorder| screen.record_prune(recorder, &status),
    )?;
    let left = screen_frames.download()?;
    let mut row = bench.row("screen_prune", "");
    row.time = times.of("screen_prune");
    let (mut flips, mut wrong) = (0, 0);
    for (f, frame) in all.iter().enumerate() {
        let (mut gaussians, places) = scene.of_frame(f as u32);
        gaussians.iter_mut().for_each(|gaussian| gaussian[5] += bench.shift());
        let keep = screen_prune(&gaussians, frame.width, frame.height);
        for (j, &i) in places.iter().enumerate() {
            if (left[i] != NONE) == keep[j] {
                continue;
            }
            flips += 1;
            // A pixel within float32's error of 1/255, or an opacity of 0.005, may go either way.
            let moved = |by: f64| {
                let mut gaussian = gaussians[j];
                gaussian[5] += by;
                screen_prune(&[gaussian], frame.width, frame.height)[0]
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
    const CASES: u32 = 6;
    const AGE: u32 = 3;
    let context = bench.context;
    let pixels = pixel_count(&all);
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let many = if quick { 900 } else { 20_000 };
    let mut screen = Screen::new(context, ScreenSizes::of_frames(&all, 3600.max(many + 1)), Policy::default())?;
    let image: Vec<[f32; 4]> = (0..pixels).map(|_| [0; 4].map(|_| rng.random_range(-0.2..1.2))).collect();
    screen.raster.buffers.image.upload(0, &image)?;
    let status = screen.status()?;
    let mut row = bench.row("screen_draw", "");
    // Budgets; the share of pixels with a loss; the share of taken places.
    for (round, (budgets, dense, taken)) in (1..).zip([
        ([100, 37], 1.0, 0.0),
        ([2, 0], 1.0, 0.0),
        ([600, 3000], 0.02, 0.1),
        ([50, 60], 0.0, 0.5),
        ([many, 1], 0.5, 0.3),
        ([40, 50], 0.5, 0.3),
    ]) {
        let places = (budgets[0] + budgets[1]) as usize;
        let losses: Vec<f32> = (0..pixels)
            .map(|_| if rng.random_bool(dense) { rng.random_range(0.0..1.2f32).powi(3) } else { 0.0 })
            .collect();
        let before: Vec<u32> = (0..places)
            .map(|i| if rng.random_bool(taken) { u32::from(i >= budgets[0] as usize) } else { NONE })
            .collect();
        let quotas = [
            Quota { view: 11, first: 0, budget: budgets[0] },
            Quota { view: 12, first: budgets[0], budget: budgets[1] },
        ];
        screen.begin(&all, &[View::default(); 2], &quotas)?;
        // In the last case the second view has its number and draws no more.
        let modes = [DRAWING, if round == CASES { FILLED } else { DRAWING }];
        screen.loss.loss_map().upload(0, &losses)?;
        let b = &screen.buffers;
        let stride = screen.sizes.places as usize;
        let (ages_before, moments_before) = (vec![7u32; places], vec![1f32; 2 * LEARNED * stride]);
        let times = bench.time_after(
            || {
                b.screen_frames.upload(0, &before)?;
                b.screen_ages.upload(0, &ages_before)?;
                b.screen_states.upload(0, &modes.map(|mode| ScreenState { count: 9, mode }))?;
                Ok(b.screen_moments.upload(0, &moments_before)?)
            },
            |recorder| screen.record_draw(recorder, round, 5, AGE, &status),
        )?;
        let (after, state) = (b.screen_frames.download()?, b.screen_states.download()?);
        let (columns, moments) = (b.screen_planes.download()?, b.screen_moments.download()?);
        let ages = b.screen_ages.download()?;
        for (f, frame) in all.iter().enumerate() {
            let (first, budget) = (quotas[f].first as usize, budgets[f] as usize);
            let which = Draw { seed: 5, view: quotas[f].view, round };
            let losses: Vec<f64> = pixels_of(&losses, frame).iter().map(|&l| f64::from(l)).collect();
            let empty: Vec<usize> = (first..first + budget).filter(|&i| before[i] == NONE).collect();
            let wanted = if modes[f] == DRAWING { empty.len().min(draw_size(budgets[f]) as usize) } else { 0 };
            let twin = screen_draw(which, &losses, wanted);
            let image: Vec<[f64; 4]> = pixels_of(&image, frame).iter().map(|p| p.map(f64::from)).collect();
            let drawn: Vec<u32> = empty[..twin.len()]
                .iter()
                .map(|&i| (columns[stride + i] - 0.5) as u32 * frame.width + (columns[i] - 0.5) as u32)
                .collect();
            if !drawn.iter().all(|&p| (p as usize) < losses.len()) {
                row.unequal(u64::MAX);
                bench.push(row);
                return Ok(());
            }
            judge_drawn(&mut row, which, &losses, &drawn, &twin);
            let planes =
                empty.iter().zip(&drawn).map(|(&i, &p)| (i, new_screen_gaussian(p, &image, frame.width, frame.height)));
            let pairs: Vec<(f32, f64)> = planes
                .flat_map(|(i, want)| (0..SCREEN_PLANES).map(move |k| (i, k, want[k])))
                .map(|(i, k, want)| (columns[k * stride + i], want))
                .collect();
            row.numbers(pairs);
            let written = &empty[..twin.len()];
            let wrong = (first..first + budget)
                .filter(|i| match written.binary_search(i) {
                    Ok(_) => {
                        (after[*i], ages[*i]) != (f as u32, AGE)
                            || (0..2 * LEARNED).any(|m| moments[m * stride + i] != 0.0)
                    }
                    // All other places are as they were.
                    Err(_) => (after[*i], ages[*i], moments[*i]) != (before[*i], 7, 1.0),
                })
                .count();
            let count = (budget - empty.len() + twin.len()) as u32;
            let expected = match modes[f] {
                DRAWING => ScreenState { count, mode: if count < budgets[f] { DRAWING } else { FILLED } },
                _ => ScreenState { count: 9, mode: WAITING },
            };
            row.unequal(wrong as u64 + u64::from(state[f] != expected));
        }
        row.time = times.of("screen_draw");
        // The losses three times, once for each digit of the key, and what is written.
        row.work.bytes = 4.0 * pixels as f64 + places as f64 * 4.0 * (1.0 + 10.0 + 1.0 + 18.0) / 5.0;
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
