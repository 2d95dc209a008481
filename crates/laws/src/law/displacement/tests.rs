use proptest::prelude::*;

use super::*;
use crate::graph::Graph;
use tautline_core::swarm::Swarm;

const DELTA_M: f64 = 1.0;
const A22_PER_S: f64 = 0.3;
const ZETA_PER_S: f64 = 0.8;

fn keys() -> DisplacementKeys {
    DisplacementKeys { k_per_s2: 0.7, zeta_per_s: ZETA_PER_S, alpha: 0.6 }
}

fn law(links: &Graph, formation: &Formation) -> DisplacementLaw {
    let context = LawContext::new(links, formation, DELTA_M, A22_PER_S);
    DisplacementLaw::new(&context, keys()).expect("a law")
}

fn command(law: &mut DisplacementLaw, observation: &Observation<'_>) -> Result<Rows, LawError> {
    let mut near = CellList::default();
    near.update(&observation.own.positions_m, law.capabilities().sensing_range_m.expect("a range"));
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

fn graphs() -> [Graph; 5] {
    let all: Vec<_> = Graph::complete(7).edges().collect();
    let all_but_one = Graph::from_edges(7, &all[1..]).expect("a simple graph");
    [Graph::complete(7), Graph::star(7), Graph::ring(7), Graph::path(7), all_but_one]
}

/// Returns the state after `dt_s` seconds of p'' = a22 v + u(p, v) + w(v) by the classical Runge-Kutta method. Adds the
/// integral of the sum of `|w_i|^2` to `fed`.
fn pushed(
    swarm: &Swarm,
    dt_s: f64,
    fed: &mut f64,
    u: &mut dyn FnMut(&Swarm) -> Rows,
    w: &dyn Fn(&Swarm) -> Rows,
) -> Swarm {
    let mut rates = Vec::new();
    for (share, weight) in [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
        let mut state = swarm.clone();
        if let Some((v, a)) = rates.last() {
            state.positions_m += v * (share * dt_s);
            state.velocities_m_s += a * (share * dt_s);
        }
        let push = w(&state);
        *fed += weight / 6.0 * dt_s * push.norm_squared();
        let a: Rows = &state.velocities_m_s * A22_PER_S + u(&state) + push;
        rates.push((state.velocities_m_s, a));
    }
    let mean = |value_of: &dyn Fn(&(Rows, Rows)) -> Rows| {
        (value_of(&rates[0]) + value_of(&rates[1]) * 2.0 + value_of(&rates[2]) * 2.0 + value_of(&rates[3]))
            * (dt_s / 6.0)
    };
    Swarm {
        positions_m: &swarm.positions_m + mean(&|(v, _)| v.clone()),
        velocities_m_s: &swarm.velocities_m_s + mean(&|(_, a)| a.clone()),
    }
}

/// On the complete graph dE/dt = -zeta |v~|^2 + v~.w exactly. The push 2 zeta v~ attains the bound. A push of half or
/// twice that strength adds less, and a push against v~ removes energy.
#[test]
fn the_energy_bound_is_attained_by_the_worst_push() -> Result<(), LawError> {
    let (links, formation) = (Graph::complete(7), Formation::grid(7, 2.0));
    for (gain, least, most) in [(2.0, 1.0 - 1e-9, 1.0 + 1e-9), (1.0, -9.0, 0.9), (4.0, -9.0, 0.9), (-2.0, -9.0, -0.9)] {
        let mut law = law(&links, &formation);
        let mut swarm = Swarm { positions_m: Formation::grid(7, 1.9).slots_m, velocities_m_s: Rows::zeros(7) };
        swarm.velocities_m_s[(2, 0)] = 0.6;
        swarm.velocities_m_s[(5, 1)] = -0.4;
        let before = law.try_energy(&Observation::exact(&swarm, &links, &formation))?;
        let mut fed = 0.0;
        for _ in 0..300 {
            let mut u =
                |swarm: &Swarm| command(&mut law, &Observation::exact(swarm, &links, &formation)).expect("clear");
            let w = |swarm: &Swarm| {
                let mean = swarm.mean_velocity_m_s();
                Rows::from_fn(7, |i, axis| gain * ZETA_PER_S * (swarm.velocities_m_s[(i, axis)] - mean[axis]))
            };
            swarm = pushed(&swarm, 2.5e-4, &mut fed, &mut u, &w);
        }
        let gained = law.try_energy(&Observation::exact(&swarm, &links, &formation))? - before;
        let ratio = gained / (fed / (4.0 * ZETA_PER_S));
        assert!((least..=most).contains(&ratio), "w = {gain} zeta v~: {ratio}");
    }
    Ok(())
}

/// Includes vehicles without damping, and a pair at the barrier.
#[test]
fn a_vehicle_that_is_not_finite_is_reported_on_every_graph() {
    let formation = Formation::grid(7, 2.0);
    for links in graphs() {
        for a22_per_s in [A22_PER_S, -ZETA_PER_S] {
            let context = LawContext::new(&links, &formation, DELTA_M, a22_per_s);
            let mut law = DisplacementLaw::new(&context, keys()).expect("a law");
            for (vehicle, axis) in (0..7).flat_map(|vehicle| (0..3).map(move |axis| (vehicle, axis))) {
                for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    let mut lost = Swarm::at_rest(formation.slots_m.clone());
                    lost.positions_m[(vehicle, axis)] = number;
                    let mut wild = Swarm::at_rest(formation.slots_m.clone());
                    wild.velocities_m_s[(vehicle, axis)] = number;
                    let mut touching = wild.clone();
                    let beside_m = row(&touching.positions_m, 2) + Vector3::new(0.5, 0.0, 0.0);
                    set_row(&mut touching.positions_m, 5, beside_m);
                    for swarm in [lost, wild, touching] {
                        let found = command(&mut law, &Observation::exact(&swarm, &links, &formation));
                        assert_eq!(found.err(), Some(LawError::NotFinite { vehicle }), "{links:?} {axis} {number}");
                    }
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn the_command_is_the_negative_gradient_plus_damping_over_links(swarm in swarms()) {
        const STEP_M: f64 = 1e-6;
        for links in graphs() {
            let formation = Formation::grid(7, 2.0);
            let mut law = law(&links, &formation);
            let found = command(&mut law, &Observation::exact(&swarm, &links, &formation))?;
            let damped = links.laplacian() * &swarm.velocities_m_s
                * ((ZETA_PER_S + A22_PER_S) / links.algebraic_connectivity());
            for i in 0..7 {
                for axis in 0..3 {
                    let energy = |by_m: f64| {
                        let mut moved = swarm.clone();
                        moved.positions_m[(i, axis)] += by_m;
                        law.energy(&Observation::exact(&moved, &links, &formation)).expect("clear of delta")
                    };
                    let gradient = (energy(STEP_M) - energy(-STEP_M)) / (2.0 * STEP_M);
                    let expected = -gradient - damped[(i, axis)];
                    prop_assert!((found[(i, axis)] - expected).abs() < 1e-6 * (1.0 + expected.abs()));
                }
            }
        }
    }

    #[test]
    fn the_energy_decays_at_the_proved_rate_on_every_graph(swarm in swarms()) {
        for links in graphs() {
            let formation = Formation::grid(7, 2.0);
            let mut law = law(&links, &formation);
            let u = command(&mut law, &Observation::exact(&swarm, &links, &formation))?;
            // dE/dt = sum v~ . (a22 v + u) + sum grad_p E . v, with grad_p E = -(u + damping).
            let mean = swarm.mean_velocity_m_s();
            let sigma = 1.0 / links.algebraic_connectivity();
            let damping = links.laplacian() * &swarm.velocities_m_s * (sigma * (ZETA_PER_S + A22_PER_S));
            let (mut rate, mut relative) = (0.0, 0.0);
            for i in 0..7 {
                let v = row(&swarm.velocities_m_s, i);
                rate += (v - mean).dot(&(A22_PER_S * v + row(&u, i))) - (row(&u, i) + row(&damping, i)).dot(&v);
                relative += (v - mean).norm_squared();
            }
            prop_assert!(rate <= -ZETA_PER_S * relative + 1e-9 * (1.0 + relative), "{rate} {relative}");
        }
    }

    #[test]
    fn the_tension_at_the_certified_separation_equals_the_energy(swarm in swarms()) {
        for links in graphs() {
            let formation = Formation::grid(7, 2.0);
            let law = law(&links, &formation);
            let Certificate { certified_m, energy_initial, void, .. } =
                law.certificate(&Observation::exact(&swarm, &links, &formation), &[]);
            let (certified_m, energy) = (certified_m.expect("certified"), energy_initial.expect("an energy"));
            prop_assert!(void.is_empty() && certified_m > DELTA_M && certified_m <= 2.0);
            prop_assert!((law.tension.value(certified_m) - energy).abs() < 1e-9 * energy);
        }
    }

    #[test]
    fn the_centre_of_mass_is_not_moved(swarm in swarms()) {
        for links in graphs() {
            let formation = Formation::grid(7, 2.0);
            let found = command(&mut law(&links, &formation), &Observation::exact(&swarm, &links, &formation))?;
            prop_assert!(found.row_sum().norm() < 1e-12 * (1.0 + found.norm()));
        }
    }
}

#[test]
fn translated_slots_are_an_equilibrium_without_contact() {
    let formation = Formation::grid(7, 2.0);
    let moved = Swarm::at_rest(Rows::from_fn(7, |i, axis| formation.slots_m[(i, axis)] + 10.0));
    for links in graphs() {
        let mut law = law(&links, &formation);
        let observation = Observation::exact(&moved, &links, &formation);
        assert!(command(&mut law, &observation).expect("a command").norm() < 1e-12);
        assert!(law.energy(&observation).expect("an energy") < 1e-24);
    }
}

#[test]
fn invalid_states_and_parameters_are_refused() {
    let (links, formation) = (Graph::complete(2), Formation::line(2, 2.0));
    let touching = Swarm::at_rest(Formation::line(2, DELTA_M).slots_m);
    let observation = Observation::exact(&touching, &links, &formation);
    assert!(matches!(command(&mut law(&links, &formation), &observation), Err(LawError::Collision { .. })));
    assert!(matches!(law(&links, &formation).certificate(&observation, &[]).void[..], [VoidReason::StartRefused(_)]));

    let apart = Graph::from_edges(4, &[(0, 1), (2, 3)]).expect("a graph");
    let line = Formation::line(4, 2.0);
    let context = LawContext::new(&apart, &line, DELTA_M, 0.0);
    let refused = DisplacementLaw::new(&context, keys()).expect_err("not connected");
    assert_eq!(refused.to_string(), "the graph is not connected: no path joins vehicle 3 to vehicle 1");
    let tight = Formation::line(4, DELTA_M);
    let links = Graph::ring(4);
    let context = LawContext::new(&links, &tight, DELTA_M, 0.0);
    assert!(matches!(DisplacementLaw::new(&context, keys()), Err(ParameterError::Tension { .. })));
}

#[test]
fn pairs_at_or_beyond_the_slot_distance_do_not_raise_the_rate() {
    let law = law(&Graph::complete(7), &Formation::grid(7, 2.0));
    let rate = |nearest_m| law.rates(&RateQuery::new(A22_PER_S, Some(nearest_m))).fastest_per_s.expect("a rate");
    let rest_m = law.capabilities().sensing_range_m.expect("a range");
    assert_eq!(rate(rest_m), rate(50.0 * rest_m));
    assert!(rate(rest_m.next_down()) > rate(rest_m) && rate(1.01 * DELTA_M) > rate(rest_m.next_down()));
    assert_eq!(law.rates(&RateQuery::new(A22_PER_S, None)).fastest_per_s, None);
}

/// Two vehicles that meet between ellipsoids, without links: `r'' = 2 F`, with energy `|r'|^2/4 + V(l)`. Returns the
/// largest relative rise of the energy if `push` gives the force.
fn highest_rise(law: &DisplacementLaw, angle: f64, push: &dyn Fn(Vector3<f64>) -> Vector3<f64>) -> f64 {
    const STEP_S: f64 = 2e-4;
    let potential = |r: Vector3<f64>| law.push(0, 1, r).expect("clear of delta").map_or(0.0, |(_, of_pair)| of_pair);
    let (mut r, mut v) = (Vector3::new(1.2, 0.0, 4.0 * angle.sin()), Vector3::new(-1.0, 0.0, -3.0 * angle.cos()));
    let energy = |r, v: Vector3<f64>| 0.25 * v.norm_squared() + potential(r);
    let (start, mut most) = (energy(r, v), 0.0_f64);
    for _ in 0..15_000 {
        let half = v + STEP_S * push(r);
        r += STEP_S * half;
        v = half + STEP_S * push(r);
        most = most.max(energy(r, v) / start - 1.0);
    }
    most
}

#[test]
fn the_push_between_ellipsoids_is_a_gradient() {
    let (links, formation) =
        (Graph::complete(2), Formation::points(Rows::from_row_slice(&[0.0, 0.0, 0.0, 3.0, 0.0, 0.0])));
    let metric = Metric::of_ratio(3.0);
    let context = LawContext { metric, ..LawContext::new(&links, &formation, DELTA_M, 0.0) };
    let law = DisplacementLaw::new(&context, keys()).expect("a law");
    let right =
        |r: Vector3<f64>| law.push(0, 1, r).expect("clear of delta").map_or_else(Vector3::zeros, |(pushed, _)| pushed);
    // With S instead of S^2: -V' S dp/l.
    let wrong = |r: Vector3<f64>| {
        let push = right(r);
        Vector3::new(push.x, push.y, push.z * metric.ratio())
    };
    let rises = |push: &dyn Fn(Vector3<f64>) -> Vector3<f64>| {
        (0..10).map(|k| highest_rise(&law, 0.15 * f64::from(k), push)).fold(0.0, f64::max)
    };
    assert!(rises(&right) < 1e-5, "{}", rises(&right));
    assert!(rises(&wrong) > 0.1, "{}", rises(&wrong));
    for k in 0..40 {
        let r = Vector3::new(0.4 + 0.05 * f64::from(k), 0.3, 3.2 - 0.04 * f64::from(k));
        let slope = |axis: usize| {
            let mut by = Vector3::zeros();
            by[axis] = 1e-6;
            let value = |r| law.push(0, 1, r).expect("clear of delta").map_or(0.0, |(_, of_pair)| of_pair);
            (value(r + by) - value(r - by)) / 2e-6
        };
        assert!((right(r) + Vector3::new(slope(0), slope(1), slope(2))).norm() < 1e-6);
    }
}
