//! Interrupted runs: a killed run keeps its recording up to the last flushed chunk. A run that is asked to stop keeps
//! its whole recording and writes a report.
#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{SEPARATION, at, part, reason, status};
use serde_json::Value;
use tautline::mcap::McapRecording;
use tautline::record::{Event, OwnedSample};
use tempfile::TempDir;

/// With negative a22 a swarm at rest stays at rest; with a22 > 0 rounding would move it within hundreds of seconds.
const DRAG: &str = "swarm.a22_per_s=-0.1";
/// Longer than any test: 240 million steps.
const FOREVER: &str = "time.duration_s=1e6";
/// Size of tens of chunks.
const GROWN_BYTES: u64 = 1 << 20;
const PATIENCE: Duration = Duration::from_mins(2);

/// Running process, killed when dropped, so that a failed test leaves none behind.
struct Underway {
    child: Option<Child>,
    folder: TempDir,
}

impl Underway {
    /// Starts a run that does not end and waits until its recording has grown.
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder for the run");
        let child = Command::new(TAUTLINE)
            .args([
                "run",
                "--json",
                "--quiet",
                "--out",
                "out",
                "--set",
                DRAG,
                "--set",
                FOREVER,
                "--set",
                "time.record_hz=60",
            ])
            .current_dir(folder.path())
            .env("XDG_RUNTIME_DIR", folder.path())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program");
        let underway = Self { child: Some(child), folder };
        let began = Instant::now();
        while fs::metadata(underway.recording()).map_or(0, |file| file.len()) < GROWN_BYTES {
            assert!(began.elapsed() < PATIENCE, "the recording does not grow");
            std::thread::sleep(Duration::from_millis(10));
        }
        underway
    }

    fn recording(&self) -> PathBuf {
        self.folder.path().join("out/run.mcap")
    }

    fn report(&self) -> PathBuf {
        self.folder.path().join("out/report.json")
    }

    /// Sends a signal and waits for the end.
    fn end_by(&mut self, signal: &str) -> Output {
        let child = self.child.take().expect("a run under way");
        let sent = Command::new("kill").args(["-s", signal, &child.id().to_string()]).status();
        assert!(sent.expect("kill").success());
        child.wait_with_output().expect("an end")
    }
}

impl Drop for Underway {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill().and_then(|()| child.wait());
        }
    }
}

/// Flies to the end, into a folder.
fn flown(folder: &Path, out: &str, duration_s: u32) -> Ran {
    let duration = format!("time.duration_s={duration_s}");
    ran_by(TAUTLINE, folder, &["run", "--quiet", "--out", out, "--set", DRAG, "--set", &duration])
}

/// Returns the first 10 s of an uninterrupted run.
fn undisturbed(folder: &Path) -> Vec<OwnedSample> {
    flown(folder, "undisturbed", 10);
    let recording = McapRecording::open(&folder.join("undisturbed/run.mcap")).expect("a recording");
    recording.read_all().expect("a whole recording").0
}

#[test]
fn a_killed_run_can_be_read_up_to_the_last_chunk() {
    let mut underway = Underway::new();
    let ended = underway.end_by("KILL");
    assert_eq!(ended.status.code(), None, "it had no chance to end by itself");
    assert!(!underway.report().exists(), "an unfinished run has no report");

    let recording = McapRecording::open(&underway.recording()).expect("a recording");
    assert!(!recording.is_complete());
    assert_eq!((recording.header().scenario_name.as_str(), recording.header().vehicles), ("pentagon", 5));
    let (samples, _) = recording.read_all().expect("everything up to the last chunk");
    let undisturbed = undisturbed(underway.folder.path());
    assert!(samples.len() > undisturbed.len(), "{} samples", samples.len());
    assert!(samples[..undisturbed.len()] == undisturbed, "what was read is what was flown");
    assert!(samples.iter().enumerate().all(|(k, sample)| sample.step == 4 * k as u64), "without a gap");

    let judged = ran_by(TAUTLINE, underway.folder.path(), &["audit", "out/run.mcap", "--allow-unfinished"]);
    let last_s = samples.last().expect("samples").time_s;
    let expected = format!(
        "UNDECIDED: the recording ends at {last_s:.2} s, before the end of its flight of 1000000.00 s; until then "
    );
    assert!(judged.exit == Some(1) && judged.out.starts_with(&expected), "{judged:?}");
}

