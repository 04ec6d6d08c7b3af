//! What a run was to do, how long it took and what it held, for a page.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::{
    page::escape,
    spending,
    table::{Column, Table},
};
use crate::pipelines::spend::Spending;

/// Mean device time of a stage over steps all through a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageMean {
    /// Of the kernel, or what a copy or fill is called.
    pub name: String,
    /// On the device.
    pub milliseconds_per_step: f64,
}

impl StageMean {
    /// As [`crate::pipelines::steps::StepReport::milliseconds`] has them.
    pub fn all(milliseconds: &[(&'static str, f64)]) -> Vec<StageMean> {
        let mean =
            |&(name, milliseconds_per_step): &(&str, f64)| StageMean { name: name.into(), milliseconds_per_step };
        milliseconds.iter().map(mean).collect()
    }
}

/// What is told of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Run {
    /// What was made.
    pub name: String,
    /// What was to be spent on which, where something was added.
    pub plan: Option<Spending>,
    /// Seconds of each phase by the clock.
    pub phases: Vec<(String, f64)>,
    /// Of a step in which Gaussians learn, in the order in which they first run; empty where the device has no timestamps.
    pub stages: Vec<StageMean>,
    /// The most that the device held; `None` where that is not known.
    pub device_megabytes: Option<f64>,
}

/// As a page shows it.
pub fn html(run: &Run) -> String {
    let mut out = run.plan.as_ref().map_or_else(String::new, |plan| spending::html(&run.name, plan));
    let _ = writeln!(out, "<h2>Time and memory of {}</h2>", escape(&run.name));
    let phases = run.phases.iter().map(|(phase, seconds)| format!("{} {seconds:.1} s", escape(phase)));
    let held = run.device_megabytes.map(|megabytes| format!("{megabytes:.1} MB held on the device at most"));
    let _ = writeln!(out, "<p class=\"took\">{}</p>", phases.chain(held).collect::<Vec<_>>().join(", "));
    let all: f64 = run.stages.iter().map(|stage| stage.milliseconds_per_step).sum();
    if all > 0.0 {
        let column = |key, title, unit, decimals| Column { key, title, unit, decimals };
        let mut table = Table::new([
            column("stage", "stage of a step", "", 0),
            column("ms", "on the device", "ms", 3),
            column("share", "share", "%", 1),
        ]);
        let mut stages: Vec<&StageMean> = run.stages.iter().collect();
        stages.sort_by(|a, b| b.milliseconds_per_step.total_cmp(&a.milliseconds_per_step));
        for StageMean { name, milliseconds_per_step } in stages {
            table.row([
                name.as_str().into(),
                (*milliseconds_per_step).into(),
                (100.0 * milliseconds_per_step / all).into(),
            ]);
        }
        table.row(["all".into(), all.into(), 100.0.into()]);
        let _ = writeln!(out, "<pre class=\"stages\">{}</pre>", escape(&table.to_string()));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_took_longest_comes_first() {
        let stages = StageMean::all(&[("emit", 1.0), ("blend", 3.0)]);
        let phases = vec![("placing".into(), 3.25), ("a<b".into(), 1.0)];
        let run = Run { name: "more & more".into(), phases, stages, device_megabytes: Some(12.34), ..Run::default() };
        let page = html(&run);
        for part in ["of more &amp; more</h2>", "placing 3.2 s, a&lt;b 1.0 s, 12.3 MB", "75.0", "4.000"] {
            assert!(page.contains(part), "`{part}` is not in: {page}");
        }
        assert!(page.find("blend") < page.find("emit"));
        // A device without timestamps.
        assert!(!html(&Run { stages: Vec::new(), ..run }).contains("<pre"));
    }
}
