//! Reads arbitrary text as a scenario, resolves it and reads the result again.

#![no_main]

use std::fs;
use std::path::PathBuf;
use std::process;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use tautline_sim::scenario::{Scenario, Source};

/// Scratch file of this process.
static PATH: LazyLock<PathBuf> =
    LazyLock::new(|| std::env::temp_dir().join(format!("tautline-fuzz-scenario-{}.toml", process::id())));

fuzz_target!(|bytes: &[u8]| {
    fs::write(&*PATH, bytes).expect("the scratch file is writable");
    let source = Source::resolve(PATH.to_str().expect("UTF-8")).expect("the scratch file exists");
    match Scenario::read(&source, &[]) {
        Ok(scenario) => {
            // A resolved scenario states every key and describes the same flight.
            let resolved = scenario.resolved().toml;
            fs::write(&*PATH, &resolved).expect("the scratch file is writable");
            let again = Scenario::read(&source, &[]).expect("a resolved scenario is valid");
            assert_eq!(again.resolved().toml, resolved, "a resolved scenario changes when it is read");
        }
        Err(error) => assert!(!error.message.is_empty(), "an error without a text"),
    }
});
