//! A watch from its first input to its end: inputs of sources go to the monitor, notices to the outputs.

use std::io;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, TryRecvError};
use std::time::Duration;

use crate::absences::Absences;
use crate::event::{Assessment, Event, Fault, MessageError, Problem, Reason, State};
use crate::monitor::Monitor;
use crate::notice::{Notice, Statement};
use crate::settings::TimeBase;
use crate::source::{Input, Inputs, OwnedPose, PlanMessage};
use crate::words::name;
use tautline_audit::Status;

/// Time between two judgements \[s\]; an alarm is at most this late.
pub const ASSESS_PERIOD_S: f64 = 0.01;
/// Time between two lines of an unchanged state \[s\].
pub const LINE_PERIOD_S: f64 = 1.0;
/// Distance of a judgement after the end of CLEAR, and before the next stamp \[s\].
const PROBE_S: f64 = 1e-4;
/// Largest number of inputs between two judgements.
const MOST_AT_ONCE: usize = 5_000;

/// Output of a watch.
pub trait Output {
    /// Takes a notice.
    ///
    /// # Errors
    /// If it cannot be written; this ends the watch.
    fn notice(&mut self, notice: &Notice) -> io::Result<()>;

    /// Takes a pose that the monitor used, with its time \[s\].
    ///
    /// # Errors
    /// As [`notice`](Self::notice).
    fn pose(&mut self, _time_s: f64, _pose: &OwnedPose) -> io::Result<()> {
        Ok(())
    }

    /// Takes a judgement; called at most each [`ASSESS_PERIOD_S`].
    ///
    /// # Errors
    /// As [`notice`](Self::notice).
    fn assessed(&mut self, _of: &Assessment, _monitor: &Monitor) -> io::Result<()> {
        Ok(())
    }
}

/// Result of a watch.
#[derive(Clone, Debug, Default, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "each is a finding of its own")]
pub struct Summary {
    /// Whether all expected vehicles were heard.
    pub has_started: bool,
    /// Time in the state CLEAR \[s\].
    pub clear_s: f64,
    /// Time in the state UNDECIDED after the start \[s\], and time since sign-offs after which the vehicle was heard.
    pub undecided_s: f64,
    /// Time in the state VIOLATION \[s\].
    pub violation_s: f64,
    /// Whether a judgement after the start was UNDECIDED.
    pub was_undecided: bool,
    /// Whether a judgement was VIOLATION, or a measured violation was found.
    pub was_violated: bool,
    /// Whether a vehicle left the tube around its plan.
    pub was_off_plan: bool,
    /// Number of positions that were compared with the plan, if there is a plan.
    pub compared: Option<u64>,
    /// Number of measured violations.
    pub violations: u64,
    /// Number of plans of planners and of their conflicts, if there was a plan.
    pub plans: Option<[u64; 2]>,
    /// Number of vehicles.
    pub vehicles: usize,
    /// Number of vehicles that had signed off at the end.
    pub signed_off: usize,
    /// Number of sign-offs after which the vehicle sent a position.
    pub returned: u64,
    /// Smallest separation at a judgement or in a measured violation \[m\], with the names of the pair.
    pub closest: Option<(f64, [String; 2])>,
}

impl Summary {
    /// Returns the status of the separation: clear if every judgement after the start was CLEAR. With a plan, at least
    /// one position must have been compared.
    #[must_use]
    pub fn status(&self) -> Status {
        match self {
            _ if self.was_violated => Status::Violation,
            _ if !self.has_started || self.was_undecided || self.compared == Some(0) => Status::Undecided,
            _ => Status::Clear,
        }
    }

    /// Returns whether the exit code is 0: the status is clear, and every vehicle kept to its plan.
    #[must_use]
    pub fn passes(&self) -> bool {
        self.status() == Status::Clear && !self.was_off_plan
    }
}

