//! Tree of frames from transforms, and the vehicles among its frames.
//!
//! A frame has one parent. A vehicle is the topmost moving frame below carriers such as `map` and `odom`. If a branch
//! contains a frame `base_link` or `base_footprint`, the topmost of these is the vehicle instead. Frames below a
//! vehicle (wheels, cameras, rotors) belong to it.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::super::error::{ContentKind, Fault, UNSEEN, quoted, refuse};
use tautline_core::option::{FRAME, TOPIC};

/// Largest depth of a frame.
const DEEPEST: usize = 64;

/// Names of the body frame of a robot.
const BODIES: [&str; 2] = ["base_link", "base_footprint"];

/// Words in names of frames that carry robots (REP 105).
const CARRIERS: [&str; 4] = ["map", "odom", "world", "earth"];

/// Relation of a frame to its parent.
#[derive(Clone, Debug, Default)]
struct Edge {
    parent: String,
    /// Constant pose, if there is one.
    fixed_pose: Option<FramePose>,
    /// Whether a transform topic moves the frame.
    moves: bool,
    /// A second parent, in contradictory transforms.
    second_parent: Option<String>,
    /// Whether it has several constant poses, or a constant pose and also moves.
    is_contradictory: bool,
    /// Poses over time \[ns\], if interpolation requires them.
    samples: Vec<(i64, Isometry3<f64>)>,
}

/// Frames and their parents.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    edges: BTreeMap<String, Edge>,
}

/// Transforms between two frames. Contains the child frames from the first frame up to the common ancestor, and those
/// from the second frame up to it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chain {
    up: Vec<String>,
    down: Vec<String>,
}

impl Chain {
    /// Returns whether the upward part contains the transform of a frame.
    pub(super) fn contains_upward(&self, child: &str) -> bool {
        self.up.iter().any(|frame| frame == child)
    }

    /// Returns the child frames of all transforms.
    pub(super) fn frames(&self) -> impl Iterator<Item = &String> {
        self.up.iter().chain(&self.down)
    }
}

/// Vehicle described by transforms.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct VehicleFrame {
    pub(super) frame: String,
    /// Nearest moving frame at or above it, whose samples give the poses of the vehicle.
    pub(super) driver: String,
    /// Parent of the driver.
    pub(super) carrier: String,
}

impl Tree {
    /// Adds the parent of a frame, with its pose there if constant.
    pub(super) fn learn(&mut self, child: &str, parent: &str, fixed_pose: Option<FramePose>) {
        let Some(known) = self.edges.get_mut(child) else {
            let (parent, moves) = (parent.to_owned(), fixed_pose.is_none());
            self.edges.insert(child.to_owned(), Edge { parent, fixed_pose, moves, ..Edge::default() });
            return;
        };
        if known.parent != parent && known.second_parent.is_none() {
            known.second_parent = Some(parent.to_owned());
        }
        known.moves |= fixed_pose.is_none();
        known.is_contradictory |= known.fixed_pose != fixed_pose;
    }

    /// Returns whether a frame moves in its parent, even if it also has a constant pose there.
    pub(super) fn moves(&self, frame: &str) -> bool {
        self.edges.get(frame).is_some_and(|edge| edge.moves)
    }

    /// Refuses a frame with contradictory poses.
    fn check(&self, frame: &str) -> Result<(), Fault> {
        if self.edges.get(frame).is_none_or(|edge| !edge.is_contradictory) {
            return Ok(());
        }
        let problem = format!("frame {} has several constant poses, or moves as well", quoted(frame));
        refuse(ContentKind::Transforms, problem, "record again, with one publisher of each transform")
    }

    /// Returns the frames with constant poses.
    pub(super) fn fixed_frames(&self) -> impl Iterator<Item = &str> {
        self.edges.iter().filter(|(_, edge)| !edge.moves).map(|(frame, _)| frame.as_str())
    }

    /// Returns all frames that have a parent.
    pub(super) fn frames(&self) -> impl Iterator<Item = &str> {
        self.edges.keys().map(String::as_str)
    }

