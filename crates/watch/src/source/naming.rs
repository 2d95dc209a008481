//! Vehicles and frames of poses that arrive on topics.

use std::collections::BTreeMap;

use super::{Input, OwnedPose};
use crate::event::{MessageError, Problem};
use tautline_recordings::read::{EarthFrame, LivePose};

/// Options for poses of topics.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NamingOptions {
    /// Topics to read; all with positions if empty.
    pub topics: Vec<String>,
    /// Frame of the positions; the first one if absent. Transforms need it.
    pub frame: Option<String>,
    /// Origin of places on the Earth.
    pub earth: Option<EarthFrame>,
}

/// Names the vehicles of topics and keeps all positions in one frame.
#[derive(Clone, Debug)]
pub struct Naming {
    options: NamingOptions,
    frame: Option<String>,
    /// Topic of each vehicle that is named by its topic.
    topics: BTreeMap<String, String>,
}

/// Largest number of vehicles that are named by their topics.
const MOST_TOPICS: usize = 10_000;

impl Naming {
    /// Returns a naming without vehicles.
    #[must_use]
    pub fn new(options: NamingOptions) -> Self {
        let frame = options.frame.clone();
        Self { options, frame, topics: BTreeMap::new() }
    }

    /// Returns whether a topic is read.
    #[must_use]
    pub fn reads(&self, topic: &str) -> bool {
        self.options.topics.is_empty() || self.options.topics.iter().any(|of| of == topic)
    }

    /// Returns the pose of a vehicle that arrived at a time \[s\], or the error of its message; `None` for a transform
    /// in another frame.
    ///
    /// A name in the message is the name of the vehicle. Otherwise the name is the topic without its last part, such
    /// as `cf1` of `/cf1/pose`.
    pub fn input(&mut self, topic: &str, of: LivePose, arrival_s: f64) -> Option<Input> {
        match self.pose(topic, of) {
            Ok(pose) => Some(Input::Pose(pose?, arrival_s)),
            Err(problem) => Some(Input::Garbage(MessageError { place: topic.to_owned(), problem }, arrival_s)),
        }
    }

    fn pose(&mut self, topic: &str, of: LivePose) -> Result<Option<OwnedPose>, Problem> {
        if of.stamp_ns == 0 {
            return Err(Problem::NoStamp);
        }
        let position_m = if of.is_on_earth {
            let earth = self.options.earth.as_ref().ok_or(Problem::NoOrigin)?;
            earth.position_m(of.position.into()).map_err(Problem::NotDecoded)?
        } else {
            if of.is_transform && self.options.frame.is_none() {
                return Err(Problem::NoFrame);
            }
            let frame = self.frame.get_or_insert_with(|| of.frame.clone());
            if *frame != of.frame {
                let others = frame.clone();
                return if of.is_transform { Ok(None) } else { Err(Problem::OtherFrame([of.frame, others])) };
            }
            of.position
        };
        let id = match (of.name, of.number) {
            (Some(name), _) => name,
            (None, number) => {
                let whole = topic.trim_matches('/');
                let base = whole.rsplit_once('/').map_or(whole, |(base, _)| base);
                self.check_topic(base, topic)?;
                number.map_or_else(|| base.to_owned(), |number| format!("{base}/{number}"))
            }
        };
        let t_s = of.stamp_ns as f64 * 1e-9;
        Ok(Some(OwnedPose { t_s, id, position_m, velocity_m_s: None, accuracy_m: of.accuracy_m }))
    }

    fn check_topic(&mut self, base: &str, topic: &str) -> Result<(), Problem> {
        match self.topics.get(base) {
            Some(own) if own == topic => Ok(()),
            Some(own) => Err(Problem::OtherTopic([base.to_owned(), own.clone()])),
            None if self.topics.len() >= MOST_TOPICS => Err(Problem::TooManyTopics),
            None => {
                self.topics.insert(base.to_owned(), topic.to_owned());
                Ok(())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::{Input, Naming, NamingOptions};
    use tautline_recordings::read::LivePose;

    fn pose(frame: &str, name: Option<&str>, is_transform: bool) -> LivePose {
        LivePose {
            name: name.map(str::to_owned),
            number: None,
            frame: frame.to_owned(),
            stamp_ns: 1_500_000_000,
            position: Vector3::x(),
            accuracy_m: None,
            is_on_earth: false,
            is_transform,
        }
    }

    #[test]
    fn a_topic_names_one_vehicle_in_one_frame() {
        let mut naming = Naming::new(NamingOptions::default());
        let Some(Input::Pose(found, 7.0)) = naming.input("/cf1/pose", pose("world", None, false), 7.0) else {
            panic!("a pose")
        };
        assert_eq!((found.id.as_str(), found.t_s), ("cf1", 1.5));
        for (topic, of) in [
            ("/cf1/odom", pose("world", None, false)),
            ("/cf2/pose", pose("map", None, false)),
            ("/tf", pose("world", Some("cf3"), true)),
            ("/cf1/pose", LivePose { stamp_ns: 0, ..pose("world", None, false) }),
            ("/cf4/fix", LivePose { is_on_earth: true, ..pose("WGS 84", None, false) }),
        ] {
            assert!(matches!(naming.input(topic, of.clone(), 7.0), Some(Input::Garbage(..))), "{topic} {of:?}");
        }
    }

    #[test]
    fn transforms_of_other_frames_are_no_vehicles() {
        let mut naming = Naming::new(NamingOptions { frame: Some("world".to_owned()), ..NamingOptions::default() });
        let found = naming.pose("/tf", pose("world", Some("cf3"), true)).expect("a pose").expect("a vehicle");
        assert_eq!(found.id, "cf3");
        assert_eq!(naming.pose("/tf", pose("cf3", Some("camera"), true)), Ok(None));
    }
}
