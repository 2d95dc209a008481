//! Result of a validation as text, as the tables of `docs/validation.md`, and as a page.

use super::claim::{Claim, Group, Kind, MeasureError, Validation};
use super::convergence::Refinement;
use super::detectors::{BuiltinFlight, Flights};
use super::tension;
use tautline_core::text::capitalised;
use tautline_report::figures::{self, Figure, Step};
use tautline_report::report::page::{self, Badge, Markup, Page, Render as _, Tone, noted, section};

/// Head of the table of a group of claims.
const HEAD: &str = "| claim | result | statement | measured | tolerance |\n| --- | --- | --- | --- | --- |\n";

impl Validation {
    /// Returns the result in one line.
    #[must_use]
    pub fn headline(&self) -> String {
        let count = |kind: Kind| self.claims().filter(|claim| claim.kind == kind && claim.pass).count();
        let (all, failed) = (self.claims().count(), self.claims().filter(|claim| !claim.pass).count());
        if failed > 0 {
            return format!("{failed} of {all} claims are not as expected");
        }
        format!(
            "valid: all {all} claims are as expected: {} of ours hold, {} of the paper's hold, {} of the paper's are \
             refuted",
            count(Kind::Ours),
            count(Kind::PaperHolds),
            count(Kind::PaperRefuted)
        )
    }

    /// Returns a line for each claim: result, name and measurement.
    #[must_use]
    pub fn text(&self) -> String {
        let width = |width_of: fn(&Claim) -> usize| self.claims().map(width_of).max().unwrap_or(0);
        let (outcomes, names) = (width(|claim| claim.outcome().len()), width(|claim| claim.id.len()));
        self.claims().fold(String::new(), |text, claim| {
            let finding = claim.finding.map(|finding| format!("[{finding}] ")).unwrap_or_default();
            text + &format!("{:outcomes$}  {:names$}  {finding}{}\n", claim.outcome(), claim.id, claim.measured)
        })
    }

    /// Returns the generated part of `docs/validation.md`.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut page = format!("{}.\n\n## Errata of the paper\n\n{}", capitalised(&self.headline()), self.errata());
        for group in &self.groups {
            page.extend(["\n## ", group.title, "\n\n", HEAD]);
            page.extend(group.claims.iter().map(entry));
        }
        page
    }

    fn errata(&self) -> String {
        let mut table = "| finding | the paper | correct | claim |\n| --- | --- | --- | --- |\n".to_owned();
        let mut findings: Vec<(&str, &Claim)> = self
            .claims()
            .filter(|claim| claim.kind == Kind::PaperRefuted)
            .filter_map(|claim| Some((claim.finding?, claim)))
            .collect();
        findings.sort_by_key(|&(finding, _)| finding);
        table.extend(findings.into_iter().map(|(finding, Claim { id, statement, source, expected, .. })| {
            format!("| {finding} | {} ({source}) | {} | `{id}` |\n", cell(statement), cell(expected))
        }));
        table
    }
}

/// Returns the row of a claim.
fn entry(claim: &Claim) -> String {
    let Claim { id, statement, source, measured, tolerance, .. } = claim;
    let statement = match (claim.kind, claim.finding) {
        (Kind::PaperRefuted, Some(finding)) => format!("{finding} above"),
        (Kind::Ours, _) => (*statement).to_owned(),
        _ => format!("{statement} ({source})"),
    };
    let outcome = claim.outcome();
    format!("| `{id}` | {outcome} | {} | {} | {tolerance} |\n", cell(&statement), cell(measured))
}

/// Escapes a text for a cell of a Markdown table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

/// Draws Figs. 1, 2 (a to c), 3 (a to c) and 4, and the convergence.
pub(super) fn draw(flights: &Flights, convergence: &[Refinement]) -> Result<Vec<Figure>, MeasureError> {
    let steps: Vec<Step> = convergence.iter().map(|&Refinement { dt_s, error_m, .. }| Step { dt_s, error_m }).collect();
    let mut drawn = vec![named("figure-1", figures::tension_curve(&tension::of_figure_1()?, "Fig. 1: edge tension"))];
    drawn.extend(of_flight(&flights.pentagon, ["figure-2a", "figure-2b", "figure-2c"], "Fig. 2", "pentagon"));
    drawn.extend(of_flight(&flights.circle, ["figure-3a", "figure-3b", "figure-3c"], "Fig. 3", "circle"));
    let baseline = &flights.baseline;
    let distances = figures::distances(&baseline.log, baseline.delta_m, None, "Fig. 4: pentagon without avoidance");
    drawn.push(named("figure-4", distances));
    drawn.push(figures::convergence(&steps, "Rapier against continuous time"));
    Ok(drawn)
}

