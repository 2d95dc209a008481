//! Cameras: specification, framing, and projection.

use std::str::FromStr;

use nalgebra::Vector3;

use crate::error::RenderError;
use tautline_report::drawing::TAN_HALF_VIEW;

/// Smallest distance of a camera from its target \[m\].
const MIN_DISTANCE_M: f64 = 1e-3;
/// Margin beside the content, relative to half the width, and above and below the texts, relative to half the height.
const MARGIN: f64 = 0.03;
/// Largest sum of the heights of texts above and below the content, relative to the height.
const MAX_TEXTS: f64 = 0.4;

/// Choice of the camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum CameraSpec {
    /// The parallel view across the plane of a planar flight, else `Perspective`.
    #[default]
    Auto,
    /// View from above at an angle that frames all vehicles over the whole flight.
    Perspective,
    /// View straight down, x to the right and y up, in parallel projection, framing the whole flight.
    Top,
    /// View along +y, x to the right and z up, in parallel projection, framing the whole flight.
    Front,
    /// View along -x, y to the right and z up, in parallel projection, framing the whole flight.
    Side,
    /// View in the direction of `Auto` that follows the vehicle of this name, or the whole swarm.
    Follow(Option<String>),
    /// View in the direction of `Auto`, near the closest pair.
    Closest,
    /// View from a given direction and distance of the centre of the flight.
    Orbit(Orbit),
}

/// Camera on a sphere around its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Direction from the target to the camera, from the x axis towards the y axis \[degrees\].
    pub azimuth_deg: f64,
    /// Height of the camera above the target's horizon \[degrees\], from -90 to 90.
    pub elevation_deg: f64,
    /// Distance from the target \[m\].
    pub distance_m: f64,
}

impl CameraSpec {
    /// All cameras that are given by a name alone, with their names.
    pub const NAMED: [(&'static str, Self); 7] = [
        ("auto", Self::Auto),
        ("perspective", Self::Perspective),
        ("top", Self::Top),
        ("front", Self::Front),
        ("side", Self::Side),
        ("follow", Self::Follow(None)),
        ("closest", Self::Closest),
    ];
}

impl FromStr for CameraSpec {
    type Err = RenderError;

    fn from_str(text: &str) -> Result<Self, RenderError> {
        if let Some((_, camera)) = Self::NAMED.into_iter().find(|(name, _)| *name == text) {
            return Ok(camera);
        }
        if let Some(name) = text.strip_prefix("follow:").filter(|name| !name.is_empty()) {
            return Ok(Self::Follow(Some(name.to_owned())));
        }
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
        let Ok([azimuth_deg, elevation_deg, distance_m]) = numbers.as_deref() else {
            return Err(RenderError::Camera(format!("`{text}` is not a camera")));
        };
        let range = |what| Err(RenderError::Camera(format!("the camera `{text}` has {what}")));
        if !azimuth_deg.is_finite() {
            return range("an azimuth that is not a finite number");
        }
        if !(-90.0..=90.0).contains(elevation_deg) {
            return range("an elevation that is not between -90 and 90 degrees");
        }
        if !(MIN_DISTANCE_M..=1e9).contains(distance_m) {
            return range("a distance that is not between 0.001 and 1e9 m");
        }
        Ok(Self::Orbit(Orbit { azimuth_deg: *azimuth_deg, elevation_deg: *elevation_deg, distance_m: *distance_m }))
    }
}

/// Projection of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// Perspective: tangents of half the angle of view, horizontal and vertical.
    Perspective([f64; 2]),
    /// Parallel: half the width and height of the view \[m\].
    Parallel([f64; 2]),
}

/// Camera with position and projection. Lengths are in scene coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position \[m\].
    pub eye_m: Vector3<f64>,
    /// Unit vector to the right of the picture.
    pub right: Vector3<f64>,
    /// Unit vector to the top of the picture.
    pub up: Vector3<f64>,
    /// Unit vector from the target to the camera.
    pub back: Vector3<f64>,
    /// Projection.
    pub lens: Lens,
    /// Width and height of the picture \[pixels\].
    pub size_px: [u32; 2],
    /// Distance of the point around which the camera turns, ahead of the position \[m\].
    pub focus_m: f64,
}

