//! What a page holds of a flight: its limits, and what is never lost.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use nalgebra::Vector3;
use serde_json::Value;

use super::*;
use crate::audit::{Obstacle, Shape, Status};
use crate::record::{OwnedSample, Sink as _};
use crate::scenario::{Scenario, Source};
use crate::swarm::{ClosestApproach, Pair, Rows, Swarm, set_row};

const JUDGED: Judged = Judged { status: Status::Clear, limit: Some(1.0), unit: "m" };

fn stage(vehicles: usize) -> Stage {
    Stage {
        vehicles: (1..=vehicles).map(|number| number.to_string()).collect(),
        radius_m: vec![Some(0.2); vehicles],
        shell_m: Some([0.5; 3]),
        plan: None,
        obstacles: Vec::new(),
    }
}

/// Vehicles on a line, 2 m apart, that fly 1 m/s, at 10 Hz.
fn film(vehicles: usize, samples: usize) -> Film {
    let mut film = Film::new();
    for k in 0..samples {
        let time_s = 0.1 * k as f64;
        let mut positions_m = Rows::zeros(vehicles);
        (0..vehicles).for_each(|i| set_row(&mut positions_m, i, Vector3::new(time_s, 2.0 * i as f64, 1.0)));
        let pair = (vehicles > 1).then(|| Pair::new(0, 1));
        film.take(time_s, &positions_m, pair.map(|pair| ClosestApproach { pair, separation_m: 2.0, time_s }));
    }
    film
}

fn violation(vehicle: usize, from_s: f64, to_s: f64) -> Moment {
    let span = Span { from_s, to_s, at_s: f64::midpoint(from_s, to_s) };
    Moment { kind: Kind::Violation, vehicles: vec![vehicle], obstacle: None, span, said: "too near".to_owned() }
}

fn packed(stage: &Stage, film: &Film, moments: &[Moment], room_bytes: usize) -> (Replay, Value) {
    let replay = Replay::new(stage, film, moments, JUDGED, room_bytes).expect("a replay");
    assert!(replay.json().len() <= room_bytes, "{} of {room_bytes} bytes", replay.json().len());
    let data = serde_json::from_str(replay.json()).expect("JSON");
    (replay, data)
}

fn doubles(data: &Value) -> Vec<f64> {
    let bytes = BASE64.decode(data.as_str().expect("base64")).expect("base64");
    bytes.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().expect("eight"))).collect()
}

#[test]
fn a_short_flight_is_there_whole() {
    let (replay, data) = packed(&stage(3), &film(3, 100), &[violation(2, 3.0, 4.0)], PAGE_BYTES);
    assert_eq!((replay.instants(), replay.vehicles(), replay.moments()), ([100, 100], [3, 3], [1, 1]));
    let times: Vec<f64> = (0..100).map(|k| 0.1 * f64::from(k)).collect();
    assert_eq!(doubles(&data["times_s"]), times);
    assert_eq!(doubles(&data["near_m"]), [2.0; 100]);
    assert_eq!(data["moments"][0]["who"], serde_json::json!([2]));
    assert!(data["rounding_m"].as_f64() == Some(replay.rounding_m()) && replay.rounding_m() < 1e-5);
    assert!(data["whole"] == true && data["status"] == "clear");
    assert_eq!(packed(&stage(3), &film(3, 100), &[violation(2, 3.0, 4.0)], PAGE_BYTES).0, replay, "the same bytes");
}

#[test]
fn what_does_not_fit_is_thinned_and_every_sample_of_a_violation_stays() {
    let film = film(5, 40_000);
    for room_bytes in [PAGE_BYTES, 60_000, 30_000] {
        let (replay, data) = packed(&stage(5), &film, &[violation(3, 1234.5, 1236.0)], room_bytes);
        let [kept, samples] = replay.instants();
        assert!(samples == 40_000 && kept <= MOST_INSTANTS && kept > 150, "{kept} in {room_bytes}");
        let times = doubles(&data["times_s"]);
        let within = film.times_s.iter().filter(|&&time_s| (1234.4..1236.1).contains(&time_s));
        assert!(within.clone().count() >= 16 && within.clone().all(|time_s| times.contains(time_s)));
        assert_eq!((times.first(), times.last()), (film.times_s.first(), film.times_s.last()));
    }
    let none = Replay::new(&stage(5), &film, &[], JUDGED, 2000);
    assert_eq!(none, Err(NoReplay::NoRoom { room_bytes: 2000 }));
}

#[test]
fn of_a_hundred_thousand_vehicles_those_that_matter_are_drawn() {
    let vehicles = 100_000;
    let (replay, data) = packed(&stage(vehicles), &film(vehicles, 3), &[violation(77_777, 0.1, 0.1)], PAGE_BYTES);
    assert_eq!(replay.vehicles(), [MOST_VEHICLES, vehicles]);
    let names = data["vehicles"].as_array().expect("names");
    let at = names.iter().position(|name| name == "77778").expect("the one that violated");
    assert_eq!(data["moments"][0]["who"], serde_json::json!([at]));
    // The first of the two nearest is drawn, too; the second is among those left out.
    assert!(names.iter().any(|name| name == "1") && names.iter().all(|name| name != "2"));
}

