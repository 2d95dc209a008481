//! Audits of recordings without heights.

use std::fs;
use std::path::Path;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::facts;

fn audit(folder: &Path, words: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, &[&["audit"], words].concat())
}

/// Two vehicles 5 m apart: without a height, with one, and on the Earth.
fn recordings() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: String| {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(path, text).expect("written");
    };
    let rows = |of: &dyn Fn(i32, f64, &str) -> String| {
        (0..10).flat_map(|t| [of(t, 0.0, "a"), of(t, 5.0, "b")]).collect::<String>()
    };
    write("flat.csv", format!("t_s,id,x,y\n{}", rows(&|t, x, id| format!("{t},{id},{x},0\n"))));
    write("high.csv", format!("t_s,id,x,y,geoaltitude\n{}", rows(&|t, x, id| format!("{t},{id},{x},0,11826\n"))));
    write("earth.csv", format!("t_s,id,lat,lon\n{}", rows(&|t, x, id| format!("{t},{id},{},8\n", 47.0 + x / 1e4))));
    write("mixed/a.csv", "t_s,x,y,z\n0,0,0,0\n1,0,0,0\n".to_owned());
    write("mixed/b.csv", "t_s,x,y\n0,0.5,0\n1,0.5,0\n".to_owned());
    let venue = |height: &str| format!("[fence]\npolygon_m = [[-9, -9], [9, -9], [9, 9], [-9, 9]]\n{height}");
    write("room.toml", venue("height_m = [0, 10]\n"));
    write("field.toml", venue(""));
    let obstacle = |shape: &str| format!("[[obstacle]]\nname = \"mast\"\n{shape}\n");
    write("ball.toml", obstacle("ball = { radius_m = 0.5 }\nat_m = [50, 0, 30]"));
    write("disc.toml", obstacle("ball = { radius_m = 0.5 }\nat_m = [50, 0, 0]"));
    folder
}

#[test]
fn limits_of_height_need_heights() {
    let folder = recordings();
    for recording in ["flat.csv", "earth.csv", "mixed"] {
        for question in [
            &["--limit", "height=120"][..],
            &["--limit", "floor=0"],
            &["--limit", "climb=2"],
            &["--limit", "descent=2"],
            &["--limit", "speed=3,climb=2"],
            &["--fence", "room.toml"],
            &["--delta", "1", "--above", "0.5"],
            &["--delta", "1", "--obstacles", "ball.toml"],
        ] {
            let ran = audit(folder.path(), &[&[recording], question].concat());
            assert_eq!(ran.exit, Some(2), "{recording} {question:?}: {ran:?}");
            assert!(
                ran.err.contains("heights of its vehicles are unknown") && ran.err.contains("--column z="),
                "{}",
                ran.err
            );
        }
    }
    fs::write(folder.path().join("tautline.toml"), "[audit]\ndelta_m = 1.0\n[audit.limits]\nheight_m = 120.0\n")
        .expect("written");
    let asked = audit(folder.path(), &["flat.csv"]);
    assert!(asked.exit == Some(2) && asked.err.contains("tautline.toml"), "{asked:?}");
    let known = audit(folder.path(), &["high.csv"]);
    assert!(known.exit == Some(1) && known.out.contains("height of a was 11826.000 m"), "{known:?}");
    assert!(known.err.contains("heights are read from column `geoaltitude`"), "{known:?}");
}

#[test]
fn without_heights_the_plane_is_judged_with_a_note() {
    let folder = recordings();
    let in_plane = "in the plane of x and y: no heights are known";
    for question in [
        &["--delta", "1"][..],
        &["--delta", "6"],
        &["--limit", "speed=3,horizontal=3,accel=9"],
        &["--fence", "field.toml"],
        &["--delta", "1", "--obstacles", "disc.toml"],
    ] {
        let ran = audit(folder.path(), &[&["flat.csv"], question].concat());
        let said = ran.out.lines().next().unwrap_or_default().to_owned();
        assert!(ran.exit == Some(i32::from(question == ["--delta", "6"])) && said.contains(in_plane), "{ran:?}");
        let high = audit(folder.path(), &[&["high.csv"], question].concat());
        assert!(!high.out.contains(in_plane), "{high:?}");
    }
    // The height difference of 300 m is unknown for one vehicle, so it does not separate the two.
    let mixed = audit(folder.path(), &["mixed", "--delta", "1"]);
    assert!(mixed.exit == Some(1) && mixed.out.contains("came to 0.500 m"), "{mixed:?}");
    let json = audit(folder.path(), &["flat.csv", "--delta", "1", "--json"]).out;
    let report: serde_json::Value = serde_json::from_str(&json).expect("a report");
    assert_eq!(report["planar"], true);
}

