//! Shapes of formations: their slots, the location of their files, and their errors.

use std::fs;
use std::path::Path;

use tautline_sim::scenario::{Override, Scenario, ScenarioError, Source, Space};

/// Fifty vehicles on a grid; the keys of the formation follow.
const FRAME: &str = r#"name = "shape"
[start]
shape = "grid"
spacing_m = 4.0
[law]
kind = "displacement"
delta_m = 2.0
[time]
duration_s = 1.0
[swarm]
count = 50
[formation]
"#;
/// Line of the first key of the formation.
const LINE: usize = 13;

const SPACING_ROUNDING: f64 = 1e-9;

fn read(formation: &str) -> Result<Scenario, ScenarioError> {
    Scenario::read(&Source::Text { name: "test.toml".to_owned(), text: format!("{FRAME}{formation}") }, &[])
}

fn nearest_m(scenario: &Scenario) -> f64 {
    scenario.formation().min_distance().expect("slots").1
}

/// Returns the extent of the slots along an axis.
fn extent_m(scenario: &Scenario, axis: usize) -> f64 {
    let along = scenario.formation().slots_m.column(axis).clone_owned();
    along.max() - along.min()
}

#[test]
fn every_shape_has_the_given_spacing_or_one_and_a_half_delta() {
    let flat = [
        "\"v\"",
        "\"v\"\nangle_deg = 60",
        "\"wedge\"",
        "\"rings\"",
        "\"text\"\ntext = \"HI\"",
        "\"svg\"\npath = \"M 0 0 L 9 0 L 4 7 Z\"",
    ];
    let high = ["\"helix\"\nradius_m = 9\npitch_m = 6.5", "\"cube\""];
    for (shape, space) in
        flat.map(|shape| (shape, Space::Plane)).into_iter().chain(high.map(|shape| (shape, Space::Volume)))
    {
        for (asked, spacing_m) in [("", 3.0), ("spacing_m = 5", 5.0)] {
            let shape = format!("shape = {shape}\n{asked}");
            if shape.contains("6.5") && spacing_m > 3.0 {
                continue;
            }
            let scenario = read(&shape).expect(&shape);
            assert_eq!((scenario.count(), scenario.space), (50, space), "{shape}");
            let off = nearest_m(&scenario) / spacing_m - 1.0;
            assert!(off.abs() < SPACING_ROUNDING, "{shape}: {off:e}");
            let resolved = scenario.resolved().toml;
            assert!(resolved.contains("shape = \"points\""), "{resolved}");
            let again = Scenario::read(&Source::Text { name: "again".to_owned(), text: resolved }, &[]);
            assert_eq!(again.as_ref(), Ok(&scenario), "{shape}");
        }
    }
    let turns = read("shape = \"helix\"\nradius_m = 30\npitch_m = 9\nturns = 3").expect("a helix");
    assert!((extent_m(&turns, 2) - 27.0).abs() < SPACING_ROUNDING);
}

#[test]
fn a_drawing_has_the_given_height_or_width() {
    // Slots lie slightly inside the drawing.
    for (asked, axis) in [("height_m = 80", 1), ("width_m = 80", 0)] {
        let scenario = read(&format!("shape = \"text\"\ntext = \"TAUT\"\n{asked}")).expect(asked);
        assert!((70.0..=80.0).contains(&extent_m(&scenario, axis)), "{}", extent_m(&scenario, axis));
    }
    let line = read("shape = \"svg\"\npath = \"M 5 5 h 9\"\nwidth_m = 500").expect("a line");
    assert!((nearest_m(&line) - 10.0).abs() < 1e-6 && extent_m(&line, 1) == 0.0);
}

#[test]
fn the_least_height_of_a_refusal_is_sufficient_and_tight() {
    let of = |height_m: f64| read(&format!("shape = \"text\"\ntext = \"HELLO\"\nheight_m = {height_m}"));
    let error = of(3.0).expect_err("too small");
    assert!(error.message.starts_with("in a drawing 3 m high, 50 vehicles come as near as 0."), "{error}");
    assert_eq!(error.place.as_ref().map(|place| place.line), Some(LINE + 2));
    let help = &error.help;
    let named = help.strip_prefix("set formation.height_m to at least ").and_then(|rest| rest.split(' ').next());
    let least_m: f64 = named.expect(help).parse().expect(help);
    assert!((2.0..2.01).contains(&nearest_m(&of(least_m).expect("enough"))), "{help}");
    assert!(of(0.999 * least_m).is_err());
}

