//! Audits of recordings of `tautline run`: they repeat the run's own audit if the file is unchanged.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tautline::mcap::{Entry, Header, McapRecorder, McapRecording, RunAudit, StoredAudit};
use tautline::record::{Sample, Sink as _};
use tautline::swarm::{Rows, Swarm};
use tempfile::TempDir;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{SEPARATION, at, closest, least, motion, number, status, violations};

/// Built-in scenarios with the duration of their flights in short tests \[s\].
const BUILT_IN: [(&str, &str); 14] = [
    ("pentagon", "4"),
    ("hexagon", "2"),
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
    ("shielded-crazyflies", "1"),
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
fn recordings_of_built_in_scenarios_have_the_verdicts_of_their_runs() {
    let is_long = std::env::var_os("TAUTLINE_LONG").is_some();
    for (scenario, duration_s) in BUILT_IN {
        let folder = tempfile::tempdir().expect("a folder");
        let short = ["time.duration_s", "arrival.hold_s"].map(|key| format!("{key}={duration_s}"));
        // The whole flight of `thousand` takes too long in a debug build.
        let is_whole = is_long && scenario != "thousand";
        let sets: Vec<&str> = short.iter().filter(|_| !is_whole).map(String::as_str).collect();
        fly(folder.path(), scenario, &sets);
        let report = json(&fs::read_to_string(folder.path().join("flown/report.json")).expect("a report"));
        let judged = audit(folder.path(), &["flown", "--json"]);
        let found = json(&judged.out);
        assert_eq!(at(&found, "/status"), at(&report, "/status"), "{scenario}: {judged:?}");
        // With ellipsoids the run measures in its delta, the audit in half axes.
        if at(&report, "/question/ellipsoid_m").is_null() {
            assert_eq!(at(&found, "/question/delta"), at(&report, "/question/delta"), "{scenario}");
            assert_eq!(closest(&found), closest(&report), "{scenario}");
        }
        let is_by_run = ["run-audit", "every-step"].contains(&motion(&found));
        assert!(is_by_run, "{scenario}: {}", found["facts"]);
        assert_eq!(found["proved"] == true, found["status"] == "clear", "{scenario}: {}", found["facts"]);
    }
}

#[test]
fn a_recording_has_the_verdict_of_its_run() {
    let folder = pentagon();
    let judged = audit(folder.path(), &["flown"]);
    assert_eq!(judged.exit, Some(0), "{judged:?}");
    let said = "PROVED CLEAR by the run's audit of every step: \
                never closer than 2.460355 m, 2 and 3 at 2.15 s (delta 2.000 m); from 0.000 s to 4.000 s";
    assert_eq!(judged.out.lines().next(), Some(said));
    let found = json(&audit(folder.path(), &["flown", "--json"]).out);
    assert_eq!((&found["proved"], motion(&found)), (&true.into(), "run-audit"));
    for same in [&["--delta", "2"][..], &["--require-presence", "--expect-vehicles", "5"]] {
        let again = audit(folder.path(), &[&["flown"], same].concat());
        assert!(
            again.exit == Some(0) && again.out.starts_with("PROVED CLEAR by the run's audit"),
            "{same:?}: {again:?}"
        );
    }
}

#[test]
fn other_options_are_judged_from_the_samples_with_a_note() {
    let folder = pentagon();
    for more in [
        &["--from", "1", "--until", "3"][..],
        &["--ids", "1,2,3"],
        &["--delta", "1.5"],
        &["--radius", "0.9"],
        &["--offset", "1=0.001"],
        &["--above", "-1"],
        &["--max-gap", "1"],
        &["--scale", "1.5"],
        &["--motion", "linear"],
        &["--limit", "speed=100"],
    ] {
        let drawn = audit(folder.path(), &[&["flown"], more].concat());
        assert!(
            drawn.exit == Some(0)
                && drawn.out.starts_with("CLEAR ")
                && drawn.out.contains(" if straight between samples"),
            "{more:?}: {drawn:?}"
        );
        assert!(
            drawn.err.contains("note: the samples are judged: the run's audit of every step "),
            "{more:?}: {drawn:?}"
        );
    }
    let independent = audit(folder.path(), &["flown", "--independent"]);
    assert!(independent.out.starts_with("CLEAR if straight between samples: "), "{independent:?}");
    // A larger delta than the run kept.
    let more = audit(folder.path(), &["flown", "--delta", "2.5"]);
    assert!(more.exit == Some(1) && more.out.starts_with("VIOLATION: 2 and 3 came to 2.460 m"), "{more:?}");
}

fn stored(recording: &McapRecording) -> RunAudit {
    let StoredAudit::AsWritten(audit) = recording.stored_audit() else { panic!("{:?}", recording.stored_audit()) };
    *audit
}

/// Writes the recording of the folder again with changed entries and a changed audit.
fn rewritten(folder: &Path, to: &str, change: impl Fn(&mut Entry), change_audit: impl Fn(&mut RunAudit)) {
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
    let mut audit = stored(&recording);
    change_audit(&mut audit);
    recorder.close(audit).expect("closed");
}

fn altered(folder: &Path, to: &str, change: impl Fn(&mut Vec<u8>)) {
    let mut bytes = fs::read(folder.join("flown/run.mcap")).expect("a recording");
    change(&mut bytes);
    fs::write(folder.join(to), bytes).expect("written");
}

/// Sets the checksums of all chunks to 0, which means absent.
fn remove_checksums(bytes: &mut [u8]) {
    let (mut at, chunk, data_end) = (8, 6, 15);
    while bytes[at] != data_end {
        let length = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().expect("8 bytes"));
        if bytes[at] == chunk {
            bytes[at + 9 + 24..at + 9 + 28].fill(0);
        }
        at += 9 + usize::try_from(length).expect("fits");
    }
}

