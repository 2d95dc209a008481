//! The verdict in the course of a flight: what is said of it from one time on to the next.

use std::collections::BTreeSet;

use super::moment::{Kind, Moment};
use tautline_core::text::seconds;

/// From when on \[s\], whether there is a violation, what is said, and the place of the violation under way that it is said of.
pub(super) type Told = (f64, bool, String, Option<usize>);

/// What is under way, by place in the list of moments, and what has begun.
#[derive(Default)]
struct State<'a> {
    violations: BTreeSet<usize>,
    undecided: BTreeSet<usize>,
    begun: [usize; 2],
    moments: &'a [Moment],
    is_else_known: bool,
}

/// What is said from the beginning on, no more than so often (at least once), of moments of which the weightiest come first.
pub(super) fn over_time(moments: &[Moment], is_else_known: bool, begin_s: f64, most: usize) -> Vec<Told> {
    // When each begins, and from when on it is over.
    let mut events: Vec<(f64, bool, usize)> = Vec::new();
    for (k, of) in moments.iter().enumerate().filter(|(_, of)| of.kind != Kind::Closest) {
        events.extend([(of.span.from_s.max(begin_s), true, k), (of.span.to_s.max(begin_s).next_up(), false, k)]);
    }
    events.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    let mut state = State { moments, is_else_known, ..State::default() };
    let mut groups: Vec<_> = events.chunk_by(|a, b| a.0 == b.0).collect();
    let mut told = Vec::new();
    if groups.first().is_none_or(|first| first[0].0 > begin_s) {
        told.push((begin_s, false, state.said(), None));
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
        told.push(match end_s.filter(|_| together > 1) {
            Some(end_s) => state.said_of_several(&seen, from_s, end_s),
            None if together > 1 => state.said_of_several(&seen, from_s, f64::INFINITY),
            None => (from_s, !state.violations.is_empty(), state.said(), state.violations.first().copied()),
        });
        groups = rest;
    }
    told
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

    fn said(&self) -> String {
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
            (None, None) if open => format!("{begun}, not all is known"),
            (None, None) => begun,
        }
    }

    /// Of a time in which more changes than can be said one by one.
    fn said_of_several(&self, [violations, undecided]: &[BTreeSet<usize>; 2], from_s: f64, to_s: f64) -> Told {
        let to = if to_s.is_finite() { format!(" to {}", seconds(to_s)) } else { " on".to_owned() };
        let around = format!("from {}{to}", seconds(from_s));
        match (self.first_of(violations), self.first_of(undecided)) {
            (Some(violation), _) => (from_s, true, format!("violation {around}: {violation}"), None),
            (None, Some(doubt)) => (from_s, false, format!("undecided {around}: {doubt}"), None),
            (None, None) => (from_s, false, self.said(), None),
        }
    }

    /// The weightiest of some in short, and how many others there are.
    fn first_of(&self, some: &BTreeSet<usize>) -> Option<String> {
        let first = &self.moments[*some.first()?].brief;
        Some(if some.len() > 1 { format!("{first}, and {} more", some.len() - 1) } else { first.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::super::choice::Span;
    use super::*;

    fn moment(kind: Kind, from_s: f64, to_s: f64, brief: &str) -> Moment {
        let span = Span { from_s, to_s, at_s: f64::midpoint(from_s, to_s) };
        Moment { kind, vehicles: vec![0], obstacle: None, span, brief: brief.to_owned(), said: String::new() }
    }

    fn said(told: &[Told], time_s: f64) -> (bool, &str) {
        let (_, alarm, said, _) = &told[told.partition_point(|told| told.0 <= time_s) - 1];
        (*alarm, said)
    }

    #[test]
    fn a_violation_is_said_while_it_lasts_and_counted_after_it() {
        let deep = moment(Kind::Violation, 3.0, 5.0, "a and b");
        let moments = [deep, moment(Kind::Violation, 4.0, 4.0, "c and d"), moment(Kind::Closest, 4.0, 4.0, "e")];
        let told = over_time(&moments, true, 0.0, 100);
        assert_eq!(said(&told, 2.9), (false, "no violation so far"));
        assert_eq!(said(&told, 3.0), (true, "violation: a and b"));
        assert_eq!(said(&told, 4.0), (true, "violation: a and b, and 1 more"));
        assert_eq!(said(&told, 5.0), (true, "violation: a and b"));
        assert_eq!(said(&told, 5.1), (false, "2 violations so far"));
        assert_eq!(told.iter().map(|told| told.3).collect::<Vec<_>>(), [None, Some(0), Some(0), Some(0), None]);
        assert_eq!(over_time(&[], true, 1.0, 100), [(1.0, false, "no violation so far".to_owned(), None)]);
    }

    #[test]
    fn what_is_not_known_is_said_and_never_that_there_was_no_violation() {
        let moments = [moment(Kind::Violation, 14.0, 15.0, "a and c"), moment(Kind::Unseen, 3.0, 8.0, "b is not seen")];
        let told = over_time(&moments, true, 0.0, 100);
        assert_eq!(said(&told, 2.9), (false, "no violation so far"));
        assert_eq!(said(&told, 5.0), (false, "undecided: b is not seen"));
        assert_eq!(said(&told, 10.0), (false, "undecided so far"));
        assert_eq!(said(&told, 14.5), (true, "violation: a and c"));
        assert_eq!(said(&told, 16.0), (false, "1 violation so far, not all is known"));
        assert_eq!(said(&over_time(&moments[..1], false, 0.0, 100), 0.0), (false, "undecided so far"));
        let last = moment(Kind::Undecided, 20.0, 21.0, "too near?");
        let told = over_time(&[moments[0].clone(), last], true, 0.0, 100);
        assert_eq!(said(&told, 20.5), (false, "1 violation so far; undecided: too near?"));
    }

    #[test]
    fn of_more_than_there_is_room_for_no_time_is_said_to_be_free_of_one_that_has_it() {
        let moments: Vec<_> =
            (0..1000).map(f64::from).map(|k| moment(Kind::Violation, 2.0 * k, 2.0 * k + 0.5, "a and b")).collect();
        let told = over_time(&moments, true, 0.0, 50);
        assert!(told.len() <= 51, "{}", told.len());
        let alarmed = moments.iter().filter(|of| said(&told, of.span.at_s).0).count();
        assert_eq!(alarmed, 1000);
        assert!(said(&told, 0.1).1.starts_with("violation from 0.00 s to "), "{told:?}");
    }
}
