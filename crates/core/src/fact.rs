//! Facts that a statement rests on, each with its source.
//!
//! A statement such as "clear" or "certified" carries the list of its [`Fact`]s. Printing, JSON and proofs read this
//! list. A fact that the data contradict is refused, or voids the statement.

use std::fmt;

use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// Value with a stable code, which programs may compare.
pub trait Coded {
    /// Returns the code, in lower case with hyphens.
    fn code(&self) -> &'static str;
}

/// Declares an enum without data and the code of each value.
macro_rules! coded {
    ($(#[$of_type:meta])* $name:ident { $($(#[$of_value:meta])* $value:ident = $code:literal,)* }) => {
        $(#[$of_type])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum $name {
            $($(#[$of_value])* $value,)*
        }

        impl Coded for $name {
            fn code(&self) -> &'static str {
                match self {
                    $(Self::$value => $code,)*
                }
            }
        }

        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.code())
            }
        }
    };
}

coded! {
    /// Subject of a fact.
    FactKind {
        /// Motion between two samples: straight, held, bounded or on curves.
        Motion = "motion",
        /// Unit of the recorded times.
        TimeUnit = "time-unit",
        /// Unit of the recorded positions.
        LengthUnit = "length-unit",
        /// Unit of the recorded heights.
        HeightUnit = "height-unit",
        /// Surface from which heights are measured.
        HeightReference = "height-reference",
        /// Clock of the vehicles: one for all, with stamps or log times.
        Clock = "clock",
        /// Frame and origin of the positions.
        Frame = "frame",
        /// Which column, file or topic is which vehicle.
        Identity = "identity",
        /// Longest gap between two samples that counts as presence.
        LongestGap = "longest-gap",
        /// Order of rows, repeated rows and missing values.
        Rows = "rows",
        /// Clock of a file beside the recording: paths of obstacles, plans, offsets.
        SideFileClock = "side-file-clock",
        /// Axes in which a recording and its plan are compared.
        SideFileAxes = "side-file-axes",
        /// Frame and origin of a plan beside the recording.
        SideFileFrame = "side-file-frame",
        /// Vehicles at or below a height are not judged among each other.
        GroundExemption = "ground-exemption",
        /// Obstacles on which vehicles land are not judged while a vehicle is at or below a height.
        LandingExemption = "landing-exemption",
        /// Motion of an obstacle outside the times of its path.
        ObstacleMotion = "obstacle-motion",
        /// File of settings from which options were taken.
        SettingsFile = "settings-file",
        /// The announced starts of a pair, equal on both sides.
        SharedStarts = "shared-starts",
        /// Commands up to a bound are carried out.
        Acceleration = "acceleration",
        /// Bound on pushes.
        Disturbance = "disturbance",
        /// Bound on the error of a measured or received position.
        PositionError = "position-error",
        /// Bound on the error of a measured or received velocity.
        VelocityError = "velocity-error",
        /// Largest coordinate, for the rounding of doubles.
        Coordinates = "coordinates",
        /// Largest speed.
        Speed = "speed",
        /// Distance of a vehicle from its reference.
        TrackingError = "tracking-error",
        /// Number of flights of the search for the largest distance of a vehicle from its reference.
        TrackingSearch = "tracking-search",
        /// Length of the control period.
        Period = "period",
        /// Age of a measurement or message.
        Age = "age",
        /// Smallest delay of a message between its stamp and its arrival.
        Latency = "latency",
        /// Each name of a vehicle belongs to one clock and one sequence of messages.
        OneStream = "one-stream",
        /// Sent velocities agree with positions over windows of the history.
        VelocityAgreement = "velocity-agreement",
    }
}

coded! {
    /// Source of a fact.
    Source {
        /// Proved from other facts.
        Proved = "proved",
        /// Contained in the recording or reported by the live source.
        Recorded = "recorded",
        /// Follows from the data: a header, a schema, a curve.
        Deduced = "deduced",
        /// Guessed from numbers.
        Inferred = "inferred",
        /// Rule of the format.
        Convention = "convention",
        /// Given by the user.
        Declared = "declared",
        /// Default of the program.
        Default = "default",
        /// Exchanged by the vehicles and compared.
        Exchanged = "exchanged",
        /// Observed over the flight.
        Observed = "observed",
        /// Cannot be observed from the data at hand.
        NotObservable = "not-observable",
    }
}

/// Value of a fact.
#[derive(Clone, Debug, PartialEq)]
pub enum FactValue {
    /// Number with its unit.
    Number(f64, &'static str),
    /// Name: of a unit, a file, a topic, a kind of motion.
    Name(String),
}

/// The number with its unit, or the name.
impl fmt::Display for FactValue {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(value, unit) => write!(out, "{value:?} {unit}"),
            Self::Name(name) => out.write_str(name),
        }
    }
}

/// Fact that a statement rests on.
#[derive(Clone, Debug, PartialEq)]
pub struct Fact {
    /// Subject of the fact.
    pub kind: FactKind,
    /// Source of the fact.
    pub source: Source,
    /// Value, if the fact has one.
    pub value: Option<FactValue>,
}

impl Fact {
    /// Fact without a value.
    #[must_use]
    pub fn new(kind: FactKind, source: Source) -> Self {
        Self { kind, source, value: None }
    }

    /// Fact with a number in a unit.
    #[must_use]
    pub fn number(kind: FactKind, source: Source, value: f64, unit: &'static str) -> Self {
        Self { kind, source, value: Some(FactValue::Number(value, unit)) }
    }

    /// Fact with a name.
    #[must_use]
    pub fn name(kind: FactKind, source: Source, value: impl Into<String>) -> Self {
        Self { kind, source, value: Some(FactValue::Name(value.into())) }
    }
}

impl Coded for Fact {
    fn code(&self) -> &'static str {
        self.kind.code()
    }
}

/// An object with the keys `fact`, `source`, `value` and `unit`; the last two are null without a value or a unit.
impl Serialize for Fact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Fact", 4)?;
        object.serialize_field("fact", &self.kind)?;
        object.serialize_field("source", &self.source)?;
        match &self.value {
            Some(FactValue::Number(value, unit)) => {
                object.serialize_field("value", value)?;
                object.serialize_field("unit", unit)?;
            }
            Some(FactValue::Name(name)) => {
                object.serialize_field("value", name)?;
                object.serialize_field("unit", &None::<&str>)?;
            }
            None => {
                object.serialize_field("value", &None::<&str>)?;
                object.serialize_field("unit", &None::<&str>)?;
            }
        }
        object.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fact_is_an_object_of_codes_and_a_value_with_its_unit() {
        let json = |fact: Fact| serde_json::to_string(&fact).expect("serializable");
        assert_eq!(
            json(Fact::number(FactKind::PositionError, Source::Declared, 0.5, "m")),
            r#"{"fact":"position-error","source":"declared","value":0.5,"unit":"m"}"#
        );
        assert_eq!(
            json(Fact::name(FactKind::TimeUnit, Source::Inferred, "ms")),
            r#"{"fact":"time-unit","source":"inferred","value":"ms","unit":null}"#
        );
        assert_eq!(
            json(Fact::new(FactKind::SharedStarts, Source::Exchanged)),
            r#"{"fact":"shared-starts","source":"exchanged","value":null,"unit":null}"#
        );
    }
}
