//! Reads tables with one JSON object per line. Keys are columns. Keys of nested objects are joined with dots; lists of
//! two or three numbers have the keys x, y and z.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fmt;

use serde::de::{DeserializeSeed, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};

use super::clock::Stamp;
use super::error::{Fault, Place, ReadError, quoted};
use super::layout::Layout;
use super::options::ReadOptions;
use super::order::Recording;
use super::readers::{FormatOption, Packing, Reader};
use super::source::{Lines, Source};
use super::table;
use super::table::Cells;

pub(super) const READER: Reader = Reader {
    name: "jsonl",
    title: "a table of JSON objects",
    extensions: &["jsonl", "ndjson"],
    docs: "Table with an object of JSON in each line",
    magic: &[],
    sniff: |head| head.is_text(are_in),
    open,
    supports: FormatOption::TABLE,
    packing: Packing::Any,
};

/// Largest number of columns; more indicate lists of changing length.
const MOST_COLUMNS: usize = 100_000;

/// Opens a table.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let objects = Objects::open(source)?;
    let layout = Layout::of(&objects.header, options, &source.stem())?;
    let is_of =
        |list: &str, column: &usize| objects.header[*column].strip_prefix(list).is_some_and(|end| end.starts_with('.'));
    let (is_named, used) = (layout.id.is_some() || !layout.slots.ids.is_empty(), layout.columns());
    let mut uneven = objects.uneven.iter().filter(|_| !is_named);
    if let Some((list, line)) = uneven.find(|(list, _)| used.iter().any(|column| is_of(list, column))) {
        let problem = format!(
            "the length of the list {} differs from the first line; its elements cannot be assigned to vehicles",
            quoted(list)
        );
        let remedy = "name each vehicle in its object, as in {\"id\": \"a\", \"x\": 1, ...}";
        return Err(Fault::coded("recording/list-length", problem, remedy).at(Place::Line(*line)));
    }
    table::open(source, objects, layout, None, 0, options)
}

/// Returns whether a text begins with a complete object in one line and another object below.
pub(super) fn are_in(text: &[u8]) -> bool {
    let mut lines = text.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii).filter(|line| !line.is_empty());
    let is_object = |line: &[u8]| line.starts_with(b"{") && serde_json::from_slice::<IgnoredAny>(line).is_ok();
    lines.next().is_some_and(is_object) && lines.next().is_some_and(|line| line.starts_with(b"{"))
}

/// Value of a key.
#[derive(Clone, Debug, Default, PartialEq)]
enum Cell {
    #[default]
    Empty,
    Whole(i64),
    Real(f64),
    Text(String),
}

/// Objects of a file, line by line.
struct Objects {
    source: Source,
    lines: Lines,
    header: Vec<String>,
    columns: HashMap<String, usize>,
    cells: Vec<Cell>,
    flat: Vec<(String, Cell)>,
    /// Lists of objects in the line, and their lengths above 0.
    lists: Vec<(String, usize)>,
    /// Lists of objects with changing length, and the line of the first change.
    uneven: BTreeMap<String, u64>,
}

impl Objects {
    /// Opens a file and collects the keys of all lines.
    fn open(source: &Source) -> Result<Self, ReadError> {
        let mut objects = Self {
            source: source.clone(),
            lines: Lines::new(source)?,
            header: Vec::new(),
            columns: HashMap::new(),
            cells: Vec::new(),
            flat: Vec::new(),
            lists: Vec::new(),
            uneven: BTreeMap::new(),
        };
        let mut lengths: HashMap<String, usize> = HashMap::new();
        while objects.next_line()? {
            for (list, length) in objects.lists.drain(..) {
                if *lengths.entry(list.clone()).or_insert(length) != length {
                    objects.uneven.entry(list).or_insert(objects.lines.number());
                }
            }
            for (key, _) in &objects.flat {
                if objects.columns.contains_key(key) {
                    continue;
                }
                if objects.header.len() == MOST_COLUMNS {
                    let problem = format!("its objects have more than {MOST_COLUMNS} different keys");
                    let remedy = "write one object per vehicle and time, with the same keys in all";
                    return Err(
                        Fault::coded("recording/field-count", problem, remedy).at(Place::Line(objects.lines.number()))
                    );
                }
                objects.columns.insert(key.clone(), objects.header.len());
                objects.header.push(key.clone());
            }
        }
        if objects.header.is_empty() { Err(Fault::Empty.into()) } else { Ok(objects) }
    }

    /// Moves to the next line that is not blank, and flattens its object.
    fn next_line(&mut self) -> Result<bool, ReadError> {
        self.flat.clear();
        self.lists.clear();
        while self.lines.advance()? {
            let line = self.lines.line().trim_ascii();
            if line.is_empty() {
                continue;
            }
            let (flat, lists) = (&mut self.flat, &mut self.lists);
            return take_apart(line, flat, lists)
                .map(|()| true)
                .map_err(|fault| fault.at(Place::Line(self.lines.number())));
        }
        Ok(false)
    }
}

fn take_apart(line: &[u8], flat: &mut Vec<(String, Cell)>, lists: &mut Vec<(String, usize)>) -> Result<(), Fault> {
    let refused = |what: String| {
        Fault::coded(
            "recording/malformed",
            format!("it is not a JSON object: {what}"),
            "write one object like {\"t\": 0, \"id\": \"a\", ...} per line",
        )
    };
    if !line.starts_with(b"{") {
        return Err(refused("it does not begin with a brace".to_owned()));
    }
    let mut json = serde_json::Deserializer::from_slice(line);
    Flat { key: String::new(), cells: flat, lists }
        .deserialize(&mut json)
        .map_err(|error| refused(error.to_string()))?;
    json.end().map_err(|error| refused(error.to_string()))
}

