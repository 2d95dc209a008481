//! How flights depend on one or two keys: shares and separations over a grid of their values.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::attack::{Bound, FLIGHTS};
use crate::base::{BaseScenario, Criterion, JITTER_KEY, Runs, check_runs, jitter_note, overlap, refusal};
use crate::batch::Batch;
use crate::flight::{FlightSample, FlightSummary, Outcome};
use crate::statistics::{CONFIDENCE, Estimate, Proportion};
use crate::study::{About, Block, Experiment, Section, Study};
use crate::table::{Kind, Table};
use tautline_core::failure::Failure;
use tautline_core::option::{RUNS, SEED, SET, SWEEP_KEY, VERDICT};
use tautline_core::text::{beside_limit, capitalised, counted, shortest};
use tautline_report::figures::{Figure, GridAxis, Separation, Share, heat_map, separations, shares};
use tautline_report::report::page::{Badge, Tone};
use tautline_report::request::ScenarioRequest;
use tautline_sim::sim::SimError;

/// Most points of a grid.
pub const MOST_POINTS: usize = 2500;

/// Most points of identical flights that have a note.
const MOST_NOTES: usize = 3;

/// Assumptions of the numbers.
const ASSUMED: [&str; 3] = [
    "Every point of the grid is flown with the same seeds. Nothing is known between points.",
    "Shares have the interval of Clopper and Pearson, medians that of order statistics, for a number of runs that was \
     fixed before the first. Of many intervals some miss the true value.",
    "The scenario of a refused run cannot be flown, such as one with two vehicles within delta at the start. A refused \
     run counts in no share.",
];

/// A key, and the values that it takes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SweptKey {
    /// The key, as for `--set`.
    pub key: String,
    /// Its values, in the order in which they were given.
    pub values: Vec<f64>,
}

/// Options of a sweep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// One key or two.
    pub keys: Vec<SweptKey>,
    /// Verdict whose share is counted.
    pub question: Criterion,
    /// Runs of each point: 1 to [`crate::MOST_RUNS`]. A single run changes only the swept keys.
    pub runs: u64,
    /// Seed of the first run; run k, from 0, has this seed plus k for start and noise.
    pub seed: u64,
}

/// The flights of one point of the grid.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Point {
    /// Values of the keys.
    pub values: Vec<f64>,
    /// Flown runs that showed the verdict.
    pub held: Proportion,
    /// Flown runs with a violation.
    pub violated: Proportion,
    /// Smallest separation of all runs \[m\].
    pub min_smallest_m: Option<f64>,
    /// Median of the runs' smallest separations \[m\].
    pub min_median_m: Estimate,
    /// Median of the time to reach the formation, over the runs that reached it \[s\].
    pub reached_median_s: Estimate,
    /// Whether the flown runs are one flight repeated, because nothing in them is random. Shares and medians have no
    /// interval then.
    pub repeated: bool,
    /// Number of refused runs, whose scenario cannot be flown.
    pub refused: u64,
    /// Reason of the first refusal.
    pub first_refusal: Option<String>,
    /// The runs that were flown, in the order of their seeds.
    pub flights: Vec<FlightSummary>,
}

/// Flights over a grid of one key or two. Inapplicable values are null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sweep {
    /// The scenario, the program and the safety distance.
    #[serde(flatten)]
    pub about: About,
    /// The swept keys.
    #[serde(rename = "grid")]
    pub keys: Vec<SweptKey>,
    /// Verdict whose share is counted.
    pub question: Criterion,
    /// Runs of each point, with their seeds.
    #[serde(flatten)]
    pub runs: Runs,
    /// Confidence of all intervals.
    pub confidence: f64,
    /// Number of points of the grid.
    pub points_asked: u64,
    /// Whether the sweep was interrupted before all points were flown.
    pub interrupted: bool,
    /// The points that were flown: the last key changes fastest.
    pub points: Vec<Point>,
}

/// Returns the failure of values, which the command line and Python give in different forms.
fn wrong_values(why: &str) -> Failure {
    Failure::input("sweep/key", why, "give finite numbers, each of them once")
}

