//! References from a file, and under laws with and without support for references.

use std::fs;
use std::path::Path;

use crate::program::{Ran, TAUTLINE, ran_by};
use serde_json::Value;

const SCENARIO: &str = r#"name = "carried"
[start]
positions_m = [[0, 0], [3, 0], [0, 3]]
[formation]
shape = "points"
points_m = [[0, 0], [3, 0], [1, 3]]
[law]
kind = "displacement"
delta_m = 2.0
[time]
duration_s = 3.0
[reference]
"#;
/// Line of the first key of the reference.
const LINE: usize = 13;

const PLACES: &str = "t,x,y\n0,0,0\n1,0.5,0\n2,1.5,0.25\n3,2,1\n";
const SPLINE: &str = "kind = \"spline\"\ntimes_s = [0, 1, 2, 3]\npoints_m = [[0, 0], [0.5, 0], [1.5, 0.25], [2, 1]]\n";
const FILE: &str = "kind = \"file\"\nfile = \"path.csv\"\n";

/// Returns a folder with a scenario in a folder below it, and the file of its reference beside that folder.
fn folder(reference: &str, places: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let below = folder.path().join("below");
    fs::create_dir(&below).expect("a folder");
    fs::write(below.join("carried.toml"), format!("{SCENARIO}{reference}")).expect("a file");
    fs::write(below.join("path.csv"), places).expect("a file");
    folder
}

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

fn flown(folder: &Path, scenario: &str) -> (Value, Value) {
    let Ran { out, err, .. } = ran(folder, &["run", scenario, "--no-figures", "--no-snapshots", "--json", "--force"]);
    let report: Value = serde_json::from_str(&out).expect(&err);
    (report["scenario"]["sha256"].clone(), report["run"]["state_hash"].clone())
}

#[test]
fn a_reference_in_a_file_equals_inline_points_and_is_in_the_recording() {
    let inline = flown(folder(SPLINE, "").path(), "below/carried.toml");
    for same in [
        PLACES,
        "0;0;0;0\n1;0.5;0;0\n2;1.5;0.25;0\n3;2;1;0\n",
        "# log\nx_m y_m yaw time_s\n0 0 9 0\n.5 0 9 1\n1.5 .25 9 2\n2 1 9 3\n",
    ] {
        let there = folder(FILE, same);
        assert_eq!(flown(there.path(), "below/carried.toml"), inline, "{same}");
        let shown = ran(there.path(), &["list", "--show", "out/carried/run.mcap"]);
        assert!(shown.out.contains("kind = \"spline\"") && !shown.out.contains("path.csv"), "{}", shown.out);
        fs::remove_file(there.path().join("below/path.csv")).expect("a file");
        fs::write(there.path().join("again.toml"), &shown.out).expect("a file");
        assert_eq!(flown(there.path(), "again.toml"), inline);
    }
    let other = flown(folder(FILE, &PLACES.replace("2,1\n", "2,1.5\n")).path(), "below/carried.toml");
    assert!(other.0 != inline.0 && other.1 != inline.1, "another file is another flight");
}

#[test]
fn a_wrong_reference_file_is_refused_with_place_and_remedy() {
    for (reference, places, said) in [
        (FILE, "t,x,y\n0,0,0\n1,one,0\n3,1,1\n", "below/path.csv:3: `one` is not a number"),
        ("kind = \"file\"\nfile = \"none.csv\"\n", PLACES, "cannot read below/none.csv"),
    ] {
        let there = folder(reference, places);
        let ran = ran(there.path(), &["run", "below/carried.toml"]);
        assert_eq!((ran.exit, ran.out.as_str(), ran.code()), (Some(2), "", "scenario/file"), "{}", ran.err);
        let err = ran.err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" ");
        assert!(err.contains(said) && err.contains("help:"), "{said}: {err}");
        assert!(err.contains(&format!("carried.toml:{}:", LINE + 1)), "{err}");
        assert!(!there.path().join("out").exists(), "nothing is written");
    }
}

#[test]
fn a_law_without_references_is_refused_with_place_and_remedy() {
    let there = folder("kind = \"rest\"\n", "");
    for command in ["check", "run"] {
        let ran = ran(there.path(), &[command, "below/carried.toml", "--set", "law.kind=laplacian"]);
        assert_eq!((ran.exit, ran.code()), (Some(2), "scenario/unsupported-by-law"), "{}", ran.err);
        assert!(ran.err.contains("help:") && !there.path().join("out").exists(), "{}", ran.err);
    }
}

#[test]
fn stalled_vehicles_are_reassigned_under_a_law_that_detects_stalls() {
    for sets in [
        ["law.kind=orca", "deadlock.mode=auto"],
        ["law.kind=displacement", "deadlock.mode=off"],
        ["law.kind=displacement", "deadlock.most=0"],
    ] {
        let there = folder("kind = \"rest\"\n", "");
        let check = |by: &str| {
            let by = format!("formation.assignment={by}");
            ran(
                there.path(),
                &["check", "below/carried.toml", "--json", "--set", &by, "--set", sets[0], "--set", sets[1]],
            )
        };
        let refused = check("when-stalled");
        assert_eq!((refused.exit, refused.code()), (Some(2), "scenario/unsupported-by-law"), "{}", refused.err);
        assert!(refused.err.contains("--set:1:22"), "{}", refused.err);
        assert_eq!(check("optimal").exit, Some(0), "the first assignment needs no such law");
    }
    let there = folder("kind = \"rest\"\n", "");
    let anew = |by: &str| {
        let by = format!("formation.assignment={by}");
        let found = ran(there.path(), &["check", "below/carried.toml", "--json", "--set", &by]);
        serde_json::from_str::<Value>(&found.out).expect(&found.err)["reassigns"].clone()
    };
    assert_eq!([anew("given"), anew("optimal"), anew("when-stalled")], [false, true, true].map(Value::Bool));
}
