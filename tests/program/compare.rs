//! `tautline compare`: numbers of `run` for any number of threads, and refusals before the first flight.

use std::fs;
use std::path::Path;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{at, closest};
use assert_cmd::Command;
use serde_json::Value;
use tautline::mcap::McapRecording;
use tautline::record::OwnedSample;
use tautline::swarm::row;

/// A valid start without randomness.
const PAIR: &str = r#"[start]
positions_m = [[0.0, 0.0], [4.0, 0.0]]
[formation]
shape = "line"
spacing_m = 3.0
[law]
delta_m = 2.0
alpha = 0.5
[time]
duration_s = 1.5
"#;
/// A pentagon, flown until the vehicles have crossed.
const CROSSING: [&str; 3] = ["pentagon", "--set", "time.duration_s=6"];
/// Error of sums of thousands of rounded lengths.
const ROUNDING: f64 = 1e-9;

fn ran(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, arguments)
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect(text)
}

/// Returns the comparison of laws as JSON, and standard error.
fn compared(folder: &Path, what: &[&str], more: &[&str]) -> (Value, String) {
    let Ran { exit, out, err } = ran(folder, &[&["compare"], what, more, &["--json"]].concat());
    assert_eq!(exit, Some(0), "{err}");
    (json(&out), err)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn list(value: &Value) -> &Vec<Value> {
    value.as_array().expect("a list")
}

fn file(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).expect("a file");
}

/// Returns the report of the flight of a law from a start, flown by `run`, and every step.
fn flown(folder: &Path, law: &Value, flight: &Value, jitter_m: &Value) -> (Value, Vec<OwnedSample>) {
    let sets = list(&law["overrides"]).iter().map(|set| set.as_str().expect("text").to_owned());
    let start = [format!("start.seed={}", flight["seed"]), format!("start.jitter_m={jitter_m}")];
    let sets: Vec<_> = sets.chain(start).flat_map(|set| ["--set".to_owned(), set]).collect();
    let sets: Vec<_> = sets.iter().map(String::as_str).collect();
    let quick = ["--no-figures", "--no-snapshots", "--json", "--force", "--out", "out"];
    let plain = ran(folder, &[&["run"], &CROSSING[..], &sets, &quick].concat());
    let every_step = [&sets[..], &["--set", "time.record_hz=240"]].concat();
    ran(folder, &[&["run"], &CROSSING[..], &every_step, &quick].concat());
    let recording = McapRecording::open(&folder.join("out/run.mcap")).and_then(McapRecording::read_all);
    (json(&plain.out), recording.expect("a recording").0)
}

#[test]
fn each_flight_has_the_bits_and_numbers_of_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let (found, err) = compared(folder.path(), &CROSSING, &["--laws=laplacian,edge-tension", "--runs=2", "--seed=5"]);
    assert!(
        err.contains("note: the start has no randomness: start.seed moves each coordinate by up to 0.100 m"),
        "{err}"
    );
    let laws = list(&found["laws"]);
    assert_eq!(
        laws.iter().map(|law| law["name"].as_str().expect("a name")).collect::<Vec<_>>(),
        ["laplacian", "edge-tension"]
    );
    for law in laws {
        let flights = list(&law["flights"]);
        assert_eq!(flights.iter().map(|flight| flight["seed"].as_u64()).collect::<Vec<_>>(), [Some(5), Some(6)]);
        for flight in flights {
            let (report, samples) = flown(folder.path(), law, flight, &found["jitter_m"]);
            let closest = closest(&report);
            for (ours, theirs) in [
                ("state_hash", at(&report, "/run/state_hash")),
                ("scenario_sha256", at(&report, "/scenario/sha256")),
                ("steps", at(&report, "/run/steps")),
                ("min_m", at(closest, "/value/lower")),
                ("min_at_s", at(closest, "/at_s")),
                ("certified_m", at(&report, "/certificate/separation_m")),
                ("reached_at_s", at(&report, "/formation/reached_at_s")),
                ("peak_control_m_s2", at(&report, "/control/peak_m_s2")),
                ("energy_max_over_initial", at(&report, "/energy/max_over_initial")),
            ] {
                assert_eq!(&flight[ours], theirs, "{ours}");
            }
            let pair: Vec<_> = list(&flight["min_pair"]).iter().map(Value::to_string).collect();
            assert_eq!(closest["subjects"], Value::from(pair));
            let (mut way_m, mut control_m_s) = (0.0, 0.0);
            for two in samples.windows(2) {
                let [before, after] = two else { panic!("two samples") };
                for i in 0..5 {
                    way_m += (row(&after.swarm.positions_m, i) - row(&before.swarm.positions_m, i)).norm();
                    let command = row(&after.control, i).norm() + row(&before.control, i).norm();
                    control_m_s += 0.5 * command * (after.time_s - before.time_s);
                }
            }
            assert!((number(&flight["path_length_m"]) - way_m).abs() < ROUNDING, "{flight}: {way_m}");
            assert!((number(&flight["total_control_m_s"]) - control_m_s).abs() < ROUNDING, "{flight}: {control_m_s}");
        }
        let smallest = flights.iter().map(|flight| number(&flight["min_m"])).fold(f64::INFINITY, f64::min);
        assert_eq!(number(&law["min_smallest_m"]), smallest);
        let mean = 0.5 * flights.iter().map(|flight| number(&flight["path_length_m"])).sum::<f64>();
        assert!((number(&law["path_length_mean_m"]["value"]) - mean).abs() < ROUNDING);
    }
}

