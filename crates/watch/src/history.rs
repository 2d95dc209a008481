//! Newest positions of one vehicle, in bounded memory.

use nalgebra::Vector3;

/// Largest number of positions that a vehicle keeps.
pub const HISTORY: usize = 128;

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

    /// Returns the place of a late stamp among the stamps.
    pub(crate) fn late(&self, t_s: f64) -> Late {
        let mut late = Late { position_m: None, gap_s: None, least_gap_s: f64::INFINITY };
        for k in 0..self.len {
            let fix = self.at(k);
            if fix.t_s == t_s {
                late.position_m = Some(fix.position_m);
            }
            if k > 0 {
                let before_s = self.at(k - 1).t_s;
                late.least_gap_s = late.least_gap_s.min(fix.t_s - before_s);
                if before_s < t_s && t_s < fix.t_s {
                    late.gap_s = Some(fix.t_s - before_s);
                }
            }
        }
        late
    }
}

/// Place of a late stamp among the stamps of a history.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Late {
    /// Position with the same stamp \[m\].
    pub(crate) position_m: Option<Vector3<f64>>,
    /// Distance of the stamps before and after it \[s\].
    pub(crate) gap_s: Option<f64>,
    /// Smallest distance of two successive stamps \[s\].
    pub(crate) least_gap_s: f64,
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::{Fix, HISTORY, History, Late};

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
    fn a_late_stamp_has_its_place_among_the_others() {
        let mut history = History::new();
        for (t_s, x) in [(1.0, 0.0), (1.5, 1.0), (3.0, 2.0)] {
            history.push(Fix { t_s, position_m: Vector3::x() * x });
        }
        let late = |t_s| history.late(t_s);
        assert_eq!(late(1.5), Late { position_m: Some(Vector3::x()), gap_s: None, least_gap_s: 0.5 });
        assert_eq!(late(2.0), Late { position_m: None, gap_s: Some(1.5), least_gap_s: 0.5 });
        assert_eq!(late(0.5).gap_s, None);
    }
}
