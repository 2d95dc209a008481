//! Tables of tests/reports/attacks.md: CMA-ES compared with uniform random search, and the worst start found for each
//! law.

use tautline::attack::{Attack, Bound, Options, SearchSpace};
use tautline::request::{ScenarioRequest, Silent};
use tautline::studies::base::BaseScenario;
use tautline::studies::{Batch, StudyRequest, answer};
use tautline::wind::Normals;

/// A search: scenario, settings, varied keys and number of flights.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    scenario: &'static str,
    sets: &'static [&'static str],
    start_m: f64,
    apart_m: f64,
    vary: &'static [&'static str],
    flights: u64,
}

/// Searches in which CMA-ES must beat random search with the same number of flights.
pub(crate) const CASES: [Case; 2] = [
    Case {
        name: "potential field, acceleration limited",
        scenario: "pentagon",
        sets: &["law.kind=potential", "law.max_accel_m_s2=1", "time.duration_s=12", "time.dt_s=0.02"],
        start_m: 0.5,
        apart_m: 2.5,
        vary: &[],
        flights: 200,
    },
    Case {
        name: "star with loss",
        scenario: "leader-lossy",
        sets: &["time.duration_s=12", "time.dt_s=0.02"],
        start_m: 0.5,
        apart_m: 2.5,
        vary: &["network.loss=0..0.3"],
        flights: 200,
    },
];

/// Seeds of the search in a comparison.
pub(crate) const SEEDS: u64 = 20;

/// Laws whose worst start on the pentagon is searched for.
const LAWS: [&str; 7] = ["edge-tension", "displacement", "laplacian", "potential", "orca", "cbf-qp", "flocking"];
const LAW_FLIGHTS: u64 = 300;

impl Case {
    fn request(&self, law: Option<&str>, seed: u64) -> StudyRequest<Options> {
        let law = law.map(|law| format!("law.kind={law}"));
        let sets: Vec<_> = law.into_iter().chain(self.sets.iter().map(|&set| set.to_owned())).collect();
        let vary = self.vary.iter().map(|text| Bound::parse(text).expect("a variation")).collect();
        let (start_m, apart_m, flights) = (Some(self.start_m), Some(self.apart_m), self.flights);
        let options = Options { vary, start_m, apart_m, flights, seed, ..Options::default() };
        StudyRequest::new(ScenarioRequest::named(self.scenario, &sets).expect("a scenario"), options)
    }

    fn search(&self, law: Option<&str>, seed: u64) -> Attack {
        let attack = answer(&self.request(law, seed), &(), &Silent::default());
        attack.unwrap_or_else(|error| panic!("{}: {error}", self.name)).expect("not interrupted")
    }

    /// Returns the smallest separation of the same number of flights drawn uniformly within the bounds \[m\].
    fn random_m(&self, seed: u64) -> f64 {
        let StudyRequest { scenario, options, .. } = self.request(None, seed);
        let space = SearchSpace::new(&BaseScenario::of(&scenario).expect("a scenario"), &options).expect("a space");
        let mut normals = Normals::new(seed, 0);
        let draw = || space.values(&space.bounds().iter().map(|_| normals.unit()).collect::<Vec<_>>());
        let flyable = std::iter::repeat_with(draw).filter_map(|values| space.candidate(&values).ok());
        let flights: Vec<_> = flyable.take(usize::try_from(self.flights).expect("few")).flatten().collect();
        let monitor = Silent::default();
        let batch = Batch::new(None, &monitor).expect("threads");
        let flown = batch.run(flights.len(), |number| batch.fly(&flights[number], 0)).expect("flown");
        flown.into_iter().flatten().filter_map(|flight| flight.min_m).fold(f64::INFINITY, f64::min)
    }

    /// Returns the smallest separations that CMA-ES and random search find \[m\].
    pub(crate) fn found_m(&self, seed: u64) -> [f64; 2] {
        let attack = self.search(None, seed);
        [attack.worst().and_then(|worst| worst.flown.min_m).expect("a separation"), self.random_m(seed)]
    }

    /// Returns the cells of one seed.
    pub(crate) fn cells(&self, seed: u64) -> [String; 2] {
        self.found_m(seed).map(shown)
    }
}

/// Returns a row for each seed with both searches, and how often CMA-ES finds the smaller separation.
pub(crate) fn beside_random() -> String {
    let names: Vec<_> = CASES.iter().map(|case| format!("{}: CMA-ES [m] | random [m]", case.name)).collect();
    let mut better = [0; CASES.len()];
    let line = |seed: u64| {
        let found = CASES.each_ref().map(|case| case.found_m(seed));
        for (better, [cma_es, random]) in better.iter_mut().zip(found) {
            *better += u64::from(cma_es < random);
        }
        let cells: Vec<_> = found.iter().flatten().copied().map(shown).collect();
        format!("| {seed} | {} |\n", cells.join(" | "))
    };
    let lines: String = (0..SEEDS).map(line).collect();
    let [potential, star] = better;
    format!(
        "| seed | {} |\n| --- | --- | --- | --- | --- |\n{lines}\
         | CMA-ES finds less | {potential} of {SEEDS} | | {star} of {SEEDS} | |\n",
        names.join(" | ")
    )
}

/// Formats a separation \[m\], rounded down so that a value below delta is shown below it.
fn shown(found_m: f64) -> String {
    format!("{:.4}", (1e4 * found_m).floor() / 1e4)
}

/// Returns a row for each law with its worst start on the pentagon.
pub(crate) fn worst_starts() -> String {
    let head = "| law | as it is [m] | worst found [m] | certified for that start [m] | flights that violated |\n\
                | --- | --- | --- | --- | --- |\n";
    head.to_owned() + &LAWS.map(worst_start).concat()
}

/// Returns the row of one law.
pub(crate) fn worst_start(law: &str) -> String {
    let case = Case {
        name: "pentagon",
        scenario: "pentagon",
        sets: &["time.duration_s=20"],
        start_m: 0.5,
        apart_m: 2.5,
        vary: &[],
        flights: LAW_FLIGHTS,
    };
    let attack = case.search(Some(law), 0);
    let worst = attack.worst().expect("a flight");
    let length = |length: Option<f64>| length.map_or_else(|| "-".to_owned(), shown);
    let [own, found, certified] = [attack.own.min_m, worst.flown.min_m, worst.flown.certified_m].map(length);
    format!("| `{law}` | {own} | {found} | {certified} | {} of {} |\n", attack.violated, attack.flights)
}
