//! Curves of planners: B-splines, MINCO trajectories and polynomials in bags, and tables of Bezier curves.

use std::fs;

use nalgebra::Vector3;
use serde_json::{Value, json};
use tautline_core::track::{Item, Piece, PlanEnd};
use tautline_recordings::read::{self, Format, LivePlan, ReadError, ReadOptions};

use crate::messages::{Message, SEC, Stamp, cdr, header, mcap_of, read_bytes, whole};
use crate::recording::{Whole, assert_refused};

const B_SPLINE: &str = "traj_utils/msg/Bspline";
const MINCO: &str = "traj_utils/msg/MINCOTraj";
const POLYNOMIALS: &str = "traj_utils/msg/PolyTraj";
const TOPIC: &str = "/drone_0_planning/bspline";
const BROADCAST: &str = "/planning/broadcast_traj_send";
const REST: [f32; 3] = [0.0; 3];

type Bspline = (i32, i32, i64, Stamp, Vec<f64>, Vec<[f64; 3]>, Vec<f64>, f64);
type Minco = (i16, i32, Stamp, f32, u8, [[f32; 3]; 6], [Vec<f32>; 3], Vec<f32>);

type PolyTraj = (i16, i32, Stamp, u8, Vec<f32>, Vec<f32>, Vec<f32>, Vec<f32>);

