#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| glint_fuzz::judge(env!("CARGO_BIN_NAME"), bytes));
