//! The report on a recording: as JSON, in words, and as a page.
//!
//! `separation` and `audit` have the keys of a flight's `report.json`; what a recording adds stands beside them.

use std::fmt::Write as _;

use serde::Serialize;

use super::findings::finite;
use super::flight::{self, Audit, ClosedForm, Parry, Rapier, SCHEMA_VERSION, Separation};
use super::page::{self, Badge, Markup, Page, Tone, section};
use crate::audit::recorded::{
    Approach, Contradiction, Gap, ObjectPair, Outcome, Settings, TOUCHING_ELLIPSOIDS, WIDTH_M,
};
use crate::audit::{Status, Undecided, Violation};
use crate::figures::Figure;
use crate::swarm::Pair;
use crate::text::{at_least, counted, fixed, metres, metres_below, seconds};

/// Violations that are listed in words, and on the page.
const LISTED_IN_WORDS: usize = 10;
const LISTED_ON_PAGE: usize = 100;

/// What was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Source {
    /// The recording.
    pub recording: String,
    /// How it counts time.
    pub clock: Clock,
    /// How it was read, a sentence each.
    pub notes: Vec<String>,
}

/// How a recording counts time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Clock {
    /// The unit: `s`, `ms`, `us` or `ns`.
    pub unit: String,
    /// Whether it was inferred from the numbers.
    pub inferred: bool,
    /// The instant that is 0 s in this report, on the recording's clock \[ns\].
    pub epoch_ns: i64,
}

/// The content of `tautline audit --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RecordedReport {
    /// Version of the keys.
    pub schema_version: u32,
    /// The verdict.
    pub status: Status,
    /// What was read.
    #[serde(flatten)]
    pub source: Source,
    /// `metres`, or `ellipsoids` where lengths are divided by the axes of the ellipsoid.
    pub measure: &'static str,
    /// What was taken to happen between samples.
    pub motion: String,
    /// Names of the vehicles; numbers of pairs count them from 1.
    pub vehicles: Vec<String>,
    /// How many of them were judged: asked for, and there.
    pub judged: usize,
    /// First and last instant judged \[s\].
    pub span_s: Option<(f64, f64)>,
    /// How close vehicles came.
    pub separation: Separation<Option<f64>>,
    /// What the judgement rests on.
    pub audit: Audit,
    /// Every violation, of pairs and of obstacles, in order of time.
    pub violations: Vec<OfPair<Violation<ObjectPair>>>,
    /// The ten closest pairs.
    pub closest: Vec<OfPair<Approach>>,
    /// What obstacles were in the way of.
    pub obstacles: Obstacles,
    /// When vehicles were not seen.
    pub gaps: Vec<OfVehicle<Gap>>,
    /// When it cannot be told whether two came too close.
    pub undecided: Vec<OfPair<Undecided<ObjectPair>>>,
    /// Where the recording contradicts the assumed bound on acceleration.
    pub contradiction: Option<OfVehicle<Contradiction>>,
}

/// A finding on a pair, with their names.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfPair<T> {
    /// Their names.
    pub who: [String; 2],
    /// What was found.
    #[serde(flatten)]
    pub finding: T,
}

/// A finding on a vehicle, with its name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfVehicle<T> {
    /// Its name.
    pub vehicle: String,
    /// What was found.
    #[serde(flatten)]
    pub finding: T,
}

/// Obstacles and who came close to them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Obstacles {
    /// The ten closest approaches.
    pub closest: Vec<OfPair<Approach>>,
    /// Every time that a vehicle was too close to one.
    pub violations: Vec<OfPair<Violation<ObjectPair>>>,
}

