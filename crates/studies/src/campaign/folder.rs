//! Folder of a campaign: manifest, parts, missing shards, and the merge of all parts into a table and an answer.

use std::collections::hash_map::RandomState;
use std::hash::BuildHasher as _;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::{fs, io};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::flights::Campaign;
use super::shard::{self, PartState, Row, fields};
use super::spec::refused;
use super::summary::{Summary, SummaryAccumulator};
use crate::SCHEMA_VERSION;
use crate::study::Study as _;
use crate::table::{Cell, ParquetTable};
use tautline_core::failure::Failure;
use tautline_core::files::{write_atomically, write_atomically_with};
use tautline_core::option::{OUT, SHARD, SHARDS};
use tautline_core::record::{hex, sha256_hex};
use tautline_core::text::counted;
use tautline_report::request::command_line;
use tautline_sim::scenario::ExternalLaw;

/// File name of the table in the folder of a campaign.
pub const RESULTS: &str = "results.parquet";
/// File name of the answer in the folder of a campaign.
pub const ANSWER: &str = "campaign.json";

/// Number of rows of a row group of the table; one group is in memory.
const GROUP_ROWS: usize = 50_000;
/// Files beside the parts that a new campaign does not overwrite.
const LEFT: [&str; 3] = ["results.parquet", "campaign.json", "campaign.html"];

/// Folder with the campaign in it.
#[derive(Clone, Debug)]
pub struct Folder {
    path: PathBuf,
    campaign: Campaign,
}

impl Folder {
    /// Writes the manifest of a campaign into a folder. A folder with the same campaign stays unchanged; its number of
    /// shards must be equal if `shards_asked`. A folder with fewer runs of the same campaign keeps its flights.
    ///
    /// # Errors
    /// [`Failure`] if the folder holds another campaign, or this campaign in another number of shards.
    pub fn plan(path: &Path, campaign: Campaign, shards_asked: bool) -> Result<Self, Failure> {
        let file = path.join("manifest.json");
        if file.exists() {
            let there = Manifest::read(&file, &campaign.manifest().tool)?;
            let campaign = if there.runs_raised { campaign.raised() } else { campaign };
            let here = campaign.manifest();
            if here.campaign != there.campaign {
                if here.differs_in_runs_alone(&there)? {
                    return Self::raise(path, campaign, there);
                }
                let problem = format!("the folder holds campaign {}, and this is {}", there.campaign, here.campaign);
                return Err(other_campaign(path, problem, format!("give another folder with {OUT}")));
            }
            if shards_asked && here.shards != there.shards {
                let problem = format!("the folder holds this campaign in {} shards, not {}", there.shards, here.shards);
                let remedy = format!("leave {SHARDS} out to continue, or give another folder with {OUT}");
                return Err(other_campaign(path, problem, remedy));
            }
            return Ok(Self { path: path.to_owned(), campaign: Campaign::of(there, path, campaign.external_law())? });
        }
        if let Some(there) = LEFT.iter().map(|name| path.join(name)).find(|there| there.exists()) {
            let problem = "the file exists, and the folder has no manifest of a campaign";
            let remedy = format!("give another folder with {OUT}, or move the file");
            return Err(other_campaign(&there, problem, remedy));
        }
        let folder = Self { path: path.to_owned(), campaign };
        folder.create_parts()?;
        folder.campaign.manifest().write(&file)?;
        // If two processes plan at once, the later manifest stays, and the other process sees it here.
        let there = Manifest::read(&file, &folder.campaign.manifest().tool)?;
        if there == *folder.campaign.manifest() { Ok(folder) } else { Self::plan(path, folder.campaign, shards_asked) }
    }

    /// Returns the folder at a path without reading it.
    pub(super) fn at(path: &Path, campaign: Campaign) -> Self {
        Self { path: path.to_owned(), campaign }
    }

    /// Opens the campaign in a folder. `load` loads the external law that its manifest names, if it names one.
    ///
    /// # Errors
    /// As [`Manifest::read`] and [`Campaign::of`], and the failure of `load`.
    pub fn open(path: &Path, program: &Program, load: &LoadLaw<'_>) -> Result<Self, Failure> {
        let file = if path.is_file() { path.to_owned() } else { path.join("manifest.json") };
        let manifest = Manifest::read(&file, program)?;
        let law = manifest.external_law.as_deref().and_then(load).transpose()?;
        let campaign = Campaign::of(manifest, path, law.as_ref())?;
        let folder = if path.is_file() { path.parent().unwrap_or(Path::new("")) } else { path };
        Ok(Self { path: folder.to_owned(), campaign })
    }

