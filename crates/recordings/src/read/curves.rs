//! Recordings of curves, with all pieces in memory.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use serde::de::DeserializeOwned;

use super::error::{ContentKind, Fault, Place, ReadError, quoted, refuse};
use super::options::ReadOptions;
use super::order::{BATCH, Recording};
use super::source::{Source, VehicleFiles};
use tautline_core::option::START;
use tautline_core::track::{Item, Metadata, Piece, Plan, Sample, Tracks};

/// Smallest jump between two pieces of a curve that is reported \[m\]. Files round to micrometres.
const JUMP_M: f64 = 1e-3;
/// Largest time between the ends of two curves that end at one instant \[s\]: sums of rounded durations differ.
const SAME_INSTANT_S: f64 = 1e-5;

/// Highest supported degree of a curve.
pub(super) const HIGHEST_DEGREE: usize = 15;

/// Names of vehicles, each with its items in order of time.
pub(super) type VehicleItems = Vec<(String, Vec<Item>)>;

/// Pieces of curves in order of time.
pub(super) struct Curves {
    vehicles: Vec<String>,
    items: std::vec::IntoIter<Item>,
    /// Published plans, in order of publication.
    plans: Vec<Plan>,
    metadata: Metadata,
}

impl Curves {
    /// Returns the recording of these vehicles in seconds, each with its items in order of time.
    pub(super) fn recording(vehicles: VehicleItems, notes: Vec<String>) -> Recording {
        Self::with_metadata(vehicles, Metadata::in_seconds(notes))
    }

    /// Returns the recording of these vehicles, each with its items in order of time, and adds a note on jumps.
    pub(super) fn with_metadata(vehicles: VehicleItems, metadata: Metadata) -> Recording {
        Self::with_plans(vehicles, metadata, Vec::new())
    }

    /// Returns the recording of these vehicles and of their published plans.
    pub(super) fn with_plans(mut vehicles: VehicleItems, mut metadata: Metadata, plans: Vec<Plan>) -> Recording {
        align_ends(&mut vehicles);
        metadata.notes.extend(largest_jump(&vehicles));
        let (vehicles, items): (Vec<_>, Vec<_>) = vehicles.into_iter().unzip();
        let mut items: Vec<_> = items.into_iter().flatten().collect();
        // The sort is stable: items with the same time stay in the order of the vehicles.
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        Box::new(Self { vehicles, items: items.into_iter(), plans, metadata })
    }
}

impl Tracks for Curves {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        &self.vehicles
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        let before = items.len();
        items.extend(self.items.by_ref().take(BATCH));
        Ok(items.len() > before)
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn plans(&self) -> &[Plan] {
        &self.plans
    }
}

/// Curve of a vehicle, as read so far.
pub(super) struct Curve {
    pub(super) vehicle: usize,
    /// Start of the next piece \[s\].
    time_s: f64,
    /// Metres per unit of length.
    pub(super) scale: f64,
    pub(super) items: Vec<Item>,
}

impl Curve {
    /// Adds a piece of this duration \[s\] with these coefficients of the powers of time.
    pub(super) fn push(&mut self, duration_s: f64, coefficients: Vec<Vector3<f64>>) -> Result<(), Fault> {
        let to_s = self.time_s + duration_s;
        // A duration that is not a number compares false.
        if !(duration_s > 0.0 && to_s > self.time_s) {
            let problem = format!("the duration of the piece must be positive, got {duration_s} s");
            return refuse(ContentKind::Duration, problem, "remove the piece");
        }
        let piece = piece(self.vehicle, self.time_s, to_s, coefficients, self.scale);
        self.items.push(Item::Piece(piece.ok_or_else(Fault::out_of_range)?));
        self.time_s = to_s;
        Ok(())
    }
}

