//! Random flights under a shield: every law and three adversaries, in the engine and on the ideal plant, with every
//! imperfection within its bound. None may violate, and a flight in which a bound was exceeded must say so.
//!
//! `TAUTLINE_LONG=1 cargo test --release -p tautline-sim --test flights shield::` flies 5,000 of them, with up to 40
//! vehicles, and prints the smallest room.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_laws::formation::Formation;
use tautline_laws::law::{Law, LawError, LawSpec};
use tautline_laws::observation::Observation;
use tautline_sim::plant;
use tautline_sim::scenario::{PlantSpec, Scenario, ShieldSpec};
use tautline_sim::shield::ShieldReport;

use super::flight::{fly, fly_with, read};

/// Deviations of a Gaussian error up to its assumed bound.
const SIGMAS: f64 = 6.0;

struct Random(ChaCha8Rng);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn index(&mut self, count: usize) -> usize {
        usize::try_from(self.0.next_u64() % count as u64).expect("small")
    }

    fn one_of<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.index(of.len())]
    }

    fn vector(&mut self, axes: usize, extent: f64) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| if axis < axes { self.between(-extent, extent) } else { 0.0 })
    }
}

/// Law that tries to make vehicles collide.
#[derive(Clone)]
enum Adversary {
    /// Each vehicle flies at its nearest neighbour.
    Dive,
    /// Each vehicle flies at the centre of the swarm.
    Centre,
    /// Each vehicle gets a random command at each instant.
    Random(Box<ChaCha8Rng>),
    /// The law is undefined everywhere.
    Undefined,
    /// The law writes NaN for one vehicle from some instant on.
    NotANumber { vehicle: usize, left: u32 },
    /// The law fails everywhere.
    Failed,
}

impl Law for Adversary {
    fn name(&self) -> &'static str {
        "adversary"
    }

    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        let positions = &at.own.positions_m;
        let count = positions.nrows();
        for i in 0..count {
            let own = row(positions, i);
            let others = (0..count).filter(|j| *j != i).map(|j| row(positions, j) - own);
            let wanted = match self {
                Self::Dive => others.min_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap_or_default() * 50.0,
                Self::Centre => others.sum::<Vector3<f64>>(),
                Self::Random(random) => Random(*random.clone()).vector(2, 20.0),
                Self::Undefined => return Err(LawError::NotFinite { vehicle: i }),
                Self::Failed => return Err(LawError::Failed),
                Self::NotANumber { vehicle, left: 0 } if *vehicle == i => Vector3::repeat(f64::NAN),
                Self::NotANumber { .. } => Vector3::zeros(),
            };
            if let Self::Random(random) = self {
                (0..3).for_each(|_| _ = random.next_u64());
            }
            set_row(command, i, wanted);
        }
        if let Self::NotANumber { left, .. } = self {
            *left = left.saturating_sub(1);
        }
        Ok(())
    }
}

