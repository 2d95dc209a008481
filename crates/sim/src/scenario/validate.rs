//! Validates a scenario: conditions on several keys.

use nalgebra::Vector3;

use super::check::{check_written, of_filled_value};
use super::document::Document;
use super::error::{ErrorKind, ScenarioError, entry_key, leg_key};
use super::limits::{
    CONTACT_PREDICTION_M, LARGEST, MAX_STEPS, SLOT_MARGIN, check_count, check_lengths, check_memory, check_name,
    first_pair_within,
};
use super::spec::{Safety, Scenario, Space};
use super::time::TimeSpec;
use crate::sim::{self, SimError};
use tautline_audit::ObstacleError;
use tautline_core::swarm::{Pair, row};
use tautline_core::text::{beside_limit, exact, metres};
use tautline_laws::graph::{Graph, Pinning};
use tautline_laws::law::{Controls, LawSpec, ParameterError};
use tautline_laws::target::{DeadlockMode, Guidance, Leg, LegTrigger};
use tautline_laws::wind::Gust;

/// Relative rounding of the position \[m\] and velocity \[m/s\] of a leader on the reference.
const LEADER_ROUNDING: f64 = 1e-9;

/// Smallest number of steps of a turn of the reference, and of the rise or fall of a gust.
const STEPS_A_CHANGE: f64 = 10.0;

/// Relative difference below which two safety distances are equal.
const ROUNDING: f64 = 1e-9;

/// Number of vehicles that a message names before it counts the rest.
const NAMED_VEHICLES: usize = 8;

