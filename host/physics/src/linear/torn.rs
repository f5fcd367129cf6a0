//! The preconditioner of a sheet that has torn since its factor was made.
//!
//! The new nodes have no place in the old factor. Let `S` tie each new node to the place where it was: a copy to its
//! twin, the node of a cut edge to the ends of the edge. Let `Z` be the motions of the new nodes alone. In the
//! hierarchical basis `[S Z]` the matrix `A` of the torn sheet is
//!
//! ```text
//! [ A_old   B ]      B = S^T A Z        D = Z^T A Z
//! [ B^T     D ]
//! ```
//!
//! up to the bending of opened edges and the lumping of masses. Its inverse is that of a block elimination
//! (H. Yserentant, "On the multi-level splitting of finite element spaces", 1986, for the basis; Y.-H. Yeung,
//! J. Crouch and A. Pothen, "Interactively cutting and constraining vertices in meshes using augmented matrices", 2016,
//! for cuts beside an old factor):
//!
//! ```text
//! S A_old^-1 S^T + X Sigma^-1 X^T       X = Z - S A_old^-1 B       Sigma = Z^T A X
//! ```
//!
//! The columns `X` and the Cholesky factor of the small `Sigma` are kept. An edit computes the columns of its own
//! nodes and of the nodes at which these are tied, three solves with the old factor each. The motions of other nodes, and
//! with them the columns, stay the same functions over the sheet: only their rows of `Sigma` change. All matrices are those
//! at the state of the factor, because the Schur complement of two different states may be indefinite. The sum is positive definite for any `X`
//! and any positive definite `Sigma`. Errors of the old factor therefore cost iterations only.
//!
//! Nodes past the capacity have their own blocks alone.

use super::vectors;
use crate::lanes::{Node, Real};
use crate::{Mat3, Vec3};

/// Blocks that a row of the matrix may have. A row of a sheet that bends has about twenty. Further blocks are left out,
/// which costs iterations only.
const MOST_BLOCKS: usize = 48;

/// A freedom with a pivot of `Sigma` below this fraction of its own block is left alone with that block. Errors of the old
/// factor and vertices that snapped, whose triangles the old factor has in other shapes, can make `Sigma` indefinite. A
/// tiny pivot would blow up all later rows. The last vertex that joins a piece to the sheet has a pivot of about a
/// thousandth: only the mass of the piece resists. Without this pivot a step in which a piece comes off took 40 to 80
/// iterations.
const LEAST_PIVOT: f64 = 1e-5;

/// Where a new node was before the sheet tore: at `fraction` of the way from one place to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tie {
    /// The places of the ends. An end may be a new node with a smaller place, or a held node.
    pub ends: [u32; 2],
    /// 0 at the first end, 1 at the second.
    pub fraction: f64,
}

impl Tie {
    /// The tie of a copy of the node at place `of`.
    pub fn copy(of: u32) -> Self {
        Self {
            ends: [of; 2],
            fraction: 0.0,
        }
    }

    fn weights(&self) -> [(usize, f32); 2] {
        let second = self.fraction as f32;
        [
            (self.ends[0] as usize, 1.0 - second),
            (self.ends[1] as usize, second),
        ]
    }
}

/// The row of a new node in the matrix at the factor's state.
#[derive(Clone, Debug)]
struct Row {
    /// Places with their blocks.
    blocks: Vec<(u32, Mat3)>,
    /// Whether the row has changed since `Sigma` was computed, and whether the columns have to be computed anew.
    changed: bool,
    is_due: bool,
    /// The mass of the node in the matrix (kg/s^2), as far as it was given.
    mass: f64,
}

/// New nodes beside an old factor. Their places follow those of the factor.
#[derive(Clone, Debug)]
pub struct TornFactor {
    /// Number of places of the factor.
    old: usize,
    /// Number of new nodes with columns.
    capacity: usize,
    ties: Vec<Tie>,
    /// The free axes of each new node: 1 free, 0 guided.
    free: Vec<[f32; 3]>,
    rows: Vec<Row>,
    /// Column after column, each over all places.
    columns: Vec<Node<f32>>,
    /// Places of a column, with those of nodes still to come.
    stride: usize,
    /// `Sigma`, and its Cholesky factor below the diagonal, by rows of `3 capacity` numbers.
    sigma: Vec<f64>,
    lower: Vec<f64>,
    /// The inverses of the blocks of nodes past the capacity.
    own: Vec<Mat3>,
    /// Room for a vector over the places and one over the columns.
    work: Vec<Node<f32>>,
    small: Vec<f64>,
}

