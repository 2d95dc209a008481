//! The values that were tried as CSV, a row each.

use super::result::Margin;

impl Margin {
    /// The values that were tried as CSV with a line of names. Two searches for the same give the same bytes.
    ///
    /// # Errors
    /// None in practice: it is written to memory.
    pub fn to_csv(&self) -> Result<Vec<u8>, ::csv::Error> {
        let mut out = ::csv::Writer::from_writer(Vec::new());
        out.write_record([self.key.as_str(), "runs", "held_count", "held_share", "held_low", "held_high", "min_m"])?;
        for probe in &self.probes {
            let number = |number: Option<f64>| number.map_or_else(String::new, |number| format!("{number:?}"));
            let held = probe.held;
            out.write_record([
                format!("{:?}", probe.value),
                held.of.to_string(),
                held.count.to_string(),
                number(held.share),
                number(Some(held.low)),
                number(Some(held.high)),
                number(probe.min_m),
            ])?;
        }
        out.into_inner().map_err(|error| error.into_error().into())
    }
}
