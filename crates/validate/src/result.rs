//! All claims and what goes with them: `validate.json`.

use serde::Serialize;

use super::claim::{Claim, Group};
use super::convergence::Refinement;
use tautline_report::figures::Figure;
use tautline_report::report::Tool;

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