/// Returns the figures of paths, control effort and distances.
fn of_flight(flown: &BuiltinFlight, names: [&str; 3], number: &str, flight: &str) -> [Figure; 3] {
    let [a, b, c] = names;
    let (log, certified_m) = (&flown.log, flown.flight.certificate.certified_m);
    [
        named(a, figures::paths(log, &[], &format!("{number}(a): {flight}, paths"))),
        named(b, figures::control(log, &format!("{number}(b): {flight}, control effort"))),
        named(c, figures::distances(log, flown.delta_m, certified_m, &format!("{number}(c): {flight}, distances"))),
    ]
}

fn named(name: &str, figure: Figure) -> Figure {
    Figure { name: name.to_owned(), ..figure }
}

/// Sentence below the heading of the convergence.
const ABOUT_CONVERGENCE: &str = "Half the step leaves a quarter of the position error, so the method has order 2.";

/// Assumptions of the claims.
const ASSUMED: [&str; 3] = [
    "Continuous time is solved by an explicit Runge-Kutta method of order 8 with error control at 1e-12, independent \
     of the physics engine.",
    "Within a step the engine moves every vehicle on a straight line, and the audit sweeps this line.",
    "Random starts come from fixed seeds, so the same program gives the same numbers.",
];

impl Validation {
    /// Returns the result as a self-contained page: claims, figures and the convergence. The bytes are the same for any
    /// validation by the same program.
    #[must_use]
    pub fn to_html(&self) -> String {
        let failed = self.claims().filter(|claim| !claim.pass);
        let mut sections: Vec<Markup> = self.groups.iter().map(claims).collect();
        let (of_convergence, of_paper): (Vec<_>, Vec<_>) =
            self.figures.iter().cloned().partition(|figure| figure.name == "convergence");
        sections.extend([
            section(
                "Convergence ladder",
                ABOUT_CONVERGENCE,
                &[convergence(&self.convergence), page::figures(&of_convergence)],
            ),
            section(
                "The paper's figures",
                "The figures of the source paper, flown and drawn again.",
                &[page::figures(&of_paper)],
            ),
            section("Assumptions", "The measurements rest on these assumptions.", &[page::list(&ASSUMED)]),
            section("Command", "This command measures everything again.", &[page::command("tautline validate")]),
        ]);
        let (tone, word) = if self.pass { (Tone::Good, "as expected") } else { (Tone::Bad, "not as expected") };
        Page {
            setup: String::new(),
            title: "Validation".to_owned(),
            kind: "Measurement of every claim of tautline and of its source paper",
            badge: Badge { tone, word: word.to_owned() },
            verdict: self.headline(),
            replay: None,
            reasons: failed.map(|claim| format!("{}: {}", claim.id, claim.measured)).collect(),
            warnings: Vec::new(),
            sections,
        }
        .render()
    }
}

/// Returns a sentence on a group of claims for a first reader.
fn about(id: &str) -> &'static str {
    match id {
        "tension" => "Each link of the law pulls or pushes by a tension that is unbounded at the safety distance.",
        "law" => "The command of each vehicle at single instants, against its formula.",
        "certificate" => "The energy of the law bounds how close any two vehicles can come.",
        "figures" => "Flights of the paper's figures, with their numbers.",
        "equilibria" => "Places where the law comes to rest without reaching its formation.",
        "rates" => "How fast small errors decay near the formation.",
        "displacement" => "The law that keeps displacements instead of distances.",
        "margins" => "How much delay, and how slow a controller, the law tolerates.",
        "engine" => "The simulated motion against the equations of motion in continuous time.",
        "detectors" => "The judge of the audit against the engine's own contacts.",
        _ => "",
    }
}

fn claims(group: &Group) -> Markup {
    let columns = ["Claim", "Measured", "Outcome"];
    section(group.title, about(group.id), &[page::words(&caption(group), &columns, group.claims.iter().map(row))])
}

fn caption(group: &Group) -> String {
    let (all, failed) = (group.claims.len(), group.claims.iter().filter(|claim| !claim.pass).count());
    if failed == 0 {
        format!("{all} claims, all as expected")
    } else {
        format!("{failed} of {all} claims not as expected")
    }
}

/// Suffixes of names of numbers, with their units.
const UNITS: [(&str, &str); 7] = [
    ("_m2_s2", "m^2/s^2"),
    ("_m_s2", "m/s^2"),
    ("_m_s", "m/s"),
    ("_per_s", "1/s"),
    ("_hz", "Hz"),
    ("_m", "m"),
    ("_s", "s"),
];

/// Replaces each name with its number in a list, such as `min_at_s 2.15`, by words and a unit: `min at 2.15 s`.
fn readable(list: &str) -> String {
    let entry = |entry: &str| {
        let (name, number) = entry.split_once(' ').filter(|(_, number)| number.parse::<f64>().is_ok())?;
        let (name, unit) = UNITS.iter().find_map(|(suffix, unit)| Some((name.strip_suffix(suffix)?, unit)))?;
        let words = name.replace("min", "smallest separation").replace("_10_s", "_10 s").replace('_', " ");
        Some(format!("{words} {number} {unit}"))
    };
    list.split(", ").map(|name| entry(name).unwrap_or_else(|| name.to_owned())).collect::<Vec<_>>().join(", ")
}