/// Replaces a number at all its places in the file.
fn replace(bytes: &mut [u8], value: f64, by: f64) {
    let places: Vec<_> = (0..bytes.len() - 8).filter(|&at| bytes[at..at + 8] == value.to_le_bytes()).collect();
    for at in places {
        bytes[at..at + 8].copy_from_slice(&by.to_le_bytes());
    }
}

#[test]
fn a_changed_or_truncated_recording_is_judged_from_its_samples() {
    let folder = pentagon();
    let said = |arguments: &[&str]| audit(folder.path(), arguments);
    rewritten(folder.path(), "same.mcap", |_| {}, |_| {});
    assert!(said(&["same.mcap"]).out.starts_with("PROVED CLEAR by the run's audit of every step: "));
    // One coordinate of one sample, and one number of the audit.
    let recording = McapRecording::open(&folder.path().join("flown/run.mcap")).expect("a recording");
    let (samples, _) = recording.read_all().expect("whole");
    let coordinate = samples[samples.len() - 1].swarm.positions_m[(0, 0)];
    let closest_m = least(&json(&said(&["flown", "--json"]).out));
    for value in [coordinate, closest_m] {
        altered(folder.path(), "changed.mcap", |bytes| {
            replace(bytes, value, value + 1e-3);
            remove_checksums(bytes);
        });
        let changed = said(&["changed.mcap"]);
        assert!(
            changed.exit == Some(0) && changed.out.starts_with("CLEAR if straight between samples: "),
            "{changed:?}"
        );
        assert!(changed.err.contains("was changed after the run"), "{changed:?}");
    }
    // Closed without an audit, as by a failed run.
    let mut recording = McapRecording::open(&folder.path().join("flown/run.mcap")).expect("a recording");
    let mut recorder = McapRecorder::create(&folder.path().join("open.mcap"), recording.header()).expect("made");
    for entry in recording.by_ref() {
        if let Entry::Sample(sample) = entry.expect("whole") {
            recorder.sample(&sample.as_sample()).expect("recorded");
        }
    }
    recorder.finish().expect("closed");
    let open = said(&["open.mcap"]);
    assert!(open.out.starts_with("CLEAR if straight between samples: "), "{open:?}");
    assert!(open.err.contains("holds no audit of its run"), "{open:?}");
    // Truncated.
    altered(folder.path(), "cut.mcap", |bytes| bytes.truncate(bytes.len() - 200));
    assert_eq!(said(&["cut.mcap"]).exit, Some(2));
    let cut = said(&["cut.mcap", "--allow-unfinished"]);
    assert!(!cut.out.contains("by the run's audit"), "{cut:?}");
}

#[test]
fn an_audit_that_contradicts_the_samples_is_not_used() {
    let folder = pentagon();
    let with_closest = |to: &str, change: fn(f64) -> f64| {
        rewritten(folder.path(), to, |_| {}, |audit| audit.closest[0].min_m = change(audit.closest[0].min_m));
        audit(folder.path(), &[to])
    };
    let raised = with_closest("raised.mcap", |m| m + 0.001);
    assert!(raised.out.starts_with("CLEAR if straight between samples: never closer than 2.460355 m"), "{raised:?}");
    assert!(raised.err.contains("closer than the run's audit"), "{raised:?}");
    // A vehicle is moved upon another, and the hash is computed again.
    let near = |entry: &mut Entry| {
        if let Entry::Sample(sample) = entry
            && (1.9..2.4).contains(&sample.time_s)
        {
            let beside = sample.swarm.positions_m.row(2).clone_owned();
            sample.swarm.positions_m.row_mut(0).copy_from(&beside);
        }
    };
    rewritten(folder.path(), "near.mcap", near, |_| {});
    let near = audit(folder.path(), &["near.mcap"]);
    assert!(near.exit == Some(1) && near.out.starts_with("VIOLATION: "), "{near:?}");
}

