//! Times, memory and plan of runs, as a table for an HTML page.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::html::{escape, scrolling};
use crate::pipelines::spend::Spending;

/// Mean device time of a stage over steps sampled throughout a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StageMean {
    /// Name of the kernel, copy or fill.
    pub name: String,
    /// Device time per step.
    pub milliseconds_per_step: f64,
}

impl StageMean {
    /// Converts the result of [`crate::pipelines::steps::StepReport::milliseconds`].
    pub fn all(milliseconds: &[(&'static str, f64)]) -> Vec<StageMean> {
        let mean =
            |&(name, milliseconds_per_step): &(&str, f64)| StageMean { name: name.into(), milliseconds_per_step };
        milliseconds.iter().map(mean).collect()
    }
}

/// Phases of an augmentation in order: the key in the JSON of `glint enhance`, and the name on a page.
pub const PHASES: [(&str, &str); 6] = [
    ("base", "renders of the base"),
    ("weigh", "weighing"),
    ("place", "placing"),
    ("screen", "screen phase"),
    ("lift", "inverse splatting"),
    ("join", "joint phase"),
];

/// Report of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Run {
    /// Name of the scene that was made.
    pub name: String,
    /// Plan of an augmentation, if Gaussians were added.
    pub plan: Option<Spending>,
    /// Wall time of each phase, seconds.
    pub phases: Vec<(String, f64)>,
    /// Stages of a training step, in the order of their first run; empty if the device has no timestamps.
    pub stages: Vec<StageMean>,
    /// Peak device memory; `None` if unknown.
    pub device_megabytes: Option<f64>,
}

/// Table of all runs side by side; the stages of a step are collapsed. `None` without runs.
pub fn html(runs: &[Run]) -> Option<String> {
    if runs.is_empty() {
        return None;
    }
    let mut phases: Vec<&str> = Vec::new();
    for (phase, _) in runs.iter().flat_map(|run| &run.phases) {
        if !phases.contains(&phase.as_str()) {
            phases.push(phase);
        }
    }
    let mut rows = String::new();
    for phase in phases {
        let seconds = |run: &Run| run.phases.iter().find(|(name, _)| name == phase).map(|(_, seconds)| *seconds);
        rows += &row(runs, &format!("{phase} [s]"), 1, seconds);
    }
    rows += &row(runs, "peak device memory [MB]", 1, |run| run.device_megabytes);
    let all = |run: &Run| run.stages.iter().map(|stage| stage.milliseconds_per_step).sum::<f64>();
    rows += &row(runs, "a step on the device [ms]", 3, |run| Some(all(run)).filter(|all| *all > 0.0));
    let names: String = runs.iter().map(|run| format!("<th>{}</th>", escape(&run.name))).collect();
    let table = |class: &str, rows: &str| {
        scrolling(class, &format!("<thead><tr><th></th>{names}</tr></thead>\n<tbody>{rows}</tbody>"))
    };
    let mut out = table("took", &rows);
    // Stages in descending order of their total time over all runs.
    let mut stages: Vec<(&str, f64)> = Vec::new();
    for stage in runs.iter().flat_map(|run| &run.stages) {
        match stages.iter_mut().find(|(name, _)| *name == stage.name) {
            Some((_, sum)) => *sum += stage.milliseconds_per_step,
            None => stages.push((&stage.name, stage.milliseconds_per_step)),
        }
    }
    stages.sort_by(|a, b| b.1.total_cmp(&a.1));
    if !stages.is_empty() {
        let time = |run: &Run, name: &str| run.stages.iter().find(|s| s.name == name).map(|s| s.milliseconds_per_step);
        let rows: String = stages.iter().map(|(name, _)| row(runs, name, 3, |run| time(run, name))).collect();
        let stages = table("stages", &rows);
        let _ = writeln!(out, "<details><summary>the stages of a step [ms]</summary>\n{stages}</details>");
    }
    Some(out)
}

/// Row with a value of each run; empty if no run has one.
fn row(runs: &[Run], what: &str, decimals: usize, value: impl Fn(&Run) -> Option<f64>) -> String {
    let values: Vec<Option<f64>> = runs.iter().map(value).collect();
    if values.iter().all(Option::is_none) {
        return String::new();
    }
    let shown = |value: &Option<f64>| value.map_or_else(String::new, |value| format!("{value:.decimals$}"));
    let cells: String = values.iter().map(|value| format!("<td>{}</td>", shown(value))).collect();
    format!("<tr><td>{}</td>{cells}</tr>\n", escape(what))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_lie_side_by_side_and_what_took_longest_comes_first() {
        let run = |name: &str, phase: &str, stages: &[(&'static str, f64)], device_megabytes| Run {
            name: name.into(),
            phases: vec![(phase.into(), 3.25)],
            stages: StageMean::all(stages),
            device_megabytes,
            plan: None,
        };
        let runs = [
            run("more & more", "a<b", &[("emit", 1.0), ("blend", 3.0)], Some(12.34)),
            run("other", "joint phase", &[("sort", 0.5)], None),
        ];
        let page = html(&runs).unwrap();
        let rows = [
            "<th>more &amp; more</th><th>other</th>",
            "<td>a&lt;b [s]</td><td>3.2</td><td></td>",
            "<td>joint phase [s]</td><td></td><td>3.2</td>",
            "<td>peak device memory [MB]</td><td>12.3</td><td></td>",
            "<td>a step on the device [ms]</td><td>4.000</td><td>0.500</td>",
            "<details>",
            "<td>blend</td><td>3.000</td><td></td>",
            "<td>emit</td><td>1.000</td><td></td>",
            "<td>sort</td><td></td><td>0.500</td>",
        ];
        let found: Vec<_> = rows.iter().map(|row| page.find(row)).collect();
        assert!(found.iter().all(Option::is_some) && found.is_sorted(), "{found:?} in {page}");
        // A device without timestamps, and no runs at all.
        let untimed = html(&[Run { stages: Vec::new(), ..runs[0].clone() }]).unwrap();
        assert!(!untimed.contains("a step") && !untimed.contains("details"), "{untimed}");
        assert_eq!(html(&[]), None);
    }
}
