//! The contacts of a tool with a patch: where they are.
//!
//! The tool touches each triangle at the point that is nearest to its hull. A point on an edge or a corner belongs to several
//! triangles and counts once. A rounded tool thus rounds an edge by itself, without shading. A point that presses stays a contact until
//! its force is zero, also when another point of its triangle is nearer: where a tool is deep in a soft surface, the nearest
//! points move as the surface yields to them, and without the former points the iteration would not end. Where the hull itself
//! has passed a triangle, the contact presses its furthest corner back along the triangle's normal. On a rigid surface, the points
//! of a tool that turns roll on under the tool. A contact that is held stays where it is.

use super::friction::{SLIDES, most_friction};
use super::patch::{Compliance, Patch, Triangle};
use super::{MAX_CONTACTS, MAX_SITES, MAX_TRIANGLES};
use crate::geometry::{Mat3, Vec3};
use crate::hull::{Hull, Near, Seed};
use crate::nearest::weights;

/// Feet that are nearer to each other than this fraction of the radius are one contact: their distances differ by less than
/// 5 millionths of the radius.
const ONE: f64 = 3e-3;
/// The distance from a point that is held, as a fraction of the radius, within which it stands for all others.
const NEAR_HELD: f64 = 0.5;
/// The compliance of a contact that is held, as a fraction of that of the surface there. The compliance of the sites is known to a hundredth,
/// and a rigid tool would make large forces of the differences between points.
const SOFT_HELD: f64 = 0.02;
/// An overlap (m) that no device renders: 0.3 mN at 3 kN/m.
const CLEAR: f64 = 1e-7;
/// Largest number of contacts that have not pressed yet: the nearest ones.
const MOST_IDLE: usize = MAX_CONTACTS / 2;
/// The sine of the angle to the normal of a triangle up to which the hull lies over the triangle or under it, not beside it.
const BORDER: f64 = 1e-6;

/// A contact of the tool with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The triangle: its corners, as places in the list of sites.
    pub corners: [u8; 3],
    /// The weights of the corners at the foot.
    pub weights: [f64; 3],
    /// From the surface to the tool.
    pub normal: Vec3,
    /// The normal force (N); negative only where the contact is held.
    pub normal_force: f64,
    /// The force of friction on the tool (N).
    pub friction: Vec3,
    /// Coefficient of friction.
    pub coefficient: f64,
    /// Whether the tool holds the surface here: the contact neither opens nor slips.
    pub is_held: bool,
    /// The compliance of the contact itself (m/N), along its normal and across.
    pub(super) softness: [f64; 2],
    /// Whether the contact is to be held from this tick on, at a place where it was not held before.
    begins: bool,
    /// The way across the normal that sticking should have undone (m).
    pub(super) residual: Vec3,
    /// The centre seen from the foot, after the last tick (m).
    pub(super) before: Vec3,
    /// The overlap that the contact may have at the end of this tick (m). A contact that is held has just this overlap and that by its own
    /// compliance, from its first tick on.
    pub(super) allowed: f64,
    /// The foot, at the places that were looked at last (m).
    foot: Vec3,
    /// The point of the hull that is nearest to the foot, seen from the centre (m).
    pub(super) tip: Vec3,
    /// The point of the tool that touches, seen from the centre (m): the arm of the force.
    pub(super) arm: Vec3,
    /// The distance of the hull from the foot (m), negative if the hull has passed the triangle.
    distance: f64,
    /// Whether the hull has passed the triangle at the foot.
    has_passed: bool,
    /// Where the search for the point of the hull that is nearest to the foot ended last.
    seed: Seed,
}

impl Contact {
    /// Takes hold of the surface here, with the compliance of a contact that has at least a `softness`. Nothing else changes.
    fn take_hold(&mut self, compliance: &Compliance, softness: [f64; 2]) {
        let own = self.own(compliance) * SOFT_HELD;
        let along = self.normal.dot(&(own * self.normal));
        let across = 0.5 * (own.trace() - along);
        let [least, least_across] = softness;
        self.softness = [along.max(least), across.max(least_across)];
        self.is_held = true;
        let [_, across] = self.softness;
        self.residual = self.friction * -across;
        self.begins = true;
    }

