//! docs/report.md lists exactly the keys of the JSON of `run` and `check`, with units; docs/study-json.md those of
//! studies.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::program::{TAUTLINE, ran_by};
use serde_json::Value;

const PAGE: &str = include_str!("../../docs/report.md");
const ELLIPSOID: &str = "safety={shape=\"ellipsoid\", half_axes_m=[0.5, 0.5, 1.0]}";
const STUDIES: &str = include_str!("../../docs/study-json.md");
/// Objects that stand in many places of the JSON of studies, by their keys: share, estimate, quantiles, pairs of runs.
const KINDS: [&[&str]; 4] = [
    &["count", "of", "share", "low", "high", "confidence"],
    &["value", "low", "high"],
    &["min", "p05", "median", "p95", "max"],
    &["only_first", "only_second", "of", "p_value", "first_of_discordant", "difference", "low", "high", "confidence"],
];

/// Returns the keys of a section of a page, each with its unit.
fn documented(page: &'static str, section: &str) -> BTreeMap<&'static str, &'static str> {
    let text = page.split("\n## ").find(|text| text.starts_with(section)).expect("a section");
    let row = |line: &'static str| {
        let mut cells = line.trim_matches('|').split(" | ").map(str::trim);
        Some((cells.next()?.strip_prefix('`')?.strip_suffix('`')?, cells.next()?))
    };
    text.lines().map(|line| line.replace("| |", "| - |")).map(|line| &*line.leak()).filter_map(row).collect()
}

/// Collects the paths of all keys of a JSON value.
fn keys(value: &Value, path: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(table) => {
            for (key, value) in table {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                keys(value, &path, found);
            }
        }
        Value::Array(list) if list.iter().any(Value::is_object) => {
            for value in list {
                keys(value, &format!("{path}[]"), found);
            }
        }
        // An empty list: another command prints its entries, or they are plain values.
        Value::Array(list) if list.is_empty() => {
            found.insert(format!("{path}[]"));
        }
        _ => {
            found.insert(path.to_owned());
        }
    }
}

/// Replaces each flight and each object of `KINDS` by a word.
fn by_kind(value: Value) -> Value {
    match value {
        Value::Object(table) => {
            let has = |keys: &[&str]| keys.len() == table.len() && keys.iter().all(|key| table.contains_key(*key));
            let flight = documented(STUDIES, "flight");
            let flight: Vec<_> = flight.keys().map(|key| key.trim_end_matches("[]")).collect();
            if has(&flight) || KINDS.iter().any(|keys| has(keys)) {
                return Value::from("a kind");
            }
            table.into_iter().map(|(key, value)| (key, by_kind(value))).collect()
        }
        // A list of flights is one word, so that it is not searched for keys.
        Value::Array(list) => {
            let list: Vec<_> = list.into_iter().map(by_kind).collect();
            if list.first().is_some_and(|first| first == "a kind") { Value::from("a kind") } else { list.into() }
        }
        plain => plain,
    }
}

/// Returns the keys that commands print.
fn printed(commands: &[&[&str]], simplify: impl Fn(Value) -> Value) -> BTreeSet<String> {
    let folder = tempfile::tempdir().expect("a folder");
    let mut found = BTreeSet::new();
    for command in commands {
        let ran = ran_by(TAUTLINE, Path::new(folder.path()), command);
        keys(&simplify(serde_json::from_str(&ran.out).expect("JSON")), "", &mut found);
    }
    let (empty, mut found): (BTreeSet<_>, BTreeSet<_>) = found.into_iter().partition(|key| key.ends_with("[]"));
    let is_plain = |list: &String| !found.iter().any(|key| key.starts_with(&format!("{list}.")));
    let plain: Vec<_> = empty.into_iter().filter(is_plain).collect();
    found.extend(plain.iter().map(|list| list.trim_end_matches("[]").to_owned()));
    found
}

/// Returns the documented keys without list marks.
fn plain(documented: &BTreeMap<&str, &str>) -> BTreeSet<String> {
    documented.keys().map(|key| key.trim_end_matches("[]").to_owned()).collect()
}

fn assert_documented(section: &str, commands: &[&[&str]]) {
    let documented = documented(PAGE, section);
    assert_eq!(plain(&documented), printed(commands, |json| json), "{section}");
    for (key, unit) in documented {
        let units = [("_deg", "deg"), ("_m_s2", "m/s^2"), ("_m_s", "m/s"), ("_per_s", "1/s"), ("_m", "m"), ("_s", "s")];
        match units.iter().find(|(suffix, _)| key.ends_with(suffix)) {
            Some((_, expected)) => assert_eq!(unit, *expected, "{key}"),
            None if key.ends_with("_bytes") => assert_eq!(unit, "B", "{key}"),
            None => assert!(["-", "m^2/s^2"].contains(&unit), "{key}: {unit}"),
        }
    }
}

