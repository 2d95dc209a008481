//! Wind of a run, advanced step by step.

use std::collections::VecDeque;

use nalgebra::Vector3;

use super::dryden::{Dryden, Step, TurbulenceState};
use super::normal::Normals;
use super::spec::WindSpec;
use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, set_row};

/// Rate at which turbulence is drawn \[Hz\]; in between it is linear. At 20 m/s the smallest length scale of 3 m gets
/// 39 samples, and less than 1 % of the variance is lost.
const TURBULENCE_HZ: f64 = 256.0;

/// First random stream of the wind, separate from other users of the same seed.
const STREAMS: u64 = 0x7769_6e64 << 32;

/// Wind of a run at an instant that advances step by step.
///
/// It is a function of the seed and of time: the step lengths do not matter, and the last step can be undone.
#[derive(Clone, Debug)]
pub struct Wind {
    spec: WindSpec,
    count: usize,
    now_s: f64,
    /// Time before the last step.
    before_s: f64,
    turbulence: Option<Turbulence>,
}

impl Wind {
    /// Creates the wind of `count` vehicles at time 0, with turbulence from a seed.
    #[must_use]
    pub fn new(spec: &WindSpec, count: usize, seed: u64) -> Self {
        let turbulence = spec.turbulence.map(|dryden| {
            let streams = if spec.shared { 1 } else { count };
            Turbulence::new(dryden, spec.mean_m_s, streams, seed)
        });
        Self { spec: spec.clone(), count, now_s: 0.0, before_s: 0.0, turbulence }
    }

    /// Advances by `dt_s` seconds. Allocates nothing after the first step of that length.
    pub fn advance(&mut self, dt_s: f64) {
        (self.before_s, self.now_s) = (self.now_s, self.now_s + dt_s);
        if let Some(turbulence) = &mut self.turbulence {
            turbulence.cover(self.before_s, self.now_s);
        }
    }

    /// Undoes the last [`Wind::advance`].
    pub fn undo(&mut self) {
        self.now_s = self.before_s;
    }

    /// Returns the present time \[s\].
    #[must_use]
    pub fn now_s(&self) -> f64 {
        self.now_s
    }

    /// Returns the next time \[s\] at which turbulence changes slope. Until then only gusts change the derivative of
    /// the wind.
    #[must_use]
    pub fn next_slope_change_s(&self, time_s: f64) -> f64 {
        // A change within rounding of `time_s` counts as passed.
        let turned = |_: &Turbulence| ((time_s * TURBULENCE_HZ + 1e-9).floor() + 1.0) / TURBULENCE_HZ;
        self.turbulence.as_ref().map_or(f64::INFINITY, turned)
    }

    /// Returns the present velocity of the air at a vehicle \[m/s\].
    #[must_use]
    pub fn air_m_s(&self, vehicle: usize) -> Vector3<f64> {
        self.air_at_m_s(vehicle, self.now_s)
    }

    /// Returns the velocity of the air at a vehicle at a time within the last step \[m/s\].
    #[must_use]
    pub fn air_at_m_s(&self, vehicle: usize, time_s: f64) -> Vector3<f64> {
        let turbulence = self.turbulence.as_ref().map_or_else(Vector3::zeros, |air| air.at(vehicle, time_s));
        self.spec.steady_m_s(vehicle, time_s) + turbulence
    }

    /// Writes the present velocity of the air at every vehicle \[m/s\].
    pub fn write(&self, air_m_s: &mut Rows) {
        (0..self.count).for_each(|i| set_row(air_m_s, i, self.air_m_s(i)));
    }

    /// Continues the turbulence from its present state with the random numbers of another seed.
    pub fn reseed(&mut self, seed: u64) {
        if let Some(turbulence) = &mut self.turbulence {
            turbulence.reseed(seed);
        }
    }

    /// Returns the recorded channel of the wind, without values.
    #[must_use]
    pub fn channel() -> Channel {
        Channel::new("wind", &["wind_x_m_s", "wind_y_m_s", "wind_z_m_s"])
    }

    /// Writes the present values into [`Wind::channel`].
    pub fn write_channel(&self, channel: &mut Channel) {
        channel.values.clear();
        (0..self.count).for_each(|i| channel.values.extend(&self.air_m_s(i)));
    }
}

/// Turbulence at its sampling instants, up to the present time.
#[derive(Clone, Debug)]
struct Turbulence {
    frame: [Vector3<f64>; 3],
    step: Step,
    /// Filters: one per vehicle, or one for all.
    eddies: Vec<TurbulenceState>,
    /// Index of the sampling instant of the first row of the window.
    first: u64,
    /// Velocity of the air at consecutive sampling instants, one row per instant \[m/s\]. Covers the last step.
    window: VecDeque<Vec<Vector3<f64>>>,
    /// Rows for reuse.
    spare: Vec<Vec<Vector3<f64>>>,
}

fn normals(seed: u64, stream: usize) -> Normals {
    Normals::new(seed, STREAMS | stream as u64)
}

