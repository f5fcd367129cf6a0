//! The pattern of a Cholesky factor over nodes, and the grouping of its columns into supernodes.
//!
//! A supernode is a run of places whose columns have the same rows below the run. It is stored as one dense block.
//! See J. W. H. Liu, "The role of elimination trees in sparse factorization" (1990), for the tree and the patterns. A
//! small supernode is merged with its parent if the additional zeros cost less time than the separate block ("relaxed
//! amalgamation", C. Ashcraft and R. Grimes, 1989).

use super::block_matrix::BlockMatrix;

/// The overhead of a supernode in a solve, in units of one stored number. It was fitted to the least time, which
/// changes little within a factor of two of this value.
const SUPERNODE: f64 = 300.0;

/// The cost of gathering and scattering each node below a supernode, in the same unit.
const BELOW: f64 = 20.0;

/// A dense block of the factor's columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Supernode {
    /// First place.
    pub first: u32,
    /// One past the last place.
    pub end: u32,
    /// First index into [`Supernodes::below`] of the rows below this supernode.
    pub below_start: u32,
    /// One past the last index into [`Supernodes::below`].
    pub below_end: u32,
}

impl Supernode {
    /// Number of places.
    pub fn width(&self) -> usize {
        (self.end - self.first) as usize
    }

    /// Number of places below.
    pub fn height(&self) -> usize {
        (self.below_end - self.below_start) as usize
    }
}

/// All supernodes, in the order of elimination.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Supernodes {
    /// The blocks, ascending. Together they cover all places.
    pub blocks: Vec<Supernode>,
    /// Places below each block, ascending.
    pub below: Vec<u32>,
}

impl Supernodes {
    /// The places below `block`, ascending.
    pub(crate) fn below_of(&self, block: &Supernode) -> &[u32] {
        &self.below[block.below_start as usize..block.below_end as usize]
    }

    /// Memory of the supernodes (bytes).
    pub fn bytes(&self) -> usize {
        size_of_val(self.blocks.as_slice()) + size_of_val(self.below.as_slice())
    }
}

/// Places below the diagonal in each column of the factor, ascending.
pub(crate) fn columns(matrix: &BlockMatrix, order: &[u32]) -> Vec<Vec<u32>> {
    let count = order.len();
    let mut place = vec![0_u32; count];
    for (at, &node) in order.iter().enumerate() {
        place[node as usize] = at as u32;
    }
    let mut columns: Vec<Vec<u32>> = Vec::with_capacity(count);
    let mut children: Vec<Vec<u32>> = vec![Vec::new(); count];
    let mut seen = vec![u32::MAX; count];
    for (at, &node) in order.iter().enumerate() {
        let mut column = Vec::new();
        let mut add = |other: u32| {
            if other as usize > at && seen[other as usize] != at as u32 {
                seen[other as usize] = at as u32;
                column.push(other);
            }
        };
        matrix
            .free_blocks(node as usize)
            .for_each(|(other, _)| add(place[other]));
        for &child in &children[at] {
            columns[child as usize].iter().for_each(|&other| add(other));
        }
        column.sort_unstable();
        if let Some(&parent) = column.first() {
            children[parent as usize].push(at as u32);
        }
        columns.push(column);
    }
    columns
}

/// A supernode during the merging. The rows below it are those of its last column.
struct Open {
    first: usize,
    end: usize,
}

impl Supernodes {
    /// The supernodes of the factor of `matrix`, whose free nodes are eliminated in `order`.
    pub fn new(matrix: &BlockMatrix, order: &[u32]) -> Self {
        let columns = columns(matrix, order);
        // The rows below a block are those of its last column.
        let cost = |first: usize, end: usize| {
            let (width, height) = ((end - first) as f64, columns[end - 1].len() as f64);
            SUPERNODE + BELOW * height + 9.0 * width * (0.5 * width + height)
        };
        let is_child = |lower: &Open, upper: &Open| {
            columns[lower.end - 1]
                .first()
                .is_some_and(|&parent| (parent as usize) < upper.end)
        };
        let mut open: Vec<Open> = Vec::new();
        for at in 0..columns.len() {
            let mut upper = Open {
                first: at,
                end: at + 1,
            };
            while let Some(lower) = open.last() {
                let exact = columns[lower.end - 1].len()
                    == columns[upper.end - 1].len() + upper.end - upper.first;
                let gain = cost(lower.first, lower.end) + cost(upper.first, upper.end)
                    - cost(lower.first, upper.end);
                if !is_child(lower, &upper) || !(exact || gain > 0.0) {
                    break;
                }
                upper.first = lower.first;
                open.pop();
            }
            open.push(upper);
        }
        let mut supernodes = Self {
            blocks: Vec::with_capacity(open.len()),
            below: Vec::new(),
        };
        for Open { first, end } in open {
            let below_start = supernodes.below.len() as u32;
            supernodes.below.extend_from_slice(&columns[end - 1]);
            supernodes.blocks.push(Supernode {
                first: first as u32,
                end: end as u32,
                below_start,
                below_end: supernodes.below.len() as u32,
            });
        }
        supernodes
    }

    /// Number of entries on and below the diagonal, with three unknowns a node.
    pub fn entries(&self) -> usize {
        let entries = |block: &Supernode| {
            let width = 3 * block.width();
            width * (width + 1) / 2 + width * 3 * block.height()
        };
        self.blocks.iter().map(entries).sum()
    }
}
