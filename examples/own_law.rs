//! A control law of your own, flown in Rapier and judged like the built-in ones.
//!
//! Each vehicle is pulled to its slot and pushed away from every other vehicle by 1/r^3, with damping. Nothing proves
//! that this law keeps vehicles apart; the audit says whether it did on this flight.
//!
//! Run with `cargo run --release --example own_law`.

use std::error::Error;
use std::ops::ControlFlow;

use tautline::formation::Formation;
use tautline::law::{Law, LawError};
use tautline::scenario::{Scenario, Source};
use tautline::swarm::{Rows, Swarm, row, set_row};
use tautline::{plant, sim};

/// `u_i = -(p_i - h_i) - 2 v_i + 4 sum_j (p_i - p_j) / |p_i - p_j|^4`
struct SpringsAndRepulsion {
    formation: Formation,
}

impl Law for SpringsAndRepulsion {
    fn name(&self) -> &'static str {
        "springs-and-repulsion"
    }

    fn control(&mut self, swarm: &Swarm, control: &mut Rows) -> Result<(), LawError> {
        for i in 0..swarm.count() {
            let position = row(&swarm.positions_m, i);
            let mut u = row(&self.formation.slots_m, i) - position - 2.0 * row(&swarm.velocities_m_s, i);
            for j in (0..swarm.count()).filter(|&j| j != i) {
                let away = position - row(&swarm.positions_m, j);
                u += 4.0 * away / away.norm_squared().powi(2);
            }
            set_row(control, i, u);
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::read(&Source::resolve("pentagon")?, &[])?;
    let mut law = SpringsAndRepulsion { formation: scenario.formation().clone() };
    let mut plant = plant::for_scenario(&scenario);
    let flight = sim::fly(&scenario, &mut law, plant.as_mut(), &mut (), &mut |_step| ControlFlow::Continue(()))?;
    println!("{}: {:?}", law.name(), flight.audit.status);
    if let Some(closest) = flight.audit.closest {
        println!("closest: vehicles {} at {:.3} m after {:.2} s", closest.pair, closest.separation_m, closest.time_s);
    }
    Ok(())
}
