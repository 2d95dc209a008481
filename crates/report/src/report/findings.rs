//! Answers and their findings in words, and as moments of a replay.

use super::answer::{Answer, Finding, FindingList, Objects, Part, PublishedPlan};
use super::section::Section;
use crate::replay::{Kind, LONGEST_NAME, Moment, Span, cut};
use tautline_audit::envelope::{Limit, Quantity};
use tautline_audit::recorded::WIDTH_M;
use tautline_audit::{ObjectPair, Status, Tally, WellClear};
use tautline_core::text::{at_least, at_most, beside_limit, exact, fixed, seconds};

impl Answer {
    /// Returns the answer on a limit or on well clear in the words of a status, such as `speed at most 3.200 m/s (limit
    /// 5.000 m/s)`.
    pub(super) fn brief_as(&self, status: Status) -> String {
        match self.part {
            Part::Limit(limit) => self.brief_on_limit(limit, status),
            Part::WellClear(limits) => self.brief_on_well_clear(limits, status),
            Part::PublishedPlans | Part::FlownPlans => self.brief_on_plans(status),
            Part::Separation | Part::Presence | Part::Plan => String::new(),
        }
    }

    fn brief_on_limit(&self, limit: Limit, status: Status) -> String {
        let (quantity, allowed) = (quantity(limit.quantity), limit_in_words(limit));
        let extreme = self.closest.first();
        match status {
            Status::Clear => {
                let least = limit.quantity.is_least();
                let most = extreme.map_or(String::new(), |finding| {
                    let value = finding.value;
                    let bound = if least { at_least(value.lower_bound(), 3) } else { at_most(value.upper_bound(), 3) };
                    // A clear value that rounding moves beyond the limit is shown as the limit.
                    let is_beyond = bound
                        .parse()
                        .is_ok_and(|shown: f64| if least { shown < limit.allowed } else { shown > limit.allowed });
                    let bound = if is_beyond { exact(limit.allowed) } else { bound };
                    format!(" {} {bound} {}", if least { "at least" } else { "at most" }, value.unit)
                });
                format!("{quantity}{most} (limit {allowed})")
            }
            Status::Violation => {
                let worst = extreme.map_or(String::new(), |finding| {
                    let time = finding.at_s.map_or(String::new(), |at_s| format!(" at {}", seconds(at_s)));
                    format!(" of {} was {}{time}", finding.names(), finding.shown_value(limit))
                });
                format!("{quantity}{worst} (limit {allowed})")
            }
            Status::Undecided => {
                let why = match self.undecided.listed.first() {
                    Some(finding) => match finding.to_s {
                        Some(to_s) => {
                            format!("{} of {} by {}", finding.shown_value(limit), finding.names(), seconds(to_s))
                        }
                        None => format!("unknown for {}", finding.names()),
                    },
                    None => "unknown at times".to_owned(),
                };
                format!("{quantity} {why} (limit {allowed})")
            }
        }
    }

    fn brief_on_well_clear(&self, WellClear { horizontal_m, vertical_m, tau_s }: WellClear, status: Status) -> String {
        let tau = if tau_s > 0.0 { format!(", tau {} s", exact(tau_s)) } else { String::new() };
        let thresholds = format!("{} m, {} m high{tau}", exact(horizontal_m), exact(vertical_m));
        match status {
            Status::Clear => format!("well clear ({thresholds})"),
            Status::Violation => {
                let others = match self.violations.count {
                    ..=1 => String::new(),
                    count => format!("; {count} losses in all"),
                };
                self.closest
                    .first()
                    .map_or(String::new(), |finding| format!("{} ({thresholds}){others}", finding.loss("are not")))
            }
            Status::Undecided => match self.undecided.listed.first() {
                Some(finding) => format!("{} ({thresholds})", finding.loss("may not be")),
                None => format!("well clear is unknown at times ({thresholds})"),
            },
        }
    }

