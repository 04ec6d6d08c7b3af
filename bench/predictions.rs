//! Compares predicted gains of single Gaussians with their true ones: bands, plain Gaussians and Gaussians with lobes, drawn at random
//! from what the search finds on a base.
//!
//!     cargo bench --bench predictions -- DATASET --base PLY [--max-size N] [--each N] [-o PLOT.svg]
//!
//! The true gain is the fall of the squared error over pixels and channels of all training photos when the base gets this Gaussian
//! alone, or these bands alone, as they were fitted: nothing learns. On test photos it is counted for as many photos. Prints a table of
//! true over predicted gains.

use std::{path::PathBuf, process::ExitCode};

use clap::Parser;
use glint::{
    Error, Result,
    data::{Dataset, DatasetOptions, Split, read_scene},
    gpu::{Context, ContextOptions},
    pipelines::{
        bands::{Bands, Promotion},
        model::{Model, Room},
        pursuit::{Kinds, Pursuit, PursuitOptions},
        render::{Needs, RenderOptions, Renderer},
        session::Session,
        start::{photos_of, upload_photos},
        views::Views,
    },
    scene::{Lobes, Scene, Supplement},
};
use plotters::prelude::*;
use rand::{SeedableRng, seq::index};
use rand_chacha::ChaCha8Rng;

#[derive(Parser)]
struct Args {
    /// Folder or JSON file of the dataset
    dataset: PathBuf,
    /// Base scene; only one of constant colors has bands to find
    #[arg(long, value_name = "PLY")]
    base: PathBuf,
    #[arg(long, default_value_t = 128)]
    max_size: u32,
    /// Number of Gaussians to draw of each kind
    #[arg(long, default_value_t = 200)]
    each: usize,
    /// Plot of all of them
    #[arg(short, long, value_name = "SVG")]
    output: Option<PathBuf>,
    /// Given by cargo bench
    #[arg(long, hide = true)]
    bench: bool,
}

/// A predicted gain, and the base with what gains it.
type Single = (f64, Scene);

/// Gains of a kind: predicted, true on training photos, and on test photos.
struct Kind {
    name: &'static str,
    found: usize,
    gains: Vec<[f64; 3]>,
}

struct Lab {
    session: Session,
    /// Training photos, in which everything is found.
    views: Views,
    /// Test photos.
    held: Views,
    base: Scene,
    each: usize,
}

impl Lab {
    /// Up to `each` numbers below `len`, drawn at random.
    fn draw(&self, len: usize) -> Vec<usize> {
        index::sample(&mut ChaCha8Rng::seed_from_u64(self.session.seed), len, self.each.min(len)).into_vec()
    }

    fn model(&self, views: &Views, scene: &Scene, room: Room) -> Result<(Model, Renderer)> {
        let model = Model::upload_around(&self.session.context, views.origin, scene, room)?;
        let render = RenderOptions { depth: true, policy: self.session.policy, ..Default::default() };
        let renderer = Renderer::new(&self.session.context, Needs::of(&model), views, render)?;
        Ok((model, renderer))
    }

    /// Gaussians of the base that gain by bands of the best degree.
    fn bands(&self) -> Result<(usize, Vec<Single>)> {
        let mut bands = Bands::new(&self.session, &self.base, &self.views, 0)?;
        while bands.advance(&self.views)?.is_some() {}
        let Promotion { degree, gains } = bands.choose(u64::MAX, 0.0);
        let alone = |i: usize| {
            let promotion = Promotion { degree, gains: vec![gains[i]] };
            let base = bands.promoted(&self.base.base, &promotion);
            (gains[i].gain.into(), Scene { base, mixed: true, ..self.base.clone() })
        };
        Ok((gains.len(), self.draw(gains.len()).into_iter().map(alone).collect()))
    }

    /// Gaussians of one kind that a placement of a tenth of the base chooses.
    fn placed(&self, kinds: Kinds) -> Result<(usize, Vec<Single>)> {
        let most = (self.base.base.len() / 10).max(1) as u32;
        let (mut model, mut renderer) =
            self.model(&self.views, &self.base, Room { supplement: most, base: most, ..Room::default() })?;
        let options = PursuitOptions { kinds, ..Default::default() };
        let mut pursuit = Pursuit::new(&self.session, &self.views, most, options)?;
        pursuit.start(most)?;
        while pursuit.advance(&mut renderer, &model, &self.views)?.is_some() {}
        let gains = pursuit.placed()?.gains;
        model.learn_counts()?;
        // Added Gaussians follow those of the base by falling gain, around the origin of the views.
        let whole = model.download()?;
        let count = self.base.base.len();
        let alone = |i: usize| {
            let supplement = whole.supplement.as_ref().filter(|_| kinds == Kinds::Lobes).map(|all| Supplement {
                gaussians: all.gaussians.reordered(&[i]),
                lobes: Lobes {
                    directions: vec![all.lobes.directions[i]],
                    widths: vec![all.lobes.widths[i]],
                    sharpness: vec![all.lobes.sharpness[i]],
                },
            });
            let plain = (kinds == Kinds::Plain).then_some(count + i);
            let base = whole.base.reordered(&(0..count).chain(plain).collect::<Vec<_>>());
            (gains[i].into(), Scene { base, supplement, ..whole.clone() })
        };
        Ok((gains.len(), self.draw(gains.len()).into_iter().map(alone).collect()))
    }

