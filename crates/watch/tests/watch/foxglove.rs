//! The server for Foxglove, seen by a client of the Foxglove WebSocket protocol.

use std::collections::BTreeMap;
use std::io;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use foxglove::Decode as _;
use foxglove::messages::{Log, SceneUpdate, log::Level};
use nalgebra::Vector3;
use serde_json::{Value, json};
use tungstenite::client::IntoClientRequest as _;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{ClientRequestBuilder, Message, WebSocket};

use crate::{monitor, settings};
use tautline_watch::foxglove_server::FoxgloveServer;
use tautline_watch::source::{Input, OwnedPose, channel};
use tautline_watch::{Assessment, Bound, Monitor, Notice, Output, Settings, Status, watch};

/// Longest wait on a slow machine.
const PATIENCE: Duration = Duration::from_mins(1);

struct Published(FoxgloveServer);

impl Output for Published {
    fn notice(&mut self, notice: &Notice) -> io::Result<()> {
        self.0.notice(notice);
        Ok(())
    }

    fn assessed(&mut self, of: &Assessment, monitor: &Monitor) -> io::Result<()> {
        self.0.assessed(of, monitor);
        Ok(())
    }
}

fn serve() -> FoxgloveServer {
    FoxgloveServer::serve("127.0.0.1:0".parse().expect("an address"), "map").expect("serves")
}

/// Client that is subscribed to all three topics; the subscription is the number of the channel.
struct Client {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    topics: BTreeMap<u32, String>,
}

enum Received {
    Scene(SceneUpdate),
    Log(Log),
    Status(Value),
}

impl Client {
    fn connect(url: &str) -> Self {
        let request = ClientRequestBuilder::new(url.parse().expect("an address")).with_sub_protocol("foxglove.sdk.v1");
        let (socket, _) = tungstenite::connect(request.into_client_request().expect("a request")).expect("connects");
        let mut client = Self { socket, topics: BTreeMap::new() };
        let mut kinds = Vec::new();
        while client.topics.len() < 3 {
            let Message::Text(text) = client.socket.read().expect("a message") else { continue };
            let of: Value = serde_json::from_str(&text).expect("JSON");
            for channel in of["channels"].as_array().into_iter().flatten() {
                let text = |key: &str| channel[key].as_str().expect(key).to_owned();
                client
                    .topics
                    .insert(u32::try_from(channel["id"].as_u64().expect("an id")).expect("small"), text("topic"));
                kinds.push([text("topic"), text("encoding"), text("schemaName")]);
            }
        }
        kinds.sort();
        let expected = [
            ["/watch/log", "protobuf", "foxglove.Log"],
            ["/watch/scene", "protobuf", "foxglove.SceneUpdate"],
            ["/watch/status", "json", "tautline.WatchStatus"],
        ];
        assert_eq!(kinds, expected.map(|of| of.map(str::to_owned)));
        let ids: Vec<_> = client.topics.keys().map(|id| json!({ "id": id, "channelId": id })).collect();
        let subscribe = json!({ "op": "subscribe", "subscriptions": ids }).to_string();
        client.socket.send(Message::text(subscribe)).expect("sends");
        client
    }

    fn next(&mut self) -> Received {
        loop {
            let Message::Binary(bytes) = self.socket.read().expect("a message") else { continue };
            let Some((&1, rest)) = bytes.split_first() else { continue };
            let (id, data) = (u32::from_le_bytes(rest[..4].try_into().expect("four")), &rest[12..]);
            return match self.topics[&id].as_str() {
                "/watch/scene" => Received::Scene(SceneUpdate::decode(data).expect("a scene")),
                "/watch/log" => Received::Log(Log::decode(data).expect("a log message")),
                _ => Received::Status(serde_json::from_slice(data).expect("JSON")),
            };
        }
    }
}

