//! `[actuation]`: conversion of commands into accelerations, with a limit and a lag.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::ImperfectionSpec;
use super::sensing::SAME_S;
use crate::scenario::{ErrorKind, Scenario, ScenarioError, is_default};
use tautline_core::swarm::{Rows, row, set_row};
use tautline_laws::law::VoidReason;

/// Conversion of commands into accelerations: without limit and lag unless given.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ActuationSpec {
    /// Limit of the magnitude of each acceleration in m/s^2; longer commands are scaled down. No limit unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_accel_m_s2: Option<f64>,
    /// Time constant in s of the lag of motors, lag a' = u - a, with a = 0 at the start; 0 unless given.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub lag_s: f64,
}

impl ImperfectionSpec for ActuationSpec {
    fn is_exact(&self) -> bool {
        *self == Self::default()
    }

    fn check(&self, scenario: &Scenario) -> Result<(), ScenarioError> {
        if self.lag_s == 0.0 || scenario.plant.holds_commands() {
            return Ok(());
        }
        let problem = "the ideal plant supports no lag";
        let help = "leave out actuation.lag_s, or set plant.kind to \"rapier\"";
        Err(ErrorKind::UnsupportedByPlant.at(&["actuation.lag_s", "plant.kind"], problem, help))
    }

    fn voids(&self) -> Vec<VoidReason> {
        let voids = [
            (self.max_accel_m_s2.is_some(), VoidReason::AccelerationLimited),
            (self.lag_s > 0.0, VoidReason::AccelerationLagged),
        ];
        voids.into_iter().filter_map(|(is_void, void)| is_void.then_some(void)).collect()
    }
}

/// Limits commands and follows them with a lag.
#[derive(Clone, Debug)]
pub(super) struct Actuation {
    spec: ActuationSpec,
    /// Whether commands are held between instants; otherwise they are interpolated linearly.
    holds: bool,
    lag: Option<Lag>,
}

/// Accelerations a that follow commands u: tau a' = u - a.
#[derive(Clone, Debug)]
struct Lag {
    before: Point,
    now: Point,
}

/// Commands and accelerations at an instant.
#[derive(Clone, Debug)]
struct Point {
    time_s: f64,
    command: Rows,
    accelerations: Rows,
}

impl Actuation {
    pub(super) fn new(scenario: &Scenario) -> Self {
        let rest =
            Point { time_s: 0.0, command: Rows::zeros(scenario.count()), accelerations: Rows::zeros(scenario.count()) };
        Self {
            spec: scenario.actuation,
            holds: scenario.time.control_hz.is_some(),
            lag: (scenario.actuation.lag_s > 0.0).then(|| Lag { before: rest.clone(), now: rest }),
        }
    }

    /// Replaces the commands at a time \[s\] by accelerations. Times must not decrease. A repeated time replaces the
    /// previous call; with `begins`, the accelerations of the previous call stay, and the commands act from now on.
    pub(super) fn act(&mut self, time_s: f64, command: &mut Rows, begins: bool) {
        if let Some(most_m_s2) = self.spec.max_accel_m_s2 {
            for i in 0..command.nrows() {
                let limited = row(command, i).cap_magnitude(most_m_s2);
                set_row(command, i, limited);
            }
        }
        let Some(lag) = &mut self.lag else { return };
        let is_repeated = time_s <= lag.now.time_s + SAME_S;
        if !is_repeated {
            std::mem::swap(&mut lag.before, &mut lag.now);
            lag.now.time_s = time_s;
        }
        lag.now.command.copy_from(command);
        if !(is_repeated && begins) {
            lag.follow(self.spec.lag_s, self.holds);
        }
        command.copy_from(&lag.now.accelerations);
    }
}

impl Lag {
    /// Advances the exact solution between the two points, for a command that is held or linear in time.
    fn follow(&mut self, lag_s: f64, holds: bool) {
        let Self { before, now } = self;
        let passed_s = now.time_s - before.time_s;
        let left = libm::exp(-passed_s / lag_s);
        let entries = before.command.iter().zip(before.accelerations.iter()).zip(now.command.iter());
        for (((&from, &was), &to), now) in entries.zip(now.accelerations.iter_mut()) {
            let slope = if holds || passed_s == 0.0 { 0.0 } else { (to - from) / passed_s };
            // For a linear command, the steady acceleration trails by lag times slope.
            *now = from + slope * (passed_s - lag_s) + (was - from + slope * lag_s) * left;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::Swarm;
    use tautline_laws::formation::Formation;

    fn actuation(max_accel_m_s2: Option<f64>, lag_s: f64, control_hz: Option<f64>) -> Actuation {
        let line = Formation::line(2, 3.0);
        let mut scenario = Scenario::new("line", Swarm::at_rest(line.slots_m.clone()), line, 1.0, 10.0);
        scenario.actuation = ActuationSpec { max_accel_m_s2, lag_s };
        scenario.time.control_hz = control_hz;
        Actuation::new(&scenario)
    }

    #[test]
    fn only_commands_above_the_limit_are_scaled_down() {
        let mut command = Rows::from_row_slice(&[3.0, 4.0, 0.0, 0.3, -0.4, 0.0]);
        actuation(Some(1.0), 0.0, None).act(0.0, &mut command, false);
        let expected = Rows::from_row_slice(&[0.6, 0.8, 0.0, 0.3, -0.4, 0.0]);
        assert!((command - expected).amax() < 1e-15);
    }

    #[test]
    fn a_lag_solves_its_equation_exactly_for_steps_and_ramps() {
        for parts in [1, 7, 100] {
            for (holds, exact) in [
                // From 0 after a step to 1.
                (Some(10.0), 1.0 - libm::exp(-2.0_f64)),
                // For u = t.
                (None, 0.4 - 0.2 + 0.2 * libm::exp(-2.0_f64)),
            ] {
                let mut actuation = actuation(None, 0.2, holds);
                let mut acceleration = Rows::zeros(2);
                for k in 0..=parts {
                    let time_s = 0.4 * f64::from(k) / f64::from(parts);
                    acceleration.fill(if holds.is_some() { 1.0 } else { time_s });
                    let again = acceleration.clone();
                    actuation.act(time_s, &mut acceleration, false);
                    acceleration.copy_from(&again);
                    actuation.act(time_s, &mut acceleration, false);
                }
                assert!((acceleration[(1, 2)] - exact).abs() < 1e-14, "{parts} {holds:?}: {}", acceleration[(1, 2)]);
            }
        }
    }
}
