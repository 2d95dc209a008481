//! Answer of an export for drones, as text and JSON.

use std::fmt::Write as _;

use serde_json::json;

use super::super::Failure;
use super::{DroneExportRequest, Flight};
use crate::report::Status;
use crate::report::recorded::RecordedReport;
use tautline_core::option::TOLERANCE;
use tautline_core::text::{at_least, at_most, counted, fixed};
use tautline_recordings::export::drones::EncodedVehicle;
use tautline_recordings::export::drones::motion::Deviation;

/// Decimals of lengths in the answer.
const DECIMALS: u8 = 6;

/// Answer of an export for drones.
#[derive(Clone, Debug)]
pub struct DroneExport {
    /// Vehicles.
    pub vehicles: Vec<EncodedVehicle>,
    /// Largest deviation of the written motion from the flight, and its vehicle. Times are those of the flight.
    pub deviation: Option<(Deviation, String)>,
    /// Verdict on the written motion; `None` without two objects to keep apart.
    pub audit: Option<RecordedReport>,
    /// Smallest margin of a distance to its limit \[m\], with the names of the pair and the time of the flight \[s\].
    pub margin: Option<(f64, [String; 2], f64)>,
    /// Start and end of the exported part of the flight \[s\].
    pub span_s: (f64, f64),
    /// Size of all files \[bytes\].
    pub bytes: usize,
    /// Reason why nothing was written: the flight or its written motion is not clear.
    pub refusal: Option<Failure>,
}

impl DroneExport {
    pub(super) fn empty() -> Self {
        Self {
            vehicles: Vec::new(),
            deviation: None,
            audit: None,
            margin: None,
            span_s: (0.0, 0.0),
            bytes: 0,
            refusal: None,
        }
    }

    /// Adds the verdict on the written motion, whose times begin `start_s` after those of the flight.
    pub(super) fn add(&mut self, report: RecordedReport, start_s: f64) {
        let closest = report.separation().into_iter().flat_map(|answer| &answer.closest);
        let name = |label: &String| {
            self.vehicles
                .iter()
                .find(|vehicle| vehicle.label == *label)
                .map_or_else(|| label.clone(), |vehicle| vehicle.name.clone())
        };
        let margins = closest.filter_map(|finding| {
            let [first, second] = &finding.subjects[..] else { return None };
            Some((finding.margin(), [first, second].map(name), finding.at_s.unwrap_or_default()))
        });
        let least = margins.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(margin, who, at_s)| (margin, who, at_s + start_s));
        if report.status != Status::Clear {
            let shift =
                if start_s == 0.0 { String::new() } else { format!(", whose 0 s are {start_s:?} s of the flight") };
            let message = format!("the flight is clear, but not the written motion{shift}: {}", report.headline());
            let help = format!("give a smaller {TOLERANCE}, or fly it with a larger separation");
            self.refusal = Some(Failure::input("export/violation", message, help));
        }
        (self.margin, self.audit) = (least, Some(report));
    }

    /// Returns whether the files were written.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.refusal.is_none()
    }

    /// Returns the answer as JSON; docs/export.md lists the keys.
    #[must_use]
    pub fn to_json(&self) -> String {
        let vehicle =
            |of: &EncodedVehicle| json!({"name": of.name, "label": of.label, "parts": of.parts, "bytes": of.bytes});
        let margin =
            self.margin.as_ref().map(|(margin, who, at_s)| json!({"margin": margin, "who": who, "at_s": at_s}));
        let deviation = self.deviation.as_ref().map(|(found, vehicle)| {
            json!({"bound_m": found.bound_m, "found_m": found.found_m, "at_s": found.time_s, "vehicle": vehicle})
        });
        let answer = json!({
            "verdict": self.audit.as_ref().map(RecordedReport::headline),
            "refusal": self.refusal.as_ref().map(Failure::in_words),
            "margin": margin,
            "deviation": deviation,
            "from_s": self.span_s.0,
            "until_s": self.span_s.1,
            "bytes": self.bytes,
            "vehicles": self.vehicles.iter().map(vehicle).collect::<Vec<_>>(),
        });
        answer.to_string()
    }

    /// Returns whether times or names of the files differ from those of the flight.
    fn has_own_terms(&self) -> bool {
        self.span_s.0 != 0.0 || self.vehicles.iter().any(|of| of.name != of.label)
    }

    /// Returns the answer in words.
    pub(super) fn text(&self, request: &DroneExportRequest, flight: &Flight) -> String {
        let mut text = match &self.audit {
            Some(report) if self.has_own_terms() => report.headline() + "; times and names of the files\n",
            Some(report) => report.headline() + "\n",
            None => "not judged: there is one vehicle and no obstacle\n".to_owned(),
        };
        let unit = if flight.settings.ellipsoid_m.is_some() { "half axes" } else { "m" };
        let of_flight = if self.has_own_terms() { " of the flight" } else { "" };
        // Writing to a string cannot fail.
        if let Some((margin, [one, other], at_s)) = &self.margin {
            let left = at_least(*margin, DECIMALS);
            let _ = writeln!(
                text,
                "margin       {left} {unit} above the limit, {one} and {other} at {} s{of_flight}",
                fixed(*at_s, 3)
            );
        }
        if let Some((found, vehicle)) = &self.deviation {
            let most = at_most(found.bound_m, DECIMALS);
            let at_s = fixed(found.time_s, 3);
            let _ = writeln!(
                text,
                "deviation    at most {most} m from the flight at every instant, vehicle {vehicle} at {at_s} \
                 s{of_flight}"
            );
        }
        let dialect = request.dialect;
        let parts = || self.vehicles.iter().map(|of| of.parts);
        let (fewest, most) = (parts().min().unwrap_or(0), parts().max().unwrap_or(0));
        let range = counted(most as u64, "piece", "pieces");
        let range = if fewest == most { range } else { format!("{fewest} to {range}") };
        let bytes = self.vehicles.iter().map(|of| of.bytes).max().unwrap_or(0);
        let vehicles = counted(self.vehicles.len() as u64, "vehicle", "vehicles");
        let _ = writeln!(text, "vehicles     {vehicles}, {range} each, at most {bytes} bytes each");
        let (from_s, until_s) = self.span_s;
        let shift =
            if from_s == 0.0 { String::new() } else { format!("; {from_s:?} s of the flight are 0 s of the files") };
        let _ = writeln!(text, "flight       {} s to {} s{shift}", fixed(from_s, 3), fixed(until_s, 3));
        let _ = write!(text, "wrote {}: {}, {} bytes", request.file.output.display(), dialect.title(), self.bytes);
        text
    }
}
