//! Tests of the data of a replay: bounds of size, and findings that are always kept.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use nalgebra::Vector3;
use serde_json::Value;

use super::*;
use crate::flight_log::FlightLog;
use tautline_audit::{Approach, MovingObstacle, ObjectPair, Slice, Slices};
use tautline_core::obstacle::Shape;
use tautline_core::record::Sample;
use tautline_core::swarm::{ClosestApproach, Pair, Rows, Swarm, set_row};
use tautline_sim::scenario::{Scenario, Source};

const JUDGED: JudgementContext = JudgementContext { is_else_known: true, limit: Some(1.0), unit: "m" };

fn stage(vehicles: usize) -> Stage {
    Stage {
        vehicles: (1..=vehicles).map(|number| number.to_string()).collect(),
        radius_m: vec![Some(0.2); vehicles],
        shell_m: Some([0.5; 3]),
        plan: None,
        rotors: None,
        obstacles: Vec::new(),
    }
}

/// Returns a log of vehicles on a line, 2 m apart, at 1 m/s, sampled at 10 Hz.
fn log(vehicles: usize, samples: usize) -> FlightLog {
    let mut log = FlightLog::default().within(usize::MAX);
    for k in 0..samples {
        let time_s = 0.1 * k as f64;
        let mut positions_m = Rows::zeros(vehicles);
        (0..vehicles).for_each(|i| set_row(&mut positions_m, i, Vector3::new(time_s, 2.0 * i as f64, 1.0)));
        let pair = (vehicles > 1).then(|| Pair::new(0, 1));
        let separation = pair.map(|pair| ClosestApproach { pair, separation_m: 2.0, time_s });
        take(&mut log, time_s, positions_m, separation);
    }
    log
}

fn take(log: &mut FlightLog, time_s: f64, positions_m: Rows, separation: Option<ClosestApproach>) {
    log.take(&Sample { separation, ..Sample::new(time_s, 0, &Swarm::at_rest(positions_m), &Rows::zeros(0)) });
}

fn violation(vehicle: usize, from_s: f64, to_s: f64) -> Moment {
    let span = Span { from_s, to_s, at_s: f64::midpoint(from_s, to_s) };
    Moment {
        kind: Kind::Violation,
        vehicles: vec![vehicle],
        obstacle: None,
        span,
        brief: "near".to_owned(),
        said: "too near".to_owned(),
    }
}

fn packed(stage: &Stage, log: &FlightLog, moments: &[Moment], room_bytes: usize) -> (Replay, Value) {
    let replay = Replay::new(stage, log, moments, JUDGED, room_bytes).expect("a replay");
    assert!(replay.json.len() <= room_bytes, "{} of {room_bytes} bytes", replay.json.len());
    let data = serde_json::from_str(&replay.json).expect("JSON");
    (replay, data)
}

fn doubles(data: &Value) -> Vec<f64> {
    let bytes = BASE64.decode(data.as_str().expect("base64")).expect("base64");
    bytes.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().expect("eight"))).collect()
}

#[test]
fn keeps_a_short_flight_completely() {
    let (replay, data) = packed(&stage(3), &log(3, 100), &[violation(2, 3.0, 4.0)], PAGE_BYTES);
    assert_eq!((replay.instants, replay.vehicles, replay.moments), ([100, 100], [3, 3], [1, 1]));
    let times: Vec<f64> = (0..100).map(|k| 0.1 * f64::from(k)).collect();
    assert_eq!(doubles(&data["times_s"]), times);
    assert_eq!(doubles(&data["near_s"]), times[..99]);
    assert_eq!(data["nearest"], serde_json::json!([[0.0, "closest so far 2.000 m, 1 and 2"]]));
    let verdicts = data["verdicts"].as_array().expect("verdicts");
    let said: Vec<_> = verdicts.iter().map(|told| (&told[1], told[2].as_str().expect("words"))).collect();
    assert_eq!(
        said,
        [
            (&Value::from(false), "no violation so far"),
            (&Value::from(true), "violation: near"),
            (&Value::from(false), "1 violation so far")
        ]
    );
    assert_eq!((replay.inexact, replay.unknown_radius, replay.obstacles_off_m), (0, None, 0.0));
    assert_eq!(data["moments"][0]["who"], serde_json::json!([2]));
    assert!(data["rounding_m"].as_f64() == Some(replay.rounding_m) && replay.rounding_m < 1e-5);
    assert_eq!(packed(&stage(3), &log(3, 100), &[violation(2, 3.0, 4.0)], PAGE_BYTES).0, replay, "the same bytes");
}

