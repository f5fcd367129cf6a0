//! A panic is a fault of this program. The program reports it in one line, with its place in the sources, unless the
//! part of the program that catches the panic reports it.

use host::run::panics::{note, text};
use std::env::var_os;
use std::panic;

/// Installs the panic hook. `RUST_BACKTRACE=1` adds Rust's own message with a backtrace.
pub(super) fn report_in_one_line() {
    let standard = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        let is_caught = note(info);
        if var_os("RUST_BACKTRACE").is_some_and(|value| value != "0") {
            standard(info);
        } else if !is_caught {
            let thread = std::thread::current();
            let name = thread.name().unwrap_or("without a name");
            errln!(
                "a fault of this program: the thread {name} panicked: {}",
                text(info.payload())
            );
        }
    }));
}
