//! Relative velocities that lead two vehicles too near each other.

use nalgebra::Vector3;

/// Part of a speed below which it has no direction across the line of sight.
const STRAIGHT: f64 = 1e-9;

/// The relative velocities of vehicle i against vehicle j with which i comes nearer to j than a diameter within the horizon.
pub(super) struct VelocityObstacle {
    /// From i to j \[m\], not zero.
    pub(super) towards_m: Vector3<f64>,
    pub(super) diameter_m: f64,
    pub(super) horizon_s: f64,
    /// In place of the horizon where the two are too near already: the time in which they part.
    pub(super) parting_s: f64,
}

impl VelocityObstacle {
    /// The outward normal where a relative velocity is nearest to the boundary, and how deep inside it lies \[m/s\]; negative
    /// outside.
    ///
    /// The set is the ball of radius diameter/horizon about `towards_m`/horizon, and its shadow away from the origin: a cone whose
    /// half-angle has the sine diameter/distance. The nearest point is on the ball where the way from its centre to the velocity
    /// leads off the cone's mantle, and on the mantle elsewhere.
    pub(super) fn way_out(&self, relative_m_s: Vector3<f64>) -> (Vector3<f64>, f64) {
        let Self { towards_m, diameter_m, horizon_s, parting_s } = self;
        let distance_m = towards_m.norm();
        let sight = towards_m / distance_m;
        if distance_m <= *diameter_m {
            return self.out_of_ball(relative_m_s, *parting_s);
        }
        let from_centre = relative_m_s - towards_m / *horizon_s;
        let sine = diameter_m / distance_m;
        if -from_centre.dot(&sight) > sine * from_centre.norm() {
            return self.out_of_ball(relative_m_s, *horizon_s);
        }
        let cosine = ((distance_m - diameter_m) * (distance_m + diameter_m)).sqrt() / distance_m;
        let normal = across(relative_m_s, sight) * cosine - sight * sine;
        (normal, -normal.dot(&relative_m_s))
    }

    fn out_of_ball(&self, relative_m_s: Vector3<f64>, within_s: f64) -> (Vector3<f64>, f64) {
        let from_centre = relative_m_s - self.towards_m / within_s;
        let length = from_centre.norm();
        let normal = if length > 0.0 { from_centre / length } else { -self.towards_m.normalize() };
        (normal, self.diameter_m / within_s - length)
    }
}

/// The direction of a velocity across a line of sight. Where it has none, to the left as seen from above, so that the two of a
/// pair turn to different sides; along a vertical line of sight, to x.
fn across(velocity_m_s: Vector3<f64>, sight: Vector3<f64>) -> Vector3<f64> {
    let rest = velocity_m_s - sight * sight.dot(&velocity_m_s);
    let rest = rest - sight * sight.dot(&rest);
    let length = rest.norm();
    if length > STRAIGHT * velocity_m_s.norm() {
        return rest / length;
    }
    let left = Vector3::new(-sight.y, sight.x, 0.0);
    let length = left.norm();
    if length > STRAIGHT { left / length } else { Vector3::x() * sight.z.signum() }
}
