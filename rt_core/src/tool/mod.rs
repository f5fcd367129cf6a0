//! Contact of a tool inside the tick: the tool meets, slides on and leaves surfaces that yield.
//!
//! The host publishes the surface near the tool as a [`Patch`]: material points (**sites**), the triangles between them, and how
//! they yield. The tick finds the contacts and their forces by itself, so that no force waits for the host.
//!
//! **Yield.** With `W` the elastic compliance, `f` the forces at the sites and `b` the damping time, the displacement `u` since
//! the message obeys `u + r = W (f - f0) + b v`, with the viscous stretch `r' = (b / t) u' - r / t`: a standard linear solid, a
//! spring and a Maxwell arm in parallel, which is passive. Its relaxation time `t` is at least two milliseconds, and long enough for
//! the transient stiffness to stay below what the device can render. Implicit Euler gives the places of the sites as an affine
//! function of the forces.
//!
//! **Drift.** A surface goes on with the part of its velocity that inertia keeps: a tap would otherwise meet a dent that has stopped. Nothing but
//! inertia holds a loose piece, whose compliance is that of its inertia over one publication. A hand that carries the piece would feel its sites
//! stay behind, and its friction would slip and be lost when the hand stops.
//!
//! **Floor.** The centre of the tool (the **proxy**) is `c = x + D F`: the hand `x`, the force `F` on it, and the compliance `D` that
//! is left of the device's stiffest spring beside the surface. The felt stiffness is the lesser one of both, not their series. On a
//! device of six degrees of freedom the tool turns with the hand, and by the moment about `c` in the same way. With the arms `r`
//! from `c`, two contacts then have the compliance `D - [r1] Dr [r2]` between them (`[r]`: the matrix of `r x`; `Dr`: the floor of rotation).
//!
//! **Messages.** Sites and proxy are where they were when a message comes. The difference to the places of the message fades
//! within half a period; that of a proxy whose floor changes, in a tenth of a second. A message of other sites can leave a contact without its place on the surface: the force of which this would
//! deprive the hand in one tick is carried, and fades too. Forces therefore never jump.
//!
//! **Friction of the host.** Tick and host stick to places of their own on the material. What one of them slipped would stay between their forces
//! for ever. The forces on a loose piece balance its weight in the host alone: there, a message leads the friction of contacts that stick a part
//! of the way to that of the host, by the difference of both forces at the time of the message. On a body that is held, the friction of the tick
//! is nearer to that of a host in every tick than the friction of a late host.
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
mod normal;
mod past;
mod patch;
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

pub use contacts::Contact;
pub use coupling::{ToolCounters, ToolCoupling, ToolCouplingConfig};
pub use patch::{Compliance, PackedPatch, Patch, PatchFault, PatchHead, Site, Triangle};

/// Largest number of sites in a patch.
pub const MAX_SITES: usize = 16;
/// Largest number of triangles in a patch.
pub const MAX_TRIANGLES: usize = 32;
/// Largest number of contacts of a tool.
pub const MAX_CONTACTS: usize = 16;

/// Least relaxation time of the viscous stretch (s): two ticks of the usual loop.
const RELAXES: f64 = 2e-3;
/// Largest number of times that the geometry of the contacts is linearized in a tick: once more while something overlaps. Deep in a
/// soft surface, the force of a moving ball then is right to a thousandth.
const LINEARIZED: usize = 4;
/// The ways of tool and surface in a tick, by which contacts are looked for beyond the radius.
const REACH: f64 = 2.0;

/// The change of the force (N) in the tick of a message, beyond that in the tick before, that is not carried: the jump of a message
/// that no hand feels.
const UNFELT: f64 = 0.05;
/// The compliance of contacts themselves, along their normals and across, as a fraction of that of the device's stiffest spring: 0.1 um/N and
/// 1 um/N beside 3 kN/m.
const SOFT: f64 = 3e-4;
const SOFT_ACROSS: f64 = 3e-3;
/// The stretch (m) of the device's stiffest spring at whose force a contact that is held comes off: 30 N at 3 kN/m.
const GRIP: f64 = 0.01;
/// The publication periods after which the sites of a late host drift no further.
const DRIFTS: f64 = 3.0;
/// The time (s) in which the offset of the proxy fades after the floor changed, as where an obstacle comes into reach: the hand is at
/// another place under the same force, and feels the way back.
const OFFSET_FADES: f64 = 0.1;
/// The part of the difference between the friction of the host and of the tick that a message takes away from a loose piece: the rest is a
/// hundredth after twenty messages, and no message is felt.
const FOLLOWS: f64 = 0.2;
/// A viscous stretch (m) that no device renders: 30 pN at 3 kN/m.
const AT_REST: f64 = 1e-14;

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

