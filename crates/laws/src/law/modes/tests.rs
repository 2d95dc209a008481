use nalgebra::{DMatrix, Matrix2};

use super::*;
use crate::formation::Formation;
use crate::graph::{Graph, Pinning};
use crate::law::{DisplacementKeys, EdgeTensionKeys, LawContext, LawSpec};
use crate::target::{Guidance, ReferenceMotion};

fn mode(k: f64, c: f64) -> Mode {
    Mode { stiffness_per_s2: k, damping_per_s: c }
}

#[test]
fn delay_margins_match_direct_simulation() {
    for ((g, k, c, a22), expected_s) in [
        ((1.0, 1.0, 1.0, 0.0), 0.711),
        ((1.0, 1.0, 1.1, 0.1), 0.674),
        ((0.3, 1.0, 1.1, 0.1), 0.694),
        ((1.0, 9.0, 1.1, 0.1), 0.106),
    ] {
        let found_s = mode(k, c).times(g).delay_margin_s(a22);
        assert!((found_s - expected_s).abs() < 5e-4, "{g} {k} {c} {a22}: {found_s}");
    }
    // Without stiffness x'' = -C x'(t - tau): tau C < pi/2.
    assert!((mode(0.0, 2.0).delay_margin_s(0.0) - std::f64::consts::FRAC_PI_4).abs() < 1e-12);
    assert_eq!(mode(1.0, 0.1).delay_margin_s(0.2), 0.0, "unstable without a delay");
    assert_eq!(mode(0.0, 0.1).delay_margin_s(-0.2), f64::INFINITY, "drag alone holds it");
}

/// Returns the root of a characteristic equation near a guess, by Newton's method with difference quotients.
fn root(f: impl Fn(Complex<f64>) -> Complex<f64>, mut s: Complex<f64>) -> Complex<f64> {
    for _ in 0..60 {
        let h = Complex::new(1e-6, 0.0);
        let slope = (f(s + h) - f(s - h)) / (h * 2.0);
        s -= f(s) / slope;
    }
    s
}

#[test]
fn a_mode_becomes_unstable_at_its_delay_margin() {
    for (k, c, a22) in [(1.0, 1.0, 0.0), (2.0, 0.7, -0.3), (0.5, 1.5, 0.2)] {
        let margin_s = mode(k, c).delay_margin_s(a22);
        let difference: f64 = c * c - a22 * a22;
        let omega = (0.5 * (difference + difference.hypot(2.0 * k))).sqrt();
        let value_at = |tau: f64| {
            let f = |s: Complex<f64>| s * s - s * a22 + (s * c + k) * (-s * tau).exp();
            root(f, Complex::new(0.0, omega)).re
        };
        assert!(
            value_at(margin_s).abs() < 1e-9 && value_at(0.95 * margin_s) < -1e-4 && value_at(1.05 * margin_s) > 1e-4,
            "{k} {c} {a22}"
        );
    }
}

#[test]
fn sampling_margins_match_closed_form_and_spectral_radius() {
    for (k, c) in [(1.0, 1.0), (4.0, 1.0), (0.1, 2.0)] {
        let found_s = mode(k, c).sampling_margin_s(0.0);
        assert!((found_s / (2.0_f64 / c).min(2.0 * c / k) - 1.0).abs() < 1e-12, "{k} {c}: {found_s}");
    }
    for (k, c, a22) in [(1.0, 1.1, 0.1), (2.0, 1.0, -0.5), (1.0, 1.0, 1e-7)] {
        let margin_s = mode(k, c).sampling_margin_s(a22);
        let radius = |period_s: f64| {
            let (bounded, moved_s, pushed_s2) = zero_order_hold(a22, period_s);
            let step = Matrix2::new(1.0 - k * pushed_s2, moved_s - c * pushed_s2, -k * moved_s, bounded - c * moved_s);
            step.complex_eigenvalues().iter().map(|z| z.norm()).fold(0.0, f64::max)
        };
        assert!(
            (radius(margin_s) - 1.0).abs() < 1e-9 && radius(0.98 * margin_s) < 1.0 && radius(1.02 * margin_s) > 1.0
        );
    }
    assert_eq!(mode(1.0, 0.1).sampling_margin_s(0.2), 0.0);
}

