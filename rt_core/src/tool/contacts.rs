//! The contacts of a tool with a patch: where they are, and their forces.
//!
//! The tool touches each triangle at the point that is nearest to its hull. A point on an edge or a corner belongs to several
//! triangles and counts once. A rounded tool thus rounds an edge by itself, without shading. A point that presses stays a contact until
//! its force is zero, also when another point of its triangle is nearer: where a tool is deep in a soft surface, the nearest
//! points move as the surface yields to them, and without the former points the iteration would not end. Where the hull itself
//! has passed a triangle, the contact presses its furthest corner back along the triangle's normal.
//!
//! Forces follow from the compliance `G` between the contacts: that of the surface, and that of the device's floor. Normal
//! forces are exact ([`super::normal`]). Friction is by block Gauss-Seidel sweeps on the disk of Coulomb's law, between two exact
//! solutions of the normal forces, so that the tool overlaps nothing whatever the sweeps leave. A contact that sticks keeps its
//! place on the material; what the sweeps leave of its way is carried to the next tick, so that nothing creeps.
//!
//! The points of a tool that turns have ways of their own. Each of them therefore has its own disk and a compliance of its own, by which
//! the corners of a rigid plate share their load, and conjugate gradients find the friction of those that stick. On a rigid surface
//! the points roll on under the tool.

use super::normal::Normals;
use super::patch::{Compliance, Triangle};
use super::{MAX_CONTACTS, MAX_SITES};
use crate::geometry::{Mat3, Vec3};
use crate::hull::Hull;
use crate::nearest::weights;

/// Rounds of sweeps and normal forces.
const ROUNDS: usize = 2;
/// Largest number of sweeps of friction in a round, the fraction of the largest friction below which a change ends them, and their
/// over-relaxation. Where few triangles press, two to four sweeps suffice.
const SWEEPS: usize = 8;
const SETTLED: f64 = 1e-3;
const BEYOND: f64 = 1.3;
/// Of a tool that turns: the rounds in which contacts beyond their cones begin to slide, the rounds of conjugate gradients in each, and
/// the fraction of their ways that these leave.
const STUCK: usize = 4;
const CONJUGATE: usize = 16;
const HELD: f64 = 1e-6;
/// Feet that are nearer to each other than this fraction of the radius are one contact: their distances differ by less than
/// 5 millionths of the radius.
const ONE: f64 = 3e-3;
/// An overlap (m) that no device renders: 0.3 mN at 3 kN/m.
const CLEAR: f64 = 1e-7;
/// Largest number of contacts that have not pressed yet: the nearest ones.
const MOST_IDLE: usize = MAX_CONTACTS / 2;
/// The sine of the angle to the normal of a triangle up to which the hull lies over the triangle or under it, not beside it.
const BORDER: f64 = 1e-6;
/// The fraction of the largest friction above which a contact slides: below it, sweeps that have not ended look the same.
const SLIDES: f64 = 1.0 - 1e-6;

/// A contact of the tool with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The triangle: its corners, as places in the list of sites.
    pub corners: [u8; 3],
    /// The weights of the corners at the foot.
    pub weights: [f64; 3],
    /// From the surface to the tool.
    pub normal: Vec3,
    /// The normal force (N).
    pub normal_force: f64,
    /// The force of friction on the tool (N).
    pub friction: Vec3,
    /// Coefficient of friction.
    pub coefficient: f64,
    /// The way across the normal that sticking should have undone (m).
    residual: Vec3,
    /// The centre seen from the foot, after the last tick (m).
    before: Vec3,
    /// The overlap that the contact may have at the end of this tick (m).
    allowed: f64,
    /// The foot, at the places that were looked at last (m).
    foot: Vec3,
    /// The point of the hull that is nearest to the foot, seen from the centre (m).
    tip: Vec3,
    /// The point of the tool that touches, seen from the centre (m): the arm of the force.
    arm: Vec3,
    /// The distance of the hull from the foot (m), negative if the hull has passed the triangle.
    distance: f64,
    /// Whether the hull has passed the triangle at the foot.
    has_passed: bool,
}

