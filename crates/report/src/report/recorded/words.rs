//! The report on a recording in words and as a page.

use std::iter;

use super::plan::PlanReport;
use super::report::{Corners, EarlyEnd, Exemption, PresenceSpan, RecordedReport, RunObjection, VehicleFinding};
use crate::figures::Figure;
use crate::replay::{NoReplay, Replay};
use crate::report::answer::{Answer, Finding, Part};
use crate::report::findings::{closest_table, lists, shortened_in_words, span, sum, tally_in_words};
use crate::report::page::{self, Badge, Page, Start, Tone};
use crate::report::section::Section;
use tautline_audit::recorded::Gap;
use tautline_audit::{LISTED, Status};
use tautline_core::fact::{BOUNDED, CURVES, Coded, EVERY_STEP, Fact, FactKind, RUN_AUDIT};
use tautline_core::option::{ABOVE, ACCEL_WINDOW, MAX_GAP, REQUIRE_PRESENCE};
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

    /// Returns the answer to a part in a few words; the headline for separations. An early end of a flight that makes
    /// the answer undecided comes first.
    #[must_use]
    pub fn brief(&self, part: Part) -> String {
        let Some(answer) = self.answers.iter().find(|answer| answer.part == part) else { return String::new() };
        let so_far = match part {
            Part::Separation => return self.headline(),
            Part::Plan => self.plan.as_ref().map_or_else(String::new, |plan| plan.brief_as(answer.status_so_far)),
            Part::Presence => match self.presence.partly as u64 {
                0 => "every vehicle is seen throughout".to_owned(),
                partly => format!("{} not seen throughout", counted(partly, "vehicle is", "vehicles are")),
            },
            _ => answer.brief_as(answer.status_so_far),
        };
        match &self.ended_early {
            Some(end) if answer.status != answer.status_so_far => format!("{}; until then {so_far}", end.words()),
            _ => so_far,
        }
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
        let required = if presence.required { format!(", which {REQUIRE_PRESENCE} requires") } else { String::new() };
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

    /// Returns the motion between samples, with the assumptions on the samples and on obstacles. The facts on plans are
    /// among them only if the vehicles fly the plans.
    #[must_use]
    pub fn motion(&self) -> String {
        let are_flights = self.source.facts.iter().any(|fact| fact.kind == FactKind::FlownPlans);
        let of_motion = |fact: &&Fact| {
            let is_other = is_of_part(fact) || are_flights && is_of_published_plan(fact);
            !is_other && (fact.kind == FactKind::Motion || fact.is_assumption())
        };
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

    /// Returns the facts as clauses, the motion first. Of the obstacles that stand still, the first is named.
    fn clauses(&self, is_told: impl Fn(&&Fact) -> bool) -> Vec<String> {
        let mut facts: Vec<_> = self.source.facts.iter().filter(is_told).collect();
        facts.sort_by_key(|fact| fact.kind != FactKind::Motion);
        let is_resting = |fact: &&Fact| fact.kind == FactKind::ObstacleMotion;
        let others = facts.iter().filter(|fact| is_resting(fact)).count().saturating_sub(1) as u64;
        let first = facts.iter().position(is_resting);
        let clause = |(k, fact): (usize, &&Fact)| match fact.kind {
            FactKind::ObstacleMotion if first != Some(k) => None,
            FactKind::ObstacleMotion if others > 0 => {
                Some(format!("{fact} and {} outside the paths", counted(others, "other", "others")))
            }
            FactKind::Motion if fact.is_named(BOUNDED) => Some(self.bounds()),
            FactKind::RoundedCorners => Some(self.corners_in_words(fact)),
            _ if is_of_plan(fact) => Some(format!("in {THE_PLAN} {fact}")),
            _ => Some(fact.to_string()),
        };
        facts.iter().enumerate().filter_map(clause).collect()
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

    /// Returns the assumption on the corners of curves, with their number.
    fn corners_in_words(&self, fact: &Fact) -> String {
        let corners = self.corners.iter().find(|corners| corners.fact() == *fact);
        corners.map_or_else(|| fact.to_string(), Corners::words)
    }

    /// Returns the headline without the verdict.
    fn finding(&self) -> String {
        let so_far = self.status_so_far();
        match &self.ended_early {
            None => self.finding_as(so_far),
            Some(end) if so_far == Status::Clear => {
                let verdict = self.verdict_as(Status::Clear);
                format!("{}; until then {verdict}: {}", end.words(), self.finding_as(so_far))
            }
            Some(end) => format!("{}; {}", self.finding_as(so_far), end.words()),
        }
    }

    /// Returns the status over the time that was flown.
    fn status_so_far(&self) -> Status {
        if self.ended_early.is_none() {
            return self.status;
        }
        self.answers.iter().fold(Status::Clear, |all, answer| all.and(answer.status_so_far))
    }

    /// Returns the findings that decide a status over the time that was flown, on pairs and on limits.
    fn finding_as(&self, status: Status) -> String {
        let answers = self.answers.iter().filter(|answer| answer.status_so_far == status);
        let found = answers.filter_map(|answer| match answer.part {
            Part::Separation => Some(self.finding_of_pairs(answer, status)),
            Part::Plan => self.plan.as_ref().map(|plan| plan.brief_as(status)),
            Part::Presence => None,
            // A clear verdict names its assumptions.
            Part::PublishedPlans | Part::FlownPlans if status != Status::Clear => {
                let assumed = self.clauses(|fact| is_of_published_plan(fact) && fact.is_assumption());
                Some(iter::once(answer.brief_as(status)).chain(assumed).collect::<Vec<_>>().join(", "))
            }
            _ => Some(answer.brief_as(status)),
        });
        let found: Vec<_> = found.collect();
        let exempt = self.exemption.as_ref().map(Exemption::words);
        let in_plane = self.source.planar.then(|| "in the plane of x and y: no heights are known".to_owned());
        // All limits are kept, but a vehicle that must be present is not seen throughout.
        let nothing = found.is_empty().then(|| "not every vehicle is seen throughout".to_owned());
        found.into_iter().chain(nothing).chain(exempt).chain(in_plane).collect::<Vec<_>>().join("; ")
            + &self.window(status)
    }

    fn finding_of_pairs(&self, answer: &Answer, status: Status) -> String {
        let unit = format!(" {}", self.unit());
        let time = |finding: &Finding| seconds(finding.at_s.unwrap_or(f64::NAN));
        let delta = self.question.delta.map_or("by radii".to_owned(), |m| format!("delta {}{unit}", exact(m)));
        match status {
            Status::Clear => {
                // Vehicles and obstacles have different limits.
                let lower = |finding: &Finding| finding.value.lower_bound();
                let nearest = answer
                    .closest
                    .iter()
                    .min_by(|a, b| a.margin().total_cmp(&b.margin()).then(lower(a).total_cmp(&lower(b))));
                let closest = nearest.map_or(String::new(), |finding| {
                    let limit = finding.limit.unwrap_or_default();
                    let least = beside_limit(finding.value.lower_bound(), limit, 6);
                    let beside = match self.question.delta {
                        Some(delta) if delta != limit => format!(", limit {}{unit}", exact(limit)),
                        _ => String::new(),
                    };
                    format!("never closer than {least}{unit}, {} at {}{beside} ", finding.names(), time(finding))
                });
                let is_in_verdict = self.is_by_run() || self.source.facts.iter().any(Fact::is_assumption);
                let motion = if is_in_verdict { String::new() } else { format!(", {}", self.motion()) };
                format!("{closest}({delta}{motion}){}", self.never_with_another())
            }
            Status::Violation => {
                let listed = answer.violations.listed.iter();
                // Of equal ones the closest pair.
                let closest = answer.closest.first().map(|finding| finding.objects);
                let is_other = |finding: &Finding| Some(finding.objects) != closest;
                let deepest = listed.min_by(|a, b| {
                    a.largest_margin().total_cmp(&b.largest_margin()).then(is_other(a).cmp(&is_other(b)))
                });
                let tie = if self.is_decimal_tie { ", with decimals exactly at the limit" } else { "" };
                let others = match tally_in_words(sum([&answer.violations])) {
                    _ if answer.violations.count <= 1 => String::new(),
                    count => format!("; {count} violations in all"),
                };
                deepest.map_or(String::new(), |finding| {
                    let limit = finding.limit.unwrap_or_default();
                    format!(
                        "{} came to {}{unit} (limit {}{unit}) at {}, {}{tie}{others}",
                        finding.names(),
                        beside_limit(finding.value.upper_bound(), limit, 3),
                        exact(limit),
                        time(finding),
                        self.motion()
                    )
                })
            }
            Status::Undecided => format!("{} ({delta}, {})", self.why_undecided(answer), self.motion()),
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

    fn why_undecided(&self, answer: &Answer) -> String {
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
        let listed = answer.undecided.listed.iter();
        if let Some(finding) = listed.min_by(|a, b| a.value.lower_bound().total_cmp(&b.value.lower_bound())) {
            let rate = self
                .deciding_rate_hz
                .map_or(String::new(), |hz| format!("; sampling at {} Hz would decide", at_most(hz, 1)));
            let (names, by) = (finding.names(), seconds(finding.to_s.unwrap_or(f64::NAN)));
            let low = at_least(finding.value.lower_bound(), 6);
            return match finding.value.upper {
                Some(upper) => {
                    format!("{names} came to between {low}{unit} and {}{unit} by {by}{rate}", at_most(upper, 6))
                }
                None => format!("the distance of {names} at {by} is unknown"),
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
                let (count, time) = (tally_in_words(self.gaps_tally), seconds(finding.from_s));
                format!("{count} gaps, the first of {vehicle} at {time}; {joined}")
            }
        }
    }

    /// Returns the sections of the text and of the page.
    fn sections(&self) -> Vec<Section> {
        let columns = &["what", "worst", "vehicle", "at [s]", "limit", "verdict"];
        let limits = self.answers.iter().filter_map(|answer| match answer.part {
            Part::Limit(limit) => Some(answer.row(limit)),
            _ => None,
        });
        let presence = &self.presence;
        let seen = format!("{} seen throughout, {} not", presence.throughout, presence.partly);
        // The plan has sections of its own.
        let answers = || self.answers.iter().filter(|answer| answer.part != Part::Plan);
        let [violations, undecided] = lists(answers);
        let closest = |is_of_obstacle| self.separation().map(|answer| closest_table(answer, is_of_obstacle));
        let of_plans =
            self.answers.iter().filter(|answer| matches!(answer.part, Part::PublishedPlans | Part::FlownPlans));
        let of_plans = of_plans.map(|answer| closest_table(answer, false));
        let sections = [
            Section::table("Each vehicle by itself", "limits, and the vehicles closest to them", columns, limits),
            Section::list(
                "Presence",
                seen,
                presence.listed.iter().map(VehicleFinding::<PresenceSpan>::words).collect(),
            )
            .of_all(presence.partly),
            violations,
            undecided,
            Section::list(
                "Gaps",
                shortened_in_words(self.gaps_tally),
                self.gaps.iter().map(VehicleFinding::<Gap>::words).collect(),
            ),
        ];
        let against_plan = self.plan.iter().flat_map(PlanReport::sections);
        let closest = [closest(false), closest(true)].into_iter().flatten();
        closest.chain(of_plans).chain(sections).chain(against_plan).filter(|section| !section.rows.is_empty()).collect()
    }

    /// Returns the lists that are cut, a sentence each.
    #[must_use]
    pub fn shortened(&self) -> Vec<String> {
        let of_parts = self.answers.iter().flat_map(|answer| {
            let [violations, undecided] = match answer.part {
                Part::Limit(limit) => {
                    ["violations", "undecided times"].map(|what| format!("{what} of {}", limit.quantity.key()))
                }
                Part::WellClear(_) => ["losses of well clear", "undecided times of well clear"].map(str::to_owned),
                Part::PublishedPlans => {
                    ["violations of published plans", "undecided times of published plans"].map(str::to_owned)
                }
                Part::FlownPlans => {
                    ["violations of plans and flights", "undecided times of plans and flights"].map(str::to_owned)
                }
                _ => ["violations", "undecided times"].map(str::to_owned),
            };
            [(violations, sum([&answer.violations])), (undecided, sum([&answer.undecided]))]
        });
        let all = of_parts.chain([("gaps".to_owned(), self.gaps_tally)]);
        all.filter(|(_, tally)| tally.is_shortened())
            .map(|(what, tally)| {
                let (count, listed) = (tally_in_words(tally), tally.listed);
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
        iter::once(judged).chain(lines).map(|line| one_line(&line) + "\n").collect()
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
        let word = match self.status {
            Status::Clear if self.is_proved() => "PROVED CLEAR",
            Status::Clear => "CLEAR",
            Status::Violation => "VIOLATION",
            Status::Undecided => "UNDECIDED",
        };
        let badge = Badge { tone, word: word.to_owned() };
        // Conditions are as long as the user's names: they follow the badge.
        let headline = self.headline();
        let rest = headline.strip_prefix(word).unwrap_or(&headline).trim_start_matches([':', ' ']).to_owned();
        let mut page = Page::new("Audit of a recording", self.source.recording.clone(), badge, rest);
        page.replay = Some(page::replay(&self.source.recording, replay, Start::AtViolation));
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
    ) || is_of_plan(fact)
        || fact.kind == FactKind::Motion && fact.subject.is_some()
}

/// Returns whether a fact is about the plans of planners.
fn is_of_published_plan(fact: &Fact) -> bool {
    matches!(fact.kind, FactKind::PlanEnd | FactKind::PlanPublication | FactKind::FlownPlans)
}

/// Returns whether a fact is about the samples of the plan.
fn is_of_plan(fact: &Fact) -> bool {
    let is_of_samples = matches!(
        fact.kind,
        FactKind::HeightUnit
            | FactKind::CommonStart
            | FactKind::GpsClocks
            | FactKind::LogTimes
            | FactKind::UniformTransforms
    );
    is_of_samples && fact.subject.as_deref() == Some(THE_PLAN)
}

impl Corners {
    /// Returns the assumption on corners in a clause.
    fn words(&self) -> String {
        let VehicleFinding { vehicle, finding } = &self.largest;
        let (count, jump) = (counted(self.count, "corner", "corners"), at_most(finding.by_m_s, 3));
        let time = seconds(finding.at_s);
        format!(
            "vehicles round off {count} (velocity jumps by at most {jump} m/s, {vehicle} at {time}; {ACCEL_WINDOW} \
             judges them)"
        )
    }
}

impl RunObjection {
    /// Returns the objection in a clause.
    fn words(&self) -> String {
        match self {
            Self::RunUndecided {} => "the run's own audit of every step is undecided (see its report.json)".to_owned(),
            Self::RunFoundCloser { who: [first, second], min, unit, at_s } => {
                let (min, time) = (at_least(*min, 3), seconds(*at_s));
                format!("the run's audit of every step found {first} and {second} {min} {unit} apart at {time}")
            }
        }
    }
}

/// Puts text with foreign names on one line, without control characters that change the direction of reading.
fn one_line(words: &str) -> String {
    in_order(words).chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect()
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
