//! The report on a recording in words and as a page.

use super::envelope::LimitFindings;
use super::plan::PlanReport;
use super::report::{EarlyEnd, Exemption, PresenceSpan, RecordedReport, RunObjection};
use super::report::{PairFinding, VehicleFinding};
use super::well_clear::WellClearFindings;
use crate::figures::Figure;
use crate::replay::{NoReplay, Replay};
use crate::report::answer::Part;
use crate::report::page::{self, Badge, Page, Start, Tone};
use crate::report::section::Section;
use tautline_audit::recorded::{Approach, Gap, ObjectPair, WIDTH_M};
use tautline_audit::{LISTED, Status, Tally, Undecided, Violation};
use tautline_core::fact::{BOUNDED, CURVES, Coded, EVERY_STEP, Fact, FactKind, RUN_AUDIT};
use tautline_core::option::{ABOVE, MAX_GAP, REQUIRE_PRESENCE};
use tautline_core::text::{at_least, at_most, beside_limit, counted, exact, fixed, in_order, seconds};

/// Largest numbers of violations in the text, and on the page.
const LISTED_IN_WORDS: usize = 10;
const LISTED_ON_PAGE: usize = 100;
/// Subject of facts about a plan.
pub(crate) const THE_PLAN: &str = "the plan";
/// Largest number of vehicles in the headline that are not seen throughout.
const NAMED_IN_HEADLINE: usize = 3;

impl RecordedReport {
    /// Returns the verdict in one line, with its window and the vehicles that are not seen throughout.
    #[must_use]
    pub fn headline(&self) -> String {
        one_line(&format!("{}: {}", self.verdict(), self.finding()))
    }

    /// Returns the answer to a part in a few words; the headline for separations.
    #[must_use]
    pub fn brief(&self, part: Part) -> String {
        let of_limit = |key| self.limits.iter().find(|limit| limit.quantity == key).map(LimitFindings::brief);
        let brief = match part {
            Part::Separation => Some(self.headline()),
            Part::Limit(key) => of_limit(key),
            Part::WellClear => self.well_clear.as_ref().map(WellClearFindings::brief),
            Part::Plan => self.plan.as_ref().map(PlanReport::brief),
            Part::Presence => {
                let partly = counted(self.presence.partly as u64, "vehicle is", "vehicles are");
                Some(format!("{partly} not seen throughout"))
            }
        };
        brief.unwrap_or_default()
    }

    /// Returns the window of the verdict, and the first vehicles that are not seen throughout.
    fn window(&self, status: Status) -> String {
        let presence = &self.presence;
        let window = presence.window_s.map_or(String::new(), |(from_s, to_s)| format!("; from {}", span(from_s, to_s)));
        if presence.partly == 0 {
            return if status == Status::Clear { window } else { String::new() };
        }
        let named = presence.listed.iter().take(NAMED_IN_HEADLINE).map(VehicleFinding::<PresenceSpan>::words);
        let rest = presence.partly.saturating_sub(NAMED_IN_HEADLINE);
        let more = (rest > 0).then(|| format!("and {rest} more"));
        let named = named.chain(more).collect::<Vec<_>>().join(", ");
        let all = presence.partly + presence.throughout;
        let required = if presence.required { format!(", which {REQUIRE_PRESENCE} asks for") } else { String::new() };
        format!(
            "{window}, over which {} of {all} vehicles {} not seen throughout{required}: {named}",
            presence.partly,
            if presence.partly == 1 { "is" } else { "are" }
        )
    }

    /// Returns the verdict alone, such as `PROVED CLEAR`.
    #[must_use]
    pub fn verdict(&self) -> String {
        self.verdict_as(self.status)
    }

    fn verdict_as(&self, status: Status) -> String {
        let above = self.exemption.as_ref().map_or(String::new(), |time| format!(" above {} m", exact(time.above_m)));
        match status {
            Status::Clear if self.source.facts.iter().any(Fact::is_assumption) => {
                format!("CLEAR{above} if {}", self.conditions())
            }
            Status::Clear if self.is_by_run() => format!("PROVED CLEAR {}", self.motion()),
            Status::Clear => format!("PROVED CLEAR{above}"),
            Status::Violation => "VIOLATION".to_owned(),
            Status::Undecided => "UNDECIDED".to_owned(),
        }
    }

