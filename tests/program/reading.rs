//! Options for reading a recording: no verdict depends on a guess.

use std::fs;

use crate::program::{Ran, TAUTLINE, ran_by};

fn audit(files: &[(&str, &str)], words: &[&str]) -> Ran {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, text).expect("written");
    }
    ran_by(TAUTLINE, folder.path(), &[&["audit"], words].concat())
}

/// Returns the exit code, and standard error in one line.
fn said(ran: &Ran) -> (Option<i32>, String) {
    let said = format!("{} {}", ran.out, ran.err);
    (ran.exit, said.split_whitespace().collect::<Vec<_>>().join(" ").replace("│ ", ""))
}

/// Two vehicles that move by `step` in each interval of time.
fn moving(step: f64, times: [&str; 3]) -> String {
    let row = |(k, t): (usize, &&str)| format!("{t},a,{},0,1\n{t},b,{},5,1\n", k as f64 * step, k as f64 * step);
    format!("t,id,x,y,z\n{}", times.iter().enumerate().map(row).collect::<String>())
}

#[test]
fn a_speed_needs_a_known_unit_of_time() {
    for times in [["0", "1", "2"], ["0.0", "10.0", "20.0"], ["0", "10", "20"]] {
        let slow = moving(0.01, times);
        for words in [&["--limit", "speed=1"][..], &["--from", "1"], &["--max-gap", "3"]] {
            let ran = audit(&[("f.csv", &slow)], &[&["f.csv", "--delta", "1"], words].concat());
            let (exit, text) = said(&ran);
            assert!(exit == Some(2) && text.contains("--time-unit s"), "{times:?} {words:?}: {text}");
        }
        // A separation does not depend on the unit of time.
        assert_eq!(audit(&[("f.csv", &slow)], &["f.csv", "--delta", "1"]).exit, Some(0), "{times:?}");
        let speeds = ["f.csv", "--limit", "speed=1", "--time-unit"];
        assert_eq!(audit(&[("f.csv", &slow)], &[&speeds[..], &["s"]].concat()).exit, Some(0), "{times:?}");
        let ms = audit(&[("f.csv", &slow)], &[&speeds[..], &["ms"]].concat()).exit;
        assert_eq!(ms, Some(i32::from(times[1] == "1")), "{times:?}: 10 m/s in steps of 1 ms, 1 m/s in steps of 10");
    }
    // Supersonic vehicles, decimals and the name of the column show that the unit is seconds.
    for (text, exit) in [
        (moving(1.0, ["0", "1", "2"]), 0),
        (moving(0.01, ["0", "0.5", "1"]), 0),
        (moving(0.01, ["0", "1", "2"]).replace("t,id", "t_s,id"), 0),
        (moving(0.3, ["0", "1", "2"]), 2),
    ] {
        assert_eq!(audit(&[("f.csv", &text)], &["f.csv", "--limit", "speed=2"]).exit, Some(exit), "{text}");
    }
}

/// A vehicle that rises by 2 m, with z down, and a static one.
const NED: &str = "t_s,id,x,y,z\n0,a,0,0,0\n0,b,5,0,0\n1,a,0,0,-2\n1,b,5,0,0\n";

#[test]
fn heights_are_along_the_upward_axis() {
    let height = ["f.csv", "--limit", "height=1"];
    for (words, exit) in [
        (&[][..], 0),
        (&["--axes", "ned"], 1),
        (&["--axes", "y,x,-z"], 1),
        (&["--scale", "1,1,-1"], 1),
        (&["--axes", "ned", "--scale", "1,1,-1"], 0),
        (&["--axes", "enu"], 0),
        (&["--axes", "nes"], 2),
        (&["--scale", "1,0,1"], 2),
        (&["--scale", "-1"], 2),
    ] {
        let ran = audit(&[("f.csv", NED)], &[&height[..], words].concat());
        assert_eq!(ran.exit, Some(exit), "{words:?}: {ran:?}");
        assert_eq!(
            ran.err.contains("axes are mapped"),
            exit != 2 && !matches!(words, [] | ["--axes", "enu"]),
            "{ran:?}"
        );
    }
    for (settings, exit) in
        [("axes = \"ned\"", 1), ("scale = [1, 1, -1]", 1), ("scale = 0.25", 0), ("axes = \"nes\"", 2)]
    {
        let settings = format!("[audit]\n{settings}\n");
        let ran = audit(&[("f.csv", NED), ("tautline.toml", &settings)], &height);
        assert_eq!(ran.exit, Some(exit), "{settings}: {ran:?}");
    }
    let settings = "[audit]\naxes = \"ned\"\n";
    let ran = audit(&[("f.csv", NED), ("tautline.toml", settings)], &[&height[..], &["--axes", "enu"]].concat());
    assert_eq!(ran.exit, Some(0), "the command line goes before the file: {ran:?}");
}

#[test]
fn unordered_and_duplicate_rows_are_read_by_options() {
    let text = "t_s,id,x,y,z\n0,a,0,0,0\n2,a,2,0,0\n1,a,1,0,0\n1,a,1,0.5,0\n0,b,0,9,0\n1,b,0,9,0\n2,b,0,9,0\n";
    for (words, exit, expected) in [
        (&[][..], 2, "recording/time-backwards"),
        (&["--sort"], 2, "recording/duplicate-row"),
        (&["--sort", "--duplicates", "first"], 0, "rows omitted"),
        (&["--sort", "--duplicates", "last"], 0, "rows omitted"),
        (&["--sort", "--duplicates", "refuse"], 2, "recording/duplicate-row"),
    ] {
        let (code, text) = said(&audit(&[("f.csv", text)], &[&["f.csv", "--delta", "1"], words].concat()));
        assert!(code == Some(exit) && text.contains(expected), "{words:?}: {text}");
    }
}

