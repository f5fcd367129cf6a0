//! A symmetric sparse matrix of 3 x 3 blocks on a fixed pattern.
//!
//! Rows and columns are [places](Places): the free nodes first, the handle nodes last. Both triangles are stored, and
//! the columns of a row ascend. The product with the free part of a vector therefore uses a prefix of each row, the product with the
//! handle part the rest. One pointer per row marks the split.

use super::places::Places;
use crate::{Mat3, Vec3};

/// The slots of the blocks of an element with `N` nodes in the matrix, by row and column.
pub type ElementSlots<const N: usize> = [[u32; N]; N];

/// A symmetric matrix of 3 x 3 blocks in compressed block rows.
///
/// ```
/// use physics::{BlockMatrix, Mat3, Vec3};
///
/// // Two free nodes and a handle node, in a chain.
/// let chain: [&[u32]; 2] = [&[0, 1], &[1, 2]];
/// let mut matrix = BlockMatrix::new(3, 2, chain.into_iter());
/// if let Some(slot) = matrix.slot(0, 1) {
///     matrix.add(slot, &Mat3::from_diagonal_element(2.0));
/// }
/// assert_eq!(matrix.slot(0, 2), None);
/// let x = [Vec3::zeros(), Vec3::x(), Vec3::zeros()];
/// assert_eq!(matrix.row_product(0, &x), Vec3::new(2.0, 0.0, 0.0));
/// ```
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    free: usize,
    row_start: Vec<u32>,
    /// First entry of each row whose column is a handle node.
    row_split: Vec<u32>,
    columns: Vec<u32>,
    blocks: Vec<Mat3>,
}

#[inline(always)]
fn add_product(sum: &mut [f64; 3], block: &Mat3, x: &Vec3) {
    let b = &block.data.0;
    for i in 0..3 {
        sum[i] += b[0][i] * x.x + b[1][i] * x.y + b[2][i] * x.z;
    }
}

