//! What a run saw between its samples, audited by the program under other clocks, around ellipsoids, and in parts.

use std::path::Path;

use tautline::mcap::{Header, McapRecorder};
use tautline::record::{Sample, Sink as _};
use tautline::swarm::{Rows, Swarm};
use tempfile::TempDir;

use crate::program::{Ran, TAUTLINE, ran_by};

/// Flies the classical law, stiff, so that vehicles pass each other between two samples a second apart.
fn flown(record_hz: &str, duration_s: &str) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let fixed = ["run", "pentagon-laplacian", "--out", "coarse", "--no-snapshots", "--no-figures", "--quiet"];
    let times = [("time.record_hz", record_hz), ("time.duration_s", duration_s), ("arrival.hold_s", duration_s)];
    let times = times.map(|(key, value)| format!("{key}={value}"));
    let sets = ["law.f1_per_s2=30", "law.f2_per_s=1", &times[0], &times[1], &times[2]];
    let sets = sets.iter().flat_map(|set| ["--set", set]);
    let ran = ran_by(TAUTLINE, folder.path(), &fixed.into_iter().chain(sets).collect::<Vec<_>>());
    assert_eq!(ran.exit, Some(1), "{ran:?}");
    folder
}

fn audit(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, &[&["audit", "coarse"], arguments].concat())
}

fn json(ran: &Ran) -> serde_json::Value {
    serde_json::from_str(&ran.out).expect("JSON alone")
}

#[test]
fn what_a_run_saw_binds_under_other_clocks_and_around_ellipsoids_or_nobody_knows() {
    let folder = flown("1", "20");
    // The folder of a run is its recording.
    let plain = audit(folder.path(), &["--json"]);
    let whole = json(&plain);
    assert_eq!((plain.exit, &whole["recording"]), (Some(1), &"coarse/run.mcap".into()));
    assert_eq!(whole["status"], "violation");
    let exported = ran_by(TAUTLINE, folder.path(), &["export", "coarse", "-o", "drawn.csv"]);
    assert_eq!(exported.exit, Some(0), "{exported:?}");
    assert!(exported.err.contains("what the run saw between them is not in drawn.csv"), "{exported:?}");
    let drawn = ran_by(TAUTLINE, folder.path(), &["audit", "drawn.csv", "--delta", "2"]);
    assert_eq!(drawn.exit, Some(0), "straight lines say the opposite: {drawn:?}");
    // Of others too, where more is asked than the run saw of all.
    let others = audit(folder.path(), &["--ids", "1,5", "--delta", "4"]);
    assert!(others.exit == Some(1) && others.out.starts_with("UNDECIDED: how near 1 and 5 came"), "{others:?}");
    assert_eq!(audit(folder.path(), &["--ids", "1,5"]).exit, Some(0));
    // All clocks later by the same: the same, later.
    let all: Vec<_> = (1..=5).flat_map(|k| ["--offset".to_owned(), format!("{k}=100")]).collect();
    let later = audit(folder.path(), &all.iter().map(String::as_str).chain(["--json"]).collect::<Vec<_>>());
    let moved = json(&later);
    assert_eq!((&moved["status"], &moved["separation"]["min_m"]), (&whole["status"], &whole["separation"]["min_m"]));
    let at_s = |report: &serde_json::Value| report["separation"]["min_at_s"].as_f64().expect("a time");
    assert!((at_s(&moved) - at_s(&whole) - 100.0).abs() < 1e-9);
    // Each clock by another millisecond: what was flown at other times nobody knows.
    let each: Vec<_> = (1..=5).flat_map(|k| ["--offset".to_owned(), format!("{k}=0.00{k}")]).collect();
    let one = audit(folder.path(), &each.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(one.exit, Some(1), "{one:?}");
    assert!(one.out.starts_with("UNDECIDED: how near ") && one.out.contains(" is not known"), "{one:?}");
    assert!(one.err.contains("clocks"), "{one:?}");
    // Around balls it is the same question in another unit; around what is longer than wide, metres decide what they can.
    let pair = &whole["separation"]["min_m"].as_f64().expect("a distance");
    let ball = audit(folder.path(), &["--ellipsoid", "1,1,1", "--json"]);
    assert_eq!(
        (json(&ball)["status"].as_str(), json(&ball)["separation"]["min_m"].as_f64()),
        (Some("violation"), Some(*pair))
    );
    let slim = audit(folder.path(), &["--ellipsoid", "0.05,0.05,1"]);
    assert!(slim.exit == Some(1) && slim.out.starts_with("UNDECIDED: "), "{slim:?}");
    let small = audit(folder.path(), &["--ellipsoid", "0.05,0.05,0.1"]);
    assert_eq!(small.exit, Some(0), "{small:?}");
    // Everything is above -1 m, and nothing above 1 m.
    assert!(audit(folder.path(), &["--above", "-1"]).out.starts_with("VIOLATION: "));
    assert!(audit(folder.path(), &["--above", "1"]).out.starts_with("UNDECIDED: at no time"));
}

/// The violation that lasts longest: from when to when \[s\].
fn longest(report: &serde_json::Value) -> [f64; 2] {
    let violations = report["violations"].as_array().expect("a list").iter();
    let spans = violations.map(|v| ["from_s", "to_s"].map(|key| v[key].as_f64().expect("a time")));
    spans.max_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0]))).expect("a violation")
}

