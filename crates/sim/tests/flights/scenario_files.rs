//! What a scenario file may say, what it must not, and where its errors point.

use std::fs;

use tautline_core::swarm::{Rows, Swarm, separation};
use tautline_laws::formation::Formation;
use tautline_sim::scenario::{Override, PlantSpec, Scenario, ScenarioError, Source, Space, builtin};

/// A minimal flight that is right: what the wrong ones below are changed from.
pub(crate) const RIGHT: &str = r#"name = "pair"
[start]
positions_m = [
    [0.0, 0.0],
    [4.0, 0.0],
]
[formation]
shape = "line"
spacing_m = 3.0
[law]
kind = "edge-tension"
delta_m = 2.0
[time]
duration_s = 1.0
"#;

/// Bits of the first coordinate that seed 1 gives for a half extent of 8 m.
const GOLDEN_RANDOM_X: u64 = 13_833_077_504_487_939_064;

pub(crate) fn read(text: &str) -> Result<Scenario, ScenarioError> {
    Scenario::read(&Source::Text { name: "test.toml".to_owned(), text: text.to_owned() }, &[])
}

pub(crate) fn read_builtin(name: &str, sets: &[&str]) -> Result<Scenario, ScenarioError> {
    let overrides = sets.iter().map(|set| Override::parse(set)).collect::<Result<Vec<_>, _>>()?;
    Scenario::read(&Source::Builtin(name.to_owned()), &overrides)
}

/// Line and column at which an error stands; 0:0 without a place.
fn place(error: &ScenarioError) -> (usize, usize) {
    error.place().map_or((0, 0), |place| (place.line, place.column))
}

