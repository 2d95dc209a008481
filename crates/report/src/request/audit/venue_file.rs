//! Obstacle files and fence files.

use std::path::Path;

use serde::Deserialize;

use super::super::Failure;
use super::toml_file::TomlFile;
use tautline_audit::MovingObstacle;
use tautline_audit::envelope::Fence;
use tautline_sim::scenario::{OBSTACLE_HELP, ObstacleTable};

/// Largest size of a file \[bytes\].
const MOST_BYTES: u64 = 64 << 20;
const OBSTACLES: TomlFile =
    TomlFile { code: "audit/obstacle-file", help: || OBSTACLE_HELP.to_owned(), most_bytes: MOST_BYTES };
const FENCE: TomlFile = TomlFile { code: "audit/fence-file", help: || FENCE_HELP.to_owned(), most_bytes: MOST_BYTES };
const FENCE_HELP: &str =
    "write [fence] with polygon_m = [[x, y], ...] in metres, and where needed height_m = [from, to] and margin_m";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ObstacleDocument {
    /// Tables of the same venue that are read elsewhere.
    #[serde(default)]
    #[expect(dead_code, reason = "the key is allowed")]
    fence: Option<toml::Table>,
    #[serde(default)]
    obstacle: Vec<toml::Spanned<ObstacleTable>>,
}

/// Reads the obstacles of a file.
pub(super) fn read_obstacles(path: &Path) -> Result<Vec<MovingObstacle>, Failure> {
    parse_obstacles(&OBSTACLES.read(path)?, path)
}

fn parse_obstacles(text: &str, path: &Path) -> Result<Vec<MovingObstacle>, Failure> {
    let document: ObstacleDocument = OBSTACLES.parse(text, path)?;
    if document.obstacle.is_empty() {
        return Err(OBSTACLES.wrong(text, path, 0, "the file has no [[obstacle]]"));
    }
    let judged = |entry: toml::Spanned<ObstacleTable>| {
        let start = entry.span().start;
        obstacle(entry.into_inner()).map_err(|message| OBSTACLES.wrong(text, path, start, &message))
    };
    document.obstacle.into_iter().map(judged).collect()
}

fn obstacle(table: ObstacleTable) -> Result<MovingObstacle, String> {
    let obstacle = table.into_moving()?;
    obstacle.check().map(|()| obstacle).map_err(|error| error.to_string())
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FenceDocument {
    /// Tables of the same venue that are read elsewhere.
    #[serde(default)]
    #[expect(dead_code, reason = "the keys are allowed")]
    obstacle: Vec<toml::Table>,
    fence: toml::Spanned<FenceTable>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(clippy::struct_field_names, reason = "each is in metres")]
struct FenceTable {
    polygon_m: Vec<[f64; 2]>,
    height_m: Option<[f64; 2]>,
    #[serde(default)]
    margin_m: f64,
}

/// Reads the fence of a file.
pub(super) fn read_fence(path: &Path) -> Result<Fence, Failure> {
    parse_fence(&FENCE.read(path)?, path)
}

fn parse_fence(text: &str, path: &Path) -> Result<Fence, Failure> {
    let document: FenceDocument = FENCE.parse(text, path)?;
    let start = document.fence.span().start;
    let FenceTable { polygon_m, height_m, margin_m } = document.fence.into_inner();
    Fence::new(&polygon_m, height_m, margin_m).map_err(|error| FENCE.wrong(text, path, start, &error.to_string()))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use tautline_core::obstacle::Shape;

    fn read(text: &str) -> Result<Vec<MovingObstacle>, String> {
        parse_obstacles(text, Path::new("obstacles.toml")).map_err(|failure| failure.message().to_owned())
    }

    #[test]
    fn reads_every_shape() {
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
    fn errors_name_their_line() {
        for (text, expected) in [
            ("[[obstacle]]\nname = \"a\"\nbal = { radius_m = 1.0 }", "line 3: unknown field `bal`"),
            ("[[obstacle]]\nname = \"a\"\nat_m = [0, 0, 0]", "line 1: obstacle `a` must have exactly one shape"),
            (
                "\n[[obstacle]]\nname = \"a\"\nball = { radius_m = 1.0 }",
                "line 2: obstacle `a` has neither at_m nor path",
            ),
            ("[[obstacle]]\nname = \"a\"\nball = { radius_m = -1.0 }\nat_m = [0, 0, 0]", "must be above 0 m, got -1"),
            ("[[obstacle]]\nname = \"a\"\nball = 3", "line 3: "),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}

#[cfg(test)]
mod fence_file_tests {
    use super::*;

    #[test]
    fn reads_a_fence_and_names_the_line_of_errors() {
        let read =
            |text: &str| parse_fence(text, Path::new("fence.toml")).map_err(|failure| failure.message().to_owned());
        let fence = read("[fence]\npolygon_m = [[0, 0], [9, 0], [9, 9]]\nheight_m = [0, 50]\nmargin_m = 1.5").unwrap();
        assert_eq!((fence.corners_m().len(), fence.margin_m()), (3, 1.5));
        for (text, expected) in [
            ("", "line 1: missing field `fence`"),
            ("\n[fence]\npolygon = []", "line 3: unknown field `polygon`"),
            ("\n[fence]\npolygon_m = [[0, 0], [1, 1]]", "line 2: a fence must have 3 to 4096 corners, got 2"),
            (
                "[fence]\npolygon_m = [[0, 0], [1, 1], [1, 0], [0, 1]]",
                "line 1: the edges of the fence from corner 1 and from corner 3 cross or touch",
            ),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
