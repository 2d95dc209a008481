//! Requests: the work of `tautline run`, `tautline audit` and `tautline export` as functions.
//!
//! A request is a struct with all options of a command. Its function returns a typed result, writes the files that the
//! request names, and passes notes and progress to a [`Monitor`]. The command line builds requests from its arguments,
//! the Python package from keyword arguments.
//!
//! | request | function | answer |
//! | --- | --- | --- |
//! | [`RunRequest`] | [`run_into`] | a folder with recording, report, figures and pictures |
//! | [`AuditRequest`] | [`audit_files`] | a verdict on a recording of any origin |
//! | [`ExportRequest`] | [`export_file`] | a recording in another format |
//! | [`DroneExportRequest`] | [`export_drones`] | trajectories of drones, judged after their encoding |
//! | [`ScenarioRequest`] | [`identify`] | a measured tracking error, and a model file |

pub mod audit;
mod drones;
mod export;
mod identify;
pub mod outputs;
mod pictures;
mod run;
mod scenario;

pub use audit::{AuditOptions, AuditRequest, AuditedRecording, OwnRecording, Subject, audit_files, run_audit};
pub use drones::{DroneExport, DroneExportOptions, DroneExportRequest, export_drones};
pub use export::{ExportRequest, export_file};
pub use identify::{IdentifiedModel, identify};
pub use outputs::{OutFolder, try_to_write_in};
pub use pictures::{NamedPicture, PICTURES_BYTES, Pictures};
pub use run::{
    RECORDING, RunFiles, RunRequest, figure_files, flight_page, replay_of_run, run_into, threads, write_files,
};
pub use scenario::{ScenarioRequest, command_line};
pub use tautline_core::failure::{Failure, blanked, in_range};
pub use tautline_core::monitor::{Monitor, Quiet, Silent};
pub use tautline_recordings::read::ReadOptions;

/// Returns a parser of arguments that have names as values.
#[cfg(feature = "cli")]
#[must_use]
pub fn one_of<T: Clone + Send + Sync + 'static>(
    choices: Vec<(clap::builder::PossibleValue, T)>,
) -> impl clap::builder::TypedValueParser<Value = T> {
    use clap::builder::TypedValueParser as _;
    let names = choices.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    clap::builder::PossibleValuesParser::new(names).try_map(move |given| {
        let chosen = choices.iter().find(|(name, _)| name.get_name() == given);
        chosen.map(|(_, value)| value.clone()).ok_or("not one of the possible values")
    })
}
