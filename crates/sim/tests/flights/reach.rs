//! Given slots are reached under the displacement law: on any connected graph, with deadlock recovery where vehicles
//! block each other, without a violation, and with the energy below its bound.
//!
//! By default: 2 random starts of each case and 6 of the 60 orderings of the pentagon. 16 or 27 vehicles replace 100
//! or 500, which `TAUTLINE_LONG=1` flies. `TAUTLINE_REACH_STARTS=20 cargo test --release --test flights reach:: --
//! --nocapture` flies 20 starts of every case in full and all orderings. It prints the table of docs/validation.md.
//!
//! Rapier with its defaults, a22 = 0.1 1/s. A flight ends once the formation has been held for `arrival.hold_s`, or
//! after 300 s.

use tautline_audit::Status;
use tautline_core::record::Sink as _;
use tautline_laws::formation::{Formation, Freedom};
use tautline_laws::law::{EdgeTension, VoidReason};
use tautline_laws::target::DeadlockMode;
use tautline_sim::metrics::Metrics;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::Simulation;

use crate::flight::read;
use crate::numbers::Numbers;

const DURATION_S: f64 = 300.0;
/// Distances of slots and of starts relative to delta = 1 m.
const SLOTS: f64 = 1.6;
const STARTS: f64 = 1.3;
/// Share of the plane and of space that is filled by the discs and balls of separated starts.
const FILLED_PLANE: f64 = 0.35;
const FILLED_SPACE: f64 = 0.2;
/// Relative error of the energy by second-order integration.
const ENERGY_ROUNDING: f64 = 1e-3;

/// Returns the number of starts per case, if the environment gives one.
fn starts_per_case() -> Option<u64> {
    std::env::var("TAUTLINE_REACH_STARTS").ok().map(|n| n.parse().expect("a number"))
}

/// Returns the smaller number of vehicles by default, the larger one in long runs.
fn vehicles(few: usize, all: usize) -> usize {
    let is_thorough = starts_per_case().is_some() || std::env::var_os("TAUTLINE_LONG").is_some();
    if is_thorough { all } else { few }
}

/// Target slots.
#[derive(Clone, Copy)]
enum Slots {
    Circle(usize),
    Grid(usize),
    Sphere(usize),
    Cube(usize),
}

impl Slots {
    fn count(self) -> usize {
        let (Self::Circle(count) | Self::Grid(count) | Self::Sphere(count) | Self::Cube(count)) = self;
        count
    }

    fn keys(self) -> String {
        let radius_m = |unit: Formation| SLOTS / unit.min_distance().expect("two slots").1;
        match self {
            Self::Circle(count) => {
                format!("shape = \"circle\", radius_m = {}", radius_m(Formation::circle(count, 1.0)))
            }
            Self::Grid(_) => format!("shape = \"grid\", spacing_m = {SLOTS}"),
            Self::Sphere(count) => {
                format!("shape = \"sphere\", radius_m = {}", radius_m(Formation::sphere(count, 1.0)))
            }
            Self::Cube(_) => format!("shape = \"cube\", spacing_m = {SLOTS}"),
        }
    }

    /// Returns half the side of the square or cube of the start \[m\].
    fn half_extent_m(self) -> f64 {
        let (count, radius_m) = (self.count() as f64, 0.5 * STARTS);
        match self {
            Self::Circle(_) | Self::Grid(_) => {
                0.5 * (count * std::f64::consts::PI * radius_m.powi(2) / FILLED_PLANE).sqrt()
            }
            Self::Sphere(_) | Self::Cube(_) => {
                0.5 * (count * std::f64::consts::PI / 0.75 * radius_m.powi(3) / FILLED_SPACE).cbrt()
            }
        }
    }

    /// Returns the scenario with the random start and the random graph of a seed.
    fn scenario(self, graph: &str, assignment: &str, seed: u64) -> Scenario {
        let (count, keys, half_extent_m) = (self.count(), self.keys(), self.half_extent_m());
        let graph = match graph {
            "random" => format!("kind = \"edges\", edges = {:?}", random_edges(count, seed)),
            named => format!("kind = \"{named}\""),
        };
        read(&format!(
            "swarm = {{ count = {count}, a22_per_s = 0.1 }}\n\
             start = {{ shape = \"random\", half_extent_m = {half_extent_m}, min_separation_m = {STARTS}, seed = \
             {seed} }}\n\
             formation = {{ {keys}, assignment = \"{assignment}\" }}\n\
             law = {{ kind = \"displacement\", delta_m = 1.0 }}\n\
             graph = {{ {graph} }}\n\
             time = {{ duration_s = {DURATION_S:?} }}\n"
        ))
    }
}

