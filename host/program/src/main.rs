//! The program `palpate`. Its commands are a library, so that the compiler builds them beside the library of the host.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    program::main()
}