    /// How the surface yields at the foot to a force there (m/N).
    fn own(&self, compliance: &Compliance) -> Mat3 {
        let mut sum = Mat3::zeros();
        for (a, weight) in self.corners.iter().zip(&self.weights) {
            let row = compliance.get(usize::from(*a));
            for (b, factor) in self.corners.iter().zip(&self.weights) {
                let block = row.and_then(|row| row.get(usize::from(*b)));
                sum += block.map_or(Mat3::zeros(), |block| block * (weight * factor));
            }
        }
        sum
    }

    /// Whether the surface yields here.
    pub(super) fn yields(&self, compliance: &Compliance) -> bool {
        let mut corners = self.corners.iter().map(|at| usize::from(*at));
        corners.any(|at| {
            let own = compliance.get(at).and_then(|row| row.get(at));
            own.is_some_and(|block| *block != Mat3::zeros())
        })
    }

    /// Moves the place to which the contact sticks, so that its friction changes by a force (N).
    pub(super) fn lead(&mut self, force: &Vec3, patch: &Patch, fraction: f64) {
        if self.yields(&patch.compliance) {
            let yields = self.own(&patch.compliance) * fraction + patch.head.floor;
            self.residual -= self.across(&(yields * self.across(force)));
        }
    }

    /// Whether the contact presses, or is held.
    pub(super) fn acts(&self) -> bool {
        self.is_held || self.normal_force > 0.0
    }

    /// Adds the forces of another contact, which goes on as this one. A contact that is held takes the whole force.
    fn join(&mut self, other: &Self) {
        self.is_held |= other.is_held;
        if self.is_held {
            let force = other.force();
            self.normal_force += self.normal.dot(&force);
            self.friction += self.across(&force);
        } else {
            self.normal_force += other.normal_force;
            self.friction += self.across(&other.friction);
        }
    }

    /// Whether this contact is also that of another foot near its own.
    fn stands_for(&self, other: &Self, radius: f64) -> bool {
        let near = if self.is_held { NEAR_HELD } else { ONE } * radius;
        (self.foot - other.foot).norm_squared() < near * near
    }

    /// The force on the tool (N).
    pub fn force(&self) -> Vec3 {
        self.normal * self.normal_force + self.friction
    }

    /// The moment of the force about the centre of the tool (N m).
    pub fn moment(&self) -> Vec3 {
        self.arm.cross(&self.force())
    }

    /// Takes direction and distance at these places. Returns whether there is a direction: below the triangle, it is that of the
    /// triangle. A contact at an edge goes on while the hull stays on the side of the last direction, which may lie in the plane of
    /// the triangle.
    fn look(&mut self, now: &Places<'_>) -> bool {
        let foot = self.at(now.sites) - now.centre;
        let near = now.hull.nearest_to_from(&foot, &mut self.seed);
        self.see(now, &near)
    }

    /// The same, if the point of the hull that is nearest to the foot is known.
    fn see(&mut self, now: &Places<'_>, near: &Near) -> bool {
        let Some([a, b, c]) = place(self.corners, now.sites) else {
            return false;
        };
        let outward = (b - a).cross(&(c - a));
        self.foot = self.at(now.sites);
        let apart = now.centre + near.point - self.foot;
        let goes_on = !self.has_passed && apart.dot(&self.normal) > 0.0;
        let is_above = goes_on || apart.dot(&outward) > 0.0;
        self.has_passed = !(near.are_apart && is_above);
        self.normal = if self.has_passed { outward } else { apart }.normalize();
        self.tip = if self.has_passed {
            now.hull.lowest(&self.normal)
        } else {
            near.point
        };
        self.distance = self.normal.dot(&(now.centre + self.tip - self.foot));
        self.normal.iter().all(|x| x.is_finite())
    }

    /// Moves the foot to the nearest point of its triangle under the point of the hull that was nearest to it.
    fn roll(&mut self, now: &Places<'_>) {
        let Some(corners) = place(self.corners, now.sites) else {
            return;
        };
        let foot = self.at(now.sites) - now.centre;
        let near = now.hull.nearest_to_from(&foot, &mut self.seed);
        if near.are_apart && !self.has_passed {
            self.weights = weights(&(now.centre + near.point), corners.each_ref());
        }
    }

