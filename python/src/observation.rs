//! Observations of laws in Python.

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods as _};
use pyo3::prelude::*;
use tautline::observation::{self, NeighbourState, OtherStates};

use crate::numbers::{cube, table, vectors};

/// Observation of a law at an instant. The arrays are copies, which the law may keep.
#[pyclass(frozen, get_all, module = "tautline")]
pub(crate) struct Observation {
    /// Time of the flight [s].
    t: f64,
    /// (N, 3) positions [m]; row i is the own position that vehicle i measures.
    positions: Py<PyArray2<f64>>,
    /// (N, 3) velocities [m/s].
    velocities: Py<PyArray2<f64>>,
    /// (N, 3) slots of the leg [m], moved with the reference.
    slots_m: Py<PyArray2<f64>>,
    /// Number of the leg, from 0.
    leg: usize,
    /// (3,) velocity of the reference [m/s].
    reference_velocity_m_s: (f64, f64, f64),
    /// (3,) acceleration of the reference [m/s^2].
    reference_acceleration_m_s2: (f64, f64, f64),
    /// (K, 2) pairs i < j, from 0, within the sensing range of the law; empty without a range.
    near: Py<PyArray2<i64>>,
    /// Whether every vehicle knows all `positions` and `velocities`; the arrays below are then None.
    shared: bool,
    /// (N, N, 3) positions [m]; `[i, j]` is the last position of vehicle j that vehicle i received.
    received_positions: Option<Py<PyArray3<f64>>>,
    /// (N, N, 3) velocities [m/s], with the same indices.
    received_velocities: Option<Py<PyArray3<f64>>>,
    /// (N, N) ages of these positions and velocities [s].
    received_ages_s: Option<Py<PyArray2<f64>>>,
    /// (N, N, 3) positions [m] of vehicle j from a sensor of vehicle i; None without a sensing range.
    sensed_positions: Option<Py<PyArray3<f64>>>,
    /// (N, N, 3) velocities [m/s], with the same indices.
    sensed_velocities: Option<Py<PyArray3<f64>>>,
}

impl Observation {
    pub(crate) fn new(py: Python<'_>, at: &observation::Observation<'_>, sees: bool) -> PyResult<Self> {
        let (target, r) = (&at.target, at.target.reference.position_m);
        let slots_m = &target.formation.slots_m;
        let carried = (0..slots_m.nrows()).flat_map(|i| (0..3).map(move |axis| slots_m[(i, axis)] + r[axis]));
        let (v, a) = (target.reference.velocity_m_s, target.reference.acceleration_m_s2);
        let pairs = at.near.iter().flat_map(|&(i, j)| [i64::try_from(i), i64::try_from(j)]);
        let near = PyArray1::from_vec(py, pairs.map(|index| index.unwrap_or(i64::MAX)).collect());
        let shared = matches!(at.others, OtherStates::Shared);
        let received = (!shared).then(|| NeighbourTables::of(py, at, |i, j| at.received(i, j))).transpose()?;
        let sensed = (!shared && sees).then(|| NeighbourTables::of(py, at, |i, j| at.sensed(i, j))).transpose()?;
        let (received_positions, received_velocities, received_ages_s) = NeighbourTables::split(received);
        let (sensed_positions, sensed_velocities, _) = NeighbourTables::split(sensed);
        Ok(Self {
            t: at.time_s,
            positions: table(py, &at.own.positions_m)?.unbind(),
            velocities: table(py, &at.own.velocities_m_s)?.unbind(),
            slots_m: vectors(py, carried.collect())?.unbind(),
            leg: target.leg,
            reference_velocity_m_s: (v.x, v.y, v.z),
            reference_acceleration_m_s2: (a.x, a.y, a.z),
            near: near.reshape([at.near.len(), 2])?.unbind(),
            shared,
            received_positions,
            received_velocities,
            received_ages_s,
            sensed_positions,
            sensed_velocities,
        })
    }
}

/// Knowledge of each vehicle about each other vehicle.
struct NeighbourTables {
    positions: Py<PyArray3<f64>>,
    velocities: Py<PyArray3<f64>>,
    ages_s: Py<PyArray2<f64>>,
}

type SplitTables = (Option<Py<PyArray3<f64>>>, Option<Py<PyArray3<f64>>>, Option<Py<PyArray2<f64>>>);

impl NeighbourTables {
    fn of(
        py: Python<'_>,
        at: &observation::Observation<'_>,
        known: impl Fn(usize, usize) -> NeighbourState,
    ) -> PyResult<Self> {
        let count = at.own.count();
        let pairs = || (0..count).flat_map(|i| (0..count).map(move |j| (i, j)));
        let (mut positions, mut velocities, mut ages_s) = (Vec::new(), Vec::new(), Vec::new());
        for (i, j) in pairs() {
            let NeighbourState { position_m: p, velocity_m_s: v, age_s } =
                if i == j { own(at, i) } else { known(i, j) };
            positions.extend([p.x, p.y, p.z]);
            velocities.extend([v.x, v.y, v.z]);
            ages_s.push(age_s);
        }
        Ok(Self {
            positions: cube(py, positions, [count, count, 3])?.unbind(),
            velocities: cube(py, velocities, [count, count, 3])?.unbind(),
            ages_s: PyArray1::from_vec(py, ages_s).reshape([count, count])?.unbind(),
        })
    }

    fn split(tables: Option<Self>) -> SplitTables {
        match tables {
            Some(Self { positions, velocities, ages_s }) => (Some(positions), Some(velocities), Some(ages_s)),
            None => (None, None, None),
        }
    }
}

/// Returns the own state of a vehicle.
fn own(at: &observation::Observation<'_>, i: usize) -> NeighbourState {
    let row = tautline::swarm::row;
    NeighbourState { position_m: row(&at.own.positions_m, i), velocity_m_s: row(&at.own.velocities_m_s, i), age_s: 0.0 }
}
