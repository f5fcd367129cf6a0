//! The program `palpate`.

use std::process::ExitCode;

fn main() -> ExitCode {
    host::cli::main()
}
