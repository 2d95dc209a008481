//! Prints the table of margins in docs/studies.md: margins of points and Crazyflies for each imperfection.
//!
//! `cargo run --release --example margins`

#[path = "../tests/support/margins.rs"]
mod margins;

fn main() {
    print!("{}", margins::table());
}
