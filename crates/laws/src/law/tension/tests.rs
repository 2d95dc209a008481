use super::*;

/// Relative error allowed for V, V' and V'': a dozen roundings, doubled by the exponent of V''.
const ROUNDING: f64 = 1e-14;

/// alpha, delta, d, l, V, V', V'' from (5) and (6) as printed, evaluated with 80 digits.
#[expect(clippy::unreadable_literal, reason = "digits as printed")]
const REFERENCES: [(f64, f64, f64, f64, f64, f64, f64); 10] = [
    (1.0, 2.0, 3.0, 2.0000000009313226, 1218259586.8429644, -1.308096273347119e+18, 2.8091153570226765e+27),
    (1.0, 2.0, 3.0, 2.0625, 15.931339449740818, -289.2807336497159, 9294.577346941804),
    (1.0, 2.0, 3.0, 2.4375, 0.810645770890735, -4.761037641830562, 27.05979862391684),
    (1.0, 2.0, 3.0, 2.4453125, 0.7742614494461394, -4.55517390874645, 25.657852038055772),
    (1.0, 2.0, 3.0, 2.9999999962747097, 1.5245978578187785e-17, -8.18512243944027e-09, 2.1971770871999188),
    (1.0, 2.0, 3.0, 3.0000000000009095, 9.08731133888912e-25, 1.9983208964649116e-12, 2.197177061687817),
    (1.0, 2.0, 3.0, 3.5, 0.17948291854603007, 0.5910215058594676, 0.5901303172379092),
    (0.75, 0.5, 5.25, 40.0, 4.5252981814921585, 0.13916401101667358, 8.890389978886582e-08),
    (2.5, 0.0, 1.0, 1e-12, 2836481642760.5386, -2.8364816427662774e+24, 5.672963285532555e+36),
    (2.5, 0.0, 1.0, 20.0, 40.82971147749556, 2.2034339675488535, 7.591413450903052e-15),
];

fn tension(alpha: f64, delta_m: f64, rest_m: f64) -> EdgeTension {
    EdgeTension::new(alpha, delta_m, rest_m).expect("parameters in their range")
}

/// Scaled clearances from 1e-12 to 1e3, 20 a decade.
fn clearances() -> impl Iterator<Item = f64> {
    (-240..=60).map(|step| 10.0_f64.powf(f64::from(step) / 20.0))
}

#[test]
fn the_tension_and_its_derivatives_match_an_80_digit_evaluation() {
    for (alpha, delta_m, rest_m, l, value, derivative, second) in REFERENCES {
        let tension = tension(alpha, delta_m, rest_m);
        // V also loses the digits of alpha h, because h is the difference of rounded distances.
        let allowed = ROUNDING * (value + alpha * ((l - rest_m) / tension.k_m()).abs());
        assert!((tension.value(l) - value).abs() <= allowed, "V({l}) = {:e}, not {value:e}", tension.value(l));
        let error = tension.derivative(l) / derivative - 1.0;
        assert!(error.abs() <= ROUNDING, "V'({l}) is off by {error:e}");
        let error = tension.second_derivative(l) / second - 1.0;
        assert!(error.abs() <= 5.0 * ROUNDING, "V''({l}) is off by {error:e}");
    }
}

#[test]
fn the_derivatives_agree_with_finite_differences_over_fifteen_decades() {
    /// Fourth-order differences at a thousandth of the scale have an error of 1e-12 of the fifth derivative's scale,
    /// plus the rounding of the function divided by the step.
    const TRUNCATION: f64 = 1e-9;
    const DIFFERENCE_ROUNDING: f64 = 1e-15;
    let tension = tension(1.5, 0.0, 2.0 * REST);
    let difference = |f: &dyn Fn(f64) -> f64, l: f64, step: f64| {
        (8.0 * (f(l + step) - f(l - step)) - (f(l + 2.0 * step) - f(l - 2.0 * step))) / (12.0 * step)
    };
    for s in clearances() {
        let l = s * tension.k_m();
        let step = 1e-3 * tension.k_m() * s.min(1.0);
        for (f, derivative) in [
            (&(|l| tension.value(l)) as &dyn Fn(f64) -> f64, tension.derivative(l)),
            (&|l| tension.derivative(l), tension.second_derivative(l)),
        ] {
            let found = difference(f, l, step);
            // The rounding of l moves f by f' times an ulp of l.
            let size = f(l).abs() + tension.alpha() + l * derivative.abs();
            let allowed = TRUNCATION * derivative.abs() + 4.0 * DIFFERENCE_ROUNDING * size / step;
            assert!((found - derivative).abs() <= allowed, "s = {s:e}: {found:e} and {derivative:e}");
        }
    }
}

#[test]
fn value_and_slope_vanish_exactly_at_the_rest_length_and_nowhere_else() {
    for (alpha, delta_m, rest_m) in [(1.0, 2.0, 3.0), (0.3, 0.5, 17.7), (40.0, 0.0, 1e-3), (1.0, 1e3, 1e3 + 1e-3)] {
        let tension = tension(alpha, delta_m, rest_m);
        assert_eq!((tension.value(rest_m), tension.derivative(rest_m)), (0.0, 0.0));
        for factor in [1e-12, 1e-6, 1e-3, 0.5] {
            let gap = factor * (rest_m - delta_m);
            if rest_m + gap > rest_m {
                assert!(tension.value(rest_m - gap) > 0.0 && tension.value(rest_m + gap) > 0.0);
                assert!(tension.derivative(rest_m - gap) < 0.0 && tension.derivative(rest_m + gap) > 0.0);
            }
        }
    }
}

