//! Audits of several files, with units, frames and guessed settings.

use std::fs;
use std::path::Path;

use tempfile::TempDir;

use crate::program::{Ran, TAUTLINE, ran_by};

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, content) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(path, content).expect("written");
    }
    folder
}

fn audit(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, &[&["audit"], arguments].concat())
}

/// Two vehicles 2 m apart, in the unit and with the time column of the header.
fn two(header: &str, metre: f64) -> String {
    format!("{header}\n0,0,0,{},0\n1,0,1,{},1\n", 2.0 * metre, 2.0 * metre)
}

#[test]
fn millimetres_are_not_read_as_metres() {
    let folder = folder(&[
        ("mm.csv", &two("t_s,a.x [mm],a.y [mm],b.x [mm],b.y [mm]", 1000.0)),
        ("feet.csv", &two("t_s,a.x (furlong),a.y (furlong),b.x (furlong),b.y (furlong)", 1.0)),
        ("min.csv", &two("time [min],a.x,a.y,b.x,b.y", 1.0)),
        ("frames.csv", &two("frame,a.x,a.y,b.x,b.y", 1.0)),
    ]);
    assert_eq!(audit(folder.path(), &["mm.csv", "--delta", "1.9"]).exit, Some(0));
    assert_eq!(audit(folder.path(), &["mm.csv", "--delta", "2.1"]).exit, Some(1), "2000 mm are 2 m");
    for (file, remedy) in [("feet.csv", "--scale"), ("min.csv", "--time-scale"), ("frames.csv", "--fps")] {
        let ran = audit(folder.path(), &[file, "--delta", "1"]);
        assert_eq!(ran.exit, Some(2), "{file}: {}", ran.err);
        assert!(ran.err.contains(remedy), "{}", ran.err);
    }
    for arguments in
        [["min.csv", "--time-scale", "60"], ["frames.csv", "--fps", "25"], ["frames.csv", "--time-scale", "0.04"]]
    {
        assert_eq!(
            audit(folder.path(), &[&arguments[..], &["--delta", "1.9"]].concat()).exit,
            Some(0),
            "{arguments:?}"
        );
    }
    for arguments in [["--fps", "0"], ["--fps", "nan"], ["--time-scale", "-1"]] {
        let ran = audit(folder.path(), &[&["frames.csv", "--delta", "1"][..], &arguments].concat());
        assert_eq!(ran.exit, Some(2), "{arguments:?}: {}", ran.err);
    }
}

#[test]
fn guessed_settings_are_reported() {
    let folder = folder(&[
        ("wide.csv", "t,cf1_x,cf1_y,cf2_x,cf2_y,gyro_x,gyro_y\n0,0,0,2,0,2,0.1\n1,0,1,2,1,2,0.2\n"),
        ("plain.txt", "0 0 0 0 2 0 0\n1 0 1 0 2 1 0\n"),
    ]);
    let ran = audit(folder.path(), &["wide.csv", "--delta", "1"]);
    assert_eq!(ran.exit, Some(0), "{}", ran.err);
    assert!(ran.err.contains("vehicles by column names: `cf1`, `cf2`"), "{}", ran.err);
    assert!(ran.err.contains("columns not used: gyro_x, gyro_y"), "{}", ran.err);
    let asked = audit(folder.path(), &["plain.txt", "--delta", "1"]);
    assert!(asked.exit == Some(2) && asked.err.contains("--dimensions 2 or 3 or 3+3"), "{}", asked.err);
    let said = audit(folder.path(), &["plain.txt", "--delta", "1", "--dimensions", "3"]);
    assert!(said.exit == Some(0) && said.err.contains("of each of 2 vehicles"), "{}", said.err);
    let plane = audit(folder.path(), &["plain.txt", "--delta", "1", "--dimensions", "2"]);
    assert_eq!(plane.exit, Some(1), "three vehicles in a plane meet: {}", plane.err);
}