#[test]
fn a_part_of_what_a_run_saw_is_said_as_people_read_it() {
    let folder = flown("1", "20");
    let [from_s, _] = longest(&json(&audit(folder.path(), &["--json"])));
    let window = [format!("{from_s}"), format!("{}", from_s + 1e-3)];
    let part = audit(folder.path(), &["--from", &window[0], "--to", &window[1]]);
    assert_eq!(part.exit, Some(1), "{part:?}");
    assert!(part.out.contains("came to just below 2.000 m (limit 2.000 m)"), "{part:?}");
    assert!(!part.out.contains("99999999") && part.out.contains(" .. 2.000000"), "{part:?}");
}

#[test]
fn a_violation_that_lasts_to_the_end_binds_before_it() {
    let [from_s, to_s] = longest(&json(&audit(flown("1", "20").path(), &["--json"])));
    let end_s = f64::midpoint(from_s, to_s);
    // Recorded before it begins, and at the end.
    let folder = flown(&format!("{}", 2.0 / end_s), &format!("{end_s}"));
    let whole = json(&audit(folder.path(), &["--json"]));
    let report = std::fs::read_to_string(folder.path().join("coarse/report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    for key in ["min_m", "min_pair"] {
        assert_eq!(whole["separation"][key], report["separation"][key]);
    }
    let lasting = &whole["violations"].as_array().expect("a list").last().expect("a violation");
    let of = |key: &str| lasting[key].as_f64().expect("a time");
    assert!((of("from_s") - from_s).abs() < 1e-9 && (of("to_s") - end_s).abs() < 1e-2, "{lasting}");
    let (late_s, later_s) = (format!("{}", from_s + 1e-4), format!("{}", from_s + 2e-4));
    let before = audit(folder.path(), &["--from", &late_s, "--to", &later_s]);
    assert_eq!(before.exit, Some(1), "{before:?}");
    assert!(before.out.contains("came to just below 2.000 m"), "{before:?}");
}

#[test]
fn a_run_whose_scenario_cannot_be_read_is_not_judged_without_what_it_says() {
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
    assert!(exported.err.contains("what the run saw between two samples is not in drawn.csv"), "{exported:?}");
}

#[test]
fn what_a_run_saw_of_an_obstacle_between_its_samples_is_said_in_every_word() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenario = "start.positions_m = [[0, 0], [0, 40]]\nformation = { shape = \"line\", spacing_m = 6.0 }\n\
                    law = { kind = \"laplacian\", delta_m = 1.0 }\ntime = { duration_s = 12.0, record_hz = 1.0 }\n\
                    [[obstacle]]\nname = \"ball\"\nball = { radius_m = 1.0 }\nat_m = [-3.9, 26.0, 0.0]\nclearance_m = 1.9\n";
    std::fs::write(folder.path().join("past.toml"), scenario).expect("a file");
    let flown =
        ran_by(TAUTLINE, folder.path(), &["run", "past.toml", "--out", "coarse", "--no-snapshots", "--no-figures"]);
    assert_eq!(flown.exit, Some(1), "{flown:?}");
    let report = std::fs::read_to_string(folder.path().join("coarse/report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let [true_m, true_s] = ["min_m", "min_at_s"].map(|key| report["obstacles"]["violations"][0][key].as_f64());
    let judged = audit(folder.path(), &["--json", "--junit", "found.xml"]);
    let whole = json(&judged);
    assert_eq!((&whole["status"], &whole["audit"]["status"]), (&"violation".into(), &"violation".into()));
    let found = &whole["violations"][0];
    assert_eq!((found["min_m"].as_f64(), found["min_at_s"].as_f64()), (true_m, true_s), "{found}");
    let words = audit(folder.path(), &[]);
    assert!(words.out.starts_with("VIOLATION: 1 and ball came to "), "{words:?}");
    let cases = std::fs::read_to_string(folder.path().join("found.xml")).expect("cases");
    assert!(!cases.contains("<testcase name=\"separation\" classname=\"tautline.audit\"/>"), "{cases}");
    // Before it was at its closest no more is known than that it was too near.
    let [from_s, at_s] = [found["from_s"].as_f64().expect("a time"), true_s.expect("a time")];
    let part = audit(folder.path(), &["--to", &format!("{}", f64::midpoint(from_s, at_s))]);
    assert!(part.out.starts_with("VIOLATION: 1 and ball came to just below 1.9"), "{part:?}");
    let open = audit(folder.path(), &["--to", &format!("{at_s}"), "--above", "-100", "--json"]);
    assert_eq!(json(&open)["audit"]["status"], "undecided");
}
