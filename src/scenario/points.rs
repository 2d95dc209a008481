//! Files of points: a line for each, its coordinates in columns.

use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Trim};

use super::error::ScenarioError;
use super::files::{KEY, bytes};
use super::values::Point;

/// The points of a file of text: columns x, y and perhaps z in m, in this order or as a first line names them (`x`,
/// `y_m`, ...), with commas, semicolons, tabs or blanks between. Empty lines, and those that begin with `#`, do not
/// count.
pub(super) fn read(path: &Path) -> Result<Vec<Point>, ScenarioError> {
    let refused = |line: u64, said: &str| {
        ScenarioError::new(format!("{}:{line}: {said}", path.display()))
            .with_help(
                "a line has the coordinates of a slot in m, such as 1.5,2.0 or 1.5,2.0,3.0; a first line may name the \
                 columns x, y, z",
            )
            .at(KEY)
    };
    let bytes = bytes(path)?;
    let text = std::str::from_utf8(&bytes).map_err(|error| refused(1, &format!("this is no text: {error}")))?;
    let text = text.trim_start_matches('\u{feff}');
    let delimiter = delimiter(text);
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(Trim::All)
        .comment(Some(b'#'))
        .delimiter(delimiter)
        .from_reader(text.as_bytes());
    let (mut columns, mut is_named): (Vec<usize>, _) = (Vec::new(), false);
    let mut points = Vec::new();
    for record in reader.records() {
        let record =
            record.map_err(|error| refused(error.position().map_or(1, csv::Position::line), &error.to_string()))?;
        let line = record.position().map_or(1, csv::Position::line);
        let fields = fields(&record, delimiter);
        if fields.is_empty() {
            continue;
        }
        if columns.is_empty() {
            let named = named(&fields);
            let is_heading = named.is_some();
            let unnamed = || if fields.len() <= 3 { Ok((0..fields.len()).collect()) } else { Err(fields.len()) };
            let found = named.map_or_else(unnamed, Ok);
            columns = found.map_err(|count| refused(line, &format!("{count} columns without the names x and y")))?;
            if is_heading {
                is_named = true;
                continue;
            }
        }
        if !is_named && fields.len() > columns.len() {
            let said = format!("{} columns where the first line has {}", fields.len(), columns.len());
            return Err(refused(line, &said));
        }
        points.push(point(&fields, &columns).map_err(|said| refused(line, &said))?);
    }
    if points.is_empty() { Err(refused(1, "there is no point")) } else { Ok(points) }
}

/// What stands between columns: the first line with a number or a name tells.
fn delimiter(text: &str) -> u8 {
    let first = text.lines().find(|line| !line.trim().is_empty() && !line.starts_with('#')).unwrap_or_default();
    [b',', b';', b'\t'].into_iter().find(|&mark| first.as_bytes().contains(&mark)).unwrap_or(b' ')
}

fn fields(record: &StringRecord, delimiter: u8) -> Vec<&str> {
    record.iter().filter(|field| delimiter != b' ' || !field.is_empty()).collect()
}

/// The columns of x, y and perhaps z, where a heading names the first two.
fn named(fields: &[&str]) -> Option<Vec<usize>> {
    let names: Vec<String> = fields.iter().map(|field| field.to_ascii_lowercase()).collect();
    let column = |axis: &str| names.iter().position(|name| name.strip_suffix("_m").unwrap_or(name) == axis);
    let [x, y] = [column("x")?, column("y")?];
    Some([x, y].into_iter().chain(column("z")).collect())
}

fn point(fields: &[&str], columns: &[usize]) -> Result<Point, String> {
    let number = |&column: &usize| {
        let field = fields.get(column).ok_or_else(|| format!("{} columns, not {}", fields.len(), columns.len()))?;
        field.parse::<f64>().map_err(|_| format!("`{}` is not a number", field.chars().take(40).collect::<String>()))
    };
    match &columns.iter().map(number).collect::<Result<Vec<_>, _>>()?[..] {
        &[x, y] => Ok(Point::Plane([x, y])),
        &[x, y, z] => Ok(Point::Space([x, y, z])),
        other => Err(format!("{} columns; a slot has x, y and perhaps z", other.len())),
    }
}
