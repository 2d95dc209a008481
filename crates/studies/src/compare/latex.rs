//! The comparison as LaTeX: tables that need no package.

use super::measures::{ARRIVALS, COSTS, Measure, OUTCOMES};
use super::result::{Comparison, LawRow};

impl Comparison {
    /// How flights ended, how soon and how near, and what it cost, each a `tabular` with a row a law and the intervals below it. Two
    /// comparisons of the same give the same bytes.
    #[must_use]
    pub fn to_latex(&self) -> String {
        let said = std::iter::once(self.headline()).chain(self.notes());
        let comments = said.fold(String::new(), |text, line| text + "% " + &line + "\n");
        let tables = [&OUTCOMES[..], &ARRIVALS, &COSTS].map(|measures| tabular(measures, &self.laws));
        format!("{comments}% In brackets: 95 % intervals.\n{}", tables.join("\n"))
    }
}

fn tabular(measures: &[Measure], laws: &[LawRow]) -> String {
    let line = |cells: &[String]| format!("{} \\\\\n", cells.join(" & "));
    let names = measures.iter().map(heading);
    let units =
        measures.iter().map(|measure| if measure.unit.is_empty() { String::new() } else { escaped(measure.unit) });
    let mut out = format!("\\begin{{tabular}}{{l{}}}\n\\hline\n", "r".repeat(measures.len()));
    out += &line(&std::iter::once("law".to_owned()).chain(names).collect::<Vec<_>>());
    out += &line(&std::iter::once(String::new()).chain(units).collect::<Vec<_>>());
    out += "\\hline\n";
    for law in laws {
        let cells: Vec<_> = measures.iter().map(|measure| (measure.cell)(law)).collect();
        let values = cells.iter().map(|cell| cell.value.clone());
        out += &line(&std::iter::once(escaped(&law.name)).chain(values).collect::<Vec<_>>());
        let interval = |text: &Option<String>| text.as_ref().map_or_else(String::new, |of| format!("{{\\small {of}}}"));
        out += &line(
            &std::iter::once(String::new())
                .chain(cells.iter().map(|cell| interval(&cell.interval)))
                .collect::<Vec<_>>(),
        );
    }
    out + "\\hline\n\\end{tabular}\n"
}

/// The name of a measure on two lines where it has two parts.
fn heading(measure: &Measure) -> String {
    match measure.name.split_once(", ") {
        Some((first, second)) => format!("\\shortstack{{{}\\\\{}}}", escaped(first), escaped(second)),
        None => escaped(measure.name),
    }
}

/// Text that LaTeX shows as it is.
fn escaped(text: &str) -> String {
    text.replace('_', "\\_").replace('%', "\\%").replace("^2", "$^2$")
}
