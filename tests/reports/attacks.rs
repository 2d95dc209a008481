//! Compares `attacks.md` with flights, one seed by default, all tables with `TAUTLINE_LONG=1`, and `docs/studies.md`
//! with `attacks.md`.

#[path = "../support/attacks.rs"]
mod tables;

use tables::{CASES, Case, SEEDS};

const PAGE: &str = include_str!("../../docs/studies.md");
const SEARCHES: &str = include_str!("attacks.md");
/// Number of the twenty seeds for which CMA-ES must find a smaller separation.
const MIN_BETTER: u64 = 18;

/// Returns the table of a command.
fn on_page(command: &str) -> &'static str {
    let [begin, end] =
        ["begin", "end"].map(|mark| format!("<!-- {mark}: cargo run --release --example {command} -->\n"));
    let (_, rest) = SEARCHES.split_once(&begin).expect("a mark");
    rest.split_once(&end).expect("a mark").0
}

/// Returns the results of a seed: CMA-ES and random search on each case \[m\].
fn found_m(seed: u64) -> [f64; 2 * CASES.len()] {
    let line = on_page("attacks").lines().find(|line| line.starts_with(&format!("| {seed} |"))).expect("a line");
    let cells: Vec<f64> =
        line.trim_matches('|').split('|').skip(1).map(|cell| cell.trim().parse().expect("m")).collect();
    cells.try_into().expect("two searches of each case")
}

fn is_long() -> bool {
    std::env::var_os("TAUTLINE_LONG").is_some()
}

#[test]
fn cma_es_beats_random_search_with_the_same_number_of_flights() {
    for (case, Case { name, .. }) in CASES.iter().enumerate() {
        let count = |less: &dyn Fn(u64) -> bool| (0..SEEDS).filter(|&seed| less(seed)).count() as u64;
        let better = count(&|seed| found_m(seed)[2 * case] < found_m(seed)[2 * case + 1]);
        assert!(better >= MIN_BETTER, "{name}: {better} of {SEEDS}");
        assert!(PAGE.contains(&format!("{better} of {SEEDS}")), "docs/studies.md lacks {better} of {SEEDS} for {name}");
        let of_itself = count(&|seed| found_m(seed)[2 * case + 1] < found_m((seed + 1) % SEEDS)[2 * case + 1]);
        assert!(of_itself < MIN_BETTER, "{name}: {of_itself} of {SEEDS}");
    }
}

#[test]
fn the_tables_of_the_page_match_flights() {
    if is_long() {
        for (command, flown) in [("attacks", tables::beside_random()), ("attacks laws", tables::worst_starts())] {
            let page = on_page(command);
            assert!(page == flown, "the page of {command} has\n{page}and flown was\n{flown}");
        }
        return;
    }
    let case = &CASES[0];
    let [cma_es, random] = case.cells(0);
    let line = on_page("attacks").lines().find(|line| line.starts_with("| 0 |")).expect("a line");
    assert!(line.starts_with(&format!("| 0 | {cma_es} | {random} |")), "{line}: {cma_es} {random}");
}
