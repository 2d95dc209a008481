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

/// Option of the unit of a [`recording`]: milliseconds are whole numbers, and dates have no unit.
fn unit_of(text: &str) -> &'static [&'static str] {
    let mut times =
        text.lines().skip_while(|line| !line.contains(",id,")).skip(1).filter_map(|line| line.split(',').next());
    if times.clone().any(|time| time.contains('T')) {
        &[]
    } else if times.any(|time| time.contains(['.', 'e'])) {
        &["--time-unit", "s"]
    } else {
        &["--time-unit", "ms"]
    }
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
    fs::write(at("wrong.json"), text.replace("\"smallest\":1.0", "\"smallest\":1.0000001")).expect("a file");
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
    assert_eq!((&proof["format"], &proof["version"]), (&json!("tautline proof"), &json!(3)));
    let claim = &proof["claim"];
    let limit = json!({"kind": "distance", "status": "clear", "delta_m": 1.0, "radii_m": {}, "above_m": null,
        "smallest": 1.0, "pair": ["alpha", "bravo"]});
    assert_eq!(claim["limits"], json!([limit]));
    assert_eq!((&claim["status"], &claim["motion"]), (&json!("clear"), &json!("linear")));
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

/// Obstacles of each shape around a place that no vehicle of [`recording`] comes near to, and one among them.
const OBSTACLES: &str = r#"
[[obstacle]]
name = "ball"
ball = { radius_m = 7.5 }
at_m = [3.1, -2.0, 0.7]
clearance_m = 0.5
[[obstacle]]
name = "box"
box = { size_m = [2.0, 4.0, 3.0], yaw_deg = 90.0 }
at_m = [-130.0, 4.0, 1.5]
clearance_m = 1.5
[[obstacle]]
name = "cable"
capsule = { from_m = [0.0, 0.0, 90.0], to_m = [30.0, 0.5, 91.0], radius_m = 0.05 }
[[obstacle]]
name = "ground"
half_space = { normal = [0.1, 0.0, 1.0] }
at_m = [0.0, 0.0, -140.0]
clearance_m = 0.0
"#;

const FENCE: &str = r"
[fence]
polygon_m = [[-LIMIT, -LIMIT], [LIMIT, -LIMIT], [LIMIT, LIMIT], [0, 300], [-LIMIT, LIMIT]]
height_m = [-200, 150]
margin_m = 0.5
";

#[test]
fn the_checker_confirms_each_limit_and_denies_altered_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let mut written = 0;
    fs::write(at("obstacles.toml"), OBSTACLES).expect("a file");
    for number in 0..48 {
        let mut random = Random(5000 + number);
        let (data, proof) = (format!("{number}.csv"), format!("{number}.json"));
        fs::write(at(&data), recording(number)).expect("a file");
        // Half of the limits are violated by most recordings.
        let is_hard = (number / 8) % 2 == 1;
        let [ellipsoid, radius] = if is_hard { ["9,8,20", "9"] } else { ["0.3,0.4,0.9", "1.5"] };
        let limit = format!("{:.1}", random.between(10.0, 110.0) / if is_hard { 8.0 } else { 1.0 });
        fs::write(at("fence.toml"), FENCE.replace("LIMIT", &limit)).expect("a file");
        let height = format!("{:.1}", random.between(-10.0, 40.0));
        let speeds = format!("speed={:.1},horizontal={limit},climb=9,descent=12.5", random.between(5.0, 30.0));
        let (heights, above) = (format!("height={height},floor=-{limit}"), format!("--above=-{limit}"));
        let arguments: &[&str] = match number % 8 {
            0 => &["--ellipsoid", ellipsoid],
            1 => &["--ellipsoid", "2,2.5,6", "--delta", "1.5", "--above=-3.5"],
            2 => &["--cylinder", "0.7,1.1"],
            3 => &["--cylinder", "9,12", "--above", "0"],
            4 => &["--delta", "0.2", "--obstacles", "obstacles.toml", "--max-gap", "99"],
            5 => &["--radius", radius, "--radius", "v0=0.25", &above],
            6 => &["--limit", &speeds, "--limit", &heights, "--delta", "0.1", "--max-gap", "99"],
            _ => &["--fence", "fence.toml", "--max-gap", "99"],
        };
        let unit = unit_of(&recording(number));
        let ran = audit(folder.path(), &[&[&data, "--proof", &proof], unit, arguments].concat());
        assert!(matches!(ran.exit, Some(0 | 1)), "{number}: {ran:?}");
        written += usize::from(at(&proof).exists());
        assert!(at(&proof).exists() || ran.err.contains("no proof is written: the verdict is undecided"), "{ran:?}");
    }
    fs::remove_file(at("obstacles.toml")).expect("a file");
    let driver = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/proofs.py");
    let ran = python(folder.path(), &driver, &[checker().to_str().expect("a path"), "."]);
    let out = String::from_utf8_lossy(&ran.stdout);
    assert!(ran.status.success() && out.starts_with(&format!("{written} confirmed, ")), "{ran:?}");
    for kind in ["distance", "ellipsoid", "cylinder", "obstacles", "speed", "height", "fence"] {
        for status in ["clear", "violation"] {
            assert!(out.contains(&format!("{kind} {status}")), "{kind} {status}: {out}");
        }
    }
}

