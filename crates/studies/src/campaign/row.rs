//! One flight of a campaign: a line of a part, and a row of `results.parquet`.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::flights::Campaign;
use crate::flight::{FlightSummary, Outcome};
use crate::splitting::Splitting;
use crate::table::{Cell, Column, Kind};

/// One flight: a run under a law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Number of the run, from 0.
    pub run: u64,
    /// Which of the campaign's laws, from 0.
    pub law: usize,
    /// What was drawn for it, in the order of the keys.
    pub drawn: Vec<Value>,
    /// Why it was not flown, where what was drawn cannot be, such as a start of two vehicles nearer than delta.
    pub not_flown: Option<String>,
    /// How it went.
    pub flight: Option<FlightSummary>,
    /// What was estimated, where a run is no flight.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splitting: Option<Splitting>,
}

/// What is known of a flight's separation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// No two vehicles came closer than delta, to the end.
    Clear,
    /// Two did.
    Violated,
    /// It ended early or the judge cannot tell.
    Unknown,
    /// What was drawn cannot be flown.
    NotFlown,
    /// It is no flight but an estimate.
    Estimated,
}

impl Row {
    /// What is known of its separation.
    #[must_use]
    pub fn known(&self) -> Known {
        match self.flight.as_ref().map(|flight| flight.outcome) {
            None if self.splitting.is_some() => Known::Estimated,
            None => Known::NotFlown,
            Some(Outcome::Clear) => Known::Clear,
            Some(Outcome::Violated) => Known::Violated,
            Some(Outcome::EndedEarly | Outcome::Undecided) => Known::Unknown,
        }
    }

    /// Smallest separation less delta \[m\].
    #[must_use]
    pub fn clearance_m(&self) -> Option<f64> {
        self.flight.as_ref()?.clearance_m()
    }

    /// Its place in the order of all rows.
    #[must_use]
    pub fn place(&self) -> (u64, usize) {
        (self.run, self.law)
    }
}

/// A column of `results.parquet`, and its cell of a row.
pub(super) type Field<'a> = (Column, Box<dyn Fn(&Row) -> Cell + 'a>);

fn field<'a, C: Into<Cell>>(name: &str, kind: Kind, cell: impl Fn(&Row) -> C + 'a) -> Field<'a> {
    (Column::new(name, "", kind), Box::new(move |row| cell(row).into()))
}

/// A column of flights, which is empty in a row that was not flown.
fn of_flight<'a, C: Into<Cell>>(name: &str, kind: Kind, cell: impl Fn(&FlightSummary) -> C + 'a) -> Field<'a> {
    field(name, kind, move |row| row.flight.as_ref().map(&cell))
}

/// A column of estimates.
fn of_estimate<'a, C: Into<Cell>>(name: &str, kind: Kind, cell: impl Fn(&Splitting) -> C + 'a) -> Field<'a> {
    field(name, kind, move |row| row.splitting.as_ref().map(&cell))
}

/// The column of a varied key: of numbers where all its values are numbers, else of texts.
fn drawn<'a>(place: usize, key: &str, samples: &[toml::Value]) -> Field<'a> {
    // Columns of our own have no dots.
    let name = if key.contains('.') { key.to_owned() } else { format!("vary.{key}") };
    let at = move |row: &Row| row.drawn.get(place).cloned();
    if samples.iter().all(toml::Value::is_integer) {
        field(&name, Kind::Integer, move |row| at(row).and_then(|value| value.as_i64()))
    } else if samples.iter().all(|value| value.is_float() || value.is_integer()) {
        field(&name, Kind::Exact, move |row| at(row).and_then(|value| value.as_f64()))
    } else {
        let text = |value: Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        field(&name, Kind::Text, move |row| at(row).map(text))
    }
}

/// Columns of `results.parquet`.
pub(super) fn fields(campaign: &Campaign) -> Vec<Field<'_>> {
    let law = |row: &Row| campaign.laws().get(row.law).map(|law| law.name.clone());
    let mut fields = vec![field("run", Kind::Count, |row| row.run), field("law", Kind::Text, law)];
    let keys = campaign.variations().iter().enumerate();
    fields.extend(keys.map(|(place, (key, variation))| drawn(place, key, &variation.samples())));
    let not_flown = field("not_flown_because", Kind::Text, |row| row.not_flown.clone());
    if campaign.splitting().is_some() {
        fields.extend([
            of_estimate("probability", Kind::Exact, |of| of.probability),
            of_estimate("iterations", Kind::Count, |of| of.iterations),
            of_estimate("extinct", Kind::Flag, |of| of.extinct),
            of_estimate("steps", Kind::Count, |of| of.steps),
            not_flown,
        ]);
        return fields;
    }
    let outcome = |row: &Row| row.flight.as_ref().map_or("not_flown", |flight| flight.outcome.name());
    let refused = |of: &FlightSummary| Some(of.refused.join(" ")).filter(|codes| !codes.is_empty());
    fields.extend([
        field("outcome", Kind::Text, outcome),
        of_flight("pass", Kind::Flag, |of| of.pass),
        of_flight("refused", Kind::Text, refused),
        of_flight("ended_early", Kind::Text, |of| of.ended_early.clone()),
        not_flown,
        of_flight("delta_m", Kind::Exact, |of| of.delta_m),
        of_flight("min_m", Kind::Exact, |of| of.min_m),
        of_flight("min_at_s", Kind::Exact, |of| of.min_at_s),
        of_flight("min_vehicle_a", Kind::Integer, |of| of.min_pair.map(|pair| pair[0])),
        of_flight("min_vehicle_b", Kind::Integer, |of| of.min_pair.map(|pair| pair[1])),
        of_flight("certified_m", Kind::Exact, |of| of.certified_m),
        of_flight("breaks_certificate", Kind::Flag, |of| of.breaks_certificate),
        of_flight("reached", Kind::Flag, |of| of.reached),
        of_flight("reached_at_s", Kind::Exact, |of| of.reached_at_s),
        of_flight("peak_control_m_s2", Kind::Exact, |of| of.peak_control_m_s2),
        of_flight("total_control_m_s", Kind::Exact, |of| of.total_control_m_s),
        of_flight("path_length_m", Kind::Exact, |of| of.path_length_m),
        of_flight("energy_max_over_initial", Kind::Exact, |of| of.energy_max_over_initial),
        of_flight("steps", Kind::Count, |of| of.steps),
        of_flight("refined_steps", Kind::Count, |of| of.refined_steps),
        of_flight("overlong_steps", Kind::Count, |of| of.overlong_steps),
        of_flight("scenario_sha256", Kind::Text, |of| of.scenario_sha256.clone()),
        of_flight("state_hash", Kind::Text, |of| of.state_hash.clone()),
    ]);
    fields
}
