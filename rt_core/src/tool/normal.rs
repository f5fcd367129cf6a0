//! Normal forces of several contacts: the linear complementarity problem, solved exactly.
//!
//! `w = G l + q`, `w >= 0`, `l >= 0`, `w . l = 0`: gaps `w` (m), normal forces `l` (N), and `G` (m/N) the symmetric and positive
//! semidefinite compliance between the contacts. The method is the dual active set of Goldfarb and Idnani (1983), with principal
//! pivots of `G` in place of their factors: the pivoted matrix holds the direction of each step. Forces are never negative on
//! the way. Each step increases the energy of the contacts, so the method ends, also for planes that are parallel.
//!
//! A contact that is held has `w = 0` and any `l`: it never opens.

use super::MAX_CONTACTS;

/// A gap (m) that counts as closed.
const CLOSED: f64 = 1e-10;
/// The part of a contact's compliance that must be its own, beside that of the contacts that press, for it to press with them: two
/// planes at an angle of less than 0.0003 take turns. Smaller pivots lose digits: with 1e-9, one of 20,000 random sets of
/// planes was wrong.
const OWN: f64 = 1e-7;
/// Largest number of pivots. Random sets of sixteen planes took at most 40.
const STEPS: usize = 8 * MAX_CONTACTS;

/// The problem, and its state between pivots.
#[derive(Clone, Debug)]
pub(super) struct Normals {
    count: usize,
    /// `G`, in which the pivots have exchanged the gap and the force of each contact that presses.
    rows: [[f64; MAX_CONTACTS]; MAX_CONTACTS],
    /// The compliance of each contact alone: the diagonal of `G`.
    own: [f64; MAX_CONTACTS],
    /// The force of each contact that presses, and the gap of each other contact.
    values: [f64; MAX_CONTACTS],
    presses: [bool; MAX_CONTACTS],
    held: [bool; MAX_CONTACTS],
}

impl Normals {
    /// A problem of `count` contacts, with `G` by row and column. Contacts that `pressed` before are tried first, after those that are
    /// `held`.
    pub(super) fn new(
        count: usize,
        rows: &[[f64; MAX_CONTACTS]; MAX_CONTACTS],
        [pressed, held]: [&[bool; MAX_CONTACTS]; 2],
    ) -> Self {
        let mut new = Self {
            count: count.min(MAX_CONTACTS),
            rows: *rows,
            own: [0.0; MAX_CONTACTS],
            values: [0.0; MAX_CONTACTS],
            presses: [false; MAX_CONTACTS],
            held: *held,
        };
        for ((own, row), at) in new.own.iter_mut().zip(&new.rows).zip(0..MAX_CONTACTS) {
            *own = row.get(at).copied().unwrap_or_default();
        }
        for first in [held, pressed] {
            for (is_first, at) in first.iter().zip(0..new.count) {
                let is_closed = new.presses.get(at).is_some_and(|presses| *presses);
                if *is_first && !is_closed && new.yields(at) {
                    new.pivot(at);
                }
            }
        }
        new
    }

    /// The values by `q`, while the same contacts press.
    fn begin(&mut self, gaps: &[f64; MAX_CONTACTS]) {
        let own = self.values.iter_mut().zip(&self.rows).zip(&self.presses);
        for (((value, row), is_force), gap) in own.zip(gaps).take(self.count) {
            let mut sum = if *is_force { 0.0 } else { *gap };
            for ((entry, gap), presses) in row.iter().zip(gaps).zip(&self.presses) {
                sum -= if *presses { entry * gap } else { 0.0 };
            }
            *value = sum;
        }
        // Each exchange opens one contact, so that at most all are opened.
        for _ in 0..self.count {
            let Some(pulling) = self.least(true, 0.0) else {
                break;
            };
            self.exchange(pulling);
        }
    }

