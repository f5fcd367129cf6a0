//! The stiffness and the damping of bodies that the devices of a scene cannot render, in the words of the scene.

use super::body::HostBody;
use super::damped::DampedDirection;
use super::stiff::StiffDirection;
use crate::scene::Scene;
use crate::world::grasps;
use serde::Serialize;
use std::fmt;

/// A direction of a body that its devices cannot render. Springs in series with it bound the stiffness; the body is
/// rendered whole in all other directions.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StiffSummary {
    /// Name of the body.
    pub body: String,
    /// Name of the handle that moves most.
    pub handle: String,
    /// Names of the other handles that move at least half as far in the same motion.
    pub others: Vec<String>,
    /// The direction of its motion, or the axis of its turn, in the axes of the scene, relative to its length.
    pub direction: [f64; 3],
    /// Whether the handle turns.
    pub turns: bool,
    /// The stiffness of the body (N/m, N m/rad): of a motion whose length, over all handles, is one.
    pub stiffness: f64,
    /// The stiffness that the devices render (N/m, N m/rad).
    pub rendered: f64,
}

impl StiffSummary {
    /// Names a direction of the scene's body `number`.
    pub fn new(scene: &Scene, number: usize, found: &StiffDirection) -> Self {
        let name = |handle| handle_name(scene, number, handle);
        let others = (0..u8::BITS as usize).filter(|other| found.others & (1 << other) != 0);
        Self {
            body: scene.bodies[number].name.clone(),
            handle: name(found.handle),
            others: others.map(name).collect(),
            direction: found.direction.into(),
            turns: found.turns,
            stiffness: found.ratio * found.rendered,
            rendered: found.rendered,
        }
    }
}

impl fmt::Display for StiffSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = shown(self.direction);
        let (motion, scale, unit) = if self.turns {
            ("about", 1.0, "N m/rad")
        } else {
            ("along", 1e-3, "N/mm")
        };
        let with = match &*self.others.join(", ") {
            "" => String::new(),
            others => format!(" (with {others})"),
        };
        write!(
            f,
            "{}: handle {}{with} is stiffer {motion} ({x:.2}, {y:.2}, {z:.2}) than its device can render: {:.3} {unit}, \
             rendered as {:.3} {unit}",
            self.body,
            self.handle,
            scale * self.stiffness,
            scale * self.rendered
        )
    }
}

/// Damping of a body, if a device renders only a part of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DampedSummary {
    /// Name of the body.
    pub body: String,
    /// Name of the handle.
    pub handle: String,
    /// The direction of its motion, or the axis of its turn, in the axes of the scene, relative to its length.
    pub direction: [f64; 3],
    /// Whether the handle turns.
    pub turns: bool,
    /// The damping of the body in this motion (N s/m, N m s/rad).
    pub damping: f64,
    /// The damping that the device renders (N s/m, N m s/rad).
    pub rendered: f64,
}

impl DampedSummary {
    /// The damping of each of a scene's `bodies` that its devices have rendered least of so far.
    pub fn all(scene: &Scene, bodies: &[HostBody]) -> Vec<Self> {
        let found = bodies.iter().enumerate().filter_map(|(number, body)| {
            let least = body.publisher().least_damped()?;
            Some(Self::new(scene, number, &least))
        });
        found.collect()
    }

    fn new(scene: &Scene, number: usize, found: &DampedDirection) -> Self {
        Self {
            body: scene.bodies[number].name.clone(),
            handle: handle_name(scene, number, found.handle),
            direction: found.direction.into(),
            turns: found.turns,
            damping: found.damping,
            rendered: found.rendered,
        }
    }
}

impl fmt::Display for DampedSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            body,
            handle,
            damping,
            rendered,
            ..
        } = self;
        let [x, y, z] = shown(self.direction);
        let lacks = damping - rendered;
        if self.turns {
            write!(
                f,
                "{body}: the device of handle {handle} renders {rendered:.3} of {damping:.3} N m s/rad of the body's damping \
                 about ({x:.2}, {y:.2}, {z:.2}): a turn of 1 rad/s lacks {lacks:.3} N m"
            )
        } else {
            write!(
                f,
                "{body}: the device of handle {handle} renders {rendered:.1} of {damping:.1} N s/m of the body's damping along \
                 ({x:.2}, {y:.2}, {z:.2}): a motion of 10 mm/s lacks {:.2} N",
                0.01 * lacks
            )
        }
    }
}

/// The name of a handle of the scene's body `number`.
fn handle_name(scene: &Scene, number: usize, handle: usize) -> String {
    let spec = &scene.bodies[number];
    let grasps = grasps(scene, spec);
    let grasp = grasps.get(handle);
    grasp.map_or_else(|| handle.to_string(), |grasp| grasp.name(spec))
}

/// A direction to two decimals. A component that rounds to zero has no sign.
fn shown(direction: [f64; 3]) -> [f64; 3] {
    direction.map(|part| (100.0 * part).round() / 100.0 + 0.0)
}
