//! Answer of a campaign: the contents of `campaign.json`.

use serde::Serialize;

use super::flights::{Campaign, Law};
use super::shard::Row;
use super::tally::{Intervals, Tally, UpperBound};
use super::tally::{KeyColumn, Varied};
use crate::Criterion;
use crate::SCHEMA_VERSION;
use crate::flight::{FlightSummary, Outcome};
use crate::splitting::{Repetitions, Splitting};
use crate::statistics::{Estimate, Paired, Proportion};
use tautline_report::figures::Histogram;

/// Number of intervals of a histogram.
const HISTOGRAM_INTERVALS: usize = 30;
/// Number of worst flights that are kept.
const WORST: usize = 10;

/// Answer of a campaign. Inapplicable values are null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// SHA-256 that identifies the campaign.
    pub campaign: String,
    /// Name of the campaign.
    pub name: String,
    /// Name of the scenario.
    pub scenario: String,
    /// Number of runs that count.
    pub runs: u64,
    /// Number of planned runs.
    pub runs_planned: u64,
    /// Whether an early stop left runs out.
    pub stopped_early: bool,
    /// Kind of the intervals of shares.
    pub intervals: Intervals,
    /// Results of each law, in order.
    pub laws: Vec<LawSummary>,
    /// Each two laws, on the runs that both flew; empty if the number of runs was not fixed beforehand.
    pub pairs: Vec<Pair>,
    /// Results over each varied number.
    pub varied: Vec<Varied>,
}

/// Results of a law.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawSummary {
    /// Name of the law.
    pub name: String,
    /// Overrides that select the law, as `--set` takes them.
    pub overrides: Vec<String>,
    /// Runs whose drawn values cannot be flown. They count nowhere else.
    pub not_flown: u64,
    /// Reason of the first of these runs.
    pub not_flown_because: Option<String>,
    /// Flights that ended early without a violation, and flights that the judge cannot decide.
    pub unknown: u64,
    /// Flights with a violation. Unknown flights count at the upper end of the interval.
    pub violated: Proportion,
    /// Upper bound of the share with a violation; unknown flights count as violations. Null if only grids vary, and
    /// without a flight.
    pub violated_below: Option<UpperBound>,
    /// Flights in which two vehicles came closer than certified. Each shows a defect.
    pub certificates_broken: u64,
    /// Flights that are clear to the end.
    pub clear: Proportion,
    /// Flights that reached the formation and kept it.
    pub reached: Proportion,
    /// Flights that pass, as in `tautline run`.
    pub pass: Proportion,
    /// Smallest separation of a flight less delta \[m\].
    pub clearance_m: Quantiles,
    /// Time to reach the formation, over the flights that reached it \[s\].
    pub reached_at_s: Quantiles,
    /// Path length, summed over the vehicles \[m\].
    pub path_length_m: Quantiles,
    /// Histogram of the smallest separation less delta \[m\].
    pub clearance_histogram_m: Option<Histogram>,
    /// Histogram of the time to reach the formation \[s\].
    pub reached_histogram_s: Option<Histogram>,
    /// Flights with the least clearance, the worst first.
    pub worst: Vec<Worst>,
    /// Probability of a violation, if runs are estimates; the numbers above then have no flights.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub splitting: Option<Repetitions>,
    /// Violated flights of the estimates, the largest violation first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bad: Vec<ViolatedRun>,
}

/// Violated flight of an estimate.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViolatedRun {
    /// Number of the run.
    pub run: u64,
    /// Index in the violated flights of the run, from 0.
    pub bad: usize,
    /// Smallest separation less delta, up to the step of the violation \[m\].
    pub clearance_m: f64,
    /// Step of the violation, from 1.
    pub violated_at_step: u64,
    /// Hash over the state after this step.
    pub state_hash: String,
}

/// Quantiles over the flights. Intervals are those of order statistics; `None` if the number of runs was not fixed
/// beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantiles {
    /// Minimum.
    pub min: Option<f64>,
    /// 5 % quantile.
    pub p05: Estimate,
    /// Median.
    pub median: Estimate,
    /// 95 % quantile.
    pub p95: Estimate,
    /// Maximum.
    pub max: Option<f64>,
}

/// Comparison of two laws on the same runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// Names of the laws.
    pub laws: [String; 2],
    /// Runs that are clear under one law and not known to be clear under the other.
    pub clear: Paired,
    /// Runs that reached the formation under one law only.
    pub reached: Paired,
}

