//! Clocks of the sources of positions in a foreign recording: whether their messages have stamps, and whether their
//! stamps are of one clock.
//!
//! The delay of a message is its log time minus its stamp. One recorder logs all messages, so the delays of two sources
//! differ by the offset of their clocks and by the difference of their latencies.

use std::collections::BTreeMap;

use super::super::error::{ContentKind, Fault, quoted};
use super::super::options::MessageClock;
use tautline_core::option::CLOCK;

/// Largest difference of the delays of two sources with one clock \[ns\]. Controllers use positions at 10 Hz or faster,
/// so the latency of a position is below 0.1 s.
const LARGEST_DIFFERENCE_NS: i128 = 100_000_000;

/// Largest time by which publishers of transforms date them forward \[ns\].
const LARGEST_FORWARD_NS: i128 = 1_000_000_000;

/// Lengths of the windows of log times in which delays are compared \[ns\]. In a short window the clock of a slow
/// simulation drifts little. A long window has several messages of a slow source. The last one is the whole recording,
/// which compares sources that are never present together.
const WINDOWS_NS: [u64; 3] = [1_000_000_000, 10_000_000_000, u64::MAX];

/// Number of sources, from the first on, with which all others are compared.
const MOST_COMPARED: usize = 64;

/// Source of positions: a topic, or a moving frame of a topic of transforms.
#[derive(Debug, Default)]
struct SourceClock {
    name: String,
    /// Number of messages with and without a stamp.
    stamped: u64,
    unstamped: u64,
    /// Whether a message without a stamp contradicts the stamps of its neighbours.
    is_mixed: bool,
    /// Last message: log time and stamp \[ns\].
    last: Option<(u64, i64)>,
    /// Delays in the current window of each length.
    delays: [Option<Delays>; WINDOWS_NS.len()],
}

/// Delays of the stamped messages of a source in one window \[ns\].
#[derive(Clone, Copy, Debug)]
struct Delays {
    smallest: i128,
    largest: i128,
    count: u64,
}

/// Difference of the smallest delays of two sources, in the window where it exceeds its tolerance most \[ns\].
#[derive(Clone, Copy, Debug)]
struct Difference {
    excess: i128,
    delays: [i128; 2],
}

/// Current window of one length: its number, and the sources with messages in it.
#[derive(Debug, Default)]
struct Window {
    number: u64,
    sources: Vec<usize>,
}

/// Clocks of all sources, by topic and moving frame.
#[derive(Debug, Default)]
pub(super) struct Clocks {
    sources: Vec<SourceClock>,
    /// Index of each source, by topic and frame; the frame is empty unless the topic holds transforms.
    indices: BTreeMap<String, BTreeMap<String, usize>>,
    /// Differences beyond their tolerance, by the source with the larger delay and the other source.
    differences: BTreeMap<(usize, usize), Difference>,
    windows: [Window; WINDOWS_NS.len()],
}

impl Clocks {
    /// Records the log time and the stamp of a message; a stamp of 0 may be a missing one.
    pub(super) fn observe(&mut self, topic: &str, frame: &str, log_ns: u64, stamp_ns: i64) {
        for (length, window_ns) in WINDOWS_NS.into_iter().enumerate() {
            let number = log_ns / window_ns;
            if number != self.windows[length].number {
                self.close_window(length);
                self.windows[length].number = number;
            }
        }
        let index = self.index(topic, frame);
        let source = &mut self.sources[index];
        let delay = i128::from(log_ns) - i128::from(stamp_ns);
        if let Some((last_log_ns, last_stamp_ns)) = source.last.replace((log_ns, stamp_ns))
            && (stamp_ns == 0) != (last_stamp_ns == 0)
        {
            let step = (i128::from(log_ns) - i128::from(last_log_ns)).abs();
            let change = (delay - (i128::from(last_log_ns) - i128::from(last_stamp_ns))).abs();
            source.is_mixed |= change > LARGEST_DIFFERENCE_NS + 2 * step;
        }
        if stamp_ns == 0 {
            source.unstamped += 1;
            return;
        }
        source.stamped += 1;
        for (known, window) in source.delays.iter_mut().zip(&mut self.windows) {
            if let Some(known) = known {
                known.smallest = known.smallest.min(delay);
                known.largest = known.largest.max(delay);
                known.count += 1;
            } else {
                *known = Some(Delays { smallest: delay, largest: delay, count: 1 });
                window.sources.push(index);
            }
        }
    }

