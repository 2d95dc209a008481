//! `tautline audit --plan`: flights against their plans, and curves of Bezier tables.

use std::fs;
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::program::{Ran, TAUTLINE, ran_by};
use crate::report::{facts, number, part, parts, status};

const HEADER: &str = "#duration,p0x,p0y,p0z,...\n";

/// Samples of both vehicles on their plans, each second, with the second one 0.1 m to the side in the middle.
const SAMPLES: &str = "t,id,x,y,z\n0,cf1,0,0,1\n0,cf2,0,1.5,1\n1.0,cf1,1,0,1\n1.0,cf2,1,1.5,1\n2.0,cf1,2,0,1\n\
                       2.0,cf2,2,1.6,1\n3.0,cf1,3,0,1\n3.0,cf2,3,1.5,1\n4.0,cf1,4,0,1\n4.0,cf2,4,1.5,1\n";

/// Returns a folder with a plan of two vehicles 1.5 m apart, and a flight in which the first swerves by 0.2 m between
/// two agreeing instants.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let straight = |y: &str| format!("{HEADER}4,0,{y},1,2,{y},1,4,{y},1\n");
    let swerve = format!("{HEADER}2,0,0,1,1,0.4,1,2,0,1\n2,2,0,1,3,0,1,4,0,1\n");
    for (name, text) in [
        ("plan/cf1.csv", straight("0")),
        ("plan/cf2.csv", straight("1.5")),
        ("flight/cf1.csv", swerve),
        ("flight/cf2.csv", straight("1.5")),
        ("other/cf1.csv", straight("0")),
        ("other/cf9.csv", straight("1.5")),
        ("samples.csv", SAMPLES.to_owned()),
    ] {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(path, text).expect("a file");
    }
    folder
}

fn audit(folder: &Path, arguments: &[&str]) -> Ran {
    ran_by(TAUTLINE, folder, &[&["audit"], arguments].concat())
}

fn json(folder: &Path, arguments: &[&str]) -> Value {
    serde_json::from_str(&audit(folder, &[arguments, &["--json"]].concat()).out).expect("JSON alone")
}

#[test]
fn curves_near_their_plan_are_proved_and_certified() {
    let folder = folder();
    let asked = ["flight", "--delta", "1", "--plan", "plan"];
    let ran = audit(folder.path(), &asked);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    assert!(ran.out.starts_with("PROVED CLEAR: never closer than 1.29"), "{ran:?}");
    for words in [
        "within 0.200001 m of the plan, cf1 at 1.00 s (delay 0.000 s estimated)",
        "the plan keeps delta + 2e, so the flight within e of it keeps delta (cf1 and cf2: 1.499999 m",
        "1.200001 m needed",
        "against the plan: plan, delay",
    ] {
        assert!(ran.out.contains(words), "{words}: {ran:?}");
    }
    let report = json(folder.path(), &asked);
    let plan = &report["plan"];
    assert_eq!((&plan["status"], &plan["certificate"]["holds"]), (&Value::from("clear"), &Value::from(true)));
    assert!((plan["vehicles"][0]["upper_m"].as_f64().expect("a number") - 0.2).abs() < 1e-8, "{plan}");
    assert_eq!((parts(&report), status(&report, "plan")), (vec!["separation", "plan"], "clear"));
    assert!((number(part(&report, "plan"), "/closest/0/value/upper") - 0.2).abs() < 1e-8, "{report}");
    assert!(plan["delay_s"].as_f64().expect("a number").abs() < 1e-5, "{plan}");
    let alone = json(folder.path(), &asked[..3]);
    assert_eq!(
        (&alone["plan"], &alone["question"]["plan"], parts(&alone)),
        (&Value::Null, &Value::Null, vec!["separation"])
    );
    // A plan that keeps less than delta + 2e certifies nothing; the verdict on the flight stands.
    let wide = audit(folder.path(), &[&asked[..], &["--tube", "0.26"]].concat());
    assert_eq!(wide.exit, Some(0), "{wide:?}");
    assert!(wide.out.starts_with("PROVED CLEAR") && wide.out.contains("does not keep delta + 2e"), "{wide:?}");
}

