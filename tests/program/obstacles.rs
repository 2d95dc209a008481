//! Scenarios with obstacles.

use std::fs;

use serde_json::Value;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{closest_obstacle, number, reason, reasons, violations};

const SCENARIO: &str = r#"[swarm]
count = 3
[start]
positions_m = [[-6, 0], [-6, 3], [-8, 0]]
[formation]
shape = "points"
points_m = [[6, -1], [6, 1], [4, 0]]
[reference]
kind = "rest"
[[obstacle]]
name = "tower"
ball = { radius_m = 1.0 }
at_m = [0.0, 0.3, 0.0]
[[obstacle]]
name = "wall"
box = { size_m = [4.0, 1.0, 3.0], yaw_deg = 33.3 }
at_m = [0.0, 6.0, 0.0]
clearance_m = 0.7
[law]
kind = "displacement"
delta_m = 1.0
[time]
duration_s = 25
"#;

/// A vehicle flies into the tower under a law without obstacle avoidance.
const HIT: &str = r#"[swarm]
count = 2
[start]
positions_m = [[-5, 0], [-5, 3]]
velocities_m_s = [[2, 0], [2, 0]]
[formation]
shape = "points"
points_m = [[0, 0], [0, 3]]
[[obstacle]]
name = "tower"
ball = { radius_m = 1.0 }
at_m = [0.0, 0.0, 0.0]
[law]
kind = "laplacian"
delta_m = 1.0
[time]
duration_s = 8
"#;

fn folder(scenario: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("among.toml"), scenario).expect("a file");
    folder
}

fn ran(folder: &tempfile::TempDir, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder.path(), arguments)
}

fn json(ran: &Ran) -> Value {
    serde_json::from_str(&ran.out).unwrap_or_else(|error| panic!("{error}: {}", ran.err))
}

#[test]
fn obstacles_are_in_check_run_report_and_audit() {
    let folder = folder(SCENARIO);
    let checked = json(&ran(&folder, &["check", "among.toml", "--json"]));
    let promised_m = checked["certified_clearance_margin_m"].as_f64().expect("a promise");
    assert!(promised_m > 0.0 && checked["start_clearance_margin_m"].as_f64().expect("room") > 3.9, "{checked}");
    let flown = ran(&folder, &["run", "among.toml", "--json", "--no-figures", "--no-snapshots"]);
    assert_eq!(flown.exit, Some(0), "{}", flown.err);
    let report = json(&flown);
    assert_eq!((report["pass"].as_bool(), report["status"].as_str()), (Some(true), Some("clear")));
    assert_eq!(number(&report, "/certificate/clearance_margin_m"), promised_m);
    let nearest = closest_obstacle(&report);
    let (min_m, clearance_m) = (number(nearest, "/value/lower"), number(nearest, "/limit"));
    assert!(nearest["subjects"][1] == "tower" && clearance_m == 0.5 && min_m >= clearance_m + promised_m, "{nearest}");
    assert!(violations(&report).is_empty(), "{report}");

    let audited = ran(&folder, &["audit", "out/among/run.mcap", "--json"]);
    let audit = json(&audited);
    assert_eq!((audited.exit, audit["status"].as_str()), (Some(0), Some("clear")), "{}", audited.err);
    assert!(audited.err.contains("the obstacles are the recording's own: tower, wall"), "{}", audited.err);
    assert_eq!(closest_obstacle(&audit)["subjects"], nearest["subjects"]);
    let other = "[[obstacle]]\nname = \"tree\"\nball = { radius_m = 0.5 }\nat_m = [6.0, 1.0, 0.0]\n";
    fs::write(folder.path().join("other.toml"), other).expect("a file");
    let other = ran(&folder, &["audit", "out/among/run.mcap", "--obstacles", "other.toml"]);
    assert_eq!(other.exit, Some(1), "others than its own, where a slot is: {}", other.out);
    assert!(other.out.contains("tree") && !other.out.contains("tower"), "{}", other.out);
    assert!(other.err.contains("are not judged: --obstacles names others"), "{}", other.err);
    let scaled = json(&ran(&folder, &["audit", "out/among/run.mcap", "--scale", "2", "--json"]));
    let drawn = json(&ran(&folder, &["audit", "out/among/run.mcap", "--independent", "--json"]));
    let least_m = |audit: &Value| number(closest_obstacle(audit), "/value/lower");
    assert!((least_m(&scaled) - 2.0 * least_m(&drawn)).abs() < 1e-9, "obstacles are scaled as positions are");
    assert!((least_m(&audit) - min_m).abs() < 1e-12, "the run's audit is repeated");
    fs::write(folder.path().join("none.toml"), "").expect("a file");
    let none = ran(&folder, &["audit", "out/among/run.mcap", "--obstacles", "none.toml"]);
    assert!(none.exit == Some(2) && none.err.contains("the file has no [[obstacle]]"), "{}", none.err);

    // The recording contains the scenario with exact obstacles.
    let held = ran(&folder, &["list", "--show", "out/among/run.mcap"]).out;
    fs::write(folder.path().join("held.toml"), held).expect("a file");
    let again =
        json(&ran(&folder, &["run", "held.toml", "--json", "--no-figures", "--no-snapshots", "--out", "again"]));
    assert_eq!(
        (&again["run"]["state_hash"], &again["scenario"]["sha256"]),
        (&report["run"]["state_hash"], &report["scenario"]["sha256"])
    );
}

