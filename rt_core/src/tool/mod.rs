//! Contact of a tool inside the tick: the tool meets, slides on and leaves surfaces that yield.
//!
//! The host publishes the surface near the tool as a [`Patch`]: material points (**sites**), the triangles between them, and how
//! they yield. The tick finds the contacts and their forces by itself, so that no force waits for the host.
//!
//! **Floor.** The centre of the tool (the **proxy**) is `c = x + D F`: the hand `x`, the force `F` on it, and the compliance `D` that
//! is left of the device's stiffest spring beside the surface. The felt stiffness is the lesser one of both, not their series. On a
//! device of six degrees of freedom the tool turns with the hand, and by the moment about `c` in the same way. With the arms `r`
//! from `c`, two contacts then have the compliance `D - [r1] Dr [r2]` between them (`[r]`: the matrix of `r x`; `Dr`: the floor of rotation).
//!
//! **Taking hold.** While the hand takes hold, what presses is held: the contact neither opens nor slips, and nothing else changes. A hand that
//! lets go loses the force that only a held contact has within half a period, as the difference of a message. The host holds the same points. If a
//! message of a step that knew of the hold has no force on the body, the host's tool touches nothing there, and the tick lets go.
//!
//! **Overlap.** If the surface comes to where the tool is, they part at a bounded speed ([`ToolConfig::parting`]).

mod contacts;
mod coupling;
mod forces;
mod friction;
mod message;
mod normal;
mod past;
mod patch;
mod sites;
#[cfg(test)]
mod tests;

use crate::count_one;
use crate::geometry::{Mat3, Pose, Vec3, Wrench, small_turn};
use crate::hull::{Hull, Seed};
use crate::publication::Publication;
use contacts::{Contacts, Lengths, Places, Softness, are_clear, find, hold, let_go, loads, settle};
use forces::{Turning, Yielding, solve};
use nalgebra::UnitQuaternion;
use past::Past;
use sites::{Relaxation, SiteState};

pub use contacts::Contact;
pub use coupling::{ToolCounters, ToolCoupling, ToolCouplingConfig};
pub use patch::{Compliance, PackedPatch, Patch, PatchFault, PatchHead, Site, Triangle};

/// Largest number of sites in a patch.
pub const MAX_SITES: usize = 16;
/// Largest number of triangles in a patch.
pub const MAX_TRIANGLES: usize = 32;
/// Largest number of contacts of a tool.
pub const MAX_CONTACTS: usize = 16;

/// Largest number of times that the geometry of the contacts is linearized in a tick: once more while something overlaps. Deep in a
/// soft surface, the force of a moving ball then is right to a thousandth.
const LINEARIZED: usize = 4;
/// The ways of tool and surface in a tick, by which contacts are looked for beyond the radius.
const REACH: f64 = 2.0;

/// The compliance of contacts themselves, along their normals and across, as a fraction of that of the device's stiffest spring: 0.1 um/N and
/// 1 um/N beside 3 kN/m.
const SOFT: f64 = 3e-4;
const SOFT_ACROSS: f64 = 3e-3;
/// The stretch (m) of the device's stiffest spring at whose force a contact that is held comes off: 30 N at 3 kN/m.
const GRIP: f64 = 0.01;
/// The time (s) in which the offset of the proxy fades after the floor changed, as where an obstacle comes into reach: the hand is at
/// another place under the same force, and feels the way back.
const OFFSET_FADES: f64 = 0.1;

/// A tool: all points within a radius of a hull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToolConfig {
    /// The hull about the centre of the tool, in world axes while the hand is not turned; of a sphere, [`Hull::POINT`].
    pub hull: Hull,
    /// Whether the tool turns with the hand, and the hand feels moments. Otherwise the tool keeps its attitude.
    pub turns: bool,
    /// Radius (m).
    pub radius: f64,
    /// The tick's period (s).
    pub period: f64,
    /// The stiffest spring that the device can render (N/m).
    pub stiffest: f64,
    /// The largest damping that the device can render (N s/m).
    pub most_damping: f64,
    /// The speed at which an overlap parts (m/s).
    pub parting: f64,
}