/// Returns two pieces of 1 s and 2 s from (0, 0, 1): x = t, y = t^2 until (1, 1, 1), then a line along y at 2 m/s.
fn polynomials(drone: i16) -> PolyTraj {
    let piece = |powers: [f32; 3]| [0.0, 0.0, 0.0, powers[2], powers[1], powers[0]];
    let both = |first, second| [piece(first), piece(second)].concat();
    let x = both([0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
    let y = both([0.0, 0.0, 1.0], [1.0, 2.0, 0.0]);
    (drone, 1, (SEC, 500_000_000), 5, x, y, both([1.0, 0.0, 0.0], [1.0, 0.0, 0.0]), vec![1.0, 2.0])
}

fn of_polynomials(message: &PolyTraj) -> Message {
    (TOPIC, POLYNOMIALS, "cdr", 7, cdr(message, true))
}

/// Returns a uniform cubic B-spline with seven points: four intervals of 1 s, along x at 1 m/s.
fn spline(drone: i32, nanosec: u32, y: f64) -> Bspline {
    let points = (0..7).map(|k| [f64::from(k), y, 1.0]).collect();
    let knots = (0..11).map(|k| f64::from(k) - 3.0).collect();
    (drone, 3, 1, (SEC, nanosec), knots, points, vec![], 0.0)
}

/// Returns a trajectory of 2 s from rest at the origin through (1, y, 1) to rest at (2, 0, 1).
fn minco(drone: i16, y: f32) -> Minco {
    let states = [[0.0, 0.0, 1.0], REST, REST, [2.0, 0.0, 1.0], REST, REST];
    (drone, 1, (SEC, 500_000_000), 0.5, 5, states, [vec![1.0], vec![y], vec![1.0]], vec![1.0, 1.0])
}

fn of(message: &Bspline) -> Message {
    (TOPIC, B_SPLINE, "cdr", 7, cdr(message, true))
}

fn of_minco(message: &Minco) -> Message {
    (BROADCAST, MINCO, "cdr", 7, cdr(message, true))
}

fn topics(topics: &[&str]) -> ReadOptions {
    ReadOptions { topics: topics.iter().map(|topic| (*topic).to_owned()).collect(), ..ReadOptions::default() }
}

fn refused(messages: &[Message], options: &ReadOptions) -> ReadError {
    read_bytes("plan.mcap", &mcap_of(messages), options).expect_err("refused")
}

fn piece(item: &Item) -> &Piece {
    match item {
        Item::Piece(piece) => piece,
        Item::Sample(sample) => panic!("{sample:?}"),
    }
}

fn pieces(found: &Whole) -> Vec<&Piece> {
    found.items.iter().map(piece).collect()
}

/// Returns the position of a vehicle at a time, on its last piece that has begun.
fn position(found: &Whole, name: &str, time_s: f64) -> [f64; 3] {
    let vehicle = found.vehicles.iter().position(|known| known == name).expect("a vehicle");
    let mut of_vehicle = pieces(found).into_iter().filter(|piece| piece.vehicle == vehicle);
    let begun = of_vehicle.rfind(|piece| piece.from_s <= time_s).expect("a piece");
    assert!(time_s <= begun.to_s, "{time_s} {begun:?}");
    let powers = begun.coefficients.iter().rev();
    powers.fold(Vector3::zeros(), |sum, c| sum * (time_s - begun.from_s) + c).into()
}

fn assert_near(found: [f64; 3], expected: [f64; 3]) {
    let off = (Vector3::from(found) - Vector3::from(expected)).norm();
    assert!(off < 1e-9, "{found:?} {expected:?}");
}

#[test]
fn a_b_spline_is_flown_until_the_next_one_starts_and_then_held() {
    // The first curve would last from 0.25 s to 4.25 s; the second starts at 2.25 s, 1 m to the side.
    let mut second = spline(4, 250_000_000, 1.0);
    second.3.0 += 2;
    // Its points begin where the first curve is then.
    second.5.iter_mut().for_each(|point| point[0] += 2.0);
    let other = spline(7, 0, 5.0);
    for little in [true, false] {
        let message = |message: &Bspline| (TOPIC, B_SPLINE, "cdr", 7, cdr(message, little));
        // The order of the messages does not matter.
        let found =
            whole("plan.mcap", &mcap_of(&[message(&second), message(&spline(4, 250_000_000, 0.0)), message(&other)]));
        assert_eq!(found.vehicles, ["4", "7"]);
        assert_eq!((found.clock.unit, found.clock.epoch_ns), ("ns", i64::from(SEC) * 1_000_000_000));
        // Control points on a line: the curve begins at the second of them.
        for (time_s, expected) in [
            (0.25, [1.0, 0.0, 1.0]),
            (1.75, [2.5, 0.0, 1.0]),
            (2.25, [3.0, 1.0, 1.0]),
            (5.0, [5.75, 1.0, 1.0]),
            (6.25, [7.0, 1.0, 1.0]),
        ] {
            assert_near(position(&found, "4", time_s), expected);
        }
        // The other drone holds its last point from 4 s to the end of all curves.
        assert_near(position(&found, "7", 4.0), [5.0, 5.0, 1.0]);
        assert_near(position(&found, "7", 6.25), [5.0, 5.0, 1.0]);
        let cut: Vec<_> =
            pieces(&found).into_iter().filter(|piece| piece.vehicle == 0).map(|piece| piece.to_s).collect();
        assert_eq!(cut, [1.25, 2.25, 3.25, 4.25, 5.25, 6.25], "parts after the second start are not flown");
        let has = |words: &str| found.notes.iter().any(|note| note.contains(words));
        assert!(has("3 curves of planners of 2 drones") && has("holds the last point"), "{:?}", found.notes);
        assert!(has("the largest jump of a curve is 1.0000 m, of `4` at 2.25 s"), "{:?}", found.notes);
    }
}

#[test]
fn a_minco_trajectory_passes_its_points_and_ends_unknown() {
    let mut next = minco(2, 0.0);
    next.2 = (SEC + 5, 0);
    let unknown = ReadOptions { plan_end: Some(PlanEnd::Unknown), ..ReadOptions::default() };
    let bytes = mcap_of(&[of_minco(&minco(2, 0.5)), of_minco(&next)]);
    let found = read_bytes("plan.mcap", &bytes, &unknown).expect("read");
    assert_eq!(found.assumed, Some("plans are published at their starts".to_owned()), "a declared end");
    let held = whole("plan.mcap", &bytes);
    assert_near(position(&held, "2", 4.0), [2.0, 0.0, 1.0]);
    let assumed = held.assumed.expect("an assumption");
    assert!(assumed.ends_with("after the end of its plan each vehicle holds the last point"), "{assumed}");
    for (time_s, expected) in [(0.5, [0.0, 0.0, 1.0]), (1.5, [1.0, 0.5, 1.0]), (2.5, [2.0, 0.0, 1.0])] {
        assert_near(position(&found, "2", time_s), expected);
    }
    let spans: Vec<_> = pieces(&found).into_iter().map(|piece| (piece.from_s, piece.to_s)).collect();
    assert_eq!(spans, [(0.5, 1.5), (1.5, 2.5), (5.0, 6.0), (6.0, 7.0)], "no piece between 2.5 s and 5 s");
    assert!(found.notes.iter().any(|note| note.contains("is not known")), "{:?}", found.notes);
}

#[test]
fn polynomials_have_their_highest_power_first_and_end_unknown() {
    let mut next = polynomials(2);
    next.2 = (SEC + 5, 0);
    let read = |plan_end| {
        let bytes = mcap_of(&[of_polynomials(&polynomials(2)), of_polynomials(&next)]);
        read_bytes("plan.mcap", &bytes, &ReadOptions { plan_end: Some(plan_end), ..ReadOptions::default() })
    };
    // The first curve ends at 3.5 s with 2 m/s along y.
    let continued = read(PlanEnd::Continue).expect("read");
    assert_near(position(&continued, "2", 4.5), [1.0, 7.0, 1.0]);
    let found = read(PlanEnd::Unknown).expect("read");
    for (time_s, expected) in
        [(0.5, [0.0, 0.0, 1.0]), (1.0, [0.5, 0.25, 1.0]), (1.5, [1.0, 1.0, 1.0]), (3.5, [1.0, 5.0, 1.0])]
    {
        assert_near(position(&found, "2", time_s), expected);
    }
    let spans: Vec<_> = pieces(&found).into_iter().map(|piece| (piece.from_s, piece.to_s)).collect();
    assert_eq!(spans, [(0.5, 1.5), (1.5, 3.5), (5.0, 6.0), (6.0, 8.0)], "no piece between 3.5 s and 5 s");
    assert!(found.notes.iter().any(|note| note.contains("is not known")), "{:?}", found.notes);
    // Another message of the planner with the same start contradicts the curve.
    let error = refused(&[of_polynomials(&polynomials(2)), of_minco(&minco(2, 0.0))], &ReadOptions::default());
    assert_refused(&error, "recording/duplicate-row", &format!("curve 2 on topic `{BROADCAST}`"));
    let one = read_bytes(
        "plan.mcap",
        &mcap_of(&[of_polynomials(&polynomials(2)), of_minco(&minco(2, 0.0))]),
        &topics(&[TOPIC]),
    );
    assert_near(position(&one.expect("read"), "2", 1.0), [0.5, 0.25, 1.0]);
}

#[test]
fn repeated_curves_are_read_once_and_contradictory_ones_refused() {
    let one = of(&spline(1, 0, 0.0));
    let copy = ("/broadcast_bspline", B_SPLINE, "cdr", 9, cdr(&spline(1, 0, 0.0), true));
    let found = whole("plan.mcap", &mcap_of(&[one.clone(), copy]));
    assert_eq!(found.items, whole("plan.mcap", &mcap_of(std::slice::from_ref(&one))).items);
    assert!(found.notes.iter().any(|note| note.starts_with("1 curve is repeated")), "{:?}", found.notes);
    let error = refused(&[one, of(&spline(1, 0, 0.1))], &ReadOptions::default());
    assert_refused(&error, "recording/duplicate-row", &format!("curve 2 on topic `{TOPIC}`"));
}

/// Returns a position at (1, 2, 3) on a topic, with a stamp in the second of the curves.
fn odometry(topic: &'static str, nanosec: u32) -> Message {
    let pose = (([1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 1.0]), [[0.0; 6]; 6]);
    let message = (header(nanosec), "base_link", pose, ([[0.0; 3]; 2], [[0.0; 6]; 6]));
    (topic, "nav_msgs/msg/Odometry", "cdr", 7, cdr(&message, true))
}

#[test]
fn curves_beside_positions_are_plans_of_the_vehicles_with_their_numbers() {
    let curves = [of(&spline(12, 250_000_000, 0.0)), of(&spline(1, 0, 3.0))];
    let flights = ["/uav2_1/odom", "/uav2_12/odom"].map(|topic| [odometry(topic, 0), odometry(topic, 200_000_000)]);
    let bytes = mcap_of(&[&curves[..], &flights.concat()].concat());
    let found = whole("plan.mcap", &bytes);
    assert_eq!(
        (found.samples().len(), &found.vehicles[..]),
        (4, &["/uav2_1/odom".to_owned(), "/uav2_12/odom".to_owned()][..])
    );
    let (published, assumed) = plans(&bytes);
    let name = |vehicle: &str| format!("/uav2_{vehicle}/odom");
    assert_eq!(published, [(0.0, name("1"), 0.0, 4.0), (0.25, name("12"), 0.25, 4.25)]);
    let numbers = "plans have the frame and the clock of the positions, \
                   and belong to the vehicles with their numbers in the names";
    assert!(assumed.contains(&numbers.to_owned()), "{assumed:?}");
    // A vehicle without plans is no fault. A number in no name, in two names, and in all names are.
    let other = [odometry("/uav2_7/odom", 0), odometry("/uav2_7/odom", 200_000_000)];
    whole("plan.mcap", &mcap_of(&[&curves[..], &flights.concat(), &other].concat()));
    let ambiguous = |drones: &[i32], topics: &[&'static str]| {
        let curves = drones.iter().map(|drone| of(&spline(*drone, 0, f64::from(*drone))));
        let flights = topics.iter().flat_map(|topic| [odometry(topic, 0), odometry(topic, 200_000_000)]);
        let messages: Vec<_> = curves.chain(flights).collect();
        let read = read_bytes("plan.mcap", &mcap_of(&messages), &ReadOptions::default());
        read.inspect_err(|error| assert_refused(error, "recording/ambiguous-topics", "")).is_err()
    };
    assert!(ambiguous(&[3], &["/uav2_1/odom", "/uav2_12/odom"]));
    assert!(ambiguous(&[2], &["/uav2_1/odom", "/uav2_12/odom"]), "a number in all names");
    assert!(ambiguous(&[2, 3], &["/drone_3/vins2/odom", "/drone_5/odom"]), "two drones, one vehicle");
    assert!(ambiguous(&[2], &["/drone_3/odom2", "/drone_5/odom"]), "a number in one name only");
    assert!(ambiguous(&[1], &["/from1to2/odom", "/from2to1/odom"]), "two positions");
    assert!(!ambiguous(&[1, 2, 3], &["/agent1/lidar3/odom", "/agent2/lidar3/odom", "/agent3/lidar3/odom"]));
    assert!(!ambiguous(&[1], &["/drone_1/odom", "/human/odom"]), "a name without a number");
}

#[test]
fn curves_beside_positions_without_numbers_need_a_topic() {
    let both = [of(&spline(1, 0, 0.0)), odometry("/odom", 0)];
    assert_refused(&refused(&both, &ReadOptions::default()), "recording/ambiguous-topics", "");
    assert_refused(&refused(&both, &topics(&[TOPIC, "/odom"])), "recording/ambiguous-topics", "");
    assert_refused(&refused(&both, &topics(&["/plan"])), "recording/unknown-topic", "");
    let read = |topic| read_bytes("plan.mcap", &mcap_of(&both), &topics(&[topic])).expect("read");
    assert_eq!(read(TOPIC).vehicles, ["1"]);
    assert_eq!(read("/odom").samples().len(), 1);
    let ended = ReadOptions { plan_end: Some(PlanEnd::Hold), ..topics(&["/odom"]) };
    assert_refused(&refused(&both, &ended), "recording/unused-option", "");
    let framed = ReadOptions { frame: Some("map".to_owned()), ..ReadOptions::default() };
    assert_refused(&refused(&both[..1], &framed), "recording/unused-option", "");
}

/// Change of a valid message.
type Spoil<T> = fn(&mut T);

#[test]
fn wrong_curves_name_the_field_and_its_value() {
    let of_spline: [(Spoil<Bspline>, &str, &str); 11] = [
        (
            |m| m.3.1 = 1_000_000_000,
            "recording/time-format",
            "start_time.nanosec: must be below 1000000000, got 1000000000",
        ),
        (
            |m| (m.1, m.5) = (1, vec![[0.0; 3]]),
            "recording/knots",
            "pos_pts: a curve of order 1 needs more than 1 point, got 1",
        ),
        (|m| m.1 = 0, "recording/degree", "order: must be 1 to 15, got 0"),
        (|m| m.1 = 16, "recording/degree", "order: must be 1 to 15, got 16"),
        (|m| m.4.truncate(10), "recording/knots", "knots: 7 points of order 3 need 11 knots, got 10"),
        (|m| m.5.truncate(3), "recording/knots", "pos_pts: a curve of order 3 needs more than 3 points, got 3"),
        (|m| m.4[5] = 0.5, "recording/knots", "knots[5]: must not be below the knot before it, 1, got 0.5"),
        (|m| m.4.fill(1.0), "recording/duration", "knots: the curve must end after it starts, got 1 and 1"),
        (|m| m.4[2] = f64::NAN, "recording/not-finite", "knots[2]: must be a finite number, got NaN"),
        (|m| m.5[1][2] = f64::INFINITY, "recording/not-finite", "pos_pts[5]: must be a finite number, got inf"),
        (|m| (m.5[1][2], m.5[2][2]) = (f64::MAX, f64::MIN), "recording/overflow", ""),
    ];
    for (spoil, code, problem) in of_spline {
        let mut message = spline(1, 0, 0.0);
        spoil(&mut message);
        let error = refused(&[of(&message)], &ReadOptions::default());
        let place = if code == "recording/overflow" {
            format!("the curve of drone 1 that starts at {SEC}000000000 ns")
        } else {
            format!("curve 1 on topic `{TOPIC}`")
        };
        assert_refused(&error, code, &place);
        assert!(error.to_string().contains(problem), "{error}");
    }
    let of_trajectory: [(Spoil<Minco>, &str, &str); 9] = [
        (|m| m.2.1 = u32::MAX, "recording/time-format", "start_time.nanosec: must be below 1000000000, got 4294967295"),
        (|m| m.7.truncate(1), "recording/field-count", "inner_x: 1 duration needs one number less, got 1"),
        (|m| m.4 = 7, "recording/degree", "order: must be 5, got 7"),
        (|m| m.6[1].clear(), "recording/field-count", "inner_y: 2 durations need one number less, got 0"),
        (|m| m.7.clear(), "recording/field-count", "duration: a curve needs at least one piece, got none"),
        (|m| m.7[1] = 0.0, "recording/duration", "duration[1]: must be positive, got 0 s"),
        (|m| m.7[0] = -1.0, "recording/duration", "duration[0]: must be positive, got -1 s"),
        (|m| m.7[0] = f32::NAN, "recording/not-finite", "duration[0]: must be a finite number, got NaN"),
        (|m| m.5[4][1] = f32::NAN, "recording/not-finite", "end_v[1]: must be a finite number, got NaN"),
    ];
    for (spoil, code, problem) in of_trajectory {
        let mut message = minco(1, 0.0);
        spoil(&mut message);
        let error = refused(&[of_minco(&message)], &ReadOptions::default());
        assert_refused(&error, code, &format!("curve 1 on topic `{BROADCAST}`"));
        assert!(error.to_string().contains(problem), "{error}");
    }
    let of_pieces: [(Spoil<PolyTraj>, &str, &str); 9] = [
        (
            |m| m.2.1 = 4_000_000_000,
            "recording/time-format",
            "start_time.nanosec: must be below 1000000000, got 4000000000",
        ),
        (|m| m.7.truncate(1), "recording/field-count", "coef_x: 1 duration needs 6 numbers, got 12"),
        (|m| m.3 = 7, "recording/degree", "order: must be 5, got 7"),
        (|m| m.5.truncate(11), "recording/field-count", "coef_y: 2 durations need 12 numbers, got 11"),
        (|m| m.7.clear(), "recording/field-count", "duration: a curve needs at least one piece, got none"),
        (|m| m.7[1] = 0.0, "recording/duration", "duration[1]: must be positive, got 0 s"),
        (|m| m.7[0] = f32::INFINITY, "recording/not-finite", "duration[0]: must be a finite number, got inf"),
        (|m| m.6[11] = f32::NAN, "recording/not-finite", "coef_z[11]: must be a finite number, got NaN"),
        (|m| m.4.clear(), "recording/field-count", "coef_x: 2 durations need 12 numbers, got 0"),
    ];
    for (spoil, code, problem) in of_pieces {
        let mut message = polynomials(1);
        spoil(&mut message);
        let error = refused(&[of_polynomials(&message)], &ReadOptions::default());
        assert_refused(&error, code, &format!("curve 1 on topic `{TOPIC}`"));
        assert!(error.to_string().contains(problem), "{error}");
    }
    // The last nanosecond of a second is a start.
    let mut last = polynomials(1);
    last.2.1 = 999_999_999;
    let found = whole("plan.mcap", &mcap_of(&[of_polynomials(&last)]));
    assert_eq!(piece(&found.items[0]).from_s, 0.999_999_999);
    let cut = (TOPIC, B_SPLINE, "cdr", 7, cdr(&spline(1, 0, 0.0), true)[..60].to_vec());
    assert_refused(
        &refused(&[cut], &ReadOptions::default()),
        "recording/damaged",
        &format!("curve 1 on topic `{TOPIC}`"),
    );
}

#[test]
fn a_list_of_b_splines_is_read_to_its_end() {
    // The first element has angles, the second one is of a drone that has published nothing.
    let mut turning = spline(4, 0, 0.0);
    (turning.6, turning.7) = (vec![1.0, 2.0], 0.1);
    let silent = (5, 0, 0, (0, 0), vec![], vec![], vec![], 0.0);
    let list = cdr(&(3, vec![turning, silent, spline(7, 0, 5.0)]), true);
    let found = whole("plan.mcap", &mcap_of(&[("/swarm_trajs", "traj_utils/msg/MultiBsplines", "cdr", 7, list)]));
    assert_eq!(found.vehicles, ["4", "7"]);
    assert_near(position(&found, "7", 1.0), [2.0, 5.0, 1.0]);
}

/// Returns a B-spline in the JSON of rosbridge.
fn spline_in_json(drone: i32) -> Value {
    let points: Vec<_> = (0..7).map(|k| json!({ "x": k, "y": 2, "z": 1 })).collect();
    let knots: Vec<_> = (0..11).map(|k| f64::from(k) - 3.0).collect();
    json!({
        "drone_id": drone, "order": 3, "traj_id": 1, "start_time": { "sec": SEC, "nanosec": 250_000_000 },
        "knots": knots, "pos_pts": points, "yaw_pts": [], "yaw_dt": 0.0,
    })
}

fn minco_in_json() -> Value {
    json!({
        "drone_id": 2, "traj_id": 1, "start_time": { "sec": SEC, "nanosec": 500_000_000 }, "des_clearance": 0.5,
        "order": 5, "start_p": [0, 0, 1], "start_v": [0, 0, 0], "start_a": [0, 0, 0], "end_p": [2, 0, 1],
        "end_v": [0, 0, 0], "end_a": [0, 0, 0], "inner_x": [1], "inner_y": [0.5], "inner_z": [1],
        "duration": [1, 1],
    })
}

fn polynomials_in_json() -> Value {
    json!({
        "drone_id": 2, "traj_id": 1, "start_time": { "sec": SEC, "nanosec": 500_000_000 }, "order": 5,
        "coef_x": [0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1], "coef_y": [0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 2, 1],
        "coef_z": [0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1], "duration": [1, 2],
    })
}

fn live(message: &Value) -> Vec<LivePlan> {
    read::live_plans(message).expect("a message of a planner").expect("a valid one")
}

/// Asserts that a message in JSON has the plan of the same message in a bag.
fn assert_same(message: &Value, bag: &[Message]) {
    let found = whole("plan.mcap", &mcap_of(bag));
    let recorded = pieces(&found);
    let plans = live(message);
    let [plan] = &plans[..] else { panic!("{plans:?}") };
    assert_eq!(found.vehicles, [plan.drone.to_string()]);
    let start_s = (plan.start_ns - found.clock.epoch_ns) as f64 * 1e-9;
    for (own, other) in plan.pieces.iter().zip(&recorded) {
        assert!((own.from_s + start_s - other.from_s).abs() < 1e-12 && own.coefficients == other.coefficients);
        assert!((own.to_s + start_s - other.to_s).abs() < 1e-12, "{own:?} {other:?}");
    }
    assert_eq!(plan.pieces.len(), recorded.len());
}

#[test]
fn json_of_a_live_source_has_the_plans_of_the_same_messages_in_a_bag() {
    assert_same(&spline_in_json(4), &[of(&spline(4, 250_000_000, 2.0))]);
    assert_same(&minco_in_json(), &[of_minco(&minco(2, 0.5))]);
    assert_same(&polynomials_in_json(), &[of_polynomials(&polynomials(2))]);
    assert!(live(&spline_in_json(4))[0].is_held && !live(&minco_in_json())[0].is_held);
    // ROS 1 has other names of times.
    let mut first = spline_in_json(4);
    first["start_time"] = json!({ "secs": SEC, "nsecs": 250_000_000 });
    assert_eq!(live(&first), live(&spline_in_json(4)));
    // In a list, a drone that has published nothing has no points.
    let mut silent = spline_in_json(5);
    (silent["knots"], silent["pos_pts"]) = (json!([]), json!([]));
    let list = json!({ "drone_id_from": 1, "traj": [spline_in_json(4), silent, spline_in_json(7)] });
    assert_eq!(live(&list).iter().map(|plan| plan.drone).collect::<Vec<_>>(), [4, 7]);
    for other in [json!({}), json!([]), json!(null), json!({ "traj": [] }), json!({ "pose": { "position": 1 } })] {
        assert_eq!(read::live_plans(&other), None, "{other}");
    }
}

/// Valid message, path of a wrong value, the value, and the problem.
type JsonSpoil = (fn() -> Value, &'static str, Value, &'static str);

#[test]
fn wrong_fields_in_json_are_errors() {
    let list = json!({ "drone_id_from": 1, "traj": [spline_in_json(4)] });
    let mut all = 0;
    for message in [spline_in_json(4), minco_in_json(), polynomials_in_json(), list] {
        let fields: Vec<_> = message.as_object().expect("an object").keys().cloned().collect();
        for field in fields {
            let wrongs = [Some(json!("word")), Some(json!({})), Some(json!([[1]])), Some(json!(1e300)), None];
            for wrong in wrongs {
                let mut spoiled = message.clone();
                match wrong {
                    Some(wrong) => spoiled[&field] = wrong,
                    None => drop(spoiled.as_object_mut().expect("an object").remove(&field)),
                }
                // A field by which messages are recognised may be missing; a number of any size may be an angle.
                if let Some(Ok(plans)) = read::live_plans(&spoiled) {
                    assert!(["yaw_dt", "des_clearance"].contains(&field.as_str()), "{field}: {plans:?}");
                }
                all += 1;
            }
        }
    }
    assert_eq!(all, 5 * (8 + 15 + 8 + 2));
    let spoils: [JsonSpoil; 8] = [
        (|| spline_in_json(4), "/order", json!(16), "order: must be 1 to 15, got 16"),
        (|| spline_in_json(4), "/start_time/nanosec", json!(1_000_000_000), "start_time.nanosec: must be below"),
        (|| spline_in_json(4), "/pos_pts/1/x", json!(null), "invalid type: null"),
        (|| spline_in_json(4), "/knots/5", json!(0.5), "knots[5]: must not be below the knot before it"),
        (minco_in_json, "/duration/1", json!(0), "duration[1]: must be positive, got 0 s"),
        (minco_in_json, "/end_v/1", json!(1e300), "end_v[1]: must be a finite number, got inf"),
        (polynomials_in_json, "/order", json!(7), "order: must be 5, got 7"),
        (polynomials_in_json, "/coef_y", json!([1]), "coef_y: 2 durations need 12 numbers, got 1"),
    ];
    for (message, path, wrong, problem) in spoils {
        let mut spoiled = message();
        *spoiled.pointer_mut(path).expect(path) = wrong;
        let error = read::live_plans(&spoiled).expect("a message of a planner").expect_err(path);
        assert!(error.contains(problem), "{path}: {error}");
    }
    // Numbers whose coefficients overflow.
    let mut large = spline_in_json(4);
    (large["pos_pts"][1]["x"], large["pos_pts"][2]["x"]) = (json!(f64::MAX), json!(f64::MIN));
    assert_eq!(read::live_plans(&large), Some(Err("a value exceeds the range of numbers".to_owned())));
}

/// Quarter of a parabola: x = t, y = t^2 over 2 s, as a Bezier curve of degree 2.
const PARABOLA: &str = "#duration,p0x,p0y,p0z,p1x,p1y,p1z,p2x,p2y,p2z\n2,0,0,1,1,0,1,2,4,1\n1,2,4,1,2.5,4,1,3,4,1\n";

#[test]
fn bezier_curves_have_the_motion_of_their_points() {
    let found = whole("cf1.csv", PARABOLA.as_bytes());
    assert_eq!((&*found.vehicles[0], found.items.len()), ("cf1", 2));
    for (time_s, expected) in [(0.0, [0.0, 0.0, 1.0]), (1.5, [1.5, 2.25, 1.0]), (2.5, [2.5, 4.0, 1.0])] {
        assert_near(position(&found, "cf1", time_s), expected);
    }
    let plane = whole("cf2.csv", b"duration,p0x,p0y,p1x,p1y\n2,0,0,2,4\n# end\n");
    assert_near(position(&plane, "cf2", 1.0), [1.0, 2.0, 0.0]);
    assert!(plane.notes.iter().any(|note| note.contains("in the plane")), "{:?}", plane.notes);
    // Points of degree 7 on a line, in the plane and in space.
    for (axes, header) in
        [(2, "#duration,p0x,p0y,..."), (3, "#duration,p0x,p0y,..."), (3, "# duration, p0x, p0y, p0z, ...")]
    {
        let point = |k: i32| format!(",{k},0,1")[..2 * axes + k.to_string().len() - 1].to_owned();
        let text = format!("{header}\n7{}\n", (0..8).map(point).collect::<String>());
        assert_near(
            position(&whole("cf3.csv", text.as_bytes()), "cf3", 2.0),
            [2.0, 0.0, f64::from(u8::from(axes == 3))],
        );
    }
}

#[test]
fn a_folder_holds_a_bezier_curve_of_each_vehicle() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["cf1.csv", "cf2.csv"] {
        fs::write(folder.path().join(name), PARABOLA).expect("written");
    }
    let moved = ReadOptions { starts: [("cf2".to_owned(), [0.0, 5.0, 0.0])].into(), ..ReadOptions::default() };
    let found = Whole::read(folder.path(), &moved).expect("read");
    assert_eq!(found.vehicles, ["cf1", "cf2"]);
    assert_near(position(&found, "cf2", 2.0), [2.0, 9.0, 1.0]);
    fs::write(folder.path().join("cf2.csv"), "duration,p0x,p0y\n1,0,0\n").expect("written");
    let flat = read::open(folder.path(), &ReadOptions::default()).expect("read");
    assert!(flat.is_planar());
    let found = Whole::read(folder.path(), &ReadOptions::default()).expect("read");
    assert_near(position(&found, "cf1", 0.0), [0.0; 3]);
}

#[test]
fn wrong_bezier_tables_name_line_and_value() {
    let header = "duration,p0x,p0y,p1x,p1y";
    for (text, code, place) in [
        ("duration,p0x,p0y,p1y,p1x\n1,0,0,0,0\n".to_owned(), "recording/missing-column", "line 1"),
        ("duration,p0x,p0y,p1x\n1,0,0,0\n".to_owned(), "recording/missing-column", "line 1"),
        ("duration,p0x,p0y,p0yaw\n1,0,0,0\n".to_owned(), "recording/missing-column", "line 1"),
        (format!("{header}\n"), "recording/empty", ""),
        (format!("{header}\n1,0,0,0\n"), "recording/field-count", "line 2"),
        (format!("{header}\n0,0,0,0,0\n"), "recording/duration", "line 2"),
        (format!("{header}\n1,0,0,0,0\n-1,0,0,0,0\n"), "recording/duration", "line 3"),
        (format!("{header}\n1,0,0,0,nan\n"), "recording/not-finite", "line 2"),
        (format!("{header}\ninf,0,0,0,0\n"), "recording/not-finite", "line 2"),
        (format!("{header}\n1,0,0,0,a\n"), "recording/not-a-number", "line 2"),
        ("#duration,p0x,p0y,...\n1,0,0,0,0\n".to_owned(), "recording/ambiguous-layout", "line 2"),
        ("#duration,p0x,p0y,p0z,...\n1,0,0,0,0\n".to_owned(), "recording/field-count", "line 2"),
        (format!("#duration,p0x,p0y,p0z,...\n1{}\n", ",0".repeat(51)), "recording/degree", "line 2"),
    ] {
        let error = read_bytes("cf1.csv", text.as_bytes(), &ReadOptions::default()).expect_err(&text);
        assert_refused(&error, code, place);
    }
    let forced = ReadOptions { format: Some(Format::BEZIER), ..ReadOptions::default() };
    let error = read_bytes("cf1.csv", b"t,x,y,z\n0,1,2,3\n", &forced).expect_err("no header");
    assert_refused(&error, "recording/no-header", "line 1");
}

/// Instant of publication, vehicle, and start and end of a plan.
type Published = (f64, String, f64, f64);

/// Returns the plans of a recording, and the clauses of its assumptions.
fn plans(bytes: &[u8]) -> (Vec<Published>, Vec<String>) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("plan.mcap");
    fs::write(&path, bytes).expect("written");
    let tracks = read::open(&path, &ReadOptions::default()).expect("read");
    let ends = |pieces: &[Piece]| (pieces[0].from_s, pieces[pieces.len() - 1].to_s);
    let all = tracks.plans().iter().map(|plan| {
        let (from_s, to_s) = ends(&plan.pieces);
        (plan.published_s, tracks.vehicles()[plan.vehicle].clone(), from_s, to_s)
    });
    let assumed = tracks.facts().iter().filter(|fact| fact.is_assumption()).map(ToString::to_string);
    (all.collect(), assumed.collect())
}