    fn brief_on_plans(&self, status: Status) -> String {
        let is_flown = self.part == Part::FlownPlans;
        match status {
            Status::Clear => {
                let closest = self.closest.first().map_or(String::new(), |finding| {
                    let limit = finding.limit.unwrap_or_default();
                    let least = beside_limit(finding.value.lower_bound(), limit, 6);
                    let time = finding.at_s.map_or(String::new(), |at_s| format!(" at {}", seconds(at_s)));
                    format!(" closer than {least} {}, {}{time}", finding.value.unit, finding.names())
                });
                let plans = if is_flown { "plans and flights" } else { "published plans" };
                format!("{plans} never come{closest}")
            }
            Status::Violation => {
                let deepest =
                    self.violations.listed.iter().min_by(|a, b| a.largest_margin().total_cmp(&b.largest_margin()));
                let others = match self.violations.count {
                    ..=1 => String::new(),
                    count if is_flown => format!("; {count} violations of plans and flights in all"),
                    count => format!("; {count} violations of plans in all"),
                };
                deepest.map_or(String::new(), |finding| {
                    let time = finding.at_s.map_or(String::new(), |at_s| format!(" at {}", seconds(at_s)));
                    format!("{} come to {}{time}{others}", finding.names(), finding.too_close())
                })
            }
            Status::Undecided => match self.undecided.listed.first() {
                Some(finding) => finding.sentence(self.part, false),
                None if is_flown => {
                    "flights have gaps or do not begin at their plans, or no plan is flown beside another flight"
                        .to_owned()
                }
                None => "no two published plans are known at the same time".to_owned(),
            },
        }
    }

    /// Returns the row of a limit in a table: quantity, extreme, vehicle, time, limit, status.
    pub(super) fn row(&self, limit: Limit) -> [String; 6] {
        let extreme = self.closest.first();
        [
            quantity(limit.quantity).to_owned(),
            extreme.map_or("not known".to_owned(), |finding| finding.shown_value(limit)),
            extreme.map_or(String::new(), Finding::names),
            extreme.and_then(|finding| finding.at_s).map_or(String::new(), |at_s| fixed(at_s, 3)),
            limit_in_words(limit),
            match self.status {
                Status::Clear => "kept",
                Status::Violation => "exceeded",
                Status::Undecided => "undecided",
            }
            .to_owned(),
        ]
    }

    /// Returns the closest approach as a moment of a replay.
    fn closest_moment(&self) -> Option<Moment> {
        let finding = self.closest.first().filter(|_| self.part == Part::Separation)?.short();
        let at_s = finding.at_s.unwrap_or_default();
        let distance =
            interval(finding.value.lower_bound(), finding.value.upper_bound(), finding.limit.unwrap_or_default());
        let said =
            format!("Closest approach: {distance} {}, {} at {} s", finding.value.unit, finding.names(), fixed(at_s, 3));
        Some(finding.moment(Kind::Closest, Span { from_s: at_s, to_s: at_s, at_s }, String::new(), said))
    }

    /// Returns the violations as moments of a replay. Those of separations begin with the deepest.
    fn violation_moments(&self) -> Vec<Moment> {
        let mut listed: Vec<_> = self.violations.listed.iter().map(Finding::short).collect();
        if self.part == Part::Separation {
            listed.sort_by(|a, b| a.largest_margin().total_cmp(&b.largest_margin()));
        }
        let moment = |finding: &Finding| {
            let (brief, said) = match self.part {
                Part::Separation => {
                    let come = finding.too_close();
                    let time = finding.at_s.map_or(String::new(), |at_s| format!(" at {} s", fixed(at_s, 3)));
                    let said = format!(
                        "Violation: {} came to {come}{time}, below it from {}",
                        finding.names(),
                        span(finding.from_s.unwrap_or_default(), finding.to_s.unwrap_or_default())
                    );
                    (format!("{} come to {come}", finding.names()), said)
                }
                part => (finding.brief(part, true), finding.said(part, true)),
            };
            finding.moment(Kind::Violation, finding.span(), brief, said)
        };
        listed.iter().map(moment).collect()
    }

