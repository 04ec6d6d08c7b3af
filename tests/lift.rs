//! Compares inverse splatting on the device with its float64 twins.

mod common;

use common::{Gpu, assert_no_breach};
use glam::DVec3;
use glint::{
    gpu::Context,
    pipelines::{
        lift::{LiftBuffers, LiftOptions, LiftPhase, LiftSizes, PointBuffers},
        model::{Model, Room},
        views::view,
    },
    reference::random_scene,
    scene::{Gaussians, Scene},
    stages::{constants::cluster::MAX_GROWTHS, types},
    verify::lift::{Case, There, look_at},
};
use rand::{Rng, RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

fn exclusive_scan(counts: &[u32]) -> Vec<u32> {
    counts.iter().scan(0, |at, n| Some(std::mem::replace(at, *at + n))).collect()
}

// --- clustering of arbitrary sets ---

/// Sets of points, each with its heaviest point and first τ.
#[derive(Default)]
struct Sets {
    points: Vec<[f32; 4]>,
    counts: Vec<u32>,
    heaviest: Vec<u32>,
    taus: Vec<f32>,
}

impl Sets {
    fn push(&mut self, set: Vec<[f32; 3]>, heaviest: u32, tau: f32) {
        self.counts.push(set.len() as u32);
        self.points.extend(set.iter().map(|p| [p[0], p[1], p[2], 0.5]));
        self.heaviest.push(heaviest);
        self.taus.push(tau);
    }
}

struct Clustered {
    labels: Vec<u32>,
    taus: Vec<f32>,
    primes: Vec<u32>,
    sizes: Vec<u32>,
    rounds: Vec<u32>,
}

fn cluster_on_device(context: &Context, sets: &Sets, fail_on_smallest: bool) -> Clustered {
    let (n, count) = (sets.points.len() as u32, sets.counts.len() as u32);
    let phase = LiftPhase::new(context, LiftOptions { fail_on_smallest, ..Default::default() }).unwrap();
    let b = LiftBuffers::new(context, &LiftSizes { places: count, views: 1, train_views: 1 }).unwrap();
    let p = PointBuffers::new(context, &n).unwrap();
    let numbered = || sets.counts.iter().enumerate().flat_map(|(set, &n)| (0..n).map(move |i| (set as u32, i)));
    p.points.upload(0, &sets.points).unwrap();
    p.labels.upload(0, &numbered().map(|(_, i)| i).collect::<Vec<_>>()).unwrap();
    p.point_sets.upload(0, &numbered().map(|(set, _)| set).collect::<Vec<_>>()).unwrap();
    b.point_counts.upload(0, &sets.counts).unwrap();
    b.point_firsts.upload(0, &exclusive_scan(&sets.counts)).unwrap();
    b.heaviest.upload(0, &sets.heaviest).unwrap();
    b.taus.upload(0, &sets.taus).unwrap();
    let mut recorder = context.recorder("cluster").unwrap();
    recorder.fill(&b.prime_labels, 0);
    phase.record_clusters(&mut recorder, count, n, &b, &p);
    recorder.submit().unwrap().wait().unwrap();
    Clustered {
        labels: p.labels.download().unwrap(),
        taus: b.taus.download().unwrap(),
        primes: b.prime_labels.download().unwrap(),
        sizes: b.cluster_sizes.download().unwrap(),
        rounds: b.rounds.download().unwrap(),
    }
}

/// Coordinates and τ are small integers: every squared distance is exact in float32, so the partition must
/// equal the twin's to the last point, including ties at exactly τ.
fn assert_same_clusters(context: &Context, sets: &Sets) {
    for rule in [false, true] {
        assert_no_breach(context, |context| drop(cluster_on_device(context, sets, rule)));
    }
}

fn random_sets(rng: &mut impl Rng) -> Sets {
    let mut sets = Sets::default();
    for n in [0, 1, 2, 3, 4, 7, 8, 9, 31, 32, 33, 63, 64, 65, 130, 400] {
        for extent in [1, 6, 40, 300] {
            let set: Vec<_> = (0..n).map(|_| [0, 1, 2].map(|k| rng.random_range(0..=(extent >> k)) as f32)).collect();
            sets.push(set, rng.random_range(0..n.max(1)), rng.random_range(1..7) as f32);
        }
    }
    sets
}

/// Rows of pixels on two surfaces, as in footprints, with holes; row by row or `shuffled`.
fn footprint_like(rng: &mut impl Rng, radius: i32, shuffled: bool) -> Vec<[f32; 3]> {
    let mut set = Vec::new();
    for y in -radius..=radius {
        for x in -radius..=radius {
            if x * x + y * y <= radius * radius && rng.random_range(0..10) > 0 {
                let z = if x + y / 2 > radius / 3 { 200 } else { 100 + (y & 1) };
                set.push([x as f32, y as f32, z as f32]);
            }
        }
    }
    if shuffled {
        set.shuffle(rng);
    }
    set
}

#[test]
fn clusters_are_the_twins_on_chains_coincident_points_and_grids() {
    let context = Gpu::new();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut sets = random_sets(&mut rng);
    let mut chain: Vec<_> = (0..1500).map(|i| [i as f32, 0.0, 0.0]).collect();
    for tau in [1.0, 2.0] {
        sets.push(chain.clone(), 7, tau);
        chain.reverse();
        sets.push(chain.clone(), 7, tau);
        chain.shuffle(&mut rng);
        sets.push(chain.clone(), 1499, tau);
    }
    sets.push(vec![[3.0, 4.0, 5.0]; 700], 5, 1.0);
    let grid: Vec<_> = (0..900).map(|i| [(i % 30 * 4) as f32, (i / 30 * 3) as f32, 0.0]).collect();
    sets.push(grid.clone(), 5, 4.0);
    sets.push(grid, 5, 3.0);
    for (radius, shuffled) in [(8, false), (8, true), (25, false), (25, true)] {
        sets.push(footprint_like(&mut rng, radius, shuffled), 3, 5.0);
        sets.push(footprint_like(&mut rng, radius, shuffled), 3, 2.0);
    }
    for i in 0..100 {
        sets.push(footprint_like(&mut rng, 4 + i % 9, i % 3 == 0), 0, 3.0);
    }
    assert_same_clusters(&context, &sets);
    // Every run gives the same labels.
    let [a, b] = [(), ()].map(|()| cluster_on_device(&context, &sets, false));
    assert_eq!(a.labels, b.labels);
}

/// The largest footprint that the screen phase allows at 1600 × 1000 pixels: σ = 26 px to 3.3 σ, 23,000
/// points. The twin's comparison of all pairs would take long, but the result is known: two surfaces 100
/// apart are two groups.
#[test]
fn the_largest_footprint_falls_into_its_two_surfaces() {
    let context = Gpu::new();
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for shuffled in [false, true] {
        let set = footprint_like(&mut rng, 86, shuffled);
        let near = set.iter().filter(|p| p[2] < 150.0).count() as u32;
        let first = [true, false].map(|side| set.iter().position(|p| (p[2] < 150.0) == side).unwrap() as u32);
        let want: Vec<_> = set.iter().map(|p| first[usize::from(p[2] >= 150.0)]).collect();
        let mut sets = Sets::default();
        sets.push(set, first[0], 5.0);
        let got = cluster_on_device(&context, &sets, false);
        assert!(got.labels == want);
        assert_eq!((got.primes[0], got.sizes[0]), (first[0], near));
    }
}

#[test]
fn sets_that_cannot_be_clustered_have_size_zero() {
    let context = Gpu::new();
    let mut sets = Sets::default();
    for tau in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e30] {
        sets.push(vec![[0.0; 3]; 5], 0, tau);
    }
    sets.push(vec![[f32::NAN; 3]; 40], 0, 1.0);
    // Invalid points among valid ones.
    let mixed = |i: usize| {
        if i.is_multiple_of(3) { [1.0, [f32::NAN, f32::INFINITY][i % 2], 2.0] } else { [i as f32, 0.0, 0.0] }
    };
    sets.push((0..60).map(mixed).collect(), 1, 5.0);
    // Farther apart than 1.5^32 times the first τ.
    sets.push((0..9).map(|i| [i as f32 * 1e12, 0.0, 0.0]).collect(), 0, 1.0);
    // A heaviest point beyond the end is replaced by the last.
    let two = |i: usize| if i < 4 { [0.0; 3] } else { [100.0; 3] };
    sets.push((0..7).map(two).collect(), 77, 1.0);
    let got = cluster_on_device(&context, &sets, false);
    assert_eq!((got.sizes, got.primes[8]), (vec![0, 0, 0, 0, 0, 0, 40, 0, 3], 4));
}

