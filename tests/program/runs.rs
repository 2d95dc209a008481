//! Commands, options, texts, JSON and exit codes of the program.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{SEPARATION, at, closest, number, part, reason, reasons, refusals, violations};
use serde_json::Value;
use tautline::mcap::McapRecording;
use tautline::record::Event;
use tautline::scenario::builtin;
use tempfile::TempDir;

const GOOD: Option<i32> = Some(0);
const BAD: Option<i32> = Some(1);
const WRONG_INPUT: Option<i32> = Some(2);

/// A flight too short to reach its formation.
const SHORT: [&str; 2] = ["--set", "time.duration_s=1"];

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder for the run")
}

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

/// Calls `run` with these arguments, into `out` below the folder.
fn run(folder: &Path, arguments: &[&str]) -> Ran {
    ran(folder, &[&["run", "--out", "out"], arguments].concat())
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// Collects the paths of all keys; lists are values.
fn key_paths(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(object) if !object.is_empty() => {
            for (key, value) in object {
                key_paths(value, &format!("{path}.{key}"), found);
            }
        }
        _ => found.push(path.trim_start_matches('.').to_owned()),
    }
}

#[test]
fn the_pentagon_as_json_is_the_reference_flight() {
    let folder = folder();
    let Ran { exit, out, err } = run(folder.path(), &["pentagon", "--json"]);
    let report = json(&out);
    assert_eq!(exit, GOOD, "{err}");
    assert_eq!(fs::read_to_string(folder.path().join("out/report.json")).expect("a report"), out, "one JSON, alone");

    let near = |value: &Value, path: &str, expected: f64, tolerance: f64| {
        let found = number(value, path);
        assert!((found - expected).abs() <= tolerance, "{path}: {found}, expected {expected}");
    };
    let closest = closest(&report);
    // Reference values, with the error of a step of 1/240 s, from crates/sim/tests/flights/reference_flights.rs.
    near(closest, "/value/lower", 2.460_353, 1e-4);
    near(closest, "/at_s", 2.151, 0.02);
    near(&report, "/certificate/separation_m", 2.055_307, 1e-5);
    near(&report, "/energy/initial", 3.656_743, 1e-5);
    near(&report, "/formation/reached_at_s", 37.0, 1.0);
    assert!([vec!["2", "3"], vec!["1", "3"]].map(Value::from).contains(&closest["subjects"]));
    assert_eq!(closest["value"]["upper"], closest["value"]["lower"]);
    assert_eq!(
        (&report["schema_version"], &report["pass"], &report["proved"]),
        (&3.into(), &true.into(), &true.into())
    );
    assert_eq!(reasons(&report), [""; 0]);
    let separation = part(&report, SEPARATION);
    assert_eq!((&report["status"], &separation["status"]), (&"clear".into(), &"clear".into()));
    assert!(violations(&report).is_empty(), "{separation}");
    let detectors = serde_json::json!({
        "steps": 28_800, "segments": null, "pairs_swept": 28_801 * 10,
        "parry_contact_s": null, "parry_disagreements": 0, "rapier_contact_pairs": 0,
    });
    assert_eq!(separation["detectors"], detectors);
    assert_eq!(report["formation"]["reached"], true);
    assert!(number(&report, "/energy/max_over_initial") <= 1.0 + 1e-6);
    assert_eq!(report["run"]["steps"], 28_800);
}

