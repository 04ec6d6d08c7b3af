//! Measures the time of a frame in a caller's command buffers, stage by stage, next to the time to copy its
//! bytes.
//!
//!     cargo bench --bench frame -- [SCENE.ply DATASET] [--gaussians N] [--size WxH] [--views N] [--sh-degree L] [--lobes SHARE] [--half]
//!                                  [--json]
//!
//! The camera moves, and several frames are in flight. If the first frame shows all bands, it must equal
//! `Renderer`'s image bit for bit.

#[path = "../tests/common/engine.rs"]
#[allow(dead_code, reason = "a frame needs no images")]
mod engine;
mod size;

use std::{collections::BTreeMap, fs, path::PathBuf, process::ExitCode, time::Instant};

use clap::Parser;
use engine::Engine;
use glam::{DMat3, DVec3};
use glint::{
    Error, Result,
    data::{Dataset, DatasetOptions, read_scene},
    gpu::{Buffer, BufferRange, Context, ContextOptions, Location, Pixels, StageTime},
    pipelines::{
        frames::{Blend, Frame, FrameView, Frames, Instance, Limits, Target, Texel},
        model::{Model, Room},
        render::{Needs, RenderOptions, Renderer},
        views::Views,
    },
    reference::{covering_scene, random_camera},
    report::table::{Cell, Column, Table},
    scene::{Camera, Scene, color, layout::sh_planes},
};
use serde::Serialize;
use serde_json::json;

/// Frames in flight.
const SLOTS: u32 = 3;
/// Distance between two views, scene units.
const APART: f64 = 0.06;
/// Bytes to copy for measuring the device's rate; exceeds every cache.
const COPIED: usize = 64 << 20;

#[derive(Parser)]
#[command(name = "frame", about = "Time of a frame, stage by stage")]
struct Args {
    /// A scene and a dataset with its cameras; without, random Gaussians
    #[arg(num_args = 0..=2, value_names = ["SCENE", "DATASET"])]
    scene: Vec<PathBuf>,
    /// Random Gaussians; the more, the smaller, so that a pixel always has as many
    #[arg(long, default_value_t = 100_000)]
    gaussians: usize,
    /// Share of the random ones that have lobes
    #[arg(long, default_value_t = 0.0)]
    lobes: f64,
    /// Pixels
    #[arg(long, default_value = "1280x720", value_parser = size::size)]
    size: [u32; 2],
    /// Bands of harmonics, at most the scene's; of spherical betas all from 1 on
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=3))]
    sh_degree: u32,
    /// Views of a frame, side by side as eyes are
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    views: u32,
    /// Half width
    #[arg(long)]
    half: bool,
    /// Frames that are timed
    #[arg(long, default_value_t = 60)]
    frames: u32,
    #[arg(long)]
    device: Option<String>,
    #[arg(long)]
    json: bool,
    /// Given by cargo bench
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::from(e.exit_code())
        }
    }
}

fn scene_of(args: &Args) -> Result<(Scene, Camera)> {
    let [width, height] = args.size;
    if let [scene, dataset] = &args.scene[..] {
        let dataset = Dataset::open(dataset, &DatasetOptions::default())?;
        let camera = dataset.photos.first().map(|photo| photo.camera);
        let Some(c) = camera else { return Err(Error::Usage("a dataset without photos".into())) };
        // Keep the field of view at another size.
        let zoom = f64::from(width) / f64::from(c.width);
        let (fx, fy) = (c.fx * zoom, c.fy * zoom);
        let (cx, cy) = (f64::from(width) / 2.0, f64::from(height) / 2.0);
        return Ok((read_scene(scene)?, Camera { width, height, fx, fy, cx, cy, ..c }));
    }
    if !args.scene.is_empty() {
        return Err(Error::Usage("expected a scene and a dataset, or neither".into()));
    }
    Ok((covering_scene(args.gaussians, args.lobes, 1.0, args.sh_degree), random_camera(width, height)))
}

/// CPU seconds of the process, all threads, from Linux's counters; 0 elsewhere.
fn cpu_seconds() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit_once(')').map_or("", |(_, rest)| rest);
    // Fields 14 and 15: user and system time in hundredths of a second.
    after_name.split_whitespace().skip(11).take(2).filter_map(|field| field.parse::<f64>().ok()).sum::<f64>() / 100.0
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

fn copy_rate(context: &Context) -> Result<f64> {
    let from = Buffer::<u32>::zeroed(context, "copied", COPIED / 4)?;
    let to = Buffer::<u32>::new(context, "copy", COPIED / 4, Location::Device)?;
    let mut seconds = Vec::new();
    for _ in 0..5 {
        let mut recorder = context.recorder("copy")?;
        recorder.time_stages();
        recorder.copy(&from, 0, &to, 0, COPIED / 4);
        seconds.extend(recorder.submit()?.wait()?.iter().map(|stage| stage.time.as_secs_f64()));
    }
    Ok(2.0 * COPIED as f64 / median(seconds))
}

