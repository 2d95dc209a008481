//! The paper's experiments, Figs. 2 to 4, flown in continuous time and held against an independent integrator.

use nalgebra::Vector3;

use super::claim::{Claim, Kind};
use super::flights::{builtin, certified_m, continuous, end, reached_at_s, times};
use super::interface::{Judged, Progress, Untried, try_each};
use crate::continuous::{Solution, Tolerances};
use crate::formation::{best_rigid_motion, largest_edge_error_m, procrustes_rms_m};
use crate::scenario::Scenario;
use crate::swarm::{Rows, Swarm, row, set_row};
use crate::text::bound;

/// Length of the paper's flights \[s\].
const DURATION_S: f64 = 120.0;
/// Looks at the flight, as often as the reference's \[Hz\].
const RATE_HZ: f64 = 10.0;
/// Reached means a largest edge error below this \[m\].
const REACHED_M: f64 = 0.01;
/// Error of a formation that is reached as well as doubles can hold it, after 120 s in which common motion has grown by
/// e^12 \[m\].
const CONVERGED_M: f64 = 1e-9;
/// How far the start is turned to see what follows \[rad\].
const TURN_RAD: f64 = 1.0;
/// Coefficients \[1/s\] between which relative motion is compared, and when \[s\].
const A22_PER_S: [f64; 3] = [-0.5, 0.0, 0.1];
const COMPARED_S: f64 = 10.0;

const REFERENCE: &str = "the reference is an independent 8th-order Runge-Kutta integrator at relative tolerance 1e-10";

/// A number of the independent integrator and ours.
struct Check {
    name: &'static str,
    /// Digits of the reference after the point.
    decimals: u32,
    expected: f64,
    measured: f64,
}

fn check(name: &'static str, decimals: u32, expected: f64, measured: f64) -> Check {
    Check { name, decimals, expected, measured }
}

/// Whether a number agrees with one of so many digits after the point.
fn agrees(measured: f64, expected: f64, decimals: u32) -> bool {
    (measured - expected).abs() <= 0.5 / f64::from(10_u32.pow(decimals))
}

fn list(checks: &[Check], of: fn(&Check) -> f64) -> String {
    let entries = checks.iter().map(|check| format!("{} {:.*}", check.name, check.decimals as usize, of(check)));
    entries.collect::<Vec<_>>().join(", ")
}

fn against_reference(id: &'static str, source: &'static str, checks: &[Check]) -> Claim {
    Claim::new(Kind::Ours, id, source)
        .expected(list(checks, |check| check.expected))
        .measured(list(checks, |check| check.measured))
        .values(checks.iter().map(|check| (check.name, check.measured)))
        .tolerance("half a unit of the last digit of the reference")
        .reason(REFERENCE)
        .pass(checks.iter().all(|check| agrees(check.measured, check.expected, check.decimals)))
}

/// An experiment: the scenario, its flight, and its numbers.
struct Experiment {
    scenario: Scenario,
    times_s: Vec<f64>,
    solution: Solution,
}

impl Experiment {
    fn fly(scenario: Scenario) -> Result<Self, Untried> {
        let times_s = times(DURATION_S, RATE_HZ);
        let solution = continuous(&scenario, &times_s, Tolerances::default())?;
        Ok(Self { scenario, times_s, solution })
    }

    fn energy_initial(&self) -> Result<f64, Untried> {
        Ok(self.scenario.law()?.energy(&self.scenario.observation(&self.scenario.start)).unwrap_or(f64::NAN))
    }

    /// The closest approach \[m\] and its time \[s\]. Its pair is not told: mirror images come equally close.
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

    /// The paper's statement about a figure under the edge-tension law: formed, and never below delta.
    fn formed(&self, id: &'static str, source: &'static str) -> Claim {
        let (min_m, at_s) = self.closest();
        let (reached_at_s, error_m) = (self.reached_at_s(), self.last_edge_error_m());
        let delta_m = self.scenario.delta_m;
        Claim::new(Kind::PaperHolds, id, source)
            .expected(format!("never below delta = {delta_m} m, and the formation reached"))
            .measured(format!(
                "closest {min_m:.6} m at {at_s:.3} s; largest edge error below {REACHED_M} m from \
                 {reached_at_s:.1} s on, {} m after {DURATION_S} s",
                bound(error_m, CONVERGED_M)
            ))
            .values([
                ("min_m", min_m),
                ("min_at_s", at_s),
                ("reached_at_s", reached_at_s),
                ("final_edge_error_m", error_m),
            ])
            .tolerance(format!("{CONVERGED_M:e} m at the end"))
            .reason("rounding, after common motion has grown by e^12")
            .pass(min_m > delta_m && reached_at_s.is_finite() && error_m <= CONVERGED_M)
    }
}

