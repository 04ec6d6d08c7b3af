//! Twins that stand in for stages.

mod common;

use common::Gpu;
use glint::{
    gpu::{ContextOptions, Twin},
    reference::twins,
    verify::{Options, run},
};

fn with(twins: &[Twin]) -> Gpu {
    Gpu::with(ContextOptions { twins: twins.to_vec(), ..ContextOptions::from_env() })
}

#[test]
fn a_device_of_twins_passes() {
    let gpu = with(twins());
    let report = run(&gpu, &Options { quick: true, perturb: 0.0 }).unwrap();
    println!("{report}");
    assert_eq!(report.broken(), 0, "{report}");
}
