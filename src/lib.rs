//! tautline flies a swarm into formation inside a rigid-body engine and proves that nothing touched.

pub mod audit;
pub mod formation;
pub mod graph;
pub mod law;
pub mod metrics;
pub mod plant;
pub mod record;
pub mod report;
pub mod scenario;
pub mod sim;
pub mod swarm;
