//! Gathering node vectors into arrays over elements, and scattering them back.
//!
//! Elements are grouped in blocks of [`LANES`]. The data of a block are stored by component: the same component of
//! all its elements side by side. The work on a block is a loop over its lanes whose body is plain arithmetic on one
//! element. The compiler turns the loop into vector instructions of the width that the machine has. It may neither
//! reorder sums nor contract a product and a sum, so every width gives the same bytes.

use super::{Node, Real};

/// Elements in a block. The values of a block fill two (f32) or four (f64) of the widest vector registers.
pub const LANES: usize = 32;

/// One number for each element of a block.
pub type Lanes<T> = [T; LANES];

/// Number of elements among which the next one is chosen.
const WINDOW: usize = 128;
/// Number of preceding elements with which the next one should have no node in common.
const APART: usize = 8;

/// `M` vectors for each element of a block, padded like nodes. Component `i` of vector `a` of element `lane` is
/// `[a][lane][i]`.
pub type Vectors<T, const M: usize> = [[Node<T>; LANES]; M];

/// Sets `differences` to the vectors `of` at each element's last `M = N - 1` nodes minus the vector at its first node.
#[inline(always)]
pub(crate) fn gather<T: Real, const N: usize, const M: usize>(
    nodes: &[[u32; N]; LANES],
    of: &[Node<T>],
    differences: &mut Vectors<T, M>,
) {
    for lane in 0..LANES {
        let nodes = &nodes[lane];
        let first = of[nodes[0] as usize];
        for a in 0..M {
            differences[a][lane] = less(of[nodes[a + 1] as usize], first);
        }
    }
}

/// Adds `vectors` to the vectors `to` at each element's last `M = N - 1` nodes, and subtracts their sum from the vector
/// at its first node.
#[inline(always)]
pub(crate) fn scatter<T: Real, const N: usize, const M: usize>(
    nodes: &[[u32; N]; LANES],
    vectors: &Vectors<T, M>,
    to: &mut [Node<T>],
) {
    for lane in 0..LANES {
        let nodes = nodes[lane].map(|node| node as usize);
        let mut sum = vectors[0][lane];
        to[nodes[1]] = plus(to[nodes[1]], sum);
        for a in 1..M {
            let vector = vectors[a][lane];
            to[nodes[a + 1]] = plus(to[nodes[a + 1]], vector);
            sum = plus(sum, vector);
        }
        to[nodes[0]] = less(to[nodes[0]], sum);
    }
}

/// The vectors of one element, as rows. The padding, which is zero, is read as well: if one entry in four is skipped,
/// the compiler processes the last lanes one by one.
#[inline(always)]
pub(crate) fn vectors_at<T: Real, const M: usize>(
    vectors: &Vectors<T, M>,
    lane: usize,
) -> [[T; 3]; M] {
    let mut rows = [[T::ZERO; 3]; M];
    for a in 0..M {
        let node = &vectors[a][lane];
        rows[a] = [node[0] + node[3], node[1], node[2]];
    }
    rows
}

/// A vector, padded like a node.
#[inline(always)]
pub(crate) fn node<T: Real>(v: [T; 3]) -> Node<T> {
    [v[0], v[1], v[2], T::ZERO]
}

/// The 3 x 3 matrix of one element, stored row by row.
#[inline(always)]
pub(crate) fn at<T: Real>(rows: &[Lanes<T>; 9], lane: usize) -> [[T; 3]; 3] {
    let mut m = [[T::ZERO; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            m[i][j] = rows[3 * i + j][lane];
        }
    }
    m
}

/// Sets row `a` of the matrix of one element.
#[inline(always)]
pub(crate) fn put<T: Real>(rows: &mut [Lanes<T>; 9], lane: usize, a: usize, value: [T; 3]) {
    for i in 0..3 {
        rows[3 * a + i][lane] = value[i];
    }
}

/// The quaternion of one element.
#[inline(always)]
pub(crate) fn quaternion_at<T: Real>(rows: &[Lanes<T>; 4], lane: usize) -> [T; 4] {
    [rows[0][lane], rows[1][lane], rows[2][lane], rows[3][lane]]
}

/// The sum over all lanes.
#[inline(always)]
pub(crate) fn sum<T: Real>(lanes: &Lanes<T>) -> T {
    let mut sum = T::ZERO;
    for &lane in lanes {
        sum += lane;
    }
    sum
}

#[inline(always)]
pub(crate) fn plus<T: Real>(a: Node<T>, b: Node<T>) -> Node<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]]
}

#[inline(always)]
pub(crate) fn less<T: Real>(a: Node<T>, b: Node<T>) -> Node<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3]]
}

/// An order of `count` elements in which nearby elements have none of their `nodes` in common, as far as possible.
/// Sums into nodes then need not wait for each other. The order stays near the given one.
pub(crate) fn apart<'a, const N: usize>(
    count: usize,
    nodes: impl Fn(usize) -> &'a [u32; N],
) -> Vec<usize> {
    let mut order = Vec::with_capacity(count);
    let mut window: Vec<usize> = (0..count.min(WINDOW)).collect();
    let mut next = window.len();
    while !window.is_empty() {
        let recent = &order[order.len().saturating_sub(APART)..];
        let apart = |&element: &usize| {
            let touches = |&other: &usize| nodes(element).iter().any(|n| nodes(other).contains(n));
            !recent.iter().any(touches)
        };
        let chosen = window.iter().position(apart).unwrap_or(0);
        order.push(window.remove(chosen));
        if next < count {
            window.push(next);
            next += 1;
        }
    }
    order
}