#[test]
fn plans_are_published_at_their_log_times_or_at_their_starts() {
    let second_ns = 1_000_000_000;
    let start_ns = u64::try_from(SEC).expect("after 1970") * second_ns;
    let at = |message: &Bspline, log_ns| (TOPIC, B_SPLINE, "cdr", log_ns, cdr(message, true));
    let mut replanned = spline(4, 250_000_000, 1.0);
    replanned.3.0 += 2;
    // The whole first curve is a plan, although it is flown until 2.25 s only.
    let logged = [at(&replanned, start_ns + 2 * second_ns), at(&spline(4, 250_000_000, 0.0), start_ns + second_ns / 2)];
    let (found, assumed) = plans(&mcap_of(&logged));
    assert_eq!(found, [(0.5, "4".to_owned(), 0.25, 4.25), (2.0, "4".to_owned(), 2.25, 6.25)]);
    assert_eq!(assumed, Vec::<String>::new(), "log times are recorded, and EGO-Planner holds the last point");
    // The log times of a recorder are those of another clock than the simulated one.
    let (found, assumed) = plans(&mcap_of(&[at(&replanned, 7), at(&spline(4, 250_000_000, 0.0), 9)]));
    assert_eq!(found, [(0.25, "4".to_owned(), 0.25, 4.25), (2.25, "4".to_owned(), 2.25, 6.25)]);
    assert_eq!(assumed, ["plans are published at their starts"]);
}

