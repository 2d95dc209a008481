//! Random scenarios, flown in Rapier at default settings and in continuous time. Both flights agree up to the first
//! hard bounce, keep their energy bound and keep their certificates.
//!
//! The test flies 40 scenarios. `TAUTLINE_RANDOM_FLIGHTS=2000 cargo test --release --test reported random_scenarios --
//! --nocapture` flies 2,000 and prints the numbers of docs/validation.md.

use tautline_audit::Status;
use tautline_core::fact::Coded;
use tautline_core::record::OwnedSample;
use tautline_core::swarm::{Rows, Swarm, separation};
use tautline_laws::formation::Formation;
use tautline_laws::law::{EdgeTension, EdgeTensionKeys, LawSpec};
use tautline_report::report::{Reason, Report};
use tautline_report::run::{run, verify};
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::{CONTACT_PREDICTION_M, PlantSpec, Scenario};

use crate::flight::Log;
use crate::numbers::Numbers;

/// Scaled clearance (l - delta)/K of a pair below which a bounce is hard. There V'' is at least 0.7 / s^3 times that at
/// the rest length, and a bounce multiplies the difference of two flights.
const HARD: f64 = 0.1;

/// Returns random positions \[m\], `count` x 3, within `extent_m` of the origin along the first axes, each more than
/// `apart_m` from the others.
pub(crate) fn places(numbers: &mut Numbers, count: usize, axes: usize, extent_m: f64, apart_m: f64) -> Rows {
    let mut places_m = Rows::zeros(count);
    for i in 0..count {
        loop {
            for axis in 0..axes {
                places_m[(i, axis)] = numbers.between(-extent_m, extent_m);
            }
            if (0..i).all(|j| separation(&places_m, i, j) > apart_m) {
                break;
            }
        }
    }
    places_m
}

/// Returns a random scenario. Between 3 and 8 vehicles in the plane or in space start at random positions at least 1.1
/// delta apart, and form a circle or a sphere. Delta and alpha span three decades, a22 spans -2 to 0.1.
fn scenario(seed: u64) -> Scenario {
    let mut numbers = Numbers(seed.wrapping_mul(0xd134_2543_de82_ef95));
    let sixth = 6.0 * numbers.unit();
    let count = 3 + (1..6).filter(|&n| f64::from(n) <= sixth).count();
    let in_space = numbers.unit() < 0.5;
    let delta_m = numbers.over_decades(0.03, 30.0);
    let spacing_m = delta_m * numbers.between(1.2, 2.5);
    let extent_m = delta_m * numbers.between(2.0, 5.0);
    let start = places(&mut numbers, count, if in_space { 3 } else { 2 }, extent_m, 1.1 * delta_m);
    let radius_m = 0.5 * spacing_m / (std::f64::consts::PI / count as f64).sin();
    let formation =
        if in_space { Formation::sphere(count, radius_m.max(spacing_m)) } else { Formation::circle(count, radius_m) };
    let mut scenario = Scenario::new("random", Swarm::at_rest(start), formation, delta_m, 10.0);
    // Accelerations in proportion to lengths: the same motion at every scale.
    let alpha = numbers.over_decades(0.1, 100.0) * delta_m * delta_m;
    scenario.law = LawSpec::EdgeTension(EdgeTensionKeys { alpha });
    scenario.a22_per_s = numbers.between(-2.0, 0.1);
    scenario.hull_radius_m.fill(0.2 * (delta_m - CONTACT_PREDICTION_M));
    scenario.arrival.edge_error_m = 0.01 * delta_m;
    scenario.arrival.disagreement_m_s = 0.01 * delta_m;
    scenario.plant = PlantSpec::Rapier;
    scenario
}

/// Smallest separation up to a time \[m\], and the time at which the first pair reached a scaled clearance of [`HARD`].
struct Approach {
    by_time: Vec<(f64, f64)>,
    first_hard_s: f64,
}

impl Approach {
    fn of(scenario: &Scenario, log: &Log) -> Self {
        let mut least_m = f64::INFINITY;
        let mut nearer = |sample: &OwnedSample| {
            least_m = sample.separation.map_or(least_m, |closest| least_m.min(closest.separation_m));
            (sample.time_s, least_m)
        };
        let by_time: Vec<_> = log.samples.iter().map(&mut nearer).collect();
        let rest_m = scenario.formation().min_distance().map_or(f64::NAN, |(_, distance_m)| distance_m);
        let tension = EdgeTension::new(1.0, scenario.delta_m, rest_m).expect("a tension");
        let is_hard = |&&(_, least_m): &&(f64, f64)| (least_m - scenario.delta_m) / tension.k_m() < HARD;
        let first_hard_s = by_time.iter().find(is_hard).map_or(f64::INFINITY, |&(time_s, _)| time_s);
        Self { by_time, first_hard_s }
    }

