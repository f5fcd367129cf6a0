//! Serves one plug-in, for tests of the crate and for programs that cannot serve a plug-in themselves. `palpate` does
//! not need this program, because it serves its plug-ins itself.

use std::process::ExitCode;

fn main() -> ExitCode {
    devices::plugin::served().unwrap_or(ExitCode::from(2))
}
