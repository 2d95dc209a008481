//! Scenes: draw lists composed from frames of a flight.
//!
//! A [`Scene`] is plain data, independent of the renderer: balls, faces, discs, shells and lines in metres, and
//! [`Annotation`]s (text, boxes, colour scales) in pixels. Lengths are in scene coordinates. Their origin lies in the
//! middle of the flight, so that single precision is enough for swarms far from the recording's origin.

mod camera;
mod caption;
mod colour;
mod compose;
mod extent;
mod geometry;
mod ground;
mod labels;

pub use camera::{Adjustment, Camera, CameraSpec, Lens, Orbit, Projected};
pub(super) use caption::metres;
pub use colour::{Colour, Colouring, Theme};
pub use compose::{Layers, View};
pub use extent::Extent;
#[cfg(test)]
pub(super) use labels::width;

use bytemuck::{Pod, Zeroable};
use nalgebra::Vector3;
#[cfg(feature = "window")]
use tautline_report::drawing::colours::PAPER;

/// A ball. A solid one is lit; a shell lets through what is within and behind it.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Ball {
    /// Centre \[m\].
    pub centre_m: [f32; 3],
    /// Radius \[m\].
    pub radius_m: f32,
    /// Colour; the opacity of a shell is that of its rim.
    pub colour: Colour,
}

impl Ball {
    #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
    fn new(centre_m: Vector3<f64>, radius_m: f64, colour: Colour) -> Self {
        Self { centre_m: single(centre_m), radius_m: radius_m as f32, colour }
    }
}

/// A flat solid parallelogram, such as a wall. Its colour holds the light that it receives.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Face {
    /// Centre \[m\].
    pub centre_m: [f32; 3],
    /// Half sides, which are perpendicular \[m\].
    pub half_m: [[f32; 3]; 2],
    /// Colour.
    pub colour: Colour,
}

/// A flat disc that lets light through: what a rotor sweeps, a mark on the ground, or the glow of a light.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Disc {
    /// Centre \[m\].
    pub centre_m: [f32; 3],
    /// Radius \[m\].
    pub radius_m: f32,
    /// Unit vector across it.
    pub normal: [f32; 3],
    /// 0 for a disc with a rim, 1 for a glow that fades from the centre.
    pub glow: f32,
    /// Colour; the opacity is that of the rim, or of the centre of a glow.
    pub colour: Colour,
}

impl Disc {
    /// A disc with a rim.
    #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
    fn new(centre_m: Vector3<f64>, radius_m: f64, normal: Vector3<f64>, colour: Colour) -> Self {
        Self { centre_m: single(centre_m), radius_m: radius_m as f32, normal: single(normal), glow: 0.0, colour }
    }
}

/// A straight line of the same width near and far.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Line {
    /// Ends \[m\].
    pub ends_m: [[f32; 3]; 2],
    /// Colours at the ends.
    pub colours: [Colour; 2],
    /// Width \[pixels\].
    pub width_px: f32,
}

impl Line {
    /// A line of one colour.
    fn new(ends_m: [Vector3<f64>; 2], colour: Colour, width_px: f32) -> Self {
        Self { ends_m: ends_m.map(single), colours: [colour; 2], width_px }
    }
}

/// Something flat in the picture; lengths in pixels from the top left corner.
#[derive(Clone, Debug, PartialEq)]
pub enum Annotation {
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
        /// End points.
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
    /// Sides of boxes.
    pub faces: Vec<Face>,
    /// Marks below vehicles, then rotors of quadrotors, farthest first, then glows.
    pub discs: Vec<Disc>,
    /// Keep-out shells, in the order in which they must be drawn: see [`Scene::compose`].
    pub shells: Vec<Ball>,
    /// Height of shells over their width.
    pub shell_ratio: f32,
    /// Ground, drop lines, trails, start marks, goal slots, edges, pairs, and arms of quadrotors, each drawn over the
    /// previous ones.
    pub lines: Vec<Line>,
    /// Words and legends.
    pub annotations: Vec<Annotation>,
}

impl Scene {
    /// Nothing, seen by this camera.
    fn empty(camera: Camera, depth_m: [f64; 2], background: Colour) -> Self {
        let (balls, faces, discs, shells) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (shell_ratio, lines, annotations) = (1.0, Vec::new(), Vec::new());
        Self { camera, depth_m, background, balls, faces, discs, shells, shell_ratio, lines, annotations }
    }

    /// A picture of nothing.
    #[cfg(feature = "window")]
    pub(crate) fn blank(size_px: [u32; 2]) -> Self {
        Self::empty(
            Camera::orbiting(
                Orbit { azimuth_deg: 0.0, elevation_deg: 0.0, distance_m: 1.0 },
                Vector3::zeros(),
                size_px,
            ),
            [0.1, 1.0],
            Theme::Dark.pick(PAPER),
        )
    }
}

/// A vector in single precision.
#[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
fn single(v: Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// A place in the picture in single precision.
#[expect(clippy::cast_possible_truncation, reason = "pixels")]
fn pixels<const N: usize>(numbers: [f64; N]) -> [f32; N] {
    numbers.map(|x| x as f32)
}

#[cfg(test)]
mod tests;