/// Three points each, farther apart than the first τ and closer than the second: every set needs another
/// round.
#[test]
fn rounds_of_more_workgroups_than_a_dimension_has_reach_every_point() {
    let context = Gpu::new();
    // Workgroups of 64 threads, one point per thread.
    let count = 65_535 * 64 / 3 + 40;
    let mut sets = Sets::default();
    for _ in 0..count {
        sets.push(vec![[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [4.0, 0.0, 1.0]], 0, 1.5);
    }
    let got = cluster_on_device(&context, &sets, false);
    assert!(got.sizes.iter().all(|&n| n == 3) && got.taus.iter().all(|&tau| tau == 2.25));
    assert!(got.rounds.len() as u32 == 6 * (MAX_GROWTHS + 1));
    let [x, y, z] = got.rounds[6..9] else { unreachable!() };
    assert!(x <= 65_535 && x * y >= (3 * count as u32).div_ceil(64) && z == 1, "{x} × {y} × {z}");
}

// --- the whole of inverse splatting ---

struct OnDevice {
    counts: Vec<u32>,
    taus: Vec<f32>,
    sizes: Vec<u32>,
    lifts: Vec<types::Lift>,
    flags: Vec<u32>,
}

impl OnDevice {
    /// Number of lifts; checks that all their words are finite.
    fn made(&self) -> u32 {
        for (lift, &flag) in self.lifts.iter().zip(&self.flags) {
            let words: &[f32] = bytemuck::cast_slice(std::slice::from_ref(lift));
            assert!(words[..words.len() - 1].iter().all(|v| v.is_finite()), "{lift:?}");
            assert_eq!(flag == 1, lift.cluster_size > 0);
        }
        self.flags.iter().sum()
    }
}

fn lift_on_device(context: &Context, case: &Case, options: LiftOptions) -> OnDevice {
    let phase = LiftPhase::new(context, options).unwrap();
    let there = There::new(context, case).unwrap();
    let (flat, b) = (there.flat(), &there.lift);
    let mut recorder = context.recorder("count").unwrap();
    phase.record_count(&mut recorder, &flat, b);
    recorder.submit().unwrap().wait().unwrap();
    let total: u32 = b.point_counts.download().unwrap().iter().sum();
    let p = PointBuffers::new(context, &total).unwrap();
    let mut recorder = context.recorder("lift").unwrap();
    phase.record_points(&mut recorder, &flat, b, &p);
    phase.record_clusters(&mut recorder, flat.count, total, b, &p);
    phase.record_pca(&mut recorder, &flat, case.unit, b, &p);
    recorder.submit().unwrap().wait().unwrap();
    OnDevice {
        counts: b.point_counts.download().unwrap(),
        taus: b.taus.download().unwrap(),
        sizes: b.cluster_sizes.download().unwrap(),
        lifts: b.lifts.download().unwrap(),
        flags: b.lift_flags.download().unwrap(),
    }
}

#[test]
fn lifts_are_the_twins() {
    let context = Gpu::new();
    for (seed, plain_weights) in [(21, false), (22, true)] {
        let options = LiftOptions { plain_weights, ..Default::default() };
        let case = Case::new(seed, 300, DVec3::ZERO);
        assert_no_breach(&context, |context| drop(lift_on_device(context, &case, options)));
        assert!(lift_on_device(&context, &case, LiftOptions::default()).made() > 150);
    }
}

/// At 1000 a float32 is off by 3e-5, the eye too; the shape must not depend on it.
#[test]
fn a_scene_far_from_its_origin_is_lifted_as_well() {
    let (context, case) = (Gpu::new(), Case::new(23, 100, DVec3::new(1000.0, -500.0, 700.0)));
    assert_no_breach(&context, |context| drop(lift_on_device(context, &case, LiftOptions::default())));
    assert!(lift_on_device(&context, &case, LiftOptions::default()).made() > 50);
}

#[test]
fn broken_input_gives_no_lift_and_no_nan() {
    let context = Gpu::new();
    let mut case = Case::new(31, 200, DVec3::ZERO);
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38, -1e38, 0.0];
    for i in 0..200 {
        case.screen_planes[rng.random_range(0..10) * 200 + i] = bad[i % bad.len()];
    }
    for d in &mut case.depths {
        if rng.random_range(0..5) == 0 {
            *d = bad[rng.random_range(0..bad.len())];
        }
    }
    case.views[1].row_y[2] = f32::NAN;
    case.train_views = vec![0, 1, 2, 3, 4, 99, u32::MAX];
    let made = lift_on_device(&context, &case, LiftOptions::default()).made();
    assert!(made > 20, "{made}");
}

