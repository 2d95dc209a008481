//! `tautline audit --above` and `--land-on`: vehicles on the ground.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::program::{Ran, TAUTLINE, ran_by};

/// Vehicle a drives through a wall at a height of 0.9 m, and b stands 9 m aside.
const DRIVE: &str =
    "t_s,id,x,y,z\n0,a,-5,0,0.9\n0,b,-5,9,0.9\n5,a,0,0,0.9\n5,b,-5,9,0.9\n10,a,5,0,0.9\n10,b,-5,9,0.9\n";
const WALL: &str = "[[obstacle]]\nname = \"wall\"\nbox = { size_m = [1, 4, 4] }\nat_m = [0, 0, 2]\n";
const GROUND: &str = "[[obstacle]]\nname = \"ground\"\nhalf_space = { normal = [0, 0, 1] }\nclearance_m = 0.5\n";

/// Two vehicles 2 m apart that take off side by side after 5 s and climb to 10 m until 10 s.
const TAKE_OFF: &str = "t_s,id,x,y,z\n0,a,0,0,0\n0,b,2,0,0\n5,a,0,0,0\n5,b,2,0,0\n10,a,0,0,10\n10,b,9,0,10\n";

fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let settings = "[audit]\nabove_m = 1.0\nland_on = [\"ground\"]\nobstacles = \"ground.toml\"\n";
    for (name, text) in [
        ("drive.csv", DRIVE.to_owned()),
        ("wall.toml", WALL.to_owned()),
        ("ground.toml", GROUND.to_owned()),
        ("both.toml", format!("{WALL}{GROUND}")),
        ("take-off.csv", TAKE_OFF.to_owned()),
        ("settings.toml", settings.to_owned()),
    ] {
        fs::write(folder.path().join(name), text).expect("a file");
    }
    folder
}

fn audit(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, &[&["audit"], arguments].concat())
}

/// Returns the kind, source and value of the facts of an exemption.
fn exemptions(folder: &Path, arguments: &[&str]) -> Vec<Value> {
    let ran = audit(folder, &[arguments, &["--json"]].concat());
    let report: Value = serde_json::from_str(&ran.out).expect("JSON alone");
    let facts = report["facts"].as_array().expect("facts").iter();
    let is_exemption = |fact: &&Value| fact["fact"].as_str().is_some_and(|kind| kind.ends_with("-exemption"));
    facts.filter(is_exemption).map(|fact| json!([fact["fact"], fact["source"], fact["value"]])).collect()
}

#[test]
fn a_collision_with_an_obstacle_counts_on_the_ground() {
    let folder = folder();
    let wall = ["drive.csv", "--delta", "1", "--obstacles", "wall.toml", "--above", "1"];
    let ran = audit(folder.path(), &wall);
    assert_eq!(ran.exit, Some(1), "{ran:?}");
    assert!(ran.out.starts_with("VIOLATION: a and wall came to -0.500 m (limit 0.500 m)"), "{ran:?}");
    // The ground is exempt if vehicles land on it, and the wall beside it is not.
    let landed = ["drive.csv", "--delta", "1", "--obstacles", "both.toml", "--above", "1", "--land-on", "ground"];
    let ran = audit(folder.path(), &landed);
    assert!(ran.out.starts_with("VIOLATION: a and wall came to -0.500 m"), "{ran:?}");
    // A limit of single vehicles counts on the ground too.
    let low = audit(folder.path(), &["drive.csv", "--delta", "1", "--above", "1", "--limit", "floor=2"]);
    assert!(low.exit == Some(1) && low.out.starts_with("VIOLATION: lowest height of a"), "{low:?}");
}

