//! Rigid bodies in Rapier, in double precision. Only this module uses the engine.
//!
//! Each vehicle is a dynamic body with locked rotation and no gravity. It has two ball colliders. The **hull** has the
//! vehicle's real radius; hulls collide and bounce. The **keep-out** ball has the radius delta/2; it reports contacts
//! and never pushes. In an ellipsoid it is the largest ball inside. In the plane z = 0, translation along z is locked
//! as well.
//!
//! # Motion within a step
//! With one solver iteration and no contact the engine computes `v += u dt; p += v dt`. A vehicle moves on a straight
//! line within a step, and a linear sweep of the step is exact. (With n iterations the position would gain `u dt^2
//! (n+1)/(2n)` instead of `u dt^2`.)
//!
//! # Second order
//! Velocities are set around the engine's step so that the whole is kick, drift, kick, with one command per step. From
//! a completed state (p, v) with the held acceleration u:
//!
//! ```text
//! w  = v e^(a22 dt/2) + (dt/2) u       the engine starts from w - dt u, adds dt u, and drifts: p' = p + dt w
//! v~ = (w + (dt/2) u) e^(a22 dt/2)     predicted, from which the law makes the next command u'
//! v' = (w + (dt/2) u') e^(a22 dt/2)    completed, and recorded
//! ```
//!
//! A free velocity is exactly v(0) exp(a22 t), the free motion of equation (1). A held command (u' = u) gives the exact
//! motion under a constant acceleration if a22 = 0. Forces u m go through the engine, so that the effect of contacts on
//! velocities stays in w.
//!
//! # Wind
//! A point with a drag d in a wind W obeys p'' = (a22 - d) v + u + d W. So a22 - d replaces a22, and u + d W replaces
//! u, with W at the beginning of the step in w and at its end in v~ and v'. This is the trapezoidal rule for d W, of
//! second order.
//!
//! # Quadrotors
//! A quadrotor is a rotating body with the model's mass, inertia and hull. Gravity, rotors and drag are added around
//! the engine's step as above: half the kick of the state before, the drift, and half the kick of the state after. The
//! velocities of that state are predicted first. For rotation, the kick changes the angular momentum, which is constant
//! without torque:
//!
//! ```text
//! l  = R J W + (dt/2) R M              the engine turns by the angular velocity of l in the middle of the step
//! W' = J^-1 (R'^T l + (dt/2) M')       about the body's axes, with the torque M' at the end
//! ```
//!
//! The engine's own gyroscopic term, of first order, is off. Friction between hulls makes vehicles tumble after a
//! collision. Rotors follow their commanded speeds exactly over the step, and attitude loops run at its beginning.
//!
//! # Contacts
//! The engine detects contacts before it moves the bodies. Contacts reported after a step belong to the state before
//! it: they are evidence that comes one step late, not the verdict.
//!
//! # Free steps
//! While all distances of pairs, and to obstacles, are beyond the reach of contacts, the plants can do the operations
//! of the engine for a body without contacts. Vector simulations, studies and `tautline run --free-steps` leave the
//! engine out of these steps. Except in vector simulations, the engine repeats each eighth of
//! them, and any difference is an error. In all other flights the engine makes every step.
//!
//! In vector simulations keep-out balls may overlap in a free step: they change no motion, and the plants report the
//! overlaps from the distances of the pairs. The engine is created for its first step, and dropped after contacts.

mod bodies;
mod mover;
mod proximity;
mod quadrotors;
mod world;

use crate::plant::{Plant, Quadrotors};
use crate::scenario::Scenario;
use crate::vehicle::Fleet;

/// Creates rigid bodies at the scenario's start.
#[must_use]
pub fn plant(scenario: &Scenario) -> Box<dyn Plant> {
    match scenario.fleet() {
        Some(fleet) => quadrotors(scenario, fleet),
        None => Box::new(bodies::Bodies::new(scenario)),
    }
}

/// Creates quadrotors in the states of a fleet, with the delta and the obstacles of a scenario.
#[must_use]
pub fn quadrotors(scenario: &Scenario, fleet: Fleet) -> Box<dyn Quadrotors> {
    Box::new(quadrotors::Fliers::new(scenario, fleet))
}