/// One camera in front of twelve fields of 40 × 40 pixels, with a 2D Gaussian in the middle of each; `depth`
/// gives the depth of a field's pixel, relative to its middle.
fn fields(unit: f32, depth: impl Fn(usize, i32, i32) -> f32) -> Case {
    let camera = look_at(DVec3::new(0.5, -0.4, -6.0), DVec3::ZERO, 240, 80);
    let field = |x: u32, y: u32| ((x / 40 + 6 * (y / 40)) as usize, x as i32 % 40 - 20, y as i32 % 40 - 20);
    let depths: Vec<f32> = (0..240 * 80).map(|p| field(p % 240, p / 240)).map(|(f, x, y)| depth(f, x, y)).collect();
    let mut screen_planes = vec![0f32; 10 * 12];
    for f in 0..12 {
        let (x, y) = (40 * (f % 6) + 20, 40 * (f / 6) + 20);
        let column = [x as f32 + 0.4, y as f32 + 0.3, 0.2, 0.5, 0.7, 2.0, 1.1, 0.7, 0.4, depths[y * 240 + x]];
        (0..10).for_each(|p| screen_planes[p * 12 + f] = column[p]);
    }
    Case {
        views: vec![view(&camera, 0)],
        cameras: vec![camera],
        depths,
        pixel_firsts: vec![0],
        screen_planes,
        screen_frames: vec![0; 12],
        train_views: vec![0],
        unit,
    }
}

