//! The formats that are read.

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A table in text with a header: long (`t,id,x,y,z`) or wide (`t,x1,y1,z1,x2,...`).
    Csv,
    /// Numbers between blanks: `t x y z x y z ...`.
    Text,
    /// Numbers between blanks: frame, vehicle, x and y of `TrajNet`.
    Trajnet,
    /// A table with an object of JSON in each line.
    Jsonl,
    /// A table in Parquet, long or wide.
    Parquet,
    /// `NumPy` arrays `t` and `positions`.
    Npz,
    /// MCAP: our own, Foxglove or ROS 2 messages.
    Mcap,
    /// A log of PX4.
    Ulog,
    /// A folder of Crazyflie polynomials, a CSV a vehicle.
    Crazyflie,
    /// A Skybrush show: `.skyc` or its JSON.
    Skybrush,
    /// A VVIZ show of Verge Aero or Finale 3D.
    Vviz,
    /// A take of `OptiTrack` Motive as CSV.
    Motive,
    /// An export of Vicon Nexus or Tracker as CSV.
    Vicon,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 13] = [
        Self::Csv,
        Self::Text,
        Self::Trajnet,
        Self::Jsonl,
        Self::Parquet,
        Self::Npz,
        Self::Mcap,
        Self::Ulog,
        Self::Crazyflie,
        Self::Skybrush,
        Self::Vviz,
        Self::Motive,
        Self::Vicon,
    ];

    /// What `--format` calls it, and what a sentence does.
    const fn names(self) -> [&'static str; 2] {
        match self {
            Self::Csv => ["csv", "a table in CSV"],
            Self::Text => ["text", "a table in plain text"],
            Self::Trajnet => ["trajnet", "a table of TrajNet"],
            Self::Jsonl => ["jsonl", "a table of JSON objects"],
            Self::Parquet => ["parquet", "a Parquet file"],
            Self::Npz => ["npz", "an NPZ archive"],
            Self::Mcap => ["mcap", "an MCAP file"],
            Self::Ulog => ["ulog", "a ULog of PX4"],
            Self::Crazyflie => ["crazyflie", "a folder of Crazyflie polynomials"],
            Self::Skybrush => ["skybrush", "a Skybrush show"],
            Self::Vviz => ["vviz", "a VVIZ show"],
            Self::Motive => ["motive", "a take of OptiTrack Motive"],
            Self::Vicon => ["vicon", "an export of Vicon"],
        }
    }

    /// What `--format` calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.names()[0]
    }

    /// What a sentence calls it.
    #[must_use]
    pub fn title(self) -> &'static str {
        self.names()[1]
    }
}