/// Camera of view `v` in frame `n`.
fn seen_from(camera: &Camera, n: u32, v: u32) -> Camera {
    let turn = DMat3::from_rotation_y(f64::from(n) * 1e-3);
    let mut translation = turn * camera.translation;
    translation.x -= f64::from(v) * APART;
    Camera { rotation: turn * camera.rotation, translation, ..*camera }
}

/// Times of a stage in a frame, milliseconds.
#[derive(Serialize)]
struct Stage {
    stage: &'static str,
    calls: u32,
    ms: f64,
    /// Time to copy the bytes that it reads and writes.
    floor_ms: Option<f64>,
}

/// Stages of a frame, the longest first. `rate` is that of copies, bytes per second.
fn by_stage(times: &[StageTime], bytes: &Bytes<'_>, rate: f64) -> Vec<Stage> {
    let mut stages: BTreeMap<&str, (u32, f64)> = BTreeMap::new();
    for stage in times {
        let entry = stages.entry(stage.name).or_default();
        entry.0 += 1;
        entry.1 += stage.time.as_secs_f64() * 1e3;
    }
    let floor = |stage| bytes.of(stage).map(|bytes| 1e3 * bytes / rate);
    let stages = stages.into_iter();
    let mut rows: Vec<_> =
        stages.map(|(stage, (calls, ms))| Stage { stage, calls, ms, floor_ms: floor(stage) }).collect();
    rows.sort_by(|a, b| b.ms.total_cmp(&a.ms));
    rows
}

/// Table of the stages; together they take `device` ms.
fn table(stages: &[Stage], device: f64) -> Table {
    let mut table = Table::new(vec![
        Column::new("stage", "", 0),
        Column::new("calls", "", 0),
        Column::new("device time", "ms", 3),
        Column::new("bytes alone", "ms", 3),
        Column::new("share", "%", 1),
    ]);
    for &Stage { stage, calls, ms, floor_ms } in stages {
        let share = 100.0 * ms / device.max(1e-9);
        table.row(vec![stage.into(), Cell::Number(calls.into()), ms.into(), floor_ms.into(), share.into()]);
    }
    table
}