#[test]
fn thins_long_flights_and_keeps_samples_of_violations() {
    let log = log(5, 40_000);
    for room_bytes in [PAGE_BYTES, 60_000, 30_000] {
        let (replay, data) = packed(&stage(5), &log, &[violation(3, 1234.5, 1236.0)], room_bytes);
        let [kept, samples] = replay.instants;
        assert!(samples == 40_000 && kept <= MOST_INSTANTS && kept > 150, "{kept} in {room_bytes}");
        let times = doubles(&data["times_s"]);
        let all_s = log.keyframes().iter().map(|keyframe| keyframe.time_s);
        let within = all_s.filter(|time_s| (1234.4..1236.1).contains(time_s));
        assert!(within.clone().count() >= 16 && within.clone().all(|time_s| times.contains(&time_s)));
        assert_eq!([times.first(), times.last()].map(Option::<&f64>::copied), log.range_s().map(Some));
    }
    let none = Replay::new(&stage(5), &log, &[], JUDGED, 1000);
    assert_eq!(none, Err(NoReplay::NoRoom { room_bytes: 1000 }));
}

#[test]
fn draws_the_vehicles_of_findings_among_a_hundred_thousand() {
    let vehicles = 100_000;
    let (replay, data) = packed(&stage(vehicles), &log(vehicles, 3), &[violation(77_777, 0.1, 0.1)], PAGE_BYTES);
    assert_eq!(replay.vehicles, [MOST_VEHICLES, vehicles]);
    let names = data["vehicles"].as_array().expect("names");
    let at = names.iter().position(|name| name == "77778").expect("the vehicle of the violation");
    assert_eq!(data["moments"][0]["who"], serde_json::json!([at]));
    // Vehicle 1 of the closest pair is drawn too; vehicle 2 is omitted.
    assert!(names.iter().any(|name| name == "1") && names.iter().all(|name| name != "2"));
}

#[test]
fn handles_one_vehicle_one_sample_and_no_vehicle() {
    let (replay, data) = packed(&stage(1), &log(1, 1), &[], PAGE_BYTES);
    assert_eq!((replay.instants, doubles(&data["near_s"]).len()), ([1, 1], 0));
    assert_eq!(Replay::new(&stage(2), &FlightLog::default(), &[], JUDGED, PAGE_BYTES), Err(NoReplay::Empty));
    let nowhere = FlightLog::recorded(vec![0.0], vec![Rows::repeat(2, f64::NAN)], Slices::default(), 1);
    assert_eq!(Replay::new(&stage(2), &nowhere, &[], JUDGED, PAGE_BYTES), Err(NoReplay::Empty));
    let far = FlightLog::recorded(vec![0.5], vec![Rows::repeat(1, 2e9)], Slices::default(), 1);
    let refused = Replay::new(&stage(1), &far, &[], JUDGED, PAGE_BYTES).expect_err("too far");
    assert_eq!(refused.to_string(), "vehicle 1 is farther than 1e9 m from the origin at 0.5 s");
}

#[test]
fn absent_vehicles_are_not_packed() {
    let at = |x: f64| Rows::from_row_slice(&[x, 0.0, 0.0, x, 5.0, 0.0]);
    let mut gone = at(1.0);
    gone.row_mut(1).fill(f64::NAN);
    let log = FlightLog::recorded(vec![0.0, 1.0, 2.0], vec![at(0.0), gone, at(2.0)], Slices::default(), 3);
    let (_, data) = packed(&stage(2), &log, &[], PAGE_BYTES);
    let steps = BASE64.decode(data["steps"].as_str().expect("base64")).expect("base64");
    let along_x: Vec<_> = steps.chunks_exact(6).map(|step| i16::from_le_bytes([step[0], step[1]])).collect();
    assert_eq!(along_x.iter().map(|&x| x == i16::MIN).collect::<Vec<_>>(), [false, false, false, true, false, false]);
    assert_eq!(i32::from(along_x[5]), 2 * i32::from(along_x[2]), "relative to its last position");
}