#[test]
fn on_a_crossing_start_the_baseline_violates_and_the_edge_tension_does_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let (found, _) = compared(folder.path(), &CROSSING, &["--laws", "edge-tension,laplacian", "--runs", "6"]);
    let [tension, laplacian] = &list(&found["laws"])[..] else { panic!("two laws") };
    let counts = |law: &Value| ["clear", "violated"].map(|key| law[key]["count"].as_u64());
    assert_eq!((counts(tension), counts(laplacian)), ([Some(6), Some(0)], [Some(0), Some(6)]));
    // 0.025^(1/6) and its complement.
    assert!((number(&tension["clear"]["low"]) - 0.540_7).abs() < 1e-3 && number(&tension["clear"]["high"]) == 1.0);
    assert!((number(&laplacian["clear"]["high"]) - 0.459_3).abs() < 1e-3 && number(&laplacian["clear"]["low"]) == 0.0);
    assert!(number(&tension["min_smallest_m"]) > 2.0 && number(&laplacian["min_smallest_m"]) < 1.6);
    // No formation is reached after 6 s, so there is no time to reach it.
    assert_eq!((&tension["reached"]["count"], &tension["reached_median_s"]["value"]), (&0.into(), &Value::Null));
    assert!(list(&laplacian["flights"]).iter().all(|flight| flight["outcome"] == "violated"));
}

/// Returns the four files of a comparison with a number of threads.
fn files(folder: &Path, variable: &str, more: &[&str]) -> [String; 4] {
    let names = ["c.json", "c.csv", "c.tex", "c.html"];
    let mut command = Command::new(TAUTLINE);
    command.arg("compare").args(CROSSING).args(["--laws=potential,edge-tension,laplacian", "--runs=3", "--quiet"]);
    command.args(["--json=c.json", "--csv", names[1], "--latex", names[2], "--html", names[3], "--force"]);
    command.args(["--adapter", "software"]).args(more);
    command.current_dir(folder).env("XDG_RUNTIME_DIR", folder).env("RAYON_NUM_THREADS", variable);
    let done = command.output().expect("the program");
    assert_eq!((done.status.code(), done.stdout.len()), (Some(0), 0), "{}", String::from_utf8_lossy(&done.stderr));
    names.map(|name| fs::read_to_string(folder.join(name)).expect(name))
}

/// Removes wall-clock times.
fn timeless([report, csv, latex, html]: [String; 4]) -> (Value, String, String, String) {
    let mut report = json(&report);
    let performance = report.as_object_mut().and_then(|report| report.remove("performance")).expect("a performance");
    assert!(number(&performance["laws"][0]["law_step_s"]) > 0.0, "{performance}");
    let (html, _) = html.split_once("<h2>Performance</h2>").expect("a performance part");
    (report, csv, latex, html.to_owned())
}

