//! Golden table of verdicts: exit codes, codes of failures, statuses, counts and parts over a fixed corpus.
//!
//! `golden.txt` holds a line for each command. `TAUTLINE_WRITE_GOLDEN=1` writes it again. A difference needs a reason.

#![allow(clippy::format_collect)]

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::program::{TAUTLINE, ran_by};

/// A tower beside a path, a wall that none meets, and a truck that moves.
const OBSTACLES: &str = "[[obstacle]]\nname = \"tower\"\nball = { radius_m = 0.5 }\nat_m = [5, 1, 0]\n\
    [[obstacle]]\nname = \"wall\"\nbox = { size_m = [2, 2, 8] }\nat_m = [20, 20, 0]\nclearance_m = 0\n";
const TRUCK: &str =
    "[[obstacle]]\nname = \"truck\"\nball = { radius_m = 1 }\npath = [[0, -20, 0, 0], [10, 20, 0, 0]]\n";
const FENCE: &str = "[fence]\npolygon_m = [[-12, -12], [12, -12], [12, 12], [-12, 12]]\nheight_m = [-1, 9]\n";

/// Number of random recordings.
const RECORDINGS: u64 = 8;

/// Scenarios that are checked and flown.
const FLIGHTS: &[&str] = &[
    "pentagon --set time.duration_s=20",
    "pentagon-laplacian --set time.duration_s=20",
    "pentagon-collinear --set time.duration_s=20",
    "pentagon-leader --set time.duration_s=10",
    "leader-lossy",
    "swap",
    "obstacles --set time.duration_s=15",
    "obstacles --set law.kind=laplacian --set time.duration_s=15",
    "crazyflies --set time.duration_s=4",
    "shielded-crazyflies --set time.duration_s=4",
    "shielded-crazyflies --set shield.tracking_error_m=0.01 --set time.duration_s=4",
    "gusts",
    "hexagon --set plant.kind=ideal --set time.duration_s=5",
    "hexagon --set time.dt_s=0.2 --set time.duration_s=5",
    "swap --set law.kind=cbf-qp --set time.duration_s=8",
    "swap --set law.kind=cbf-qp --set law.variant=braking --set time.duration_s=8",
    "swap --set law.kind=orca --set time.duration_s=8",
    "swap --set law.kind=bvc --set time.duration_s=8",
    "swap --set law.kind=flocking --set time.duration_s=8",
    "swap --set law.kind=potential --set time.duration_s=8",
    "swap --set law.kind=laplacian --set shield.enabled=true --set time.duration_s=8",
    "swap --set vehicle.model=unicycle --set time.duration_s=8",
    "swap --set law.delta_m=9",
];

/// Questions to each random recording.
const QUESTIONS: &[&str] = &[
    "--delta 0.5",
    "--delta 1",
    "--delta 3",
    "--delta 1 --motion bounded --max-accel 2",
    "--delta 1 --motion hold",
    "--delta 1 --max-gap 1 --require-presence",
    "--delta 1 --limit speed=2,climb=1",
    "--delta 1 --fence fence.toml --obstacles obstacles.toml",
    "--ellipsoid 0.5,0.5,1",
    "--cylinder 1,2",
    "--delta 1 --from 2 --until 6",
    "--delta 1 --above 0.5",
    "--delta 1 --allow-undecided --max-gap 1",
];

/// Recordings with their questions.
const AUDITS: &[&str] = &[
    "touch.csv --delta 1",
    "touch.csv --delta 1.0000000001",
    "near.csv --delta 1 --independent",
    "far.csv --delta 1 --obstacles truck.toml",
    "far.csv --delta 1 --obstacles obstacles.toml",
    "pass.csv --delta 1",
    "pass.csv --delta 1.000001",
    "pass.csv --delta 0.5 --limit speed=1",
    "pass.csv --limit speed=1",
    "pass.csv --limit speed=3",
    "pass.csv --radius 0.3",
    "pass.csv --well-clear 5,5,35",
    "pass.csv --delta 0.9 --offset bravo=0.4",
    "pass.csv --delta 1 --ids alpha",
    "late.csv --delta 1 --require-presence",
    "late.csv --delta 1 --expect-vehicles 4",
    "late.csv --delta 1 --expect-vehicles 3",
    "gap.csv --delta 0.5",
    "gap.csv --delta 0.5 --max-gap 0.6",
    "gap.csv --delta 0.5 --motion bounded --max-accel 0.1",
    "alone.csv --delta 1",
    "backwards.csv --delta 1",
    "guess.csv --delta 1",
    "guess.csv --delta 1 --limit speed=5",
    "plane.csv --delta 1",
    "plane.csv --delta 1 --limit climb=1",
    "pass.csv",
    "none.csv --delta 1",
    "pass.csv near.csv far.csv --delta 1",
    "pass.csv backwards.csv --delta 1",
    "out/pentagon",
    "out/pentagon --independent",
    "out/pentagon --delta 2.5",
    "out/pentagon-laplacian",
    "out/pentagon-collinear",
    "out/leader-lossy",
    "out/swap",
    "out/obstacles",
    "out/obstacles --independent",
    "out/crazyflies",
    "out/hexagon",
    "out/gusts --until 2",
];

