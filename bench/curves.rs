//! Plots quality over time, Gaussians or memory: one panel per dataset, one line per strategy or row. The
//! input are tables of `bench/train`, or the output of `bench/ablation --json`.
//!
//!     STEPS="300 1000 3000" bench/train OUT DATASET... > now.md
//!     cargo bench --bench curves -- curves.svg now.md before=earlier.md
//!     LIMIT="2000 4000 8000" POINTS=half bench/train OUT DATASET... > limits.md
//!     cargo bench --bench curves -- curves.svg limits.md --over gaussians
//!
//!     for n in 5 10 30 60; do cargo bench --bench ablation -- DATASET --base PLY --rows more --steps $n --json; done > more.jsonl
//!     cargo bench --bench curves -- curves.svg more.jsonl
//!
//! `NAME=FILE` prefixes the strategies of a file with NAME. Points are means over seeds, bars show the range.

use std::{collections::BTreeMap, error::Error, fs, path::Path, process::ExitCode};

use clap::{Parser, ValueEnum};
use plotters::{coord::Shift, prelude::*};
use serde_json::{Map, Value};

#[derive(Parser)]
struct Args {
    /// The SVG that is written.
    output: String,
    /// Tables as `bench/train` prints them, or lines of `bench/ablation --json`.
    #[arg(required = true, value_name = "[NAME=]FILE")]
    tables: Vec<String>,
    /// The x axis.
    #[arg(long, value_enum, default_value_t = Over::Seconds)]
    over: Over,
    /// Given by cargo bench.
    #[arg(long, hide = true)]
    bench: bool,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Over {
    /// Time of training, or of an augmentation; a line goes through the lengths of runs.
    Seconds,
    /// Number of the base's Gaussians; a line goes through limits.
    Gaussians,
    /// Final device memory; a line goes through limits.
    Memory,
}

impl Over {
    fn title(self) -> &'static str {
        match self {
            Over::Seconds => "seconds",
            Over::Gaussians => "Gaussians",
            Over::Memory => "memory of the device, MB",
        }
    }
}

/// A row of a table.
struct Run {
    dataset: String,
    strategy: String,
    steps: u32,
    limit: u32,
    /// Position in the plot.
    at: [f64; 2],
}

/// A row of `bench/ablation --json`.
fn of_ablation(name: &str, row: &Map<String, Value>, over: Over) -> Result<Run, String> {
    let number = |key: &str| row.get(key).and_then(Value::as_f64).ok_or_else(|| format!("no number `{key}`"));
    let text = |key: &str| row.get(key).and_then(Value::as_str).ok_or_else(|| format!("no text `{key}`"));
    let dataset = text("dataset")?;
    let x = match over {
        Over::Seconds => number("seconds")?,
        Over::Gaussians => number("gaussians")?,
        Over::Memory => return Err("a row of bench/ablation knows no memory".into()),
    };
    Ok(Run {
        dataset: Path::new(dataset).file_name().map_or(dataset.into(), |name| name.to_string_lossy().into_owned()),
        strategy: format!("{name} {}", text("name")?).trim().to_owned(),
        steps: number("steps_per_view")? as u32,
        limit: 0,
        at: [x, number("psnr")?],
    })
}

/// Positions of each seed's run, by dataset, then by line of the plot, then by steps or limit.
type Curves = BTreeMap<String, BTreeMap<String, BTreeMap<u32, Vec<[f64; 2]>>>>;

