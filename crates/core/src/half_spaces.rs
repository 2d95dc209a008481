//! Projection of a point onto the intersection of half-spaces and a ball: a quadratic program in three variables.

use nalgebra::Vector3;

/// Sine of the angle below which an affine subspace and a plane count as parallel.
const PARALLEL: f64 = 1e-8;
/// Relative tolerances of a violation, as fractions of the lengths whose difference it is. The first is used normally.
/// The others follow where nearly parallel planes leave no point within the first.
const ROUNDING: [f64; 4] = [1e-12, 1e-10, 1e-8, 1e-6];

/// Set of all x with `normal . x >= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// Unit normal.
    pub normal: Vector3<f64>,
    /// Smallest extent along the normal.
    pub offset: f64,
}

impl HalfSpace {
    /// Returns the distance of a point outside the half-space; negative inside.
    fn violation(&self, point: &Vector3<f64>) -> f64 {
        self.offset - self.normal.dot(point)
    }

    /// Returns the magnitude of the lengths whose difference a violation in the ball is.
    fn size(&self, radius: f64) -> f64 {
        radius + self.offset.abs()
    }
}

/// Half-spaces, with scratch memory of the search.
///
/// # Method
/// Half-spaces are added one by one. While the best point satisfies the next half-space, it stays the best. Otherwise
/// the best point lies on the plane of that half-space, which is the same problem with one dimension less (Seidel,
/// Small-dimensional linear programming and convex hulls made easy, 1991). If the intersection is empty, the largest
/// violation becomes a fourth variable, and half-spaces are added by the same rule.
///
/// The order is as given, so the same input gives the same bits. The cost is O(n) on average for an arbitrary order and
/// O(n^3) at worst, plus the same for each half-space that cannot be satisfied. Nothing is allocated once the lists
/// have grown. If target point and normals lie in the plane z = 0, the result does too, exactly.
#[derive(Clone, Debug, Default)]
pub struct HalfSpaces {
    given: Vec<HalfSpace>,
    /// Scratch: half-spaces in which other half-spaces are violated no more than the worst one.
    no_worse: Vec<HalfSpace>,
}

/// Result of a projection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The point.
    pub point: Vector3<f64>,
    /// Largest violation of the point; 0 if the point is in all half-spaces up to rounding.
    pub violation: f64,
}

impl HalfSpaces {
    /// Returns no half-spaces, with memory for this many.
    #[must_use]
    pub fn with_capacity(count: usize) -> Self {
        Self { given: Vec::with_capacity(count), no_worse: Vec::new() }
    }

    /// Removes all half-spaces and keeps their memory.
    pub fn clear(&mut self) {
        self.given.clear();
    }

    /// Adds a half-space.
    pub fn push(&mut self, half_space: HalfSpace) {
        self.given.push(half_space);
    }

    /// Returns the point nearest to `wish` in all half-spaces and in the ball of this radius about the origin. If there
    /// is no such point, returns the nearest point of minimal largest violation. Violations are accurate to 1e-12 of
    /// the radius and the offsets, and to 1e-6 with nearly parallel planes.
    pub fn nearest(&mut self, wish: Vector3<f64>, radius: f64) -> Nearest {
        let search = Search::near(wish, radius);
        match search.best(&self.given, &Subspace::space()) {
            Ok(point) => Nearest { point, violation: 0.0 },
            Err(Infeasible { place, last }) => {
                let least = self.minimize_violation(place, last, radius);
                let relaxed = Search { slack: self.largest_violation(&least), ..search };
                let point = relaxed.best_up_to_rounding(&self.given).unwrap_or(least);
                Nearest { point, violation: self.largest_violation(&point) }
            }
        }
    }

    /// Returns the point nearest to `wish` in all half-spaces and in the ball of this radius about the origin. `None`
    /// if no point is in all of them up to rounding.
    #[must_use]
    pub fn nearest_inside(&self, wish: Vector3<f64>, radius: f64) -> Option<Vector3<f64>> {
        Search::near(wish, radius).best(&self.given, &Subspace::space()).ok()
    }

    /// Returns a point of minimal largest violation. `point` must lie in all half-spaces before `place`.
    fn minimize_violation(&mut self, place: usize, mut point: Vector3<f64>, radius: f64) -> Vector3<f64> {
        let Self { given, no_worse } = self;
        let mut largest = 0.0;
        for (i, worst) in given.iter().enumerate().skip(place) {
            if worst.violation(&point) <= largest + ROUNDING[0] * worst.size(radius) {
                continue;
            }
            no_worse.clear();
            no_worse.extend(given[..i].iter().filter_map(|other| difference(other, worst)));
            let search =
                Search { objective: Objective::Along(worst.normal), radius, slack: 0.0, rounding: ROUNDING[0] };
            point = search.best_up_to_rounding(no_worse).unwrap_or(point);
            largest = given[..=i].iter().map(|given| given.violation(&point)).fold(0.0, f64::max);
        }
        point
    }

    fn largest_violation(&self, point: &Vector3<f64>) -> f64 {
        self.given.iter().map(|given| given.violation(point)).fold(0.0, f64::max)
    }
}

