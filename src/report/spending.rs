//! Plan of an augmentation as text and HTML.

use std::fmt::Write;

use super::{
    html::escape,
    table::{Cell, Column, Table},
};
use crate::{
    data::counted,
    pipelines::spend::{Candidates, Spending, Spent},
};

/// Table of gains for each use of the budget.
fn table(plan: &Spending) -> Table {
    let mut table = Table::new([
        Column::new("spent on", "", 0),
        Column::new("worth something", "", 0),
        Column::new("placed at first", "", 0),
        Column::new("gain", "dB", 3),
        Column::new("a thousand", "dB", 3),
        Column::new("a megabyte", "dB", 3),
        Column::new("a second", "dB", 3),
    ]);
    let kinds = [
        ("Gaussians with lobes", &plan.lobes, true),
        ("the same without lobes", &plan.without_lobes, false),
        ("plain Gaussians", &plan.plain, true),
        ("bands for Gaussians of the base", &plan.bands, true),
    ];
    for (what, spent, is_placed) in kinds.into_iter().filter(|(_, spent, _)| spent != &&plan.bands || spent.placed > 0)
    {
        let &Spent { chosen, placed, gain_db, db_per_thousand, db_per_megabyte, db_per_second } = spent;
        let counts = [chosen, placed].map(|count| if is_placed { Cell::Count(count.into()) } else { Cell::Absent });
        let per_second = db_per_second.map_or(Cell::Absent, Cell::Number);
        let gains = match placed {
            0 => vec![],
            _ => {
                [gain_db, db_per_thousand, db_per_megabyte].map(Cell::Number).into_iter().chain([per_second]).collect()
            }
        };
        table.row(std::iter::once(Cell::from(what)).chain(counts).chain(gains));
    }
    if let Some(gain) = plan.training_on_db {
        let per_second = plan.training_on_db_per_second.map_or(Cell::Absent, Cell::Number);
        let name = format!("longer training, {} steps", plan.steps).into();
        let nothing = || Cell::Absent;
        table.row([name, nothing(), nothing(), gain.into(), nothing(), nothing(), per_second]);
    }
    table
}

/// Sentences on the planned Gaussians, the candidates left out, and the meaning of gains.
fn sentences(plan: &Spending) -> [String; 3] {
    let &Spending { gaussians_allowed, bytes_allowed, placements, steps, candidates, .. } = plan;
    let Candidates { drawn, no_gain, below_training_on: below, beyond } = candidates;
    let bytes = bytes_allowed.map_or(String::new(), |bytes| format!(" in {bytes} bytes"));
    let later = match placements.saturating_sub(1) {
        0 => String::new(),
        1 => ", the rest in a later placement".into(),
        more => format!(", the rest in {more} later placements"),
    };
    let banded = plan.bands.placed;
    let does = if plan.placed() == 0 && banded > 0 {
        format!("no Gaussian is added{bytes}; {banded} get bands, then everything learns for {steps} steps")
    } else if plan.placed() == 0 {
        format!("at most {gaussians_allowed} Gaussians{bytes} may be added; none is, and the scene is unchanged")
    } else {
        format!(
            "at most {gaussians_allowed} Gaussians{bytes} may be added: {} now{later}; then everything learns for {}",
            plan.placed(),
            counted(steps as usize, "step")
        )
    };
    let mut reasons = vec![format!("{no_gain} that gain nothing in all photos together or overlap better ones")];
    if plan.least_db_per_thousand > 0.0 {
        let least = plan.least_db_per_thousand;
        reasons.push(format!("{below} that gain less than longer training would ({least:.3} dB a thousand)"));
    }
    if beyond > 0 {
        reasons.push(format!("{beyond} beyond the budget of the first placement"));
    }
    let left_out = format!("left out of {drawn} candidates: {}", reasons.join(", "));
    let gains = "gains are predictions on the training photos, before anything learns".to_owned();
    [does, left_out, gains]
}

/// Formats the plan as text.
pub fn text(plan: &Spending) -> String {
    let [does, left_out, gains] = sentences(plan);
    format!("plan: {does}\n{}\n{left_out}\n{gains}\n", table(plan))
}

/// Formats the plan as HTML.
pub fn html(plan: &Spending) -> String {
    let mut out = format!("<pre class=\"plan\">{}</pre>\n", escape(&table(plan).to_string()));
    for sentence in sentences(plan) {
        let _ = writeln!(out, "<p>{}</p>", escape(&sentence));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_tells_what_is_done_and_what_is_left_out() {
        let spent = Spent {
            chosen: 9,
            placed: 4,
            gain_db: 0.25,
            db_per_thousand: 62.5,
            db_per_megabyte: 5.0,
            db_per_second: Some(0.75),
        };
        let plan = Spending {
            gaussians_allowed: 10,
            gaussians_at_first: 5,
            bytes_allowed: Some(2_000_000),
            placements: 3,
            steps: 600,
            training_on_db: Some(0.125),
            training_on_db_per_second: Some(0.0156),
            least_db_per_thousand: 0.5,
            lobes: spent,
            without_lobes: Spent { gain_db: 0.0625, ..spent },
            plain: Spent::default(),
            bands: Spent { chosen: 77, placed: 77, ..spent },
            candidates: Candidates { drawn: 120, no_gain: 111, below_training_on: 3, beyond: 2 },
        };
        let said = text(&plan);
        for part in [
            "at most 10 Gaussians in 2000000 bytes may be added: 4 now",
            "the rest in 2 later placements",
            "0.250",
            "bands for Gaussians of the base",
            "the same without lobes",
            "0.062",
            "62.500",
            "0.750",
            "0.016",
            "longer training, 600 steps",
            "0.125",
            "left out of 120 candidates: 111 that gain nothing",
            "3 that gain less than longer training would (0.500 dB a thousand)",
            "2 beyond the budget",
        ] {
            assert!(said.contains(part), "`{part}` is not in: {said}");
        }
        let bands = Spent::default();
        let none = Spending { lobes: Spent { placed: 0, ..spent }, training_on_db: None, bands, ..plan.clone() };
        assert!(!text(&none).contains("bands"));
        assert!(text(&none).contains("the scene is unchanged") && !text(&none).contains("longer training,"));
        assert!(html(&plan).contains("the same without lobes") && html(&plan).contains("<p>left out of 120"));
    }
}