#[test]
fn files_are_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let one = timeless(files(folder.path(), "1", &[]));
    assert!(one == timeless(files(folder.path(), "2", &[])), "RAYON_NUM_THREADS=2");
    assert!(one == timeless(files(folder.path(), "1", &["--threads", "3"])), "--threads 3");
    let other = timeless(files(folder.path(), "1", &["--seed", "1"]));
    assert!(
        one.0 != other.0 && one.1 != other.1 && one.2 != other.2 && one.3 != other.3,
        "other starts, other numbers"
    );
}

#[test]
fn csv_latex_and_page_agree_with_json() {
    let folder = tempfile::tempdir().expect("a folder");
    let [report, csv, latex, html] = files(folder.path(), "2", &[]);
    let (report, names) = (json(&report), ["potential", "edge-tension", "laplacian"]);

    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 4);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()), "{csv}");
    for (row, (law, name)) in rows[1..].iter().zip(list(&report["laws"]).iter().zip(names)) {
        assert_eq!((row[0], law["name"].as_str()), (name, Some(name)));
        let cell = |column: &str| row[rows[0].iter().position(|&head| head == column).expect(column)];
        for (column, key) in [
            ("clear_low", "/clear/low"),
            ("min_smallest_m", "/min_smallest_m"),
            ("path_length_mean_high_m", "/path_length_mean_m/high"),
            ("peak_control_largest_m_s2", "/peak_control_largest_m_s2"),
        ] {
            assert_eq!(cell(column).parse().ok(), law.pointer(key).and_then(Value::as_f64), "{column}");
        }
        assert_eq!(cell("reached_median_s"), "", "no flight reached the formation");
        assert!(latex.contains(&format!("\n{name} & ")) && html.contains(&format!("data-label=\"Law\">{name}</th>")));
    }

    let tables: Vec<_> = latex.split("\\begin{tabular}").skip(1).collect();
    assert_eq!((tables.len(), latex.matches("\\end{tabular}").count()), (3, 3));
    for table in tables {
        let columns = table.split(['{', '}']).nth(1).expect("columns").len();
        let body = table.lines().skip(1).take_while(|line| !line.starts_with("\\end"));
        let lines: Vec<_> = body.filter(|line| *line != "\\hline").collect();
        assert_eq!(lines.len(), 2 + 2 * names.len(), "{table}");
        for line in lines {
            assert!(line.ends_with(" \\\\") && line.matches(" & ").count() + 1 == columns, "{line}");
            assert_eq!(line.matches('{').count(), line.matches('}').count(), "{line}");
            assert_eq!(line.matches('%').count(), line.matches("\\%").count(), "{line}");
        }
    }

    assert_eq!(html.matches(", the closest of 3 flights").count(), 3, "a figure of each law");
    assert!(html.contains("tautline compare pentagon --laws 'potential,edge-tension,laplacian' --runs 3 --seed 0"));
    assert_eq!(html.matches("tautline run pentagon").count(), 3, "the worst flight of each law");
    for part in ["</html>", "Clopper and Pearson", "the start has no randomness"] {
        assert!(html.contains(part), "{part}");
    }
}

