//! Curves as samples.

use nalgebra::Vector3;

use super::error::ExportError;
use crate::read::ReadError;
use tautline_core::track::{Item, Piece, Sample, Tracks};

/// Most samples that are made of the curves of a recording.
const MOST_SAMPLES: f64 = 1e9;

/// Curves in memory, to be looked at in regular intervals.
pub(super) struct Sampled {
    /// The pieces of each vehicle, in order of time.
    pieces: Vec<Vec<Piece>>,
    /// What was recorded as samples, in order of time.
    samples: Vec<Sample>,
    hz: f64,
    from_s: f64,
}

impl Sampled {
    pub(super) fn new(recording: &mut dyn Tracks<Error = ReadError>, hz: f64) -> Result<Self, ExportError> {
        let mut items = Vec::new();
        while recording.read(&mut items)? {}
        let (mut pieces, mut samples) = (Vec::new(), Vec::new());
        pieces.resize_with(recording.vehicles().len(), Vec::new);
        let (mut from_s, mut to_s, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        for item in items {
            match item {
                Item::Sample(sample) => samples.push(sample),
                Item::Piece(piece) => {
                    (from_s, to_s) = (from_s.min(piece.from_s), to_s.max(piece.to_s));
                    count += (piece.to_s - piece.from_s) * hz;
                    pieces[piece.vehicle].push(piece);
                }
            }
        }
        if from_s > to_s {
            return Err(ExportError::NoCurves);
        }
        if !(hz > 0.0 && hz.is_finite() && count <= MOST_SAMPLES) {
            return Err(ExportError::SampleRate(hz));
        }
        Ok(Self { pieces, samples, hz, from_s })
    }

    /// When the curves are looked at \[s\]: in regular intervals, and where the curve of a vehicle ends.
    fn times_s(&self) -> impl Iterator<Item = f64> + '_ {
        let mut ends: Vec<f64> = self.pieces.iter().filter_map(|pieces| Some(pieces.last()?.to_s)).collect();
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        let mut ends = ends.into_iter().peekable();
        let mut regular = (0_u64..).map(|k| self.from_s + k as f64 / self.hz).peekable();
        std::iter::from_fn(move || {
            let end_s = *ends.peek()?;
            let regular_s = regular.next_if(|&time_s| time_s <= end_s);
            if regular_s.is_none_or(|time_s| time_s == end_s) {
                ends.next();
            }
            regular_s.or(Some(end_s))
        })
    }

    /// Calls `take` with the samples of each instant, in order of time.
    pub(super) fn each_instant(
        &self,
        take: &mut impl FnMut(&[Sample]) -> Result<(), ExportError>,
    ) -> Result<(), ExportError> {
        let mut recorded = self.samples.chunk_by(|a, b| a.time_s == b.time_s).peekable();
        let mut current = vec![0; self.pieces.len()];
        let mut instant = Vec::new();
        for time_s in self.times_s() {
            while let Some(before) = recorded.next_if(|samples| samples[0].time_s < time_s) {
                take(before)?;
            }
            instant.clear();
            for (pieces, current) in self.pieces.iter().zip(&mut current) {
                while pieces.get(*current + 1).is_some_and(|next| next.from_s <= time_s) {
                    *current += 1;
                }
                instant.extend(pieces.get(*current).and_then(|piece| sample(piece, time_s)));
            }
            if let Some(same) = recorded.next_if(|samples| samples[0].time_s == time_s) {
                instant.extend_from_slice(same);
            }
            if !instant.is_empty() {
                take(&instant)?;
            }
        }
        recorded.try_for_each(take)
    }
}

/// Position and velocity of a piece; none outside of it.
fn sample(piece: &Piece, time_s: f64) -> Option<Sample> {
    if !(piece.from_s..=piece.to_s).contains(&time_s) {
        return None;
    }
    let dt = time_s - piece.from_s;
    let (mut position_m, mut velocity_m_s) = (Vector3::zeros(), Vector3::zeros());
    for coefficient in piece.coefficients.iter().rev() {
        velocity_m_s = velocity_m_s * dt + position_m;
        position_m = position_m * dt + coefficient;
    }
    let vehicle = piece.vehicle;
    Some(Sample { vehicle, time_s, position_m, velocity_m_s: Some(velocity_m_s), radius_m: None })
}
