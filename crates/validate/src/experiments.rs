//! The paper's experiments, Figs. 2 to 4, in continuous time against an independent integrator.

use nalgebra::Vector3;

use super::claim::{Claim, ClaimsResult, MeasureError, Progress, stated, try_each};
use super::flights::{builtin, certified_m, continuous, end, larger, reached_at_s, times};
use tautline_core::monitor::Quiet;
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_core::text::bound;
use tautline_laws::formation::{best_rigid_motion, largest_edge_error_m, procrustes_rms_m};
use tautline_sim::continuous::{Solution, Tolerances};
use tautline_sim::scenario::Scenario;

/// Duration of the paper's flights \[s\].
const DURATION_S: f64 = 120.0;
/// Sampling rate, equal to that of the reference \[Hz\].
const RATE_HZ: f64 = 10.0;
/// Largest edge error of a reached formation \[m\].
const REACHED_M: f64 = 0.01;
/// Largest edge error of a formation that is reached to working precision, after 120 s of common growth by e^12 \[m\].
const CONVERGED_M: f64 = 1e-9;
/// Rotation of the start \[rad\].
const TURN_RAD: f64 = 1.0;
/// Coefficients \[1/s\] between which relative motion is compared, and the time of the comparison \[s\].
const A22_PER_S: [f64; 3] = [-0.5, 0.0, 0.1];
const COMPARED_S: f64 = 10.0;

/// Returns whether a number agrees with a printed one, to half a unit of its last digit.
fn agrees(measured: f64, printed: &str) -> bool {
    let decimals = printed.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    printed.parse::<f64>().is_ok_and(|expected| (measured - expected).abs() <= 0.5 * libm::exp10(-(decimals as f64)))
}

/// Compares numbers with those of the independent integrator, which the claim expects in the same order.
fn against_reference(claim: Claim, measured: &[f64]) -> Claim {
    let expected: Vec<_> = claim.expected.split(", ").filter_map(|entry| entry.split_once(' ')).collect();
    let entries = || expected.iter().zip(measured).map(|(&(name, printed), &measured)| (name, printed, measured));
    let words = |(name, printed, measured): (&str, &str, f64)| {
        let decimals = printed.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        format!("{name} {measured:.decimals$}")
    };
    let pass = expected.len() == measured.len() && entries().all(|(_, printed, measured)| agrees(measured, printed));
    let values: Vec<_> = entries().map(|(name, _, measured)| (name, measured)).collect();
    claim.measured(entries().map(words).collect::<Vec<_>>().join(", "), values).pass(pass)
}

/// Scenario with its flight.
struct Experiment {
    scenario: Scenario,
    times_s: Vec<f64>,
    solution: Solution,
}

impl Experiment {
    fn fly(scenario: Scenario, progress: &Progress<'_>) -> Result<Self, MeasureError> {
        let times_s = times(DURATION_S, RATE_HZ);
        let solution = continuous(&scenario, &times_s, Tolerances::default(), progress)?;
        Ok(Self { scenario, times_s, solution })
    }

    fn energy_initial(&self) -> Result<f64, MeasureError> {
        Ok(self.scenario.law()?.energy(&self.scenario.observation(&self.scenario.start)).unwrap_or(f64::NAN))
    }

    /// Returns the smallest separation \[m\] and its time \[s\]. Its pair is not unique: mirror images come equally
    /// close.
    fn closest(&self) -> (f64, f64) {
        self.solution.closest.map_or((f64::NAN, f64::NAN), |closest| (closest.separation_m, closest.time_s))
    }

    fn reached_at_s(&self) -> f64 {
        let (formation, graph) = (self.scenario.formation(), &self.scenario.graph);
        reached_at_s(&self.times_s, &self.solution.states, formation, graph, REACHED_M).unwrap_or(f64::NAN)
    }

    fn last_positions_m(&self) -> &Rows {
        self.solution.states.last().map_or(&self.scenario.start.positions_m, |last| &last.positions_m)
    }

