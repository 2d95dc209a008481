//! Compares `docs/studies.md` with flights: one row by default, the whole table with `TAUTLINE_LONG=1`.

#[path = "../support/margins.rs"]
mod table;

const PAGE: &str = include_str!("../../docs/studies.md");
const BEGIN: &str = "<!-- begin: cargo run --release --example margins -->\n";
const END: &str = "<!-- end: cargo run --release --example margins -->\n";

#[test]
fn the_table_of_the_page_matches_flights() {
    let page = PAGE.split_once(BEGIN).and_then(|(_, rest)| rest.split_once(END)).expect("two marks").0;
    if std::env::var_os("TAUTLINE_LONG").is_some() {
        let flown = table::table();
        assert!(page == flown, "docs/studies.md has\n{page}and flown was\n{flown}");
        return;
    }
    let key = "actuation.max_accel_m_s2";
    let line = page.lines().find(|line| line.contains(key)).expect("a row");
    let cells: Vec<_> = line.split('|').map(str::trim).collect();
    let flown = table::cells(key, 0).expect("a row of the table");
    assert_eq!(cells[3..5], flown.each_ref().map(String::as_str), "{line}");
}
