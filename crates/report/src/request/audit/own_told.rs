//! What the samples and the events of a recording of `tautline run` say of the time between its samples.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use tautline_audit::recorded::{Told, ToldViolation};
use tautline_core::record::OwnedSample;
use tautline_core::swarm::{ClosestApproach, Pair, row};

/// What a sample says of the time since the one before it; nothing where it names a vehicle that is not there.
pub(super) fn told(
    before: &OwnedSample,
    sample: &OwnedSample,
    mut closest: ClosestApproach,
    (scale, axes_m): (f64, Option<Vector3<f64>>),
) -> Option<Told> {
    closest.separation_m *= scale;
    let (from, to) = (apart(before, closest.pair, axes_m)?, apart(sample, closest.pair, axes_m)?);
    let (from_s, to_s) = (before.time_s, sample.time_s);
    let passed = if to_s > from_s { ((closest.time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0) } else { 1.0 };
    let drawn_m = from.lerp(&to, passed).norm();
    let heights = [height(before, closest.pair), height(sample, closest.pair)];
    Some(Told { from_s, to_s, closest, drawn_m, others_m: 0.0, height_m: around(heights) })
}

/// From the first to the second of a pair \[m\], over the axes of their ellipsoids where these are given.
fn apart(sample: &OwnedSample, pair: Pair, axes_m: Option<Vector3<f64>>) -> Option<Vector3<f64>> {
    let at = &sample.swarm.positions_m;
    let apart_m = (pair.second() < at.nrows()).then(|| row(at, pair.second()) - row(at, pair.first()))?;
    Some(axes_m.map_or(apart_m, |axes_m| apart_m.component_div(&axes_m)))
}

/// How high the higher of a pair is \[m\]; as high as can be where one is not there.
fn height(sample: &OwnedSample, pair: Pair) -> f64 {
    let at = &sample.swarm.positions_m;
    let of = |vehicle: usize| if vehicle < at.nrows() { at[(vehicle, 2)] } else { f64::INFINITY };
    of(pair.first()).max(of(pair.second()))
}

fn around(heights: [f64; 2]) -> [f64; 2] {
    [heights[0].min(heights[1]), heights[0].max(heights[1])]
}

/// Pairs that are too close, as far as a recording has been read.
#[derive(Debug, Default)]
pub(super) struct Near {
    /// Since when \[s\], and how high the higher of the two was at samples since \[m\].
    since: BTreeMap<Pair, (f64, [f64; 2])>,
    /// The closest that they came \[m\] and when \[s\], where that was told.
    closest: BTreeMap<Pair, (f64, f64)>,
    /// Those that ended after the last sample.
    pub(super) ended: Vec<ToldViolation>,
}

impl Near {
    pub(super) fn begin(&mut self, pair: Pair, time_s: f64, before: Option<&OwnedSample>) {
        let height_m = before.map_or([f64::INFINITY, f64::NEG_INFINITY], |sample| [height(sample, pair); 2]);
        self.since.insert(pair, (time_s, height_m));
        self.closest.remove(&pair);
    }

    /// Takes the closest that a pair came \[m\], and when \[s\].
    pub(super) fn approach(&mut self, pair: Pair, closest: (f64, f64)) {
        self.closest.insert(pair, closest);
    }

    pub(super) fn end(&mut self, pair: Pair, to_s: f64, min_m: f64, limit_m: f64, before: Option<&OwnedSample>) {
        if !self.since.contains_key(&pair) {
            self.begin(pair, to_s, before);
        }
        let min_at_s = self.closest.remove(&pair).filter(|(told_m, _)| *told_m == min_m).map(|(_, at_s)| at_s);
        self.ended.extend(self.since.remove(&pair).map(|(from_s, height_m)| ToldViolation {
            pair,
            from_s,
            to_s,
            least_m: min_m,
            min_m,
            min_at_s,
            limit_m,
            height_m,
        }));
    }

    /// Takes a sample, and gives those that ended before it.
    pub(super) fn pass(&mut self, sample: &OwnedSample) -> Vec<ToldViolation> {
        let widen = |pair: Pair, [low_m, high_m]: &mut [f64; 2]| {
            let at_m = height(sample, pair);
            (*low_m, *high_m) = (low_m.min(at_m), high_m.max(at_m));
        };
        self.since.iter_mut().for_each(|(pair, (_, height_m))| widen(*pair, height_m));
        self.ended.iter_mut().for_each(|told| widen(told.pair, &mut told.height_m));
        std::mem::take(&mut self.ended)
    }

    /// Returns the violations that last to the last sample. Where the recording does not tell the smallest distance of a pair, the
    /// smallest distance of all pairs bounds it from below, and the distance at the last sample from above.
    pub(super) fn lasting(
        mut self,
        last: &OwnedSample,
        (limit_m, axes_m): (f64, Option<Vector3<f64>>),
        all: &[Told],
    ) -> Vec<ToldViolation> {
        let told = std::mem::take(&mut self.since).into_iter().filter_map(|(pair, (from_s, height_m))| {
            let to_s = last.time_s;
            if let Some(&(min_m, at_s)) = self.closest.get(&pair).filter(|(min_m, _)| *min_m < limit_m) {
                let (least_m, min_at_s) = (min_m, Some(at_s));
                return Some(ToldViolation { pair, from_s, to_s, least_m, min_m, min_at_s, limit_m, height_m });
            }
            let within = all.iter().filter(|told| told.to_s >= from_s).map(|told| told.closest);
            let least_m = within.clone().map(|of_all| of_all.separation_m).fold(f64::INFINITY, f64::min);
            let own = within.filter(|of_all| of_all.pair == pair && of_all.time_s >= from_s);
            let at_last = (apart(last, pair, axes_m)?.norm(), to_s);
            let known = own.map(|own| (own.separation_m, own.time_s)).chain([at_last]);
            let (min_m, at_s) = known.min_by(|a, b| a.0.total_cmp(&b.0))?;
            let (min_m, min_at_s) = (min_m.min(limit_m.next_down()), Some(at_s));
            Some(ToldViolation { pair, from_s, to_s, least_m: least_m.min(min_m), min_m, min_at_s, limit_m, height_m })
        });
        told.collect()
    }
}
