//! `tautline audit --proof`, and its independent checker.

#![allow(clippy::cast_possible_truncation, clippy::format_collect)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::json;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::least;

/// Number of recordings; more with `TAUTLINE_LONG=1`.
const CASES: u64 = 60;
const LONG_CASES: u64 = 1000;

const PASS: &str = "t,id,x,y,z\n0,alpha,-5,0,0\n0,bravo,5,1,0\n1,alpha,5,0,0\n1,bravo,-5,1,0\n";

/// Above the separation of any two vehicles at their first instant [m]: 46 sqrt(3), and the shift of clocks.
const FARTHEST_M: &str = "90";

/// `SplitMix64` (Steele, Lea, Flood 2014): the same recordings on every machine.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) % limit
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.below(1 << 53) as f64 / (1_u64 << 53) as f64)
    }
}

/// Vehicles on random paths, with a common clock or their own; numbers with all digits or three decimals. The table has
/// one of the forms that the checker reads.
fn recording(number: u64) -> String {
    let mut random = Random(number);
    let (vehicles, instants) = (2 + random.below(5), 2 + random.below(30));
    let (is_together, is_short) = (random.below(2) == 0, random.below(2) == 0);
    let start_s = if random.below(4) == 0 { 1_700_000_000 } else { 0 };
    let (has_more, is_quoted, end) = (random.below(3) == 0, random.below(5) == 0, ["\n", "\r\n"][number as usize % 2]);
    // Seconds, milliseconds, dates, or seconds with an exponent.
    let kind = random.below(4);
    let time_name = ["t", "time", "t_s", "time_s"][random.below(if kind == 1 { 2 } else { 4 }) as usize];
    let digits = |x: f64| if is_short { format!("{x:.3}") } else { format!("{x:?}") };
    let mut rows = Vec::new();
    for vehicle in 0..vehicles {
        let shift_s = if is_together { 0.0 } else { random.between(0.0, 0.4) };
        let mut position = [0; 3].map(|_| random.between(-20.0, 20.0));
        for instant in 0..instants {
            let time_s = 0.5 * instant as f64 + shift_s;
            position = position.map(|x| x + random.between(-3.0, 3.0));
            let time = match kind {
                0 if start_s > 0 => format!("{}", f64::from(start_s) + time_s),
                0 => digits(time_s),
                1 => format!("{:.0}", 1e3 * (f64::from(start_s) + time_s)),
                2 => format!("2023-11-14T22:13:{:09.6}Z", 20.0 + time_s),
                _ => format!("{time_s:e}"),
            };
            let [x, y, z] = position.map(digits);
            let id = if is_quoted { format!("\"v{vehicle}\"") } else { format!("v{vehicle}") };
            let more = if has_more { ",1,2.5,-3e0,nan" } else { "" };
            rows.push((time_s, format!("{time},{id},{x},{y},{z}{more}{end}")));
            // A row without a position, and a repeated row.
            match random.below(20) {
                0 => rows.push((time_s, format!("{time},{id},,,{}{end}", if has_more { ",,,," } else { "" }))),
                1 => rows.extend(rows.last().cloned()),
                _ => {}
            }
        }
    }
    if random.below(2) == 0 {
        rows.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    }
    let more = if has_more { ",vx,vy,vz,qw" } else { "" };
    let comment = if number.is_multiple_of(5) { format!("# a comment, of no table{end}{end}") } else { String::new() };
    let rows: String = rows.into_iter().map(|(_, row)| row).collect();
    format!("{comment}{time_name},id,x,y,z{more}{end}{rows}")
}

fn audit(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, &[&["audit"], arguments].concat())
}

fn checker() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("python/tautline/check_proof.py")
}

fn python(folder: &Path, script: &Path, arguments: &[&str]) -> Output {
    let ran = Command::new("python3").arg(script).args(arguments).current_dir(folder).output();
    ran.expect("tests/setup.sh looks for python3")
}

fn smallest_m(folder: &Path, arguments: &[&str]) -> f64 {
    let report: serde_json::Value = serde_json::from_str(&audit(folder, arguments).out).expect("a report");
    least(&report)
}

