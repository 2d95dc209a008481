//! Tests of the displacement law with a reference and with several legs.

use proptest::prelude::*;

use super::*;
use crate::graph::Graph;
use crate::observation::{OtherStates, StateTables};
use crate::target::{Guidance, Leg, Reference, ReferenceMotion};
use tautline_core::swarm::Swarm;

const COUNT: usize = 6;
const DELTA_M: f64 = 1.0;
const A22_PER_S: f64 = 0.2;

fn pinnings() -> [Pinning; 4] {
    [Pinning::All, Pinning::Listed(vec![1, 4]), Pinning::Leader(0), Pinning::Leader(3)]
}

fn graphs() -> [Graph; 4] {
    [Graph::complete(COUNT), Graph::star(COUNT), Graph::ring(COUNT), Graph::path(COUNT)]
}

fn guidance(known_by: &Pinning) -> Guidance {
    let motion = ReferenceMotion::Circle { centre_m: Vector3::zeros(), radius_m: 2.0, period_s: 9.0 };
    Guidance { motion, known_by: known_by.clone(), feed_forward: true }
}

fn law(links: &Graph, formation: &Formation, later: &[Leg], guidance: &Guidance) -> DisplacementLaw {
    let context =
        LawContext { later, guidance: Some(guidance), ..LawContext::new(links, formation, DELTA_M, A22_PER_S) };
    DisplacementLaw::new(&context, DisplacementKeys::default()).expect("a law")
}

fn command(law: &mut DisplacementLaw, observation: &Observation<'_>) -> Rows {
    let mut near = CellList::default();
    near.update(&observation.own.positions_m, law.tension.rest_m());
    let mut command = Rows::zeros(COUNT);
    law.command(&Observation { near: near.pairs(), ..*observation }, &mut command).expect("a command");
    command
}

fn observation<'a>(
    swarm: &'a Swarm,
    links: &'a Graph,
    formation: &'a Formation,
    reference: Reference,
) -> Observation<'a> {
    let exact = Observation::exact(swarm, links, formation);
    Observation { target: Target { reference, ..exact.target }, ..exact }
}

fn moving() -> Reference {
    guidance(&Pinning::All).motion.at(1.3)
}

/// Swarms displaced from the slots, with some near pairs; a leader is on the reference.
fn swarms() -> impl Strategy<Value = Swarm> {
    prop::collection::vec(-0.4..0.4_f64, 6 * COUNT).prop_map(|off| {
        let (slots_m, reference) = (Formation::grid(COUNT, 2.0).slots_m, moving());
        let mut swarm = Swarm {
            positions_m: Rows::from_fn(COUNT, |i, axis| {
                slots_m[(i, axis)] + reference.position_m[axis] + off[3 * i + axis]
            }),
            velocities_m_s: Rows::from_fn(COUNT, |i, axis| off[3 * (COUNT + i) + axis]),
        };
        for leader in [0, 3] {
            set_row(&mut swarm.positions_m, leader, row(&slots_m, leader) + reference.position_m);
            set_row(&mut swarm.velocities_m_s, leader, reference.velocity_m_s);
        }
        swarm
    })
}