/// Reads the curves of these vehicles with notes; `append` adds the pieces of a file to the curve of its vehicle.
pub(super) fn curves_of(
    vehicles: VehicleFiles,
    left_out: Option<String>,
    options: &ReadOptions,
    mut append: impl FnMut(&mut Curve, &Source) -> Result<(), ReadError>,
) -> Result<(VehicleItems, Vec<String>), ReadError> {
    let mut notes: Vec<String> = left_out.into_iter().collect();
    let (several, mut has_sequence_note) = (vehicles.len() > 1, false);
    let mut curves = VehicleItems::new();
    if let Some(name) = options.starts.keys().find(|name| vehicles.iter().all(|(known, _)| known != *name)) {
        let problem = format!("{START} names the unknown vehicle {}", quoted(name));
        return refuse(ContentKind::UnknownVehicle, problem, "use the names of the files without their extension");
    }
    for (name, files) in vehicles {
        let mut curve = Curve { vehicle: curves.len(), time_s: 0.0, scale: options.metres(), items: Vec::new() };
        for file in &files {
            let appended = append(&mut curve, file).map_err(|fault| fault.of(&file.display_path()));
            appended.map_err(|fault| if several { fault.among_others() } else { fault })?;
        }
        if files.len() > 1 && !has_sequence_note {
            notes.push(format!("`{name}` and others fly the files of their folders in sequence"));
            has_sequence_note = true;
        }
        let start = options.starts.get(&name).copied().unwrap_or_default();
        for item in &mut curve.items {
            if let Item::Piece(piece) = item {
                piece.coefficients[0] += Vector3::from(start);
            }
        }
        curves.push((name, curve.items));
    }
    Ok((curves, notes))
}

/// Returns the note on curves that start at one position, which may be relative.
pub(super) fn note_of_starts(curves: &VehicleItems) -> Option<String> {
    let first = |items: &[Item]| match items {
        [Item::Piece(piece), ..] => Some(piece.coefficients[0]),
        _ => None,
    };
    let is_common = curves.windows(2).any(|pair| first(&pair[0].1) == first(&pair[1].1));
    let start = START.set("NAME=X,Y,Z");
    is_common.then(|| format!("curves start at one position: if they are relative, set each origin with {start}"))
}

/// Parses JSON; `a_show` names the expected content and `remedy` the remedy for malformed JSON.
pub(super) fn from_json<T: DeserializeOwned>(bytes: &[u8], a_show: &str, remedy: &str) -> Result<T, ReadError> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    serde_json::from_slice(text).map_err(|error| {
        let fault = if error.is_eof() {
            Fault::truncated("the JSON ends before it is complete")
        } else {
            Fault::content(ContentKind::Malformed, format!("it is not the JSON of {a_show}: {error}"), remedy)
        };
        fault.at(Place::Line(u64::try_from(error.line()).unwrap_or(0)))
    })
}

/// Returns distinct names: those given, or numbers if two are equal.
pub(super) fn distinct(names: Vec<String>) -> Vec<String> {
    let different: BTreeSet<_> = names.iter().collect();
    if different.len() == names.len() { names } else { (1..=names.len()).map(|number| number.to_string()).collect() }
}

/// Returns a piece with these coefficients, scaled to metres; `None` if a number is not finite or the interval is
/// empty.
pub(super) fn piece(
    vehicle: usize,
    from_s: f64,
    to_s: f64,
    coefficients: impl IntoIterator<Item = Vector3<f64>>,
    scale: f64,
) -> Option<Piece> {
    let coefficients: Vec<_> = coefficients.into_iter().map(|coefficient| coefficient * scale).collect();
    let finite = coefficients.iter().all(|coefficient| coefficient.iter().all(|x| x.is_finite()));
    (finite && from_s.is_finite() && to_s.is_finite() && from_s < to_s).then_some(Piece {
        vehicle,
        from_s,
        to_s,
        coefficients,
    })
}

/// Converts the Bezier curve of these points over a duration T to coefficients of the powers of time.
///
/// `c_k = C(n, k) D_k / T^k` with the k-th forward difference `D_k = sum_i (-1)^(k - i) C(k, i) P_i` of the points.
pub(crate) fn powers(points: &[Vector3<f64>], duration_s: f64) -> Vec<Vector3<f64>> {
    let degree = points.len() - 1;
    let mut differences = points.to_vec();
    let mut factor = 1.0;
    let mut coefficients = Vec::with_capacity(points.len());
    for k in 0..=degree {
        coefficients.push(differences[0] * factor);
        for i in 0..degree - k {
            differences[i] = differences[i + 1] - differences[i];
        }
        factor *= (degree - k) as f64 / ((k + 1) as f64 * duration_s);
    }
    coefficients
}

