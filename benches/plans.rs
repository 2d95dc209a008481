//! Time to judge published plans: vehicles that fly among each other replan at 10 Hz, each plan four pieces of degree 5
//! over 4 s, as MINCO planners publish them. The time for 10 s of plans is to stay below 10 s.

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;
use tautline::audit::Status;
use tautline::audit::recorded::{PlanAuditor, PlansOutcome, Settings};
use tautline::track::{Piece, Plan, PlanEnd};

/// Plans of each vehicle: 10 s.
const ROUNDS: u32 = 100;
const RATE_HZ: f64 = 10.0;
const PIECES: usize = 4;
/// Limit that the vehicles keep \[m\].
const DELTA_M: f64 = 0.5;
/// Limit that they violate \[m\].
const TOO_MUCH_M: f64 = 2.5;

/// Returns position, velocity and acceleration of a vehicle: layers of circles that turn in opposite directions.
fn state(vehicle: usize, time_s: f64) -> [Vector3<f64>; 3] {
    let (layer, place) = (vehicle / 10, vehicle % 10);
    let radius_m = 6.0 + 0.8 * layer as f64;
    let rate = if layer % 2 == 0 { 0.4 } else { -0.4 };
    let angle = TAU * place as f64 / 10.0 + rate * time_s;
    let (sine, cosine) = angle.sin_cos();
    let height_m = 1.0 + 1.2 * layer as f64;
    [
        Vector3::new(radius_m * cosine, radius_m * sine, height_m),
        Vector3::new(-sine, cosine, 0.0) * (radius_m * rate),
        Vector3::new(-cosine, -sine, 0.0) * (radius_m * rate * rate),
    ]
}

/// Returns the piece of degree 5 of 1 s between the states at both ends.
fn piece(vehicle: usize, from_s: f64) -> Piece {
    let ([p, v, a], [q, w, b]) = (state(vehicle, from_s), state(vehicle, from_s + 1.0));
    let by = q - p;
    let coefficients = vec![
        p,
        v,
        a * 0.5,
        (by * 20.0 - w * 8.0 - v * 12.0 - a * 3.0 + b) * 0.5,
        (by * -30.0 + w * 14.0 + v * 16.0 + a * 3.0 - b * 2.0) * 0.5,
        (by * 12.0 - (v + w) * 6.0 - a + b) * 0.5,
    ];
    Piece { vehicle, from_s, to_s: from_s + 1.0, coefficients }
}

fn plans(vehicles: usize) -> Vec<Plan> {
    let of_round = |round: u32| {
        // Vehicles publish one after the other within a period.
        (0..vehicles).map(move |vehicle| {
            let published_s = (f64::from(round) + vehicle as f64 / vehicles as f64) / RATE_HZ;
            let pieces = (0..PIECES).map(|k| piece(vehicle, published_s + k as f64)).collect();
            Plan { vehicle, published_s, pieces }
        })
    };
    (0..ROUNDS).flat_map(of_round).collect()
}

fn judged(names: &[String], plans: &[Plan], delta_m: f64) -> PlansOutcome {
    let mut auditor = PlanAuditor::new(Settings::delta(delta_m), PlanEnd::Unknown).expect("settings");
    for plan in plans {
        auditor.push(names, plan).expect("a plan");
    }
    auditor.finish().expect("an outcome")
}

fn bench(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("plans");
    group.sample_size(10);
    for vehicles in [20, 100] {
        let names: Vec<_> = (0..vehicles).map(|vehicle| vehicle.to_string()).collect();
        let plans = plans(vehicles);
        for (name, delta_m, status) in [("clear", DELTA_M, Status::Clear), ("violation", TOO_MUCH_M, Status::Violation)]
        {
            assert_eq!(judged(&names, &plans, delta_m).published.status, status);
            group.bench_function(BenchmarkId::new(name, vehicles), |bencher| {
                bencher.iter(|| black_box(judged(&names, &plans, delta_m)));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
