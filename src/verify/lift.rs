//! Inverse splatting, from footprints to appended Gaussians.

use glam::{DMat3, DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Bench, judge::Work};
use crate::{
    error::Result,
    gpu::{Buffer, Recorder},
    pipelines::{raster::WORKGROUP, views::view},
    reference::{
        NONE,
        lift_append::{ParameterPlanes, lift_append},
        lift_cluster::lift_cluster,
        lift_count::{ScreenGaussians, lift_count},
        lift_groups::{LiftClusters, TAU_GROWTH},
        lift_pca::{Lift, lift_pca},
        lift_points::{LiftPoints as Points, lift_points},
    },
    scene::Camera,
    stages::{
        lift_append::{self as append_stage, LiftAppend},
        lift_cluster::{self as cluster_stage, LiftCluster},
        lift_count::{self as count_stage, LiftCount},
        lift_pca::{self as pca_stage, LiftPca},
        lift_points::{self as points_stage, LiftPoints},
        types,
    },
};

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    let case = Case::new(21, if quick { 200 } else { 2500 }, DVec3::ZERO);
    for (fail_on_smallest, plain_weights) in [(false, false), (true, true)] {
        lift(bench, &case, fail_on_smallest, plain_weights)?;
    }
    Ok(())
}

/// Cameras around a ball before a wall; 2D Gaussians everywhere, some at the ball's edge, some in holes of the depth map,
/// some beyond the image's border, some slots empty.
pub struct Case {
    pub cameras: Vec<Camera>,
    pub views: Vec<types::View>,
    pub depths: Vec<f32>,
    /// Where each view's depths begin.
    pub pixel_firsts: Vec<usize>,
    /// 10 planes × `stride`.
    pub plane: Vec<f32>,
    pub stride: usize,
    pub screen_frames: Vec<u32>,
    pub train_views: Vec<u32>,
    /// The scene's own length.
    pub unit: f32,
}

/// All numbers rounded to float32, so that device and twin see the same camera.
pub fn look_at(eye: DVec3, target: DVec3, width: u32, height: u32) -> Camera {
    let single = |v: f64| f64::from(v as f32);
    let z = (target - eye).normalize();
    let x = DVec3::Y.cross(z).normalize();
    let rotation = DMat3::from_cols(x, z.cross(x), z).transpose();
    let rotation = DMat3::from_cols_array(&rotation.to_cols_array().map(single));
    let translation = DVec3::from((-(rotation * eye)).to_array().map(single));
    let f = single(width as f64 * 1.1);
    let (cx, cy) = (width as f64 / 2.0, height as f64 / 2.0);
    Camera { width, height, fx: f, fy: f, cx, cy, rotation, translation }
}

impl Case {
    pub fn new(seed: u64, count: usize, centre: DVec3) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let cameras: Vec<_> = (0..5)
            .map(|i| {
                let angle = 0.25 * i as f64 - 0.5;
                let eye = centre + DVec3::new(6.0 * angle.sin(), -0.7, -6.0 * angle.cos());
                look_at(eye, centre, 120 + 16 * i, 96)
            })
            .collect();
        let mut depths = Vec::new();
        let mut pixel_firsts = Vec::new();
        for camera in &cameras {
            pixel_firsts.push(depths.len());
            let eye = camera.eye() - centre;
            for y in 0..camera.height {
                for x in 0..camera.width {
                    let ray = camera.unproject(x as f64 + 0.5, y as f64 + 0.5, 1.0) - camera.eye();
                    // Ball of radius 1.5 at the centre, wall 4 behind it.
                    let (a, b, c) = (ray.length_squared(), eye.dot(ray), eye.length_squared() - 2.25);
                    let hit = b * b - a * c;
                    let z = if hit > 0.0 { (-b - hit.sqrt()) / a } else { (4.0 - eye.z) / ray.z };
                    let hole = (x / 8 + y / 8).is_multiple_of(9);
                    depths.push(if hole || z <= 0.0 { 0.0 } else { z as f32 });
                }
            }
        }
        let mut plane = vec![0f32; 10 * count];
        let mut screen_frames = Vec::new();
        for i in 0..count {
            let v = rng.random_range(0..cameras.len());
            let camera = &cameras[v];
            let x = rng.random_range(-3.0..camera.width as f32 + 3.0);
            let y = rng.random_range(-3.0..camera.height as f32 + 3.0);
            let inside = x >= 0.0 && y >= 0.0 && x < camera.width as f32 && y < camera.height as f32;
            let at = pixel_firsts[v] + y as usize * camera.width as usize + x as usize;
            let mut column = vec![x, y];
            column.extend((2..5).map(|_| rng.random_range(0.0..1.0f32)));
            column.push(rng.random_range(-4.0..5.0));
            column.extend([rng.random_range(-1.0..2.3), rng.random_range(-1.0..2.3), rng.random_range(-4.0..4.0)]);
            column.push(if inside { depths[at] } else { 0.0 });
            for (p, value) in column.into_iter().enumerate() {
                plane[p * count + i] = value;
            }
            screen_frames.push(if i % 13 == 5 { NONE } else { v as u32 });
        }
        Case {
            views: cameras.iter().zip(&pixel_firsts).map(|(c, &first)| view(c, first as u32)).collect(),
            cameras,
            depths,
            pixel_firsts,
            plane,
            stride: count,
            screen_frames,
            train_views: vec![0, 2, 3, 4],
            unit: 6.0,
        }
    }

    /// What the twins read: the case, with `plane` and `depths` in float64.
    pub fn gaussians<'a>(&'a self, plane: &'a [f64], depths: &'a [f64]) -> ScreenGaussians<'a> {
        ScreenGaussians {
            plane,
            stride: self.stride,
            screen_frames: &self.screen_frames,
            views: &self.cameras,
            pixel_firsts: &self.pixel_firsts,
            depths,
        }
    }
}

