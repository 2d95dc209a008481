//! Message definitions of planners: the fields in a bag decide how its messages are read, not the name of a schema.

use crate::mcap::topic::DeclaredTopic;

/// Kind of a message with curves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CurveKind {
    BSpline,
    /// List of B-splines.
    BSplines,
    /// Trajectory of least jerk through points.
    Minco,
    Polynomials,
    /// A known name with a definition of other fields.
    Unsupported,
}

/// Kind, name of the schema in a bag without definitions, and fields, one a line.
const KNOWN: [(CurveKind, &str, &str); 4] = [
    (
        CurveKind::BSpline,
        "traj_utils/msg/Bspline",
        "int32 drone_id\nint32 order\nint64 traj_id\nTime start_time\nfloat64[] knots\nPoint[] pos_pts\n\
         float64[] yaw_pts\nfloat64 yaw_dt",
    ),
    (CurveKind::BSplines, "traj_utils/msg/MultiBsplines", "int32 drone_id_from\nBspline[] traj"),
    (
        CurveKind::Minco,
        "traj_utils/msg/MINCOTraj",
        "int16 drone_id\nint32 traj_id\nTime start_time\nfloat32 des_clearance\nuint8 order\nfloat32[3] start_p\n\
         float32[3] start_v\nfloat32[3] start_a\nfloat32[3] end_p\nfloat32[3] end_v\nfloat32[3] end_a\n\
         float32[] inner_x\nfloat32[] inner_y\nfloat32[] inner_z\nfloat32[] duration",
    ),
    (
        CurveKind::Polynomials,
        "traj_utils/msg/PolyTraj",
        "int16 drone_id\nint32 traj_id\nTime start_time\nuint8 order\nfloat32[] coef_x\nfloat32[] coef_y\n\
         float32[] coef_z\nfloat32[] duration",
    ),
];

/// Returns whether the messages of a topic are curves of a planner.
pub(super) fn is_curve(topic: &DeclaredTopic) -> bool {
    curve_kind(&topic.schema, &topic.definition).is_some()
}

/// Fields of the types in messages of planners, and the full name of the ROS type. A definition may leave the section
/// of such a type out.
const STANDARD: [(&str, &str, &str); 2] = [
    ("Time", "builtin_interfaces/Time", "int32 sec\nuint32 nanosec"),
    ("Point", "geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z"),
];

/// Largest depth of types within types.
const DEEPEST: usize = 4;

/// Returns the kind of the curves in messages of a schema; `None` if they are no curves.
pub(super) fn curve_kind(schema: &str, definition: &str) -> Option<CurveKind> {
    let named = KNOWN.iter().find(|(_, name, _)| *name == schema);
    if definition.is_empty() {
        return named.map(|(kind, ..)| *kind);
    }
    // All kinds have the number of a drone. This test skips other definitions quickly, as it runs for each message.
    let is_candidate = named.is_some() || definition.contains("drone_id");
    let fields = is_candidate.then(|| Definition::new(schema, definition).fields())?;
    let found = KNOWN.iter().find(|(.., known)| *known == fields).map(|(kind, ..)| *kind);
    found.or(named.map(|_| CurveKind::Unsupported))
}

/// Returns the fields of a definition, one a line: type and name. Constants and comments are left out. The types
/// `Time`, `Point` and `Bspline` stand for all types with their fields.
pub(super) fn fields(schema: &str, definition: &str) -> String {
    Definition::new(schema, definition).fields()
}

/// Definition of a message and of the types in it.
struct Definition<'a> {
    /// Package of the message.
    package: &'a str,
    own: &'a str,
    /// Full name and text of each other type.
    types: Vec<(String, &'a str)>,
}

impl<'a> Definition<'a> {
    fn new(schema: &'a str, definition: &'a str) -> Self {
        let mut sections = definition.split("\n===").map(|section| section.trim_start_matches(['=', '\r', '\n']));
        let own = sections.next().unwrap_or_default();
        let types = sections.filter_map(|section| {
            let (head, body) = section.split_once('\n').unwrap_or((section, ""));
            Some((full_name(head.trim().strip_prefix("MSG:")?.trim(), ""), body))
        });
        Self { package: package(schema), own, types: types.collect() }
    }

    fn fields(&self) -> String {
        self.resolved(self.own, self.package, 0)
    }

    /// Returns the fields in a text of a package, one a line.
    fn resolved(&self, text: &str, package: &str, depth: usize) -> String {
        let lines = text.lines().filter_map(|line| {
            let (kind, rest) = line.split('#').next()?.trim().split_once(char::is_whitespace)?;
            let rest = rest.trim_start();
            let (name, value) = rest.split_at(rest.find(|c: char| c.is_whitespace() || c == '=').unwrap_or(rest.len()));
            let is_constant = value.trim_start().starts_with('=');
            (!is_constant).then(|| format!("{} {name}", self.named(kind, package, depth)))
        });
        lines.collect::<Vec<_>>().join("\n")
    }

