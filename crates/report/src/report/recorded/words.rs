//! The report on a recording in words and as a page.

use super::envelope::LimitFindings;
use super::plan::PlanReport;
use super::report::{EarlyEnd, Exemption, PresenceSpan, RecordedReport};
use super::report::{PairFinding, VehicleFinding};
use super::well_clear::WellClearFindings;
use crate::figures::Figure;
use crate::replay::{NoReplay, Replay};
use crate::report::page::{self, Badge, Page, Start, Tone};
use crate::report::section::Section;
use tautline_audit::recorded::{Approach, Gap, ObjectPair, WIDTH_M};
use tautline_audit::{LISTED, Status, Tally, Undecided, Violation};
use tautline_core::fact::Coded;
use tautline_core::text::{at_least, at_most, beside_limit, counted, exact, fixed, in_order, seconds};

/// Largest numbers of violations in the text, and on the page.
const LISTED_IN_WORDS: usize = 10;
const LISTED_ON_PAGE: usize = 100;
/// Largest number of vehicles in the headline that are not seen throughout.
const NAMED_IN_HEADLINE: usize = 3;

impl RecordedReport {
    /// Returns the verdict in one line, with its window and the vehicles that are not seen throughout.
    #[must_use]
    pub fn headline(&self) -> String {
        one_line(&format!("{}: {}", self.verdict(), self.finding()))
    }

    /// Returns the window of the verdict, and the first vehicles that are not seen throughout.
    fn window(&self) -> String {
        let presence = &self.presence;
        let window = presence.window_s.map_or(String::new(), |(from_s, to_s)| format!("; from {}", span(from_s, to_s)));
        if presence.partly == 0 {
            return if self.status == Status::Clear { window } else { String::new() };
        }
        let named = presence.listed.iter().take(NAMED_IN_HEADLINE).map(VehicleFinding::<PresenceSpan>::words);
        let rest = presence.partly.saturating_sub(NAMED_IN_HEADLINE);
        let more = (rest > 0).then(|| format!("and {rest} more"));
        let named = named.chain(more).collect::<Vec<_>>().join(", ");
        let all = presence.partly + presence.throughout;
        let required = if presence.required { ", which --require-presence asks for" } else { "" };
        format!(
            "{window}, over which {} of {all} vehicles {} not seen throughout{required}: {named}",
            presence.partly,
            if presence.partly == 1 { "is" } else { "are" }
        )
    }

    /// Returns the verdict alone, such as `PROVED CLEAR`.
    #[must_use]
    pub fn verdict(&self) -> String {
        let above = self.exemption.as_ref().map_or(String::new(), |time| format!(" above {} m", exact(time.above_m)));
        match self.status {
            Status::Clear if self.audit.judged_by_run => format!("PROVED CLEAR {}", self.motion),
            Status::Clear if self.audit.proved => format!("PROVED CLEAR{above}"),
            Status::Clear => format!("CLEAR{above} if {}", self.audit.assumes.as_ref().unwrap_or(&self.motion)),
            Status::Violation => "VIOLATION".to_owned(),
            Status::Undecided => "UNDECIDED".to_owned(),
        }
    }

    /// Returns the headline without the verdict.
    fn finding(&self) -> String {
        match (&self.ended_early, &self.until_then) {
            (None, _) => self.finding_of_motion(),
            (Some(end), Some(until_then)) => format!("{}; until then {until_then}", end.words()),
            (Some(end), None) => format!("{}; {}", self.finding_of_motion(), end.words()),
        }
    }

    /// Returns the findings with the status of the verdict, on pairs and on limits.
    fn finding_of_motion(&self) -> String {
        let decides = |limit: &&LimitFindings| limit.status == self.status;
        let limits = self.limits.iter().filter(decides).map(LimitFindings::brief);
        let well_clear = self.well_clear.iter().filter(|found| found.status == self.status);
        let limits = limits.chain(well_clear.map(WellClearFindings::brief));
        let of_pairs = self.audit.flight.status == Some(self.status);
        let exempt = self.exemption.as_ref().map(Exemption::words);
        let in_plane = self.source.planar.then(|| "in the plane of x and y: no heights are known".to_owned());
        let pairs = of_pairs.then(|| self.finding_of_pairs());
        let against_plan = self.plan.iter().filter(|plan| plan.status == self.status).map(PlanReport::brief);
        let found = pairs.into_iter().chain(limits).chain(against_plan).collect::<Vec<_>>();
        // All limits are kept, but a vehicle that must be present is not seen throughout.
        let nothing = found.is_empty().then(|| "not every vehicle is seen throughout".to_owned());
        found.into_iter().chain(nothing).chain(exempt).chain(in_plane).collect::<Vec<_>>().join("; ") + &self.window()
    }