impl Scenario {
    /// Checks that the scenario can be flown. [`Scenario::read`] has done so; scenarios that are built or changed in
    /// code must be validated.
    ///
    /// A valid scenario has at least two vehicles, and one row or entry per vehicle everywhere. Expected memory, steps
    /// and magnitudes are within [`MAX_MEMORY_BYTES`](super::MAX_MEMORY_BYTES), [`MAX_STEPS`](super::MAX_STEPS),
    /// [`SMALLEST`](super::SMALLEST) and [`LARGEST`](super::LARGEST). All numbers are finite. All pairs of starts and
    /// of slots are more than delta apart, and two hulls fit within delta. The graph is connected. In the plane z = 0
    /// everywhere.
    ///
    /// # Errors
    /// [`ScenarioError`] for the first violated condition, with its keys and the remedy, without a place in a text.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        self.check_noise()?;
        self.check_lengths()?;
        self.check_keys()?;
        self.check()
    }

    /// Checks a scenario that was read: conditions on several keys, and the values that the program filled in.
    /// Single keys are those of `valid` where only the start, the slots and the seed differ.
    pub(super) fn check_built(&self, valid: Option<&Self>) -> Result<(), ScenarioError> {
        self.check()?;
        let has_valid_keys = valid.is_some_and(|valid| {
            let Self { start, legs, external_law, noise_seed, .. } = self.clone();
            i64::try_from(noise_seed).is_ok()
                && *self == Self { start, legs, external_law, noise_seed, ..valid.clone() }
        });
        if has_valid_keys { Ok(()) } else { self.check_keys().map_err(of_filled_value) }
    }

    /// Checks single keys as the reader of a recording does. [`Scenario::check`] checks all limits of points and edges.
    fn check_keys(&self) -> Result<(), ScenarioError> {
        check_written(&Document::from(self).without_lists().toml())
    }

    /// Checks conditions on several keys; the schema checks single keys.
    fn check(&self) -> Result<(), ScenarioError> {
        check_name("the name", &self.name, "name")?;
        check_count(self.count())?;
        self.check_legs()?;
        self.check_lengths()?;
        let takes_none = self.graph.is_complete() && !self.law.keeps_edges();
        check_memory(self.count(), if takes_none { 0 } else { self.graph.edge_count() as u128 })?;
        self.check_safety()?;
        self.check_airframe()?;
        self.check_motion()?;
        self.check_separations()?;
        self.check_reference()?;
        self.check_hulls()?;
        self.check_obstacles()?;
        check_connected(&self.graph)?;
        self.check_time()?;
        self.check_wind()?;
        self.check_arrival()?;
        self.check_deadlock()?;
        self.imperfections().into_iter().try_for_each(|imperfection| imperfection.check(self))?;
        self.check_shield()?;
        self.check_flight()
    }

    /// Builds the law and the judge as a flight does, so that a flight refuses no scenario that was accepted.
    fn check_flight(&self) -> Result<(), ScenarioError> {
        self.law().map_err(|error| of_law(&error))?;
        sim::check_judge(self).map_err(|error| self.of_judge(&error))
    }

    /// Returns an error of the judge at its key.
    fn of_judge(&self, error: &SimError) -> ScenarioError {
        if let SimError::Obstacle(ObstacleError { name, .. }) = error {
            let help = "correct the shape, the position or the clearance_m of the obstacle";
            let number = self.obstacles.iter().position(|obstacle| obstacle.name == *name);
            let key = number.map_or_else(|| "obstacle".to_owned(), |number| entry_key("obstacle", number));
            return ErrorKind::Obstacle.at(&[&key], error.to_string(), help);
        }
        let keys = ["law.delta_m", "safety.half_axes_m", "swarm.hull_radius_m", "swarm.count"];
        let help = "choose a safety distance and a number of vehicles that can be judged";
        ErrorKind::OutOfRange.at(&keys, error.to_string(), help)
    }

    fn check_noise(&self) -> Result<(), ScenarioError> {
        if i64::try_from(self.noise_seed).is_ok() {
            return Ok(());
        }
        let problem = format!("noise.seed is too large for a scenario file, got {}", self.noise_seed);
        let help = format!("give a seed of at most {}", i64::MAX);
        Err(ErrorKind::OutOfRange.at(&["noise.seed"], problem, help))
    }

    fn check_arrival(&self) -> Result<(), ScenarioError> {
        let (arrival, time) = (self.arrival, self.time);
        if arrival.hold_s > time.duration_s {
            let problem = format!(
                "the formation must be held for {} s, longer than the flight of {} s",
                arrival.hold_s, time.duration_s
            );
            let help = "enlarge time.duration_s or reduce arrival.hold_s";
            return Err(ErrorKind::OutsideFlight.at(&["arrival.hold_s", "time.duration_s"], problem, help));
        }
        Ok(())
    }

    fn check_legs(&self) -> Result<(), ScenarioError> {
        if self.legs.is_empty() {
            let problem = "the scenario has no formation";
            return Err(ErrorKind::MissingKey.at(&["formation"], problem, "give one"));
        }
        let mut from_s = 0.0;
        for (number, leg) in self.legs.iter().enumerate().skip(1) {
            let slots = leg.formation.count();
            if slots != self.count() {
                let problem = format!("leg {} has {slots} slots for {} vehicles", number + 1, self.count());
                let help = "every leg needs a slot for each vehicle";
                return Err(ErrorKind::CountMismatch.at(&[&leg_key(number, "points_m")], problem, help));
            }
            let LegTrigger::At(start_s) = leg.begins else { continue };
            if !(start_s >= from_s && start_s < self.time.duration_s) {
                let problem = format!("leg {} begins at {start_s} s", number + 1);
                let help = format!(
                    "legs must begin in order, at {from_s} s or later and before the end of the flight at {} s",
                    self.time.duration_s
                );
                let keys = [&*leg_key(number, "start_s"), "time.duration_s"];
                return Err(ErrorKind::OutsideFlight.at(&keys, problem, help));
            }
            from_s = start_s;
        }
        Ok(())
    }

    /// Checks that the law follows the reference, and that the leader starts on it.
    fn check_reference(&self) -> Result<(), ScenarioError> {
        let Some(guidance) = &self.reference else { return Ok(()) };
        self.check_followed(guidance)?;
        let start = guidance.motion.at(0.0);
        let shortest_s = STEPS_A_CHANGE * self.time.dt_s;
        if guidance.motion.shortest_s() < shortest_s {
            let problem = format!(
                "the reference turns within {} s, too fast for steps of {} s",
                guidance.motion.shortest_s(),
                self.time.dt_s
            );
            let help = format!("give each of its ways or turns at least {shortest_s} s, or reduce time.dt_s");
            return Err(ErrorKind::StepTooLong.at(&["reference.kind", "time.dt_s"], problem, help));
        }
        if self.space == Space::Plane && !guidance.motion.is_level() {
            let problem = "the reference leaves the plane z = 0 of the swarm";
            let help = "set its z to 0, or swarm.dimensions to 3";
            return Err(ErrorKind::Plane.at(&["reference.kind", "swarm.dimensions"], problem, help));
        }
        let Some(leader) = guidance.known_by.leader() else { return Ok(()) };
        let off_m_s = row(&self.start.velocities_m_s, leader) - start.velocity_m_s;
        let off_m = self.legs.iter().map(|leg| {
            let slot_m = row(&leg.formation.slots_m, leader) + start.position_m;
            (row(&self.start.positions_m, leader) - slot_m).norm()
        });
        let off_m = off_m.fold(0.0, f64::max);
        // Certificates assume that the leader is on the reference.
        let rounding = LEADER_ROUNDING * (1.0 + start.position_m.norm() + start.velocity_m_s.norm());
        if off_m_s.norm() <= rounding && off_m <= rounding {
            return Ok(());
        }
        let problem = format!(
            "the leader {} must start on the reference, got an offset of {} m and {} m/s",
            leader + 1,
            metres(off_m),
            metres(off_m_s.norm())
        );
        let help = "leave out its start velocity: the default is that of the reference";
        Err(ErrorKind::Reference.at(&[&entry_key("start.velocities_m_s", leader), "reference.leader"], problem, help))
    }

    /// Checks that the law follows a reference that these vehicles know.
    fn check_followed(&self, guidance: &Guidance) -> Result<(), ScenarioError> {
        let refuse = |said: String, help: &str, key: &'static str| {
            Err(ErrorKind::UnsupportedByLaw.at(&[key, "law.kind"], said, help))
        };
        match self.law() {
            Ok(law) if law.capabilities().controls != Controls::Places => {
                let follows = |spec: &LawSpec| {
                    let guidance = Guidance { known_by: Pinning::All, ..guidance.clone() };
                    let other = Self { law: spec.clone(), reference: Some(guidance), ..self.clone() };
                    Some(
                        other
                            .law()
                            .ok()
                            .filter(|law| law.capabilities().controls == Controls::Places)?
                            .name()
                            .to_owned(),
                    )
                };
                let laws: Vec<_> = LawSpec::all().iter().filter_map(follows).collect();
                let help = format!("set law.kind to one that does ({}), or leave out [reference]", laws.join(", "));
                refuse(format!("the law `{}` follows no reference", law.name()), &help, "reference.kind")
            }
            Err(error @ ParameterError::ReferenceNotHeard) => {
                let key = if guidance.known_by.leader().is_some() { "reference.leader" } else { "reference.known_by" };
                let help = "leave it out: then all vehicles know the reference; or set law.kind to \"displacement\"";
                refuse(error.to_string(), help, key)
            }
            // An invalid law is refused at its own keys.
            _ => Ok(()),
        }
    }

    fn check_lengths(&self) -> Result<(), ScenarioError> {
        check_lengths(
            self.count(),
            [
                ("start.velocities_m_s", "start velocities", Some(self.start.velocities_m_s.nrows())),
                ("formation.points_m", "slots in the formation", Some(self.formation().count())),
                ("swarm.mass_kg", "masses", Some(self.mass_kg.len())),
                ("swarm.hull_radius_m", "hull radii", Some(self.hull_radius_m.len())),
                ("graph.edges", "vehicles in the graph", Some(self.graph.count())),
            ],
        )
    }

    fn check_motion(&self) -> Result<(), ScenarioError> {
        let start = [
            ("start.positions_m".to_owned(), "the start position", &self.start.positions_m),
            ("start.velocities_m_s".to_owned(), "the start velocity", &self.start.velocities_m_s),
        ];
        let slots = self.legs.iter().enumerate();
        let slots = slots.map(|(number, leg)| (leg_key(number, "points_m"), "the slot", &leg.formation.slots_m));
        for (key, what, rows) in start.into_iter().chain(slots) {
            for i in 0..rows.nrows() {
                for axis in 0..3 {
                    let name = ["x", "y", "z"][axis];
                    check_size(&format!("{name} of {what} of vehicle {}", i + 1), rows[(i, axis)])
                        .map_err(|error| error.at(&[&entry_key(&key, i)]))?;
                }
                if self.space == Space::Plane && rows[(i, 2)] != 0.0 {
                    let z = rows[(i, 2)];
                    let problem = format!("z of {what} of vehicle {} must be 0 in the plane, got {z}", i + 1);
                    let help = "set z to 0, or swarm.dimensions to 3";
                    return Err(ErrorKind::Plane.at(&[&entry_key(&key, i), "swarm.dimensions"], problem, help));
                }
            }
        }
        Ok(())
    }

    fn check_separations(&self) -> Result<(), ScenarioError> {
        let delta_m = self.delta_m;
        let refuse = |said: String, help: &str, key: &str, pair: Pair| {
            let keys = [entry_key(key, pair.second()), entry_key(key, pair.first())];
            Err(ErrorKind::WithinDelta.at(&[&keys[0], &keys[1], "law.delta_m"], said, help))
        };
        let metric = self.metric();
        let apart = if metric.is_metres() { "apart," } else { "apart, scaled to the ellipsoid," };
        if let Some((pair, separation_m)) = first_pair_within(&metric.scaled_rows(&self.start.positions_m), delta_m) {
            let said = if separation_m == 0.0 {
                format!("vehicles {pair} start at the same point")
            } else {
                let separation = beside_limit(separation_m, delta_m, 3);
                format!("vehicles {pair} start {separation} m {apart} not more than delta = {delta_m} m")
            };
            let help = "move one of the vehicles away, or reduce law.delta_m";
            return refuse(said, help, "start.positions_m", pair);
        }
        let least_m = delta_m * (1.0 + SLOT_MARGIN);
        let too_near = |(number, leg): (usize, &Leg)| {
            Some((number, first_pair_within(&metric.scaled_rows(&leg.formation.slots_m), least_m)?))
        };
        if let Some((leg, (pair, distance_m))) = self.legs.iter().enumerate().find_map(too_near) {
            let distance = beside_limit(distance_m, delta_m, 3);
            let said = if distance_m == 0.0 {
                format!("the slots of vehicles {pair} are the same point")
            } else if distance_m <= delta_m {
                format!("the slots of vehicles {pair} are {distance} m apart, not more than delta = {delta_m} m")
            } else {
                format!(
                    "the slots of vehicles {pair} are farther apart than delta = {delta_m} m by less than a billionth"
                )
            };
            let help = "enlarge the formation, or reduce law.delta_m";
            return refuse(said, help, &leg_key(leg, "points_m"), pair);
        }
        Ok(())
    }

    fn check_hulls(&self) -> Result<(), ScenarioError> {
        let mut order: Vec<usize> = (0..self.count()).collect();
        order.sort_by(|&i, &j| self.hull_radius_m[j].total_cmp(&self.hull_radius_m[i]));
        let &[i, j, ..] = &order[..] else { return Ok(()) };
        let touching_m = self.hull_radius_m[i] + self.hull_radius_m[j];
        let least_m = self.metric().shortest_m(self.delta_m);
        if touching_m + CONTACT_PREDICTION_M <= least_m {
            return Ok(());
        }
        let problem = format!(
            "the hulls of vehicles {} touch at {} m, less than {CONTACT_PREDICTION_M} m before the safety distance \
             delta = {} m",
            Pair::new(i, j),
            exact(touching_m),
            self.delta_m
        );
        let help = match 0.5 * (least_m - CONTACT_PREDICTION_M) {
            _ if self.airframe.quadrotor().is_some() => {
                format!(
                    "enlarge law.delta_m to at least {}: the hulls are those of the model",
                    touching_m + CONTACT_PREDICTION_M
                )
            }
            largest_m if largest_m > 0.0 => {
                format!("set swarm.hull_radius_m to at most {largest_m}, or enlarge law.delta_m")
            }
            _ => format!("law.delta_m must be more than {CONTACT_PREDICTION_M} m"),
        };
        let hulls = [i, j].map(|i| entry_key("swarm.hull_radius_m", i));
        Err(ErrorKind::HullsTouch.at(&[&hulls[0], &hulls[1], "law.delta_m"], problem, help))
    }

    fn check_time(&self) -> Result<(), ScenarioError> {
        let TimeSpec { duration_s, dt_s, control_hz, .. } = self.time;
        if dt_s > duration_s {
            let problem = format!("one step of {dt_s} s is longer than the flight of {duration_s} s");
            let help = "enlarge time.duration_s or reduce time.dt_s";
            return Err(ErrorKind::StepTooLong.at(&["time.duration_s"], problem, help));
        }
        let steps = duration_s / dt_s;
        if steps > MAX_STEPS {
            let problem = format!(
                "a flight has at most {MAX_STEPS:e} steps, got {steps:.2e} ({duration_s} s in steps of {dt_s} s)"
            );
            let help = format!("at this step a flight may last {} s", (MAX_STEPS * dt_s).floor());
            return Err(ErrorKind::TooManySteps.at(&["time.duration_s", "time.dt_s"], problem, help));
        }
        if self.a22_per_s.abs() * dt_s > 1.0 {
            let problem = format!(
                "one step of {dt_s} s is longer than the time 1/|a22| = {} s in which velocities change by themselves",
                1.0 / self.a22_per_s.abs()
            );
            let help = "reduce time.dt_s or swarm.a22_per_s";
            return Err(ErrorKind::StepTooLong.at(&["swarm.a22_per_s", "time.dt_s"], problem, help));
        }
        if let Some(control_hz) = control_hz
            && control_hz * dt_s > 1.0 + 1e-6
        {
            let problem =
                format!("a control rate of {control_hz} Hz evaluates the law more than once in a step of {dt_s} s");
            let help = format!("reduce time.control_hz to at most {}, or reduce time.dt_s", 1.0 / dt_s);
            return Err(ErrorKind::StepTooLong.at(&["time.control_hz", "time.dt_s"], problem, help));
        }
        Ok(())
    }

    fn check_deadlock(&self) -> Result<(), ScenarioError> {
        let hold_s = self.deadlock.hold_s;
        if hold_s >= self.time.duration_s {
            let duration_s = self.time.duration_s;
            let problem =
                format!("spread slots must be held for less than the flight of {duration_s} s, got {hold_s} s");
            let help = "reduce deadlock.hold_s or increase time.duration_s: the slots must come together again";
            return Err(ErrorKind::OutsideFlight.at(&["deadlock.hold_s", "time.duration_s"], problem, help));
        }
        if self.deadlock.mode == DeadlockMode::Start
            && let Ok(law) = self.law()
            && law.capabilities().settling.is_none()
        {
            let problem = format!("the law `{}` does not support deadlock recovery", law.name());
            let help = "leave out deadlock.mode, or set law.kind to \"displacement\"";
            return Err(ErrorKind::UnsupportedByLaw.at(&["deadlock.mode", "law.kind"], problem, help));
        }
        Ok(())
    }

    /// Checks that the ellipsoid is one of revolution, as wide as delta, and that the law keeps ellipsoids apart.
    fn check_safety(&self) -> Result<(), ScenarioError> {
        let Safety::Ellipsoid { half_axes_m: [a_m, b_m, _] } = self.safety else { return Ok(()) };
        let key = "safety.half_axes_m";
        if a_m != b_m {
            let problem = format!("the horizontal half axes must be equal, got {a_m} m and {b_m} m");
            let help = "vehicles turn: set both to the larger one";
            return Err(ErrorKind::Inconsistent.at(&[key], problem, help));
        }
        let (delta_m, width_m) = (self.delta_m, 2.0 * a_m);
        if (delta_m - width_m).abs() > ROUNDING * width_m {
            let problem =
                format!("the safety distance must be the width of the ellipsoid, {width_m} m, got {delta_m} m");
            let help = "leave out law.delta_m: it is twice the horizontal half axes";
            return Err(ErrorKind::Inconsistent.at(&["law.delta_m", key], problem, help));
        }
        let Ok(law) = self.law() else { return Ok(()) };
        // A shield keeps the ellipsoids apart under any law.
        if law.capabilities().uses_ellipsoid_metric || self.shield.is_some() {
            return Ok(());
        }
        let problem = format!("the law `{}` does not support ellipsoids", law.name());
        let help = "set law.kind to \"displacement\", or safety.shape to \"ball\"";
        Err(ErrorKind::UnsupportedByLaw.at(&["safety.shape", "law.kind"], problem, help))
    }

    /// Checks that the wind acts on the vehicles, and its velocities and gusts.
    fn check_wind(&self) -> Result<(), ScenarioError> {
        let drag_per_s = self.drag_per_s;
        if drag_per_s * self.time.dt_s > 1.0 {
            let problem = format!(
                "one step of {} s is longer than the time 1/drag = {} s in which the air brakes a vehicle",
                self.time.dt_s,
                1.0 / drag_per_s
            );
            let help = "reduce time.dt_s or vehicle.drag_per_s";
            return Err(ErrorKind::StepTooLong.at(&["vehicle.drag_per_s", "time.dt_s"], problem, help));
        }
        if self.airframe.quadrotor().is_some() && drag_per_s != 0.0 {
            let problem = format!("only points have vehicle.drag_per_s, got {drag_per_s} 1/s");
            let help = "leave it out: the drag of a quadrotor is part of its model";
            return Err(ErrorKind::UnsupportedByVehicle.at(&["vehicle.drag_per_s", "vehicle.model"], problem, help));
        }
        if self.airframe.quadrotor().is_none() && !self.wind.is_still() && drag_per_s == 0.0 {
            let problem = "the wind has no effect on points without drag";
            let help = "set vehicle.drag_per_s, for example to 0.3";
            return Err(ErrorKind::UnsupportedByVehicle.at(&["wind", "vehicle.drag_per_s"], problem, help));
        }
        self.check_air("wind.mean_m_s", "the mean wind", self.wind.mean_m_s)?;
        self.wind.gusts.iter().try_for_each(|gust| self.check_gust(gust))
    }

    /// Checks a velocity of the air \[m/s\], which must be horizontal in the plane.
    fn check_air(&self, key: &'static str, what: &str, air_m_s: Vector3<f64>) -> Result<(), ScenarioError> {
        if self.space == Space::Plane && air_m_s.z != 0.0 {
            let problem = format!("{what} blows at {} m/s along z, out of the plane z = 0", air_m_s.z);
            let help = "set its z to 0, or swarm.dimensions to 3";
            return Err(ErrorKind::Plane.at(&[key, "swarm.dimensions"], problem, help));
        }
        Ok(())
    }

    fn check_gust(&self, gust: &Gust) -> Result<(), ScenarioError> {
        let Gust { at_s, rise_s, velocity_m_s, ref vehicles, .. } = *gust;
        self.check_air("wind.gust", "a gust", velocity_m_s)?;
        let shortest_s = STEPS_A_CHANGE * self.time.dt_s;
        for (what, slope_s) in [("the rise of a gust", rise_s), ("the fall of a gust", gust.fall_s())] {
            if slope_s < shortest_s {
                let problem = format!("{what} takes {slope_s} s, too short for steps of {} s", self.time.dt_s);
                let help = format!("give it at least {shortest_s} s, or reduce time.dt_s");
                return Err(ErrorKind::StepTooLong.at(&["wind.gust", "time.dt_s"], problem, help));
            }
        }
        if at_s >= self.time.duration_s {
            let problem = format!("a gust must begin within the flight of {} s, got {at_s} s", self.time.duration_s);
            let help = "let it begin earlier, or enlarge time.duration_s";
            return Err(ErrorKind::OutsideFlight.at(&["wind.gust", "time.duration_s"], problem, help));
        }
        match vehicles.as_deref() {
            Some([]) => Err(ErrorKind::Inconsistent.at(
                &["wind.gust"],
                "the list of vehicles of a gust is empty",
                "leave out `vehicles`: the gust then acts on all vehicles",
            )),
            met => match met.unwrap_or_default().iter().find(|&&vehicle| vehicle >= self.count()) {
                Some(vehicle) => {
                    let problem = format!("a gust acts on vehicle {}, but the swarm has {}", vehicle + 1, self.count());
                    let help = format!("give numbers from 1 to {}", self.count());
                    Err(ErrorKind::UnknownVehicle.at(&["wind.gust"], problem, help))
                }
                None => Ok(()),
            },
        }
    }
}

