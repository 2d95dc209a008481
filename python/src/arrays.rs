//! A recording in borrowed arrays, read one instant after the other.

use numpy::ndarray::{ArrayView1, ArrayView3};
use tautline::read::{ContentKind, Fault, Place, ReadError};
use tautline::track::{Item, Metadata, Plan, Sample, Tracks};

/// Approximate number of items of a batch, small enough for the processor's cache.
const BATCH: usize = 4096;
/// Largest number of vehicles that a note names.
const MOST_NAMED: usize = 8;
/// Error code of a number that is not finite.
const NOT_FINITE: ContentKind = ContentKind::NotFinite;

/// Positions and optional velocities of N vehicles at T instants.
#[derive(Clone)]
pub(crate) struct Arrays<'a> {
    /// T times \[s\].
    pub(crate) times_s: ArrayView1<'a, f64>,
    /// T x N x 3, or T x N x 2 in the plane z = 0 \[m\]; NaN where a vehicle was not seen.
    pub(crate) positions_m: ArrayView3<'a, f64>,
    /// Velocities in the shape of the positions \[m/s\]; NaN where unknown.
    pub(crate) velocities_m_s: Option<ArrayView3<'a, f64>>,
    /// Name of each vehicle.
    pub(crate) names: &'a [String],
    metadata: Metadata,
    /// Number of the next instant.
    at: usize,
}

impl<'a> Arrays<'a> {
    pub(crate) fn new(
        times_s: ArrayView1<'a, f64>,
        positions_m: ArrayView3<'a, f64>,
        velocities_m_s: Option<ArrayView3<'a, f64>>,
        names: &'a [String],
        notes: &[String],
    ) -> Self {
        let is_planar = positions_m.shape()[2] == 2;
        let metadata = Metadata { is_planar, ..Metadata::in_seconds(notes.to_vec()) };
        Self { times_s, positions_m, velocities_m_s, names, metadata, at: 0 }
    }

    /// Appends the samples of the next instant to `items`.
    fn instant(&mut self, items: &mut Vec<Item>) -> Result<(), ReadError> {
        let (k, time_s) = (self.at, self.times_s[self.at]);
        let wrong = |kind, place: String, problem: String, remedy: &str| ReadError {
            file: "arrays".to_owned(),
            place: Some(Place::Part(place)),
            fault: Fault::Content { kind, problem, remedy: remedy.to_owned() },
        };
        if !time_s.is_finite() {
            let problem = format!("it is {time_s}");
            return Err(wrong(NOT_FINITE, format!("t[{k}]"), problem, "remove the instant, or correct its time"));
        }
        if let Some(before_s) = k.checked_sub(1).map(|before| self.times_s[before]).filter(|before| *before >= time_s) {
            let how = if before_s == time_s { "is repeated" } else { "runs backwards" };
            let problem = format!("time {how}: {time_s} s comes after {before_s} s");
            let remedy = "sort the instants by time, and take repeated ones out";
            return Err(wrong(ContentKind::TimeBackwards, format!("t[{k}]"), problem, remedy));
        }
        for vehicle in 0..self.positions_m.shape()[1] {
            let position = vector(&self.positions_m, k, vehicle);
            let velocity = self.velocities_m_s.as_ref().map(|of| vector(of, k, vehicle));
            if position.iter().all(|x| x.is_finite()) {
                let velocity = velocity.filter(|of| !of.iter().all(|x| x.is_nan()));
                if let Some(odd) = velocity.and_then(|of| of.into_iter().find(|x| !x.is_finite())) {
                    let remedy = "give finite velocities, or NaN in every axis of an unknown velocity";
                    let place = format!("velocities[{k}, {vehicle}]");
                    return Err(wrong(NOT_FINITE, place, format!("it holds {odd}"), remedy));
                }
                items.push(Item::Sample(Sample {
                    vehicle,
                    time_s,
                    position_m: position.into(),
                    velocity_m_s: velocity.map(Into::into),
                    radius_m: None,
                }));
            } else if !is_unseen(&self.positions_m, k, vehicle) {
                let odd = position.into_iter().find(|x| !x.is_finite()).unwrap_or_default();
                let remedy = "positions are finite, or NaN in every axis where a vehicle was not seen";
                let place = format!("positions[{k}, {vehicle}]");
                return Err(wrong(NOT_FINITE, place, format!("it holds {odd}"), remedy));
            }
        }
        self.at += 1;
        Ok(())
    }
}

/// Returns the vector of a vehicle at an instant; z is 0 in a plane.
#[inline]
fn vector(of: &ArrayView3<'_, f64>, instant: usize, vehicle: usize) -> [f64; 3] {
    let z = if of.shape()[2] == 3 { of[(instant, vehicle, 2)] } else { 0.0 };
    [of[(instant, vehicle, 0)], of[(instant, vehicle, 1)], z]
}

/// Whether a vector is NaN in every axis.
fn is_unseen(of: &ArrayView3<'_, f64>, instant: usize, vehicle: usize) -> bool {
    (0..of.shape()[2]).all(|axis| of[(instant, vehicle, axis)].is_nan())
}

/// Returns notes on vehicles that are never seen, or not from the first instant to the last.
pub(crate) fn notes_of_absence(positions_m: ArrayView3<'_, f64>, names: &[String]) -> Vec<String> {
    let (instants, vehicles) = (positions_m.shape()[0], positions_m.shape()[1]);
    let is_seen = |instant, vehicle| !is_unseen(&positions_m, instant, vehicle);
    let is_late = |vehicle: &usize| instants > 0 && !(is_seen(0, *vehicle) && is_seen(instants - 1, *vehicle));
    let (there, never): (Vec<_>, Vec<_>) =
        (0..vehicles).filter(is_late).partition(|&vehicle| (0..instants).any(|instant| is_seen(instant, vehicle)));
    let note = |who: &[usize], what: &str| {
        let shown: Vec<_> = who.iter().take(MOST_NAMED).map(|&vehicle| format!("`{}`", names[vehicle])).collect();
        let more = who.len().saturating_sub(MOST_NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        (!who.is_empty()).then(|| format!("{}{more} {what}", shown.join(", ")))
    };
    let never = note(&never, "are NaN at every instant and are not audited");
    let there = note(&there, "are not seen from the first instant to the last; they are audited while present");
    never.into_iter().chain(there).collect()
}

impl Tracks for Arrays<'_> {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        self.names
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        let (from, before) = (self.at, items.len());
        while self.at < self.times_s.len() && items.len() < before + BATCH {
            self.instant(items)?;
        }
        Ok(self.at > from)
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn plans(&self) -> &[Plan] {
        &[]
    }
}