#[test]
fn the_printed_limit_is_kept_and_the_next_number_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    for number in 1000..1012 {
        fs::write(folder.path().join("a.csv"), recording(number)).expect("a file");
        let least_m = smallest_m(folder.path(), &["a.csv", "--delta", "0.001", "--json"]);
        for (limit_m, exit) in [(least_m, 0), (least_m.next_up(), 1)] {
            let ran = audit(folder.path(), &["a.csv", "--delta", &format!("{limit_m:?}")]);
            assert_eq!(ran.exit, Some(exit), "{number}: {limit_m:?} {ran:?}");
        }
    }
}

#[test]
fn the_checker_confirms_proofs_and_denies_altered_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let cases = if std::env::var_os("TAUTLINE_LONG").is_some() { LONG_CASES } else { CASES };
    for number in 0..cases {
        let (data, proof) = (format!("{number}.csv"), format!("{number}.json"));
        fs::write(folder.path().join(&data), recording(number)).expect("a file");
        // A limit that is barely kept, one that is kept, and one that is not. Decimals and doubles differ by less.
        let delta = match number % 3 {
            0 => format!("{:?}", smallest_m(folder.path(), &[&data, "--delta", "0.01", "--json"]) * (1.0 - 1e-11)),
            1 => "0.01".to_owned(),
            _ => FARTHEST_M.to_owned(),
        };
        let ran = audit(folder.path(), &[&data, "--delta", &delta, "--proof", &proof, "--quiet"]);
        assert_eq!(ran.exit, Some(i32::from(number % 3 == 2)), "{ran:?}");
    }
    let driver = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/proofs.py");
    let ran = python(folder.path(), &driver, &[checker().to_str().expect("a path"), "."]);
    let out = String::from_utf8_lossy(&ran.stdout);
    assert!(ran.status.success() && out.starts_with(&format!("{cases} confirmed, ")), "{ran:?}");
}

#[test]
fn the_checker_has_exit_codes() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    fs::write(at("pass.csv"), PASS).expect("a file");
    assert_eq!(audit(folder.path(), &["pass.csv", "--delta", "1", "--proof", "proof.json"]).exit, Some(0));
    let check = |proof: &str, data: &str| {
        let ran = python(folder.path(), &checker(), &[proof, data]);
        (ran.status.code(), String::from_utf8_lossy(&ran.stdout).into_owned())
    };
    let (code, said) = check("proof.json", "pass.csv");
    assert_eq!(code, Some(0), "{said}");
    let verdict = "CONFIRMED: clear, never closer than 1.0 m, alpha and bravo at t = 0.5 s (limit 1.0 m)";
    assert_eq!(said.lines().next(), Some(verdict), "{said}");
    assert!(said.lines().skip(1).all(|line| line.starts_with("assumes  ")), "{said}");
    let text = fs::read_to_string(at("proof.json")).expect("a proof");
    fs::write(at("wrong.json"), text.replace("\"separation_m\":1.0", "\"separation_m\":1.0000001")).expect("a file");
    assert_eq!(check("wrong.json", "pass.csv").0, Some(1));
    fs::write(at("other.csv"), PASS.replace("5,1,0", "5,1.5,0")).expect("a file");
    assert_eq!(check("proof.json", "other.csv").0, Some(1));
    fs::write(at("broken.json"), &text[..text.len() / 2]).expect("a file");
    for (proof, data) in [("broken.json", "pass.csv"), ("proof.json", "none.csv"), ("pass.csv", "pass.csv")] {
        assert_eq!(check(proof, data).0, Some(2), "{proof} {data}");
    }
}

