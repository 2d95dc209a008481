//! Equilibria of the edge-tension law, from many starts (finding F3).

use nalgebra::Vector3;

use super::claim::{Claim, ClaimsResult, MeasureError, Progress, stated, try_each};
use super::flights::{continuous, end};
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_core::text::bound;
use tautline_laws::formation::{Formation, largest_edge_error_m};
use tautline_sim::continuous::Tolerances;
use tautline_sim::scenario::{Scenario, Space, offset, random, scatter};

/// Number of orderings of five vehicles on a line, without mirror images.
const ORDERINGS: u64 = 60;
/// Number of random starts of the 12-gon.
const POLYGON_STARTS: u64 = 40;
/// Number of flights, the units of work.
pub(super) const FLIGHTS: u64 = ORDERINGS + POLYGON_STARTS;
const SPACING_M: f64 = 3.0;
const NOISE_M: f64 = 0.05;
const SIDE_M: f64 = 3.0;
const DELTA_M: f64 = 2.0;
const POLYGON_COUNT: usize = 12;
const POLYGON_RADIUS_M: f64 = 3.0;
const POLYGON_DELTA_M: f64 = 1.0;
const POLYGON_HALF_EXTENT_M: f64 = 6.0;
const POLYGON_SPACING_M: f64 = 1.1;
const SEED: u64 = 3;
/// Duration of a flight to rest \[s\].
const ORDERING_S: f64 = 600.0;
/// Times at which the 12-gon is checked \[s\].
const POLYGON_TIMES_S: [f64; 4] = [60.0, 120.0, 300.0, 1000.0];
const POLYGON_NAMES: [&str; 4] = ["after_60_s", "after_120_s", "after_300_s", "after_1000_s"];
/// Largest edge error of a reached formation \[m\].
const REACHED_M: f64 = 0.01;
/// Largest pull on a vehicle at rest \[m/s^2\].
const REST_M_S2: f64 = 1e-9;
/// Coarse tolerances, which must give the same outcomes.
const COARSE: Tolerances = Tolerances { relative: 1e-10, absolute: 1e-10 };

/// State at rest at the end of a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Rest {
    edge_error_m: f64,
    /// Largest pull on a vehicle \[m/s^2\].
    pull_m_s2: f64,
}

impl Rest {
    fn reached(&self) -> bool {
        self.edge_error_m < REACHED_M
    }
}

/// Flies to the pentagon with a22 = 0, on which relative motion does not depend.
fn rest(start: Rows, tolerances: Tolerances, progress: &Progress<'_>) -> Result<Rest, MeasureError> {
    let formation = Formation::pentagon(SIDE_M);
    let scenario = Scenario::new("rest", Swarm::at_rest(start), formation, DELTA_M, ORDERING_S);
    let last = end(&scenario, tolerances, progress)?;
    let mut control = Rows::zeros(scenario.count());
    scenario.law()?.command(&scenario.observation(&last), &mut control)?;
    Ok(Rest {
        edge_error_m: largest_edge_error_m(&last.positions_m, scenario.formation(), &scenario.graph),
        pull_m_s2: (0..scenario.count()).map(|i| row(&control, i).norm()).fold(0.0, f64::max),
    })
}

/// Returns all orders of the vehicles 0 to 4, one of each pair of mirror images.
fn orderings() -> Vec<[usize; 5]> {
    let codes = (0..5_usize.pow(5)).map(|code| [4, 3, 2, 1, 0].map(|place| code / 5_usize.pow(place) % 5));
    codes.filter(|order| (0..5).all(|vehicle| order.contains(&vehicle)) && order[0] < order[4]).collect()
}

/// Returns a line along x in this order with transverse noise.
fn line(order: [usize; 5], stream: u64) -> Rows {
    let mut random = random(SEED);
    random.set_stream(stream);
    let mut positions_m = Rows::zeros(order.len());
    for (place, &vehicle) in order.iter().enumerate() {
        let noise_m = offset(NOISE_M, Space::Plane, &mut random).y;
        set_row(&mut positions_m, vehicle, Vector3::new(SPACING_M * place as f64, noise_m, 0.0));
    }
    positions_m
}

pub(super) fn judge(progress: &Progress<'_>) -> ClaimsResult {
    let (orderings, polygon) = rayon::join(|| pentagon_orderings(progress), || polygon(progress));
    Ok(vec![orderings?, polygon?])
}