#[test]
fn degenerate_footprints_are_lifted_as_the_twin_lifts_them() {
    let context = Gpu::new();
    let on = |yes: bool| if yes { 5.0 } else { 0.0 };
    // A pixel is 5 / 264 wide at depth 5, the first τ five times that: 0.095.
    let step = 0.08;
    let of = |yes: bool, near: f32, far: f32| if yes { near } else { far };
    let depth = |field: usize, x: i32, y: i32| match field {
        0 => on((x, y) == (0, 0)),              // one pixel
        1 => on(y == 0 && (0..2).contains(&x)), // two
        2 => on(y == 0 && (0..3).contains(&x)), // three in a row
        3 => on(y == 0),                        // a row
        4 => on(x == y),                        // a diagonal
        5 => on(x * x + y * y >= 4),            // no depth at the centre
        6 => of((0..2).contains(&x), 5.0, 9.0), // a strip at the centre, fewer pixels than behind it
        7 => 5.0 + step * (x + 20) as f32,      // a stair that single linkage must join
        8 => of((x + y) % 2 == 0, 5.0, 8.0),    // two surfaces, pixel by pixel
        9 => of((x, y) == (0, 0), 3.0, 5.0),    // a single heaviest pixel in front of the rest
        10 => on(x % 4 == 0 && y % 4 == 0),     // a sparse grid
        _ => 5.0,                               // facing the camera: two equal eigenvalues
    };
    let mut case = fields(6.0, depth);
    // A circle, so that the last field's eigenvalues are equal.
    (case.screen_planes[6 * 12 + 11], case.screen_planes[7 * 12 + 11]) = (1.0, 1.0);
    assert_no_breach(&context, |context| drop(lift_on_device(context, &case, LiftOptions::default())));
    let got = lift_on_device(&context, &case, LiftOptions::default());
    println!("groups {:?} of {:?} points, τ {:?}", got.sizes, got.counts, got.taus);
    let sizes = &got.sizes;
    assert_eq!((sizes[0], sizes[1], sizes[2]), (0, 0, 3));
    assert!(got.made() == 10 && got.counts[0] == 1 && got.counts[1] == 2);
    // Rows and diagonals have no width: their two smaller axes are at the floor.
    for f in [2, 3, 4] {
        let [_, b, c] = got.lifts[f].log_scale;
        assert!((b - c).abs() < 1e-3, "{f}");
    }
    assert!(got.lifts[6].mean[2] < 0.0 && sizes[6] < got.counts[6] / 2, "the strip with the heaviest pixel");
    assert_eq!(sizes[7], got.counts[7], "the chain is one");
    // The two surfaces are joined or separate as a whole; the single pixel in front has fewer than three
    // points.
    assert!(sizes[8] < got.counts[8] && sizes[9] == got.counts[9] - 1, "{sizes:?}");

    // Q near zero: no length unit, points in one place, so that all eigenvalues are the floor's 0.
    let nothing = fields(0.0, |f, x, y| if f < 6 { on(y == 0 && x >= 0 && x < f as i32) } else { 5.0 });
    let got = lift_on_device(&context, &nothing, LiftOptions::default());
    got.made();
    assert!(got.flags[..3].iter().all(|&f| f == 0), "{:?}", got.flags);
}

