//! The real line folded into the interval from 0 to 1.

/// On either side of a bound so much is bent.
const BENT: f64 = 0.05;

/// A place of the real line as one from 0 to 1: itself but for a twentieth at either bound, where a parabola leads to the bound
/// and back again. A value that falls up to a bound so has its minimum inside, where an optimiser comes to rest
/// (`BoxConstraintsLinQuadTransformation` of Hansen's `pycma`).
pub(super) fn folded(x: f64) -> f64 {
    let width = 1.0 + 2.0 * BENT;
    let along = (x + BENT).rem_euclid(2.0 * width);
    let place = if along > width { 2.0 * width - along } else { along } - BENT;
    let bent = |beyond: f64| beyond * beyond / (4.0 * BENT);
    if place < BENT {
        bent(place + BENT)
    } else if place > 1.0 - BENT {
        1.0 - bent(1.0 + BENT - place)
    } else {
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_is_folded_into_the_interval_without_a_jump() {
        let step = 1e-4;
        let mut before = folded(-7.0);
        for k in 1..140_000_i32 {
            let now = folded(-7.0 + f64::from(k) * step);
            assert!((0.0..=1.0).contains(&now) && (now - before).abs() <= step * (1.0 + 1e-6), "{k}: {before} {now}");
            before = now;
        }
        assert_eq!([0.05, 0.3, 0.5, 0.95].map(folded), [0.05, 0.3, 0.5, 0.95]);
        assert!(folded(-0.05).abs() < 1e-15 && (folded(1.05) - 1.0).abs() < 1e-15);
    }
}
