//! Statements of a replay over time: on the closest pair so far, and on the verdict.

use std::collections::BTreeSet;

use super::{Kind, Moment, base64_of, doubles};
use crate::flight_log::FlightLog;
use tautline_audit::{Approach, Slice, Slices};
use tautline_core::swarm::Pair;
use tautline_core::text::{beside_limit, seconds};

/// Number of decimals of a distance.
const DECIMALS: u8 = 3;
/// Index of a vehicle that is not drawn.
const NOT_DRAWN: u16 = u16::MAX;

/// A statement on the closest pair, with the time from which it holds \[s\].
pub(super) type Statement = (f64, String);

/// Wording of statements.
pub(super) struct Words<'a, N> {
    /// Unit of distances.
    pub(super) unit: &'a str,
    /// Limit of all separations; the limit of a pair if it is `None`.
    pub(super) limit: Option<f64>,
    /// Whether distances are unknown at some times.
    pub(super) has_gaps: bool,
    /// Function that returns the name of a vehicle.
    pub(super) name: N,
}

/// Returns the statements on the closest pair so far, at most `most` (at least two). Slices are merged until they fit.
/// Within a slice with a new minimum, the statement is empty until the minimum, or to the end if its time is unknown.
pub(super) fn so_far<N: Fn(usize) -> Option<String>>(
    slices: &Slices,
    words: &Words<'_, N>,
    most: usize,
) -> Vec<Statement> {
    let mut finest = slices.clone().finish(usize::MAX);
    let mut said = words.over(&finest);
    while said.len() > most && finest.len() > 1 {
        finest = slices.clone().finish(finest.len() / 2);
        said = words.over(&finest);
    }
    said
}

impl<N: Fn(usize) -> Option<String>> Words<'_, N> {
    fn over(&self, slices: &[Slice]) -> Vec<Statement> {
        let mut said: Vec<Statement> = Vec::new();
        let mut say = |from_s: f64, words: String| match said.last_mut() {
            Some(last) if last.0 == from_s => last.1 = words,
            _ => said.push((from_s, words)),
        };
        let mut least: Option<Approach> = None;
        for Slice { from_s, to_s, closest, .. } in slices {
            if least.is_some_and(|least| least.certain_m() <= closest.certain_m()) {
                continue;
            }
            if least.is_some() {
                say(*from_s, String::new());
            }
            // A later minimum belongs to a later slice.
            if closest.time_s > *to_s {
                continue;
            }
            say(if closest.is_known() { closest.time_s.max(*from_s) } else { *to_s }, self.so_far(closest));
            least = Some(*closest);
        }
        said
    }

    fn begin(&self) -> &'static str {
        if self.has_gaps { "closest known so far" } else { "closest so far" }
    }

    fn so_far(&self, of: &Approach) -> String {
        let names = of.pair.vehicles().and_then(|pair| Some([(self.name)(pair.first())?, (self.name)(pair.second())?]));
        let who = names.map_or(String::new(), |[first, second]| format!(", {first} and {second}"));
        let bound = if of.is_known() { "" } else { "at least " };
        let shown = beside_limit(of.certain_m(), self.limit.unwrap_or(of.limit_m), DECIMALS);
        format!("{} {bound}{shown} {}{who}", self.begin(), self.unit)
    }
}

