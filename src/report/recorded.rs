//! The report on a recording: as JSON, in words, and as a page.
//!
//! `separation` and `audit` have the keys of a flight's `report.json`; what a recording adds stands beside them.

use std::fmt::Write as _;

use serde::Serialize;

use super::findings::finite;
use super::flight::{Audit, ClosedForm, Parry, Rapier, SCHEMA_VERSION};
use super::page::{Badge, Block, Column, Page, Section, Table, Tone};
use crate::audit::recorded::{self, Approach, Outcome, Question, Who};
use crate::audit::{Status, Violation};
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
    pub separation: Separation,
    /// What the judgement rests on.
    pub audit: Audit,
    /// Every violation, of pairs and of obstacles, in order of time.
    pub violations: Vec<Breach>,
    /// The ten closest pairs.
    pub closest: Vec<Closest>,
    /// What obstacles were in the way of.
    pub obstacles: Obstacles,
    /// When vehicles were not seen.
    pub gaps: Vec<Gap>,
    /// When it cannot be told whether two came too close.
    pub undecided: Vec<Undecided>,
    /// Where the recording contradicts the assumed bound on acceleration.
    pub contradiction: Option<Contradiction>,
}

/// How close vehicles came, by the keys of a flight's report.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Separation {
    /// Safety distance delta \[m\]; none where radii alone were asked about.
    pub delta_m: Option<f64>,
    /// Smallest distance of two vehicles \[m\].
    pub min_m: Option<f64>,
    /// When it occurred \[s\].
    pub min_at_s: Option<f64>,
    /// Which pair.
    pub min_pair: Option<[usize; 2]>,
    /// Of flights alone.
    pub certified_m: Option<f64>,
    /// Of flights alone.
    pub certificate_void: Vec<String>,
}

/// The closest that two came.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Closest {
    /// Their names.
    pub who: [String; 2],
    /// It is at least this \[m\].
    pub lower_m: f64,
    /// And at most this \[m\].
    pub upper_m: f64,
    /// When \[s\].
    pub time_s: f64,
    /// What it must not fall below \[m\].
    pub limit_m: f64,
}

/// Obstacles and who came close to them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Obstacles {
    /// The ten closest approaches.
    pub closest: Vec<Closest>,
    /// Every time that a vehicle was too close to one.
    pub violations: Vec<Breach>,
}

/// A time during which two were too close, by their names.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Breach {
    /// Their names.
    pub who: [String; 2],
    /// When it began \[s\].
    pub from_s: f64,
    /// When it ended \[s\].
    pub to_s: f64,
    /// Smallest distance within \[m\].
    pub min_m: f64,
    /// When that was \[s\].
    pub min_at_s: f64,
    /// What it must not fall below \[m\].
    pub limit_m: f64,
}

/// A time during which a vehicle was not seen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// The vehicle.
    pub vehicle: String,
    /// Last seen \[s\].
    pub from_s: f64,
    /// Seen again \[s\].
    pub to_s: f64,
}

/// A time over which it cannot be told whether two came too close.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Undecided {
    /// Their names.
    pub who: [String; 2],
    /// From \[s\].
    pub from_s: f64,
    /// To \[s\].
    pub to_s: f64,
    /// Their distance is at least this \[m\].
    pub lower_m: f64,
    /// Its smallest value is at most this \[m\].
    pub upper_m: f64,
    /// What it must not fall below \[m\].
    pub limit_m: f64,
    /// The sampling rate that would decide \[Hz\].
    pub rate_hz: Option<f64>,
}

/// Where the recording needs more acceleration than was assumed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Contradiction {
    /// The vehicle.
    pub vehicle: String,
    /// When \[s\].
    pub time_s: f64,
    /// What it needs \[m/s^2\].
    pub needs_m_s2: f64,
    /// What was assumed \[m/s^2\].
    pub assumed_m_s2: f64,
}

