//! `report.html`: a run's report for people.

use maud::{Markup, html};

use super::flight::{Performance, Report, Violation};
use super::page::{self, Badge, Page, Picture, Start, noted, section};
use crate::figures::Figure;
use crate::replay::{NoReplay, Replay};
use tautline_core::swarm::Bounce;
use tautline_core::text::{at_least, seconds, significant};
use tautline_laws::formation::Freedom;
use tautline_sim::scenario::{PlantSpec, Scenario};
use tautline_sim::vehicle::Airframe;

/// Most violations, or hits of hulls, that are listed one by one.
pub(super) const LISTED: usize = 50;

/// Most bytes of a scenario on a page.
const LONGEST_SCENARIO: usize = 100_000;

/// What a run's page shows beside its report.
#[derive(Clone, Copy, Debug)]
pub struct RunPage<'a> {
    /// What was flown.
    pub scenario: &'a Scenario,
    /// What was known to be doubtful before the first step.
    pub warnings: &'a [(String, String)],
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
    /// Two runs of one scenario give the same bytes but for the table of performance.
    #[must_use]
    pub fn to_html(&self, page: &RunPage<'_>) -> String {
        self.page(page).render_with_replays()
    }

    fn page(&self, page: &RunPage<'_>) -> Page {
        let tables = [self.separation_table(), self.formation_table(), self.control_table(), self.run_table()];
        let replay = match page.replay {
            Ok(replay) => page::replay(&self.scenario.name, replay, Start::AtOnce),
            Err(why) => page::no_replay(&why.to_string()),
        };
        let mut sections = vec![section("Replay", &[replay])];
        sections.push(section("Numbers", &[html! { div.tables { @for table in tables { (table) } } }]));
        if !self.legs.is_empty() {
            sections.push(section("Legs", &[super::legs::table(&self.legs)]));
        }
        if !self.audit.violations.is_empty() {
            sections.push(section("Violations", &[self.violations()]));
        }
        if let Some(bounces) = self.hulls.bounces.as_deref().filter(|bounces| !bounces.is_empty()) {
            sections.push(section("Hulls that hit", &[hits(bounces)]));
        }
        if !page.pictures.is_empty() {
            sections.push(section("Pictures", &[page::pictures(page.pictures)]));
        }
        if let Some(obstacles) = &self.obstacles {
            sections.push(section("Obstacles", &[obstacles.table()]));
        }
        if !page.figures.is_empty() {
            sections.push(section("Figures", &[page::figures(page.figures)]));
        }
        sections.push(section("What was assumed", &[page::list(&self.assumptions(page.scenario))]));
        sections.push(section("Repeat it", &[self.repetition(page)]));
        sections.extend(self.performance.map(|times| section("Performance", &[times.table()])));
        Page {
            title: self.scenario.name.clone(),
            kind: "Flight report",
            badge: Badge::judged(self.verdict.pass),
            verdict: self.headline(),
            reasons: self.verdict.reasons.clone(),
            warnings: page.warnings.to_vec(),
            sections,
        }
    }

    fn separation_table(&self) -> Markup {
        let Self { separation, audit, .. } = self;
        let pair = separation.min_pair.map(|[first, second]| format!("vehicles {first} and {second}"));
        let at = separation.min_at_s.map(|at_s| format!("at {}", seconds(at_s)));
        let closest = [pair, at].into_iter().flatten().collect::<Vec<_>>().join(" ");
        let certificate = if separation.certified_m.is_some() {
            let anew = self.changes().map(|changes| format!(", and anew at {changes}"));
            let until = separation.certified_until_s.map(|until_s| format!(" until {}", seconds(until_s)));
            format!("promised before the first step{}{}", anew.unwrap_or_default(), until.unwrap_or_default())
        } else {
            separation.certificate_void.join(" ")
        };
        let sweep = format!("{} steps and {} pairs swept", audit.steps, audit.pairs_checked);
        let contacts = audit.rapier.contact_pairs.map_or(NOT_KNOWN.to_owned(), |pairs| pairs.to_string());
        let caption = match &separation.ellipsoid {
            Some(ellipsoid) => &format!("Separation, in lengths scaled to ellipsoids; {}", ellipsoid.line()),
            None => "Separation",
        };
        numbers(
            caption,
            [
                ("Safety distance δ", with_unit(Some(separation.delta_m), "m"), "what is judged by"),
                ("Smallest distance", proved_m(separation.min_m), &closest),
                ("Certified distance", proved_m(separation.certified_m), &certificate),
                ("Audit", audit.status.name().to_owned(), &sweep),
                ("Violations", audit.violations.len().to_string(), "times that a pair was closer than δ"),
                ("Disagreements", audit.parry.disagreements.to_string(), "of closed form and shape cast"),
                ("Contacts seen by the engine", contacts, "pairs whose keep-out balls overlapped"),
            ],
        )
    }

    fn formation_table(&self) -> Markup {
        let Self { formation, velocity, .. } = self;
        let reached = formation.reached_at_s.map_or("not reached".to_owned(), seconds);
        numbers(
            "Formation",
            [
                ("Reached", reached, "and kept from then on to the end"),
                ("Largest edge error", with_unit(formation.max_edge_error_m, "m"), "at the end"),
                ("Position error", with_unit(formation.max_position_error_m, "m"), "largest of a vehicle, at the end"),
                ("Velocity disagreement", with_unit(velocity.disagreement_m_s, "m/s"), "at the end"),
                ("Common velocity", with_unit(velocity.common_m_s, "m/s"), "at the end"),
            ],
        )
    }

    fn control_table(&self) -> Markup {
        let Self { energy, control, .. } = self;
        numbers(
            "Energy and control",
            [
                ("Initial energy E(0)", with_unit(energy.initial, "m²/s²"), ""),
                ("Final energy", with_unit(energy.at_end, "m²/s²"), ""),
                ("Largest energy over E(0)", with_unit(energy.max_over_initial, ""), "over all steps"),
                ("Peak control", with_unit(control.peak_m_s2, "m/s²"), "over all steps"),
                ("Final control", with_unit(control.final_m_s2, "m/s²"), ""),
            ],
        )
    }

    fn run_table(&self) -> Markup {
        let run = &self.run;
        numbers(
            "Run",
            [
                ("Vehicles", run.vehicles.to_string(), ""),
                ("Duration", with_unit(Some(run.duration_s), "s"), ""),
                ("Step", with_unit(Some(run.dt_s * 1e3), "ms"), ""),
                ("Steps", run.steps.to_string(), ""),
            ],
        )
    }

    fn violations(&self) -> Markup {
        let violations = &self.audit.violations;
        let row = |violation: &Violation| {
            let [from, to, at] = [violation.from_s, violation.to_s, violation.min_at_s].map(seconds);
            [violation.pair.to_string(), from, to, proved_m(Some(violation.min_m)), at]
        };
        html! {
            (page::numbers(
                "Times that a pair was closer than δ",
                &["Vehicles", "From", "To", "Smallest", "At"],
                violations.iter().take(LISTED).map(row),
            ))
            (more(violations.len()))
        }
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

impl Performance {
    fn table(&self) -> Markup {
        let spent = [
            ("From first to last step", Some(self.wall_s), "s"),
            ("Time flown over that", self.real_time_factor, ""),
            ("In the law", Some(self.law_s), "s"),
            ("In its energy", Some(self.energy_s), "s"),
            ("In the physics", Some(self.physics_s), "s"),
            ("Of that, in forces, rotors and attitude loops", Some(self.airframe_s), "s"),
            ("In the audit", Some(self.audit_s), "s"),
            ("In the recorders", Some(self.record_s), "s"),
        ];
        page::numbers(
            "Wall-clock time, which alone differs from run to run",
            &["Where", "Time"],
            spent.map(|(name, number, unit)| [name.to_owned(), with_unit(number, unit)]),
        )
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

/// The times that two hulls hit.
fn hits(bounces: &[Bounce]) -> Markup {
    let row =
        |bounce: &Bounce| [bounce.pair.to_string(), seconds(bounce.time_s), with_unit(Some(bounce.closing_m_s), "m/s")];
    html! {
        (page::numbers(
            "From the first on, a bounce is flown and not the law's motion",
            &["Vehicles", "At", "Closing speed"],
            bounces.iter().take(LISTED).map(row),
        ))
        (more(bounces.len()))
    }
}

/// The number of entries of a list that are not on the page.
pub(super) fn more(all: usize) -> Markup {
    html! {
        @if let Some(more @ 1..) = all.checked_sub(LISTED) {
            p { (more) " more are in report.json." }
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

const NOT_KNOWN: &str = "–";

/// A table of quantities: their names, their values, and remarks on them.
fn numbers<const N: usize>(caption: &str, rows: [(&str, String, &str); N]) -> Markup {
    let row = |(name, value, remark): (&str, String, &str)| {
        let name = if remark.is_empty() {
            html! { (name) }
        } else {
            noted(name, remark)
        };
        [name, html! { (value) }]
    };
    page::numbers(caption, &["Quantity", "Value"], rows.map(row))
}

fn with_unit(number: Option<f64>, unit: &str) -> String {
    number.map_or(NOT_KNOWN.to_owned(), |number| format!("{} {unit}", short(number)).trim_end().to_owned())
}

/// A distance that is not larger than what was found.
fn proved_m(distance_m: Option<f64>) -> String {
    distance_m.map_or(NOT_KNOWN.to_owned(), |distance_m| format!("{} m", at_least(distance_m, 6)))
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
