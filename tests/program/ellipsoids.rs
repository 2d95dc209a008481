//! Scenarios with ellipsoids: flight, report, and audit of the recording.

use std::fs;

use serde_json::Value;

use crate::program::{TAUTLINE, ran_by};
use crate::report::{at, closest, least, number};

/// Two vehicles that exchange places, the second 0.5 m above the first; the ellipsoid follows below.
const SCENARIO: &str = r#"[start]
positions_m = [[-2.0, 0.1, 0.0], [2.0, 0.0, 0.5]]
[formation]
shape = "points"
points_m = [[0.35, 0.0, 0.0], [-0.35, 0.0, 0.5]]
[swarm]
hull_radius_m = 0.1
[time]
duration_s = 8.0
[law]
kind = "displacement"
"#;

const ELLIPSOID: &str = "[safety]\nshape = \"ellipsoid\"\nhalf_axes_m = [0.2, 0.2, 0.6]\n";

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

#[test]
fn ellipsoids_are_reported_in_both_metrics_and_their_recording_is_judged_with_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let ran = |arguments: &[&str]| ran_by(TAUTLINE, folder.path(), arguments);
    for (name, safety) in [("ellipsoids", ELLIPSOID), ("balls", "delta_m = 0.4\n")] {
        fs::write(folder.path().join(format!("{name}.toml")), format!("{SCENARIO}{safety}")).expect("a file");
    }
    let flown = json(&ran(&["run", "ellipsoids.toml", "--json", "--no-snapshots"]).out);
    assert_eq!((&flown["question"]["delta"], &flown["status"]), (&json("0.4"), &json("\"clear\"")));
    for path in ["/question/ellipsoid_m", "/ellipsoid/half_axes_m"] {
        assert_eq!(*at(&flown, path), json("[0.2, 0.2, 0.6]"));
    }
    let (scaled, metres) = (least(&flown), number(&flown, "/ellipsoid/min_distance_m"));
    assert_eq!(closest(&flown)["value"]["unit"], "m, scaled");
    assert!(number(&flown, "/certificate/separation_m") < scaled && scaled <= metres);
    assert_eq!(json(&ran(&["check", "ellipsoids.toml", "--json"]).out)["half_axes_m"], json("[0.2, 0.2, 0.6]"));

    // The audit measures in half axes, where two touch at 2: 0.4 m of the report are 2.
    let audited = ran(&["audit", "out/ellipsoids/run.mcap", "--json"]);
    let judged = json(&audited.out);
    assert_eq!((audited.exit, &judged["question"]["unit"]), (Some(0), &json("\"ellipsoids\"")), "{}", audited.err);
    assert_eq!(closest(&judged)["value"]["unit"], "ellipsoids");
    assert!((least(&judged) - scaled / 0.2).abs() < 1e-6, "{}", closest(&judged));
    assert!(audited.err.contains("the ellipsoid is the recording's own, with half axes of 0.2, 0.2 and 0.6 m"));
    let page = fs::read_to_string(folder.path().join("out/ellipsoids/figures/distances.svg")).expect("a figure");
    assert!(page.contains("scaled to ellipsoids"));

    assert_eq!(json(&ran(&["run", "balls.toml", "--json", "--no-snapshots"]).out)["status"], "clear");
    let of_balls = |more: &[&str]| ran(&[&["audit", "out/balls/run.mcap"], more].concat()).exit;
    assert_eq!((of_balls(&[]), of_balls(&["--ellipsoid", "0.2,0.2,0.6"])), (Some(0), Some(1)));
}

#[test]
fn the_audit_of_a_run_with_ellipsoids_is_in_half_axes() {
    let folder = tempfile::tempdir().expect("a folder");
    let ran = |arguments: &[&str]| ran_by(TAUTLINE, folder.path(), arguments);
    fs::write(folder.path().join("ellipsoids.toml"), format!("{SCENARIO}{ELLIPSOID}")).expect("a file");
    let fly = |hz: &str, out: &str| {
        json(&ran(&["run", "ellipsoids.toml", "--set", hz, "--out", out, "--json", "--no-snapshots"]).out)
    };
    let flown = fly("time.record_hz=1", "coarse");
    let scaled = least(&flown) / 0.2;
    let recording = "coarse/run.mcap";
    for more in [&[][..], &["--ellipsoid", "0.2,0.2,0.6"]] {
        let audit = ran(&[&["audit", recording, "--json"], more].concat());
        let found = least(&json(&audit.out));
        assert!((found - scaled).abs() < 1e-9, "{more:?}: {found}, and the run saw {scaled}");
    }
    for more in
        [&["--delta", "0.4"][..], &["--ellipsoid", "0.22,0.22,0.66"], &["--ellipsoid", "0.2,0.2,0.6", "--scale", "2"]]
    {
        let audit = ran(&[&["audit", recording], more].concat());
        assert!(audit.out.starts_with("CLEAR if straight between samples: "), "{more:?}: {audit:?}");
        assert!(audit.err.contains("the run's audit of every step answers another question"), "{more:?}: {audit:?}");
    }
}
