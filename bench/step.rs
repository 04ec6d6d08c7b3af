//! Measures the time of one training step, stage by stage, on a dataset, the built-in scene or random
//! Gaussians.
//!
//!     cargo bench --bench step -- [DATASET | --size WxH [--overlap X]] [--gaussians N] [--max-size N] [--steps N] [--sh-degree L] [--tile WxH] [--half] [--host] [--json]
//!
//! With a size, random Gaussians train on renders of other random Gaussians. With --host colors and moments lie in the host's memory, and
//! the bytes are printed that a step would move over a bus.
//!
//! Before timing, an image by the same kernels is compared with the float64 twin.

mod size;

use std::{collections::BTreeMap, path::PathBuf, process::ExitCode, time::Instant};

use clap::Parser;
use glint::{
    Error, Result,
    data::{Dataset, DatasetOptions, Split, builtin::builtin_scene},
    gpu::{Context, ContextOptions, Kernel},
    pipelines::{
        learn::{PROBED_NTH, learning_bytes},
        model::{Model, Room},
        raster::TileShape,
        render::{Needs, RenderOptions, Renderer},
        session::{Policy, Reduction, Session},
        start::{first_points, photos_of, upload_photos},
        train::{BaseOptions, train_base},
        views::Views,
    },
    reference::{self, Background, Options, Params, random_camera, random_scene},
    report::table::{Cell, Column, Table},
    scene::{
        Scene, from_points,
        layout::{bytes, sh_planes},
    },
    stages::step_done,
    verify::task::{Load, random_task},
};
use serde_json::json;

#[derive(Parser)]
#[command(name = "step", about = "Time of one training step, stage by stage")]
struct Args {
    /// Folder or JSON file of a dataset; without, the built-in scene
    dataset: Option<PathBuf>,
    /// Pixels of the views of random Gaussians
    #[arg(long, value_parser = size::size, conflicts_with_all = ["dataset", "max_size"])]
    size: Option<[u32; 2]>,
    /// How often random Gaussians cover the image, as a multiple of the default
    #[arg(long, default_value_t = 1.0, requires = "size", value_parser = positive)]
    overlap: f64,
    /// Gaussians at most
    #[arg(long, default_value_t = 30_000)]
    gaussians: usize,
    #[arg(long, default_value_t = 1600)]
    max_size: u32,
    /// Steps timed by the clock, after as many steps of warming up that also shape the scene
    #[arg(long, default_value_t = 200)]
    steps: u32,
    #[arg(long, default_value_t = 3)]
    sh_degree: u32,
    /// Add gradients up by float atomics, which training does if deterministic sums do not fit
    #[arg(long)]
    atomic: bool,
    /// Pixels of a tile in place of those that suit the device's subgroups
    #[arg(long, value_parser = size::size)]
    tile: Option<[u32; 2]>,
    /// Keep both moments of a number in one word
    #[arg(long)]
    half: bool,
    /// Keep colors and moments in the host's memory, as `glint train --gaussians-on host`
    #[arg(long, conflicts_with = "size")]
    host: bool,
    #[arg(long)]
    device: Option<String>,
    #[arg(long)]
    json: bool,
    /// Given by cargo bench
    #[arg(long, hide = true)]
    bench: bool,
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|x: &f64| x.is_finite() && *x > 0.0);
    number.ok_or_else(|| format!("`{text}`, expected a number above 0"))
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

fn run(args: &Args) -> Result<()> {
    let context = Context::new(&ContextOptions { device: args.device.clone(), ..Default::default() })?;
    check(&context)?;
    let lanes = context.info().subgroup_size;
    let tile = args.tile.map(|[width, height]| {
        let fits = TileShape::new(width, height, lanes);
        fits.ok_or_else(|| {
            Error::Usage(format!("subgroups of {lanes} lanes cannot cover tiles of {width}×{height} pixels"))
        })
    });
    let tile = tile.transpose()?;
    let Task { model, views, background, extent } = match args.size {
        Some([width, height]) => {
            let load = Load { width, height, gaussians: args.gaussians };
            let (model, views) = random_task(&context, load, args.overlap, args.sh_degree)?;
            Task { model, views, background: [0.0; 3], extent: 1.0 }
        }
        None => task(&context, args)?,
    };
    // All bands are in use after a thirtieth of a run; the first runs get there, and warm up.
    let options = BaseOptions { iterations: args.steps, sh_degree: args.sh_degree, ..Default::default() };
    let reduction = if args.atomic { Reduction::Atomic } else { Reduction::Deterministic };
    let session = Session {
        policy: Policy { reduction, packed: args.half, tile, ..Default::default() },
        background,
        extent,
        ..Session::new(&context)
    };
    let warm = Instant::now();
    while warm.elapsed() < size::WARM_UP {
        train_base(&session, &model, &views, &options, false, |_| ())?;
    }
    let started = Instant::now();
    let timed = train_base(&session, &model, &views, &options, true, |_| ())?;
    let wall = started.elapsed().as_secs_f64() * 1e3 / f64::from(args.steps);

    let steps = timed.steps.stages.iter().filter(|s| s.name == step_done::Kernel::NAME).count().max(1) as f64;
    let mut stages: BTreeMap<&str, (u32, f64)> = BTreeMap::new();
    for stage in &timed.steps.stages {
        let entry = stages.entry(stage.name).or_default();
        entry.0 += 1;
        entry.1 += stage.time.as_secs_f64() * 1e3 / steps;
    }
    let mut rows: Vec<_> = stages.into_iter().map(|(name, (calls, ms))| (name, f64::from(calls) / steps, ms)).collect();
    rows.sort_by(|a, b| b.2.total_cmp(&a.2));
    let device_ms: f64 = rows.iter().map(|r| r.2).sum();
    let camera = views.cameras[0];
    let bus_bytes = if args.host { Some(bus_bytes(&context, &model, &views, args)?) } else { None };
    if args.json {
        let stages: Vec<_> = rows.iter().map(|(n, calls, ms)| json!({"stage": n, "calls": calls, "ms": ms})).collect();
        let report = json!({
            "device": context.info().name, "driver": context.info().driver.version, "gaussians": model.count(),
            "views": views.cameras.len(), "width": camera.width, "height": camera.height,
            "sh_degree": args.sh_degree, "tile": session.policy.tile(context.info()).to_string(), "float_atomics": args.atomic, "half": args.half, "steps": args.steps, "wall_ms_per_step": wall,
            "device_ms_per_step": device_ms, "bus_bytes_per_step": bus_bytes, "stages": stages,
        });
        println!("{report:#}");
        return Ok(());
    }
    println!(
        "{}: {} Gaussians, SH degree {}, {} views of {}×{} and the like\n{wall:.3} ms per step by the clock over {} steps\n",
        context.info().name,
        model.count(),
        args.sh_degree,
        views.cameras.len(),
        camera.width,
        camera.height,
        args.steps
    );
    if let Some(bytes) = bus_bytes {
        println!("{:.2} MB a step over the bus: {:.2} ms at 25 GB/s\n", bytes / 1e6, bytes / 25e6);
    }
    let mut table = Table::new(vec![
        Column::new("stage", "", 0),
        Column::new("calls", "1/step", 0),
        Column::new("device time", "ms/step", 3),
        Column::new("share", "%", 1),
    ]);
    for (name, calls, ms) in rows {
        table.row(vec![name.into(), Cell::Number(calls), ms.into(), (100.0 * ms / device_ms).into()]);
    }
    print!("{table}");
    Ok(())
}

