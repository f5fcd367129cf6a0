//! Writes the man pages and the completions of bash, zsh and fish into a folder, from the program's own help. The Debian
//! package has them (`host/program/debian/build`).
//!
//! ```sh
//! cargo run --release -p palpate --example manual -- FOLDER
//! ```

use clap_complete::Shell;
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args_os().nth(1).map(PathBuf::from);
    let folder = folder.ok_or("found no argument, allowed: a folder for the pages")?;
    clap_mangen::generate_to(program::command(), &folder)?;
    for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
        clap_complete::generate_to(shell, &mut program::command(), "palpate", &folder)?;
    }
    Ok(())
}
