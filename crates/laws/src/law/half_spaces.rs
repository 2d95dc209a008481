//! The point nearest a wish within half-spaces and a ball: a quadratic program in three variables.

use nalgebra::Vector3;

/// Sine of the angle up to which a flat and a plane count as parallel.
const PARALLEL: f64 = 1e-8;
/// What counts as rounding of a violation, as parts of the lengths that it is the difference of: the first, and where planes are
/// so nearly parallel that it leaves no point, the others.
const ROUNDING: [f64; 4] = [1e-12, 1e-10, 1e-8, 1e-6];

/// All x with `normal . x >= offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HalfSpace {
    /// Of length 1.
    pub(super) normal: Vector3<f64>,
    pub(super) offset: f64,
}

impl HalfSpace {
    /// How far outside a point is; negative inside.
    fn violation(&self, point: &Vector3<f64>) -> f64 {
        self.offset - self.normal.dot(point)
    }

    /// The size of the lengths that a violation in the ball is the difference of.
    fn size(&self, radius: f64) -> f64 {
        radius + self.offset.abs()
    }
}

/// Half-spaces, and the memory that a search in them takes.
///
/// # Method
/// Half-spaces are added one by one, and while the best point of those before satisfies the next, it stays the best. Where it
/// does not, the best point lies on the plane of that half-space, which is the same problem with a dimension less (Seidel,
/// Small-dimensional linear programming and convex hulls made easy, 1991). Where no point is in all of them, "the largest
/// violation" is a fourth variable, and half-spaces are added by the same rule.
///
/// The order is the given one, so the same input gives the same bits; on average O(n) where the order is arbitrary, at
/// worst O(n^3), and as much once more for each half-space that cannot be satisfied. Nothing is allocated once the lists have
/// grown. Where wish and normals lie in the plane z = 0, so does the answer, exactly.
#[derive(Clone, Debug, Default)]
pub(super) struct HalfSpaces {
    given: Vec<HalfSpace>,
    /// Scratch: where others are violated no more than one of them.
    no_worse: Vec<HalfSpace>,
}

/// An answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Nearest {
    pub(super) point: Vector3<f64>,
    /// How far it is outside of the half-space that it violates most; 0 where it is in all of them, but for rounding.
    pub(super) violation: f64,
}

impl HalfSpaces {
    pub(super) fn clear(&mut self) {
        self.given.clear();
    }

    pub(super) fn push(&mut self, half_space: HalfSpace) {
        self.given.push(half_space);
    }

    /// The point nearest to `wish` in the ball of this radius about the origin and in all half-spaces; where there is none,
    /// the nearest of those that make the largest violation least. Violations are told to 1e-12 of the radius and the offsets,
    /// to 1e-6 where planes are nearly parallel.
    pub(super) fn nearest(&mut self, wish: Vector3<f64>, radius: f64) -> Nearest {
        let search = Search { aim: Aim::Near(wish), radius, slack: 0.0, rounding: ROUNDING[0] };
        match search.best(&self.given, &Flat::space()) {
            Ok(point) => Nearest { point, violation: 0.0 },
            Err(Nowhere { place, last }) => {
                let least = self.violate_least(place, last, radius);
                let relaxed = Search { slack: self.largest_violation(&least), ..search };
                let point = relaxed.best_but_for_rounding(&self.given).unwrap_or(least);
                Nearest { point, violation: self.largest_violation(&point) }
            }
        }
    }

    /// A point that makes the largest violation least, from one in all half-spaces before `place`.
    fn violate_least(&mut self, place: usize, mut point: Vector3<f64>, radius: f64) -> Vector3<f64> {
        let Self { given, no_worse } = self;
        let mut largest = 0.0;
        for (i, worst) in given.iter().enumerate().skip(place) {
            if worst.violation(&point) <= largest + ROUNDING[0] * worst.size(radius) {
                continue;
            }
            no_worse.clear();
            no_worse.extend(given[..i].iter().filter_map(|other| difference(other, worst)));
            let search = Search { aim: Aim::Along(worst.normal), radius, slack: 0.0, rounding: ROUNDING[0] };
            point = search.best_but_for_rounding(no_worse).unwrap_or(point);
            largest = given[..=i].iter().map(|given| given.violation(&point)).fold(0.0, f64::max);
        }
        point
    }

