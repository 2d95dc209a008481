//! Arrays in the `.npy` format of `NumPy`: a header in the words of a Python dictionary, then plain numbers.
//!
//! The header is read here because a file may lie about its lengths: memory grows only with bytes that are there, where
//! `npyz` reserves up to 4 GiB that a header claims for itself, and costs a cold build 22 core-seconds and 17 crates.

use std::io::{self, Read};

use super::clock::{Stamp, TimeUnit};
use super::error::Fault;

/// First bytes of an array.
const MAGIC: &[u8; 6] = b"\x93NUMPY";

/// Longest header that is read \[bytes\].
const HEADER_LIMIT_BYTES: usize = 64 * 1024;

/// The `NaT` of `datetime64`.
const NOT_A_TIME: i64 = i64::MIN;

/// What an array holds.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Kind {
    Float,
    Signed,
    Unsigned,
    Bool,
    /// Times in a unit.
    Time(TimeUnit),
    /// Text of four bytes a character.
    Unicode,
    /// Text of one byte a character.
    Bytes,
}

/// An array being read, number by number in the order of the file.
pub(super) struct Array {
    bytes: Box<dyn Read>,
    kind: Kind,
    /// Bytes of an element.
    width: usize,
    big_endian: bool,
    pub(super) fortran_order: bool,
    pub(super) shape: Vec<usize>,
    element: Vec<u8>,
    /// Elements that have not been read.
    left: usize,
}

impl Array {
    /// Reads the header.
    pub(super) fn open(mut bytes: Box<dyn Read>) -> Result<Self, Fault> {
        let mut head = [0; 8];
        read_exactly(&mut bytes, &mut head)?;
        let [magic @ .., major, _] = &head;
        if magic != MAGIC {
            return Err(Fault::damaged("it does not begin as a NumPy array does"));
        }
        let mut length = [0; 4];
        let digits = if *major == 1 { 2 } else { 4 };
        read_exactly(&mut bytes, &mut length[..digits])?;
        let length = u32::from_le_bytes(length) as usize;
        if length > HEADER_LIMIT_BYTES {
            return Err(Fault::damaged(format!("its header claims {length} bytes")));
        }
        let mut header = vec![0; length];
        read_exactly(&mut bytes, &mut header)?;
        let header = String::from_utf8(header).map_err(|_| Fault::damaged("its header is not text"))?;
        let broken = |what: &str| Fault::damaged(format!("its header has no {what}: {}", header.trim()));
        let descr = value(&header, "descr").ok_or_else(|| broken("type"))?;
        let descr = descr.trim_matches(['\'', '"']);
        let (kind, width, big_endian) = kind(descr).ok_or_else(|| {
            let remedy = "save times as float64, int64 or datetime64, and positions as float32 or float64";
            Fault::content(format!("it holds elements of type `{descr}`"), remedy)
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

    /// How many elements there are.
    pub(super) fn count(&self) -> usize {
        self.shape.iter().product()
    }

    /// The unit of an array of times.
    pub(super) fn unit(&self) -> Option<TimeUnit> {
        if let Kind::Time(unit) = self.kind { Some(unit) } else { None }
    }

    fn next_element(&mut self) -> Result<(), Fault> {
        read_exactly(&mut self.bytes, &mut self.element)?;
        self.left = self.left.saturating_sub(1);
        // Behind the last element the checksum is compared.
        if self.left == 0 && self.bytes.read(&mut [0])? > 0 {
            return Err(Fault::damaged("the array is longer than it says"));
        }
        if self.big_endian {
            self.element.reverse();
        }
        Ok(())
    }

    /// The next whole number; none where the array holds others.
    fn integer(&self) -> Option<i64> {
        let mut wide = [0; 8];
        wide[..self.width.min(8)].copy_from_slice(&self.element[..self.width.min(8)]);
        let unsigned = u64::from_le_bytes(wide);
        match self.kind {
            Kind::Unsigned | Kind::Bool => i64::try_from(unsigned).ok(),
            Kind::Signed | Kind::Time(_) => {
                let shift = 64 - 8 * u32::try_from(self.width).ok()?;
                Some((unsigned << shift).cast_signed() >> shift)
            }
            _ => None,
        }
    }

    fn float(&self) -> Option<f64> {
        match (&self.kind, self.width) {
            (Kind::Float, 8) => self.element.first_chunk().copied().map(f64::from_le_bytes),
            (Kind::Float, 4) => self.element.first_chunk().copied().map(|bytes| f32::from_le_bytes(bytes).into()),
            _ => self.integer().map(|integer| integer as f64),
        }
    }

    /// The next element as a number.
    pub(super) fn next_number(&mut self) -> Result<f64, Fault> {
        self.next_element()?;
        self.float().ok_or_else(|| self.not("numbers"))
    }

    /// The next element as a time.
    pub(super) fn next_stamp(&mut self) -> Result<Stamp, Fault> {
        self.next_element()?;
        let stamp = self.integer().map(|whole| self.stamp_of(whole)).or_else(|| self.float().map(Stamp::Real));
        stamp.ok_or_else(|| self.not("times"))
    }

    fn stamp_of(&self, whole: i64) -> Stamp {
        match self.kind {
            Kind::Time(_) if whole == NOT_A_TIME => Stamp::Real(f64::NAN),
            _ => Stamp::Whole(whole),
        }
    }

    /// The next element as text.
    pub(super) fn next_text(&mut self) -> Result<String, Fault> {
        self.next_element()?;
        let text = match self.kind {
            // The whole element was turned around, characters and all: turn the order of characters back.
            Kind::Unicode => {
                let chars = self
                    .element
                    .chunks_exact(4)
                    .map(|bytes| char::from_u32(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])));
                let text: Option<String> = if self.big_endian { chars.rev().collect() } else { chars.collect() };
                text.ok_or_else(|| Fault::damaged("a name is not text"))?
            }
            Kind::Bytes => String::from_utf8(self.element.clone()).map_err(|_| Fault::NotUtf8)?,
            _ => return Err(self.not("names")),
        };
        Ok(text.trim_end_matches('\0').to_owned())
    }

    fn not(&self, what: &str) -> Fault {
        let found = match self.kind {
            Kind::Float => "decimal numbers",
            Kind::Signed | Kind::Unsigned => "whole numbers",
            Kind::Bool => "truth values",
            Kind::Time(_) => "times",
            Kind::Unicode | Kind::Bytes => "text",
        };
        Fault::content(format!("its elements are no {what} but {found}"), "save float64, int64 or text")
    }
}

fn read_exactly(bytes: &mut impl Read, buffer: &mut [u8]) -> Result<(), Fault> {
    match bytes.read_exact(buffer) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => {
            Err(Fault::Truncated { what: "the array is shorter than it says".to_owned() })
        }
        other => Ok(other?),
    }
}

