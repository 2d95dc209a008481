//! `tautline export --format` as a process: what drones hold is judged, and refused files leave nothing behind.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::program::{Ran, TAUTLINE, ran_by};

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

fn said(ran: &Ran) -> String {
    let words = |text: &str| text.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ");
    words(&ran.out) + " " + &words(&ran.err)
}

/// Returns a table of two vehicles that circle 2 m apart at 0.6 m/s for 8 s, 25 samples a second.
fn circles() -> String {
    let mut text = "t,id,x,y,z\n".to_owned();
    for k in 0..=200 {
        let t = f64::from(k) / 25.0;
        for (name, phase) in [("a", 0.0), ("b", 0.5)] {
            let (sin, cos) = (TAU * (t / 10.0 + phase)).sin_cos();
            let _ = writeln!(text, "{t},{name},{cos},{sin},{}", 1.0 + 0.05 * t);
        }
    }
    text
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("flight.csv"), circles()).expect("written");
    folder
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<_> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Returns the number that follows a word of the answer.
fn number(text: &str, word: &str) -> f64 {
    let after = text.split(word).nth(1).unwrap_or_else(|| panic!("no `{word}` in {text}"));
    let found = after.split_whitespace().find_map(|word| word.parse().ok());
    found.unwrap_or_else(|| panic!("no number after `{word}` in {text}"))
}

#[test]
fn every_dialect_is_judged_and_audited_again() {
    let folder = folder();
    for (to, output, more, files, verdict) in [
        ("crazyflie", "cf", &[][..], vec!["a.csv", "b.csv"], "PROVED CLEAR"),
        ("crazyflie", "cft", &["--compressed"], vec!["a.traj", "b.traj"], "PROVED CLEAR"),
        ("skyb", "sky", &[], vec!["a.skyb", "b.skyb"], "PROVED CLEAR"),
        ("skyb", "sky1", &["--skyb-version", "1"], vec!["a.skyb", "b.skyb"], "PROVED CLEAR"),
        ("skyc", "show.skyc", &[], vec![], "PROVED CLEAR"),
    ] {
        let arguments = ["export", "flight.csv", "--format", to, "-o", output, "--delta", "1.5"];
        let done = ran(folder.path(), &[&arguments[..], more].concat());
        let text = said(&done);
        assert_eq!(done.exit, Some(0), "{to}: {text}");
        assert!(text.contains(verdict), "{to}: {text}");
        // 2 m between the centres, less the deviations.
        let (margin, deviation) = (number(&text, "margin"), number(&text, "at most"));
        assert!(deviation > 0.0 && deviation <= 0.01, "{to}: {text}");
        assert!(margin <= 0.5 + 1e-6 && margin >= 0.5 - 2.0 * deviation - 0.01, "{to}: {text}");
        if !files.is_empty() {
            assert_eq!(names(&folder.path().join(output)), files, "{to}");
        }
        let again = ran(folder.path(), &["audit", output, "--delta", "1.5"]);
        assert_eq!(again.exit, Some(0), "{to}: {}", said(&again));
        let closer = ran(folder.path(), &["audit", output, "--delta", "2.05"]);
        assert_eq!(closer.exit, Some(1), "{to}: {}", said(&closer));
    }
    assert!(names(folder.path()).iter().all(|name| !name.starts_with('.')), "{:?}", names(folder.path()));
}

#[test]
fn violations_are_refused_and_leave_nothing() {
    let folder = folder();
    // Vehicle a passes b at 1 m and turns at a right angle. A loose curve bulges towards b before the turn.
    let mut corner = "t,id,x,y,z\n".to_owned();
    for k in 0..=80 {
        let t = f64::from(k) / 10.0;
        let _ = writeln!(corner, "{t},a,{},{},1\n{t},b,3,-1,1", t.min(4.0), (t - 4.0).max(0.0));
    }
    fs::write(folder.path().join("corner.csv"), corner).expect("written");
    let before = names(folder.path());
    for (delta, tolerance, words) in [
        ("1.5", "0.01", "the flight itself is not clear"),
        ("0.99", "0.3", "the flight is clear, but not the written motion"),
    ] {
        let arguments = ["export", "corner.csv", "--format", "crazyflie", "-o", "cf"];
        let refused = ran(folder.path(), &[&arguments[..], &["--delta", delta, "--tolerance", tolerance]].concat());
        assert_eq!(refused.exit, Some(1), "{}", said(&refused));
        assert_eq!(refused.code(), "export/violation");
        for word in [words, "VIOLATION", "a and b", "--tolerance"].iter().take(if delta == "1.5" { 3 } else { 4 }) {
            assert!(said(&refused).contains(word), "no {word}: {}", said(&refused));
        }
        assert_eq!(names(folder.path()), before);
    }
}

