//! What the contacts of a step are for the local models that follow it.
//!
//! Between two publications the contacts of the last step hold a body: along the normal by a stiff spring, because the
//! multiplier is carried, across it by the friction spring of the step. A contact at its largest force does not hold along the
//! normal. The bodies that touch a body respond by themselves, so that a spring joins the nodes of all of them.

use super::{Contacts, MOST_BODIES, Member, Need, RIGID};
use crate::contact::{Contact, Rows};
use crate::element::precision::Precision;
use crate::motion::joined::{At, Workspace};
use crate::motion::touching::Touch;
use crate::{Mat3, Vec3};

/// A look ahead goes this many times as far as a model lasts: it ends after the next model has come.
const FURTHER: f64 = 1.25;

/// A contact as a spring on the sum of the displacements of nodes, by weights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// The sides of the first and of the second foot, as numbers of [`Contacts::sides`].
    pub sides: [usize; 2],
    /// The nodes and their weights. A weight of zero has no node.
    pub nodes: [(At, f64); 4],
    /// From the second foot to the first one; of length one.
    pub normal: Vec3,
    /// The normal force (N).
    pub pressed: f64,
    /// Stiffness (N/m), symmetric and positive semidefinite.
    pub stiffness: Mat3,
    /// The velocity of the obstacle's material point (m/s); zero between bodies.
    pub carried: Vec3,
    /// The time in which the contact closes (s); zero if it holds.
    pub closes: f64,
    /// The time from then to the end of the look ahead (s).
    pub lasts: f64,
    /// The island.
    root: usize,
}

impl Spring {
    /// The weighted sum of vectors `of` nodes.
    pub fn difference(&self, of: &dyn Fn(At) -> Vec3) -> Vec3 {
        self.taken().map(|(at, weight)| of(at) * weight).sum()
    }

    /// Calls `add` with the part of a `force` on the first foot that each node takes (N).
    pub fn add(&self, force: &Vec3, add: &mut dyn FnMut(At, Vec3)) {
        for (at, weight) in self.taken() {
            add(at, force * weight);
        }
    }

    /// The sides in ascending order.
    pub fn sorted(&self) -> [usize; 2] {
        let [one, other] = self.sides;
        [one.min(other), one.max(other)]
    }

    /// Whether one foot is on the body and the other one is not.
    pub fn leaves(&self, body: usize) -> bool {
        let own = || self.taken().filter(|(at, _)| at.body == body);
        let [first, second] = [1.0, -1.0].map(|sign| own().any(|(_, weight)| weight * sign > 0.0));
        first != second
    }

    fn taken(&self) -> impl Iterator<Item = (At, f64)> {
        self.nodes.into_iter().filter(|(_, weight)| *weight != 0.0)
    }
}

/// What a look ahead needs beside the contacts of a step.
#[derive(Debug)]
pub(super) struct Foreseen {
    pub(super) rows: Rows,
    pub(super) x: Vec<Vec3>,
    pub(super) u: Vec<Vec3>,
    pub(super) v: Vec<Vec3>,
}

impl Contacts {
    /// Makes the springs of the contacts of the last step. Called before the models are made.
    pub fn hold(&mut self) {
        let mut springs = core::mem::take(&mut self.springs);
        springs.clear();
        for root in 0..MOST_BODIES {
            let touches = self.touches.iter().zip(&self.of_row);
            for (touch, row) in touches.filter(|(touch, _)| touch.response.acts()) {
                let mut nodes = touch.nodes.iter().filter(|(_, weight)| *weight != 0.0);
                let body = nodes.next().map(|(at, _)| at.body);
                if body.is_some_and(|body| self.islands.root(body) == root) {
                    let contact = &self.rows.contacts()[*row];
                    springs.push(Spring {
                        carried: touch.row.motion / self.h,
                        ..spring(touch, contact.parts, root)
                    });
                }
            }
        }
        self.springs = springs;
    }

