//! Mapping of the axes by the user, facts that every recording states, and the search for vehicles under two names.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::{AXES, COLUMN, DISTINCT, SCALE, TOPIC};
use tautline_core::track::{Item, Metadata, Plan, Sample, Tracks};

use super::axes::Axes;
use super::error::{ContentKind, Fault, ReadError, quoted, refuse};
use super::options::ReadOptions;
use super::order::Recording;

/// Smallest number of common times that is evidence of one vehicle under two names.
const ENOUGH_TIMES: u32 = 3;

/// Smallest number of changes of position between these times: vehicles that stand at one place, such as an unset
/// origin, are no evidence.
const ENOUGH_MOVES: u32 = 2;

/// Applies the mapping of the axes by the user, adds the facts that every recording has, and refuses one vehicle under
/// two names.
pub(super) fn stated(recording: Recording, options: &ReadOptions, path: &Path) -> Result<Recording, ReadError> {
    let axes = options.turn();
    if recording.is_planar() && !axes.keeps_plane() {
        let problem = format!("{AXES} maps its third axis to x or y, but it has none");
        let column = COLUMN.set("z=NAME");
        let remedy = format!("name the column of the third axis with {column}, or keep z in {AXES}");
        return refuse(ContentKind::ContradictsOption, problem, remedy);
    }
    let metadata = completed(recording.metadata(), options);
    let is_known = metadata.facts.iter().any(|fact| fact.kind == FactKind::Identity && fact.source == Source::Recorded);
    let twins = (!options.distinct && !is_known).then(Twins::default);
    let mut plans = recording.plans().to_vec();
    for piece in plans.iter_mut().flat_map(|plan| &mut plan.pieces) {
        if metadata.is_planar {
            piece.coefficients.iter_mut().for_each(flatten);
        }
        piece.coefficients.iter_mut().for_each(|coefficient| *coefficient = axes.turn(*coefficient));
    }
    Ok(Box::new(Stated { recording, axes, plans, metadata, path: path.to_owned(), options: options.clone(), twins }))
}

/// Returns metadata with a note on the axes and a fact of each kind that every recording has.
fn completed(metadata: &Metadata, options: &ReadOptions) -> Metadata {
    let mut metadata = metadata.clone();
    let axes = Some(options.turn()).filter(|axes| !axes.is_identity());
    metadata.notes.extend(axes.map(|axes| axes.note()));
    let facts = &mut metadata.facts;
    let frame = match &metadata.earth_origin {
        Some(origin) => {
            let source = if origin.is_inferred { Source::Deduced } else { Source::Declared };
            Fact::name(FactKind::Frame, source, format!("east, north and up of {origin}"))
        }
        None if axes.is_some() => Fact::name(FactKind::Frame, Source::Declared, options.turn().note()),
        None if metadata.has_directions => Fact::name(FactKind::Frame, Source::Deduced, "east, north and up"),
        None => Fact::name(FactKind::Frame, Source::Default, "one frame, z up"),
    };
    let length = match options.scale {
        Some(_) => Fact::number(FactKind::LengthUnit, Source::Declared, options.metres(), "m"),
        None => Fact::name(FactKind::LengthUnit, Source::Convention, "m"),
    };
    let others = [
        Fact::name(FactKind::TimeUnit, Source::Convention, metadata.clock.unit),
        Fact::name(FactKind::Clock, Source::Convention, "one clock for all vehicles"),
        Fact::name(FactKind::Identity, Source::Convention, "vehicles of the format"),
        length,
        frame,
    ];
    for fact in others {
        if !facts.iter().any(|known| known.kind == fact.kind) {
            facts.push(fact);
        }
    }
    if options.distinct {
        facts.push(Fact::name(FactKind::Identity, Source::Declared, "vehicles with equal positions are different"));
    }
    metadata
}

struct Stated {
    recording: Recording,
    axes: Axes,
    /// Plans with these axes.
    plans: Vec<Plan>,
    metadata: Metadata,
    path: PathBuf,
    options: ReadOptions,
    /// Search for one vehicle under two names; `None` if the names are certain.
    twins: Option<Twins>,
}

