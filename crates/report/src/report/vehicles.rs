//! What flew, in words.

use tautline_sim::scenario::{PlantSpec, Scenario};
use tautline_sim::vehicle::Airframe;

/// What the vehicles were taken to be, and what becomes of a command.
pub(super) fn plant(scenario: &Scenario) -> (String, &'static str) {
    match (&scenario.airframe, scenario.plant) {
        (Airframe::Unicycle(_), _) => (
            "The vehicles are unicycles: they go where they look, turn no faster than they can, and never stop. Their way within a \
             step is an arc in closed form, which the audit takes for straight: they leave it by less than 1e-5 m. Mass and hull \
             play no part."
                .to_owned(),
            "held over it",
        ),
        (Airframe::Quadrotor(quadrotor), PlantSpec::Rapier) => (
            format!(
                "The vehicles are quadrotors ({}): rigid bodies in Rapier with six degrees of freedom that four rotors lift, under \
                 gravity, with the lag of their motors, drag and an attitude loop at {} Hz; within a step each moves on a straight \
                 line at constant speed, and hulls that touch push each other. Everything is computed \
                 in double precision.",
                quadrotor.model.name,
                quadrotor.attitude_hz
            ),
            "held until the next one",
        ),
        (Airframe::Point, PlantSpec::Rapier) => (
            "The vehicles are rigid bodies in Rapier without rotation; within a step each moves on a straight line \
             at constant speed. Commands are accelerations, so mass changes nothing, and neither do hulls, until a pair is \
             so close that they touch. Everything is computed in double precision."
                .to_owned(),
            "held over it",
        ),
        (Airframe::Quadrotor(quadrotor), PlantSpec::Ideal) => (
            format!(
                "The vehicles are quadrotors ({}) whose equations of motion are solved in continuous time by an integrator of 8th \
                 order in double precision (64 bits); hulls play no part, and there is no engine to see contacts. The audit takes \
                 them to move on straight lines within a step.",
                quadrotor.model.name
            ),
            "held until the next one",
        ),
        (Airframe::Point, PlantSpec::Ideal) => (
            "The vehicles are points that follow the equation of motion, solved in continuous time by an integrator of \
             8th order in double precision (64 bits); mass and hull play no part, and there is no engine to see \
             contacts. The audit takes them to move on straight lines within a step."
                .to_owned(),
            "recorded; the motion between follows the law in continuous time",
        ),
    }
}
