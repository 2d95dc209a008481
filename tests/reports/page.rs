//! `report.html`: escaped, self-contained, and equal for every run of a scenario except for the performance.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use tautline::figures;
use tautline::flight_log::FlightLog;
use tautline::report::page::{self, Badge, Page, Picture, Render as _, Tone};

use crate::report::{closest, number};

const HOSTILE: &str = "</title></pre><script>alert(\"x\")</script>&amp;<img src=x onerror='y'>";

fn hostile_page() -> Page {
    let text = || HOSTILE.to_owned();
    let figure = figures::paths(&FlightLog::default(), &[], HOSTILE);
    let picture = Picture { description: text(), data_uri: text(), file: text(), is_light: true };
    let badge = Badge { tone: Tone::Bad, word: HOSTILE.to_owned() };
    let content = [
        page::list(&[HOSTILE]),
        page::words(HOSTILE, &[HOSTILE; 2], [[HOSTILE; 2]]),
        page::numbers(HOSTILE, &[HOSTILE; 2], [[page::noted(HOSTILE, HOSTILE), badge.render()]]),
        page::figures(&[figure]),
        page::pictures(&[picture]),
        page::command(HOSTILE),
    ];
    Page {
        setup: text(),
        title: text(),
        kind: HOSTILE,
        replay: None,
        badge: Badge { tone: Tone::Bad, word: "violation".to_owned() },
        verdict: text(),
        reasons: vec![text()],
        warnings: vec![(text(), text())],
        sections: vec![page::section(HOSTILE, HOSTILE, &content)],
    }
}

/// Removes parts of a page that look like references but are not.
fn without_namespaces(html: &str) -> String {
    html.replace("http://www.w3.org/2000/svg", "").replace("http-equiv", "").replace("href=\"data:,\"", "")
}

/// Removes the script elements of a page; returns their attributes.
fn without_scripts(html: &str) -> (String, Vec<String>) {
    let mut parts = html.split("<script");
    let mut plain = parts.next().unwrap_or_default().to_owned();
    let mut attributes = Vec::new();
    for part in parts {
        attributes.push(part.split('>').next().unwrap_or_default().to_owned());
        plain += part.split_once("</script>").expect("it ends").1;
    }
    (plain, attributes)
}

#[test]
fn every_text_of_a_page_is_escaped() {
    let html = hostile_page().render();
    for raw in ["<script", "<img src=x", "</title></pre>"] {
        assert!(!html.contains(raw), "{raw} in {html}");
    }
    let escaped = html.matches("&lt;script&gt;").count();
    assert!(escaped >= 20, "{escaped} texts were found");
    assert!(html.contains("&amp;amp;"), "an entity in a text is escaped");
}

#[test]
fn a_table_has_headers_and_a_badge_has_words() {
    let html = hostile_page().render();
    assert!(html.contains("<th scope=\"col\"") && html.contains("<th scope=\"row\"") && html.contains("<caption>"));
    assert!(html.contains(">violation</strong>"));
    assert!(html.contains("<html lang=\"en\">") && html.contains("name=\"viewport\""));
}

