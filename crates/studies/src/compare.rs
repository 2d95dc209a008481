//! Laws side by side: the same starts, the same plant and the same audit under each of them.

use std::time::Instant;

use serde::Serialize;

use crate::base::{BaseScenario, JITTER, check_law_name, check_runs, jitter_note};
use crate::batch::Batch;
use crate::flight::{FlightSample, FlightSummary, Outcome};
use crate::statistics::{CONFIDENCE, Estimate, Proportion};
use crate::study::{About, Block, Experiment, Section, Study};
use crate::table::{Kind, Table};
use tautline_core::failure::Failure;
use tautline_core::option::{LAWS, RUNS, SEED};
use tautline_core::text::{at_least, counted};
use tautline_report::figures::{Figure, OfLaw, at_closest, by_law};
use tautline_report::flight_log::FlightLog;
use tautline_report::report::page::{self, Badge, Tone};
use tautline_report::request::{Pictures, ScenarioRequest};
use tautline_report::run::run;
use tautline_sim::scenario::{Draw, ExternalLaw, NamedLaw, Scenario, Template};

/// Assumptions of the numbers.
const ASSUMED: [&str; 5] = [
    "Every law is flown from the same starts on the same plant and judged by the same audit. A flight is proved clear \
     if it was flown to its end, no two vehicles came closer than delta at any time, and both detectors agree.",
    "Starts are drawn at random. Intervals are for all starts that could have been drawn, and hold for a number of \
     runs that was fixed before the first.",
    "Shares have the interval of Clopper and Pearson, medians and percentiles that of order statistics, means that of \
     Student.",
    "Times to reach are over the flights that reached the formation and kept it to the end.",
    "Path length and total control are sums over all vehicles and the whole flight.",
];

/// Options of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Kinds of laws, names of tables `[laws.NAME]`, or names of external laws. By default the names of all such
    /// tables, or all kinds if the scenario has no such table.
    /// `NAME+shield` flies a law under the shield, `NAME+bare` without it.
    pub laws: Option<Vec<String>>,
    /// Whether each law is flown twice, without and under the shield.
    pub shield: bool,
    /// Starts under each law: 1 to [`crate::MOST_RUNS`].
    pub runs: u64,
    /// Seed of the first run. Run k, from 0, has this seed plus k as `start.seed` and, if the flight is random, as
    /// `noise.seed`. A start that does not depend on its seed gets a jitter of 5 % of delta along each axis.
    pub seed: u64,
    /// External laws that `laws` may name.
    pub external: Vec<ExternalLaw>,
}

impl Default for Options {
    fn default() -> Self {
        Self { laws: None, shield: false, runs: 20, seed: 0, external: Vec::new() }
    }
}

/// Laws side by side. Units are in the names; inapplicable values are null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The scenario, the program and the safety distance.
    #[serde(flatten)]
    pub about: About,
    /// Number of starts that were flown under every law.
    pub runs: u64,
    /// Requested number of starts.
    pub runs_asked: u64,
    /// `start.seed` of the first start.
    pub seed: u64,
    /// Jitter along each axis of a start without randomness \[m\].
    pub jitter_m: Option<f64>,
    /// Confidence of all intervals.
    pub confidence: f64,
    /// A row for each law, in the order of the options.
    pub laws: Vec<LawRow>,
    /// Wall-clock times. Only this part differs between two equal comparisons.
    pub performance: Performance,
    /// Whether the flight depends on the seed of noise.
    #[serde(skip)]
    flight_is_random: bool,
}

/// Results of a law.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawRow {
    /// Name of the law: its kind, or that of its table `[laws.NAME]`.
    pub name: String,
    /// Kind of the law; `external` for an external law.
    pub kind: String,
    /// Overrides that fly the law, one for its kind and one for each key.
    pub overrides: Vec<String>,
    /// Flights that were proved clear by both detectors.
    pub clear: Proportion,
    /// Flights with a violation.
    pub violated: Proportion,
    /// Flights without a violation that ended early.
    pub ended_early: u64,
    /// Flights that the judge cannot decide.
    pub undecided: u64,
    /// Flights, of any outcome, that `tautline check` refuses.
    pub refused: u64,
    /// Flights that reached the formation.
    pub reached: Proportion,
    /// Median of the time to reach the formation, over the flights that reached it \[s\].
    pub reached_median_s: Estimate,
    /// 95th percentile of the time to reach the formation \[s\].
    pub reached_p95_s: Estimate,
    /// Smallest separation of all flights \[m\].
    pub min_smallest_m: Option<f64>,
    /// Seed of the flight with the smallest separation.
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
    /// Whether the flights are one flight repeated, because nothing in them is random. No number has an interval then.
    pub repeated: bool,
    /// The flights, in the order of their seeds.
    pub flights: Vec<FlightSummary>,
}

