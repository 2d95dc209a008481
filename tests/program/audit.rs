//! `tautline audit` as a process.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{SEPARATION, at, closest, facts, motion, part, status, violations};

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
fn the_first_line_and_the_exit_code_have_the_verdict() {
    let folder = folder(&[("pass.csv", PASS)]);
    let clear = audit(folder.path(), &["pass.csv", "--delta", "0.5"]);
    assert_eq!(clear.exit, Some(0), "{clear:?}");
    assert!(
        clear.out.starts_with(
            "CLEAR if straight between samples: never closer than 1.000000 m, alpha and bravo at 0.50 s \
             (delta 0.500 m); from 0.000 s to \
             1.000 s"
        ),
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
fn options_in_seconds_need_a_known_unit_of_time() {
    let every_two = "t,id,x,y,z\n0,a,0,0,0\n0,b,1.5,0,0\n2,a,0,0,0\n2,b,1.5,0,0\n4,a,0,0,0\n4,b,1.5,0,0\n";
    let folder = folder(&[("log.csv", every_two)]);
    let bounded = ["log.csv", "--delta", "1", "--motion", "bounded", "--max-accel", "1"];
    for asked in [&bounded[3..], &["--from", "0"], &["--until", "3"], &["--max-gap", "5"], &["--offset", "a=1"]] {
        let ran = audit(folder.path(), &[&bounded[..3], asked].concat());
        assert_eq!(ran.exit, Some(2), "{ran:?}");
        assert!(ran.err.contains("log.csv") && ran.err.contains("give --time-unit ms, or --time-unit s"), "{ran:?}");
    }
    assert_eq!(audit(folder.path(), &bounded[..3]).exit, Some(0), "a straight way is the same in any unit");
    for (unit, exit) in [("ms", 0), ("s", 1)] {
        let ran = audit(folder.path(), &[&bounded[..], &["--time-unit", unit]].concat());
        assert_eq!(ran.exit, Some(exit), "{ran:?}");
    }
}

#[test]
fn a_tautline_recording_has_a_default_delta() {
    let folder = folder(&[("pass.csv", PASS)]);
    let fly = ["run", "circle", "--out", "out", "--set", "time.duration_s=1", "--no-snapshots", "--no-figures"];
    ran_by(TAUTLINE, folder.path(), &fly);
    let own = audit(folder.path(), &["out/run.mcap"]);
    assert_eq!(own.exit, Some(0), "{own:?}");
    assert!(own.out.contains("(delta 1.000 m)"), "{own:?}");
    assert!(own.err.contains("note: the safety distance is the recording's own, 1.0 m"), "{own:?}");
    let another = audit(folder.path(), &["out/run.mcap", "--delta", "1.5"]);
    assert!(another.out.contains("(delta 1.500 m)") && !another.err.contains("recording's own"), "{another:?}");
    let of_others = audit(folder.path(), &["pass.csv"]);
    assert_eq!(of_others.exit, Some(2), "{of_others:?}");
    assert!(of_others.err.contains("has no limit: neither delta nor its radius is given"), "{of_others:?}");
}

#[test]
fn a_violation_at_an_obstacle_beside_ellipsoids_is_not_clear_in_an_audit() {
    let folder = folder(&[("ell.toml", ELLIPSOIDS)]);
    for record_hz in ["60", "240"] {
        let record = format!("time.record_hz={record_hz}");
        let words = ["run", "ell.toml", "--out", "out", "--force", "--no-figures", "--set", &record];
        let ran = ran_by(TAUTLINE, folder.path(), &words);
        assert!(ran.out.contains("from obstacle post"), "{ran:?}");
        let ran = audit(folder.path(), &["out", "--json"]);
        let json: Value = serde_json::from_str(&ran.out).expect("JSON alone");
        assert_eq!((ran.exit, &json["status"]), (Some(1), &"undecided".into()), "{ran:?}");
    }
}

/// Vehicle 1 flies through the clearance of an obstacle, far from all others.
const ELLIPSOIDS: &str = r#"
name = "ell"
[swarm]
count = 4
dimensions = 3
hull_radius_m = 0.05
[safety]
shape = "ellipsoid"
half_axes_m = [0.25, 0.25, 0.75]
[start]
positions_m = [[-3, 0, 0], [6, 6, 0.3], [9, -9, 0.6], [9, 9, -0.2]]
[formation]
shape = "points"
points_m = [[3, 0, 0], [9, 6, 0], [12, -9, 0], [12, 9, 0]]
[reference]
kind = "rest"
[sensing]
latency_s = 0.15
[[obstacle]]
name = "post"
at_m = [0, 0, 0]
ball = { radius_m = 0.2 }
clearance_m = 0.3
[law]
kind = "displacement"
delta_m = 0.5
[time]
duration_s = 20
"#;

#[test]
fn of_equal_minima_all_outputs_name_one_pair() {
    let folder = folder(&[]);
    let start = "start={positions_m=[[-5.7,0],[5.7,0],[-2.7,10],[2.7,10]]}";
    let formation = "formation={shape=\"points\",points_m=[[5.7,0],[-5.7,0],[2.7,10],[-2.7,10]]}";
    let sets = [start, formation, "time.duration_s=4", "swarm.a22_per_s=0", "swarm.hull_radius_m=0.001"];
    let sets: Vec<_> = sets.iter().flat_map(|set| ["--set", set]).collect();
    let words = ["run", "pentagon-laplacian", "--plant", "ideal", "--out", "out", "--no-figures"];
    let ran = ran_by(TAUTLINE, folder.path(), &[&words[..], &sets].concat());
    let audited = audit(folder.path(), &["out"]);
    for out in [&ran.out, &audited.out] {
        let (headline, closest) = out.split_once('\n').expect("lines");
        let closest = closest.lines().find(|line| line.contains("1 and 2") || line.contains("3 and 4")).expect(out);
        let pair = if closest.contains("1 and 2") { "1 and 2" } else { "3 and 4" };
        assert!(headline.contains("VIOLATION") && headline.contains(pair), "{out}");
    }
}

#[test]
fn json_goes_to_standard_output_with_the_keys_of_a_report() {
    let folder = folder(&[("pass.csv", PASS)]);
    let ran = audit(folder.path(), &["pass.csv", "--delta", "2", "--json"]);
    let json: Value = serde_json::from_str(&ran.out).expect("JSON alone");
    assert_eq!((&json["status"], status(&json, SEPARATION)), (&"violation".into(), "violation"));
    assert_eq!(closest(&json)["value"], json!({"lower": 1.0, "upper": 1.0, "unit": "m"}));
    for found in [closest(&json), &violations(&json)[0]] {
        assert_eq!((&found["subjects"], &found["limit"]), (&json!(["alpha", "bravo"]), &2.0.into()));
    }
    let separation = part(&json, SEPARATION);
    assert_eq!(separation["detectors"]["parry_disagreements"], 0);
    assert_eq!(json["clock"]["unit"], "s");
    for found in [at(&json, "/gaps"), at(separation, "/undecided")] {
        assert_eq!(*found, json!({"count": 0, "is_exact": true, "listed": []}));
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
    assert!(["wrote a.xml", "wrote a.csv", "wrote a.html"].iter().all(|line| ran.out.contains(line)), "{}", ran.out);
    let figures = ["pass.csv", "--delta", "2", "--html", "b.html", "--figures", "svg", "--proof", "b.json"];
    let drawn = audit(folder.path(), &figures);
    assert!(
        drawn.out.contains("\nwrote b.html and ") && drawn.out.contains(" figures in b-figures\n"),
        "{}",
        drawn.out
    );
    assert!(drawn.out.contains("\nwrote b.json"), "{}", drawn.out);
    assert_eq!(audit(folder.path(), &[&figures[..], &["-q"]].concat()).out, "");
    let clear = audit(folder.path(), &[&["pass.csv", "--delta", "0.5"][..], &files].concat());
    assert_eq!(clear.exit, Some(0), "{clear:?}");
    assert!(read("a.xml").contains("failures=\"0\"") && !read("a.csv").contains("violation"));
}

#[test]
fn a_violation_of_bounded_motion_has_an_upper_bound_alone() {
    let folder = folder(&[("pass.csv", PASS)]);
    let bounded = ["--time-unit", "s", "--motion", "bounded", "--max-accel", "0.01"];
    for (more, lower) in [(&[][..], Value::from(1.0)), (&bounded, Value::Null)] {
        let asked = [&["pass.csv", "--delta", "2", "--json", "--events", "a.csv"], more].concat();
        let json: Value = serde_json::from_str(&audit(folder.path(), &asked).out).expect("JSON alone");
        let [found] = violations(&json) else { panic!("{json}") };
        assert_eq!(found["value"]["lower"], lower);
        let upper = found["value"]["upper"].as_f64().expect("a bound");
        assert!((1.0..1.1).contains(&upper), "{found}");
        let events = fs::read_to_string(folder.path().join("a.csv")).expect("events");
        let [names, row] = [0, 1].map(|k| events.lines().nth(k).expect("a row").split(',').collect::<Vec<_>>());
        let cell = |name: &str| row[names.iter().position(|found| *found == name).expect(name)].to_owned();
        let shown = lower.as_f64().map_or_else(String::new, |lower| format!("{lower:?}"));
        assert_eq!((cell("kind"), cell("lower_m"), cell("upper_m")), ("violation".into(), shown, format!("{upper:?}")));
    }
}

#[test]
fn figures_are_written_beside_the_page() {
    let folder = folder(&[("pass.csv", PASS)]);
    let ran = audit(folder.path(), &["pass.csv", "--delta", "0.5", "--html", "a.html", "--figures", "svg,pdf"]);
    assert_eq!(ran.exit, Some(0), "{}", ran.err);
    for (file, begins) in [("encounters.svg", "<svg"), ("closest-approach.pdf", "%PDF")] {
        let bytes = fs::read(folder.path().join("a-figures").join(file)).expect(file);
        assert!(bytes.starts_with(begins.as_bytes()), "{file}");
    }
    assert!(!folder.path().join("a-figures/encounters.png").exists());
    assert_eq!(audit(folder.path(), &["pass.csv", "--delta", "0.5", "--figures", "svg"]).exit, Some(2), "needs --html");
}

#[test]
fn every_option_of_judging_works() {
    let tower = "[[obstacle]]\nname = \"tower\"\nball = { radius_m = 1.0 }\nat_m = [0.0, -2.0, 0.0]\n";
    let folder = folder(&[("pass.csv", PASS), ("tower.toml", tower)]);
    for (arguments, exit) in [
        (&["--radius", "0.4"][..], 0),
        (&["--radius", "alpha=0.4", "--radius", "bravo=0.7"], 1),
        (&["--ellipsoid", "0.4,0.4,2"], 0),
        (&["--ellipsoid", "0.6,0.6,2"], 1),
        (&["--delta", "2", "--until", "0.4"], 0),
        (&["--delta", "2", "--from", "0.6"], 0),
        (&["--delta", "2", "--from", "0.3", "--until", "0.45"], 1),
        (&["--delta", "2", "--above", "0.5"], 1),
        (&["--delta", "2", "--above", "-0.5"], 1),
        (&["--delta", "0.5", "--ids", "alpha,bravo"], 0),
        (&["--delta", "2", "--offset", "bravo=0.5"], 1),
        (&["--delta", "0.5", "--expect-vehicles", "2"], 0),
        (&["--delta", "2", "--max-gap", "0.5"], 1),
        (&["--delta", "0.5", "--max-gap", "2"], 0),
        (&["--delta", "1", "--obstacles", "tower.toml"], 0),
        (&["--delta", "1", "--radius", "0.4", "--obstacles", "tower.toml"], 0),
        (&["--delta", "1", "--radius", "alpha=1.1", "--radius", "bravo=0", "--obstacles", "tower.toml"], 1),
    ] {
        let ran = audit(folder.path(), &[&["pass.csv"][..], arguments].concat());
        // A gap over the whole recording leaves two single samples, far apart.
        assert_eq!(ran.exit, Some(exit), "{arguments:?}: {ran:?}");
    }
}

#[test]
fn wrong_input_exits_with_2_and_a_remedy() {
    let bad = "[[obstacle]]\nname = \"tower\"\nbal = { radius_m = 1.0 }\n";
    let alone = "t,id,x,y,z\n0,a,0,0,0\n1,a,1,0,0\n";
    let files =
        [("pass.csv", PASS), ("bad.toml", bad), ("text.csv", "t,id,x,y,z\n0,a,here,0,0\n"), ("alone.csv", alone)];
    let folder = folder(&files);
    for (arguments, code) in [
        (&["pass.csv"][..], "audit/no-limit"),
        (&["pass.csv", "--delta", "0"], "audit/out-of-range"),
        (&["pass.csv", "--delta", "nan"], "audit/out-of-range"),
        (&["pass.csv", "--delta", "-1"], "audit/out-of-range"),
        (&["pass.csv", "--delta", "1", "--max-gap", "-1"], "audit/out-of-range"),
        (&["pass.csv", "--radius", "-1"], "audit/out-of-range"),
        (&["pass.csv", "--ellipsoid", "-1,1,1"], "audit/out-of-range"),
        (&["pass.csv", "--delta", "1", "--motion", "bounded", "--max-accel", "-1"], "audit/out-of-range"),
        (&["pass.csv", "--delta", "1e71"], "audit/out-of-range"),
        (&["pass.csv", "--delta", "1e-300"], "audit/out-of-range"),
        (&["pass.csv", "--delta", "1", "--events", "./pass.csv"], "files/overwrites-input"),
        (&["pass.csv", "--delta", "1", "--obstacles", "bad.toml", "--html", "bad.toml"], "files/overwrites-input"),
        (&["pass.csv", "--delta", "1", "--junit", "new.xml", "--html", "./new.xml"], "files/overwrites-input"),
        (&["pass.csv", "--delta", "1", "--ids", "zulu"], "audit/unknown-vehicle"),
        (&["pass.csv", "--delta", "1", "--radius", "zulu=1"], "audit/unknown-vehicle"),
        (&["pass.csv", "--delta", "1", "--motion", "bounded"], "audit/no-acceleration-bound"),
        (&["pass.csv", "--delta", "1", "--max-accel", "1"], "audit/unused-acceleration"),
        (&["pass.csv", "--delta", "1", "--motion", "polynomial"], "audit/no-curves"),
        (&["pass.csv", "--delta", "1", "--from", "2", "--until", "1"], "audit/empty-window"),
        (&["pass.csv", "--delta", "1", "--obstacles", "bad.toml"], "audit/obstacle-file"),
        (&["pass.csv", "--delta", "1", "--obstacles", "none.toml"], "files/cannot-read"),
        (&["pass.csv", "--ellipsoid", "1,2"], ""),
        (&["pass.csv", "--delta", "1", "--offset", "alpha"], ""),
        (&["pass.csv", "--delta", "1", "--offset", "alpha=1", "--offset", "alpha=2"], "usage/twice"),
        (&["pass.csv", "--radius", "0.1", "--radius", "0.2"], "usage/twice"),
        (&["none.csv", "--delta", "1"], "recording/not-found"),
        (&["text.csv", "--delta", "1"], "recording/not-a-number"),
        (&["pass.csv", "--delta", "2", "--ids", "alpha"], "audit/nothing-to-judge"),
        (&["alone.csv", "--delta", "2"], "audit/nothing-to-judge"),
        (&["alone.csv", "--delta", "2", "--allow-undecided"], "audit/nothing-to-judge"),
        (&["pass.csv", "--delta", "0.5", "--from", "5"], "audit/empty-window"),
        (&["pass.csv", "--delta", "0.5", "--expect-vehicles", "3"], "audit/vehicle-count"),
        (&["alone.csv", "--delta", "0.5", "--expect-vehicles", "2"], "audit/vehicle-count"),
    ] {
        let ran = audit(folder.path(), arguments);
        // Values that clap refuses have no code.
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{arguments:?}: {ran:?}");
        assert_eq!(ran.out, "", "{arguments:?}");
    }
}

#[test]
fn messages_name_the_option_and_the_known_names() {
    let folder = folder(&[("pass.csv", PASS)]);
    for (arguments, message, help) in [
        (&["--delta", "-1"][..], "--delta: must be a finite number above 0, got -1.0", "give --delta NUMBER"),
        (&["--radius", "alpha=-1"], "--radius: must be a finite number of at least 0, got alpha=-1.0", "NAME=NUMBER"),
        (&["--delta", "1", "--above", "nan"], "--above: must be a finite number, got NaN", "give --above NUMBER"),
        (
            &["--delta", "1", "--motion", "bounded", "--max-accel", "zulu=1"],
            "the recording has no vehicle zulu; it has alpha, bravo",
            "the names of the recording",
        ),
        (
            &["--delta", "1", "--motion", "hold", "--limit", "accel=2"],
            "the limit of accel needs continuous motion; with motion hold, vehicles jump from sample to sample",
            "give --motion linear",
        ),
    ] {
        let ran = audit(folder.path(), &[&["pass.csv"], arguments].concat());
        let said = ran.err.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains(message) && said.contains(help), "{ran:?}");
    }
    let missing = audit(folder.path(), &["none.csv", "--delta", "1"]);
    assert!(missing.err.contains("none.csv: cannot read the file: "), "{missing:?}");
    let layout = audit(folder.path(), &["pass.csv", "--delta", "1", "--layout", "x,y"]);
    assert!(layout.err.contains("must be one of `time,vehicle,axis`, "), "{layout:?}");
    let high = audit(folder.path(), &["pass.csv", "--delta", "1", "--above", "100"]);
    let expected = "UNDECIDED: no two vehicles are present at the same time, one of them above 100.000 m (--above)";
    assert!(high.out.starts_with(expected), "{high:?}");
}

#[test]
fn a_separation_just_above_its_limit_is_shown_above_it() {
    let apart = "t,id,x,y,z\n0,a,0,0,0\n0,b,1.5327002,0,0\n1,a,0,0,0\n1,b,1.5327002,0,0\n";
    let folder = folder(&[("apart.csv", apart)]);
    let judged = audit(folder.path(), &["apart.csv", "--delta", "1.53270015"]);
    assert!(
        judged.out.contains(": never closer than 1.5327002 m, a and b at 0.00 s (delta 1.53270015 m)"),
        "{judged:?}"
    );
}

#[test]
fn an_unwritable_file_exits_with_3() {
    let folder = folder(&[("pass.csv", PASS)]);
    let too_long = format!("{}.html", "a".repeat(300));
    let ran = audit(folder.path(), &["pass.csv", "--delta", "2", "--html", &too_long]);
    assert_eq!(ran.exit, Some(3), "{ran:?}");
    assert!(ran.out.starts_with("VIOLATION: alpha and bravo"), "the verdict is said all the same: {ran:?}");
}

#[test]
fn the_text_has_the_closest_pair_and_every_limit() {
    // Twelve pairs with radii of 0.1 m; the last two overlap, or nearly overlap.
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
    let json: Value = serde_json::from_str(&limits.out).expect("JSON alone");
    assert_eq!(*at(&json, "/question/delta"), Value::Null);
    assert_eq!(violations(&json)[0]["limit"], 10.0);
    let events = fs::read_to_string(folder.path().join("lim.ev.csv")).expect("events");
    assert!(events.contains("violation,big,too,0.0,0.0,9.0,9.0,0.0,10.0,"), "{events}");
    // The mast is closer to a vehicle than the vehicles ever are to each other, and contact with it is allowed.
    let mast = audit(folder.path(), &["pass.csv", "--delta", "0.5", "--obstacles", "mast.toml", "--html", "a.html"]);
    let said = "CLEAR if straight between samples: never closer than 0.500000 m, alpha and mast at 0.00 s";
    assert!(mast.out.starts_with(said), "{mast:?}");
    let page = fs::read_to_string(folder.path().join("a.html")).expect("a page");
    assert!(page.contains("Distances from the closest obstacles"));
    let of_alpha = ["pass.csv", "--delta", "0.5", "--ids", "alpha", "--obstacles", "mast.toml", "--html", "a.html"];
    let alone = audit(folder.path(), &of_alpha);
    assert!(alone.out.contains("1.000 s, 1 vehicle, "), "{alone:?}");
    assert!(!fs::read_to_string(folder.path().join("a.html")).expect("a page").contains("Closest pairs"));
}

#[test]
fn the_page_has_the_verdict() {
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
    assert!(doubtful.contains("closest 0.749999 .. 1.250001 m at 0.500 s") && !doubtful.contains("UNDECIDED:"));
}

#[test]
fn headline_and_keys_distinguish_proof_and_assumption() {
    let columns = |axis: &str| (0..8).map(|power| format!("{axis}^{power}")).collect::<Vec<_>>().join(",");
    let head = format!("duration,{}", ["x", "y", "z", "yaw"].map(columns).join(","));
    let curve =
        |x: &str, z: &str| format!("{head}\n1,{x},0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,{z},0,0,0,0,0,0,0,0,0,0,0,0,0,0\n");
    let folder = folder(&[("pass.csv", PASS)]);
    fs::create_dir(folder.path().join("curves")).expect("a folder");
    for (name, x, z) in [("cf1.csv", "0", "0.5,1e-18"), ("cf2.csv", "1", "0,0")] {
        fs::write(folder.path().join("curves").join(name), curve(x, z)).expect("a file");
    }
    let said = |arguments: &[&str]| {
        let ran = audit(folder.path(), &[arguments, &["--json"]].concat());
        let json: Value = serde_json::from_str(&ran.out).expect("JSON alone");
        let headline = ran.err.lines().find(|line| line.contains("CLEAR")).unwrap_or_default().to_owned();
        let facts = ["motion", "acceleration"].map(|kind| facts(&json, kind));
        let facts: Vec<_> = facts.iter().flatten().map(|fact| json!([fact["source"], fact["value"]])).collect();
        (ran.exit, headline, at(&json, "/proved").clone(), json!(facts))
    };
    let drawn = said(&["pass.csv", "--delta", "0.5"]);
    assert!(drawn.1.starts_with("CLEAR if straight between samples: "), "{drawn:?}");
    assert_eq!((drawn.0, drawn.2, drawn.3), (Some(0), false.into(), json!([["default", "straight"]])));
    let bounded = said(&["pass.csv", "--delta", "0.5", "--motion", "bounded", "--max-accel", "1"]);
    assert!(bounded.1.starts_with("PROVED CLEAR: "), "{bounded:?}");
    let bounds = json!([["declared", "bounded"], ["declared", 1.0]]);
    assert_eq!((bounded.0, bounded.2, bounded.3), (Some(0), true.into(), bounds));
    let curves = said(&["curves", "--delta", "0.5"]);
    assert!(curves.1.starts_with("PROVED CLEAR: "), "{curves:?}");
    assert_eq!((curves.0, curves.2, curves.3), (Some(0), true.into(), json!([["recorded", "curves"]])));
    let violation = said(&["pass.csv", "--delta", "2"]);
    assert_eq!((violation.0, violation.2), (Some(1), false.into()));
    // A limit is printed with all its digits.
    let digits = audit(folder.path(), &["pass.csv", "--delta", "0.9999996"]);
    assert!(
        digits.out.contains("never closer than 1.000000 m") && digits.out.contains("delta 0.9999996 m"),
        "{digits:?}"
    );
    // A rise below rounding: whether both vehicles are on the ground is unknown, and the search ends.
    let hidden = audit(folder.path(), &["curves", "--delta", "2", "--above", "0.5"]);
    assert_eq!(hidden.exit, Some(1), "{hidden:?}");
    assert!(hidden.out.starts_with("UNDECIDED: "), "{hidden:?}");
}

#[test]
fn a_gap_with_effect_has_a_remedy_and_others_change_nothing() {
    // During its gap, vehicle charlie has no other vehicle beside it: bravo has left.
    let mut rows = "t,id,x,y,z\n".to_owned();
    for t in 0..20 {
        let seen = [t < 8, t < 7, t > 9 && t != 14].into_iter().zip(["alpha", "bravo", "charlie"]).zip([0, 9, 18]);
        for ((_, name), x) in seen.filter(|((is_seen, _), _)| *is_seen) {
            let _ = writeln!(rows, "{t}.5,{name},{x},0,0");
        }
    }
    let folder = folder(&[("late.csv", &rows), ("gap.csv", &rows.replace("\n3.5,bravo,9,0,0", ""))]);
    let late = audit(folder.path(), &["late.csv", "--delta", "1", "--junit", "late.xml"]);
    assert_eq!(late.exit, Some(0), "{late:?}");
    let junit = fs::read_to_string(folder.path().join("late.xml")).expect("JUnit");
    assert!(junit.contains("failures=\"0\"") && !late.out.contains("was not seen"), "{junit} {late:?}");
    // Nothing is said of charlie, and that is said.
    assert!(late.out.contains("(delta 1.000 m); charlie is never present with another; from "), "{late:?}");
    assert!(late.err.contains("charlie, present from 10.5 s to 19.5 s, is never present with another"), "{late:?}");
    let gap = audit(folder.path(), &["gap.csv", "--delta", "1"]);
    assert_eq!(gap.exit, Some(1), "{gap:?}");
    let said = "UNDECIDED: bravo was not seen from 2.500 s to 4.500 s; --max-gap 2 would judge across (delta 1.000 m";
    assert!(gap.out.starts_with(said), "{gap:?}");
    assert_eq!(audit(folder.path(), &["gap.csv", "--delta", "1", "--max-gap", "2"]).exit, Some(0));
}

#[test]
fn the_verdict_on_a_recording_is_never_better_than_that_of_its_run() {
    // Two vehicles exchange places on a wide arc, recorded at start and end only.
    let swap = r#"
        start = { positions_m = [[-3, 0], [3, 0]], velocities_m_s = [[0, -4], [0, 4]] }
        formation = { shape = "points", points_m = [[3, 0], [-3, 0]] }
        law = { kind = "laplacian", delta_m = 1.0, f1_per_s2 = 1.0, f2_per_s = 1.0 }
        arrival = { hold_s = 20 }
        time = { duration_s = 20, record_hz = 0.05 }
        name = "swap"
    "#;
    let folder = folder(&[("swap.toml", swap)]);
    let fly = |scenario: &str, out: &str, sets: &[&str]| {
        let fixed = ["--out", out, "--no-snapshots", "--no-figures", "--quiet"];
        let sets = sets.iter().flat_map(|set| ["--set", set]);
        let arguments: Vec<_> = ["run", scenario].into_iter().chain(fixed).chain(sets).collect();
        ran_by(TAUTLINE, folder.path(), &arguments);
        let report = fs::read_to_string(folder.path().join(out).join("report.json")).expect("a report");
        let report: Value = serde_json::from_str(&report).expect("JSON");
        let recording = format!("{out}/run.mcap");
        let ran = audit(folder.path(), &[&recording, "--json"]);
        let json: Value = serde_json::from_str(&ran.out).expect("JSON");
        let [judged, flown] = [&json, &report].map(closest);
        assert_eq!(at(judged, "/value"), at(flown, "/value"), "{out}: {ran:?}");
        // With samples of every step, another of two pairs at the same distance may come first.
        let is_repeated = out != "every";
        assert!(!is_repeated || judged["subjects"] == flown["subjects"], "{out}");
        assert_eq!(at(&json, "/status"), at(&report, "/status"), "{out}");
        let [judged, flown] = [&json, &report].map(violations);
        let ended = flown.iter().filter(|found| found["to_s"].as_f64() < report["run"]["duration_s"].as_f64());
        for violation in ended {
            assert_eq!(judged.iter().filter(|found| *found == violation).count(), 1, "{out}: {violation} {judged:?}");
        }
        (ran.exit, json)
    };
    // A stiff law, so that vehicles pass each other between two samples 1 s apart.
    let stiff = ["law.f1_per_s2=30", "law.f2_per_s=1", "time.record_hz=1", "time.duration_s=20"];
    let (exit, coarse) = fly("pentagon-laplacian", "coarse", &stiff);
    assert_eq!((exit, &coarse["status"]), (Some(1), &"violation".into()));
    // Straight lines between the samples give a violation, but the run is clear.
    let (exit, apart) = fly("swap.toml", "apart", &[]);
    assert_eq!((exit, &apart["proved"], motion(&apart)), (Some(0), &true.into(), "run-audit"), "{apart}");
    ran_by(TAUTLINE, folder.path(), &["export", "apart/run.mcap", "-o", "apart.csv"]);
    let drawn = audit(folder.path(), &["apart.csv", "--delta", "1"]);
    assert!(drawn.out.starts_with("VIOLATION: 1 and 2 came to 0.000"), "{drawn:?}");
    // Every step is recorded: proved.
    let (exit, every) = fly("pentagon-laplacian", "every", &["time.duration_s=2", "time.record_hz=240"]);
    assert_eq!((exit, &every["proved"], motion(&every)), (Some(0), &true.into(), "every-step"), "{every}");
}

#[test]
fn no_output_replaces_an_input_even_with_wrong_options() {
    for (settings, asked) in [
        ("", &["--config", "missing.toml", "--junit", "in.csv"][..]),
        ("[audit]\ndelta = 1", &["--events", "tautline.toml"]),
        ("[audit]\ndelta = 1", &["--summary", "tautline.toml"]),
        ("[audit]\ndelta = 1", &["--config", "tautline.toml", "--junit", "tautline.toml"]),
        ("", &["--html", "in.csv", "--junit", "in.csv"]),
        ("", &["--radius", "1", "--radius", "2", "--summary", "in.csv"]),
    ] {
        let folder = folder(&[("in.csv", PASS)]);
        let file = folder.path().join("tautline.toml");
        if !settings.is_empty() {
            fs::write(&file, settings).expect("written");
        }
        let ran = audit(folder.path(), &[&["in.csv", "--delta", "1"], asked].concat());
        assert_eq!(ran.exit, Some(2), "{asked:?}: {ran:?}");
        assert_eq!(fs::read_to_string(folder.path().join("in.csv")).expect("there"), PASS, "{asked:?}");
        assert_eq!(fs::read_to_string(&file).unwrap_or_default(), settings, "{asked:?}");
    }
}

#[test]
fn wrong_options_are_in_the_machine_readable_files() {
    let folder = folder(&[("in.csv", PASS)]);
    let ran = audit(folder.path(), &["in.csv", "--radius", "1", "--radius", "2", "--junit", "j.xml"]);
    assert_eq!(ran.exit, Some(2), "{ran:?}");
    assert!(fs::read_to_string(folder.path().join("j.xml")).expect("a file").contains("two values"));
}

#[test]
fn decimals_exactly_at_the_limit_are_named() {
    let pair = |x: f64| format!("t_s,id,x,y,z\n0,a,0.1,0,0\n0,b,{x:?},0,0\n1,a,0.1,0,0\n1,b,{x:?},0,0\n");
    let [equal, below, clear] = [0.6, 0.599_999_999_999, 0.4].map(pair);
    let folder = folder(&[("equal.csv", &equal), ("below.csv", &below), ("clear.csv", &clear)]);
    let equal = audit(folder.path(), &["equal.csv", "--delta", "0.5"]);
    let headline = equal.out.lines().next().unwrap_or_default();
    assert!(equal.exit == Some(1) && headline.contains(", with decimals exactly at the limit"), "{equal:?}");
    let said = equal.err.split_whitespace().collect::<Vec<_>>().join(" ");
    let (note, remedy) = said.split_once("a limit of ").expect("a remedy");
    assert!(note.contains("exactly 0.5 m apart, and the doubles nearest to them are closer"), "{note}");
    let delta = remedy.split_whitespace().next().expect("a number");
    assert_eq!(audit(folder.path(), &["equal.csv", "--delta", delta]).exit, Some(0), "{delta}");
    let below = audit(folder.path(), &["below.csv", "--delta", "0.5"]);
    assert!(below.exit == Some(1) && !below.out.contains("decimals") && !below.err.contains("decimals"), "{below:?}");
    assert_eq!(audit(folder.path(), &["clear.csv", "--delta", "0.3"]).exit, Some(0));
}