#[test]
fn the_proof_holds_the_facts_that_the_table_does_not_contain() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("pass.csv"), PASS).expect("a file");
    let arguments = ["pass.csv", "--delta", "1", "--time-unit", "s", "--offset", "bravo=0.25", "--proof", "proof.json"];
    assert_eq!(audit(folder.path(), &arguments).exit, Some(0));
    let text = fs::read_to_string(folder.path().join("proof.json")).expect("a proof");
    let proof: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&proof["format"], &proof["version"]), (&json!("tautline proof"), &json!(2)));
    let claim = &proof["claim"];
    assert_eq!(claim["limit"], json!({"kind": "distance", "distance_m": 1.0}));
    assert_eq!((&claim["status"], &claim["motion"]), (&json!("clear"), &json!("linear")));
    assert_eq!(claim["pair"], json!(["alpha", "bravo"]));
    let assumed = json!({"time_unit": "s", "max_gaps_s": {"alpha": 1.5, "bravo": 1.5}, "offsets_s": {"bravo": 0.25}});
    assert_eq!(proof["assumed"], assumed);
    let check = |options: &[&str]| {
        let ran = python(folder.path(), &checker(), &[&["proof.json", "pass.csv"], options].concat());
        (ran.status.code(), String::from_utf8_lossy(&ran.stdout).into_owned())
    };
    // The shift of a clock is a fact that the caller accepts.
    let (code, said) = check(&[]);
    assert!(code == Some(1) && said.contains("accept it with --offset NAME=SECONDS"), "{said}");
    let (code, said) = check(&["--offset", "bravo=0.25"]);
    assert!(code == Some(0) && said.contains("assumes  clock of bravo, moved by 0.25 s\n"), "{said}");
}

#[test]
fn an_export_of_a_flight_has_a_proof() {
    let folder = tempfile::tempdir().expect("a folder");
    let set = ["--set", "vehicle.model=crazyflie", "--set", "time.duration_s=1", "--no-snapshots", "--out", "flight"];
    ran_by(TAUTLINE, folder.path(), &[&["run", "pentagon"], &set[..]].concat());
    assert_eq!(ran_by(TAUTLINE, folder.path(), &["export", "flight", "-o", "flight.csv"]).exit, Some(0));
    let ran = audit(folder.path(), &["flight.csv", "--delta", "1", "--proof", "proof.json"]);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    let ran = python(folder.path(), &checker(), &["proof.json", "flight.csv"]);
    assert_eq!(ran.status.code(), Some(0), "{ran:?}");
    let header = fs::read_to_string(folder.path().join("flight.csv")).expect("a table");
    assert!(
        header.lines().next().is_some_and(|names| names.contains(",vx,") && names.contains(",qw,")),
        "{header:.80}"
    );
}

#[test]
fn recordings_without_a_proof_are_refused_with_a_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("pass.csv"), PASS).expect("a file");
    fs::write(folder.path().join("wide.csv"), "t,x1,y1,z1,x2,y2,z2\n0,0,0,0,5,0,0\n1,0,0,0,5,0,0\n").expect("a file");
    fs::write(folder.path().join("seconds.csv"), PASS.replace("t,", "t_s,")).expect("a file");
    let more: String =
        PASS.lines().enumerate().map(|(k, line)| format!("{line},{}\n", ["battery", "1"][k.min(1)])).collect();
    fs::write(folder.path().join("more.csv"), more).expect("a file");
    for (arguments, code) in [
        (&["pass.csv", "--radius", "1"][..], "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--motion", "hold"], "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--from", "0.5"], "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--scale", "2"], "audit/no-proof"),
        (&["seconds.csv", "--delta", "1", "--time-unit", "ms"], "audit/no-proof"),
        (&["more.csv", "--delta", "1"], "audit/no-proof"),
        (&["wide.csv", "--delta", "1"], "audit/no-proof"),
        (&["pass.csv", "pass.csv", "--delta", "1"], "usage/several-recordings"),
    ] {
        let ran = audit(folder.path(), &[arguments, &["--proof", "proof.json"]].concat());
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{arguments:?} {ran:?}");
        assert!(!folder.path().join("proof.json").exists());
    }
}

#[test]
fn decimals_at_the_limit_have_no_proof() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("proof.json");
    // The doubles are closer than the limit in both cases, the decimals in the second case only.
    for (other, has_proof) in [("0.6", false), ("0.59", true)] {
        let rows = |t: u8| format!("{t},a,0.1,0,0\n{t},b,{other},0,0\n");
        fs::write(folder.path().join("two.csv"), format!("t,id,x,y,z\n{}{}", rows(0), rows(1))).expect("a file");
        let ran = audit(folder.path(), &["two.csv", "--delta", "0.5", "--proof", "proof.json"]);
        assert_eq!((ran.exit, file.exists()), (Some(1), has_proof), "{ran:?}");
        assert_eq!(ran.err.contains("no proof is written: the checker computes with"), !has_proof, "{ran:?}");
    }
}
