//! `report.html` in a real browser.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::browser::{check, open, probe};

/// Flies a built-in scenario and returns the path of its page.
fn fly(folder: &Path, arguments: &[&str]) -> PathBuf {
    let out = folder.join("run");
    let program = Command::new(env!("CARGO_BIN_EXE_tautline"))
        .arg("run")
        .args(arguments)
        .arg("--quiet")
        .arg("--out")
        .arg(&out)
        .output()
        .expect("the program runs");
    assert!(program.status.code() <= Some(1), "{}", String::from_utf8_lossy(&program.stderr));
    out.join("report.html")
}

#[test]
fn a_report_fits_every_screen_in_light_and_dark_and_loads_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = fly(folder.path(), &["pentagon"]);
    check(folder.path(), &page, "pentagon", "CLEAR", 6);

    let picture = folder.path().join("report.png");
    let flags = [
        format!("--screenshot={}", picture.display()),
        "--window-size=1280,2000".to_owned(),
        "--disable-gpu".to_owned(),
    ];
    open(folder.path(), &page, &flags);
    let bytes = fs::read(&picture).expect("a picture");
    assert!(bytes.starts_with(b"\x89PNG") && bytes.len() > 50_000, "{} bytes", bytes.len());
}

#[test]
fn a_report_of_a_violation_fits_every_screen() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = fly(folder.path(), &["pentagon-laplacian"]);
    check(folder.path(), &page, "pentagon-laplacian", "VIOLATION", 6);
}

#[test]
fn pages_of_studies_fit_every_screen() {
    let folder = tempfile::tempdir().expect("a folder");
    let short = ["pentagon", "--set", "time.duration_s=2", "--quiet", "--html"];
    let page = |name: &str, study: &[&str]| {
        let page = folder.path().join(format!("{name}.html"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_tautline"));
        let program = command.arg(name).args(short).arg(&page).args(study).output().expect("the program runs");
        assert!(program.status.code() <= Some(1), "{}", String::from_utf8_lossy(&program.stderr));
        page
    };
    let grid = ["--key", "start.jitter_m=0..0.4:3", "--key", "law.delta_m=1,2,9", "--runs", "2", "--verdict", "clear"];
    check(folder.path(), &page("sweep", &grid), "pentagon: start.jitter_m and law.delta_m", "6 of 9 points", 2);
    let margin = ["--key", "law.alpha=0.5..2", "--scan", "2", "--runs", "2"];
    check(folder.path(), &page("margin", &margin), "pentagon: law.alpha", "fails", 2);
    check(folder.path(), &page("attack", &["--move-start", "0.4", "--flights", "6"]), "pentagon", "a search", 1);
}

#[test]
fn the_check_detects_wide_pages_and_console_messages() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = fly(folder.path(), &["pentagon", "--set", "time.duration_s=1"]);
    let html = fs::read_to_string(&page).expect("a page");
    fs::write(&page, html.replace("<footer>", "<footer><div style=\"width:900px\">wide</div>")).expect("written");
    let (found, messages) = probe(folder.path(), &page, 390, false);
    assert!(found["scroll_width"].as_u64() > Some(390), "{found}");
    assert!(messages.is_empty(), "{messages:?}");
    fs::write(&page, html.replace("<footer>", "<footer><img src=\"elsewhere.png\">")).expect("written");
    let (_, messages) = probe(folder.path(), &page, 390, false);
    assert!(messages.iter().any(|line| line.contains("Content Security Policy")), "{messages:?}");
}
