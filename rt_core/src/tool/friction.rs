//! Friction of the contacts of a tool: block Gauss-Seidel sweeps on the disk of Coulomb's law.
//!
//! A contact that sticks keeps its place on the material; what the sweeps leave of its way is carried to the next tick, so that nothing
//! creeps.
//!
//! The points of a tool that turns have ways of their own. Each of them therefore has its own disk and a compliance of its own, by which
//! the corners of a rigid plate share their load, and conjugate gradients find the friction of those that stick. They also find that of
//! contacts that are held, which has no bound.

use super::MAX_CONTACTS;
use super::contacts::{Contact, Contacts};
use super::forces::{Blocks, Columns, Yielding};
use crate::geometry::Vec3;

/// Largest number of sweeps of friction in a round, the fraction of the largest friction below which a change ends them, and their
/// over-relaxation. Where few triangles press, two to four sweeps suffice.
const SWEEPS: usize = 8;
const SETTLED: f64 = 1e-3;
const BEYOND: f64 = 1.3;
/// Of a tool that turns: the rounds in which contacts beyond their cones begin to slide, the rounds of conjugate gradients in each, and
/// the fraction that these leave of the ways without friction.
const STUCK: usize = 4;
const CONJUGATE: usize = 16;
const HELD: f64 = 1e-6;
/// The largest friction (N) of a contact that is held.
const UNBOUNDED: f64 = f64::MAX;
/// The fraction of the largest friction above which a contact slides: below it, sweeps that have not ended look the same.
pub(super) const SLIDES: f64 = 1.0 - 1e-6;

/// Ends the friction without normal force. Returns whether there was any.
pub(super) fn let_go(contacts: &mut Contacts, turns: bool) -> bool {
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
pub(super) struct Rubbing {
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
    pub(super) fn new() -> Self {
        Self {
            slides: heapless::Vec::new(),
            blocks: [[[[0.0; 2]; 2]; MAX_CONTACTS]; MAX_CONTACTS],
        }
    }

    /// Adds a contact.
    fn add(&mut self, at: usize, contacts: &[Contact], blocks: &Blocks, yielding: &Yielding<'_>) {
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
            // Contacts may join in any order.
            let block = if other.at >= at {
                blocks.get(other.at, at)
            } else {
                blocks.get(at, other.at).transpose()
            };
            let by_axis = axes.map(|axis| {
                let moved = block * axis;
                other.axes.map(|axis| axis.dot(&moved))
            });
            let [[mut a, b], [c, mut d]] = by_axis;
            if to == number {
                let [_, across] = contact.softness;
                (a, d) = (a + across, d + across);
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
    pub(super) fn rub(
        &mut self,
        contacts: &mut Contacts,
        blocks: &Blocks,
        columns: &Columns,
        yielding: &Yielding<'_>,
    ) {
        let most = most_friction(contacts, yielding.turning.is_some());
        for (at, most) in (0..contacts.len()).zip(most) {
            if most > 0.0 && !self.slides.iter().any(|slide| slide.at == at) {
                self.add(at, contacts, blocks, yielding);
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
        let is_exact =
            yielding.turning.is_some() || self.slides.iter().any(|slide| slide.most == UNBOUNDED);
        self.sweep();
        if is_exact {
            self.stick();
        }
        for slide in &self.slides {
            if let Some(contact) = contacts.get_mut(slide.at) {
                let ([a, b], [x, y]) = (&slide.axes, slide.friction);
                contact.friction = a * x + b * y;
            }
        }
    }

    /// Finds the friction under which the contacts stick, after the sweeps. Points of a rigid tool on a rigid floor are so nearly dependent
    /// that sweeps alone leave most of their way. A contact that would leave its cone slides.
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
        let free = self.slides.iter().flat_map(|slide| slide.free);
        let least = free.fold(0.0, |sum, way| sum + way * way) * (HELD * HELD);
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
            let each = moved.iter_mut().zip(from).zip(&self.slides);
            for (([along, across], [[a, b], [c, d]]), _) in each {
                *along += a * x + c * y;
                *across += b * x + d * y;
            }
        }
        moved
    }

    fn sweep(&mut self) {
        let each = self.slides.iter();
        let whole = each.fold(0.0, |whole: f64, slide| whole.max(slide.scale()));
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

impl Slide {
    /// By what changes of the friction are measured (N): the largest friction, or the present one of a contact that is held.
    fn scale(&self) -> f64 {
        if self.most == UNBOUNDED {
            let [x, y] = self.friction;
            libm::sqrt(x * x + y * y)
        } else {
            self.most
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
/// on a triangle holds for all normal forces on the triangle. On a tool that turns, each has its own. That of a contact that is held has no
/// bound.
pub(super) fn most_friction(contacts: &[Contact], turns: bool) -> [f64; MAX_CONTACTS] {
    let mut most = [0.0; MAX_CONTACTS];
    for (most, one) in most.iter_mut().zip(contacts) {
        if one.is_held {
            *most = UNBOUNDED;
        } else if turns {
            *most = one.coefficient * one.normal_force;
        }
    }
    let pressing = contacts.iter().filter(|one| one.normal_force > 0.0);
    for pressing in pressing.filter(|one| !(turns || one.is_held)) {
        let each = most.iter_mut().zip(contacts);
        let mut first = each.filter(|(_, one)| one.corners == pressing.corners);
        if let Some((most, one)) = first.next() {
            *most += one.coefficient * pressing.normal_force;
        }
    }
    most
}
