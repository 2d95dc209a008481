//! Keys of the shapes that have some of their own.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use tautline_laws::formation::Ink;

/// Keys of `shape = "v"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct VKeys {
    /// Distance between neighbours on an arm in m, and of the nearest slots; 1.5 times `law.delta_m` unless given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
    /// Angle between the arms in degrees, from 60 to 180.
    #[serde(default = "right_angle_deg")]
    #[schemars(range(min = 60, max = 180))]
    pub(super) angle_deg: f64,
}

fn right_angle_deg() -> f64 {
    90.0
}

/// Keys of a shape that has a spacing alone.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SpacingKeys {
    /// Distance of the nearest slots in m; 1.5 times `law.delta_m` unless given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
}

/// Keys of `shape = "helix"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct HelixKeys {
    /// Radius in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) radius_m: f64,
    /// Rise of a full turn in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) pitch_m: f64,
    /// Distance between neighbours in m, and of the nearest slots; 1.5 times `law.delta_m` unless this or `turns` is
    /// given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
    /// Turns from the first slot to the last, in place of `spacing_m`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) turns: Option<f64>,
}

/// Keys of `shape = "text"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TextKeys {
    /// What is written; a line break begins a line below.
    #[schemars(length(min = 1, max = 1000))]
    pub(super) text: String,
    /// Height of all that is written in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) height_m: Option<f64>,
    /// Width of all that is written in m, in place of `height_m`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) width_m: Option<f64>,
    /// Distance of the nearest slots in m; 1.5 times `law.delta_m` unless this, the height or the width is given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
}

/// Keys of `shape = "svg"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct SvgKeys {
    /// Path data, as the attribute `d` of SVG has it.
    pub(super) path: Option<String>,
    /// An SVG file, in place of `path`; relative to the folder of the scenario file.
    pub(super) file: Option<PathBuf>,
    /// Whether slots fill what the lines surround, instead of standing on them.
    #[serde(default)]
    pub(super) filled: bool,
    /// Height of the drawing in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) height_m: Option<f64>,
    /// Width of the drawing in m, in place of `height_m`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) width_m: Option<f64>,
    /// Distance of the nearest slots in m; 1.5 times `law.delta_m` unless this, the height or the width is given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
}

/// Keys of `shape = "image"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct ImageKeys {
    /// A PNG picture; relative to the folder of the scenario file.
    pub(super) file: PathBuf,
    /// Which pixels are drawn: the opaque ones of a picture that has others, or else the dark ones, unless given.
    #[serde(default)]
    #[schemars(with = "Ink")]
    pub(super) ink: Option<Ink>,
    /// Height of what is drawn in m.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) height_m: Option<f64>,
    /// Width of what is drawn in m, in place of `height_m`.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) width_m: Option<f64>,
    /// Distance of the nearest slots in m; 1.5 times `law.delta_m` unless this, the height or the width is given.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) spacing_m: Option<f64>,
}

/// Keys of `shape = "file"`.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct FileKeys {
    /// A text file with a line for each slot: x, y and, unless it is 0, z in m, with commas, semicolons, tabs or
    /// blanks between; relative to the folder of the scenario file. A first line may name the columns.
    pub(super) file: PathBuf,
}
