//! A recording of a run has the verdict of the run, as long as it is what the run wrote.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tautline::mcap::{Entry, McapRecorder, McapRecording};
use tautline::record::Sink as _;
use tempfile::TempDir;

use crate::program::{Ran, TAUTLINE, ran_by};

/// Every built-in scenario, and for how long it is flown where tests are short \[s\].
const BUILT_IN: [(&str, &str); 12] = [
    ("pentagon", "4"),
    ("circle", "2"),
    ("pentagon-laplacian", "5"),
    ("pentagon-collinear", "2"),
    ("pentagon-leader", "2"),
    ("leader-lossy", "10"),
    ("swap", "2"),
    ("show", "0.2"),
    ("thousand", "0.2"),
    ("obstacles", "2"),
    ("gusts", "26"),
    ("crazyflies", "1"),
];

fn fly(folder: &Path, scenario: &str, sets: &[&str]) {
    let fixed = ["run", scenario, "--out", "flown", "--no-snapshots", "--no-figures", "--quiet", "--force"];
    let sets = sets.iter().flat_map(|set| ["--set", set]);
    let ran = ran_by(TAUTLINE, folder, &fixed.into_iter().chain(sets).collect::<Vec<_>>());
    assert!(matches!(ran.exit, Some(0 | 1)), "{scenario}: {ran:?}");
}

fn audit(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, &[&["audit"], arguments].concat())
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON alone")
}

fn pentagon() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fly(folder.path(), "pentagon", &["time.duration_s=4", "arrival.hold_s=4"]);
    folder
}

#[test]
fn the_recordings_of_all_built_in_scenarios_have_the_verdicts_of_their_runs() {
    let is_long = std::env::var_os("TAUTLINE_LONG").is_some();
    for (scenario, duration_s) in BUILT_IN {
        let folder = tempfile::tempdir().expect("a folder");
        let short = ["time.duration_s", "arrival.hold_s"].map(|key| format!("{key}={duration_s}"));
        // A debug build flies all of `thousand` for longer than a test may take.
        let is_whole = is_long && scenario != "thousand";
        let sets: Vec<&str> = short.iter().filter(|_| !is_whole).map(String::as_str).collect();
        fly(folder.path(), scenario, &sets);
        let report = json(&fs::read_to_string(folder.path().join("flown/report.json")).expect("a report"));
        let judged = audit(folder.path(), &["flown", "--json"]);
        let found = json(&judged.out);
        assert_eq!(found["status"], report["audit"]["status"], "{scenario}: {judged:?}");
        for key in ["delta_m", "min_m", "min_pair", "min_at_s"] {
            // Around ellipsoids the run counts in its delta, and the audit in half axes.
            if report["separation"]["ellipsoid"].is_null() {
                assert_eq!(found["separation"][key], report["separation"][key], "{scenario}: {key}");
            }
        }
        if found["status"] == "clear" {
            let is_word = found["audit"]["judged_by_run"] == true || found["audit"]["proved"] == true;
            assert!(is_word && found["audit"]["assumes"].is_null(), "{scenario}: {}", found["audit"]);
        }
    }
}

#[test]
fn a_recording_is_clear_as_its_run_judged_and_says_so() {
    let folder = pentagon();
    let judged = audit(folder.path(), &["flown"]);
    assert_eq!(judged.exit, Some(0), "{judged:?}");
    let said = "CLEAR as the run judged every step: never closer than 2.460355 m, 2 and 3 at 2.15 s (delta 2.000 m); from 0.000 s to 4.000 s";
    assert_eq!(judged.out.lines().next(), Some(said));
    let found = json(&audit(folder.path(), &["flown", "--json"]).out);
    assert_eq!((&found["audit"]["proved"], &found["audit"]["judged_by_run"]), (&false.into(), &true.into()));
    // Of a part, of some vehicles and against a smaller distance too.
    for more in [&["--from", "1", "--to", "3"][..], &["--ids", "1,2,3"], &["--delta", "1.5"], &["--radius", "0.9"]] {
        let part = audit(folder.path(), &[&["flown"], more].concat());
        assert!(part.exit == Some(0) && part.out.starts_with("CLEAR as the run judged"), "{more:?}: {part:?}");
    }
}

