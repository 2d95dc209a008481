//! docs/report.md lists exactly the keys of the JSON of `run`, `audit` and `check`, docs/codes.md their codes,
//! docs/studies.md the keys of studies, and docs/campaigns.md those of campaigns.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;
use std::path::Path;

use crate::program::{TAUTLINE, ran_by};
use serde_json::Value;

const PAGE: &str = include_str!("../../docs/report.md");
const CODES: &str = include_str!("../../docs/codes.md");
const ELLIPSOID: &str = "safety={shape=\"ellipsoid\", half_axes_m=[0.5, 0.5, 1.0]}";
const STUDIES: &str = include_str!("../../docs/studies.md");
const CAMPAIGNS: &str = include_str!("../../docs/campaigns.md");
/// Objects that stand in many places of the JSON of studies, by their keys: share, estimate, quantiles, pairs of runs.
const KINDS: [&[&str]; 4] = [
    &["count", "of", "share", "low", "high", "confidence"],
    &["value", "low", "high"],
    &["min", "p05", "median", "p95", "max"],
    &["only_first", "only_second", "of", "p_value", "first_of_discordant", "difference", "low", "high", "confidence"],
];

/// Returns the text of a section of a page, without its further sections of this level.
fn section(page: &'static str, mark: &str, heading: &str) -> &'static str {
    page.split(mark).find(|text| text.starts_with(heading)).expect("a section")
}

/// Returns the keys of a section of a page.
fn documented(page: &'static str, heading: &str) -> BTreeSet<&'static str> {
    rows(section(page, "\n## ", heading))
}

/// Returns the keys of a study, with those of all studies.
fn documented_study(heading: &str) -> BTreeSet<&'static str> {
    let mut keys = documented(STUDIES, "Keys of all studies");
    keys.extend(documented(STUDIES, heading));
    keys
}

/// Returns the keys of tables. The first cell of a row holds one key or several.
fn rows(text: &'static str) -> BTreeSet<&'static str> {
    let cells = text.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` |"));
    cells.flat_map(|(keys, _)| keys.split("`, `")).collect()
}

/// Returns the keys of a finding, from the table whose first cells hold one key or several.
fn keys_of_a_finding() -> BTreeSet<String> {
    let table = section(PAGE, "\n## ", "Answers and findings").split("| key of a finding |").nth(1).expect("a table");
    let cells = table.lines().filter_map(|line| line.strip_prefix("| `")?.split_once("` |"));
    let keys = cells.flat_map(|(cell, _)| cell.split("`, `"));
    keys.map(|key| key.trim_end_matches("[]").to_owned()).collect()
}

/// Replaces each finding by a word, and the data of each reason, whose keys depend on the code.
fn without_findings(value: Value) -> Value {
    let mut paths = BTreeSet::new();
    match value {
        Value::Object(table) if table.contains_key("subjects") => {
            keys(&Value::Object(table.clone()), "", &mut paths);
            if paths == keys_of_a_finding() { Value::from("a finding") } else { Value::Object(table) }
        }
        Value::Object(mut table) if table.contains_key("data") => {
            assert_documented_reason(&table);
            table.insert("data".to_owned(), Value::from("keys of the code"));
            Value::Object(table)
        }
        Value::Object(table) => table.into_iter().map(|(key, value)| (key, without_findings(value))).collect(),
        Value::Array(list) => {
            let list: Vec<_> = list.into_iter().map(without_findings).collect();
            let are_findings = !list.is_empty() && list.iter().all(|entry| entry == "a finding");
            if are_findings { Value::from("findings") } else { list.into() }
        }
        plain => plain,
    }
}

/// Asserts that the row of a reason's code names every key of its data.
fn assert_documented_reason(reason: &serde_json::Map<String, Value>) {
    let text = section(CODES, "\n## ", "Reasons against a pass");
    let code = reason["code"].as_str().expect("a code");
    let row = text.lines().find(|line| line.starts_with(&format!("| `{code}` |"))).unwrap_or_else(|| panic!("{code}"));
    for key in reason["data"].as_object().expect("an object").keys() {
        assert!(row.contains(&format!("`{key}`")) || row.contains(&format!("`{key}[]`")), "{code}: {key}");
    }
}

/// Collects the paths of all keys of a JSON value.
fn keys(value: &Value, path: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(table) if !table.is_empty() => {
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
            let flight: Vec<_> = flight.iter().map(|key| key.trim_end_matches("[]")).collect();
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
    printed_in(tempfile::tempdir().expect("a folder").path(), commands, simplify)
}

/// Returns the keys that commands print in a folder.
fn printed_in(folder: &Path, commands: &[&[&str]], simplify: impl Fn(Value) -> Value) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for command in commands {
        let ran = ran_by(TAUTLINE, folder, command);
        keys(&simplify(serde_json::from_str(&ran.out).expect("JSON")), "", &mut found);
    }
    let (empty, mut found): (BTreeSet<_>, BTreeSet<_>) = found.into_iter().partition(|key| key.ends_with("[]"));
    let is_plain = |list: &String| !found.iter().any(|key| key.starts_with(&format!("{list}.")));
    let plain: Vec<_> = empty.into_iter().filter(is_plain).collect();
    found.extend(plain.iter().map(|list| list.trim_end_matches("[]").to_owned()));
    found
}

/// Returns the keys without those of tables that are null or empty in one output and have keys in another one.
fn whole(keys: &BTreeSet<String>) -> BTreeSet<String> {
    let is_table = |key: &String| {
        keys.iter()
            .any(|other| ["{key}.", "{key}[]."].iter().any(|form| other.starts_with(&form.replace("{key}", key))))
    };
    keys.iter().filter(|key| !is_table(key)).cloned().collect()
}

/// Returns the documented keys without list marks.
fn plain(documented: &BTreeSet<&str>) -> BTreeSet<String> {
    documented.iter().map(|key| key.trim_end_matches("[]").to_owned()).collect()
}

fn assert_documented(documented: &BTreeSet<&'static str>, printed: &BTreeSet<String>) {
    assert_eq!(plain(documented), *printed);
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
    let commands =
        [&hit, &passed_through, &mission, &among, &assigned, &tilting, &heard, &shielded].map(|command| &command[..]);
    assert_documented(&documented(PAGE, "report.json"), &printed(&commands, without_findings));
}

#[test]
fn every_key_of_an_audit_is_on_its_page() {
    /// Vehicle b is not seen from 2 s to 5 s, and c is alone.
    const LATE: [(&str, u32, RangeInclusive<u32>); 4] =
        [("a", 0, 0..=8), ("b", 9, 0..=2), ("b", 9, 5..=8), ("c", 18, 20..=22)];
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
    let seen = LATE.into_iter().flat_map(|(id, x, times)| times.map(move |t| format!("{t},{id},{x},0,0\n")));
    write("late.csv", &format!("t_s,id,x,y,z\n{}", seen.collect::<Vec<_>>().concat()));
    // Vehicle a turns, and its plan ends earlier than the flight.
    let turn = "t_s,id,x,y,z\n0,a,0,0,0\n0,b,0,9,0\n1,a,5,0,0\n1,b,0,9,0\n2,a,0,0,0\n2,b,0,9,0\n";
    write("turn.csv", turn);
    write("plan.csv", turn.rsplit_once("2,a").expect("a row").0);
    std::fs::create_dir(folder.path().join("corners")).expect("a folder");
    for (name, y) in [("a.csv", 0), ("b.csv", 9)] {
        let corner = format!("duration,x^0,x^1,y^0,y^1,z^0,z^1\n1,0,3,{y},0,1,0\n1,3,-3,{y},0,1,0\n");
        write(&format!("corners/{name}"), &corner);
    }
    let fly = |scenario: &str, out: &str, sets: &[&str]| {
        let sets = sets.iter().flat_map(|set| ["--set", set]);
        let fixed = ["run", scenario, "--out", out, "--no-figures", "--no-snapshots", "--force", "--quiet"];
        ran_by(TAUTLINE, folder.path(), &fixed.into_iter().chain(sets).collect::<Vec<_>>());
    };
    // The mean velocity grows until rounding moves vehicles.
    fly("pentagon", "drifting", &["swarm.a22_per_s=2.0", "time.duration_s=60"]);
    let stiff = ["law.f1_per_s2=30", "law.f2_per_s=1", "time.record_hz=1", "time.duration_s=20", "arrival.hold_s=20"];
    fly("pentagon-laplacian", "stiff", &stiff);
    let bounded = ["turn.csv", "--delta", "1", "--motion", "bounded", "--max-accel", "0.1"];
    let planned = ["turn.csv", "--delta", "1", "--plan", "plan.csv", "--plan-delay", "0"];
    let commands = [
        &["late.csv", "--delta", "1", "--limit", "speed=5", "--require-presence"][..],
        &bounded,
        &planned,
        &["turn.csv", "--delta", "1", "--plan", "turn.csv"],
        &["corners", "--limit", "accel=9"],
        &["drifting"],
        &["stiff", "--delta", "1.99"],
    ];
    let commands: Vec<_> = commands.iter().map(|command| [&["audit"], *command, &["--json"]].concat()).collect();
    let commands: Vec<_> = commands.iter().map(Vec::as_slice).collect();
    let simplify = |mut report: Value| {
        // Keys of limits depend on the question.
        report["question"]["limits"] = Value::from("keys of limits");
        without_findings(report)
    };
    let mut documented = documented(PAGE, "audit --json");
    documented.extend(rows(section(PAGE, "\n### ", "First keys")));
    assert_eq!(whole(&plain(&documented)), whole(&printed_in(folder.path(), &commands, simplify)));
}

#[test]
fn every_key_of_the_check_is_on_its_page() {
    let mission = ["check", "pentagon-leader", "--json", "--set", "leg=[{scale=1.2}]"];
    let among = ["check", "obstacles", "--json", "--set", ELLIPSOID];
    let drifting = ["check", "--json", "--set", "graph.kind=ring", "--set", "time.duration_s=310"];
    assert_documented(&documented(PAGE, "check --json"), &printed(&[&drifting, &mission, &among], |json| json));
}

#[test]
fn every_key_of_a_comparison_is_on_its_page() {
    let quick = ["compare", "--laws", "edge-tension", "--runs", "1", "--json", "--set", "time.duration_s=1.5"];
    assert_eq!(plain(&documented_study("compare --json")), printed(&[&quick], by_kind));
}

#[test]
fn every_key_of_an_attack_is_on_its_page() {
    let quick = ["attack", "--vary", "law.alpha=0.9..1.1", "--flights", "1", "--json", "--set", "time.duration_s=1.5"];
    assert_eq!(plain(&documented_study("attack --json")), printed(&[&quick], by_kind));
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
    assert_eq!(plain(&documented(CAMPAIGNS, "campaign.json")), whole(&named));
}

#[test]
fn every_code_of_a_warning_is_on_its_page() {
    use tautline::fact::Coded;
    use tautline::preflight::Code;
    for code in Code::ALL {
        let mark = if code.refuses() { " *" } else { "" };
        let begin = format!("| `{}`{mark} |", code.code());
        let mut rows = section(CODES, "\n## ", "Warnings of a check").lines();
        assert!(rows.any(|row| row.starts_with(&begin)), "{}", code.code());
    }
}

#[test]
fn every_code_has_a_row_and_every_row_a_code() {
    use tautline::fact::{Coded, FactKind, Source};
    use tautline::watch;
    for (heading, codes) in [
        ("Reasons against a pass", tautline::report::Reason::CODES),
        ("Reasons of a void certificate", tautline::law::VoidReason::CODES),
        ("Early ends", tautline::sim::Ending::CODES),
        ("Exceeded bounds of a shield", tautline::shield::report::Exceeded::CODES),
        ("Facts", FactKind::CODES),
        ("Sources", Source::CODES),
        ("Notices of a watch", watch::Statement::CODES),
        ("Reasons of a watch", watch::Reason::CODES),
        ("Faults of a watch", watch::Fault::CODES),
        ("Messages that cannot be read", watch::Problem::CODES),
        ("Lost sources of a watch", watch::Loss::CODES),
    ] {
        let lines = section(CODES, "\n## ", heading).lines().skip_while(|line| !line.starts_with("| ---"));
        let cells = lines.filter_map(|line| line.strip_prefix("| `")?.split_once("` |"));
        let mut rows: Vec<_> = cells.flat_map(|(cell, _)| cell.split("`, `")).collect();
        // A completed flight has no early end.
        let mut codes: Vec<_> = codes.iter().copied().filter(|code| *code != "completed").collect();
        rows.sort_unstable();
        codes.sort_unstable();
        assert_eq!(rows, codes, "{heading}");
    }
}
