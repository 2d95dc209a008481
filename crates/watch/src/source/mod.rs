//! Sources of poses: each runs in a thread of its own and sends [`Input`]s through one bounded channel.

mod drops;
mod foxglove;
mod lines;
mod mavlink;
mod naming;
mod rosbridge;
mod websocket;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use nalgebra::Vector3;

use crate::event::{Loss, MessageError};
use crate::monitor::Pose;
use tautline_recordings::read::LivePlan;

pub use foxglove::foxglove;
pub use lines::{LONGEST_LINE, input_of_line, lines};
pub use mavlink::{MavlinkFrame, MavlinkReader, mavlink};
pub use naming::{Naming, NamingOptions};
pub use rosbridge::{inputs_of_message, rosbridge};

/// Number of inputs that wait to be read. Inputs of the network beyond it are dropped and counted.
pub const MOST_WAITING: usize = 1 << 16;
/// First and largest pause before a source connects again.
const PAUSES: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(5)];

/// Pose with its own name.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnedPose {
    /// Stamp \[s\].
    pub t_s: f64,
    /// Name of the vehicle.
    pub id: String,
    /// Position \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity \[m/s\], if known.
    pub velocity_m_s: Option<Vector3<f64>>,
    /// Standard deviation of the position as the source reports it \[m\], if it does.
    pub accuracy_m: Option<f64>,
}

impl OwnedPose {
    /// Returns the pose for the monitor.
    #[must_use]
    pub fn borrowed(&self) -> Pose<'_> {
        let Self { t_s, ref id, position_m, velocity_m_s, accuracy_m } = *self;
        Pose { t_s, id, position_m, velocity_m_s, accuracy_m }
    }
}

/// Plan of a planner in a message of a topic.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanMessage {
    /// Topic.
    pub topic: String,
    /// The plan.
    pub plan: LivePlan,
    /// Arrival since the start of the watch \[s\].
    pub arrival_s: f64,
    /// Arrival on the clock of this machine, since 1970 \[ns\].
    pub arrival_ns: i64,
}

/// Input of a watch.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// A pose, and its arrival since the start of the watch \[s\].
    Pose(OwnedPose, f64),
    /// A plan of a planner.
    Plan(PlanMessage),
    /// The sign-off of a vehicle: its name, its stamp \[s\] and its arrival \[s\].
    SignOff(String, f64, f64),
    /// A message that cannot be read, and its arrival \[s\].
    Garbage(MessageError, f64),
    /// The messages of a name are those of two vehicles: the name, and the arrival \[s\].
    TwoStreams(String, f64),
    /// A source is connected.
    Connected(String),
    /// A source is lost; it connects again.
    Lost(String, Loss),
    /// The source has ended.
    End,
}

/// Sending end of the channel of inputs.
#[derive(Clone, Debug)]
pub struct Feed {
    sender: SyncSender<Input>,
    dropped: Arc<AtomicU64>,
    stop: Arc<AtomicBool>,
    start: Instant,
}

/// Receiving end of the channel of inputs.
#[derive(Debug)]
pub struct Inputs {
    pub(crate) receiver: Receiver<Input>,
    pub(crate) dropped: Arc<AtomicU64>,
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) start: Instant,
}

/// Returns both ends of a channel of inputs. Sources end soon after `stop` is set.
#[must_use]
pub fn channel(stop: Arc<AtomicBool>) -> (Feed, Inputs) {
    let (sender, receiver) = sync_channel(MOST_WAITING);
    let (dropped, start) = (Arc::new(AtomicU64::new(0)), Instant::now());
    let feed = Feed { sender, dropped: Arc::clone(&dropped), stop: Arc::clone(&stop), start };
    (feed, Inputs { receiver, dropped, stop, start })
}

impl Feed {
    /// Returns the time since the start of the watch \[s\].
    #[must_use]
    pub fn now_s(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Returns whether the source should end.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Sends an input and waits for room. Returns `false` at the end of the watch.
    #[must_use]
    pub fn send(&self, input: Input) -> bool {
        self.sender.send(input).is_ok()
    }

    /// Sends an input, or drops it if the channel is full. Returns `false` at the end of the watch.
    #[must_use]
    pub fn offer(&self, input: Input) -> bool {
        match self.sender.try_send(input) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                self.dropped.fetch_add(1, Ordering::Relaxed);
                true
            }
            Err(TrySendError::Disconnected(_)) => false,
        }
    }

    /// Counts inputs that were lost before they came to the source.
    fn note_dropped(&self, count: u64) {
        if count > 0 {
            self.dropped.fetch_add(count, Ordering::Relaxed);
        }
    }

    /// Connects and reads again after each loss, with pauses that double. `session` connects, calls its argument when
    /// it is connected, and reads until the loss.
    fn reconnect(&self, name: &str, mut session: impl FnMut(&mut dyn FnMut()) -> Loss) {
        let mut pause = PAUSES[0];
        while !self.is_over() {
            let mut is_connected = false;
            let loss = session(&mut || {
                is_connected = true;
                // At the end of the watch the session notices it, too.
                let _ = self.send(Input::Connected(name.to_owned()));
            });
            if is_connected {
                pause = PAUSES[0];
            }
            if self.is_over() || !self.send(Input::Lost(name.to_owned(), loss)) {
                return;
            }
            let until = Instant::now() + pause;
            while Instant::now() < until && !self.is_over() {
                std::thread::sleep(Duration::from_millis(20));
            }
            pause = (2 * pause).min(PAUSES[1]);
        }
    }
}
