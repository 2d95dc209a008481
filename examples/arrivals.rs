//! Prints the table of arrivals, which docs/shield.md shows in part: laws without and under the shield, and behind a
//! radio that loses messages, from random starts of several kinds. Then arrivals with short ranges of the radio.
//!
//! `cargo run --release --example arrivals [RUNS [LAW...]]`, 20 runs of each law by default.

use tautline::compare::{LawRow, Options};
use tautline::request::{ScenarioRequest, Silent};
use tautline::scenario::Source;
use tautline::studies::{StudyRequest, answer};

/// Kind of a flight: its name and the tables of its scenario.
struct Kind {
    name: String,
    tables: String,
}

/// Laws that steer each vehicle to its slot; `braking` is a variant of `cbf-qp`.
const LAWS: [&str; 6] = ["laplacian", "displacement", "orca", "bvc", "cbf-qp", "braking"];
/// Common tables: 60 s with commands up to 5 m/s^2 in steps of a quarter of the shield's period.
const COMMON: &str = "
    [law]
    kind = \"displacement\"
    delta_m = 1.0
    [laws.braking]
    kind = \"cbf-qp\"
    variant = \"braking\"
    [time]
    duration_s = 60
    dt_s = 0.0125
    record_hz = 4
    [arrival]
    edge_error_m = 0.1
    disagreement_m_s = 0.2
    [actuation]
    max_accel_m_s2 = 5.0
";
/// Radio with latency and with losses in bursts.
const RADIO: [&str; 1] = ["network={rate_hz=20, latency_s=0.1, loss=0.3, loss_burst=3}"];

/// Ranges of the radio \[m\], each with the largest number of hops of a message.
const RANGES: [(u32, u32); 5] = [(40, 1), (15, 1), (10, 1), (10, 8), (7, 8)];

/// Vehicles on a circle that change places with those opposite, with a jitter of 0.1 m.
fn circle(count: usize, radius_m: f64) -> Kind {
    let tables = format!(
        "[swarm]\ncount = {count}\n[start]\nshape = \"circle\"\nradius_m = {radius_m}\njitter_m = 0.1\n\
         [formation]\nshape = \"circle\"\nradius_m = {radius_m}\nyaw_deg = 180\n"
    );
    Kind { name: format!("circle of {count}"), tables }
}

/// Random starts at least 2.4 m apart, to a grid whose slots have no relation to the starts.
fn random(count: usize, spacing_m: f64, half_extent_m: f64, dimensions: usize) -> Kind {
    let shape = if dimensions == 2 { "grid" } else { "cube" };
    let tables = format!(
        "[swarm]\ncount = {count}\ndimensions = {dimensions}\n[start]\nshape = \"random\"\nhalf_extent_m = \
         {half_extent_m}\nmin_separation_m = 2.4\n[formation]\nshape = \"{shape}\"\nspacing_m = {spacing_m}\n"
    );
    let place = if dimensions == 2 { "" } else { ", in space" };
    Kind { name: format!("random, {count} to slots {spacing_m} m apart{place}"), tables }
}

/// The same with vehicles that may take each other's slots.
fn interchangeable(kind: &Kind) -> Kind {
    let tables = kind.tables.replace("[formation]\n", "[formation]\nassignment = \"optimal\"\n");
    Kind { name: format!("{}, optimal assignment", kind.name), tables }
}

/// Two groups that change sides, through each other or through a gap between two walls.
fn groups(gap_m: Option<f64>) -> Kind {
    let rows = |x: f64| (0..8).map(|k| [x + 2.0 * f64::from(k / 4), 2.0 * f64::from(k % 4) - 3.0]).collect::<Vec<_>>();
    let left: Vec<_> = rows(-8.0).into_iter().chain(rows(6.0)).collect();
    let right: Vec<_> = rows(6.0).into_iter().chain(rows(-8.0)).collect();
    let start = format!(
        "[start]\npositions_m = {left:?}\njitter_m = 0.2\n[formation]\nshape = \"points\"\npoints_m = {right:?}\n"
    );
    let wall = |(name, side): (&str, f64)| {
        let centre_m = side * (0.5 * gap_m.unwrap_or_default() + 5.0);
        format!(
            "[[obstacle]]\nname = \"{name}\"\nbox = {{ size_m = [1.0, 10.0, 4.0] }}\nat_m = [0.0, {centre_m}, 0.0]\n\
             clearance_m = 0.5\n"
        )
    };
    let walls = gap_m.iter().flat_map(|_| [("upper wall", 1.0), ("lower wall", -1.0)]).map(wall);
    let tables = std::iter::once(start).chain(walls).collect();
    let name =
        gap_m.map_or_else(|| "two groups of 8".to_owned(), |gap_m| format!("the same through a gap of {gap_m} m"));
    Kind { name, tables }
}

