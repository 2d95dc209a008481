//! Files as streams of bytes and of lines, with limits on what they may grow to.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read};
use std::path::PathBuf;

use flate2::read::MultiGzDecoder;

use super::error::{Fault, Place, ReadError};

/// Longest line that is read \[bytes\]: an instant of a hundred thousand vehicles.
pub(super) const LINE_LIMIT_BYTES: usize = 8 * 1024 * 1024;

/// Bytes read at a time.
const BLOCK_BYTES: usize = 256 * 1024;

/// Up to here compressed data may grow without being looked at \[bytes\].
const FREE_GROWTH_BYTES: u64 = 64 * 1024 * 1024;

/// Beyond [`FREE_GROWTH_BYTES`] data may grow by this factor. Deflate reaches 1032, recordings of real motion 20.
const GROWTH_LIMIT: u64 = 200;

/// First bytes of a gzip file.
pub(super) const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// A file that can be read from its start as often as needed.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub(super) path: PathBuf,
    pub(super) gzip: bool,
}

impl Source {
    /// The bytes of the file, unpacked.
    pub(super) fn bytes(&self) -> io::Result<Box<dyn Read>> {
        let file = File::open(&self.path)?;
        if !self.gzip {
            return Ok(Box::new(file));
        }
        let packed_bytes = file.metadata()?.len();
        Ok(Box::new(Growing::new(MultiGzDecoder::new(BufReader::new(file)), packed_bytes)))
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

/// The lines of a text, one in memory at a time.
pub(super) struct Lines {
    input: BufReader<Box<dyn Read>>,
    /// The current line with its end.
    buffer: Vec<u8>,
    number: u64,
}

impl Lines {
    pub(super) fn new(source: &Source) -> io::Result<Self> {
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
