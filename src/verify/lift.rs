//! Verifies inverse splatting, from footprints to appended Gaussians.

use glam::{DMat3, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Bench;
use crate::{
    error::Result,
    gpu::{Buffer, Context},
    pipelines::{
        lift::{Flat, LiftBuffers, LiftOptions, LiftPhase, LiftSizes, PointBuffers},
        model::Model,
        views::view,
    },
    reference::{NONE, random_scene},
    scene::Camera,
    stages::{status, types},
};

pub(super) fn cases(bench: &Bench<'_>, quick: bool) -> Result<()> {
    let case = Case::new(21, if quick { 200 } else { 2500 }, DVec3::ZERO);
    for options in [LiftOptions::default(), LiftOptions { fail_on_smallest: true, plain_weights: true }] {
        lift(bench, &case, options)?;
    }
    Ok(())
}

/// Cameras around a ball in front of a wall. 2D Gaussians are everywhere: some at the ball's edge, some in
/// holes of the depth map, some beyond the image's border; some places are empty.
pub struct Case {
    /// Cameras by view.
    pub cameras: Vec<Camera>,
    /// The cameras in the kernels' format.
    pub views: Vec<types::View>,
    /// Camera z by pixel, view after view; 0: none.
    pub depths: Vec<f32>,
    /// Start of each view's depths.
    pub pixel_firsts: Vec<usize>,
    /// 10 planes × `stride`.
    pub screen_planes: Vec<f32>,
    /// View of each place, [`NONE`] if it is empty.
    pub screen_frames: Vec<u32>,
    /// Training views, candidates for the nearest one.
    pub train_views: Vec<u32>,
    /// The scene's length unit.
    pub unit: f32,
}

/// A camera at `eye`; all its numbers are rounded to float32, so that device and twin see the same camera.
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
                    // A ball of radius 1.5 at the centre, a wall 4 behind it.
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
}

/// A case on the device.
pub struct There {
    screen_planes: Buffer<f32>,
    screen_frames: Buffer<u32>,
    depths: Buffer<f32>,
    /// Buffers by place of a 2D Gaussian.
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

    /// The 2D Gaussians as input of the lift's stages.
    pub fn flat(&self) -> Flat<'_> {
        let There { screen_planes, screen_frames, depths, .. } = self;
        let count = screen_frames.len() as u32;
        Flat { screen_planes, stride: count, screen_frames, depths, count }
    }
}

fn lift(bench: &Bench<'_>, case: &Case, options: LiftOptions) -> Result<()> {
    let context = &bench.shadowed;
    let count = case.screen_frames.len() as u32;
    let there = There::new(context, case)?;
    let (flat, b) = (there.flat(), &there.lift);
    let phase = LiftPhase::new(context, options)?;
    bench.run(|recorder| phase.record_count(recorder, &flat, b))?;
    let points: u64 = b.point_counts.download()?.iter().map(|&n| u64::from(n)).sum();
    if points > u64::from(count) * case.depths.len() as u64 {
        // More points than pixels cannot be right: the row is broken already, so make no buffers.
        return Ok(());
    }
    let points = points as u32;
    let p = PointBuffers::new(context, &points)?;
    bench.run(|recorder| {
        phase.record_points(recorder, &flat, b, &p);
        phase.record_clusters(recorder, count, points, b, &p);
        phase.record_pca(recorder, &flat, case.unit, b, &p);
    })?;
    // Append after an existing supplement, also with too little room.
    let made = b.lift_flags.download()?.iter().sum::<u32>() as usize;
    let scene = random_scene(5, 20, 7, 1);
    for spare in [made, made / 2] {
        let model = Model::upload(context, &scene, spare)?;
        let status = Buffer::<u32>::zeroed(context, "status", status::WORDS)?;
        bench.run(|recorder| phase.record_append(recorder, count, b, &model, &status))?;
    }
    Ok(())
}
