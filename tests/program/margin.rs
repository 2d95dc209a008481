//! `tautline margin`: brackets agree with single flights, and wrong input is refused first.

use std::path::Path;

use serde_json::Value;

use crate::program::{Ran, TAUTLINE, ran_by};

/// A range with a turn: the pentagon reaches its formation only with enough time.
const SEARCH: [&str; 4] = ["pentagon", "--key", "time.duration_s=30..40", "--quiet"];

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

fn margin(folder: &Path, more: &[&str]) -> Value {
    let Ran { exit, out, err } = ran(folder, &[&["margin"], &SEARCH[..], more, &["--json"]].concat());
    assert_eq!(exit, Some(0), "{err}");
    serde_json::from_str(&out).expect("JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn both_sides_of_the_bracket_agree_with_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let found = margin(folder.path(), &["--scan", "3", "--halvings", "3"]);
    assert_eq!(found["turn"]["holds_below"], Value::Bool(false), "{found}");
    let [low, high] = [0, 1].map(|k| number(&found["turn"]["bracket"][k]));
    assert_eq!(high - low, 5.0 / 8.0, "an interval of 5 s, halved three times");
    for (value, passes) in [(low, false), (high, true)] {
        let set = format!("time.duration_s={value:?}");
        let flown = ran(folder.path(), &["run", "pentagon", "--set", &set, "--json", "--no-snapshots", "--force"]);
        let report: Value = serde_json::from_str(&flown.out).expect("a report");
        assert_eq!((flown.exit, &report["pass"]), (Some(i32::from(!passes)), &Value::Bool(passes)), "{set}");
        let probes = found["probes"].as_array().expect("a list");
        let probe = probes.iter().find(|probe| number(&probe["value"]) == value).expect("it was tried");
        assert_eq!(probe["flights"][0]["state_hash"], report["run"]["state_hash"]);
        assert_eq!(probe["held"]["count"], Value::from(u64::from(passes)));
    }
}

#[test]
fn page_and_table_are_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = |name: &str, threads: &str| {
        let [csv, html] = ["csv", "html"].map(|kind| format!("{name}.{kind}"));
        let more = ["--scan", "2", "--halvings", "1", "--threads", threads, "--csv", &csv, "--html", &html];
        let ran = ran(folder.path(), &[&["margin"], &SEARCH[..], &more].concat());
        assert_eq!(ran.exit, Some(0), "{}", ran.err);
        [csv, html].map(|file| std::fs::read_to_string(folder.path().join(file)).expect("written"))
    };
    let [csv, html] = files("one", "1");
    assert_eq!([&csv, &html], files("two", "2").each_ref());
    assert_eq!(csv.lines().count(), 4);
    for part in ["<svg", "the verdict turns in between", "time.duration_s=30.0..40.0", "tautline run"] {
        assert!(html.contains(part), "{part}");
    }
}

#[test]
fn a_verdict_that_never_holds_exits_with_1_and_one_that_always_holds_with_0() {
    let folder = tempfile::tempdir().expect("a folder");
    let asked = |key: &str| ran(folder.path(), &["margin", "pentagon", "--key", key, "--scan", "2"]);
    let nowhere = asked("time.duration_s=2..3");
    assert_eq!(nowhere.exit, Some(1));
    assert!(nowhere.out.contains("fails at any value of time.duration_s tried, from 2 to 3"), "{}", nowhere.out);
    let everywhere = asked("time.duration_s=40..41");
    assert_eq!(everywhere.exit, Some(0));
    assert!(everywhere.out.contains("passes at every value of time.duration_s tried"), "{}", everywhere.out);
}

#[test]
fn wrong_input_is_refused_with_a_remedy_before_a_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("there.json"), "").expect("a file");
    let key = |key: &'static str| vec!["margin", "pentagon", "--key", key];
    let with = |more: &[&'static str]| [key("law.alpha=1..2"), more.to_vec()].concat();
    for (arguments, code) in [
        (key("law.alfa=1..2"), "scenario/unknown-key"),
        (key("law.alpha=1..1"), "margin/range"),
        (key("law.alpha=-1..1"), "scenario/out-of-range"),
        (key("law..alpha=1..2"), "scenario/override"),
        (with(&["--json=there.json"]), "files/exists"),
        (with(&["--json", "--csv", "-"]), "files/one-standard-output"),
        ([key("law.alpha=-1..1"), vec!["--log"]].concat(), "margin/range"),
        // Values that clap refuses have no code.
        (key("law.alpha"), ""),
        (key("law.alpha=1..b"), ""),
        (with(&["--runs", "0"]), ""),
        (with(&["--scan", "1"]), ""),
    ] {
        let ran = ran(folder.path(), &arguments);
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{arguments:?}: {}", ran.err);
    }
}

#[test]
fn integer_keys_and_the_control_rate_of_quadrotors_work() {
    let folder = tempfile::tempdir().expect("a folder");
    let short = ["--set", "time.duration_s=1.5", "--scan", "2", "--halvings", "0", "--verdict", "clear"];
    for (scenario, key, range) in
        [("pentagon", "noise.seed", "noise.seed=1..2"), ("crazyflies", "time.control_hz", "time.control_hz=50..100")]
    {
        let ran = ran(folder.path(), &[&["margin", scenario, "--key", range], &short[..]].concat());
        assert_eq!(ran.exit, Some(0), "{}", ran.err);
        assert!(ran.out.contains(&format!("stays clear at every value of {key} tried")), "{}", ran.out);
    }
}
