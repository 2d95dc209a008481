//! Optional keys and their defaults, and graphs from their keys.

use tautline_laws::graph::Graph;
use tautline_sim::preflight::{Code, Preflight};
use tautline_sim::scenario::{Override, Scenario, ScenarioError, Source};

use crate::scenario_files::{RIGHT, read, read_builtin};

const MISSION: &str = r#"name = "mission"
[start]
positions_m = [[0, 0], [4, 0.1], [8, 0]]
[formation]
shape = "circle"
radius_m = 3.0
move_m = [1, 2]
[law]
kind = "displacement"
delta_m = 1.0
[[leg]]
shape = "line"
spacing_m = 3.0
start_s = 20
move_m = [0, 5]
[[leg]]
yaw_deg = 90
start_s = "reached"
[reference]
kind = "way-points"
points_m = [[0, 0], [5, 0]]
times_s = [0, 10]
[deadlock]
mode = "start"
hold_s = 3
[time]
duration_s = 60.0
"#;

fn refusal(text: &str) -> ScenarioError {
    read(text).expect_err("an invalid scenario")
}

#[test]
fn a_wrong_key_is_refused_at_its_place() {
    read(MISSION).expect("a valid scenario");
    for (name, other, code, at) in [
        ("move_m = [0, 5]", "offset_m = [0, 5]", "scenario/unknown-key", (15, 1)),
        ("\"circle\"", "\"ring\"", "scenario/unknown-choice", (5, 9)),
        ("mode = \"start\"", "mode = \"always\"", "scenario/unknown-choice", (24, 8)),
        ("\"reached\"", "\"soon\"", "scenario/unknown-choice", (18, 11)),
        ("hold_s = 3", "hold_s = -3", "scenario/out-of-range", (25, 10)),
    ] {
        assert!(MISSION.contains(name), "{name}");
        let error = refusal(&MISSION.replace(name, other));
        assert_eq!(error.code(), code, "{error}");
        assert_eq!(error.place.as_ref().map(|place| (place.line, place.column)), Some(at), "{error}");
    }
}

/// Keys of `cbf-qp` that its variant does not use, or with which it cannot brake, are refused at their place.
#[test]
fn keys_that_a_variant_of_cbf_qp_cannot_use_are_refused() {
    let mission = MISSION.replace("mode = \"start\"\nhold_s = 3\n", "");
    let with = |keys: &str| mission.replace("kind = \"displacement\"", &format!("kind = \"cbf-qp\"\n{keys}"));
    read(&with("variant = \"braking\"\nmargin_m = 0.1\napproach_per_s = 3")).expect("a valid scenario");
    for (keys, message) in [
        ("margin_m = 0.1", "margin_m is 0.1, and only the braking variant uses it"),
        ("approach_per_s = 3", "approach_per_s is 3,"),
    ] {
        let error = refusal(&with(keys));
        assert_eq!(error.code(), "law/parameter", "{error}");
        assert!(error.message.contains(message) && error.help.contains("set law.variant"), "{error}");
        assert_eq!(error.place.as_ref().map(|place| place.line), Some(10), "{error}");
    }
    let fast = with("variant = \"braking\"\nmax_speed_m_s = 9").replace("[start]", "[swarm]\na22_per_s = 0.6\n[start]");
    let error = refusal(&fast);
    assert!(error.code() == "law/parameter" && error.message.contains("max_speed_m_s is 9"), "{error}");
    assert!(error.help.contains("lower law.max_speed_m_s") && error.place.is_some(), "{error}");
}

#[test]
fn slots_must_not_be_spread_to_the_end_of_the_flight() {
    let held = refusal(&MISSION.replace("hold_s = 3", "hold_s = 60"));
    assert_eq!(held.code(), "scenario/outside-flight", "{held}");
    assert!(read(&MISSION.replace("hold_s = 3", "hold_s = 59.9")).is_ok());
}

#[test]
fn a_reference_without_a_kind_is_at_rest() {
    let resting = |keys: &str| read(&format!("{RIGHT}[reference]\n{keys}").replace("edge-tension", "displacement"));
    let (named, bare) = (resting("kind = \"rest\"\nleader = 2\n"), resting("leader = 2\n"));
    let resolved = named.expect("right").resolved().toml;
    assert!(resolved.contains("leader = 2"));
    assert_eq!(bare.expect("right").resolved().toml, resolved);
    let moving = resting("velocity_m_s = [1, 0]\n").expect_err("one at rest has no velocity");
    assert_eq!(moving.code(), "scenario/unknown-key", "{moving}");
}

