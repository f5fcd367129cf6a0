//! A sparse matrix of scalars times node vectors: the derivatives across edges from nodes, and back.

use crate::element::torn::make_room;
use crate::lanes::block::{less, plus};
use crate::lanes::{Node, Real};
#[cfg(not(palpate_one_version))]
use multiversion::multiversion;

/// A constant matrix of scalars in compressed rows.
#[derive(Clone, Debug)]
pub(crate) struct ScalarMatrix<T> {
    row_start: Vec<u32>,
    columns: Vec<u32>,
    weights: Vec<T>,
}

impl<T> Default for ScalarMatrix<T> {
    fn default() -> Self {
        Self {
            row_start: vec![0],
            columns: Vec::new(),
            weights: Vec::new(),
        }
    }
}

impl<T: Real> ScalarMatrix<T> {
    /// Adds a row of columns and weights.
    pub(crate) fn push(&mut self, row: impl Iterator<Item = (u32, T)>) {
        for (column, weight) in row {
            self.columns.push(column);
            self.weights.push(weight);
        }
        self.row_start.push(self.columns.len() as u32);
    }

    /// Adds a row with room for `room` entries. The entries that are not used repeat the first column without weight.
    pub(crate) fn push_roomy(&mut self, row: impl Iterator<Item = (u32, T)>, room: usize) {
        let start = self.columns.len();
        self.columns.resize(start + room, 0);
        self.weights.resize(start + room, T::ZERO);
        self.row_start.push(self.columns.len() as u32);
        self.set_row(self.rows() - 1, row);
    }

    /// The number of entries for which a row has room.
    pub(crate) fn room(&self, row: usize) -> usize {
        (self.row_start[row + 1] - self.row_start[row]) as usize
    }

    /// Replaces the entries of a row, as many as it has room for.
    pub(crate) fn set_row(&mut self, row: usize, entries: impl Iterator<Item = (u32, T)>) {
        let range = self.row_start[row] as usize..self.row_start[row + 1] as usize;
        let (columns, weights) = (&mut self.columns[range.clone()], &mut self.weights[range]);
        let mut count = 0;
        for ((column, weight), entry) in columns.iter_mut().zip(weights.iter_mut()).zip(entries) {
            (*column, *weight) = entry;
            count += 1;
        }
        let first = columns.first().copied().unwrap_or_default();
        columns[count..].fill(first);
        weights[count..].fill(T::ZERO);
    }

    /// Makes room for `rows` rows and `entries` entries in all.
    pub(crate) fn make_room(&mut self, rows: usize, entries: usize) {
        make_room(&mut self.row_start, rows + 1);
        make_room(&mut self.columns, entries);
        make_room(&mut self.weights, entries);
    }

    /// The columns of a row and their weights.
    pub(crate) fn row(&self, row: usize) -> impl Iterator<Item = (u32, T)> + '_ {
        let range = self.row_start[row] as usize..self.row_start[row + 1] as usize;
        let columns = self.columns[range.clone()].iter().copied();
        columns.zip(self.weights[range].iter().copied())
    }

    /// Replaces each column by its place.
    pub(crate) fn renumber(&mut self, place: &[u32]) {
        for column in &mut self.columns {
            *column = place[*column as usize];
        }
    }

    /// The matrix with its weights in another precision.
    pub(crate) fn converted<U: Real>(&self) -> ScalarMatrix<U> {
        ScalarMatrix {
            row_start: self.row_start.clone(),
            columns: self.columns.clone(),
            weights: self.weights.iter().map(|w| U::of(w.to_f64())).collect(),
        }
    }

    /// The transpose, with `rows` rows.
    pub(crate) fn transposed(&self, rows: usize) -> Self {
        let mut entries: Vec<(u32, u32, T)> = Vec::with_capacity(self.columns.len());
        for (row, ends) in (0_u32..).zip(self.row_start.windows(2)) {
            let range = ends[0] as usize..ends[1] as usize;
            let weights = self.weights[range.clone()].iter();
            let columns = self.columns[range].iter();
            entries.extend(columns.zip(weights).map(|(&c, &weight)| (c, row, weight)));
        }
        entries.sort_unstable_by_key(|&(column, row, _)| (column, row));
        let starts = 0..=rows as u32;
        let start = |row: u32| entries.partition_point(|entry| entry.0 < row) as u32;
        Self {
            row_start: starts.map(start).collect(),
            columns: entries.iter().map(|entry| entry.1).collect(),
            weights: entries.iter().map(|entry| entry.2).collect(),
        }
    }

    /// Becomes the transpose of `matrix`, with `rows` rows, in the order of [`transposed`](Self::transposed). Entries without
    /// weight are left out. Nothing is allocated if there is [room](Self::make_room).
    pub(crate) fn transpose(&mut self, matrix: &Self, rows: usize) {
        // The number of entries of each row, then the end of each row, and then, as the rows fill from behind, its start.
        self.row_start.clear();
        self.row_start.resize(rows + 1, 0);
        for (&column, &weight) in matrix.columns.iter().zip(&matrix.weights) {
            if weight != T::ZERO {
                self.row_start[column as usize] += 1;
            }
        }
        let mut end = 0;
        for start in &mut self.row_start {
            end += *start;
            *start = end;
        }
        self.columns.clear();
        self.columns.resize(end as usize, 0);
        self.weights.clear();
        self.weights.resize(end as usize, T::ZERO);
        for row in (0..matrix.rows()).rev() {
            for (column, weight) in matrix.row(row) {
                if weight != T::ZERO {
                    let start = &mut self.row_start[column as usize];
                    *start -= 1;
                    self.columns[*start as usize] = row as u32;
                    self.weights[*start as usize] = weight;
                }
            }
        }
    }

    /// Where its arrays are in memory.
    #[cfg(test)]
    pub(crate) fn addresses(&self) -> [usize; 3] {
        [
            self.row_start.as_ptr().addr(),
            self.columns.as_ptr().addr(),
            self.weights.as_ptr().addr(),
        ]
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.row_start.len() - 1
    }

    /// Number of entries.
    pub(crate) fn entries(&self) -> usize {
        self.columns.len()
    }

    /// Memory of the matrix (bytes).
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.row_start.as_slice())
            + size_of_val(self.columns.as_slice())
            + size_of_val(self.weights.as_slice())
    }
}

