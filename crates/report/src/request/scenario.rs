//! Which scenario a request is about.

use super::Failure;
use tautline_sim::scenario::{Override, Scenario, Source, Template};

/// A scenario and what is changed of it.
#[derive(Clone, Debug)]
pub struct ScenarioRequest {
    /// The argument of the command line that names the scenario: a file, a built-in scenario, or `-` for a text.
    pub argument: String,
    /// The text of the scenario.
    pub source: Source,
    /// Keys that are set, each as `KEY.PATH=VALUE`.
    pub overrides: Vec<String>,
}

impl ScenarioRequest {
    /// The scenario of a file or of a built-in name.
    ///
    /// # Errors
    /// [`Failure`] where neither exists.
    pub fn named(argument: &str, overrides: &[String]) -> Result<Self, Failure> {
        let (argument, overrides) = (argument.to_owned(), overrides.to_vec());
        Ok(Self { source: Source::resolve(&argument)?, argument, overrides })
    }

    /// The overrides as keys and values.
    ///
    /// # Errors
    /// [`Failure`] where one is no `KEY.PATH=VALUE`.
    pub fn parsed_overrides(&self) -> Result<Vec<Override>, Failure> {
        Ok(self.overrides.iter().map(|text| Override::parse(text)).collect::<Result<_, _>>()?)
    }

    /// Reads the scenario.
    ///
    /// # Errors
    /// [`Failure`] where it is wrong, with its place.
    pub fn read(&self) -> Result<Scenario, Failure> {
        Ok(Scenario::read(&self.source, &self.parsed_overrides()?)?)
    }

    /// Reads the scenario as a template, whose keys are varied.
    ///
    /// # Errors
    /// [`Failure`] where it is wrong, with its place.
    pub fn template(&self) -> Result<Template, Failure> {
        Ok(Template::read(&self.source, &self.parsed_overrides()?)?)
    }

    /// The command line of a command about this scenario, with options `after` it, and `sets` beside the overrides.
    #[must_use]
    pub fn command<'a>(
        &'a self,
        command: &'a str,
        after: impl IntoIterator<Item = &'a str>,
        sets: impl IntoIterator<Item = &'a String>,
    ) -> String {
        let sets = self.overrides.iter().chain(sets).flat_map(|text| ["--set", text.as_str()]);
        let words: Vec<_> = [command, &self.argument].into_iter().chain(after).chain(sets).collect();
        command_line(words.iter().copied())
    }

    /// The command line that flies this scenario with `sets` in the place of the overrides.
    #[must_use]
    pub fn run_command<'a>(&'a self, sets: impl IntoIterator<Item = &'a String>) -> String {
        let sets = sets.into_iter().flat_map(|text| ["--set", text.as_str()]);
        let words: Vec<_> = ["run", &self.argument].into_iter().chain(sets).collect();
        command_line(words.iter().copied())
    }
}

/// The program with these words behind it, quoted for a shell.
#[must_use]
pub fn command_line<'a>(words: impl Iterator<Item = &'a str> + Clone) -> String {
    let words = std::iter::once("tautline").chain(words);
    // Only a zero byte cannot be quoted, and no argument has one.
    shlex::try_join(words.clone()).unwrap_or_else(|_| words.collect::<Vec<_>>().join(" "))
}
