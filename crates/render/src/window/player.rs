//! Playback: current time, speed, and updates of a live flight.

use std::sync::mpsc::{Receiver, TryRecvError};

use crate::timeline::Timeline;
use tautline_core::record::{Event, OwnedSample};

/// Available speeds.
const SPEEDS: [f64; 10] = [0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
/// Largest number of live updates that are processed per picture.
const MAX_UPDATES: usize = 2000;

/// Update of a live flight.
#[derive(Clone, Debug)]
pub enum LiveUpdate {
    /// Sample.
    Sample(Box<OwnedSample>),
    /// Event.
    Event(Event),
    /// End of the flight, with a message after an error.
    Ended(Option<String>),
}

/// Flight with its playback state.
pub(super) struct Player {
    pub(super) timeline: Timeline,
    live: Option<Receiver<LiveUpdate>>,
    /// Message at the end of the flight.
    pub(super) end_message: Option<String>,
    pub(super) time_s: f64,
    pub(super) playing: bool,
    pub(super) speed: f64,
}

impl Player {
    pub(super) fn new(timeline: Timeline, live: Option<Receiver<LiveUpdate>>) -> Self {
        let time_s = timeline.log.range_s()[0];
        Self { timeline, live, end_message: None, time_s, playing: true, speed: 1.0 }
    }

    /// Returns whether the flight is still in progress.
    pub(super) fn is_live(&self) -> bool {
        self.live.is_some()
    }

    /// Processes live updates; returns whether there were any.
    pub(super) fn receive(&mut self) -> bool {
        let Some(live) = &self.live else { return false };
        for taken in 0..MAX_UPDATES {
            match live.try_recv() {
                Ok(LiveUpdate::Sample(sample)) => {
                    if let Err(error) = self.timeline.take_checked(&sample.as_sample()) {
                        return self.end(Some(error.to_string()));
                    }
                }
                Ok(LiveUpdate::Event(event)) => self.timeline.note(&event),
                Ok(LiveUpdate::Ended(end_message)) => return self.end(end_message),
                Err(TryRecvError::Empty) => return taken > 0,
                Err(TryRecvError::Disconnected) => return self.end(None),
            }
        }
        true
    }

    /// Ends the live mode.
    fn end(&mut self, end_message: Option<String>) -> bool {
        (self.end_message, self.live) = (end_message, None);
        true
    }

    /// Advances the time. Playback stops at the end of a finished flight and waits at the end of a live one.
    pub(super) fn advance(&mut self, seconds: f64) {
        let [first_s, last_s] = self.timeline.log.range_s();
        if self.playing {
            self.time_s += seconds * self.speed;
        }
        if self.time_s >= last_s && !self.is_live() {
            self.playing = false;
        }
        self.time_s = self.time_s.clamp(first_s, last_s.max(first_s));
    }

    /// Plays or pauses; at the end it plays from the start.
    pub(super) fn toggle(&mut self) {
        let [first_s, last_s] = self.timeline.log.range_s();
        if !self.playing && self.time_s >= last_s && !self.is_live() {
            self.time_s = first_s;
        }
        self.playing = !self.playing;
    }

    pub(super) fn seek(&mut self, time_s: f64) {
        let [first_s, last_s] = self.timeline.log.range_s();
        self.time_s = time_s.clamp(first_s, last_s.max(first_s));
    }

    /// Pauses at the worst instant of the next or previous violation.
    pub(super) fn seek_violation(&mut self, is_next: bool) {
        let now_s = self.time_s;
        let worst_s = self.timeline.log.violations().all().iter().map(|found| found.min_at_s);
        let found = if is_next {
            worst_s.filter(|&at_s| at_s > now_s).min_by(f64::total_cmp)
        } else {
            worst_s.filter(|&at_s| at_s < now_s).max_by(f64::total_cmp)
        };
        if let Some(at_s) = found {
            self.playing = false;
            self.seek(at_s);
        }
    }

    /// Steps by a number of samples, forward or back.
    pub(super) fn step(&mut self, samples: isize) {
        self.playing = false;
        let keyframes = self.timeline.log.keyframes();
        let index = keyframes.partition_point(|keyframe| keyframe.time_s <= self.time_s).saturating_sub(1);
        let between = keyframes.get(index).is_some_and(|keyframe| keyframe.time_s < self.time_s);
        // A step back from between two samples goes to the sample before.
        let by = if samples < 0 && between { samples + 1 } else { samples };
        let to = index.saturating_add_signed(by).min(keyframes.len().saturating_sub(1));
        if let Some(keyframe) = keyframes.get(to) {
            self.time_s = keyframe.time_s;
        }
    }

    /// Selects the next higher or lower speed.
    pub(super) fn change_speed(&mut self, up: bool) {
        let next = if up {
            SPEEDS.into_iter().find(|&speed| speed > self.speed)
        } else {
            SPEEDS.into_iter().rev().find(|&speed| speed < self.speed)
        };
        self.speed = next.unwrap_or(self.speed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::{Rows, Swarm};

    fn sample(time_s: f64) -> OwnedSample {
        let swarm = Swarm::at_rest(Rows::zeros(1));
        OwnedSample {
            time_s,
            step: 0,
            swarm,
            control: Rows::zeros(1),
            separation: None,
            energy: None,
            peaks: tautline_core::record::Peaks::default(),
            channels: Vec::new(),
        }
    }

    fn player() -> Player {
        let mut timeline = Timeline::new("one", 1);
        for time_s in [0.0, 1.0, 2.0] {
            timeline.take(&sample(time_s).as_sample());
        }
        Player::new(timeline, None)
    }

    #[test]
    fn playback_stops_at_the_end_and_restarts_from_the_start() {
        let mut player = player();
        player.advance(0.75);
        assert_eq!((player.time_s, player.playing), (0.75, true));
        player.advance(9.0);
        assert_eq!((player.time_s, player.playing), (2.0, false));
        player.toggle();
        assert_eq!((player.time_s, player.playing), (0.0, true));
    }

    #[test]
    fn steps_go_from_sample_to_sample() {
        let mut player = player();
        player.seek(0.5);
        player.step(1);
        assert_eq!(player.time_s, 1.0);
        player.seek(1.5);
        player.step(-1);
        assert_eq!(player.time_s, 1.0);
        player.step(-1);
        player.step(-1);
        assert_eq!((player.time_s, player.playing), (0.0, false));
        player.step(100);
        assert_eq!(player.time_s, 2.0);
    }

    #[test]
    fn violations_are_visited_in_order() {
        let mut player = player();
        for (time_s, to_s) in [(1.2, 1.4), (0.4, 0.6)] {
            player.timeline.note(&Event::ObstacleViolationBegan { vehicle: 0, obstacle: 0, time_s });
            player.timeline.note(&Event::ObstacleViolationEnded { vehicle: 0, obstacle: 0, time_s: to_s, min_m: 0.1 });
        }
        let mut visit = |is_next| {
            player.seek_violation(is_next);
            player.time_s
        };
        let visited = [true, true, true, false, false].map(&mut visit);
        let expected = [0.5, 1.3, 1.3, 0.5, 0.5];
        assert!(visited.iter().zip(expected).all(|(time_s, expected)| (time_s - expected).abs() < 1e-9), "{visited:?}");
    }

    #[test]
    fn a_live_flight_with_too_large_coordinates_is_ended() {
        let (sender, receiver) = std::sync::mpsc::channel();
        let mut player = Player::new(Timeline::new("one", 1), Some(receiver));
        let mut gone = sample(1.0);
        gone.swarm.positions_m[(0, 2)] = -1e10;
        for sample in [sample(0.0), gone] {
            sender.send(LiveUpdate::Sample(Box::new(sample))).expect("sent");
        }
        assert!(player.receive() && !player.is_live());
        assert_eq!(player.timeline.log.range_s(), [0.0, 0.0]);
        let end_message = player.end_message.expect("a message");
        assert!(end_message.starts_with("vehicle 1 has a coordinate of -10000000000.0 m at 1 s"), "{end_message}");
    }

    #[test]
    fn the_speed_changes_and_stays_in_range() {
        let mut player = player();
        player.change_speed(true);
        assert_eq!(player.speed, 2.0);
        (0..20).for_each(|_| player.change_speed(false));
        assert_eq!(player.speed, 0.05);
    }

    #[test]
    fn playback_waits_for_a_live_flight() {
        let (sender, receiver) = std::sync::mpsc::channel();
        let mut player = Player::new(Timeline::new("one", 1), Some(receiver));
        sender.send(LiveUpdate::Sample(Box::new(sample(0.0)))).expect("sent");
        sender.send(LiveUpdate::Sample(Box::new(sample(1.0)))).expect("sent");
        assert!(player.receive());
        player.advance(5.0);
        assert_eq!((player.time_s, player.playing, player.is_live()), (1.0, true, true));
        sender.send(LiveUpdate::Ended(Some("it broke".to_owned()))).expect("sent");
        assert!(player.receive() && !player.is_live());
        assert_eq!(player.end_message.as_deref(), Some("it broke"));
        player.advance(0.1);
        assert!(!player.playing);
    }
}
