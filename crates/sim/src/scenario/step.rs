//! The step that a law asks for wherever vehicles are, and the one that is chosen where none is given.

use super::limits::{MAX_HALVINGS, MAX_STEPS};
use super::spec::Scenario;
use super::time::TimeSpec;
use tautline_laws::law::{Law, LawSpec, RateQuery};

impl TimeSpec {
    /// What a step times the law's fastest rate may be where the flight is the law's motion: as asked, and no more than keeps its
    /// energy.
    #[must_use]
    pub fn honest_rate_dt(&self) -> f64 {
        self.max_rate_dt.min(Self::DEFAULT_MAX_RATE_DT)
    }

    /// The shortest part of a step \[s\].
    #[must_use]
    pub fn shortest_step_s(&self) -> f64 {
        self.dt_s * 0.5_f64.powi(i32::try_from(self.max_halvings).unwrap_or(i32::MAX))
    }
}

impl Scenario {
    /// Longest step that a law's links ask for, wherever vehicles are \[s\]. Continuous time chooses its own.
    #[must_use]
    pub fn links_step_s(&self, law: &dyn Law) -> Option<f64> {
        let rate_per_s =
            law.rates(&RateQuery::new(self.velocity_coefficient_per_s(), Some(f64::INFINITY))).fastest_per_s?;
        (self.plant.holds_commands() && rate_per_s > 0.0).then(|| self.time.honest_rate_dt() / rate_per_s)
    }

    /// Halves a step that nobody gave until it can be made as short as the links of the law ask for. It stays where shorter ones are
    /// of no use: where the law is asked less often than that, and where a flight may not have so many parts of steps. What is wrong
    /// with law or times is left for [`super::validate`] to refuse.
    pub(super) fn choose_step(&mut self) {
        let Ok(law) = self.law() else { return };
        let Some(needed_s) = self.links_step_s(law.as_ref()).filter(|&needed_s| needed_s > 0.0) else { return };
        let is_asked_in_time = self.time.control_hz.is_none_or(|control_hz| control_hz * needed_s >= 1.0);
        if !is_asked_in_time {
            return;
        }
        let mut chosen = self.time;
        while chosen.shortest_step_s() > needed_s {
            chosen.dt_s *= 0.5;
        }
        if chosen.duration_s <= MAX_STEPS * chosen.shortest_step_s() {
            self.time = chosen;
        }
    }

    /// Raises the number of halvings until the shortest part of a step resolves the potential field at the certified distance.
    ///
    /// The certificate assigns the whole energy of the start to one pair. Links of a large gain drive pairs close to the
    /// certified distance.
    pub(super) fn choose_halvings(&mut self) {
        let LawSpec::Potential(_) = self.law else { return };
        let Ok(law) = self.law() else { return };
        let certified_m = self.certificate(law.as_ref()).certified_m;
        let query = RateQuery::new(self.velocity_coefficient_per_s(), certified_m);
        let Some(rate_per_s) = law.rates(&query).fastest_per_s else { return };
        while self.time.max_halvings < MAX_HALVINGS
            && self.time.shortest_step_s() * rate_per_s > self.time.honest_rate_dt()
        {
            self.time.max_halvings += 1;
        }
    }
}
