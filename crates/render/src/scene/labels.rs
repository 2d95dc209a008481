//! Layout of text without overlaps.

use super::colour::Colour;
use super::{Annotation, pixels};

/// Widths of the characters from space to ~ in thousandths of the line height, for the overlay's font.
#[rustfmt::skip]
const CHARACTER_WIDTHS: [u16; 95] = [
    228, 274, 392, 653, 564, 831, 648, 240, 310, 310, 472, 564, 246, 282, 246, 359, 564, 564, 564, 564,
    564, 564, 564, 564, 564, 564, 246, 246, 564, 564, 564, 380, 940, 641, 630, 609, 702, 555, 520, 658,
    692, 248, 487, 599, 502, 865, 709, 774, 592, 774, 618, 517, 548, 680, 624, 921, 608, 569, 560, 310,
    359, 310, 564, 490, 376, 509, 583, 460, 583, 548, 376, 573, 569, 237, 237, 495, 255, 863, 569, 582,
    583, 583, 374, 428, 387, 569, 480, 775, 499, 474, 455, 319, 262, 319, 564,
];
/// Width of any other character.
const OTHER_WIDTH: u16 = 996;
/// Padding around text, relative to the line height.
const PADDING: f32 = 0.12;

/// Top left and bottom right corner \[pixels\].
pub(super) type Corners = [[f32; 2]; 2];

/// Places text in a picture where there is room.
pub(super) struct LabelLayout {
    pub(super) annotations: Vec<Annotation>,
    size_px: [f32; 2],
    /// Occupied boxes.
    taken: Vec<Corners>,
}

impl LabelLayout {
    pub(super) fn new(size_px: [u32; 2]) -> Self {
        Self { annotations: Vec::new(), size_px: size_px.map(|size| size as f32), taken: Vec::new() }
    }

    /// Adds an annotation that occupies no room.
    pub(super) fn draw(&mut self, annotation: Annotation) {
        self.annotations.push(annotation);
    }

    /// Reserves a box, so that no text is placed there.
    pub(super) fn reserve(&mut self, corners_px: Corners) {
        self.taken.push(corners_px);
    }

    /// Draws text with the anchor at a position, even if that is occupied; returns its box.
    pub(super) fn put(
        &mut self,
        at_px: [f32; 2],
        anchor: [f32; 2],
        size_px: f32,
        colour: Colour,
        text: &str,
    ) -> Corners {
        let corners_px = area(at_px, anchor, size_px, text);
        self.reserve(corners_px);
        self.draw(Annotation::Words { at_px, anchor, size_px, colour, text: text.to_owned() });
        corners_px
    }

    /// Draws text if there is room for it; returns whether there was.
    pub(super) fn put_if_free(
        &mut self,
        at_px: [f64; 2],
        anchor: [f32; 2],
        size_px: f32,
        colour: Colour,
        text: &str,
    ) -> bool {
        let at_px = pixels(at_px);
        let room = self.has_room(area(at_px, anchor, size_px, text));
        if room {
            self.put(at_px, anchor, size_px, colour, text);
        }
        room
    }

    /// Returns the number of annotations and the number of occupied boxes.
    pub(super) fn placed(&self) -> (usize, usize) {
        (self.annotations.len(), self.taken.len())
    }

    /// Inserts a background before annotation `annotation` that surrounds all boxes from `taken` on.
    pub(super) fn insert_background(&mut self, taken: usize, annotation: usize, colour: Colour, room_px: f32) {
        let around = self.taken[taken..].iter().copied().reduce(|a, b| {
            [[a[0][0].min(b[0][0]), a[0][1].min(b[0][1])], [a[1][0].max(b[1][0]), a[1][1].max(b[1][1])]]
        });
        let Some([low, high]) = around else { return };
        let corners_px = [low.map(|side| side - room_px), high.map(|side| side + room_px)];
        self.annotations.insert(annotation, Annotation::Box { corners_px, colour, round_px: room_px });
    }

    fn has_room(&self, [low, high]: Corners) -> bool {
        let inside = (0..2).all(|axis| low[axis] >= 0.0 && high[axis] <= self.size_px[axis]);
        let clear = |taken: &Corners| (0..2).any(|axis| high[axis] <= taken[0][axis] || taken[1][axis] <= low[axis]);
        inside && self.taken.iter().all(clear)
    }

    /// Returns the nearest free position for text around a point of the picture, at these distances.
    pub(super) fn find(&self, at_px: [f64; 2], distances_px: &[f32], size_px: f32, text: &str) -> Option<[f32; 2]> {
        let [x, y] = pixels(at_px);
        let [width_px, height_px] = self.size_px;
        if !((0.0..=width_px).contains(&x) && (0.0..=height_px).contains(&y)) {
            return None;
        }
        let half = width(size_px, text) / 2.0;
        let around = |distance: f32| {
            [[0.0, -1.0], [0.0, 1.0], [1.0, 0.0], [-1.0, 0.0], [0.7, -0.7], [-0.7, -0.7]]
                .map(|[right, down]| [x + right * (distance + half), y + down * distance])
        };
        let mut places = distances_px.iter().flat_map(|&distance| around(distance));
        places.find(|&centre| self.has_room(area(centre, [0.5, 0.5], size_px, text)))
    }
}

/// Returns the width of text \[pixels\].
pub(crate) fn width(size_px: f32, text: &str) -> f32 {
    let letter =
        |c: char| (c as usize).checked_sub(32).and_then(|k| CHARACTER_WIDTHS.get(k)).copied().unwrap_or(OTHER_WIDTH);
    text.chars().map(|c| f32::from(letter(c))).sum::<f32>() * size_px / 1000.0
}

fn area(at_px: [f32; 2], anchor: [f32; 2], size_px: f32, text: &str) -> Corners {
    let (width, padding) = (width(size_px, text), PADDING * size_px);
    let (left, top) = (at_px[0] - anchor[0] * width, at_px[1] - anchor[1] * size_px);
    [[left - padding, top - padding], [left + width + padding, top + size_px + padding]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_do_not_overlap_and_stay_in_the_picture() {
        let mut labels = LabelLayout::new([200, 100]);
        let ink = Colour::hex(0);
        assert!(labels.put_if_free([50.0, 50.0], [0.5, 0.5], 10.0, ink, "first"));
        assert!(!labels.put_if_free([55.0, 52.0], [0.5, 0.5], 10.0, ink, "second"), "it would cover the first");
        assert!(!labels.put_if_free([195.0, 50.0], [0.0, 0.5], 10.0, ink, "third"), "it would leave the picture");
        let found = labels.find([50.0, 50.0], &[20.0], 10.0, "fourth").expect("room");
        assert!(labels.put_if_free(found.map(f64::from), [0.5, 0.5], 10.0, ink, "fourth"), "{found:?}");
        assert_eq!(labels.find([-50.0, 50.0], &[80.0], 10.0, "fifth"), None, "its point is outside the picture");
        labels.reserve([[0.0, 0.0], [200.0, 100.0]]);
        assert_eq!(labels.find([50.0, 50.0], &[20.0], 10.0, "sixth"), None, "everything is taken");
        assert_eq!(labels.annotations.len(), 2);
    }
}