impl Contact {
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
        let Some([a, b, c]) = place(self.corners, now.sites) else {
            return false;
        };
        let outward = (b - a).cross(&(c - a));
        self.foot = self.at(now.sites);
        let near = now.hull.nearest_to(&(self.foot - now.centre));
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
        let near = now.hull.nearest_to(&(self.at(now.sites) - now.centre));
        if near.are_apart && !self.has_passed {
            self.weights = weights(&(now.centre + near.point), corners.each_ref());
        }
    }

    /// The distance between hull and foot at these places (m), negative on the other side of the surface. A hull that has passed the
    /// triangle parts along the normal, so its distance is along it.
    fn distance_at(&self, places: &Places<'_>) -> f64 {
        let foot = self.at(places.sites) - places.centre;
        let near = places.hull.nearest_to(&foot);
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
    fn at(&self, places: &[Vec3; MAX_SITES]) -> Vec3 {
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
    /// The largest distance of a corner of the hull from the centre.
    pub extent: f64,
    /// The way by which an overlap parts in a tick.
    pub parting: f64,
}

/// Finds the contacts of a tool with the triangles at the places `now`, in a tick that began at the places `before`: the points
/// of `kept` that press, and the nearest points of triangles.
pub(super) fn find<'a>(
    triangles: impl Iterator<Item = &'a Triangle>,
    [before, now]: [Places<'_>; 2],
    lengths: &Lengths,
    softness: Softness,
    kept: &[Contact],
) -> Contacts {
    let mut found = Contacts::new();
    for contact in kept.iter().filter(|contact| contact.normal_force > 0.0) {
        let mut contact = *contact;
        if softness.rolls {
            contact.roll(&now);
        }
        if contact.look(&now) {
            contact.friction = contact.across(&contact.friction);
            if !(softness.rolls && is_met(&mut found, &contact, lengths.radius)) {
                // There is room for all that were kept.
                let _ = found.push(contact);
            }
        }
    }
    hand_on(&mut found, kept);
    for triangle in triangles {
        if let Some(contact) = touch(triangle, &now, lengths)
            && contact.distance.abs() <= lengths.radius + lengths.reach
        {
            insert(&mut found, contact, softness, lengths.radius);
        }
    }
    for contact in &mut found {
        contact.before = before.centre - contact.at(before.sites);
        contact.arm = contact.tip - contact.normal * lengths.radius;
        let overlap = lengths.radius - contact.distance_at(&before);
        contact.allowed = (overlap - lengths.parting).max(0.0);
    }
    found
}

/// Adds the forces of a contact to another one to which it has rolled. Returns whether there is one.
fn is_met(found: &mut Contacts, contact: &Contact, radius: f64) -> bool {
    let same = ONE * radius;
    let mut others = found.iter_mut();
    let other = others.find(|other| (other.foot - contact.foot).norm_squared() < same * same);
    if let Some(other) = other {
        other.normal_force += contact.normal_force;
        other.friction += other.across(&contact.friction);
        return true;
    }
    false
}

/// Hands the friction of points that press no more to a point of the same triangle that does.
fn hand_on(found: &mut Contacts, kept: &[Contact]) {
    for old in kept.iter().filter(|old| old.normal_force == 0.0) {
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
        other.normal_force += there.normal_force;
        other.friction += other.across(&there.friction);
    } else {
        // There is room for all that were there.
        let _ = contacts.push(there);
    }
}

/// The contact at the nearest point of a triangle; `None` where the triangle is out of reach, or where another one at the same edge
/// is nearer.
fn touch(triangle: &Triangle, now: &Places<'_>, lengths: &Lengths) -> Option<Contact> {
    let corners = place(triangle.corners, now.sites)?;
    let [a, b, c] = corners.map(|corner| corner - now.centre);
    let corners = [&a, &b, &c];
    let centre = Hull::POINT.nearest(corners);
    let mut near = centre;
    if lengths.extent > 0.0 {
        let most = lengths.radius + lengths.reach + lengths.extent;
        if combined([a, b, c], &centre.weights).norm() > most {
            return None;
        }
        near = now.hull.nearest(corners);
    }
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
        residual: Vec3::zeros(),
        before: Vec3::zeros(),
        allowed: 0.0,
        foot: Vec3::zeros(),
        tip: Vec3::zeros(),
        arm: Vec3::zeros(),
        distance: 0.0,
        has_passed: false,
    };
    let is_found = contact.look(now);
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
    let (mut others, same) = (found.iter(), ONE * radius);
    if others.any(|other| (other.foot - contact.foot).norm_squared() < same * same) {
        return;
    }
    let mut idle = found.iter().filter(|other| other.normal_force == 0.0);
    if idle.nth(MOST_IDLE - 1).is_none() && found.push(contact).is_ok() {
        return;
    }
    let idle = found.iter_mut().filter(|other| other.normal_force == 0.0);
    let furthest = idle.max_by(|a, b| a.distance.total_cmp(&b.distance));
    if let Some(other) = furthest {
        if other.distance > contact.distance {
            *other = contact;
        }
        return;
    }
    let least = found.iter_mut().filter(|_| softness.rolls);
    let least = least.min_by(|a, b| a.normal_force.total_cmp(&b.normal_force));
    if let Some(other) = least.filter(|_| contact.distance < radius - CLEAR) {
        *other = contact;
    }
}