/// Returns the times \[s\] from which a pair is the closest, as doubles, and the pairs, as two 16-bit indices each;
/// 65535 is a vehicle that is not drawn. The first pair is that of the log at its first instant.
pub(super) fn pairs(slices: &[Slice], log: &FlightLog, place: impl Fn(usize) -> Option<usize>) -> [String; 2] {
    let place = |vehicle: usize| place(vehicle).and_then(|at| u16::try_from(at).ok()).unwrap_or(NOT_DRAWN);
    let two = |pair: Option<Pair>| pair.map_or([NOT_DRAWN; 2], |two| [place(two.first()), place(two.second())]);
    let [begin_s, end_s] = log.range_s();
    let first = log.at(begin_s).and_then(|frame| frame.nearest).map(|(pair, _)| (begin_s, pair));
    // The first pair replaces a slice of the first instant alone, and begins one of the same pair.
    let slices = &slices[slices.iter().take_while(|slice| first.is_some() && slice.to_s <= begin_s).count()..];
    let first =
        first.filter(|(_, pair)| slices.first().is_none_or(|slice| slice.closest.pair.vehicles() != Some(*pair)));
    let begins = slices.iter().skip(1).map(|slice| slice.from_s).chain([f64::INFINITY]);
    let pairs = slices.iter().zip(begins).flat_map(|(slice, next_s)| {
        let none = (slice.to_s < next_s && slice.to_s < end_s).then_some((slice.to_s.next_up(), [NOT_DRAWN; 2]));
        let from_s = if first.is_some() { slice.from_s.max(begin_s.next_up()) } else { slice.from_s };
        [Some((from_s, two(slice.closest.pair.vehicles()))), none].into_iter().flatten()
    });
    let first = first.map(|(at_s, pair)| (at_s, two(Some(pair))));
    let (from_s, who): (Vec<_>, Vec<_>) = first.into_iter().chain(pairs).unzip();
    [doubles(from_s.into_iter()), base64_of(who.iter().flatten().flat_map(|at| at.to_le_bytes()))]
}

/// Start \[s\], whether a violation is present, the statement, and the index of the violation that it names.
pub(super) type VerdictStatement = (f64, bool, String, Option<usize>);

/// Indices of the present findings, and counts of those that have begun.
#[derive(Default)]
struct State<'a> {
    violations: BTreeSet<usize>,
    undecided: BTreeSet<usize>,
    begun: [usize; 2],
    moments: &'a [Moment],
    is_else_known: bool,
}

