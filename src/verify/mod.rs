//! Verifies glint's kernels on a device and its driver: compares every dispatch of the pipelines with its
//! float64 twin, and measures its time.

mod bands;
mod bounds;
mod density;
mod exposure;
mod frames;
mod judge;
pub mod lift;
pub mod loss;
mod model;
mod pursuit;
mod raster;
mod rates;
pub mod screen;
mod shadow;
pub mod sort;
pub mod task;
mod work;

use std::{fmt, time::Instant};

use serde::Serialize;

pub use bounds::{BOUNDS, Bound, NEAR_THRESHOLD};
pub use judge::{Breach, Errors, Row};
pub use rates::Rates;
pub use work::{STEPS, work};

use shadow::Shadow;

use crate::{
    error::Result,
    gpu::{Context, DeviceInfo, Recorder},
    report::table::{Cell, Column, Table},
};

/// Selects the cases to run.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    /// Run small cases only: a minute on two CPU cores instead of ten.
    pub quick: bool,
    /// If above 0: compare also with twins that are off by this relative error, to find bounds that do not notice it.
    pub perturb: f64,
}

/// Result of a verification.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The device.
    pub device: DeviceInfo,
    /// Measured rates of the device.
    pub rates: Rates,
    /// Rows in the order of the pipeline.
    pub rows: Vec<Row>,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// Runs all cases.
///
/// # Errors
/// Only if the device cannot run a stage at all; a wrong result is a [`Breach`] of a row.
pub fn run(context: &Context, options: &Options) -> Result<Report> {
    let start = Instant::now();
    let mut bench = Bench::new(context, options.perturb, if options.quick { 3 } else { 9 })?;
    rates::measure(&mut bench)?;
    sort::cases(&bench, options.quick)?;
    model::cases(&bench, options.quick)?;
    raster::cases(&bench, options.quick)?;
    loss::cases(&bench, options.quick)?;
    exposure::cases(&bench, options.quick)?;
    density::cases(&bench, options.quick)?;
    frames::cases(&bench, options.quick)?;
    screen::cases(&bench, options.quick)?;
    lift::cases(&bench, options.quick)?;
    pursuit::cases(&bench, options.quick)?;
    bands::cases(&bench, options.quick)?;
    let rates = bench.rates;
    let rows = bench.into_rows();
    let report = Report { device: context.info().clone(), rates, rows, seconds: start.elapsed().as_secs_f64() };
    Ok(report)
}

/// Runs the fundamental stages on small cases: scan, sort, a picture from scene to gradients, a step. Returns
/// the rows that violate a bound: none on a correct device.
///
/// # Errors
/// Those of [`run`].
pub fn check(context: &Context) -> Result<Vec<Row>> {
    let bench = Bench::new(context, 0.0, 0)?;
    sort::check(&bench)?;
    raster::check(&bench)?;
    let mut rows = bench.into_rows();
    rows.retain(|row| !row.is_ok());
    Ok(rows)
}

/// Runs `work` in a context of the device in which every dispatch is compared with its twin, and returns a row for each stage and variant.
///
/// # Errors
/// Those of `work`; a wrong result is a [`Breach`] of a row.
pub fn judged(context: &Context, work: impl FnOnce(&Context) -> Result<()>) -> Result<Vec<Row>> {
    let bench = Bench::new(context, 0.0, 0)?;
    work(&bench.shadowed)?;
    Ok(bench.into_rows())
}

impl Report {
    /// Number of rows that violate a bound, or whose bounds are blind.
    pub fn broken(&self) -> usize {
        self.rows.iter().filter(|row| !row.is_ok()).count()
    }
}

/// Common state of all cases.
struct Bench<'a> {
    context: &'a Context,
    perturb: f64,
    repeats: usize,
    rates: Rates,
    rows: Vec<Row>,
    /// A second context on the device, in which every dispatch is compared.
    shadowed: Context,
    shadow: Shadow,
}

impl<'a> Bench<'a> {
    /// Times are medians of `repeats` runs after a first one.
    fn new(context: &'a Context, perturb: f64, repeats: usize) -> Result<Self> {
        let shadow = Shadow::new(perturb);
        let shadowed = shadow.context(context)?;
        Ok(Bench { context, perturb, repeats, rates: Rates::default(), rows: Vec::new(), shadowed, shadow })
    }

    /// Runs the recorded stages in the compared context.
    fn run(&self, record: impl FnOnce(&mut Recorder)) -> Result<()> {
        let mut recorder = self.shadowed.recorder("verify")?;
        record(&mut recorder);
        Ok(recorder.submit()?.wait().map(drop)?)
    }

    /// All rows with their verdicts, in the order of the bounds.
    fn into_rows(mut self) -> Vec<Row> {
        self.rows.extend(self.shadow.rows());
        self.rows.sort_by_key(|row| BOUNDS.iter().position(|bound| bound.stage == row.stage));
        self.rows
    }

    /// Adds the row that `compare` makes with a twin off by its argument.
    fn push(&mut self, compare: impl Fn(f64) -> Row) {
        let judged = |perturb| {
            let mut row = compare(perturb);
            row.judge();
            row
        };
        let mut row = judged(0.0);
        row.blind = self.perturb > 0.0 && judged(self.perturb).breaches.is_empty();
        self.rows.push(row);
    }

