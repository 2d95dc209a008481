//! Files and messages of a campaign: reproducible bytes, damaged parts, places of errors, kinds of bounds.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use crate::program::{Ran, TAUTLINE, ran_by};

/// Five vehicles from random starts, for 1 s.
const SPEC: &str = "scenario = \"pentagon\"\nruns = 12\nseed = 5\n[set]\ntime.duration_s = 1.0\n[vary]\n\
                    \"start.jitter_m\" = { uniform = [0.0, 0.3] }\n";

fn place(spec: &str) -> TempDir {
    let place = tempfile::tempdir().expect("a folder");
    fs::write(place.path().join("spec.toml"), spec).expect("written");
    place
}

fn campaign(place: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, place, &[&["campaign"], arguments].concat())
}

/// Returns every file below a folder except those of shards, with its bytes.
fn left(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.strip_prefix(folder).expect("below").to_owned();
            if name == Path::new("parts") || name == Path::new("manifest.json") {
                continue;
            }
            if path.is_dir() {
                folders.push(path);
            } else {
                files.push((name, fs::read(&path).expect("bytes")));
            }
        }
    }
    files.sort();
    files
}

#[test]
fn every_file_of_the_answer_has_the_same_bytes_for_any_shards_threads_and_folder() {
    let place = place(SPEC);
    let run = |out: &str, more: &[&str]| {
        let fixed = ["run", "spec.toml", "--out", out, "--worst", "2", "--no-snapshots", "--quiet"];
        let ran = campaign(place.path(), &[&fixed[..], more].concat());
        assert!(matches!(ran.exit, Some(0 | 1)), "{}", ran.err);
        left(&place.path().join(out))
    };
    let whole = run("one", &["--shards", "1", "--threads", "1"]);
    let split = run("deep/er/two", &["--shards", "5", "--threads", "2"]);
    let names = |files: &[(PathBuf, Vec<u8>)]| files.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    assert_eq!(names(&whole), names(&split));
    let reports = names(&whole).iter().filter(|name| name.ends_with("report.json")).count();
    assert!(reports == 2 && names(&whole).contains(&PathBuf::from("campaign.html")), "{:?}", names(&whole));
    for ((name, one), (_, other)) in std::iter::zip(&whole, &split) {
        assert!(one == other, "{} differs", name.display());
    }
    // Another campaign has other bytes, and a single run has wall-clock times.
    fs::write(place.path().join("spec.toml"), SPEC.replace("seed = 5", "seed = 6")).expect("written");
    assert_ne!(run("other", &[]), whole);
    let flown = ran_by(
        TAUTLINE,
        place.path(),
        &["run", "pentagon", "--set", "time.duration_s=1", "--out", "own", "--json", "--quiet", "--no-snapshots"],
    );
    assert!(flown.out.contains("\"performance\""), "{}", flown.err);
}

/// Remedy of a missing part: a command alone.
const HELP: &str = "help: tautline campaign shard camp --shard 1";