#[test]
fn what_the_run_did_not_judge_is_not_said_by_its_word() {
    let folder = pentagon();
    for more in [&["--limit", "speed=100"][..], &["--independent"], &["--motion", "linear"]] {
        let drawn = audit(folder.path(), &[&["flown"], more].concat());
        assert!(
            drawn.exit == Some(0) && drawn.out.starts_with("CLEAR if straight between samples: "),
            "{more:?}: {drawn:?}"
        );
    }
    // More than the run kept.
    let more = audit(folder.path(), &["flown", "--delta", "2.5"]);
    assert!(more.exit == Some(1) && more.out.starts_with("VIOLATION: 2 and 3 came to 2.460 m"), "{more:?}");
    // By other clocks.
    let later = audit(folder.path(), &["flown", "--offset", "1=0.001"]);
    assert!(!later.out.contains("as the run judged"), "{later:?}");
}

/// Writes a recording anew, with what `change` makes of it, and its verdict where `is_closed`.
fn rewritten(folder: &Path, to: &str, is_closed: bool, change: impl Fn(&mut Entry)) {
    let mut recording = McapRecording::open(&folder.join("flown/run.mcap")).expect("a recording");
    let mut recorder = McapRecorder::create(&folder.join(to), recording.header()).expect("made");
    for entry in recording.by_ref() {
        let mut entry = entry.expect("whole");
        change(&mut entry);
        match &entry {
            Entry::Sample(sample) => recorder.sample(&sample.as_sample()).expect("recorded"),
            Entry::Event(event) => recorder.event(event).expect("recorded"),
        }
    }
    let verdict = recording.verdict().expect("a verdict").clone();
    if is_closed { recorder.close(verdict) } else { recorder.finish() }.expect("closed");
}

#[test]
fn a_recording_that_was_changed_or_cut_does_not_profit_from_its_run() {
    let folder = pentagon();
    let said = |arguments: &[&str]| audit(folder.path(), arguments);
    rewritten(folder.path(), "same.mcap", true, |_| {});
    assert!(said(&["same.mcap"]).out.starts_with("CLEAR as the run judged every step: "));
    // One place of one sample, by a millimetre.
    rewritten(folder.path(), "moved.mcap", true, |entry| {
        if let Entry::Sample(sample) = entry
            && (sample.time_s - 2.0).abs() < 1e-3
        {
            sample.swarm.positions_m[(0, 0)] += 1e-3;
        }
    });
    let moved = said(&["moved.mcap"]);
    assert!(moved.exit == Some(0) && moved.out.starts_with("CLEAR if straight between samples: "), "{moved:?}");
    assert!(moved.err.contains("is not as the run wrote it"), "{moved:?}");
    // Moved upon another between two samples that were left as they are: the run's word of that time does not hide it.
    rewritten(folder.path(), "near.mcap", true, |entry| {
        if let Entry::Sample(sample) = entry
            && (1.9..2.4).contains(&sample.time_s)
        {
            let beside = sample.swarm.positions_m.row(2).clone_owned();
            sample.swarm.positions_m.row_mut(0).copy_from(&beside);
        }
    });
    let near = said(&["near.mcap"]);
    assert!(near.exit == Some(1) && near.out.starts_with("VIOLATION: "), "{near:?}");
    // Closed without a verdict, as by a run that failed.
    rewritten(folder.path(), "open.mcap", false, |_| {});
    assert!(said(&["open.mcap"]).out.starts_with("CLEAR if straight between samples: "));
    // Cut off.
    let bytes = fs::read(folder.path().join("flown/run.mcap")).expect("a recording");
    fs::write(folder.path().join("cut.mcap"), &bytes[..bytes.len() - 200]).expect("written");
    assert_eq!(said(&["cut.mcap"]).exit, Some(2));
    let cut = said(&["cut.mcap", "--allow-unfinished"]);
    assert!(!cut.out.contains("as the run judged"), "{cut:?}");
}

#[test]
fn a_verdict_that_the_samples_contradict_is_not_used() {
    let folder = pentagon();
    let with_closest = |to: &str, change: fn(f64) -> f64| {
        let mut recording = McapRecording::open(&folder.path().join("flown/run.mcap")).expect("a recording");
        let mut recorder = McapRecorder::create(&folder.path().join(to), recording.header()).expect("made");
        for entry in recording.by_ref() {
            match entry.expect("whole") {
                Entry::Sample(sample) => recorder.sample(&sample.as_sample()).expect("recorded"),
                Entry::Event(event) => recorder.event(&event).expect("recorded"),
            }
        }
        let mut verdict = recording.verdict().expect("a verdict").clone();
        verdict.separation_m = change(verdict.separation_m);
        recorder.close(verdict).expect("closed");
        audit(folder.path(), &[to])
    };
    let same = with_closest("same.mcap", |m| m);
    assert!(same.out.starts_with("CLEAR as the run judged every step: never closer than 2.460355 m"), "{same:?}");
    let raised = with_closest("raised.mcap", |m| m + 0.001);
    assert!(raised.out.starts_with("CLEAR if straight between samples: never closer than 2.460355 m"), "{raised:?}");
    assert!(raised.err.contains("the verdict of the run is not used"), "{raised:?}");
    // A verdict with a smaller separation than the samples leaves the audit clear.
    let lowered = with_closest("lowered.mcap", |m| m - 0.001);
    assert_eq!(lowered.exit, Some(0), "{lowered:?}");
}