fn run(args: &Args) -> Result<()> {
    let context = Context::new(&ContextOptions { device: args.device.clone(), ..Default::default() })?;
    let (scene, camera) = scene_of(args)?;
    let started = Instant::now();
    let room = Room { half: args.half, ..Default::default() };
    let model = Model::upload_around(&context, DVec3::ZERO, &scene, room)?;
    let upload = started.elapsed().as_secs_f64() * 1e3;
    let degree = color::of(model.sh_degree).part(args.sh_degree);
    let [width, height] = args.size;
    let limits = Limits {
        texel: Texel::Rgba32F,
        in_flight: SLOTS,
        views: args.views,
        timings: true,
        ..Limits::for_needs(Needs::at(&model, [degree]), width, height)
    };
    let started = Instant::now();
    let mut frames = Frames::new(&context, limits)?;
    let made = started.elapsed().as_secs_f64() * 1e3;
    let pixels = camera.pixels() as usize;
    // Each slot holds its views one after the other.
    let all = (args.views as usize).saturating_mul(4 * pixels);
    let targets = (0..SLOTS).map(|_| Buffer::<u32>::new(&context, "target", all, Location::Device));
    let targets: Vec<_> = targets.collect::<std::result::Result<_, _>>()?;
    let engine = Engine::new(&context, SLOTS);
    let instances = [Instance { degree, ..Instance::of(&model) }];
    let mut record = |n: u32| -> Result<()> {
        let slot = n % SLOTS;
        let commands = engine.begin(slot);
        let view = |v: u32| {
            let offset = u64::from(v) * 16 * pixels as u64;
            let range = BufferRange { buffer: targets[slot as usize].raw().handle(), offset };
            let color = Target { blend: Blend::Opaque([0.0; 3]), ..Target::new(Pixels::Buffer(range), Texel::Rgba32F) };
            FrameView { color: Some(color), ..FrameView::new(seen_from(&camera, n, v)) }
        };
        let views: Vec<_> = (0..args.views).map(view).collect();
        // SAFETY: the engine has waited for the slot; its buffers are live and as large as the view.
        unsafe { frames.record(commands, &Frame { slot, instances: &instances, views: &views }) }?;
        engine.submit(slot);
        Ok(())
    };

    let started = Instant::now();
    record(0)?;
    engine.finish();
    let first = started.elapsed().as_secs_f64() * 1e3;
    let image = targets[0].download()?;
    let (warm, mut n) = (Instant::now(), 1);
    while n < SLOTS || warm.elapsed() < size::WARM_UP {
        record(n)?;
        n += 1;
    }
    engine.finish();
    let (started, cpu) = (Instant::now(), cpu_seconds());
    for n in 0..args.frames {
        record(n)?;
    }
    engine.finish();
    let each = |seconds: f64| seconds * 1e3 / f64::from(args.frames.max(1));
    let (wall, cpu) = (each(started.elapsed().as_secs_f64()), each(cpu_seconds() - cpu));
    let slot = (args.frames + SLOTS - 1) % SLOTS;
    let (report, times) = (frames.report(slot)?, frames.times(slot)?);
    check(&context, &scene, &camera, room, &image[..4 * pixels], degree)?;

    let rate = copy_rate(&context)?;
    let bytes =
        Bytes { args, model: &model, degree, visible: report.visible.into(), isects: report.intersections.into() };
    let stages = by_stage(&times, &bytes, rate);
    let device: f64 = stages.iter().map(|stage| stage.ms).sum();
    let memory = (frames.limits().plan(context.info())?.bytes(), model.capacity());
    if args.json {
        let report = json!({
            "device": context.info().name, "driver": context.info().driver.version, "gaussians": model.count(), "width": width,
            "height": height, "views": args.views, "sh_degree": degree, "half": args.half, "lobes": args.lobes, "visible": report.visible,
            "intersections": report.intersections, "needed": report.needed, "frames": args.frames, "wall_ms": wall,
            "cpu_ms": cpu, "device_ms": device, "upload_ms": upload, "made_ms": made, "first_ms": first,
            "frames_bytes": memory.0, "copy_bytes_per_s": rate, "stages": stages,
        });
        println!("{report:#}");
        return Ok(());
    }
    println!(
        "{}: {} Gaussians of degree {degree}{}, {} of {width}×{height}: {} visible, {} intersections{}\n\
         a frame {wall:.2} ms, of the CPU {cpu:.2} ms, on the device {device:.2} ms; the first {first:.1} ms, pipelines and buffers {made:.0} ms, \
         upload {upload:.0} ms\n\
         frames hold {:.1} MB beside the model; copies {:.1} GB/s\n",
        context.info().name,
        model.count(),
        if args.half { " at half width" } else { "" },
        if args.views == 1 { "a view".into() } else { format!("{} views, each", args.views) },
        report.visible,
        report.intersections,
        report.needed.map_or(String::new(), |needed| format!(" (of {needed}: no room)")),
        memory.0 as f64 / 1e6,
        rate / 1e9,
    );
    print!("{}", table(&stages, device));
    Ok(())
}

/// Minimum bytes that stages read and write; each number counts once per view.
struct Bytes<'a> {
    args: &'a Args,
    model: &'a Model,
    degree: u32,
    visible: f64,
    isects: f64,
}

impl Bytes<'_> {
    fn of(&self, stage: &str) -> Option<f64> {
        let (gaussians, pixels) =
            (f64::from(self.model.capacity()), self.args.size.map(f64::from).iter().product::<f64>());
        let harmonics = sh_planes(self.degree) as f64 * if self.args.half { 2.0 } else { 4.0 };
        let (geometry, splat) = if self.args.half { (32.0, 28.0) } else { (44.0, 36.0) };
        let of_a_view = match stage {
            // Geometry, keys and tile counts of all Gaussians; harmonics, splats and colors of the visible
            // ones.
            "project" => gaussians * (geometry + 8.0) + self.visible * (harmonics + splat),
            // Key and value of every sorted item, read once and written once.
            "radix_upsweep" | "radix_downsweep" => 16.0 * (self.visible + self.isects),
            "emit" => self.visible * 32.0 + self.isects * 12.0,
            "tile_ranges" => self.isects * 4.0,
            "blend" => self.isects * 4.0 + self.visible * splat + pixels * 16.0,
            "resolve" => pixels * 32.0,
            _ => return None,
        };
        Some(f64::from(self.args.views) * of_a_view)
    }
}

fn check(context: &Context, scene: &Scene, camera: &Camera, room: Room, image: &[u32], degree: u32) -> Result<()> {
    let views = Views::upload(context, &[*camera], &[])?;
    let model = Model::upload_around(context, DVec3::ZERO, scene, room)?;
    let mut renderer = Renderer::new(context, Needs::of(&model), &views, RenderOptions::default())?;
    let want = renderer.render(&model, &views, 0, [0.0; 3])?;
    let same = image
        .chunks_exact(4)
        .zip(want.color.chunks_exact(3))
        .all(|(got, want)| (0..3).all(|c| got[c] == want[c].to_bits()));
    match same || degree != model.sh_degree {
        true => Ok(()),
        false => Err(Error::Usage("the frame is not the renderer's image".into())),
    }
}
