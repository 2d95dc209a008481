//! Cylinders, well clear, named ellipsoids, and the rules of shows.

use std::fs;

use serde_json::{Value, json};

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{at, closest, part, parts, status};

/// Two vehicles that pass 0.25 m aside and 0.5 m above each other, far apart at both samples.
const PASS: &str = "t,id,x,y,z\n0,a,-5,0,5\n0,b,5,0.25,5.5\n1,a,5,0,5\n1,b,-5,0.25,5.5\n";
/// Head-on at 100 m/s from 20 km.
const HEAD_ON: &str = "t,id,x,y,z\n0,a,0,0,100\n0,b,20000,0,100\n300,a,15000,0,100\n300,b,5000,0,100\n";

fn audit(name: &str, text: &str, words: &[&str]) -> Ran {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join(name), text).expect("written");
    let seconds = if text.starts_with("t,") { ["--time-unit", "s"].as_slice() } else { &[] };
    ran_by(TAUTLINE, folder.path(), &[&["audit", name], words, seconds].concat())
}

#[test]
fn a_cylinder_tells_beside_from_above() {
    let clear = audit("pass.csv", PASS, &["--cylinder", "0.5,0.5"]);
    assert_eq!(clear.exit, Some(0), "{clear:?}");
    assert!(
        clear.out.starts_with("CLEAR if straight between samples: never closer than 1.000000 cylinders"),
        "{clear:?}"
    );
    assert_eq!(audit("pass.csv", PASS, &["--delta", "0.7"]).exit, Some(1));
    let near = audit("pass.csv", PASS, &["--cylinder", "0.5,0.8", "--json"]);
    let report: Value = serde_json::from_str(&near.out).expect("JSON");
    let question = &report["question"];
    assert_eq!((near.exit, &question["unit"], &question["delta"]), (Some(1), &"cylinders".into(), &1.0.into()));
    assert_eq!(
        (&question["cylinder_m"], &closest(&report)["value"]["unit"]),
        (&json!([0.5, 0.8]), &"cylinders".into())
    );
}

#[test]
fn well_clear_is_in_every_answer() {
    let lost = audit("traffic.csv", HEAD_ON, &["--well-clear", "do-365", "--until", "170"]);
    assert_eq!(lost.exit, Some(1), "{lost:?}");
    assert!(lost.out.starts_with("VIOLATION: a and b are not well clear from 161."), "{lost:?}");
    let far = audit("traffic.csv", HEAD_ON, &["--well-clear", "f3442", "--until", "170"]);
    assert!(far.exit == Some(0) && far.out.contains("well clear (609.600 m, 76.200 m high)"), "{far:?}");
    let report: Value =
        serde_json::from_str(&audit("traffic.csv", HEAD_ON, &["--well-clear", "1219.2,137.16,35", "--json"]).out)
            .expect("JSON");
    assert_eq!(report["question"]["well_clear"], json!([1219.2, 137.16, 35.0]));
    assert_eq!((parts(&report), status(&report, "well_clear")), (vec!["well_clear"], "violation"));
    assert_eq!(*at(part(&report, "well_clear"), "/violations/listed/0/subjects"), json!(["a", "b"]));
}

#[test]
fn the_replay_shows_a_loss_of_well_clear() {
    let page = |thresholds: &str| {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join("traffic.csv"), HEAD_ON).expect("written");
        let words = ["audit", "traffic.csv", "--well-clear", thresholds, "--until", "170", "--time-unit", "s"];
        ran_by(TAUTLINE, folder.path(), &[&words[..], &["--html", "page.html"]].concat());
        fs::read_to_string(folder.path().join("page.html")).expect("a page")
    };
    let stated = "violation: a and b are not well clear";
    assert!(page("do-365").contains(stated) && !page("f3442").contains(stated));
}

#[test]
fn ellipsoids_have_names() {
    let named = audit("pass.csv", PASS, &["--ellipsoid", "crazyswarm"]);
    let given = audit("pass.csv", PASS, &["--ellipsoid", "0.125,0.125,0.375"]);
    assert_eq!((named.exit, named.out.lines().next()), (given.exit, given.out.lines().next()));
    assert_eq!(audit("pass.csv", PASS, &["--ellipsoid", "crazyflie-firmware"]).exit, Some(1));
}

