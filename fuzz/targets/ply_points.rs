#![no_main]

use std::path::Path;

use glint::data::FileKind;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = FileKind::PlyPoints.check(bytes, Path::new("ply_points"));
});
