//! Rigid bodies in Rapier, in double precision. Only this module uses the engine.
//!
//! Each vehicle is a dynamic body with rotations locked, no gravity and two ball colliders: the **hull** (the vehicle's
//! real radius; hulls collide and bounce) and the **keep-out** ball of radius delta/2 (reports contacts, never pushes); in an
//! ellipsoid it is the largest ball within.
//! In the plane z = 0 translation along z is locked as well.
//!
//! # Motion within a step
//! With one solver iteration and no contact the engine updates `v += u dt; p += v dt`, so within a step a vehicle moves on a
//! straight line and a linear sweep of the step is exact. (With n iterations the position would gain
//! `u dt^2 (n+1)/(2n)` instead of `u dt^2`.)
//!
//! # Second order
//! Velocities are set around the engine's step so that the whole is kick, drift, kick, with one command a step. From a
//! completed state (p, v) with the held acceleration u
//!
//! ```text
//! w  = v e^(a22 dt/2) + (dt/2) u       the engine starts from w - dt u, adds dt u, and drifts: p' = p + dt w
//! v~ = (w + (dt/2) u) e^(a22 dt/2)     predicted, from which the law makes the next command u'
//! v' = (w + (dt/2) u') e^(a22 dt/2)    completed, and recorded
//! ```
//!
//! A free velocity is exactly v(0) exp(a22 t), the free motion of equation (1); a command that is held (u' = u) gives the
//! motion under a constant acceleration exactly, where a22 = 0. Forces u m go through the engine, so that what
//! its contacts do to a velocity stays in w.
//!
//! # Wind
//! A point with a drag d in a wind W obeys p'' = (a22 - d) v + u + d W: a22 - d takes the place of a22, and u + d W that of u, with
//! W at the beginning of the step in w and at its end in v~ and v'. That is the trapezium's rule for d W, and second order.
//!
//! # Quadrotors
//! A quadrotor is a body that turns, with the model's mass, inertia and hull; gravity, rotors and drag are added around the
//! engine's step as above: half of the kick of the state before, the drift, half of the kick of the state after, whose
//! velocities are predicted first. For rotation the kick is one of angular momentum, which keeps without torque:
//!
//! ```text
//! l  = R J W + (dt/2) R M              the engine turns by the angular velocity that l has in the middle of the step
//! W' = J^-1 (R'^T l + (dt/2) M')       about the body's axes, with the torque M' at the end
//! ```
//!
//! The engine's own gyroscopic term, of first order, is switched off. Friction between hulls makes vehicles tumble after a
//! hit. Rotors follow what is asked of them exactly over the step, and attitude loops run at its beginning.
//!
//! # Contacts
//! The engine looks for contacts before it moves the bodies, so those that it reports after a step are of the state
//! before that step: evidence that comes one step late, and never the verdict.

mod bodies;
mod quadrotors;
mod world;

use crate::plant::{Plant, Quadrotors};
use crate::scenario::Scenario;
use crate::vehicle::Fleet;

/// Returns a swarm of rigid bodies at the scenario's start.
#[must_use]
pub fn plant(scenario: &Scenario) -> Box<dyn Plant> {
    match scenario.fleet() {
        Some(fleet) => quadrotors(scenario, fleet),
        None => Box::new(bodies::Bodies::new(scenario)),
    }
}

/// Returns quadrotors in any state, with the delta and the obstacles of a scenario.
#[must_use]
pub fn quadrotors(scenario: &Scenario, fleet: Fleet) -> Box<dyn Quadrotors> {
    Box::new(quadrotors::Fliers::new(scenario, fleet))
}