#[test]
fn incomplete_rows_and_equal_vehicles_are_read_by_options() {
    let gap = "t_s,id,x,y,alt\n0,a,0,0,5\n1,a,1,0,\n2,a,2,0,5\n0,b,0,9,5\n1,b,1,9,5\n2,b,2,9,5\n";
    let twins = "t_s,id,x,y\n0,a,0,0\n0,b,0,0\n1,a,1,0\n1,b,1,0\n2,a,2,0\n2,b,2,0\n";
    for (text, words, exit, expected) in [
        (gap, &[][..], 2, "recording/empty-cell"),
        (gap, &["--skip-incomplete"], 1, "UNDECIDED: a was not seen from 0.000 s to 2.000 s"),
        (gap, &["--skip-incomplete", "--max-gap", "2"], 0, "coordinates is empty: 1"),
        (gap, &["--skip-incomplete", "--clock", "log"], 2, "recording/unused-option"),
        (twins, &[], 2, "recording/vehicle-twice"),
        (twins, &["--distinct"], 1, "VIOLATION"),
    ] {
        let (code, text) = said(&audit(&[("f.csv", text)], &[&["f.csv", "--delta", "1"], words].concat()));
        assert!(code == Some(exit) && text.contains(expected), "{words:?}: {text}");
    }
}

#[test]
fn a_single_vehicle_is_judged_by_its_limits() {
    let text = "t_s,x,y,z,mode\n0,0,0,0,4\n1,1,0,0,4\n2,2,0,1,4\n";
    for (words, exit, expected) in [
        (&["--limit", "speed=2"][..], 2, "--one-vehicle"),
        (&["--one-vehicle", "--limit", "speed=2"], 0, "speed at most 1.415 m/s"),
        (&["--one-vehicle", "--limit", "speed=1"], 1, "VIOLATION"),
        (&["--one-vehicle", "--delta", "1"], 2, "1 vehicle to judge, but no second object"),
    ] {
        let (code, text) = said(&audit(&[("cf1.csv", text)], &[&["cf1.csv"], words].concat()));
        assert!(code == Some(exit) && text.contains(expected), "{words:?}: {text}");
    }
}

#[test]
fn the_common_window_of_clocks_is_in_the_verdict() {
    let px4 = |lat: &str| {
        let rows = ["1000000", "1020000"].map(|t| format!("{t},0,0,-10,{lat},8,400\n")).concat();
        format!("timestamp,x,y,z,ref_lat,ref_lon,ref_alt\n{rows}")
    };
    let (a, b) = (px4("47"), px4("47.001"));
    let files = [("f/a.csv", a.as_str()), ("f/b.csv", b.as_str())];
    let (code, text) = said(&audit(&files, &["f", "--delta", "1", "--origin", "47,8,400"]));
    assert!(code == Some(0) && text.contains("the clocks of all vehicles started together"), "{text}");
    assert!(text.contains("never closer than 111."), "{text}");
    let (code, text) = said(&audit(&files, &["f", "--delta", "1"]));
    assert!(code == Some(2) && text.contains("--origin 47.0,8.0,400.0"), "{text}");
}

#[test]
fn positions_of_several_frames_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let table = |frames: [&str; 2]| {
        let rows = (0..3).flat_map(|t| frames.map(|frame| (t, frame)).into_iter().zip([("a", 0), ("b", 3)]));
        let rows = rows.map(|((t, frame), (id, x))| format!("{t},{frame},{id},{x},0,5\n"));
        "t,header.frame_id,id,pose.position.x,pose.position.y,pose.position.z\n".to_owned() + &rows.collect::<String>()
    };
    let audit = |frames| {
        std::fs::write(folder.path().join("poses.csv"), table(frames)).expect("a table");
        ran_by(TAUTLINE, folder.path(), &["audit", "poses.csv", "--delta", "0.5", "--time-unit", "s"])
    };
    let two = audit(["a/odom", "b/odom"]);
    assert_eq!((two.exit, two.code()), (Some(2), "recording/several-frames"), "{}", two.err);
    // Negative twins: one frame, and numbers of pictures.
    for frames in [["map", "/map"], ["1", "2"]] {
        let one = audit(frames);
        assert_eq!(one.exit, Some(0), "{frames:?}: {}{}", one.out, one.err);
    }
}

#[test]
fn integers_that_a_double_does_not_hold_name_no_vehicle() {
    let folder = tempfile::tempdir().expect("a folder");
    let audit = |ids: [&str; 2]| {
        let rows = (0..4).flat_map(|t| [(t, ids[0], "0"), (t, ids[1], "0.05")]);
        let rows = rows.map(|(t, id, x)| format!("{{\"t\":{t},\"id\":{id},\"x\":{x},\"y\":0,\"z\":5}}\n"));
        std::fs::write(folder.path().join("ids.jsonl"), rows.collect::<String>()).expect("a table");
        ran_by(TAUTLINE, folder.path(), &["audit", "ids.jsonl", "--delta", "0.5", "--time-unit", "s"])
    };
    let merged = audit(["18446744073709551616", "18446744073709551617"]);
    assert_eq!((merged.exit, merged.code()), (Some(2), "recording/element-type"), "{}", merged.err);
    let told_apart = audit(["18446744073709551614", "18446744073709551615"]);
    assert_eq!(told_apart.exit, Some(1), "they are 0.05 m apart: {}{}", told_apart.out, told_apart.err);
}