/// The compliance of a contact itself (m/N), along its normal and across. Where several points of a rigid plate lie on a rigid floor, it alone
/// tells how they share force and friction: without it they would take turns, and the plate would creep.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Softness {
    pub along: f64,
    pub across: f64,
    /// Whether the points that press roll on under the tool. Where a surface yields, they stay.
    pub rolls: bool,
}

/// How a tool turns in a tick, seen from the attitude at which its contacts were found last.
#[derive(Clone, Copy)]
pub(super) struct Turning<'a> {
    /// The attitude without contact forces.
    pub free: Mat3,
    /// The attitude after the last tick.
    pub before: Mat3,
    /// Of the device's floor (rad/(N m)).
    pub floor: &'a Mat3,
}

/// The tool and the surface without contact forces, and how they yield to them.
pub(super) struct Yielding<'a> {
    /// The centre of the tool (m).
    pub centre: Vec3,
    /// How the tool turns; `None` for a tool that keeps its attitude.
    pub turning: Option<Turning<'a>>,
    /// The sites (m).
    pub sites: &'a [Vec3; MAX_SITES],
    /// Of the sites (m/N), to be multiplied by `fraction`.
    pub compliance: &'a Compliance,
    /// See `compliance`.
    pub fraction: f64,
    /// Of the device's floor (m/N).
    pub floor: &'a Mat3,
    /// Of each contact.
    pub softness: Softness,
    /// Whether no site yields.
    pub is_rigid: bool,
}

impl Yielding<'_> {
    /// `G` between two contacts: the relative displacement of the first one by a force at the second one (m/N).
    fn between(&self, one: &Contact, other: &Contact) -> Mat3 {
        let mut sum = *self.floor;
        if let Some(turning) = &self.turning {
            let [to, from] = [one, other].map(|contact| contact.arm.cross_matrix());
            sum -= to * turning.floor * from;
        }
        if self.is_rigid {
            return sum;
        }
        for (a, weight) in one.corners.iter().zip(&one.weights) {
            let row = self.compliance.get(usize::from(*a));
            // Most feet lie on an edge or a corner.
            let Some(row) = row.filter(|_| *weight != 0.0) else {
                continue;
            };
            for (b, factor) in other.corners.iter().zip(&other.weights) {
                if *factor != 0.0
                    && let Some(block) = row.get(usize::from(*b))
                {
                    let part = weight * factor * self.fraction;
                    for (sum, entry) in sum.as_mut_slice().iter_mut().zip(block.as_slice()) {
                        *sum += entry * part;
                    }
                }
            }
        }
        sum
    }

    /// The centre of the tool seen from the foot of a contact, without contact forces (m).
    fn apart(&self, contact: &Contact) -> Vec3 {
        self.centre - contact.at(self.sites)
    }

    /// The point of the hull that is nearest to the foot of a contact, seen from the centre, without contact forces (m).
    fn tip(&self, contact: &Contact) -> Vec3 {
        (self.turning).map_or(contact.tip, |turning| turning.free * contact.tip)
    }

    /// The way of the tool over the foot of a contact since the last tick, without contact forces (m).
    fn way(&self, contact: &Contact) -> Vec3 {
        let moved = self.apart(contact) - contact.before;
        (self.turning).map_or(moved, |turning| {
            moved + (turning.free - turning.before) * contact.arm
        })
    }
}

