//! The contacts of a tool with a patch: where they are, and their forces.
//!
//! The sphere touches each triangle at the point that is nearest to its centre. A point on an edge or a corner belongs to several
//! triangles and counts once. The sphere thus rounds an edge by itself, without shading. A point that presses stays a contact until
//! its force is zero, also when another point of its triangle is nearer: where a sphere is deep in a soft surface, the nearest
//! points move as the surface yields to them, and without the former points the iteration would not end.
//!
//! Forces follow from the compliance `G` between the contacts: that of the surface, and that of the device's floor. Normal
//! forces are exact ([`super::normal`]). Friction is by block Gauss-Seidel sweeps on the disk of Coulomb's law, between two exact
//! solutions of the normal forces, so that the sphere overlaps nothing whatever the sweeps leave. A contact that sticks keeps its
//! place on the material; what the sweeps leave of its way is carried to the next tick, so that nothing creeps.

use super::nearest::weights;
use super::normal::Normals;
use super::patch::{Compliance, Triangle};
use super::{MAX_CONTACTS, MAX_SITES};
use crate::geometry::{Mat3, Vec3};

/// Rounds of sweeps and normal forces.
const ROUNDS: usize = 2;
/// Largest number of sweeps of friction in a round, the fraction of the largest friction below which a change ends them, and their
/// over-relaxation. Where few triangles press, two to four sweeps suffice.
const SWEEPS: usize = 16;
const SETTLED: f64 = 1e-4;
const BEYOND: f64 = 1.3;
/// Feet that are nearer to each other than this fraction of the radius are one contact: their distances differ by less than
/// 5 millionths of the radius.
const ONE: f64 = 3e-3;
/// An overlap (m) that no device renders: 0.3 mN at 3 kN/m.
const CLEAR: f64 = 1e-7;
/// Largest number of contacts that have not pressed yet: the nearest ones.
const MOST_IDLE: usize = MAX_CONTACTS / 2;
/// A weight below this is that of a corner on which the foot does not lie.
const BORDER: f64 = 1e-9;
/// The fraction of the largest friction above which a contact slides: below it, sweeps that have not ended look the same.
const SLIDES: f64 = 1.0 - 1e-6;

/// A contact of the sphere with a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The triangle: its corners, as places in the list of sites.
    pub corners: [u8; 3],
    /// The weights of the corners at the foot.
    pub weights: [f64; 3],
    /// From the surface to the centre of the sphere.
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
    distance: f64,
}

impl Contact {
    /// The force on the tool (N).
    pub fn force(&self) -> Vec3 {
        self.normal * self.normal_force + self.friction
    }

    /// Takes direction and distance at these places. Returns whether there is a direction: below the triangle, it is that of the
    /// triangle.
    fn look(&mut self, now: &Places<'_>) -> bool {
        let Some([a, b, c]) = place(self.corners, now.sites) else {
            return false;
        };
        let outward = (b - a).cross(&(c - a));
        let apart = now.centre - self.foot(now.sites);
        let length = apart.norm();
        let is_below = apart.dot(&outward) <= 0.0;
        self.distance = if is_below { -length } else { length };
        self.normal = if is_below {
            outward / outward.norm()
        } else {
            apart / length
        };
        self.normal.iter().all(|x| x.is_finite())
    }

    fn across(&self, v: &Vec3) -> Vec3 {
        v - self.normal * self.normal.dot(v)
    }

