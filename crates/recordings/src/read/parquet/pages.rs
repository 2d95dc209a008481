//! Checks the sizes that a Parquet file claims, before the library allocates memory for them.
//!
//! The metadata are structs of Thrift's compact protocol. They are read here as strictly as every writer writes them:
//! with ascending fields of the known types. So the library finds the same numbers.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek as _, SeekFrom};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use bytes::Bytes;
use parquet::basic::{Compression, Encoding, Type as Physical};
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::reader::{ChunkReader, Length, SerializedPageReader};

use crate::read::source::{grown, grows_without_end};

/// File whose pages have a limited unpacked size.
pub(super) struct PageFile {
    file: File,
    /// Unpacked size of the pages of all columns read up to now \[bytes\].
    unpacked_bytes: Arc<AtomicU64>,
    compression: Compression,
    /// Header of the current page.
    header: Mutex<PageHeader>,
}

/// Sizes in the header of a page \[bytes\].
#[derive(Clone, Copy, Default)]
struct PageHeader {
    unpacked_bytes: u64,
    /// Size of the levels before the packed values.
    levels_bytes: u64,
    is_plain: bool,
}

impl PageFile {
    fn unpacks_too_much(&self, page: &[u8]) -> bool {
        let header = *self.header.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(packed) = usize::try_from(header.levels_bytes).ok().and_then(|start| page.get(start..)) else {
            return false;
        };
        let claimed_bytes = header.unpacked_bytes.saturating_sub(header.levels_bytes);
        let most = |unpacked: &mut dyn Read| io::copy(&mut unpacked.take(claimed_bytes + 1), &mut io::sink());
        // The library unpacks the other codecs into a buffer of the claimed size. It also reports damaged data.
        let unpacked = match self.compression {
            _ if header.is_plain => return false,
            Compression::GZIP(_) => most(&mut flate2::read::MultiGzDecoder::new(packed)),
            Compression::LZ4 => most(&mut lz4_flex::frame::FrameDecoder::new(packed)),
            _ => return false,
        };
        unpacked.is_ok_and(|bytes| bytes > claimed_bytes)
    }
}

impl Length for PageFile {
    fn len(&self) -> u64 {
        Length::len(&self.file)
    }
}

impl ChunkReader for PageFile {
    type T = BufReader<File>;

    /// Checks the page header at this offset, and returns a reader of it.
    fn get_read(&self, start: u64) -> Result<Self::T> {
        let mut reader = self.file.get_read(start)?;
        let packed_bytes = Length::len(&self.file);
        let header = Thrift { left: packed_bytes.saturating_sub(start), reader: &mut reader }
            .page_header()
            .map_err(|error| ParquetError::General(format!("the header of a page: {error}")))?;
        let page_bytes = header.unpacked_bytes;
        let unpacked_bytes = self.unpacked_bytes.fetch_add(page_bytes, Ordering::Relaxed) + page_bytes;
        if grows_without_end(unpacked_bytes, packed_bytes) {
            return Err(ParquetError::External(grown(unpacked_bytes, packed_bytes).into()));
        }
        *self.header.lock().unwrap_or_else(PoisonError::into_inner) = header;
        reader.seek(SeekFrom::Start(start))?;
        Ok(reader)
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes> {
        let page = self.file.get_bytes(start, length)?;
        if self.unpacks_too_much(&page) {
            return Err(ParquetError::General("a page unpacks to more bytes than its header states".to_owned()));
        }
        Ok(page)
    }
}

/// Pages of a column in a row group.
pub(super) struct Pages {
    pages: SerializedPageReader<PageFile>,
    physical: Physical,
}

impl Pages {
    /// Opens a column of a row group. `unpacked_bytes` counts the unpacked size of all columns.
    pub(super) fn new(
        file: &File,
        unpacked_bytes: &Arc<AtomicU64>,
        group: &RowGroupMetaData,
        column: usize,
    ) -> Result<Self> {
        let chunk = group.column(column);
        let rows = usize::try_from(group.num_rows())?;
        let file = PageFile {
            file: file.try_clone()?,
            unpacked_bytes: Arc::clone(unpacked_bytes),
            compression: chunk.compression(),
            header: Mutex::default(),
        };
        let pages = SerializedPageReader::new(Arc::new(file), chunk, rows, None)?;
        Ok(Self { pages, physical: chunk.column_type() })
    }

