//! Scenarios, laws, plants and the loop that flies them.

#[path = "../support/flight.rs"]
mod flight;

mod built_ins;
mod displacement;
mod ideal_plant;
mod imperfections;
mod law_properties;
mod links;
mod loop_claims;
mod missions;
mod obstacles;
mod plant_claims;
mod quadrotors;
mod random_scenarios;
mod reach;
mod reference_flights;
mod rivals;
mod safety;
mod scenario_bytes;
mod scenario_files;
mod scenario_keys;
mod schema;
mod shapes;
mod simulation;
mod steps;
mod symmetry;
mod unicycles;
mod verdicts;
mod wind;