    fn largest_violation(&self, point: &Vector3<f64>) -> f64 {
        self.given.iter().map(|given| given.violation(point)).fold(0.0, f64::max)
    }
}

/// Where `other` is violated no more than `worst` is; `None` where that is everywhere or nowhere.
fn difference(other: &HalfSpace, worst: &HalfSpace) -> Option<HalfSpace> {
    let normal = other.normal - worst.normal;
    let length = normal.norm();
    (length > PARALLEL).then(|| HalfSpace { normal: normal / length, offset: (other.offset - worst.offset) / length })
}

/// What makes a point the best.
#[derive(Clone, Copy)]
enum Aim {
    /// To be near to this one.
    Near(Vector3<f64>),
    /// To be far in this direction.
    Along(Vector3<f64>),
}

/// No point is in the half-spaces up to the one at `place`.
#[derive(Clone, Copy)]
struct Nowhere {
    place: usize,
    /// The best point of those before.
    last: Vector3<f64>,
}

/// What is looked for in half-spaces and a ball.
#[derive(Clone, Copy)]
struct Search {
    aim: Aim,
    radius: f64,
    /// How much wider each half-space is.
    slack: f64,
    rounding: f64,
}

impl Search {
    /// The best point of a flat.
    fn best(&self, within: &[HalfSpace], flat: &Flat) -> Result<Vector3<f64>, Nowhere> {
        let mut point = flat.best(self.radius, self.aim).ok_or(Nowhere { place: 0, last: Vector3::zeros() })?;
        for (place, half_space) in within.iter().enumerate() {
            let nowhere = Nowhere { place, last: point };
            if half_space.violation(&point) > self.slack + self.rounding * half_space.size(self.radius) {
                let edge = flat.cut(half_space, self.slack).ok_or(nowhere)?;
                point = self.best(&within[..place], &edge).map_err(|_| nowhere)?;
            }
        }
        Ok(point)
    }

    /// The best point, where there must be one but for rounding.
    fn best_but_for_rounding(&self, within: &[HalfSpace]) -> Option<Vector3<f64>> {
        let rounded = |rounding| Self { rounding, ..*self }.best(within, &Flat::space()).ok();
        ROUNDING.into_iter().find_map(rounded)
    }
}

/// A point, a line, a plane or space.
struct Flat {
    /// The point of it nearest to the origin.
    foot: Vector3<f64>,
    kind: Kind,
}

enum Kind {
    Space,
    /// With this normal.
    Plane(Vector3<f64>),
    /// In this direction.
    Line(Vector3<f64>),
    Point,
}

impl Flat {
    fn space() -> Self {
        Self { foot: Vector3::zeros(), kind: Kind::Space }
    }

    /// The part of a vector that lies in it. Twice, so that what is left of one that is nearly perpendicular lies in it too.
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

    /// Its best point in the ball, where it meets the ball.
    fn best(&self, radius: f64, aim: Aim) -> Option<Vector3<f64>> {
        let room = radius * radius - self.foot.norm_squared();
        if room < 0.0 {
            return None;
        }
        let from_foot = match aim {
            Aim::Near(wish) => self.part_of(wish - self.foot).cap_magnitude(room.sqrt()),
            Aim::Along(direction) => {
                let part = self.part_of(direction);
                let length = part.norm();
                if length > PARALLEL { part * (room.sqrt() / length) } else { Vector3::zeros() }
            }
        };
        Some(self.foot + from_foot)
    }

    /// Its points on the plane of a half-space that is wider by `slack`, unless the two are parallel.
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