/// Writes points into sets declared smaller or larger than they are. Counting and writing make the same
/// decisions, but a difference of a pixel must neither write into a neighbour's place nor leave one
/// uninitialised.
#[test]
fn counts_of_points_that_differ_from_what_is_found_harm_no_neighbour() {
    let context = Gpu::new();
    let case = Case::new(11, 60, DVec3::ZERO);
    let phase = LiftPhase::new(&context, LiftOptions::default()).unwrap();
    let there = There::new(&context, &case).unwrap();
    let mut recorder = context.recorder("count").unwrap();
    phase.record_count(&mut recorder, &there.flat(), &there.lift);
    recorder.submit().unwrap().wait().unwrap();
    let found = there.lift.point_counts.download().unwrap();
    assert!(found.iter().filter(|&&n| n > 1).count() > 20);
    // Gaps between the sets must stay untouched.
    let room: Vec<u32> = found.iter().map(|&n| n + 20).collect();
    let firsts = exclusive_scan(&room);
    there.lift.point_firsts.upload(0, &firsts).unwrap();
    let written = |counts: &[u32]| {
        there.lift.point_counts.upload(0, counts).unwrap();
        let p = PointBuffers::new(&context, &room.iter().sum()).unwrap();
        let mut recorder = context.recorder("points").unwrap();
        for words in [&p.point_sets, &p.labels] {
            recorder.fill(words, u32::MAX);
        }
        phase.record_points(&mut recorder, &there.flat(), &there.lift, &p);
        recorder.submit().unwrap().wait().unwrap();
        let (points, sets, labels) =
            (p.points.download().unwrap(), p.point_sets.download().unwrap(), p.labels.download().unwrap());
        let of = |item: usize| {
            let (first, n) = (firsts[item] as usize, counts[item] as usize);
            let (own, beyond) = (first..first + n, first + n..first + room[item] as usize);
            assert!(sets[own.clone()].iter().all(|&set| set == item as u32), "{item}");
            assert!(labels[own.clone()].iter().copied().eq(0..counts[item]), "{item}");
            assert!(sets[beyond.clone()].iter().chain(&labels[beyond]).all(|&word| word == u32::MAX), "{item}");
            points[own].to_vec()
        };
        (0..counts.len()).map(of).collect::<Vec<_>>()
    };
    let right = written(&found);
    let fewer = written(&found.iter().map(|&n| n.saturating_sub(1)).collect::<Vec<_>>());
    // Empty sets stay empty: those have nothing to lift.
    let more = written(&found.iter().map(|&n| if n > 0 { n + 9 } else { 0 }).collect::<Vec<_>>());
    for ((right, fewer), more) in right.iter().zip(&fewer).zip(&more) {
        let n = right.len();
        assert!(right.iter().all(|p| p[3] > 0.0) && fewer[..] == right[..n.saturating_sub(1)]);
        if let Some(&[x, y, z, _]) = right.last() {
            assert!(more[..n] == right[..] && more[n..].iter().all(|&p| p == [x, y, z, 0.0]));
        }
    }
}

/// A supplement of several pages: each dispatch writes its own, and an overflow of the last is reported.
#[test]
fn lifts_beyond_the_page_are_left_to_another_dispatch() {
    let context = Gpu::new();
    let phase = LiftPhase::new(&context, LiftOptions::default()).unwrap();
    let lift = |i: usize| types::Lift {
        mean: [i as f32, 0.5, 2.0],
        log_scale: [-(i as f32), 0.25, 1.0],
        quat: [1.0, 0.0, 0.0, i as f32],
        lobe_dir: [0.0, 0.0, 1.0],
        lobe_width: 0.5,
        cluster_size: if i.is_multiple_of(3) { 0 } else { 5 },
        ..Default::default()
    };
    let lifts: Vec<types::Lift> = (0..30).map(lift).collect();
    let wanted = || lifts.iter().filter(|l| l.cluster_size > 0);
    let scene = Scene { base: random_scene(5, 10, 0, 1).base, ..Default::default() };
    let model = |supplement| {
        let room = Room { supplement, page: Some(8), ..Default::default() };
        Model::upload_around(&context, DVec3::ZERO, &scene, room).unwrap()
    };
    let mut enough = model(20);
    phase.append_lifts(&lifts, &mut enough).unwrap();
    let made = enough.download().unwrap();
    assert!(made.base == scene.base);
    // Beyond its page a lift would be written over another property.
    let Gaussians { means, log_scales, quats, .. } = made.supplement.unwrap().gaussians;
    assert!(means.iter().eq(wanted().map(|l| &l.mean)) && log_scales.iter().eq(wanted().map(|l| &l.log_scale)));
    assert!(quats.iter().eq(wanted().map(|l| &l.quat)), "{quats:?}");
    assert!(phase.append_lifts(&lifts, &mut model(19)).is_err());
}
