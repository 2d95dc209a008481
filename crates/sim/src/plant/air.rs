//! What a wind does to points that have a drag.

use nalgebra::Vector3;

use crate::scenario::{Scenario, Space};
use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, row, set_row};
use tautline_laws::wind::Wind;

/// A wind, and points that are pushed by their drag times its velocity. The other half of a drag, on their own velocity, is of
/// the motion in still air.
#[derive(Clone, Debug)]
pub(crate) struct Air {
    wind: Wind,
    /// Along each axis \[1/s\]; none along z in the plane.
    drag_per_s: Vector3<f64>,
    /// What is commanded \[m/s^2\].
    command: Rows,
}

impl Air {
    /// That of the scenario, where a wind blows.
    pub(crate) fn of(scenario: &Scenario) -> Option<Self> {
        let up_per_s = if scenario.space == Space::Plane { 0.0 } else { scenario.drag_per_s };
        let drag_per_s = Vector3::new(scenario.drag_per_s, scenario.drag_per_s, up_per_s);
        let command = Rows::zeros(scenario.count());
        (!scenario.wind.is_still()).then(|| Self { wind: scenario.air(), drag_per_s, command })
    }

    /// Moves the wind on by `dt_s` seconds.
    pub(crate) fn advance(&mut self, dt_s: f64) {
        self.wind.advance(dt_s);
    }

    /// Takes the last [`Air::advance`] back.
    pub(crate) fn undo(&mut self) {
        self.wind.undo();
    }

    /// Takes another command.
    pub(super) fn hold(&mut self, command: &Rows) {
        self.command.copy_from(command);
    }

    /// Writes the command and what the wind adds to it now \[m/s^2\].
    pub(super) fn write_held(&self, held: &mut Rows) {
        for i in 0..self.command.nrows() {
            set_row(held, i, row(&self.command, i) + self.push_m_s2(i, 0.0));
        }
    }

    /// What the wind pushes a vehicle with, `before_s` seconds before now \[m/s^2\].
    pub(crate) fn push_m_s2(&self, vehicle: usize, before_s: f64) -> Vector3<f64> {
        self.wind.air_at_m_s(vehicle, self.wind.now_s() - before_s).component_mul(&self.drag_per_s)
    }

    /// How long the wind is smooth from so many seconds before now on \[s\].
    pub(crate) fn smooth_s(&self, before_s: f64) -> f64 {
        let time_s = self.wind.now_s() - before_s;
        self.wind.next_turn_s(time_s) - time_s
    }

    pub(crate) fn reseed(&mut self, seed: u64) {
        self.wind.reseed(seed);
    }

    pub(crate) fn channel() -> Channel {
        Wind::channel()
    }

    pub(crate) fn write_channel(&self, channel: &mut Channel) {
        self.wind.write_channel(channel);
    }
}