    /// Gains over the base of each scene, beside the predicted ones.
    fn measure(&self, name: &'static str, (found, singles): (usize, Vec<Single>)) -> Result<Kind> {
        let predicted = singles.iter().map(|(predicted, _)| *predicted);
        let [train, test] = [self.gains(&self.views, &singles)?, self.gains(&self.held, &singles)?];
        let scale = self.views.cameras.len() as f64 / self.held.cameras.len().max(1) as f64;
        let gains = predicted.zip(train).zip(test).map(|((predicted, train), test)| [predicted, train, scale * test]);
        Ok(Kind { name, found, gains: gains.collect() })
    }

    fn gains(&self, views: &Views, singles: &[Single]) -> Result<Vec<f64>> {
        let mut pursuit = Pursuit::new(&self.session, views, 1, PursuitOptions::default())?;
        let mut error = |scene: &Scene| {
            let (model, mut renderer) = self.model(views, scene, Room::default())?;
            pursuit.measure(&mut renderer, &model, views)
        };
        let before = error(&self.base)?;
        singles.iter().map(|(_, scene)| Ok(before - error(scene)?)).collect()
    }
}

/// The value that a fraction `at` of the sorted `values` is below.
fn quantile(values: &[f64], at: f64) -> f64 {
    values.get(((values.len() as f64 * at) as usize).min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}

fn print(kinds: &[Kind]) {
    println!(
        "| kind | found | drawn | true / predicted: quartiles | sum | sum, test photos | below 0 | within a factor of two |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for Kind { name, found, gains } in kinds {
        let mut ratios: Vec<f64> = gains.iter().map(|[predicted, train, _]| train / predicted).collect();
        ratios.sort_by(f64::total_cmp);
        let share = |test: fn(f64) -> bool| {
            100.0 * ratios.iter().filter(|&&ratio| test(ratio)).count() as f64 / ratios.len().max(1) as f64
        };
        let [predicted, train, test] = [0, 1, 2].map(|k| gains.iter().map(|gain| gain[k]).sum::<f64>());
        let [low, median, high] = [0.25, 0.5, 0.75].map(|at| quantile(&ratios, at));
        println!(
            "| {name} | {found} | {} | {low:.2}, {median:.2}, {high:.2} | {:.2} | {:.2} | {:.0} % | {:.0} % |",
            ratios.len(),
            train / predicted,
            test / predicted,
            share(|ratio| ratio < 0.0),
            share(|ratio| (0.5..=2.0).contains(&ratio)),
        );
    }
}

/// Plots true over predicted gains; those that are not above 0 lie on the lower edge.
fn plot(path: &PathBuf, kinds: &[Kind]) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let all = kinds.iter().flat_map(|kind| kind.gains.iter().flat_map(|gain| [gain[0], gain[1]]));
    let all = all.filter(|gain| *gain > 0.0);
    let (least, most) = all.fold((f64::MAX, f64::MIN), |(least, most), gain| (least.min(gain), most.max(gain)));
    let range = least / 1.5..most * 1.5;
    let root = SVGBackend::new(path, (1000, 360)).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, kind) in root.split_evenly((1, kinds.len())).iter().zip(kinds) {
        let mut chart = ChartBuilder::on(area)
            .caption(kind.name, ("sans-serif", 16))
            .margin(8)
            .x_label_area_size(34)
            .y_label_area_size(50)
            .build_cartesian_2d(range.clone().log_scale(), range.clone().log_scale())?;
        let power = |gain: &f64| format!("{gain:.0e}");
        let mut mesh = chart.configure_mesh();
        mesh.x_labels(5).x_label_formatter(&power).y_label_formatter(&power).light_line_style(TRANSPARENT);
        mesh.x_desc("predicted gain").y_desc("true gain").draw()?;
        for factor in [0.5, 1.0, 2.0] {
            let ends = [range.start.max(range.start / factor), range.end.min(range.end / factor)];
            let line = ends.map(|x| (x, x * factor));
            chart.draw_series([PathElement::new(line, BLACK.mix(if factor == 1.0 { 0.8 } else { 0.3 }))])?;
        }
        let dots = kind.gains.iter().map(|&[x, y, _]| Circle::new((x, y.max(range.start)), 2, BLUE.mix(0.6).filled()));
        chart.draw_series(dots)?;
    }
    Ok(root.present()?)
}

fn run(args: &Args) -> Result<()> {
    let options = DatasetOptions { max_size: Some(args.max_size), ..Default::default() };
    let dataset = Dataset::open(&args.dataset, &options)?;
    let context = Context::new(&ContextOptions::default())?;
    let upload = |split| upload_photos(&context, &photos_of(&dataset, Some(split))?, [0.0; 3], 0, |_, _| ());
    let [views, held] = [upload(Split::Train)?, upload(Split::Test)?];
    let session = Session { extent: dataset.extent() as f32, ..Session::new(&context) };
    let lab = Lab { session, views, held, base: read_scene(&args.base)?, each: args.each };
    let mut kinds = Vec::new();
    if lab.base.base.sh_degree == 0 {
        kinds.push(lab.measure("bands", lab.bands()?)?);
    }
    for (name, kind) in [("plain", Kinds::Plain), ("with lobes", Kinds::Lobes)] {
        kinds.push(lab.measure(name, lab.placed(kind)?)?);
    }
    print(&kinds);
    let Some(path) = &args.output else { return Ok(()) };
    plot(path, &kinds).map_err(|error| Error::Usage(format!("{}: {error}", path.display())))
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
