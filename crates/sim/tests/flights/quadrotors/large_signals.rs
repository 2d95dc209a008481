//! Commands that saturate the rotors: reversals at many periods, up to the largest acceleration of each built-in model.
//!
//! `TAUTLINE_LONG=1` flies more amplitudes, periods and directions.

use nalgebra::Vector3;
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::formation::Formation;
use tautline_sim::plant::rapier;
use tautline_sim::scenario::{Scenario, Space};
use tautline_sim::vehicle::{Airframe, Fleet, HEIGHT_RAD_S, MODELS, Model, Quadrotor, State};

use super::{fly, model};

const DT_S: f64 = 1.0 / 500.0;
/// Duration of the reversals \[s\].
const REVERSALS_S: f64 = 3.0;
/// Time after them until the vehicle hovers \[s\].
const HOVER_S: f64 = 10.0;
/// Decay of the speed of a vehicle that hovers \[1/s\].
const STOP_PER_S: f64 = 1.0;
/// Largest height over reversals on a level \[m\].
const HEIGHT_M: f64 = 2.0;
/// Largest speed beyond that of the commanded motion \[m/s\].
const SPEED_M_S: f64 = 15.0;

fn alone(model: &Model, space: Space) -> (Scenario, Fleet) {
    let mut scenario = Scenario::new("alone", Swarm::at_rest(Rows::zeros(1)), Formation::line(1, 1.0), 1.0, 1.0);
    scenario.space = space;
    let model = model.clone();
    let quadrotor = Quadrotor { model, attitude_hz: 500.0, ground_effect: false, downwash: false };
    scenario.set_airframe(Airframe::Quadrotor(Box::new(quadrotor)));
    let fleet = scenario.fleet().expect("a quadrotor");
    (scenario, fleet)
}

/// Extremes of a flight with reversals, and its end.
#[derive(Debug)]
struct Flown {
    height_m: f64,
    speed_m_s: f64,
    last: State,
}

/// Flies reversals of an acceleration \[m/s^2\], half a period first, then hovers. The height z = 0 is held throughout.
fn reversals(model: &Model, space: Space, amplitude_m_s2: Vector3<f64>, half_s: f64) -> Flown {
    let (scenario, fleet) = alone(model, space);
    let mut plant = rapier::quadrotors(&scenario, fleet);
    let (mut height_m, mut speed_m_s) = (0.0_f64, 0.0_f64);
    let last = fly(plant.as_mut(), (REVERSALS_S + HOVER_S, DT_S), &mut |time_s, state| {
        height_m = height_m.max(state.position_m.z.abs());
        speed_m_s = speed_m_s.max(state.velocity_m_s.norm());
        let is_back = ((time_s + 1e-9) / half_s + 0.5).floor().rem_euclid(2.0) > 0.5;
        let mut command = match (time_s < REVERSALS_S, is_back) {
            (true, true) => -amplitude_m_s2,
            (true, false) => amplitude_m_s2,
            (false, _) => -STOP_PER_S * state.velocity_m_s,
        };
        command.z += -HEIGHT_RAD_S * (HEIGHT_RAD_S * state.position_m.z + 2.0 * state.velocity_m_s.z);
        command
    });
    Flown { height_m, speed_m_s, last }
}

/// Returns directions of reversals with their names.
fn directions(space: Space) -> Vec<Vector3<f64>> {
    let level = [Vector3::x(), Vector3::y(), Vector3::new(1.0, 1.0, 0.0), Vector3::new(1.0, -1.0, 0.0)];
    let more = [Vector3::z(), Vector3::new(1.0, 0.0, 1.0), Vector3::new(1.0, 1.0, 1.0)];
    let more = more.into_iter().filter(|_| space == Space::Volume);
    level.into_iter().chain(more).map(|along| along.normalize()).collect()
}

#[test]
fn reversals_that_saturate_the_rotors_keep_height_and_speed() {
    let is_long = std::env::var_os("TAUTLINE_LONG").is_some();
    let shares: &[f64] = if is_long { &[0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0] } else { &[0.1, 1.0] };
    let halves_s: &[f64] = if is_long {
        &[0.01, 0.016, 0.02, 0.03, 0.05, 0.07, 0.1, 0.14, 0.2, 0.28, 0.35, 0.5, 0.7, 1.0, 1.5]
    } else {
        &[0.01, 0.05, 0.1, 0.35, 0.7]
    };
    for (name, _) in MODELS {
        let model = model(name);
        for space in [Space::Plane, Space::Volume] {
            let most_m_s2 = model.most_accel_m_s2(space == Space::Plane);
            let (mut height_share, mut speed_share) = (0.0_f64, 0.0_f64);
            for along in directions(space) {
                for (share, half_s) in
                    shares.iter().flat_map(|share| halves_s.iter().map(move |half_s| (share, half_s)))
                {
                    let amplitude_m_s2 = along * (share * most_m_s2);
                    let Flown { height_m, speed_m_s, last } = reversals(&model, space, amplitude_m_s2, *half_s);
                    let what = format!(
                        "{name}, {space:?}, {amplitude_m_s2:?} every {half_s} s: {height_m} m, {speed_m_s} m/s"
                    );
                    // What the command itself moves.
                    let height_bound_m = HEIGHT_M + amplitude_m_s2.z.abs() * half_s * half_s;
                    let speed_bound_m_s = SPEED_M_S + amplitude_m_s2.norm() * half_s;
                    height_share = height_share.max(height_m / height_bound_m);
                    speed_share = speed_share.max(speed_m_s / speed_bound_m_s);
                    assert!(height_m < height_bound_m && speed_m_s < speed_bound_m_s, "{what}");
                    let is_hovering = last.velocity_m_s.norm() < 0.01 && last.position_m.z.abs() < 0.01;
                    assert!(is_hovering && last.attitude.angle() < 0.01, "{what}: {last:?}");
                }
            }
            println!("{name}, {space:?}: {height_share} of the height, {speed_share} of the speed");
        }
    }
}

/// Commands that reverse faster than the body turns ask for torques beyond the rotors. A mixer that raises the total
/// thrust for them lifts the vehicle without end.
#[test]
fn a_hummingbird_whose_command_reverses_at_5_hz_stays_at_its_height() {
    let flown = reversals(&model("hummingbird"), Space::Plane, 3.0 * Vector3::x(), 0.1);
    assert!(flown.height_m < 0.05 && flown.speed_m_s < 0.5, "{flown:?}");
}