/// The model and views to train.
struct Task {
    model: Model,
    views: Views,
    background: [f32; 3],
    extent: f32,
}

fn task(context: &Context, args: &Args) -> Result<Task> {
    let dataset = match &args.dataset {
        Some(path) => Dataset::open(path, &DatasetOptions { max_size: Some(args.max_size), ..Default::default() })?,
        None => builtin_scene(args.gaussians).dataset(),
    };
    let photos = photos_of(&dataset, Some(Split::Train))?;
    let views = upload_photos(context, &photos, dataset.background, 0, |_, _| ())?;
    let cloud = first_points(&dataset, Some(args.gaussians), 0).cloud;
    let base = from_points(&cloud.around(views.origin), &cloud.colors, args.sh_degree);
    let model = Model::upload_around(
        context,
        views.origin,
        &Scene { base, origin: views.origin, ..Scene::default() },
        Room { host: args.host, ..Default::default() },
    )?;
    Ok(Task { model, views, background: dataset.background, extent: dataset.extent() as f32 })
}

/// Bytes of colors and moments that a step reads and writes, at most: those of the Gaussians that touch a tile. Projection reads colors; a
/// step reads and writes colors and moments, and the probe of one step in four moments.
fn bus_bytes(context: &Context, model: &Model, views: &Views, args: &Args) -> Result<f64> {
    let mut renderer = Renderer::new(context, Needs::of(model), views, RenderOptions::default())?;
    let (mut seen, few) = (0, views.cameras.len().div_ceil(32));
    let some = (0..views.cameras.len()).step_by(few);
    let count = some.len() as f64;
    for view in some {
        renderer.render(model, views, view as u32, [0.0; 3])?;
        seen += renderer.raster.buffers.tile_counts.download()?.iter().filter(|&&tiles| tiles > 0).count();
    }
    let [_, others] = learning_bytes(args.sh_degree, args.half, true).map(|bytes| bytes as f64);
    let colors = bytes(sh_planes(args.sh_degree)) as f64;
    let each = colors + 2.0 * others + 2.0 * (others - colors) / f64::from(PROBED_NTH);
    Ok(each * seen as f64 / count)
}

/// Fails unless the device's image of a random scene equals the twin's: mean difference below 1e-5 (measured:
/// 5e-7).
fn check(context: &Context) -> Result<()> {
    let (scene, camera) = (random_scene(1, 2000, 0, 3), random_camera(96, 64));
    let views = Views::upload(context, &[camera], &[])?;
    let model = Model::upload(context, &scene, 0)?;
    let mut renderer = Renderer::new(context, Needs::of(&model), &views, RenderOptions::default())?;
    let image = renderer.render(&model, &views, 0, [0.0; 3])?;
    let tile = renderer.raster.tile;
    let options = Options { tile_width: tile.width, tile_height: tile.height, ..Default::default() };
    let view = reference::View::from_camera(&camera).rounded();
    let twin = reference::render(&Params::from_scene(&scene)?, &view, &options, Background::Color([0.0; 3]));
    let differences = image.color.chunks(3).zip(&twin.blended.image);
    let sum: f64 = differences.map(|(a, b)| (0..3).map(|c| (f64::from(a[c]) - b[c]).abs()).sum::<f64>()).sum();
    let mean = sum / image.color.len() as f64;
    if mean < 1e-5 {
        Ok(())
    } else {
        Err(Error::Usage(format!("the image is off the twin's by {mean:.1e} on average")))
    }
}