impl Tracks for Stated {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        self.recording.vehicles()
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        let before = items.len();
        let more = self.recording.read(items)?;
        if self.metadata.is_planar {
            items[before..].iter_mut().for_each(flatten_item);
        }
        if !self.axes.is_identity() {
            items[before..].iter_mut().try_for_each(|item| turn(item, self.axes))?;
        }
        if let Some(twins) = &mut self.twins {
            items[before..].iter().for_each(|item| twins.observe(item));
        }
        if !more {
            self.metadata = completed(self.recording.metadata(), &self.options);
            let found = self.twins.as_mut().and_then(Twins::found);
            if let Some([first, second]) = found {
                return Err(ReadError::new(&self.path, fault(self.recording.vehicles(), first, second)));
            }
        }
        Ok(more)
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn plans(&self) -> &[Plan] {
        &self.plans
    }
}

/// Removes the height.
fn flatten(vector: &mut Vector3<f64>) {
    vector.z = 0.0;
}

/// Removes the heights of a planar recording.
fn flatten_item(item: &mut Item) {
    match item {
        Item::Sample(sample) => {
            flatten(&mut sample.position_m);
            sample.velocity_m_s.iter_mut().for_each(flatten);
        }
        Item::Piece(piece) => piece.coefficients.iter_mut().for_each(flatten),
    }
}

/// Maps the axes of an item.
fn turn(item: &mut Item, axes: Axes) -> Result<(), Fault> {
    match item {
        Item::Sample(sample) => {
            if sample.radius_m.is_some() && !axes.keeps_lengths() {
                let problem = format!("{SCALE} has different factors for its axes, but vehicles have a radius");
                let remedy = format!("give one factor in {SCALE}");
                return refuse(ContentKind::ContradictsOption, problem, remedy);
            }
            sample.position_m = axes.turn(sample.position_m);
            sample.velocity_m_s = sample.velocity_m_s.map(|velocity| axes.turn(velocity));
        }
        Item::Piece(piece) => {
            piece.coefficients.iter_mut().for_each(|coefficient| *coefficient = axes.turn(*coefficient));
        }
    }
    Ok(())
}

fn fault(names: &[String], first: usize, second: usize) -> Fault {
    let [first, second] = [first, second].map(|index| quoted(names.get(index).map_or("", String::as_str)));
    let problem = format!(
        "the vehicles {first} and {second} have equal positions at all common times, as one vehicle under two names has"
    );
    let remedy = format!(
        "leave one of them out (for messages, choose topics with {TOPIC}), or confirm two vehicles with {DISTINCT}"
    );
    Fault::content(ContentKind::VehicleTwice, problem, remedy)
}

/// Position of a vehicle at a time, as bits.
type Bits = [u64; 3];

/// Search for two vehicles with equal positions at all common times.
///
/// A pair is a candidate if its positions are equal at the first time of one of the two, and until they differ. Each
/// vehicle has at most one partner, the first vehicle of its group with equal positions.
#[derive(Debug, Default)]
struct Twins {
    /// Partner of each vehicle, and its candidacy; by vehicle.
    vehicles: Vec<Seen>,
    candidates: u32,
    /// Number of earlier times.
    instants: u64,
    /// Items of the current time.
    now_s: f64,
    instant: Vec<(usize, Bits)>,
    has_new: bool,
}

/// State of a vehicle in the search.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    is_present: bool,
    partner: Option<usize>,
    /// Number of common times with the partner, and of changes of position between them.
    times: u32,
    moves: u32,
    /// Number of the instant at which the vehicle got its first partner.
    paired_at: u64,
    /// Position at the last common time.
    last: Bits,
    /// Whether the vehicle was seen at a time without its partner.
    was_alone: bool,
    /// Position at the current time.
    now: Option<Bits>,
}

impl Twins {
    #[inline]
    fn observe(&mut self, item: &Item) {
        // Curves are plans: two equal ones are a violation.
        let Item::Sample(Sample { vehicle, time_s, position_m, .. }) = *item else { return };
        if time_s.to_bits() != self.now_s.to_bits() {
            self.close();
            self.now_s = time_s;
        }
        if vehicle >= self.vehicles.len() {
            self.vehicles.resize(vehicle + 1, Seen::default());
        }
        self.has_new |= !self.vehicles[vehicle].is_present;
        // Adding 0 converts -0 to +0.
        self.instant.push((vehicle, [0, 1, 2].map(|axis| (position_m[axis] + 0.0).to_bits())));
    }

