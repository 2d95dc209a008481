//! Files as streams of bytes and of lines, which may not grow without a limit.

use std::fs::File;
use std::io::{BufRead as _, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use flate2::read::MultiGzDecoder;
use tempfile::TempPath;

use super::archive::{Archive, Growing};
use super::error::{Fault, Place, ReadError};

/// Longest line that is read \[bytes\]: an instant of a hundred thousand vehicles.
pub(super) const LINE_LIMIT_BYTES: usize = 8 * 1024 * 1024;

/// Bytes read at a time.
const BLOCK_BYTES: usize = 256 * 1024;

/// First bytes of a gzip file.
pub(super) const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// First bytes of a file in Zstandard.
pub(super) const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// A file, alone or in an archive, that can be read from its start as often as needed.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) path: PathBuf,
    /// The entry of the archive that `path` then is.
    pub(super) entry: Option<String>,
    pub(super) gzip: bool,
    pub(super) zstd: bool,
    /// Where what was an entry has been unpacked to, and what errors call it.
    unpacked: Option<(Arc<TempPath>, PathBuf)>,
}

impl Source {
    /// A file of its own.
    pub(super) fn file(path: &Path) -> Self {
        Self { path: path.to_owned(), entry: None, gzip: false, zstd: false, unpacked: None }
    }

    /// An entry of an archive.
    pub(super) fn entry(archive: &Path, name: String) -> Self {
        Self { entry: Some(name), ..Self::file(archive) }
    }

    /// As a file of its own, whose bytes can be read in any order: an entry or a packed file is unpacked, until the last copy
    /// of this is gone.
    pub(super) fn seekable(self) -> Result<Self, ReadError> {
        if self.entry.is_none() && !self.gzip && !self.zstd {
            return Ok(self);
        }
        let mut file = tempfile::NamedTempFile::new()?;
        std::io::copy(&mut self.bytes()?, &mut file)?;
        let unpacked = Arc::new(file.into_temp_path());
        let called = self.shown();
        Ok(Self { unpacked: Some((unpacked.clone(), called)), ..Self::file(&unpacked) })
    }

    /// What errors call it.
    pub(super) fn shown(&self) -> PathBuf {
        match (&self.unpacked, &self.entry) {
            (Some((_, called)), _) => called.clone(),
            (None, Some(entry)) => self.path.join(entry),
            (None, None) => self.path.clone(),
        }
    }

    /// What its only vehicle is called: the name of the file without what says the format.
    pub(super) fn stem(&self) -> String {
        let path = self.shown();
        let packed = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
        let path = if packed { path.with_extension("") } else { path };
        path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// The bytes of the file, unpacked.
    pub(super) fn bytes(&self) -> Result<Box<dyn Read>, ReadError> {
        let (file, packed_bytes): (Box<dyn Read>, _) = if let Some(entry) = &self.entry {
            (Archive::open(&self.path)?.entry(entry)?, File::open(&self.path)?.metadata()?.len())
        } else {
            let file = File::open(&self.path)?;
            let bytes = file.metadata()?.len();
            (Box::new(file), bytes)
        };
        if self.zstd {
            return Ok(Box::new(Growing::new(zstd::Decoder::new(file)?, packed_bytes)));
        }
        if !self.gzip {
            return Ok(file);
        }
        Ok(Box::new(Growing::new(MultiGzDecoder::new(BufReader::new(file)), packed_bytes)))
    }
}

/// The lines of a text, one in memory at a time.
pub(super) struct Lines {
    input: BufReader<Box<dyn Read>>,
    /// The current line with its end.
    buffer: Vec<u8>,
    number: u64,
}

impl Lines {
    pub(super) fn new(source: &Source) -> Result<Self, ReadError> {
        Ok(Self { input: BufReader::with_capacity(BLOCK_BYTES, source.bytes()?), buffer: Vec::new(), number: 0 })
    }

    /// The current line without its end.
    #[inline]
    pub(super) fn line(&self) -> &[u8] {
        let line = self.buffer.strip_suffix(b"\n").unwrap_or(&self.buffer);
        line.strip_suffix(b"\r").unwrap_or(line)
    }

    /// Its number, from 1.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Goes to the next line; `false` behind the last one.
    #[inline]
    pub(super) fn advance(&mut self) -> Result<bool, ReadError> {
        self.buffer.clear();
        self.number += 1;
        let read = (&mut self.input).take(LINE_LIMIT_BYTES as u64 + 1).read_until(b'\n', &mut self.buffer);
        let bytes = read.map_err(|error| Fault::from(error).at(Place::Line(self.number)))?;
        if self.buffer.len() > LINE_LIMIT_BYTES {
            return Err(Fault::LineTooLong(LINE_LIMIT_BYTES).at(Place::Line(self.number)));
        }
        if self.number == 1 && self.buffer.starts_with(b"\xef\xbb\xbf") {
            self.buffer.drain(..3);
        }
        Ok(bytes > 0)
    }
}