    /// Creates the folder of parts.
    pub(super) fn create_parts(&self) -> Result<(), Failure> {
        let parts = self.path.join("parts");
        fs::create_dir_all(&parts).map_err(file_failure("write", &parts))
    }

    /// Returns the campaign.
    #[must_use]
    pub fn campaign(&self) -> &Campaign {
        &self.campaign
    }

    /// Returns the path of the folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the path of a file beside the manifest.
    #[must_use]
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Returns the path of the part of a shard.
    pub(super) fn part_path(&self, shard: u64) -> PathBuf {
        self.path.join("parts").join(format!("{}.jsonl", stem(shard)))
    }

    /// Returns the path for a part that differs from the part that another machine wrote.
    pub(super) fn conflict_path(&self, shard: u64) -> PathBuf {
        self.path.join("parts").join(format!("{}.differs.jsonl", stem(shard)))
    }

    /// Returns the path of the wall-clock times of a shard.
    pub(super) fn times_path(&self, shard: u64) -> PathBuf {
        self.path.join("parts").join(format!("{}.times.json", stem(shard)))
    }

    /// Returns a path for a file of a shard that only this process uses.
    pub(super) fn unique_path(&self, shard: u64, kind: &str) -> PathBuf {
        let number = RandomState::new().hash_one(std::process::id());
        self.path.join("parts").join(format!("{}.{number:016x}.{kind}", stem(shard)))
    }

    /// Returns the files of this kind that processes left for a shard.
    pub(super) fn leftovers(&self, shard: u64, kind: &str) -> Result<Vec<PathBuf>, Failure> {
        let folder = self.path.join("parts");
        let (begin, end) = (format!("{}.", stem(shard)), format!(".{kind}"));
        let is_one = |path: &PathBuf| {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            name.starts_with(&begin) && name.ends_with(&end)
        };
        let entries = fs::read_dir(&folder).map_err(file_failure("read", &folder))?;
        let paths = entries.map(|entry| entry.map(|entry| entry.path())).collect::<io::Result<Vec<_>>>();
        let mut paths = paths.map_err(file_failure("read", &folder))?;
        paths.retain(is_one);
        paths.sort();
        Ok(paths)
    }

    /// Reads the part of a shard.
    ///
    /// # Errors
    /// [`Failure`] if the shard was flown twice with different results, the part is of another campaign, or the file
    /// cannot be read.
    pub fn read(&self, shard: u64) -> Result<PartState, Failure> {
        let (kept, other) = (self.part_path(shard), self.conflict_path(shard));
        if other.exists() {
            return Err(different_results(shard, &kept, &other));
        }
        shard::read(&kept, self.campaign.manifest(), shard, self.campaign.laws().len())
    }

    /// Returns the row of a run under a law, counted from 0; `None` if the run has not been flown.
    ///
    /// # Errors
    /// As [`Folder::read`], and [`Failure`] if the part is damaged.
    pub fn row(&self, run: u64, law: usize) -> Result<Option<Row>, Failure> {
        let manifest = self.campaign.manifest();
        let Some(shard) = (0..manifest.shards).find(|&shard| manifest.range(shard).contains(&run)) else {
            return Ok(None);
        };
        match self.read(shard)? {
            PartState::Whole(rows) => Ok(rows.into_iter().find(|row| row.place() == (run, law))),
            PartState::Missing => Ok(None),
            PartState::Damaged(why) => Err(self.missing_shards(&[shard], &[self.damage(shard, why)])),
        }
    }

    /// Returns the shards that are not flown, in order, each with a sentence on the damage of its part if it has one.
    ///
    /// # Errors
    /// As [`Folder::read`].
    pub fn missing(&self) -> Result<Vec<(u64, Option<String>)>, Failure> {
        let of_shard = |shard| {
            Ok(match self.read(shard)? {
                PartState::Whole(_) => None,
                PartState::Missing => Some((shard, None)),
                PartState::Damaged(why) => Some((shard, Some(self.damage(shard, why)))),
            })
        };
        (0..self.campaign.manifest().shards).filter_map(|shard| of_shard(shard).transpose()).collect()
    }

