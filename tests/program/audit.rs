//! `tautline audit`, run as a user runs it.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use tempfile::TempDir;

use crate::program::{Ran, TAUTLINE, ran_by};

/// Two vehicles pass each other within a second, 1 m apart in the middle and far apart in every sample.
const PASS: &str = "t,id,x,y,z\n0,alpha,-5,0,0\n0,bravo,5,1,0\n1,alpha,5,0,0\n1,bravo,-5,1,0\n";

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        fs::write(folder.path().join(name), text).expect("a file");
    }
    folder
}

fn audit(folder: &Path, arguments: &[&str]) -> Ran {
    let mut all = vec!["audit"];
    all.extend(arguments);
    ran_by(TAUTLINE, folder, &all)
}

#[test]
fn the_first_line_says_it_and_so_does_the_exit_code() {
    let folder = folder(&[("pass.csv", PASS)]);
    let clear = audit(folder.path(), &["pass.csv", "--delta", "0.5"]);
    assert_eq!(clear.exit, Some(0), "{clear:?}");
    assert!(
        clear.out.starts_with("PROVED CLEAR: never closer than 1.000000 m, alpha and bravo at 0.50 s"),
        "{clear:?}"
    );
    let violation = audit(folder.path(), &["pass.csv", "--delta", "2"]);
    assert_eq!(violation.exit, Some(1), "{violation:?}");
    assert!(violation.out.starts_with("VIOLATION: alpha and bravo came to 1.000 m (limit 2.000 m)"), "{violation:?}");
    let bounded = ["pass.csv", "--delta", "0.9", "--motion", "bounded", "--max-accel", "1"];
    let undecided = audit(folder.path(), &bounded);
    assert_eq!(undecided.exit, Some(1), "{undecided:?}");
    assert!(undecided.out.starts_with("UNDECIDED: alpha and bravo"), "{undecided:?}");
    assert!(undecided.out.contains("Hz would decide"), "{undecided:?}");
    assert_eq!(audit(folder.path(), &[&bounded[..], &["--allow-undecided"]].concat()).exit, Some(0));
    let quiet = audit(folder.path(), &["pass.csv", "--delta", "2", "--quiet"]);
    assert_eq!((quiet.exit, quiet.out.as_str()), (Some(1), ""), "{quiet:?}");
}

#[test]
fn what_is_asked_in_seconds_does_not_rest_on_a_guessed_unit() {
    let every_two = "t,id,x,y,z\n0,a,0,0,0\n0,b,1.5,0,0\n2,a,0,0,0\n2,b,1.5,0,0\n4,a,0,0,0\n4,b,1.5,0,0\n";
    let folder = folder(&[("log.csv", every_two)]);
    let bounded = ["log.csv", "--delta", "1", "--motion", "bounded", "--max-accel", "1"];
    for asked in [&bounded[3..], &["--from", "0"], &["--to", "3"], &["--max-gap", "5"], &["--offset", "a=0"]] {
        let ran = audit(folder.path(), &[&bounded[..3], asked].concat());
        assert_eq!(ran.exit, Some(2), "{ran:?}");
        assert!(ran.err.contains("log.csv") && ran.err.contains("say --time-unit ms, or --time-unit s"), "{ran:?}");
    }
    assert_eq!(audit(folder.path(), &bounded[..3]).exit, Some(0), "a straight way is the same in any unit");
    for (unit, exit) in [("ms", 0), ("s", 1)] {
        let ran = audit(folder.path(), &[&bounded[..], &["--time-unit", unit]].concat());
        assert_eq!(ran.exit, Some(exit), "{ran:?}");
    }
}

