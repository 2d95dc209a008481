//! How old what was heard is, counted in classes.

/// Least age that is told from none \[s\].
const LEAST_S: f64 = 1e-5;
/// Ratio of the ends of a class: a quantile is known to a hundredth.
const RATIO: f64 = 1.01;
/// Classes, up to an age of 4 weeks.
const CLASSES: usize = 2600;

/// Ages that were counted.
#[derive(Clone, Debug)]
pub(super) struct Ages {
    counts: Vec<u64>,
    total: u64,
}

impl Default for Ages {
    fn default() -> Self {
        Self { counts: vec![0; CLASSES], total: 0 }
    }
}

impl Ages {
    /// Counts an age \[s\].
    pub(super) fn take(&mut self, age_s: f64) {
        let class = (libm::log(age_s.max(LEAST_S) / LEAST_S) / libm::log(RATIO)).ceil();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 0; what is more is cut")]
        let class = (class as usize).min(CLASSES - 1);
        self.counts[class] += 1;
        self.total += 1;
    }

    /// The age that this share of them does not exceed \[s\], to a hundredth; none where none was counted.
    pub(super) fn quantile_s(&self, share: f64) -> Option<f64> {
        let wanted = share * self.total as f64;
        let mut counted = 0;
        let class = self.counts.iter().position(|count| {
            counted += count;
            counted > 0 && counted as f64 >= wanted
        })?;
        #[expect(clippy::cast_precision_loss, reason = "some thousands")]
        let power = class as f64;
        Some(if class == 0 { 0.0 } else { LEAST_S * libm::pow(RATIO, power) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_known_to_a_hundredth() {
        let mut ages = Ages::default();
        assert_eq!(ages.quantile_s(0.95), None);
        (1..=1000).for_each(|k| ages.take(0.001 * f64::from(k)));
        for (share, expected) in [(0.5, 0.5), (0.95, 0.95), (1.0, 1.0)] {
            let found = ages.quantile_s(share).expect("ages");
            assert!((found / expected - 1.0).abs() < 0.0101, "{share}: {found}");
        }
        let mut none = Ages::default();
        (0..20).for_each(|_| none.take(0.0));
        assert_eq!(none.quantile_s(0.95), Some(0.0));
    }
}
