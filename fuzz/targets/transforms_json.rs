#![no_main]

use std::path::Path;

use glint::data::FileKind;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = FileKind::TransformsJson.check(bytes, Path::new("transforms_json"));
});