#[test]
fn the_keys_of_the_report_are_the_documented_ones() {
    let expected = [
        "schema_version status pass proved answers facts window_s vehicles reasons",
        "question.delta question.unit question.radius_m question.ellipsoid_m question.cylinder_m question.obstacles",
        "question.limits question.well_clear question.require_presence question.plan question.above_m",
        "question.from_s question.to_s",
        "certificate.separation_m certificate.clearance_margin_m certificate.until_s certificate.void",
        "scenario.name scenario.sha256",
        "tool.name tool.version",
        "hulls.bounces hulls.passed_through",
        "formation.reached formation.reached_at_s formation.held_s formation.fails formation.at_rest",
        "formation.max_edge_error_m formation.rms_position_error_m formation.max_position_error_m",
        "energy.initial energy.final energy.max_over_initial energy.max_over_leg_start energy.rose",
        "control.peak_m_s2 control.final_m_s2",
        "velocity.disagreement_m_s velocity.common_m_s",
        "run.duration_s run.dt_s run.steps run.engine_steps run.refined_steps run.overlong_steps",
        "run.ended_early run.vehicles run.state_hash",
        "performance.wall_s performance.real_time_factor performance.law_s performance.energy_s",
        "performance.physics_s performance.airframe_s performance.audit_s performance.record_s",
    ];
    let mut expected: Vec<&str> = expected.iter().flat_map(|line| line.split(' ')).collect();
    let report = json(&run(folder().path(), &["pentagon-laplacian", "--json", "--set", "time.duration_s=6"]).out);
    let mut found = Vec::new();
    key_paths(&report, "", &mut found);
    expected.sort_unstable();
    found.sort_unstable();
    assert_eq!(found, expected);

    let keys = |value: &Value| value.as_object().expect("an object").keys().cloned().collect::<Vec<_>>().join(" ");
    assert_eq!(keys(part(&report, SEPARATION)), "closest detectors part status undecided violations");
    for finding in [closest(&report), &violations(&report)[0]] {
        assert_eq!(keys(finding), "at_s from_s limit rate_hz subjects to_s value");
        assert_eq!(keys(&finding["value"]), "lower unit upper");
    }
    for (path, expected) in [
        ("/reasons/0", "code data text"),
        ("/facts/0", "fact source subject unit value"),
        ("/certificate/void/0", "code text"),
    ] {
        assert_eq!(keys(at(&report, path)), expected, "{path}");
    }
}

#[test]
fn the_verdict_comes_first_and_the_paths_of_files_last() {
    let folder = folder();
    let Ran { exit, out, err } = run(folder.path(), &[]);
    assert_eq!(exit, GOOD);
    assert!(err.lines().all(|line| line.starts_with("warning [")), "only warnings stand beside the talk: {err}");
    let lines: Vec<&str> = out.lines().collect();
    assert!(lines[0].starts_with("CLEAR: never closer than 2.4"), "{out}");
    assert!(lines[0].contains("(delta 2.000 m), formation reached at 3"), "{out}");
    let names: Vec<_> = lines.iter().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(names, ["CLEAR:", "separation", "audit", "wrote"], "four lines: {out}");
    assert_eq!(lines[3], "wrote out/report.html with a replay, report.json and run.mcap");
    let all = run(folder.path(), &["--verbose", "--force"]).out;
    assert!(lines.iter().all(|line| all.lines().any(|one| one == *line)), "{all}");
    for name in ["formation", "energy", "control", "velocity", "run", "performance"] {
        assert!(all.lines().any(|line| line.starts_with(name)), "{name}: {all}");
    }
    assert!(!out.contains('\u{1b}'), "no colour and no progress bar in a pipe");
}

#[test]
fn the_readme_shows_what_the_program_prints() {
    let readme = include_str!("../../README.md");
    let of_run = readme.split("tautline run pentagon").nth(1).expect("the command");
    let shown = of_run.split("```text\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a transcript");
    let printed = run(folder().path(), &[]).out.replace("wrote out/", "wrote out/pentagon/");
    assert!(printed == shown, "the README shows\n{shown}\nand the program prints\n{printed}");
}

#[test]
fn free_steps_leave_out_most_steps_of_the_engine_and_change_no_bit() {
    let folder = folder();
    let flown = |more: &[&str]| json(&run(folder.path(), &[&SHORT[..], more, &["--json", "--force"]].concat()).out);
    let (whole, free) = (flown(&[]), flown(&["--free-steps"]));
    let steps = |report: &Value| report["run"]["engine_steps"].as_u64().expect("a number");
    assert!(steps(&whole) >= whole["run"]["steps"].as_u64().expect("a number"), "{whole}");
    assert!(2 * steps(&free) < steps(&whole), "{} of {} steps", steps(&free), steps(&whole));
    let without_count = |mut report: Value| {
        report["run"]["engine_steps"] = Value::Null;
        report["performance"] = Value::Null;
        report
    };
    assert_eq!(without_count(free), without_count(whole));
    let flown = run(folder.path(), &[&SHORT[..], &["--free-steps", "--plant", "ideal", "--force"]].concat());
    assert!(flown.err.contains("no step left out the engine"), "{}", flown.err);
}

