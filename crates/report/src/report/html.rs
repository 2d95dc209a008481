//! `report.html`: a run's report for people.

use maud::{Markup, html};

use super::flight::{Report, Violation};
use super::obstacles::Obstacles;
use super::page::{self, Badge, Page, Picture, Start};
use super::section::Section;
use crate::figures::Figure;
use crate::replay::{NoReplay, Replay};
use tautline_core::swarm::Bounce;
use tautline_core::text::{at_least, metres, seconds, significant};
use tautline_laws::formation::Freedom;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::{PlantSpec, Scenario};
use tautline_sim::vehicle::Airframe;

/// Most violations, or hits of hulls, that are listed one by one.
const LISTED: usize = 50;

/// Most bytes of a scenario on a page.
const LONGEST_SCENARIO: usize = 100_000;

/// What a run's page shows beside its report.
#[derive(Clone, Copy, Debug)]
pub struct RunPage<'a> {
    /// What was flown.
    pub scenario: &'a Scenario,
    /// Findings before the first step.
    pub preflight: &'a Preflight,
    /// The flight itself, or why it cannot be replayed.
    pub replay: &'a Result<Replay, NoReplay>,
    /// The run as charts.
    pub figures: &'a [Figure],
    /// The run as it looked.
    pub pictures: &'a [Picture],
    /// The command that repeats the run.
    pub command: &'a str,
}

impl Report {
    /// The report as a self-contained HTML page.
    ///
    /// Two runs of one scenario give the same bytes but for the last section, on performance.
    #[must_use]
    pub fn to_html(&self, about: &RunPage<'_>) -> String {
        let badge = Badge::judged(self.verdict.pass);
        let mut page = Page::new("Flight report", self.scenario.name.clone(), badge, self.headline());
        page.reasons.clone_from(&self.verdict.reasons);
        let warnings = about.preflight.warnings.iter();
        page.warnings = warnings.map(|of| (of.code.name().to_owned(), of.message.clone())).collect();
        page.add("Replay", [page::replay(&self.scenario.name, about.replay, Start::AtOnce)]);
        let rows = self.rows().into_iter().map(<[String; 2]>::from);
        page.add("Findings", [page::words("Findings", &["Part", "Finding"], rows)]);
        page.sections.extend(self.sections().iter().map(|section| section.html(LISTED)));
        page.add("Pictures", [page::pictures(about.pictures)]);
        page.add("Figures", [page::figures(about.figures)]);
        page.add("What was assumed", [page::list(&self.assumptions(about.scenario))]);
        page.add("Repeat it", [self.repetition(about)]);
        page.add("Performance", self.performance.map(|times| page::list(&[times.line()])));
        page.render()
    }

    /// Returns the lists of findings of the page.
    fn sections(&self) -> Vec<Section> {
        let violation = |violation: &Violation| {
            let [from, to, at] = [violation.from_s, violation.to_s, violation.min_at_s].map(seconds);
            [violation.pair.to_string(), from, to, format!("{} m", at_least(violation.min_m, 6)), at]
        };
        let columns = &["Vehicles", "From", "To", "Smallest", "At"];
        let caption = "times that a pair was closer than delta";
        let violations = Section::table("Violations", caption, columns, self.audit.violations.iter().map(violation));
        let hit = |bounce: &Bounce| {
            [bounce.pair.to_string(), seconds(bounce.time_s), format!("{} m/s", metres(bounce.closing_m_s))]
        };
        let caption = "after the first hit the motion is not governed by the law";
        let hits = self.hulls.bounces.iter().flatten().map(hit);
        let hits = Section::table("Hulls that hit", caption, &["Vehicles", "At", "Closing speed"], hits);
        let obstacles = self.obstacles.iter().flat_map(Obstacles::sections);
        [violations, hits].into_iter().chain(obstacles).filter(|section| !section.rows.is_empty()).collect()
    }

