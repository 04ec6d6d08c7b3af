//! Verifies density control: scores, weighing, drawing and applying changes.

use super::{Bench, sort::noise};
use crate::{
    error::Result,
    gpu::Buffer,
    pipelines::density::Strategy,
    reference::{Params, packed_record::pack_record, random_scene, scan_spine::scan_spine},
    scene::layout::{self, GEOMETRY_PLANES, LOG_SCALE, OPACITY, quads, sh_planes},
    stages::{
        WORKGROUP,
        constants::density::{BLUE, BUDGET, ERRORS, MCMC, RED_GREEN, SCORES, WORDS},
        density_apply, density_draw, density_image, density_noise, density_place, density_plan, density_score,
        density_weigh,
        status::{self, Resource, Status},
        types::{self, Frame},
    },
};

const SEED: u32 = 77;
const STEP: u32 = 5;
/// Offset of the page in its segment, and of the segment in the Gaussian index.
const PAGE_FIRST: u32 = 64;
const SEGMENT_FIRST: u32 = 30;

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    let count = if quick { 3000 } else { 300_000 };
    image(bench, if quick { (101, 67) } else { (1000, 701) })?;
    let page = Page::new(bench, count)?;
    for (pulls, packed) in [(false, false), (true, false), (false, true), (true, true)] {
        score(bench, &page, pulls, packed)?;
    }
    let strategies = || Strategy::ALL.into_iter().filter_map(Strategy::kernel);
    for strategy in strategies() {
        weigh(bench, &page, strategy)?;
    }
    plan(bench)?;
    for replacement in [true, false] {
        draw(bench, count, replacement)?;
    }
    place(bench, count)?;
    for strategy in strategies() {
        apply(bench, &page, strategy, 2)?;
    }
    // With packed moments.
    apply(bench, &page, BUDGET, 1)?;
    moved(bench, &page)
}

fn unit(i: u32) -> f32 {
    (noise(i) >> 8) as f32 / 16_777_216.0
}

/// A page of a segment, not its first page.
struct Page {
    count: usize,
    population: Buffer<u32>,
    status: Buffer<u32>,
    /// Some opacities are NaN or low, some scales are infinite.
    quads: Vec<[f32; 4]>,
    workgroup_size: u32,
}

impl Page {
    fn new(bench: &Bench<'_>, count: usize) -> Result<Self> {
        let mut params = Params::from_scene(&random_scene(61, count, 0, 1))?;
        for i in 0..count {
            let logit = &mut params.geometry[OPACITY * count + i];
            match i % 11 {
                3 => *logit = -7.0 + 3.0 * f64::from(unit(i as u32)),
                5 if i % 7 == 0 => *logit = f64::NAN,
                6 if i % 7 == 0 => params.geometry[LOG_SCALE * count + i] = f64::INFINITY,
                _ => {}
            }
        }
        params.geometry.iter_mut().for_each(|v| *v = f64::from(*v as f32));
        let quads = layout::page(GEOMETRY_PLANES, count, count, |p, i| params.geometry[p * count + i] as f32);
        let end = SEGMENT_FIRST + PAGE_FIRST + count as u32;
        Ok(Page {
            count,
            population: Buffer::from_slice(&bench.shadowed, "population", &[0, SEGMENT_FIRST, end])?,
            status: Buffer::zeroed(&bench.shadowed, "status", status::WORDS)?,
            quads,
            workgroup_size: bench.shadowed.info().workgroup(WORKGROUP),
        })
    }
}

fn image(bench: &Bench<'_>, (width, height): (u32, u32)) -> Result<()> {
    let context = &bench.shadowed;
    let pixels = width * height;
    let frames = [
        Frame { image_first: 0, target_first: 0, width: 3, height: 3 },
        Frame { image_first: 5, target_first: 9, width, height },
    ];
    let channel = |k: u32| if k % 97 == 13 { f32::NAN } else { 1.2 * unit(k) };
    let image: Vec<[f32; 4]> = (0..pixels + 5).map(|p| [0, 1, 2, 3].map(|c| channel(4 * p + c))).collect();
    let targets: Vec<u32> = (0..pixels + 9).map(|p| noise(p) | if p % 5 == 0 { 0 } else { 255 << 24 }).collect();
    let targets: Vec<u32> =
        targets.into_iter().enumerate().map(|(p, t)| if p % 5 == 0 { t & 0xFF_FFFF } else { t }).collect();
    let workgroup_size = context.info().workgroup(WORKGROUP);
    let buffers = density_image::Buffers {
        frames: &Buffer::from_slice(context, "frames", &frames)?,
        image: &Buffer::from_slice(context, "image", &image)?,
        targets: &Buffer::from_slice(context, "targets", &targets)?,
        image_grad: &Buffer::<f32>::zeroed(context, "image_grad", 3 * image.len())?,
    };
    for terms in [ERRORS, RED_GREEN, BLUE] {
        let stage = density_image::Stage::new(context, &density_image::Spec { workgroup_size, terms })?;
        bench.run(|recorder| stage.record(recorder, &buffers, &density_image::Push { frame: 1 }, pixels))?;
    }
    Ok(())
}

