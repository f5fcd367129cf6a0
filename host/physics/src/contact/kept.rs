//! What a contact keeps from step to step: its forces, and the direction in which they acted.
//!
//! A contact of a vertex is known by the vertex and the other part, so that its forces follow the foot from triangle to
//! triangle. If a vertex has several contacts with a part, the direction tells them apart. A contact of edges is known by
//! their vertices.

use super::between::Between;
use crate::Vec3;

/// The least product of the directions of a contact in two steps that follow each other.
const TURNED: f64 = 0.5;

/// Whether a contact that has one direction, of length one, may have the other one next.
pub(super) fn is_same(one: &Vec3, other: &Vec3) -> bool {
    one.dot(other) > TURNED
}

/// By what a contact is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Key {
    /// A vertex and the other part, or the number of parts and that of the obstacle in sum.
    Vertex(u32, u32),
    /// A point between vertices, and the other side as above.
    Between(Between, u32),
    /// The vertices of two edges: each edge ascending, the smaller edge first.
    Edges([u32; 4]),
}

impl Key {
    /// The key after vertices have got the numbers that `number` gives; `None` if one is no longer there.
    pub(super) fn renumbered(self, number: &dyn Fn(u32) -> Option<u32>) -> Option<Self> {
        Some(match self {
            Self::Vertex(vertex, part) => Self::Vertex(number(vertex)?, part),
            Self::Between(point, part) => Self::Between(point.renumbered(number)?, part),
            Self::Edges([a, b, c, d]) => {
                let edge = |a, b| {
                    let [a, b] = [number(a)?, number(b)?];
                    Some([a.min(b), a.max(b)])
                };
                let [one, other] = [edge(a, b)?, edge(c, d)?];
                let [[a, b], [c, d]] = [one.min(other), one.max(other)];
                Self::Edges([a, b, c, d])
            }
        })
    }
}

/// The state of a contact after a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kept {
    pub key: Key,
    pub normal: Vec3,
    /// The normal forces of the last two steps (N), the latest first.
    pub forces: [f64; 2],
    /// The speed at which the contact opened (m/s).
    pub opening: f64,
    /// The friction force (N).
    pub friction: Vec3,
    /// The stiffness of its spring (N/m).
    pub stiffness: f64,
    /// The stiffness along the normal that the contact took within a step (N/m); zero if it has taken none.
    pub stiffened: f64,
    /// The part of the overlap that the motion of an obstacle made (m).
    pub overrun: f64,
    /// Steps since the contact was found.
    pub age: u32,
    /// Whether the contact began with an overlap that has not parted.
    pub is_parting: bool,
    /// Where a shape holds the first foot (m, axes of the shape); `None` for a contact that is not held.
    pub anchor: Option<Vec3>,
    /// Whether a contact of the present step has taken the state.
    pub is_taken: bool,
}

impl Kept {
    /// The friction force (N), turned to a plane across `normal`: projected, and kept in size.
    pub(super) fn friction_across(&self, normal: &Vec3) -> Vec3 {
        let across = self.friction - normal * normal.dot(&self.friction);
        let length = across.norm();
        if length > 0.0 {
            across * (self.friction.norm() / length)
        } else {
            Vec3::zeros()
        }
    }

    /// Whether the contact had a force.
    pub(super) fn acted(&self) -> bool {
        self.forces[0] != 0.0
    }

    /// The energy (J) in the spring.
    pub(super) fn stored(&self) -> f64 {
        self.friction.norm_squared() / (2.0 * self.stiffness)
    }
}

/// Takes the state of a contact that pushes along `normal` from `kept`, which is ascending by key. `from` is where the search
/// begins, and is moved to the key: contacts are asked for in the order of their keys.
pub(super) fn take(kept: &mut [Kept], from: &mut usize, key: Key, normal: &Vec3) -> Option<Kept> {
    while kept.get(*from).is_some_and(|state| state.key < key) {
        *from += 1;
    }
    let group = kept[*from..].iter_mut();
    let group = group.take_while(|state| state.key == key);
    let near = group.filter(|state| !state.is_taken && is_same(&state.normal, normal));
    let best = near.max_by(|a, b| a.normal.dot(normal).total_cmp(&b.normal.dot(normal)))?;
    best.is_taken = true;
    Some(*best)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(key: Key, normal: Vec3) -> Kept {
        Kept {
            key,
            normal,
            forces: [1.0, 1.0],
            opening: 0.0,
            friction: Vec3::new(3.0, 0.0, 4.0),
            stiffness: 2.0,
            stiffened: 0.0,
            overrun: 0.0,
            age: 1,
            is_parting: false,
            anchor: None,
            is_taken: false,
        }
    }

    #[test]
    fn a_state_goes_to_the_contact_in_its_direction_once() {
        let [first, second] = [Key::Vertex(1, 0), Key::Edges([0, 1, 2, 3])];
        let mut all = [
            kept(first, Vec3::z()),
            kept(first, Vec3::x()),
            kept(second, Vec3::z()),
        ];
        let mut from = 0;
        let near_x = Vec3::new(0.8, 0.0, 0.6);
        let mut taken = |key, normal: Vec3| {
            let state = take(&mut all, &mut from, key, &normal);
            state.map(|state| state.normal)
        };
        assert_eq!(taken(Key::Vertex(0, 5), Vec3::z()), None);
        assert_eq!(taken(first, near_x), Some(Vec3::x()));
        assert_eq!(taken(first, near_x), Some(Vec3::z()));
        assert_eq!(taken(first, near_x), None);
        assert_eq!(taken(Key::Vertex(2, 0), Vec3::z()), None);
        assert_eq!(taken(second, -Vec3::z()), None);
        assert_eq!(taken(second, Vec3::z()), Some(Vec3::z()));
    }

    #[test]
    fn a_key_follows_its_vertices() {
        let number = |vertex| (vertex != 4).then(|| 10 - vertex);
        let renumbered = |key: Key| key.renumbered(&number);
        assert_eq!(renumbered(Key::Vertex(3, 1)), Some(Key::Vertex(7, 1)));
        assert_eq!(renumbered(Key::Vertex(4, 1)), None);
        let edges = renumbered(Key::Edges([0, 2, 1, 3]));
        assert_eq!(edges, Some(Key::Edges([7, 9, 8, 10])));
        assert_eq!(renumbered(Key::Edges([0, 4, 1, 3])), None);
    }

    #[test]
    fn a_friction_force_turns_with_the_surface() {
        let state = kept(Key::Vertex(0, 0), Vec3::z());
        assert_eq!(state.friction_across(&Vec3::z()), Vec3::x() * 5.0);
        assert_eq!(
            state.friction_across(&state.friction.normalize()).norm(),
            0.0
        );
        assert_eq!(state.stored(), 6.25);
    }
}