/// Returns an error of the parameters of a law at its key.
fn of_law(error: &ParameterError) -> ScenarioError {
    let slot = |vehicle| entry_key("formation.points_m", vehicle);
    let refuse = |help: &str, keys: &[&str]| {
        ErrorKind::LawParameter.at(keys, format!("no law has these parameters: {error}"), help)
    };
    match *error {
        ParameterError::Tension { pair, .. } => {
            let keys = [&*slot(pair.second()), &slot(pair.first()), "law.delta_m"];
            refuse("enlarge the formation, or change law.delta_m", &keys)
        }
        ParameterError::ObstacleOverSlot { vehicle, obstacle, .. } => {
            let help = "move one of them away, or reduce the clearance_m of the obstacle";
            refuse(help, &[&slot(vehicle), &entry_key("obstacle", obstacle)])
        }
        ParameterError::Slot { vehicle } => refuse("give finite numbers", &[&slot(vehicle)]),
        ParameterError::Counts { .. } | ParameterError::Disconnected { .. } => {
            refuse("add edges until every vehicle can be reached from every other", &["graph.edges"])
        }
        ParameterError::ReferenceUnknown | ParameterError::ReferenceNotHeard => {
            let help = "leave it out: then all vehicles know the reference; or add edges to the graph";
            refuse(help, &["reference.known_by", "reference.leader", "graph.edges"])
        }
        ParameterError::OnlyBraking { name, .. } => {
            refuse("leave it out, or set law.variant to \"braking\"", &[&format!("law.{name}"), "law.variant"])
        }
        ParameterError::CannotBrake { .. } => {
            let keys = ["law.max_speed_m_s", "law.max_accel_m_s2", "swarm.a22_per_s"];
            refuse("lower law.max_speed_m_s, or raise law.max_accel_m_s2", &keys)
        }
        ParameterError::NotFinite { .. } => refuse("give finite numbers", &["law.kind"]),
        ParameterError::Memory { .. } => {
            refuse("use fewer vehicles, or a graph of fewer edges", &["swarm.count", "graph.kind"])
        }
    }
}