/// Returns a random scenario and its law, unless the draw cannot be flown.
fn draw(seed: u64, most: usize) -> Option<(Scenario, Box<dyn Law>)> {
    let mut random = Random(ChaCha8Rng::seed_from_u64(seed));
    let count = 2 + random.index(most - 1);
    let axes = random.one_of(&[2, 3]);
    let extent = 2.2 * (count as f64).powf(1.0 / axes as f64) + 1.0;
    let mut points: Vec<Vector3<f64>> = Vec::new();
    let spread = |points: &mut Vec<Vector3<f64>>, random: &mut Random, apart: f64| {
        for _ in 0..20_000 {
            let point = random.vector(axes, extent);
            if points.iter().all(|other| (point - other).norm() > apart) {
                points.push(point);
            }
            if points.len() == count {
                return Some(());
            }
        }
        None
    };
    spread(&mut points, &mut random, random_apart(seed))?;
    let mut slots = Vec::new();
    spread(&mut slots, &mut random, 1.5)?;
    let rows = |points: &[Vector3<f64>]| Rows::from_fn(count, |i, axis| points[i][axis]);
    let mut start = Swarm::at_rest(rows(&points));
    for i in 0..count {
        let velocity = random.vector(axes, 0.4);
        set_row(&mut start.velocities_m_s, i, velocity);
    }
    let mut scenario = Scenario::new("random", start, Formation::points(rows(&slots)), 1.0, 8.0);
    let period_s = random.one_of(&[0.02, 0.05, 0.1]);
    scenario.time.control_hz = Some(1.0 / period_s);
    scenario.time.dt_s = period_s / random.one_of(&[2.0, 5.0, 10.0]);
    scenario.noise_seed = seed;
    let mut shield = ShieldSpec { accel_m_s2: Some(random.one_of(&[4.0, 6.0])), ..ShieldSpec::default() };
    if random.between(0.0, 1.0) < 0.5 {
        scenario.plant = PlantSpec::Ideal;
    } else if random.between(0.0, 1.0) < 0.3 {
        scenario.actuation.lag_s = random.between(0.02, 0.05);
    }
    scenario.actuation.max_accel_m_s2 = shield.accel_m_s2;
    if random.between(0.0, 1.0) < 0.7 {
        scenario.network.rate_hz = Some(1.0 / period_s);
        scenario.network.latency_s = random.between(0.0, 0.3);
        scenario.network.jitter_s = random.between(0.0, 0.2);
        scenario.network.loss = random.between(0.0, 0.5);
        scenario.network.loss_burst = Some(random.between(2.0, 5.0));
    }
    if random.between(0.0, 1.0) < 0.6 {
        let (position_m, velocity_m_s) = (random.between(0.0, 0.005), random.between(0.0, 0.01));
        scenario.sensing.rate_hz = Some(1.0 / period_s);
        scenario.sensing.position_noise_m = position_m;
        scenario.sensing.velocity_noise_m_s = velocity_m_s;
        (shield.position_error_m, shield.velocity_error_m_s) = (SIGMAS * position_m, SIGMAS * velocity_m_s);
        scenario.sensing.latency_s = random.one_of(&[0.0, 1.0]) * period_s;
    }
    scenario.a22_per_s = random.one_of(&[0.0, -0.3, 0.1]);
    if random.between(0.0, 1.0) < 0.5 {
        scenario.drag_per_s = 0.1;
        scenario.wind.mean_m_s = random.vector(axes, 2.0);
        shield.disturbance_m_s2 = Some(0.1 * scenario.wind.mean_m_s.norm() + 1e-12);
    }
    if random.between(0.0, 1.0) < 0.3 {
        shield.ease_m = Some(0.0);
        shield.turn = 0.0;
    }
    if seed % 4 == 3 && scenario.actuation.lag_s == 0.0 {
        (shield.period_tolerance, shield.hang_periods, shield.hang_share) = (0.05, 2, 0.2);
    }
    scenario.shield = Some(shield);
    let laws = LawSpec::all();
    let law: Box<dyn Law> = match random.index(laws.len() + 3) {
        0 => Box::new(Adversary::Dive),
        1 => Box::new(Adversary::Centre),
        2 => Box::new(Adversary::Random(Box::new(ChaCha8Rng::seed_from_u64(seed)))),
        k => {
            scenario.law = laws[k - 3].clone();
            scenario.validate().ok()?;
            scenario.law().ok()?
        }
    };
    scenario.validate().ok()?;
    Some((scenario, law))
}

/// Returns the least distance of two starts of a draw \[m\]: some begin as near as the tube allows.
fn random_apart(seed: u64) -> f64 {
    if seed.is_multiple_of(3) { 1.35 } else { 2.4 }
}

fn report(flight: &tautline_sim::sim::Flight) -> &ShieldReport {
    flight.shield.as_ref().expect("a shield")
}

