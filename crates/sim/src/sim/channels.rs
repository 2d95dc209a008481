//! What is recorded of vehicles and link beside states and commands.

use crate::link::Imperfections;
use crate::plant::Plant;
use tautline_core::record::Channel;

/// The channels of a flight, vehicles' before link's, in memory that is used again for each sample.
#[derive(Clone)]
pub(super) struct Channels {
    all: Vec<Channel>,
    /// How many of them are the vehicles'.
    vehicles: usize,
}

impl Channels {
    pub(super) fn of(plant: &dyn Plant, link: &dyn Imperfections) -> Self {
        let mut all = plant.channels();
        let vehicles = all.len();
        all.extend(link.channels());
        Self { all, vehicles }
    }

    /// Takes the present values.
    pub(super) fn write(&mut self, plant: &dyn Plant, link: &dyn Imperfections) {
        let (vehicles, links) = self.all.split_at_mut(self.vehicles);
        plant.write_channels(vehicles);
        link.write_channels(links);
    }

    pub(super) fn all(&self) -> &[Channel] {
        &self.all
    }
}
