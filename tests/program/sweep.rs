//! `tautline sweep`: flights agree with `run`, and wrong input is refused before the first flight.

use std::path::Path;

use serde_json::Value;

use crate::program::{Ran, TAUTLINE, ran_by};

const SHORT: [&str; 3] = ["pentagon", "--set", "time.duration_s=1.5"];

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, &[&["sweep"], &SHORT[..], arguments].concat())
}

#[test]
fn each_point_has_the_bits_of_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let grid = ["--key", "law.alpha=0.5,2", "--key", "start.jitter_m=0.1", "--runs", "2", "--json"];
    let Ran { exit, out, err } = ran(folder.path(), &[&grid[..], &["--verdict", "clear"]].concat());
    assert_eq!(exit, Some(0), "{err}");
    assert!(err.contains("pentagon stays clear in each of 2 runs at 2 of 2 points"), "{err}");
    let found: Value = serde_json::from_str(&out).expect("JSON");
    for point in found["points"].as_array().expect("a list") {
        for flight in point["flights"].as_array().expect("a list") {
            let sets = [
                format!("law.alpha={}", point["values"][0]),
                format!("start.jitter_m={}", point["values"][1]),
                format!("start.seed={}", flight["seed"]),
            ];
            let sets = sets.iter().flat_map(|set| ["--set", set.as_str()]);
            let run: Vec<_> = ["run"].into_iter().chain(SHORT).chain(sets).collect();
            let quick = ["--json", "--no-snapshots", "--no-figures", "--force"];
            let report = ran_by(TAUTLINE, folder.path(), &[&run[..], &quick].concat());
            let report: Value = serde_json::from_str(&report.out).expect("a report");
            assert_eq!(report["run"]["state_hash"], flight["state_hash"], "{run:?}");
        }
    }
}

#[test]
fn files_are_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let files = |name: &str, threads: &str| {
        let files = ["csv", "html", "latex"].map(|kind| format!("{name}.{kind}"));
        let [csv, html, latex] = files.each_ref().map(String::as_str);
        let grid = ["--key", "law.alpha=0.5,1", "--key", "law.delta_m=1..9:3", "--quiet", "--threads", threads];
        let ran = ran(folder.path(), &[&grid[..], &["--csv", csv, "--html", html, "--latex", latex]].concat());
        // Most of the points cannot be flown.
        assert_eq!((ran.exit, ran.out.as_str()), (Some(1), ""), "{}", ran.err);
        files.map(|file| std::fs::read_to_string(folder.path().join(file)).expect("written"))
    };
    let [csv, html, latex] = files("one", "1");
    assert_eq!([&csv, &html, &latex], files("two", "2").each_ref());
    assert_eq!(csv.lines().count(), 7);
    assert!(csv.lines().skip(1).filter(|line| line.contains("start")).count() == 4, "5 m and 9 m are refused: {csv}");
    for part in
        ["over two keys", "Refused points", "tautline sweep pentagon --key 'law.alpha=0.5,1' --key 'law.delta_m=1,5,9'"]
    {
        assert!(html.contains(part), "{part}");
    }
    assert!(latex.contains("law.delta\\_m"), "{latex}");
}

#[test]
fn wrong_input_is_refused_with_its_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    for (arguments, code) in [
        (&["--key", "law.alpha"][..], "sweep/key"),
        (&["--key", "law.alpha=0:1"], "sweep/key"),
        (&["--key", "law.alpha=1..1:3"], "sweep/key"),
        (&["--key", "law.alpha=nan"], "sweep/key"),
        (&["--key", "law.alpha=1", "--key", "law.alpha=2"], "sweep/grid"),
        (&["--key", "law.alpha=1", "--key", "law.delta_m=2", "--key", "time.dt_s=1"], "sweep/grid"),
        (&["--key", "law.alpha=1..2:60", "--key", "law.delta_m=1..2:60"], "sweep/grid"),
        (&["--key", "time.max_halvings=0,0.5"], "sweep/grid"),
        (&["--key", "law.alfa=1,2"], "scenario/unknown-key"),
        (&["--key", "law..alpha=1,2"], "scenario/override"),
        (&["--key", "law.delta_m=9,10"], "scenario/within-delta"),
        (&["--key", "start.seed=1,2", "--runs", "3"], "request/equal-runs"),
        // Values that clap refuses have no code.
        (&[], ""),
        (&["--key", "law.alpha=1", "--runs", "0"], ""),
    ] {
        let ran = ran(folder.path(), arguments);
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{arguments:?}: {}", ran.err);
    }
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0, "nothing is written");
}

#[test]
fn the_examples_of_the_help_fly() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut flown = 0;
    for (study, option) in [("sweep", "--key"), ("attack", "--vary")] {
        let help = ran_by(TAUTLINE, folder.path(), &[study, "--help"]).out;
        for example in help.split('`').skip(1).step_by(2).filter(|text| text.contains('.') && text.contains('=')) {
            let flights: &[&str] = if study == "attack" { &["--flights", "3"] } else { &[] };
            let arguments = [&[study], &SHORT[..], flights, &[option, example, "--json"]].concat();
            let ran = ran_by(TAUTLINE, folder.path(), &arguments);
            let found: Value = serde_json::from_str(&ran.out).unwrap_or_else(|error| panic!("{error}: {ran:?}"));
            let points = found["points"].as_array().into_iter().flatten().chain([&found]);
            let refused: u64 = points.filter_map(|point| point["refused"].as_u64()).sum();
            assert_eq!(refused, 0, "{example}: {found}");
            flown += 1;
        }
    }
    assert!(flown >= 3, "{flown} examples");
}