/// Watches `a` and `b`, which rest at this distance, until the state was published ten times; returns the last scene,
/// all log messages and the last status.
fn watched(gap_m: f64) -> (SceneUpdate, Vec<Log>, Value) {
    let server = serve();
    let mut client = Client::connect(&server.url());
    let stop = Arc::new(AtomicBool::new(false));
    let (feed, inputs) = channel(Arc::clone(&stop));
    let watching = std::thread::spawn(move || {
        watch(monitor(Settings { max_age_s: Bound::declared(10.0), ..settings() }), &inputs, &mut Published(server))
            .expect("watches")
    });
    // The first status shows that the subscription is served.
    while !matches!(client.next(), Received::Status(_)) {}
    let over = Arc::clone(&stop);
    let sender = std::thread::spawn(move || {
        while !over.load(Ordering::Relaxed) {
            let t_s = feed.now_s();
            for (id, x) in [("a", 0.0), ("b", gap_m)] {
                let pose = OwnedPose {
                    t_s,
                    id: id.to_owned(),
                    position_m: Vector3::new(x, 0.0, 2.0),
                    velocity_m_s: Some(Vector3::zeros()),
                    accuracy_m: None,
                };
                if !feed.send(Input::Pose(pose, t_s)) {
                    return;
                }
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    });
    let (mut scene, mut logs, mut status, mut count) = (SceneUpdate::default(), Vec::new(), Value::Null, 0);
    while count < 10 {
        match client.next() {
            Received::Scene(of) => scene = of,
            Received::Log(of) => logs.push(of),
            Received::Status(of) => {
                count += u32::from(of["heard"] == 2);
                status = of;
            }
        }
    }
    stop.store(true, Ordering::Relaxed);
    watching.join().expect("ends");
    sender.join().expect("ends");
    (scene, logs, status)
}

/// Returns the places on x, the sizes and whether the red part is the largest one, of all spheres.
fn spheres(scene: &SceneUpdate) -> Vec<(String, f64, f64, bool)> {
    let with_spheres = scene.entities.iter().filter(|entity| !entity.spheres.is_empty());
    with_spheres
        .map(|entity| {
            assert_eq!((entity.frame_id.as_str(), entity.spheres.len()), ("map", 1));
            assert!(entity.timestamp.is_some() && entity.lifetime.is_some());
            let sphere = &entity.spheres[0];
            let (pose, size, color) = (sphere.pose, sphere.size.expect("a size"), sphere.color.expect("a colour"));
            let at = pose.and_then(|pose| pose.position).expect("a position");
            (entity.id.clone(), at.x, size.x, color.r > color.g)
        })
        .collect()
}

#[test]
fn two_vehicles_too_close_are_a_red_scene_an_alarm_and_a_status() {
    let (scene, logs, status) = watched(0.4);
    let expected = [("vehicle/a", 0.0), ("vehicle/b", 0.4)].map(|(id, x)| (id.to_owned(), x, 1.0, true));
    assert_eq!(spheres(&scene), expected);
    let lines: Vec<_> = scene.entities.iter().flat_map(|entity| &entity.lines).collect();
    let [line] = lines[..] else { panic!("{lines:?}") };
    assert_eq!(line.points.iter().map(|at| [at.x, at.y, at.z]).collect::<Vec<_>>(), [[0.0, 0.0, 2.0], [0.4, 0.0, 2.0]]);
    // The start of the violation, and the state.
    assert!(logs.iter().filter(|of| of.level() == Level::Error).count() >= 2, "{logs:?}");
    assert_eq!((status["status"].as_str(), &status["clear_until"]), (Some("violation"), &Value::Null));
    assert!((status["closest"]["nominal_m"].as_f64().expect("a number") - 0.4).abs() < 1e-9, "{status}");
    assert_eq!(status["closest"]["subjects"], json!(["a", "b"]));
}

#[test]
fn two_vehicles_apart_are_a_green_scene_without_an_alarm() {
    let (scene, logs, status) = watched(6.0);
    let expected = [("vehicle/a", 0.0), ("vehicle/b", 6.0)].map(|(id, x)| (id.to_owned(), x, 1.0, false));
    assert_eq!(spheres(&scene), expected);
    assert!(scene.entities.iter().all(|entity| entity.lines.is_empty()));
    assert!(logs.iter().all(|of| of.level() != Level::Error), "{logs:?}");
    assert!(logs.iter().any(|of| of.level() == Level::Info), "{logs:?}");
    assert_eq!((status["status"].as_str(), &status["stale"]), (Some("clear"), &json!([])));
    assert!(status["clear_until"]["at_s"].as_f64() > status["t_s"].as_f64(), "{status}");
    // Each key of the schema is a key of the message, and the other way round.
    let schema: Value = serde_json::from_str(include_str!("../../src/status_schema.json")).expect("JSON");
    let keys =
        |of: &Value| of.as_object().expect("an object").keys().cloned().collect::<std::collections::BTreeSet<_>>();
    assert_eq!(keys(&schema["properties"]), keys(&status));
}

#[test]
fn a_client_that_does_not_read_blocks_nothing_and_loses_the_oldest_messages() {
    let mut server = serve();
    let mut client = Client::connect(&server.url());
    let mut monitor = monitor(settings());
    let of = monitor.assess(0.0);
    // The subscription is served once a status comes.
    let subscribed = std::thread::spawn(move || {
        while !matches!(client.next(), Received::Status(_)) {}
        client
    });
    let began = Instant::now();
    while !subscribed.is_finished() {
        assert!(began.elapsed() < PATIENCE, "the client receives no status");
        server.assessed(&of, &monitor);
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut client = subscribed.join().expect("a client");
    // 200 MB are more than the queue and the buffers of the connection hold.
    let text = "x".repeat(100_000);
    let notice =
        |k: u32| Notice { event: "lost", status: Status::Undecided, text: format!("{k} {text}"), json: json!({}) };
    let count = 2000;
    for k in 0..count {
        server.notice(&notice(k));
    }
    let mut received = Vec::new();
    while received.last() != Some(&(count - 1)) {
        if let Received::Log(of) = client.next() {
            received.push(of.message.split(' ').next().expect("a number").parse::<u32>().expect("a number"));
        }
    }
    assert!(received.is_sorted() && received.len() < count as usize, "{} messages", received.len());
}

#[test]
fn other_machines_are_not_served() {
    for address in ["0.0.0.0:0", "[::]:0", "192.0.2.1:0"] {
        let refused = FoxgloveServer::serve(address.parse().expect("an address"), "map").err().expect(address);
        assert_eq!(refused.kind(), io::ErrorKind::PermissionDenied);
    }
}