/// Wall-clock times on the machine that flew.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Performance {
    /// Time from the start of the first flight to the end of the last \[s\].
    pub wall_s: f64,
    /// Times of each law, in the order of the rows.
    pub laws: Vec<LawPerformance>,
}

/// Wall-clock time of a law.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LawPerformance {
    /// Name of the law.
    pub name: String,
    /// Time in the law over the steps of all its flights \[s\].
    pub law_step_s: Option<f64>,
}

impl Experiment for Options {
    type Study = Comparison;

    const COMMAND: &'static str = "compare";

    fn check(&self) -> Result<(), Failure> {
        check_runs(self.runs, self.seed)
    }

    fn external_laws(&self) -> &[ExternalLaw] {
        &self.external
    }

    fn arguments(&self, study: &Comparison) -> Vec<String> {
        let laws: Vec<_> = study.laws.iter().map(|law| law.name.as_str()).collect();
        let all = [(LAWS, laws.join(",")), (RUNS, self.runs.to_string()), (SEED, self.seed.to_string())];
        all.into_iter().flat_map(|(option, value)| [option.argument(), value]).collect()
    }

    fn fly(&self, base: &BaseScenario, batch: &Batch<'_>) -> Result<Option<Comparison>, Failure> {
        let template = base.template();
        let laws = self.laws(template)?;
        let jitter_m = (!template.start_is_random()).then(|| JITTER * base.own().delta_m);
        let seed = |run: u64| self.seed.saturating_add(run);
        // Wrong starts and laws are refused before the first flight.
        for law in &laws {
            let law_exists = drawn(template, law, seed(0), jitter_m)?.law();
            law_exists.map_err(|error| Failure::from(error).under(&under(law, seed(0))))?;
        }
        (1..self.runs).try_for_each(|run| drawn(template, &laws[0], seed(run), jitter_m).map(drop))?;

        let starts = usize::try_from(self.runs).unwrap_or(usize::MAX);
        let steps = base.own().time.steps().saturating_mul(self.runs).saturating_mul(laws.len() as u64);
        batch.monitor().begin(Self::COMMAND, Some(steps));
        let began = Instant::now();
        // Each start is flown under all laws before the next start, so an interruption leaves few incomplete starts.
        let flown = batch.run_groups(starts, laws.len(), |run, law| {
            let (law, seed) = (&laws[law], seed(run as u64));
            let flight = batch.fly(&drawn(template, law, seed, jitter_m)?, seed);
            flight.map_err(|error| Failure::from(error).under(&under(law, seed)))
        })?;
        let mut flights = vec![Vec::new(); laws.len()];
        for start in flown.into_iter().flatten() {
            flights.iter_mut().zip(start).for_each(|(flights, flight)| flights.push(flight));
        }
        let runs = flights[0].len() as u64;
        if runs == 0 {
            return Ok(None);
        }
        let time = |(law, flights): (&ComparedLaw, &Vec<FlightSummary>)| {
            let steps: u64 = flights.iter().map(|flight| flight.steps).sum();
            let law_s: f64 = flights.iter().map(|flight| flight.law_s).sum();
            LawPerformance { name: law.name().to_owned(), law_step_s: (steps > 0).then(|| law_s / steps as f64) }
        };
        let performance =
            Performance { wall_s: began.elapsed().as_secs_f64(), laws: laws.iter().zip(&flights).map(time).collect() };
        Ok(Some(Comparison {
            about: About::new(base.own()),
            runs,
            runs_asked: self.runs,
            seed: self.seed,
            jitter_m,
            confidence: CONFIDENCE,
            laws: laws.iter().zip(flights).map(|(law, flights)| LawRow::new(law, flights)).collect(),
            performance,
            flight_is_random: template.flight_is_random(),
        }))
    }

