//! What became of messages.

use serde::{Deserialize, Serialize};

/// What became of the messages of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Network {
    /// Messages, one for each who may hear it.
    pub sent: u64,
    /// Those of them that never arrived.
    pub lost: u64,
    /// The age that 95 % of what vehicles held of each other did not exceed, looked at whenever messages were sent, to a
    /// hundredth \[s\].
    pub age_p95_s: Option<f64>,
}

impl Network {
    /// In one line.
    pub(super) fn line(&self) -> String {
        let share = 100.0 * self.lost as f64 / self.sent.max(1) as f64;
        let age = self
            .age_p95_s
            .map_or_else(String::new, |age_s| format!("; 95 % of what was held was no older than {age_s:.3} s"));
        format!("{} of {} messages lost ({share:.1} %){age}", self.lost, self.sent)
    }
}