#[test]
fn tables_of_laws_have_names_and_do_not_affect_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let named =
        format!("{PAIR}[laws.stiff]\nkind = \"edge-tension\"\nalpha = 4.0\n[laws.laplacian]\nf1_per_s2 = 2.0\n");
    file(folder.path(), "pair.toml", &named);
    let settings = |laws: &[&str]| {
        let (found, _) = compared(folder.path(), &["pair.toml", "--runs", "1"], laws);
        let of_law = |law: &Value| format!("{}: {}", law["name"], law["overrides"]);
        list(&found["laws"]).iter().map(of_law).collect::<Vec<_>>()
    };
    assert_eq!(
        settings(&["--laws", "stiff,edge-tension,potential"]),
        [
            r#""stiff": ["law.kind=edge-tension","law.alpha=4.0"]"#,
            // The law of [law].
            r#""edge-tension": ["law.kind=edge-tension","law.alpha=0.5"]"#,
            r#""potential": ["law.kind=potential","law.k_per_s2=1.0","law.c_per_s=2.0","law.eta_m4_per_s2=1.0"]"#,
        ]
    );
    let laplacian = r#""laplacian": ["law.kind=laplacian","law.f1_per_s2=2.0","law.f2_per_s=1.0"]"#;
    let stiff = r#""stiff": ["law.kind=edge-tension","law.alpha=1.0"]"#;
    assert_eq!(settings(&["--set", "laws.stiff.alpha=1"]), [laplacian, stiff], "without --laws, those of the file");

    let flown = |text: &str, out: &str| {
        file(folder.path(), "pair.toml", text);
        let quick = ["run", "pair.toml", "--no-figures", "--no-snapshots", "--json", "--out", out];
        let report = json(&ran(folder.path(), &quick).out);
        (report["scenario"]["sha256"].clone(), report["run"]["state_hash"].clone())
    };
    assert_eq!(flown(PAIR, "plain"), flown(&named, "named"));
}

#[test]
fn paths_in_a_scenario_are_relative_to_its_folder_under_every_law() {
    let folder = tempfile::tempdir().expect("a folder");
    fs::create_dir(folder.path().join("below")).expect("a folder");
    file(folder.path(), "below/slots.csv", "0,0\n3,0\n");
    let listed = PAIR.replace("shape = \"line\"\nspacing_m = 3.0", "shape = \"file\"\nfile = \"slots.csv\"");
    file(folder.path(), "below/pair.toml", &listed);
    let (found, _) =
        compared(folder.path(), &["below/pair.toml", "--runs", "2"], &["--laws", "displacement,laplacian"]);
    assert!(list(&found["laws"]).iter().all(|law| law["clear"]["count"] == 2), "{found}");
}

#[test]
fn a_random_start_depends_on_the_seed_and_keeps_its_jitter() {
    let folder = tempfile::tempdir().expect("a folder");
    let random = ["pentagon", "--set", "start={shape=\"random\", half_extent_m=6.0}", "--set", "time.duration_s=1.5"];
    let (found, err) = compared(folder.path(), &random, &["--laws=edge-tension,laplacian", "--runs=3", "--seed=7"]);
    assert!(found["jitter_m"].is_null() && !err.contains("randomness"), "{err}");
    let [tension, laplacian] = &list(&found["laws"])[..] else { panic!("two laws") };
    let flights = list(&tension["flights"]);
    assert!(
        flights[0]["state_hash"] != flights[1]["state_hash"] && flights[1]["state_hash"] != flights[2]["state_hash"]
    );
    assert!(flights.iter().zip(list(&laplacian["flights"])).all(|(one, other)| one["seed"] == other["seed"]));
    let jittered = ["pentagon", "--set", "start.jitter_m=0.2", "--set", "time.duration_s=1.5"];
    let (found, err) = compared(folder.path(), &jittered, &["--laws=edge-tension", "--runs=1"]);
    assert!(found["jitter_m"].is_null() && !err.contains("randomness"), "{err}");
}

