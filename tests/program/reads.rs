//! Recordings that are not plain files, unusual names, and errors inside a recording.

use std::fs;

use assert_cmd::Command;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{facts, least, motion};

fn audit(text: &str, arguments: &[&str]) -> Ran {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("flight.csv"), text).expect("written");
    ran_by(TAUTLINE, folder.path(), &[&["audit", "flight.csv", "--delta", "1"], arguments].concat())
}

#[test]
#[cfg(target_os = "linux")]
fn a_pipe_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let lines: Vec<_> = (0..20_000).map(|k| format!("{k} 0 0 0 {} 0 0\n", if k == 9 { 0.5 } else { 5.0 })).collect();
    let text = lines.concat();
    fs::write(folder.path().join("flight.txt"), &text).expect("written");
    let ran = |arguments: &[&str], input: &str| {
        let mut command = Command::new(TAUTLINE);
        let done = command.args(arguments).current_dir(folder.path()).write_stdin(input).output().expect("ran");
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    assert_eq!(ran(&["audit", "flight.txt", "--delta", "1", "--dimensions", "3"], "").0, Some(1));
    for arguments in [&["audit", "/dev/stdin", "--delta", "1"][..], &["export", "/dev/stdin", "-o", "out.npz"]] {
        let (exit, said) = ran(arguments, &text);
        assert_eq!(exit, Some(2), "{said}");
        assert!(said.contains("pipe") && said.contains("file first"), "{said}");
        assert!(!folder.path().join("out.npz").exists());
    }
}

/// Vehicles `a,b`, `c` and `d` in a row, 2 m and 0.5 m apart.
const NAMES: &str = "t,id,x,y,z\n0,\"a,b\",0,0,0\n0,c,2,0,0\n0,d,2.5,0,0\n";

#[test]
fn a_name_with_a_comma_is_quoted() {
    for (arguments, exit) in [
        (&[][..], 1),
        (&["--ids", "\"a,b\",c"], 0),
        (&["--ids", "\"a,b\"", "--ids", "c"], 0),
        (&["--ids", "c,d"], 1),
        (&["--ids", "c", "--ids", "d"], 1),
        (&["--ids", "a,b"], 2),
        (&["--ids", ""], 2),
    ] {
        let ran = audit(NAMES, arguments);
        assert_eq!(ran.exit, Some(exit), "{arguments:?}: {ran:?}");
    }
}

#[test]
fn control_characters_in_names_are_escaped() {
    let names = NAMES.replace(",c,", ",\u{1b}[31mc,");
    for arguments in [&[][..], &["--ids", "nobody"]] {
        let ran = audit(&names, arguments);
        let said = ran.out + &ran.err;
        assert!(said.contains("[31mc"), "{said}");
        assert!(!said.contains('\u{1b}'), "{said:?}");
    }
}

#[test]
fn errors_inside_a_recording_name_its_file() {
    let ran = audit("t,id,x,y,z,radius\n0,a,0,0,0,0.1\n1,a,0,0,0,0.2\n", &[]);
    assert_eq!(ran.exit, Some(2), "{ran:?}");
    assert!(ran.err.contains("flight.csv: vehicle a at 1.0 s"), "{}", ran.err);
}

/// Returns a bag of `crates/recordings/tests/recordings`: two robots 2 m apart, with drifting odometry.
fn bag(name: &str) -> String {
    format!("{}/crates/recordings/tests/recordings/bags/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn positions_by_interpolated_transforms_are_not_proved() {
    let folder = tempfile::tempdir().expect("a folder");
    let ran = |name: &str, arguments: &[&str]| {
        let bag = bag(name);
        ran_by(
            TAUTLINE,
            folder.path(),
            &[&["audit", bag.as_str(), "--delta", "1", "--frame", "map"], arguments].concat(),
        )
    };
    let bounded = ["--motion", "bounded", "--max-accel", "1"];
    let exact = ran("robots_exact", &bounded);
    assert!(exact.exit == Some(0) && exact.out.starts_with("PROVED CLEAR"), "{exact:?}");
    let guessed = ran("robots", &bounded);
    let if_so = "CLEAR if accelerations of at most 1.0 m/s^2, transforms uniform between their samples: ";
    assert!(guessed.exit == Some(0) && guessed.out.starts_with(if_so), "{guessed:?}");
    assert!(guessed.err.contains("10 by transforms at their time, 32 by interpolation"), "{guessed:?}");
    let json: serde_json::Value = serde_json::from_str(&ran("robots", &["--json"]).out).expect("a report");
    assert_eq!((&json["proved"], motion(&json)), (&false.into(), "straight"));
    assert_eq!(facts(&json, "uniform-transforms").len(), 1, "{}", json["facts"]);
    assert_eq!(json["vehicles"], serde_json::json!(["r1/base_link", "r2/base_link"]));
    let refused = ran_by(TAUTLINE, folder.path(), &["audit", &bag("robots"), "--delta", "1"]);
    assert_eq!((refused.exit, refused.code()), (Some(2), "recording/several-frames"), "{refused:?}");
}

#[test]
fn exports_of_bags_and_geographic_positions_have_the_same_verdict() {
    let folder = tempfile::tempdir().expect("a folder");
    let gps = "t_s,id,lat,lon,alt\n0,a,47,8,400\n0,b,47.0001,8,400\n1,a,47,8,401\n1,b,47.0001,8,401\n";
    fs::write(folder.path().join("gps.csv"), gps).expect("written");
    let split = bag("split");
    let lost = "the file does not contain: transforms uniform between their samples";
    let robots = bag("robots");
    for (recording, options, said) in [
        (split.as_str(), &[][..], ""),
        ("gps.csv", &["--origin", "47,8,390"], "--origin 47.0,8.0,390.0"),
        (robots.as_str(), &["--frame", "map"], lost),
    ] {
        let exported = ["export", recording, "-o", "out.csv", "--force"];
        let ran = ran_by(TAUTLINE, folder.path(), &[&exported[..], options].concat());
        assert!(ran.exit == Some(0) && ran.err.contains(said), "{ran:?}");
        let distance = |path: &str, options: &[&str]| {
            let asked = ["audit", path, "--delta", "0.1", "--json", "--quiet"];
            let ran = ran_by(TAUTLINE, folder.path(), &[&asked[..], options].concat());
            let json: serde_json::Value = serde_json::from_str(&ran.out).expect("a report");
            least(&json)
        };
        assert_eq!(distance("out.csv", &[]), distance(recording, options));
    }
    let wrong = ran_by(TAUTLINE, folder.path(), &["audit", "gps.csv", "--delta", "1", "--origin", "95,8,0"]);
    assert_eq!(wrong.exit, Some(2), "{wrong:?}");
}
