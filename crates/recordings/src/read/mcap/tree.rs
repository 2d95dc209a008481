//! The tree of frames that transforms make, and which of its frames are vehicles.
//!
//! A frame has one parent. A vehicle is the first frame on the way up from `map` and `odom`, which only carry it, that
//! moves; where some frame of its branch is called `base_link` or `base_footprint`, it is the first of those. What hangs on
//! a vehicle (wheels, cameras, rotors) is part of it.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::super::error::{Fault, UNSEEN, quoted, refuse};

/// Longest way from a frame to its root \[frames\].
const DEEPEST: usize = 64;

/// What the body of a robot is called.
const BODIES: [&str; 2] = ["base_link", "base_footprint"];

/// Words in the names of frames that carry robots, as REP 105 calls them.
const CARRIERS: [&str; 4] = ["map", "odom", "world", "earth"];

/// How a frame lies in its parent.
#[derive(Clone, Debug)]
struct Edge {
    parent: String,
    /// Where it stands still.
    still: Option<Placed>,
    /// Whether it is said to move.
    moves: bool,
    /// Another frame that is said to be its parent.
    stray: Option<String>,
    /// Whether it is said to stand still in several places, or to move as well.
    torn: bool,
    /// Where it was at some times \[ns\], once these are needed.
    samples: Vec<(i64, Isometry3<f64>)>,
}

/// Frames and their parents.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    edges: BTreeMap<String, Edge>,
}

/// The transforms between two frames: children of those that lead up from the one to what both are in, and of those that
/// lead down from there to the other, as seen from below.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chain {
    up: Vec<String>,
    down: Vec<String>,
}

impl Chain {
    /// Whether one of the transforms that lead up is that of a frame.
    pub(super) fn leads_up_over(&self, child: &str) -> bool {
        self.up.iter().any(|frame| frame == child)
    }

    /// Children of all transforms.
    pub(super) fn frames(&self) -> impl Iterator<Item = &String> {
        self.up.iter().chain(&self.down)
    }
}

/// A vehicle that transforms speak of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Body {
    pub(super) frame: String,
    /// The nearest frame above it, or itself, that moves in its parent: with each sample of that it is seen.
    pub(super) driver: String,
    /// What its driver moves in.
    pub(super) carrier: String,
}

impl Tree {
    /// Learns what a frame lies in, and where it stands still there.
    pub(super) fn learn(&mut self, child: &str, parent: &str, still: Option<Placed>) {
        let Some(known) = self.edges.get_mut(child) else {
            let (parent, moves) = (parent.to_owned(), still.is_none());
            let edge = Edge { parent, still, moves, stray: None, torn: false, samples: Vec::new() };
            self.edges.insert(child.to_owned(), edge);
            return;
        };
        if known.parent != parent && known.stray.is_none() {
            known.stray = Some(parent.to_owned());
        }
        known.moves |= still.is_none();
        known.torn |= known.still != still;
    }

    /// Whether a frame moves in its parent, also one that is said to stand still there as well.
    pub(super) fn moves(&self, frame: &str) -> bool {
        self.edges.get(frame).is_some_and(|edge| edge.moves)
    }

    /// Refuses a frame that is in several places at once.
    fn check(&self, frame: &str) -> Result<(), Fault> {
        if self.edges.get(frame).is_none_or(|edge| !edge.torn) {
            return Ok(());
        }
        let problem = format!("frame {} stands still in more than one place, or moves as well", quoted(frame));
        refuse("recording/transforms", problem, "record again, with one publisher of each transform")
    }

    /// Frames that stand still in their parents.
    pub(super) fn still(&self) -> impl Iterator<Item = &str> {
        self.edges.iter().filter(|(_, edge)| !edge.moves).map(|(frame, _)| frame.as_str())
    }

    /// All frames that have a parent.
    pub(super) fn frames(&self) -> impl Iterator<Item = &str> {
        self.edges.keys().map(String::as_str)
    }

    /// A frame and all that it is in, up to the root.
    pub(super) fn way_up<'a>(&'a self, frame: &'a str) -> Result<Vec<&'a str>, Fault> {
        let mut way = vec![frame];
        while let Some((child, edge)) = way.last().and_then(|last| self.edges.get_key_value(*last)) {
            if let Some(stray) = &edge.stray {
                let problem =
                    format!("frame {} is given in {} and in {}", quoted(child), quoted(&edge.parent), quoted(stray));
                let remedy = "a frame has one parent: record robots under namespaces of their own, or name topics of poses with --topic";
                return refuse("recording/transforms", problem, remedy);
            }
            if way.len() > DEEPEST {
                let problem = format!("transforms lead from {} through more than {DEEPEST} frames", quoted(frame));
                return refuse("recording/transforms", problem, "look whether they go round in a circle");
            }
            way.push(&edge.parent);
        }
        Ok(way)
    }

