//! Maps the true state to accelerations: sense, supervise, command, actuate.

use std::sync::{Arc, Mutex};

use super::ending::SimError;
use crate::link::Imperfections;
use crate::plant::Feedback;
use crate::scenario::Scenario;
use crate::shield::ShieldStage;
use tautline_core::obstacle::Obstacle;
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::graph::Graph;
use tautline_laws::law::{Certificate, Law, LawError, certificate_through};
use tautline_laws::observation::{Observation, OtherStates};
use tautline_laws::space::{Metric, VerletList};
use tautline_laws::target::{Change, CurrentTarget, Guidance, Supervisor};
use tautline_shield::ContractLog;

/// Control loop between the true state and the actuators, with all of its memory.
#[derive(Clone)]
pub(super) struct Controller {
    pub(super) law: Box<dyn Law>,
    pub(super) link: Box<dyn Imperfections>,
    pub(super) supervisor: Box<dyn Supervisor>,
    pub(super) target: CurrentTarget,
    guidance: Option<Guidance>,
    pub(super) links: Graph,
    pub(super) obstacles: Vec<Obstacle>,
    /// Metric of separations.
    metric: Metric,
    near: VerletList,
    pub(super) shield: Option<ShieldStage>,
    /// Whether the shield has no command at the present instant of command yet.
    pub(super) awaits_command: bool,
    /// Whether the next command begins at its instant: commands of the law and from outside do not continue each other.
    pub(super) begins: bool,
    /// Last command of the law or from outside, as the shield changed it, N x 3 \[m/s^2\].
    commanded: Rows,
}

impl Controller {
    pub(super) fn new(
        scenario: &Scenario,
        law: Box<dyn Law>,
        link: Box<dyn Imperfections>,
        supervisor: Box<dyn Supervisor>,
    ) -> Result<Self, SimError> {
        let target = CurrentTarget::first_of(&scenario.legs).ok_or(SimError::NoLeg)?;
        let (guidance, links) = (scenario.reference.clone(), scenario.graph.clone());
        let (obstacles, near) = (scenario.obstacles.clone(), VerletList::default());
        let commanded = Rows::zeros(scenario.count());
        let metric = scenario.metric();
        let shield = ShieldStage::of(scenario)?;
        Ok(Self {
            law,
            link,
            supervisor,
            target,
            guidance,
            links,
            obstacles,
            metric,
            near,
            shield,
            awaits_command: false,
            begins: false,
            commanded,
        })
    }

    /// Returns this controller, whose shield writes a log of its contracts if there is one.
    pub(super) fn with_contract_log(mut self, log: Option<Arc<Mutex<ContractLog>>>) -> Self {
        if let (Some(shield), Some(log)) = (&mut self.shield, log) {
            shield.begin_log(log);
        }
        self
    }

    /// Senses at an instant of the flight, lets the supervisor change the target, and writes the law's command if
    /// `command` is given.
    pub(super) fn act(&mut self, time_s: f64, truth: &Swarm, command: Option<&mut Rows>) -> Result<(), LawError> {
        self.respond(time_s, truth, true, command)
    }

    fn respond(
        &mut self,
        time_s: f64,
        truth: &Swarm,
        supervised: bool,
        command: Option<&mut Rows>,
    ) -> Result<(), LawError> {
        if let Some(guidance) = &self.guidance {
            self.target.set_reference(guidance.motion.at(time_s));
        }
        let sensed = self.link.sense(time_s, truth);
        if supervised && !self.supervisor.is_idle() {
            self.supervisor.supervise(time_s, sensed.own, &mut self.target);
            self.law.follow(&self.target.view())?;
        }
        let Some(command) = command else { return Ok(()) };
        if let Some(range_m) = self.law.capabilities().sensing_range_m {
            let from = match sensed.others {
                OtherStates::Shared => None,
                OtherStates::PerVehicle(picture) => picture.near_search_positions(),
            };
            let (positions_m, slack_m) = from.unwrap_or((&sensed.own.positions_m, 0.0));
            self.near.update(positions_m, range_m + slack_m);
        }
        let observation = Observation {
            time_s,
            own: sensed.own,
            others: sensed.others,
            target: self.target.view(),
            links: &self.links,
            near: self.near.pairs(),
            obstacles: &self.obstacles,
        };
        let mut commanded = self.law.command(&observation, &mut self.commanded);
        if let Some(shield) = &mut self.shield {
            shield.note_undefined(std::mem::replace(&mut commanded, Ok(())), &mut self.commanded);
            shield.filter(time_s, truth, sensed.own, &mut self.commanded);
        }
        commanded.map_err(|error| error.with_true_distance(truth, self.metric, &self.obstacles))?;
        self.actuate(time_s, command);
        Ok(())
    }

