//! `tautline export` as a process.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::program::{PATIENCE, Ran, TAUTLINE, ran_by};
use crate::report::{at, least, motion};

const LONG: &str = "t,id,x,y,z\n0,1,1,2,3\n0,2,4,5,6\n0.5,1,1,2,3.5\n0.5,2,4,5,6\n";
const CURVE: &str = "duration,x^0,x^1,y^0,y^1,z^0,z^1\n1,0,1,0,0,1,0\n";

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("flight.csv"), LONG).expect("written");
    fs::write(folder.path().join("cf1.csv"), CURVE).expect("written");
    folder
}

/// Returns the output without the line breaks that depend on the width of the terminal.
fn said(ran: &Ran) -> String {
    let words = |text: &str| text.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
    words(&ran.out) + " " + &words(&ran.err)
}

#[test]
fn a_recording_survives_every_format() {
    let folder = folder();
    for (from, to) in [
        ("flight.csv", "1.npz"),
        ("1.npz", "2.parquet"),
        ("2.parquet", "3.mcap"),
        ("3.mcap", "4.csv"),
        ("4.csv", "5.csv"),
    ] {
        let done = ran(folder.path(), &["export", from, "-o", to]);
        assert_eq!(done.exit, Some(0), "{from} to {to}: {}", said(&done));
        assert!(said(&done).contains(&format!("wrote {to}: 4 samples of 2 vehicles")), "{}", said(&done));
    }
    let text = |name: &str| fs::read_to_string(folder.path().join(name)).expect("read");
    assert_eq!(text("4.csv"), text("5.csv"));
    assert_eq!(text("5.csv").lines().nth(3), Some("0.5,1,1.0,2.0,3.5"));
}

#[test]
fn a_file_that_exists_is_overwritten_only_by_force() {
    let folder = folder();
    let again = |more: &[&str]| ran(folder.path(), &[&["export", "flight.csv", "-o", "cf1.csv"], more].concat());
    let refused = again(&[]);
    assert_eq!(refused.exit, Some(2));
    assert!(said(&refused).contains("--force"), "{}", said(&refused));
    assert_eq!(fs::read_to_string(folder.path().join("cf1.csv")).expect("read"), CURVE);
    assert_eq!(again(&["--force", "--quiet"]).out, "");
    let itself = ran(folder.path(), &["export", "flight.csv", "-o", "./flight.csv", "--force"]);
    assert_eq!(itself.exit, Some(2), "{}", said(&itself));
    assert!(said(&itself).contains("would overwrite the recording"), "{}", said(&itself));
    assert_eq!(fs::read_to_string(folder.path().join("flight.csv")).expect("read"), LONG);
    assert!(fs::read_to_string(folder.path().join("cf1.csv")).expect("read").starts_with("t_s,id,x,y,z"));
}

/// `/dev/full` refuses every write.
#[cfg(target_os = "linux")]
#[test]
fn a_write_error_is_reported_once() {
    let folder = folder();
    for format in ["csv", "parquet", "npz", "mcap"] {
        let failed = ran(folder.path(), &["export", "flight.csv", "-o", "/dev/full", "--format", format, "--force"]);
        assert_eq!(failed.exit, Some(3), "{format}: {}", said(&failed));
        assert!(failed.err.contains("No space left on device"), "{format}: {}", said(&failed));
        assert!(!said(&failed).contains("ZipWriter"), "{format}: {}", said(&failed));
    }
}

#[test]
fn curves_need_a_rate() {
    let folder = folder();
    let refused = ran(folder.path(), &["export", "cf1.csv", "-o", "out.csv"]);
    assert_eq!(refused.exit, Some(2));
    assert!(said(&refused).contains("--sample-hz"), "{}", said(&refused));
    assert!(!folder.path().join("out.csv").exists());
    let done = ran(folder.path(), &["export", "cf1.csv", "-o", "out.csv", "--sample-hz", "2"]);
    assert_eq!(done.exit, Some(0), "{}", said(&done));
    assert!(said(&done).contains("lost"), "{}", said(&done));
}

#[test]
fn wrong_input_ends_with_2_and_leaves_no_file() {
    let folder = folder();
    fs::write(folder.path().join("wrong.csv"), LONG.replace("3.5", "three")).expect("written");
    for (arguments, words) in [
        (vec!["wrong.csv", "-o", "out.npz"], ["wrong.csv, line 4", "`three`"]),
        (vec!["missing.csv", "-o", "out.npz"], ["missing.csv", "check the path"]),
        (vec!["flight.csv", "-o", "out"], ["has no extension of a known format", "--format"]),
        (vec!["flight.csv", "-o", "out.npz", "--scale", "-1"], ["--scale", "positive"]),
        (vec!["flight.csv", "-o", "out.npz", "--column", "w=x"], ["unknown role `w`", "radius"]),
        (vec!["flight.csv", "-o", "out.npz", "--input-format", "mcap"], ["not an MCAP file", "omit --input-format"]),
    ] {
        let refused = ran(folder.path(), &[vec!["export"], arguments.clone()].concat());
        assert_eq!(refused.exit, Some(2), "{arguments:?}: {}", said(&refused));
        for word in words {
            assert!(said(&refused).contains(word), "{arguments:?}: {}\ninstead of {word}", said(&refused));
        }
        let names: Vec<_> =
            fs::read_dir(folder.path()).expect("a folder").map(|e| e.expect("one").file_name()).collect();
        assert_eq!(names.len(), 3, "{names:?}");
    }
}

