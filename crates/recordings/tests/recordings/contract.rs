//! The contract of a reader, checked by the property tests here and by the fuzz targets in `fuzz/`.

use std::path::Path;

use tautline_core::track::Item;
use tautline_recordings::read::{self, ReadOptions};

/// Limit of the number of items in a file of a few kilobytes.
const MOST_ITEMS: usize = 10_000_000;

/// Reads a recording to its end or to an error.
///
/// # Errors
/// A sentence if the items violate the contract, or if an error has no text or no remedy.
pub(crate) fn read_whole(path: &Path, options: &ReadOptions) -> Result<(), String> {
    let mut items = Vec::new();
    let mut read = || {
        let mut tracks = read::open(path, options)?;
        while items.len() <= MOST_ITEMS && tracks.read(&mut items)? {}
        Ok(tracks.vehicles().len())
    };
    if let Err(error) = read::show_rules(path, options) {
        check_message(&error)?;
    }
    match read() {
        Ok(_) if items.len() > MOST_ITEMS => Err("the items have no end".to_owned()),
        Ok(vehicles) => item_fault(&items, vehicles).map_or(Ok(()), Err),
        Err(error) => check_message(&error),
    }
}

fn check_message(error: &read::ReadError) -> Result<(), String> {
    let (text, help) = (error.to_string(), error.help());
    if text.is_empty() || help.is_empty() {
        Err(format!("an error without a text or remedy: {text:?} {help:?}"))
    } else {
        Ok(())
    }
}

/// Returns the first violation: a number that is not finite, an unknown vehicle, or a time that does not increase.
fn item_fault(items: &[Item], vehicles: usize) -> Option<String> {
    let mut last = vec![f64::NEG_INFINITY; vehicles];
    let mut now = f64::NEG_INFINITY;
    for item in items {
        let (time_s, vehicle) = (item.time_s(), item.vehicle());
        let finite = match item {
            Item::Sample(sample) => sample.position_m.iter().all(|x| x.is_finite()),
            Item::Piece(piece) => {
                piece.to_s > piece.from_s && piece.coefficients.iter().flatten().all(|x| x.is_finite())
            }
        };
        if !finite || !time_s.is_finite() || time_s < now || vehicle >= vehicles || time_s <= last[vehicle] {
            return Some(format!("{item:?} after {now} s"));
        }
        (now, last[vehicle]) = (time_s, time_s);
    }
    None
}
