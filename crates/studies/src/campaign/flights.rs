//! Flights of a campaign, each determined by the manifest and the number of its run.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

use super::folder::{Manifest, Program, other_campaign};
use super::shard::Row;
use super::spec::{Method, Spec, Stop, refused};
use super::summary::{Summary, SummaryAccumulator};
use super::vary::Variation;
use crate::SCHEMA_VERSION;
use crate::base::{BaseScenario, NOISE_SEED, START_SEED};
use crate::batch::Batch;
use crate::splitting::{self, SplittingSettings};
use tautline_core::failure::Failure;
use tautline_core::option::SHARDS;
use tautline_sim::scenario::{ExternalLaw, Override, Scenario, ScenarioError, Source};

/// Largest number of runs of a campaign.
pub const MOST_RUNS: u64 = 1_000_000_000;
/// Default number of runs of a shard: the most that a failed machine loses.
const RUNS_OF_A_SHARD: u64 = 250;
/// Number of runs of a shard under a law that each process loads, which may be slow.
const RUNS_UNDER_A_LOADED_LAW: u64 = 50;
/// Most values of a list that are tried before the first flight.
const MOST_TRIED: usize = 1000;
/// Number of first runs that are searched for one that can be flown.
const FIRST_TRIED: u64 = 100;
/// Code of a value outside the bounds of its key.
const OUT_OF_RANGE: &str = "scenario/out-of-range";
/// Tables whose keys can make a flight random.
const FLIGHT: [&str; 4] = ["wind.", "sensing.", "network.", "actuation."];

/// Largest number of rows in memory.
const AT_ONCE: u64 = 1024;

/// Flights of all runs.
#[derive(Clone, Debug)]
pub struct Campaign {
    manifest: Manifest,
    base: BaseScenario,
    laws: Vec<Law>,
    variations: BTreeMap<String, Variation>,
    seed: u64,
    stop: Option<Stop>,
    splitting: Option<SplittingSettings>,
    argument: String,
}

/// Law that flies every run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Law {
    /// Name of the law: its kind, or that of its table `[laws.NAME]`.
    pub name: String,
    /// Overrides that select the law, as `--set` takes them; empty for the scenario's own law.
    pub overrides: Vec<String>,
}

impl Campaign {
    /// Plans a campaign with a name and a number of shards, by default one for each `RUNS_OF_A_SHARD` runs, or for each
    /// `RUNS_UNDER_A_LOADED_LAW` runs under an external law with a source. The path of a scenario is relative to
    /// `folder`. An external law flies every run in place of the scenario's own law.
    ///
    /// # Errors
    /// [`Failure`] for a wrong specification, and for the first value, law or run that cannot be flown.
    pub fn plan(
        spec: &Spec,
        name: &str,
        folder: &Path,
        shards: Option<u64>,
        program: Program,
        external_law: Option<&ExternalLaw>,
    ) -> Result<Self, Failure> {
        let plain = |error| spec.scenario("scenario", "scenario", error);
        let file = folder.join(&spec.scenario);
        let source =
            if file.is_file() { Source::File(file) } else { Source::resolve(&spec.scenario).map_err(plain)? };
        let (called, text) = source.text().map_err(plain)?;
        let scenario_name =
            Path::new(&called).file_name().map_or(called.clone(), |name| name.to_string_lossy().into_owned());
        let mut manifest = Manifest {
            schema_version: SCHEMA_VERSION,
            campaign: String::new(),
            name: name.to_owned(),
            tool: program,
            scenario_name,
            scenario: text,
            spec: spec.to_toml()?,
            runs: runs(spec)?,
            runs_raised: false,
            external_law: external_law.map(|law| law.name().to_owned()),
            external_law_sha256: external_law.and_then(ExternalLaw::source_sha256).map(str::to_owned),
            first: Vec::new(),
            shards: 1,
            folder: std::path::absolute(source.folder()).unwrap_or_else(|_| source.folder().to_owned()),
        };
        let is_loaded = external_law.is_some_and(|law| law.source_sha256().is_some());
        let runs_of_a_shard = if is_loaded { RUNS_UNDER_A_LOADED_LAW } else { RUNS_OF_A_SHARD };
        manifest.shards = shards.unwrap_or_else(|| manifest.runs.div_ceil(runs_of_a_shard));
        if manifest.shards == 0 || manifest.shards > manifest.runs {
            let (runs, shards) = (manifest.runs, manifest.shards);
            let problem = format!("{}: must be from 1 to {runs}, the number of runs", SHARDS.set(shards));
            return Err(refused(problem, format!("give a number in this range, or leave {SHARDS} out")));
        }
        let mut campaign = Self::read(manifest, spec, external_law)?;
        campaign.check(spec)?;
        campaign.manifest.first = campaign.first();
        campaign.manifest = campaign.manifest.sealed();
        Ok(campaign)
    }

