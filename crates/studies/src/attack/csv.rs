//! Candidates that were each worse than all before as CSV, a row each.

use super::result::Attack;

impl Attack {
    /// Candidates that were each worse than all before as CSV with a line of names. Two searches for the same give the same
    /// bytes.
    ///
    /// # Errors
    /// None in practice: it is written to memory.
    pub fn to_csv(&self) -> Result<Vec<u8>, ::csv::Error> {
        let mut out = ::csv::Writer::from_writer(Vec::new());
        let names = ["flight", "noise_seed", "outcome", "min_m", "min_at_s", "certified_m"].map(str::to_owned);
        out.write_record(names.into_iter().chain(self.bounds.iter().map(|bound| bound.key.clone())))?;
        for candidate in &self.progress {
            let number = |number: Option<f64>| number.map_or_else(String::new, |number| format!("{number:?}"));
            let flown = &candidate.flown;
            let told = [
                candidate.flight.to_string(),
                flown.noise_seed.to_string(),
                flown.outcome.name().to_owned(),
                number(flown.min_m),
                number(flown.min_at_s),
                number(flown.certified_m),
            ];
            out.write_record(told.into_iter().chain(candidate.values.iter().map(f64::to_string)))?;
        }
        out.into_inner().map_err(|error| error.into_error().into())
    }
}