    /// Times the recorded stages; they must give the same result when repeated.
    fn time(&self, record: impl Fn(&mut Recorder)) -> Result<Times> {
        let mut stages: Vec<(&'static str, Vec<f64>)> = Vec::new();
        let mut whole = Vec::new();
        // The first run warms up and is not counted.
        for run in 0..=self.repeats {
            let mut recorder = self.context.recorder("verify")?;
            recorder.time_stages();
            record(&mut recorder);
            let start = Instant::now();
            let times = recorder.submit()?.wait()?;
            if run == 0 {
                continue;
            }
            whole.push(start.elapsed().as_secs_f64());
            for (i, stage) in times.iter().enumerate() {
                if stages.len() == i {
                    stages.push((stage.name, Vec::new()));
                }
                stages[i].1.push(stage.time.as_secs_f64());
            }
        }
        let stages = stages.into_iter().map(|(name, times)| (name, median(times))).collect();
        Ok(Times { stages, whole: median(whole) })
    }
}

/// Median times of the stages of a recording, in order.
struct Times {
    stages: Vec<(&'static str, f64)>,
    /// Seconds from submission to the end of waiting.
    whole: f64,
}

impl Times {
    /// Seconds per call of a stage; `None` without timestamps.
    fn of(&self, stage: &str) -> Option<f64> {
        let times: Vec<f64> = self.stages.iter().filter(|(name, _)| *name == stage).map(|(_, time)| *time).collect();
        (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64)
    }

    /// Seconds of all calls of all stages; `None` without timestamps.
    fn sum(&self) -> Option<f64> {
        (!self.stages.is_empty()).then(|| self.stages.iter().map(|(_, time)| time).sum())
    }

    /// Seconds of all calls of all stages; wall-clock seconds without timestamps.
    fn whole(&self) -> f64 {
        self.sum().unwrap_or(self.whole)
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// The bounds and their reasons as text.
pub fn explain() -> String {
    let mut text = String::new();
    for b in BOUNDS {
        let limit = |name: &str, v: f64| if v == 0.0 { String::new() } else { format!(", {name} {v:.0e}") };
        let limits = [("max", b.max), ("L2", b.relative_l2), ("bias", b.bias), ("flips", b.flips)];
        let limits: String = limits.into_iter().map(|(name, v)| limit(name, v)).collect();
        let limits = if limits.is_empty() { ", exact".to_owned() } else { limits };
        text += &format!("{}{limits}\n    {}\n", b.stage, b.reason);
    }
    text
}

const COLUMNS: [Column; 10] = [
    Column::new("stage", "", 1),
    Column::new("variant", "", 1),
    Column::new("max", "of largest", 1),
    Column::new("L2", "relative", 1),
    Column::new("1−cos", "", 1),
    Column::new("bias", "", 1),
    Column::new("flips", "", 1),
    Column::new("unequal", "", 1),
    Column::new("time", "µs", 1),
    Column::new("", "", 1),
];

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let d = &self.device;
        writeln!(f, "{} ({}), {}, subgroups of {} lanes", d.name, d.kind, d.driver.version, d.subgroup_size)?;
        writeln!(
            f,
            "copies {:.1} GB/s, computes {:.1} G multiply-adds/s",
            self.rates.bytes / 1e9,
            self.rates.operations / 1e9
        )?;
        let launch = self.rows.iter().find(|row| row.stage == "dispatch_args").and_then(|row| row.time);
        if let Some(launch) = launch {
            writeln!(f, "A dispatch of one thread takes {:.1} µs.", launch * 1e6)?;
        }
        writeln!(f)?;
        let mut table = Table::new(COLUMNS);
        let small = |v: Option<f64>| v.map(|v| if v == 0.0 { "0".to_owned() } else { format!("{v:.1e}") }).into();
        for row in &self.rows {
            let e = &row.errors;
            let verdict = match row.breaches.as_slice() {
                [] if row.blind => "BLIND: no bound notices the perturbed twin".to_owned(),
                [] => "ok".to_owned(),
                [b, ..] => format!("BROKEN: {} {:.1e} > {:.1e}", b.measure, b.value, b.limit),
            };
            table.row([
                row.stage.into(),
                row.variant.clone().into(),
                small(e.max),
                small(e.relative_l2),
                small(e.cosine_loss),
                small(e.bias),
                small(e.flips),
                e.unequal.into(),
                row.time.map(|t| t * 1e6).into(),
                Cell::Text(verdict),
            ]);
        }
        writeln!(f, "{table}")?;
        match self.broken() {
            0 => writeln!(f, "{} rows, all within their bounds; {:.0} s.", self.rows.len(), self.seconds),
            n => writeln!(f, "{n} of {} rows break a bound; {:.0} s.", self.rows.len(), self.seconds),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::gpu::ContextOptions;

    /// float32 does not resolve an error of 1e-12. A wrong integer has a wrong bit, however small the error.
    #[test]
    fn a_bound_that_does_not_notice_an_error_is_blind() {
        let context = Context::new(&ContextOptions::from_env()).unwrap();
        let blind = |perturb| {
            let mut bench = Bench::new(&context, perturb, 0).unwrap();
            raster::check(&bench).unwrap();
            bench.push(|perturb| {
                let mut row = Row::new("fma_rate", "", perturb);
                row.numbers([(1.0, 1.0)]);
                row
            });
            let rows = bench.into_rows();
            assert!(rows.iter().all(|row| row.breaches.is_empty()), "{rows:#?}");
            rows.iter().filter(|row| !row.is_ok()).map(|row| row.stage).collect::<BTreeSet<_>>()
        };
        // The other stages write integers, too.
        assert_eq!(blind(1e-12), BTreeSet::from(["blend", "blend_backward", "fma_rate", "project_backward"]));
        assert_eq!([blind(0.0), blind(2e-3)], [const { BTreeSet::new() }; 2]);
    }
}