impl BlockMatrix {
    /// A zero matrix over `nodes` nodes, the first `free` of them free, that couples every two nodes of
    /// each of `cliques` (and every node with itself).
    pub fn new<'a>(nodes: usize, free: usize, cliques: impl Iterator<Item = &'a [u32]>) -> Self {
        let mut rows: Vec<Vec<u32>> = (0..nodes as u32).map(|node| vec![node]).collect();
        for clique in cliques {
            for &node in clique {
                rows[node as usize].extend_from_slice(clique);
            }
        }
        Self::from_rows(free, rows)
    }

    /// A zero matrix over `places` that couples every two nodes of each of `cliques`, and every node with itself.
    pub(crate) fn with_places<'a>(
        places: &Places,
        cliques: impl Iterator<Item = &'a [u32]>,
    ) -> Self {
        let place = places.of_nodes();
        let mut rows: Vec<Vec<u32>> = (0..place.len() as u32).map(|place| vec![place]).collect();
        for clique in cliques {
            for &node in clique {
                let row = &mut rows[place[node as usize] as usize];
                row.extend(clique.iter().map(|&other| place[other as usize]));
            }
        }
        Self::from_rows(places.free(), rows)
    }

    /// A zero matrix with these columns in each row, in any order and repeated or not.
    fn from_rows(free: usize, mut rows: Vec<Vec<u32>>) -> Self {
        let nodes = rows.len();
        let mut matrix = Self {
            free,
            row_start: Vec::with_capacity(nodes + 1),
            row_split: Vec::with_capacity(nodes),
            columns: Vec::new(),
            blocks: Vec::new(),
        };
        matrix.row_start.push(0);
        for row in &mut rows {
            row.sort_unstable();
            row.dedup();
            let split = row.partition_point(|&column| (column as usize) < free);
            matrix.row_split.push((matrix.columns.len() + split) as u32);
            matrix.columns.extend_from_slice(row);
            matrix.row_start.push(matrix.columns.len() as u32);
        }
        matrix.blocks = vec![Mat3::zeros(); matrix.columns.len()];
        matrix
    }

    /// Memory of the matrix (bytes).
    pub fn bytes(&self) -> usize {
        size_of_val(self.row_start.as_slice())
            + size_of_val(self.row_split.as_slice())
            + size_of_val(self.columns.as_slice())
            + size_of_val(self.blocks.as_slice())
    }

    /// Number of nodes: free nodes and handle nodes.
    pub fn nodes(&self) -> usize {
        self.row_split.len()
    }

    /// Number of free nodes.
    pub fn free(&self) -> usize {
        self.free
    }

    /// Number of stored blocks.
    pub fn block_count(&self) -> usize {
        self.columns.len()
    }

    /// The slot of block (`row`, `column`), or `None` if the pattern lacks the block.
    pub fn slot(&self, row: u32, column: u32) -> Option<u32> {
        let start = self.row_start[row as usize] as usize;
        let end = self.row_start[row as usize + 1] as usize;
        let offset = self.columns[start..end].binary_search(&column).ok()?;
        Some((start + offset) as u32)
    }

    /// The slots of the blocks of an element, or `None` if the pattern lacks one of them.
    pub fn element_slots<const N: usize>(&self, nodes: [u32; N]) -> Option<ElementSlots<N>> {
        let mut slots = [[0; N]; N];
        for a in 0..N {
            for b in 0..N {
                slots[a][b] = self.slot(nodes[a], nodes[b])?;
            }
        }
        Some(slots)
    }

    /// Sets every block to zero.
    pub fn clear(&mut self) {
        self.blocks.fill(Mat3::zeros());
    }

    /// A zero matrix of the same pattern over renumbered nodes: node `i` becomes `place[i]`. Free nodes stay free.
    pub(crate) fn renumbered(&self, place: &[u32]) -> Self {
        let mut cliques = Vec::with_capacity(self.columns.len());
        for row in 0..self.nodes() {
            let (columns, _) = self.row(row);
            let pair = |&column: &u32| [place[row], place[column as usize]];
            cliques.extend(columns.iter().map(pair));
        }
        Self::new(
            self.nodes(),
            self.free,
            cliques.iter().map(<[u32; 2]>::as_slice),
        )
    }

    /// A zero matrix of the same pattern, with `more` free nodes after the free nodes. These couple to none.
    pub(crate) fn widened(&self, more: usize) -> Self {
        let at = |node: usize| if node < self.free { node } else { node + more } as u32;
        let mut cliques = Vec::with_capacity(self.columns.len());
        for row in 0..self.nodes() {
            let (columns, _) = self.row(row);
            cliques.extend(columns.iter().map(|&column| [at(row), at(column as usize)]));
        }
        let cliques = cliques.iter().map(<[u32; 2]>::as_slice);
        Self::new(self.nodes() + more, self.free + more, cliques)
    }

    /// Adds a matrix of the same pattern.
    pub(crate) fn add_all(&mut self, other: &Self) {
        for (block, other) in self.blocks.iter_mut().zip(&other.blocks) {
            *block += other;
        }
    }

    /// Blocks of a row, with the columns (counted over all nodes).
    pub(crate) fn blocks(&self, row: usize) -> impl Iterator<Item = (usize, &Mat3)> {
        self.entries(self.row_start[row], self.row_start[row + 1])
    }

    /// Adds to the block stored at `slot`.
    #[inline]
    pub fn add(&mut self, slot: u32, block: &Mat3) {
        self.blocks[slot as usize] += block;
    }

    /// Adds a symmetric matrix in the rows and columns `nodes`, which are at most `N` and ascend. Its block (j, k) is
    /// `block(row(j), k)`, computed for `j <= k`. A block that the pattern lacks is left out.
    pub(crate) fn add_symmetric<const N: usize, R>(
        &mut self,
        nodes: &[u32],
        row: impl Fn(usize) -> R,
        block: impl Fn(&R, usize) -> Mat3,
    ) {
        let mut slots = [[u32::MAX; N]; N];
        for (&row, slots) in nodes.iter().zip(&mut slots) {
            let (columns, start) = self.row(row as usize);
            let mut offset = 0;
            for (&column, slot) in nodes.iter().zip(slots) {
                while columns.get(offset).is_some_and(|&c| c < column) {
                    offset += 1;
                }
                if columns.get(offset) == Some(&column) {
                    *slot = (start + offset) as u32;
                }
            }
        }
        for j in 0..nodes.len().min(N) {
            let row = row(j);
            for k in j..nodes.len().min(N) {
                let block = block(&row, k);
                if let Some(own) = self.blocks.get_mut(slots[j][k] as usize) {
                    *own += block;
                }
                if let Some(mirror) = self.blocks.get_mut(slots[k][j] as usize)
                    && j != k
                {
                    *mirror += block.transpose();
                }
            }
        }
    }

    /// Columns of a row, with the slot of the first.
    pub fn row(&self, row: usize) -> (&[u32], usize) {
        let start = self.row_start[row] as usize;
        (
            &self.columns[start..self.row_start[row + 1] as usize],
            start,
        )
    }

    fn entries(&self, start: u32, end: u32) -> impl Iterator<Item = (usize, &Mat3)> {
        let range = start as usize..end as usize;
        self.columns[range.clone()]
            .iter()
            .map(|&column| column as usize)
            .zip(&self.blocks[range])
    }

    /// Blocks of a row in free columns, with the columns.
    pub fn free_blocks(&self, row: usize) -> impl Iterator<Item = (usize, &Mat3)> {
        self.entries(self.row_start[row], self.row_split[row])
    }

    /// Blocks of a row in handle columns, with the columns (counted over all nodes).
    pub fn handle_blocks(&self, row: usize) -> impl Iterator<Item = (usize, &Mat3)> {
        self.entries(self.row_split[row], self.row_start[row + 1])
    }

    /// The diagonal block of a row.
    pub fn diagonal(&self, row: usize) -> Mat3 {
        self.slot(row as u32, row as u32)
            .map_or_else(Mat3::zeros, |slot| self.blocks[slot as usize])
    }

    /// Row `row` times `x`, over all nodes.
    #[inline]
    pub fn row_product(&self, row: usize, x: &[Vec3]) -> Vec3 {
        self.row_product_of(row, |column| &x[column])
    }

    /// Row `row` times the vector whose part at each column is `x`.
    #[inline]
    pub(crate) fn row_product_of<'a>(&self, row: usize, x: impl Fn(usize) -> &'a Vec3) -> Vec3 {
        let mut sum = [0.0; 3];
        for (column, block) in self.entries(self.row_start[row], self.row_start[row + 1]) {
            add_product(&mut sum, block, x(column));
        }
        Vec3::from(sum)
    }

    /// The free part of row `row` times `x`, over free nodes.
    #[inline]
    pub fn free_product(&self, row: usize, x: &[Vec3]) -> Vec3 {
        let mut sum = [0.0; 3];
        for (column, block) in self.free_blocks(row) {
            add_product(&mut sum, block, &x[column]);
        }
        Vec3::from(sum)
    }

    /// The whole matrix times `x`.
    ///
    /// `x` and `y` hold one entry per node.
    pub fn product(&self, x: &[Vec3], y: &mut [Vec3]) {
        for (row, y) in y.iter_mut().enumerate().take(self.nodes()) {
            *y = self.row_product(row, x);
        }
    }
}
