//! Running metrics of a flight, updated sample by sample.
//!
//! [`Metrics`] is a [`Sink`]: it observes a flight, or takes the samples of a recording. Arrival is checked at every
//! step. Peaks include steps between samples if samples hold them; see [`tautline_core::record::Peaks`].

use std::borrow::Cow;

use nalgebra::Vector3;

use tautline_core::record::{Event, Peaks, RecordError, Sample, Sink, Step};
use tautline_core::swarm::{Rows, Swarm, largest_row_norm, mean_row, row};
use tautline_laws::formation::Freedom;
use tautline_laws::graph::Graph;
use tautline_laws::target::{Arrival, FormationError, Guidance, Leg, Reference, reassign};

/// Running metrics of samples, in order of time; results in a [`Summary`].
#[derive(Clone, Debug)]
pub struct Metrics<'a> {
    /// Legs with the present assignment of vehicles.
    legs: Cow<'a, [Leg]>,
    graph: &'a Graph,
    guidance: Option<&'a Guidance>,
    arrival: Arrival,
    freedom: Freedom,
    /// Current leg, from 0.
    leg: usize,
    /// Ended legs.
    ended: Vec<LegSummary>,
    samples: u64,
    /// First instant of the leg since which all errors have been within the limits \[s\].
    good_since_s: Option<f64>,
    /// Last instant that was checked \[s\].
    judged_to_s: Option<f64>,
    last_s: f64,
    distance: FormationError,
    common_m_s: f64,
    peak_control_m_s2: f64,
    final_control_m_s2: f64,
    energy: Option<EnergyRange>,
    /// Mean position of the first sample.
    origin_m: Option<Vector3<f64>>,
    extent_m: f64,
    fastest_m_s: f64,
    quadrotor_peaks: Option<QuadrotorPeaks>,
}

/// Range of the energy \[m^2/s^2\] over the samples that have one.
#[derive(Clone, Copy, Debug)]
struct EnergyRange {
    initial: f64,
    last: f64,
    max: f64,
}

/// Metrics of a flight. Values at the end are those of the last sample; values of a state that is not finite are not
/// finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Number of samples.
    pub samples: u64,
    /// Time of the last sample \[s\].
    pub end_s: f64,
    /// Time at which the formation was reached for good \[s\]; see [`Metrics::finish`].
    pub reached_at_s: Option<f64>,
    /// Time for which all tolerances had been kept at the end \[s\]; `None` if they were not kept at the end.
    pub held_s: Option<f64>,
    /// Largest error of a desired distance over the graph's edges at the end \[m\].
    pub max_edge_error_m: f64,
    /// Root mean square distance of the vehicles from their slots at the end \[m\], after the best motion that the
    /// formation is free to make (rotation, reflection, translation).
    pub rms_position_error_m: f64,
    /// Distance of the vehicle that is then farthest from its slot \[m\].
    pub max_position_error_m: f64,
    /// Largest speed relative to the swarm's mean velocity, or to the reference if there is one, at the end \[m/s\].
    pub disagreement_m_s: f64,
    /// Speed of the mean velocity at the end \[m/s\].
    pub common_m_s: f64,
    /// Largest commanded acceleration of a vehicle, Euclidean norm, over all steps \[m/s^2\].
    pub peak_control_m_s2: f64,
    /// Largest commanded acceleration of a vehicle at the end \[m/s^2\]; NaN if the law is undefined there.
    pub final_control_m_s2: f64,
    /// Largest distance of a vehicle from the mean position of the first sample \[m\].
    pub extent_m: f64,
    /// Largest speed of a vehicle \[m/s\].
    pub fastest_m_s: f64,
    /// Energy of the first sample that has one \[m^2/s^2\].
    pub energy_initial: Option<f64>,
    /// Energy of the last sample that has one \[m^2/s^2\].
    pub energy_final: Option<f64>,
    /// Largest energy over all steps \[m^2/s^2\].
    pub energy_max: Option<f64>,
    /// Ratio `energy_max / energy_initial`: 1 if the energy never exceeded its initial value; `None` for a start
    /// without energy.
    pub energy_max_over_initial: Option<f64>,
}

/// Leg before the last one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegSummary {
    /// Time at which the next leg began \[s\].
    pub ended_at_s: f64,
    /// Time at which its formation was reached for good \[s\], if it was.
    pub reached_at_s: Option<f64>,
}

