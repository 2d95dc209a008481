//! Small files of settings.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use super::Failure;

/// The text of a file of at most so many bytes; a longer one, or what never ends, is refused.
pub(crate) fn read(path: &Path, most_bytes: u64, help: &str) -> Result<String, Failure> {
    let cannot = |error: std::io::Error| {
        Failure::input("files/cannot-read", format!("cannot read {}: {error}", path.display()), help)
    };
    let file = File::open(path).map_err(cannot)?;
    let mut text = String::new();
    file.take(most_bytes + 1).read_to_string(&mut text).map_err(cannot)?;
    if text.len() as u64 > most_bytes {
        let message = format!("{} has more than the {most_bytes} bytes that are read of such a file", path.display());
        return Err(Failure::input("files/too-large", message, help));
    }
    Ok(text)
}