fn row(claim: &Claim) -> [Markup; 3] {
    let tone = match (claim.pass, claim.kind) {
        (false, _) => Tone::Bad,
        (true, Kind::PaperRefuted) => Tone::Neutral,
        (true, _) => Tone::Good,
    };
    let Claim { id, source, expected, tolerance, reason, .. } = claim;
    let finding = claim.finding.map(|finding| format!("{finding}; ")).unwrap_or_default();
    let expected = readable(expected);
    let judged = format!("Expected: {expected}. Tolerance: {tolerance} ({reason}).");
    [
        noted(claim.statement, &format!("{finding}{id}; {source}")),
        noted(&readable(&claim.measured), &judged),
        Badge { tone, word: claim.outcome().to_owned() }.render(),
    ]
}

fn convergence(refinements: &[Refinement]) -> Markup {
    let row = |&Refinement { dt_s, error_m, order, energy_excess_m2_s2, .. }: &Refinement| {
        let [error, excess] = [error_m, energy_excess_m2_s2].map(|x| format!("{x:.2e}"));
        let order = order.map_or("–".to_owned(), |order| format!("{order:.3}"));
        [format!("1/{:.0}", 1.0 / dt_s), error, order, excess]
    };
    page::numbers(
        "Largest position error of Rapier in the pentagon flight, by step",
        &["Step [s]", "Position error [m]", "Order", "Energy excess [m^2/s^2]"],
        refinements.iter().map(row),
    )
}

#[cfg(test)]
mod tests {
    use super::super::claim::Group;
    use super::*;

    fn claim(id: &'static str, kind: Kind, pass: bool) -> Claim {
        let (source, statement, expected) = ("equation (0)", "Nothing moves.", "no motion");
        let finding = (kind == Kind::PaperRefuted).then_some("F9");
        let claim = Claim { id, source, kind, statement, expected, finding, reason: "exact", ..Claim::default() };
        claim.measured("none".to_owned(), [("speed_m_s", 0.0), ("unknown", f64::NAN)]).pass(pass)
    }

    fn validation(claims: Vec<Claim>) -> Validation {
        let groups = vec![Group { id: "still", title: "Stillness", claims }];
        Validation::new(groups, Vec::new(), Vec::new(), 1.0)
    }

    #[test]
    fn names_of_numbers_become_words_with_units() {
        let list =
            "energy_initial_m2_s2 3.5, min_m 2.46, min_at_s 2.1, vehicle_1_x_at_10_s_m -1.0, off by 2 m, law_m x";
        let words = "energy initial 3.5 m^2/s^2, smallest separation 2.46 m, smallest separation at 2.1 s, \
                     vehicle 1 x at 10 s -1.0 m, off by 2 m, law_m x";
        assert_eq!(readable(list), words);
    }

    #[test]
    fn a_refuted_statement_of_the_paper_is_not_a_failure() {
        let judged = validation(vec![
            claim("a", Kind::Ours, true),
            claim("b", Kind::PaperHolds, true),
            claim("c", Kind::PaperRefuted, true),
        ]);
        assert_eq!(
            judged.headline(),
            "valid: all 3 claims are as expected: 1 of ours hold, 1 of the paper's hold, 1 of the paper's are refuted"
        );
        assert_eq!(judged.text().lines().last(), Some("paper: refuted  c  [F9] none"));
        let page = judged.markdown();
        assert!(page.contains("| F9 | Nothing moves. (equation (0)) | no motion | `c` |"), "{page}");
        assert!(page.contains("| `c` | paper: refuted | F9 above | none |"), "{page}");
        assert!(judged.to_html().contains("paper: refuted"));
    }

    #[test]
    fn a_claim_that_is_not_as_expected_is_reported() {
        for (kind, outcome) in [(Kind::Ours, "FAILS"), (Kind::PaperHolds, "FAILS"), (Kind::PaperRefuted, "NOT REFUTED")]
        {
            let judged = validation(vec![claim("a", Kind::Ours, true), claim("b", kind, false)]);
            assert!(!judged.pass);
            assert_eq!(judged.headline(), "1 of 2 claims are not as expected");
            assert!(judged.text().contains(outcome) && judged.markdown().contains(outcome));
            assert!(judged.to_html().contains("b: none"));
        }
    }

    #[test]
    fn a_number_that_is_not_finite_is_null_in_json() -> serde_json::Result<()> {
        let judged = validation(vec![claim("a", Kind::PaperRefuted, true)]);
        let json: serde_json::Value = serde_json::from_str(&judged.to_json()?)?;
        let claim = &json["groups"][0]["claims"][0];
        assert_eq!(claim["kind"], "paper-refuted");
        assert_eq!(
            (&claim["values"]["speed_m_s"], &claim["values"]["unknown"]),
            (&0.0.into(), &serde_json::Value::Null)
        );
        Ok(())
    }
}
