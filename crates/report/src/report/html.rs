//! `report.html`: the page of a run.

use maud::{Markup, html};

use super::findings::{closest_table, lists};
use super::flight::Report;
use super::page::{self, Badge, Page, Picture, Start, Tone};
use super::section::Section;
use crate::figures::Figure;
use crate::replay::{NoReplay, Replay};
use tautline_audit::Status;
use tautline_core::fact::Coded;
use tautline_core::swarm::Bounce;
use tautline_core::text::{seconds, significant, up_to};
use tautline_laws::formation::Freedom;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::{PlantSpec, Scenario};
use tautline_sim::vehicle::Airframe;

/// Largest number of violations, and of collisions of hulls, in a list.
const LISTED: usize = 50;

/// Largest size of the scenario on a page \[bytes\].
const LONGEST_SCENARIO: usize = 100_000;

/// Content of the page of a run beside its report.
#[derive(Clone, Copy, Debug)]
pub struct RunPage<'a> {
    /// Scenario of the flight.
    pub scenario: &'a Scenario,
    /// Findings of the check before the first step.
    pub preflight: &'a Preflight,
    /// Replay of the flight, or the reason why there is no replay.
    pub replay: &'a Result<Replay, NoReplay>,
    /// Charts of the run.
    pub figures: &'a [Figure],
    /// Pictures of the run.
    pub pictures: &'a [Picture],
    /// Command that repeats the run.
    pub command: &'a str,
    /// Changes of keys of the scenario's file.
    pub changes: &'a [String],
}

impl RunPage<'_> {
    /// Returns the law that flew and the changed keys, in a sentence.
    fn setup(&self) -> String {
        let law = self.scenario.flown_law().map_or_else(|error| error.to_string(), |law| law.name().to_owned());
        let shield = if self.scenario.shield.is_some() { ", with a shield" } else { "" };
        let changes = if self.changes.is_empty() {
            String::new()
        } else {
            format!(" Changed keys: {}.", self.changes.join(", "))
        };
        format!("Law: {law}{shield}.{changes}")
    }
}

impl Report {
    /// Returns the report as a self-contained HTML page.
    ///
    /// Two runs of one scenario give the same bytes except for the last section, the performance.
    #[must_use]
    pub fn to_html(&self, about: &RunPage<'_>) -> String {
        let tone = match self.answer.status {
            _ if self.verdict.pass => Tone::Good,
            Status::Undecided => Tone::Neutral,
            Status::Clear | Status::Violation => Tone::Bad,
        };
        let headline = self.headline();
        let (word, rest) = headline.split_once(": ").unwrap_or((&headline, ""));
        let badge = Badge { tone, word: word.to_owned() };
        let mut page = Page::new("Flight report", self.scenario.name.clone(), badge, rest.to_owned());
        page.setup = about.setup();
        page.reasons = self.reasons_beside_headline();
        let warnings = about.preflight.warnings.iter();
        page.warnings = warnings.map(|of| (of.code.code().to_owned(), of.message.clone())).collect();
        page.replay = Some(page::replay(&self.scenario.name, about.replay, Start::AtOnce));
        let rows = self.rows().into_iter().map(<[String; 2]>::from);
        page.add(
            "Findings",
            "What the flight and its audit gave, part by part; report.json has all numbers.",
            [page::words("Findings by part", &["Part", "Finding"], rows)],
        );
        page.sections.extend(self.sections().iter().map(|section| section.html(LISTED)));
        page.add(
            "Pictures",
            "The vehicles at some moments of the flight, each in the shell that must stay free.",
            [page::pictures(about.pictures)],
        );
        page.add(
            "Figures",
            "Quantities over the flight; horizontal lines across a chart are limits.",
            [page::figures(about.figures)],
        );
        page.add(
            "Assumptions",
            "The verdict holds under these assumptions.",
            [page::list(&self.assumptions(about.scenario))],
        );
        page.add("Reproduce", "This command flies the same flight again.", [self.repetition(about)]);
        page.add(
            "Performance",
            "Times on the clock of the computer that flew; they do not affect the result.",
            self.performance.map(|times| page::list(&[times.line()])),
        );
        page.render()
    }

    /// Returns the lists of findings of the page.
    fn sections(&self) -> Vec<Section> {
        let hit = |bounce: &Bounce| {
            [bounce.pair.to_string(), seconds(bounce.time_s), format!("{} m/s", up_to(bounce.closing_m_s))]
        };
        let caption = "after the first collision the motion is not governed by the law";
        let hits = self.hulls.bounces.iter().flatten().map(hit);
        let hits = Section::table("Hulls that hit", caption, &["Vehicles", "At", "Closing speed"], hits);
        let [violations, _] = lists(|| std::iter::once(&self.answer));
        let sections = [violations, hits, closest_table(&self.answer, true)];
        sections.into_iter().filter(|section| !section.rows.is_empty()).collect()
    }

