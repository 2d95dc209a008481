//! Shapes of formations.

use std::fs;
use std::path::Path;

use crate::program::{Ran, TAUTLINE, ran_by};
use serde_json::Value;

/// Fourteen vehicles on a grid, with slots along given directions.
const FRAME: &str = r#"[swarm]
count = 14
[start]
shape = "grid"
spacing_m = 4.0
[law]
kind = "displacement"
delta_m = 2.0
[time]
duration_s = 60.0
[formation]
assignment = "optimal"
"#;

const LOGO: &str = "<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'><path d='M 0 0 H 9 L 4 7 Z'/></svg>";

/// Returns a folder with a scenario in a folder below it, and its files beside that folder.
fn folder(formation: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let below = folder.path().join("below");
    fs::create_dir(&below).expect("a folder");
    let write = |name: &str, bytes: &[u8]| fs::write(below.join(name), bytes).expect("a file");
    write("show.toml", format!("{FRAME}{formation}").as_bytes());
    write("logo.svg", LOGO.as_bytes());
    write("points.csv", (0..14).map(|i| format!("{},0", 3 * i)).collect::<Vec<_>>().join("\n").as_bytes());
    write("mask.png", &mask());
    folder
}

/// Returns a picture with a dark bar on white.
fn mask() -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 40, 8);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    let pixels: Vec<u8> = (0..320).map(|place| if (2..6).contains(&(place / 40)) { 0 } else { 255 }).collect();
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(&pixels).expect("pixels");
    writer.finish().expect("an end");
    bytes
}

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

#[test]
fn every_shape_is_a_formation() {
    for formation in [
        "shape = \"v\"",
        "shape = \"wedge\"\nspacing_m = 4",
        "shape = \"rings\"",
        "shape = \"helix\"\nradius_m = 8\npitch_m = 8",
        "shape = \"cube\"",
        "shape = \"text\"\ntext = \"HI\"\nheight_m = 30",
        "shape = \"svg\"\npath = \"M 0 0 L 9 0 L 4 7 Z\"",
        "shape = \"svg\"\nfile = \"logo.svg\"\nfilled = true\nwidth_m = 40",
        "shape = \"image\"\nfile = \"mask.png\"",
        "shape = \"file\"\nfile = \"points.csv\"",
    ] {
        let folder = folder(formation);
        let Ran { exit, out, err } = ran(folder.path(), &["check", "below/show.toml", "--json"]);
        let found: Value = serde_json::from_str(&out).expect(&err);
        assert_eq!(exit, Some(0), "{formation}: {out}");
        assert!(found["certified_m"].as_f64().is_some_and(|certified_m| certified_m > 2.0), "{formation}: {out}");
    }
}

#[test]
fn letters_named_on_the_command_line_are_flown() {
    let folder = tempfile::tempdir().expect("a folder");
    let sets = [
        "law.kind=displacement",
        "swarm.count=14",
        "start={shape=\"grid\", spacing_m=2}",
        "formation.shape=text",
        "formation.text=HI",
        "formation.assignment=optimal",
    ];
    let sets = sets.iter().flat_map(|set| ["--set", set]);
    let arguments: Vec<_> =
        ["run", "circle", "--no-figures", "--no-snapshots", "--json"].into_iter().chain(sets).collect();
    let Ran { exit, out, err } = ran(folder.path(), &arguments);
    assert_eq!(exit, Some(0), "{out}{err}");
    let shown = ran(folder.path(), &["list", "--show", "out/circle/run.mcap"]);
    assert!(shown.out.contains("shape = \"points\"\npoints_m = [") && !shown.out.contains("text"), "{}", shown.out);
}

#[test]
fn wrong_formations_are_refused_with_place_and_remedy() {
    let at = |key: usize| format!("show.toml:{}:", 12 + key);
    for (formation, code, place) in [
        ("shape = \"text\"\ntext = \"HI\"\nheight_m = 3", "scenario/within-delta", at(3)),
        ("shape = \"svg\"\nfile = \"mask.png\"", "scenario/shape", at(2)),
        ("shape = \"svg\"\nfile = \"none.svg\"", "scenario/file", at(2)),
        ("shape = \"image\"\nfile = \"logo.svg\"", "scenario/shape", at(2)),
        ("shape = \"image\"\nfile = \"mask.png\"\nink = \"opaque\"\nwidth_m = 1", "scenario/within-delta", at(4)),
        ("shape = \"file\"\nfile = \"logo.svg\"", "scenario/file", at(2)),
        ("shape = \"file\"\nfile = \"few.csv\"", "scenario/count-mismatch", at(2)),
    ] {
        let folder = folder(formation);
        fs::write(folder.path().join("below/few.csv"), "0,0\n9,9\n").expect("a file");
        let ran = ran(folder.path(), &["run", "below/show.toml"]);
        assert_eq!((ran.exit, ran.out.as_str(), ran.code()), (Some(2), "", code), "{formation}: {}", ran.err);
        let err = ran.err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" ");
        assert!(err.contains("help:") && err.contains(&place), "{place}: {err}");
        assert!(!folder.path().join("out").exists(), "nothing is written");
    }
}
