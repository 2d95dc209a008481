//! `tautline schema`: the JSON Schema of the scenario file.

use super::console;
use super::{Exit, Failure};
use crate::scenario;

pub(super) fn schema() -> Result<Exit, Failure> {
    console::data(&format!("{:#}\n", scenario::schema()))?;
    Ok(Exit::Good)
}
