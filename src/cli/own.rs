//! What a recording of `tautline run` says of itself beside positions.

use std::collections::BTreeMap;
use std::path::Path;

use crate::audit::recorded::{Told, ToldViolation};
use crate::record::Event;
use crate::record::mcap::{Entry, McapRecording};
use crate::scenario::{self, PlantSpec, Scenario};

/// A recording of ours.
pub(super) struct OwnRecording {
    /// Its safety distance \[m\].
    pub(super) delta_m: f64,
    /// What it says of the time between its samples, in order of time; nothing where it holds every step that was flown.
    pub(super) told: Vec<Told>,
    /// The times that it says a pair was too close in, but for one that lasts to its end: its last sample shows that.
    pub(super) violations: Vec<ToldViolation>,
    /// Whether it holds every step that was flown, and every step was straight.
    pub(super) has_every_step: bool,
    /// Most steps between two of its samples.
    pub(super) most_steps: u64,
    /// The law that was flown, where it is not the scenario's.
    other_law: Option<String>,
}

impl OwnRecording {
    /// Reads it; `None` where the file is none of ours, or is damaged, which reading its positions tells better. `scale` is
    /// what its lengths are multiplied by.
    pub(super) fn read(path: &Path, scale: f64) -> Option<Self> {
        let recording = path.is_file().then(|| McapRecording::open(path).ok()).flatten()?;
        let header = recording.header();
        let text = header.scenario_toml.clone();
        let source = scenario::Source::Text { name: header.scenario_name.clone(), text };
        let is_straight =
            Scenario::read(&source, &[]).is_ok_and(|scenario| matches!(scenario.plant, PlantSpec::Rapier(_)));
        let mut own = Self {
            delta_m: header.delta_m * scale,
            told: Vec::new(),
            violations: Vec::new(),
            has_every_step: is_straight,
            most_steps: 0,
            other_law: None,
        };
        let mut before: Option<(u64, f64)> = None;
        let mut began_s = BTreeMap::new();
        for entry in recording {
            match entry.ok()? {
                Entry::Sample(sample) => {
                    let (step, from_s) = before.unwrap_or((sample.step, sample.time_s));
                    own.most_steps = own.most_steps.max(sample.step.saturating_sub(step));
                    own.told.extend(sample.separation.map(|mut closest| {
                        closest.separation_m *= scale;
                        Told { from_s, to_s: sample.time_s, closest }
                    }));
                    before = Some((sample.step, sample.time_s));
                }
                Entry::Event(Event::StepRefined { .. }) => own.has_every_step = false,
                Entry::Event(Event::ViolationBegan { pair, time_s }) => _ = began_s.insert(pair, time_s),
                Entry::Event(Event::ViolationEnded { pair, time_s, min_m }) => {
                    let from_s = began_s.remove(&pair).unwrap_or(time_s);
                    let (min_m, limit_m) = (min_m * scale, own.delta_m);
                    own.violations.push(ToldViolation { pair, from_s, to_s: time_s, min_m, limit_m });
                }
                Entry::Event(Event::OtherLaw { name, .. }) => own.other_law = Some(name),
                Entry::Event(_) => {}
            }
        }
        own.has_every_step &= own.most_steps <= 1;
        if own.has_every_step {
            own.told.clear();
            own.violations.clear();
        }
        Some(own)
    }

    /// What a person should know about how it was flown and is judged.
    pub(super) fn notes(&self) -> impl Iterator<Item = String> {
        let steps = self.most_steps;
        let between = (!self.has_every_step).then(|| {
            format!(
                "up to {steps} steps were flown between two samples: the closest approach that the run saw there counts"
            )
        });
        let law = self.other_law.as_ref().map(|name| format!("flown under the law {name}, and not the scenario's"));
        law.into_iter().chain(between)
    }
}
