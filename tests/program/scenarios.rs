//! Sources of scenarios, and refusals before the flight.

use std::fs;
use std::path::Path;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{at, reason, reasons, refusals};
use assert_cmd::Command;
use serde_json::Value;

/// A flight without a name and a kind of law.
const SHORT: &str = r#"[start]
positions_m = [[0.0, 0.0], [4.0, 0.0]]
[formation]
shape = "line"
spacing_m = 3.0
[law]
delta_m = 2.0
[time]
duration_s = 1.5
"#;

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect(text)
}

const RUN: [&str; 4] = ["run", "--no-figures", "--no-snapshots", "--json"];

#[test]
fn a_scenario_is_read_from_a_file_or_standard_input() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("two by two.toml"), SHORT).expect("a file");
    let of_file = ran(folder.path(), &[&RUN[..], &["two by two.toml"]].concat());
    assert_eq!(json(&of_file.out)["scenario"]["name"], "two-by-two", "{}", of_file.err);
    assert!(folder.path().join("out/two-by-two/run.mcap").exists());

    let mut piped = Command::new(TAUTLINE);
    let piped = piped.args(RUN).arg("-").current_dir(folder.path()).env("XDG_RUNTIME_DIR", folder.path());
    let of_input = piped.write_stdin(SHORT).output().expect("the program");
    let report = json(&String::from_utf8_lossy(&of_input.stdout));
    assert_eq!(report["scenario"]["name"], "standard-input");
    assert_eq!(report["run"]["state_hash"], json(&of_file.out)["run"]["state_hash"], "the same flight");

    let mut wrong = Command::new(TAUTLINE);
    let wrong =
        wrong.args(["check", "-"]).write_stdin(SHORT.replace("delta_m", "delta")).output().expect("the program");
    let said = String::from_utf8_lossy(&wrong.stderr).into_owned();
    assert!(wrong.status.code() == Some(2) && said.contains("unknown key `delta`"), "{said}");
    assert!(said.contains("standard input:7:1"), "{said}");
    assert_eq!(ran(folder.path(), &["check", "-"]).exit, Some(2), "nothing is no scenario");
}

#[test]
fn the_scenario_of_a_recording_can_be_printed() {
    let folder = tempfile::tempdir().expect("a folder");
    let flown = ran(folder.path(), &[&RUN[..], &["circle", "--set", "time.duration_s=1", "--out", "first"]].concat());
    let shown = ran(folder.path(), &["list", "--show", "first/run.mcap"]);
    assert_eq!((shown.exit, shown.err.as_str()), (Some(0), ""));
    fs::write(folder.path().join("again.toml"), &shown.out).expect("a file");
    let again = ran(folder.path(), &[&RUN[..], &["again.toml", "--out", "second"]].concat());
    for key in ["/scenario/name", "/scenario/sha256", "/run/state_hash"] {
        assert_eq!(json(&flown.out).pointer(key), json(&again.out).pointer(key), "{key}");
    }
    fs::write(folder.path().join("other.mcap"), b"no recording").expect("a file");
    for (name, said) in [("other.mcap", "other.mcap"), ("again.toml", "hold a scenario"), ("nothing", "no built-in")] {
        let refused = ran(folder.path(), &["list", "--show", name]);
        assert_eq!((refused.exit, refused.out.as_str()), (Some(2), ""), "{name}");
        assert!(refused.err.contains(said), "{}", refused.err);
    }
}