/// Returns the failure of a text.
fn wrong(why: &str) -> Failure {
    let help = format!(
        "write KEY=FROM..TO:COUNT with two different finite numbers and a count from 2 to {MOST_POINTS}, or \
         KEY=V1,V2,... with finite numbers"
    );
    Failure::input("sweep/key", why, help)
}

impl SweptKey {
    /// Parses `KEY=FROM..TO:COUNT` or `KEY=V1,V2,...`.
    ///
    /// # Errors
    /// [`Failure`] `sweep/key`.
    pub fn parse(text: &str) -> Result<Self, Failure> {
        let Some((key, values)) = text.split_once('=') else {
            return Err(wrong(&format!("{}: is not KEY=VALUES", SWEEP_KEY.set(text))));
        };
        let number = |text: &str| {
            let number = text.trim().parse::<f64>();
            number.map_err(|_| wrong(&format!("{}: `{}` is not a number", SWEEP_KEY.set(key), text.trim())))
        };
        let Some((from, rest)) = values.split_once("..") else {
            return Self::new(key, values.split(',').map(number).collect::<Result<_, _>>()?);
        };
        let Some((to, count)) = rest.split_once(':').filter(|_| !rest.starts_with('.')) else {
            return Err(wrong(&format!("{}: is neither KEY=FROM..TO:COUNT nor a list", SWEEP_KEY.set(text))));
        };
        let most = MOST_POINTS;
        let count = count.trim().parse::<usize>().ok().filter(|count| (2..=most).contains(count)).ok_or_else(|| {
            let option = SWEEP_KEY.set(text);
            wrong(&format!("{option}: the count must be from 2 to {most}, got `{}`", count.trim()))
        })?;
        let (from, to) = (number(from)?, number(to)?);
        if from == to || !(to - from).is_finite() {
            let option = SWEEP_KEY.set(text);
            return Err(wrong(&format!("{option}: the ends must be two different finite numbers")));
        }
        let range = Bound { key: key.to_owned(), low: from.min(to), high: from.max(to), whole: false };
        let part = |k: usize| k as f64 / (count - 1) as f64;
        let value = |k: usize| range.at(if from <= to { part(k) } else { 1.0 - part(k) });
        Self::new(key, (0..count).map(value).collect())
    }

    /// Returns whether the key is a seed.
    fn is_seed(&self) -> bool {
        self.key.rsplit('.').next() == Some("seed")
    }

    /// Returns a key with these values.
    ///
    /// # Errors
    /// [`Failure`] `sweep/key` for an empty key, no values, a value given twice, or a value that is not finite.
    pub fn new(key: &str, values: Vec<f64>) -> Result<Self, Failure> {
        let key = key.trim().to_owned();
        let option = SWEEP_KEY.set(&key);
        let twice = values.iter().enumerate().find(|(k, value)| values[..*k].contains(value));
        match (values.iter().find(|value| !value.is_finite()), twice) {
            (Some(value), _) => Err(wrong_values(&format!("{option}: {value} is not finite"))),
            (None, Some((_, value))) => Err(wrong_values(&format!("{option}: {value} is given twice"))),
            (None, None) if values.is_empty() || key.is_empty() => {
                Err(wrong_values(&format!("{option}: the grid is empty")))
            }
            (None, None) => Ok(Self { key, values }),
        }
    }
}