impl Turbulence {
    fn new(dryden: Dryden, mean_m_s: Vector3<f64>, streams: usize, seed: u64) -> Self {
        let mut turbulence = Self {
            frame: Dryden::frame(mean_m_s),
            step: dryden.step(mean_m_s, 1.0 / TURBULENCE_HZ),
            eddies: (0..streams).map(|stream| TurbulenceState::new(normals(seed, stream))).collect(),
            first: 0,
            window: VecDeque::new(),
            spare: Vec::new(),
        };
        turbulence.push();
        turbulence.cover(0.0, 0.0);
        turbulence
    }

    fn reseed(&mut self, seed: u64) {
        self.eddies.iter_mut().enumerate().for_each(|(stream, eddy)| eddy.reseed(normals(seed, stream)));
    }

    /// Appends the present velocity of the air of all filters.
    fn push(&mut self) {
        let Self { frame: [along, across, up], step, eddies, window, spare, .. } = self;
        let mut row = spare.pop().unwrap_or_default();
        row.clear();
        row.extend(eddies.iter().map(|eddy| {
            let air = eddy.velocity_m_s(step);
            air.x * *along + air.y * *across + air.z * *up
        }));
        window.push_back(row);
    }

    /// Moves the window so that it covers the times from one to the other.
    fn cover(&mut self, from_s: f64, to_s: f64) {
        while self.window.len() > 2 && (self.first + 1) as f64 <= from_s * TURBULENCE_HZ {
            self.spare.extend(self.window.pop_front());
            self.first += 1;
        }
        while (self.first + self.window.len() as u64 - 1) as f64 <= to_s * TURBULENCE_HZ {
            self.eddies.iter_mut().for_each(|eddy| eddy.advance(&self.step));
            self.push();
        }
    }

    fn at(&self, vehicle: usize, time_s: f64) -> Vector3<f64> {
        let stream = if self.eddies.len() == 1 { 0 } else { vehicle };
        let place = (time_s * TURBULENCE_HZ - self.first as f64).clamp(0.0, (self.window.len() - 1) as f64);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "the index is clamped to the window"
        )]
        let before = (place as usize).min(self.window.len() - 2);
        let (from, to) = (self.window[before][stream], self.window[before + 1][stream]);
        from + (place - before as f64) * (to - from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stormy(shared: bool) -> WindSpec {
        let turbulence = Some(Dryden { speed_20ft_m_s: 10.0, height_m: 10.0 });
        WindSpec { mean_m_s: Vector3::new(3.0, 4.0, 0.0), turbulence, shared, ..WindSpec::default() }
    }

    /// Returns the air of vehicle 2 at multiples of 0.1 s, with each interval split into `cut` steps.
    fn flown(wind: &mut Wind, steps: u32, cut: u32) -> Vec<Vector3<f64>> {
        let advance = |_| {
            (0..cut).for_each(|_| wind.advance(0.1 / f64::from(cut)));
            wind.air_m_s(1)
        };
        (0..steps).map(advance).collect()
    }

    #[test]
    fn the_wind_is_a_function_of_time_and_seed() {
        for shared in [true, false] {
            let coarse = flown(&mut Wind::new(&stormy(shared), 3, 5), 40, 1);
            let fine = flown(&mut Wind::new(&stormy(shared), 3, 5), 40, 64);
            assert!(coarse.iter().zip(&fine).all(|(a, b)| (a - b).norm() < 1e-10));
            let other = flown(&mut Wind::new(&stormy(shared), 3, 6), 40, 1);
            assert!(coarse.iter().zip(&other).all(|(a, b)| (a - b).norm() > 1e-6));
        }
    }

    #[test]
    fn undoing_halving_and_cloning_steps_keep_the_wind() {
        let (mut straight, mut halting) = (Wind::new(&stormy(false), 3, 1), Wind::new(&stormy(false), 3, 1));
        let mut copy = straight.clone();
        for step in 0..200 {
            straight.advance(0.03125);
            halting.advance(0.03125);
            halting.undo();
            halting.advance(0.015_625);
            let between = halting.air_m_s(2);
            assert_eq!(straight.air_at_m_s(2, halting.now_s()), between);
            halting.advance(0.015_625);
            assert_eq!(straight.air_m_s(2), halting.air_m_s(2), "{step}");
            if step == 100 {
                copy = straight.clone();
            }
        }
        (101..200).for_each(|_| copy.advance(0.03125));
        assert_eq!(copy.air_m_s(0), straight.air_m_s(0));
        copy.reseed(9);
        assert_eq!(copy.air_m_s(0), straight.air_m_s(0), "from where it is");
        copy.advance(1.0);
        straight.advance(1.0);
        assert!((copy.air_m_s(0) - straight.air_m_s(0)).norm() > 1e-6);
    }

    #[test]
    fn turbulence_is_shared_or_separate() {
        for shared in [true, false] {
            let mut wind = Wind::new(&stormy(shared), 3, 5);
            wind.advance(0.7);
            let apart_m_s = (wind.air_m_s(0) - wind.air_m_s(2)).norm();
            assert_eq!(apart_m_s == 0.0, shared);
            let mut channel = Wind::channel();
            wind.write_channel(&mut channel);
            assert_eq!(channel.values[6..], wind.air_m_s(2).as_slice()[..]);
        }
    }
}