/// Returns the statements from `begin_s` on, at most `most` (at least one). `moments` are in order of gravity.
pub(super) fn over_time(moments: &[Moment], is_else_known: bool, begin_s: f64, most: usize) -> Vec<VerdictStatement> {
    // Start of each finding, and the time from which it is over.
    let mut events: Vec<(f64, bool, usize)> = Vec::new();
    for (k, of) in moments.iter().enumerate().filter(|(_, of)| of.kind != Kind::Closest) {
        events.extend([(of.span.from_s.max(begin_s), true, k), (of.span.to_s.max(begin_s).next_up(), false, k)]);
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    let mut state = State { moments, is_else_known, ..State::default() };
    let mut groups: Vec<_> = events.chunk_by(|a, b| a.0 == b.0).collect();
    let mut statements = Vec::new();
    if groups.first().is_none_or(|first| first[0].0 > begin_s) {
        statements.push((begin_s, false, state.statement(), None));
    }
    let together = groups.len().div_ceil(most.max(1)).max(1);
    while !groups.is_empty() {
        let rest = groups.split_off(together.min(groups.len()));
        let (from_s, end_s) = (groups[0][0].0, rest.first().map(|next| next[0].0));
        state.take(groups[0], &mut <[BTreeSet<usize>; 2]>::default());
        let mut seen = [state.violations.clone(), state.undecided.clone()];
        for group in &groups[1..] {
            state.take(group, &mut seen);
        }
        statements.push(match end_s.filter(|_| together > 1) {
            Some(end_s) => state.merged_statement(&seen, from_s, end_s),
            None if together > 1 => state.merged_statement(&seen, from_s, f64::INFINITY),
            None => (from_s, !state.violations.is_empty(), state.statement(), state.violations.first().copied()),
        });
        groups = rest;
    }
    statements
}

impl State<'_> {
    fn take(&mut self, events: &[(f64, bool, usize)], seen: &mut [BTreeSet<usize>; 2]) {
        for &(_, begins, k) in events {
            let kind = usize::from(self.moments[k].kind != Kind::Violation);
            let under_way = if kind == 0 { &mut self.violations } else { &mut self.undecided };
            if begins {
                under_way.insert(k);
                seen[kind].insert(k);
                self.begun[kind] += 1;
            } else {
                under_way.remove(&k);
            }
        }
    }

    fn statement(&self) -> String {
        let begun = match self.begun[0] {
            0 => String::new(),
            1 => "1 violation so far".to_owned(),
            count => format!("{count} violations so far"),
        };
        let open = self.begun[1] > 0 || !self.is_else_known;
        match (self.first_of(&self.violations), self.first_of(&self.undecided)) {
            (Some(violation), _) => format!("violation: {violation}"),
            (None, Some(doubt)) if begun.is_empty() => format!("undecided: {doubt}"),
            (None, Some(doubt)) => format!("{begun}; undecided: {doubt}"),
            (None, None) if begun.is_empty() && open => "undecided so far".to_owned(),
            (None, None) if begun.is_empty() => "no violation so far".to_owned(),
            (None, None) if open => format!("{begun}, some times undecided"),
            (None, None) => begun,
        }
    }

    /// Returns the statement on an interval with more changes than statements.
    fn merged_statement(
        &self,
        [violations, undecided]: &[BTreeSet<usize>; 2],
        from_s: f64,
        to_s: f64,
    ) -> VerdictStatement {
        let to = if to_s.is_finite() { format!(" to {}", seconds(to_s)) } else { " on".to_owned() };
        let around = format!("from {}{to}", seconds(from_s));
        match (self.first_of(violations), self.first_of(undecided)) {
            (Some(violation), _) => (from_s, true, format!("violation {around}: {violation}"), None),
            (None, Some(doubt)) => (from_s, false, format!("undecided {around}: {doubt}"), None),
            (None, None) => (from_s, false, self.statement(), None),
        }
    }

    /// Returns the gravest of some findings in brief, and the number of the others.
    fn first_of(&self, some: &BTreeSet<usize>) -> Option<String> {
        let first = &self.moments[*some.first()?].brief;
        Some(if some.len() > 1 { format!("{first}, and {} more", some.len() - 1) } else { first.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Span;
    use super::*;
    use tautline_audit::ObjectPair;
    use tautline_core::swarm::Pair;

    fn slice(from_s: f64, [lower_m, upper_m]: [f64; 2]) -> Slice {
        let pair = ObjectPair::Vehicles(Pair::new(0, 1));
        let closest = Approach { pair, lower_m, upper_m, time_s: from_s + 0.5, limit_m: 1.0 };
        Slice { from_s, to_s: from_s + 1.0, closest, is_whole: true }
    }

    fn nearest_said(slices: &[Slice], has_gaps: bool) -> Vec<(f64, String)> {
        Words { unit: "m", limit: None, has_gaps, name: |k: usize| Some((k + 1).to_string()) }.over(slices)
    }

    #[test]
    fn the_smallest_separation_is_said_from_its_time_on() {
        let slices = [[4.0; 2], [2.0; 2], [3.0; 2], [1.0; 2]];
        let slices: Vec<_> = slices.into_iter().zip(0..).map(|(of, k)| slice(f64::from(k), of)).collect();
        let so_far = |metres: &str| format!("closest so far {metres} m, 1 and 2");
        let expected = [
            (0.5, so_far("4.000")),
            (1.0, String::new()),
            (1.5, so_far("2.000")),
            (3.0, String::new()),
            (3.5, so_far("1.000")),
        ];
        assert_eq!(nearest_said(&slices, false), expected);
        assert_eq!(nearest_said(&slices[..1], true), [(0.5, "closest known so far 4.000 m, 1 and 2".to_owned())]);
    }

    #[test]
    fn lower_bounds_are_marked() {
        let found = nearest_said(&[slice(0.0, [0.0, 6.0]), slice(1.0, [0.0, 0.0])], false);
        assert_eq!(found, [(1.0, "closest so far at least 0.000 m, 1 and 2".to_owned())]);
        let found = nearest_said(&[slice(0.0, [2.0, f64::INFINITY]), slice(1.0, [1.0, 3.0])], false);
        let expected = [(1.0, String::new()), (2.0, "closest so far at least 1.000 m, 1 and 2".to_owned())];
        assert_eq!(found, expected);
    }

    #[test]
    fn number_of_statements_is_bounded() {
        let mut slices = Slices::new(5000);
        (0..4000).map(f64::from).for_each(|k| slices.take(slice(k, [5000.0 - k; 2])));
        let words = Words { unit: "m", limit: None, has_gaps: false, name: |_| None };
        let said = so_far(&slices, &words, 40);
        assert!(said.len() <= 40 && said.len() > 24, "{}", said.len());
        assert_eq!(said.last(), Some(&(3999.5, "closest so far 1001.000 m".to_owned())));
    }

    fn moment(kind: Kind, from_s: f64, to_s: f64, brief: &str) -> Moment {
        let span = Span { from_s, to_s, at_s: f64::midpoint(from_s, to_s) };
        Moment { kind, vehicles: vec![0], obstacle: None, span, brief: brief.to_owned(), said: String::new() }
    }

    fn said(statements: &[VerdictStatement], time_s: f64) -> (bool, &str) {
        let (_, alarm, said, _) = &statements[statements.partition_point(|statements| statements.0 <= time_s) - 1];
        (*alarm, said)
    }

    #[test]
    fn violations_are_named_while_they_last_and_counted_later() {
        let deep = moment(Kind::Violation, 3.0, 5.0, "a and b");
        let moments = [deep, moment(Kind::Violation, 4.0, 4.0, "c and d"), moment(Kind::Closest, 4.0, 4.0, "e")];
        let statements = over_time(&moments, true, 0.0, 100);
        assert_eq!(said(&statements, 2.9), (false, "no violation so far"));
        assert_eq!(said(&statements, 3.0), (true, "violation: a and b"));
        assert_eq!(said(&statements, 4.0), (true, "violation: a and b, and 1 more"));
        assert_eq!(said(&statements, 5.0), (true, "violation: a and b"));
        assert_eq!(said(&statements, 5.1), (false, "2 violations so far"));
        assert_eq!(
            statements.iter().map(|statements| statements.3).collect::<Vec<_>>(),
            [None, Some(0), Some(0), Some(0), None]
        );
        assert_eq!(over_time(&[], true, 1.0, 100), [(1.0, false, "no violation so far".to_owned(), None)]);
    }

    #[test]
    fn undecided_times_never_read_as_no_violation() {
        let moments = [moment(Kind::Violation, 14.0, 15.0, "a and c"), moment(Kind::Unseen, 3.0, 8.0, "b is not seen")];
        let statements = over_time(&moments, true, 0.0, 100);
        assert_eq!(said(&statements, 2.9), (false, "no violation so far"));
        assert_eq!(said(&statements, 5.0), (false, "undecided: b is not seen"));
        assert_eq!(said(&statements, 10.0), (false, "undecided so far"));
        assert_eq!(said(&statements, 14.5), (true, "violation: a and c"));
        assert_eq!(said(&statements, 16.0), (false, "1 violation so far, some times undecided"));
        assert_eq!(said(&over_time(&moments[..1], false, 0.0, 100), 0.0), (false, "undecided so far"));
        let last = moment(Kind::Undecided, 20.0, 21.0, "too near?");
        let statements = over_time(&[moments[0].clone(), last], true, 0.0, 100);
        assert_eq!(said(&statements, 20.5), (false, "1 violation so far; undecided: too near?"));
    }

    #[test]
    fn merged_statements_never_hide_a_violation() {
        let moments: Vec<_> =
            (0..1000).map(f64::from).map(|k| moment(Kind::Violation, 2.0 * k, 2.0 * k + 0.5, "a and b")).collect();
        let statements = over_time(&moments, true, 0.0, 50);
        assert!(statements.len() <= 51, "{}", statements.len());
        let alarmed = moments.iter().filter(|of| said(&statements, of.span.at_s).0).count();
        assert_eq!(alarmed, 1000);
        assert!(said(&statements, 0.1).1.starts_with("violation from 0.00 s to "), "{statements:?}");
    }
}