impl Options {
    /// Refuses grids that cannot be drawn or flown.
    fn check_grid(&self) -> Result<(), Failure> {
        let grid = |why: String, help: &str| Err(Failure::input("sweep/grid", why, help));
        if self.keys.is_empty() || self.keys.len() > 2 {
            let why = format!("{SWEEP_KEY}: a sweep has one key or two, got {}", self.keys.len());
            let help = format!("give one key or two with {SWEEP_KEY}; give other keys a value with {SET}");
            return grid(why, &help);
        }
        if let [one, other] = &self.keys[..]
            && overlap(&one.key, &other.key)
        {
            let why = format!("{} {}: the keys overlap", SWEEP_KEY.set(&one.key), SWEEP_KEY.set(&other.key));
            return grid(why, "give two different keys, each once with all its values");
        }
        let points = self.keys.iter().map(|key| key.values.len()).fold(1, usize::saturating_mul);
        let flights = (points as u64).saturating_mul(self.runs);
        if points > MOST_POINTS || flights > *FLIGHTS.end() {
            let keys = self.keys.iter().map(|key| format!("{} ({})", SWEEP_KEY.set(&key.key), key.values.len()));
            let keys = keys.collect::<Vec<_>>().join(" and ");
            if points > MOST_POINTS {
                let why = format!("{keys}: the grid must have at most {MOST_POINTS} points, got {points}");
                return grid(why, "give fewer values of a key");
            }
            let most = FLIGHTS.end();
            let runs = RUNS.set(self.runs);
            let why = format!("{runs}: {points} points must have at most {most} flights, got {flights}");
            return grid(why, "give fewer runs, or fewer values of a key");
        }
        Ok(())
    }

    /// Returns the values of the keys at each point.
    fn points(&self) -> Vec<Vec<f64>> {
        self.keys.iter().fold(vec![Vec::new()], |points, SweptKey { values, .. }| {
            let each = |point: Vec<f64>| values.iter().map(move |&value| [point.as_slice(), &[value]].concat());
            points.into_iter().flat_map(each).collect()
        })
    }
}

/// Returns the overrides of a point.
fn sets(keys: &[SweptKey], values: &[f64]) -> Vec<String> {
    keys.iter().zip(values).map(|(swept, &value)| format!("{}={}", swept.key, shortest(value))).collect()
}

impl Experiment for Options {
    type Study = Sweep;

    const COMMAND: &'static str = "sweep";

    fn check(&self) -> Result<(), Failure> {
        check_runs(self.runs, self.seed)?;
        self.check_grid()
    }

    fn arguments(&self, _study: &Sweep) -> Vec<String> {
        let keys = self.keys.iter().flat_map(|SweptKey { key, values }| {
            let values: Vec<_> = values.iter().copied().map(shortest).collect();
            [SWEEP_KEY.argument(), format!("{key}={}", values.join(","))]
        });
        let verdict = self.question.name().to_owned();
        let rest = [(VERDICT, verdict), (RUNS, self.runs.to_string()), (SEED, self.seed.to_string())];
        keys.chain(rest.into_iter().flat_map(|(option, value)| [option.argument(), value])).collect()
    }

    fn fly(&self, base: &BaseScenario, batch: &Batch<'_>) -> Result<Option<Sweep>, Failure> {
        for SweptKey { key, values } in &self.keys {
            let fraction = values.iter().find(|value| value.fract() != 0.0 && base.takes_integers_only(key));
            if let Some(value) = fraction {
                let why = format!("{}: the key takes integers only, got {value}", SWEEP_KEY.set(key));
                return Err(Failure::input(
                    "sweep/grid",
                    why,
                    "give integers, or a count that divides the range evenly",
                ));
            }
        }
        base.check_keys(self.keys.iter().map(|varied| varied.key.as_str()))?;
        let points = self.points();
        let scenario = |values: &Vec<f64>| base.with(&sets(&self.keys, values));
        let read = batch.run(points.len(), |number| {
            Ok::<_, Failure>(Some(scenario(&points[number]).ok().map(|scenario| scenario.is_random_in_flight())))
        })?;
        if read.iter().any(Option::is_none) {
            return Ok(None);
        }
        let Some(is_random) = read.into_iter().flatten().flatten().reduce(|a, b| a | b) else {
            // No point can be flown, for example because the key is unknown.
            let refused =
                |error| Failure::from(error).under(&format!("with {}", sets(&self.keys, &points[0]).join(", ")));
            return Err(scenario(&points[0])
                .map_err(refused)
                .err()
                .unwrap_or_else(|| wrong_values(&format!("{SWEEP_KEY}: the grid is empty"))));
        };
        let keys: Vec<_> = self.keys.iter().map(|varied| &*varied.key).collect();
        let runs = Runs::new(self.runs, self.seed, base, is_random || keys.contains(&JITTER_KEY));
        runs.check_seeds(&keys, base, is_random)?;
        let count = usize::try_from(self.runs).unwrap_or(usize::MAX);
        let steps = base.own().time.steps().saturating_mul(points.len() as u64).saturating_mul(self.runs);
        batch.monitor().begin(Self::COMMAND, Some(steps));
        let flown = batch.run_groups(points.len(), count, |point, run| {
            let run = run as u64;
            let scenario = base.with(&[runs.sets(run), sets(&self.keys, &points[point])].concat());
            let scenario = match scenario {
                Ok(scenario) => scenario,
                Err(error) => return Ok(Some(Err(refusal(error)))),
            };
            match batch.fly(&scenario, runs.seed(run)) {
                Ok(flight) => Ok(flight.map(Ok)),
                // A defect of an external law or of the engine is no property of a point.
                Err(error @ (SimError::ExternalLaw { .. } | SimError::EngineDiffers(_))) => Err(Failure::from(error)),
                Err(error) => Ok(Some(Err(error.to_string()))),
            }
        })?;
        let of_point =
            |(values, runs): (&Vec<f64>, Option<Vec<_>>)| Some(Point::new(values.clone(), self.question, runs?));
        let flown: Vec<_> = points.iter().zip(flown).filter_map(of_point).collect();
        let own = base.own();
        let sweep = Sweep {
            about: About::new(own),
            keys: self.keys.clone(),
            question: self.question,
            runs,
            confidence: CONFIDENCE,
            points_asked: points.len() as u64,
            interrupted: flown.len() < points.len(),
            points: flown,
        };
        Ok((!sweep.points.is_empty()).then_some(sweep))
    }
}

