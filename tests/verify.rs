//! `glint verify` as a library: it passes on the test device, and it can fail.

mod common;

use common::Gpu;
use glint::verify::{Options, run};

#[test]
fn quick_verify_passes() {
    let gpu = Gpu::new();
    let report = run(&gpu, &Options { quick: true, perturb: 0.0 }).unwrap();
    println!("{report}");
    assert!(report.passed(), "{report}");
}