/// Accumulator of rows for a summary. It holds a few numbers of each row.
#[derive(Debug)]
pub(super) struct SummaryAccumulator {
    intervals: Intervals,
    tally: Tally,
    laws: Vec<LawNumbers>,
    keys: Vec<KeyColumn>,
}

/// Numbers of the rows of a law.
#[derive(Clone, Debug, Default)]
struct LawNumbers {
    clearance_m: Vec<f64>,
    reached_at_s: Vec<f64>,
    path_length_m: Vec<f64>,
    /// Whether each run was clear and reached the formation; `None` for a run that was not flown.
    outcomes: Vec<Option<[bool; 2]>>,
    not_flown_because: Option<String>,
    worst: Vec<Worst>,
    estimates: Vec<Splitting>,
    bad: Vec<ViolatedRun>,
}

impl SummaryAccumulator {
    /// Returns an empty accumulator.
    #[must_use]
    pub(super) fn new(campaign: &Campaign) -> Self {
        let laws = campaign.laws().len();
        let is_drawn = campaign.variations().values().any(|variation| variation.grid_len().is_none());
        let intervals = match (campaign.stop(), is_drawn) {
            (Some(_), _) => Intervals::ConfidenceSequence,
            // More runs after a look at the flights are runs that were not fixed beforehand.
            (None, true) if campaign.manifest().runs_raised => Intervals::ConfidenceSequence,
            (None, true) => Intervals::ClopperPearson,
            (None, false) => Intervals::Exact,
        };
        Self {
            intervals,
            tally: Tally::new(laws, campaign.stop()),
            laws: vec![LawNumbers::default(); laws],
            keys: campaign.variations().iter().map(|(key, variation)| KeyColumn::new(key, variation, laws)).collect(),
        }
    }

    /// Adds the next row in the order of runs and laws. Returns whether the row counts; after an early stop no row
    /// does.
    pub(super) fn take(&mut self, row: &Row) -> bool {
        if !self.tally.take(row) {
            return false;
        }
        let Some(numbers) = self.laws.get_mut(row.law) else { return true };
        numbers.take(row);
        if let Some(flight) = &row.flight {
            std::iter::zip(&mut self.keys, &row.drawn).for_each(|(column, value)| column.take(row.law, value, flight));
        }
        true
    }

    /// Returns whether the rule for an early stop is satisfied.
    #[must_use]
    pub(super) fn is_enough(&self) -> bool {
        self.tally.is_enough()
    }

    /// Returns the summary of the added rows.
    #[must_use]
    pub(super) fn finish(self, campaign: &Campaign) -> Summary {
        let Self { intervals, tally, laws, keys } = self;
        // Tests of pairs need a number of runs that was fixed beforehand.
        let has_pairs = intervals == Intervals::ClopperPearson && campaign.splitting().is_none();
        let pairs = if has_pairs { pairs(campaign.laws(), &laws) } else { Vec::new() };
        let laws = std::iter::zip(campaign.laws(), tally.counts()).zip(laws);
        let laws = laws.map(|((law, counts), numbers)| LawSummary {
            name: law.name.clone(),
            overrides: law.overrides.clone(),
            not_flown: counts.not_flown,
            not_flown_because: numbers.not_flown_because,
            unknown: counts.unknown,
            certificates_broken: counts.certificates_broken,
            violated: counts.violated(intervals),
            violated_below: counts.violated_below(intervals),
            clear: counts.share(Criterion::Clear, intervals),
            reached: counts.share(Criterion::Reached, intervals),
            pass: counts.share(Criterion::Pass, intervals),
            clearance_m: Quantiles::of(&numbers.clearance_m, intervals),
            reached_at_s: Quantiles::of(&numbers.reached_at_s, intervals),
            path_length_m: Quantiles::of(&numbers.path_length_m, intervals),
            clearance_histogram_m: Histogram::of(&numbers.clearance_m, HISTOGRAM_INTERVALS),
            reached_histogram_s: Histogram::of(&numbers.reached_at_s, HISTOGRAM_INTERVALS),
            worst: numbers.worst,
            splitting: campaign.splitting().map(|_| Repetitions::new(&numbers.estimates)),
            bad: numbers.bad,
        });
        let manifest = campaign.manifest();
        Summary {
            schema_version: SCHEMA_VERSION,
            campaign: manifest.campaign.clone(),
            name: manifest.name.clone(),
            scenario: campaign.own().name.clone(),
            runs: tally.runs(),
            runs_planned: manifest.runs,
            stopped_early: tally.is_enough() && tally.runs() < manifest.runs,
            intervals,
            pairs,
            varied: keys.into_iter().filter_map(|column| column.finish(intervals)).collect(),
            laws: laws.collect(),
        }
    }
}

