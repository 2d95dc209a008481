use nalgebra::Vector3;

use super::*;
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;
use tautline_laws::law::EdgeTension;

use crate::scenario::{Override, PlantSpec, Source, Space};

/// Resolution of printed certified separations, 6 digits.
const PRINTED_M: f64 = 1e-6;
/// A few roundings of numbers of order 1.
const ROUNDING: f64 = 1e-12;

fn scenario(name: &str, sets: &[&str]) -> Scenario {
    let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect("a key and a value")).collect();
    Scenario::read(&Source::Builtin(name.to_owned()), &overrides).expect("a scenario")
}

fn check(scenario: &Scenario) -> Preflight {
    Preflight::of(scenario).expect("a law")
}

fn codes(scenario: &Scenario) -> Vec<Code> {
    check(scenario).warnings.iter().map(|warning| warning.code).collect()
}

/// Returns vehicles with delta = 1 m that start slightly off a formation of radius 10 m.
fn swarm(formation: Formation, graph: Graph, a22_per_s: f64) -> Scenario {
    let mut start = Swarm::at_rest(&formation.slots_m * 1.5);
    start.positions_m[(0, 1)] += 0.1;
    let mut scenario = Scenario::new("swarm", start, formation, 1.0, 10.0);
    scenario.graph = graph;
    scenario.a22_per_s = a22_per_s;
    scenario.plant = PlantSpec::Rapier;
    scenario.validate().expect("a scenario that can be flown");
    scenario
}

fn ring(count: usize, graph: Graph, a22_per_s: f64) -> Scenario {
    swarm(Formation::circle(count, 10.0), graph, a22_per_s)
}

/// The law of the sensed start has no command, so a flight ends before its first step.
#[test]
fn a_flight_that_ends_at_its_start_is_refused() {
    let mut ended = 0;
    for seed in 0..20 {
        let noise = ["sensing.position_noise_m=1", "sensing.rate_hz=100"];
        let noisy = scenario("pentagon", &[&[&*format!("noise.seed={seed}")], &noise[..]].concat());
        let ends = Simulation::new(&noisy).expect("a flight").ending().is_some();
        let found = check(&noisy);
        assert_eq!(found.refusing().contains(&"ends-at-start"), ends, "seed {seed}: {:?}", found.warnings);
        assert_eq!(found.warnings.iter().any(|warning| warning.message.contains("[sensing]")), ends, "seed {seed}");
        ended += u32::from(ends);
    }
    assert!(ended > 0 && ended < 20, "{ended}");
}

#[test]
fn a_first_step_that_bends_too_far_is_refused() {
    for (halvings, is_refused) in [(0, true), (12, false)] {
        let law = ["plant.kind=ideal", "shield.enabled=true", "law.kind=laplacian"];
        let bent = scenario("swap", &[&law[..], &[&format!("time.max_halvings={halvings}")]].concat());
        let found = check(&bent);
        assert_eq!(found.refusing().contains(&"ends-at-start"), is_refused, "{halvings}: {:?}", found.warnings);
        let mut simulation = Simulation::new(&bent).expect("a flight");
        simulation.step();
        assert_eq!(simulation.steps() == 0, is_refused, "{halvings}");
    }
}

#[test]
fn the_pentagon_has_the_known_numbers() {
    let found = check(&scenario("pentagon", &[]));
    assert!((found.certified_m.expect("a certificate") - 2.055_307).abs() < PRINTED_M);
    assert_eq!(found.algebraic_connectivity, 5.0);
    assert!((found.velocity_margin_per_s.expect("a margin") - 1.0).abs() < ROUNDING);
    assert_eq!(found.common_mode_rate_per_s, 0.1);
    assert_eq!((found.start_dimension, found.formation_dimension), (2, 2));
    assert_eq!((found.rigidity.rank, found.rigidity.needed, found.rigidity.rigid), (Some(7), 7, Some(true)));
    assert!((found.start_margin_m.expect("a pair") - (9.01_f64.sqrt() - 2.0)).abs() < ROUNDING);
    assert!((found.formation_margin_m.expect("a pair") - 1.0).abs() < ROUNDING);
    assert!((found.dt_max_s.expect("a bound") * 387.0 - 1.0).abs() < 5e-3, "{:?}", found.dt_max_s);
    let codes: Vec<_> = found.warnings.iter().map(|warning| warning.code).collect();
    assert_eq!(codes, []);
    assert_eq!(found.drift_note, None);
    assert!(!found.refuses());
}