#[test]
fn a_flight_outside_of_its_tube_fails() {
    let folder = folder();
    let asked = ["flight", "--plan", "plan", "--plan-delay", "0", "--tube"];
    let kept = audit(folder.path(), &[&asked[..], &["0.21"]].concat());
    assert_eq!(kept.exit, Some(0), "{kept:?}");
    assert!(kept.out.starts_with("PROVED CLEAR: within 0.200001 m of the plan"), "{kept:?}");
    let outputs = ["0.15", "--junit", "j.xml", "--events", "e.csv", "--html", "p.html", "--figures", "svg"];
    let left = audit(folder.path(), &[&asked[..], &outputs].concat());
    assert_eq!(left.exit, Some(1), "{left:?}");
    assert!(left.out.starts_with("VIOLATION: cf1 is "), "{left:?}");
    assert!(left.out.contains("m from the plan at 1.00 s (tube 0.150 m, delay 0.000 s)"), "{left:?}");
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).expect("a file");
    assert!(read("j.xml").contains("failures=\"1\""), "{}", read("j.xml"));
    assert!(read("e.csv").contains("violation,cf1,plan,1.0"), "{}", read("e.csv"));
    assert!(read("p.html").contains("Distance from the plan"));
    assert!(read("p-figures/plan.svg").contains("tube 0.15 m"));
}

#[test]
fn samples_are_clear_only_under_their_assumption() {
    let folder = folder();
    let asked = ["samples.csv", "--delta", "1", "--plan", "plan", "--plan-delay", "0"];
    let ran = audit(folder.path(), &asked);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    assert!(ran.out.starts_with("CLEAR if straight between samples: "), "{ran:?}");
    assert!(ran.out.contains("within 0.100001 m of the plan, cf2 at 2.00 s"), "{ran:?}");
    // A plan of samples is an assumption too, also for a flight on curves.
    let swapped = audit(folder.path(), &["flight", "--plan", "samples.csv", "--plan-delay", "0"]);
    assert!(swapped.out.starts_with("CLEAR if the plan is straight between its samples: "), "{swapped:?}");
    // Bounded motion may leave the tube between its samples.
    let bounded = ["--motion", "bounded", "--max-accel", "0.5", "--tube"];
    let status = |tube| audit(folder.path(), &[&asked[..], &bounded, &[tube]].concat());
    let wide = status("0.2");
    assert!(wide.out.starts_with("PROVED CLEAR"), "{wide:?}");
    let narrow = status("0.12");
    assert_eq!(narrow.exit, Some(1), "{narrow:?}");
    assert!(narrow.out.starts_with("UNDECIDED: cf2 is between 0.099999 m and 0.162501 m"), "{narrow:?}");
    // A wrong delay is a large distance.
    let late = audit(folder.path(), &["samples.csv", "--plan", "plan", "--plan-delay", "0.5", "--tube", "0.3"]);
    assert!(late.exit == Some(1) && late.out.starts_with("VIOLATION: cf"), "{late:?}");
}

#[test]
fn an_assumption_of_the_plan_is_not_one_of_the_flight() {
    let rows = "0,a,0,0,0\n0,b,0,9,0\n1000,a,0,0,0\n1000,b,0,9,0\n";
    let folder = folder();
    for (name, time) in [("boot.csv", "time_boot_ms"), ("known.csv", "t_ms")] {
        fs::write(folder.path().join(name), format!("{time},id,x,y,z\n{rows}")).expect("a file");
    }
    let assumed = "the clocks of all vehicles started together";
    for (flight, plan, said, subjects) in [
        ("known.csv", "boot.csv", format!("between its samples and in the plan {assumed}: "), [Some("the plan")]),
        ("boot.csv", "known.csv", format!("CLEAR if straight between samples, {assumed} and the plan is "), [None]),
    ] {
        let asked = [flight, "--plan", plan, "--plan-delay", "0", "--tube", "1"];
        let ran = audit(folder.path(), &asked);
        assert!(ran.exit == Some(0) && ran.out.contains(&said), "{said}: {ran:?}");
        assert_eq!(ran.out.matches(assumed).count(), 1, "{ran:?}");
        let report = json(folder.path(), &asked);
        let found: Vec<_> = facts(&report, "common-start").iter().map(|fact| fact["subject"].as_str()).collect();
        assert_eq!((found.as_slice(), &report["proved"]), (&subjects[..], &Value::from(false)));
    }
}

#[test]
fn times_without_plan_or_flight_are_undecided() {
    let folder = folder();
    let late = ["samples.csv", "--plan", "plan", "--plan-delay", "-1.5"];
    let ran = audit(folder.path(), &late);
    assert_eq!(ran.exit, Some(1), "{ran:?}");
    assert!(
        ran.out.starts_with("UNDECIDED: the distance of cf1 from the plan is not known from -1.500 s to"),
        "{ran:?}"
    );
    assert!(ran.out.contains("no flight") && ran.out.contains("no plan"), "{ran:?}");
    let within = audit(folder.path(), &[&late[..], &["--from", "0", "--until", "2.5"]].concat());
    assert_eq!(within.exit, Some(0), "{within:?}");
}

