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

#[test]
#[ignore = "writes files, for a look at them"]
fn full_verify_to_files() {
    let gpu = Gpu::new();
    let quick = std::env::var_os("QUICK").is_some();
    let report = run(&gpu, &Options { quick, perturb: 0.0 }).unwrap();
    println!("{report}");
    let out = std::path::PathBuf::from(std::env::var_os("OUT").unwrap());
    glint::verify::plot(&report, &out.join("verify.svg")).unwrap();
    std::fs::write(out.join("verify.json"), serde_json::to_string_pretty(&report).unwrap()).unwrap();
}