#[test]
fn foreign_text_is_escaped_and_cut() {
    let mut hostile = stage(2);
    hostile.vehicles = vec!["</script><script>alert(1)</script>".to_owned(), "ü".repeat(5_000_000)];
    hostile.obstacles = vec![MovingObstacle {
        name: "<!--".repeat(9000),
        shape: Shape::Ball { radius_m: 1.0 },
        clearance_m: None,
        path: vec![(0.0, Vector3::zeros())],
    }];
    let said = "</SCRIPT>".repeat(100_000);
    let moment = Moment { said, ..violation(0, 0.0, 0.1) };
    let (replay, data) = packed(&hostile, &log(2, 10), &[moment], PAGE_BYTES);
    assert!(!replay.json.contains('<') && replay.json.len() < 20_000);
    assert_eq!(data["vehicles"][0], "</script><script>alert(1)</script>");
    assert_eq!(data["vehicles"][1].as_str().map(|name| name.chars().count()), Some(41));
}

#[test]
fn packs_slots_links_and_reference() {
    let scenario = Scenario::read(&Source::Builtin("pentagon".to_owned()), &[]).expect("built in");
    let mut log = FlightLog::default();
    // Every vehicle is in its slot, with the formation turned by a quarter and moved.
    let slots_m = &scenario.legs[0].formation.slots_m;
    let turned = Rows::from_fn(slots_m.nrows(), |i, axis| match axis {
        0 => 3.0 - slots_m[(i, 1)],
        1 => slots_m[(i, 0)],
        _ => slots_m[(i, 2)],
    });
    take(&mut log, 0.0, turned, None);
    let (_, data) = packed(&Stage::of(&scenario), &log, &[], PAGE_BYTES);
    assert_eq!(
        (data["axes"].as_u64(), data["points"].as_u64(), data["tension"].as_bool()),
        (Some(5), Some(9), Some(true))
    );
    let bytes = |key: &Value| BASE64.decode(key.as_str().expect("base64")).expect("base64");
    assert_eq!(bytes(&data["links"]).len(), 10 * 4, "every two");
    let numbers: Vec<_> = bytes(&data["formations"][0]["slots"])
        .chunks_exact(4)
        .map(|bytes| f64::from(f32::from_le_bytes(bytes.try_into().expect("four"))))
        .collect();
    let number = |key: &str| data[key].as_f64().expect("a number");
    let starts: Vec<_> = bytes(&data["starts"])
        .chunks_exact(4)
        .map(|bytes| f64::from(i32::from_le_bytes(bytes.try_into().expect("four"))) * number("cell_m"))
        .collect();
    let point = |k: usize| Vector3::from_column_slice(&starts[3 * k..3 * k + 3]);
    for vehicle in 0..5 {
        let along = |axis: usize| (point(6 + axis) - point(5)) * numbers[3 * vehicle + axis] / number("axis_m");
        let slot = point(5) + along(0) + along(1) + along(2);
        assert!((slot - point(vehicle)).norm() < 1e-5, "{vehicle}: {slot} and {}", point(vehicle));
    }
}

/// Returns a log of two instants of vehicles on a line, 2 m apart.
fn two_instants(vehicles: usize) -> FlightLog {
    let at = |x: f64| Rows::from_fn(vehicles, |i, axis| if axis == 0 { x + 2.0 * i as f64 } else { 0.0 });
    FlightLog::recorded(vec![0.0, 10.0], vec![at(0.0), at(1.0)], Slices::default(), 2)
}

fn with_gaps(mut log: FlightLog, gaps: Vec<(usize, [f64; 2])>) -> FlightLog {
    log.gaps = gaps;
    log
}

