//! First steps of a user: `new`, `doctor`, completions, `run --watch`, and where a run says to look.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::program::{Ran, TAUTLINE, ran_by};
use serde_json::Value;
use tempfile::TempDir;

const GOOD: Option<i32> = Some(0);
const BAD: Option<i32> = Some(1);
const WRONG_INPUT: Option<i32> = Some(2);

fn folder() -> TempDir {
    tempfile::tempdir().expect("a folder")
}

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

#[test]
fn a_new_scenario_flies_clear_and_reaches_its_formation() {
    let folder = folder();
    let new = ran(folder.path(), &["new", "ring"]);
    assert_eq!((new.exit, new.err.as_str()), (GOOD, ""));
    assert!(new.out.starts_with("wrote ring.toml: six vehicles fly to a ring; "), "{}", new.out);
    assert!(new.out.ends_with("next: tautline run ring.toml --open\n"), "{}", new.out);
    let run = ran(folder.path(), &["run", "ring.toml", "--no-snapshots"]);
    assert_eq!((run.exit, run.err.as_str()), (GOOD, ""), "{}", run.out);
    assert!(run.out.starts_with("CLEAR: "), "{}", run.out);
    assert!(run.out.contains("wrote out/ring/report.html with a replay"), "{}", run.out);
    assert!(folder.path().join("out/ring/report.html").is_file());
}

#[test]
fn new_repeats_the_built_in_scenario_of_its_name_or_of_like() {
    let folder = folder();
    let new = |arguments: &[&str]| ran(folder.path(), &[&["new"], arguments].concat());
    let read = |file: &str| fs::read_to_string(folder.path().join(file)).expect("a scenario");
    assert_eq!(new(&["swap"]).out.lines().next(), Some("wrote swap.toml: the built-in scenario swap"));
    assert_eq!(read("swap.toml"), ran(folder.path(), &["list", "--show", "swap"]).out);
    assert_eq!(new(&["mine", "--like", "swap"]).exit, GOOD);
    assert_eq!(read("mine.toml"), read("swap.toml").replace("name = \"swap\"", "name = \"mine\""));
    let unknown = new(&["other", "--like", "nothing"]);
    assert_eq!((unknown.exit, unknown.code()), (WRONG_INPUT, "scenario/not-found"));
    assert!(!folder.path().join("other.toml").exists());
}

#[test]
fn a_new_scenario_overwrites_only_with_force() {
    let folder = folder();
    fs::write(folder.path().join("mine.toml"), "# mine\n").expect("a file");
    let refused = ran(folder.path(), &["new", "mine.toml"]);
    assert_eq!(refused.exit, WRONG_INPUT);
    assert!(refused.err.contains("mine.toml exists already"), "{}", refused.err);
    assert_eq!(fs::read_to_string(folder.path().join("mine.toml")).expect("the file"), "# mine\n");
    assert_eq!(ran(folder.path(), &["new", "mine", "--force"]).exit, GOOD);
    assert!(fs::read_to_string(folder.path().join("mine.toml")).expect("the file").contains("name = \"mine\""));
}

#[test]
fn a_new_scenario_needs_a_name() {
    let folder = folder();
    for name in ["two words", ".toml", "a\"b"] {
        let refused = ran(folder.path(), &["new", name]);
        assert_eq!(refused.exit, WRONG_INPUT, "{name}");
        assert!(refused.err.contains("usage/name"), "{}", refused.err);
    }
    assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 0, "nothing was written");
}

