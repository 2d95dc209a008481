//! Flights and their reports.

#[path = "../../../sim/tests/flights/flight.rs"]
mod flight;
#[path = "../../../sim/tests/flights/numbers.rs"]
#[expect(dead_code, reason = "tests of the simulation need more kinds of numbers")]
mod numbers;

mod missions;
mod random_scenarios;
mod recorded;
mod requests;
mod rivals;
mod steps;
mod verdicts;
