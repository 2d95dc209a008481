//! What a flight is made of beside its scenario.

use super::ending::SimError;
use crate::link::{self, Imperfections};
use crate::plant::{self, Plant};
use crate::scenario::Scenario;
use tautline_laws::law::Law;
use tautline_laws::target::{Schedule, Supervisor};

/// What a flight is made of beside its scenario.
pub struct Parts {
    /// The control law.
    pub law: Box<dyn Law>,
    /// What moves the vehicles.
    pub plant: Box<dyn Plant>,
    /// What lies between truth and law.
    pub link: Box<dyn Imperfections>,
    /// Who changes the target.
    pub supervisor: Box<dyn Supervisor>,
}

impl Parts {
    /// What the scenario asks for.
    ///
    /// # Errors
    /// [`SimError::Law`] where its law does not exist, which a validated scenario rules out but for memory.
    pub fn of(scenario: &Scenario) -> Result<Self, SimError> {
        Ok(Self::under(scenario, scenario.law()?))
    }

    /// What the scenario asks for, under another law.
    #[must_use]
    pub fn under(scenario: &Scenario, law: Box<dyn Law>) -> Self {
        let link = link::of(scenario, law.capabilities().sensing_range_m.is_some());
        let supervisor = Schedule::new(&scenario.legs, &scenario.graph, scenario.arrival)
            .free_by(law.capabilities().controls.freedom());
        let supervisor = match law.capabilities().settling {
            Some(settling) => {
                let leader = scenario.reference.as_ref().and_then(|guidance| guidance.known_by.leader());
                supervisor.breathing(scenario.breathing, settling, leader).blown(!scenario.wind.is_still())
            }
            None => supervisor,
        };
        Self { law, plant: plant::of(scenario), link, supervisor: Box::new(supervisor) }
    }
}
