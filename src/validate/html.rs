//! `validate.html`.

use super::claim::{Claim, Group, Kind};
use super::convergence::Refinement;
use super::result::Validation;
use crate::report::page::{Badge, Block, Cell, Column, Page, Section, Table, Tone};

/// What the claims rest on.
const ASSUMED: [&str; 3] = [
    "Continuous time is solved by an explicit Runge-Kutta method of order 8 with error control at 1e-12, which knows nothing \
     of the physics engine.",
    "Within a step the engine moves every vehicle on a straight line, and the audit sweeps that line.",
    "Random starts come from fixed seeds: the same program finds the same numbers.",
];

impl Validation {
    /// The result as a self-contained page: claims, figures and the convergence. Two validations by one program give the same
    /// bytes.
    #[must_use]
    pub fn to_html(&self) -> String {
        let failed = self.claims().filter(|claim| !claim.pass);
        let mut sections: Vec<Section> = self.groups.iter().map(section).collect();
        let (of_convergence, of_paper): (Vec<_>, Vec<_>) =
            self.figures.iter().cloned().partition(|figure| figure.name == "convergence");
        sections.extend([
            Section::new(
                "Convergence ladder",
                vec![Block::Table(convergence(&self.convergence)), Block::Figures(of_convergence)],
            ),
            Section::new("The paper's figures", vec![Block::Figures(of_paper)]),
            Section::new("What was assumed", vec![Block::List(ASSUMED.map(str::to_owned).to_vec())]),
            Section::new("Repeat it", vec![Block::Command("tautline validate".to_owned())]),
        ]);
        Page {
            title: "Validation".to_owned(),
            kind: "Every claim, ours and the paper's, judged by measurement".to_owned(),
            badge: Badge::judged(self.pass),
            verdict: self.headline(),
            reasons: failed.map(|claim| format!("{}: {}", claim.id, claim.measured)).collect(),
            warnings: Vec::new(),
            sections,
            foot: format!("Made by {} {}.", self.tool.name, self.tool.version),
        }
        .render()
    }
}

fn section(group: &Group) -> Section {
    let table = Table {
        caption: caption(group),
        columns: vec![Column::words("Claim"), Column::words("Measured"), Column::words("Outcome")],
        rows: group.claims.iter().map(row).collect(),
    };
    Section::new(group.title, vec![Block::Table(table)])
}

fn caption(group: &Group) -> String {
    let (all, failed) = (group.claims.len(), group.claims.iter().filter(|claim| !claim.pass).count());
    if failed == 0 {
        format!("{all} claims, all as expected")
    } else {
        format!("{failed} of {all} claims not as expected")
    }
}

fn row(claim: &Claim) -> Vec<Cell> {
    let tone = match (claim.pass, claim.kind) {
        (false, _) => Tone::Bad,
        (true, Kind::PaperRefuted) => Tone::Neutral,
        (true, _) => Tone::Good,
    };
    let Claim { id, source, expected, tolerance, reason, .. } = claim;
    let finding = claim.finding.map(|finding| format!("{finding}; ")).unwrap_or_default();
    let judged = format!("Expected: {expected}. Tolerance: {tolerance} ({reason}).");
    vec![
        Cell::Noted(claim.statement.to_owned(), format!("{finding}{id}; {source}")),
        Cell::Noted(claim.measured.clone(), judged),
        Cell::Badge(Badge { tone, word: claim.outcome().to_owned() }),
    ]
}

fn convergence(refinements: &[Refinement]) -> Table {
    let number = |x: f64| Cell::from(format!("{x:.2e}"));
    let row = |&Refinement { dt_s, double_m, single_m, order, energy_excess_m2_s2, .. }: &Refinement| {
        let order = order.map_or("–".to_owned(), |order| format!("{order:.3}"));
        let step = Cell::from(format!("1/{:.0}", 1.0 / dt_s));
        vec![step, number(double_m), Cell::from(order), number(single_m), number(energy_excess_m2_s2)]
    };
    Table {
        caption: "Largest position error of Rapier on the pentagon's flight, by step".to_owned(),
        columns: vec![
            Column::words("Step [s]"),
            Column::numbers("Double precision [m]"),
            Column::numbers("Order"),
            Column::numbers("Single precision [m]"),
            Column::numbers("Energy excess [m²/s²]"),
        ],
        rows: refinements.iter().map(row).collect(),
    }
}
