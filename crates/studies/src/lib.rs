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
//! A study is an [`study::Experiment`], which holds its options and flies scenarios in a [`batch::Batch`], and its answer a
//! [`study::Study`], whose [`table::Table`]s are written as text, CSV, LaTeX, Parquet and a page.

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

use std::ops::RangeInclusive;

pub use base::Question;
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

/// Most runs of a comparison, and of each value of a margin or point of a sweep.
pub const MOST_RUNS: u64 = 1_000_000;
/// Seeds of a first run: up to the largest of a scenario file, less the most runs.
pub const SEEDS: RangeInclusive<u64> = 0..=i64::MAX as u64 - MOST_RUNS;
/// Threads that a study may use.
pub const THREADS: RangeInclusive<usize> = 1..=256;