impl RecordedReport {
    /// The report on an outcome.
    #[must_use]
    pub fn new(outcome: &Outcome, question: &Question, source: Source, motion: &str) -> Self {
        let name = |vehicle: usize| outcome.vehicles.get(vehicle).cloned().unwrap_or_else(|| (vehicle + 1).to_string());
        let names = |who: Who| match who {
            Who::Pair(pair) => [name(pair.first()), name(pair.second())],
            Who::Obstacle { vehicle, obstacle } => {
                [name(vehicle), question.obstacles.get(obstacle).map_or(String::new(), |thing| thing.name.clone())]
            }
        };
        let closest = |approach: &Approach| Closest {
            who: names(approach.who),
            lower_m: approach.lower_m,
            upper_m: approach.upper_m,
            time_s: approach.time_s,
            limit_m: approach.limit_m,
        };
        let breach = |v: &recorded::Violation| Breach {
            who: names(v.who),
            from_s: v.from_s,
            to_s: v.to_s,
            min_m: v.min_m,
            min_at_s: v.min_at_s,
            limit_m: v.limit_m,
        };
        let is_pair = |who: Who| matches!(who, Who::Pair(_));
        let first = outcome.closest.first();
        let scaled = question.ellipsoid_m.is_some();
        let min_m = first.and_then(|first| finite(first.certain_m()));
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
                delta_m: question.delta_m.or(scaled.then_some(recorded::TOUCHING_ELLIPSOIDS)),
                min_m,
                min_at_s: first.and_then(|first| finite(first.time_s)),
                min_pair: first.and_then(|first| first.who.pair()).map(Pair::numbers),
                ..Separation::default()
            },
            audit: Audit {
                status: outcome.status,
                violations: outcome.violations.iter().filter_map(violation).collect(),
                steps: outcome.stretches,
                pairs_checked: outcome.swept,
                closed_form: ClosedForm { min_m },
                parry: Parry { min_toi_s: outcome.min_toi_s.and_then(finite), disagreements: outcome.disagreements },
                rapier: Rapier { contact_pairs: None },
            },
            violations: outcome.violations.iter().map(breach).collect(),
            closest: outcome.closest.iter().map(closest).collect(),
            obstacles: Obstacles {
                closest: outcome.obstacles.iter().map(closest).collect(),
                violations: outcome.violations.iter().filter(|v| !is_pair(v.who)).map(breach).collect(),
            },
            gaps: outcome
                .gaps
                .iter()
                .map(|gap| Gap { vehicle: name(gap.vehicle), from_s: gap.from_s, to_s: gap.to_s })
                .collect(),
            undecided: outcome
                .undecided
                .iter()
                .map(|u| Undecided {
                    who: names(u.who),
                    from_s: u.from_s,
                    to_s: u.to_s,
                    lower_m: u.lower_m,
                    upper_m: u.upper_m,
                    limit_m: u.limit_m,
                    rate_hz: u.rate_hz.and_then(finite),
                })
                .collect(),
            contradiction: outcome.contradiction.map(|c| Contradiction {
                vehicle: name(c.vehicle),
                time_s: c.time_s,
                needs_m_s2: c.needs_m_s2,
                assumed_m_s2: c.assumed_m_s2,
            }),
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
                let closest = all.min_by(|a, b| a.lower_m.total_cmp(&b.lower_m)).map_or_else(
                    || "at no time were there two vehicles to keep apart".to_owned(),
                    |closest| {
                        let [first, second] = &closest.who;
                        let at = seconds(closest.time_s);
                        format!(
                            "never closer than {}{unit}, {first} and {second} at {at}",
                            at_least(closest.lower_m, 6)
                        )
                    },
                );
                format!("{closest} ({delta}, {})", self.motion)
            }
            Status::Violation => {
                let violations = &self.violations;
                let deepest = violations.iter().min_by(|a, b| (a.min_m - a.limit_m).total_cmp(&(b.min_m - b.limit_m)));
                let others = match violations.len() {
                    0 | 1 => String::new(),
                    count => format!("; {count} violations in all"),
                };
                deepest.map_or(String::new(), |b| {
                    let [first, second] = &b.who;
                    format!(
                        "{first} and {second} came to {}{unit} (limit {}{unit}) at {}, {}{others}",
                        metres_below(b.min_m, b.limit_m),
                        metres(b.limit_m),
                        seconds(b.min_at_s),
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
        if let Some(c) = &self.contradiction {
            return format!(
                "{} needs {} m/s^2 at {}, more than the assumed {:?} m/s^2",
                c.vehicle,
                fixed(c.needs_m_s2, 3),
                seconds(c.time_s),
                c.assumed_m_s2
            );
        }
        if let Some(u) = self.undecided.iter().min_by(|a, b| a.lower_m.total_cmp(&b.lower_m)) {
            let [first, second] = &u.who;
            let rate =
                self.rate_hz().map_or(String::new(), |hz| format!("; sampling at {} Hz would decide", fixed(hz, 1)));
            return format!(
                "{first} and {second} came to between {}{unit} and {}{unit} by {}{rate}",
                at_least(u.lower_m, 6),
                metres(u.upper_m),
                seconds(u.to_s)
            );
        }
        match &self.gaps[..] {
            [] => "there was nothing to judge".to_owned(),
            [gap] => format!("{} was not seen from {} to {}", gap.vehicle, seconds(gap.from_s), seconds(gap.to_s)),
            [gap, ..] => format!("{} gaps, the first of {} at {}", self.gaps.len(), gap.vehicle, seconds(gap.from_s)),
        }
    }

    /// The sampling rate that would decide everything undecided \[Hz\]; `None` where some of it no rate is known for.
    fn rate_hz(&self) -> Option<f64> {
        self.undecided.iter().map(|u| u.rate_hz).try_fold(0.0, |most: f64, rate| Some(most.max(rate?)))
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
            for c in closest {
                let [first, second] = &c.who;
                let at = fixed(c.time_s, 3);
                line(format!("  {}  at {at} s  {first} and {second}", interval(c.lower_m, c.upper_m)));
            }
        }
        let mut list = |heading: &str, lines: Vec<String>| {
            if !lines.is_empty() {
                line(format!("{heading}: {}", lines.len()));
            }
            let rest = lines.len().saturating_sub(LISTED_IN_WORDS);
            for words in lines.into_iter().take(LISTED_IN_WORDS) {
                line(format!("  {words}"));
            }
            if rest > 0 {
                line(format!("  and {rest} more"));
            }
        };
        list("violations", self.violations.iter().map(Breach::words).collect());
        list("undecided", self.undecided.iter().map(Undecided::words).collect());
        list("gaps", self.gaps.iter().map(Gap::words).collect());
        text
    }

    /// The report as a self-contained HTML page.
    #[must_use]
    pub fn to_html(&self, figures: &[Figure], command: &str) -> String {
        let mut sections = Vec::new();
        if !self.closest.is_empty() {
            sections.push(Section::new("Closest pairs", vec![Block::Table(closest_table(&self.closest))]));
        }
        if !figures.is_empty() {
            sections.push(Section::new("Figures", vec![Block::Figures(figures.to_vec())]));
        }
        if !self.obstacles.closest.is_empty() {
            sections.push(Section::new("Obstacles", vec![Block::Table(closest_table(&self.obstacles.closest))]));
        }
        let lists = [
            ("Violations", self.violations.iter().map(Breach::words).collect::<Vec<_>>()),
            ("Undecided", self.undecided.iter().map(Undecided::words).collect()),
            ("Gaps", self.gaps.iter().map(Gap::words).collect()),
            ("How it was read", self.source.notes.clone()),
        ];
        for (heading, mut lines) in lists {
            let rest = lines.len().saturating_sub(LISTED_ON_PAGE);
            lines.truncate(LISTED_ON_PAGE);
            if rest > 0 {
                lines.push(format!("and {rest} more"));
            }
            if !lines.is_empty() {
                sections.push(Section::new(heading, vec![Block::List(lines)]));
            }
        }
        let assumed = vec![
            format!("Motion: {}.", self.motion),
            "A distance strictly below its limit is a violation; equality is not.".to_owned(),
            format!("Time 0 s is {} ns on the recording's clock.", self.source.clock.epoch_ns),
        ];
        sections.push(Section::new("What was assumed", vec![Block::List(assumed)]));
        sections.push(Section::new("Repeat it", vec![Block::Command(command.to_owned())]));
        let tone = match self.status {
            Status::Clear => Tone::Good,
            Status::Violation => Tone::Bad,
            Status::Undecided => Tone::Neutral,
        };
        Page {
            title: self.source.recording.clone(),
            kind: "Audit of a recording".to_owned(),
            badge: Badge { tone, word: self.verdict().to_owned() },
            verdict: self.finding(),
            reasons: Vec::new(),
            warnings: Vec::new(),
            sections,
            foot: format!("Made by {} {}.", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION")),
        }
        .render()
    }
}

fn violation(violation: &recorded::Violation) -> Option<Violation> {
    let recorded::Violation { from_s, to_s, min_m, min_at_s, .. } = *violation;
    Some(Violation { pair: violation.who.pair()?, from_s, to_s, min_m, min_at_s })
}

impl Breach {
    fn words(&self) -> String {
        let [first, second] = &self.who;
        let min = metres_below(self.min_m, self.limit_m);
        format!(
            "{first} and {second}: {min} at {} s, below {} from {}",
            fixed(self.min_at_s, 3),
            metres(self.limit_m),
            span(self.from_s, self.to_s)
        )
    }
}

impl Undecided {
    fn words(&self) -> String {
        let [first, second] = &self.who;
        let rate = self.rate_hz.map_or(String::new(), |hz| format!("; {} Hz would decide", fixed(hz, 1)));
        format!(
            "{first} and {second}: {} from {}, limit {}{rate}",
            interval(self.lower_m, self.upper_m),
            span(self.from_s, self.to_s),
            metres(self.limit_m)
        )
    }
}

impl Gap {
    fn words(&self) -> String {
        format!("{} was not seen from {}", self.vehicle, span(self.from_s, self.to_s))
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
    if upper - lower <= 2.0 * recorded::WIDTH_M || low == high { low } else { format!("{low} .. {high}") }
}

fn closest_table(closest: &[Closest]) -> Table {
    let rows = closest.iter().map(|c| {
        let [first, second] = &c.who;
        vec![
            format!("{first} and {second}").into(),
            interval(c.lower_m, c.upper_m).into(),
            fixed(c.time_s, 3).into(),
            metres(c.limit_m).into(),
        ]
    });
    Table {
        caption: "Who came closest, and when".to_owned(),
        columns: vec![
            Column::words("who"),
            Column::numbers("smallest distance"),
            Column::numbers("at [s]"),
            Column::numbers("limit"),
        ],
        rows: rows.collect(),
    }
}
