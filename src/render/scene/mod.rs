//! From a recorded instant to a draw list.
//!
//! A [`Scene`] is plain data and knows nothing of how it is drawn: balls, shells and lines in metres, and [`Mark`]s
//! (words, boxes, scales of colour) in pixels. Lengths are in the scene's frame, which is the recording's but for its
//! origin: it lies amid the flight, so that single precision does for swarms far from the recording's origin.

mod camera;
mod caption;
mod colour;
mod ground;
mod placing;
mod stage;
mod world;

pub use camera::{Camera, CameraError, CameraSpec, Lens, Orbit, Projected};
pub(crate) use caption::metres;
pub use colour::{Colour, Theme};
#[cfg(test)]
pub(super) use placing::width;
pub use stage::Stage;

use nalgebra::Vector3;

use super::footage::{Footage, Moment, Span};
use crate::swarm::Pair;

/// A ball. A solid one is lit; a shell lets through what is within and behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre \[m\].
    pub centre_m: [f32; 3],
    /// Radius \[m\].
    pub radius_m: f32,
    /// Colour; the opacity of a shell is that of its rim.
    pub colour: Colour,
}

/// A straight line of the same width near and far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Ends \[m\].
    pub ends_m: [[f32; 3]; 2],
    /// Colours at the ends.
    pub colours: [Colour; 2],
    /// Width \[pixels\].
    pub width_px: f32,
}

/// Something flat in the picture; lengths in pixels from the top left corner.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// Words on one line.
    Words {
        /// Where the words are.
        at_px: [f32; 2],
        /// Which part of the words is there: 0 left or top, 0.5 middle, 1 right or bottom.
        anchor: [f32; 2],
        /// Height of a line \[pixels\].
        size_px: f32,
        /// Their colour.
        colour: Colour,
        /// The words.
        text: String,
    },
    /// A filled box.
    Box {
        /// Top left and bottom right.
        corners_px: [[f32; 2]; 2],
        /// Its colour.
        colour: Colour,
        /// Radius of its corners.
        round_px: f32,
    },
    /// The outline of a box, drawn inside it.
    Outline {
        /// Top left and bottom right.
        corners_px: [[f32; 2]; 2],
        /// Its colour.
        colour: Colour,
        /// Its width.
        width_px: f32,
    },
    /// A box whose colours run from left to right.
    Scale {
        /// Top left and bottom right.
        corners_px: [[f32; 2]; 2],
        /// Colours at even distances.
        colours: Vec<Colour>,
    },
    /// A straight line.
    Stroke {
        /// Its ends.
        ends_px: [[f32; 2]; 2],
        /// Its colour.
        colour: Colour,
        /// Its width.
        width_px: f32,
    },
    /// A ring.
    Ring {
        /// Its centre.
        at_px: [f32; 2],
        /// Its radius.
        radius_px: f32,
        /// Its colour.
        colour: Colour,
        /// Its width.
        width_px: f32,
    },
}

/// Everything that is in a picture.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Where it is seen from.
    pub camera: Camera,
    /// Nearest and farthest that anything is from the camera \[m\].
    pub depth_m: [f64; 2],
    /// What nothing is drawn on.
    pub background: Colour,
    /// Vehicles.
    pub balls: Vec<Ball>,
    /// Keep-out shells, in the order in which they must be drawn: see [`Scene::compose`].
    pub shells: Vec<Ball>,
    /// Ground, trails, start marks, goal slots, edges, pairs: a later one is drawn over those before it.
    pub lines: Vec<Line>,
    /// Words and legends.
    pub marks: Vec<Mark>,
}

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
    pub const NONE: Self = Self {
        shells: false,
        edges: false,
        trails: false,
        marks: false,
        ground: false,
        labels: false,
        closest: false,
        caption: false,
    };
    /// Everything.
    pub const ALL: Self = Self {
        shells: true,
        edges: true,
        trails: true,
        marks: true,
        ground: true,
        labels: true,
        closest: true,
        caption: true,
    };
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
}

impl Default for View {
    fn default() -> Self {
        Self { camera: CameraSpec::Iso, theme: Theme::Dark, size_px: [1280, 720], layers: Layers::ALL }
    }
}

