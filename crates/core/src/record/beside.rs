//! A recorder in a thread of its own.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread;

use super::{Event, OwnedSample, RecordError, Sample, Sink};

/// Samples and events that wait for the recorder, at most: beyond, the flight waits.
const WAITING: usize = 2;

/// What is handed over.
enum Said {
    Sample(Box<OwnedSample>),
    Event(Event),
}

/// Hands over copies of what it is given.
struct Beside {
    to_recorder: SyncSender<Said>,
    /// Samples that have been recorded, to be written over.
    recorded: Receiver<Box<OwnedSample>>,
}

/// Runs `fly` with a sink that records in a thread beside it, in the same order and with the same bits. Ends of steps that are
/// not recorded are not looked at: a recorder whose [`Sink::step`] does something is to be called in the flight's own thread.
/// Memory is taken for three samples, once.
///
/// # Errors
/// The first error of the recorder, which the flight meets at something that it hands over later, or at its end.
pub fn record_beside<T, E: From<RecordError>>(
    sink: &mut (dyn Sink + Send),
    fly: impl FnOnce(&mut dyn Sink) -> Result<T, E>,
) -> Result<T, E> {
    let (to_recorder, said) = sync_channel(WAITING);
    let (back, recorded) = channel();
    thread::scope(|scope| {
        let recorder = scope.spawn(move || record(sink, &said, &back));
        let flown = fly(&mut Beside { to_recorder, recorded });
        match recorder.join() {
            Ok(written) => written.map_err(E::from).and(flown),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

/// Records until nobody says anything more, or something cannot be kept.
fn record(sink: &mut dyn Sink, said: &Receiver<Said>, back: &Sender<Box<OwnedSample>>) -> Result<(), RecordError> {
    for said in said {
        match said {
            Said::Event(event) => sink.event(&event)?,
            Said::Sample(sample) => {
                sink.sample(&sample.as_sample())?;
                // A flight that is over wants no more samples.
                let _ = back.send(sample);
            }
        }
    }
    Ok(())
}

impl Beside {
    fn say(&self, said: Said) -> Result<(), RecordError> {
        // The recorder tells its own error when it is waited for.
        let gone = |_| RecordError::Write {
            path: "the recording".to_owned(),
            source: std::io::Error::other("writing failed before"),
        };
        self.to_recorder.send(said).map_err(gone)
    }
}

impl Sink for Beside {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        let copy = match self.recorded.try_recv() {
            Ok(mut used) => {
                used.copy_from(sample);
                used
            }
            Err(_) => Box::new(OwnedSample::from(sample)),
        };
        self.say(Said::Sample(copy))
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.say(Said::Event(event.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Peaks;
    use crate::swarm::{Rows, Swarm};

    /// Keeps times, and cannot keep the one that it is given.
    #[derive(Default)]
    struct Times(Vec<f64>, Option<f64>);

    impl Times {
        fn keep(&mut self, time_s: f64) -> Result<(), RecordError> {
            if self.1 == Some(time_s) {
                let source = std::io::Error::other("the disk is full");
                return Err(RecordError::Write { path: "run.mcap".to_owned(), source });
            }
            self.0.push(time_s);
            Ok(())
        }
    }

    impl Sink for Times {
        fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
            assert_eq!(sample.swarm.positions_m, Rows::from_element(sample.swarm.count(), sample.time_s));
            self.keep(sample.time_s)
        }

        fn event(&mut self, event: &Event) -> Result<(), RecordError> {
            self.keep(event.time_s())
        }
    }

    /// Samples at whole seconds, of more vehicles from second to second, each followed by an event half a second later.
    fn told(sink: &mut dyn Sink) -> Result<usize, RecordError> {
        for k in 0..20_u32 {
            let (time_s, count) = (f64::from(k), 2 + k as usize / 8);
            let swarm = Swarm::at_rest(Rows::from_element(count, time_s));
            let (swarm, control, peaks) = (&swarm, &Rows::zeros(if k == 9 { 0 } else { count }), Peaks::default());
            let (separation, energy, step) = (None, None, u64::from(k));
            sink.sample(&Sample { time_s, step, swarm, control, separation, energy, peaks, channels: &[] })?;
            sink.event(&Event::LegBegan { leg: 1, time_s: time_s + 0.5 })?;
        }
        Ok(20)
    }

    #[test]
    fn everything_arrives_in_its_order() {
        let mut times = Times::default();
        assert_eq!(record_beside(&mut times, told).expect("recorded"), 20);
        assert_eq!(times.0, (0..40).map(|k| 0.5 * f64::from(k)).collect::<Vec<_>>());
    }

    #[test]
    fn an_error_of_the_recorder_ends_the_flight_and_is_told_even_at_its_very_end() {
        for failing_s in [0.0, 7.5, 19.5] {
            let mut times = Times(Vec::new(), Some(failing_s));
            let error = record_beside(&mut times, told).expect_err("a full disk");
            assert_eq!(error.to_string(), "cannot write run.mcap: the disk is full");
            assert_eq!(times.0.last().map_or(0.0, |last| last + 0.5), failing_s);
        }
    }
}
