//! References that cannot be followed are refused: invalid files, and laws without references.

use std::fs;

use tautline_sim::scenario::{Override, Scenario, ScenarioError, Source};

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

/// Reads the scenario with a reference and a law, next to a file of points.
fn read(reference: &str, places: &str, law: &str) -> Result<Scenario, ScenarioError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("carried.toml");
    fs::write(&path, format!("{SCENARIO}{reference}")).expect("a file");
    fs::write(folder.path().join("path.csv"), places).expect("a file");
    let law = Override::parse(&format!("law.kind={law}")).expect("an override");
    Scenario::read(&Source::File(path), &[law])
}

#[test]
fn a_wrong_reference_file_is_refused_at_its_line() {
    let (file, reference) = ("scenario/file", "scenario/reference");
    for (places, code, line) in [
        ("t,x,z\n0,0,0\n3,1,1\n", file, "path.csv:1:"),
        ("0,0\n3,1\n", file, "path.csv:1:"),
        ("0,0,0,0,0\n", file, "path.csv:1:"),
        ("t,x,y\n0,0,0\n1,one,0\n3,1,1\n", file, "path.csv:3:"),
        ("t,x,y\n0,0,0\n3,nan,0\n", file, "path.csv:3:"),
        ("t,x,y\n0,0,0\n2,0,0\n1,1,1\n", file, "path.csv:4:"),
        ("t,x,y\n0,0,0\n2,0,0\n2,1,1\n3,1,1\n", file, "path.csv:4:"),
        ("t,x,y\n0,0,0\n", file, "path.csv:2:"),
        ("t,x,y\n", file, "path.csv:1:"),
        ("t,x,y\n0,0,0\n2,1,0\n", "scenario/outside-flight", ""),
        ("t,x,y\n0,0,0\n1,0.1,0\n2,9,0\n3,9.1,0\n", reference, ""),
        ("t,x,y\n0,0,0\n1,1e99,0\n3,0,0\n", file, "path.csv:3:"),
        ("t,x,y\n0,0,0\n1,1,0\n1.001,1.001,0\n3,3,0\n", "scenario/step-too-long", ""),
    ] {
        let error = read("kind = \"file\"\nfile = \"path.csv\"\n", places, "displacement").expect_err(places);
        assert_eq!(error.code(), code, "{places}: {error}");
        assert!(error.message.contains(line) && !error.help.is_empty() && error.place.is_some(), "{error}");
    }
}

#[test]
fn a_reference_that_the_law_cannot_follow_is_refused() {
    let rest = "kind = \"rest\"\n";
    for (law, keys) in [
        ("edge-tension", ""),
        ("laplacian", ""),
        ("potential", ""),
        ("orca", "leader = 2\n"),
        ("bvc", "leader = 2\n"),
        ("cbf-qp", "known_by = [1, 2]\n"),
        ("flocking", "known_by = [3]\n"),
        ("orca", "[deadlock]\nmode = \"start\"\n"),
    ] {
        let error = read(&format!("{rest}{keys}"), "", law).expect_err(law);
        assert_eq!(error.code(), "scenario/unsupported-by-law", "{law}: {error}");
        assert!(!error.help.is_empty() && error.place.is_some(), "{law}: {error}");
    }
    for law in ["orca", "bvc", "cbf-qp", "flocking"] {
        for known in ["", "known_by = \"all\"\n", "known_by = [1, 2, 3]\n[deadlock]\nmode = \"auto\"\n"] {
            assert!(read(&format!("{rest}{known}"), "", law).is_ok(), "{law} {known}");
        }
    }
}
