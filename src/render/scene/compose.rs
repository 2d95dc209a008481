//! A frame of a flight as a draw list.

use super::builder::SceneBuilder;
use super::camera::Camera;
use super::draw_list::Scene;
use super::extent::Extent;
use super::labels::LabelLayout;
use super::view::View;
use crate::render::timeline::{Frame, Timeline};

impl Scene {
    /// The draw list of a frame of a flight, seen by a camera whose size of picture is that of the view.
    ///
    /// Shells are in the order of the square of their centre's distance less the square of their radius, farthest first.
    /// For balls that do not overlap this is the order along every line of sight: where a line meets a ball, that number
    /// is the product of the distances to the two points. Balls that overlap are a violation, and of one colour, so their
    /// order is of no account. So nothing pops while the camera moves.
    #[must_use]
    pub fn compose(timeline: &Timeline, extent: &Extent, frame: &Frame, view: &View, camera: Camera) -> Self {
        let builder = SceneBuilder::new(timeline, extent, frame, view, camera);
        let mut scene = Self::empty(camera, extent.depth_m(&camera), view.theme.background());
        let layers = view.layers;
        builder.vehicles(&mut scene);
        if layers.ground {
            builder.ground(&mut scene.lines);
        }
        if layers.trails {
            builder.trails(&mut scene.lines);
        }
        if layers.marks {
            builder.starts_and_goals(&mut scene.lines);
        }
        if layers.edges {
            builder.edges(&mut scene.lines);
        }
        if layers.closest {
            builder.pairs(&mut scene.lines);
        }
        let mut labels = LabelLayout::new(view.size_px);
        if layers.caption {
            builder.caption(&mut labels);
            builder.legend(&mut labels);
        }
        if layers.labels {
            builder.keep_off_vehicles(&mut labels);
        }
        if layers.closest {
            builder.distances(&mut labels);
        }
        if layers.ground {
            builder.scale(&mut labels);
        }
        if layers.labels {
            builder.names(&mut labels);
        }
        scene.annotations = labels.annotations;
        scene
    }
}
