//! Which keys take whole numbers alone.

/// Part of the way between two ends.
const BETWEEN: f64 = 0.381_966;
/// What is next to a whole number is as far from it.
const NEXT: f64 = 1.0 / 1_048_576.0;

/// A value between two ends, which stands for all of them; a whole one where it is to be.
pub(crate) fn between([from, to]: [f64; 2], whole: bool) -> f64 {
    let value = from + (to - from) * BETWEEN;
    if whole { value.round() } else { value }
}

/// Whether a key takes whole numbers alone between two ends: they are whole, and where one of them or one between is taken, what
/// lies next to it is not. What is refused far from there may be so for its size.
pub(crate) fn takes_whole_numbers_alone(ends: [f64; 2], takes: impl Fn(f64) -> bool) -> bool {
    if ends.iter().any(|end| end.fract() != 0.0) {
        return false;
    }
    let whole = [between(ends, true), ends[0], ends[1]].into_iter().find(|&whole| takes(whole));
    whole.is_some_and(|whole| {
        // As near as it is still no whole number.
        let by = (whole.abs() * 2.0 * f64::EPSILON).clamp(NEXT, 0.5);
        !takes(whole - by) && !takes(whole + by)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_are_told_from_others_by_what_lies_next_to_them() {
        let seeds = |value: f64| value.fract() == 0.0 && value >= 0.0;
        for ends in [[0.0, 1.0], [1.0, 1_000_001.0], [1_000_000.0, 0.0], [3.0, 3.0], [-5.0, 20.0], [0.0, 1e12]] {
            assert!(takes_whole_numbers_alone(ends, seeds), "{ends:?}");
        }
        assert!(!takes_whole_numbers_alone([0.5, 2.0], seeds), "an end is no whole number");
        assert!(!takes_whole_numbers_alone([-9.0, -1.0], seeds), "none is taken");
        // Refused at 0.76 for its size, and taken at 1.
        let radii = |value: f64| value >= 0.9;
        assert!(!takes_whole_numbers_alone([0.0, 2.0], radii));
        assert!(!takes_whole_numbers_alone([1.0, 2.0], |value| value >= 1.0), "taken from an end on");
    }
}
