//! A chart that is drawn.

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
