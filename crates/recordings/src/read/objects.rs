//! Reads tables of JSON objects: one per line, or the elements of an array. Keys are columns. Keys of nested objects
//! are joined with dots; lists of two or three numbers have the keys x, y and z. Lines of `TrajNet++` hold a frame, a
//! pedestrian and a position in the object `track`; its lines with the object `scene` hold no position.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt;
use std::io::{BufReader, Bytes, Read};

use serde::de::{DeserializeSeed, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};

use super::cells::{Cell, Cells};
use super::clock::{EXACT, Stamp};
use super::error::{ContentKind, Fault, Place, ReadError, quoted, refuse};
use super::layout::Layout;
use super::options::ReadOptions;
use super::order::Recording;
use super::source::{BLOCK_BYTES, LINE_LIMIT_BYTES, Lines, Source};
use super::table;

/// Largest number of columns; more indicate lists of changing length.
const MOST_COLUMNS: usize = 100_000;

/// Keys of a position in `TrajNet++`, and the names of their columns.
const TRAJNET: [(&str, &str); 4] = [("track.f", "frame"), ("track.p", "id"), ("track.x", "x"), ("track.y", "y")];

/// Bytes of a mark at the beginning of a text in UTF-8.
const BOM: [u8; 3] = [0xef, 0xbb, 0xbf];

/// Opens a table.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let objects = Objects::open(source)?;
    if objects.is_trajnet {
        objects.scenes.check(options)?;
    }
    let layout = Layout::of(&objects.header, options, &source.stem())?;
    let is_of =
        |list: &str, column: &usize| objects.header[*column].strip_prefix(list).is_some_and(|end| end.starts_with('.'));
    let (is_named, used) = (layout.id.is_some() || !layout.slots.ids.is_empty(), layout.columns());
    let mut uneven = objects.uneven.iter().filter(|_| !is_named);
    if let Some((list, line)) = uneven.find(|(list, _)| used.iter().any(|column| is_of(list, column))) {
        let problem = format!(
            "the length of the list {} differs from the first object; its elements cannot be assigned to vehicles",
            quoted(list)
        );
        let remedy = "name each vehicle in its object, as in {\"id\": \"a\", \"x\": 1, ...}";
        return Err(Fault::content(ContentKind::ListLength, problem, remedy).at(objects.text.place(*line)));
    }
    table::open(source, objects, layout, None, 0, options)
}

/// Returns whether a text begins with an array of objects, or with a complete object in one line and another object
/// below.
pub(super) fn are_in(text: &[u8]) -> bool {
    if let Some(elements) = text.strip_prefix(b"[") {
        return elements.trim_ascii_start().starts_with(b"{");
    }
    let mut lines = text.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii).filter(|line| !line.is_empty());
    let is_object = |line: &[u8]| line.starts_with(b"{") && serde_json::from_slice::<IgnoredAny>(line).is_ok();
    lines.next().is_some_and(is_object) && lines.next().is_some_and(|line| line.starts_with(b"{"))
}

/// Text of objects, with one object in memory.
enum ObjectText {
    /// One object per line.
    Lines(Lines),
    Elements(Elements),
}

impl ObjectText {
    fn open(source: &Source) -> Result<Self, ReadError> {
        let mut first = [0];
        let mut bytes = source.bytes()?;
        while bytes.read(&mut first)? == 1 && (first[0].is_ascii_whitespace() || BOM.contains(&first[0])) {}
        let is_array = first == *b"[";
        Ok(if is_array { Self::Elements(Elements::open(source)?) } else { Self::Lines(Lines::new(source)?) })
    }

    /// Moves to the next object; returns `false` after the last one.
    fn advance(&mut self) -> Result<bool, ReadError> {
        match self {
            Self::Elements(elements) => elements.advance(),
            Self::Lines(lines) => {
                while lines.advance()? {
                    if !lines.line().trim_ascii().is_empty() {
                        return Ok(true);
                    }
                }
                Ok(false)
            }
        }
    }

    /// Returns the current object.
    fn object(&self) -> &[u8] {
        match self {
            Self::Lines(lines) => lines.line().trim_ascii(),
            Self::Elements(elements) => &elements.element,
        }
    }

    /// Returns the number of the current object, from 1.
    fn number(&self) -> u64 {
        match self {
            Self::Lines(lines) => lines.number(),
            Self::Elements(elements) => elements.number,
        }
    }

