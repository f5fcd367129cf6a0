//! Printing that never panics. The macros `out!` and `outln!` replace `print!` and `println!`, and `errln!` replaces
//! `eprintln!`, which panic where the stream is closed or its disk is full.
//!
//! A reader that closes its pipe (`palpate plan | head -1`) has read enough. The rest of the text is dropped; the
//! command goes on, writes its files, and ends with the exit code that it would have had. Any other failure to print is
//! kept until the command has written its files; [`end`] then returns the error.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::sync::Mutex;

/// The first error of the standard output. After an error nothing more is printed.
static FAILURE: Mutex<Option<io::Error>> = Mutex::new(None);

/// Prints to the standard output.
macro_rules! out {
    ($($part:tt)*) => { $crate::printing::print(format_args!($($part)*)) };
}

/// Prints a line to the standard output.
macro_rules! outln {
    () => { $crate::printing::print(format_args!("\n")) };
    ($($part:tt)*) => { $crate::printing::print(format_args!("{}\n", format_args!($($part)*))) };
}

/// Prints a line of the program to the standard error.
macro_rules! errln {
    ($($part:tt)*) => { $crate::printing::complain(format_args!($($part)*)) };
}

/// Prints text to the standard output, unless an earlier text could not be printed.
pub(super) fn print(text: Arguments<'_>) {
    keep(|| io::stdout().write_fmt(text));
}

/// Prints a message of clap, such as the help.
pub(super) fn print_message(message: &clap::Error) {
    if message.use_stderr() {
        // There is no other place for an error about the standard error.
        let _ = message.print();
    } else {
        keep(|| message.print());
    }
}

/// Prints a line to the standard error, with the name of the program.
pub(super) fn complain(text: Arguments<'_>) {
    // One write call, so that lines of two threads do not mix.
    let line = format!("palpate: {text}\n");
    let _ = io::stderr().write_all(line.as_bytes());
}

/// Ends the printing.
///
/// # Errors
/// If a text could not be printed. A pipe that its reader closed is no error.
pub(super) fn end() -> io::Result<()> {
    keep(|| io::stdout().flush());
    match lock().take() {
        Some(error) if error.kind() != ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

fn keep(write: impl FnOnce() -> io::Result<()>) {
    let mut failure = lock();
    if failure.is_none() {
        *failure = write().err();
    }
}

fn lock() -> std::sync::MutexGuard<'static, Option<io::Error>> {
    FAILURE
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}
