//! Reads arrays in the `.npy` format of `NumPy`: a header in Python dictionary syntax, then raw numbers.
//!
//! The header is parsed here because a file may declare wrong lengths: memory grows only with bytes that exist. The
//! crate `npyz` allocates up to the 4 GiB that a header declares for itself, and costs 22 core-seconds and 17 crates in
//! a cold build.

use std::io;
use std::io::Read;

use super::cells::Cell;
use super::clock::Stamp;
use super::error::{ContentKind, Fault, refuse};
use super::time_unit::TimeUnit;

/// First bytes of an array.
const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// Largest accepted header \[bytes\].
const HEADER_LIMIT_BYTES: usize = 64 * 1024;

/// Value `NaT` of `datetime64`.
const NOT_A_TIME: i64 = i64::MIN;

/// Type of the elements of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Float,
    Signed,
    /// Unsigned integers and booleans.
    Unsigned,
    /// Times as integers of a unit.
    Time(TimeUnit),
    /// Text with four bytes per character.
    Unicode,
    /// Text with one byte per character.
    Bytes,
}

/// Array being read, element by element in the order of the file.
pub(super) struct Array {
    bytes: Box<dyn Read>,
    kind: Kind,
    /// Size of an element \[bytes\].
    width: usize,
    big_endian: bool,
    pub(super) fortran_order: bool,
    pub(super) shape: Vec<usize>,
    element: Vec<u8>,
    /// Number of unread elements.
    left: usize,
}

impl Array {
    /// Opens an array and reads its header.
    pub(super) fn open(mut bytes: Box<dyn Read>) -> Result<Self, Fault> {
        let mut head = [0; 8];
        read_exactly(&mut bytes, &mut head)?;
        let [magic @ .., major, _] = &head;
        if magic != MAGIC {
            return Err(Fault::damaged("it does not begin as a NumPy array"));
        }
        let mut length = [0; 4];
        let digits = if *major == 1 { 2 } else { 4 };
        read_exactly(&mut bytes, &mut length[..digits])?;
        let length = u32::from_le_bytes(length) as usize;
        if length > HEADER_LIMIT_BYTES {
            return Err(Fault::damaged(format!("its header declares {length} bytes")));
        }
        let mut header = vec![0; length];
        read_exactly(&mut bytes, &mut header)?;
        let header = String::from_utf8(header).map_err(|_| Fault::damaged("its header is not text"))?;
        let broken = |what: &str| Fault::damaged(format!("its header has no {what}: {}", header.trim()));
        let descr = value(&header, "descr").ok_or_else(|| broken("type"))?;
        let descr = descr.trim_matches(['\'', '"']);
        let (kind, width, big_endian) = kind(descr).ok_or_else(|| {
            let remedy = "save times as one of float64, int64, datetime64, and positions as one of float32, float64";
            Fault::content(ContentKind::ElementType, format!("it holds elements of type `{descr}`"), remedy)
        })?;
        let fortran_order = value(&header, "fortran_order").ok_or_else(|| broken("order"))? == "True";
        let shape = value(&header, "shape").ok_or_else(|| broken("shape"))?;
        let shape = shape.trim_matches(['(', ')']).split(',').map(str::trim).filter(|text| !text.is_empty());
        let shape: Vec<usize> = shape.map(str::parse).collect::<Result<_, _>>().map_err(|_| broken("shape"))?;
        if shape.iter().try_fold(width, |product, &length| product.checked_mul(length)).is_none() {
            return Err(broken("shape that fits into memory"));
        }
        let left = shape.iter().product();
        Ok(Self { bytes, kind, width, big_endian, fortran_order, shape, element: vec![0; width], left })
    }

    /// Returns the number of elements.
    pub(super) fn count(&self) -> usize {
        self.shape.iter().product()
    }

    /// Returns the unit of an array of times.
    pub(super) fn unit(&self) -> Option<TimeUnit> {
        if let Kind::Time(unit) = self.kind { Some(unit) } else { None }
    }

    fn next(&mut self) -> Result<Cell, Fault> {
        read_exactly(&mut self.bytes, &mut self.element)?;
        self.left = self.left.saturating_sub(1);
        // Reading past the last element verifies the checksum of the archive.
        if self.left == 0 && self.bytes.read(&mut [0])? > 0 {
            return Err(Fault::damaged("the array is longer than its header declares"));
        }
        if self.big_endian {
            self.element.reverse();
        }
        let mut wide = [0; 8];
        let width = self.width.min(8);
        wide[..width].copy_from_slice(&self.element[..width]);
        let bits = u64::from_le_bytes(wide);
        Ok(match self.kind {
            Kind::Float if width == 4 => Cell::Real(f32::from_le_bytes([wide[0], wide[1], wide[2], wide[3]]).into()),
            Kind::Float => Cell::Real(f64::from_bits(bits)),
            Kind::Unsigned => Cell::Whole(bits.into()),
            Kind::Time(_) if bits.cast_signed() == NOT_A_TIME => Cell::Real(f64::NAN),
            Kind::Signed | Kind::Time(_) => {
                let unused = 8 * (8 - width);
                Cell::Whole(((bits << unused).cast_signed() >> unused).into())
            }
            Kind::Unicode => {
                let chars =
                    self.element.chunks_exact(4).map(|c| char::from_u32(u32::from_le_bytes([c[0], c[1], c[2], c[3]])));
                // Reversing the whole element also reversed the order of characters.
                let text: Option<String> = if self.big_endian { chars.rev().collect() } else { chars.collect() };
                Cell::Text(text.ok_or_else(|| Fault::damaged("a name is not text"))?)
            }
            Kind::Bytes => Cell::Text(String::from_utf8(self.element.clone()).map_err(|_| Fault::not_utf8())?),
        })
    }