#[test]
fn every_wrong_input_is_refused_at_its_place_with_a_remedy() {
    // Text of RIGHT to replace, its replacement, part of the message, line and column.
    let cases: &[(&str, &str, &str, (usize, usize))] = &[
        ("[time]", "[time", "this is not TOML", (13, 6)),
        ("name", "naem = 1\nname", "unknown key `naem`", (1, 1)),
        ("spacing_m", "spacing", "unknown key `spacing`", (9, 1)),
        ("spacing_m = 3.0", "radius_m = 3.0", "unknown key `radius_m`", (9, 1)),
        ("spacing_m = 3.0", "", "missing key `spacing_m`", (7, 1)),
        ("duration_s = 1.0", "", "missing key `duration_s`", (13, 1)),
        ("\"line\"", "\"lien\"", "unknown choice `lien`", (8, 9)),
        ("\"line\"", "7", "expected a string", (8, 9)),
        ("2.0\n[time]", "\"two\"\n[time]", "expected a number", (12, 11)),
        ("[4.0, 0.0]", "[4.0]", "expected a point", (5, 5)),
        ("[4.0, 0.0]", "[4.0, 0.0, 0.0, 0.0]", "expected a point", (5, 5)),
        ("[4.0, 0.0]", "[4.0, \"0\"]", "expected a number", (5, 11)),
        ("    [0.0, 0.0],\n    [4.0, 0.0],\n", "", "0 vehicles cannot form a formation", (3, 15)),
        ("    [4.0, 0.0],\n", "", "1 vehicle cannot form a formation", (3, 15)),
        ("[start]", "[swarm]\ncount = 3\n[start]", "2 start positions for 3 vehicles", (5, 15)),
        ("[start]", "[swarm]\nmass_kg = [1]\n[start]", "1 masses for 2 vehicles", (3, 11)),
        ("[start]", "[start]\nvelocities_m_s = [[0, 0]]", "1 start velocities for 2 vehicles", (3, 18)),
        ("shape = \"line\"\nspacing_m", "shape = \"pentagon\"\nside_m", "5 slots in the formation for 2", (9, 10)),
        ("spacing_m = 3.0", "spacing_m = 2.0", "a desired distance of 2 m (vehicles 1-2) is not more", (9, 13)),
        ("spacing_m = 3.0", "spacing_m = 2.000000000000001", "less than a billionth", (9, 13)),
        ("spacing_m = 3.0", "spacing_m = 0", "the spacing is 0", (9, 13)),
        ("spacing_m = 3.0", "spacing_m = -3", "the spacing is -3", (9, 13)),
        ("spacing_m = 3.0", "spacing_m = nan", "the spacing is not a number", (9, 13)),
        (
            "\"line\"\nspacing_m = 3.0",
            "\"points\"\npoints_m = [[1, 1],\n  [1, 1]]",
            "the slots of vehicles 1 and 2 are the same point",
            (10, 3),
        ),
        ("[4.0, 0.0]", "[2.0, 0.0]", "vehicles 1-2 start 2 m apart, not more than delta = 2 m", (5, 5)),
        ("[4.0, 0.0]", "[0.0, 0.0]", "vehicles 1-2 start at the same point", (5, 5)),
        ("[4.0, 0.0]", "[nan, 0.0]", "x of the start position of vehicle 2 is not a number", (5, 5)),
        ("[4.0, 0.0]", "[4.0, -inf]", "y of the start position of vehicle 2 is infinite", (5, 5)),
        ("[4.0, 0.0]", "[1e200, 0.0]", "is 1e200, too large to compute with", (5, 5)),
        ("[4.0, 0.0]", "[1e999, 0.0]", "overflowed", (5, 6)),
        ("[start]", "[swarm]\ndimensions = 2\n[start]\nvelocities_m_s = [[0, 0],[0, 0, 1]]", "the plane", (5, 26)),
        ("[start]", "[swarm]\ndimensions = 4\n[start]", "4 dimensions", (3, 14)),
        ("[start]", "[start]\nshape = \"line\"\nspacing_m = 3", "both `positions_m` and a `shape`", (3, 9)),
        ("[start]", "[swarm]\nmass_kg = -1.0\n[start]", "the mass of vehicle 1 is -1", (3, 11)),
        ("[start]", "[swarm]\nmass_kg = [1.0, 0.0]\n[start]", "the mass of vehicle 2 is 0", (3, 17)),
        ("[start]", "[swarm]\nmass_kg = 1e-300\n[start]", "too small to compute with", (3, 11)),
        ("[start]", "[swarm]\nhull_radius_m = 1.1\n[start]", "the hulls of vehicles 1-2 touch at 2.2 m", (3, 17)),
        ("2.0\n[time]", "0.4\n[time]", "the hulls of vehicles 1-2 touch at 0.5 m", (12, 11)),
        ("[start]", "[swarm]\na22_per_s = inf\n[start]", "a22 is infinite", (3, 13)),
        ("[start]", "[swarm]\na22_per_s = -1e4\n[start]", "in which velocities change by themselves", (3, 13)),
        ("2.0\n[time]", "0\n[time]", "delta is 0", (12, 11)),
        ("delta_m", "alpha = -1\ndelta_m", "alpha is -1", (12, 9)),
        ("edge-tension\"", "laplacian\"\nf2_per_s = -1", "the gain f2 is -1", (12, 12)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = []\n[time]", "no path joins vehicle 1 to 2", (15, 9)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = [[1, 1]]\n[time]", "joins vehicle 1 to itself", (15, 10)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = [[1, 3]]\n[time]", "names vehicle 3", (15, 10)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = [[0, 1]]\n[time]", "names vehicle 0", (15, 10)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = [[1, 2], [2, 1]]\n[time]", "a second time", (15, 18)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = [[1, 2, 3]]\n[time]", "expected an edge", (15, 10)),
        ("[time]", "[time]\ndt_s = 0", "the time step is 0", (14, 8)),
        ("[time]", "[time]\ndt_s = -0.1", "the time step is -0.1", (14, 8)),
        ("[time]", "[time]\ndt_s = 2.0", "longer than the flight", (15, 14)),
        ("duration_s = 1.0", "duration_s = 0", "the duration is 0", (14, 14)),
        ("duration_s = 1.0", "duration_s = 1e12", "2.40e14 steps; at most 1e9", (14, 14)),
        ("duration_s = 1.0", "duration_s = nan", "the duration is not a number", (14, 14)),
        ("[time]", "[time]\nrecord_hz = 0", "the recording rate is 0", (14, 13)),
        ("[time]", "[time]\nmax_halvings = 21", "at most 20 times", (14, 16)),
        ("[time]", "[arrival]\nhold_s = -1\n[time]", "the hold time is -1", (14, 10)),
        ("[time]", "[judge]\nhold_s = -1\n[time]", "the hold time is -1", (14, 10)),
        ("[time]", "[arrival]\n[judge]\nhold_s = 0\n[time]", "both [arrival] and [judge] are given", (14, 2)),
        ("name = \"pair\"", "name = \"pair\"\n\"a, expected `b`\" = 1", "unknown key `a, expected `b``", (2, 1)),
        ("[time]", "[arrival]\nedge_error_m = 0\n[time]", "the edge error is 0", (14, 16)),
        ("\"pair\"", "\"a/../b\"", "the name holds '/'", (1, 8)),
        ("\"pair\"", "\"\"", "the name is empty", (1, 8)),
    ];
    read(RIGHT).expect("the text that the cases change is right");
    for &(from, to, said, at) in cases {
        assert!(RIGHT.contains(from), "{from}");
        let text = RIGHT.replacen(from, to, 1);
        let error = read(&text).expect_err(&text);
        assert!(error.message().contains(said), "{error}");
        assert_eq!(place(&error), at, "{error}");
        assert!(error.help().is_some_and(|help| !help.is_empty()), "{error}");
        assert!(error.to_string().starts_with(&format!("test.toml:{}:{}: ", at.0, at.1)), "{error}");
    }
}

