//! Text and legends, drawn with egui.

use egui::epaint::{ClippedPrimitive, Mesh, Vertex};
use egui::{Color32, FontId, Pos2, Rect, Shape, Stroke, StrokeKind, Vec2, pos2};
use egui_wgpu::ScreenDescriptor;

use super::adapter::Gpu;
use super::{Target, WORDS_FORMAT};
use crate::scene::{Annotation, Colour};

/// Draws annotations over pictures.
pub(super) struct Overlay {
    context: egui::Context,
    renderer: egui_wgpu::Renderer,
}

impl Overlay {
    pub(super) fn new(device: &wgpu::Device) -> Self {
        let options = egui_wgpu::RendererOptions { dithering: false, ..egui_wgpu::RendererOptions::PREDICTABLE };
        let renderer = egui_wgpu::Renderer::new(device, WORDS_FORMAT, options);
        Self { context: egui::Context::default(), renderer }
    }

    pub(super) fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        annotations: &[Annotation],
    ) {
        let [width, height] = target.size_px;
        let screen = Rect::from_min_size(Pos2::ZERO, Vec2::new(width as f32, height as f32));
        let input = egui::RawInput {
            screen_rect: Some(screen),
            max_texture_side: Some(gpu.largest_px as usize),
            // A fixed time keeps pictures deterministic.
            time: Some(0.0),
            ..egui::RawInput::default()
        };
        let mut output = self.context.run_pass(input, |context| {
            let layer = egui::LayerId::background();
            paint(&context.layer_painter(layer).with_clip_rect(screen), annotations, Vec2::ZERO, 1.0);
        });
        let primitives: Vec<ClippedPrimitive> = self.context.tessellate(std::mem::take(&mut output.shapes), 1.0);
        let screen = ScreenDescriptor { size_in_pixels: target.size_px, pixels_per_point: 1.0 };
        for (id, deltas) in &output.textures_delta.set {
            for delta in deltas {
                self.renderer.update_texture(&gpu.device, &gpu.queue, *id, delta);
            }
        }
        self.renderer.update_buffers(&gpu.device, &gpu.queue, encoder, &primitives, &screen);
        let mut pass = encoder
            .begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("words"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &target.words_view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
                })],
                ..wgpu::RenderPassDescriptor::default()
            })
            .forget_lifetime();
        self.renderer.render(&mut pass, &primitives, &screen);
        drop(pass);
        for id in &output.textures_delta.free {
            self.renderer.free_texture(id);
        }
        output.textures_delta.clear();
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