#[test]
fn an_estimated_delay_limits_the_verdict_to_the_common_time() {
    let folder = folder();
    // The flight of `samples.csv`, 1.5 s later than its plan and without its first second.
    let late: String = SAMPLES
        .lines()
        .filter_map(|line| {
            let (time, rest) = line.split_once(',')?;
            let time: f64 = time.parse().ok().filter(|time| *time >= 1.0)?;
            Some(format!("{:?},{rest}\n", time + 1.5))
        })
        .collect();
    // Both vehicles then wait for 2 s at the end of their plans.
    let waiting = format!("t,id,x,y,z\n{late}7.5,cf1,4,0,1\n7.5,cf2,4,1.5,1\n");
    fs::write(folder.path().join("late.csv"), waiting).expect("a file");
    let asked = ["late.csv", "--delta", "1", "--plan", "plan", "--max-gap", "5"];
    let ran = audit(folder.path(), &asked);
    assert_eq!(ran.exit, Some(0), "{ran:?}");
    for words in [
        "of the plan from 2.500 s to 5.500 s, the common time of flight and plan, cf2 at",
        "keeps delta (cf1 and cf2:",
        "needed) in this time",
    ] {
        assert!(ran.out.contains(words), "{words}: {ran:?}");
    }
    let report = json(folder.path(), &asked);
    let [from_s, to_s] = [0, 1].map(|k| report["plan"]["common_s"][k].as_f64().expect("a time"));
    assert!((from_s - 2.5).abs() < 1e-9 && (to_s - 5.5).abs() < 1e-3, "{report}");
    // The claim about the whole flight, or about a given window, stays undecided.
    for window in [&["--plan-delay", "1.5"][..], &["--until", "7"]] {
        let whole = audit(folder.path(), &[&asked[..], window].concat());
        assert_eq!(whole.exit, Some(1), "{whole:?}");
        assert!(whole.out.starts_with("UNDECIDED: the distance of cf1") && whole.out.contains("no plan"), "{whole:?}");
    }
    // A large distance in the common time is found.
    let tube = audit(folder.path(), &[&asked[..], &["--tube", "0.05"]].concat());
    assert!(tube.exit == Some(1) && tube.out.starts_with("VIOLATION: cf2 is"), "{tube:?}");
    // A gap of the flight within the common time is undecided.
    let gap = audit(folder.path(), &["late.csv", "--delta", "1", "--plan", "plan", "--max-gap", "0.5"]);
    assert!(gap.exit == Some(1) && gap.out.starts_with("UNDECIDED"), "{gap:?}");
    // A short overlap is no common time: the plan ends where the flight begins.
    let after = "t,id,x,y,z\n0.5,cf1,4,0,1\n0.5,cf2,4,1.5,1\n9.25,cf1,4,0,1\n9.25,cf2,4,1.5,1\n";
    fs::write(folder.path().join("after.csv"), after).expect("a file");
    let short =
        audit(folder.path(), &["after.csv", "--time-unit", "s", "--delta", "1", "--plan", "plan", "--max-gap", "20"]);
    assert!(short.exit == Some(1) && short.out.starts_with("UNDECIDED: the distance of"), "{short:?}");
}

#[test]
fn wrong_questions_about_a_plan_are_refused() {
    let folder = folder();
    for (arguments, words) in [
        (
            &["flight", "--plan", "other"][..],
            &["other: the vehicles of the plan are cf1, cf9, those of flight are cf1, cf2", "--ids"][..],
        ),
        (&["flight", "--plan", "plan", "--tube", "0"], &["--tube: must be a finite number above 0, got 0.0"]),
        (&["flight", "--plan", "plan", "--plan-delay", "1e99"], &["--plan-delay: must be a finite number"]),
        (&["flight", "--delta", "1", "--tube", "0.1"], &["--plan"]),
        (&["flight", "--plan", "missing.skyc"], &["missing.skyc"]),
        (&["flight", "--plan", "plan", "--html", "plan/cf1.csv"], &["plan"]),
    ] {
        let ran = audit(folder.path(), arguments);
        assert_eq!(ran.exit, Some(2), "{ran:?}");
        assert!(words.iter().all(|words| ran.err.contains(words)), "{ran:?}");
    }
    let common = audit(folder.path(), &["flight", "--plan", "other", "--ids", "cf1"]);
    assert_eq!(common.exit, Some(0), "{common:?}");
}
