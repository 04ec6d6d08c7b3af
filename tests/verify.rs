//! `glint verify`: it passes on the test device, and it can fail.

mod common;
#[path = "common/run.rs"]
mod run;

use std::{collections::BTreeSet, time::Duration};

use common::Gpu;
use glint::{
    stages::NAMES,
    verify::{self, BOUNDS, Options},
};

/// Every stage is named after its kernel; the whole of rendering is in brackets. No bound is loose enough to
/// hide a twin that is off by two thousandths, by one bit, or (for results that are sets) by two pixels.
#[test]
fn every_stage_passes_and_every_bound_can_fail() {
    let gpu = Gpu::new();
    let report = verify::run(&gpu, &Options { quick: true, perturb: 2e-3 }).unwrap();
    println!("{report}");
    assert_eq!(report.broken(), 0, "{report}");
    let seen: BTreeSet<&str> = report.rows.iter().map(|row| row.stage).collect();
    // One kernel is only for devices with float atomics.
    let tried = |stage: &str| gpu.info().float_atomics || stage != "blend_backward_atomic";
    assert_eq!(seen, BOUNDS.iter().map(|bound| bound.stage).filter(|stage| tried(stage)).collect());
    let missing: Vec<_> = NAMES.iter().filter(|stage| tried(stage) && !seen.contains(*stage)).collect();
    assert!(missing.is_empty(), "not verified: {missing:?}");
    for row in &report.rows {
        assert!(row.errors.relative_l2.is_some() || row.errors.unequal.is_some(), "nothing was compared: {row:?}");
    }
    assert!(serde_json::to_string(&report).unwrap().contains("\"blend_backward\""));
}

fn glint(arguments: &[&str]) -> std::process::Output {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_glint"));
    // All stages in all variants, on two cores shared with another test.
    run::run_within(Duration::from_secs(900), command.arg("verify").args(arguments))
}

#[test]
fn the_command_explains_its_bounds() {
    let explained = glint(&["--explain"]);
    let text = String::from_utf8(explained.stdout).unwrap();
    assert!(explained.status.success() && BOUNDS.iter().all(|bound| text.contains(bound.reason)));
}

/// The first steps on a dataset have a row for each stage of training, and a fault is seen in every one of them.
#[test]
fn training_on_a_dataset_is_verified() {
    let folder = tempfile::tempdir().unwrap();
    let photos = folder.path().join("photos");
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_glint"));
    let made = run::run(command.args("synth mixed --views 9 --size 24 --points 80 -o".split(' ')).arg(&photos));
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let judged = glint(&[photos.to_str().unwrap(), "--json", "--perturb", "2e-3"]);
    assert_eq!(judged.status.code(), Some(0), "{}", String::from_utf8_lossy(&judged.stderr));
    let json: serde_json::Value = serde_json::from_slice(&judged.stdout).unwrap();
    let rows = json["rows"].as_array().unwrap();
    let seen: BTreeSet<&str> = rows.iter().map(|row| row["stage"].as_str().unwrap()).collect();
    let of_training = ["project", "blend", "ssim_forward", "blend_backward", "project_backward", "density_apply"];
    assert!(of_training.iter().all(|stage| seen.contains(stage)), "{seen:?}");
}