/// Extends curves that end within [`SAME_INSTANT_S`] of the latest end up to it.
fn align_ends(vehicles: &mut [(String, Vec<Item>)]) {
    let latest_s = latest_end_s(vehicles.iter().filter_map(|(_, items)| items.last()));
    for (_, items) in vehicles {
        if let Some(Item::Piece(last)) = items.last_mut()
            && latest_s - last.to_s <= SAME_INSTANT_S
        {
            last.to_s = latest_s;
        }
    }
}

/// Returns the latest end of the pieces \[s\].
fn latest_end_s<'a>(items: impl Iterator<Item = &'a Item>) -> f64 {
    let end_s = |item: &Item| if let Item::Piece(piece) = item { piece.to_s } else { f64::NEG_INFINITY };
    items.map(end_s).fold(f64::NEG_INFINITY, f64::max)
}

/// Extends a drone with a single point to the end of the show.
pub(super) fn stand_throughout<'a>(curves: impl Iterator<Item = &'a mut Vec<Item>>) {
    let mut curves: Vec<_> = curves.collect();
    let end_s = latest_end_s(curves.iter().flat_map(|curve| curve.iter()));
    for curve in &mut curves {
        if let [Item::Sample(sample)] = curve[..]
            && sample.time_s < end_s
        {
            let Sample { vehicle, time_s: from_s, position_m, .. } = sample;
            curve[0] = Item::Piece(Piece { vehicle, from_s, to_s: end_s, coefficients: vec![position_m] });
        }
    }
}

/// Returns the position at a time since the start of a piece \[s\], by its coefficients.
pub(super) fn value(coefficients: &[Vector3<f64>], time_s: f64) -> Vector3<f64> {
    coefficients.iter().rev().fold(Vector3::zeros(), |sum, coefficient| sum * time_s + coefficient)
}

fn largest_jump(vehicles: &[(String, Vec<Item>)]) -> Option<String> {
    let jumps = vehicles.iter().flat_map(|(name, items)| {
        items.windows(2).filter_map(move |pair| match pair {
            [Item::Piece(before), Item::Piece(after)] => {
                let end = value(&before.coefficients, before.to_s - before.from_s);
                Some(((end - after.coefficients.first()?).norm(), name, after.from_s))
            }
            _ => None,
        })
    });
    let (jump_m, name, time_s) = jumps.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|jump| jump.0 > JUMP_M)?;
    Some(format!("the largest jump of a curve is {jump_m:.4} m, of `{name}` at {time_s} s"))
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;

    /// Rounding error of a few additions of numbers around 10.
    const ROUNDING_M: f64 = 1e-13;

    #[test]
    fn power_coefficients_agree_with_de_casteljau() {
        let points = [vector![1.0, 2.0, 3.0], vector![-2.0, 0.5, 4.0], vector![0.0, 7.0, 1.0], vector![5.0, 5.0, 5.0]];
        let coefficients = powers(&points, 2.5);
        for step in 0..=10 {
            let u = f64::from(step) / 10.0;
            let mut level = points.to_vec();
            while level.len() > 1 {
                level = level.windows(2).map(|pair| pair[0] * (1.0 - u) + pair[1] * u).collect();
            }
            let t = 2.5 * u;
            let power = coefficients.iter().rev().fold(Vector3::zeros(), |sum, c| sum * t + c);
            assert!((power - level[0]).norm() < ROUNDING_M, "{u}: {power} {}", level[0]);
        }
    }

    #[test]
    fn ends_that_differ_by_rounding_are_one_instant() {
        let curve = |to_s: f64| vec![Item::Piece(piece(0, 0.0, to_s, [Vector3::zeros()], 1.0).expect("a piece"))];
        let mut vehicles = [10.0, 10.0 - 5e-6, 10.0 - 2e-5].map(|to_s| (String::new(), curve(to_s)));
        align_ends(&mut vehicles);
        let ends = vehicles.map(|(_, items)| match &items[0] {
            Item::Piece(piece) => piece.to_s,
            Item::Sample(_) => f64::NAN,
        });
        assert_eq!(ends, [10.0, 10.0, 10.0 - 2e-5]);
    }
}
