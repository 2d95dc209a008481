//! What each vehicle may do by itself: limits as words of the command line, and the file of a fence.

use std::path::Path;

use serde::Deserialize;

use super::Failure;
use super::text_file;
use tautline_audit::envelope::{Envelope, Fence, Limit, Quantity};

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

/// A limit as it is written: `speed=5`.
pub(super) fn limit(text: &str) -> Result<Limit, String> {
    let names = || Quantity::NUMBERS.map(Quantity::name).join(", ");
    let (name, value) = text.split_once('=').ok_or_else(|| format!("write LIMIT=VALUE, of {}", names()))?;
    let quantity = Quantity::NUMBERS.into_iter().find(|quantity| quantity.name() == name.trim());
    let quantity = quantity.ok_or_else(|| format!("`{name}` is no limit: the limits are {}", names()))?;
    match value.trim().parse::<f64>() {
        Ok(allowed) if allowed.is_finite() => Ok(Limit { quantity, allowed }),
        _ => Err(format!("`{value}` is not a number")),
    }
}

/// Limits and the fence of a file.
pub(super) fn envelope(limits: &[Limit], fence: Option<&Path>) -> Result<Envelope, Failure> {
    for (k, limit) in limits.iter().enumerate() {
        if limits[..k].iter().any(|before| before.quantity == limit.quantity) {
            let message = format!("--limit {} is given twice", limit.quantity.name());
            return Err(Failure::input(message, "give each limit once"));
        }
    }
    Ok(Envelope { limits: limits.to_vec(), fence: fence.map(read).transpose()? })
}

fn read(path: &Path) -> Result<Fence, Failure> {
    parse(&text_file::read(path, MOST_BYTES, FENCE_HELP)?, path)
}

fn parse(text: &str, path: &Path) -> Result<Fence, Failure> {
    let wrong = |message: &str, start: Option<usize>| {
        let line = start.map_or(1, |start| 1 + text[..start.min(text.len())].matches('\n').count());
        Failure::input(format!("{}, line {line}: {message}", path.display()), FENCE_HELP)
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
    fn limits_are_read_by_their_names() {
        let read = limit(" climb = 2.5").expect("a limit");
        assert_eq!((read.quantity, read.allowed), (Quantity::Climb, 2.5));
        assert_eq!(
            limit("speed").unwrap_err(),
            "write LIMIT=VALUE, of speed, horizontal, climb, descent, accel, height, floor"
        );
        assert!(limit("spee=3").unwrap_err().starts_with("`spee` is no limit"));
        assert_eq!(limit("speed=NaN").unwrap_err(), "`NaN` is not a number");
    }

    #[test]
    fn a_fence_is_read_and_what_is_wrong_is_said_with_its_line() {
        let read = |text: &str| parse(text, Path::new("fence.toml")).map_err(|failure| failure.said.message);
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