#[test]
fn sparse_samples_are_no_gap_in_a_recording_of_a_run() {
    let folder = tempfile::tempdir().expect("a folder");
    fly(folder.path(), "pentagon", &["time.duration_s=6", "arrival.hold_s=6", "time.record_hz=0.2"]);
    let judged = audit(folder.path(), &["flown"]);
    assert!(
        judged.exit == Some(0) && judged.out.starts_with("PROVED CLEAR by the run's audit of every step"),
        "{judged:?}"
    );
    // The user's `--max-gap` still applies.
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
fn straight_lines_do_not_overrule_the_run_for_obstacles() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("past.toml"), PAST_A_CRATE).expect("written");
    fly(folder.path(), "past.toml", &[]);
    let report = json(&fs::read_to_string(folder.path().join("flown/report.json")).expect("a report"));
    let judged = audit(folder.path(), &["flown", "--json"]);
    let found = json(&judged.out);
    assert_eq!((&report["status"], &found["status"]), (&"clear".into(), &"clear".into()), "{judged:?}");
    let drawn = audit(folder.path(), &["flown", "--independent"]);
    assert!(drawn.out.starts_with("VIOLATION: "), "straight lines alone say otherwise: {drawn:?}");
}

#[test]
fn a_run_that_ended_early_is_not_clear() {
    let folder = pentagon();
    rewritten(folder.path(), "early.mcap", |_| {}, |audit| audit.ended_early = "interrupted".to_owned());
    let early = audit(folder.path(), &["early.mcap"]);
    assert!(early.out.starts_with("CLEAR if straight between samples: "), "{early:?}");
}

#[test]
fn an_early_end_leaves_every_part_undecided_and_names_those_that_were_before() {
    let folder = tempfile::tempdir().expect("a folder");
    // The mean velocity grows until positions have no resolution.
    fly(folder.path(), "pentagon", &["swarm.a22_per_s=0.5", "time.duration_s=150"]);
    let asked = ["flown", "--plan", "flown", "--plan-delay", "0", "--tube", "1", "--require-presence"];
    let judged = audit(folder.path(), &[&asked[..], &["--json", "--junit", "cases.xml"]].concat());
    let report = json(&judged.out);
    assert_eq!((judged.exit, &report["plan"]["status"]), (Some(1), &"undecided".into()), "{judged:?}");
    for name in ["separation", "plan", "presence"] {
        assert_eq!(status(&report, name), "undecided", "{report}");
    }
    let cases = fs::read_to_string(folder.path().join("cases.xml")).expect("cases");
    assert!(cases.contains("until then every vehicle is seen throughout"), "{cases}");
    assert!(cases.contains("until then within "), "{cases}");
    // Only the yaw rate was unknown before the end.
    let judged = audit(folder.path(), &["flown", "--limit", "yaw-rate=1"]);
    let said = "UNDECIDED: yaw rate unknown for 1 (limit 1.000 deg/s); the flight ended early";
    assert!(judged.exit == Some(1) && judged.out.starts_with(said), "{judged:?}");
}

#[test]
fn the_recording_of_an_undecided_run_is_undecided() {
    let folder = pentagon();
    rewritten(folder.path(), "open.mcap", |_| {}, |audit| audit.status = "undecided".to_owned());
    let open = audit(folder.path(), &["open.mcap"]);
    assert!(open.exit == Some(1) && open.out.starts_with("UNDECIDED: the run's own audit"), "{open:?}");
}

