//! Inverse splatting, from footprints to appended Gaussians.

use glam::{DMat3, DQuat, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    Bench,
    judge::{Row, Work},
};
use crate::{
    error::Result,
    gpu::{Buffer, Context},
    pipelines::{
        lift::{Flat, LiftBuffers, LiftOptions, LiftPhase, LiftSizes, PointBuffers},
        model::{Model, Segment},
        views::view,
    },
    reference::{
        NONE, Params,
        lift_append::lift_append,
        lift_cluster::lift_cluster,
        lift_count::{ScreenGaussians, lift_count},
        lift_groups::{LiftClusters, TAU_GROWTH},
        lift_pca::{Lift, lift_pca},
        lift_points::{LiftPoints, lift_points},
        random_scene,
    },
    scene::Camera,
    stages::{
        status::{self, Resource, Status},
        types,
    },
};

pub(super) fn cases(bench: &mut Bench<'_>, quick: bool) -> Result<()> {
    let case = Case::new(21, if quick { 200 } else { 2500 }, DVec3::ZERO);
    for options in [LiftOptions::default(), LiftOptions { fail_on_smallest: true, plain_weights: true }] {
        lift(bench, &case, options)?;
    }
    Ok(())
}

/// Cameras around a ball before a wall; 2D Gaussians everywhere, some at the ball's edge, some in holes of the depth map,
/// some beyond the image's border, some places empty.
pub struct Case {
    /// By view.
    pub cameras: Vec<Camera>,
    /// The same as kernels are given them.
    pub views: Vec<types::View>,
    /// Camera z by pixel, view after view; 0: none.
    pub depths: Vec<f32>,
    /// Where each view's depths begin.
    pub pixel_firsts: Vec<usize>,
    /// 10 planes × `stride`.
    pub screen_planes: Vec<f32>,
    /// View of each place, [`NONE`] where it is empty.
    pub screen_frames: Vec<u32>,
    /// Those among which the nearest is looked for.
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
    /// `count` places, around a ball at `centre`.
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
        let mut screen_planes = vec![0f32; 10 * count];
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
                screen_planes[p * count + i] = value;
            }
            screen_frames.push(if i % 13 == 5 { NONE } else { v as u32 });
        }
        Case {
            views: cameras.iter().zip(&pixel_firsts).map(|(c, &first)| view(c, first as u32)).collect(),
            cameras,
            depths,
            pixel_firsts,
            screen_planes,
            screen_frames,
            train_views: vec![0, 2, 3, 4],
            unit: 6.0,
        }
    }

    /// What the twins read: the case, with planes and depths in float64.
    pub fn gaussians<'a>(&'a self, screen_planes: &'a [f64], depths: &'a [f64]) -> ScreenGaussians<'a> {
        ScreenGaussians {
            screen_planes,
            stride: self.screen_frames.len(),
            screen_frames: &self.screen_frames,
            views: &self.cameras,
            pixel_firsts: &self.pixel_firsts,
            depths,
        }
    }
}

/// A case on the device.
pub struct There {
    screen_planes: Buffer<f32>,
    screen_frames: Buffer<u32>,
    depths: Buffer<f32>,
    /// By place of a 2D Gaussian.
    pub lift: LiftBuffers,
}

impl There {
    /// Uploads a case.
    pub fn new(context: &Context, case: &Case) -> Result<Self> {
        let places = case.screen_frames.len() as u32;
        let (views, train_views) = (case.views.len() as u32, case.train_views.len() as u32);
        let lift = LiftBuffers::new(context, &LiftSizes { places, views, train_views })?;
        lift.views.upload(0, &case.views)?;
        lift.train_views.upload(0, &case.train_views)?;
        lift.counts.upload(0, &[places, 0, 0])?;
        Ok(There {
            screen_planes: Buffer::from_slice(context, "screen planes", &case.screen_planes)?,
            screen_frames: Buffer::from_slice(context, "screen frames", &case.screen_frames)?,
            depths: Buffer::from_slice(context, "depths", &case.depths)?,
            lift,
        })
    }

    /// The 2D Gaussians as the lift's stages take them.
    pub fn flat(&self) -> Flat<'_> {
        let There { screen_planes, screen_frames, depths, .. } = self;
        let count = screen_frames.len() as u32;
        Flat { screen_planes, stride: count, screen_frames, depths, count }
    }
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

/// The rows of a case of one's own.
pub fn judge(context: &Context, case: &Case, options: LiftOptions) -> Result<Vec<Row>> {
    let mut bench = Bench::new(context, 0.0, 0);
    lift(&mut bench, case, options)?;
    bench.rows.iter_mut().for_each(Row::judge);
    Ok(bench.rows)
}

