//! The formats that are read.

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A table in text with a header: long (`t,id,x,y,z`) or wide (`t,x1,y1,z1,x2,...`).
    Csv,
    /// Numbers between blanks: `t x y z x y z ...`.
    Text,
    /// A table in Parquet, long or wide.
    Parquet,
    /// `NumPy` arrays `t` and `positions`.
    Npz,
    /// MCAP: our own, Foxglove or ROS 2 messages.
    Mcap,
    /// A folder of Crazyflie polynomials, a CSV a vehicle.
    Crazyflie,
    /// A Skybrush show: `.skyc` or its JSON.
    Skybrush,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 7] =
        [Self::Csv, Self::Text, Self::Parquet, Self::Npz, Self::Mcap, Self::Crazyflie, Self::Skybrush];

    /// What `--format` calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Text => "text",
            Self::Parquet => "parquet",
            Self::Npz => "npz",
            Self::Mcap => "mcap",
            Self::Crazyflie => "crazyflie",
            Self::Skybrush => "skybrush",
        }
    }

    /// The format of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }

    /// What a sentence calls it.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Csv => "a table in CSV",
            Self::Text => "a table in plain text",
            Self::Parquet => "a Parquet file",
            Self::Npz => "an NPZ archive",
            Self::Mcap => "an MCAP file",
            Self::Crazyflie => "a folder of Crazyflie polynomials",
            Self::Skybrush => "a Skybrush show",
        }
    }
}
