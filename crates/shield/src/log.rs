//! Log of a fleet's contracts, which `proofs/replay` checks against the machine-checked model.
//!
//! The log is text with one event per line, in the order of events. A double is the 16 hexadecimal digits of its bits,
//! so nothing is rounded. Vehicles are counted from 0. `proofs/README.md` lists the lines.
//!
//! The log is written by an observer. After each instant it reads the contracts of a vehicle and compares them with
//! those that it read before. A line `foreign` names a vehicle that holds another plane than its events give. A line
//! `moved` names one that did not fly the segment that it had reserved. A flight without a log does none of this.

use std::fmt::Write as _;
use std::io::{self, Write};

use crate::contract::{Body, Broadcast, Decision, Message, Proposal, divider_of_starts};
use crate::fleet::Fleet;
use crate::plane::{Divider, Plane, Segment};
use crate::shield::Shield;
use crate::start::hash_of_pair;

/// Version of the format.
const VERSION: u32 = 1;
/// Number of bytes that are collected before they are written.
const BUFFER: usize = 1 << 16;

/// Log of the contracts of a fleet, from its start ([`ContractLog::begin`]) to the end of the flight
/// ([`ContractLog::finish`]).
pub struct ContractLog {
    out: Box<dyn Write + Send>,
    /// Lines that are not written yet.
    text: String,
    /// CRC-32 of the lines that are written.
    check: crc32fast::Hasher,
    /// First error of `out`.
    error: Option<io::Error>,
    count: usize,
    /// Planes of each vehicle towards each other one, by vehicle and then by other vehicle.
    known: Vec<Known>,
    /// Segment that each vehicle reserved last.
    reserved: Vec<Segment>,
    totals: LogTotals,
}

/// Numbers of events in a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LogTotals {
    /// Number of lines after the starts.
    pub events: u64,
    /// Number of instants of all vehicles.
    pub instants: u64,
    /// Number of messages sent.
    pub sent: u64,
    /// Number of messages received.
    pub heard: u64,
}

/// State of a contract after the last event.
#[derive(Clone, Copy, Debug)]
struct Known {
    held: Divider,
    /// Pending proposal of an owner.
    pending: Option<Proposal>,
    /// Number of the last decision of a follower.
    decided: u32,
}

/// Contract of a vehicle with another one, as the vehicle holds it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ContractView {
    /// As the owner: its planes and the last decision that it heard.
    Owner { held: Plane, pending: Option<Proposal>, heard: Decision },
    /// As the follower: its plane, the last proposal that it heard, and its last decision.
    Follower { held: Plane, heard: Proposal, decided: Decision },
}

impl ContractLog {
    /// Returns a log that is written to `out`.
    #[must_use]
    pub fn new(out: Box<dyn Write + Send>) -> Self {
        let (text, totals) = (String::with_capacity(2 * BUFFER), LogTotals::default());
        let check = crc32fast::Hasher::new();
        Self { out, text, check, error: None, count: 0, known: Vec::new(), reserved: Vec::new(), totals }
    }

    /// Begins the log with the starts and first planes of a fleet at its start.
    pub fn begin(&mut self, fleet: &Fleet) {
        let starts = fleet.shields().first().map_or(&[][..], Shield::starts);
        self.count = starts.len();
        let vertical = starts.first().map_or(1.0, |start| start.metric.vertical());
        self.line(format_args!("tautline contract log {VERSION}"));
        self.line(format_args!("vertical {}", Bits([vertical])));
        for (i, start) in starts.iter().enumerate() {
            let numbers = Bits([start.margin_m, start.delta_m]);
            self.line(format_args!("start {i} {numbers} {}", Bits(numbers_of(&start.segment))));
        }
        for (i, owner) in starts.iter().enumerate() {
            for (j, follower) in starts.iter().enumerate().skip(i + 1) {
                // A fleet has a plane for each pair.
                let Some(divider) = divider_of_starts(owner, follower) else { continue };
                let hash = hash_of_pair(owner, follower);
                self.line(format_args!("pair {i} {j} {hash:016x} {}", Bits(plane_numbers(&divider))));
            }
        }
        self.reserved = starts.iter().map(|start| start.segment).collect();
        self.known.clear();
        for i in 0..starts.len() {
            for j in 0..starts.len() {
                let (owner, follower) = (i.min(j), i.max(j));
                let first = if i == j { None } else { divider_of_starts(&starts[owner], &starts[follower]) };
                let held = first.unwrap_or(Divider { normal: [0.0; 3], offset_m: 0.0 });
                self.known.push(Known { held, pending: None, decided: 0 });
            }
        }
    }