fn pentagon_orderings(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let orderings = orderings();
    let places: Vec<usize> = (0..orderings.len()).collect();
    let rests = try_each(&places, progress, |&place| {
        let start = line(orderings[place], place as u64);
        Ok((rest(start.clone(), Tolerances::default(), progress)?, rest(start, COARSE, progress)?))
    })?;
    let reached = rests.iter().filter(|(rest, _)| rest.reached()).count();
    let elsewhere: Vec<&Rest> = rests.iter().map(|(rest, _)| rest).filter(|rest| !rest.reached()).collect();
    let pull_m_s2 = elsewhere.iter().map(|rest| rest.pull_m_s2).fold(0.0, f64::max);
    let least_m = elsewhere.iter().map(|rest| rest.edge_error_m).fold(f64::INFINITY, f64::min);
    let most_m = elsewhere.iter().map(|rest| rest.edge_error_m).fold(0.0, f64::max);
    let changed = rests.iter().filter(|(fine, coarse)| fine.reached() != coarse.reached()).count();
    let in_order_m = rests.first().map_or(f64::NAN, |(rest, _)| rest.edge_error_m);
    let words = format!(
        "{reached} of {} orderings of five vehicles near a line ({SPACING_M} m apart, up to {NOISE_M} m off) reach the \
         pentagon. The other {} come to rest with pulls {} m/s^2 and edge errors of {least_m:.2} to {most_m:.2} m. \
         Ordering 1-2-3-4-5: {in_order_m:.2} m. {changed} outcomes change with 100 times the solver tolerance",
        orderings.len(),
        elsewhere.len(),
        bound(pull_m_s2, REST_M_S2)
    );
    let values = [
        ("orderings", orderings.len() as f64),
        ("reached", reached as f64),
        ("largest_pull_elsewhere_m_s2", pull_m_s2),
        ("least_edge_error_elsewhere_m", least_m),
        ("most_edge_error_elsewhere_m", most_m),
        ("edge_error_in_order_m", in_order_m),
        ("outcomes_changed", changed as f64),
    ];
    let rest_elsewhere = !elsewhere.is_empty() && pull_m_s2 < REST_M_S2 && least_m > 10.0 * REACHED_M;
    let pass = orderings.len() as u64 == ORDERINGS && reached > 0 && rest_elsewhere && changed == 0;
    Ok(stated("pentagon-orderings")?.measured(words, values).pass(pass))
}

/// Measures how many flights have reached the 12-gon at each time.
fn polygon(progress: &Progress<'_>) -> Result<Claim, MeasureError> {
    let formation = Formation::circle(POLYGON_COUNT, POLYGON_RADIUS_M);
    let fly = |stream: u64| {
        let mut random = random(SEED + 1);
        random.set_stream(stream);
        let (space, extent_m, spacing_m) = (Space::Plane, POLYGON_HALF_EXTENT_M, POLYGON_SPACING_M);
        let start = scatter(POLYGON_COUNT, space, extent_m, spacing_m, &mut random)?;
        let scenario = Scenario::new("polygon", Swarm::at_rest(start), formation.clone(), POLYGON_DELTA_M, 1.0);
        let states = continuous(&scenario, &POLYGON_TIMES_S, COARSE, progress)?.states;
        let error_m = |state: &Swarm| largest_edge_error_m(&state.positions_m, &formation, &scenario.graph);
        Ok(states.iter().map(|state| error_m(state) < REACHED_M).collect::<Vec<_>>())
    };
    let streams: Vec<u64> = (0..POLYGON_STARTS).collect();
    let flights = try_each(&streams, progress, |&stream| fly(stream))?;
    let reached_by = |k: usize| flights.iter().filter(|flight| flight.get(k) == Some(&true)).count() as u64;
    let reached = [0, 1, 2, 3].map(reached_by);
    let list = POLYGON_TIMES_S.iter().zip(reached).map(|(time_s, reached)| format!("{reached} after {time_s} s"));
    let words = format!(
        "of {POLYGON_STARTS} starts (radius {POLYGON_RADIUS_M} m, delta {POLYGON_DELTA_M} m): {}",
        list.collect::<Vec<_>>().join(", ")
    );
    let pass = reached[0] * 10 <= POLYGON_STARTS && reached[3] * 10 >= 9 * POLYGON_STARTS;
    let values = POLYGON_NAMES.into_iter().zip(reached.map(|n| n as f64));
    Ok(stated("polygon-random-starts")?.measured(words, values).pass(pass))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_60_orderings_up_to_mirror_images() {
        let orderings = orderings();
        assert_eq!(orderings.len() as u64, ORDERINGS);
        assert_eq!(orderings[0], [0, 1, 2, 3, 4]);
        for order in &orderings {
            let mut mirrored = *order;
            mirrored.reverse();
            assert!(!orderings.contains(&mirrored));
        }
    }
}