    fn illustrate(&self, base: &BaseScenario, study: &Comparison, _pictures: &dyn Pictures) -> Vec<Section> {
        const ABOUT: &str =
            "The flight of each law that came closest, from above, at that instant; all axes are alike.";
        let block = match self.closest_approaches(base, study) {
            Ok(figures) => Block::Figures(figures),
            Err(failure) => Block::Page(page::list(&[format!("no figures: {}", failure.in_words())])),
        };
        vec![Section::new("Closest approach of each law", ABOUT, [block])]
    }
}

impl Options {
    /// Returns the laws to compare, without repetition.
    fn laws(&self, template: &Template) -> Result<Vec<ComparedLaw>, Failure> {
        self.external.iter().try_for_each(|law| check_law_name(template, law))?;
        let names = self.laws.clone().unwrap_or_else(|| template.compared_laws());
        let names = if self.shield { Template::with_and_without_shield(&names) } else { names };
        if names.is_empty() {
            let help = "give the kind of a law, such as edge-tension";
            let message = format!("{LAWS}: must name at least one law");
            return Err(Failure::input("compare/no-law", message, help));
        }
        if let Some((_, twice)) = names.iter().enumerate().find(|&(k, name)| names[..k].contains(name)) {
            return Err(Failure::input(
                "compare/law-twice",
                format!("{}: `{twice}` is named twice", LAWS.set(names.join(","))),
                "name each law once; variants of a law are tables [laws.NAME] with the same `kind`",
            ));
        }
        names.iter().map(|name| self.law(template, name)).collect()
    }

    /// Returns a figure for each law: the flight with the smallest separation, flown again, at the time of this
    /// separation.
    fn closest_approaches(&self, base: &BaseScenario, study: &Comparison) -> Result<Vec<Figure>, Failure> {
        /// Memory of the history of a flight \[bytes\].
        const HISTORY_BYTES: usize = 4 << 20;
        let mut flown = Vec::new();
        for law in &study.laws {
            let Some(worst) = law.worst() else { continue };
            let (Some(min_m), Some(at_s), Some(pair)) = (worst.min_m, worst.min_at_s, worst.min_pair) else { continue };
            let named = self.law(base.template(), &law.name)?;
            let scenario = drawn(base.template(), &named, worst.seed, study.jitter_m)?;
            let mut log = FlightLog::of(&scenario).within(HISTORY_BYTES);
            run(&scenario, &mut log)?;
            flown.push((law, worst.seed, scenario, (pair, at_s, min_m), log));
        }
        let (flights, logs): (Vec<_>, Vec<_>) =
            flown.into_iter().map(|(law, seed, scenario, closest, log)| ((law, seed, scenario, closest), log)).unzip();
        let figure = |((law, seed, scenario, ([a, b], at_s, min_m)), log): (&Flown<'_>, &FlightLog)| {
            let obstacles: Vec<_> = scenario.obstacles.iter().map(Into::into).collect();
            let figure = at_closest(&law.name, log, &obstacles, Some(([a - 1, b - 1], *at_s)), &logs);
            let runs = study.runs;
            Figure {
                name: format!("closest-{}", law.name.replace('+', "-")),
                description: format!(
                    "{}: {} m apart at {at_s:.2} s, vehicles {a} and {b}, the closest of {runs} flights \
                     (start.seed {seed}).",
                    law.name,
                    at_least(*min_m, 3),
                ),
                ..figure
            }
        };
        Ok(flights.iter().zip(&logs).map(figure).collect())
    }

    /// Returns the law with a name. `NAME+shield` and `NAME+bare` choose the shield.
    fn law(&self, template: &Template, name: &str) -> Result<ComparedLaw, Failure> {
        let Some(law) = self.external.iter().find(|law| name.split('+').next() == Some(law.name())) else {
            return Ok(ComparedLaw { named: template.law(name)?, external: None });
        };
        let own = format!("{}{}", template.own_law().name, &name[law.name().len()..]);
        let named = NamedLaw { name: name.to_owned(), ..template.law(&own)? };
        Ok(ComparedLaw { named, external: Some(law.clone()) })
    }
}

/// Law of a comparison: one of the scenario, or an external law over the scenario's own.
#[derive(Clone, Debug)]
struct ComparedLaw {
    named: NamedLaw,
    external: Option<ExternalLaw>,
}

impl ComparedLaw {
    fn name(&self) -> &str {
        &self.named.name
    }

