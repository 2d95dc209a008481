//! Messages that are lost, one by one or in bursts.

/// Losses of Gilbert and Elliott: a link is good or bad, all messages are lost while it is bad and none while it is good. It
/// turns bad with probability p a message and good with r. The share lost is p/(p + r) and a burst has 1/r messages in the
/// mean; with p + r = 1 each message is lost by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Loss {
    share: f64,
    turns_bad: f64,
    turns_good: f64,
}

impl Loss {
    /// Losses of this share, in bursts of so many messages in the mean, or one by one.
    pub(super) fn new(share: f64, burst: Option<f64>) -> Self {
        let turns_good = burst.map_or(1.0 - share, |burst| if share < 1.0 { 1.0 / burst } else { 0.0 });
        let turns_bad = if share < 1.0 { (turns_good * share / (1.0 - share)).min(1.0) } else { 1.0 };
        Self { share, turns_bad, turns_good }
    }

    /// Whether a message is lost, after what became of the one before it on the same link; `unit` is uniform in \[0, 1).
    pub(super) fn next(&self, before: Option<bool>, unit: f64) -> bool {
        match before {
            None => unit < self.share,
            Some(false) => unit < self.turns_bad,
            Some(true) => unit >= self.turns_good,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::noise::{Noise, Source};

    /// Share lost and mean burst of so many messages on a link.
    fn measured(loss: Loss, messages: u64) -> (f64, f64) {
        // In runs, since each draw begins a block of the generator.
        const RUN: usize = 4096;
        let noise = Noise::new(3, Source::Radio);
        let mut draw = noise.draw(0, 0, 0, RUN);
        let (mut before, mut lost, mut bursts) = (None, 0_u64, 0_u64);
        for number in 0..messages {
            if number.is_multiple_of(RUN as u64) {
                draw = noise.draw(0, 0, number / RUN as u64, RUN);
            }
            let is_lost = loss.next(before, draw.unit());
            bursts += u64::from(is_lost && before != Some(true));
            lost += u64::from(is_lost);
            before = Some(is_lost);
        }
        (lost as f64 / messages as f64, lost as f64 / bursts as f64)
    }

    #[test]
    fn the_share_lost_and_the_mean_burst_are_those_asked_for() {
        for (share, burst) in [(0.02, None), (0.3, None), (0.1, Some(5.0)), (0.5, Some(20.0)), (0.05, Some(1.0))] {
            // Standard errors of both are below 1 %.
            let (lost, length) = measured(Loss::new(share, burst), 1_000_000);
            let expected = burst.unwrap_or(1.0 / (1.0 - share));
            assert!((lost / share - 1.0).abs() < 0.02, "{share} {burst:?}: {lost}");
            assert!((length / expected - 1.0).abs() < 0.02, "{share} {burst:?}: bursts of {length}");
        }
        // Losses in bursts are not those one by one.
        assert!(measured(Loss::new(0.1, None), 100_000).1 < 1.2);
    }

    #[test]
    fn nothing_and_everything_can_be_lost() {
        for burst in [None, Some(3.0)] {
            assert_eq!(measured(Loss::new(1.0, burst), 1000).0, 1.0);
            assert_eq!(measured(Loss::new(0.0, burst), 1000).0, 0.0);
        }
    }
}