#[test]
fn the_number_of_vehicles_must_come_from_somewhere() {
    let text = RIGHT.replace("positions_m = [\n    [0.0, 0.0],\n    [4.0, 0.0],\n]", "shape = \"line\"\nspacing_m = 3");
    let error = read(&text).expect_err("no number is given");
    assert!(error.message().contains("number of vehicles is not given"), "{error}");
    let counted = read(&format!("{text}[swarm]\ncount = 7\n")).expect("the number is given");
    assert_eq!(counted.count(), 7);
}

#[test]
fn a_million_vehicles_on_the_complete_graph_are_refused_with_the_memory_they_would_take() {
    let text = format!(
        "{}[swarm]\ncount = 1000000\n",
        RIGHT.replace("positions_m = [\n    [0.0, 0.0],\n    [4.0, 0.0],\n]", "shape = \"line\"\nspacing_m = 3")
    );
    let error = read(&text).expect_err("takes too much memory");
    assert!(error.message().contains("499999500000 edges would take 7454.4 GiB"), "{error}");
    assert_eq!(place(&error), (14, 9), "{error}");
    let absurd = text.replace("1000000", "9223372036854775807");
    assert!(read(&absurd).expect_err("takes too much memory").message().contains("GiB"));
}

#[test]
fn an_empty_file_is_said_to_be_empty() {
    for text in ["", "\n\n", "# nothing but a comment\n"] {
        let error = read(text).expect_err("nothing to fly");
        assert!(error.message().contains("empty"), "{error}");
    }
}

