//! Reads the records of an MCAP file one after another.
//!
//! The framing is parsed here because a recording may be damaged or hostile. The readers of the `mcap` crate allocate
//! the length in a record header and use unchecked arithmetic inside chunks. Here memory grows only with bytes that are
//! in the file.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use mcap::MAGIC;
use mcap::records::op;

use tautline_core::record::{ReadFault, RecordError};

/// Largest accepted record \[bytes\]: a sample of three million vehicles.
const RECORD_LIMIT_BYTES: u64 = 256 * 1024 * 1024;

/// Unpacked size of all chunks up to which their growth is not limited \[bytes\], and the largest growth factor beyond.
const FREE_GROWTH_BYTES: u64 = 1024 * 1024 * 1024;
const GROWTH_LIMIT: u64 = 200;

/// Size of a record header: opcode and length.
const HEAD_BYTES: usize = 9;

/// Size of a footer's content.
const FOOTER_BYTES: u64 = 20;

/// Record of the file.
pub(super) struct Record<'a> {
    /// Position of the record, or of its chunk, in the file \[bytes\].
    pub(super) offset: u64,
    pub(super) opcode: u8,
    pub(super) body: &'a [u8],
}

/// Reader of the records in the data section of an MCAP file, including those inside chunks.
pub(super) struct RecordReader {
    file: BufReader<File>,
    /// Whether the file ends with a footer.
    complete: bool,
    /// Position of the next record in the file \[bytes\].
    offset: u64,
    /// Position of the record in `body` \[bytes\].
    body_offset: u64,
    body: Vec<u8>,
    /// Range of `body` with the unread records of a chunk.
    chunk: std::ops::Range<usize>,
    /// Unpacked size of the chunks up to now \[bytes\].
    unpacked_bytes: u64,
    ended: bool,
}

impl RecordReader {
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let mut file = File::open(path)?;
        let mut magic = Vec::new();
        (&mut file).take(MAGIC.len() as u64).read_to_end(&mut magic)?;
        if magic.is_empty() {
            return Err(invalid(ReadFault::Empty));
        }
        if magic != MAGIC {
            return Err(invalid(ReadFault::NotMcap));
        }
        let complete = ends_with_footer(&mut file)?;
        let offset = file.seek(SeekFrom::Start(MAGIC.len() as u64))?;
        Ok(Self {
            file: BufReader::new(file),
            complete,
            offset,
            body_offset: offset,
            body: Vec::new(),
            chunk: 0..0,
            unpacked_bytes: 0,
            ended: false,
        })
    }

    pub(super) fn is_complete(&self) -> bool {
        self.complete
    }

    /// Returns the next record, with chunks unpacked; `None` at the end of the data section, or at the truncation of an
    /// unclosed file.
    pub(super) fn next(&mut self) -> io::Result<Option<Record<'_>>> {
        while self.chunk.is_empty() {
            let Some(opcode) = self.read_record()? else { return Ok(None) };
            match opcode {
                op::DATA_END | op::FOOTER => {
                    if self.complete {
                        self.check_end(opcode)?;
                    }
                    self.ended = true;
                    return Ok(None);
                }
                op::CHUNK => {
                    self.body = chunk_records(&self.body).map_err(|reason| damaged(self.body_offset, reason))?;
                    self.chunk = 0..self.body.len();
                    self.unpacked_bytes += self.body.len() as u64;
                    if self.unpacked_bytes > FREE_GROWTH_BYTES.max(self.offset.saturating_mul(GROWTH_LIMIT)) {
                        return Err(damaged(self.body_offset, "its chunks unpack to more than 200 times their size"));
                    }
                }
                _ => return Ok(Some(Record { offset: self.body_offset, opcode, body: &self.body })),
            }
        }
        let rest = &self.body[self.chunk.clone()];
        let head = Fields(rest).head();
        match head.and_then(|(opcode, bytes)| Some((opcode, usize::try_from(bytes).ok()?))) {
            Some((opcode, bytes)) if bytes <= rest.len() - HEAD_BYTES => {
                self.chunk.start += HEAD_BYTES + bytes;
                let body = &rest[HEAD_BYTES..HEAD_BYTES + bytes];
                Ok(Some(Record { offset: self.body_offset, opcode, body }))
            }
            _ => Err(damaged(self.body_offset, "a record inside the chunk is longer than the chunk")),
        }
    }

    /// Reads the next record of the file into `body`; skips the content of unused record types.
    fn read_record(&mut self) -> io::Result<Option<u8>> {
        if self.ended {
            return Ok(None);
        }
        self.body_offset = self.offset;
        if self.fill(HEAD_BYTES as u64)? < HEAD_BYTES as u64 {
            return self.broken_off();
        }
        let Some((opcode, bytes)) = Fields(&self.body).head() else { return self.broken_off() };
        let wanted = matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::CHUNK);
        if opcode == 0 {
            return Err(damaged(self.body_offset, "it has no type"));
        }
        let read = if wanted {
            if bytes > RECORD_LIMIT_BYTES {
                let (offset, limit) = (self.body_offset, RECORD_LIMIT_BYTES);
                return Err(invalid(ReadFault::TooLong { offset, bytes, limit }));
            }
            self.fill(bytes)?
        } else {
            io::copy(&mut (&mut self.file).take(bytes), &mut io::sink())?
        };
        self.offset = self.offset.saturating_add(HEAD_BYTES as u64).saturating_add(bytes);
        if read < bytes { self.broken_off() } else { Ok(Some(opcode)) }
    }

    /// Refuses data after the end of the recording, such as a second recording.
    fn check_end(&mut self, mut opcode: u8) -> io::Result<()> {
        while opcode != op::FOOTER {
            let Some(next) = self.read_record()? else { return Ok(()) };
            opcode = next;
        }
        self.body_offset = self.offset;
        if self.fill(MAGIC.len() as u64 + 1)? == MAGIC.len() as u64 && self.body == MAGIC {
            return Ok(());
        }
        Err(damaged(self.body_offset, "it follows the end of the recording; judge each recording separately"))
    }

    /// Replaces `body` with the next `bytes` bytes, or with fewer at the end of the file.
    fn fill(&mut self, bytes: u64) -> io::Result<u64> {
        self.body.clear();
        let read = (&mut self.file).take(bytes).read_to_end(&mut self.body)?;
        Ok(read as u64)
    }

    /// Handles the end of the file: accepted for an unclosed file, damage in a closed one.
    fn broken_off<T>(&mut self) -> io::Result<Option<T>> {
        self.ended = true;
        if self.complete {
            return Err(damaged(self.body_offset, "it goes beyond the end of the file"));
        }
        Ok(None)
    }
}

