//! The command `audit`, run as a user runs it.