#[test]
fn the_response_to_a_held_command_is_accurate_for_small_a22() {
    for x in [0.0, 1e-12, 1e-6, 9.9e-4, -9.9e-4, 1.01e-3, -1.01e-3, 0.5, -2.0_f64] {
        // e^x, (e^x - 1)/x and (e^x - 1 - x)/x^2 are sums of x^n/(n + k)!.
        let sum = |k: u32| {
            let first = (1..=k).map(f64::from).product::<f64>().recip();
            let terms = (1..40).scan(first, |term, n| {
                *term *= x / f64::from(n + k);
                Some(*term)
            });
            first + terms.sum::<f64>()
        };
        let period_s = 2.5;
        let (bounded, moved_s, pushed_s2) = zero_order_hold(x / period_s, period_s);
        for (found, exact) in
            [(bounded, sum(0)), (moved_s, period_s * sum(1)), (pushed_s2, period_s * period_s * sum(2))]
        {
            assert!((found / exact - 1.0).abs() < 1e-10, "{x}: {found} {exact}");
        }
    }
}

/// Returns the determinant of s^2 - a22 s + (k + c s) (D - A e^(-s tau)) over a graph.
fn determinant(
    received: &ReceivedStateLoop,
    graph: &Graph,
    pinning: &Pinning,
    (a22, tau): (f64, f64),
    s: Complex<f64>,
) -> Complex<f64> {
    let matrix = graph.pinned_laplacian(pinning);
    let late = (-s * tau).exp();
    let gain = s * received.gain.damping_per_s + received.gain.stiffness_per_s2;
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| {
        let part = if i == j { Complex::new(matrix[(i, j)], 0.0) } else { late * matrix[(i, j)] };
        gain * part + if i == j { s * s - s * a22 } else { Complex::new(0.0, 0.0) }
    })
    .determinant()
}

/// Whether some root is to the right of the imaginary axis, except at the origin. Counts the turns of the determinant
/// along a large half disc whose straight edge is slightly off the axis (argument principle).
fn grows(received: &ReceivedStateLoop, graph: &Graph, pinning: &Pinning, late: (f64, f64)) -> bool {
    const PARTS: u32 = 60_000;
    const RADIUS: f64 = 60.0;
    const OFF: f64 = 1e-3;
    let along = |k: u32| {
        let share = f64::from(k) / f64::from(PARTS);
        if share < 0.5 {
            // Steps along the straight edge are finer near its middle.
            let up = (share - 0.25) * 4.0;
            Complex::new(OFF, RADIUS * up * up * up)
        } else {
            let angle = std::f64::consts::FRAC_PI_2 - (share - 0.5) * TAU;
            Complex::new(OFF + RADIUS * angle.cos(), RADIUS * angle.sin())
        }
    };
    let value = |k: u32| determinant(received, graph, pinning, late, along(k % PARTS));
    let mut before = value(0);
    let turns: f64 = (1..=PARTS)
        .map(|k| {
            let next = value(k);
            let turned = (next / before).arg();
            before = next;
            turned
        })
        .sum();
    (turns / TAU).round() != 0.0
}

#[test]
fn delay_margins_of_received_states_match_the_roots_of_the_swarm() {
    for (graph, pinning, a22) in [
        (Graph::complete(5), Pinning::Unpinned, 0.0),
        (Graph::complete(4), Pinning::Unpinned, -0.2),
        (Graph::ring(5), Pinning::Unpinned, 0.0),
        (Graph::star(5), Pinning::Unpinned, 0.0),
        (Graph::star(5), Pinning::Unpinned, -0.1),
        (Graph::ring(6), Pinning::All, 0.1),
        (Graph::star(4), Pinning::All, 0.1),
    ] {
        let links = crate::law::pinned::PinnedConsensus::new(&graph, pinning.clone());
        let gain = mode(1.0, 1.0 + a22).times(1.0 / graph.pinned_connectivity(&pinning));
        let received = links.linear(gain, gain).received.expect("a graph of the list");
        let margin_s = received.delay_margin_s(a22).expect("a margin");
        if margin_s.is_infinite() {
            assert!(!grows(&received, &graph, &pinning, (a22, 30.0)), "{graph:?}");
            continue;
        }
        assert!(!grows(&received, &graph, &pinning, (a22, 0.95 * margin_s)), "{graph:?} {pinning:?} {margin_s}");
        assert!(grows(&received, &graph, &pinning, (a22, 1.05 * margin_s)), "{graph:?} {pinning:?} {margin_s}");
    }
}

