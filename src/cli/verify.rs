//! `glint verify`: judges a device and its driver, every kernel against float64.

use super::{DeviceArgs, Failure, Outcome, print, print_json};
use crate::verify::{Options, explain, run};

/// Check a device and its driver: every stage's error against float64, and its time against what the hardware allows
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
    /// Show that the bounds notice: put this relative error into every reference result, upon which rows must break; with 0.002
    /// all do
    #[arg(long, value_name = "ERROR", default_value_t = 0.0, hide_default_value = true, value_parser = parse_error)]
    perturb: f64,
    /// Print the bounds and their reasons, and do nothing else
    #[arg(long, conflicts_with_all = ["quick", "json", "perturb"])]
    explain: bool,
}

fn parse_error(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|e| (0.0..=1.0).contains(e)).ok_or_else(|| "expected a number from 0 to 1".into())
}

impl Args {
    pub(super) fn run(&self) -> Outcome {
        if self.explain {
            return Ok(print(explain())?);
        }
        self.device.with_unchecked(|context| {
            let report = run(context, &Options { quick: self.quick, perturb: self.perturb })?;
            if self.json {
                print_json(&report)?;
            } else {
                print(&report)?;
            }
            match report.broken() {
                0 => Ok(()),
                count => Err(Failure::Bounds(count)),
            }
        })
    }
}