#[test]
fn heights_beside_latitudes_are_assumed_in_metres_without_a_unit() {
    let folder = recordings();
    let bounded = ["--delta", "1", "--motion", "bounded", "--max-accel", "0.1"];
    for (column, is_assumed, verdict) in [
        ("alt", true, "CLEAR if accelerations of at most 0.1 m/s^2, heights are in metres: "),
        ("alt_m", false, "PROVED CLEAR: "),
    ] {
        let rows: Vec<_> = (0..10).map(|t| format!("{t},a,47,8,400\n{t},b,47.001,8,400\n")).collect();
        fs::write(folder.path().join("field.csv"), format!("t_s,id,lat,lon,{column}\n{}", rows.concat()))
            .expect("written");
        let ran = audit(folder.path(), &[&["field.csv"], &bounded[..]].concat());
        assert!(ran.exit == Some(0) && ran.out.starts_with(verdict), "{column}: {ran:?}");
        let json = audit(folder.path(), &[&["field.csv"], &bounded[..], &["--json"]].concat()).out;
        let report: serde_json::Value = serde_json::from_str(&json).expect("a report");
        assert_eq!(report["proved"], !is_assumed, "{column}");
        let by_default = facts(&report, "height-unit").into_iter().filter(|fact| fact["source"] == "default");
        assert_eq!(by_default.count(), usize::from(is_assumed), "{column}: {}", report["facts"]);
    }
}

#[test]
fn heights_above_an_unnamed_origin_are_not_judged() {
    let folder = recordings();
    let rows: Vec<_> = (0..10).map(|t| format!("{t},a,47,8,11826\n{t},b,47.001,8,11826\n")).collect();
    let rows = rows.concat();
    fs::write(folder.path().join("adsb.csv"), format!("t_s,id,lat,lon,geoaltitude\n{rows}")).expect("written");
    for question in [
        &["--limit", "height=120"][..],
        &["--limit", "floor=0"],
        &["--fence", "room.toml"],
        &["--fence", "field.toml"],
        &["--delta", "1", "--above", "0.5"],
        &["--delta", "1", "--obstacles", "ball.toml"],
    ] {
        let ran = audit(folder.path(), &[&["adsb.csv"], question].concat());
        let said = "relative to the first one, 47.0,8.0,11826.0";
        assert!(ran.exit == Some(2) && ran.err.contains(said) && ran.err.contains("--origin"), "{ran:?}");
        let asked = audit(folder.path(), &[&["adsb.csv", "--origin", "47,8,0"], question].concat());
        assert!(asked.exit.is_some_and(|exit| exit < 2), "{asked:?}");
    }
    let high = audit(folder.path(), &["adsb.csv", "--origin", "47,8,0", "--limit", "height=120"]);
    assert!(high.exit == Some(1) && high.out.contains("height of a was 11826.000 m"), "{high:?}");
    // Far from the origin z is not the height: level ground is below the tangent plane.
    let far = audit(folder.path(), &["adsb.csv", "--origin", "47.1,8,0", "--limit", "height=120"]);
    assert!(far.exit == Some(2) && far.err.contains("km from --origin"), "{far:?}");
    assert_eq!(audit(folder.path(), &["adsb.csv", "--origin", "47.1,8,0", "--delta", "1"]).exit, Some(0));
    // Differences do not depend on the origin.
    let relative = audit(folder.path(), &["adsb.csv", "--delta", "1", "--limit", "climb=2,speed=1"]);
    assert_eq!(relative.exit, Some(0), "{relative:?}");
}