    /// Returns the campaign of a manifest in the folder `at`. `external_law` is the law that the manifest names, if it
    /// names one.
    ///
    /// # Errors
    /// [`Failure`] if the campaign cannot be flown here, for example because a file of its scenario is missing or
    /// different, or because it has another law.
    pub fn of(manifest: Manifest, path: &Path, external_law: Option<&ExternalLaw>) -> Result<Self, Failure> {
        check_external_law(&manifest, path, external_law)?;
        let spec = Spec::read("the specification in the manifest", &manifest.spec)?;
        let campaign = Self::read(manifest, &spec, external_law)?;
        let first = campaign.first();
        if first != campaign.manifest.first {
            let problem = format!(
                "run 0 differs from the planned campaign (SHA-256 {} here, {} in the manifest)",
                first.join(", "),
                campaign.manifest.first.join(", ")
            );
            let remedy = "use the same files of the scenario on all machines";
            return Err(other_campaign(path, problem, remedy));
        }
        Ok(campaign)
    }

    fn read(manifest: Manifest, spec: &Spec, external_law: Option<&ExternalLaw>) -> Result<Self, Failure> {
        let source = Source::Embedded {
            name: manifest.scenario_name.clone(),
            text: manifest.scenario.clone(),
            folder: manifest.folder.clone(),
        };
        spec.check_stop()?;
        let sets = spec.sets();
        let mut variations = spec.variations()?;
        spec.check_overlaps(&sets, &variations)?;
        if spec.splitting.is_some() && spec.method != Method::Splitting {
            let problem = "splitting: needs method = \"splitting\"";
            return Err(spec.refuse("splitting", problem, "add the method, or leave the table out"));
        }
        let written = |(key, value): (&String, &toml::Value)| Override::parse(&format!("{key}={value}"));
        let written = sets.iter().map(written).collect::<Result<Vec<_>, _>>();
        let written = written.map_err(|error| spec.scenario("set", "", error))?;
        let base = BaseScenario::read(source, written).map_err(|error| spec.scenario("scenario", "", error))?;
        let base = base.with_external_law(external_law.cloned())?;
        base.check_keys(sets.keys().chain(variations.keys()).map(String::as_str))
            .map_err(|failure| spec.at("vary", failure))?;
        let template = base.template();
        let laws = spec.laws.iter().zip(1..).map(|(name, entry)| {
            let law = template.law(name).map_err(|error| spec.scenario(&format!("laws.{entry}"), "", error))?;
            Ok(Law { name: law.name.clone(), overrides: law.overrides() })
        });
        let mut laws = laws.collect::<Result<Vec<_>, Failure>>()?;
        if let Some((_, twice)) = laws.iter().enumerate().find(|&(k, law)| laws[..k].contains(law)) {
            let problem = format!("laws: the law `{}` is given twice", twice.name);
            return Err(spec.refuse("laws", problem, "give each law once"));
        }
        if laws.is_empty() {
            let name = external_law.map_or_else(|| template.own_law().name, |law| law.name().to_owned());
            laws.push(Law { name, overrides: Vec::new() });
        }
        let is_open = |key: &str| !sets.contains_key(key) && !variations.contains_key(key);
        let open = [
            (START_SEED, template.start_is_random() || varies(&variations, &["start."])),
            (NOISE_SEED, template.flight_is_random() || varies(&variations, &FLIGHT)),
        ];
        let drawn: Vec<_> = open.into_iter().filter(|&(key, is_random)| is_random && is_open(key)).collect();
        variations.extend(drawn.into_iter().map(|(key, _)| (key.to_owned(), Variation::Seed)));
        let splitting = (spec.method == Method::Splitting).then(|| spec.splitting.unwrap_or_default());
        let file = manifest.folder.join(&manifest.scenario_name);
        let builtin = tautline_sim::scenario::builtin::find(&manifest.scenario_name);
        let is_builtin = builtin.is_some_and(|builtin| builtin.toml == manifest.scenario);
        let argument = if is_builtin { manifest.scenario_name.clone() } else { file.display().to_string() };
        Ok(Self { manifest, base, laws, variations, seed: spec.seed, stop: spec.stop, splitting, argument })
    }

