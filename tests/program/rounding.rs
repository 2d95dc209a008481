//! Separations in all outputs for people are rounded down: a reader must not see a larger one than the judge found.

use std::fs;
use std::path::Path;

use crate::program::{TAUTLINE, ran_by};
use crate::report::least;

/// Separation whose nearest numbers of three and of six decimals are larger \[m\].
const APART_M: f64 = 2.504_729_6;

/// Returns the texts of a page or a figure, without scripts, styles and tags.
fn texts(page: &str) -> String {
    let mut rest = page.to_owned();
    for element in ["script", "style"] {
        while let Some(from) = rest.find(&format!("<{element}")) {
            let to = rest[from..].find(&format!("</{element}>")).map_or(rest.len(), |end| from + end);
            rest.replace_range(from..to, "");
        }
    }
    let mut texts = String::new();
    for part in rest.split('<').filter_map(|part| part.split_once('>')) {
        texts.push_str(part.1);
        texts.push(' ');
    }
    texts
}

/// Returns the numbers of a text that begin with these digits.
fn numbers(text: &str, digits: &str) -> Vec<f64> {
    let is_of_number = |c: char| c.is_ascii_digit() || c == '.';
    let words = text.split(|c: char| !is_of_number(c)).map(|word| word.trim_end_matches('.'));
    // Numbers with fewer decimals label axes.
    let is_separation = |word: &&str| word.starts_with(digits) && word.len() > digits.len();
    words.filter(is_separation).filter_map(|word| word.parse().ok()).collect()
}

/// Checks that each of these files shows a separation, and none a larger one than `apart_m`.
fn check(folder: &Path, files: &[&str], apart_m: f64) {
    // Numbers of this size are separations.
    let digits = &format!("{apart_m:.3}")[..4];
    for file in files {
        let content = fs::read_to_string(folder.join(file)).expect(file);
        let is_page = Path::new(file).extension().is_some_and(|kind| kind == "html" || kind == "svg");
        let found = numbers(&if is_page { texts(&content) } else { content }, digits);
        assert!(!found.is_empty(), "{file} shows no separation of {digits}... m");
        assert!(found.iter().all(|shown| *shown <= apart_m), "{file}: {found:?} above {apart_m:?}");
        assert!(found.iter().all(|shown| apart_m - shown < 1e-3), "{file}: {found:?} far below {apart_m:?}");
    }
}

#[test]
fn outputs_of_an_audit_round_separations_down() {
    let folder = tempfile::tempdir().expect("a folder");
    for (limit_m, exit) in [("1", 0), ("4", 1)] {
        let rows = |t: u8| format!("{t},alpha,0,0,0\n{t},bravo,0,{APART_M:?},0\n");
        let table: String = (0..4).map(rows).collect();
        fs::write(folder.path().join("two.csv"), format!("t_s,id,x,y,z\n{table}")).expect("a file");
        let files = ["--html", "page.html", "--figures", "svg", "--junit", "junit.xml", "--summary", "summary.md"];
        let ran = ran_by(TAUTLINE, folder.path(), &[&["audit", "two.csv", "--delta", limit_m], &files[..]].concat());
        assert_eq!(ran.exit, Some(exit), "{ran:?}");
        fs::write(folder.path().join("out.txt"), &ran.out).expect("a file");
        let figures = ["encounters", "closest-approach", "smallest"].map(|name| format!("page-figures/{name}.svg"));
        let mut files = vec!["out.txt", "page.html", "summary.md"];
        // A passed JUnit case has no message.
        if exit == 1 {
            files.push("junit.xml");
        }
        files.extend(figures.iter().map(String::as_str));
        check(folder.path(), &files, APART_M);
    }
}

#[test]
fn outputs_of_a_flight_round_separations_down() {
    let folder = tempfile::tempdir().expect("a folder");
    // A start whose smallest separation would be rounded up to three decimals.
    let flown = (0..40).find_map(|seed| {
        let seed = format!("start.seed={seed}");
        let set = ["--set", "start.jitter_m=0.1", "--set", "time.duration_s=3", "--set", &seed, "--figures", "svg"];
        let ran = ran_by(TAUTLINE, folder.path(), &[&["run", "pentagon", "--force"], &set[..]].concat());
        fs::write(folder.path().join("out.txt"), &ran.out).expect("a file");
        let text = fs::read_to_string(folder.path().join("out/pentagon/report.json")).expect("a report");
        let report: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let min_m = least(&report);
        let nearest: f64 = format!("{min_m:.3}").parse().expect("a number");
        (nearest > min_m).then_some(min_m)
    });
    let files = ["out.txt", "out/pentagon/report.html", "out/pentagon/figures/distances.svg"];
    check(folder.path(), &files, flown.expect("a start"));
}