    /// Returns a frame and all its ancestors, up to the root.
    pub(super) fn ancestry<'a>(&'a self, frame: &'a str) -> Result<Vec<&'a str>, Fault> {
        let mut way = vec![frame];
        while let Some((child, edge)) = way.last().and_then(|last| self.edges.get_key_value(*last)) {
            if let Some(second_parent) = &edge.second_parent {
                let problem = format!(
                    "frame {} has the parents {} and {}",
                    quoted(child),
                    quoted(&edge.parent),
                    quoted(second_parent)
                );
                let remedy = format!("record robots in separate namespaces, or choose topics of poses with {TOPIC}");
                return refuse(ContentKind::Transforms, problem, remedy);
            }
            if way.len() > DEEPEST {
                let problem = format!("frame {} has more than {DEEPEST} ancestors", quoted(frame));
                return refuse(ContentKind::Transforms, problem, "check the transforms for a cycle");
            }
            way.push(&edge.parent);
        }
        Ok(way)
    }

    /// Returns the vehicles.
    pub(super) fn bodies(&self) -> Result<Vec<VehicleFrame>, Fault> {
        let ways: BTreeMap<_, _> =
            self.frames().map(|frame| Ok((frame, self.ancestry(frame)?))).collect::<Result<_, Fault>>()?;
        let moved = |way: &[&str]| way.iter().any(|frame| self.moves(frame));
        let named: BTreeSet<&str> = ways
            .iter()
            .filter(|(frame, way)| is_body(frame) && moved(way) && !way[1..].iter().any(|above| is_body(above)))
            .map(|(frame, _)| *frame)
            .collect();
        // Frames above a body frame.
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
            let index = way.iter().position(|frame| self.moves(frame))?;
            let [driver, carrier] = [way[index], way[index + 1]].map(str::to_owned);
            let body = VehicleFrame { frame: (*frame).to_owned(), driver, carrier };
            Some(way[..=index].iter().try_for_each(|frame| self.check(frame)).map(|()| body))
        };
        vehicles.filter_map(body).collect()
    }

    /// Returns the transforms from a frame to another; `None` without a common ancestor.
    pub(super) fn chain(&self, from: &str, into: &str) -> Result<Option<Chain>, Fault> {
        let (up, down) = (self.ancestry(from)?, self.ancestry(into)?);
        let meeting =
            up.iter().enumerate().find_map(|(k, frame)| Some((k, down.iter().position(|other| other == frame)?)));
        let Some((top, bottom)) = meeting else { return Ok(None) };
        let owned = |frames: &[&str]| frames.iter().map(|frame| (*frame).to_owned()).collect();
        Ok(Some(Chain { up: owned(&up[..top]), down: owned(&down[..bottom]) }))
    }

    /// Stores the pose of a moving frame.
    pub(super) fn store(&mut self, frame: &str, time_ns: i64, placed: &FramePose) -> Result<(), Fault> {
        let transform = placed.rigid()?;
        if let Some(edge) = self.edges.get_mut(frame) {
            edge.samples.push((time_ns, transform));
        }
        Ok(())
    }

    /// Sorts the stored poses by time.
    pub(super) fn settle(&mut self) -> Result<(), Fault> {
        for (frame, edge) in &mut self.edges {
            edge.samples.sort_by_key(|(time_ns, _)| *time_ns);
            edge.samples.dedup();
            if let Some([(time_ns, _), _]) = edge.samples.array_windows().find(|[a, b]| a.0 == b.0) {
                let problem = format!("frame {} has two poses at {time_ns} ns", quoted(frame));
                return refuse(ContentKind::Transforms, problem, "record again, with one publisher of each transform");
            }
        }
        Ok(())
    }

    /// Returns the transform along a chain at a time; `given` is the known pose of one of its frames.
    pub(super) fn transform_along(
        &self,
        chain: &Chain,
        time_ns: i64,
        given: Option<(&str, Isometry3<f64>)>,
    ) -> Result<Option<TransformAt>, Fault> {
        let mut interpolated = false;
        let mut product = |frames: &[String]| -> Result<Option<Isometry3<f64>>, Fault> {
            let mut whole = Isometry3::identity();
            for frame in frames {
                let part = match given.filter(|(known, _)| known == frame) {
                    Some((_, transform)) => TransformAt { transform, interpolated: false },
                    None => match self.place(frame, time_ns)? {
                        Some(known) => known,
                        None => return Ok(None),
                    },
                };
                interpolated |= part.interpolated;
                whole = part.transform * whole;
            }
            Ok(Some(whole))
        };
        let (up, down) = (product(&chain.up)?, product(&chain.down)?);
        Ok(up.zip(down).map(|(up, down)| TransformAt { transform: down.inverse() * up, interpolated }))
    }

    fn place(&self, frame: &str, time_ns: i64) -> Result<Option<TransformAt>, Fault> {
        let Some(edge) = self.edges.get(frame) else { return Ok(None) };
        self.check(frame)?;
        match &edge.fixed_pose {
            Some(placed) => Ok(Some(TransformAt { transform: placed.rigid()?, interpolated: false })),
            None => Ok(pose_at(&edge.samples, time_ns)),
        }
    }
}

