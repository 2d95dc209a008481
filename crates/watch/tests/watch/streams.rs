//! Facts behind CLEAR: velocities that agree with positions, the error of positions, and one vehicle for each name.

use mavlink_core::calculate_crc;
use nalgebra::Vector3;

use crate::{monitor, rest, settings};
use tautline_core::fact::{FactKind, FactValue, Source};
use tautline_watch::source::{Input, MavlinkFrame, MavlinkReader};
use tautline_watch::{Bound, ClockScope, Fault, Monitor, Notice, Pose, Reason, Settings, State, Statement, TimeBase};

/// Returns the judgements of two vehicles 12 m apart at 50 Hz with default bounds, delta 1 m. `a` comes nearer with
/// 5 m/s and sends this velocity and its position at a time.
fn approach(sent_m_s: f64, position: impl Fn(f64) -> f64) -> (Monitor, Vec<(f64, Option<f64>)>) {
    let mut monitor = monitor(Settings { time_base: TimeBase::Stamps, ..Settings::default() });
    let mut judged = Vec::new();
    for k in 0..100 {
        let t_s = 0.02 * f64::from(k);
        let velocity_m_s = Some(Vector3::x() * sent_m_s);
        let position_m = Vector3::x() * position(t_s);
        monitor.take(&Pose { t_s, id: "a", position_m, velocity_m_s, accuracy_m: None }, t_s);
        let at_rest = Some(Vector3::zeros());
        let there = Vector3::x() * 12.0;
        monitor.take(&Pose { t_s, id: "b", position_m: there, velocity_m_s: at_rest, accuracy_m: None }, t_s);
        judged.push((t_s, monitor.assess(t_s).clear_until.map(|until| until.at_s)));
    }
    (monitor, judged)
}

#[test]
fn a_sent_velocity_of_zero_at_5_m_s_is_not_clear() {
    // The pair violates at 2.2 s.
    let (monitor, judged) = approach(0.0, |t_s| 5.0 * t_s);
    assert!(judged.iter().all(|&(t_s, until_s)| t_s < 0.03 || until_s.is_none()), "{judged:?}");
    assert!(judged.iter().all(|&(_, until_s)| until_s.is_none_or(|until_s| until_s < 2.2)), "{judged:?}");
    assert!(monitor.faults(Fault::VelocityDisagrees) > 90);
    // The positions show that the pair is on course to violate.
    let mut seen = monitor;
    assert!(seen.assess(0.0).nominal_violation.is_some_and(|first| (first.at_s - 2.2).abs() < 0.1));
    // Negative twin: the right velocity.
    let (monitor, judged) = approach(5.0, |t_s| 5.0 * t_s);
    assert_eq!(monitor.faults(Fault::VelocityDisagrees) + monitor.faults(Fault::OutOfBounds), 0);
    assert!(judged[..60].iter().all(|(_, until_s)| until_s.is_some_and(|until_s| until_s < 2.2)), "{judged:?}");
    assert!(
        monitor.facts().iter().any(|fact| fact.kind == FactKind::VelocityAgreement && fact.source == Source::Observed)
    );
}

#[test]
fn a_position_that_stands_still_while_its_velocity_goes_on_is_not_clear() {
    // From 0.5 s on; the error is above its bound 0.01 s later.
    let (monitor, judged) = approach(5.0, |t_s| 5.0 * t_s.min(0.5));
    assert!(judged.iter().all(|&(t_s, until_s)| t_s < 0.53 || until_s.is_none()), "{judged:?}");
    assert!(monitor.faults(Fault::VelocityDisagrees) > 60);
}

/// Returns a frame of `MAVLink` 2.
fn frame(message: u8, extra: u8, [system, component, number]: [u8; 3], payload: &[u8]) -> Vec<u8> {
    let length = u8::try_from(payload.len()).expect("a short payload");
    let mut bytes = vec![0xFD, length, 0, 0, number, system, component, message, 0, 0];
    bytes.extend(payload);
    bytes.extend(calculate_crc(&bytes[1..], extra).to_le_bytes());
    bytes
}

/// Returns `LOCAL_POSITION_NED` at rest.
fn local(sender: [u8; 3], time_ms: u32, north_m: f32) -> Vec<u8> {
    let numbers = [north_m, 0.0, -2.0, 0.0, 0.0, 0.0].into_iter().flat_map(f32::to_le_bytes);
    let payload: Vec<u8> = time_ms.to_le_bytes().into_iter().chain(numbers).collect();
    frame(32, 185, sender, &payload)
}

