//! Those who came closest in a recording, as figures.

use super::super::{Failure, Monitor};
use super::Open;
use crate::figures::{self, Encounter, Figure};
use crate::report::recorded::interval;
use tautline_audit::Slice;
use tautline_audit::recorded::{Approach, Outcome, PairSeries, PositionLookup, RecordedError, Settings};

/// Pairs, and approaches to obstacles, that are drawn.
const DRAWN: usize = 3;

/// Reads the recording again for those who came closest, and for the places of all.
pub(super) fn figures(
    open: &Open<'_>,
    monitor: &dyn Monitor,
    settings: &Settings,
    outcome: &Outcome,
    places: &mut PositionLookup,
) -> Result<Vec<Figure>, Failure> {
    let follow = |approach: &Approach| Ok((PairSeries::new(settings, outcome, approach.pair)?, *approach));
    let closest = |of: &[Approach]| of.iter().take(DRAWN).map(follow).collect::<Result<Vec<_>, RecordedError>>();
    let (mut pairs, mut obstacles) = (closest(&outcome.closest)?, closest(&outcome.obstacles)?);
    let mut recording = open()?;
    let (mut items, mut more) = (Vec::new(), true);
    while more {
        if monitor.is_interrupted() {
            return Err(Failure::interrupted());
        }
        items.clear();
        more = recording.read(&mut items)?;
        places.push(&items)?;
        for (series, _) in pairs.iter_mut().chain(&mut obstacles) {
            series.push(&items)?;
        }
    }
    let drawn = |followed: Vec<(PairSeries, Approach)>| -> Vec<Encounter> {
        followed.into_iter().map(|(series, approach)| encounter(series, &approach, settings, outcome)).collect()
    };
    let (pairs, obstacles) = (drawn(pairs), drawn(obstacles));
    let mut drawn = Vec::new();
    if let Some(nearest) = pairs.first() {
        drawn.push(figures::encounters(&pairs, "encounters", "Distances of the closest pairs"));
        drawn.push(figures::closest_approach(nearest, "Closest approach from above"));
        drawn.push(figures::smallest(&over_time(&outcome.smallest), nearest, "Smallest distance of all"));
    }
    if !obstacles.is_empty() {
        drawn.push(figures::encounters(&obstacles, "obstacles", "Distances from the closest obstacles"));
    }
    Ok(drawn)
}

/// When the closest of all was how near, and none where nothing is known of a time in between.
fn over_time(slices: &[Slice]) -> Vec<Option<(f64, f64)>> {
    let ends = std::iter::once(None).chain(slices.iter().map(|slice| Some(slice.known_s()[1])));
    let points = slices.iter().zip(ends).flat_map(|(slice, end_s)| {
        let gap = end_s.is_some_and(|end_s| end_s < slice.known_s()[0]).then_some(None);
        gap.into_iter().chain([Some((slice.closest.time_s, slice.closest.certain_m()))])
    });
    points.collect()
}

/// What a figure shows of two who came close.
fn encounter(series: PairSeries, approach: &Approach, settings: &Settings, outcome: &Outcome) -> Encounter {
    let unit = if settings.ellipsoid_m.is_some() { "ellipsoids" } else { "m" };
    let mut encounter = Encounter {
        names: outcome.names(approach.pair, &settings.obstacles),
        unit,
        distances: Vec::new(),
        paths_m: [Vec::new(), Vec::new()],
        limit_m: approach.limit_m,
        closest_s: approach.time_s,
        closest: format!("{} {unit}", interval(approach.lower_m, approach.upper_m)),
    };
    for sample in series.finish() {
        if sample.unseen_before {
            encounter.distances.push((sample.time_s, f64::NAN, 0.0));
            encounter.paths_m.iter_mut().for_each(|path| path.push((f64::NAN, f64::NAN)));
        }
        encounter.distances.push((sample.time_s, sample.distance_m, sample.deviation_m));
        for (path, at) in encounter.paths_m.iter_mut().zip(sample.positions_m) {
            path.push((at.x, at.y));
        }
    }
    encounter
}