impl<'a> Metrics<'a> {
    /// Creates metrics of a flight through these legs with the limits of `arrival`.
    #[must_use]
    pub fn new(legs: &'a [Leg], graph: &'a Graph, arrival: Arrival) -> Self {
        Self {
            legs: Cow::Borrowed(legs),
            graph,
            guidance: None,
            arrival,
            freedom: Freedom::RigidMotion,
            leg: 0,
            ended: Vec::new(),
            samples: 0,
            good_since_s: None,
            judged_to_s: None,
            last_s: 0.0,
            distance: FormationError::unknown(),
            common_m_s: f64::NAN,
            peak_control_m_s2: 0.0,
            final_control_m_s2: 0.0,
            energy: None,
            origin_m: None,
            extent_m: 0.0,
            fastest_m_s: 0.0,
            quadrotor_peaks: None,
        }
    }

    /// Sets the motions that the formation is free to make; by default any rigid motion.
    #[must_use]
    pub fn with_freedom(mut self, freedom: Freedom) -> Self {
        self.freedom = freedom;
        self
    }

    /// Sets the reference that carries the formations.
    #[must_use]
    pub fn with_reference(mut self, guidance: Option<&'a Guidance>) -> Self {
        self.guidance = guidance;
        self
    }

    /// Adds a sample, in O(edges); allocates only for the first one.
    pub fn observe(&mut self, sample: &Sample<'_>) {
        self.samples += 1;
        self.last_s = sample.time_s;
        let leg = self.legs.get(self.leg);
        self.distance = leg.map_or_else(FormationError::unknown, |leg| {
            FormationError::of(sample.swarm, &leg.formation, &self.reference(sample.time_s), self.graph, self.freedom)
        });
        self.common_m_s = sample.swarm.mean_velocity_m_s().norm();
        self.observe_control(sample.control);
        self.observe_energy(sample.energy);
        self.observe_peaks(sample.peaks);
        self.observe_extent(sample.swarm);
        QuadrotorPeaks::observe(&mut self.quadrotor_peaks, sample);
        if self.judged_to_s != Some(sample.time_s) {
            self.judge(sample.time_s, sample.swarm, self.arrival.is_within(&self.distance));
        }
    }

    /// Records whether a true state is within the limits of arrival.
    fn judge(&mut self, time_s: f64, swarm: &Swarm, is_within: bool) {
        let good = is_within && swarm.first_not_finite().is_none();
        self.good_since_s = good.then(|| self.good_since_s.unwrap_or(time_s));
        self.judged_to_s = Some(time_s);
    }

    fn reference(&self, time_s: f64) -> Reference {
        self.guidance.map_or_else(Reference::at_rest, |known| known.motion.at(time_s))
    }

    /// Ends the current leg. It counts as reached if the true state was within the limits for long enough, whatever the
    /// vehicles sensed.
    fn begin_leg(&mut self, leg: usize, time_s: f64) {
        let held_since_s = self.good_since_s.filter(|&since_s| self.arrival.is_held(since_s, time_s));
        self.ended.push(LegSummary { ended_at_s: time_s, reached_at_s: held_since_s });
        (self.good_since_s, self.judged_to_s) = (None, None);
        self.leg = leg;
    }

    /// Returns the ended legs, in order. [`Metrics::finish`] covers the leg after them.
    #[must_use]
    pub fn ended_legs(&self) -> &[LegSummary] {
        &self.ended
    }

    /// Returns the largest tilt and rotor thrust, for quadrotors.
    #[must_use]
    pub fn quadrotor_peaks(&self) -> Option<QuadrotorPeaks> {
        self.quadrotor_peaks
    }

    /// Updates the commands; the final command of a sample without one is NaN.
    fn observe_control(&mut self, control: &Rows) {
        if control.nrows() == 0 {
            self.final_control_m_s2 = f64::NAN;
            return;
        }
        self.final_control_m_s2 = largest_row_norm(control);
        self.peak_control_m_s2 = larger(self.peak_control_m_s2, self.final_control_m_s2);
    }

    fn observe_extent(&mut self, swarm: &Swarm) {
        let origin_m = *self.origin_m.get_or_insert_with(|| mean_row(&swarm.positions_m));
        let farthest_m = (0..swarm.count()).map(|i| (row(&swarm.positions_m, i) - origin_m).norm()).fold(0.0, larger);
        self.extent_m = larger(self.extent_m, farthest_m);
        self.fastest_m_s = larger(self.fastest_m_s, largest_row_norm(&swarm.velocities_m_s));
    }

    /// Updates the peaks with those between samples.
    fn observe_peaks(&mut self, peaks: Peaks) {
        if let Some(control_m_s2) = peaks.control_m_s2 {
            self.peak_control_m_s2 = larger(self.peak_control_m_s2, control_m_s2);
        }
        if let (Some(range), Some(energy)) = (&mut self.energy, peaks.energy) {
            range.max = larger(range.max, energy);
        }
    }

