//! The physics engine against continuous time, step by half step.

use nalgebra::Vector3;
use rayon::prelude::*;
use serde::Serialize;

use super::claim::{Claim, Kind};
use super::flights::{builtin, continuous, engine, times, with_step};
use super::{Progress, ValidateError};
use crate::plant::{Path, rapier};
use crate::scenario::{Precision, Scenario};
use crate::swarm::{Rows, Swarm, mean_row, row, set_row};
use crate::text::bound;

/// Steps per second of the ladder, from coarse to fine.
pub(super) const STEPS_HZ: [f64; 9] = [60.0, 120.0, 240.0, 480.0, 960.0, 1920.0, 3840.0, 7680.0, 15360.0];
/// Length of the flights \[s\]: all encounters of the pentagon are over by then.
const DURATION_S: f64 = 10.0;
/// Instants that are compared \[Hz\].
const COMPARED_HZ: f64 = 10.0;
/// Semi-implicit Euler is of order 1.
const ORDER: std::ops::RangeInclusive<f64> = 0.9..=1.1;
/// Rounding to 6e-8 of velocities of some 1 m/s, adding up one-sidedly over the 20000 steps of the best rung, moves a
/// vehicle by at most 20000 * 6e-8 m.
const SINGLE_FLOOR_M: f64 = 1.2e-3;

/// Free decay: coefficients \[1/s\], steps taken, and their lengths in turn \[s\].
const FREE_A22_PER_S: [f64; 3] = [-1.0, -0.1, 0.1];
const FREE_STEPS: usize = 6000;
const FREE_STEP_S: [f64; 3] = [1.0 / 60.0, 1.0 / 240.0, 1.0 / 1000.0];
/// Rounding of 6000 steps, relative: a few eps each.
const FREE_DOUBLE: f64 = 1e-11;
const FREE_SINGLE: f64 = 2e-3;

/// One step length of the ladder.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rung {
    /// Step \[s\].
    pub dt_s: f64,
    /// Largest distance of a vehicle from its place in continuous time, in double precision \[m\].
    pub double_m: f64,
    /// The same in single precision \[m\].
    pub single_m: f64,
    /// Observed order from the rung before, in double precision; none for the first.
    pub order: Option<f64>,
    /// Largest excess of E over what the dissipation leaves of E(0), in double precision \[m^2/s^2\].
    pub energy_excess_m2_s2: f64,
    /// Largest rise of E above its lowest value so far, in double precision \[m^2/s^2\].
    pub energy_rise_m2_s2: f64,
}

impl Rung {
    const NONE: Self = Self {
        dt_s: f64::NAN,
        double_m: f64::NAN,
        single_m: f64::INFINITY,
        order: None,
        energy_excess_m2_s2: f64::NAN,
        energy_rise_m2_s2: f64::NAN,
    };
}

/// What one flight of the ladder gave.
#[derive(Clone, Copy, Debug)]
struct Flown {
    error_m: f64,
    excess: f64,
    rise: f64,
}

/// The larger number; NaN where either is.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

fn relative_speed_squared(swarm: &Swarm) -> f64 {
    let mean = mean_row(&swarm.velocities_m_s);
    (0..swarm.count()).map(|i| (row(&swarm.velocities_m_s, i) - mean).norm_squared()).sum()
}

fn largest_distance_m(a: &Swarm, b: &Swarm) -> f64 {
    let distance = |i: usize| (row(&a.positions_m, i) - row(&b.positions_m, i)).norm();
    (0..a.count()).map(distance).fold(0.0, larger)
}

/// Flies with every step recorded and compares with the states of continuous time.
fn fly(scenario: &Scenario, precision: Precision, steps_hz: f64, reference: &[Swarm]) -> Result<Flown, ValidateError> {
    let scenario = with_step(scenario, precision, 1.0 / steps_hz);
    let every = steps_hz / COMPARED_HZ;
    let mut flown = Flown { error_m: 0.0, excess: 0.0, rise: 0.0 };
    let (mut allowed, mut lowest, mut power) = (f64::NAN, f64::INFINITY, f64::NAN);
    engine(&scenario, |sample| {
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
        flown.excess = larger(flown.excess, energy - allowed);
        flown.rise = larger(flown.rise, energy - lowest);
        (lowest, power) = (lowest.min(energy), power_now);
    })?;
    Ok(flown)
}

fn order(coarse: f64, fine: f64) -> f64 {
    (coarse / fine).log2()
}

