//! Scenario of a request.

use super::Failure;
use tautline_core::option::SET;
use tautline_sim::scenario::{ExternalLaw, Override, Scenario, Source, Template};

/// A scenario with overrides.
#[derive(Clone, Debug)]
pub struct ScenarioRequest {
    /// Argument of the command line that names the scenario: a file, a built-in scenario, or `-` for standard input.
    pub argument: String,
    /// Text of the scenario.
    pub source: Source,
    /// Overrides, each as `KEY.PATH=VALUE`.
    pub overrides: Vec<String>,
    /// Law that flies in place of the scenario's own.
    pub external_law: Option<ExternalLaw>,
}

impl ScenarioRequest {
    /// Returns the scenario of a file or of a built-in name.
    ///
    /// # Errors
    /// [`Failure`] if neither exists.
    pub fn named(argument: &str, overrides: &[String]) -> Result<Self, Failure> {
        let (argument, overrides) = (argument.to_owned(), overrides.to_vec());
        Ok(Self { source: Source::resolve(&argument)?, argument, overrides, external_law: None })
    }

    /// Returns the overrides as keys and values.
    ///
    /// # Errors
    /// [`Failure`] if one of them is not of the form `KEY.PATH=VALUE`.
    pub fn parsed_overrides(&self) -> Result<Vec<Override>, Failure> {
        Ok(self.overrides.iter().map(|text| Override::parse(text)).collect::<Result<_, _>>()?)
    }

    /// Reads the scenario.
    ///
    /// # Errors
    /// [`Failure`] with the place of the error in the text.
    pub fn read(&self) -> Result<Scenario, Failure> {
        let scenario = Scenario::read(&self.source, &self.parsed_overrides()?)?;
        Ok(Scenario { external_law: self.external_law.clone(), ..scenario })
    }

    /// Reads the scenario as a template for variations of its keys.
    ///
    /// # Errors
    /// [`Failure`] with the place of the error in the text.
    pub fn template(&self) -> Result<Template, Failure> {
        let template = Template::read(&self.source, &self.parsed_overrides()?)?;
        Ok(template.with_external_law(self.external_law.clone()))
    }

    /// Returns the command line of a command about this scenario, with the options `after` it, and with `sets` beside
    /// the overrides.
    #[must_use]
    pub fn command<'a>(
        &'a self,
        command: &'a str,
        after: impl IntoIterator<Item = &'a str>,
        sets: impl IntoIterator<Item = &'a String>,
    ) -> String {
        let sets = self.overrides.iter().chain(sets).flat_map(|text| [SET.argument(), text.clone()]);
        let words = [command, &self.argument].into_iter().chain(after).map(str::to_owned);
        let words: Vec<_> = words.chain(sets).collect();
        command_line(words.iter().map(String::as_str))
    }

    /// Returns the command line that flies this scenario with `sets` instead of the overrides.
    #[must_use]
    pub fn run_command<'a>(&'a self, sets: impl IntoIterator<Item = &'a String>) -> String {
        let sets = sets.into_iter().flat_map(|text| [SET.argument(), text.clone()]);
        let words: Vec<_> = ["run", &self.argument].map(str::to_owned).into_iter().chain(sets).collect();
        command_line(words.iter().map(String::as_str))
    }
}

/// Returns the program name and these words, quoted for a shell.
#[must_use]
pub fn command_line<'a>(words: impl Iterator<Item = &'a str> + Clone) -> String {
    let words = std::iter::once("tautline").chain(words);
    // Only a zero byte cannot be quoted, and no argument contains one.
    shlex::try_join(words.clone()).unwrap_or_else(|_| words.collect::<Vec<_>>().join(" "))
}