impl RecordedReport {
    /// The report on an outcome.
    #[must_use]
    pub fn new(outcome: &Outcome, settings: &Settings, source: Source, motion: &str) -> Self {
        let first = outcome.closest.first();
        let scaled = settings.ellipsoid_m.is_some();
        let min_m = first.and_then(|first| finite(first.certain_m()));
        let names = |pair: ObjectPair| outcome.names(pair, &settings.obstacles);
        let closest = |of: &[Approach]| of.iter().map(|a| OfPair { who: names(a.pair), finding: *a }).collect();
        let violations: Vec<_> =
            outcome.violations.iter().map(|v| OfPair { who: names(v.pair), finding: *v }).collect();
        Self {
            schema_version: SCHEMA_VERSION,
            status: outcome.status,
            source,
            measure: if scaled { "ellipsoids" } else { "metres" },
            motion: motion.to_owned(),
            vehicles: outcome.vehicles.clone(),
            judged: outcome.presence.iter().flatten().count(),
            span_s: outcome.span_s,
            separation: Separation {
                delta_m: settings.delta_m.or(scaled.then_some(TOUCHING_ELLIPSOIDS)),
                min_m,
                min_at_s: first.and_then(|first| finite(first.time_s)),
                min_pair: first.and_then(|first| first.pair.vehicles()).map(Pair::numbers),
                certified_m: None,
                certificate_void: Vec::new(),
            },
            audit: Audit {
                status: outcome.status,
                violations: outcome
                    .violations
                    .iter()
                    .filter_map(|v| Some(flight::Violation::new(v.pair.vehicles()?, v)))
                    .collect(),
                steps: outcome.segments,
                pairs_checked: outcome.swept,
                closed_form: ClosedForm { min_m },
                parry: Parry {
                    min_toi_s: outcome.parry.min_toi_s.and_then(finite),
                    disagreements: outcome.parry.disagreements,
                },
                rapier: Rapier { contact_pairs: None },
            },
            closest: closest(&outcome.closest),
            obstacles: Obstacles {
                closest: closest(&outcome.obstacles),
                violations: violations.iter().filter(|v| v.finding.pair.vehicles().is_none()).cloned().collect(),
            },
            violations,
            gaps: outcome
                .gaps
                .iter()
                .map(|gap| OfVehicle { vehicle: outcome.name(gap.vehicle), finding: *gap })
                .collect(),
            undecided: outcome.undecided.iter().map(|u| OfPair { who: names(u.pair), finding: *u }).collect(),
            contradiction: outcome
                .contradiction
                .map(|finding| OfVehicle { vehicle: outcome.name(finding.vehicle), finding }),
        }
    }

