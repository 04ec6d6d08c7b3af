//! What holds of the code as a whole.

mod common;

use std::{fs, path::Path};

use common::Gpu;
use glint::{
    gpu::Buffer,
    reference::step_done::step_done,
    stages::step_done::{self as stage, StepDone},
};

fn files(folder: &Path, extension: &str, into: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, extension, into);
        } else if path.extension().is_some_and(|e| e == extension) {
            into.push(path);
        }
    }
}

#[test]
fn every_kernel_has_a_stage_and_a_twin_of_its_name() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut kernels = Vec::new();
    files(&root.join("glsl"), "comp", &mut kernels);
    assert!(kernels.len() > 25);
    // `tests/verify.rs` holds that each stage is compared with its twin.
    for kernel in kernels {
        let name = kernel.file_stem().unwrap().to_str().unwrap();
        for place in ["src/stages", "src/reference"] {
            assert!(root.join(place).join(format!("{name}.rs")).exists(), "{name} has no {place}/{name}.rs");
        }
    }
}

#[test]
fn unsafe_code_is_in_the_vulkan_layer_only() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut sources = Vec::new();
    files(&root.join("src"), "rs", &mut sources);
    for path in sources.iter().filter(|p| !p.starts_with(root.join("src/gpu"))) {
        let text = fs::read_to_string(path).unwrap();
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        assert!(!code.into_iter().any(|line| line.contains("unsafe {") || line.contains("unsafe fn")), "{path:?}");
    }
}

#[test]
fn steps_are_counted_as_the_twin_counts_them() {
    let gpu = Gpu::new();
    let counter = StepDone::new(&gpu, &stage::Spec { workgroup_size: 1 }).unwrap();
    for start in [[0, 0], [0, 41], [9, 41]] {
        let status = Buffer::from_slice(&gpu, "status", &start).unwrap();
        let mut recorder = gpu.recorder("steps").unwrap();
        let mut twin = start;
        for _ in 0..3 {
            counter.record(&mut recorder, &stage::Buffers { status: &status });
            step_done(&mut twin);
        }
        recorder.submit().unwrap().wait().unwrap();
        assert_eq!(status.download().unwrap(), twin);
    }
}