/// Returns whether a frame has the name of a robot body, optionally prefixed by the name of the robot.
fn is_body(frame: &str) -> bool {
    BODIES
        .iter()
        .any(|body| frame.strip_suffix(body).is_some_and(|robot| robot.is_empty() || robot.ends_with(['/', '_'])))
}

/// Returns whether a frame carries robots and is not one.
fn is_carrier(frame: &str) -> bool {
    let frame = frame.to_lowercase();
    frame.split(|c: char| !c.is_alphanumeric()).any(|word| CARRIERS.contains(&word))
}

/// Longest interval for interpolation of a moving transform \[ns\].
const LONGEST_BRACKET_NS: i64 = 1_000_000_000;

/// Largest deviation of the norm of a quaternion from 1, as in tf2.
const NORM: f64 = 0.01;

/// Cosine of half the angle above which chord and arc differ by less than 1e-9.
const NEARLY_SAME: f64 = 1.0 - 1e-9;

/// Pose of a frame in its parent as recorded: position and the quaternion x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FramePose {
    pub(super) position: Vector3<f64>,
    pub(super) turn: [f64; 4],
}

impl FramePose {
    /// Returns the transform from the frame to its parent.
    pub(super) fn rigid(&self) -> Result<Isometry3<f64>, Fault> {
        if let Some(odd) = self.position.iter().chain(&self.turn).find(|x| !x.is_finite()) {
            return Err(Fault::not_finite("transform", &odd.to_string(), UNSEEN));
        }
        let [x, y, z, w] = self.turn;
        let quaternion = Quaternion::new(w, x, y, z);
        if (quaternion.norm() - 1.0).abs() > NORM {
            let problem = format!("the quaternion {x}, {y}, {z}, {w} is not normalized");
            return refuse(ContentKind::Transforms, problem, format!("record again, or omit {FRAME}"));
        }
        Ok(Isometry3::from_parts(Translation3::from(self.position), UnitQuaternion::new_normalize(quaternion)))
    }
}

/// Transform at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TransformAt {
    pub(super) transform: Isometry3<f64>,
    /// Whether it is interpolated between two samples.
    pub(super) interpolated: bool,
}

/// Returns a moving transform at a time from its samples in order of time; `None` outside of them or in a gap above
/// [`LONGEST_BRACKET_NS`].
pub(super) fn pose_at(samples: &[(i64, Isometry3<f64>)], time_ns: i64) -> Option<TransformAt> {
    let after = samples.partition_point(|(stamp, _)| *stamp < time_ns);
    let (to_ns, to) = samples.get(after)?;
    if *to_ns == time_ns {
        return Some(TransformAt { transform: *to, interpolated: false });
    }
    let (from_ns, from) = samples.get(after.checked_sub(1)?)?;
    let span_ns = to_ns.checked_sub(*from_ns).filter(|span| *span <= LONGEST_BRACKET_NS)?;
    let part = (time_ns - from_ns) as f64 / span_ns as f64;
    let shift = from.translation.vector.lerp(&to.translation.vector, part);
    let turn = slerp(from.rotation, to.rotation, part);
    Some(TransformAt { transform: Isometry3::from_parts(shift.into(), turn), interpolated: true })
}