    fn finding_of_pairs(&self) -> String {
        let unit = format!(" {}", self.unit());
        let delta = self.separation.delta_m.map_or("by radii".to_owned(), |m| format!("delta {}{unit}", exact(m)));
        match self.status {
            Status::Clear => {
                let all = self.closest.iter().chain(&self.obstacles.closest);
                let lowest = all.min_by(|a, b| a.finding.lower_m.total_cmp(&b.finding.lower_m));
                let closest = lowest.map_or(String::new(), |PairFinding { who: [first, second], finding }| {
                    let (least, at) = (beside_limit(finding.lower_m, finding.limit_m, 6), seconds(finding.time_s));
                    format!("never closer than {least}{unit}, {first} and {second} at {at} ")
                });
                let is_in_verdict = self.audit.judged_by_run || !self.audit.proved;
                let motion = if is_in_verdict { String::new() } else { format!(", {}", self.motion) };
                format!("{closest}({delta}{motion}){}", self.never_with_another())
            }
            Status::Violation => {
                let over = |of: &PairFinding<Violation<ObjectPair>>| of.finding.min_m - of.finding.limit_m;
                let deepest = self.violations.iter().min_by(|a, b| over(a).total_cmp(&over(b)));
                let tie = if self.is_decimal_tie { ", with decimals exactly at the limit" } else { "" };
                let others = match counted_in_words(self.findings.violations) {
                    _ if self.findings.violations.count <= 1 => String::new(),
                    count => format!("; {count} violations in all"),
                };
                deepest.map_or(String::new(), |PairFinding { who: [first, second], finding }| {
                    format!(
                        "{first} and {second} came to {}{unit} (limit {}{unit}) at {}, {}{tie}{others}",
                        beside_limit(finding.min_m, finding.limit_m, 3),
                        exact(finding.limit_m),
                        seconds(finding.min_at_s),
                        self.motion
                    )
                })
            }
            Status::Undecided => format!("{} ({delta}, {})", self.why_undecided(), self.motion),
        }
    }

    /// Returns the vehicles that are never present together with another one, and are therefore not judged.
    fn never_with_another(&self) -> String {
        let others = |count: usize| if count > 0 { format!(" and {count} more") } else { String::new() };
        self.alone.split_first().map_or(String::new(), |(first, rest)| {
            let (is, others) = (if rest.is_empty() { "is" } else { "are" }, others(rest.len()));
            format!("; {}{others} {is} never present with another", first.vehicle)
        })
    }

