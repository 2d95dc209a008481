//! Tests of properties that all laws share.

use super::*;
use crate::formation::Formation;
use crate::graph::Graph;
use crate::observation::{Observation, OtherStates, StateTables};
use crate::space::CellList;
use crate::target::{CurrentTarget, Leg};
use tautline_core::swarm::{Rows, Swarm};

const COUNT: usize = 6;

/// Returns a moving swarm off its slots, with separations above 1 m.
fn swarm() -> Swarm {
    let stir = |i: usize, axis: usize| 0.2 * libm::sin((3 * i + axis) as f64);
    let slots_m = Formation::grid(COUNT, 1.7).slots_m;
    Swarm {
        positions_m: Rows::from_fn(COUNT, |i, axis| slots_m[(i, axis)] + stir(i, axis)),
        velocities_m_s: Rows::from_fn(COUNT, |i, axis| stir(i + 7, axis)),
    }
}

fn built(spec: &LawSpec, links: &Graph, formation: &Formation) -> Box<dyn Law> {
    let context = LawContext::new(links, formation, 1.0, 0.1);
    spec.clone().complete(0.1).build(&context).expect("a law")
}

fn command(law: &mut dyn Law, observation: &Observation<'_>) -> Rows {
    let mut near = CellList::default();
    near.update(&observation.own.positions_m, law.capabilities().sensing_range_m.unwrap_or(0.0));
    let mut command = Rows::zeros(COUNT);
    law.command(&Observation { near: near.pairs(), ..*observation }, &mut command).expect("a command");
    command
}

#[test]
fn separate_exact_tables_give_the_command_of_the_shared_state() {
    let (swarm, formation) = (swarm(), Formation::grid(COUNT, 2.0));
    let held = StateTables {
        received: vec![swarm.clone(); COUNT],
        ages_s: vec![vec![0.0; COUNT]; COUNT],
        sensed: vec![swarm.clone(); COUNT],
    };
    for spec in LawSpec::all() {
        for links in [Graph::complete(COUNT), Graph::star(COUNT)] {
            let mut law = built(&spec, &links, &formation);
            let shared = Observation::exact(&swarm, &links, &formation);
            let expected = command(law.as_mut(), &shared);
            let found = command(law.as_mut(), &Observation { others: OtherStates::PerVehicle(&held), ..shared });
            assert!((&found - &expected).amax() < 1e-12 * expected.amax(), "{spec:?}: {found} {expected}");
            assert!(expected.amax() > 0.1, "{spec:?}: command is not zero");
        }
    }
}

#[test]
fn a_command_depends_only_on_the_tables_of_its_vehicle() {
    // Vehicles change sides, so that others are in their way.
    let (swarm, formation) = (swarm(), Formation::points(-Formation::grid(COUNT, 2.0).slots_m));
    let pictures = |vehicle: Option<usize>| {
        let mut held = StateTables {
            received: vec![swarm.clone(); COUNT],
            ages_s: vec![vec![0.0; COUNT]; COUNT],
            sensed: vec![swarm.clone(); COUNT],
        };
        if let Some(vehicle) = vehicle {
            // This vehicle's tables have all others displaced and moving quickly to the middle.
            for picture in [&mut held.received[vehicle], &mut held.sensed[vehicle]] {
                picture.positions_m.iter_mut().enumerate().for_each(|(k, x)| *x += 0.05 * libm::sin(k as f64));
                picture.velocities_m_s -= 6.0 * &picture.positions_m;
            }
        }
        held
    };
    for spec in LawSpec::all() {
        for links in [Graph::complete(COUNT), Graph::star(COUNT), Graph::ring(COUNT)] {
            let mut law = built(&spec, &links, &formation);
            let mut command_with = |vehicle: Option<usize>| {
                let held = pictures(vehicle);
                let observation = Observation {
                    others: OtherStates::PerVehicle(&held),
                    ..Observation::exact(&swarm, &links, &formation)
                };
                command(law.as_mut(), &observation)
            };
            let plain = command_with(None);
            let mut own = 0;
            for vehicle in 0..COUNT {
                let other = command_with(Some(vehicle));
                let changed = |i: usize| (0..3).any(|axis| other[(i, axis)] != plain[(i, axis)]);
                own += u32::from(changed(vehicle));
                assert!(
                    (0..COUNT).all(|i| i == vehicle || !changed(i)),
                    "{spec:?}: a command depends on the tables of vehicle {vehicle}"
                );
            }
            // Half-spaces may leave the preferred value of a vehicle unchanged.
            assert!(own > 0, "{spec:?}: no command depends on its vehicle's own tables");
        }
    }
}

#[test]
fn following_new_slots_equals_building_the_law_for_them() {
    let (swarm, first, next) = (swarm(), Formation::grid(COUNT, 2.0), Formation::grid(COUNT, 2.6));
    for spec in LawSpec::all() {
        let links = Graph::complete(COUNT);
        let mut law = built(&spec, &links, &first);
        let mut target = CurrentTarget::first_of(&[Leg::first(first.clone())]).expect("a leg");
        target.begin(1, &next);
        law.follow(&target.view()).expect("slots clear of delta");
        let observation = Observation { target: target.view(), ..Observation::exact(&swarm, &links, &next) };
        let anew = command(built(&spec, &links, &next).as_mut(), &observation);
        assert_eq!(command(law.as_mut(), &observation), anew, "{spec:?}");
        assert_eq!(
            law.capabilities().sensing_range_m,
            built(&spec, &links, &next).capabilities().sensing_range_m,
            "{spec:?}"
        );
    }
}

#[test]
fn needs_include_a_compass_for_displacements_and_sensing_for_a_range() {
    for spec in LawSpec::all() {
        let law = built(&spec, &Graph::complete(COUNT), &Formation::grid(COUNT, 2.0));
        let needs = |what: &str| law.capabilities().needs.iter().any(|need| need.contains(what));
        assert_eq!(needs("compass"), law.capabilities().controls == Controls::Displacements, "{spec:?}");
        assert_eq!(needs("senses"), law.capabilities().sensing_range_m.is_some(), "{spec:?}");
        assert!(law.capabilities().needs.iter().all(|need| !need.is_empty()), "{spec:?}");
        assert!(
            law.capabilities().assumptions.starts_with("The certified separation holds for ")
                && law.capabilities().assumptions.ends_with('.')
        );
    }
}

#[test]
fn laws_are_named_like_their_kinds() {
    let (links, formation) = (Graph::complete(COUNT), Formation::grid(COUNT, 2.0));
    let specs = LawSpec::all();
    let names: Vec<_> = specs.iter().map(|spec| built(spec, &links, &formation).name().to_owned()).collect();
    let kinds = ["edge-tension", "displacement", "laplacian", "potential", "orca", "bvc", "cbf-qp", "flocking"];
    assert_eq!(names, kinds);
}