impl Point {
    fn new(values: Vec<f64>, question: Criterion, runs: Vec<Result<FlightSummary, String>>) -> Self {
        let (flights, refusals): (Vec<_>, Vec<_>) = runs.into_iter().partition(Result::is_ok);
        let flights: Vec<_> = flights.into_iter().flatten().collect();
        let sample = FlightSample::new(&flights);
        Self {
            values,
            held: sample.share(|flight| question.holds(flight)),
            violated: sample.share(|flight| flight.outcome == Outcome::Violated),
            min_smallest_m: flights.iter().filter_map(|flight| flight.min_m).reduce(f64::min),
            min_median_m: sample.quantile(|flight| flight.min_m, 0.5),
            reached_median_s: sample.quantile(|flight| flight.reached_at_s.filter(|_| flight.reached), 0.5),
            repeated: sample.is_repeated(),
            refused: refusals.len() as u64,
            first_refusal: refusals.into_iter().find_map(Result::err),
            flights,
        }
    }
}

impl Sweep {
    /// Returns the number of flown points, of all points after an interruption, and of flights.
    fn size(&self) -> String {
        let flights: u64 = self.points.iter().map(|point| point.held.of).sum();
        let (flown, flights) = (self.points.len() as u64, counted(flights, "flight", "flights"));
        if self.interrupted {
            return format!("{flown} of {} points, {flights}", self.points_asked);
        }
        format!("{}, {flights}", counted(flown, "point", "points"))
    }

    /// Returns whether points that differ only in the key at `place` all have the same flights, and there are such
    /// points.
    fn is_inert(&self, place: usize) -> bool {
        let mut flown: BTreeMap<Vec<u64>, &Point> = BTreeMap::new();
        let mut compared = 0;
        let hashes = |point: &Point| point.flights.iter().map(|flight| flight.state_hash.clone()).collect::<Vec<_>>();
        for point in self.points.iter().filter(|point| point.refused == 0) {
            let others = point.values.iter().enumerate().filter(|&(k, _)| k != place);
            let first = *flown.entry(others.map(|(_, value)| value.to_bits()).collect()).or_insert(point);
            if first.values == point.values {
                continue;
            }
            compared += 1;
            if hashes(first) != hashes(point) {
                return false;
            }
        }
        compared > 0
    }

