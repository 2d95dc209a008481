//! Errors of scenarios: place, message and remedy.

use std::fmt;

use tautline_core::coded;
use tautline_core::fact::Coded;
use tautline_core::failure::{Failure, LONGEST_LINE, Place};
use tautline_core::text::with_short_numbers;

/// Error of a scenario: kind, keys, problem and remedy.
///
/// [`fmt::Display`] writes place, problem and remedy.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ScenarioError {
    /// Kind of the problem.
    pub kind: ErrorKind,
    /// The problem with its value, one sentence.
    pub message: String,
    /// The remedy.
    pub help: String,
    /// Keys that are part of the problem, as an override names them: `start.positions_m.2` is the position of vehicle
    /// 2, and `leg.1.points_m.2` its slot in the first `[[leg]]`. The error is placed at the first one, unless an
    /// override set another one.
    pub keys: Vec<String>,
    /// Place in the text; `None` for a scenario built in code, and for a file that could not be read.
    pub place: Option<Box<Place>>,
}

coded! {
    /// Kind of a [`ScenarioError`].
    ErrorKind {
        /// The source cannot be read.
        CannotRead = "scenario/cannot-read",
        /// A list has another length than the number of vehicles.
        CountMismatch = "scenario/count-mismatch",
        /// The graph is not connected.
        Disconnected = "scenario/disconnected",
        /// An edge of the graph does not join two vehicles.
        Edge = "scenario/edge",
        /// The text has no keys.
        Empty = "scenario/empty",
        /// Two keys exclude each other.
        ExclusiveKeys = "scenario/exclusive-keys",
        /// A file that the scenario names cannot be used.
        File = "scenario/file",
        /// Two hulls do not fit within the safety distance.
        HullsTouch = "scenario/hulls-touch",
        /// Keys contradict each other.
        Inconsistent = "scenario/inconsistent",
        /// The law cannot be built with its parameters.
        LawParameter = "law/parameter",
        /// The flight needs too much memory.
        Memory = "scenario/memory",
        /// A required key is missing.
        MissingKey = "scenario/missing-key",
        /// A name has other characters than letters, digits, `-` and `_`.
        Name = "scenario/name",
        /// A vehicle or a slot is within the clearance of an obstacle.
        NearObstacle = "scenario/near-obstacle",
        /// The vehicles do not fit into the space of the start.
        NoRoom = "scenario/no-room",
        /// The file or the built-in scenario does not exist.
        NotFound = "scenario/not-found",
        /// The text is not UTF-8.
        NotUtf8 = "scenario/not-utf8",
        /// An obstacle cannot be judged.
        Obstacle = "scenario/obstacle",
        /// A number is out of its range.
        OutOfRange = "scenario/out-of-range",
        /// A time or a duration is outside the flight.
        OutsideFlight = "scenario/outside-flight",
        /// An override cannot be applied.
        Override = "scenario/override",
        /// A vector leaves the plane of the swarm.
        Plane = "scenario/plane",
        /// The reference cannot be followed.
        Reference = "scenario/reference",
        /// A shape gives no formation.
        Shape = "scenario/shape",
        /// The shield has no certificate.
        Shield = "scenario/shield",
        /// The step is too long for a rate or a duration.
        StepTooLong = "scenario/step-too-long",
        /// The text is not TOML.
        Syntax = "scenario/syntax",
        /// The file is too large.
        TooLarge = "scenario/too-large",
        /// The flight has too many steps.
        TooManySteps = "scenario/too-many-steps",
        /// A word is none of the choices.
        UnknownChoice = "scenario/unknown-choice",
        /// The key does not exist.
        UnknownKey = "scenario/unknown-key",
        /// The vehicle does not exist.
        UnknownVehicle = "scenario/unknown-vehicle",
        /// The law does not support a setting.
        UnsupportedByLaw = "scenario/unsupported-by-law",
        /// The plant does not support a setting.
        UnsupportedByPlant = "scenario/unsupported-by-plant",
        /// The vehicle does not support a setting.
        UnsupportedByVehicle = "scenario/unsupported-by-vehicle",
        /// Two starts or two slots are within the safety distance.
        WithinDelta = "scenario/within-delta",
        /// A value has the wrong type.
        WrongType = "scenario/wrong-type",
    }
}

impl ErrorKind {
    /// Returns an error at keys. The first key is the place of the error, unless an override set another one.
    pub(crate) fn at(self, keys: &[&str], problem: impl AsRef<str>, help: impl AsRef<str>) -> ScenarioError {
        let [message, help] = [problem.as_ref(), help.as_ref()].map(printable);
        ScenarioError { kind: self, message, help, keys: Vec::new(), place: None }.at(keys)
    }
}

/// Returns the path of an entry of a list, from 0.
pub(crate) fn entry_key(list: &str, entry: usize) -> String {
    format!("{list}.{}", entry + 1)
}

/// Returns the path of a key of a leg, from 0: the first is `[formation]`, the others are `[[leg]]`.
pub(super) fn leg_key(leg: usize, key: &str) -> String {
    if leg == 0 { format!("formation.{key}") } else { format!("leg.{leg}.{key}") }
}

