//! `tautline campaign`: the same answer for any shards, threads and interruptions.

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::program::{PATIENCE, Ran, TAUTLINE, ran_by};

/// Five vehicles from random starts, under two laws, for 1 s.
const SPEC: &str = r#"
    scenario = "pentagon"
    runs = 60
    seed = 5
    laws = ["edge-tension", "displacement"]
    [set]
    time.duration_s = 1.0
    [vary]
    "start.jitter_m" = { uniform = [0.0, 0.4] }
    "law.delta_m" = { list = [1.5, 2.0] }
"#;

/// Folder with a specification.
struct Place(tempfile::TempDir);

impl Place {
    fn of(spec: &str) -> Self {
        let place = Self(tempfile::tempdir().expect("a folder"));
        fs::write(place.0.path().join("spec.toml"), spec).expect("written");
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn campaign(&self, arguments: &[&str]) -> Ran {
        ran_by(TAUTLINE, self.0.path(), &[&["campaign"], arguments].concat())
    }

    /// Flies the whole campaign into a folder and returns the bytes of table and answer.
    fn run(&self, out: &str, more: &[&str]) -> [Vec<u8>; 2] {
        let fixed = ["run", "spec.toml", "--out", out, "--worst", "0", "--quiet"];
        let ran = self.campaign(&[&fixed[..], more].concat());
        assert!(matches!(ran.exit, Some(0 | 1)), "{}", ran.err);
        self.left(out)
    }

    fn left(&self, out: &str) -> [Vec<u8>; 2] {
        ["results.parquet", "campaign.json"].map(|name| fs::read(self.path(out).join(name)).expect("left"))
    }

    /// Returns the size of all rows and journals of a folder.
    fn bytes(&self, out: &str) -> u64 {
        let entries = fs::read_dir(self.path(out).join("parts")).into_iter().flatten().flatten();
        entries.filter_map(|entry| entry.metadata().ok()).map(|file| file.len()).sum()
    }

    fn parts(&self, out: &str) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.path(out).join("parts")).expect("parts");
        let mut parts: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
        parts.retain(|path| path.extension().is_some_and(|extension| extension == "jsonl"));
        parts.sort();
        parts
    }
}

fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).expect("JSON")
}

#[test]
fn the_answer_is_the_same_for_any_shards_threads_and_order() {
    let place = Place::of(SPEC);
    let whole = place.run("one", &["--shards", "1", "--threads", "1"]);
    assert_eq!(place.run("seven", &["--shards", "7", "--threads", "2"]), whole);
    let planned = place.campaign(&["plan", "spec.toml", "--shards", "60", "--out", "many"]);
    assert!(planned.exit == Some(0) && planned.out.starts_with("wrote many/manifest.json: "), "{planned:?}");
    let again = place.campaign(&["plan", "spec.toml", "--shards", "60", "--out", "many"]);
    assert!(again.out.starts_with("planned before in many/manifest.json: "), "nothing is written: {}", again.out);
    // Shards in another order, some of them twice, from the folder and from the manifest.
    for shards in ["59", "0-20", "30-58", "10-35"] {
        let folder = if shards == "59" { "many/manifest.json" } else { "many" };
        let flown = place.campaign(&["shard", folder, "--shard", shards, "--threads", "2", "--quiet"]);
        assert_eq!(flown.exit, Some(0), "{}", flown.err);
    }
    let missing = place.campaign(&["missing", "many"]);
    assert_eq!((missing.exit, missing.out.as_str()), (Some(0), ""));
    let merged = place.campaign(&["merge", "many", "--worst", "0"]);
    assert!(merged.out.contains("results.parquet") && merged.out.contains("flights violated"), "{}", merged.out);
    assert_eq!(place.left("many"), whole);
    let answer = json(&whole[1]);
    assert_eq!((&answer["runs"], answer["laws"][0]["violated"]["of"].as_u64()), (&Value::from(60), Some(60)));
    assert_eq!(answer["pairs"].as_array().map(Vec::len), Some(1));
    // Another seed gives other flights.
    fs::write(place.path("spec.toml"), SPEC.replace("seed = 5", "seed = 6")).expect("written");
    assert_ne!(place.run("other", &[])[0], whole[0]);
}