#[test]
fn a_collision_with_an_obstacle_fails_in_every_output_and_between_samples() {
    let folder = folder(HIT);
    let flown = ran(&folder, &["run", "among.toml", "--json", "--no-figures", "--no-snapshots"]);
    let report = json(&flown);
    assert_eq!((flown.exit, report["status"].as_str()), (Some(1), Some("violation")), "{}", flown.err);
    let found = violations(&report);
    assert!(
        !found.is_empty() && found.iter().all(|found| found["subjects"][1] == "tower"),
        "no two vehicles: {report}"
    );
    assert_eq!(reasons(&report)[0], "obstacle-violation");
    let reason = reason(&report, "obstacle-violation");
    assert_eq!((&reason["data"]["vehicle"], &reason["data"]["obstacle"]), (&1.into(), &"tower".into()), "{reason}");
    let text = reason["text"].as_str().expect("a text");
    assert!(text.starts_with("A vehicle came too near to an obstacle: vehicle 1"), "{reason}");
    let words = ran(&folder, &["run", "among.toml", "--force", "--no-figures", "--no-snapshots"]);
    assert!(words.out.starts_with("VIOLATION: vehicle 1 came to 0.25"), "{}", words.out);
    let audited = ran(&folder, &["audit", "out/among/run.mcap"]);
    assert_eq!(audited.exit, Some(1), "{}", audited.out);
    assert!(audited.out.starts_with("VIOLATION: 1 and tower"), "{}", audited.out);

    // One vehicle and an obstacle have a separation, also with limits of single vehicles.
    for (vehicle, exit, status) in [("1", 1, "violation"), ("2", 0, "clear")] {
        let words = ["audit", "out/among/run.mcap", "--ids", vehicle, "--limit", "speed=50", "--json"];
        let audited = ran(&folder, &words);
        let audit = json(&audited);
        assert_eq!((audited.exit, audit["status"].as_str()), (Some(exit), Some(status)), "{}", audited.err);
        assert!(audited.err.contains("the obstacles are the recording's own: tower"), "{}", audited.err);
        assert_eq!(closest_obstacle(&audit)["subjects"], serde_json::json!([vehicle, "tower"]));
    }
}

#[test]
fn wrong_obstacles_are_refused_with_place_and_remedy() {
    let folder = folder(&SCENARIO.replace("[0.0, 0.3, 0.0]", "[-6.0, 1.2, 0.0]"));
    for command in ["check", "run"] {
        let ran = ran(&folder, &[command, "among.toml"]);
        assert_eq!((ran.exit, ran.code()), (Some(2), "scenario/near-obstacle"), "{}", ran.err);
        assert!(ran.err.contains("among.toml:") && ran.err.contains("help:"), "{}", ran.err);
        assert!(!folder.path().join("out").exists());
    }
}

#[test]
fn a_law_without_obstacle_avoidance_has_no_certificate_among_obstacles() {
    let folder =
        folder(&SCENARIO.replace("[reference]\nkind = \"rest\"\n", "").replace("\"displacement\"", "\"edge-tension\""));
    let checked = ran(&folder, &["check", "among.toml"]);
    assert_eq!(checked.exit, Some(0), "{}", checked.err);
    let said = checked.out + &checked.err;
    assert!(said.contains("does not keep clear of obstacles"), "{said}");
}