/// Returns `GPS_RAW_INT` with a fix in space and accuracies \[mm\].
fn receiver(sender: [u8; 3], [horizontal_mm, vertical_mm]: [u32; 2]) -> Vec<u8> {
    let mut payload = vec![0; 52];
    payload[28] = 3;
    payload[34..38].copy_from_slice(&horizontal_mm.to_le_bytes());
    payload[38..42].copy_from_slice(&vertical_mm.to_le_bytes());
    frame(24, 24, sender, &payload)
}

/// Watches datagrams, each with its arrival \[s\], up to their end.
struct Radio {
    reader: MavlinkReader,
    monitor: Monitor,
}

impl Radio {
    fn new(settings: Settings) -> Self {
        let settings = Settings { clocks: Some(ClockScope::PerVehicle), has_message_counts: true, ..settings };
        Self { reader: MavlinkReader::new(MavlinkFrame::Local), monitor: monitor(settings) }
    }

    fn take(&mut self, datagram: &[u8], arrival_s: f64) {
        let mut inputs = Vec::new();
        self.reader.take(datagram, arrival_s, &mut inputs);
        for input in inputs {
            match input {
                Input::Pose(pose, arrival_s) => {
                    self.monitor.take(&pose.borrowed(), arrival_s);
                }
                Input::TwoStreams(id, arrival_s) => self.monitor.two_streams(&id, arrival_s),
                other => panic!("{other:?}"),
            }
        }
        // Not more messages than the history keeps come between two judgements.
        self.monitor.assess(arrival_s);
    }

    fn state(&mut self, arrival_s: f64) -> State {
        self.monitor.assess(arrival_s).state
    }
}

#[test]
fn two_vehicles_with_one_system_id_are_not_clear() {
    let is_two =
        |radio: &mut Radio| matches!(radio.state(6.0), State::Undecided(Reason::Fault(Fault::TwoStreams, Some(1))));
    // System 1 is one vehicle, or two of them 0.04 m apart, which is within the errors. System 2 rests 30 m away.
    // The number and the clock of the second vehicle differ by these.
    for (count, number, clock_ms, is_found) in [
        (1, 0, 0, false),
        (2, 77, 0, true),
        (2, 200, 7, true),
        (2, 0, 7, true),
        (2, 0, 340, true),
        (2, 0, 90_000, true),
    ] {
        let mut radio = Radio::new(Settings::default());
        for k in 0..300_u32 {
            let arrival_s = f64::from(k) * 0.02;
            let byte = k.to_le_bytes()[0];
            radio.take(&local([2, 1, byte], 20 * k, 30.0), arrival_s);
            radio.take(&local([1, 1, byte], 500_000 + 20 * k, 0.0), arrival_s);
            if count == 2 {
                let own = [1, 1, byte.wrapping_add(number)];
                radio.take(&local(own, 500_000 + 20 * k - clock_ms, 0.04), arrival_s + 0.005);
            }
        }
        assert_eq!(is_two(&mut radio), is_found, "{number} {clock_ms}: {:?}", radio.state(6.0));
        assert_eq!(radio.monitor.faults(Fault::TwoStreams), u64::from(is_found));
        assert!(is_found || radio.state(6.0) == State::Clear, "{:?}", radio.state(6.0));
        // The finding stays after the second vehicle is silent, and refuses sign-offs.
        for k in 300..600_u32 {
            let (arrival_s, byte) = (f64::from(k) * 0.02, k.to_le_bytes()[0]);
            radio.take(&local([2, 1, byte], 20 * k, 30.0), arrival_s);
            radio.take(&local([1, 1, byte], 500_000 + 20 * k, 0.0), arrival_s);
        }
        assert_eq!(radio.state(12.0) == State::Clear, !is_found);
        assert_eq!(radio.monitor.sign_off("2", 11.98, 12.0), !is_found);
    }
}