fn fly(folder: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_tautline"))
        .args(["run", "--quiet", "--force", "--out"])
        .arg(folder)
        .args(arguments)
        .output()
        .expect("the program runs");
    assert!(output.status.code() <= Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    fs::read_to_string(folder.join("report.html")).expect("a page")
}

#[test]
fn two_runs_give_the_same_page_except_for_the_performance() {
    let folder = tempfile::tempdir().expect("a folder");
    let flown = ["circle", "--set", "time.duration_s=20"];
    let runs = ["a", "b"].map(|name| {
        fly(&folder.path().join(name), &[&flown[..], &["--threads", if name == "a" { "1" } else { "2" }]].concat())
    });
    let [a, b] = runs.each_ref().map(|html| html.split_once("<h2>Performance</h2>").expect("a performance part"));
    assert_eq!(a.0, b.0);
    assert_ne!(a.1, b.1, "wall-clock time is in the performance part");
    for name in ["paths", "distances", "control", "energy", "shape-error", "disagreement"] {
        let file = Path::new("figures").join(format!("{name}.svg"));
        let [a, b] = ["a", "b"].map(|run| fs::read(folder.path().join(run).join(&file)).expect("a figure"));
        assert_eq!(a, b, "{name}");
        assert!(runs[0].contains(std::str::from_utf8(&a).expect("text")), "{name} is part of the page");
    }
}

#[test]
fn a_page_has_verdict_assumptions_and_command_and_is_self_contained() {
    let folder = tempfile::tempdir().expect("a folder");
    let html = fly(folder.path(), &["pentagon", "--set", "time.duration_s=2"]);
    for part in [
        "(clear: never closer than",
        "certified 2.055307 m",
        "The certified separation holds for the complete graph",
        "Everything is computed in double precision",
        "tautline run pentagon --set &#39;time.duration_s=2&#39;",
        "kind = &quot;rapier&quot;",
    ] {
        let part_quoted = part.replace("&#39;", "'");
        assert!(html.contains(part) || html.contains(&part_quoted), "{part}");
    }
    assert_eq!(html.matches("src=\"data:image/png;base64,").count(), 3, "start, closest approach and end");
    assert_eq!(html.matches("<a href=\"snapshots/").count(), 3, "each is a link to its file");
    let links = ["src=\"data:image/png;base64,", "<a href=\"snapshots/"];
    let html = links.iter().fold(without_namespaces(&html), |html, link| html.replace(link, ""));
    let (plain, scripts) = without_scripts(&html);
    assert_eq!(
        scripts,
        [" type=\"application/json\"", " type=\"x-shader\"", ""],
        "data, shaders and the one that runs"
    );
    for reference in ["http", "href", "src=", "url(", "@import", "<script"] {
        assert!(!plain.contains(reference), "{reference}");
    }
}

#[test]
fn unwanted_figures_are_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let flown = ["pentagon", "--set", "time.duration_s=1"];
    fly(folder.path(), &flown);
    let figure = folder.path().join("figures/energy.svg");
    assert!(figure.exists());
    let html = fly(folder.path(), &[&flown[..], &["--no-figures"]].concat());
    assert!(!figure.exists() && !html.contains("E(0) = "), "only the still picture of the replay is left");
}

#[test]
fn the_page_of_an_audit_shows_the_smallest_distance_and_an_inset() {
    let folder = tempfile::tempdir().expect("a folder");
    // Alpha and bravo pass each other on paths of 100 m; charlie and delta are closest before and after.
    let page = |miss_m: f64| {
        let mut table = "t,id,x,y,z\n".to_owned();
        for t in 0..=100 {
            let x = f64::from(t);
            let _ = writeln!(table, "{t},alpha,{x},0,0\n{t},bravo,{},{miss_m},0", 100.0 - x);
            let _ = writeln!(table, "{t},charlie,{x},50,0\n{t},delta,{x},58,0");
        }
        fs::write(folder.path().join("pass.csv"), table).expect("written");
        let audit = ["audit", "pass.csv", "--delta", "1", "--html", "a.html"];
        let done = Command::new(env!("CARGO_BIN_EXE_tautline")).args(audit).current_dir(folder.path()).output();
        assert_eq!(done.expect("the program runs").status.code(), Some(0));
        fs::read_to_string(folder.path().join("a.html")).expect("a page")
    };
    let near = page(1.5);
    let figure =
        near.split("<svg xmlns").find(|figure| figure.contains("Smallest separation of all pairs")).expect("a figure");
    assert!(figure.contains("closest 1.500000 m at 50.000 s, limit 1.0 m"), "{figure}");
    // The smallest separation of all pairs: 8 m except around the pass.
    let corners_of = |colour: &str| -> Vec<(f64, f64)> {
        let lines = figure.split("<polyline ").filter_map(|line| line.split('>').next());
        let numbers = |(x, y): (&str, &str)| Some((x.parse().ok()?, y.parse().ok()?));
        let corners = |line: &str| -> Vec<(f64, f64)> {
            let corners = line.split('"').find(|text| text.contains(',')).expect("corners").split(' ');
            corners.filter_map(|corner| corner.split_once(',').and_then(numbers)).collect()
        };
        // A line of the legend is short.
        let width = |corners: &Vec<(f64, f64)>| corners[corners.len() - 1].0 - corners[0].0;
        let all = lines.filter(|line| line.contains(colour)).map(corners);
        all.max_by(|one, other| width(one).total_cmp(&width(other))).expect("a line")
    };
    let corners = corners_of("#332288");
    let lowest = corners.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).expect("corners");
    let [first, last] = [corners[0], corners[corners.len() - 1]];
    // Steps from the first instant to the last: each line is level or upright.
    let limit = corners_of("#1B1F24");
    assert!((first.0 - limit[0].0).abs() < 1.0 && (last.0 - limit[1].0).abs() < 1.0, "{corners:?} {limit:?}");
    let is_step = |two: &[(f64, f64)]| two[0].0 == two[1].0 || two[0].1 == two[1].1;
    assert!(corners.windows(2).all(is_step), "{corners:?}");
    assert!((lowest.0 - f64::midpoint(first.0, last.0)).abs() < 10.0 && first.1 == last.1, "{corners:?}");
    let insets = |page: &str| page.matches("<svg x=").count();
    assert_eq!((insets(&near), insets(&page(30.0))), (1, 0), "a visible approach has no inset");
}