#[test]
fn refusals_and_unreached_formations_have_notes() {
    let folder = tempfile::tempdir().expect("a folder");
    file(folder.path(), "pair.toml", &PAIR.replace("alpha = 0.5\n", "[laws.laplacian]\nf2_per_s = 0.1\n"));
    let weak = ["pair.toml", "--set", "swarm.a22_per_s=0.5", "--set", "arrival.edge_error_m=0.97"];
    let quick = ["--runs", "6", "--set", "arrival.hold_s=0.1", "--set", "arrival.disagreement_m_s=9"];
    let (found, err) = compared(folder.path(), &[&weak[..], &quick].concat(), &["--laws", "laplacian,edge-tension"]);
    assert!(
        err.contains("note: laplacian: 6 of 6 flights are refused by `check` (relative-velocity-unstable)"),
        "{err}"
    );
    let [laplacian, tension] = &list(&found["laws"])[..] else { panic!("two laws") };
    assert_eq!((&laplacian["refused"], &tension["refused"]), (&6.into(), &0.into()));
    assert_eq!(laplacian["flights"][0]["refused"][0], "relative-velocity-unstable");
    assert_eq!(laplacian["clear"]["count"], 6, "flown anyway");

    // A duration for which some starts are within the tolerance to the end and some are not.
    let short = ["pair.toml", "--runs", "12", "--laws", "edge-tension", "--set", "time.duration_s=0.1"];
    let tight =
        ["--set", "arrival.edge_error_m=1.0", "--set", "arrival.disagreement_m_s=9", "--set", "arrival.hold_s=0.1"];
    let (found, err) = compared(folder.path(), &[&short[..], &tight].concat(), &[]);
    let reached = found["laws"][0]["reached"]["count"].as_u64().expect("a count");
    assert!((1..12).contains(&reached), "{reached}");
    assert!(err.contains(&format!("are over the {reached} of 12 flights that reached the formation")), "{err}");
}

#[test]
fn wrong_input_is_refused_with_a_remedy_before_a_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = folder.path();
    file(at, "pair.toml", PAIR);
    file(at, "near.toml", &PAIR.replace("[4.0, 0.0]", "[2.05, 0.0]"));
    for (name, table) in [
        ("key", "[laws.potential]\nalpha = 1.0"),
        ("value", "[laws.edge-tension]\nalpha = -1.0"),
        ("kind", "[laws.fast]\nalpha = 1.0"),
        ("other", "[laws.laplacian]\nkind = \"edge-tension\""),
        ("name", "[laws.\"a,b\"]\nkind = \"edge-tension\""),
        ("table", "[laws]\nfast = 3"),
    ] {
        file(at, &format!("{name}.toml"), &format!("{PAIR}{table}\n"));
    }
    fs::create_dir(at.join("folder.csv")).expect("a folder");
    file(at, "earlier.html", "an earlier comparison");
    let before = fs::read_dir(at).expect("a folder").count();
    let cases: &[(&[&str], &str, &str)] = &[
        (&["pair.toml", "--laws", "laplacain"], "scenario/unknown-choice", "did you mean `laplacian`?"),
        (&["pair.toml", "--laws", "x"], "scenario/unknown-choice", "`displacement`"),
        (&["pair.toml", "--laws", ""], "scenario/unknown-choice", "[laws.NAME]"),
        (&["pair.toml", "--laws", "laplacian,laplacian"], "compare/law-twice", "[laws.NAME]"),
        (&["near.toml", "--laws", "laplacian"], "scenario/within-delta", "start"),
        (&["key.toml", "--laws", "laplacian"], "scenario/unknown-key", "key.toml:12:1"),
        (&["value.toml", "--laws", "laplacian"], "scenario/out-of-range", "value.toml:12:9"),
        (&["kind.toml", "--laws", "laplacian"], "scenario/unknown-choice", "kind.toml:11:7"),
        (&["kind.toml"], "scenario/unknown-choice", "known here"),
        (&["other.toml"], "scenario/name", "other.toml:12:8"),
        (&["name.toml"], "scenario/name", "name.toml:11:7"),
        (&["table.toml"], "scenario/wrong-type", "table.toml:12:8"),
        (&["pair.toml", "--runs", "0"], "", ""),
        (&["pair.toml", "--seed", "-1"], "", ""),
        (&["nowhere"], "scenario/not-found", ""),
        (&["pair.toml", "--csv", "a.txt", "--json=./a.txt"], "files/overwrites-input", "another file"),
        (&["pair.toml", "--csv", "pair.toml"], "files/overwrites-input", "another file"),
        (&["pair.toml", "--json=new.json", "--csv", "folder.csv"], "files/is-directory", "a file in this directory"),
        (&["pair.toml", "--html", "earlier.html"], "files/exists", "--force"),
        (&["pair.toml", "--csv", "-", "--json"], "files/one-standard-output", "into a file"),
    ];
    for (arguments, code, shown) in cases {
        let ran = ran(at, &[&["compare"], *arguments].concat());
        // Values that clap refuses have no code.
        assert_eq!((ran.exit, ran.out.as_str(), ran.code()), (Some(2), "", *code), "{arguments:?}: {}", ran.err);
        let err = ran.err.split_whitespace().filter(|word| *word != "|").collect::<Vec<_>>().join(" ");
        assert!(err.contains(shown), "{arguments:?}: {err}");
    }
    // Every command checks these tables.
    assert_eq!(ran(at, &["check", "value.toml"]).exit, Some(2));
    let nowhere = ran(at, &["compare", "pair.toml", "--json=pair.toml/deep/c.json"]);
    assert_eq!((nowhere.exit, nowhere.out.as_str()), (Some(3), ""), "{}", nowhere.err);
    assert!(nowhere.err.contains("cannot write") && nowhere.err.contains("--json"), "{}", nowhere.err);
    assert_eq!(fs::read_dir(at).expect("a folder").count(), before, "nothing is written");
    let earlier = || fs::read_to_string(at.join("earlier.html")).expect("a file");
    assert_eq!(earlier(), "an earlier comparison");
    let again = ["compare", "pair.toml", "--laws", "laplacian", "--runs", "1", "--csv", "earlier.html", "--force"];
    assert_eq!(ran(at, &again).exit, Some(0));
    assert!(earlier().starts_with("law,"), "{}", earlier());
}

