//! Rates of growth and decay near the formation: findings F4 and F5, and stars.

use nalgebra::{DMatrix, Vector3};

use super::claim::{Claim, ClaimsResult, Measure, MeasureError, Progress, stated, try_each};
use super::flights::{continuous, end, engine, engine_to_any_end, larger, separation_m, with_step};
use tautline_core::monitor::Quiet;
use tautline_core::swarm::{Rows, Swarm, mean_row, set_row};
use tautline_core::text::bound;
use tautline_laws::formation::{Formation, largest_edge_error_m};
use tautline_laws::graph::Graph;
use tautline_sim::continuous::Tolerances;
use tautline_sim::scenario::{Scenario, Space};
use tautline_sim::sim::Ending;

const A22_PER_S: f64 = 0.1;
/// Number of vehicles of the paper's second example.
const HEXAGON: usize = 6;
const RADIUS_M: f64 = 1.5;
const DELTA_M: f64 = 1.0;
/// Initial bend of the hexagon out of its plane, root of the sum of squares \[m\].
const BEND_M: f64 = 0.16;
/// Times at which the bend is measured \[s\]: early times, and times late enough for the power law.
const BEND_TIMES_S: [f64; 4] = [100.0, 300.0, 10_000.0, 30_000.0];

/// Initial common velocity \[m/s\], and duration of its growth \[s\].
const COMMON_M_S: f64 = 1e-3;
const COMMON_S: f64 = 100.0;
/// Step of Rapier where the closed form does not depend on it \[s\].
const ENGINE_STEP_S: f64 = 1.0 / 60.0;
/// Time by which rounding grows by e^120 \[s\].
const LOST_S: f64 = 1200.0;
/// Edge error above which a formation is lost \[m\].
const LOST_M: f64 = 0.1;

/// Common speed that a lost swarm exceeds \[m/s\].
const RUNAWAY_M_S: f64 = 1e9;

/// Numbers of vehicles of the stars.
const STARS: [usize; 3] = [10, 11, 12];
const STAR_RADIUS_M: f64 = 3.0;
/// Transverse speed of two followers \[m/s\]; edges stay straight to 1e-9 m.
const STAR_M_S: f64 = 1e-6;
const STAR_S: f64 = 100.0;
/// Tolerances far below the speeds of the star.
const FINE: Tolerances = Tolerances { relative: 1e-12, absolute: 1e-18 };

pub(super) fn judge(progress: &Progress<'_>) -> ClaimsResult {
    let parts: [Measure; 5] = [bent_hexagon, common_mode, common_mode_in_the_engine, lost_to_rounding, stars];
    try_each(&parts, progress, |part| part(progress))
}

fn hexagon() -> Formation {
    Formation::circle(HEXAGON, RADIUS_M)
}

/// Returns the distance of a swarm from its best plane, root of the sum of squares \[m\].
fn bend_m(positions_m: &Rows) -> f64 {
    let centre = mean_row(positions_m);
    let centred = DMatrix::from_fn(positions_m.nrows(), 3, |i, axis| positions_m[(i, axis)] - centre[axis]);
    centred.singular_values().iter().copied().fold(f64::INFINITY, f64::min)
}

/// Returns the hexagon at rest with a saddle bend: z is proportional to the cosine of twice the angle.
fn bent() -> Scenario {
    let mut start = Swarm::at_rest(hexagon().slots_m);
    for i in 0..HEXAGON {
        let (x, y) = (start.positions_m[(i, 0)] / RADIUS_M, start.positions_m[(i, 1)] / RADIUS_M);
        start.positions_m[(i, 2)] = BEND_M * (x * x - y * y) / (HEXAGON as f64 / 2.0).sqrt();
    }
    Scenario::new("bent", start, hexagon(), DELTA_M, LOST_S)
}

fn bent_hexagon(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let scenario = bent();
    let solution = continuous(&scenario, &BEND_TIMES_S, Tolerances::default(), progress)?;
    let bend_at = |k: usize| solution.states.get(k).map_or(f64::NAN, |state| bend_m(&state.positions_m));
    let (at_100_m, at_300_m, at_10000_m, at_30000_m) = (bend_at(0), bend_at(1), bend_at(2), bend_at(3));
    let exponent = (at_30000_m / at_10000_m).ln() / (BEND_TIMES_S[3] / BEND_TIMES_S[2]).ln();
    let words = format!(
        "bend {BEND_M} m, after 100 s {at_100_m:.2} m, after 300 s {at_300_m:.2} m, after 10000 s {at_10000_m:.3} m; \
         exponent up to 30000 s {exponent:.2}"
    );
    let claim = stated("bent-hexagon")?;
    // 1/A^2 grows linearly, so the exponent at a bend A is -1/2 (1 - A^2/A(0)^2): 1 % short of its limit.
    let pass = (exponent + 0.5).abs() <= claim.limit();
    let values = [("after_100_s_m", at_100_m), ("after_300_s_m", at_300_m), ("exponent", exponent)];
    Ok(claim.measured(words, values).pass(pass))
}

/// Returns the hexagon in formation with a common velocity.
fn drifting() -> Scenario {
    let mut start = Swarm::at_rest(hexagon().slots_m);
    for i in 0..HEXAGON {
        set_row(&mut start.velocities_m_s, i, Vector3::new(0.6, -0.8, 0.0) * COMMON_M_S);
    }
    let mut scenario = Scenario::new("drifting", start, hexagon(), DELTA_M, COMMON_S);
    scenario.a22_per_s = A22_PER_S;
    scenario
}