#[test]
fn a_flight_without_traps_has_no_warnings() {
    let quiet = scenario("pentagon", &["swarm.a22_per_s=0", "time.dt_s=0.0025"]);
    assert_eq!(check(&quiet).warnings, []);
}

#[test]
fn relative_velocities_of_a_star_are_damped_up_to_ten_vehicles_and_not_beyond() {
    for (count, margin_per_s, unstable) in [(10, 0.01, false), (11, 0.0, true), (12, -0.1 / 12.0, true)] {
        let star = ring(count, Graph::star(count), 0.1);
        let found = check(&star);
        assert!((found.velocity_margin_per_s.expect("a margin") - margin_per_s).abs() < ROUNDING, "{count}");
        assert_eq!(codes(&star).contains(&Code::RelativeVelocityUnstable), unstable, "{count}");
        assert_eq!(found.refuses(), unstable);
        assert_eq!(found.certified_edges_m.is_some(), !unstable, "edges are certified where the energy decays");
        assert_eq!(found.text().contains("joined by an edge never come closer than"), !unstable);
        assert!(
            !found.text().contains("algebraic convergence") && !found.text().contains("may grow"),
            "{}",
            found.text()
        );
    }
    assert!(check(&ring(10, Graph::star(10), 0.1)).text().contains("exponential convergence of the edges' lengths"));
    assert!(!codes(&ring(12, Graph::star(12), 0.0)).contains(&Code::RelativeVelocityUnstable));
}

#[test]
fn a_large_star_is_refused_by_its_connectivity() {
    let count = 1001;
    let radius_m = 2.0 * count as f64;
    let star = swarm(Formation::circle(count, radius_m), Graph::star(count), 0.1);
    let found = check(&star);
    assert_eq!((found.algebraic_connectivity, found.velocity_margin_per_s), (1.0, Some(1.1 / 1001.0 - 0.1)));
    assert_eq!((found.rigidity.rank, found.rigidity.rigid), (None, Some(false)));
    assert!(found.refuses());
    let undamped = swarm(Formation::circle(count, radius_m), Graph::star(count), -0.1);
    assert!(!check(&undamped).refuses(), "drag damps relative velocities on every graph");
}

#[test]
fn a_drift_is_described_and_refused_beyond_the_position_resolution() {
    let noted = |sets: &[&str]| {
        let found = check(&scenario("pentagon", sets));
        assert_eq!(found.warnings, [], "a note is no warning");
        found.drift_note
    };
    // In 297 s the drift is 0.018 m, below 1 % of delta.
    assert_eq!((noted(&[]), noted(&["time.duration_s=297"])), (None, None));
    let harmless = noted(&["time.duration_s=300"]).expect("a visible drift");
    assert!(
        harmless.contains("in 300 s rounding grows to about 0.00237 m/s and carries the whole swarm 0.0237 m away"),
        "{harmless}"
    );
    assert!(harmless.ends_with("this changes no separation"), "{harmless}");
    let fine = ["arrival.edge_error_m=1e-6", "time.duration_s=521", "time.dt_s=0.5", "time.record_hz=1"];
    let felt = noted(&fine).expect("a visible drift");
    assert!(felt.contains("position resolution is"), "{felt}");
    let said = |sets: &[&str]| {
        let found = check(&scenario("pentagon", sets));
        let warning = found.warnings.iter().find(|warning| warning.message.contains("mean velocity grows"));
        let warning = warning.expect("a drift").clone();
        (warning.code, warning.message)
    };
    let (code, summed) = said(&[&fine[..2], &["time.dt_s=0.01", "time.record_hz=1"]].concat());
    assert!(code == Code::DriftUnresolved && summed.contains("the rounding of all steps adds up to"), "{summed}");
    let (end, uncounted) = ("time.duration_s=900", "swarm.a22_per_s=100");
    for sets in [&["swarm.a22_per_s=0.5"][..], &[end], &[uncounted], &[uncounted, end]] {
        let (code, ruinous) = said(sets);
        assert!(code == Code::DriftUnresolved && !ruinous.contains("NaN"), "{ruinous}");
        let found = check(&scenario("pentagon", sets));
        assert!(found.refuses() && found.headline() == "REFUSED: drift-unresolved", "{}", found.headline());
        assert_eq!(found.drift_note, None, "reported once");
    }
    assert!(!check(&scenario("pentagon", &["time.duration_s=400"])).refuses());
}