    /// The distance between hull and foot at these places (m), negative on the other side of the surface. A hull that has passed the
    /// triangle parts along the normal, so its distance is along it.
    fn distance_at(&self, places: &Places<'_>) -> f64 {
        let foot = self.at(places.sites) - places.centre;
        let near = places.hull.nearest_to_from(&foot, &mut self.seed.clone());
        if self.has_passed || !near.are_apart {
            return self.normal.dot(&(places.hull.lowest(&self.normal) - foot));
        }
        let apart = near.point - foot;
        apart.norm().copysign(apart.dot(&self.normal))
    }

    fn across(&self, v: &Vec3) -> Vec3 {
        v - self.normal * self.normal.dot(v)
    }

    /// The point at its foot, of places of the sites.
    pub(super) fn at(&self, places: &[Vec3; MAX_SITES]) -> Vec3 {
        let corners = self.corners.iter().zip(&self.weights);
        corners.fold(Vec3::zeros(), |sum, (corner, weight)| {
            let place = places.get(usize::from(*corner));
            sum + place.map_or(Vec3::zeros(), |place| place * *weight)
        })
    }

    /// Adds the force on the body to those of the sites.
    fn load(&self, forces: &mut [Vec3; MAX_SITES]) {
        let force = self.force();
        for (corner, weight) in self.corners.iter().zip(&self.weights) {
            if let Some(sum) = forces.get_mut(usize::from(*corner)) {
                *sum -= force * *weight;
            }
        }
    }
}

/// The contacts of a tick.
pub(super) type Contacts = heapless::Vec<Contact, MAX_CONTACTS>;

/// The forces of the contacts on the sites (N).
pub(super) fn loads(contacts: &[Contact]) -> [Vec3; MAX_SITES] {
    let mut forces = [Vec3::zeros(); MAX_SITES];
    for contact in contacts {
        contact.load(&mut forces);
    }
    forces
}

/// A tool and the sites, at one time.
#[derive(Clone, Copy)]
pub(super) struct Places<'a> {
    pub hull: &'a Hull,
    pub centre: &'a Vec3,
    pub sites: &'a [Vec3; MAX_SITES],
}

/// The lengths by which contacts are found (m).
#[derive(Clone, Copy)]
pub(super) struct Lengths {
    /// Radius of the tool.
    pub radius: f64,
    /// The distance beyond the radius within which contacts are found.
    pub reach: f64,
    /// The way by which an overlap parts in a tick.
    pub parting: f64,
}

/// Finds the contacts of a tool with the triangles at the places `now`, in a tick that began at the places `before`, or at `now` for
/// `None`: the points of `kept` that press, and the nearest points of triangles, whose searches begin at their seeds.
pub(super) fn find<'a>(
    triangles: impl Iterator<Item = &'a Triangle>,
    before: Option<Places<'_>>,
    now: Places<'_>,
    lengths: &Lengths,
    softness: Softness,
    kept: &[Contact],
    seeds: &mut [Seed; MAX_TRIANGLES],
) -> Contacts {
    let mut found = Contacts::new();
    let held = kept.iter().filter(|contact| contact.is_held);
    let others = kept.iter().filter(|one| one.acts() && !one.is_held);
    for contact in held.chain(others) {
        let mut contact = *contact;
        let rolls = softness.rolls && !contact.is_held;
        if rolls {
            contact.roll(&now);
        }
        if contact.look(&now) {
            contact.friction = contact.across(&contact.friction);
            if !is_met(&mut found, &contact, lengths.radius, rolls) {
                // There is room for all that were kept.
                let _ = found.push(contact);
            }
        }
    }
    hand_on(&mut found, kept);
    for (triangle, seed) in triangles.zip(seeds) {
        if let Some(contact) = touch(triangle, &now, lengths, seed)
            && contact.distance.abs() <= lengths.radius + lengths.reach
        {
            insert(&mut found, contact, softness, lengths.radius);
        }
    }
    for contact in &mut found {
        let was = before.as_ref().unwrap_or(&now);
        contact.before = was.centre - contact.at(was.sites);
        contact.arm = contact.tip - contact.normal * lengths.radius;
        let distance = (before.as_ref()).map_or(contact.distance, |was| contact.distance_at(was));
        let overlap = lengths.radius - distance;
        if contact.is_held {
            if core::mem::take(&mut contact.begins) {
                let [along, _] = contact.softness;
                contact.allowed = overlap - along * contact.normal_force;
            }
        } else {
            contact.softness = softness.each;
            contact.allowed = (overlap - lengths.parting).max(0.0);
        }
    }
    found
}