#[test]
fn loss_copies_components_and_a_restart_are_one_vehicle() {
    let mut radio = Radio::new(Settings::default());
    let mut earlier: Vec<Vec<u8>> = Vec::new();
    for k in 0..600_u32 {
        let arrival_s = f64::from(k) * 0.02;
        let byte = k.to_le_bytes()[0];
        radio.take(&local([2, 1, byte], 20 * k, 30.0), arrival_s);
        // The autopilot restarts at 4 s; its clock and its count begin again.
        let (time_ms, number) =
            if k < 200 { (700_000 + 20 * k, byte) } else { (20 * (k - 200), (k - 200).to_le_bytes()[0]) };
        let own = local([1, 1, number], time_ms, 0.0);
        // Each fifth message is lost, and each message comes again 0.3 s later by another link.
        if k % 5 != 3 {
            radio.take(&own, arrival_s);
        }
        earlier.push(own);
        if k >= 15 && !(200..230).contains(&k) {
            radio.take(&earlier[k as usize - 15], arrival_s + 0.001);
        }
        // Another component has its own count, and sends no positions.
        radio.take(&frame(0, 50, [1, 154, byte.wrapping_mul(7)], &[0; 9]), arrival_s);
    }
    assert_eq!(radio.monitor.faults(Fault::TwoStreams), 0);
    assert_eq!(radio.monitor.faults(Fault::ClockStep), 1);
    assert_eq!(radio.state(12.0), State::Clear);
    // A second component with positions of the system is another vehicle.
    radio.take(&local([1, 2, 0], 20 * 400, 0.0), 12.0);
    assert_eq!(radio.monitor.faults(Fault::TwoStreams), 1);
}

#[test]
fn a_name_with_two_clocks_is_not_clear_in_any_source() {
    for time_base in [TimeBase::Arrival, TimeBase::Stamps] {
        for (offset_s, is_found) in [(0.0, false), (0.33, true), (-0.33, true), (400.0, true)] {
            let mut monitor = monitor(Settings { time_base, ..settings() });
            for k in 0..100 {
                let now_s = 1000.0 + 0.1 * f64::from(k);
                rest(&mut monitor, "b", now_s, 6.0, now_s);
                let t_s = if k % 2 == 1 { now_s - offset_s } else { now_s };
                rest(&mut monitor, "a", t_s, 0.0, now_s);
            }
            assert_eq!(monitor.faults(Fault::TwoStreams), u64::from(is_found), "{time_base:?} {offset_s}");
            let state = monitor.assess(1009.9).state;
            assert_eq!(state == State::Clear, !is_found, "{time_base:?} {offset_s}: {state:?}");
        }
    }
}

#[test]
fn one_stream_is_observed_only_where_two_would_show() {
    for (clocks, has_message_counts, time_base, is_observed) in [
        (ClockScope::Common, false, TimeBase::Arrival, false),
        (ClockScope::Common, false, TimeBase::Stamps, false),
        (ClockScope::PerVehicle, false, TimeBase::Stamps, false),
        (ClockScope::PerVehicle, false, TimeBase::Arrival, true),
        (ClockScope::Common, true, TimeBase::Arrival, true),
    ] {
        let mut monitor = monitor(Settings { clocks: Some(clocks), has_message_counts, time_base, ..settings() });
        for k in 0..20 {
            let now_s = 0.1 * f64::from(k);
            rest(&mut monitor, "b", now_s, 6.0, now_s);
            // Two vehicles have the name `a` and one clock, which the fact must not exclude.
            rest(&mut monitor, "a", now_s - 0.05 * f64::from(k % 2), 0.001 * f64::from(k % 2), now_s);
        }
        assert_eq!(monitor.faults(Fault::TwoStreams), 0);
        let source = monitor.facts().into_iter().find(|fact| fact.kind == FactKind::OneStream).map(|fact| fact.source);
        let expected = if is_observed { Source::Observed } else { Source::NotObservable };
        assert_eq!(source, Some(expected), "{clocks:?} {has_message_counts} {time_base:?}");
    }
}

#[test]
fn a_wrong_velocity_in_a_part_of_the_messages_is_not_clear() {
    // `a` moves with 4 m/s, `b` rests 62 m away. The pair violates at 15.25 s.
    for every in [1, 2, 3] {
        for sent_m_s in [0.0, 4.0] {
            let mut monitor = monitor(Settings {
                time_base: TimeBase::Stamps,
                accel_m_s2: Bound::declared(2.0),
                position_error_m: Some(Bound::declared(2.0)),
                max_age_s: Bound::declared(5.0),
                ..Settings::default()
            });
            for k in 0..76 {
                let t_s = 0.2 * f64::from(k);
                let velocity_m_s = (k % every == 0).then_some(Vector3::x() * sent_m_s);
                let position_m = Vector3::new(4.0 * t_s, 0.0, 2.0);
                monitor.take(&Pose { t_s, id: "a", position_m, velocity_m_s, accuracy_m: None }, t_s);
                rest(&mut monitor, "b", t_s, 62.0, t_s);
                let state = monitor.assess(t_s).state;
                if sent_m_s == 0.0 && t_s > 2.1 {
                    assert_eq!(state, State::Undecided(Reason::Fault(Fault::VelocityDisagrees, None)), "{every} {t_s}");
                } else if sent_m_s > 0.0 && t_s > 0.1 && t_s < 10.0 {
                    assert_eq!(state, State::Clear, "{every} {t_s}");
                }
                let agreement = monitor.facts().into_iter().find(|fact| fact.kind == FactKind::VelocityAgreement);
                let expected = if k < every { Source::NotObservable } else { Source::Observed };
                assert_eq!(agreement.map(|fact| fact.source), Some(expected), "{every} {t_s}");
            }
        }
    }
}