    /// Returns the undecided times as moments of a replay.
    fn undecided_moments(&self) -> Vec<Moment> {
        let timed = self.undecided.listed.iter().filter(|finding| finding.from_s.is_some()).map(Finding::short);
        let moment = |finding: Finding| {
            let (brief, said) = (finding.brief(self.part, false), finding.said(self.part, false));
            finding.moment(Kind::Undecided, finding.span(), brief, said)
        };
        timed.map(moment).collect()
    }
}

/// Returns the closest approach, the violations and the undecided times, the gravest first. Distances and times are
/// those of the audit. Findings on plans are left out, because a replay shows the flight.
pub(super) fn moments(answers: &[Answer]) -> impl Iterator<Item = Moment> + '_ {
    let is_of_plan = |answer: &&Answer| matches!(answer.part, Part::Plan | Part::PublishedPlans | Part::FlownPlans);
    let answers = answers.iter().filter(move |answer| !is_of_plan(answer));
    let violations = answers.clone().flat_map(Answer::violation_moments);
    let undecided = answers.clone().flat_map(Answer::undecided_moments);
    answers.filter_map(Answer::closest_moment).chain(violations).chain(undecided)
}

/// Returns the closest approaches of vehicles, or of vehicles and obstacles, as a table.
pub(super) fn closest_table(answer: &Answer, are_of_obstacles: bool) -> Section {
    let heading = match answer.part {
        Part::PublishedPlans => "Closest published plans",
        Part::FlownPlans => "Closest plans and flights",
        _ if are_of_obstacles => "Closest to obstacles",
        _ => "Closest pairs",
    };
    let closest = || answer.closest.iter().filter(|finding| finding.is_of_obstacle() == are_of_obstacles);
    let unit = closest().next().map_or("", |finding| finding.value.unit);
    let row = |finding: &Finding| {
        let limit = finding.limit.unwrap_or_default();
        let apart = interval(finding.value.lower_bound(), finding.value.upper_bound(), limit);
        [finding.names(), apart, fixed(finding.at_s.unwrap_or(f64::NAN), 3), exact(limit)]
    };
    let columns = &["pair", "smallest distance", "at [s]", "limit"];
    Section::table(heading, format!("smallest distances in {unit}"), columns, closest().map(row))
}

/// Returns the violations and the undecided times of some answers, a sentence each.
pub(super) fn lists<'a, I: Iterator<Item = &'a Answer>>(answers: impl Fn() -> I) -> [Section; 2] {
    [true, false].map(|are_violations| {
        let list = |answer: &'a Answer| if are_violations { &answer.violations } else { &answer.undecided };
        let sentences = answers().flat_map(|answer| {
            list(answer).listed.iter().map(move |finding| finding.sentence(answer.part, are_violations))
        });
        let heading = if are_violations { "Violations" } else { "Undecided" };
        Section::list(heading, shortened_in_words(sum(answers().map(list))), sentences.collect())
    })
}

/// Adds the numbers of found and of listed findings.
pub(super) fn sum<'a>(lists: impl IntoIterator<Item = &'a FindingList>) -> Tally {
    lists.into_iter().fold(Tally::all(0), |all, list| Tally {
        count: all.count + list.count,
        listed: all.listed + list.listed.len(),
        is_exact: all.is_exact && list.is_exact,
    })
}

/// Returns the number of findings in words, such as `at least 12`.
pub(super) fn tally_in_words(tally: Tally) -> String {
    let least = if tally.is_exact { "" } else { "at least " };
    format!("{least}{}", tally.count)
}

/// Returns the number of findings, and the number of the listed ones if the list is cut.
pub(super) fn shortened_in_words(tally: Tally) -> String {
    let count = tally_in_words(tally);
    if tally.is_shortened() { format!("{count}, {} of them listed", tally.listed) } else { count }
}

