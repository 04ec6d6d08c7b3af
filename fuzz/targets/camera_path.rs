#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| glint_fuzz::judge(glint::data::FileKind::CameraPath, bytes));