/// Returns a tree in which each vehicle is linked with a random earlier one, and as many random links again.
fn random_edges(count: usize, seed: u64) -> Vec<[usize; 2]> {
    let mut numbers = Numbers(seed.wrapping_add(1).wrapping_mul(0x9fb2_1c65_1e98_df25));
    let mut edges: Vec<[usize; 2]> = (2..=count).map(|vehicle| [numbers.below(vehicle - 1) + 1, vehicle]).collect();
    while edges.len() < 2 * count {
        let [a, b] = [numbers.below(count) + 1, numbers.below(count) + 1];
        let edge = [a.min(b), a.max(b)];
        if a != b && !edges.contains(&edge) {
            edges.push(edge);
        }
    }
    edges
}

/// Result of a flight.
struct Flown {
    reached_at_s: Option<f64>,
    recoveries: usize,
    assignments: usize,
    separation_m: f64,
    /// Description of a violated property.
    broken: Option<String>,
}

/// Flies until the formation has been held.
fn fly(scenario: &Scenario) -> Flown {
    let mut simulation = Simulation::new(scenario).expect("a flight");
    let mut metrics =
        Metrics::new(&scenario.legs, &scenario.graph, scenario.arrival).with_freedom(Freedom::Translation);
    let mut highest = 0.0_f64;
    let reached_at_s = loop {
        for event in simulation.events() {
            metrics.event(&event).expect("kept");
        }
        if let Some(sample) = simulation.sample() {
            metrics.observe(&sample);
            highest = highest.max(sample.energy.expect("an energy")).max(sample.peaks.energy.unwrap_or(0.0));
        }
        let reached_at_s = metrics.finish().reached_at_s;
        if reached_at_s.is_some() || simulation.ending().is_some() {
            break reached_at_s;
        }
        simulation.step();
    };
    let flight = simulation.finish();
    let separation_m = flight.audit.closest.expect("a pair").separation_m;
    let broken = match flight.certificate.certified_m {
        _ if flight.audit.status != Status::Clear => Some(format!("came to {separation_m} m")),
        Some(certified_m) if separation_m < certified_m => {
            Some(format!("came to {separation_m} m, certified {certified_m} m"))
        }
        Some(certified_m) => {
            let slots_m = scenario.formation().min_distance().expect("two slots").1;
            let promised = EdgeTension::new(1.0, scenario.delta_m, slots_m).expect("a tension").value(certified_m);
            let is_more = highest > promised * (1.0 + ENERGY_ROUNDING);
            is_more.then(|| format!("an energy of {highest}, bound {promised}"))
        }
        // The energy is so large that the bound cannot be distinguished from delta.
        None => (flight.certificate.void != [VoidReason::Unresolved]).then(|| "no certificate".to_owned()),
    };
    let (recoveries, assignments) = (flight.deadlock_recoveries.len(), flight.assignments.len());
    Flown { reached_at_s, recoveries, assignments, separation_m, broken }
}

/// Flies a case, prints its row of the table, and returns the failures.
fn judge(name: &str, scenarios: impl Iterator<Item = Scenario>) -> Vec<String> {
    let flown: Vec<Flown> = scenarios.map(|scenario| fly(&scenario)).collect();
    let mut times_s: Vec<f64> = flown.iter().filter_map(|flown| flown.reached_at_s).collect();
    times_s.sort_by(f64::total_cmp);
    let counted = |count: fn(&Flown) -> usize| {
        let some = flown.iter().filter(|flown| count(flown) > 0).count();
        format!("{some} ({})", flown.iter().map(count).max().unwrap_or(0))
    };
    println!(
        "| {name} | {} of {} | {:.1} | {:.1} | {} | {} | {:.4} |",
        times_s.len(),
        flown.len(),
        times_s.get(times_s.len() / 2).unwrap_or(&f64::NAN),
        times_s.last().unwrap_or(&f64::NAN),
        counted(|flown| flown.recoveries),
        counted(|flown| flown.assignments),
        flown.iter().map(|flown| flown.separation_m).fold(f64::INFINITY, f64::min),
    );
    let wrong = |(start, flown): (usize, &Flown)| {
        let late =
            flown.reached_at_s.is_none().then(|| format!("not reached, {} deadlock recoveries", flown.recoveries));
        Some(format!("{name}, start {start}: {}", flown.broken.clone().or(late)?))
    };
    flown.iter().enumerate().filter_map(wrong).collect()
}