/// Deserializer that appends values with their full keys.
struct Flat<'a> {
    key: String,
    cells: &'a mut Vec<(String, Cell)>,
    lists: &'a mut Vec<(String, usize)>,
}

impl Flat<'_> {
    fn push(self, cell: Cell) {
        self.cells.push((self.key, cell));
    }
}

impl<'de> DeserializeSeed<'de> for Flat<'_> {
    type Value = ();

    fn deserialize<D: serde::Deserializer<'de>>(self, json: D) -> Result<(), D::Error> {
        json.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Flat<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        self.push(Cell::Empty);
        Ok(())
    }

    fn visit_bool<E>(self, value: bool) -> Result<(), E> {
        self.push(Cell::Text(value.to_string()));
        Ok(())
    }

    fn visit_i64<E>(self, value: i64) -> Result<(), E> {
        self.push(Cell::Whole(value));
        Ok(())
    }

    fn visit_u64<E>(self, value: u64) -> Result<(), E> {
        self.push(i64::try_from(value).map_or(Cell::Real(value as f64), Cell::Whole));
        Ok(())
    }

    fn visit_f64<E>(self, value: f64) -> Result<(), E> {
        self.push(Cell::Real(value));
        Ok(())
    }

    fn visit_str<E>(self, value: &str) -> Result<(), E> {
        self.push(Cell::Text(value.to_owned()));
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut known = Vec::new();
        while let Some(key) = map.next_key::<String>()? {
            if known.contains(&key) {
                return Err(A::Error::custom(format!("the key {} occurs twice", quoted(&key))));
            }
            let whole = if self.key.is_empty() { key.clone() } else { format!("{}.{key}", self.key) };
            known.push(key);
            map.next_value_seed(Flat { key: whole, cells: self.cells, lists: self.lists })?;
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<(), A::Error> {
        let (before, mut count) = (self.cells.len(), 0);
        loop {
            let element = Flat { key: format!("{}.{count}", self.key), cells: self.cells, lists: self.lists };
            if list.next_element_seed(element)?.is_none() {
                break;
            }
            count += 1;
        }
        let elements = &mut self.cells[before..];
        let depth = |key: &str| key.bytes().filter(|&byte| byte == b'.').count();
        let own = depth(&self.key) + 1;
        if elements.iter().any(|(key, _)| depth(key) > own) {
            self.lists.push((self.key.clone(), count));
        }
        let is_number = |cell: &Cell| matches!(cell, Cell::Whole(_) | Cell::Real(_) | Cell::Empty);
        if matches!(count, 2 | 3) && elements.len() == count && elements.iter().all(|(_, cell)| is_number(cell)) {
            for ((key, _), axis) in elements.iter_mut().zip(["x", "y", "z"]) {
                *key = format!("{}.{axis}", self.key);
            }
        }
        Ok(())
    }
}

impl Cells for Objects {
    fn header(&self) -> &[String] {
        &self.header
    }

    fn restart(&mut self, _columns: &[usize], _all: bool) -> Result<(), ReadError> {
        self.lines = Lines::new(&self.source)?;
        Ok(())
    }

    fn advance(&mut self) -> Result<bool, ReadError> {
        self.cells.clear();
        self.cells.resize(self.header.len(), Cell::Empty);
        let more = self.next_line()?;
        for (key, cell) in self.flat.drain(..) {
            if let Some(&column) = self.columns.get(&key) {
                self.cells[column] = cell;
            }
        }
        Ok(more)
    }

    fn row(&self) -> u64 {
        self.lines.number()
    }

    fn place(row: u64) -> Place {
        Place::Line(row)
    }

    fn text(&self, column: usize) -> Result<Cow<'_, str>, Fault> {
        Ok(match &self.cells[column] {
            Cell::Empty => "".into(),
            Cell::Whole(whole) => whole.to_string().into(),
            Cell::Real(real) => format!("{real:?}").into(),
            Cell::Text(text) => text.as_str().into(),
        })
    }

    fn number(&self, column: usize) -> Option<f64> {
        match &self.cells[column] {
            Cell::Whole(whole) => Some(*whole as f64),
            Cell::Real(real) => Some(*real),
            Cell::Text(text) => text.trim().parse().ok(),
            Cell::Empty => None,
        }
    }

    /// Formats a double as its shortest decimal, which restores the text of the file.
    fn stamp(&mut self, column: usize) -> Option<Stamp> {
        match &self.cells[column] {
            Cell::Whole(whole) => Some(Stamp::Whole(*whole)),
            Cell::Real(real) => Stamp::parse(&format!("{real:?}")),
            Cell::Text(text) => Stamp::parse(text.trim()),
            Cell::Empty => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_object_is_flattened() {
        let mut flat = Vec::new();
        let line = br#"{"t": 1, "pose": {"position": [1, 2.5, -3], "q": [0, 0, 0, 1]}, "id": "a", "lost": null}"#;
        take_apart(line, &mut flat, &mut Vec::new()).expect("an object");
        let keys: Vec<_> = flat.iter().map(|(key, _)| key.as_str()).collect();
        let expected = "t pose.position.x pose.position.y pose.position.z pose.q.0 pose.q.1 pose.q.2 pose.q.3 id lost";
        assert_eq!(keys.join(" "), expected);
        assert_eq!((&flat[2].1, &flat[8].1), (&Cell::Real(2.5), &Cell::Text("a".to_owned())));
        for wrong in ["[1]", r#"{"t": 1, "t": 2}"#, r#"{"t": NaN}"#, r#"{"t": 1} x"#, r#"{"t": "#] {
            assert!(take_apart(wrong.as_bytes(), &mut Vec::new(), &mut Vec::new()).is_err(), "{wrong}");
        }
    }
}
