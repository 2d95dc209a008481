//! `tautline schema`: the JSON Schema of the scenario file.

use super::{Exit, console};
use tautline_report::request::Failure;
use tautline_sim::scenario;

pub(super) fn schema() -> Result<Exit, Failure> {
    console::json(&scenario::schema())?;
    Ok(Exit::Good)
}