    /// Refuses values that their keys do not take, and runs that are all the same flight.
    fn check(&self, spec: &Spec) -> Result<(), Failure> {
        let grids = self.variations.values().any(|variation| variation.grid_len().is_some());
        if grids && self.stop.is_some() {
            let problem = "stop: must not be given with a grid, whose first runs are its first points";
            let remedy = "draw the values instead (list, uniform), or leave [stop] out";
            return Err(spec.refuse("stop", problem, remedy));
        }
        if self.splitting.is_some() && self.stop.is_some() {
            let problem = "stop: must not be given with splitting, which estimates no share of flights";
            return Err(spec.refuse("stop", problem, "leave [stop] or `method` out"));
        }
        let runs = self.manifest.runs;
        if runs > 1 && self.splitting.is_none() && self.runs_are_equal() {
            let problem = format!("runs: all {runs} runs are the same flight");
            let remedy = "vary a key that changes the flight, such as \"start.jitter_m\" = { uniform = [0.0, 0.1] } in \
                          [vary], or give the scenario a random start or wind";
            return Err(spec.refuse("runs", problem, remedy));
        }
        if self.manifest.external_law.is_some() && !spec.laws.is_empty() {
            let problem = "laws: must not be given with an external law, which flies every run";
            return Err(spec.refuse("laws", problem, "leave `laws` or the external law out"));
        }
        if self.manifest.external_law.is_some() && self.splitting.is_some() {
            let problem = "method: splitting copies flights under way, and copies of an external law share its memory";
            return Err(spec.refuse("method", problem, "fly whole flights, or a law of the scenario"));
        }
        for law in &self.laws {
            self.check_law(spec, law)?;
        }
        Ok(())
    }

    /// Returns whether nothing is varied, or only seeds and keys of one value that change none of the first flights.
    fn runs_are_equal(&self) -> bool {
        let hash = |run: u64| {
            let scenario = self.scenario(run, &self.laws[0]);
            scenario.map_or_else(|error| error.to_string(), |scenario| scenario.flight_sha256())
        };
        let is_fixed = |variation: &Variation| *variation == Variation::Seed || variation.is_constant();
        self.variations.values().all(is_fixed) && (1..self.manifest.runs.min(3)).all(|run| hash(run) == hash(0))
    }

    /// Refuses values that their keys do not take under a law, and a law that cannot fly.
    fn check_law(&self, spec: &Spec, law: &Law) -> Result<(), Failure> {
        let (run, scenario) = self.first_flyable(spec, law)?;
        for (key, variation) in &self.variations {
            let tried = variation.samples().into_iter().take(MOST_TRIED).map(|value| {
                let mut drawn = self.drawn(run);
                drawn.insert(key, value.clone());
                let situation = || format!("under the law {}, {key} = {value}", law.name);
                self.read_with(law, &drawn).map_err(|error| spec.scenario(&format!("vary.{key}"), &situation(), error))
            });
            let (flown, refused): (Vec<_>, Vec<_>) = tried.partition(Result::is_ok);
            let mut refused = refused.into_iter().filter_map(Result::err);
            // A range may contain values that cannot be flown, which are counted. A listed value must be valid, and
            // the ends of a range must be within the bounds of the key.
            let must_fly = variation.is_listed() || flown.is_empty();
            if let Some(failure) = refused.find(|failure| must_fly || failure.code() == OUT_OF_RANGE) {
                return Err(failure);
            }
        }
        let under = |failure: Failure| failure.under(&format!("run {run} under the law {}", law.name));
        scenario.law().map_err(|error| under(error.into()))?;
        self.splitting.iter().try_for_each(|settings| splitting::check(&scenario, settings)).map_err(under)
    }

    /// Returns the first run that can be flown under a law, with its scenario.
    fn first_flyable(&self, spec: &Spec, law: &Law) -> Result<(u64, Scenario), Failure> {
        let mut runs = 0..self.manifest.runs.min(FIRST_TRIED);
        let flyable = runs.find_map(|run| Some((run, self.scenario(run, law).ok()?)));
        let first = || self.scenario(0, law).map(|scenario| (0, scenario));
        let under = |error| spec.scenario("vary", &format!("under the law {}", law.name), error);
        flyable.map_or_else(|| first().map_err(under), Ok)
    }

    /// Returns for run 0 under each law the hash of the scenario, or the reason why the run cannot be flown.
    fn first(&self) -> Vec<String> {
        let first = self.laws.iter().map(|law| self.scenario(0, law));
        first.map(|first| first.map_or_else(|error| error.message, |first| first.resolved().sha256)).collect()
    }

    /// Returns the same campaign, whose number of runs was raised after flights had been flown.
    pub(super) fn raised(mut self) -> Self {
        self.manifest = Manifest { runs_raised: true, ..self.manifest }.sealed();
        self
    }

