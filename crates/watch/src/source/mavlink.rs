//! `MAVLink` 1 and 2 over UDP: `LOCAL_POSITION_NED` and `GLOBAL_POSITION_INT`.
//!
//! The system id is the name of a vehicle. Its positions come from one component. A second component with positions, or
//! two counts of messages of one component, are two vehicles with one system id.
//!
//! `GPS_RAW_INT` beside the positions reports the accuracy of the receiver: `h_acc` and `v_acc` are standard
//! deviations. They belong to the positions of the system for [`ACCURACY_S`]. `eph` and `epv` of `GPS_RAW_INT` and
//! `HIL_GPS` are dilutions of precision without a unit, so they bound nothing and are not read.
//!
//! The messages are defined in `common.xml` and `standard.xml`. `mavlink-core` reads frames and checksums. Messages
//! with another id are skipped.

use std::collections::BTreeMap;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;

use mavlink_core::{MAVLinkV1MessageRaw, MAVLinkV2MessageRaw};
use nalgebra::Vector3;
use socket2::SockRef;

use super::drops::KernelDrops;
use super::{Feed, Input, OwnedPose};
use crate::event::{Loss, MessageError, Problem};
use crate::streams::SequenceOrder;
use tautline_recordings::read::EarthFrame;

/// Message id, payload length without extensions, and extra byte of the checksum of `LOCAL_POSITION_NED`.
const LOCAL: (u32, usize, u8) = (32, 28, 185);
/// Message id, payload length and extra byte of `GLOBAL_POSITION_INT`.
const GLOBAL: (u32, usize, u8) = (33, 28, 104);
/// Message id, payload length without extensions, and extra byte of `GPS_RAW_INT`.
const RECEIVER: (u32, usize, u8) = (24, 30, 24);
/// Type of the fix of a receiver from which it has a position in space.
const FIX_IN_SPACE: u8 = 3;
/// Time for which an accuracy is used \[s\].
const ACCURACY_S: f64 = 5.0;
/// Largest number of bytes of a datagram.
const LARGEST_DATAGRAM: usize = 65_536;
/// Receive buffer of the socket, as far as the system gives it \[bytes\].
const RECEIVE_BUFFER: usize = 8 << 20;
/// Time between two checks for the end of the watch.
const POLL: Duration = Duration::from_millis(100);
/// Bit of the incompatibility flags of `MAVLink` 2 for a signature, whose 13 bytes follow the checksum.
const SIGNED: u8 = 1;

/// Message that positions are read from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MavlinkFrame {
    /// `LOCAL_POSITION_NED`: all vehicles must have the same local origin.
    Local,
    /// `GLOBAL_POSITION_INT`, in metres east, north and up of this origin.
    Global(EarthFrame),
}

/// Listens to datagrams on an address.
///
/// # Errors
/// If the address cannot be bound.
pub fn mavlink(address: SocketAddr, frame: MavlinkFrame, feed: Feed) -> io::Result<SocketAddr> {
    let socket = bind(address)?;
    let bound = socket.local_addr()?;
    std::thread::spawn(move || {
        let mut first = Some(socket);
        let mut reader = MavlinkReader::new(frame);
        feed.reconnect(&format!("mavlink:{bound}"), |connected| {
            let socket = match first.take().map_or_else(|| bind(bound), Ok) {
                Ok(socket) => socket,
                Err(error) => return Loss::Failed(error.to_string()),
            };
            connected();
            // A system keeps its count while the socket is lost.
            listen(&socket, &mut reader, &feed)
        });
    });
    Ok(bound)
}

/// Binds a socket with a large receive buffer.
fn bind(address: SocketAddr) -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind(address)?;
    socket.set_read_timeout(Some(POLL))?;
    // The system may give less, and counts what it drops.
    let _ = SockRef::from(&socket).set_recv_buffer_size(RECEIVE_BUFFER);
    Ok(socket)
}

/// Reads datagrams until the socket fails or the watch ends.
fn listen(socket: &UdpSocket, reader: &mut MavlinkReader, feed: &Feed) -> Loss {
    let mut bytes = vec![0; LARGEST_DATAGRAM];
    let mut inputs = Vec::new();
    let mut drops = KernelDrops::of(socket);
    while !feed.is_over() {
        feed.note_dropped(drops.new_drops());
        match socket.recv(&mut bytes) {
            Ok(length) => {
                inputs.clear();
                reader.take(&bytes[..length], feed.now_s(), &mut inputs);
                if !inputs.drain(..).all(|input| feed.offer(input)) {
                    break;
                }
            }
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Loss::Failed(error.to_string()),
        }
    }
    Loss::Closed
}

