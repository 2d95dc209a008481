//! Zip archives, whose entries must not grow beyond all measure.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek as _, SeekFrom};

use flate2::bufread::DeflateDecoder;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::error::{Fault, Place, ReadError};
use super::source::{Growing, Source, fault_of};

/// An archive opened for reading.
pub(super) struct Archive {
    source: Source,
    zip: ZipArchive<BufReader<File>>,
}

impl Archive {
    pub(super) fn open(source: &Source) -> Result<Self, ReadError> {
        let file = File::open(&source.path).map_err(|error| source.error(Fault::System(error)))?;
        let zip = ZipArchive::new(BufReader::new(file)).map_err(|error| source.error(zip_fault(error)))?;
        Ok(Self { source: source.clone(), zip })
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
        let at = |fault| self.source.error(fault).at(Place::Part(format!("entry `{name}`")));
        let index = self.zip.index_for_name(name).ok_or_else(|| at(zip_fault(ZipError::FileNotFound)))?;
        let entry = self.zip.by_index_raw(index).map_err(|error| at(zip_fault(error)))?;
        let (method, start, crc) = (entry.compression(), entry.data_start(), entry.crc32());
        let packed_bytes = entry.compressed_size();
        if entry.encrypted() {
            return Err(at(Fault::content("it is encrypted", "give an archive without a password")));
        }
        let start = start.ok_or_else(|| at(Fault::damaged("the entry has no place in the archive")))?;
        let mut file = File::open(&self.source.path).map_err(|error| at(Fault::System(error)))?;
        file.seek(SeekFrom::Start(start)).map_err(|error| at(Fault::System(error)))?;
        // What the archive says of its lengths is no more than a claim: an entry cannot be longer than its file.
        let file_bytes = file.metadata().map_or(0, |data| data.len());
        let packed = BufReader::new(file.take(packed_bytes));
        let packed_bytes = packed_bytes.min(file_bytes);
        Ok(match method {
            CompressionMethod::Stored => Box::new(Checked::new(packed, crc)),
            CompressionMethod::Deflated => {
                Box::new(Checked::new(Growing::new(DeflateDecoder::new(packed), move || packed_bytes), crc))
            }
            other => {
                let remedy = "make the archive with deflate or unpacked, as numpy.savez does";
                return Err(at(Fault::content(format!("it is packed by {other}"), remedy)));
            }
        })
    }

    /// All bytes of an entry, unpacked.
    pub(super) fn whole(&mut self, name: &str) -> Result<Vec<u8>, ReadError> {
        let mut bytes = Vec::new();
        let read = self.entry(name)?.read_to_end(&mut bytes);
        read.map_err(|error| self.source.error(fault_of(error)).at(Place::Part(format!("entry `{name}`"))))?;
        Ok(bytes)
    }
}

fn zip_fault(error: ZipError) -> Fault {
    match error {
        ZipError::Io(error) => fault_of(error),
        ZipError::FileNotFound => Fault::content("the entry is missing", "make the archive again"),
        ZipError::UnsupportedArchive(what) => Fault::content(
            format!("the archive needs what is not supported: {what}"),
            "make it with deflate or unpacked",
        ),
        ZipError::InvalidArchive(what) if what.contains("EOCD") || what.contains("end") => {
            Fault::Truncated { what: "the end of the archive is missing".to_owned() }
        }
        other => Fault::damaged(other),
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