    fn why_undecided(&self) -> String {
        let unit = format!(" {}", self.unit());
        if self.audit.flight.parry.disagreements > 0 {
            return "the two detectors disagree".to_owned();
        }
        if let Some(why) = &self.run_objection {
            return why.clone();
        }
        if let Some(VehicleFinding { vehicle, finding }) = &self.contradiction {
            return format!(
                "{vehicle} needs {} m/s^2 at {}, more than the assumed {:?} m/s^2",
                at_most(finding.needs_m_s2, 3),
                seconds(finding.time_s),
                finding.assumed_m_s2
            );
        }
        let closest = self.undecided.iter().min_by(|a, b| a.finding.lower_m.total_cmp(&b.finding.lower_m));
        if let Some(PairFinding { who: [first, second], finding }) = closest {
            let rate = self
                .deciding_rate_hz
                .map_or(String::new(), |hz| format!("; sampling at {} Hz would decide", at_most(hz, 1)));
            let (low, high, at) = (at_least(finding.lower_m, 6), at_most(finding.upper_m, 6), seconds(finding.to_s));
            return if finding.upper_m.is_finite() {
                format!("{first} and {second} came to between {low}{unit} and {high}{unit} by {at}{rate}")
            } else {
                format!("the distance of {first} and {second} at {at} is unknown")
            };
        }
        let longest_s = self.gaps.iter().map(|gap| gap.finding.joined_by_s).fold(0.0, f64::max);
        // Rounded up, so that the printed gap is long enough.
        let joined = format!("--max-gap {} would judge across", (longest_s * 1e6).ceil() / 1e6);
        match &self.gaps[..] {
            [] if self.span_s.is_none() => "the window holds nothing to judge".to_owned(),
            [] => {
                let above = self.exemption.as_ref();
                let above = above.map(|time| format!(", one of them above {} m (--above)", exact(time.above_m)));
                format!("no two vehicles are present at the same time{}", above.unwrap_or_default())
            }
            [VehicleFinding { vehicle, finding }] => {
                format!("{vehicle} was not seen from {}; {joined}", span(finding.from_s, finding.to_s))
            }
            [VehicleFinding { vehicle, finding }, ..] => {
                let (count, at) = (counted_in_words(self.findings.gaps), seconds(finding.from_s));
                format!("{count} gaps, the first of {vehicle} at {at}; {joined}")
            }
        }
    }

