//! One statement, judged.

use serde::{Deserialize, Serialize, Serializer};

/// A statement of ours or of the paper, with what was measured about it.
///
/// `claims.json` holds what is known before anything is measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Claim {
    /// Stable name.
    pub id: &'static str,
    /// Where the statement comes from: equation, figure or theorem.
    pub source: &'static str,
    /// The finding about the paper, F1 to F7, that the claim measures.
    #[serde(borrow)]
    pub finding: Option<&'static str>,
    /// Whose statement it is, and how it is expected to fare.
    pub kind: Kind,
    /// What is stated.
    pub statement: &'static str,
    /// What the measurement should give.
    pub expected: &'static str,
    /// What it gave, in words.
    pub measured: String,
    /// The key numbers behind these words by name, units in the names; a JSON object in files, where a number that is not
    /// finite is null.
    #[serde(serialize_with = "as_object", skip_deserializing)]
    pub values: Vec<(&'static str, f64)>,
    /// By how much the measurement may differ.
    pub tolerance: &'static str,
    /// Why by so much.
    pub reason: &'static str,
    /// Whether the measurement is as expected.
    pub pass: bool,
}

/// Whose statement it is, and how it is expected to fare.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// This program's own: it must hold.
    #[default]
    Ours,
    /// The paper's, and it holds.
    PaperHolds,
    /// The paper's, and it is refuted: what must hold is the refutation.
    PaperRefuted,
}

/// Claims about one thing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// Stable name.
    pub id: &'static str,
    /// What they are about.
    pub title: &'static str,
    /// The claims.
    pub claims: Vec<Claim>,
}

impl Claim {
    /// What stands in the place of claims that could not be tried.
    pub(super) fn untried(error: &impl ToString) -> Self {
        Self {
            id: "tried",
            source: "this program",
            statement: "These claims can be tried.",
            expected: "every flight can be flown",
            measured: error.to_string(),
            tolerance: "none",
            reason: "a law or a plant that gives up is broken",
            ..Self::default()
        }
    }

    /// The number that the tolerance begins with; NaN, which nothing is within, where it begins with none.
    pub(super) fn limit(&self) -> f64 {
        self.tolerance.split(' ').next().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN)
    }

    /// What the measurement gave; the claim still fails until it is judged.
    pub(super) fn measured(self, words: String, values: impl IntoIterator<Item = (&'static str, f64)>) -> Self {
        Self { measured: words, values: values.into_iter().collect(), ..self }
    }

    pub(super) fn pass(self, pass: bool) -> Self {
        Self { pass, ..self }
    }

    /// A claim that every number measured is, without its sign, at most [`Claim::limit`].
    pub(super) fn within_limit(self) -> Self {
        let limit = self.limit();
        let pass = self.values.iter().all(|(_, number)| number.abs() <= limit);
        self.pass(pass)
    }

    pub(super) fn but_only_if(self, holds: bool) -> Self {
        let pass = self.pass && holds;
        self.pass(pass)
    }

    /// How the statement fared, in two words at most.
    #[must_use]
    pub fn outcome(&self) -> &'static str {
        match (self.kind, self.pass) {
            (Kind::Ours, true) => "holds",
            (Kind::PaperHolds, true) => "paper: holds",
            (Kind::PaperRefuted, true) => "paper: refuted",
            (Kind::Ours | Kind::PaperHolds, false) => "FAILS",
            (Kind::PaperRefuted, false) => "NOT REFUTED",
        }
    }

    /// The measured number of this name.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<f64> {
        self.values.iter().find(|(key, _)| *key == name).map(|&(_, value)| value)
    }
}

fn as_object<S: Serializer>(values: &[(&str, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(values.iter().copied())
}
