//! Inverse splatting on the device against its float64 twins.

use glam::DVec3;
use glint::{
    gpu::{Buffer, Context, ContextOptions},
    pipelines::views::view,
    reference::{
        lift_append as append_twin, lift_cluster as cluster_twin, lift_pca as pca_twin,
        lift_points::{self as points_twin, LiftPoints},
    },
    stages::{
        lift_append::{self, LiftAppend},
        lift_cluster::{self, LiftCluster},
        lift_count::{self, LiftCount},
        lift_pca::{self, LiftPca},
        lift_points::{self, LiftPoints as LiftPointsStage},
        types,
    },
    verify::lift::{Case, covariance, look_at},
};
use rand::{Rng, RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;

fn context() -> Context {
    Context::new(&ContextOptions::from_env()).expect("a Vulkan device")
}

fn buffer<T: bytemuck::Pod>(context: &Context, name: &str, data: &[T]) -> Buffer<T> {
    Buffer::from_slice(context, name, data).unwrap()
}

fn room<T: bytemuck::Pod>(context: &Context, name: &str, len: usize) -> Buffer<T> {
    Buffer::zeroed(context, name, len).unwrap()
}

fn exclusive_scan(counts: &[u32]) -> Vec<u32> {
    counts.iter().scan(0, |at, n| Some(std::mem::replace(at, *at + n))).collect()
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}

// --- clustering of arbitrary sets ---

/// Sets of points with a heaviest one and a first τ each.
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

fn cluster_on_device(context: &Context, sets: &Sets, fail_on_smallest: bool, workgroup_size: u32) -> Clustered {
    let stage = LiftCluster::new(context, workgroup_size, fail_on_smallest).unwrap();
    let (n, count) = (sets.points.len(), sets.counts.len());
    let numbered = || sets.counts.iter().enumerate().flat_map(|(set, &n)| (0..n).map(move |i| (set as u32, i)));
    let labels = buffer(context, "labels", &numbered().map(|(_, i)| i).collect::<Vec<_>>());
    let taus = buffer(context, "taus", &sets.taus);
    let prime_labels = room(context, "prime_labels", count);
    let cluster_sizes = room(context, "cluster_sizes", count);
    let rounds = room(context, "rounds", lift_cluster::ROUNDS_LEN);
    let buffers = lift_cluster::Buffers {
        points: &buffer(context, "points", &sets.points),
        point_counts: &buffer(context, "point_counts", &sets.counts),
        point_firsts: &buffer(context, "point_firsts", &exclusive_scan(&sets.counts)),
        heaviest: &buffer(context, "heaviest", &sets.heaviest),
        point_sets: &buffer(context, "point_sets", &numbered().map(|(set, _)| set).collect::<Vec<_>>()),
        labels: &labels,
        group_sizes: &room(context, "group_sizes", n),
        taus: &taus,
        prime_labels: &prime_labels,
        cluster_sizes: &cluster_sizes,
        rounds: &rounds,
    };
    let mut recorder = context.recorder("cluster").unwrap();
    recorder.time_stages();
    stage.record(&mut recorder, &buffers, count as u32, n as u32);
    let times = recorder.submit().unwrap().wait().unwrap();
    let total: std::time::Duration = times.iter().map(|t| t.time).sum();
    println!("clustering of {count} sets, {n} points: {total:?}, of it join {:?}", times.get(2).map(|t| t.time));
    Clustered {
        labels: labels.download().unwrap(),
        taus: taus.download().unwrap(),
        primes: prime_labels.download().unwrap(),
        sizes: cluster_sizes.download().unwrap(),
        rounds: rounds.download().unwrap(),
    }
}

/// Coordinates and τ are small integers: every squared distance is exact in float32, so the partition must be the twin's to
/// the last point, ties at exactly τ included.
fn assert_same_clusters(context: &Context, sets: &Sets, workgroup_size: u32) {
    let points: Vec<_> = sets.points.iter().map(|p| p.map(f64::from)).collect();
    let firsts = exclusive_scan(&sets.counts);
    for rule in [false, true] {
        let got = cluster_on_device(context, sets, rule, workgroup_size);
        let want = cluster_twin::lift_cluster(&points, &sets.counts, &firsts, &sets.heaviest, &wide(&sets.taus), rule);
        for (set, (&first, &n)) in firsts.iter().zip(&sets.counts).enumerate() {
            let range = first as usize..(first + n) as usize;
            let what = format!("set {set} of {} points, fail on smallest {rule}", range.len());
            assert_eq!(got.labels[range.clone()], want.labels[range], "{what}");
            assert_eq!(got.primes[set], want.prime_labels[set], "{what}");
            assert_eq!(got.sizes[set], want.cluster_sizes[set], "{what}");
            // Each growth rounds: 32 times at most.
            let (a, b) = (f64::from(got.taus[set]), want.taus[set]);
            assert!((a - b).abs() <= 32.0 * 6e-8 * b, "{what}: τ {a} instead of {b}");
        }
    }
}

fn random_sets(seed: u64) -> Sets {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sets = Sets::default();
    for n in [0, 1, 2, 3, 4, 7, 8, 9, 31, 32, 33, 63, 64, 65, 130, 400] {
        for extent in [1, 6, 40, 300] {
            let set: Vec<_> = (0..n).map(|_| [0, 1, 2].map(|k| rng.random_range(0..=(extent >> k)) as f32)).collect();
            sets.push(set, rng.random_range(0..n.max(1)), rng.random_range(1..7) as f32);
        }
    }
    sets
}

/// Rows of pixels on two surfaces, as footprints give, with holes; row by row or `shuffled`.
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
fn clusters_are_the_twins_on_random_sets() {
    let context = context();
    for (seed, workgroup_size) in [(1, 64), (2, 32), (3, 256)] {
        assert_same_clusters(&context, &random_sets(seed), workgroup_size);
    }
}

#[test]
fn clusters_are_the_twins_on_chains_coincident_points_and_grids() {
    let context = context();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut sets = Sets::default();
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
    assert_same_clusters(&context, &sets, 64);
}

#[test]
fn clustering_many_sets_at_once_gives_every_run_the_same_labels() {
    let context = context();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut sets = Sets::default();
    for i in 0..300 {
        sets.push(footprint_like(&mut rng, 4 + i % 9, i % 3 == 0), 0, 3.0);
    }
    assert_same_clusters(&context, &sets, 64);
    let (a, b) = (cluster_on_device(&context, &sets, false, 64), cluster_on_device(&context, &sets, false, 128));
    assert_eq!(a.labels, b.labels);
}

/// The largest footprint that the plane stage allows at 1600 × 1000 pixels: σ = 26 px to 3.3 σ, 23,000 points. The twin's
/// all pairs would take long; that two surfaces 100 apart are two groups is known.
#[test]
fn the_largest_footprint_falls_into_its_two_surfaces() {
    let context = context();
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for shuffled in [false, true] {
        let set = footprint_like(&mut rng, 86, shuffled);
        let near = set.iter().filter(|p| p[2] < 150.0).count() as u32;
        let first = [true, false].map(|side| set.iter().position(|p| (p[2] < 150.0) == side).unwrap() as u32);
        let want: Vec<_> = set.iter().map(|p| first[usize::from(p[2] >= 150.0)]).collect();
        let mut sets = Sets::default();
        sets.push(set, first[0], 5.0);
        let got = cluster_on_device(&context, &sets, false, 64);
        assert!(got.labels == want);
        assert_eq!((got.primes[0], got.sizes[0]), (first[0], near));
    }
}

#[test]
fn sets_that_cannot_be_clustered_have_size_zero() {
    let context = context();
    let mut sets = Sets::default();
    for tau in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e30] {
        sets.push(vec![[0.0; 3]; 5], 0, tau);
    }
    sets.push(vec![[f32::NAN; 3]; 40], 0, 1.0);
    // Broken points among good ones.
    let mixed = |i: usize| {
        if i.is_multiple_of(3) { [1.0, [f32::NAN, f32::INFINITY][i % 2], 2.0] } else { [i as f32, 0.0, 0.0] }
    };
    sets.push((0..60).map(mixed).collect(), 1, 5.0);
    // Farther apart than 1.5^32 times the first τ.
    sets.push((0..9).map(|i| [i as f32 * 1e12, 0.0, 0.0]).collect(), 0, 1.0);
    // A heaviest point that does not exist is taken for the last.
    let two = |i: usize| if i < 4 { [0.0; 3] } else { [100.0; 3] };
    sets.push((0..7).map(two).collect(), 77, 1.0);
    let got = cluster_on_device(&context, &sets, false, 64);
    assert_eq!((got.sizes, got.primes[8]), (vec![0, 0, 0, 0, 0, 0, 40, 0, 3], 4));
}

