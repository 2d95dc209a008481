//! Prints the tables of tests/reports/attacks.md: CMA-ES and random search, or with `laws` the worst start of each law.
//!
//! `cargo run --release --example attacks [laws]`

#[path = "../tests/support/attacks.rs"]
#[allow(dead_code, reason = "the test uses other parts")]
mod attacks;

fn main() {
    let laws = std::env::args().nth(1).is_some_and(|table| table == "laws");
    print!("{}", if laws { attacks::worst_starts() } else { attacks::beside_random() });
}
