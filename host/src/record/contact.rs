//! The contacts of a host step: their sums by pair, and the strongest of them.
//!
//! A side is a number: bodies have the numbers of the scene, and obstacles follow the bodies in the order of the scene.

use super::field::{Cells, Record, Visitor, fields, record};
use super::kind::{Stamp, kind};
use physics::Vec3;

/// Most contacts with places in a message.
pub const MOST_POINTS: usize = 256;

/// The contacts of a host step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactStep {
    /// Number of the host step, from one.
    pub step: u64,
    /// Time at which the step was due (ns).
    pub time_ns: u64,
    /// The first tick that follows the step in the log.
    pub tick: u64,
    /// The sums, by pair of sides that touch, with the pairs in ascending order.
    pub sums: Vec<ContactSum>,
    /// The contacts with the largest forces, at most [`MOST_POINTS`].
    pub points: Vec<ContactPoint>,
}

/// The sum of the contacts between two sides.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactSum {
    /// The sides, ascending.
    pub sides: [u32; 2],
    /// Number of contacts with a force.
    pub count: u32,
    /// Number of contacts that slip.
    pub slipping: u32,
    /// Sum of the sizes of the normal forces (N).
    pub normal: f64,
    /// Sum of the sizes of the friction forces (N).
    pub friction: f64,
    /// The force on the first side (N).
    pub force: Vec3,
    /// The largest depth (m).
    pub depth: f64,
}

/// A contact with its place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactPoint {
    /// The sides.
    pub sides: [u32; 2],
    /// The place on the first side at the start of the step (m).
    pub at: Vec3,
    /// The force on the first side (N).
    pub force: Vec3,
    /// The depth by which the sides overlap (m); not negative.
    pub depth: f64,
}

impl ContactStep {
    /// The stamp of its message.
    pub fn stamp(&self) -> Stamp {
        Stamp {
            body: 0,
            number: Some(self.step as u32),
            time_ns: self.time_ns,
        }
    }

    /// The sum of the contacts between two sides, by their numbers in ascending order; zero if the two do not touch.
    pub fn sum(&self, sides: [u32; 2]) -> ContactSum {
        let found = self.sums.iter().find(|sum| sum.sides == sides);
        let none = ContactSum {
            sides,
            ..ContactSum::default()
        };
        found.copied().unwrap_or(none)
    }
}

kind! { ContactStep: "palpate_msgs/msg/Contacts", Contacts, |_| "/contacts".to_owned();
    fn size(&self) -> usize {
        size_of_val(self.sums.as_slice()) + size_of_val(self.points.as_slice())
    }
}

record! { ContactStep: Self::default();
    "# The contacts of a host step. A side is a number: bodies first, then obstacles, both in the order of the scene.";
    "uint64 step       # number of the host step, from one" step;
    "uint64 time_ns    # the time at which the step was due" time_ns;
    "uint64 tick       # the first tick that follows the step in the log" tick;
    "palpate_msgs/ContactSum[] sums  # by pair of sides that touch" sums: list "sum";
    "palpate_msgs/ContactPoint[] points  # the contacts with the largest forces, at most 256" points: list "point";
}

record! { ContactSum: Self::default();
    "uint32[2] sides   # ascending" sides;
    "uint32 count      # number of contacts with a force" count;
    "uint32 slipping   # number of contacts that slip" slipping;
    "float64 normal    # sum of the sizes of the normal forces (N)" normal;
    "float64 friction  # sum of the sizes of the friction forces (N)" friction;
    "float64[3] force  # force on the first side (N)" force;
    "float64 depth     # the largest depth (m)" depth;
}

record! { ContactPoint: Self::default();
    "uint32[2] sides" sides;
    "float64[3] at     # place on the first side at the start of the step (m)" at;
    "float64[3] force  # force on the first side (N)" force;
    "float64 depth     # by which the sides overlap (m); not negative" depth;
}

/// The columns of a pair of sides.
pub(crate) fn contact_columns(sum: &ContactSum, to: &mut impl Cells) {
    to.number(format_args!("normal_N"), sum.normal);
    to.number(format_args!("friction_N"), sum.friction);
    to.number(format_args!("depth_m"), sum.depth);
    to.whole(format_args!("contacts"), u64::from(sum.count));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Kind;
    use crate::record::cdr::decode;

    #[test]
    fn contacts_are_read_back_and_a_short_message_is_refused() {
        let step = ContactStep {
            step: 12,
            time_ns: 48_000_000,
            tick: 48,
            sums: vec![
                ContactSum {
                    sides: [0, 0],
                    count: 3,
                    ..ContactSum::default()
                },
                ContactSum {
                    sides: [0, 2],
                    count: 7,
                    slipping: 1,
                    normal: 0.25,
                    friction: 0.125,
                    force: Vec3::new(0.1, -0.0, 0.2),
                    depth: 3e-7,
                },
            ],
            points: vec![ContactPoint {
                sides: [2, 0],
                at: Vec3::new(0.01, 0.02, 0.05),
                force: Vec3::new(0.0, 0.0, -0.2),
                depth: 2e-7,
            }],
        };
        assert_eq!(step.sum([0, 2]).count, 7);
        assert_eq!(
            (step.sum([0, 1]).sides, step.sum([0, 1]).count),
            ([0, 1], 0)
        );
        let message = step.clone().message();
        assert_eq!(decode(&message), Some(step));
        for cut in 0..message.len() {
            assert_eq!(decode::<ContactStep>(&message[..cut]), None, "{cut}");
        }
    }
}
