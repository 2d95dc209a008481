//! Why a campaign cannot be planned, flown or put together.

use std::io;
use std::path::{Path, PathBuf};

use crate::splitting::SplittingError;
use tautline_report::report::ArtefactError;
use tautline_sim::scenario::ScenarioError;
use tautline_sim::sim::SimError;

/// Why a campaign cannot be planned, flown or put together.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// A specification that is not TOML, or has keys that it should not have.
    #[error("{name}: {why}")]
    Spec {
        /// What the text is called.
        name: String,
        /// What is wrong, with its place.
        why: String,
    },
    /// A variation that draws nothing.
    #[error("vary.\"{key}\": {why}")]
    Vary {
        /// The key of the scenario.
        key: String,
        /// What is wrong.
        why: String,
    },
    /// Numbers that make no campaign.
    #[error("{why}")]
    Plan {
        /// What is wrong.
        why: String,
        /// What to do about it.
        help: String,
        /// The key of the specification, with its tables before it; empty where it is about none.
        key: String,
    },
    /// A scenario that cannot be read, or not with these keys.
    #[error("{under}{error}")]
    Scenario {
        /// Which keys, followed by a colon, or nothing.
        under: String,
        /// The key of the specification, with its tables before it.
        key: String,
        /// What is wrong.
        error: Box<ScenarioError>,
    },
    /// A law that does not exist here.
    #[error("run {run} under the law {law}: {error}")]
    Flight {
        /// Number of the run.
        run: u64,
        /// The law's name.
        law: String,
        /// What is wrong.
        error: Box<SimError>,
    },
    /// A run that cannot be split.
    #[error("run {run} under the law {law}: {error}")]
    Splitting {
        /// Number of the run.
        run: u64,
        /// The law's name.
        law: String,
        /// What is wrong.
        error: Box<SplittingError>,
    },
    /// A folder that holds another campaign, or a manifest that is not this program's.
    #[error("{path}: {why}")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// In what it differs, with both hashes.
        why: String,
        /// What to do about it.
        help: String,
    },
    /// Shards that were not flown, or whose parts are damaged.
    #[error("shards {list} of {shards} are missing{}", in_words(damaged))]
    Holes {
        /// Which, as `tautline campaign shard --shard` takes them.
        list: String,
        /// Of how many.
        shards: u64,
        /// Those whose parts are there and damaged.
        damaged: Vec<DamagedPart>,
    },
    /// Two parts of one shard that say different things.
    #[error("two machines flew shard {shard} with different results: {kept} and {other}")]
    Alarm {
        /// Number of the shard.
        shard: u64,
        /// The part that was there.
        kept: PathBuf,
        /// The part that was flown again.
        other: PathBuf,
    },
    /// The machine failed.
    #[error("{what} {path}: {source}")]
    Machine {
        /// What could not be done, such as `cannot read`.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// A part whose contents are not what was written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{path} is damaged: {why}")]
pub struct DamagedPart {
    /// Number of its shard.
    pub shard: u64,
    /// The file.
    pub path: PathBuf,
    /// What shows the damage.
    pub why: &'static str,
}

/// The damaged parts, in clauses behind another.
fn in_words(damaged: &[DamagedPart]) -> String {
    damaged.iter().flat_map(|part| ["; ".to_owned(), part.to_string()]).collect()
}

impl CampaignError {
    /// The stable name of the problem, such as `campaign/missing-shards`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Spec { .. } => "campaign/specification",
            Self::Vary { .. } => "campaign/variation",
            Self::Plan { .. } => "campaign/plan",
            Self::Scenario { error, .. } => error.code(),
            Self::Flight { .. } => "campaign/flight",
            Self::Splitting { .. } => "campaign/splitting",
            Self::Foreign { .. } => "campaign/other-campaign",
            Self::Holes { .. } => "campaign/missing-shards",
            Self::Alarm { .. } => "campaign/other-bits",
            Self::Machine { .. } => "files/cannot-access",
        }
    }

    pub(super) fn plan(why: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Plan { why: why.into(), help: help.into(), key: String::new() }
    }

    pub(super) fn scenario(under: &str, key: &str, error: ScenarioError) -> Self {
        Self::Scenario { under: under.to_owned(), key: key.to_owned(), error: Box::new(error) }
    }

    /// Names the key of the specification that a [`CampaignError::Plan`] is about.
    pub(super) fn at(mut self, place: &str) -> Self {
        if let Self::Plan { key, .. } = &mut self {
            place.clone_into(key);
        }
        self
    }

    pub(super) fn reading(path: &Path, source: io::Error) -> Self {
        Self::Machine { what: "cannot read", path: path.to_owned(), source }
    }

    pub(super) fn writing(path: &Path, source: io::Error) -> Self {
        Self::Machine { what: "cannot write", path: path.to_owned(), source }
    }

    /// Whether the machine is at fault, or two machines disagree, and not the input.
    #[must_use]
    pub fn is_machine(&self) -> bool {
        matches!(self, Self::Machine { .. } | Self::Alarm { .. })
    }

    /// What to do about it.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        Some(match self {
            Self::Spec { .. } => "docs/campaigns.md shows every key of a specification".to_owned(),
            Self::Vary { .. } => "write \"run\" for a seed, or one of { uniform = [low, high] }, log_uniform, { normal = [mean, \
                                  deviation] }, { integer = [low, high] }, { list = [...] }, { grid = [...] }, { grid = { from = \
                                  0.0, to = 1.0, count = 11 } }"
                .to_owned(),
            Self::Plan { help, .. } | Self::Foreign { help, .. } => help.clone(),
            Self::Scenario { error, .. } => return error.help().map(str::to_owned),
            Self::Flight { .. } => return None,
            Self::Splitting { .. } => "let chance have a part in every step (wind, noise of sensing, loss on the network), and split \
                                       into 2 flights at least, with fewer to end in a round"
                .to_owned(),
            Self::Holes { list, damaged, .. } => {
                let replaced = if damaged.is_empty() { "" } else { ", which replaces damaged parts" };
                format!("fly them with: tautline campaign shard FOLDER --shard {list}{replaced}")
            }
            Self::Alarm { .. } => "the same flight has the same bits everywhere: look for a faulty machine, or one whose program \
                                   is another; remove the wrong part to go on"
                .to_owned(),
            Self::Machine { .. } => "what was flown before is kept; free some space or mend access, and start again".to_owned(),
        })
    }
}

impl From<ArtefactError> for CampaignError {
    fn from(error: ArtefactError) -> Self {
        Self::Machine { what: "cannot write", path: error.path.into(), source: error.source }
    }
}