    /// The vehicles.
    pub(super) fn bodies(&self) -> Result<Vec<Body>, Fault> {
        let ways: BTreeMap<_, _> =
            self.frames().map(|frame| Ok((frame, self.way_up(frame)?))).collect::<Result<_, Fault>>()?;
        let moved = |way: &[&str]| way.iter().any(|frame| self.moves(frame));
        let named: BTreeSet<&str> = ways
            .iter()
            .filter(|(frame, way)| is_body(frame) && moved(way) && !way[1..].iter().any(|above| is_body(above)))
            .map(|(frame, _)| *frame)
            .collect();
        // Frames with a body somewhere below them.
        let carrying: BTreeSet<&str> = named.iter().flat_map(|body| ways[body][1..].iter().copied()).collect();
        let unnamed = |frame: &str| self.moves(frame) && !is_carrier(frame);
        let is_vehicle = |frame: &str, way: &[&str]| {
            let above = &way[1..];
            named.contains(frame)
                || (unnamed(frame)
                    && !carrying.contains(frame)
                    && !above
                        .iter()
                        .any(|above| named.contains(above) || (unnamed(above) && !carrying.contains(above))))
        };
        let vehicles = ways.iter().filter(|(frame, way)| is_vehicle(frame, way));
        let body = |(frame, way): (&&str, &Vec<&str>)| {
            let at = way.iter().position(|frame| self.moves(frame))?;
            let [driver, carrier] = [way[at], way[at + 1]].map(str::to_owned);
            let body = Body { frame: (*frame).to_owned(), driver, carrier };
            Some(way[..=at].iter().try_for_each(|frame| self.check(frame)).map(|()| body))
        };
        vehicles.filter_map(body).collect()
    }

    /// The transforms from a frame into another; none where they have nothing in common.
    pub(super) fn chain(&self, from: &str, into: &str) -> Result<Option<Chain>, Fault> {
        let (up, down) = (self.way_up(from)?, self.way_up(into)?);
        let meeting = up.iter().enumerate().find_map(|(k, frame)| Some((k, down.iter().position(|of| of == frame)?)));
        let Some((top, bottom)) = meeting else { return Ok(None) };
        let owned = |frames: &[&str]| frames.iter().map(|frame| (*frame).to_owned()).collect();
        Ok(Some(Chain { up: owned(&up[..top]), down: owned(&down[..bottom]) }))
    }

    /// Remembers where a moving frame was.
    pub(super) fn remember(&mut self, frame: &str, time_ns: i64, placed: &Placed) -> Result<(), Fault> {
        let transform = placed.rigid()?;
        if let Some(edge) = self.edges.get_mut(frame) {
            edge.samples.push((time_ns, transform));
        }
        Ok(())
    }

    /// Puts what is remembered in order of time.
    pub(super) fn settle(&mut self) -> Result<(), Fault> {
        for (frame, edge) in &mut self.edges {
            edge.samples.sort_by_key(|(time_ns, _)| *time_ns);
            edge.samples.dedup();
            if let Some([(time_ns, _), _]) = edge.samples.array_windows().find(|[a, b]| a.0 == b.0) {
                let problem = format!("frame {} is in two places of its parent at {time_ns} ns", quoted(frame));
                return refuse("recording/transforms", problem, "record again, with one publisher of each transform");
            }
        }
        Ok(())
    }

    /// What turns places at the begin of a chain into places at its end, at a time; `given` is where one of its frames is
    /// known to be then.
    pub(super) fn along(
        &self,
        chain: &Chain,
        time_ns: i64,
        given: Option<(&str, Isometry3<f64>)>,
    ) -> Result<Option<Known>, Fault> {
        let mut guessed = false;
        let mut product = |frames: &[String]| -> Result<Option<Isometry3<f64>>, Fault> {
            let mut whole = Isometry3::identity();
            for frame in frames {
                let part = match given.filter(|(known, _)| known == frame) {
                    Some((_, transform)) => Known { transform, guessed: false },
                    None => match self.place(frame, time_ns)? {
                        Some(known) => known,
                        None => return Ok(None),
                    },
                };
                guessed |= part.guessed;
                whole = part.transform * whole;
            }
            Ok(Some(whole))
        };
        let (up, down) = (product(&chain.up)?, product(&chain.down)?);
        Ok(up.zip(down).map(|(up, down)| Known { transform: down.inverse() * up, guessed }))
    }

