//! Findings on limits of single vehicles, such as speed.

use serde::Serialize;

use super::report::VehicleFinding;
use crate::report::answer::{Answer, Enclosure, Finding, FindingList, Part};
use tautline_audit::envelope::{Corner, Exceedance, Limit, LimitOutcome};
use tautline_audit::recorded::Outcome;
use tautline_audit::{Status, Tally};
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::text::{at_least, at_most, exact, fixed, seconds};

/// Findings on one limit of each vehicle by itself.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LimitFindings {
    /// Limited quantity with its unit, such as `speed_m_s`.
    pub quantity: &'static str,
    /// Limit: an upper bound, but a lower bound for `floor_m` and `fence_margin_m`.
    pub allowed: f64,
    /// Status of the limit.
    pub status: Status,
    /// Value closest to the limit or farthest beyond it; null if no value is known.
    pub extreme: Option<VehicleFinding<Exceedance>>,
    /// Corners of curves, where the velocity jumps and the limit is not applied; null without corners.
    pub corners: Option<CornerFindings>,
    /// Number of violations, and how many are listed.
    pub violations_tally: Tally,
    /// Number of undecided times, and how many are listed.
    pub undecided_tally: Tally,
    /// Violations; of a long list the worst, and the first of each vehicle.
    pub violations: Vec<VehicleFinding<Exceedance>>,
    /// Undecided times, cut in the same way.
    pub undecided: Vec<VehicleFinding<Exceedance>>,
    /// Vehicles for which the quantity is unknown.
    pub unknown: Vec<String>,
    limit: Limit,
}

/// Corners of curves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CornerFindings {
    /// Number of corners of all vehicles.
    pub count: u64,
    /// Corner with the largest jump of the velocity.
    pub largest: VehicleFinding<Corner>,
}

impl CornerFindings {
    /// Returns the assumption of a clear verdict about corners.
    pub(super) fn fact(&self) -> Fact {
        let VehicleFinding { vehicle, finding } = &self.largest;
        Fact::number(FactKind::RoundedCorners, Source::Default, finding.by_m_s, "m/s").about(vehicle)
    }
}

impl LimitFindings {
    pub(super) fn new(found: &LimitOutcome, outcome: &Outcome) -> Self {
        let named = |of: &Exceedance| VehicleFinding::new(outcome, of.vehicle, *of);
        let largest = |of: Corner| VehicleFinding::new(outcome, of.vehicle, of);
        let corners = found.corners.map(|of| CornerFindings { count: of.count, largest: largest(of.largest) });
        Self {
            quantity: found.limit.quantity.key(),
            allowed: found.limit.allowed,
            status: found.status,
            extreme: found.extreme.as_ref().map(named),
            corners,
            violations_tally: found.violations_tally,
            undecided_tally: found.undecided_tally,
            violations: found.violations.iter().map(named).collect(),
            undecided: found.undecided.iter().map(named).collect(),
            unknown: found.unknown.iter().map(|&vehicle| outcome.name(vehicle)).collect(),
            limit: found.limit,
        }
    }

    /// Returns the answer on the limit.
    pub(super) fn answer(&self) -> Answer {
        let finding = |VehicleFinding { vehicle, finding }: &VehicleFinding<Exceedance>| Finding {
            subjects: vec![vehicle.clone()],
            from_s: Some(finding.from_s),
            to_s: Some(finding.to_s),
            at_s: Some(finding.at_s),
            value: Enclosure::new(finding.lower, finding.upper, self.unit()),
            limit: Some(self.allowed),
            rate_hz: None,
        };
        let unknown = self.unknown.iter().map(|vehicle| Finding {
            subjects: vec![vehicle.clone()],
            from_s: None,
            to_s: None,
            at_s: None,
            value: Enclosure { lower: None, upper: None, unit: self.unit() },
            limit: Some(self.allowed),
            rate_hz: None,
        });
        let undecided: Vec<_> = self.undecided.iter().map(finding).chain(unknown).collect();
        let undecided_tally =
            Tally { count: self.undecided_tally.count + self.unknown.len() as u64, ..self.undecided_tally };
        Answer {
            closest: self.extreme.iter().map(finding).collect(),
            violations: FindingList::new(self.violations_tally, self.violations.iter().map(finding).collect()),
            undecided: FindingList::new(undecided_tally, undecided),
            ..Answer::new(Part::Limit(self.quantity), self.status)
        }
    }

