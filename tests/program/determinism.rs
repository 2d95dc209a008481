//! Equal bits for equal scenarios, over runs, numbers of threads and output options. Over builds:
//! `crates/sim/tests/bits.rs`.

use std::fs;

use crate::program::{TAUTLINE, ran_by};
use serde_json::Value;
use tempfile::TempDir;

/// `state_hash` of built-in scenarios; that of `pentagon` is in `crates/sim/tests/bits.rs`.
///
/// The hashes may change with the version of the engine, the built-in scenarios, the arithmetic of the law, and the
/// coverage of [`tautline::record::StateHash`]; the changelog gives the reason. They may not change with the machine,
/// the build, the time or the number of threads.
const GOLDEN: [(&str, &str); 3] = [
    ("circle", "7c996884f60a7c94d0282adaf8ab57a7a999fca017b5c76aac033b7687045a96"),
    ("pentagon-laplacian", "d119c0b8f6301a5a56b0466c6b04bfdd9155c0979d3f37768febca5c68b40dbd"),
    ("pentagon-collinear", "153897ed935659071f997f590ec2f84e2fbaef17be8299cdfadaa78a84462762"),
];

/// Enough vehicles for law and audit to run in parallel on two threads.
const MANY: &str = r#"name = "many"
[swarm]
count = 520
a22_per_s = 0.1
[start]
shape = "grid"
spacing_m = 3.0
jitter_m = 0.2
seed = 1
[formation]
shape = "circle"
radius_m = 200.0
[law]
kind = "edge-tension"
delta_m = 2.0
[time]
duration_s = 0.1
[arrival]
hold_s = 0.1
"#;

/// Runs of one build of the program, each into its own folder.
struct Runs {
    folder: TempDir,
    count: usize,
}

impl Runs {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder for the runs");
        fs::write(folder.path().join("many.toml"), MANY).expect("a scenario file");
        Self { folder, count: 0 }
    }

    /// Returns the hash of the states and the whole recording.
    fn run(&mut self, program: &str, scenario: &str, more: &[&str]) -> (String, Vec<u8>) {
        self.count += 1;
        let out = format!("out-{}", self.count);
        let ran = ran_by(program, self.folder.path(), &[&["run", scenario, "--out", &out], more].concat());
        assert!(matches!(ran.exit, Some(0 | 1)), "{}{}", ran.out, ran.err);
        let out = self.folder.path().join(out);
        let report = fs::read_to_string(out.join("report.json")).expect("a report");
        let report: Value = serde_json::from_str(&report).expect("JSON");
        let hash = report["run"]["state_hash"].as_str().expect("a hash").to_owned();
        (hash, fs::read(out.join("run.mcap")).expect("a recording"))
    }
}

#[test]
fn recordings_are_equal_for_any_number_of_threads_and_any_output() {
    let mut runs = Runs::new();
    for scenario in ["pentagon", "many.toml"] {
        let (hash, recording) = runs.run(TAUTLINE, scenario, &["--threads", "2"]);
        let ways: [&[&str]; 5] =
            [&["--threads", "2"], &["--threads", "2"], &["--threads", "1"], &["--quiet"], &["--json", "--quiet"]];
        for more in ways {
            let again = runs.run(TAUTLINE, scenario, more);
            assert_eq!(again.0, hash, "{scenario} {more:?}");
            assert!(again.1 == recording, "{scenario} {more:?}: the recordings differ");
        }
    }
}

#[test]
fn a_start_that_differs_by_one_bit_has_another_hash() {
    let mut runs = Runs::new();
    let [plain, nudged] = ["duration_s=1", "dt_s=0.00416666666666666755"]
        .map(|set| runs.run(TAUTLINE, "pentagon", &["--set", "time.duration_s=1", "--set", &format!("time.{set}")]).0);
    assert_ne!(plain, nudged);
}

#[test]
fn the_built_in_scenarios_have_their_golden_hashes() {
    let mut runs = Runs::new();
    let found = GOLDEN.map(|(name, _)| (name, runs.run(TAUTLINE, name, &["--quiet"]).0));
    assert_eq!(found.each_ref().map(|(name, hash)| (*name, hash.as_str())), GOLDEN);
}
