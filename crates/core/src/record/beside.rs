//! Runs a recorder in its own thread.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread;

use super::{Event, OwnedSample, RecordError, Sample, Sink};

/// Capacity of the queue to the recorder thread. The flight waits while the queue is full.
const CAPACITY: usize = 2;

/// Item of the queue to the recorder thread.
enum QueueItem {
    Sample(Box<OwnedSample>),
    Event(Event),
}

/// Sink that sends copies to the recorder thread.
struct QueueSink {
    queue: SyncSender<QueueItem>,
    /// Recorded samples, whose memory is reused.
    recorded: Receiver<Box<OwnedSample>>,
}

/// Runs `fly` with a sink that records in a parallel thread, in the same order and with the same bits.
///
/// Steps that are not recorded are not passed on: call a recorder that implements [`Sink::step`] in the thread of the
/// flight. Allocates three samples once.
///
/// # Errors
/// The first error of the recorder. The flight receives it with a later sample or event, or at its end.
pub fn record_in_thread<T, E: From<RecordError>>(
    sink: &mut (dyn Sink + Send),
    fly: impl FnOnce(&mut dyn Sink) -> Result<T, E>,
) -> Result<T, E> {
    let (queue, queued) = sync_channel(CAPACITY);
    let (back, recorded) = channel();
    thread::scope(|scope| {
        let recorder = scope.spawn(move || record(sink, &queued, &back));
        let flown = fly(&mut QueueSink { queue, recorded });
        match recorder.join() {
            Ok(written) => written.map_err(E::from).and(flown),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

/// Records until the queue is closed or the sink fails.
fn record(
    sink: &mut dyn Sink,
    queued: &Receiver<QueueItem>,
    back: &Sender<Box<OwnedSample>>,
) -> Result<(), RecordError> {
    for item in queued {
        match item {
            QueueItem::Event(event) => sink.event(&event)?,
            QueueItem::Sample(sample) => {
                sink.sample(&sample.as_sample())?;
                // The receiver is gone after the end of the flight.
                let _ = back.send(sample);
            }
        }
    }
    Ok(())
}

impl QueueSink {
    fn send(&self, item: QueueItem) -> Result<(), RecordError> {
        // `record_in_thread` returns the recorder's own error after joining its thread.
        let gone = |_| RecordError::Write {
            path: "the recording".to_owned(),
            source: std::io::Error::other("writing failed before"),
        };
        self.queue.send(item).map_err(gone)
    }
}

impl Sink for QueueSink {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        let copy = match self.recorded.try_recv() {
            Ok(mut used) => {
                used.copy_from(sample);
                used
            }
            Err(_) => Box::new(OwnedSample::from(sample)),
        };
        self.send(QueueItem::Sample(copy))
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.send(QueueItem::Event(event.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Peaks;
    use crate::swarm::{Rows, Swarm};

    /// Sink that collects times; fails at the time in its second field.
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

    /// Sends samples at whole seconds, with a growing number of vehicles, each followed by an event half a second
    /// later.
    fn fly(sink: &mut dyn Sink) -> Result<usize, RecordError> {
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
    fn order_is_preserved() {
        let mut times = Times::default();
        assert_eq!(record_in_thread(&mut times, fly).expect("recorded"), 20);
        assert_eq!(times.0, (0..40).map(|k| 0.5 * f64::from(k)).collect::<Vec<_>>());
    }

    #[test]
    fn recorder_error_ends_the_flight() {
        for failing_s in [0.0, 7.5, 19.5] {
            let mut times = Times(Vec::new(), Some(failing_s));
            let error = record_in_thread(&mut times, fly).expect_err("a full disk");
            assert_eq!(error.to_string(), "cannot write run.mcap: the disk is full");
            assert_eq!(times.0.last().map_or(0.0, |last| last + 0.5), failing_s);
        }
    }
}
