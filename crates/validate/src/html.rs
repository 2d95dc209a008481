//! `validate.html`.

use super::claim::{Claim, Group, Kind};
use super::convergence::Refinement;
use super::result::Validation;
use tautline_report::report::page::{self, Badge, Markup, Page, Render as _, Tone, noted, section};

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
        let mut sections: Vec<Markup> = self.groups.iter().map(claims).collect();
        let (of_convergence, of_paper): (Vec<_>, Vec<_>) =
            self.figures.iter().cloned().partition(|figure| figure.name == "convergence");
        sections.extend([
            section("Convergence ladder", &[convergence(&self.convergence), page::figures(&of_convergence)]),
            section("The paper's figures", &[page::figures(&of_paper)]),
            section("What was assumed", &[page::list(&ASSUMED)]),
            section("Repeat it", &[page::command("tautline validate")]),
        ]);
        Page {
            title: "Validation".to_owned(),
            kind: "Every claim, ours and the paper's, judged by measurement",
            badge: Badge::judged(self.pass),
            verdict: self.headline(),
            reasons: failed.map(|claim| format!("{}: {}", claim.id, claim.measured)).collect(),
            warnings: Vec::new(),
            sections,
        }
        .render()
    }
}

fn claims(group: &Group) -> Markup {
    let columns = ["Claim", "Measured", "Outcome"];
    section(group.title, &[page::words(&caption(group), &columns, group.claims.iter().map(row))])
}

fn caption(group: &Group) -> String {
    let (all, failed) = (group.claims.len(), group.claims.iter().filter(|claim| !claim.pass).count());
    if failed == 0 {
        format!("{all} claims, all as expected")
    } else {
        format!("{failed} of {all} claims not as expected")
    }
}

fn row(claim: &Claim) -> [Markup; 3] {
    let tone = match (claim.pass, claim.kind) {
        (false, _) => Tone::Bad,
        (true, Kind::PaperRefuted) => Tone::Neutral,
        (true, _) => Tone::Good,
    };
    let Claim { id, source, expected, tolerance, reason, .. } = claim;
    let finding = claim.finding.map(|finding| format!("{finding}; ")).unwrap_or_default();
    let judged = format!("Expected: {expected}. Tolerance: {tolerance} ({reason}).");
    [
        noted(claim.statement, &format!("{finding}{id}; {source}")),
        noted(&claim.measured, &judged),
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
        "Largest position error of Rapier on the pentagon's flight, by step",
        &["Step [s]", "Position error [m]", "Order", "Energy excess [m²/s²]"],
        refinements.iter().map(row),
    )
}
