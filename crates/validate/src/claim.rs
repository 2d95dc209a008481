//! Claims, groups of claims and the result of a validation.

use rayon::prelude::*;
use serde::{Deserialize, Serialize, Serializer};

use super::convergence::Refinement;
use tautline_core::monitor::Monitor;
use tautline_report::figures::Figure;
use tautline_report::report::Tool;

/// Statement of tautline or of the paper, with its measurement. `claims.json` holds all texts except the measurement.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Claim {
    /// Stable name.
    pub id: &'static str,
    /// Source of the statement: equation, figure or theorem.
    pub source: &'static str,
    /// Finding about the paper, F1 to F7, that the claim measures.
    #[serde(borrow)]
    pub finding: Option<&'static str>,
    /// Author of the statement, and the expected result.
    pub kind: Kind,
    /// Statement.
    pub statement: &'static str,
    /// Expected measurement.
    pub expected: &'static str,
    /// Measurement in words.
    pub measured: String,
    /// Measured numbers by name, with units in the names; a JSON object in files, with null for numbers that are not
    /// finite.
    #[serde(serialize_with = "as_object", skip_deserializing)]
    pub values: Vec<(&'static str, f64)>,
    /// Largest difference between measured and expected.
    pub tolerance: &'static str,
    /// Reason for the tolerance.
    pub reason: &'static str,
    /// Whether the measurement is as expected.
    pub pass: bool,
}

/// Author of a statement, and the expected result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Of tautline; must hold.
    #[default]
    Ours,
    /// Of the paper; must hold.
    PaperHolds,
    /// Of the paper; must be refuted.
    PaperRefuted,
}

/// Claims about one subject.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// Stable name.
    pub id: &'static str,
    /// Subject.
    pub title: &'static str,
    /// Claims.
    pub claims: Vec<Claim>,
}

impl Claim {
    /// Returns the claim in place of a group whose measurement failed.
    pub(super) fn failed_group(error: &impl ToString) -> Self {
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

    /// Returns the first number of the tolerance; NaN without a number, which fails every comparison.
    pub(super) fn limit(&self) -> f64 {
        self.tolerance.split(' ').next().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN)
    }

    /// Adds the measurement. The claim fails until [`Claim::pass`] is called.
    pub(super) fn measured(self, words: String, values: impl IntoIterator<Item = (&'static str, f64)>) -> Self {
        Self { measured: words, values: values.into_iter().collect(), ..self }
    }

    pub(super) fn pass(self, pass: bool) -> Self {
        Self { pass, ..self }
    }

    /// Passes the claim if no measured number is larger than [`Claim::limit`] in magnitude.
    pub(super) fn within_limit(self) -> Self {
        let limit = self.limit();
        let pass = self.values.iter().all(|(_, number)| number.abs() <= limit);
        self.pass(pass)
    }

    pub(super) fn but_only_if(self, holds: bool) -> Self {
        let pass = self.pass && holds;
        self.pass(pass)
    }

    /// Returns the result in at most two words.
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

    /// Returns the measured number of a name.
    #[must_use]
    pub fn value(&self, name: &str) -> Option<f64> {
        self.values.iter().find(|(key, _)| *key == name).map(|&(_, value)| value)
    }
}

fn as_object<S: Serializer>(values: &[(&str, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(values.iter().copied())
}

/// Receives finished units of work, from any thread, and ends the work at an interruption.
pub(super) type Progress<'a> = dyn Monitor + 'a;

/// Reason why claims could not be measured: a failed law, scenario or flight, which is a defect.
pub(super) type MeasureError = Box<dyn std::error::Error + Send + Sync>;

/// Measured claims, or the reason why they could not be measured.
pub(super) type ClaimsResult = Result<Vec<Claim>, MeasureError>;

/// Measurement of one claim.
pub(super) type Measure = fn(&Progress<'_>) -> Result<Claim, MeasureError>;

/// Returns the claim of a name from `claims.json`. It fails until it is measured.
pub(super) fn stated(id: &str) -> Result<Claim, MeasureError> {
    let claims: Vec<Claim> = serde_json::from_str(include_str!("claims.json"))?;
    claims.into_iter().find(|claim| claim.id == id).ok_or_else(|| format!("unknown claim {id}").into())
}

/// Calls `attempt` for each trial in parallel, with a unit of work each, and returns the results in order. An
/// interruption is an error.
pub(super) fn try_each<T: Sync, R: Send>(
    trials: &[T],
    progress: &Progress<'_>,
    attempt: impl Fn(&T) -> Result<R, MeasureError> + Sync,
) -> Result<Vec<R>, MeasureError> {
    let try_one = |trial| if progress.is_interrupted() { Err("interrupted".into()) } else { attempt(trial) };
    trials.par_iter().map(|trial| try_one(trial).inspect(|_| progress.advance(1))).collect()
}

/// Version of the keys of `validate.json`. It rises if a key is renamed, removed or changes its meaning.
pub const SCHEMA_VERSION: u32 = 1;

/// Result of [`validate`](super::validate).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Validation {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name and version of the program that measured the claims.
    pub tool: Tool,
    /// Whether every claim is as expected.
    pub pass: bool,
    /// All claims.
    pub groups: Vec<Group>,
    /// Errors of Rapier against continuous time, from coarse to fine steps.
    #[serde(rename = "ladder")]
    pub convergence: Vec<Refinement>,
    /// Figures of the paper, and of the convergence.
    #[serde(skip)]
    pub figures: Vec<Figure>,
    /// Wall-clock time: the only part that differs between runs.
    pub performance: Performance,
}

/// Wall-clock time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Performance {
    /// Duration of the validation \[s\].
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

    /// Returns all claims in order.
    pub fn claims(&self) -> impl Iterator<Item = &Claim> {
        self.groups.iter().flat_map(|group| &group.claims)
    }

    /// Returns the claim of a name.
    #[must_use]
    pub fn claim(&self, id: &str) -> Option<&Claim> {
        self.claims().find(|claim| claim.id == id)
    }

    /// Returns the result as `validate.json`.
    ///
    /// # Errors
    /// None in practice: every value has a JSON form.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|json| json + "\n")
    }
}