/// Lets go of contacts that are held. Returns whether there were any.
pub(super) fn let_go(contacts: &mut Contacts, are_lost: impl Fn(&Contact) -> bool) -> bool {
    let mut any = false;
    for contact in contacts.iter_mut().filter(|contact| contact.is_held) {
        contact.is_held = !are_lost(contact);
        any |= !contact.is_held;
    }
    any
}

/// Takes hold of the contacts that press, with at least a `softness`. One of them stands for all that are near it: they would act against each
/// other.
pub(super) fn hold(
    contacts: &mut Contacts,
    compliance: &Compliance,
    softness: [f64; 2],
    radius: f64,
) {
    for at in 0..contacts.len() {
        let Some(contact) = contacts.get(at) else {
            break;
        };
        let mut held = contacts.iter().filter(|other| other.is_held);
        let takes = contact.acts() && !held.any(|other| other.stands_for(contact, radius));
        if let Some(contact) = contacts.get_mut(at).filter(|_| takes) {
            contact.take_hold(compliance, softness);
        }
    }
}

/// Adds the forces of a contact to another one that is held and stands for it, or to which it rolled. Returns whether there is one.
fn is_met(found: &mut Contacts, contact: &Contact, radius: f64, rolls: bool) -> bool {
    let mut others = found
        .iter_mut()
        .filter(|other| rolls || (other.is_held && !contact.is_held));
    let other = others.find(|other| other.stands_for(contact, radius));
    let is_there = other.is_some();
    if let Some(other) = other {
        other.join(contact);
    }
    is_there
}

/// Hands the friction of points that do not press any more to a point of the same triangle that does.
fn hand_on(found: &mut Contacts, kept: &[Contact]) {
    for old in kept.iter().filter(|old| !old.acts()) {
        let heir = found.iter_mut().find(|new| new.corners == old.corners);
        if let Some(heir) = heir.filter(|_| old.friction != Vec3::zeros()) {
            heir.friction = heir.across(&old.friction);
            heir.residual = old.residual;
        }
    }
}

/// Carries a contact to the nearest point of other triangles. `was` and `now` are the places of its sites and of those of the
/// triangles. Forces at the same point are added.
pub(super) fn carry<'a>(
    contacts: &mut Contacts,
    contact: &Contact,
    triangles: impl Iterator<Item = &'a Triangle>,
    [was, now]: [&[Vec3; MAX_SITES]; 2],
    radius: f64,
) {
    let foot = contact.at(was);
    let nearest = triangles.filter_map(|triangle| {
        let [a, b, c] = place(triangle.corners, now)?;
        let there = Contact {
            corners: triangle.corners,
            weights: weights(&foot, [&a, &b, &c]),
            coefficient: triangle.friction,
            begins: true,
            ..*contact
        };
        Some((there, (there.at(now) - foot).norm_squared()))
    });
    let Some((there, apart)) = nearest.min_by(|(_, a), (_, b)| a.total_cmp(b)) else {
        return;
    };
    if apart > radius * radius {
        return;
    }
    let (at, same) = (there.at(now), ONE * radius);
    let mut others = contacts.iter_mut();
    if let Some(other) = others.find(|other| (other.at(now) - at).norm_squared() < same * same) {
        other.join(&there);
    } else {
        // There is room for all that were there.
        let _ = contacts.push(there);
    }
}