#[test]
fn random_flights_never_violate_while_the_bounds_hold() {
    let long = std::env::var_os("TAUTLINE_LONG").is_some();
    let (flights, most) = if long { (5_000, 40) } else { (60, 12) };
    let (mut flown, mut exceeded, mut least_m, mut changed) = (0, 0, f64::INFINITY, 0.0);
    for seed in 0.. {
        if flown == flights {
            break;
        }
        let Some((scenario, law)) = draw(seed, most) else { continue };
        let (flight, _) = fly_with(&scenario, law, plant::of(&scenario));
        let flight = flight.unwrap_or_else(|error| panic!("{seed}: {error}"));
        let shield = report(&flight);
        flown += 1;
        assert_eq!(flight.ending.reason(), None, "{seed}");
        if shield.breach.is_some() {
            exceeded += 1;
            continue;
        }
        let room_m = flight.audit.closest.expect("two vehicles").separation_m - scenario.delta_m;
        assert!(flight.audit.status == Status::Clear && room_m > 0.0, "{seed}: {room_m} {:?}", flight.audit.status);
        assert_eq!(flight.certificate.certified_m, Some(1.0), "{seed}: {:?}", flight.certificate.void);
        let shares = [shield.counters.command_share, shield.counters.tracking_share];
        assert!(shares.iter().all(|share| share.is_some_and(|share| share <= 1.0)), "{seed}: {shield:?}");
        least_m = least_m.min(room_m);
        changed += shield.counters.changed_share();
    }
    println!("{flown} flights: {exceeded} with a bound exceeded, smallest room {least_m:.3e} m");
    assert!(exceeded * 20 <= flights, "{exceeded} of {flights} exceeded a bound");
    assert!(changed / f64::from(flights) > 0.1 && least_m < 0.1, "{changed} {least_m}");
}

const SWAP: &str = r#"
    [start]
    positions_m = [[-3, 0], [3, 0]]
    [formation]
    shape = "points"
    points_m = [[3, 0], [-3, 0]]
    [law]
    kind = "laplacian"
    delta_m = 1.0
    [time]
    duration_s = 20
"#;

#[test]
fn without_the_shield_the_swap_violates_and_with_it_the_certificate_is_kept() {
    let (flight, _) = fly(&read(SWAP));
    assert_eq!(flight.audit.status, Status::Violation);
    let (flight, _) = fly(&read(&format!("{SWAP}\n[shield]")));
    assert_eq!((flight.audit.status, flight.certificate.certified_m), (Status::Clear, Some(1.0)));
    assert_eq!(report(&flight).breach, None);
    assert!(report(&flight).counters.changed > 0);
}

#[test]
fn vehicles_that_miss_instants_keep_the_certificate() {
    let (regular, _) = fly(&read(&format!("{SWAP}\n[shield]")));
    let hangs = "[shield]\nperiod_tolerance = 0.1\nhang_periods = 3\nhang_share = 0.3";
    let (flight, _) = fly(&read(&format!("{SWAP}\n{hangs}")));
    assert_eq!((flight.audit.status, flight.certificate.certified_m), (Status::Clear, Some(1.0)));
    let (shield, regular) = (report(&flight), report(&regular));
    assert_eq!(shield.breach, None);
    assert!(shield.counters.commands * 4 < regular.counters.commands * 3, "{shield:?}");
    // With 1 to 3 missed instants the longest time is 4 periods of at most 4.4.
    let share = shield.counters.period_share.expect("observed");
    assert!((share - 4.0 / 4.4).abs() < 1e-6, "{share}");
    assert_eq!(regular.counters.period_share, None);
    assert_eq!((shield.facts.len(), regular.facts.len()), (2, 1));
    assert!(shield.certificate.contains("commands are held over 0.045 to 0.22 s"), "{}", shield.certificate);
    // The same bits again.
    let (again, _) = fly(&read(&format!("{SWAP}\n{hangs}")));
    assert_eq!(report(&again), shield);
    let error = tautline_sim::scenario::Source::Text {
        name: "hangs".into(),
        text: format!("{SWAP}\n[shield]\nhang_share = 0.1"),
    };
    let error = Scenario::read(&error, &[]).expect_err("no hangs").to_string();
    assert!(error.contains("shield.hang_share needs shield.hang_periods above 0 (0.1)"), "{error}");
}

#[test]
fn measurements_that_are_no_whole_number_of_periods_old_keep_the_certificate() {
    for (sensing, keys) in [
        ("latency_s = 0.03", ""),
        ("latency_s = 0.05", "hang_periods = 2\nhang_share = 0.2"),
        ("latency_s = 0.07", "period_tolerance = 0.1\nhang_periods = 1\nhang_share = 0.2"),
    ] {
        let (flight, _) = fly(&read(&format!("{SWAP}\n[sensing]\n{sensing}\n[shield]\n{keys}")));
        let shield = report(&flight);
        assert_eq!((flight.audit.status, shield.breach), (Status::Clear, None), "{sensing} {keys}");
        assert_eq!(flight.certificate.certified_m, Some(1.0), "{sensing} {keys}");
        assert!(shield.counters.age_share.is_some_and(|share| share > 0.999), "{sensing} {keys}");
        assert!(shield.certificate.contains("s old, with known ages"), "{}", shield.certificate);
    }
}

