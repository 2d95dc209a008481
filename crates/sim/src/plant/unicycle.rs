//! Plant of unicycles: vehicles in the plane that move along their heading and cannot stop.
//!
//! Without engine and solids: the way over a step is an arc in closed form. The audit sweeps its chord; the rest is its
//! bend. The steering of the command at the beginning of a step acts over its first half, that of the next command over
//! its second half. This makes the coupling second order, as for rigid bodies.

use super::{Plant, PlantError, StepPath};
use crate::vehicle::{Heading, Steering, Unicycle};
use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, Swarm, row, set_row};

/// Swarm of unicycles.
#[derive(Clone, Debug)]
pub struct Unicycles {
    unicycle: Unicycle,
    positions_m: Rows,
    headings: Vec<Heading>,
    /// Headings at the beginning of the last step, and its steering.
    began: Vec<(Heading, Steering)>,
    /// Length of a step whose second half is pending \[s\]; 0 for a completed state.
    moved_s: f64,
    /// Accelerations \[m/s^2\] held over the step.
    held: Rows,
}

impl Unicycles {
    /// Creates unicycles at the positions of a swarm, with headings along its velocities.
    #[must_use]
    pub fn new(unicycle: Unicycle, start: &Swarm) -> Self {
        let headings: Vec<_> = (0..start.count()).map(|i| Heading::of(row(&start.velocities_m_s, i))).collect();
        let began = headings.iter().map(|&heading| (heading, Steering::default())).collect();
        let positions_m = start.positions_m.clone();
        Self { unicycle, positions_m, headings, began, moved_s: 0.0, held: Rows::zeros(start.count()) }
    }
}

impl Plant for Unicycles {
    fn count(&self) -> usize {
        self.headings.len()
    }

    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, path: &mut StepPath) -> Result<(), PlantError> {
        for (i, heading) in self.headings.iter_mut().enumerate() {
            let by = self.unicycle.steering(*heading, row(&self.held, i), dt_s);
            let position_m = row(&self.positions_m, i) + heading.way_m(by, dt_s);
            path.raise_bend(heading.bend_m(by, dt_s));
            set_row(&mut self.positions_m, i, position_m);
            self.began[i] = (*heading, by);
            *heading = self.unicycle.after(*heading, by, dt_s);
        }
        self.moved_s = dt_s;
        self.observe(predicted);
        predicted.first_not_finite().map_or(Ok(()), |vehicle| Err(PlantError::NotFinite { vehicle }))
    }

    fn apply(&mut self, command: &Rows, state: &mut Swarm) {
        self.held.copy_from(command);
        if self.moved_s > 0.0 {
            let half_s = 0.5 * self.moved_s;
            for (i, heading) in self.headings.iter_mut().enumerate() {
                let (before, by) = self.began[i];
                let next = self.unicycle.steering(*heading, row(&self.held, i), self.moved_s);
                let between = self.unicycle.after(before, by, half_s);
                *heading = self.unicycle.after(between, next, half_s);
                set_row(&mut state.velocities_m_s, i, heading.velocity_m_s());
            }
            self.moved_s = 0.0;
        }
    }

    fn observe(&self, swarm: &mut Swarm) {
        swarm.positions_m.copy_from(&self.positions_m);
        for (i, heading) in self.headings.iter().enumerate() {
            set_row(&mut swarm.velocities_m_s, i, heading.velocity_m_s());
        }
    }

    fn restore(&mut self, swarm: &Swarm) {
        self.positions_m.copy_from(&swarm.positions_m);
        // Undoing a step restores the headings at its beginning, bit for bit.
        if self.moved_s > 0.0 {
            for (heading, (before, _)) in self.headings.iter_mut().zip(&self.began) {
                *heading = *before;
            }
        } else {
            for (i, heading) in self.headings.iter_mut().enumerate() {
                *heading = Heading::of(row(&swarm.velocities_m_s, i));
            }
        }
        self.moved_s = 0.0;
    }

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("heading", &["heading_rad", "speed_m_s"])]
    }

    fn write_channels(&self, channels: &mut [Channel]) {
        for channel in channels {
            channel.values.clear();
            channel.values.extend(self.headings.iter().flat_map(|heading| [heading.psi_rad, heading.speed_m_s]));
        }
    }
}
