//! Studies of many flights: comparisons, margins, sweeps, attacks, campaigns, rare events.
//!
//! | module | answers |
//! | --- | --- |
//! | [`compare`] | laws side by side from the same starts, a row of numbers each |
//! | [`margin`] | how much of one key a verdict survives, by bisection |
//! | [`sweep`] | shares and separations over a grid of one or two keys |
//! | [`attack`] | the worst start, wind or loss within bounds: CMA-ES over the smallest separation |
//! | [`campaign`] | many flights in shards, merged into one answer with intervals |
//! | [`splitting`] | the probability of rare events by adaptive multilevel splitting |
//! | [`statistics`] | shares, means, quantiles and differences of pairs with 95 % intervals |
//!
//! An [`study::Experiment`] holds the options of a study and flies its scenarios in a [`batch::Batch`]. The answer is a
//! [`study::Study`], whose [`table::Table`]s are written as text, CSV, LaTeX, Parquet and a page.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

use std::ops::RangeInclusive;

pub use base::Criterion;
pub use batch::Batch;
pub use flight::{FlightSummary, Outcome};
pub use study::{Experiment, SCHEMA_VERSION, Study, StudyFiles, StudyRequest, answer};
pub use tautline_report::request;

pub mod attack;
pub mod base;
pub mod batch;
pub mod campaign;
pub mod compare;
pub mod flight;
pub mod margin;
pub mod splitting;
pub mod statistics;
pub mod study;
pub mod sweep;
pub mod table;
#[cfg(test)]
mod tests;

/// Largest number of runs of a comparison, of each value of a margin, and of each point of a sweep.
pub const MOST_RUNS: u64 = 1_000_000;
/// Admitted seeds of a first run: the largest seed of a scenario file, less the largest number of runs, is the last.
pub const SEEDS: RangeInclusive<u64> = 0..=i64::MAX as u64 - MOST_RUNS;
/// Admitted numbers of threads.
pub const THREADS: RangeInclusive<usize> = 1..=256;

/// Parses `KEY=FROM..TO`, two values of a key.
///
/// # Errors
/// The reason, if the text has another form or a value is not a number.
pub fn key_range(text: &str) -> Result<(String, [f64; 2]), String> {
    let parts = text.split_once('=').and_then(|(key, range)| Some((key.trim(), range.split_once("..")?)));
    let Some((key, (from, to))) = parts else { return Err("is not KEY=FROM..TO".to_owned()) };
    if to.starts_with('.') {
        return Err("has more than two points".to_owned());
    }
    let number = |end: &str| end.trim().parse().map_err(|_| format!("`{}` is not a number", end.trim()));
    Ok((key.to_owned(), [number(from)?, number(to)?]))
}