#[test]
fn exceeded_bounds_are_named_with_their_vehicle() {
    // The wind blows harder than the shield assumes after a change of the scenario in code.
    let mut scenario = read(&format!("{SWAP}\n[shield]\ndisturbance_m_s2 = 0.2\n[vehicle]\ndrag_per_s = 0.1"));
    scenario.wind.mean_m_s = Vector3::new(0.0, 60.0, 0.0);
    assert!(scenario.validate().is_err());
    let (flight, _) = fly(&scenario);
    let breach = report(&flight).breach.expect("a breach");
    assert!(breach.exceeded.to_string().contains("times the tube"), "{breach:?}");
    assert_eq!(flight.certificate.certified_m, None);
    // A dead vehicle voids the certificate.
    let dead = "[shield]\n[[failure]]\nvehicle = 1\nat_s = 1.0\nkind = \"dead\"";
    let (flight, _) = fly(&read(&format!("{SWAP}\n{dead}")));
    assert_eq!(flight.certificate.certified_m, None);
    assert_eq!(report(&flight).breach, None);
    // A silent one does not.
    let silent = "[network]\nrate_hz = 20\n[shield]\n[[failure]]\nvehicle = 1\nat_s = 1.0\nkind = \"silent\"";
    let (flight, _) = fly(&read(&format!("{SWAP}\n{silent}")));
    assert_eq!((flight.audit.status, flight.certificate.certified_m), (Status::Clear, Some(1.0)));
}

#[test]
fn a_law_that_is_undefined_makes_the_shield_brake() {
    let mut scenario = read(&format!("{SWAP}\n[shield]"));
    scenario.start.velocities_m_s[(0, 0)] = 1.0;
    let (flight, log) = fly_with(&scenario, Box::new(Adversary::Undefined), plant::of(&scenario));
    let flight = flight.expect("a flight");
    assert_eq!((flight.ending.reason(), flight.audit.status), (None, Status::Clear));
    assert_eq!((report(&flight).undefined, report(&flight).failed), (401, 0));
    assert!(log.samples.last().expect("samples").swarm.velocities_m_s.amax() < 1e-9, "both have stopped");
}

/// Without a shield a command that is not finite ends the flight. Under a shield the vehicle brakes, and the report
/// counts the instants.
#[test]
fn commands_that_are_not_finite_are_counted() {
    let scenario = read(&format!("{SWAP}\n[shield]"));
    let counts = |law: Adversary| {
        let (flight, _) = fly_with(&scenario, Box::new(law), plant::of(&scenario));
        let flight = flight.expect("a flight");
        assert_eq!(flight.ending.reason(), None);
        (report(&flight).undefined, report(&flight).failed)
    };
    assert_eq!(counts(Adversary::NotANumber { vehicle: 0, left: 0 }), (401, 401), "throughout");
    assert_eq!(counts(Adversary::NotANumber { vehicle: 1, left: 400 }), (1, 1), "at the last instant, for one vehicle");
    assert_eq!(counts(Adversary::Failed), (401, 401));
    assert_eq!(counts(Adversary::Centre), (0, 0));
}