/// Returns the half-space where `other` is violated no more than `worst`; `None` if that is everywhere or infeasible.
fn difference(other: &HalfSpace, worst: &HalfSpace) -> Option<HalfSpace> {
    let normal = other.normal - worst.normal;
    let length = normal.norm();
    (length > PARALLEL).then(|| HalfSpace { normal: normal / length, offset: (other.offset - worst.offset) / length })
}

/// Objective of a search.
#[derive(Clone, Copy)]
enum Objective {
    /// Minimize the distance to this point.
    Near(Vector3<f64>),
    /// Maximize the extent in this direction.
    Along(Vector3<f64>),
}

/// No point is in all half-spaces up to the one at `place`.
#[derive(Clone, Copy)]
struct Infeasible {
    place: usize,
    /// Best point in the half-spaces before `place`.
    last: Vector3<f64>,
}

/// Search for the best point in half-spaces and a ball.
#[derive(Clone, Copy)]
struct Search {
    objective: Objective,
    radius: f64,
    /// Distance by which each half-space is widened.
    slack: f64,
    rounding: f64,
}

impl Search {
    fn near(wish: Vector3<f64>, radius: f64) -> Self {
        Self { objective: Objective::Near(wish), radius, slack: 0.0, rounding: ROUNDING[0] }
    }

    /// Returns the best point in an affine subspace.
    fn best(&self, within: &[HalfSpace], subspace: &Subspace) -> Result<Vector3<f64>, Infeasible> {
        let mut point =
            subspace.best(self.radius, self.objective).ok_or(Infeasible { place: 0, last: Vector3::zeros() })?;
        for (place, half_space) in within.iter().enumerate() {
            let infeasible = Infeasible { place, last: point };
            if half_space.violation(&point) > self.slack + self.rounding * half_space.size(self.radius) {
                let edge = subspace.cut(half_space, self.slack).ok_or(infeasible)?;
                point = self.best(&within[..place], &edge).map_err(|_| infeasible)?;
            }
        }
        Ok(point)
    }

    /// Returns the best point when one exists up to rounding; tries growing tolerances.
    fn best_up_to_rounding(&self, within: &[HalfSpace]) -> Option<Vector3<f64>> {
        let rounded = |rounding| Self { rounding, ..*self }.best(within, &Subspace::space()).ok();
        ROUNDING.into_iter().find_map(rounded)
    }
}

/// Affine subspace: a point, a line, a plane or the whole space.
struct Subspace {
    /// Its point nearest to the origin.
    foot: Vector3<f64>,
    kind: Kind,
}

enum Kind {
    Space,
    /// Plane with this unit normal.
    Plane(Vector3<f64>),
    /// Line in this direction.
    Line(Vector3<f64>),
    Point,
}

impl Subspace {
    fn space() -> Self {
        Self { foot: Vector3::zeros(), kind: Kind::Space }
    }

    /// Returns the component of a vector in the subspace. Projects twice to remove the rounding of a nearly
    /// perpendicular vector.
    fn part_of(&self, vector: Vector3<f64>) -> Vector3<f64> {
        self.projection(self.projection(vector))
    }

    fn projection(&self, vector: Vector3<f64>) -> Vector3<f64> {
        match self.kind {
            Kind::Space => vector,
            Kind::Plane(normal) => vector - normal * normal.dot(&vector),
            Kind::Line(along) => along * along.dot(&vector),
            Kind::Point => Vector3::zeros(),
        }
    }

    /// Returns the best point in the ball; `None` if the subspace does not meet the ball.
    fn best(&self, radius: f64, objective: Objective) -> Option<Vector3<f64>> {
        let room = radius * radius - self.foot.norm_squared();
        if room < 0.0 {
            return None;
        }
        let from_foot = match objective {
            Objective::Near(wish) => self.part_of(wish - self.foot).cap_magnitude(room.sqrt()),
            Objective::Along(direction) => {
                let part = self.part_of(direction);
                let length = part.norm();
                if length > PARALLEL { part * (room.sqrt() / length) } else { Vector3::zeros() }
            }
        };
        Some(self.foot + from_foot)
    }

    /// Returns the intersection with the plane of a half-space widened by `slack`; `None` if the two are parallel.
    fn cut(&self, half_space: &HalfSpace, slack: f64) -> Option<Self> {
        let part = self.part_of(half_space.normal);
        let steepness = part.norm();
        if steepness <= PARALLEL {
            return None;
        }
        let uphill = part / steepness;
        let missing = half_space.offset - slack - half_space.normal.dot(&self.foot);
        let foot = self.foot + uphill * (missing / half_space.normal.dot(&uphill));
        let kind = match self.kind {
            Kind::Space => Kind::Plane(half_space.normal),
            Kind::Plane(normal) => Kind::Line(normal.cross(&uphill)),
            Kind::Line(_) | Kind::Point => Kind::Point,
        };
        Some(Self { foot, kind })
    }
}

#[cfg(test)]
mod tests;
