//! Where in a flight the window is, and how it goes on.

use std::sync::mpsc::{Receiver, TryRecvError};

use crate::timeline::Timeline;
use tautline_core::record::{Event, OwnedSample};

/// Speeds that keys go through.
const SPEEDS: [f64; 10] = [0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
/// Most that is taken from a flight in the air before a picture is drawn.
const TAKEN_AT_ONCE: usize = 2000;

/// What a flight in the air sends.
#[derive(Clone, Debug)]
pub enum LiveUpdate {
    /// A sample.
    Sample(Box<OwnedSample>),
    /// An event.
    Event(Event),
    /// The end, with a sentence where something went wrong.
    Ended(Option<String>),
}

/// A flight being watched.
pub(super) struct Player {
    pub(super) timeline: Timeline,
    live: Option<Receiver<LiveUpdate>>,
    /// What the flight said at its end.
    pub(super) said: Option<String>,
    pub(super) time_s: f64,
    pub(super) playing: bool,
    pub(super) speed: f64,
}

impl Player {
    pub(super) fn new(timeline: Timeline, live: Option<Receiver<LiveUpdate>>) -> Self {
        let time_s = timeline.log.range_s()[0];
        Self { timeline, live, said: None, time_s, playing: true, speed: 1.0 }
    }

    /// Whether the flight is still being flown.
    pub(super) fn is_live(&self) -> bool {
        self.live.is_some()
    }

    /// Takes what has been flown; whether there was anything.
    pub(super) fn receive(&mut self) -> bool {
        let Some(live) = &self.live else { return false };
        for taken in 0..TAKEN_AT_ONCE {
            match live.try_recv() {
                Ok(LiveUpdate::Sample(sample)) => {
                    if let Err(error) = self.timeline.take_checked(&sample.as_sample()) {
                        return self.end(Some(error.to_string()));
                    }
                }
                Ok(LiveUpdate::Event(event)) => self.timeline.note(&event),
                Ok(LiveUpdate::Ended(said)) => return self.end(said),
                Err(TryRecvError::Empty) => return taken > 0,
                Err(TryRecvError::Disconnected) => return self.end(None),
            }
        }
        true
    }

    /// Watches the flight no further.
    fn end(&mut self, said: Option<String>) -> bool {
        (self.said, self.live) = (said, None);
        true
    }

    /// Lets time pass; at the end of a flight that has ended it stops, at the end of one in the air it waits.
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

    /// Plays or pauses; from the end it plays again from the start.
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

    /// Goes so many samples on, or back.
    pub(super) fn step(&mut self, samples: isize) {
        self.playing = false;
        let keyframes = self.timeline.log.keyframes();
        let at = keyframes.partition_point(|keyframe| keyframe.time_s <= self.time_s).saturating_sub(1);
        let between = keyframes.get(at).is_some_and(|keyframe| keyframe.time_s < self.time_s);
        // Back from between two samples is the one before.
        let by = if samples < 0 && between { samples + 1 } else { samples };
        let to = at.saturating_add_signed(by).min(keyframes.len().saturating_sub(1));
        if let Some(keyframe) = keyframes.get(to) {
            self.time_s = keyframe.time_s;
        }
    }

    /// The next speed up, or down.
    pub(super) fn faster(&mut self, up: bool) {
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
    fn playing_ends_at_the_end_and_starts_again_from_the_start() {
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
    fn a_flight_in_the_air_that_leaves_all_measure_is_watched_no_further() {
        let (sender, receiver) = std::sync::mpsc::channel();
        let mut player = Player::new(Timeline::new("one", 1), Some(receiver));
        let mut gone = sample(1.0);
        gone.swarm.positions_m[(0, 2)] = -1e10;
        for sample in [sample(0.0), gone] {
            sender.send(LiveUpdate::Sample(Box::new(sample))).expect("sent");
        }
        assert!(player.receive() && !player.is_live());
        assert_eq!(player.timeline.log.range_s(), [0.0, 0.0]);
        let said = player.said.expect("a sentence");
        assert!(said.starts_with("vehicle 1 has a coordinate of -10000000000.0 m at 1 s"), "{said}");
    }

    #[test]
    fn speed_goes_up_and_down_and_stays_in_range() {
        let mut player = player();
        player.faster(true);
        assert_eq!(player.speed, 2.0);
        (0..20).for_each(|_| player.faster(false));
        assert_eq!(player.speed, 0.05);
    }

    #[test]
    fn a_flight_in_the_air_is_waited_for() {
        let (sender, receiver) = std::sync::mpsc::channel();
        let mut player = Player::new(Timeline::new("one", 1), Some(receiver));
        sender.send(LiveUpdate::Sample(Box::new(sample(0.0)))).expect("sent");
        sender.send(LiveUpdate::Sample(Box::new(sample(1.0)))).expect("sent");
        assert!(player.receive());
        player.advance(5.0);
        assert_eq!((player.time_s, player.playing, player.is_live()), (1.0, true, true));
        sender.send(LiveUpdate::Ended(Some("it broke".to_owned()))).expect("sent");
        assert!(player.receive() && !player.is_live());
        assert_eq!(player.said.as_deref(), Some("it broke"));
        player.advance(0.1);
        assert!(!player.playing);
    }
}
