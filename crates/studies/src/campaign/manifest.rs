//! `manifest.json`: everything that a shard needs to be flown anywhere, and what tells one campaign from another.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::SCHEMA_VERSION;
use tautline_report::report::write_atomically;
use tautline_report::request::Failure;

/// Everything that a shard needs to be flown anywhere.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of these keys and of the parts.
    pub schema_version: u32,
    /// SHA-256 over everything below but `shards` and `folder`: two campaigns with the same one fly the same flights.
    pub campaign: String,
    /// Name of the campaign: that of its specification's file.
    pub name: String,
    /// What flies it.
    pub tool: Program,
    /// What the scenario is called.
    pub scenario_name: String,
    /// Its TOML.
    pub scenario: String,
    /// The specification, with everything that the command line added.
    pub spec: String,
    /// Number of runs.
    pub runs: u64,
    /// SHA-256 of the resolved scenario of run 0 under each law: other files that a scenario names make another campaign.
    pub first: Vec<String>,
    /// Into how many parts the runs are split.
    pub shards: u64,
    /// The folder that paths in the scenario count from, as it was planned.
    pub folder: PathBuf,
}

/// A program, to its last bit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 of its file.
    pub sha256: String,
}

/// The file that holds this crate, where it is not that of the process.
static HOLDER: OnceLock<PathBuf> = OnceLock::new();

impl Program {
    /// Says which file holds this crate where it is a library that a program of others loads. Said once, before any campaign:
    /// what flies is known by that file then.
    pub fn is_in(file: PathBuf) {
        // Whoever says it again says the same.
        let _ = HOLDER.set(file);
    }

    /// The one that is running.
    ///
    /// # Errors
    /// [`Failure`] where its file cannot be read.
    pub fn running() -> Result<Self, Failure> {
        let path = HOLDER.get().cloned().map_or_else(std::env::current_exe, Ok);
        let path = path.map_err(cannot("read", Path::new("the program")))?;
        let program = fs::read(&path).map_err(cannot("read", &path))?;
        Ok(Self {
            name: tautline_core::PROGRAM.to_owned(),
            version: tautline_core::VERSION.to_owned(),
            sha256: base16(&Sha256::digest(program)),
        })
    }
}

impl Manifest {
    /// The same manifest with its own hash.
    #[must_use]
    pub(super) fn sealed(mut self) -> Self {
        self.campaign = self.hash();
        self
    }

    fn hash(&self) -> String {
        let Self { schema_version, name, tool, scenario_name, scenario, spec, runs, first, .. } = self;
        let (version, runs) = (schema_version.to_string(), runs.to_string());
        let texts = [&version, name, &tool.sha256, scenario_name, scenario, spec, &runs];
        let mut hash = Sha256::new();
        for text in texts.into_iter().chain(first) {
            // Lengths keep what ends one text from beginning the next.
            hash.update((text.len() as u64).to_le_bytes());
            hash.update(text);
        }
        base16(&hash.finalize())
    }

    /// Runs of a shard, from 0: as many as its neighbours', give or take one.
    #[must_use]
    pub fn range(&self, shard: u64) -> std::ops::Range<u64> {
        let shards = self.shards.max(1);
        // The same as shard times runs over shards, which may be larger than any number.
        let at = |shard: u64| self.runs / shards * shard + self.runs % shards * shard / shards;
        at(shard)..at(shard + 1)
    }

    /// Reads a manifest.
    ///
    /// # Errors
    /// [`Failure`] `campaign/other-campaign` if the file is missing, is not a manifest, was changed by hand, or was planned by
    /// another program.
    pub fn read(path: &Path, program: &Program) -> Result<Self, Failure> {
        let foreign = |problem: &str, remedy: &str| Err(other_campaign(path, problem, remedy));
        let text = match fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return foreign("no such campaign", "plan one with: tautline campaign plan SPEC.toml --out FOLDER");
            }
            Err(error) => return Err(cannot("read", path)(error)),
        };
        let read = match serde_json::from_str::<Self>(&text) {
            Ok(read) => read,
            Err(error) => return foreign(&format!("not a manifest: {error}"), "plan the campaign again"),
        };
        if read.schema_version != SCHEMA_VERSION || read.shards == 0 || read.shards > read.runs {
            let problem = format!("a manifest of version {} with {} shards", read.schema_version, read.shards);
            return foreign(&problem, "plan the campaign again with this program");
        }
        let hash = read.hash();
        if hash != read.campaign {
            let problem =
                format!("the manifest was edited: it names campaign {}, and its contents are {hash}", read.campaign);
            return foreign(&problem, "plan the campaign again, into another folder");
        }
        if read.tool.sha256 != program.sha256 {
            let problem = format!(
                "planned by {} {} with the SHA-256 {}, and this is {} with the SHA-256 {}",
                read.tool.name, read.tool.version, read.tool.sha256, program.version, program.sha256
            );
            return foreign(
                &problem,
                "use the same program everywhere, or plan the campaign again into another folder",
            );
        }
        Ok(read)
    }

    /// Writes the manifest.
    ///
    /// # Errors
    /// [`Failure`] if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let json = serde_json::to_string_pretty(self).map_err(|error| cannot("write", path)(error.into()))?;
        Ok(write_atomically(path, (json + "\n").as_bytes())?)
    }
}

/// Returns the failure of a file or folder that belongs to another campaign or program.
pub(super) fn other_campaign(path: &Path, problem: impl AsRef<str>, remedy: impl AsRef<str>) -> Failure {
    Failure::input("campaign/other-campaign", problem, remedy).of(path)
}

/// Returns a function that makes the failure of a file that cannot be read or written.
pub(super) fn cannot(what: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Failure {
    let path = path.display();
    move |error| {
        Failure::machine("files/cannot-access", format!("{path}: cannot {what} the file: {error}"))
            .with_help("free some space or mend access, and start again: finished flights are kept")
    }
}

/// Bytes in hexadecimal digits.
pub(super) fn base16(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string does not fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