#[test]
fn the_margin_of_the_baseline_is_that_of_its_own_gain() {
    let found = check(&scenario("pentagon-laplacian", &["law.f2_per_s=0.3"]));
    assert!((found.velocity_margin_per_s.expect("a margin") - 0.2).abs() < ROUNDING);
    assert!(check(&scenario("pentagon-laplacian", &["law.f2_per_s=0.05"])).refuses());
}

#[test]
fn a_start_on_a_line_is_refused_where_the_formation_leaves_it() {
    let line = scenario("pentagon-collinear", &[]);
    assert_eq!((check(&line).start_dimension, codes(&line)[0]), (1, Code::StartOnLine));
    assert!(check(&line).refuses());
    let jittered = scenario("pentagon-collinear", &["start.jitter_m=0.01"]);
    assert!(!codes(&jittered).contains(&Code::StartOnLine));
    let baseline = "law={kind=\"laplacian\", delta_m=2.0}";
    assert!(!codes(&scenario("pentagon-collinear", &[baseline])).contains(&Code::StartOnLine));
    let (start, formation) = (Formation::line(4, 3.0), Formation::line(4, 2.0));
    let shrink = Scenario::new("shrink", Swarm::at_rest(start.slots_m), formation, 1.0, 10.0);
    assert!(!codes(&shrink).contains(&Code::StartOnLine), "a line is reached from a line");
}

#[test]
fn only_relative_velocities_leave_a_line() {
    let mut line = scenario("pentagon-collinear", &["swarm.a22_per_s=0"]);
    line.start.velocities_m_s.column_mut(1).fill(1.0);
    assert_eq!(check(&line).start_dimension, 1);
    line.start.velocities_m_s[(2, 1)] = 1.1;
    assert_eq!(check(&line).start_dimension, 2);
    assert!(!check(&line).refuses());
}

#[test]
fn a_start_in_a_plane_is_refused_where_the_formation_leaves_it() {
    let sphere = Formation::sphere(8, 5.0);
    let mut flat = Scenario::new("flat", Swarm::at_rest(Formation::grid(8, 3.0).slots_m), sphere.clone(), 1.0, 10.0);
    assert_eq!(codes(&flat)[0], Code::StartInPlane);
    assert!(check(&flat).refuses() && check(&flat).warnings[0].message.contains("in a plane"));
    set_row(&mut flat.start.positions_m, 3, Vector3::new(10.0, 0.0, 0.5));
    assert!(!codes(&flat).contains(&Code::StartInPlane));
    flat.start = Swarm::at_rest(Formation::line(8, 3.0).slots_m);
    assert_eq!(codes(&flat)[0], Code::StartOnLine);
    let solid = Scenario::new("solid", Swarm::at_rest(&sphere.slots_m * 2.0), sphere, 1.0, 10.0);
    assert_eq!(codes(&solid), [], "a sphere from a larger one");
}

#[test]
fn a_flat_formation_in_space_converges_algebraically() {
    let circle = scenario("circle", &["swarm.dimensions=3"]);
    let found = check(&circle);
    assert!(codes(&circle).contains(&Code::FlatFormationInSpace) && !codes(&circle).contains(&Code::NotRigid));
    assert_eq!((found.rigidity.rank, found.rigidity.needed, found.rigidity.rigid), (Some(9), 12, Some(false)));
    assert!(!codes(&scenario("circle", &[])).contains(&Code::FlatFormationInSpace));
    let mut triangle = ring(3, Graph::complete(3), 0.0);
    triangle.space = Space::Volume;
    assert_eq!(check(&triangle).rigidity.rigid, Some(true), "three slots are rigid in space");
    assert_eq!(codes(&triangle), []);
}

