//! Why a flight has no replay.

/// Why a flight has no replay.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoReplay {
    /// Nobody is ever there.
    #[error("nothing is there to be drawn")]
    Empty,
    /// A place is too far away for single precision.
    #[error("vehicle {name} is beyond {farthest_m:e} m at {time_s} s")]
    TooFar {
        /// Whose.
        name: String,
        /// When \[s\].
        time_s: f64,
        /// The farthest that is drawn \[m\].
        farthest_m: f64,
    },
    /// Two instants would not fit.
    #[error("it does not fit into {room_bytes} bytes")]
    NoRoom {
        /// The room \[bytes\].
        room_bytes: usize,
    },
}