/// The ladder of the pentagon.
pub(super) fn climb(progress: &Progress<'_>) -> Result<Vec<Rung>, ValidateError> {
    let mut scenario = builtin("pentagon")?;
    scenario.time.duration_s = DURATION_S;
    let reference = continuous(&scenario, &times(DURATION_S, COMPARED_HZ))?.states;
    let flown = STEPS_HZ
        .par_iter()
        .flat_map(|&steps_hz| [Precision::Double, Precision::Single].into_par_iter().map(move |p| (p, steps_hz)))
        .map(|(precision, steps_hz)| fly(&scenario, precision, steps_hz, &reference).inspect(|_| progress.advance(1)))
        .collect::<Result<Vec<_>, ValidateError>>()?;
    let mut rungs: Vec<Rung> = Vec::new();
    for (&steps_hz, flown) in STEPS_HZ.iter().zip(flown.chunks_exact(2)) {
        let (double, single) = (flown[0], flown[1]);
        rungs.push(Rung {
            dt_s: 1.0 / steps_hz,
            double_m: double.error_m,
            single_m: single.error_m,
            order: rungs.last().map(|coarse| order(coarse.double_m, double.error_m)),
            energy_excess_m2_s2: double.excess,
            energy_rise_m2_s2: double.rise,
        });
    }
    Ok(rungs)
}

/// The claims about the ladder.
pub(super) fn claims(rungs: &[Rung]) -> Vec<Claim> {
    vec![converges(rungs), single_precision(rungs), energy_excess(rungs), energy_rise(rungs)]
}

fn steps() -> String {
    format!("dt = 1/{} s to 1/{} s", STEPS_HZ[0], STEPS_HZ[STEPS_HZ.len() - 1])
}

/// Smallest and largest, NaN where one is.
fn span(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    numbers.fold(
        (f64::INFINITY, f64::NEG_INFINITY),
        |(low, high), x| {
            if x.is_nan() { (x, x) } else { (low.min(x), high.max(x)) }
        },
    )
}

fn converges(rungs: &[Rung]) -> Claim {
    let (low, high) = span(rungs.iter().filter_map(|rung| rung.order));
    let [first, .., last] = rungs else { return no_ladder("order-of-the-engine") };
    Claim {
        id: "order-of-the-engine",
        source: "discrete time",
        finding: None,
        kind: Kind::Ours,
        statement: "In double precision Rapier converges to continuous time with order 1.",
        expected: format!("an observed order of {} to {} from each step to its half", ORDER.start(), ORDER.end()),
        measured: format!(
            "order {low:.2} to {high:.2} over {}; largest position error {:.1e} m to {:.1e} m",
            steps(),
            first.double_m,
            last.double_m
        ),
        values: [
            ("lowest_order", low),
            ("highest_order", high),
            ("coarsest_error_m", first.double_m),
            ("finest_error_m", last.double_m),
        ]
        .into(),
        tolerance: "0.1".to_owned(),
        reason: "second-order terms of the coarsest step",
        pass: ORDER.contains(&low) && ORDER.contains(&high),
    }
}

fn single_precision(rungs: &[Rung]) -> Claim {
    let best = rungs.iter().fold(Rung::NONE, |best, rung| if rung.single_m < best.single_m { *rung } else { best });
    let finest = rungs.last().copied().unwrap_or(Rung::NONE);
    Claim {
        id: "single-precision-floor",
        source: "discrete time",
        finding: None,
        kind: Kind::Ours,
        statement: "In single precision the error falls to a floor of rounding, and no shorter step is better.",
        expected: format!("a floor of at most {SINGLE_FLOOR_M:e} m, above that of double precision, and more beyond"),
        measured: format!(
            "floor {:.1e} m at dt = 1/{:.0} s; {:.1e} m at dt = 1/{:.0} s",
            best.single_m,
            1.0 / best.dt_s,
            finest.single_m,
            1.0 / finest.dt_s
        ),
        values: [("floor_m", best.single_m), ("floor_dt_s", best.dt_s), ("finest_error_m", finest.single_m)].into(),
        tolerance: format!("{SINGLE_FLOOR_M:e} m"),
        reason: "velocities of 1 m/s rounded to 6e-8 at every step of some 20000, all to one side",
        pass: best.single_m <= SINGLE_FLOOR_M
            && best.single_m > best.double_m
            && finest.dt_s < best.dt_s
            && finest.single_m > 2.0 * best.single_m,
    }
}

