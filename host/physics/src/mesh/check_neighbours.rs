//! The checks of how the cells of a solid meet: at most two at a face, one on either side of it, and one middle
//! on each edge.

use super::Cells;
use super::check_solid::SolidError;
use super::tet::MIDSIDE_ENDS;

/// The corners of each face, counted around its outward normal.
const FACES: [[usize; 3]; 4] = [[0, 1, 3], [1, 2, 3], [0, 3, 2], [0, 2, 1]];

/// Checks that no two cells lie on one side of a face. At most two cells then meet at a face.
pub(super) fn check_faces(cells: &Cells) -> Result<(), SolidError> {
    let mut faces = Vec::with_capacity(4 * cells.len());
    for (cell, all) in (0_u32..).zip(cells.vertices()) {
        for corners in FACES {
            let (face, turned) = sorted(corners.map(|corner| all[corner]));
            faces.push((face, turned, cell));
        }
    }
    faces.sort_unstable();
    let meet = faces.windows(2).filter_map(|pair| match *pair {
        [(face, side, first), (other, other_side, cell)] => {
            ((face, side) == (other, other_side)).then_some((cell, first, face))
        }
        _ => None,
    });
    match meet.min() {
        Some((cell, first, face)) => Err(SolidError::Overlap { cell, first, face }),
        None => Ok(()),
    }
}

/// Three vertices in ascending order, and whether their cyclic order was descending.
fn sorted([a, b, c]: [u32; 3]) -> ([u32; 3], bool) {
    let mut ascending = [a, b, c];
    ascending.sort_unstable();
    // A cyclic shift preserves the orientation. Start with the least vertex.
    let next = match ascending[0] {
        least if least == a => b,
        least if least == b => c,
        _ => a,
    };
    (ascending, next != ascending[1])
}

/// Checks that each edge has one vertex at its middle, and that this vertex is the middle of no other edge and the
/// corner of no cell.
pub(super) fn check_midsides(cells: &[[u32; 10]], vertices: usize) -> Result<(), SolidError> {
    const NONE: u32 = u32::MAX;
    let mut corner_of = vec![NONE; vertices];
    for (cell, all) in (0_u32..).zip(cells) {
        for &corner in &all[..4] {
            if corner_of[corner as usize] == NONE {
                corner_of[corner as usize] = cell;
            }
        }
    }
    let mut edges = Vec::with_capacity(6 * cells.len());
    for (cell, all) in (0_u32..).zip(cells) {
        for (&vertex, [a, b]) in all[4..].iter().zip(MIDSIDE_ENDS) {
            let corner_of = corner_of[vertex as usize];
            if corner_of != NONE {
                return Err(SolidError::MiddleIsCorner {
                    cell,
                    vertex,
                    corner_of,
                });
            }
            edges.push(([all[a].min(all[b]), all[a].max(all[b])], vertex, cell));
        }
    }
    edges.sort_unstable();
    let two = edges.windows(2).filter_map(|pair| match *pair {
        [(ends, m, first), (other, n, cell)] if ends == other && m != n => {
            Some((first, cell, ends, [m, n]))
        }
        _ => None,
    });
    if let Some((first, cell, ends, [m, n])) = two.min_by_key(|two| two.0.max(two.1)) {
        let swapped = first > cell;
        return Err(SolidError::TwoMiddles {
            cell: first.max(cell),
            first: first.min(cell),
            ends,
            middles: if swapped { [n, m] } else { [m, n] },
        });
    }
    edges.sort_unstable_by_key(|&(ends, vertex, cell)| (vertex, cell, ends));
    let shared = edges.windows(2).filter_map(|pair| match *pair {
        [(ends, m, first), (other, n, cell)] if m == n && ends != other => {
            Some((cell, first, m, other))
        }
        _ => None,
    });
    match shared.min() {
        Some((cell, first, vertex, ends)) => Err(SolidError::SharedMiddle {
            cell,
            first,
            vertex,
            ends,
        }),
        None => Ok(()),
    }
}
