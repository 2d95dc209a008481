//! The result in words: a line a claim for the terminal, tables for `docs/validation.md`.

use super::claim::{Claim, Kind};
use super::convergence::Refinement;
use super::result::Validation;

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
            let finding = claim.finding.map(|finding| format!("[{finding}] ")).unwrap_or_default();
            text + &format!("{:outcomes$}  {:names$}  {finding}{}\n", claim.outcome(), claim.id, claim.measured)
        })
    }

    /// The generated part of `docs/validation.md`.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut page = format!("{}.\n\n## Errata of the paper\n\n{}", capitalised(&self.headline()), self.errata());
        for group in &self.groups {
            page.extend(["\n## ", group.title, "\n"]);
            for claim in &group.claims {
                page += &entry(claim);
            }
        }
        page + "\n## Convergence ladder\n\n" + &self.convergence_table()
    }

    fn errata(&self) -> String {
        let mut table =
            "| finding | the statement | what was measured | claim |\n| --- | --- | --- | --- |\n".to_owned();
        let mut findings: Vec<(&str, &Claim)> = self
            .claims()
            .filter(|claim| claim.kind == Kind::PaperRefuted)
            .filter_map(|claim| Some((claim.finding?, claim)))
            .collect();
        findings.sort_by_key(|&(finding, _)| finding);
        for (finding, Claim { id, statement, measured, .. }) in findings {
            table.extend(["| ", finding, " | ", statement, " | ", measured, " | `", id, "` |\n"]);
        }
        table
    }

    fn convergence_table(&self) -> String {
        let head = "Largest position error on the pentagon's flight against continuous time, 10 looks a second for 10 \
                    seconds.\n\n| step [s] | position error [m] | order | energy excess [m^2/s^2] |\n\
                    | --- | --- | --- | --- |\n";
        let rows = self.convergence.iter().map(|Refinement { dt_s, error_m, order, energy_excess_m2_s2, .. }| {
            let order = order.map_or("-".to_owned(), |order| format!("{order:.2}"));
            let hz = 1.0 / dt_s;
            format!("| 1/{hz:.0} | {error_m:.1e} | {order} | {energy_excess_m2_s2:.1e} |\n")
        });
        std::iter::once(head.to_owned()).chain(rows).collect()
    }
}

fn capitalised(text: &str) -> String {
    let mut rest = text.chars();
    rest.next().map(|first| first.to_uppercase().chain(rest).collect()).unwrap_or_default()
}

fn entry(claim: &Claim) -> String {
    let Claim { id, statement, source, expected, measured, tolerance, reason, .. } = claim;
    let head = format!("\n### {}: `{id}`\n\n{statement} ({source})\n\n", capitalised(claim.outcome()));
    head + &format!("- expected: {expected}\n- measured: {measured}\n- tolerance: {tolerance} ({reason})\n")
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
    fn a_refuted_statement_of_the_paper_is_called_refuted_and_is_no_failure() {
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
        assert!(page.contains("| F9 | Nothing moves. | none | `c` |"), "{page}");
        assert!(page.contains("### Paper: refuted: `c`"), "{page}");
        assert!(judged.to_html().contains("paper: refuted"));
    }

    #[test]
    fn a_claim_that_is_not_as_expected_is_never_hidden() {
        for (kind, outcome) in [(Kind::Ours, "FAILS"), (Kind::PaperHolds, "FAILS"), (Kind::PaperRefuted, "NOT REFUTED")]
        {
            let judged = validation(vec![claim("a", Kind::Ours, true), claim("b", kind, false)]);
            assert!(!judged.pass);
            assert_eq!(judged.headline(), "NOT VALID: 1 of 2 claims are not as expected");
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