    /// Notes a message that arrived at its receiver.
    pub fn heard(&mut self, message: &Message) {
        self.totals.heard += 1;
        self.event(format_args!("hear {} {} {}", message.to, message.from, Content(message)));
    }

    /// Notes the instant of a vehicle after [`Shield::filter`]: its period, the changes of its planes, and the segment
    /// that it reserves.
    pub fn filtered(&mut self, shield: &Shield) {
        let i = shield.index();
        self.totals.instants += 1;
        self.event(format_args!("instant {i} {}", shield.period()));
        if self.reserved.get(i) != Some(&shield.present_segment()) {
            self.event(format_args!("moved {i}"));
        }
        for j in (0..self.count).filter(|j| *j != i) {
            if let Some(view) = shield.contract_with(j) {
                self.compare(shield, [i, j], view);
            }
        }
        self.event(format_args!("reserve {i} {}", Bits(numbers_of(&shield.segment()))));
        self.reserved[i] = shield.segment();
    }

    /// Notes messages that a vehicle sent, lost or not.
    pub fn sent(&mut self, broadcast: &Broadcast) {
        for message in broadcast.messages() {
            self.totals.sent += 1;
            self.event(format_args!("send {} {} {}", message.from, message.to, Content(&message)));
        }
    }

    /// Ends the log with the planes that each vehicle holds, the numbers of events, and the CRC-32 of all lines before.
    ///
    /// # Errors
    /// The first error of a write.
    pub fn finish(&mut self) -> io::Result<LogTotals> {
        for i in 0..self.count {
            for j in (0..self.count).filter(|j| *j != i) {
                let Known { held, pending, .. } = self.known[i * self.count + j];
                let held = Bits(plane_numbers(&held));
                match pending {
                    Some(Proposal { divider, .. }) => {
                        self.event(format_args!("hold {i} {j} {held} {}", Bits(plane_numbers(&divider))));
                    }
                    None => self.event(format_args!("hold {i} {j} {held}")),
                }
            }
        }
        let LogTotals { events, instants, sent, heard } = self.totals;
        self.write();
        let check = self.check.clone().finalize();
        self.line(format_args!("end {events} {instants} {sent} {heard} {check:08x}"));
        self.write();
        if self.error.is_none() {
            self.error = self.out.flush().err();
        }
        self.error.take().map_or(Ok(self.totals), Err)
    }

    /// Notes the changes of a contract since the last instant, and compares the planes with those of the events.
    fn compare(&mut self, shield: &Shield, [i, j]: [usize; 2], view: ContractView) {
        let side = shield.limits().side();
        let mut known = self.known[i * self.count + j];
        let fits = match view {
            ContractView::Owner { held, pending, heard } => {
                if let Some(taken) = known.pending.filter(|known| pending != Some(*known)) {
                    let [old, new] = [known.held, taken.divider].map(|divider| side.owner_plane(&divider));
                    // Equal planes do not show which one is held.
                    let accepted = if old == new { heard.accepted } else { held == new };
                    self.event(format_args!("take {i} {j} {} {}", taken.number, word(accepted)));
                    known.held = if accepted { taken.divider } else { known.held };
                    known.pending = None;
                }
                if let Some(Proposal { number, divider }) = pending.filter(|_| known.pending.is_none()) {
                    self.event(format_args!("propose {i} {j} {number} {}", Bits(plane_numbers(&divider))));
                    known.pending = pending;
                }
                held == side.owner_plane(&known.held)
            }
            ContractView::Follower { held, heard, decided } => {
                if decided.number != known.decided {
                    self.event(format_args!("decide {i} {j} {} {}", decided.number, word(decided.accepted)));
                    known.held = if decided.accepted { heard.divider } else { known.held };
                    known.decided = decided.number;
                }
                held == side.follower_plane(&known.held)
            }
        };
        if !fits {
            self.event(format_args!("foreign {i} {j}"));
        }
        self.known[i * self.count + j] = known;
    }

