//! The display in a terminal.