#[test]
fn a_flight_with_each_step_has_a_proof() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let fly = |rate: &str, name: &str| {
        let rate = format!("time.record_hz={rate}");
        let set = ["--set", &rate, "--set", "time.duration_s=2", "--no-snapshots", "--force", "--out", name];
        ran_by(TAUTLINE, folder.path(), &[&["run", "pentagon"], &set[..]].concat());
    };
    fly("240", "every");
    fly("60", "coarse");
    let check = |proof: &str, data: &str| {
        let ran = python(folder.path(), &checker(), &[proof, data]);
        (ran.status.code(), String::from_utf8_lossy(&ran.stdout).into_owned())
    };
    let limits = ["--limit", "speed=9", "--proof", "every.json"];
    let ran = audit(folder.path(), &[&["every"], &limits[..]].concat());
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    let (code, said) = check("every.json", "every/run.mcap");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.starts_with("CONFIRMED: clear, all 2 limits kept\n"), "{said}");
    assert!(said.contains("assumes  samples: 481 samples, of successive steps of the run\n"), "{said}");
    // A single changed bit, the end cut off, and the recording of another flight.
    let bytes = fs::read(at("every/run.mcap")).expect("a recording");
    for (name, content) in [
        ("bit.mcap", [&bytes[..9000], &[bytes[9000] ^ 1], &bytes[9001..]].concat()),
        ("cut.mcap", bytes[..bytes.len() / 2].to_vec()),
        ("other.mcap", fs::read(at("coarse/run.mcap")).expect("a recording")),
    ] {
        fs::write(at(name), &content).expect("a file");
        let (code, said) = check("every.json", name);
        assert!(code == Some(1) && said.contains("its SHA-256 differs"), "{name}: {said}");
        // A recording with other samples is not confirmed with its own hash.
        if name == "bit.mcap" {
            continue;
        }
        let text = fs::read_to_string(at("every.json")).expect("a proof");
        let hash = |bytes: &[u8]| tautline::record::sha256_hex(bytes);
        fs::write(at("forged.json"), text.replace(&hash(&bytes), &hash(&content))).expect("a file");
        assert_ne!(check("forged.json", name).0, Some(0), "{name}");
    }
    // Between the samples of a recording without each step, the motion is an assumption.
    let ran = audit(folder.path(), &["coarse", "--proof", "coarse.json"]);
    assert_eq!((ran.exit, ran.code()), (Some(2), "audit/no-proof"), "{ran:?}");
    assert!(ran.err.contains("fly with a `time.record_hz` of at least"), "{ran:?}");
    let ran = audit(folder.path(), &["coarse", "--motion", "linear", "--proof", "coarse.json"]);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    let (code, said) = check("coarse.json", "coarse/run.mcap");
    assert!(code == Some(0) && said.contains("samples: 121 samples, not of each step\n"), "{said}");
    let ran = audit(folder.path(), &["every", "--scale", "2", "--delta", "1", "--proof", "scaled.json"]);
    assert_eq!((ran.exit, ran.code()), (Some(2), "audit/no-proof"), "{ran:?}");
}

#[test]
fn curves_have_a_proof() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    let run = ["run", "crazyflies", "--out", "flight", "--no-snapshots", "--quiet"];
    assert_eq!(ran_by(TAUTLINE, folder.path(), &run).exit, Some(0));
    let export = ["export", "flight", "--format", "crazyflie", "-o", "polynomials", "--delta", "0.4"];
    assert_eq!(ran_by(TAUTLINE, folder.path(), &export).exit, Some(0));
    fs::create_dir(at("bezier")).expect("a folder");
    for (name, y) in [("a", 0.0), ("b", 0.75)] {
        let row = |x: f64| format!("1.5,{x},{y},1,{x},{},1,{},{y},1.25\n", y + 0.1, -x);
        fs::write(
            at(&format!("bezier/{name}.csv")),
            format!("duration,p0x,p0y,p0z,p1x,p1y,p1z,p2x,p2y,p2z\n{}{}", row(y - 3.0), row(3.0 - y)),
        )
        .expect("a file");
    }
    for (data, delta, name) in
        [("polynomials", "0.4", "kept"), ("polynomials", "0.6", "violated"), ("bezier", "0.5", "b")]
    {
        let json = format!("{name}.json");
        fs::create_dir(at(name)).expect("a folder");
        for file in fs::read_dir(at(data)).expect("a folder") {
            let file = file.expect("a file").path();
            fs::copy(&file, at(name).join(file.file_name().expect("a name"))).expect("a copy");
        }
        let ran = audit(folder.path(), &[name, "--delta", delta, "--proof", &json]);
        assert_eq!(ran.exit, Some(i32::from(name == "violated")), "{ran:?}");
        assert!(at(&json).exists(), "{ran:?}");
    }
    for (arguments, part) in
        [(["--limit", "speed=9"], "limit"), (["--above", "1"], "above"), (["--cylinder", "1,1"], "cylinder")]
    {
        let delta: &[&str] = if part == "cylinder" { &[] } else { &["--delta", "0.4"] };
        let ran = audit(folder.path(), &[&["kept", "--proof", "none.json"], &arguments[..], delta].concat());
        assert_eq!((ran.exit, ran.code()), (Some(2), "audit/no-proof"), "{ran:?}");
        assert!(ran.err.contains(&format!("--{part} for curves")), "{ran:?}");
    }
    for name in ["flight", "polynomials", "bezier"] {
        fs::remove_dir_all(at(name)).expect("a folder");
    }
    let driver = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/proofs.py");
    let ran = python(folder.path(), &driver, &[checker().to_str().expect("a path"), "."]);
    let out = String::from_utf8_lossy(&ran.stdout);
    assert!(ran.status.success() && out.starts_with("3 confirmed, "), "{ran:?}");
}

