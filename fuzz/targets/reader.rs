//! Reads arbitrary bytes as a recording.
//!
//! The variable `TAUTLINE_FUZZ` names the reader, such as `csv`; `recording` stands for the recognition of formats.

#![no_main]

use std::fs;
use std::panic;
use std::path::PathBuf;
use std::process;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use tautline_recordings::read::{Format, ReadOptions, is_guarded};

#[path = "../../crates/recordings/tests/recordings/contract.rs"]
mod contract;

/// Reader and scratch file of this process.
static SETTING: LazyLock<(ReadOptions, PathBuf)> = LazyLock::new(|| {
    // The fuzzer aborts at any panic, but the reader of Parquet turns panics of its library into errors.
    let abort = panic::take_hook();
    panic::set_hook(Box::new(move |panic| {
        if !is_guarded() {
            abort(panic);
        }
    }));
    let name = std::env::var("TAUTLINE_FUZZ").expect("TAUTLINE_FUZZ: the name of a reader, such as csv");
    let format = Format::all().find(|format| format.name == name);
    assert!(format.is_some() || name == "recording", "{name}: no such reader");
    // Only this reader needs the rate of frames.
    let times_per_second = (name == "trajnet").then_some(30.0);
    let options = ReadOptions { format, times_per_second, ..ReadOptions::default() };
    (options, std::env::temp_dir().join(format!("tautline-fuzz-{name}-{}", process::id())))
});

fuzz_target!(|bytes: &[u8]| {
    let (options, path) = &*SETTING;
    fs::write(path, bytes).expect("the scratch file is writable");
    for allow_unfinished in [false, true] {
        let options = ReadOptions { allow_unfinished, ..options.clone() };
        if let Err(fault) = contract::read_whole(path, &options) {
            panic!("{fault}");
        }
    }
});