fn exclusive_scan(counts: &[u32]) -> Vec<u32> {
    counts.iter().scan(0, |at, n| Some(std::mem::replace(at, *at + n))).collect()
}

fn wide(values: &[f32]) -> Vec<f64> {
    values.iter().map(|&v| f64::from(v)).collect()
}

/// R diag(s²) Rᵀ by columns.
pub fn covariance(quat: [f64; 4], log_scale: [f64; 3]) -> [f64; 9] {
    let [w, x, y, z] = quat;
    let r = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
    let scaled = r * DMat3::from_diagonal(DVec3::from(log_scale.map(|l| (2.0 * l).exp())));
    (scaled * r.transpose()).to_cols_array()
}

fn lift(bench: &mut Bench<'_>, case: &Case, fail_on_smallest: bool, plain_weights: bool) -> Result<()> {
    let context = bench.context;
    let count = case.screen_frames.len();
    let (n, workgroup_size) = (count as u32, WORKGROUP);
    let (stride, view_count) = (case.stride as u32, case.views.len() as u32);
    let plane = Buffer::from_slice(context, "plane", &case.plane)?;
    let screen_frames = Buffer::from_slice(context, "plane views", &case.screen_frames)?;
    let views = Buffer::from_slice(context, "views", &case.views)?;
    let depths = Buffer::from_slice(context, "depths", &case.depths)?;
    let train_views = Buffer::from_slice(context, "train views", &case.train_views)?;
    let words = |name: &str, len: usize| Buffer::<u32>::zeroed(context, name, len);
    let (plane64, depths64) = (wide(&case.plane), wide(&case.depths));
    let g = case.gaussians(&plane64, &depths64);
    let chosen = !fail_on_smallest && !plain_weights;

    // Footprints: the pixels of their boxes are tested.
    let boxes: f64 = (0..g.len()).filter_map(|i| g.footprint(i)).map(|f| f64::from(f.size[0] * f.size[1])).sum();
    let point_counts = words("point counts", count)?;
    let stage = LiftCount::new(context, &count_stage::Spec { workgroup_size })?;
    let times = bench.time(|recorder| {
        let buffers = count_stage::Buffers {
            plane: &plane,
            screen_frames: &screen_frames,
            views: &views,
            depths: &depths,
            point_counts: &point_counts,
        };
        stage.record(recorder, &buffers, &count_stage::Push { count: n, stride, view_count });
    })?;
    let counts = point_counts.download()?;
    let firsts = exclusive_scan(&counts);
    let total: u64 = counts.iter().map(|&c| u64::from(c)).sum();
    let shifted: Vec<f64> =
        plane64.iter().enumerate().map(|(k, v)| if k / count == 5 { v + bench.shift() } else { *v }).collect();
    let want_counts = lift_count(&case.gaussians(&shifted, &depths64));
    let mut row = bench.row("lift_count", "");
    row.time = times.of("lift_count");
    row.work = Work { bytes: 4.0 * (11.0 * count as f64 + case.depths.len() as f64), operations: 9.0 * boxes };
    let mut flips = 0;
    for i in 0..count {
        let off = counts[i].abs_diff(want_counts[i]);
        flips += off as usize;
        // α in float32 errs by the absolute error of the exponent, at most 5.5 and a few roundings, and by exp's own: 1e-5 is
        // ample.
        let unsure = g
            .footprint(i)
            .map_or(0, |f| f.pixels().filter(|&(x, y)| (f.response(x, y) * 255.0 - 1.0).abs() < 1e-5).count());
        row.unequal(u64::from(off as usize > unsure));
    }
    row.flips(flips, total as usize);
    let lost = total > boxes as u64;
    if chosen || lost {
        bench.push(row);
    }
    if lost {
        // More points than pixels: no buffers are made for those.
        return Ok(());
    }
    let points_len = total as usize;

    let point_firsts = Buffer::from_slice(context, "point firsts", &firsts)?;
    let points = Buffer::<[f32; 4]>::zeroed(context, "points", points_len)?;
    let (heaviest, prime_labels) = (words("heaviest", count)?, words("prime labels", count)?);
    let (labels, point_sets) = (words("labels", points_len)?, words("point sets", points_len)?);
    let (group_sizes, cluster_sizes) = (words("group sizes", points_len)?, words("cluster sizes", count)?);
    let (taus, start_taus) =
        (Buffer::<f32>::zeroed(context, "taus", count)?, Buffer::<f32>::zeroed(context, "start taus", count)?);
    let lifts = Buffer::<types::Lift>::zeroed(context, "lifts", count)?;
    let lift_flags = words("lift flags", count)?;
    let rounds = words("rounds", cluster_stage::ROUNDS_LEN)?;
    let points_of = LiftPoints::new(context, &points_stage::Spec { workgroup_size })?;
    let cluster = LiftCluster::new(context, workgroup_size, fail_on_smallest)?;
    let pca = LiftPca::new(context, &pca_stage::Spec { workgroup_size, plain_weights: u32::from(plain_weights) })?;
    let record = |recorder: &mut Recorder| {
        points_of.record(
            recorder,
            &points_stage::Buffers {
                plane: &plane,
                screen_frames: &screen_frames,
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
            &points_stage::Push { count: n, stride, view_count },
        );
        recorder.copy(&taus, 0, &start_taus, 0, count);
        cluster.record(
            recorder,
            &cluster_stage::Buffers {
                points: &points,
                point_sets: &point_sets,
                labels: &labels,
                group_sizes: &group_sizes,
                point_counts: &point_counts,
                point_firsts: &point_firsts,
                heaviest: &heaviest,
                taus: &taus,
                prime_labels: &prime_labels,
                cluster_sizes: &cluster_sizes,
                rounds: &rounds,
            },
            n,
            points_len as u32,
        );
        pca.record(
            recorder,
            &pca_stage::Buffers {
                plane: &plane,
                screen_frames: &screen_frames,
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
            &pca_stage::Push {
                count: n,
                stride,
                view_count,
                train_count: case.train_views.len() as u32,
                unit: case.unit,
            },
        );
    };
    let times = bench.time(record)?;

    // Points, of the Gaussians whose pixels are the twin's.
    let got_points = points.download()?;
    let got_heaviest = heaviest.download()?;
    let got_starts = start_taus.download()?;
    let want = lift_points(&g);
    let mut row = bench.row("lift_points", "");
    let same: Vec<usize> = (0..count).filter(|&i| counts[i] == want.counts[i]).collect();
    for coordinates in [0..3, 3..4] {
        let (got_points, firsts, want) = (&got_points, &firsts, &want);
        row.numbers(same.iter().flat_map(|&i| {
            let coordinates = coordinates.clone();
            let set = want.set(i).iter().enumerate();
            set.flat_map(move |(k, p)| coordinates.clone().map(move |c| (got_points[firsts[i] as usize + k][c], p[c])))
        }));
    }
    let agreed: Vec<usize> = same.iter().copied().filter(|&i| got_heaviest[i] == want.heaviest[i]).collect();
    row.numbers(agreed.iter().map(|&i| (got_starts[i], want.start_taus[i])));
    let set = |i: usize| &got_points[firsts[i] as usize..][..counts[i] as usize];
    for (i, &heaviest) in got_heaviest.iter().enumerate() {
        // The heaviest is the first of the device's own greatest weights.
        let top = set(i).iter().map(|p| p[3]).fold(0.0, f32::max);
        row.unequal(u64::from(set(i).iter().position(|p| p[3] == top).unwrap_or(0) as u32 != heaviest));
    }
    row.flips(same.len() - agreed.len(), same.len());
    row.time = times.of("lift_points");
    row.work = Work {
        bytes: 4.0 * (11.0 * count as f64 + case.depths.len() as f64) + 24.0 * points_len as f64,
        operations: 9.0 * boxes,
    };
    if chosen {
        bench.push(row);
    }

    // Clustering of the device's own points, so that a pixel at the edge of 1/255 does not matter.
    let own = Points {
        counts: counts.clone(),
        firsts: firsts.clone(),
        points: got_points.iter().map(|p| p.map(f64::from)).collect(),
        heaviest: got_heaviest,
        start_taus: wide(&got_starts),
    };
    let twin = lift_cluster(&own.points, &own.counts, &own.firsts, &own.heaviest, &own.start_taus, fail_on_smallest);
    let got = LiftClusters {
        labels: labels.download()?,
        taus: wide(&taus.download()?),
        prime_labels: prime_labels.download()?,
        cluster_sizes: cluster_sizes.download()?,
    };
    let rule = if fail_on_smallest { "failure by the smallest group" } else { "failure by the largest group" };
    let mut agrees = vec![true; count];
    let (mut flips, mut wrong) = (0, 0);
    for i in 0..count {
        let range = firsts[i] as usize..(firsts[i] + counts[i]) as usize;
        agrees[i] = got.labels[range.clone()] == twin.labels[range.clone()]
            && got.cluster_sizes[i] == twin.cluster_sizes[i]
            && (got.cluster_sizes[i] == 0 || got.prime_labels[i] == twin.prime_labels[i]);
        if !agrees[i] {
            flips += 1;
            wrong += u64::from(!is_tie(own.set(i), own.start_taus[i], twin.taus[i].max(got.taus[i])));
        }
    }
    for name in ["lift_join", "lift_groups"] {
        let mut row = bench.row(name, format!("{rule}, all rounds"));
        row.chosen = !fail_on_smallest;
        row.flips(flips, count);
        row.unequal(wrong);
        row.numbers((0..count).filter(|&i| agrees[i]).map(|i| (got.taus[i] as f32, twin.taus[i])));
        row.time = times.all(name);
        row.work.bytes = if name == "lift_join" { 24.0 } else { 8.0 } * points_len as f64 + 16.0 * count as f64;
        bench.push(row);
    }

    let (got_lifts, got_flags) = (lifts.download()?, lift_flags.download()?);
    let want = lift_pca(&g, &own, &got, &case.train_views, f64::from(case.unit), plain_weights);
    let mut row = bench.row("lift_pca", if plain_weights { "weights w" } else { "weights w²" });
    row.chosen = !plain_weights;
    row.words(&got_flags, &want.iter().map(|l| u32::from(l.cluster_size > 0)).collect::<Vec<_>>());
    row.words(
        &got_lifts.iter().map(|l| l.cluster_size).collect::<Vec<_>>(),
        &want.iter().map(|l| l.cluster_size).collect::<Vec<_>>(),
    );
    let made: Vec<(&types::Lift, &Lift)> =
        got_lifts.iter().zip(&want).filter(|(a, b)| a.cluster_size > 0 && b.cluster_size > 0).collect();
    type Field = (fn(&types::Lift) -> Vec<f32>, fn(&Lift) -> Vec<f64>);
    let fields: [Field; 6] = [
        (|l| l.mean.to_vec(), |l| l.mean.to_vec()),
        (|l| l.dc.to_vec(), |l| l.dc.to_vec()),
        (|l| vec![l.opacity], |l| vec![l.opacity]),
        (|l| l.lobe_dir.to_vec(), |l| l.lobe_dir.to_vec()),
        (|l| vec![l.theta_bar], |l| vec![l.theta_bar]),
        (|l| vec![l.lobe_width], |l| vec![l.lobe_width]),
    ];
    for (got, want) in fields {
        row.numbers(made.iter().flat_map(|(a, b)| got(a).into_iter().zip(want(b)).collect::<Vec<_>>()));
    }
    // Shapes relative to their largest axis: the smaller an axis the less sure it is, relative to itself.
    row.numbers(made.iter().flat_map(|(a, b)| {
        let (a, b) = (covariance(a.quat.map(f64::from), a.log_scale.map(f64::from)), covariance(b.quat, b.log_scale));
        let largest = b.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        (0..9).map(move |k| ((a[k] / largest) as f32, b[k] / largest))
    }));
    row.time = times.of("lift_pca");
    row.work.bytes = 20.0 * points_len as f64 + count as f64 * (60.0 + size_of::<types::Lift>() as f64);
    bench.push(row);
    if chosen { append(bench, &got_lifts, &got_flags) } else { Ok(()) }
}

/// Whether two points of a set are as far apart as some τ that clustering tries, within float32's error of a squared distance.
fn is_tie(set: &[[f64; 4]], start: f64, last: f64) -> bool {
    let mut tau = start;
    while tau <= 1.01 * last {
        for (k, a) in set.iter().enumerate() {
            for b in &set[..k] {
                let distance = (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt();
                if (distance / tau - 1.0).abs() < 1e-5 {
                    return true;
                }
            }
        }
        tau *= TAU_GROWTH;
    }
    false
}

/// The device's lifts: every word where the twin puts it, the others untouched.
fn append(bench: &mut Bench<'_>, lifts: &[types::Lift], flags: &[u32]) -> Result<()> {
    const GAUSSIAN_FIRST: u32 = 7;
    const LOBE_FIRST: u32 = 2;
    const SH_COEFFICIENTS: u32 = 4;
    let context = bench.context;
    let capacity = GAUSSIAN_FIRST + flags.iter().sum::<u32>() + 3;
    let nines = |planes: u32| vec![9f32; (planes * capacity) as usize];
    let upload = |planes: u32| Buffer::from_slice(context, "parameters", &nines(planes));
    let (geometry, sh, lobes) = (upload(11)?, upload(3 * SH_COEFFICIENTS)?, upload(5)?);
    let lifts_there = Buffer::from_slice(context, "lifts", lifts)?;
    let lift_ranks = Buffer::from_slice(context, "lift ranks", &exclusive_scan(flags))?;
    let stage = LiftAppend::new(context, &append_stage::Spec { workgroup_size: WORKGROUP })?;
    let times = bench.time(|recorder| {
        let buffers = append_stage::Buffers {
            lifts: &lifts_there,
            lift_ranks: &lift_ranks,
            geometry: &geometry,
            sh: &sh,
            lobes: &lobes,
        };
        let push = append_stage::Push {
            count: lifts.len() as u32,
            gaussian_first: GAUSSIAN_FIRST,
            lobe_first: LOBE_FIRST,
            stride: capacity,
            lobe_stride: capacity,
            sh_coefficients: SH_COEFFICIENTS,
        };
        stage.record(recorder, &buffers, &push);
    })?;
    let wide_lifts: Vec<Lift> = lifts
        .iter()
        .map(|l| Lift {
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
    let [mut g, mut s, mut l] = [11, 3 * SH_COEFFICIENTS, 5].map(|planes| wide(&nines(planes)));
    let mut planes = ParameterPlanes {
        geometry: &mut g,
        sh: &mut s,
        lobes: &mut l,
        stride: capacity as usize,
        lobe_stride: capacity as usize,
        sh_coefficients: SH_COEFFICIENTS as usize,
    };
    let made = lift_append(&wide_lifts, GAUSSIAN_FIRST as usize, LOBE_FIRST as usize, &mut planes) as f64;
    let mut row = bench.row("lift_append", "");
    for (got, want) in [(&geometry, &g), (&sh, &s), (&lobes, &l)] {
        row.words(&wide(&got.download()?), want);
    }
    row.time = times.of("lift_append");
    row.work.bytes = lifts.len() as f64 * 8.0 + made * (size_of::<types::Lift>() as f64 + 4.0 * (11.0 + 12.0 + 5.0));
    bench.push(row);
    Ok(())
}
