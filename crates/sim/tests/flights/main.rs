//! Scenarios, laws, plants and the simulation loop.

mod flight;

mod built_ins;
mod displacement;
mod ideal_plant;
mod imperfections;
mod law_properties;
mod links;
mod loop_claims;
mod numbers;
mod obstacles;
mod plant_claims;
mod quadrotors;
mod reach;
mod reference_flights;
mod references;
mod safety;
mod scenario_bytes;
mod scenario_files;
mod scenario_keys;
mod schema;
mod schema_properties;
mod shapes;
mod shield;
mod simulation;
mod symmetry;
mod unicycles;
mod vector;
mod wind;
