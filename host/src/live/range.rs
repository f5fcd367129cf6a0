//! The least and the greatest value of a quantity over some ticks.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The least and the greatest value. JSON has the two numbers as an array, and `null` for a range without values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The least value.
    pub least: f64,
    /// The greatest value.
    pub most: f64,
}

impl Default for Range {
    /// A range without values.
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Range {
    /// A range without values.
    pub const EMPTY: Self = Self {
        least: f64::INFINITY,
        most: f64::NEG_INFINITY,
    };

    /// The range that contains `value` only. A value that is not finite gives a range without values.
    pub fn of(value: f64) -> Self {
        let mut range = Self::EMPTY;
        range.take(value);
        range
    }

    /// Whether the range contains no value.
    pub fn is_empty(&self) -> bool {
        self.least > self.most
    }

    /// Widens the range to contain `value`. A value that is not finite is ignored.
    pub fn take(&mut self, value: f64) {
        if value.is_finite() {
            self.least = self.least.min(value);
            self.most = self.most.max(value);
        }
    }

    /// Widens the range to contain `other`.
    pub fn merge(&mut self, other: &Self) {
        self.least = self.least.min(other.least);
        self.most = self.most.max(other.most);
    }
}

impl Serialize for Range {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let values = (!self.is_empty()).then_some([self.least, self.most]);
        values.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Range {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let values = Option::<[f64; 2]>::deserialize(deserializer)?;
        Ok(values.map_or(Self::EMPTY, |[least, most]| Self { least, most }))
    }
}