#[test]
fn files_of_one_vehicle_each_are_one_recording() {
    let (a, b) = ("t,x,y,z\n0,0,0,0\n1,0,1,0\n", "t,x,y,z\n0,2,0,0\n1,2,1,0\n");
    let folder = folder(&[("flight/a.csv", a), ("flight/b.csv", b), ("pair.csv", &two("t,x1,y1,x2,y2", 1.0))]);
    for (delta, exit) in [("1.9", 0), ("2.1", 1)] {
        for arguments in [&["flight"][..], &["--join", "flight/a.csv", "flight/b.csv"]] {
            let ran = audit(folder.path(), &[arguments, &["--delta", delta]].concat());
            assert_eq!(ran.exit, Some(exit), "{arguments:?}: {}", ran.err);
            assert!(ran.err.contains("each file is one vehicle: a, b"), "{}", ran.err);
        }
    }
    let several = audit(folder.path(), &["flight", "pair.csv", "--delta", "1.9"]);
    assert_eq!(several.exit, Some(0), "{}", several.err);
    assert!(several.out.contains("pair.csv:") && several.out.contains("flight:"), "{}", several.out);
    assert_eq!(audit(folder.path(), &["flight", "pair.csv", "--delta", "2.1"]).exit, Some(1));
    let answers = ["--json", "--junit", "a.xml", "--events", "a.csv"];
    let told = audit(folder.path(), &[&["flight", "pair.csv", "--delta", "2.1"], &answers[..]].concat());
    assert_eq!(told.exit, Some(1), "{}", told.err);
    let reports: serde_json::Value = serde_json::from_str(&told.out).expect("JSON");
    let recordings: Vec<_> = reports.as_array().expect("a list").iter().map(|one| &one["recording"]).collect();
    assert_eq!(recordings, ["flight", "pair.csv"]);
    let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("written");
    let suites = read("a.xml");
    assert!(suites.matches("<testsuite ").count() == 2 && suites.contains("name=\"pair.csv\""), "{suites}");
    let events = read("a.csv");
    assert!(events.starts_with("recording,kind,first,"), "{events}");
    assert!(events.lines().any(|line| line.starts_with("flight,violation,a,b,")), "{events}");
    let page = audit(folder.path(), &["flight", "pair.csv", "--delta", "1.9", "--html", "a.html"]);
    assert!(page.exit == Some(2) && page.err.contains("--join"), "{}", page.err);
    // An unreadable file is an error; the other files are judged.
    let lost = audit(folder.path(), &["nowhere.csv", "pair.csv", "--delta", "1.9"]);
    assert!(lost.exit == Some(2) && lost.err.contains("nowhere.csv"), "{}", lost.err);
    assert!(lost.out.contains("pair.csv:\n") && lost.out.contains("CLEAR"), "{}", lost.out);
    assert!(lost.out.contains("not judged: "), "{}", lost.out);
    let told = audit(folder.path(), &["nowhere.csv", "pair.csv", "--delta", "2.1", "--json", "--junit", "l.xml"]);
    let answers: serde_json::Value = serde_json::from_str(&told.out).expect("JSON");
    assert_eq!(
        (told.exit, &answers[0]["recording"], &answers[1]["status"]),
        (Some(2), &"nowhere.csv".into(), &"violation".into())
    );
    assert!(answers[0]["error"].as_str().is_some_and(|error| error.contains("nowhere.csv")), "{answers}");
    let suites = read("l.xml");
    assert!(suites.contains("errors=\"1\""), "{suites}");
    // Every list is in the order of the arguments.
    let arguments = ["pair.csv", "nowhere.csv", "flight", "--delta", "1.9"];
    let outputs = ["--json", "--junit", "o.xml", "--summary", "o.md"];
    let listed = audit(folder.path(), &[&arguments[..], &outputs].concat());
    let answers: serde_json::Value = serde_json::from_str(&listed.out).expect("JSON");
    let recordings: Vec<_> = answers.as_array().expect("a list").iter().map(|one| &one["recording"]).collect();
    assert_eq!(recordings, arguments[..3]);
    let first_three: [&str; 3] = arguments[..3].try_into().expect("three recordings");
    for (text, names) in [
        (read("o.xml"), first_three.map(|name| format!("<testsuite name=\"{name}\""))),
        (read("o.md"), first_three.map(|name| format!("\n| {name} |"))),
    ] {
        let places: Vec<_> = names.iter().map(|name| text.find(name)).collect();
        assert!(places.iter().all(Option::is_some) && places.is_sorted(), "{places:?}: {text}");
    }
    let annotated = audit(folder.path(), &[&arguments[..], &["--annotations", "github"]].concat());
    let files: Vec<_> = annotated.out.lines().filter_map(|line| Some(line.split_once("file=")?.1)).collect();
    assert!(arguments[..3].iter().zip(&files).all(|(name, line)| line.starts_with(name)), "{files:?}");
    let exported = ran_by(TAUTLINE, folder.path(), &["export", "flight", "--time-unit", "s", "-o", "both.csv"]);
    assert_eq!(exported.exit, Some(0), "{}", exported.err);
    assert_eq!(audit(folder.path(), &["both.csv", "--delta", "2.1"]).exit, Some(1));
    let two = ran_by(TAUTLINE, folder.path(), &["export", "flight/a.csv", "flight/b.csv", "-o", "x.csv"]);
    assert!(two.exit == Some(2) && two.err.contains("--join"), "{}", two.err);
}

#[test]
fn a_show_is_judged_by_its_own_smallest_distance() {
    let show = |least: &str| {
        format!(
            r#"{{"settings": {{"validation": {{{least}}}}}, "swarm": {{"drones": [
                {{"settings": {{"trajectory": {{"points": [[0, [0, 0, 0]], [9, [0, 0, 9]]]}}}}}},
                {{"settings": {{"trajectory": {{"points": [[0, [2, 0, 0]], [9, [2, 0, 9]]]}}}}}}]}}}}"#
        )
    };
    let (near, far) = (show(r#""minDistance": 1.5"#), show(r#""minDistance": 2.5"#));
    let folder = folder(&[("near.json", &near), ("far.json", &far), ("silent.json", &show(""))]);
    let exits = ["near.json", "far.json", "silent.json"].map(|show| audit(folder.path(), &[show]).exit);
    assert_eq!(exits, [Some(0), Some(1), Some(2)]);
    assert_eq!(audit(folder.path(), &["far.json", "--delta", "1.5"]).exit, Some(0), "--delta overrides the recording");
}