#[test]
#[cfg(unix)]
fn an_export_that_is_interrupted_leaves_no_file() {
    /// Number of rows that take seconds to export.
    const ROWS: u32 = 400_000;
    let folder = folder();
    let rows: Vec<_> = (0..ROWS).map(|k| format!("{k},a,{k}.25,2,3\n")).collect();
    fs::write(folder.path().join("long.csv"), format!("t_s,id,x,y,z\n{}", rows.concat())).expect("written");
    let names = || -> Vec<String> {
        let entries = fs::read_dir(folder.path()).expect("a folder");
        entries.map(|entry| entry.expect("one").file_name().to_string_lossy().into_owned()).collect()
    };
    let mut child = Command::new(TAUTLINE)
        .args(["export", "long.csv", "-o", "out.npz"])
        .current_dir(folder.path())
        .stderr(Stdio::piped())
        .spawn()
        .expect("started");
    let began = Instant::now();
    while !names().iter().any(|name| name.ends_with(".partial")) {
        assert!(child.try_wait().expect("a child").is_none(), "it ended before it could be interrupted");
        assert!(began.elapsed() < PATIENCE, "the export does not begin to write: {:?}", names());
        std::thread::sleep(Duration::from_millis(2));
    }
    assert!(Command::new("kill").args(["-s", "INT", &child.id().to_string()]).status().expect("kill").success());
    let ended = child.wait_with_output().expect("an end");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!(ended.status.code(), Some(130), "{said}");
    assert!(said.contains("interrupted: `out.npz` was not written"), "{said}");
    assert_eq!(names().len(), 3, "{:?}", names());
}

#[test]
fn a_missing_folder_is_wrong_input() {
    let folder = folder();
    let failed = ran(folder.path(), &["export", "flight.csv", "-o", "missing/out.npz"]);
    assert_eq!(failed.exit, Some(2), "{}", said(&failed));
    assert!(
        said(&failed).contains("missing/out.npz: cannot write the file: missing does not exist"),
        "{}",
        said(&failed)
    );
}

#[test]
fn a_table_with_contradictory_pages_is_an_error_without_a_panic() {
    let folder = folder();
    let path = folder.path().join("flight.parquet");
    assert_eq!(ran(folder.path(), &["export", "flight.csv", "-o", "flight.parquet"]).exit, Some(0));
    let mut bytes = fs::read(&path).expect("read");
    // The first page is a dictionary. Labelled as an index it is skipped, and the pages that need it are invalid.
    assert_eq!(bytes[4..6], [0x15, 0x04]);
    bytes[5] = 0x02;
    fs::write(&path, bytes).expect("written");
    let refused = ran(folder.path(), &["export", "flight.parquet", "-o", "out.csv"]);
    assert_eq!(refused.exit, Some(2), "{}", said(&refused));
    assert!(said(&refused).contains("flight.parquet") && said(&refused).contains("damaged"), "{}", said(&refused));
    assert!(!said(&refused).contains("panicked"), "{}", said(&refused));
}

#[test]
fn attitudes_are_exported_and_the_file_has_the_verdict_of_the_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = ["run", "crazyflies", "--set", "time.duration_s=2.5", "--no-snapshots", "--no-figures", "--out", "flown"];
    assert_eq!(ran(folder.path(), &run).exit, Some(1), "it is not in formation yet");
    let verdict = |file: &str| {
        let judged = ran(folder.path(), &["audit", file, "--delta", "0.5", "--json"]);
        assert_eq!(judged.exit, Some(1), "{file}: {}", said(&judged));
        serde_json::from_str::<serde_json::Value>(&judged.out).expect("JSON")
    };
    let same = |one: &serde_json::Value, other: &serde_json::Value, paths: &[&str]| {
        for path in paths {
            assert_eq!(at(one, path), at(other, path), "{path}");
        }
    };
    let of_the_run = verdict("flown/run.mcap");
    for extension in ["csv", "parquet", "npz", "mcap"] {
        let file = format!("flown.{extension}");
        let done = ran(folder.path(), &["export", "flown/run.mcap", "-o", &file]);
        assert_eq!(done.exit, Some(0), "{}", said(&done));
    }
    let table = fs::read_to_string(folder.path().join("flown.csv")).expect("a table");
    let header = table.lines().next().expect("a header");
    assert_eq!(header, "t_s,id,x,y,z,vx,vy,vz,qw,qx,qy,qz,thrust_1_n,thrust_2_n,thrust_3_n,thrust_4_n");
    let first = verdict("flown.csv");
    for extension in ["parquet", "npz", "mcap"] {
        let other = verdict(&format!("flown.{extension}"));
        same(&other, &first, &["/vehicles", "/status", "/proved", "/answers"]);
        assert_eq!(motion(&other), motion(&first), "{extension}");
    }
    same(&of_the_run, &first, &["/vehicles", "/status"]);
    assert_eq!(first["vehicles"], serde_json::json!(["1", "2", "3", "4", "5"]));
    assert!((least(&first) - least(&of_the_run)).abs() < 1e-4, "the run saw the steps between its samples too");
}
