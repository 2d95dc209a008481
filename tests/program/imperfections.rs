//! Sensing, network, actuation and failures: refusals with their place, and the built-in leader.

use serde_json::Value;

use crate::program::{TAUTLINE, ran_by};
use crate::report::at;

#[test]
fn a_wrong_imperfection_is_refused_with_place_value_and_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    let ran = ran_by(TAUTLINE, folder.path(), &["check", "pentagon", "--set", "network.loss=0.1"]);
    assert_eq!((ran.exit, ran.code()), (Some(2), "scenario/missing-key"), "{}", ran.err);
    assert!(ran.err.contains("--set:1:") && ran.err.contains("set network.rate_hz"), "{}", ran.err);
}

#[test]
fn extrapolation_of_lost_messages_is_harmless_and_holding_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let fly = |more: &[&str]| {
        let ran =
            ran_by(TAUTLINE, folder.path(), &[&["run", "leader-lossy", "--json", "--quiet", "--force"], more].concat());
        let report: Value = serde_json::from_str(&ran.out).unwrap_or_else(|_| panic!("{}", ran.err));
        (ran.exit, report)
    };
    let (exit, report) = fly(&[]);
    assert_eq!((exit, &report["formation"]["reached"]), (Some(0), &Value::Bool(true)), "{report:#}");
    let network = &report["network"];
    let count = |key: &str| network[key].as_f64().expect(key);
    // 40 s at 50 Hz on eight one-way links, the first message at the start.
    assert_eq!(count("sent"), 2001.0 * 8.0);
    assert!((0.08..0.13).contains(&(count("lost") / count("sent"))), "{network}");
    assert!(count("age_p95_s") > 0.03, "{network}");
    assert_eq!(*at(&report, "/certificate/separation_m"), Value::Null);
    let (exit, report) = fly(&["--set", "network.missing=hold"]);
    assert_eq!((exit, &report["formation"]["reached"]), (Some(1), &Value::Bool(false)));
}

/// Three vehicles in formation around a point, in a constant wind.
const LEANING: &str = r#"[start]
positions_m = [[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]]
[formation]
shape = "points"
points_m = [[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]]
[reference]
kind = "rest"
[vehicle]
drag_per_s = 0.5
[wind]
mean_m_s = [3.0, 0.0]
[law]
kind = "displacement"
delta_m = 0.6
[time]
duration_s = 40.0
"#;

#[test]
fn a_constant_wind_spreads_no_slots_and_certifies_no_arrival() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("leaning.toml"), LEANING).expect("a file");
    let ran = ran_by(TAUTLINE, folder.path(), &["run", "leaning.toml", "--json", "--no-snapshots"]);
    let report: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON");
    assert!(report.get("deadlock_recoveries").is_none(), "{}", report["deadlock_recoveries"]);
    let formation = &report["formation"];
    assert_eq!((&formation["reached"], &formation["at_rest"]), (&false.into(), &serde_json::Value::Null));
    assert!(formation["max_edge_error_m"].as_f64().expect("a number") < 0.01, "they lean alike");
    assert!(!ran.err.contains("more time may help"), "{}", ran.err);
}

#[test]
fn a_failed_vehicle_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let dead = ["--set", "failure=[{vehicle=3, at_s=1, kind=\"dead\"}]"];
    let quick = ["--set", "time.duration_s=6", "--json", "--no-snapshots"];
    let ran = ran_by(TAUTLINE, folder.path(), &[&["run", "pentagon"], &dead[..], &quick].concat());
    let report: serde_json::Value = serde_json::from_str(&ran.out).expect(&ran.err);
    assert_eq!(report["failures"], serde_json::json!([{"vehicle": 3, "at_s": 1.0, "kind": "dead"}]));
    assert!(ran.err.contains("Failed: vehicle 3 (dead) at 1 s."), "{}", ran.err);
    assert!(!ran.err.contains("more time may help"), "{}", ran.err);
}
