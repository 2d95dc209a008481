//! What stands in the way of a flight.

use serde::Serialize;

/// Something that stands in the way of a flight.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// Stable name.
    pub code: Code,
    /// A sentence or two, with the remedy where there is one.
    pub message: String,
}

/// What a [`Warning`] is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Code {
    /// Relative velocities are not damped.
    RelativeVelocityUnstable,
    /// The start lies on a line that the law never leaves, and the formation does not.
    StartOnLine,
    /// The start lies in a plane that the law never leaves, and the formation does not.
    StartInPlane,
    /// Steps cannot be made as short as the law's links ask for.
    StepTooLong,
    /// By the end the swarm has drifted so far that numbers do not tell its positions apart.
    DriftUnresolved,
    /// More delay, or fewer commands, than the formation bears.
    BeyondMargin,
    /// Nothing is certified about separations.
    NoCertificate,
    /// The formation can be bent without changing the length of an edge to first order.
    NotRigid,
    /// A flat formation in space: nothing resists motion out of its flat to first order.
    FlatFormationInSpace,
    /// The swarm's mean velocity grows by itself.
    CommonModeUnstable,
}

impl Code {
    /// Every code, the worst first.
    pub const ALL: [Self; 10] = [
        Self::RelativeVelocityUnstable,
        Self::StartOnLine,
        Self::StartInPlane,
        Self::StepTooLong,
        Self::DriftUnresolved,
        Self::BeyondMargin,
        Self::NoCertificate,
        Self::NotRigid,
        Self::FlatFormationInSpace,
        Self::CommonModeUnstable,
    ];

    /// Whether the flight cannot do what it is for: the formation is out of reach, or nothing may be called stable.
    #[must_use]
    pub fn refuses(self) -> bool {
        matches!(
            self,
            Self::RelativeVelocityUnstable
                | Self::StartOnLine
                | Self::StartInPlane
                | Self::StepTooLong
                | Self::DriftUnresolved
        )
    }

    /// The stable name, such as `start-on-line`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::RelativeVelocityUnstable => "relative-velocity-unstable",
            Self::StartOnLine => "start-on-line",
            Self::StartInPlane => "start-in-plane",
            Self::StepTooLong => "step-too-long",
            Self::DriftUnresolved => "drift-unresolved",
            Self::BeyondMargin => "beyond-margin",
            Self::NoCertificate => "no-certificate",
            Self::NotRigid => "not-rigid",
            Self::FlatFormationInSpace => "flat-formation-in-space",
            Self::CommonModeUnstable => "common-mode-unstable",
        }
    }
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "warning [{}]: {}", self.code.name(), self.message)
    }
}
