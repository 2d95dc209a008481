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

/// Returns the kind of the curves in messages of a schema; `None` if they are no curves.
pub(super) fn curve_kind(schema: &str, definition: &str) -> Option<CurveKind> {
    let named = KNOWN.iter().find(|(_, name, _)| *name == schema);
    if definition.is_empty() {
        return named.map(|(kind, ..)| *kind);
    }
    let mut sections = definition.split("\n===").map(|section| section.trim_start_matches(['=', '\r', '\n']));
    let own = fields(sections.next().unwrap_or_default());
    let found = KNOWN.iter().find(|(.., fields)| *fields == own).map(|(kind, ..)| *kind);
    let found = found.filter(|kind| *kind != CurveKind::BSplines || sections.any(defines_b_spline));
    found.or(named.map(|_| CurveKind::Unsupported))
}

/// Returns whether a part of a definition defines the type of the elements of a list of B-splines.
fn defines_b_spline(section: &str) -> bool {
    let Some((head, body)) = section.split_once('\n') else { return false };
    let name = head.trim().strip_prefix("MSG:").map_or("", |name| base(name.trim()));
    name == "Bspline" && fields(body) == KNOWN[0].2
}

/// Returns the fields of a definition, one a line: type without its package, and name. Constants and comments are left
/// out.
pub(super) fn fields(definition: &str) -> String {
    let lines = definition.lines().take_while(|line| !line.starts_with("===")).filter_map(|line| {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_whitespace();
        let (kind, name) = (words.next()?, words.next()?);
        // `time` is the name of ROS 1.
        let kind = if kind == "time" { "Time" } else { base(kind) };
        (!line.contains('=')).then(|| format!("{kind} {name}"))
    });
    lines.collect::<Vec<_>>().join("\n")
}

fn base(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
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
}