impl LawNumbers {
    fn take(&mut self, row: &Row) {
        let outcome = |flight: &FlightSummary| [flight.outcome == Outcome::Clear, flight.reached];
        self.outcomes.push(row.flight.as_ref().map(outcome));
        if let Some(flight) = &row.flight {
            self.clearance_m.extend(row.clearance_m());
            self.reached_at_s.extend(flight.reached_at_s.filter(|_| flight.reached));
            self.path_length_m.push(flight.path_length_m);
            self.take_worst(row.run, flight);
        } else if let Some(splitting) = &row.splitting {
            self.take_estimate(row.run, splitting);
        } else if self.not_flown_because.is_none() {
            self.not_flown_because.clone_from(&row.not_flown);
        }
    }

    /// Keeps a flight that is among the worst. Of equal flights the first one is worse.
    fn take_worst(&mut self, run: u64, flight: &FlightSummary) {
        let (Some(min_m), Some(clearance_m)) = (flight.min_m, flight.clearance_m()) else { return };
        // A violation, which may be of an obstacle's clearance, is worse than any flight without one.
        let rank = |outcome: Outcome| outcome != Outcome::Violated;
        let own = (rank(flight.outcome), clearance_m);
        let place = self.worst.partition_point(|worse| (rank(worse.outcome), worse.clearance_m) <= own);
        let worst = Worst {
            run,
            outcome: flight.outcome,
            clearance_m,
            min_m,
            min_at_s: flight.min_at_s,
            min_pair: flight.min_pair,
            reached: flight.reached,
            state_hash: flight.state_hash.clone(),
        };
        self.worst.insert(place, worst);
        self.worst.truncate(WORST);
    }

    fn take_estimate(&mut self, run: u64, splitting: &Splitting) {
        self.bad.extend(splitting.bad.iter().enumerate().map(|(bad, flight)| ViolatedRun {
            run,
            bad,
            clearance_m: flight.clearance_m,
            violated_at_step: flight.violated_at_step,
            state_hash: flight.state_hash.clone(),
        }));
        self.bad.sort_by(|a, b| a.clearance_m.total_cmp(&b.clearance_m));
        self.bad.truncate(WORST);
        self.estimates.push(Splitting { bad: Vec::new(), ..splitting.clone() });
    }
}

impl Quantiles {
    fn of(values: &[f64], intervals: Intervals) -> Self {
        let estimate = |part| {
            let estimate = Estimate::quantile(values, part);
            let is_fixed = intervals == Intervals::ClopperPearson;
            if is_fixed { estimate } else { estimate.without_interval() }
        };
        Self {
            min: values.iter().copied().reduce(f64::min),
            p05: estimate(0.05),
            median: estimate(0.5),
            p95: estimate(0.95),
            max: values.iter().copied().reduce(f64::max),
        }
    }
}

/// Returns each two laws on the runs that both flew.
fn pairs(laws: &[Law], numbers: &[LawNumbers]) -> Vec<Pair> {
    let pair = |first: usize, second: usize| {
        let runs = std::iter::zip(&numbers[first].outcomes, &numbers[second].outcomes);
        let runs: Vec<_> = runs.filter_map(|(first, second)| Some(((*first)?, (*second)?))).collect();
        let paired = |what: usize| {
            let count = |of: [bool; 2]| runs.iter().filter(|run| [run.0[what], run.1[what]] == of).count() as u64;
            Paired::new(count([true, false]), count([false, true]), runs.len() as u64)
        };
        Pair { laws: [first, second].map(|law| laws[law].name.clone()), clear: paired(0), reached: paired(1) }
    };
    (0..laws.len()).flat_map(|first| (first + 1..laws.len()).map(move |second| pair(first, second))).collect()
}

/// One of the worst flights.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Worst {
    /// Number of the run.
    pub run: u64,
    /// Outcome of the flight.
    pub outcome: Outcome,
    /// Smallest separation less delta \[m\].
    pub clearance_m: f64,
    /// Smallest separation \[m\].
    pub min_m: f64,
    /// Time of the smallest separation \[s\].
    pub min_at_s: Option<f64>,
    /// Vehicles of the smallest separation.
    pub min_pair: Option<[usize; 2]>,
    /// Whether the formation was reached.
    pub reached: bool,
    /// Hash over the bits of every recorded state.
    pub state_hash: String,
}
