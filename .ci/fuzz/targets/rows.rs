#![no_main]

#[path = "../readers.rs"]
#[allow(dead_code)] // each target has one of its functions
mod readers;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| readers::rows(bytes));