/// For each contact, its displacement (m) by a normal force of 1 N at each other one: `G n`.
type Columns = [[Vec3; MAX_CONTACTS]; MAX_CONTACTS];

/// `G n`. As `G` is symmetric, a row also tells the displacement along a normal by a force: `n . G f = f . G n`.
fn columns(contacts: &Contacts, yielding: &Yielding<'_>) -> Columns {
    let mut columns = [[Vec3::zeros(); MAX_CONTACTS]; MAX_CONTACTS];
    for (one, at) in contacts.iter().zip(0..MAX_CONTACTS) {
        let Some((above, from)) = columns.split_at_mut_checked(at) else {
            continue;
        };
        let Some(own) = from.first_mut() else {
            continue;
        };
        for ((row, entry), other) in above.iter_mut().zip(own.iter_mut()).zip(contacts.iter()) {
            let block = yielding.between(one, other);
            *entry = block * other.normal;
            if let Some(entry) = row.get_mut(at) {
                *entry = block.transpose() * one.normal;
            }
        }
        if let Some(entry) = own.get_mut(at) {
            *entry = yielding.between(one, one) * one.normal;
        }
    }
    columns
}

/// The contacts along their normals.
struct Pressing {
    columns: Columns,
    /// The gaps without contact forces (m).
    gaps: [f64; MAX_CONTACTS],
    normals: Normals,
    /// Whether there is room for the tool.
    has_room: bool,
}

impl Pressing {
    fn new(contacts: &Contacts, yielding: &Yielding<'_>, radius: f64) -> Self {
        let columns = columns(contacts, yielding);
        let mut along = [[0.0; MAX_CONTACTS]; MAX_CONTACTS];
        let mut gaps = [0.0; MAX_CONTACTS];
        let mut pressed = [false; MAX_CONTACTS];
        let each = along.iter_mut().zip(&columns).zip(contacts);
        for (((along, columns), one), (gap, pressed)) in each.zip(gaps.iter_mut().zip(&mut pressed))
        {
            for ((entry, column), other) in along.iter_mut().zip(columns).zip(contacts) {
                *entry = one.normal.dot(column);
                if core::ptr::eq(one, other) {
                    *entry += yielding.softness.along;
                }
            }
            let apart = yielding.apart(one) + yielding.tip(one);
            *gap = one.normal.dot(&apart) - radius + one.allowed;
            *pressed = one.normal_force > 0.0;
        }
        Self {
            columns,
            gaps,
            normals: Normals::new(contacts.len(), &along, &pressed),
            has_room: true,
        }
    }

    /// Finds the normal forces, while friction stays. Returns whether they have changed.
    fn press(&mut self, contacts: &mut Contacts) -> bool {
        let mut gaps = self.gaps;
        for (contact, columns) in contacts.iter().zip(&self.columns) {
            if contact.friction != Vec3::zeros() {
                for ((gap, column), _) in gaps.iter_mut().zip(columns).zip(contacts.iter()) {
                    *gap += column.dot(&contact.friction);
                }
            }
        }
        self.has_room = self.normals.solve(gaps);
        let (mut changed, mut whole) = (0.0_f64, 0.0_f64);
        for (contact, force) in contacts.iter_mut().zip(self.normals.forces()) {
            changed = changed.max((force - contact.normal_force).abs());
            whole = whole.max(force);
            contact.normal_force = force;
        }
        changed > SETTLED * whole
    }
}

/// Finds the forces of the contacts with a tool of a radius (m). Returns whether there is room for the tool.
pub(super) fn solve(contacts: &mut Contacts, yielding: &Yielding<'_>, radius: f64) -> bool {
    let mut pressing = Pressing::new(contacts, yielding, radius);
    pressing.press(contacts);
    if contacts.iter().any(|contact| contact.coefficient > 0.0) {
        let (mut rubbing, turns) = (Rubbing::new(), yielding.turning.is_some());
        for _ in 0..ROUNDS {
            let_go(contacts, turns);
            rubbing.rub(contacts, &pressing.columns, yielding);
            if !pressing.press(contacts) {
                break;
            }
        }
        if let_go(contacts, turns) {
            pressing.press(contacts);
        }
    }
    pressing.has_room
}

