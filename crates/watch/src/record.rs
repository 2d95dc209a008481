//! Recording of the poses that the monitor used.

use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use crate::source::OwnedPose;
use tautline_recordings::export::TrackRecorder;

/// Recording of poses in a file `PATH.partial` until it is complete.
///
/// The file receives its poses at least once per second of the recording. An incomplete CSV file is readable; an
/// incomplete MCAP file needs `allow_unfinished`.
pub struct Record {
    file: Poses,
    partial: PathBuf,
    path: PathBuf,
    /// Time of the last flush \[s\].
    flushed_s: f64,
    rows: u64,
}

/// Form of a recording.
enum Poses {
    /// Columns `time_s,id,x,y,z,vx,vy,vz`.
    Csv(BufWriter<File>),
    /// Messages, one for each pose.
    Mcap(Box<TrackRecorder>),
}

/// Extension of an incomplete file.
const PARTIAL: &str = "partial";

impl Record {
    /// Returns the name `PATH.partial` of the incomplete file.
    #[must_use]
    pub fn partial_of(path: &Path) -> PathBuf {
        let mut name = path.as_os_str().to_owned();
        name.push(".");
        name.push(PARTIAL);
        PathBuf::from(name)
    }

    /// Returns whether the extension of a file is that of a recording: `csv` or `mcap`.
    #[must_use]
    pub fn is_written(path: &Path) -> bool {
        path.extension().is_some_and(|extension| extension == "csv" || extension == "mcap")
    }

    /// Creates the file `PATH.partial`, as MCAP if this is the extension of the path, otherwise as CSV.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: &Path) -> io::Result<Self> {
        let partial = Self::partial_of(path);
        let file = File::create(&partial)?;
        let file = if path.extension().is_some_and(|extension| extension == "mcap") {
            Poses::Mcap(Box::new(TrackRecorder::new(file)?))
        } else {
            let mut file = BufWriter::new(file);
            file.write_all(b"time_s,id,x,y,z,vx,vy,vz\n")?;
            Poses::Csv(file)
        };
        Ok(Self { file, partial, path: path.to_owned(), flushed_s: f64::NEG_INFINITY, rows: 0 })
    }

    /// Appends a pose at a time of the monitor \[s\]. Numbers round-trip.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn push(&mut self, time_s: f64, pose: &OwnedPose) -> io::Result<()> {
        match &mut self.file {
            Poses::Csv(file) => {
                let position_m = pose.position_m;
                let id = quoted(&pose.id);
                write!(file, "{time_s:?},{id},{:?},{:?},{:?},", position_m.x, position_m.y, position_m.z)?;
                match pose.velocity_m_s {
                    Some(v_m_s) => writeln!(file, "{:?},{:?},{:?}", v_m_s.x, v_m_s.y, v_m_s.z)?,
                    None => writeln!(file, ",,")?,
                }
            }
            Poses::Mcap(file) => file.push(time_s, &pose.id, pose.position_m, pose.velocity_m_s)?,
        }
        self.rows += 1;
        if time_s >= self.flushed_s + 1.0 {
            self.flushed_s = time_s;
            match &mut self.file {
                Poses::Csv(file) => file.flush()?,
                Poses::Mcap(file) => file.flush()?,
            }
        }
        Ok(())
    }

    /// Returns the number of poses.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Removes `PATH.partial`.
    ///
    /// # Errors
    /// If the file cannot be removed.
    pub fn discard(self) -> io::Result<()> {
        drop(self.file);
        std::fs::remove_file(&self.partial)
    }

    /// Renames `PATH.partial` to `PATH`.
    ///
    /// # Errors
    /// If the file cannot be written or renamed.
    pub fn finish(self) -> io::Result<()> {
        match self.file {
            Poses::Csv(mut file) => file.flush()?,
            Poses::Mcap(file) => file.finish()?,
        }
        File::options().append(true).open(&self.partial)?.sync_all()?;
        std::fs::rename(&self.partial, &self.path)
    }
}

/// Returns a cell of CSV.
fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) || cell.trim() != cell {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::Record;
    use crate::source::OwnedPose;
    use tautline_core::track::Item;
    use tautline_recordings::read::{ReadOptions, open};

    #[test]
    fn a_recording_is_read_back_with_the_same_numbers() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["watch.csv", "watch.mcap"] {
            let path = folder.path().join(name);
            let mut record = Record::create(&path).expect("a file");
            let third = 1.0 / 3.0;
            for (t_s, id) in [(0.1, "a, b"), (0.1, "c"), (0.2, "a, b"), (0.2, "c")] {
                let position_m = Vector3::new(third, -t_s, 7.0);
                let velocity_m_s = Some(Vector3::new(0.0, -1.0, third));
                record
                    .push(t_s, &OwnedPose { t_s, id: id.to_owned(), position_m, velocity_m_s, accuracy_m: None })
                    .expect("a row");
            }
            assert!(!path.exists());
            record.finish().expect("a file");
            let mut tracks = open(&path, &ReadOptions::default()).expect("a recording");
            let mut items = Vec::new();
            while tracks.read(&mut items).expect("rows") {}
            assert_eq!(tracks.vehicles(), ["a, b", "c"]);
            let Item::Sample(first) = &items[0] else { panic!("{items:?}") };
            assert_eq!((first.time_s, first.position_m), (0.1, Vector3::new(third, -0.1, 7.0)));
            assert_eq!((items.len(), first.velocity_m_s), (4, Some(Vector3::new(0.0, -1.0, third))));
        }
    }

    #[test]
    fn names_that_differ_only_in_spelling_are_kept_apart() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("watch.mcap");
        let mut record = Record::create(&path).expect("a file");
        for (id, x_m) in [("cf1", 0.0), ("CF1", 2.0)] {
            let position_m = Vector3::new(x_m, 0.0, 0.0);
            let pose = OwnedPose { t_s: 0.0, id: id.to_owned(), position_m, velocity_m_s: None, accuracy_m: None };
            record.push(0.0, &pose).expect("a row");
        }
        record.finish().expect("a file");
        let mut tracks = open(&path, &ReadOptions::default()).expect("a recording");
        while tracks.read(&mut Vec::new()).expect("rows") {}
        assert_eq!(tracks.vehicles(), ["cf1", "CF1"]);
    }
}
