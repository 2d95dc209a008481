//! One statement, judged.

use serde::ser::SerializeMap as _;
use serde::{Serialize, Serializer};

use super::ValidateError;

/// A statement of ours or of the paper, with what was measured about it.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
    /// The key numbers behind these words; units are in the names.
    pub values: Values,
    /// By how much the measurement may differ.
    pub tolerance: String,
    /// Why by so much.
    pub reason: &'static str,
    /// Whether the measurement is as expected.
    pub pass: bool,
}

/// Whose statement it is, and how it is expected to fare.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// This program's own: it must hold.
    Ours,
    /// The paper's, and it holds.
    PaperHolds,
    /// The paper's, and it is refuted: what must hold is the refutation.
    PaperRefuted,
}

impl Claim {
    /// What stands in the place of claims that could not be tried.
    pub(super) fn untried(error: &ValidateError) -> Self {
        Self {
            id: "tried",
            source: "this program",
            finding: None,
            kind: Kind::Ours,
            statement: "These claims can be tried.",
            expected: "every flight can be flown".to_owned(),
            measured: error.to_string(),
            values: Values::default(),
            tolerance: "none".to_owned(),
            reason: "a law or a plant that gives up is broken",
            pass: false,
        }
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
        self.values.0.iter().find(|(key, _)| *key == name).map(|&(_, value)| value)
    }
}

/// Named numbers in a fixed order; a JSON object in files, where a number that is not finite is null.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Values(pub Vec<(&'static str, f64)>);

impl<const N: usize> From<[(&'static str, f64); N]> for Values {
    fn from(values: [(&'static str, f64); N]) -> Self {
        Self(values.to_vec())
    }
}

impl Serialize for Values {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, value) in &self.0 {
            map.serialize_entry(name, value)?;
        }
        map.end()
    }
}
