//! The file of a fence.

use std::path::Path;

use serde::Deserialize;

use super::super::{Failure, text_file};
use tautline_audit::envelope::Fence;

/// Largest file that is read \[bytes\].
const MOST_BYTES: u64 = 16 << 20;
const FENCE_HELP: &str =
    "write [fence] with polygon_m = [[x, y], ...] in metres, and where needed height_m = [from, to] and margin_m";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    /// In the same place, read by themselves.
    #[serde(default)]
    #[expect(dead_code, reason = "they may stand there")]
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
pub(super) fn read(path: &Path) -> Result<Fence, Failure> {
    parse(&text_file::read(path, MOST_BYTES, FENCE_HELP)?, path)
}

fn parse(text: &str, path: &Path) -> Result<Fence, Failure> {
    let wrong = |message: &str, start: Option<usize>| {
        let line = start.map_or(1, |start| 1 + text[..start.min(text.len())].matches('\n').count());
        Failure::input("audit/fence-file", format!("{}, line {line}: {message}", path.display()), FENCE_HELP)
    };
    let document: Document =
        toml::from_str(text).map_err(|error| wrong(error.message(), error.span().map(|span| span.start)))?;
    let start = document.fence.span().start;
    let FenceTable { polygon_m, height_m, margin_m } = document.fence.into_inner();
    Fence::new(&polygon_m, height_m, margin_m).map_err(|error| wrong(&error.to_string(), Some(start)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fence_is_read_and_what_is_wrong_is_said_with_its_line() {
        let read = |text: &str| parse(text, Path::new("fence.toml")).map_err(|failure| failure.message().to_owned());
        let fence = read("[fence]\npolygon_m = [[0, 0], [9, 0], [9, 9]]\nheight_m = [0, 50]\nmargin_m = 1.5").unwrap();
        assert_eq!((fence.corners_m().len(), fence.margin_m()), (3, 1.5));
        for (text, expected) in [
            ("", "line 1: missing field `fence`"),
            ("\n[fence]\npolygon = []", "line 3: unknown field `polygon`"),
            ("\n[fence]\npolygon_m = [[0, 0], [1, 1]]", "line 2: a fence has 3 to 4096 corners, not 2"),
            (
                "[fence]\npolygon_m = [[0, 0], [1, 1], [1, 0], [0, 1]]",
                "line 1: the edges of the fence from corner 1 and from corner 3 meet",
            ),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