    /// Returns the place of the object with this number.
    fn place(&self, number: u64) -> Place {
        match self {
            Self::Lines(_) => Place::Line(number),
            Self::Elements(_) => Elements::place(number),
        }
    }
}

/// Elements of an array of objects.
struct Elements {
    input: Bytes<BufReader<Box<dyn Read>>>,
    element: Vec<u8>,
    number: u64,
    has_ended: bool,
}

impl Elements {
    fn open(source: &Source) -> Result<Self, ReadError> {
        let input = BufReader::with_capacity(BLOCK_BYTES, source.bytes()?).bytes();
        let mut elements = Self { input, element: Vec::new(), number: 0, has_ended: false };
        while elements.next_sign()? != b'[' {}
        Ok(elements)
    }

    fn byte(&mut self) -> Result<u8, ReadError> {
        let byte = self.input.next().transpose().map_err(|error| self.fault(error))?;
        byte.ok_or_else(|| self.fault(Fault::truncated("the end of its array is missing")))
    }

    /// Returns the next byte that is not blank.
    fn next_sign(&mut self) -> Result<u8, ReadError> {
        loop {
            let byte = self.byte()?;
            if !byte.is_ascii_whitespace() {
                return Ok(byte);
            }
        }
    }

    fn fault(&self, fault: impl Into<Fault>) -> ReadError {
        fault.into().at(Self::place(self.number.max(1)))
    }

    /// Refuses a byte that cannot be at its place.
    fn refuse(&self, byte: u8, expected: &str) -> ReadError {
        let problem =
            format!("it is not an array of JSON objects: {expected} is expected, got {}", byte.escape_ascii());
        self.fault(Fault::content(
            ContentKind::Malformed,
            problem,
            "write an array like [{\"t\": 0, \"id\": \"a\", ...}, ...]",
        ))
    }

    /// Reads an object up to its closing brace.
    fn read_object(&mut self) -> Result<(), ReadError> {
        let (mut depth, mut in_text, mut is_escaped) = (1_u64, false, false);
        self.element.clear();
        self.element.push(b'{');
        while depth > 0 {
            let byte = self.byte()?;
            if self.element.len() == LINE_LIMIT_BYTES {
                return Err(self.fault(Fault::line_too_long(LINE_LIMIT_BYTES)));
            }
            self.element.push(byte);
            match byte {
                _ if is_escaped => is_escaped = false,
                b'\\' if in_text => is_escaped = true,
                b'"' => in_text = !in_text,
                b'{' if !in_text => depth += 1,
                b'}' if !in_text => depth -= 1,
                _ => {}
            }
        }
        Ok(())
    }

    /// Moves to the next object; returns `false` after the last one.
    fn advance(&mut self) -> Result<bool, ReadError> {
        if self.has_ended {
            return Ok(false);
        }
        self.number += 1;
        let mut sign = self.next_sign()?;
        if self.number > 1 && sign == b',' {
            sign = self.next_sign()?;
        } else if self.number > 1 && sign != b']' {
            return Err(self.refuse(sign, "a comma or a closing bracket"));
        }
        match sign {
            b'{' => self.read_object().map(|()| true),
            b']' => {
                self.has_ended = true;
                self.element.clear();
                let rest = self.input.find(|byte| !byte.as_ref().is_ok_and(u8::is_ascii_whitespace)).transpose();
                let rest = rest.map_err(|error| self.fault(error))?;
                rest.map_or(Ok(false), |byte| Err(self.refuse(byte, "the end of the file")))
            }
            other => Err(self.refuse(other, "an object")),
        }
    }

    fn place(number: u64) -> Place {
        Place::Part(format!("element {number}"))
    }
}

/// Key of a predicted position in `TrajNet++`, with the number of the prediction.
const PREDICTION: &str = "track.prediction_number";

/// Rates of positions that the scenes of `TrajNet++` state, and the step of its frames.
#[derive(Debug, Default)]
struct Scenes {
    /// Positions per second that the first scene states, as text.
    fps: Option<String>,
    /// Another rate of a later scene.
    other_fps: Option<String>,
    first_frame: Option<u64>,
    /// Greatest common divisor of the distances between frames; 0 for one frame.
    step: u64,
    /// Whether a frame is not a whole number.
    is_uneven: bool,
}