    fn last_edge_error_m(&self) -> f64 {
        largest_edge_error_m(self.last_positions_m(), self.scenario.formation(), &self.scenario.graph)
    }

    /// Returns the claim about a figure under the edge-tension law: reached, and never below delta.
    fn formed(&self, id: &str) -> Result<Claim, MeasureError> {
        let (min_m, at_s) = self.closest();
        let (reached_at_s, error_m) = (self.reached_at_s(), self.last_edge_error_m());
        let words = format!(
            "closest {min_m:.6} m at {at_s:.3} s; reached at {reached_at_s:.1} s; edge error {} m after {DURATION_S} s",
            bound(error_m, CONVERGED_M)
        );
        let values =
            [("min_m", min_m), ("min_at_s", at_s), ("reached_at_s", reached_at_s), ("final_edge_error_m", error_m)];
        let pass = min_m > self.scenario.delta_m && reached_at_s.is_finite() && error_m <= CONVERGED_M;
        Ok(stated(id)?.measured(words, values).pass(pass))
    }
}

pub(super) fn judge(progress: &Progress<'_>) -> ClaimsResult {
    let parts: [fn(&Progress<'_>) -> ClaimsResult; 6] = [
        pentagon,
        circle,
        |progress| Ok(vec![baseline(progress)?]),
        |progress| Ok(vec![straight_line(progress)?]),
        |progress| Ok(vec![up_to_rigid_motion(progress)?]),
        |progress| Ok(vec![relative_motion(progress)?]),
    ];
    Ok(try_each(&parts, progress, |part| part(progress))?.concat())
}

fn pentagon(progress: &Progress<'_>) -> ClaimsResult {
    let flight = Experiment::fly(builtin("pentagon")?, progress)?;
    let mut law = flight.scenario.law()?;
    let mut control = Rows::zeros(flight.scenario.count());
    law.command(&flight.scenario.observation(&flight.scenario.start), &mut control)?;
    let at_10_s = flight.times_s.iter().position(|&time_s| time_s == 10.0).map(|k| &flight.solution.states[k]);
    let position = at_10_s.map_or_else(Vector3::zeros, |state| row(&state.positions_m, 0));
    let (min_m, min_at_s) = flight.closest();
    let measured = [
        flight.energy_initial()?,
        certified_m(&flight.scenario)?,
        min_m,
        min_at_s,
        flight.reached_at_s(),
        control[(0, 0)],
        control[(0, 1)],
        position.x,
        position.y,
    ];
    Ok(vec![flight.formed("figure-2")?, against_reference(stated("figure-2-reference")?, &measured)])
}

fn circle(progress: &Progress<'_>) -> ClaimsResult {
    let flight = Experiment::fly(builtin("circle")?, progress)?;
    let (min_m, min_at_s) = flight.closest();
    let measured = [flight.energy_initial()?, certified_m(&flight.scenario)?, min_m, min_at_s, flight.reached_at_s()];
    Ok(vec![flight.formed("figure-3")?, against_reference(stated("figure-3-reference")?, &measured)])
}

fn baseline(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let flight = Experiment::fly(builtin("pentagon-laplacian")?, progress)?;
    let (min_m, min_at_s) = flight.closest();
    let (delta_m, error_m) = (flight.scenario.delta_m, flight.last_edge_error_m());
    let words = format!(
        "closest {min_m:.4} m at {min_at_s:.2} s, delta = {delta_m} m; reached at {:.1} s; edge error {} m after \
         {DURATION_S} s",
        flight.reached_at_s(),
        bound(error_m, CONVERGED_M)
    );
    let pass = agrees(min_m, "1.5327") && agrees(min_at_s, "3.63") && error_m <= CONVERGED_M;
    let values = [("min_m", min_m), ("min_at_s", min_at_s), ("final_edge_error_m", error_m)];
    Ok(stated("figure-4")?.measured(words, values).pass(pass))
}

fn straight_line(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let flight = Experiment::fly(builtin("pentagon-collinear")?, progress)?;
    let (min_m, _) = flight.closest();
    let error_m = flight.last_edge_error_m();
    let states = &flight.solution.states;
    let off_line_m = states.iter().map(|state| state.positions_m.columns(1, 2).amax()).fold(0.0, f64::max);
    let words = format!(
        "distance from the line {}; closest {min_m:.6} m; edge error {error_m:.2} m after {DURATION_S} s",
        if off_line_m == 0.0 { "exactly 0".to_owned() } else { format!("{off_line_m:.1e} m") }
    );
    let pass = off_line_m == 0.0 && agrees(min_m, "2.458145") && agrees(error_m, "8.57");
    let values = [("off_line_m", off_line_m), ("min_m", min_m), ("final_edge_error_m", error_m)];
    Ok(stated("straight-line")?.measured(words, values).pass(pass))
}

/// Finding F6: a rotated and mirrored start gives a rotated and mirrored flight.
fn up_to_rigid_motion(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let straight = Experiment::fly(builtin("pentagon")?, progress)?;
    let (sin, cos) = libm::sincos(TURN_RAD);
    let mut scenario = straight.scenario.clone();
    for i in 0..scenario.count() {
        let start = row(&scenario.start.positions_m, i);
        let turned = Vector3::new(cos * start.x + sin * start.y, sin * start.x - cos * start.y, 0.0);
        set_row(&mut scenario.start.positions_m, i, turned);
    }
    let turned = Experiment::fly(scenario, progress)?;
    let formation = &turned.scenario.formation();
    let positions_m = turned.last_positions_m();
    let fits_m = [straight.last_positions_m(), positions_m].map(|end_m| procrustes_rms_m(end_m, formation));
    let fit_m = fits_m[0].max(fits_m[1]);
    let motion = best_rigid_motion(positions_m, formation);
    // In space a flat shape is turned over instead of mirrored, so only the motion within the plane counts.
    let mirrored = motion.is_some_and(|motion| motion.rotation.fixed_view::<2, 2>(0, 0).determinant() < 0.0);
    // The image of the x axis is a side of the pentagon.
    let turn_rad = motion.map_or(f64::NAN, |motion| motion.rotation[(1, 0)].atan2(motion.rotation[(0, 0)]));
    let offsets_m = (0..formation.count()).map(|i| (row(positions_m, i) - row(&formation.slots_m, i)).norm());
    let farthest_m = offsets_m.fold(0.0, f64::max);
    let words = format!(
        "rigid fit of both ends {} m (rms); turned by {turn_rad:.6} rad and {}; up to {farthest_m:.2} m from the slots",
        bound(fit_m, CONVERGED_M),
        if mirrored { "mirrored" } else { "not mirrored" }
    );
    let turned = mirrored && (turn_rad - TURN_RAD).abs() <= CONVERGED_M;
    let values = [("fit_rms_m", fit_m), ("turn_rad", turn_rad), ("farthest_from_slot_m", farthest_m)];
    let pass = fit_m <= CONVERGED_M && turned && farthest_m > 0.1;
    Ok(stated("up-to-rigid-motion")?.measured(words, values).pass(pass))
}

/// Relative motion on the complete graph does not depend on a22.
fn relative_motion(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let ends = try_each(&A22_PER_S, &Quiet::new(progress), |&a22_per_s| {
        let mut scenario = Scenario { a22_per_s, ..builtin("pentagon")? };
        scenario.time.duration_s = COMPARED_S;
        end(&scenario, Tolerances::default(), progress)
    })?;
    let offset = |swarm: &Swarm, i| row(&swarm.positions_m, i) - row(&swarm.positions_m, 0);
    let [first, others @ ..] = &ends[..] else { return Err("no flight to compare".into()) };
    let apart_m = |other| (0..first.count()).map(move |i| (offset(other, i) - offset(first, i)).norm());
    let difference_m = others.iter().flat_map(apart_m).fold(0.0, larger);
    let words =
        format!("difference after {COMPARED_S} s {} m, a22 = {A22_PER_S:?} 1/s", bound(difference_m, CONVERGED_M));
    Ok(stated("relative-motion")?.measured(words, [("largest_difference_m", difference_m)]).within_limit())
}