#[test]
fn files_are_relative_to_the_scenario() {
    let folder = tempfile::tempdir().expect("a folder");
    let below = folder.path().join("below");
    fs::create_dir(&below).expect("a folder");
    let save = |name: &str, text: &str| fs::write(below.join(name), text).expect("a file");
    save(
        "ring.svg",
        "<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'><circle cx='4' cy='4' r='4'/></svg>",
    );
    let points: Vec<String> = (0..50).map(|i| format!("{},0,{}", 3 * i, i % 2)).collect();
    save("points.csv", &points.join("\n"));
    let read = |formation: &str, sets: &[&str]| {
        let file = below.join("scenario.toml");
        fs::write(&file, format!("{FRAME}{formation}")).expect("a file");
        let sets: Vec<_> = sets.iter().map(|set| Override::parse(set).expect("an override")).collect();
        Scenario::read(&Source::File(file), &sets)
    };
    let ring = read("shape = \"svg\"\nfile = \"ring.svg\"\nheight_m = 60", &[]).expect("a ring");
    assert!((extent_m(&ring, 1) - 60.0).abs() < 0.5);
    let high = read("shape = \"file\"\nfile = \"points.csv\"", &[]).expect("points");
    assert_eq!(
        (high.space, high.formation().slots_m[(49, 0)], high.formation().slots_m[(49, 2)]),
        (Space::Volume, 147.0, 1.0)
    );
    let set = read("shape = \"line\"\nspacing_m = 7", &["formation.shape=svg", "formation.file=\"ring.svg\""])
        .expect("a ring");
    assert!((nearest_m(&set) - 7.0).abs() < SPACING_ROUNDING);
    let elsewhere = read("shape = \"file\"\nfile = \"../points.csv\"", &[]).expect_err("it is below");
    assert!(elsewhere.code() == "scenario/file" && !elsewhere.help.is_empty(), "{elsewhere}");
    assert_eq!(elsewhere.place.as_ref().map(|place| (place.line, place.column)), Some((LINE + 1, 8)));
    let absolute = format!("shape = \"file\"\nfile = '{}'", below.join("points.csv").display());
    assert_eq!(self::read(&absolute).expect("points").legs, high.legs);
}

#[test]
fn a_file_of_points_may_name_its_columns_and_gives_the_number_of_vehicles() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("points");
    let read = |points: &str| {
        fs::write(&file, points).expect("a file");
        let text = FRAME.replace("count = 50", "") + &format!("shape = \"file\"\nfile = '{}'", file.display());
        let text = text.replace("spacing_m = 4.0", "spacing_m = 9.0");
        Scenario::read(&Source::Text { name: "test.toml".to_owned(), text }, &[])
    };
    let plain = read("0,0\n3,0\n0,4\n").expect("points");
    assert_eq!((plain.count(), plain.space, plain.formation().slots_m.row(2)[1]), (3, Space::Plane, 4.0));
    for same in [
        "0 0\n3\t 0\n\n 0  4",
        "# metres\n0;0;0\n3;0;0\n0;4;0\n",
        "\u{feff}id,y_m,\"x\"\r\na,0,0\r\nb,0,3\r\nc,4,0\r\n",
        "X\tY\tZ\n0\t0\t0\n3e0\t0\t0\n0\t4\t0",
    ] {
        assert_eq!(read(same).expect(same).legs, plain.legs, "{same}");
    }
    for (wrong, code) in [
        ("", "scenario/file"),
        ("x,y\n", "scenario/file"),
        ("0,0\n3,zero\n", "scenario/file"),
        ("0,0\n3\n", "scenario/file"),
        ("0,0,0,0\n", "scenario/file"),
        ("7\n8\n", "scenario/file"),
        ("0,0\n3,nan\n", "scenario/file"),
        ("0,0\n1,0\n", "scenario/within-delta"),
    ] {
        let error = read(wrong).expect_err(wrong);
        assert_eq!(error.code(), code, "{error}");
        assert!(!error.help.is_empty(), "{wrong:?}: {error}");
        assert!(error.to_string().contains(&format!("test.toml:{}:8", LINE + 1)), "{error}");
    }
}