/// Studies.
const STUDIES: &[&str] = &[
    "compare swap --runs 1 --set time.duration_s=8 --json",
    "sweep pentagon --key law.alpha=0.5,1 --runs 1 --set time.duration_s=8 --json",
    "attack pentagon-laplacian --move-start 0.1 --flights 4 --set time.duration_s=6 --json",
    "margin swap --key law.delta_m=0.5..1.5 --scan 2 --halvings 1 --runs 1 --set time.duration_s=8 --json",
];

/// `SplitMix64` (Steele, Lea, Flood 2014): the same recordings on every machine.
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        low + (high - low) * (((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64)
    }
}

/// Vehicles on random paths of few decimals. In odd recordings some begin late, and some have gaps.
fn recording(number: u64) -> String {
    let mut random = Random(number);
    let mut text = "t_s,id,x,y,z\n".to_owned();
    for vehicle in 0..3 + number % 5 {
        let mut place = [0; 3].map(|_| random.between(-8.0, 8.0));
        let (begin, gap) = (random.between(0.0, 8.0), random.between(0.0, 40.0));
        for k in 0..20 {
            place = place.map(|x| x + random.between(-1.0, 1.0));
            let t = f64::from(k) * 0.5;
            let is_absent = (vehicle % 3 == 2 && t < begin) || (gap..gap + 3.0).contains(&f64::from(k));
            if number % 2 == 1 && is_absent {
                continue;
            }
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{t},v{vehicle},{:.2},{:.2},{:.2}", place[0], place[1], place[2]);
        }
    }
    text
}

/// Files of the corpus.
fn files() -> Vec<(String, String)> {
    let mut files: Vec<_> = (0..RECORDINGS).map(|k| (format!("r{k}.csv"), recording(k))).collect();
    let rest = |x: f64| (0..=10).map(|t| format!("{t},a,0,0,0\n{t},b,{x},0,0\n")).collect::<String>();
    let pass = (0..=20).map(|k| {
        let (t, x) = (0.5 * f64::from(k), f64::from(k) - 10.0);
        format!("{t},alpha,{x},0,0\n{t},bravo,{},1,0\n", -x)
    });
    let pass = pass.collect::<String>();
    let late = (5..=10).map(|t| format!("{t},c,0,{},0\n", t - 4)).collect::<String>();
    for (name, rows) in [
        ("touch", rest(1.0)),
        ("near", rest(0.5)),
        ("far", rest(50.0)),
        ("pass", pass.clone()),
        ("late", rest(9.0) + &late),
        ("alone", rest(1.0).lines().filter(|row| row.contains('a')).map(|row| format!("{row}\n")).collect()),
        ("backwards", "1,a,0,0,0\n0,a,0,0,0\n".to_owned()),
        ("gap", pass.lines().filter(|row| !row.starts_with(['4', '5', '6'])).map(|row| format!("{row}\n")).collect()),
    ] {
        files.push((format!("{name}.csv"), format!("t_s,id,x,y,z\n{rows}")));
    }
    files.push(("guess.csv".to_owned(), format!("t,id,x,y,z\n{}", rest(9.0))));
    files.push(("plane.csv".to_owned(), "t_s,id,x,y\n0,a,0,0\n0,b,3,0\n9,a,0,0\n9,b,3,0\n".to_owned()));
    files.push(("obstacles.toml".to_owned(), OBSTACLES.to_owned()));
    files.push(("truck.toml".to_owned(), TRUCK.to_owned()));
    files.push(("fence.toml".to_owned(), FENCE.to_owned()));
    files
}

/// Commands of the corpus. Flights come first: audits read their recordings.
fn commands() -> Vec<String> {
    let both = |flight: &&str| [format!("run {flight} --force --json"), format!("check {flight} --json")];
    let random = (0..RECORDINGS).flat_map(|k| {
        let asked = QUESTIONS.iter().map(move |asked| format!("audit r{k}.csv {asked} --json"));
        asked.chain([format!("audit r{k}.csv --plan r{k}.csv --plan-delay 0.1 --tube 0.25 --json")])
    });
    let audits = AUDITS.iter().map(|asked| format!("audit {asked} --json"));
    let studies = STUDIES.iter().map(|study| (*study).to_owned());
    FLIGHTS.iter().flat_map(both).chain(random).chain(audits).chain(studies).collect()
}