#[test]
fn wrong_rules_are_refused() {
    let planar = "t,id,x,y\n0,a,0,0\n0,b,5,0\n1,a,0,0\n1,b,5,0\n";
    for (text, words, code) in [
        (PASS, &["--cylinder", "0,1"][..], "audit/out-of-range"),
        (PASS, &["--cylinder", "1,-1"], "audit/out-of-range"),
        (PASS, &["--cylinder", "1"], ""),
        (PASS, &["--cylinder", "1,1", "--ellipsoid", "1,1,1"], "audit/cylinder"),
        (PASS, &["--cylinder", "1,1", "--delta", "1"], "audit/cylinder"),
        (planar, &["--cylinder", "1,1"], "audit/unknown-place"),
        (planar, &["--well-clear", "f3442"], "audit/unknown-place"),
        (PASS, &["--well-clear", "do-178"], ""),
        (PASS, &["--well-clear", "f3442", "--motion", "hold"], "audit/well-clear"),
        (PASS, &["--ellipsoid", "crazyfly"], ""),
        (PASS, &["--rules", "all"], ""),
    ] {
        let ran = audit("pass.csv", text, words);
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{words:?}: {ran:?}");
        let is_well_clear_of_jumps = words.contains(&"hold") && words.contains(&"--well-clear");
        assert!(!is_well_clear_of_jumps || !ran.err.contains("ellipsoid"), "{ran:?}");
    }
}

/// Returns a show of two drones 5 m apart that rise to 10 m in 10 s, and fly 20 m along x in 4 s.
fn show(settings: &str, yaw: &str) -> String {
    let drone = |name: &str, y: u32| {
        format!(
            r#"{{"settings": {{"name": "{name}", {yaw} "trajectory": {{"version": 1, "points":
            [[0, [0, {y}, 0], []], [10, [0, {y}, 10], []], [14, [20, {y}, 10], []]]}}}}}}"#
        )
    };
    format!(
        r#"{{"version": 1, "settings": {settings}, "swarm": {{"drones": [{}, {}]}}}}"#,
        drone("a", 0),
        drone("b", 5)
    )
}

#[test]
fn a_show_is_judged_by_its_own_rules_and_options_override_them() {
    let own = show(r#"{"validation": {"minDistance": 3, "maxVelocityXY": 4, "maxAltitude": 100}}"#, "");
    let fast = audit("show.json", &own, &[]);
    assert!(fast.exit == Some(1) && fast.out.starts_with("VIOLATION: horizontal speed"), "{fast:?}");
    assert!(
        fast.err.contains("limits of the show file: distance 3.0 m, horizontal 4.0 m/s, height 100.0 m"),
        "{fast:?}"
    );
    assert_eq!(audit("show.json", &own, &["--limit", "horizontal=6"]).exit, Some(0));
    assert_eq!(audit("show.json", &own, &["--rules", "none", "--delta", "3"]).exit, Some(0));
    assert_eq!(audit("show.json", &own, &["--limit", "horizontal=6", "--delta", "6"]).exit, Some(1));

    let fenced = |y: u32, inclusion: bool| {
        let fence = format!(
            r#"{{"geofence": {{"version": 1, "polygons": [{{"isInclusion": {inclusion}, "points":
            [[-5, -5, 0], [25, -5, 0], [25, {y}, 0], [-5, {y}, 0]]}}]}}}}"#
        );
        audit("show.json", &show(&fence, ""), &["--delta", "3"])
    };
    assert_eq!([fenced(9, true).exit, fenced(4, true).exit, fenced(9, false).exit], [Some(0), Some(1), Some(1)]);
    assert!(fenced(9, true).err.contains("the fence is that of the show file"));
}

