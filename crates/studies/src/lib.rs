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

pub mod attack;
pub mod campaign;
pub mod compare;
pub mod margin;
pub mod splitting;
pub mod statistics;