    /// Returns the type of a field: the name above for a type with such fields, otherwise the type as it is written.
    fn named(&self, kind: &str, package: &str, depth: usize) -> String {
        // The name of ROS 1.
        if kind == "time" {
            return "Time".to_owned();
        }
        let (base, array) = kind.split_at(kind.find('[').unwrap_or(kind.len()));
        let full = full_name(base, package);
        let mut sections = self.types.iter().filter(|(name, _)| *name == full).map(|(_, text)| *text);
        let known = match sections.next() {
            None => STANDARD.iter().find(|(_, name, _)| *name == full).map(|(name, ..)| *name),
            // Two sections of one type contradict each other.
            Some(text) if depth < DEEPEST && sections.all(|other| other == text) => {
                let fields = self.resolved(text, self::package(&full), depth + 1);
                let standard = STANDARD.iter().find(|(.., known)| *known == fields).map(|(name, ..)| *name);
                standard.or((fields == KNOWN[0].2).then_some("Bspline"))
            }
            Some(_) => None,
        };
        match known {
            Some(name) => format!("{name}{array}"),
            // A type of the same name with other fields, or without a section.
            None if ["Time", "Point", "Bspline"].contains(&base) => format!("/{full}{array}"),
            None => kind.to_owned(),
        }
    }
}

/// Returns the package of a type: `traj_utils` of `traj_utils/msg/Bspline`.
fn package(name: &str) -> &str {
    name.split_once('/').map_or("", |(package, _)| package)
}

/// Returns a type as `PACKAGE/NAME`; a name without a package belongs to `own`.
fn full_name(name: &str, own: &str) -> String {
    let base = name.rsplit('/').next().unwrap_or(name);
    match package(name) {
        "" if own.is_empty() => base.to_owned(),
        "" => format!("{own}/{base}"),
        package => format!("{package}/{base}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const B_SPLINE: &str = "# a curve\nint32 drone_id\n\nint32 order   # degree\nint64 traj_id\n\
                            builtin_interfaces/Time start_time\nfloat64[] knots\ngeometry_msgs/msg/Point[] pos_pts\n\
                            float64[] yaw_pts\nfloat64 yaw_dt\nint32 NONE = 0\n";

    #[test]
    fn the_fields_decide_and_not_the_name() {
        let end = "================================================================================\n";
        let whole = format!("{B_SPLINE}{end}MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n");
        assert_eq!(curve_kind("bspline/msg/Bspline", &whole), Some(CurveKind::BSpline));
        // Negative twin: a known name with other fields.
        let other = whole.replace("int32 order", "int32 degree");
        assert_eq!(curve_kind("traj_utils/msg/Bspline", &other), Some(CurveKind::Unsupported));
        assert_eq!(curve_kind("bspline/msg/Bspline", &other), None);
        // Without a definition the name decides.
        assert_eq!(curve_kind("traj_utils/msg/Bspline", ""), Some(CurveKind::BSpline));
        assert_eq!(curve_kind("bspline/msg/Bspline", ""), None);
    }

    #[test]
    fn a_list_of_b_splines_needs_their_definition() {
        let list = |element: &str| {
            let end = "================================================================================\n";
            let list = "int32 drone_id_from\ntraj_utils/Bspline[] traj\n";
            let text = format!("{list}{end}MSG: traj_utils/Bspline\n{element}");
            curve_kind("traj_utils/msg/MultiBsplines", &text)
        };
        assert_eq!(list(B_SPLINE), Some(CurveKind::BSplines));
        assert_eq!(list("int32 drone_id\n"), Some(CurveKind::Unsupported));
    }

    #[test]
    fn bounds_and_the_fields_of_types_count() {
        let section = |name: &str, fields: &str| format!("{}\nMSG: {name}\n{fields}\n", "=".repeat(80));
        let [time, point] = ["builtin_interfaces/Time", "geometry_msgs/Point"];
        let whole = |point_fields: &str, time_fields: &str| {
            let text = B_SPLINE.to_owned() + &section(point, point_fields) + &section(time, time_fields);
            curve_kind("traj_utils/msg/Bspline", &text)
        };
        let [right_point, right_time] = ["float64 x\nfloat64 y\nfloat64 z", "int32 sec\nuint32 nanosec"];
        assert_eq!(whole(right_point, right_time), Some(CurveKind::BSpline));
        // Each defect alone.
        let unsupported = Some(CurveKind::Unsupported);
        assert_eq!(whole("float64 z\nfloat64 y\nfloat64 x", right_time), unsupported);
        assert_eq!(whole("float32 x\nfloat32 y\nfloat32 z", right_time), unsupported);
        assert_eq!(whole(right_point, "uint32 nanosec\nint32 sec"), unsupported);
        let twice = B_SPLINE.to_owned() + &section(point, right_point) + &section(point, "float64 z");
        assert_eq!(curve_kind("traj_utils/msg/Bspline", &twice), unsupported);
        let bounded = "geometry_msgs/msg/Point[<=50] raw_pts\ngeometry_msgs/msg/Point[] pos_pts\n";
        let more = B_SPLINE.replace("geometry_msgs/msg/Point[] pos_pts\n", bounded);
        assert_eq!(curve_kind("traj_utils/msg/Bspline", &more), unsupported);
        let text = B_SPLINE.replace("int32 NONE = 0", "string<=8 note");
        assert_eq!(curve_kind("traj_utils/msg/Bspline", &text), unsupported);
        // A point of another package has to be defined.
        let own = B_SPLINE.replace("geometry_msgs/msg/Point", "Point");
        assert_eq!(curve_kind("traj_utils/msg/Bspline", &own), unsupported);
        let own = own + &section("traj_utils/Point", right_point);
        assert_eq!(curve_kind("traj_utils/msg/Bspline", &own), Some(CurveKind::BSpline));
        let own = own.replace("MSG: traj_utils/Point", "MSG: other/Point");
        assert_eq!(curve_kind("traj_utils/msg/Bspline", &own), unsupported);
    }
}
