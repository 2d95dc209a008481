//! Small TOML files: settings, obstacles, a fence.

use std::fs::File;
use std::io::{ErrorKind, Read as _};
use std::path::Path;

use serde::de::DeserializeOwned;

use super::super::Failure;

/// A kind of TOML file.
pub(super) struct TomlFile {
    /// Error code of a wrong file.
    pub(super) code: &'static str,
    /// Remedy for a wrong file.
    pub(super) help: fn() -> String,
    /// Largest file that is read \[bytes\].
    pub(super) most_bytes: u64,
}

impl TomlFile {
    /// Returns the text of a file. Rejects files above the size limit, and endless ones such as a device.
    pub(super) fn read(&self, path: &Path) -> Result<String, Failure> {
        let cannot = |error: std::io::Error| {
            let help = if error.kind() == ErrorKind::NotFound { "check the path".to_owned() } else { (self.help)() };
            let message = format!("{}: cannot read the file: {error}", path.display());
            Failure::input("files/cannot-read", message, help)
        };
        let file = File::open(path).map_err(cannot)?;
        let mut text = String::new();
        file.take(self.most_bytes + 1).read_to_string(&mut text).map_err(cannot)?;
        if text.len() as u64 > self.most_bytes {
            let most = self.most_bytes;
            let message = format!("{} has more than the {most} bytes that are read of such a file", path.display());
            return Err(Failure::input("files/too-large", message, (self.help)()));
        }
        Ok(text)
    }

    /// Parses a text of this kind.
    pub(super) fn parse<T: DeserializeOwned>(&self, text: &str, path: &Path) -> Result<T, Failure> {
        toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            self.wrong(text, path, start, error.message())
        })
    }

    /// Returns the failure for a problem at this byte of a text.
    pub(super) fn wrong(&self, text: &str, path: &Path, start: usize, message: &str) -> Failure {
        let line = 1 + text[..start.min(text.len())].matches('\n').count();
        Failure::input(self.code, format!("{}, line {line}: {message}", path.display()), (self.help)())
    }
}