/// Ends the friction without normal force. Returns whether there was any.
fn let_go(contacts: &mut Contacts, turns: bool) -> bool {
    let most = most_friction(contacts, turns);
    let mut was = false;
    for (contact, most) in contacts.iter_mut().zip(most) {
        if most == 0.0 && contact.friction != Vec3::zeros() {
            (contact.friction, was) = (Vec3::zeros(), true);
        }
    }
    was
}

/// The contacts across their normals: those that can have friction.
struct Rubbing {
    slides: heapless::Vec<Slide, MAX_CONTACTS>,
    /// For each, the displacement of each across its normal by a friction of 1 N: by the axes of the friction.
    blocks: [[[[f64; 2]; 2]; MAX_CONTACTS]; MAX_CONTACTS],
}

/// A contact in the sweeps of friction. Pairs of numbers are along the two axes.
#[derive(Clone, Copy, Debug)]
struct Slide {
    /// Its place in the list of contacts.
    at: usize,
    /// Two axes across its normal.
    axes: [Vec3; 2],
    /// The way of the tool at its foot, that sticking undoes (m): without contact forces, and now.
    free: [f64; 2],
    way: [f64; 2],
    /// The change of friction by the way (N/m).
    gain: f64,
    /// The friction, and the largest one (N).
    friction: [f64; 2],
    most: f64,
}

impl Rubbing {
    fn new() -> Self {
        Self {
            slides: heapless::Vec::new(),
            blocks: [[[[0.0; 2]; 2]; MAX_CONTACTS]; MAX_CONTACTS],
        }
    }

    /// Adds a contact.
    fn add(&mut self, at: usize, contacts: &[Contact], yielding: &Yielding<'_>) {
        let Some(contact) = contacts.get(at) else {
            return;
        };
        let axes = axes(&contact.normal);
        let way = yielding.way(contact) + contact.residual;
        let free = axes.map(|axis| axis.dot(&way));
        let new = Slide {
            at,
            axes,
            free,
            way: free,
            gain: 0.0,
            friction: axes.map(|axis| axis.dot(&contact.friction)),
            most: 0.0,
        };
        let number = self.slides.len();
        // There is room for all contacts.
        let _ = self.slides.push(new);
        for (other, to) in self.slides.iter_mut().zip(0..MAX_CONTACTS) {
            let Some(its) = contacts.get(other.at) else {
                continue;
            };
            let block = yielding.between(its, contact);
            let by_axis = axes.map(|axis| {
                let moved = block * axis;
                other.axes.map(|axis| axis.dot(&moved))
            });
            let [[mut a, b], [c, mut d]] = by_axis;
            if to == number {
                (a, d) = (a + yielding.softness.across, d + yielding.softness.across);
                // The largest eigenvalue.
                let half = 0.5 * (a - d);
                let stiffest = 0.5 * (a + d) + libm::sqrt((half * half + b * c).max(0.0));
                other.gain = if stiffest > 0.0 {
                    BEYOND / stiffest
                } else {
                    0.0
                };
            }
            let pairs = [
                (number, to, [[a, b], [c, d]]),
                (to, number, [[a, c], [b, d]]),
            ];
            for (from, to, block) in pairs {
                let row = self.blocks.get_mut(from);
                if let Some(place) = row.and_then(|row| row.get_mut(to)) {
                    *place = block;
                }
            }
        }
    }

    /// Sweeps of friction, while the normal forces stay. Only contacts that can have friction take part.
    fn rub(&mut self, contacts: &mut Contacts, columns: &Columns, yielding: &Yielding<'_>) {
        let most = most_friction(contacts, yielding.turning.is_some());
        for (at, most) in (0..contacts.len()).zip(most) {
            if most > 0.0 && !self.slides.iter().any(|slide| slide.at == at) {
                self.add(at, contacts, yielding);
            }
        }
        for slide in &mut self.slides {
            slide.most = most.get(slide.at).copied().unwrap_or_default();
            let mut pushed = Vec3::zeros();
            for (column, contact) in columns.get(slide.at).into_iter().flatten().zip(&*contacts) {
                pushed += column * contact.normal_force;
            }
            for ((way, free), axis) in slide.way.iter_mut().zip(&slide.free).zip(&slide.axes) {
                *way = free + axis.dot(&pushed);
            }
        }
        for (number, from) in (0..self.slides.len()).zip(&self.blocks) {
            if let Some(friction) = self.slides.get(number).map(|slide| slide.friction) {
                shift(&mut self.slides, from, friction);
            }
        }
        let turns = yielding.turning.is_some();
        if turns {
            self.stick();
        }
        self.sweep();
        if turns {
            self.stick();
        }
        for slide in &self.slides {
            if let Some(contact) = contacts.get_mut(slide.at) {
                let ([a, b], [x, y]) = (&slide.axes, slide.friction);
                contact.friction = a * x + b * y;
            }
        }
    }