fn score(bench: &Bench<'_>, page: &Page, pulls: bool, packed_records: bool) -> Result<()> {
    let (context, count) = (&bench.shadowed, page.count);
    let before = (SEGMENT_FIRST + PAGE_FIRST) as usize;
    // One in a thousand touches enough tiles that the whole subgroup sums them.
    let tiles_of = |i: u32| if i % 1000 == 7 { 300 + noise(i) % 99 } else { noise(i) % 9 };
    let tile_counts: Vec<u32> = (0..(before + count) as u32).map(tiles_of).collect();
    let first_slot = scan_spine(&tile_counts);
    let slots = first_slot[tile_counts.len()];
    let triple = |k: u32, of: u32| [0, 1, 2].map(|c| if of == 0 { unit(3 * k + c) - 0.5 } else { unit(7 * k + c) });
    let centres: Vec<[f32; 3]> = (0..slots).map(|k| triple(k, 0)).collect();
    let colors: Vec<[f32; 3]> = (0..slots).map(|k| triple(k, 1)).collect();
    let words = |slot: usize| match pulls {
        true => {
            let parts = [centres[slot], [0.0; 3], [0.0; 3]];
            pack_record(&std::array::from_fn(|k| f64::from(parts[k / 3][k % 3])), false)
        }
        false => [colors[slot][0].to_bits(), colors[slot][1].to_bits(), 0, 0],
    };
    let words: Vec<[u32; 4]> = (0..slots as usize).map(words).collect();
    let splats: Vec<types::Splat> = (0..(before + count) as u32)
        .map(|i| types::Splat { shape: [0.1 + unit(i), unit(i + 1) - 0.5, 0.1 + unit(i + 2), 0.5], centre: [1.0, 2.0] })
        .collect();
    let start: Vec<[f32; 4]> = (0..count as u32).map(|i| [0, 1, 2, 3].map(|p| unit(4 * i + p + 3))).collect();
    let centres = Buffer::from_slice(context, "centres", &centres)?;
    let spec = density_score::Spec { workgroup_size: page.workgroup_size, pulls, packed_records };
    let stage = density_score::Stage::new(context, &spec)?;
    let buffers = density_score::Buffers {
        population: &page.population,
        status: &page.status,
        tile_counts: &Buffer::from_slice(context, "tile_counts", &tile_counts)?,
        first_slot: &Buffer::from_slice(context, "first_slot", &first_slot[..tile_counts.len()])?,
        splats: &Buffer::from_slice(context, "splats", &splats)?,
        record_centres: &centres,
        record_shapes: &centres,
        record_colors: &Buffer::from_slice(context, "colors", &colors)?,
        record_words: &Buffer::from_slice(context, "words", &words)?,
        scores: &Buffer::from_slice(context, "scores", &start)?,
    };
    let push = density_score::Push {
        segment: 1,
        page_first: PAGE_FIRST,
        stride: count as u32,
        by_gaussian: 0,
        half_width: 50.0,
        half_height: 33.5,
    };
    bench.run(|recorder| stage.record(recorder, &buffers, &push, count as u32))
}