    /// The report as indented JSON with a line end.
    ///
    /// # Errors
    /// None in practice: every key is a string and every value has a JSON form.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    fn unit(&self) -> &'static str {
        if self.measure == "metres" { " m" } else { " ellipsoids" }
    }

    /// The verdict in one line.
    #[must_use]
    pub fn headline(&self) -> String {
        format!("{}: {}", self.verdict(), self.finding())
    }

    fn verdict(&self) -> &'static str {
        match self.status {
            Status::Clear => "PROVED CLEAR",
            Status::Violation => "VIOLATION",
            Status::Undecided => "UNDECIDED",
        }
    }

    /// The headline behind the verdict.
    fn finding(&self) -> String {
        let unit = self.unit();
        let delta = self.separation.delta_m.map_or("by radii".to_owned(), |m| format!("delta {}{unit}", metres(m)));
        match self.status {
            Status::Clear => {
                let all = self.closest.iter().chain(&self.obstacles.closest);
                let lowest = all.min_by(|a, b| a.finding.lower_m.total_cmp(&b.finding.lower_m));
                let closest = lowest.map_or_else(
                    || "at no time were there two vehicles to keep apart".to_owned(),
                    |OfPair { who: [first, second], finding }| {
                        let (least, at) = (at_least(finding.lower_m, 6), seconds(finding.time_s));
                        format!("never closer than {least}{unit}, {first} and {second} at {at}")
                    },
                );
                format!("{closest} ({delta}, {})", self.motion)
            }
            Status::Violation => {
                let over = |of: &OfPair<Violation<ObjectPair>>| of.finding.min_m - of.finding.limit_m;
                let deepest = self.violations.iter().min_by(|a, b| over(a).total_cmp(&over(b)));
                let others = match self.violations.len() {
                    0 | 1 => String::new(),
                    count => format!("; {count} violations in all"),
                };
                deepest.map_or(String::new(), |OfPair { who: [first, second], finding }| {
                    format!(
                        "{first} and {second} came to {}{unit} (limit {}{unit}) at {}, {}{others}",
                        metres_below(finding.min_m, finding.limit_m),
                        metres(finding.limit_m),
                        seconds(finding.min_at_s),
                        self.motion
                    )
                })
            }
            Status::Undecided => format!("{} ({delta}, {})", self.why_undecided(), self.motion),
        }
    }

    fn why_undecided(&self) -> String {
        let unit = self.unit();
        if self.audit.parry.disagreements > 0 {
            return "the two detectors disagree".to_owned();
        }
        if let Some(OfVehicle { vehicle, finding }) = &self.contradiction {
            return format!(
                "{vehicle} needs {} m/s^2 at {}, more than the assumed {:?} m/s^2",
                fixed(finding.needs_m_s2, 3),
                seconds(finding.time_s),
                finding.assumed_m_s2
            );
        }
        let closest = self.undecided.iter().min_by(|a, b| a.finding.lower_m.total_cmp(&b.finding.lower_m));
        if let Some(OfPair { who: [first, second], finding }) = closest {
            let rate =
                self.rate_hz().map_or(String::new(), |hz| format!("; sampling at {} Hz would decide", fixed(hz, 1)));
            return format!(
                "{first} and {second} came to between {}{unit} and {}{unit} by {}{rate}",
                at_least(finding.lower_m, 6),
                metres(finding.upper_m),
                seconds(finding.to_s)
            );
        }
        let Some(OfVehicle { vehicle, finding: Gap { from_s, to_s, .. } }) = self.gaps.first() else {
            return "there was nothing to judge".to_owned();
        };
        match self.gaps.len() {
            1 => format!("{vehicle} was not seen from {} to {}", seconds(*from_s), seconds(*to_s)),
            count => format!("{count} gaps, the first of {vehicle} at {}", seconds(*from_s)),
        }
    }

    /// The sampling rate that would decide everything undecided \[Hz\]; `None` where some of it no rate is known for.
    fn rate_hz(&self) -> Option<f64> {
        self.undecided.iter().map(|u| u.finding.rate_hz).try_fold(0.0, |most: f64, rate| Some(most.max(rate?)))
    }

    /// What was found of each kind, a sentence each.
    fn lists(&self) -> [(&'static str, Vec<String>); 3] {
        [
            ("Violations", self.violations.iter().map(OfPair::<Violation<_>>::words).collect()),
            ("Undecided", self.undecided.iter().map(OfPair::<Undecided<_>>::words).collect()),
            ("Gaps", self.gaps.iter().map(OfVehicle::words).collect()),
        ]
    }

    /// The closest pairs and what was found, a line each, with a line end.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let mut line = |words: String| {
            let _ = writeln!(text, "{words}");
        };
        let span = self.span_s.map_or("nothing".to_owned(), |(from_s, to_s)| span(from_s, to_s));
        line(format!(
            "judged       {span}, {}, {} of motion, {} swept",
            counted(self.judged as u64, "vehicle", "vehicles"),
            counted(self.audit.steps, "stretch", "stretches"),
            self.audit.pairs_checked
        ));
        for (heading, closest) in [("closest pairs", &self.closest), ("closest to obstacles", &self.obstacles.closest)]
        {
            if !closest.is_empty() {
                line(format!("{heading} [{}]", self.unit().trim()));
            }
            for OfPair { who: [first, second], finding } in closest {
                let (apart, at) = (interval(finding.lower_m, finding.upper_m), fixed(finding.time_s, 3));
                line(format!("  {apart}  at {at} s  {first} and {second}"));
            }
        }
        for (heading, lines) in self.lists() {
            if !lines.is_empty() {
                line(format!("{}: {}", heading.to_lowercase(), lines.len()));
            }
            listed(lines, LISTED_IN_WORDS).for_each(|words| line(format!("  {words}")));
        }
        text
    }

    /// The report as a self-contained HTML page.
    #[must_use]
    pub fn to_html(&self, figures: &[Figure], command: &str) -> String {
        let mut sections = Vec::new();
        if !self.closest.is_empty() {
            sections.push(section("Closest pairs", &[closest_table(&self.closest)]));
        }
        if !figures.is_empty() {
            sections.push(section("Figures", &[page::figures(figures)]));
        }
        if !self.obstacles.closest.is_empty() {
            sections.push(section("Obstacles", &[closest_table(&self.obstacles.closest)]));
        }
        for (heading, lines) in self.lists().into_iter().chain([("How it was read", self.source.notes.clone())]) {
            if !lines.is_empty() {
                let lines: Vec<_> = listed(lines, LISTED_ON_PAGE).collect();
                sections.push(section(heading, &[page::list(&lines)]));
            }
        }
        let assumed = [
            format!("Motion: {}.", self.motion),
            "A distance strictly below its limit is a violation; equality is not.".to_owned(),
            format!("Time 0 s is {} ns on the recording's clock.", self.source.clock.epoch_ns),
        ];
        sections.push(section("What was assumed", &[page::list(&assumed)]));
        sections.push(section("Repeat it", &[page::command(command)]));
        let tone = match self.status {
            Status::Clear => Tone::Good,
            Status::Violation => Tone::Bad,
            Status::Undecided => Tone::Neutral,
        };
        Page {
            title: self.source.recording.clone(),
            kind: "Audit of a recording",
            badge: Badge { tone, word: self.verdict() },
            verdict: self.finding(),
            reasons: Vec::new(),
            warnings: Vec::new(),
            sections,
        }
        .render()
    }
}