/// Running watch.
struct Session<'a> {
    monitor: Monitor,
    output: &'a mut dyn Output,
    summary: Summary,
    last: Option<Assessment>,
    absences: Absences,
    /// Time of the last line \[s\].
    line_s: f64,
    /// Last message that cannot be read.
    message_error: Option<MessageError>,
    /// Line of a judgement just before a stamp. The events of this stamp are older, so they come first.
    held: Option<Notice>,
    holds: bool,
}

/// Watches until the source ends or the flag of the inputs is set.
///
/// # Errors
/// If an output fails.
pub fn watch(monitor: Monitor, inputs: &Inputs, output: &mut dyn Output) -> io::Result<Summary> {
    let uses_stamps = monitor.settings().time_base == TimeBase::Stamps;
    let mut session = Session {
        monitor,
        output,
        summary: Summary::default(),
        last: None,
        absences: Absences::default(),
        line_s: f64::NEG_INFINITY,
        message_error: None,
        held: None,
        holds: false,
    };
    let now_s = || inputs.start.elapsed().as_secs_f64();
    let (mut next_s, mut is_over, mut dropped) = (0.0, false, 0);
    while !is_over && !inputs.stop.load(Ordering::Relaxed) {
        let wait_s = if uses_stamps { 0.1 } else { (next_s - now_s()).clamp(0.0, ASSESS_PERIOD_S) };
        match inputs.receiver.recv_timeout(Duration::from_secs_f64(wait_s)) {
            Ok(input) => is_over |= session.take(input)?,
            Err(RecvTimeoutError::Disconnected) => is_over = true,
            Err(RecvTimeoutError::Timeout) => {}
        }
        for _ in 0..MOST_AT_ONCE {
            match inputs.receiver.try_recv() {
                Ok(input) => is_over |= session.take(input)?,
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => break,
            }
        }
        let lost = inputs.dropped.load(Ordering::Relaxed);
        if lost > dropped {
            session.monitor.dropped(lost - dropped, now_s());
            dropped = lost;
        }
        if !uses_stamps && now_s() >= next_s {
            session.assess(now_s())?;
            next_s = now_s() + ASSESS_PERIOD_S;
        }
        // Standard input may be silent forever: its thread cannot be ended.
    }
    session.finish(now_s())
}