    /// Returns the sections of the text and of the page.
    fn sections(&self) -> Vec<Section> {
        let caption = format!("smallest distances in {}", self.unit());
        let closest = |heading: &'static str, closest: &[PairFinding<Approach>]| {
            let row = |PairFinding { who: [first, second], finding }: &PairFinding<Approach>| {
                let apart = interval(finding.lower_m, finding.upper_m, finding.limit_m);
                [format!("{first} and {second}"), apart, fixed(finding.time_s, 3), exact(finding.limit_m)]
            };
            let columns = &["who", "smallest distance", "at [s]", "limit"];
            Section::table(heading, &caption, columns, closest.iter().map(row))
        };
        let columns = &["what", "worst", "vehicle", "at [s]", "limit", "verdict"];
        let limits = "limits, and the vehicles closest to them";
        let presence = &self.presence;
        let seen = format!("{} seen throughout, {} not", presence.throughout, presence.partly);
        let all = |of: Tally, tally: fn(&LimitFindings) -> Tally| self.limits.iter().map(tally).fold(of, sum);
        let unknown = self.limits.iter().map(|limit| limit.unknown.len()).sum();
        let well_clear = || self.well_clear.iter();
        let violations = all(self.findings.violations, |limit| limit.violations_tally);
        let violations = well_clear().map(|found| found.violations_tally).fold(violations, sum);
        let undecided = sum(all(self.findings.undecided, |limit| limit.undecided_tally), Tally::all(unknown));
        let undecided = well_clear().map(|found| found.undecided_tally).fold(undecided, sum);
        let list = |heading: &'static str, tally: Tally, lines: Vec<String>| {
            Section::list(heading, shortened_in_words(tally), lines)
        };
        let violated = self.violations.iter().map(PairFinding::<Violation<_>>::words);
        let violated = violated.chain(self.limits.iter().flat_map(LimitFindings::violations_in_words));
        let violated = violated.chain(well_clear().flat_map(WellClearFindings::violations_in_words)).collect();
        let open = self.undecided.iter().map(PairFinding::<Undecided<_>>::words);
        let open = open.chain(self.limits.iter().flat_map(LimitFindings::undecided_in_words));
        let open = open.chain(well_clear().flat_map(WellClearFindings::undecided_in_words)).collect();
        let sections = [
            closest("Closest pairs", &self.closest),
            closest("Closest to obstacles", &self.obstacles.closest),
            Section::table("Each vehicle by itself", limits, columns, self.limits.iter().map(LimitFindings::row)),
            Section::list(
                "Presence",
                seen,
                presence.listed.iter().map(VehicleFinding::<PresenceSpan>::words).collect(),
            )
            .of_all(presence.partly),
            list("Violations", violations, violated),
            list("Undecided", undecided, open),
            list("Gaps", self.findings.gaps, self.gaps.iter().map(VehicleFinding::<Gap>::words).collect()),
        ];
        let against_plan = self.plan.iter().flat_map(PlanReport::sections);
        sections.into_iter().chain(against_plan).filter(|section| !section.rows.is_empty()).collect()
    }

    /// Returns the lists that are cut, a sentence each.
    #[must_use]
    pub fn shortened(&self) -> Vec<String> {
        let of_pairs = [
            ("violations", self.findings.violations),
            ("undecided times", self.findings.undecided),
            ("gaps", self.findings.gaps),
        ];
        let of_limits = self.limits.iter().flat_map(|limit| {
            [("violations", limit.violations_tally), ("undecided times", limit.undecided_tally)]
                .map(|(what, tally)| (format!("{what} of {}", limit.quantity), tally))
        });
        let all = of_pairs.map(|(what, tally)| (what.to_owned(), tally)).into_iter().chain(of_limits);
        let of_traffic = self.well_clear.iter().flat_map(|found| {
            let tallies = [
                ("losses of well clear", found.violations_tally),
                ("undecided times of well clear", found.undecided_tally),
            ];
            tallies.map(|(what, tally)| (what.to_owned(), tally))
        });
        let shortened = all.chain(of_traffic).filter(|(_, tally)| tally.is_shortened());
        shortened
            .map(|(what, tally)| {
                let (count, listed) = (counted_in_words(tally), tally.listed);
                format!(
                    "{count} {what} were found and {listed} are listed: the worst, and the first of each pair or \
                     vehicle, {LISTED} of either at most"
                )
            })
            .collect()
    }

    /// Returns the closest pairs and the findings, a line each, with a final line break.
    #[must_use]
    pub fn text(&self) -> String {
        let span = self.span_s.map_or("nothing".to_owned(), |(from_s, to_s)| span(from_s, to_s));
        let judged = format!(
            "judged       {span}, {}, {} of motion, {} swept",
            counted(self.judged as u64, "vehicle", "vehicles"),
            counted(self.audit.flight.steps, "stretch", "stretches"),
            self.audit.flight.pairs_checked
        );
        let lines = self.sections().into_iter().flat_map(|section| section.text(LISTED_IN_WORDS));
        std::iter::once(judged).chain(lines).map(|line| one_line(&line) + "\n").collect()
    }

    /// Returns the report as a self-contained HTML page, with the replay of the recording or the reason for its
    /// absence.
    #[must_use]
    pub fn to_html(&self, replay: &Result<Replay, NoReplay>, figures: &[Figure], command: &str) -> String {
        let tone = match self.status {
            Status::Clear => Tone::Good,
            Status::Violation => Tone::Bad,
            Status::Undecided => Tone::Neutral,
        };
        let badge = Badge { tone, word: self.verdict() };
        let mut page = Page::new("Audit of a recording", self.source.recording.clone(), badge, self.finding());
        page.replay = Some(page::replay(&self.source.recording, replay, Start::AtOnce));
        page.add(
            "Figures",
            "Distances over the recording; a bold line across a chart is the limit.",
            [page::figures(figures)],
        );
        page.sections.extend(self.sections().iter().map(|section| section.html(LISTED_ON_PAGE)));
        page.add("How it was read", "Decisions of the reader of this file format.", [page::list(&self.source.notes)]);
        let known = if self.audit.assumes.is_some() { "assumed" } else { "as recorded" };
        let assumed = [
            format!("Motion: {} ({known}).", self.motion),
            "A distance strictly below its limit is a violation; equality is not.".to_owned(),
            format!("Time 0 s is {} ns on the recording's clock.", self.source.clock.epoch_ns),
        ];
        page.add("Assumptions", "The verdict holds under these assumptions.", [page::list(&assumed)]);
        let facts = self.source.facts.iter().map(|fact| {
            let value = fact.value.as_ref().map_or_else(String::new, ToString::to_string);
            [fact.code().to_owned(), fact.source.code().to_owned(), one_line(&value)]
        });
        let columns = ["Fact", "Source", "Value"];
        page.add("Facts", "The verdict rests on these facts.", [page::words("Facts and sources", &columns, facts)]);
        page.add("Reproduce", "This command judges the recording again.", [page::command(command)]);
        page.render()
    }
}

