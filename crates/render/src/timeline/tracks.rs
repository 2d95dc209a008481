//! Timeline of recorded motion from any source, audited while it is read.

use std::sync::Arc;

use nalgebra::Vector3;

use super::{Timeline, UNKNOWN_RADIUS_M};
use crate::error::{RenderError, check_lengths};
use tautline_audit::Status;
use tautline_audit::recorded::{Approach, Outcome, RecordedError, Settings, TrackAuditor};
use tautline_core::swarm::{ClosestApproach, Rows, set_row};
use tautline_core::track::{Item, Piece, Tracks};
use tautline_report::flight_log::{BUDGET_BYTES, FlightLog, PICTURED, Violations};

/// Rate of keyframes at which recorded curves are drawn \[Hz\].
const CURVE_HZ: f64 = 30.0;
/// Number of items that are read before the audit starts: usual intervals are learnt from them.
const OPENING: usize = 65_536;
/// Largest number of keyframes over the number of samples of the vehicle with the most samples.
const MAX_SHARED: usize = 2;

/// Error of recorded motion.
#[derive(Debug, thiserror::Error)]
pub enum TracksError<E> {
    /// The recording cannot be read.
    #[error("{0}")]
    Read(E),
    /// The recording can be read but not drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// Recorded motion of one vehicle.
#[derive(Default)]
struct VehicleTrack {
    samples: Vec<(f64, Vector3<f64>)>,
    pieces: Vec<Piece>,
    radius_m: Option<f64>,
}

impl Timeline {
    /// Reads recorded motion. Vehicles with different sample times are interpolated linearly to common times; a vehicle
    /// before its first or after its last sample is absent. Closest approaches, and violations of `delta_m` \[m\], come
    /// from [`TrackAuditor`](tautline_audit::recorded::TrackAuditor). Motion that it refuses is drawn without a
    /// verdict.
    ///
    /// The result may have no keyframes.
    ///
    /// # Errors
    /// [`TracksError`] if the recording cannot be read, or a vehicle is beyond [`FARTHEST_M`](crate::FARTHEST_M).
    pub fn from_tracks<T: Tracks + ?Sized>(
        name: &str,
        recording: &mut T,
        delta_m: Option<f64>,
    ) -> Result<Self, TracksError<T::Error>> {
        let settings = Settings::delta(delta_m.unwrap_or(NO_DELTA_M));
        let mut audit = TrackAuditor::new(settings).map(TrackAuditor::with_smallest);
        let tracks = read(recording, &mut audit)?;
        let mut timeline = Self::new(name, tracks.len());
        timeline.delta_m = delta_m;
        timeline.vehicles = (0..tracks.len()).map(|k| vehicle(recording, k)).collect();
        timeline.radius_m = tracks.iter().map(|track| track.radius_m.unwrap_or(UNKNOWN_RADIUS_M)).collect();
        if tracks.iter().any(|track| track.radius_m.is_none()) {
            timeline.notes.push(format!("vehicles of unknown radius are drawn with {UNKNOWN_RADIUS_M} m"));
        }
        timeline.by_radii = !tracks.is_empty() && tracks.iter().all(|track| track.radius_m.is_some());
        timeline.assumes_straight = tracks.iter().any(|track| !track.samples.is_empty());
        let mut places = vec![0; tracks.len()];
        let (judged, mut log) = (audit.and_then(TrackAuditor::finish), FlightLog::default());
        for time_s in common_times(&tracks, &moments_s(&judged)) {
            let mut positions_m = Rows::zeros(tracks.len());
            for (k, track) in tracks.iter().enumerate() {
                let position_m = track.at(time_s, &mut places[k]);
                // Curves may exceed the limit between times at which they do not.
                check_lengths(position_m.iter(), "coordinate", time_s, || timeline.vehicles[k].clone())?;
                set_row(&mut positions_m, k, position_m);
            }
            log.take_positions(time_s, positions_m);
        }
        timeline.take_outcome(&mut log, judged);
        timeline.log = Arc::new(log);
        timeline.notes.extend_from_slice(recording.notes());
        Ok(timeline)
    }
}

/// Reads all motion, by vehicle. Refused motion is drawn and labelled as not judged.
fn read<T: Tracks + ?Sized>(
    recording: &mut T,
    audit: &mut Result<TrackAuditor, RecordedError>,
) -> Result<Vec<VehicleTrack>, TracksError<T::Error>> {
    let (mut tracks, mut items): (Vec<VehicleTrack>, _) = (Vec::new(), Vec::new());
    let (mut more, mut first) = (true, true);
    while more {
        while more && (items.is_empty() || first && items.len() < OPENING) {
            more = recording.read(&mut items).map_err(TracksError::Read)?;
        }
        first = false;
        if let Ok(auditor) = audit
            && let Err(refused) = auditor.push(recording.vehicles(), &items)
        {
            *audit = Err(refused);
        }
        for item in items.drain(..) {
            let k = item.vehicle();
            if tracks.len() <= k {
                tracks.resize_with(k + 1, VehicleTrack::default);
            }
            match item {
                Item::Sample(sample) => {
                    let name = || vehicle(recording, k);
                    check_lengths(sample.position_m.iter(), "coordinate", sample.time_s, name)?;
                    check_lengths(&sample.radius_m, "radius", sample.time_s, name)?;
                    tracks[k].radius_m = sample.radius_m.or(tracks[k].radius_m);
                    tracks[k].samples.push((sample.time_s, sample.position_m));
                }
                Item::Piece(piece) => tracks[k].pieces.push(piece),
            }
        }
    }
    Ok(tracks)
}

/// Returns the name of a vehicle, or its number without one.
fn vehicle<T: Tracks + ?Sized>(recording: &T, k: usize) -> String {
    recording.vehicles().get(k).cloned().unwrap_or_else(|| (k + 1).to_string())
}

impl VehicleTrack {
    /// Returns the position at a time, which must not be before that of the last call. `place` is state between calls.
    fn at(&self, time_s: f64, place: &mut usize) -> Vector3<f64> {
        let absent = Vector3::repeat(f64::NAN);
        if self.pieces.is_empty() {
            while self.samples.get(*place + 1).is_some_and(|next| next.0 <= time_s) {
                *place += 1;
            }
            return match (self.samples.get(*place), self.samples.get(*place + 1)) {
                (Some(here), _) if here.0 == time_s => here.1,
                (Some(here), Some(next)) if here.0 < time_s => {
                    here.1 + (next.1 - here.1) * ((time_s - here.0) / (next.0 - here.0))
                }
                _ => absent,
            };
        }
        while self.pieces.get(*place).is_some_and(|piece| piece.to_s < time_s) {
            *place += 1;
        }
        self.pieces.get(*place).filter(|piece| piece.from_s <= time_s).map_or(absent, |piece| {
            let t = time_s - piece.from_s;
            piece.coefficients.iter().rev().fold(Vector3::zeros(), |sum, coefficient| sum * t + coefficient)
        })
    }
}

/// Returns all sample times if they are few, else evenly spaced times and the moments of interest \[s\].
fn common_times(tracks: &[VehicleTrack], moments_s: &[f64]) -> Vec<f64> {
    let mut times: Vec<f64> = Vec::new();
    for track in tracks {
        times.extend(track.samples.iter().map(|sample| sample.0));
        times.extend(track.pieces.iter().flat_map(|piece| [piece.from_s, piece.to_s]));
    }
    times.retain(|time| time.is_finite());
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    let (Some(&first), Some(&last)) = (times.first(), times.last()) else { return times };
    let max_times = BUDGET_BYTES / (tracks.len().max(1) * 6 * size_of::<f64>());
    let has_curves = tracks.iter().any(|track| !track.pieces.is_empty());
    let longest = tracks.iter().map(|track| track.samples.len()).max().unwrap_or(0);
    if !has_curves && times.len() <= max_times && times.len() <= MAX_SHARED * longest {
        return times;
    }
    let wanted = if has_curves { (last - first) * CURVE_HZ } else { longest as f64 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded by both")]
    let steps = wanted.ceil().clamp(1.0, max_times.max(2) as f64) as usize;
    let even = (0..=steps).map(|k| first + (last - first) * (k as f64 / steps as f64));
    let mut times: Vec<f64> =
        even.chain(moments_s.iter().copied().filter(|moment_s| (first..=last).contains(moment_s))).collect();
    times.sort_unstable_by(f64::total_cmp);
    times.dedup();
    times
}

/// Safety distance of a recording that is drawn without limits \[m\]; only the closest approach is used.
const NO_DELTA_M: f64 = 1e-9;

/// Returns the times of the closest approach, and of the smallest separations of the first violations \[s\].
fn moments_s(judged: &Result<Outcome, RecordedError>) -> Vec<f64> {
    let worst = |outcome: &Outcome| outcome.violations.iter().take(PICTURED).map(|found| found.min_at_s).collect();
    let mut moments: Vec<f64> = judged.as_ref().map_or_else(|_| Vec::new(), worst);
    moments.extend(judged.iter().filter_map(|outcome| outcome.closest.first()).map(|closest| closest.time_s));
    moments
}

impl Timeline {
    /// Adds the outcome of the audit to a log.
    fn take_outcome(&mut self, log: &mut FlightLog, judged: Result<Outcome, RecordedError>) {
        let outcome = match judged {
            Ok(outcome) => outcome,
            Err(refused) => {
                self.notes.push(format!("it was not judged: {refused}"));
                self.refused = true;
                return;
            }
        };
        let found = outcome.smallest.iter().map(|slice| &slice.closest).chain(outcome.closest.first());
        let mut closest: Vec<_> = found.filter_map(approach).collect();
        closest.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let is_judged = self.delta_m.is_some() || self.by_radii;
        let violations = outcome.violations.into_iter().filter(|found| is_judged && found.pair.vehicles().is_some());
        log.judge(closest, Violations::judged(violations.collect()));
        if is_judged {
            self.status = Some(outcome.status);
            let undecided = outcome.undecided.iter().map(|undecided| undecided.from_s);
            let open_s = undecided.chain(outcome.gaps.iter().map(|gap| gap.from_s)).reduce(f64::min);
            let open_s = open_s.or((outcome.status == Status::Undecided).then_some(f64::NEG_INFINITY));
            self.undecided_s = open_s.filter(|_| outcome.status != Status::Clear);
        }
    }
}

fn approach(found: &Approach) -> Option<ClosestApproach> {
    let (pair, separation_m, time_s) = (found.pair.vehicles()?, found.certain_m(), found.time_s);
    Some(ClosestApproach { pair, separation_m, time_s })
}