/// Returns the state of two systems 60 m apart whose receivers report these accuracies \[mm\], with its facts.
fn with_receivers(position_error_m: Option<Bound>, accuracy_mm: Option<[u32; 2]>) -> (State, Notice, Monitor) {
    let mut radio = Radio::new(Settings { position_error_m, ..Settings::default() });
    for k in 0..50_u32 {
        let (arrival_s, byte) = (f64::from(k) * 0.1, k.to_le_bytes()[0]);
        for (system, north_m) in [(1, 0.0), (2, 60.0)] {
            if let Some(accuracy_mm) = accuracy_mm.filter(|_| k % 10 == 0) {
                radio.take(&receiver([system, 1, byte.wrapping_mul(2)], accuracy_mm), arrival_s);
            }
            radio.take(&local([system, 1, byte.wrapping_mul(2).wrapping_add(1)], 100 * k, north_m), arrival_s);
        }
    }
    let judged = radio.monitor.assess(4.9);
    (judged.state, Notice::new(Statement::State(&judged), &radio.monitor), radio.monitor)
}

#[test]
fn clear_names_the_error_of_positions_with_its_source() {
    let fact = |monitor: &Monitor, kind: FactKind| {
        let fact = monitor.facts().into_iter().find(|fact| fact.kind == kind)?;
        let Some(FactValue::Number(value, _)) = fact.value else { panic!("{fact:?}") };
        Some((fact.source, value))
    };
    // Reported: 5 times the hypotenuse of 0.3 m and 0.4 m.
    let (state, notice, monitor) = with_receivers(None, Some([300, 400]));
    assert_eq!(state, State::Clear);
    let (source, error_m) = fact(&monitor, FactKind::PositionError).expect("a bound");
    assert!(source == Source::Recorded && (error_m - 2.5).abs() < 1e-12, "{error_m}");
    let json = &notice.json["facts"];
    for (k, kind, source, value, unit) in [
        (0, "position-error", "recorded", 2.5, "m"),
        (1, "acceleration", "default", 9.81, "m/s^2"),
        (2, "velocity-error", "default", 0.1, "m/s"),
        (3, "age", "default", 1.0, "s"),
        (4, "latency", "default", 0.0, "s"),
    ] {
        let expected =
            serde_json::json!({ "fact": kind, "source": source, "value": value, "unit": unit, "subject": null });
        assert_eq!(json[k], expected, "{json}");
    }
    for (k, kind, source, value) in [
        (5, "clock", "declared", "own".into()),
        (6, "length-unit", "convention", "m".into()),
        (7, "time-unit", "convention", "s".into()),
        (8, "velocity-agreement", "observed", serde_json::Value::Null),
        (9, "one-stream", "observed", serde_json::Value::Null),
    ] {
        assert_eq!((&json[k]["fact"], &json[k]["source"], &json[k]["value"]), (&kind.into(), &source.into(), &value));
    }
    // Declared, and the default.
    for (bound, accuracy_mm, source, value) in [
        (Some(Bound::declared(3.0)), Some([300, 400]), Source::Declared, 3.0),
        (Settings::default().position_error_m, None, Source::Default, 0.05),
    ] {
        let (state, _, monitor) = with_receivers(bound, accuracy_mm);
        assert_eq!((state, fact(&monitor, FactKind::PositionError)), (State::Clear, Some((source, value))));
    }
    // Without a bound, and with one that the receiver contradicts, nothing is clear.
    let (state, notice, monitor) = with_receivers(None, None);
    assert_eq!((state, fact(&monitor, FactKind::PositionError)), (State::Undecided(Reason::ErrorUnknown(0)), None));
    assert!(notice.json["facts"].is_null(), "{}", notice.json);
    for bound in [Bound::declared(0.4), Bound::default_of(0.05)] {
        let (state, ..) = with_receivers(Some(bound), Some([300, 400]));
        assert_eq!(state, State::Undecided(Reason::Fault(Fault::Inaccurate, None)), "{bound:?}");
    }
}
