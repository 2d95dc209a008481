//! Zip archives, whose entries must not grow beyond all measure.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use flate2::bufread::DeflateDecoder;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::error::{Fault, Place, ReadError, quoted};

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
            return Err(Fault::coded(
                "recording/archive-entry",
                format!("two of its entries are called {}", quoted(&name)),
                remedy,
            ));
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
            return Err(Fault::coded(
                "recording/unsupported-compression",
                "it is encrypted",
                "give an archive without a password",
            ));
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
                return Err(Fault::coded(
                    "recording/unsupported-compression",
                    format!("it is packed by {other}"),
                    remedy,
                ));
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
