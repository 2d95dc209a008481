//! A period of warm shields allocates no memory. The test is alone in its program because it counts all allocations.

use std::alloc::System;

use nalgebra::Vector3;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use tautline_shield::obstacle::SolidHalfSpace;
use tautline_shield::{Fleet, Message, Obstacle, Settings, State};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

const PERIOD_S: f64 = 0.05;
const PERIODS: usize = 400;
const VEHICLES: usize = 20;

/// Flies a crowd towards the origin and away again, with every fourth message lost.
fn fly(fleet: &mut Fleet, states: &mut [State], commands: &mut [Vector3<f64>], sent: &mut Vec<Message>) {
    let mut wanted = [Vector3::zeros(); VEHICLES];
    for period in 0..PERIODS {
        let pull = if period < PERIODS / 2 { -1.0 } else { 1.0 };
        for (wanted, state) in wanted.iter_mut().zip(states.iter()) {
            *wanted = state.position_m * pull - state.velocity_m_s;
        }
        fleet.filter(states, &wanted, commands);
        sent.clear();
        sent.extend(fleet.messages());
        for (k, message) in sent.iter().enumerate() {
            if (k + period) % 4 != 0 {
                fleet.hear(message);
            }
        }
        for (state, command) in states.iter_mut().zip(commands.iter()) {
            *state = state.after(*command, PERIOD_S);
        }
    }
}

#[test]
fn a_period_of_warm_shields_allocates_nothing() {
    let limits = Settings::new(1.0, PERIOD_S).limits().expect("defaults are valid");
    let place = |k: usize| Vector3::new((k % 5) as f64, (k / 5) as f64, 0.1 * (k % 3) as f64) * 1.5;
    let mut states: Vec<_> = (0..VEHICLES).map(|k| State::at_rest(place(k) - place(12))).collect();
    let mut fleet = Fleet::new(&[limits; VEHICLES], &states).expect("starts are apart");
    // Within reach at all times.
    let ground = Obstacle::new(SolidHalfSpace { normal: Vector3::z_axis(), offset_m: -0.5 }, 0.2);
    fleet = fleet.with_obstacles(&[ground]).expect("starts are above the ground");
    let (mut commands, mut sent) = ([Vector3::zeros(); VEHICLES], vec![]);
    fly(&mut fleet, &mut states, &mut commands, &mut sent);
    let region = Region::new(ALLOCATOR);
    fly(&mut fleet, &mut states, &mut commands, &mut sent);
    assert_eq!(region.change().allocations + region.change().reallocations, 0);
    assert!(fleet.report().changed > 1_000);
}