#[test]
fn absence_between_two_kept_instants_breaks_the_path() {
    let gaps = vec![(1, [3.0, 5.0]), (1, [6.0, 7.0]), (7, [1.0, 2.0]), (2, [4.0, 11.0])];
    let (_, data) = packed(&stage(3), &with_gaps(two_instants(3), gaps), &[], PAGE_BYTES);
    let bytes = BASE64.decode(data["breaks"].as_str().expect("base64")).expect("base64");
    assert_eq!(bytes, [1, 0, 1, 0], "at instant 1 vehicle 1");
    assert_eq!(data["holds"], false);
    // Without room for breaks, the vehicle is absent at the instants.
    let many = (0..200).map(|vehicle| (vehicle, [3.0, 5.0])).collect();
    let (_, data) = packed(&stage(200), &with_gaps(two_instants(200), many), &[], 15_000);
    let breaks = BASE64.decode(data["breaks"].as_str().expect("base64")).expect("base64").len() / 4;
    let steps = BASE64.decode(data["steps"].as_str().expect("base64")).expect("base64");
    let absent = steps.chunks_exact(6).filter(|step| step[..2] == i16::MIN.to_le_bytes()).count();
    assert!(absent > 0 && breaks + absent == data["vehicles"].as_array().map_or(0, Vec::len), "{breaks} and {absent}");
}

#[test]
fn findings_keep_their_instant_or_are_counted_as_inexact() {
    let vehicles = 1000;
    let mut log = FlightLog::default();
    for k in 0..600_u32 {
        let at = Rows::from_fn(vehicles, |i, axis| if axis == 0 { f64::from(k) * 0.01 } else { 3.0 * i as f64 });
        take(&mut log, f64::from(k), at, None);
    }
    let moments: Vec<_> = (0..150).map(|k| violation(k, 4.0 * k as f64 - 3.0, 4.0 * k as f64 + 3.0)).collect();
    let (replay, data) = packed(&stage(vehicles), &log, &moments, PAGE_BYTES);
    let times = doubles(&data["times_s"]);
    let missing = moments.iter().filter(|of| !times.contains(&of.span.at_s.max(0.0))).count();
    assert_eq!((missing, replay.inexact), (0, 0), "{:?} and {:?}", replay.instants, replay.vehicles);
    // Findings beyond the list keep their instants while there is room; otherwise they count as inexact.
    let at = |k: u32| 0.2 * f64::from(k);
    let moments: Vec<_> = (0..300).map(|k| violation(0, at(k), at(k))).collect();
    let longer = self::log(2, 4000);
    let (replay, data) = packed(&stage(2), &longer, &moments, PAGE_BYTES);
    assert_eq!((replay.moments, replay.inexact), ([200, 300], 0), "{:?}", replay.instants);
    let alarms = data["verdicts"].as_array().expect("verdicts").iter().filter(|told| told[1] == true);
    let named: Vec<_> = alarms.map(|told| told[3].as_array().map_or(0, Vec::len)).collect();
    assert_eq!(named, [vec![0; 200], vec![1; 100]].concat(), "unlisted findings name their vehicles");
    let (replay, _) = packed(&stage(2), &longer, &moments, 36_000);
    assert!(replay.inexact > 0, "{:?}", replay.instants);
}

#[test]
fn unselected_vehicles_are_not_drawn() {
    let mut at = Rows::repeat(5000, f64::NAN);
    for k in [7, 4321] {
        set_row(&mut at, k, Vector3::zeros());
    }
    let log = FlightLog::recorded(vec![0.0, 1.0], vec![at.clone(), at], Slices::default(), 2);
    let (replay, data) = packed(&stage(5000), &log, &[], PAGE_BYTES);
    assert_eq!((replay.vehicles, &data["vehicles"]), ([2, 2], &serde_json::json!(["8", "4322"])));
}

