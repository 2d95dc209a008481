//! Server for Foxglove: a scene of the vehicles, a log, and the status as JSON, over the Foxglove WebSocket protocol.
//!
//! | topic | schema | content |
//! | --- | --- | --- |
//! | `/watch/scene` | `foxglove.SceneUpdate` | a sphere per vehicle, and lines between pairs in alarm |
//! | `/watch/log` | `foxglove.Log` | changes of state and all other notices |
//! | `/watch/status` | JSON | the present state with its numbers |
//!
//! The protocol has no token, so the server serves this machine only. Publishing never blocks: messages wait in a queue
//! per client, and a client that reads too slowly loses the oldest ones.

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use ::foxglove::messages::{
    Color, LinePrimitive, Log, Point3, Pose, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive, Timestamp, Vector3,
    line_primitive, log,
};
use ::foxglove::{Channel, ChannelBuilder, Context, FoxgloveError, RawChannel, Schema, WebSocketServer, messages};

use crate::event::{Assessment, Pair};
use crate::monitor::Monitor;
use crate::notice::{Notice, Statement};
use tautline_audit::Status;

/// Time between two scenes of an unchanged state.
const SCENE_PERIOD: Duration = Duration::from_millis(100);
/// Time after which a client removes a scene that is not replaced \[s\].
const LIFETIME_S: u32 = 1;
/// Largest number of messages that wait for a client.
const MOST_WAITING: usize = 256;
/// Largest number of lines of a scene.
const MOST_LINES: usize = 1000;
/// Width of a line \[m\].
const LINE_M: f64 = 0.05;

/// Opacity of a sphere, whose radius is half of delta.
const OPACITY: f64 = 0.6;
const CLEAR: [f64; 3] = [0.2, 0.7, 0.4];
const UNDECIDED: [f64; 3] = [0.9, 0.7, 0.2];
const ALARM: [f64; 3] = [0.9, 0.15, 0.15];
const AHEAD: [f64; 3] = [1.0, 0.5, 0.1];
const STALE: [f64; 3] = [0.5, 0.5, 0.5];

/// Schema of `/watch/status`.
const STATUS_SCHEMA: &str = include_str!("status_schema.json");

/// Server for Foxglove. It ends with the process.
pub struct FoxgloveServer {
    address: SocketAddr,
    frame: String,
    scene: Channel<SceneUpdate>,
    log: Channel<Log>,
    status: Arc<RawChannel>,
    /// Time of the last scene.
    shown: Option<Instant>,
    /// Status of the last scene, and of the last log message of a state.
    statuses: [Option<Status>; 2],
    /// Keeps the channels open.
    _context: Arc<Context>,
}

impl FoxgloveServer {
    /// Serves on an address of this machine. `frame` is the frame of the positions.
    ///
    /// # Errors
    /// If the address is not one of this machine, or cannot be bound.
    pub fn serve(address: SocketAddr, frame: &str) -> io::Result<Self> {
        if !address.ip().is_loopback() {
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the protocol of Foxglove has no token"));
        }
        let context = Context::new();
        let channel = |topic| ChannelBuilder::new(topic).context(&context);
        let schema = Schema::new("tautline.WatchStatus", "jsonschema", STATUS_SCHEMA.as_bytes());
        let status = channel("/watch/status").message_encoding("json").schema(schema).build_raw().map_err(of_server)?;
        let host = if address.is_ipv6() { format!("[{}]", address.ip()) } else { address.ip().to_string() };
        let handle = WebSocketServer::new()
            .name("tautline watch")
            .bind(host, address.port())
            .message_backlog_size(MOST_WAITING)
            .context(&context)
            .start_blocking()
            .map_err(of_server)?;
        Ok(Self {
            address: SocketAddr::new(address.ip(), handle.port()),
            frame: frame.to_owned(),
            scene: channel("/watch/scene").build(),
            log: channel("/watch/log").build(),
            status,
            shown: None,
            statuses: [None; 2],
            _context: context,
        })
    }

    /// Returns the address to open in Foxglove.
    #[must_use]
    pub fn url(&self) -> String {
        format!("ws://{}", self.address)
    }

