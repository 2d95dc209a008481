//! Large swarms: the work, memory and size of recordings grow with the number of vehicles, not of pairs.

use std::ops::ControlFlow;

use tautline::audit::Status;
use tautline::figures::{Criteria, of_run};
use tautline::flight_log::FlightLog;
use tautline::mcap::{Header, McapRecorder};
use tautline::preflight::Preflight;
use tautline::run::run_while;
use tautline::scenario::{Scenario, Source};

const MANY_VEHICLES: usize = 10_000;

/// Returns a scenario with a grid of `count` vehicles that contracts from 2 m to 1.6 m over a few steps.
fn grid(count: usize, more: &str) -> String {
    format!(
        "name = \"grid\"\nswarm.count = {count}\nstart = {{ shape = \"grid\", spacing_m = 2.0 }}\n\
         formation = {{ shape = \"grid\", spacing_m = 1.6 }}\narrival.hold_s = 0.01\n\
         time = {{ duration_s = 0.0125, record_hz = 120 }}\n{more}"
    )
}

const ALL: &str = "law = { kind = \"displacement\", delta_m = 1.0 }\n";
const LED: &str = "law = { kind = \"displacement\", delta_m = 1.0 }\ngraph.kind = \"star\"\n\
                   reference = { kind = \"rest\", leader = 1 }\n";

fn read(toml: &str) -> Scenario {
    let source = Source::Text { name: "test".to_owned(), text: toml.to_owned() };
    Scenario::read(&source, &[]).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_large_swarm_sweeps_near_pairs_and_records_vehicles() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, more) in [("all", ALL), ("led", LED)] {
        let scenario = read(&grid(MANY_VEHICLES, more));
        let preflight = Preflight::of(&scenario).expect("a law");
        let path = folder.path().join(name);
        let header = Header::new(name, "", scenario.count(), scenario.delta_m);
        let (mut recorder, mut history) =
            (McapRecorder::create(&path, &header).expect("created"), FlightLog::default());
        let threads = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
        let fly = || {
            let sink = &mut (&mut recorder, &mut history);
            run_while(&scenario, &preflight, sink, &mut |_| ControlFlow::Continue(()))
        };
        let report = threads.install(fly).expect("a flight");
        assert_eq!((report.answer.status, report.run.steps), (Status::Clear, 3), "{name}: whole steps, none in parts");
        // Four neighbours at 2 m, and four at 2.83 m.
        let swept = report.answer.detectors.expect("detectors").pairs_swept as f64 / (4 * MANY_VEHICLES) as f64;
        assert!((2.0..=8.0).contains(&swept), "{name}: {swept} pairs a vehicle and step");
        recorder.finish().expect("written");
        let (bytes, numbers) = (std::fs::metadata(&path).expect("written").len(), preflight.recording_bytes);
        assert_eq!((preflight.samples, numbers), (3, 3 * 72 * MANY_VEHICLES as u64));
        assert!((numbers..numbers + 8192).contains(&bytes), "{name}: {bytes} for {numbers}");

        let shape = Some((&scenario.legs[..], &scenario.graph));
        let criteria = Criteria {
            delta_m: 1.0,
            certified_m: None,
            shape,
            edge_error_m: None,
            disagreement_m_s: None,
            most_thrust_n: None,
            obstacles: &[],
        };
        for figure in of_run(&history, &criteria) {
            let bytes = figure.svg.len();
            assert!(bytes < 150_000, "{name}: {bytes} of {}", figure.name);
        }
    }
}

#[test]
fn a_law_without_edge_data_needs_no_memory_for_a_complete_graph() {
    let scenario = read(&grid(40_000, ALL));
    assert_eq!(scenario.graph.edge_count(), 799_980_000);
    scenario.validate().expect("the same answer");
    let text = grid(40_000, "law = { kind = \"edge-tension\", delta_m = 1.0 }\n");
    let refused = Scenario::read(&Source::Text { name: "test".to_owned(), text }, &[]).expect_err("too much memory");
    assert!(refused.message.contains("40000 vehicles with 799980000 edges would take"), "{refused}");
}

#[test]
fn the_recording_of_a_large_swarm_is_bounded_without_a_rate() {
    let of = |count: usize, time: &str| {
        let text = grid(count, ALL).replace("duration_s = 0.0125, record_hz = 120", time);
        let preflight = Preflight::of(&read(&text.replace("hold_s = 0.01", "hold_s = 1.0"))).expect("a law");
        (preflight.samples, preflight.recording_bytes)
    };
    assert_eq!(of(500, "duration_s = 60"), (3601, 3601 * 72 * 500));
    assert_eq!(of(20_000, "duration_s = 60"), (721, 721 * 72 * 20_000));
    assert_eq!(of(20_000, "duration_s = 60, record_hz = 60").0, 3601);
}

#[test]
fn a_star_limits_the_step_unless_its_centre_is_the_leader() {
    let star = format!("{ALL}graph.kind = \"star\"\n");
    let told = |more: &str| Preflight::of(&read(&grid(1000, more))).expect("a law").text();
    let said = told(&star);
    // 0.5/(sigma c mu): sigma = 1, c = 1/s, mu = N.
    assert!(said.contains("the links require at most 0.000500 s"), "{said}");
    for more in [ALL, LED] {
        let said = told(more);
        assert!(!said.contains("the links ask"), "{said}");
    }
}
