//! Units of time and their names.

/// Unit of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TimeUnit {
    /// s.
    Seconds,
    /// ms.
    Milliseconds,
    /// us.
    Microseconds,
    /// ns.
    Nanoseconds,
}

impl TimeUnit {
    /// All units, the longest first.
    pub const ALL: [Self; 4] = [Self::Seconds, Self::Milliseconds, Self::Microseconds, Self::Nanoseconds];

    /// Returns the names, the usual one first, and the number of units per second.
    const fn names(self) -> (&'static [&'static str], i64) {
        match self {
            Self::Seconds => (&["s", "sec", "secs", "second", "seconds"], 1),
            Self::Milliseconds => {
                (&["ms", "msec", "msecs", "millis", "millisec", "millisecs", "millisecond", "milliseconds"], 1_000)
            }
            Self::Microseconds => (
                &["us", "µs", "μs", "usec", "usecs", "micros", "microsec", "microsecs", "microsecond", "microseconds"],
                1_000_000,
            ),
            Self::Nanoseconds => {
                (&["ns", "nsec", "nsecs", "nanos", "nanosec", "nanosecs", "nanosecond", "nanoseconds"], 1_000_000_000)
            }
        }
    }

    /// Returns `s`, `ms`, `us` or `ns`.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.names().0[0]
    }

    /// Returns the unit with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|unit| unit.names().0.contains(&name))
    }

    /// Returns the number of units per second.
    pub(super) fn per_second(self) -> i64 {
        self.names().1
    }
}

/// Returns the length of the unit of time with this name \[s\], also of a unit that is longer than a second.
pub(super) fn seconds_of(name: &str) -> Option<f64> {
    match name {
        "min" | "mins" | "minute" | "minutes" => Some(60.0),
        "h" | "hr" | "hrs" | "hour" | "hours" => Some(3600.0),
        "day" | "days" => Some(86_400.0),
        _ => TimeUnit::from_name(name).map(|unit| 1.0 / unit.per_second() as f64),
    }
}