/// A difference between poses that fades: a way (m) and a small rotation vector (rad).
#[derive(Clone, Copy, Debug)]
struct Offset {
    way: Vec3,
    turn: Vec3,
    /// The fraction that has not faded.
    left: f64,
}

impl Offset {
    const ZERO: Self = Self {
        way: Vec3::new(0.0, 0.0, 0.0),
        turn: Vec3::new(0.0, 0.0, 0.0),
        left: 0.0,
    };

    /// The way and the turn that are left.
    fn now(&self) -> [Vec3; 2] {
        [self.way * self.left, self.turn * self.left]
    }
}

/// The box around points.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    least: Vec3,
    most: Vec3,
}

impl Bounds {
    /// The box around no point.
    const NONE: Self = Self {
        least: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        most: Vec3::new(-f64::INFINITY, -f64::INFINITY, -f64::INFINITY),
    };

    fn add(&mut self, point: &Vec3) {
        self.least = self.least.inf(point);
        self.most = self.most.sup(point);
    }

    /// The distance of a point from the box (m); zero inside.
    fn distance(&self, point: &Vec3) -> f64 {
        let beyond = (self.least - point).sup(&(point - self.most));
        beyond.sup(&Vec3::zeros()).norm()
    }
}

/// The rotation from the attitude of one pose to that of another.
fn between(from: &Pose, to: &Pose) -> UnitQuaternion<f64> {
    to.rotation * from.rotation.inverse()
}

/// The same as a matrix.
fn turn(from: &Pose, to: &Pose) -> Mat3 {
    between(from, to).to_rotation_matrix().into_inner()
}

/// The angle between the attitudes of two poses (rad), small ones rightly and others too small by a third at most.
fn angle(one: &Pose, other: &Pose) -> f64 {
    2.0 * between(one, other).imag().norm()
}

/// A tool in contact with one patch.
///
/// ```
/// use rt_core::hull::Hull;
/// use rt_core::{Pose, Vec3};
/// use rt_core::tool::{Patch, Site, Tool, ToolConfig, Triangle};
///
/// // A floor that nothing moves, and a device that renders at most 1 kN/m.
/// let mut floor = Patch::empty();
/// floor.head.sequence = 1;
/// (floor.head.site_count, floor.head.triangle_count) = (3, 1);
/// floor.head.triangles[0].corners = [0, 1, 2];
/// floor.head.floor.fill_diagonal(1e-3);
/// for (site, place) in floor.sites.iter_mut().zip([[-0.1, -0.1], [0.1, -0.1], [0.0, 0.1]]) {
///     site.place = Vec3::new(place[0], place[1], 0.0);
/// }
/// let mut ball = Tool::new(ToolConfig {
///     hull: Hull::POINT,
///     turns: false,
///     radius: 5e-3,
///     period: 1e-3,
///     stiffest: 1e3,
///     most_damping: 10.0,
///     parting: 0.02,
/// });
/// ball.accept(&floor).unwrap();
/// // The hand goes down to 2 mm below the place where the ball touches.
/// for tick in 0..=10 {
///     let hand = Vec3::new(0.0, 0.0, 8e-3 - 0.5e-3 * f64::from(tick));
///     ball.tick(&Pose::at(hand));
/// }
/// assert!((ball.wrench().force - Vec3::z() * 2.0).norm() < 1e-9);
/// assert!((ball.proxy().position - Vec3::z() * 5e-3).norm() < 1e-9);
/// ```
#[derive(Clone, Debug)]
pub struct Tool {
    config: ToolConfig,
    /// The largest distance of a corner of the hull from the centre (m).
    extent: f64,
    patch: Patch,
    pending: Patch,
    is_pending: bool,
    /// The age of the newest patch in the last tick (s).
    age: f64,
    refused: u64,
    relaxation: Relaxation,
    /// Whether no site of the patch yields.
    is_rigid: bool,
    sites: [SiteState; MAX_SITES],
    /// The sites as rendered last (m), and where they would have been without contact forces.
    places: [Vec3; MAX_SITES],
    unloaded: [Vec3; MAX_SITES],
    contacts: Contacts,
    /// The forces of bodies.
    past: Past,
    /// Of the searches for the nearest points of the hull and each triangle.
    seeds: [Seed; MAX_TRIANGLES],
    proxy: Option<Pose>,
    /// The offset of the proxy by changes of the floor.
    offset: Offset,
    /// The wrench of contacts that went with the message, which fades.
    carried: Wrench,
    fade: f64,
    fade_step: f64,
    /// The change of the wrench in the last tick, as [`Self::felt`] (N).
    change: f64,
    has_room: bool,
    /// Whether the hand takes hold of what the tool touches.
    holds: bool,
    /// Whether the host knew of it in the step of the newest patch.
    is_hold_known: bool,
    /// The sites without contact forces, without their offsets.
    bounds: Bounds,
    /// The largest offset of a site when the message came (m).
    most_offset: f64,
    /// Whether no stretch of a site relaxes.
    is_at_rest: bool,
    /// Whether the tool was far from all sites in the last tick, so that their places were not computed.
    is_away: bool,
}

