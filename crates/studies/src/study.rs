//! Studies: options, flights, answer and files.
//!
//! An [`Experiment`] holds the options of a study and flies its scenarios. The answer is a [`Study`]: a headline, notes
//! and tables. A [`Study`] is written as text, JSON, CSV, LaTeX and a page. [`answer`] runs a whole command of the
//! command line.

use std::path::PathBuf;

use serde::Serialize;

use crate::base::BaseScenario;
use crate::batch::Batch;
use crate::table::Table;
use tautline_core::failure::Failure;
use tautline_core::monitor::Monitor;
use tautline_core::option::{CSV, FORCE, HTML, JSON, LATEX};
use tautline_report::figures::Figure;
use tautline_report::report::page::{self, Badge, Markup, Page};
use tautline_report::report::{ScenarioIdentity, Tool};
use tautline_report::request::outputs::{self, NamedPath, is_standard_output, write};
use tautline_report::request::{Pictures, ScenarioRequest};
use tautline_sim::scenario::{ExternalLaw, Scenario};

/// Version of the keys of every JSON file of this crate. It rises if a key is renamed, removed or changes its meaning.
pub const SCHEMA_VERSION: u32 = 3;

/// The answer of a study.
pub trait Study: Serialize {
    /// Returns the kind of the page, such as `Margin`.
    fn kind(&self) -> &'static str;

    /// Returns the title of the page.
    fn title(&self) -> String;

    /// Returns the badge beside the headline of the page.
    fn badge(&self) -> Badge;

    /// Returns the answer in a sentence.
    fn headline(&self) -> String;

    /// Returns the notes that a reader needs for the answer, a sentence each.
    fn notes(&self) -> Vec<String>;

    /// Returns the tables and figures. Text and LaTeX contain the tables of all sections except details.
    fn sections(&self) -> Vec<Section>;

    /// Returns the table of the CSV file, with a row for each unit of the study, such as a law or a value of a key.
    fn records(&self) -> Table;

    /// Returns the assumptions of the numbers, a sentence each.
    fn assumptions(&self) -> Vec<String>;

    /// Returns whether the command exits with 0.
    fn is_good(&self) -> bool;

    /// Returns the wall-clock times. Only this part differs between two answers to the same question.
    fn performance(&self) -> Option<Table> {
        None
    }

    /// Returns descriptions of single flights of the study, each with the command that repeats the flight.
    fn repeats(&self, _scenario: &ScenarioRequest) -> Vec<(String, String)> {
        Vec::new()
    }

    /// Returns the answer as JSON.
    ///
    /// # Errors
    /// None in practice: every value has a JSON form.
    fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|json| json + "\n")
    }

    /// Returns the records as CSV with a line of names.
    ///
    /// # Errors
    /// None in practice: the table is written to memory.
    fn to_csv(&self) -> Result<Vec<u8>, csv::Error> {
        self.records().csv()
    }

    /// Returns the tables as LaTeX, each a `tabular`.
    fn to_latex(&self) -> String {
        let lines = std::iter::once(self.headline()).chain(self.notes());
        let comments = lines.fold(String::new(), |text, line| text + "% " + &line + "\n");
        let tables: Vec<_> = tables(self).iter().map(Table::latex).collect();
        format!("{comments}% In brackets: 95 % intervals.\n{}", tables.join("\n"))
    }

    /// Returns the tables for a terminal.
    fn text(&self) -> String {
        let tables: Vec<_> = tables(self).iter().chain(&self.performance()).map(Table::text).collect();
        tables.join("\n")
    }

    /// Returns the answer as a self-contained page. Two answers to the same question give the same bytes, except for
    /// the last section, on performance.
    fn to_html(&self, page: &StudyPage) -> String {
        let mut whole = Page::new(self.kind(), self.title(), self.badge(), self.headline());
        for Section { heading, about, blocks, .. } in self.sections() {
            whole.add(&heading, &about, blocks.into_iter().map(Block::html));
        }
        whole.add("Notes", "Limits of the numbers above.", [page::list(&self.notes())]);
        for Section { heading, about, blocks, .. } in page.sections.clone() {
            whole.add(&heading, &about, blocks.into_iter().map(Block::html));
        }
        whole.add("Assumptions", "The numbers hold under these assumptions.", [page::list(&self.assumptions())]);
        whole.add(
            "Command",
            "This command repeats the study with the same result.",
            page.commands.iter().map(|command| page::command(command)),
        );
        let repeat = |(what, command): &(String, String)| [page::list(&[what]), page::command(command)];
        whole.add(
            "Single flights",
            "These commands fly single flights of the study, each with a report of its own.",
            page.repeats.iter().flat_map(repeat),
        );
        whole.add(
            "Performance",
            "Times on the clock of the computer that flew; they do not affect the result.",
            self.performance().iter().map(Table::html),
        );
        whole.render()
    }
}

