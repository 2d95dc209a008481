//! Sources of a scenario: built-in scenarios, files, standard input and text in memory.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::document::Document;
use super::error::suggest;
use super::error::{ErrorKind, ScenarioError};
use super::limits::{MAX_NAME_CHARS, is_name_character};
use super::spec::Scenario;
use super::text::Override;
use super::text::Text;
use super::{build, builtin, template};
use tautline_core::failure::Place;

/// Size limit of a scenario file \[bytes\]: 250,000 vehicles with a position, a velocity, a slot and an edge each.
/// Reading takes 45 to 100 times the size of the file in memory.
pub const MAX_FILE_BYTES: u64 = 32 << 20;

/// Name of standard input in messages.
const STANDARD_INPUT: &str = "standard input";

/// Source of the text of a scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A built-in scenario, by name.
    Builtin(String),
    /// A TOML file.
    File(PathBuf),
    /// TOML in memory.
    Text {
        /// Name in messages.
        name: String,
        /// The TOML.
        text: String,
    },
    /// TOML in memory, read from a file; paths in it are relative to a folder.
    Embedded {
        /// Name in messages.
        name: String,
        /// The TOML.
        text: String,
        /// Folder that paths are relative to.
        folder: PathBuf,
    },
}

impl Source {
    /// Returns the built-in scenario with this name, or else the file at this path; `-` reads standard input to its
    /// end.
    ///
    /// # Errors
    /// [`ScenarioError`] for a word without `.` or path separator that is neither, and if standard input cannot be
    /// read.
    pub fn resolve(name_or_path: &str) -> Result<Self, ScenarioError> {
        if name_or_path == "-" {
            return Ok(Self::Text { name: STANDARD_INPUT.to_owned(), text: read(STANDARD_INPUT, std::io::stdin())? });
        }
        if builtin::find(name_or_path).is_some() {
            return Ok(Self::Builtin(name_or_path.to_owned()));
        }
        let path = Path::new(name_or_path);
        if name_or_path.contains(['/', '\\', '.']) || path.exists() {
            return Ok(Self::File(path.to_owned()));
        }
        Err(unknown_builtin(name_or_path))
    }

    /// Returns the folder that paths in the scenario are relative to: that of the file, or else the current folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        match self {
            Self::File(path) => path.parent().unwrap_or(Path::new("")),
            Self::Embedded { folder, .. } => folder,
            Self::Builtin(_) | Self::Text { .. } => Path::new(""),
        }
    }

    /// Returns the name and the text.
    ///
    /// # Errors
    /// [`ScenarioError`] if the source cannot be read.
    pub fn text(&self) -> Result<(String, String), ScenarioError> {
        match self {
            Self::Builtin(name) => {
                builtin::find(name).map(|b| (b.name.to_owned(), b.toml.to_owned())).ok_or_else(|| unknown_builtin(name))
            }
            Self::Text { name, text } | Self::Embedded { name, text, .. } => Ok((name.clone(), text.clone())),
            Self::File(path) => Ok((path.display().to_string(), read_file(path)?)),
        }
    }
}

impl Scenario {
    /// Reads, builds and validates a scenario. Without a name, it takes that of its file; `-` replaces characters that
    /// a name may not contain.
    ///
    /// # Errors
    /// [`ScenarioError`] with its place in the text or in an override. Causes: the source cannot be read or is not
    /// TOML; a key is unknown, missing or of the wrong type; the scenario is invalid (see [`Scenario::validate`]).
    pub fn read(source: &Source, overrides: &[Override]) -> Result<Self, ScenarioError> {
        let (name, text) = source.text()?;
        Text { name: &name, toml: &text, overrides }.read(|text| finish(decoded(text, source.folder())?, text, None))
    }
}

/// Reads the keys of a text, with paths relative to a folder.
pub(super) fn decoded(text: &Text<'_>, folder: &Path) -> Result<Document, ScenarioError> {
    let mut document = text.decode()?;
    document.vehicle.resolve_path(folder).map_err(|error| text.place(error))?;
    find_files(&mut document, folder).map_err(|error| text.place(error))?;
    Ok(document)
}