/// Returns a message that is logged some seconds after the second of the curves.
fn logged(message: &Bspline, seconds: f64) -> Message {
    let start_ns = u64::try_from(SEC).expect("after 1970") * 1_000_000_000;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some seconds")]
    let log_ns = start_ns + (seconds * 1e9) as u64;
    (TOPIC, B_SPLINE, "cdr", log_ns, cdr(message, true))
}

/// Returns a curve that starts some seconds later.
fn later(drone: i32, seconds: i32, y: f64) -> Bspline {
    let mut curve = spline(drone, 0, y);
    curve.3.0 += seconds;
    curve
}

#[test]
fn the_smallest_log_time_is_the_publication() {
    let one = spline(4, 0, 0.0);
    let instants = |messages: &[Message]| plans(&mcap_of(messages)).0.iter().map(|plan| plan.0).collect::<Vec<_>>();
    assert_eq!(instants(&[logged(&one, 3.0), logged(&one, 0.5)]), [0.5]);
    assert_eq!(instants(&[logged(&one, 0.5), logged(&one, 3.0)]), [0.5]);
}

#[test]
fn a_curve_that_is_replaced_before_its_start_is_not_flown() {
    // Published at 1 s for 5 s; replaced at 2 s by a curve from 3 s on.
    let messages = [logged(&spline(4, 0, 0.0), 0.0), logged(&later(4, 5, 1.0), 1.0), logged(&later(4, 3, 2.0), 2.0)];
    let found = whole("plan.mcap", &mcap_of(&messages));
    assert_near(position(&found, "4", 2.5), [3.5, 0.0, 1.0]);
    assert_near(position(&found, "4", 6.0), [4.0, 2.0, 1.0]);
    let is_noted = |found: &Whole| found.notes.iter().any(|note| note.starts_with("1 curve is not flown"));
    assert!(is_noted(&found), "{:?}", found.notes);
    assert_eq!(plans(&mcap_of(&messages)).0.len(), 3, "it was published");
    // Negative twin: published the other way round, it is flown from 5 s on.
    let messages = [logged(&spline(4, 0, 0.0), 0.0), logged(&later(4, 3, 2.0), 1.0), logged(&later(4, 5, 1.0), 2.0)];
    let found = whole("plan.mcap", &mcap_of(&messages));
    assert_near(position(&found, "4", 6.0), [2.0, 1.0, 1.0]);
    assert!(!is_noted(&found), "{:?}", found.notes);
}

