//! Compares ways to spend steps and bytes on a trained base, by their gain on held-out photographs.
//!
//!     cargo bench --bench ablation -- DATASET [--base PLY | --gaussians N --iterations N] [--max-size N] [--seeds N] [--rows LIST]
//!
//! Every row starts from the same base and takes the same number of joint steps:
//!
//! - `more`: nothing is added, the base trains longer;
//! - `plain`: plain Gaussians by pursuit; `lobes`: Gaussians with lobes only; `both`: the kind with the
//!   higher gain per byte; `bands`: bands only, for a base of constant colors; `pursuit`: all of these;
//! - `auto`: the default of `glint enhance`: pursuit as long as a Gaussian gains more than longer training;
//! - `augs`: the paper's placement and joint phase, with the rounds of the preset `quick`; `paper`: with its
//!   own;
//! - `augs+`: the paper's placement, and a joint phase that trains everything, as in the other rows.
//!
//! Prints a table, or with `--json` a line of JSON per row and seed, for `glint report --history`. Its
//! `views` has the PSNR of each held-out photo by name: a photo of something that no training photo shows can
//! shift the mean from seed to seed.

use std::{path::PathBuf, process::ExitCode, time::Instant};

use clap::Parser;
use glint::{
    Error, Result,
    data::{
        Dataset, DatasetOptions, Holdout, Photo, Split, builtin::builtin_scene, read_scene, scene_bytes, write_scene,
    },
    gpu::{Context, ContextOptions},
    pipelines::{
        enhance::{EnhanceOptions, Method, enhance},
        join::join,
        model::{Model, Room},
        pursuit::Kinds,
        render::RenderOptions,
        session::Session,
        spend::{MOST_BY_BYTES, MOST_BY_GAIN, Weigh},
        start::{first_points, photos_of, upload_photos},
        train::{BaseOptions, train_base},
        views::Views,
    },
    report::evaluate::{Evaluation, evaluate},
    scene::{Scene, from_points},
};
use serde_json::{Map, Value, json};

#[derive(Parser)]
#[command(name = "ablation", about = "What each way of augmenting a base gains on held-out photographs")]
struct Args {
    /// Folder or JSON file of a dataset; without, the built-in scene
    dataset: Option<PathBuf>,
    #[command(flatten)]
    base: BaseArgs,
    #[arg(long, default_value_t = 72)]
    max_size: u32,
    /// Photos to hold out: every Nth, or `sector`; without, as the dataset says
    #[arg(long, value_name = "N|sector|none")]
    holdout: Option<Holdout>,
    #[arg(long, default_value_t = 0.1)]
    ratio: f64,
    /// Limit by bytes in place of Gaussians: as many as this share of the base's
    #[arg(long)]
    byte_ratio: Option<f64>,
    /// Joint steps for each view
    #[arg(long, default_value_t = 30)]
    steps: u32,
    /// Seeds of every row
    #[arg(long, default_value_t = 1)]
    seeds: u64,
    /// The first of them
    #[arg(long, default_value_t = 0)]
    first_seed: u64,
    #[arg(long, value_delimiter = ',', default_value = "more,plain,lobes,pursuit,augs")]
    rows: Vec<String>,
    /// Settings other than the defaults. Of pursuit and its joint phase: draws, sizes, first, ratio, rounds, caution, doubt, least, opacity,
    /// placements, worth, degree (of lobes), pace, decay, newton (0: Adam's steps). Of the paper's method: shared, smallest, weights, bias (1: the
    /// other way, see docs/method.md). Of both: threshold, centre (1: depths of centres), and direction,
    /// width and sharpness, factors of the rates that lobes' learn by (0: they stay as they were placed)
    #[arg(long, value_name = "KEY=VALUE", value_delimiter = ',')]
    set: Vec<String>,
    #[arg(long)]
    device: Option<String>,
    #[arg(long)]
    json: bool,
    /// Given by cargo bench
    #[arg(long, hide = true)]
    bench: bool,
}

