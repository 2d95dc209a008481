//! Rendering of scenes on the processor, for machines without a graphics adapter.
//!
//! The pictures follow `shaders/scene.wgsl`: four samples per pixel, blending in linear light, text on top. Bands of
//! rows are drawn in parallel.

use std::ops::Range;

use egui::epaint::{ImageData, Mesh, Primitive, Vertex};
use egui::{Color32, Pos2, Rect, TextureId, Vec2};
use nalgebra::{Vector2, Vector3};
use rayon::iter::{IndexedParallelIterator as _, ParallelIterator as _};
use rayon::slice::ParallelSliceMut as _;

use super::error::RenderError;
use super::gpu::paint;
use super::picture::Picture;
use super::scene::{Ball, Camera, Colour, Disc, Face, Lens, Line, Scene};

/// Largest side of a picture \[pixels\].
const LARGEST_PX: u32 = 16_384;
/// Largest side of the texture of letters \[pixels\].
const LETTERS_PX: usize = 2048;
/// Rows of a band.
const BAND: usize = 16;
/// Positions of the samples of a pixel.
const SAMPLES: [[f32; 2]; 4] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];
/// Light from above the camera's left shoulder, as in shaders/scene.wgsl.
const LIGHT: [f32; 3] = [-0.408, 0.577, 0.707];
const AMBIENT: f32 = 0.38;
const GLOSS: f32 = 0.16;
const SHININESS: i32 = 48;

/// Renderer without an adapter.
#[derive(Default)]
pub(crate) struct Software {
    context: egui::Context,
    letters: Letters,
}

/// Texture of the letters.
#[derive(Default)]
struct Letters {
    size: [usize; 2],
    pixels: Vec<Color32>,
}

impl Software {
    pub(crate) const NAME: &'static str = "the program itself, without a graphics adapter";

    pub(crate) fn check_size([width, height]: [u32; 2]) -> Result<(), RenderError> {
        if [width, height].into_iter().all(|side| (1..=LARGEST_PX).contains(&side)) {
            return Ok(());
        }
        let cannot = format!("a picture of {width} x {height} pixels cannot be drawn");
        Err(RenderError::PictureSize(format!("{cannot}: the program draws from 1 to {LARGEST_PX} pixels a side")))
    }

    pub(crate) fn paint(&mut self, scene: &Scene) -> Result<Picture, RenderError> {
        let size_px = scene.camera.size_px;
        Self::check_size(size_px)?;
        let [width, height] = size_px.map(|side| side as usize);
        let view = ViewSpace::of(scene);
        let lines: Vec<_> = scene.lines.iter().filter_map(|line| view.stroke(line)).collect();
        let mut rgba = vec![0; width * height * 4];
        rgba.par_chunks_mut(width * 4 * BAND).enumerate().for_each(|(k, rows)| {
            let rows_px = k * BAND..k * BAND + rows.len() / (width * 4);
            let mut band = Band::new(&view, rows_px, scene.background);
            for ball in &scene.balls {
                band.ball(ball);
            }
            for face in &scene.faces {
                band.face(face);
            }
            for line in &lines {
                band.line(line);
            }
            for disc in &scene.discs {
                band.disc(disc);
            }
            for shell in &scene.shells {
                band.shell(shell, scene.shell_ratio);
            }
            band.resolve(rows);
        });
        let mut picture = Picture { size_px, rgba };
        self.write(scene, &mut picture);
        Ok(picture)
    }

