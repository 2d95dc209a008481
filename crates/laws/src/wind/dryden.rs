//! Dryden turbulence at low altitude (MIL-F-8785C), by filters whose variance is independent of the time step.

use nalgebra::Vector3;

use super::normal::Normals;

/// Length of a foot \[m\].
const FOOT_M: f64 = 0.3048;

/// Least speed at which turbulence is carried past a vehicle \[m/s\]; without mean wind it would never change.
const SLOWEST_M_S: f64 = 1.0;

/// Step in units of L/V below which the factor `l22` is lost to rounding and replaced by its leading term.
const SHORT: f64 = 1e-3;

/// Dryden turbulence near the ground, with these intensities and length scales:
///
/// ```text
/// sigma_w = 0.1 W20,   sigma_u = sigma_v = sigma_w/(0.177 + 0.000823 h)^0.4
/// L_w = h,             L_u = L_v = h/(0.177 + 0.000823 h)^1.2                 h in feet, from 10 to 1000
/// ```
///
/// u is along the horizontal part of the mean wind (along x without one), v across it and w up. The air is frozen and
/// carried past vehicles at the mean wind's speed V, and at 1 m/s at least. With x = V|t|/L the correlation over a time
/// t is sigma^2 e^-x for u and sigma^2 e^-x (1 - x/2) for v and w.
#[derive(Clone, Copy, Debug, serde::Deserialize, PartialEq, serde::Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(description = "Intensity and length scales of the turbulence.")]
pub struct Dryden {
    /// Wind speed 20 feet above the ground in m/s. The vertical standard deviation is a tenth of it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub speed_20ft_m_s: f64,
    /// Height above the ground in m.
    #[schemars(range(min = 3.048, max = 304.8))]
    pub height_m: f64,
}

impl Dryden {
    /// Least height of the model: 10 feet \[m\].
    pub const LOWEST_M: f64 = 10.0 * FOOT_M;
    /// Largest height of the model: 1000 feet \[m\].
    pub const HIGHEST_M: f64 = 1000.0 * FOOT_M;

    fn roughness(&self) -> f64 {
        0.177 + 0.000_823 * self.height_m / FOOT_M
    }

    /// Standard deviations of u, v and w \[m/s\].
    #[must_use]
    pub fn intensity_m_s(&self) -> Vector3<f64> {
        let up_m_s = 0.1 * self.speed_20ft_m_s;
        let level_m_s = up_m_s / libm::pow(self.roughness(), 0.4);
        Vector3::new(level_m_s, level_m_s, up_m_s)
    }

    /// Length scales L of u, v and w \[m\].
    #[must_use]
    pub fn length_m(&self) -> Vector3<f64> {
        let level_m = self.height_m / libm::pow(self.roughness(), 1.2);
        Vector3::new(level_m, level_m, self.height_m)
    }

    /// Returns the exact step of `dt_s` seconds in a mean wind.
    pub(super) fn step(&self, mean_m_s: Vector3<f64>, dt_s: f64) -> Step {
        let carried_m = mean_m_s.norm().max(SLOWEST_M_S) * dt_s;
        let [along, across, up] = (Vector3::repeat(carried_m).component_div(&self.length_m())).into();
        Step {
            intensity_m_s: self.intensity_m_s(),
            along: LongitudinalFilter::new(along),
            across: [across, up].map(TransverseFilter::new),
        }
    }

    /// Returns the unit directions of u, v and w.
    pub(super) fn frame(mean_m_s: Vector3<f64>) -> [Vector3<f64>; 3] {
        let level = Vector3::new(mean_m_s.x, mean_m_s.y, 0.0);
        let along = level.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::x);
        [along, Vector3::z().cross(&along), Vector3::z()]
    }
}

/// Factors of one step of fixed length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    intensity_m_s: Vector3<f64>,
    along: LongitudinalFilter,
    across: [TransverseFilter; 2],
}

/// Filter of u: u+ = p u + sqrt(1 - p^2) xi with p = e^-d, d = V dt/L.
#[derive(Clone, Copy, Debug)]
struct LongitudinalFilter {
    p: f64,
    kick: f64,
}

impl LongitudinalFilter {
    fn new(d: f64) -> Self {
        Self { p: libm::exp(-d), kick: (-libm::expm1(-2.0 * d)).sqrt() }
    }
}

/// Filter of v and w: two lags in a row, x and then y, whose combination has the zero of the filter:
///
/// ```text
/// y+ = p (y + d x) + l21 xi1 + l22 xi2,   x+ = p x + l11 xi1,   out = sqrt 3 x + (1 - sqrt 3) y
/// ```
///
/// with the Cholesky factors of the covariance of the noise of a step:
///
/// ```text
/// Q11 = (1 - p^2)/2,   Q12 = (1 - (1 + 2d) p^2)/4,   Q22 = (1 - (1 + 2d + 2d^2) p^2)/4
/// ```
#[derive(Clone, Copy, Debug)]
struct TransverseFilter {
    p: f64,
    d: f64,
    l11: f64,
    l21: f64,
    l22: f64,
}

impl TransverseFilter {
    fn new(d: f64) -> Self {
        let (p, lost) = (libm::exp(-d), -libm::expm1(-2.0 * d));
        let squared = 1.0 - lost;
        let q12 = 0.25 * (lost - 2.0 * d * squared);
        let q22 = 0.25 * (lost - 2.0 * d * (1.0 + d) * squared);
        let l11 = (0.5 * lost).sqrt();
        let l21 = q12 / l11;
        let l22 = if d < SHORT { (d * d * d / 12.0).sqrt() } else { (q22 - l21 * l21).max(0.0).sqrt() };
        Self { p, d, l11, l21, l22 }
    }
}

/// Filter states of the turbulence of one vehicle, or of all, scaled to unit variance.
#[derive(Clone, Debug)]
pub(super) struct TurbulenceState {
    along: f64,
    /// States x and y of v and of w.
    across: [[f64; 2]; 2],
    normals: Normals,
}

impl TurbulenceState {
    /// Draws the states from the stationary distribution.
    pub(super) fn new(normals: Normals) -> Self {
        let mut eddy = Self { along: 0.0, across: [[0.0; 2]; 2], normals };
        eddy.along = eddy.normals.next();
        for state in &mut eddy.across {
            let x = eddy.normals.next() * std::f64::consts::FRAC_1_SQRT_2;
            *state = [x, 0.5 * x + eddy.normals.next() / 8.0_f64.sqrt()];
        }
        eddy
    }

    /// Continues from the present states with other random numbers.
    pub(super) fn reseed(&mut self, normals: Normals) {
        self.normals = normals;
    }

    pub(super) fn advance(&mut self, step: &Step) {
        let Self { along, across, normals } = self;
        *along = step.along.p * *along + step.along.kick * normals.next();
        for ([x, y], TransverseFilter { p, d, l11, l21, l22 }) in across.iter_mut().zip(step.across) {
            let (first, second) = (normals.next(), normals.next());
            *y = p * (*y + d * *x) + l21 * first + l22 * second;
            *x = p * *x + l11 * first;
        }
    }

    /// Returns u, v and w \[m/s\].
    pub(super) fn velocity_m_s(&self, step: &Step) -> Vector3<f64> {
        let root = 3.0_f64.sqrt();
        let [v, w] = self.across.map(|[x, y]| root * x + (1.0 - root) * y);
        Vector3::new(self.along, v, w).component_mul(&step.intensity_m_s)
    }
}

#[cfg(test)]
mod tests;