    fn assumptions(&self, scenario: &Scenario) -> Vec<String> {
        let certificate = if let (Some(shield), Some(_)) = (&self.shield, self.certificate.separation_m) {
            format!("With the shield between law and vehicles: {}.", shield.certificate)
        } else if self.certificate.separation_m.is_some() {
            scenario.flown_law().map_or_else(|error| error.to_string(), |law| law.capabilities().assumptions.to_owned())
        } else {
            let void: Vec<_> = self.certificate.void.iter().map(ToString::to_string).collect();
            format!("No distance is certified. {}", void.join(" "))
        };
        let moved = match scenario.flown_law().map(|law| law.capabilities().controls.freedom()) {
            Ok(Freedom::Fixed) => "where the reference has moved it",
            Ok(Freedom::Translation) => "at any place",
            _ => "at any place, turned or mirrored",
        };
        let (time, judge) = (&scenario.time, &scenario.arrival);
        let (plant, command) = plant(scenario);
        let lengths = self.ellipsoid.as_ref().map(|ellipsoid| {
            let [_, _, half_height_m] = ellipsoid.half_axes_m;
            format!(
                "An ellipsoid around each vehicle must stay empty; it reaches {half_height_m} m above and below the \
                 centre. Distances of the audit, certificate and violations are scaled lengths: horizontal parts are \
                 in metres, vertical parts are divided by {}.",
                short(half_height_m / ellipsoid.half_axes_m[0])
            )
        });
        let mut assumptions = vec![
            certificate,
            plant,
            format!(
                "Commands are computed {} and {command}. A step is halved, at most {} times, if it is longer than {} \
                 over the law's fastest rate, or if it would use up more than half of a pair's clearance.",
                time.control_hz.map_or_else(
                    || format!("once per step of {} ms", short(time.dt_s * 1e3)),
                    |control_hz| format!("{control_hz} times per second"),
                ),
                time.max_halvings,
                short(time.max_rate_dt)
            ),
            "The audit sweeps every pair over every whole step, along the straight line between its ends, so it \
             covers the time between samples. The closed form of the smallest distance decides, in double precision \
             and to 4 units of rounding of the pair's distance; a shape cast by parry must agree. The engine's own \
             contacts are evidence only."
                .to_owned(),
            format!(
                "Reached means that for at least the last {2} s every edge error is at most {0} m. Every vehicle is \
                 within {0} m of its slot in the formation, {3}. Every speed relative to the mean velocity is at \
                 most {1} m/s in that time.",
                judge.edge_error_m, judge.disagreement_m_s, judge.hold_s, moved
            ),
            format!(
                "Errors are taken at the recorded samples, at most {} per second. The smallest separation, the \
                 largest energy and the peak command cover every step of the run.",
                short(time.record_hz)
            ),
        ];
        assumptions.splice(2..2, lengths);
        assumptions
    }

    fn repetition(&self, page: &RunPage<'_>) -> Markup {
        html! {
            (page::command(page.command))
            p {
                "The same program gives the same motion to the last bit, on any number of threads: the hash of all \
                 recorded states is " (self.run.state_hash) "."
            }
            (folded_scenario(&page.preflight.resolved.toml, &self.scenario.sha256))
        }
    }
}

/// Returns the resolved scenario, cut to [`LONGEST_SCENARIO`].
fn folded_scenario(toml: &str, sha256: &str) -> Markup {
    let end = toml.floor_char_boundary(LONGEST_SCENARIO);
    let part = match toml.len() {
        all if end < all => format!("; its first {end} of {all} bytes, run.mcap holds all"),
        _ => String::new(),
    };
    html! {
        details {
            summary { "The resolved scenario, SHA-256 " (sha256) (part) }
            pre tabindex="0" { code { (toml[..end]) } }
        }
    }
}

/// Returns the model of the vehicles, and the use of a command within a step.
fn plant(scenario: &Scenario) -> (String, &'static str) {
    match (&scenario.airframe, scenario.plant) {
        (Airframe::Unicycle(_), _) => (
            "The vehicles are unicycles: they move in the direction of their heading, turn at a limited rate, and \
             never stop. Their path within a step is an arc in closed form. The audit takes its chord, which it \
             leaves by less than 1e-5 delta. Mass and hull have no effect."
                .to_owned(),
            "held over the step",
        ),
        (Airframe::Quadrotor(quadrotor), PlantSpec::Rapier) => (
            format!(
                "The vehicles are quadrotors ({}): rigid bodies in Rapier with six degrees of freedom and four \
                 rotors. Gravity, drag, the lag of the motors and an attitude loop at {} Hz are simulated. Within a \
                 step each moves on a straight line at constant speed, and hulls that touch repel each other. \
                 Everything is computed in double precision.",
                quadrotor.model.name,
                quadrotor.attitude_hz
            ),
            "held until the next command",
        ),
        (Airframe::Point, PlantSpec::Rapier) => (
            "The vehicles are rigid bodies in Rapier without rotation. Within a step each moves on a straight line \
             at constant speed. Commands are accelerations, so the mass has no effect. Hulls have none until a pair \
             touches. Everything is computed in double precision."
                .to_owned(),
            "held over the step",
        ),
        (Airframe::Quadrotor(quadrotor), PlantSpec::Ideal) => (
            format!(
                "The vehicles are quadrotors ({}) whose equations of motion are solved in continuous time by an \
                 integrator of 8th order in double precision (64 bits). Hulls have no effect, and no engine reports \
                 contacts. The audit assumes straight lines within a step.",
                quadrotor.model.name
            ),
            "held until the next command",
        ),
        (Airframe::Point, PlantSpec::Ideal) => (
            "The vehicles are points that follow the equation of motion, solved in continuous time by an integrator of \
             8th order in double precision (64 bits). Mass and hull have no effect, and no engine reports \
             contacts. The audit assumes straight lines within a step."
                .to_owned(),
            "recorded; the motion between follows the law in continuous time",
        ),
    }
}

/// Formats a number with at most six significant digits and no trailing zeros; very small and very large numbers as
/// powers of ten.
fn short(number: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e7).contains(&number.abs()) {
        return format!("{number:.3e}");
    }
    let text = significant(number, 6);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