    fn place(&self, frame: &str, time_ns: i64) -> Result<Option<Known>, Fault> {
        let Some(edge) = self.edges.get(frame) else { return Ok(None) };
        self.check(frame)?;
        match &edge.still {
            Some(placed) => Ok(Some(Known { transform: placed.rigid()?, guessed: false })),
            None => Ok(at(&edge.samples, time_ns)),
        }
    }
}

/// Whether a frame is called as the body of a robot is, perhaps behind the name of the robot.
fn is_body(frame: &str) -> bool {
    BODIES
        .iter()
        .any(|body| frame.strip_suffix(body).is_some_and(|robot| robot.is_empty() || robot.ends_with(['/', '_'])))
}

/// Whether a frame carries robots and is none.
fn is_carrier(frame: &str) -> bool {
    let frame = frame.to_lowercase();
    frame.split(|c: char| !c.is_alphanumeric()).any(|word| CARRIERS.contains(&word))
}

/// Samples of a moving transform further apart than this say nothing of what is between them \[ns\].
const LONGEST_BRACKET_NS: i64 = 1_000_000_000;

/// How far the norm of a quaternion may be from 1, as tf2 has it.
const NORM: f64 = 0.01;

/// Above this cosine of half the angle the chord is the arc to 1e-9 of it.
const NEARLY_SAME: f64 = 1.0 - 1e-9;

/// Where a frame lies in its parent, as it is written: position and the quaternion x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    pub(super) position: Vector3<f64>,
    pub(super) turn: [f64; 4],
}

impl Placed {
    /// What turns places in the frame into places in its parent.
    pub(super) fn rigid(&self) -> Result<Isometry3<f64>, Fault> {
        if let Some(odd) = self.position.iter().chain(&self.turn).find(|x| !x.is_finite()) {
            return Err(Fault::not_finite("transform", &odd.to_string(), UNSEEN));
        }
        let [x, y, z, w] = self.turn;
        let quaternion = Quaternion::new(w, x, y, z);
        if (quaternion.norm() - 1.0).abs() > NORM {
            let problem = format!("the quaternion {x}, {y}, {z}, {w} is no rotation: its length is not 1");
            return refuse("recording/transforms", problem, "record again, or leave --frame away");
        }
        Ok(Isometry3::from_parts(Translation3::from(self.position), UnitQuaternion::new_normalize(quaternion)))
    }
}

/// A transform at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    pub(super) transform: Isometry3<f64>,
    /// Whether it is a guess between two samples.
    pub(super) guessed: bool,
}

/// A moving transform at a time, out of samples in order of time; none where no two of them are around it, or where these
/// are too far apart.
pub(super) fn at(samples: &[(i64, Isometry3<f64>)], time_ns: i64) -> Option<Known> {
    let after = samples.partition_point(|(stamp, _)| *stamp < time_ns);
    let (to_ns, to) = samples.get(after)?;
    if *to_ns == time_ns {
        return Some(Known { transform: *to, guessed: false });
    }
    let (from_ns, from) = samples.get(after.checked_sub(1)?)?;
    let span_ns = to_ns.checked_sub(*from_ns).filter(|span| *span <= LONGEST_BRACKET_NS)?;
    let part = (time_ns - from_ns) as f64 / span_ns as f64;
    let shift = from.translation.vector.lerp(&to.translation.vector, part);
    let turn = between(from.rotation, to.rotation, part);
    Some(Known { transform: Isometry3::from_parts(shift.into(), turn), guessed: true })
}

