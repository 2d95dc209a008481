//! Who called a command: a person at a terminal, or a program that has this crate inside of it.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A call of the thread that works on it.
#[derive(Default)]
struct Call {
    /// What was asked for, without the program's name.
    words: Vec<String>,
    /// Where a program called: what it takes.
    program: Option<Program>,
}

/// What a program that calls takes in the place of a terminal.
struct Program {
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
pub(super) fn by_program<T>(words: &[String], interrupted: &Arc<AtomicBool>, work: impl FnOnce() -> T) -> (T, String) {
    let program = Program { interrupted: Arc::clone(interrupted), data: String::new() };
    CALL.set(Call { words: words.to_vec(), program: Some(program) });
    let done = work();
    (done, CALL.take().program.map(|program| program.data).unwrap_or_default())
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