/// Changes of a camera by hand: turned about its focus, zoomed and moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adjustment {
    /// Change of azimuth and elevation \[degrees\].
    pub turn_deg: [f64; 2],
    /// Factor of the distance, or of the height of a parallel view.
    pub zoom: f64,
    /// Movement of the focus \[m\].
    pub move_m: Vector3<f64>,
}

impl Adjustment {
    /// No change.
    pub const NONE: Self = Self { turn_deg: [0.0; 2], zoom: 1.0, move_m: Vector3::new(0.0, 0.0, 0.0) };
}

/// Direction and projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Direction {
    pub(super) azimuth_deg: f64,
    pub(super) elevation_deg: f64,
    pub(super) is_parallel: bool,
}

impl Direction {
    pub(super) const TOP: Self = Self::parallel(-90.0, 90.0);
    pub(super) const FRONT: Self = Self::parallel(-90.0, 0.0);
    pub(super) const SIDE: Self = Self::parallel(0.0, 0.0);

    const fn parallel(azimuth_deg: f64, elevation_deg: f64) -> Self {
        Self { azimuth_deg, elevation_deg, is_parallel: true }
    }

    pub(super) const fn perspective(azimuth_deg: f64, elevation_deg: f64) -> Self {
        Self { azimuth_deg, elevation_deg, is_parallel: false }
    }
}

/// Picture with the heights that texts need \[pixels\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    pub(super) size_px: [u32; 2],
    /// Heights of the texts at the top and at the bottom.
    pub(super) texts_px: [f64; 2],
}

impl Area {
    /// Returns the margins relative to half the width or height: left, right, bottom, top.
    fn margins(&self) -> [f64; 4] {
        let height = f64::from(self.size_px[1].max(1));
        let [top, bottom] = self.texts_px.map(|text_px| text_px / height);
        let scale = (MAX_TEXTS / (top + bottom)).min(1.0);
        [MARGIN, MARGIN, 2.0 * bottom * scale + MARGIN, 2.0 * top * scale + MARGIN]
    }
}

/// Projection of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// Position, to the right and down from the top left corner \[pixels\].
    pub at_px: [f64; 2],
    /// Distance ahead of the camera \[m\].
    pub depth_m: f64,
    /// Pixels per metre across the line of sight.
    pub px_per_m: f64,
}

impl Camera {
    /// Returns the nearest camera of a direction that sees all balls (centre and radius \[m\]) between the texts.
    pub(super) fn framing(direction: Direction, balls: &[(Vector3<f64>, f64)], area: Area) -> Self {
        let Direction { azimuth_deg, elevation_deg, is_parallel } = direction;
        let size_px = area.size_px;
        let [right, up, back] = axes(azimuth_deg, elevation_deg);
        let half = if is_parallel { 1.0 } else { TAN_HALF_VIEW };
        let across = half * aspect(size_px);
        let (room, margins) = ([across, across, half, half], area.margins());
        let slopes = [0, 1, 2, 3].map(|side| room[side] * (1.0 - margins[side]));
        let lengths = slopes.map(|slope| slope.hypot(1.0));
        // Required reach of each side of the view, and the range along the line of sight.
        let mut reaches = [f64::NEG_INFINITY; 4];
        let (mut nearest, mut farthest) = (f64::NEG_INFINITY, f64::INFINITY);
        for (centre, radius) in balls {
            let (x, y, ahead) = (right.dot(centre), up.dot(centre), -back.dot(centre));
            for (side, offset) in [-x, x, -y, y].into_iter().enumerate() {
                let reach =
                    if is_parallel { offset + radius } else { offset + radius * lengths[side] - ahead * slopes[side] };
                reaches[side] = reaches[side].max(reach);
            }
            (nearest, farthest) = (nearest.max(-ahead + radius), farthest.min(-ahead - radius));
        }
        if reaches.iter().any(|reach| !reach.is_finite()) {
            (reaches, nearest, farthest) = ([half; 4], 0.0, 0.0);
        }
        let need = |low: usize, high: usize| (reaches[low] + reaches[high]) / (slopes[low] + slopes[high]);
        let distance_m = need(0, 1).max(need(2, 3)).max(MIN_DISTANCE_M);
        let middle = |low: usize, high: usize| {
            let (least, most) = (reaches[high] - slopes[high] * distance_m, slopes[low] * distance_m - reaches[low]);
            f64::midpoint(least, most)
        };
        // A parallel view may be turned about its focus, so its camera is behind everything from all sides.
        let centre = f64::midpoint(nearest, farthest);
        let behind = if is_parallel { centre + 2.0 * distance_m + (nearest - farthest).max(1.0) } else { distance_m };
        let eye_m = right * middle(0, 1) + up * middle(2, 3) + back * behind;
        let lens = if is_parallel {
            Lens::Parallel([across * distance_m, distance_m])
        } else {
            Lens::Perspective([across, half])
        };
        Self { eye_m, right, up, back, lens, size_px, focus_m: (behind - centre).max(MIN_DISTANCE_M) }
    }