    /// The point at its foot, of places of the sites.
    fn foot(&self, places: &[Vec3; MAX_SITES]) -> Vec3 {
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

/// A sphere and the sites, at one time.
#[derive(Clone, Copy)]
pub(super) struct Places<'a> {
    pub centre: &'a Vec3,
    pub sites: &'a [Vec3; MAX_SITES],
}

/// The lengths by which contacts are found (m).
#[derive(Clone, Copy)]
pub(super) struct Lengths {
    /// Radius of the sphere.
    pub radius: f64,
    /// The distance beyond the radius within which contacts are found.
    pub reach: f64,
    /// The way by which an overlap parts in a tick.
    pub parting: f64,
}

/// Finds the contacts of a sphere with the triangles at the places `now`, in a tick that began at the places `before`: the points
/// of `kept` that press, and the nearest points of triangles.
pub(super) fn find<'a>(
    triangles: impl Iterator<Item = &'a Triangle>,
    [before, now]: [Places<'_>; 2],
    lengths: &Lengths,
    kept: &[Contact],
) -> Contacts {
    let mut found = Contacts::new();
    for contact in kept.iter().filter(|contact| contact.normal_force > 0.0) {
        let mut contact = *contact;
        if contact.look(&now) {
            contact.friction = contact.across(&contact.friction);
            // There is room for all that were kept.
            let _ = found.push(contact);
        }
    }
    hand_on(&mut found, kept);
    for triangle in triangles {
        if let Some(contact) = touch(triangle, &now)
            && contact.distance <= lengths.radius + lengths.reach
        {
            insert(&mut found, contact, now.sites, lengths.radius);
        }
    }
    for contact in &mut found {
        contact.before = before.centre - contact.foot(before.sites);
        let length = contact.before.norm();
        let is_behind = contact.before.dot(&contact.normal) < 0.0;
        let overlap = lengths.radius - if is_behind { -length } else { length };
        contact.allowed = (overlap - lengths.parting).max(0.0);
    }
    found
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

/// The contact at the nearest point of a triangle; `None` where another triangle at the same edge is nearer.
fn touch(triangle: &Triangle, now: &Places<'_>) -> Option<Contact> {
    let corners = place(triangle.corners, now.sites)?;
    let [a, b, c] = corners;
    let mut contact = Contact {
        corners: triangle.corners,
        weights: weights(now.centre, [&a, &b, &c]),
        normal: Vec3::zeros(),
        normal_force: 0.0,
        friction: Vec3::zeros(),
        coefficient: triangle.friction,
        residual: Vec3::zeros(),
        before: Vec3::zeros(),
        allowed: 0.0,
        distance: 0.0,
    };
    let is_inside = contact.weights.iter().all(|weight| *weight > BORDER);
    let is_found = contact.look(now);
    (is_found && (is_inside || contact.distance > 0.0)).then_some(contact)
}

/// The corners of a triangle.
fn place(corners: [u8; 3], sites: &[Vec3; MAX_SITES]) -> Option<[Vec3; 3]> {
    let [a, b, c] = corners.map(|corner| sites.get(usize::from(corner)));
    Some([*a?, *b?, *c?])
}

/// Adds a contact, if it is not the same point as another, and if there is room or a contact without force that is further away.
fn insert(found: &mut Contacts, contact: Contact, sites: &[Vec3; MAX_SITES], radius: f64) {
    let foot = contact.foot(sites);
    let mut others = found.iter();
    if others.any(|other| (other.foot(sites) - foot).norm() < ONE * radius) {
        return;
    }
    let mut idle = found.iter().filter(|other| other.normal_force == 0.0);
    if idle.nth(MOST_IDLE - 1).is_none() && found.push(contact).is_ok() {
        return;
    }
    let idle = found.iter_mut().filter(|other| other.normal_force == 0.0);
    let furthest = idle.max_by(|a, b| a.distance.total_cmp(&b.distance));
    if let Some(other) = furthest.filter(|other| other.distance > contact.distance) {
        *other = contact;
    }
}

/// The tool and the surface without contact forces, and how they yield to them.
pub(super) struct Yielding<'a> {
    /// The centre of the sphere (m).
    pub centre: Vec3,
    /// The sites (m).
    pub sites: &'a [Vec3; MAX_SITES],
    /// Of the sites (m/N), to be multiplied by `fraction`.
    pub compliance: &'a Compliance,
    /// See `compliance`.
    pub fraction: f64,
    /// Of the device's floor (m/N).
    pub floor: &'a Mat3,
}

impl Yielding<'_> {
    /// The relative displacement of two contacts, of the first one by a force at the second one (m/N).
    fn between(&self, one: &Contact, other: &Contact) -> Mat3 {
        let mut sum = Mat3::zeros();
        for (a, weight) in one.corners.iter().zip(&one.weights) {
            let Some(row) = self.compliance.get(usize::from(*a)) else {
                continue;
            };
            for (b, factor) in other.corners.iter().zip(&other.weights) {
                if let Some(block) = row.get(usize::from(*b)) {
                    sum += block * (weight * factor);
                }
            }
        }
        sum * self.fraction + self.floor
    }
}