    fn event(&mut self, line: std::fmt::Arguments<'_>) {
        self.totals.events += 1;
        self.line(line);
    }

    fn line(&mut self, line: std::fmt::Arguments<'_>) {
        // A string takes every text.
        let _ = writeln!(self.text, "{line}");
        if self.text.len() >= BUFFER {
            self.write();
        }
    }

    fn write(&mut self) {
        self.check.update(self.text.as_bytes());
        if self.error.is_none() {
            self.error = self.out.write_all(self.text.as_bytes()).err();
        }
        self.text.clear();
    }
}

impl std::fmt::Debug for ContractLog {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("ContractLog").field("totals", &self.totals).finish_non_exhaustive()
    }
}

/// Bits of doubles as hexadecimal digits.
struct Bits<const COUNT: usize>([f64; COUNT]);

impl<const COUNT: usize> std::fmt::Display for Bits<COUNT> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (k, number) in self.0.iter().enumerate() {
            let space = if k > 0 { " " } else { "" };
            write!(out, "{space}{:016x}", number.to_bits())?;
        }
        Ok(())
    }
}

/// Stamp, hash and content of a message.
struct Content<'a>(&'a Message);

impl std::fmt::Display for Content<'_> {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Message { stamp, starts, body, .. } = self.0;
        write!(out, "{stamp} {starts:016x}")?;
        match body {
            Body::Owner { proposal: None } => write!(out, " none"),
            Body::Owner { proposal: Some(Proposal { number, divider }) } => {
                write!(out, " {number} {}", Bits(plane_numbers(divider)))
            }
            Body::Follower { segment, decision } => {
                write!(out, " {}", Bits(numbers_of(segment)))?;
                match decision {
                    Some(Decision { number, accepted }) => write!(out, " {number} {}", word(*accepted)),
                    None => write!(out, " none"),
                }
            }
        }
    }
}

fn word(accepted: bool) -> &'static str {
    if accepted { "yes" } else { "no" }
}

fn numbers_of(segment: &Segment) -> [f64; 6] {
    let Segment { position_m: [px, py, pz], stop_m: [sx, sy, sz] } = *segment;
    [px, py, pz, sx, sy, sz]
}