/// Returns what decides about a report: each statement by its path, without texts, lists and measured numbers.
fn row(command: &str, folder: &Path) -> String {
    let words: Vec<_> = command.split(' ').collect();
    let ran = ran_by(TAUTLINE, folder, &words);
    let mut row = format!("{command} | exit {}", ran.exit.map_or("none".to_owned(), |exit| exit.to_string()));
    if !ran.code().is_empty() {
        let _ = write!(row, " | {}", ran.code());
    }
    let Ok(report) = serde_json::from_str::<Value>(&ran.out) else { return row };
    let reports = report.as_array().map_or_else(|| std::slice::from_ref(&report), Vec::as_slice);
    for report in reports {
        row += " |";
        statements(report, &mut row);
    }
    row
}

/// Appends the statements of a report of a flight or of a recording.
fn statements(report: &Value, row: &mut String) {
    let mut add = |name: &str, value: &Value| {
        let shown = match value {
            Value::Null => return,
            Value::String(word) => word.clone(),
            Value::Array(list) => list.len().to_string(),
            other => other.to_string(),
        };
        // Writing to a string cannot fail.
        let _ = write!(row, " {name}={shown}");
    };
    let at = |path: &str| report.pointer(path).unwrap_or(&Value::Null);
    let part = |name: &str| {
        let answers = at("/answers").as_array().map_or(&[][..], Vec::as_slice);
        answers.iter().find(|answer| answer["part"] == name).unwrap_or(&Value::Null)
    };
    let is_audit = !at("/judged").is_null();
    let is_flight = !at("/reasons").is_null();
    let separation = part("separation");
    let refusals = at("/reasons").as_array().into_iter().flatten().find(|reason| reason["code"] == "refused");
    let refused = refusals.map_or(&Value::Null, |reason| &reason["data"]["warnings"]);
    let none = Value::Array(Vec::new());
    if is_audit {
        add("status", at("/status"));
    }
    add("ready", at("/ready"));
    if is_flight {
        add("pass", at("/pass"));
        add("refused", if refused.is_null() { &none } else { refused });
    }
    add("reasons", at("/reasons"));
    add("separation", &separation["status"]);
    if is_audit {
        add("proved", at("/proved"));
        let is_clear = at("/status") == "clear";
        let is_run_audit = |fact: &Value| fact["fact"] == "motion" && fact["value"] == "run-audit";
        let by_run = at("/facts").as_array().into_iter().flatten().any(is_run_audit);
        add("by_run", &Value::Bool(is_clear && by_run));
    }
    for (name, path) in [
        ("void", "/certificate/void"),
        ("voided", "/certificate_void"),
        ("reached", "/formation/reached"),
        ("vehicles", "/judged"),
        ("partly", "/presence/partly"),
    ] {
        add(name, at(path));
    }
    if is_audit {
        let zero = Value::from(0);
        let count = |kind: &str| if separation.is_null() { &zero } else { &separation[kind]["count"] };
        add("violations", count("violations"));
        add("undecided", count("undecided"));
    }
    for (name, path) in
        [("gaps", "/gaps/count"), ("alone", "/alone"), ("ended_early", "/ended_early/at_s"), ("plan", "/plan/status")]
    {
        add(name, at(path));
    }
    add("well_clear", &part("well_clear")["status"]);
    add("code", at("/code"));
    for (name, path) in [("certifies", "/certificate/separation_m"), ("certifies", "/certified_m")] {
        if report.pointer(path).is_some() {
            add(name, &Value::Bool(at(path).is_number()));
        }
    }
    for warning in at("/warnings").as_array().into_iter().flatten() {
        add("warning", &warning["code"]);
    }
    if is_flight {
        add("violations", &separation["violations"]["count"]);
        add("undecided", &separation["undecided"]["count"]);
    }
    for answer in at("/answers").as_array().into_iter().flatten() {
        let name = answer["part"].as_str().unwrap_or_default();
        if !["separation", "well_clear", "presence", "plan"].contains(&name) {
            add(name, &answer["status"]);
        }
    }
}

#[test]
fn verdicts_are_those_of_the_golden_table() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files() {
        fs::write(folder.path().join(name), text).expect("written");
    }
    let found: String = commands().iter().map(|command| row(command, folder.path()) + "\n").collect();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/golden.txt");
    if std::env::var_os("TAUTLINE_WRITE_GOLDEN").is_some() {
        fs::write(&path, &found).expect("written");
    }
    let golden = fs::read_to_string(&path).expect("the table");
    let differing: Vec<_> = golden.lines().zip(found.lines()).filter(|(one, other)| one != other).collect();
    assert!(differing.is_empty(), "{differing:#?}");
    assert_eq!(golden.lines().count(), found.lines().count());
}