#[test]
fn a_recording_of_ours_is_judged_by_its_own_delta_unless_another_is_given() {
    let folder = folder(&[("pass.csv", PASS)]);
    let fly = ["run", "circle", "--out", "out", "--set", "time.duration_s=1", "--no-snapshots", "--no-figures"];
    ran_by(TAUTLINE, folder.path(), &fly);
    let own = audit(folder.path(), &["out/run.mcap"]);
    assert_eq!(own.exit, Some(0), "{own:?}");
    assert!(own.out.contains("(delta 1.000 m,"), "{own:?}");
    assert!(own.err.contains("note: the safety distance is the recording's own, 1.0 m"), "{own:?}");
    let another = audit(folder.path(), &["out/run.mcap", "--delta", "1.5"]);
    assert!(another.out.contains("(delta 1.500 m,") && !another.err.contains("own"), "{another:?}");
    let of_others = audit(folder.path(), &["pass.csv"]);
    assert_eq!(of_others.exit, Some(2), "{of_others:?}");
    assert!(of_others.err.contains("there is no delta"), "{of_others:?}");
}

#[test]
fn json_is_alone_on_standard_output_and_has_the_keys_of_a_report() {
    let folder = folder(&[("pass.csv", PASS)]);
    let ran = audit(folder.path(), &["pass.csv", "--delta", "2", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&ran.out).expect("JSON alone");
    assert_eq!(json["status"], "violation");
    assert_eq!(json["separation"]["min_m"], 1.0);
    assert_eq!(json["separation"]["min_pair"], serde_json::json!([1, 2]));
    assert_eq!(json["audit"]["violations"][0]["pair"], serde_json::json!([1, 2]));
    assert_eq!(json["audit"]["parry"]["disagreements"], 0);
    assert_eq!(json["clock"]["unit"], "s");
    assert_eq!(json["closest"][0]["who"], serde_json::json!(["alpha", "bravo"]));
    for key in ["gaps", "undecided"] {
        assert_eq!(json[key], serde_json::json!([]), "{key}");
    }
    assert!(ran.err.contains("VIOLATION"), "talk goes beside it: {ran:?}");
}

#[test]
fn junit_events_and_page_are_written() {
    let folder = folder(&[("pass.csv", PASS)]);
    let files = ["--junit", "a.xml", "--events", "a.csv", "--html", "a.html"];
    let ran = audit(folder.path(), &[&["pass.csv", "--delta", "2"][..], &files].concat());
    assert_eq!(ran.exit, Some(1), "{ran:?}");
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect(name);
    assert!(read("a.xml").contains("failures=\"2\""), "{}", read("a.xml"));
    let events = read("a.csv");
    assert!(events.starts_with("kind,first,second,from_s,to_s,"), "{events}");
    assert!(events.contains("\nviolation,alpha,bravo,0.41"), "{events}");
    let page = read("a.html");
    assert!(page.contains("VIOLATION") && page.contains("closest 1.000000 m") && page.contains("Closest approach"));
    let clear = audit(folder.path(), &[&["pass.csv", "--delta", "0.5"][..], &files].concat());
    assert_eq!(clear.exit, Some(0), "{clear:?}");
    assert!(read("a.xml").contains("failures=\"0\"") && !read("a.csv").contains("violation"));
}

#[test]
fn every_question_can_be_asked() {
    let tower = "[[obstacle]]\nname = \"tower\"\nball = { radius_m = 1.0 }\nat_m = [0.0, -2.0, 0.0]\n";
    let folder = folder(&[("pass.csv", PASS), ("tower.toml", tower)]);
    for (arguments, exit) in [
        (&["--radius", "0.4"][..], 0),
        (&["--radius", "alpha=0.4", "--radius", "bravo=0.7"], 1),
        (&["--ellipsoid", "0.4,0.4,2"], 0),
        (&["--ellipsoid", "0.6,0.6,2"], 1),
        (&["--delta", "2", "--to", "0.4"], 0),
        (&["--delta", "2", "--from", "0.6"], 0),
        (&["--delta", "2", "--from", "0.3", "--to", "0.45"], 1),
        (&["--delta", "2", "--above", "0.5"], 0),
        (&["--delta", "2", "--above", "-0.5"], 1),
        (&["--delta", "2", "--ids", "alpha"], 0),
        (&["--delta", "2", "--offset", "bravo=9"], 0),
        (&["--delta", "2", "--max-gap", "0.5"], 1),
        (&["--delta", "0.5", "--max-gap", "2"], 0),
        (&["--delta", "1", "--obstacles", "tower.toml"], 0),
        (&["--delta", "1", "--radius", "0.4", "--obstacles", "tower.toml"], 0),
        (&["--delta", "1", "--radius", "alpha=1.1", "--radius", "bravo=0", "--obstacles", "tower.toml"], 1),
    ] {
        let ran = audit(folder.path(), &[&["pass.csv"][..], arguments].concat());
        // A gap of the whole recording leaves two single samples, far apart.
        assert_eq!(ran.exit, Some(exit), "{arguments:?}: {ran:?}");
    }
}

#[test]
fn wrong_input_is_named_with_its_remedy_and_exits_with_2() {
    let bad = "[[obstacle]]\nname = \"tower\"\nbal = { radius_m = 1.0 }\n";
    let files = [("pass.csv", PASS), ("bad.toml", bad), ("text.csv", "t,id,x,y,z\n0,a,here,0,0\n")];
    let folder = folder(&files);
    for (arguments, said) in [
        (&["pass.csv"][..], "--radius NAME=R"),
        (&["pass.csv", "--delta", "0"], "delta must be above 0"),
        (&["pass.csv", "--delta", "nan"], "delta"),
        (&["pass.csv", "--delta", "-1"], "delta must be above 0, and finite, not -1"),
        (&["pass.csv", "--delta", "1", "--max-gap", "-1"], "the longest gap must be 0 s or more, not -1"),
        (&["pass.csv", "--radius", "-1"], "the radius must be 0 m or more, and finite, not -1"),
        (&["pass.csv", "--ellipsoid", "-1,1,1"], "each axis of the ellipsoid must be above 0"),
        (&["pass.csv", "--delta", "1", "--motion", "bounded", "--max-accel", "-1"], "acceleration must be 0 or more"),
        (&["pass.csv", "--delta", "1e71"], "not 1e71"),
        (&["pass.csv", "--delta", "1e-300"], "not 1e-300"),
        (&["pass.csv", "--delta", "1", "--events", "./pass.csv"], "would overwrite the recording"),
        (
            &["pass.csv", "--delta", "1", "--obstacles", "bad.toml", "--html", "bad.toml"],
            "overwrite the file of obstacles",
        ),
        (&["pass.csv", "--delta", "1", "--junit", "new.xml", "--html", "./new.xml"], "would overwrite --junit"),
        (&["pass.csv", "--delta", "1", "--ids", "zulu"], "no vehicle zulu"),
        (&["pass.csv", "--delta", "1", "--radius", "zulu=1"], "no vehicle zulu"),
        (&["pass.csv", "--delta", "1", "--motion", "bounded"], "--max-accel"),
        (&["pass.csv", "--delta", "1", "--max-accel", "1"], "--motion bounded"),
        (&["pass.csv", "--delta", "1", "--motion", "polynomial"], "--motion linear"),
        (&["pass.csv", "--delta", "1", "--from", "2", "--to", "1"], "holds no time"),
        (&["pass.csv", "--delta", "1", "--obstacles", "bad.toml"], "line 3"),
        (&["pass.csv", "--delta", "1", "--obstacles", "none.toml"], "none.toml"),
        (&["pass.csv", "--ellipsoid", "1,2"], "three half axes"),
        (&["pass.csv", "--delta", "1", "--offset", "alpha"], "NAME=SECONDS"),
        (&["none.csv", "--delta", "1"], "none.csv"),
        (&["text.csv", "--delta", "1"], "line 2"),
    ] {
        let ran = audit(folder.path(), arguments);
        assert_eq!(ran.exit, Some(2), "{arguments:?}: {ran:?}");
        let words = ran.err.split_whitespace().filter(|word| !word.starts_with('│')).collect::<Vec<_>>().join(" ");
        assert!(words.contains(said), "{arguments:?}: {words}");
        assert_eq!(ran.out, "", "{arguments:?}");
    }
}

#[test]
fn a_file_that_cannot_be_written_is_the_machines_failure() {
    let folder = folder(&[("pass.csv", PASS)]);
    let ran = audit(folder.path(), &["pass.csv", "--delta", "2", "--html", "none/a.html"]);
    assert_eq!(ran.exit, Some(3), "{ran:?}");
    assert!(ran.out.starts_with("VIOLATION: alpha and bravo"), "the verdict is said all the same: {ran:?}");
}

#[test]
fn what_is_said_names_the_closest_and_every_limit_as_it_is() {
    // Twelve pairs of radii 0.1 m; in the last two they overlap, or nearly do.
    let mut rows = "t_s,id,x,y,z,radius\n".to_owned();
    for k in 0..12 {
        let x = 100.0 * f64::from(k);
        let _ = write!(rows, "0,a{k},{x},0,0,0.1\n0,b{k},{},0,0,0.1\n", x + 1.0 + 0.1 * f64::from(k));
    }
    rows += "0,big,0,900,0,5\n0,too,9,900,0,5\n";
    let obstacle =
        "[[obstacle]]\nname = \"mast\"\nball = { radius_m = 1.0 }\nat_m = [-5.0, -1.5, 0.0]\nclearance_m = 0\n";
    let folder = folder(&[("lim.csv", &rows), ("pass.csv", PASS), ("mast.toml", obstacle)]);
    let limits = audit(folder.path(), &["lim.csv", "--json", "--events", "lim.ev.csv", "--quiet"]);
    let json: serde_json::Value = serde_json::from_str(&limits.out).expect("JSON alone");
    assert_eq!(json["separation"]["delta_m"], serde_json::Value::Null);
    assert_eq!(json["violations"][0]["limit_m"], 10.0);
    let events = fs::read_to_string(folder.path().join("lim.ev.csv")).expect("events");
    assert!(events.contains("violation,big,too,0.0,0.0,9.0,9.0,0.0,10.0,"), "{events}");
    // The mast is closer than the two ever are to each other, and may be touched.
    let mast = audit(folder.path(), &["pass.csv", "--delta", "0.5", "--obstacles", "mast.toml", "--html", "a.html"]);
    assert!(mast.out.starts_with("PROVED CLEAR: never closer than 0.500000 m, alpha and mast at 0.00 s"), "{mast:?}");
    let page = fs::read_to_string(folder.path().join("a.html")).expect("a page");
    assert!(page.contains("Distances from the closest obstacles"));
    let alone = audit(folder.path(), &["pass.csv", "--delta", "0.5", "--ids", "alpha", "--html", "a.html"]);
    assert!(alone.out.contains("1.000 s, 1 vehicle, "), "{alone:?}");
    assert!(!fs::read_to_string(folder.path().join("a.html")).expect("a page").contains("Closest pairs"));
}

#[test]
fn the_page_says_what_the_verdict_says() {
    let mut gap = "t,id,x,y,z\n".to_owned();
    for t in [0, 1, 2, 3, 8, 9, 10] {
        let _ = write!(gap, "{t},alpha,0,0,0\n{t},bravo,{},0,0\n", t + 1);
    }
    let folder = folder(&[("pass.csv", PASS), ("gap.csv", &gap)]);
    let page = |arguments: &[&str]| {
        audit(folder.path(), &[arguments, &["--html", "a.html"]].concat());
        fs::read_to_string(folder.path().join("a.html")).expect("a page")
    };
    let lines = |page: &str| page.matches("<polyline").count();
    assert_eq!(
        lines(&page(&["gap.csv", "--delta", "1"])),
        lines(&page(&["gap.csv", "--delta", "1", "--max-gap", "9"])) + 4
    );
    let scaled = page(&["pass.csv", "--ellipsoid", "0.5,0.5,0.5"]);
    assert!(scaled.contains("distance [ellipsoids]") && scaled.contains("closest 2.000000 ellipsoids"), "{scaled}");
    let doubtful = page(&["pass.csv", "--delta", "0.9", "--motion", "bounded", "--max-accel", "1"]);
    assert!(doubtful.contains("closest 0.750000 .. 1.250000 m at 0.500 s") && !doubtful.contains("UNDECIDED:"));
}