    fn index(&mut self, topic: &str, frame: &str) -> usize {
        if let Some(&index) = self.indices.get(topic).and_then(|frames| frames.get(frame)) {
            return index;
        }
        let name = if frame.is_empty() { quoted(topic) } else { format!("{} on {}", quoted(frame), quoted(topic)) };
        self.sources.push(SourceClock { name, ..SourceClock::default() });
        let index = self.sources.len() - 1;
        self.indices.entry(topic.to_owned()).or_default().insert(frame.to_owned(), index);
        index
    }

    /// Compares the delays in the last window of each length.
    pub(super) fn close(&mut self) {
        for length in 0..WINDOWS_NS.len() {
            self.close_window(length);
        }
    }

    /// Compares the delays in the current window of a length.
    fn close_window(&mut self, length: usize) {
        let window = &mut self.windows[length].sources;
        window.sort_unstable();
        let delays = window.drain(..).filter_map(|index| Some((index, self.sources[index].delays[length].take()?)));
        // A single message gives no spread.
        let delays: Vec<_> = delays.filter(|(_, delays)| delays.count > 1).collect();
        for (place, (first, a)) in delays.iter().enumerate().take_while(|(_, (first, _))| *first < MOST_COMPARED) {
            for (second, b) in &delays[place + 1..] {
                let spread = (a.largest - a.smallest) + (b.largest - b.smallest);
                let apart = (a.smallest - b.smallest).abs();
                let excess = apart - LARGEST_DIFFERENCE_NS.max(2 * spread);
                if excess <= 0 {
                    continue;
                }
                let a_is_later = a.smallest > b.smallest;
                let pair = if a_is_later { (*first, *second) } else { (*second, *first) };
                let found = Difference { excess, delays: [a.smallest.max(b.smallest), a.smallest.min(b.smallest)] };
                let known = self.differences.entry(pair).or_insert(found);
                if excess > known.excess {
                    *known = found;
                }
            }
        }
    }

    /// Decides between stamps and log times. `gives` returns, by topic and frame, whether a source gives the positions
    /// of a vehicle; other sources may be dated forward. It returns `None` for an unused source.
    ///
    /// # Errors
    /// If only some of the sources have stamps, or if their stamps are of several clocks.
    pub(super) fn decide(
        &self,
        given: Option<MessageClock>,
        gives: impl Fn(&str, &str) -> Option<bool>,
    ) -> Result<MessageClock, Fault> {
        if let Some(given) = given {
            return Ok(given);
        }
        let (mut used, mut of_vehicles) = (Vec::new(), vec![None; self.sources.len()]);
        for (topic, frames) in &self.indices {
            for (frame, &index) in frames {
                let Some(is_of_vehicle) = gives(topic, frame) else { continue };
                used.push(&self.sources[index]);
                of_vehicles[index] = Some(is_of_vehicle);
            }
        }
        if used.iter().all(|source| source.stamped == 0) {
            return Ok(MessageClock::Log);
        }
        if let Some(source) = used.iter().find(|source| source.is_mixed) {
            let problem =
                format!("{} messages of {} have no stamp, its others have one", source.unstamped, source.name);
            return Err(several_clocks(problem));
        }
        let with = used.iter().find(|source| source.stamped > 0);
        let without = used.iter().find(|source| source.stamped == 0);
        if let Some((with, without)) = with.zip(without) {
            let problem = format!("the messages of {} have stamps, those of {} have none", with.name, without.name);
            return Err(several_clocks(problem));
        }
        let mut apart = self.differences.iter().filter(|((larger, smaller), difference)| {
            let forward_ns =
                of_vehicles[*smaller].map(|is_of_vehicle| if is_of_vehicle { 0 } else { LARGEST_FORWARD_NS });
            of_vehicles[*larger].is_some() && forward_ns.is_some_and(|forward_ns| difference.excess > forward_ns)
        });
        match apart.next() {
            None => Ok(MessageClock::Stamp),
            Some(((a, b), difference)) => {
                let [a, b] = [a, b].map(|index| &self.sources[*index].name);
                let [delay_a, delay_b] = difference.delays.map(|delay| delay as f64 / 1e9);
                let problem = format!(
                    "the stamps are of several clocks: log times are {delay_a:.3} s after the stamps of {a}, but \
                     {delay_b:.3} s after those of {b}"
                );
                Err(several_clocks(problem))
            }
        }
    }
}

fn several_clocks(problem: String) -> Fault {
    let remedy = format!(
        "judge by the times of logging with {}, or confirm that all stamps are of one clock with {}",
        CLOCK.set("log"),
        CLOCK.set("stamp")
    );
    Fault::content(ContentKind::SeveralClocks, problem, remedy)
}
