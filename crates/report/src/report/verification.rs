//! What changed when a flight was flown again at half the step.

use serde::{Deserialize, Serialize};

use tautline_core::text::{at_least, seconds};

/// The same flight with every step half as long, and what that changed.
///
/// What bounces hard off a barrier is chaotic: 10 to 20 of a hundred such flights end elsewhere however fine the step is. A
/// verdict that two steps agree on is called firm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verification {
    /// Longest step of the second flight \[s\].
    pub dt_s: f64,
    /// Whether the second flight passed.
    pub pass: bool,
    /// Smallest separation of the second flight \[m\].
    pub min_m: Option<f64>,
    /// When the second flight reached its formation \[s\].
    pub reached_at_s: Option<f64>,
    /// Whether both flights have the same verdict, and smallest separations that differ by at most 1 % of delta.
    pub firm: bool,
}

impl Verification {
    /// In one line.
    #[must_use]
    pub fn text(&self) -> String {
        let firm = if self.firm { "firm" } else { "NOT FIRM, what happens depends on the step" };
        let pass = if self.pass { "passes" } else { "does not pass" };
        let min_m = self.min_m.map_or("-".to_owned(), |min_m| at_least(min_m, 6));
        let reached =
            self.reached_at_s.map_or("not reached".to_owned(), |at_s| format!("reached at {}", seconds(at_s)));
        format!("{firm}: at half the step it {pass}, never closer than {min_m} m, formation {reached}")
    }
}