#[test]
fn a_star_has_the_given_hub() {
    let graph = |sets: &[&str]| read_builtin("pentagon", sets).map(|scenario| scenario.graph);
    assert_eq!(graph(&["graph.kind=star"]).expect("right"), Graph::star(5));
    let third = Graph::from_edges(5, &[(2, 0), (2, 1), (2, 3), (2, 4)]).expect("a graph");
    assert_eq!(graph(&["graph={kind=\"star\", hub=3}"]).expect("right"), third);
    assert_eq!(Graph::star_about(5, 4), Graph::from_edges(5, &[(4, 0), (4, 1), (4, 2), (4, 3)]).expect("a graph"));
    for (hub, code) in [(0, "scenario/out-of-range"), (6, "scenario/unknown-vehicle")] {
        let wrong = graph(&[&format!("graph={{kind=\"star\", hub={hub}}}")]).expect_err("no such vehicle");
        assert_eq!(wrong.code(), code, "{wrong}");
        assert_eq!(wrong.place.as_ref().map(|place| place.column), Some(25));
    }
}

#[test]
fn a_random_graph_is_connected_and_has_the_given_degree_and_seed() {
    let graph = |keys: &str| {
        let set = format!("graph={{kind=\"random\"{keys}}}");
        read_builtin("thousand", &["law.kind=displacement", &set]).map(|scenario| scenario.graph)
    };
    let plain = graph("").expect("right");
    assert_eq!((plain.edge_count(), plain.is_connected()), (2000, true));
    assert_eq!(graph(", degree=4, seed=0").expect("right"), plain);
    assert_ne!(graph(", seed=1").expect("right"), plain);
    assert_eq!(graph(", degree=2").expect("right").edge_count(), 1000);
    assert!(graph(", degree=999").expect("right").is_complete());
    let few = read(&format!("{RIGHT}[graph]\nkind = \"random\"\n")).expect("right").graph;
    assert!(few.is_complete(), "two vehicles are each other's only link");
    assert_eq!(graph(", degree=1").expect("right").edge_count(), 999, "a tree");
    for degree in [0, 1000, u64::MAX / 2] {
        assert_eq!(graph(&format!(", degree={degree}")).expect_err("no such graph").code(), "scenario/out-of-range");
    }
}

#[test]
fn only_the_default_step_is_shortened_for_the_links() {
    let ring = |more: &str| {
        read(&format!(
            "[swarm]\ncount = 3000\n[start]\nshape = \"grid\"\nspacing_m = 2\n[formation]\nshape = \"grid\"\n\
             spacing_m = 1.6\n\
             [law]\nkind = \"displacement\"\ndelta_m = 1\n[graph]\nkind = \"ring\"\n[time]\nduration_s = 1\n{more}"
        ))
        .expect("a scenario")
    };
    let chosen = ring("");
    let needed_s = chosen.links_step_s(chosen.law().expect("a law").as_ref()).expect("links");
    assert!(chosen.time.shortest_step_s() <= needed_s && 2.0 * chosen.time.shortest_step_s() > needed_s);
    let halvings = (1.0 / 240.0 / chosen.time.dt_s).log2();
    assert!(halvings >= 1.0 && halvings.fract() == 0.0, "{halvings}");
    assert_eq!(ring("dt_s = 0.004").time.dt_s, 0.004);
    assert!(ring("max_halvings = 20").time.dt_s == 1.0 / 240.0, "its substeps are short enough");
    assert!(ring("max_halvings = 0\n").time.dt_s <= needed_s);
    assert_eq!(ring("control_hz = 25").time.dt_s, 1.0 / 240.0, "the law is not evaluated more often");
}

