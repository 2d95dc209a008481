//! Tests of pictures and films, by the library and by the program.

#[path = "../support/program.rs"]
mod program;

mod pictures;
mod render;
