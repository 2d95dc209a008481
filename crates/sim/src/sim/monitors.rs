//! Monitors of a flight: integration error, rounding error and energy.

use nalgebra::Vector3;

use super::controller::Controller;
use super::ending::Breakdown;
use crate::scenario::Scenario;
use tautline_core::record::{DeadlockRecovery, EnergyRise, Event, Reassignment};
use tautline_core::swarm::{Rows, Swarm, mean_row};
use tautline_laws::law::Certificate;
use tautline_laws::target::Change;

/// Bound of the integration error of a separation, from the first overlong substep on.
///
/// While the fastest rate of the law is `omega` and no vehicle moves farther than `s`, the acceleration of a vehicle
/// changes by at most `omega^2 s`. With a limit `a` of accelerations it changes by at most `2 a`. The error of a
/// substep of length h with accelerations from its ends is at most that of a constant error of this size:
///
/// ```text
/// c = min(omega^2 s, 2 a)
/// velocity of a pair    2 h c
/// position of a pair      h^2 c
/// ```
///
/// Errors grow from substep to substep as solutions of `x'' = min(omega^2 x, 4 a)`, the fastest divergence of two
/// motions of the law. Substeps that are short enough for the law add no error of their own: it is of second order in
/// the step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct IntegrationError {
    position_m: f64,
    velocity_m_s: f64,
}

/// Substep, as far as its error depends on it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Substep {
    /// Length \[s\].
    pub(super) length_s: f64,
    /// Fastest rate of the law over it \[1/s\].
    pub(super) rate_per_s: f64,
    /// Longest move of a vehicle \[m\].
    pub(super) moved_m: f64,
    /// Limit of commanded accelerations \[m/s^2\]; infinite without a limit.
    pub(super) limit_m_s2: f64,
    /// Whether the substep is too long for the law.
    pub(super) is_overlong: bool,
}

impl IntegrationError {
    /// Returns the bound of the error of a separation \[m\]; infinite if unbounded.
    pub(super) fn position_m(self) -> f64 {
        self.position_m
    }

    /// Returns the error after one more substep.
    #[must_use]
    pub(super) fn after(self, part: Substep) -> Self {
        let Substep { length_s, rate_per_s, moved_m, limit_m_s2, is_overlong } = part;
        // Infinite rate times zero way is NaN, which `min` ignores.
        let change_m_s2 = |way_m: f64, most_m_s2: f64| (rate_per_s * rate_per_s * way_m).min(most_m_s2);
        let own_m_s = if is_overlong { length_s * change_m_s2(moved_m, 2.0 * limit_m_s2) } else { 0.0 };
        let position_m = self.position_m + length_s * (self.velocity_m_s + own_m_s);
        let grown_m_s = if position_m > 0.0 { length_s * change_m_s2(position_m, 4.0 * limit_m_s2) } else { 0.0 };
        Self { position_m, velocity_m_s: self.velocity_m_s + grown_m_s + 2.0 * own_m_s }
    }
}

/// Number of roundings of a velocity in one step: two half kicks and the drift between them.
const VELOCITY_ROUNDINGS: f64 = 3.0;

/// Upper bound of the accumulated rounding error of any coordinate.
///
/// Every step rounds a position x, relative to the centre of the start, to half a unit in the last place, and a
/// velocity v a few times. The error of the velocity moves the vehicle in all later steps:
///
/// ```text
/// e_v' = e_v + 3 (eps/2) |v|        e_x' = e_x + e_v' dt + (eps/2) |x|        eps = 2^-52
/// ```
///
/// A vehicle whose displacement per step is below half a unit in the last place of its position stands still; the bound
/// includes this error.
#[derive(Clone, Copy)]
pub(super) struct RoundingBound {
    /// Centre of the start, the origin of a plant's positions \[m\].
    origin_m: Vector3<f64>,
    required_m: f64,
    velocity_m_s: f64,
    position_m: f64,
    /// Rounding of the present positions relative to the origin of the scenario \[m\].
    present_m: f64,
}

impl RoundingBound {
    pub(super) fn of(scenario: &Scenario) -> Self {
        Self {
            origin_m: mean_row(&scenario.start.positions_m),
            required_m: scenario.arrival.edge_error_m,
            velocity_m_s: 0.0,
            position_m: 0.0,
            present_m: 0.0,
        }
    }