fn weigh(bench: &Bench<'_>, page: &Page, strategy: u32) -> Result<()> {
    let (context, count) = (&bench.shadowed, page.count);
    // A fifth of the scores are 0.
    let scores: Vec<[f32; 4]> =
        (0..count as u32).map(|i| [0, 1, 2, 3].map(|p| (unit(4 * i + p) - 0.2).max(0.0))).collect();
    let numbers = PAGE_FIRST as usize + count;
    let spec = density_weigh::Spec { workgroup_size: page.workgroup_size, strategy };
    let stage = density_weigh::Stage::new(context, &spec)?;
    let buffers = density_weigh::Buffers {
        population: &page.population,
        geometry: &Buffer::from_slice(context, "geometry", &page.quads)?,
        scores: &Buffer::from_slice(context, "scores", &scores)?,
        alive: &Buffer::<u32>::zeroed(context, "alive", numbers)?,
        keys: &Buffer::<u32>::zeroed(context, "keys", numbers)?,
    };
    // A weight is a whole number up to 2^31 / capacity: an error of one must be small against the bound.
    let capacity = 6000;
    let push = density_weigh::Push {
        segment: 1,
        page_first: PAGE_FIRST,
        stride: count as u32,
        capacity,
        least_opacity: 0.005,
        least_score: 0.9,
        step: STEP,
        seed: SEED,
    };
    bench.run(|recorder| stage.record(recorder, &buffers, &push, count as u32))
}

fn plan(bench: &Bench<'_>) -> Result<()> {
    let context = &bench.shadowed;
    let mut failed = Status::default();
    failed.fail(Resource::Intersections, 5);
    for replacement in [true, false] {
        let stage = density_plan::Stage::new(context, &density_plan::Spec { workgroup_size: 1, replacement })?;
        // The usual case; at the cap; no living Gaussians; no candidates; no Gaussians; a single one; a
        // failed step.
        let cases = [
            ([100_000, 90_000, 80_000], Status::default()),
            ([120_000, 120_000, 9], Status::default()),
            ([100, 0, 0], Status::default()),
            ([100, 50, 0], Status::default()),
            ([0, 0, 0], Status::default()),
            ([1, 1, 1], Status::default()),
            ([100, 90, 80], failed),
        ];
        for (known, status) in cases {
            for (target, nth) in [(0, 20), (110_000, 0), (u32::MAX, 0)] {
                let mut words = [0; WORDS as usize];
                words[..3].copy_from_slice(&known);
                let there = Buffer::from_slice(context, "words", &words)?;
                let args = Buffer::<u32>::zeroed(context, "args", 3)?;
                let status_there = Buffer::from_slice(context, "status", &status.0)?;
                let buffers = density_plan::Buffers { status: &status_there, words: &there, dispatch_args: &args };
                let push = density_plan::Push { capacity: 120_000, target, nth, threads_per_group: 64 };
                bench.run(|recorder| stage.record(recorder, &buffers, &push, 1))?;
            }
        }
    }
    Ok(())
}

fn draw(bench: &Bench<'_>, count: usize, replacement: bool) -> Result<()> {
    let context = &bench.shadowed;
    let old = count as u32;
    let children = old / 3;
    // Every third has weight 0.
    let weight = |i: u32| if i % 3 == 1 { 0 } else { noise(i) % (u32::MAX / old / 2) };
    let sums = scan_spine(&(0..old).map(weight).collect::<Vec<_>>());
    let (order, total) = match replacement {
        true => (sums[..count].to_vec(), sums[count]),
        false => ((0..old).rev().collect(), old),
    };
    let words_there = Buffer::from_slice(context, "words", &[old, old - 50, total, children, old - 50 + children])?;
    let order_there = Buffer::from_slice(context, "order", &order)?;
    let sources = Buffer::<u32>::zeroed(context, "sources", 2 * count)?;
    let copies = Buffer::<u32>::zeroed(context, "copies", count)?;
    let workgroup_size = context.info().workgroup(WORKGROUP);
    let stage = density_draw::Stage::new(context, &density_draw::Spec { workgroup_size, replacement })?;
    let buffers =
        density_draw::Buffers { words: &words_there, order: &order_there, sources: &sources, copies: &copies };
    let push = density_draw::Push { step: STEP, seed: SEED };
    bench.run(|recorder| stage.record(recorder, &buffers, &push, children))
}