#[test]
fn a_wrong_shape_is_refused_at_its_key() {
    let missing = Path::new("no such").join("file.png");
    let image = format!("shape = \"image\"\nfile = '{}'", missing.display());
    for (formation, code, place) in [
        ("shape = \"v\"\nangle_deg = 59", "scenario/out-of-range", (14, 13)),
        ("shape = \"v\"\nangle_deg = nan", "scenario/out-of-range", (14, 13)),
        ("shape = \"wedge\"\nspacing_m = 2", "scenario/within-delta", (14, 13)),
        ("shape = \"rings\"\nspacing_m = -1", "scenario/out-of-range", (14, 13)),
        ("shape = \"helix\"\nradius_m = 1\npitch_m = 1\nspacing_m = 9", "scenario/shape", (14, 12)),
        ("shape = \"helix\"\nradius_m = 9\npitch_m = 1", "scenario/shape", (15, 11)),
        ("shape = \"helix\"\nradius_m = 9\npitch_m = 4\nspacing_m = 3\nturns = 2", "scenario/exclusive-keys", (17, 9)),
        ("shape = \"text\"\ntext = \"\u{65e5}\"", "scenario/shape", (14, 8)),
        ("shape = \"text\"\ntext = \"  \"", "scenario/shape", (14, 8)),
        ("shape = \"text\"", "scenario/missing-key", (12, 1)),
        ("shape = \"text\"\ntext = \"HI\"\nheight_m = 9\nspacing_m = 3", "scenario/exclusive-keys", (15, 12)),
        ("shape = \"text\"\ntext = \"HI\"\nheight_m = 0", "scenario/out-of-range", (15, 12)),
        ("shape = \"text\"\ntext = \"HI\"\nspacing_m = 1", "scenario/within-delta", (15, 13)),
        ("shape = \"svg\"\npath = \"M 0 0 L\"", "scenario/shape", (14, 8)),
        ("shape = \"svg\"\npath = \"M 0 0 H 9\"\nheight_m = 99", "scenario/shape", (15, 12)),
        ("shape = \"svg\"\npath = \"M 0 0 H 9\"\nfile = \"a\"", "scenario/exclusive-keys", (14, 8)),
        ("shape = \"svg\"", "scenario/missing-key", (12, 2)),
        (&image, "scenario/file", (14, 8)),
        ("shape = \"image\"\nfile = \".\"", "scenario/file", (14, 8)),
    ] {
        let error = read(formation).expect_err(formation);
        assert_eq!(error.code(), code, "{error}");
        assert!(!error.help.is_empty(), "{formation}: {error}");
        assert_eq!(error.place.as_ref().map(|place| (place.line, place.column)), Some(place), "{error}");
    }
    let few = FRAME.replace("count = 50", "count = 4") + "shape = \"text\"\ntext = \"HELLO\"";
    let error = Scenario::read(&Source::Text { name: "few".to_owned(), text: few }, &[]).expect_err("five letters");
    assert_eq!(error.message, "4 slots for 5 letters");
}

#[test]
fn the_pitch_of_a_refusal_is_sufficient() {
    let of = |pitch: &str| read(&format!("shape = \"helix\"\nradius_m = 9\npitch_m = {pitch}"));
    for flat in ["1", "1e-9", "2.5"] {
        let help = of(flat).expect_err("too flat").help;
        let named = help.strip_prefix("enlarge formation.pitch_m to ").and_then(|rest| rest.split(',').next());
        let enough = of(named.expect(&help)).expect(&help);
        assert!((nearest_m(&enough) - 3.0).abs() < SPACING_ROUNDING, "{help}");
    }
}