impl Scenes {
    /// Records the rate of a scene or the frame of a position.
    fn observe(&mut self, flat: &[(String, Cell)]) {
        for (key, cell) in flat {
            match key.as_str() {
                "scene.fps" => {
                    let text = || cell.text().map(Cow::into_owned).unwrap_or_default();
                    let fps = cell.number().map_or_else(text, |fps| fps.to_string());
                    match &self.fps {
                        None => self.fps = Some(fps),
                        Some(first) if *first != fps => self.other_fps = Some(fps),
                        Some(_) => {}
                    }
                }
                "track.f" => self.observe_frame(cell),
                _ => {}
            }
        }
    }

    fn observe_frame(&mut self, cell: &Cell) {
        let Some(frame) = cell.number().and_then(|frame| Stamp::Real(frame).whole()) else {
            self.is_uneven = true;
            return;
        };
        let frame = frame.unsigned_abs();
        let first = *self.first_frame.get_or_insert(frame);
        let (mut one, mut other) = (self.step, frame.abs_diff(first));
        while other != 0 {
            (one, other) = (other, one % other);
        }
        self.step = one;
    }

    /// Refuses a rate of frames that contradicts the scenes, and names the right one if none is given.
    ///
    /// The step of the frames is that of positions, or a multiple of it if all vehicles miss positions.
    fn check(&self, options: &ReadOptions) -> Result<(), Fault> {
        /// Relative rounding of a rate.
        const ROUNDING: f64 = 1e-6;
        let Some(stated) = &self.fps else { return Ok(()) };
        if let Some(other) = &self.other_fps {
            let problem = format!("its scenes state {stated} and {other} positions per second");
            return refuse(ContentKind::Frames, problem, "write the scenes of each rate to a file of their own");
        }
        let Some(fps) = stated.parse().ok().filter(|&fps: &f64| fps > 0.0 && fps.is_finite()) else {
            let problem = format!("its scenes state {} positions per second", quoted(stated));
            return refuse(ContentKind::Frames, problem, "correct `fps` of the scenes, or remove it");
        };
        if self.is_uneven || self.step == 0 {
            return Ok(());
        }
        let rate = fps * self.step as f64;
        let states = format!("its scenes state {fps} positions per second, and frames have steps of {}", self.step);
        let remedy = format!("give a rate of {rate} frames per second");
        let Some(given) = options.times_per_second.or(options.time_unit.map(|unit| unit.per_second() as f64)) else {
            return refuse(ContentKind::Frames, format!("its times are the numbers of frames; {states}"), remedy);
        };
        let equals = |other: f64| (given / other - 1.0).abs() <= ROUNDING;
        let parts = (rate / given).round();
        if equals(rate) || (parts > 1.0 && equals(rate / parts) && !equals(fps)) {
            return Ok(());
        }
        refuse(ContentKind::UnitConflict, format!("{states}, but {given} frames per second are given"), remedy)
    }
}

/// Objects of a file, one by one.
struct Objects {
    source: Source,
    text: ObjectText,
    /// Whether objects without a key of `track` hold no position.
    is_trajnet: bool,
    scenes: Scenes,
    header: Vec<String>,
    columns: HashMap<String, usize>,
    cells: Vec<Cell>,
    flat: Vec<(String, Cell)>,
    /// Lists of objects in the object, and their lengths above 0.
    lists: Vec<(String, usize)>,
    /// Lists of objects with changing length, and the number of the object with the first change.
    uneven: BTreeMap<String, u64>,
}

impl Objects {
    /// Opens a file and collects the keys of all objects.
    fn open(source: &Source) -> Result<Self, ReadError> {
        let mut objects = Self {
            source: source.clone(),
            text: ObjectText::open(source)?,
            is_trajnet: false,
            scenes: Scenes::default(),
            header: Vec::new(),
            columns: HashMap::new(),
            cells: Vec::new(),
            flat: Vec::new(),
            lists: Vec::new(),
            uneven: BTreeMap::new(),
        };
        let mut lengths: HashMap<String, usize> = HashMap::new();
        while objects.next_object()? {
            for (list, length) in objects.lists.drain(..) {
                if *lengths.entry(list.clone()).or_insert(length) != length {
                    objects.uneven.entry(list).or_insert(objects.text.number());
                }
            }
            if objects.flat.iter().any(|(key, cell)| key == PREDICTION && !matches!(cell, Cell::Empty)) {
                let problem = format!("`{PREDICTION}` marks a predicted position beside measured positions");
                let remedy =
                    "remove the lines of predictions, or judge each prediction as a file of its own, without this key";
                let fault = Fault::content(ContentKind::AmbiguousLayout, problem, remedy);
                return Err(objects.fault(fault));
            }
            objects.scenes.observe(&objects.flat);
            for (key, _) in &objects.flat {
                if objects.columns.contains_key(key) {
                    continue;
                }
                if objects.header.len() == MOST_COLUMNS {
                    let problem = format!("its objects have more than {MOST_COLUMNS} different keys");
                    let remedy = "write one object per vehicle and time, with the same keys in all";
                    let fault = Fault::content(ContentKind::FieldCount, problem, remedy);
                    return Err(objects.fault(fault));
                }
                objects.columns.insert(key.clone(), objects.header.len());
                objects.header.push(key.clone());
            }
        }
        if objects.header.is_empty() {
            return Err(Fault::empty().into());
        }
        objects.rename_trajnet();
        Ok(objects)
    }

