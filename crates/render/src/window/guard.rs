//! Whether a panic is that of the library of windows.

use std::cell::Cell;

thread_local! {
    static WITHIN: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is in the library of windows, and not in what it calls of ours. A panic there means that the
/// display went away: the library has no other words for it.
#[must_use]
pub fn is_in_window_library() -> bool {
    WITHIN.get()
}

/// Does what calls the library.
pub(super) fn in_library<T>(act: impl FnOnce() -> T) -> T {
    marked(true, act)
}

/// Does something of ours that the library called.
pub(super) fn out_of_library<T>(act: impl FnOnce() -> T) -> T {
    marked(false, act)
}

fn marked<T>(within: bool, act: impl FnOnce() -> T) -> T {
    let before = WITHIN.replace(within);
    let done = act();
    WITHIN.set(before);
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_library_calls_of_ours_is_not_the_library() {
        assert!(!is_in_window_library());
        in_library(|| {
            assert!(is_in_window_library());
            assert!(!out_of_library(is_in_window_library));
            assert!(is_in_window_library());
        });
        assert!(!is_in_window_library());
    }
}