impl Finding {
    /// Returns the names of all subjects, and their plans.
    pub(super) fn names(&self) -> String {
        let named = self.subjects.iter().enumerate().map(|(index, vehicle)| match self.plans.get(index) {
            Some(PublishedPlan { number, published_s }) => {
                format!("plan {number} of {vehicle} (published at {})", seconds(*published_s))
            }
            None if self.plans.is_empty() => vehicle.clone(),
            None => format!("the flight of {vehicle}"),
        });
        named.collect::<Vec<_>>().join(" and ")
    }

    /// Returns the finding with names cut to the length that a replay shows.
    fn short(&self) -> Self {
        Self { subjects: self.subjects.iter().map(|name| cut(name, LONGEST_NAME)).collect(), ..self.clone() }
    }

    fn span(&self) -> Span {
        let (from_s, to_s) = (self.from_s.unwrap_or_default(), self.to_s.unwrap_or_default());
        Span { from_s, to_s, at_s: self.at_s.unwrap_or(f64::midpoint(from_s, to_s)) }
    }

    fn moment(&self, kind: Kind, span: Span, brief: String, said: String) -> Moment {
        let (vehicles, obstacle) = match self.objects {
            Objects::Pair(ObjectPair::Vehicles(pair)) => (vec![pair.first(), pair.second()], None),
            Objects::Pair(ObjectPair::Obstacle { vehicle, obstacle }) => (vec![vehicle], Some(obstacle)),
            Objects::Vehicle(vehicle) => (vec![vehicle], None),
        };
        Moment { kind, vehicles, obstacle, span, brief, said }
    }

    /// Returns a smallest distance below its limit, such as `0.250 m (limit 1.000)`.
    fn too_close(&self) -> String {
        let limit = self.limit.unwrap_or_default();
        format!("{} {} (limit {})", beside_limit(self.value.upper_bound(), limit, 3), self.value.unit, exact(limit))
    }

    /// Returns a violation or an undecided time in a few words, for a replay.
    fn brief(&self, part: Part, is_violation: bool) -> String {
        let names = self.names();
        match (part, is_violation) {
            (Part::Limit(limit), _) => {
                let (quantity, value) = (quantity(limit.quantity), self.shown_value(limit));
                format!("{names}: {quantity} {value} (limit {})", limit_in_words(limit))
            }
            (Part::WellClear(_), true) => format!("{names} are not well clear"),
            (Part::WellClear(_), false) => format!("{names} may not be well clear"),
            _ => format!("{names} may come too close"),
        }
    }

    /// Returns a violation or an undecided time in a sentence, for a replay.
    fn said(&self, part: Part, is_violation: bool) -> String {
        let sentence = self.sentence(part, is_violation);
        match part {
            Part::Limit(_) => sentence,
            _ if is_violation => format!("Violation: {sentence}"),
            _ => format!("Undecided: {sentence}"),
        }
    }

    /// Returns a violation or an undecided time in a sentence.
    fn sentence(&self, part: Part, is_violation: bool) -> String {
        let names = self.names();
        let over = span(self.from_s.unwrap_or(f64::NAN), self.to_s.unwrap_or(f64::NAN));
        let (allowed, unit) = (self.limit.unwrap_or_default(), self.value.unit);
        match part {
            Part::Limit(limit) if self.from_s.is_none() => {
                format!("{names}: its {} is not known", quantity(limit.quantity))
            }
            Part::Limit(limit) => format!(
                "{names}: {} {} by {} s, {} the limit of {} from {over}",
                quantity(limit.quantity),
                self.shown_value(limit),
                fixed(self.at_s.unwrap_or(f64::NAN), 3),
                if is_violation { "beyond" } else { "against" },
                limit_in_words(limit)
            ),
            Part::WellClear(_) => self.loss(if is_violation { "are not" } else { "may not be" }),
            _ if is_violation => format!(
                "{names}: {} {unit} at {} s, below {} {unit} from {over}",
                beside_limit(self.value.upper_bound(), allowed, 3),
                fixed(self.at_s.unwrap_or(f64::NAN), 3),
                exact(allowed)
            ),
            _ => {
                let rate = self.rate_hz.map_or(String::new(), |hz| format!("; {} Hz would decide", at_most(hz, 1)));
                let apart = match self.value.upper {
                    Some(upper) => interval(self.value.lower_bound(), upper, allowed),
                    None => "an unknown distance in".to_owned(),
                };
                format!("{names}: {apart} {unit} from {over}, limit {} {unit}{rate}", exact(allowed))
            }
        }
    }