impl Tool {
    /// A tool before its first patch.
    pub fn new(config: ToolConfig) -> Self {
        Self {
            extent: config.hull.extent(),
            config,
            patch: Patch::empty(),
            pending: Patch::empty(),
            is_pending: false,
            age: 0.0,
            refused: 0,
            relaxation: Relaxation {
                left: 0.0,
                gain: 0.0,
            },
            is_rigid: true,
            sites: [SiteState::ZERO; MAX_SITES],
            places: [Vec3::zeros(); MAX_SITES],
            unloaded: [Vec3::zeros(); MAX_SITES],
            contacts: Contacts::new(),
            past: Past::NONE,
            seeds: [Seed::default(); MAX_TRIANGLES],
            proxy: None,
            offset: Offset::ZERO,
            carried: Wrench::zero(),
            fade: 0.0,
            fade_step: 0.0,
            change: 0.0,
            has_room: true,
            holds: false,
            is_hold_known: false,
            bounds: Bounds::NONE,
            most_offset: 0.0,
            is_at_rest: true,
            is_away: false,
        }
    }

    /// Hands over a patch. The next tick takes it into use.
    ///
    /// # Errors
    /// The [`PatchFault`] for which the patch was refused. Refusals are counted.
    pub fn accept(&mut self, patch: &impl Publication<Head = PatchHead>) -> Result<(), PatchFault> {
        let current = if self.is_pending {
            &self.pending.head
        } else {
            &self.patch.head
        };
        let head = patch.head();
        let is_newer = head.sequence > current.sequence && head.epoch >= current.epoch;
        let checked = patch::check(patch).and({
            if is_newer {
                Ok(())
            } else {
                Err(PatchFault::Outdated)
            }
        });
        if checked.is_ok() {
            self.pending.copy_used_from(patch);
            self.is_pending = true;
        } else {
            count_one(&mut self.refused);
        }
        checked
    }

    /// Tells whether the hand takes hold of what the tool touches, from the next tick on: of what presses already, and of what comes to
    /// press.
    pub fn take_hold(&mut self, holds: bool) {
        self.holds = holds;
    }

    /// Tells how old the newest patch is in the next tick (s).
    pub(super) fn see_age(&mut self, age: f64) {
        self.age = age - self.config.period;
    }

    /// Tells that the host knew of the hold in the step of the patch that was accepted last.
    pub(super) fn expect_hold(&mut self) {
        self.is_hold_known = true;
    }

