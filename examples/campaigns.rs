//! Prints the tables of docs/campaigns.md: results of each law from random starts, and the leader star over a lossy
//! radio.
//!
//! `cargo run --release --example campaigns [MOST_RUNS]`

#[path = "../tests/support/campaigns.rs"]
mod campaigns;

fn main() {
    let most_runs = std::env::args().nth(1).and_then(|runs| runs.parse().ok()).unwrap_or(1000);
    campaigns::table(most_runs, &mut |line| print!("{line}"));
    print!("\n{}", campaigns::lossy(most_runs));
}
