//! A control law of your own, flown in Rapier and audited like the built-in laws.
//!
//! Damped springs pull each vehicle to its slot, and all other vehicles repel it by 1/r^3. The law has no certificate;
//! the audit shows whether it kept vehicles apart on this flight.
//!
//! Run with `cargo run --release --example own_law`.

use std::error::Error;
use std::ops::ControlFlow;

use tautline::law::{Law, LawError};
use tautline::observation::Observation;
use tautline::scenario::{Scenario, Source};
use tautline::sim::{self, Components};
use tautline::swarm::{Rows, row, set_row};

/// `u_i = -(p_i - h_i) - 2 v_i + 4 sum_j (p_i - p_j) / |p_i - p_j|^4`
#[derive(Clone)]
struct SpringsAndRepulsion;

impl Law for SpringsAndRepulsion {
    fn name(&self) -> &'static str {
        "springs-and-repulsion"
    }

    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        for i in 0..at.own.count() {
            let position = row(&at.own.positions_m, i);
            let mut u = row(&at.target.formation.slots_m, i) - position - 2.0 * row(&at.own.velocities_m_s, i);
            for j in (0..at.own.count()).filter(|&j| j != i) {
                let away = position - at.sensed(i, j).position_m;
                u += 4.0 * away / away.norm_squared().powi(2);
            }
            set_row(command, i, u);
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::read(&Source::resolve("pentagon")?, &[])?;
    let parts = Components::with_law(&scenario, Box::new(SpringsAndRepulsion));
    let flight = sim::fly(&scenario, parts, &mut (), &mut |_step| ControlFlow::Continue(()))?;
    println!("{}: {:?}", flight.law, flight.audit.status);
    if let Some(closest) = flight.audit.closest {
        println!("closest: vehicles {} at {:.3} m after {:.2} s", closest.pair, closest.separation_m, closest.time_s);
    }
    Ok(())
}