/// Size of a panel in pixels.
const PANEL: (u32, u32) = (520, 420);

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut runs = vec![];
    for table in &args.tables {
        let (name, path) = table.split_once('=').unwrap_or(("", table));
        let text = fs::read_to_string(path).map_err(|e| format!("{path}: {e}"))?;
        for line in text.lines() {
            if let Ok(Value::Object(row)) = serde_json::from_str(line) {
                runs.push(of_ablation(name, &row, args.over).map_err(|what| format!("{path}: `{line}`: {what}"))?);
                continue;
            }
            let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
            let [dataset, strategy, steps, limit, _, gaussians, quality, seconds, memory] = cells[..] else { continue };
            // Skips the head and the rule below it.
            let Ok(steps) = steps.parse() else { continue };
            let number = |what: &str, cell: &str| -> Result<f64, String> {
                cell.parse().map_err(|_| format!("{path}: `{line}`: {what} is not a number"))
            };
            let x = match args.over {
                Over::Seconds => number("the time", seconds)?,
                Over::Gaussians => number("the number of Gaussians", gaussians)?,
                Over::Memory => number("the memory", memory)?,
            };
            runs.push(Run {
                dataset: dataset.to_owned(),
                strategy: format!("{name} {strategy}").trim().to_owned(),
                steps,
                limit: number("the limit", limit)? as u32,
                at: [x, number("PSNR", quality.split(' ').next().unwrap_or(""))?],
            });
        }
    }
    if runs.is_empty() {
        return Err("neither a table of bench/train nor a row of bench/ablation --json in these files".into());
    }
    // If there are several limits or lengths, the line's name contains the one that is not on its axis.
    let (several_steps, several_limits) =
        (runs.iter().any(|r| r.steps != runs[0].steps), runs.iter().any(|r| r.limit != runs[0].limit));
    let mut curves = Curves::new();
    for Run { dataset, strategy, steps, limit, at } in runs {
        let (line, key) = match args.over {
            Over::Seconds if several_limits => (format!("{strategy}, {limit} Gaussians"), steps),
            Over::Seconds => (strategy, steps),
            _ if several_steps => (format!("{strategy}, {steps} steps"), limit),
            _ => (strategy, limit),
        };
        curves.entry(dataset).or_default().entry(line).or_default().entry(key).or_default().push(at);
    }
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, (PANEL.0 * curves.len() as u32, PANEL.1)).into_drawing_area();
        area.fill(&WHITE)?;
        for (panel, (dataset, lines)) in area.split_evenly((1, curves.len())).iter().zip(&curves) {
            draw(panel, dataset, lines, args.over)?;
        }
        area.present()?;
    }
    Ok(fs::write(&args.output, svg)?)
}

fn draw(
    panel: &DrawingArea<SVGBackend<'_>, Shift>,
    dataset: &str,
    lines: &BTreeMap<String, BTreeMap<u32, Vec<[f64; 2]>>>,
    over: Over,
) -> Result<(), Box<dyn Error>> {
    let all = || lines.values().flat_map(|points| points.values().flatten());
    let range =
        |axis: usize| all().map(|p| p[axis]).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let ((first, last), (low, high)) = (range(0), range(1));
    let mut chart = ChartBuilder::on(panel)
        .margin(12)
        .caption(dataset, ("sans-serif", 18))
        .x_label_area_size(40)
        .y_label_area_size(45)
        .build_cartesian_2d((first / 1.3..last * 1.3).log_scale(), low - 0.5..high + 0.5)?;
    chart
        .configure_mesh()
        .light_line_style(WHITE)
        .x_desc(over.title())
        .y_desc("test PSNR, dB")
        .x_label_formatter(&|&v| match format!("{v}") {
            text if text.starts_with(['1', '2', '5']) => text,
            // Too crowded for all labels.
            _ => String::new(),
        })
        .draw()?;
    for (k, (name, points)) in lines.iter().enumerate() {
        let color = Palette99::pick(k).to_rgba();
        let mean = |seeds: &[[f64; 2]], axis: usize| seeds.iter().map(|p| p[axis]).sum::<f64>() / seeds.len() as f64;
        let means: Vec<(f64, f64)> = points.values().map(|seeds| (mean(seeds, 0), mean(seeds, 1))).collect();
        for (seeds, &(x, y)) in points.values().zip(&means) {
            let [low, high] = seeds.iter().fold([y; 2], |[a, b], p| [a.min(p[1]), b.max(p[1])]);
            chart.draw_series([PathElement::new([(x, low), (x, high)], color)])?;
        }
        chart.draw_series(means.iter().map(|&at| Circle::new(at, 4, color.filled())))?;
        chart
            .draw_series([PathElement::new(means, color.stroke_width(2))])?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE)
        .border_style(RGBColor(200, 200, 200))
        .draw()?;
    Ok(())
}