pub(super) fn judge(progress: &Progress<'_>) -> Judged {
    let parts: [fn() -> Judged; 6] = [
        pentagon,
        circle,
        || Ok(vec![baseline()?]),
        || Ok(vec![straight_line()?]),
        || Ok(vec![up_to_rigid_motion()?]),
        || Ok(vec![relative_motion()?]),
    ];
    Ok(try_each(&parts, progress, |part| part())?.concat())
}

fn pentagon() -> Judged {
    let flight = Experiment::fly(builtin("pentagon")?)?;
    let mut law = flight.scenario.law()?;
    let mut control = Rows::zeros(flight.scenario.count());
    law.command(&flight.scenario.observation(&flight.scenario.start), &mut control)?;
    let at_10_s = flight.times_s.iter().position(|&time_s| time_s == 10.0).map(|k| &flight.solution.states[k]);
    let position = at_10_s.map_or_else(Vector3::zeros, |state| row(&state.positions_m, 0));
    let (min_m, min_at_s) = flight.closest();
    let checks = [
        check("energy_initial_m2_s2", 8, 3.656_742_96, flight.energy_initial()?),
        check("certified_m", 6, 2.055_307, certified_m(&flight.scenario)?),
        check("min_m", 6, 2.460_353, min_m),
        check("min_at_s", 3, 2.151, min_at_s),
        check("reached_at_s", 1, 36.5, flight.reached_at_s()),
        check("vehicle_1_control_x_m_s2", 9, 0.860_843_123, control[(0, 0)]),
        check("vehicle_1_control_y_m_s2", 9, -0.021_225_585, control[(0, 1)]),
        check("vehicle_1_x_at_10_s_m", 7, 4.318_055_1, position.x),
        check("vehicle_1_y_at_10_s_m", 7, -1.043_487_6, position.y),
    ];
    Ok(vec![
        flight
            .formed("figure-2", "Fig. 2, equation (8)")
            .statement("Five vehicles leave a line and form the pentagon without coming closer than delta."),
        against_reference("figure-2-reference", "Fig. 2", &checks)
            .statement("The pentagon's flight agrees with an independent integrator."),
    ])
}

fn circle() -> Judged {
    let flight = Experiment::fly(builtin("circle")?)?;
    let (min_m, min_at_s) = flight.closest();
    let checks = [
        check("energy_initial_m2_s2", 8, 4.479_772_16, flight.energy_initial()?),
        check("certified_m", 6, 1.019_476, certified_m(&flight.scenario)?),
        check("min_m", 6, 1.238_135, min_m),
        check("min_at_s", 2, 4.18, min_at_s),
        check("reached_at_s", 1, 44.3, flight.reached_at_s()),
    ];
    Ok(vec![
        flight
            .formed("figure-3", "Fig. 3, equation (8)")
            .statement("Six vehicles leave a line and form the circle without coming closer than delta."),
        against_reference("figure-3-reference", "Fig. 3", &checks)
            .statement("The circle's flight agrees with an independent integrator."),
    ])
}

fn baseline() -> Result<Claim, Untried> {
    let flight = Experiment::fly(builtin("pentagon-laplacian")?)?;
    let (min_m, min_at_s) = flight.closest();
    let (delta_m, error_m) = (flight.scenario.delta_m, flight.last_edge_error_m());
    Ok(Claim::new(Kind::PaperHolds, "figure-4", "Fig. 4, equation (3)")
        .statement(
            "Under the Laplacian law (3) the same start reaches the pentagon, but vehicles come closer than delta.",
        )
        .expected("reached; closest 1.5327 m at 3.63 s")
        .measured(format!(
            "closest {min_m:.4} m at {min_at_s:.2} s, delta = {delta_m} m; reached at {:.1} s, largest \
             edge error {} m after {DURATION_S} s",
            flight.reached_at_s(),
            bound(error_m, CONVERGED_M)
        ))
        .values([("min_m", min_m), ("min_at_s", min_at_s), ("final_edge_error_m", error_m)])
        .tolerance("half a unit of the last digit")
        .reason(REFERENCE)
        .pass(agrees(min_m, 1.5327, 4) && agrees(min_at_s, 3.63, 2) && error_m <= CONVERGED_M))
}

fn straight_line() -> Result<Claim, Untried> {
    let flight = Experiment::fly(builtin("pentagon-collinear")?)?;
    let (min_m, _) = flight.closest();
    let error_m = flight.last_edge_error_m();
    let states = &flight.solution.states;
    let off_line_m = states.iter().map(|state| state.positions_m.columns(1, 2).amax()).fold(0.0, f64::max);
    Ok(Claim::new(Kind::PaperRefuted, "straight-line", "the convergence theorem")
        .finding("F2")
        .statement("The law drives the vehicles to the formation from any start without overlap.")
        .expected("from an exactly straight line never: closest 2.458145 m, largest edge error 8.57 m for ever")
        .measured(format!(
            "largest distance from the line {}; closest {min_m:.6} m; largest edge error {error_m:.2} m after \
             {DURATION_S} s",
            if off_line_m == 0.0 { "exactly 0".to_owned() } else { format!("{off_line_m:.1e} m") }
        ))
        .values([("off_line_m", off_line_m), ("min_m", min_m), ("final_edge_error_m", error_m)])
        .tolerance("0 from the line, half a unit of the last digit for the rest")
        .reason("forces along the line have no other component, not even by rounding")
        .pass(off_line_m == 0.0 && agrees(min_m, 2.458_145, 6) && agrees(error_m, 8.57, 2)))
}