    fn assumptions(&self, scenario: &Scenario) -> Vec<String> {
        let certificate = if self.separation.certified_m.is_some() {
            scenario.law().map_or_else(|error| error.to_string(), |law| law.capabilities().assumptions.to_owned())
        } else {
            format!("No distance is certified. {}", self.separation.certificate_void.join(" "))
        };
        let moved = match scenario.law().map(|law| law.capabilities().controls.freedom()) {
            Ok(Freedom::Fixed) => "where the reference has carried it",
            Ok(Freedom::Translation) => "wherever it is",
            _ => "wherever it is, turned and perhaps mirrored",
        };
        let (time, judge) = (&scenario.time, &scenario.arrival);
        let (plant, command) = plant(scenario);
        let lengths = self.separation.ellipsoid.as_ref().map(|ellipsoid| {
            let [_, _, half_height_m] = ellipsoid.half_axes_m;
            format!(
                "What must stay empty around a vehicle is an ellipsoid {half_height_m} m high above and below its centre. Distances of \
                 the audit, certificate and violations are scaled lengths: level as in metres, and upwards divided by {}.",
                short(half_height_m / ellipsoid.half_axes_m[0])
            )
        });
        let mut assumptions = vec![
            certificate,
            plant,
            format!(
                "Commands are computed {} and {command}. A step longer than {} over the law's fastest rate, or \
                 that would take more than half of a pair's clearance, is flown in halves, at most {} times halved.",
                time.control_hz.map_or_else(
                    || format!("once a step of {} ms", short(time.dt_s * 1e3)),
                    |control_hz| format!("{control_hz} times a second"),
                ),
                short(time.max_rate_dt),
                time.max_halvings
            ),
            "The audit sweeps every pair over every whole step, along the straight line between its ends, so nothing passes between samples: the closed form of the \
             smallest distance decides, in double precision and to 4 units of rounding of the pair's distance, and a shape \
             cast by parry must agree. The engine's own contacts are evidence alone."
                .to_owned(),
            format!(
                "Reached means: no edge is wrong by more than {0} m, every vehicle is within {0} m of its slot in the \
                 formation, {3}, and none differs from the mean velocity by more than {1} m/s, from \
                 then on to the end, for at least {2} s.",
                judge.edge_error_m, judge.disagreement_m_s, judge.hold_s, moved
            ),
            format!(
                "Errors are those of the recorded samples, at most {} a second; the smallest distance, the largest energy and \
                 the peak control are those of the whole run.",
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
                "The same program gives the same motion to the last bit, on any number of threads: the hash of all recorded \
                 states is " (self.run.state_hash) "."
            }
            (folded_scenario(&page.scenario.resolved_toml(), &self.scenario.sha256))
        }
    }
}

/// The resolved scenario, or so many of its lines as a page has room for.
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

/// The model of the vehicles, and the use of a command within a step.
fn plant(scenario: &Scenario) -> (String, &'static str) {
    match (&scenario.airframe, scenario.plant) {
        (Airframe::Unicycle(_), _) => (
            "The vehicles are unicycles: they go where they look, turn no faster than they can, and never stop. Their way within a \
             step is an arc in closed form, which the audit takes for straight: they leave it by less than 1e-5 m. Mass and hull \
             play no part."
                .to_owned(),
            "held over it",
        ),
        (Airframe::Quadrotor(quadrotor), PlantSpec::Rapier) => (
            format!(
                "The vehicles are quadrotors ({}): rigid bodies in Rapier with six degrees of freedom that four rotors lift, under \
                 gravity, with the lag of their motors, drag and an attitude loop at {} Hz; within a step each moves on a straight \
                 line at constant speed, and hulls that touch push each other. Everything is computed \
                 in double precision.",
                quadrotor.model.name,
                quadrotor.attitude_hz
            ),
            "held until the next one",
        ),
        (Airframe::Point, PlantSpec::Rapier) => (
            "The vehicles are rigid bodies in Rapier without rotation; within a step each moves on a straight line \
             at constant speed. Commands are accelerations, so mass changes nothing, and neither do hulls, until a pair is \
             so close that they touch. Everything is computed in double precision."
                .to_owned(),
            "held over it",
        ),
        (Airframe::Quadrotor(quadrotor), PlantSpec::Ideal) => (
            format!(
                "The vehicles are quadrotors ({}) whose equations of motion are solved in continuous time by an integrator of 8th \
                 order in double precision (64 bits); hulls play no part, and there is no engine to see contacts. The audit takes \
                 them to move on straight lines within a step.",
                quadrotor.model.name
            ),
            "held until the next one",
        ),
        (Airframe::Point, PlantSpec::Ideal) => (
            "The vehicles are points that follow the equation of motion, solved in continuous time by an integrator of \
             8th order in double precision (64 bits); mass and hull play no part, and there is no engine to see \
             contacts. The audit takes them to move on straight lines within a step."
                .to_owned(),
            "recorded; the motion between follows the law in continuous time",
        ),
    }
}

/// A number with six significant digits at most, without zeros at its end; very small and very large ones in powers of
/// ten.
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
