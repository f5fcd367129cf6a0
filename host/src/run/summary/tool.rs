//! A tool in the summary of a run: what its hand felt, and the patches by which it was felt.

use crate::run::collect::Touched;
use crate::scene::Scene;
use rt_core::tool::ToolCoupling;
use serde::Serialize;
use std::fmt;

/// The least distance between a tool and its device (m) that is printed.
const SEEN: f64 = 1e-5;

/// One tool.
#[derive(Clone, Debug, Serialize)]
pub struct ToolSummary {
    /// Name of the tool.
    pub tool: String,
    /// Name of the device that moves it.
    pub device: String,
    /// Time in which it pressed a surface (s).
    pub pressed: f64,
    /// Largest force on it (N), before the cap.
    pub peak_force: f64,
    /// Its time (s).
    pub peak_time: f64,
    /// Largest distance from its device (m).
    pub apart: f64,
    /// Patches that the tick took into use.
    pub patches: u64,
    /// Patches refused.
    pub refused_patches: u64,
    /// Times that the newest patch became too old.
    pub faded: u64,
    /// Net work of the hand on the surfaces (J).
    pub supplied: f64,
    /// Largest net energy out at the hand (J).
    pub most_out: f64,
    /// The device's own dissipation on which the cap relies (J).
    pub credited: f64,
    /// Ticks in which the cap reduced the force.
    pub capped_ticks: u64,
}

impl ToolSummary {
    /// The tools of a run, in the scene's order.
    pub(in crate::run) fn all<'a>(
        scene: &Scene,
        couplings: impl Iterator<Item = &'a ToolCoupling>,
        touched: &[Touched],
    ) -> Vec<Self> {
        let couplings: Vec<_> = couplings.collect();
        let summaries = scene.numbered_tools().filter_map(|(tool, device, _)| {
            let coupling = couplings.iter().find(|one| one.device() == device)?;
            let touched = touched.get(device).copied().unwrap_or_default();
            let (counts, account) = (coupling.counters(), coupling.energy());
            Some(Self {
                tool: tool.name.clone(),
                device: tool.device.clone(),
                pressed: touched.ticks as f64 / scene.realtime.rate,
                peak_force: touched.peak_force,
                peak_time: touched.peak_time,
                apart: touched.apart,
                patches: counts.accepted,
                refused_patches: counts.not_finite
                    + counts.wrong_sites
                    + counts.outdated
                    + counts.to_come,
                faded: counts.faded,
                supplied: account.supplied,
                most_out: (-(account.least + account.initial)).max(0.0),
                credited: account.credited,
                capped_ticks: account.capped,
            })
        });
        summaries.collect()
    }

    pub(super) fn print(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mj = |joules: f64| joules * 1e3;
        write!(
            f,
            "  tool       {} on {}: pressed for {:.2} s, peak {:.2} N at {:.2} s",
            self.tool, self.device, self.pressed, self.peak_force, self.peak_time
        )?;
        // On a surface that is softer than the device, the tool is where the device is.
        if self.apart > SEEN {
            write!(f, ", up to {:.2} mm from its device", self.apart * 1e3)?;
        }
        write!(f, "; {} patches", self.patches)?;
        if self.refused_patches > 0 {
            write!(f, ", {} refused", self.refused_patches)?;
        }
        if self.faded > 0 {
            write!(f, ", too old {} times", self.faded)?;
        }
        write!(
            f,
            "\n             {:+.1} mJ supplied by the hand, peak net output {:.1} mJ, with {:.1} mJ of the device's own losses \
             credited",
            mj(self.supplied),
            mj(self.most_out),
            mj(self.credited)
        )?;
        if self.capped_ticks > 0 {
            write!(f, "; capped in {} ticks", self.capped_ticks)?;
        }
        writeln!(f)
    }
}
