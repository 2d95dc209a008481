//! What tests of intervals share.

pub(super) fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} instead of {expected}");
}

/// Share of `Binomial(n, p)` up to and with k, by its sum from the side where it does not begin with nothing.
pub(super) fn binomial_up_to(k: u64, n: u64, p: f64) -> f64 {
    if p > 0.5 {
        return if k >= n { 1.0 } else { 1.0 - binomial_up_to(n - k - 1, n, 1.0 - p) };
    }
    let mut term = (1.0 - p).powi(i32::try_from(n).expect("small"));
    let mut sum = 0.0;
    for i in 0..=k.min(n) {
        sum += term;
        term *= (n - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
    }
    sum
}
