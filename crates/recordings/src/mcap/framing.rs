//! The records of an MCAP file, one after the other.
//!
//! The format's framing is read here and not by the `mcap` crate, because a recording may be damaged or hostile: the
//! crate's readers reserve memory for whatever length a record claims and do unchecked arithmetic on lengths inside a
//! chunk. Here memory grows only with bytes that are really in the file.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use mcap::MAGIC;
use mcap::records::op;

use tautline_core::record::{ReadFault, RecordError};

/// Longest record that is read \[bytes\]: a sample of three million vehicles.
const RECORD_LIMIT_BYTES: u64 = 256 * 1024 * 1024;

/// Bytes of a record's head: opcode and length.
const HEAD_BYTES: usize = 9;

/// Bytes of a footer's content.
const FOOTER_BYTES: u64 = 20;

/// One record: what it is and what it holds.
pub(super) struct Record<'a> {
    /// Where in the file it, or the chunk around it, begins \[bytes\].
    pub(super) offset: u64,
    pub(super) opcode: u8,
    pub(super) body: &'a [u8],
}

/// Reads the data section of an MCAP file record by record and goes into its chunks.
pub(super) struct RecordReader {
    file: BufReader<File>,
    /// Whether the file ends as a closed recording does.
    complete: bool,
    /// Where in the file the next record begins \[bytes\].
    offset: u64,
    /// Where in the file the record in `body` begins \[bytes\].
    body_offset: u64,
    body: Vec<u8>,
    /// The part of `body` that holds records of a chunk not yet given out.
    chunk: std::ops::Range<usize>,
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
            ended: false,
        })
    }

    pub(super) fn is_complete(&self) -> bool {
        self.complete
    }

    /// The next record, chunks taken apart; `None` at the end of the data section or where a file that was not closed
    /// breaks off.
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

    /// Reads the next record of the file into `body`, or only its opcode where the content is not used.
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

    /// Refuses a file in which something follows the end of the recording, such as a second recording.
    fn check_end(&mut self, mut opcode: u8) -> io::Result<()> {
        while opcode != op::FOOTER {
            let Some(next) = self.read_record()? else { return Ok(()) };
            opcode = next;
        }
        self.body_offset = self.offset;
        if self.fill(MAGIC.len() as u64 + 1)? == MAGIC.len() as u64 && self.body == MAGIC {
            return Ok(());
        }
        Err(damaged(self.body_offset, "it follows the end of the recording: judge each recording by itself"))
    }

    /// Replaces `body` by the next `bytes` bytes, or by as many as there are.
    fn fill(&mut self, bytes: u64) -> io::Result<u64> {
        self.body.clear();
        let read = (&mut self.file).take(bytes).read_to_end(&mut self.body)?;
        Ok(read as u64)
    }

    /// The end of a file that was not closed; a file that was closed cannot end here.
    fn broken_off<T>(&mut self) -> io::Result<Option<T>> {
        self.ended = true;
        if self.complete {
            return Err(damaged(self.body_offset, "it goes beyond the end of the file"));
        }
        Ok(None)
    }
}

/// Whether the file ends with a footer record and the format's closing bytes.
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

/// The records in a chunk's content, unpacked to no more than it says, once its checksum is found right.
fn chunk_records(body: &[u8]) -> Result<Vec<u8>, &'static str> {
    let mut fields = Fields(body);
    let header = (|| {
        let _message_times = (fields.u64()?, fields.u64()?);
        Some((fields.u64()?, fields.u32()?, fields.str()?, fields.u64()?))
    })();
    let (unpacked_bytes, crc, compression, bytes) = header.ok_or("the chunk has no header")?;
    let packed = usize::try_from(bytes).ok().and_then(|bytes| fields.0.get(..bytes));
    let mut packed = packed.ok_or("the chunk is shorter than it says")?;
    if unpacked_bytes > RECORD_LIMIT_BYTES {
        return Err("the chunk claims to unpack to more than any recording needs");
    }
    let mut records = Vec::new();
    let read = match compression {
        "" => packed.read_to_end(&mut records),
        "lz4" => lz4_flex::frame::FrameDecoder::new(packed).take(unpacked_bytes).read_to_end(&mut records),
        "zstd" => zstd::Decoder::new(packed).and_then(|zstd| zstd.take(unpacked_bytes).read_to_end(&mut records)),
        _ => return Err("the chunk is packed by something else than lz4 and zstd (`mcap compress` changes that)"),
    };
    read.map_err(|_| "the packed content of the chunk is wrong")?;
    if records.len() as u64 != unpacked_bytes {
        return Err("the chunk is shorter than it says");
    }
    if crc != 0 && crc32fast::hash(&records) != crc { Err("the checksum of the chunk is wrong") } else { Ok(records) }
}

/// A fault of the content on its way through calls that fail as the system does.
fn invalid(fault: ReadFault) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, fault)
}

pub(super) fn damaged(offset: u64, reason: &str) -> io::Error {
    invalid(ReadFault::Damaged { offset, reason: reason.to_owned() })
}

/// The system's error or the file's fault.
pub(super) fn error(path: &Path, error: io::Error) -> RecordError {
    let path = path.display().to_string();
    match error.downcast() {
        Ok(fault) => RecordError::Read { path, fault },
        Err(source) => RecordError::Open { path, source },
    }
}

/// Takes the fields of a record off its front; `None` where it is too short.
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
