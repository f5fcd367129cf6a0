//! What a machine lacks for a steady tick: each condition with what was found, what is wanted, what it costs to lack the
//! condition, and the commands that mend and undo.
//!
//! All facts come from files of the kernel and of `/etc` below a root, so a test makes its own machine. Nothing is
//! changed. [`examine`] reads and judges; [`script`] writes the steps as one script for the shell; [`Report`] holds both
//! the table and the line at the start of a run.
//!
//! One file holds one group of checks: `kernel`, `cores`, `power`, `limits`, `agents` and `usb`. Each names the
//! kernel's documents from which its files and their meaning come.
#![forbid(unsafe_code)]

mod agents;
mod check;
mod cores;
mod kernel;
mod limits;
mod power;
mod report;
pub mod script;
mod step;
mod system;
mod usb;

pub use check::{Check, Verdict};
pub use report::Report;
pub use step::Step;
pub use system::Asked;

use std::path::Path;
use system::System;

/// Reads and judges the machine whose files are below `root` (`/`), for a run with the core and the priority of `asked`.
pub fn examine(root: &Path, asked: &Asked) -> Report {
    let system = System::new(root, asked);
    let groups = [
        kernel::checks,
        cores::checks,
        power::checks,
        limits::checks,
        agents::checks,
        usb::checks,
    ];
    Report {
        core: system.core,
        priority: system.priority,
        checks: groups.iter().flat_map(|checks| checks(&system)).collect(),
    }
}
