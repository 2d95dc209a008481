//! The independent judge: of a flight step by step, and of recordings of any origin.

mod findings;
mod flown;
mod recorded;
mod scenes;
