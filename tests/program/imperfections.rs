//! Sensing, network, actuation and failures: what is wrong is refused at its place, and the built-in leader shows what it says.

use serde_json::Value;

use crate::program::{TAUTLINE, ran_by};

#[test]
fn a_wrong_imperfection_is_refused_with_place_value_and_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    let ideal = "plant.kind=ideal";
    let cases: [(&[&str], &str, &str); 24] = [
        (&["sensing.position_noise_m=-0.1"], "position is -0.1", "at least 0"),
        (&["sensing.position_noise_m=nan"], "not a number", "finite"),
        (&["sensing.position_noise_m=0.1"], "drawn anew with each measurement", "sensing.rate_hz"),
        (&["sensing.rate_hz=0"], "the rate of measurements is 0", "more than 0"),
        (&["sensing.latency_s=200"], "is 200 s in a flight of 120 s", "enlarge time.duration_s"),
        (&["sensing.latency_s=1e-9"], "is 0.000000001 s", "at least 0.000001"),
        (&["sensing.rate_hz=100", ideal], "continuous time", "actuation.control_hz"),
        (&["network.loss=1.5", "network.rate_hz=50"], "is 1.5", "at most 1"),
        (&["network.loss=-0.5", "network.rate_hz=50"], "is -0.5", "at least 0"),
        (&["network.loss=0.1"], "nothing says how often", "set network.rate_hz"),
        (&["network.jitter_s=0.1"], "nothing says how often", "set network.rate_hz"),
        (&["network.loss=0.8", "network.loss_burst=2", "network.rate_hz=50"], "bursts of 2 lost", "at least 4"),
        (&["network.latency_s=121"], "is 121 s in a flight", "enlarge time.duration_s"),
        (&["network.missing=guess"], "guess", "extrapolate"),
        (
            &["network.rate_hz=50", "network.failure=[{link=[1, 9], from_s=1}]"],
            "no link between vehicles 1 and 9",
            "edge of",
        ),
        (
            &["network.rate_hz=50", "network.failure=[{link=[1, 2], from_s=3, to_s=2}]"],
            "from 3 s to 2 s",
            "later than that",
        ),
        (&["network.rate_hz=1e8"], "messages a second are more than 10 in a step", "send at most 2400"),
        (&["actuation.max_accel_m_s2=0"], "largest acceleration is 0", "more than 0"),
        (&["actuation.lag_s=0.1", ideal], "without a lag", "plant.kind"),
        (&["actuation.control_hz=50", "time.control_hz=60"], "both are the control rate", "keep one"),
        (&["failure=[{vehicle=6, at_s=1, kind=\"dead\"}]"], "vehicle 6 is to fail, and there are 5", "counted from 1"),
        (&["failure=[{vehicle=1, at_s=500, kind=\"dead\"}]"], "at 500 s", "within the flight"),
        (&["failure=[{vehicle=1, at_s=5, kind=\"silent\"}]"], "nothing says how often", "set network.rate_hz"),
        (&["failure=[{vehicle=1, at_s=5, kind=\"frozen\"}]", ideal], "hold no command", "actuation.control_hz"),
    ];
    for (sets, said, remedy) in cases {
        let mut arguments = vec!["check", "pentagon"];
        for set in sets {
            arguments.extend(["--set", set]);
        }
        let ran = ran_by(TAUTLINE, folder.path(), &arguments);
        let message = ran.err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" ");
        assert_eq!(ran.exit, Some(2), "{sets:?}: {message}");
        assert!(message.contains(said) && message.contains(remedy), "{sets:?}: {message}");
        assert!(message.contains("--set:1:") && !message.contains("panicked"), "{sets:?}: {message}");
    }
}

#[test]
fn what_is_lost_does_no_harm_where_it_is_carried_along_and_does_where_it_is_held() {
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
    // 40 s at 50 Hz on eight links one way, the first message at once.
    assert_eq!(count("sent"), 2001.0 * 8.0);
    assert!((0.08..0.13).contains(&(count("lost") / count("sent"))), "{network}");
    assert!(count("age_p95_s") > 0.03, "{network}");
    assert_eq!(report["separation"]["certified_m"], Value::Null);
    let (exit, report) = fly(&["--set", "network.missing=hold"]);
    assert_eq!((exit, &report["formation"]["reached"]), (Some(1), &Value::Bool(false)));
}

/// Three on their slots around a place, in a wind that does not change.
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
fn a_swarm_that_leans_into_a_wind_spreads_no_slots_and_is_promised_no_arrival() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("leaning.toml"), LEANING).expect("a file");
    let ran = ran_by(TAUTLINE, folder.path(), &["run", "leaning.toml", "--json", "--no-snapshots"]);
    let report: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON");
    assert!(report.get("breaths").is_none(), "{}", report["breaths"]);
    let formation = &report["formation"];
    assert_eq!((&formation["reached"], &formation["at_rest"]), (&false.into(), &serde_json::Value::Null));
    assert!(formation["max_edge_error_m"].as_f64().expect("a number") < 0.01, "they lean alike");
    assert!(!ran.err.contains("more time may help"), "{}", ran.err);
}

#[test]
fn a_vehicle_that_failed_is_named_where_it_matters() {
    let folder = tempfile::tempdir().expect("a folder");
    let dead = ["--set", "failure=[{vehicle=3, at_s=1, kind=\"dead\"}]"];
    let quick = ["--set", "time.duration_s=6", "--json", "--no-snapshots"];
    let ran = ran_by(TAUTLINE, folder.path(), &[&["run", "pentagon"], &dead[..], &quick].concat());
    let report: serde_json::Value = serde_json::from_str(&ran.out).expect(&ran.err);
    assert_eq!(report["failures"], serde_json::json!([{"vehicle": 3, "at_s": 1.0, "kind": "dead"}]));
    assert!(ran.err.contains("Failed: vehicle 3 (dead) at 1 s."), "{}", ran.err);
    assert!(!ran.err.contains("more time may help"), "{}", ran.err);
}