    /// Lets go of all contacts if the hand does, of those that a hand could not hold, and of those on a body of which the patch says that the
    /// host's tool does not touch it. Returns whether there were any.
    fn let_go(&mut self) -> bool {
        let most = if self.holds {
            GRIP * self.config.stiffest
        } else {
            0.0
        };
        if let_go(&mut self.contacts, |one| one.force().norm() >= most) {
            return true;
        }
        if !core::mem::replace(&mut self.is_hold_known, false) {
            return false;
        }
        let yields = |at: usize| {
            let own = self.patch.compliance.get(at).and_then(|row| row.get(at));
            own.is_some_and(|block| *block != Mat3::zeros())
        };
        let sites = (0..).zip(&self.patch.sites);
        let mut sites = sites.take(usize::from(self.patch.head.site_count));
        if sites.any(|(at, site)| yields(at) && site.force != Vec3::zeros()) {
            return false;
        }
        let compliance = &self.patch.compliance;
        let_go(&mut self.contacts, |contact| contact.yields(compliance))
    }

    /// One tick with the hand at a pose. Returns the wrench on the hand, the moment about the centre of the tool.
    pub fn tick(&mut self, hand: &Pose) -> Wrench {
        let was = self.wrench();
        let mut is_carried = self.is_pending && !self.contacts.is_empty();
        if self.is_pending {
            self.is_pending = false;
            self.come_back();
            self.switch();
            self.follow();
        }
        self.age += self.config.period;
        if self.let_go() {
            is_carried = true;
            self.fade_again();
        }
        if self.holds {
            let (softness, radius) = (self.least_softness(), self.config.radius);
            hold(&mut self.contacts, &self.patch.compliance, softness, radius);
        }
        self.move_to(hand);
        self.past.push(self.force_of_bodies());
        if is_carried {
            self.carry(&was.plus(&self.contact_wrench().scaled(-1.0)));
        }
        let wrench = self.wrench();
        self.change = self.felt(&wrench.plus(&was.scaled(-1.0)));
        wrench
    }

    /// The force of bodies on the tool (N); without that of obstacles, which a message does not have.
    fn force_of_bodies(&self) -> Vec3 {
        if self.is_rigid {
            return Vec3::zeros();
        }
        let of_bodies = self.contacts.iter();
        let of_bodies = of_bodies.filter(|contact| contact.yields(&self.patch.compliance));
        of_bodies.map(Contact::force).sum()
    }