#[test]
fn starts_on_paths_that_converge_are_refused_or_clear_without_a_command() {
    let scenario = |apart_m: f64, speed_m_s: f64, angle_rad: f64| {
        let text = format!(
            r#"
            [start]
            positions_m = [[0, 0], [0, {apart_m}]]
            velocities_m_s = [[{speed_m_s}, 0], [{speed_m_s}, {}]]
            [formation]
            shape = "points"
            points_m = [[0, 0], [0, 50]]
            [law]
            kind = "laplacian"
            delta_m = 1.0
            [plant]
            kind = "ideal"
            [shield]
            max_speed_m_s = {}
            [time]
            duration_s = {}
            "#,
            -angle_rad * speed_m_s,
            1.001 * speed_m_s,
            speed_m_s / 2.9,
        );
        let source = tautline_sim::scenario::Source::Text { name: "converging".into(), text };
        Scenario::read(&source, &[])
    };
    // Twice the path error of the ideal plant, and rounding.
    let required_m = 1.0 + 2.1e-5;
    for (speed_m_s, length_m) in [(50.0, 416.0), (300.0, 15_000.0)] {
        for angle_rad in [1e-12, 1e-9, 0.99e-7, 1e-6] {
            let lost_m = angle_rad * length_m;
            if lost_m > 2e-7 {
                let error = scenario(required_m + 0.8 * lost_m, speed_m_s, angle_rad).expect_err("too near");
                assert!(error.to_string().contains("reserve segments nearer"), "{angle_rad}: {error}");
            }
            let near = scenario(required_m + 1.1 * lost_m + 1e-7, speed_m_s, angle_rad).expect("far enough");
            if speed_m_s < 100.0 || angle_rad == 0.99e-7 {
                let (flight, _) = fly_with(&near, Box::new(Adversary::Undefined), plant::of(&near));
                let flight = flight.expect("a flight");
                assert_eq!((flight.audit.status, report(&flight).breach), (Status::Clear, None), "{angle_rad}");
                let closest_m = flight.audit.closest.expect("a pair").separation_m;
                assert!(closest_m < required_m + 0.2 * lost_m + 1e-5, "{angle_rad}: {closest_m}");
            }
        }
    }
}

#[test]
fn a_saved_flight_continues_with_the_same_bits() {
    let (scenario, _) =
        (0..).find_map(|seed| draw(seed, 12).filter(|(scenario, _)| scenario.network.loss > 0.1)).expect("one");
    let whole = fly(&scenario).0;
    let mut simulation = tautline_sim::Simulation::new(&scenario).expect("a flight");
    let mut saved = None;
    while simulation.ending().is_none() {
        simulation.step();
        if simulation.steps() == 77 {
            saved = Some(simulation.save());
        }
    }
    let first = simulation.state().clone();
    simulation.load(&saved.expect("77 steps"), None);
    while simulation.ending().is_none() {
        simulation.step();
    }
    assert_eq!((simulation.state(), &whole.last), (&first, &first));
    assert_eq!(report(&simulation.finish()), report(&whole));
}

#[test]
fn scenarios_that_do_not_fit_the_shield_are_refused_with_place_value_and_remedy() {
    let refused = |shield: &str| {
        let source = tautline_sim::scenario::Source::Text { name: "test".into(), text: format!("{SWAP}{shield}") };
        let error = Scenario::read(&source, &[]).expect_err(shield);
        format!("{}: {error}", error.keys.first().cloned().unwrap_or_default())
    };
    for (shield, place, says) in [
        ("[shield]\nbrake_m_s2 = 6", "shield.brake_m_s2", "must be at most 5.0000"),
        ("[shield]\ntracker_per_s = 80", "shield.tracker_per_s", "the tracker is unstable"),
        ("[shield]\naccel_m_s2 = 6\n[actuation]\nmax_accel_m_s2 = 5", "shield.accel_m_s2", "(6)"),
        (
            "[shield]\ndisturbance_m_s2 = 0.1\n[vehicle]\ndrag_per_s = 0.1\n[wind]\nmean_m_s = [3, 0]",
            "disturbance",
            "(0.1)",
        ),
        ("[shield]\n[sensing]\nrate_hz = 20\nposition_noise_m = 0.01", "shield.position_error_m", "raise it to 0.06"),
        ("[shield]\n[sensing]\nrate_hz = 30", "sensing.rate_hz", "set sensing.rate_hz to 20"),
        ("[shield]\n[actuation]\nlag_s = 0.0001", "actuation.lag_s", "must be 0 or at least 0.001172 s"),
        ("[shield]\n[actuation]\nlag_s = 1e-300", "actuation.lag_s", "(1e-300)"),
        ("[shield]\n[actuation]\nlag_s = 100", "actuation.lag_s", "the tracker is unstable"),
        ("[shield]\nbrake_m_s2 = 1e-9", "shield.brake_m_s2", "a brake over"),
        ("[shield]\ntracking_error_m = 1e7", "shield.tracking_error_m", "margins must be at most"),
        ("[shield]\n[swarm]\na22_per_s = 5", "swarm.a22_per_s", "the tracker is unstable"),
        ("[shield]\n[swarm]\na22_per_s = -50", "swarm.a22_per_s", "drag takes 100.0000 of"),
        (
            "[shield]\ndisturbance_m_s2 = 0.1\n[vehicle]\ndrag_per_s = 0.1\n[wind]\ngust = [\
             {at_s = 0.5, rise_s = 0.5, velocity_m_s = [1, 0]}, {at_s = 0.5, rise_s = 0.5, velocity_m_s = [1, 0]}]",
            "disturbance",
            "must be at least 0.2",
        ),
        ("[shield]\n[vehicle]\nmodel = \"crazyflie\"\nattitude_rad_s = 5", "shield.tracking_error_m", "--identify"),
        ("[shield]\nposition_error_m = 3\naccel_m_s2 = 40", "start.positions_m", "reserve segments"),
        ("[shield]\nbrake = 3", "brake", "brake_m_s2"),
        ("control_hz = 33\n[shield]", "time.control_hz", "must be a whole number of steps"),
    ] {
        let error = refused(shield);
        assert!(error.contains(place) && error.contains(says), "{shield}: {error}");
    }
}

