//! Time of the shield: one period of all vehicles, and their broadcasts through a radio without loss.
//!
//! Run with `cargo bench --bench shield`; compare times of one run only. Divide by the number of vehicles for the cost
//! of a vehicle and period.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;
use tautline::shield::{Broadcast, Fleet, Settings, State};

const PERIOD_S: f64 = 0.05;

/// Fleet on a grid that flies to permuted places of the grid.
struct Crowd {
    fleet: Fleet,
    states: Vec<State>,
    slots: Vec<Vector3<f64>>,
    sent: Vec<Broadcast>,
}

impl Crowd {
    fn new(count: usize, spacing_m: f64) -> Self {
        let limits = Settings::new(1.0, PERIOD_S).limits().expect("defaults are valid");
        let side = (1..=count).find(|side| side * side >= count).expect("a square");
        let place = |i: usize| Vector3::new((i % side) as f64, (i / side) as f64, 0.0) * spacing_m;
        let states: Vec<_> = (0..count).map(|i| State::at_rest(place(i))).collect();
        let fleet = Fleet::new(&vec![limits; count], &states).expect("starts are apart");
        let slots = (0..count).map(|i| place((i * 37 + 11) % count)).collect();
        Self { fleet, states, slots, sent: vec![Broadcast::default(); count] }
    }

    /// Makes a period: each vehicle takes a command and writes its messages, and all of them are heard.
    fn period(&mut self) {
        let shields = self.fleet.shields_mut().iter_mut();
        for (((shield, state), slot), sent) in shields.zip(&mut self.states).zip(&self.slots).zip(&mut self.sent) {
            let command = shield.filter(black_box(*state), slot - state.position_m);
            shield.write_broadcast(sent);
            *state = state.after(command, PERIOD_S);
        }
        self.sent.iter().for_each(|broadcast| self.fleet.hear_broadcast(broadcast));
    }
}

fn periods(criterion: &mut Criterion) {
    for count in [10, 30, 100, 300, 1_000] {
        let mut group = criterion.benchmark_group(format!("shield/{count}"));
        group.sample_size(20);
        for (name, spacing_m) in [("crowd", 2.4), ("apart", 50.0)] {
            let mut crowd = Crowd::new(count, spacing_m);
            group.bench_function(format!("period {name}"), |bencher| {
                bencher.iter(|| crowd.period());
            });
        }
        group.finish();
    }
}

criterion_group!(benches, periods);
criterion_main!(benches);
