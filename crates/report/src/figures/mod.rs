//! A run as charts in SVG.
//!
//! | function | shows |
//! | --- | --- |
//! | [`paths`] | where the vehicles went, from above: start x, end o, a unit as long on both axes |
//! | [`paths_in_space`] | the same in space, where the run is not level |
//! | [`distances`] | distances of pairs, with the safety distance and the certified one |
//! | [`control`] | control effort of each vehicle |
//! | [`channels`] | tilt, rotor thrust, wind and age of messages of each vehicle |
//! | [`energy`] | the law's energy and its start E(0), its bound on a complete graph |
//! | [`shape_error`] | largest error of a desired distance |
//! | [`disagreement`] | largest speed relative to the swarm's mean |
//! | [`encounters`] | distances of pairs of a recording, with bands where they are not known exactly |
//! | [`closest_approach`] | two paths of a recording from above, and from near where they are closest |
//! | [`smallest`] | the smallest distance of all of a recording |
//! | [`tension_curve`] | an edge tension with its barrier and its minimum |
//! | [`convergence`] | an integrator's error over its step |
//! | [`attack`](attack()) | the smallest separation that a search had found over its flights |
//! | [`margin`](margin()) | the share of flights that show something over the values of a key |
//! | [`shares`] | the same of several laws |
//! | [`separations`] | the smallest separation of flights over the values of a key |
//! | [`heat_map`](heat_map()) | a number over a grid of two keys |
//! | [`histograms`] | how often a number of many flights falls where |
//!
//! [`of_run`] draws every one that a run has data for. All of them draw a [`RunHistory`], which watches a run or reads a
//! recording in bounded memory, and never fail for what is in it: what is not a finite number breaks a line, and a
//! history without samples gives empty axes. The same history gives the same bytes, and their number is bounded for any
//! swarm and any time: of many vehicles, quantiles and the extremes are drawn, and a figure says what.
//!
//! Charts use no fonts and no style but their own. They are drawn on a panel that is white, and dark where the reader
//! prefers dark pages, in colours that colour-blind people tell apart.

mod attack;
mod axis;
mod beside;
mod channels;
mod chart;
mod convergence;
mod distances;
mod each;
mod figure;
mod heat_map;
mod histogram;
mod history;
mod margin;
mod paths;
mod recorded;
mod run;
mod scalars;
mod svg;
mod tension;
mod thin;

pub use attack::attack;
pub use channels::channels;
pub use convergence::{Step, convergence};
pub use distances::distances;
pub use figure::Figure;
pub use heat_map::{GridAxis, heat_map};
pub use histogram::{Histogram, histograms};
pub use history::RunHistory;
pub use margin::{Separation, Share, margin, separations, shares};
pub use paths::{paths, paths_in_space};
pub use recorded::{Encounter, closest_approach, encounters, smallest};
pub use run::{Criteria, NAMES_OF_RUN, of_run};
pub use scalars::{control, disagreement, energy, shape_error};
pub use tension::tension_curve;