    /// Returns the camera after changes by hand.
    #[must_use]
    pub fn adjusted(&self, change: &Adjustment) -> Self {
        let Adjustment { turn_deg, zoom, move_m } = change;
        let target_m = self.eye_m - self.back * self.focus_m + move_m;
        let azimuth_deg = (-self.right.x).atan2(self.right.y).to_degrees() + turn_deg[0];
        let elevation_deg = (self.back.z.clamp(-1.0, 1.0).asin().to_degrees() + turn_deg[1]).clamp(-90.0, 90.0);
        let [right, up, back] = axes(azimuth_deg, elevation_deg);
        let (lens, focus_m) = match self.lens {
            Lens::Parallel(half) => (Lens::Parallel(half.map(|half| half * zoom)), self.focus_m),
            perspective @ Lens::Perspective(_) => (perspective, (self.focus_m * zoom).max(MIN_DISTANCE_M)),
        };
        Self { eye_m: target_m + back * focus_m, right, up, back, lens, focus_m, ..*self }
    }

    /// Returns half the height of the view at the focus \[m\].
    #[cfg(feature = "window")]
    pub(crate) fn half_height_m(&self) -> f64 {
        match self.lens {
            Lens::Perspective([_, half]) => half * self.focus_m,
            Lens::Parallel([_, half]) => half,
        }
    }

    /// Returns a perspective camera that looks at a target \[m\].
    #[must_use]
    pub fn orbiting(orbit: Orbit, target_m: Vector3<f64>, size_px: [u32; 2]) -> Self {
        let [right, up, back] = axes(orbit.azimuth_deg, orbit.elevation_deg);
        Self {
            eye_m: target_m + back * orbit.distance_m,
            right,
            up,
            back,
            lens: Lens::Perspective([TAN_HALF_VIEW * aspect(size_px), TAN_HALF_VIEW]),
            size_px,
            focus_m: orbit.distance_m,
        }
    }

    /// Transforms a point to camera coordinates: right, up, back \[m\].
    pub(crate) fn in_camera_frame(&self, point_m: Vector3<f64>) -> Vector3<f64> {
        let from_eye = point_m - self.eye_m;
        Vector3::new(self.right.dot(&from_eye), self.up.dot(&from_eye), self.back.dot(&from_eye))
    }

    /// Projects a point to the picture; `None` if it is behind a perspective camera.
    #[must_use]
    pub fn project(&self, point_m: Vector3<f64>) -> Option<Projected> {
        let local = self.in_camera_frame(point_m);
        let depth_m = -local.z;
        let [width, height] = self.size_px.map(f64::from);
        let half = match self.lens {
            Lens::Perspective(tangents) if depth_m > 0.0 => tangents.map(|tangent| tangent * depth_m),
            Lens::Perspective(_) => return None,
            Lens::Parallel(half) => half,
        };
        let at_px = [(1.0 + local.x / half[0]) * width / 2.0, (1.0 - local.y / half[1]) * height / 2.0];
        let px_per_m = height / 2.0 / half[1];
        at_px.iter().all(|x| x.is_finite()).then_some(Projected { at_px, depth_m, px_per_m })
    }

