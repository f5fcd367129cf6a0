//! Contact against the aims of its design, and what contact costs.
//!
//! Each aim is a line with the most that is asked for and what was measured (`rest`, `worn`, `lists`, `measures`, `throws`). A
//! line that is not reached is printed as it is. `hand` has the force at the hand, `tool` that of a tool,
//! and `between` those of bodies in equilibrium. Times are no aims (`cost`).

mod aim;
mod between;
mod cost;
pub(crate) mod crossings;
mod hand;
mod lists;
mod measures;
mod motions;
mod rest;
mod tables;
mod throws;
mod tool;
mod world;
mod worn;

pub use aim::{Aim, Side};
pub use cost::{Cost, Share};
pub use hand::HandCell;
pub use measures::Measured;
pub use tool::ToolCell;

use crate::speed::Machine;
use crate::{Level, StudyError};
use serde::Serialize;

/// A part of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Section {
    /// Rest, sliding, belts, energy, lists and throws.
    Aims,
    /// Equilibria: a patch test, and the law of Hertz.
    Between,
    /// The force at the hand under slow hosts.
    Hand,
    /// The force of a tool under slow hosts.
    Tool,
    /// The processor time of the stages.
    Cost,
}

/// The results of the study.
#[derive(Clone, Debug, Serialize)]
pub struct ContactStudy {
    /// `palpate.contact/1`.
    pub schema: &'static str,
    /// The extent.
    pub level: Level,
    /// The seed of the throws.
    pub seed: u64,
    /// The aims; empty if no part with aims ran.
    pub aims: Vec<Aim>,
    /// What measures of clusters cost and miss; empty if the aims did not run.
    pub measures: Vec<Measured>,
    /// The machine of the times; `null` if they were not taken.
    pub machine: Option<Machine>,
    /// What hands feel of slow hosts; empty if this part did not run.
    pub hands: Vec<HandCell>,
    /// Tools under slow hosts; empty if this part did not run.
    pub tools: Vec<ToolCell>,
    /// The times; empty if this part did not run.
    pub costs: Vec<Cost>,
}

/// Runs one part of the study, or all. `seed` fixes the throws. `progress` receives the fraction done.
///
/// # Errors
/// [`StudyError`].
pub fn run(
    level: Level,
    only: Option<Section>,
    seed: u64,
    progress: &mut dyn FnMut(f64),
) -> Result<ContactStudy, StudyError> {
    let mut found = ContactStudy {
        schema: "palpate.contact/1",
        level,
        seed,
        aims: Vec::new(),
        measures: Vec::new(),
        hands: Vec::new(),
        tools: Vec::new(),
        machine: None,
        costs: Vec::new(),
    };
    let runs = |part| only.is_none_or(|only| only == part);
    if runs(Section::Aims) {
        let aims = &mut found.aims;
        rest::run(level, &mut |done| progress(0.1 * done), aims)?;
        worn::run(level, aims)?;
        lists::run(level, aims)?;
        found.measures = measures::run(level, aims)?;
        progress(0.2);
        throws::run(level, seed, &mut |done| progress(0.2 + 0.4 * done), aims)?;
    }
    if runs(Section::Between) {
        between::run(level, &mut found.aims)?;
    }
    if runs(Section::Hand) {
        let aims = &mut found.aims;
        found.hands = hand::run(level, &mut |done| progress(0.7 + 0.05 * done), aims)?;
    }
    if runs(Section::Tool) {
        let aims = &mut found.aims;
        found.tools = tool::run(level, &mut |done| progress(0.75 + 0.05 * done), aims)?;
    }
    if runs(Section::Cost) {
        found.machine = Some(Machine::here());
        found.costs = cost::run(level, &mut |done| progress(0.8 + 0.2 * done))?;
    }
    Ok(found)
}
