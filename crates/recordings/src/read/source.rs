//! Files as streams of bytes and lines, zip archives, and limits on the growth of compressed data.

use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::io::{BufReader, Read, Seek as _, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use flate2::bufread::DeflateDecoder;
use flate2::read::MultiGzDecoder;
use tempfile::TempPath;
use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::error::{ContentKind, Fault, Place, ReadError, quoted, refuse};

/// Longest accepted line \[bytes\]: an instant of a hundred thousand vehicles.
pub(super) const LINE_LIMIT_BYTES: usize = 8 * 1024 * 1024;

/// Block size of reads \[bytes\].
pub(super) const BLOCK_BYTES: usize = 256 * 1024;

/// First bytes of a gzip file.
pub(super) const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// First bytes of a Zstandard file.
pub(super) const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Names of vehicles, each with its files.
pub(super) type VehicleFiles = Vec<(String, Vec<Source>)>;

/// File or archive entry that can be read repeatedly.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) path: PathBuf,
    /// Entry, if `path` is an archive.
    pub(super) entry: Option<String>,
    pub(super) gzip: bool,
    pub(super) zstd: bool,
    /// Unpacked copy of an entry, and its name for errors.
    unpacked: Option<(Arc<TempPath>, PathBuf)>,
}

impl Source {
    /// Returns the source of a file.
    pub(super) fn file(path: &Path) -> Self {
        Self { path: path.to_owned(), entry: None, gzip: false, zstd: false, unpacked: None }
    }

    /// Returns the source of an archive entry.
    pub(super) fn entry(archive: &Path, name: String) -> Self {
        Self { entry: Some(name), ..Self::file(archive) }
    }

    /// Returns a seekable file: entries and compressed files are unpacked to a temporary file, which lives as long as
    /// any clone of the source.
    pub(super) fn seekable(self) -> Result<Self, ReadError> {
        if self.entry.is_none() && !self.gzip && !self.zstd {
            return Ok(self);
        }
        let mut file = tempfile::NamedTempFile::new()?;
        std::io::copy(&mut self.bytes()?, &mut file)?;
        let unpacked = Arc::new(file.into_temp_path());
        let display_name = self.display_path();
        Ok(Self { unpacked: Some((unpacked.clone(), display_name)), ..Self::file(&unpacked) })
    }

    /// Returns the name for errors.
    pub(super) fn display_path(&self) -> PathBuf {
        match (&self.unpacked, &self.entry) {
            (Some((_, display_name)), _) => display_name.clone(),
            (None, Some(entry)) => self.path.join(entry),
            (None, None) => self.path.clone(),
        }
    }