/// Refuses a number that is not finite, or larger in magnitude than [`LARGEST`].
fn check_size(what: &str, number: f64) -> Result<(), ScenarioError> {
    if number.abs() <= LARGEST {
        return Ok(());
    }
    let (problem, help) = match number {
        _ if number.is_nan() => (format!("{what} is not a number"), "give a finite number"),
        _ if number.is_infinite() => (format!("{what} is infinite"), "give a finite number"),
        _ => (format!("{what} must be at most {LARGEST:e} in magnitude, got {number:e}"), "give a smaller number"),
    };
    Err(ErrorKind::OutOfRange.at(&[], problem, help))
}

/// Refuses a graph in which some vehicle cannot be reached from vehicle 1.
fn check_connected(graph: &Graph) -> Result<(), ScenarioError> {
    let apart = graph.unreachable();
    if apart.is_empty() {
        return Ok(());
    }
    let named: Vec<_> = apart.iter().take(NAMED_VEHICLES).map(|i| (i + 1).to_string()).collect();
    let more = if apart.len() > NAMED_VEHICLES { " and more" } else { "" };
    let problem = format!("the graph is not connected: no path joins vehicle 1 to {}{more}", named.join(", "));
    let help = "add edges until every vehicle can be reached from every other";
    Err(ErrorKind::Disconnected.at(&["graph.edges"], problem, help))
}
