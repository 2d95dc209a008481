//! What came of a campaign: `campaign.json`.

use serde::Serialize;

use super::flights::{Campaign, Law};
use super::shard::{Known, Row};
use super::tally::{Intervals, Tally, UpperBound};
use super::tally::{KeyColumn, Varied};
use crate::Question;
use crate::SCHEMA_VERSION;
use crate::flight::{FlightSummary, Outcome};
use crate::splitting::{Repetitions, Splitting};
use crate::statistics::{Estimate, Paired, Proportion};
use tautline_report::figures::Histogram;

/// Intervals of a histogram.
const HISTOGRAM_INTERVALS: usize = 30;
/// Number of worst flights that are kept.
const WORST: usize = 10;

/// What came of a campaign. What does not apply is null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// SHA-256 that tells this campaign from all others.
    pub campaign: String,
    /// Its name.
    pub name: String,
    /// Name of the scenario.
    pub scenario: String,
    /// Runs that count.
    pub runs: u64,
    /// Runs that were planned.
    pub runs_planned: u64,
    /// Whether enough was known before all of them.
    pub stopped_early: bool,
    /// Which intervals shares have.
    pub intervals: Intervals,
    /// Each law, in the order in which they were named.
    pub laws: Vec<LawSummary>,
    /// Each two laws, on the runs that both flew; none where the number of runs was not fixed beforehand.
    pub pairs: Vec<Pair>,
    /// Each varied number, and what flights showed over it.
    pub varied: Vec<Varied>,
}

/// What flights of a law showed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawSummary {
    /// The law's name.
    pub name: String,
    /// What sets it, as `--set` takes it.
    pub overrides: Vec<String>,
    /// Flights that what was drawn made impossible; they count nowhere else.
    pub not_flown: u64,
    /// The first of them says why.
    pub not_flown_because: Option<String>,
    /// Flights that ended early without a violation, or of which the judge cannot tell.
    pub unknown: u64,
    /// With a violation. Flights of which it is not known count at the upper end of the interval.
    pub violated: Proportion,
    /// Bound that the share with a violation is below, those of which it is not known counted as violations; null where only grids
    /// vary, and of no flight.
    pub violated_below: Option<UpperBound>,
    /// Flights in which two vehicles came closer than their law's certificate; each is a defect.
    pub certificates_broken: u64,
    /// Clear to the end.
    pub clear: Proportion,
    /// With the formation reached and kept.
    pub reached: Proportion,
    /// Passed, as `tautline run` says it.
    pub pass: Proportion,
    /// Smallest separation less delta of a flight \[m\].
    pub clearance_m: Quantiles,
    /// When the formation was reached, of the flights that reached it \[s\].
    pub reached_at_s: Quantiles,
    /// Ways flown, summed over the vehicles \[m\].
    pub path_length_m: Quantiles,
    /// Flights by their smallest separation less delta \[m\].
    pub clearance_histogram_m: Option<Histogram>,
    /// Those that reached the formation by when they did \[s\].
    pub reached_histogram_s: Option<Histogram>,
    /// The flights with the least clearance, the worst first.
    pub worst: Vec<Worst>,
    /// The probability of a violation, where runs are estimates of it and no flights; all numbers above are of none then.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub splitting: Option<Repetitions>,
    /// Flights that were violated in them, those furthest into a violation first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bad: Vec<BadRun>,
}

/// A flight of an estimate that was violated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BadRun {
    /// Number of the run.
    pub run: u64,
    /// Its number among the run's bad flights, from 0.
    pub bad: usize,
    /// Smallest separation less delta, up to the step in which it was violated \[m\].
    pub clearance_m: f64,
    /// The step, from 1.
    pub violated_at_step: u64,
    /// Hash over the state after that step.
    pub state_hash: String,
}

/// What so many parts of all flights are not above. Intervals are those of order statistics; none where the number of runs
/// was not fixed beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quantiles {
    /// The smallest.
    pub min: Option<f64>,
    /// A twentieth.
    pub p05: Estimate,
    /// Half of them.
    pub median: Estimate,
    /// All but a twentieth.
    pub p95: Estimate,
    /// The largest.
    pub max: Option<f64>,
}

/// Two laws on the same runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pair {
    /// Names of the two.
    pub laws: [String; 2],
    /// Runs in which one was clear and the other was not known to be.
    pub clear: Paired,
    /// Runs in which one reached the formation and the other did not.
    pub reached: Paired,
}

/// Rows on their way to a summary. Memory is that of a few numbers a row.
#[derive(Debug)]
pub(super) struct Gathered {
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
    bad: Vec<BadRun>,
}

impl Gathered {
    /// Nothing yet.
    #[must_use]
    pub(super) fn new(campaign: &Campaign) -> Self {
        let laws = campaign.laws().len();
        let is_drawn = campaign.variations().values().any(|variation| variation.grid_len().is_none());
        let intervals = match (campaign.stop(), is_drawn) {
            (Some(_), _) => Intervals::ConfidenceSequence,
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

    /// Takes the next row in the order of runs and laws. Returns whether the row counts, which no row does after the decision.
    pub(super) fn take(&mut self, row: &Row) -> bool {
        if !self.tally.take(row) {
            return false;
        }
        let Some(numbers) = self.laws.get_mut(row.law) else { return true };
        numbers.take(row);
        let reached = row.flight.as_ref().is_some_and(|flight| flight.reached);
        for (column, value) in std::iter::zip(&mut self.keys, &row.drawn) {
            column.take(row.law, value, row.known(), reached);
        }
        true
    }

    /// Whether enough has been flown.
    #[must_use]
    pub(super) fn is_enough(&self) -> bool {
        self.tally.is_enough()
    }

    /// The summary of what was taken.
    #[must_use]
    pub(super) fn finish(self, campaign: &Campaign) -> Summary {
        let Self { intervals, tally, laws, keys } = self;
        // Tests of pairs hold for a number of runs that was fixed beforehand.
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
            clear: counts.share(Question::Clear, intervals),
            reached: counts.share(Question::Reached, intervals),
            pass: counts.share(Question::Pass, intervals),
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
        let (known, reached) = (row.known(), row.flight.as_ref().is_some_and(|flight| flight.reached));
        self.outcomes.push((known != Known::NotFlown).then_some([known == Known::Clear, reached]));
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

    /// Keeps a flight that is among the worst. Of equal flights the first is worse.
    fn take_worst(&mut self, run: u64, flight: &FlightSummary) {
        let (Some(min_m), Some(clearance_m)) = (flight.min_m, flight.clearance_m()) else { return };
        // A violation, which may be of an obstacle's clearance, is worse than none.
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
        self.bad.extend(splitting.bad.iter().enumerate().map(|(bad, flight)| BadRun {
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
            if is_fixed { estimate } else { Estimate { value: estimate.value, low: None, high: None } }
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

/// A flight to look at.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Worst {
    /// Number of the run.
    pub run: u64,
    /// How it went.
    pub outcome: Outcome,
    /// Smallest separation less delta \[m\].
    pub clearance_m: f64,
    /// Smallest separation \[m\].
    pub min_m: f64,
    /// When that was \[s\].
    pub min_at_s: Option<f64>,
    /// Which two.
    pub min_pair: Option<[usize; 2]>,
    /// Whether the formation was reached.
    pub reached: bool,
    /// Hash over the bits of every recorded state.
    pub state_hash: String,
}
