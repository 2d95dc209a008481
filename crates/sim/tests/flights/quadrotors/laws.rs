//! Every law on every built-in model under the shield: each vehicle stays within the measured tracking error of its
//! model.
//!
//! `TAUTLINE_LONG=1` flies more starts, in the plane and in space, in still air and in the fastest wind of the table.

use tautline_sim::scenario::{Override, Scenario, Source};
use tautline_sim::sim::{Flight, Simulation};
use tautline_sim::vehicle::MODELS;

use super::model;

/// Laws with keys that press vehicles against their limits: default gains, and gains that make commands switch.
const LAWS: [(&str, &[&str]); 11] = [
    ("edge-tension", &[]),
    ("displacement", &["law.k_per_s2=0.6"]),
    ("displacement", &["law.k_per_s2=6", "law.zeta_per_s=0.4"]),
    ("laplacian", &["law.f1_per_s2=0.3", "law.f2_per_s=1"]),
    ("laplacian", &["law.f1_per_s2=8", "law.f2_per_s=0.5"]),
    ("potential", &[]),
    ("orca", &[]),
    ("bvc", &[]),
    ("cbf-qp", &[]),
    ("cbf-qp", &["law.variant=braking"]),
    ("flocking", &[]),
];

/// Returns six vehicles of a model that change places across a circle.
fn crossing(name: &str, law: (&str, &[&str]), more: &[String]) -> Scenario {
    let (radius_m, delta_m) = if name == "hummingbird" { (8.0, 0.8) } else { (2.6, 0.4) };
    let sets = [
        format!("vehicle.model={name}"),
        format!("start.radius_m={radius_m}"),
        format!("formation.radius_m={radius_m}"),
        "swarm.count=6".to_owned(),
        format!("law={{kind=\"{}\",delta_m={delta_m}}}", law.0),
        "shield.enabled=true".to_owned(),
    ];
    read("swap", &sets, law, more)
}

/// Returns two vehicles of a model above each other that change places.
fn stacked(name: &str, law: (&str, &[&str]), more: &[String]) -> Scenario {
    let (height_m, delta_m) = if name == "hummingbird" { (2.5, 0.8) } else { (1.8, 0.4) };
    let sets = [
        "swarm.count=2".to_owned(),
        "swarm.dimensions=3".to_owned(),
        format!("vehicle.model={name}"),
        format!("start={{positions_m=[[0,0,0],[0.05,0.02,{height_m}]]}}"),
        format!("formation={{shape=\"points\",points_m=[[0,0,{height_m}],[0,0,0]]}}"),
        format!("law={{kind=\"{}\",delta_m={delta_m}}}", law.0),
        "shield.enabled=true".to_owned(),
    ];
    read("swap", &sets, law, more)
}

fn read(name: &str, sets: &[String], law: (&str, &[&str]), more: &[String]) -> Scenario {
    let all = sets.iter().map(String::as_str).chain(law.1.iter().copied()).chain(more.iter().map(String::as_str));
    let overrides: Vec<_> = all.map(|set| Override::parse(set).expect(set)).collect();
    let scenario = Scenario::read(&Source::Builtin(name.to_owned()), &overrides);
    scenario.unwrap_or_else(|error| panic!("{law:?} {more:?}: {error}"))
}

fn fly(scenario: &Scenario) -> Flight {
    let mut simulation = Simulation::new(scenario).expect("a flight");
    while simulation.ending().is_none() {
        simulation.step();
    }
    simulation.finish()
}

#[test]
fn every_law_keeps_every_model_in_its_tube() {
    let is_long = std::env::var_os("TAUTLINE_LONG").is_some();
    let (seeds, duration_s) = if is_long { (0..6, 40) } else { (0..1, 12) };
    for (name, _) in MODELS {
        let wind_m_s = model(name).tracking.expect("a measured table").wind_m_s;
        let (mut flights, mut largest) = (0_u32, 0.0_f64);
        let mut check = |scenario: &Scenario, what: &str| {
            let flight = fly(scenario);
            let shield = flight.shield.as_ref().expect("a shield");
            let share = shield.counters.tracking_share.expect("an observed share");
            (flights, largest) = (flights + 1, largest.max(share));
            assert_eq!(shield.breach, None, "{name}, {what}");
            assert!(share < 1.0, "{name}, {what}: {share} of the tube");
        };
        for law in LAWS {
            for seed in seeds.clone() {
                for dimensions in if is_long { 2..=3 } else { 2..=2 } {
                    for wind in if is_long { vec![[0.0, 0.0], [1.0, 0.0], [-0.6, 0.8]] } else { vec![[0.6, 0.8]] } {
                        let more = [
                            format!("swarm.dimensions={dimensions}"),
                            format!("wind.mean_m_s=[{},{},0]", wind[0] * wind_m_s, wind[1] * wind_m_s),
                            format!("start.seed={seed}"),
                            format!("time.duration_s={duration_s}"),
                        ];
                        check(&crossing(name, law, &more), &format!("{law:?} {more:?}"));
                    }
                }
            }
            let more = [format!("wind.mean_m_s=[0,{},0]", 0.999 * wind_m_s), format!("time.duration_s={duration_s}")];
            check(&stacked(name, law, &more), &format!("{law:?} stacked"));
        }
        println!("{name}: {flights} flights, at most {largest} of the tube");
    }
}
