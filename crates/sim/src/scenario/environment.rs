//! Parts of a scenario that a learning environment ignores.
//!
//! An environment replaces the law, its graph and its rate. It observes true states and pays for the distance to the
//! slots of the first leg, which are fixed positions. Any other target, observation or command is a part that it
//! ignores.

use super::document::Assignment;
use super::spec::Scenario;
use super::template::Template;
use crate::link::ImperfectionSpec as _;
use tautline_laws::target::{Guidance, ReferenceMotion};

/// Part of a scenario that a learning environment ignores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IgnoredPart {
    /// Key of the part.
    pub key: &'static str,
    /// Reason why the environment ignores the part.
    pub what: &'static str,
    /// Key and TOML value that turn the part off; `None` if the scenario must be written without it.
    pub off: Option<(&'static str, &'static str)>,
}

/// Parts in the order of their check.
const REFERENCE: IgnoredPart = IgnoredPart { key: "reference", what: "it moves the slots", off: None };
const LEADER: IgnoredPart =
    IgnoredPart { key: "reference.leader", what: "the other vehicles follow the leader", off: None };
const LEGS: IgnoredPart = IgnoredPart { key: "leg", what: "it has further slots", off: Some(("leg", "[]")) };
const REASSIGNMENT: IgnoredPart = IgnoredPart {
    key: "formation.assignment",
    what: "it gives a stalled vehicle another slot",
    off: Some(("formation.assignment", "\"given\"")),
};
const RANDOM_SLOTS: IgnoredPart = IgnoredPart {
    key: "formation.assignment",
    what: "each random start has its own assignment of slots",
    off: Some(("formation.assignment", "\"given\"")),
};
const RECOVERY: IgnoredPart =
    IgnoredPart { key: "deadlock", what: "it spreads the slots", off: Some(("deadlock.mode", "\"off\"")) };
const SENSING: IgnoredPart =
    IgnoredPart { key: "sensing", what: "observations are the true states", off: Some(("sensing", "{}")) };
const NETWORK: IgnoredPart =
    IgnoredPart { key: "network", what: "observations are the true states", off: Some(("network", "{}")) };
const ACTUATION: IgnoredPart =
    IgnoredPart { key: "actuation", what: "actions are exact accelerations", off: Some(("actuation", "{}")) };
const FAILURES: IgnoredPart =
    IgnoredPart { key: "failure", what: "actions are exact accelerations", off: Some(("failure", "[]")) };
const SHIELD: IgnoredPart =
    IgnoredPart { key: "shield", what: "it replaces actions", off: Some(("shield.enabled", "false")) };

impl Template {
    /// Returns the parts of the scenario that a learning environment ignores, in a fixed order.
    #[must_use]
    pub fn parts_ignored_by_environments(&self) -> Vec<IgnoredPart> {
        let mut parts = self.own().parts_ignored_by_environments();
        // An assignment to the nearest slots depends on the start.
        if self.start_is_random() && self.assignment() == Assignment::Optimal && !parts.contains(&REASSIGNMENT) {
            parts.push(RANDOM_SLOTS);
        }
        parts
    }
}