    /// Returns a loss of well clear in a sentence.
    fn loss(&self, how: &str) -> String {
        format!(
            "{} {how} well clear from {}, down to {} m horizontally and {} m vertically",
            self.names(),
            span(self.from_s.unwrap_or(f64::NAN), self.to_s.unwrap_or(f64::NAN)),
            at_least(self.value.lower_bound(), 3),
            at_least(self.vertical_m.unwrap_or_default(), 3)
        )
    }

    /// Formats the value of an extreme or of a violation, rounded so that the statement holds.
    fn shown_value(&self, limit: Limit) -> String {
        let number = match (self.value.lower, self.value.upper) {
            (None, None) => return "not known".to_owned(),
            (Some(lower), None) => format!("at least {}", at_least(lower, 3)),
            (None, Some(upper)) => format!("at most {}", at_most(upper, 3)),
            (Some(lower), Some(upper)) if upper - lower <= 1e-6 * upper.abs().max(1.0) => {
                distinct(upper, limit.allowed)
            }
            (Some(lower), Some(upper)) => format!("{} to {}", at_least(lower, 3), at_most(upper, 3)),
        };
        format!("{number} {}", self.value.unit)
    }
}

/// Formats a value with at least three decimals, and with enough to differ from the limit.
fn distinct(value: f64, allowed: f64) -> String {
    let size = |number: f64, decimals: usize| fixed(number, decimals).trim_start_matches('-').to_owned();
    let is_distinct = |&decimals: &usize| size(value, decimals) != size(allowed, decimals);
    let decimals = if value == allowed { 3 } else { (3..=17).find(is_distinct).unwrap_or(3) };
    fixed(value, decimals)
}

/// Returns the limited quantity in words.
fn quantity(quantity: Quantity) -> &'static str {
    match quantity {
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

fn limit_in_words(limit: Limit) -> String {
    let least = if limit.quantity.is_least() { "at least " } else { "" };
    format!("{least}{} {}", exact(limit.allowed), limit.quantity.unit())
}

/// Formats an interval of time.
pub(super) fn span(from_s: f64, to_s: f64) -> String {
    format!("{} s to {} s", fixed(from_s, 3), fixed(to_s, 3))
}

/// Formats a distance beside its limit with six decimals, rounded down. If the bounds differ, returns an interval that
/// contains both.
#[must_use]
pub fn interval(lower: f64, upper: f64, limit: f64) -> String {
    let (low, high) = (beside_limit(lower, limit, 6), at_most(upper, 6));
    if upper - lower <= 2.0 * WIDTH_M || low == high { low } else { format!("{low} .. {high}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_audit::Violation;
    use tautline_core::swarm::Pair;
    use tautline_core::text::in_order;

    #[test]
    fn long_names_are_cut_and_direction_controls_are_replaced() {
        let pair = ObjectPair::Vehicles(Pair::new(0, 1));
        let found = Violation { pair, from_s: 1.0, to_s: 2.0, min_m: 0.25, min_at_s: 1.5, limit_m: 1.0 };
        let names = ["ü".repeat(5000), "drone \u{202e}b".to_owned()];
        let mut answer = Answer::new(Part::Separation, Status::Violation);
        answer.violations.listed = vec![Finding::violation(&found, names, "m", true)];
        let moment = moments(&[answer]).next().expect("a moment");
        let expected =
            "… and drone \u{fffd}b came to 0.250 m (limit 1.000) at 1.500 s, below it from 1.000 s to 2.000 s";
        let said = in_order(&moment.said);
        assert!(said.ends_with(expected) && said.chars().count() < 150, "{said}");
    }
}