    /// Updates the energy; the final energy of a sample without one is NaN.
    fn observe_energy(&mut self, energy: Option<f64>) {
        match (&mut self.energy, energy) {
            (Some(range), Some(energy)) => {
                range.last = energy;
                range.max = larger(range.max, energy);
            }
            (Some(range), None) => range.last = f64::NAN,
            (None, Some(energy)) => self.energy = Some(EnergyRange { initial: energy, last: energy, max: energy }),
            (None, None) => {}
        }
    }

    /// Returns the largest error of a desired distance at the last sample \[m\].
    #[must_use]
    pub fn edge_error_m(&self) -> f64 {
        self.distance.max_edge_error_m
    }

    /// Returns the metrics.
    ///
    /// The formation is reached at the end of the first step of the last sequence of steps within the limits of edges,
    /// positions and disagreement. The sequence must last at least `hold_s` and end with the last step. Without steps,
    /// samples are used. A formation that was held and lost again is not reached; if it was regained, the time of that
    /// counts.
    #[must_use]
    pub fn finish(&self) -> Summary {
        let held_s = self.good_since_s.map(|since| self.last_s - since);
        let reached = self.good_since_s.is_some_and(|since_s| self.arrival.is_held(since_s, self.last_s));
        Summary {
            samples: self.samples,
            end_s: self.last_s,
            reached_at_s: self.good_since_s.filter(|_| reached),
            held_s,
            max_edge_error_m: self.distance.max_edge_error_m,
            rms_position_error_m: self.distance.rms_position_error_m,
            max_position_error_m: self.distance.max_position_error_m,
            disagreement_m_s: self.distance.disagreement_m_s,
            common_m_s: self.common_m_s,
            peak_control_m_s2: self.peak_control_m_s2,
            final_control_m_s2: self.final_control_m_s2,
            extent_m: self.extent_m,
            fastest_m_s: self.fastest_m_s,
            energy_initial: self.energy.map(|energy| energy.initial),
            energy_final: self.energy.map(|energy| energy.last),
            energy_max: self.energy.map(|energy| energy.max),
            energy_max_over_initial: self
                .energy
                .filter(|energy| energy.initial != 0.0)
                .map(|energy| energy.max / energy.initial),
        }
    }
}

impl Sink for Metrics<'_> {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.observe(sample);
        Ok(())
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        match event {
            &Event::LegBegan { leg, time_s } => self.begin_leg(leg, time_s),
            Event::Assigned { slots, .. } => {
                reassign(self.legs.to_mut(), self.leg, slots);
                self.judged_to_s = None;
            }
            _ => {}
        }
        Ok(())
    }

    /// Checks arrival at the end of every step, recorded or not.
    fn step(&mut self, step: &Step<'_>) {
        let is_within = self.legs.get(self.leg).is_some_and(|leg| {
            let reference = self.reference(step.time_s);
            self.arrival.holds(step.swarm, &leg.formation, &reference, self.graph, self.freedom)
        });
        self.judge(step.time_s, step.swarm, is_within);
    }
}

/// Returns the larger number; NaN if either is NaN, which `f64::max` ignores.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// Peaks of the channels of quadrotors, over the samples that have them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadrotorPeaks {
    /// Largest angle between a vehicle's thrust and the vertical \[rad\].
    pub max_tilt_rad: f64,
    /// Largest thrust of a rotor \[N\].
    pub max_thrust_n: f64,
}

impl QuadrotorPeaks {
    /// Updates the peaks; samples without a channel `attitude` change nothing.
    fn observe(quadrotor_peaks: &mut Option<Self>, sample: &Sample<'_>) {
        let channel = |name: &str| sample.channels.iter().find(|channel| &*channel.name == name);
        let (Some(attitude), Some(rotors)) = (channel("attitude"), channel("rotors")) else { return };
        let Self { max_tilt_rad, max_thrust_n } =
            quadrotor_peaks.get_or_insert(Self { max_tilt_rad: 0.0, max_thrust_n: 0.0 });
        for q in attitude.values.chunks_exact(4) {
            // Half angle from the vertical: its sine is the norm of the quaternion's x and y components.
            *max_tilt_rad = max_tilt_rad.max(2.0 * libm::asin((q[1] * q[1] + q[2] * q[2]).sqrt().min(1.0)));
        }
        *max_thrust_n = rotors.values.iter().copied().fold(*max_thrust_n, f64::max);
    }
}

#[cfg(test)]
mod tests;