#[test]
fn wrong_input_ends_with_2_and_leaves_nothing() {
    let folder = folder();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("written");
    let rows = |keep: &dyn Fn(f64, &str) -> bool| {
        let text = circles();
        let kept = text.lines().filter(|line| {
            let mut cells = line.split(',');
            let (time, name) = (cells.next().unwrap_or_default(), cells.next().unwrap_or_default());
            time.parse().map_or(true, |time| keep(time, name))
        });
        kept.flat_map(|line| [line, "\n"]).collect::<String>()
    };
    write("late.csv", &rows(&|t, name| name == "a" || t >= 2.0));
    write("gap.csv", &rows(&|t, name| name == "a" || !(3.0..5.0).contains(&t)));
    // Replaces x in the rows of a vehicle at a time, or at all times.
    let with_x = |of: &str, x: &str| {
        let row = |line: &str| match line.split(',').collect::<Vec<_>>()[..] {
            [time, name, _, y, z] if line.starts_with(of) || of == name => format!("{time},{name},{x},{y},{z}\n"),
            _ => format!("{line}\n"),
        };
        circles().lines().map(row).collect::<String>()
    };
    write("nan.csv", &with_x("4,a,", "nan"));
    write("far.csv", &with_x("b", "90"));
    // Vehicle a jumps by 2 m after 1 s.
    fs::create_dir(folder.path().join("jump")).expect("a folder");
    write("jump/a.csv", "duration,x^0,y^0,z^0\n1,0,0,1\n1,2,0,1\n");
    write("jump/b.csv", "duration,x^0,y^0,z^0\n2,9,0,1\n");
    write("flat.csv", "t,id,x,y\n0,a,0,0\n0,b,3,0\n1,a,0,1\n1,b,3,1\n");
    write("two.csv", "t,id,x,y,z\n0,ä,0,0,0\n0,b,3,0,0\n1,ä,0,1,0\n1,b,3,1,0\n");
    write("steps.csv", "t,id,x,y,z\n0,a,0,0,1\n0,b,9,0,1\n10,a,2,0,1\n10,b,9,2,1\n20,a,4,0,1\n20,b,9,4,1\n");
    write("point.csv", &rows(&|t, name| name == "a" || t == 0.0));
    write("wide.csv", "t,a_x,a_y,a_z,b_x,b_y,b_z\n0.5,0,0,1,,,\n1.5,1,0,1,,,\n2.5,2,0,1,,,\n");
    write("distant.csv", "t,id,x,y,z\n0.5,a,1e6,0,0\n0.5,b,1e6,3,0\n1.5,a,1e6,0,1\n1.5,b,1e6,3,1\n");
    fs::create_dir(folder.path().join("full")).expect("a folder");
    write("full/notes.md", "mine");
    let before = names(folder.path());
    for (input, to, more, code, words) in [
        ("late.csv", "crazyflie", &[][..], "export/absent", ["vehicle b", "--from 2.0 --until 8.0"]),
        ("gap.csv", "skyb", &[], "export/gap", ["vehicle b", "2.96 s to 5.0 s"]),
        ("nan.csv", "skyb", &[], "recording/not-finite", ["nan.csv, line 202", "column `x`"]),
        ("far.csv", "crazyflie", &["--compressed"], "export/too-far", ["vehicle b", "32.767 m"]),
        ("jump", "skyc", &[], "export/too-fast", ["vehicle a at ", "--tolerance"]),
        ("flat.csv", "skyc", &[], "export/no-heights", ["no heights", "--column z=NAME"]),
        ("two.csv", "crazyflie", &[], "export/name", ["no file name", "rename"]),
        ("flight.csv", "crazyflie", &["--tolerance", "0.00005"], "export/too-long", ["4096 bytes", "--compressed"]),
        ("flight.csv", "skyb", &["--tolerance", "0.001"], "export/tolerance", ["rounds positions", "--tolerance"]),
        ("flight.csv", "skyb", &["--tolerance", "-1"], "export/tolerance", ["--tolerance", "-1"]),
        ("flight.csv", "skyb", &["--skyb-version", "3"], "export/skyb-version", ["must be 1 or 2", "3"]),
        ("flight.csv", "skyc", &["--compressed"], "export/unused-option", ["--compressed", "crazyflie"]),
        ("flight.csv", "skyc", &["--sample-hz", "10"], "export/unused-option", ["--sample-hz", "--format csv"]),
        ("flight.csv", "skyb", &["--from", "20"], "export/window", ["--from: no vehicle", "0.0 s to 8.0 s"]),
        ("flight.csv", "skyb", &["--until", "-2"], "export/window", ["--until: no vehicle", "0.0 s to 8.0 s"]),
        ("flight.csv", "skyb", &["--until", "nan"], "export/window", ["--until: must be a finite", "got NaN"]),
        (
            "flight.csv",
            "skyb",
            &["--from", "5", "--until", "3"],
            "export/window",
            ["--until: must be", "3.0 s and 5.0 s"],
        ),
        ("steps.csv", "crazyflie", &[], "audit/guessed-time-unit", ["an export for drones", "--time-unit ms"]),
        ("wide.csv", "skyb", &[], "export/absent", ["vehicle b: it is not seen at any time", "leave the vehicle out"]),
        (
            "late.csv",
            "skyb",
            &["--until", "1"],
            "export/absent",
            ["b: it is not seen in the exported", "export a part"],
        ),
        ("point.csv", "skyb", &[], "export/absent", ["vehicle b", "absent for a part"]),
        ("distant.csv", "crazyflie", &[], "export/tolerance", ["rounds positions", "origin"]),
    ] {
        let output = if to == "skyc" { "show" } else { "out" };
        let arguments = [&["export", input, "--format", to, "-o", output, "--delta", "0.5"], more].concat();
        let refused = ran(folder.path(), &arguments);
        assert_eq!((refused.exit, refused.code()), (Some(2), code), "{arguments:?}: {}", said(&refused));
        for word in words {
            assert!(said(&refused).contains(word), "{arguments:?}: {}\ninstead of {word}", said(&refused));
        }
        assert_eq!(names(folder.path()), before, "{arguments:?}");
    }
    // No parent is made.
    let deep = ran(folder.path(), &["export", "flight.csv", "--format", "skyb", "-o", "new/x/y", "--delta", "1"]);
    assert_eq!((deep.exit, deep.code()), (Some(2), "files/no-folder"), "{}", said(&deep));
    assert_eq!(names(folder.path()), before);
    let unknown = ran(folder.path(), &["export", "flight.csv", "--format", "foo", "-o", "out"]);
    assert_eq!(unknown.exit, Some(2));
    assert!(said(&unknown).contains("crazyflie, skyb, skyc"), "{}", said(&unknown));
    let kept = ["export", "flight.csv", "--format", "skyb", "-o", "full", "--delta", "1", "--force"];
    assert_eq!(ran(folder.path(), &kept).code(), "files/exists");
    assert_eq!(fs::read_to_string(folder.path().join("full/notes.md")).expect("read"), "mine");
}