    /// Returns the ray through a point of the picture \[pixels from the top left corner\]: origin \[m\] and unit
    /// direction.
    #[cfg(test)]
    pub(super) fn ray(&self, at_px: [f64; 2]) -> [Vector3<f64>; 2] {
        let [width, height] = self.size_px.map(f64::from);
        let (x, y) = (at_px[0] / width * 2.0 - 1.0, 1.0 - at_px[1] / height * 2.0);
        match self.lens {
            Lens::Perspective([across, half]) => {
                [self.eye_m, (self.right * (x * across) + self.up * (y * half) - self.back).normalize()]
            }
            Lens::Parallel([across, half]) => {
                [self.eye_m + self.right * (x * across) + self.up * (y * half), -self.back]
            }
        }
    }
}

/// Returns right, up and back of a camera in this direction from its target.
fn axes(azimuth_deg: f64, elevation_deg: f64) -> [Vector3<f64>; 3] {
    let ((sin_a, cos_a), (sin_e, cos_e)) = (azimuth_deg.to_radians().sin_cos(), elevation_deg.to_radians().sin_cos());
    let back = Vector3::new(cos_e * cos_a, cos_e * sin_a, sin_e);
    let right = Vector3::new(-sin_a, cos_a, 0.0);
    [right, back.cross(&right), back]
}