impl ScenarioError {
    /// Adds keys; see [`ErrorKind::at`].
    pub(crate) fn at(mut self, keys: &[&str]) -> Self {
        self.keys.extend(keys.iter().map(|&key| key.to_owned()));
        self
    }

    /// Moves the keys of `[formation]` to a leg.
    pub(super) fn on_leg(mut self, leg: usize) -> Self {
        for key in &mut self.keys {
            if let Some(rest) = key.strip_prefix("formation.") {
                *key = leg_key(leg, rest);
            }
        }
        self
    }

    /// Puts the key of the table, or the entry of the list, in front of the first key.
    pub(super) fn below(mut self, key: impl fmt::Display) -> Self {
        match self.keys.first_mut() {
            Some(first) => first.insert_str(0, &format!("{key}.")),
            None => self.keys.push(key.to_string()),
        }
        self
    }

    /// Adds `start.jitter_m` to the causes of two starts within delta, if the jitter moved the starts.
    pub(super) fn with_jitter(mut self, jitter_m: f64) -> Self {
        let is_of_starts = self.keys.first().is_some_and(|key| key.starts_with("start.positions_m"));
        if jitter_m == 0.0 || self.kind != ErrorKind::WithinDelta || !is_of_starts {
            return self;
        }
        self.message = format!("{}; start.jitter_m moved each coordinate by up to {jitter_m} m", self.message);
        self.help = String::from("reduce start.jitter_m, move one of the vehicles away, or reduce law.delta_m");
        self.keys.insert(0, "start.jitter_m".to_owned());
        self
    }

    pub(crate) fn with_place(mut self, place: Place) -> Self {
        self.place = Some(Box::new(place));
        self
    }

    /// Returns the stable code of the problem, such as `scenario/out-of-range`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        self.kind.code()
    }
}

impl std::error::Error for ScenarioError {}

impl fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.place, self.keys.first()) {
            (Some(place), _) => {
                write!(f, "{}:{}:{}: {}", printable(&place.source), place.line, place.column, self.message)?;
            }
            (None, Some(key)) => write!(f, "{key}: {}", self.message)?,
            (None, None) => f.write_str(&self.message)?,
        }
        write!(f, "\n  help: {}", self.help)
    }
}

/// Shortens long numbers, and escapes control characters, which could control the terminal.
fn printable(text: &str) -> String {
    with_short_numbers(text).chars().fold(String::with_capacity(text.len()), |mut out, c| {
        if c.is_control() && c != '\n' {
            out.extend(c.escape_default());
        } else {
            out.push(c);
        }
        out
    })
}

/// Returns a remedy for an unknown name: the nearest known name if it is similar, and all known names.
pub(super) fn suggest(name: &str, known: &[&str]) -> String {
    let list = known.iter().map(|known| format!("`{known}`")).collect::<Vec<_>>().join(", ");
    let nearest = known.iter().map(|known| (edit_distance(name, known), known)).min();
    match nearest {
        None => "no name is allowed here".to_owned(),
        Some((distance, nearest)) if distance <= 1 + nearest.chars().count() / 3 => {
            format!("did you mean `{nearest}`? Known here: {list}")
        }
        Some(_) => format!("known here: {list}"),
    }
}

/// Returns the Levenshtein distance of two words: the fewest insertions, deletions and replacements of a character.
/// Words of more than 64 characters are compared by their first 64.
#[must_use]
pub fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(64).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().take(64).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

impl From<ScenarioError> for Failure {
    fn from(error: ScenarioError) -> Self {
        // The message of the error shows a part of a line of any length.
        if error.place.as_ref().is_some_and(|place| place.text.lines().any(|line| line.len() > LONGEST_LINE)) {
            return Self::new(error.code(), false, error.to_string());
        }
        let message = match error.keys.first().filter(|_| error.place.is_none()) {
            Some(key) => format!("{key}: {}", error.message),
            None => error.message.clone(),
        };
        let failure = Self::input(error.code(), message, &error.help);
        error.place.iter().fold(failure, |failure, place| failure.at(place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_shows_place_and_remedy_in_plain_text() {
        let text = "name = \"a\"\nside_m = 2.0\n";
        let error = ErrorKind::OutOfRange.at(&[], "too small", "enlarge it");
        let error = error.with_place(Place::new("f.toml", text, 20..23));
        assert_eq!(error.to_string(), "f.toml:2:10: too small\n  help: enlarge it");
    }

    #[test]
    fn without_a_text_the_key_is_the_place() {
        let error = ErrorKind::OutOfRange.at(&[&entry_key("swarm.mass_kg", 1)], "is zero", "enlarge it");
        assert_eq!(error.to_string(), "swarm.mass_kg.2: is zero\n  help: enlarge it");
    }

    #[test]
    fn control_characters_of_the_input_do_not_reach_the_terminal() {
        let error =
            ErrorKind::UnknownKey.at(&[], "key \u{1b}[2J", "\u{1b}[2J").with_place(Place::new("f", "\u{1b}[2J", 0..1));
        assert!(!error.to_string().contains('\u{1b}'));
    }

    #[test]
    fn edit_distance_counts_single_character_changes() {
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("side_m", "side_m"), 0);
        assert_eq!(edit_distance("sied_m", "side_m"), 2);
        assert_eq!(edit_distance("pentagram", "pentagon"), 3);
    }
}