    /// Checks the count of values, for which the decoder allocates memory.
    fn check(&self, page: &Page) -> Result<()> {
        if self.physical == Physical::BYTE_ARRAY
            && let Some(name) = delta_text(page.encoding())
        {
            return Err(ParquetError::NYI(format!("text in the encoding {name}")));
        }
        let Page::DictionaryPage { buf, num_values, .. } = page else { return Ok(()) };
        // Text has its length, of four bytes, before it.
        let least_bytes = match self.physical {
            Physical::INT64 | Physical::DOUBLE => 8,
            _ => 4,
        };
        if *num_values as usize > buf.len() / least_bytes {
            let problem = format!("a dictionary claims {num_values} values in {} bytes", buf.len());
            return Err(ParquetError::General(problem));
        }
        Ok(())
    }
}

/// Returns the name of an encoding of text whose claimed counts are not checked.
pub(super) fn delta_text(encoding: Encoding) -> Option<&'static str> {
    match encoding {
        Encoding::DELTA_LENGTH_BYTE_ARRAY => Some("DELTA_LENGTH_BYTE_ARRAY"),
        Encoding::DELTA_BYTE_ARRAY => Some("DELTA_BYTE_ARRAY"),
        _ => None,
    }
}

impl Iterator for Pages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl PageReader for Pages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        let page = self.pages.get_next_page()?;
        page.as_ref().map_or(Ok(()), |page| self.check(page))?;
        Ok(page)
    }

    // Columns are flat and read whole, so that no page is skipped.
    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        Err(ParquetError::NYI("a look at the next page".to_owned()))
    }

    fn skip_next_page(&mut self) -> Result<()> {
        Err(ParquetError::NYI("a skipped page".to_owned()))
    }
}

/// Checks the description of a file, which is its footer.
///
/// # Errors
/// The schema nests too deep, or claims more columns than it has; the description is not strict.
pub(super) fn check_footer(footer: &[u8]) -> io::Result<()> {
    let mut thrift = Thrift { left: footer.len() as u64, reader: Cursor::new(footer) };
    let mut id = 0;
    while let Some(kind) = thrift.field(&mut id, FILE)? {
        if id == 2 {
            thrift.check_schema()?;
        } else {
            thrift.skip(kind, 0)?;
        }
    }
    Ok(())
}

/// Types of the compact protocol. The type of a truth value is its value.
const BOOL: u8 = 1;
const FALSE: u8 = 2;
const I8: u8 = 3;
const I16: u8 = 4;
const I32: u8 = 5;
const I64: u8 = 6;
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// Types of the fields 1, 2, … of the structs in `parquet.thrift`.
const FILE: &[u8] = &[I32, LIST, I64, LIST, LIST, BINARY, LIST];
const SCHEMA_ELEMENT: &[u8] = &[I32, I32, I32, BINARY, I32, I32, I32, I32, I32, STRUCT];
const PAGE: &[u8] = &[I32, I32, I32, I32, STRUCT, STRUCT, STRUCT, STRUCT];
const DATA_PAGE: &[u8] = &[I32, I32, I32, I32, STRUCT];
const DICTIONARY_PAGE: &[u8] = &[I32, I32, BOOL];
const DATA_PAGE_V2: &[u8] = &[I32, I32, I32, I32, I32, I32, BOOL, STRUCT];

/// Largest depth of nested groups and structs. Tables have flat columns.
const DEPTH_LIMIT: usize = 32;

/// Reader of the compact protocol.
struct Thrift<R> {
    reader: R,
    /// Number of bytes to the end.
    left: u64,
}

impl<R: BufRead> Thrift<R> {
    fn byte(&mut self) -> io::Result<u8> {
        let mut byte = [0];
        self.reader.read_exact(&mut byte)?;
        self.left = self.left.saturating_sub(1);
        Ok(byte[0])
    }