/// The first of some lines, and how many more there are.
fn listed(mut lines: Vec<String>, most: usize) -> impl Iterator<Item = String> {
    let rest = lines.len().saturating_sub(most);
    lines.truncate(most);
    lines.into_iter().chain((rest > 0).then(|| format!("and {rest} more")))
}

impl OfPair<Violation<ObjectPair>> {
    fn words(&self) -> String {
        let Self { who: [first, second], finding } = self;
        let min = metres_below(finding.min_m, finding.limit_m);
        format!(
            "{first} and {second}: {min} at {} s, below {} from {}",
            fixed(finding.min_at_s, 3),
            metres(finding.limit_m),
            span(finding.from_s, finding.to_s)
        )
    }
}

impl OfPair<Undecided<ObjectPair>> {
    fn words(&self) -> String {
        let Self { who: [first, second], finding } = self;
        let rate = finding.rate_hz.map_or(String::new(), |hz| format!("; {} Hz would decide", fixed(hz, 1)));
        format!(
            "{first} and {second}: {} from {}, limit {}{rate}",
            interval(finding.lower_m, finding.upper_m),
            span(finding.from_s, finding.to_s),
            metres(finding.limit_m)
        )
    }
}

impl OfVehicle<Gap> {
    fn words(&self) -> String {
        format!("{} was not seen from {}", self.vehicle, span(self.finding.from_s, self.finding.to_s))
    }
}

/// Two times in words.
fn span(from_s: f64, to_s: f64) -> String {
    format!("{} s to {} s", fixed(from_s, 3), fixed(to_s, 3))
}

/// A distance with six decimals, rounded down, or an interval where its bounds differ.
#[must_use]
pub fn interval(lower: f64, upper: f64) -> String {
    let (low, high) = (at_least(lower, 6), fixed(upper, 6));
    if upper - lower <= 2.0 * WIDTH_M || low == high { low } else { format!("{low} .. {high}") }
}

fn closest_table(closest: &[OfPair<Approach>]) -> Markup {
    let row = |OfPair { who: [first, second], finding }: &OfPair<Approach>| {
        let apart = interval(finding.lower_m, finding.upper_m);
        [format!("{first} and {second}"), apart, fixed(finding.time_s, 3), metres(finding.limit_m)]
    };
    let columns = ["who", "smallest distance", "at [s]", "limit"];
    page::numbers("Who came closest, and when", &columns, closest.iter().map(row))
}
