//! One statement, judged.

use rayon::prelude::*;
use serde::{Deserialize, Serialize, Serializer};

use super::convergence::Refinement;
use tautline_report::figures::Figure;
use tautline_report::report::Tool;

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
            statement: "The claims of this group can be measured.",
            expected: "every flight can be flown",
            measured: error.to_string(),
            tolerance: "none",
            reason: "a flight that fails is a defect",
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

/// Counts further units of finished work, from any thread.
pub(super) type Progress<'a> = dyn Fn(u64) + Sync + 'a;

/// Why claims could not be tried: a law, a scenario or a flight failed. It cannot happen in a program that works.
pub(super) type Untried = Box<dyn std::error::Error + Send + Sync>;

/// Claims, judged.
pub(super) type Judged = Result<Vec<Claim>, Untried>;

/// The claim of this name as `claims.json` states it: it fails until it is judged.
pub(super) fn stated(id: &str) -> Result<Claim, Untried> {
    let claims: Vec<Claim> = serde_json::from_str(include_str!("claims.json"))?;
    claims.into_iter().find(|claim| claim.id == id).ok_or_else(|| format!("unknown claim {id}").into())
}

/// Tries each of these in parallel, a unit of work each; the results are in their order.
pub(super) fn try_each<T: Sync, R: Send>(
    trials: &[T],
    progress: &Progress<'_>,
    attempt: impl Fn(&T) -> Result<R, Untried> + Sync,
) -> Result<Vec<R>, Untried> {
    trials.par_iter().map(|trial| attempt(trial).inspect(|_| progress(1))).collect()
}

/// Version of the keys of `validate.json`: raised when one is renamed, removed or changes its meaning.
pub const SCHEMA_VERSION: u32 = 1;

/// The result of [`validate`](super::validate).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Validation {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// What judged.
    pub tool: Tool,
    /// Whether every claim is as expected.
    pub pass: bool,
    /// All claims.
    pub groups: Vec<Group>,
    /// Rapier against continuous time, from coarse to fine steps.
    #[serde(rename = "ladder")]
    pub convergence: Vec<Refinement>,
    /// The paper's figures, and that of the convergence.
    #[serde(skip)]
    pub figures: Vec<Figure>,
    /// Wall-clock time: the only part that differs from run to run.
    pub performance: Performance,
}

/// Wall-clock time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Performance {
    /// From start to end \[s\].
    pub wall_s: f64,
}

impl Validation {
    pub(super) fn new(groups: Vec<Group>, convergence: Vec<Refinement>, figures: Vec<Figure>, wall_s: f64) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            tool: Tool { name: tautline_core::PROGRAM.to_owned(), version: tautline_core::VERSION.to_owned() },
            pass: groups.iter().flat_map(|group| &group.claims).all(|claim| claim.pass),
            groups,
            convergence,
            figures,
            performance: Performance { wall_s },
        }
    }

    /// All claims in their order.
    pub fn claims(&self) -> impl Iterator<Item = &Claim> {
        self.groups.iter().flat_map(|group| &group.claims)
    }

    /// The claim of this id.
    #[must_use]
    pub fn claim(&self, id: &str) -> Option<&Claim> {
        self.claims().find(|claim| claim.id == id)
    }

    /// `validate.json`.
    ///
    /// # Errors
    /// When the result cannot be written as JSON, which its types rule out.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|json| json + "\n")
    }
}
