//! Errors of readers and exporters as failures of requests.

use tautline_core::failure::Failure;

use crate::export::ExportError;
use crate::export::drones::DroneError;
use crate::read::ReadError;

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::new(error.code(), error.is_machine(), error.to_string()).with_help(error.help())
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        Self::new(error.code(), error.is_machine(), error.to_string()).with_help(error.help())
    }
}

impl From<DroneError> for Failure {
    fn from(error: DroneError) -> Self {
        Self::new(error.code(), error.is_machine(), error.to_string()).with_help(error.help())
    }
}
