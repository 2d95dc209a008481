//! What is shown of each law, as people read it.

use super::result::LawRow;
use crate::statistics::{Estimate, Proportion};
use tautline_core::text::{at_least, significant};

/// Significant digits of an estimate.
const DIGITS: u8 = 4;
/// Significant digits of a share in percent.
const PERCENT_DIGITS: u8 = 3;
/// What is shown where nothing is known.
const NOTHING: &str = "-";

/// One number of each law.
pub(super) struct Measure {
    /// What it is, in a few words.
    pub(super) name: &'static str,
    /// Its unit; none for a count.
    pub(super) unit: &'static str,
    /// The number of one law.
    pub(super) cell: fn(&LawRow) -> Cell,
}

/// A number and its interval.
pub(super) struct Cell {
    pub(super) value: String,
    pub(super) interval: Option<String>,
}

/// How flights ended.
pub(super) const OUTCOMES: [Measure; 6] = [
    Measure { name: "proved clear", unit: "%", cell: |law| share(&law.clear) },
    Measure { name: "violated", unit: "%", cell: |law| share(&law.violated) },
    Measure { name: "undecided", unit: "", cell: |law| count(law.undecided) },
    Measure { name: "ended early", unit: "", cell: |law| count(law.ended_early) },
    Measure { name: "refused by check", unit: "", cell: |law| count(law.refused) },
    Measure { name: "reached", unit: "%", cell: |law| share(&law.reached) },
];

/// How soon the formation was reached, and how near two vehicles came.
pub(super) const ARRIVALS: [Measure; 4] = [
    Measure { name: "time to reach, median", unit: "s", cell: |law| estimate(&law.reached_median_s) },
    Measure { name: "time to reach, 95 %", unit: "s", cell: |law| estimate(&law.reached_p95_s) },
    Measure { name: "separation, smallest", unit: "m", cell: |law| smallest(law.min_smallest_m) },
    Measure { name: "separation, median", unit: "m", cell: |law| estimate(&law.min_median_m) },
];

/// What it cost.
pub(super) const COSTS: [Measure; 4] = [
    Measure { name: "path length, mean", unit: "m", cell: |law| estimate(&law.path_length_mean_m) },
    Measure { name: "peak control, largest", unit: "m/s^2", cell: |law| plain(law.peak_control_largest_m_s2) },
    Measure { name: "peak control, median", unit: "m/s^2", cell: |law| estimate(&law.peak_control_median_m_s2) },
    Measure { name: "total control, mean", unit: "m/s", cell: |law| estimate(&law.total_control_mean_m_s) },
];

fn shown(number: Option<f64>, digits: u8) -> String {
    match number {
        None => NOTHING.to_owned(),
        Some(0.0) => "0".to_owned(),
        Some(number) => significant(number, digits),
    }
}

fn interval(low: Option<f64>, high: Option<f64>, digits: u8) -> Option<String> {
    let is_known = low.is_some() || high.is_some();
    is_known.then(|| format!("[{}, {}]", shown(low, digits), shown(high, digits)))
}

fn share(share: &Proportion) -> Cell {
    let percent = |share: f64| Some(100.0 * share);
    Cell {
        value: shown(share.share.and_then(percent), PERCENT_DIGITS),
        interval: share.share.and_then(|_| interval(percent(share.low), percent(share.high), PERCENT_DIGITS)),
    }
}

fn estimate(estimate: &Estimate) -> Cell {
    Cell { value: shown(estimate.value, DIGITS), interval: interval(estimate.low, estimate.high, DIGITS) }
}

fn count(count: u64) -> Cell {
    Cell { value: count.to_string(), interval: None }
}

fn plain(number: Option<f64>) -> Cell {
    Cell { value: shown(number, DIGITS), interval: None }
}

/// Rounded down: nothing came closer than what is shown.
fn smallest(number: Option<f64>) -> Cell {
    Cell { value: number.map_or_else(|| NOTHING.to_owned(), |number| at_least(number, 3)), interval: None }
}
