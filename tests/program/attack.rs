//! `tautline attack`: the worst flight is that of `run`, and wrong input is refused first.

use std::path::Path;

use serde_json::Value;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{at, closest};

/// A law without avoidance, until two vehicles meet.
const SHORT: [&str; 4] = ["--set", "law.kind=laplacian", "--set", "time.duration_s=3"];

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

#[test]
fn the_printed_command_and_the_recording_repeat_the_worst_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    let search = ["attack", "pentagon", "--move-start", "0.4", "--flights", "24", "--out", "worst", "--json"];
    let Ran { exit, out, err } = ran(folder.path(), &[&search[..], &SHORT].concat());
    assert_eq!(exit, Some(1), "{err}");
    assert!(err.contains("VIOLATION found: ") && err.contains("a search, not a proof"), "{err}");
    let found: Value = serde_json::from_str(&out).expect("JSON");
    assert_eq!(found["flights"], 24);
    let worst = found["progress"].as_array().expect("a list").last().expect("a worst");
    assert_eq!(worst["flown"]["outcome"], "violated");

    let sets = found["sets"].as_array().expect("a list").iter().map(|set| set.as_str().expect("text"));
    let sets = sets.flat_map(|set| ["--set", set]);
    let again: Vec<_> = ["run", "pentagon"].into_iter().chain(sets).collect();
    let flown = ran(folder.path(), &[&again[..], &["--json", "--no-snapshots", "--no-figures"]].concat());
    let flown: Value = serde_json::from_str(&flown.out).expect("a report");
    let left = std::fs::read_to_string(folder.path().join("worst/report.json")).expect("a report");
    let left: Value = serde_json::from_str(&left).expect("JSON");
    for report in [&flown, &left] {
        assert_eq!(report["run"]["state_hash"], worst["flown"]["state_hash"]);
        assert_eq!(at(closest(report), "/value/lower"), at(worst, "/flown/min_m"));
    }
    for file in ["run.mcap", "report.html"] {
        assert!(folder.path().join("worst").join(file).is_file(), "{file}");
    }
    // The printed command flies the same bits.
    let printed = err.lines().find(|line| line.trim().starts_with("tautline run pentagon")).expect("a command");
    assert!(printed.contains("start={positions_m=[["), "{printed}");

    let Ran { exit, err, .. } = ran(folder.path(), &[&search[..], &SHORT].concat());
    assert_eq!(exit, Some(2), "a finished run is kept: {err}");
    assert!(err.contains("worst holds a finished run"), "{err}");
}

#[test]
fn a_search_without_a_violation_exits_with_0_and_is_no_proof() {
    let folder = tempfile::tempdir().expect("a folder");
    let search = ["attack", "pentagon", "--vary", "law.alpha=0.5..2", "--flights", "9", "--set", "time.duration_s=3"];
    let files = |name: &str, threads: &str| {
        let [csv, html, json] = ["csv", "html", "json"].map(|kind| format!("{name}.{kind}"));
        let more = ["--threads", threads, "--csv", &csv, "--html", &html, &format!("--json={json}")];
        let Ran { exit, out, err } = ran(folder.path(), &[&search[..], &more].concat());
        assert_eq!(exit, Some(0), "{err}");
        assert!(out.starts_with("no violation found in 9 flights: smallest separation "), "{out}");
        assert!(out.contains("a search, not a proof"), "{out}");
        [csv, html, json].map(|file| std::fs::read_to_string(folder.path().join(file)).expect("written"))
    };
    let [csv, html, json] = files("one", "1");
    assert_eq!([&csv, &html, &json], files("two", "2").each_ref());
    assert!(html.contains("a search, not a proof") && html.contains("tautline attack pentagon --vary"));
    assert!(csv.starts_with("flight,noise_seed,outcome,min_m,min_at_s,certified_m,law.alpha\n1,"), "{csv}");
}

#[test]
fn wrong_input_is_refused_with_a_remedy_before_a_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("there.json"), "").expect("a file");
    for (arguments, code) in [
        (&[][..], "attack/nothing-varied"),
        (&["--vary", "law.alpha"], "attack/variation"),
        (&["--vary", "law..alpha=1..2"], "scenario/override"),
        (&["--vary", "law.kind=1..2"], "scenario/wrong-type"),
        (&["--vary", "law.alpha=1..2", "--vary", "law.alpha=2..3"], "attack/key-twice"),
        (&["--vary", "noise.seed=1..2"], "attack/seed-varied"),
        (&["--move-start", "0"], "attack/out-of-range"),
        (&["--move-start", "1", "--flights", "2", "--seeds", "3"], "attack/too-few-flights"),
        (&["--move-start", "1", "--seeds", "2"], "attack/nothing-random"),
        (&["--move-start", "1", "--json=there.json"], "files/exists"),
        (&["--move-start", "1", "--json", "--csv", "-"], "files/one-standard-output"),
        (&["--move-start", "1", "--set", "law.delta_m=9"], "scenario/within-delta"),
    ] {
        let ran = ran(folder.path(), &[&["attack", "pentagon"], arguments].concat());
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{arguments:?}: {}", ran.err);
        assert!(ran.err.contains("help:"), "{arguments:?}: {}", ran.err);
    }
    // Values that clap refuses have no code.
    let none = ran(folder.path(), &["attack", "pentagon", "--move-start", "1", "--flights", "0"]);
    assert_eq!((none.exit, none.code()), (Some(2), ""), "{}", none.err);
}

#[test]
fn a_violation_of_the_unchanged_scenario_exits_with_1() {
    let folder = tempfile::tempdir().expect("a folder");
    let ran = ran_by(
        TAUTLINE,
        folder.path(),
        &["attack", "pentagon-laplacian", "--vary", "time.duration_s=1.1..1.9", "--flights", "3", "--quiet", "--json"],
    );
    assert_eq!(ran.exit, Some(1), "{}{}", ran.out, ran.err);
    let nothing =
        ["attack", "pentagon", "--set", "time.duration_s=2", "--move-start", "1e300", "--flights", "2", "--quiet"];
    assert_eq!(ran_by(TAUTLINE, folder.path(), &nothing).exit, Some(1), "nothing flown is nothing known");
}