#[test]
fn refusals_of_check_are_in_the_headline_and_never_pass() {
    let folder = tempfile::tempdir().expect("a folder");
    // Two vehicles on a line that reach a line at once: only the instability is refused.
    let unstable =
        "[graph]\nkind = \"path\"\n[arrival]\nedge_error_m = 100.0\ndisagreement_m_s = 100.0\nhold_s = 0.1\n[time]";
    let text = SHORT.replace("[time]", unstable);
    fs::write(folder.path().join("pair.toml"), text).expect("a file");
    let run = |more: &[&str]| ran(folder.path(), &[&RUN[..], &["pair.toml", "--force"], more].concat());
    let good = run(&[]);
    assert_eq!(good.exit, Some(0), "{}", good.err);
    assert!(refusals(&json(&good.out)).is_empty() && !good.err.to_lowercase().contains("refused"), "{}", good.err);

    let refused = run(&["--set", "swarm.a22_per_s=0.5", "--set", "law={kind=\"laplacian\", delta_m=2, f2_per_s=0.1}"]);
    assert_eq!(refused.exit, Some(1), "{}", refused.err);
    assert!(refused.err.starts_with("REFUSED: relative-velocity-unstable\n"), "{}", refused.err);
    let said = "REFUSED BY CHECK: relative-velocity-unstable (clear: never closer than ";
    let headline = refused.err.lines().find(|line| line.starts_with(said)).expect("it is flown and judged");
    assert!(headline.contains(", formation reached at "), "{headline}");
    let report = json(&refused.out);
    assert_eq!(refusals(&report), ["relative-velocity-unstable"]);
    assert_eq!((&report["pass"], &report["formation"]["reached"]), (&json("false"), &json("true")));
    assert_eq!(reasons(&report), ["refused"]);
    assert_eq!(report["run"]["steps"], 360, "to its end");
}

#[test]
fn an_unreached_formation_has_a_reason_and_advice_on_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let fly = |sets: &[&str]| {
        let sets = sets.iter().flat_map(|set| ["--set", set]);
        let arguments: Vec<_> = RUN.into_iter().chain(["pentagon", "--force"]).chain(sets).collect();
        let Ran { out, err, .. } = ran(folder.path(), &arguments);
        let headline =
            err.lines().find(|line| line.to_lowercase().contains("not reached: ")).expect("not reached").to_owned();
        (json(&out)["formation"].clone(), headline)
    };
    let (line, said) = fly(&["start.positions_m=[[3,0],[9,0],[6,0],[0,0],[12,0]]"]);
    assert_eq!((&line["fails"], &line["at_rest"]), (&json("\"max_edge_error_m\""), &json("true")));
    assert!(said.contains(": largest edge error 8.573 m, at rest elsewhere"), "{said}");
    let (short, said) = fly(&["time.duration_s=10"]);
    assert_eq!((&short["fails"], &short["at_rest"]), (&json("\"max_edge_error_m\""), &json("false")));
    assert!(said.starts_with("NOT REACHED: ") && said.contains(", still moving (clear: "), "{said}");
    let (fast, said) = fly(&["time.duration_s=20", "arrival.edge_error_m=100"]);
    assert_eq!(fast["fails"], "disagreement_m_s");
    assert!(said.contains("NOT REACHED: largest relative speed 0."), "{said}");
    let (brief, said) = fly(&["time.duration_s=40", "arrival.hold_s=39"]);
    assert!(brief["fails"] == "held_s" && brief["held_s"].as_f64().is_some_and(|held_s| held_s < 39.0), "{brief}");
    assert!(said.contains("NOT REACHED: kept for the last ") && brief["at_rest"].is_boolean(), "{said}");
}

#[test]
fn positions_beyond_their_resolution_end_a_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    let fly = |duration: &str| {
        let sets = ["--set", "swarm.a22_per_s=0.5", "--set", duration];
        ran(folder.path(), &[&RUN[..], &["pentagon", "--force"], &sets].concat())
    };
    let lost = json(&fly("time.duration_s=150").out);
    let ended_early = at(&lost, "/run/ended_early");
    let said = "rounding may have moved vehicles by 1.0e-2 m; 0.01 m is required";
    assert!(ended_early["text"].as_str().is_some_and(|text| text.contains(said)), "{ended_early}");
    assert_eq!(ended_early["code"], "positions-unresolved");
    let ended = &reason(&lost, "ended-early")["data"];
    assert_eq!((&ended["ending"], &ended["at_s"]), (&ended_early["code"], &lost["run"]["duration_s"]));
    let end_s = lost["run"]["duration_s"].as_f64().expect("a time");
    // Rounding of 2e-16 m/s grows to about 3e10 m/s in 120 s; at this speed every step rounds by 1e-6 m/s.
    assert!((100.0..140.0).contains(&end_s), "{end_s}");
    assert_eq!(refusals(&lost), ["drift-unresolved"]);
    let told = json(&fly("time.duration_s=25").out);
    assert!(at(&told, "/run/ended_early").is_null() && refusals(&told).is_empty(), "{told}");
}
