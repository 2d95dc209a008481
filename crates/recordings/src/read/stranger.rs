//! Files that are known and not read: what they are, and the way in.

use super::error::Fault;

/// Beginnings of files, what they are, and what helps.
const STRANGERS: [(&[u8], &str, &str); 12] = [
    (b"#ROSBAG V", "a ROS 1 bag", BAG),
    (b"SQLite format 3\0", "an SQLite database, as ROS 2 bags are", BAG),
    (b"skyb", "a compiled Skybrush trajectory of one drone", "give the .skyc show that it was made of"),
    (b"\xa3\x95", "a DataFlash log of ArduPilot", DATAFLASH),
    (b"FMT,", "a DataFlash log of ArduPilot", DATAFLASH),
    (b"FMT ", "a DataFlash log of ArduPilot", DATAFLASH),
    (
        b"\x89HDF\r\n\x1a\n",
        "an HDF5 file",
        "save its arrays with numpy.savez(\"flight.npz\", t=t, positions=positions)",
    ),
    (b"MATLAB 5.0", "a file of MATLAB", "write it with `writetable` as t,id,x,y,z"),
    (b"RRF2", "a recording of Rerun", "write its positions as a table t,id,x,y,z"),
    (b"\x28\xb5\x2f\xfd", "packed by zstd", "unpack it first, with unzstd"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive", UNPACK),
    (b"Rar!\x1a\x07", "a RAR archive", UNPACK),
];

pub(super) const BAG: &str = "convert it with `rosbags-convert --src BAG --dst flight --dst-storage mcap` (from `pip install \
                              rosbags`), and give the folder `flight`";
const DATAFLASH: &str = "write its POS messages with `mavlogdump.py --types POS --format csv`, and from that a table t,id,lat,lon,alt \
                         in degrees and metres";
const UNPACK: &str = "unpack it, and give the folder";
pub(super) const TABLE: &str =
    "give positions over time, such as a table t,id,x,y,z, or an object of JSON in each line";
const EARTH: &str = "write it as a table t,id,lat,lon,alt: time, vehicle, degrees and metres";

/// What a file is and what helps, where it is known and not read.
pub(super) fn of_bytes(head: &[u8]) -> Option<Fault> {
    // Each message of telemetry has the microseconds since 1970 in front.
    if matches!(head, [0, 4..=7, _, _, _, _, _, _, 0xfd | 0xfe, ..]) {
        let remedy = "write its positions with `mavlogdump.py --types GLOBAL_POSITION_INT --format csv`, and from that a table \
                      t,id,lat,lon,alt in degrees and metres";
        return Some(Fault::coded(
            "recording/unsupported-format",
            "it is a MAVLink telemetry log, which is not read",
            remedy,
        ));
    }
    if head.get(257..262) == Some(b"ustar") {
        return Some(Fault::coded("recording/unsupported-format", "it is a tar archive, which is not read", UNPACK));
    }
    let stranger = STRANGERS.iter().find(|(begin, ..)| head.starts_with(begin));
    stranger.map(|(_, what, remedy)| {
        Fault::coded("recording/unsupported-format", format!("it is {what}, which is not read"), *remedy)
    })
}

/// The same of text, which has no blanks in front.
pub(super) fn of_text(text: &[u8]) -> Option<Fault> {
    let holds = |word: &str| memchr::memmem::find(text, word.as_bytes()).is_some();
    let (what, remedy) = match text.first()? {
        b'<' if holds("<gpx") => ("a GPX track", EARTH),
        b'<' if holds("<kml") => ("a KML file", EARTH),
        b'<' if holds("<html") || holds("<HTML") => ("a page of HTML", TABLE),
        b'<' => ("an XML file", TABLE),
        b'[' => ("JSON, but no Skybrush show", TABLE),
        _ => return None,
    };
    Some(Fault::coded("recording/unsupported-format", format!("it is {what}, which is not read"), remedy))
}