    /// Solves the problem for `q`; the contacts that pressed in the last solution are tried first. Returns whether there is a
    /// solution: two planes that face each other may have none.
    pub(super) fn solve(&mut self, gaps: [f64; MAX_CONTACTS]) -> bool {
        self.begin(&gaps);
        let mut steps = 0..STEPS;
        while let Some(entering) = self.least(false, -CLOSED) {
            let mut force = 0.0;
            loop {
                if steps.next().is_none() {
                    return false;
                }
                let closes = if self.yields(entering) {
                    -self.value(entering) / self.at(entering, entering)
                } else {
                    f64::INFINITY
                };
                let (opens, opening) = self.opens(entering);
                if closes <= opens && closes < f64::INFINITY {
                    self.exchange(entering);
                    if let Some(value) = self.values.get_mut(entering) {
                        *value += force;
                    }
                    break;
                }
                let Some(opening) = opening else {
                    return false;
                };
                self.shift(entering, opens);
                force += opens;
                // Its force is zero but for rounding, and so is the gap that it gets.
                self.pivot(opening);
                if let Some(value) = self.values.get_mut(opening) {
                    *value = 0.0;
                }
            }
        }
        true
    }

    /// The normal forces (N).
    pub(super) fn forces(&self) -> impl Iterator<Item = f64> {
        let each = self.values.iter().zip(&self.presses).take(self.count);
        each.map(|(value, presses)| if *presses { *value } else { 0.0 })
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        let row = self.rows.get(row);
        row.and_then(|row| row.get(column))
            .copied()
            .unwrap_or_default()
    }

    fn value(&self, at: usize) -> f64 {
        self.values.get(at).copied().unwrap_or_default()
    }

    /// Whether the gap of a contact grows with its force, while those that press stay closed.
    fn yields(&self, at: usize) -> bool {
        let own = self.own.get(at).copied().unwrap_or_default();
        self.at(at, at) > OWN * own
    }

    /// The contact with the least value below a bound, among those that press or among the others, without those that are held.
    fn least(&self, presses: bool, below: f64) -> Option<usize> {
        let each = self.values.iter().zip(&self.presses).zip(&self.held);
        let each = each
            .zip(0..self.count)
            .filter(|(((value, one), held), _)| !**held && **one == presses && **value < below);
        let least = each.min_by(|(((a, _), _), _), (((b, _), _), _)| a.total_cmp(b));
        least.map(|(_, at)| at)
    }

    /// The increase of the force of a contact at which the first of those that press opens, and that contact.
    fn opens(&self, entering: usize) -> (f64, Option<usize>) {
        let each = self.rows.iter().zip(&self.values).zip(&self.presses);
        let mut found = (f64::INFINITY, None);
        for ((((row, value), presses), held), at) in each.zip(&self.held).zip(0..self.count) {
            let slope = row.get(entering).copied().unwrap_or_default();
            if *presses && !*held && slope < 0.0 {
                let by = value.max(0.0) / -slope;
                if by < found.0 {
                    found = (by, Some(at));
                }
            }
        }
        found
    }

    /// Increases the force, or the gap, that a contact has not got as its value.
    fn shift(&mut self, at: usize, by: f64) {
        for (value, row) in self.values.iter_mut().zip(&self.rows).take(self.count) {
            *value += row.get(at).copied().unwrap_or_default() * by;
        }
    }

    /// Closes a contact, or opens one that presses: its value becomes zero, and is exchanged.
    fn exchange(&mut self, at: usize) {
        let by = -self.value(at) / self.at(at, at);
        self.shift(at, by);
        self.pivot(at);
        if let Some(value) = self.values.get_mut(at) {
            *value = by;
        }
    }

