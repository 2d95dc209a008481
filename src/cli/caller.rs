//! Who called a command: a person at a terminal, or a program that has this crate inside of it.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use tautline_sim::scenario::{ScenarioError, Source};

/// What a scenario is called that a program gives as text.
const GIVEN: &str = "TOML";

/// A call of the thread that works on it.
#[derive(Default)]
struct Call {
    /// What was asked for, without the program's name.
    words: Vec<String>,
    /// Where a program called: what it takes.
    program: Option<Program>,
}

/// What a program that calls has in the place of a terminal.
struct Program {
    /// What it gives in the place of standard input.
    input: Option<String>,
    interrupted: Arc<AtomicBool>,
    data: String,
}

thread_local! {
    static CALL: RefCell<Call> = RefCell::default();
}

/// Takes note of a call by a person.
pub(super) fn by_person(words: Vec<String>) {
    CALL.set(Call { words, program: None });
}

/// Does the work of a call by a program, which nothing is said to: what would be data on standard output is given back.
/// The program ends the work by setting `interrupted`.
pub(super) fn by_program<T>(
    words: &[String],
    input: Option<&str>,
    interrupted: &Arc<AtomicBool>,
    work: impl FnOnce() -> T,
) -> (T, String) {
    let (input, interrupted) = (input.map(str::to_owned), Arc::clone(interrupted));
    let program = Program { input, interrupted, data: String::new() };
    CALL.set(Call { words: words.to_vec(), program: Some(program) });
    let done = work();
    (done, CALL.take().program.map(|program| program.data).unwrap_or_default())
}

/// The scenario of this name or path. `-` is the text that the program that called gives, or else standard input.
pub(super) fn source(name_or_path: &str) -> Result<Source, ScenarioError> {
    let given = CALL.with_borrow(|call| call.program.as_ref().and_then(|program| program.input.clone()));
    match given.filter(|_| name_or_path == "-") {
        Some(text) => Ok(Source::Text { name: GIVEN.to_owned(), text }),
        None => Source::resolve(name_or_path),
    }
}

/// What was asked for, without the program's name.
pub(super) fn words() -> Vec<String> {
    CALL.with_borrow(|call| call.words.clone())
}

/// Whether there is nobody to talk to.
pub(super) fn is_program() -> bool {
    CALL.with_borrow(|call| call.program.is_some())
}

/// What the program that called ends the work by.
pub(super) fn interruption() -> Option<Arc<AtomicBool>> {
    CALL.with_borrow(|call| call.program.as_ref().map(|program| Arc::clone(&program.interrupted)))
}

/// Gives data to the program that called; `false` where a person did.
pub(super) fn takes(data: &str) -> bool {
    CALL.with_borrow_mut(|call| call.program.as_mut().map(|program| program.data.push_str(data)).is_some())
}
