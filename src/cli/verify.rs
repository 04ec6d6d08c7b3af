use std::path::PathBuf;

use super::{DeviceArgs, Failure, Outcome, check_output, print, print_json};
use crate::verify::{Options, explain, plot, run};

/// Judge a device and its driver: every stage against float64, beside its time and what that could be
///
/// Needs no data. Prints a table with a row for each stage in each variant that can be chosen; exit code 1 when a bound is
/// broken.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(flatten)]
    device: DeviceArgs,
    /// Small cases only: less than a minute on two CPU cores, where all take some minutes
    #[arg(long)]
    quick: bool,
    /// Print JSON: {"device","rates","rows":[{"stage","variant","chosen","errors","breaches","time","work","floor"}],"seconds"};
    /// times in seconds
    #[arg(long)]
    json: bool,
    /// Write an SVG with error on one axis and time on the other, one labelled point for each row
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    /// Print the bounds and their reasons, and do nothing else
    #[arg(long, conflicts_with_all = ["quick", "json", "plot"])]
    explain: bool,
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        if self.explain {
            return Ok(print(explain())?);
        }
        if let Some(path) = &self.plot {
            check_output(path)?;
        }
        self.device.with(|context| {
            let report = run(context, &Options { quick: self.quick, perturb: 0.0 })?;
            if self.json {
                print_json(&report)?;
            } else {
                print(&report)?;
            }
            if let Some(path) = &self.plot {
                plot(&report, path)?;
            }
            match report.broken() {
                0 => Ok(()),
                count => Err(Failure::Bounds(count)),
            }
        })
    }
}