    /// Names the columns of `TrajNet++` like those of other tables.
    fn rename_trajnet(&mut self) {
        self.is_trajnet = TRAJNET.iter().all(|(key, _)| self.columns.contains_key(*key));
        if !self.is_trajnet {
            return;
        }
        self.header.retain(|key| !key.starts_with("scene."));
        self.columns = self.header.iter().enumerate().map(|(column, key)| (key.clone(), column)).collect();
        for name in &mut self.header {
            let known = TRAJNET.iter().find(|(key, _)| key == name).map(|(_, column)| *column);
            *name = known.unwrap_or(name.strip_prefix("track.").unwrap_or(name)).to_owned();
        }
    }

    /// Moves to the next object and flattens it.
    fn next_object(&mut self) -> Result<bool, ReadError> {
        loop {
            self.flat.clear();
            self.lists.clear();
            if !self.text.advance()? {
                return Ok(false);
            }
            take_apart(self.text.object(), &mut self.flat, &mut self.lists)
                .map_err(|fault| fault.at(self.text.place(self.text.number())))?;
            if !self.is_trajnet || self.flat.iter().any(|(key, _)| key.starts_with("track.")) {
                return Ok(true);
            }
        }
    }
}

fn take_apart(line: &[u8], flat: &mut Vec<(String, Cell)>, lists: &mut Vec<(String, usize)>) -> Result<(), Fault> {
    let refused = |what: String| {
        let remedy = "write one object like {\"t\": 0, \"id\": \"a\", ...} per line";
        Fault::content(ContentKind::Malformed, format!("it is not a JSON object: {what}"), remedy)
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
        self.push(Cell::Whole(value.into()));
        Ok(())
    }

    fn visit_u64<E>(self, value: u64) -> Result<(), E> {
        self.push(Cell::Whole(value.into()));
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
        let mut known = HashSet::new();
        while let Some(key) = map.next_key::<String>()? {
            let whole = if self.key.is_empty() { key.clone() } else { format!("{}.{key}", self.key) };
            if known.contains(&key) {
                return Err(A::Error::custom(format!("the key {} occurs twice", quoted(&key))));
            }
            known.insert(key);
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
        self.text = ObjectText::open(&self.source)?;
        Ok(())
    }

    fn advance(&mut self) -> Result<bool, ReadError> {
        self.cells.clear();
        self.cells.resize(self.header.len(), Cell::Empty);
        let more = self.next_object()?;
        for (key, cell) in self.flat.drain(..) {
            if let Some(&column) = self.columns.get(&key) {
                self.cells[column] = cell;
            }
        }
        Ok(more)
    }

    fn row(&self) -> u64 {
        self.text.number()
    }

    fn place(&self, row: u64) -> Place {
        self.text.place(row)
    }

    fn text(&self, column: usize) -> Result<Cow<'_, str>, Fault> {
        self.cells[column].text()
    }

    /// Refuses integers beyond 64 bits: several of them are one double.
    fn name(&self, column: usize) -> Result<Cow<'_, str>, Fault> {
        match self.cells[column] {
            Cell::Real(real) if real.abs() >= EXACT => {
                let problem =
                    format!("key `{}` holds {real:e}, a number too large to name a vehicle", self.header[column]);
                refuse(ContentKind::ElementType, problem, "write names of vehicles as text")
            }
            _ => self.text(column),
        }
    }

    fn number(&self, column: usize) -> Option<f64> {
        self.cells[column].number()
    }

    /// Formats a double as its shortest decimal, which restores the text of the file.
    fn stamp(&mut self, column: usize) -> Option<Stamp> {
        match &self.cells[column] {
            Cell::Real(real) => Stamp::parse(&format!("{real:?}")),
            cell => cell.stamp(),
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
