//! Hands that follow the waypoints of a scene exactly.
//!
//! A simulated hand gives way to the force that it feels, so runs of different hosts would differ in the motion, too.

use host::engine::Engine;
use host::world::{World, grasps};
use nalgebra::UnitQuaternion;
use rt_core::{MAX_DEVICES, Pose, TickRecord, Twist, Vec3};
use sim::Trajectory;

/// A hand.
struct Path {
    device: usize,
    start: Pose,
    trajectory: Trajectory,
    /// From device axes to scene axes.
    rotation: UnitQuaternion<f64>,
    scale: f64,
}

/// Pose and twist of a hand, by device.
pub(crate) type Poses = [(Pose, Twist); MAX_DEVICES];

/// The hands of all bodies of a scene, in the order of the handles.
pub(crate) struct Hands {
    paths: Vec<Path>,
}

impl Hands {
    /// The hands of the world, at the handles of the bodies of `engine`, which are at rest.
    pub(crate) fn new(world: &World<'_>, engine: &Engine) -> Self {
        let scene = &world.loaded.scene;
        let mut paths = Vec::new();
        for (spec, body) in scene.bodies.iter().zip(engine.bodies()) {
            for (handle, grasp) in grasps(scene, spec).iter().enumerate() {
                let Some(report) = body.body().handle_report(handle) else {
                    continue;
                };
                let device = &scene.devices[grasp.device];
                let points = device
                    .hand
                    .as_ref()
                    .map_or(&[][..], |hand| hand.waypoints.as_slice());
                let points: Vec<_> = points
                    .iter()
                    .map(|[t, x, y, z]| (*t, Vec3::new(*x, *y, *z)))
                    .collect();
                let trajectory = Trajectory::new_waypoints(&points);
                paths.push(Path {
                    device: grasp.device,
                    start: Pose {
                        position: report.pose.position,
                        rotation: report.pose.rotation,
                    },
                    trajectory: trajectory.unwrap_or_else(|_| Trajectory::still()),
                    rotation: world.mounts[grasp.device].rotation,
                    scale: device.motion_scale,
                });
            }
        }
        Self { paths }
    }

    /// Pose and twist of each hand at `time` (s), in the order of the handles.
    pub(crate) fn at(&self, time: f64) -> Vec<(Pose, Twist)> {
        let each = self.paths.iter().map(|path| {
            let (moved, velocity) = path.trajectory.at(time);
            let pose = Pose {
                position: path.start.position + path.rotation * moved * path.scale,
                rotation: path.start.rotation,
            };
            let twist = Twist {
                linear: path.rotation * velocity * path.scale,
                ..Twist::zero()
            };
            (pose, twist)
        });
        each.collect()
    }

    /// Pose and twist of the hand of each device at `time` (s).
    pub(crate) fn by_device(&self, time: f64) -> Poses {
        let mut poses = [(Pose::identity(), Twist::zero()); MAX_DEVICES];
        for (path, hand) in self.paths.iter().zip(self.at(time)) {
            if let Some(pose) = poses.get_mut(path.device) {
                *pose = hand;
            }
        }
        poses
    }

    /// The direction in which each hand moves from the start until `time` (s): of unit length, or zero.
    pub(crate) fn directions(&self, time: f64) -> Vec<Vec3> {
        let each = self.paths.iter().map(|path| {
            let moved = path.rotation * path.trajectory.at(time).0;
            moved.try_normalize(0.0).unwrap_or_default()
        });
        each.collect()
    }

    /// The record of the tick of this number and time (ns).
    pub(crate) fn record(&self, tick: u64, time_ns: u64) -> TickRecord {
        let mut record = TickRecord {
            tick,
            time_ns,
            ..TickRecord::empty()
        };
        let hands = self.at(time_ns as f64 * 1e-9);
        for (path, hand) in self.paths.iter().zip(hands) {
            if path.device < MAX_DEVICES {
                record.proxies[path.device] = hand;
                record.device_count = record.device_count.max(path.device as u8 + 1);
            }
        }
        record
    }
}
