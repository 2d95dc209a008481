//! Convergence of Rapier to continuous time over successive halves of the step.

use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;

use super::claim::{Claim, ClaimsResult, MeasureError, Progress, stated};
use super::flights::{builtin, continuous, engine, larger, relative_speed_squared, times, with_step};
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_core::text::bound;
use tautline_sim::continuous::Tolerances;
use tautline_sim::plant::{StepPath, rapier};
use tautline_sim::scenario::Scenario;

/// Steps per second, from coarse to fine.
pub(super) const STEPS_HZ: [f64; 9] = [60.0, 120.0, 240.0, 480.0, 960.0, 1920.0, 3840.0, 7680.0, 15360.0];
/// Duration of the flights \[s\]; all encounters of the pentagon are earlier.
const DURATION_S: f64 = 10.0;
/// Rate of the compared states \[Hz\].
const COMPARED_HZ: f64 = 10.0;
/// Admitted order: kick-drift-kick has order 2.
const ORDER: std::ops::RangeInclusive<f64> = 1.9..=2.1;

/// Free decay: coefficients \[1/s\], number of steps, and their lengths in turn \[s\].
const FREE_A22_PER_S: [f64; 3] = [-1.0, -0.1, 0.1];
const FREE_STEPS: usize = 6000;
const FREE_STEP_S: [f64; 3] = [1.0 / 60.0, 1.0 / 240.0, 1.0 / 1000.0];

/// Step length, with the errors of a flight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Refinement {
    /// Step \[s\].
    pub dt_s: f64,
    /// Largest position error of a vehicle against continuous time \[m\].
    pub error_m: f64,
    /// Observed order against the next coarser step; `None` for the first.
    pub order: Option<f64>,
    /// Largest error of the energy balance: E against E(0) less the dissipated energy \[m^2/s^2\].
    pub energy_excess_m2_s2: f64,
    /// Largest rise of E above its lowest value so far \[m^2/s^2\].
    pub energy_rise_m2_s2: f64,
}

fn largest_distance_m(a: &Swarm, b: &Swarm) -> f64 {
    let distance = |i: usize| (row(&a.positions_m, i) - row(&b.positions_m, i)).norm();
    (0..a.count()).map(distance).fold(0.0, larger)
}

/// Flies with every step recorded and returns the errors against continuous states, without the order.
fn fly(
    scenario: &Scenario,
    steps_hz: f64,
    reference: &[Swarm],
    progress: &Progress<'_>,
) -> Result<Refinement, MeasureError> {
    let dt_s = 1.0 / steps_hz;
    let scenario = with_step(scenario, dt_s);
    let every = steps_hz / COMPARED_HZ;
    let mut flown = Refinement { dt_s, ..Refinement::default() };
    let (mut allowed, mut lowest, mut power) = (f64::NAN, f64::INFINITY, f64::NAN);
    engine(&scenario, progress, |sample| {
        let entry = sample.step as f64 / every;
        if entry.fract() == 0.0 {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count")]
            let state = reference.get(entry as usize);
            let error_m = state.map_or(f64::NAN, |state| largest_distance_m(state, sample.swarm));
            flown.error_m = larger(flown.error_m, error_m);
        }
        let energy = sample.energy.unwrap_or(f64::NAN);
        let power_now = relative_speed_squared(sample.swarm);
        // dE/dt = -sum |v~|^2, by the trapezoidal rule.
        allowed = if sample.step == 0 { energy } else { allowed - 0.5 * (power + power_now) / steps_hz };
        flown.energy_excess_m2_s2 = larger(flown.energy_excess_m2_s2, (energy - allowed).abs());
        flown.energy_rise_m2_s2 = larger(flown.energy_rise_m2_s2, energy - lowest);
        (lowest, power) = (lowest.min(energy), power_now);
    })?;
    Ok(flown)
}

fn order(coarse: f64, fine: f64) -> f64 {
    (coarse / fine).log2()
}

/// Returns the convergence in the pentagon flight.
pub(super) fn measure(progress: &Progress<'_>) -> Result<Vec<Refinement>, MeasureError> {
    let mut scenario = builtin("pentagon")?;
    scenario.time.duration_s = DURATION_S;
    let reference = continuous(&scenario, &times(DURATION_S, COMPARED_HZ), Tolerances::default(), progress)?.states;
    let mut refinements = STEPS_HZ
        .par_iter()
        .map(|&steps_hz| fly(&scenario, steps_hz, &reference, progress).inspect(|_| progress.advance(1)))
        .collect::<Result<Vec<_>, MeasureError>>()?;
    for fine in 1..refinements.len() {
        refinements[fine].order = Some(order(refinements[fine - 1].error_m, refinements[fine].error_m));
    }
    Ok(refinements)
}