/// F6: turn and mirror the start, and everything that follows is turned and mirrored with it.
fn up_to_rigid_motion() -> Result<Claim, Untried> {
    let straight = Experiment::fly(builtin("pentagon")?)?;
    let (sin, cos) = libm::sincos(TURN_RAD);
    let mut scenario = straight.scenario.clone();
    for i in 0..scenario.count() {
        let start = row(&scenario.start.positions_m, i);
        let turned = Vector3::new(cos * start.x + sin * start.y, sin * start.x - cos * start.y, 0.0);
        set_row(&mut scenario.start.positions_m, i, turned);
    }
    let turned = Experiment::fly(scenario)?;
    let formation = &turned.scenario.formation();
    let positions_m = turned.last_positions_m();
    let fits_m = [straight.last_positions_m(), positions_m].map(|end_m| procrustes_rms_m(end_m, formation));
    let fit_m = fits_m[0].max(fits_m[1]);
    let motion = best_rigid_motion(positions_m, formation);
    // In space a flat shape is turned over instead of mirrored: what counts is the motion within the plane.
    let mirrored = motion.is_some_and(|motion| motion.rotation.fixed_view::<2, 2>(0, 0).determinant() < 0.0);
    // The image of the x axis: a side of the pentagon.
    let turn_rad = motion.map_or(f64::NAN, |motion| motion.rotation[(1, 0)].atan2(motion.rotation[(0, 0)]));
    let offsets_m = (0..formation.count()).map(|i| (row(positions_m, i) - row(&formation.slots_m, i)).norm());
    let farthest_m = offsets_m.fold(0.0, f64::max);
    Ok(Claim::new(Kind::PaperRefuted, "up-to-rigid-motion", "section 4, goal positions h_p")
        .finding("F6")
        .statement("The vehicles reach the goal positions.")
        .expected(format!(
            "only the shape: a start turned by {TURN_RAD} rad and mirrored gives an end turned by {TURN_RAD} \
             rad and mirrored"
        ))
        .measured(format!(
            "best rigid fit {} m (rms) either way; turned by {turn_rad:.6} rad and {}; a vehicle is {farthest_m:.2} \
             m from its slot",
            bound(fit_m, CONVERGED_M),
            if mirrored { "mirrored" } else { "not mirrored" }
        ))
        .values([("fit_rms_m", fit_m), ("turn_rad", turn_rad), ("farthest_from_slot_m", farthest_m)])
        .tolerance(format!("{CONVERGED_M:e} m for the fit, {CONVERGED_M:e} rad for the turn"))
        .reason("rounding, after common motion has grown by e^12")
        .pass(fit_m <= CONVERGED_M && mirrored && (turn_rad - TURN_RAD).abs() <= CONVERGED_M && farthest_m > 0.1))
}

/// Relative motion on the complete graph is the same for every a22.
fn relative_motion() -> Result<Claim, Untried> {
    let ends = try_each(&A22_PER_S, &|_| (), |&a22_per_s| {
        let mut scenario = Scenario { a22_per_s, ..builtin("pentagon")? };
        scenario.time.duration_s = COMPARED_S;
        end(&scenario, Tolerances::default())
    })?;
    let offset = |swarm: &Swarm, i| row(&swarm.positions_m, i) - row(&swarm.positions_m, 0);
    let [first, others @ ..] = &ends[..] else { return Err("no flight to compare".into()) };
    let apart_m = |other| (0..first.count()).map(move |i| (offset(other, i) - offset(first, i)).norm());
    let difference_m = others.iter().flat_map(apart_m).fold(0.0, f64::max);
    Ok(Claim::new(Kind::Ours, "relative-motion", "the stability theorem, complete graph")
        .statement("On the complete graph a22 cancels: relative motion does not depend on it.")
        .expected("the same pentagon flight")
        .measured(format!(
            "relative positions after {COMPARED_S} s differ by {} m between a22 of {A22_PER_S:?} 1/s",
            bound(difference_m, CONVERGED_M)
        ))
        .values([("largest_difference_m", difference_m)])
        .tolerance(format!("{CONVERGED_M:e} m"))
        .reason("the solver's tolerance of 1e-12 a step")
        .pass(difference_m <= CONVERGED_M))
}
