//! Rendering of scenes on the processor, for machines without a graphics adapter.
//!
//! The pictures follow `shaders/scene.wgsl`: four samples per pixel, blending in linear light. Bands of rows are drawn
//! in parallel.

use std::ops::Range;

use nalgebra::{Vector2, Vector3};
use rayon::iter::{IndexedParallelIterator as _, ParallelIterator as _};
use rayon::slice::ParallelSliceMut as _;

use super::error::{RenderError, check_size};
use super::overlay::Overlay;
use super::picture::{Picture, byte, pixels};
use super::scene::{Ball, Camera, Colour, Disc, Face, Lens, Line, Scene};
use tautline_report::drawing::LIGHT;

/// Largest side of a picture \[pixels\].
const LARGEST_PX: u32 = 16_384;
/// Rows of a band.
const BAND: usize = 16;
/// Positions of the samples of a pixel.
const SAMPLES: [[f32; 2]; 4] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];
/// Light on a side that faces away from the light, share of the reflected light, and its exponent.
pub(crate) const AMBIENT: f32 = 0.38;
pub(crate) const GLOSS: f32 = 0.16;
pub(crate) const SHININESS: u8 = 48;

/// Renderer without an adapter.
#[derive(Default)]
pub(crate) struct Software(Overlay);

impl Software {
    pub(crate) const NAME: &'static str = "the program itself, without a graphics adapter";

    pub(crate) fn check_size(size_px: [u32; 2]) -> Result<(), RenderError> {
        check_size(size_px, LARGEST_PX, "the program")
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
        self.0.draw(&scene.annotations, &mut picture);
        Ok(picture)
    }
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

    /// Returns the point of a plane at a point of the picture, relative to the plane's centre, and its depth \[m\].
    fn on_plane(&self, [x, y]: [f32; 2], centre: Vec3, normal: Vec3) -> (Vec3, f32) {
        let [origin, direction] = self.ray(x, y);
        let point = origin + direction * ((centre - origin).dot(&normal) / direction.dot(&normal));
        (point - centre, -point.z)
    }

    /// Projects a point ahead of the camera \[pixels\].
    fn project(&self, point: Vec3) -> Vector2<f32> {
        let scale = if self.is_perspective { -1.0 / point.z } else { 1.0 };
        let [x, y] = [point.x * scale / self.half[0], point.y * scale / self.half[1]];
        Vector2::new((1.0 + x) * self.size_px[0] / 2.0, (1.0 - y) * self.size_px[1] / 2.0)
    }

    /// Returns a rectangle around a ball, from the left and the top \[pixels\]; `None` outside of the picture.
    fn around(&self, centre: Vec3, radius_m: f32) -> Option<[[f32; 2]; 2]> {
        let depth_m = -centre.z;
        let half = if !self.is_perspective {
            radius_m
        } else if depth_m <= -radius_m {
            return None;
        } else if depth_m <= 1.001 * radius_m {
            return Some([[0.0, 0.0], self.size_px]);
        } else {
            // Bound of the ellipse as which a ball appears, from the tangent cone of its distance and direction.
            let sine = radius_m / centre.norm().max(depth_m);
            let stretch = 1.0 / (1.0 - (radius_m / depth_m).powi(2)).max(1e-4);
            let aside = centre.xy().norm() / depth_m;
            sine / (1.0 - sine * sine).max(1e-4).sqrt() * (1.0 + aside * aside) * stretch
        };
        let centre_px = self.project(centre);
        let reach = half / self.half[1] * self.size_px[1] / 2.0 + 1.0;
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

    /// Returns whether a point at a depth is ahead of the camera and of what is drawn.
    fn shows(&self, sample: usize, depth_m: f32) -> bool {
        depth_m < self.depths_m[sample] && (!self.view.is_perspective || depth_m > 0.0)
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
        let light = single(LIGHT.into());
        self.visit(around, |band, sample, [x, y]| {
            let Some(hit) = view.hit(view.ray(x, y), centre, ball.radius_m, 1.0) else { return };
            if hit.depth_m < band.depths_m[sample] {
                let lit = AMBIENT + (1.0 - AMBIENT) * hit.normal.dot(&light).max(0.0);
                let gloss = GLOSS * hit.normal.dot(&(light + hit.view).normalize()).max(0.0).powi(SHININESS.into());
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
            let (offset, depth_m) = view.on_plane([x, y], centre, normal);
            let is_inside = (0..2).all(|k| offset.dot(&half[k]).abs() <= squared[k]);
            if is_inside && band.shows(sample, depth_m) {
                band.depths_m[sample] = depth_m;
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
            let (offset, depth_m) = view.on_plane([x, y], centre, normal);
            let out = offset.norm() / disc.radius_m;
            if out <= 1.0 && band.shows(sample, depth_m) {
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
