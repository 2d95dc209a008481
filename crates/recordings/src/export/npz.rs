//! Writes an NPZ archive of `NumPy` arrays.
//!
//! Arrays: `t`, `positions` (T x N x 3, or T x N x 2 without heights) and `axes`. If known also `velocities`, `radii`
//! (T x N), `names`, `seen` (T x N) and `epoch_ns`. Each channel is an array with its name (T x N x columns) and an
//! array of column names, such as `attitude` and `attitude_columns`.
//!
//! The recording is read once per array, so that no array is in memory.

use std::fs::File;
use std::io;
use std::io::{BufWriter, Seek, SeekFrom, Write};

use nalgebra::Vector3;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::ExportError;
use super::source::{ChannelColumns, ExportInfo, Source};
use tautline_core::track::Sample;

/// Array names with a meaning for readers of motion.
const RESERVED: [&str; 8] = ["t", "positions", "axes", "velocities", "radii", "seen", "names", "epoch_ns"];

/// Alignment of the end of an array header \[bytes\].
const ALIGNMENT: usize = 64;

pub(super) fn write(source: &Source<'_>, info: &ExportInfo, file: &mut File) -> Result<(), ExportError> {
    let (times, vehicles, axes) = (info.instants, info.names.len(), info.axes);
    let file = FailsOnce { inner: BufWriter::new(file), failed: false };
    let mut archive = Archive { zip: ZipWriter::new(file), source, vehicles };
    archive.array("t", "<f8", &[times], |instant, _, out| {
        let time_s = instant.first().map_or(f64::NAN, |sample| sample.time_s);
        out.write_all(&time_s.to_le_bytes())
    })?;
    archive.array("positions", "<f8", &[times, vehicles, axes], |_, slots, out| {
        slots.iter().try_for_each(|slot| vector(slot.map(|sample| sample.position_m), axes, out))
    })?;
    // If T = N, the shape alone does not identify the axes.
    archive.texts("axes", &["time", "vehicle", "xyz"].map(str::to_owned))?;
    if info.velocities {
        archive.array("velocities", "<f8", &[times, vehicles, axes], |_, slots, out| {
            slots.iter().try_for_each(|slot| vector(slot.and_then(|sample| sample.velocity_m_s), axes, out))
        })?;
    }
    if info.radii {
        archive.array("radii", "<f8", &[times, vehicles], |_, slots, out| {
            let radius = |slot: Option<&Sample>| slot.and_then(|sample| sample.radius_m).unwrap_or(f64::NAN);
            slots.iter().try_for_each(|&slot| out.write_all(&radius(slot).to_le_bytes()))
        })?;
    }
    if info.samples != (times * vehicles) as u64 {
        archive.array("seen", "|b1", &[times, vehicles], |_, slots, out| {
            slots.iter().try_for_each(|slot| out.write_all(&[u8::from(slot.is_some())]))
        })?;
    }
    let numbered = info.names.iter().enumerate().all(|(index, name)| *name == (index + 1).to_string());
    if !numbered {
        archive.texts("names", &info.names)?;
    }
    for channel in &info.extra.channels {
        archive.channel(channel, times)?;
    }
    if info.clock.epoch_ns != 0 {
        archive.begin("epoch_ns", "<i8", &[])?.write_all(&info.clock.epoch_ns.to_le_bytes())?;
    }
    archive.zip.finish().map_err(io::Error::other)?.flush()?;
    Ok(())
}

fn vector(vector: Option<Vector3<f64>>, axes: usize, out: &mut dyn Write) -> io::Result<()> {
    let vector = vector.unwrap_or_else(|| Vector3::repeat(f64::NAN));
    vector.iter().take(axes).try_for_each(|x| out.write_all(&x.to_le_bytes()))
}

/// Writer that accepts and discards all data after its first error.
///
/// An unfinished archive writes its directory when dropped, where a second error could not be reported.
struct FailsOnce<W> {
    inner: W,
    failed: bool,
}

impl<W> FailsOnce<W> {
    fn attempt<T>(&mut self, discarded: T, action: impl FnOnce(&mut W) -> io::Result<T>) -> io::Result<T> {
        if self.failed {
            return Ok(discarded);
        }
        let done = action(&mut self.inner);
        self.failed = done.as_ref().is_err_and(|error| error.kind() != io::ErrorKind::Interrupted);
        done
    }
}

