//! The reverse Cuthill-McKee order: neighbours lie near each other, level by level from one end of the mesh.
//!
//! The first node is an approximate end of the longest of all shortest paths through the mesh (A. George and
//! J. W. H. Liu, "An implementation of a pseudoperipheral node finder", 1979). The other nodes follow by their
//! distance from it, nodes with fewer neighbours first.

use crate::linear::block_matrix::BlockMatrix;

/// Number of searches for an end of the mesh.
const SEARCHES: usize = 3;

/// Appends the nodes that `start` reaches to `order`, breadth first, and marks them with `mark`. Nodes that have this
/// mark already are omitted.
fn reach(matrix: &BlockMatrix, start: u32, mark: u32, marks: &mut [u32], order: &mut Vec<u32>) {
    let first = order.len();
    let degree = |node: u32| matrix.free_blocks(node as usize).count();
    order.push(start);
    marks[start as usize] = mark;
    let mut next = first;
    while let Some(&node) = order.get(next) {
        next += 1;
        let begin = order.len();
        for (other, _) in matrix.free_blocks(node as usize) {
            if marks[other] != mark {
                marks[other] = mark;
                order.push(other as u32);
            }
        }
        order[begin..].sort_by_key(|&node| (degree(node), node));
    }
}

/// The free node at each place.
pub fn order(matrix: &BlockMatrix) -> Vec<u32> {
    let free = matrix.free();
    let mut order = Vec::with_capacity(free);
    let mut found = Vec::with_capacity(free);
    // The number of times that each node has been reached. Each part of the mesh is searched equally often.
    let mut marks = vec![0; free];
    for node in 0..free as u32 {
        if marks[node as usize] != 0 {
            continue;
        }
        let mut start = node;
        for search in 1..=SEARCHES {
            found.clear();
            reach(matrix, start, search as u32, &mut marks, &mut found);
            start = found.last().copied().unwrap_or(start);
        }
        reach(matrix, start, SEARCHES as u32 + 1, &mut marks, &mut order);
    }
    order.reverse();
    order
}
