//! Reading of scenario files: valid texts, invalid texts, and the places of their errors.

use std::fs;

use tautline_core::swarm::{Rows, Swarm, separation};
use tautline_laws::formation::Formation;
use tautline_sim::scenario::{Override, PlantSpec, Scenario, ScenarioError, Source, Space, builtin};

/// A minimal valid scenario, from which the invalid ones are derived.
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

/// Bits of the first coordinate for seed 1 and a half extent of 8 m.
const GOLDEN_RANDOM_X: u64 = 13_833_077_504_487_939_064;

pub(crate) fn read(text: &str) -> Result<Scenario, ScenarioError> {
    Scenario::read(&Source::Text { name: "test.toml".to_owned(), text: text.to_owned() }, &[])
}

pub(crate) fn read_builtin(name: &str, sets: &[&str]) -> Result<Scenario, ScenarioError> {
    let overrides = sets.iter().map(|set| Override::parse(set)).collect::<Result<Vec<_>, _>>()?;
    Scenario::read(&Source::Builtin(name.to_owned()), &overrides)
}

/// Returns line and column of an error; 0:0 without a place.
fn place(error: &ScenarioError) -> (usize, usize) {
    error.place.as_ref().map_or((0, 0), |place| (place.line, place.column))
}

#[test]
fn wrong_input_is_refused_at_its_place_with_a_remedy() {
    // Text of RIGHT, its replacement, the code of the error, line and column.
    let cases: &[(&str, &str, &str, (usize, usize))] = &[
        ("[time]", "[time", "scenario/syntax", (13, 6)),
        ("name", "naem = 1\nname", "scenario/unknown-key", (1, 1)),
        ("spacing_m", "spacing", "scenario/unknown-key", (9, 1)),
        ("spacing_m = 3.0", "radius_m = 3.0", "scenario/unknown-key", (9, 1)),
        ("spacing_m = 3.0", "", "scenario/missing-key", (7, 1)),
        ("duration_s = 1.0", "", "scenario/missing-key", (13, 1)),
        ("\"line\"", "\"lien\"", "scenario/unknown-choice", (8, 9)),
        ("\"line\"", "7", "scenario/wrong-type", (8, 9)),
        ("2.0\n[time]", "\"two\"\n[time]", "scenario/wrong-type", (12, 11)),
        ("[4.0, 0.0]", "[4.0]", "scenario/wrong-type", (5, 5)),
        ("[4.0, 0.0]", "[4.0, 0.0, 0.0, 0.0]", "scenario/wrong-type", (5, 5)),
        ("[4.0, 0.0]", "[4.0, \"0\"]", "scenario/wrong-type", (5, 11)),
        ("    [0.0, 0.0],\n    [4.0, 0.0],\n", "", "scenario/out-of-range", (3, 15)),
        ("    [4.0, 0.0],\n", "", "scenario/out-of-range", (3, 15)),
        ("[start]", "[swarm]\ncount = 3\n[start]", "scenario/count-mismatch", (5, 15)),
        ("[start]", "[swarm]\nmass_kg = [1]\n[start]", "scenario/count-mismatch", (3, 11)),
        ("[start]", "[start]\nvelocities_m_s = [[0, 0]]", "scenario/count-mismatch", (3, 18)),
        ("shape = \"line\"\nspacing_m", "shape = \"pentagon\"\nside_m", "scenario/count-mismatch", (9, 10)),
        ("spacing_m = 3.0", "spacing_m = 2.0", "scenario/within-delta", (9, 13)),
        ("spacing_m = 3.0", "spacing_m = 2.000000000000001", "scenario/within-delta", (9, 13)),
        ("spacing_m = 3.0", "spacing_m = 0", "scenario/out-of-range", (9, 13)),
        ("spacing_m = 3.0", "spacing_m = -3", "scenario/out-of-range", (9, 13)),
        ("spacing_m = 3.0", "spacing_m = nan", "scenario/out-of-range", (9, 13)),
        ("\"line\"\nspacing_m = 3.0", "\"points\"\npoints_m = [[1, 1],\n  [1, 1]]", "scenario/within-delta", (10, 3)),
        ("[4.0, 0.0]", "[2.0, 0.0]", "scenario/within-delta", (5, 5)),
        ("[4.0, 0.0]", "[0.0, 0.0]", "scenario/within-delta", (5, 5)),
        ("[4.0, 0.0]", "[nan, 0.0]", "scenario/out-of-range", (5, 6)),
        ("[4.0, 0.0]", "[4.0, -inf]", "scenario/out-of-range", (5, 11)),
        ("[4.0, 0.0]", "[1e200, 0.0]", "scenario/out-of-range", (5, 6)),
        ("[4.0, 0.0]", "[1e999, 0.0]", "scenario/out-of-range", (5, 6)),
        ("[start]", "[swarm]\ndimensions = 2\n[start]\nvelocities_m_s = [[0, 0],[0, 0, 1]]", "scenario/plane", (5, 26)),
        ("[start]", "[swarm]\ndimensions = 4\n[start]", "scenario/out-of-range", (3, 14)),
        ("[start]", "[start]\nshape = \"line\"\nspacing_m = 3", "scenario/exclusive-keys", (3, 9)),
        ("[start]", "[swarm]\nmass_kg = -1.0\n[start]", "scenario/out-of-range", (3, 11)),
        ("[start]", "[swarm]\nmass_kg = [1.0, 0.0]\n[start]", "scenario/out-of-range", (3, 17)),
        ("[start]", "[swarm]\nmass_kg = 1e-300\n[start]", "scenario/out-of-range", (3, 11)),
        ("[start]", "[swarm]\nhull_radius_m = 1.1\n[start]", "scenario/hulls-touch", (3, 17)),
        ("2.0\n[time]", "0.4\n[time]", "scenario/hulls-touch", (12, 11)),
        ("[start]", "[swarm]\na22_per_s = inf\n[start]", "scenario/out-of-range", (3, 13)),
        ("[start]", "[swarm]\na22_per_s = -1e4\n[start]", "scenario/step-too-long", (3, 13)),
        ("2.0\n[time]", "0\n[time]", "scenario/out-of-range", (12, 11)),
        ("delta_m", "alpha = -1\ndelta_m", "scenario/out-of-range", (12, 9)),
        ("edge-tension\"", "laplacian\"\nf2_per_s = -1", "scenario/out-of-range", (12, 12)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = []\n[time]", "scenario/disconnected", (15, 9)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = [[1, 1]]\n[time]", "scenario/edge", (15, 10)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = [[1, 3]]\n[time]", "scenario/edge", (15, 10)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = [[0, 1]]\n[time]", "scenario/out-of-range", (15, 11)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = [[1, 2], [2, 1]]\n[time]", "scenario/edge", (15, 18)),
        ("[time]", "[graph]\nkind = \"edges\"\nedges = [[1, 2, 3]]\n[time]", "scenario/wrong-type", (15, 10)),
        ("[time]", "[time]\ndt_s = 0", "scenario/out-of-range", (14, 8)),
        ("[time]", "[time]\ndt_s = -0.1", "scenario/out-of-range", (14, 8)),
        ("[time]", "[time]\ndt_s = 2.0", "scenario/step-too-long", (15, 14)),
        ("duration_s = 1.0", "duration_s = 0", "scenario/out-of-range", (14, 14)),
        ("duration_s = 1.0", "duration_s = 1e8", "scenario/too-many-steps", (14, 14)),
        ("duration_s = 1.0", "duration_s = nan", "scenario/out-of-range", (14, 14)),
        ("[time]", "[time]\nrecord_hz = 0", "scenario/out-of-range", (14, 13)),
        ("[time]", "[time]\nmax_halvings = 21", "scenario/out-of-range", (14, 16)),
        ("[time]", "[arrival]\nhold_s = -1\n[time]", "scenario/out-of-range", (14, 10)),
        ("[time]", "[arrivals]\nhold_s = 1\n[time]", "scenario/unknown-key", (13, 2)),
        ("name = \"pair\"", "name = \"pair\"\n\"a, expected `b`\" = 1", "scenario/unknown-key", (2, 1)),
        ("[time]", "[arrival]\nedge_error_m = 0\n[time]", "scenario/out-of-range", (14, 16)),
        ("\"pair\"", "\"a/../b\"", "scenario/name", (1, 8)),
        ("\"pair\"", "\"\"", "scenario/name", (1, 8)),
    ];
    read(RIGHT).expect("the base text is valid");
    for &(from, to, code, at) in cases {
        assert!(RIGHT.contains(from), "{from}");
        let text = RIGHT.replacen(from, to, 1);
        let error = read(&text).expect_err(&text);
        assert_eq!(error.code(), code, "{error}");
        assert_eq!(place(&error), at, "{error}");
        assert!(!error.help.is_empty(), "{error}");
        assert!(error.to_string().starts_with(&format!("test.toml:{}:{}: ", at.0, at.1)), "{error}");
    }
}

/// A recording holds the values that the program fills in, and its reader checks them.
#[test]
fn a_default_that_follows_from_other_keys_survives_write_and_read() {
    for (sets, f2_per_s) in [
        (&["law.kind=laplacian", "swarm.a22_per_s=-1.5"][..], 0.0),
        (&["law.kind=laplacian", "swarm.a22_per_s=-0.25"], 0.75),
        (&["law.kind=laplacian", "swarm.a22_per_s=0", "vehicle.drag_per_s=3"], 0.0),
    ] {
        let scenario = read_builtin("pentagon", sets).expect("valid");
        let written = scenario.resolved().toml;
        assert!(written.contains(&format!("f2_per_s = {f2_per_s:?}\n")), "{written}");
        assert_eq!(read(&written), Ok(scenario), "{sets:?}");
    }
    // A pair of way points takes longer than a time may be.
    let slow = "reference={kind=\"way-points\", points_m=[[0,0],[1e9,0]], speed_m_s=1e-3}";
    let error = read_builtin("pentagon", &["law.kind=displacement", slow]).expect_err("no time is so long");
    assert_eq!(error.code(), "scenario/out-of-range", "{error}");
    assert!(error.message.contains("reference.times_s"), "{error}");
}

#[test]
fn a_number_of_any_size_is_repeated_in_a_few_digits() {
    for (set, says) in [
        ("law.delta_m=1e300", "got 1e300"),
        ("law.delta_m=1e-300", "got 1e-300"),
        ("law.delta_m=-1e300", "got -1e300"),
        ("sensing.latency_s=1e-300", "got 1e-300 s"),
        ("law.delta_m=100000000000000000000000000000000000000000000000000", "got 1e50"),
    ] {
        let error = read_builtin("pentagon", &[set]).expect_err(set);
        assert!(error.message.contains(says) && error.message.len() < 120, "{error}");
    }
}

#[test]
fn what_a_flight_refuses_is_refused_at_its_key() {
    let obstacle = |shape: &str| format!("obstacle=[{{name=\"o\", at_m=[0,0,50], {shape}}}]");
    for (set, code, says) in [
        (obstacle("box={size_m=[-1,1,1]}"), "scenario/out-of-range", "`size_m` must be more than 0, got -1"),
        (obstacle("box={size_m=[1,0,1]}"), "scenario/out-of-range", "`size_m` must be more than 0, got 0"),
        (obstacle("half_space={normal=[0,0,1e-10]}"), "scenario/out-of-range", "the normal of obstacle"),
    ] {
        let error = read_builtin("pentagon", &[&set]).expect_err(&set);
        assert_eq!((error.code(), error.place.is_some()), (code, true), "{error}");
        assert!(error.message.contains(says), "{error}");
    }
    // A scenario in code has no schema before it.
    let mut scenario = read_builtin("pentagon", &[&obstacle("ball={radius_m=1}")]).expect("valid");
    scenario.obstacles[0].clearance_m = f64::INFINITY;
    assert!(scenario.validate().is_err_and(|error| !error.keys.is_empty()));
}

#[test]
fn the_number_of_vehicles_is_required() {
    let text = RIGHT.replace("positions_m = [\n    [0.0, 0.0],\n    [4.0, 0.0],\n]", "shape = \"line\"\nspacing_m = 3");
    let error = read(&text).expect_err("no number is given");
    assert_eq!(error.code(), "scenario/missing-key", "{error}");
    let counted = read(&format!("{text}[swarm]\ncount = 7\n")).expect("the number is given");
    assert_eq!(counted.count(), 7);
}

#[test]
fn a_million_vehicles_on_the_complete_graph_are_refused_with_their_memory() {
    let text = format!(
        "{}[swarm]\ncount = 1000000\n",
        RIGHT.replace("positions_m = [\n    [0.0, 0.0],\n    [4.0, 0.0],\n]", "shape = \"line\"\nspacing_m = 3")
    );
    let error = read(&text).expect_err("takes too much memory");
    assert!(error.message.contains("499999500000 edges would take 7454.4 GiB"), "{error}");
    assert_eq!(place(&error), (14, 9), "{error}");
    let absurd = text.replace("1000000", "9223372036854775807");
    assert_eq!(read(&absurd).expect_err("takes too much memory").code(), "scenario/memory");
}

#[test]
fn an_empty_file_is_reported_as_empty() {
    for text in ["", "\n\n", "# nothing but a comment\n"] {
        let error = read(text).expect_err("nothing to fly");
        assert_eq!(error.code(), "scenario/empty", "{error}");
    }
}

#[test]
fn directories_and_large_files_are_refused_before_parsing() {
    let folder = tempfile::tempdir().expect("a folder for the files");
    let error = |path: &std::path::Path| Scenario::read(&Source::File(path.to_owned()), &[]).expect_err("refused");

    assert_eq!(error(folder.path()).code(), "scenario/cannot-read");

    let missing = folder.path().join("missing.toml");
    assert_eq!(error(&missing).code(), "scenario/not-found");
    assert!(error(&missing).message.contains("missing.toml"));

    let large = folder.path().join("large.toml");
    fs::File::create(&large).and_then(|file| file.set_len(1 << 30)).expect("a sparse file of 1 GiB");
    assert_eq!(error(&large).code(), "scenario/too-large");

    let latin1 = folder.path().join("latin1.toml");
    fs::write(&latin1, b"name = \"pair\"\n# caf\xe9\n").expect("a file");
    let not_utf8 = error(&latin1);
    assert_eq!(not_utf8.code(), "scenario/not-utf8", "{not_utf8}");
    assert_eq!(place(&not_utf8), (2, 6));

    let right = folder.path().join("right.toml");
    fs::write(&right, RIGHT).expect("a file");
    assert!(Scenario::read(&Source::File(right), &[]).is_ok());
}

#[test]
fn an_unknown_name_is_refused_with_the_known_names() {
    let error = Source::resolve("pentagn").expect_err("no such built-in");
    let help = &error.help;
    assert!(help.contains("did you mean `pentagon`?"), "{error}");
    assert!(builtin::all().iter().all(|known| help.contains(known.name)), "{error}");
    assert_eq!(Source::resolve("circle").ok(), Some(Source::Builtin("circle".to_owned())));
    assert_eq!(Source::resolve("./circle").ok(), Some(Source::File("./circle".into())));
}

#[test]
fn an_override_sets_existing_and_missing_keys() {
    let set = |sets: &[&str]| read_builtin("pentagon", sets).expect("right overrides");
    let says = |sets: &[&str], line: &str| set(sets).resolved().toml.lines().any(|written| written.trim() == line);
    assert!(says(&["law.delta_m=1.5"], "delta_m = 1.5"));
    assert!(says(&["name=my-run"], "name = \"my-run\""));
    assert!(says(&[], "kind = \"rapier\"") && says(&["plant.kind=ideal"], "kind = \"ideal\""));
    assert!(says(&["plant = {kind = \"ideal\"}"], "kind = \"ideal\""));
    assert!(says(&["start.positions_m.4.x=-1"], "[-1.0, 0.05],"));
    assert!(says(&["start.positions_m.4.1=-1"], "[-1.0, 0.05],"));
    assert!(says(&["start.positions_m.4=[-1, 0.5]"], "[-1.0, 0.5],"));
    assert!(says(&["arrival.hold_s=0.5"], "hold_s = 0.5"));
    assert!(says(&["time.dt_s=0.1", "time.dt_s=0.2"], "dt_s = 0.2"), "the last one wins");
    assert_eq!(set(&["graph.kind=star"]).graph.edge_count(), 4);
    assert_eq!(set(&["formation={shape=\"circle\", radius_m=3}"]).formation(), &Formation::circle(5, 3.0));
}

#[test]
fn another_kind_drops_only_the_keys_of_the_previous_kind() {
    let law = |sets: &[&str]| read_builtin("pentagon", sets).map(|scenario| scenario.law);
    let laplacian = law(&["law={kind=\"laplacian\", delta_m=2}"]).expect("a law");
    assert_eq!(law(&["law.kind=laplacian"]), Ok(laplacian), "the pentagon's file gives law.alpha");
    let circle = read_builtin("pentagon", &["formation.shape=circle", "formation.radius_m=3"]).expect("a circle");
    assert_eq!(circle.formation(), &Formation::circle(5, 3.0), "the pentagon's file gives formation.side_m");
    let refused = |text: &str, sets: &[&str]| {
        let overrides = sets.iter().map(|set| Override::parse(set)).collect::<Result<Vec<_>, _>>().expect("overrides");
        let source = Source::Text { name: "f".to_owned(), text: text.to_owned() };
        Scenario::read(&source, &overrides).expect_err("refused").message
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
fn missing_keys_have_their_defaults() {
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
    assert_eq!(error.code(), "scenario/unknown-key", "{error}");
    assert_eq!(read_builtin("pentagon", &[]).expect("right").plant, PlantSpec::Rapier);
    assert_eq!(read_builtin("pentagon", &["plant.kind=ideal"]).expect("right").plant, PlantSpec::Ideal);
}

#[test]
fn an_error_caused_by_an_override_is_placed_in_the_override() {
    let cases: &[(&str, &str, usize)] = &[
        ("law={kind=\"laplacian\", delta_m=2, alpha=1}", "scenario/unknown-key", 35),
        ("formation.side_m=2", "scenario/within-delta", 18),
        ("law.delta_m=3", "scenario/within-delta", 13),
        ("start.positions_m.1.x=6", "scenario/within-delta", 23),
        ("start.jiter_m=1", "scenario/unknown-key", 7),
        ("graph.kind=tree", "scenario/unknown-choice", 12),
        ("time.dt_s=fast", "scenario/wrong-type", 11),
        ("time.dt_s=nan", "scenario/out-of-range", 11),
        ("time=3", "scenario/wrong-type", 6),
        ("swarm.count=6", "scenario/count-mismatch", 13),
        ("start.positions_m.6.x=1", "scenario/override", 19),
        ("start.positions_m.0.x=1", "scenario/override", 19),
        ("start.positions_m.1.w=1", "scenario/override", 21),
        ("name.x=1", "scenario/override", 6),
        ("start.positions_m=[[0,0]", "scenario/override", 25),
        ("law.delta_m=2,5", "scenario/override", 14),
        ("law.delta_m=", "scenario/override", 13),
        ("law..delta_m=1", "scenario/override", 5),
        ("=1", "scenario/override", 1),
        ("law.delta_m", "scenario/override", 1),
    ];
    for &(set, code, column) in cases {
        let error = read_builtin("pentagon", &[set]).expect_err(set);
        assert_eq!(error.code(), code, "{error}");
        assert_eq!(place(&error), (1, column), "{error}");
        assert!(error.place.as_ref().is_some_and(|place| place.source == "set" && place.text == set), "{error}");
        assert!(!error.help.is_empty(), "{error}");
    }
    // The file has the key too.
    let left = read_builtin("pentagon", &["formation.side_m=5", "formation.shape=circle", "formation.radius_m=4"]);
    let left = left.expect_err("a circle has no side");
    assert!(left.place.as_ref().is_some_and(|place| place.text == "formation.side_m=5"), "{left}");
    // The file gives one of the two keys.
    let short = read(&RIGHT.replace("duration_s = 1.0", "duration_s = 0.5")).expect_err("shorter than the hold");
    assert_eq!((short.code(), place(&short)), ("scenario/outside-flight", (14, 14)), "{short}");
}

#[test]
fn an_error_that_an_override_causes_elsewhere_is_placed_in_the_override() {
    // The built-in scenario, its overrides, the one that causes the error, and the code of the error.
    let cases: &[(&str, &[&str], usize, &str)] = &[
        ("obstacles", &["obstacle.1.clearance_m=9"], 0, "scenario/near-obstacle"),
        ("obstacles", &["time.dt_s=0.01", "obstacle.1.clearance_m=9"], 1, "scenario/near-obstacle"),
        ("pentagon", &["formation.shape=text"], 0, "scenario/missing-key"),
        ("pentagon", &["formation.shape=svg"], 0, "scenario/missing-key"),
        ("pentagon", &["formation.shape=svg", "formation.path=\"M 0 0\"", "time.dt_s=0.01"], 1, "scenario/shape"),
        ("pentagon", &["formation.scale=0.01", "time.dt_s=0.01"], 0, "scenario/within-delta"),
        ("pentagon", &["swarm.dimensions=3", "formation={shape=\"text\", text=\"\"}"], 1, "scenario/shape"),
    ];
    for &(name, sets, cause, code) in cases {
        let error = read_builtin(name, sets).expect_err("refused");
        assert_eq!(error.code(), code, "{sets:?}: {error}");
        assert!(
            error.place.as_ref().is_some_and(|place| place.source == "set" && place.text == sets[cause]),
            "{sets:?}: {error}"
        );
    }
}

#[test]
fn an_error_of_the_file_is_placed_in_the_file_with_any_override() {
    let source = Source::Text { name: "f".to_owned(), text: RIGHT.replace("spacing_m = 3.0", "spacing_m = 1.0") };
    let overrides = [Override::parse("time.dt_s=0.1").expect("an override")];
    let error = Scenario::read(&source, &overrides).expect_err("slots within delta");
    assert_eq!(error.place.as_ref().map(|place| (place.source.as_str(), place.line)), Some(("f", 9)));
    let overrides = [Override::parse("formation.spacing_m=3").expect("an override")];
    assert!(Scenario::read(&source, &overrides).is_ok(), "an override corrects the file");
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
        let resolved = scenario.resolved().toml;
        let again = read(&resolved).expect(&resolved);
        assert_eq!(again, scenario);
        let (a, b) = (&scenario.start.positions_m, &again.start.positions_m);
        assert!(a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits()));
        assert_eq!(again.resolved().toml, resolved);
        assert_eq!(again.resolved().sha256, scenario.resolved().sha256);
    }
}

#[test]
fn the_hash_changes_with_the_last_bit_of_a_start_position() {
    let mut scenario = read_builtin("pentagon", &[]).expect("a built-in");
    let hash = scenario.resolved().sha256;
    assert_eq!(hash.len(), 64);
    scenario.start.positions_m[(0, 0)] = scenario.start.positions_m[(0, 0)].next_up();
    assert_ne!(scenario.resolved().sha256, hash);
}

#[test]
fn random_starts_are_the_same_on_every_machine_and_keep_their_separation() {
    let random = |seed: u64, dimensions: u8| {
        let start = format!("start={{shape=\"random\", half_extent_m=8, min_separation_m=2.5, seed={seed}}}");
        read_builtin("pentagon", &[&start, &format!("swarm.dimensions={dimensions}")]).expect("room enough")
    };
    let plane = random(1, 2);
    // Fixes the generator and the conversion of its words into positions.
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
    assert_eq!(full.expect_err("no room").code(), "scenario/no-room");
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
fn the_dimension_follows_from_vectors_outside_the_plane() {
    let space = |sets: &[&str]| read_builtin("pentagon", sets).expect("right").space;
    assert_eq!(space(&[]), Space::Plane);
    assert_eq!(space(&["swarm.dimensions=3"]), Space::Volume);
    assert_eq!(space(&["start.positions_m.1=[3, 0, 0.1]"]), Space::Volume);
    assert_eq!(space(&["start={shape=\"sphere\", radius_m=5}"]), Space::Volume);
    assert_eq!(space(&["formation={shape=\"sphere\", radius_m=5}"]), Space::Volume);
}

#[test]
fn a_scenario_built_in_code_equals_that_of_a_file() {
    let file = read(RIGHT).expect("right");
    let start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]));
    let code = Scenario::new("pair", start, Formation::line(2, 3.0), 2.0, 1.0);
    assert_eq!(code, file);
    assert_eq!(code.validate(), Ok(()));
    let mut wrong = code;
    wrong.mass_kg.pop();
    let error = wrong.validate().expect_err("a mass is missing");
    assert_eq!(error.to_string().lines().next(), Some("swarm.mass_kg: 1 masses for 2 vehicles"));
    assert!(error.place.is_none());
}

#[test]
fn an_invalid_scenario_built_in_code_is_refused_without_panic() {
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
        // The text must not make the reader panic either.
        let _ = read(&scenario.resolved().toml);
    }
}
