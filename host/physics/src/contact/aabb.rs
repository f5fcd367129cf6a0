//! Boxes along the axes.

use crate::Vec3;

/// A box along the axes (m).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// The corner with the smallest coordinates.
    pub least: [f64; 3],
    /// The corner with the largest coordinates.
    pub most: [f64; 3],
}

impl Default for Aabb {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Aabb {
    /// The box that contains nothing.
    pub const EMPTY: Self = Self {
        least: [f64::INFINITY; 3],
        most: [f64::NEG_INFINITY; 3],
    };

    /// The box of some points.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |mut all, point| {
            all.add(point);
            all
        })
    }

    /// Includes a point.
    pub fn add(&mut self, point: &Vec3) {
        for axis in 0..3 {
            self.least[axis] = self.least[axis].min(point[axis]);
            self.most[axis] = self.most[axis].max(point[axis]);
        }
    }

    /// The smallest box that contains both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            least: core::array::from_fn(|i| self.least[i].min(other.least[i])),
            most: core::array::from_fn(|i| self.most[i].max(other.most[i])),
        }
    }

    /// The box with its faces moved outwards by `by` (m).
    #[must_use]
    pub fn grown(&self, by: f64) -> Self {
        Self {
            least: self.least.map(|x| x - by),
            most: self.most.map(|x| x + by),
        }
    }

    /// Whether the boxes have a point in common.
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|i| self.least[i] <= other.most[i] && other.least[i] <= self.most[i])
    }

    /// Whether a point of one box is as near as `distance` (m) to a point of the other one.
    pub fn is_within(&self, other: &Self, distance: f64) -> bool {
        let mut squared = 0.0;
        for i in 0..3 {
            let gap = (self.least[i] - other.most[i]).max(other.least[i] - self.most[i]);
            squared += gap.max(0.0) * gap.max(0.0);
        }
        squared <= distance * distance
    }

    /// Half the area of the faces (m²).
    pub fn half_area(&self) -> f64 {
        let [x, y, z] = core::array::from_fn(|i| self.most[i] - self.least[i]);
        x * y + y * z + z * x
    }

    /// The axis along which the box is longest.
    pub fn longest_axis(&self) -> usize {
        let length = |axis: usize| self.most[axis] - self.least[axis];
        let longer = |best: usize, axis: usize| {
            if length(axis) > length(best) {
                axis
            } else {
                best
            }
        };
        (0..3).fold(0, longer)
    }
}
