//! Printing that never panics. The macros `out!` and `outln!` replace `print!` and `println!`, and `errln!` replaces
//! `eprintln!`, which panic if the stream is closed or its disk is full.
//!
//! A reader that closes its pipe (`palpate plan | head -1`) has read enough. The rest of the text is dropped; the
//! command continues, writes its files, and ends with the exit code that it would have had. Any other failure to print
//! is kept until the command has written its files; [`end`] then returns the error.
//!
//! Texts of files and devices (logs, scenes, results, plug-ins) may hold control characters, which a terminal obeys: they
//! move the cursor, change the title, or answer as if a person typed. All text of the program passes through here, and
//! [`clean`] takes these characters out.

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
    let text = clean(&text.to_string());
    keep(|| io::stdout().write_all(text.as_bytes()));
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
    let line = clean(&format!("palpate: {text}\n"));
    let _ = io::stderr().write_all(line.as_bytes());
}

/// The text with a question mark for each control character but the ends of lines and tabs.
fn clean(text: &str) -> String {
    text.replace(|c: char| c.is_control() && !matches!(c, '\n' | '\t'), "?")
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_obeys_is_taken_out_and_lines_stay() {
        // ESC, BEL, a carriage return, a backspace, NUL, DEL, and the eight-bit forms of CSI and OSC.
        let hostile = "a\u{1b}[2Jb\u{7}\r\u{8}\0\u{7f}\u{9b}31m\u{9d}0;t\u{9c}\tc\nµ – 力\n";
        let cleaned = clean(hostile);
        assert_eq!(cleaned, "a?[2Jb??????31m?0;t?\tc\nµ – 力\n");
        assert_eq!(clean(&cleaned), cleaned);
    }
}
