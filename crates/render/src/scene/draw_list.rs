//! Draw list: the content of a picture as plain data.

use bytemuck::{Pod, Zeroable};
use nalgebra::Vector3;

use super::camera::Camera;
use super::colour::Colour;

/// Ball. A solid ball is lit; a shell is transparent.
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

/// Transparent flat disc, for example the disc swept by a rotor.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Disc {
    /// Centre \[m\].
    pub centre_m: [f32; 3],
    /// Radius \[m\].
    pub radius_m: f32,
    /// Unit normal.
    pub normal: [f32; 3],
    /// Colour; the opacity is that of the rim.
    pub colour: Colour,
}

/// Straight line of constant width in pixels.
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
    /// Creates a line of one colour.
    pub(super) fn new(ends_m: [Vector3<f64>; 2], colour: Colour, width_px: f32) -> Self {
        Self { ends_m: ends_m.map(single), colours: [colour; 2], width_px }
    }
}

/// Flat element of a picture; lengths in pixels from the top left corner.
#[derive(Clone, Debug, PartialEq)]
pub enum Annotation {
    /// Text on one line.
    Words {
        /// Position.
        at_px: [f32; 2],
        /// Part of the text at that position: 0 left or top, 0.5 middle, 1 right or bottom.
        anchor: [f32; 2],
        /// Height of a line \[pixels\].
        size_px: f32,
        /// Colour.
        colour: Colour,
        /// Text.
        text: String,
    },
    /// Filled box.
    Box {
        /// Top left and bottom right corner.
        corners_px: [[f32; 2]; 2],
        /// Colour.
        colour: Colour,
        /// Radius of the corners.
        round_px: f32,
    },
    /// Outline of a box, drawn inside it.
    Outline {
        /// Top left and bottom right corner.
        corners_px: [[f32; 2]; 2],
        /// Colour.
        colour: Colour,
        /// Width.
        width_px: f32,
    },
    /// Box with colours from left to right.
    Scale {
        /// Top left and bottom right corner.
        corners_px: [[f32; 2]; 2],
        /// Colours at even distances.
        colours: Vec<Colour>,
    },
    /// Straight line.
    Stroke {
        /// Ends.
        ends_px: [[f32; 2]; 2],
        /// Colour.
        colour: Colour,
        /// Width.
        width_px: f32,
    },
    /// Ring.
    Ring {
        /// Centre.
        at_px: [f32; 2],
        /// Radius.
        radius_px: f32,
        /// Colour.
        colour: Colour,
        /// Width.
        width_px: f32,
    },
}

/// Complete content of a picture.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Camera.
    pub camera: Camera,
    /// Smallest and largest depth of the content \[m\].
    pub depth_m: [f64; 2],
    /// Background colour.
    pub background: Colour,
    /// Vehicles and round obstacles.
    pub balls: Vec<Ball>,
    /// Rotors of quadrotors, farthest first.
    pub discs: Vec<Disc>,
    /// Keep-out shells in drawing order: see [`Scene::compose`].
    pub shells: Vec<Ball>,
    /// Ratio of height to width of shells.
    pub shell_ratio: f32,
    /// Ground, trails, start marks, goal slots, edges, pairs and arms of quadrotors; later ones cover earlier ones.
    pub lines: Vec<Line>,
    /// Text and legends.
    pub annotations: Vec<Annotation>,
}

impl Scene {
    /// Creates an empty scene with this camera.
    pub(super) fn empty(camera: Camera, depth_m: [f64; 2], background: Colour) -> Self {
        let (balls, discs, shells, lines) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (shell_ratio, annotations) = (1.0, Vec::new());
        Self { camera, depth_m, background, balls, discs, shells, shell_ratio, lines, annotations }
    }

    /// Creates an empty scene with the default camera.
    #[cfg(feature = "window")]
    pub(crate) fn blank(size_px: [u32; 2]) -> Self {
        use super::{camera::CameraSpec, colour::Theme};
        Self::empty(Camera::framing(&CameraSpec::Iso, &[], size_px), [0.1, 1.0], Theme::Dark.background())
    }
}

/// Converts a vector to single precision.
#[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
pub(super) fn single(v: Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// Converts pixel numbers to single precision.
#[expect(clippy::cast_possible_truncation, reason = "pixels")]
pub(super) fn pixels<const N: usize>(numbers: [f64; N]) -> [f32; N] {
    numbers.map(|x| x as f32)
}