/// The value of a key of a Python dictionary without nested dictionaries.
fn value<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let (_, rest) = header.split_once(&format!("'{key}'"))?;
    let rest = rest.trim_start().strip_prefix(':')?.trim_start();
    let end = if rest.starts_with('(') { rest.find(')')? + 1 } else { rest.find([',', '}'])? };
    rest.get(..end).map(str::trim)
}

/// Kind, width \[bytes\] and byte order of a type like `<f8`, `|b1`, `<M8[ns]` or `<U12`.
fn kind(descr: &str) -> Option<(Kind, usize, bool)> {
    let mut letters = descr.chars();
    let (order, letter) = (letters.next()?, letters.next()?);
    let rest = letters.as_str();
    let (width, unit) = rest.split_once('[').unwrap_or((rest, ""));
    let width: usize = width.parse().ok()?;
    let (kind, width) = match (letter, width) {
        ('f', 4 | 8) => (Kind::Float, width),
        ('i', 1 | 2 | 4 | 8) => (Kind::Signed, width),
        ('u', 1 | 2 | 4 | 8) => (Kind::Unsigned, width),
        ('b', 1) => (Kind::Bool, 1),
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
    fn types_are_read_and_others_refused() {
        assert_eq!(kind("<f8"), Some((Kind::Float, 8, false)));
        assert_eq!(kind(">i4"), Some((Kind::Signed, 4, true)));
        assert_eq!(kind("<M8[ns]"), Some((Kind::Time(TimeUnit::Nanoseconds), 8, false)));
        for other in ["", "<", "O", "|O", "<c16", "<f2", "<M8", "<U99999999", "f8"] {
            assert_eq!(kind(other), None, "{other}");
        }
    }

    #[test]
    fn headers_are_read_in_any_order_of_their_keys() {
        let header = "{'shape': (3, 2, 3), 'fortran_order': False, 'descr': '<f8', }";
        assert_eq!(value(header, "shape"), Some("(3, 2, 3)"));
        assert_eq!(value(header, "fortran_order"), Some("False"));
        assert_eq!(value(header, "descr"), Some("'<f8'"));
        assert_eq!(value(header, "other"), None);
    }
}