    /// Returns the manifest.
    #[must_use]
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Returns the scenario without drawn values.
    #[must_use]
    pub fn own(&self) -> &Scenario {
        self.base.own()
    }

    /// Returns the external law that flies every run.
    #[must_use]
    pub fn external_law(&self) -> Option<&ExternalLaw> {
        self.own().external_law.as_ref()
    }

    /// Returns the laws that fly every run, in order.
    #[must_use]
    pub fn laws(&self) -> &[Law] {
        &self.laws
    }

    /// Returns the variations of all varied keys.
    #[must_use]
    pub fn variations(&self) -> &BTreeMap<String, Variation> {
        &self.variations
    }

    /// Returns the rule for an early stop.
    #[must_use]
    pub fn stop(&self) -> Option<Stop> {
        self.stop
    }

    /// Returns the settings of splitting, if runs are estimates.
    #[must_use]
    pub fn splitting(&self) -> Option<&SplittingSettings> {
        self.splitting.as_ref()
    }

    /// Returns the seed of all random numbers.
    #[must_use]
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Returns the number of steps of all flights of `runs` runs, if all are flown to their end.
    #[must_use]
    pub fn steps(&self, runs: u64) -> u64 {
        let flights = self.splitting.map_or(1, |settings| settings.flights as u64);
        self.own().time.steps().saturating_mul(runs).saturating_mul(self.laws.len() as u64).saturating_mul(flights)
    }

    /// Returns the scenario as an argument of `tautline run`: the name of a built-in one, or a path.
    #[must_use]
    pub fn scenario_argument(&self) -> &str {
        &self.argument
    }

    /// Returns the drawn values of a run, in the order of the keys.
    #[must_use]
    pub fn values(&self, run: u64) -> Vec<Value> {
        self.drawn(run).into_values().map(|value| serde_json::to_value(value).unwrap_or_default()).collect()
    }

    /// Returns the overrides that fly a run under a law, as `--set` takes them.
    #[must_use]
    pub fn sets(&self, run: u64, law: &Law) -> Vec<String> {
        self.base.sets().chain(law.overrides.iter().cloned()).chain(written(&self.drawn(run))).collect()
    }

    /// Returns the scenario of a run under a law.
    ///
    /// # Errors
    /// [`ScenarioError`] if the drawn values cannot be flown, such as a start of two vehicles within delta.
    pub fn scenario(&self, run: u64, law: &Law) -> Result<Scenario, ScenarioError> {
        self.read_with(law, &self.drawn(run))
    }

    /// Flies a run under one of the laws, counted from 0. Returns `None` after an interruption: it ends estimates, but
    /// not flights under way.
    ///
    ///
    /// # Errors
    /// [`Failure`] if a law or a judge cannot be built, or the campaign has no such law.
    pub fn row(&self, run: u64, law: usize, batch: &Batch<'_>) -> Result<Option<Row>, Failure> {
        let Some(named) = self.laws().get(law) else {
            let problem = format!("law: must be from 0 to {}, got {law}", self.laws().len() - 1);
            return Err(refused(problem, "give the number of a law of the campaign"));
        };
        let mut row = Row { run, law, drawn: self.values(run), not_flown: None, flight: None, splitting: None };
        let scenario = match self.scenario(run, named) {
            Ok(scenario) => scenario,
            Err(error) => {
                batch.monitor().advance(self.own().time.steps());
                row.not_flown = Some(error.message);
                return Ok(Some(row));
            }
        };
        let under = |failure: Failure| failure.under(&format!("run {run} under the law {}", named.name));
        if let Some(settings) = self.splitting() {
            let (seeds, mut reported) = ([self.seed(), run], 0);
            let split = splitting::estimate(&scenario, settings, seeds, &mut batch.carry_on(&mut reported, false));
            row.splitting = split.map_err(under)?;
        } else {
            let flown = batch.finishing_flights().fly(&scenario, run);
            row.flight = flown.map_err(|error| under(error.into()))?;
        }
        Ok((row.flight.is_some() || row.splitting.is_some()).then_some(row))
    }

