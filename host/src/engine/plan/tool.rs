//! The plan of a tool: how far the host tells the surface near it, and how large a message is.

use super::super::tool::{stiffest, stiffest_turning};
use crate::world::World;
use crate::world::reach::{WAYS, horizon, reach};
use crate::world::shapes::round;
use rt_core::tool::{MAX_SITES, MAX_TRIANGLES, Patch};
use std::fmt;

/// The plan of a tool.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ToolPlan {
    /// Name of the tool.
    pub tool: String,
    /// Name of its device.
    pub device: String,
    /// Least distance from the tool up to which a patch has the surface (m).
    pub reach: f64,
    /// That distance for each m/s of the tool (s).
    pub reach_time: f64,
    /// The stiffest spring that the device renders (N/m).
    pub stiffest: f64,
    /// The stiffest rotational spring (N m/rad), unless the tool keeps its attitude.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turning: Option<f64>,
    /// Largest size of a patch (bytes).
    pub bytes: usize,
}

impl ToolPlan {
    /// The tools of a world, in the scene's order.
    pub fn all(world: &World<'_>) -> Vec<Self> {
        let scene = &world.loaded.scene;
        let plans = scene.numbered_tools().map(|(tool, device, _)| Self {
            tool: tool.name.clone(),
            device: tool.device.clone(),
            reach: reach(horizon(&scene.host), tool.radius, 0.0),
            reach_time: WAYS * horizon(&scene.host),
            stiffest: stiffest(world.loaded, device),
            turning: stiffest_turning(world.loaded, device),
            bytes: size_of::<Patch>(),
        });
        plans.collect()
    }
}

impl fmt::Display for ToolPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} on {}: the surface within {} mm, or its way in {} ms if that is more, as at most {MAX_SITES} sites and \
             {MAX_TRIANGLES} triangles ({:.0} kB); at most {:.0} N/m",
            self.tool,
            self.device,
            round(1e3 * self.reach),
            round(1e3 * self.reach_time),
            self.bytes as f64 * 1e-3,
            self.stiffest
        )?;
        match self.turning {
            Some(turning) => write!(f, ", and {} N m/rad as the device turns it", round(turning)),
            None => f.write_str("; it keeps its attitude"),
        }
    }
}
