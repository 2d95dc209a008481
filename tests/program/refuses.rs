//! Wrong input ends with exit code 2, a message that names the place and the remedy, and nothing written. A machine that
//! fails ends with exit code 3 and the name of the file. Nothing ends in a panic.

use std::fs::{self, File};
use std::path::Path;

use crate::program::{Ran, TAUTLINE, ran_by};
use tempfile::TempDir;

const BAD: Option<i32> = Some(1);
const WRONG_INPUT: Option<i32> = Some(2);

/// A minimal flight that is right: what the wrong ones below are changed from.
const RIGHT: &str = r#"name = "pair"
[start]
positions_m = [
    [0.0, 0.0],
    [4.0, 0.0],
]
[formation]
shape = "line"
spacing_m = 3.0
[law]
kind = "edge-tension"
delta_m = 2.0
[time]
duration_s = 1.0
"#;

/// Runs a scenario that is wrong; gives its message in one line after checking what all refusals have in common.
fn refused(folder: &Path, scenario: &str, more: &[&str]) -> String {
    let names = || {
        let entries = fs::read_dir(folder).expect("the folder");
        let mut names: Vec<_> = entries.map(|entry| entry.expect("an entry").file_name()).collect();
        names.sort();
        names
    };
    let before = names();
    let Ran { exit, out, err } = ran(folder, &[&["run", scenario], more].concat());
    assert_eq!((exit, out.as_str()), (WRONG_INPUT, ""), "{err}");
    assert!(!err.contains("panicked") && !err.contains("RUST_BACKTRACE"), "{err}");
    assert!(err.contains("help:"), "a remedy is named: {err}");
    assert_eq!(names(), before, "nothing is written");
    // Long lines are broken for the terminal.
    err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" ")
}

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder for the run")
}

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

#[test]
fn a_scenario_that_cannot_be_flown_is_refused_at_its_place() {
    let folder = folder();
    let line = "positions_m = [\n    [0.0, 0.0],\n    [4.0, 0.0],\n]";
    // Text of RIGHT to replace, its replacement, part of the message, line and column.
    let cases: &[(&str, &str, &str, &str)] = &[
        ("spacing_m", "spacing", "unknown key `spacing`", ":9:1"),
        ("2.0\n[time]", "\"two\"\n[time]", "expected a number", ":12:11"),
        ("    [0.0, 0.0],\n    [4.0, 0.0],\n", "", "0 vehicles cannot form a formation", ":3:15"),
        ("    [4.0, 0.0],\n", "", "1 vehicle cannot form a formation", ":3:15"),
        ("spacing_m = 3.0", "spacing_m = 2.0", "is not more than delta = 2 m", ":9:13"),
        ("[4.0, 0.0]", "[1.5, 0.0]", "vehicles 1-2 start 1.5 m apart", ":5:5"),
        ("[4.0, 0.0]", "[nan, 0.0]", "is not a number", ":5:5"),
        ("[4.0, 0.0]", "[inf, 0.0]", "is infinite", ":5:5"),
        ("[4.0, 0.0]", "[0.0, 0.0]", "vehicles 1-2 start at the same point", ":5:5"),
        ("[start]", "[swarm]\nmass_kg = -1.0\n[start]", "the mass of vehicle 1 is -1", ":3:11"),
        ("[time]", "[wind]\nmean_m_s = [1.0, 0.0]\n[time]", "points without drag, which do not feel it", ":13:1"),
        ("[time]", "[time]\ndt_s = 0.0", "the time step is 0", ":14:8"),
        ("[time]", "[time]\ndt_s = -0.1", "the time step is -0.1", ":14:8"),
        ("duration_s = 1.0", "duration_s = 0", "the duration is 0", ":14:14"),
        ("duration_s = 1.0", "duration_s = 1e12", "steps; at most", ":14:14"),
        (line, "shape = \"line\"\nspacing_m = 3\n[swarm]\ncount = 1000000", "7454.4 GiB of memory", ":6:9"),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = []\n[time]", "the graph is not connected", ":15:9"),
        ("[time]", "[time", "not TOML", ":13:6"),
    ];
    for &(from, to, said, place) in cases {
        assert!(RIGHT.contains(from), "{from}");
        fs::write(folder.path().join("wrong.toml"), RIGHT.replacen(from, to, 1)).expect("a file");
        let message = refused(folder.path(), "wrong.toml", &[]);
        assert!(message.contains(said), "{said}: {message}");
        assert!(message.contains(&format!("wrong.toml{place}]")), "{place}: {message}");
    }
}