/// Puts text with foreign names on one line, without control characters that change the direction of reading.
fn one_line(words: &str) -> String {
    in_order(words).chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
}

/// Adds the numbers of found and of listed findings.
fn sum(a: Tally, b: Tally) -> Tally {
    Tally { count: a.count + b.count, listed: a.listed + b.listed, is_exact: a.is_exact && b.is_exact }
}

/// Returns the number of findings in words, such as `at least 12`.
fn counted_in_words(tally: Tally) -> String {
    let least = if tally.is_exact { "" } else { "at least " };
    format!("{least}{}", tally.count)
}

/// Returns the number of findings, and the number of the listed ones if the list is cut.
fn shortened_in_words(tally: Tally) -> String {
    let count = counted_in_words(tally);
    if tally.is_shortened() { format!("{count}, {} of them listed", tally.listed) } else { count }
}

impl Exemption {
    /// Returns the exempt times in a clause.
    fn words(&self) -> String {
        let Self { above_m, exempt, land_on, judged_s } = self;
        let (above, judged) = (exact(*above_m), fixed(*judged_s, 3));
        let pairs =
            format!("pairs at or below {above} m were exempt for {} s", at_most(exempt.pairs_s.min(*judged_s), 3));
        let landed = (!land_on.is_empty()).then(|| {
            let (names, time) = (land_on.join(", "), at_most(exempt.vehicles_s.min(*judged_s), 3));
            format!(", landing on {names} for {time} s")
        });
        format!("{pairs}{} of {judged} s", landed.unwrap_or_default())
    }
}

impl EarlyEnd {
    /// Returns the time and reason of the end in a clause.
    #[must_use]
    pub fn words(&self) -> String {
        let (at, duration) = (seconds(self.at_s), seconds(self.duration_s));
        match &self.reason {
            Some(reason) => format!("the flight ended early, at {at} of {duration} ({reason})"),
            None => format!("the recording ends at {at}, before the end of its flight of {duration}"),
        }
    }
}

impl PairFinding<Violation<ObjectPair>> {
    pub(super) fn words(&self) -> String {
        let Self { who: [first, second], finding } = self;
        let min = beside_limit(finding.min_m, finding.limit_m, 3);
        format!(
            "{first} and {second}: {min} at {} s, below {} from {}",
            fixed(finding.min_at_s, 3),
            exact(finding.limit_m),
            span(finding.from_s, finding.to_s)
        )
    }
}

impl PairFinding<Undecided<ObjectPair>> {
    pub(super) fn words(&self) -> String {
        let Self { who: [first, second], finding } = self;
        let rate = finding.rate_hz.map_or(String::new(), |hz| format!("; {} Hz would decide", at_most(hz, 1)));
        let apart = if finding.upper_m.is_finite() {
            interval(finding.lower_m, finding.upper_m, finding.limit_m)
        } else {
            "not known".to_owned()
        };
        format!(
            "{first} and {second}: {apart} from {}, limit {}{rate}",
            span(finding.from_s, finding.to_s),
            exact(finding.limit_m)
        )
    }
}

impl VehicleFinding<Gap> {
    pub(super) fn words(&self) -> String {
        format!("{} was not seen from {}", self.vehicle, span(self.finding.from_s, self.finding.to_s))
    }
}

impl VehicleFinding<PresenceSpan> {
    pub(super) fn words(&self) -> String {
        match self.finding {
            PresenceSpan { from_s: Some(from_s), to_s: Some(to_s) } => {
                format!("{} is seen from {}", self.vehicle, span(from_s, to_s))
            }
            _ => format!("{} is not seen", self.vehicle),
        }
    }
}

/// Formats an interval of time.
fn span(from_s: f64, to_s: f64) -> String {
    format!("{} s to {} s", fixed(from_s, 3), fixed(to_s, 3))
}

/// Formats a distance beside its limit with six decimals, rounded down. If the bounds differ, returns an interval that
/// contains both.
#[must_use]
pub fn interval(lower: f64, upper: f64, limit: f64) -> String {
    let (low, high) = (beside_limit(lower, limit, 6), at_most(upper, 6));
    if upper - lower <= 2.0 * WIDTH_M || low == high { low } else { format!("{low} .. {high}") }
}
