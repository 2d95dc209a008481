//! Formations that are drawn, at their size.

use std::path::Path;

use super::error::ScenarioError;
use super::files;
use super::limits::{DEFAULT_SPACING, SLOT_MARGIN, rounded_up};
use super::shapes::{ImageKeys, SvgKeys, TextKeys};
use tautline_core::swarm::Pair;
use tautline_laws::formation::{Drawing, DrawingError, Formation, MAX_DRAWN_SLOTS};

const TEXT: &str = "formation.text";
const PATH: &str = "formation.path";

/// How large a drawing shall be.
#[derive(Clone, Copy)]
enum Size {
    /// By a dimension of all of it \[m\].
    Of(Dimension, f64),
    /// By the distance of the nearest slots \[m\].
    Spacing(f64),
}

/// Height or width: its key, what has it, and its axis.
#[derive(Clone, Copy)]
struct Dimension {
    key: &'static str,
    name: &'static str,
    axis: usize,
}

const HEIGHT: Dimension = Dimension { key: "formation.height_m", name: "high", axis: 1 };
const WIDTH: Dimension = Dimension { key: "formation.width_m", name: "wide", axis: 0 };
const SPACING: &str = "formation.spacing_m";

/// The size that is asked for, by one key at most.
fn size(
    height_m: Option<f64>,
    width_m: Option<f64>,
    spacing_m: Option<f64>,
    delta_m: f64,
) -> Result<Size, ScenarioError> {
    match (height_m, width_m, spacing_m) {
        (Some(height_m), None, None) => Ok(Size::Of(HEIGHT, height_m)),
        (None, Some(width_m), None) => Ok(Size::Of(WIDTH, width_m)),
        (None, None, Some(spacing_m)) => Ok(Size::Spacing(spacing_m)),
        (None, None, None) => Ok(Size::Spacing(DEFAULT_SPACING * delta_m)),
        _ => {
            let given = [(HEIGHT.key, height_m), (WIDTH.key, width_m), (SPACING, spacing_m)];
            let error = ScenarioError::new("more than one of `height_m`, `width_m` and `spacing_m` are given")
                .coded("scenario/exclusive-keys")
                .with_help("keep one of them: each decides how large the drawing is");
            Err(given.into_iter().filter(|(_, given)| given.is_some()).fold(error, |error, (key, _)| error.at(key)))
        }
    }
}

/// The letters of a text.
pub(super) fn text(keys: &TextKeys, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let size = size(keys.height_m, keys.width_m, keys.spacing_m, delta_m)?;
    let drawing = Drawing::text(&keys.text).map_err(|error| refused(&error, TEXT, None))?;
    sized(&drawing, size, count, delta_m, TEXT)
}

/// SVG path data or an SVG file.
pub(super) fn svg(keys: &SvgKeys, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let size = size(keys.height_m, keys.width_m, keys.spacing_m, delta_m)?;
    let (drawing, key) = match (&keys.path, &keys.file) {
        (Some(data), None) => (Drawing::path(data, keys.filled).map_err(|error| refused(&error, PATH, None))?, PATH),
        (None, Some(file)) => {
            let bytes = files::bytes(file, files::KEY)?;
            (Drawing::svg(&bytes, keys.filled).map_err(|error| refused(&error, files::KEY, Some(file)))?, files::KEY)
        }
        (given, _) => {
            let (code, said) = if given.is_some() {
                ("scenario/exclusive-keys", "both `path` and `file` are given")
            } else {
                ("scenario/missing-key", "neither `path` nor `file` is given")
            };
            return Err(ScenarioError::new(said)
                .coded(code)
                .with_help("give path = \"M 0 0 L ...\", or file = \"drawing.svg\"")
                .at(PATH)
                .at(files::KEY));
        }
    };
    sized(&drawing, size, count, delta_m, key)
}

/// A picture.
pub(super) fn image(keys: &ImageKeys, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let size = size(keys.height_m, keys.width_m, keys.spacing_m, delta_m)?;
    let bytes = files::bytes(&keys.file, files::KEY)?;
    let drawing = Drawing::png(&bytes, keys.ink).map_err(|error| refused(&error, files::KEY, Some(&keys.file)))?;
    sized(&drawing, size, count, delta_m, files::KEY)
}

