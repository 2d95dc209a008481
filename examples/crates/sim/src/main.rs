//! Flies a law of your own in a built-in scenario: damped springs to the slots, without repulsion.

use std::error::Error;

use tautline_sim::law::{Law, LawError};
use tautline_sim::observation::Observation;
use tautline_sim::scenario::{Scenario, Source};
use tautline_sim::sim::{Components, Simulation};
use tautline_sim::swarm::{Rows, row, set_row};

/// `u_i = -(p_i - h_i) - 2 v_i`
#[derive(Clone)]
struct Springs;

impl Law for Springs {
    fn name(&self) -> &'static str {
        "springs"
    }

    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        for i in 0..at.own.count() {
            let to_slot = row(&at.target.formation.slots_m, i) - row(&at.own.positions_m, i);
            set_row(command, i, to_slot - 2.0 * row(&at.own.velocities_m_s, i));
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::read(&Source::resolve("pentagon")?, &[])?;
    let mut simulation = Simulation::with(&scenario, Components::with_law(&scenario, Box::new(Springs)))?;
    while simulation.ending().is_none() {
        simulation.step();
    }
    let flight = simulation.finish();
    println!("{:?}: {:?}", flight.ending, flight.audit.status);
    Ok(())
}
