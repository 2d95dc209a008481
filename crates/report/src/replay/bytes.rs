//! Numbers as text of a page: their bytes, the least first, as base64.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use nalgebra::Vector3;

/// Doubles.
pub(super) fn doubles(numbers: impl Iterator<Item = f64>) -> String {
    base64_of(numbers.flat_map(f64::to_le_bytes))
}

/// Places in single precision.
#[expect(clippy::cast_possible_truncation, reason = "drawn in single precision")]
pub(super) fn singles(places: &[Vector3<f64>]) -> String {
    let numbers = places.iter().flat_map(|place| place.iter().copied().collect::<Vec<_>>());
    base64_of(numbers.flat_map(|x| (x as f32).to_le_bytes()))
}

pub(super) fn base64_of(bytes: impl Iterator<Item = u8>) -> String {
    BASE64.encode(bytes.collect::<Vec<_>>())
}

/// What so many bytes take.
pub(super) fn base64_bytes(bytes: usize) -> usize {
    4 * bytes.div_ceil(3)
}
