//! What a law is built from, and what its keys must be.

use crate::formation::Formation;
use crate::graph::Graph;

/// What a law is built from beside its own keys.
#[derive(Clone, Copy, Debug)]
pub struct Setting<'a> {
    /// Who talks to whom.
    pub links: &'a Graph,
    /// The formation of the first leg.
    pub formation: &'a Formation,
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Velocity coefficient a22 of the vehicles \[1/s\].
    pub a22_per_s: f64,
}

/// A number among a law's keys, and what it must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// Its key in the scenario, such as `law.alpha`.
    pub key: &'static str,
    /// What it is called in a sentence, such as `the gain f1`.
    pub name: &'static str,
    /// As given.
    pub value: f64,
    /// Whether it may be zero.
    pub may_be_zero: bool,
}

impl Gain {
    pub(super) fn positive(key: &'static str, name: &'static str, value: f64) -> Self {
        Self { key, name, value, may_be_zero: false }
    }

    pub(super) fn at_least_zero(key: &'static str, name: &'static str, value: f64) -> Self {
        Self { key, name, value, may_be_zero: true }
    }
}
