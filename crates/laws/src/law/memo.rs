//! The potential energy that was found on the way to a command.

use tautline_core::swarm::Rows;

/// The potential part of an energy at the positions that a law was asked about last: found while it made its command, and
/// wanted again for the energy of the same instant.
#[derive(Clone, Debug)]
pub(super) struct Memo {
    positions_m: Rows,
    potential: Option<f64>,
}

impl Memo {
    /// Nothing is known yet about so many vehicles.
    pub(super) fn new(count: usize) -> Self {
        Self { positions_m: Rows::zeros(count), potential: None }
    }

    /// Keeps the potential of these positions, as many as [`Memo::new`] was told.
    pub(super) fn keep(&mut self, positions_m: &Rows, potential: f64) {
        self.positions_m.as_mut_slice().copy_from_slice(positions_m.as_slice());
        self.potential = Some(potential);
    }

    pub(super) fn forget(&mut self) {
        self.potential = None;
    }

    /// The potential of these very positions, where it is known.
    pub(super) fn of(&self, positions_m: &Rows) -> Option<f64> {
        self.potential.filter(|_| self.positions_m.as_slice() == positions_m.as_slice())
    }
}