    /// Returns the worst flight and its point.
    fn worst(&self) -> Option<(&Point, &FlightSummary)> {
        let flights = self.points.iter().flat_map(|point| point.flights.iter().map(move |flight| (point, flight)));
        flights.reduce(|worst, next| if next.1.is_worse_than(worst.1) { next } else { worst })
    }

    /// Returns curves over one key, or heat maps over two.
    fn figures(&self) -> Vec<Figure> {
        let does = self.question.words()[0];
        match &self.keys[..] {
            [key] => {
                let share = |point: &Point| {
                    let has_interval = point.held.of > 1 && !point.repeated;
                    let interval = has_interval.then_some([point.held.low, point.held.high]);
                    Some(Share { value: point.values[0], share: point.held.share?, interval })
                };
                let separation = |point: &Point| {
                    let Estimate { value, low, high } = point.min_median_m;
                    let interval_m = low.zip(high).map(|(low, high)| [low, high]);
                    let (smallest_m, median_m, flights) = (point.min_smallest_m?, value?, point.held.of);
                    Some(Separation { value: point.values[0], flights, smallest_m, median_m, interval_m })
                };
                let mut points: Vec<_> = self.points.iter().collect();
                points.sort_by(|a, b| a.values[0].total_cmp(&b.values[0]));
                let series = [(does.to_owned(), points.iter().filter_map(|point| share(point)).collect())];
                let lengths: Vec<_> = points.iter().filter_map(|point| separation(point)).collect();
                vec![
                    shares("share", &key.key, does, &series, false),
                    separations("separation", &key.key, &lengths, self.about.delta_m, false),
                ]
            }
            [y, x] => {
                let axes = [x, y].map(|SweptKey { key, values }| GridAxis { key, values });
                let point_at = |y: f64, x: f64| self.points.iter().find(|point| point.values == [y, x]);
                let map = |name: &str, label: &str, range, pick: fn(&Point) -> Option<f64>| {
                    let cells =
                        y.values.iter().flat_map(|&y| x.values.iter().map(move |&x| point_at(y, x).and_then(pick)));
                    heat_map(name, label, axes, &cells.collect::<Vec<_>>(), range)
                };
                vec![
                    map("share", &format!("share that {does}"), Some([0.0, 1.0]), |point| point.held.share),
                    map("separation", "smallest separation [m]", None, |point| point.min_smallest_m),
                ]
            }
            _ => Vec::new(),
        }
    }
}

