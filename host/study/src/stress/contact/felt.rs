//! What hands felt with tools: the force that the cap withheld, the largest jump, and how far tools sank into what they touched.

use host::engine::plan::renderable;
use host::world::World;
use nalgebra::{Isometry3, Point3};
use physics::Vec3;
use physics::contact::obstacle::Geometry;
use physics::contact::rounded::Rounded;
use physics::contact::vicinity::nearest_point;
use rt_core::safety::SafetyState;
use rt_core::{Pose, Telemetry};

/// The stiffest spring that a device of unknown friction and damping renders (N/m).
const STIFFEST: f64 = 3000.0;
/// The part of the radius beyond which the hull itself is in the surface, but for rounding.
const PASSED: f64 = 0.99;
/// A way of a hand (m) that counts in any case, and the largest force of a tool as a multiple of the stiffest spring over the way: another tool
/// may push the surface towards this one as far again.
const LEAST_WAY: f64 = 1e-3;
const MOST_LAW: f64 = 2.0;

/// The tools of a run.
pub(super) struct Felt<'a> {
    world: &'a World<'a>,
    /// By device, the stiffest spring (N/m).
    stiffest: Vec<f64>,
    /// By device, its pose and the force on its hand in the last tick (N), if it rendered the whole force.
    before: Vec<Option<(Pose, Vec3)>>,
    /// Sums of the withheld and the whole force (N).
    withheld: f64,
    whole: f64,
    /// By tool, the patch of the last two ticks.
    patches: Vec<[u64; 2]>,
    /// The largest unexplained changes of a force in a tick (N), with a new patch in this tick or the last one, and without.
    pub(super) jumps: [f64; 2],
    /// The largest force of a tool before the cap (N), as a multiple of the stiffest spring over the way of the hand, and its tick.
    pub(super) law: (f64, u64),
    /// The largest part of a radius by which a tool was inside a thing, and its tick.
    pub(super) sunk: (f64, u64),
    now: u64,
}

impl<'a> Felt<'a> {
    pub(super) fn new(world: &'a World<'a>) -> Self {
        let each = renderable(world.loaded);
        Self {
            world,
            stiffest: each.iter().map(|one| one.stiffness.min(STIFFEST)).collect(),
            patches: vec![[0; 2]; each.len()],
            before: vec![None; each.len()],
            withheld: 0.0,
            whole: 0.0,
            jumps: [0.0; 2],
            law: (0.0, 0),
            sunk: (0.0, 0),
            now: 0,
        }
    }

    /// The part of the force that the cap withheld.
    pub(super) fn withheld(&self) -> f64 {
        self.withheld / self.whole.max(f64::MIN_POSITIVE)
    }

    /// Takes a tick.
    pub(super) fn see(&mut self, telemetry: &Telemetry) {
        self.now = telemetry.tick;
        let scene = &self.world.loaded.scene;
        let shapes = scene.numbered_tools().zip(self.world.tool_shapes());
        for ((spec, device, _), shape) in shapes {
            let count = usize::from(telemetry.tool_count);
            let mut tools = telemetry.tools.iter().take(count);
            let Some(tool) = tools.find(|tool| usize::from(tool.device) == device) else {
                continue;
            };
            self.withheld += tool.withheld.force;
            self.whole += tool.withheld.of;
            let shown = &telemetry.devices[device];
            let start = Vec3::from(spec.position);
            let spring = self.stiffest[device] * ((shown.pose.position - start).norm() + LEAST_WAY);
            let law = tool.wrench.force.norm() / spring;
            if law > self.law.0 {
                self.law = (law, self.now);
            }
            let [before, last] = self.patches[device];
            self.patches[device] = [last, tool.sequence];
            let is_new = tool.sequence != last || last != before;
            // What a fault of a device takes away, and how that comes back, is its own.
            let is_whole = matches!(shown.safety, SafetyState::Normal | SafetyState::Limited)
                && telemetry.readings[device].is_ok();
            let now = is_whole.then_some((shown.pose, shown.wrench.force));
            let before = core::mem::replace(&mut self.before[device], now);
            if let (Some((from, was)), Some((to, is))) = (before, now) {
                let turn = (to.rotation * from.rotation.inverse()).angle();
                let reach = shape.hull().extent() + shape.radius();
                let way = (to.position - from.position).norm() + turn * reach;
                let jump = (is - was).norm() - self.stiffest[device] * way;
                let most = &mut self.jumps[usize::from(!is_new)];
                *most = most.max(jump);
            }
            let hull = shape.hull().turned(&tool.proxy.rotation);
            let centre = tool.proxy.position;
            let mut deepest = 0.0_f64;
            for obstacle in &self.world.obstacles[..scene.given_obstacles().len()] {
                if let Geometry::Shape(other) = obstacle.geometry() {
                    let pose = obstacle.pose(0.0);
                    let nearest = Point3::from(nearest_point(other, &pose, &hull, &centre));
                    let found = other.nearest(&pose.inverse_transform_point(&nearest).coords);
                    deepest = deepest.max(1.0 - found.distance / shape.radius());
                }
            }
            self.sink(deepest);
        }
    }

    /// Takes the triangles of a body that a tool of the host touches, at the end of a step.
    pub(super) fn touches<'b>(
        &mut self,
        tool: &Rounded,
        pose: &Isometry3<f64>,
        triangles: impl Iterator<Item = [&'b Vec3; 3]>,
    ) {
        let distances = triangles.map(|triangle| tool.distance_from_hull(pose, triangle));
        let least = distances.fold(f64::INFINITY, f64::min);
        self.sink(1.0 - least / tool.radius());
    }

    fn sink(&mut self, part: f64) {
        if part > self.sunk.0 {
            self.sunk = (part, self.now);
        }
    }

    /// The rules that the tools broke.
    pub(super) fn failures(&self) -> Vec<String> {
        let mut found = Vec::new();
        let (part, tick) = self.sunk;
        if part > PASSED {
            found.push(format!("a tool passed through a surface in tick {tick}"));
        }
        let (law, tick) = self.law;
        if law > MOST_LAW {
            found.push(format!("in tick {tick}, the force of a tool before the cap is {law:.1} times that of its stiffest spring over the way of the hand"));
        }
        found
    }
}