    /// Returns a sentence on the damage of the part of a shard; `None` if the part is whole or missing.
    ///
    /// # Errors
    /// As [`Folder::read`].
    pub fn damaged(&self, shard: u64) -> Result<Option<String>, Failure> {
        let found = self.read(shard)?;
        Ok(if let PartState::Damaged(why) = found { Some(self.damage(shard, why)) } else { None })
    }

    fn damage(&self, shard: u64, why: &str) -> String {
        format!("{} is damaged: {why}", self.part_path(shard).display())
    }

    /// Returns the failure of shards that are missing or damaged.
    fn missing_shards(&self, missing: &[u64], damaged: &[String]) -> Failure {
        let (list, shards) = (listed(missing), self.campaign.manifest().shards);
        let damages = damaged.iter().fold(String::new(), |text, damage| text + "; " + damage);
        let are = if missing.len() == 1 { "is" } else { "are" };
        let what = if damaged.is_empty() { "missing" } else { "missing or damaged" };
        let total = counted(shards, "shard", "shards");
        let path = self.path.display().to_string();
        Failure::input(
            "campaign/missing-shards",
            format!("{} of {total} {are} {what}: {list}{damages}", missing.len()),
            command_line(["campaign", "shard", &path, &SHARD.argument(), &list].into_iter()),
        )
    }
}

impl Folder {
    /// Writes `results.parquet` and `campaign.json`. Returns the answer and the SHA-256 of the table. The bytes of both
    /// files are the same for any number of shards, threads and interruptions. Runs after an early stop are left out,
    /// flown or not.
    ///
    /// # Errors
    /// As [`Folder::read`], and [`Failure`] if shards are missing or a file cannot be written.
    pub fn merge(&self) -> Result<(Summary, String), Failure> {
        let path = self.file(RESULTS);
        let summary = write_atomically_with(&path, |file| {
            let failed =
                |error: parquet::errors::ParquetError| file_failure("write", &path)(std::io::Error::other(error));
            let copy = file.try_clone().map_err(file_failure("write", &path))?;
            let (columns, cells): (Vec<_>, Vec<_>) = fields(self.campaign()).into_iter().unzip();
            let about = ["tautline.campaign", &self.campaign().manifest().campaign];
            let mut table = ParquetTable::create(columns, about, copy).map_err(failed)?;
            let mut rows: Vec<Vec<Cell>> = Vec::new();
            let summary = self.gather(&mut |row| {
                rows.push(cells.iter().map(|cell| cell(row)).collect());
                if rows.len() == GROUP_ROWS {
                    table.write(&std::mem::take(&mut rows)).map_err(failed)?;
                }
                Ok(())
            })?;
            if !rows.is_empty() {
                table.write(&rows).map_err(failed)?;
            }
            table.close().map_err(failed)?;
            Ok::<_, Failure>(summary)
        })?;
        let answer = self.file(ANSWER);
        let json = summary.to_json().map_err(|error| file_failure("write", &answer)(error.into()))?;
        write_atomically(&answer, json.as_bytes())?;
        let bytes = fs::read(&path).map_err(file_failure("read", &path))?;
        Ok((summary, sha256_hex(&bytes)))
    }

    /// Returns the answer of all flown rows without writing it.
    ///
    /// # Errors
    /// As [`Folder::merge`].
    pub fn summary(&self) -> Result<Summary, Failure> {
        self.gather(&mut |_| Ok(()))
    }

    /// Returns the answer, and calls `take` for each row that counts, in order.
    fn gather(&self, take: &mut dyn FnMut(&Row) -> Result<(), Failure>) -> Result<Summary, Failure> {
        let mut gathered = SummaryAccumulator::new(self.campaign());
        for shard in 0..self.campaign().manifest().shards {
            if gathered.is_enough() {
                break;
            }
            let PartState::Whole(rows) = self.read(shard)? else {
                let missing = self.missing()?.into_iter().filter(|&(missing, _)| missing >= shard);
                let (missing, damaged): (Vec<_>, Vec<_>) = missing.unzip();
                return Err(self.missing_shards(&missing, &damaged.into_iter().flatten().collect::<Vec<_>>()));
            };
            for row in &rows {
                if gathered.take(row) {
                    take(row)?;
                }
            }
        }
        Ok(gathered.finish(self.campaign()))
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "required by serde")]
fn is_false(value: &bool) -> bool {
    !value
}