#[test]
fn what_is_no_scenario_file_is_refused_by_name() {
    let folder = folder();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("folder.toml")).expect("a folder");
    File::create(path("large.toml")).and_then(|file| file.set_len(1 << 30)).expect("a sparse file of 1 GiB");
    fs::write(path("latin1.toml"), b"name = \"pair\"\n# caf\xe9\n").expect("a file");
    fs::write(path("picture.toml"), [0x89, b'P', b'N', b'G', 0, 1, 2, 3]).expect("a file");
    fs::write(path("empty.toml"), b"").expect("a file");
    let cases = [
        ("folder.toml", "folder.toml is a directory"),
        ("large.toml", "large.toml has more than 128 MiB"),
        ("latin1.toml", "byte 19 (from 0) is not UTF-8"),
        ("picture.toml", "is not UTF-8"),
        ("empty.toml", "is empty"),
        ("missing.toml", "cannot read missing.toml"),
        ("pentagn", "`pentagn` is neither a built-in scenario nor a file"),
        ("", "neither a built-in scenario nor a file"),
    ];
    for (name, said) in cases {
        let message = refused(folder.path(), name, &[]);
        assert!(message.contains(said) && message.contains(name), "{said}: {message}");
    }
}

#[test]
fn a_wrong_override_is_refused_at_its_place() {
    let folder = folder();
    let cases = [
        ("law.delta_n=2", "unknown key `delta_n`", "--set:1:5]"),
        ("law.delta_m=3", "a desired distance of 3 m", "--set:1:13]"),
        ("time.dt_s=nan", "the time step is not a number", "--set:1:11]"),
        ("law.delta_m", "has no `=`", "--set:1:1]"),
    ];
    for (set, said, place) in cases {
        let message = refused(folder.path(), "pentagon", &["--set", set]);
        assert!(message.contains(said) && message.contains(place), "{said}, {place}: {message}");
    }
}

#[test]
fn what_a_file_holds_does_not_steer_the_terminal() {
    let folder = folder();
    fs::write(folder.path().join("wrong.toml"), RIGHT.replacen("\"pair\"", "\"\\u001b[2J\u{1b}[2J\"", 1))
        .expect("a file");
    assert!(!refused(folder.path(), "wrong.toml", &[]).contains('\u{1b}'));
    assert!(!refused(folder.path(), "\u{1b}[2J", &[]).contains('\u{1b}'));
    assert!(!refused(folder.path(), "pentagon", &["--set", "\u{1b}[2J=1"]).contains('\u{1b}'));
}

#[cfg(unix)]
mod machine {
    use super::{File, Path, RIGHT, Ran, TAUTLINE, folder, fs, ran, ran_by};
    use tautline::mcap::McapRecording;
    use tautline::record::Event;

    const MACHINE_FAILED: Option<i32> = Some(3);