fn kinds() -> Vec<Kind> {
    vec![
        circle(2, 4.0),
        circle(6, 4.0),
        circle(12, 6.0),
        circle(24, 10.0),
        random(10, 2.4, 7.0, 2),
        random(20, 2.4, 10.0, 2),
        random(20, 1.5, 10.0, 2),
        interchangeable(&random(20, 1.5, 10.0, 2)),
        random(20, 2.4, 5.0, 3),
        groups(None),
        groups(Some(6.0)),
        groups(Some(4.0)),
    ]
}

/// Returns the rows of laws from the starts of a kind.
fn compared(kind: &Kind, laws: &[String], sets: &[&str], runs: u64) -> Vec<LawRow> {
    let source = Source::Text { name: "arrivals".to_owned(), text: format!("{}{COMMON}", kind.tables) };
    let overrides = sets.iter().map(|&set| set.to_owned()).collect();
    let scenario = ScenarioRequest { argument: "arrivals".to_owned(), source, overrides, external_law: None };
    let options = Options { laws: Some(laws.to_vec()), runs, ..Options::default() };
    let request = StudyRequest::new(scenario, options);
    let comparison = answer(&request, &(), &Silent::default());
    comparison.unwrap_or_else(|error| panic!("{}: {error}", kind.name)).expect("not interrupted").laws
}

/// Returns a number of each law, in their order.
fn cell(rows: &[LawRow], number: impl Fn(&LawRow) -> String) -> String {
    rows.iter().map(number).collect::<Vec<_>>().join(" / ")
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let runs = arguments.next().and_then(|runs| runs.parse().ok()).unwrap_or(20);
    let named: Vec<_> = arguments.collect();
    let laws = if named.is_empty() { LAWS.map(str::to_owned).to_vec() } else { named };
    let median = |row: &LawRow| row.reached_median_s.value.map_or("-".to_owned(), |at_s| format!("{at_s:.0}"));
    println!("Of {runs} flights each, under {}:\n", laws.join(" / "));
    let columns = ["bare: violate", "shield: violate", "bare: reach", "shield: reach", "median [s]", "radio: reach"];
    println!("| start | {} | median [s] |", columns.join(" | "));
    println!("| --- | --- | --- | --- | --- | --- | --- | --- |");
    for kind in kinds() {
        let named = |ending: &str| laws.iter().map(|law| format!("{law}{ending}")).collect::<Vec<_>>();
        let bare = compared(&kind, &named("+bare"), &[], runs);
        let shield = compared(&kind, &named("+shield"), &[], runs);
        let radio = compared(&kind, &named("+shield"), &RADIO, runs);
        let violated: u64 = shield.iter().chain(&radio).map(|row| row.violated.count).sum();
        println!(
            "| {} | {} | {violated} | {} | {} | {} | {} | {} |",
            kind.name,
            cell(&bare, |row| row.violated.count.to_string()),
            cell(&bare, |row| row.reached.count.to_string()),
            cell(&shield, |row| row.reached.count.to_string()),
            cell(&shield, median),
            cell(&radio, |row| row.reached.count.to_string()),
            cell(&radio, median),
        );
    }
    ranges(runs);
}

/// Prints how many flights of 20 vehicles under `cbf-qp` and the shield arrive with a range of the radio.
fn ranges(runs: u64) {
    println!("\nReached by cbf-qp under the shield, {}:\n", random(20, 2.4, 10.0, 2).name);
    println!("| range [m] | hops | reach | median [s] |\n| --- | --- | --- | --- |");
    for (range_m, hops) in RANGES {
        let radio = format!("network={{rate_hz=20, range_m={range_m}, relay_hops={hops}}}");
        let rows = compared(&random(20, 2.4, 10.0, 2), &["cbf-qp+shield".to_owned()], &[&radio], runs);
        let Some(row) = rows.first() else { continue };
        let median = row.reached_median_s.value.map_or("-".to_owned(), |at_s| format!("{at_s:.0}"));
        println!("| {range_m} | {hops} | {} of {runs} | {median} |", row.reached.count);
    }
}
