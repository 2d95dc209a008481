//! `tautline check`, and the warnings of `tautline run`.

use std::path::Path;

use crate::program::{TAUTLINE, ran_by};
use crate::report::{SEPARATION, at, least, part};
use serde_json::Value;

fn tautline(arguments: &[&str]) -> (i32, String, String) {
    let ran = ran_by(TAUTLINE, Path::new(env!("CARGO_TARGET_TMPDIR")), arguments);
    (ran.exit.expect("a code"), ran.out, ran.err)
}

fn json(arguments: &[&str]) -> (i32, Value) {
    let arguments: Vec<_> = ["check"].iter().chain(arguments).chain(&["--json"]).copied().collect();
    let (code, out, _) = tautline(&arguments);
    (code, serde_json::from_str(&out).expect("JSON alone on standard output"))
}

fn codes(found: &Value) -> Vec<&str> {
    found["warnings"].as_array().expect("a list").iter().filter_map(|warning| warning["code"].as_str()).collect()
}

#[test]
fn the_pentagon_has_the_known_numbers() {
    let (code, found) = json(&["pentagon"]);
    assert_eq!((code, found["algebraic_connectivity"].as_f64()), (0, Some(5.0)));
    let number = |key: &str| found[key].as_f64().expect("a number");
    assert!((number("certified_m") - 2.055_307).abs() < 1e-5);
    assert!((number("velocity_margin_per_s") - 1.0).abs() < 1e-9);
    assert_eq!(codes(&found), [""; 0]);
}

#[test]
fn a_star_of_twelve_is_refused() {
    let star = [
        "circle",
        "--set",
        "start={shape=\"circle\", radius_m=12.0, jitter_m=0.1}",
        "--set",
        "swarm.count=12",
        "--set",
        "formation.radius_m=10.0",
        "--set",
        "graph={kind=\"star\"}",
    ];
    let (code, found) = json(&star);
    assert!((found["velocity_margin_per_s"].as_f64().expect("a number") + 0.1 / 12.0).abs() < 1e-9, "{found}");
    assert_eq!((code, codes(&found)[0]), (1, "relative-velocity-unstable"));
    let (code, found) = json(&[&star[..], &["--set", "swarm.count=10"]].concat());
    assert_eq!(code, 0, "ten are damped: {found}");
    assert!(found["certified_m"].is_null() && found["certified_edges_m"].as_f64().is_some(), "{found}");
    let (_, out, _) = tautline(&[&["check"], &star[..], &["--set", "swarm.count=10"]].concat());
    assert!(out.contains("pairs joined by an edge never come closer than") && !out.contains("may grow"), "{out}");
    assert!(!out.contains("algebraic convergence"), "{out}");
}

#[test]
fn a_circle_in_space_is_a_warning_and_a_line_is_refused() {
    let (code, found) = json(&["circle", "--set", "swarm.dimensions=3"]);
    assert!(code == 0 && codes(&found).contains(&"flat-formation-in-space"), "{found}");
    let (_, out, _) = tautline(&["check", "circle", "--set", "swarm.dimensions=3"]);
    assert!(out.contains("algebraic convergence at best"), "there it is true: {out}");
    let (code, found) = json(&["pentagon-collinear"]);
    assert!(code == 1 && codes(&found).contains(&"start-on-line"), "{found}");
}

#[test]
fn wrong_input_and_a_bad_flight_have_different_exit_codes() {
    for arguments in [
        &["check", "no-such-scenario"][..],
        &["check", "pentagon", "--set", "law.delta_m=3.0"],
        &["check", "pentagon", "--set", "nonsense"],
        &["check", "--nonsense"],
    ] {
        let (code, out, err) = tautline(arguments);
        assert_eq!((code, out.as_str()), (2, ""), "{arguments:?}: {err}");
        assert!(!err.is_empty());
    }
}

#[test]
fn an_unresolved_drift_is_refused() {
    let check = |sets: &[&str]| json(&sets.iter().flat_map(|set| ["--set", set]).collect::<Vec<_>>());
    let (code, found) = check(&["swarm.a22_per_s=0.5"]);
    assert_eq!((code, codes(&found)[0]), (1, "drift-unresolved"), "{found}");
    let (code, found) = check(&["time.duration_s=400"]);
    assert_eq!(code, 0, "{found}");
    let (code, found) = check(&["time.duration_s=310"]);
    assert_eq!(code, 0, "{found}");
    assert!(found["drift_note"].as_str().expect("words").contains("this changes no separation"), "{found}");
}

