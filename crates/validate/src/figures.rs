//! The paper's figures from our own flights, and the convergence's.

use super::convergence::Refinement;
use super::detectors::{Flights, Flown};
use super::interface::Untried;
use super::tension;
use tautline_report::figures::{self, Figure, Step};

/// Figs. 1, 2 (a to c), 3 (a to c) and 4, and the convergence.
pub(super) fn draw(flights: &Flights, convergence: &[Refinement]) -> Result<Vec<Figure>, Untried> {
    let steps: Vec<Step> = convergence.iter().map(|&Refinement { dt_s, error_m, .. }| Step { dt_s, error_m }).collect();
    let mut drawn = vec![named("figure-1", figures::tension_curve(&tension::of_figure_1()?, "Fig. 1: edge tension"))];
    drawn.extend(of_flight(&flights.pentagon, ["figure-2a", "figure-2b", "figure-2c"], "Fig. 2", "pentagon"));
    drawn.extend(of_flight(&flights.circle, ["figure-3a", "figure-3b", "figure-3c"], "Fig. 3", "circle"));
    let baseline = &flights.baseline;
    let distances = figures::distances(&baseline.log, baseline.delta_m, None, "Fig. 4: pentagon without avoidance");
    drawn.push(named("figure-4", distances));
    drawn.push(figures::convergence(&steps, "Rapier against continuous time"));
    Ok(drawn)
}

/// Paths, control effort and distances.
fn of_flight(flown: &Flown, names: [&str; 3], number: &str, flight: &str) -> [Figure; 3] {
    let [a, b, c] = names;
    let (log, certified_m) = (&flown.log, flown.flight.certificate.certified_m);
    [
        named(a, figures::paths(log, &format!("{number}(a): {flight}, paths"))),
        named(b, figures::control(log, &format!("{number}(b): {flight}, control effort"))),
        named(c, figures::distances(log, flown.delta_m, certified_m, &format!("{number}(c): {flight}, distances"))),
    ]
}

fn named(name: &str, figure: Figure) -> Figure {
    Figure { name: name.to_owned(), ..figure }
}