fn aspect([width, height]: [u32; 2]) -> f64 {
    f64::from(width) / f64::from(height.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Framing solves linear equations, exact to some units of rounding of a picture's width.
    const ROUNDING_PX: f64 = 1e-6;

    fn edges(camera: &Camera, balls: &[(Vector3<f64>, f64)]) -> [f64; 4] {
        let mut sides = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        for &(centre, radius) in balls {
            // The outline of a ball, from many tangent rays.
            for k in 0..720_u32 {
                let (sin, cos) = f64::from(k).to_radians().sin_cos();
                let across = camera.right * cos + camera.up * sin;
                let point = match camera.lens {
                    Lens::Parallel(_) => centre + across * radius,
                    Lens::Perspective(_) => {
                        let to_eye = camera.eye_m - centre;
                        let distance = to_eye.norm();
                        let axis = to_eye / distance;
                        let across = (across - axis * axis.dot(&across)).normalize();
                        let cosine = radius / distance;
                        centre + (axis * cosine + across * (1.0 - cosine * cosine).sqrt()) * radius
                    }
                };
                let centre_px = camera.project(point).expect("ahead").at_px;
                sides = [
                    sides[0].min(centre_px[0]),
                    sides[1].max(centre_px[0]),
                    sides[2].min(centre_px[1]),
                    sides[3].max(centre_px[1]),
                ];
            }
        }
        sides
    }

    #[test]
    fn framing_shows_every_ball_and_is_tight() {
        let balls = [([0.0, 0.0, 0.0], 1.0), ([12.0, 3.0, 0.0], 0.5), ([5.0, -4.0, 2.0], 1.5)]
            .map(|(centre, radius)| (Vector3::from(centre), radius));
        let oblique = [Direction::perspective(-62.0, 32.0), Direction::perspective(20.0, 70.0)];
        for spec in [Direction::TOP, Direction::FRONT, Direction::SIDE].into_iter().chain(oblique) {
            for size_px in [[1280, 720], [300, 900], [64, 64]] {
                let area = Area { size_px, texts_px: [60.0, 40.0] };
                let (camera, margins) = (Camera::framing(spec, &balls, area), area.margins());
                let [left, right, top, bottom] = edges(&camera, &balls);
                let [width, height] = size_px.map(f64::from);
                let free = [left, width - right, height - bottom, top];
                let wanted = [0, 1, 2, 3].map(|side| margins[side] * if side < 2 { width } else { height } / 2.0);
                let spare = [0, 1, 2, 3].map(|side| free[side] - wanted[side]);
                // The outline is sampled every half degree: 1e-4 of a ball's size.
                let tolerance = ROUNDING_PX + 2e-4 * width.max(height);
                assert!(spare.iter().all(|&spare| spare >= -tolerance), "{spec:?} {size_px:?}: {spare:?}");
                let tight = [spare[0] + spare[1], spare[2] + spare[3]];
                assert!(tight[0].min(tight[1]) <= 2.0 * tolerance, "{spec:?} {size_px:?}: {spare:?}");
            }
        }
    }

    #[test]
    fn a_ray_through_a_projected_point_meets_the_point() {
        let balls = [(Vector3::new(1.0, 2.0, 3.0), 2.0), (Vector3::new(-4.0, 0.0, 1.0), 1.0)];
        for spec in [Direction::perspective(-62.0, 32.0), Direction::TOP] {
            let camera = Camera::framing(spec, &balls, Area { size_px: [640, 480], texts_px: [0.0; 2] });
            let [origin, direction] = camera.ray(camera.project(balls[0].0).expect("ahead").at_px);
            let miss = (balls[0].0 - origin).cross(&direction).norm();
            assert!(miss < 1e-9, "{spec:?}: {miss} m");
        }
    }

    #[test]
    fn a_camera_turns_about_its_focus_and_zooms() {
        let balls = [(Vector3::new(1.0, 2.0, 3.0), 2.0), (Vector3::new(-4.0, 0.0, 1.0), 1.0)];
        for spec in [Direction::perspective(-62.0, 32.0), Direction::TOP] {
            let camera = Camera::framing(spec, &balls, Area { size_px: [640, 480], texts_px: [0.0; 2] });
            let same = camera.adjusted(&Adjustment::NONE);
            assert!((same.eye_m - camera.eye_m).norm() < 1e-9 && (same.up - camera.up).norm() < 1e-9, "{spec:?}");
            let change = Adjustment { turn_deg: [30.0, -20.0], zoom: 0.5, ..Adjustment::NONE };
            let (focus, turned) = (camera.eye_m - camera.back * camera.focus_m, camera.adjusted(&change));
            let [before, after] = [camera, turned].map(|camera| camera.project(focus).expect("ahead"));
            let apart = (before.at_px[0] - after.at_px[0]).hypot(before.at_px[1] - after.at_px[1]);
            assert!(apart < 1e-6 && (after.px_per_m / before.px_per_m - 2.0).abs() < 1e-9, "{spec:?}: {apart}");
        }
    }

    #[test]
    fn framing_without_finite_balls_works() {
        for balls in [vec![], vec![(Vector3::zeros(), 0.0)], vec![(Vector3::repeat(f64::NAN), 1.0)]] {
            let camera = Camera::framing(Direction::TOP, &balls, Area { size_px: [10, 10], texts_px: [0.0; 2] });
            assert!(camera.project(Vector3::zeros()).is_some(), "{balls:?}");
        }
    }

    #[test]
    fn an_invalid_camera_is_refused() {
        for text in ["", "isometric", "follow:", "1,2", "1,2,3,4", "a,b,c"] {
            let refused = CameraSpec::from_str(text);
            let message = refused.expect_err(text).to_string();
            assert_eq!(message, format!("`{text}` is not a camera"));
        }
        for text in ["nan,0,1", "0,91,1", "0,0,0", "0,0,-1", "0,0,nan", "0,0,1e10"] {
            let message = CameraSpec::from_str(text).expect_err(text).to_string();
            assert!(message.starts_with(&format!("the camera `{text}` has a")), "{message}");
        }
        assert_eq!(CameraSpec::from_str("follow:cf 7").ok(), Some(CameraSpec::Follow(Some("cf 7".to_owned()))));
    }
}