    /// Returns the motion between samples, with the assumptions on the samples and on obstacles.
    #[must_use]
    pub fn motion(&self) -> String {
        let of_motion = |fact: &&Fact| fact.kind == FactKind::Motion || fact.is_assumption() && !is_of_part(fact);
        self.clauses(of_motion).join(", ")
    }

    /// Returns the conditions of a clear verdict.
    fn conditions(&self) -> String {
        let is_recorded = |fact: &Fact| {
            fact.kind == FactKind::Motion && [CURVES, EVERY_STEP, RUN_AUDIT].iter().any(|name| fact.is_named(name))
        };
        let is_condition = |fact: &&Fact| {
            !is_of_part(fact) && !is_recorded(fact) && (fact.kind == FactKind::Motion || fact.is_assumption())
        };
        let of_parts = self.clauses(|fact| is_of_part(fact));
        let of_motion = self.clauses(is_condition);
        let of_motion = (!of_motion.is_empty()).then(|| of_motion.join(", "));
        of_motion.into_iter().chain(of_parts).collect::<Vec<_>>().join(" and ")
    }

    /// Returns facts as clauses, the first obstacle that stands still with the number of the others.
    fn clauses(&self, is_told: impl Fn(&&Fact) -> bool) -> Vec<String> {
        let mut clauses = Vec::new();
        let mut resting = 0;
        for fact in self.source.facts.iter().filter(is_told) {
            resting += u64::from(fact.kind == FactKind::ObstacleMotion);
            match fact.kind {
                FactKind::ObstacleMotion if resting > 1 => {}
                FactKind::Motion if fact.is_named(BOUNDED) => clauses.push(self.bounds()),
                _ => clauses.push(fact.to_string()),
            }
        }
        if resting > 1 {
            clauses.push(format!("{} outside the paths", counted(resting - 1, "other obstacle", "other obstacles")));
        }
        clauses
    }

    /// Returns the bounds on accelerations.
    fn bounds(&self) -> String {
        let bounds = self.source.facts.iter().filter(|fact| fact.kind == FactKind::Acceleration);
        let bounds = bounds.map(|fact| {
            let value = fact.value.as_ref().map_or_else(String::new, ToString::to_string);
            fact.subject.as_ref().map_or(value.clone(), |vehicle| format!("{value} for {vehicle}"))
        });
        format!("accelerations of at most {}", bounds.collect::<Vec<_>>().join(", "))
    }

    /// Returns the headline without the verdict.
    fn finding(&self) -> String {
        match &self.ended_early {
            None => self.finding_as(self.status),
            Some(end) if self.was_clear_until_end => {
                let verdict = self.verdict_as(Status::Clear);
                format!("{}; until then {verdict}: {}", end.words(), self.finding_as(Status::Clear))
            }
            Some(end) => format!("{}; {}", self.finding_as(self.status), end.words()),
        }
    }

    /// Returns the findings that decide the status, on pairs and on limits. Up to an early end of a clear flight all of
    /// them are clear.
    fn finding_as(&self, status: Status) -> String {
        let decides = |own: Status| own == status || self.was_clear_until_end;
        let limits = self.limits.iter().filter(|limit| decides(limit.status)).map(|limit| limit.brief_as(status));
        let well_clear = self.well_clear.iter().filter(|found| decides(found.status));
        let limits = limits.chain(well_clear.map(|found| found.brief_as(status)));
        let of_pairs = self.separation.is_some_and(decides);
        let exempt = self.exemption.as_ref().map(Exemption::words);
        let in_plane = self.source.planar.then(|| "in the plane of x and y: no heights are known".to_owned());
        let pairs = of_pairs.then(|| self.finding_of_pairs(status));
        let against_plan = self.plan.iter().filter(|plan| decides(plan.status)).map(|plan| plan.brief_as(status));
        let found = pairs.into_iter().chain(limits).chain(against_plan).collect::<Vec<_>>();
        // All limits are kept, but a vehicle that must be present is not seen throughout.
        let nothing = found.is_empty().then(|| "not every vehicle is seen throughout".to_owned());
        found.into_iter().chain(nothing).chain(exempt).chain(in_plane).collect::<Vec<_>>().join("; ")
            + &self.window(status)
    }

