//! Presence of vehicles: reported in every output, and required by an option.

use std::fmt::Write as _;
use std::fs;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{parts, status};

/// Vehicles in a row, each with a sample every second up to its own time \[s\].
fn recording(until_s: &[u32]) -> String {
    let mut text = "t,id,x,y,z\n".to_owned();
    for t in 0..=until_s.iter().copied().max().unwrap_or(0) {
        for (k, _) in until_s.iter().enumerate().filter(|(_, until_s)| t <= **until_s) {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{t},v{k},{},0,0", 9 * k);
        }
    }
    text
}

fn audit(until_s: &[u32], words: &[&str]) -> (Ran, tempfile::TempDir) {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("flight.csv"), recording(until_s)).expect("written");
    let settings = "[audit]\ndelta_m = 1.0\nrequire_presence = true\n";
    fs::write(folder.path().join("strict.toml"), settings).expect("written");
    (ran_by(TAUTLINE, folder.path(), &[&["audit", "flight.csv"], words].concat()), folder)
}

#[test]
fn the_headline_names_absent_vehicles_with_their_times() {
    let (ran, folder) = audit(&[60, 60, 55], &["--delta", "1", "--html", "p.html"]);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    let headline = ran.out.lines().next().expect("a headline");
    let said = "; from 0.000 s to 60.000 s, over which 1 of 3 vehicles is not seen throughout: \
                v2 is seen from 0.000 s to 55.000 s";
    assert!(headline.starts_with("CLEAR if straight") && headline.ends_with(said), "{headline}");
    assert!(ran.out.contains("presence: 2 seen throughout, 1 not\n  v2 is seen from 0.000 s to 55.000 s\n"), "{ran:?}");
    let page = fs::read_to_string(folder.path().join("p.html")).expect("a page");
    assert!(page.contains("Presence") && page.contains("55.000"));
    let (all, _) = audit(&[60, 60, 60], &["--delta", "1", "--require-presence"]);
    assert!(all.exit == Some(0) && !all.out.contains("throughout"), "{all:?}");
}

#[test]
fn missing_required_presence_is_undecided_with_names() {
    for words in [&["--delta", "1", "--require-presence"][..], &["--config", "strict.toml"]] {
        let (ran, _) = audit(&[60, 60, 55], words);
        assert_eq!(ran.exit, Some(1), "{ran:?}");
        assert!(
            ran.out.starts_with("UNDECIDED: ") && ran.out.contains("v2 is seen from 0.000 s to 55.000 s"),
            "{ran:?}"
        );
    }
    let (_, folder) = audit(&[60, 60, 55], &["--delta", "1", "--require-presence", "--junit", "j.xml"]);
    let junit = fs::read_to_string(folder.path().join("j.xml")).expect("cases");
    assert!(junit.contains(r#"name="presence""#) && junit.contains("vehicle is not seen throughout"), "{junit}");
    let (window, _) =
        audit(&[60, 60, 55], &["--delta", "1", "--require-presence", "--until", "55", "--time-unit", "s"]);
    assert_eq!(window.exit, Some(0), "{window:?}");
    let (never, _) = audit(&[60, 60, 55], &["--delta", "1", "--require-presence", "--from", "57", "--time-unit", "s"]);
    assert!(never.exit == Some(1) && never.out.contains("v2 is not seen"), "{never:?}");
    let (violation, _) = audit(&[60, 60, 55], &["--delta", "10", "--require-presence"]);
    assert!(violation.exit == Some(1) && violation.out.starts_with("VIOLATION: "), "{violation:?}");
}

#[test]
fn presence_is_in_the_keys_and_the_text_stays_short_for_thousands() {
    let until_s: Vec<u32> = (0..2000).map(|k| if k % 2 == 0 { 4 } else { 3 }).collect();
    let (ran, _) = audit(&until_s, &["--delta", "1", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON");
    let presence = &report["presence"];
    assert_eq!((&presence["throughout"], &presence["partly"]), (&1000.into(), &1000.into()));
    assert_eq!(presence["window_s"], serde_json::json!([0.0, 4.0]));
    assert_eq!(presence["listed"][0], serde_json::json!({"vehicle": "v1", "from_s": 0.0, "to_s": 3.0}));
    assert_eq!((parts(&report), &report["status"]), (vec!["separation"], &"clear".into()), "presence is not asked");
    let (required, _) = audit(&until_s, &["--delta", "1", "--require-presence", "--json"]);
    let required: serde_json::Value = serde_json::from_str(&required.out).expect("JSON");
    assert_eq!((status(&required, "separation"), status(&required, "presence")), ("clear", "undecided"));
    assert_eq!(required["status"], "undecided");
    let (text, _) = audit(&until_s, &["--delta", "1"]);
    let headline = text.out.lines().next().expect("a headline");
    assert!(headline.ends_with(", and 997 more") && headline.len() < 500, "{headline}");
    assert!(text.out.contains("  and 990 more\n") && text.out.lines().count() < 60, "{}", text.out.lines().count());
}