/// Three points each, farther apart than the first τ and closer than the second: every set asks for another round.
#[test]
fn rounds_of_more_workgroups_than_a_dimension_has_reach_every_point() {
    let context = context();
    // The smallest workgroup that a stage can have.
    let lanes = context.info().subgroup_size;
    let count = 65_535 * lanes / 3 + 40;
    let mut sets = Sets::default();
    for _ in 0..count {
        sets.push(vec![[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [4.0, 0.0, 1.0]], 0, 1.5);
    }
    let got = cluster_on_device(&context, &sets, false, lanes);
    assert!(got.sizes.iter().all(|&n| n == 3) && got.taus.iter().all(|&tau| tau == 2.25));
    let [x, y, z] = got.rounds[6..9] else { unreachable!() };
    assert!(x <= 65_535 && x * y >= (3 * count).div_ceil(lanes) && z == 1, "{x} × {y} × {z}");
}

// --- the whole of inverse splatting ---

struct OnDevice {
    counts: Vec<u32>,
    firsts: Vec<u32>,
    points: Vec<[f32; 4]>,
    heaviest: Vec<u32>,
    start_taus: Vec<f32>,
    clusters: Clustered,
    lifts: Vec<types::Lift>,
    flags: Vec<u32>,
    geometry: Vec<f32>,
    sh: Vec<f32>,
    lobes: Vec<f32>,
}

const GAUSSIAN_FIRST: u32 = 7;
const LOBE_FIRST: u32 = 2;
const SH_COEFFICIENTS: u32 = 4;

fn lift_on_device(context: &Context, case: &Case, plain_weights: u32) -> OnDevice {
    let count = case.plane_views.len();
    let (n, workgroup_size) = (count as u32, 64);
    let stride = case.stride as u32;
    let view_count = case.views.len() as u32;
    let plane = buffer(context, "plane", &case.plane);
    let plane_views = buffer(context, "plane_views", &case.plane_views);
    let views = buffer(context, "views", &case.views);
    let depths = buffer(context, "depths", &case.depths);
    let train_views = buffer(context, "train_views", &case.train_views);
    let point_counts = room(context, "point_counts", count);

    let stage = LiftCount::new(context, &lift_count::Spec { workgroup_size }).unwrap();
    let buffers = lift_count::Buffers {
        plane: &plane,
        plane_views: &plane_views,
        views: &views,
        depths: &depths,
        point_counts: &point_counts,
    };
    let mut recorder = context.recorder("count").unwrap();
    stage.record(&mut recorder, &buffers, &lift_count::Push { count: n, stride, view_count });
    recorder.submit().unwrap().wait().unwrap();

    let counts = point_counts.download().unwrap();
    let firsts = exclusive_scan(&counts);
    let total = counts.iter().sum::<u32>() as usize;
    let point_firsts = buffer(context, "point_firsts", &firsts);
    let points = room(context, "points", total);
    let heaviest = room(context, "heaviest", count);
    let labels = room(context, "labels", total);
    let point_sets = room(context, "point_sets", total);
    let group_sizes = room(context, "group_sizes", total);
    let taus = room(context, "taus", count);
    let prime_labels = room(context, "prime_labels", count);
    let cluster_sizes = room(context, "cluster_sizes", count);
    let lifts = room(context, "lifts", count);
    let lift_flags = room(context, "lift_flags", count);
    let rounds = room(context, "rounds", lift_cluster::ROUNDS_LEN);

    let points_stage = LiftPointsStage::new(context, &lift_points::Spec { workgroup_size }).unwrap();
    let cluster_stage = LiftCluster::new(context, workgroup_size, false).unwrap();
    let pca_stage = LiftPca::new(context, &lift_pca::Spec { workgroup_size, plain_weights }).unwrap();
    let mut recorder = context.recorder("lift").unwrap();
    let start_taus = buffer::<f32>(context, "start_taus", &vec![0.0; count]);
    recorder.time_stages();
    points_stage.record(
        &mut recorder,
        &lift_points::Buffers {
            plane: &plane,
            plane_views: &plane_views,
            views: &views,
            depths: &depths,
            point_counts: &point_counts,
            point_firsts: &point_firsts,
            points: &points,
            heaviest: &heaviest,
            taus: &taus,
            point_sets: &point_sets,
            labels: &labels,
        },
        &lift_points::Push { count: n, stride, view_count },
    );
    recorder.copy(&taus, 0, &start_taus, 0, count);
    cluster_stage.record(
        &mut recorder,
        &lift_cluster::Buffers {
            points: &points,
            point_counts: &point_counts,
            point_firsts: &point_firsts,
            heaviest: &heaviest,
            point_sets: &point_sets,
            labels: &labels,
            group_sizes: &group_sizes,
            taus: &taus,
            prime_labels: &prime_labels,
            cluster_sizes: &cluster_sizes,
            rounds: &rounds,
        },
        n,
        total as u32,
    );
    pca_stage.record(
        &mut recorder,
        &lift_pca::Buffers {
            plane: &plane,
            plane_views: &plane_views,
            views: &views,
            train_views: &train_views,
            points: &points,
            point_counts: &point_counts,
            point_firsts: &point_firsts,
            heaviest: &heaviest,
            labels: &labels,
            prime_labels: &prime_labels,
            cluster_sizes: &cluster_sizes,
            lifts: &lifts,
            lift_flags: &lift_flags,
        },
        &lift_pca::Push { count: n, stride, view_count, train_count: case.train_views.len() as u32, unit: case.unit },
    );
    let times = recorder.submit().unwrap().wait().unwrap();
    for name in ["lift_points", "lift_join", "lift_groups", "lift_pca"] {
        let sum: std::time::Duration = times.iter().filter(|t| t.name == name).map(|t| t.time).sum();
        println!("{name} of {count} Gaussians, {total} points: {sum:?}");
    }

    let flags = lift_flags.download().unwrap();
    let capacity = GAUSSIAN_FIRST + flags.iter().sum::<u32>() + 3;
    let nines = |planes: u32| buffer(context, "parameters", &vec![9f32; (planes * capacity) as usize]);
    let (geometry, sh, lobes) = (nines(11), nines(3 * SH_COEFFICIENTS), nines(5));
    let append = LiftAppend::new(context, &lift_append::Spec { workgroup_size }).unwrap();
    let mut recorder = context.recorder("append").unwrap();
    append.record(
        &mut recorder,
        &lift_append::Buffers {
            lifts: &lifts,
            lift_ranks: &buffer(context, "lift_ranks", &exclusive_scan(&flags)),
            geometry: &geometry,
            sh: &sh,
            lobes: &lobes,
        },
        &lift_append::Push {
            count: n,
            gaussian_first: GAUSSIAN_FIRST,
            lobe_first: LOBE_FIRST,
            stride: capacity,
            lobe_stride: capacity,
            sh_coefficients: SH_COEFFICIENTS,
        },
    );
    recorder.submit().unwrap().wait().unwrap();
    assert_eq!(context.validation_messages(), Vec::<String>::new());
    OnDevice {
        counts,
        firsts,
        points: points.download().unwrap(),
        heaviest: heaviest.download().unwrap(),
        start_taus: start_taus.download().unwrap(),
        clusters: Clustered {
            labels: labels.download().unwrap(),
            taus: taus.download().unwrap(),
            primes: prime_labels.download().unwrap(),
            sizes: cluster_sizes.download().unwrap(),
            rounds: rounds.download().unwrap(),
        },
        lifts: lifts.download().unwrap(),
        flags,
        geometry: geometry.download().unwrap(),
        sh: sh.download().unwrap(),
        lobes: lobes.download().unwrap(),
    }
}

#[test]
fn counts_and_points_are_the_twins() {
    let context = context();
    let case = Case::new(11, 400, DVec3::ZERO);
    let (plane, depths) = (wide(&case.plane), wide(&case.depths));
    let g = case.gaussians(&plane, &depths);
    let got = lift_on_device(&context, &case, 0);
    let want = points_twin::lift_points(&g);
    let mut same_sets = 0;
    for i in 0..g.len() {
        // α in float32 errs by the absolute error of the exponent, which is at most 5.5 and a difference of products a few times
        // as large, and by exp's own (3 + 2|x| ulp is what Vulkan allows: 8e-7 here). 1.3e-5 was seen on an NVIDIA H200, less on
        // llvmpipe; 4e-5 leaves room for another driver.
        let unsure = match g.footprint(i) {
            Some(f) => f.pixels().filter(|&(x, y)| (f.response(x, y) * 255.0 - 1.0).abs() < 4e-5).count() as u32,
            None => 0,
        };
        assert!(got.counts[i].abs_diff(want.counts[i]) <= unsure, "{i}: {} {}", got.counts[i], want.counts[i]);
        if unsure > 0 {
            continue;
        }
        same_sets += 1;
        let set = &got.points[got.firsts[i] as usize..][..got.counts[i] as usize];
        for (k, (a, b)) in set.iter().zip(want.set(i)).enumerate() {
            for c in 0..3 {
                // Two products of rounded factors at z ≤ 12.
                assert!((f64::from(a[c]) - b[c]).abs() < 5e-6, "{i}.{k}: {a:?} {b:?}");
            }
            assert!((f64::from(a[3]) - b[3]).abs() < 4e-5 * b[3], "{i}.{k}: {a:?} {b:?}");
        }
        // The heaviest is the first of the device's own greatest weights.
        let top = set.iter().map(|p| p[3]).fold(0.0, f32::max);
        assert_eq!(set.iter().position(|p| p[3] == top).unwrap_or(0) as u32, got.heaviest[i]);
        if got.heaviest[i] == want.heaviest[i] {
            assert!((f64::from(got.start_taus[i]) - want.start_taus[i]).abs() <= 1e-6 * want.start_taus[i]);
        }
    }
    assert!(same_sets > 350, "{same_sets}");
    assert!(got.counts.iter().filter(|&&c| c > 0).count() > 200);
}

/// Clustering and PCA of the device's own points, so that a pixel at the edge of 1/255 does not matter. Returns how many lifts
/// were made.
fn assert_lifts_are_the_twins(context: &Context, case: &Case, plain_weights: bool, position_error: f64) -> usize {
    let (plane, depths) = (wide(&case.plane), wide(&case.depths));
    let g = case.gaussians(&plane, &depths);
    let got = lift_on_device(context, case, u32::from(plain_weights));
    let points = LiftPoints {
        counts: got.counts.clone(),
        firsts: got.firsts.clone(),
        points: got.points.iter().map(|p| p.map(f64::from)).collect(),
        heaviest: got.heaviest.clone(),
        start_taus: wide(&got.start_taus),
    };
    let clusters = cluster_twin::lift_cluster(
        &points.points,
        &points.counts,
        &points.firsts,
        &points.heaviest,
        &points.start_taus,
        false,
    );
    assert_eq!(got.clusters.labels, clusters.labels);
    assert_eq!(got.clusters.primes, clusters.prime_labels);
    assert_eq!(got.clusters.sizes, clusters.cluster_sizes);
    for (a, b) in got.clusters.taus.iter().zip(&clusters.taus) {
        assert!((f64::from(*a) - b).abs() <= 32.0 * 6e-8 * b);
    }
    let want = pca_twin::lift_pca(&g, &points, &clusters, &case.train_views, f64::from(case.unit), plain_weights);
    for (i, (a, b)) in got.lifts.iter().zip(&want).enumerate() {
        assert_eq!(a.cluster_size, b.cluster_size, "{i}");
        assert_eq!(got.flags[i], u32::from(b.cluster_size > 0), "{i}");
        let near = |name: &str, a: &[f32], b: &[f64], tolerance: f64| {
            for (a, b) in a.iter().zip(b) {
                assert!((f64::from(*a) - b).abs() <= tolerance, "{i} {name}: {a} {b}");
            }
        };
        near("mean", &a.mean, &b.mean, position_error);
        near("dc", &a.dc, &b.dc, 2e-6);
        near("opacity", &[a.opacity], &[b.opacity], 0.0);
        near("lobe_dir", &a.lobe_dir, &b.lobe_dir, 1e-6);
        // The angle between two directions, each off by the position's error over a distance of 4 or more.
        near("theta_bar", &[a.theta_bar], &[b.theta_bar], 1e-6 + position_error);
        near("lobe_width", &[a.lobe_width], &[b.lobe_width], 3e-6 + 3.0 * position_error);
        if b.cluster_size == 0 {
            continue;
        }
        // Jacobi in float32 errs by some 1e-6 of the greatest eigenvalue, the sums over up to a thousand points by as much, k² by a few
        // 1e-6 of itself: 2e-5 of the largest entry.
        let (ca, cb) = (covariance(a.quat.map(f64::from), a.log_scale.map(f64::from)), covariance(b.quat, b.log_scale));
        let largest = cb.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        for (p, q) in ca.iter().zip(&cb) {
            assert!((p - q).abs() < 2e-5 * largest, "{i}: {ca:?} {cb:?}");
        }
        assert!((a.quat.iter().map(|q| q * q).sum::<f32>() - 1.0).abs() < 1e-6);
        // So a small eigenvalue is the less sure, relative to itself, the smaller it is.
        for (p, q) in a.log_scale.iter().zip(&b.log_scale) {
            let slack = 2e-5 * (2.0 * (b.log_scale[0] - q)).exp();
            assert!((f64::from(*p) - q).abs() < slack, "{i}: {:?} {:?}", a.log_scale, b.log_scale);
        }
    }

    // Appending the device's lifts: every word where the twin puts it, the others untouched.
    let lifts: Vec<_> = got
        .lifts
        .iter()
        .map(|l| pca_twin::Lift {
            mean: l.mean.map(f64::from),
            log_scale: l.log_scale.map(f64::from),
            quat: l.quat.map(f64::from),
            dc: l.dc.map(f64::from),
            opacity: f64::from(l.opacity),
            lobe_dir: l.lobe_dir.map(f64::from),
            lobe_width: f64::from(l.lobe_width),
            theta_bar: f64::from(l.theta_bar),
            cluster_size: l.cluster_size,
        })
        .collect();
    let made = got.flags.iter().sum::<u32>() as usize;
    let capacity = GAUSSIAN_FIRST as usize + made + 3;
    let nines = |planes: usize| vec![9.0; planes * capacity];
    let (mut geometry, mut sh, mut lobes) = (nines(11), nines(3 * SH_COEFFICIENTS as usize), nines(5));
    let mut planes = append_twin::ParameterPlanes {
        geometry: &mut geometry,
        sh: &mut sh,
        lobes: &mut lobes,
        stride: capacity,
        lobe_stride: capacity,
        sh_coefficients: SH_COEFFICIENTS as usize,
    };
    append_twin::lift_append(&lifts, GAUSSIAN_FIRST as usize, LOBE_FIRST as usize, &mut planes);
    assert_eq!(wide(&got.geometry), geometry);
    assert_eq!(wide(&got.sh), sh);
    assert_eq!(wide(&got.lobes), lobes);
    made
}

#[test]
fn lifts_are_the_twins() {
    let context = context();
    for (seed, plain_weights) in [(21, false), (22, true)] {
        // Coordinates up to 6, a dozen roundings of 3e-7 each.
        let made = assert_lifts_are_the_twins(&context, &Case::new(seed, 300, DVec3::ZERO), plain_weights, 4e-6);
        assert!(made > 150, "{made}");
    }
}

#[test]
fn a_scene_far_from_its_origin_is_lifted_as_well() {
    // At 1000 a float32 is off by 3e-5, the eye too; the shape must not be touched by it.
    let made =
        assert_lifts_are_the_twins(&context(), &Case::new(23, 100, DVec3::new(1000.0, -500.0, 700.0)), false, 2e-4);
    assert!(made > 50, "{made}");
}

#[test]
fn broken_input_gives_no_lift_and_no_nan() {
    let context = context();
    let mut case = Case::new(31, 200, DVec3::ZERO);
    let mut rng = ChaCha8Rng::seed_from_u64(31);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e38, -1e38, 0.0];
    for i in 0..200 {
        case.plane[rng.random_range(0..10) * 200 + i] = bad[i % bad.len()];
    }
    for d in &mut case.depths {
        if rng.random_range(0..5) == 0 {
            *d = bad[rng.random_range(0..bad.len())];
        }
    }
    case.views[1].row_y[2] = f32::NAN;
    case.train_views = vec![0, 1, 2, 3, 4, 99, u32::MAX];
    let got = lift_on_device(&context, &case, 0);
    for (lift, &flag) in got.lifts.iter().zip(&got.flags) {
        let words: &[f32] = bytemuck::cast_slice(std::slice::from_ref(lift));
        assert!(words[..words.len() - 1].iter().all(|v| v.is_finite()), "{lift:?}");
        assert_eq!(flag == 1, lift.cluster_size > 0);
    }
    let made = got.flags.iter().sum::<u32>();
    assert!(made > 20, "{made}");
}

