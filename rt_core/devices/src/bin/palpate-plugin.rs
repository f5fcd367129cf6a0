//! Serves one plug-in, for tests of the crate and for programs that cannot serve one themselves. `palpate` needs no such
//! program: it is its own.

use std::process::ExitCode;

fn main() -> ExitCode {
    devices::plugin::served().unwrap_or(ExitCode::from(2))
}
