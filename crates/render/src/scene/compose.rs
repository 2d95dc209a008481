//! A frame of a flight as a draw list.

use super::builder::SceneBuilder;
use super::camera::Camera;
use super::draw_list::{Line, Scene};
use super::extent::Extent;
use super::labels::LabelLayout;
use super::view::View;
use crate::timeline::{Frame, Timeline};

/// Whether a part of a picture is shown, and what adds it.
type Part<'a, T> = (bool, fn(&SceneBuilder<'a>, &mut T));

impl Scene {
    /// The draw list of a frame of a flight, seen by a camera whose size of picture is that of the view.
    ///
    /// Shells are in the order of the square of their centre's distance less the square of their radius, farthest first.
    /// For balls that do not overlap this is the order along every line of sight: where a line meets a ball, that number
    /// is the product of the distances to the two points. Balls that overlap are a violation, and of one colour, so their
    /// order is of no account. So nothing pops while the camera moves. Shells that are ellipsoids are balls in scaled lengths, and in
    /// that order there.
    #[must_use]
    pub fn compose(timeline: &Timeline, extent: &Extent, frame: &Frame, view: &View, camera: Camera) -> Self {
        let builder = SceneBuilder::new(timeline, extent, frame, view, camera);
        let mut scene = Self::empty(camera, extent.depth_m(&camera), view.theme.background());
        #[expect(clippy::cast_possible_truncation, reason = "the draw list is in single precision")]
        let shell_ratio = timeline.metric.ratio() as f32;
        scene.shell_ratio = shell_ratio;
        builder.vehicles(&mut scene);
        builder.rotors(&mut scene.discs);
        builder.round_obstacles(&mut scene);
        let layers = view.layers;
        // In the order in which they cover each other, and in which they take room from each other.
        let lines: [Part<'_, Vec<Line>>; 7] = [
            (layers.ground, SceneBuilder::ground),
            (true, SceneBuilder::flat_obstacles),
            (layers.trails, SceneBuilder::trails),
            (layers.marks, SceneBuilder::starts_and_goals),
            (layers.edges, SceneBuilder::edges),
            (layers.closest, SceneBuilder::pairs),
            (true, SceneBuilder::arms),
        ];
        let words: [Part<'_, LabelLayout>; 6] = [
            (layers.caption, SceneBuilder::caption),
            (layers.caption, SceneBuilder::legend),
            (layers.labels, SceneBuilder::keep_off_vehicles),
            (layers.closest, SceneBuilder::distances),
            (layers.ground, SceneBuilder::scale),
            (layers.labels, SceneBuilder::names),
        ];
        lines.iter().filter(|(shown, _)| *shown).for_each(|(_, draw)| draw(&builder, &mut scene.lines));
        let mut labels = LabelLayout::new(view.size_px);
        words.iter().filter(|(shown, _)| *shown).for_each(|(_, write)| write(&builder, &mut labels));
        Self { annotations: labels.annotations, ..scene }
    }
}
