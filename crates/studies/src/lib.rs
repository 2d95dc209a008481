//! Studies of many flights: comparisons, margins, attacks, campaigns, rare events.
//!
//! | module | answers |
//! | --- | --- |
//! | [`compare`] | laws side by side from the same starts, a row of numbers each |
//! | [`margin`] | how much of one key a verdict survives, by bisection |
//! | [`attack`] | the worst start, wind or loss within bounds: CMA-ES over the smallest separation |
//! | [`campaign`] | many flights in shards, merged into one answer with intervals |
//! | [`splitting`] | the probability of rare events by adaptive multilevel splitting |
//! | [`statistics`] | shares, means, quantiles and differences of pairs with 95 % intervals |

#![deny(clippy::print_stdout, clippy::print_stderr, clippy::dbg_macro)]

use std::error::Error;
use std::ops::RangeInclusive;

pub use tautline_report::request;
use tautline_report::request::outputs::{Called, is_standard_output};
use tautline_report::request::{Failure, Monitor, in_range};

pub mod attack;
pub mod campaign;
pub mod compare;
pub mod margin;
pub mod splitting;
pub mod statistics;

/// Most runs of a comparison, and of each value of a margin.
pub const MOST_RUNS: u64 = 1_000_000;
/// Seeds of a first run: the last that a scenario file can say, less the most runs.
pub const SEEDS: RangeInclusive<u64> = 0..=i64::MAX as u64 - MOST_RUNS;
/// Threads that a study may use.
pub const THREADS: RangeInclusive<usize> = 1..=256;

/// The number of threads that is given, or one a core.
fn threads(given: Option<usize>) -> Result<usize, Failure> {
    match given {
        Some(number) => in_range("--threads", &number, &THREADS).map(|()| number),
        None => Ok(rayon::current_num_threads().min(*THREADS.end())),
    }
}

/// The failure where a result cannot be put into a file.
fn not_written(error: &dyn Error) -> Failure {
    Failure::machine("files/cannot-write", format!("cannot write the result: {error}"))
}

/// Names the files that were written.
fn wrote<'a>(outputs: impl Iterator<Item = Called<'a>>, monitor: &dyn Monitor) {
    for (_, file) in outputs.filter(|(_, file)| !is_standard_output(file)) {
        monitor.say(&format!("wrote {}", file.display()));
    }
}