#[test]
fn one_vehicle_one_sample_and_nobody() {
    let (replay, data) = packed(&stage(1), &film(1, 1), &[], PAGE_BYTES);
    assert_eq!((replay.instants(), doubles(&data["near_m"]).len()), ([1, 1], 0));
    assert_eq!(Replay::new(&stage(2), &Film::new(), &[], JUDGED, PAGE_BYTES), Err(NoReplay::Empty));
    let nowhere = Film::of(vec![0.0], vec![Rows::repeat(2, f64::NAN)], Nearest::default(), 1);
    assert_eq!(Replay::new(&stage(2), &nowhere, &[], JUDGED, PAGE_BYTES), Err(NoReplay::Empty));
    let far = Film::of(vec![0.5], vec![Rows::repeat(1, 2e9)], Nearest::default(), 1);
    let refused = Replay::new(&stage(1), &far, &[], JUDGED, PAGE_BYTES).expect_err("too far");
    assert_eq!(refused.to_string(), "vehicle 1 is beyond 1e9 m at 0.5 s");
}

#[test]
fn who_is_not_there_for_a_time_is_not_packed() {
    let at = |x: f64| Rows::from_row_slice(&[x, 0.0, 0.0, x, 5.0, 0.0]);
    let mut gone = at(1.0);
    gone.row_mut(1).fill(f64::NAN);
    let film = Film::of(vec![0.0, 1.0, 2.0], vec![at(0.0), gone, at(2.0)], Nearest::default(), 3);
    let (_, data) = packed(&stage(2), &film, &[], PAGE_BYTES);
    let steps = BASE64.decode(data["steps"].as_str().expect("base64")).expect("base64");
    let along_x: Vec<_> = steps.chunks_exact(6).map(|step| i16::from_le_bytes([step[0], step[1]])).collect();
    assert_eq!(along_x.iter().map(|&x| x == i16::MIN).collect::<Vec<_>>(), [false, false, false, true, false, false]);
    assert_eq!(i32::from(along_x[5]), 2 * i32::from(along_x[2]), "from where it was last seen");
}

#[test]
fn foreign_text_neither_ends_the_script_nor_fills_the_page() {
    let mut hostile = stage(2);
    hostile.vehicles = vec!["</script><script>alert(1)</script>".to_owned(), "ü".repeat(5_000_000)];
    hostile.obstacles = vec![Obstacle {
        name: "<!--".repeat(9000),
        shape: Shape::Ball { radius_m: 1.0 },
        clearance_m: None,
        path: vec![(0.0, Vector3::zeros())],
    }];
    let said = "</SCRIPT>".repeat(100_000);
    let moment = Moment { said, ..violation(0, 0.0, 0.1) };
    let (replay, data) = packed(&hostile, &film(2, 10), &[moment], PAGE_BYTES);
    assert!(!replay.json().contains('<') && replay.json().len() < 20_000);
    assert_eq!(data["vehicles"][0], "</script><script>alert(1)</script>");
    assert_eq!(data["vehicles"][1].as_str().map(|name| name.chars().count()), Some(41));
}

#[test]
fn memory_is_bounded_while_a_flight_is_taken_and_its_violations_stay() {
    let mut film = Film::new().within(200_000);
    let control = Rows::zeros(0);
    let pair = Pair::new(0, 1);
    let mut swarm = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 5.0, 0.0, 0.0]));
    for k in 0..50_000_u32 {
        let time_s = f64::from(k) / 100.0;
        if k == 20_000 {
            film.event(&crate::record::Event::ViolationBegan { pair, time_s }).expect("taken");
        }
        if k == 20_050 {
            film.event(&crate::record::Event::ViolationEnded { pair, time_s, min_m: 0.5 }).expect("taken");
        }
        swarm.positions_m[(0, 1)] = time_s;
        let sample = crate::record::Sample::new(time_s, k.into(), &swarm, &control);
        film.sample(&OwnedSample::from(&sample).as_sample()).expect("taken");
    }
    assert!(film.times_s.len() * 48 <= 200_000 && film.samples == 50_000, "{}", film.times_s.len());
    let even = film.even();
    let widest_s = even.windows(2).map(|two| film.times_s[two[1]] - film.times_s[two[0]]).fold(0.0, f64::max);
    assert!(even.len() > 1000 && widest_s < 500.0 / 1000.0, "as dense everywhere: {} and {widest_s} s", even.len());
    for k in 19_998..=20_052_u32 {
        assert!(film.times_s.contains(&(f64::from(k) / 100.0)), "{k}");
    }
}

#[test]
fn slots_links_and_reference_of_a_scenario_go_with_the_flight() {
    let scenario = Scenario::read(&Source::Builtin("pentagon".to_owned()), &[]).expect("built in");
    let mut film = Film::new();
    // Every vehicle in its slot, turned by a quarter and moved.
    let slots_m = &scenario.legs[0].formation.slots_m;
    let turned = Rows::from_fn(slots_m.nrows(), |i, axis| match axis {
        0 => 3.0 - slots_m[(i, 1)],
        1 => slots_m[(i, 0)],
        _ => slots_m[(i, 2)],
    });
    film.take(0.0, &turned, None);
    let (_, data) = packed(&Stage::of(&scenario, Vec::new()), &film, &[], PAGE_BYTES);
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
