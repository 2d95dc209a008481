//! The program, run as a user runs it.

#[path = "../support/program.rs"]
mod program;

mod archives;
mod attack;
mod audit;
mod campaign;
mod campaign_files;
mod check;
mod compare;
mod determinism;
mod doors;
mod ellipsoids;
mod exports;
mod fixes;
mod heights;
mod imperfections;
mod interruption;
mod keys;
mod layouts;
mod limits;
mod margin;
mod obstacles;
mod own_recordings;
mod presence;
mod proofs;
mod reading;
mod reads;
mod references;
mod refuses;
mod runs;
mod scenarios;
mod shapes;
mod told;
