//! Accelerations that a law commands at the start of each leg.

use crate::scenario::Scenario;
use crate::vehicle::GRAVITY_M_S2;
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_core::text::metres;
use tautline_laws::law::Law;
use tautline_laws::observation::Observation;
use tautline_laws::space::CellList;
use tautline_laws::target::{CurrentTarget, Reference};

/// Largest acceleration that is not reported \[multiples of gravity\]. Agile racing multirotors reach about 5 g.
const CREDIBLE_G: f64 = 5.0;

/// Returns the largest acceleration \[m/s^2\] that the law commands at the start of any leg. Each leg after the first
/// starts at rest on the slots of the leg before, at the reference's place at time 0. Returns `None` if the law is
/// undefined there.
pub(super) fn start_peak_m_s2(scenario: &Scenario, law: &mut dyn Law) -> Option<f64> {
    let mut target = CurrentTarget::first_of(&scenario.legs)?;
    let reference = scenario.reference_at(0.0);
    target.set_reference(reference);
    let mut swarm = scenario.start.clone();
    let (mut near, mut command) = (CellList::default(), Rows::zeros(scenario.count()));
    let mut peak_m_s2 = 0.0_f64;
    for (leg, of_leg) in scenario.legs.iter().enumerate() {
        if leg > 0 {
            swarm = on_slots(&scenario.legs[leg - 1].formation.slots_m, &reference);
            target.begin(leg, &of_leg.formation);
            law.follow(&target.view()).ok()?;
        }
        if let Some(range_m) = law.capabilities().sensing_range_m {
            near.update(&swarm.positions_m, range_m);
        }
        let observation = Observation {
            target: target.view(),
            near: near.pairs(),
            obstacles: &scenario.obstacles,
            ..Observation::exact(&swarm, &scenario.graph, &of_leg.formation)
        };
        law.command(&observation, &mut command).ok()?;
        peak_m_s2 = (0..command.nrows()).map(|i| row(&command, i).norm()).fold(peak_m_s2, f64::max);
    }
    let peak_m_s2 = scenario.actuation.max_accel_m_s2.map_or(peak_m_s2, |most_m_s2| peak_m_s2.min(most_m_s2));
    peak_m_s2.is_finite().then_some(peak_m_s2)
}

/// Returns vehicles on slots that move with the reference.
fn on_slots(slots_m: &Rows, reference: &Reference) -> Swarm {
    let mut swarm = Swarm::at_rest(slots_m.clone());
    for i in 0..swarm.count() {
        set_row(&mut swarm.positions_m, i, row(slots_m, i) + reference.position_m);
        set_row(&mut swarm.velocities_m_s, i, reference.velocity_m_s);
    }
    swarm
}

/// Returns a warning if few vehicles reach this acceleration \[m/s^2\].
pub(super) fn extreme_acceleration(peak_m_s2: f64) -> Option<String> {
    let peak_g = peak_m_s2 / GRAVITY_M_S2;
    (peak_g > CREDIBLE_G).then(|| {
        format!(
            "At the start of a leg the law commands {} m/s^2, {peak_g:.1} times gravity. Few vehicles reach more than \
             {CREDIBLE_G} times gravity. Reduce the law's gains or the distance between start and slots, or set \
             actuation.max_accel_m_s2.",
            metres(peak_m_s2)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preflight::{Code, Preflight};
    use crate::scenario::{Override, Source};

    fn check(name: &str, sets: &[&str]) -> Preflight {
        let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect("a key and a value")).collect();
        let scenario = Scenario::read(&Source::Builtin(name.to_owned()), &overrides).expect("a scenario");
        Preflight::of(&scenario).expect("a law")
    }

    #[test]
    fn the_peak_at_the_start_is_the_largest_command() {
        // The command of vehicle 1 at the start of the pentagon is (0.860843, -0.021226) m/s^2.
        let peak_m_s2 = check("pentagon", &[]).start_peak_m_s2.expect("a command");
        assert!((peak_m_s2 - 0.860_843_f64.hypot(0.021_226)).abs() < 1e-5, "{peak_m_s2}");
        assert!(check("pentagon", &[]).text().contains("control      0.861 m/s^2 at the start\n"));
        assert_eq!(check("pentagon", &["actuation.max_accel_m_s2=0.5"]).start_peak_m_s2, Some(0.5));
    }

    #[test]
    fn extreme_accelerations_of_any_leg_are_a_warning() {
        let has_warning =
            |found: &Preflight| found.warnings.iter().any(|warning| warning.code == Code::ExtremeAcceleration);
        let stiff = check("show", &["law.k_per_s2=1"]);
        assert!(has_warning(&stiff) && !stiff.refuses(), "{:?}", stiff.warnings);
        assert!(!has_warning(&check("show", &["law.k_per_s2=1", "actuation.max_accel_m_s2=40"])));
        let near = check("pentagon-laplacian", &[]);
        assert!(!has_warning(&near), "{:?}", near.warnings);
        assert!(has_warning(&check("pentagon-laplacian", &["law.f1_per_s2=20"])));
    }
}