/// Returns the claims about the convergence.
pub(super) fn claims(refinements: &[Refinement]) -> ClaimsResult {
    let error = |first, last| format!("position error {first:.1e} to {last:.1e} m");
    let excess = |first, last| format!("difference {first:.1e} to {last:.1e} m^2/s^2");
    let [of_error, of_excess] =
        [["coarsest_error_m", "finest_error_m"], ["coarsest_excess_m2_s2", "finest_excess_m2_s2"]];
    Ok(vec![
        of_second_order("order-of-the-engine", refinements, of_error, |one| one.error_m, error)?,
        of_second_order("energy-excess-of-the-engine", refinements, of_excess, |one| one.energy_excess_m2_s2, excess)?,
        energy_rise(refinements)?,
    ])
}

fn steps() -> String {
    format!("dt = 1/{} to 1/{} s", STEPS_HZ[0], STEPS_HZ[STEPS_HZ.len() - 1])
}

/// Checks that a number of each flight falls with the square of the step. `names` and `words` are for the first and the
/// last flight.
fn of_second_order(
    id: &str,
    refinements: &[Refinement],
    names: [&'static str; 2],
    number: fn(&Refinement) -> f64,
    words: impl Fn(f64, f64) -> String,
) -> Result<Claim, MeasureError> {
    let numbers: Vec<f64> = refinements.iter().map(number).collect();
    let orders: Vec<f64> = numbers.windows(2).map(|pair| order(pair[0], pair[1])).collect();
    let (low, high) =
        (orders.iter().copied().fold(f64::INFINITY, f64::min), orders.iter().copied().fold(f64::NEG_INFINITY, larger));
    let claim = stated(id)?;
    let [first, .., last] = numbers[..] else { return Ok(claim) };
    let words = format!("order {low:.2} to {high:.2} over {}; {}", steps(), words(first, last));
    let values = [("lowest_order", low), ("highest_order", high), (names[0], first), (names[1], last)];
    Ok(claim.measured(words, values).pass(orders.iter().all(|order| ORDER.contains(order))))
}

fn energy_rise(refinements: &[Refinement]) -> Result<Claim, MeasureError> {
    let claim = stated("energy-of-the-engine")?;
    let rise = refinements.iter().map(|one| one.energy_rise_m2_s2).fold(0.0, larger);
    let words = format!("largest rise {} m^2/s^2 over {}", bound(rise, claim.limit()), steps());
    Ok(claim.measured(words, [("largest_rise_m2_s2", rise)]).within_limit())
}

/// Returns the largest relative error of a free velocity against v(0) exp(a22 t).
fn free_decay_error() -> Result<f64, MeasureError> {
    let mut largest = 0.0;
    for a22_per_s in FREE_A22_PER_S {
        let mut scenario = builtin("pentagon")?;
        scenario.a22_per_s = a22_per_s;
        for i in 0..scenario.count() {
            let velocity = Vector3::new(1.0, -0.5, 0.0) * (1.0 + i as f64);
            set_row(&mut scenario.start.velocities_m_s, i, velocity);
        }
        let (mut plant, mut path) = (rapier::plant(&scenario), StepPath::default());
        let (mut state, mut time_s) = (scenario.start.clone(), 0.0);
        plant.apply(&Rows::zeros(scenario.count()), &mut state);
        for step in 0..FREE_STEPS {
            let dt_s = FREE_STEP_S[step % FREE_STEP_S.len()];
            plant.advance(dt_s, &mut state, &mut path)?;
            time_s += dt_s;
        }
        plant.observe(&mut state);
        let exact = &scenario.start.velocities_m_s * libm::exp(a22_per_s * time_s);
        for i in 0..scenario.count() {
            let error = (row(&state.velocities_m_s, i) - row(&exact, i)).norm() / row(&exact, i).norm();
            largest = larger(largest, error);
        }
    }
    Ok(largest)
}

/// Returns the claim about free motion.
pub(super) fn free_decay(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let largest = free_decay_error()?;
    progress.advance(1);
    let claim = stated("free-decay")?;
    let words = format!(
        "relative error {} after {FREE_STEPS} steps of mixed lengths, a22 = {FREE_A22_PER_S:?} 1/s",
        bound(largest, claim.limit())
    );
    Ok(claim.measured(words, [("relative_error", largest)]).within_limit())
}
