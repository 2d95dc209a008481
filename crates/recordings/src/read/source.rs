//! Files as streams of bytes and of lines, zip archives, and limits to the growth of what is packed.

use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::io::{BufRead as _, BufReader, Read, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use flate2::bufread::DeflateDecoder;
use flate2::read::MultiGzDecoder;
use tempfile::TempPath;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::error::{Fault, Place, ReadError, quoted, refuse};

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

/// Longest end of an archive: its last record with the longest comment \[bytes\].
const END_LIMIT_BYTES: u64 = 22 + 65_535;

/// Up to here compressed data may grow without being looked at \[bytes\].
const FREE_GROWTH_BYTES: u64 = 64 * 1024 * 1024;

/// Beyond [`FREE_GROWTH_BYTES`] data may grow by this factor. Deflate reaches 1032, recordings of real motion 20.
const GROWTH_LIMIT: u64 = 200;

/// An archive opened for reading.
pub(super) struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
}

impl Archive {
    pub(super) fn open(path: &Path) -> Result<Self, Fault> {
        let zip = ZipArchive::new(BufReader::new(File::open(path)?)).map_err(|error| match error {
            ZipError::InvalidArchive(_) if !has_end(path) => {
                Fault::Truncated("the end of the archive is missing".to_owned())
            }
            other => zip_fault(other),
        })?;
        if zip.has_duplicate_names()
            && let Some(name) = repeated(path, zip.central_directory_start())?
        {
            let remedy = "unpack it, look which of the two is meant, and make the archive again with that one";
            return refuse(
                "recording/archive-entry",
                format!("two of its entries are called {}", quoted(&name)),
                remedy,
            );
        }
        Ok(Self { path: path.to_owned(), zip })
    }

    /// Whether there is an entry of this name.
    pub(super) fn holds(&self, name: &str) -> bool {
        self.zip.index_for_name(name).is_some()
    }

    /// Names of all entries.
    pub(super) fn names(&self) -> Vec<String> {
        self.zip.file_names().filter_map(Result::ok).map(std::borrow::Cow::into_owned).collect()
    }

    /// The bytes of an entry, unpacked and compared with their checksum.
    pub(super) fn entry(&mut self, name: &str) -> Result<Box<dyn Read>, ReadError> {
        self.try_entry(name).map_err(|fault| fault.at(place(name)))
    }

    fn try_entry(&mut self, name: &str) -> Result<Box<dyn Read>, Fault> {
        let index = self.zip.index_for_name(name).ok_or_else(|| zip_fault(ZipError::FileNotFound))?;
        let entry = self.zip.by_index_raw(index).map_err(zip_fault)?;
        let (method, start, crc) = (entry.compression(), entry.data_start(), entry.crc32());
        let packed_bytes = entry.compressed_size();
        if entry.encrypted() {
            return refuse(
                "recording/unsupported-compression",
                "it is encrypted",
                "give an archive without a password",
            );
        }
        let start = start.ok_or_else(|| Fault::damaged("the entry has no place in the archive"))?;
        let mut file = File::open(&self.path)?;
        file.seek(SeekFrom::Start(start))?;
        // What the archive says of its lengths is no more than a claim: an entry cannot be longer than its file.
        let file_bytes = file.metadata().map_or(0, |data| data.len());
        let packed = BufReader::new(file.take(packed_bytes));
        let packed_bytes = packed_bytes.min(file_bytes);
        Ok(match method {
            CompressionMethod::Stored => Box::new(Checked::new(packed, crc)),
            CompressionMethod::Deflated => {
                Box::new(Checked::new(Growing::new(DeflateDecoder::new(packed), packed_bytes), crc))
            }
            other => {
                let remedy = "make the archive with deflate or unpacked, as numpy.savez does";
                return refuse("recording/unsupported-compression", format!("it is packed by {other}"), remedy);
            }
        })
    }

    /// All bytes of an entry, unpacked.
    pub(super) fn whole(&mut self, name: &str) -> Result<Vec<u8>, ReadError> {
        let mut bytes = Vec::new();
        self.entry(name)?.read_to_end(&mut bytes).map_err(|error| Fault::from(error).at(place(name)))?;
        Ok(bytes)
    }
}

