//! A run as charts in SVG.
//!
//! | function | shows |
//! | --- | --- |
//! | [`paths`] | where the vehicles went, from above: start x, end o, a unit as long on both axes |
//! | [`paths_in_space`] | the same in space, where the run is not level |
//! | [`distances`] | distances of pairs, with the safety distance and the certified one |
//! | [`control`] | control effort of each vehicle |
//! | [`energy`] | the law's energy and its start E(0), its bound on a complete graph |
//! | [`shape_error`] | largest error of a desired distance |
//! | [`disagreement`] | largest speed relative to the swarm's mean |
//! | [`encounters`] | distances of pairs of a recording, with bands where they are not known exactly |
//! | [`closest_approach`] | two paths of a recording from above, where they are closest |
//! | [`tension_curve`] | an edge tension with its barrier and its minimum |
//! | [`convergence`] | an integrator's error over its step |
//!
//! [`of_run`] draws every one that a run has data for. All of them draw a [`Course`], which watches a run or reads a
//! recording in bounded memory, and never fail for what is in it: what is not a finite number breaks a line, and a
//! course without samples gives empty axes. The same course gives the same bytes.
//!
//! Charts use no fonts and no style but their own. They are drawn on a panel that is white, and dark where the reader
//! prefers dark pages, in colours that colour-blind people tell apart.

mod axis;
mod chart;
mod convergence;
mod course;
mod distances;
mod histories;
mod paths;
mod recorded;
mod tension;
mod thin;

pub use convergence::{Step, convergence};
pub use course::Course;
pub use distances::distances;
pub use histories::{control, disagreement, energy, shape_error};
pub use paths::{paths, paths_in_space};
pub use recorded::{Encounter, closest_approach, encounters};
pub use tension::tension_curve;

use maud::{PreEscaped, html};

use crate::formation::Formation;
use crate::graph::Graph;

/// A finished chart.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Figure {
    /// Short name, such as `paths`: the name of its file without `.svg`.
    pub name: String,
    /// Title, also drawn above the chart.
    pub title: String,
    /// What the chart shows, in sentences, for people who cannot see it.
    pub description: String,
    /// The chart as a complete SVG document, which may also be put into an HTML page as it is.
    pub svg: String,
}

/// What the figures of a run are measured by.
#[derive(Clone, Copy, Debug)]
pub struct Yardsticks<'a> {
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Distance that the law's certificate promised \[m\].
    pub certified_m: Option<f64>,
    /// The formation, and the graph whose edges it is judged by.
    pub shape: Option<(&'a Formation, &'a Graph)>,
    /// Largest edge error that counts as reached \[m\].
    pub edge_error_m: Option<f64>,
    /// Largest velocity disagreement that counts as reached \[m/s\].
    pub disagreement_m_s: Option<f64>,
}

/// A chart could not be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cannot draw {figure}: {reason}")]
pub struct FigureError {
    /// Name of the figure.
    pub figure: String,
    /// What the drawing library said.
    pub reason: String,
}

/// Every figure that a run has data for, in the order in which they are best read.
///
/// # Errors
/// [`FigureError`] when the drawing library refuses, which no course makes it do.
pub fn of_run(course: &Course, yardsticks: &Yardsticks<'_>) -> Result<Vec<Figure>, FigureError> {
    let mut figures = vec![paths(course, "Paths from above")?];
    if !course.is_level() {
        figures.push(paths_in_space(course, "Paths in space")?);
    }
    if course.vehicles() > 1 {
        figures.push(distances(course, yardsticks.delta_m, yardsticks.certified_m, "Distances between vehicles")?);
    }
    figures.push(control(course, "Control effort")?);
    if course.energy_initial().is_some() {
        figures.push(energy(course, "Energy")?);
    }
    if let Some((formation, graph)) = yardsticks.shape {
        figures.push(shape_error(course, formation, graph, yardsticks.edge_error_m, "Shape error")?);
    }
    figures.push(disagreement(course, yardsticks.disagreement_m_s, "Velocity disagreement")?);
    Ok(figures)
}

/// Names of all figures that [`of_run`] can draw.
pub const NAMES_OF_RUN: [&str; 7] =
    ["paths", "paths-3d", "distances", "control", "energy", "shape-error", "disagreement"];

impl Figure {
    /// Puts a drawing of `size` \[tenths of a pixel\] into a frame with a printable title, description and style.
    fn framed(name: &str, title: &str, description: &str, size: (u32, u32), drawing: &str) -> Self {
        let (width, height) = (size.0 / chart::PX, size.1 / chart::PX);
        let view = format!("0 0 {} {}", size.0, size.1);
        let label = format!("{title}. {description}");
        let svg = html! {
            svg xmlns="http://www.w3.org/2000/svg" class="tautline-figure" width=(width) height=(height) viewBox=(view)
                role="img" aria-label=(label) {
                title { (title) }
                desc { (description) }
                style { (PreEscaped(chart::style())) }
                (PreEscaped(drawing))
            }
        };
        Self {
            name: name.to_owned(),
            title: title.to_owned(),
            description: description.to_owned(),
            svg: svg.into_string(),
        }
    }
}

/// The same text without control characters, which XML does not allow.
fn printable(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).collect()
}

impl FigureError {
    fn new(figure: &str, reason: &dyn std::fmt::Display) -> Self {
        Self { figure: figure.to_owned(), reason: reason.to_string() }
    }
}