#[test]
fn a_file_that_cannot_be_a_scenario_is_refused_before_it_is_understood() {
    let folder = tempfile::tempdir().expect("a folder for the files");
    let error = |path: &std::path::Path| Scenario::read(&Source::File(path.to_owned()), &[]).expect_err("refused");

    assert!(error(folder.path()).message().ends_with("is a directory"));

    let missing = folder.path().join("missing.toml");
    assert!(error(&missing).message().contains("cannot read") && error(&missing).message().contains("missing.toml"));

    let large = folder.path().join("large.toml");
    fs::File::create(&large).and_then(|file| file.set_len(1 << 30)).expect("a sparse file of 1 GiB");
    assert!(error(&large).message().ends_with("has more than 128 MiB"));

    let latin1 = folder.path().join("latin1.toml");
    fs::write(&latin1, b"name = \"pair\"\n# caf\xe9\n").expect("a file");
    let not_utf8 = error(&latin1);
    assert!(not_utf8.message().contains("byte 19 (from 0) is not UTF-8"), "{not_utf8}");
    assert_eq!(place(&not_utf8), (2, 6));

    let right = folder.path().join("right.toml");
    fs::write(&right, RIGHT).expect("a file");
    assert!(Scenario::read(&Source::File(right), &[]).is_ok());
}

#[test]
fn an_unknown_name_is_answered_with_the_names_that_are_known() {
    let error = Source::resolve("pentagn").expect_err("no such built-in");
    let help = error.help().unwrap_or_default();
    assert!(help.contains("did you mean `pentagon`?"), "{error}");
    assert!(builtin::all().iter().all(|known| help.contains(known.name)), "{error}");
    assert_eq!(Source::resolve("circle").ok(), Some(Source::Builtin("circle".to_owned())));
    assert_eq!(Source::resolve("./circle").ok(), Some(Source::File("./circle".into())));
}

#[test]
fn an_override_sets_any_key_and_makes_those_that_are_not_there() {
    let set = |sets: &[&str]| read_builtin("pentagon", sets).expect("right overrides");
    let says = |sets: &[&str], line: &str| set(sets).resolved_toml().lines().any(|written| written.trim() == line);
    assert!(says(&["law.delta_m=1.5"], "delta_m = 1.5"));
    assert!(says(&["name=my-run"], "name = \"my-run\""));
    assert!(says(&[], "kind = \"rapier\"") && says(&["plant.kind=ideal"], "kind = \"ideal\""));
    assert!(says(&["plant = {kind = \"ideal\"}"], "kind = \"ideal\""));
    assert!(says(&["start.positions_m.4.x=-1"], "[-1.0, 0.05],"));
    assert!(says(&["start.positions_m.4.1=-1"], "[-1.0, 0.05],"));
    assert!(says(&["start.positions_m.4=[-1, 0.5]"], "[-1.0, 0.5],"));
    assert!(says(&["judge.hold_s=0.5"], "hold_s = 0.5") && says(&["arrival.hold_s=0.5"], "hold_s = 0.5"));
    assert!(says(&["time.dt_s=0.1", "time.dt_s=0.2"], "dt_s = 0.2"), "the last one wins");
    assert_eq!(set(&["graph.kind=star"]).graph.edge_count(), 4);
    assert_eq!(set(&["formation={shape=\"circle\", radius_m=3}"]).formation(), &Formation::circle(5, 3.0));
}

#[test]
fn another_kind_leaves_the_keys_of_the_one_before_and_nothing_else() {
    let law = |sets: &[&str]| read_builtin("pentagon", sets).map(|scenario| scenario.law);
    let laplacian = law(&["law={kind=\"laplacian\", delta_m=2}"]).expect("a law");
    assert_eq!(law(&["law.kind=laplacian"]), Ok(laplacian), "the pentagon's file gives law.alpha");
    let circle = read_builtin("pentagon", &["formation.shape=circle", "formation.radius_m=3"]).expect("a circle");
    assert_eq!(circle.formation(), &Formation::circle(5, 3.0), "the pentagon's file gives formation.side_m");
    let refused = |text: &str, sets: &[&str]| {
        let overrides = sets.iter().map(|set| Override::parse(set)).collect::<Result<Vec<_>, _>>().expect("overrides");
        let source = Source::Text { name: "f".to_owned(), text: text.to_owned() };
        Scenario::read(&source, &overrides).expect_err("refused").message().to_owned()
    };
    let alpha = RIGHT.replace("delta_m", "alpha = 1\ndelta_m");
    let (wrong, slip) = (alpha.replace("edge-tension", "laplacian"), alpha.replace("alpha", "alhpa"));
    assert!(refused(&wrong, &[]).contains("unknown key `alpha`"), "the file is wrong by itself");
    assert!(refused(&slip, &["law.kind=laplacian"]).contains("unknown key `alhpa`"), "no kind has it");
    assert!(
        refused(&alpha, &["law.kind=laplacian", "law.alpha=2"]).contains("unknown key `alpha`"),
        "it was asked for"
    );
    assert!(refused(RIGHT, &["law.kind=laplacian", "law.alpha=2"]).contains("unknown key `alpha`"), "it was asked for");
    assert!(
        refused(&alpha, &["formation.shape=circle", "formation.radius_m=3", "law.f1_per_s2=2"]).contains("`f1_per_s2`")
    );
}

