//! Drawn shapes of `[formation]`: text, SVG and pictures, scaled to a size.

use std::path::Path;

use super::document::{DrawingSize, ImageKeys, SvgKeys, TextKeys};
use super::error::{ErrorKind, ScenarioError};
use super::files;
use super::limits::{DEFAULT_SPACING, SLOT_MARGIN, rounded_up};
use tautline_core::swarm::Pair;
use tautline_core::text::beside_limit;
use tautline_laws::formation::{Drawing, DrawingError, Formation, MAX_DRAWN_SLOTS};

const TEXT: &str = "formation.text";
const PATH: &str = "formation.path";

/// Size of a drawing.
#[derive(Clone, Copy)]
enum Size {
    /// Height or width of the drawing \[m\].
    Of(Dimension, f64),
    /// Smallest distance of slots \[m\].
    Spacing(f64),
}

/// Height or width: key, adjective and axis.
#[derive(Clone, Copy)]
struct Dimension {
    key: &'static str,
    name: &'static str,
    axis: usize,
}

const HEIGHT: Dimension = Dimension { key: "formation.height_m", name: "high", axis: 1 };
const WIDTH: Dimension = Dimension { key: "formation.width_m", name: "wide", axis: 0 };
const SPACING: &str = "formation.spacing_m";

impl DrawingSize {
    /// Returns the size, which at most one key gives.
    fn size(self, delta_m: f64) -> Result<Size, ScenarioError> {
        match (self.height_m, self.width_m, self.spacing_m) {
            (Some(height_m), None, None) => Ok(Size::Of(HEIGHT, height_m)),
            (None, Some(width_m), None) => Ok(Size::Of(WIDTH, width_m)),
            (None, None, Some(spacing_m)) => Ok(Size::Spacing(spacing_m)),
            (None, None, None) => Ok(Size::Spacing(DEFAULT_SPACING * delta_m)),
            (height_m, width_m, spacing_m) => {
                let given = [(HEIGHT.key, height_m), (WIDTH.key, width_m), (SPACING, spacing_m)];
                let problem = "more than one of `height_m`, `width_m` and `spacing_m` are given";
                let help = "keep one of them: each sets the size of the drawing";
                let keys: Vec<_> = given.into_iter().filter_map(|(key, given)| given.map(|_| key)).collect();
                Err(ErrorKind::ExclusiveKeys.at(&keys, problem, help))
            }
        }
    }
}

/// Returns the slots of a text.
pub(super) fn text(keys: &TextKeys, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let size = keys.size.size(delta_m)?;
    let drawing = Drawing::text(&keys.text).map_err(|error| refused(&error, TEXT, None))?;
    sized(&drawing, size, count, delta_m, TEXT)
}

/// Returns the slots of SVG path data or of an SVG file.
pub(super) fn svg(keys: &SvgKeys, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let size = keys.size.size(delta_m)?;
    let (drawing, key) = match (&keys.path, &keys.file) {
        (Some(data), None) => (Drawing::path(data, keys.filled).map_err(|error| refused(&error, PATH, None))?, PATH),
        (None, Some(file)) => {
            let bytes = files::bytes(file, files::KEY)?;
            (Drawing::svg(&bytes, keys.filled).map_err(|error| refused(&error, files::KEY, Some(file)))?, files::KEY)
        }
        (given, _) => {
            let (kind, said) = if given.is_some() {
                (ErrorKind::ExclusiveKeys, "both `path` and `file` are given")
            } else {
                (ErrorKind::MissingKey, "neither `path` nor `file` is given")
            };
            let help = "give path = \"M 0 0 L ...\", or file = \"drawing.svg\"";
            return Err(kind.at(&[PATH, files::KEY], said, help));
        }
    };
    sized(&drawing, size, count, delta_m, key)
}

/// Returns the slots of a picture.
pub(super) fn image(keys: &ImageKeys, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let size = keys.size.size(delta_m)?;
    let bytes = files::bytes(&keys.file, files::KEY)?;
    let drawing = Drawing::png(&bytes, keys.ink).map_err(|error| refused(&error, files::KEY, Some(&keys.file)))?;
    sized(&drawing, size, count, delta_m, files::KEY)
}

/// Returns the slots of a drawing, scaled to a size.
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
        let problem = format!("slots {pair} of the drawing are the same point");
        let help = "draw longer lines or larger areas, or fly fewer vehicles";
        return Err(ErrorKind::WithinDelta.at(&[key, "swarm.count"], problem, help));
    }
    let scale = match size {
        Size::Spacing(spacing_m) => spacing_m / nearest,
        Size::Of(dimension, asked_m) => dimension.scale(drawing, asked_m, count, nearest, delta_m)?,
    };
    formation.slots_m *= scale;
    Ok(formation)
}

impl Dimension {
    /// Returns the scale that gives a drawing this dimension. Refuses a scale at which the nearest slots are not more
    /// than delta apart.
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
            let problem = format!("the drawing is a straight line, which cannot be {asked_m} m {name}");
            let help = "give its other dimension, or spacing_m";
            return Err(ErrorKind::Shape.at(&[key], problem, help));
        }
        let scale = asked_m / drawn;
        let nearest_m = scale * nearest;
        if nearest_m >= delta_m * (1.0 + SLOT_MARGIN) {
            return Ok(scale);
        }
        let enough_m = rounded_up(delta_m * (1.0 + SLOT_MARGIN) / nearest * drawn);
        let problem = format!(
            "in a drawing {asked_m} m {name}, {count} vehicles come as near as {} m, not more than delta = {delta_m} m",
            beside_limit(nearest_m, delta_m, 3)
        );
        let help = format!(
            "set {key} to at least {enough_m} for {count} vehicles at this delta, reduce law.delta_m, or fly fewer \
             vehicles"
        );
        Err(ErrorKind::WithinDelta.at(&[key, "swarm.count", "law.delta_m"], problem, help))
    }
}

/// Returns the error of a drawing, at the key that gives it.
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
            "draw lines or areas with an extent; in an SVG file convert letters to paths, in a picture \
                                `ink` says which pixels count"
                .to_owned()
        }
        DrawingError::Slots(_) => format!("fly at most {MAX_DRAWN_SLOTS} vehicles"),
    };
    let shown = file.map_or_else(String::new, |file| format!("{}: ", file.display()));
    let is_of_count = matches!(error, DrawingError::Letters { .. } | DrawingError::Slots(_));
    let keys = [key, "swarm.count"];
    ErrorKind::Shape.at(if is_of_count { &keys } else { &keys[..1] }, format!("{shown}{error}"), help)
}
