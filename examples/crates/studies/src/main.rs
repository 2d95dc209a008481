//! Compares two laws from the same starts.

use std::error::Error;

use tautline_studies::compare::{CompareRequest, compare};
use tautline_studies::request::{ScenarioRequest, Silent};

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = ScenarioRequest::named("pentagon", &["time.duration_s=30".to_owned()])?;
    let laws = Some(["edge-tension", "laplacian"].map(str::to_owned).into());
    let request = CompareRequest { laws, runs: 4, ..CompareRequest::new(scenario) };
    match compare(&request, &(), &Silent::default())? {
        Some(comparison) => println!("{}", comparison.text()),
        None => println!("interrupted"),
    }
    Ok(())
}
