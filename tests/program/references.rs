//! References through the program: from a file, and under laws that follow one or do not.

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

/// A folder with a scenario below it, and its reference beside that.
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
fn a_reference_in_a_file_is_the_curve_through_the_same_points_and_the_recording_needs_no_file() {
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
fn a_file_that_is_no_reference_is_refused_with_place_and_remedy() {
    for (places, said) in [
        ("t,x,z\n0,0,0\n3,1,1\n", "below/path.csv:1: the first line does not name the columns t, x and y"),
        ("0,0\n3,1\n", "below/path.csv:1: 2 columns; a place in time has t, x, y and perhaps z"),
        ("0,0,0,0,0\n", "below/path.csv:1: 5 columns without the names t, x and y"),
        ("t,x,y\n0,0,0\n1,one,0\n3,1,1\n", "below/path.csv:3: `one` is not a number"),
        ("t,x,y\n0,0,0\n3,nan,0\n", "below/path.csv:3: a number is not finite"),
        ("t,x,y\n0,0,0\n2,0,0\n1,1,1\n", "below/path.csv:4: the time 1 s is not after 2 s"),
        ("t,x,y\n0,0,0\n2,0,0\n2,1,1\n3,1,1\n", "below/path.csv:4: the time 2 s is not after 2 s"),
        ("t,x,y\n0,0,0\n", "below/path.csv:2: there is one point, and a motion has at least two"),
        ("t,x,y\n", "below/path.csv:1: there is no point"),
        ("t,x,y\n0,0,0\n2,1,0\n", "the reference is given from 0 to 2 s, and the flight lasts from 0 to 3 s"),
        ("t,x,y\n0,0,0\n1,0.1,0\n2,9,0\n3,9.1,0\n", "the reference jumps between 1 and 2 s"),
        ("t,x,y\n0,0,0\n1,1e99,0\n3,0,0\n", "x of the reference is 1e99, too large to compute with"),
        ("t,x,y\n0,0,0\n1,1,0\n1.001,1.001,0\n3,3,0\n", "the reference turns within 0.0019"),
    ] {
        let there = folder(FILE, places);
        let Ran { exit, out, err } = ran(there.path(), &["run", "below/carried.toml"]);
        assert_eq!((exit, out.as_str()), (Some(2), ""), "{places}: {err}");
        let err = err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" ");
        assert!(err.contains(said) && err.contains("help:") && !err.contains("panicked"), "{said}: {err}");
        assert!(err.contains(&format!("carried.toml:{LINE}:")) || err.contains(&format!("carried.toml:{}:", LINE + 1)));
        assert!(!there.path().join("out").exists(), "nothing is written");
    }
    let missing = folder("kind = \"file\"\nfile = \"none.csv\"\n", PLACES);
    let Ran { exit, err, .. } = ran(missing.path(), &["check", "below/carried.toml"]);
    assert!(exit == Some(2) && err.contains("cannot read below/none.csv") && err.contains("help:"), "{err}");
}

/// What is asked of a law that it does not do, with the place and the remedy.
#[test]
fn a_law_that_does_not_follow_is_refused_with_place_and_remedy() {
    let rest = "kind = \"rest\"\n";
    let cases = [
        ("edge-tension", rest, "the law `edge-tension` follows no reference", "(displacement, orca, cbf-qp, flocking)"),
        ("laplacian", rest, "the law `laplacian` follows no reference", "set law.kind to one that does"),
        ("potential", rest, "the law `potential` follows no reference", "or leave out [reference]"),
        ("orca", "kind = \"rest\"\nleader = 2\n", "vehicles that do not know the reference", "leave it out"),
        ("cbf-qp", "kind = \"rest\"\nknown_by = [1, 2]\n", "vehicles that do not know the reference", "displacement"),
        ("flocking", "kind = \"rest\"\nknown_by = [3]\n", "vehicles that do not know the reference", "leave it out"),
        (
            "orca",
            "kind = \"rest\"\n[breathing]\nmode = \"start\"\n",
            "the law `orca` is never given spread slots",
            "leave out",
        ),
    ];
    for (law, reference, said, remedy) in cases {
        let there = folder(reference, "");
        let file = there.path().join("below/carried.toml");
        let text = fs::read_to_string(&file).expect("a file").replace("displacement", law);
        fs::write(&file, text).expect("a file");
        for command in ["check", "run"] {
            let Ran { exit, out, err } = ran(there.path(), &[command, "below/carried.toml"]);
            assert_eq!((exit, out.as_str()), (Some(2), ""), "{law}: {err}");
            let err = err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" ");
            assert!(err.contains(said) && err.contains(remedy) && err.contains("carried.toml:"), "{law}: {err}");
        }
        assert!(!there.path().join("out").exists(), "nothing is written");
    }
    // Known by all, by whatever name, it is followed; slots that are spread by themselves are not asked of other laws.
    for law in ["orca", "cbf-qp", "flocking"] {
        for known in ["", "known_by = \"all\"\n", "known_by = [1, 2, 3]\n[breathing]\nmode = \"auto\"\n"] {
            let there = folder(&format!("{rest}{known}"), "");
            let sets = ["check", "below/carried.toml", "--set", &format!("law.kind={law}")];
            assert_eq!(ran(there.path(), &sets).exit, Some(0), "{law} {known}");
        }
    }
}

#[test]
fn vehicles_are_assigned_anew_where_they_are_stalled_under_a_law_that_tells() {
    for (sets, said) in [
        (["law.kind=orca", "breathing.mode=auto"], "under the law `orca` nobody is assigned anew"),
        (["law.kind=displacement", "breathing.mode=off"], "with breathing off nobody is assigned anew"),
        (["law.kind=displacement", "breathing.most=0"], "with breathing off nobody is assigned anew"),
    ] {
        let there = folder("kind = \"rest\"\n", "");
        let check = |by: &str| {
            let by = format!("formation.assignment={by}");
            ran(
                there.path(),
                &["check", "below/carried.toml", "--json", "--set", &by, "--set", sets[0], "--set", sets[1]],
            )
        };
        let Ran { exit, err, .. } = check("when-stalled");
        let err = err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" ");
        assert!(exit == Some(2) && err.contains(said) && err.contains("--set:1:22"), "{err}");
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