impl View {
    /// Pixels of a length that is one pixel in a picture 720 pixels high.
    fn unit_px(&self) -> f32 {
        let [width, height] = self.size_px.map(|size| size as f32);
        (height.min(0.75 * width) / 720.0).max(0.3)
    }

    /// Size of text \[pixels\] in units of the normal one.
    fn text_px(&self, units: f32) -> f32 {
        (17.0 * self.unit_px()).max(9.0) * units
    }
}

impl Scene {
    /// The draw list of a flight at a moment.
    ///
    /// Shells are in the order of the square of their centre's distance less the square of their radius, farthest first.
    /// For balls that do not overlap this is the order along every line of sight: where a line meets a ball, that number
    /// is the product of the distances to the two points. Balls that overlap are a violation, and of one colour, so their
    /// order is of no account. So nothing pops while the camera moves.
    ///
    /// # Errors
    /// [`CameraError`] when the camera follows a vehicle that the flight does not have.
    pub fn compose(footage: &Footage, stage: &Stage, moment: &Moment, view: &View) -> Result<Self, CameraError> {
        let camera = stage.camera(footage, moment, view)?;
        Ok(Self::seen_by(camera, footage, stage, moment, view))
    }

    /// A picture of nothing.
    #[must_use]
    pub fn blank(size_px: [u32; 2]) -> Self {
        Self {
            camera: Camera::framing(&CameraSpec::Iso, &[], size_px),
            depth_m: [0.1, 1.0],
            background: Theme::Dark.background(),
            balls: Vec::new(),
            shells: Vec::new(),
            lines: Vec::new(),
            marks: Vec::new(),
        }
    }

    /// The draw list of a flight at a moment, seen by a camera whose size of picture is that of the view.
    #[must_use]
    pub fn seen_by(camera: Camera, footage: &Footage, stage: &Stage, moment: &Moment, view: &View) -> Self {
        let painting = Painting { footage, stage, moment, view, camera, violated: violated(footage, moment) };
        let mut scene = Self {
            camera,
            depth_m: stage.depth_m(&camera),
            background: view.theme.background(),
            balls: Vec::new(),
            shells: Vec::new(),
            lines: Vec::new(),
            marks: Vec::new(),
        };
        painting.vehicles(&mut scene);
        if view.layers.ground {
            painting.ground(&mut scene);
        }
        if view.layers.trails {
            painting.trails(&mut scene);
        }
        if view.layers.marks {
            painting.starts_and_goals(&mut scene);
        }
        if view.layers.edges {
            painting.edges(&mut scene);
        }
        if view.layers.closest {
            painting.pairs(&mut scene);
        }
        painting.annotate(&mut scene);
        scene
    }
}

/// Everything that a scene is made of.
struct Painting<'a> {
    footage: &'a Footage,
    stage: &'a Stage,
    moment: &'a Moment,
    view: &'a View,
    camera: Camera,
    /// Pairs that are closer than delta at this moment and their distances \[m\], the nearest first.
    violated: Vec<(Pair, f64)>,
}

impl Painting<'_> {
    /// Where a vehicle is, in the scene's frame \[m\]; none where it is not there.
    fn vehicle(&self, k: usize) -> Option<Vector3<f64>> {
        self.stage.place(&self.moment.positions_m, k)
    }

    /// The closest pair, where it is not closer than delta, and its distance \[m\].
    fn clear_nearest(&self) -> Option<(Pair, f64)> {
        self.moment.nearest.filter(|(nearest, _)| self.violated.iter().all(|(pair, _)| pair != nearest))
    }
}

fn violated(footage: &Footage, moment: &Moment) -> Vec<(Pair, f64)> {
    let lasts = |span: &&Span| span.from_s <= moment.time_s && moment.time_s <= span.to_s;
    let mut pairs: Vec<Pair> = footage.violations().iter().filter(lasts).map(|span| span.pair).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let mut violated: Vec<_> = pairs.into_iter().map(|pair| (pair, moment.distance_m(pair))).collect();
    violated.retain(|(_, distance_m)| distance_m.is_finite());
    violated.sort_by(|a, b| a.1.total_cmp(&b.1));
    violated
}

/// A vector in single precision.
fn single(v: Vector3<f64>) -> [f32; 3] {
    #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
    let single = [v.x as f32, v.y as f32, v.z as f32];
    single
}

#[cfg(test)]
mod tests;