    /// Exchanges the gap and the force of a contact in the rows.
    fn pivot(&mut self, at: usize) {
        let Some(row) = self.rows.get(at).copied() else {
            return;
        };
        let inverse = self.at(at, at).recip();
        let mut others = self.rows.iter_mut().zip(0..self.count);
        for (other, _) in others.by_ref().filter(|(_, number)| *number != at) {
            let factor = other.get(at).copied().unwrap_or_default() * inverse;
            for (entry, own) in other.iter_mut().zip(&row).take(self.count) {
                *entry -= factor * own;
            }
            if let Some(entry) = other.get_mut(at) {
                *entry = factor;
            }
        }
        if let Some(own) = self.rows.get_mut(at) {
            for entry in own.iter_mut().take(self.count) {
                *entry *= -inverse;
            }
            if let Some(entry) = own.get_mut(at) {
                *entry = inverse;
            }
        }
        if let Some(presses) = self.presses.get_mut(at) {
            *presses = !*presses;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    type Square = [[f64; MAX_CONTACTS]; MAX_CONTACTS];
    const NONE: [bool; MAX_CONTACTS] = [false; MAX_CONTACTS];

    /// The compliance of a point on a spring of 3 kN/m between planes, and their gaps. Some planes are nearly parallel.
    fn planes(numbers: &[[f64; 4]], spread: f64) -> (Square, [f64; MAX_CONTACTS]) {
        let normal = |[x, y, _, _]: &[f64; 4]| Vec3::new(x * spread, y * spread, 1.0).normalize();
        let mut rows = [[0.0; MAX_CONTACTS]; MAX_CONTACTS];
        let mut gaps = [0.0; MAX_CONTACTS];
        for (i, one) in numbers.iter().enumerate() {
            for (j, other) in numbers.iter().enumerate() {
                rows[i][j] = normal(one).dot(&normal(other)) / 3000.0;
            }
            gaps[i] = one[2] * 5e-3;
        }
        (rows, gaps)
    }

    /// Checks the conditions of the problem, up to rounding: pivots of nearly parallel planes lose eight digits. No device renders a
    /// gap of 0.1 um.
    fn check(
        count: usize,
        rows: &Square,
        gaps: &[f64; MAX_CONTACTS],
        forces: &[f64],
        held: &[bool; MAX_CONTACTS],
    ) {
        for i in 0..count {
            let gap: f64 = gaps[i] + (0..count).map(|j| rows[i][j] * forces[j]).sum::<f64>();
            let is_closed = gap.abs() < 1e-7;
            let is_open = !held[i] && gap > 0.0 && forces[i] == 0.0;
            assert!(is_closed || is_open, "{i}: {gap} {forces:?}");
            assert!(held[i] || forces[i] >= 0.0, "{i}: {gap} {forces:?}");
        }
    }

    proptest! {
        #[test]
        fn sixteen_planes_are_solved(
            numbers in proptest::collection::vec(proptest::array::uniform4(-1.0..1.0_f64), 1..=MAX_CONTACTS),
            spread in prop_oneof![Just(0.01), Just(0.3), Just(2.0)],
            warm in proptest::array::uniform16(any::<bool>()),
        ) {
            let count = numbers.len();
            let (rows, gaps) = planes(&numbers, spread);
            let mut problem = Normals::new(count, &rows, [&warm, &NONE]);
            prop_assert!(problem.solve(gaps));
            let forces: Vec<f64> = problem.forces().collect();
            check(count, &rows, &gaps, &forces, &NONE);
        }

        #[test]
        fn a_yielding_surface_is_solved(
            factors in proptest::collection::vec(proptest::array::uniform16(-1.0..1.0_f64), MAX_CONTACTS),
            gaps in proptest::array::uniform16(-1e-3..1e-3_f64),
            warm in proptest::array::uniform16(any::<bool>()),
            held in prop_oneof![Just(NONE), proptest::array::uniform16(any::<bool>())],
        ) {
            let mut rows = [[0.0; MAX_CONTACTS]; MAX_CONTACTS];
            for (i, row) in rows.iter_mut().enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    let product = factors[i].iter().zip(&factors[j]).map(|(a, b)| a * b);
                    *entry = product.sum::<f64>() * 1e-4 + f64::from(u8::from(i == j)) * 1e-4;
                }
            }
            let mut problem = Normals::new(MAX_CONTACTS, &rows, [&warm, &held]);
            prop_assert!(problem.solve(gaps));
            let forces: Vec<f64> = problem.forces().collect();
            check(MAX_CONTACTS, &rows, &gaps, &forces, &held);
        }
    }

    #[test]
    fn planes_that_face_each_other_leave_no_room() {
        let mut rows = [[0.0; MAX_CONTACTS]; MAX_CONTACTS];
        rows[0][0] = 1.0;
        rows[1][1] = 1.0;
        (rows[0][1], rows[1][0]) = (-1.0, -1.0);
        let mut gaps = [0.0; MAX_CONTACTS];
        (gaps[0], gaps[1]) = (-1e-3, -1e-3);
        let mut problem = Normals::new(2, &rows, [&NONE; 2]);
        assert!(!problem.solve(gaps));
        // There is room for a force at one of them.
        gaps[1] = 2e-3;
        let mut problem = Normals::new(2, &rows, [&NONE; 2]);
        assert!(problem.solve(gaps));
        assert_eq!(problem.forces().collect::<Vec<_>>(), [1e-3, 0.0]);
    }
}
