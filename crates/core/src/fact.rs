//! Facts that a statement rests on, each with its source.
//!
//! A statement such as "clear" or "certified" carries the list of its [`Fact`]s. Printing, JSON and proofs read this
//! list. A fact that the data contradict is refused, or voids the statement.

use std::fmt;

use crate::option::ACCEL_WINDOW;
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

/// Value with a stable code, which programs may compare.
pub trait Coded {
    /// Codes of all values.
    const CODES: &'static [&'static str];

    /// Returns the code, in lower case with hyphens.
    fn code(&self) -> &'static str;
}

/// Code and sentence of a value, as in JSON.
#[derive(Serialize)]
struct Statement {
    code: &'static str,
    text: String,
}

/// Serialises values as objects with `code` and `text`.
///
/// # Errors
/// Those of the serialiser.
pub fn serialize_coded<T: Coded + fmt::Display, S: Serializer>(values: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|value| Statement { code: value.code(), text: value.to_string() }))
}

/// Implements [`Coded`] for an enum by a pattern and the code of each value.
#[macro_export]
macro_rules! impl_coded {
    ($name:ty { $($value:pat => $code:literal,)* }) => {
        impl $crate::fact::Coded for $name {
            const CODES: &'static [&'static str] = &[$($code),*];

            fn code(&self) -> &'static str {
                match self {
                    $($value => $code,)*
                }
            }
        }
    };
}

