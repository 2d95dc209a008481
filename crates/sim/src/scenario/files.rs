//! Files that a scenario names.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use super::error::ScenarioError;

/// The key that names the file of a formation.
pub(super) const KEY: &str = "formation.file";

/// Largest file that is read \[bytes\].
const MAX_BYTES: u64 = 128 << 20;

/// All bytes of a file that is not too long, which a key names.
pub(super) fn bytes(path: &Path, key: &'static str) -> Result<Vec<u8>, ScenarioError> {
    let shown = path.display();
    let refused = |said: String, help: &str| ScenarioError::new(said).coded("scenario/file").with_help(help).at(key);
    let unreadable = |error: std::io::Error| {
        let help = "give the path of a file that can be read; it counts from the folder of the scenario file, or from the \
                    working directory where there is none";
        refused(format!("cannot read {shown}: {error}"), help)
    };
    let file = File::open(path).map_err(unreadable)?;
    if path.is_dir() {
        return Err(refused(format!("{shown} is a directory"), "give the path of a file within it"));
    }
    let mut bytes = Vec::new();
    // A device or a pipe does not say how long it is.
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(refused(
            format!("{shown} has more than {} MiB", MAX_BYTES >> 20),
            "nothing that a scenario names is that long: is it the right file?",
        ));
    }
    Ok(bytes)
}