fn place(name: &str) -> Place {
    Place::Part(format!("entry `{name}`"))
}

/// Whether the record that every archive ends with is among the last bytes of a file.
fn has_end(path: &Path) -> bool {
    let tail = File::open(path).and_then(|mut file| {
        let (bytes, mut tail) = (file.metadata()?.len(), Vec::new());
        file.seek(SeekFrom::Start(bytes.saturating_sub(END_LIMIT_BYTES)))?;
        file.read_to_end(&mut tail).map(|_| tail)
    });
    tail.is_ok_and(|tail| memchr::memmem::find(&tail, b"PK\x05\x06").is_some())
}

/// The first name that two files of the directory of an archive have; it begins at this byte. Folders may come twice.
fn repeated(path: &Path, directory: u64) -> io::Result<Option<String>> {
    /// Bytes of an entry before its name, the first four of them.
    const FIXED_BYTES: usize = 46;
    const BEGIN: [u8; 4] = *b"PK\x01\x02";
    let mut file = BufReader::new(File::open(path)?);
    file.seek(SeekFrom::Start(directory))?;
    let (mut fixed, mut known) = ([0; FIXED_BYTES], BTreeSet::new());
    while file.read_exact(&mut fixed).is_ok() && fixed.starts_with(&BEGIN) {
        let [name, extra, comment] = [28, 30, 32].map(|at| u16::from_le_bytes([fixed[at], fixed[at + 1]]));
        let mut bytes = vec![0; usize::from(name)];
        file.read_exact(&mut bytes)?;
        file.seek_relative(i64::from(extra) + i64::from(comment))?;
        if !bytes.ends_with(b"/") && !known.insert(bytes.clone()) {
            return Ok(Some(String::from_utf8_lossy(&bytes).into_owned()));
        }
    }
    Ok(None)
}

fn zip_fault(error: ZipError) -> Fault {
    match error {
        ZipError::Io(error) => error.into(),
        ZipError::FileNotFound => {
            Fault::coded("recording/archive-entry", "the entry is missing", "make the archive again")
        }
        ZipError::UnsupportedArchive(what) => Fault::coded(
            "recording/unsupported-compression",
            format!("the archive needs what is not supported: {what}"),
            "make it with deflate or unpacked",
        ),
        other => Fault::damaged(other),
    }
}

/// Unpacked data that are refused once they grow beyond all measure.
pub(super) struct Growing<R> {
    inner: R,
    packed_bytes: u64,
    inflated_bytes: u64,
}

impl<R: Read> Growing<R> {
    /// What is packed takes so much of the file \[bytes\].
    pub(super) fn new(inner: R, packed_bytes: u64) -> Self {
        Self { inner, packed_bytes, inflated_bytes: 0 }
    }
}

impl<R: Read> Read for Growing<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.inner.read(buffer)?;
        self.inflated_bytes += bytes as u64;
        let Self { inflated_bytes, packed_bytes, .. } = *self;
        if inflated_bytes > FREE_GROWTH_BYTES.max(packed_bytes.saturating_mul(GROWTH_LIMIT)) {
            let grown = format!("it grows to more than {inflated_bytes} bytes out of {packed_bytes}");
            return Err(io::Error::new(io::ErrorKind::FileTooLarge, grown));
        }
        Ok(bytes)
    }
}

/// Bytes that are compared with their checksum as they end.
struct Checked<R> {
    inner: R,
    hasher: crc32fast::Hasher,
    expected: u32,
}

impl<R> Checked<R> {
    fn new(inner: R, expected: u32) -> Self {
        Self { inner, hasher: crc32fast::Hasher::new(), expected }
    }
}

impl<R: Read> Read for Checked<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.inner.read(buffer)?;
        self.hasher.update(&buffer[..bytes]);
        if bytes == 0 && !buffer.is_empty() && self.hasher.clone().finalize() != self.expected {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "the checksum is wrong"));
        }
        Ok(bytes)
    }
}
