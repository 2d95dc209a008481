//! Reads recordings as a whole.
#![allow(dead_code, reason = "each test uses its part")]

use std::path::Path;

use tautline_core::track::{Clock, Item, Sample};
use tautline_recordings::read::{self, ReadError, ReadOptions};

/// Asserts the code and the place of an error; the place is empty for a file as a whole.
#[track_caller]
pub(crate) fn assert_refused(error: &ReadError, code: &str, place: &str) {
    let found = error.place.as_ref().map(ToString::to_string).unwrap_or_default();
    assert_eq!((error.code(), &*found), (code, place), "{error}");
    assert!(!error.help().is_empty() && !error.is_machine(), "{error}");
}

/// All items and metadata of a recording.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Whole {
    pub(crate) vehicles: Vec<String>,
    pub(crate) items: Vec<Item>,
    pub(crate) clock: Clock,
    pub(crate) notes: Vec<String>,
    /// Facts that are assumptions, as clauses.
    pub(crate) assumed: Option<String>,
}

impl Whole {
    pub(crate) fn read(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let mut tracks = read::open(path, options)?;
        let mut items = Vec::new();
        while tracks.read(&mut items)? {}
        let vehicles = tracks.vehicles().to_vec();
        let (clock, notes) = (tracks.clock().clone(), tracks.notes().to_vec());
        let assumed = tracks.facts().iter().filter(|fact| fact.is_assumption()).map(ToString::to_string);
        let assumed = assumed.reduce(|all, next| all + ", " + &next);
        Ok(Self { vehicles, items, clock, notes, assumed })
    }

    /// Returns the samples as (time, name, position).
    pub(crate) fn samples(&self) -> Vec<(f64, &str, [f64; 3])> {
        self.items
            .iter()
            .map(|item| match item {
                Item::Sample(Sample { vehicle, time_s, position_m, .. }) => {
                    (*time_s, self.vehicles[*vehicle].as_str(), (*position_m).into())
                }
                Item::Piece(piece) => panic!("a piece: {piece:?}"),
            })
            .collect()
    }
}