/// Declares an enum without data and the code of each value, which is also its JSON.
#[macro_export]
macro_rules! coded {
    ($(#[$of_type:meta])* $name:ident { $($(#[$of_value:meta])* $value:ident = $code:literal,)* }) => {
        $(#[$of_type])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum $name {
            $($(#[$of_value])* $value,)*
        }

        impl $name {
            /// All values.
            pub const ALL: [Self; [$($code),*].len()] = [$(Self::$value),*];
        }

        $crate::impl_coded! { $name { $(Self::$value => $code,)* } }

        impl ::serde::Serialize for $name {
            fn serialize<S: ::serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str($crate::fact::Coded::code(self))
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
        /// The clocks of all vehicles started together.
        CommonStart = "common-start",
        /// The clock of each vehicle is set by GPS.
        GpsClocks = "gps-clocks",
        /// Positions are taken at their times of logging.
        LogTimes = "log-times",
        /// Transforms of frames are uniform between their samples.
        UniformTransforms = "uniform-transforms",
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
        /// An obstacle stands still outside the times of its path.
        ObstacleMotion = "obstacle-motion",
        /// Motion of a plan between its samples.
        PlanMotion = "plan-motion",
        /// The heights of flight and plan have one reference.
        PlanHeights = "plan-heights",
        /// Flight and plan are compared in the plane of x and y.
        PlanPlane = "plan-plane",
        /// Motion of a vehicle after the end of its published plan.
        PlanEnd = "plan-end",
        /// Instants at which plans are published.
        PlanPublication = "plan-publication",
        /// Assignment of plans to recorded flights.
        FlownPlans = "flown-plans",
        /// Accelerations are means over windows.
        MeanAcceleration = "mean-acceleration",
        /// Accelerations are those of the parabolas through three samples in a row.
        SampledAcceleration = "sampled-acceleration",
        /// Vehicles round off the corners of their curves, where the velocity jumps.
        RoundedCorners = "rounded-corners",
        /// File of settings from which options were taken.
        SettingsFile = "settings-file",
        /// The announced starts of a pair, equal on both sides.
        SharedStarts = "shared-starts",
        /// No earlier flight from the same starts had the number of this flight.
        FlightNumber = "flight-number",
        /// A vehicle that returns has saved its contracts before each message and command.
        SavedContracts = "saved-contracts",
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
#[non_exhaustive]
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
#[non_exhaustive]
pub struct Fact {
    /// Subject of the fact.
    pub kind: FactKind,
    /// Source of the fact.
    pub source: Source,
    /// Value, if the fact has one.
    pub value: Option<FactValue>,
    /// Vehicle, obstacle or file that the fact is about; `None` for a fact about all.
    pub subject: Option<String>,
}

impl Fact {
    /// Returns a fact without a value.
    #[must_use]
    pub fn new(kind: FactKind, source: Source) -> Self {
        Self { kind, source, value: None, subject: None }
    }

    /// Returns a fact with a number in a unit.
    #[must_use]
    pub fn number(kind: FactKind, source: Source, value: f64, unit: &'static str) -> Self {
        Self { value: Some(FactValue::Number(value, unit)), ..Self::new(kind, source) }
    }

    /// Returns a fact with a name as its value.
    #[must_use]
    pub fn name(kind: FactKind, source: Source, value: impl Into<String>) -> Self {
        Self { value: Some(FactValue::Name(value.into())), ..Self::new(kind, source) }
    }

    /// Returns whether the value is this name.
    #[must_use]
    pub fn is_named(&self, name: &str) -> bool {
        matches!(&self.value, Some(FactValue::Name(own)) if own == name)
    }

    /// Returns the fact about one vehicle, obstacle or file.
    #[must_use]
    pub fn about(self, subject: impl Into<String>) -> Self {
        Self { subject: Some(subject.into()), ..self }
    }

    /// Returns whether a clear verdict rests on the fact as an assumption: the data leave another case open. A verdict
    /// with an assumption is not proved.
    #[must_use]
    pub fn is_assumption(&self) -> bool {
        match self.kind {
            FactKind::Motion => self.is_named(STRAIGHT) || self.is_named(HELD),
            // A recording with latitudes and longitudes may have heights in feet.
            FactKind::HeightUnit | FactKind::PlanEnd | FactKind::PlanPublication => self.source == Source::Default,
            FactKind::CommonStart
            | FactKind::FlownPlans
            | FactKind::GpsClocks
            | FactKind::LogTimes
            | FactKind::UniformTransforms
            | FactKind::ObstacleMotion
            | FactKind::PlanMotion
            | FactKind::PlanHeights
            | FactKind::PlanPlane
            | FactKind::MeanAcceleration
            | FactKind::SampledAcceleration
            | FactKind::RoundedCorners => true,
            _ => false,
        }
    }
}

/// Name of straight motion between two samples.
pub const STRAIGHT: &str = "straight";
/// Name of rest between two samples, with a jump at each.
pub const HELD: &str = "held";
/// Name of any motion whose accelerations stay within a bound.
pub const BOUNDED: &str = "bounded";
/// Name of motion on recorded curves.
pub const CURVES: &str = "curves";
/// Name of the motion of a run whose every step is recorded.
pub const EVERY_STEP: &str = "every-step";
/// Name of the motion along the chords of steps, from which paths differ by less than a bound.
pub const CHORDS: &str = "chords";
/// Name of the motion that the audit of a run has judged step by step.
pub const RUN_AUDIT: &str = "run-audit";

/// Writes the fact as a clause, such as `straight between samples`.
impl fmt::Display for Fact {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.value.as_ref().map_or_else(String::new, ToString::to_string);
        let subject = self.subject.as_deref().unwrap_or_default();
        match self.kind {
            FactKind::Motion if !subject.is_empty() => write!(out, "{subject} by straight lines between samples"),
            FactKind::Motion => out.write_str(match value.as_str() {
                STRAIGHT => "straight between samples",
                HELD => "held between samples, jumps swept",
                BOUNDED => "accelerations within their bounds",
                CURVES => "on the recording's curves",
                EVERY_STEP => "on every step of the run",
                CHORDS => "along the chords of every step",
                RUN_AUDIT => "by the run's audit of every step",
                other => other,
            }),
            FactKind::HeightUnit => write!(out, "heights are in {}", if value == "m" { "metres" } else { &value }),
            FactKind::CommonStart => out.write_str("the clocks of all vehicles started together"),
            FactKind::GpsClocks => out.write_str("clocks set by the GPS of each vehicle"),
            FactKind::LogTimes => out.write_str("positions at their times of logging"),
            FactKind::UniformTransforms => out.write_str("transforms uniform between their samples"),
            FactKind::ObstacleMotion => write!(out, "the obstacle {subject} stands still {value}"),
            FactKind::PlanMotion if subject.is_empty() => out.write_str("the plan is straight between its samples"),
            FactKind::PlanMotion => write!(out, "{subject} is straight between samples"),
            FactKind::PlanHeights => out.write_str("the heights of flight and plan have one reference"),
            FactKind::PlanPlane => out.write_str("flight and plan have equal heights, which are not compared"),
            FactKind::PlanEnd => write!(
                out,
                "after the end of its plan {}",
                match value.as_str() {
                    "hold" => "each vehicle holds the last point",
                    "continue" => "each vehicle flies on with its last velocity",
                    _ => "the motion of each vehicle is unknown",
                }
            ),
            FactKind::PlanPublication => write!(out, "plans are published at {value}"),
            FactKind::FlownPlans => write!(out, "plans have the frame and the clock of the positions, and {value}"),
            FactKind::MeanAcceleration => write!(out, "accelerations are means over {value}"),
            FactKind::SampledAcceleration => {
                out.write_str("accelerations are those of the parabolas through three samples in a row")
            }
            FactKind::RoundedCorners => write!(
                out,
                "vehicles round off corners (the velocity of {subject} jumps by {value}; {ACCEL_WINDOW} judges them)"
            ),
            FactKind::OneStream => out.write_str(match self.source {
                Source::NotObservable => "two vehicles under one name would not be noticed",
                _ => "each name is that of one vehicle",
            }),
            FactKind::VelocityAgreement => out.write_str(match self.source {
                Source::NotObservable => "sent velocities are not compared with positions yet",
                _ => "sent velocities agree with positions",
            }),
            kind => {
                out.write_str(kind.code())?;
                if !subject.is_empty() {
                    write!(out, " of {subject}")?;
                }
                if value.is_empty() { Ok(()) } else { write!(out, ": {value}") }
            }
        }
    }
}

impl Coded for Fact {
    const CODES: &'static [&'static str] = FactKind::CODES;

    fn code(&self) -> &'static str {
        self.kind.code()
    }
}

/// Writes an object with the keys `fact`, `source`, `value`, `unit` and `subject`; the last three may be null.
impl Serialize for Fact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_struct("Fact", 5)?;
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
        object.serialize_field("subject", &self.subject)?;
        object.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facts_of_a_watch_have_sentences_for_both_sources() {
        for kind in [FactKind::OneStream, FactKind::VelocityAgreement] {
            let [seen, unseen] = [Source::Observed, Source::NotObservable].map(|of| Fact::new(kind, of).to_string());
            assert!(seen != unseen && unseen.contains(" not "), "{seen}; {unseen}");
            assert!(![seen, unseen].contains(&kind.code().to_owned()));
        }
    }

    #[test]
    fn a_fact_is_an_object_of_codes_and_a_value_with_its_unit() {
        let json = |fact: Fact| serde_json::to_string(&fact).expect("serializable");
        assert_eq!(
            json(Fact::number(FactKind::PositionError, Source::Declared, 0.5, "m")),
            r#"{"fact":"position-error","source":"declared","value":0.5,"unit":"m","subject":null}"#
        );
        assert_eq!(
            json(Fact::name(FactKind::TimeUnit, Source::Inferred, "ms").about("a")),
            r#"{"fact":"time-unit","source":"inferred","value":"ms","unit":null,"subject":"a"}"#
        );
        assert_eq!(
            json(Fact::new(FactKind::SharedStarts, Source::Exchanged)),
            r#"{"fact":"shared-starts","source":"exchanged","value":null,"unit":null,"subject":null}"#
        );
    }
}
