//! What a run saw between its samples, audited by the program under other clocks, around ellipsoids, and in parts.

use std::path::Path;

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