fn common_rate(id: &str, last: &Swarm, duration_s: f64) -> Result<Claim, MeasureError> {
    let rate_per_s = (last.mean_velocity_m_s().norm() / COMMON_M_S).ln() / duration_s;
    let error_per_s = rate_per_s - A22_PER_S;
    let claim = stated(id)?;
    let (pass, error) = (error_per_s.abs() <= claim.limit(), bound(error_per_s, claim.limit()));
    let words = format!("{rate_per_s:.6} 1/s over {COMMON_S} s, error {error} 1/s");
    Ok(claim.measured(words, [("rate_per_s", rate_per_s)]).pass(pass))
}

fn common_mode(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    common_rate("common-mode", &end(&drifting(), Tolerances::default(), progress)?, COMMON_S)
}

fn common_mode_in_the_engine(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let flight = engine(&with_step(&drifting(), ENGINE_STEP_S), progress, |_| ())?;
    common_rate("common-mode-in-the-engine", &flight.last, flight.duration_s)
}

fn lost_to_rounding(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let mut scenario = drifting();
    scenario.start.velocities_m_s.fill(0.0);
    scenario.time.duration_s = LOST_S;
    let mut scenario = with_step(&scenario, ENGINE_STEP_S);
    scenario.time.record_hz = 1.0;
    // The flight continues beyond the precision of positions, which is the effect to measure.
    scenario.arrival.edge_error_m = f64::INFINITY;
    let mut lost_at_s = f64::NAN;
    let flight = engine_to_any_end(&scenario, scenario.law()?, progress, |sample| {
        let error_m = largest_edge_error_m(&sample.swarm.positions_m, scenario.formation(), &scenario.graph);
        let kept = error_m <= LOST_M;
        if lost_at_s.is_nan() && !kept {
            lost_at_s = sample.time_s;
        }
    })?;
    let common_m_s = flight.last.mean_velocity_m_s().norm();
    let min_m = separation_m(flight.audit.closest);
    let ending = match flight.ending {
        Ending::Completed => "flown to its end",
        Ending::Interrupted => "interrupted",
        Ending::LawUndefined(_) => "ended by a collision",
        Ending::BrokeDown(_) => "ended by overflow",
    };
    let lost = if lost_at_s.is_nan() { "never lost".to_owned() } else { format!("lost after {lost_at_s:.0} s") };
    let words = format!(
        "{lost}; {ending} at {:.0} s, common speed above {RUNAWAY_M_S:e} m/s; closest {min_m:.2} m, delta = \
         {DELTA_M} m",
        flight.duration_s
    );
    let values =
        [("lost_at_s", lost_at_s), ("end_s", flight.duration_s), ("final_common_m_s", common_m_s), ("min_m", min_m)];
    Ok(stated("lost-to-rounding")?.measured(words, values).pass(lost_at_s < LOST_S && common_m_s > RUNAWAY_M_S))
}

/// Returns the growth rate of the relative velocities of a star in formation \[1/s\].
fn star_rate_per_s(count: usize, progress: &Progress<'_>) -> Result<f64, MeasureError> {
    let mut slots_m = Rows::zeros(count);
    let rim = Formation::circle(count - 1, STAR_RADIUS_M);
    slots_m.rows_mut(1, count - 1).copy_from(&rim.slots_m);
    let formation = Formation::points(slots_m);
    // Two followers move across the plane of the star in opposite directions: no edge resists, and the hub stays.
    let mut start = Swarm::at_rest(formation.slots_m.clone());
    (start.velocities_m_s[(1, 2)], start.velocities_m_s[(2, 2)]) = (STAR_M_S, -STAR_M_S);
    let mut scenario = Scenario::new("star", start, formation, DELTA_M, STAR_S);
    scenario.space = Space::Volume;
    scenario.graph = Graph::star(count);
    scenario.a22_per_s = A22_PER_S;
    Ok((end(&scenario, FINE, progress)?.disagreement_m_s() / scenario.start.disagreement_m_s()).ln() / STAR_S)
}

fn stars(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let expected = STARS.map(|count| A22_PER_S - (1.0 + A22_PER_S) / count as f64);
    let rates = try_each(&STARS, &Quiet::new(progress), |&count| star_rate_per_s(count, progress))?;
    let error_per_s = rates.iter().zip(expected).map(|(rate, expected)| (rate - expected).abs()).fold(0.0, larger);
    let claim = stated("star")?;
    let pass = error_per_s <= claim.limit();
    // Rounded to the printed digits, so that a rate of the size of rounding has no sign.
    let entry = |(count, rate): (&usize, &f64)| format!("N = {count}: {:+.6} 1/s", (rate * 1e6).round() / 1e6 + 0.0);
    let list = STARS.iter().zip(&rates).map(entry).collect::<Vec<_>>().join(", ");
    let words = format!("{list}; largest error {} 1/s", bound(error_per_s, claim.limit()));
    let values = ["rate_10_per_s", "rate_11_per_s", "rate_12_per_s"].into_iter().zip(rates);
    Ok(claim.measured(words, values).pass(pass))
}