fn lift(bench: &mut Bench<'_>, case: &Case, options: LiftOptions) -> Result<()> {
    let context = bench.context;
    let count = case.screen_frames.len();
    let there = There::new(context, case)?;
    let (flat, b) = (there.flat(), &there.lift);
    let phase = LiftPhase::new(context, options)?;
    let (planes64, depths64) = (wide(&case.screen_planes), wide(&case.depths));
    let g = case.gaussians(&planes64, &depths64);
    let LiftOptions { fail_on_smallest, plain_weights } = options;
    let chosen = options == LiftOptions::default();

    // Footprints: the pixels of their boxes are tested.
    let boxes: f64 = (0..g.len()).filter_map(|i| g.footprint(i)).map(|f| f64::from(f.size[0] * f.size[1])).sum();
    let times = bench.time(|recorder| phase.record_count(recorder, &flat, b))?;
    let (counts, firsts) = (b.point_counts.download()?, b.point_firsts.download()?);
    let total: u64 = counts.iter().map(|&c| u64::from(c)).sum();
    let shifted: Vec<f64> =
        planes64.iter().enumerate().map(|(k, v)| if k / count == 5 { v + bench.shift() } else { *v }).collect();
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

    // Clustering moves τ and labels: what it begins with is read before.
    let p = PointBuffers::new(context, &(points_len as u32))?;
    let mut recorder = context.recorder("points")?;
    phase.record_points(&mut recorder, &flat, b, &p);
    recorder.submit()?.wait()?;
    let got_starts = b.taus.download()?;
    let times = bench.time(|recorder| {
        phase.record_points(recorder, &flat, b, &p);
        phase.record_clusters(recorder, count as u32, points_len as u32, b, &p);
        phase.record_pca(recorder, &flat, case.unit, b, &p);
    })?;

    // Points, of the Gaussians whose pixels are the twin's.
    let (got_points, got_heaviest) = (p.points.download()?, b.heaviest.download()?);
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
    let own = LiftPoints {
        counts: counts.clone(),
        firsts: firsts.clone(),
        points: got_points.iter().map(|p| p.map(f64::from)).collect(),
        heaviest: got_heaviest,
        start_taus: wide(&got_starts),
    };
    let twin = lift_cluster(&own.points, &own.counts, &own.firsts, &own.heaviest, &own.start_taus, fail_on_smallest);
    let got = LiftClusters {
        labels: p.labels.download()?,
        taus: wide(&b.taus.download()?),
        prime_labels: b.prime_labels.download()?,
        cluster_sizes: b.cluster_sizes.download()?,
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

    let (got_lifts, got_flags) = (b.lifts.download()?, b.lift_flags.download()?);
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
    // Positions as seen from a camera: a scene may lie anywhere.
    let eye = case.cameras[0].eye();
    row.numbers(
        made.iter()
            .flat_map(|(a, b)| (0..3).map(move |c| ((f64::from(a.mean[c]) - eye[c]) as f32, b.mean[c] - eye[c]))),
    );
    type Field = (fn(&types::Lift) -> Vec<f32>, fn(&Lift) -> Vec<f64>);
    let fields: [Field; 5] = [
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
    if chosen { append(bench, &phase, b, &got_lifts) } else { Ok(()) }
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

/// The device's lifts behind a supplement: every word where the twin puts it, also where some have no room.
fn append(bench: &mut Bench<'_>, phase: &LiftPhase, b: &LiftBuffers, lifts: &[types::Lift]) -> Result<()> {
    let (context, count) = (bench.context, lifts.len() as u32);
    let lifts: Vec<Lift> = lifts.iter().map(Lift::from).collect();
    let made = lifts.iter().filter(|l| l.cluster_size > 0).count();
    let scene = random_scene(5, 20, 7, 1);
    let mut row = bench.row("lift_append", "");
    for spare in [made, made / 2] {
        let mut want = scene.clone();
        let mut told = Status::default();
        let supplement = want.supplement.get_or_insert_default();
        let needed = lift_append(&lifts, 7 + spare, supplement);
        if needed > supplement.gaussians.len() {
            told.fail(Resource::SupplementGaussians, needed as u32);
        }
        let model = Model::upload(context, &scene, spare)?;
        let status = Buffer::<u32>::zeroed(context, "status", status::WORDS)?;
        let mut recorder = context.recorder("append")?;
        phase.record_append(&mut recorder, count, b, &model, &status);
        recorder.submit()?.wait()?;
        row.words(&status.download()?, &told.0);
        let (got, want) = (Params::from_scene(&model.download()?)?, Params::from_scene(&want)?);
        for (got, want) in [(&got.geometry, &want.geometry), (&got.sh, &want.sh), (&got.lobes, &want.lobes)] {
            row.words(got, want);
        }
    }
    // Every run appends again.
    let model = Model::upload(context, &scene, made * (bench.repeats + 1))?;
    let status = Buffer::<u32>::zeroed(context, "status", status::WORDS)?;
    row.time = bench.time(|r| phase.record_append(r, count, b, &model, &status))?.of("lift_append");
    let planes = (model.part(Segment::Supplement).geometry.planes() + 12 + 5) as f64;
    row.work.bytes = lifts.len() as f64 * 8.0 + made as f64 * (size_of::<types::Lift>() as f64 + 4.0 * planes);
    bench.push(row);
    Ok(())
}