#[test]
fn the_doctor_gives_a_remedy_for_each_missing_thing() {
    let folder = folder();
    let text = ran(folder.path(), &["doctor"]);
    let findings = ran(folder.path(), &["doctor", "--json"]);
    assert_eq!((text.exit, findings.exit), (GOOD, GOOD), "{}", findings.err);
    let findings = json(&findings.out);
    for name in ["tautline", "cores", "pictures", "window", "mp4", "python", "package"] {
        let finding = findings.as_array().expect("a list").iter().find(|finding| finding["name"] == name);
        let finding = finding.unwrap_or_else(|| panic!("{name}: {findings}"));
        assert_eq!(finding["available"] == true, finding["remedy"].is_null(), "{finding}");
        assert!(text.out.lines().any(|line| line.starts_with(name)), "{}", text.out);
    }
    // No program is found on this path, and no window opens without a desktop.
    let mut bare = Command::new(TAUTLINE);
    bare.args(["doctor", "--json"]).env("PATH", folder.path()).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
    let bare = json(&String::from_utf8_lossy(&bare.output().expect("the program").stdout));
    let missing =
        |name: &str| bare.as_array().expect("a list").iter().any(|f| f["name"] == name && f["available"] == false);
    assert!(missing("python") && missing("package"), "{bare}");
    assert!(!cfg!(target_os = "linux") || missing("window"), "{bare}");
}

/// Returns the candidates for the last of the words.
fn completed(folder: &Path, words: &[&str]) -> Vec<String> {
    let mut shell = Command::new(TAUTLINE);
    shell.arg("--").args(words).current_dir(folder);
    shell.env("COMPLETE", "bash").env("_CLAP_COMPLETE_INDEX", (words.len() - 1).to_string()).env("_CLAP_IFS", "\n");
    let answer = shell.output().expect("the program");
    assert!(answer.status.success());
    String::from_utf8(answer.stdout).expect("text").lines().map(str::to_owned).collect()
}

#[test]
fn completion_knows_scenarios_files_and_keys() {
    let folder = folder();
    fs::write(folder.path().join("circus.toml"), "").expect("a file");
    assert_eq!(completed(folder.path(), &["tautline", "run", "circ"]), ["circle", "circus.toml"]);
    assert_eq!(completed(folder.path(), &["tautline", "run", "--set", "law.delta"]), ["law.delta_m="]);
    assert_eq!(completed(folder.path(), &["tautline", "margin", "--key", "time.dt"]), ["time.dt_s="]);
    assert_eq!(completed(folder.path(), &["tautline", "run", "--set", "nowhere"]), [] as [&str; 0]);
    for (words, candidates) in [
        (&["render", "--camera", "fr"][..], &["front"][..]),
        (&["render", "--colour", "s"], &["speed"]),
        (&["view", "--theme", ""], &["dark", "light"]),
        (&["compare", "--laws", "orca,lap"], &["orca,laplacian"]),
        (&["list", "--show", "gus"], &["gusts"]),
        (&["view", "circ"], &["circle", "circus.toml"]),
        (&["render", "circ"], &["circle", "circus.toml"]),
        (&["run", "--set", "law.kind=lap"], &["law.kind=laplacian"]),
        (&["run", "--set=law.ki"], &["--set=law.kind="]),
        (&["run", "--set=law.kind=lap"], &["--set=law.kind=laplacian"]),
        (&["view", "--set", "plant.kind=r"], &["plant.kind=rapier"]),
    ] {
        assert_eq!(completed(folder.path(), &[&["tautline"], words].concat()), candidates, "{words:?}");
    }
}

#[cfg(unix)]
#[test]
fn bash_completes_words_that_it_splits() {
    let folder = folder();
    let script = ran(folder.path(), &["completions", "bash"]);
    fs::write(folder.path().join("script"), script.out).expect("written");
    // Bash gives the pieces of the line, the number of the current piece, and the typed part of it.
    for (pieces, typed, reply) in [
        ("tautline run --set law.ki", "law.ki", "law.kind="),
        ("tautline run --set = law.ki", "law.ki", "law.kind="),
        ("tautline run --set law.kind = lap", "lap", "laplacian"),
        ("tautline run --set law.kind = orca --set plant.kind =", "", "rapier ideal"),
        ("tautline render --theme =", "", "dark light"),
        ("tautline run circl", "circl", "circle"),
    ] {
        let line = format!(
            "tautline() {{ {TAUTLINE} \"$@\"; }}; source ./script; COMP_WORDS=({pieces}); COMP_TYPE=9; \
             COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); _clap_complete_tautline tautline '{typed}' ''; \
             echo \"${{COMPREPLY[@]}}\""
        );
        let bash = Command::new("bash").args(["-c", &line]).current_dir(folder.path()).output().expect("bash");
        let (out, err) = (String::from_utf8_lossy(&bash.stdout), String::from_utf8_lossy(&bash.stderr));
        assert_eq!((out.trim_end(), err.as_ref()), (reply, ""), "{pieces}");
    }
}