/// One camera before twelve fields of 40 × 40 pixels, a 2D Gaussian in the middle of each; `depth` says what lies at a pixel
/// of a field, from its middle.
fn fields(unit: f32, depth: impl Fn(usize, i32, i32) -> f32) -> Case {
    let camera = look_at(DVec3::new(0.5, -0.4, -6.0), DVec3::ZERO, 240, 80);
    let field = |x: u32, y: u32| ((x / 40 + 6 * (y / 40)) as usize, x as i32 % 40 - 20, y as i32 % 40 - 20);
    let depths: Vec<f32> = (0..240 * 80).map(|p| field(p % 240, p / 240)).map(|(f, x, y)| depth(f, x, y)).collect();
    let mut plane = vec![0f32; 10 * 12];
    for f in 0..12 {
        let (x, y) = (40 * (f % 6) + 20, 40 * (f / 6) + 20);
        let column = [x as f32 + 0.4, y as f32 + 0.3, 0.2, 0.5, 0.7, 2.0, 1.1, 0.7, 0.4, depths[y * 240 + x]];
        (0..10).for_each(|p| plane[p * 12 + f] = column[p]);
    }
    Case {
        views: vec![view(&camera, 0)],
        cameras: vec![camera],
        depths,
        pixel_firsts: vec![0],
        plane,
        stride: 12,
        plane_views: vec![0; 12],
        train_views: vec![0],
        unit,
    }
}