#[test]
fn a_file_of_json_replaces_no_file_of_the_run_and_none_without_force() {
    let folder = folder();
    let ran = |arguments: &[&str]| ran_by(TAUTLINE, folder.path(), arguments);
    let short = ["run", "pentagon", "--set", "time.duration_s=1", "--no-snapshots", "--no-figures", "--out", "o"];
    let inside = ran(&[&short[..], &["--json=o/run.mcap"]].concat());
    assert_eq!((inside.exit, inside.code()), (WRONG_INPUT, "files/overwrites-input"), "{inside:?}");
    fs::write(folder.path().join("there.json"), "mine").expect("a file");
    for words in [&["list", "--json=there.json"][..], &["doctor", "--json=there.json"], &["check", "--json=there.json"]]
    {
        let refused = ran(words);
        assert_eq!((refused.exit, refused.code()), (WRONG_INPUT, "files/exists"), "{words:?}: {refused:?}");
    }
    assert_eq!(fs::read_to_string(folder.path().join("there.json")).expect("the file"), "mine");
    let beside = ran(&[&short[..], &["--json=new.json"]].concat());
    assert!(beside.out.contains("wrote new.json"), "{beside:?}");
    let written = fs::read_to_string(folder.path().join("new.json")).expect("the file");
    assert_eq!(json(&written)["status"], json(&ran(&[&short[..], &["--json", "--force"]].concat()).out)["status"]);
}

#[test]
fn with_json_text_goes_to_standard_error_unless_quiet() {
    let folder = folder();
    let talking = run(folder.path(), &[&SHORT[..], &["--json"]].concat());
    assert!(talking.err.lines().any(|line| line.starts_with("NOT REACHED: ")), "{}", talking.err);
    assert!(json(&talking.out).is_object());
    let quiet = run(folder.path(), &[&SHORT[..], &["--json", "--quiet", "--force"]].concat());
    assert_eq!((quiet.exit, quiet.err.as_str()), (talking.exit, ""));
    assert!(json(&quiet.out).is_object());
    let silent = run(folder.path(), &[&SHORT[..], &["--quiet", "--force"]].concat());
    assert_eq!((silent.exit, silent.out.as_str(), silent.err.as_str()), (talking.exit, "", ""));
}