#[test]
fn without_a_command_the_help_is_shown_and_wrong_words_have_tips() {
    let folder = folder();
    let help = ran(folder.path(), &[]);
    assert_eq!((help.exit, help.err.as_str()), (GOOD, ""));
    assert!(help.out.starts_with("Fly formations") && help.out.contains("Usage: tautline"), "{}", help.out);
    assert_eq!(fs::read_dir(folder.path()).expect("the folder").count(), 0, "nothing was flown");
    for (arguments, tip) in [
        (&["rnu"][..], "'run'"),
        (&["pentagon"], "tautline run pentagon"),
        (&["mine.toml"], "tautline run mine.toml"),
        (&["flight.csv"], "tautline audit flight.csv --delta METRES"),
        (&["run", "--st", "law.kind=orca"], "'--set'"),
        (&["audit", "flight.csv", "--delta", "2m"], "a length is a number of metres without a unit, such as 2\n"),
        (&["audit", "flight.csv", "--delta", "500mm"], "a length is a number of metres without a unit, such as 0.5\n"),
        (&["--color", "never", "run", "--st", "law.kind=orca"], "'--set'"),
        (&["audit", "flight.csv", "--delta", "1,5"], "such as 1.5\n"),
        (&["audit", "flight.csv", "--radius", "10cm"], "a radius is a number of metres without a unit, such as 0.5\n"),
        (&["audit", "flight.csv", "--max-gap", "1s"], "a time is a number of seconds without a unit, such as 1\n"),
        (&["watch", "--delta", "1", "--accel", "fast"], "an acceleration is a number of m/s^2 without a unit"),
        (&["audit", "flight.csv", "--to", "5"], "'--until'"),
        (&["audit", "flight.csv", "--format", "csv"], "'--input-format'"),
        (&["audit", "flight.csv", "-o", "page.html"], "write the page with --html FILE"),
        (&["run", "--html", "page.html"], "report.html in the folder of --out"),
        (&["run", "--set", "law.delta_m=50cm"], "numbers without a unit"),
        (&["campaign", "rn"], "'run'"),
        (&["list", "pentagon"], "tautline list --show pentagon"),
        (&["list", "--show", "pentagn"], "did you mean `pentagon`?"),
        (&["new", "mine", "--like", "pentagn"], "did you mean `pentagon`?"),
        (&["audit", "flight.csv", "--delta", "1", "--json", "out.json"], "--json=out.json"),
    ] {
        let wrong = ran(folder.path(), arguments);
        assert_eq!((wrong.exit, wrong.out.as_str()), (WRONG_INPUT, ""), "{arguments:?}");
        assert!(wrong.err.contains(tip), "{arguments:?}: {}", wrong.err);
    }
    for arguments in [&["juggle"][..], &["campaign", "spec.toml"], &["list", "nothing"]] {
        let far = ran(folder.path(), arguments);
        assert!(far.exit == WRONG_INPUT && !far.err.contains("tip"), "{}", far.err);
    }
}

#[test]
fn colours_are_a_choice() {
    let folder = folder();
    fs::write(folder.path().join("two.csv"), "t,id,x,y,z\n0,a,0,0,0\n0,b,9,0,0\n").expect("written");
    for (choice, has_colours) in [("always", true), ("never", false), ("auto", false)] {
        let judged = ran(folder.path(), &["audit", "two.csv", "--delta", "1", "--color", choice]);
        let refused = ran(folder.path(), &["audit", "none.csv", "--delta", "1", "--color", choice]);
        let usage = ran(folder.path(), &["--color", choice, "run", "--nope"]);
        for text in [&judged.out, &refused.err, &usage.err] {
            assert_eq!(text.contains('\u{1b}'), has_colours, "{choice}: {text}");
        }
    }
}

