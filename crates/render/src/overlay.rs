//! Text and legends, drawn with egui.

use egui::epaint::{ImageData, Mesh, Primitive, Vertex};
use egui::{Color32, FontId, Pos2, Rect, Shape, Stroke, StrokeKind, TextureId, Vec2, pos2};

use super::picture::{Picture, byte, pixels};
use super::scene::{Annotation, Colour};

/// Largest side of the texture of letters \[pixels\].
const LETTERS_PX: usize = 2048;

/// Draws annotations over pictures, on the processor.
#[derive(Default)]
pub(super) struct Overlay {
    context: egui::Context,
    letters: Letters,
}

/// Texture of the letters.
#[derive(Default)]
struct Letters {
    size: [usize; 2],
    pixels: Vec<Color32>,
}

impl Overlay {
    pub(super) fn draw(&mut self, annotations: &[Annotation], picture: &mut Picture) {
        let [width, height] = picture.size_px.map(|side| side as f32);
        let screen = Rect::from_min_size(Pos2::ZERO, Vec2::new(width, height));
        let input = egui::RawInput {
            screen_rect: Some(screen),
            max_texture_side: Some(LETTERS_PX),
            // A fixed time keeps pictures deterministic.
            time: Some(0.0),
            ..egui::RawInput::default()
        };
        let mut output = self.context.run_pass(input, |context| {
            let painter = context.layer_painter(egui::LayerId::background()).with_clip_rect(screen);
            paint(&painter, annotations, Vec2::ZERO, 1.0);
        });
        for (id, deltas) in &output.textures_delta.set {
            for delta in deltas.iter().filter(|_| *id == TextureId::default()) {
                let ImageData::Color(image) = &delta.image;
                self.letters.update(delta.pos, image.size, &image.pixels);
            }
        }
        let shapes = std::mem::take(&mut output.shapes);
        for clipped in self.context.tessellate(shapes, 1.0) {
            if let Primitive::Mesh(mesh) = &clipped.primitive {
                self.letters.mesh(mesh, clipped.clip_rect, picture);
            }
        }
        output.textures_delta.clear();
    }
}

impl Letters {
    /// Replaces the texture, or the part of it at a position.
    fn update(&mut self, origin: Option<[usize; 2]>, [width, height]: [usize; 2], pixels: &[Color32]) {
        let Some([left, top]) = origin else {
            (self.size, self.pixels) = ([width, height], pixels.to_vec());
            return;
        };
        for (y, row) in pixels.chunks_exact(width.max(1)).enumerate().take(height) {
            let from = (top + y) * self.size[0] + left;
            if let Some(old) = self.pixels.get_mut(from..from + width) {
                old.copy_from_slice(row);
            }
        }
    }

    /// Returns the nearest texel, from 0 to 1 per channel. Letters are drawn at whole pixels.
    fn texel(&self, u: f32, v: f32) -> [f32; 4] {
        let index_at = |part: f32, side: usize| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
            let index = (part * side as f32) as usize;
            index.min(side.saturating_sub(1))
        };
        let texel = self.pixels.get(index_at(v, self.size[1]) * self.size[0] + index_at(u, self.size[0]));
        texel.map_or([1.0; 4], |texel| texel.to_array().map(|channel| f32::from(channel) / 255.0))
    }

    fn mesh(&self, mesh: &Mesh, clip: Rect, picture: &mut Picture) {
        for corners in mesh.indices.chunks_exact(3) {
            let corner = |k: usize| mesh.vertices.get(corners[k] as usize).copied();
            if let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) {
                self.triangle([a, b, c], clip, picture);
            }
        }
    }

    /// Draws a triangle with premultiplied colours.
    fn triangle(&self, [a, b, c]: [Vertex; 3], clip: Rect, picture: &mut Picture) {
        let cross = |p: Pos2, q: Pos2, r: Pos2| (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
        let area = cross(a.pos, b.pos, c.pos);
        if area == 0.0 {
            return;
        }
        let [b, c] = if area > 0.0 { [b, c] } else { [c, b] };
        let area = area.abs();
        let edges = [[b.pos, c.pos], [c.pos, a.pos], [a.pos, b.pos]];
        // A pixel on a common edge belongs to one triangle only.
        let owns = edges.map(|[p, q]| q.y < p.y || q.y == p.y && q.x > p.x);
        let bounds = Rect::from_points(&[a.pos, b.pos, c.pos]).intersect(clip);
        let [width, height] = picture.size_px;
        for y in pixels(bounds.top(), bounds.bottom(), height) {
            for x in pixels(bounds.left(), bounds.right(), width) {
                let pixel = Pos2::new(x as f32 + 0.5, y as f32 + 0.5);
                let weights = edges.map(|[p, q]| cross(p, q, pixel));
                if !clip.contains(pixel) || weights.iter().zip(owns).any(|(&w, owns)| w < 0.0 || w == 0.0 && !owns) {
                    continue;
                }
                let [wa, wb, wc] = weights.map(|weight| weight / area);
                let mix = |value_of: &dyn Fn(&Vertex) -> f32| wa * value_of(&a) + wb * value_of(&b) + wc * value_of(&c);
                let texel = self.texel(mix(&|v| v.uv.x), mix(&|v| v.uv.y));
                let from = (y * width as usize + x) * 4;
                let source = [0, 1, 2, 3].map(|k| mix(&|v| f32::from(v.color.to_array()[k])) * texel[k]);
                for k in 0..3 {
                    let under = f32::from(picture.rgba[from + k]);
                    picture.rgba[from + k] = byte(source[k] + under * (1.0 - source[3] / 255.0));
                }
            }
        }
    }
}

