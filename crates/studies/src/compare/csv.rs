//! The comparison as CSV: a row a law, every number to its last digit, nothing where there is none.

use super::result::{Comparison, LawRow};
use crate::statistics::{Estimate, Proportion};

impl Comparison {
    /// The table as CSV with a line of names. Two comparisons of the same give the same bytes.
    ///
    /// # Errors
    /// None in practice: it is written to memory.
    pub fn to_csv(&self) -> Result<Vec<u8>, ::csv::Error> {
        let mut out = ::csv::Writer::from_writer(Vec::new());
        for (k, law) in self.laws.iter().enumerate() {
            let columns = columns(law);
            if k == 0 {
                out.write_record(columns.iter().map(|(name, _)| name))?;
            }
            out.write_record(columns.iter().map(|(_, value)| value))?;
        }
        out.into_inner().map_err(|error| error.into_error().into())
    }
}

/// Names and values of a row.
fn columns(law: &LawRow) -> Vec<(String, String)> {
    let one = |name: &str, value: String| vec![(name.to_owned(), value)];
    [
        one("law", law.name.clone()),
        one("kind", law.kind.clone()),
        one("runs", law.clear.of.to_string()),
        share("clear", &law.clear),
        share("violated", &law.violated),
        one("undecided_count", law.undecided.to_string()),
        one("ended_early_count", law.ended_early.to_string()),
        one("refused_count", law.refused.to_string()),
        share("reached", &law.reached),
        estimate("reached_median", "s", &law.reached_median_s),
        estimate("reached_p95", "s", &law.reached_p95_s),
        one("min_smallest_m", number(law.min_smallest_m)),
        one("min_smallest_seed", law.min_smallest_seed.map_or_else(String::new, |seed| seed.to_string())),
        estimate("min_median", "m", &law.min_median_m),
        estimate("path_length_mean", "m", &law.path_length_mean_m),
        one("peak_control_largest_m_s2", number(law.peak_control_largest_m_s2)),
        estimate("peak_control_median", "m_s2", &law.peak_control_median_m_s2),
        estimate("total_control_mean", "m_s", &law.total_control_mean_m_s),
    ]
    .concat()
}

fn number(number: Option<f64>) -> String {
    number.map_or_else(String::new, |number| format!("{number:?}"))
}

fn share(name: &str, of: &Proportion) -> Vec<(String, String)> {
    vec![
        (format!("{name}_count"), of.count.to_string()),
        (format!("{name}_share"), number(of.share)),
        (format!("{name}_low"), number(Some(of.low))),
        (format!("{name}_high"), number(Some(of.high))),
    ]
}

fn estimate(name: &str, unit: &str, of: &Estimate) -> Vec<(String, String)> {
    vec![
        (format!("{name}_{unit}"), number(of.value)),
        (format!("{name}_low_{unit}"), number(of.low)),
        (format!("{name}_high_{unit}"), number(of.high)),
    ]
}