impl Scenario {
    fn parts_ignored_by_environments(&self) -> Vec<IgnoredPart> {
        // Without `..`, a new field does not compile until it is listed here.
        let Self {
            // Known to the environment, or part of the motion and of the audit.
            name: _,
            start: _,
            airframe: _,
            space: _,
            mass_kg: _,
            hull_radius_m: _,
            a22_per_s: _,
            drag_per_s: _,
            wind: _,
            obstacles: _,
            delta_m: _,
            safety: _,
            plant: _,
            noise_seed: _,
            // Replaced by the policy and its rate, and by the length of an episode.
            graph: _,
            law: _,
            external_law: _,
            time: _,
            arrival: _,
            // Ignored.
            legs,
            reference,
            deadlock,
            sensing,
            network,
            actuation,
            shield,
            failures,
        } = self;
        let is_moving = |guidance: &Guidance| match guidance.motion {
            ReferenceMotion::Rest { position_m } => position_m != nalgebra::Vector3::zeros(),
            _ => true,
        };
        let has_recovery = deadlock.is_on() && self.law().is_ok_and(|law| law.capabilities().settling.is_some());
        let is_led = reference.as_ref().is_some_and(|guidance| guidance.known_by.leader().is_some());
        [
            (reference.as_ref().is_some_and(is_moving), REFERENCE),
            (is_led, LEADER),
            (legs.len() > 1, LEGS),
            (legs.iter().any(|leg| leg.interchangeable), REASSIGNMENT),
            (has_recovery, RECOVERY),
            (!sensing.is_exact(), SENSING),
            (!network.is_exact(), NETWORK),
            (!actuation.is_exact(), ACTUATION),
            (!failures.is_exact(), FAILURES),
            (shield.is_some_and(|shield| shield.enabled), SHIELD),
        ]
        .into_iter()
        .filter_map(|(is_ignored, part)| is_ignored.then_some(part))
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::builtin;
    use super::super::{Override, Source};
    use super::*;

    fn ignored(name: &str, sets: &[&str]) -> Vec<&'static str> {
        let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect("an override")).collect();
        let source = Source::resolve(name).expect("a built-in scenario");
        let template = Template::read(&source, &overrides).expect("a scenario");
        template.parts_ignored_by_environments().iter().map(|part| part.key).collect()
    }

    #[test]
    fn each_built_in_scenario_has_its_ignored_parts() {
        let mut found: Vec<(&str, Vec<&str>)> =
            builtin::all().iter().map(|scenario| (scenario.name, ignored(scenario.name, &[]))).collect();
        found.sort_unstable();
        let slots = ["formation.assignment", "deadlock"];
        assert_eq!(
            found,
            [
                ("circle", vec![]),
                ("crazyflies", vec![]),
                ("gusts", slots.to_vec()),
                ("hexagon", vec![]),
                ("leader-lossy", vec!["reference", "reference.leader", "deadlock", "network"]),
                ("obstacles", vec!["leg", "formation.assignment", "deadlock"]),
                ("pentagon", vec![]),
                ("pentagon-collinear", vec![]),
                ("pentagon-laplacian", vec![]),
                ("pentagon-leader", vec!["reference.leader", "deadlock"]),
                ("shielded-crazyflies", vec!["network", "shield"]),
                ("show", vec!["leg", "formation.assignment", "deadlock"]),
                ("swap", vec!["deadlock"]),
                ("thousand", slots.to_vec()),
            ]
        );
    }

    #[test]
    fn a_part_is_ignored_by_itself_and_its_remedy_turns_it_off() {
        for (name, sets, key) in [
            ("pentagon", vec!["sensing.latency_s=0.1"], "sensing"),
            ("pentagon", vec!["sensing.position_noise_m=0.1", "sensing.rate_hz=100"], "sensing"),
            ("pentagon", vec!["network={rate_hz=50, latency_s=0.1}"], "network"),
            ("pentagon", vec!["actuation.lag_s=0.2"], "actuation"),
            ("pentagon", vec!["actuation.max_accel_m_s2=1"], "actuation"),
            ("pentagon", vec!["failure=[{kind=\"dead\", vehicle=1, at_s=1}]"], "failure"),
            ("hexagon", vec!["shield.enabled=true"], "shield"),
            ("pentagon", vec!["leg=[{shape=\"circle\", radius_m=5, start_s=3}]"], "leg"),
            ("pentagon", vec!["formation.assignment=optimal", "start.jitter_m=0.1"], "formation.assignment"),
            ("swap", vec![], "deadlock"),
            ("swap", vec!["deadlock.mode=start"], "deadlock"),
        ] {
            let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect("an override")).collect();
            let source = Source::resolve(name).expect("a built-in scenario");
            let read = |overrides: &[Override]| Template::read(&source, overrides).expect("a scenario");
            let parts = read(&overrides).parts_ignored_by_environments();
            assert_eq!(parts.iter().map(|part| part.key).collect::<Vec<_>>(), [key], "{sets:?}");
            let (key, value) = parts[0].off.expect("a remedy");
            let off = Override::parse(&format!("{key}={value}")).expect("an override");
            let more: Vec<_> = overrides.into_iter().chain([off]).collect();
            assert_eq!(read(&more).parts_ignored_by_environments(), [], "{sets:?}");
        }
        // A reference moves the slots, unless it rests at the origin.
        for (motion, expected) in [
            ("kind=\"rest\"", vec![]),
            ("kind=\"rest\", position_m=[1, 0]", vec!["reference"]),
            ("kind=\"velocity\", velocity_m_s=[1, 0]", vec!["reference"]),
            ("kind=\"circle\", radius_m=1, period_s=9", vec!["reference"]),
        ] {
            let reference = format!("reference={{{motion}}}");
            assert_eq!(ignored("swap", &["deadlock.mode=off", &reference]), expected, "{motion}");
        }
        assert_eq!(ignored("pentagon-leader", &["deadlock.mode=off"]), ["reference.leader"]);
        // An assignment to a fixed start is fixed.
        assert_eq!(ignored("pentagon", &["formation.assignment=optimal"]), [""; 0]);
        assert_eq!(ignored("swap", &["formation.assignment=when-stalled"]), ["formation.assignment", "deadlock"]);
    }
}