    /// Flies the whole campaign without files. Returns the answer of [`super::Folder::merge`], or `None` after an
    /// interruption.
    ///
    /// # Errors
    /// As [`Campaign::row`].
    pub fn fly(&self, batch: &Batch<'_>) -> Result<Option<Summary>, Failure> {
        let (laws, runs) = (self.laws().len(), self.manifest().runs);
        let mut gathered = SummaryAccumulator::new(self);
        let mut from = 0;
        while from < runs && !gathered.is_enough() {
            let to = runs.min(from + AT_ONCE);
            let places: Vec<_> = (from..to).flat_map(|run| (0..laws).map(move |law| (run, law))).collect();
            for row in batch.run(places.len(), |number| self.row(places[number].0, places[number].1, batch))? {
                let Some(row) = row else { return Ok(None) };
                gathered.take(&row);
            }
            from = to;
        }
        Ok(Some(gathered.finish(self)))
    }

    fn read_with(&self, law: &Law, drawn: &BTreeMap<&str, toml::Value>) -> Result<Scenario, ScenarioError> {
        self.base.with(&law.overrides.iter().cloned().chain(written(drawn)).collect::<Vec<_>>())
    }

    fn drawn(&self, run: u64) -> BTreeMap<&str, toml::Value> {
        // The last grid changes fastest, like the last digit of a number.
        let mut rest = run;
        let places = self.variations.iter().rev().map(|(key, variation)| {
            let place = variation.grid_len().map_or(0, |len| {
                let place = rest % len.max(1);
                rest /= len.max(1);
                place
            });
            (key.as_str(), variation.value(self.seed, key, run, place))
        });
        places.collect()
    }
}

/// Refuses an external law that is not the one that a manifest names.
fn check_external_law(manifest: &Manifest, path: &Path, given: Option<&ExternalLaw>) -> Result<(), Failure> {
    let source = given.and_then(ExternalLaw::source_sha256);
    let (planned, given) = (manifest.external_law.as_deref(), given.map(ExternalLaw::name));
    if planned == given {
        if manifest.external_law_sha256.as_deref() == source {
            return Ok(());
        }
        let [there, here] = [manifest.external_law_sha256.as_deref(), source].map(|sha256| sha256.unwrap_or("none"));
        let law = planned.unwrap_or_default();
        let problem = format!("the source of the law `{law}` has the SHA-256 {here} here, and {there} in the manifest");
        let remedy = "use the same file on all machines, or plan the campaign again into another folder";
        return Err(other_campaign(path, problem, remedy));
    }
    let named = |law: Option<&str>| law.map_or_else(|| "the law of its scenario".to_owned(), |law| format!("`{law}`"));
    let problem = format!("the campaign flies {}, and this is {}", named(planned), named(given));
    let remedy = match planned {
        Some(law) if manifest.external_law_sha256.is_some() => {
            format!("use the program of the Python package, which imports `{law}`: python -m tautline campaign ...")
        }
        Some(law) => format!("continue the campaign in Python: tautline.campaign(..., law={law}(...))"),
        None => "continue without an external law, or give another folder".to_owned(),
    };
    Err(other_campaign(path, problem, remedy))
}

fn written<'a>(drawn: &'a BTreeMap<&'a str, toml::Value>) -> impl Iterator<Item = String> + 'a {
    drawn.iter().map(|(key, value)| format!("{key}={value}"))
}

/// Returns whether a key of one of these tables is varied.
fn varies(variations: &BTreeMap<String, Variation>, tables: &[&str]) -> bool {
    variations.keys().any(|key| tables.iter().any(|table| key.starts_with(table)))
}

/// Returns the number of runs: that of the specification, by default one for each point of the grids.
fn runs(spec: &Spec) -> Result<u64, Failure> {
    let grids: Vec<_> = spec.variations()?.values().filter_map(Variation::grid_len).collect();
    let points = grids.iter().copied().try_fold(1_u64, u64::checked_mul).filter(|&points| points <= MOST_RUNS);
    let points = points.ok_or_else(|| {
        let remedy = "give fewer values, or draw them: { uniform = [low, high] } with `runs`";
        spec.refuse("vary", format!("vary: the grids have more than {MOST_RUNS} points together"), remedy)
    })?;
    match spec.runs {
        None if grids.is_empty() => {
            let problem = "runs: missing key, which only grids can replace";
            Err(spec.at_beginning(refused(problem, "add the number of runs, such as runs = 1000")))
        }
        None => Ok(points),
        Some(runs) if runs == 0 || runs > MOST_RUNS => {
            let problem = format!("runs: must be from 1 to {MOST_RUNS}, got {runs}");
            Err(spec.refuse("runs", problem, "give a number in this range"))
        }
        Some(runs) if runs % points != 0 => {
            let problem = format!("runs: must be a multiple of the {points} points of the grids, got {runs}");
            Err(spec.refuse("runs", problem, "give a multiple, or leave `runs` out to fly each point once"))
        }
        Some(runs) => Ok(runs),
    }
}