#[test]
fn a_formation_with_too_few_edges_is_not_rigid() {
    // Two triangles on a common side are rigid in the plane; without that side the square shears.
    let sides = [(0, 1), (1, 2), (2, 3), (3, 0)];
    let braced: Vec<_> = sides.into_iter().chain([(0, 2)]).collect();
    let graph = |edges: &[(usize, usize)]| Graph::from_edges(4, edges).expect("a graph");
    let (loose, tight) = (ring(4, graph(&sides), 0.0), ring(4, graph(&braced), 0.0));
    assert_eq!((check(&loose).rigidity.rank, check(&loose).rigidity.needed), (Some(4), 5));
    assert!(codes(&loose).contains(&Code::NotRigid));
    assert_eq!((check(&tight).rigidity.rank, check(&tight).rigidity.rigid), (Some(5), Some(true)));
    assert!(!codes(&tight).contains(&Code::NotRigid));
    let mut in_space = loose;
    in_space.space = Space::Volume;
    assert!(codes(&in_space).contains(&Code::NotRigid) && codes(&in_space).contains(&Code::FlatFormationInSpace));
}

#[test]
fn a_degenerate_formation_with_enough_edges_is_not_rigid() {
    // Two triangles joined by three bars: rigid, but for parallel bars of equal length, along which it shears.
    let edges = [(0, 1), (1, 2), (0, 2), (3, 4), (4, 5), (3, 5), (0, 3), (1, 4), (2, 5)];
    let prism = |shift_m: f64| {
        let points = [[0.0, 0.0], [4.0, 0.0], [2.0, 3.0], [0.0, 9.0], [4.0 + shift_m, 9.0], [2.0, 12.0]];
        let formation = Formation::points(Rows::from_fn(6, |i, axis| if axis < 2 { points[i][axis] } else { 0.0 }));
        Rigidity::of(&formation, &Graph::from_edges(6, &edges).expect("a graph"), 2)
    };
    assert_eq!((prism(0.0).rank, prism(0.0).rigid), (Some(8), Some(false)));
    assert_eq!((prism(1.0).rank, prism(1.0).rigid), (Some(9), Some(true)));
}

#[test]
fn the_closed_form_of_the_complete_graph_is_the_counted_rank() {
    for formation in [
        Formation::line(5, 2.0),
        Formation::circle(6, 3.0),
        Formation::grid(9, 2.0),
        Formation::sphere(7, 3.0),
        Formation::circle(2, 3.0),
        Formation::circle(3, 3.0),
        Formation::sphere(40, 9.0),
    ] {
        let graph = Graph::complete(formation.count());
        assert_eq!(
            Rigidity::of(&formation, &graph, 3).rank,
            Some(stability::rank(&formation, &graph)),
            "{formation:?}"
        );
    }
}

#[test]
fn the_constraints_needed_are_those_of_a_rigid_body() {
    let needed =
        |count, dimensions| Rigidity::of(&Formation::line(count, 1.0), &Graph::complete(count), dimensions).needed;
    assert_eq!([2, 3, 4, 5].map(|count| needed(count, 2)), [1, 3, 5, 7]);
    assert_eq!([2, 3, 4, 5].map(|count| needed(count, 3)), [1, 3, 6, 9]);
}

#[test]
fn nothing_is_certified_without_a_barrier_or_a_complete_graph() {
    let star = ring(5, Graph::star(5), 0.0);
    for (scenario, reason) in
        [(star, VoidReason::GraphNotComplete), (scenario("pentagon-laplacian", &[]), VoidReason::NoBarrier)]
    {
        let found = check(&scenario);
        assert!(codes(&scenario).contains(&Code::NoCertificate) && found.certified_m.is_none());
        assert!(found.certificate_void.contains(&reason), "{:?}", found.certificate_void);
    }
    assert!(!codes(&ring(5, Graph::complete(5), 0.0)).contains(&Code::NoCertificate));
}