    /// Adds the rounding of a step of `dt_s` \[s\] that ended in a state, in O(N).
    ///
    /// # Errors
    /// [`Breakdown::Unresolved`] if the bound exceeds the tolerance of arrival.
    pub(super) fn add_step(&mut self, swarm: &Swarm, dt_s: f64, step: u64) -> Result<(), Breakdown> {
        let half_unit = 0.5 * f64::EPSILON;
        let far_m = largest_coordinate(&swarm.positions_m, self.origin_m);
        self.velocity_m_s +=
            VELOCITY_ROUNDINGS * half_unit * largest_coordinate(&swarm.velocities_m_s, Vector3::zeros());
        self.position_m += self.velocity_m_s * dt_s + half_unit * far_m;
        self.present_m = half_unit * (far_m + self.origin_m.amax());
        let (rounding_m, required_m) = (self.rounding_m(), self.required_m);
        if rounding_m > required_m { Err(Breakdown::Unresolved { step, rounding_m, required_m }) } else { Ok(()) }
    }

    /// Returns the bound for one coordinate \[m\].
    pub(super) fn rounding_m(&self) -> f64 {
        self.position_m + self.present_m
    }
}

/// Returns the largest magnitude of a coordinate relative to an origin.
fn largest_coordinate(rows: &Rows, origin: Vector3<f64>) -> f64 {
    let largest = |axis: usize| rows.column(axis).iter().fold(0.0_f64, |most, x| most.max((x - origin[axis]).abs()));
    largest(0).max(largest(1)).max(largest(2))
}

/// Energy since the last change of the target, the worst rise, and the changes of the target.
#[derive(Clone, Debug, Default)]
pub(super) struct EnergyMonitor {
    /// Revision of the target, and its first energy \[m^2/s^2\].
    since: Option<(u64, f64)>,
    /// Worst rise: the one that integration explains least. Rounding is the same for all rises.
    worst: Option<EnergyRise>,
    leg: usize,
    pub(super) deadlock_recoveries: Vec<DeadlockRecovery>,
    pub(super) assignments: Vec<Reassignment>,
}

impl EnergyMonitor {
    /// Records the supervisor's changes at an instant, and renews the certificate if necessary.
    pub(super) fn note_changes(
        &mut self,
        scenario: &Scenario,
        controller: &mut Controller,
        (time_s, state): (f64, &Swarm),
        certificate: &mut Certificate,
        events: &mut Vec<Event>,
    ) {
        let leg = controller.target.view().leg;
        events.extend((self.leg + 1..=leg).map(|leg| Event::LegBegan { leg, time_s }));
        self.leg = leg;
        let Some((change, promise)) = controller.change(time_s, state) else { return };
        if scenario.shield.is_none() {
            certificate.renew(&scenario.with_scenario_limits(promise), leg);
        }
        let certified_m = certificate.certified_m;
        events.push(match change {
            Change::Spread { scale } => {
                self.deadlock_recoveries.push(DeadlockRecovery { time_s, scale, certified_m });
                Event::DeadlockRecovery { time_s, scale }
            }
            Change::Assigned { slots } => {
                let vehicles = slots.iter().enumerate().filter(|&(i, &slot)| i != slot).count();
                self.assignments.push(Reassignment { time_s, vehicles, certified_m });
                Event::Assigned { time_s, slots }
            }
        });
    }

    /// Records the energy of the next instant, under the target with this revision.
    pub(super) fn add(&mut self, revision: u64, energy: Option<f64>) {
        let Some(energy) = energy else { return };
        let from = match self.since {
            Some((own_revision, from)) if own_revision == revision => from,
            _ => {
                self.since = Some((revision, energy));
                energy
            }
        };
        let rise = EnergyRise { from, to: energy };
        if self.worst.is_none_or(|worst| rise.unexplained() > worst.unexplained()) {
            self.worst = Some(rise);
        }
    }

