//! What came of it: `compare --json`.

use serde::Serialize;

use super::flight::{FlightRow, Outcome};
use super::plan::Plan;
use crate::statistics::{CONFIDENCE, Estimate, Proportion};
use tautline_report::report::{ScenarioIdentity, Tool};
use tautline_sim::scenario::NamedLaw;

/// Version of the keys of `compare --json`: raised when one is renamed, removed or changes its meaning.
pub const SCHEMA_VERSION: u32 = 1;

/// Laws side by side. Units are in the names; what does not apply is null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// The scenario as its file has it.
    pub scenario: ScenarioIdentity,
    /// What flew it.
    pub tool: Tool,
    /// Safety distance delta \[m\] that every flight was judged by.
    pub delta_m: f64,
    /// Starts under each law that are compared.
    pub runs: u64,
    /// Starts that were asked for.
    pub runs_asked: u64,
    /// `start.seed` of the first.
    pub seed: u64,
    /// Jitter along each axis that a start without randomness got \[m\].
    pub jitter_m: Option<f64>,
    /// How often an interval holds the true value.
    pub confidence: f64,
    /// A row a law, in the order in which they were named.
    pub laws: Vec<LawRow>,
    /// Wall-clock times, the only part that differs between two comparisons of the same.
    pub performance: Performance,
}

/// How a law fared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawRow {
    /// That of its kind, or of its table `[laws.NAME]`.
    pub name: String,
    /// Its kind.
    pub kind: String,
    /// The overrides that fly it, one for its kind and one for each key.
    pub overrides: Vec<String>,
    /// Flights to their end that were proved clear, both detectors agreeing.
    pub clear: Proportion,
    /// Flights with a violation.
    pub violated: Proportion,
    /// Flights without a violation that were not flown to their end.
    pub ended_early: u64,
    /// Flights that the judge could not tell about.
    pub undecided: u64,
    /// Flights, of any outcome, that `tautline check` refuses.
    pub refused: u64,
    /// Flights that reached the formation.
    pub reached: Proportion,
    /// Median of the time to reach it, over those that did \[s\].
    pub reached_median_s: Estimate,
    /// 95th percentile of that \[s\].
    pub reached_p95_s: Estimate,
    /// Smallest separation of all flights \[m\].
    pub min_smallest_m: Option<f64>,
    /// The seed of the flight that it was in.
    pub min_smallest_seed: Option<u64>,
    /// Median of the flights' smallest separations \[m\].
    pub min_median_m: Estimate,
    /// Mean path length, summed over the vehicles \[m\].
    pub path_length_mean_m: Estimate,
    /// Largest commanded acceleration of all flights \[m/s^2\].
    pub peak_control_largest_m_s2: Option<f64>,
    /// Median of the flights' largest commanded accelerations \[m/s^2\].
    pub peak_control_median_m_s2: Estimate,
    /// Mean integral of |u|, summed over the vehicles \[m/s\].
    pub total_control_mean_m_s: Estimate,
    /// A row a flight, in the order of their seeds.
    pub flights: Vec<FlightRow>,
}

/// Wall-clock times on the machine that flew.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Performance {
    /// From first to last flight \[s\].
    pub wall_s: f64,
    /// Of each law, in the order of the rows.
    pub laws: Vec<LawPerformance>,
}

/// Wall-clock time of a law.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawPerformance {
    /// The law's name.
    pub name: String,
    /// Time in the law over the steps of all its flights \[s\].
    pub law_step_s: Option<f64>,
}

impl Comparison {
    pub(super) fn new(plan: &Plan, flights: Vec<Vec<FlightRow>>, wall_s: f64) -> Self {
        let own = plan.template().own();
        let laws = plan.laws();
        let of_law = |(law, rows): (&NamedLaw, &Vec<FlightRow>)| LawPerformance {
            name: law.name.clone(),
            law_step_s: law_step_s(rows),
        };
        let performance = Performance { wall_s, laws: laws.iter().zip(&flights).map(of_law).collect() };
        Self {
            schema_version: SCHEMA_VERSION,
            scenario: ScenarioIdentity { name: own.name.clone(), sha256: own.sha256_hex() },
            tool: Tool { name: tautline_core::PROGRAM.to_owned(), version: tautline_core::VERSION.to_owned() },
            delta_m: own.delta_m,
            runs: flights.first().map_or(0, |rows| rows.len() as u64),
            runs_asked: plan.runs(),
            seed: plan.seed(0),
            jitter_m: plan.jitter_m(),
            confidence: CONFIDENCE,
            laws: laws.iter().zip(flights).map(|(law, rows)| LawRow::new(law, rows)).collect(),
            performance,
        }
    }

    /// `compare --json`.
    ///
    /// # Errors
    /// None in practice: every value has a JSON form.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|json| json + "\n")
    }
}

impl LawRow {
    fn new(law: &NamedLaw, flights: Vec<FlightRow>) -> Self {
        let of = flights.len() as u64;
        let count = |is: &dyn Fn(&FlightRow) -> bool| flights.iter().filter(|row| is(row)).count() as u64;
        let ended = |outcome: Outcome| count(&|row| row.outcome == outcome);
        let known = |of: fn(&FlightRow) -> Option<f64>| flights.iter().filter_map(of).collect::<Vec<_>>();
        let (reached_s, min_m) = (known(|row| row.reached_at_s.filter(|_| row.reached)), known(|row| row.min_m));
        let peak_m_s2 = known(|row| row.peak_control_m_s2);
        let worst = worst(&flights);
        Self {
            name: law.name.clone(),
            kind: law.kind(),
            overrides: law.overrides(),
            clear: Proportion::new(ended(Outcome::Clear), of),
            violated: Proportion::new(ended(Outcome::Violated), of),
            ended_early: ended(Outcome::EndedEarly),
            undecided: ended(Outcome::Undecided),
            refused: count(&|row| !row.refused.is_empty()),
            reached: Proportion::new(count(&|row| row.reached), of),
            reached_median_s: Estimate::quantile(&reached_s, 0.5),
            reached_p95_s: Estimate::quantile(&reached_s, 0.95),
            min_smallest_m: worst.and_then(|row| row.min_m),
            min_smallest_seed: worst.map(|row| row.seed),
            min_median_m: Estimate::quantile(&min_m, 0.5),
            path_length_mean_m: Estimate::mean(&known(|row| Some(row.path_length_m))),
            peak_control_largest_m_s2: peak_m_s2.iter().copied().reduce(f64::max),
            peak_control_median_m_s2: Estimate::quantile(&peak_m_s2, 0.5),
            total_control_mean_m_s: Estimate::mean(&known(|row| Some(row.total_control_m_s))),
            flights,
        }
    }

    /// The flight with the smallest separation, the first of several.
    #[must_use]
    pub fn worst(&self) -> Option<&FlightRow> {
        worst(&self.flights)
    }
}

fn worst(flights: &[FlightRow]) -> Option<&FlightRow> {
    let known = flights.iter().filter_map(|row| Some((row.min_m?, row)));
    known.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, row)| row)
}

fn law_step_s(flights: &[FlightRow]) -> Option<f64> {
    let steps: u64 = flights.iter().map(|row| row.steps).sum();
    (steps > 0).then(|| flights.iter().map(|row| row.law_s).sum::<f64>() / steps as f64)
}