impl Session<'_> {
    /// Takes an input. Returns whether the source has ended.
    fn take(&mut self, input: Input) -> io::Result<bool> {
        match input {
            Input::Pose(pose, arrival_s) => self.pose(&pose, arrival_s)?,
            Input::Plan(message) => self.plan(&message)?,
            Input::SignOff(id, t_s, arrival_s) => self.sign_off(&id, t_s, arrival_s)?,
            Input::Garbage(error, arrival_s) => {
                self.message_error = Some(error);
                self.monitor.fault(Fault::Garbage, None, arrival_s);
                self.pass_events()?;
            }
            Input::TwoStreams(id, arrival_s) => {
                self.monitor.two_streams(&id, arrival_s);
                self.pass_events()?;
            }
            Input::Connected(source) => self.notice(Statement::Connected(&source))?,
            Input::Lost(source, loss) => self.notice(Statement::Lost(&source, &loss))?,
            Input::End => return Ok(true),
        }
        Ok(false)
    }

    fn pose(&mut self, pose: &OwnedPose, arrival_s: f64) -> io::Result<()> {
        self.pass_until(pose.t_s, arrival_s)?;
        let borrowed = pose.borrowed();
        if let Some(taken) = self.monitor.take(&borrowed, arrival_s) {
            self.output.pose(taken.time_s, pose)?;
        }
        self.pass_events()
    }

    fn plan(&mut self, message: &PlanMessage) -> io::Result<()> {
        if let Err(problem) = self.monitor.take_plan(message) {
            self.message_error = Some(MessageError { place: message.topic.clone(), problem });
            self.monitor.fault(Fault::Garbage, None, message.arrival_s);
        }
        self.pass_events()
    }

    fn sign_off(&mut self, id: &str, t_s: f64, arrival_s: f64) -> io::Result<()> {
        self.pass_until(t_s, arrival_s)?;
        let problem = Problem::NotHeard(id.chars().take(60).collect());
        self.message_error = Some(MessageError { place: String::new(), problem });
        self.monitor.sign_off(id, t_s, arrival_s);
        self.pass_events()
    }

    /// Judges the time from the present to a stamp, with [`TimeBase::Stamps`].
    fn pass_until(&mut self, t_s: f64, arrival_s: f64) -> io::Result<()> {
        if self.monitor.settings().time_base == TimeBase::Stamps
            && let Some(ahead_s) = self.monitor.is_ahead_s(t_s)
            && ahead_s > 0.0
        {
            // All poses with the present stamp have been taken.
            let next_s = self.monitor.now_s() + ahead_s;
            let since_s = self.last.map_or(f64::INFINITY, |last| self.monitor.now_s() - last.now_s);
            let is_due = since_s >= ASSESS_PERIOD_S || ahead_s >= ASSESS_PERIOD_S;
            if is_due || self.end_of_clear_s().is_some_and(|end_s| end_s < next_s) {
                self.assess(arrival_s)?;
            }
            self.pass_end_of_clear(t_s, next_s, arrival_s)?;
            if ahead_s > self.monitor.settings().max_age_s.value {
                // No message came between the present and this stamp.
                self.monitor.advance(t_s);
                self.assess(arrival_s)?;
            }
        }
        Ok(())
    }

    /// Returns the time until which the last judgement is CLEAR \[s\], if it is CLEAR.
    fn end_of_clear_s(&self) -> Option<f64> {
        self.last.filter(|last| last.state == State::Clear)?.clear_until.map(|until| until.at_s)
    }

    /// Judges the time between the end of CLEAR and the time `next_s` of the next stamp \[s\], if it is not proved.
    fn pass_end_of_clear(&mut self, t_s: f64, next_s: f64, arrival_s: f64) -> io::Result<()> {
        // A part of the time that is left, so that the judgement lies before the next stamp.
        let part_s = |left_s: f64| PROBE_S.min(left_s / 2.0);
        let mut was_short = false;
        while let Some(end_s) = self.end_of_clear_s().filter(|&end_s| end_s < next_s) {
            was_short = true;
            let left_s = next_s - end_s;
            if self.monitor.advance(t_s - (left_s - part_s(left_s))) <= 0.0 {
                break;
            }
            self.assess(arrival_s)?;
        }
        let left_s = next_s - self.monitor.now_s();
        if was_short && self.monitor.advance(t_s - part_s(left_s)) > 0.0 {
            self.holds = true;
            self.assess(arrival_s)?;
            self.holds = false;
        }
        Ok(())
    }

    fn notice(&mut self, statement: Statement<'_>) -> io::Result<()> {
        self.output.notice(&Notice::new(statement, &self.monitor))
    }

    fn assess(&mut self, arrival_s: f64) -> io::Result<()> {
        let of = self.monitor.assess(arrival_s);
        self.judged(&of)
    }

    fn judged(&mut self, of: &Assessment) -> io::Result<()> {
        self.pass_events()?;
        if let Some(notice) = self.held.take() {
            self.output.notice(&notice)?;
        }
        let summary = &mut self.summary;
        let before = self.last.filter(|last| last.now_s.is_finite() && of.now_s.is_finite());
        if let Some(last) = before {
            // The first pose may set the time of the monitor back.
            let passed_s = (of.now_s - last.now_s).max(0.0);
            match last.state {
                State::Clear => {
                    summary.clear_s += passed_s;
                    self.absences.clear_s += passed_s;
                }
                State::Violation(..) => summary.violation_s += passed_s,
                State::Undecided(reason) if summary.has_started => {
                    if reason.is_of_end() {
                        self.absences.end_s += passed_s;
                    } else {
                        summary.undecided_s += passed_s;
                    }
                }
                State::Undecided(_) => {}
            }
        }
        // A return of a vehicle, or another state, shows that the watch was not at its end.
        self.absences.settle();
        let unseen_s = std::mem::take(&mut self.absences.unseen_s);
        let has_return = std::mem::take(&mut self.absences.has_return);
        let is_end = matches!(of.state, State::Undecided(reason) if reason.is_of_end());
        let end_s = if is_end && !has_return { 0.0 } else { std::mem::take(&mut self.absences.end_s) };
        summary.clear_s = (summary.clear_s - unseen_s).max(0.0);
        summary.undecided_s += unseen_s + end_s;
        summary.was_undecided |= unseen_s + end_s > 0.0;
        summary.has_started |=
            !matches!(of.state, State::Undecided(reason) if reason.is_of_start() || reason.is_of_end());
        summary.was_violated |= matches!(of.state, State::Violation(..));
        summary.was_undecided |=
            summary.has_started && matches!(of.state, State::Undecided(reason) if !reason.is_of_end());
        (summary.vehicles, summary.signed_off) = (of.heard, of.signed_off);
        if let Some(near) = of.closest {
            note_closest(summary, near.nominal_m, || near.pair.map(|k| name(&self.monitor, k)));
        }
        let is_change = self.last.is_none_or(|last| kind(last.state) != kind(of.state));
        // Not a difference of times: times may be infinite before the first pose.
        let is_due = of.now_s >= self.line_s + LINE_PERIOD_S || of.now_s < self.line_s;
        if is_change || is_due {
            self.line_s = of.now_s;
            let notice = Notice::new(Statement::State(of), &self.monitor);
            if self.holds {
                self.held = Some(notice);
            } else {
                self.output.notice(&notice)?;
            }
        }
        self.last = Some(*of);
        self.output.assessed(of, &self.monitor)
    }

    fn pass_events(&mut self) -> io::Result<()> {
        let events: Vec<Event> = self.monitor.drain_events().collect();
        for event in events {
            match event {
                Event::Began(_) => self.summary.was_violated = true,
                Event::SignedOff { vehicle, at_s } => self.absences.begin(vehicle, at_s, self.last.as_ref()),
                Event::Back { vehicle, signed_off_s: Some(_), .. } => {
                    self.absences.end(vehicle);
                    self.summary.returned += 1;
                    self.summary.was_undecided |= self.summary.has_started;
                }
                Event::Ended(of) => {
                    note_closest(&mut self.summary, of.min_m, || of.pair.map(|k| name(&self.monitor, k)));
                }
                Event::Plan { is_outside: true, .. } => self.summary.was_off_plan = true,
                // The conflict may be withdrawn before the next judgement.
                Event::PlanConflict { .. } => self.summary.was_undecided |= self.summary.has_started,
                _ => {}
            }
            let statement = Statement::Event(&event, self.message_error.as_ref());
            self.output.notice(&Notice::new(statement, &self.monitor))?;
        }
        Ok(())
    }

    fn finish(mut self, arrival_s: f64) -> io::Result<Summary> {
        let of = self.monitor.finish(arrival_s);
        self.judged(&of)?;
        self.summary.violations = self.monitor.violations();
        self.summary.compared = self.monitor.compared();
        self.summary.plans = self.monitor.plan_counts();
        self.output.notice(&Notice::new(Statement::Summary(&self.summary), &self.monitor))?;
        Ok(self.summary)
    }
}

fn note_closest(summary: &mut Summary, distance_m: f64, pair: impl FnOnce() -> [String; 2]) {
    if summary.closest.as_ref().is_none_or(|(least_m, _)| distance_m < *least_m) {
        summary.closest = Some((distance_m, pair()));
    }
}

/// Part of a state whose change gives a line at once.
fn kind(state: State) -> (Status, Option<u32>) {
    let vehicle = match state {
        State::Violation([vehicle, _], _) | State::Undecided(Reason::Stale(vehicle, _)) => Some(vehicle),
        _ => None,
    };
    (state.status(), vehicle)
}
