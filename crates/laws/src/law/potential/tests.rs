use proptest::prelude::*;

use super::*;
use crate::formation::Formation;
use crate::space::CellList;
use tautline_core::swarm::Swarm;

const DELTA_M: f64 = 1.0;
const A22_PER_S: f64 = 0.3;

fn law(links: &Graph, formation: &Formation) -> PotentialLaw {
    let context = LawContext::new(links, formation, DELTA_M, A22_PER_S);
    PotentialLaw::new(&context, PotentialKeys { k_per_s2: 0.7, c_per_s: 1.1, eta_m4_per_s2: 0.4, max_accel_m_s2: None })
        .expect("finite gains")
}

fn command(law: &mut PotentialLaw, observation: &Observation<'_>) -> Result<Rows, LawError> {
    let mut near = CellList::default();
    near.update(&observation.own.positions_m, law.range_m);
    let mut command = Rows::from_element(observation.own.count(), f64::NAN);
    law.command(&Observation { near: near.pairs(), ..*observation }, &mut command).map(|()| command)
}

/// Swarms of seven vehicles on a grid of 1.6 m with noise that keeps separations above delta; slots are 2 m apart.
fn swarms() -> impl Strategy<Value = Swarm> {
    prop::collection::vec(-0.25..0.25_f64, 42).prop_map(|noise| Swarm {
        positions_m: Formation::grid(7, 1.6).slots_m + Rows::from_column_slice(&noise[..21]),
        velocities_m_s: Rows::from_column_slice(&noise[21..]),
    })
}

proptest! {
    #[test]
    fn the_command_is_the_negative_gradient_plus_damping(swarm in swarms()) {
        const STEP_M: f64 = 1e-6;
        for links in [Graph::complete(7), Graph::star(7), Graph::path(7)] {
            let formation = Formation::grid(7, 2.0);
            let mut law = law(&links, &formation);
            let found = command(&mut law, &Observation::exact(&swarm, &links, &formation))?;
            for i in 0..7 {
                for axis in 0..3 {
                    let energy = |by_m: f64| {
                        let mut moved = swarm.clone();
                        moved.positions_m[(i, axis)] += by_m;
                        law.energy(&Observation::exact(&moved, &links, &formation)).expect("clear of delta")
                    };
                    let gradient = (energy(STEP_M) - energy(-STEP_M)) / (2.0 * STEP_M);
                    let expected = -gradient - 1.1 * swarm.velocities_m_s[(i, axis)];
                    prop_assert!((found[(i, axis)] - expected).abs() < 1e-6 * (1.0 + expected.abs()));
                }
            }
        }
    }

    #[test]
    fn repulsion_at_the_certified_separation_equals_the_energy(swarm in swarms()) {
        let (links, formation) = (Graph::star(7), Formation::grid(7, 2.0));
        let law = law(&links, &formation);
        let certificate = law.certificate(&Observation::exact(&swarm, &links, &formation), &[]);
        let certified_m = certificate.certified_m.expect("certified");
        let energy = certificate.energy_initial.expect("energy");
        let (steep, _) = law.steepness(Pair::new(0, 1), certified_m).expect("above delta");
        prop_assert!((0.5 * 0.4 * steep * steep - energy).abs() < 1e-9 * energy);
        prop_assert!(certified_m > DELTA_M && certified_m <= 2.0);
    }
}

#[test]
fn collisions_and_void_certificates_are_reported() {
    let (links, formation) = (Graph::complete(2), Formation::line(2, 2.0));
    let touching = Swarm::at_rest(Formation::line(2, DELTA_M).slots_m);
    let observation = Observation::exact(&touching, &links, &formation);
    assert!(matches!(command(&mut law(&links, &formation), &observation), Err(LawError::Collision { .. })));
    assert_eq!(law(&links, &formation).energy(&observation), None);

    let context = LawContext::new(&links, &formation, DELTA_M, 3.0);
    let fed = PotentialLaw::new(&context, PotentialKeys::default()).expect("finite gains");
    let apart = Swarm::at_rest(formation.slots_m.clone());
    let observation = Observation::exact(&apart, &links, &formation);
    assert_eq!(fed.certificate(&observation, &[]).void, [VoidReason::VelocityUndamped]);

    let keys = PotentialKeys { max_accel_m_s2: Some(0.5), ..PotentialKeys::default() };
    let context = LawContext { a22_per_s: 0.0, ..context };
    let mut limited = PotentialLaw::new(&context, keys).expect("finite gains");
    assert_eq!(limited.certificate(&observation, &[]).void, [VoidReason::CommandLimited]);
    let near = Swarm::at_rest(Formation::line(2, 1.1 * DELTA_M).slots_m);
    let pushed = command(&mut limited, &Observation::exact(&near, &links, &formation)).expect("a command");
    assert!((pushed[(0, 0)] + 0.5).abs() < 1e-12 && (pushed[(1, 0)] - 0.5).abs() < 1e-12, "{pushed}");
}

#[test]
fn rates_match_the_curvature_of_the_potential_and_the_damping() {
    const STEP_M: f64 = 1e-4;
    let law = law(&Graph::complete(2), &Formation::line(2, 2.0));
    let potential = |l_m: f64| 0.5 * 0.4 * law.steepness(Pair::new(0, 1), l_m).expect("above delta").0.powi(2);
    for l_m in [1.1, 1.4, 1.8] {
        let curved = potential(l_m + STEP_M) - 2.0 * potential(l_m) + potential(l_m - STEP_M);
        let omega_squared = 0.7 + 2.0 * curved / (STEP_M * STEP_M);
        let (rate, half) =
            (law.rates(&RateQuery::new(A22_PER_S, Some(l_m))).fastest_per_s.expect("a rate"), 0.5 * (1.1 - A22_PER_S));
        let expected = half + (half * half + omega_squared).sqrt();
        assert!((rate - expected).abs() < 1e-5 * expected, "{l_m}: {rate} {expected}");
    }
    let margin = law.rates(&RateQuery::new(A22_PER_S, None)).velocity_margin.expect("it brakes");
    assert_eq!([margin.per_s, margin.terms_per_s], [1.1 - A22_PER_S, 1.1 + A22_PER_S]);
    assert_eq!(law.rates(&RateQuery::new(A22_PER_S, None)).common_mode_per_s, A22_PER_S - 1.1);
}

#[test]
fn the_number_of_near_vehicles_is_bounded_by_packing() {
    let rate_per_s = |count: usize| {
        let law = law(&Graph::star(count), &Formation::grid(count, 2.0));
        law.rates(&RateQuery::new(A22_PER_S, Some(0.75 * law.range_m))).fastest_per_s.expect("a rate")
    };
    // Balls of three quarters of the range, within the range and half a ball: (1 + 8/3)^3 = 49.3 by volume, one of them
    // the vehicle's own.
    assert!(rate_per_s(49) < rate_per_s(50));
    assert_eq!(rate_per_s(50), rate_per_s(300));
}