#[test]
fn a_table_is_printed_unless_quiet() {
    let folder = tempfile::tempdir().expect("a folder");
    file(folder.path(), "pair.toml", PAIR);
    let what = ["compare", "pair.toml", "--laws", "edge-tension,laplacian", "--runs", "6"];
    let Ran { exit, out, err } = ran(folder.path(), &what);
    assert_eq!(exit, Some(0), "{err}");
    assert!(out.starts_with("pair: 2 laws from the same 6 starts (start.seed 0 to 5), delta 2 m\n"), "{out}");
    // One table, with a row for each law.
    let headings =
        ["Law ", "Violated ", "Unknown ", "Reached ", "Time to reach, median [s] ", "Clearance, smallest [m]"];
    let table: Vec<_> =
        out.lines().skip_while(|line| !line.starts_with("Law ")).take_while(|line| !line.is_empty()).collect();
    assert!(headings.iter().all(|heading| table[0].contains(heading)), "{out}");
    assert_eq!(out.lines().filter(|line| line.starts_with("laplacian ")).count(), 1, "{out}");
    assert!(table[1].starts_with("edge-tension ") && table[2].starts_with("laplacian "), "{out}");
    assert!(table[1].contains("0 of 6 [") && !out.contains('\u{1b}'), "{out}");
    let quiet = ran(folder.path(), &[&what[..], &["--quiet", "--csv", "c.csv"]].concat());
    assert_eq!((quiet.exit, quiet.out.as_str(), quiet.err.as_str()), (Some(0), "", ""));
    assert!(folder.path().join("c.csv").exists());
}

#[test]
fn each_start_has_its_own_noise_which_run_repeats() {
    let folder = tempfile::tempdir().expect("a folder");
    let noisy = ["--set", "sensing.position_noise_m=0.01", "--set", "sensing.rate_hz=50"];
    let flown_once = [&CROSSING[..], &noisy, &["--laws", "edge-tension", "--runs", "2"]].concat();
    let (comparison, _) = compared(folder.path(), &flown_once, &[]);
    let law = &comparison["laws"][0];
    for flight in list(&law["flights"]) {
        let sets = [
            format!("start.seed={}", flight["seed"]),
            format!("noise.seed={}", flight["seed"]),
            format!("start.jitter_m={}", comparison["jitter_m"]),
        ];
        let sets: Vec<_> = sets.iter().flat_map(|set| ["--set", set.as_str()]).collect();
        let run = [&["run"], &CROSSING[..], &noisy, &sets, &["--json", "--no-snapshots", "--force"]].concat();
        let report = json(&ran(folder.path(), &run).out);
        assert_eq!(flight["state_hash"], report["run"]["state_hash"], "{run:?}");
    }
}
