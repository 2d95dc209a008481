//! Replays within a page.

use std::sync::LazyLock;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use maud::{Markup, PreEscaped, html};
use sha2::{Digest as _, Sha256};

use crate::replay::{Chart, NoReplay, Replay};
use tautline_core::text::{counted, metres, up_to};

/// Style sheet of replays.
pub(super) const STYLE: &str = include_str!("replay.css");

/// Script and shaders of replays, without comments and indentation.
static SCRIPT: LazyLock<String> = LazyLock::new(|| without_comments(embedded!("TAUTLINE_ASSETS", "replay.js")));
static SHADERS: LazyLock<String> = LazyLock::new(|| without_comments(embedded!("TAUTLINE_SHADERS", "replay.glsl")));

/// Returns a script without comments and indentation, with its source expression.
pub(super) fn packed(source: &str) -> (String, String) {
    let code = without_comments(source);
    let hash = BASE64.encode(Sha256::digest(&code));
    (code, format!("'sha256-{hash}'"))
}

/// Returns the source expression of the content security policy that admits the script alone.
pub(super) fn script_source() -> String {
    format!("script-src 'sha256-{}'", BASE64.encode(Sha256::digest(&*SCRIPT)))
}

/// Returns the script and its shaders, which are embedded as data, for the end of a page.
pub(super) fn script() -> Markup {
    html! {
        script type="x-shader" { (PreEscaped(&*SHADERS)) }
        script { (PreEscaped(&*SCRIPT)) }
    }
}

/// Removes comments and indentation: lines that begin with `//`, and everything from `/**` to `*/`.
fn without_comments(source: &str) -> String {
    let mut code = String::new();
    for (k, part) in source.split("/**").enumerate() {
        let rest =
            if k == 0 { Some(part) } else { part.split_once("*/").map(|(_, rest)| rest.trim_start_matches(' ')) };
        code += rest.unwrap_or_default();
    }
    let lines = code.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("//"));
    lines.flat_map(|line| [line, "\n"]).collect()
}

/// Time at which a replay starts to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// With the page.
    AtOnce,
    /// With the page, and at the first violation.
    AtViolation,
    /// On a click. Another replay of the page then stops drawing.
    OnDemand,
}

/// Start of the element of a replay. Escaped text cannot contain it.
pub(super) const ELEMENT: &str = "<div class=\"replay\"";

/// Returns a replay with a label for screen readers, or the reason why there is no replay.
#[must_use]
pub fn replay(label: &str, replay: &Result<Replay, NoReplay>, start: Start) -> Markup {
    let replay = match replay {
        Ok(replay) => replay,
        Err(why) => return html! { p { "No replay: " (why) "." } },
    };
    let on_demand = (start == Start::OnDemand).then_some("later");
    let at_violation = (start == Start::AtViolation).then_some("violation");
    html! {
        div.replay data-label=(label) data-start=[on_demand] data-opens=[at_violation] {
            script type="application/json" { (PreEscaped(&replay.json)) }
            noscript { p { "The replay needs JavaScript, which is disabled. A still picture replaces it." } }
            div.replay-still { (PreEscaped(&replay.still.svg)) }
            (chart(&replay.chart))
            p.replay-note { (note(replay)) }
        }
    }
}

/// Returns the smallest separation over time as a chart, which the script places along its slider.
fn chart(chart: &Chart) -> Markup {
    let band = |&(from, to, violation): &(f64, f64, bool)| {
        html! {
            rect.replay-violation[violation].replay-undecided[!violation] x={ (format!("{:.1}", from - 1.5)) } y="0"
                width={ (format!("{:.1}", to - from + 3.0)) } height="100" {}
        }
    };
    html! {
        div.replay-graph role="img" aria-label="Smallest distance of any two over time, with its limit" {
            svg viewBox="0 0 1000 100" preserveAspectRatio="none" {
                @for (x, _) in &chart.ticks {
                    line.replay-tick x1=(format!("{x:.1}")) x2=(format!("{x:.1}")) y1="0" y2="100" {}
                }
                @for found in &chart.bands { (band(found)) }
                @if let Some(height) = chart.limit {
                    line.replay-limit x1="0" x2="1000" y1=(format!("{height:.1}")) y2=(format!("{height:.1}")) {}
                }
                @if !chart.distance.is_empty() { path d=(chart.distance) {} }
                @if let Some([x, y]) = chart.closest {
                    path.replay-closest d=(format!("M{x:.1} {y:.1}h0.01")) {}
                }
            }
            @for (height, words) in &chart.levels {
                span.replay-level style=(format!("top:{:.2}rem", 0.03 * height)) { (words) }
            }
            @for (k, (x, label)) in chart.ticks.iter().enumerate() {
                @let left = format!("left:{:.1}%", 0.1 * x);
                span.replay-second.replay-first[*x < 20.0].replay-last[*x > 960.0] style=(left) {
                    (label) @if k + 1 == chart.ticks.len() { " s" }
                }
            }
        }
    }
}

/// Returns the limits of accuracy of a replay.
fn note(replay: &Replay) -> String {
    let [kept, samples] = replay.instants;
    let of_all = if kept < samples { format!(" of {samples}") } else { String::new() };
    let motion = match (replay.holds, samples) {
        (_, 0 | 1) => "of one sample".to_owned(),
        (true, _) => format!("held between {kept} samples{of_all}"),
        (false, _) => format!("interpolated linearly between {kept} samples{of_all}"),
    };
    let some = |[shown, all]: [usize; 2], what: &str| {
        if shown < all { format!("{shown} of {all} {what} are included. ") } else { String::new() }
    };
    let said = [
        format!(
            "Positions are rounded by at most {} m and {motion}. Distances, times and verdicts are those of the \
             audit. ",
            up_to(replay.rounding_m)
        ),
        some(replay.vehicles, "vehicles"),
        some(replay.moments, "findings"),
        match replay.inexact {
            0 => String::new(),
            count => format!(
                "The sample of {}, or a vehicle of it, is not drawn. ",
                counted(count as u64, "finding", "findings")
            ),
        },
        replay.unknown_radius.map_or(String::new(), |(count, radius_m)| {
            format!(
                "The size of {} is assumed to be {} m. ",
                counted(count as u64, "vehicle", "vehicles"),
                metres(radius_m)
            )
        }),
        if replay.obstacles_off_m > 0.0 {
            format!("Moving obstacles are drawn at most {} m off their paths. ", up_to(replay.obstacles_off_m))
        } else {
            String::new()
        },
    ];
    said.concat() + "The page loads nothing else."
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn removes_comments_and_indentation_only() {
        let source = "// @ts-check\n  /** @type {A} */\n  const a = (/** @type {B} */ (b)) => \"a // b\";\n\n\
                      /** two\n lines */ c();\n";
        assert_eq!(without_comments(source), "const a = ((b)) => \"a // b\";\nc();\n");
    }

    #[test]
    fn script_and_shaders_stay_small() {
        assert!(SCRIPT.len() + SHADERS.len() < 51_650, "{} and {}", SCRIPT.len(), SHADERS.len());
        assert!(SCRIPT.len() > 10_000 && SHADERS.starts_with("@ COMMON"));
        assert!(!SCRIPT.contains("</script") && !SHADERS.contains("</script"));
    }
}