/// Sender of the positions of a system.
#[derive(Clone, Debug)]
struct Sender {
    component: u8,
    order: SequenceOrder,
}

/// Reader of datagrams, with the order of the messages and the accuracy of each system.
#[derive(Clone, Debug)]
pub struct MavlinkReader {
    frame: MavlinkFrame,
    senders: BTreeMap<u32, Sender>,
    /// Standard deviation of the receiver of each system \[m\], with its arrival \[s\].
    accuracies: BTreeMap<u32, (f64, f64)>,
}

/// Frame with a valid checksum, as far as its message is known.
struct Frame {
    message: u32,
    system: u32,
    component: u8,
    number: u8,
    checksum: u16,
    payload: Vec<u8>,
    length: usize,
}

impl MavlinkReader {
    /// Returns a reader before its first datagram.
    #[must_use]
    pub fn new(frame: MavlinkFrame) -> Self {
        Self { frame, senders: BTreeMap::new(), accuracies: BTreeMap::new() }
    }

    /// Appends the poses of the frames of a datagram that arrived at a time \[s\], and an error for bytes that are no
    /// frame.
    pub fn take(&mut self, mut bytes: &[u8], arrival_s: f64, inputs: &mut Vec<Input>) {
        while !bytes.is_empty() {
            let length = first_frame(bytes).and_then(|frame| {
                self.take_frame(&frame, arrival_s, inputs)?;
                Ok(frame.length)
            });
            match length {
                Ok(length) => bytes = &bytes[length..],
                Err(problem) => {
                    inputs.push(Input::Garbage(MessageError { place: "datagram".to_owned(), problem }, arrival_s));
                    return;
                }
            }
        }
    }

    fn take_frame(&mut self, frame: &Frame, arrival_s: f64, inputs: &mut Vec<Input>) -> Result<(), Problem> {
        let Frame { system, component, number, checksum, ref payload, .. } = *frame;
        let reading = match (frame.message, &self.frame) {
            (id, MavlinkFrame::Local) if id == LOCAL.0 => Some(local(payload)),
            (id, MavlinkFrame::Global(earth)) if id == GLOBAL.0 => global(payload, earth)?,
            (id, _) if id == RECEIVER.0 => {
                match accuracy_m(payload) {
                    Some(accuracy_m) => self.accuracies.insert(system, (accuracy_m, arrival_s)),
                    None => self.accuracies.remove(&system),
                };
                None
            }
            _ => None,
        };
        let are_two = match self.senders.get_mut(&system) {
            Some(sender) if sender.component == component => sender.order.take(number, checksum, arrival_s),
            Some(_) => reading.is_some(),
            None => {
                if reading.is_some() {
                    let order = SequenceOrder::new(number, checksum, arrival_s);
                    self.senders.insert(system, Sender { component, order });
                }
                false
            }
        };
        let accuracy = self.accuracies.get(&system).filter(|(_, read_s)| arrival_s - read_s <= ACCURACY_S);
        let pose = reading.map(|(t_s, position_m, velocity)| OwnedPose {
            t_s,
            id: system.to_string(),
            position_m,
            velocity_m_s: Some(velocity),
            accuracy_m: accuracy.map(|(accuracy_m, _)| *accuracy_m),
        });
        inputs.extend(pose.map(|pose| Input::Pose(pose, arrival_s)));
        inputs.extend(are_two.then(|| Input::TwoStreams(system.to_string(), arrival_s)));
        Ok(())
    }
}

/// Returns the first frame of bytes.
fn first_frame(bytes: &[u8]) -> Result<Frame, Problem> {
    let payload = usize::from(*bytes.get(1).ok_or(Problem::CutFrame)?);
    let (frame, is_whole) = match bytes[0] {
        0xFE => {
            let mut raw = MAVLinkV1MessageRaw::new();
            let length = 8 + payload;
            raw.as_mut_slice()[..length].copy_from_slice(bytes.get(..length).ok_or(Problem::CutFrame)?);
            let message = u32::from(raw.message_id());
            let frame = Frame {
                message,
                system: u32::from(raw.system_id()),
                component: raw.component_id(),
                number: raw.sequence(),
                checksum: raw.checksum(),
                payload: raw.payload().to_vec(),
                length,
            };
            (frame, extra_of(message).is_none_or(|extra| raw.has_valid_crc_with_extra_crc(extra)))
        }
        0xFD => {
            let flags = *bytes.get(2).ok_or(Problem::CutFrame)?;
            if flags & !SIGNED != 0 {
                return Err(Problem::UnknownFlags(flags));
            }
            let length = 12 + payload + if flags & SIGNED != 0 { 13 } else { 0 };
            let mut raw = MAVLinkV2MessageRaw::new();
            raw.as_mut_slice()[..length].copy_from_slice(bytes.get(..length).ok_or(Problem::CutFrame)?);
            let message = raw.message_id();
            let frame = Frame {
                message,
                system: raw.system_id(),
                component: raw.component_id(),
                number: raw.sequence(),
                checksum: raw.checksum(),
                payload: raw.payload().to_vec(),
                length,
            };
            (frame, extra_of(message).is_none_or(|extra| raw.has_valid_crc_with_extra_crc(extra)))
        }
        other => return Err(Problem::NoFrameStart(other)),
    };
    if !is_whole {
        return Err(Problem::WrongChecksum([frame.message, frame.system]));
    }
    Ok(frame)
}

