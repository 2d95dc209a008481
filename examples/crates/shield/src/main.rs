//! Shields a policy that flies at its neighbours, behind a radio that loses two of three messages.

use std::error::Error;

use nalgebra::Vector3;
use tautline_shield::{Settings, Shield, Start, State};

/// Period of the controllers \[s\].
const PERIOD_S: f64 = 0.05;

/// Returns a command of 5 m/s^2 at the nearest other vehicle.
fn policy(own: usize, states: &[State]) -> Vector3<f64> {
    let others = states.iter().enumerate().filter(|(other, _)| *other != own);
    let apart = others.map(|(_, other)| other.position_m - states[own].position_m);
    let nearest = apart.min_by(|a, b| a.norm().total_cmp(&b.norm()));
    nearest.map_or_else(Vector3::zeros, |apart| apart.normalize() * 5.0)
}

fn main() -> Result<(), Box<dyn Error>> {
    // Own position is known to 2 cm; pushes stay below 0.2 m/s^2.
    let settings = Settings { position_error_m: 0.02, disturbance_m_s2: 0.2, ..Settings::new(1.0, PERIOD_S) };
    let limits = settings.limits()?;
    println!("{}", limits.certificate());

    let mut states = [0.0, 3.0, 6.0, 9.0].map(|x| State::at_rest(Vector3::new(x, 0.1 * x * x, 0.0)));
    // Each vehicle announces its own start as bytes.
    let announced = states.iter().map(|state| limits.start(*state).map(|start| start.to_bytes()));
    let announced = announced.collect::<Result<Vec<_>, _>>()?;
    let starts = announced.iter().map(|bytes| Start::from_bytes(bytes)).collect::<Result<Vec<_>, _>>()?;
    let shields = (0..states.len()).map(|own| Shield::new(&limits, own, &starts));
    let mut shields = shields.collect::<Result<Vec<_>, _>>()?;

    let (mut nearest_m, mut sent) = (f64::INFINITY, 0_u32);
    for _ in 0..400 {
        for own in 0..states.len() {
            let wanted = policy(own, &states);
            let command = shields[own].filter(states[own], wanted);
            for message in shields[own].messages().collect::<Vec<_>>() {
                sent += 1;
                if sent.is_multiple_of(3) {
                    shields[message.to as usize].hear(&message);
                }
            }
            // Your simulator or vehicle carries the command out over the period.
            states[own] = states[own].after(command, PERIOD_S);
        }
        for (own, state) in states.iter().enumerate() {
            let apart = states[own + 1..].iter().map(|other| (other.position_m - state.position_m).norm());
            nearest_m = apart.fold(nearest_m, f64::min);
        }
    }
    println!("closest {nearest_m:.3} m");
    for (own, shield) in shields.iter().enumerate() {
        let counters = shield.counters();
        // The others differ from the law's at most by the limits of the vehicle.
        let by_planes = (counters.changed - counters.limited) as f64 / counters.commands as f64;
        println!("vehicle {}: {:.0} % of commands changed by planes", own + 1, 100.0 * by_planes);
        if let Some(exceeded) = counters.exceeded() {
            println!("vehicle {}: {exceeded}", own + 1);
        }
    }
    Ok(())
}