/// Returns the last number that follows some words.
fn number_after<'a>(text: &'a str, words: &str) -> Option<&'a str> {
    let number = |(at, words): (usize, &str)| {
        let rest = &text[at + words.len()..];
        let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        Some(rest[..end].trim_end_matches('.')).filter(|number| number.parse::<f64>().is_ok())
    };
    text.match_indices(words).filter_map(number).last()
}

#[test]
fn a_number_that_is_shown_twice_is_the_same_number() {
    let folder = tempfile::tempdir().expect("a folder");
    let html = fly(folder.path(), &["pentagon-laplacian", "--set", "time.duration_s=10"]);
    let report = fs::read_to_string(folder.path().join("report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let [min_m, min_at_s] = ["/value/lower", "/at_s"].map(|path| number(closest(&report), path));
    assert!(!html.contains("Vehicles 4 and 5 came to "), "the reason would repeat the headline");
    // Places of the smallest separation: headline, table of findings, replay, still picture, figure, pictures.
    let least = [
        (&html[..], "vehicles 4 and 5 came to "),
        (&html, "<td data-label=\"Finding\">"),
        (&html, "Closest approach: "),
        (&html, "4 and 5 come to "),
        (&html, "closest so far "),
        (&html, ">closest "),
        (&html, " Closest: "),
        (&html, "vehicles 4 and 5 at 3.63 s, "),
    ];
    let (mut found, mut decimals) = (0, std::collections::BTreeSet::new());
    for (place, words) in least {
        let row = place.split_once("separation</th>").and_then(|(_, rest)| rest.split("</tr>").next()).expect("a row");
        let place = if words.starts_with("<td") { row } else { place };
        let Some(number) = number_after(place, words) else { panic!("no number after {words:?}") };
        let digits = number.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        let unit = 0.1_f64.powi(i32::try_from(digits).expect("a few"));
        let shown: f64 = number.parse().expect("a number");
        let error = min_m - shown;
        assert!((-1e-12..unit).contains(&error), "{words:?}: {number}, not {min_m} rounded down");
        found += 1;
        decimals.insert(digits);
    }
    assert_eq!((found, decimals.into_iter().collect::<Vec<_>>()), (8, vec![3, 6]), "two precisions alone");
    // Places of its time: headline, replay and figure.
    for words in ["(delta 2.000 m) at ", "4 and 5 at ", "vehicles 4 and 5 at ", "Closest approach, at "] {
        let number = number_after(&html, words).unwrap_or_else(|| panic!("no time after {words:?}"));
        let shown: f64 = number.parse().expect("a number");
        assert!((min_at_s - shown).abs() <= 0.005 + 1e-9, "{words:?}: {number}, not {min_at_s}");
    }
}