    /// Publishes a notice as a log message. A state is published when it changes.
    pub fn notice(&mut self, notice: &Notice) {
        if notice.event == "state" && self.statuses[1].replace(notice.status) == Some(notice.status) {
            return;
        }
        let level = match notice.status {
            Status::Violation => log::Level::Error,
            Status::Undecided => log::Level::Warning,
            Status::Clear => log::Level::Info,
        };
        self.log.log(&Log {
            timestamp: Some(Timestamp::now()),
            level: level.into(),
            message: notice.text.clone(),
            name: "tautline watch".to_owned(),
            ..Log::default()
        });
    }

    /// Publishes the scene and the status of a judgement, each 0.1 s and when the state changes.
    pub fn assessed(&mut self, of: &Assessment, monitor: &Monitor) {
        let status = of.state.status();
        let is_due = self.shown.is_none_or(|last| last.elapsed() >= SCENE_PERIOD);
        if !is_due && self.statuses[0] == Some(status) {
            return;
        }
        (self.shown, self.statuses[0]) = (Some(Instant::now()), Some(status));
        if self.scene.has_sinks() {
            self.scene.log(&scene(of, monitor, &self.frame));
        }
        if self.status.has_sinks() {
            self.status.log(Notice::new(Statement::State(of), monitor).json.to_string().as_bytes());
        }
    }
}

fn of_server(error: FoxgloveError) -> io::Error {
    match error {
        FoxgloveError::Bind(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

/// Returns a sphere per present vehicle, and lines between pairs in violation and on course to violate.
fn scene(of: &Assessment, monitor: &Monitor, frame: &str) -> SceneUpdate {
    let place = |k: u32| monitor.newest(k as usize).map(|(at, ..)| Point3 { x: at.x, y: at.y, z: at.z });
    let mut alarms: Vec<Pair> = monitor.open_violations().map(|of| of.pair).chain(of.state.violated()).collect();
    alarms.sort_unstable();
    alarms.dedup();
    let mut in_alarm: Vec<u32> = alarms.iter().flatten().copied().collect();
    in_alarm.sort_unstable();
    let own = if of.state.status() == Status::Clear { CLEAR } else { UNDECIDED };
    let now = Timestamp::now();
    let entity = |id: String| SceneEntity {
        timestamp: Some(now),
        frame_id: frame.to_owned(),
        id,
        lifetime: Some(messages::Duration::new(i32::try_from(LIFETIME_S).unwrap_or(1), 0)),
        ..SceneEntity::default()
    };
    let side = monitor.settings().delta_m;
    let vehicles = monitor.names().iter().zip(0_u32..).filter(|(_, k)| !monitor.has_signed_off(*k as usize));
    let mut entities: Vec<SceneEntity> = vehicles
        .filter_map(|(name, k)| {
            let at = place(k)?;
            let shown = match () {
                () if in_alarm.binary_search(&k).is_ok() => ALARM,
                () if monitor.is_stale(k as usize) => STALE,
                () => own,
            };
            let sphere = SpherePrimitive {
                pose: Some(pose(Vector3 { x: at.x, y: at.y, z: at.z })),
                size: Some(Vector3 { x: side, y: side, z: side }),
                color: Some(colour(shown, OPACITY)),
            };
            Some(SceneEntity { spheres: vec![sphere], ..entity(format!("vehicle/{name}")) })
        })
        .collect();
    let ahead = of.nominal_violation.map(|of| of.pair).filter(|pair| alarms.binary_search(pair).is_err());
    let lines = alarms.iter().map(|&pair| (pair, ALARM)).chain(ahead.map(|pair| (pair, AHEAD)));
    let mut list = LinePrimitive {
        r#type: line_primitive::Type::LineList.into(),
        pose: Some(pose(Vector3::default())),
        thickness: LINE_M,
        ..LinePrimitive::default()
    };
    for (pair, shown) in lines.take(MOST_LINES) {
        if let [Some(a), Some(b)] = pair.map(place) {
            list.points.extend([a, b]);
            list.colors.extend([colour(shown, 1.0); 2]);
        }
    }
    // An entity without lines replaces the lines of the last scene.
    let lines = Some(list).filter(|list| !list.points.is_empty()).into_iter().collect();
    entities.push(SceneEntity { lines, ..entity("alarms".to_owned()) });
    SceneUpdate { deletions: Vec::new(), entities }
}

fn pose(position: Vector3) -> Pose {
    Pose { position: Some(position), orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }) }
}

fn colour([r, g, b]: [f64; 3], a: f64) -> Color {
    Color { r, g, b, a }
}