/// Spherical linear interpolation along the shortest arc.
fn slerp(from: UnitQuaternion<f64>, to: UnitQuaternion<f64>, part: f64) -> UnitQuaternion<f64> {
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

    const STILL: Option<FramePose> = Some(FramePose { position: Vector3::new(0.0, 0.0, 0.5), turn: NO_TURN });

    fn tree(edges: &[(&str, &str, Option<FramePose>)]) -> Tree {
        let mut tree = Tree::default();
        for (parent, child, fixed_pose) in edges {
            tree.learn(child, parent, *fixed_pose);
        }
        tree
    }

    fn bodies(edges: &[(&str, &str, Option<FramePose>)]) -> Vec<[String; 2]> {
        let bodies = tree(edges).bodies().expect("a tree");
        bodies.into_iter().map(|body| [body.frame, body.driver]).collect()
    }

    #[test]
    fn vehicle_is_the_body_frame_below_its_carriers() {
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
    fn chains_lead_up_and_down_and_cycles_are_refused() {
        let tree =
            tree(&[("map", "a", STILL), ("a", "b", STILL), ("map", "c", STILL), ("x", "y", None), ("y", "x", None)]);
        let transform_along = |from, into| {
            let chain = tree.chain(from, into).expect("a tree")?;
            let known = tree.transform_along(&chain, 0, None).expect("rotations").expect("all are constant");
            Some((known.transform.translation.z, known.interpolated))
        };
        assert_eq!(transform_along("b", "map"), Some((1.0, false)));
        assert_eq!(transform_along("c", "b"), Some((-0.5, false)));
        assert_eq!(transform_along("b", "elsewhere"), None);
        assert!(tree.chain("x", "map").is_err() && tree.bodies().is_err());
    }

    #[test]
    fn contradictory_parents_and_poses_are_refused() {
        let mut tree = tree(&[("map", "a", STILL), ("map", "b", None)]);
        tree.learn("a", "map", STILL);
        let chain = tree.chain("a", "map").expect("a tree").expect("a way");
        assert!(tree.transform_along(&chain, 0, None).is_ok());
        tree.learn("a", "map", None);
        assert!(tree.transform_along(&chain, 0, None).is_err());
        tree.learn("a", "odom", STILL);
        assert!(tree.chain("a", "map").is_err() && tree.chain("b", "map").is_ok());
        let pose = |x| FramePose { position: Vector3::new(x, 0.0, 0.0), turn: NO_TURN };
        tree.store("b", 5, &pose(1.0)).expect("a rotation");
        tree.store("b", 5, &pose(1.0)).expect("a rotation");
        assert!(tree.settle().is_ok());
        tree.store("b", 5, &pose(2.0)).expect("a rotation");
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
    fn transform_is_interpolated_only_between_samples() {
        let samples = [sample(0, 0.0, 0.0), sample(100, 1.0, 1.0), sample(1_000_000_101, 2.0, 0.0)];
        assert_eq!(pose_at(&samples, 100), Some(TransformAt { transform: samples[1].1, interpolated: false }));
        let found = pose_at(&samples, 25).expect("between");
        assert!(found.interpolated && found.transform.translation.x == 0.25);
        assert!(found.transform.rotation.angle_to(&turned(0.25)) < 1e-12);
        for outside in [-1, 101, 1_000_000_102, i64::MIN, i64::MAX] {
            assert_eq!(pose_at(&samples, outside), None, "{outside}");
        }
    }

    #[test]
    fn interpolation_takes_the_shortest_arc() {
        let far = UnitQuaternion::new_unchecked(-turned(1.0).into_inner());
        assert!(slerp(turned(0.0), far, 0.5).angle_to(&turned(0.5)) < 1e-12);
        assert!(slerp(turned(0.0), turned(1e-7), 0.5).angle_to(&turned(5e-8)) < 1e-15);
    }

    #[test]
    fn invalid_quaternions_are_refused() {
        let placed = |turn| FramePose { position: Vector3::zeros(), turn }.rigid();
        assert!(placed([0.0, 0.0, 0.0, 0.0]).is_err() && placed([0.0, 0.0, f64::NAN, 1.0]).is_err());
        assert!(placed([0.0, 0.0, 0.0, 1.005]).is_ok());
    }
}