/// Returns whether the file ends with a footer record and the closing magic bytes.
fn ends_with_footer(file: &mut File) -> io::Result<bool> {
    let mut expected = vec![op::FOOTER];
    expected.extend_from_slice(&FOOTER_BYTES.to_le_bytes());
    let head = expected.len();
    let tail = head as u64 + FOOTER_BYTES + MAGIC.len() as u64;
    let length = file.seek(SeekFrom::End(0))?;
    let Some(start) = length.checked_sub(tail) else { return Ok(false) };
    file.seek(SeekFrom::Start(start))?;
    let mut bytes = Vec::new();
    file.take(tail).read_to_end(&mut bytes)?;
    Ok(bytes.starts_with(&expected) && bytes.ends_with(MAGIC))
}

/// Unpacks the records of a chunk, up to the declared size, and verifies their checksum.
fn chunk_records(body: &[u8]) -> Result<Vec<u8>, &'static str> {
    let mut fields = Fields(body);
    let header = (|| {
        let _message_times = (fields.u64()?, fields.u64()?);
        Some((fields.u64()?, fields.u32()?, fields.str()?, fields.u64()?))
    })();
    let (unpacked_bytes, crc, compression, bytes) = header.ok_or("the chunk has no header")?;
    let packed = usize::try_from(bytes).ok().and_then(|bytes| fields.0.get(..bytes));
    let mut packed = packed.ok_or("the chunk is shorter than its header declares")?;
    if unpacked_bytes > RECORD_LIMIT_BYTES {
        return Err("the chunk declares an unpacked size above 256 MiB");
    }
    let mut records = Vec::new();
    let read = match compression {
        "" => packed.read_to_end(&mut records),
        "lz4" => lz4_flex::frame::FrameDecoder::new(packed).take(unpacked_bytes).read_to_end(&mut records),
        "zstd" => zstd::Decoder::new(packed).and_then(|zstd| zstd.take(unpacked_bytes).read_to_end(&mut records)),
        _ => return Err("the chunk compression is not lz4 or zstd; rewrite the file with `mcap compress`"),
    };
    read.map_err(|_| "the packed content of the chunk is wrong")?;
    if records.len() as u64 != unpacked_bytes {
        return Err("the chunk is shorter than its header declares");
    }
    if crc != 0 && crc32fast::hash(&records) != crc { Err("the checksum of the chunk is wrong") } else { Ok(records) }
}

/// Wraps a fault of the content as an `io::Error`.
fn invalid(fault: ReadFault) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, fault)
}

pub(super) fn damaged(offset: u64, reason: &str) -> io::Error {
    invalid(ReadFault::Damaged { offset, reason: reason.to_owned() })
}

/// Returns the fault of the content, or the error of the system.
pub(super) fn error(path: &Path, error: io::Error) -> RecordError {
    let path = path.display().to_string();
    match error.downcast() {
        Ok(fault) => RecordError::Read { path, fault },
        Err(source) => RecordError::Open { path, source },
    }
}

/// Cursor over the fields of a record; `None` past its end.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    fn head(mut self) -> Option<(u8, u64)> {
        let [opcode] = self.array()?;
        Some((opcode, self.u64()?))
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (array, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*array)
    }

    pub(super) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn str(&mut self) -> Option<&'a str> {
        let bytes = usize::try_from(self.u32()?).ok()?;
        let (text, rest) = self.0.split_at_checked(bytes)?;
        self.0 = rest;
        std::str::from_utf8(text).ok()
    }
}
