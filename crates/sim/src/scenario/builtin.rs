//! Built-in scenarios, embedded in the program, and the text of new scenario files.

use super::limits::check_name;

/// Built-in scenario.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Builtin {
    /// Name that [`super::Source::resolve`] accepts.
    pub name: &'static str,
    /// Summary in one line.
    pub summary: &'static str,
    /// Text of the scenario file, comments included; a start for new scenarios.
    pub toml: &'static str,
}

/// Embeds the scenario with a name.
macro_rules! builtin {
    ($name:literal, $summary:literal) => {
        Builtin { name: $name, summary: $summary, toml: embedded!($name, ".toml") }
    };
}

const ALL: &[Builtin] = &[
    builtin!("pentagon", "five vehicles from a line to the hourglass of the edge-tension paper: clear and reached"),
    builtin!("hexagon", "six vehicles from two rows to a regular hexagon, with less than 1 g: clear and reached"),
    builtin!("circle", "six vehicles from a line to a circle under the edge-tension law: clear and reached"),
    builtin!(
        "pentagon-laplacian",
        "the start of the pentagon under the Laplacian baseline, which avoids no collision: a violation"
    ),
    builtin!(
        "pentagon-collinear",
        "the pentagon from an exactly straight line, which the law cannot leave: clear but never reached"
    ),
    builtin!(
        "pentagon-leader",
        "the pentagon around a leader that follows only its own reference, over a star: clear and reached"
    ),
    builtin!(
        "leader-lossy",
        "a moving leader over a radio that loses one message in ten, extrapolated: clear and reached"
    ),
    builtin!("swap", "twelve vehicles change places across a circle under the displacement law: clear and reached"),
    builtin!(
        "show",
        "a hundred vehicles write two words and end in rings, certified through all legs: clear and reached"
    ),
    builtin!(
        "obstacles",
        "eight vehicles past pillars, a house and a cable, in two legs: clear of all of them, reached"
    ),
    builtin!(
        "crazyflies",
        "five quadrotors that tilt and lag, from a line to a pentagon of 0.6 m: clear, reached, not certified"
    ),
    builtin!(
        "shielded-crazyflies",
        "six quadrotors change places in wind, under a law that avoids nothing and a shield: clear, reached"
    ),
    builtin!(
        "gusts",
        "rings in a turbulent wind with gusts on some vehicles: a common wind changes no separation, reached"
    ),
    builtin!("thousand", "a thousand vehicles gather in space: clear and reached"),
];

/// Returns all built-in scenarios, the default first.
#[must_use]
pub fn all() -> &'static [Builtin] {
    ALL
}

/// Returns the built-in scenario with a name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Builtin> {
    ALL.iter().find(|builtin| builtin.name == name)
}

/// Returns the text of a new scenario file, with comments; `None` if the name is not 1 to 64 letters, digits, `-` and
/// `_`. With `from`, the text repeats this built-in scenario under the new name. Otherwise six vehicles fly to a ring,
/// and lines such as `#key = value` are optional keys.
#[must_use]
pub fn new_scenario(name: &str, from: Option<&Builtin>) -> Option<String> {
    check_name("the name", name, "name").is_ok().then(|| match from {
        Some(builtin) => {
            builtin.toml.replacen(&format!("\nname = \"{}\"", builtin.name), &format!("\nname = \"{name}\""), 1)
        }
        None => embedded!("new-scenario.toml").replace("NAME", name),
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Scenario, Source};
    use super::{all, new_scenario};

    #[test]
    fn a_new_scenario_is_valid_with_and_without_its_optional_keys() {
        let text = new_scenario("ring", None).expect("a name");
        let optional = |line: &str| {
            line.strip_prefix('#')
                .filter(|rest| rest.starts_with(|c: char| c.is_ascii_lowercase() || c == '['))
                .map(str::to_owned)
        };
        let all: Vec<_> = text.lines().map(|line| optional(line).unwrap_or_else(|| line.to_owned())).collect();
        assert_eq!(text.lines().filter(|line| optional(line).is_some()).count(), 20);
        for text in [text.clone(), all.join("\n")] {
            let source = Source::Text { name: "ring".to_owned(), text };
            let scenario = Scenario::read(&source, &[]).expect("a scenario");
            assert_eq!((scenario.name.as_str(), scenario.count()), ("ring", 6));
        }
    }

    #[test]
    fn a_built_in_scenario_is_repeated_under_another_name() {
        for builtin in all() {
            let text = new_scenario("mine", Some(builtin)).expect("a name");
            let source = Source::Text { name: "mine".to_owned(), text };
            let mine = Scenario::read(&source, &[]).expect(builtin.name);
            let own = Scenario::read(&Source::Builtin(builtin.name.to_owned()), &[]).expect(builtin.name);
            assert_eq!((mine.name.as_str(), mine.count()), ("mine", own.count()));
        }
    }

    #[test]
    fn a_wrong_name_gives_no_scenario() {
        for name in ["", "a b", "a/b", "ä", "\"", &"a".repeat(65)] {
            assert_eq!(new_scenario(name, None), None, "{name}");
        }
    }
}
