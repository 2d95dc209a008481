//! Flies a scenario to its report.

use std::error::Error;

use tautline_report::run::run;
use tautline_report::scenario::{Scenario, Source};

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::read(&Source::resolve("pentagon")?, &[])?;
    let report = run(&scenario, &mut ())?;
    println!("{}", report.headline());
    Ok(())
}