#[test]
fn degenerate_footprints_are_lifted_as_the_twin_lifts_them() {
    let context = context();
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
        5 => on(x * x + y * y >= 4),            // no depth under the centre
        6 => of(x < 1, 5.0, 9.0),               // a step beside the centre
        7 => 5.0 + step * (x + 20) as f32,      // a stair whose steps single linkage must join
        8 => of((x + y) % 2 == 0, 5.0, 8.0),    // two surfaces, pixel by pixel
        9 => of((x, y) == (0, 0), 3.0, 5.0),    // the heaviest pixel alone before the rest
        10 => on(x % 4 == 0 && y % 4 == 0),     // a sparse grid
        _ => 5.0,                               // facing the camera: two equal eigenvalues
    };
    let mut case = fields(6.0, depth);
    // A circle, so that the last field's are equal.
    (case.plane[6 * 12 + 11], case.plane[7 * 12 + 11]) = (1.0, 1.0);
    let made = assert_lifts_are_the_twins(&context, &case, false, 4e-6);
    let got = lift_on_device(&context, &case, 0);
    println!("groups {:?} of {:?} points, τ {:?}", got.clusters.sizes, got.counts, got.clusters.taus);
    let sizes = &got.clusters.sizes;
    assert_eq!((sizes[0], sizes[1], sizes[2]), (0, 0, 3));
    assert!(made == 10 && got.counts[0] == 1 && got.counts[1] == 2);
    // Rows and diagonals have no width: their two lesser axes are at the floor.
    for f in [2, 3, 4] {
        let [_, b, c] = got.lifts[f].log_scale;
        assert!((b - c).abs() < 1e-3, "{f}");
    }
    assert!(got.lifts[6].mean[2] < 0.0 && sizes[6] < got.counts[6], "the nearer side of the step");
    assert_eq!(sizes[7], got.counts[7], "the chain is one");
    // The two surfaces are joined or not as a whole; the lone pixel in front has fewer than three.
    assert!(sizes[8] < got.counts[8] && sizes[9] == got.counts[9] - 1, "{sizes:?}");

    // Q near zero: no length of its own, points in one place, so that all eigenvalues are the floor's 0.
    let nothing = fields(0.0, |f, x, y| if f < 6 { on(y == 0 && x >= 0 && x < f as i32) } else { 5.0 });
    let got = lift_on_device(&context, &nothing, 0);
    for lift in &got.lifts {
        let words: &[f32] = bytemuck::cast_slice(std::slice::from_ref(lift));
        assert!(words[..words.len() - 1].iter().all(|v| v.is_finite()), "{lift:?}");
    }
    assert!(got.flags[..3].iter().all(|&f| f == 0), "{:?}", got.flags);
}