fn extra_of(message: u32) -> Option<u8> {
    [LOCAL, GLOBAL, RECEIVER].into_iter().find(|known| known.0 == message).map(|known| known.2)
}

/// Returns the standard deviation of `GPS_RAW_INT` \[m\], `None` without a fix in space or an accuracy.
fn accuracy_m(payload: &[u8]) -> Option<f64> {
    let metres = |from: usize| f64::from(u32::from_le_bytes(word(payload, from))) * 1e-3;
    let [horizontal_m, vertical_m] = [metres(34), metres(38)];
    let has_fix = payload.get(28).is_some_and(|&kind| kind >= FIX_IN_SPACE);
    (has_fix && horizontal_m > 0.0 && vertical_m > 0.0).then(|| horizontal_m.hypot(vertical_m))
}

/// Stamp \[s\], position \[m\] and velocity \[m/s\].
type Reading = (f64, Vector3<f64>, Vector3<f64>);

fn local(payload: &[u8]) -> Reading {
    let number = |k: usize| f64::from(f32::from_le_bytes(word(payload, 4 * k)));
    // North, east and down become east, north and up.
    let turned = |k: usize| Vector3::new(number(k + 1), number(k), -number(k + 2));
    (stamp(payload), turned(1), turned(4))
}

/// Returns the reading of `GLOBAL_POSITION_INT`, `None` without a fix: latitude and longitude are 0.
fn global(payload: &[u8], earth: &EarthFrame) -> Result<Option<Reading>, Problem> {
    let number = |k: usize| f64::from(i32::from_le_bytes(word(payload, 4 * k)));
    let speed = |k: usize| f64::from(i16::from_le_bytes(half(payload, 20 + 2 * k))) * 0.01;
    let place = [number(1) * 1e-7, number(2) * 1e-7, number(3) * 1e-3];
    if number(1) == 0.0 && number(2) == 0.0 {
        return Ok(None);
    }
    let velocity = Vector3::new(speed(1), speed(0), -speed(2));
    let at = earth.position_m(place).map_err(Problem::NotDecoded)?;
    Ok(Some((stamp(payload), at, earth.direction_at(place, velocity).map_err(Problem::NotDecoded)?)))
}

fn stamp(payload: &[u8]) -> f64 {
    f64::from(u32::from_le_bytes(word(payload, 0))) * 1e-3
}

/// Returns bytes of a payload, whose zeros at the end are not sent.
fn word(payload: &[u8], from: usize) -> [u8; 4] {
    std::array::from_fn(|k| payload.get(from + k).copied().unwrap_or(0))
}

