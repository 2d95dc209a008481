//! Looks up values in the JSON of `run` and `audit`. A missing key fails the test.

#![allow(dead_code, reason = "not every program that shares this uses each function")]

use serde_json::Value;

/// Part of a question: separations of vehicles, and their distances from obstacles.
pub(crate) const SEPARATION: &str = "separation";

/// Returns the value at a path of keys such as `/certificate/separation_m`.
pub(crate) fn at<'a>(value: &'a Value, path: &str) -> &'a Value {
    value.pointer(path).unwrap_or_else(|| panic!("no {path}: {value}"))
}

/// Returns the number at a path of keys.
pub(crate) fn number(value: &Value, path: &str) -> f64 {
    at(value, path).as_f64().unwrap_or_else(|| panic!("{path} is no number: {value}"))
}

/// Returns the list at a path of keys.
pub(crate) fn list<'a>(value: &'a Value, path: &str) -> &'a [Value] {
    at(value, path).as_array().unwrap_or_else(|| panic!("{path} is no list: {value}"))
}

/// Returns the names of the answered parts.
pub(crate) fn parts(report: &Value) -> Vec<&str> {
    list(report, "/answers").iter().map(|answer| answer["part"].as_str().expect("a name")).collect()
}

/// Returns the answer to a part of the question, such as `separation` or `speed_m_s`.
pub(crate) fn part<'a>(report: &'a Value, name: &str) -> &'a Value {
    let answers: Vec<_> = list(report, "/answers").iter().filter(|answer| answer["part"] == name).collect();
    assert_eq!(answers.len(), 1, "answers to {name}: {}", report["answers"]);
    answers[0]
}

/// Returns the status of the answer to a part.
pub(crate) fn status<'a>(report: &'a Value, name: &str) -> &'a str {
    at(part(report, name), "/status").as_str().expect("a status")
}

/// Returns the closest approach of two vehicles or, without one, of a vehicle and an obstacle.
pub(crate) fn closest(report: &Value) -> &Value {
    at(part(report, SEPARATION), "/closest/0")
}

/// Returns the closest approach of a vehicle and an obstacle.
pub(crate) fn closest_obstacle(report: &Value) -> &Value {
    let obstacles = list(report, "/question/obstacles");
    let mut closest = list(part(report, SEPARATION), "/closest").iter();
    closest.find(|found| obstacles.contains(&found["subjects"][1])).unwrap_or_else(|| panic!("no obstacle: {report}"))
}

/// Returns the lower bound of the smallest separation, in the unit of the question.
pub(crate) fn least(report: &Value) -> f64 {
    number(closest(report), "/value/lower")
}

/// Returns the listed violations of separations. All of them must be listed.
pub(crate) fn violations(report: &Value) -> &[Value] {
    let found = at(part(report, SEPARATION), "/violations");
    let listed = list(found, "/listed");
    assert_eq!((found["count"].as_u64(), &found["is_exact"]), (Some(listed.len() as u64), &true.into()), "{found}");
    listed
}

/// Returns the codes of the reasons against a pass.
pub(crate) fn reasons(report: &Value) -> Vec<&str> {
    list(report, "/reasons").iter().map(|reason| reason["code"].as_str().expect("a code")).collect()
}

/// Returns the reason with this code.
pub(crate) fn reason<'a>(report: &'a Value, code: &str) -> &'a Value {
    let mut reasons = list(report, "/reasons").iter();
    reasons.find(|reason| reason["code"] == code).unwrap_or_else(|| panic!("no {code}: {}", report["reasons"]))
}

/// Returns the codes of the warnings with which the check refuses a flight; none if it does not.
pub(crate) fn refusals(report: &Value) -> Vec<&str> {
    if !reasons(report).contains(&"refused") {
        return Vec::new();
    }
    let warnings = list(reason(report, "refused"), "/data/warnings").iter();
    warnings.map(|code| code.as_str().expect("a code")).collect()
}

/// Returns the facts of a kind, such as `motion`.
pub(crate) fn facts<'a>(report: &'a Value, kind: &str) -> Vec<&'a Value> {
    list(report, "/facts").iter().filter(|fact| fact["fact"] == kind).collect()
}

/// Returns the motion between samples that the answers rest on, such as `straight`.
pub(crate) fn motion(report: &Value) -> &str {
    let facts = facts(report, "motion");
    assert_eq!(facts.len(), 1, "{}", report["facts"]);
    facts[0]["value"].as_str().expect("a name")
}
