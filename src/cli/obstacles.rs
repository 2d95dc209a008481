//! The file of obstacles.
//!
//! ```toml
//! [[obstacle]]
//! name = "tower"
//! box = { size_m = [2.0, 2.0, 30.0], yaw_deg = 15.0 }
//! at_m = [10.0, 4.0, 15.0]
//! clearance_m = 1.5            # without it: the vehicle's radius, or delta / 2
//!
//! [[obstacle]]
//! name = "truck"
//! ball = { radius_m = 3.0 }
//! path = [[0.0, -20.0, 0.0, 1.0], [8.0, 20.0, 0.0, 1.0]]   # t [s], x, y, z [m]
//!
//! [[obstacle]]
//! name = "cable"
//! capsule = { from_m = [0.0, 0.0, 8.0], to_m = [30.0, 0.0, 9.0], radius_m = 0.05 }
//!
//! [[obstacle]]
//! name = "ground"
//! half_space = { normal = [0.0, 0.0, 1.0] }
//! ```

use std::ops::Range;
use std::path::Path;

use nalgebra::Vector3;
use serde::Deserialize;

use super::Failure;
use crate::audit::{Obstacle, Shape};

/// Largest file that is read \[bytes\].
const MOST_BYTES: u64 = 64 << 20;
const HELP: &str = "an obstacle has a name, one of ball, box, capsule and half_space, and a place at_m = [x, y, z] or a \
                    path = [[t, x, y, z], ...]";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    #[serde(default)]
    obstacle: Vec<toml::Spanned<Entry>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    ball: Option<Ball>,
    #[serde(rename = "box")]
    cuboid: Option<Cuboid>,
    capsule: Option<Capsule>,
    half_space: Option<HalfSpace>,
    at_m: Option<[f64; 3]>,
    path: Option<Vec<[f64; 4]>>,
    clearance_m: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Ball {
    radius_m: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Cuboid {
    size_m: [f64; 3],
    #[serde(default)]
    yaw_deg: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(clippy::struct_field_names, reason = "each is in metres")]
struct Capsule {
    from_m: [f64; 3],
    to_m: [f64; 3],
    radius_m: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct HalfSpace {
    normal: [f64; 3],
}

/// Reads a file of obstacles.
pub(super) fn read(path: &Path) -> Result<Vec<Obstacle>, Failure> {
    let cannot = |error: std::io::Error| {
        Failure::input(format!("cannot read {}: {error}", path.display()), "give a TOML file of obstacles")
    };
    let size = std::fs::metadata(path).map_err(cannot)?.len();
    if size > MOST_BYTES {
        let message = format!("{} has {size} bytes, more than a file of obstacles may have", path.display());
        return Err(Failure::input(message, format!("give at most {MOST_BYTES} bytes")));
    }
    let text = std::fs::read_to_string(path).map_err(cannot)?;
    parse(&text, path)
}

fn parse(text: &str, path: &Path) -> Result<Vec<Obstacle>, Failure> {
    let wrong = |message: String, place: Option<Range<usize>>| {
        let line = place.map_or(1, |place| 1 + text[..place.start.min(text.len())].matches('\n').count());
        Failure::input(format!("{}, line {line}: {message}", path.display()), HELP)
    };
    let document: Document = toml::from_str(text).map_err(|error| wrong(error.message().to_owned(), error.span()))?;
    let obstacles: Result<Vec<_>, _> = document
        .obstacle
        .into_iter()
        .map(|entry| {
            let place = entry.span();
            obstacle(entry.into_inner()).map_err(|message| wrong(message, Some(place)))
        })
        .collect();
    obstacles
}

fn obstacle(entry: Entry) -> Result<Obstacle, String> {
    let Entry { name, .. } = entry;
    let in_space = matches!((&entry.capsule, &entry.half_space), (Some(_), _) | (_, Some(_)));
    let shapes = [
        entry.ball.map(|ball| Shape::Ball { radius_m: ball.radius_m }),
        entry.cuboid.map(|cuboid| Shape::Box {
            half_m: Vector3::from(cuboid.size_m) * 0.5,
            yaw_rad: cuboid.yaw_deg.to_radians(),
        }),
        entry.capsule.map(|capsule| Shape::Capsule {
            from_m: capsule.from_m.into(),
            to_m: capsule.to_m.into(),
            radius_m: capsule.radius_m,
        }),
        entry.half_space.map(|half_space| Shape::HalfSpace { normal: half_space.normal.into() }),
    ];
    let mut shapes = shapes.into_iter().flatten();
    let (Some(shape), None) = (shapes.next(), shapes.next()) else {
        return Err(format!("obstacle `{name}` needs one shape and no more"));
    };
    let path = match (entry.at_m, entry.path) {
        (Some(at_m), None) => vec![(0.0, at_m.into())],
        (None, Some(path)) => path.into_iter().map(|[t, x, y, z]| (t, Vector3::new(x, y, z))).collect(),
        (None, None) if in_space => vec![(0.0, Vector3::zeros())],
        (None, None) => return Err(format!("obstacle `{name}` has no place")),
        (Some(_), Some(_)) => return Err(format!("obstacle `{name}` has a place and a path")),
    };
    let obstacle = Obstacle { name, shape, clearance_m: entry.clearance_m, path };
    obstacle.check().map(|()| obstacle).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Obstacle>, String> {
        parse(text, Path::new("obstacles.toml")).map_err(|failure| failure.said.message)
    }

    #[test]
    fn every_shape_is_read() {
        let text = r#"
            [[obstacle]]
            name = "tower"
            box = { size_m = [2.0, 2.0, 30.0], yaw_deg = 90.0 }
            at_m = [10.0, 4.0, 15.0]
            clearance_m = 1.5
            [[obstacle]]
            name = "truck"
            ball = { radius_m = 3.0 }
            path = [[0.0, -20.0, 0.0, 1.0], [8.0, 20.0, 0.0, 1.0]]
            [[obstacle]]
            name = "cable"
            capsule = { from_m = [0.0, 0.0, 8.0], to_m = [30.0, 0.0, 9.0], radius_m = 0.05 }
            [[obstacle]]
            name = "ground"
            half_space = { normal = [0.0, 0.0, 1.0] }
        "#;
        let read = read(text).unwrap();
        assert_eq!(read.len(), 4);
        assert_eq!(read[0].clearance_m, Some(1.5));
        assert_eq!(read[1].path[1], (8.0, Vector3::new(20.0, 0.0, 1.0)));
        assert!(matches!(read[0].shape, Shape::Box { half_m, .. } if half_m.z == 15.0));
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (text, expected) in [
            ("[[obstacle]]\nname = \"a\"\nbal = { radius_m = 1.0 }", "line 3: unknown field `bal`"),
            ("[[obstacle]]\nname = \"a\"\nat_m = [0, 0, 0]", "line 1: obstacle `a` needs one shape"),
            ("\n[[obstacle]]\nname = \"a\"\nball = { radius_m = 1.0 }", "line 2: obstacle `a` has no place"),
            ("[[obstacle]]\nname = \"a\"\nball = { radius_m = -1.0 }\nat_m = [0, 0, 0]", "must be above 0 m, not -1"),
            ("[[obstacle]]\nname = \"a\"\nball = 3", "line 3: "),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