#[test]
fn the_rules_of_skybrush_are_its_defaults() {
    let still = r#""yawControl": {"version": 1, "setpoints": [[0, 0], [2, 60]]},"#;
    let turning = r#""yawControl": {"version": 1, "setpoints": [[0, 0], [2, 61]]},"#;
    let judged = |yaw: &str| audit("show.json", &show("{}", yaw), &["--rules", "skybrush", "--json"]);
    let report = |ran: &Ran| serde_json::from_str::<Value>(&ran.out).expect("JSON");
    assert_eq!(status(&report(&judged(still)), "yaw_rate_deg_s"), "clear");
    assert_eq!(status(&report(&judged(turning)), "yaw_rate_deg_s"), "violation");
    assert_eq!(status(&report(&judged(still)), "navigation_floor_m"), "clear");
    let without = judged("");
    assert!(!parts(&report(&without)).contains(&"yaw_rate_deg_s"), "{without:?}");
    assert!(without.err.contains("not judged: the yaw rate, since the recording has no yaw"), "{without:?}");
}

#[test]
fn unreadable_rules_of_a_show_are_refused_unless_they_are_replaced() {
    const VALID: &str = r#"{"points": [[-5, -5], [25, -5], [25, 9], [-5, 9]]}"#;
    let fence =
        |polygons: &str| format!(r#"{{"validation": {{"minDistance": 3}}, "geofence": {{"polygons": {polygons}}}}}"#);
    let flagged =
        |flag: &str| fence(&format!(r#"[{{"isInclusion": {flag}, "points": [[-5, -5], [25, -5], [25, 9]]}}]"#));
    let bow_tie = fence(&format!(r#"[{VALID}, {{"points": [[0, 0], [9, 9], [9, 0], [0, 9]]}}]"#));
    let delta = ["--delta", "3"].as_slice();
    let replaced = ["--delta", "3", "--limit", "descent=3", "--limit", "climb=3"].as_slice();
    for (settings, named, options) in [
        (bow_tie, "polygon 2 of `settings.geofence`", None),
        (fence(&format!(r#"[{VALID}, {{"points": [[0, 0], [9, 9]]}}]"#)), "got 2", None),
        (flagged("0"), "`isInclusion` must be true or false (0)", None),
        (flagged(r#""false""#), "`isInclusion` must be true or false (\"false\")", None),
        (flagged("null"), "`isInclusion` must be true or false (null)", None),
        (fence(r#""x""#), "`polygons` of `settings.geofence` must be a list (\"x\")", None),
        (fence("{}"), "`polygons` of `settings.geofence` must be a list ({})", None),
        (r#"{"validation": [3]}"#.to_owned(), "`settings.validation` must be an object ([3])", None),
        ("[1]".to_owned(), "`settings` must be an object ([1])", None),
        (r#"{"validation": {"minDistance": "6"}}"#.to_owned(), "minDistance` must be a number above 0", Some(delta)),
        (
            r#"{"validation": {"maxVelocityZ": -1}}"#.to_owned(),
            "--limit descent=NUMBER and --limit climb=",
            Some(replaced),
        ),
    ] {
        let text = show(&settings, "");
        let refused = audit("show.json", &text, options.map_or(delta, |_| &[]));
        assert_eq!((refused.exit, refused.code()), (Some(2), "recording/malformed"), "{settings}: {refused:?}");
        let said = refused.err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" ");
        assert!(said.contains(named) && said.contains("--rules none"), "{named}: {said}");
        let good = options.unwrap_or(&["--delta", "3", "--rules", "none"]);
        assert_eq!(audit("show.json", &text, good).exit, Some(0), "{settings}");
    }
}

#[test]
fn a_limit_of_yaw_rate_needs_readable_setpoints() {
    let jump = r#""yawControl": {"version": 1, "setpoints": [[0, 0], [2, 0], [2, 300]]},"#;
    let judged = |options: &[&str]| audit("show.json", &show("{}", jump), options);
    for options in [&["--rules", "skybrush"][..], &["--delta", "3", "--limit", "yaw-rate=30"]] {
        let refused = judged(options);
        assert_eq!((refused.exit, refused.code()), (Some(2), "recording/malformed"), "{refused:?}");
        assert!(refused.err.contains("times of setpoints must increase"), "{refused:?}");
    }
    assert_eq!(judged(&["--delta", "3"]).exit, Some(0));
}
