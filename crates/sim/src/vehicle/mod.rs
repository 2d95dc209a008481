//! Vehicles that are more than points: their models, and the equations of their motion.
//!
//! [`Model`] holds the numbers of a quadrotor, [`Quadrotor`] how it is flown. [`Dynamics`] is made of both: forces and
//! torques of a [`State`], rotors that lag, and the attitude loop that makes rotor speeds of a commanded acceleration.
//! Nothing here moves anything: that is what a plant does.
//!
//! # Frames
//! World: z up. Body: x ahead, y to the left, z along the thrust. An attitude turns body into world. Rotors are counted in
//! the order of the model.

mod dynamics;
mod fleet;
mod model;
mod rotors;
mod unicycle;

pub use dynamics::{Attitude, Drift, Dynamics, Ground, LEAST_LIFT, State, THRUST_RESERVE, Wrench};
pub use fleet::{Fleet, HEIGHT_RAD_S, RotorFailure};
pub use model::{GRAVITY_M_S2, MODELS, Misread, Model, ModelError, Quadrotor, Turn, read};
pub use rotors::{AIR_DENSITY_KG_M3, Downwash, Mixer, RotorCurve, RotorLag};
pub use unicycle::{Heading, Steering, Unicycle};

/// What kind of body a vehicle is.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Airframe {
    /// A point that carries out accelerations exactly.
    #[default]
    Point,
    /// A rigid body that four rotors lift.
    Quadrotor(Box<Quadrotor>),
    /// A vehicle in the plane that goes where it looks and cannot stop.
    Unicycle(Unicycle),
}

impl Airframe {
    /// Whether it is a point.
    #[must_use]
    pub fn is_point(&self) -> bool {
        *self == Self::Point
    }

    /// The quadrotor, where it is one.
    #[must_use]
    pub fn quadrotor(&self) -> Option<&Quadrotor> {
        match self {
            Self::Quadrotor(quadrotor) => Some(quadrotor),
            Self::Point | Self::Unicycle(_) => None,
        }
    }

    /// The unicycle, where it is one.
    #[must_use]
    pub fn unicycle(&self) -> Option<&Unicycle> {
        match self {
            Self::Unicycle(unicycle) => Some(unicycle),
            Self::Point | Self::Quadrotor(_) => None,
        }
    }
}