/// Returns the failure of two machines that flew a shard with different results.
pub(super) fn different_results(shard: u64, kept: &Path, other: &Path) -> Failure {
    let [kept, other] = [kept, other].map(Path::display);
    let problem = format!("two machines flew shard {shard} with different results: {kept} and {other}");
    Failure::machine("campaign/other-bits", problem).with_help(FAULTY)
}

/// Remedy for a flight with different bits on two machines.
pub(super) const FAULTY: &str = "equal flights have equal bits on all machines: look for a faulty machine, or one with \
                                 another program; remove the wrong part to continue";

/// Kind of the file with the rows of a process that is running or was killed.
pub(super) const JOURNAL: &str = "journal";

fn stem(shard: u64) -> String {
    format!("shard-{shard:09}")
}

/// Returns shards as a list for [`parse`]: `13,500-502`.
#[must_use]
pub fn listed(shards: &[u64]) -> String {
    let mut spans: Vec<[u64; 2]> = Vec::new();
    for &shard in shards {
        match spans.last_mut() {
            Some([_, last]) if *last + 1 == shard => *last = shard,
            _ => spans.push([shard, shard]),
        }
    }
    let said = |[first, last]: &[u64; 2]| if first == last { first.to_string() } else { format!("{first}-{last}") };
    spans.iter().map(said).collect::<Vec<_>>().join(",")
}

/// Parses a list of shards such as `7`, `3-5`, `13,500-502`, or `env:NAME` for the list in an environment variable.
///
/// # Errors
/// [`Failure`] for a text that is not a list, and for a shard beyond the last.
pub fn parse(list: &str, shards: u64) -> Result<Vec<u64>, Failure> {
    let wrong = |problem: String| {
        let remedy = "give numbers from 0 on, such as 7, 3-5, 13,500-502, or env:SLURM_ARRAY_TASK_ID";
        refused(format!("{}: {problem}", SHARD.set(list)), remedy)
    };
    if let Some(name) = list.strip_prefix("env:") {
        let value = std::env::var(name).map_err(|_| wrong(format!("no environment variable `{name}`")))?;
        return if value.starts_with("env:") { Err(wrong(format!("{name} = {value}"))) } else { parse(&value, shards) };
    }
    let mut parsed = Vec::new();
    for span in list.split(',').map(str::trim) {
        let (first, last) = span.split_once('-').unwrap_or((span, span));
        let number = |text: &str| text.trim().parse::<u64>().map_err(|_| wrong(format!("`{span}` is not a shard")));
        let (first, last) = (number(first)?, number(last)?);
        if first > last || last >= shards {
            return Err(wrong(format!("must be from 0 to {}, in increasing order", shards - 1)));
        }
        parsed.extend(first..=last);
    }
    parsed.sort_unstable();
    parsed.dedup();
    Ok(parsed)
}

/// Everything that a machine needs to fly a shard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of the keys of manifest and parts.
    pub schema_version: u32,
    /// SHA-256 over all keys below except `shards` and `folder`. Equal hashes mean equal flights.
    pub campaign: String,
    /// Name of the campaign: the file name of its specification.
    pub name: String,
    /// Program that flies the campaign.
    pub tool: Program,
    /// Name of the scenario.
    pub scenario_name: String,
    /// TOML of the scenario.
    pub scenario: String,
    /// Specification, with the keys of the command line.
    pub spec: String,
    /// Number of runs.
    pub runs: u64,
    /// Whether the number of runs was raised after flights had been flown.
    #[serde(default, skip_serializing_if = "is_false")]
    pub runs_raised: bool,
    /// Name of the external law that flies every run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub external_law: Option<String>,
    /// SHA-256 of the source from which every process makes the external law.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub external_law_sha256: Option<String>,
    /// SHA-256 of the resolved scenario of run 0 under each law. It detects changes in files that the scenario names.
    pub first: Vec<String>,
    /// Number of parts into which the runs are split.
    pub shards: u64,
    /// Folder to which paths in the scenario are relative.
    pub folder: PathBuf,
}

