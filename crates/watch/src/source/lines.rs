//! JSON lines: `{"t": 1.5, "id": "a", "x": 0, "y": 0, "z": 2}`, with `vx`, `vy` and `vz` if known.
//!
//! `{"t": 9.5, "id": "a", "event": "off"}` is the sign-off of a vehicle.
//!
//! Empty lines and lines that begin with `#` are skipped.

use std::io::{BufRead, Read as _};

use nalgebra::Vector3;
use serde::Deserialize;

use super::{Feed, Input, OwnedPose};
use crate::event::{MessageError, Problem};

/// Largest number of bytes of a line. A longer line is an error of the input.
pub const LONGEST_LINE: usize = 1 << 16;

#[derive(Deserialize)]
struct Line {
    t: f64,
    id: Name,
    event: Option<String>,
    x: Option<f64>,
    y: Option<f64>,
    z: Option<f64>,
    vx: Option<f64>,
    vy: Option<f64>,
    vz: Option<f64>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Name {
    Text(String),
    Number(i64),
}

/// Reads lines until the end of `from`.
pub fn lines(mut from: impl BufRead, feed: &Feed) {
    let mut line = Vec::new();
    let mut number = 0_u64;
    loop {
        line.clear();
        let mut is_error = false;
        let read = (&mut from).take(LONGEST_LINE as u64).read_until(b'\n', &mut line);
        number += 1;
        let arrival_s = feed.now_s();
        let garbage = |problem| Input::Garbage(MessageError { place: format!("line {number}"), problem }, arrival_s);
        let input = match read {
            Ok(0) => break,
            Ok(_) if line.len() == LONGEST_LINE && line.last() != Some(&b'\n') => {
                if skip_line(&mut from).is_err() {
                    break;
                }
                garbage(Problem::TooLong)
            }
            Ok(_) if matches!(line.trim_ascii().first(), None | Some(b'#')) => continue,
            Ok(_) => input_of_line(&line, arrival_s).unwrap_or_else(garbage),
            Err(error) => {
                is_error = true;
                garbage(Problem::NotDecoded(error.to_string()))
            }
        };
        if !feed.send(input) || is_error || feed.is_over() {
            break;
        }
    }
    let _ = feed.send(Input::End);
}

/// Returns the pose or the sign-off of a line that arrived at a time \[s\].
///
/// # Errors
/// If the line is neither.
pub fn input_of_line(line: &[u8], arrival_s: f64) -> Result<Input, Problem> {
    let refused =
        |why: String| Problem::NotPose(why, String::from_utf8_lossy(line.trim_ascii()).chars().take(60).collect());
    let of: Line = serde_json::from_slice(line).map_err(|error| refused(error.to_string()))?;
    let velocity_m_s = match (of.vx, of.vy, of.vz) {
        (Some(x), Some(y), Some(z)) => Some(Vector3::new(x, y, z)),
        (None, None, None) => None,
        _ => return Err(Problem::VelocityIncomplete),
    };
    let id = match of.id {
        Name::Text(text) => text,
        Name::Number(number) => number.to_string(),
    };
    if id.is_empty() {
        return Err(Problem::NoName);
    }
    match (of.event.as_deref(), [of.x, of.y, of.z]) {
        (Some("off"), [None, None, None]) => Ok(Input::SignOff(id, of.t, arrival_s)),
        (Some("off"), _) => Err(Problem::SignOffWithPosition),
        (_, [Some(x), Some(y), Some(z)]) => {
            let position_m = Vector3::new(x, y, z);
            Ok(Input::Pose(OwnedPose { t_s: of.t, id, position_m, velocity_m_s, accuracy_m: None }, arrival_s))
        }
        (Some(event), [None, None, None]) => Err(Problem::UnknownEvent(event.to_owned())),
        (_, place) => {
            let missing = ["x", "y", "z"].into_iter().zip(place).find(|(_, of)| of.is_none());
            Err(refused(format!("missing field `{}`", missing.map_or("x", |(name, _)| name))))
        }
    }
}

/// Skips the rest of a line.
fn skip_line(from: &mut impl BufRead) -> std::io::Result<()> {
    loop {
        let bytes = from.fill_buf()?;
        let (skipped, is_over) = match bytes.iter().position(|&byte| byte == b'\n') {
            Some(end) => (end + 1, true),
            None => (bytes.len(), bytes.is_empty()),
        };
        from.consume(skipped);
        if is_over {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;

    use nalgebra::Vector3;

    use super::{LONGEST_LINE, input_of_line, lines};
    use crate::event::{MessageError, Problem};
    use crate::source::{Input, channel};

    #[test]
    fn a_line_is_a_pose_with_or_without_velocity() {
        let pose_of = |line: &[u8]| match input_of_line(line, 0.0) {
            Ok(Input::Pose(pose, _)) => pose,
            other => panic!("{other:?}"),
        };
        let pose = pose_of(br#"{"t":1.5,"id":7,"x":1,"y":2,"z":3e0,"more":[],"event":"landing"}"#);
        assert_eq!((pose.id.as_str(), pose.position_m), ("7", Vector3::new(1.0, 2.0, 3.0)));
        assert_eq!(pose.velocity_m_s, None);
        let moving = br#"{"t":0,"id":"a","x":1,"y":2,"z":3,"vx":4,"vy":5,"vz":6}"#;
        assert_eq!(pose_of(moving).velocity_m_s, Some(Vector3::new(4.0, 5.0, 6.0)));
        for wrong in [
            r#"{"t":0,"id":"a","x":1,"y":2}"#,
            r#"{"t":0,"id":"a","x":1,"y":2,"z":3,"vx":4}"#,
            r#"{"t":"0","id":"a","x":1,"y":2,"z":3}"#,
            r#"{"t":0,"id":"a","x":NaN,"y":2,"z":3}"#,
            r#"{"t":0,"id":"","x":1,"y":2,"z":3}"#,
            "t,id,x,y,z",
            r#"{"t":0,"id":"a"}"#,
            r#"{"t":0,"id":"a","event":"gone"}"#,
            r#"{"t":0,"id":"a","event":1}"#,
            r#"{"t":0,"id":"","event":"off"}"#,
            r#"{"t":0,"event":"off"}"#,
            r#"{"t":0,"id":"a","event":"off","x":1,"y":2,"z":3}"#,
            r#"{"t":0,"id":"a","event":"off","z":3}"#,
            "\u{0}",
        ] {
            assert!(input_of_line(wrong.as_bytes(), 0.0).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_line_with_the_event_off_is_a_sign_off() {
        let found = input_of_line(br#"{"t":9.5,"id":"a","event":"off"}"#, 7.0);
        assert_eq!(found, Ok(Input::SignOff("a".to_owned(), 9.5, 7.0)));
    }

    #[test]
    fn a_line_without_end_is_skipped() {
        let good = b"{\"t\":0,\"id\":\"a\",\"x\":1,\"y\":2,\"z\":3}\n";
        let text = [&good[..], &vec![b'x'; 3 * LONGEST_LINE], b"\n\n", good, b"\xff\xfe"].concat();
        let (feed, inputs) = channel(Arc::new(AtomicBool::new(false)));
        lines(&text[..], &feed);
        drop(feed);
        let found: Vec<_> = inputs.receiver.iter().collect();
        let kinds: Vec<_> = found.iter().map(|input| matches!(input, Input::Pose(..))).collect();
        assert_eq!(kinds, [true, false, true, false, false]);
        let too_long = MessageError { place: "line 2".to_owned(), problem: Problem::TooLong };
        assert!(matches!(&found[1], Input::Garbage(error, _) if *error == too_long));
        assert_eq!(found[4], Input::End);
    }
}