    /// Takes accelerations from outside as the command of this instant, after the shield, and writes those that reach
    /// the vehicles.
    pub(super) fn filter(&mut self, time_s: f64, truth: &Swarm, given: &Rows, command: &mut Rows) {
        self.commanded.copy_from(given);
        self.begins = true;
        let own = self.link.sense(time_s, truth).own;
        if let Some(shield) = &mut self.shield {
            shield.filter(time_s, truth, own, &mut self.commanded);
        }
        self.actuate(time_s, command);
    }

    /// Returns what the vehicles know at an instant, without the pairs in sensing range.
    pub(super) fn observation<'a>(&'a mut self, time_s: f64, truth: &'a Swarm) -> Observation<'a> {
        let sensed = self.link.sense(time_s, truth);
        let (own, others, target) = (sensed.own, sensed.others, self.target.view());
        Observation { time_s, own, others, target, links: &self.links, near: &[], obstacles: &self.obstacles }
    }

    /// Writes the accelerations at a time \[s\] that result from the last command.
    pub(super) fn actuate(&mut self, time_s: f64, command: &mut Rows) {
        command.copy_from(&self.commanded);
        if std::mem::take(&mut self.begins) {
            self.link.actuate_anew(time_s, command);
        } else {
            self.link.actuate(time_s, command);
        }
    }

    /// Returns the supervisor's last change within a leg, and the new certificate from this true state.
    pub(super) fn change(&mut self, time_s: f64, truth: &Swarm) -> Option<(Change, Certificate)> {
        let change = self.supervisor.take_change()?;
        let target = self.target.view();
        let exact = Observation::exact(truth, &self.links, target.formation);
        let mut ahead = self.supervisor.later_formations(&target);
        if matches!(change, Change::Assigned { .. }) {
            // The slots of the leg follow after the spread ones.
            ahead.insert(0, target.formation);
        }
        let start = Observation { time_s, target, obstacles: &self.obstacles, ..exact };
        Some((change, certificate_through(self.law.as_ref(), &start, &ahead)))
    }

    /// Restarts all random numbers.
    pub(super) fn reseed(&mut self, seed: u64) {
        self.law.reseed(seed);
        self.link.reseed(seed);
        self.supervisor.reseed(seed);
        if let Some(shield) = &mut self.shield {
            shield.reseed(seed);
        }
    }

    /// Returns the law's energy of a true state, for the current target.
    pub(super) fn energy(&self, time_s: f64, truth: &Swarm) -> Option<f64> {
        let exact = Observation::exact(truth, &self.links, self.target.view().formation);
        let (target, obstacles) = (self.target.view(), self.obstacles.as_slice());
        self.law.energy(&Observation { time_s, target, obstacles, ..exact })
    }
}

impl Feedback for Controller {
    fn command(&mut self, time_s: f64, truth: &Swarm, command: &mut Rows) -> Result<(), LawError> {
        self.respond(time_s, truth, false, Some(command))
    }

    fn accept(&mut self, time_s: f64, truth: &Swarm) {
        self.link.accept(time_s, truth);
    }

    fn longest_step_s(&self) -> f64 {
        self.link.longest_step_s()
    }
}