#[test]
fn obstacles_and_ellipsoids_are_certified_too() {
    let pillar = "[[obstacle]]\nname = \"pillar\"\nat_m = [0, 0.2, 0]\nball = { radius_m = 0.6 }\nclearance_m = 0.5";
    let with = format!("{SWAP}\n[shield]\n{pillar}");
    let (bare, _) = fly(&read(&format!("{SWAP}\n{pillar}")));
    assert_eq!(bare.clearance.map(|clearance| clearance.status), Some(Status::Violation));
    let (flight, _) = fly(&read(&with));
    assert_eq!(flight.clearance.as_ref().map(|clearance| clearance.status), Some(Status::Clear));
    assert_eq!((flight.status(), report(&flight).breach), (Status::Clear, None));
    let certificate = &flight.certificate;
    assert_eq!((certificate.certified_m, certificate.certified_clearance_margin_m), (Some(1.0), Some(0.0)));
    // A tilted cable acts by its section with the plane in which the vehicles stay.
    let cable = "[[obstacle]]\nname = \"cable\"\ncapsule = { from_m = [-0.5, -3, -1], to_m = [0.5, 3, 2], \
                 radius_m = 0.1 }\nclearance_m = 0.5";
    let (flight, log) = fly(&read(&format!("{SWAP}\n[shield]\n{cable}")));
    assert_eq!((flight.status(), report(&flight).breach), (Status::Clear, None));
    assert!(log.samples.iter().all(|sample| sample.swarm.positions_m.column(2).iter().all(|z| *z == 0.0)));

    // Two vehicles above each other are 1 m apart, which is less than the height of the ellipsoids.
    let stacked = SWAP
        .replace("[[-3, 0], [3, 0]]", "[[0, 0, -2], [0, 0, 2]]")
        .replace("[[3, 0], [-3, 0]]", "[[0, 0, 2], [0, 0, -2]]")
        .replace("delta_m = 1.0", "")
        + "\n[safety]\nshape = \"ellipsoid\"\nhalf_axes_m = [0.5, 0.5, 1.0]";
    let (flight, _) = fly(&read(&format!("{stacked}\n[shield]")));
    assert_eq!((flight.audit.status, flight.certificate.certified_m), (Status::Clear, Some(1.0)));
    assert!(report(&flight).certificate.contains("2.000 m in the vertical"), "{}", report(&flight).certificate);
}

