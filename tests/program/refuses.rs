//! Refusals: wrong input exits with 2, place and remedy, and writes nothing. A failure of the machine exits with 3 and
//! the name of the file. No failure is a panic.

use std::fs::{self, File};
use std::path::Path;

use crate::program::{Ran, TAUTLINE, ran_by};
use tempfile::TempDir;

const BAD: Option<i32> = Some(1);
const WRONG_INPUT: Option<i32> = Some(2);

/// A minimal valid flight, from which the wrong ones below are derived.
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

/// Runs a wrong scenario, checks what all refusals have in common, and returns the code and the message in one line.
fn refused(folder: &Path, scenario: &str, more: &[&str]) -> (String, String) {
    let names = || {
        let entries = fs::read_dir(folder).expect("the folder");
        let mut names: Vec<_> = entries.map(|entry| entry.expect("an entry").file_name()).collect();
        names.sort();
        names
    };
    let before = names();
    let ran = ran(folder, &[&["run", scenario], more].concat());
    let code = ran.code().to_owned();
    let Ran { exit, out, err } = ran;
    assert_eq!((exit, out.as_str()), (WRONG_INPUT, ""), "{err}");
    assert!(!err.contains("panicked") && !err.contains("RUST_BACKTRACE"), "{err}");
    assert!(err.contains("help:"), "a remedy is named: {err}");
    assert_eq!(names(), before, "nothing is written");
    // The frame of the excerpt is left out.
    (code, err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" "))
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
    // Text of RIGHT to replace, its replacement, the code, line and column.
    for (from, to, code, place) in [
        ("[time]", "[time", "scenario/syntax", ":13:6"),
        ("spacing_m", "spacing", "scenario/unknown-key", ":9:1"),
        ("[4.0, 0.0]", "[1.5, 0.0]", "scenario/within-delta", ":5:5"),
    ] {
        assert!(RIGHT.contains(from), "{from}");
        fs::write(folder.path().join("wrong.toml"), RIGHT.replacen(from, to, 1)).expect("a file");
        let (found, message) = refused(folder.path(), "wrong.toml", &[]);
        assert_eq!(found, code, "{message}");
        assert!(message.contains(&format!("--> wrong.toml{place} ")), "{place}: {message}");
    }
}

#[test]
fn a_file_that_is_no_scenario_is_refused_by_name() {
    let folder = folder();
    fs::create_dir(folder.path().join("folder.toml")).expect("a folder");
    fs::write(folder.path().join("empty.toml"), b"").expect("a file");
    for (name, code) in [
        ("folder.toml", "scenario/cannot-read"),
        ("empty.toml", "scenario/empty"),
        ("missing.toml", "scenario/not-found"),
        ("pentagn", "scenario/not-found"),
        ("", "scenario/not-found"),
    ] {
        let (found, message) = refused(folder.path(), name, &[]);
        assert_eq!(found, code, "{message}");
        assert!(message.contains(name), "{name}: {message}");
    }
}

#[test]
fn a_wrong_override_is_refused_at_its_place() {
    let folder = folder();
    for (set, code, place) in [
        ("law.delta_n=2", "scenario/unknown-key", "--> --set:1:5 "),
        ("law.delta_m", "scenario/override", "--> --set:1:1 "),
    ] {
        let (found, message) = refused(folder.path(), "pentagon", &["--set", set]);
        assert_eq!(found, code, "{message}");
        assert!(message.contains(place), "{place}: {message}");
    }
}

#[test]
fn an_error_that_an_override_causes_is_placed_in_the_override() {
    let folder = folder();
    fs::write(folder.path().join("wrong.toml"), RIGHT.replacen("delta_m", "delta_n", 1)).expect("a file");
    let two = include_str!("../../assets/pentagon.toml").replacen("duration_s = ", "duration_s = -", 1);
    let two = two.replacen("delta_m = ", "delta_m = -", 1);
    fs::write(folder.path().join("two.toml"), two).expect("a file");
    for (scenario, set, place) in [
        ("pentagon", "formation.shape=svg", "--set:1:"),
        ("pentagon", "swarm.count=1", "--set:1:"),
        ("pentagon", "law.kind=nothing", "--set:1:"),
        ("swap", "formation.shape=text", "--set:1:"),
        // Negative twin: the error is in the file without the override, too.
        ("wrong.toml", "time.duration_s=7", "wrong.toml:"),
        // The override repairs the first of two errors; the second one is in the file.
        ("two.toml", "law.delta_m=1.5", "two.toml:"),
    ] {
        let harmless = ["--set", "time.max_rate_dt=0.1", "--set", set, "--set", "start.seed=3"];
        let (_, message) = refused(folder.path(), scenario, &harmless);
        assert!(message.contains(&format!("--> {place}")), "{scenario} {set}: {message}");
    }
}

#[test]
fn control_characters_of_a_file_are_escaped() {
    let folder = folder();
    fs::write(folder.path().join("wrong.toml"), RIGHT.replacen("\"pair\"", "\"\\u001b[2J\u{1b}[2J\"", 1))
        .expect("a file");
    assert!(!refused(folder.path(), "wrong.toml", &[]).1.contains('\u{1b}'));
    assert!(!refused(folder.path(), "\u{1b}[2J", &[]).1.contains('\u{1b}'));
    assert!(!refused(folder.path(), "pentagon", &["--set", "\u{1b}[2J=1"]).1.contains('\u{1b}'));
}

#[cfg(unix)]
mod machine {
    use super::{File, Path, RIGHT, Ran, TAUTLINE, folder, fs, ran, ran_by};
    use tautline::mcap::McapRecording;
    use tautline::record::Event;

    const MACHINE_FAILED: Option<i32> = Some(3);

    fn assert_failed(ran: Ran, named: &str) {
        assert_eq!(ran.code(), "files/cannot-write", "{}", ran.err);
        let Ran { exit, out, err } = ran;
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
        let validated = |out: &str| ran(folder.path(), &["validate", "--out", out]);
        for refused in [run_into(folder.path(), "file", &[]), validated("file")] {
            assert_eq!((refused.exit, refused.code()), (Some(2), "files/no-folder"), "{}", refused.err);
        }
        assert_failed(run_into(folder.path(), "file/out", &[]), "cannot write file/out:");
        assert_failed(run_into(folder.path(), "/dev/null/out", &[]), "cannot write /dev/null/out:");
        fs::create_dir_all(folder.path().join("taken/run.mcap")).expect("a folder");
        assert_failed(run_into(folder.path(), "taken", &[]), "cannot write taken/run.mcap:");
        fs::create_dir_all(folder.path().join("kept/report.json/inside")).expect("a folder");
        assert_failed(run_into(folder.path(), "kept", &["--force"]), "cannot write kept/report.json:");
        assert_failed(validated("/proc"), "cannot write /proc:");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_reported_with_the_file() {
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
    fn a_recording_up_to_a_full_disk_can_be_read() {
        let folder = folder();
        // Blocks of 512 bytes: 1 MiB, a tenth of the recording. The limit is reported as an error instead of a signal.
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
    fn an_overflowing_motion_is_judged_and_recorded() {
        let folder = folder();
        // A common velocity that grows a hundredfold every 2.3 s, which no law can stop.
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