    fn varint(&mut self) -> io::Result<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(damaged("a number is too long"))
    }

    /// Reads a signed number of 32 bits.
    fn number(&mut self) -> io::Result<i32> {
        let value = self.varint()?;
        let value = (value >> 1).cast_signed() ^ -(value & 1).cast_signed();
        i32::try_from(value).map_err(|_| damaged("a number is too large"))
    }

    /// Reads a size or count, which is a signed number.
    fn size(&mut self) -> io::Result<u64> {
        u64::try_from(self.number()?).map_err(|_| damaged("a size is negative"))
    }

    fn jump(&mut self, bytes: u64) -> io::Result<()> {
        if bytes > self.left {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        self.left -= bytes;
        io::copy(&mut self.reader.by_ref().take(bytes), &mut io::sink()).map(drop)
    }

    /// Reads the type of the next field, and adds to `id`; returns `None` at the end of the struct.
    fn field(&mut self, id: &mut usize, kinds: &[u8]) -> io::Result<Option<u8>> {
        let byte = self.byte()?;
        let (delta, kind) = (usize::from(byte >> 4), byte & 0xf);
        if byte == 0 {
            return Ok(None);
        }
        *id += delta;
        let is_other = |&known: &u8| known != kind && !(known == BOOL && kind == FALSE);
        if delta == 0 || kinds.get(*id - 1).is_some_and(is_other) {
            return Err(damaged("a field is out of order or has a wrong type"));
        }
        Ok(Some(kind))
    }

    /// Reads the number and type of the elements of a list.
    fn list(&mut self) -> io::Result<(u64, u8)> {
        let byte = self.byte()?;
        let (count, kind) = (u64::from(byte >> 4), byte & 0xf);
        let count = if count == 15 { self.varint()? } else { count };
        if count > self.left {
            return Err(damaged("a list is longer than the rest of the file"));
        }
        Ok((count, kind))
    }

    fn skip(&mut self, kind: u8, depth: usize) -> io::Result<()> {
        if depth > DEPTH_LIMIT {
            return Err(damaged("its fields nest too deep"));
        }
        match kind {
            BOOL | FALSE => Ok(()),
            I8 => self.byte().map(drop),
            I16 | I32 | I64 => self.varint().map(drop),
            DOUBLE => self.jump(8),
            BINARY => {
                let bytes = self.varint()?;
                self.jump(bytes)
            }
            LIST => {
                let (count, kind) = self.list()?;
                if kind == BOOL || kind == FALSE {
                    return Err(damaged("it has a list of truth values"));
                }
                (0..count).try_for_each(|_| self.skip(kind, depth + 1))
            }
            STRUCT => self.skip_struct(&[], depth),
            _ => Err(damaged("it has a field of an unknown type")),
        }
    }

    fn skip_struct(&mut self, kinds: &[u8], depth: usize) -> io::Result<()> {
        let mut id = 0;
        while let Some(kind) = self.field(&mut id, kinds)? {
            self.skip(kind, depth + 1)?;
        }
        Ok(())
    }

    /// Checks the list of schema elements, which is a tree in depth-first order.
    fn check_schema(&mut self) -> io::Result<()> {
        let (count, kind) = self.list()?;
        if kind != STRUCT {
            return Err(damaged("its schema has no columns"));
        }
        // Number of children that each open group still has.
        let mut open: Vec<u64> = Vec::new();
        let mut claimed = 0;
        for _ in 0..count {
            let (mut id, mut children) = (0, 0);
            while let Some(kind) = self.field(&mut id, SCHEMA_ELEMENT)? {
                match id {
                    5 => children = self.size()?,
                    _ => self.skip(kind, 0)?,
                }
            }
            while open.pop_if(|left| *left == 0).is_some() {}
            if let Some(left) = open.last_mut() {
                *left -= 1;
            }
            claimed += children;
            open.push(children);
            if claimed >= count || open.len() > DEPTH_LIMIT {
                return Err(damaged("its schema nests too deep, or claims more columns than it has"));
            }
        }
        Ok(())
    }

    /// Reads the header of a page.
    fn page_header(&mut self) -> io::Result<PageHeader> {
        let (mut id, mut header) = (0, PageHeader::default());
        while let Some(kind) = self.field(&mut id, PAGE)? {
            match id {
                2 => header.unpacked_bytes = self.size()?,
                5 => self.skip_struct(DATA_PAGE, 0)?,
                7 => self.skip_struct(DICTIONARY_PAGE, 0)?,
                8 => {
                    let mut id = 0;
                    while let Some(kind) = self.field(&mut id, DATA_PAGE_V2)? {
                        match id {
                            5 | 6 => header.levels_bytes += self.size()?,
                            7 => header.is_plain = kind == FALSE,
                            _ => self.skip(kind, 1)?,
                        }
                    }
                }
                _ => self.skip(kind, 0)?,
            }
        }
        Ok(header)
    }
}

fn damaged(problem: &'static str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, problem)
}
