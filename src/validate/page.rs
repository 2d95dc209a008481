//! The result in words: a line a claim for the terminal, tables for `docs/validation.md`.

use std::fmt::Write as _;

use super::{Claim, Kind, Validation};

impl Validation {
    /// The result in one line.
    #[must_use]
    pub fn headline(&self) -> String {
        let count = |kind: Kind| self.claims().filter(|claim| claim.kind == kind && claim.pass).count();
        let (all, failed) = (self.claims().count(), self.claims().filter(|claim| !claim.pass).count());
        if failed > 0 {
            return format!("NOT VALID: {failed} of {all} claims are not as expected");
        }
        format!(
            "valid: all {all} claims are as expected: {} of ours hold, {} of the paper's hold, {} of the paper's are refuted",
            count(Kind::Ours),
            count(Kind::PaperHolds),
            count(Kind::PaperRefuted)
        )
    }

    /// A line a claim: how it fared, its name, what was measured.
    #[must_use]
    pub fn text(&self) -> String {
        let width = |of: fn(&Claim) -> usize| self.claims().map(of).max().unwrap_or(0);
        let (outcomes, names) = (width(|claim| claim.outcome().len()), width(|claim| claim.id.len()));
        self.claims().fold(String::new(), |text, claim| {
            text + &format!("{:outcomes$}  {:names$}  {}\n", claim.outcome(), claim.id, claim.measured)
        })
    }

    /// The tables of `docs/validation.md`.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut page = format!("{}.\n", self.headline());
        for group in &self.groups {
            // Writing to a string cannot fail.
            let _ = write!(page, "\n### {}\n", group.title);
            for claim in &group.claims {
                let _ = write!(page, "\n{}", entry(claim));
            }
        }
        page
    }
}

fn entry(claim: &Claim) -> String {
    format!(
        "**`{}`: {}** ({})\n\n> {}\n\n- expected: {}\n- measured: {}\n- tolerance: {} ({})\n",
        claim.id,
        claim.outcome(),
        claim.source,
        claim.statement,
        claim.expected,
        claim.measured,
        claim.tolerance,
        claim.reason
    )
}
