//! The program as another program calls it: the answers of the command line, and nothing printed.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::Vector3;
use serde_json::Value;
use tautline::cli::{self, Held};
use tautline::read::ReadError;
use tautline::track::{Clock, Item, Sample, Tracks};

use crate::program::{TAUTLINE, ran_by};

fn words(text: &str) -> Vec<String> {
    text.split(' ').map(str::to_owned).collect()
}

/// Two that pass each other in a second, 1 m apart in between.
struct Passing {
    names: [String; 2],
    clock: Clock,
    is_read: bool,
}

impl Passing {
    fn new() -> Self {
        let clock = Clock { unit: "s", ..Clock::default() };
        Self { names: ["alpha", "bravo"].map(str::to_owned), clock, is_read: false }
    }
}

impl Tracks for Passing {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        &self.names
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        let seen = |vehicle, time_s, x, y| {
            let position_m = Vector3::new(x, y, 0.0);
            Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
        };
        if !self.is_read {
            items.extend([
                seen(0, 0.0, -5.0, 0.0),
                seen(1, 0.0, 5.0, 1.0),
                seen(0, 1.0, 5.0, 0.0),
                seen(1, 1.0, -5.0, 1.0),
            ]);
        }
        Ok(!std::mem::replace(&mut self.is_read, true))
    }

    fn clock(&self) -> &Clock {
        &self.clock
    }

    fn notes(&self) -> &[String] {
        &[]
    }
}

#[test]
fn a_call_answers_with_what_the_command_prints() {
    let folder = tempfile::tempdir().expect("a folder");
    let called = cli::call(&words("check pentagon --json"), None, &Arc::default()).expect("an answer");
    let printed = ran_by(TAUTLINE, folder.path(), &["check", "pentagon", "--json"]);
    assert_eq!(called.data, printed.out);
    assert!(called.is_good);
    let refused = cli::call(&words("check pentagon-collinear --json"), None, &Arc::default()).expect("an answer");
    assert!(!refused.is_good, "exit code 1 is an answer");
}

#[test]
fn a_scenario_that_a_program_gives_stands_for_standard_input() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = "[start]\npositions_m = [[0, 0], [4, 0.1], [8, 0]]\n[formation]\nshape = \"circle\"\nradius_m = 2.0\n\
                [law]\ndelta_m = 1.5\n[time]\nduration_s = 1.0\n";
    std::fs::write(folder.path().join("TOML.toml"), text).expect("written");
    for asked in ["check --json -- -", "compare --laws laplacian,edge-tension --runs 1 --json=- -- -"] {
        let called = cli::call(&words(asked), Some(text), &Arc::default()).expect("an answer");
        let of_file = asked.replace("-- -", "-- TOML.toml");
        let printed = ran_by(TAUTLINE, folder.path(), &of_file.split(' ').collect::<Vec<_>>());
        let of = |data: &str| {
            let mut answer: Value = serde_json::from_str(data).expect("JSON");
            answer
                .as_object_mut()
                .expect("an object")
                .retain(|key, _| !["performance", "command"].contains(&key.as_str()));
            answer
        };
        assert_eq!(of(&called.data), of(&printed.out), "{asked}");
    }
    let refusal = cli::call(&words("check -- -"), Some("x = 3"), &Arc::default()).expect_err("a wrong key");
    assert!(refusal.message.contains("TOML, line 1: unknown key `x`"), "{refusal}");
}

#[test]
fn a_refusal_says_what_the_command_says_and_whose_fault_it_is() {
    for (asked, is_machine, says) in [
        ("bogus", false, "unrecognized subcommand 'bogus'"),
        ("check pentagn", false, "did you mean `pentagon`?"),
        ("check pentagon --set law.nope=1", false, "--set, line 1: unknown key `nope`"),
        ("audit none.csv --delta 1", false, "none.csv: No such file"),
        ("validate --out /dev/null/none", true, "cannot write"),
    ] {
        let refusal = cli::call(&words(asked), None, &Arc::default()).expect_err(asked);
        assert_eq!(refusal.is_machine, is_machine, "{refusal}");
        assert!(refusal.message.contains(says), "{refusal}");
        assert!(!refusal.message.contains("Usage"), "{refusal}");
    }
}

#[test]
fn motion_that_a_program_holds_is_judged_as_a_recording_of_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("passing.csv");
    std::fs::write(&file, "t,id,x,y,z\n0,alpha,-5,0,0\n0,bravo,5,1,0\n1,alpha,5,0,0\n1,bravo,-5,1,0\n")
        .expect("written");
    let held = Held { command: "audit(...)", own: None, open: &|| Ok(Box::new(Passing::new())) };
    let page = folder.path().join("page.html");
    let asked = [words("audit --delta 2 --html"), vec![page.display().to_string(), "arrays".to_owned()]].concat();
    let ours = cli::judge(&asked, Some(&held), &Arc::default()).expect("judged");
    let of_file = [words("audit --delta 2"), vec![file.display().to_string()]].concat();
    let theirs = cli::judge(&of_file, None, &Arc::default()).expect("judged");
    assert_eq!(ours.verdict(), "VIOLATION");
    assert_eq!((&ours.violations, &ours.closest, &ours.audit), (&theirs.violations, &theirs.closest, &theirs.audit));
    assert_eq!(ours.source.recording, "arrays");
    assert!(std::fs::read_to_string(page).expect("a page").contains("audit(...)"));
}

#[test]
fn what_calls_ends_the_work() {
    let interrupted = Arc::new(AtomicBool::new(true));
    let held = Held { command: "", own: None, open: &|| Ok(Box::new(Passing::new())) };
    let refusal = cli::judge(&words("audit --delta 2 arrays"), Some(&held), &interrupted).expect_err("ended");
    assert_eq!(refusal.message, "interrupted");
    let compared = cli::call(&words("compare pentagon --laws laplacian --runs 1 --json -"), None, &interrupted)
        .expect("an answer");
    assert!(!compared.is_good && serde_json::from_str::<Value>(&compared.data).is_err(), "{compared:?}");
}