#[test]
fn a_damaged_part_is_reported_and_flown_again() {
    let place = place(SPEC);
    let run = || campaign(place.path(), &["run", "spec.toml", "--out", "camp", "--shards", "3", "--worst", "0"]);
    assert!(matches!(run().exit, Some(0 | 1)));
    let path = place.path().join("camp/parts/shard-000000001.jsonl");
    let whole = fs::read(&path).expect("a part");
    let altered = String::from_utf8(whole.clone()).expect("text").replacen("\"pass\":", "\"pass\" :", 1).into_bytes();
    for (bytes, why) in
        [(&whole[..whole.len() / 2], "is truncated"), (&altered, "was altered"), (&[][..], "is truncated")]
    {
        fs::write(&path, bytes).expect("written");
        for command in [&["merge", "camp", "--worst", "0"][..], &["report", "camp", "--worst", "0"]] {
            let refused = campaign(place.path(), command);
            let said = refused.err.split_whitespace().collect::<Vec<_>>().join(" ").replace("│ ", "");
            assert_eq!(refused.exit, Some(2), "{said}");
            for part in ["1 of 3 shards is missing or damaged: 1; ", "shard-000000001.jsonl is damaged: it ", why, HELP]
            {
                assert!(said.contains(part), "{part}: {said}");
            }
        }
        let missing = campaign(place.path(), &["missing", "camp"]);
        assert_eq!((missing.exit, missing.out.trim()), (Some(1), "1"));
        assert!(missing.err.contains("is damaged") && missing.err.contains(why), "{}", missing.err);
        let replay = campaign(place.path(), &["replay", "camp", "--run", "5", "--out", "again", "--no-snapshots"]);
        assert!(replay.exit == Some(2) && replay.err.contains("is damaged"), "{}", replay.err);
        fs::remove_dir_all(place.path().join("again")).ok();
        let again = run();
        assert!(again.err.contains("is damaged") && fs::read(&path).expect("a part") == whole, "{}", again.err);
    }
    // A missing part is not damaged.
    fs::remove_file(&path).expect("removed");
    let missing = campaign(place.path(), &["merge", "camp", "--worst", "0"]);
    assert!(missing.err.contains("1 of 3 shards is missing: 1") && !missing.err.contains("damaged"), "{}", missing.err);
    assert!(!campaign(place.path(), &["missing", "camp"]).err.contains("damaged"));
}

#[test]
fn errors_have_line_and_column_of_the_specification() {
    for (from, to, says, at) in [
        ("start.jitter_m", "start.jiter_m", "jiter_m", "spec.toml:7:8"),
        ("{ uniform", "{ unifrom", "unifrom", "spec.toml:7:22"),
        ("[0.0, 0.3]", "[0.3, 0.0]", "vary.start.jitter_m: must be two", "spec.toml:7:1"),
        ("[0.0, 0.3]", "[-2.0, -1.0]", "jitter_m", "spec.toml:7:1"),
        ("time.duration_s", "time.duratoin_s", "duratoin_s", "spec.toml:5:6"),
        ("runs = 12", "runs = 0", "`runs` must be at least 1, got 0", "spec.toml:2:8"),
        ("runs = 12", "runs = \"ten\"", "`runs` must be a whole number, got the text \"ten\"", "spec.toml:2:8"),
        (
            "{ uniform = [0.0, 0.3] }",
            "{ grid = 3 }",
            "`grid` must be a list with at least one entry or a table",
            ":7:29",
        ),
        ("time.duration_s", "breathing.mode", "unknown key `breathing`", "spec.toml:5:1"),
        ("time.duration_s = 1.0", "\"breathing.mode\" = \"x\"", "unknown key `breathing`", "spec.toml:5:2"),
        ("time.duration_s = 1.0", "\"time.dt_s\" = [1.0]", "`dt_s` must be a number, got a list", "spec.toml:5:15"),
        ("seed = 5", "laws = [\"orcca\"]", "orcca", "spec.toml:3:9"),
        ("\"pentagon\"", "\"pentagan\"", "pentagan", "spec.toml:1:1"),
        ("[set]", "stop = { width = 3.0 }\n[set]", "stop.width", "spec.toml:4:10"),
    ] {
        let spec = SPEC.replace(from, to);
        assert_ne!(spec, SPEC, "{from}");
        let place = place(&spec);
        let ran = campaign(place.path(), &["run", "spec.toml", "--out", "camp"]);
        assert_eq!(ran.exit, Some(2), "{to}: {}", ran.out);
        assert!(ran.err.contains(says) && ran.err.contains(at), "{to}: {at}: {}", ran.err);
        assert!(!ran.err.contains("--set:"), "{to}: {}", ran.err);
    }
    // An error in the scenario's own file has its place there.
    let place = place(&SPEC.replace("\"pentagon\"", "\"own.toml\""));
    fs::write(place.path().join("own.toml"), "[law]\nkind = \"edge-tension\"\ndelta_n = 2.0\n").expect("written");
    let ran = campaign(place.path(), &["run", "spec.toml", "--out", "camp"]);
    assert!(ran.exit == Some(2) && ran.err.contains("own.toml:3:1"), "{}", ran.err);
}