#[test]
fn a_part_of_a_flight_counts_from_its_start() {
    let folder = folder();
    let part = ["--from", "1.5", "--until", "4.25", "--delta", "1"];
    let arguments = [&["export", "flight.csv", "--format", "skyc", "-o", "part.skyc"][..], &part].concat();
    let done = ran(folder.path(), &arguments);
    assert_eq!(done.exit, Some(0), "{}", said(&done));
    assert!(said(&done).contains("1.500 s to 4.250 s; 1.5 s of the flight are 0 s of the files"), "{}", said(&done));
    let again = ran(folder.path(), &["audit", "part.skyc", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&again.out).expect("JSON alone");
    assert_eq!(report["question"]["delta"], 1.0, "{report}");
    assert_eq!(report["window_s"], serde_json::json!([0.0, 2.75]), "{report}");
    // An existing output needs --force, and is replaced as a whole.
    assert_eq!(ran(folder.path(), &arguments).code(), "files/exists");
    assert_eq!(ran(folder.path(), &[&arguments[..], &["--force", "--quiet"]].concat()).exit, Some(0));
    let into = |name: &str, to: &str, more: &[&str]| {
        ran(folder.path(), &[&["export", "flight.csv", "--format", to, "-o", name, "--delta", "1"], more].concat())
    };
    assert_eq!(into("out", "crazyflie", &[]).exit, Some(0));
    assert_eq!(into("out", "skyb", &[]).code(), "files/exists");
    assert_eq!(into("out", "skyb", &["--force"]).exit, Some(0));
    assert_eq!(names(&folder.path().join("out")), ["a.skyb", "b.skyb"]);
}

#[test]
fn one_vehicle_is_written_and_not_judged() {
    let folder = folder();
    let one: String = circles().lines().filter(|line| !line.contains(",b,")).flat_map(|line| [line, "\n"]).collect();
    fs::write(folder.path().join("one.csv"), one).expect("written");
    let done = ran(folder.path(), &["export", "one.csv", "--format", "crazyflie", "-o", "one"]);
    assert_eq!(done.exit, Some(0), "{}", said(&done));
    assert!(
        said(&done).contains("not judged: there is one vehicle") && !said(&done).contains("CLEAR"),
        "{}",
        said(&done)
    );
    let two = ran(folder.path(), &["export", "flight.csv", "--format", "crazyflie", "-o", "two"]);
    assert_eq!((two.exit, two.code()), (Some(2), "audit/no-limit"), "{}", said(&two));
    assert!(said(&two).contains("give --delta or --ellipsoid") && !said(&two).contains("--fence"), "{}", said(&two));
}

#[test]
fn obstacles_move_with_the_exported_part() {
    let folder = folder();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("written");
    // The vehicle is at x = t. The ball crosses its path at x = 7 m.
    write("line.csv", "t,id,x,y,z\n0.5,a,0.5,0,1\n9.5,a,9.5,0,1\n");
    let ball = |crossing_s: f64| {
        let (from_s, to_s) = (crossing_s - 2.0, crossing_s + 2.0);
        format!(
            "[[obstacle]]\nname = \"ball\"\nball = {{ radius_m = 0.3 }}\nclearance_m = 0.3\n\
             path = [[{from_s}, 7.0, -20.0, 1.0], [{to_s}, 7.0, 20.0, 1.0]]\n"
        )
    };
    let exported = |crossing_s: f64, output: &str| {
        write("ball.toml", &ball(crossing_s));
        let arguments = ["export", "line.csv", "--format", "skyc", "-o", output, "--obstacles", "ball.toml"];
        ran(folder.path(), &[&arguments[..], &["--delta", "0.5", "--from", "4.5"]].concat())
    };
    // It crosses at 2.5 s, which is 7 s of the flight in times of the files.
    let clear = exported(2.5, "clear.skyc");
    assert_eq!(clear.exit, Some(0), "{}", said(&clear));
    assert!(said(&clear).contains("times and names of the files"), "{}", said(&clear));
    // It meets the vehicle at 7 s.
    let hit = exported(7.0, "hit.skyc");
    assert_eq!((hit.exit, hit.code()), (Some(1), "export/violation"), "{}", said(&hit));
    assert!(said(&hit).contains("the flight itself"), "{}", said(&hit));
    // Without the shift, the file would be at x = 7 m at 2.5 s, and its distance to this ball would be 0 m.
    let margin = number(&said(&clear), "margin");
    assert!(margin > 1.0, "{}", said(&clear));
}

#[test]
fn force_keeps_the_input_and_files_of_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let data = folder.path().join("data");
    fs::create_dir(&data).expect("a folder");
    fs::write(data.join("ok.csv"), circles()).expect("written");
    let export = |input: &str, output: &str| {
        ran(folder.path(), &["export", input, "--format", "skyb", "-o", output, "--force", "--delta", "1"])
    };
    let refused = export("data/ok.csv", "data");
    assert_eq!(refused.exit, Some(2), "{}", said(&refused));
    assert_eq!(names(&data), ["ok.csv"]);
    // An input between files of an export.
    fs::write(folder.path().join("flight.csv"), circles()).expect("written");
    let cf = ["export", "flight.csv", "--format", "crazyflie", "-o", "cf", "--delta", "1"];
    assert_eq!(ran(folder.path(), &cf).exit, Some(0));
    let inside = export("cf/a.csv", "cf");
    assert_eq!((inside.exit, inside.code()), (Some(2), "files/overwrites-input"), "{}", said(&inside));
    assert_eq!(names(&folder.path().join("cf")), ["a.csv", "b.csv"]);
    // Files with the extension of an export, but other content.
    for (name, text) in [("mine.csv", "t,x,y\n"), ("mine.skyb", "other"), ("mine.traj", "1 2 3")] {
        fs::write(folder.path().join("cf").join(name), text).expect("written");
        let foreign = export("flight.csv", "cf");
        assert_eq!((foreign.exit, foreign.code()), (Some(2), "files/exists"), "{}", said(&foreign));
        assert_eq!(names(&folder.path().join("cf")), ["a.csv", "b.csv", name]);
        fs::remove_file(folder.path().join("cf").join(name)).expect("removed");
    }
    assert_eq!(export("flight.csv", "cf").exit, Some(0));
    assert_eq!(names(&folder.path().join("cf")), ["a.skyb", "b.skyb"]);
}