#[test]
fn a_step_that_cannot_be_short_enough_is_kept_and_refused() {
    let stiff = |more: &str, zeta_per_s: f64| {
        read(&format!(
            "[swarm]\ncount = 5\n[start]\nshape = \"circle\"\nradius_m = 5\n[formation]\nshape = \"circle\"\n\
             radius_m = 3\n\
             [law]\nkind = \"displacement\"\ndelta_m = 1\nk_per_s2 = 1e3\nzeta_per_s = {zeta_per_s}\n[time]\n{more}"
        ))
        .expect("a scenario")
    };
    let refused = |scenario: &Scenario| {
        Preflight::of(scenario).expect("a law").warnings.iter().any(|warning| warning.code == Code::StepTooLong)
    };
    let short = stiff("duration_s = 100", 1e6);
    assert!(short.time.dt_s < 1.0 / 240.0 && !refused(&short), "substeps within the limit");
    let (many, crazyflie) =
        (stiff("duration_s = 100", 1e9), stiff("duration_s = 100\n[vehicle]\nmodel = \"crazyflie\"", 1e6));
    assert!(many.time.dt_s == 1.0 / 240.0 && refused(&many), "5e9 substeps");
    // A step of 5e-7 s suffices; halving gives 2.5e-7 s.
    for (duration_s, is_chosen) in [(200, true), (400, false), (499, false), (600, false)] {
        let whole = stiff(&format!("max_halvings = 0\nduration_s = {duration_s}"), 1e6);
        assert_eq!((whole.time.dt_s < 5e-7, refused(&whole)), (is_chosen, !is_chosen), "{duration_s}");
    }
    assert!(crazyflie.time.dt_s == 1.0 / 500.0 && refused(&crazyflie), "evaluated 100 times a second");
}

#[test]
fn an_invalid_limit_is_refused_where_it_chooses_the_step() {
    for none in ["-1", "0", "nan"] {
        let error = read(&format!(
            "[start]\npositions_m = [[0, 0], [4, 3]]\n[formation]\nshape = \"line\"\nspacing_m = 3\n\
             [law]\nkind = \"displacement\"\ndelta_m = 1\n[time]\nduration_s = 100\nmax_rate_dt = {none}\n"
        ))
        .expect_err("no limit");
        assert_eq!(error.code(), "scenario/out-of-range", "{none}: {error}");
    }
}

#[test]
fn a_flight_shorter_than_hold_s_is_refused_at_the_override() {
    let sets = [Override::parse("time.duration_s=0.5").expect("an override")];
    let error = Scenario::read(&Source::Builtin("thousand".to_owned()), &sets).expect_err("too short");
    assert_eq!(error.code(), "scenario/outside-flight", "{error}");
    assert!(error.place.as_ref().is_some_and(|place| place.source == "set" && place.text.contains("0.5")), "{error}");
}

#[test]
fn an_assignment_around_a_leader_is_optimal_and_keeps_its_slot() {
    let (starts, slots) = ([[-5.0, 4.0], [-2.0, -2.0], [-3.0, 0.0]], [[5.0, 2.0], [-6.0, -3.0], [2.0, 1.0]]);
    let scenario = read(&format!(
        "[start]\npositions_m = {starts:?}\n[formation]\nshape = \"points\"\nassignment = \"optimal\"\n\
         points_m = {slots:?}\n\
         [law]\nkind = \"displacement\"\ndelta_m = 1.0\n[reference]\nleader = 3\n[time]\nduration_s = 2\n\
         [[leg]]\nshape = \"points\"\nassignment = \"optimal\"\npoints_m = [[9, 0], [0, 9], [0, 0]]\nstart_s = 1\n"
    ))
    .expect("a scenario");
    let ways = |from: [[f64; 2]; 3], slots: [[f64; 2]; 3]| -> f64 {
        let offset = [0, 1].map(|axis| from[2][axis] - slots[2][axis]);
        let way = |i: usize| (0..2).map(|axis| (from[i][axis] - slots[i][axis] - offset[axis]).powi(2)).sum::<f64>();
        (0..3).map(way).sum()
    };
    let of_leg = |leg: usize| {
        let slots_m = &scenario.legs[leg].formation.slots_m;
        [0, 1, 2].map(|i| [slots_m[(i, 0)], slots_m[(i, 1)]])
    };
    for (leg, from, given) in [(0, starts, slots), (1, of_leg(0), [[9.0, 0.0], [0.0, 9.0], [0.0, 0.0]])] {
        let [kept, swapped] = [given, [given[1], given[0], given[2]]].map(|slots| ways(from, slots));
        assert!((ways(from, of_leg(leg)) - kept.min(swapped)).abs() < 1e-9, "{leg}: {kept} {swapped}");
        assert!(swapped < kept, "{leg}: {kept} {swapped}");
        assert_eq!(of_leg(leg)[2], starts[2], "the leader is where it is on the reference, at the origin");
    }
}