fn place(bench: &Bench<'_>, count: usize) -> Result<()> {
    let context = &bench.shadowed;
    let workgroup_size = context.info().workgroup(WORKGROUP);
    let stage = density_place::Stage::new(context, &density_place::Spec { workgroup_size })?;
    for all in [false, true] {
        let alive: Vec<u32> = (0..count as u32).map(|i| u32::from(!all && !noise(i).is_multiple_of(4))).collect();
        let ranks = scan_spine(&alive);
        let stays = if all { count as u32 } else { ranks[count] };
        let words = Buffer::from_slice(context, "words", &[count as u32, stays, 0, 0, stays])?;
        let alive_there = Buffer::from_slice(context, "alive", &alive)?;
        let ranks_there = Buffer::from_slice(context, "ranks", &ranks[..count])?;
        let sources = Buffer::<u32>::zeroed(context, "sources", count)?;
        let buffers =
            density_place::Buffers { words: &words, alive: &alive_there, ranks: &ranks_there, sources: &sources };
        // In two pages.
        let half = count as u32 / 2;
        bench.run(|recorder| {
            for (page_first, stride) in [(0, half), (half, count as u32)] {
                stage.record(recorder, &buffers, &density_place::Push { page_first, stride }, stride);
            }
        })?;
    }
    Ok(())
}

/// `planes`: planes of moments per learned plane.
fn apply(bench: &Bench<'_>, page: &Page, strategy: u32, planes: u32) -> Result<()> {
    let (context, count) = (&bench.shadowed, page.count);
    let numbers = PAGE_FIRST as usize + count;
    // Gaussians with non-finite parameters had no children; the last third are children.
    let at = |plane: usize, i: usize| page.quads[plane / 4 * count + i][plane % 4];
    let sound = |i: usize| (0..GEOMETRY_PLANES).all(|plane| at(plane, i).is_finite());
    let copies: Vec<u32> = (0..numbers)
        .map(|n| match n.checked_sub(PAGE_FIRST as usize) {
            Some(i) if sound(i) && at(OPACITY, i) < 6.0 => [0, 1, 2, 0, 7][noise(n as u32) as usize % 5],
            _ => 0,
        })
        .map(|n| if strategy == MCMC { n } else { n.min(1) })
        .collect();
    let sources: Vec<u32> = (0..numbers as u32).collect();
    let stays = numbers as u32 * 2 / 3;
    let sh = sh_planes(1);
    let of_each = planes as usize;
    let some = |quads: usize| -> Vec<[f32; 4]> {
        (0..(quads * count) as u32).map(|i| [0, 1, 2, 3].map(|c| 0.5 + unit(4 * i + c))).collect()
    };
    let (moments, sh_moments) = (some(of_each * quads(GEOMETRY_PLANES)), some(of_each * quads(sh)));
    let spec = density_apply::Spec {
        workgroup_size: page.workgroup_size,
        strategy,
        sh_beside: planes * sh as u32,
        moments: planes,
    };
    let stage = density_apply::Stage::new(context, &spec)?;
    let buffers = density_apply::Buffers {
        population: &page.population,
        status: &page.status,
        words: &Buffer::from_slice(context, "words", &[0, stays, 0, 0, numbers as u32])?,
        sources: &Buffer::from_slice(context, "sources", &sources)?,
        copies: &Buffer::from_slice(context, "copies", &copies)?,
        geometry: &Buffer::from_slice(context, "geometry", &page.quads)?,
        geometry_moments: &Buffer::from_slice(context, "moments", &moments)?,
        sh_moments: &Buffer::from_slice(context, "sh_moments", &sh_moments)?,
        // A separate buffer, since each binding is compared.
        lobe_moments: &Buffer::<[f32; 4]>::zeroed(context, "lobe_moments", 1)?,
        scores: &Buffer::from_slice(context, "scores", &vec![[1f32; SCORES as usize]; count])?,
    };
    let push = density_apply::Push {
        segment: 1,
        page_first: PAGE_FIRST,
        stride: count as u32,
        small: 0.05,
        most: 0.8,
        step: STEP,
        seed: SEED,
    };
    bench.run(|recorder| stage.record(recorder, &buffers, &push, count as u32))
}

fn moved(bench: &Bench<'_>, page: &Page) -> Result<()> {
    let (context, count) = (&bench.shadowed, page.count);
    let geometry = Buffer::from_slice(context, "geometry", &page.quads)?;
    let stage = density_noise::Stage::new(context, &density_noise::Spec { workgroup_size: page.workgroup_size })?;
    let buffers = density_noise::Buffers { population: &page.population, status: &page.status, geometry: &geometry };
    // So that the faintest move by about their own size.
    let push = density_noise::Push {
        segment: 1,
        page_first: PAGE_FIRST,
        stride: count as u32,
        rate: 100.0,
        step: STEP,
        seed: SEED,
    };
    bench.run(|recorder| stage.record(recorder, &buffers, &push, count as u32))
}