    /// Returns the name of its only vehicle: the file name without extensions.
    pub(super) fn stem(&self) -> String {
        let path = self.display_path();
        let packed = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gz"));
        let path = if packed { path.with_extension("") } else { path };
        path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Returns the bytes of the file, unpacked.
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

/// Lines of a text. The current line is a slice of the block that was read last.
pub(super) struct Lines {
    input: Box<dyn Read>,
    /// Bytes in memory: `filled` of them were read, those from `next` on follow the current line.
    block: Vec<u8>,
    filled: usize,
    next: usize,
    /// Places of the line ends in the block, and the number of those that lie before `next`.
    line_ends: Vec<usize>,
    passed: usize,
    /// Current line without its line end.
    line: Range<usize>,
    number: u64,
}

impl Lines {
    pub(super) fn new(source: &Source) -> Result<Self, ReadError> {
        let input = source.bytes()?;
        Ok(Self {
            input,
            block: vec![0; BLOCK_BYTES],
            filled: 0,
            next: 0,
            line_ends: Vec::new(),
            passed: 0,
            line: 0..0,
            number: 0,
        })
    }

    /// Returns the current line without its line end.
    #[inline]
    pub(super) fn line(&self) -> &[u8] {
        &self.block[self.line.clone()]
    }

    /// Returns its number, from 1.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Returns its place.
    pub(super) fn place(&self) -> Place {
        Place::Line(self.number)
    }

    /// Moves to the next line; returns `false` after the last one.
    #[inline]
    pub(super) fn advance(&mut self) -> Result<bool, ReadError> {
        self.number += 1;
        match self.line_ends.get(self.passed) {
            Some(&end) => self.enter(end, 1).map(|()| true),
            None => self.fill(),
        }
    }

    /// Moves to the line from `next` to `end`, and over the bytes of its line end.
    #[inline]
    fn enter(&mut self, end: usize, line_end: usize) -> Result<(), ReadError> {
        let start = self.next;
        if end + line_end - start > LINE_LIMIT_BYTES {
            return Err(self.too_long());
        }
        self.next = end + line_end;
        self.passed += 1;
        let line = &self.block[start..end];
        self.line = start..end - usize::from(line.ends_with(b"\r"));
        if self.number == 1 && line.starts_with(b"\xef\xbb\xbf") {
            self.line.start += 3;
        }
        Ok(())
    }

    /// Reads blocks up to the end of the next line, and moves to it.
    #[cold]
    fn fill(&mut self) -> Result<bool, ReadError> {
        self.block.copy_within(self.next..self.filled, 0);
        self.filled -= self.next;
        (self.next, self.line) = (0, 0..0);
        self.line_ends.clear();
        self.passed = 0;
        loop {
            if self.filled > LINE_LIMIT_BYTES {
                return Err(self.too_long());
            }
            if self.filled == self.block.len() {
                self.block.resize(2 * self.filled, 0);
            }
            let before = self.filled;
            match self.input.read(&mut self.block[before..]) {
                Ok(0) => return self.enter(before, 0).map(|()| before > 0),
                Ok(bytes) => self.filled += bytes,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(Fault::from(error).at(self.place())),
            }
            // One search for all line ends of a block is faster than one for each line.
            self.line_ends.extend(memchr::memchr_iter(b'\n', &self.block[before..self.filled]).map(|at| before + at));
            if let Some(&end) = self.line_ends.first() {
                return self.enter(end, 1).map(|()| true);
            }
        }
    }

    #[cold]
    fn too_long(&self) -> ReadError {
        Fault::line_too_long(LINE_LIMIT_BYTES).at(self.place())
    }
}

/// Longest end record of an archive, including its comment \[bytes\].
const END_LIMIT_BYTES: u64 = 22 + 65_535;

/// Unpacked size below which growth is not limited \[bytes\].
const FREE_GROWTH_BYTES: u64 = 64 * 1024 * 1024;

/// Largest growth factor beyond [`FREE_GROWTH_BYTES`]. Deflate reaches 1032, recordings of real motion 20.
const GROWTH_LIMIT: u64 = 200;

/// Returns whether unpacked data are so much larger than the packed ones that they are refused.
pub(super) fn grows_without_end(unpacked_bytes: u64, packed_bytes: u64) -> bool {
    unpacked_bytes > FREE_GROWTH_BYTES.max(packed_bytes.saturating_mul(GROWTH_LIMIT))
}

/// Returns the error of data that grow too large.
pub(super) fn grown(unpacked_bytes: u64, packed_bytes: u64) -> io::Error {
    let problem = format!("it unpacks to more than {unpacked_bytes} bytes from {packed_bytes}");
    io::Error::new(io::ErrorKind::FileTooLarge, problem)
}

/// Size up to which documents of an archive may be unpacked to memory, and their largest growth factor beyond it. A
/// document takes up to twelve times its size in memory. Shows of real motion grow by a factor of ten.
const FREE_DOCUMENT_BYTES: u64 = 2 * FREE_GROWTH_BYTES;
const DOCUMENT_GROWTH_LIMIT: u64 = 30;

/// Opened zip archive.
pub(super) struct Archive {
    path: PathBuf,
    zip: ZipArchive<BufReader<File>>,
    /// Size of the documents unpacked to memory up to now \[bytes\].
    document_bytes: u64,
}

impl Archive {
    pub(super) fn open(path: &Path) -> Result<Self, Fault> {
        let zip = ZipArchive::new(BufReader::new(File::open(path)?)).map_err(|error| match error {
            ZipError::InvalidArchive(_) if !has_end(path) => Fault::truncated("the end of the archive is missing"),
            other => zip_fault(other),
        })?;
        if zip.has_duplicate_names()
            && let Some(name) = repeated(path, zip.central_directory_start())?
        {
            let remedy = "unpack it, and make an archive with only one of the two";
            return refuse(ContentKind::ArchiveEntry, format!("two entries have the name {}", quoted(&name)), remedy);
        }
        Ok(Self { path: path.to_owned(), zip, document_bytes: 0 })
    }

    /// Returns whether there is an entry with this name.
    pub(super) fn holds(&self, name: &str) -> bool {
        self.zip.index_for_name(name).is_some()
    }

    /// Returns the names of all entries.
    pub(super) fn names(&self) -> Vec<String> {
        self.zip.file_names().filter_map(Result::ok).map(std::borrow::Cow::into_owned).collect()
    }

    /// Returns the bytes of an entry, unpacked and verified by their checksum.
    pub(super) fn entry(&mut self, name: &str) -> Result<Box<dyn Read>, ReadError> {
        self.try_entry(name).map_err(|fault| fault.at(place(name)))
    }

    fn try_entry(&mut self, name: &str) -> Result<Box<dyn Read>, Fault> {
        let index = self.zip.index_for_name(name).ok_or_else(|| zip_fault(ZipError::FileNotFound))?;
        let entry = self.zip.by_index_raw(index).map_err(zip_fault)?;
        let (method, start, crc) = (entry.compression(), entry.data_start(), entry.crc32());
        let packed_bytes = entry.compressed_size();
        if entry.encrypted() {
            let remedy = "give an archive without a password";
            return refuse(ContentKind::UnsupportedCompression, "it is encrypted", remedy);
        }
        let start = start.ok_or_else(|| Fault::damaged("the entry has no offset in the archive"))?;
        let mut file = File::open(&self.path)?;
        file.seek(SeekFrom::Start(start))?;
        // The declared lengths are not trusted: an entry cannot be longer than its file.
        let file_bytes = file.metadata().map_or(0, |data| data.len());
        let packed = BufReader::new(file.take(packed_bytes));
        let packed_bytes = packed_bytes.min(file_bytes);
        Ok(match method {
            CompressionMethod::Stored => Box::new(Checked::new(packed, crc)),
            CompressionMethod::Deflated => {
                Box::new(Checked::new(Growing::new(DeflateDecoder::new(packed), packed_bytes), crc))
            }
            other => {
                let remedy = "make the archive with deflate or without compression, as numpy.savez does";
                return refuse(ContentKind::UnsupportedCompression, format!("it is packed by {other}"), remedy);
            }
        })
    }

    /// Checks that no two entries share bytes, so that unpacked sizes are limited by the size of the file.
    pub(super) fn check_entries(&mut self) -> Result<(), Fault> {
        let mut ranges = Vec::with_capacity(self.zip.len());
        for index in 0..self.zip.len() {
            let entry = self.zip.by_index_raw(index).map_err(zip_fault)?;
            let start = entry.data_start().ok_or_else(|| Fault::damaged("an entry has no offset in the archive"))?;
            ranges.push((start, start.saturating_add(entry.compressed_size())));
        }
        ranges.sort_unstable();
        if ranges.windows(2).any(|pair| pair[0].1 > pair[1].0) {
            return refuse(ContentKind::ArchiveEntry, "two entries share bytes", "make the archive again");
        }
        Ok(())
    }

    /// Returns all bytes of an entry, unpacked. The size of all documents read so is limited.
    pub(super) fn document(&mut self, name: &str) -> Result<Vec<u8>, ReadError> {
        let packed_bytes = std::fs::metadata(&self.path)?.len();
        let limit = FREE_DOCUMENT_BYTES.max(packed_bytes.saturating_mul(DOCUMENT_GROWTH_LIMIT));
        let left = limit.saturating_sub(self.document_bytes);
        let mut bytes = Vec::new();
        let read = self.entry(name)?.take(left + 1).read_to_end(&mut bytes);
        let read = read.map_err(|error| Fault::from(error).at(place(name)))? as u64;
        self.document_bytes += read;
        if read > left {
            return Err(Fault::from(grown(self.document_bytes, packed_bytes)).at(place(name)));
        }
        Ok(bytes)
    }
}

fn place(name: &str) -> Place {
    Place::Part(format!("entry `{name}`"))
}

/// Returns whether the end record of an archive is among the last bytes of a file.
fn has_end(path: &Path) -> bool {
    let tail = File::open(path).and_then(|mut file| {
        let (bytes, mut tail) = (file.metadata()?.len(), Vec::new());
        file.seek(SeekFrom::Start(bytes.saturating_sub(END_LIMIT_BYTES)))?;
        file.read_to_end(&mut tail).map(|_| tail)
    });
    tail.is_ok_and(|tail| memchr::memmem::find(&tail, b"PK\x05\x06").is_some())
}

/// Returns the first file name that occurs twice in the directory of an archive, which starts at byte `directory`.
/// Folders may repeat.
fn repeated(path: &Path, directory: u64) -> io::Result<Option<String>> {
    /// Size of a directory entry before its name, and its first four bytes.
    const FIXED_BYTES: usize = 46;
    const BEGIN: [u8; 4] = *b"PK\x01\x02";
    let mut file = BufReader::new(File::open(path)?);
    file.seek(SeekFrom::Start(directory))?;
    let (mut fixed, mut known) = ([0; FIXED_BYTES], BTreeSet::new());
    while file.read_exact(&mut fixed).is_ok() && fixed.starts_with(&BEGIN) {
        let [name, extra, comment] = [28, 30, 32].map(|offset| u16::from_le_bytes([fixed[offset], fixed[offset + 1]]));
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
            Fault::content(ContentKind::ArchiveEntry, "the entry is missing", "make the archive again")
        }
        ZipError::UnsupportedArchive(what) => Fault::content(
            ContentKind::UnsupportedCompression,
            format!("unsupported archive feature: {what}"),
            "make the archive with deflate or without compression",
        ),
        other => Fault::damaged(other),
    }
}

/// Unpacked data with a growth limit.
pub(super) struct Growing<R> {
    inner: R,
    packed_bytes: u64,
    inflated_bytes: u64,
}

impl<R: Read> Growing<R> {
    /// Limits `inner`, whose compressed size is `packed_bytes`.
    pub(super) fn new(inner: R, packed_bytes: u64) -> Self {
        Self { inner, packed_bytes, inflated_bytes: 0 }
    }
}

impl<R: Read> Read for Growing<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let bytes = self.inner.read(buffer)?;
        self.inflated_bytes += bytes as u64;
        let Self { inflated_bytes, packed_bytes, .. } = *self;
        if grows_without_end(inflated_bytes, packed_bytes) {
            return Err(grown(inflated_bytes, packed_bytes));
        }
        Ok(bytes)
    }
}

/// Bytes that are verified by their checksum at the end.
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