#[test]
fn drawing_is_most_precise_at_the_gravest_finding() {
    let at = |x: f64| Rows::from_row_slice(&[5e5 + x, 4e6, 0.0, 5e5, 4e6, 0.0, 0.0, 0.0, 0.0]);
    let log = FlightLog::recorded(vec![0.0, 1.0], vec![at(1.0), at(0.35)], Slices::default(), 2);
    let (replay, data) = packed(&stage(3), &log, &[violation(0, 1.0, 1.0)], PAGE_BYTES);
    let numbers = |key: &str| serde_json::from_value::<Vec<f64>>(data[key].clone()).expect("numbers");
    assert_eq!(numbers("origin_m"), [5e5 + 0.35, 4e6, 0.0]);
    assert!(replay.rounding_m > 0.2, "far positions are rounded to single precision: {}", replay.rounding_m);
    assert!(packed(&stage(2), &two_instants(2), &[], PAGE_BYTES).0.rounding_m < 1e-3);
}

#[test]
fn unknown_radii_are_assumed_and_reported() {
    let unknown = |half_m: f64| Stage { radius_m: vec![None, Some(0.3)], shell_m: Some([half_m; 3]), ..stage(2) };
    for (half_m, drawn_m) in [(0.025, 0.025), (1.0, 0.1)] {
        let (replay, data) = packed(&unknown(half_m), &two_instants(2), &[], PAGE_BYTES);
        assert_eq!(data["radius_m"], serde_json::json!([drawn_m, 0.3]));
        assert_eq!(replay.unknown_radius, Some((1, drawn_m)));
    }
}

#[test]
fn findings_are_cut_to_the_flight_and_gaps_end_the_closest_pair() {
    let pair = ObjectPair::Vehicles(Pair::new(0, 1));
    let slice = |from_s: f64, to_s: f64| {
        let closest = Approach { pair, lower_m: 2.0, upper_m: 2.0, time_s: from_s, limit_m: 1.0 };
        Slice { from_s, to_s, closest, is_whole: true }
    };
    let mut near = Slices::default();
    for slice in [slice(0.0, 3.0), slice(5.0, 10.0)] {
        near.take(slice);
    }
    let at = |x: f64| Rows::from_row_slice(&[x, 0.0, 0.0, x + 2.0, 0.0, 0.0]);
    let log = FlightLog::recorded(vec![0.0, 10.0], vec![at(0.0), at(1.0)], near, 2);
    let (_, data) = packed(&stage(2), &log, &[violation(0, -5.0, 50.0)], PAGE_BYTES);
    let moment = &data["moments"][0];
    assert_eq!((&moment["from_s"], &moment["to_s"]), (&Value::from(0.0), &Value::from(10.0)));
    assert_eq!(doubles(&data["near_s"]), [0.0, 3.0_f64.next_up(), 5.0]);
    let who = BASE64.decode(data["near_who"].as_str().expect("base64")).expect("base64");
    assert_eq!(who, [0, 0, 1, 0, 255, 255, 255, 255, 0, 0, 1, 0]);
}

/// At the start the data name the pair that pictures show, not the closest pair of the time after it.
#[test]
fn the_closest_pair_at_the_start_is_that_of_the_pictures() {
    let mut log = FlightLog::default();
    for (time_s, pair) in [(0.0, Pair::new(0, 1)), (1.0, Pair::new(1, 2))] {
        let places_m = Rows::from_row_slice(&[-1.0 - time_s, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
        take(&mut log, time_s, places_m, Some(ClosestApproach { pair, separation_m: 1.0, time_s }));
    }
    let (_, data) = packed(&stage(3), &log, &[], PAGE_BYTES);
    let bytes = |key: &str| BASE64.decode(data[key].as_str().expect("text")).expect("base64");
    let who: Vec<_> = bytes("near_who").chunks_exact(2).map(|two| u16::from_le_bytes([two[0], two[1]])).collect();
    let from: Vec<_> =
        bytes("near_s").chunks_exact(8).map(|of| f64::from_le_bytes(of.try_into().expect("8"))).collect();
    assert_eq!(who[..2], [0, 1], "{who:?}");
    assert_eq!((who.last(), from[0]), (Some(&2), 0.0), "{who:?}");
    assert!(from[1..].iter().all(|&from_s| from_s > 0.0), "{from:?}");
}