    /// Moves the hand to a pose.
    fn move_to(&mut self, hand: &Pose) {
        let fade = (self.fade - self.fade_step).max(0.0);
        self.offset.left = (self.offset.left - self.config.period / OFFSET_FADES).max(0.0);
        let led = self.led(hand);
        let before = self.proxy.unwrap_or(led);
        if self.contacts.is_empty() && self.is_away_from(&led.position, &before.position) {
            (self.fade, self.proxy) = (fade, Some(led));
            self.is_away = true;
            return;
        }
        self.come_back();
        self.fade = fade;
        let free = self.free();
        let fraction = 1.0 / (1.0 + self.relaxation.gain);
        let (mut proxy, mut places) = (before, self.places);
        // Where the tool would be if the forces of the last tick stayed.
        let held = self.yielded(&led, &self.contact_wrench());
        let way = (held.position - before.position).norm() + self.extent * angle(&held, &before);
        let lengths = Lengths {
            radius: self.config.radius,
            reach: REACH * (way + self.most_way(&free)),
            parting: self.config.parting * self.config.period,
        };
        let hull_before = self.hull_at(&before);
        let mut hull = hull_before;
        let (mut turned, softness) = (None, self.softness());
        for pass in 0..LINEARIZED {
            let was = Places {
                hull: &hull_before,
                centre: &before.position,
                sites: &self.places,
            };
            let now = Places {
                hull: &hull,
                centre: &proxy.position,
                sites: &places,
            };
            let triangles = self.patch.head.triangles();
            let was = (pass > 0).then_some(was);
            let (kept, seeds) = (&self.contacts, &mut self.seeds);
            let found = find(triangles, was, now, &lengths, softness, kept, seeds);
            if pass > 0 && are_clear(&found, self.config.radius) {
                break;
            }
            self.contacts = found;
            if self.contacts.is_empty() {
                (proxy, places) = (led, free);
                break;
            }
            let turning = self.config.turns.then(|| Turning {
                free: turn(&proxy, &led),
                before: turn(&proxy, &before),
                floor: &self.patch.head.turning_floor,
            });
            let yielding = Yielding {
                centre: led.position,
                turning,
                sites: &free,
                compliance: &self.patch.compliance,
                fraction,
                floor: &self.patch.head.floor,
                is_rigid: self.is_rigid,
            };
            self.has_room = solve(&mut self.contacts, &yielding, self.config.radius);
            let found_at = proxy;
            proxy = self.yielded(&led, &self.contact_wrench());
            turned = turning.map(|turning| turn(&found_at, &proxy) - turning.before);
            hull = self.hull_at(&proxy);
            places = self.loaded(&free, &loads(&self.contacts), fraction);
        }
        let now = Places {
            hull: &hull,
            centre: &proxy.position,
            sites: &places,
        };
        settle(&mut self.contacts, &now, turned);
        self.relax(&places);
        (self.proxy, self.places, self.unloaded) = (Some(proxy), places, free);
        let wrench = self.wrench();
        let start = proxy.position + wrench.force + wrench.moment + proxy.rotation.imag();
        let sum = places.iter().fold(start, |sum, place| sum + place);
        if !sum.iter().all(|x| x.is_finite()) {
            self.begin_again();
        }
    }

    /// The pose to which the hand would lead the tool without contact forces.
    fn led(&self, hand: &Pose) -> Pose {
        let [way, turn] = self.offset.now();
        let mut led = Pose::at(hand.position + way);
        if self.config.turns {
            led.rotation = small_turn(&turn) * hand.rotation;
        }
        led
    }

    /// The pose of the tool that is led to a pose, under a wrench.
    fn yielded(&self, led: &Pose, wrench: &Wrench) -> Pose {
        let head = &self.patch.head;
        let mut pose = *led;
        pose.position += head.floor * wrench.force;
        if self.config.turns {
            pose.rotation = small_turn(&(head.turning_floor * wrench.moment)) * led.rotation;
        }
        pose
    }

    /// The hull of the tool at a pose.
    fn hull_at(&self, pose: &Pose) -> Hull {
        if self.config.turns {
            self.config.hull.turned(&pose.rotation)
        } else {
            self.config.hull
        }
    }

    /// The least compliance of contacts that have one, along their normals and across (m/N).
    fn least_softness(&self) -> [f64; 2] {
        [SOFT, SOFT_ACROSS].map(|part| part / self.config.stiffest)
    }

    /// The compliance of the contacts themselves. A tool that keeps its attitude needs none.
    fn softness(&self) -> Softness {
        if self.config.turns {
            Softness {
                each: self.least_softness(),
                rolls: self.is_rigid,
            }
        } else {
            Softness::default()
        }
    }

    /// A wrench as the hand feels it (N): a moment counts as the force at the surface of the tool.
    fn felt(&self, wrench: &Wrench) -> f64 {
        wrench.force.norm() + wrench.moment.norm() / (self.extent + self.config.radius)
    }

    /// The wrench on the hand. The moment is zero for a tool that keeps its attitude.
    pub fn wrench(&self) -> Wrench {
        self.contact_wrench().plus(&self.carried.scaled(self.fade))
    }

