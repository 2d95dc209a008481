//! Models of vehicles that are not points, and their equations of motion.
//!
//! [`Model`] holds the parameters of a quadrotor, [`Quadrotor`] adds the options of a flight. [`Dynamics`] is built
//! from both: forces and torques of a [`State`], lagging rotors, and the attitude loop that converts a commanded
//! acceleration into rotor speeds. Plants integrate these equations.
//!
//! # Frames
//! World: z up. Body: x ahead, y to the left, z along the thrust. An attitude rotates from body to world. Rotors are
//! numbered in the order of the model.

mod dynamics;
mod fleet;
mod model;
mod rotors;
mod tracking;
mod unicycle;

pub use dynamics::{Attitude, Drift, Dynamics, Ground, LEAST_LIFT, State, THRUST_RESERVE, Wrench};
pub use fleet::{Fleet, HEIGHT_RAD_S, RotorFailure};
pub use model::{GRAVITY_M_S2, MODELS, Model, Quadrotor, RotorDirection, built_in, read};
pub use rotors::{AIR_DENSITY_KG_M3, Downwash, Mixer, RotorCurve, RotorLag};
pub use tracking::{Tracking, TrackingSearch};
pub use unicycle::{Heading, Steering, Unicycle};

/// Kind of body of a vehicle.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Airframe {
    /// A point that executes accelerations exactly.
    #[default]
    Point,
    /// A rigid body lifted by four rotors.
    Quadrotor(Box<Quadrotor>),
    /// A vehicle in the plane that moves along its heading and cannot stop.
    Unicycle(Unicycle),
}

impl Airframe {
    /// Returns whether the vehicle is a point.
    #[must_use]
    pub fn is_point(&self) -> bool {
        *self == Self::Point
    }

    /// Returns the quadrotor, if the vehicle is one.
    #[must_use]
    pub fn quadrotor(&self) -> Option<&Quadrotor> {
        match self {
            Self::Quadrotor(quadrotor) => Some(quadrotor),
            Self::Point | Self::Unicycle(_) => None,
        }
    }

    /// Returns the unicycle, if the vehicle is one.
    #[must_use]
    pub fn unicycle(&self) -> Option<&Unicycle> {
        match self {
            Self::Unicycle(unicycle) => Some(unicycle),
            Self::Point | Self::Quadrotor(_) => None,
        }
    }
}
