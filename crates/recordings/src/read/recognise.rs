//! Which format a file is in, going by its content.

use std::io::Read;
use std::path::Path;
use std::str;

use super::archive::Archive;
use super::error::{Fault, ReadError};
use super::format::Format;
use super::heading;
use super::motive;
use super::objects;
use super::skybrush::SHOW;
use super::source::{GZIP_MAGIC, Source};
use super::stranger;
use super::ulog;
use super::vicon;

/// Bytes that are looked at.
const HEAD_BYTES: u64 = 64 * 1024;

/// How files of a format begin, where all of them do. Other archives begin as NPZ does.
const MAGICS: [(Format, &[u8]); 5] = [
    (Format::Ulog, ulog::MAGIC),
    (Format::Parquet, b"PAR1"),
    (Format::Mcap, b"\x89MCAP0\r\n"),
    (Format::Npz, b"PK\x03\x04"),
    (Format::Npz, b"PK\x05\x06"),
];

/// Keys that a VVIZ show has in front of what may be long.
const VVIZ_KEYS: [&[u8]; 2] = [b"\"defaultPositionRate\"", b"\"agentTraversal\""];

/// Recognises a file, and finds out whether it is packed by gzip.
pub(super) fn recognise(source: &mut Source, forced: Option<Format>) -> Result<Format, ReadError> {
    source.gzip = false;
    let mut head = head_of(source)?;
    source.gzip = head.starts_with(&GZIP_MAGIC);
    if source.gzip {
        head = head_of(source)?;
    }
    let format = match forced {
        Some(format) if MAGICS.iter().any(|(known, _)| *known == format) && by_magic(&head) != Some(format) => {
            return Err(Fault::WrongFormat(format).into());
        }
        Some(format) => format,
        None => format_of(&head)?,
    };
    let packed = source.entry.is_some();
    let unpacks = !matches!(format, Format::Mcap | Format::Crazyflie | Format::Skybrush);
    if (source.gzip || packed) && !unpacks && !(packed && format == Format::Crazyflie) {
        let (within, remedy) = if packed { ("an archive", "unzip") } else { ("gzip", "gunzip") };
        let problem = format!("it is {} inside {within}", format.title());
        return Err(Fault::coded(
            "recording/unsupported-compression",
            problem,
            format!("unpack it first, with {remedy}"),
        )
        .into());
    }
    Ok(format)
}

/// Whether a file is a zip archive that holds neither `NumPy` arrays nor a show.
pub(super) fn is_archive(path: &Path) -> Result<bool, ReadError> {
    let head = head_of(&Source::file(path))?;
    Ok(by_magic(&head) == Some(Format::Npz) && !Archive::open(path)?.names().iter().any(|name| is_recording(name)))
}

/// Whether a file is text with neither a row of numbers nor the name of a column of time: a note beside tables.
pub(super) fn is_prose(source: &Source) -> bool {
    let Ok(head) = head_of(source) else { return false };
    // What is looked at may end within a letter.
    let text = match str::from_utf8(&head) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => str::from_utf8(&head[..error.valid_up_to()]).unwrap_or_default(),
        Err(_) => return false,
    };
    let between = |c: char| c.is_whitespace() || matches!(c, ',' | ';' | '(' | ')' | '#');
    let is_of_a_table = |line: &str| {
        let words: Vec<_> = line.split(between).filter(|word| !word.is_empty()).collect();
        let numbers = words.iter().filter(|word| word.parse::<f64>().is_ok()).count();
        (numbers > 1 && 2 * numbers > words.len()) || words.iter().any(|word| heading::is_clock(word))
    };
    !text.contains('\0') && !text.lines().any(is_of_a_table)
}

fn is_recording(entry: &str) -> bool {
    entry == SHOW || entry.rsplit('.').next() == Some("npy")
}

/// The first bytes, unpacked.
fn head_of(source: &Source) -> Result<Vec<u8>, ReadError> {
    let mut head = Vec::new();
    source.bytes()?.take(HEAD_BYTES).read_to_end(&mut head)?;
    if head.is_empty() { Err(Fault::Empty.into()) } else { Ok(head) }
}

fn by_magic(head: &[u8]) -> Option<Format> {
    MAGICS.iter().find(|(_, magic)| head.starts_with(magic)).map(|(format, _)| *format)
}

fn format_of(head: &[u8]) -> Result<Format, Fault> {
    match by_magic(head) {
        // Entries of NPZ archives end in .npy; a show holds show.json.
        Some(Format::Npz) if memchr::memmem::find(head, b".npy").is_none() => return Ok(Format::Skybrush),
        Some(format) => return Ok(format),
        None => {}
    }
    if head.starts_with(b"\x93NUMPY") {
        let remedy = "save positions together with their times: numpy.savez(\"flight.npz\", t=t, positions=positions)";
        return Err(Fault::coded(
            "recording/no-time-column",
            "it is a single NumPy array, which tells no times",
            remedy,
        ));
    }
    if let Some(stranger) = stranger::of_bytes(head) {
        return Err(stranger);
    }
    if head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff") {
        return Err(Fault::NotUtf8);
    }
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    if memchr::memchr(0, text).is_some() {
        return Err(Fault::UnknownFormat);
    }
    if objects::are_in(text) {
        return Ok(Format::Jsonl);
    }
    if text.starts_with(b"{") {
        let is_vviz = VVIZ_KEYS.iter().any(|key| memchr::memmem::find(text, key).is_some());
        return Ok(if is_vviz { Format::Vviz } else { Format::Skybrush });
    }
    if text.starts_with(motive::BEGIN) {
        return Ok(Format::Motive);
    }
    if vicon::is_export(text) {
        return Ok(Format::Vicon);
    }
    if let Some(stranger) = stranger::of_text(text) {
        return Err(stranger);
    }
    let lines = text.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii);
    let Some(line) = lines.into_iter().find(|line| !line.is_empty() && !line.starts_with(b"#")) else {
        return Ok(Format::Csv);
    };
    let polynomials = b"duration,";
    if line.get(..polynomials.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(polynomials)) {
        return Ok(Format::Crazyflie);
    }
    let has = |byte| memchr::memchr(byte, line).is_some();
    let begins_with_a_number = line.split(u8::is_ascii_whitespace).next().is_some_and(is_number);
    let tuples = begins_with_a_number && has(b'(');
    let csv = (has(b',') && !tuples) || has(b';') || (has(b'\t') && !begins_with_a_number);
    Ok(if csv { Format::Csv } else { Format::Text })
}

fn is_number(bytes: &[u8]) -> bool {
    std::str::from_utf8(bytes).is_ok_and(|text| text.parse::<f64>().is_ok())
}
