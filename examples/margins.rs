//! Prints the table of docs/margins.md: how much of each imperfection points and Crazyflies tolerate.
//!
//! `cargo run --release --example margins`

#[path = "../tests/support/margins.rs"]
mod margins;

fn main() {
    print!("{}", margins::table());
}