/// Builds and validates the scenario of a document. `valid` is another scenario of the same file, if one is known.
pub(super) fn finish(
    mut document: Document,
    text: &Text<'_>,
    valid: Option<&Scenario>,
) -> Result<Scenario, ScenarioError> {
    let stem = || Path::new(text.name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    document.name = document.name.or_else(|| Some(as_name(&stem())));
    template::check_laws(&document.laws).map_err(|error| text.place(error))?;
    let jitter_m = document.start.jitter_m;
    let scenario = build::scenario(document).map_err(|error| text.place(error))?;
    scenario.check_built(valid).map_err(|error| text.place(error.with_jitter(jitter_m)))?;
    Ok(scenario)
}

/// Resolves the files of shapes and of the reference relative to a folder.
fn find_files(document: &mut Document, folder: &Path) -> Result<(), ScenarioError> {
    super::formation::resolve_path(folder, &mut document.formation.shape)?;
    if let Some(reference) = &mut document.reference {
        reference.resolve_path(folder)?;
    }
    for (number, leg) in document.leg.iter_mut().enumerate() {
        if let Some(shape) = &mut leg.shape {
            super::formation::resolve_path(folder, shape).map_err(|error| error.on_leg(number + 1))?;
        }
    }
    Ok(())
}

/// Returns whether a key of a scenario takes integers only; `false` for a key that does not exist.
#[must_use]
pub fn takes_integers_only(source: &Source, overrides: &[Override], key: &str) -> bool {
    let Ok((name, toml)) = source.text() else { return false };
    let is_of_wrong_type = |number: &str| {
        let overrides = &[overrides, &[Override::parse(&format!("{key}={number}")).ok()?]].concat();
        let read = Text { name: &name, toml: &toml, overrides }.decode();
        Some(read.is_err_and(|error| error.kind == ErrorKind::WrongType))
    };
    is_of_wrong_type("0.5") == Some(true) && is_of_wrong_type("1") == Some(false)
}

fn unknown_builtin(name: &str) -> ScenarioError {
    let names: Vec<_> = builtin::all().iter().map(|builtin| builtin.name).collect();
    let file = format!("{name}.toml");
    let is_file = Path::new(&file).is_file();
    let problem = format!("`{name}` is neither a built-in scenario nor a file");
    let help = if is_file { format!("did you mean the file `{file}`?") } else { suggest(name, &names) };
    ErrorKind::NotFound.at(&[], problem, help)
}

/// Replaces characters that a name may not contain by `-`.
fn as_name(text: &str) -> String {
    text.chars().take(MAX_NAME_CHARS).map(|c| if is_name_character(c) { c } else { '-' }).collect()
}

/// Reads a UTF-8 file of at most [`MAX_FILE_BYTES`].
fn read_file(path: &Path) -> Result<String, ScenarioError> {
    let shown = path.display().to_string();
    if path.is_dir() {
        let problem = format!("{shown} is a directory");
        return Err(ErrorKind::CannotRead.at(&[], problem, "give the path of a scenario file within it"));
    }
    read(&shown, File::open(path).map_err(|error| unreadable(&shown, &error))?)
}

fn unreadable(shown: &str, error: &std::io::Error) -> ScenarioError {
    let is_missing = error.kind() == std::io::ErrorKind::NotFound;
    let problem = format!("cannot read {shown}: {error}");
    let help = "give the path of a scenario file, or the name of a built-in scenario such as `pentagon`";
    if is_missing { ErrorKind::NotFound } else { ErrorKind::CannotRead }.at(&[], problem, help)
}

/// Reads a source to its end, as UTF-8 of at most [`MAX_FILE_BYTES`]; `shown` is its name in messages.
fn read(shown: &str, source: impl Read) -> Result<String, ScenarioError> {
    let mut bytes = Vec::new();
    // The size of a device or a pipe is unknown in advance.
    source.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(|error| unreadable(shown, &error))?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let problem = format!("{shown} has more than {} MiB", MAX_FILE_BYTES >> 20);
        return Err(ErrorKind::TooLarge.at(&[], problem, "name a smaller file"));
    }
    String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let bytes = error.into_bytes();
        let text = String::from_utf8_lossy(&bytes[..bytes.len().min(valid + 64)]);
        let problem = format!("byte {valid} (from 0) is not UTF-8");
        let help = "save the file as UTF-8 text";
        ErrorKind::NotUtf8.at(&[], problem, help).with_place(Place::new(
            shown,
            &text,
            valid..valid + '\u{fffd}'.len_utf8(),
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn takes_integers(builtin: &str, sets: &[&str], key: &str) -> bool {
        let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect("an override")).collect();
        takes_integers_only(&Source::Builtin(builtin.to_owned()), &overrides, key)
    }

    #[test]
    fn keys_that_count_take_integers_only() {
        for (key, sets) in [
            ("start.seed", &[][..]),
            ("noise.seed", &[]),
            ("time.max_halvings", &[]),
            ("swarm.count", &[]),
            ("law.neighbours_max", &["law.kind=orca"]),
            ("failure.1.vehicle", &["failure=[{vehicle=1, kind=\"silent\", at_s=1}]"]),
            ("failure.1.rotor", &["failure=[{vehicle=1, kind=\"rotor\", rotor=1, at_s=1}]"]),
            ("graph.edges.1.2", &["graph={kind=\"edges\", edges=[[1, 2], [2, 3], [3, 4], [4, 5]]}"]),
            ("reference.known_by.1", &["reference={known_by=[1, 2]}"]),
        ] {
            assert!(takes_integers("pentagon", sets, key), "{key}");
        }
    }

    #[test]
    fn keys_that_measure_take_any_number() {
        for (builtin, key) in [
            ("crazyflies", "sensing.latency_s"),
            ("crazyflies", "time.control_hz"),
            ("pentagon", "time.record_hz"),
            ("pentagon", "time.dt_s"),
            ("pentagon", "law.alpha"),
            ("pentagon", "start.positions_m.2.x"),
            ("pentagon", "wind.mean_m_s"),
            ("gusts", "wind.mean_m_s.1"),
            ("pentagon", "law.kind"),
            ("pentagon", "law.alfa"),
            ("pentagon", "law..alpha"),
            ("pentagon", "law.neighbours_max"),
        ] {
            assert!(!takes_integers(builtin, &[], key), "{builtin} {key}");
        }
    }
}