#[test]
fn the_longest_step_follows_the_fastest_mode() {
    let pentagon = scenario("pentagon", &[]);
    let found = check(&pentagon);
    let tension = EdgeTension::new(1.0, 2.0, 3.0).expect("a tension");
    let omega_per_s = 0.3 / found.dt_max_s.expect("a bound");
    // Stiffness of the stiffest pair at the certified separation, by finite differences of V'.
    let (l, h) = (found.certified_m.expect("a certificate"), 1e-6);
    let stiffness_per_s2 = (tension.derivative(l + h) - tension.derivative(l - h)) / (2.0 * h);
    assert!((omega_per_s.powi(2) / stiffness_per_s2 - 1.0).abs() < 1e-6);
    // No other pair is stiffer there, and no pull is stiffer across its edge.
    for d in [3.0, 3.5, 27.0_f64.sqrt(), 6.0] {
        let other = EdgeTension::new(1.0, 2.0, d).expect("a tension");
        let nearest_m = other.push_side_root(5.0 * found.energy_initial.expect("an energy"));
        assert!(other.second_derivative(nearest_m) <= omega_per_s.powi(2) * (1.0 + ROUNDING));
        let across = (1..2000).map(|k| f64::from(k) * 0.01 + 2.06).map(|l| other.derivative(l) / l);
        assert!(across.fold(0.0, f64::max) < other.second_derivative(d));
    }
    assert!(!codes(&scenario("pentagon", &["time.dt_s=0.5"])).iter().any(|code| code.code().starts_with("dt")));
}

#[test]
fn the_longest_step_of_soft_laws_follows_their_damping() {
    let wide = swarm(Formation::circle(5, 1e6), Graph::complete(5), 0.0);
    assert_eq!(check(&wide).dt_max_s, Some(0.3), "relative velocities decay at 1/s");
    let baseline = |sets: &[&str]| check(&scenario("pentagon-laplacian", sets)).dt_max_s.expect("a bound");
    assert!((baseline(&[]) - 0.3).abs() < ROUNDING);
    assert!((baseline(&["law.f1_per_s2=9"]) - 0.1).abs() < ROUNDING);
    assert!((baseline(&["law.f2_per_s=6.1"]) - 0.05).abs() < ROUNDING);
    assert_eq!(check(&ring(5, Graph::star(5), 0.0)).dt_max_s, None);
}

#[test]
fn a_large_complete_swarm_is_checked_without_its_matrices() {
    let count = 1000;
    let found = check(&swarm(Formation::sphere(count, 100.0), Graph::complete(count), 0.0));
    assert_eq!((found.algebraic_connectivity, found.rigidity.rank), (1000.0, Some(3 * count - 6)));
    assert_eq!(found.rigidity.rigid, Some(true));
}

#[test]
fn the_json_has_the_promised_keys_and_codes() {
    let json = serde_json::to_value(check(&scenario("circle", &["swarm.dimensions=3"]))).expect("plain data");
    let keys = [
        "algebraic_connectivity",
        "connectivity_is",
        "velocity_margin_per_s",
        "common_mode_rate_per_s",
        "certified_m",
        "certificate_void",
        "dt_max_s",
        "dt_links_s",
        "samples",
        "recording_bytes",
        "start_dimension",
        "formation_dimension",
        "rigidity",
        "warnings",
        "energy_initial",
        "start_margin_m",
        "certified_edges_m",
        "drift_m",
        "spacing_m",
    ];
    for key in keys {
        assert!(json.get(key).is_some(), "{key}");
    }
    assert_eq!(json["connectivity_is"], "solved");
    let circle = scenario("circle", &[]);
    circle.graph.clone().mark_connectivity_as_bound();
    let bound = check(&circle);
    assert_eq!(serde_json::to_value(&bound).expect("plain data")["connectivity_is"], "bound");
    assert!(bound.text().contains("a lower bound"), "{}", bound.text());
    assert_eq!(json["rigidity"], serde_json::json!({"rank": 9, "needed": 12, "rigid": false}));
    for warning in json["warnings"].as_array().expect("a list") {
        assert_eq!(warning.as_object().expect("a table").keys().collect::<Vec<_>>(), ["code", "message"]);
    }
    for code in Code::ALL {
        assert_eq!(serde_json::to_value(code).expect("a name"), code.code());
    }
}

