//! One statement, judged.

use serde::{Serialize, Serializer};

/// A statement of ours or of the paper, with what was measured about it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Claim {
    /// Stable name.
    pub id: &'static str,
    /// Where the statement comes from: equation, figure or theorem.
    pub source: &'static str,
    /// The finding about the paper, F1 to F7, that the claim measures.
    pub finding: Option<&'static str>,
    /// Whose statement it is, and how it is expected to fare.
    pub kind: Kind,
    /// What is stated.
    pub statement: &'static str,
    /// What the measurement should give.
    pub expected: String,
    /// What it gave, in words.
    pub measured: String,
    /// The key numbers behind these words by name, units in the names; a JSON object in files, where a number that is not
    /// finite is null.
    #[serde(serialize_with = "as_object")]
    pub values: Vec<(&'static str, f64)>,
    /// By how much the measurement may differ.
    pub tolerance: String,
    /// Why by so much.
    pub reason: &'static str,
    /// Whether the measurement is as expected.
    pub pass: bool,
}

/// Whose statement it is, and how it is expected to fare.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
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

/// A claim is built up by the methods of its fields' names; it fails until `pass` or `at_most` judges
/// it.
impl Claim {
    pub(super) fn new(kind: Kind, id: &'static str, source: &'static str) -> Self {
        Self { id, source, kind, ..Self::default() }
    }

    /// What stands in the place of claims that could not be tried.
    pub(super) fn untried(error: &impl ToString) -> Self {
        Self::new(Kind::Ours, "tried", "this program")
            .statement("These claims can be tried.")
            .expected("every flight can be flown")
            .measured(error.to_string())
            .tolerance("none")
            .reason("a law or a plant that gives up is broken")
    }

    pub(super) fn finding(self, finding: &'static str) -> Self {
        Self { finding: Some(finding), ..self }
    }

    pub(super) fn statement(self, statement: &'static str) -> Self {
        Self { statement, ..self }
    }

    pub(super) fn expected(self, expected: impl Into<String>) -> Self {
        Self { expected: expected.into(), ..self }
    }

    pub(super) fn measured(self, measured: impl Into<String>) -> Self {
        Self { measured: measured.into(), ..self }
    }

    pub(super) fn values(self, values: impl IntoIterator<Item = (&'static str, f64)>) -> Self {
        Self { values: values.into_iter().collect(), ..self }
    }

    pub(super) fn tolerance(self, tolerance: impl Into<String>) -> Self {
        Self { tolerance: tolerance.into(), ..self }
    }

    pub(super) fn reason(self, reason: &'static str) -> Self {
        Self { reason, ..self }
    }

    pub(super) fn pass(self, pass: bool) -> Self {
        Self { pass, ..self }
    }

    /// A claim that a ratio of this name, its only number, is within this tolerance of 0.
    pub(super) fn at_most(self, name: &'static str, ratio: f64, limit: f64) -> Self {
        self.values([(name, ratio)]).tolerance(format!("{limit:e}")).pass(ratio <= limit)
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