#[test]
fn all_curves_decide_whether_log_times_have_the_clock_of_the_starts() {
    let at_starts = ["plans are published at their starts".to_owned()];
    let instants = |messages: &[Message]| {
        let (found, assumed) = plans(&mcap_of(messages));
        (found.iter().map(|plan| plan.0).collect::<Vec<_>>(), assumed)
    };
    // A single curve far ahead is no other clock.
    let far = [logged(&spline(4, 0, 0.0), 0.5), logged(&later(5, 100, 1.0), 1.0)];
    assert_eq!(instants(&far), (vec![0.5, 1.0], vec![]));
    assert_eq!(instants(&far[1..]).1, at_starts);
    // Curves are not late alone: then the recorder's clock is.
    let late = [logged(&spline(4, 0, 0.0), 6.0), logged(&later(5, 1, 1.0), 7.0)];
    assert_eq!(instants(&late), (vec![0.0, 1.0], at_starts.to_vec()));
    let some = [late[0].clone(), logged(&later(5, 1, 1.0), 0.5)];
    let assumed = "plans are published at their log times, up to 6.000 s after their starts, from which they are flown";
    assert_eq!(instants(&some), (vec![0.5, 6.0], vec![assumed.to_owned()]));
    // Starts of two clocks.
    let mut stray = spline(5, 0, 1.0);
    stray.3 = (0, 0);
    assert_refused(
        &refused(&[logged(&spline(4, 0, 0.0), 0.5), logged(&stray, 0.5)], &ReadOptions::default()),
        "recording/several-clocks",
        "",
    );
}