#[test]
fn a_missing_file_or_folder_is_named_with_a_remedy() {
    let folder = folder();
    fs::write(folder.path().join("two.csv"), "t,id,x,y,z\n0,a,0,0,0\n0,b,9,0,0\n").expect("written");
    let audit = ["audit", "two.csv", "--delta", "1"];
    for (arguments, code, says, remedy) in [
        (&["--obstacles", "no.toml"][..], "files/cannot-read", "no.toml: cannot read the file", "check the path"),
        (&["--fence", "no.toml"], "files/cannot-read", "no.toml: cannot read the file", "check the path"),
        (&["--html", "two.csv/b.html"], "files/no-folder", "two.csv is not a folder", "create the folder"),
        (&["--html", "a/b.html"], "files/no-folder", "a/b.html: cannot write the file: a does", "create the folder"),
        (&["--proof", "a/b.json"], "files/no-folder", "a/b.json: cannot write the file: a does", "create the folder"),
        (&["--events", "a/b.csv"], "files/no-folder", "a/b.csv: cannot write the file: a does", "create the folder"),
    ] {
        let refused = ran(folder.path(), &[&audit[..], arguments].concat());
        assert_eq!(refused.out, "", "refused before the audit");
        assert_eq!((refused.exit, refused.code()), (WRONG_INPUT, code), "{}", refused.err);
        assert!(refused.err.contains(says) && refused.err.contains(remedy), "{}", refused.err);
    }
    let refused = ran(folder.path(), &["run", "--out", "two.csv"]);
    assert_eq!((refused.exit, refused.code()), (WRONG_INPUT, "files/no-folder"), "{}", refused.err);
    assert!(refused.err.contains("--out: two.csv is a file"), "{}", refused.err);
    assert_eq!(ran(folder.path(), &["new", "ring"]).exit, GOOD);
    let refused = ran(folder.path(), &["run", "ring"]);
    assert_eq!((refused.exit, refused.code()), (WRONG_INPUT, "scenario/not-found"), "{}", refused.err);
    assert!(refused.err.contains("did you mean the file `ring.toml`?"), "{}", refused.err);
    let refused = ran(folder.path(), &["new", "a/"]);
    assert!(refused.exit == WRONG_INPUT && refused.err.contains("got `a/`"), "{}", refused.err);
    let refused = ran(folder.path(), &["new", "a/b"]);
    assert_eq!((refused.exit, refused.code()), (WRONG_INPUT, "files/no-folder"), "{}", refused.err);
    assert!(refused.err.contains("a/b.toml: cannot write the file: a does not exist"), "{}", refused.err);
}

#[test]
fn watching_needs_a_file() {
    let refused = ran(folder().path(), &["run", "pentagon", "--watch"]);
    assert_eq!(refused.exit, WRONG_INPUT);
    assert!(refused.err.contains("--watch: `pentagon` is not a file"), "{}", refused.err);
}

#[cfg(unix)]
#[test]
fn a_watched_scenario_is_flown_again_after_each_change() {
    use std::io::{BufRead as _, BufReader};
    use std::process::Stdio;

    let folder = folder();
    assert_eq!(ran(folder.path(), &["new", "ring"]).exit, GOOD);
    let file = folder.path().join("ring.toml");
    let text = fs::read_to_string(&file).expect("a scenario");
    let mut watching = Command::new(TAUTLINE)
        .args(["run", "ring.toml", "--watch", "--no-snapshots", "--no-figures"])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program");
    let mut notes = BufReader::new(watching.stderr.take().expect("standard error"));
    // Returns what is printed up to the next wait.
    let mut until_it_waits = || {
        let mut printed = String::new();
        while !printed.contains("waiting for a change") {
            assert_ne!(notes.read_line(&mut printed).expect("a line"), 0, "it ended: {printed}");
        }
        printed
    };
    until_it_waits();
    fs::write(&file, text.replace("delta_m = 1.0", "delta_m = true")).expect("a wrong scenario");
    assert!(until_it_waits().contains("delta_m"), "the failure is reported");
    fs::write(&file, text.replace("duration_s = 60.0", "duration_s = 1.0")).expect("a short flight");
    until_it_waits();
    let sent = Command::new("kill").args(["-s", "INT", &watching.id().to_string()]).status();
    assert!(sent.expect("kill").success());
    let ended = watching.wait_with_output().expect("an end");
    let printed = String::from_utf8_lossy(&ended.stdout);
    assert_eq!(ended.status.code(), BAD, "the last flight did not reach its formation: {printed}");
    assert!(printed.contains("CLEAR: ") && printed.contains("NOT REACHED: "), "{printed}");
}

