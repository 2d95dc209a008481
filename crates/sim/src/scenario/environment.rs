//! Parts of a scenario that a learning environment ignores.
//!
//! A policy is a law: its commands pass through the shield and the actuators, and it observes what the vehicles know.
//! An environment replaces the law, its graph of control and its rate, and reports the present slots of all vehicles.

use super::spec::Scenario;

/// Part of a scenario that a learning environment ignores.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IgnoredPart {
    /// Key of the part.
    pub key: &'static str,
    /// Reason why the environment ignores the part.
    pub what: &'static str,
}

/// The reference that only a leader knows: slots tell it to all vehicles.
const LEADER: IgnoredPart = IgnoredPart { key: "reference.leader", what: "the other vehicles follow the leader" };

impl Scenario {
    /// Returns the part of the scenario that a learning environment ignores.
    #[must_use]
    pub fn part_ignored_by_environments(&self) -> Option<IgnoredPart> {
        let is_led = self.reference.as_ref().is_some_and(|guidance| guidance.known_by.leader().is_some());
        is_led.then_some(LEADER)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Source;
    use super::super::builtin;
    use super::*;

    #[test]
    fn environments_fly_all_built_in_scenarios_without_a_leader() {
        let ignored = |name: &str| {
            let source = Source::resolve(name).expect("a built-in scenario");
            Scenario::read(&source, &[]).expect("a scenario").part_ignored_by_environments()
        };
        for scenario in builtin::all() {
            let is_led = ["leader-lossy", "pentagon-leader"].contains(&scenario.name);
            assert_eq!(ignored(scenario.name), is_led.then_some(LEADER), "{}", scenario.name);
        }
    }
}