/// The contact at the nearest point of a triangle; `None` where the triangle is out of reach, or where another one at the same edge
/// is nearer.
fn touch(
    triangle: &Triangle,
    now: &Places<'_>,
    lengths: &Lengths,
    seed: &mut Seed,
) -> Option<Contact> {
    let corners = place(triangle.corners, now.sites)?;
    let [a, b, c] = corners.map(|corner| corner - now.centre);
    let corners = [&a, &b, &c];
    let most = lengths.radius + lengths.reach;
    let near = now.hull.nearest_within(most, corners, seed)?;
    let apart = near.point - combined([a, b, c], &near.weights);
    let outward = (b - a).cross(&(c - a));
    let beside = apart.cross(&outward).norm();
    let is_over = !near.are_apart || beside <= BORDER * apart.norm() * outward.norm();
    let mut contact = Contact {
        corners: triangle.corners,
        weights: near.weights,
        normal: Vec3::zeros(),
        normal_force: 0.0,
        friction: Vec3::zeros(),
        coefficient: triangle.friction,
        is_held: false,
        softness: [0.0; 2],
        begins: false,
        residual: Vec3::zeros(),
        before: Vec3::zeros(),
        allowed: 0.0,
        foot: Vec3::zeros(),
        tip: Vec3::zeros(),
        arm: Vec3::zeros(),
        distance: 0.0,
        has_passed: false,
        seed: *seed,
    };
    let is_found = contact.see(now, &near);
    (is_found && (is_over || contact.distance > 0.0)).then_some(contact)
}

/// The point of a triangle of these weights.
fn combined([a, b, c]: [Vec3; 3], [x, y, z]: &[f64; 3]) -> Vec3 {
    a * *x + b * *y + c * *z
}

/// The corners of a triangle.
fn place(corners: [u8; 3], sites: &[Vec3; MAX_SITES]) -> Option<[Vec3; 3]> {
    let [a, b, c] = corners.map(|corner| sites.get(usize::from(corner)));
    Some([*a?, *b?, *c?])
}

/// Adds a contact, if it is not the same point as another, and if there is room or a contact without force that is further away. In a list
/// full of points that press and roll on, a point that overlaps takes the place of the one that presses least.
fn insert(found: &mut Contacts, contact: Contact, softness: Softness, radius: f64) {
    let mut others = found.iter();
    if others.any(|other| other.stands_for(&contact, radius)) {
        return;
    }
    let mut idle = found.iter().filter(|other| !other.acts());
    if idle.nth(MOST_IDLE - 1).is_none() && found.push(contact).is_ok() {
        return;
    }
    let idle = found.iter_mut().filter(|other| !other.acts());
    let furthest = idle.max_by(|a, b| a.distance.total_cmp(&b.distance));
    if let Some(other) = furthest {
        if other.distance > contact.distance {
            *other = contact;
        }
        return;
    }
    let others = found.iter_mut().filter(|other| !other.is_held);
    let least = others.filter(|_| softness.rolls);
    let least = least.min_by(|a, b| a.normal_force.total_cmp(&b.normal_force));
    if let Some(other) = least.filter(|_| contact.distance < radius - CLEAR) {
        *other = contact;
    }
}

/// The compliance of contacts themselves. Where several points of a rigid plate lie on a rigid floor, it alone tells how they share force and
/// friction: without it they would take turns, and the plate would creep. Those that are held have a compliance of their own.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Softness {
    /// Along their normals and across (m/N).
    pub each: [f64; 2],
    /// Whether the points that press roll on under the tool. Where a surface yields, they stay.
    pub rolls: bool,
}

/// Whether each contact overlaps by no more than it may, and no contact that is held is further away.
pub(super) fn are_clear(contacts: &[Contact], radius: f64) -> bool {
    contacts.iter().all(|contact| {
        let [along, _] = contact.softness;
        let overlap = contact.allowed + contact.normal_force * along;
        let gap = contact.distance + overlap - radius;
        gap > -CLEAR && !(contact.is_held && gap >= CLEAR)
    })
}

/// Ends a tick at these places: notes what the sweeps left of the way of each contact that sticks. A tool has `turned` in the tick by this
/// difference of its attitudes, seen from the attitude at which the contacts were found.
pub(super) fn settle(contacts: &mut Contacts, now: &Places<'_>, turned: Option<Mat3>) {
    let most = most_friction(contacts, turned.is_some());
    for (contact, most) in contacts.iter_mut().zip(most) {
        let moved = now.centre - contact.at(now.sites) - contact.before + contact.residual;
        let way = turned.map_or(moved, |turned| moved + turned * contact.arm);
        let sticks = contact.friction.norm() < SLIDES * most;
        contact.residual = if sticks {
            contact.across(&way)
        } else {
            let [_, across] = contact.softness;
            contact.friction * -across
        };
    }
}
