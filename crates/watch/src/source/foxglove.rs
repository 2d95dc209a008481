//! Client of the Foxglove WebSocket protocol, as `foxglove_bridge` and the Foxglove SDK serve it.
//!
//! The `foxglove` crate has a server only, so this is a client over `tungstenite`. Messages are decoded as those of a
//! recording: ROS 2 in CDR, and Foxglove in protobuf and JSON.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::{Value, json};

use super::websocket::{Incoming, Protocol, websocket};
use super::{Feed, Input, Naming, NamingOptions};
use crate::event::{MessageError, Problem};
use tautline_recordings::read::{has_live_poses, live_poses};

/// First byte of a message of a subscription, which has 12 more bytes before its data: subscription and time.
const MESSAGE_DATA: u8 = 1;
/// Largest number of subscriptions.
const MOST_CHANNELS: usize = 10_000;

/// Connects to a Foxglove server and subscribes to all topics with positions, or to those of the options.
///
/// # Errors
/// A sentence if the address is wrong.
pub fn foxglove(url: &str, options: NamingOptions, feed: Feed) -> Result<(), String> {
    websocket(url, feed, Client { channels: BTreeMap::new(), naming: Naming::new(options) })
}

struct Client {
    channels: BTreeMap<u32, Channel>,
    naming: Naming,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Channel {
    id: u32,
    topic: String,
    encoding: String,
    schema_name: String,
}

impl Protocol for Client {
    fn names(&self) -> &'static [&'static str] {
        &["foxglove.sdk.v1", "foxglove.websocket.v1"]
    }

    fn start(&mut self) -> Vec<String> {
        self.channels.clear();
        Vec::new()
    }

    fn take(&mut self, message: Incoming<'_>, arrival_s: f64, inputs: &mut Vec<Input>) -> Vec<String> {
        let garbage =
            |place: &str, problem| Input::Garbage(MessageError { place: place.to_owned(), problem }, arrival_s);
        match message {
            Incoming::Text(text) => match serde_json::from_str::<Value>(text) {
                Ok(of) => return self.answer(&of),
                Err(error) => inputs.push(garbage("foxglove", Problem::NotDecoded(error.to_string()))),
            },
            Incoming::Binary([MESSAGE_DATA, rest @ ..]) => {
                let found = rest.split_first_chunk::<4>().zip(rest.get(12..));
                let channel = found
                    .and_then(|((id, _), data)| Some((self.channels.get(&u32::from_le_bytes(*id))?.clone(), data)));
                let Some((channel, data)) = channel else {
                    inputs.push(garbage("foxglove", Problem::NoSubscription));
                    return Vec::new();
                };
                match live_poses(&channel.schema_name, &channel.encoding, data) {
                    Ok(poses) => {
                        inputs.extend(
                            poses.into_iter().filter_map(|of| self.naming.input(&channel.topic, of, arrival_s)),
                        );
                    }
                    Err(why) => inputs.push(garbage(&channel.topic, Problem::NotDecoded(why))),
                }
            }
            // Times and answers of services.
            Incoming::Binary(_) => {}
        }
        Vec::new()
    }
}

impl Client {
    /// Returns the subscriptions to new channels with positions.
    fn answer(&mut self, of: &Value) -> Vec<String> {
        if of["op"] == "unadvertise" {
            for id in of["channelIds"].as_array().into_iter().flatten() {
                self.channels.retain(|own, _| Some(u64::from(*own)) != id.as_u64());
            }
        }
        let channels = of["channels"].as_array().filter(|_| of["op"] == "advertise");
        let mut subscriptions = Vec::new();
        for channel in channels.into_iter().flatten() {
            // A channel of another form has no positions.
            let Ok(channel) = Channel::deserialize(channel) else { continue };
            let is_wanted =
                has_live_poses(&channel.schema_name, &channel.encoding) && self.naming.reads(&channel.topic);
            if is_wanted && self.channels.len() < MOST_CHANNELS {
                subscriptions.push(json!({ "id": channel.id, "channelId": channel.id }));
                self.channels.insert(channel.id, channel);
            }
        }
        if subscriptions.is_empty() {
            return Vec::new();
        }
        vec![json!({ "op": "subscribe", "subscriptions": subscriptions }).to_string()]
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use std::collections::BTreeMap;

    use super::{Client, Incoming, Protocol as _};
    use crate::source::{Input, Naming, NamingOptions};

    #[test]
    fn a_channel_with_positions_is_subscribed_and_decoded() {
        let mut client = Client { channels: BTreeMap::new(), naming: Naming::new(NamingOptions::default()) };
        let mut inputs = Vec::new();
        let advertise = r#"{"op":"advertise","channels":[
            {"id":4,"topic":"/a/pose","encoding":"json","schemaName":"foxglove.PoseInFrame","schema":""},
            {"id":5,"topic":"/log","encoding":"json","schemaName":"foxglove.Log","schema":""}]}"#;
        let replies = client.take(Incoming::Text(advertise), 0.0, &mut inputs);
        let expected = r#"{"op":"subscribe","subscriptions":[{"channelId":4,"id":4}]}"#;
        assert_eq!((replies, inputs.len()), (vec![expected.to_owned()], 0));
        let json = br#"{"timestamp":{"sec":2,"nsec":0},"frame_id":"w","pose":{"position":{"x":1,"y":2,"z":3}}}"#;
        let data = [&[1, 4, 0, 0, 0][..], &[0; 8], json].concat();
        client.take(Incoming::Binary(&data), 9.0, &mut inputs);
        let [Input::Pose(pose, 9.0)] = &inputs[..] else { panic!("{inputs:?}") };
        assert_eq!((pose.id.as_str(), pose.t_s, pose.position_m), ("a", 2.0, Vector3::new(1.0, 2.0, 3.0)));
        // Damage of any kind is an error of the input.
        for wrong in [&[1_u8][..], &[1, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], &data[..data.len() - 1]] {
            inputs.clear();
            client.take(Incoming::Binary(wrong), 9.0, &mut inputs);
            assert!(matches!(inputs[..], [Input::Garbage(..)]), "{wrong:?}");
        }
    }
}
