//! Prints the tables of docs/attack.md: CMA-ES and random search, and with `laws` the worst start found for each law.
//!
//! `cargo run --release --example attacks [laws]`

#[path = "../tests/support/attacks.rs"]
#[allow(dead_code, reason = "the test asks for parts of it")]
mod attacks;

fn main() {
    let laws = std::env::args().nth(1).is_some_and(|table| table == "laws");
    print!("{}", if laws { attacks::worst_starts() } else { attacks::beside_random() });
}
