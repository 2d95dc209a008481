//! Recordings as columns.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use tautline::read::ReadError;
use tautline::request::{Failure, audit};
use tautline::track::{Item, Piece, Sample};

use crate::errors::{IntoException as _, wrong_input};
use crate::numbers::{cube, vectors};
use crate::request::ReadOptions;
use crate::work::run_in_thread;

/// A recording in memory: M samples and K pieces of curves, both in order of time.
#[pyclass(frozen, get_all, module = "tautline._native")]
pub(crate) struct Columns {
    vehicles: Vec<String>,
    notes: Vec<String>,
    /// Whether the height of a vehicle is unknown; z is then 0 and has no meaning.
    planar: bool,
    unit: String,
    epoch_ns: i64,
    /// (M,) vehicle, from 0.
    vehicle: Py<PyArray1<i64>>,
    /// (M,) time [s].
    t: Py<PyArray1<f64>>,
    /// (M, 3) position [m].
    position: Py<PyArray2<f64>>,
    /// (M, 3) velocity [m/s]; NaN where unknown.
    velocity: Py<PyArray2<f64>>,
    /// (M,) radius [m]; NaN where unknown.
    radius: Py<PyArray1<f64>>,
    /// (K,) vehicle of the piece, from 0.
    piece_vehicle: Py<PyArray1<i64>>,
    /// (K, 2) begin and end of the piece [s].
    piece_span: Py<PyArray2<f64>>,
    /// (K, D, 3) coefficients [m/s^k] of the polynomial in the time since the begin of the piece.
    piece_coefficients: Py<PyArray3<f64>>,
}

/// Items and metadata of a recording.
#[derive(Default)]
struct Read {
    vehicles: Vec<String>,
    notes: Vec<String>,
    planar: bool,
    unit: String,
    epoch_ns: i64,
    samples: Vec<Sample>,
    pieces: Vec<Piece>,
}

/// Reads a recording, in one file or in a file for each vehicle.
#[pyfunction]
pub(crate) fn read(py: Python<'_>, paths: Vec<PathBuf>, options: &ReadOptions) -> PyResult<Columns> {
    let interrupted = Arc::default();
    run_in_thread(py, &interrupted, || all(&paths, &options.0, &interrupted))??.columns(py)
}

fn all(paths: &[PathBuf], options: &tautline::read::ReadOptions, interrupted: &AtomicBool) -> PyResult<Read> {
    let failed = |error: ReadError| Failure::from(error).into_exception();
    let mut recording = audit::open(paths, options).map_err(failed)?;
    let (mut read, mut items) = (Read::default(), Vec::new());
    while recording.read(&mut items).map_err(failed)? {
        if interrupted.load(Ordering::Relaxed) {
            return Err(wrong_input("interrupted"));
        }
        for item in items.drain(..) {
            match item {
                Item::Sample(sample) => read.samples.push(sample),
                Item::Piece(piece) => read.pieces.push(piece),
            }
        }
    }
    let clock = recording.clock();
    (read.unit, read.epoch_ns) = (clock.unit.to_owned(), clock.epoch_ns);
    read.planar = recording.is_planar();
    (read.vehicles, read.notes) = (recording.vehicles().to_vec(), recording.notes().to_vec());
    Ok(read)
}

impl Read {
    fn columns(self, py: Python<'_>) -> PyResult<Columns> {
        let Self { vehicles, notes, planar, unit, epoch_ns, samples, pieces } = self;
        let index = |vehicle: usize| i64::try_from(vehicle).unwrap_or(i64::MAX);
        let numbers = |of: &dyn Fn(&Sample) -> f64| PyArray1::from_iter(py, samples.iter().map(of)).unbind();
        let most = pieces.iter().map(|piece| piece.coefficients.len()).max().unwrap_or(1);
        let velocities = samples.iter().flat_map(|of| of.velocity_m_s.map_or([f64::NAN; 3], Into::into));
        let coefficients = pieces
            .iter()
            .flat_map(|piece| (0..most).flat_map(|k| piece.coefficients.get(k).map_or([0.0; 3], |&of| of.into())));
        Ok(Columns {
            vehicle: PyArray1::from_iter(py, samples.iter().map(|of| index(of.vehicle))).unbind(),
            t: numbers(&|of| of.time_s),
            position: vectors(py, samples.iter().flat_map(|of| <[f64; 3]>::from(of.position_m)).collect())?.unbind(),
            velocity: vectors(py, velocities.collect())?.unbind(),
            radius: numbers(&|of| of.radius_m.unwrap_or(f64::NAN)),
            piece_vehicle: PyArray1::from_iter(py, pieces.iter().map(|of| index(of.vehicle))).unbind(),
            piece_span: spans(py, &pieces)?.unbind(),
            piece_coefficients: cube(py, coefficients.collect(), [pieces.len(), most, 3])?.unbind(),
            vehicles,
            notes,
            planar,
            unit,
            epoch_ns,
        })
    }
}

fn spans<'py>(py: Python<'py>, pieces: &[Piece]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    use numpy::PyArrayMethods as _;
    PyArray1::from_iter(py, pieces.iter().flat_map(|of| [of.from_s, of.to_s])).reshape([pieces.len(), 2])
}