/// `sum += factor * node`, over the three axes.
#[inline(always)]
fn add_times(sum: &mut Node<f32>, factor: f32, node: &Node<f32>) {
    for i in 0..4 {
        sum[i] += factor * node[i];
    }
}

impl TornFactor {
    /// Room for `most` new nodes beside a factor of `old` places, `capacity` of them with columns.
    pub fn new(old: usize, most: usize, capacity: usize) -> Self {
        let capacity = capacity.min(most);
        let row = || Row {
            blocks: Vec::with_capacity(MOST_BLOCKS),
            changed: false,
            is_due: false,
            mass: 0.0,
        };
        let (stride, size) = (old + most, 3 * capacity);
        Self {
            old,
            capacity,
            ties: Vec::with_capacity(most),
            free: Vec::with_capacity(most),
            rows: (0..most).map(|_| row()).collect(),
            columns: vec![[0.0; 4]; stride * size],
            stride,
            sigma: vec![0.0; size * size],
            lower: vec![0.0; size * size],
            own: vec![Mat3::zeros(); most],
            work: vec![[0.0; 4]; stride],
            small: vec![0.0; size],
        }
    }

    /// Number of new nodes.
    pub fn count(&self) -> usize {
        self.ties.len()
    }

    /// Number of new nodes for which there is room.
    pub fn most(&self) -> usize {
        self.rows.len()
    }

    /// Number of new nodes with columns: as many as have room.
    fn joined(&self) -> usize {
        self.count().min(self.capacity)
    }

    /// Memory (bytes).
    pub fn bytes(&self) -> usize {
        size_of_val(self.columns.as_slice())
            + 2 * size_of_val(self.sigma.as_slice())
            + self.rows.len() * (MOST_BLOCKS * size_of::<(u32, Mat3)>() + size_of::<Row>())
            + size_of_val(self.own.as_slice())
            + size_of_val(self.work.as_slice())
    }

    /// Adds a new node at the next place. `free` is 1 for each axis that is free and 0 for each that a support guides.
    /// Returns whether there was room. The row of the node has still to be given.
    pub fn push(&mut self, tie: Tie, free: &Vec3) -> bool {
        let at = self.count();
        if at >= self.most() {
            return false;
        }
        self.ties.push(tie);
        self.free
            .push([free.x as f32, free.y as f32, free.z as f32]);
        // `S` has a row more: the columns of earlier nodes move the new node with the places where it is tied. The columns
        // of nodes that are such places are given anew.
        let place = self.old + at;
        for column in 0..3 * at.min(self.capacity) {
            let start = self.column_start(column);
            let column = &mut self.columns[start..start + self.stride];
            let mut own = [0.0; 4];
            for (end, weight) in tie.weights() {
                if weight != 0.0 && end < place {
                    let from = column[end];
                    add_times(&mut own, weight, &from);
                }
            }
            for i in 0..3 {
                own[i] *= self.free[at][i];
            }
            column[place] = own;
        }
        for (end, weight) in tie.weights() {
            if weight != 0.0 && end >= self.old {
                self.begin(end - self.old);
            }
        }
        self.begin(at);
        true
    }

    /// Empties the row of a new node, counted from the first, so that it is given anew, and its columns are computed.
    /// Other numbers are ignored.
    pub fn begin(&mut self, node: usize) {
        self.renew(node);
        let count = self.count();
        if let Some(row) = self.rows[..count].get_mut(node) {
            row.is_due = true;
        }
    }

    /// Empties the row of a new node, so that it is given anew; its columns are kept. This serves if edges were opened
    /// or divided beside the node, and no vertex moved at rest.
    pub fn renew(&mut self, node: usize) {
        let count = self.count();
        if let Some(row) = self.rows[..count].get_mut(node) {
            row.blocks.clear();
            row.changed = true;
        }
    }

    /// Whether the row of the new node at `place` is being given.
    pub fn takes(&self, place: usize) -> bool {
        let node = place.wrapping_sub(self.old);
        node < self.count() && self.rows[node].changed
    }

    /// Adds to the block (`row`, `column`) of the matrix at the factor's state. Blocks of other rows than those that
    /// are being given are ignored.
    pub fn add(&mut self, row: usize, column: usize, block: &Mat3) {
        if !self.takes(row) {
            return;
        }
        let blocks = &mut self.rows[row - self.old].blocks;
        let found = blocks
            .iter()
            .position(|(other, _)| *other as usize == column);
        match found {
            Some(at) => blocks[at].1 += block,
            None if blocks.len() < MOST_BLOCKS => blocks.push((column as u32, *block)),
            None => {}
        }
    }

