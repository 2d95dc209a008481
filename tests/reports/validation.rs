//! Compares `docs/validation.md` with `tautline validate`, whose claims must all pass, and opens its page in a browser.

use std::fs;
use std::process::Command;

use serde_json::Value;

const PAGE: &str = include_str!("../../docs/validation.md");
const BEGIN: &str = "<!-- begin: tautline validate --markdown -->\n";
const END: &str = "<!-- end: tautline validate --markdown -->\n";

/// Returns the part of the page between the marks.
fn generated(page: &str) -> Option<&str> {
    page.split_once(BEGIN)?.1.split_once(END).map(|(part, _)| part)
}

/// Returns the lines in which the texts differ.
fn differences(page: &str, program: &str) -> String {
    let only = |mark: &str, here: &str, there: &str| {
        let lines = here.lines().filter(|line| !there.lines().any(|other| other == *line));
        lines.fold(String::new(), |text, line| text + mark + " " + line + "\n")
    };
    only("page:   ", page, program) + &only("program:", program, page)
}

#[test]
#[ignore = "minutes: sh tests/run.sh --long"]
fn the_page_matches_the_program_and_every_claim_passes() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_tautline")).arg("validate").args(arguments).current_dir(folder.path()).output()
    };
    let done = run(&["--markdown", "--quiet"]).expect("the program");
    let out = folder.path().join("out/validate");
    let result = fs::read(out.join("validate.json")).expect("the result");
    let result: Value = serde_json::from_slice(&result).expect("JSON");
    let failed: Vec<_> = result["groups"]
        .as_array()
        .expect("groups")
        .iter()
        .flat_map(|group| group["claims"].as_array().expect("claims"))
        .filter(|claim| claim["pass"] != true)
        .collect();
    assert!(failed.is_empty(), "{failed:#?}");
    assert_eq!((done.status.code(), &result["pass"]), (Some(0), &Value::Bool(true)));

    let program = String::from_utf8(done.stdout).expect("UTF-8");
    let page = generated(PAGE).expect("two marks in docs/validation.md");
    assert!(page == program, "docs/validation.md is not what the program measures:\n{}", differences(page, &program));

    let kept = run(&["--quiet"]).expect("the program");
    assert_eq!(kept.status.code(), Some(2), "a finished validation is not overwritten");
    let html = fs::read_to_string(out.join("validate.html")).expect("the page");
    for figure in ["1", "2a", "2b", "2c", "3a", "3b", "3c", "4"].map(|figure| format!("figure-{figure}")) {
        let svg = fs::read_to_string(out.join(format!("figures/{figure}.svg"))).expect(&figure);
        assert!(svg.starts_with("<svg") && html.contains(&svg), "{figure}");
    }
    assert!(out.join("figures/convergence.svg").is_file());
    crate::browser::check(folder.path(), &out.join("validate.html"), "Validation", "valid: all", 9);
    let ids = result["groups"].to_string();
    for finding in 1..=7 {
        assert!(ids.contains(&format!("\"finding\":\"F{finding}\"")), "F{finding} is measured");
        assert!(html.contains(&format!("F{finding}; ")), "F{finding} is named on the page");
    }
}

#[test]
fn a_different_number_on_the_page_is_detected() {
    let page = "a\nthe error is 1e-9 m\nb\n";
    let program = "a\nthe error is 2e-9 m\nb\n";
    let seen = differences(page, program);
    assert_eq!(seen, "page:    the error is 1e-9 m\nprogram: the error is 2e-9 m\n");
    assert!(differences(page, page).is_empty());
    assert_eq!(generated("no marks"), None);
}
