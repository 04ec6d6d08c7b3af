#![no_main]

use std::path::Path;

use glint::data::FileKind;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = FileKind::Safetensors.check(bytes, Path::new("safetensors"));
});
