//! Table of margins in docs/studies.md: how much of each imperfection five points and five Crazyflies survive.

use tautline::margin::{Margin, Options, Range};
use tautline::request::{ScenarioRequest, Silent};
use tautline::studies::{Criterion, StudyRequest, answer};

/// One imperfection: name, key, first and last value, runs of each value, further settings.
struct Row {
    what: &'static str,
    key: &'static str,
    from: f64,
    to: f64,
    logarithmic: bool,
    runs: u64,
    sets: &'static [&'static str],
}

const ROWS: [Row; 7] = [
    Row::of("own and received states are late", "sensing.latency_s", [0.0, 1.0]),
    Row::of("received states are late", "network.latency_s", [0.0, 4.0]).with(&["network.rate_hz=50"]),
    Row::of("messages are lost, twenty in a row", "network.loss", [0.0, 0.95])
        .with(&["network.rate_hz=50", "network.loss_burst=20"])
        .runs(3),
    Row::of("commands are held", "time.control_hz", [100.0, 0.25]).by_ratio(),
    Row::of("acceleration is limited", "actuation.max_accel_m_s2", [1.0, 0.002]).by_ratio(),
    Row::of("positions are measured with noise", "sensing.position_noise_m", [1e-4, 0.4])
        .with(&["sensing.rate_hz=100"])
        .by_ratio()
        .runs(3),
    Row::of("each vehicle has a turbulence of its own", "wind.dryden.speed_20ft_m_s", [0.1, 20.0])
        .with(&["wind.dryden={speed_20ft_m_s=0.1, height_m=6}", "wind.shared=false"])
        .by_ratio()
        .runs(3),
];

/// Points with the drag of a Crazyflie over its mass, and Crazyflies.
const VEHICLES: [(&str, &[&str]); 2] =
    [("points", &["vehicle.model=point", "vehicle.drag_per_s=0.448"]), ("Crazyflies", &["vehicle.model=crazyflie"])];
const SCAN: usize = 3;
const HALVINGS: u32 = 4;
const DIGITS: usize = 3;

impl Row {
    const fn of(what: &'static str, key: &'static str, [from, to]: [f64; 2]) -> Self {
        Self { what, key, from, to, logarithmic: false, runs: 1, sets: &[] }
    }

    const fn with(self, sets: &'static [&'static str]) -> Self {
        Self { sets, ..self }
    }

    const fn runs(self, runs: u64) -> Self {
        Self { runs, ..self }
    }

    const fn by_ratio(self) -> Self {
        Self { logarithmic: true, ..self }
    }

    fn margin(&self, vehicle: &[&str], question: Criterion) -> Margin {
        let sets: Vec<_> = self.sets.iter().chain(vehicle).map(|&set| set.to_owned()).collect();
        let Self { from, to, logarithmic, runs, .. } = *self;
        let range = Range { from, to, scan: SCAN, halvings: HALVINGS, logarithmic };
        let options = Options { key: self.key.to_owned(), range, question, runs, seed: 0 };
        let request = StudyRequest::new(ScenarioRequest::named("crazyflies", &sets).expect("a scenario"), options);
        let margin = answer(&request, &(), &Silent::default());
        margin.unwrap_or_else(|error| panic!("{}: {error}", self.key)).expect("not interrupted")
    }

    fn cell(&self, margin: &Margin) -> String {
        let number = |value: f64| format!("{value:.*e}", DIGITS - 1).parse::<f64>().map_or(value, |rounded| rounded);
        match margin.sides() {
            Some([holds, fails]) => format!("{}, not {}", number(holds.value), number(fails.value)),
            None if margin.holds_everywhere() => format!("{}", self.to),
            None => format!("not {}", self.from),
        }
    }
}

/// Returns the cells of a key for one kind of vehicle: values that stay clear, and values that pass.
#[allow(dead_code, reason = "not every program that shares this asks for a part")]
pub(crate) fn cells(key: &str, vehicles: usize) -> Option<[String; 2]> {
    let row = ROWS.iter().find(|row| row.key == key)?;
    Some([Criterion::Clear, Criterion::Pass].map(|question| row.cell(&row.margin(VEHICLES[vehicles].1, question))))
}

/// Returns the table in Markdown, a row for each imperfection.
pub(crate) fn table() -> String {
    let headings = VEHICLES.map(|(vehicles, _)| format!("{vehicles} stay clear | {vehicles} pass"));
    let line = |row: &Row| {
        let cells = VEHICLES.iter().flat_map(|(_, vehicle)| {
            [Criterion::Clear, Criterion::Pass].map(|question| row.cell(&row.margin(vehicle, question)))
        });
        format!("| {} | `{}` | {} |\n", row.what, row.key, cells.collect::<Vec<_>>().join(" | "))
    };
    let head = format!("| imperfection | key | {} |\n| --- | --- | --- | --- | --- | --- |\n", headings.join(" | "));
    head + &ROWS.iter().map(line).collect::<String>()
}