/// The blocks of `G` between the contacts.
type Blocks = [[Mat3; MAX_CONTACTS]; MAX_CONTACTS];

/// Finds the forces of the contacts with a sphere of a radius (m). Returns whether there is room for the sphere.
pub(super) fn solve(contacts: &mut Contacts, yielding: &Yielding<'_>, radius: f64) -> bool {
    let blocks = blocks(contacts, yielding);
    let mut free = [Vec3::zeros(); MAX_CONTACTS];
    let mut along = [[0.0; MAX_CONTACTS]; MAX_CONTACTS];
    let each = contacts.iter().zip(&blocks).zip(&mut free);
    for (((contact, blocks), free), row) in each.zip(&mut along) {
        *free = yielding.centre - contact.foot(yielding.sites);
        for ((entry, block), other) in row.iter_mut().zip(blocks).zip(contacts.iter()) {
            *entry = contact.normal.dot(&(block * other.normal));
        }
    }
    let mut has_room = press(contacts, &blocks, &along, &free, radius);
    if contacts.iter().any(|contact| contact.coefficient > 0.0) {
        for _ in 0..ROUNDS {
            let_go(contacts);
            rub(contacts, &blocks, &free);
            has_room = press(contacts, &blocks, &along, &free, radius);
        }
        if let_go(contacts) {
            has_room = press(contacts, &blocks, &along, &free, radius);
        }
    }
    has_room
}

/// `G` between the contacts.
#[expect(
    clippy::large_stack_arrays,
    reason = "18 kB, which the stack of the tick's thread has"
)]
fn blocks(contacts: &Contacts, yielding: &Yielding<'_>) -> Blocks {
    let mut blocks = [[Mat3::zeros(); MAX_CONTACTS]; MAX_CONTACTS];
    for ((row, one), from) in blocks.iter_mut().zip(contacts.iter()).zip(0..MAX_CONTACTS) {
        for (block, other) in row.iter_mut().zip(contacts.iter()).skip(from) {
            *block = yielding.between(one, other);
        }
    }
    mirror(&mut blocks, contacts.len());
    blocks
}

/// Ends the friction of triangles without normal force. Returns whether there was any.
fn let_go(contacts: &mut Contacts) -> bool {
    let most = most_friction(contacts);
    let mut was = false;
    for (contact, most) in contacts.iter_mut().zip(most) {
        if most == 0.0 && contact.friction != Vec3::zeros() {
            (contact.friction, was) = (Vec3::zeros(), true);
        }
    }
    was
}

/// Completes a symmetric matrix of blocks by its upper half.
fn mirror(blocks: &mut Blocks, count: usize) {
    for at in 0..count {
        let Some((above, from)) = blocks.split_at_mut_checked(at) else {
            continue;
        };
        let Some(row) = from.first_mut() else {
            continue;
        };
        for (block, other) in row.iter_mut().zip(above) {
            *block = other.get(at).map_or(Mat3::zeros(), Mat3::transpose);
        }
    }
}

/// The displacement at a contact by forces at all of them.
fn response<'a>(row: &[Mat3; MAX_CONTACTS], forces: impl Iterator<Item = Vec3> + 'a) -> Vec3 {
    let each = row.iter().zip(forces);
    each.fold(Vec3::zeros(), |sum, (block, force)| sum + block * force)
}

/// The normal forces, while friction stays. `along` is `G` along the normals.
fn press(
    contacts: &mut Contacts,
    blocks: &Blocks,
    along: &[[f64; MAX_CONTACTS]; MAX_CONTACTS],
    free: &[Vec3; MAX_CONTACTS],
    radius: f64,
) -> bool {
    let mut gaps = [0.0; MAX_CONTACTS];
    let mut pressed = [false; MAX_CONTACTS];
    let each = blocks.iter().zip(free).zip(contacts.iter());
    for (((blocks, free), contact), (gap, pressed)) in each.zip(gaps.iter_mut().zip(&mut pressed)) {
        let apart = free + response(blocks, contacts.iter().map(|contact| contact.friction));
        *gap = contact.normal.dot(&apart) - radius + contact.allowed;
        *pressed = contact.normal_force > 0.0;
    }
    let mut normals = Normals::new(contacts.len(), along, gaps, pressed);
    let has_room = normals.solve();
    for (contact, force) in contacts.iter_mut().zip(normals.forces()) {
        contact.normal_force = force;
    }
    has_room
}