#[test]
fn parts_between_equal_times_are_left_out() {
    // The knots 1 and 1 + 2^-52 are one instant after 1000 s.
    let mut curve = later(4, 1000, 0.0);
    curve.4 = [-3.0, -2.0, -1.0, 0.0, 1.0, 1.0 + f64::EPSILON, 2.0, 3.0, 4.0, 5.0, 6.0].to_vec();
    let found = whole("plan.mcap", &mcap_of(&[of(&later(5, 0, 3.0)), of(&curve)]));
    let parts = pieces(&found).into_iter().filter(|piece| piece.vehicle == 0 && piece.from_s >= 1000.0).count();
    assert_eq!(parts, 3);
    curve.5[3][0] = 1e300;
    curve.5[4][0] = -1e300;
    curve.4[5] = 1.0 + 1e-10;
    let error = refused(&[of(&curve)], &ReadOptions::default());
    let place = format!("the curve of drone 4 that starts at {}000000000 ns", SEC + 1000);
    assert_refused(&error, "recording/overflow", &place);
}

#[test]
fn bytes_after_a_message_are_refused() {
    let with_rest = |rest: &[u8]| {
        let mut message = of(&spline(1, 0, 0.0));
        message.4.extend_from_slice(rest);
        read_bytes("plan.mcap", &mcap_of(&[message]), &ReadOptions::default())
    };
    with_rest(&[0; 4]).expect("padding");
    for rest in [&[0; 8][..], &[0, 1]] {
        let error = with_rest(rest).expect_err("more fields");
        assert!(error.to_string().contains("bytes after its last field"), "{error}");
    }
}