/// A site between ticks.
#[derive(Clone, Copy, Debug)]
struct SiteState {
    /// Elastic displacement since the message (m): `u`.
    stretch: Vec3,
    /// Viscous stretch (m): `r`.
    viscous: Vec3,
    /// The difference to the place of the message when it came (m), which fades.
    offset: Vec3,
    /// `b v - W f0` (m), with the velocity without the drift.
    bias: Vec3,
}

impl SiteState {
    const ZERO: Self = Self {
        stretch: Vec3::new(0.0, 0.0, 0.0),
        viscous: Vec3::new(0.0, 0.0, 0.0),
        offset: Vec3::new(0.0, 0.0, 0.0),
        bias: Vec3::new(0.0, 0.0, 0.0),
    };
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

/// How the viscous stretch of a patch relaxes in a tick.
#[derive(Clone, Copy, Debug)]
struct Relaxation {
    /// The fraction of the viscous stretch that is left after a tick.
    left: f64,
    /// The viscous stretch by an elastic displacement in the tick.
    gain: f64,
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

    /// The time (s) for which the sites of a patch have drifted, if it is the newest.
    fn drift_time(&self, patch: &PatchHead) -> f64 {
        self.age.max(0.0).min(DRIFTS * patch.period)
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

    /// Leads the friction of contacts that stick on a loose piece to that of the host in the new patch.
    fn follow(&mut self) {
        let older = self.age / self.config.period + 0.5;
        let Some(was) = self.past.force(older as usize) else {
            return;
        };
        let sites = self.patch.sites.iter();
        let hosts: Vec3 = sites
            .take(usize::from(self.patch.head.site_count))
            .map(|site| -site.force)
            .sum();
        let missing = (hosts - was) * (FOLLOWS * (1.0 - self.patch.head.elastic));
        let fraction = 1.0 / (1.0 + self.relaxation.gain);
        for contact in &mut self.contacts {
            contact.lead(&missing, &self.patch, fraction);
        }
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

    /// Carries the wrench of which a message has deprived the hand, beyond what no hand feels.
    fn carry(&mut self, missing: &Wrench) {
        let unfelt = UNFELT + self.change;
        let part = 1.0 - unfelt / self.felt(missing);
        // The wrench fades from this tick on.
        self.carried = if part > 0.0 && self.fade > 0.0 {
            missing.scaled(part / self.fade)
        } else {
            Wrench::zero()
        };
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

    /// Takes the pending patch into use. Sites and proxy stay where they are. A contact with a triangle that is there no longer goes on
    /// at the nearest point of the new surface: without its force, the surface would keep its dent and press less.
    fn switch(&mut self) {
        let (old, new) = (&self.patch.head, &self.pending.head);
        let count = usize::from(new.site_count);
        let before = usize::from(old.site_count);
        let mut kept = [false; MAX_SITES];
        let vertices = self
            .patch
            .sites
            .iter()
            .zip(&self.pending.sites)
            .take(before.min(count));
        for (kept, (one, other)) in kept.iter_mut().zip(vertices) {
            *kept = old.epoch == new.epoch && one.vertex == other.vertex;
        }
        let (was, places) = (self.places, self.rendered(&kept, count));
        let is_kept = |corner: &u8| kept.get(usize::from(*corner)).copied().unwrap_or_default();
        let goes_on = |contact: &Contact| {
            let mut triangles = new.triangles();
            contact.corners.iter().all(is_kept)
                && triangles.any(|triangle| triangle.corners == contact.corners)
        };
        let mut contacts = Contacts::new();
        for contact in self.contacts.iter().filter(|contact| goes_on(contact)) {
            // Both lists have the same room.
            let _ = contacts.push(*contact);
        }
        for contact in &self.contacts {
            if !goes_on(contact) {
                let now = new.triangles();
                contacts::carry(
                    &mut contacts,
                    contact,
                    now,
                    [&was, &places],
                    self.config.radius,
                );
            }
        }
        self.contacts = contacts;
        let (Wrench { force, moment }, fade) = (self.contact_wrench(), self.fade);
        let [way, turn] = self.offset.now();
        let offset = Offset {
            way: way + (old.floor - new.floor) * force,
            turn: turn + (old.turning_floor - new.turning_floor) * moment,
            left: 1.0,
        };
        self.carried = self.carried.scaled(fade);
        self.patch.copy_used_from(&self.pending);
        self.offset = if before > 0 { offset } else { Offset::ZERO };
        self.relaxation = self.relaxation();
        self.is_rigid = self.patch.is_rigid();
        self.begin_sites(&kept, count);
        let fraction = -1.0 / (1.0 + self.relaxation.gain);
        self.unloaded = self.loaded(&self.places, &loads(&self.contacts), fraction);
        let each = self.sites.iter().zip(&self.patch.sites).take(count);
        (self.bounds, self.most_offset) = (Bounds::NONE, 0.0);
        for (state, site) in each {
            for time in [0.0, DRIFTS * self.patch.head.period] {
                self.bounds.add(&(site.drifted(time) + state.bias));
            }
            self.most_offset = self.most_offset.max(state.offset.norm());
        }
        let head = &self.patch.head;
        self.fade = 1.0;
        self.fade_step = (2.0 * self.config.period / head.period).min(0.5);
    }

    /// Lets the present differences fade as if they had come with a message of this tick.
    fn fade_again(&mut self) {
        let fade = core::mem::replace(&mut self.fade, 1.0);
        self.carried = self.carried.scaled(fade);
        for state in &mut self.sites {
            state.offset *= fade;
        }
        self.most_offset *= fade;
    }

    /// The sites of the pending patch: those that were there where they are, and the new ones where the host has them (m).
    fn rendered(&self, kept: &[bool; MAX_SITES], count: usize) -> [Vec3; MAX_SITES] {
        let mut places = self.places;
        let drift_time = self.drift_time(&self.pending.head);
        let each = places.iter_mut().zip(&self.pending.sites).zip(kept);
        for ((place, site), _) in each.take(count).filter(|(_, kept)| !**kept) {
            *place = site.drifted(drift_time);
        }
        places
    }

    /// The displacement and the offset of each site of a new patch. A new site has the offset of the nearest one that was there.
    fn begin_sites(&mut self, kept: &[bool; MAX_SITES], count: usize) {
        let forces = loads(&self.contacts);
        let damping = self.patch.head.damping;
        let drift_time = self.drift_time(&self.patch.head);
        let each = self
            .sites
            .iter_mut()
            .zip(&self.patch.sites)
            .zip(&self.patch.compliance);
        for ((((state, site), row), place), kept) in each.zip(&self.places).zip(kept).take(count) {
            let pairs = row.iter().zip(&self.patch.sites).zip(&forces).take(count);
            let mut loaded = Vec3::zeros();
            state.bias = (site.velocity - site.drift) * damping;
            for ((block, other), force) in pairs {
                state.bias -= block * other.force;
                loaded += block * force;
            }
            if *kept {
                state.stretch = loaded + state.bias - state.viscous;
                state.offset = place - (site.drifted(drift_time) + state.stretch);
            } else {
                (state.viscous, state.offset) = (Vec3::zeros(), Vec3::zeros());
                state.stretch = loaded + state.bias;
            }
        }
        let states = self.sites;
        let each = self
            .sites
            .iter_mut()
            .zip(&self.patch.sites)
            .zip(&mut self.places);
        for (((state, site), place), _) in each.zip(kept).take(count).filter(|(_, kept)| !**kept) {
            let others = states.iter().zip(&self.patch.sites).zip(kept).take(count);
            let others = others.filter(|(_, kept)| **kept).map(|(other, _)| other);
            let distance = |other: &Site| (other.place - site.place).norm_squared();
            let nearest = others.min_by(|(_, a), (_, b)| distance(a).total_cmp(&distance(b)));
            if let Some((nearest, _)) = nearest {
                state.viscous = nearest.viscous;
                state.stretch -= nearest.viscous;
                state.offset = nearest.offset;
            }
            *place = site.drifted(drift_time) + state.stretch + state.offset;
        }
    }

    /// How the viscous stretch of the patch relaxes. The transient stiffness `K (1 + gain)` is at most that of the device's stiffest
    /// spring, and the damping is at most that which the device can render.
    fn relaxation(&self) -> Relaxation {
        let (head, config) = (&self.patch.head, &self.config);
        let most = config.stiffest / head.stiffness - 1.0;
        let damping = head.damping.min(config.most_damping / head.stiffness);
        if most <= 0.0 || damping <= 0.0 {
            return Relaxation {
                left: 0.0,
                gain: 0.0,
            };
        }
        let time = RELAXES.max(damping / most - config.period);
        Relaxation {
            left: time / (time + config.period),
            gain: damping / (time + config.period),
        }
    }

    /// The sites without contact forces (m).
    fn free(&self) -> [Vec3; MAX_SITES] {
        let Relaxation { left, gain } = self.relaxation;
        let mut free = [Vec3::zeros(); MAX_SITES];
        let count = usize::from(self.patch.head.site_count);
        let drift_time = self.drift_time(&self.patch.head);
        let each = self.sites.iter().zip(&self.patch.sites);
        for (free, (state, site)) in free.iter_mut().zip(each).take(count) {
            let stretch = state.bias - state.viscous * left + state.stretch * gain;
            *free = site.drifted(drift_time) + state.offset * self.fade + stretch / (1.0 + gain);
        }
        free
    }

    /// The sites under contact forces (m).
    fn loaded(
        &self,
        free: &[Vec3; MAX_SITES],
        forces: &[Vec3; MAX_SITES],
        fraction: f64,
    ) -> [Vec3; MAX_SITES] {
        let mut places = *free;
        if self.is_rigid {
            return places;
        }
        let count = usize::from(self.patch.head.site_count);
        let mut loaded = heapless::Vec::<(usize, Vec3), MAX_SITES>::new();
        for (force, at) in forces.iter().zip(0..count) {
            if *force != Vec3::zeros() {
                // There is room for all sites.
                let _ = loaded.push((at, force * fraction));
            }
        }
        for (place, row) in places.iter_mut().zip(&self.patch.compliance).take(count) {
            for (at, force) in &loaded {
                *place += row.get(*at).map_or(Vec3::zeros(), |block| block * force);
            }
        }
        places
    }

    /// The largest way of a site since the last tick if the contact forces stay, with the sites without contact forces (m).
    fn most_way(&self, free: &[Vec3; MAX_SITES]) -> f64 {
        let count = usize::from(self.patch.head.site_count);
        let each = free.iter().zip(&self.unloaded).take(count);
        each.map(|(place, before)| (place - before).norm())
            .fold(0.0, f64::max)
    }

    /// Ends a tick: the displacement and the viscous stretch of each site.
    fn relax(&mut self, places: &[Vec3; MAX_SITES]) {
        let Relaxation { left, gain } = self.relaxation;
        let count = usize::from(self.patch.head.site_count);
        let drift_time = self.drift_time(&self.patch.head);
        let each = self.sites.iter_mut().zip(&self.patch.sites).zip(places);
        for ((state, site), place) in each.take(count) {
            let stretch = place - site.drifted(drift_time) - state.offset * self.fade;
            state.viscous = state.viscous * left + (stretch - state.stretch) * gain;
            state.stretch = stretch;
        }
        let mut each = self.sites.iter_mut().take(count);
        let is_free = self.contacts.is_empty();
        self.is_at_rest = is_free && each.all(|state| state.viscous.amax() < AT_REST);
        if self.is_at_rest {
            for state in self.sites.iter_mut().take(count) {
                (state.viscous, state.stretch) = (Vec3::zeros(), state.bias);
            }
        }
    }
}