#[test]
fn the_text_matches_the_numbers() {
    let pentagon = check(&scenario("pentagon", &[]));
    assert_eq!(
        pentagon.headline(),
        "READY: certified never closer than 2.055307 m in continuous time (delta 2 m), no warnings"
    );
    let text = pentagon.text();
    for said in
        ["margin of relative velocities 1.000000 1/s", "0.00417 s, divided down to ", "rank 7: in the plane rigid"]
    {
        assert!(text.contains(said), "{said:?} in\n{text}");
    }
    let line = check(&scenario("pentagon-collinear", &[]));
    assert_eq!(line.headline(), "REFUSED: start-on-line");
    assert!(line.warnings[0].to_string().starts_with("warning [start-on-line]: The start lies on a line"));
    assert_eq!([0.0, 0.3, 1.5, 2.5e-7].map(warning::significant), ["0.00", "0.300", "1.50", "2.50e-7"]);
}

#[test]
fn a_law_whose_links_are_too_fast_for_the_shortest_steps_is_refused() {
    let stiff = ["law.kind=displacement", "law.zeta_per_s=1e5", "graph.kind=path", "time.dt_s=4e-3"];
    let refused = check(&scenario("pentagon", &stiff));
    assert!(refused.refuses() && codes(&scenario("pentagon", &stiff)).contains(&Code::StepTooLong));
    assert!(refused.headline().contains("step-too-long"), "{}", refused.headline());
    for fine in [
        &stiff[..1],
        &stiff[..3],
        &[&stiff[..3], &["time.dt_s=1e-5"]].concat(),
        &[&stiff[..], &["plant.kind=ideal"]].concat(),
    ] {
        assert!(!codes(&scenario("pentagon", fine)).contains(&Code::StepTooLong), "{fine:?}");
    }
}

#[test]
fn a_certificate_within_the_resolution_of_delta_is_void() {
    let faint = ["law.kind=displacement", "law.alpha=1e-9", "graph.kind=path", "start.positions_m.4.x=-1e5"];
    let found = check(&scenario("pentagon", &faint));
    assert!(found.certified_m.is_none() && found.certificate_void[0] == VoidReason::Unresolved, "{found:?}");
    assert!(found.energy_initial.is_some());
    assert!(check(&scenario("pentagon", &faint[..1])).certified_m.is_some());
}

#[test]
fn margins_are_predicted_and_scenarios_beyond_them_get_a_warning() {
    let margin = |found: &Preflight, key: &str, state: ContactState| {
        found.margins.iter().find(|margin| margin.key == key && margin.state == state).copied()
    };
    let sets = ["law.kind=displacement", "swarm.a22_per_s=0"];
    let found = check(&scenario("pentagon", &sets));
    let value = |key: &str, state: ContactState| margin(&found, key, state).expect(key).value.expect("a bound");
    assert!((value("sensing.latency_s", ContactState::Free) - 0.711).abs() < 5e-4);
    assert!((value("sensing.latency_s", ContactState::InContact) - 0.0811).abs() < 5e-5);
    assert!((value("time.control_hz", ContactState::Free) - 0.5).abs() < 1e-9, "2 s between commands");
    assert!(value("time.control_hz", ContactState::InContact) > 5.0);
    assert!(value("network.latency_s", ContactState::Free) > 3.0, "each of five vehicles contributes a fifth");
    let text = found.text();
    assert!(text.contains("sensing.latency_s up to 0.711, up to 0.0811 in contact"), "{text}");

    // An edge tension has known modes only on the complete graph, other laws have none.
    assert!(!check(&scenario("pentagon", &[])).margins.is_empty());
    for sets in [&["graph.kind=ring"][..], &["law={kind=\"orca\", delta_m=2.0}", "swarm.hull_radius_m=0.2"]] {
        assert_eq!(check(&scenario("pentagon", sets)).margins, []);
    }
    // Vehicles that follow only a hub form no loop.
    let led = check(&scenario("pentagon-leader", &[]));
    assert_eq!(margin(&led, "network.latency_s", ContactState::Free).expect("a star").value, None);

    for (set, is_beyond) in [
        ("sensing.latency_s=0.70", false),
        ("sensing.latency_s=0.72", true),
        ("network.latency_s=0.72", false),
        ("time.control_hz=0.6", false),
        ("time.control_hz=0.4", true),
    ] {
        let codes = codes(&scenario("pentagon", &[sets[0], sets[1], set]));
        assert_eq!(codes.contains(&Code::BeyondMargin), is_beyond, "{set}");
    }
}
