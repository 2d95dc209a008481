//! Side files of an audit against the clock of the recording: paths of obstacles, plans, offsets.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report;

/// A time since 1970 \[s\].
const EPOCH: i64 = 1_700_000_000;

/// Two vehicles at rest, 30 m apart, for 20 s from a time on.
fn at_rest(from_s: i64) -> String {
    let mut text = "t_s,id,x,y,z\n".to_owned();
    for t in [0, 10, 20] {
        let _ = write!(text, "{t},a,0,0,0\n{t},b,0,30,0\n", t = from_s + t);
    }
    text
}

/// A ball of 1 m that drives from 20 m beside vehicle a to the vehicle and beyond, in 20 s from a time on.
fn truck(from_s: f64) -> String {
    let [begin, end] = [from_s, from_s + 20.0].map(|t| format!("{t:?}"));
    let path = format!("path = [[{begin}, -20, 0, 0], [{end}, 20, 0, 0]]");
    format!("[[obstacle]]\nname = \"truck\"\nball = {{ radius_m = 1.0 }}\n{path}\n")
}

fn folder(files: &[(&str, String)]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        fs::write(folder.path().join(name), text).expect("a file");
    }
    folder
}

fn audit(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, &[&["audit"], arguments].concat())
}

/// Returns the message and the remedy of a failure on one line.
fn said(ran: &Ran) -> String {
    ran.err.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Returns the sources of the facts of a kind, and their values after their subjects.
fn facts(folder: &Path, arguments: &[&str], kind: &str) -> Vec<(String, String)> {
    let ran = audit(folder, &[arguments, &["--json"]].concat());
    let report: Value = serde_json::from_str(&ran.out).expect("JSON alone");
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let subject = |fact: &Value| fact["subject"].as_str().map_or(String::new(), |subject| format!("{subject}: "));
    let facts = report::facts(&report, kind).into_iter();
    facts.map(|fact| (text(&fact["source"]), subject(fact) + &text(&fact["value"]))).collect()
}

#[test]
fn a_path_on_the_clock_of_the_recording_is_moved_with_it() {
    let absolute = truck(EPOCH as f64);
    let folder = folder(&[
        ("unix.csv", at_rest(EPOCH)),
        ("zero.csv", at_rest(0)),
        ("unix.toml", absolute),
        ("zero.toml", truck(0.0)),
    ]);
    for (recording, path, fact) in [
        ("unix.csv", "unix.toml", ("deduced", "obstacles on the clock of the recording")),
        ("unix.csv", "zero.toml", ("convention", "obstacles from the epoch of the recording")),
        ("zero.csv", "zero.toml", ("convention", "obstacles from the epoch of the recording")),
    ] {
        let asked = [recording, "--delta", "1", "--obstacles", path];
        let ran = audit(folder.path(), &asked);
        assert_eq!(ran.exit, Some(1), "{asked:?}: {ran:?}");
        assert!(ran.out.starts_with("VIOLATION: a and truck came to -1.000 m (limit 0.500 m) at 10.00 s"), "{ran:?}");
        let fact = (fact.0.to_owned(), fact.1.to_owned());
        assert_eq!(facts(folder.path(), &asked, "side-file-clock"), [fact], "{asked:?}");
    }
    // A recording from 0 has no epoch by which the path could be moved.
    let ran = audit(folder.path(), &["zero.csv", "--delta", "1", "--obstacles", "unix.toml"]);
    assert_eq!((ran.exit, ran.code()), (Some(2), "audit/side-file-clock"), "{ran:?}");
}

#[test]
fn a_path_outside_the_judged_window_is_refused() {
    let folder = folder(&[
        ("unix.csv", at_rest(EPOCH)),
        ("milliseconds.toml", truck(1000.0 * EPOCH as f64)),
        ("yesterday.toml", truck(EPOCH as f64 - 86_400.0)),
    ]);
    for (path, problem) in [
        ("milliseconds.toml", "outside the judged window from 0.00 s to 20.00 s"),
        ("yesterday.toml", "is from -86400.00 s to -86380.00 s, outside the judged window"),
    ] {
        let ran = audit(folder.path(), &["unix.csv", "--delta", "1", "--obstacles", path]);
        assert_eq!((ran.exit, ran.code()), (Some(2), "audit/side-file-clock"), "{ran:?}");
        assert!(said(&ran).contains(problem) && said(&ran).contains("at_m"), "{ran:?}");
    }
}

#[test]
fn an_obstacle_that_stands_still_beyond_its_path_is_an_assumption() {
    let path =
        |points: &str| format!("[[obstacle]]\nname = \"truck\"\nball = {{ radius_m = 1.0 }}\npath = [{points}]\n");
    let moving = "[5, -90, 0, 0], [8, -50, 0, 0]";
    let whole = format!("[0, -90, 0, 0], {moving}, [20, -50, 0, 0]");
    let folder = folder(&[("rest.csv", at_rest(0)), ("part.toml", path(moving)), ("whole.toml", path(&whole))]);
    let bounded = ["--motion", "bounded", "--max-accel", "0.01"];
    let part = [&["rest.csv", "--delta", "1", "--obstacles", "part.toml"], &bounded[..]].concat();
    let ran = audit(folder.path(), &part);
    let times = "before 5.00 s and after 8.00 s";
    let assumed = format!("the obstacle truck stands still {times}");
    assert!(ran.exit == Some(0) && ran.out.starts_with("CLEAR if ") && ran.out.contains(&assumed), "{ran:?}");
    assert_eq!(facts(folder.path(), &part, "obstacle-motion"), [("convention".to_owned(), format!("truck: {times}"))]);
    let three = [0; 3].map(|_| path(moving)).concat();
    fs::write(folder.path().join("three.toml"), three).expect("written");
    let ran = audit(folder.path(), &["rest.csv", "--delta", "1", "--obstacles", "three.toml"]);
    let expected = format!("CLEAR if straight between samples, {assumed} and 2 others outside the paths: ");
    assert!(ran.exit == Some(0) && ran.out.starts_with(&expected), "{ran:?}");
    let whole = [&["rest.csv", "--delta", "1", "--obstacles", "whole.toml"], &bounded[..]].concat();
    let ran = audit(folder.path(), &whole);
    assert!(ran.exit == Some(0) && ran.out.starts_with("PROVED CLEAR: "), "{ran:?}");
    assert!(facts(folder.path(), &whole, "obstacle-motion").is_empty());
}

#[test]
fn seconds_of_a_side_file_need_the_unit_of_the_recording() {
    let folder = folder(&[("steps.csv", at_rest(0).replace("t_s", "t")), ("truck.toml", truck(0.0))]);
    let asked = ["steps.csv", "--delta", "1", "--obstacles", "truck.toml"];
    let ran = audit(folder.path(), &asked);
    assert_eq!((ran.exit, ran.code()), (Some(2), "audit/guessed-time-unit"), "{ran:?}");
    assert!(said(&ran).contains("the path of the obstacle `truck` depends on it"), "{ran:?}");
    let known = audit(folder.path(), &[&asked[..], &["--time-unit", "s"]].concat());
    assert!(known.exit == Some(1) && known.out.starts_with("VIOLATION: a and truck came to -1.000 m"), "{known:?}");
}

#[test]
fn an_offset_that_parts_the_vehicles_is_refused() {
    let folder = folder(&[("rest.csv", at_rest(0))]);
    for (offset, exit) in [("b=20.5", 2), ("b=-86400", 2), ("b=5", 0), ("b=-20", 0)] {
        let ran = audit(folder.path(), &["rest.csv", "--delta", "1", "--offset", offset]);
        assert_eq!(ran.exit, Some(exit), "{offset}: {ran:?}");
        if exit == 2 {
            assert_eq!(ran.code(), "audit/side-file-clock", "{ran:?}");
            assert!(said(&ran).contains("longer than the recording, 20.00 s"), "{ran:?}");
        }
    }
    // The window is shorter than the offset, and the recording is longer.
    let window = ["rest.csv", "--delta", "1", "--offset", "b=5", "--from", "10", "--until", "12"];
    assert_eq!(audit(folder.path(), &window).exit, Some(0));
}

#[test]
fn a_plan_of_another_time_is_refused() {
    let folder = folder(&[
        ("flown.csv", at_rest(EPOCH)),
        ("planned.csv", at_rest(EPOCH)),
        ("yesterday.csv", at_rest(EPOCH - 86_400)),
        ("zero.csv", at_rest(0)),
    ]);
    let asked = |plan| ["flown.csv", "--plan", plan, "--tube", "1"];
    for (plan, source) in [("planned.csv", "deduced"), ("zero.csv", "inferred")] {
        let ran = audit(folder.path(), &asked(plan));
        assert_eq!(ran.exit, Some(0), "{plan}: {ran:?}");
        assert_eq!(facts(folder.path(), &asked(plan), "side-file-clock")[0].0, source, "{plan}");
        assert_eq!(facts(folder.path(), &asked(plan), "side-file-axes")[0].1, "x, y and z");
    }
    let given = [&asked("zero.csv")[..], &["--plan-delay", "0"]].concat();
    assert_eq!(facts(folder.path(), &given, "side-file-clock")[0].0, "declared");
    for arguments in [asked("yesterday.csv").to_vec(), [&asked("zero.csv")[..], &["--plan-delay", "900"]].concat()] {
        let ran = audit(folder.path(), &arguments);
        assert_eq!((ran.exit, ran.code()), (Some(2), "audit/side-file-clock"), "{ran:?}");
        assert!(said(&ran).contains("the judged flight from 0.00 s to 20.00 s"), "{ran:?}");
    }
}

#[test]
fn a_flight_in_space_is_within_a_plane_plan_in_the_plane_only() {
    let plane = "t_s,id,x,y\n0,a,0,0\n0,b,0,30\n20,a,0,0\n20,b,0,30\n".to_owned();
    let folder = folder(&[("flown.csv", at_rest(0)), ("plane.csv", plane.clone()), ("flat.csv", plane)]);
    let asked = ["flown.csv", "--plan", "plane.csv", "--plan-delay", "0", "--tube", "1"];
    let ran = audit(folder.path(), &asked);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    assert!(ran.out.contains(" m of the plan in the plane of x and y, "), "{ran:?}");
    let assumed = "flight and plan have equal heights, which are not compared";
    assert!(ran.out.starts_with("CLEAR if ") && ran.out.lines().next().is_some_and(|line| line.contains(assumed)));
    let report: Value =
        serde_json::from_str(&audit(folder.path(), &[&asked[..], &["--json"]].concat()).out).expect("JSON");
    assert_eq!((report::facts(&report, "plan-plane").len(), &report["proved"]), (1, &false.into()), "{report}");
    assert_eq!(report["plan"]["planar"], true);
    assert_eq!(facts(folder.path(), &asked, "side-file-axes"), [("deduced".to_owned(), "x and y".to_owned())]);
    // A flight without heights says so itself.
    let flat = audit(folder.path(), &["flat.csv", "--plan", "plane.csv", "--plan-delay", "0", "--tube", "1"]);
    assert!(flat.out.contains("no heights are known") && !flat.out.contains(assumed), "{flat:?}");
}

#[test]
fn a_plan_has_the_origin_of_its_flight() {
    // Two vehicles at rest, 111 m apart in latitude.
    let table = |south: f64| {
        let rows = |t: u8| format!("{t},a,{:?},8,500\n{t},b,{:?},8,500\n", 47.0 - south, 47.001 - south);
        format!("t_s,id,lat,lon,altitude_m\n{}{}", rows(0), rows(10))
    };
    let metres = "t_s,id,x,y,z\n0,a,0,0,0\n0,b,0,111.2,0\n10,a,0,0,0\n10,b,0,111.2,0\n".to_owned();
    let folder = folder(&[("flown.csv", table(0.0)), ("south.csv", table(0.001)), ("metres.csv", metres)]);
    let asked = |flight, plan| [flight, "--plan", plan, "--plan-delay", "0", "--tube", "0.5"];
    let judged = |arguments: &[&str]| audit(folder.path(), arguments);
    fs::copy(folder.path().join("flown.csv"), folder.path().join("planned.csv")).expect("a copy");
    assert_eq!(judged(&asked("flown.csv", "planned.csv")).exit, Some(0));
    let frame = facts(folder.path(), &asked("flown.csv", "planned.csv"), "side-file-frame");
    assert_eq!(frame, [("deduced".to_owned(), "east, north and up of 47.0,8.0,500.0".to_owned())]);
    for origin in [&[][..], &["--origin", "47,8,500"], &["--origin", "46.999,8,500"]] {
        let away = judged(&[&asked("flown.csv", "south.csv")[..], origin].concat());
        assert!(away.exit == Some(1) && away.out.contains("111.1"), "{origin:?}: {away:?}");
    }
    // Metres need an origin on the Earth.
    for (flight, plan) in [("flown.csv", "metres.csv"), ("metres.csv", "flown.csv")] {
        let mixed = judged(&asked(flight, plan));
        assert_eq!((mixed.exit, mixed.code()), (Some(2), "recording/several-frames"), "{mixed:?}");
    }
    let declared = [&asked("flown.csv", "metres.csv")[..], &["--origin", "47,8,500"]].concat();
    assert_eq!(judged(&declared).exit, Some(0));
    assert_eq!(facts(folder.path(), &declared, "side-file-frame")[0].0, "declared");
    let folder_plan = judged(&asked("metres.csv", "."));
    assert_eq!((folder_plan.exit, folder_plan.out.as_str()), (Some(2), ""), "{folder_plan:?}");
    let live = ran_by(TAUTLINE, folder.path(), &["watch", "-", "--delta", "1", "--plan", "south.csv", "--tube", "1"]);
    assert_eq!((live.exit, live.code()), (Some(2), "recording/several-frames"), "{live:?}");
}

#[test]
fn a_guessed_unit_of_time_is_not_exported() {
    let table = |name: &str| at_rest(0).replace("t_s,", &format!("{name},"));
    let folder = folder(&[("guess.csv", table("t")), ("seconds.csv", table("t_s"))]);
    let export = |arguments: &[&str]| ran_by(TAUTLINE, folder.path(), &[&["export"], arguments].concat());
    let refused = export(&["guess.csv", "--out", "out.csv"]);
    assert_eq!((refused.exit, refused.code()), (Some(2), "export/guessed-time-unit"), "{refused:?}");
    assert!(!folder.path().join("out.csv").exists());
    assert_eq!(export(&["guess.csv", "--time-unit", "s", "--out", "out.csv"]).exit, Some(0));
    assert_eq!(export(&["seconds.csv", "--out", "other.csv"]).exit, Some(0));
    // A unit that contradicts the name of the column is refused.
    let other = audit(folder.path(), &["seconds.csv", "--delta", "1", "--time-unit", "ms"]);
    assert_eq!((other.exit, other.code()), (Some(2), "recording/unit-conflict"), "{other:?}");
}

#[test]
fn one_jump_does_not_show_that_times_are_in_seconds() {
    // 30 m/s, in milliseconds with decimals, with a jump of 10 m.
    let table = |jump_m: f64| {
        let row = |k: u32| {
            let x = 0.5 * f64::from(k) + if k == 7 { jump_m } else { 0.0 };
            format!("{:?},a,{x:?},0,1\n{:?},b,{x:?},20,1\n", 16.667 * f64::from(k), 16.667 * f64::from(k))
        };
        format!("t,id,x,y,z\n{}", (0..60).map(row).collect::<String>())
    };
    let uptime = (0..60).map(|k| {
        let (t, x) = (500_000_000 + 10_000 * k, 0.3 * f64::from(k));
        format!("{t},a,{x:?},0,1\n{},b,{x:?},20,1\n", t + 300)
    });
    let uptime = format!("timestamp,id,x,y,z\n{}", uptime.collect::<String>());
    let folder = folder(&[("smooth.csv", table(0.0)), ("jump.csv", table(10.0)), ("uptime.csv", uptime)]);
    for name in ["smooth.csv", "jump.csv", "uptime.csv"] {
        let ran = audit(folder.path(), &[name, "--delta", "1", "--limit", "speed=5"]);
        assert_eq!((ran.exit, ran.code()), (Some(2), "audit/guessed-time-unit"), "{name}: {ran:?}");
    }
    let given = audit(folder.path(), &["uptime.csv", "--delta", "1", "--limit", "speed=5", "--time-unit", "us"]);
    assert_eq!(given.exit, Some(1), "{given:?}");
}

#[test]
fn a_plan_has_the_axes_and_heights_of_its_flight() {
    let earth = |height: &str| {
        let rows = |t: u8| format!("{t},a,47,8,500\n{t},b,47.001,8,500\n");
        format!("t_s,id,lat,lon,{height}\n{}{}", rows(0), rows(10))
    };
    let folder = folder(&[
        ("metres.csv", at_rest(0)),
        ("sea.csv", earth("alt_msl_m")),
        ("ground.csv", earth("relative_alt_m")),
        ("level.csv", earth("alt_m")),
    ]);
    let asked = |flight, plan, more: &[&str]| {
        audit(folder.path(), &[&[flight, "--plan", plan, "--plan-delay", "0", "--tube", "1"][..], more].concat())
    };
    for more in [&["--axes", "ned"][..], &["--scale", "0.001"]] {
        let turned = asked("metres.csv", "metres.csv", more);
        assert_eq!((turned.exit, turned.code()), (Some(2), "audit/plan-frame"), "{turned:?}");
    }
    let other = asked("sea.csv", "ground.csv", &[]);
    assert_eq!((other.exit, other.code()), (Some(2), "audit/plan-frame"), "{other:?}");
    assert!(!asked("sea.csv", "sea.csv", &[]).out.contains("one reference"));
    let assumed = asked("sea.csv", "level.csv", &[]);
    assert!(assumed.exit == Some(0) && assumed.out.contains("heights of flight and plan have one reference"));
}