    pub(super) fn worst(&self) -> Option<EnergyRise> {
        self.worst
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_laws::formation::Formation;

    const OVERLONG: Substep =
        Substep { length_s: 0.25, rate_per_s: 2.0, moved_m: 0.5, limit_m_s2: f64::INFINITY, is_overlong: true };

    /// Tests x'' = omega^2 x, the fastest growth, from x = 1 in kicks and drifts with omega h = 0.5, against cosh(omega
    /// t).
    #[test]
    fn the_bound_holds_for_a_motion_that_is_stepped_too_coarsely() {
        let Substep { length_s: h, rate_per_s: omega, .. } = OVERLONG;
        let kick = |x: f64| 0.5 * h * omega * omega * x;
        let (mut x, mut v, mut error) = (1.0, 0.0, IntegrationError::default());
        for step in 1..=8_u32 {
            let before: f64 = x;
            v += kick(x);
            x += h * v;
            v += kick(x);
            error = error.after(Substep { moved_m: x - before, ..OVERLONG });
            let exact = libm::cosh(omega * h * f64::from(step));
            assert!((x - exact).abs() <= error.position_m(), "step {step}: {x} for {exact}, {error:?}");
        }
    }

    #[test]
    fn an_error_is_zero_until_a_part_is_too_long_and_unbounded_at_a_barrier_without_a_limit() {
        let none = IntegrationError::default();
        assert_eq!(none.after(Substep { is_overlong: false, ..OVERLONG }), none);
        for moved_m in [0.5, 0.0] {
            let at_barrier = Substep { rate_per_s: f64::INFINITY, moved_m, ..OVERLONG };
            let error = none.after(at_barrier);
            assert_eq!(error.position_m(), f64::INFINITY, "moved by {moved_m} m");
            let later = error.after(Substep { rate_per_s: 0.0, is_overlong: false, ..OVERLONG });
            assert_eq!(later.position_m(), f64::INFINITY);
            // A limit of 3 m/s^2 bounds the change by 6 m/s^2.
            let limited = none.after(Substep { limit_m_s2: 3.0, ..at_barrier });
            assert_eq!(limited, IntegrationError { position_m: 0.375, velocity_m_s: 6.0 });
        }
    }

    /// Returns the number of steps of `dt_s` that two vehicles fly at a position and speed until the bound is exceeded;
    /// at most 100,000.
    fn steps(from_m: f64, at_m: f64, speed_m_s: f64, dt_s: f64) -> u64 {
        let rows = |x_m: f64| Rows::from_row_slice(&[x_m, 0.0, 0.0, x_m + 4.0, 0.0, 0.0]);
        let scenario = Scenario::new("pair", Swarm::at_rest(rows(from_m)), Formation::line(2, 3.0), 2.0, 1.0);
        let mut resolution = RoundingBound::of(&scenario);
        let mut state = Swarm::at_rest(rows(at_m));
        state.velocities_m_s.column_mut(1).fill(speed_m_s);
        let is_exceeded = |step: &u64| match resolution.add_step(&state, dt_s, *step) {
            Err(Breakdown::Unresolved { step: at_step, rounding_m, required_m }) => {
                assert!(at_step == *step && rounding_m > required_m && required_m == 0.01);
                true
            }
            other => {
                assert_eq!(other, Ok(()));
                false
            }
        };
        (1..=100_000).find(is_exceeded).unwrap_or(100_000)
    }

    #[test]
    fn a_swarm_far_from_its_start_ends_when_rounding_exceeds_the_tolerance() {
        // Half a unit in the last place of 2^30 m is 1.2e-7 m, of 2^40 m 1.2e-4 m.
        assert_eq!(steps(0.0, 2.0_f64.powi(30), 0.0, 0.01), 83_886);
        assert!(steps(0.0, 2.0_f64.powi(40), 0.0, 0.01) < 90);
        assert_eq!(steps(1e6, 1e6, 0.0, 0.01), 100_000, "the start is there");
    }

    #[test]
    fn errors_of_velocities_accumulate_with_time() {
        assert_eq!(steps(0.0, 0.0, 1.0, 1.0 / 240.0), 100_000);
        // An error of 3.3e-16 of 1e6 m/s per step of 1 s: 0.01 m after about 7,700 steps.
        assert!((7_000..8_500).contains(&steps(0.0, 0.0, 1e6, 1.0)));
    }

    #[test]
    fn rises_count_within_a_target_only() {
        let mut energy_monitor = EnergyMonitor::default();
        assert_eq!(energy_monitor.worst(), None);
        energy_monitor.add(0, None);
        for (revision, energy) in [(0, 4.0), (0, 3.0), (1, 9.0), (1, 8.0), (2, 2.0)] {
            energy_monitor.add(revision, Some(energy));
        }
        assert_eq!(energy_monitor.worst(), Some(EnergyRise { from: 2.0, to: 2.0 }), "it only fell");
        energy_monitor.add(2, Some(2.5));
        energy_monitor.add(2, Some(2.2));
        assert_eq!(energy_monitor.worst(), Some(EnergyRise { from: 2.0, to: 2.5 }));
    }

    #[test]
    fn a_ratio_of_tiny_energies_does_not_hide_a_rise() {
        let mut energy_monitor = EnergyMonitor::default();
        energy_monitor.add(0, Some(0.0));
        energy_monitor.add(0, Some(1e-3));
        assert_eq!(energy_monitor.worst(), Some(EnergyRise { from: 0.0, to: 1e-3 }));
        for (revision, energy) in [(1, 1e-16), (1, 1e-9), (2, 9.0), (2, 12.0), (3, 100.0), (3, 100.05)] {
            energy_monitor.add(revision, Some(energy));
        }
        assert_eq!(energy_monitor.worst(), Some(EnergyRise { from: 9.0, to: 12.0 }));
    }
}