/// Judges the recording of an interrupted run with every output.
fn assert_the_audit_agrees(folder: &Path, last_s: f64) {
    let audit = |more: &[&str]| ran_by(TAUTLINE, folder, &[&["audit", "out/run.mcap"], more].concat());
    let judged = audit(&["--junit", "found.xml", "--events", "found.csv", "--summary", "found.md"]);
    assert_eq!(judged.exit, Some(1), "{judged:?}");
    let headline = judged.out.lines().next().expect("a headline");
    let early =
        format!("UNDECIDED: the flight ended early, at {last_s:.2} s of 1000000.00 s (interrupted); until then ");
    assert!(headline.starts_with(&early) && headline.contains("CLEAR"), "{headline}");
    let cases = fs::read_to_string(folder.join("found.xml")).expect("cases");
    assert!(cases.contains("<failure") && cases.contains("the flight ended early"), "{cases}");
    let rows = fs::read_to_string(folder.join("found.csv")).expect("rows");
    assert!(rows.contains(&format!("ended-early,,,{last_s:?},1000000.0")), "{rows}");
    assert!(fs::read_to_string(folder.join("found.md")).expect("a summary").contains("UNDECIDED"));
    assert_eq!(audit(&["--allow-undecided"]).exit, Some(0));
    // A window that was flown completely is judged normally.
    let part = audit(&["--until", "1", "--json"]);
    let report: Value = serde_json::from_str(&part.out).expect("JSON");
    let ended_early = at(&report, "/ended_early");
    assert_eq!((part.exit, &report["status"], ended_early), (Some(0), &Value::from("clear"), &Value::Null));
    let whole: Value = serde_json::from_str(&audit(&["--json"]).out).expect("JSON");
    assert_eq!((&whole["status"], status(&whole, SEPARATION)), (&Value::from("undecided"), "undecided"));
    assert_eq!((&whole["proved"], &whole["ended_early"]["at_s"]), (&Value::from(false), &Value::from(last_s)));
    let limited: Value = serde_json::from_str(&audit(&["--limit", "speed=100", "--json"]).out).expect("JSON");
    assert_eq!(status(&limited, "speed_m_s"), "undecided", "{limited}");
}

#[test]
fn a_killed_run_is_repeated_without_force() {
    let mut underway = Underway::new();
    underway.end_by("KILL");
    let again = flown(underway.folder.path(), "out", 60);
    assert_eq!((again.exit, again.out.as_str(), again.err.as_str()), (Some(0), "", ""));
    assert!(McapRecording::open(&underway.recording()).expect("a recording").read_all().is_ok());
    assert!(underway.report().exists());
}

#[test]
fn a_stopped_run_is_repeated_without_force_and_a_finished_one_is_not() {
    let mut underway = Underway::new();
    underway.end_by("INT");
    assert!(underway.report().exists(), "it left a report");
    let again = flown(underway.folder.path(), "out", 60);
    assert_eq!((again.exit, again.out.as_str(), again.err.as_str()), (Some(0), "", ""));
    let finished = flown(underway.folder.path(), "out", 60);
    assert_eq!(finished.exit, Some(2), "{}", finished.err);
    assert!(finished.err.contains("out holds a finished run"), "{}", finished.err);
}

#[test]
fn a_stopped_run_writes_a_report_on_its_flight() {
    for signal in ["INT", "TERM"] {
        let mut underway = Underway::new();
        let ended = underway.end_by(signal);
        assert_eq!(ended.status.code(), Some(1), "{signal}: not flown to its end is not passed");
        assert_eq!(String::from_utf8_lossy(&ended.stderr), "");

        let text = fs::read_to_string(underway.report()).expect("a report");
        assert_eq!(String::from_utf8_lossy(&ended.stdout), text, "the report is printed as ever");
        let report: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(report["pass"], false);
        let ended = reason(&report, "ended-early");
        assert_eq!(
            (&ended["data"]["ending"], &ended["data"]["at_s"]),
            (&"interrupted".into(), &report["run"]["duration_s"])
        );
        assert!(ended["text"].as_str().is_some_and(|said| said.contains("interrupted")), "{ended}");
        assert_eq!(report["run"]["ended_early"]["code"], "interrupted");
        assert_eq!(report["status"], "undecided", "what was flown is judged, and the rest is not known");
        assert_eq!(status(&report, SEPARATION), "undecided");
        assert_eq!(report["formation"]["reached"], false);
        assert_eq!(*at(&report, "/run/steps"), part(&report, SEPARATION)["detectors"]["steps"]);

        let recording = McapRecording::open(&underway.recording()).expect("a recording");
        let (samples, events) = recording.read_all().expect("a whole recording");
        let last = samples.last().expect("samples");
        assert_eq!(report["run"]["steps"], last.step, "the last instant is recorded");
        assert_eq!(report["run"]["duration_s"], last.time_s);
        let [Event::EndedEarly { time_s, reason }] = &events[..] else { panic!("{events:?}") };
        assert_eq!((*time_s, reason.as_str()), (last.time_s, "interrupted"));
        assert_the_audit_agrees(underway.folder.path(), last.time_s);
    }
}