/// Five lifts into room for three, and points into sets that are said to be smaller by one than they are.
#[test]
fn what_does_not_fit_is_not_written() {
    let context = context();
    let lift = types::Lift { mean: [1.0; 3], quat: [1.0; 4], opacity: 1.0, cluster_size: 3, ..Default::default() };
    let append = LiftAppend::new(&context, &lift_append::Spec { workgroup_size: 64 }).unwrap();
    for (stride, lobe_stride) in [(GAUSSIAN_FIRST + 3, LOBE_FIRST + 20), (GAUSSIAN_FIRST + 20, LOBE_FIRST + 3)] {
        let nines = |planes: u32, stride: u32| buffer(&context, "parameters", &vec![9f32; (planes * stride) as usize]);
        let (geometry, sh, lobes) = (nines(11, stride), nines(3, stride), nines(5, lobe_stride));
        let mut recorder = context.recorder("append").unwrap();
        append.record(
            &mut recorder,
            &lift_append::Buffers {
                lifts: &buffer(&context, "lifts", &[lift; 5]),
                lift_ranks: &buffer(&context, "lift_ranks", &[0, 1, 2, 3, 4]),
                geometry: &geometry,
                sh: &sh,
                lobes: &lobes,
            },
            &lift_append::Push {
                count: 5,
                gaussian_first: GAUSSIAN_FIRST,
                lobe_first: LOBE_FIRST,
                stride,
                lobe_stride,
                sh_coefficients: 1,
            },
        );
        recorder.submit().unwrap().wait().unwrap();
        for (all, first, stride) in
            [(geometry, GAUSSIAN_FIRST, stride), (sh, GAUSSIAN_FIRST, stride), (lobes, LOBE_FIRST, lobe_stride)]
        {
            for (at, &x) in all.download().unwrap().iter().enumerate() {
                let place = at as u32 % stride;
                assert_eq!(x != 9.0, (first..first + 3).contains(&place), "place {place} of a plane of {stride}: {x}");
            }
        }
    }

    let case = Case::new(11, 60, DVec3::ZERO);
    let counts = lift_on_device(&context, &case, 0).counts;
    let (n, total) = (counts.len(), counts.iter().sum::<u32>() as usize);
    let fewer: Vec<u32> = counts.iter().map(|&n| n.saturating_sub(1)).collect();
    let firsts = exclusive_scan(&counts);
    let points = room::<[f32; 4]>(&context, "points", total);
    let mut recorder = context.recorder("points").unwrap();
    LiftPointsStage::new(&context, &lift_points::Spec { workgroup_size: 64 }).unwrap().record(
        &mut recorder,
        &lift_points::Buffers {
            plane: &buffer(&context, "plane", &case.plane),
            plane_views: &buffer(&context, "plane_views", &case.plane_views),
            views: &buffer(&context, "views", &case.views),
            depths: &buffer(&context, "depths", &case.depths),
            point_counts: &buffer(&context, "point_counts", &fewer),
            point_firsts: &buffer(&context, "point_firsts", &firsts),
            points: &points,
            heaviest: &room(&context, "heaviest", n),
            taus: &room(&context, "taus", n),
            point_sets: &room(&context, "point_sets", total),
            labels: &room(&context, "labels", total),
        },
        &lift_points::Push { count: n as u32, stride: case.stride as u32, view_count: case.views.len() as u32 },
    );
    recorder.submit().unwrap().wait().unwrap();
    let points = points.download().unwrap();
    for (&first, &n) in firsts.iter().zip(&counts).filter(|(_, n)| **n > 1) {
        let set = &points[first as usize..][..n as usize];
        assert!(set[..n as usize - 1].iter().all(|p| p[3] > 0.0) && set[n as usize - 1] == [0.0; 4]);
    }
}