    /// Adds the contacts that close while a model lasts, `horizon` seconds, if all goes on at its velocity. Called after
    /// [`hold`](Self::hold).
    pub fn foresee<T: Precision>(&mut self, members: &[Member<'_, T>], horizon: f64) {
        let period = FURTHER * horizon;
        let is_idle = self.need == Need::Nothing
            || self.clearance.is_enough_for(period / self.h)
            || !members.iter().any(Member::is_awake)
            || members.iter().all(|member| member.body.handle_count() == 0);
        if is_idle {
            return;
        }
        // The next step finds its own rows.
        let (times, h, began) = (self.times, self.h, self.began);
        self.swap_foreseen();
        (self.times, self.h) = ([times[1], times[1] + period], period);
        self.gather(members);
        for (u, v) in self.u.iter_mut().zip(&self.v) {
            *u = v * period;
        }
        self.find(period);
        self.swap_foreseen();
        (self.times, self.h, self.began) = (times, h, began);
        let mut springs = core::mem::take(&mut self.springs);
        let held = springs.len();
        for contact in self.foreseen.rows.contacts() {
            let (now, then) = (contact.row.gap, contact.predicted);
            let nodes = self.nodes(contact);
            let bodies = || nodes.iter().filter(|(_, weight)| *weight != 0.0);
            let closes = now > 0.0 && then < 0.0 && !self.rows.holds(contact.key);
            if let (true, Some((first, _))) = (closes, bodies().next()) {
                for (at, _) in bodies() {
                    self.islands.join(first.body, at.body);
                }
                let closes = period * now / (now - then);
                springs.push(closing(contact, nodes, [closes, period - closes]));
            }
        }
        if springs.len() > held {
            for spring in &mut springs {
                let first = spring.taken().next();
                spring.root = first.map_or(0, |(at, _)| self.islands.root(at.body));
            }
            springs.sort_unstable_by(|a, b| {
                let by_root = a.root.cmp(&b.root);
                by_root.then(a.closes.total_cmp(&b.closes))
            });
        }
        self.springs = springs;
    }

    fn swap_foreseen(&mut self) {
        let Foreseen { rows, x, u, v } = &mut self.foreseen;
        core::mem::swap(&mut self.rows, rows);
        core::mem::swap(&mut self.x, x);
        core::mem::swap(&mut self.u, u);
        core::mem::swap(&mut self.v, v);
    }

    /// The springs of the bodies that share contacts with the body of this number; these and those of the contacts that come;
    /// and room for their solver.
    pub fn held(&mut self, body: usize) -> ([&[Spring]; 2], &mut Workspace) {
        let root = self.islands.root(body);
        let from = self.springs.partition_point(|spring| spring.root < root);
        let to = self.springs.partition_point(|spring| spring.root <= root);
        let springs = &self.springs[from..to];
        let holds = springs.partition_point(|spring| spring.closes == 0.0);
        ([&springs[..holds], springs], &mut self.room)
    }

    /// Whether two bodies are of one island.
    pub fn share(&self, one: usize, other: usize) -> bool {
        self.islands.root(one) == self.islands.root(other)
    }
}

/// A contact that closes in some seconds and lasts for some, as if it held and stuck.
fn closing(contact: &Contact, nodes: [(At, f64); 4], [closes, lasts]: [f64; 2]) -> Spring {
    let row = &contact.row;
    let along: Mat3 = row.normal * row.normal.transpose();
    let held = if row.friction > 0.0 {
        Mat3::identity()
    } else {
        along
    };
    let stiffness = held * (row.normal_stiffness * RIGID);
    Spring {
        sides: contact.parts,
        nodes,
        normal: row.normal,
        pressed: 0.0,
        stiffness,
        carried: Vec3::zeros(),
        closes,
        lasts,
        root: 0,
    }
}

fn spring(touch: &Touch, sides: [usize; 2], root: usize) -> Spring {
    let row = &touch.row;
    let tangent = row.tangent(&touch.response);
    // The largest force of a contact is the same at every depth.
    let along = row.normal.dot(&(tangent * row.normal));
    let rigid = row.normal * row.normal.transpose() * (along * (RIGID - 1.0));
    Spring {
        sides,
        nodes: touch.nodes,
        normal: row.normal,
        pressed: touch.response.normal,
        stiffness: tangent + rigid,
        carried: Vec3::zeros(),
        closes: 0.0,
        lasts: 0.0,
        root,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::row::Row;

    #[test]
    fn a_contact_at_its_largest_force_holds_across_the_normal_alone() {
        let row = Row {
            normal: Vec3::z(),
            gap: 0.0,
            motion: Vec3::zeros(),
            friction: 1.0,
            depth: 0.0,
            normal_stiffness: 10.0,
            friction_stiffness: 5.0,
            carried: 1.0,
            most: 2.0,
            anchored: Vec3::zeros(),
            is_held: false,
        };
        let node = At { body: 0, node: 0 };
        for (depth, along) in [(0.05, 10.0 * RIGID), (0.2, 0.0)] {
            let mut touch = Touch::new([(node, 1.0), (node, 0.0), (node, 0.0), (node, 0.0)], row);
            touch.response = row.response(&Vec3::new(0.0, 0.0, -depth));
            let found = spring(&touch, [0, 1], 0).stiffness;
            let expected = Mat3::from_diagonal(&Vec3::new(5.0, 5.0, along));
            assert!((found - expected).norm() < 1e-12 * RIGID * 10.0, "{found}");
        }
    }
}
