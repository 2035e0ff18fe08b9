#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| depthcal_fuzz::targets::run("db3", bytes));