    /// Returns the limited quantity in words.
    fn quantity_name(&self) -> &'static str {
        use tautline_audit::envelope::Quantity;
        match self.limit.quantity {
            Quantity::Speed => "speed",
            Quantity::HorizontalSpeed => "horizontal speed",
            Quantity::Climb => "climb",
            Quantity::Descent => "descent",
            Quantity::Acceleration => "acceleration",
            Quantity::Height => "height",
            Quantity::Floor => "lowest height",
            Quantity::NavigationFloor => "height in horizontal motion",
            Quantity::YawRate => "yaw rate",
            Quantity::Fence => "room to the fence",
        }
    }

    fn unit(&self) -> &'static str {
        self.limit.quantity.unit()
    }

    /// Formats the value of an extreme or of a violation, rounded so that the statement holds.
    fn value(&self, of: &Exceedance) -> String {
        let (lower, upper) = (of.lower, of.upper);
        let number = match (lower.is_finite(), upper.is_finite()) {
            (false, false) => return "not known".to_owned(),
            (true, false) => format!("at least {}", at_least(lower, 3)),
            (false, true) => format!("at most {}", at_most(upper, 3)),
            (true, true) if upper - lower <= 1e-6 * upper.abs().max(1.0) => self.distinct_from_limit(upper),
            (true, true) => format!("{} to {}", at_least(lower, 3), at_most(upper, 3)),
        };
        format!("{number} {}", self.unit())
    }

    /// Formats a value with at least three decimals, and with enough to differ from the limit.
    fn distinct_from_limit(&self, value: f64) -> String {
        let size = |number: f64, decimals: usize| fixed(number, decimals).trim_start_matches('-').to_owned();
        let is_distinct = |&decimals: &usize| size(value, decimals) != size(self.allowed, decimals);
        let decimals = if value == self.allowed { 3 } else { (3..=17).find(is_distinct).unwrap_or(3) };
        fixed(value, decimals)
    }

    fn limit_in_words(&self) -> String {
        let least = if self.limit.quantity.is_least() { "at least " } else { "" };
        format!("{least}{} {}", exact(self.allowed), self.unit())
    }

    /// Returns the finding in a few words, such as `speed at most 3.200 m/s (limit 5.000 m/s)`.
    #[must_use]
    pub fn brief(&self) -> String {
        self.brief_as(self.status)
    }

    /// Returns the finding in the words of a status.
    pub(super) fn brief_as(&self, status: Status) -> String {
        let quantity = self.quantity_name();
        match status {
            Status::Clear => {
                let least = self.limit.quantity.is_least();
                let most = self.extreme.as_ref().map_or(String::new(), |of| {
                    let bound = if least { at_least(of.finding.lower, 3) } else { at_most(of.finding.upper, 3) };
                    // A clear value that rounding moves beyond the limit is shown as the limit.
                    let is_beyond = bound
                        .parse()
                        .is_ok_and(|shown: f64| if least { shown < self.allowed } else { shown > self.allowed });
                    let bound = if is_beyond { exact(self.allowed) } else { bound };
                    format!(" {} {bound} {}", if least { "at least" } else { "at most" }, self.unit())
                });
                format!("{quantity}{most} (limit {})", self.limit_in_words())
            }
            Status::Violation => {
                let worst = self.extreme.iter().map(|of| {
                    let at = seconds(of.finding.at_s);
                    format!(" of {} was {} at {at}", of.vehicle, self.value(&of.finding))
                });
                format!("{quantity}{} (limit {})", worst.collect::<String>(), self.limit_in_words())
            }
            Status::Undecided => {
                let why = match (&self.undecided[..], &self.unknown[..]) {
                    ([of, ..], _) => {
                        format!("{} of {} by {}", self.value(&of.finding), of.vehicle, seconds(of.finding.to_s))
                    }
                    ([], [vehicle, ..]) => format!("unknown for {vehicle}"),
                    ([], []) => "unknown at times".to_owned(),
                };
                format!("{quantity} {why} (limit {})", self.limit_in_words())
            }
        }
    }

    /// Returns the violations, a sentence each.
    pub(super) fn violations_in_words(&self) -> impl Iterator<Item = String> + '_ {
        self.violations.iter().map(|of| self.words(of, "beyond"))
    }

    /// Returns the undecided times, a sentence each.
    pub(super) fn undecided_in_words(&self) -> impl Iterator<Item = String> + '_ {
        let unknown =
            self.unknown.iter().map(|vehicle| format!("{vehicle}: its {} is not known", self.quantity_name()));
        self.undecided.iter().map(|of| self.words(of, "against")).chain(unknown)
    }

    /// Returns a violation or an undecided time in a sentence.
    pub(super) fn in_words(&self, of: &VehicleFinding<Exceedance>, is_violation: bool) -> String {
        self.words(of, if is_violation { "beyond" } else { "against" })
    }

    /// Returns a violation or an undecided time in a few words.
    pub(super) fn in_short(&self, VehicleFinding { vehicle, finding }: &VehicleFinding<Exceedance>) -> String {
        format!("{vehicle}: {} {} (limit {})", self.quantity_name(), self.value(finding), self.limit_in_words())
    }

    fn words(&self, VehicleFinding { vehicle, finding }: &VehicleFinding<Exceedance>, how: &str) -> String {
        format!(
            "{vehicle}: {} {} by {} s, {how} the limit of {} from {} s to {} s",
            self.quantity_name(),
            self.value(finding),
            fixed(finding.at_s, 3),
            self.limit_in_words(),
            fixed(finding.from_s, 3),
            fixed(finding.to_s, 3)
        )
    }

    /// Returns the row of a table: quantity, extreme, vehicle, time, limit, status.
    pub(super) fn row(&self) -> [String; 6] {
        let of = self.extreme.as_ref();
        [
            self.quantity_name().to_owned(),
            of.map_or("not known".to_owned(), |of| self.value(&of.finding)),
            of.map_or(String::new(), |of| of.vehicle.clone()),
            of.map_or(String::new(), |of| fixed(of.finding.at_s, 3)),
            self.limit_in_words(),
            match self.status {
                Status::Clear => "kept",
                Status::Violation => "exceeded",
                Status::Undecided => "undecided",
            }
            .to_owned(),
        ]
    }
}