/// The rotation at a part of the shortest way between two, at a steady rate.
fn between(from: UnitQuaternion<f64>, to: UnitQuaternion<f64>, part: f64) -> UnitQuaternion<f64> {
    let cosine = from.coords.dot(&to.coords);
    let (cosine, to) = if cosine < 0.0 { (-cosine, -to.coords) } else { (cosine, to.coords) };
    let (a, b) = if cosine > NEARLY_SAME {
        (1.0 - part, part)
    } else {
        let angle = libm::acos(cosine);
        (libm::sin((1.0 - part) * angle), libm::sin(part * angle))
    };
    UnitQuaternion::new_normalize(Quaternion::from(from.coords * a + to * b))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::messages::NO_TURN;
    use super::*;

    const STILL: Option<Placed> = Some(Placed { position: Vector3::new(0.0, 0.0, 0.5), turn: NO_TURN });

    fn tree(edges: &[(&str, &str, Option<Placed>)]) -> Tree {
        let mut tree = Tree::default();
        for (parent, child, still) in edges {
            tree.learn(child, parent, *still);
        }
        tree
    }

    fn bodies(edges: &[(&str, &str, Option<Placed>)]) -> Vec<[String; 2]> {
        let bodies = tree(edges).bodies().expect("a tree");
        bodies.into_iter().map(|body| [body.frame, body.driver]).collect()
    }

    #[test]
    fn a_robot_is_its_body_and_neither_what_carries_it_nor_what_hangs_on_it() {
        let robot = [
            ("map", "r1/odom", None),
            ("r1/odom", "r1/base_footprint", None),
            ("r1/base_footprint", "r1/base_link", STILL),
            ("r1/base_link", "r1/wheel", None),
            ("r1/base_link", "r1/camera", STILL),
        ];
        assert_eq!(bodies(&robot), [["r1/base_footprint", "r1/base_footprint"]]);
        assert_eq!(bodies(&robot[..1]), Vec::<[String; 2]>::new());
        let odd = [("map", "odom", None), ("odom", "robot", None), ("robot", "gimbal", None), ("map", "cf1", None)];
        assert_eq!(bodies(&odd), [["cf1", "cf1"], ["robot", "robot"]]);
        let markers = [("world", "drone", None), ("drone", "drone/base_link", STILL), ("world", "drone2", None)];
        assert_eq!(bodies(&markers), [["drone/base_link", "drone"], ["drone2", "drone2"]]);
    }

    #[test]
    fn chains_lead_up_and_down_and_circles_are_refused() {
        let tree =
            tree(&[("map", "a", STILL), ("a", "b", STILL), ("map", "c", STILL), ("x", "y", None), ("y", "x", None)]);
        let along = |from, into| {
            let chain = tree.chain(from, into).expect("a tree")?;
            let known = tree.along(&chain, 0, None).expect("rotations").expect("all stand still");
            Some((known.transform.translation.z, known.guessed))
        };
        assert_eq!(along("b", "map"), Some((1.0, false)));
        assert_eq!(along("c", "b"), Some((-0.5, false)));
        assert_eq!(along("b", "elsewhere"), None);
        assert!(tree.chain("x", "map").is_err() && tree.bodies().is_err());
    }

    #[test]
    fn a_frame_has_one_parent_and_one_place_in_it() {
        let mut tree = tree(&[("map", "a", STILL), ("map", "b", None)]);
        tree.learn("a", "map", STILL);
        let chain = tree.chain("a", "map").expect("a tree").expect("a way");
        assert!(tree.along(&chain, 0, None).is_ok());
        tree.learn("a", "map", None);
        assert!(tree.along(&chain, 0, None).is_err());
        tree.learn("a", "odom", STILL);
        assert!(tree.chain("a", "map").is_err() && tree.chain("b", "map").is_ok());
        let at = |x| Placed { position: Vector3::new(x, 0.0, 0.0), turn: NO_TURN };
        tree.remember("b", 5, &at(1.0)).expect("a rotation");
        tree.remember("b", 5, &at(1.0)).expect("a rotation");
        assert!(tree.settle().is_ok());
        tree.remember("b", 5, &at(2.0)).expect("a rotation");
        assert!(tree.settle().is_err());
    }
}

#[cfg(test)]
mod rigid_tests {
    use nalgebra::vector;

    use super::*;

    fn turned(angle: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle)
    }

    fn sample(time_ns: i64, x: f64, angle: f64) -> (i64, Isometry3<f64>) {
        (time_ns, Isometry3::from_parts(vector![x, 0.0, 0.0].into(), turned(angle)))
    }

    #[test]
    fn a_transform_is_known_at_samples_guessed_between_and_unknown_outside() {
        let samples = [sample(0, 0.0, 0.0), sample(100, 1.0, 1.0), sample(1_000_000_101, 2.0, 0.0)];
        assert_eq!(at(&samples, 100), Some(Known { transform: samples[1].1, guessed: false }));
        let found = at(&samples, 25).expect("between");
        assert!(found.guessed && found.transform.translation.x == 0.25);
        assert!(found.transform.rotation.angle_to(&turned(0.25)) < 1e-12);
        for outside in [-1, 101, 1_000_000_102, i64::MIN, i64::MAX] {
            assert_eq!(at(&samples, outside), None, "{outside}");
        }
    }

    #[test]
    fn rotations_take_the_shortest_way() {
        let far = UnitQuaternion::new_unchecked(-turned(1.0).into_inner());
        assert!(between(turned(0.0), far, 0.5).angle_to(&turned(0.5)) < 1e-12);
        assert!(between(turned(0.0), turned(1e-7), 0.5).angle_to(&turned(5e-8)) < 1e-15);
    }

    #[test]
    fn what_is_no_rotation_is_refused() {
        let placed = |turn| Placed { position: Vector3::zeros(), turn }.rigid();
        assert!(placed([0.0, 0.0, 0.0, 0.0]).is_err() && placed([0.0, 0.0, f64::NAN, 1.0]).is_err());
        assert!(placed([0.0, 0.0, 0.0, 1.005]).is_ok());
    }
}
