//! `tautline watch`: lines of JSON in, states and exit codes out.

use std::fmt::Write as _;
use std::fs;
use std::io::{BufReader, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use assert_cmd::Command as Checked;
use serde_json::Value;
use tempfile::tempdir;

use crate::program::{PATIENCE, Ran, TAUTLINE, ran_by};
use crate::report::{number, violations};

fn watched(folder: &Path, arguments: &[&str], input: &str) -> Ran {
    let mut command = Checked::new(TAUTLINE);
    command.arg("watch").args(arguments).current_dir(folder).write_stdin(input);
    let done = command.output().expect("the program runs");
    let text = |bytes| String::from_utf8(bytes).expect("the program writes UTF-8");
    Ran { exit: done.status.code(), out: text(done.stdout), err: text(done.stderr) }
}

const STAMPS: [&str; 4] = ["--time", "stamps", "--delta", "0.5"];

/// Watches a recording by its stamps.
fn judged(input: &str, more: &[&str]) -> Ran {
    let folder = tempdir().expect("a folder");
    watched(folder.path(), &[&STAMPS[..], more].concat(), input)
}

/// Returns lines of `a` at rest and `b`, which moves along x from 4 m with `speed` [m/s], for 4 s at 10 Hz.
fn approach(speed: f64, offset_m: f64) -> String {
    (0..=40).fold(String::new(), |mut text, k| {
        let t = f64::from(k) / 10.0;
        let x = 4.0 + speed * t;
        let _ = writeln!(text, r#"{{"t":{t},"id":"a","x":0,"y":0,"z":2,"vx":0,"vy":0,"vz":0}}"#);
        let _ = writeln!(text, r#"{{"t":{t},"id":"b","x":{x},"y":{offset_m},"z":2,"vx":{speed},"vy":0,"vz":0}}"#);
        text
    })
}

fn events(ran: &Ran) -> Vec<Value> {
    ran.out.lines().map(|line| serde_json::from_str(line).expect(line)).collect()
}

/// Returns the status, and whether it passes, of the summary of a watch with `--json`.
fn result(ran: &Ran) -> (String, bool) {
    let summary = events(ran).pop().expect("a summary");
    (summary["status"].as_str().expect("a status").to_owned(), summary["pass"] == true)
}

/// Returns whether a reason with a code has a value in its data.
fn has_reason(ran: &Ran, code: &str, key: &str, value: impl Into<Value>) -> bool {
    let value = value.into();
    events(ran).iter().any(|of| of["reason"]["code"] == code && of["reason"]["data"][key] == value)
}

#[test]
fn two_vehicles_far_apart_are_clear() {
    let ran = judged(&approach(0.0, 0.0), &["--json"]);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    assert_eq!(result(&ran), ("clear".to_owned(), true));
    // A line each second of the stamps.
    let states: Vec<_> = events(&ran).into_iter().filter(|of| of["event"] == "state").collect();
    assert!(states.len() == 5 && states.iter().all(|of| of["status"] == "clear"), "{}", ran.out);
    let until_s = states[0]["clear_until"]["at_s"].as_f64().expect("a time");
    assert!((0.57..0.58).contains(&until_s) && states[0]["closest"]["nominal_m"] == 4.0, "{}", ran.out);
    // Without JSON, each notice is a line.
    assert_eq!(judged(&approach(0.0, 0.0), &[]).out.lines().count(), ran.out.lines().count());
}

#[test]
fn every_line_with_clear_has_its_facts() {
    let ran = judged(&approach(0.0, 0.0), &["--json", "--position-error", "0.02", "--accel", "5"]);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    let is_clear = |line: &&Value| line["status"] == "clear";
    let lines: Vec<_> = events(&ran).into_iter().filter(|line| is_clear(&line)).collect();
    assert_eq!(lines.len(), 6, "{}", ran.out);
    for line in lines {
        let fact = |kind: &str| {
            let found = line["facts"].as_array().and_then(|facts| facts.iter().find(|fact| fact["fact"] == kind));
            found.map(|fact| (fact["source"].as_str().unwrap_or_default().to_owned(), fact["value"].as_f64()))
        };
        assert_eq!(fact("position-error"), Some(("declared".to_owned(), Some(0.02))), "{line}");
        assert_eq!(fact("acceleration"), Some(("declared".to_owned(), Some(5.0))), "{line}");
        assert_eq!(fact("age"), Some(("default".to_owned(), Some(1.0))), "{line}");
        // One position of a vehicle contradicts no velocity.
        let agreement = if line["t_s"] == 0.0 { "not-observable" } else { "observed" };
        assert_eq!(fact("velocity-agreement"), Some((agreement.to_owned(), None)), "{line}");
    }
    // Other states rest on no facts.
    let ran = judged(&approach(-2.0, 0.3), &["--json"]);
    assert!(events(&ran).iter().all(|line| line["status"] == "clear" || line["facts"].is_null()), "{}", ran.out);
}

#[test]
fn a_sent_velocity_of_zero_is_a_contradiction() {
    let input = approach(-2.0, 0.6).replace(r#""vx":-2"#, r#""vx":0"#);
    let ran = judged(&input, &["--json"]);
    assert_eq!(ran.exit, Some(1), "{ran:?}");
    assert!(
        events(&ran).iter().any(|line| line["fault"] == "velocity-disagrees" && line["vehicle"] == "b"),
        "{}",
        ran.out
    );
    let late = events(&ran).into_iter().filter(|line| line["t_s"].as_f64().is_some_and(|t_s| t_s > 0.15));
    assert_eq!(late.filter(|line| line["status"] == "clear").count(), 0, "{}", ran.out);
}

#[test]
fn a_collision_course_is_announced_and_the_violation_found() {
    let ran = judged(&approach(-2.0, 0.3), &["--json"]);
    assert_eq!((ran.exit, result(&ran)), (Some(1), ("violation".to_owned(), false)), "{ran:?}");
    let found = events(&ran);
    let announced = found.iter().find(|of| of["nominal_violation"].is_object()).expect("a forecast");
    assert!((number(announced, "/nominal_violation/at_s") - 1.8).abs() < 1e-9, "{announced}");
    assert!(number(announced, "/last_brake/at_s") < 1.8, "{announced}");
    assert!(found.iter().any(|of| of["violation"]["subjects"] == serde_json::json!(["a", "b"])), "{}", ran.out);
    // 4 - 2 t with 0.3 m beside: below 0.5 m for 0.4 s around 2 s.
    let end = found.iter().find(|of| of["event"] == "violation-end").expect("an end");
    for (path, value) in [("/from_s", 1.8), ("/to_s", 2.2), ("/value/upper", 0.3), ("/at_s", 2.0), ("/limit", 0.5)] {
        assert!((number(end, path) - value).abs() < 1e-9, "{path}: {end}");
    }
    // Negative twin: 0.6 m beside is no violation.
    let apart = judged(&approach(-2.0, 0.6), &["--json"]);
    assert!(!events(&apart).iter().any(|of| of["status"] == "violation"), "{}", apart.out);
}

#[test]
fn a_vehicle_that_falls_silent_is_undecided() {
    let silent: String = approach(0.0, 0.0)
        .lines()
        .filter(|line| !(line.contains("\"b\"") && (line.contains("\"t\":3") || line.contains("\"t\":2."))))
        .flat_map(|line| [line, "\n"])
        .collect();
    let ran = judged(&silent, &["--json"]);
    assert_eq!((ran.exit, result(&ran)), (Some(1), ("undecided".to_owned(), false)), "{ran:?}");
    assert!(has_reason(&ran, "stale", "vehicle", "b"), "{}", ran.out);
    assert!(events(&ran).iter().any(|of| of["event"] == "stale" && of["vehicle"] == "b"), "{}", ran.out);
}

#[test]
fn a_gap_of_all_vehicles_is_undecided() {
    let gap: String = approach(0.0, 0.0)
        .lines()
        .filter(|line| !line.contains("\"t\":1.") && !line.contains("\"t\":2"))
        .flat_map(|line| [line, "\n"])
        .collect();
    let ran = judged(&gap, &["--json"]);
    assert_eq!(ran.exit, Some(1), "{ran:?}");
    assert!(has_reason(&ran, "stale", "vehicle", "a"), "{}", ran.out);
}

#[test]
fn expected_vehicles_must_be_heard() {
    for (option, value, missing) in [("--expect", "3", serde_json::json!([])), ("--ids", "a,b,c", vec!["c"].into())] {
        let ran = judged(&approach(0.0, 0.0), &[option, value, "--json"]);
        assert_eq!(ran.exit, Some(1), "{ran:?}");
        assert!(has_reason(&ran, "missing", "heard", 2) && has_reason(&ran, "missing", "missing", missing));
        assert!(!events(&ran).iter().any(|of| of["status"] == "clear"), "{}", ran.out);
    }
    assert_eq!(judged(&approach(0.0, 0.0), &["--ids", "a,b"]).exit, Some(0));
    assert_eq!(judged("", &[]).exit, Some(1));
    let alone = judged("{\"t\":0,\"id\":\"a\",\"x\":0,\"y\":0,\"z\":0}\n", &["--json"]);
    assert!(has_reason(&alone, "too-few", "heard", 1), "{}", alone.out);
}

#[test]
fn wrong_lines_are_events_and_never_clear() {
    let good = approach(0.0, 0.0);
    let (half, rest) = good.split_at(good.find("{\"t\":2,").expect("2 s"));
    let again = half.lines().last().expect("a line");
    let elsewhere = again.replace("\"x\":4", "\"x\":5");
    for (wrong, fault) in [
        ("garbage\n", "garbage"),
        ("{\"t\":2,\"id\":\"a\",\"x\":0,\"y\":0}\n", "garbage"),
        ("\u{0}\u{1}\n", "garbage"),
        ("{\"t\":1e300,\"id\":\"a\",\"x\":0,\"y\":0,\"z\":2}\n", "out-of-range"),
        ("{\"t\":0.5,\"id\":\"a\",\"x\":0,\"y\":0,\"z\":2}\n", "clock-step"),
        (&format!("{elsewhere}\n"), "conflict"),
    ] {
        let ran = judged(&format!("{half}{wrong}{rest}"), &["--json"]);
        assert_eq!(ran.exit, Some(1), "{wrong}: {ran:?}");
        let events = events(&ran);
        assert!(events.iter().any(|of| of["event"] == "fault" && of["fault"] == fault), "{wrong}: {}", ran.out);
        assert!(events.iter().any(|of| of["status"] == "undecided"), "{wrong}: {}", ran.out);
    }
    // A message that comes twice, or late, is ignored.
    for (harmless, fault) in [
        (format!("{again}\n"), "duplicate"),
        ("{\"t\":1.5,\"id\":\"b\",\"x\":4,\"y\":0,\"z\":2}\n".to_owned(), "reordered"),
    ] {
        let ran = judged(&format!("{half}{harmless}{rest}"), &["--json"]);
        assert_eq!(ran.exit, Some(0), "{harmless}: {ran:?}");
        assert!(events(&ran).iter().any(|of| of["fault"] == fault), "{harmless}: {}", ran.out);
    }
}

#[test]
fn every_line_of_json_is_an_object_with_its_text() {
    let ran = judged(&approach(-2.0, 0.3), &["--json"]);
    let events = events(&ran);
    assert!(events.iter().all(|of| of["event"].is_string() && of["text"].is_string()), "{}", ran.out);
    let state = events.iter().find(|of| of["status"] == "clear").expect("a state");
    assert_eq!(state["clear_until"]["subjects"], serde_json::json!(["a", "b"]));
    let summary = events.last().expect("a summary");
    assert_eq!((summary["event"].as_str(), summary["violations"].as_u64()), (Some("summary"), Some(1)));
}

#[test]
fn the_recording_is_judged_to_the_same_violations() {
    // Three vehicles on crossing paths, whose samples miss the violations.
    let mut input = String::new();
    for k in 0..=30 {
        let t = f64::from(k) / 5.0;
        for (id, x, y) in [("a", 6.0 - 2.0 * t, 0.1), ("b", 0.0, 0.0), ("c", 0.3, 2.0 * t - 9.0)] {
            let _ = writeln!(input, r#"{{"t":{t},"id":"{id}","x":{x},"y":{y},"z":2}}"#);
        }
    }
    let folder = tempdir().expect("a folder");
    for file in ["watch.csv", "watch.mcap"] {
        let arguments = [&STAMPS[..], &["--record", file, "--json"]].concat();
        let ran = watched(folder.path(), &arguments, &input);
        assert_eq!(ran.exit, Some(1), "{ran:?}");
        let seen: Vec<_> = events(&ran).into_iter().filter(|of| of["event"] == "violation-end").collect();
        assert!(seen.len() >= 2, "{}", ran.out);
        let audit = ran_by(TAUTLINE, folder.path(), &["audit", file, "--delta", "0.5", "--json"]);
        assert_eq!(audit.exit, Some(1), "{audit:?}");
        let report: Value = serde_json::from_str(&audit.out).expect("JSON");
        let found = violations(&report);
        assert_eq!(found.len(), seen.len(), "{}\n{}", audit.out, ran.out);
        for of in found {
            let same = |seen: &&Value| {
                [("/from_s", "/from_s"), ("/to_s", "/to_s"), ("/value/upper", "/value/upper")]
                    .iter()
                    .all(|(own, other)| (number(seen, own) - number(of, other)).abs() < 1e-6)
            };
            assert_eq!(seen.iter().filter(same).count(), 1, "{of}\n{}", ran.out);
        }
        assert!(!folder.path().join(format!("{file}.partial")).exists());
    }
    // Negative twin: at a smaller delta both find nothing.
    let clear = watched(folder.path(), &["--time", "stamps", "--delta", "0.05", "--json"], &input);
    assert!(!events(&clear).iter().any(|of| of["event"] == "violation"), "{}", clear.out);
    assert_eq!(ran_by(TAUTLINE, folder.path(), &["audit", "watch.csv", "--delta", "0.05"]).exit, Some(0));
}

#[test]
fn a_recording_overwrites_no_other_file_and_is_not_empty() {
    let folder = tempdir().expect("a folder");
    let record = |input: &str, more: &[&str]| {
        watched(folder.path(), &[&STAMPS[..], &["--record", "r.mcap"], more].concat(), input)
    };
    // Without a position there is no file.
    let empty = record("", &[]);
    assert_eq!(empty.exit, Some(1), "{empty:?}");
    assert!(empty.err.contains("no position was heard, so r.mcap is not written"), "{empty:?}");
    assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0);
    for other in ["r.mcap", "r.mcap.partial"] {
        fs::write(folder.path().join(other), "mine").expect("a file");
        let refused = record(&approach(0.0, 0.0), &[]);
        assert_eq!((refused.exit, refused.code()), (Some(2), "watch/record"), "{refused:?}");
        assert_eq!(fs::read_to_string(folder.path().join(other)).expect("the file"), "mine");
        fs::remove_file(folder.path().join(other)).expect("the file");
    }
    fs::write(folder.path().join("r.mcap"), "old").expect("a file");
    assert_eq!(record(&approach(0.0, 0.0), &["--force"]).exit, Some(0));
    assert!(folder.path().join("r.mcap").exists());
}

#[test]
fn a_recording_of_interleaved_stamps_is_judged_as_a_table_is() {
    let folder = tempdir().expect("a folder");
    let mut input = String::new();
    for k in 0..20 {
        // The second vehicle is heard before the first, whose stamp is older.
        let (now, late) = (f64::from(k), f64::from(k) - 0.5);
        let _ = writeln!(input, r#"{{"t":{now},"id":"a","x":0,"y":0,"z":2}}"#);
        let _ = writeln!(input, r#"{{"t":{late},"id":"b","x":0.3,"y":0,"z":2}}"#);
    }
    for file in ["o.csv", "o.mcap"] {
        watched(folder.path(), &[&STAMPS[..], &["--record", file]].concat(), &input);
        let audit = ran_by(TAUTLINE, folder.path(), &["audit", file, "--delta", "0.5"]);
        assert_eq!(audit.exit, Some(1), "{file}: {audit:?}");
        assert!(audit.out.starts_with("VIOLATION"), "{file}: {audit:?}");
    }
}

#[test]
fn outputs_of_a_watch_overwrite_neither_its_plan_nor_each_other() {
    let folder = tempdir().expect("a folder");
    fs::write(folder.path().join("plan.csv"), "time_s,id,x,y,z\n0,a,0,0,2\n0,b,5,0,2\n9,a,0,0,2\n9,b,5,0,2\n")
        .expect("a plan");
    for outputs in [
        &["--plan", "plan.csv", "--json=plan.csv"][..],
        &["--plan", "plan.csv", "--record", "plan.csv"],
        &["--record", "r.mcap", "--json=r.mcap"],
        &["--record", "r.mcap", "--json=r.mcap.partial"],
    ] {
        let refused = watched(folder.path(), &[&STAMPS[..], outputs, &["--force"]].concat(), "");
        assert_eq!((refused.exit, refused.code()), (Some(2), "files/overwrites-input"), "{outputs:?}: {refused:?}");
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1, "{outputs:?}: nothing is written");
    }
}

#[cfg(unix)]
#[test]
fn a_recording_of_a_killed_watch_is_read_up_to_the_last_second() {
    let folder = tempdir().expect("a folder");
    let mut child = Command::new(TAUTLINE)
        .args(["watch", "--record", "r.mcap", "--json=lines.jsonl"])
        .args(STAMPS)
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program runs");
    let mut input = child.stdin.take().expect("a pipe");
    input.write_all(approach(0.0, 0.0).as_bytes()).expect("the program listens");
    let audit = || {
        let words = ["audit", "r.mcap.partial", "--delta", "1", "--allow-unfinished", "--json"];
        let judged = ran_by(TAUTLINE, folder.path(), &words);
        serde_json::from_str::<Value>(&judged.out).ok().and_then(|report| report["window_s"][1].as_f64())
    };
    // Positions of the fifth second, from 4 s on, are written at its beginning.
    while audit().is_none_or(|end_s| end_s < 3.9) {
        assert!(child.try_wait().expect("its state").is_none(), "the watch ended early");
    }
    child.kill().expect("killed");
    child.wait().expect("ended");
    assert!(audit().is_some_and(|end_s| (3.9..=4.0).contains(&end_s)), "{:?}", audit());
    assert!(!folder.path().join("r.mcap").exists());
    let refused = ran_by(TAUTLINE, folder.path(), &["audit", "r.mcap.partial", "--delta", "1"]);
    assert_eq!(refused.exit, Some(2), "an unfinished file is read on request only: {refused:?}");
    let lines = fs::read_to_string(folder.path().join("lines.jsonl")).expect("the notices");
    assert!(lines.lines().all(|line| serde_json::from_str::<Value>(line).is_ok()), "{lines}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_recording_is_complete_if_another_output_fails() {
    let folder = tempdir().expect("a folder");
    let full = fs::File::options().write(true).open("/dev/full").expect("the device");
    let mut child = Command::new(TAUTLINE)
        .args(["watch", "--json", "--record", "r.csv"])
        .args(STAMPS)
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(full)
        .stderr(Stdio::null())
        .spawn()
        .expect("the program runs");
    let mut input = child.stdin.take().expect("a pipe");
    // The watch may end before its input.
    let _ = input.write_all(approach(0.0, 0.0).as_bytes());
    drop(input);
    assert_eq!(child.wait().expect("ends").code(), Some(3));
    let text = fs::read_to_string(folder.path().join("r.csv")).expect("the recording");
    assert!(text.lines().count() > 1, "{text}");
}

#[test]
fn deviations_from_the_plan_are_reported() {
    let folder = tempdir().expect("a folder");
    let plan = "time_s,id,x,y,z\n0,a,0,0,2\n0,b,4,0,2\n4,a,0,0,2\n4,b,4,0,2\n";
    fs::write(folder.path().join("plan.csv"), plan).expect("a file");
    let run = |input: &str| {
        watched(folder.path(), &[&STAMPS[..], &["--plan", "plan.csv", "--tube", "0.3", "--json"]].concat(), input)
    };
    assert_eq!(run(&approach(0.0, 0.0)).exit, Some(0));
    let off = run(&approach(0.2, 0.0));
    assert_eq!(off.exit, Some(1), "{off:?}");
    assert_eq!(result(&off), ("clear".to_owned(), false));
    let left = events(&off).into_iter().find(|of| of["event"] == "plan").expect("a deviation");
    assert!(left["vehicle"] == "b" && left["outside"] == true, "{left}");
    assert!((number(&left, "/deviation_m") - 0.32).abs() < 1e-9, "{left}");
    // Beside an undecided part the last line names the deviation, too.
    let doubtful = approach(0.2, 0.0).replacen("{\"t\":3,", "nonsense\n{\"t\":3,", 1);
    let doubtful = events(&run(&doubtful)).pop().expect("a summary");
    assert_eq!((&doubtful["status"], &doubtful["off_plan"]), (&"undecided".into(), &true.into()), "{doubtful}");
    assert!(doubtful["text"].as_str().is_some_and(|text| text.ends_with("; OFF PLAN")), "{doubtful}");
    // A plan of other times is not kept, and a guessed unit is refused.
    let late = watched(
        folder.path(),
        &[&STAMPS[..], &["--plan", "plan.csv", "--plan-start", "50", "--json"]].concat(),
        &approach(0.0, 0.0),
    );
    assert_eq!(late.exit, Some(1), "{late:?}");
    assert_eq!(events(&late).last().expect("a summary")["compared_with_plan"], 0);
    fs::write(folder.path().join("guess.csv"), plan.replace("time_s", "t")).expect("a file");
    let guess = watched(folder.path(), &[&STAMPS[..], &["--plan", "guess.csv"]].concat(), "");
    assert_eq!((guess.exit, guess.code()), (Some(2), "watch/plan"), "{guess:?}");
    // Times since 1970 in both are one clock.
    let since_1970 = |text: &str| text.replace("\n0,", "\n1700000000,").replace("\n4,", "\n1700000004,");
    fs::write(folder.path().join("absolute.csv"), since_1970(plan)).expect("a file");
    let flight = approach(0.0, 0.0).lines().fold(String::new(), |mut text, line| {
        let (t_s, rest) = line[5..].split_once(',').expect("a stamp");
        let t_s = t_s.parse::<f64>().expect("a number") + 1.7e9;
        let _ = writeln!(text, "{{\"t\":{t_s},{rest}");
        text
    });
    let absolute = watched(folder.path(), &[&STAMPS[..], &["--plan", "absolute.csv", "--json"]].concat(), &flight);
    assert_eq!(absolute.exit, Some(0), "{absolute:?}");
    assert_eq!(events(&absolute).last().expect("a summary")["compared_with_plan"], 82);
    // A plan without heights.
    fs::write(folder.path().join("flat.csv"), "time_s,id,x,y\n0,a,0,0\n0,b,4,0\n4,a,0,0\n4,b,4,0\n").expect("a file");
    let flat = watched(folder.path(), &[&STAMPS[..], &["--plan", "flat.csv"]].concat(), "");
    assert_eq!((flat.exit, flat.code()), (Some(2), "watch/plan"), "{flat:?}");
    // A vehicle of the plan that is not heard.
    let alone: String = approach(0.0, 0.0).replace("\"b\"", "\"c\"");
    assert!(has_reason(&run(&alone), "missing", "missing", vec!["b"]));
}

#[test]
fn wrong_options_end_with_code_2() {
    let folder = tempdir().expect("a folder");
    fs::write(folder.path().join("there.csv"), "").expect("a file");
    fs::create_dir(folder.path().join("folder.csv")).expect("a folder");
    for (arguments, code) in [
        (&["--delta", "0"][..], "watch/setting"),
        (&["--delta", "nan"], "watch/setting"),
        (&["--delta", "1", "--max-age", "-1"], "watch/setting"),
        (&["--delta", "1", "--expect", "1"], "watch/setting"),
        (&["--delta", "1", "--ids", "a,,b"], "watch/setting"),
        (&["serial:1", "--delta", "1"], "watch/source"),
        (&["mavlink:here", "--delta", "1"], "watch/source"),
        (&["rosbridge:localhost:9090", "--delta", "1"], "watch/source"),
        (&["foxglove:no such host", "--delta", "1"], "watch/source"),
        (&["mavlink:127.0.0.1:0", "--delta", "1", "--time", "stamps"], "watch/source"),
        (&["--delta", "1", "--plan-end", "hold"], "watch/source"),
        (&["--delta", "1", "--record", "watch.txt"], "watch/record"),
        (&["--delta", "1", "--record", "folder.csv", "--force"], "watch/record"),
        (&["--delta", "1", "--record", "there.csv"], "watch/record"),
        (&["--delta", "1", "--plan", "none.csv"], "recording/not-found"),
        (&["--delta", "1", "--origin", "95,0,0"], ""),
        (&["--delta", "1", "--foxglove=0.0.0.0:8765"], "watch/setting"),
        (&["--delta", "1", "--foxglove=[::]:8765"], "watch/setting"),
        (&["--delta", "1", "--foxglove=here"], ""),
        (&["--delta", "1", "--foxglove=127.0.0.1:65536"], ""),
    ] {
        let ran = watched(folder.path(), arguments, "");
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{arguments:?}: {ran:?}");
    }
    assert_eq!(watched(folder.path(), &[], "").exit, Some(2), "delta is required");
}

#[test]
fn vehicles_that_sign_off_leave_a_good_watch() {
    let flight = approach(0.0, 0.0);
    let off = |id: &str, t: f64| format!("{{\"t\":{t},\"id\":\"{id}\",\"event\":\"off\"}}\n");
    let later = (41..=60).fold(String::new(), |mut text, k| {
        let _ = writeln!(text, r#"{{"t":{},"id":"a","x":0,"y":0,"z":2}}"#, f64::from(k) / 10.0);
        text
    });
    let ran = judged(&format!("{flight}{}{later}{}", off("b", 4.0), off("a", 6.0)), &["--json"]);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    let summary = events(&ran).pop().expect("a summary");
    let both = serde_json::json!(["a", "b"]);
    assert_eq!((&summary["vehicles"], &summary["signed_off"]), (&both, &both), "{summary}");
    assert!(events(&ran).iter().any(|of| of["event"] == "signed-off" && of["vehicle"] == "b"), "{}", ran.out);
    // Negative twins: no sign-off, a refused one, and wrong ones.
    for (input, fault) in [
        (format!("{flight}{later}"), None),
        (format!("{}{}{later}", approach(-0.9, 0.0), off("b", 4.0)), Some("sign-off-refused")),
        (format!("{flight}{}{later}", off("c", 4.0)), Some("garbage")),
        (format!("{flight}{}{later}", off("b", 1e300)), Some("out-of-range")),
        (format!("{flight}{}{later}", off("b", 4.0).replace("off", "gone")), Some("garbage")),
        (format!("{flight}{}{later}", off("b", 4.0).replace("\"t\":4,", "")), Some("garbage")),
        (format!("{flight}{}{later}", off("b", 4.0).replace("event", "x\":1,\"event")), Some("garbage")),
    ] {
        let ran = judged(&input, &["--json"]);
        assert_eq!(ran.exit, Some(1), "{fault:?}: {ran:?}");
        let found = events(&ran)
            .iter()
            .any(|of| of["event"] == "fault" && Some(of["fault"].as_str().unwrap_or_default()) == fault);
        assert_eq!(found, fault.is_some(), "{fault:?}: {}", ran.out);
    }
}

#[test]
fn a_watch_with_a_return_after_a_sign_off_is_not_better_than_its_audit() {
    // `a` signs off at 1 s and is heard again on the other side of `b`, or stays away.
    for (vehicles, returns_at, exit) in
        [("b", 31, 1), ("b", 13, 1), ("bc", 31, 1), ("bc", 13, 1), ("b", 99, 0), ("bc", 99, 0)]
    {
        let mut input = String::new();
        for k in 0..=40 {
            let t = f64::from(k) / 10.0;
            let x_m = if k <= 10 { 0.0 } else { 10.0 };
            if k <= 10 || k >= returns_at {
                let _ = writeln!(input, r#"{{"t":{t},"id":"a","x":{x_m},"y":0,"z":2,"vx":0,"vy":0,"vz":0}}"#);
            }
            for (id, x_m) in vehicles.chars().zip([5, 20]) {
                let _ = writeln!(input, r#"{{"t":{t},"id":"{id}","x":{x_m},"y":0,"z":2,"vx":0,"vy":0,"vz":0}}"#);
            }
            if k == 10 {
                input += "{\"t\":1.02,\"id\":\"a\",\"event\":\"off\"}\n";
            }
        }
        let folder = tempdir().expect("a folder");
        let ran = watched(folder.path(), &[&STAMPS[..], &["--record", "r.csv"]].concat(), &input);
        assert_eq!(ran.exit, Some(exit), "{vehicles} {returns_at}: {ran:?}");
        let audit = ran_by(TAUTLINE, folder.path(), &["audit", "r.csv", "--delta", "0.5"]);
        assert!(exit == 1 || audit.exit == Some(0), "{vehicles} {returns_at}: {ran:?} {audit:?}");
        if returns_at == 31 {
            assert!(audit.exit == Some(1) && audit.out.contains("UNDECIDED"), "{audit:?}");
        }
    }
}

#[test]
fn a_wrong_address_of_a_server_is_refused_with_a_right_one() {
    let folder = tempdir().expect("a folder");
    for (argument, remedy) in [
        ("--foxglove=localhost:9", "write 127.0.0.1:9"),
        ("--foxglove=8766", "write 127.0.0.1:8766"),
        ("--foxglove=:8766", "write 127.0.0.1:8766"),
        ("--foxglove=127.0.0.1", "write 127.0.0.1:8765"),
        ("--page=localhost:9", "write 127.0.0.1:9"),
        ("--page=99999", "write 127.0.0.1:8737"),
    ] {
        let ran = watched(folder.path(), &["--delta", "1", argument], "");
        assert!(ran.exit == Some(2) && ran.err.contains(remedy), "{argument}: {ran:?}");
    }
    // One port for both servers: nothing is served and no file is written.
    for (page, foxglove) in [("127.0.0.1", "127.0.0.1"), ("0.0.0.0", "127.0.0.1"), ("[::1]", "[::1]")] {
        let [page, foxglove] = [format!("--page={page}:8797"), format!("--foxglove={foxglove}:8797")];
        let ran = watched(folder.path(), &["--delta", "1", "--record", "r.csv", &page, &foxglove], "");
        assert_eq!((ran.exit, ran.code()), (Some(2), "watch/setting"), "{ran:?}");
        assert!(ran.err.contains("--page, --foxglove: both have one port"), "{ran:?}");
        assert!(!ran.err.contains("live page:") && !ran.err.contains("Foxglove server:"), "{ran:?}");
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }
    // Negative twin: any free port for each is good, and the watch ends with its input.
    let free = ["--delta", "1", "--page=127.0.0.1:0", "--foxglove=127.0.0.1:0"];
    assert_eq!(watched(folder.path(), &free, "").exit, Some(1));
}

#[test]
fn foxglove_is_served_on_the_printed_address() {
    let mut child = Command::new(TAUTLINE)
        .args(["watch", "--json", "--delta", "0.5", "--foxglove=127.0.0.1:0"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program runs");
    let mut line = String::new();
    let mut err = BufReader::new(child.stderr.take().expect("a pipe"));
    while !line.contains("ws://") {
        line.clear();
        assert!(std::io::BufRead::read_line(&mut err, &mut line).expect("a line") > 0, "no address");
    }
    let url = &line[line.find("ws://").expect("an address")..];
    let address = url.trim().trim_start_matches("ws://").to_owned();
    let request = tungstenite::ClientRequestBuilder::new(url.trim().parse().expect("an address"))
        .with_sub_protocol("foxglove.sdk.v1");
    let (mut socket, _) = tungstenite::connect(request).expect("connects");
    while !socket.read().expect("a message").to_text().is_ok_and(|text| text.contains("/watch/scene")) {}
    // The port is taken now.
    let folder = tempdir().expect("a folder");
    let second = watched(folder.path(), &["--delta", "0.5", &format!("--foxglove={address}")], "");
    assert_eq!((second.exit, second.code()), (Some(3), "watch/cannot-listen"), "{second:?}");
    child.kill().expect("ends");
    child.wait().expect("ends");
}

/// Starts a watch of a source.
fn start(arguments: &[&str]) -> (Child, BufReader<std::process::ChildStdout>) {
    let mut child = Command::new(TAUTLINE)
        .arg("watch")
        .args(arguments)
        .args(["--json", "--delta", "0.5", "--max-age", "0.5"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program runs");
    let out = BufReader::new(child.stdout.take().expect("a pipe"));
    (child, out)
}

/// Reads events until one fulfils a condition.
fn until(out: &mut impl std::io::BufRead, is_it: impl Fn(&Value) -> bool) -> Value {
    let mut line = String::new();
    loop {
        line.clear();
        assert!(out.read_line(&mut line).expect("a line") > 0, "the watch has ended");
        let of: Value = serde_json::from_str(&line).expect("JSON");
        if is_it(&of) {
            return of;
        }
    }
}

/// Accepts a WebSocket of rosbridge and sends poses of two vehicles until `count` were sent.
fn serve_ros(stream: TcpStream, count: u32) {
    let mut socket = tungstenite::accept(stream).expect("a handshake");
    for _ in 0..2 {
        let asked = socket.read().expect("a subscription").into_text().expect("text");
        assert!(asked.contains("subscribe"), "{asked}");
    }
    for k in 0..count {
        for (id, x) in [("a", 0), ("b", 4)] {
            let text = format!(
                r#"{{"op":"publish","topic":"/{id}/pose","msg":{{"header":{{"stamp":{{"sec":{},"nanosec":{}}},
                "frame_id":"world"}},"pose":{{"position":{{"x":{x},"y":0,"z":2}}}}}}}}"#,
                100 + k / 50,
                k % 50 * 20_000_000
            );
            // The watch ends before its server.
            if socket.send(tungstenite::Message::text(text)).is_err() {
                return;
            }
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}

#[test]
fn a_source_that_is_lost_connects_again_and_nothing_is_clear_meanwhile() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let source = format!("rosbridge:{}", listener.local_addr().expect("an address"));
    let (mut child, mut out) = start(&[&source, "--topic", "/a/pose", "--topic", "/b/pose"]);
    let (resume, is_stale) = std::sync::mpsc::channel();
    let server = std::thread::spawn(move || {
        let serve = || serve_ros(listener.accept().expect("a client").0, 100);
        serve();
        is_stale.recv_timeout(PATIENCE).expect("the watch reports a stale vehicle");
        serve();
    });
    until(&mut out, |of| of["event"] == "connected");
    until(&mut out, |of| of["status"] == "clear" && of["event"] == "state");
    until(&mut out, |of| of["event"] == "lost");
    until(&mut out, |of| of["reason"]["code"] == "stale");
    resume.send(()).expect("the server waits");
    until(&mut out, |of| of["event"] == "connected");
    // The stamps begin again: the clock of the source stepped.
    until(&mut out, |of| of["fault"] == "clock-step");
    until(&mut out, |of| of["status"] == "clear" && of["event"] == "state");
    child.kill().expect("ends");
    child.wait().expect("ends");
    server.join().expect("served");
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_watch_with_the_code_of_its_verdict() {
    for (x, code) in [(4.0, 0), (0.4, 1)] {
        let mut child = Command::new(TAUTLINE)
            .args(["watch", "--json", "--delta", "0.5", "--max-age", "60"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program runs");
        let mut input = child.stdin.take().expect("a pipe");
        let mut out = BufReader::new(child.stdout.take().expect("a pipe"));
        for (id, x) in [("a", 0.0), ("b", x)] {
            writeln!(input, r#"{{"t":0,"id":"{id}","x":{x},"y":0,"z":2,"vx":0,"vy":0,"vz":0}}"#).expect("writes");
        }
        until(&mut out, |of| of["heard"] == 2);
        let signal = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
        assert!(signal.success());
        let summary = until(&mut out, |of| of["event"] == "summary");
        assert_eq!(summary["pass"], Value::Bool(code == 0), "{summary}");
        assert_eq!(child.wait().expect("ends").code(), Some(code));
        drop(input);
    }
}
