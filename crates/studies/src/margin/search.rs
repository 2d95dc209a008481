//! Where between two values an answer turns.

/// Between which values a verdict is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The first.
    pub from: f64,
    /// The last.
    pub to: f64,
    /// Values, evenly spaced with both ends, that are looked at first; at least 2.
    pub scan: usize,
    /// Times that the interval in which the verdict turns is halved.
    pub halvings: u32,
    /// Values are spaced and halved by their ratio, and not by their difference.
    pub logarithmic: bool,
}

/// Which values lie between two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Spacing {
    /// By their ratio, and not by their difference.
    logarithmic: bool,
    /// Whole numbers alone.
    whole: bool,
}

/// What a search comes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Found {
    /// The answer is the same at every value that was looked at.
    Even(bool),
    /// The answer turns between two values.
    Turn {
        /// The last with the answer of the range's beginning.
        before: f64,
        /// The first with the other.
        after: f64,
        /// The answer of the range's beginning.
        was: bool,
        /// How often the answer turned among the values that were looked at first.
        turns: usize,
    },
}

impl Spacing {
    /// The place `share` of the way between two values, from 0 to 1.
    fn between(self, from: f64, to: f64, share: f64) -> f64 {
        let place = if self.logarithmic { from * libm::pow(to / from, share) } else { from + (to - from) * share };
        if self.whole { place.round() } else { place }
    }
}

/// Asks at evenly spaced values, then halves the first interval in which the answer turns; at `whole` numbers alone, each of
/// them once, where the ends are whole. An answer that is not given ends the search with what is known then; nothing where that
/// is not the answer at both ends of an interval.
pub(super) fn search<E>(
    range: Range,
    whole: bool,
    ask: &mut dyn FnMut(f64) -> Result<Option<bool>, E>,
) -> Result<Option<Found>, E> {
    let spacing = Spacing { logarithmic: range.logarithmic, whole };
    let values = values(range, spacing);
    let mut scanned: Vec<(f64, bool)> = Vec::with_capacity(values.len());
    for &value in &values {
        match ask(value)? {
            Some(answer) => scanned.push((value, answer)),
            None => break,
        }
    }
    let Some(&(_, was)) = scanned.first() else { return Ok(None) };
    let turns = scanned.windows(2).filter(|pair| pair[0].1 != pair[1].1).count();
    let Some(turn) = scanned.windows(2).find(|pair| pair[0].1 != pair[1].1) else {
        return Ok(Some(Found::Even(was)).filter(|_| scanned.len() == values.len()));
    };
    let (mut before, mut after) = (turn[0].0, turn[1].0);
    for _ in 0..range.halvings {
        let middle = spacing.between(before, after, 0.5);
        // Neighbours have nothing between them.
        if middle == before || middle == after {
            break;
        }
        match ask(middle)? {
            Some(answer) if answer == was => before = middle,
            Some(_) => after = middle,
            None => break,
        }
    }
    Ok(Some(Found::Turn { before, after, was, turns }))
}

/// The values that are looked at first, both ends among them.
fn values(range: Range, spacing: Spacing) -> Vec<f64> {
    let last = range.scan.max(2) - 1;
    let mut values: Vec<f64> = (0..=last)
        .map(|k| match k {
            0 => range.from,
            _ if k == last => range.to,
            _ => spacing.between(range.from, range.to, k as f64 / last as f64),
        })
        .collect();
    values.dedup();
    values
}