/// Sets `y` to the product with `u`. The weights of a row sum to zero, so that the vectors of `u` are taken relative to
/// the first of the row: this keeps the digits of small differences.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx2+bmi1+bmi2"))
)]
pub(crate) fn differences<T: Real>(matrix: &ScalarMatrix<T>, u: &[Node<T>], y: &mut [Node<T>]) {
    for (ends, y) in matrix.row_start.windows(2).zip(y) {
        let range = ends[0] as usize..ends[1] as usize;
        let mut sum = [T::ZERO; 4];
        let mut entries = matrix.columns[range.clone()]
            .iter()
            .zip(&matrix.weights[range]);
        if let Some((&first, _)) = entries.next() {
            let first = u[first as usize];
            for (&column, &weight) in entries {
                let difference = less(u[column as usize], first);
                sum = plus(sum, difference.map(|c| weight * c));
            }
        }
        *y = sum;
    }
}

/// Sets `y` to the product with `u`. The error is one rounding of the common part of `u`, which does no harm if `u` is
/// a change of a step.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx2+bmi1+bmi2"))
)]
pub(crate) fn set_product<T: Real>(matrix: &ScalarMatrix<T>, u: &[Node<T>], y: &mut [Node<T>]) {
    for (ends, y) in matrix.row_start.windows(2).zip(y) {
        *y = row(matrix, ends, u);
    }
}

/// Adds the product with `u` to `y`.
#[cfg_attr(
    not(palpate_one_version),
    multiversion(targets("x86_64+avx2+bmi1+bmi2"))
)]
pub(crate) fn add_product<T: Real>(matrix: &ScalarMatrix<T>, u: &[Node<T>], y: &mut [Node<T>]) {
    for (ends, y) in matrix.row_start.windows(2).zip(y) {
        *y = plus(*y, row(matrix, ends, u));
    }
}

/// The row between two `ends` times `u`.
#[inline(always)]
fn row<T: Real>(matrix: &ScalarMatrix<T>, ends: &[u32], u: &[Node<T>]) -> Node<T> {
    let range = ends[0] as usize..ends[1] as usize;
    let mut sum = [T::ZERO; 4];
    let columns = &matrix.columns[range.clone()];
    for (&column, &weight) in columns.iter().zip(&matrix.weights[range]) {
        let u = &u[column as usize];
        for i in 0..4 {
            sum[i] += weight * u[i];
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transpose_made_in_place_is_the_transpose_without_the_entries_of_no_weight() {
        let rows = [vec![(2, 1.0), (0, 2.0)], vec![], vec![(2, 3.0), (4, 4.0)]];
        let (mut roomy, mut exact) = (ScalarMatrix::<f64>::default(), ScalarMatrix::default());
        for row in &rows {
            roomy.push_roomy(row.iter().copied(), row.len() + 2);
            exact.push(row.iter().copied());
        }
        let expected = exact.transposed(5);
        let mut found = ScalarMatrix::default();
        found.make_room(5, roomy.entries());
        let before = found.addresses();
        // The second time it replaces the first.
        for _ in 0..2 {
            found.transpose(&roomy, 5);
            assert_eq!(found.row_start, expected.row_start);
            assert_eq!(found.columns, expected.columns);
            assert_eq!(found.weights, expected.weights);
        }
        assert_eq!(found.addresses(), before);
    }
}