#[test]
fn a_list_of_b_splines_has_a_curve_of_each_drone() {
    let empty: Bspline = (0, 0, 0, (0, 0), vec![], vec![], vec![], 0.0);
    let list = (2, vec![spline(1, 0, 0.0), empty, spline(2, 0, 3.0)]);
    let message = ("/swarm_trajs", "traj_utils/msg/MultiBsplines", "cdr", 7, cdr(&list, true));
    let found = whole("plan.mcap", &mcap_of(&[message]));
    assert_eq!(found.vehicles, ["1", "2"]);
    assert_near(position(&found, "2", 1.0), [2.0, 3.0, 1.0]);
    let has = |words: &str| found.notes.iter().any(|note| note.contains(words));
    assert!(has("the names of schemas decide"), "{:?}", found.notes);
    // Negative twin: an element with knots and without points is damaged.
    let damaged = (2, vec![(0, 3, 0, (0, 0), vec![0.0], vec![], vec![], 0.0), spline(2, 0, 3.0)]);
    let damaged: (i32, Vec<Bspline>) = damaged;
    let message = ("/swarm_trajs", "traj_utils/msg/MultiBsplines", "cdr", 7, cdr(&damaged, true));
    assert_refused(&refused(&[message], &ReadOptions::default()), "recording/knots", "curve 1 on topic `/swarm_trajs`");
}