/// Sweeps of friction, while the normal forces stay. Only contacts that can have friction take part.
fn rub(contacts: &mut Contacts, blocks: &Blocks, free: &[Vec3; MAX_CONTACTS]) {
    let most = most_friction(contacts);
    let mut slides = heapless::Vec::<Slide, MAX_CONTACTS>::new();
    let each = blocks.iter().zip(free).zip(contacts.iter()).zip(most);
    for ((((blocks, free), contact), most), at) in each.zip(0..MAX_CONTACTS) {
        let own = blocks.get(at).map(|own| stiffest(own, &contact.normal));
        if most > 0.0
            && let Some(own) = own
        {
            let apart = free + response(blocks, contacts.iter().map(Contact::force));
            // There is room for all contacts.
            let _ = slides.push(Slide {
                at,
                way: apart - contact.before + contact.residual,
                gain: BEYOND / own,
                most,
            });
        }
    }
    let whole = most.iter().fold(0.0, |whole: f64, one| whole.max(*one));
    for _ in 0..SWEEPS {
        let mut changed = 0.0_f64;
        for number in 0..slides.len() {
            let Some(slide) = slides.get(number).copied() else {
                continue;
            };
            let Some(contact) = contacts.get_mut(slide.at) else {
                continue;
            };
            let aim = contact.friction - contact.across(&slide.way) * slide.gain;
            let length = aim.norm();
            let friction = if length > slide.most {
                aim * (slide.most / length)
            } else {
                aim
            };
            let change = friction - contact.friction;
            contact.friction = friction;
            changed = changed.max(change.norm());
            for other in &mut slides {
                let row = blocks.get(other.at);
                if let Some(block) = row.and_then(|row| row.get(slide.at)) {
                    other.way += block * change;
                }
            }
        }
        if changed <= SETTLED * whole {
            break;
        }
    }
}

/// A contact in the sweeps of friction.
#[derive(Clone, Copy, Debug)]
struct Slide {
    /// Its place in the list of contacts.
    at: usize,
    /// The way of the tool at its foot, that sticking undoes (m).
    way: Vec3,
    /// The change of friction by the way (N/m).
    gain: f64,
    /// The largest friction (N).
    most: f64,
}

/// The largest friction of each contact (N): that of the first one on a triangle holds for all normal forces on the triangle.
fn most_friction(contacts: &[Contact]) -> [f64; MAX_CONTACTS] {
    let mut most = [0.0; MAX_CONTACTS];
    for ((most, one), at) in most.iter_mut().zip(contacts).zip(0..MAX_CONTACTS) {
        let same = |other: &&Contact| other.corners == one.corners;
        if !contacts.iter().take(at).any(|other| same(&other)) {
            let forces = contacts.iter().filter(same).map(|other| other.normal_force);
            *most = one.coefficient * forces.fold(0.0, |sum, force| sum + force);
        }
    }
    most
}

/// The largest eigenvalue of a symmetric block across a normal.
fn stiffest(block: &Mat3, normal: &Vec3) -> f64 {
    let along = block * normal;
    let own = normal.dot(&along);
    // The trace of the part across, and that of its square.
    let trace = block.trace() - own;
    let square = block.norm_squared() - 2.0 * along.norm_squared() + own * own;
    0.5 * (trace + libm::sqrt((2.0 * square - trace * trace).max(0.0)))
}

/// Whether each contact overlaps by no more than it may.
pub(super) fn are_clear(contacts: &[Contact], radius: f64) -> bool {
    contacts
        .iter()
        .all(|contact| contact.distance + contact.allowed > radius - CLEAR)
}

/// Ends a tick at these places: notes what the sweeps left of the way of each contact that sticks.
pub(super) fn settle(contacts: &mut Contacts, now: &Places<'_>) {
    let most = most_friction(contacts);
    for (contact, most) in contacts.iter_mut().zip(most) {
        let way = now.centre - contact.foot(now.sites) - contact.before + contact.residual;
        let sticks = contact.friction.norm() < SLIDES * most;
        contact.residual = if sticks {
            contact.across(&way)
        } else {
            Vec3::zeros()
        };
    }
}
