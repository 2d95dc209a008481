//! Which format a file is in, going by its content.

use std::fs;
use std::io::Read;
use std::path::Path;

use super::error::Fault;
use super::format::Format;
use super::source::{GZIP_MAGIC, Source};

/// Bytes that are looked at.
const HEAD_BYTES: u64 = 64 * 1024;

const PARQUET_MAGIC: &[u8] = b"PAR1";
const MCAP_MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// What a file is.
pub(super) struct Recognised {
    pub(super) format: Format,
    /// Whether it is packed by gzip.
    pub(super) gzip: bool,
}

/// Recognises a file or folder.
pub(super) fn recognise(path: &Path, forced: Option<Format>) -> Result<Recognised, Fault> {
    let data = fs::metadata(path)?;
    if data.is_dir() {
        return Ok(Recognised { format: Format::Crazyflie, gzip: false });
    }
    if !data.is_file() {
        let problem = "it is a pipe or a device, and a recording is read more than once";
        return Err(Fault::content(problem, "save it to a file first, and give the file"));
    }
    let mut source = Source { path: path.to_owned(), gzip: false };
    let mut head = head_of(&source)?;
    source.gzip = head.starts_with(&GZIP_MAGIC);
    if source.gzip {
        head = head_of(&source)?;
    }
    let format = match forced {
        Some(format) if first_bytes(format).is_some_and(|bytes| !head.starts_with(bytes)) => {
            let reason = "it does not begin as one does".to_owned();
            return Err(Fault::WrongFormat { format, reason });
        }
        Some(format) => format,
        None => format_of(&head)?,
    };
    if source.gzip && !matches!(format, Format::Csv | Format::Text) {
        let problem = format!("it is {} inside gzip", format.title());
        return Err(Fault::content(problem, "unpack it first, with gunzip"));
    }
    Ok(Recognised { format, gzip: source.gzip })
}

/// The first bytes, unpacked.
fn head_of(source: &Source) -> Result<Vec<u8>, Fault> {
    let mut head = Vec::new();
    source.bytes()?.take(HEAD_BYTES).read_to_end(&mut head)?;
    if head.is_empty() { Err(Fault::Empty) } else { Ok(head) }
}

/// How every file of a format begins, if they all begin alike.
fn first_bytes(format: Format) -> Option<&'static [u8]> {
    match format {
        Format::Parquet => Some(PARQUET_MAGIC),
        Format::Mcap => Some(MCAP_MAGIC),
        Format::Npz => Some(b"PK"),
        Format::Csv | Format::Text | Format::Crazyflie | Format::Skybrush => None,
    }
}

fn format_of(head: &[u8]) -> Result<Format, Fault> {
    if head.starts_with(PARQUET_MAGIC) {
        return Ok(Format::Parquet);
    }
    if head.starts_with(MCAP_MAGIC) {
        return Ok(Format::Mcap);
    }
    if head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06") {
        // Entries of NPZ archives end in .npy; a show holds show.json.
        let arrays = memchr::memmem::find(head, b".npy").is_some();
        return Ok(if arrays { Format::Npz } else { Format::Skybrush });
    }
    if head.starts_with(b"\x93NUMPY") {
        let remedy = "save positions together with their times: numpy.savez(\"flight.npz\", t=t, positions=positions)";
        return Err(Fault::content("it is a single NumPy array, which tells no times", remedy));
    }
    if head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff") {
        return Err(Fault::NotUtf8);
    }
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    if memchr::memchr(0, text).is_some() {
        return Err(Fault::UnknownFormat);
    }
    if text.starts_with(b"{") {
        return Ok(Format::Skybrush);
    }
    let lines = text.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
    let Some(line) = lines.into_iter().find(|line| !line.is_empty() && !line.starts_with(b"#")) else {
        return Ok(Format::Csv);
    };
    if line.starts_with(b"duration,") {
        return Ok(Format::Crazyflie);
    }
    let has = |byte| memchr::memchr(byte, line).is_some();
    let begins_with_a_number = line.split(u8::is_ascii_whitespace).next().is_some_and(is_number);
    let csv = has(b',') || has(b';') || (has(b'\t') && !begins_with_a_number);
    Ok(if csv { Format::Csv } else { Format::Text })
}

fn is_number(bytes: &[u8]) -> bool {
    std::str::from_utf8(bytes).is_ok_and(|text| text.parse::<f64>().is_ok())
}