#[test]
fn the_definition_in_a_bag_decides_how_a_message_is_read() {
    let fields = "int16 drone_id\nint32 traj_id\ntime start_time\nuint8 order\nfloat32[] coef_x\nfloat32[] coef_y\n\
                  float32[] coef_z\nfloat32[] duration\n";
    let written = |schema: &str, definition: &str| {
        let mut out = mcap::Writer::new(std::io::Cursor::new(Vec::new())).expect("a writer");
        let schema = out.add_schema(schema, "ros2msg", definition.as_bytes()).expect("a schema");
        let channel_id = out.add_channel(schema, TOPIC, "cdr", &std::collections::BTreeMap::new()).expect("a channel");
        let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 7, publish_time: 7 };
        out.write_to_known_channel(&header, &cdr(&polynomials(2), true)).expect("a message");
        out.finish().expect("finished");
        let bytes = out.into_inner().into_inner();
        read_bytes("plan.mcap", &bytes, &ReadOptions::default())
    };
    let found = written("other_planner/msg/Polynomials", fields).expect("read");
    assert_near(position(&found, "2", 1.0), [0.5, 0.25, 1.0]);
    assert!(!found.notes.iter().any(|note| note.contains("the names of schemas decide")), "{:?}", found.notes);
    // Negative twin: a known name with fields in another order.
    let other = fields.replace("uint8 order\nfloat32[] coef_x\n", "float32[] coef_x\nuint8 order\n");
    let error = written(POLYNOMIALS, &other).expect_err("other fields");
    assert_refused(&error, "recording/unsupported-format", &format!("curve 1 on topic `{TOPIC}`"));
    assert!(error.to_string().contains("float32[] coef_x, uint8 order"), "{error}");
}
