//! Rules and geometry that replays, pictures, Foxglove scenes and figures share.

pub mod colours;
mod limits;
mod obstacles;
pub(crate) mod rotors;
mod surroundings;
mod viewpoint;

pub use limits::{LIGHT, LIMITS, Limits, MOST_LINKS, TAN_HALF_VIEW, UNKNOWN_RADIUS_M, link_look, max_clearance_m};
pub(crate) use obstacles::perpendicular;
pub use obstacles::{box_corners, box_sides, is_level, plane_section, shape_bounds};
pub use rotors::Rotors;
pub use surroundings::{Ground, Surroundings};
pub use viewpoint::{Viewpoint, is_between, turns_deg};