#[test]
fn the_smallest_separation_that_is_printed_is_clear_and_the_next_number_is_not() {
    let folder = pentagon();
    let printed = json(&audit(folder.path(), &["flown", "--json"]).out)["separation"]["min_m"].as_f64().expect("known");
    for (delta_m, exit) in [(printed, 0), (printed.next_up(), 1)] {
        let judged = audit(folder.path(), &["flown", "--delta", &format!("{delta_m:?}")]);
        assert_eq!(judged.exit, Some(exit), "{judged:?}");
    }
}

#[test]
fn samples_far_apart_leave_no_gap_in_a_recording_of_a_run() {
    let folder = tempfile::tempdir().expect("a folder");
    fly(folder.path(), "pentagon", &["time.duration_s=6", "arrival.hold_s=6", "time.record_hz=0.2"]);
    let judged = audit(folder.path(), &["flown"]);
    assert!(judged.exit == Some(0) && judged.out.starts_with("CLEAR as the run judged every step"), "{judged:?}");
    // A `--max-gap` of the user still applies.
    let short = audit(folder.path(), &["flown", "--max-gap", "2"]);
    assert!(short.exit == Some(1) && short.out.starts_with("UNDECIDED"), "{short:?}");
}

/// Scenario of a flight past a crate. The straight lines between its samples lead into the crate.
const PAST_A_CRATE: &str = "
[swarm]
dimensions = 3
a22_per_s = 0.0
hull_radius_m = 0.2
[start]
positions_m = [[-1.504, -2.324, 1.809], [-1.371, 1.55, 1.293], [1.958, -1.949, 0.0]]
velocities_m_s = [[0.65, 0.0, 0.0], [-0.404, 0.0, 0.0], [0.46, 0.0, 0.0]]
[formation]
shape = \"helix\"
radius_m = 2.0
pitch_m = 2.0
spacing_m = 1.5
move_m = [0, 0, 3]
assignment = \"optimal\"
[law]
kind = \"displacement\"
delta_m = 1.0
alpha = 10.0
k_per_s2 = 10.0
zeta_per_s = 3.0
[graph]
kind = \"star\"
[reference]
kind = \"circle\"
period_s = 20.0
radius_m = 5.0
[[obstacle]]
name = \"crate\"
box = { size_m = [1.0, 2.0, 1.0], yaw_deg = 30.0 }
at_m = [4.087, -1.172, 1.247]
[time]
duration_s = 10.0
record_hz = 1.0
dt_s = 0.02
";

#[test]
fn straight_lines_past_an_obstacle_do_not_overrule_a_run_that_judged_every_step() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("past.toml"), PAST_A_CRATE).expect("written");
    fly(folder.path(), "past.toml", &[]);
    let report = json(&fs::read_to_string(folder.path().join("flown/report.json")).expect("a report"));
    let judged = audit(folder.path(), &["flown", "--json"]);
    let found = json(&judged.out);
    assert_eq!((&report["audit"]["status"], &found["status"]), (&"clear".into(), &"clear".into()), "{judged:?}");
    let drawn = audit(folder.path(), &["flown", "--independent"]);
    assert!(drawn.out.starts_with("VIOLATION: "), "straight lines alone say otherwise: {drawn:?}");
}

#[test]
fn a_run_that_ended_early_gives_no_word_for_its_recording() {
    let folder = pentagon();
    let mut recording = McapRecording::open(&folder.path().join("flown/run.mcap")).expect("a recording");
    let mut recorder = McapRecorder::create(&folder.path().join("early.mcap"), recording.header()).expect("made");
    for entry in recording.by_ref() {
        match entry.expect("whole") {
            Entry::Sample(sample) => recorder.sample(&sample.as_sample()).expect("recorded"),
            Entry::Event(event) => recorder.event(&event).expect("recorded"),
        }
    }
    let mut verdict = recording.verdict().expect("a verdict").clone();
    verdict.ended_early = "interrupted".to_owned();
    recorder.close(verdict).expect("closed");
    let early = audit(folder.path(), &["early.mcap"]);
    assert!(early.out.starts_with("CLEAR if straight between samples: "), "{early:?}");
}
