//! Same scenario, same bits: over runs, thread counts, ways to talk, and builds.

#[path = "support/program.rs"]
mod program;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use program::{TAUTLINE, ran_by};
use serde_json::Value;
use tempfile::TempDir;

/// `state_hash` of the built-in scenarios. They may change with the engine's version, with what a built-in says, with
/// the law's arithmetic, and with what [`tautline::record::StateHash`] covers: each time for a reason that the changelog
/// gives. They may not change with the machine, the build, the time or the number of threads.
const GOLDEN: [(&str, &str); 4] = [
    ("pentagon", "7615129a80f129fa3eb772a3ef1430d60819b00334b64597c504ea42c3acc46f"),
    ("circle", "f94651af9f9a3a81544b762e699281707c78c9d932660930cf9d234a51b51522"),
    ("pentagon-laplacian", "c0096256d218ee13af80fe90e90d6c2bf17f78139afbba67a7869fefb54c17c3"),
    ("pentagon-collinear", "4e420d87d4604615aed1f0e8cd5a5ca268a70902d4db4c7efb439ae723998672"),
];

/// A hundred vehicles, from which law and audit run side by side where there are two threads.
const HUNDRED: &str = r#"name = "hundred"
[swarm]
count = 100
a22_per_s = 0.1
[start]
shape = "grid"
spacing_m = 3.0
jitter_m = 0.2
seed = 1
[formation]
shape = "circle"
radius_m = 40.0
[law]
kind = "edge-tension"
delta_m = 2.0
[time]
duration_s = 1.0
"#;

/// A run by one build of the program, into a folder of its own.
struct Runs {
    folder: TempDir,
    count: usize,
}

impl Runs {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder for the runs");
        fs::write(folder.path().join("hundred.toml"), HUNDRED).expect("a scenario file");
        Self { folder, count: 0 }
    }

    /// The hash of the states and the whole recording.
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
fn three_runs_any_thread_count_and_any_talk_give_the_same_recording_byte_for_byte() {
    let mut runs = Runs::new();
    for scenario in ["pentagon", "hundred.toml"] {
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
fn another_start_by_one_bit_gives_another_hash() {
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

/// The program built by the other profile, and kept up to date: release for a debug build under test, and the reverse.
fn other_build() -> PathBuf {
    let folder = Path::new(TAUTLINE).parent().expect("a folder");
    let target = folder.parent().expect("the target folder");
    let (profile, other) = if folder.ends_with("release") { ("dev", "debug") } else { ("release", "release") };
    let built = Command::new(env!("CARGO"))
        .args(["build", "--quiet", "--bin", "tautline", "--profile", profile, "--target-dir"])
        .arg(target)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .status();
    assert!(built.expect("cargo").success(), "the {profile} build of the program");
    target.join(other).join("tautline").with_extension(std::env::consts::EXE_EXTENSION)
}

#[test]
fn debug_and_release_builds_fly_the_same_bits() {
    let mut runs = Runs::new();
    let other = other_build();
    let other = other.to_str().expect("a path in UTF-8");
    for scenario in ["pentagon", "hundred.toml"] {
        let (here, there) = (runs.run(TAUTLINE, scenario, &[]), runs.run(other, scenario, &[]));
        assert_eq!(here.0, there.0, "{scenario}");
        assert!(here.1 == there.1, "{scenario}: the recordings differ");
    }
}