#[test]
fn the_tension_is_convex_and_its_pull_bounded() {
    let tension = tension(2.0, 1.0, 4.0);
    let bound = tension.alpha() / tension.k_m();
    let mut previous = f64::NEG_INFINITY;
    for s in clearances() {
        let l = tension.delta_m() + s * tension.k_m();
        let slope = tension.derivative(l);
        assert!(slope >= previous && slope <= bound && tension.second_derivative(l) >= 0.0);
        previous = slope;
    }
    assert_eq!(previous, bound);
}

#[test]
fn figure_1_shows_the_minimum_for_delta_1_under_a_caption_for_delta_one_half() {
    let minimum = |delta_m: f64| tension(1.0, delta_m, delta_m + REST).minimum();
    assert!((minimum(0.5) - 2.795_587_149).abs() < 5e-10);
    assert!((minimum(1.0) - 3.295_587_149).abs() < 5e-10);
}

#[test]
fn at_and_inside_the_barrier_the_tension_is_infinite() {
    let tension = tension(1.0, 2.0, 3.0);
    for l in [2.0, 1.0, 0.0, -1.0, f64::NEG_INFINITY] {
        let all = (tension.value(l), tension.derivative(l), tension.second_derivative(l));
        assert_eq!(all, (f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY));
    }
    let just_outside = 2.0_f64.next_up();
    assert!(tension.value(just_outside).is_finite() && tension.derivative(just_outside).is_finite());
    assert!(tension.value(f64::NAN).is_nan() && tension.derivative(f64::NAN).is_nan());
    assert!(tension.second_derivative(f64::NAN).is_nan());
}

#[test]
fn parameters_without_a_tension_are_refused() {
    for alpha in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(EdgeTension::new(alpha, 1.0, 2.0), Err(TensionError::Alpha { .. })));
    }
    for delta_m in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(EdgeTension::new(1.0, delta_m, 2.0), Err(TensionError::Delta { .. })));
    }
    for rest_m in [2.0, 1.0, -3.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(EdgeTension::new(1.0, 2.0, rest_m), Err(TensionError::Rest { .. })));
    }
    assert!(matches!(EdgeTension::new(1.0, 0.0, 1e-310), Err(TensionError::Rest { .. })));
}

#[test]
fn the_push_side_root_inverts_the_tension_over_forty_decades() {
    /// The root is accurate to a few units in the last place of s. V amplifies this by at most s V'/V, which is 1 at
    /// the barrier. At the minimum V is as accurate as h.
    const ROOT_ROUNDING: f64 = 1e-14;
    for decade in -80..=80 {
        let target = 10.0_f64.powf(f64::from(decade) / 4.0);
        let (s, iterations) = push_side_root(target);
        assert!(s > 0.0 && s <= REST);
        assert!(iterations < 10, "{target:e} took {iterations} iterations");
        let h = s - REST;
        let resolution = ROOT_ROUNDING * target + f64::EPSILON * slope(s, h).abs();
        assert!((value(s, h) - target).abs() <= resolution, "{target:e}: {:e}", value(s, h));
    }
}

#[test]
fn the_push_side_root_lies_between_barrier_and_rest_length() {
    let tension = tension(1.25, 2.0, 3.0);
    assert_eq!(tension.push_side_root(0.0), 3.0);
    assert_eq!(tension.push_side_root(-1.0), 3.0);
    assert_eq!(tension.push_side_root(f64::INFINITY), 2.0);
    assert!(tension.push_side_root(f64::NAN).is_nan());
    let mut previous = 3.0;
    for decade in -300..=307 {
        let root = tension.push_side_root(10.0_f64.powi(decade));
        assert!((2.0..=previous).contains(&root), "1e{decade}: {root}");
        previous = root;
    }
    for l in [2.0001, 2.1, 2.5, 2.9, 2.9999] {
        assert!((tension.push_side_root(tension.value(l)) - l).abs() < 1e-14 * l);
    }
}

#[test]
fn the_exponential_is_within_two_units_in_the_last_place() {
    /// Half a unit of the reference (libm's expm1 has an error of at most one) in addition to the two units.
    const UNITS: f64 = 2.5;
    let ulp = |x: f64| x.abs().next_up() - x.abs();
    for step in -70_000..=1_000 {
        let x = f64::from(step) / 1000.0;
        let (found, expected) = (expm1(x), libm::expm1(x));
        assert!((found - expected).abs() <= UNITS * ulp(expected), "{x}: {found:e} and {expected:e}");
    }
    for decade in 1..300 {
        for x in [10.0_f64.powi(-decade), -(10.0_f64.powi(-decade))] {
            assert!((expm1(x) - libm::expm1(x)).abs() <= UNITS * ulp(x), "{x:e}");
        }
    }
    assert_eq!((expm1(0.0), expm1(-1e300), expm1(f64::NEG_INFINITY)), (0.0, -1.0, -1.0));
    assert!(expm1(f64::NAN).is_nan());
}