#[derive(clap::Args)]
struct BaseArgs {
    /// A trained base; without, one is trained
    #[arg(long, value_name = "PLY")]
    base: Option<PathBuf>,
    /// Gaussians of a base that is trained
    #[arg(long, default_value_t = 4000)]
    gaussians: usize,
    /// Steps of a base that is trained
    #[arg(long, default_value_t = 3000)]
    iterations: u32,
    /// Keep the trained base here
    #[arg(long, value_name = "PLY")]
    keep: Option<PathBuf>,
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

/// The options of a row; `None` for the control.
fn options_of(row: &str, args: &Args) -> Result<Option<EnhanceOptions>> {
    let mut options = match row {
        "more" => return Ok(None),
        "plain" | "lobes" | "both" | "bands" | "pursuit" | "auto" => EnhanceOptions::pursuit(),
        "augs" | "augs+" => EnhanceOptions::quick(),
        "paper" => EnhanceOptions::paper(),
        other => return Err(Error::Usage(format!("unknown row `{other}`"))),
    };
    options.ratio = args.ratio;
    options.join.steps_per_view = args.steps;
    options.bands &= !matches!(row, "plain" | "lobes" | "both");
    match row {
        "plain" => options.pursuit.kinds = Kinds::Plain,
        "lobes" => options.pursuit.kinds = Kinds::Lobes,
        "auto" => (options.ratio, options.weigh) = (MOST_BY_GAIN, Weigh::Limit),
        "augs+" => options.join = join_all(args)?,
        _ => {}
    }
    set(&mut options, args)?;
    Ok(Some(options))
}

fn join_all(args: &Args) -> Result<glint::pipelines::join::JoinOptions> {
    let mut options = EnhanceOptions::pursuit();
    options.join.steps_per_view = args.steps;
    set(&mut options, args)?;
    Ok(options.join)
}

fn set(options: &mut EnhanceOptions, args: &Args) -> Result<()> {
    for pair in &args.set {
        let bad = || Error::Usage(format!("--set {pair}: expected a known key and a number"));
        let (key, value) = pair.split_once('=').ok_or_else(bad)?;
        let value: f32 = value.parse().map_err(|_| bad())?;
        // Applies to the other method only, so it has no effect here.
        let mut other = match options.method {
            Method::Pursuit => EnhanceOptions::paper(),
            Method::Augs => EnhanceOptions::pursuit(),
        };
        if !set_one(options, key, value) && !set_one(&mut other, key, value) {
            return Err(bad());
        }
    }
    Ok(())
}

/// Sets an option; returns whether the method has such a setting.
fn set_one(options: &mut EnhanceOptions, key: &str, value: f32) -> bool {
    match (options.method, key) {
        (_, "threshold") => options.median_threshold = value,
        (_, "centre") => options.centre_depth = value != 0.0,
        (Method::Augs, "shared") => options.schedule.shared_steps = value != 0.0,
        (Method::Augs, "smallest") => options.lift.fail_on_smallest = value != 0.0,
        (Method::Augs, "weights") => options.lift.plain_weights = value != 0.0,
        (Method::Augs, "bias") => options.join.bias_correction = value != 0.0,
        (Method::Pursuit, "draws") => options.pursuit.draws = value as u32,
        (Method::Pursuit, "sizes") => options.pursuit.sizes = value as u32,
        (Method::Pursuit, "first") => options.pursuit.first_size = value,
        (Method::Pursuit, "ratio") => options.pursuit.size_ratio = value,
        (Method::Pursuit, "rounds") => options.pursuit.rounds = value as u32,
        (Method::Pursuit, "doubt") => options.pursuit.doubt = value,
        (Method::Pursuit, "caution") => options.pursuit.caution = value,
        (Method::Pursuit, "least") => options.pursuit.least_gain = value,
        (Method::Pursuit, "opacity") => options.pursuit.least_opacity = value,
        (Method::Pursuit, "placements") => options.pursuit.placements = value as u32,
        (_, "direction") => options.join.lobe_rates[0] = value,
        (_, "width") => options.join.lobe_rates[1] = value,
        (_, "sharpness") => options.join.lobe_rates[2] = value,
        (Method::Pursuit, "pace") => options.join.pace = value,
        (Method::Pursuit, "decay") => options.join.decay = value,
        (Method::Pursuit, "newton") => options.join.newton = value,
        (Method::Pursuit, "degree") => options.pursuit.lobe_degree = value as u32,
        (Method::Pursuit, "worth") => options.pursuit.lobe_worth = value,
        _ => return false,
    }
    true
}

/// Gaussians that a row added or changed.
#[derive(Default)]
struct Added {
    lobes: u32,
    plain: u32,
    banded: u32,
    /// Seconds before the joint phase.
    place: f64,
}

/// Results of one row and seed.
struct Found {
    /// Means over the held-out photos: PSNR in dB, and SSIM, −1 to 1.
    psnr: f64,
    ssim: f64,
    added: Added,
    /// Seconds in total.
    seconds: f64,
}

fn judge(session: &Session, scene: &Scene, photos: &[&Photo]) -> Result<Evaluation> {
    let render = RenderOptions { policy: session.policy, ..Default::default() };
    evaluate(&session.context, scene, photos, render, session.background, |_| Ok(()))
}

/// PSNR of the whole scene, by the photo's name.
fn by_view(evaluation: &Evaluation) -> Map<String, Value> {
    evaluation.views.iter().map(|view| (view.name.clone(), view.augmented.psnr.into())).collect()
}

fn train(args: &Args, dataset: &Dataset, session: &Session, views: &Views) -> Result<Scene> {
    let first = first_points(dataset, Some(args.base.gaussians), 0);
    let base = from_points(&first.cloud.around(glam::DVec3::ZERO), &first.cloud.colors, 3);
    let scene = Scene { base, ..Default::default() };
    let model = Model::upload_around(&session.context, views.origin, &scene, Room::default())?;
    let options = BaseOptions { iterations: args.base.iterations, sh_degree: 3, ..Default::default() };
    train_base(session, &model, views, &options, false, |_| ())?;
    model.download()
}

/// The base as the row `row` augments it; without options, trained longer.
fn augment(
    session: &Session,
    base: &Scene,
    views: &Views,
    options: Option<EnhanceOptions>,
    (row, args): (&str, &Args),
) -> Result<(Scene, Added)> {
    let Some(mut options) = options else {
        let model = Model::upload_around(&session.context, views.origin, base, Room::default())?;
        join(session, &model, views, &join_all(args)?)?.run(&model, views, false, |_| ())?;
        return Ok((model.download()?, Added::default()));
    };
    if let (Some(share), Method::Pursuit) = (args.byte_ratio, options.method) {
        let bytes = share * scene_bytes(base) as f64;
        (options.ratio, options.bytes) = (MOST_BY_BYTES, Some(bytes as u64));
    }
    if row == "bands" {
        options.ratio = 0.0;
    }
    let done = enhance(session, base, views, &options, |_| ())?;
    let plain = done.placed.iter().map(|placed| placed.plain).sum();
    let times = done.times;
    let place = (times.base + times.bands + times.place + times.screen + times.lift).as_secs_f64();
    let added = Added { lobes: done.lifted, plain, banded: done.promotion.gains.len() as u32, place };
    Ok((done.scene, added))
}

fn run(args: &Args) -> Result<()> {
    let holdout = args.holdout.unwrap_or_default();
    let options = DatasetOptions { max_size: Some(args.max_size), holdout, ..Default::default() };
    let dataset = match &args.dataset {
        Some(path) => Dataset::open(path, &options)?,
        None => builtin_scene(8000).dataset(),
    };
    let (learned, held) = (photos_of(&dataset, Some(Split::Train))?, photos_of(&dataset, Some(Split::Test))?);
    let context = Context::new(&ContextOptions { device: args.device.clone(), ..Default::default() })?;
    let background = [0.0; 3];
    let views = upload_photos(&context, &learned, background, 0, |_, _| ())?;
    let session = |seed| Session { extent: dataset.extent() as f32, background, seed, ..Session::new(&context) };
    let base = match &args.base.base {
        Some(path) => read_scene(path)?,
        None => train(args, &dataset, &session(0), &views)?,
    };
    if let Some(path) = &args.base.keep {
        write_scene(path, &base)?;
    }
    let before = judge(&session(0), &base, &held)?.augmented;
    let split = holdout.to_string();
    let columns = ["row", "PSNR", "gain", "SSIM", "spread", "lobes", "plain", "banded", "place s", "all s"];
    let mut table = Vec::new();
    let name = args.dataset.as_ref().map_or("built-in".into(), |path| path.display().to_string());
    if !args.json {
        println!(
            "{name}: {} Gaussians, {} training and {} held-out photos at {} px, base {:.2} dB, SSIM {:.4}",
            base.base.len(),
            learned.len(),
            held.len(),
            args.max_size,
            before.psnr,
            before.ssim
        );
    }
    for row in &args.rows {
        let options = options_of(row, args)?;
        let mut found = Vec::new();
        for seed in (args.first_seed..).take(args.seeds as usize) {
            let (session, started) = (session(seed), Instant::now());
            let (scene, added) = augment(&session, &base, &views, options, (row, args))?;
            let seconds = started.elapsed().as_secs_f64();
            let judged = judge(&session, &scene, &held)?;
            let after = judged.augmented;
            let supplement = scene.supplement.as_ref().map_or(0, |s| s.gaussians.len());
            let bytes = scene_bytes(&scene);
            if args.json {
                println!(
                    "{}",
                    json!({
                        "name": row, "dataset": name, "seed": seed, "holdout": split, "psnr": after.psnr, "ssim": after.ssim,
                        "base_psnr": before.psnr, "seconds": seconds, "place_seconds": added.place, "bytes": bytes,
                        "gaussians": scene.base.len() + supplement, "steps_per_view": args.steps, "lobes": added.lobes, "plain": added.plain,
                        "banded": added.banded, "views": by_view(&judged),
                    })
                );
            }
            found.push(Found { psnr: after.psnr, ssim: after.ssim, added, seconds });
        }
        let mean = |of: fn(&Found) -> f64| found.iter().map(of).sum::<f64>() / found.len().max(1) as f64;
        let psnr = mean(|f| f.psnr);
        let most = found.iter().map(|f| f.psnr).fold(f64::MIN, f64::max);
        let least = found.iter().map(|f| f.psnr).fold(f64::MAX, f64::min);
        let row_values = [
            psnr,
            psnr - before.psnr,
            mean(|f| f.ssim),
            most - least,
            mean(|f| f.added.lobes.into()),
            mean(|f| f.added.plain.into()),
            mean(|f| f.added.banded.into()),
            mean(|f| f.added.place),
            mean(|f| f.seconds),
        ];
        table.push((row.clone(), row_values));
        if !args.json {
            let v = &table.last().unwrap().1;
            eprintln!("{row}: {:+.2} dB, {:.1} s", v[1], v[8]);
        }
    }
    if !args.json {
        println!("{}", columns.join("\t"));
        for (row, v) in &table {
            println!(
                "{row}\t{:.2}\t{:+.2}\t{:.4}\t{:.2}\t{:.0}\t{:.0}\t{:.0}\t{:.1}\t{:.1}",
                v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8]
            );
        }
    }
    Ok(())
}