/// Returns the tables of all sections except details.
fn tables(study: &(impl Study + ?Sized)) -> Vec<Table> {
    let blocks = study.sections().into_iter().filter(|section| !section.is_detail).flat_map(|section| section.blocks);
    let table = |block| if let Block::Table(table) = block { Some(table) } else { None };
    blocks.filter_map(table).collect()
}

/// Section of an answer.
#[derive(Clone, Debug)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// Sentence on the content for the first reader of a page.
    pub about: String,
    /// Tables, figures and other blocks.
    pub blocks: Vec<Block>,
    /// Whether only the page has the section.
    pub is_detail: bool,
}

/// A block of a section.
#[derive(Clone, Debug)]
pub enum Block {
    /// A table.
    Table(Table),
    /// Figures side by side.
    Figures(Vec<Figure>),
    /// Any other part of a page.
    Page(Markup),
}

impl Section {
    /// Returns a section of an answer.
    #[must_use]
    pub fn new(heading: impl Into<String>, about: impl Into<String>, blocks: impl IntoIterator<Item = Block>) -> Self {
        Self { heading: heading.into(), about: about.into(), blocks: blocks.into_iter().collect(), is_detail: false }
    }

    /// Returns a section for the page alone.
    #[must_use]
    pub fn detail(
        heading: impl Into<String>,
        about: impl Into<String>,
        blocks: impl IntoIterator<Item = Block>,
    ) -> Self {
        Self { is_detail: true, ..Self::new(heading, about, blocks) }
    }
}

impl Block {
    fn html(self) -> Markup {
        match self {
            Self::Table(table) => table.html(),
            Self::Figures(figures) => page::figures(&figures),
            Self::Page(markup) => markup,
        }
    }
}

/// Parts of a page besides the answer.
#[derive(Clone, Debug, Default)]
pub struct StudyPage {
    /// Commands and specifications that repeat the study.
    pub commands: Vec<String>,
    /// Descriptions of single flights, each with the command that repeats the flight.
    pub repeats: Vec<(String, String)>,
    /// More sections, such as pictures.
    pub sections: Vec<Section>,
}

/// Options of a study.
pub trait Experiment {
    /// The answer.
    type Study: Study;

    /// Name of the command.
    const COMMAND: &'static str;

    /// Refuses options out of range, before any file is read or written.
    ///
    /// # Errors
    /// [`Failure`] that names the option.
    fn check(&self) -> Result<(), Failure>;

    /// Returns the options of the command line that repeat `study`.
    fn arguments(&self, study: &Self::Study) -> Vec<String>;

    /// Flies the study. Returns `None` if an interruption left no answer.
    ///
    /// # Errors
    /// [`Failure`] if the options or the scenario are wrong.
    fn fly(&self, base: &BaseScenario, batch: &Batch<'_>) -> Result<Option<Self::Study>, Failure>;

    /// Returns the external laws of the options, besides that of the scenario.
    fn external_laws(&self) -> &[ExternalLaw] {
        &[]
    }

    /// Prepares further outputs of the study, such as a folder, before the first flight.
    ///
    /// # Errors
    /// [`Failure`] if the outputs cannot be written.
    fn prepare(&self, _force: bool) -> Result<(), Failure> {
        Ok(())
    }

    /// Returns the sections for the page alone, such as pictures.
    fn illustrate(&self, _base: &BaseScenario, _study: &Self::Study, _pictures: &dyn Pictures) -> Vec<Section> {
        Vec::new()
    }

    /// Writes further outputs of the study, such as a folder.
    ///
    /// # Errors
    /// [`Failure`] if the outputs cannot be written.
    fn conclude(
        &self,
        _request: &ScenarioRequest,
        _study: &Self::Study,
        _pictures: &dyn Pictures,
        _monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        Ok(())
    }
}

/// Request for a study: a scenario, options, and files to write.
#[derive(Clone, Debug)]
pub struct StudyRequest<E> {
    /// The scenario.
    pub scenario: ScenarioRequest,
    /// The options.
    pub options: E,
    /// Files to write.
    pub files: StudyFiles,
    /// Number of threads, by default one for each core. The answer is the same for any number.
    pub threads: Option<usize>,
}

/// Files of a study. `-` is standard output.
#[derive(Clone, Debug, Default)]
pub struct StudyFiles {
    /// All numbers as JSON.
    pub json: Option<PathBuf>,
    /// A row for each unit of the study as CSV.
    pub csv: Option<PathBuf>,
    /// The tables as LaTeX.
    pub latex: Option<PathBuf>,
    /// The page.
    pub html: Option<PathBuf>,
    /// Whether existing files are overwritten.
    pub force: bool,
}

impl StudyFiles {
    /// Returns the requested files, each with its option.
    pub fn outputs(&self) -> impl Iterator<Item = NamedPath<'_>> {
        let all = [(JSON, &self.json), (CSV, &self.csv), (LATEX, &self.latex), (HTML, &self.html)];
        all.into_iter().filter_map(|(option, file)| Some((option.to_string(), file.as_deref()?)))
    }