#[test]
fn the_baseline_violates_and_the_line_reaches_no_formation() {
    let folder = folder();
    let laplacian = run(folder.path(), &["pentagon-laplacian"]);
    assert_eq!(laplacian.exit, BAD);
    assert!(laplacian.out.starts_with("VIOLATION: vehicles "), "{}", laplacian.out);
    assert!(laplacian.out.contains("came to 1.53"), "{}", laplacian.out);

    let collinear = run(folder.path(), &["pentagon-collinear", "--force"]);
    assert_eq!(collinear.exit, BAD);
    assert!(
        collinear.out.starts_with("REFUSED BY CHECK: start-on-line; not reached: largest edge error "),
        "{}",
        collinear.out
    );
    assert!(collinear.out.contains("The start lies on a line"), "{}", collinear.out);
    let report = json(&fs::read_to_string(folder.path().join("out/report.json")).expect("a report"));
    assert_eq!(reasons(&report), ["refused", "not-reached", "start-too-flat"]);
    assert_eq!(refusals(&report), ["start-on-line"]);
    let flat = reason(&report, "start-too-flat");
    assert_eq!(flat["data"], json(r#"{"start_dimension": 1, "formation_dimension": 2}"#));
    assert!(flat["text"].as_str().is_some_and(|text| text.contains("on a line")), "{flat}");
}

#[test]
fn colliding_hulls_end_the_judged_flight_and_points_pass_through() {
    let folder = folder();
    let weak =
        ["pentagon-laplacian", "--set", "law.f1_per_s2=30", "--set", "law.f2_per_s=1", "--no-snapshots", "--json"];
    let solid = run(folder.path(), &weak);
    let report = json(&solid.out);
    let bounces = report["hulls"]["bounces"].as_array().expect("a list");
    let first = &bounces[0];
    assert!(first["closing_m_s"].as_f64().expect("a speed") > 0.0, "{first}");
    assert_eq!(report["hulls"]["passed_through"], Value::Null);
    assert!(
        solid.err.lines().any(|line| line.starts_with("VIOLATION") && line.contains("; hulls hit ")),
        "{}",
        solid.err
    );
    let hit = reason(&report, "hulls-hit");
    assert_eq!(
        (&hit["data"]["collisions"], &hit["data"]["time_s"]),
        (&bounces.len().into(), &first["time_s"]),
        "{hit}"
    );
    let said = "After the first collision the motion is not governed by the law";
    assert!(hit["text"].as_str().is_some_and(|text| text.contains(said)), "{hit}");
    let page = fs::read_to_string(folder.path().join("out/report.html")).expect("a page");
    assert!(page.contains("Hulls that hit") && page.contains("hulls hit, "), "a table, and marks in the figure");
    let (_, events) = McapRecording::open(&folder.path().join("out/run.mcap"))
        .and_then(McapRecording::read_all)
        .expect("a recording");
    let hits: Vec<_> = events
        .iter()
        .filter_map(|event| match *event {
            Event::HullsHit { pair, time_s, closing_m_s } => Some((pair, time_s, closing_m_s)),
            _ => None,
        })
        .collect();
    assert_eq!(hits.len(), bounces.len());
    assert_eq!((Some(hits[0].1), Some(hits[0].2)), (first["time_s"].as_f64(), first["closing_m_s"].as_f64()));

    let points = run(folder.path(), &[&weak[..], &["--plant", "ideal", "--force"]].concat());
    let report = json(&points.out);
    assert_eq!(report["hulls"]["bounces"], Value::Null);
    let through = &report["hulls"]["passed_through"];
    assert!(through["min_m"].as_f64() < through["touching_m"].as_f64(), "{through}");
    assert!(points.err.contains("passed through each other: vehicles "), "{}", points.err);
    let passed = reason(&report, "passed-through");
    let data = (&passed["data"]["are_points"], &passed["data"]["min_m"]);
    assert_eq!(data, (&true.into(), &through["min_m"]), "{passed}");
    let said = "Solid hulls would move otherwise";
    assert!(passed["text"].as_str().is_some_and(|text| text.contains(said)), "{passed}");

    // A flight without a collision has no such note.
    let clear = run(folder.path(), &["--json", "--force", "--no-snapshots"]);
    assert_eq!(json(&clear.out)["hulls"]["bounces"], json("[]"));
    assert!(!clear.err.contains("hulls"), "{}", clear.err);
}

#[test]
fn without_a_scenario_the_pentagon_is_flown_into_out() {
    let folder = folder();
    let Ran { exit, out, err } = ran(folder.path(), &["run"]);
    assert_eq!(exit, GOOD, "{err}");
    assert!(out.starts_with("CLEAR: "), "{out}");
    let run_folder = folder.path().join("out/pentagon");
    let mut names: Vec<_> =
        fs::read_dir(&run_folder).expect("the folder").map(|entry| entry.expect("an entry").file_name()).collect();
    names.sort();
    assert_eq!(names, ["figures", "report.html", "report.json", "run.mcap", "snapshots"], "nothing temporary is left");
    let recording = McapRecording::open(&run_folder.join("run.mcap")).expect("a recording");
    assert_eq!(recording.header().scenario_name, "pentagon");
    let report = json(&fs::read_to_string(run_folder.join("report.json")).expect("a report"));
    assert_eq!(report["scenario"]["sha256"], recording.header().scenario_sha256);
    let (samples, events) = recording.read_all().expect("a whole recording");
    assert_eq!((samples.len(), events.len()), (7201, 0));
}

#[test]
fn a_finished_run_is_overwritten_only_by_force() {
    let folder = folder();
    assert_eq!(run(folder.path(), &SHORT).exit, BAD);
    let files = || ["report.json", "run.mcap"].map(|name| fs::read(folder.path().join("out").join(name)).expect(name));
    let before = files();
    let refused = run(folder.path(), &["circle"]);
    assert_eq!(refused.exit, WRONG_INPUT);
    assert!(refused.err.contains("holds a finished run") && refused.err.contains("--force"), "{}", refused.err);
    assert!(files() == before, "the run is as it was");
    let forced = run(folder.path(), &["circle", "--set", "time.duration_s=1", "--force"]);
    assert_eq!(forced.exit, BAD);
    assert!(files() != before);
}

#[test]
fn a_recording_without_a_report_is_not_a_finished_run() {
    let folder = folder();
    fs::create_dir(folder.path().join("out")).expect("a folder");
    fs::write(folder.path().join("out/run.mcap"), b"what a killed run left").expect("a file");
    assert_eq!(run(folder.path(), &SHORT).exit, BAD, "it is flown, and not reached in a second");
}

#[test]
fn an_override_changes_the_flight_and_is_part_of_its_identity() {
    let folder = folder();
    let report = |out: &str, sets: &[&str]| {
        let sets: Vec<&str> = sets.iter().flat_map(|set| ["--set", *set]).collect();
        json(&ran(folder.path(), &[&["run", "--json", "--quiet", "--out", out], &sets[..]].concat()).out)
    };
    let plain = report("a", &["time.duration_s=1"]);
    let changed = report("b", &["time.duration_s=1", "law.delta_m=1.5", "name=mine", "time.dt_s=0.01"]);
    assert_eq!(changed["question"]["delta"], 1.5);
    assert_eq!(changed["scenario"]["name"], "mine");
    assert_eq!(changed["run"]["steps"], 100);
    assert_ne!(changed["scenario"]["sha256"], plain["scenario"]["sha256"]);
    assert_ne!(changed["run"]["state_hash"], plain["run"]["state_hash"]);
}

#[test]
fn the_resolved_scenario_of_a_recording_flies_the_same_states_again() {
    let folder = folder();
    let first = json(&run(folder.path(), &["--json", "--set", "time.duration_s=2", "--set", "law.delta_m=1.75"]).out);
    let recording = McapRecording::open(&folder.path().join("out/run.mcap")).expect("a recording");
    fs::write(folder.path().join("again.toml"), &recording.header().scenario_toml).expect("a file");
    let again = json(&run(folder.path(), &["again.toml", "--json", "--force"]).out);
    assert_eq!(again["run"]["state_hash"], first["run"]["state_hash"]);
    assert_eq!(again["scenario"], first["scenario"]);
}

#[test]
fn list_names_every_built_in_and_shows_one_as_toml() {
    let folder = folder();
    let listed = ran(folder.path(), &["list"]);
    assert_eq!((listed.exit, listed.out.lines().count()), (GOOD, 1 + builtin::all().len()));
    for builtin in builtin::all() {
        assert!(listed.out.contains(builtin.name) && listed.out.contains(builtin.summary), "{}", listed.out);
        let shown = ran(folder.path(), &["list", "--show", builtin.name]);
        assert_eq!((shown.exit, shown.out.as_str()), (GOOD, builtin.toml));
    }
    let pentagon = listed.out.lines().nth(1).expect("a row").split_whitespace().take(5).collect::<Vec<_>>();
    assert_eq!(pentagon, ["pentagon", "5", "120", "s", "28800"]);
    let rows = json(&ran(folder.path(), &["list", "--json"]).out);
    assert_eq!(rows.as_array().map(Vec::len), Some(builtin::all().len()));
    let expected = serde_json::json!({
        "name": "pentagon", "vehicles": 5, "duration_s": 120.0, "steps": 28800, "content": builtin::all()[0].summary,
    });
    assert_eq!(rows[0], expected);
    let unknown = ran(folder.path(), &["list", "--show", "heptagon"]);
    assert_eq!((unknown.exit, unknown.out.as_str()), (WRONG_INPUT, ""));
    assert!(unknown.err.contains("heptagon") && unknown.err.contains("tautline list"), "{}", unknown.err);
}

#[test]
fn what_list_shows_can_be_saved_and_flown() {
    let folder = folder();
    let shown = ran(folder.path(), &["list", "--show", "circle"]);
    fs::write(folder.path().join("mine.toml"), shown.out).expect("a file");
    let Ran { exit, err, .. } = run(folder.path(), &["mine.toml"]);
    assert_eq!(exit, GOOD, "{err}");
}

#[test]
fn the_schema_is_json() {
    let schema = ran(folder().path(), &["schema"]);
    assert_eq!(schema.exit, GOOD);
    assert_eq!(json(&schema.out)["title"], "tautline scenario");
}

#[test]
fn every_shell_gets_a_completion_script() {
    let folder = folder();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = ran(folder.path(), &["completions", shell]);
        assert_eq!(script.exit, GOOD, "{}", script.err);
        assert!(script.out.contains("tautline") && script.out.contains("COMPLETE"), "{shell}: {}", script.out);
    }
    assert_eq!(ran(folder.path(), &["completions", "tcsh"]).exit, WRONG_INPUT);
}

#[test]
fn help_and_version_exit_with_0_on_standard_output() {
    let folder = folder();
    let commands: [&[&str]; 4] = [&["--help"], &["run", "--help"], &["help", "list"], &["--version"]];
    for arguments in commands {
        let Ran { exit, out, err } = ran(folder.path(), arguments);
        assert_eq!((exit, err.as_str()), (GOOD, ""), "{arguments:?}");
        assert!(!out.is_empty(), "{arguments:?}");
    }
}

#[test]
fn wrong_usage_is_wrong_input() {
    let folder = folder();
    let commands: [&[&str]; 5] =
        [&["fly"], &["run", "--fast"], &["run", "--threads", "0"], &["run", "--out"], &["run", "pentagon", "circle"]];
    for arguments in commands {
        let Ran { exit, out, err } = ran(folder.path(), arguments);
        assert_eq!((exit, out.as_str()), (WRONG_INPUT, ""), "{arguments:?}");
        assert!(err.starts_with("error: "), "{err}");
    }
    assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 0, "nothing was written");
}