#[test]
fn every_key_of_the_report_is_on_its_page() {
    let quick = ["--verify", "--no-figures", "--no-snapshots", "--json", "--set", "time.duration_s=6"];
    let hit =
        [&["run", "pentagon-laplacian", "--set", "law.f1_per_s2=30", "--set", "law.f2_per_s=1"], &quick[..]].concat();
    let passed_through = [&hit[..], &["--plant", "ideal", "--force"]].concat();
    let mission =
        [&["run", "pentagon-leader", "--set", "leg=[{scale=1.2}]", "--set", "deadlock.mode=start"], &quick[..]]
            .concat();
    let tilting = [&["run", "crazyflies", "--plant", "ideal"], &quick[..], &["--set", "time.duration_s=1.5"]].concat();
    let into_a_pillar = "reference={kind=\"velocity\",velocity_m_s=[3,2.0,0],leader=1}";
    let among = [&["run", "obstacles", "--set", into_a_pillar, "--set", ELLIPSOID], &quick[..]].concat();
    // Two vehicles head on.
    let swap = [
        "--set",
        "start={positions_m=[[0, 0], [4, 0]]}",
        "--set",
        "formation={shape=\"points\", points_m=[[4, 0], [0, 0]], assignment=\"when-stalled\"}",
        "--set",
        "time.duration_s=12",
    ];
    let assigned = [&["run", "pentagon", "--set", "law.kind=displacement"], &quick[..], &swap].concat();
    let radio = [
        "--set",
        "network={rate_hz=20, loss=0.1}",
        "--set",
        "failure=[{vehicle=2, at_s=1, kind=\"silent\"}]",
        "--set",
        "time.duration_s=1.5",
    ];
    let heard = [&["run", "pentagon", "--force"], &quick[..], &radio].concat();
    let shielded = [&["run", "pentagon", "--force", "--set", "shield.enabled=true"], &quick[..]].concat();
    assert_documented(
        "report.json",
        &[&hit, &passed_through, &mission, &among, &assigned, &tilting, &heard, &shielded],
    );
}

#[test]
fn every_key_of_the_check_is_on_its_page() {
    let mission = ["check", "pentagon-leader", "--json", "--set", "leg=[{scale=1.2}]"];
    let among = ["check", "obstacles", "--json", "--set", ELLIPSOID];
    let drifting = ["check", "--json", "--set", "graph.kind=ring", "--set", "time.duration_s=310"];
    assert_documented("check --json", &[&drifting, &mission, &among]);
}

#[test]
fn every_key_of_a_comparison_is_on_its_page() {
    let quick = ["compare", "--laws", "edge-tension", "--runs", "1", "--json", "-", "--set", "time.duration_s=1.5"];
    assert_eq!(plain(&documented(STUDIES, "compare --json")), printed(&[&quick], by_kind));
}

#[test]
fn every_key_of_an_attack_is_on_its_page() {
    let quick =
        ["attack", "--vary", "law.alpha=0.9..1.1", "--flights", "1", "--json", "-", "--set", "time.duration_s=1.5"];
    assert_eq!(plain(&documented(STUDIES, "attack --json")), printed(&[&quick], by_kind));
}

#[test]
fn every_key_of_a_campaign_is_on_its_page() {
    const PAIR: &str = "formation = { shape = \"points\", points_m = [[0.0, 0.0], [1.3, 0.0]] }\n\
                        start = { positions_m = [[0.0, 0.0], [3.0, 0.0]] }\n\
                        law = { kind = \"displacement\", delta_m = 1.0 }\n\
                        time = { duration_s = 12.0, dt_s = 0.02 }\n";
    const FLIGHTS: &str = "scenario = \"pair.toml\"\nruns = 8\nlaws = [\"displacement\", \"edge-tension\"]\n[vary]\n\
                           \"start.jitter_m\" = { uniform = [0.0, 0.1] }\n";
    const RARE: &str = "scenario = \"pair.toml\"\nruns = 2\nmethod = \"splitting\"\n[set]\n\
                        law = { kind = \"laplacian\" }\nsensing = { position_noise_m = 0.3, rate_hz = 10.0 }\n\
                        [splitting]\nflights = 10\n";
    let folder = tempfile::tempdir().expect("a folder");
    let mut found = BTreeSet::new();
    for (name, text) in [("pair.toml", PAIR), ("flights.toml", FLIGHTS), ("rare.toml", RARE)] {
        std::fs::write(folder.path().join(name), text).expect("written");
    }
    for name in ["flights.toml", "rare.toml"] {
        let ran = ran_by(TAUTLINE, folder.path(), &["campaign", "run", name, "--worst", "0", "--json", "--quiet"]);
        keys(&by_kind(serde_json::from_str(&ran.out).expect(&ran.err)), "", &mut found);
    }
    // Null in one campaign, a table or a list in the other.
    let named: BTreeSet<_> = found.iter().map(|key| key.trim_end_matches("[]").to_owned()).collect();
    let is_whole = |key: &String| {
        !named.iter().any(|other| other.starts_with(&format!("{key}.")) || other.starts_with(&format!("{key}[]")))
    };
    let whole: BTreeSet<_> = named.iter().filter(|key| is_whole(key)).cloned().collect();
    assert_eq!(plain(&documented(STUDIES, "campaign.json")), whole);
}

#[test]
fn every_code_of_a_warning_is_on_its_page() {
    use tautline::preflight::Code;
    for code in Code::ALL {
        assert!(PAGE.contains(&format!("`{}`", code.name())), "{}", code.name());
    }
}
