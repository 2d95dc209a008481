//! What is written of the channels of a recording.

use std::sync::Arc;

use crate::read::is_read;
use tautline_core::record::Channel;

/// The channels that are written, in order of first appearance.
#[derive(Clone, Debug, Default)]
pub(super) struct Beside {
    pub(super) channels: Vec<Written>,
}

/// A channel that is written.
#[derive(Clone, Debug)]
pub(super) struct Written {
    pub(super) name: Arc<str>,
    pub(super) columns: Arc<[String]>,
}

impl Written {
    /// The channel at an instant; none where the instant does not have it.
    pub(super) fn of<'a>(&self, channels: &'a [Channel]) -> Option<&'a Channel> {
        channels.iter().find(|channel| self.name == channel.name && self.columns == channel.columns)
    }

    /// The row of a vehicle at an instant.
    pub(super) fn row<'a>(&self, channels: &'a [Channel], row: usize) -> Option<&'a [f64]> {
        let width = self.columns.len();
        self.of(channels)?.values.get(row * width..(row + 1) * width)
    }
}

impl Beside {
    /// Takes note of the channels of an instant. Of two of one name the first is written.
    pub(super) fn note(&mut self, channels: &[Channel]) {
        for channel in channels {
            if self.channels.iter().all(|known| known.name != channel.name) {
                let (name, columns) = (channel.name.clone(), channel.columns.clone());
                self.channels.push(Written { name, columns });
            }
        }
    }

    /// Names of the columns of all channels in a long table: as the channels call them, behind the name of the channel where
    /// one would be taken for another.
    pub(super) fn columns(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for channel in &self.channels {
            for column in &*channel.columns {
                let taken = is_read(column) || names.contains(column);
                names.push(if taken { format!("{}_{column}", channel.name) } else { column.clone() });
            }
        }
        names
    }

    /// Appends what stands in those columns in a row of an instant; NaN where nothing is known.
    pub(super) fn cells(&self, channels: &[Channel], row: usize, cells: &mut Vec<f64>) {
        for channel in &self.channels {
            match channel.row(channels, row) {
                Some(known) => cells.extend(known),
                None => cells.extend(std::iter::repeat_n(f64::NAN, channel.columns.len())),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_column_of_a_channel_is_called_as_one_that_is_read() {
        let mut beside = Beside::default();
        beside.note(&[
            Channel::new("attitude", &["qw", "qx"]),
            Channel::new("gps", &["x", "y1", "t_s", "id", "radius", "vx", "qw"]),
            Channel::new("wind", &["wind_x_m_s"]),
        ]);
        let expected =
            ["qw", "qx", "gps_x", "gps_y1", "gps_t_s", "gps_id", "gps_radius", "gps_vx", "gps_qw", "wind_x_m_s"];
        assert_eq!(beside.columns(), expected);
        assert!(expected.iter().all(|name| !is_read(name)), "{expected:?}");
    }
}