    /// Finds the friction under which the contacts stick, before the sweeps. Points of a rigid tool on a rigid floor are so nearly dependent
    /// that sweeps alone would leave most of their way. A contact that would leave its cone slides.
    fn stick(&mut self) {
        let mut sticks = [true; MAX_CONTACTS];
        for (sticks, slide) in sticks.iter_mut().zip(&self.slides) {
            let [x, y] = slide.friction;
            *sticks = libm::sqrt(x * x + y * y) < SLIDES * slide.most;
        }
        for _ in 0..STUCK {
            self.hold(&sticks);
            if !self.slide(&mut sticks) {
                break;
            }
        }
    }

    /// Lets the contacts slide whose friction lies outside of their cones. Returns whether there were any.
    fn slide(&mut self, sticks: &mut [bool; MAX_CONTACTS]) -> bool {
        let mut any = false;
        let numbers = 0..self.slides.len();
        for ((number, from), sticks) in numbers.zip(&self.blocks).zip(sticks) {
            let Some(slide) = self.slides.get_mut(number) else {
                continue;
            };
            let [x, y] = slide.friction;
            let length = libm::sqrt(x * x + y * y);
            if length > slide.most {
                let part = slide.most / length;
                slide.friction = [x * part, y * part];
                shift(&mut self.slides, from, [x * (part - 1.0), y * (part - 1.0)]);
                (*sticks, any) = (false, true);
            }
        }
        any
    }

    /// Undoes the ways of the contacts that stick, while the friction of the others stays: conjugate gradients (Hestenes and Stiefel, 1952),
    /// which need one round for each independent motion, six for a rigid tool.
    fn hold(&mut self, sticks: &[bool; MAX_CONTACTS]) {
        let mut left = [[0.0; 2]; MAX_CONTACTS];
        for ((left, slide), sticks) in left.iter_mut().zip(&self.slides).zip(sticks) {
            if *sticks {
                *left = slide.way.map(|way| -way);
            }
        }
        let (mut direction, mut size) = (left, dot(&left, &left));
        let least = size * (HELD * HELD);
        for _ in 0..CONJUGATE {
            let moved = self.moved(&direction);
            let yields = dot(&direction, &moved);
            if size <= least || yields <= 0.0 {
                break;
            }
            let step = size / yields;
            let each = self.slides.iter_mut().zip(&direction).zip(&moved);
            for (((slide, direction), moved), (left, sticks)) in
                each.zip(left.iter_mut().zip(sticks))
            {
                let ([x, y], [along, across]) = (&mut slide.friction, &mut slide.way);
                let ([a, b], [c, d]) = (direction, moved);
                (*x, *y) = (*x + a * step, *y + b * step);
                (*along, *across) = (*along + c * step, *across + d * step);
                if *sticks {
                    *left = [-*along, -*across];
                }
            }
            let before = core::mem::replace(&mut size, dot(&left, &left));
            let again = size / before;
            for ([a, b], [x, y]) in direction.iter_mut().zip(&left) {
                (*a, *b) = (x + *a * again, y + *b * again);
            }
        }
    }

    /// The ways by these forces of friction.
    fn moved(&self, forces: &[[f64; 2]; MAX_CONTACTS]) -> [[f64; 2]; MAX_CONTACTS] {
        let mut moved = [[0.0; 2]; MAX_CONTACTS];
        for ((from, [x, y]), _) in self.blocks.iter().zip(forces).zip(&self.slides) {
            for ([along, across], [[a, b], [c, d]]) in moved.iter_mut().zip(from) {
                *along += a * x + c * y;
                *across += b * x + d * y;
            }
        }
        moved
    }