    fn finding_of_pairs(&self, status: Status) -> String {
        let unit = format!(" {}", self.unit());
        let delta = self.question.delta.map_or("by radii".to_owned(), |m| format!("delta {}{unit}", exact(m)));
        match status {
            Status::Clear => {
                let all = self.closest.iter().chain(&self.closest_to_obstacles);
                let lowest = all.min_by(|a, b| a.finding.lower_m.total_cmp(&b.finding.lower_m));
                let closest = lowest.map_or(String::new(), |PairFinding { who: [first, second], finding }| {
                    let (least, at) = (beside_limit(finding.lower_m, finding.limit_m, 6), seconds(finding.time_s));
                    format!("never closer than {least}{unit}, {first} and {second} at {at} ")
                });
                let is_in_verdict = self.is_by_run() || self.source.facts.iter().any(Fact::is_assumption);
                let motion = if is_in_verdict { String::new() } else { format!(", {}", self.motion()) };
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
                        self.motion()
                    )
                })
            }
            Status::Undecided => format!("{} ({delta}, {})", self.why_undecided(), self.motion()),
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
        if self.detectors.parry_disagreements > 0 {
            return "the two detectors disagree".to_owned();
        }
        if let Some(objection) = &self.run_objection {
            return objection.words();
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
        let joined = format!("{} would judge across", MAX_GAP.set((longest_s * 1e6).ceil() / 1e6));
        match &self.gaps[..] {
            [] if self.span_s.is_none() => "the window holds nothing to judge".to_owned(),
            [] => {
                let above = self.exemption.as_ref();
                let above = above.map(|time| format!(", one of them above {} m ({ABOVE})", exact(time.above_m)));
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
            closest("Closest to obstacles", &self.closest_to_obstacles),
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
            counted(self.detectors.steps.or(self.detectors.segments).unwrap_or_default(), "stretch", "stretches"),
            self.detectors.pairs_swept
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
        let is_recorded = self.conditions().is_empty();
        let assumed = [
            format!("Motion: {} ({}).", self.motion(), if is_recorded { "as recorded" } else { "assumed" }),
            "A distance strictly below its limit is a violation; equality is not.".to_owned(),
            format!("Time 0 s is {} ns on the recording's clock.", self.source.clock.epoch_ns),
        ];
        page.add("Assumptions", "The verdict holds under these assumptions.", [page::list(&assumed)]);
        let facts = self.source.facts.iter().map(|fact| {
            let value = fact.value.as_ref().map(ToString::to_string);
            let value = fact.subject.iter().cloned().chain(value).collect::<Vec<_>>().join(": ");
            [fact.code().to_owned(), fact.source.code().to_owned(), one_line(&value)]
        });
        let columns = ["Fact", "Source", "Value"];
        page.add("Facts", "The verdict rests on these facts.", [page::words("Facts and sources", &columns, facts)]);
        page.add("Reproduce", "This command judges the recording again.", [page::command(command)]);
        page.render()
    }
}

/// Returns whether a fact concerns limits of single vehicles or the plan, and not the motion of the recording.
fn is_of_part(fact: &Fact) -> bool {
    matches!(
        fact.kind,
        FactKind::MeanAcceleration
            | FactKind::SampledAcceleration
            | FactKind::RoundedCorners
            | FactKind::PlanMotion
            | FactKind::PlanHeights
            | FactKind::PlanPlane
    ) || fact.subject.as_deref() == Some(THE_PLAN)
}

impl RunObjection {
    /// Returns the objection in a clause.
    fn words(&self) -> String {
        match self {
            Self::RunUndecided {} => "the run's own audit of every step is undecided (see its report.json)".to_owned(),
            Self::RunFoundCloser { who: [first, second], min, unit, at_s } => {
                let (min, at) = (at_least(*min, 3), seconds(*at_s));
                format!("the run's audit of every step found {first} and {second} {min} {unit} apart at {at}")
            }
        }
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
