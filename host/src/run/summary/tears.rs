//! The tears of a body in the summary of a run.

use crate::engine::tears::BodyTears;
use crate::record::Distribution;
use crate::run::tear_force::TearForce;
use serde::Serialize;
use std::fmt;

/// The tears of one body.
#[derive(Clone, Debug, Serialize)]
pub struct TearSummary {
    /// Name of the body.
    pub body: String,
    /// Number of edges that opened.
    pub edges: u64,
    /// Number of edges that were divided for this.
    pub cut: u64,
    /// Number of vertices that snapped: they moved at rest onto the path of a tear.
    pub snapped: u64,
    /// Number of tears that started where the stress reached the strength.
    pub started: u64,
    /// Number of tips at the end.
    pub tips: usize,
    /// The torn area (m^2): length at rest times thickness.
    pub area: f64,
    /// The energy that the torn area takes (J): toughness times area. Zero under the law `thesis`.
    pub energy: f64,
    /// The energy that hands and contacts supplied and that the body does not store at the end (J).
    pub spent: f64,
    /// The part of the energy of the torn area that open edges have still to take at the end (J).
    pub pending: f64,
    /// The part of the energy of the torn area that went into motion and damping about the tips (J): they moved on inside edges.
    pub slackened: f64,
    /// The largest flow of energy to a tip at the end (J/m^2).
    pub driving: f64,
    /// The toughness (J/m^2).
    pub toughness: f64,
    /// Number of tips that rest at the end because their vertex is held.
    pub held: usize,
    /// Number of tips that rest at the end because no edge leads on from them.
    pub blocked: usize,
    /// The change of the body's energy by edits (J).
    pub edits: f64,
    /// Number of pieces that sleep at the end.
    pub asleep: usize,
    /// The force of the device that pulled hardest while the body tore; `None` if no edge opened or no device holds the
    /// body.
    pub force: Option<TearForce>,
    /// Whether a tear rests because the room for vertices is used up.
    pub full: bool,
    /// Measured time of the tears, a step. Measured times do not enter the state.
    pub time: Distribution,
    /// Solvers for new topologies that were made in the background and then taken, of all bodies.
    pub renewed: u64,
}

impl TearSummary {
    /// The summary of the `tears` of `body`.
    pub(crate) fn new(
        body: &str,
        tears: &BodyTears,
        force: Option<TearForce>,
        time: Distribution,
        renewed: u64,
    ) -> Self {
        let report = tears.tearing().report();
        Self {
            body: body.to_owned(),
            edges: report.opened,
            cut: report.cut,
            snapped: report.snapped,
            started: report.started,
            tips: report.tips,
            area: report.area,
            energy: report.due,
            spent: report.spent,
            pending: report.pending,
            slackened: report.slackened,
            driving: report.driving,
            toughness: tears.tearing().options().material.toughness,
            held: report.held,
            blocked: report.blocked,
            edits: report.edits,
            asleep: 0,
            force,
            full: report.full,
            time,
            renewed,
        }
    }

    /// Why the tears do not run on at the end.
    fn rest(&self) -> String {
        let percent = 100.0 * self.driving / self.toughness;
        if self.blocked > 0 {
            format!(
                "at the end no edge leads on from {} of the tips: divide the triangles there",
                self.blocked
            )
        } else if self.held == self.tips {
            "at the end every tip is at a vertex that is held: no tear goes through one".to_owned()
        } else if percent >= 100.0 {
            format!(
                "at the end a tear runs: the flow of energy to its tip is {percent:.0} % of the toughness"
            )
        } else {
            format!(
                "at the end the tears rest: the flow of energy to a tip is at most {percent:.0} % of the toughness"
            )
        }
    }

    /// Prints what tore, and what it took.
    pub(super) fn print(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "  tears      {}: {} edges opened ({} cut, {} vertices snapped), {:.1} mm2 torn, {:.1} mJ taken; {} tip{} at \
             the end",
            self.body,
            self.edges,
            self.cut,
            self.snapped,
            self.area * 1e6,
            self.energy * 1e3,
            self.tips,
            if self.tips == 1 { "" } else { "s" }
        )?;
        if let Some(force) = &self.force {
            writeln!(
                f,
                "             from {:.3} to {:.3} s by {}: {:.2} N at the first edge, peak {:.2} N, plateau {:.2} N (median)",
                force.from, force.to, force.device, force.start, force.peak, force.plateau
            )?;
        }
        if self.edges > 0 && self.energy > 0.0 {
            writeln!(
                f,
                "             {:.1} mJ supplied and not stored, {:.2} of what the torn area took so far; of \
                 that energy {:.0} % went into motion and damping at the tips",
                self.spent * 1e3,
                self.spent / (self.energy - self.pending),
                100.0 * self.slackened / self.energy
            )?;
        }
        if self.tips > 0 && self.energy > 0.0 && !self.full {
            writeln!(f, "             {}", self.rest())?;
        }
        if self.asleep > 0 {
            let s = if self.asleep == 1 { "" } else { "s" };
            writeln!(
                f,
                "             {} piece{s} without a hand asleep at the end",
                self.asleep
            )?;
        }
        if self.full {
            writeln!(
                f,
                "  !          {}: a tear rests because the room for new vertices is used up: raise `room` in \
                 `[body.tear]`",
                self.body
            )?;
        }
        Ok(())
    }
}
