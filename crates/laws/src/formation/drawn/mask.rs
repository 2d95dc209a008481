//! Which pixels of a raster are drawn.

use super::outline::{Point, Region};

/// Rows of square pixels from below, each from the left.
#[derive(Clone, Debug)]
pub(super) struct Mask {
    pub(super) width: usize,
    /// One flag a pixel.
    pub(super) drawn: Vec<bool>,
    /// Side of a pixel, in longer sides of the drawing.
    pub(super) side: f64,
}

impl Mask {
    /// The raster of an area that fits within 1 x 1: `pixels` along a side of that. A pixel is drawn whose middle is.
    pub(super) fn of(regions: &[Region], pixels: usize) -> Self {
        let mut mask = Self { width: pixels, drawn: vec![false; pixels * pixels], side: 1.0 / pixels as f64 };
        for region in regions {
            mask.fill(region);
        }
        mask
    }

    /// Number of pixels that are drawn.
    pub(super) fn count(&self) -> usize {
        self.drawn.iter().filter(|&&drawn| drawn).count()
    }

    /// Column and row of each pixel that is drawn.
    pub(super) fn pixels(&self) -> impl Iterator<Item = [usize; 2]> {
        let drawn = self.drawn.iter().enumerate().filter(|&(_, &drawn)| drawn);
        drawn.map(|(place, _)| [place % self.width, place / self.width])
    }

    fn fill(&mut self, region: &Region) {
        let inside = |winding: i32| if region.even_odd { winding % 2 != 0 } else { winding != 0 };
        for (row, mut crossings) in self.crossings(region).into_iter().enumerate() {
            crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut winding = 0;
            for pair in crossings.windows(2) {
                winding += pair[0].1;
                if inside(winding) {
                    let [from, to] = [pair[0].0, pair[1].0].map(|x| self.first_from(x));
                    self.drawn[row * self.width + from..row * self.width + to].fill(true);
                }
            }
        }
    }

    /// Where the middle line of each row crosses the region's lines, with +1 upwards and -1 downwards.
    fn crossings(&self, region: &Region) -> Vec<Vec<(f64, i32)>> {
        let mut rows: Vec<Vec<(f64, i32)>> = vec![Vec::new(); self.width];
        let mut cross = |from: Point, to: Point| {
            let ([x0, y0], [x1, y1], sense) = if from[1] < to[1] { (from, to, 1) } else { (to, from, -1) };
            let first = self.first_from(y0);
            for (row, crossings) in rows[..self.first_from(y1)].iter_mut().enumerate().skip(first) {
                let y = (row as f64 + 0.5) * self.side;
                crossings.push((x0 + (x1 - x0) * (y - y0) / (y1 - y0), sense));
            }
        };
        for line in &region.lines {
            line.windows(2).for_each(|ends| cross(ends[0], ends[1]));
            if let (Some(&first), Some(&last)) = (line.first(), line.last()) {
                cross(last, first);
            }
        }
        rows
    }

    /// The first pixel of a row or column whose middle is not before a coordinate.
    fn first_from(&self, coordinate: f64) -> usize {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the raster")]
        let first = (coordinate / self.side - 0.5).ceil().clamp(0.0, self.width as f64) as usize;
        first
    }
}