/// Flies random starts to slots on several graphs.
fn reach(slots: Slots, name: &str, graphs: &[&str], starts: u64) {
    let case = |graph: &&str| {
        judge(
            &format!("{} {name}, {graph}", slots.count()),
            (0..starts).map(|seed| slots.scenario(graph, "given", seed)),
        )
    };
    let wrong: Vec<String> = graphs.iter().flat_map(case).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

const ALL_GRAPHS: [&str; 5] = ["complete", "star", "ring", "path", "random"];
const DENSE_GRAPHS: [&str; 3] = ["complete", "star", "random"];

/// Returns a start near a line, 3 m apart, with an order of the pentagon's vehicles.
fn ordering(order: [usize; 5], number: u64) -> Scenario {
    let mut numbers = Numbers(number.wrapping_add(1).wrapping_mul(0xd6e8_feb8_6659_fd93));
    let mut places = [[0.0; 2]; 5];
    for (place, &vehicle) in order.iter().enumerate() {
        places[vehicle] = [3.0 * place as f64, numbers.between(-0.05, 0.05)];
    }
    read(&format!(
        "swarm = {{ a22_per_s = 0.1 }}\n\
         start = {{ positions_m = {places:?} }}\n\
         formation = {{ shape = \"pentagon\", side_m = 3.0 }}\n\
         law = {{ kind = \"displacement\", delta_m = 2.0 }}\n\
         time = {{ duration_s = {DURATION_S:?} }}\n"
    ))
}

/// Returns all orders of five, one of each pair of mirror images.
fn orderings() -> Vec<[usize; 5]> {
    let codes = (0..5_usize.pow(5)).map(|code| [4, 3, 2, 1, 0].map(|place| code / 5_usize.pow(place) % 5));
    codes.filter(|order| (0..5).all(|vehicle| order.contains(&vehicle)) && order[0] < order[4]).collect()
}

/// The law of the paper reaches the pentagon from 26 of them.
#[test]
fn the_pentagon_is_reached_from_every_order_of_its_vehicles() {
    let every = if starts_per_case().is_some() { 1 } else { 10 };
    let starts = orderings().into_iter().zip(0..).step_by(every).map(|(order, number)| ordering(order, number));
    let wrong = judge("pentagon from every ordering, complete", starts);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_circle_of_12_is_reached_on_every_graph() {
    reach(Slots::Circle(12), "on a circle", &ALL_GRAPHS, starts_per_case().unwrap_or(2));
}

#[test]
fn a_sphere_of_30_is_reached_on_every_graph() {
    reach(Slots::Sphere(30), "on a sphere", &ALL_GRAPHS, starts_per_case().unwrap_or(2));
}

#[test]
fn a_grid_of_100_is_reached() {
    reach(Slots::Grid(vehicles(16, 100)), "in a grid", &DENSE_GRAPHS, starts_per_case().unwrap_or(2));
}

#[test]
fn a_grid_of_100_is_reached_by_interchangeable_vehicles() {
    let starts = starts_per_case().unwrap_or(2);
    let slots = Slots::Grid(vehicles(16, 100));
    let case = |assignment: &str| {
        let scenarios = (0..starts).map(|seed| slots.scenario("complete", assignment, seed));
        judge(&format!("{} in a grid, complete, {assignment}", slots.count()), scenarios)
    };
    let wrong = [case("when-stalled"), case("optimal")].concat();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Remaining limitation: on a path, 100 vehicles block each other through eight deadlock recoveries, without a
/// violation. Steps are up to 34 times shorter, so two starts suffice.
#[test]
fn a_grid_of_100_is_reached_on_a_ring_and_clear_on_a_path() {
    let slots = Slots::Grid(vehicles(16, 100));
    reach(slots, "in a grid", &["ring"], 2);
    let scenarios = (0..2).map(|seed| slots.scenario("path", "given", seed));
    let wrong = judge(&format!("{} in a grid, path", slots.count()), scenarios);
    assert!(wrong.iter().all(|said| said.contains("not reached")), "{}", wrong.join("\n"));
}

#[test]
fn a_sphere_of_100_is_reached() {
    reach(Slots::Sphere(vehicles(16, 100)), "on a sphere", &DENSE_GRAPHS, starts_per_case().unwrap_or(2));
}

#[test]
fn a_cube_of_500_is_reached() {
    reach(Slots::Cube(vehicles(27, 500)), "in a cube", &DENSE_GRAPHS[..2], starts_per_case().unwrap_or(2));
}

/// Negative control: without deadlock recovery some flights do not arrive.
#[test]
fn stalled_flights_arrive_only_with_deadlock_recovery() {
    let reached = |mode: DeadlockMode| {
        let flown = (0..3).map(|seed| {
            let mut scenario = Slots::Circle(12).scenario("path", "given", seed);
            scenario.deadlock.mode = mode;
            fly(&scenario)
        });
        flown.filter(|flown| flown.reached_at_s.is_some()).count()
    };
    assert_eq!(reached(DeadlockMode::Auto), 3);
    assert!(reached(DeadlockMode::Off) < 3);
}
