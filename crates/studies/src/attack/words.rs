//! The worst that was found in words: a sentence, what one must know to read it, and a table for the terminal.

use super::method::Method;
use super::result::{Attack, Candidate, Flown};
use crate::compare::Outcome;
use tautline_core::text::{aligned, as_toml, at_least, counted, exact, metres, metres_below, seconds};

/// What every search says of itself.
pub(super) const CAVEAT: &str = "This is a search, not a proof: what it did not find may be there all the same, and the worst found need not be the worst.";

impl Method {
    /// Its name in a sentence.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::CmaEs => "CMA-ES",
            Self::Random => "uniform random search",
        }
    }
}

impl Attack {
    /// What was found, in two sentences.
    #[must_use]
    pub fn headline(&self) -> String {
        let broken = if self.certificates_broken > 0 { "CERTIFICATE BROKEN, " } else { "" };
        format!("{broken}{}. {CAVEAT}", self.found())
    }

    /// What was found, in a sentence without its end.
    fn found(&self) -> String {
        let flights = counted(self.flights, "flight", "flights");
        let delta = exact(self.delta_m);
        let Some(worst) = self.worst() else { return "no flight was flown: no candidate could be".to_owned() };
        if self.violated == 0 && self.own.outcome == Outcome::Violated {
            return format!(
                "VIOLATION in the scenario as it is; {flights} beside it found none: the worst came to {}",
                self.closest(worst)
            );
        }
        let unknown = self.ended_early + self.undecided;
        if self.violated == 0 && unknown >= self.flights {
            return format!("nothing is known: of {flights} none was flown to its end and judged");
        }
        if self.violated == 0 {
            return format!(
                "no violation found in {flights}: the worst came to {} (delta {delta} m)",
                self.closest(worst)
            );
        }
        let violated = format!("{} of {flights} violated", self.violated);
        format!("VIOLATION found: {} (delta {delta} m); {violated}", self.closest(worst))
    }

    /// How close two came, when and who.
    fn closest(&self, worst: &Candidate) -> String {
        let Flown { min_m, min_at_s, min_pair, .. } = &worst.flown;
        let Some(min_m) = *min_m else { return "no two vehicles".to_owned() };
        let shown = if min_m < self.delta_m { metres_below(min_m, self.delta_m) } else { at_least(min_m, 3) };
        let at = min_at_s.map_or_else(String::new, |at_s| format!(" at {}", seconds(at_s)));
        let pair = min_pair.map_or_else(String::new, |[a, b]| format!(", vehicles {a}-{b}"));
        format!("{shown} m{at}{pair}")
    }

    /// What one must know to read it, a sentence each.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let broken = (self.certificates_broken > 0).then(|| {
            format!(
                "DEFECT: in {} two came closer than the law's certificate promises; that is a defect of law, plant or step, \
                 whatever delta says: please report it with the command below",
                counted(self.certificates_broken, "flight", "flights")
            )
        });
        let whole = self.certified > 0 && self.certified == self.flights && self.certificates_broken == 0;
        let certified = whole.then(|| {
            "every flight had a certificate of its law and kept it; a certificate, unlike a search, is a proof"
                .to_owned()
        });
        let obstacle = self.worst().filter(|worst| {
            worst.flown.outcome == Outcome::Violated && worst.flown.min_m.is_some_and(|min_m| min_m >= self.delta_m)
        });
        let obstacle = obstacle.map(|_| {
            "the violation is of an obstacle's clearance; the search looks at separations of vehicles alone".to_owned()
        });
        let interrupted = self
            .interrupted
            .then(|| format!("interrupted: of {} flights {} were flown", self.flights_asked, self.flights));
        let exhausted = self.exhausted.then(|| {
            format!(
                "hardly any candidate within the bounds can be flown: of {} flights {} were; narrow the bounds",
                self.flights_asked, self.flights
            )
        });
        let refused = (self.refused > 0).then(|| {
            let first = self.first_refusal.as_ref().map_or_else(String::new, |first| format!(", the first: {first}"));
            let candidates = counted(self.refused, "candidate", "candidates");
            format!("{candidates} could not be flown and cost no flight{first}")
        });
        let at_start = self.worst().filter(|worst| worst.flown.min_at_s == Some(0.0)).map(|_| {
            "the worst is a start of two that near, and nothing that comes of it; --apart keeps starts farther apart".to_owned()
        });
        let early = (self.ended_early > 0).then(|| {
            let flights = counted(self.ended_early, "flight", "flights");
            format!("{flights} ended early without a violation, and count with what the judge saw up to then")
        });
        let undecided = (self.undecided > 0)
            .then(|| format!("the judge could not tell about {}", counted(self.undecided, "flight", "flights")));
        [broken, certified, obstacle, interrupted, exhausted, refused, at_start, early, undecided]
            .into_iter()
            .flatten()
            .collect()
    }

    /// Bounds and the worst values as rows: key, smallest, largest, worst.
    pub(super) fn rows(&self) -> Vec<[String; 4]> {
        let worst = |k: usize| self.worst().and_then(|worst| worst.values.get(k).copied());
        let row = |(k, bound): (usize, &super::bounds::Bound)| {
            let worst = worst(k).map_or_else(|| "-".to_owned(), as_toml);
            [bound.key.clone(), as_toml(bound.low), as_toml(bound.high), worst]
        };
        self.bounds.iter().enumerate().map(row).collect()
    }

    /// The scenario as it is beside the worst: how close two came, what was certified and the verdict.
    pub(super) fn beside(&self) -> Vec<[String; 4]> {
        let length = |length: Option<f64>| length.map_or_else(|| "-".to_owned(), metres);
        let row = |what: &str, flown: &Flown| {
            let verdict = flown.outcome.name().replace('_', " ");
            [what.to_owned(), length(flown.min_m), length(flown.certified_m), verdict]
        };
        let worst = self.worst().map(|worst| row("the worst found", &worst.flown));
        std::iter::once(row("as the scenario is", &self.own)).chain(worst).collect()
    }

    /// What was searched and found, as two tables.
    #[must_use]
    pub fn text(&self) -> String {
        let under = |names: [&str; 4], rows: Vec<[String; 4]>| {
            let rows = std::iter::once(names.map(str::to_owned)).chain(rows);
            aligned(&rows.map(|row| row.to_vec()).collect::<Vec<_>>())
        };
        let beside = under(["", "separation [m]", "certified [m]", "verdict"], self.beside());
        format!("{beside}\n{}", under(["key", "smallest", "largest", "worst"], self.rows()))
    }

    /// How much was flown.
    pub(super) fn effort(&self) -> String {
        format!("{}, {}", counted(self.flights, "flight", "flights"), self.method.words())
    }
}
