//! Why a campaign cannot be planned, flown or put together.

use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use toml::de::{DeTable, DeValue};

use crate::splitting::SplittingError;
use tautline_report::report::ArtefactError;
use tautline_report::request::Failure;
use tautline_sim::scenario::{Place, ScenarioError};
use tautline_sim::sim::SimError;

/// Why a campaign cannot be planned, flown or put together.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// A specification that cannot be read, or that makes no campaign.
    #[error("{message}")]
    Input {
        /// The stable name of the problem.
        code: &'static str,
        /// What is wrong.
        message: String,
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
    MissingShards {
        /// Which, as `tautline campaign shard --shard` takes them.
        list: String,
        /// Of how many.
        shards: u64,
        /// Those whose parts are there and damaged.
        damaged: Vec<DamagedPart>,
    },
    /// Two parts of one shard that say different things.
    #[error("two machines flew shard {shard} with different results: {kept} and {other}")]
    Nondeterministic {
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
            Self::Input { code, .. } => code,
            Self::Scenario { error, .. } => error.code(),
            Self::Flight { .. } => "campaign/flight",
            Self::Splitting { .. } => "campaign/splitting",
            Self::Foreign { .. } => "campaign/other-campaign",
            Self::MissingShards { .. } => "campaign/missing-shards",
            Self::Nondeterministic { .. } => "campaign/other-bits",
            Self::Machine { .. } => "files/cannot-access",
        }
    }

    /// Numbers or keys that make no campaign.
    pub(super) fn plan(why: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Input { code: "campaign/plan", message: why.into(), help: help.into(), key: String::new() }
    }

    /// A text that is no specification.
    pub(super) fn specification(name: &str, why: &str) -> Self {
        let (message, help) =
            (format!("{name}: {why}"), "docs/campaigns.md shows every key of a specification".to_owned());
        Self::Input { code: "campaign/specification", message, help, key: String::new() }
    }

    /// A variation that draws nothing.
    pub(super) fn variation(key: &str, why: &str) -> Self {
        let help = "write \"run\" for a seed, or one of { uniform = [low, high] }, log_uniform, { normal = [mean, deviation] }, \
                    { integer = [low, high] }, { list = [...] }, { grid = [...] }, { grid = { from = 0.0, to = 1.0, count = 11 } }";
        let (message, key) = (format!("vary.\"{key}\": {why}"), format!("vary.{key}"));
        Self::Input { code: "campaign/variation", message, help: help.to_owned(), key }
    }

    pub(super) fn scenario(under: &str, key: &str, error: ScenarioError) -> Self {
        Self::Scenario { under: under.to_owned(), key: key.to_owned(), error: Box::new(error) }
    }

    /// Names the key of the specification that a [`CampaignError::Input`] is about.
    pub(super) fn at(mut self, place: &str) -> Self {
        if let Self::Input { key, .. } = &mut self {
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
        matches!(self, Self::Machine { .. } | Self::Nondeterministic { .. })
    }

    /// What to do about it.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        Some(match self {
            Self::Input { help, .. } | Self::Foreign { help, .. } => help.clone(),
            Self::Scenario { error, .. } => return error.help().map(str::to_owned),
            Self::Flight { .. } => return None,
            Self::Splitting { .. } => {
                "let chance have a part in every step (wind, noise of sensing, loss on the network), and split \
                                       into 2 flights at least, with fewer to end in a round"
                    .to_owned()
            }
            Self::MissingShards { list, damaged, .. } => {
                let replaced = if damaged.is_empty() { "" } else { ", which replaces damaged parts" };
                format!("fly them with: tautline campaign shard FOLDER --shard {list}{replaced}")
            }
            Self::Nondeterministic { .. } => {
                "the same flight has the same bits everywhere: look for a faulty machine, or one whose program \
                                   is another; remove the wrong part to go on"
                    .to_owned()
            }
            Self::Machine { .. } => {
                "what was flown before is kept; free some space or mend access, and start again".to_owned()
            }
        })
    }
}

impl From<ArtefactError> for CampaignError {
    fn from(error: ArtefactError) -> Self {
        Self::Machine { what: "cannot write", path: error.path.into(), source: error.source }
    }
}

impl From<CampaignError> for Failure {
    fn from(error: CampaignError) -> Self {
        match error {
            CampaignError::Scenario { under, error, .. } => {
                let failure = Self::from(*error);
                if under.is_empty() { failure } else { failure.under(under.trim_end_matches(": ")) }
            }
            CampaignError::Flight { run, law, error } => {
                Self::from(*error).under(&format!("run {run} under the law {law}"))
            }
            other => {
                let failure = Self::new(other.code(), other.is_machine(), other.to_string());
                other.help().into_iter().fold(failure, Self::with_help)
            }
        }
    }
}

/// What overrides are called in errors of a scenario.
const SET: &str = "--set";

impl CampaignError {
    /// Returns the place in the text of a specification, which is called `name`: the key that the error is about, or else its table. None
    /// where the error is not about the specification.
    #[must_use]
    pub fn place(&self, name: &str, text: &str) -> Option<Place> {
        let keys = match self {
            Self::Input { key, .. } => vec![key.clone()],
            Self::Scenario { key, error, .. } => match error.place() {
                Some(place) if place.source == SET && !key.starts_with("vary.") => {
                    let set = place.text.split('=').next().unwrap_or_default().trim();
                    vec![format!("vary.{set}"), format!("set.{set}"), key.clone()]
                }
                // The scenario's own file has the place.
                Some(place) if place.source != SET && !key.starts_with("vary.") => return None,
                _ => vec![key.clone()],
            },
            _ => return None,
        };
        let parsed = DeTable::parse(text).ok()?;
        let span = keys.iter().find_map(|key| find(parsed.get_ref(), key)).or_else(|| {
            let key = keys.first()?;
            std::iter::successors(key.rsplit_once('.'), |(table, _)| table.rsplit_once('.'))
                .find_map(|(table, _)| find(parsed.get_ref(), table))
        })?;
        Some(Place::new(name, text, span))
    }
}

/// The bytes of a key, whose tables' names stand before it, each in a table of its own or joined by dots.
fn find(table: &DeTable<'_>, key: &str) -> Option<Range<usize>> {
    table.iter().find_map(|(name, value)| {
        let rest = key.strip_prefix(&**name.get_ref())?;
        match (rest.strip_prefix('.'), value.get_ref()) {
            (None, _) => rest.is_empty().then(|| name.span()),
            (Some(below), DeValue::Table(table)) => find(table, below),
            (Some(_), _) => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "scenario = \"pentagon\"\nruns = 3\n[vary]\n\"start.jitter_m\" = 1\nlaw.alpha = { unifrom = [0, 1] }\n\
                        [vary.network]\n  loss = 2\n[stop]\nwidth = 3\n";

    #[test]
    fn a_key_is_found_however_it_is_written_and_else_its_table() {
        let at = |key: &str| {
            let place = CampaignError::plan("", "").at(key).place("spec.toml", TEXT)?;
            Some((place.line, place.column))
        };
        assert_eq!(at("runs"), Some((2, 1)));
        assert_eq!(at("vary.start.jitter_m"), Some((4, 1)));
        assert_eq!(at("vary.law.alpha.unifrom"), Some((5, 15)));
        assert_eq!(at("vary.network.loss"), Some((7, 3)));
        assert_eq!(at("stop.width"), Some((9, 1)));
        assert_eq!(at("stop.decided"), Some((8, 2)), "its table");
        assert_eq!((at("laws"), at("")), (None, None));
    }
}
