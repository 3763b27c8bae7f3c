#![no_main]

#[path = "../../../tests/house/fuzz.rs"]
#[allow(dead_code)] // each target has one of its functions
mod readers;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| readers::imported(bytes));