    fn sweep(&mut self) {
        let each = self.slides.iter();
        let whole = each.fold(0.0, |whole: f64, slide| whole.max(slide.most));
        for _ in 0..SWEEPS {
            let mut changed = 0.0_f64;
            for (number, from) in (0..self.slides.len()).zip(&self.blocks) {
                let Some(slide) = self.slides.get_mut(number) else {
                    continue;
                };
                let ([x, y], [along, across]) = (slide.friction, slide.way);
                let (mut aim, mut other) = (x - along * slide.gain, y - across * slide.gain);
                let length = libm::sqrt(aim * aim + other * other);
                if length > slide.most {
                    let part = slide.most / length;
                    (aim, other) = (aim * part, other * part);
                }
                slide.friction = [aim, other];
                let change = [aim - x, other - y];
                let [along, across] = change;
                changed = changed.max(along * along + across * across);
                shift(&mut self.slides, from, change);
            }
            if libm::sqrt(changed) <= SETTLED * whole {
                break;
            }
        }
    }
}

/// The sum of products.
fn dot(one: &[[f64; 2]; MAX_CONTACTS], other: &[[f64; 2]; MAX_CONTACTS]) -> f64 {
    let each = one.iter().flatten().zip(other.iter().flatten());
    each.fold(0.0, |sum, (a, b)| sum + a * b)
}

/// Moves contacts by a change of the friction to which these blocks belong.
fn shift(slides: &mut [Slide], from: &[[[f64; 2]; 2]; MAX_CONTACTS], [x, y]: [f64; 2]) {
    for (slide, [[a, b], [c, d]]) in slides.iter_mut().zip(from) {
        let [along, across] = &mut slide.way;
        *along += a * x + c * y;
        *across += b * x + d * y;
    }
}

/// Two axes across a normal, by T. Duff et al., "Building an orthonormal basis, revisited" (2017).
fn axes(normal: &Vec3) -> [Vec3; 2] {
    let (x, y, z) = (normal.x, normal.y, normal.z);
    let sign = 1.0_f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    [
        Vec3::new(1.0 + sign * x * x * a, sign * b, -sign * x),
        Vec3::new(b, sign + y * y * a, -y),
    ]
}

/// The largest friction of each contact (N). All points of a tool that keeps its attitude have the same way: the friction of the first one
/// on a triangle holds for all normal forces on the triangle. On a tool that turns, each has its own.
fn most_friction(contacts: &[Contact], turns: bool) -> [f64; MAX_CONTACTS] {
    let mut most = [0.0; MAX_CONTACTS];
    if turns {
        for (most, one) in most.iter_mut().zip(contacts) {
            *most = one.coefficient * one.normal_force;
        }
        return most;
    }
    for pressing in contacts.iter().filter(|one| one.normal_force > 0.0) {
        let each = most.iter_mut().zip(contacts);
        let mut first = each.filter(|(_, one)| one.corners == pressing.corners);
        if let Some((most, one)) = first.next() {
            *most += one.coefficient * pressing.normal_force;
        }
    }
    most
}

/// Whether each contact overlaps by no more than it may.
pub(super) fn are_clear(contacts: &[Contact], radius: f64, softness: Softness) -> bool {
    contacts.iter().all(|contact| {
        let overlap = contact.allowed + contact.normal_force * softness.along;
        contact.distance + overlap > radius - CLEAR
    })
}

/// Ends a tick at these places: notes what the sweeps left of the way of each contact that sticks. A tool has `turned` in the tick by this
/// difference of its attitudes, seen from the attitude at which the contacts were found.
pub(super) fn settle(
    contacts: &mut Contacts,
    now: &Places<'_>,
    turned: Option<Mat3>,
    softness: Softness,
) {
    let most = most_friction(contacts, turned.is_some());
    for (contact, most) in contacts.iter_mut().zip(most) {
        let moved = now.centre - contact.at(now.sites) - contact.before + contact.residual;
        let way = turned.map_or(moved, |turned| moved + turned * contact.arm);
        let sticks = contact.friction.norm() < SLIDES * most;
        contact.residual = if sticks {
            contact.across(&way)
        } else {
            contact.friction * -softness.across
        };
    }
}