#[test]
fn every_example_of_a_key_in_the_help_of_a_study_is_flown() {
    let folder = folder();
    let mut flown = 0;
    for (command, option, quick) in [
        ("margin", "--key", &["--scan", "2", "--halvings", "0"][..]),
        ("sweep", "--key", &["--set", "time.duration_s=2"]),
        ("attack", "--vary", &["--set", "time.duration_s=2", "--flights", "3"]),
    ] {
        let help = ran_by(TAUTLINE, folder.path(), &[command, "--help"]).out;
        let examples = help.split('`').skip(1).step_by(2).filter(|word| word.contains('=') && word.contains('.'));
        for example in examples {
            let words = [&[command, "pentagon", option, example], quick].concat();
            let ran = ran_by(TAUTLINE, folder.path(), &words);
            assert!(matches!(ran.exit, Some(0 | 1)), "{words:?}: {}", ran.err);
            for refused in ["could not be flown", "no flight was flown", "can be flown"] {
                assert!(!(ran.out.clone() + &ran.err).contains(refused), "{words:?}: {}{}", ran.out, ran.err);
            }
            flown += 1;
        }
    }
    assert_eq!(flown, 4, "the examples that are found in the help");
    // Negative twin: a key that no flight takes.
    let refused = ["sweep", "pentagon", "--key", "network.loss=0,0.1,0.2", "--set", "time.duration_s=2"];
    let refused = ran_by(TAUTLINE, folder.path(), &refused);
    assert!(refused.exit == Some(1) && refused.out.contains("could not be flown"), "{}", refused.out);
}

#[cfg(target_os = "linux")]
#[test]
fn a_page_is_opened_on_request() {
    use std::os::unix::fs::PermissionsExt as _;

    let folder = folder();
    let root = folder.path();
    fs::write(root.join("pair.csv"), "t_s,id,x,y,z\n0,a,0,0,0\n0,b,3,0,0\n1,a,0,0,0\n1,b,3,0,0\n").expect("a file");
    // A browser that notes its page.
    let browser = root.join("xdg-open");
    fs::write(&browser, format!("#!/bin/sh\necho \"$1\" >> '{}'\n", root.join("opened").display())).expect("a script");
    fs::set_permissions(&browser, fs::Permissions::from_mode(0o755)).expect("a program");
    let path = format!("{}:{}", root.display(), std::env::var("PATH").expect("a path"));
    let short = ["--set", "time.duration_s=1"];
    for (words, page) in [
        (vec!["audit", "pair.csv", "--delta", "1", "--html", "a.html"], "a.html"),
        ([&["sweep", "--key", "law.alpha=1,2", "--html", "s.html"][..], &short].concat(), "s.html"),
        ([&["run", "--no-snapshots"][..], &short].concat(), "out/pentagon/report.html"),
    ] {
        let command = |more: &[&str]| {
            Command::new(TAUTLINE).args(&words).args(more).current_dir(root).env("PATH", &path).output()
        };
        command(&[]).expect("the program");
        assert!(!root.join("opened").exists(), "{words:?}: nothing is opened without the option");
        let force: &[&str] = if words[0] == "audit" { &["--open"] } else { &["--open", "--force"] };
        let ran = command(force).expect("the program");
        while !fs::read_to_string(root.join("opened")).is_ok_and(|text| text.ends_with('\n')) {
            std::thread::yield_now();
        }
        let opened = fs::read_to_string(root.join("opened")).expect("the note");
        assert!(opened.trim_end().ends_with(page), "{opened}: {}", String::from_utf8_lossy(&ran.stderr));
        fs::remove_file(root.join("opened")).expect("the note");
    }
}
