//! Tests that turbulence has the variance and the correlations of its formulas for every time step.

use super::*;

const DRYDEN: Dryden = Dryden { speed_20ft_m_s: 15.0, height_m: 30.0 };
const MEAN_M_S: Vector3<f64> = Vector3::new(8.0, 0.0, 0.0);

/// Returns the time in which the air moves by d length scales of w \[s\].
fn seconds(d: f64) -> f64 {
    d * DRYDEN.height_m / MEAN_M_S.norm()
}

/// Returns u, v, w at `count` steps.
fn drawn(step: &Step, seed: u64, count: usize) -> Vec<Vector3<f64>> {
    let mut eddy = TurbulenceState::new(Normals::new(seed, 0));
    let mut next = || {
        eddy.advance(step);
        eddy.velocity_m_s(step)
    };
    (0..count).map(|_| next()).collect()
}

fn mean_square(air: &[Vector3<f64>]) -> Vector3<f64> {
    air.iter().map(|air| air.component_mul(air)).sum::<Vector3<f64>>() / air.len() as f64
}

/// Uses 10^6 samples at each of three steps. Short steps use many independent filters, since neighbours are correlated.
#[test]
fn the_variance_matches_the_formula_for_every_step() {
    let samples = 1_000_000;
    for (d, eddies) in [(5e-4, 20_000), (0.05, 100), (5.0, 1)] {
        let step = DRYDEN.step(MEAN_M_S, seconds(d));
        let each = samples / eddies;
        let squares = (0..eddies).map(|seed| mean_square(&drawn(&step, seed as u64, each)));
        let found = squares.sum::<Vector3<f64>>() / eddies as f64;
        let ratio = found.component_div(&DRYDEN.intensity_m_s().component_mul(&DRYDEN.intensity_m_s()));
        assert!((ratio - Vector3::repeat(1.0)).amax() < 0.03, "d = {d}: {ratio:?}");
    }
}

/// Lags are not multiples of a length scale: u decays as e^-x, v and w as e^-x (1 - x/2).
#[test]
fn correlations_match_the_formula() {
    let d = 0.1;
    let step = DRYDEN.step(MEAN_M_S, seconds(d));
    let air = drawn(&step, 3, 400_000);
    let sigma = DRYDEN.intensity_m_s();
    for lag in [1, 5, 10, 20, 30] {
        let products = air.windows(lag + 1).map(|window| window[0].component_mul(&window[lag]));
        let found =
            products.sum::<Vector3<f64>>().component_div(&sigma.component_mul(&sigma)) / (air.len() - lag) as f64;
        let x = (d * lag as f64) * Vector3::repeat(DRYDEN.height_m).component_div(&DRYDEN.length_m());
        let expected = Vector3::new((-x.x).exp(), (-x.y).exp() * (1.0 - 0.5 * x.y), (-x.z).exp() * (1.0 - 0.5 * x.z));
        assert!((found - expected).amax() < 0.03, "lag {lag}: {found:?} for {expected:?}");
    }
}

/// A published method integrates the filter's differential equation with white noise of variance 1 per step, not scaled
/// by the step. Its variance depends on the step.
#[test]
fn unscaled_white_noise_has_a_step_dependent_variance() {
    let naive = |d: f64| {
        let (mut normals, mut u, mut sum) = (Normals::new(1, 0), 0.0, 0.0);
        let samples = 200_000_u32;
        for _ in 0..samples {
            u += d * (2.0_f64.sqrt() * normals.next() - u);
            sum += u * u;
        }
        sum / f64::from(samples)
    };
    assert!(naive(0.01) < 0.02, "one hundredth of it");
    assert!(naive(0.01) < 0.2 * naive(0.1));
}

/// Computed by hand from the formulas at 100 feet.
#[test]
fn scales_match_the_standard() {
    let at_100ft = Dryden { speed_20ft_m_s: 10.0, height_m: 30.48 };
    // 0.177 + 0.0823 = 0.2593; 0.2593^0.4 = 0.582802, 0.2593^1.2 = 0.197953.
    assert!((at_100ft.intensity_m_s() - Vector3::new(1.715_849, 1.715_849, 1.0)).amax() < 1e-5);
    assert!((at_100ft.length_m() - Vector3::new(153.976, 153.976, 30.48)).amax() < 1e-2);
    let [along, across, up] = Dryden::frame(Vector3::new(0.0, -3.0, 1.0));
    assert_eq!((along, across, up), (-Vector3::y(), Vector3::x(), Vector3::z()));
    assert_eq!(Dryden::frame(Vector3::zeros())[0], Vector3::x());
}

/// Compares both sides of the step below which a factor is replaced by its leading term.
#[test]
fn the_noise_of_a_step_is_continuous_at_the_change_of_formula() {
    let [below, above] = [TransverseFilter::new(SHORT * (1.0 - 1e-9)), TransverseFilter::new(SHORT)];
    assert!((below.l22 / above.l22 - 1.0).abs() < 2e-3, "{} {}", below.l22, above.l22);
    for d in [1e-9, 1e-6, 0.3, 40.0] {
        let TransverseFilter { p, l11, l21, l22, .. } = TransverseFilter::new(d);
        // Stationarity: a step preserves the covariance of x, 1/2, and of y, 1/4.
        assert!((p * p * 0.5 + l11 * l11 - 0.5).abs() < 1e-15);
        let y = p * p * (0.25 + 2.0 * d * 0.25 + d * d * 0.5) + l21 * l21 + l22 * l22;
        assert!((y - 0.25).abs() < 1e-12, "{d}: {y}");
    }
}
