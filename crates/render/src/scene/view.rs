//! How to look at a flight.

use super::camera::CameraSpec;
use super::colour::Theme;

/// What to show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::struct_excessive_bools, reason = "each is a layer that is shown or not")]
pub struct Layers {
    /// Keep-out shells of radius delta/2.
    pub shells: bool,
    /// Edges in the colour of their tension.
    pub edges: bool,
    /// Where the vehicles came from.
    pub trails: bool,
    /// Start marks (x) and goal slots (o).
    pub marks: bool,
    /// Ground with its scale, and axes.
    pub ground: bool,
    /// Numbers of the vehicles.
    pub labels: bool,
    /// The closest pair with its distance.
    pub closest: bool,
    /// Caption and legend.
    pub caption: bool,
}

impl Layers {
    /// Vehicles alone.
    pub const NONE: Self = Self::all(false);
    /// Everything.
    pub const ALL: Self = Self::all(true);

    const fn all(on: bool) -> Self {
        Self { shells: on, edges: on, trails: on, marks: on, ground: on, labels: on, closest: on, caption: on }
    }
}

/// How to look at a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// From where.
    pub camera: CameraSpec,
    /// In which colours.
    pub theme: Theme,
    /// Width and height \[pixels\].
    pub size_px: [u32; 2],
    /// What to show.
    pub layers: Layers,
    /// How long trails are \[s\]; none for the whole way.
    pub trail_s: Option<f64>,
}

impl Default for View {
    fn default() -> Self {
        let (camera, theme, layers) = (CameraSpec::Iso, Theme::Dark, Layers::ALL);
        Self { camera, theme, size_px: [1280, 720], layers, trail_s: None }
    }
}

impl View {
    /// Pixels of a length that is one pixel in a picture 720 pixels high.
    pub(super) fn unit_px(&self) -> f32 {
        let [width, height] = self.size_px.map(|size| size as f32);
        (height.min(0.75 * width) / 720.0).max(0.3)
    }

    /// Size of text \[pixels\] in units of the normal one.
    pub(super) fn text_px(&self, units: f32) -> f32 {
        (17.0 * self.unit_px()).max(9.0) * units
    }
}