#[test]
fn any_number_of_threads_is_taken() {
    let folder = folder();
    let Ran { exit, err, .. } = run(folder.path(), &[&SHORT[..], &["--threads", "65535"]].concat());
    assert_eq!(exit, BAD, "flown, and not reached in a second: {err}");
}

#[test]
fn a_closed_pipe_is_no_error() {
    let folder = folder();
    let run = ["run", "--out", "out", "--json", "--quiet", "--set", "time.duration_s=45"];
    let commands: [&[&str]; 5] = [&run, &["list"], &["schema"], &["completions", "zsh"], &["--help"]];
    for arguments in commands {
        let mut child = Command::new(TAUTLINE)
            .args(arguments)
            .current_dir(folder.path())
            .env("XDG_RUNTIME_DIR", folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program");
        drop(child.stdout.take());
        let done = child.wait_with_output().expect("an end");
        let err = String::from_utf8_lossy(&done.stderr);
        assert_eq!((done.status.code(), err.as_ref()), (GOOD, ""), "{arguments:?}");
    }
}

#[test]
fn verdicts_have_colours_only_if_forced_or_on_a_terminal() {
    let folder = tempfile::tempdir().expect("a folder");
    let colours = |variables: &[(&str, &str)]| {
        let mut command = std::process::Command::new(crate::program::TAUTLINE);
        command.args(["run", "--no-snapshots", "--no-figures", "--force", "--set", "time.duration_s=1"]);
        command.current_dir(folder.path()).env("XDG_RUNTIME_DIR", folder.path());
        command.env_remove("NO_COLOR").env_remove("CLICOLOR_FORCE").envs(variables.iter().copied());
        let ran = command.output().expect("the program");
        String::from_utf8(ran.stdout).expect("text").contains('\u{1b}')
    };
    assert!(colours(&[("CLICOLOR_FORCE", "1")]));
    assert!(!colours(&[]), "a pipe is no terminal");
    assert!(!colours(&[("NO_COLOR", "1")]));
    assert!(!colours(&[("CLICOLOR_FORCE", "0")]));
    let help = |value: &str| {
        let mut command = std::process::Command::new(crate::program::TAUTLINE);
        let ran = command.arg("--help").env_remove("NO_COLOR").env("CLICOLOR_FORCE", value).output();
        String::from_utf8(ran.expect("the program").stdout).expect("text")
    };
    assert!(help("1").contains('\u{1b}') && !help("0").contains('\u{1b}'));
    let said = help("0");
    assert!(said.contains("130  Ctrl-C in any other command.") && said.contains("NO_COLOR=1"), "{said}");
}