    fn kind(&self) -> String {
        if self.external.is_some() { "external".to_owned() } else { self.named.kind() }
    }

    /// Returns the overrides that fly the law; for an external law only the choice of the shield.
    fn overrides(&self) -> Vec<String> {
        let is_flown = |set: &String| self.external.is_none() || set.starts_with("shield.");
        self.named.overrides().into_iter().filter(is_flown).collect()
    }
}

fn under(law: &ComparedLaw, seed: u64) -> String {
    format!("under the law {}, start.seed = {seed}", law.name())
}

/// Returns the flight of a law from the start of a seed.
fn drawn(template: &Template, law: &ComparedLaw, seed: u64, jitter_m: Option<f64>) -> Result<Scenario, Failure> {
    let drawn = template.scenario(&law.named, Draw { seed, jitter_m });
    let drawn = drawn.map_err(|error| Failure::from(error).under(&under(law, seed)))?;
    Ok(Scenario { external_law: law.external.clone(), ..drawn })
}

/// The worst flight of a law: its seed, its scenario, and pair, time \[s\] and distance \[m\] of its closest approach.
type Flown<'a> = (&'a LawRow, u64, Scenario, ([usize; 2], f64, f64));

impl LawRow {
    fn new(law: &ComparedLaw, flights: Vec<FlightSummary>) -> Self {
        let sample = FlightSample::new(&flights);
        let ended = |outcome: Outcome| sample.share(|flight| flight.outcome == outcome);
        let reached_s = |flight: &FlightSummary| flight.reached_at_s.filter(|_| flight.reached);
        let worst = worst(&flights);
        Self {
            name: law.name().to_owned(),
            kind: law.kind(),
            overrides: law.overrides(),
            clear: ended(Outcome::Clear),
            violated: ended(Outcome::Violated),
            ended_early: ended(Outcome::EndedEarly).count,
            undecided: ended(Outcome::Undecided).count,
            refused: sample.count(|flight| !flight.refused.is_empty()),
            reached: sample.share(|flight| flight.reached),
            reached_median_s: sample.quantile(reached_s, 0.5),
            reached_p95_s: sample.quantile(reached_s, 0.95),
            min_smallest_m: worst.and_then(|flight| flight.min_m),
            min_smallest_seed: worst.map(|flight| flight.seed),
            min_median_m: sample.quantile(|flight| flight.min_m, 0.5),
            path_length_mean_m: sample.mean(|flight| flight.path_length_m),
            peak_control_largest_m_s2: flights.iter().filter_map(|flight| flight.peak_control_m_s2).reduce(f64::max),
            peak_control_median_m_s2: sample.quantile(|flight| flight.peak_control_m_s2, 0.5),
            total_control_mean_m_s: sample.mean(|flight| flight.total_control_m_s),
            repeated: sample.is_repeated(),
            flights,
        }
    }

    /// Returns the flight with the smallest separation; the first of equal ones.
    #[must_use]
    pub fn worst(&self) -> Option<&FlightSummary> {
        worst(&self.flights)
    }

    fn notes(&self) -> Vec<String> {
        let (name, total) = (&self.name, self.flights.len());
        let refused = (self.refused > 0).then(|| {
            let mut codes: Vec<_> =
                self.flights.iter().flat_map(|flight| &flight.refused).map(String::as_str).collect();
            codes.sort_unstable();
            codes.dedup();
            let (codes, refused) = (codes.join(", "), self.refused);
            format!("{name}: {refused} of {total} flights are refused by `check` ({codes}) and flown anyway")
        });
        let early: Vec<_> = self.flights.iter().filter(|flight| flight.ended_early.is_some()).collect();
        let ended = early.first().map(|first| {
            let violated = early.iter().filter(|flight| flight.outcome == Outcome::Violated).count();
            let why = first.ended_early.as_deref().unwrap_or_default().trim_end_matches('.');
            format!(
                "{name}: {} of {total} flights ended early, {violated} of them after a violation; the first has \
                 start.seed {}: {why}",
                early.len(),
                first.seed
            )
        });
        let reached = self.reached.count;
        let censored = (reached > 0 && reached < self.reached.of).then(|| {
            format!("{name}: times to reach are over the {reached} of {total} flights that reached the formation")
        });
        let identical = FlightSample::new(&self.flights).note(&format!("under {name}"));
        [refused, ended, censored, identical].into_iter().flatten().collect()
    }
}