fn energy_excess(rungs: &[Rung]) -> Claim {
    let (low, high) =
        span(rungs.windows(2).map(|pair| order(pair[0].energy_excess_m2_s2, pair[1].energy_excess_m2_s2)));
    let [first, .., last] = rungs else { return no_ladder("energy-excess-of-the-engine") };
    Claim {
        id: "energy-excess-of-the-engine",
        source: "discrete time, dE/dt = -sum |v_i - mean v|^2",
        finding: None,
        kind: Kind::Ours,
        statement: "In Rapier, E exceeds what the dissipation leaves of E(0) only in proportion to dt.",
        expected: format!("an observed order of {} to {}", ORDER.start(), ORDER.end()),
        measured: format!(
            "order {low:.2} to {high:.2} over {}; excess {:.1e} to {:.1e} m^2/s^2",
            steps(),
            first.energy_excess_m2_s2,
            last.energy_excess_m2_s2
        ),
        values: [
            ("lowest_order", low),
            ("highest_order", high),
            ("coarsest_excess_m2_s2", first.energy_excess_m2_s2),
            ("finest_excess_m2_s2", last.energy_excess_m2_s2),
        ]
        .into(),
        tolerance: "0.1".to_owned(),
        reason: "second-order terms of the coarsest step",
        pass: ORDER.contains(&low) && ORDER.contains(&high),
    }
}

fn energy_rise(rungs: &[Rung]) -> Claim {
    const ROUNDING: f64 = 1e-12;
    let rise = rungs.iter().map(|rung| rung.energy_rise_m2_s2).fold(0.0, larger);
    Claim {
        id: "energy-of-the-engine",
        source: "the stability theorem, in discrete time",
        finding: None,
        kind: Kind::Ours,
        statement: "In Rapier, E never rises along the pentagon's flight.",
        expected: "no rise above its lowest value so far".to_owned(),
        measured: format!("largest rise {} m^2/s^2 over {}", bound(rise, ROUNDING), steps()),
        values: [("largest_rise_m2_s2", rise)].into(),
        tolerance: format!("{ROUNDING:e} m^2/s^2"),
        reason: "rounding of E, which starts at 3.7 m^2/s^2",
        pass: rise <= ROUNDING,
    }
}

fn no_ladder(id: &'static str) -> Claim {
    Claim {
        id,
        source: "discrete time",
        finding: None,
        kind: Kind::Ours,
        statement: "There are steps to compare.",
        expected: "at least two".to_owned(),
        measured: "fewer".to_owned(),
        values: super::Values::default(),
        tolerance: "0".to_owned(),
        reason: "a count",
        pass: false,
    }
}

/// Largest relative error of a free velocity against v(0) exp(a22 t).
fn free_decay_error(precision: Precision) -> Result<f64, ValidateError> {
    let mut largest = 0.0;
    for a22_per_s in FREE_A22_PER_S {
        let mut scenario = builtin("pentagon")?;
        scenario.a22_per_s = a22_per_s;
        for i in 0..scenario.count() {
            let velocity = Vector3::new(1.0, -0.5, 0.0) * (1.0 + i as f64);
            set_row(&mut scenario.start.velocities_m_s, i, velocity);
        }
        let (mut plant, mut path) = (rapier::plant(&scenario, precision), Path::default());
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

/// The claim about free motion.
pub(super) fn free_decay(progress: &Progress<'_>) -> Result<Claim, ValidateError> {
    let (double, single) = rayon::join(|| free_decay_error(Precision::Double), || free_decay_error(Precision::Single));
    let (double, single) = (double?, single?);
    progress.advance(1);
    Ok(Claim {
        id: "free-decay",
        source: "equation (1) with u = 0",
        finding: None,
        kind: Kind::Ours,
        statement: "In Rapier a free velocity is v(0) exp(a22 t), whatever the step.",
        expected: "exact to rounding".to_owned(),
        measured: format!(
            "largest relative error {} in double and {single:.0e} in single precision after {FREE_STEPS} steps of mixed \
             lengths with a22 of {FREE_A22_PER_S:?} 1/s",
            bound(double, FREE_DOUBLE)
        ),
        values: [("double_relative_error", double), ("single_relative_error", single)].into(),
        tolerance: format!("{FREE_DOUBLE:e} in double, {FREE_SINGLE:e} in single precision"),
        reason: "a few roundings a step",
        pass: double <= FREE_DOUBLE && single <= FREE_SINGLE,
    })
}