#[test]
fn text_goes_to_standard_output_unless_quiet() {
    let (code, out, err) = tautline(&["check", "pentagon-laplacian"]);
    assert!(code == 0 && out.starts_with("READY: ") && out.contains("warning [no-certificate]: ") && err.is_empty());
    assert_eq!(tautline(&["check", "pentagon-collinear", "--quiet"]), (1, String::new(), String::new()));
}

#[test]
fn laws_without_a_name_and_vehicles_too_close_are_named() {
    let (code, _, err) = tautline(&["compare", "pentagon", "--laws=", "--runs", "1"]);
    assert!(code == 2 && err.contains("the name of a law is empty"), "{err}");
    let (code, _, err) = tautline(&["check", "--set", "start.positions_m.1=[9.0000001, 1.0]"]);
    assert!(code == 2 && err.contains("vehicles 1 and 2 start 1.050 m apart, not more than delta = 2 m"), "{err}");
}

#[test]
fn run_warns_before_it_flies_and_not_when_quiet() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let out = out.to_str().expect("a path in Unicode");
    let run = ["run", "pentagon-collinear", "--set", "time.duration_s=1.5", "--force", "--out", out];
    let (code, _, err) = tautline(&run);
    assert!(code == 1 && err.contains("warning [start-on-line]: "), "{err}");
    let (_, out, err) = tautline(&[&run[..], &["--quiet"]].concat());
    assert_eq!((out.as_str(), err.as_str()), ("", ""));
}

#[test]
fn run_flies_the_ideal_plant_when_asked() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let out = out.to_str().expect("a path in Unicode");
    let run = ["run", "pentagon", "--plant", "ideal", "--set", "time.duration_s=3", "--json", "--out", out];
    let (code, report, err) = tautline(&run);
    let report: Value = serde_json::from_str(&report).expect("JSON alone on standard output");
    assert_eq!(code, 1, "three seconds are too short to reach the formation");
    assert!((least(&report) - 2.460_353).abs() < 2e-6, "{report}");
    assert!(at(part(&report, SEPARATION), "/detectors/rapier_contact_pairs").is_null(), "{report}");
    assert!(!err.contains("warning"), "{err}");
    let (code, ..) = tautline(&["run", "pentagon", "--plant", "perfect", "--out", out]);
    assert_eq!(code, 2);
}

#[test]
fn identify_measures_quadrotors_only_and_keeps_other_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let ran = |arguments: &[&str]| ran_by(TAUTLINE, folder.path(), &[&["check"], arguments].concat());
    let points = ran(&["pentagon", "--identify"]);
    assert!(points.exit == Some(2) && points.err.contains("only the tracking error of quadrotors"), "{points:?}");
    assert_eq!(ran(&["pentagon", "--out", "model.toml"]).exit, Some(2), "--out needs --identify");
    std::fs::write(folder.path().join("notes.toml"), "notes = 1\n").expect("a file");
    let kept = ran(&["shielded-crazyflies", "--identify", "--out", "notes.toml"]);
    assert!(kept.exit == Some(2) && kept.code() == "files/exists", "{kept:?}");
    assert_eq!(std::fs::read_to_string(folder.path().join("notes.toml")).expect("a file"), "notes = 1\n");
    if std::env::var_os("TAUTLINE_LONG").is_none() {
        return;
    }
    let measured = ran(&["shielded-crazyflies", "--identify", "--json", "--out", "own.toml"]);
    let found: Value = serde_json::from_str(&measured.out).expect("JSON alone");
    let error_m = found["tracking"]["error_m"].as_f64().expect("a number");
    assert!(error_m > found["largest_error_m"].as_f64().expect("a number"), "{found}");
    let table = std::fs::read_to_string(folder.path().join("own.toml")).expect("a model");
    assert!(table.starts_with("# Crazyflie 2.x") && table.contains(&format!("error_m = {error_m}")), "{table}");
    let checked = ran(&["shielded-crazyflies", "--set", "vehicle.model=\"own.toml\""]);
    assert!(checked.exit == Some(0) && checked.out.contains("measured by a search of"), "{checked:?}");
}
