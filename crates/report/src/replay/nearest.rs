//! The nearest over time, by the judge: what is said of it so far, and who it is at a time.

use super::bytes::{base64_of, doubles};
use tautline_audit::{Approach, Slice, Slices};
use tautline_core::text::{at_least, at_most};

/// Decimals of a distance.
const DECIMALS: u8 = 3;
/// Stands for nobody, or for one who is not drawn.
const NOBODY: u16 = u16::MAX;

/// What is said from a time \[s\] on.
pub(super) type Said = (f64, String);

/// How it is said.
pub(super) struct Words<'a, N> {
    /// What distances are counted in.
    pub(super) unit: &'a str,
    /// Whether something is not known of some of the time.
    pub(super) has_gaps: bool,
    /// The name of a vehicle.
    pub(super) name: N,
}

/// What is said of the nearest so far, no more than so often (at least twice), of as many slices as leave room for that. In a slice
/// in which it came to less, that is what it was at most.
pub(super) fn so_far<N: Fn(usize) -> Option<String>>(slices: &Slices, words: &Words<'_, N>, most: usize) -> Vec<Said> {
    let mut finest = slices.clone().finish(usize::MAX);
    let mut said = words.over(&finest);
    while said.len() > most && finest.len() > 1 {
        finest = slices.clone().finish(finest.len() / 2);
        said = words.over(&finest);
    }
    said
}

impl<N: Fn(usize) -> Option<String>> Words<'_, N> {
    fn over(&self, slices: &[Slice]) -> Vec<Said> {
        let mut said: Vec<Said> = Vec::new();
        let mut say = |from_s: f64, words: String| match said.last_mut() {
            Some(last) if last.0 == from_s => last.1 = words,
            _ => said.push((from_s, words)),
        };
        let mut least: Option<Approach> = None;
        for Slice { from_s, to_s, closest, .. } in slices {
            if least.is_some_and(|least| least.certain_m() <= closest.certain_m()) {
                continue;
            }
            if let Some(before) = least {
                say(*from_s, self.at_most(&before));
            }
            // What comes later is of a later slice.
            if closest.time_s > *to_s {
                continue;
            }
            say(*to_s, self.so_far(closest));
            least = Some(*closest);
        }
        said
    }

    fn begin(&self) -> &'static str {
        if self.has_gaps { "nearest known so far" } else { "nearest so far" }
    }

    fn so_far(&self, of: &Approach) -> String {
        let names = of.pair.vehicles().and_then(|pair| Some([(self.name)(pair.first())?, (self.name)(pair.second())?]));
        let who = names.map_or(String::new(), |[first, second]| format!(", {first} and {second}"));
        let bound = if of.is_known() { "" } else { "at least " };
        format!("{} {bound}{} {}{who}", self.begin(), at_least(of.certain_m(), DECIMALS), self.unit)
    }

    fn at_most(&self, of: &Approach) -> String {
        if of.upper_m.is_finite() {
            format!("{} at most {} {}", self.begin(), at_most(of.upper_m, DECIMALS), self.unit)
        } else {
            String::new()
        }
    }
}

/// From when \[s\] on which two are the nearest, as doubles and as two 16-bit places each; 65535 is nobody.
pub(super) fn pairs(slices: &[Slice], end_s: f64, place: impl Fn(usize) -> Option<usize>) -> [String; 2] {
    let place = |vehicle: usize| place(vehicle).and_then(|at| u16::try_from(at).ok()).unwrap_or(NOBODY);
    let begins = slices.iter().skip(1).map(|slice| slice.from_s).chain([f64::INFINITY]);
    let pairs = slices.iter().zip(begins).flat_map(|(slice, next_s)| {
        let two = slice.closest.pair.vehicles().map_or([NOBODY; 2], |two| [place(two.first()), place(two.second())]);
        let nobody = (slice.to_s < next_s && slice.to_s < end_s).then_some((slice.to_s.next_up(), [NOBODY; 2]));
        [Some((slice.from_s, two)), nobody].into_iter().flatten()
    });
    let (from_s, who): (Vec<_>, Vec<_>) = pairs.unzip();
    [doubles(from_s.into_iter()), base64_of(who.iter().flatten().flat_map(|at| at.to_le_bytes()))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_audit::ObjectPair;
    use tautline_core::swarm::Pair;

    fn slice(from_s: f64, [lower_m, upper_m]: [f64; 2]) -> Slice {
        let pair = ObjectPair::Vehicles(Pair::new(0, 1));
        let closest = Approach { pair, lower_m, upper_m, time_s: from_s + 0.5, limit_m: 1.0 };
        Slice { from_s, to_s: from_s + 1.0, closest, is_whole: true }
    }

    fn said(slices: &[Slice], has_gaps: bool) -> Vec<(f64, String)> {
        Words { unit: "m", has_gaps, name: |k: usize| Some((k + 1).to_string()) }.over(slices)
    }

    #[test]
    fn nothing_is_said_of_a_slice_that_has_not_ended_but_what_it_was_at_most() {
        let slices = [[4.0; 2], [2.0; 2], [3.0; 2], [1.0; 2]];
        let slices: Vec<_> = slices.into_iter().zip(0..).map(|(of, k)| slice(f64::from(k), of)).collect();
        let so_far = |metres: &str| format!("nearest so far {metres} m, 1 and 2");
        let expected = [
            (1.0, "nearest so far at most 4.000 m".to_owned()),
            (2.0, so_far("2.000")),
            (3.0, "nearest so far at most 2.000 m".to_owned()),
            (4.0, so_far("1.000")),
        ];
        assert_eq!(said(&slices, false), expected);
        assert_eq!(said(&slices[..1], true), [(1.0, "nearest known so far 4.000 m, 1 and 2".to_owned())]);
    }

    #[test]
    fn a_bound_is_said_as_one() {
        let found = said(&[slice(0.0, [0.0, 6.0]), slice(1.0, [0.0, 0.0])], false);
        assert_eq!(found, [(1.0, "nearest so far at least 0.000 m, 1 and 2".to_owned())]);
        let found = said(&[slice(0.0, [2.0, f64::INFINITY]), slice(1.0, [1.0, 3.0])], false);
        let expected = [(1.0, String::new()), (2.0, "nearest so far at least 1.000 m, 1 and 2".to_owned())];
        assert_eq!(found, expected);
    }

    #[test]
    fn however_often_it_falls_no_more_is_said_than_there_is_room_for() {
        let mut slices = Slices::new(5000);
        (0..4000).map(f64::from).for_each(|k| slices.take(slice(k, [5000.0 - k; 2])));
        let words = Words { unit: "m", has_gaps: false, name: |_| None };
        let said = so_far(&slices, &words, 40);
        assert!(said.len() <= 40 && said.len() > 24, "{}", said.len());
        assert_eq!(said.last(), Some(&(4000.0, "nearest so far 1001.000 m".to_owned())));
    }
}