/// Draws annotations with the top left corner of their picture at `origin` \[points\].
pub(crate) fn paint(painter: &egui::Painter, annotations: &[Annotation], origin: Vec2, pixels_per_point: f32) {
    let scale = 1.0 / pixels_per_point;
    let to_screen = |[x, y]: [f32; 2]| pos2(x * scale, y * scale) + origin;
    let corners = |[low, high]: [[f32; 2]; 2]| Rect::from_min_max(to_screen(low), to_screen(high));
    let stroke = |width_px: f32, colour| Stroke::new(width_px * scale, colour32(colour));
    for annotation in annotations {
        match annotation {
            Annotation::Words { at_px, anchor, size_px, colour, text } => {
                let font = FontId::proportional(size_px * scale);
                let galley = painter.layout_no_wrap(text.clone(), font, colour32(*colour));
                let place = to_screen(*at_px) - Vec2::new(anchor[0], anchor[1]) * galley.size();
                // Whole pixels keep letters sharp.
                let place =
                    pos2((place.x * pixels_per_point).round() * scale, (place.y * pixels_per_point).round() * scale);
                painter.galley(place, galley, colour32(*colour));
            }
            Annotation::Box { corners_px, colour, round_px } => {
                painter.rect_filled(corners(*corners_px), round_px * scale, colour32(*colour));
            }
            Annotation::Outline { corners_px, colour, width_px } => {
                painter.rect_stroke(corners(*corners_px), 0.0, stroke(*width_px, *colour), StrokeKind::Inside);
            }
            Annotation::Scale { corners_px, colours } => {
                painter.add(Shape::mesh(gradient(corners(*corners_px), colours)));
            }
            Annotation::Stroke { ends_px, colour, width_px } => {
                painter.line_segment(ends_px.map(to_screen), stroke(*width_px, *colour));
            }
            Annotation::Ring { at_px, radius_px, colour, width_px } => {
                painter.circle_stroke(to_screen(*at_px), radius_px * scale, stroke(*width_px, *colour));
            }
        }
    }
}

fn gradient(area: Rect, colours: &[Colour]) -> Mesh {
    let mut mesh = Mesh::default();
    let last = colours.len().saturating_sub(1).max(1) as f32;
    for (k, colour) in colours.iter().enumerate() {
        let x = area.left() + area.width() * (k as f32 / last);
        for y in [area.top(), area.bottom()] {
            mesh.vertices.push(Vertex { pos: pos2(x, y), uv: egui::epaint::WHITE_UV, color: colour32(*colour) });
        }
    }
    for k in 1..u32::try_from(colours.len()).unwrap_or(0) {
        let right = 2 * k;
        mesh.add_triangle(right - 2, right - 1, right);
        mesh.add_triangle(right - 1, right, right + 1);
    }
    mesh
}

fn colour32(colour: Colour) -> Color32 {
    let [red, green, blue, opacity] = colour.rgba;
    Color32::from_rgba_unmultiplied(red, green, blue, opacity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::width;

    /// Letters are placed at quarters of a pixel, or at whole ones.
    const ROUNDING_PX: f32 = 0.5;

    #[test]
    fn text_widths_match_the_layout() {
        let context = egui::Context::default();
        let mut largest = 0.0_f32;
        let mut output = context.run_pass(egui::RawInput::default(), |context| {
            let painter = context.layer_painter(egui::LayerId::background());
            for text in
                ["closest so far 2.460 m, vehicles 1-3 at 2.15 s", "WWW", "iii", "keep-out shell, radius delta/2"]
            {
                for size_px in [9.0, 17.0, 40.0] {
                    let galley = painter.layout_no_wrap(text.to_owned(), FontId::proportional(size_px), Color32::WHITE);
                    largest = largest.max((galley.size().x - width(size_px, text)).abs() / text.len() as f32);
                }
            }
        });
        output.textures_delta.clear();
        assert!(largest <= ROUNDING_PX, "{largest} pixels a letter");
    }
}