/// Loads the external law of a name; `None` where this program cannot load laws of this kind.
pub type LoadLaw<'a> = dyn Fn(&str) -> Option<Result<ExternalLaw, Failure>> + 'a;

/// Identity of a program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Name.
    pub name: String,
    /// Version.
    pub version: String,
    /// SHA-256 of its sources and dependencies; of its executable if the sources are unknown.
    pub sha256: String,
}

/// SHA-256 of the sources of the crates that affect flights, and of the versions of all dependencies. Empty outside of
/// the workspace.
const SOURCES: &str = env!("TAUTLINE_SOURCES");
/// File that contains this crate, if it is not the executable of the process.
static HOLDER: OnceLock<PathBuf> = OnceLock::new();

impl Program {
    /// Sets the file that contains this crate if it is a library of another program. The hash of this file identifies
    /// the program if its sources are unknown. Call it before any campaign.
    pub fn set_library_file(file: PathBuf) {
        // All calls set the same file, so a second call changes nothing.
        let _ = HOLDER.set(file);
    }

    /// Returns the running program.
    ///
    /// # Errors
    /// [`Failure`] if its file cannot be read.
    pub fn running() -> Result<Self, Failure> {
        let (name, version) = (tautline_core::PROGRAM.to_owned(), tautline_core::VERSION.to_owned());
        if !SOURCES.is_empty() {
            return Ok(Self { name, version, sha256: SOURCES.to_owned() });
        }
        let path = HOLDER.get().cloned().map_or_else(std::env::current_exe, Ok);
        let path = path.map_err(file_failure("read", Path::new("the program")))?;
        let program = fs::read(&path).map_err(file_failure("read", &path))?;
        Ok(Self { name, version, sha256: sha256_hex(program) })
    }
}

impl Manifest {
    /// Returns the same manifest with its hash.
    #[must_use]
    pub(super) fn sealed(mut self) -> Self {
        self.campaign = self.hash();
        self
    }

    fn hash(&self) -> String {
        let Self {
            schema_version,
            name,
            tool,
            scenario_name,
            scenario,
            spec,
            runs,
            first,
            runs_raised,
            external_law,
            external_law_sha256,
            ..
        } = self;
        let (version, runs) = (schema_version.to_string(), runs.to_string());
        let texts = [&version, name, &tool.sha256, scenario_name, scenario, spec, &runs];
        let mut hash = Sha256::new();
        let raised = runs_raised.then(|| "raised".to_owned());
        for text in texts.into_iter().chain(first).chain(&raised).chain(external_law).chain(external_law_sha256) {
            // Lengths separate the texts, so that different texts do not give the same bytes.
            hash.update((text.len() as u64).to_le_bytes());
            hash.update(text);
        }
        hex(&hash.finalize())
    }

    /// Returns the runs of a shard, from 0. The sizes of two shards differ by at most one run.
    #[must_use]
    pub fn range(&self, shard: u64) -> std::ops::Range<u64> {
        let shards = self.shards.max(1);
        // Equal to `shard * runs / shards`, without overflow.
        let first_run = |shard: u64| self.runs / shards * shard + self.runs % shards * shard / shards;
        first_run(shard)..first_run(shard + 1)
    }

    /// Reads a manifest.
    ///
    /// # Errors
    /// [`Failure`] `campaign/other-campaign` if the file is missing, is not a manifest, was changed by hand, or was
    /// planned by another program.
    pub fn read(path: &Path, program: &Program) -> Result<Self, Failure> {
        let foreign = |problem: &str, remedy: &str| Err(other_campaign(path, problem, remedy));
        let text = match fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                let remedy = format!("plan one with: tautline campaign plan SPEC.toml {} FOLDER", OUT.argument());
                return foreign("no such campaign", &remedy);
            }
            Err(error) => return Err(file_failure("read", path)(error)),
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
                "use the same program on all machines, or plan the campaign again into another folder",
            );
        }
        Ok(read)
    }

    /// Writes the manifest.
    ///
    /// # Errors
    /// [`Failure`] if the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let json = serde_json::to_string_pretty(self).map_err(|error| file_failure("write", path)(error.into()))?;
        Ok(write_atomically(path, (json + "\n").as_bytes())?)
    }
}