fn worst(flights: &[FlightSummary]) -> Option<&FlightSummary> {
    let known = flights.iter().filter_map(|flight| Some((flight.min_m?, flight)));
    known.min_by(|(a, _), (b, _)| a.total_cmp(b)).map(|(_, flight)| flight)
}

impl Comparison {
    /// Returns charts of the outcomes, the times and the clearances.
    fn figures(&self) -> Vec<Figure> {
        let row = |law: &LawRow, value: Option<f64>, interval: [Option<f64>; 2]| OfLaw {
            law: law.name.clone(),
            value,
            interval,
        };
        let share = |name: &str, title: &str, pick: fn(&LawRow) -> Proportion| {
            let percent = |part: f64| 100.0 * part;
            let rows = self.laws.iter().map(|law| {
                let share = pick(law);
                row(law, share.share.map(percent), [share.low, share.high].map(percent).map(Some))
            });
            // Laws that need more acceleration violate under such a limit.
            let limit = self.about.max_accel_m_s2.map(|limit| format!(", commands limited to {limit} m/s^2"));
            let title = format!("{title}{}", limit.unwrap_or_default());
            by_law(name, &title, "share of the flights [%]", &rows.collect::<Vec<_>>(), Some([0.0, 100.0]), None)
        };
        let measured = |name: &str, title: &str, label: &str, pick: &dyn Fn(&LawRow) -> Estimate, limit| {
            let rows = self.laws.iter().map(|law| {
                let estimate = pick(law);
                row(law, estimate.value, [estimate.low, estimate.high])
            });
            by_law(name, title, label, &rows.collect::<Vec<_>>(), None, limit)
        };
        let delta_m = self.about.delta_m;
        let clearance = |law: &LawRow| {
            let Estimate { value, low, high } = law.min_median_m;
            let less = |length: Option<f64>| length.map(|length_m| length_m - delta_m);
            Estimate { value: less(value), low: less(low), high: less(high) }
        };
        vec![
            share("violated", "Violated", |law| law.violated),
            share("reached", "Reached the formation", |law| law.reached),
            measured(
                "time",
                "Time to reach the formation, median",
                "time to reach [s]",
                &|law| law.reached_median_s,
                None,
            ),
            measured(
                "clearance",
                "Smallest separation less delta, median",
                "clearance [m]",
                &clearance,
                Some((0.0, "delta")),
            ),
        ]
    }
}