#[test]
fn what_is_not_given_has_its_default() {
    let named = |name: &str, text: &str| {
        Scenario::read(&Source::Text { name: name.to_owned(), text: text.to_owned() }, &[]).expect("right")
    };
    let nameless = RIGHT.replace("name = \"pair\"\n", "");
    assert_eq!(named("out/my flight.v2.toml", &nameless).name, "my-flight-v2");
    assert_eq!(named("out/my flight.toml", RIGHT).name, "pair");
    let kindless = RIGHT.replace("kind = \"edge-tension\"\n", "");
    assert_eq!(named("f", &kindless), named("f", RIGHT));
    let alpha = kindless.replace("delta_m", "alpha = 2\ndelta_m");
    assert_eq!(named("f", &alpha).law, named("f", &alpha.replace("alpha", "kind = \"edge-tension\"\nalpha")).law);
    let random = |more: &str| {
        read_builtin("pentagon", &[&format!("start={{shape=\"random\", half_extent_m=20, seed=3{more}}}")])
            .expect("room")
    };
    assert_eq!(random(""), random(", min_separation_m=3.0"), "1.5 times delta");
}

#[test]
fn a_scenario_has_no_choice_of_precision() {
    let error = read_builtin("pentagon", &["plant.precision=single"]).expect_err("an unknown key");
    assert!(error.to_string().contains("precision"), "{error}");
    assert_eq!(read_builtin("pentagon", &[]).expect("right").plant, PlantSpec::Rapier);
    assert_eq!(read_builtin("pentagon", &["plant.kind=ideal"]).expect("right").plant, PlantSpec::Ideal);
}

#[test]
fn an_error_that_an_override_causes_stands_in_the_override() {
    let cases: &[(&str, &str, usize)] = &[
        ("formation.side_m=2", "a desired distance of 2 m", 18),
        ("law.delta_m=3", "a desired distance of 3 m", 13),
        ("start.positions_m.1.x=6", "vehicles 1-3 start 0.1", 23),
        ("start.jiter_m=1", "unknown key `jiter_m`", 7),
        ("graph.kind=tree", "unknown choice `tree`", 12),
        ("time.dt_s=fast", "expected a number", 11),
        ("time.dt_s=nan", "the time step is not a number", 11),
        ("time=3", "expected a table", 6),
        ("swarm.count=6", "5 start positions for 6 vehicles", 13),
        ("start.positions_m.6.x=1", "entries 1 to 5, not 6", 19),
        ("start.positions_m.0.x=1", "entries 1 to 5, not 0", 19),
        ("start.positions_m.1.w=1", "`w` is not the number of an entry", 21),
        ("name.x=1", "there is nothing below a string", 6),
        ("start.positions_m=[[0,0]", "not TOML", 25),
        ("law.delta_m=2,5", "not TOML", 14),
        ("law.delta_m=", "not TOML", 13),
        ("law..delta_m=1", "`` is not a key", 5),
        ("=1", "`` is not a key", 1),
        ("law.delta_m", "has no `=`", 1),
    ];
    for &(set, said, column) in cases {
        let error = read_builtin("pentagon", &[set]).expect_err(set);
        assert!(error.message().contains(said), "{error}");
        assert_eq!(place(&error), (1, column), "{error}");
        assert!(error.place().is_some_and(|place| place.source == "--set" && place.text == set), "{error}");
        assert!(error.help().is_some(), "{error}");
    }
}