/// Returns the failure of a file or folder that belongs to another campaign or program.
pub(super) fn other_campaign(path: &Path, problem: impl AsRef<str>, remedy: impl AsRef<str>) -> Failure {
    Failure::input("campaign/other-campaign", problem, remedy).of(path)
}

/// Returns a function that makes the failure of a file that cannot be read or written.
pub(super) fn file_failure(what: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Failure {
    let path = path.display();
    move |error| {
        Failure::machine("files/cannot-access", format!("{path}: cannot {what} the file: {error}"))
            .with_help("free some space or correct the permissions, and start again: finished flights are kept")
    }
}

/// Removes a file, unless it does not exist.
pub(super) fn remove_if_present(path: &Path) -> Result<(), Failure> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(file_failure("remove", path)(error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Spec;
    use tautline_core::swarm::Rows;
    use tautline_laws::law::{Law, LawError};
    use tautline_laws::observation::Observation;

    #[test]
    fn another_program_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let spec =
            Spec::read("spec.toml", "scenario = 'pentagon'\n[vary]\nlaw.alpha = { grid = [1.0] }").expect("read");
        let program = Program::running().expect("a program");
        let campaign = Campaign::plan(&spec, "one", Path::new("."), None, program.clone(), None).expect("a plan");
        let folder = Folder::plan(folder.path(), campaign, false).expect("planned");
        Folder::open(folder.path(), &program, &|_| None).expect("the same program");
        let other = Program { sha256: "0".repeat(64), ..program };
        let refused = Folder::open(folder.path(), &other, &|_| None).expect_err("another program").to_string();
        assert!(refused.contains("planned by") && refused.contains("use the same program"), "{refused}");
    }

    #[test]
    fn a_law_from_another_source_is_refused() {
        let law = |sha256: &str| ExternalLaw::new(Named).from_source(sha256.to_owned(), || Box::new(Named));
        let folder = tempfile::tempdir().expect("a folder");
        let text = "scenario = 'pentagon'\nruns = 60\n[vary]\nstart.jitter_m = { uniform = [0.0, 0.1] }";
        let spec = Spec::read("spec.toml", text).expect("read");
        let program = Program::running().expect("a program");
        let (place, planned) = (Path::new("."), law("a"));
        let campaign = Campaign::plan(&spec, "one", place, None, program.clone(), Some(&planned)).expect("a plan");
        assert_eq!(campaign.manifest().shards, 2);
        Folder::plan(folder.path(), campaign, false).expect("planned");
        let open = |load: &LoadLaw<'_>| Folder::open(folder.path(), &program, load).map_err(|error| error.to_string());
        open(&|name| (name == "m:Law").then(|| Ok(law("a")))).expect("the same law");
        let refused = open(&|_| Some(Ok(law("b")))).expect_err("another source");
        assert!(refused.contains("has the SHA-256 b here, and a in the manifest"), "{refused}");
        let refused = open(&|_| None).expect_err("no law");
        assert!(refused.contains("which imports `m:Law`: python -m tautline campaign"), "{refused}");
        let failed = open(&|_| Some(Err(Failure::input("request/python-law", "no module", "give one"))));
        assert!(failed.expect_err("no module").contains("no module"));
    }

    /// A law with a name that is imported.
    #[derive(Clone)]
    struct Named;

    impl Law for Named {
        fn name(&self) -> &'static str {
            "m:Law"
        }

        fn command(&mut self, _at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
            command.fill(0.0);
            Ok(())
        }
    }

    #[test]
    fn a_list_of_shards_reads_back() {
        for shards in [vec![], vec![7], vec![0, 1, 2], vec![13, 500, 501, 502, 504]] {
            let list = listed(&shards);
            if !shards.is_empty() {
                assert_eq!(parse(&list, 505).expect(&list), shards);
            }
        }
        assert_eq!(listed(&[13, 500, 501, 502]), "13,500-502");
        assert_eq!(parse("5, 3-4 ,3", 6).expect("a list"), [3, 4, 5]);
        for wrong in ["", "a", "6", "4-3", "1,", "-1", "1-", "env:TAUTLINE_NO_SUCH_VARIABLE"] {
            assert!(parse(wrong, 6).is_err(), "{wrong}");
        }
    }
}
