//! Words that do not cover each other.

use super::{Colour, Mark};

/// Widths of the letters from space to ~ in thousandths of the height of a line, as the overlay's font has them.
#[rustfmt::skip]
const LETTERS: [u16; 95] = [
    228, 274, 392, 653, 564, 831, 648, 240, 310, 310, 472, 564, 246, 282, 246, 359, 564, 564, 564, 564,
    564, 564, 564, 564, 564, 564, 246, 246, 564, 564, 564, 380, 940, 641, 630, 609, 702, 555, 520, 658,
    692, 248, 487, 599, 502, 865, 709, 774, 592, 774, 618, 517, 548, 680, 624, 921, 608, 569, 560, 310,
    359, 310, 564, 490, 376, 509, 583, 460, 583, 548, 376, 573, 569, 237, 237, 495, 255, 863, 569, 582,
    583, 583, 374, 428, 387, 569, 480, 775, 499, 474, 455, 319, 262, 319, 564,
];
/// Width of any other letter.
const OTHER: u16 = 996;
/// Room around words over the height of a line.
const PADDING: f32 = 0.12;

/// Puts words into a picture where there is room for them.
pub(super) struct Placing<'a> {
    marks: &'a mut Vec<Mark>,
    size_px: [f32; 2],
    /// Boxes that are taken: left, top, right, bottom.
    taken: Vec<[f32; 4]>,
}

impl<'a> Placing<'a> {
    pub(super) fn new(marks: &'a mut Vec<Mark>, size_px: [u32; 2]) -> Self {
        Self { marks, size_px: size_px.map(|size| size as f32), taken: Vec::new() }
    }

    /// Adds a mark that needs no room.
    pub(super) fn draw(&mut self, mark: Mark) {
        self.marks.push(mark);
    }

    /// Keeps words out of a box: top left and bottom right.
    pub(super) fn take(&mut self, [[left, top], [right, bottom]]: [[f32; 2]; 2]) {
        self.taken.push([left, top, right, bottom]);
    }

    /// Writes words with this part of them at a place, whatever is there, and gives their box.
    pub(super) fn write(
        &mut self,
        at_px: [f32; 2],
        anchor: [f32; 2],
        size_px: f32,
        colour: Colour,
        text: &str,
    ) -> [[f32; 2]; 2] {
        let [left, top, right, bottom] = area(at_px, anchor, size_px, text);
        self.taken.push([left, top, right, bottom]);
        self.marks.push(Mark::Words { at_px, anchor, size_px, colour, text: text.to_owned() });
        [[left, top], [right, bottom]]
    }

    /// Writes words if there is room for them; says whether there was.
    pub(super) fn words_at(
        &mut self,
        at_px: [f64; 2],
        anchor: [f32; 2],
        size_px: f32,
        colour: Colour,
        text: &str,
    ) -> bool {
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let at_px = at_px.map(|x| x as f32);
        let room = self.has_room(area(at_px, anchor, size_px, text));
        if room {
            self.write(at_px, anchor, size_px, colour, text);
        }
        room
    }

    /// How many marks there are, and how many places are taken.
    pub(super) fn placed(&self) -> (usize, usize) {
        (self.marks.len(), self.taken.len())
    }

    /// Puts a box behind every mark from `mark` on that surrounds all places taken from `taken` on.
    pub(super) fn back(&mut self, taken: usize, mark: usize, colour: Colour, room_px: f32) {
        let Some((first, rest)) = self.taken[taken..].split_first() else { return };
        let around = rest.iter().fold(*first, |a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]);
        let [left, top, right, bottom] = around;
        let corners_px = [[left - room_px, top - room_px], [right + room_px, bottom + room_px]];
        self.marks.insert(mark, Mark::Box { corners_px, colour, round_px: room_px });
    }

    fn has_room(&self, [left, top, right, bottom]: [f32; 4]) -> bool {
        let inside = left >= 0.0 && top >= 0.0 && right <= self.size_px[0] && bottom <= self.size_px[1];
        let clear = |taken: &[f32; 4]| right <= taken[0] || taken[2] <= left || bottom <= taken[1] || taken[3] <= top;
        inside && self.taken.iter().all(clear)
    }

    /// The nearest place around a point of the picture, at these distances from it, that has room for words.
    pub(super) fn find(&self, at_px: [f64; 2], distances_px: &[f32], size_px: f32, text: &str) -> Option<[f32; 2]> {
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let [x, y] = at_px.map(|x| x as f32);
        let [width_px, height_px] = self.size_px;
        if !((0.0..=width_px).contains(&x) && (0.0..=height_px).contains(&y)) {
            return None;
        }
        for &distance in distances_px {
            for [right, down] in [[0.0, -1.0], [0.0, 1.0], [1.0, 0.0], [-1.0, 0.0], [0.7, -0.7], [-0.7, -0.7]] {
                let half = width(size_px, text) / 2.0;
                let centre = [x + right * (distance + half), y + down * distance];
                if self.has_room(area(centre, [0.5, 0.5], size_px, text)) {
                    return Some(centre);
                }
            }
        }
        None
    }
}

/// How wide words are \[pixels\].
pub(in crate::render) fn width(size_px: f32, text: &str) -> f32 {
    let letter = |c: char| (c as usize).checked_sub(32).and_then(|k| LETTERS.get(k)).copied().unwrap_or(OTHER);
    text.chars().map(|c| f32::from(letter(c))).sum::<f32>() * size_px / 1000.0
}

fn area(at_px: [f32; 2], anchor: [f32; 2], size_px: f32, text: &str) -> [f32; 4] {
    let (width, padding) = (width(size_px, text), PADDING * size_px);
    let (left, top) = (at_px[0] - anchor[0] * width, at_px[1] - anchor[1] * size_px);
    [left - padding, top - padding, left + width + padding, top + size_px + padding]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_never_cover_each_other_and_stay_in_the_picture() {
        let mut marks = Vec::new();
        let mut placing = Placing::new(&mut marks, [200, 100]);
        let ink = Colour::hex(0);
        assert!(placing.words_at([50.0, 50.0], [0.5, 0.5], 10.0, ink, "first"));
        assert!(!placing.words_at([55.0, 52.0], [0.5, 0.5], 10.0, ink, "second"), "it would cover the first");
        assert!(!placing.words_at([195.0, 50.0], [0.0, 0.5], 10.0, ink, "third"), "it would stick out");
        let found = placing.find([50.0, 50.0], &[20.0], 10.0, "fourth").expect("room");
        assert!(placing.words_at(found.map(f64::from), [0.5, 0.5], 10.0, ink, "fourth"), "{found:?}");
        assert_eq!(placing.find([-50.0, 50.0], &[80.0], 10.0, "fifth"), None, "its point is outside the picture");
        placing.take([[0.0, 0.0], [200.0, 100.0]]);
        assert_eq!(placing.find([50.0, 50.0], &[20.0], 10.0, "sixth"), None, "everything is taken");
        assert_eq!(marks.len(), 2);
    }
}