#[test]
fn a_bound_has_its_kind_in_text_json_and_page() {
    let place = place(
        &SPEC.replace("runs = 12", "runs = 20").replace("duration_s = 1.0", "duration_s = 0.1\narrival.hold_s = 0.1"),
    );
    let ran = campaign(place.path(), &["run", "spec.toml", "--out", "camp", "--worst", "0"]);
    // 1 - 0.05^(1/20) = 0.1391.
    let sentence = "0 of 20 flights violated: below 14 % with 95 % confidence (one-sided)";
    assert!(ran.out.contains(sentence) && ran.out.contains("two-sided 95 % interval"), "{}", ran.out);
    let answer = fs::read(place.path().join("camp/campaign.json")).expect("an answer");
    let law = &serde_json::from_slice::<Value>(&answer).expect("JSON")["laws"][0];
    let [below, high] =
        [&law["violated_below"]["share"], &law["violated"]["high"]].map(|x| x.as_f64().expect("a number"));
    assert!((below - (1.0 - 0.05_f64.powf(0.05))).abs() < 1e-9, "{law}");
    assert!((high - (1.0 - 0.025_f64.powf(0.05))).abs() < 1e-9, "the interval is two-sided: {law}");
    assert_eq!(law["violated_below"]["kind"], "one-sided");
    let page = fs::read_to_string(place.path().join("camp/campaign.html")).expect("a page");
    assert!(page.contains(sentence) && page.contains("two-sided 95 % intervals of their shares"), "{page}");
    let stopped =
        campaign(place.path(), &["run", "spec.toml", "--out", "stop", "--worst", "0", "--until-width", "0.01"]);
    assert!(stopped.out.contains("% with 95 % confidence (confidence sequence)"), "{}", stopped.out);
    // If all flights are violated, the upper bound is 1 and is not printed.
    let spec = "scenario = \"pentagon-laplacian\"\nruns = 3\n[set]\ntime.duration_s = 5.0\n[vary]\n\
                start.jitter_m = { uniform = [0.0, 0.01] }\n";
    fs::write(place.path().join("spec.toml"), spec).expect("written");
    let all = campaign(place.path(), &["run", "spec.toml", "--out", "all", "--worst", "0"]);
    assert!(all.out.lines().any(|line| line == "3 of 3 flights violated"), "{}", all.out);
}

#[test]
fn options_out_of_range_are_named_with_their_value() {
    let place = place(SPEC);
    let refused = campaign(place.path(), &["plan", "spec.toml", "--out", "camp", "--shards", "0"]);
    assert_eq!(refused.exit, Some(2), "{}", refused.out);
    assert!(refused.err.contains("--shards 0: must be from 1 to 12, the number of runs"), "{}", refused.err);
    assert!(refused.err.contains("help: give a number in this range, or leave --shards out"), "{}", refused.err);
    assert_eq!(campaign(place.path(), &["plan", "spec.toml", "--out", "camp", "--shards", "3"]).exit, Some(0));
    for (arguments, says) in [
        (&["merge", "camp"][..], "3 of 3 shards are missing: 0-2"),
        (&["shard", "camp", "--shard", "4"], "--shard 4: must be from 0 to 2"),
        (&["replay", "camp", "--run", "12"], "--run 12: must be from 0 to 11"),
        (&["replay", "camp", "--run", "1", "--law", "orca"], "--law orca: the campaign has no such law"),
    ] {
        let refused = campaign(place.path(), arguments);
        assert!(refused.exit == Some(2) && refused.err.contains(says), "{says}: {}", refused.err);
    }
}

#[test]
fn a_report_says_that_it_flies_flights_again() {
    let place = place(
        &SPEC.replace("runs = 12", "runs = 3").replace("duration_s = 1.0", "duration_s = 0.1\narrival.hold_s = 0.1"),
    );
    let ran = campaign(place.path(), &["run", "spec.toml", "--out", "camp", "--worst", "0"]);
    assert!(!ran.err.contains("again"), "{}", ran.err);
    let report = campaign(place.path(), &["report", "camp", "--worst", "2", "--no-snapshots"]);
    let says = "flying 2 flights with the least clearance again for the page; --worst 0 leaves it out";
    assert!(report.err.contains(says), "{}", report.err);
}