#[test]
fn a_campaign_killed_repeatedly_has_the_same_answer() {
    let place = Place::of(SPEC);
    let whole = place.run("whole", &[]);
    let bytes = place.bytes("whole");
    let kills = if std::env::var_os("TAUTLINE_LONG").is_some() { 20 } else { 5 };
    for kill in 0..kills {
        let mut child = Command::new(TAUTLINE)
            .args(["campaign", "run", "spec.toml", "--out", "killed", "--shards", "4", "--worst", "0", "--quiet"])
            .current_dir(place.0.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        // Each process adds about the same number of flights.
        let enough = bytes * kill / kills;
        let began = Instant::now();
        while place.bytes("killed") <= enough && child.try_wait().expect("it is ours").is_none() {
            let flown = place.bytes("killed");
            assert!(began.elapsed() < PATIENCE, "process {kill} has flown {flown} of {enough} bytes");
            std::thread::sleep(Duration::from_millis(2));
        }
        child.kill().expect("it can be killed");
        child.wait().expect("it ends");
    }
    assert_eq!(place.run("killed", &[]), whole);
}

#[test]
fn a_torn_part_is_flown_again_and_that_of_another_campaign_refused() {
    let place = Place::of(SPEC);
    let whole = place.run("camp", &["--shards", "3"]);
    let part = place.parts("camp")[1].clone();
    let bytes = fs::read(&part).expect("a part");
    for torn in [bytes.len() / 2, bytes.len() - 1, 0] {
        fs::write(&part, &bytes[..torn]).expect("torn");
        let missing = place.campaign(&["missing", "camp"]);
        assert_eq!((missing.exit, missing.out.trim()), (Some(1), "1"), "{torn}");
        let holes = place.campaign(&["merge", "camp", "--worst", "0"]);
        assert_eq!(holes.exit, Some(2));
        assert!(
            holes.err.contains("1 of 3 shards is missing or damaged: 1; ") && holes.err.contains("--shard 1"),
            "{}",
            holes.err
        );
    }
    let changed = String::from_utf8(bytes.clone()).expect("text").replacen("\"pass\":", "\"pass\" :", 1);
    fs::write(&part, changed).expect("changed");
    assert_eq!(place.campaign(&["missing", "camp"]).exit, Some(1), "a part that was changed is no part");
    assert_eq!(place.run("camp", &[]), whole);
    // A part of another campaign.
    fs::write(place.path("spec.toml"), SPEC.replace("seed = 5", "seed = 6")).expect("written");
    place.run("other", &["--shards", "3"]);
    fs::copy(&place.parts("other")[1], &part).expect("copied");
    let refused = place.campaign(&["merge", "camp", "--worst", "0"]);
    assert_eq!(refused.exit, Some(2), "{}", refused.out);
    assert!(refused.err.contains("of campaign"), "{}", refused.err);
    // Two results of one shard.
    fs::write(&part, &bytes).expect("restored");
    let differs = part.with_file_name("shard-000000001.differs.jsonl");
    fs::write(&differs, &bytes).expect("written");
    let alarm = place.campaign(&["merge", "camp", "--worst", "0"]);
    assert_eq!(alarm.exit, Some(3), "{}", alarm.err);
    assert!(alarm.err.contains("different results"), "{}", alarm.err);
}

#[test]
fn an_edited_manifest_and_another_specification_are_refused_with_both_hashes() {
    let place = Place::of(SPEC);
    assert_eq!(place.campaign(&["plan", "spec.toml", "--shards", "2", "--out", "camp"]).exit, Some(0));
    let path = place.path("camp/manifest.json");
    let text = fs::read_to_string(&path).expect("a manifest");
    let manifest = json(text.as_bytes());
    fs::write(&path, text.replace("\"runs\": 60", "\"runs\": 59")).expect("written");
    let changed = place.campaign(&["shard", "camp", "--shard", "0"]);
    assert_eq!(changed.exit, Some(2));
    let campaign = manifest["campaign"].as_str().expect("a hash");
    assert!(changed.err.contains(&campaign[..32]) && changed.err.contains("its contents are"), "{}", changed.err);
    fs::write(&path, &text).expect("written");
    // The same folder with another specification.
    fs::write(place.path("spec.toml"), SPEC.replace("seed = 5", "seed = 61")).expect("written");
    let other = place.campaign(&["run", "spec.toml", "--out", "camp"]);
    assert_eq!(other.exit, Some(2));
    assert!(other.err.contains(&campaign[..32]) && other.err.contains("and this is"), "{}", other.err);
}

#[test]
fn more_runs_keep_the_flown_ones_and_widen_the_intervals() {
    let place = Place::of(SPEC);
    place.run("camp", &["--shards", "4"]);
    // A damaged part is flown again; the other 45 runs are kept.
    let damaged = &place.parts("camp")[1];
    fs::write(damaged, &fs::read(damaged).expect("a part")[..1000]).expect("written");
    fs::write(place.path("spec.toml"), SPEC.replace("runs = 60", "runs = 90")).expect("written");
    let raised = place.campaign(&["run", "spec.toml", "--out", "camp", "--worst", "0", "--shards", "1"]);
    assert!(matches!(raised.exit, Some(0 | 1)), "{}", raised.err);
    assert!(raised.out.contains("90 flights in"), "15 and 30 runs under two laws: {}", raised.out);
    let again = place.campaign(&["run", "spec.toml", "--out", "camp", "--worst", "0"]);
    assert!(!again.out.contains("flights in") && again.exit == raised.exit, "{}", again.out);
    place.run("fresh", &["--shards", "1"]);
    let rows = |out: &str| {
        let part = fs::read_to_string(&place.parts(out)[0]).expect("a part");
        let lines: Vec<_> = part.lines().map(str::to_owned).collect();
        lines[1..lines.len() - 1].to_vec()
    };
    assert_eq!((place.parts("camp").len(), rows("camp").len()), (1, 180));
    assert_eq!(rows("camp"), rows("fresh"));
    let answer = |out: &str| serde_json::from_slice::<Value>(&place.left(out)[1]).expect("JSON");
    let [raised, fresh] = [answer("camp"), answer("fresh")];
    assert_eq!([&raised["intervals"], &fresh["intervals"]], ["confidence-sequence", "clopper-pearson"]);
    let width = |of: &Value| {
        let share = &of["laws"][0]["violated"];
        share["high"].as_f64().expect("a bound") - share["low"].as_f64().expect("a bound")
    };
    assert_eq!(raised["laws"][0]["violated"]["count"], fresh["laws"][0]["violated"]["count"]);
    assert!(width(&raised) > width(&fresh), "the number of runs was not fixed beforehand");
    fs::write(place.path("spec.toml"), SPEC).expect("written");
    let fewer = place.campaign(&["run", "spec.toml", "--out", "camp", "--worst", "0"]);
    assert_eq!(fewer.exit, Some(2));
    assert!(fewer.err.contains("with 90 runs, and this is 60"), "{}", fewer.err);
}

#[test]
fn an_early_stop_leaves_later_rows_out() {
    let spec = SPEC.replace("runs = 60", "runs = 400").replace("laws = [\"edge-tension\", \"displacement\"]", "");
    let place = Place::of(&spec.replace("duration_s = 1.0", "duration_s = 0.2\n    arrival.hold_s = 0.1"));
    let early = place.run("early", &["--until-width", "0.2", "--shards", "8"]);
    let answer = json(&early[1]);
    let runs = answer["runs"].as_u64().expect("a number");
    assert!(runs < 400 && answer["stopped_early"] == Value::Bool(true), "{answer}");
    assert_eq!(answer["intervals"], "confidence-sequence");
    assert!(place.parts("early").len() < 8, "shards beyond are not flown");
    // A complete campaign in another folder has the same rows.
    let planned = ["plan", "spec.toml", "--until-width", "0.2", "--shards", "5", "--out", "all"];
    assert_eq!(place.campaign(&planned).exit, Some(0));
    assert_eq!(place.campaign(&["shard", "all", "--shard", "0-4", "--threads", "2", "--quiet"]).exit, Some(0));
    assert!(matches!(place.campaign(&["merge", "all", "--worst", "0"]).exit, Some(0 | 1)));
    assert_eq!(place.left("all"), early);
    let whole = json(&place.run("whole", &[])[1]);
    assert_eq!((whole["runs"].as_u64(), &whole["intervals"]), (Some(400), &Value::from("clopper-pearson")));
}

#[test]
fn a_full_disk_exits_with_3_and_keeps_finished_flights() {
    let place = Place::of(SPEC);
    let whole = place.run("whole", &[]);
    let limited = |blocks: u32| {
        let shell = format!(
            "trap '' XFSZ; ulimit -f {blocks}; \
             exec {TAUTLINE} campaign run spec.toml --out full --shards 2 --worst 0 --quiet"
        );
        Command::new("sh").args(["-c", &shell]).current_dir(place.0.path()).output().expect("it runs")
    };
    let full = limited(16);
    assert_eq!(full.status.code(), Some(3), "{}", String::from_utf8_lossy(&full.stderr));
    assert!(String::from_utf8_lossy(&full.stderr).contains("cannot write"));
    assert_eq!(place.run("full", &[]), whole);
}

#[test]
fn a_replay_has_the_same_hash_and_the_worst_flights_have_recordings() {
    let place = Place::of(&SPEC.replace("runs = 60", "runs = 6"));
    let ran = place.campaign(&["run", "spec.toml", "--out", "camp", "--worst", "2", "--no-snapshots"]);
    assert!(ran.out.contains("an hour") && ran.out.contains("displacement"), "{}{}", ran.out, ran.err);
    let answer = json(&fs::read(place.path("camp/campaign.json")).expect("an answer"));
    let worst = &answer["laws"][0]["worst"][0];
    let run = worst["run"].to_string();
    let again = ["replay", "camp", "--run", &run, "--law", "edge-tension", "--out", "again", "--no-snapshots"];
    let again = place.campaign(&again);
    assert!(again.out.contains(worst["state_hash"].as_str().expect("a hash")), "{}{}", again.out, again.err);
    let page = fs::read_to_string(place.path("camp/campaign.html")).expect("a page");
    for part in ["flights violated", "tautline run pentagon --set", "worst/", "Over law.delta_m", "<svg"] {
        assert!(page.contains(part), "{part}");
    }
    let recordings = fs::read_dir(place.path("camp/worst")).expect("flown again");
    assert_eq!(
        recordings.filter(|entry| entry.as_ref().is_ok_and(|entry| entry.path().join("run.mcap").exists())).count(),
        2
    );
    // More runs have other worst flights. Folders of replays and of other programs stay.
    let replayed = (0..6).find(|run| !place.path(&format!("camp/worst/edge-tension-run-{run}")).exists());
    let replayed = replayed.expect("a run").to_string();
    place.campaign(&["replay", "camp", "--run", &replayed, "--law", "edge-tension", "--no-snapshots"]);
    fs::create_dir(place.path("camp/worst/notes")).expect("a folder");
    let chosen = fs::read_dir(place.path("camp/worst")).expect("flights").filter_map(Result::ok);
    let chosen = chosen.map(|entry| entry.path()).find(|path| path.join(".chosen-by-campaign").exists());
    let former = place.path("camp/worst/edge-tension-run-99");
    fs::rename(chosen.expect("a chosen flight"), &former).expect("renamed");
    fs::write(place.path("spec.toml"), SPEC.replace("runs = 60", "runs = 40")).expect("written");
    let raised = place.campaign(&["run", "spec.toml", "--out", "camp", "--worst", "2", "--no-snapshots"]);
    assert!(matches!(raised.exit, Some(0 | 1)), "{}", raised.err);
    let answer = json(&fs::read(place.path("camp/campaign.json")).expect("an answer"));
    let mut kept = vec!["notes".to_owned(), format!("edge-tension-run-{replayed}")];
    for law in answer["laws"].as_array().expect("laws") {
        let name = law["name"].as_str().expect("a name");
        kept.extend(
            law["worst"].as_array().expect("flights").iter().map(|flight| format!("{name}-run-{}", flight["run"])),
        );
    }
    assert!(!former.exists(), "run 99 is not among the worst flights");
    for entry in fs::read_dir(place.path("camp/worst")).expect("flown again") {
        let name = entry.expect("an entry").file_name().into_string().expect("a name");
        assert!(kept.contains(&name), "{name} is not among the worst flights: {kept:?}");
    }
    for name in &kept[..2] {
        assert!(place.path(&format!("camp/worst/{name}")).exists(), "{name}");
    }
    // The command on the page flies the same bits.
    let report = fs::read(place.path("again/report.json")).expect("a report");
    assert_eq!(json(&report)["run"]["state_hash"], worst["state_hash"]);
}

#[test]
fn wrong_input_is_refused_with_key_and_remedy() {
    let refused = |spec: &str, code: &str| {
        let place = Place::of(spec);
        let ran = place.campaign(&["run", "spec.toml", "--out", "camp"]);
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{spec}: {}", ran.err);
        assert!(ran.err.contains("help:") && !place.path("camp").exists(), "{spec}: {}", ran.err);
    };
    let vary = |vary: &str| format!("scenario = \"pentagon\"\nruns = 10\n[vary]\n{vary}\n");
    let jitter = "start.jitter_m = { uniform = [0.0, 0.1] }";
    for (spec, code) in [
        ("scenario = \"pentagon\"\nrums = 10", "campaign/specification"),
        ("scenario = \"pentagan\"\nruns = 10", "scenario/not-found"),
        ("scenario = \"pentagon\"\nruns = 10", "campaign/plan"),
        (&format!("scenario = \"pentagon\"\n[vary]\n{jitter}"), "campaign/plan"),
        (&vary("start.jiter_m = { uniform = [0.0, 0.1] }"), "scenario/unknown-key"),
        (&vary("start.jitter_m = { uniform = [0.2, 0.1] }"), "campaign/variation"),
        (&vary("swarm.a22_per_s = { list = [-1.0, \"fast\"] }"), "scenario/wrong-type"),
        (&vary("law.alpha = { grid = [1.0, 2.0, 3.0] }"), "campaign/plan"),
        ("scenario = \"pentagon\"\nruns = 10\nlaws = [\"edge-tensoin\"]", "scenario/unknown-choice"),
        (&format!("{}[stop]\nwidth = 1.5", vary(jitter)), "campaign/plan"),
        (&format!("{SPEC}law.kind = {{ list = [\"orca\", \"potential\"] }}"), "campaign/plan"),
        (&vary("start.seed = \"run\""), "campaign/plan"),
        (&vary("noise.seed = \"run\""), "campaign/plan"),
        (&vary("law.alpha = { list = [2.0, 2.0] }"), "campaign/plan"),
    ] {
        refused(spec, code);
    }
    let place = Place::of(SPEC);
    for (arguments, code) in [
        (&["shard", "nowhere", "--shard", "0"][..], "campaign/other-campaign"),
        (&["run", "nowhere.toml"], "campaign/cannot-read"),
        (&["plan", "spec.toml", "--out", "camp", "--shards", "61"], "campaign/plan"),
    ] {
        let ran = place.campaign(arguments);
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{arguments:?}: {}", ran.err);
    }
    assert_eq!(place.campaign(&["plan", "spec.toml", "--out", "camp", "--shards", "3"]).exit, Some(0));
    for (arguments, code) in [
        (&["shard", "camp", "--shard", "3"][..], "campaign/plan"),
        (&["shard", "camp", "--shard", "env:TAUTLINE_NO_SUCH"], "campaign/plan"),
        (&["replay", "camp", "--run", "60"], "campaign/no-run"),
        (&["replay", "camp", "--run", "0", "--law", "orca"], "campaign/unknown-law"),
        (&["merge", "camp"], "campaign/missing-shards"),
    ] {
        let ran = place.campaign(arguments);
        assert_eq!((ran.exit, ran.code()), (Some(2), code), "{arguments:?}: {}", ran.err);
    }
}

#[test]
fn missing_runs_and_bounds_of_keys_have_their_place() {
    let refused = |spec: &str| {
        let ran = Place::of(spec).campaign(&["run", "spec.toml", "--worst", "0"]);
        assert_eq!(ran.exit, Some(2), "{}", ran.err);
        ran.err
    };
    let runs = refused("scenario = 'pentagon'\n[vary]\n'start.jitter_m' = { uniform = [0.0, 0.1] }\n");
    assert!(runs.contains("spec.toml:1:1") && runs.contains("runs: missing key"), "{runs}");
    let scenario = refused("scenario = 'pentagn'\nruns = 2\n");
    assert!(scenario.contains("spec.toml:1:1") && scenario.contains("scenario: `pentagn` is neither"), "{scenario}");
    let loss = "scenario = 'pentagon'\nruns = 3\n[set]\nnetwork.rate_hz = 50\ntime.duration_s = 1\n[vary]\n\
                'network.loss' = { uniform = [0.0, 1.5] }\n";
    let loss = refused(loss);
    assert!(loss.contains("spec.toml:7:1") && loss.contains("network.loss = 1.5"), "{loss}");
    assert!(loss.contains("scenario/out-of-range"), "{loss}");
}

#[test]
fn a_campaign_with_most_draws_refused_exits_with_1() {
    let near = "[start]\npositions_m = [[0.0, 0.0], [1.02, 0.0]]\n[formation]\nshape = 'line'\nspacing_m = 3.0\n\
                [law]\nkind = 'displacement'\ndelta_m = 1.0\n[time]\nduration_s = 1\n";
    let spec = |widest: f64| {
        let place = Place::of(&format!(
            "scenario = 'near.toml'\nruns = 40\n[vary]\n'start.positions_m.2.x' = {{ uniform = [0.5, {widest:?}] }}\n"
        ));
        fs::write(place.path("near.toml"), near).expect("written");
        place.campaign(&["run", "spec.toml", "--worst", "0"])
    };
    let mostly = spec(1.2);
    assert_eq!(mostly.exit, Some(1), "{}", mostly.err);
    let said = mostly.out + &mostly.err;
    assert!(said.contains("MOST DRAWS REFUSED") && said.contains("narrow [vary]"), "{said}");
    let rarely = spec(5.0);
    assert_eq!(rarely.exit, Some(0), "{}", rarely.err);
    assert!(!rarely.out.contains("MOST DRAWS REFUSED"), "{}", rarely.out);
}

#[test]
fn journals_of_other_campaigns_and_changed_rows_are_ignored() {
    let place = Place::of(SPEC);
    let whole = place.run("whole", &["--shards", "1"]);
    let killed = |out: &str| {
        let mut child = Command::new(TAUTLINE)
            .args(["campaign", "run", "spec.toml", "--out", out, "--shards", "1", "--worst", "0", "--quiet"])
            .current_dir(place.0.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("it starts");
        let parts = place.path(out).join("parts");
        let journal = || {
            let entries = fs::read_dir(&parts).ok()?.flatten().map(|entry| entry.path());
            entries.into_iter().find(|path| path.extension().is_some_and(|kind| kind == "journal"))
        };
        let has_rows = || journal().is_some_and(|path| fs::read(path).is_ok_and(|bytes| bytes.len() > 4000));
        let began = Instant::now();
        while !has_rows() && child.try_wait().expect("it is ours").is_none() {
            assert!(began.elapsed() < PATIENCE, "the journal of {out} does not grow");
            std::thread::sleep(Duration::from_millis(5));
        }
        child.kill().expect("it can be killed");
        child.wait().expect("it ends");
        journal().expect("what it flew")
    };
    // Rows of this campaign, one of them changed, beside rows of another seed.
    let changed = killed("changed");
    let text = fs::read_to_string(&changed).expect("rows");
    fs::write(&changed, text.replacen("\"outcome\":\"clear\"", "\"outcome\":\"violated\"", 1)).expect("written");
    fs::write(place.path("spec.toml"), SPEC.replace("seed = 5", "seed = 6")).expect("written");
    let foreign = killed("foreign");
    fs::copy(&foreign, changed.with_file_name("shard-000000000.foreign.journal")).expect("copied");
    fs::write(place.path("spec.toml"), SPEC).expect("written");
    assert_eq!(place.run("changed", &[]), whole);
}

#[test]
fn a_file_named_like_a_built_in_scenario_is_repeated_by_its_path() {
    let place =
        Place::of("scenario = \"cases/pentagon\"\nruns = 2\n[vary]\nstart.jitter_m = { uniform = [0.0, 0.1] }\n");
    fs::create_dir(place.path("cases")).expect("a folder");
    let pentagon = ran_by(TAUTLINE, place.0.path(), &["list", "--show", "pentagon"]).out;
    fs::write(place.path("cases/pentagon"), pentagon.replace("duration_s = 120", "duration_s = 2")).expect("written");
    let ran = place.campaign(&["run", "spec.toml", "--out", "camp", "--worst", "1", "--no-snapshots"]);
    assert_eq!(ran.exit, Some(0), "{}", ran.err);
    let page = fs::read_to_string(place.path("camp/campaign.html")).expect("a page");
    assert!(page.contains("cases/pentagon --set") && !page.contains("tautline run pentagon"), "{page}");
    // Existing results are not overwritten.
    fs::create_dir(place.path("mine")).expect("a folder");
    fs::write(place.path("mine/results.parquet"), "mine").expect("written");
    let refused = place.campaign(&["run", "spec.toml", "--out", "mine"]);
    assert!(refused.exit == Some(2) && refused.err.contains("results.parquet"), "{}", refused.err);
    assert_eq!(fs::read_to_string(place.path("mine/results.parquet")).expect("kept"), "mine");
}

#[test]
fn points_of_a_grid_have_no_interval() {
    let place = Place::of(
        "scenario = \"pentagon\"\n[set]\ntime.duration_s = 1.0\n[vary]\nlaw.alpha = { grid = [0.5, 1.0, 2.0] }\n",
    );
    let answer = json(&place.run("camp", &[])[1]);
    let violated = &answer["laws"][0]["violated"];
    assert_eq!((&answer["intervals"], &violated["high"]), (&Value::from("exact"), &Value::from(0.0)));
    let said = place.campaign(&["report", "camp", "--worst", "0"]).out;
    assert!(said.contains("all points of the grid") && !said.contains("95 % confidence"), "{said}");
}

/// Two vehicles approach each other up to 1.3 m and oscillate. Errors of measurement decide whether they come below 1
/// m: 43 % of 20,000 flights do.
const RARE: &str = r#"
    scenario = "pair.toml"
    runs = 4
    seed = 3
    method = "splitting"
    [splitting]
    flights = 20
    kill = 5
    keep = 2
"#;
const PAIR: &str = r#"
    formation = { shape = "points", points_m = [[0.0, 0.0], [1.3, 0.0]] }
    start = { positions_m = [[0.0, 0.0], [3.0, 0.0]] }
    law = { kind = "laplacian", delta_m = 1.0 }
    sensing = { position_noise_m = 0.12, rate_hz = 10.0 }
    time = { duration_s = 6.0, dt_s = 0.02 }
    arrival = { hold_s = 1.0 }
"#;

#[test]
fn rare_violations_are_estimated_and_replayed_with_the_same_state() {
    let place = Place::of(RARE);
    fs::write(place.path("pair.toml"), PAIR).expect("written");
    let whole = place.run("one", &["--shards", "1", "--threads", "1"]);
    assert_eq!(place.run("four", &["--shards", "4", "--threads", "2"]), whole);
    let answer = json(&whole[1]);
    let law = &answer["laws"][0];
    let probability = law["splitting"]["probability"]["value"].as_f64().expect("a probability");
    assert!(probability > 0.15 && probability < 0.8, "{answer}");
    let bad = &law["bad"][0];
    let (run, number) = (bad["run"].to_string(), bad["bad"].to_string());
    let again = place.campaign(&["replay", "one", "--run", &run, "--bad", &number, "--out", "again"]);
    assert_eq!(again.exit, Some(1), "{}", again.err);
    assert!(again.out.contains(bad["state_hash"].as_str().expect("a hash")), "{}", again.out);
    // The audit of the recording finds the violation of the run.
    let audit = ran_by(TAUTLINE, place.0.path(), &["audit", "again/run.mcap"]);
    assert_eq!(audit.exit, Some(1), "{}{}", audit.out, audit.err);
    let page = place.campaign(&["report", "one", "--worst", "1"]);
    assert_eq!(page.exit, Some(1), "estimates exit with 1");
    assert!(page.out.contains("probability of a violation "), "{}", page.out);
    let none = place.campaign(&["replay", "one", "--run", "0", "--bad", "7"]);
    assert!(none.exit == Some(2) && none.err.contains("no violated flight 7"), "{}", none.err);
    // Without randomness from step to step, two flights from one state are the same.
    fs::write(place.path("pair.toml"), PAIR.replace("position_noise_m = 0.12, ", "")).expect("written");
    let still = place.campaign(&["run", "spec.toml", "--out", "still"]);
    assert!(still.exit == Some(2) && still.err.contains("random from step to step"), "{}{}", still.out, still.err);
}

#[test]
fn random_orders_of_starts_include_all_orders() {
    let spec = "scenario = \"pentagon\"\nruns = 40\n[set]\ntime.duration_s = 0.05\narrival.hold_s = 0.02\n\
                start.shuffle = true\n";
    let place = Place::of(spec);
    let answer = json(&place.run("camp", &[])[1]);
    assert_eq!(answer["laws"][0]["violated"]["of"], Value::from(40), "{answer}");
    let rows = place.parts("camp").iter().map(|part| fs::read_to_string(part).expect("a part")).collect::<String>();
    let mut flown: Vec<_> = rows
        .lines()
        .filter_map(|line| json(line.as_bytes())["flight"]["scenario_sha256"].as_str().map(str::to_owned))
        .collect();
    flown.sort();
    flown.dedup();
    assert!(flown.len() > 20, "{} different starts of 40", flown.len());
}
