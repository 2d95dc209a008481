//! Positions of an approved plan over time.

use nalgebra::Vector3;

use tautline_core::track::{Item, Piece, Tracks};

/// Largest number of samples and pieces of a plan.
pub(crate) const MOST_ITEMS: usize = 20_000_000;

/// Plan of all vehicles; the default is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// Vehicles in order of their names.
    vehicles: Vec<(String, Vec<Item>)>,
    /// Time of the monitor at which the plan has its time 0 \[s\].
    start_s: f64,
}

impl Plan {
    /// Reads a plan. `start_s` is the time of the monitor at which the plan has its time 0 \[s\].
    ///
    /// # Errors
    /// The error of the recording; `None` for more than 20 million items.
    pub fn read<E>(tracks: &mut dyn Tracks<Error = E>, start_s: f64) -> Result<Option<Self>, E> {
        let (mut batch, mut count) = (Vec::new(), 0);
        let mut vehicles: Vec<Vec<Item>> = Vec::new();
        let mut is_over = false;
        while !is_over {
            // The last call may append items, too.
            is_over = !tracks.read(&mut batch)?;
            count += batch.len();
            if count > MOST_ITEMS {
                return Ok(None);
            }
            for item in batch.drain(..) {
                let k = item.vehicle();
                if vehicles.len() <= k {
                    vehicles.resize(k + 1, Vec::new());
                }
                vehicles[k].push(item);
            }
        }
        let mut vehicles: Vec<_> = tracks.vehicles().iter().cloned().zip(vehicles).collect();
        vehicles.sort_by(|a, b| a.0.cmp(&b.0));
        Ok(Some(Self { vehicles, start_s }))
    }

    /// Returns the names of the vehicles in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.vehicles.iter().map(|(name, _)| name.as_str())
    }

    /// Returns the index of a vehicle.
    #[must_use]
    pub fn find(&self, name: &str) -> Option<usize> {
        self.vehicles.binary_search_by(|(own, _)| own.as_str().cmp(name)).ok()
    }

    /// Returns the planned position at a time of the monitor \[m\]; `None` outside of the plan.
    #[must_use]
    pub fn position_m(&self, vehicle: usize, time_s: f64) -> Option<Vector3<f64>> {
        let t_s = time_s - self.start_s;
        let items = &self.vehicles.get(vehicle)?.1;
        let k = items.partition_point(|item| item.time_s() <= t_s).checked_sub(1)?;
        match (&items[k], items.get(k + 1)) {
            (Item::Piece(piece), _) => (t_s <= piece.to_s).then(|| place(piece, t_s)),
            (Item::Sample(from), Some(Item::Sample(to))) => {
                let share = (t_s - from.time_s) / (to.time_s - from.time_s);
                Some(from.position_m + (to.position_m - from.position_m) * share)
            }
            (Item::Sample(last), _) => (t_s == last.time_s).then_some(last.position_m),
        }
    }
}

fn place(piece: &Piece, t_s: f64) -> Vector3<f64> {
    let since_s = t_s - piece.from_s;
    piece.coefficients.iter().rev().fold(Vector3::zeros(), |sum, coefficient| sum * since_s + coefficient)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::Plan;
    use tautline_core::track::{Item, Piece, Sample};

    #[test]
    fn a_plan_has_positions_between_its_samples_and_on_its_curves_only() {
        let sample = |time_s, x| {
            let position_m = Vector3::new(x, 0.0, 0.0);
            Item::Sample(Sample { vehicle: 0, time_s, position_m, velocity_m_s: None, radius_m: None })
        };
        let coefficients = vec![Vector3::zeros(), Vector3::zeros(), Vector3::x()];
        let piece = Item::Piece(Piece { vehicle: 1, from_s: 1.0, to_s: 3.0, coefficients });
        let vehicles = vec![("a".into(), vec![sample(0.0, 0.0), sample(2.0, 4.0)]), ("b".into(), vec![piece])];
        let plan = Plan { vehicles, start_s: 10.0 };
        let x = |name, time_s| plan.position_m(plan.find(name).expect(name), time_s).map(|at| at.x);
        assert_eq!([x("a", 9.9), x("a", 10.5), x("a", 12.0), x("a", 12.1)], [None, Some(1.0), Some(4.0), None]);
        assert_eq!([x("b", 10.9), x("b", 13.0), x("b", 13.1)], [None, Some(4.0), None]);
        assert_eq!(plan.find("c"), None);
    }
}