#[test]
fn the_headline_states_how_long_vehicles_were_exempt() {
    let folder = folder();
    let ran = audit(folder.path(), &["take-off.csv", "--delta", "2.5", "--above", "1"]);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    // Both pass 1 m at 5.5 s, where they are 2.7 m apart.
    assert!(ran.out.starts_with("CLEAR above 1.000 m if straight between samples: never closer than 2.69"), "{ran:?}");
    assert!(ran.out.contains("; pairs at or below 1.000 m were exempt for 5.500 s of 10.000 s; from"), "{ran:?}");
    assert_eq!(
        exemptions(folder.path(), &["take-off.csv", "--delta", "2.5", "--above", "1"]),
        [json!(["ground-exemption", "declared", 1.0]), json!(["ground-exemption", "observed", 5.5])]
    );
    assert!(exemptions(folder.path(), &["take-off.csv", "--delta", "1"]).is_empty());
    // A window that begins in the air has no exempt time.
    let late = audit(folder.path(), &["take-off.csv", "--delta", "2.5", "--above", "1", "--from", "6"]);
    assert!(late.out.contains("were exempt for 0.000 s of 4.000 s"), "{late:?}");
}

#[test]
fn vehicles_that_never_leave_the_ground_are_not_judged() {
    let folder = folder();
    for question in [&["--delta", "1"], &["--well-clear", "do-365"]] {
        let ran = audit(folder.path(), &[&["drive.csv", "--above", "1"], &question[..]].concat());
        assert!(ran.exit == Some(1) && ran.out.starts_with("UNDECIDED: "), "{question:?}: {ran:?}");
        assert!(ran.out.contains("exempt for 10.000 s of 10.000 s"), "{question:?}: {ran:?}");
    }
}

#[test]
fn an_obstacle_on_which_vehicles_land_is_exempt_while_they_are_on_the_ground() {
    let folder = folder();
    let ground = ["take-off.csv", "--delta", "1", "--obstacles", "ground.toml"];
    let above = [&ground[..], &["--above", "1"]].concat();
    for arguments in [&ground[..], &above[..]] {
        let ran = audit(folder.path(), arguments);
        assert_eq!(ran.exit, Some(1), "{arguments:?}: {ran:?}");
        assert!(ran.out.starts_with("VIOLATION: a and ground came to 0.000 m"), "{ran:?}");
    }
    let landed = [&ground[..], &["--above", "1", "--land-on", "ground"]].concat();
    let ran = audit(folder.path(), &landed);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    let exempt = "pairs at or below 1.000 m were exempt for 5.500 s, landing on ground for 5.500 s of 10.000 s";
    assert!(ran.out.starts_with("CLEAR above 1.000 m if ") && ran.out.contains(exempt), "{ran:?}");
    assert_eq!(
        exemptions(folder.path(), &landed)[2..],
        [json!(["landing-exemption", "declared", "ground"]), json!(["landing-exemption", "observed", 5.5])]
    );
    let by_file = audit(folder.path(), &["take-off.csv", "--delta", "1", "--config", "settings.toml"]);
    assert!(by_file.exit == Some(0) && by_file.out.contains("landing on ground for 5.500 s"), "{by_file:?}");
    // A vehicle that is low in the air, above Z, is judged.
    let low = audit(folder.path(), &[&ground[..], &["--above", "0.2", "--land-on", "ground"]].concat());
    assert!(low.exit == Some(1) && low.out.starts_with("VIOLATION: a and ground came to 0.19"), "{low:?}");
}

#[test]
fn a_wrong_name_of_an_obstacle_is_refused() {
    let folder = folder();
    let asked = ["take-off.csv", "--delta", "1", "--obstacles", "ground.toml"];
    for (more, problem, remedy) in [
        (
            &["--above", "1", "--land-on", "pad"][..],
            "no obstacle `pad`; the obstacles are ground",
            "leave --land-on out",
        ),
        (&["--land-on", "ground"], "at or below a height, which is not given", "--above Z"),
    ] {
        let ran = audit(folder.path(), &[&asked[..], more].concat());
        assert_eq!((ran.exit, ran.code()), (Some(2), "audit/land-on"), "{ran:?}");
        let said = ran.err.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains(problem) && said.contains(remedy), "{ran:?}");
    }
}