    /// Draws the annotations.
    fn write(&mut self, scene: &Scene, picture: &mut Picture) {
        let [width, height] = picture.size_px.map(|side| side as f32);
        let screen = Rect::from_min_size(Pos2::ZERO, Vec2::new(width, height));
        let input = egui::RawInput {
            screen_rect: Some(screen),
            max_texture_side: Some(LETTERS_PX),
            time: Some(0.0),
            ..egui::RawInput::default()
        };
        let mut output = self.context.run_pass(input, |context| {
            let painter = context.layer_painter(egui::LayerId::background()).with_clip_rect(screen);
            paint(&painter, &scene.annotations, Vec2::ZERO, 1.0);
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

/// Returns the pixels whose centres may be between two coordinates.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the casts saturate")]
fn pixels(from: f32, to: f32, side: u32) -> Range<usize> {
    (from.floor().max(0.0) as usize).min(side as usize)..(to.ceil().max(0.0) as usize).min(side as usize)
}

fn byte(value: f32) -> u8 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
    let byte = (value + 0.5) as u8;
    byte
}

type Vec3 = Vector3<f32>;

/// Camera with the axes right, up, back \[m\].
struct ViewSpace {
    camera: Camera,
    near_m: f32,
    half: [f32; 2],
    is_perspective: bool,
    size_px: [f32; 2],
    /// Vertical direction.
    up: Vec3,
}

/// Projected line.
struct Stroke {
    ends_px: [Vector2<f32>; 2],
    /// Inverse depths in perspective, else depths.
    depths: [f32; 2],
    colours: [[f32; 4]; 2],
    width_px: f32,
}

struct Hit {
    normal: Vec3,
    view: Vec3,
    depth_m: f32,
}

impl ViewSpace {
    fn of(scene: &Scene) -> Self {
        let camera = scene.camera;
        let (half, is_perspective) = match camera.lens {
            Lens::Perspective(half) => (half, true),
            Lens::Parallel(half) => (half, false),
        };
        let up = single(Vector3::new(camera.right.z, camera.up.z, camera.back.z));
        #[expect(clippy::cast_possible_truncation, reason = "samples are in single precision")]
        let (half, near_m) = (half.map(|half| half as f32), scene.depth_m[0] as f32);
        Self { camera, near_m, half, is_perspective, size_px: camera.size_px.map(|side| side as f32), up }
    }

    fn at(&self, point_m: [f32; 3]) -> Vec3 {
        single(self.camera.in_camera_frame(Vector3::from(point_m.map(f64::from))))
    }

    /// Returns origin and direction of the ray through a point of the picture.
    fn ray(&self, x: f32, y: f32) -> [Vec3; 2] {
        let flat = [(x / self.size_px[0] * 2.0 - 1.0) * self.half[0], (1.0 - y / self.size_px[1] * 2.0) * self.half[1]];
        if self.is_perspective {
            [Vec3::zeros(), Vec3::new(flat[0], flat[1], -1.0)]
        } else {
            [Vec3::new(flat[0], flat[1], 0.0), Vec3::new(0.0, 0.0, -1.0)]
        }
    }

    /// Projects a point ahead of the camera \[pixels\].
    fn project(&self, point: Vec3) -> Vector2<f32> {
        let scale = if self.is_perspective { -1.0 / point.z } else { 1.0 };
        let [x, y] = [point.x * scale / self.half[0], point.y * scale / self.half[1]];
        Vector2::new((1.0 + x) * self.size_px[0] / 2.0, (1.0 - y) * self.size_px[1] / 2.0)
    }

    /// Returns a rectangle around a ball, from the left and the top \[pixels\]; `None` outside of the picture.
    fn around(&self, centre: Vec3, radius_m: f32) -> Option<[[f32; 2]; 2]> {
        let whole = [[0.0, 0.0], self.size_px];
        let depth_m = -centre.z;
        if !self.is_perspective {
            let centre_px = self.project(centre);
            let reach = radius_m / self.half[1] * self.size_px[1] / 2.0 + 1.0;
            return Some([[centre_px.x - reach, centre_px.y - reach], [centre_px.x + reach, centre_px.y + reach]]);
        }
        if depth_m <= -radius_m {
            return None;
        }
        if depth_m <= 1.001 * radius_m {
            return Some(whole);
        }
        let centre_px = self.project(centre);
        // Bound of the ellipse as which a ball appears, from the tangent cone of its distance and direction.
        let sine = radius_m / centre.norm().max(depth_m);
        let stretch = 1.0 / (1.0 - (radius_m / depth_m).powi(2)).max(1e-4);
        let aside = centre.xy().norm() / depth_m;
        let tangent = sine / (1.0 - sine * sine).max(1e-4).sqrt() * (1.0 + aside * aside) * stretch;
        let reach = tangent / self.half[1] * self.size_px[1] / 2.0 + 1.0;
        Some([[centre_px.x - reach, centre_px.y - reach], [centre_px.x + reach, centre_px.y + reach]])
    }

    fn stroke(&self, line: &Line) -> Option<Stroke> {
        let [mut first, mut second] = line.ends_m.map(|end| self.at(end));
        if self.is_perspective {
            if -first.z < self.near_m && -second.z < self.near_m {
                return None;
            }
            let cut = |behind: Vec3, ahead: Vec3| {
                behind + (ahead - behind) * ((self.near_m + behind.z) / (behind.z - ahead.z))
            };
            if -first.z < self.near_m {
                first = cut(first, second);
            } else if -second.z < self.near_m {
                second = cut(second, first);
            }
        }
        let ends_px = [first, second].map(|end| self.project(end));
        let depths = [first, second].map(|end| if self.is_perspective { -1.0 / end.z } else { -end.z });
        let is_finite = ends_px.iter().all(|end| end.iter().all(|x| x.is_finite()));
        let colours = line.colours.map(Colour::linear);
        is_finite.then_some(Stroke { ends_px, depths, colours, width_px: line.width_px })
    }

    fn to_sphere(&self, v: Vec3, ratio: f32) -> Vec3 {
        v + self.up * (v.dot(&self.up) * (1.0 / ratio - 1.0))
    }

    /// Returns where a ray meets an upright ellipsoid with this height over width.
    fn hit(&self, [origin, direction]: [Vec3; 2], centre: Vec3, radius_m: f32, ratio: f32) -> Option<Hit> {
        let to_origin = self.to_sphere(origin - centre, ratio);
        let along = self.to_sphere(direction, ratio);
        let squared = along.norm_squared();
        let middle = -to_origin.dot(&along) / squared;
        let chord = radius_m * radius_m - (to_origin + along * middle).norm_squared();
        if chord < 0.0 {
            return None;
        }
        let half = (chord / squared).sqrt();
        let reach = if middle - half < 0.0 { middle + half } else { middle - half };
        if reach < 0.0 {
            return None;
        }
        let point = origin + direction * reach;
        let normal = self.to_sphere(self.to_sphere(point - centre, ratio), ratio).normalize();
        Some(Hit { normal, view: -direction.normalize(), depth_m: -point.z })
    }
}

#[expect(clippy::cast_possible_truncation, reason = "samples are in single precision")]
fn single(v: Vector3<f64>) -> Vec3 {
    Vec3::new(v.x as f32, v.y as f32, v.z as f32)
}

/// Rows of a picture with their samples.
struct Band<'a> {
    view: &'a ViewSpace,
    rows: Range<usize>,
    width: usize,
    /// Linear colour and depth of each sample.
    colours: Vec<[f32; 3]>,
    depths_m: Vec<f32>,
}

impl<'a> Band<'a> {
    fn new(view: &'a ViewSpace, rows: Range<usize>, background: Colour) -> Self {
        let width = view.camera.size_px[0] as usize;
        let [red, green, blue, _] = background.linear();
        let samples = width * rows.len() * SAMPLES.len();
        Self { view, rows, width, colours: vec![[red, green, blue]; samples], depths_m: vec![f32::INFINITY; samples] }
    }

    /// Visits the samples within a rectangle with their index and position \[pixels\].
    fn visit(&mut self, [low, high]: [[f32; 2]; 2], mut act: impl FnMut(&mut Self, usize, [f32; 2])) {
        let rows = pixels(low[1], high[1], self.view.camera.size_px[1]);
        let columns = pixels(low[0], high[0], self.view.camera.size_px[0]);
        for y in rows.start.max(self.rows.start)..rows.end.min(self.rows.end) {
            for x in columns.clone() {
                let first = ((y - self.rows.start) * self.width + x) * SAMPLES.len();
                for (k, [right, down]) in SAMPLES.into_iter().enumerate() {
                    act(self, first + k, [x as f32 + right, y as f32 + down]);
                }
            }
        }
    }

    fn blend(&mut self, sample: usize, [red, green, blue, opacity]: [f32; 4]) {
        for (under, over) in self.colours[sample].iter_mut().zip([red, green, blue]) {
            *under += (over - *under) * opacity;
        }
    }

    fn ball(&mut self, ball: &Ball) {
        let (view, centre) = (self.view, self.view.at(ball.centre_m));
        let Some(around) = view.around(centre, ball.radius_m) else { return };
        let [red, green, blue, _] = ball.colour.linear();
        let light = Vec3::from(LIGHT);
        self.visit(around, |band, sample, [x, y]| {
            let Some(hit) = view.hit(view.ray(x, y), centre, ball.radius_m, 1.0) else { return };
            if hit.depth_m < band.depths_m[sample] {
                let lit = AMBIENT + (1.0 - AMBIENT) * hit.normal.dot(&light).max(0.0);
                let gloss = GLOSS * hit.normal.dot(&(light + hit.view).normalize()).max(0.0).powi(SHININESS);
                band.depths_m[sample] = hit.depth_m;
                band.colours[sample] = [red, green, blue].map(|part| part * lit + gloss);
            }
        });
    }

    fn face(&mut self, face: &Face) {
        let (view, centre) = (self.view, self.view.at(face.centre_m));
        let half = face.half_m.map(|side| {
            let end = std::array::from_fn(|axis| face.centre_m[axis] + side[axis]);
            view.at(end) - centre
        });
        let squared = half.map(|side| side.norm_squared());
        let normal = half[0].cross(&half[1]);
        let Some(around) = view.around(centre, (squared[0] + squared[1]).sqrt()) else { return };
        let [red, green, blue, _] = face.colour.linear();
        self.visit(around, |band, sample, [x, y]| {
            let [origin, direction] = view.ray(x, y);
            let point = origin + direction * ((centre - origin).dot(&normal) / direction.dot(&normal));
            let offset = point - centre;
            let is_inside = (0..2).all(|k| offset.dot(&half[k]).abs() <= squared[k]);
            if is_inside && -point.z < band.depths_m[sample] && (!view.is_perspective || point.z < 0.0) {
                band.depths_m[sample] = -point.z;
                band.colours[sample] = [red, green, blue];
            }
        });
    }

    fn shell(&mut self, shell: &Ball, ratio: f32) {
        let (view, centre) = (self.view, self.view.at(shell.centre_m));
        let Some(around) = view.around(centre, shell.radius_m * ratio.max(1.0)) else { return };
        let [red, green, blue, opacity] = shell.colour.linear();
        self.visit(around, |band, sample, [x, y]| {
            let Some(hit) = view.hit(view.ray(x, y), centre, shell.radius_m, ratio) else { return };
            if hit.depth_m < band.depths_m[sample] {
                let rim = 1.0 - hit.normal.dot(&hit.view).abs();
                band.blend(sample, [red, green, blue, opacity * (0.10 + 0.90 * rim.powi(3))]);
            }
        });
    }

    fn disc(&mut self, disc: &Disc) {
        let (view, centre) = (self.view, self.view.at(disc.centre_m));
        let tip = std::array::from_fn(|axis| disc.centre_m[axis] + disc.normal[axis]);
        let normal = (view.at(tip) - centre).normalize();
        let Some(around) = view.around(centre, disc.radius_m) else { return };
        let [red, green, blue, opacity] = disc.colour.linear();
        self.visit(around, |band, sample, [x, y]| {
            let [origin, direction] = view.ray(x, y);
            let point = origin + direction * ((centre - origin).dot(&normal) / direction.dot(&normal));
            let out = (point - centre).norm() / disc.radius_m;
            if out <= 1.0 && -point.z < band.depths_m[sample] && (!view.is_perspective || point.z < 0.0) {
                let rim = ((out - 0.86) / 0.14).clamp(0.0, 1.0);
                let rim = rim * rim * (3.0 - 2.0 * rim);
                let faded = (1.0 - out) * (1.0 - out);
                let share = if disc.glow > 0.5 { faded } else { 0.45 + 0.55 * rim };
                band.blend(sample, [red, green, blue, opacity * share]);
            }
        });
    }

    fn line(&mut self, line: &Stroke) {
        let [from, to] = line.ends_px;
        let (run, reach) = (to - from, line.width_px / 2.0);
        let length = run.norm();
        if length <= 0.0 {
            return;
        }
        let along = run / length;
        let (low, high) = (from.inf(&to).add_scalar(-reach), from.sup(&to).add_scalar(reach));
        let view = self.view;
        let rows = pixels(low.y, high.y, view.camera.size_px[1]);
        for y in rows.start.max(self.rows.start)..rows.end.min(self.rows.end) {
            // Columns of this row that the line can reach.
            let mut columns = [low.x, high.x];
            if along.y.abs() > 1e-6 {
                let half = (reach + 1.0) / along.y.abs();
                let crossing_x = from.x + (y as f32 + 0.5 - from.y) * along.x / along.y;
                let slack = half + (along.x / along.y).abs();
                columns = [columns[0].max(crossing_x - slack), columns[1].min(crossing_x + slack)];
            }
            self.visit([[columns[0], y as f32], [columns[1], y as f32 + 1.0]], |band, sample, [x, y]| {
                let offset = Vector2::new(x, y) - from;
                let (part, aside) = (offset.dot(&along) / length, along.perp(&offset).abs());
                if aside > reach || !(0.0..=1.0).contains(&part) {
                    return;
                }
                let depth = line.depths[0] + (line.depths[1] - line.depths[0]) * part;
                let (depth_m, share) =
                    if view.is_perspective { (1.0 / depth, part * line.depths[1] / depth) } else { (depth, part) };
                if depth_m < band.depths_m[sample] {
                    let [first, second] = line.colours;
                    band.blend(sample, [0, 1, 2, 3].map(|k| first[k] + (second[k] - first[k]) * share));
                }
            });
        }
    }

    /// Writes the means of the samples.
    fn resolve(&self, rgba: &mut [u8]) {
        for (pixel, samples) in rgba.chunks_exact_mut(4).zip(self.colours.chunks_exact(SAMPLES.len())) {
            for k in 0..3 {
                let mean = samples.iter().map(|sample| sample[k]).sum::<f32>() / SAMPLES.len() as f32;
                pixel[k] = byte(255.0 * srgb(mean));
            }
            pixel[3] = u8::MAX;
        }
    }
}

/// Converts linear light to sRGB (IEC 61966-2-1).
fn srgb(light: f32) -> f32 {
    let light = light.clamp(0.0, 1.0);
    if light <= 0.003_130_8 { 12.92 * light } else { 1.055 * light.powf(1.0 / 2.4) - 0.055 }
}