#[test]
fn an_error_of_the_file_stays_in_the_file_whatever_is_overridden() {
    let source = Source::Text { name: "f".to_owned(), text: RIGHT.replace("spacing_m = 3.0", "spacing_m = 1.0") };
    let overrides = [Override::parse("time.dt_s=0.1").expect("an override")];
    let error = Scenario::read(&source, &overrides).expect_err("slots within delta");
    assert_eq!(error.place().map(|place| (place.source.as_str(), place.line)), Some(("f", 9)));
    let overrides = [Override::parse("formation.spacing_m=3").expect("an override")];
    assert!(Scenario::read(&source, &overrides).is_ok(), "an override heals the file");
}

#[test]
fn the_resolved_scenario_reads_back_to_the_same_bits_and_the_same_hash() {
    let random = "start={shape=\"random\", half_extent_m=20, min_separation_m=2.5, jitter_m=0.1, seed=7}";
    let changed: &[&[&str]] = &[
        &["swarm.count=5", random],
        &["start.jitter_m=0.05", "start.seed=3", "swarm.dimensions=3"],
        &["graph.kind=ring", "law.delta_m=0.9"],
        &["swarm.mass_kg=[0.1,0.2,0.3,0.4,0.7]", "time.dt_s=0.01", "time.record_hz=7", "arrival.hold_s=0"],
        &["formation={shape=\"sphere\", radius_m=4}", "start.velocities_m_s=[[1,0],[0,1],[0.1,0.2,0.3],[0,0],[0,0]]"],
    ];
    let changed = changed.iter().map(|&sets| ("pentagon", sets));
    for (name, sets) in builtin::all().iter().map(|builtin| (builtin.name, &[][..])).chain(changed) {
        let scenario = read_builtin(name, sets).expect(name);
        let resolved = scenario.resolved_toml();
        let again = read(&resolved).expect(&resolved);
        assert_eq!(again, scenario);
        let (a, b) = (&scenario.start.positions_m, &again.start.positions_m);
        assert!(a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits()));
        assert_eq!(again.resolved_toml(), resolved);
        assert_eq!(again.sha256_hex(), scenario.sha256_hex());
    }
}

#[test]
fn the_hash_changes_with_the_last_bit_of_a_start_position() {
    let mut scenario = read_builtin("pentagon", &[]).expect("a built-in");
    let hash = scenario.sha256_hex();
    assert_eq!(hash.len(), 64);
    scenario.start.positions_m[(0, 0)] = scenario.start.positions_m[(0, 0)].next_up();
    assert_ne!(scenario.sha256_hex(), hash);
}

#[test]
fn random_starts_are_the_same_on_every_machine_and_keep_their_distance() {
    let random = |seed: u64, dimensions: u8| {
        let start = format!("start={{shape=\"random\", half_extent_m=8, min_separation_m=2.5, seed={seed}}}");
        read_builtin("pentagon", &[&start, &format!("swarm.dimensions={dimensions}")]).expect("room enough")
    };
    let plane = random(1, 2);
    // Fixes the generator and the arithmetic that makes positions of its words.
    assert_eq!(plane.start.positions_m[(0, 0)].to_bits(), GOLDEN_RANDOM_X);
    assert_eq!(plane, random(1, 2));
    assert_ne!(plane, random(2, 2));
    assert!(plane.formation().is_in_plane_z0() && plane.start.positions_m.column(2).iter().all(|&z| z == 0.0));
    let volume = random(1, 3);
    assert!(volume.start.positions_m.column(2).iter().any(|&z| z != 0.0));
    for scenario in [plane, volume] {
        for j in 1..5 {
            assert!((0..j).all(|i| separation(&scenario.start.positions_m, i, j) > 2.5));
        }
    }
    let full = read_builtin("pentagon", &["start={shape=\"random\", half_extent_m=1.5, min_separation_m=2.5}"]);
    assert!(full.expect_err("no room").message().contains("no room for vehicle"));
}

