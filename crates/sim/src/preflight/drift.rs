//! Drift of the swarm by its mean velocity: its distance, and whether floating-point numbers resolve positions there.

use super::{Preflight, numbers};
use crate::scenario::{LARGEST, Scenario};

/// Fewest spacings of floating-point numbers within the arrival tolerance at which a drift is harmless.
const FINE_SPACINGS: f64 = 100.0;

impl Preflight {
    /// Describes the growth of the mean velocity and the distance over which it carries the swarm.
    fn drift_in_words(&self, scenario: &Scenario, why: &str) -> String {
        let drift = scenario.drift(self.common_mode_rate_per_s);
        let seed = if scenario.start.mean_velocity_m_s().norm() > 0.0 { "it" } else { "rounding" };
        format!(
            "The mean velocity grows as exp({} t), since {why}: in {} s {seed} grows to about {} m/s and carries the whole \
             swarm {} m away",
            self.common_mode_rate_per_s,
            scenario.time.duration_s,
            numbers::significant(drift.speed_m_s),
            numbers::significant(drift.distance_m)
        )
    }

    pub(super) fn drift_unresolved(&self, scenario: &Scenario) -> Option<String> {
        let (needed_m, spacing_m) = (scenario.arrival.edge_error_m, self.spacing_m);
        let unresolved = if spacing_m > needed_m {
            format!(
                "where positions are {} m apart from number to number and {needed_m} m count",
                numbers::significant(spacing_m)
            )
        } else if self.drift_rounding_m(scenario) > needed_m {
            let rounding_m = numbers::significant(self.drift_rounding_m(scenario));
            format!("where the rounding of all steps adds up to {rounding_m} m; {needed_m} m is required")
        } else if self.drift_m > LARGEST {
            format!("farther than the {LARGEST:e} m that a flight is meant for")
        } else {
            return None;
        };
        let said = if self.common_mode_rate_per_s > 0.0 {
            self.drift_in_words(scenario, self.why_common_mode_grows(scenario))
        } else {
            format!("The mean velocity carries the whole swarm {} m away", numbers::significant(self.drift_m))
        };
        Some(format!("{said}, {unresolved}. Shorten time.duration_s, or reduce what drives the mean velocity."))
    }

    /// Bound of the rounding errors of all steps of the drift \[m\].
    ///
    /// A step rounds the position x to eps |x|/2 and the velocity to 3 eps |v|/2. The error of the velocity moves the vehicle
    /// in all later steps. With x growing as exp(r t) the sum over steps of dt is 4 (eps/2) x/(r dt). With a constant velocity
    /// it is 2 (eps/2) x T/dt.
    fn drift_rounding_m(&self, scenario: &Scenario) -> f64 {
        let time = &scenario.time;
        let uniform = 2.0 * time.duration_s / time.dt_s;
        let rate_dt = self.common_mode_rate_per_s.max(0.0) * time.dt_s;
        0.5 * f64::EPSILON * self.drift_m * uniform.min(4.0 / rate_dt)
    }

    pub(super) fn why_common_mode_grows(&self, scenario: &Scenario) -> &'static str {
        if self.common_mode_rate_per_s < scenario.velocity_coefficient_per_s() {
            "the law brakes it too little"
        } else {
            "the law cannot move the centre of mass"
        }
    }

    pub(super) fn common_mode_unstable(&self, scenario: &Scenario) -> Option<String> {
        if self.common_mode_rate_per_s <= 0.0 || self.drift_unresolved(scenario).is_some() {
            return None;
        }
        let told = if FINE_SPACINGS * self.spacing_m <= scenario.arrival.edge_error_m {
            ". No distance between vehicles feels that.".to_owned()
        } else {
            let spacing = numbers::significant(self.spacing_m);
            format!(
                ", where positions are told to {spacing} m only. Shorten time.duration_s, or reduce swarm.a22_per_s."
            )
        };
        Some(self.drift_in_words(scenario, self.why_common_mode_grows(scenario)) + &told)
    }
}