impl<W: Write> Write for FailsOnce<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.attempt(bytes.len(), |inner| inner.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.attempt((), Write::flush)
    }
}

impl<W: Seek> Seek for FailsOnce<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.attempt(0, |inner| inner.seek(to))
    }
}

/// Writer of the zip container.
type Zip<'a> = ZipWriter<FailsOnce<BufWriter<&'a mut File>>>;

struct Archive<'a> {
    zip: Zip<'a>,
    source: &'a Source<'a>,
    vehicles: usize,
}

/// Sample of each vehicle at one instant, `None` for an absent vehicle.
type Slots<'a> = [Option<&'a Sample>];

impl<'a> Archive<'a> {
    /// Starts an array and writes its header.
    fn begin(&mut self, name: &str, descr: &str, shape: &[usize]) -> Result<&mut Zip<'a>, ExportError> {
        // The default options have a fixed time stamp, so that equal recordings give equal bytes.
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored).large_file(true);
        self.zip.start_file(format!("{name}.npy"), options).map_err(io::Error::other)?;
        let shape: Vec<_> = shape.iter().map(|length| format!("{length},")).collect();
        let shape = shape.join(" ");
        let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({shape}), }}");
        let head = 10;
        let filled = (head + header.len() + 1).next_multiple_of(ALIGNMENT);
        header.push_str(&" ".repeat(filled - head - header.len() - 1));
        header.push('\n');
        let length = u16::try_from(header.len()).map_err(io::Error::other)?;
        self.zip.write_all(b"\x93NUMPY\x01\x00")?;
        self.zip.write_all(&length.to_le_bytes())?;
        self.zip.write_all(header.as_bytes())?;
        Ok(&mut self.zip)
    }

    /// Writes an array of text.
    fn texts(&mut self, name: &str, texts: &[String]) -> Result<(), ExportError> {
        if let Some(text) = texts.iter().find(|text| text.ends_with('\0')) {
            return Err(ExportError::Name(text.clone()));
        }
        let width = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
        let mut out = BufWriter::new(self.begin(name, &format!("<U{width}"), &[texts.len()])?);
        for text in texts {
            for c in text.chars().map(u32::from).chain(std::iter::repeat(0)).take(width) {
                out.write_all(&c.to_le_bytes())?;
            }
        }
        out.flush()?;
        Ok(())
    }

    /// Writes a channel, NaN for unknown values, and the names of its columns.
    fn channel(&mut self, channel: &ChannelColumns, times: usize) -> Result<(), ExportError> {
        let (source, vehicles, width) = (self.source, self.vehicles, channel.columns.len());
        let name = if RESERVED.contains(&&*channel.name) {
            format!("channel_{}", channel.name)
        } else {
            channel.name.to_string()
        };
        let unknown = vec![f64::NAN; width];
        let mut out = BufWriter::new(self.begin(&name, "<f8", &[times, vehicles, width])?);
        source.each_instant(|instant, channels| {
            let mut rows = vec![&unknown[..]; vehicles];
            for (row, sample) in instant.iter().enumerate() {
                rows[sample.vehicle] = channel.row(channels, row).unwrap_or(&unknown);
            }
            Ok(rows.into_iter().flatten().try_for_each(|number| out.write_all(&number.to_le_bytes()))?)
        })?;
        out.flush()?;
        drop(out);
        self.texts(&format!("{name}_columns"), &channel.columns)
    }

    /// Writes an array, one instant after another.
    fn array(
        &mut self,
        name: &str,
        descr: &str,
        shape: &[usize],
        write: impl Fn(&[Sample], &Slots<'_>, &mut dyn Write) -> io::Result<()>,
    ) -> Result<(), ExportError> {
        let (source, vehicles) = (self.source, self.vehicles);
        let zip = self.begin(name, descr, shape)?;
        // Buffering saves checksum updates: the archive computes one per write.
        let mut out = BufWriter::new(zip);
        source.each_instant(|instant, _| {
            let mut slots = vec![None; vehicles];
            for sample in instant {
                slots[sample.vehicle] = Some(sample);
            }
            Ok(write(instant, &slots, &mut out)?)
        })?;
        out.flush()?;
        Ok(())
    }
}