#[test]
fn jitter_stays_in_the_plane_and_within_its_bound() {
    let straight = read_builtin("pentagon-collinear", &[]).expect("a built-in");
    let jittered = read_builtin("pentagon-collinear", &["start.jitter_m=0.05"]).expect("a built-in");
    let offsets = &jittered.start.positions_m - &straight.start.positions_m;
    assert!(offsets.iter().all(|offset| offset.abs() <= 0.05 + 1e-12), "rounding of the sum alone exceeds the bound");
    assert!(offsets.column(0).iter().chain(offsets.column(1).iter()).all(|&offset| offset != 0.0));
    assert_eq!(jittered.space, Space::Plane);
    assert!(offsets.column(2).iter().all(|&offset| offset == 0.0));
    let volume = read_builtin("pentagon-collinear", &["start.jitter_m=0.05", "swarm.dimensions=3"]).expect("in space");
    assert!(volume.start.positions_m.column(2).iter().all(|&z| z != 0.0));
}

#[test]
fn the_dimension_follows_from_what_leaves_the_plane() {
    let space = |sets: &[&str]| read_builtin("pentagon", sets).expect("right").space;
    assert_eq!(space(&[]), Space::Plane);
    assert_eq!(space(&["swarm.dimensions=3"]), Space::Volume);
    assert_eq!(space(&["start.positions_m.1=[3, 0, 0.1]"]), Space::Volume);
    assert_eq!(space(&["start={shape=\"sphere\", radius_m=5}"]), Space::Volume);
    assert_eq!(space(&["formation={shape=\"sphere\", radius_m=5}"]), Space::Volume);
}

#[test]
fn a_scenario_built_in_code_is_the_one_that_a_file_gives() {
    let file = read(RIGHT).expect("right");
    let start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]));
    let code = Scenario::new("pair", start, Formation::line(2, 3.0), 2.0, 1.0);
    assert_eq!(code, file);
    assert_eq!(code.validate(), Ok(()));
    let mut wrong = code;
    wrong.mass_kg.pop();
    let error = wrong.validate().expect_err("a mass is missing");
    assert_eq!(error.to_string().lines().next(), Some("swarm.mass_kg: 1 masses for 2 vehicles"));
    assert!(error.place().is_none());
}

#[test]
fn a_scenario_broken_in_code_is_refused_and_never_panics() {
    let right = read_builtin("circle", &[]).expect("a built-in");
    let breaks: &[fn(&mut Scenario)] = &[
        |s| s.start.velocities_m_s = Rows::zeros(0),
        |s| s.start = Swarm::at_rest(Rows::zeros(0)),
        |s| s.legs[0].formation = Formation::circle(5, 3.0),
        |s| s.hull_radius_m.clear(),
        |s| s.graph = tautline_laws::graph::Graph::ring(4),
        |s| s.delta_m = f64::NAN,
        |s| s.legs[0].formation.slots_m[(0, 0)] = f64::NAN,
        |s| s.start.positions_m[(5, 2)] = 1.0,
        |s| s.time.dt_s = f64::NEG_INFINITY,
        |s| s.name = "\u{1b}".to_owned(),
    ];
    for (number, break_it) in breaks.iter().enumerate() {
        let mut scenario = right.clone();
        break_it(&mut scenario);
        assert!(scenario.validate().is_err(), "break {number}");
        // Still text, and still no panic.
        let _ = read(&scenario.resolved_toml());
    }
}
