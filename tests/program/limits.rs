//! Limits of single vehicles and fences: results in every output, and refusals.

use std::fmt::Write as _;
use std::fs;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{at, facts, parts, status};

/// A vehicle that moves along x with 5 m/s and rises with 1 m/s from 2 s on, and a static one.
fn recording() -> String {
    (0..=40).fold("t,id,x,y,z\n".to_owned(), |mut text, k| {
        let t = f64::from(k) / 10.0;
        // Writing to a string cannot fail.
        let _ = write!(text, "{t},a,{},0,{}\n{t},b,0,9,0\n", 5.0 * t, (t - 2.0).max(0.0));
        text
    })
}

fn audit(words: &[&str]) -> (Ran, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("flight.csv"), recording()).expect("written");
    let venue = "[fence]\npolygon_m = [[-1, -1], [15, -1], [15, 12], [-1, 12]]\nheight_m = [-1, 9]\n\n\
                 [[obstacle]]\nname = \"mast\"\nball = { radius_m = 0.5 }\nat_m = [0, 50, 0]\nclearance_m = 1\n";
    fs::write(folder.path().join("venue.toml"), venue).expect("written");
    (ran_by(TAUTLINE, folder.path(), &[&["audit", "flight.csv"], words].concat()), folder)
}

#[test]
fn limits_are_in_every_answer() {
    let words = [
        "--limit",
        "speed=5,climb=0.5",
        "--fence",
        "venue.toml",
        "--events",
        "e.csv",
        "--junit",
        "j.xml",
        "--html",
        "p.html",
    ];
    let (ran, folder) = audit(&words);
    assert_eq!(ran.exit, Some(1), "{ran:?}");
    assert!(ran.out.starts_with("VIOLATION: speed of a was 5.099 m/s"), "{ran:?}");
    assert!(ran.out.contains("room to the fence of a was -5.000 m at 4.00 s (limit at least 0.000 m)"), "{ran:?}");
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect(name);
    let events = read("e.csv");
    let rows: Vec<_> =
        events.lines().skip(1).map(|line| line.split(',').take(3).collect::<Vec<_>>().join(" ")).collect();
    assert_eq!(rows, ["violation a speed_m_s", "violation a climb_m_s", "violation a fence_margin_m"]);
    let junit = read("j.xml");
    assert!(junit.contains(r#"tests="3""#) && junit.contains(r#"failures="3""#), "{junit}");
    assert!(!junit.contains("separation"), "it was not asked how close two came");
    let (ran, _) = audit(&["--fence", "venue.toml", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON");
    assert_eq!(report["question"]["limits"], serde_json::json!({ "fence_margin_m": 0.0 }));
    let page = read("p.html");
    assert!(page.contains("Each vehicle by itself") && page.contains("room to the fence"));
}

#[test]
fn without_delta_no_separation_is_judged() {
    let (ran, _) = audit(&["--limit", "speed=6"]);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    assert_eq!(
        ran.out.lines().next(),
        Some("CLEAR if straight between samples: speed at most 5.100 m/s (limit 6.000 m/s); from 0.000 s to 4.000 s")
    );
    let (ran, _) = audit(&["--limit", "speed=6", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON");
    assert_eq!((&report["status"], parts(&report)), (&"clear".into(), vec!["speed_m_s"]));
    assert_eq!((status(&report, "speed_m_s"), at(&report, "/question/delta")), ("clear", &serde_json::Value::Null));
    let (ran, _) = audit(&["--limit", "speed=6", "--delta", "1"]);
    assert!(
        ran.exit == Some(0) && ran.out.contains("never closer than") && ran.out.contains("; speed at most"),
        "{ran:?}"
    );
}

#[test]
fn one_file_holds_fence_and_obstacles() {
    let (ran, _) = audit(&["--delta", "1", "--obstacles", "venue.toml", "--fence", "venue.toml", "--until", "2.9"]);
    assert!(ran.exit == Some(0) && ran.out.contains("mast"), "{ran:?}");
}

#[test]
fn wrong_limits_are_refused() {
    for (words, code) in [
        (&["--limit", "speed=fast"][..], ""),
        (&["--limit", "sped=5"], ""),
        (&["--limit", "speed=5,speed=6"], "audit/limit-twice"),
        (&["--limit", "speed=0"], "audit/out-of-range"),
        (&["--limit", "speed=5", "--motion", "hold"], "audit/limit-of-jumps"),
        (&["--fence", "flight.csv"], "audit/fence-file"),
        (&["--fence", "nowhere.toml"], "files/cannot-read"),
        (&["--limit", "speed=5", "--events", "flight.csv"], "files/overwrites-input"),
    ] {
        let (ran, _) = audit(words);
        // Values that clap refuses have no code.
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{words:?}: {ran:?}");
    }
}

/// Straight segments as in Skybrush: polynomials with a corner each second.
fn corners() -> tempfile::TempDir {
    let columns = |axis: &str| (0..8).map(|power| format!("{axis}^{power}")).collect::<Vec<_>>().join(",");
    let head = format!("duration,{}", ["x", "y", "z", "yaw"].map(columns).join(","));
    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir(folder.path().join("show")).expect("a folder");
    for (name, y) in [("cf1.csv", 0), ("cf2.csv", 9)] {
        let pieces = (0..40).map(|k| {
            let (from, by) = if k % 2 == 0 { (0, 3) } else { (3, -3) };
            format!("1,{from},{by},0,0,0,0,0,0,{y},0,0,0,0,0,0,0,1,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0\n")
        });
        let text = format!("{head}\n{}", pieces.collect::<String>());
        fs::write(folder.path().join("show").join(name), text).expect("written");
    }
    folder
}

#[test]
fn corners_of_a_show_are_one_note_and_a_window_judges_them() {
    let folder = corners();
    let audit = |words: &[&str]| ran_by(TAUTLINE, folder.path(), &[&["audit", "show"], words].concat());
    let plain = audit(&["--limit", "accel=4", "--delta", "1"]);
    assert_eq!(plain.exit, Some(0), "{plain:?}");
    let said = "CLEAR if vehicles round off 78 corners (velocity jumps by at most 6.000 m/s, cf1 at 1.00 s; \
                --accel-window judges them): ";
    assert!(plain.out.starts_with(said), "{plain:?}");
    let report: serde_json::Value = serde_json::from_str(&audit(&["--limit", "accel=4", "--json"]).out).expect("JSON");
    let corners = &report["corners"][0];
    assert_eq!((&corners["part"], &corners["count"]), (&"accel_m_s2".into(), &78.into()));
    let largest = serde_json::json!({"vehicle": "cf1", "at_s": 1.0, "by_m_s": 6.0});
    assert_eq!(corners["largest"], largest);
    assert_eq!((&report["proved"], facts(&report, "rounded-corners").len()), (&false.into(), 1));
    let strict = audit(&["--limit", "accel=4", "--accel-window", "0.2"]);
    assert_eq!(strict.exit, Some(1), "{strict:?}");
    assert!(strict.out.starts_with("VIOLATION: accel") && strict.out.contains("30.000 m/s^2"), "{strict:?}");
    let wide = audit(&["--limit", "accel=31", "--accel-window", "0.2"]);
    assert!(wide.exit == Some(0) && wide.out.contains("accelerations are means over 0.2 s"), "{wide:?}");
    let none = audit(&["--limit", "speed=4", "--accel-window", "0.2"]);
    assert!(none.exit == Some(2) && none.err.contains("leave --accel-window out"), "{none:?}");
}