#[test]
fn recordings_without_a_proof_are_refused_with_a_remedy() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name);
    fs::write(at("pass.csv"), PASS).expect("a file");
    fs::write(at("wide.csv"), "t,x1,y1,z1,x2,y2,z2\n0,0,0,0,5,0,0\n1,0,0,0,5,0,0\n").expect("a file");
    fs::write(at("seconds.csv"), PASS.replace("t,", "t_s,")).expect("a file");
    let more: String =
        PASS.lines().enumerate().map(|(k, line)| format!("{line},{}\n", ["battery", "1"][k.min(1)])).collect();
    fs::write(at("more.csv"), more).expect("a file");
    let ball = "[[obstacle]]\nname = \"o\"\nball = { radius_m = 1.0 }\n";
    fs::write(at("moving.toml"), format!("{ball}path = [[0, 0, 90, 0], [1, 9, 90, 0]]\n")).expect("a file");
    fs::write(at("rest.toml"), format!("{ball}at_m = [0, 90, 0]\n")).expect("a file");
    let turned = "box = { size_m = [1, 1, 1], yaw_deg = 30.0 }\nat_m = [0, 90, 0]\n";
    fs::write(at("turned.toml"), format!("[[obstacle]]\nname = \"o\"\n{turned}")).expect("a file");
    for (arguments, part, code) in [
        (&["pass.csv", "--delta", "1", "--motion", "hold"][..], "motion that is neither", "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--from", "0.5"], "--from", "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--ids", "alpha,bravo"], "--ids", "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--scale", "2"], "table with the columns", "audit/no-proof"),
        (&["seconds.csv", "--delta", "1", "--time-unit", "ms"], "another unit", "audit/no-proof"),
        (&["more.csv", "--delta", "1"], "table with the columns", "audit/no-proof"),
        (&["wide.csv", "--delta", "1"], "table with the columns", "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--limit", "accel=9"], "--limit accel", "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--limit", "navigation-floor=0"], "--limit navigation-floor", "audit/no-proof"),
        (&["pass.csv", "--well-clear", "5,5,0"], "--well-clear", "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--plan", "wide.csv"], "--plan", "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--obstacles", "moving.toml"], "`o`, which moves", "audit/no-proof"),
        (&["pass.csv", "--delta", "1", "--obstacles", "turned.toml"], "`o`, a box with a yaw", "audit/no-proof"),
        (
            &["pass.csv", "--radius", "alpha=1", "--radius", "bravo=0", "--obstacles", "rest.toml"],
            "`o`, whose clearance",
            "audit/no-proof",
        ),
        (
            &["pass.csv", "--delta", "1", "--above", "0", "--land-on", "o", "--obstacles", "rest.toml"],
            "--land-on",
            "audit/no-proof",
        ),
        (&["pass.csv", "pass.csv", "--delta", "1"], "one recording only", "usage/several-recordings"),
    ] {
        let ran = audit(folder.path(), &[arguments, &["--proof", "proof.json"]].concat());
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{arguments:?} {ran:?}");
        assert!(ran.err.contains(part), "{arguments:?}: {ran:?}");
        assert!(!at("proof.json").exists());
    }
}

#[test]
fn a_limit_that_the_tolerance_of_the_audit_keeps_has_no_proof() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("proof.json");
    fs::write(folder.path().join("pass.csv"), PASS).expect("a file");
    // The vehicles fly at 10 m/s.
    for (limit, exit, has_proof) in [("speed=10", 0, true), ("speed=9.9999999999", 0, false), ("speed=9.99", 1, true)] {
        let ran = audit(folder.path(), &["pass.csv", "--time-unit", "s", "--limit", limit, "--proof", "proof.json"]);
        assert_eq!((ran.exit, file.exists()), (Some(exit), has_proof), "{limit}: {ran:?}");
        assert_eq!(ran.err.contains("beyond its limit by less than the audit's tolerance"), !has_proof, "{ran:?}");
        if has_proof {
            assert_eq!(python(folder.path(), &checker(), &["proof.json", "pass.csv"]).status.code(), Some(0));
            fs::remove_file(&file).expect("a proof");
        }
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
