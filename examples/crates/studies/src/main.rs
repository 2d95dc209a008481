//! Compares two laws from the same starts.

use std::error::Error;

use tautline_studies::compare::Options;
use tautline_studies::request::{ScenarioRequest, Silent};
use tautline_studies::{Study as _, StudyRequest, answer};

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = ScenarioRequest::named("pentagon", &["time.duration_s=30".to_owned()])?;
    let laws = Some(["edge-tension", "laplacian"].map(str::to_owned).into());
    let options = Options { laws, runs: 4, ..Options::default() };
    match answer(&StudyRequest::new(scenario, options), &(), &Silent::default())? {
        Some(comparison) => println!("{}", comparison.text()),
        None => println!("interrupted"),
    }
    Ok(())
}
