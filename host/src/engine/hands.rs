//! The hands on a body: their paths, the clock of the body, and the targets of the handles in a step.

use super::change::Held;
use super::clock::BodyClock;
use super::path::HandlePath;
use super::publisher::Publisher;
use super::virtual_coupling::Spring;
use nalgebra::UnitQuaternion;
use physics::{Body, HandlePose};
use rt_core::{Pose, TickRecord};

/// Speed of a handle, or of a tool, in excess of its hand's speed while it catches up (m/s).
const CATCH_UP: f64 = 0.5;
/// Angular velocity of a handle, or of a tool, in excess of its hand's while it catches up (rad/s).
const TURN_AFTER: f64 = 5.0;

/// The hands on one body.
pub(super) struct Hands {
    /// In the order of the body's handles.
    paths: Vec<HandlePath>,
    /// The targets of the handles for the present step.
    pub(super) targets: Vec<HandlePose>,
    /// Cut-off of the paths (Hz).
    cutoff: f64,
    /// Length of a step (s).
    step: f64,
    clock: BodyClock,
    /// The time of the newest record (ns); `None` before the first. A body that nobody holds has a time, too.
    newest_ns: Option<u64>,
    /// The time at the end of the present step (ns); `None` before the first record.
    pub(super) time_ns: Option<u64>,
    /// Whether a handle stays behind its hand in the present step.
    behind: bool,
}

impl Hands {
    /// Hands at rest on `handles`: the device of each and its place. Paths have a `cutoff` (Hz); steps take `step` (s).
    pub(super) fn new(handles: impl Iterator<Item = (u8, Pose)>, cutoff: f64, step: f64) -> Self {
        let path = |(device, start)| HandlePath::new(usize::from(device), cutoff, start);
        let paths: Vec<_> = handles.map(path).collect();
        Self {
            targets: Vec::with_capacity(paths.len()),
            paths,
            cutoff,
            step,
            clock: BodyClock::new(step),
            newest_ns: None,
            time_ns: None,
            behind: false,
        }
    }

    /// Takes one tick's record.
    pub(super) fn follow(&mut self, record: &TickRecord) {
        self.newest_ns = Some(record.time_ns);
        for path in &mut self.paths {
            path.follow(record);
        }
    }

    /// Advances the clock by a step, and sets the targets of the handles: the poses of the hands at the end of the step, or of
    /// the proxies if springs of the `publisher` lie between the hands and the body. After a stall a hand may be anywhere. If its
    /// handle went there at once, the model would show the impact and not the body: see [`catch_up`].
    pub(super) fn aim(&mut self, body: &Body, publisher: &Publisher) {
        self.time_ns = self.newest_ns.map(|newest| self.clock.step(newest));
        let time_ns = self.time_ns.unwrap_or(0);
        self.behind = false;
        self.targets.clear();
        let poses = self.paths.iter().map(|path| path.pose_at(time_ns));
        self.targets.extend(poses.map(|pose| HandlePose {
            position: pose.position,
            rotation: pose.rotation,
        }));
        publisher.place(&mut self.targets, time_ns);
        for (index, (path, target)) in self.paths.iter().zip(&mut self.targets).enumerate() {
            if let Some(report) = body.handle_report(index) {
                self.behind |= catch_up(path, &report.pose, target, self.step);
            }
        }
    }

    /// The time at which a model of the present step holds (ns); `None` before the first record, and while a handle stays
    /// behind its hand.
    pub(super) fn reached_ns(&self) -> Option<u64> {
        self.time_ns.filter(|_| !self.behind)
    }

    /// A hand that is to hold a handle at `start`, from a change of the body on.
    pub(super) fn join(&self, device: u8, link: Option<Spring>, start: Pose) -> Joining {
        Joining {
            device,
            link,
            path: HandlePath::joining(usize::from(device), self.cutoff, start),
        }
    }

    /// Goes on with the hands after a change.
    pub(super) fn regrip(&mut self, regrip: Regrip<'_>) {
        self.paths = regrip.each(&self.paths, |join| join.path.clone());
    }
}

/// A hand that is to hold a handle when a change lands.
pub(super) struct Joining {
    pub(super) device: u8,
    pub(super) link: Option<Spring>,
    pub(super) path: HandlePath,
}

/// The hands after a change: those that stay and those that join.
#[derive(Clone, Copy)]
pub(super) struct Regrip<'a> {
    pub(super) hands: &'a [Held],
    pub(super) joining: &'a [Joining],
}

impl<'a> Regrip<'a> {
    /// For each hand, its entry in `kept` or the entry that `join` makes.
    pub(super) fn each<V: Clone>(self, kept: &[V], join: impl Fn(&Joining) -> V) -> Vec<V> {
        let entry = |hand: &Held| match *hand {
            Held::Kept(old) => kept.get(old).cloned(),
            Held::Joined(number) => self.joining.get(number).map(&join),
        };
        self.hands.iter().filter_map(entry).collect()
    }

    /// The handles after the change, each with its number before.
    pub(super) fn numbered(self) -> impl Iterator<Item = (usize, Option<usize>)> + 'a {
        let numbered = self.hands.iter().enumerate();
        numbered.map(|(handle, hand)| match *hand {
            Held::Kept(old) => (handle, Some(old)),
            Held::Joined(_) => (handle, None),
        })
    }

    /// The handles that join, each with its hand.
    pub(super) fn joined(self) -> impl Iterator<Item = (usize, &'a Joining)> {
        let numbered = self.hands.iter().enumerate();
        numbered.filter_map(move |(handle, hand)| match *hand {
            Held::Joined(number) => self.joining.get(number).map(|join| (handle, join)),
            Held::Kept(_) => None,
        })
    }
}

/// Shortens the way to a target, of a step (s) that begins at a pose: no faster than the hand on this path plus [`CATCH_UP`], and no faster in
/// rotation than the hand plus [`TURN_AFTER`]. Returns whether the target stays behind.
pub(super) fn catch_up(
    path: &HandlePath,
    from: &HandlePose,
    target: &mut HandlePose,
    step: f64,
) -> bool {
    let mut behind = false;
    let speed = path.velocity().norm() + CATCH_UP;
    let displacement = target.position - from.position;
    if let Some(fraction) = shortened(displacement.norm(), speed * step) {
        target.position = from.position + displacement * fraction;
        behind = true;
    }
    // A device that senses no rotation reports the same quaternion in every tick.
    if target.rotation != from.rotation {
        let speed = path.turning().norm() + TURN_AFTER;
        let turn = (target.rotation * from.rotation.inverse()).scaled_axis();
        if let Some(fraction) = shortened(turn.norm(), speed * step) {
            let part = UnitQuaternion::from_scaled_axis(turn * fraction);
            target.rotation = part * from.rotation;
            behind = true;
        }
    }
    behind
}

/// The fraction of a displacement or a turn of `length` that is as long as `most`; `None` if the whole is no longer.
fn shortened(length: f64, most: f64) -> Option<f64> {
    (length > most).then(|| most / length)
}