fn plane_numbers(divider: &Divider) -> [f64; 4] {
    let Divider { normal: [x, y, z], offset_m } = *divider;
    [x, y, z, offset_m]
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use nalgebra::Vector3;

    use super::*;
    use crate::brake::State;
    use crate::settings::Settings;
    use crate::shield::Timing;

    /// Bytes that a log wrote.
    #[derive(Clone, Default)]
    struct Written(Arc<Mutex<Vec<u8>>>);

    impl Write for Written {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().expect("no panic").extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// Flies two vehicles towards each other with a log. `change` is called before each instant.
    fn fly(change: impl Fn(usize, &mut Fleet)) -> (String, LogTotals) {
        let limits = [Settings::new(1.0, 0.05).limits().expect("defaults"); 2];
        let mut states = [-3.0, 3.0].map(|x| State::at_rest(Vector3::new(x, 0.0, 0.0)));
        let mut fleet = Fleet::new(&limits, &states).expect("apart");
        let written = Written::default();
        let mut log = ContractLog::new(Box::new(written.clone()));
        log.begin(&fleet);
        let (mut commands, mut broadcasts) = ([Vector3::zeros(); 2], vec![Broadcast::for_swarm(2); 2]);
        for period in 0..80 {
            change(period, &mut fleet);
            let wanted = [5.0, -5.0].map(|x| Vector3::new(x, 0.0, 0.0));
            fleet.filter(&states, &wanted, &mut commands);
            for (shield, broadcast) in fleet.shields_mut().iter_mut().zip(&mut broadcasts) {
                shield.write_broadcast(broadcast);
                log.filtered(shield);
                log.sent(broadcast);
            }
            for message in broadcasts.iter().flat_map(Broadcast::messages) {
                fleet.hear(&message);
                log.heard(&message);
            }
            for (state, command) in states.iter_mut().zip(commands) {
                *state = state.after(command, 0.05);
            }
        }
        let totals = log.finish().expect("written");
        (String::from_utf8(written.0.lock().expect("no panic").clone()).expect("text"), totals)
    }

    #[test]
    fn a_log_has_each_event_in_order_and_ends_with_their_numbers() {
        let (text, totals) = fly(|_, _| {});
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[..2], ["tautline contract log 1", "vertical 3ff0000000000000"]);
        assert!(lines[2].starts_with("start 0 3fe00001") && lines[3].starts_with("start 1 "), "{}", lines[2]);
        assert!(lines[4].starts_with("pair 0 1 ") && lines[5] == "instant 0 1", "{}", lines[4]);
        let count = |word: &str| lines.iter().filter(|line| line.starts_with(word)).count() as u64;
        let counted = LogTotals {
            events: lines.len() as u64 - 6,
            instants: count("instant "),
            sent: count("send "),
            heard: count("hear "),
        };
        assert_eq!((totals, totals.instants), (counted, 160));
        let LogTotals { events, instants, sent, heard } = totals;
        let (before, last) = text.split_at(text.len() - lines[lines.len() - 1].len() - 1);
        let check = crc32fast::hash(before.as_bytes());
        assert_eq!(last, format!("end {events} {instants} {sent} {heard} {check:08x}\n"));
        assert!(count("propose 0 1 ") > 2 && count("take 0 1 ") > 2 && count("decide 1 0 ") > 2);
        assert_eq!((count("hold 0 1 "), count("hold 1 0 "), count("foreign")), (1, 1, 0));
    }

    #[test]
    fn a_plane_without_an_event_is_named() {
        let (text, _) = fly(|period, fleet| {
            if period == 40 {
                let segments = [0, 1].map(|i| fleet.shields()[i].segment());
                assert!(fleet.shields_mut()[1].hold_heard(&segments));
            }
        });
        assert!(text.contains("\nforeign 1 0\n"));
    }

    #[test]
    fn a_reference_that_did_not_move_by_the_period_is_named() {
        let settings = Settings { period_tolerance: 0.2, ..Settings::new(1.0, 0.05) };
        let limits = settings.limits().expect("a tube");
        let states = [-3.0, 3.0].map(|x| State { position_m: Vector3::x() * x, velocity_m_s: Vector3::y() });
        for (elapsed_s, moved) in [(0.05, 0), (0.04, 1), (0.06, 1)] {
            let mut fleet = Fleet::new(&[limits; 2], &states).expect("apart");
            let written = Written::default();
            let mut log = ContractLog::new(Box::new(written.clone()));
            log.begin(&fleet);
            for _ in 0..2 {
                let shield = &mut fleet.shields_mut()[0];
                shield.filter_timed(states[0], Vector3::zeros(), Timing { elapsed_s, age_s: 0.0 });
                log.filtered(shield);
            }
            log.finish().expect("written");
            let text = String::from_utf8(written.0.lock().expect("no panic").clone()).expect("text");
            assert_eq!(text.matches("\nmoved 0\n").count(), moved, "{elapsed_s}");
        }
    }

    #[test]
    fn the_first_error_of_a_write_is_returned() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let error = ContractLog::new(Box::new(Full)).finish().expect_err("full");
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
    }
}