    fn until(&self, time_s: f64) -> f64 {
        self.by_time.iter().take_while(|(at_s, _)| *at_s <= time_s).last().map_or(f64::NAN, |&(_, least_m)| least_m)
    }
}

struct Flown {
    report: Report,
    approach: Approach,
}

fn fly(scenario: &Scenario) -> Flown {
    let mut log = Log::default();
    let report = run(scenario, &mut log).expect("a report");
    Flown { report, approach: Approach::of(scenario, &log) }
}

/// Returns the faults of a single flight.
fn faults(report: &Report) -> impl Iterator<Item = &Reason> {
    let wrong = ["energy-rose", "certificate-broken", "detectors-disagree", "ended-early", "violation", "hulls-hit"];
    report.verdict.reasons.iter().filter(move |reason| wrong.contains(&reason.code()))
}

#[derive(Default)]
struct Tally {
    flights: u32,
    firm: u32,
    hard: u32,
    compared: u32,
    worst: f64,
    failures: Vec<String>,
}

fn judge(seed: u64, tally: &mut Tally) {
    let scenario = scenario(seed);
    scenario.validate().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    assert!(!Preflight::of(&scenario).expect("a law").refuses(), "seed {seed}");
    let engine = fly(&scenario);
    let ideal = fly(&Scenario { plant: PlantSpec::Ideal, ..scenario.clone() });
    tally.flights += 1;
    for (plant, flown) in [("rapier", &engine), ("ideal", &ideal)] {
        tally.failures.extend(faults(&flown.report).map(|fault| format!("seed {seed}, {plant}: {fault}")));
    }
    // The last sample before the first hard bounce of either flight.
    let hard_s = engine.approach.first_hard_s.min(ideal.approach.first_hard_s);
    tally.hard += u32::from(hard_s.is_finite());
    let until_s = if hard_s.is_finite() { hard_s - 1.0 / scenario.time.record_hz } else { f64::INFINITY };
    if until_s >= 0.0 {
        tally.compared += 1;
        let off = (engine.approach.until(until_s) - ideal.approach.until(until_s)).abs() / scenario.delta_m;
        tally.worst = tally.worst.max(off);
        if off > 0.01 {
            tally.failures.push(format!("seed {seed}: closest approaches differ by {off:.4} delta before {hard_s} s"));
        }
    }
    let firm = verify(&scenario, &engine.report).expect("a flight").firm;
    tally.firm += u32::from(firm);
    let verdicts = [&engine, &ideal].map(|flown| (flown.report.verdict.pass, flown.report.answer.status));
    if firm && verdicts[0] != verdicts[1] {
        tally.failures.push(format!("seed {seed}: a firm verdict is another in continuous time: {verdicts:?}"));
    }
}

#[test]
fn engine_and_continuous_time_agree_up_to_hard_bounces() {
    let flights = if std::env::var_os("TAUTLINE_LONG").is_some() { 400 } else { 40 };
    let flights = std::env::var("TAUTLINE_RANDOM_FLIGHTS").map_or(flights, |count| count.parse().expect("a number"));
    let mut tally = Tally::default();
    (0..flights).for_each(|seed| judge(seed, &mut tally));
    let Tally { flights, firm, hard, compared, worst, failures } = tally;
    println!("{flights} flights: {firm} firm, {hard} with a hard bounce, {compared} compared up to it");
    println!("closest approaches differ by at most {worst:.2e} delta up to it; {} failures", failures.len());
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(firm > 0 && hard > 0 && compared > 0, "all three kinds occur");
}

/// A flight whose energy rose to 1.77 of its start although it passed, before steps were refined.
#[test]
fn flight_with_an_energy_rise_does_not_pass() {
    let mut scenario = crate::flight::builtin(
        "circle",
        &[
            "swarm.count=4",
            "start={shape=\"random\", half_extent_m=3, min_separation_m=1.2, seed=27}",
            "formation={shape=\"circle\", radius_m=0.9}",
            "law.alpha=100",
            "law.delta_m=1",
            "swarm.a22_per_s=0",
            "time.duration_s=60",
        ],
    );
    let honest = run(&scenario, &mut ()).expect("a report");
    assert!(!honest.verdict.pass && honest.answer.status == Status::Clear, "{:?}", honest.verdict);
    assert_eq!(faults(&honest).count(), 0, "{:?}", honest.verdict);
    // Without halving, the same steps gain energy, and the flight fails.
    (scenario.time.max_rate_dt, scenario.time.max_halvings) = (1e9, 0);
    let careless = run(&scenario, &mut ()).expect("a report");
    assert!(!careless.verdict.pass && faults(&careless).count() > 0, "{:?}", careless.verdict);
}
