//! Audits your own positions, step by step.

use std::error::Error;

use tautline_audit::Auditor;
use tautline_audit::swarm::Rows;

fn main() -> Result<(), Box<dyn Error>> {
    // Two vehicles head-on past each other in one second: 10 m apart at both ends, 1 m apart in between.
    let mut auditor = Auditor::new(2, 2.0)?;
    auditor.start(0.0, &Rows::from_row_slice(&[-5.0, 0.0, 0.0, 5.0, 1.0, 0.0]))?;
    auditor.step(1.0, &Rows::from_row_slice(&[5.0, 0.0, 0.0, -5.0, 1.0, 0.0]))?;
    let audit = auditor.finish();
    println!("{:?}", audit.status);
    if let Some(closest) = audit.closest {
        println!("vehicles {} at {} m after {} s", closest.pair, closest.separation_m, closest.time_s);
    }
    Ok(())
}