    /// Returns whether a file goes to standard output.
    #[must_use]
    pub fn are_piped(&self) -> bool {
        self.outputs().any(|(_, file)| is_standard_output(file))
    }
}

impl<E> StudyRequest<E> {
    /// Returns a study without files, on all cores.
    #[must_use]
    pub fn new(scenario: ScenarioRequest, options: E) -> Self {
        Self { scenario, options, files: StudyFiles::default(), threads: None }
    }
}

/// Flies a study, passes its answer to the monitor and writes its files. Returns `None` if an interruption left no
/// answer.
///
/// # Errors
/// [`Failure`] if the request or the scenario is wrong, or a file cannot be written.
pub fn answer<E: Experiment>(
    request: &StudyRequest<E>,
    pictures: &dyn Pictures,
    monitor: &dyn Monitor,
) -> Result<Option<E::Study>, Failure> {
    let StudyRequest { scenario, options, files, threads } = request;
    options.check()?;
    let batch = Batch::for_laws(*threads, monitor, scenario.external_law.iter().chain(options.external_laws()))?;
    outputs::check_new(&scenario.argument, files.outputs(), files.force)?;
    let base = BaseScenario::of(scenario)?;
    options.prepare(files.force)?;
    let flown = options.fly(&base, &batch);
    monitor.finish();
    let Some(study) = flown? else {
        monitor.warn("interrupted before there was an answer: nothing was kept; give the command again");
        return Ok(None);
    };
    for note in study.notes() {
        monitor.warn(&format!("note: {note}"));
    }
    // The command line has no external laws.
    let has_command = scenario.external_law.is_none() && options.external_laws().is_empty();
    let repeats = if has_command { study.repeats(scenario) } else { Vec::new() };
    let repeated = match &repeats[..] {
        [_, _, _, ..] if files.html.is_some() => Vec::new(),
        [_, _, _, ..] => vec![format!("{HTML} writes a page with the command that repeats each of these flights")],
        few => few.iter().map(|(what, command)| format!("{what}\n  {command}")).collect(),
    };
    monitor.say(&format!("{}\n\n{}\n{}", study.headline(), study.text(), repeated.join("\n")));
    let not_written = |error: &dyn std::error::Error| {
        Failure::machine("files/cannot-write", format!("cannot write the result: {error}"))
    };
    if let Some(file) = &files.json {
        write(file, study.to_json().map_err(|error| not_written(&error))?.as_bytes(), monitor)?;
    }
    if let Some(file) = &files.csv {
        write(file, &study.to_csv().map_err(|error| not_written(&error))?, monitor)?;
    }
    if let Some(file) = &files.latex {
        write(file, study.to_latex().as_bytes(), monitor)?;
    }
    if let Some(file) = &files.html {
        let sections = options.illustrate(&base, &study, pictures);
        let arguments = options.arguments(&study);
        let command = scenario.command(E::COMMAND, arguments.iter().map(String::as_str), []);
        let commands = if has_command { vec![command] } else { Vec::new() };
        let page = StudyPage { commands, repeats, sections };
        write(file, study.to_html(&page).as_bytes(), monitor)?;
    }
    for (_, file) in files.outputs().filter(|(_, file)| !is_standard_output(file)) {
        monitor.say(&format!("wrote {}", file.display()));
    }
    if monitor.is_interrupted() {
        let wrote_files = files.outputs().any(|(_, file)| !is_standard_output(file));
        let again = if wrote_files {
            format!(" with {FORCE} begins again and replaces the files")
        } else {
            " begins again".to_owned()
        };
        monitor.warn(&format!("interrupted: the answer counts the flights up to here; the same command{again}"));
    }
    options.conclude(scenario, &study, pictures, monitor)?;
    Ok(Some(study))
}

/// Identity of the flown scenario, in every answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct About {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name and hash of the scenario of the file.
    pub scenario: ScenarioIdentity,
    /// The program.
    pub tool: Tool,
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// Name of the external law that flew in place of the scenario's own law.
    pub external_law: Option<String>,
    /// Limit of commands \[m/s^2\], for figures.
    #[serde(skip)]
    pub max_accel_m_s2: Option<f64>,
}

impl About {
    pub(crate) fn new(scenario: &Scenario) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            scenario: ScenarioIdentity { name: scenario.name.clone(), sha256: scenario.resolved().sha256 },
            tool: Tool { name: tautline_core::PROGRAM.to_owned(), version: tautline_core::VERSION.to_owned() },
            delta_m: scenario.delta_m,
            max_accel_m_s2: scenario.actuation.max_accel_m_s2,
            external_law: scenario.external_law.as_ref().map(|law| law.name().to_owned()),
        }
    }

    /// Returns the note on an external law.
    pub(crate) fn note(&self) -> Option<String> {
        let law = self.external_law.as_ref()?;
        Some(format!("flown under the external law {law}; nothing is proved about this law"))
    }
}