#[test]
fn a_radio_of_any_range_keeps_vehicles_apart() {
    let text = SWAP.replace("[[-3, 0], [3, 0]]", "[[-6, 0], [6, 0]]").replace("[[3, 0], [-3, 0]]", "[[6, 0], [-6, 0]]");
    let with = |range_m: &str| fly(&read(&format!("{text}\n[shield]\n[network]\nrate_hz = 20\n{range_m}"))).0;
    let apart = |flight: &tautline_sim::sim::Flight| {
        (row(&flight.last.positions_m, 0) - row(&flight.last.positions_m, 1)).norm()
    };
    let (far, near) = (with(""), with("range_m = 5.0"));
    for flight in [&far, &near] {
        assert_eq!((flight.audit.status, report(flight).breach), (Status::Clear, None));
    }
    assert_eq!((report(&far).lost, report(&near).lost > 0), (0, true));
    // The first plane is halfway: both come within range of each other there, and pass.
    assert!(apart(&far) > 11.0 && apart(&near) > 11.0, "{} {}", apart(&far), apart(&near));
    // No contract is renewed. Vehicles stay apart whatever they do then.
    let short = with("range_m = 0.9");
    assert_eq!((short.audit.status, report(&short).lost), (Status::Clear, report(&short).sent));
    assert_eq!((report(&short).breach, report(&short).counters.accepted), (None, 0));
    // A third vehicle passes on some of the messages that are out of range.
    let text = text.replace("[-6, 0], [6, 0]]", "[-6, 0], [6, 0], [0, 3]]");
    let text = text.replace("[[6, 0], [-6, 0]]", "[[6, 0], [-6, 0], [0, 3]]").replace("count = 2", "count = 3");
    let relayed = |hops: u32| {
        let network = format!("[network]\nrate_hz = 20\nrange_m = 5.0\nrelay_hops = {hops}");
        fly(&read(&format!("{text}\n[shield]\n{network}"))).0
    };
    let (direct, relayed) = (relayed(1), relayed(2));
    assert!(report(&relayed).lost < report(&direct).lost);
    for flight in [&direct, &relayed] {
        assert_eq!((flight.audit.status, report(flight).breach), (Status::Clear, None));
    }
}

#[test]
fn a_lag_and_late_measurements_keep_the_bounds() {
    for sensing in ["latency_s = 0.05", "rate_hz = 20", "rate_hz = 40\nlatency_s = 0.05"] {
        let (flight, _) = fly(&read(&format!("{SWAP}\n[shield]\n[actuation]\nlag_s = 0.05\n[sensing]\n{sensing}")));
        assert_eq!((flight.status(), report(&flight).breach), (Status::Clear, None), "{sensing}");
    }
}

#[test]
fn the_default_period_is_one_that_the_law_tolerates() {
    let lattice = |count: usize, more: &str| {
        let text = format!(
            "[swarm]\ncount = {count}\n[start]\nshape = \"grid\"\nspacing_m = 2.0\njitter_m = 0.05\n\
             [formation]\nshape = \"grid\"\nspacing_m = 2.0\n[law]\nkind = \"displacement\"\ndelta_m = 1.0\n\
             [reference]\nkind = \"rest\"\n[time]\nduration_s = 15\n{more}"
        );
        read(&text)
    };
    let rate_hz = |count: usize, more: &str| lattice(count, more).time.control_hz;
    // The relative velocities of the complete graph with a reference have the damping (N + 1) c, here with c = 1 /s.
    // Held commands need less than 2 s / (N + 1). The default takes at most half of this.
    for (count, expected_hz) in [(4, 20.0), (19, 20.0), (20, 40.0), (39, 40.0), (40, 60.0), (100, 120.0)] {
        let found_hz = rate_hz(count, "[shield]").expect("a rate");
        assert!((found_hz - expected_hz).abs() < 1e-9, "{count}: {found_hz}");
    }
    assert_eq!(rate_hz(40, "control_hz = 20\n[shield]"), Some(20.0));
    assert_eq!(rate_hz(40, "[sensing]\nrate_hz = 20\n[shield]"), Some(20.0));
    assert_eq!(rate_hz(40, ""), None);
    // A law that needs more than one command a step gets one.
    assert_eq!(rate_hz(40, "dt_s = 0.05\n[shield]"), Some(20.0));
    assert_eq!(rate_hz(400, "dt_s = 0.0125\n[shield]"), Some(80.0));
    // At the default rate, vehicles come to rest in their slots. At 20 Hz they go on shaking.
    let [chosen, fixed] = ["[shield]", "control_hz = 20\n[shield]"].map(|more| fly(&lattice(60, more)).0);
    let moved_m = |flight: &tautline_sim::sim::Flight| flight.last.velocities_m_s.amax();
    assert!(moved_m(&chosen) < 1e-2 && moved_m(&fixed) > 0.1, "{} {}", moved_m(&chosen), moved_m(&fixed));
}
