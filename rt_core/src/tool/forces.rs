//! The forces of the contacts of a tool.
//!
//! Forces follow from the compliance `G` between the contacts: that of the surface, and that of the device's floor. Normal
//! forces are exact ([`super::normal`]). Friction ([`super::friction`]) is found between two exact solutions of the normal forces, so
//! that the tool overlaps nothing whatever friction leaves.

use super::contacts::{Contact, Contacts};
use super::friction::{Rubbing, let_go};
use super::normal::Normals;
use super::patch::Compliance;
use super::{MAX_CONTACTS, MAX_SITES};
use crate::geometry::{Mat3, Vec3};

/// Rounds of friction and normal forces.
const ROUNDS: usize = 2;
/// The fraction of the largest normal force below which a change of the forces ends the rounds.
const SETTLED: f64 = 1e-3;

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
    /// Whether no site yields.
    pub is_rigid: bool,
}

impl Yielding<'_> {
    /// The relative displacement of a contact by a moment about the centre of the tool (1/N).
    fn turned(&self, contact: &Contact) -> Mat3 {
        let turning = self.turning.as_ref();
        turning.map_or(Mat3::zeros(), |turning| {
            contact.arm.cross_matrix() * turning.floor
        })
    }

    /// `G` between two contacts: the relative displacement of the first one by a force at the second one (m/N). `turned` is that of the first
    /// one by a moment.
    fn between(&self, one: &Contact, turned: &Mat3, other: &Contact) -> Mat3 {
        let mut sum = *self.floor;
        if self.turning.is_some() {
            sum -= turned * other.arm.cross_matrix();
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
    pub(super) fn way(&self, contact: &Contact) -> Vec3 {
        let moved = self.apart(contact) - contact.before;
        (self.turning).map_or(moved, |turning| {
            moved + (turning.free - turning.before) * contact.arm
        })
    }
}

/// `G` between all pairs of contacts (m/N): row by row, up to the diagonal.
pub(super) struct Blocks(heapless::Vec<Mat3, { MAX_CONTACTS * (MAX_CONTACTS + 1) / 2 }>);

impl Blocks {
    const fn new() -> Self {
        Self(heapless::Vec::new())
    }

    fn fill(&mut self, contacts: &[Contact], yielding: &Yielding<'_>) {
        for (one, at) in contacts.iter().zip(0..MAX_CONTACTS) {
            let turned = yielding.turned(one);
            for (other, _) in contacts.iter().zip(0..=at) {
                // There is room for all pairs.
                let _ = self.0.push(yielding.between(one, &turned, other));
            }
        }
    }

    /// The relative displacement of the first contact by a force at the second one (m/N), which does not come after it.
    pub(super) fn get(&self, one: usize, other: usize) -> Mat3 {
        let before = one.saturating_mul(one.saturating_add(1)) / 2;
        let block = self.0.get(before.saturating_add(other));
        block.copied().unwrap_or_default()
    }
}

/// For each contact, its displacement (m) by a normal force of 1 N at each other one: `G n`. As `G` is symmetric, a row also tells the
/// displacement along a normal by a force: `n . G f = f . G n`.
pub(super) type Columns = [[Vec3; MAX_CONTACTS]; MAX_CONTACTS];

fn columns(contacts: &[Contact], blocks: &Blocks) -> Columns {
    let mut columns = [[Vec3::zeros(); MAX_CONTACTS]; MAX_CONTACTS];
    for (one, at) in contacts.iter().zip(0..MAX_CONTACTS) {
        let Some((above, from)) = columns.split_at_mut_checked(at) else {
            continue;
        };
        let Some(own) = from.first_mut() else {
            continue;
        };
        let others = contacts.iter().zip(0..MAX_CONTACTS);
        for ((row, entry), (other, from)) in above.iter_mut().zip(own.iter_mut()).zip(others) {
            let block = blocks.get(at, from);
            *entry = block * other.normal;
            if let Some(entry) = row.get_mut(at) {
                *entry = block.tr_mul(&one.normal);
            }
        }
        if let Some(entry) = own.get_mut(at) {
            *entry = blocks.get(at, at) * one.normal;
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
    fn new(contacts: &Contacts, blocks: &Blocks, yielding: &Yielding<'_>, radius: f64) -> Self {
        let columns = columns(contacts, blocks);
        let mut along = [[0.0; MAX_CONTACTS]; MAX_CONTACTS];
        let mut gaps = [0.0; MAX_CONTACTS];
        let mut pressed = [false; MAX_CONTACTS];
        let each = along.iter_mut().zip(&columns).zip(contacts);
        for (((along, columns), one), (gap, pressed)) in each.zip(gaps.iter_mut().zip(&mut pressed))
        {
            for ((entry, column), other) in along.iter_mut().zip(columns).zip(contacts) {
                *entry = one.normal.dot(column);
                if core::ptr::eq(one, other) {
                    let [along, _] = one.softness;
                    *entry += along;
                }
            }
            let apart = yielding.apart(one) + yielding.tip(one);
            *gap = one.normal.dot(&apart) - radius + one.allowed;
            *pressed = one.normal_force > 0.0;
        }
        let mut held = [false; MAX_CONTACTS];
        for (held, one) in held.iter_mut().zip(contacts) {
            *held = one.is_held;
        }
        Self {
            columns,
            gaps,
            normals: Normals::new(contacts.len(), &along, [&pressed, &held]),
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
            whole = whole.max(force.abs());
            contact.normal_force = force;
        }
        changed > SETTLED * whole
    }
}

/// Finds the forces of the contacts with a tool of a radius (m). Returns whether there is room for the tool.
pub(super) fn solve(contacts: &mut Contacts, yielding: &Yielding<'_>, radius: f64) -> bool {
    let mut blocks = Blocks::new();
    blocks.fill(contacts, yielding);
    let mut pressing = Pressing::new(contacts, &blocks, yielding, radius);
    pressing.press(contacts);
    let mut each = contacts.iter();
    if each.any(|contact| contact.is_held || contact.coefficient > 0.0) {
        let (mut rubbing, turns) = (Rubbing::new(), yielding.turning.is_some());
        for _ in 0..ROUNDS {
            let_go(contacts, turns);
            rubbing.rub(contacts, &blocks, &pressing.columns, yielding);
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
