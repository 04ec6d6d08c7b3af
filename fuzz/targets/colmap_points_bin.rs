#![no_main]

use std::path::Path;

use glint::data::FileKind;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = FileKind::ColmapPointsBin.check(bytes, Path::new("colmap_points_bin"));
});
