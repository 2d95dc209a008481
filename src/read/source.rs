//! Files as streams of bytes and of lines, with limits on what they may grow to.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::PathBuf;

use flate2::read::MultiGzDecoder;

use super::error::{Fault, FaultAt, Grown, Place};

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
            return Err(io::Error::other(Grown { inflated_bytes, packed_bytes }));
        }
        Ok(bytes)
    }
}

/// The lines of a text, one in memory at a time.
pub(super) struct Lines {
    input: Box<dyn Read>,
    buffer: Vec<u8>,
    /// The current line without its end.
    line: std::ops::Range<usize>,
    /// Where the next line begins, and where the bytes that were read end.
    next: usize,
    filled: usize,
    ended: bool,
    number: u64,
}

impl Lines {
    pub(super) fn new(source: &Source) -> io::Result<Self> {
        Ok(Self {
            input: source.bytes()?,
            buffer: vec![0; BLOCK_BYTES],
            line: 0..0,
            next: 0,
            filled: 0,
            ended: false,
            number: 0,
        })
    }

    /// The current line.
    pub(super) fn line(&self) -> &[u8] {
        &self.buffer[self.line.clone()]
    }

    /// Its number, from 1.
    pub(super) fn number(&self) -> u64 {
        self.number
    }

    /// Goes to the next line; `false` behind the last one.
    #[inline]
    pub(super) fn advance(&mut self) -> Result<bool, FaultAt> {
        let mut searched = self.next;
        loop {
            if let Some(at) = memchr::memchr(b'\n', &self.buffer[searched..self.filled]) {
                self.take_line(searched + at, searched + at + 1);
                return Ok(true);
            }
            searched = self.filled;
            if self.ended {
                if self.next == self.filled {
                    return Ok(false);
                }
                self.take_line(self.filled, self.filled);
                return Ok(true);
            }
            searched -= self.refill()?;
        }
    }

    fn take_line(&mut self, end: usize, next: usize) {
        let mut start = self.next;
        if self.number == 0 && self.buffer[start..end].starts_with(b"\xef\xbb\xbf") {
            start += 3;
        }
        let end = if self.buffer[start..end].ends_with(b"\r") { end - 1 } else { end };
        self.line = start..end;
        self.next = next;
        self.number += 1;
    }

    /// Reads more bytes behind those of the unfinished line and gives by how much that line was moved down.
    fn refill(&mut self) -> Result<usize, FaultAt> {
        let moved = self.next;
        self.buffer.copy_within(self.next..self.filled, 0);
        self.filled -= moved;
        self.next = 0;
        self.line = 0..0;
        if self.filled >= LINE_LIMIT_BYTES {
            return Err(Fault::LineTooLong { limit: LINE_LIMIT_BYTES }.at(Place::Line(self.number + 1)));
        }
        if self.filled == self.buffer.len() {
            self.buffer.resize((2 * self.buffer.len()).min(LINE_LIMIT_BYTES), 0);
        }
        let bytes = loop {
            match self.input.read(&mut self.buffer[self.filled..]) {
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                read => break read,
            }
        };
        let bytes = bytes.map_err(|error| Fault::from(error).at(Place::Line(self.number + 1)))?;
        self.ended = bytes == 0;
        self.filled += bytes;
        Ok(moved)
    }
}
