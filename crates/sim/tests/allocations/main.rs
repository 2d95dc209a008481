//! Operations of every step allocate no memory.
//!
//! One program without a test harness: the counter is global, and a harness has threads of its own.

mod audit;
mod laws;
mod space;
mod step_loop;

use std::alloc::System;

use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

fn main() {
    laws::control_energy_and_errors_of_the_shape_allocate_nothing();
    laws::a_law_that_senses_allocates_nothing_once_its_lists_have_grown();
    space::a_search_of_near_pairs_that_has_grown_allocates_nothing();
    audit::a_step_of_a_warm_auditor_allocates_nothing();
    audit::the_memory_of_an_audit_is_linear_in_the_vehicles();
    step_loop::the_loop_allocates_nothing_per_step();
    step_loop::worlds_allocate_nothing_per_step();
    println!("a step allocates nothing");
}
