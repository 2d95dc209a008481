//! Tests of the audit of flights and of recordings.

mod curves_at_limits;
mod cylinders;
mod encounters;
mod envelope;
mod exact;
mod findings;
mod flown;
#[path = "../../src/fractions.rs"]
mod fractions;
mod many_findings;
mod plan;
mod plans;
mod presence;
mod recorded;
mod recorded_curves;
mod scenes;
mod times;
mod well_clear;