    /// Adds the mass of the new node at `place`, as it is in the matrix (kg/s^2), to its row.
    pub fn add_mass(&mut self, place: usize, mass: f64) {
        if self.takes(place) {
            self.rows[place - self.old].mass = mass;
            self.add(place, place, &(Mat3::identity() * mass));
        }
    }

    /// Computes the columns of the rows that were given. `solve` solves with the old factor in place, and `mask` has the
    /// free axes of the old places, or nothing if all are free.
    pub fn update<T: Real>(&mut self, mask: &[Node<T>], mut solve: impl FnMut(&mut [Node<f32>])) {
        let joined = self.joined();
        let Some(first) = self.rows[..self.count()].iter().position(|row| row.changed) else {
            return;
        };
        for node in first..joined {
            if self.rows[node].is_due {
                for axis in 0..3 {
                    self.make_column(node, axis, mask, &mut solve);
                }
            }
        }
        for node in joined..self.count() {
            if self.rows[node].changed {
                self.own[node] = self
                    .own_block(node)
                    .try_inverse()
                    .unwrap_or_else(Mat3::zeros);
            }
        }
        for node in 0..joined {
            for other in 0..=node {
                if self.rows[node].changed || self.rows[other].changed {
                    self.make_sigma(node, other);
                }
            }
        }
        for row in &mut self.rows {
            (row.changed, row.is_due) = (false, false);
        }
        self.eliminate(3 * first, 3 * joined);
    }

    /// The diagonal block of a new node, without its guided axes.
    fn own_block(&self, node: usize) -> Mat3 {
        let place = (self.old + node) as u32;
        let block = self.rows[node]
            .blocks
            .iter()
            .find(|(other, _)| *other == place);
        let mut block = block.map_or_else(Mat3::zeros, |(_, block)| *block);
        for axis in 0..3 {
            if self.free[node][axis] == 0.0 {
                block.fill_row(axis, 0.0);
                block.fill_column(axis, 0.0);
                block[(axis, axis)] = 1.0;
            }
        }
        block
    }

    /// Computes the column of an axis of a new node: `Z - S A_old^-1 S^T A Z`.
    fn make_column<T: Real>(
        &mut self,
        node: usize,
        axis: usize,
        mask: &[Node<T>],
        solve: &mut impl FnMut(&mut [Node<f32>]),
    ) {
        let mut work = core::mem::take(&mut self.work);
        let end = self.old + self.count();
        work.fill([0.0; 4]);
        if self.free[node][axis] != 0.0 {
            for (place, block) in &self.rows[node].blocks {
                // The matrix is symmetric: its column is its row.
                if let Some(entry) = work[..end].get_mut(*place as usize) {
                    for i in 0..3 {
                        entry[i] -= block[(axis, i)] as f32;
                    }
                }
            }
            self.gather(&mut work);
            vectors::filter(mask, &mut work[..self.old]);
            solve(&mut work[..self.old]);
            vectors::filter(mask, &mut work[..self.old]);
            self.spread(&mut work);
            work[self.old + node][axis] += 1.0;
        }
        let column = self.column_start(3 * node + axis);
        self.columns[column..column + self.stride].copy_from_slice(&work);
        self.work = work;
    }

    fn column_start(&self, column: usize) -> usize {
        column * self.stride
    }

    /// `S^T` in place: the forces on new nodes act where they are tied.
    fn gather(&self, r: &mut [Node<f32>]) {
        for (node, tie) in self.ties.iter().enumerate().rev() {
            let own = r[self.old + node];
            for (end, weight) in tie.weights() {
                if weight != 0.0 && end < self.old + node {
                    add_times(&mut r[end], weight, &own);
                }
            }
        }
    }

    /// `S` in place: new nodes move with the places where they are tied, along their free axes.
    fn spread(&self, y: &mut [Node<f32>]) {
        for (node, tie) in self.ties.iter().enumerate() {
            let mut own = [0.0; 4];
            for (end, weight) in tie.weights() {
                if weight != 0.0 && end < self.old + node {
                    add_times(&mut own, weight, &y[end]);
                }
            }
            for i in 0..3 {
                own[i] *= self.free[node][i];
            }
            y[self.old + node] = own;
        }
    }