#[test]
fn followers_of_a_leader_on_a_star_are_stable_with_any_delay() {
    let graph = Graph::star(5);
    let links = crate::law::pinned::PinnedConsensus::new(&graph, Pinning::Leader(0));
    let gain = mode(1.0, 1.0);
    let linear = links.linear(gain, gain);
    assert_eq!(linear.received.and_then(|received| received.delay_margin_s(0.1)), Some(f64::INFINITY));
    // On a path own and received terms do not have the modes of their sum.
    let path = crate::law::pinned::PinnedConsensus::new(&Graph::path(4), Pinning::Unpinned);
    assert_eq!(path.linear(gain, gain).received, None);
    // Without a reference, unstable common motion cannot be separated on a star, but can if D is a multiple of the
    // identity.
    let star = crate::law::pinned::PinnedConsensus::new(&graph, Pinning::Unpinned).linear(gain, gain).received;
    assert_eq!(star.expect("a star").delay_margin_s(0.1), None);
    let ring = crate::law::pinned::PinnedConsensus::new(&Graph::ring(5), Pinning::Unpinned).linear(gain, gain).received;
    assert!(ring.expect("a ring").delay_margin_s(0.1).is_some());
}

#[test]
fn the_pentagon_in_contact_is_far_stiffer_than_free() {
    let (graph, slots) = (Graph::complete(5), Formation::pentagon(3.0));
    let context = LawContext::new(&graph, &slots, 2.0, 0.0);
    let law = LawSpec::Displacement(DisplacementKeys::default()).build(&context).expect("a law");
    let linear = law.linear(&slots).expect("modes");
    assert_eq!(linear.free, [mode(1.0, 1.0)]);
    let contact = linear.stiffest_contact_mode.expect("a push");
    let margins_s = [linear.delay_margin_s(0.0), contact.delay_margin_s(0.0)];
    assert!((margins_s[0] - 0.711).abs() < 5e-4 && (margins_s[1] - 0.0811).abs() < 5e-5, "{contact:?} {margins_s:?}");
    let guidance = Guidance {
        motion: ReferenceMotion::Rest { position_m: nalgebra::Vector3::zeros() },
        known_by: Pinning::Leader(2),
        feed_forward: true,
    };
    let led = LawContext { guidance: Some(&guidance), ..context };
    let law = LawSpec::Displacement(DisplacementKeys::default()).build(&led).expect("a law");
    let linear = law.linear(&slots).expect("modes");
    // Each follower has four neighbours, one of them the leader. The leader follows the reference independently.
    assert_eq!((linear.free.len(), linear.stiffest_contact_mode), (3, None));
}

#[test]
fn edge_tension_modes_match_differences_of_its_command() {
    let (graph, slots) = (Graph::complete(5), Formation::pentagon(4.0));
    let context = LawContext::new(&graph, &slots, 2.0, 0.1);
    let law = LawSpec::EdgeTension(EdgeTensionKeys::default()).build(&context).expect("a law");
    let linear = law.linear(&slots).expect("modes");
    assert!(linear.free.iter().all(|mode| mode.damping_per_s == 1.1));
    let stiffest = linear.free.iter().map(|mode| mode.stiffness_per_s2).fold(0.0, f64::max);
    // The largest curvature that a command has, by power iteration on differences of it.
    let command = |positions_m: &tautline_core::swarm::Rows| {
        let mut law = law.clone();
        let at_rest = tautline_core::swarm::Swarm::at_rest(positions_m.clone());
        let mut command = tautline_core::swarm::Rows::zeros(5);
        let observation = crate::observation::Observation::exact(&at_rest, &graph, &slots);
        law.command(&observation, &mut command).expect("a command");
        command
    };
    let mut direction = tautline_core::swarm::Rows::from_fn(5, |i, axis| libm::sin((7 * i + 3 * axis) as f64));
    let mut found = 0.0;
    for _ in 0..400 {
        let step = &direction * (1e-5 / direction.norm());
        let change = command(&(&slots.slots_m - &step)) - command(&(&slots.slots_m + &step));
        found = 0.5 * change.norm() / step.norm();
        direction = change;
    }
    assert!((found / stiffest - 1.0).abs() < 1e-5, "{found} {stiffest}");
    assert!(
        EdgeTensionKeys::default().alpha == 1.0 && linear.stiffest_contact_mode.is_none() && linear.received.is_none()
    );
}