/// Covers all pinnings, with shared and with separate tables.
#[test]
fn a_vehicle_that_is_not_finite_is_reported_with_any_pinning_and_tables() {
    let (formation, links) = (Formation::grid(COUNT, 2.0), Graph::star(COUNT));
    for pinning in pinnings() {
        let guidance = guidance(&pinning);
        let mut law = law(&links, &formation, &[], &guidance);
        for vehicle in 0..COUNT {
            let (clear, mut lost) =
                (Swarm::at_rest(formation.slots_m.clone()), Swarm::at_rest(formation.slots_m.clone()));
            lost.velocities_m_s[(vehicle, 1)] = f64::NAN;
            let held = StateTables {
                received: vec![clear.clone(); COUNT],
                ages_s: vec![vec![0.0; COUNT]; COUNT],
                sensed: vec![clear; COUNT],
            };
            for others in [OtherStates::Shared, OtherStates::PerVehicle(&held)] {
                let observation = Observation { others, ..observation(&lost, &links, &formation, moving()) };
                assert_eq!(
                    law.command(&observation, &mut Rows::zeros(COUNT)),
                    Err(LawError::NotFinite { vehicle }),
                    "{pinning:?}"
                );
            }
        }
    }
    // A single vehicle without neighbours.
    let (formation, links) = (Formation::grid(1, 2.0), Graph::complete(1));
    let context = LawContext::new(&links, &formation, DELTA_M, A22_PER_S);
    let mut law = DisplacementLaw::new(&context, DisplacementKeys::default()).expect("a law");
    let mut lost = Swarm::at_rest(formation.slots_m.clone());
    lost.positions_m[(0, 2)] = f64::INFINITY;
    let clear = Swarm::at_rest(formation.slots_m.clone());
    let held = StateTables { received: vec![clear.clone()], ages_s: vec![vec![0.0]], sensed: vec![clear] };
    for others in [OtherStates::Shared, OtherStates::PerVehicle(&held)] {
        let observation = Observation { others, ..Observation::exact(&lost, &links, &formation) };
        assert_eq!(law.command(&observation, &mut Rows::zeros(1)), Err(LawError::NotFinite { vehicle: 0 }));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Computes dE/dt as a difference quotient along the motion, with a moving reference.
    #[test]
    fn the_energy_with_a_moving_reference_decays_at_the_proved_rate(swarm in swarms()) {
        const STEP_S: f64 = 1e-6;
        let (formation, reference) = (Formation::grid(COUNT, 2.0), moving());
        for links in graphs() {
            for known_by in pinnings() {
                let mut law = law(&links, &formation, &[], &guidance(&known_by));
                let u = command(&mut law, &observation(&swarm, &links, &formation, reference));
                let state_at = |dt_s: f64| {
                    let r = guidance(&known_by).motion.at(1.3 + dt_s);
                    let accelerations = &u + &swarm.velocities_m_s * A22_PER_S;
                    let moved = Swarm {
                        positions_m: &swarm.positions_m + &swarm.velocities_m_s * dt_s,
                        velocities_m_s: &swarm.velocities_m_s + accelerations * dt_s,
                    };
                    law.energy(&observation(&moved, &links, &formation, r)).expect("an energy")
                };
                let rate = (state_at(STEP_S) - state_at(-STEP_S)) / (2.0 * STEP_S);
                let square = |i: usize| (row(&swarm.velocities_m_s, i) - reference.velocity_m_s).norm_squared();
                let squares: f64 = (0..COUNT).map(square).sum();
                prop_assert!(rate <= -squares + 1e-5 * (1.0 + squares), "{known_by:?}: {rate}, {squares}");
            }
        }
    }

    #[test]
    fn a_jump_of_the_slots_stays_within_the_certified_energy(
        swarm in swarms(), scale in 1.0..2.5_f64, yaw in -3.0..3.0_f64,
    ) {
        let formation = Formation::grid(COUNT, 2.0);
        let next = Leg::first(formation.clone()).placed(scale, yaw, Vector3::new(1.0, -2.0, 0.0));
        for links in graphs() {
            for known_by in pinnings() {
                let later = [next.clone()];
                let law = law(&links, &formation, &later, &guidance(&known_by));
                let before = observation(&swarm, &links, &formation, moving());
                let certificate = law.certificate(&before, &[&next.formation]);
                let after = law.energy(&observation(&swarm, &links, &next.formation, moving())).expect("an energy");
                let [first, second] = certificate.legs[..] else { panic!("{certificate:?}") };
                // Errors are relative to a leader's slot.
                prop_assert!(after <= second.energy * (1.0 + 1e-12), "{known_by:?}: {after} {second:?}");
                prop_assert_eq!(Some(first.energy), certificate.energy_initial);
                prop_assert_eq!(certificate.certified_m, second.certified_m);
                prop_assert!(second.certified_m <= first.certified_m);
            }
        }
    }
}

#[test]
fn vehicles_on_the_reference_get_its_feed_forward() {
    let (formation, reference) = (Formation::grid(COUNT, 2.0), moving());
    let mut swarm = Swarm::at_rest(formation.slots_m.clone());
    for i in 0..COUNT {
        let place_m = row(&formation.slots_m, i) + reference.position_m;
        set_row(&mut swarm.positions_m, i, place_m);
        set_row(&mut swarm.velocities_m_s, i, reference.velocity_m_s);
    }
    let expected = feed_forward_acceleration(&reference, A22_PER_S);
    for links in graphs() {
        for known_by in pinnings() {
            let mut law = law(&links, &formation, &[], &guidance(&known_by));
            let found = command(&mut law, &observation(&swarm, &links, &formation, reference));
            assert!((0..COUNT).all(|i| (row(&found, i) - expected).norm() < 1e-12), "{known_by:?}: {found}");
            let elsewhere = Reference { position_m: reference.position_m + Vector3::x(), ..reference };
            let drawn = command(&mut law, &observation(&swarm, &links, &formation, elsewhere));
            assert!((&drawn - &found).amax() > 0.1, "{known_by:?}");
        }
    }
}

#[test]
fn a_leader_is_independent_of_other_vehicles() {
    let formation = Formation::grid(COUNT, 2.0);
    let mut swarm = Swarm::at_rest(formation.slots_m.clone());
    swarm.positions_m[(1, 0)] = 1.3;
    let reference = Reference::at_rest();
    let mut led = law(&Graph::star(COUNT), &formation, &[], &guidance(&Pinning::Leader(0)));
    let links = Graph::star(COUNT);
    let found = command(&mut led, &observation(&swarm, &links, &formation, reference));
    assert_eq!(row(&found, 0), Vector3::zeros());
    let mut known = law(&links, &formation, &[], &guidance(&Pinning::All));
    let pushed = command(&mut known, &observation(&swarm, &links, &formation, reference));
    assert!(row(&pushed, 0).norm() > 0.1);
}

#[test]
fn the_smallest_slot_distance_of_all_legs_holds_from_the_start() {
    let (wide, tight) = (Formation::grid(COUNT, 3.0), Leg::first(Formation::grid(COUNT, 2.0)));
    let links = Graph::complete(COUNT);
    let known = guidance(&Pinning::All);
    let later = [tight];
    let mut law = law(&links, &wide, &later, &known);
    assert_eq!(law.tension.rest_m(), 2.0);
    let mut target = crate::target::CurrentTarget::first_of(&[Leg::first(wide)]).expect("a leg");
    target.begin(1, &Formation::grid(COUNT, 5.0));
    law.follow(&target.view()).expect("slots");
    assert_eq!(law.tension.rest_m(), 2.0, "no leg widens it again");
    let apart = [Leg::first(Formation::grid(COUNT, 0.9))];
    let context = LawContext { later: &apart, ..LawContext::new(&links, &apart[0].formation, 0.5, 0.0) };
    assert!(DisplacementLaw::new(&context, DisplacementKeys::default()).is_ok());
    let context = LawContext { later: &apart, ..LawContext::new(&links, &later[0].formation, DELTA_M, 0.0) };
    assert!(matches!(DisplacementLaw::new(&context, DisplacementKeys::default()), Err(ParameterError::Tension { .. })));
}

#[test]
fn a_moving_reference_without_feed_forward_voids_the_certificate() {
    let (formation, links) = (Formation::grid(COUNT, 2.0), Graph::star(COUNT));
    let swarm = Swarm::at_rest(formation.slots_m.clone());
    let at_rest = ReferenceMotion::Rest { position_m: Vector3::zeros() };
    for (motion, holds) in [(at_rest, true), (guidance(&Pinning::All).motion, false)] {
        let not_fed = Guidance { motion, feed_forward: false, known_by: Pinning::All };
        let law = law(&links, &formation, &[], &not_fed);
        let certificate = law.certificate(&observation(&swarm, &links, &formation, not_fed.motion.at(0.0)), &[]);
        assert_eq!(certificate.certified_m.is_some(), holds);
        assert_eq!(certificate.void.contains(&VoidReason::NoFeedForward), !holds);
    }
    let unknown = Guidance { known_by: Pinning::Listed(Vec::new()), ..guidance(&Pinning::All) };
    let context = LawContext { guidance: Some(&unknown), ..LawContext::new(&links, &formation, DELTA_M, 0.0) };
    let refused = DisplacementLaw::new(&context, DisplacementKeys::default());
    assert!(matches!(refused, Err(ParameterError::ReferenceUnknown)));
}
