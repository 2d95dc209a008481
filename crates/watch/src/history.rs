//! Newest positions of one vehicle, in bounded memory.

use nalgebra::Vector3;

/// Largest number of positions that a vehicle keeps.
pub const HISTORY: usize = 128;

/// Smallest time between two positions of a difference quotient \[s\].
const LEAST_INTERVAL_S: f64 = 1e-6;

/// Position with its stamp.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Fix {
    pub(crate) t_s: f64,
    pub(crate) position_m: Vector3<f64>,
}

/// Ring of the newest positions, in strict order of their stamps.
#[derive(Clone, Debug)]
pub(crate) struct History {
    fixes: Box<[Fix]>,
    /// Index of the oldest position.
    start: usize,
    len: usize,
    /// Whether older positions were dropped.
    is_wrapped: bool,
}

impl History {
    pub(crate) fn new() -> Self {
        Self { fixes: vec![Fix::default(); HISTORY].into(), start: 0, len: 0, is_wrapped: false }
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn is_wrapped(&self) -> bool {
        self.is_wrapped
    }

    /// Returns a position; 0 is the oldest one.
    pub(crate) fn at(&self, k: usize) -> Fix {
        self.fixes[(self.start + k) % HISTORY]
    }

    pub(crate) fn newest(&self) -> Option<Fix> {
        self.len.checked_sub(1).map(|last| self.at(last))
    }

    pub(crate) fn push(&mut self, fix: Fix) {
        if self.len == HISTORY {
            (self.start, self.is_wrapped) = ((self.start + 1) % HISTORY, true);
        } else {
            self.len += 1;
        }
        self.fixes[(self.start + self.len - 1) % HISTORY] = fix;
    }

    pub(crate) fn clear(&mut self) {
        (self.start, self.len, self.is_wrapped) = (0, 0, false);
    }

    /// Returns the newest position at or before a stamp, as an index; 0 if all are later.
    pub(crate) fn up_to(&self, t_s: f64) -> usize {
        (1..self.len).rev().find(|&k| self.at(k).t_s <= t_s).unwrap_or(0)
    }

    /// Returns the velocity at the newest position by a difference quotient, with the bound on its error.
    ///
    /// The error is `2 eps / h + A h / 2` for two positions `h` apart. The positions with the smallest error are used.
    pub(crate) fn velocity(&self, position_error_m: f64, accel_m_s2: f64) -> Option<(Vector3<f64>, f64)> {
        let newest = self.newest()?;
        let error = |h_s: f64| 2.0 * position_error_m / h_s + accel_m_s2 * h_s / 2.0;
        let mut best: Option<(Fix, f64)> = None;
        // The error falls with h up to its only minimum and rises from there.
        for k in (0..self.len - 1).rev() {
            let fix = self.at(k);
            let h_s = newest.t_s - fix.t_s;
            if h_s < LEAST_INTERVAL_S {
                continue;
            }
            let error_m_s = error(h_s);
            match best {
                Some((_, least)) if error_m_s > least => break,
                _ => best = Some((fix, error_m_s)),
            }
        }
        let (fix, error_m_s) = best?;
        Some(((newest.position_m - fix.position_m) / (newest.t_s - fix.t_s), error_m_s))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::{Fix, HISTORY, History};

    #[test]
    fn keeps_the_newest_positions_only() {
        let mut history = History::new();
        for k in 0..3 * HISTORY {
            history.push(Fix { t_s: k as f64, position_m: Vector3::zeros() });
        }
        assert_eq!(history.len(), HISTORY);
        assert!(history.is_wrapped());
        assert_eq!(history.at(0).t_s, (2 * HISTORY) as f64);
        assert_eq!(history.up_to(2.5 * HISTORY as f64), HISTORY / 2);
    }

    #[test]
    fn a_difference_quotient_holds_its_error_bound() {
        let (accel, position_error_m) = (5.0, 0.01);
        let mut history = History::new();
        for k in 0..100 {
            let t_s = 0.01 * f64::from(k);
            // Errors of alternating sign are the worst case.
            let error_m = if k % 2 == 0 { position_error_m } else { -position_error_m };
            history.push(Fix { t_s, position_m: Vector3::x() * (accel * t_s * t_s / 2.0 + error_m) });
        }
        let (velocity, error_m_s) = history.velocity(position_error_m, accel).expect("two positions");
        assert!((velocity.x - accel * 0.99).abs() <= error_m_s, "{velocity} {error_m_s}");
        // sqrt(4 eps A) is the smallest possible bound.
        assert!(error_m_s < 1.01 * (4.0 * position_error_m * accel).sqrt(), "{error_m_s}");
    }
}