    /// Computes the blocks of `Sigma` between two nodes, from the rows that have changed.
    fn make_sigma(&mut self, node: usize, other: usize) {
        let mut block = Mat3::zeros();
        for axis in 0..3 {
            for along in 0..3 {
                let of = |row: usize, i: usize, column: usize, j: usize| {
                    let start = self.column_start(3 * column + j);
                    let column = &self.columns[start..start + self.stride];
                    let mut sum = 0.0;
                    for (place, block) in &self.rows[row].blocks {
                        if let Some(x) = column.get(*place as usize) {
                            for k in 0..3 {
                                sum += block[(i, k)] * f64::from(x[k]);
                            }
                        }
                    }
                    sum
                };
                // The two differ by the error of the old factor.
                let sum = of(node, axis, other, along) + of(other, along, node, axis);
                block[(axis, along)] = 0.5 * sum;
            }
        }
        let size = 3 * self.capacity;
        for axis in 0..3 {
            for along in 0..3 {
                let (row, column) = (3 * node + axis, 3 * other + along);
                let is_guided = self.free[node][axis] * self.free[other][along] == 0.0;
                self.sigma[row * size + column] = match is_guided {
                    true if row == column => 1.0,
                    true => 0.0,
                    false => block[(axis, along)],
                };
            }
        }
    }

    /// The Cholesky factor of `Sigma`, from row `first` on (Golub and Van Loan, "Matrix computations", section 4.2).
    fn eliminate(&mut self, first: usize, end: usize) {
        let size = 3 * self.capacity;
        for row in first..end {
            for column in 0..=row {
                let (above, below) = self.lower.split_at_mut(row * size);
                let (own, mut sum) = (&mut below[..size], self.sigma[row * size + column]);
                if column == row {
                    for k in 0..row {
                        sum -= own[k] * own[k];
                    }
                    let block = self.rows[row / 3].blocks.iter();
                    let place = (self.old + row / 3) as u32;
                    let diagonal = block.filter(|(other, _)| *other == place);
                    let diagonal = diagonal.map(|(_, block)| block[(row % 3, row % 3)]);
                    let whole = diagonal.fold(self.rows[row / 3].mass, f64::max);
                    // The comparison takes a pivot that is no number for a bad one, too.
                    if sum > LEAST_PIVOT * whole {
                        own[row] = libm::sqrt(sum);
                    } else {
                        own[..row].fill(0.0);
                        own[row] = libm::sqrt(whole.max(f64::MIN_POSITIVE));
                    }
                } else {
                    let other = &above[column * size..][..=column];
                    for k in 0..column {
                        sum -= own[k] * other[k];
                    }
                    own[column] = sum / other[column];
                }
            }
        }
    }

    /// Applies the preconditioner in place to `r`, the residual at the old places and at those of the new nodes. `solve`
    /// and `mask` are those of [`update`](Self::update).
    pub fn apply<T: Real>(
        &mut self,
        r: &mut [Node<f32>],
        mask: &[Node<T>],
        solve: impl FnOnce(&mut [Node<f32>]),
    ) {
        let end = self.old + self.count();
        let (joined, size) = (3 * self.joined(), 3 * self.capacity);
        for column in 0..joined {
            let start = self.column_start(column);
            self.small[column] = vectors::dot_single(&self.columns[start..start + end], &r[..end]);
        }
        for row in 0..joined {
            let lower = &self.lower[row * size..][..=row];
            let mut sum = self.small[row];
            for (l, x) in lower[..row].iter().zip(&self.small) {
                sum -= l * x;
            }
            self.small[row] = sum / lower[row];
        }
        for row in (0..joined).rev() {
            let lower = &self.lower[row * size..][..=row];
            let x = self.small[row] / lower[row];
            self.small[row] = x;
            for (l, sum) in lower[..row].iter().zip(&mut self.small) {
                *sum -= l * x;
            }
        }
        // Nodes past the capacity, by their own blocks.
        let past = self.joined()..self.count();
        let alone = |node: usize| {
            let r = &r[self.old + node];
            let load = Vec3::new(f64::from(r[0]), f64::from(r[1]), f64::from(r[2]));
            self.own[node] * load
        };
        for node in past.clone() {
            let u = alone(node);
            self.work[self.old + node] = [u.x as f32, u.y as f32, u.z as f32, 0.0];
        }
        self.gather(&mut r[..end]);
        vectors::filter(mask, &mut r[..self.old]);
        solve(&mut r[..self.old]);
        vectors::filter(mask, &mut r[..self.old]);
        self.spread(&mut r[..end]);
        for node in past {
            let own = self.work[self.old + node];
            add_times(&mut r[self.old + node], 1.0, &own);
        }
        for column in 0..joined {
            let start = self.column_start(column);
            let x = &self.columns[start..start + end];
            vectors::add_single(self.small[column] as f32, x, r);
        }
    }
}