fn half(payload: &[u8], from: usize) -> [u8; 2] {
    std::array::from_fn(|k| payload.get(from + k).copied().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use mavlink_core::calculate_crc;
    use nalgebra::Vector3;

    use super::{GLOBAL, LOCAL, MavlinkFrame, MavlinkReader, RECEIVER};
    use crate::source::{Input, OwnedPose};
    use tautline_recordings::read::EarthFrame;

    /// Returns a frame of `MAVLink` 2, or of `MAVLink` 1.
    fn framed((id, _, extra): (u32, usize, u8), system: u8, payload: &[u8], is_new: bool) -> Vec<u8> {
        let length = u8::try_from(payload.len()).expect("a short payload");
        let header = if is_new {
            vec![0xFD, length, 0, 0, 9, system, 1, id.to_le_bytes()[0], 0, 0]
        } else {
            vec![0xFE, length, 9, system, 1, id.to_le_bytes()[0]]
        };
        let mut bytes = [header, payload.to_vec()].concat();
        bytes.extend(calculate_crc(&bytes[1..], extra).to_le_bytes());
        bytes
    }

    fn local_payload() -> Vec<u8> {
        let numbers = [1.0_f32, 2.0, -3.0, 0.5, 0.25, -0.125];
        let numbers = numbers.iter().flat_map(|x| x.to_le_bytes());
        1500_u32.to_le_bytes().into_iter().chain(numbers).collect()
    }

    fn read(bytes: &[u8], frame: &MavlinkFrame) -> Vec<Input> {
        let mut inputs = Vec::new();
        MavlinkReader::new(*frame).take(bytes, 7.0, &mut inputs);
        inputs
    }

    #[test]
    fn local_positions_become_east_north_up() {
        let pose = OwnedPose {
            t_s: 1.5,
            id: "42".to_owned(),
            position_m: Vector3::new(2.0, 1.0, 3.0),
            velocity_m_s: Some(Vector3::new(0.25, 0.5, 0.125)),
            accuracy_m: None,
        };
        for is_new in [true, false] {
            let one = framed(LOCAL, 42, &local_payload(), is_new);
            let two = [one.clone(), one].concat();
            assert_eq!(read(&two, &MavlinkFrame::Local), vec![Input::Pose(pose.clone(), 7.0); 2]);
        }
    }

    #[test]
    fn global_positions_are_metres_from_the_origin() {
        let earth = EarthFrame::new([47.0, 8.0, 400.0]).expect("an origin");
        let numbers = [470_000_000_i32, 80_001_000, 410_000, 0].iter().flat_map(|x| x.to_le_bytes());
        let speeds = [100_i16, 200, 300].iter().flat_map(|x| x.to_le_bytes());
        let payload: Vec<_> = 0_u32.to_le_bytes().into_iter().chain(numbers).chain(speeds).chain([0, 0]).collect();
        let found = read(&framed(GLOBAL, 3, &payload, true), &MavlinkFrame::Global(earth));
        let [Input::Pose(pose, _)] = &found[..] else { panic!("{found:?}") };
        // 1e-4 degrees of longitude at 47 degrees of latitude.
        assert!((pose.position_m - Vector3::new(7.607, 0.0, 10.0)).norm() < 2e-3, "{}", pose.position_m);
        assert!((pose.velocity_m_s.expect("sent") - Vector3::new(2.0, 1.0, -3.0)).norm() < 1e-4);
    }

    /// Returns the payload of `GPS_RAW_INT` with a type of the fix and accuracies \[mm\].
    fn receiver_payload(fix: u8, horizontal_mm: u32, vertical_mm: u32) -> Vec<u8> {
        let mut payload = vec![0; 52];
        payload[28] = fix;
        payload[34..38].copy_from_slice(&horizontal_mm.to_le_bytes());
        payload[38..42].copy_from_slice(&vertical_mm.to_le_bytes());
        payload
    }

    #[test]
    fn the_accuracy_of_a_receiver_belongs_to_the_positions_of_its_system_for_a_time() {
        let mut reader = MavlinkReader::new(MavlinkFrame::Local);
        let mut accuracy = |system: u8, receiver: Option<Vec<u8>>, arrival_s: f64| {
            let mut inputs = Vec::new();
            if let Some(payload) = receiver {
                reader.take(&framed(RECEIVER, 7, &payload, true), arrival_s, &mut inputs);
            }
            reader.take(&framed(LOCAL, system, &local_payload(), true), arrival_s, &mut inputs);
            let [Input::Pose(pose, _)] = &inputs[..] else { panic!("{inputs:?}") };
            pose.accuracy_m
        };
        assert_eq!(accuracy(7, None, 0.0), None);
        assert_eq!(accuracy(7, Some(receiver_payload(3, 3000, 4000)), 1.0), Some(5.0));
        assert_eq!((accuracy(8, None, 1.0), accuracy(7, None, 6.0), accuracy(7, None, 6.1)), (None, Some(5.0), None));
        for unknown in [receiver_payload(2, 3000, 4000), receiver_payload(3, 0, 4000), vec![0, 1]] {
            assert_eq!(accuracy(7, Some(receiver_payload(3, 3000, 4000)), 7.0), Some(5.0));
            assert_eq!(accuracy(7, Some(unknown), 7.0), None);
        }
    }

    #[test]
    fn damaged_frames_are_garbage_and_other_messages_are_skipped() {
        let good = framed(LOCAL, 1, &local_payload(), true);
        for k in 0..good.len() {
            let mut bad = good.clone();
            bad[k] ^= 0x10;
            let poses = read(&bad, &MavlinkFrame::Local).iter().filter(|of| matches!(of, Input::Pose(..))).count();
            assert_eq!(poses, 0, "byte {k}");
            assert!(matches!(&read(&good[..k], &MavlinkFrame::Local)[..], [] | [Input::Garbage(..)]));
        }
        assert_eq!(read(&framed((0, 9, 50), 1, &[0; 9], true), &MavlinkFrame::Local), []);
    }
}