    fn assert_failed(Ran { exit, out, err }: Ran, named: &str) {
        assert_eq!((exit, out.as_str()), (MACHINE_FAILED, ""), "{err}");
        assert!(!err.contains("panicked"), "{err}");
        let message: String = err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" ");
        assert!(message.contains(named), "{named} is named: {message}");
        assert!(message.contains("help:"), "a remedy is named: {message}");
    }

    fn run_into(folder: &Path, out: &str, more: &[&str]) -> Ran {
        ran(folder, &[&["run", "--out", out], more].concat())
    }

    #[test]
    fn a_folder_that_cannot_be_written_to_is_named() {
        let folder = folder();
        fs::write(folder.path().join("file"), b"").expect("a file");
        assert_failed(run_into(folder.path(), "file", &[]), "cannot write file:");
        assert_failed(run_into(folder.path(), "file/out", &[]), "cannot write file/out:");
        assert_failed(run_into(folder.path(), "/dev/null/out", &[]), "cannot write /dev/null/out:");
        fs::create_dir_all(folder.path().join("taken/run.mcap")).expect("a folder");
        assert_failed(run_into(folder.path(), "taken", &[]), "cannot write taken/run.mcap:");
        fs::create_dir_all(folder.path().join("kept/report.json/inside")).expect("a folder");
        assert_failed(run_into(folder.path(), "kept", &["--force"]), "cannot write kept/report.json:");
        let validated = |out: &str| ran(folder.path(), &["validate", "--out", out]);
        assert_failed(validated("file"), "cannot write file:");
        assert_failed(validated("/proc"), "cannot write /proc:");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_named_with_the_file_that_did_not_fit() {
        let folder = folder();
        fs::create_dir(folder.path().join("full")).expect("a folder");
        std::os::unix::fs::symlink("/dev/full", folder.path().join("full/run.mcap")).expect("a link");
        assert_failed(run_into(folder.path(), "full", &[]), "cannot write full/run.mcap: No space left on device");
        assert!(!folder.path().join("full/report.json").exists());

        let full = File::options().write(true).open("/dev/full").expect("a full device");
        let done = std::process::Command::new(TAUTLINE).arg("schema").stdout(full).output().expect("the program");
        assert_eq!(done.status.code(), MACHINE_FAILED);
        assert!(String::from_utf8_lossy(&done.stderr).contains("cannot write to standard output: No space left"));
    }

    #[test]
    fn what_was_written_before_the_disk_was_full_can_be_read() {
        let folder = folder();
        // Blocks of 512 bytes: 1 MiB, a tenth of the recording. The limit is told as an error instead of a signal.
        let script = format!("trap '' XFSZ; ulimit -f 2048; exec '{TAUTLINE}' run --out out");
        let failed = ran_by("sh", folder.path(), &["-c", &script]);
        assert_failed(failed, "cannot write out/run.mcap:");
        assert!(!folder.path().join("out/report.json").exists(), "an unfinished run has no report");
        let recording = McapRecording::open(&folder.path().join("out/run.mcap")).expect("a recording");
        assert!(!recording.is_complete());
        let (samples, _) = recording.read_all().expect("everything up to the last chunk");
        assert!(samples.len() > 500, "{} samples", samples.len());
        assert!(samples.iter().all(|sample| sample.swarm.first_not_finite().is_none()));
    }

    #[test]
    fn a_motion_that_leaves_the_range_of_numbers_is_judged_and_keeps_its_recording() {
        let folder = folder();
        // A common velocity that grows a hundredfold every 2.3 s: no law can hold it.
        let start = "positions_m = [[0.0, 0.0], [4.0, 0.0]]\nvelocities_m_s = [[1.0, 0.0], [1.0, 0.0]]\n";
        let scenario = RIGHT
            .replacen("positions_m = [\n    [0.0, 0.0],\n    [4.0, 0.0],\n]\n", start, 1)
            .replacen("[start]", "[swarm]\na22_per_s = 2.0\n[start]", 1)
            .replacen("edge-tension", "laplacian", 1)
            .replacen("duration_s = 1.0", "duration_s = 30.0", 1);
        fs::write(folder.path().join("diverges.toml"), scenario).expect("a file");
        let said = "rounding may have moved vehicles by";
        let Ran { exit, out, err } = run_into(folder.path(), "out", &["diverges.toml"]);
        assert_eq!(exit, super::BAD, "{err}");
        assert!(
            out.contains(said) && out.contains("shorten time.duration_s") && !err.contains("panicked"),
            "{out}{err}"
        );
        let path = folder.path().join("out").join("run.mcap");
        let (samples, events) = McapRecording::open(&path).and_then(McapRecording::read_all).expect("a recording");
        assert!(samples.len() > 20, "{} samples", samples.len());
        assert!(matches!(events.last(), Some(Event::EndedEarly { reason, .. }) if reason.contains(said)), "{events:?}");
        let report = fs::read_to_string(folder.path().join("out").join("report.json")).expect("a report");
        assert!(report.contains(said) && report.contains("\"pass\": false"), "{report}");
    }
}