#[test]
#[cfg(feature = "viewer")]
fn an_interrupted_film_leaves_no_file_and_names_the_kept_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    let names = || -> Vec<String> {
        let entries = fs::read_dir(folder.path()).expect("a folder");
        let mut names: Vec<_> = entries.map(|of| of.expect("one").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    };
    let film = ["render", "pentagon", "--at", "start", "--film", "film.gif", "--film-fps", "50", "--adapter", "none"];
    let child = Command::new(TAUTLINE)
        .args(film)
        .args(["--speed", "0.1", "--out", "."])
        .current_dir(folder.path())
        .env("XDG_RUNTIME_DIR", folder.path())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program");
    let began = Instant::now();
    while !names().iter().any(|name| name.starts_with(".film.gif") && name.ends_with(".partial")) {
        assert!(began.elapsed() < PATIENCE, "the film does not begin: {:?}", names());
        std::thread::sleep(Duration::from_millis(10));
    }
    assert!(Command::new("kill").args(["-s", "INT", &child.id().to_string()]).status().expect("kill").success());
    let ended = child.wait_with_output().expect("an end");
    let err = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(130), "{err}");
    assert!(err.contains("interrupted: kept ./start.png"), "{err}");
    assert_eq!(names(), ["start.png"]);
}

/// Processor time that a command has used when it is interrupted, in whole seconds as `ps` rounds them down. A command
/// is then beyond its start.
const USED_S: u32 = 1;

/// Returns the processor time of a process in whole seconds.
fn used_s(child: &Child) -> u32 {
    let ps = Command::new("ps").args(["-o", "time=", "-p", &child.id().to_string()]).output().expect("ps");
    // [days-][hours:]minutes:seconds[.fraction]
    let text = String::from_utf8(ps.stdout).expect("text");
    let fields = text.trim().split(['-', ':']).map(|field| field.split('.').next().unwrap_or_default());
    fields.filter_map(|field| field.parse::<u32>().ok()).fold(0, |total, field| 60 * total + field)
}

/// Starts a command that does not end, interrupts it after it has used some processor time, and returns its result.
fn interrupted(folder: &Path, arguments: &[&str]) -> Output {
    let mut child = Command::new(TAUTLINE)
        .args(arguments)
        .current_dir(folder)
        .env("XDG_RUNTIME_DIR", folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program");
    let began = Instant::now();
    while used_s(&child) < USED_S {
        assert!(child.try_wait().expect("it is ours").is_none(), "{arguments:?} ended before it was interrupted");
        assert!(began.elapsed() < PATIENCE, "{arguments:?} has not used {USED_S} s of processor time");
        std::thread::sleep(Duration::from_millis(20));
    }
    let sent = Command::new("kill").args(["-s", "INT", &child.id().to_string()]).status();
    assert!(sent.expect("kill").success());
    child.wait_with_output().expect("an end")
}

#[test]
fn an_interrupted_command_says_what_is_kept_and_how_to_continue() {
    let folder = tempfile::tempdir().expect("a folder");
    let spec = "scenario = \"pentagon\"\nruns = 4000\n[vary]\nstart.jitter_m = { uniform = [0.0, 0.3] }\n";
    fs::write(folder.path().join("spec.toml"), spec).expect("written");
    let forever = ran_by(TAUTLINE, folder.path(), &["list", "--show", "pentagon"]).out;
    let forever =
        forever.replace("a22_per_s = 0.1", "a22_per_s = -0.1").replace("duration_s = 120.0", "duration_s = 1e5");
    fs::write(folder.path().join("forever.toml"), forever).expect("written");
    let rows: String = (0..60_000).flat_map(|k| (0..100).map(move |id| format!("{k},{id},{id}0,0,0\n"))).collect();
    fs::write(folder.path().join("long.csv"), format!("t_s,id,x,y,z\n{rows}")).expect("written");
    let begins = "nothing was kept; give the command again";
    for (arguments, exit, says) in [
        (&["run", "--no-snapshots", "--set", DRAG, "--set", FOREVER][..], 1, "the same command begins again"),
        (&["campaign", "run", "spec.toml"], 1, "finished flights are kept; the same command continues"),
        (&["compare", "--set", DRAG, "--set", FOREVER], 1, begins),
        (&["sweep", "--key", "law.alpha=0.5..1:3", "--set", DRAG, "--set", FOREVER], 1, begins),
        (&["margin", "--key", "law.alpha=1..2", "--set", DRAG, "--set", FOREVER], 1, begins),
        (&["attack", "--move-start", "0.1", "--set", DRAG, "--set", FOREVER], 1, begins),
        (&["validate"], 130, "interrupted: nothing was written; give the command again"),
        (&["render", "forever.toml"], 130, "interrupted: nothing was written; give the command again"),
        (&["audit", "long.csv", "--delta", "1"], 130, "interrupted: the audit is incomplete; give the command again"),
    ] {
        // An audit of six million rows takes some seconds.
        let ended = interrupted(folder.path(), arguments);
        let err = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(exit), "{arguments:?}: {err}");
        assert!(err.contains(says), "{arguments:?}: {err}");
    }
}