/// The slots of a drawing, at its size.
fn sized(
    drawing: &Drawing,
    size: Size,
    count: usize,
    delta_m: f64,
    key: &'static str,
) -> Result<Formation, ScenarioError> {
    let mut formation = drawing.slots(count).map_err(|error| refused(&error, key, None))?;
    let (pair, nearest) = formation.min_distance().unwrap_or((Pair::new(0, 1), f64::INFINITY));
    if nearest == 0.0 {
        return Err(ScenarioError::new(format!("slots {pair} of what is drawn are the same point"))
            .coded("scenario/within-delta")
            .with_help("draw longer lines or larger areas, or fly fewer vehicles")
            .at(key)
            .at("swarm.count"));
    }
    let scale = match size {
        Size::Spacing(spacing_m) => spacing_m / nearest,
        Size::Of(dimension, asked_m) => dimension.scale(drawing, asked_m, count, nearest, delta_m)?,
    };
    formation.slots_m *= scale;
    Ok(formation)
}

impl Dimension {
    /// What a drawing, whose nearest slots are this near, is enlarged by to have the dimension that is asked for, if
    /// its slots then are more than delta apart.
    fn scale(
        self,
        drawing: &Drawing,
        asked_m: f64,
        count: usize,
        nearest: f64,
        delta_m: f64,
    ) -> Result<f64, ScenarioError> {
        let Self { key, name, axis } = self;
        let drawn = drawing.size()[axis];
        if drawn == 0.0 {
            return Err(ScenarioError::new(format!("what is drawn is a straight line, and not {asked_m} m {name}"))
                .coded("scenario/shape")
                .with_help("give its other dimension, or spacing_m")
                .at(key));
        }
        let scale = asked_m / drawn;
        let nearest_m = scale * nearest;
        if nearest_m >= delta_m * (1.0 + SLOT_MARGIN) {
            return Ok(scale);
        }
        let enough_m = rounded_up(delta_m * (1.0 + SLOT_MARGIN) / nearest * drawn);
        Err(ScenarioError::new(format!(
            "in a drawing {asked_m} m {name}, {count} vehicles come as near as {nearest_m} m, not more than delta = \
             {delta_m} m"
        ))
        .coded("scenario/within-delta")
        .with_help(format!(
            "set {key} to at least {enough_m} for {count} vehicles at this delta, reduce law.delta_m, or fly fewer \
             vehicles"
        ))
        .at(key)
        .at("swarm.count")
        .at("law.delta_m"))
    }
}

/// What cannot be drawn, at the key that says it.
fn refused(error: &DrawingError, key: &'static str, file: Option<&Path>) -> ScenarioError {
    let help = match error {
        DrawingError::Glyph(_) => "letters, digits and signs of Latin, Greek and Cyrillic scripts are drawn".to_owned(),
        DrawingError::Length(_) => "shorten it".to_owned(),
        DrawingError::Letters { letters, .. } => {
            format!("fly at least {letters} vehicles, about ten for each letter to be read")
        }
        DrawingError::Path(_) => "write it as in SVG, for example path = \"M 0 0 L 4 0 L 2 3 Z\"".to_owned(),
        DrawingError::Svg(_) => "save the drawing as plain SVG".to_owned(),
        DrawingError::Nesting(_) => "ungroup its elements".to_owned(),
        DrawingError::Png(_) => "save the picture as PNG".to_owned(),
        DrawingError::Pixels { .. } => "save it smaller: slots need few pixels".to_owned(),
        DrawingError::NotFinite => "draw nearer to the origin".to_owned(),
        DrawingError::Empty if key == TEXT => "give at least one letter".to_owned(),
        DrawingError::Empty => {
            "there must be lines or areas with an extent; in an SVG file letters are to be made paths, in a picture \
                                `ink` says which pixels count"
                .to_owned()
        }
        DrawingError::Slots(_) => format!("fly at most {MAX_DRAWN_SLOTS} vehicles"),
    };
    let shown = file.map_or_else(String::new, |file| format!("{}: ", file.display()));
    let refused = ScenarioError::new(format!("{shown}{error}")).coded("scenario/shape").with_help(help).at(key);
    if matches!(error, DrawingError::Letters { .. } | DrawingError::Slots(_)) {
        refused.at("swarm.count")
    } else {
        refused
    }
}