    /// Returns the next element as a number.
    pub(super) fn next_number(&mut self) -> Result<f64, Fault> {
        let cell = self.next()?;
        if let Cell::Whole(whole) = cell
            && cell.number().is_none()
        {
            let problem = format!("it holds the integer {whole}, which would be rounded");
            return refuse(ContentKind::Overflow, problem, "subtract an offset first");
        }
        cell.number().filter(|_| !matches!(cell, Cell::Text(_))).ok_or_else(|| not("numbers", "text"))
    }

    /// Returns the next element as a time.
    pub(super) fn next_stamp(&mut self) -> Result<Stamp, Fault> {
        let cell = self.next()?;
        cell.stamp().filter(|_| !matches!(cell, Cell::Text(_))).ok_or_else(|| not("times", "text"))
    }

    /// Returns the next element as text.
    pub(super) fn next_text(&mut self) -> Result<String, Fault> {
        match self.next()? {
            Cell::Text(text) => Ok(text.trim_end_matches('\0').to_owned()),
            _ => Err(not("names", "numbers")),
        }
    }
}

fn not(what: &str, found: &str) -> Fault {
    let remedy = "save float64, int64 or text";
    Fault::content(ContentKind::ElementType, format!("its elements are {found}, expected {what}"), remedy)
}

fn read_exactly(bytes: &mut impl Read, buffer: &mut [u8]) -> Result<(), Fault> {
    match bytes.read_exact(buffer) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
            Err(Fault::truncated("the array is shorter than its header declares"))
        }
        other => Ok(other?),
    }
}

/// Returns the value of a key in a Python dictionary without nested dictionaries.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let (_, rest) = header.split_once(&format!("'{key}'"))?;
    let rest = rest.trim_start().strip_prefix(':')?.trim_start();
    let end = if rest.starts_with('(') { rest.find(')')? + 1 } else { rest.find([',', '}'])? };
    rest.get(..end).map(str::trim)
}

/// Parses a type such as `<f8`, `|b1`, `<M8[ns]` or `<U12` into kind, size \[bytes\] and whether it is big-endian.
fn kind(descr: &str) -> Option<(Kind, usize, bool)> {
    let mut letters = descr.chars();
    let (order, letter) = (letters.next()?, letters.next()?);
    let rest = letters.as_str();
    let (width, unit) = rest.split_once('[').unwrap_or((rest, ""));
    let width: usize = width.parse().ok()?;
    let (kind, width) = match (letter, width) {
        ('f', 4 | 8) => (Kind::Float, width),
        ('i', 1 | 2 | 4 | 8) => (Kind::Signed, width),
        ('u', 1 | 2 | 4 | 8) | ('b', 1) => (Kind::Unsigned, width),
        ('M' | 'm', 8) => (Kind::Time(TimeUnit::from_name(unit.trim_end_matches(']'))?), 8),
        ('U', 1..=4096) => (Kind::Unicode, 4 * width),
        ('S', 1..=4096) => (Kind::Bytes, width),
        _ => return None,
    };
    matches!(order, '<' | '>' | '|' | '=').then_some((kind, width, order == '>'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_types_are_parsed_and_others_refused() {
        assert_eq!(kind("<f8"), Some((Kind::Float, 8, false)));
        assert_eq!(kind(">i4"), Some((Kind::Signed, 4, true)));
        assert_eq!(kind("<M8[ns]"), Some((Kind::Time(TimeUnit::Nanoseconds), 8, false)));
        for other in ["", "<", "O", "|O", "<c16", "<f2", "<M8", "<U99999999", "f8"] {
            assert_eq!(kind(other), None, "{other}");
        }
    }

    #[test]
    fn header_keys_are_found_in_any_order() {
        let header = "{'shape': (3, 2, 3), 'fortran_order': False, 'descr': '<f8', }";
        assert_eq!(value(header, "shape"), Some("(3, 2, 3)"));
        assert_eq!(value(header, "fortran_order"), Some("False"));
        assert_eq!(value(header, "descr"), Some("'<f8'"));
        assert_eq!(value(header, "other"), None);
    }
}