#[test]
fn violations_between_samples_are_in_the_audit_of_the_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    // The classical law, stiff, so that vehicles pass each other between two samples 1 s apart.
    let times = ["time.record_hz=1", "time.duration_s=20", "arrival.hold_s=20"];
    fly(folder.path(), "pentagon-laplacian", &[&["law.f1_per_s2=30", "law.f2_per_s=1"], &times[..]].concat());
    let report = json(&fs::read_to_string(folder.path().join("flown/report.json")).expect("a report"));
    // The folder of a run stands for its recording.
    let judged = audit(folder.path(), &["flown", "--json"]);
    let whole = json(&judged.out);
    assert_eq!((judged.exit, &whole["recording"]), (Some(1), &"flown/run.mcap".into()));
    assert_eq!(closest(&whole), closest(&report));
    assert_eq!(violations(&whole), violations(&report));
    // Limits of single vehicles do not hide the violations.
    assert!(audit(folder.path(), &["flown", "--limit", "speed=100"]).out.starts_with("VIOLATION: "));
    let exported = ran_by(TAUTLINE, folder.path(), &["export", "flown", "-o", "drawn.csv"]);
    assert!(exported.exit == Some(0) && exported.err.contains("the run's audit of every step is not in drawn.csv"));
    let drawn = ran_by(TAUTLINE, folder.path(), &["audit", "drawn.csv", "--delta", "2"]);
    assert_eq!(drawn.exit, Some(0), "straight lines show the opposite: {drawn:?}");
    // Other options are not clear either if the run found a smaller separation between the samples.
    let found = &violations(&report)[0];
    let [first, second] = [0, 1].map(|k| found["subjects"][k].as_str().expect("a name"));
    let ids = format!("{first},{second}");
    for more in [&["--from", "0"][..], &["--ids", &ids], &["--delta", "1.99"], &["--motion", "linear"]] {
        let part = audit(folder.path(), &[&["flown"], more].concat());
        let said = "UNDECIDED: the run's audit of every step found ";
        assert!(part.exit == Some(1) && part.out.starts_with(said), "{more:?}: {part:?}");
        assert!(part.err.contains("another question (VIOLATION: "), "{more:?}: {part:?}");
    }
    let before = (0.5 * number(found, "/from_s")).to_string();
    let all = violations(&report).iter();
    let deepest = all.map(|violation| number(violation, "/value/lower")).fold(f64::INFINITY, f64::min);
    let least = (0.99 * deepest).to_string();
    for more in
        [&["--ids", &ids, "--delta", &least][..], &["--until", &before], &["--delta", &least], &["--independent"]]
    {
        let part = audit(folder.path(), &[&["flown"], more].concat());
        assert!(part.exit == Some(0) && part.out.starts_with("CLEAR if straight"), "{more:?}: {part:?}");
    }
    // A run that is cut off keeps its findings, and the note says that they count.
    altered(folder.path(), "flown/run.mcap", |bytes| bytes.truncate(bytes.len() - 200));
    let cut = audit(folder.path(), &["flown", "--allow-unfinished"]);
    assert!(cut.out.starts_with("UNDECIDED: the run's audit of every step found "), "{cut:?}");
    assert!(cut.err.contains("the run recorded ") && cut.err.contains(" but no audit"), "{cut:?}");
}

#[test]
fn violations_of_obstacles_between_samples_are_in_the_audit_of_the_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = "start.positions_m = [[0, 0], [0, 40]]\nformation = { shape = \"line\", spacing_m = 6.0 }\n\
                    law = { kind = \"laplacian\", delta_m = 1.0 }\ntime = { duration_s = 12.0, record_hz = 1.0 }\n\
                    [[obstacle]]\nname = \"ball\"\nball = { radius_m = 1.0 }\nat_m = [-3.9, 26.0, 0.0]\n\
                    clearance_m = 1.9\n";
    fs::write(folder.path().join("past.toml"), scenario).expect("a file");
    fly(folder.path(), "past.toml", &[]);
    let report = json(&fs::read_to_string(folder.path().join("flown/report.json")).expect("a report"));
    let whole = json(&audit(folder.path(), &["flown", "--json", "--junit", "found.xml"]).out);
    assert_eq!((&whole["status"], status(&whole, SEPARATION)), (&"violation".into(), "violation"));
    let found = violations(&report);
    assert_eq!(found[0]["subjects"][1], "ball");
    assert_eq!(violations(&whole), found);
    assert!(audit(folder.path(), &["flown"]).out.starts_with("VIOLATION: 1 and ball came to "));
    let cases = fs::read_to_string(folder.path().join("found.xml")).expect("cases");
    assert!(!cases.contains("<testcase name=\"separation\" classname=\"tautline.audit\"/>"), "{cases}");
}

#[test]
fn a_run_with_an_unreadable_scenario_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let header = Header::new("newer", "name = \"newer\"\n[law]\ndelta_n = 1.0\n", 2, 1.0);
    let mut recorder = McapRecorder::create(&folder.path().join("newer.mcap"), &header).expect("made");
    for time_s in [0.0, 1.0] {
        let swarm = Swarm::at_rest(Rows::from_fn(2, |i, axis| if axis == 0 { 9.0 * i as f64 } else { 0.0 }));
        let control = Rows::zeros(2);
        let step = if time_s == 0.0 { 0 } else { 240 };
        let sample = Sample::new(time_s, step, &swarm, &control);
        recorder.sample(&sample).expect("recorded");
    }
    recorder.finish().expect("closed");
    let judged = ran_by(TAUTLINE, folder.path(), &["audit", "newer.mcap", "--delta", "1"]);
    assert!(judged.exit == Some(2) && judged.err.contains("its scenario cannot be read: "), "{judged:?}");
    assert!(judged.err.contains("delta_n") && judged.err.contains("export it as CSV"), "{judged:?}");
    let exported = ran_by(TAUTLINE, folder.path(), &["export", "newer.mcap", "-o", "drawn.csv"]);
    assert_eq!(exported.exit, Some(0), "{exported:?}");
    assert!(exported.err.contains("the run's audit of every step is not in drawn.csv"), "{exported:?}");
}