impl Study for Comparison {
    fn kind(&self) -> &'static str {
        "Laws side by side"
    }

    fn title(&self) -> String {
        self.about.scenario.name.clone()
    }

    fn badge(&self) -> Badge {
        Badge { tone: Tone::Neutral, word: "compared".to_owned() }
    }

    fn headline(&self) -> String {
        let laws = counted(self.laws.len() as u64, "law", "laws");
        let starts = match self.runs {
            1 => format!("the same start (start.seed {})", self.seed),
            runs => format!("the same {runs} starts (start.seed {} to {})", self.seed, self.seed + (runs - 1)),
        };
        let interrupted = if self.is_good() { "" } else { "INTERRUPTED: " };
        format!("{interrupted}{}: {laws} from {starts}, delta {} m", self.about.scenario.name, self.about.delta_m)
    }

    fn notes(&self) -> Vec<String> {
        let interrupted = (self.runs < self.runs_asked).then(|| {
            format!(
                "interrupted: the comparison has {1} of {0} starts, those flown under every law",
                self.runs_asked, self.runs
            )
        });
        let jitter = self.jitter_m.map(jitter_note);
        interrupted.into_iter().chain(jitter).chain(self.laws.iter().flat_map(LawRow::notes)).collect()
    }

    fn records(&self) -> Table {
        Table::of("Laws", &self.laws)
            .column("law", "Law", Kind::Text, |law| law.name.clone())
            .column("kind", "", Kind::Text, |law| law.kind.clone())
            .column("runs", "", Kind::Count, |law| law.clear.of)
            .column("clear", "Proved clear [%]", Kind::Share, |law| law.clear)
            .column("violated", "Violated [%]", Kind::Share, |law| law.violated)
            .column("undecided_count", "Undecided", Kind::Count, |law| law.undecided)
            .column("ended_early_count", "Ended early", Kind::Count, |law| law.ended_early)
            .column("refused_count", "Refused by check", Kind::Count, |law| law.refused)
            .column("reached", "Reached [%]", Kind::Share, |law| law.reached)
            .column("reached_median", "Time to reach, median [s]", Kind::Estimate, |law| law.reached_median_s)
            .column("reached_p95", "Time to reach, 95th percentile [s]", Kind::Estimate, |law| law.reached_p95_s)
            .column("min_smallest", "Separation, smallest [m]", Kind::AtLeast, |law| law.min_smallest_m)
            .column("min_smallest_seed", "", Kind::Integer, |law| law.min_smallest_seed)
            .column("min_median", "Separation, median [m]", Kind::Estimate, |law| law.min_median_m)
            .column("path_length_mean", "Path length, mean [m]", Kind::Estimate, |law| law.path_length_mean_m)
            .column("peak_control_largest", "Peak control, largest [m/s^2]", Kind::Measured, |law| {
                law.peak_control_largest_m_s2
            })
            .column("peak_control_median", "Peak control, median [m/s^2]", Kind::Estimate, |law| {
                law.peak_control_median_m_s2
            })
            .column("total_control_mean", "Total control, mean [m/s]", Kind::Estimate, |law| law.total_control_mean_m_s)
            .build()
    }

    fn sections(&self) -> Vec<Section> {
        let records = self.records();
        let part = |caption: &str, columns: std::ops::Range<usize>| {
            Block::Table(records.part(caption, |place| place == 0 || columns.contains(&place)))
        };
        let keys = Table::of("Keys of each law", &self.laws)
            .column("", "Law", Kind::Text, |law| law.name.clone())
            .column("", "Keys", Kind::Text, |law| law.overrides.join(", "))
            .build();
        vec![
            Section::new(
                "Laws side by side",
                "Each law flew from the same starts; dots are estimates, and lines are their 95 % intervals. A dot \
                 without a line has no interval, because an interval needs more flights.",
                [
                    Block::Figures(self.figures()),
                    part("How flights ended, with 95 % intervals", 1..9),
                    part("Time to reach the formation, and separation", 9..14),
                    part("Path and control", 14..18),
                ],
            ),
            Section::detail("Keys", "The keys of the scenario that fly each law.", [Block::Table(keys)]),
        ]
    }

    fn text(&self) -> String {
        let delta_m = self.about.delta_m;
        Table::of("Flights of each law, with 95 % intervals", &self.laws)
            .column("", "Law", Kind::Text, |law| law.name.clone())
            .column("", "Violated", Kind::Share, |law| law.violated)
            .column("", "Unknown", Kind::Count, |law| law.undecided + law.ended_early)
            .column("", "Reached", Kind::Share, |law| law.reached)
            .column("", "Time to reach, median [s]", Kind::Estimate, |law| law.reached_median_s)
            .column("", "Clearance, smallest [m]", Kind::AtLeast, |law| law.min_smallest_m.map(|min_m| min_m - delta_m))
            .build()
            .text()
    }

    fn assumptions(&self) -> Vec<String> {
        ASSUMED.map(str::to_owned).to_vec()
    }

    fn is_good(&self) -> bool {
        self.runs == self.runs_asked
    }

    fn performance(&self) -> Option<Table> {
        let table = Table::of("Wall-clock time on this machine", &self.performance.laws)
            .column("", "Law", Kind::Text, |law| law.name.clone())
            .column("", "A step of the law [us]", Kind::Measured, |law| law.law_step_s.map(|step_s| 1e6 * step_s));
        Some(table.build())
    }

    fn repeats(&self, scenario: &ScenarioRequest) -> Vec<(String, String)> {
        let jitter = self.jitter_m.map(|jitter_m| format!("start.jitter_m={jitter_m:?}"));
        let repeat = |law: &LawRow| {
            let seed = law.worst()?.seed;
            let noise = self.flight_is_random.then(|| format!("noise.seed={seed}"));
            let seed = format!("start.seed={seed}");
            let sets = law.overrides.iter().chain([&seed]).chain(&noise).chain(&jitter);
            Some((format!("The worst flight of {}:", law.name), scenario.command("run", [], sets)))
        };
        self.laws.iter().filter_map(repeat).collect()
    }
}

#[cfg(test)]
mod tests;