    /// The wrench of the contacts.
    fn contact_wrench(&self) -> Wrench {
        let mut sum = Wrench::zero();
        for contact in &self.contacts {
            sum.force += contact.force();
            if self.config.turns {
                sum.moment += contact.moment();
            }
        }
        sum
    }

    /// The energy that the hand could get back (J): that of the surface under the contact forces, and that of the floor.
    pub fn stored(&self) -> f64 {
        if self.contacts.is_empty() {
            return 0.0;
        }
        let (Wrench { force, moment }, head) = (self.contact_wrench(), &self.patch.head);
        let mut sum = force.dot(&(head.floor * force));
        sum += moment.dot(&(head.turning_floor * moment));
        for (load, state) in loads(&self.contacts).iter().zip(&self.sites) {
            // `W f - r`: the displacement by the contact forces, without the part that relaxes.
            sum += head.elastic * load.dot(&(state.stretch - state.bias));
        }
        // Not `max`, which hides a number that is not one.
        if sum < 0.0 { 0.0 } else { 0.5 * sum }
    }

    /// Number of the patch that was taken into use last; zero before the first.
    pub fn sequence(&self) -> u64 {
        self.patch.head.sequence
    }

    /// The pose of the tool on the surface; at the origin before the first tick.
    pub fn proxy(&self) -> Pose {
        self.proxy.unwrap_or(Pose::identity())
    }

    /// How far the tool has gone from where it was in the host's step of the patch in use (m), with the way of the farthest corner of its hull
    /// by its turn. Beyond [`PatchHead::reach`], it may meet a surface that the patch lacks.
    pub fn way(&self) -> f64 {
        let (from, to) = (&self.patch.head.pose, self.proxy());
        let way = (to.position - from.position).norm();
        if self.config.turns {
            way + self.extent * angle(from, &to)
        } else {
            way
        }
    }

    /// The distance up to which the patch in use has the surface beyond the tool (m); infinite before the first.
    pub fn reach(&self) -> f64 {
        self.patch.head.reach
    }

    /// The contacts within reach.
    pub fn contacts(&self) -> &[Contact] {
        &self.contacts
    }

    /// The sites in use, as rendered (m), when the tool was near them last.
    pub fn places(&self) -> &[Vec3] {
        let count = usize::from(self.patch.head.site_count);
        self.places.get(..count).unwrap_or(&self.places)
    }

    /// Whether the surface left room for the tool in the last tick.
    pub fn has_room(&self) -> bool {
        self.has_room
    }

    /// Number of patches that were refused.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Forgets the contacts and the stretch after an overflow, which must not outlive the patch that caused it.
    #[cold]
    fn begin_again(&mut self) {
        self.contacts.clear();
        (self.proxy, self.offset) = (None, Offset::ZERO);
        (self.carried, self.change) = (Wrench::zero(), 0.0);
        self.past = Past::NONE;
        let drift_time = self.drift_time(&self.patch.head);
        let each = self.sites.iter_mut().zip(&mut self.places);
        for ((state, place), site) in each.zip(&self.patch.sites) {
            *state = SiteState {
                stretch: state.bias,
                bias: state.bias,
                ..SiteState::ZERO
            };
            *place = site.drifted(drift_time);
        }
        self.unloaded = self.places;
    }

    /// Whether the tool cannot meet the surface in a tick in which its centre moves from `before` to `centre`, if it has no
    /// contact. Nothing then is computed but the place of the tool.
    fn is_away_from(&self, centre: &Vec3, before: &Vec3) -> bool {
        let moved = (centre - before).norm() + self.most_offset * self.fade_step;
        let around = self.config.radius + self.extent;
        let near = around + self.most_offset * self.fade + REACH * moved;
        self.is_at_rest && self.bounds.distance(centre) > near
    }

    /// Finds the places of the sites in the last tick, if the tool was far from them.
    fn come_back(&mut self) {
        if self.is_away {
            self.is_away = false;
            self.places = self.free();
            self.unloaded = self.places;
        }
    }
}
