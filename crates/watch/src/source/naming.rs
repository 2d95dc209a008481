//! Vehicles and frames of poses that arrive on topics.

use std::collections::BTreeMap;

use super::OwnedPose;
use tautline_core::option::{FRAME, ORIGIN, TOPIC};
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

    /// Returns the pose of a vehicle; `None` for a transform in another frame.
    ///
    /// A name in the message is the name of the vehicle. Otherwise the name is the topic without its last part, such
    /// as `cf1` of `/cf1/pose`.
    ///
    /// # Errors
    /// A sentence if the pose has no stamp, is in another frame, or its vehicle has another topic, too.
    pub fn pose(&mut self, topic: &str, of: LivePose) -> Result<Option<OwnedPose>, String> {
        if of.stamp_ns == 0 {
            return Err(format!("{topic}: the message has no stamp, so its age is unknown; set header.stamp"));
        }
        let position_m = if of.is_on_earth {
            let Some(earth) = &self.options.earth else {
                let origin = ORIGIN.set("LAT,LON,HEIGHT");
                return Err(format!("{topic}: the positions are on the Earth; set {origin}"));
            };
            earth.position_m(of.position.into())?
        } else {
            if of.is_transform && self.options.frame.is_none() {
                let example = FRAME.set("world");
                return Err(format!("{topic}: transforms have several frames; set {FRAME}, such as {example}"));
            }
            let frame = self.frame.get_or_insert_with(|| of.frame.clone());
            if *frame != of.frame {
                let problem = || format!("{topic}: the position is in frame {:?}, others in {frame:?}", of.frame);
                return if of.is_transform {
                    Ok(None)
                } else {
                    Err(format!("{}; give the topics of one frame with {TOPIC}", problem()))
                };
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

    fn check_topic(&mut self, base: &str, topic: &str) -> Result<(), String> {
        match self.topics.get(base) {
            Some(own) if own == topic => Ok(()),
            Some(own) => {
                Err(format!("{topic}: vehicle {base:?} has the topic {own}, too; give one of them with {TOPIC}"))
            }
            None if self.topics.len() >= MOST_TOPICS => Err(format!("{topic}: more than {MOST_TOPICS} topics")),
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

    use super::{Naming, NamingOptions};
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
        let found = naming.pose("/cf1/pose", pose("world", None, false)).expect("a pose").expect("a vehicle");
        assert_eq!((found.id.as_str(), found.t_s), ("cf1", 1.5));
        for (topic, of) in [
            ("/cf1/odom", pose("world", None, false)),
            ("/cf2/pose", pose("map", None, false)),
            ("/tf", pose("world", Some("cf3"), true)),
            ("/cf1/pose", LivePose { stamp_ns: 0, ..pose("world", None, false) }),
            ("/cf4/fix", LivePose { is_on_earth: true, ..pose("WGS 84", None, false) }),
        ] {
            assert!(naming.pose(topic, of.clone()).is_err(), "{topic} {of:?}");
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