    /// Compares the positions of the current time.
    fn close(&mut self) {
        if self.has_new || self.candidates > 0 {
            self.compare();
        }
        self.has_new = false;
        self.instants += 1;
        self.instant.clear();
    }

    fn compare(&mut self) {
        let instant = std::mem::take(&mut self.instant);
        for &(vehicle, bits) in &instant {
            self.vehicles[vehicle].now = Some(bits);
        }
        // Vehicles that differ from their partner form new groups.
        let mut regrouped: HashMap<(usize, Bits), usize> = HashMap::new();
        for &(vehicle, bits) in &instant {
            let Some(partner) = self.vehicles[vehicle].partner else { continue };
            match self.vehicles[partner].now {
                None => self.vehicles[vehicle].was_alone = true,
                Some(place) if place == bits => {
                    let seen = &mut self.vehicles[vehicle];
                    let is_move = seen.times > 0 && seen.last != bits;
                    (seen.times, seen.moves) = (seen.times + 1, seen.moves + u32::from(is_move));
                    seen.last = bits;
                }
                Some(_) => {
                    let was_alone = self.vehicles[vehicle].was_alone;
                    let next = if was_alone { vehicle } else { *regrouped.entry((partner, bits)).or_insert(vehicle) };
                    if next == vehicle {
                        self.vehicles[vehicle].partner = None;
                        self.candidates -= 1;
                    } else {
                        self.vehicles[vehicle] = self.regrouped(vehicle, next, bits);
                    }
                }
            }
        }
        if self.has_new {
            self.pair_new(&instant);
        }
        for &(vehicle, _) in &instant {
            let seen = &mut self.vehicles[vehicle];
            (seen.now, seen.is_present) = (None, true);
        }
        self.instant = instant;
    }

    /// Returns the state of a vehicle that has left its partner together with the vehicle `next`.
    fn regrouped(&self, vehicle: usize, next: usize, bits: Bits) -> Seen {
        let (own, other) = (self.vehicles[vehicle], self.vehicles[next]);
        // Two vehicles that were seen at all times since they had a partner have all these times in common.
        let is_dense = |seen: &Seen| u64::from(seen.times) == self.instants - seen.paired_at;
        let common = if other.times < own.times { other } else { own };
        let (times, moves) = if is_dense(&own) && is_dense(&other) { (common.times, common.moves) } else { (0, 0) };
        let is_move = times > 0 && own.last != bits;
        Seen { partner: Some(next), times: times + 1, moves: moves + u32::from(is_move), last: bits, ..own }
    }

    /// Pairs vehicles that are seen for the first time with a vehicle at the same place.
    fn pair_new(&mut self, instant: &[(usize, Bits)]) {
        let mut groups: HashMap<Bits, usize> = HashMap::new();
        // Earlier vehicles come first: a vehicle with samples before cannot be paired with another one of these.
        let known = instant.iter().filter(|(vehicle, _)| self.vehicles[*vehicle].is_present);
        for &(vehicle, bits) in known {
            groups.entry(bits).or_insert(vehicle);
        }
        for &(vehicle, bits) in instant {
            if self.vehicles[vehicle].is_present {
                continue;
            }
            let first = *groups.entry(bits).or_insert(vehicle);
            let seen = &mut self.vehicles[vehicle];
            if first == vehicle {
                continue;
            }
            (seen.partner, seen.times, seen.moves, seen.last) = (Some(first), 1, 0, bits);
            seen.paired_at = self.instants;
            self.candidates += 1;
        }
    }

    /// Returns a pair with equal positions at all common times, after the last item.
    fn found(&mut self) -> Option<[usize; 2]> {
        self.close();
        let is_evident = |seen: &Seen| seen.times >= ENOUGH_TIMES && seen.moves >= ENOUGH_MOVES;
        let mut pairs = self.vehicles.iter().enumerate().filter(|(_, seen)| is_evident(seen));
        pairs.find_map(|(vehicle, seen)| Some([seen.partner?, vehicle]))
    }
}