impl Study for Sweep {
    fn kind(&self) -> &'static str {
        "Sweep"
    }

    fn title(&self) -> String {
        let keys: Vec<_> = self.keys.iter().map(|varied| varied.key.as_str()).collect();
        format!("{}: {}", self.about.scenario.name, keys.join(" and "))
    }

    fn badge(&self) -> Badge {
        Badge { tone: Tone::Neutral, word: self.size() }
    }

    fn headline(&self) -> String {
        let holds = |point: &&Point| point.held.of > 0 && point.held.count == point.held.of && point.refused == 0;
        let refused: u64 = self.points.iter().map(|point| point.refused).sum();
        let refused = match refused {
            0 => String::new(),
            count => format!(", {} could not be flown", counted(count, "run", "runs")),
        };
        let interrupted = if self.interrupted { format!("INTERRUPTED after {}: ", self.size()) } else { String::new() };
        let runs = self.runs.count;
        let every = if runs == 1 { String::new() } else { format!(" in each of {runs} runs") };
        let worst = self.worst().and_then(|(point, flight)| Some((point, flight.min_m?))).map(|(point, min_m)| {
            let shown = beside_limit(min_m, self.about.delta_m, 3);
            format!("; the smallest separation is {shown} m with {}", sets(&self.keys, &point.values).join(", "))
        });
        format!(
            "{interrupted}{} {}{every} at {} of {}{refused}{}",
            self.about.scenario.name,
            self.question.words()[0],
            self.points.iter().filter(holds).count(),
            counted(self.points.len() as u64, "point", "points"),
            worst.unwrap_or_default()
        )
    }

    fn notes(&self) -> Vec<String> {
        let refused = self.points.iter().find_map(|point| Some((point, point.first_refusal.as_ref()?)));
        let refused = refused.map(|(point, why)| {
            let runs = self.points.iter().map(|point| point.refused).sum();
            let (runs, with) = (counted(runs, "run", "runs"), sets(&self.keys, &point.values).join(", "));
            format!("{runs} could not be flown and count in no share, the first with {with}: {why}")
        });
        let inert = self.keys.iter().enumerate().filter(|&(place, varied)| varied.is_seed() && self.is_inert(place));
        let inert = inert.map(|(_, SweptKey { key, .. })| {
            format!(
                "{key} changes no flight: the scenario draws no random number from this seed. Set {JITTER_KEY} for \
                 random starts, or noise in [wind], [sensing] or [network]"
            )
        });
        let identical = self.points.iter().filter_map(|point| {
            FlightSample::new(&point.flights).note(&format!("with {}", sets(&self.keys, &point.values).join(", ")))
        });
        let notes = [refused, self.runs.jitter_m.map(jitter_note), self.about.note()].into_iter().flatten();
        notes.chain(inert).chain(identical.take(MOST_NOTES)).collect()
    }

    fn records(&self) -> Table {
        let (does, is_single) = (capitalised(self.question.words()[0]), self.runs.count == 1);
        let table = Table::of(if is_single { "One flight each" } else { "With 95 % intervals" }, &self.points);
        let share = if is_single { Kind::OneFlight } else { Kind::Share };
        // The median of one flight is its separation, so only files have it.
        let median = if is_single { " [m]" } else { "Separation, median [m]" };
        let keys = self.keys.iter().enumerate();
        let table = keys.fold(table, |table, (k, SweptKey { key, .. })| {
            table.column(key, key, Kind::Exact, |point| point.values.get(k).copied())
        });
        let table = table
            .column("held", &does, share, |point| point.held)
            .column("violated", "Violated", share, |point| point.violated)
            .column("min_smallest", "Separation, smallest [m]", Kind::AtLeast, |point| point.min_smallest_m)
            .column("min_median", median, Kind::Estimate, |point| point.min_median_m)
            .column("reached_median", "Time to reach, median [s]", Kind::Estimate, |point| point.reached_median_s);
        table
            .column("repeated", "", Kind::Flag, |point| point.repeated)
            .column("refused_count", "Refused", Kind::Count, |point| point.refused)
            .column("first_refusal", "", Kind::Text, |point| point.first_refusal.clone())
            .build()
    }

    fn sections(&self) -> Vec<Section> {
        let mut sections = vec![
            Section::new("Over the grid", "The results over the values of the keys.", [Block::Figures(self.figures())]),
            Section::new(
                "Every point",
                "A row for each combination of values, over all its flights.",
                [Block::Table(self.records())],
            ),
        ];
        let refused: Vec<_> = self.points.iter().filter(|point| point.refused > 0).collect();
        if !refused.is_empty() {
            let table = Table::of("Runs that could not be flown", &refused)
                .column("", "Point", Kind::Text, |point| sets(&self.keys, &point.values).join(", "))
                .column("", "Why", Kind::Text, |point| point.first_refusal.clone())
                .build();
            sections.push(Section::new(
                "Refused points",
                "These combinations of values are not a valid scenario.",
                [Block::Table(table)],
            ));
        }
        sections
    }

    fn assumptions(&self) -> Vec<String> {
        ASSUMED.map(str::to_owned).to_vec()
    }

    fn is_good(&self) -> bool {
        let refused: u64 = self.points.iter().map(|point| point.refused).sum();
        let flown: u64 = self.points.iter().map(|point| point.flights.len() as u64).sum();
        !self.interrupted && refused <= flown
    }

    fn repeats(&self, scenario: &ScenarioRequest) -> Vec<(String, String)> {
        let repeat = |(point, flight): (&Point, &FlightSummary)| {
            let sets = [self.runs.sets(flight.seed - self.runs.seed), sets(&self.keys, &point.values)].concat();
            ("The flight with the smallest separation:".to_owned(), scenario.command("run", [], &sets))
        };
        self.worst().map(repeat).into_iter().collect()
    }
}

#[cfg(test)]
mod tests;
